"""Nodes of their own for the smooth parts of a surface mesh that meet at kinks and T joints.

Two cells with a common edge belong to one smooth part where their directions across that edge, each
in the plane of its cell, differ by less than :data:`KINK`; of more than two cells that meet at an
edge the smoothest pair does. Around every other edge each smooth part gets nodes of its own, which
a joint keeps together (:mod:`fxcrack.continuum.shell_joints`). Where a kink fades out inside the
surface, the cells around its end are one smooth part, and the node there stays one.
"""

from __future__ import annotations

from dataclasses import replace

import basix
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Array, Ints
from fxcrack.mesh.raw import RawMesh, reference, row_ids
from fxcrack.mesh.split import images, vertices_of_nodes

KINK = 40.0
"""Degrees between neighbouring cells from which their edge is a kink."""


def part_at_kinks(raw: RawMesh) -> RawMesh:
    """Give smooth parts of a surface in space nodes of their own where they meet.

    Args:
        raw: The whole mesh, which is left as it is.

    Returns:
        The same mesh if it has no kink; otherwise one with further nodes at the end and
        ``joints``. Groups of edges and nodes hold all copies, those of edges and nodes that only
        touch a kink the copies of their own cells.
    """
    table = np.array(reference(raw.cell, raw.order).entity_closure_dofs[1])
    smooth, kinked = _edges(raw, table)
    if not len(kinked):
        return raw
    on_kink = np.zeros(len(raw.points), dtype=bool)
    on_kink[kinked] = True
    near = np.flatnonzero(on_kink[raw.cells].any(axis=1))
    row = np.full(len(raw.cells), -1, dtype=np.int64)
    row[near] = np.arange(len(near))
    nodes = raw.cells[near]

    # one number for every node on a kink as a cell sees it; equal where a smooth edge joins cells
    seen = np.full(nodes.shape, -1, dtype=np.int64)
    on = on_kink[nodes]
    seen[on] = np.arange(int(on.sum()))
    a, b = (np.divmod(smooth[:, k], len(table)) for k in (0, 1))
    both = (row[a[0]] >= 0) & (row[b[0]] >= 0)
    sides = []
    for cell, edge in (a, b):
        place = table[edge[both]]
        held = row[cell[both]][:, None]
        place = np.take_along_axis(place, np.argsort(nodes[held, place], axis=1), axis=1)
        sides.append(seen[held, place].ravel())
    ends = np.column_stack(sides)
    ends = ends[ends[:, 0] >= 0]
    n = int(on.sum())
    graph = coo_array((np.ones(len(ends), dtype=np.int8), (ends[:, 0], ends[:, 1])), (n, n))
    _, piece = connected_components(graph, directed=False)

    # the piece of most cells keeps the node, of equal ones that of the first cell
    owner = nodes[on]
    size = np.bincount(piece)
    order = np.lexsort((np.arange(n), -size[piece], owner))
    first = order[np.concatenate(([True], np.diff(owner[order]) != 0))]
    keeps = np.zeros(len(size), dtype=bool)
    keeps[piece[first]] = True
    moves = np.zeros(nodes.shape, dtype=bool)
    moves[on] = ~keeps[piece]
    moves &= moves[:, : raw.n_vertices(2)] @ vertices_of_nodes(raw)
    if not moves.any():
        return raw
    moved = piece[seen[moves]]
    new, position = np.unique(moved, return_inverse=True)
    renamed = nodes.copy()
    renamed[moves] = len(raw.points) + position
    of_new = np.empty(len(new), dtype=np.int64)
    of_new[position] = nodes[moves]
    cells = raw.cells.copy()
    cells[near] = renamed
    groups = {
        name: replace(group, rows=images(raw, group, nodes, renamed))
        for name, group in raw.groups.items()
    }
    original, number = np.unique(of_new, return_inverse=True)
    members = np.concatenate([original, len(raw.points) + np.arange(len(new))])
    joint = np.concatenate([np.arange(len(original)), number])
    order = np.lexsort((members, joint))
    return replace(
        raw,
        points=np.concatenate([raw.points, raw.points[of_new]]),
        cells=cells,
        groups=groups,
        joints=np.column_stack([members, joint])[order],
    )


def _edges(raw: RawMesh, table: Ints) -> tuple[Ints, Ints]:
    """Pairs of edges of cells across which the surface is smooth, and nodes of all other edges.

    Edges of cells are numbered cell by cell; edges of one cell only, the border, are neither.

    Args:
        raw: The mesh.
        table: Nodes of the cell's edges, vertices first, shape (n_edges, n_edge_nodes).

    Returns:
        Shapes (n_pairs, 2) and (n_nodes,).
    """
    ids = row_ids(np.sort(raw.cells[:, table[:, :2]].reshape(-1, 2), axis=1))
    across = _across(raw).reshape(-1, 3)
    by_id = np.argsort(ids, kind="stable")
    begins = np.flatnonzero(np.concatenate(([True], np.diff(ids[by_id]) != 0)))
    counts = np.diff(np.append(begins, len(ids)))
    limit = -np.cos(np.radians(KINK))
    two = begins[counts == 2]
    pairs = np.column_stack((by_id[two], by_id[two + 1]))
    flat = np.einsum("nx,nx->n", across[pairs[:, 0]], across[pairs[:, 1]]) <= limit
    smooth, kinked = [pairs[flat]], [pairs[~flat].ravel()]
    for begin, count in zip(begins[counts > 2], counts[counts > 2], strict=True):
        here = by_id[begin : begin + count]
        kinked.append(here)
        cosine = across[here] @ across[here].T
        np.fill_diagonal(cosine, 1.0)
        while cosine.min() <= limit:
            i, j = np.unravel_index(int(np.argmin(cosine)), cosine.shape)
            smooth.append(np.array([[here[i], here[j]]]))
            cosine[[i, j]] = 1.0
            cosine[:, [i, j]] = 1.0
    cell, edge = np.divmod(np.concatenate(kinked), len(table))
    return np.concatenate(smooth), np.unique(raw.cells[cell[:, None], table[edge]])


def _across(raw: RawMesh) -> Array:
    """Unit vectors out of each cell across the middles of its edges, (n_cells, n_edges, 3)."""
    kind = basix.CellType[raw.cell]
    corners = np.asarray(basix.geometry(kind))
    out = []
    for ends in basix.topology(kind)[1]:
        along, middle = corners[ends[1]] - corners[ends[0]], corners[ends].mean(axis=0)
        gradients = reference(raw.cell, raw.order).tabulate(1, middle[None])[1:, 0, :, 0]
        jacobian = np.einsum("ckx,dk->cxd", raw.points[raw.cells], gradients)
        edge = jacobian @ along
        outward = jacobian @ (middle - corners.mean(axis=0))
        edge /= np.linalg.norm(edge, axis=1, keepdims=True)
        outward -= np.einsum("cx,cx->c", outward, edge)[:, None] * edge
        out.append(outward / np.linalg.norm(outward, axis=1, keepdims=True))
    return np.stack(out, axis=1)


__all__ = ["KINK", "part_at_kinks"]
