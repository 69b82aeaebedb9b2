"""Stress of the bodies: at a small strain, as means of cells, von Mises."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import basix.ufl
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem

from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.thermal_strain import whole_stress


def small_stress(continuum: Continuum, i: int, strain: Any) -> Any:
    """Stress of a part at a small strain and the present temperature, UFL.

    Args:
        continuum: Materials, model and temperature.
        i: Which part.
        strain: Voigt strain of the model, UFL.

    Returns:
        All components, in the order of ``model.stress_labels``.
    """
    if continuum.temperature is None:
        return ufl.dot(continuum.parts[i][1], strain)
    return whole_stress(continuum, i, strain)


def tied_stress(continuum: Continuum, i: int, u: fem.Function, *, finite: bool) -> fem.Function:
    """Stress of a part that is a first-order continuum shell, by its own strains; collective.

    Args:
        continuum: Bodies with ``tied_cells``.
        i: Which part.
        u: Displacement, length.
        finite: Cauchy stress of the Green-Lagrange strain.

    Returns:
        Means of its cells, 0 in others, components in the order of ``model.stress_labels``.
    """
    part, n = continuum.tied_cells[i], len(continuum.model.stress_labels)
    domain = continuum.mesh.domain
    element = basix.ufl.element("DG", domain.basix_cell(), 0, shape=(n,))
    out = fem.Function(fem.functionspace(domain, element))
    dofs = out.function_space.dofmap.list[part.cells, 0]
    out.x.array.reshape(-1, n)[dofs] = part.stress_means(u, finite=finite)
    out.x.scatter_forward()
    return out


def cell_stress(continuum: Continuum, u: fem.Function) -> fem.Function:
    """Cell averages of the stress of the small strain; collective.

    At the present temperature (``continuum.temperature.set(time)``).

    Args:
        continuum: Materials, model and temperature.
        u: Displacement, length.

    Returns:
        A function constant in each cell, components in the order of ``model.stress_labels``,
        force/length^2.
    """
    strain = continuum.model.strain(u, continuum.x)
    parts = [
        (
            tied_stress(continuum, i, u, finite=False)
            if i in continuum.tied_cells
            else small_stress(continuum, i, strain),
            dx,
        )
        for i, (_, _, dx) in enumerate(continuum.parts)
    ]
    return cell_means(continuum, parts)


def cell_means(continuum: Continuum, stresses: Sequence[tuple[Any, Any]]) -> fem.Function:
    """Cell averages of UFL stresses, weighted as volumes are; collective.

    Args:
        continuum: Model and mesh.
        stresses: One per part with its measure, components in the order of ``model.stress_labels``.

    Returns:
        A function constant in each cell, the same components.
    """
    n, domain = len(continuum.model.stress_labels), continuum.mesh.domain
    element = basix.ufl.element("DG", domain.basix_cell(), 0, shape=(n,))
    space = fem.functionspace(domain, element)
    test = ufl.TestFunction(space)
    volume = dolfinx.fem.petsc.assemble_vector(
        fem.form(ufl.inner(ufl.as_vector([1.0] * n), test) * continuum.weight * ufl.dx)
    )
    sigma = sum(ufl.inner(stress, test) * continuum.weight * dx for stress, dx in stresses)
    integral = dolfinx.fem.petsc.assemble_vector(fem.form(sigma))
    out = fem.Function(space, name="stress")
    local = len(volume.array)
    out.x.array[:local] = integral.array / volume.array
    out.x.scatter_forward()
    volume.destroy()
    integral.destroy()
    return out


def von_mises(continuum: Continuum, stress: fem.Function) -> fem.Function:
    """Von Mises stress per cell, of the cell averages of the stress.

    Args:
        continuum: Model and mesh.
        stress: From :func:`cell_stress` or :func:`cell_means`.

    Returns:
        A scalar function constant in each cell, force/length^2.
    """
    s = stress.x.array.reshape(-1, len(continuum.model.stress_labels))
    a, b, c = s[:, :3].T  # the normal stresses come first in every model
    shears = s[:, 3:].T
    space = fem.functionspace(continuum.mesh.domain, ("DG", 0))
    out = fem.Function(space, name="von_mises")
    out.x.array[:] = np.sqrt(
        0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) + 3.0 * sum(t**2 for t in shears)
    )
    return out
