"""What the machine does in a second: dense algebra, messages, ranks that share nothing."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from mpi4py import MPI

from fxcrack.base.parallel import slowest
from fxcrack.equilibrium.growing_cholesky import GrowingCholesky

Result = dict[str, Any]


def dense_rate(n: int = 1500) -> Result:
    """Seconds of the dense algebra: a factor per n^3, a release with equilibrium per n^2."""
    rng = np.random.default_rng(0)
    base = rng.standard_normal((n, n))
    matrix = base @ base.T + n * np.eye(n)
    cholesky = GrowingCholesky(matrix)
    start = time.perf_counter()
    cholesky.append(np.arange(n - 60))
    factor = time.perf_counter() - start
    start = time.perf_counter()
    for i in range(n - 60, n, 3):
        cholesky.append(np.arange(i, i + 3))
        cholesky.solve(matrix[cholesky.free, 0])
    each = (time.perf_counter() - start) / 20
    return {"factor_per_cube": factor / (n - 60) ** 3, "release_per_square": each / n**2}


def message_rate(comm: MPI.Intracomm) -> Result:
    """Latency and seconds per byte between ranks; collective; zeros on one rank."""
    if comm.size == 1:
        return {"latency": 0.0, "per_byte": 0.0}
    seconds = []
    for size in (8, 4_000_000):
        block = np.zeros(size // 8)
        comm.Allreduce(MPI.IN_PLACE, block)
        comm.Barrier()
        count = 200 if size < 100 else 10
        start = time.perf_counter()
        for _ in range(count):
            comm.Allreduce(MPI.IN_PLACE, block)
        seconds.append(slowest(comm, time.perf_counter() - start) / count)
    return {"latency": seconds[0], "per_byte": max(seconds[1] - seconds[0], 0.0) / 4e6}


def unshared_rate(comm: MPI.Intracomm, n: int = 4_000_000) -> Result:
    """Seconds of work that needs no message, all ranks at once; collective.

    On P ranks that have a core and a path to memory each it takes what it takes on one. What it
    takes longer bounds the gain of any program from P ranks of this machine.

    Args:
        comm: The ranks.
        n: Numbers in each of the three arrays of the triad; far more than the caches hold.

    Returns:
        Seconds of a pass over memory ("memory") and of a dense product from the caches ("caches").
    """
    a, b, c = np.zeros(n), np.ones(n), np.ones(n)
    block = np.ones((300, 300))
    seconds = {}
    for name in ("memory", "caches"):
        times = []
        for _ in range(10):
            comm.Barrier()
            start = time.perf_counter()
            if name == "memory":
                np.multiply(b, 3.0, out=a)
                np.add(a, c, out=a)
            else:
                for _ in range(20):
                    np.matmul(block, block)
            times.append(slowest(comm, time.perf_counter() - start))
        seconds[name] = float(np.median(times))
    return seconds
