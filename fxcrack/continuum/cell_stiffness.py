"""How stiff the cells around the nodes are, for springs between them.

    M = int C_nn N w dV/int N w dV,    V = int N w dV

with C_nn the largest modulus of uniaxial strain of the material, likewise its smallest shear
modulus; N is the shape function of the node.
"""

from __future__ import annotations

from typing import Any

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum


def moduli_at_nodes(continuum: Continuum) -> Array:
    """Modulus of uniaxial strain, shear modulus and volume of each owned dof; collective.

    Returns:
        Shape (n_local, 3): force/length^2 twice, length^3.

    Raises:
        InputError: A material has no stiffness at zero strain.
    """
    domain = continuum.mesh.domain
    v = ufl.TestFunction(continuum.space)
    one = ufl.as_vector([1.0] * continuum.gdim)
    forms: list[Any] = [0, 0, 0]
    for material, (_, _, dx) in zip(continuum.part_materials, continuum.parts, strict=True):
        if not hasattr(material, "stiffness"):
            raise InputError(
                f"stiffness='auto' takes the stiffness of bonds from that of the bodies, and "
                f"{type(material).__name__} has none at zero strain; give three numbers"
            )
        c = np.diag(np.asarray(material.stiffness()))
        for i, factor in enumerate((c[:3].max(), c[3:].min(), 1.0)):
            value = fem.Constant(domain, PETSc.ScalarType(float(factor)))
            forms[i] += value * ufl.inner(one, v) * continuum.weight * dx
    out = []
    for form in forms:
        vector = dolfinx.fem.petsc.assemble_vector(fem.form(form))
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        out.append(np.array(vector.array_r))
        vector.destroy()
    return np.column_stack([out[0] / out[2], out[1] / out[2], out[2]])


__all__ = ["moduli_at_nodes"]
