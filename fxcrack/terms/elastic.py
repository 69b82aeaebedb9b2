"""Elastic bodies: W = 1/2 int (e - e0) : C : (e - e0) w dV, for small or finite strain.

With e the small strain the term is linear; with e the Green-Lagrange strain it is the
St. Venant-Kirchhoff material, for isotropic and orthotropic stiffness alike.
"""

from __future__ import annotations

from typing import Any

import ufl
from dolfinx import fem

from fxcrack.continuum import Continuum
from fxcrack.models import Axisymmetric
from fxcrack.terms.base import Term


def green_lagrange(model: Any, u: Any, x: Any) -> Any:
    """Voigt Green-Lagrange strain of a model, engineering shears, components as its small strain.

    E = 1/2 (grad u + grad u^t + grad u^t grad u),   hoop: u_r/r + 1/2 (u_r/r)^2
    """
    g = ufl.grad(u)
    square = g.T * g
    n = model.gdim
    quadratic = [0.5 * square[i, i] for i in range(n)]
    if isinstance(model, Axisymmetric):
        quadratic.append(0.5 * (u[0] / x[0]) ** 2)
    shears = [(1, 2), (0, 2), (0, 1)] if n == 3 else [(0, 1)]
    quadratic += [square[i, j] for i, j in shears]
    return model.strain(u, x) + ufl.as_vector(quadratic)


class Elastic(Term):
    """Elastic bodies of a continuum, all materials.

    Args:
        continuum: Materials, model and measures.
        finite: Green-Lagrange strain instead of the small one.
        eigenstrain: Stress-free strain e0 per part, in the order of the continuum's parts.
    """

    def __init__(
        self, continuum: Continuum, *, finite: bool = False, eigenstrain: list[Any] | None = None
    ) -> None:
        self._continuum = continuum
        self._finite = finite
        self._eigenstrain = eigenstrain
        self.name = "finite strain" if finite else "elasticity"
        self.constant = not finite

    def energy(self, u: fem.Function) -> Any:
        """Strain energy."""
        c = self._continuum
        strain = green_lagrange(c.model, u, c.x) if self._finite else c.model.strain(u, c.x)
        total = 0
        for i, (stiffness, _, dx) in enumerate(c.parts):
            e = strain if self._eigenstrain is None else strain - self._eigenstrain[i]
            total += 0.5 * ufl.inner(ufl.dot(stiffness, e), e) * c.weight * dx
        return total
