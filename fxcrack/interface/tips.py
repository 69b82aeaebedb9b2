"""Tips of a front and their local geometry."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.surface import FacetSurface


@dataclass(frozen=True)
class Tip:
    """One front node and what surrounds it.

    Attributes:
        node: Slave node.
        force_nodes: Nodes whose bond forces count, and that are released together, shape (k,).
        wake_nodes: Two nodes per wake point, shape (k, 2).
        wake_weights: Their weights, shape (k, 2).
        frame: Columns n, s (growth direction), t (front tangent), shape (3, 3).
        d_ahead: Distance to the next node along s, 0 at the end of the surface, length.
        d_behind: Distance to the wake point, length.
        width: Front length (times thickness or ring) the node stands for, length.
        area: Area that opens when the node is released, length^2.
        further_nodes: Two nodes of the next corner point behind the wake point, shape (2,).
        further_weights: Their weights, shape (2,).
        d_further: Distance of that point along the surface, 0 where none is open, length.
        straight: Whether ``d_ahead`` and ``d_behind`` lie on one line through the node; not so
            where the growth direction points out of the surface at its edge.
        ligament: Whether it is bonded between two open parts on opposite sides; the wake point is
            then the mean of one on either side, lengths are means of both sides, and the growth
            direction is away from the nearer one.
    """

    node: int
    force_nodes: Ints
    wake_nodes: Ints
    wake_weights: Array
    frame: Array
    d_ahead: float
    d_behind: float
    width: float
    area: float
    further_nodes: Ints
    further_weights: Array
    d_further: float
    straight: bool
    ligament: bool = False


@dataclass(frozen=True)
class Tips:
    """Several tips as arrays, first axis n_tips; fields as in :class:`Tip`."""

    node: Ints
    force_nodes: Ints
    wake_nodes: Ints
    wake_weights: Array
    frame: Array
    d_ahead: Array
    d_behind: Array
    width: Array
    area: Array
    further_nodes: Ints
    further_weights: Array
    d_further: Array
    straight: Bools
    ligament: Bools

    def __len__(self) -> int:
        """Number of tips."""
        return len(self.node)


def gradient(s: FacetSurface, facet: int, indicator: Array) -> tuple[Array, float]:
    """Gradient of a nodal indicator at a facet's centre, and the facet's size.

    Args:
        s: Surface.
        facet: Number of the facet.
        indicator: Nodal values, shape (n_nodes,).

    Returns:
        Gradient, shape (3,), 1/length; length of an interval, area of a quadrilateral or twice the
        area of a triangle (length^2).
    """
    corner = s.facets[facet, : s.n_corners]
    x, v = s.x[corner], indicator[corner]
    if s.kind == "interval":
        along = x[1] - x[0]
        square = float(along @ along)
        return (v[1] - v[0]) / square * along, math.sqrt(square)
    if s.kind == "triangle":
        a, b = np.stack([x[1] - x[0], x[2] - x[0]]), np.array([v[1] - v[0], v[2] - v[0]])
    else:
        a = 0.5 * np.stack([x[1] + x[3] - x[0] - x[2], x[2] + x[3] - x[0] - x[1]])
        b = 0.5 * np.array([v[1] + v[3] - v[0] - v[2], v[2] + v[3] - v[0] - v[1]])
    (aa, ab), (_, bb) = (a @ a.T).tolist()
    square = aa * bb - ab * ab
    c0, c1 = bb * b[0] - ab * b[1], aa * b[1] - ab * b[0]
    return np.asarray((c0 * a[0] + c1 * a[1]) / square), math.sqrt(square)


def norm(a: Array) -> float:
    """Norm of one vector, shape (3,); numpy's own takes ten times as long on three numbers."""
    return math.sqrt(float(a @ a))


def cross(a: Array, b: Array) -> Array:
    """Vector product of two vectors, each of shape (3,), as is the result; likewise."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


_EDGES = ((0, 4, 1), (2, 7, 3), (0, 5, 2), (1, 6, 3))
"""Corner, midside, corner of second-order quadrilaterals in basix order."""


@dataclass(frozen=True)
class FrontUnits:
    """Which tips soften together.

    Attributes:
        leaders: Position of the tip that stands for each unit, shape (n_units,): the midside row,
            or the one row of a unit.
        shares: Part of each tip in the rate of each unit, rows sum to 1, shape (n_units, n_tips).
    """

    leaders: Ints
    shares: Array

    def mean(self, values: Array) -> Array:
        """Values of tips averaged over units, shape (..., n_tips, m) to (..., n_units, m)."""
        return np.asarray(self.shares @ values)

    def at_tips(self, values: Array) -> Array:
        """Largest value of the units a tip is part of, shape (..., n_units) to (..., n_tips)."""
        spread = np.where(self.shares > 0.0, values[..., None], -np.inf)
        return np.asarray(spread.max(axis=-2, initial=-np.inf))


def edge_midsides(surface: FacetSurface) -> dict[int, tuple[int, int]]:
    """Corners of the element edge of each midside node; empty on other than such faces."""
    if surface.kind != "quadrilateral" or surface.order != 2:
        return {}
    edges = np.concatenate([surface.facets[:, e] for e in _EDGES])
    return {m: (a, b) for a, m, b in edges.tolist()}


def units_of(edges: dict[int, tuple[int, int]], tips: Tips) -> FrontUnits:
    """Units of the present front.

    Args:
        edges: From :func:`edge_midsides`.
        tips: The front.
    """
    n = len(tips)
    at = {node: i for i, node in enumerate(tips.node.tolist())}
    share = np.zeros((n, n))
    for node, i in at.items():
        share[i, i] = 1.0
        for corner in edges.get(node, ()):
            if corner in at:
                share[i, at[corner]] = 1.0
    beside = share.sum(axis=0) - 1.0  # edges a corner row belongs to
    leads = np.array([node in edges for node in at], dtype=bool) | (beside == 0.0)
    share = share[leads] / np.maximum(beside, 1.0) * tips.area
    return FrontUnits(np.flatnonzero(leads), share / share.sum(axis=1, keepdims=True))


_SAME = 1e-9
"""Lengths and cosines that differ by less than this fraction are equal."""
_PLACES = np.array([0.8147, 0.4351, 0.3836])
"""Direction along which equal places are ordered: across no symmetry that meshes usually have."""


def first_by_place(values: Array, x: Array) -> int:
    """Position of the largest of some values; of equal ones the first along a fixed direction.

    Args:
        values: Shape (n,), of the size of lengths in ``x`` or of 1.
        x: Places they belong to, shape (n, 3); unlike numbers of nodes, these are the mesh's own.
    """
    top = float(values.max())
    equal = np.flatnonzero(values >= top - _SAME * max(abs(top), float(np.abs(values).max())))
    return int(equal[np.argmin(x[equal] @ _PLACES)]) if len(equal) > 1 else int(equal[0])
