"""The arrays of a gmsh model: cells, points and physical groups as a :class:`RawMesh`.

An entity may belong to any number of groups; nodes that no cell uses (points of the geometry) are
dropped; gaps in gmsh's numbering are closed; second-order quadrilaterals and hexahedra without
centre nodes get them.
"""

from __future__ import annotations

from typing import Any

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
from dolfinx.mesh import CellType

from fxcrack.base.arrays import Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import MeshError
from fxcrack.mesh.complete import INCOMPLETE, Completion
from fxcrack.mesh.raw import Floats, RawGroup, RawMesh, distinct

_CELLS = {
    2: ("triangle", 1),
    3: ("quadrilateral", 1),
    4: ("tetrahedron", 1),
    5: ("hexahedron", 1),
    9: ("triangle", 2),
    10: ("quadrilateral", 2),
    11: ("tetrahedron", 2),
    12: ("hexahedron", 2),
}
_PLANE = 1e-9


def extract(model: Any, gdim: int | None) -> RawMesh:
    """Read the current gmsh model; to be called on the rank that holds it.

    Args:
        model: ``gmsh.model``, meshed.
        gdim: Geometric dimension, 3 for surface cells in space; ``None`` for that of the cells.

    Raises:
        MeshError: No cells or unsupported ones, a plane mesh out of z = 0, unusable groups.
    """
    cell, order, tdim, tags, cells, incomplete = _cells(model)
    if gdim is not None and gdim not in (tdim, 3):
        raise MeshError(
            f"the cells are {tdim}-dimensional, but gdim={gdim} was asked for; leave gdim out, or "
            "mesh only surfaces in the plane z = 0"
        )
    gdim = tdim if gdim is None else gdim
    node_tags, coordinates, _ = model.mesh.getNodes()
    by_tag = np.argsort(node_tags)
    node_tags = node_tags[by_tag].astype(np.int64)
    coordinates = coordinates.reshape(-1, 3)[by_tag]

    used, flat = np.unique(cells, return_inverse=True)
    nodes = flat.reshape(len(tags), -1).astype(np.int64)
    points = coordinates[np.searchsorted(node_tags, used)]
    completion = Completion(cell, points, nodes) if incomplete else None
    if completion is not None:
        points, nodes = completion.points, completion.nodes
    _check_plane(points, gdim)
    nodes = nodes[:, compat.gmsh_cell_permutation(getattr(CellType, cell), nodes.shape[1])]
    raw = RawMesh(cell, order, np.ascontiguousarray(points[:, :gdim]), nodes)

    # MSH 2 files repeat a cell for every physical group that holds it.
    kept, position = distinct(nodes, raw.n_vertices(tdim))
    raw = RawMesh(cell, order, raw.points, nodes[kept])
    by_tag = np.argsort(tags)
    tags, position = tags[by_tag], position[by_tag]

    for name, (dim, tag) in _names(model, tdim).items():
        element_tags, element_nodes = _group_elements(model, dim, tag, name)
        if dim == tdim:
            raw.cell_groups[name] = np.unique(position[np.searchsorted(tags, element_tags)])
            continue
        label = f"group '{name}' (dimension {dim})"
        index = np.minimum(np.searchsorted(used, element_nodes), len(used) - 1)
        stray = np.flatnonzero(used[index] != element_nodes)
        if len(stray):
            where = coordinates[np.searchsorted(node_tags, element_nodes[stray[0]])]
            raise MeshError(
                f"{label} has a node at {format_point(where)} that belongs to no cell; take it out "
                "of the group, or embed it in the mesh (gmsh.model.mesh.embed, or fragment)"
            )
        width = raw.n_entity_nodes(dim)
        if completion is not None and dim == 2 and len(index) == 8 * len(element_tags):
            index = completion.facets(index.reshape(-1, 8), label).ravel()
        if len(index) % width or len(element_tags) != len(index) // width:
            raise MeshError(
                f"{label} holds elements that are no parts of a {cell} of order {order}; mesh "
                f"cells and groups with one order and one element shape"
            )
        rows = index.reshape(-1, width)
        raw.groups[name] = RawGroup(dim, rows[distinct(rows, raw.n_vertices(dim))[0]])
    _check_nodes(raw)
    return raw


def _cells(model: Any) -> tuple[str, int, int, Ints, Ints, bool]:
    """Cell shape, order, dimension, element tags, flat node tags, and whether nodes are missing."""
    tdim = max((d for d in (1, 2, 3) if len(model.mesh.getElementTypes(d))), default=0)
    if tdim < 2:
        raise MeshError(
            "no triangles, quadrilaterals, tetrahedra or hexahedra were found; mesh the model "
            "(gmsh.model.mesh.generate(2) or (3)) and see that its surfaces or volumes are saved"
        )
    types = [int(t) for t in model.mesh.getElementTypes(tdim)]
    names = [model.mesh.getElementProperties(t)[0].lower() for t in types]
    if len(types) > 1:
        raise MeshError(
            f"the cells are of {len(types)} kinds ({', '.join(names)}), but a mesh must have one; "
            f"recombine all surfaces or none (gmsh.model.mesh.setRecombine)"
        )
    incomplete = types[0] in INCOMPLETE
    if not incomplete and types[0] not in _CELLS:
        raise MeshError(
            f"cells of kind {names[0]} are not supported; use first- or second-order triangles, "
            f"quadrilaterals, tetrahedra or hexahedra"
        )
    tags, nodes = model.mesh.getElementsByType(types[0])
    cell, order = (INCOMPLETE[types[0]], 2) if incomplete else _CELLS[types[0]]
    return cell, order, tdim, tags.astype(np.int64), nodes.astype(np.int64), incomplete


def _check_plane(points: Floats, gdim: int) -> None:
    """Refuse a plane mesh that leaves the plane z = 0."""
    if gdim == 3:
        return
    size = np.ptp(points[:, :2], axis=0).max()
    off = np.flatnonzero(np.abs(points[:, 2]) > _PLANE * size)
    if len(off):
        raise MeshError(
            f"surface cells must lie in the plane z = 0, but {len(off)} of {len(points)} nodes do "
            f"not, the first at {format_point(points[off[0]])}; move the model there, mesh the "
            "volume for a 3-D analysis, or give gdim=3 for shells"
        )


def _names(model: Any, tdim: int) -> dict[str, tuple[int, int]]:
    """Name, dimension and tag of every physical group, cells first."""
    found: dict[str, tuple[int, int]] = {}
    for dim, tag in sorted(model.getPhysicalGroups(), key=lambda group: (-group[0], group[1])):
        name = model.getPhysicalName(dim, tag) or f"group_{dim}_{tag}"
        if name in found:
            raise MeshError(
                f"the name '{name}' is used for physical groups of dimension {found[name][0]} and "
                f"{dim}; give one of them another name"
            )
        if dim <= tdim:
            found[name] = (dim, tag)
    return found


def _group_elements(model: Any, dim: int, tag: int, name: str) -> tuple[Ints, Ints]:
    """Element tags and flat node tags of a physical group."""
    tags, nodes = [], []
    for entity in model.getEntitiesForPhysicalGroup(dim, tag):
        _, entity_tags, entity_nodes = model.mesh.getElements(dim, entity)
        tags += entity_tags
        nodes += entity_nodes
    if not tags:
        raise MeshError(
            f"physical group '{name}' (dimension {dim}) holds no elements; mesh the entities in it "
            f"or remove the group"
        )
    return np.concatenate(tags).astype(np.int64), np.concatenate(nodes).astype(np.int64)


def _check_nodes(raw: RawMesh) -> None:
    """Refuse a node group with a midside node: DOLFINx has only vertices as points."""
    if raw.order == 1:
        return
    is_vertex = np.zeros(len(raw.points), dtype=bool)
    is_vertex[raw.cells[:, : raw.n_vertices(raw.tdim)]] = True
    for name, group in raw.groups.items():
        midside = group.rows[~is_vertex[group.rows[:, 0]], 0] if group.dim == 0 else []
        if len(midside):
            raise MeshError(
                f"group '{name}' has the midside node at {format_point(raw.points[midside[0]])}; "
                "only corner nodes of cells can be in a group of nodes: move the element ends there"
            )
