"""Rows of the history in explicit dynamics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.history import Row
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.crack import Crack
from fxcrack.steps.rows import critical_columns, load_columns

NODES_OF_SPEED = 5
"""Releases over which the speed of a tip is taken."""


class CrackSpeed:
    """Speed of a crack, from the times at which it had its last lengths.

    Args:
        crack: The crack.

    Attributes:
        passed: Times and lengths after the last releases, oldest first, (time, length).
    """

    def __init__(self, crack: Crack, time: float) -> None:
        self._crack = crack
        self.passed: list[tuple[float, float]] = [(time, self._length())]

    def _length(self) -> float:
        return self._crack.extent.length(self._crack.tips())

    def note(self, time: float) -> None:
        """Some nodes have been released at a time."""
        self.passed.append((time, self._length()))
        del self.passed[: -NODES_OF_SPEED - 1]

    def at(self, time: float) -> float:
        """Growth since the fifth last release over the time since then, length/time."""
        start, length = self.passed[0]
        if len(self.passed) < 2 or time <= start:
            return 0.0
        return (self.passed[-1][1] - length) / (time - start)


def explicit_row(
    analysis: Analysis, solver: ExplicitSolver, event: str, speeds: Sequence[CrackSpeed]
) -> Row:
    """Loads, reactions, cracks, criteria and energies of the present increment; collective.

    Displacements, forces and criteria are those of its start, energies those of the middle of the
    increment before.

    Args:
        analysis: The analysis, its tip values up to date.
        solver: Its solver, between the two halves of an increment.
        event: Name of the event.
        speeds: Of the active cracks.

    Returns:
        The columns that :mod:`fxcrack.history` lists.
    """
    solver.record_state()
    state = solver.state
    row: Row = {"time": float(analysis.time), "event": event}
    for (load, answer, moves), a, r in zip(
        load_columns(solver), state.loads, state.conjugate, strict=True
    ):
        if moves:
            row[load] = float(a)
        row[answer] = float(r)
    for monitor, value in zip(solver.monitors, solver.monitored, strict=True):
        row[f"m[{monitor.title}]"] = value
    for (g, v), speed in zip(analysis.at_tips(), speeds, strict=True):
        row[f"a[{g.title}]"] = g.extent.length(v.tips)
        row[f"area[{g.title}]"] = g.extent.area(v.tips)
        row[f"speed[{g.title}]"] = speed.at(analysis.time)
        row[f"released[{g.title}]"] = g.n_released
        row[f"spent[{g.title}]"] = spent_per_area(solver, g)
        row |= critical_columns(g, v)
    stored, spent = solver.stored_now(), solver.spent()
    work = solver.external_work()
    scaled = stored.pop("mass_scaling_energy", None)
    row |= stored
    if scaled is not None:
        row["mass_scaling_energy"] = scaled
    row["external_work"] = work
    if solver.energies.initial:
        row["initial_energy"] = solver.energies.initial
    row |= spent
    row["dt"] = solver.dt
    row["balance"] = work + solver.energies.initial - sum(stored.values()) - sum(spent.values())
    return row


def spent_per_area(solver: ExplicitSolver, crack: Crack) -> float:
    """Energy that the bonds of a crack have really taken, over the area swept, force/length.

    Of bonds that softened and are free; 0 before the first of them. On a plane of symmetry that of
    the whole crack, as rates are.
    """
    rows, bonds = solver.row_of[crack.p], solver.dynamics.bonds
    nodes = np.flatnonzero(rows >= 0)
    nodes = nodes[bonds.freed[rows[nodes]]]
    if not len(nodes):
        return 0.0
    rate = float(bonds.spent[rows[nodes]].sum() / bonds.area[rows[nodes]].sum())
    return rate * crack.probe.pair.interface.opening_factor


def imbalance(row: Row) -> float:
    """Energy balance over all energies of a row; NaN where one of them is no number."""
    names = ("strain_energy", "kinetic_energy", "external_work", "released_energy")
    size = sum(abs(float(row[name])) for name in names) + float(row.get("initial_energy", 0.0))
    return abs(float(row["balance"])) / size if size > 0.0 or size != size else 0.0
