"""What a scene is made of, how it is solved and why, and what each part of it has cost.

Nothing is estimated: unknowns and terms are counted, seconds are those of the runs so far.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of

INTERFACE_LAWS = ("contact", "friction", "softening")


@dataclass(frozen=True)
class Explanation:
    """A scene in numbers.

    Attributes:
        solver: "linear" or "newton".
        why: Reasons for the solver.
        effects: What is on beyond small linear elasticity.
        unknowns: How many there are, by kind; kinds that the scene lacks are not listed.
        counts: Form terms, compiled forms, factorisations, nonlinear iterations so far.
        phases: Seconds of the runs so far, by phase of the solution.
        costs: Seconds of the runs so far, by effect.
        groups: Integration, plies, slenderness and shear factors of groups of continuum shells.
    """

    solver: str
    why: tuple[str, ...]
    effects: tuple[str, ...]
    unknowns: dict[str, int]
    counts: dict[str, int]
    phases: dict[str, float]
    costs: dict[str, float]
    groups: tuple[str, ...] = ()

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
        for title, table in (("phases", self.phases), ("effects", self.costs)):
            if table:
                width = max(len(name) for name in table)
                lines.append(f"seconds by {title}:")
                lines += [f"  {name:<{width}}  {value:9.4f}" for name, value in table.items()]
        if not self.phases:
            lines.append("seconds: not run yet")
        return "\n".join(lines)


def explain(source: Analysis | HasAnalysis) -> Explanation:
    """Look at a scene or its analysis; collective, the same on every rank."""
    analysis = analysis_of(source)
    solver = analysis.solver
    unknowns = {"displacements": analysis.continuum.n_global}
    counts = {"form terms": 1, "factorisations": solver.timings.factorizations}
    costs: dict[str, float] = {}
    if analysis.started:
        system = solver.system
        unknowns["retained jumps"] = system.n_retained
        for kind, number in (
            ("contact nodes", int(system.contact.sum())),
            ("friction nodes", 0 if system.friction is None else len(system.friction.rows)),
            ("cohesive bonds", len(system.soft.bonds)),
        ):
            if number:
                unknowns[kind] = number
        costs = {k: v for k, v in solver.law_seconds.items() if k in INTERFACE_LAWS}
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
    return Explanation(
        plan.solver, plan.why, plan.effects, unknowns, counts, seconds, costs, groups
    )


def _listed(table: dict[str, int]) -> str:
    return ", ".join(f"{number:,} {name}" for name, number in table.items())
