"""What the machine has, and what this process takes of it: processor, cores, memory."""

from __future__ import annotations

import os
import platform
import resource
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
        text = limit.read_text(encoding="ascii").strip()
        if text.isdigit():
            found.append(float(text) / 1e6)
    try:
        found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e6)
    except (ValueError, OSError, AttributeError):
        pass
    return min(found, default=float("inf"))


def processor() -> str:
    """Name of the processor, of its architecture where the system does not tell."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def machine_name() -> str:
    """Processor, cores and memory in words."""
    return f"{processor()}, {os.cpu_count()} cores, {_memory() / 1000.0:.0f} GB"


def cores() -> int:
    """Number of cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def threads_share_cores(comm: MPI.Comm) -> str:
    """Why ranks wait for each other's threads of linear algebra, in words; "" if they do not.

    OpenBLAS and MKL start as many threads as a process may use cores, unless the environment
    limits them; those of one rank then take the cores of the others. Not collective.
    """
    limited = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    if comm.size == 1 or cores() == 1 or any(os.environ.get(name) for name in limited):
        return ""
    return f"each of {comm.size} ranks may start {cores()} threads of linear algebra"


def peak_memory(comm: MPI.Intracomm) -> float:
    """Highest resident size of every rank's process so far, summed over ranks, MB; collective."""
    return float(comm.allreduce(_peak()))


def _peak() -> float:
    """Highest resident size of this process, MB."""
    status = Path("/proc/self/status")
    if status.exists():
        # not getrusage: a process started by a large one inherits that one's maximum there
        lines = [line.split() for line in status.read_text(encoding="utf-8").splitlines()]
        return next(float(line[1]) for line in lines if line[0] == "VmHWM:") * 1024.0 / 1e6
    unit = 1e6 if sys.platform == "darwin" else 1e6 / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def reset_peak_memory() -> bool:
    """Let the highest resident size start again from the present one; whether that works."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return False
    return True
