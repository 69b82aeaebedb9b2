"""A named facet group as a small mesh of its own, whole on every rank.

Nodes are displacement nodes (so a second-order displacement brings midside nodes); their order
and that of the facets follow the input order of the cells and not the partition.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import basix
import numpy as np
import numpy.typing as npt

from fxcrack.base import compat
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InterfaceError, raise_on_all_ranks
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.face import Face
from fxcrack.continuum.shell_bodies import ShellBodies

_FLAT = 1e-10
"""Facets smaller than this fraction of the others have no length."""


@lru_cache(maxsize=16)
def facet_element(kind: str, order: int) -> basix.finite_element.FiniteElement:
    """Lagrange element of a facet ("interval", "triangle", "quadrilateral")."""
    return basix.create_element(
        basix.ElementFamily.P,
        getattr(basix.CellType, kind),
        order,
        basix.LagrangeVariant.equispaced,
    )


def shape_functions(kind: str, order: int, xi: Array) -> tuple[Array, Array]:
    """Shape functions of a facet and their derivatives.

    Args:
        kind: Facet cell.
        order: 1 or 2.
        xi: Reference points, shape (m, dim).

    Returns:
        Values, shape (m, n_nodes), and gradients, shape (dim, m, n_nodes).
    """
    element = facet_element(kind, order)
    if not len(xi):  # Basix 0.9 ends the process
        return np.zeros((0, element.dim)), np.zeros((np.shape(xi)[1], 0, element.dim))
    table = element.tabulate(1, xi)[..., 0]
    return np.asarray(table[0]), np.asarray(table[1:])


@dataclass(frozen=True)
class FacetSurface:
    """Facets of a named group with their displacement nodes.

    Attributes:
        name: Group name.
        kind: Facet cell: "interval", "triangle" or "quadrilateral".
        order: Order of the facet's shape functions.
        dofs: Global displacement node (block index) of each node, shape (n_nodes,).
        x: Node positions, shape (n_nodes, 3), length.
        facets: Node numbers per facet in basix order, shape (n_facets, nodes_per_facet).
        inner: A point inside the cell behind each facet, shape (n_facets, 3), length.
        breadth: Out-of-plane extent at the nodes, length (1 in 3-D), shape (n_nodes,).
        outward: Sign that turns each facet's own area vector outward, shape (n_facets,); found
            from ``inner`` where it is not given.
        point_maps: Displacement of each node's point per unknown of the node, shape
            (n_nodes, gdim, n_unknowns); ``None`` where the unknowns are the displacement
            (:mod:`fxcrack.continuum.dof_layout`).
    """

    name: str
    kind: str
    order: int
    dofs: Ints
    x: Array
    facets: Ints
    inner: Array
    breadth: Array
    outward: Array | None = None
    point_maps: Array | None = None

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.dofs)

    @property
    def dim(self) -> int:
        """Dimension of the facets: 1 or 2."""
        return 1 if self.kind == "interval" else 2

    @property
    def n_corners(self) -> int:
        """Corner nodes per facet; they come first in a facet's row."""
        return {"interval": 2, "triangle": 3, "quadrilateral": 4}[self.kind]

    def facet_normals(self, xi: Array) -> tuple[Array, Array]:
        """Outward area vectors of every facet at reference points.

        Args:
            xi: Reference points, shape (m, dim).

        Returns:
            Unit outward normals and Jacobians, shapes (n_facets, m, 3) and (n_facets, m).
        """
        _, gradient = shape_functions(self.kind, self.order, xi)
        tangents = np.einsum("dmk,fkc->dfmc", gradient, self.x[self.facets])
        if self.dim == 1:
            area = np.cross(tangents[0], [0.0, 0.0, 1.0])
        else:
            area = np.cross(tangents[0], tangents[1])
        if self.outward is None:
            away = self.x[self.facets[:, : self.n_corners]].mean(axis=1) - self.inner
            area *= np.where(np.einsum("fmc,fc->fm", area, away) < 0.0, -1.0, 1.0)[..., None]
        else:
            area *= self.outward[:, None, None]
        size = np.linalg.norm(area, axis=-1)
        return area / np.where(size > 0.0, size, 1.0)[..., None], size

    def moved(self, x: Array) -> FacetSurface:
        """The same facets with their nodes at other positions, sides kept.

        Args:
            x: New positions, shape (n_nodes, 3), length.
        """
        if self.outward is not None:
            return replace(self, x=x)
        centre = np.asarray(facet_element(self.kind, self.order).points).mean(axis=0)[None]
        unit, _ = self.facet_normals(centre)
        own, _ = replace(self, outward=np.ones(len(self.facets))).facet_normals(centre)
        return replace(self, x=x, outward=np.sign(np.einsum("fc,fc->f", unit[:, 0], own[:, 0])))

    def with_facets(self, chosen: Bools) -> FacetSurface:
        """The same nodes with some of the facets, sides kept.

        Args:
            chosen: Which facets, shape (n_facets,).
        """
        outward = None if self.outward is None else self.outward[chosen]
        return replace(self, facets=self.facets[chosen], inner=self.inner[chosen], outward=outward)

    def maps_at(self, nodes: Ints) -> Array | None:
        """``point_maps`` of some nodes, shape (..., gdim, n_unknowns)."""
        return None if self.point_maps is None else np.asarray(self.point_maps[nodes])

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals at the nodes, averaged by area, shape (n_nodes, 3)."""
        points = np.asarray(facet_element(self.kind, self.order).points)
        unit, size = self.facet_normals(points)
        total = np.zeros((self.n_nodes, 3))
        np.add.at(total, self.facets, unit * size[..., None])
        length = np.linalg.norm(total, axis=1, keepdims=True)
        return total / np.where(length > 0.0, length, 1.0)  # 0 at nodes without facets

    @cached_property
    def areas(self) -> Array:
        """Tributary area of each node, the integral of its shape function.

        Shape (n_nodes,), length^2.
        """
        xi, weights = basix.make_quadrature(getattr(basix.CellType, self.kind), 2 * self.order + 2)
        values, _ = shape_functions(self.kind, self.order, np.asarray(xi))
        _, size = self.facet_normals(np.asarray(xi))
        breadth = self.breadth[self.facets] @ values.T
        total = np.zeros(self.n_nodes)
        np.add.at(total, self.facets, np.einsum("m,fm,mk->fk", weights, size * breadth, values))
        return total

    @cached_property
    def facet_size(self) -> float:
        """Median distance of neighbouring corners, length."""
        around = [0, 1, 3, 2] if self.kind == "quadrilateral" else list(range(self.n_corners))
        corners = self.x[self.facets[:, around]]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)
        return float(np.median(edges))


def closure_table(cell: basix.CellType, order: int) -> tuple[str, Ints]:
    """Facet cell and, per local facet, the cell's dofs in the facet element's order."""
    tdim = len(basix.topology(cell)) - 1
    element = basix.create_element(
        basix.ElementFamily.P, cell, order, basix.LagrangeVariant.equispaced
    )
    kinds = basix.cell.subentity_types(cell)[tdim - 1]
    kind = kinds[0].name
    corners = basix.geometry(cell)
    points = np.asarray(facet_element(kind, order).points)
    table = []
    for vertices in basix.topology(cell)[tdim - 1]:
        base = corners[vertices[0]]
        axes = [corners[v] - base for v in vertices[1:tdim]]
        where = base + points @ np.asarray(axes)
        distance = np.linalg.norm(where[:, None] - np.asarray(element.points)[None], axis=-1)
        table.append(np.argmin(distance, axis=1))
    return kind, np.asarray(table, dtype=np.int64)


def facet_nodes(
    continuum: Continuum, facets: npt.NDArray[np.int32]
) -> tuple[str, npt.NDArray[np.int32], Ints, npt.NDArray[np.int32]]:
    """Facets of this rank as parts of a cell.

    Args:
        continuum: Displacement space.
        facets: Facets of this rank, shape (n_facets,).

    Returns:
        The kind of facet ("interval", "triangle", "quadrilateral"); the first cell at each facet
        and the facet's number in this cell, both of shape (n_facets,); and the displacement nodes
        of this rank on it in basix order, shape (n_facets, nodes_per_facet).
    """
    topology, tdim = continuum.mesh.domain.topology, continuum.mesh.tdim
    topology.create_connectivity(tdim - 1, tdim)
    topology.create_connectivity(tdim, tdim - 1)
    to_cell, to_facet = topology.connectivity(tdim - 1, tdim), topology.connectivity(tdim, tdim - 1)
    cells = np.asarray(to_cell.array[to_cell.offsets[facets]], dtype=np.int32)
    element = continuum.space.element.basix_element
    kind, table = closure_table(element.cell_type, continuum.order)
    around = to_facet.array.reshape(-1, len(table))[cells]
    local = np.argmax(around == facets[:, None], axis=1)
    nodes = continuum.space.dofmap.list[cells[:, None], table[local]]
    return kind, cells, local, nodes


@dataclass(frozen=True)
class _Facets:
    """Facets of a surface on this rank, those it alone gives.

    Attributes:
        kind: Facet cell.
        key: Place of the cell of each facet in the input, shape (n_facets,).
        which: Number of the facet in its cell, shape (n_facets,).
        nodes: Displacement nodes of this rank, shape (n_facets, nodes_per_facet).
        x: Their positions on the surface, shape (n_facets, nodes_per_facet, 3).
        inner: A point behind each facet, shape (n_facets, 3).
        outward: As in :class:`FacetSurface`, shape (n_facets,); ``None`` to find it.
    """

    kind: str
    key: Ints
    which: Ints
    nodes: Ints
    x: Array
    inner: Array
    outward: Array | None = None


def gather_surface(continuum: Continuum, name: str | Face) -> FacetSurface:
    """Collect a facet group, or the face of a shell, on every rank; collective.

    Args:
        continuum: Displacement space.
        name: Facet group, or face of a shell.

    Returns:
        The surface, the same on every rank.

    Raises:
        InterfaceError: The group is empty, some of its facets lie inside the body, or the
            surface does not fit the bodies.
    """
    if isinstance(continuum, ShellBodies):
        mine = _face_facets(continuum, name)
    elif isinstance(name, Face):
        raise InterfaceError(
            f"Face '{name}' belongs to shells, and this scene has solids; name a facet group. A "
            "mesh has cells of one shape, so shells and solids cannot be bonded to each other: "
            "model thin parts beside solids with ContinuumShell"
        )
    else:
        mine = _group_facets(continuum, name)
    index_map = continuum.space.dofmap.index_map
    blocks = np.asarray(index_map.local_to_global(mine.nodes.ravel()), dtype=np.int64)
    send = [mine.key, mine.which, blocks.reshape(mine.nodes.shape), mine.x, mine.inner]
    has_outward = mine.outward is not None
    if mine.outward is not None:
        send.append(mine.outward)
    maps = continuum.layout.point_maps(name, mine.nodes)
    if maps is not None:
        send.append(maps)
    parts = [p for p in continuum.comm.allgather(send) if len(p[0])]
    if not parts:
        raise InterfaceError(f"facet group '{name}' of mesh '{continuum.mesh.name}' is empty")
    key, which, blocks, points, inner, *others = (
        np.concatenate(c) for c in zip(*parts, strict=True)
    )
    order = np.lexsort((which, key))
    blocks, points, inner = blocks[order], points[order], inner[order]
    outward = others.pop(0)[order] if has_outward else None
    unique, first, inverse = np.unique(blocks.ravel(), return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    position = np.empty((len(unique), 3))
    position[rank] = points.reshape(-1, 3)[first]
    node_dofs = np.empty(len(unique), dtype=np.int64)
    node_dofs[rank] = unique
    point_maps = None
    for found in others:
        by_corner = found[order].reshape(-1, *found.shape[2:])
        point_maps = np.empty((len(unique), *found.shape[2:]))
        point_maps[rank] = by_corner[first]
    surface = FacetSurface(
        name=str(name),
        kind=mine.kind,
        order=continuum.order,
        dofs=node_dofs,
        x=position,
        facets=rank[inverse].reshape(blocks.shape),
        inner=inner,
        breadth=continuum.model.breadth(position),
        outward=outward,
        point_maps=point_maps,
    )
    _check_facets(surface)
    return surface


def _group_facets(continuum: Continuum, name: str) -> _Facets:
    """Facets of a named group at cells that this rank owns; collective."""
    domain, tdim = continuum.mesh.domain, continuum.mesh.tdim
    facets = continuum.mesh.group(name, dim=tdim - 1).entities
    kind, cells, local, nodes = facet_nodes(continuum, facets)
    offsets = domain.topology.connectivity(tdim - 1, tdim).offsets
    problem = None
    if np.any(offsets[facets + 1] - offsets[facets] > 1):
        problem = (
            f"facet group '{name}' has facets inside the body; slave and master surfaces must be "
            "boundaries: mesh the two sides apart, or split the mesh there (fxcrack.Split)"
        )
    raise_on_all_ranks(continuum.comm, problem, InterfaceError)
    here = cells < domain.topology.index_map(tdim).size_local
    cells, local, nodes = cells[here], local[here], nodes[here]
    return _Facets(
        kind,
        np.asarray(compat.original_cell_index(domain), dtype=np.int64)[cells],
        local,
        nodes,
        continuum.positions()[nodes],
        domain.geometry.x[compat.geometry_dofmap(domain)[cells]].mean(axis=1),
    )


def _face_facets(shell: ShellBodies, face: str | Face) -> _Facets:
    """Cells of a shell that this rank owns as facets at X + z D; collective."""
    if not isinstance(face, Face):
        raise InterfaceError(
            f"interface side '{face}' of a shell: name a face, Face('{face}', 'top') or 'bottom', "
            "where it is a group of cells; edges are no sides of an interface"
        )
    domain = shell.mesh.domain
    cells = shell.mesh.group(face.group, dim=2).entities
    cells = cells[cells < domain.topology.index_map(2).size_local]
    nodes = shell.space.dofmap.list[cells]
    z = shell.height(face)
    reference = shell.positions()[nodes]
    side = 1.0 if face.side == "top" else -1.0
    return _Facets(
        domain.topology.cell_name(),
        np.asarray(compat.original_cell_index(domain), dtype=np.int64)[cells],
        np.zeros(len(cells), dtype=np.int64),
        nodes,
        reference + z * shell.directors[nodes],
        reference.mean(axis=1),
        side * shell.signs[cells],
    )


def _check_facets(surface: FacetSurface) -> None:
    """Refuse facets without length or area: crack lengths and areas need them.

    Raises:
        InterfaceError: Says where the first one is.
    """
    xi, _ = basix.make_quadrature(getattr(basix.CellType, surface.kind), 2 * surface.order)
    _, size = surface.facet_normals(np.asarray(xi))
    least = size.min(axis=1)
    flat = np.flatnonzero(~(least > _FLAT * np.median(least)))
    if len(flat):
        where = format_point(surface.x[surface.facets[flat[0]]].mean(axis=0))
        raise InterfaceError(
            f"facet group '{surface.name}' has {len(flat)} facets without length or area, the "
            f"first at {where}; merge their nodes or mesh the surface again"
        )


def triangle_areas(x: Array) -> Array:
    """Areas of plane triangles [length^2].

    Args:
        x: Their corners, shape (n, 3, 3) [length].
    """
    return 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
