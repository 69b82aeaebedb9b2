"""What a scene is made of, how it is solved and why, and what each part of it has cost.

Nothing is estimated: unknowns and terms are counted, seconds are those of the runs so far.
"""

from __future__ import annotations

import html
import warnings
from dataclasses import dataclass

import numpy as np

from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of

INTERFACE_LAWS = ("contact", "friction", "softening")


@dataclass(frozen=True)
class Explanation:
    """A scene in numbers.

    Attributes:
        solver: "linear", "newton" or "explicit".
        why: Reasons for the solver.
        effects: What is on beyond small linear elasticity.
        unknowns: How many there are, by kind; kinds that the scene lacks are not listed.
        counts: Form terms, compiled forms, factorisations, nonlinear iterations so far.
        phases: Seconds of the runs so far, by phase of the solution.
        costs: Seconds of the runs so far, by effect.
        groups: Integration, plies, slenderness and shear factors of groups of continuum shells.
        notes: What else decides how the scene is solved, one sentence each.
    """

    solver: str
    why: tuple[str, ...]
    effects: tuple[str, ...]
    unknowns: dict[str, int]
    counts: dict[str, int]
    phases: dict[str, float]
    costs: dict[str, float]
    groups: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def path(self) -> str:
        """Former name of :attr:`solver`, deprecated: "condensed" for "linear"."""
        warnings.warn(
            "Explanation.path is now called Explanation.solver, with 'linear' for 'condensed'; the "
            "former name will be removed",
            DeprecationWarning,
            stacklevel=2,
        )
        return "condensed" if self.solver == "linear" else self.solver

    def __str__(self) -> str:
        """Several lines for a terminal."""
        lines = [f"solver: {self.solver}, because {'; '.join(self.why)}"]
        lines.append("effects: " + ("; ".join(self.effects) or "none beyond linear elasticity"))
        lines += self.groups
        lines.append("unknowns: " + _listed(self.unknowns))
        lines.append("counted: " + _listed(self.counts))
        lines += self.notes
        for title, table in (("phases", self.phases), ("effects", self.costs)):
            if table:
                width = max(len(name) for name in table)
                lines.append(f"seconds by {title}:")
                lines += [f"  {name:<{width}}  {value:9.4f}" for name, value in table.items()]
        if not self.phases:
            lines.append("seconds: not run yet")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """The same lines for notebooks."""
        return f"<pre>{html.escape(str(self))}</pre>"


def explain(source: Analysis | HasAnalysis) -> Explanation:
    """Look at a scene or its analysis; collective, the same on every rank."""
    analysis = analysis_of(source)
    solver = analysis.solver
    if isinstance(solver, ExplicitSolver):
        return _explicit(analysis, solver)
    unknowns = {"displacements": analysis.continuum.layout.n_distinct}
    counts = {"form terms": 1, "factorisations": solver.timings.factorizations}
    costs: dict[str, float] = {}
    if analysis.started:
        system = analysis.condensed.system
        unknowns["retained jumps"] = system.n_retained
        for kind, number in (
            ("contact nodes", int(system.contact.sum())),
            ("friction nodes", 0 if system.friction is None else len(system.friction.rows)),
            ("cohesive bonds", len(system.soft.bonds)),
        ):
            if number:
                unknowns[kind] = number
        costs = {k: v for k, v in analysis.condensed.law_seconds.items() if k in INTERFACE_LAWS}
    if isinstance(solver, NewtonSolver):
        bodies = solver.bodies
        kept = sum(np.size(v) for term in bodies.terms for v in term.state().values())
        kept = int(analysis.comm.allreduce(kept))
        if kept:
            unknowns["remembered values"] = kept
        counts["form terms"] = len(bodies.terms)
        counts["compiled forms"] = bodies.n_forms
        counts["nonlinear solves"] = solver.counts.solves
        counts["iterations"] = solver.counts.iterations
        costs = {**bodies.seconds, **costs}
    plan = analysis.plan
    seconds = dict(solver.timings.seconds)
    groups = tuple(str(cells) for cells in analysis.continuum.shell_cells.values())
    notes = tuple(
        f"release of '{g.title}': {type(g.law).__name__}"
        + ("" if g.debond.release_chosen else ", by default")
        for g in analysis.cracks
    )
    return Explanation(
        plan.solver, plan.why, plan.effects, unknowns, counts, seconds, costs, groups, notes
    )


def _explicit(analysis: Analysis, solver: ExplicitSolver) -> Explanation:
    """What explicit dynamics is made of."""
    plan, lumped = analysis.plan, solver.lumped
    unknowns = {"displacements": analysis.continuum.n_global, "interface nodes": len(lumped.nodes)}
    counts = {"increments": solver.increments, "internal forces": solver.bodies.evaluations}
    choice, costs = solver.bodies.choice, dict(solver.seconds)
    per = sum(costs.values()) / max(solver.increments, 1)
    notes = [
        f"increment: {solver.dt:.6g}, of the largest stable one {solver.stable:.6g}, which the "
        + (
            "highest frequency of bodies and elastic bonds limits (contact does not)"
            if solver.dynamics.elastic.exist
            else "highest frequency of the bodies limits (bonds and contact do not)"
        ),
        f"operator: {choice.name}, {choice.why}",
        f"interface: {'one master for each slave' if lumped.simple else 'slaves share masters'}",
        f"seconds per increment: {per:.3g}, of which internal forces "
        f"{costs['internal forces'] / max(solver.increments, 1):.3g}",
    ]
    seconds = dict(solver.timings.seconds)
    return Explanation(
        plan.solver, plan.why, plan.effects, unknowns, counts, seconds, costs, notes=tuple(notes)
    )


def _listed(table: dict[str, int]) -> str:
    return ", ".join(f"{number:,} {name}" for name, number in table.items())
