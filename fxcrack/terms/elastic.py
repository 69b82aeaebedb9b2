"""Elastic bodies: W = 1/2 int (e - e0) : C : (e - e0) w dV, for small or finite strain.

With e the small strain the term is linear; with e the Green-Lagrange strain it is the
St. Venant-Kirchhoff material, for isotropic and orthotropic stiffness alike.
"""

from __future__ import annotations

from typing import Any

import ufl
from dolfinx import fem

from fxcrack.continuum import Continuum
from fxcrack.terms.base import Term, parts_of
from fxcrack.terms.kinematics import green_lagrange


class Elastic(Term):
    """Elastic bodies of a continuum: all parts whose material names no other form.

    Args:
        continuum: Materials, model and measures.
        finite: Green-Lagrange strain instead of the small one.
    """

    def __init__(self, continuum: Continuum, *, finite: bool = False) -> None:
        self._continuum = continuum
        self._finite = finite
        self._parts = parts_of(continuum, "elastic")
        self.name = "finite strain" if finite else "elasticity"
        self.constant = not finite

    def energy(self, u: fem.Function) -> Any:
        """Strain energy."""
        c = self._continuum
        strain = green_lagrange(c.model, u, c.x) if self._finite else c.model.strain(u, c.x)
        total = 0
        for i in self._parts:
            stiffness, _, dx = c.parts[i]
            total += 0.5 * ufl.inner(ufl.dot(stiffness, strain), strain) * c.weight * dx
        return total
