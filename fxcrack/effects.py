"""Effects a scene may ask for, and the solver path they need.

A bare scene is linear and condensed once. Each effect adds one form term in the bodies or one law
of the interface; what is not named does not exist in the scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fxcrack.continuum import Continuum
from fxcrack.terms import Term


@dataclass(frozen=True)
class FiniteStrain:
    """Large rotations and strains of the bodies.

    Elastic materials follow the St. Venant-Kirchhoff law (their stiffness between the second
    Piola-Kirchhoff stress and the Green-Lagrange strain).
    """


Effect = FiniteStrain


@dataclass(frozen=True)
class Plan:
    """How a scene is solved, and why.

    Attributes:
        path: "condensed" or "newton".
        why: One sentence per reason.
    """

    path: str
    why: tuple[str, ...]


def plan(effects: Sequence[Effect], path: str | None) -> Plan:
    """Choose the solver path.

    Args:
        effects: What the scene asks for.
        path: The path the user insists on, ``None`` for the cheapest that will do.
    """
    nonlinear = [type(e).__name__ for e in effects if isinstance(e, FiniteStrain)]
    if nonlinear:
        return Plan("newton", tuple(f"{name} makes the bodies nonlinear" for name in nonlinear))
    if path == "newton":
        return Plan("newton", ("path='newton' was asked for; the bodies are linear",))
    return Plan("condensed", ("the bodies are linear: one factorisation serves all increments",))


def form_terms(continuum: Continuum, effects: Sequence[Effect]) -> list[Term]:
    """Terms of the bodies on the Newton path."""
    from fxcrack.terms.elastic import Elastic

    return [Elastic(continuum, finite=any(isinstance(e, FiniteStrain) for e in effects))]
