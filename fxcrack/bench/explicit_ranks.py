"""Speed of explicit dynamics on several ranks, beside processes that share nothing.

    mpirun -n 2 python -m fxcrack.bench.explicit_ranks 54k 127k

In one run, one after the other and repeatedly: rank 0 alone with the whole mesh while the others
sleep, every rank with a whole mesh of its own, and all ranks with one mesh. The fastest of each
counts, in seconds that pass. What processes that share nothing gain over one is what memory and
cores of the machine allow; the gain of one mesh on all ranks belongs beside it.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from mpi4py import MPI

from fxcrack.base.errors import InputError
from fxcrack.bench.explicit import CASES, Case, run

_NAP = 0.01  # seconds between looks of ranks that wait; a waiting MPI call would take a core


def compare(
    case: Case, comm: MPI.Intracomm, *, repeat: int = 3, increments: int | None = None
) -> dict[str, Any]:
    """Gains over one rank of all ranks on one mesh, and of as many processes; collective.

    Args:
        case: The mesh.
        comm: Two ranks or more.
        repeat: How often each is measured; the fastest counts.
        increments: Of a stretch of each run; for about 0.1 s by default.

    Raises:
        InputError: There is one rank only, or a number is not positive.
    """
    if comm.size < 2 or repeat < 1:
        raise InputError("bench explicit_ranks: start it with two ranks or more, repeat at least 1")

    def milliseconds(own: MPI.Intracomm) -> float:
        return float(run(case, own, increments=increments)["ms_per_increment_wall"])

    alone, apart, together = [], [], []
    for _ in range(repeat):
        alone.append(milliseconds(MPI.COMM_SELF) if comm.rank == 0 else 0.0)
        _arrive_quietly(comm)
        apart.append(milliseconds(MPI.COMM_SELF))
        _arrive_quietly(comm)
        together.append(milliseconds(comm))
    one = comm.bcast(min(alone))
    slowest = comm.allreduce(min(apart), op=MPI.MAX)
    return {
        "case": case.name,
        "ranks": comm.size,
        "ms_one": one,
        "ms_apart": slowest,
        "ms_together": min(together),
        "gain_apart": comm.size * one / slowest,
        "gain_together": one / min(together),
    }


def _arrive_quietly(comm: MPI.Intracomm) -> None:
    """Wait for all ranks without taking a core; collective."""
    request = comm.Ibarrier()
    while not request.Test():
        time.sleep(_NAP)


def main() -> None:
    """Measure the cases that are named; rank 0 prints a line of JSON for each."""
    comm = MPI.COMM_WORLD
    for name in sys.argv[1:] or ["54k"]:
        if name not in CASES:
            raise InputError(f"'{name}' is none of the meshes; take some of {', '.join(CASES)}")
        result = compare(CASES[name], comm)
        if comm.rank == 0:
            print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()


__all__ = ["compare"]
