"""An error on one rank ends the whole job.

Left alone, an uncaught exception on one rank leaves the others waiting for it for ever. What the
user asked for (:class:`~fxcrack.base.signals.Interrupted`, Ctrl-C) is one line and no traceback.
"""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType

from mpi4py import MPI

from fxcrack.base import together
from fxcrack.base.errors import FxcrackError, raise_on_all_ranks
from fxcrack.base.signals import Interrupted

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


def slowest(comm: MPI.Intracomm, seconds: float) -> float:
    """The largest of the ranks' times; collective."""
    return float(comm.allreduce(seconds, op=MPI.MAX))


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
    together.install()


@contextmanager
def all_or_none(
    comm: MPI.Comm, task: str, kind: type[FxcrackError] = FxcrackError
) -> Iterator[None]:
    """Let all ranks fail if one of them fails inside; collective.

    The block itself must not communicate; what ranks do in it may differ.

    Args:
        comm: Communicator on which all ranks enter.
        task: What is being done, the beginning of the message.
        kind: Class of the exception.

    Raises:
        FxcrackError: The block raised on some rank; its own exception is the cause there.
    """
    together.check_same_call(comm, task)
    cause: Exception | None = None
    try:
        yield
    except Exception as error:  # any exception must reach the other ranks
        cause = error
    name = "" if isinstance(cause, FxcrackError) else f"{type(cause).__name__}: "
    problem = None if cause is None else f"{task}: {name}{cause}"
    try:
        raise_on_all_ranks(comm, problem, kind)
    except FxcrackError as error:
        raise error from cause
