"""From arrays on rank 0 to a distributed DOLFINx mesh with its named groups."""

from __future__ import annotations

from dataclasses import replace

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh as Domain
from mpi4py import MPI

from fxcrack.base.errors import MeshError
from fxcrack.mesh.kinks import part_at_kinks
from fxcrack.mesh.mesh import Group, Mesh
from fxcrack.mesh.raw import RawMesh, distinct, vertices_of


def distribute(raw: RawMesh | None, comm: MPI.Comm, name: str) -> Mesh:
    """Make the distributed mesh; collective.

    Surfaces in space get nodes of their own for each smooth part where they have kinks or T joints
    (:mod:`fxcrack.mesh.kinks`).

    Args:
        raw: The whole mesh on rank 0, ``None`` on the others.
        comm: Communicator to distribute over.
        name: What messages and files call the mesh.

    Raises:
        MeshError: A group holds entities that are not facets, edges or nodes of the cells.
    """
    shape = joints = None
    if raw is not None:
        if (raw.tdim, raw.gdim) == (2, 3):
            raw = part_at_kinks(raw)
        joints = raw.joints
        shape = (raw.cell, raw.order, raw.tdim, raw.gdim, raw.n_entity_nodes(raw.tdim))
    cell, order, tdim, gdim, width = comm.bcast(shape)
    points = np.empty((0, gdim)) if raw is None else raw.points
    cells = np.empty((0, width), dtype=np.int64) if raw is None else raw.cells
    element = compat.coordinate_element(cell, order, gdim)
    domain = compat.create_mesh(comm, cells, points, element)

    groups = {n: Group(tdim, c) for n, c in _cell_groups(raw, domain).items()}
    dims = None if raw is None else {g.dim for g in raw.groups.values()}
    for dim in sorted(comm.bcast(dims), reverse=True):
        for group, entities in _lower_groups(raw, domain, dim, name).items():
            groups[group] = Group(dim, entities)
    for group, points in _midside_groups(raw, domain).items():
        groups[group] = replace(groups[group], points=points)
    return Mesh(domain, groups, name, comm.bcast(joints))


def _midside_groups(raw: RawMesh | None, domain: Domain) -> dict[str, npt.NDArray[np.int32]]:
    """Local geometry nodes of the groups of nodes that hold nodes which are no vertices."""
    comm = compat.plain_comm(domain.comm)
    chosen: dict[str, npt.NDArray[np.int64]] = {}
    if raw is not None and raw.order > 1:
        is_vertex = vertices_of(raw)
        nodes = {n: g.rows[:, 0] for n, g in raw.groups.items() if g.dim == 0}
        chosen = {n: np.sort(rows) for n, rows in nodes.items() if not is_vertex[rows].all()}
    chosen = comm.bcast(chosen)
    given = domain.geometry.input_global_indices
    return {n: np.flatnonzero(np.isin(given, rows)).astype(np.int32) for n, rows in chosen.items()}


def _cell_groups(raw: RawMesh | None, domain: Domain) -> dict[str, npt.NDArray[np.int32]]:
    """Local cells of each group of cells, found by the cells' places in the input."""
    comm = compat.plain_comm(domain.comm)
    sent = comm.gather(compat.original_cell_index(domain))
    members: list[dict[str, npt.NDArray[np.int32]]] | None = None
    if raw is not None and sent is not None:
        members = [{} for _ in sent]
        for name, cells in raw.cell_groups.items():
            inside = np.zeros(len(raw.cells), dtype=bool)
            inside[cells] = True
            for found, original in zip(members, sent, strict=True):
                found[name] = np.flatnonzero(inside[original]).astype(np.int32)
    mine: dict[str, npt.NDArray[np.int32]] = comm.scatter(members)
    return mine


def _lower_groups(
    raw: RawMesh | None, domain: Domain, dim: int, name: str
) -> dict[str, npt.NDArray[np.int32]]:
    """Local entities of each group of dimension ``dim`` below the cells."""
    comm = compat.plain_comm(domain.comm)
    names: list[str] = []
    rows = np.empty((0, 1), dtype=np.int64)
    numbers = np.empty(0, dtype=np.int32)
    width = None
    if raw is not None:
        chosen = {n: g.rows for n, g in raw.groups.items() if g.dim == dim}
        if dim == 0 and raw.order > 1:  # midside nodes are no entities: _midside_groups
            is_vertex = vertices_of(raw)
            chosen = {n: rows[is_vertex[rows[:, 0]]] for n, rows in chosen.items()}
        names = list(chosen)
        rows = np.concatenate(list(chosen.values()))
        numbers = np.repeat(
            np.arange(len(names), dtype=np.int32), [len(r) for r in chosen.values()]
        )
        width = rows.shape[1]
    names, width = comm.bcast((names, width))
    sizes = np.bincount(numbers, minlength=len(names))
    rows = rows.reshape(-1, width)

    vertices, numbers = compat.distribute_entity_data(domain, dim, rows, numbers)
    kept, position = distinct(np.asarray(vertices, dtype=np.int64), vertices.shape[1])
    entities = compat.entities_from_vertices(domain, dim, vertices[kept])[position]
    known = entities >= 0
    pairs = np.unique(np.column_stack((numbers[known], entities[known])), axis=0)
    owned = pairs[pairs[:, 1] < domain.topology.index_map(dim).size_local, 0]
    found = comm.allreduce(np.bincount(owned, minlength=len(names)))
    for group, n_found, n_given in zip(names, found, comm.bcast(sizes), strict=True):
        if n_found != n_given:
            kind = "facets" if dim == domain.topology.dim - 1 else "edges" if dim else "nodes"
            raise MeshError(
                f"mesh '{name}': {n_given - n_found} of the {n_given} entities of group '{group}' "
                f"are not {kind} of the cells; make the geometry conforming there (fragment)"
            )
    return {group: pairs[pairs[:, 0] == i, 1].astype(np.int32) for i, group in enumerate(names)}
