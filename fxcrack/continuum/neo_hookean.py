"""Neo-Hookean bodies: W = mu/2 (tr F^t F - 3 - 2 ln J) + lambda/2 (ln J)^2 per undeformed volume.

With a temperature F = F_e (1 + expansion (T - T_ref)): the energy is that of the elastic part F_e
per volume of the freely expanded body.

Plane strain, axisymmetric and three-dimensional bodies; the stretch out of a plane is 1.
"""

from __future__ import annotations

from typing import Any

import ufl
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.kinematics import (
    PlaneStress,
    cofactor,
    deformation_gradient,
    displacement_gradient,
    labelled,
)
from fxcrack.continuum.term import StoringTerm
from fxcrack.continuum.thermal_strain import at_rise, expansion

_CLOSE = 0.05
"""Where the difference over the sum is less, a series to its 10th power is exact to 1e-17."""


class NeoHookeanBodies(StoringTerm):
    """The parts of a continuum made of :class:`fxcrack.NeoHookean`.

    Args:
        continuum: Materials, model and measures.

    Raises:
        InputError: The model is plane stress.
    """

    name = "neo-Hookean material"
    finite = True

    def __init__(self, continuum: Continuum) -> None:
        if isinstance(continuum.model, PlaneStress):
            raise InputError(
                "NeoHookean: its thickness stretch is not solved for in plane stress; use "
                "PlaneStrain, Axisymmetric or Solid, or an Isotropic material with finite strain"
            )
        super().__init__(continuum, "neo_hookean")

    def energy(self, u: fem.Function) -> Any:
        """Strain energy."""
        c = self._continuum
        total = 0
        for i in self._parts:
            f, stretch, mu, lame = self._elastic_part(u, i)
            total += stretch**3 * density(f, mu, lame) * c.weight * c.parts[i][2]
        return total

    def mean_residual(
        self, u: fem.Function, begin: fem.Function, v: Any, rise: fem.Function | None = None
    ) -> Any:
        """Forces over an increment whose work is the change of the strain energy, UFL.

        With C = F^t F, j = det C and the thermal stretch s,

            W = mu/2 (s tr C - 3 s^3) + s^3 phi(ln j - 6 ln s)

        The mean of the cofactor of C by Simpson's rule times the change of C is the change of j,
        phi and ln have difference quotients, and the change of a product is the mean of one factor
        times the change of the other, both ways.

        Args:
            u: Displacement at the end.
            begin: Displacement at the beginning.
            v: Test function.
            rise: T - T_ref at the beginning, where the bodies have a temperature.
        """
        c = self._continuum
        change = displacement_gradient(c.model, v, c.x)
        first, last = (deformation_gradient(c.model, x, c.x) for x in (begin, u))
        middle = 0.5 * (first + last)
        c0, c1 = first.T * first, last.T * last
        mean = (cofactor(c0) + 4 * cofactor(0.5 * (c0 + c1)) + cofactor(c1)) / 6
        j0, j1 = ufl.det(c0), ufl.det(c1)
        total = 0
        for i in self._parts:
            _, s1, mu, lame = self._elastic_part(u, i)
            s0 = at_rise(c, s1, rise)
            logs = ufl.ln(j0) + ufl.ln(j1)
            if c.temperature is not None:
                logs -= 6 * (ufl.ln(s0) + ufl.ln(s1))
            slope = 0.5 * (s0**3 + s1**3) * _log_quotient(j0, j1) * (-mu / 2 + lame / 8 * logs)
            stress = 0.5 * (s0 + s1) * mu * ufl.Identity(3) + 2 * slope * mean
            total += ufl.inner(middle * stress, change) * c.weight * c.parts[i][2]
        return total

    def _elastic_part(self, u: fem.Function, i: int) -> tuple[Any, Any, Any, Any]:
        """Elastic deformation gradient, thermal stretch and the two moduli of a part."""
        c = self._continuum
        f = deformation_gradient(c.model, u, c.x)
        stiffness = c.part_materials[i].stiffness()
        mu, lame = (
            fem.Constant(c.mesh.domain, PETSc.ScalarType(v))
            for v in (stiffness[3, 3], stiffness[0, 1])
        )
        if c.temperature is None:
            return f, 1, mu, lame
        stretch = 1 + c.temperature.rise * expansion(c, i)[0]
        return f / stretch, stretch, mu, lame

    def stresses(self, u: fem.Function) -> list[tuple[Any, Any]]:
        """Cauchy stress (mu (F_e F_e^t - 1) + lambda ln J_e)/J_e."""
        c = self._continuum
        out = []
        for i in self._parts:
            f, _, mu, lame = self._elastic_part(u, i)
            one, j = ufl.Identity(3), ufl.det(f)
            stress = (mu * (f * f.T - one) + lame * ufl.ln(j) * one) / j
            out.append((labelled(c.model, stress), c.parts[i][2]))
        return out


def density(f: Any, mu: Any, lame: Any) -> Any:
    """Energy per undeformed volume at a deformation gradient of shape (3, 3)."""
    log_j = ufl.ln(ufl.det(f))
    return mu / 2 * (ufl.inner(f, f) - 3 - 2 * log_j) + lame / 2 * log_j**2


def _log_quotient(a: Any, b: Any) -> Any:
    """(ln b - ln a)/(b - a), also where a and b are close, by 2/(a + b) artanh(r)/r."""
    r = (b - a) / (b + a)
    square = r**2
    series = 1 + square * (
        1 / 3 + square * (1 / 5 + square * (1 / 7 + square * (1 / 9 + square / 11)))
    )
    far = ufl.gt(square, _CLOSE**2)
    # neither branch may divide by zero
    return 2 / (a + b) * ufl.conditional(far, _artanh_over(ufl.conditional(far, r, 0.5)), series)


def _artanh_over(r: Any) -> Any:
    return ufl.ln((1 + r) / (1 - r)) / (2 * r)
