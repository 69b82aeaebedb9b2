"""Columns of the history for the numbers that all nodes of a section share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fxcrack.base.arrays import Array
from fxcrack.continuum.generalised_plane_strain import SharedUnknown, shared_unknowns
from fxcrack.continuum.shared_loads import SharedForce, SharedMonitor
from fxcrack.history import Row
from fxcrack.solvers.base import Solver


def is_shared(part: object) -> bool:
    """Whether a support, load or monitor belongs to such a number, which has own columns."""
    return isinstance(part, SharedUnknown | SharedForce | SharedMonitor)


def columns_of_shared(
    solver: Solver, loads: Sequence[float] | Array, conjugate: Array, monitored: Array
) -> Row:
    """Each number and its resultant in a state.

    Args:
        solver: The solver.
        loads: Coordinates of supports and load factors, shape (n_loads,).
        conjugate: Reactions and conjugate displacements, shape (n_loads,).
        monitored: Values of the monitors, shape (n_monitors,).
    """
    shared = shared_unknowns(solver.continuum.model)
    if not shared:
        return {}
    columns: list[Any] = [c.support for c in solver.supports.columns]
    acting: list[Any] = list(solver.loads)
    watched: list[Any] = list(solver.monitors)
    row: Row = {}
    for one in shared:
        if one in columns:
            i = columns.index(one)
            row[one.title] = float(loads[i]) * one.per_unknown
            row[one.answer] = float(conjugate[i]) * one.per_reaction
        else:
            row[one.title] = float(monitored[watched.index(SharedMonitor(one))])
            row[one.answer] = sum(
                (
                    float(factor) * one.load
                    for load, factor in zip(acting, loads[len(columns) :], strict=True)
                    if load == SharedForce(one)
                ),
                0.0,
            )
    return row


__all__ = ["columns_of_shared", "is_shared"]
