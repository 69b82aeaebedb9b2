"""Rank-0 logging under the name ``fxcrack``; configured only when a program asks for it.

A record has the name of the module that wrote it, ``fxcrack.solvers.newton`` for example, so that
``logging.getLogger("fxcrack.solvers")`` is the logger of all solvers; the lines of progress are
those of ``fxcrack.progress``.
"""

from __future__ import annotations

import logging
import sys
from collections import deque
from itertools import count
from typing import TextIO

from mpi4py import MPI

from fxcrack.base.errors import InputError

logger = logging.getLogger("fxcrack")
progress = logging.getLogger("fxcrack.progress")

MOST_KEPT = 500
"""Warnings kept for reports; a process that warns more often loses the oldest."""
_said: deque[tuple[int, str]] = deque(maxlen=MOST_KEPT)
_numbers = count(1)
_LEVELS = ("debug", "info", "warning", "error")


def n_warned() -> int:
    """Number of warnings of this process so far."""
    return _said[-1][0] if _said else 0


def warned_since(number: int) -> list[str]:
    """Warnings of this process after the first ``number``, in order, each text once."""
    return list(dict.fromkeys(text for n, text in _said if n > number))


def _write(level: int, message: str, args: tuple[object, ...]) -> None:
    """Log once, on rank 0 of the world, in the name of the module two calls up."""
    if MPI.COMM_WORLD.rank == 0:
        name = str(sys._getframe(2).f_globals.get("__name__", "fxcrack"))
        logging.getLogger(name).log(level, message, *args, stacklevel=3)


def debug(message: str, *args: object) -> None:
    """Log what a solver did, once, on rank 0 of the world."""
    _write(logging.DEBUG, message, args)


def info(message: str, *args: object) -> None:
    """Log once, on rank 0 of the world."""
    _write(logging.INFO, message, args)


def warn(message: str, *args: object) -> None:
    """Warn once, on rank 0 of the world; :func:`warned_since` keeps what was said."""
    _said.append((next(_numbers), message % args if args else message))
    _write(logging.WARNING, message, args)


def tell_progress(line: str) -> None:
    """Give one line of progress to the handlers of the log; to stderr where there are none.

    Args:
        line: The line; on the rank that calls, which is to be one.
    """
    if progress.hasHandlers():
        progress.info("%s", line)
    else:
        print(line, file=sys.stderr, flush=True)


class _Stderr(logging.StreamHandler[TextIO]):
    """Writes to what ``sys.stderr`` is at the time, so that a line of progress is not torn."""

    def __init__(self) -> None:
        logging.Handler.__init__(self)

    @property
    def stream(self) -> TextIO:  # type: ignore[override]
        """The present stderr."""
        return sys.stderr


def level_of(level: int | str) -> int:
    """Number of a level.

    Args:
        level: "debug", "info", "warning", "error", or a number of :mod:`logging`.

    Raises:
        InputError: It is no level.
    """
    if isinstance(level, str) and level.lower() in _LEVELS:
        return int(getattr(logging, level.upper()))
    if isinstance(level, int) and not isinstance(level, bool):
        return level
    given = f"'{level}'" if isinstance(level, str) else f"of type {type(level).__name__}"
    raise InputError(f"log level {given}: give one of {', '.join(_LEVELS)}")


def show(level: int | str = "info") -> None:
    """Print log records of a level and above to stderr; rank 0 alone has any.

    Called by the command line and by scripts that do not configure :mod:`logging` themselves.

    Args:
        level: "debug" (what the solvers did in every increment), "info", "warning" or "error", or
            a number of :mod:`logging`.

    Raises:
        InputError: It is no level.
    """
    number = level_of(level)
    if not any(isinstance(h, logging.StreamHandler) for h in logger.handlers):
        handler = _Stderr()
        handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
        logger.addHandler(handler)
    logger.setLevel(number)
