"""The mesh of a scene as it was given, whole, on rank 0: for the writer of decks."""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.mesh.mesh import Group, Mesh
from fxcrack.mesh.raw import reference


@dataclass(frozen=True)
class Gathered:
    """A mesh in the numbering in which it was given.

    Attributes:
        cell: Cell shape.
        order: Of the geometry.
        points: Positions, shape (n_nodes, gdim), length.
        cells: Nodes of the cells in DOLFINx order, shape (n_cells, n_cell_nodes).
        groups: Of each named group its dimension, and its cells (dimension of the cells), its
            facets as (cell, local facet) or its nodes; of surfaces in space, edges as their nodes.
        signs: -1 where the order of a cell's nodes does not show its top, of shells,
            shape (n_cells,).
    """

    cell: str
    order: int
    points: Array
    cells: Ints
    groups: dict[str, tuple[int, Ints]]
    signs: Array


def gather(mesh: Mesh, signs: Array | None = None) -> Gathered | None:
    """The whole mesh on rank 0, ``None`` on the others; collective.

    Facets between two cells are left out: they are no surface of a body. Nodes that parts of a
    surface have of their own in a joint are one again.

    Args:
        mesh: The mesh.
        signs: Of shells, 1 or -1 per owned cell; 1 by default.
    """
    domain, comm = mesh.domain, mesh.comm
    given = np.asarray(domain.geometry.input_global_indices)
    original = compat.original_cell_index(domain)
    geometry = np.asarray(compat.geometry_dofmap(domain), dtype=np.int64)
    n_owned = domain.topology.index_map(mesh.tdim).size_local
    signs = np.ones(n_owned) if signs is None else np.asarray(signs)
    parts = comm.gather(
        (
            *(given, domain.geometry.x[:, : mesh.gdim]),
            *(original[:n_owned], given[geometry[:n_owned]], signs),
        )
    )
    groups = {}
    for name in sorted(mesh.groups):
        group = mesh.groups[name]
        found = comm.gather(_members(mesh, group, given, original, geometry))
        if found is not None:
            edges = mesh.gdim > mesh.tdim > group.dim
            groups[name] = (0 if edges else group.dim, np.unique(np.concatenate(found), axis=0))
    if parts is None:
        return None
    # numbers of nodes that were given but used by no cell are closed up
    used = np.unique(np.concatenate([p[0] for p in parts]))
    points = np.zeros((len(used), mesh.gdim))
    n_cells = sum(len(p[2]) for p in parts)
    cells = np.zeros((n_cells, parts[0][3].shape[1]), dtype=np.int64)
    same = _joined(used, mesh.joints)
    top = np.ones(n_cells)
    for numbers, x, which, nodes, sign in parts:
        points[np.searchsorted(used, numbers)] = x
        cells[which] = same[np.searchsorted(used, nodes)]
        top[which] = sign
    for name, (dim, rows) in groups.items():
        if rows.ndim == 1 and dim < mesh.tdim:
            groups[name] = (dim, np.unique(same[np.searchsorted(used, rows)]))
    cell = domain.topology.cell_name()
    return Gathered(cell, mesh.order, points, cells, groups, top)


def _joined(used: Ints, joints: Ints) -> Ints:
    """The node that stands for each node, the first of its joint, shape (n_nodes,).

    Args:
        used: Numbers of the nodes in the input, ascending.
        joints: Number in the input, and joint, sorted by the latter, shape (n, 2).
    """
    same = np.arange(len(used))
    if len(joints):
        at = np.searchsorted(used, joints[:, 0])
        _, first, which = np.unique(joints[:, 1], return_index=True, return_inverse=True)
        same[at] = at[first][which]
    return same


def _members(mesh: Mesh, group: Group, given: Ints, original: Ints, geometry: Ints) -> Ints:
    """Members of a group that this rank owns, in the numbering of the input."""
    topology, tdim = mesh.domain.topology, mesh.tdim
    owned = group.entities[group.entities < topology.index_map(group.dim).size_local]
    if group.dim == tdim:
        return np.asarray(original[owned], dtype=np.int64)
    if group.points is not None:
        return np.asarray(given[group.points], dtype=np.int64)
    topology.create_connectivity(group.dim, tdim)
    topology.create_connectivity(tdim, group.dim)
    up = topology.connectivity(group.dim, tdim)
    down = topology.connectivity(tdim, group.dim)
    element = reference(topology.cell_name(), mesh.order)
    closures = element.entity_closure_dofs[group.dim]
    facets, nodes = [], []
    for entity in owned:
        cells = up.links(entity)
        cell = int(cells[0])
        local = int(np.flatnonzero(down.links(cell) == entity)[0])
        nodes.append(given[geometry[cell][closures[local]]])
        if len(cells) == 1:
            facets.append((original[cell], local))
    if group.dim == tdim - 1 and mesh.gdim == tdim:
        return np.array(facets, dtype=np.int64).reshape(-1, 2)
    flat = np.concatenate(nodes) if nodes else np.zeros(0)
    return np.unique(flat.astype(np.int64))
