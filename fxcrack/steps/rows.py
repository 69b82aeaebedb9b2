"""Rows of the history: the present state of an analysis in numbers."""

from __future__ import annotations

from collections.abc import Callable

from fxcrack.criteria.evaluator import TipValues
from fxcrack.history import Row
from fxcrack.solvers.base import AnySolver
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.crack import Crack
from fxcrack.steps.element_growth import with_passed_parts
from fxcrack.steps.shared_numbers import columns_of_shared, is_shared

Observer = Callable[[str, Row], None]
"""Called on all ranks with the name of every event and its row of the history."""


class Recorder:
    """Adds rows to the history of an analysis.

    Args:
        analysis: The analysis.
        observer: Called with every row.
        columns: Further columns of every row.
    """

    def __init__(
        self,
        analysis: Analysis,
        observer: Observer | None = None,
        columns: Callable[[], Row] | None = None,
    ) -> None:
        self._analysis = analysis
        self._observer = observer
        self._columns = columns

    def __call__(self, event: str) -> None:
        """Add a row of the present state and show it to the observer; collective."""
        analysis = self._analysis
        row = history_row(analysis, event)
        for g, v in analysis.at_tips():
            g.look_for_overlap(v.tips, analysis.solver.state)
        if self._columns is not None:
            row |= self._columns()
        analysis.history.append(row)
        if self._observer is not None:
            self._observer(event, row)


def load_columns(solver: AnySolver) -> list[tuple[str, str, bool]]:
    """Columns of each support component and force pattern, in the order of ``state.loads``.

    Returns:
        Name of the prescribed displacement or load factor, name of the reaction or of the
        displacement conjugate to it, and whether the first one ever differs from zero.
    """
    names = [(f"u[{c.title}]", f"R[{c.title}]", c.moves) for c in solver.supports.columns]
    return names + [(f"F[{x.title}]", f"v[{x.title}]", True) for x in solver.loads]


def critical_columns(crack: Crack, values: TipValues) -> Row:
    """Columns of the tip whose f is largest: f, what is behind it, and its node; none without tips.

    Args:
        crack: The crack.
        values: Values of its criteria at the present tips.
    """
    if not len(values.tips):
        return {}
    i, title = values.largest, crack.title
    row: Row = {f"f[{title}]": float(values.f[i])}
    row |= {f"{name}[{title}]": float(part[i]) for name, part in values.report.items()}
    row[f"node[{title}]"] = int(values.tips.node[i])
    return row


def history_row(analysis: Analysis, event: str) -> Row:
    """Loads, reactions, cracks, criteria and energies of the present state; collective.

    Args:
        analysis: The analysis, its tip values up to date.
        event: Name of the event.

    Returns:
        The columns that :mod:`fxcrack.history` lists.
    """
    solver, balance = analysis.condensed, analysis.balance
    state, system = solver.state, solver.system
    stored, spent = solver.stored(state), solver.spent()
    work = balance.external_work + solver.extra_work(state)
    row: Row = {"time": float(balance.time), "event": event}
    acting = [*(c.support for c in solver.supports.columns), *solver.loads]
    for (load, answer, moves), part, a, r in zip(
        load_columns(solver), acting, state.loads, state.conjugate, strict=True
    ):
        if is_shared(part):
            continue
        if moves:
            row[load] = float(a)
        row[answer] = float(r)
    # displacements that criteria follow come after those of the user
    monitored = system.monitors(state)
    for monitor, value in zip(solver.monitors, monitored, strict=False):
        if not is_shared(monitor):
            row[f"m[{monitor.title}]"] = float(value)
    for fluid in solver.fluids:  # the volume between faces that have turned
        volume = f"v[{fluid.pressure.title}]"
        row[volume] = float(row[volume]) + fluid.more_volume()
    row |= columns_of_shared(solver, state.loads, state.conjugate, monitored)
    for g, v in analysis.at_tips():
        length, area = g.extent.length(v.tips), g.extent.area(v.tips)
        ligaments = analysis.fatigue.ligaments.get(g.p)
        if ligaments is not None and len(v.tips):
            passed = ligaments.part[v.tips.node]
            if passed.any():
                length, area = with_passed_parts(g, v.tips, passed)
        row[f"a[{g.title}]"], row[f"area[{g.title}]"] = length, area
        row[f"released[{g.title}]"] = g.n_released
        row |= critical_columns(g, v)
    row |= stored
    row["external_work"] = work
    row["released_energy"] = balance.released - balance.viscous
    if balance.viscous:
        row["viscous_energy"] = balance.viscous
    if system.soft.bonds or system.soft.finished:
        row["snap_energy"] = analysis.snap_energy
    if any(pair.interface.friction is not None for pair in solver.pairs):  # 0.0 as well
        row["friction_energy"] = solver.friction_energy
    row |= spent
    if balance.kinetic:
        row["initial_kinetic_energy"] = balance.kinetic
    if solver.overlap_energy:
        row["overlap_energy"] = solver.overlap_energy
    given = work + balance.kinetic + solver.overlap_energy
    gone = balance.released + solver.friction_energy + sum(spent.values())
    row["balance"] = given - sum(stored.values()) - gone
    return row
