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
from fxcrack.continuum.kinematics import PlaneStress, deformation_gradient, labelled
from fxcrack.continuum.term import StoringTerm
from fxcrack.continuum.thermal_strain import expansion


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
