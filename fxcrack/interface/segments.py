"""Parts of two facing surfaces that lie on each other, and points of integration on them.

A slave facet and a master facet share a segment: the master's outline, projected on the chord (2-D)
or the mean plane (3-D) of the slave facet, cut by that of the slave facet. On a segment the shape
functions of both sides are smooth, so that their products are integrated by Gauss points: exactly
on straight facets, parallelograms and triangles, to the accuracy of the rule on other
quadrilaterals and on curved facets. Pure numpy.

Convex outlines are cut by Sutherland and Hodgman's method (1974), all pairs of facets at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.projection import by_size, closest
from fxcrack.interface.surface import FacetSurface, facet_element, shape_functions

_FACING = -0.3
"""Cosine between the outward normals of two facets that may lie on each other, at most."""
_SLIVER = 1e-10
"""Segments smaller than this part of the slave facet are left out."""


@dataclass(frozen=True)
class Segments:
    """Points of integration on the segments of two surfaces.

    Attributes:
        slave: Slave facet of each point, shape (n_points,).
        master: Master facet of each point, shape (n_points,).
        slave_xi: Reference coordinates in the slave facet, shape (n_points, dim).
        master_xi: Reference coordinates in the master facet, shape (n_points, dim).
        weight: Weights, areas of the slave surface, shape (n_points,), length^dim.
    """

    slave: Ints
    master: Ints
    slave_xi: Array
    master_xi: Array
    weight: Array


def find_segments(slave: FacetSurface, master: FacetSurface, tolerance: float) -> Segments:
    """Points of integration where a slave surface has a master surface under it.

    Args:
        slave: Slave surface.
        master: Master surface.
        tolerance: How far points of the two may be from each other, length.
    """
    s, m, normal = _candidates(slave, master, tolerance)
    cut = _cut_lines if slave.dim == 1 else _cut_polygons
    which, points, weight = cut(slave, master, s, m, normal)
    s, m, normal = s[which], m[which], normal[which]
    slave_nodes = slave.x[slave.facets[s]]
    slave_xi = closest(points, slave_nodes, slave)
    values, gradient = shape_functions(slave.kind, slave.order, slave_xi)
    on_slave = np.einsum("nk,nkc->nc", values, slave_nodes)
    # the area of a curved facet over that of its projection
    area = _area_vectors(np.einsum("dnk,nkc->dnc", gradient, slave_nodes))
    size = np.linalg.norm(area, axis=1)
    slope = np.abs(np.einsum("nc,nc->n", area, normal)) / np.where(size > 0.0, size, 1.0)
    master_nodes = master.x[master.facets[m]]
    master_xi = closest(on_slave, master_nodes, master)
    values, _ = shape_functions(master.kind, master.order, master_xi)
    away = np.linalg.norm(on_slave - np.einsum("nk,nkc->nc", values, master_nodes), axis=1)
    near = away <= tolerance
    return Segments(
        s[near], m[near], slave_xi[near], master_xi[near], (weight / np.maximum(slope, 0.1))[near]
    )


def _area_vectors(tangents: Array) -> Array:
    """Vectors across facets, shape (n, 3), from their tangents, shape (dim, n, 3)."""
    if len(tangents) == 1:
        return np.cross(tangents[0], [0.0, 0.0, 1.0])
    return np.cross(tangents[0], tangents[1])


def _middles(surface: FacetSurface) -> tuple[Array, Array, Array]:
    """Centres of the facets, their radii and their outward normals there."""
    nodes = surface.x[surface.facets]
    centre = nodes[:, : surface.n_corners].mean(axis=1)
    radius = np.linalg.norm(nodes - centre[:, None], axis=2).max(axis=1)
    middle = np.asarray(facet_element(surface.kind, 1).points).mean(axis=0)[None]
    return centre, radius, surface.facet_normals(middle)[0][:, 0]


def _candidates(
    slave: FacetSurface, master: FacetSurface, tolerance: float
) -> tuple[Ints, Ints, Array]:
    """Pairs of facets near each other that face each other, and the slave's normal, sorted."""
    centre, radius, normal = _middles(slave)
    _, _, master_normal = _middles(master)
    found: list[Array] = []
    for members, centres, largest in by_size(master):
        near = cKDTree(centres).query_ball_point(centre, radius + largest + tolerance)
        counts = [len(n) for n in near]
        if sum(counts):
            number = np.concatenate([np.asarray(n, dtype=np.int64) for n in near])
            found.append(np.stack([np.repeat(np.arange(len(near)), counts), members[number]]))
    if not found:
        none = np.zeros(0, dtype=np.int64)
        return none, none, np.zeros((0, 3))
    s, m = np.concatenate(found, axis=1)
    order = np.lexsort((m, s))
    s, m = s[order], m[order]
    facing = np.einsum("nc,nc->n", normal[s], master_normal[m]) < _FACING
    s, m = s[facing], m[facing]
    return s, m, normal[s]


def _degree(slave: FacetSurface, master: FacetSurface) -> int:
    """Degree of the products of shape functions, and of the breadth, on straight facets."""
    per_order = 2 if slave.kind == "quadrilateral" else 1
    return per_order * (slave.order + master.order) + (1 if slave.dim == 1 else 0)


def _cut_lines(
    slave: FacetSurface, master: FacetSurface, s: Ints, m: Ints, normal: Array
) -> tuple[Ints, Array, Array]:
    """Points and weights on segments of lines, and which pair of facets each belongs to."""
    ends = slave.x[slave.facets[s, :2]]
    chord = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(chord, axis=1)
    along = chord / length[:, None]
    others = master.x[master.facets[m, :2]] - ends[:, :1]
    at = np.einsum("nkc,nc->nk", others, along) / length[:, None]
    low, high = np.maximum(at.min(axis=1), 0.0), np.minimum(at.max(axis=1), 1.0)
    which = np.flatnonzero(high - low > _SLIVER)
    xi, weight = basix.make_quadrature(basix.CellType.interval, _degree(slave, master))
    part = (high - low)[which]
    t = low[which, None] + part[:, None] * np.asarray(xi)[:, 0]
    points = ends[which, None, 0] + t[..., None] * chord[which, None]
    weights = (part * length[which])[:, None] * np.asarray(weight)
    return np.repeat(which, len(weight)), points.reshape(-1, 3), weights.ravel()


def _cut_polygons(
    slave: FacetSurface, master: FacetSurface, s: Ints, m: Ints, normal: Array
) -> tuple[Ints, Array, Array]:
    """Points and weights on segments of polygons, and which pair of facets each belongs to."""
    around = [0, 1, 3, 2] if slave.kind == "quadrilateral" else [0, 1, 2]
    corners = slave.x[slave.facets[s][:, around]]
    others = master.x[master.facets[m][:, around]]
    origin = corners.mean(axis=1)
    first = corners[:, 1] - corners[:, 0]
    first = first - np.einsum("nc,nc->n", first, normal)[:, None] * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([first, np.cross(normal, first)], axis=1)
    window = _counterclockwise(np.einsum("nkc,nac->nka", corners - origin[:, None], axes))
    polygon = _counterclockwise(np.einsum("nkc,nac->nka", others - origin[:, None], axes))
    polygon, count = clip(polygon, window)
    # fans of triangles from the first corner
    n, width = polygon.shape[:2]
    base = np.broadcast_to(polygon[:, :1], (n, width - 2, 2))
    one, two = polygon[:, 1:-1] - base, polygon[:, 2:] - base
    double = one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]
    double[np.arange(1, width - 1)[None] >= (count - 1)[:, None]] = 0.0
    large = double > _SLIVER * 2.0 * _area(window)[:, None]
    which, j = np.nonzero(large)
    rule = basix.make_quadrature(basix.CellType.triangle, _degree(slave, master))
    xi, weight = np.asarray(rule[0]), np.asarray(rule[1])
    a, b, c = base[which, j], one[which, j], two[which, j]
    flat = a[:, None] + xi[None, :, :1] * b[:, None] + xi[None, :, 1:] * c[:, None]
    points = origin[which, None] + np.einsum("nqa,nac->nqc", flat, axes[which])
    weights = double[which, j][:, None] * weight
    return np.repeat(which, len(weight)), points.reshape(-1, 3), weights.ravel()


def _area(polygon: Array) -> Array:
    """Areas of polygons, positive where their corners turn to the left, shape (n,)."""
    following = np.roll(polygon, -1, axis=1)
    cross = polygon[..., 0] * following[..., 1] - polygon[..., 1] * following[..., 0]
    return np.asarray(0.5 * cross.sum(axis=1))


def _counterclockwise(polygon: Array) -> Array:
    """Polygons, shape (n, k, 2), whose corners turn to the left."""
    return np.where((_area(polygon) < 0.0)[:, None, None], polygon[:, ::-1], polygon)


def clip(polygon: Array, window: Array) -> tuple[Array, Ints]:
    """Parts of polygons inside others, all pairs at once.

    Args:
        polygon: Corners of convex polygons, shape (n, k, 2).
        window: Corners of the convex polygons to keep inside of, to the left, shape (n, j, 2).

    Returns:
        Corners of the parts in order, shape (n, k + j, 2), of which the first ``count`` are
        valid; and count, shape (n,), 0 where nothing is left.
    """
    n, k = polygon.shape[:2]
    width = k + window.shape[1]
    out = np.zeros((n, width, 2))
    out[:, :k] = polygon
    count = np.full(n, k)
    columns = np.arange(width)
    for edge in range(window.shape[1]):
        start = window[:, edge, None]
        along = window[:, (edge + 1) % window.shape[1], None] - start
        away = out - start
        side = along[..., 0] * away[..., 1] - along[..., 1] * away[..., 0]
        valid = columns < count[:, None]
        following = np.where(columns + 1 < count[:, None], columns + 1, 0)
        there = np.take_along_axis(side, following, axis=1)
        target = np.take_along_axis(out, following[..., None], axis=1)
        crosses: Bools = valid & ((side >= 0.0) != (there >= 0.0))
        part = np.divide(side, side - there, out=np.zeros_like(side), where=crosses)
        between = out + part[..., None] * (target - out)
        # each corner inside, followed by the point where its edge crosses
        both = np.stack([out, between], axis=2).reshape(n, 2 * width, 2)
        keep = np.stack([valid & (side >= 0.0), crosses], axis=2).reshape(n, 2 * width)
        order = np.argsort(~keep, axis=1, kind="stable")[:, :width]
        out = np.take_along_axis(both, order[..., None], axis=1)
        count = np.minimum(keep.sum(axis=1), width)
    return out, count
