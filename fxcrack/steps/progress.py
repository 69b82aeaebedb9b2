"""The progress of a step on rank 0: one line of a terminal, or lines of the log without one.

Lines of the log come after 2, 6, 14, ... seconds, at last every minute, and at the end of a step
that has given any.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable
from types import TracebackType

from mpi4py import MPI
from rich.console import Console
from rich.live import Live
from rich.text import Text

from fxcrack.base import log
from fxcrack.history import Row
from fxcrack.steps.share_done import ShareDone

_FIRST, _LONGEST = 2.0, 60.0
"""Seconds before the first line of the log, and between two of them at most."""
_KNOWN = 0.05
"""Part of the step that must be done before the time left is estimated from it."""


class Progress:
    """Context manager that is called with every row of a history.

    It shows a line on a terminal. Elsewhere (a file, a pipe, a notebook) its lines are records of
    the logger ``fxcrack.progress`` at level INFO, or lines of stderr where logging is not
    configured. Nothing is shown where that logger itself has a higher level.

    Args:
        comm: Communicator; only a rank that is the first one of it and of the world shows anything.
        share: What tells how much of the step is done.
        number: Number of the step.
        enabled: ``False`` silences it.
        now: Clock, seconds.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        share: ShareDone,
        *,
        number: int = 1,
        enabled: bool = True,
        now: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._share, self._number, self._now = share, number, now
        self._live: Live | None = None
        first = comm.rank == 0 and MPI.COMM_WORLD.rank == 0
        self._on = enabled and first and log.progress.level <= logging.INFO
        if self._on and _is_terminal():
            console = Console(stderr=True)
            self._live = Live(console=console, refresh_per_second=4, transient=True)
        self._text = ""
        self._begin = now()
        self._rows: float | None = None  # when the first row came: what is before it is set-up
        self._due, self._gap = self._begin + _FIRST, _FIRST
        self._told = False

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
        """Stop showing; without a terminal the last state ends the lines."""
        if self._live is not None:
            self._live.__exit__(kind, error, trace)
        elif self._told and self._text:
            log.tell_progress(self.line)

    def __call__(self, event: str, row: Row) -> None:
        """Show one row."""
        if not self._on:
            return
        if self._rows is None:
            self._rows = self._now()
        self._share.update(row)
        self._text = describe(event, row, self._share)
        if self._live is not None:
            self._live.update(_Line(self))
        elif self._now() >= self._due:
            self._told = True
            log.tell_progress(self.line)
            self._gap = min(2.0 * self._gap, _LONGEST)
            self._due = self._now() + self._gap

    @property
    def line(self) -> str:
        """The time elapsed, the time left where it can be known, and the last row.

        What is cut off on narrow terminals comes last.
        """
        now = self._now()
        words = f"step {self._number} after {clock(now - self._begin)}"
        part = self._share.part
        if self._rows is not None and part is not None and _KNOWN <= part < 1.0:
            words += f", about {clock((now - self._rows) * (1.0 - part) / part)} left"
        return f"{words}: {self._text}"


class _Line:
    """Renders the line anew at every refresh, so that the clock goes on between two rows."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def __rich__(self) -> Text:
        return Text(self._progress.line, no_wrap=True, overflow="ellipsis")


def _is_terminal() -> bool:
    """Whether stderr is a terminal that can write over a line."""
    return sys.stderr.isatty() and os.environ.get("TERM", "") not in ("dumb", "unknown")


def clock(seconds: float) -> str:
    """Seconds as minutes:seconds, or hours:minutes:seconds."""
    whole = round(seconds)
    minutes, hours = whole // 60, whole // 3600
    if hours:
        return f"{hours}:{minutes % 60:02d}:{whole % 60:02d}"
    return f"{minutes}:{whole % 60:02d}"


def describe(event: str, row: Row, share: ShareDone | None = None) -> str:
    """Words for a row: crack lengths, criteria, time, the first reaction or load.

    Args:
        event: Name of the event.
        row: The row.
        share: What knows the values at which the step ends.
    """
    goals = {} if share is None else share.goals

    def entry(name: str, shown: str, digits: int = 5) -> str:
        text = f"{shown} = {row[name]:.{digits}g}"
        return f"{text} of {goals[name]:.{digits}g}" if name in goals else text

    parts = [event]
    parts += [entry(k, k) for k in row if k.startswith("a[")]
    parts += [entry(k, k, 4) for k in row if k.startswith("f[")]
    parts.append(entry("N", "N") if "N" in row else entry("time", "t"))
    load = next((k for k in row if k.startswith("R[") and f"u{k[1:]}" in row), None)
    load = load or next((k for k in row if k.startswith("F[")), None)
    parts += [entry(load, load)] if load else []
    return "  ".join(parts)
