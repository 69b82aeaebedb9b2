"""Rank-0 logging under the name ``fxcrack``; configured only when a program asks for it."""

from __future__ import annotations

import logging

from mpi4py import MPI

logger = logging.getLogger("fxcrack")


def info(message: str, *args: object) -> None:
    """Log once, on rank 0 of the world."""
    if MPI.COMM_WORLD.rank == 0:
        logger.info(message, *args)


def warn(message: str, *args: object) -> None:
    """Warn once, on rank 0 of the world."""
    if MPI.COMM_WORLD.rank == 0:
        logger.warning(message, *args)


def show(level: int = logging.INFO) -> None:
    """Print log records to the terminal; called by the command line and the demos."""
    if not any(isinstance(h, logging.StreamHandler) for h in logger.handlers):
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
        logger.addHandler(handler)
    logger.setLevel(level)
