"""How a scene is solved: which solver its effects need, and why."""

from __future__ import annotations

from dataclasses import dataclass

SOLVERS = ("linear", "newton")
"""Names of the solvers that a scene can ask for."""


@dataclass(frozen=True)
class Plan:
    """How a scene is solved, and why.

    Attributes:
        solver: "linear" (:class:`~fxcrack.solvers.linear.LinearSolver`: one condensed stiffness) or
            "newton" (:class:`~fxcrack.solvers.newton.NewtonSolver`).
        why: Reasons for the choice, one sentence each.
        effects: Effects that are on, one sentence each.
    """

    solver: str
    why: tuple[str, ...]
    effects: tuple[str, ...]
