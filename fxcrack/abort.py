"""An error on one rank ends the whole job.

Left alone, an uncaught exception on one rank leaves the others waiting for it for ever.
"""

from __future__ import annotations

import sys
import traceback
from types import TracebackType

from mpi4py import MPI


def _abort(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Print the error and end all ranks."""
    comm = MPI.COMM_WORLD
    sys.stdout.flush()
    text = "".join(traceback.format_exception(kind, error, trace))
    sys.stderr.write(f"rank {comm.rank} of {comm.size}:\n{text}")
    sys.stderr.flush()
    comm.Abort(1)


def install() -> None:
    """End all ranks on an uncaught exception; does nothing on one rank."""
    if MPI.COMM_WORLD.size > 1:
        sys.excepthook = _abort
