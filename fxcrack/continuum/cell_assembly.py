"""Matrices and vectors of cells into those of the bodies; collective where PETSc is."""

from __future__ import annotations

from typing import Any

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints


def cell_pattern(space: fem.FunctionSpace) -> Any:
    """A compiled form that couples all unknowns of each cell."""
    v, u = ufl.TestFunction(space), ufl.TrialFunction(space)
    return fem.form(ufl.inner(u, v) * ufl.dx(space.mesh))


def add_matrices(matrix: PETSc.Mat, nodes: Ints, values: Array) -> None:
    """Add matrices of cells; the caller assembles.

    Args:
        matrix: Made from :func:`cell_pattern`.
        nodes: Local nodes of the cells, shape (n_cells, n_nodes).
        values: Shape (n_cells, n, n) with all unknowns of each node in turn.
    """
    if len(nodes):
        rows = np.ascontiguousarray(nodes, dtype=PETSc.IntType)
        matrix.setValuesBlockedLocalRCV(rows, rows, values, addv=PETSc.InsertMode.ADD_VALUES)


def cell_vector(space: fem.FunctionSpace, parts: list[tuple[Ints, Array]]) -> PETSc.Vec:
    """Sum of vectors of cells on the owned dofs; collective; the caller destroys it.

    Args:
        space: Space of the unknowns.
        parts: Local nodes of owned cells, shape (n_cells, n_nodes), and their values, shape
            (n_cells, n) with all unknowns of each node in turn.
    """
    vector = compat.create_vector(space)
    with vector.localForm() as local:
        for nodes, values in parts:
            add_forces(local.array, nodes, values)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector


def add_forces(forces: Array, nodes: Ints, values: Array) -> None:
    """Add vectors of cells to values of the local dofs, ghosts too; the caller sums up over ranks.

    Args:
        forces: Shape (n_dofs,), changed in place.
        nodes: Local nodes of the cells, shape (n_cells, n_nodes).
        values: Shape (n_cells, n) with all unknowns of each node in turn.
    """
    if not len(nodes):
        return
    width = values.size // nodes.size
    place = (width * nodes[..., None] + np.arange(width)).ravel()
    forces += np.bincount(place, values.ravel(), minlength=len(forces))


__all__ = ["add_forces", "add_matrices", "cell_pattern", "cell_vector"]
