"""An error on one rank ends the whole job.

Left alone, an uncaught exception on one rank leaves the others waiting for it for ever. What the
user asked for (:class:`~fxcrack.interrupt.Interrupted`, Ctrl-C) is one line and no traceback.
"""

from __future__ import annotations

import sys
import time
import traceback
from types import TracebackType

from mpi4py import MPI

from fxcrack.interrupt import Interrupted

PATIENCE = 3.0
"""Seconds an interrupted rank waits for the others."""

_HAND_ON = 0.5
"""Seconds mpiexec gets to hand on what was written: an abort may overtake it."""

_ordinary = sys.excepthook


def all_arrive(comm: MPI.Intracomm, patience: float) -> bool:
    """Whether all ranks call this within so many seconds; collective if they do."""
    deadline = time.monotonic() + patience
    arrived = comm.Ibarrier()
    while not arrived.Test():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.001)
    return True


def end_all(comm: MPI.Intracomm, code: int) -> None:
    """End all ranks, once what was written has had time to arrive."""
    sys.stdout.flush()
    sys.stderr.flush()
    time.sleep(_HAND_ON)
    comm.Abort(code)


def _abort(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Print the error and end all ranks."""
    comm = MPI.COMM_WORLD
    sys.stdout.flush()
    if isinstance(error, Interrupted):
        if comm.rank == 0:
            print(f"fxcrack: {error}", file=sys.stderr, flush=True)
        if comm.size > 1 and not all_arrive(comm, PATIENCE):
            end_all(comm, error.code)
        raise SystemExit(error.code)
    if comm.size == 1:
        _ordinary(kind, error, trace)
        return
    if kind is KeyboardInterrupt:
        sys.stderr.write(f"rank {comm.rank} of {comm.size}: interrupted\n")
        end_all(comm, 130)
    text = "".join(traceback.format_exception(kind, error, trace))
    sys.stderr.write(f"rank {comm.rank} of {comm.size}:\n{text}")
    end_all(comm, 1)


def install() -> None:
    """End all ranks on an uncaught exception; on one rank only interruptions look different."""
    sys.excepthook = _abort
