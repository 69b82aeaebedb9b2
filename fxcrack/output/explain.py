"""What a scene is made of, how it is solved and why, and what each part of it has cost.

Nothing is estimated: unknowns and terms are counted, seconds are those of the runs so far.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fxcrack.scene import Scene

INTERFACE_LAWS = ("contact", "friction", "softening")


@dataclass(frozen=True)
class Explanation:
    """A scene in numbers.

    Attributes:
        path: "condensed" or "newton".
        why: Reasons for the path.
        effects: What is on beyond small linear elasticity.
        unknowns: How many there are, by kind; kinds that the scene lacks are not listed.
        counts: Form terms, compiled forms, factorisations, nonlinear iterations so far.
        phases: Seconds of the runs so far, by phase of the solution.
        costs: Seconds of the runs so far, by effect.
    """

    path: str
    why: tuple[str, ...]
    effects: tuple[str, ...]
    unknowns: dict[str, int]
    counts: dict[str, int]
    phases: dict[str, float]
    costs: dict[str, float]

    def __str__(self) -> str:
        """Several lines for a terminal."""
        lines = [f"path: {self.path}, because {'; '.join(self.why)}"]
        lines.append("effects: " + ("; ".join(self.effects) or "none beyond linear elasticity"))
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


def explain(scene: Scene) -> Explanation:
    """Look at a scene; the same on every rank."""
    model = scene.solver
    unknowns = {"displacements": scene.continuum.n_global}
    counts = {"form terms": 1, "factorisations": model.timings.factorizations}
    costs: dict[str, float] = {}
    if model.prepared:
        system = model.system
        unknowns["jumps in the window"] = system.n_retained
        for kind, number in (
            ("contact nodes", int(system.contact.sum())),
            ("friction nodes", 0 if system.friction is None else len(system.friction.rows)),
            ("softening bonds", len(system.soft.bonds)),
        ):
            if number:
                unknowns[kind] = number
        costs = {k: v for k, v in model.law_seconds.items() if k in INTERFACE_LAWS}
    bodies = getattr(model, "bodies", None)
    if bodies is not None:
        kept = sum(np.size(v) for term in bodies.terms for v in term.state().values())
        kept = int(scene.mesh.comm.allreduce(kept))
        if kept:
            unknowns["remembered values"] = kept
        counts["form terms"] = len(bodies.terms)
        counts["compiled forms"] = bodies.n_forms
        counts["nonlinear solves"] = model.counts.solves  # type: ignore[attr-defined]
        counts["iterations"] = model.counts.iterations  # type: ignore[attr-defined]
        costs = {**bodies.seconds, **costs}
    return Explanation(
        scene.plan.path,
        scene.plan.why,
        scene.plan.effects,
        unknowns,
        counts,
        dict(model.timings.seconds),
        costs,
    )


def _listed(table: dict[str, int]) -> str:
    return ", ".join(f"{number:,} {name}" for name, number in table.items())
