"""A progress line on rank 0 with load, crack length and f; silent when not a terminal."""

from __future__ import annotations

import sys
from types import TracebackType

from mpi4py import MPI
from rich.console import Console
from rich.live import Live
from rich.text import Text

from fxcrack.history import Row


class Progress:
    """Context manager that is called with every row of a history.

    Args:
        comm: Communicator; only rank 0 shows anything.
        enabled: ``False`` silences it.
    """

    def __init__(self, comm: MPI.Comm, *, enabled: bool = True) -> None:
        self._live: Live | None = None
        if enabled and comm.rank == 0 and sys.stderr.isatty():
            self._live = Live(console=Console(stderr=True), refresh_per_second=8, transient=True)

    def __enter__(self) -> Progress:
        """Start showing."""
        if self._live is not None:
            self._live.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop showing."""
        if self._live is not None:
            self._live.__exit__(kind, error, trace)

    def __call__(self, event: str, row: Row) -> None:
        """Show one row."""
        if self._live is not None:
            self._live.update(Text(line(event, row)))


def line(event: str, row: Row) -> str:
    """One line for a row: time, the first reaction, crack lengths, criteria."""
    clock = f"N = {row['N']:.5g}" if "N" in row else f"t = {row['time']:.5g}"
    parts = [f"{event:<9} {clock}"]
    load = next((k for k in row if k.startswith("R[") and f"u{k[1:]}" in row), None)
    if load is not None:
        parts.append(f"{load} = {row[load]:.5g}")
    parts += [f"{k} = {v:.5g}" for k, v in row.items() if k.startswith(("a[", "f["))]
    return "   ".join(parts)
