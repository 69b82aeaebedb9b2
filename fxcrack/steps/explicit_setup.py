"""The solver of explicit dynamics in place of the one a scene was made with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.follower_pressure import FollowerPressure
from fxcrack.continuum.term import Term
from fxcrack.continuum.thermal_strain import is_linear, thermal_loads
from fxcrack.interface.definition import Interface
from fxcrack.interface.supported_slaves import tell_of_held_bonds
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.solvers.plan import Plan
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.debond import Debond
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.explicit_rules import (
    check_bodies,
    check_constraints,
    check_large_rotation,
    inertia_of,
)


def use_explicit_solver(analysis: Analysis, terms: Callable[[Continuum], Sequence[Term]]) -> None:
    """Give an analysis that has not begun the solver of explicit dynamics; collective.

    Args:
        analysis: The analysis; nothing happens where it has that solver already.
        terms: Makes the terms of the bodies, all but inertia.

    Raises:
        InputError: Bodies or effects are not made for it, or other steps were run before.
    """
    effect = inertia_of(analysis.effects)
    old = analysis.solver
    if isinstance(old, ExplicitSolver):
        return
    if analysis.started:
        raise InputError(
            "Explicit: this scene has run other steps before, from which explicit dynamics cannot "
            "go on; make another scene for it, scene.rebuilt()"
        )
    interfaces = [pair.interface for pair in analysis.pairs]
    check_bodies(analysis.continuum, old.loads, interfaces)
    check_constraints(analysis.continuum, old.supports.constraints)
    found = terms(analysis.continuum)
    check_large_rotation(analysis.continuum, interfaces, found)
    heat: list[Any] = []
    if is_linear(analysis.continuum) and all(
        t.constant for t in found if not isinstance(t, FollowerPressure)
    ):
        heat = thermal_loads(analysis.continuum)
    solver = ExplicitSolver(
        analysis.continuum, analysis.pairs, old.supports, [*old.loads, *heat], old.monitors,
        terms=found, effect=effect,
    )  # fmt: skip
    old.destroy()
    analysis.solver = solver
    why = ("the step is explicit: central differences, nothing is factored",)
    effects = tuple(e for e in analysis.plan.effects if "inertia" not in e)
    analysis.plan = Plan("explicit", why, (*effects, "inertia: explicit dynamics"))


def prepare_explicit(
    analysis: Analysis, step: Explicit, may_grow: list[bool], *, resumes: bool
) -> None:
    """Choose operator and increment, and take the state to begin with; collective.

    Args:
        analysis: The analysis.
        step: Controls of the step.
        may_grow: Per interface, whether its crack may grow.
        resumes: Whether the state was taken from a checkpoint.
    """
    solver = analysis.solver
    assert isinstance(solver, ExplicitSolver)
    if not analysis.started:
        for pair, held in zip(analysis.pairs, solver.held_by_supports, strict=True):
            tell_of_held_bonds(pair, held)
    now = analysis.loads_at(analysis.time)
    solver.prepare(step.options, may_grow, now)
    if resumes:
        solver.begin(now, now)
        solver.record_state()
    analysis.started = True


def paired_by_nodes(debonds: Sequence[Debond], bonds: Sequence[Interface]) -> dict[str, Any]:
    """Interfaces at rest that pair their nodes as explicit dynamics does, by argument of a scene.

    Args:
        debonds: Interfaces with a criterion.
        bonds: Those without.
    """

    def by_nodes(interface: Interface) -> Interface:
        return interface if interface.is_rigid else replace(interface, pairing="node-to-surface")

    return {
        "debonds": [replace(d, interface=by_nodes(d.interface)) for d in debonds],
        "bonds": [by_nodes(b) for b in bonds],
    }


def start_from(analysis: Analysis, still: Analysis) -> None:
    """Begin explicit dynamics in a static equilibrium; collective.

    Args:
        analysis: The analysis, which has not begun.
        still: An analysis of the same bodies on the same mesh, in equilibrium.
    """
    solver = analysis.solver
    assert isinstance(solver, ExplicitSolver)
    vector = still.solver.displacement()
    solver.set_displacement(vector.array_r)
    vector.destroy()


__all__ = ["paired_by_nodes", "prepare_explicit", "start_from", "use_explicit_solver"]
