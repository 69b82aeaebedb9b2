"""Splitting a conforming mesh along an internal named surface, before it is distributed.

A node of the surface is given to each pair (cell, node) that holds it; pairs of one node are joined
where their cells share a facet that holds the node and is not on the surface. Pieces of a node that
lie on different sides of the surface become different nodes. On the inner border of the surface
there is one piece only: such nodes, where the two sides remain connected, are not doubled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Ints
from fxcrack.base.checks import format_point, numbers, text
from fxcrack.base.errors import InputError, MeshError
from fxcrack.mesh.raw import Floats, RawGroup, RawMesh, distinct, reference, row_ids

_AMBIGUOUS = 1e-6


@dataclass(frozen=True)
class Split:
    """Split the mesh along a named internal surface into a slave and a master side.

    The slave side gets new nodes. The name of the surface is removed; groups of facets, edges and
    nodes that lie on it get both copies, those that only touch it stay with the cells they belong
    to.
    Where the surface ends inside the mesh, the nodes of that border are nodes of both sides; a
    facet with no corner node off that border cannot open and is in neither.

    Attributes:
        surface: Group of facets inside the mesh; it may end inside the mesh or at its boundary.
        slave: Name for the facets of the side ``toward`` points into.
        master: Name for the facets of the other side.
        toward: Direction from master to slave, shape (gdim,), any length; or the name of a group
            of cells that holds the slave side, for surfaces that close on themselves.
    """

    surface: str
    slave: str
    master: str
    toward: tuple[float, ...] | str

    def __post_init__(self) -> None:
        """Check the names and the direction.

        Raises:
            MeshError: One is not a text, or the direction holds no numbers.
        """
        try:
            for name in ("surface", "slave", "master"):
                text("Split", name, getattr(self, name))
            if isinstance(self.toward, str):
                text("Split", "toward", self.toward)
            else:
                words = "a direction, or the name of a group of cells"
                numbers("Split", "toward", self.toward, words=words)
        except InputError as error:
            raise MeshError(str(error)) from error


@dataclass(frozen=True)
class _Corners:
    """Cells around a surface and their pairs (cell, node on the surface).

    Attributes:
        cells: Indices of the cells with a node on the surface, sorted, shape (n_near,).
        nodes: Their nodes, shape (n_near, n_cell_nodes).
        pair: Number of the pair of each entry of ``nodes``, -1 off the surface.
        piece: Piece of its node each pair belongs to, numbered over all nodes, shape (n_pairs,).
        facets: Surface facets as (cell, local facet) of both sides, shape (n_facets, 2, 2); cells
            count within ``cells``.
    """

    cells: Ints
    nodes: Ints
    pair: Ints
    piece: Ints
    facets: Ints


def split_surface(raw: RawMesh, split: Split) -> RawMesh:
    """Split the mesh along one surface.

    Args:
        raw: The whole mesh, which is left as it is.
        split: What to split.

    Returns:
        A new mesh with the nodes of the slave side appended.

    Raises:
        MeshError: The surface is unknown, not made of facets, on the boundary, branched or
            one-sided, holds nothing to separate, or ``toward`` does not tell its sides apart; a
            new name is taken.
    """
    _check_names(raw, split)
    corners = _corners(raw, split.surface)
    slave_side = _slave_sides(raw, split, corners)

    each = np.arange(len(slave_side))
    sides = [corners.facets[each, slave_side], corners.facets[each, 1 - slave_side]]

    # Pieces seen from the slave side of some surface facet and not from the master side move.
    table = _facet_nodes(raw)
    slave_pieces, master_pieces = (
        corners.piece[corners.pair[side[:, :1], table[side[:, 1]]]] for side in sides
    )
    moves = np.zeros_like(corners.pair, dtype=bool)
    on = corners.pair >= 0
    moves[on] = np.isin(corners.piece[corners.pair[on]], np.setdiff1d(slave_pieces, master_pieces))
    moves &= moves[:, : raw.n_vertices(raw.tdim)] @ vertices_of_nodes(raw)
    if not moves.any():
        raise MeshError(
            f"splitting along '{split.surface}' separates nothing: all its corner nodes are on its "
            f"inner border; refine the mesh so that facets of the surface meet at a node inside "
            f"it, or extend it to the boundary"
        )
    doubled = np.unique(corners.nodes[moves])
    renamed = corners.nodes.copy()
    renamed[moves] = len(raw.points) + np.searchsorted(doubled, corners.nodes[moves])
    cells = raw.cells.copy()
    cells[corners.cells] = renamed

    groups = {
        name: RawGroup(group.dim, images(raw, group, corners.nodes, renamed))
        for name, group in raw.groups.items()
        if name != split.surface
    }
    facets = [renamed[side[:, :1], table[side[:, 1]]] for side in sides]
    parted = (np.sort(facets[0], axis=1) != np.sort(facets[1], axis=1)).any(axis=1)
    for name, rows in zip((split.slave, split.master), facets, strict=True):
        groups[name] = RawGroup(raw.tdim - 1, rows[parted])
    points = np.concatenate((raw.points, raw.points[doubled]))
    return replace(raw, points=points, cells=cells, groups=groups)


_EDGES = {2: ((0,), (1,)), 3: ((0, 1), (1, 2), (0, 2))}
"""Ends of an interval and edges of a triangle, by corners."""


def in_order(raw: RawMesh, splits: Sequence[Split]) -> list[Split]:
    """Splits in an order that does: a surface that ends on another one comes after it.

    Split first, a ply crack that ends on a delamination would leave three pieces around its end.

    Args:
        raw: The whole mesh.
        splits: As they were given, names not checked yet.

    Returns:
        The same ones, otherwise in the order given.
    """
    known = [s for s in splits if s.surface in raw.groups]
    parts = {s.surface: _border_and_inside(raw, s.surface) for s in known}
    left, out = list(splits), []
    while left:
        first = next((s for s in left if not _ends_on(s, left, parts)), left[0])
        left.remove(first)
        out.append(first)
    return out


def _ends_on(split: Split, others: list[Split], parts: dict[str, tuple[Ints, Ints]]) -> bool:
    """Whether the border of a surface has nodes inside one of some other surfaces."""
    none = np.zeros(0, dtype=np.int64)
    border = parts.get(split.surface, (none, none))[0]
    return any(
        np.isin(border, parts.get(o.surface, (none, none))[1]).any()
        for o in others
        if o.surface != split.surface
    )


def _border_and_inside(raw: RawMesh, surface: str) -> tuple[Ints, Ints]:
    """Corner nodes on the border of a surface, and the others of it."""
    group = raw.groups[surface]
    if group.dim != raw.tdim - 1 or group.dim == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    corners = group.rows[:, : raw.n_vertices(group.dim)]
    edges = _EDGES.get(corners.shape[1])
    if edges is None:  # quadrilaterals: the order of the splits is the user's
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    ends = np.sort(np.concatenate([corners[:, list(edge)] for edge in edges]), axis=1)
    every, counts = np.unique(ends, axis=0, return_counts=True)
    border = np.unique(every[counts == 1])
    return border, np.setdiff1d(corners, border)


def _check_names(raw: RawMesh, split: Split) -> None:
    """Refuse unknown and clashing names and a ``toward`` of the wrong form."""
    surface = raw.groups.get(split.surface)
    if surface is None or surface.dim != raw.tdim - 1:
        known = [n for n, g in raw.groups.items() if g.dim == raw.tdim - 1]
        raise MeshError(
            f"there is no group of facets '{split.surface}' to split along; groups of facets: "
            f"{', '.join(sorted(known)) or 'none'}"
        )
    taken = set(raw.names) - {split.surface}
    for name in (split.slave, split.master):
        if name in taken or split.slave == split.master:
            raise MeshError(
                f"splitting along '{split.surface}' cannot make a group '{name}': the name is "
                f"taken; choose names for slave and master that differ from each other and from "
                f"{', '.join(sorted(taken)) or 'the surface'}"
            )
    if isinstance(split.toward, str):
        if split.toward not in raw.cell_groups:
            raise MeshError(
                f"splitting along '{split.surface}': toward='{split.toward}' is no group of cells; "
                f"groups of cells: {', '.join(sorted(raw.cell_groups)) or 'none'}"
            )
        return
    toward = np.asarray(split.toward, dtype=float)
    if toward.shape != (raw.tdim,) or not np.isfinite(toward).all() or not toward.any():
        raise MeshError(
            f"splitting along '{split.surface}': toward={split.toward} must be a direction of "
            f"{raw.tdim} components, not all zero"
        )


def _facet_nodes(raw: RawMesh) -> Ints:
    """Local nodes of each facet of the reference cell, vertices first."""
    return np.array(reference(raw.cell, raw.order).entity_closure_dofs[raw.tdim - 1])


def vertices_of_nodes(raw: RawMesh) -> npt.NDArray[np.bool_]:
    """Which vertices span the part of the cell a node belongs to, shape (n_vertices, n_nodes).

    DOLFINx knows edges and facets by their vertices: a midside node can be doubled only together
    with a vertex of its edge or facet.
    """
    element = reference(raw.cell, raw.order)
    n_vertices = raw.n_vertices(raw.tdim)
    spans = np.zeros((n_vertices, element.dim), dtype=bool)
    for own, closure in zip(element.entity_dofs, element.entity_closure_dofs, strict=True):
        for nodes, with_boundary in zip(own, closure, strict=True):
            vertices = [v for v in with_boundary if v < n_vertices]
            spans[np.ix_(vertices, nodes)] = True
    return spans


def _corners(raw: RawMesh, surface: str) -> _Corners:
    """Find the cells around a surface and break its nodes into pieces."""
    n_vertices = raw.n_vertices(raw.tdim - 1)
    table = _facet_nodes(raw)
    rows = raw.groups[surface].rows
    on_surface = np.zeros(len(raw.points), dtype=bool)
    on_surface[rows] = True
    near = np.flatnonzero(on_surface[raw.cells].any(axis=1))
    nodes = raw.cells[near]

    # All facets of these cells, then the surface itself; equal vertices, equal number.
    facets = nodes[:, table].reshape(-1, table.shape[1])
    both = np.concatenate((facets[:, :n_vertices], rows[:, :n_vertices]))
    ids = row_ids(np.sort(both, axis=1))
    facet_ids, surface_ids = ids[: len(facets)], ids[len(facets) :]
    by_id = np.argsort(facet_ids, kind="stable")
    first = np.flatnonzero(np.diff(facet_ids[by_id]) == 0)
    couples = np.column_stack((by_id[first], by_id[first + 1]))
    is_surface = np.isin(facet_ids[couples[:, 0]], surface_ids)
    _check_two_sided(raw, surface, facet_ids, surface_ids, int(is_surface.sum()))

    pair = np.full(nodes.shape, -1, dtype=np.int64)
    on = on_surface[nodes]
    pair[on] = np.arange(on.sum())
    # Sorted by node, the two copies of a facet list the same nodes in the same order.
    inner = couples[~is_surface]
    cell, local = np.divmod(inner, len(table))
    here = table[local]
    here = np.take_along_axis(here, np.argsort(nodes[cell[..., None], here], axis=2), axis=2)
    joined = pair[cell[..., None], here]
    ends = np.column_stack((joined[:, 0].ravel(), joined[:, 1].ravel()))
    ends = ends[ends[:, 0] >= 0]
    _, piece = _components(int(on.sum()), ends)

    sides = np.stack(np.divmod(couples[is_surface], len(table)), axis=2)
    return _Corners(near, nodes, pair, piece, sides)


def _check_two_sided(
    raw: RawMesh, surface: str, facet_ids: Ints, surface_ids: Ints, n_inside: int
) -> None:
    """Refuse a surface whose facets do not all have a cell on either side."""
    if n_inside == len(surface_ids):
        return
    n_cells = np.bincount(facet_ids, minlength=int(surface_ids.max()) + 1)[surface_ids]
    bad = np.flatnonzero(n_cells != 2)[0]
    n_vertices = raw.n_vertices(raw.tdim - 1)
    where = format_point(raw.points[raw.groups[surface].rows[bad, :n_vertices]].mean(axis=0))
    n_bad = int((n_cells != 2).sum())
    if n_cells[bad] == 0:
        raise MeshError(
            f"{n_bad} of {len(surface_ids)} facets of '{surface}' belong to no cell, the first at "
            f"{where}; the surface must be embedded in the mesh (fragment)"
        )
    raise MeshError(
        f"{n_bad} of {len(surface_ids)} facets of '{surface}' are on the boundary of the mesh, the "
        f"first at {where}; only a surface inside the mesh, with a cell on either side, can be "
        f"split"
    )


def _slave_sides(raw: RawMesh, split: Split, corners: _Corners) -> Ints:
    """Which of the two sides of each surface facet is the slave, 0 or 1, shape (n_facets,).

    Sides of neighbouring facets belong together where they hold the same piece of a doubled node,
    so each connected patch is oriented as a whole.
    """
    table = _facet_nodes(raw)
    cell, local = corners.facets[..., 0], corners.facets[..., 1]
    # Sorted by node, so that the columns of both sides mean the same nodes.
    nodes = corners.nodes[cell[..., None], table[local]]
    order = np.argsort(nodes, axis=2)
    pair = np.take_along_axis(corners.pair[cell[..., None], table[local]], order, axis=2)
    piece = corners.piece[pair]
    _check_branches(raw, split.surface, np.take_along_axis(nodes, order, axis=2), piece)

    n_facets = len(cell)
    side_number = np.broadcast_to(np.arange(2 * n_facets).reshape(-1, 2, 1), piece.shape)
    doubled = piece[:, 0] != piece[:, 1]
    links = np.column_stack(
        (
            side_number.swapaxes(1, 2)[doubled].ravel(),
            2 * n_facets + piece.swapaxes(1, 2)[doubled].ravel(),
        )
    )
    _, patch = _components(2 * n_facets + int(corners.piece.max()) + 1, links)
    patch = np.unique(patch[: 2 * n_facets], return_inverse=True)[1].reshape(-1, 2)
    if np.any(patch[:, 0] == patch[:, 1]):
        raise MeshError(
            f"'{split.surface}' has only one side (it is twisted like a Moebius strip) and cannot "
            f"be split into slave and master"
        )
    vote, size = _votes(raw, split, corners)
    n_patches = int(patch.max()) + 1
    total = np.bincount(patch.ravel(), np.column_stack((vote, -vote)).ravel(), n_patches)
    sizes = np.bincount(patch.ravel(), np.column_stack((size, size)).ravel(), n_patches)
    unclear = np.flatnonzero(np.abs(total) <= _AMBIGUOUS * sizes)
    if len(unclear):
        first = np.flatnonzero(patch[:, 0] == unclear[0])
        first = first if len(first) else np.flatnonzero(patch[:, 1] == unclear[0])
        where = format_point(raw.points[corners.nodes[cell[first[0], 0]]].mean(axis=0))
        raise MeshError(
            f"toward={split.toward!r} does not tell the sides of '{split.surface}' apart near "
            f"{where}: it is perpendicular to the normal there, or the surface closes on itself; "
            f"give a direction across the surface or the name of the group of cells on the slave "
            f"side"
        )
    return (total[patch[:, 0]] < 0).astype(np.int64)


def _votes(raw: RawMesh, split: Split, corners: _Corners) -> tuple[Floats, Floats]:
    """Weight of each facet for its side 0 as the slave, and the largest possible weight.

    Shapes (n_facets,) each: area times the cosine between the normal into side 0 and ``toward``.
    """
    cell, local = corners.facets[..., 0], corners.facets[..., 1]
    if isinstance(split.toward, str):
        inside = np.isin(corners.cells[cell], raw.cell_groups[split.toward]).astype(float)
        return inside[:, 0] - inside[:, 1], np.ones(len(cell))
    n_vertices = raw.n_vertices(raw.tdim - 1)
    facet = corners.nodes[cell[:, :1], _facet_nodes(raw)[local[:, 0]]][:, :n_vertices]
    x = raw.points[facet]
    if raw.tdim == 2:
        normal = (x[:, 1] - x[:, 0]) @ np.array([[0.0, -1.0], [1.0, 0.0]])
    else:
        # Two edges of a triangle; the diagonals of a quadrilateral in DOLFINx order.
        normal = (
            np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
            if n_vertices == 3
            else np.cross(x[:, 3] - x[:, 0], x[:, 2] - x[:, 1])
        )
    across = raw.points[corners.nodes[cell[:, 0]]].mean(axis=1) - x.mean(axis=1)
    normal *= np.sign(np.sum(normal * across, axis=1))[:, None]
    toward = np.asarray(split.toward, dtype=float)
    return normal @ (toward / np.linalg.norm(toward)), np.linalg.norm(normal, axis=1)


def _check_branches(raw: RawMesh, surface: str, nodes: Ints, piece: Ints) -> None:
    """Refuse a surface that parts the mesh around a node into more than two pieces."""
    held = np.unique(np.column_stack((nodes.ravel(), piece.ravel())), axis=0)
    owners, counts = np.unique(held[:, 0], return_counts=True)
    if np.any(counts > 2):
        where = format_point(raw.points[owners[counts > 2][0]])
        raise MeshError(
            f"'{surface}' branches or crosses itself at {where}; give its branches names of their "
            f"own and split along one after the other"
        )


def _components(n: int, links: Ints) -> tuple[int, Ints]:
    """Number of connected components of n vertices, and the component of each."""
    graph = coo_array((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), (n, n))
    count, labels = connected_components(graph, directed=False)
    return int(count), labels.astype(np.int64)


def images(raw: RawMesh, group: RawGroup, nodes: Ints, renamed: Ints) -> Ints:
    """What the entities of a group become: the distinct images in the cells that hold them.

    Args:
        raw: The mesh before the split.
        group: The group before the split.
        nodes: Nodes of the cells around the surface before the split.
        renamed: The same after it.

    Returns:
        Nodes of the entities after the split, shape (n_entities, n_entity_nodes).
    """
    changed = np.zeros(len(raw.points), dtype=bool)
    changed[nodes[nodes != renamed]] = True
    touched = changed[group.rows].any(axis=1)
    rows = group.rows[touched]
    if not len(rows):
        return group.rows
    n_vertices = raw.n_vertices(group.dim)
    shared = (
        _incidence(rows[:, :n_vertices], len(raw.points)) @ _incidence(nodes, len(raw.points)).T
    )
    shared = coo_array(shared)
    holds = shared.data == n_vertices
    entity, cell = shared.row[holds], shared.col[holds]
    # Where in the cell each node of the entity stands.
    position = np.argmax(nodes[cell][:, None, :] == rows[entity][:, :, None], axis=2)
    images = renamed[cell[:, None], position]
    return np.concatenate((group.rows[~touched], images[distinct(images, n_vertices)[0]]))


def _incidence(rows: Ints, n_nodes: int) -> csr_array:
    """Sparse matrix with a one for every node of every row."""
    n, width = rows.shape
    ones: npt.NDArray[np.int32] = np.ones(rows.size, dtype=np.int32)
    return csr_array((ones, rows.ravel(), np.arange(0, rows.size + 1, width)), shape=(n, n_nodes))
