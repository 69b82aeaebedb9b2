"""Work that may fail on some ranks only: then it fails on all of them, and nobody waits."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from mpi4py import MPI

from fxcrack.errors import FxcrackError, agree


@contextmanager
def together(comm: MPI.Comm, task: str) -> Iterator[None]:
    """Let all ranks fail if one of them fails inside; collective.

    The block itself must not communicate; what ranks do in it may differ.

    Args:
        comm: Communicator on which all ranks enter.
        task: What is being done, the beginning of the message.

    Raises:
        FxcrackError: The block raised on some rank; its own exception is the cause there.
    """
    cause: Exception | None = None
    try:
        yield
    except Exception as error:  # whatever it is, the other ranks must hear of it
        cause = error
    problem = None if cause is None else f"{task}: {type(cause).__name__}: {cause}"
    try:
        agree(comm, problem, FxcrackError)
    except FxcrackError as error:
        raise error from cause
