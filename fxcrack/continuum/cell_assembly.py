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
    add_to_vector(vector, space, parts)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector


def add_to_vector(
    vector: PETSc.Vec, space: fem.FunctionSpace, parts: list[tuple[Ints, Array]]
) -> None:
    """Add vectors of cells to a ghosted vector, ghosts too; the caller updates the owners.

    Args:
        vector: From :func:`fxcrack.base.compat.create_vector`.
        space: Space of the unknowns.
        parts: As in :func:`cell_vector`.
    """
    width = space.dofmap.index_map_bs
    with vector.localForm() as local:
        by_node = local.array.reshape(-1, width)
        for nodes, values in parts:
            np.add.at(by_node, nodes, values.reshape(*nodes.shape, width))


__all__ = ["add_matrices", "add_to_vector", "cell_pattern", "cell_vector"]
