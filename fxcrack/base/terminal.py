"""Tables as all commands print them, on rank 0."""

from __future__ import annotations

import os

from mpi4py import MPI
from rich import box
from rich.console import Console
from rich.table import Table

_FILE_WIDTH = 140  # characters of a table that goes into a file or a pipe


def rank_0_console() -> Console:
    """Where rank 0 prints tables, whole if into a file; the other ranks print nowhere."""
    console = Console(quiet=MPI.COMM_WORLD.rank > 0, highlight=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = _FILE_WIDTH
    return console


def new_table(title: str, *columns: str) -> Table:
    """An empty table whose first column is text and whose others are numbers."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right")
    return table
