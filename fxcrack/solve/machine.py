"""What the machine has: memory and a name."""

from __future__ import annotations

import os
import platform
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
