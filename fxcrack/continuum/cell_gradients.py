"""Gradients of the displacement at the middle of cells, without compiled forms."""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix
import numpy as np
from dolfinx import fem

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.continuum import Continuum


@dataclass(frozen=True, eq=False)
class CellGradients:
    """Gradients in the cells that this rank owns, or in some of them.

    Attributes:
        gradient: du_i/dx_j at the middle of each cell, shape (n_cells, gdim, gdim);
            nothing changes out of the plane of generalised plane strain.
        volume: Volume of each cell, or its area, by the Jacobian there, shape (n_cells,); of
            several dimensions only up to a common factor.
        nodes: Nodes of each cell on this rank, ghosts included, shape (n_cells, n_nodes).
    """

    gradient: Array
    volume: Array
    nodes: Ints

    @classmethod
    def of(cls, continuum: Continuum, displacement: Array, *, every: int = 1) -> CellGradients:
        """Those of a displacement; collective.

        Args:
            continuum: Solid bodies.
            displacement: Of the dofs that this rank owns, shape (n_local,), length.
            every: Distance of the cells that are looked at in their numbering; 1 takes all.
        """
        domain, gdim, flat = continuum.mesh.domain, continuum.gdim, continuum.mesh.gdim
        u = fem.Function(continuum.space)
        u.x.array[: len(displacement)] = displacement
        u.x.scatter_forward()
        n = int(domain.topology.index_map(continuum.mesh.tdim).size_local)
        nodes = np.asarray(continuum.space.dofmap.list)[:n:every].astype(np.int64)
        values = continuum.layout.displacements(u.x.array)[nodes]
        x = domain.geometry.x[compat.geometry_dofmap(domain)[:n:every]][:, :, :flat]
        cell = getattr(basix.CellType, domain.topology.cell_name())
        middle = basix.geometry(cell).mean(axis=0)[None]
        jacobian = np.einsum("cni,jn->cij", x, _shapes(cell, continuum.mesh.order, middle))
        moved = np.einsum("cni,jn->cij", values, _shapes(cell, continuum.order, middle))
        volume = np.abs(np.linalg.det(jacobian))
        gradient = np.zeros((len(nodes), gdim, gdim))
        gradient[:, :, :flat] = moved @ np.linalg.inv(jacobian)
        return cls(gradient, volume, nodes)


def _shapes(cell: basix.CellType, order: int, at: Array) -> Array:
    """Gradients of the Lagrange shape functions of a cell at one point, shape (tdim, n_nodes)."""
    element = basix.create_element(
        basix.ElementFamily.P, cell, order, basix.LagrangeVariant.gll_warped
    )
    return np.asarray(element.tabulate(1, at)[1:, 0, :, 0])


__all__ = ["CellGradients"]
