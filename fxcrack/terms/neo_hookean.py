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

from fxcrack.continuum import Continuum
from fxcrack.errors import InputError
from fxcrack.models import PlaneStress
from fxcrack.terms.base import StoringTerm
from fxcrack.terms.kinematics import deformation_gradient


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
        domain = c.mesh.domain
        f = deformation_gradient(c.model, u, c.x)
        total = 0
        for i in self._parts:
            stiffness = c.part_materials[i].stiffness()
            mu = fem.Constant(domain, PETSc.ScalarType(stiffness[3, 3]))
            lame = fem.Constant(domain, PETSc.ScalarType(stiffness[0, 1]))
            if c.temperature is None:
                energy = density(f, mu, lame)
            else:
                from fxcrack import thermal

                stretch = 1 + c.temperature.rise * thermal.expansion(c, i)[0]
                energy = stretch**3 * density(f / stretch, mu, lame)
            total += energy * c.weight * c.parts[i][2]
        return total


def density(f: Any, mu: Any, lame: Any) -> Any:
    """Energy per undeformed volume at a deformation gradient of shape (3, 3)."""
    log_j = ufl.ln(ufl.det(f))
    return mu / 2 * (ufl.inner(f, f) - 3 - 2 * log_j) + lame / 2 * log_j**2
