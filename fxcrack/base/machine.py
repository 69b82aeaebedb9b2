"""What the machine has: memory and a name."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from pathlib import Path

from mpi4py import MPI


def machine_memory_mb(comm: MPI.Intracomm) -> float:
    """Memory of all machines the ranks run on, MB, inf if unknown; collective."""
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    mine = _memory() if node.rank == 0 else 0.0
    node.Free()
    return float(comm.allreduce(mine))


def _memory() -> float:
    found = []
    limit = Path("/sys/fs/cgroup/memory.max")  # a container may have less than its machine
    if limit.exists():
        text = limit.read_text().strip()
        if text.isdigit():
            found.append(float(text) / 1e6)
    try:
        found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e6)
    except (ValueError, OSError, AttributeError):
        pass
    return min(found, default=float("inf"))


def machine_name() -> str:
    """Processor, cores and memory in words."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    return f"{model}, {os.cpu_count()} cores, {_memory() / 1000.0:.0f} GB"


# what a launcher tells its processes must not reach the processes of another launcher
_LAUNCHER = ("PMI", "HYD", "MPIR_", "MPICH_", "OMPI_", "PRTE_", "OPAL_", "ORTE_", "MPI_LOCAL")
_KEPT = ("OMPI_MCA_btl", "OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM")


def launcher() -> str | None:
    """The mpiexec that belongs to this Python's environment, else the one on PATH, if any."""
    near = Path(sys.executable).parent / "mpiexec"
    return str(near) if near.exists() else shutil.which("mpiexec")


def command(module: str, words: list[str], ranks: int) -> list[str] | None:
    """Command line that runs a module with this Python.

    Returns:
        ``None`` if several ranks are asked for and no launcher is there.
    """
    python = [sys.executable, "-m", module, *words]
    if ranks == 1:
        return python
    found = launcher()
    return None if found is None else [found, "-n", str(ranks), *python]


def environment() -> dict[str, str]:
    """This process's environment, without what its own launcher left in it.

    More ranks than cores are allowed, also in Open MPI (4 and 5). Linear algebra runs on one thread
    per rank unless OMP_NUM_THREADS says otherwise: ranks share the cores.
    """
    found = {k: v for k, v in os.environ.items() if k in _KEPT or not k.startswith(_LAUNCHER)}
    found.setdefault("OMP_NUM_THREADS", "1")
    found["OMPI_MCA_rmaps_base_oversubscribe"] = "1"
    found["PRTE_MCA_rmaps_default_mapping_policy"] = ":oversubscribe"
    return found
