"""The history of an analysis: a table with one row per event, and how it is written.

Events: start and end of a step; just before a release "onset" (at f = 1) or "unstable" (at f above
1: further nodes go at the same load), neither in increment stepping; "release" (just after), "bend"
(an amplitude changes its slope, in event stepping: everything is linear in time between rows),
"snap" (cohesive bonds have run through unstable states), "increment".

Columns (brackets hold the name of a support, load, monitor or interface):
time, event, u[..] and R[..] prescribed displacement and reaction, F[..] and v[..] load factor and
its work-conjugate displacement, m[..] monitored displacement, a[..] crack length, area[..] open
area, f[..] largest criterion value and GI, GII, GIII[..] there, node[..] where, released[..]
number of released nodes; strain_energy, external_work, released_energy, balance; where they occur
viscous_energy, snap_energy (part of released_energy), overlap_energy (given by contact as it pushes
overlapping faces apart), initial_kinetic_energy (of a given velocity), and in fatigue steps N,
G_max[..], dG[..], dadN[..].
"""

from __future__ import annotations

import csv
import html
import json
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, overload

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base import log
from fxcrack.base.checks import counted, number, text
from fxcrack.base.errors import InputError, unknown_name
from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none

Row = dict[str, float | int | str]


AT_ONE = 1e-6
"""How far from 1 f may be at an onset: searches for f = 1 end so near to it at least."""
BEFORE_RELEASE = ("onset", "unstable")
"""Events whose rows stand just before a release, at f = 1 and above it."""
_FORMER_DETAILS = {"window": "retained"}
"""Former names of details; they are removed in the next release."""


def _names_of(event: str | Sequence[str] | None) -> tuple[str, ...] | None:
    """Names of events from one or several."""
    return (event,) if isinstance(event, str) else None if event is None else tuple(event)


class Details(dict[str, Any]):
    """What else is worth keeping with a history, by name; former names warn."""

    def get(self, name: str, default: Any = None) -> Any:
        """The detail of a name, also of a former one; ``default`` where there is none."""
        if name in self or _FORMER_DETAILS.get(name) in self:
            return self[name]
        return default

    def __missing__(self, name: str) -> Any:
        if name not in _FORMER_DETAILS:
            raise KeyError(f"{name}; known: {', '.join(self)}")
        new = _FORMER_DETAILS[name]
        warnings.warn(
            f"details['{name}'] is now called details['{new}']; the former name will be removed",
            DeprecationWarning,
            stacklevel=2,
        )
        return self[new]


class History:
    """Rows of an analysis, the same on every rank.

    Args:
        comm: Communicator; rank 0 writes files.

    Attributes:
        rows: One dictionary per row.
        reason: Why the last step ended.
        details: What else is worth keeping (timings, retained jumps, releases), plain types only.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self._comm = comm
        self.rows: list[Row] = []
        self.reason = ""
        self.details = Details()

    @property
    def comm(self) -> MPI.Comm:
        """Communicator; rank 0 writes files."""
        return self._comm

    def __repr__(self) -> str:
        """Number of rows and columns, and why the last step ended."""
        return f"<History of {len(self)} rows and {len(self.columns)} columns: {self.reason}>"

    def __str__(self) -> str:
        """What happened, see :meth:`describe`."""
        return self.describe()

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.rows)

    def __iter__(self) -> Iterator[Row]:
        """Rows in order."""
        return iter(self.rows)

    @property
    def columns(self) -> list[str]:
        """Column names in order of first appearance."""
        return list(dict.fromkeys(k for row in self.rows for k in row))

    def append(self, row: Row) -> None:
        """Add a row."""
        self.rows.append(row)

    @overload
    def __getitem__(self, column: str) -> npt.NDArray[Any]: ...

    @overload
    def __getitem__(self, column: int) -> Row: ...

    @overload
    def __getitem__(self, column: slice) -> list[Row]: ...

    def __getitem__(self, column: str | int | slice) -> npt.NDArray[Any] | Row | list[Row]:
        """A column, shape (n_rows,), NaN where a row lacks it; by a whole number, that row.

        By a slice such as ``history[-3:]`` it is a list of rows.

        Raises:
            InputError: No row has the column, or it is neither a name nor a number nor a slice.
            IndexError: There are fewer rows.
        """
        if isinstance(column, slice):
            return self.rows[column]
        if isinstance(column, int | np.integer):
            return self.rows[int(column)]
        text("history", "column", column)
        if self.rows and column not in self.columns:
            unknown_name("column", column, self.columns)
        return np.array([row.get(column, np.nan) for row in self.rows])

    def rows_of(self, *events: str) -> list[Row]:
        """Rows of some events, in order; ``rows_of("onset", "unstable")`` stand before releases."""
        return [row for row in self.rows if row["event"] in events]

    def at(self, column: str, value: float, *, event: str | Sequence[str] | None = None) -> Row:
        """First row where a column reaches a value (to round-off), optionally of some events.

        Args:
            column: The column.
            value: The value.
            event: Event or events of the row. "onset" are rows at f = 1; a warning says where a row
                "unstable", at f above 1, has reached the value before.

        Raises:
            InputError: There is no such row, column or event.
        """
        value = number("history.at", column, value)
        wanted = _names_of(event)
        above: Row | None = None
        for row in self.rows:
            found = row.get(column, np.nan)
            if not (isinstance(found, (int, float)) and found >= value - 1e-9 * abs(value)):
                continue
            if wanted is None or row["event"] in wanted:
                if above is not None:
                    log.warn(
                        "history.at: %s reaches %g in unstable growth, at f above 1 (time %g), "
                        "before the row at f = 1 that is returned (time %g); for rows before any "
                        "release give event=('onset', 'unstable')",
                        column, value, above["time"], row["time"],
                    )  # fmt: skip
                return row
            if "onset" in wanted and row["event"] == "unstable" and "N" not in row:
                above = above or row
        if self.rows and column not in self.columns:
            unknown_name("column", column, self.columns)
        chosen = [r for r in self.rows if wanted is None or r["event"] in wanted]
        if not chosen:
            events = list(dict.fromkeys(str(r["event"]) for r in self.rows))
            unknown_name("row of event", str(event), events)
        reached = [float(r[column]) for r in chosen if column in r]
        most = f"{max(reached):.9g}" if reached else "none"
        hint = ""
        if above is not None:
            hint = (
                f"; a row 'unstable' (f above 1, time {above['time']:g}) reaches it: give "
                "event=('onset', 'unstable')"
            )
        raise InputError(
            f"there is no row with {column} >= {value:g} among {len(chosen)} rows"
            f"{'' if event is None else f' of event {event!r}'}; the largest is {most}{hint}"
        )

    def load_at(
        self,
        opening: npt.ArrayLike,
        *,
        x: str | None = None,
        y: str | None = None,
        event: str | Sequence[str] = BEFORE_RELEASE,
    ) -> npt.NDArray[np.float64]:
        """Load at an opening, interpolated over the rows of some events.

        Between two releases a load lies on a saw-tooth; before each release it is that of growth.
        The way from the first row of the history to the first such row is a straight line.

        Args:
            opening: Values of the column ``x``, of any shape.
            x: Column; by default the first prescribed displacement that moves, else the
                displacement of the first load.
            y: Column; by default the reaction or load that belongs to it.
            event: Event or events whose rows to interpolate over; by default those before
                releases, "onset" and "unstable".

        Returns:
            Values of the column ``y`` where ``x`` has the given values for the first time, of the
            shape of ``opening``.

        Raises:
            InputError: A column is unknown, no row is of that event, or the values lie outside.
        """
        if x is None:
            moving = [c for c in self.columns if c[:2] in ("u[", "v[")]
            if not moving:
                raise InputError("load_at: no displacement is prescribed or loaded; give x and y")
            x = moving[0]
        if y is None:
            y = {"u[": "R[", "v[": "F["}.get(x[:2], "") + x[2:]
        for name in (x, y):
            if name not in self.columns:
                unknown_name("column", name, self.columns)
        chosen = _names_of(event) or ()
        rows = self.rows[:1] + [r for r in self.rows[1:] if r["event"] in chosen]
        points = [(float(r[x]), float(r[y])) for r in rows if x in r and y in r]
        if len(points) < 2:
            events = list(dict.fromkeys(str(r["event"]) for r in self.rows))
            unknown_name("row of event", " or ".join(chosen), events)
        wanted = np.asarray(opening, dtype=np.float64)
        out = np.full(wanted.shape, np.nan)
        for (a, p), (b, q) in pairwise(points):
            low, high = min(a, b), max(a, b)
            small = 1e-9 * max(abs(a), abs(b))
            inside = (wanted >= low - small) & (wanted <= high + small) & np.isnan(out)
            part = (wanted - a) / (b - a) if b != a else np.ones(wanted.shape)
            out = np.where(inside, p + np.clip(part, 0.0, 1.0) * (q - p), out)
        if np.isnan(out).any():
            lost = float(wanted[np.isnan(out)].ravel()[0])
            reached = [a for a, _ in points]
            raise InputError(
                f"load_at: {x} = {lost:g} lies outside the rows of event "
                f"'{' or '.join(chosen)}', which reach from {min(reached):g} to {max(reached):g}"
            )
        return out

    def describe(self) -> str:
        """What happened, in a few lines: events, first onset, largest load, cracks, energies."""
        if not self.rows:
            return "no rows: no step was run"
        names = self.columns
        count = Counter(str(row["event"]) for row in self.rows)
        lines = [
            f"{len(self.rows)} rows: " + ", ".join(f"{n} {event}" for event, n in count.items()),
            f"the last step ended: {self.reason or 'not yet'}",
        ]
        moving = [c[2:-1] for c in names if c.startswith("u[")]
        forces = [c[2:-1] for c in names if c.startswith("F[")]
        for load, x, y in [(t, "u", "R") for t in moving] + [(t, "v", "F") for t in forces]:
            values = np.abs(self[f"{y}[{load}]"].astype(float))
            if np.isnan(values).all():
                continue
            row = self.rows[int(np.nanargmax(values))]
            at = float(row.get(f"{x}[{load}]", np.nan)) + 0.0  # no -0
            lines.append(f"largest {y}[{load}]: {row[f'{y}[{load}]']:.6g} at {x} = {at:.6g}")
        for title in (c[2:-1] for c in names if c.startswith("a[")):
            a, released = self[f"a[{title}]"].astype(float), self[f"released[{title}]"]
            lines.append(
                f"crack {title}: length from {a[0]:.6g} to {a[-1]:.6g}, "
                f"{counted(int(released[-1]), 'node')} released"
            )
            f = self[f"f[{title}]"].astype(float) if f"f[{title}]" in names else np.zeros(len(a))
            unstable = (self["event"] == "unstable") & (f > 1.0 + AT_ONE)
            if "N" in names:  # of cycles: tips above the upper limit of their law
                unstable &= np.isnan(self["N"].astype(float))
            if unstable.any():
                before = int(np.isin(self["event"], BEFORE_RELEASE).sum())
                lines.append(
                    f"  unstable growth: f is above 1 before {int(unstable.sum())} of {before} "
                    f"releases, up to {float(f[unstable].max()):.3g}"
                )
            grown = np.flatnonzero(np.diff(released.astype(float)) > 0.0)
            if len(grown):
                lines.append(f"  began to grow at time {float(self.rows[grown[0]]['time']):.6g}")
        energies = [c for c in ("external_work", "strain_energy", "released_energy") if c in names]
        if energies and "balance" in names:
            last = ", ".join(f"{c} {float(self[c][-1]):.6g}" for c in energies)
            off = float(np.nanmax(np.abs(self["balance"].astype(float))))
            most = max(float(np.nanmax(np.abs(self[c].astype(float)))) for c in energies)
            lines.append(f"energies at the end: {last}")
            lines.append(
                f"largest error of the energy balance: {off:.3g}, {off / (most or 1.0):.1g} "
                "of the largest of these energies"
            )
        return "\n".join(lines)

    def to_frame(self) -> Any:
        """All rows as a ``pandas.DataFrame``, one column per column.

        Raises:
            InputError: pandas is not installed.
        """
        try:
            import pandas as pd  # optional: only those who ask for a frame need it
        except ImportError as error:
            raise InputError(
                "to_frame needs pandas, which is not installed; install it (pip install pandas), "
                "or use history['column'] and history.to_csv(path)"
            ) from error
        return pd.DataFrame(self.rows, columns=self.columns)

    def _repr_html_(self) -> str:
        """The description and the first and last rows, for notebooks."""
        rows, names = self.rows, self.columns
        shown = rows if len(rows) <= 12 else [*rows[:6], {}, *rows[-6:]]

        def cell(row: Row, name: str) -> str:
            value = row.get(name, "")
            text = f"{value:.6g}" if isinstance(value, float) else str(value)
            return f"<td>{html.escape(text if row else '...')}</td>"

        head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
        body = "".join(f"<tr>{''.join(cell(row, n) for n in names)}</tr>" for row in shown)
        return (
            f"<pre>{html.escape(self.describe())}</pre><table><thead><tr>{head}</tr></thead>"
            f"<tbody>{body}</tbody></table>"
        )

    def to_csv(self, path: str | Path) -> None:
        """Write all rows as comma-separated values; collective, rank 0 writes."""
        with all_or_none(self._comm, f"writing {path}"):
            if self._comm.rank == 0:
                self.write_csv(path)

    def to_json(self, path: str | Path) -> None:
        """Write rows, reason and details as JSON; collective, rank 0 writes."""
        with all_or_none(self._comm, f"writing {path}"):
            if self._comm.rank == 0:
                self.write_json(path)

    def write_csv(self, path: str | Path) -> None:
        """As :meth:`to_csv`, on one rank alone."""
        with (
            replacing(path) as temporary,
            temporary.open("w", newline="", encoding="utf-8") as stream,
        ):
            writer = csv.DictWriter(stream, self.columns)
            writer.writeheader()
            writer.writerows(self.rows)

    def write_json(self, path: str | Path) -> None:
        """As :meth:`to_json`, on one rank alone."""
        content = {"reason": self.reason, "details": self.details, "rows": self.rows}
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")

    def plot(
        self,
        path: str | Path | None = None,
        *,
        x: str | npt.ArrayLike | None = None,
        y: str | npt.ArrayLike | None = None,
        **options: Any,
    ) -> Any:
        """Plot load against opening; collective.

        Args:
            path: Picture file (.png, .pdf, .svg), or ``None`` for none.
            x: Column or array of shape (n_rows,); by default the first prescribed displacement
                that is not fixed, else the displacement of the first load, absolute value.
            y: Column or array of shape (n_rows,); by default the reaction or load that belongs to
                it, absolute value.
            **options: As for :func:`fxcrack.output.plots.curves.load_opening`: reference curves
                ``[(label, x, y)]``, xlabel, ylabel, label, title, ax.

        Returns:
            The ``matplotlib`` figure on rank 0, ``None`` on the others.

        Raises:
            InputError: A column is unknown, or there is none to choose.
            FxcrackError: The file could not be written.
        """
        from fxcrack.output import plots  # loads matplotlib: only those who plot wait for it

        return plots.load_opening(self, path, x=x, y=y, **options)
