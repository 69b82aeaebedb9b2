"""Starting processes of their own, on one rank or several, from a process that uses MPI itself."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

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
