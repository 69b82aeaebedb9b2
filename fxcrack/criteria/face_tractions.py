"""Tractions on the faces in the ring around a tip: what they do as the crack grows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import InputError
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.loads import Pressure, Traction
from fxcrack.criteria.crack_tip_fields import TipFields
from fxcrack.interface.crack_pressure import CrackPressure
from fxcrack.interface.front_cells import FrontCells
from fxcrack.interface.hierarchy import Hierarchy
from fxcrack.interface.surface import FacetSurface, gather_surface, shape_functions


@dataclass(frozen=True)
class LoadedFaces:
    """A traction or pressure with the facets it acts on.

    Attributes:
        number: Its number among the load factors.
        load: What the user gave.
        surface: The facets.
    """

    number: int
    load: Traction | Pressure
    surface: FacetSurface


def loads_on_faces(continuum: Continuum, loads: list[Any]) -> list[LoadedFaces]:
    """The tractions and pressures among some loads, with their facets; collective.

    Raises:
        InputError: One of them is a pressure that follows the crack.
    """
    for load in loads:
        if isinstance(load, CrackPressure):
            raise InputError(
                f"method='domain' does not know pressures that follow the crack (pressure "
                f"'{load.title}'); use method='vcct' or 'closure'"
            )
    return [
        LoadedFaces(k, load, gather_surface(continuum, load.where))
        for k, load in enumerate(loads)
        if isinstance(load, Traction | Pressure)
    ]


@dataclass(frozen=True)
class _Facets:
    """Loaded facets of one load in a ring.

    Attributes:
        number: Number of the load factor.
        nodes: Positions among the nodes of the ring, shape (n, n_nodes).
        along: Derivative of each shape function along the extension, times its size, shape (n,
            n_points, n_nodes).
        force: Traction times area at the points, shape (n, n_points, gdim).
        x: The points, shape (n, n_points, 3).
        shift: Extension at the points, shape (n, n_points, 3).
        above: Whether the cell of each is on the side the normal of the interface points to, shape
            (n,).
    """

    number: int
    nodes: Ints
    along: Array
    force: Array
    x: Array
    shift: Array
    above: Bools


class FaceTractions:
    """The term - int t . (H q) dS of a ring.

    Args:
        loaded: All loaded faces of the scene.
        q: Extension at the corners of the ring's cells, shape (n_cells, n_corners, gdim).
        cells: These.
        above: Whether each of them is on the side the normal points to, shape (n_cells,).
        nodes: Global displacement nodes of the ring, sorted, shape (n_nodes,).
        n_loads: Number of load factors.
        gdim: Components of a displacement.
    """

    def __init__(
        self,
        loaded: list[LoadedFaces],
        q: Array,
        cells: FrontCells,
        above: Bools,
        nodes: Ints,
        n_loads: int,
        *,
        gdim: int,
    ) -> None:
        self._gdim, self._n_loads = gdim, n_loads
        shift = np.zeros((len(nodes), 3))
        ids = np.searchsorted(nodes, cells.nodes[:, : cells.n_corners])
        shift[ids.ravel(), :gdim] = q.reshape(-1, gdim)
        self._above = _sides(cells, above)
        self._facets = [f for f in (self._find(x, nodes, shift) for x in loaded) if f is not None]

    def _find(self, faces: LoadedFaces, nodes: Ints, shift: Array) -> _Facets | None:
        """The facets of a load that the extension moves."""
        s = faces.surface
        at = np.searchsorted(nodes, s.dofs)
        at = np.where(at < len(nodes), at, 0)
        inside = nodes[at] == s.dofs
        of_node = np.where(inside[:, None], shift[at], 0.0)
        moves = np.abs(of_node).max(axis=1) > 0.0
        corner = s.facets[:, : s.n_corners]
        rows = np.flatnonzero(moves[corner].any(axis=1) & inside[s.facets].all(axis=1))
        if not len(rows):
            return None
        at_points = _moved(s, rows, of_node)
        traction = _traction(faces.load, at_points.x, at_points.normals)
        force = traction * at_points.size[..., None]
        # a facet that moves belongs to a cell of the ring, whose side of the interface is its own
        above = [self._above[tuple(sorted(k))] for k in s.dofs[corner[rows]].tolist()]
        return _Facets(
            faces.number, at[s.facets[rows]], at_points.along, force[..., : self._gdim],
            at_points.x, at_points.q, np.array(above),
        )  # fmt: skip

    def work(self, u: Array, load: Array) -> float:
        """The term in a state.

        Args:
            u: Displacements of the ring's nodes, shape (n_nodes, gdim) [length].
            load: Load factors, shape (n_loads,).
        """
        total = 0.0
        for f in self._facets:
            slope = np.einsum("fqa,fac->fqc", f.along, u[f.nodes])
            total -= float(load[f.number]) * float(np.einsum("fqc,fqc->", f.force, slope))
        return total

    def interaction(self, fields: TipFields, origin: Array, n_modes: int) -> Array:
        """The term with unit intensity factors for H, less its sign, shape (n_modes, n_loads).

        Args:
            fields: The crack-tip fields.
            origin: The tip, shape (3,) [length].
            n_modes: Intensity factors that are needed.
        """
        out = np.zeros((n_modes, self._n_loads))
        for f in self._facets:
            for side, rows in enumerate((f.above, ~f.above)):
                if not rows.any():
                    continue
                x = (f.x[rows] - origin).reshape(-1, 3)
                found = fields.gradients(x, side)[:n_modes]
                tip = found.reshape(n_modes, int(rows.sum()), -1, 3, 3)[..., : self._gdim, :]
                out[:, f.number] += np.einsum("fqc,mfqcj,fqj->m", f.force[rows], tip, f.shift[rows])
        return out


@dataclass(frozen=True)
class OpenedFacets:
    """The derivative of a jump along the extension, integrated over some slave facets.

    Attributes:
        nodes: Slave nodes, shape (n,).
        weights: Of their jumps, shape (n,) [length].
    """

    nodes: Ints
    weights: Array


def opened_facets(
    surface: FacetSurface,
    bonded: Bools,
    opened: Ints,
    nodes: Ints,
    cells: FrontCells,
    q: Array,
    hierarchy: Hierarchy | None = None,
) -> OpenedFacets:
    """Facets of the slave face that nodes which have just been released have opened.

    Args:
        surface: The slave face.
        bonded: Its bonded nodes, shape (n_surface_nodes,).
        opened: The released nodes, shape (n,).
        nodes: Global displacement nodes of the ring, sorted, shape (n_nodes,).
        cells: Cells of the ring.
        q: Extension at their corners, shape (n_cells, n_corners, gdim).
        hierarchy: Of the jumps of second-order triangles.
    """
    none = OpenedFacets(np.zeros(0, dtype=np.int64), np.zeros(0))
    if not len(opened):
        return none
    shift = np.zeros((len(nodes), 3))
    ids = np.searchsorted(nodes, cells.nodes[:, : cells.n_corners])
    shift[ids.ravel(), : q.shape[2]] = q.reshape(-1, q.shape[2])
    at = np.searchsorted(nodes, surface.dofs)
    at = np.where(at < len(nodes), at, 0)
    of_node = np.where((nodes[at] == surface.dofs)[:, None], shift[at], 0.0)
    if hierarchy is not None:
        surface = hierarchy.curved(surface)
    corner = surface.facets[:, : surface.n_corners]
    mine = np.isin(corner, opened)
    # those behind the front hold nodes that were open before
    fresh = mine.any(axis=1) & (mine | bonded[corner]).all(axis=1)
    moves = (np.abs(of_node).max(axis=1) > 0.0)[corner].any(axis=1)
    rows = np.flatnonzero(fresh & moves)
    if not len(rows):
        return none
    at_points = _moved(surface, rows, of_node)
    each = np.einsum("fqa,fq->fa", at_points.along, at_points.size)
    found = np.zeros(surface.n_nodes)
    np.add.at(found, surface.facets[rows], each)
    if hierarchy is not None:
        found = hierarchy.on_whole_jumps(found)
    chosen = np.unique(surface.facets[rows])
    return OpenedFacets(chosen, found[chosen])


@dataclass(frozen=True)
class _Moved:
    """Facets that the extension moves, at quadrature points.

    Attributes:
        x: The points, shape (n, n_points, 3) [length].
        q: Extension, likewise.
        along: Derivative of each shape function along it, times its size, shape (n, n_points,
            n_nodes).
        normals: Outward normals, shape (n, n_points, 3).
        size: Area that each point stands for, shape (n, n_points) [length^2].
    """

    x: Array
    q: Array
    along: Array
    normals: Array
    size: Array


def _moved(s: FacetSurface, rows: Ints, of_node: Array) -> _Moved:
    """Facets of a surface with the extension given at its nodes, shape (n_surface_nodes, 3)."""
    points, weights = edge_quadrature(s.kind)
    values, slopes = shape_functions(s.kind, s.order, points)
    linear, _ = shape_functions(s.kind, 1, points)
    facets, corner = s.facets[rows], s.facets[rows, : s.n_corners]
    tangents = np.einsum("dqa,fac->fqdc", slopes, s.x[facets])
    q = np.einsum("qa,fac->fqc", linear, of_node[corner])
    gram = np.einsum("fqdc,fqec->fqde", tangents, tangents)
    share = np.linalg.solve(gram, np.einsum("fqdc,fqc->fqd", tangents, q)[..., None])[..., 0]
    normals, size = s.facet_normals(points)
    breadth = np.einsum("qa,fa->fq", values, s.breadth[facets])
    return _Moved(
        np.einsum("qa,fac->fqc", values, s.x[facets]),
        q,
        np.einsum("fqd,dqa->fqa", share, slopes),
        normals[rows],
        size[rows] * breadth * weights,
    )


def _sides(cells: FrontCells, above: Bools) -> dict[tuple[int, ...], bool]:
    """The side of the cell behind each boundary facet of some cells, by its sorted corner nodes."""
    corners = np.sort(cells.nodes[:, cells.facet_corners], axis=2)
    row, facet = np.nonzero(cells.outer)
    keys = corners[row, facet].tolist()
    return {tuple(k): bool(v) for k, v in zip(keys, above[row], strict=True)}


@lru_cache(maxsize=4)
def edge_quadrature(kind: str) -> tuple[Array, Array]:
    """Quadrature of functions that go with the inverse root of the distance from an edge.

    Gauss's rule in t with xi = t^2 (3 - 2 t), whose derivative is zero at both ends.

    Args:
        kind: Facet cell: "interval", "triangle" or "quadrilateral".

    Returns:
        Reference points, shape (n, dim), and weights, shape (n,).
    """
    gauss, half = np.polynomial.legendre.leggauss(_POINTS)
    t, w = 0.5 * (gauss + 1.0), 0.5 * half
    xi, w = t**2 * (3.0 - 2.0 * t), w * 6.0 * t * (1.0 - t)
    if kind == "interval":
        return xi[:, None], w
    a, b = (v.ravel() for v in np.meshgrid(xi, xi, indexing="ij"))
    weights = np.outer(w, w).ravel()
    if kind == "quadrilateral":
        return np.stack([a, b], axis=1), weights
    # a square collapsed onto a triangle
    return np.stack([a, b * (1.0 - a)], axis=1), weights * (1.0 - a)


_POINTS = 10
"""Points of Gauss's rule per direction on a loaded facet."""


def _traction(load: Traction | Pressure, x: Array, normals: Array) -> Array:
    """Traction at points with a load factor of one, shape (n, m, 3) [force/length^2]."""
    flat, shape = x.reshape(-1, 3), x.shape[:2]

    def at(value: Any) -> Array:
        if callable(value):
            return numbers_at(f"load '{load.title}'", "value", value, flat).reshape(shape)
        return np.full(shape, float(value))

    if isinstance(load, Pressure):
        return -at(load.value)[..., None] * normals
    out = np.zeros((*shape, 3))
    for axis, value in enumerate(load.value):
        out[..., axis] = at(value)
    return out
