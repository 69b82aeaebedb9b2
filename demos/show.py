"""What the demos share: the command line of a script and tables on rank 0."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI
from rich.console import Console
from rich.table import Table


def arguments(purpose: str | None, out: str) -> tuple[Path, bool]:
    """Output folder and --fine from the command line."""
    parser = argparse.ArgumentParser(description=purpose)
    parser.add_argument("--out", type=Path, default=Path(out), help="folder for the results")
    parser.add_argument("--fine", action="store_true", help="a finer mesh")
    found = parser.parse_args()
    return found.out, found.fine


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[float | str]]) -> None:
    """Print a table on rank 0."""
    if MPI.COMM_WORLD.rank:
        return
    out = Table(title=title)
    for column in columns:
        out.add_column(column, justify="right")
    for row in rows:
        out.add_row(*(x if isinstance(x, str) else f"{x:.5g}" for x in row))
    Console(width=110).print(out)
