"""Rank-0 logging under the name ``fxcrack``; configured only when a program asks for it."""

from __future__ import annotations

import logging
from collections import deque
from itertools import count

from mpi4py import MPI

logger = logging.getLogger("fxcrack")

MOST_KEPT = 500
"""Warnings kept for reports; a process that warns more often loses the oldest."""
_said: deque[tuple[int, str]] = deque(maxlen=MOST_KEPT)
_numbers = count(1)


def n_warned() -> int:
    """Number of warnings of this process so far."""
    return _said[-1][0] if _said else 0


def warned_since(number: int) -> list[str]:
    """Warnings of this process after the first ``number``, in order, each text once."""
    return list(dict.fromkeys(text for n, text in _said if n > number))


def info(message: str, *args: object) -> None:
    """Log once, on rank 0 of the world."""
    if MPI.COMM_WORLD.rank == 0:
        logger.info(message, *args)


def warn(message: str, *args: object) -> None:
    """Warn once, on rank 0 of the world; :func:`warned_since` keeps what was said."""
    _said.append((next(_numbers), message % args if args else message))
    if MPI.COMM_WORLD.rank == 0:
        logger.warning(message, *args)


def show(level: int = logging.INFO) -> None:
    """Print log records to the terminal; called by the command line and the demos."""
    if not any(isinstance(h, logging.StreamHandler) for h in logger.handlers):
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
        logger.addHandler(handler)
    logger.setLevel(level)
