"""Mass at the nodes alone, by row sums, for explicit dynamics.

    m_i = int rho N_i w dV

with the weight w of the kinematic model. Row sums keep the whole mass and its centre of each
element; of first-order elements all of them are positive.
"""

from __future__ import annotations

from typing import Any

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.materials import Material


def density_of(effect: Inertia, material: Material) -> float:
    """Mass per undeformed volume of a part.

    Raises:
        InputError: Neither the effect nor the material has one.
    """
    density: Any = getattr(material, "density", None) if effect.density is None else effect.density
    if density is None:
        raise InputError(
            f"Inertia: {material} has no density; give Inertia(density=...) or density= in the "
            "material"
        )
    return float(density)


def lumped_mass(continuum: Continuum, effect: Inertia) -> Array:
    """Mass of every owned dof, shape (n_local,), mass; collective.

    Args:
        continuum: Displacement space, materials and measures; first order.
        effect: Density of the bodies.

    Raises:
        InputError: A part has no density, or elements are of second order.
    """
    if continuum.order != 1:
        raise InputError(
            "explicit dynamics needs first-order elements: row sums of second-order ones give "
            "corner nodes a negative mass; write Scene(..., order=1)"
        )
    domain = continuum.mesh.domain
    v = ufl.TestFunction(continuum.space)
    one = ufl.as_vector([1.0] * continuum.gdim)
    form: Any = 0
    for material, (_, _, dx) in zip(continuum.part_materials, continuum.parts, strict=True):
        density = fem.Constant(domain, PETSc.ScalarType(density_of(effect, material)))
        form += density * ufl.inner(one, v) * continuum.weight * dx
    vector = dolfinx.fem.petsc.assemble_vector(fem.form(form))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    mass = np.array(vector.array_r)
    vector.destroy()
    bad = np.flatnonzero(~(mass > 0.0))
    raise_on_all_ranks(
        continuum.comm,
        f"explicit dynamics: {len(bad)} unknowns have no mass, the first at node "
        f"{continuum.positions()[bad[0] // continuum.gdim]}; look for cells without volume there"
        if len(bad)
        else None,
    )
    return mass
