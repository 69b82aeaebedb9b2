"""Orientation of shells: which side is the top, directors of the nodes, frames of the section.

The director D of a node is the mean of the unit normals of the cells around it. Cells of a
connected surface turn the same side up.
"""

from __future__ import annotations

from collections.abc import Sequence

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix
import dolfinx.la
import numpy as np
import scipy.sparse as sp
from dolfinx import fem
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.mesh import Mesh

_KINK = 30.0
"""Degrees between the director and the normal of a cell beyond which a surface is not smooth."""
_ALONG = 1e-3
"""Part of the section's axis that must lie in the tangent plane."""


def cell_signs(mesh: Mesh, up: Array) -> Array:
    """Signs that turn the normals of all owned cells to the top; collective.

    Args:
        mesh: Surface mesh.
        up: How far the unit normal of each owned cell, by the order of its nodes, points up, 0
            where nothing is said about it, shape (n_cells,).

    Returns:
        1 or -1 per owned cell, shape (n_cells,). In each connected surface the side that is up for
        the sum of its cells, or to which its first cell points.

    Raises:
        InputError: A surface has one side only.
    """
    domain, comm = mesh.domain, mesh.comm
    topology = domain.topology
    n = topology.index_map(2).size_local
    original = np.asarray(compat.original_cell_index(domain), dtype=np.int64)[:n]
    n_vertices = len(basix.geometry(getattr(basix.CellType, topology.cell_name())))
    nodes = np.asarray(domain.geometry.input_global_indices)[compat.geometry_dofmap(domain)[:n]]
    gathered = comm.allgather((original, nodes[:, :n_vertices].astype(np.int64), up))
    order = np.argsort(np.concatenate([g[0] for g in gathered]), kind="stable")
    corners = np.concatenate([g[1] for g in gathered])[order]
    upward = np.concatenate([g[2] for g in gathered])[order]
    pieces, sign = _orient(corners)
    if pieces is None:
        raise InputError(
            f"mesh '{mesh.name}': a surface has one side only (a Moebius strip), so no top; cut it "
            "into parts with nodes of their own"
        )
    total = np.zeros(pieces.max(initial=0) + 1)
    np.add.at(total, pieces, sign * upward)
    sign = np.where(total[pieces] < 0.0, -sign, sign)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    begin = sum(len(g[0]) for g in gathered[: comm.rank])
    return np.asarray(sign[rank[begin : begin + n]])


def _orient(corners: Ints) -> tuple[Ints | None, Array]:
    """Connected pieces of cells, and signs that give neighbours the same side.

    Args:
        corners: Vertices of the cells, basix order, shape (n_cells, 3 or 4).

    Returns:
        Number of each cell's piece (``None`` if one has a single side), and signs, 1 for the first
        cell of each piece; both of shape (n_cells,).
    """
    n = len(corners)
    around = [0, 1, 2] if corners.shape[1] == 3 else [0, 1, 3, 2]
    ring = corners[:, around]
    edges = np.stack([ring, np.roll(ring, -1, axis=1)], axis=2).reshape(-1, 2)
    cell = np.repeat(np.arange(n), ring.shape[1])
    forward = edges[:, 0] < edges[:, 1]
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low))
    same = (np.diff(low[order]) == 0) & (np.diff(high[order]) == 0)
    # an edge of two cells connects them; where more meet, sides have no common meaning
    begins = np.flatnonzero(np.concatenate([[True], ~same]))
    pairs = begins[np.diff(np.append(begins, len(order))) == 2]
    a, b = order[pairs], order[pairs + 1]
    turned = forward[a] == forward[b]  # both run the same way along it: their sides differ
    one, other = cell[a], cell[b] + np.where(turned, n, 0)
    rows = np.concatenate([one, one + n])
    columns = np.concatenate([other, np.where(other < n, other + n, other - n)])
    graph = sp.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(2 * n, 2 * n))
    _, label = connected_components(graph, directed=False)
    if np.any(label[:n] == label[n:]):
        return None, np.ones(n)
    piece = np.minimum(label[:n], label[n:])
    _, first, piece = np.unique(piece, return_index=True, return_inverse=True)
    sign = np.where(label[:n] == label[first][piece], 1.0, -1.0)
    return piece, sign


def nodal_directors(space: fem.FunctionSpace, normals: Array, title: str) -> Array:
    """Unit directors of the local nodes, ghosts too; collective.

    Args:
        space: Space of the unknowns.
        normals: Unit normals of the owned cells at their nodes, shape (n_cells, n_cell_nodes, 3).
        title: Name of the mesh in messages.

    Returns:
        Shape (n_local_nodes, 3).

    Raises:
        InputError: The surface has a kink.
    """
    index_map, nodes = space.dofmap.index_map, space.dofmap.list[: len(normals)]
    total = dolfinx.la.vector(index_map, 3, dtype=np.float64)
    total.array[:] = 0.0
    np.add.at(total.array.reshape(-1, 3), nodes, normals)
    total.scatter_reverse(dolfinx.la.InsertMode.add)
    total.scatter_forward()
    d = np.array(total.array.reshape(-1, 3))
    d /= np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-300)
    cosine = np.einsum("cnx,cnx->cn", normals, d[nodes])
    problem = None
    if len(cosine) and cosine.min() < np.cos(np.radians(_KINK)):
        at = nodes[np.unravel_index(np.argmin(cosine), cosine.shape)]
        x = space.tabulate_dof_coordinates()[at]
        problem = (
            f"mesh '{title}': the shell has a kink at {format_point(x)}, where normals of cells "
            f"differ from the director by {np.degrees(np.arccos(cosine.min())):.0f} degrees; use "
            "smaller cells if the surface is smooth there; at the edge of two smooth parts, give "
            "each nodes of its own, as meshes that fxcrack reads have"
        )
    raise_on_all_ranks(compat.plain_comm(space.mesh.comm), problem)
    return np.asarray(d)


def section_axes(normal: Array, axis: Sequence[float]) -> tuple[Array, bool]:
    """Axes 1, 2, 3 of a section.

    Args:
        normal: Unit normals, shape (..., 3).
        axis: Direction that is projected on the tangent plane.

    Returns:
        Rows are the axes, shape (..., 3, 3), and whether the axis has a part in every tangent
        plane.
    """
    a = np.asarray(axis, dtype=float)
    a = a / np.linalg.norm(a)
    e1 = a - np.einsum("...x,x->...", normal, a)[..., None] * normal
    size = np.linalg.norm(e1, axis=-1, keepdims=True)
    e1 = e1 / np.maximum(size, 1e-300)
    fits = bool(size.min(initial=1.0) > _ALONG)
    return np.stack([e1, np.cross(normal, e1), normal], axis=-2), fits


def covariant_to_axes(basis: Array, axes: Array) -> Array:
    """Local Voigt strains, engineering shears, per covariant strain 11, 22, 33, 23, 13, 12.

    Args:
        basis: Columns are the covariant basis, shape (..., 3, 3).
        axes: Rows are the local axes, shape (..., 3, 3).

    Returns:
        Shape (..., 6, 6).
    """
    t = axes @ np.linalg.inv(basis).swapaxes(-1, -2)  # t[a, i] = G^i . e_a
    pairs = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
    out = np.empty((*t.shape[:-2], 6, 6))
    for row, (a, b) in enumerate(pairs):
        for column, (i, j) in enumerate(pairs):
            value = t[..., a, i] * t[..., b, j]
            if i != j:
                value = value + t[..., a, j] * t[..., b, i]
            out[..., row, column] = value if a == b else 2.0 * value
    return out


__all__ = ["cell_signs", "covariant_to_axes", "nodal_directors", "section_axes"]
