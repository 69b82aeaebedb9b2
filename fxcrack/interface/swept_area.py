"""Area that a front sweeps when one of its nodes is released.

A node stands for parts of the facets around it, but its release moves the front over those ahead
of it. Each facet is therefore divided among pairs of a node on the side the front comes from and
one on the other side, by the direction g in which the front reaches it:

    triangle        shares max(0, -g . grad N_i) of the near nodes and max(0, g . grad N_j) of the
                    far ones, as upwind schemes distribute a flux (Roe 1987, "N scheme")
    quadrilateral   the two partners of each line along which the front may come, in the ratio
                    |g . grad xi| : |g . grad eta|

With A+ the area ahead of a node (pairs in which it is the near one), A- the area behind it and A++
the area ahead of its partners, the release of the node moves the front over

    A = A+ - alpha (A+ - A-) - beta (A++ - A+)

A+ alone is the area between the nodes. A finite element model with its tip at a node has the energy
of a crack shorter by alpha d_behind + beta d_ahead (:data:`_OFFSET`), and this is what changes
where lengths do: without it the bond before a coarser element would have to dissipate more than the
bodies set free. The elements behind the first front count as if they were as long as those ahead of
it. So all areas add up to the surface whatever the order of release, and on even spacing every node
has its tributary area.
"""

from __future__ import annotations

import basix
import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.surface import FacetSurface, shape_functions
from fxcrack.interface.tips import cross, first_by_place

_OFFSET = {1: (0.057, 0.031), 2: (0.02, 0.017)}
"""alpha and beta per order of the elements.

From the energy of models with a step in element length: order 1 in the asymptotic field of a crack
tip; order 2 between that, (0.014, 0.008), and arms of three to six elements per height, (0.026,
0.026).
"""

_LINES = {
    # per coordinate the lines (near, far) if it grows along g; first and second order
    4: (((0, 1), (2, 3)), ((0, 2), (1, 3))),
    9: (((0, 1), (2, 3), (5, 6)), ((0, 2), (1, 3), (4, 7))),
}
_MIDDLE = {
    # the node in the middle of each of these lines
    4: ((-1, -1), (-1, -1)),
    9: ((4, 7, 8), (5, 6, 8)),
}
_LEAST = 0.05
"""Least part of its tributary area that a node sweeps: fronts that turn away from the direction
they started in may leave nodes with next to none."""


def facet_parts(surface: FacetSurface) -> Array:
    """Area each facet gives to each of its nodes, the integrals of the shape functions.

    Shape (n_facets, nodes_per_facet), length^2; they add up to the tributary areas of the nodes.
    """
    cell = getattr(basix.CellType, surface.kind)
    xi, weights = basix.make_quadrature(cell, 2 * surface.order + 2)
    values, _ = shape_functions(surface.kind, surface.order, np.asarray(xi))
    _, size = surface.facet_normals(np.asarray(xi))
    breadth = surface.breadth[surface.facets] @ values.T
    return np.asarray(np.einsum("m,fm,mk->fk", weights, size * breadth, values))


def swept(ahead: float, behind: float, beyond: float, order: int) -> float:
    """Area that the front sweeps over a node.

    Args:
        ahead: Area between the node and the next one, length^2.
        behind: Area between the node and the one behind, length^2.
        beyond: Area between the next node and the one after it, length^2.
        order: Order of the elements, 1 or 2.
    """
    alpha, beta = _OFFSET[order]
    return ahead - alpha * (ahead - behind) - beta * (beyond - ahead)


class SweptArea:
    """Swept areas of the nodes of one surface (3-D).

    Args:
        surface: The undeformed surface.
        heading: Direction in which the front is expected at each node, shape (n_nodes, 3); zero
            where it is not known.
        bonded: Nodes bonded at the beginning, shape (n_nodes,).
    """

    def __init__(self, surface: FacetSurface, heading: Array, bonded: Bools) -> None:
        self._surface = surface
        self._bonded = bonded
        self._heading = heading
        self._parts = facet_parts(surface)
        self._forth, self._back = self._areas(1.0), self._areas(-1.0)

    def of_node(self, node: int, growth: Array) -> float:
        """Area that a node sweeps, length^2; midside nodes have theirs at the corners.

        Args:
            node: Slave node.
            growth: Growth direction of the front there, shape (3,).
        """
        normal, heading = self._surface.normals[node], self._heading[node]
        along = cross(normal, cross(heading, normal))
        # a front that has run past the middle between two comes from the other side
        against = float(along @ growth) < -0.5 * float(np.linalg.norm(along))
        return float((self._back if against else self._forth)[node])

    def _areas(self, sign: float) -> Array:
        """Area of each node if the front comes along the heading, or against it."""
        surface, order = self._surface, self._surface.order
        near, far, area = self._pairs(sign)
        n = surface.n_nodes
        ahead, behind = np.bincount(near, area, n), np.bincount(far, area, n)
        # at the ends of the surface as if it went on evenly, and likewise behind the first front
        ahead_too = np.where(ahead > 0.01 * surface.areas, ahead, behind)
        grown = np.bincount(far, area * self._bonded[near], n)
        part = np.divide(grown, behind, out=np.zeros(n), where=behind > 0.0)
        behind_too = grown + (1.0 - part) * ahead
        through = np.divide(area, behind[far], out=np.zeros_like(area), where=behind[far] > 0.0)
        beyond = np.bincount(near, through * ahead_too[far], n)
        alpha, beta = _OFFSET[order]
        out = ahead - alpha * (ahead - behind_too) - beta * (beyond - ahead)
        leads = ahead > 0.01 * surface.areas
        return np.where(leads, np.maximum(out, _LEAST * surface.areas), ahead)

    def _pairs(self, sign: float) -> tuple[Ints, Ints, Array]:
        """Near node, far node and area of the parts of all facets, each of shape (n_parts,)."""
        surface = self._surface
        corners = surface.facets[:, : surface.n_corners]
        direction = sign * self._heading[corners].mean(axis=1)
        corner = surface.x[corners]
        if surface.kind == "triangle":
            slopes = np.einsum("fic,fc->fi", _triangle_gradients(corner), direction)
            near, far = np.maximum(-slopes, 0.0), np.maximum(slopes, 0.0)
            both = near[:, :, None] * far[:, None, :]
            total = both.sum(axis=(1, 2))
            whole = self._parts.sum(axis=1) / np.where(total > 0.0, total, 1.0)
            area = both * whole[:, None, None]
            shape = area.shape
            return (
                np.broadcast_to(surface.facets[:, :, None], shape).ravel(),
                np.broadcast_to(surface.facets[:, None, :], shape).ravel(),
                area.ravel(),
            )
        rates = _quadrilateral_rates(corner, direction)
        total = np.abs(rates).sum(axis=1)
        weight = np.abs(rates) / np.where(total > 0.0, total, 1.0)[:, None]
        out: list[tuple[Ints, Ints, Array]] = []
        k = surface.facets.shape[1]
        for axis in range(2):
            turned = rates[:, axis] < 0.0
            for (a, b), m in zip(_LINES[k][axis], _MIDDLE[k][axis], strict=False):
                area = self._parts[:, a] + self._parts[:, b]
                if m >= 0:
                    area = area + self._parts[:, m]
                one, two = surface.facets[:, a], surface.facets[:, b]
                out.append(
                    (np.where(turned, two, one), np.where(turned, one, two), weight[:, axis] * area)
                )
        near_nodes, far_nodes, areas = (np.concatenate(c) for c in zip(*out, strict=True))
        return near_nodes, far_nodes, areas


def _triangle_gradients(corner: Array) -> Array:
    """Gradients of the linear shape functions, shape (n_facets, 3, 3), 1/length."""
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    aa, ab, bb = ((p * q).sum(axis=1)[:, None] for p, q in ((a, a), (a, b), (b, b)))
    square = aa * bb - ab * ab
    one, two = (bb * a - ab * b) / square, (aa * b - ab * a) / square
    return np.stack([-one - two, one, two], axis=1)


def _quadrilateral_rates(corner: Array, direction: Array) -> Array:
    """Rates of both facet coordinates along a direction, shape (n_facets, 2), 1/length."""
    a = 0.5 * (corner[:, 1] + corner[:, 3] - corner[:, 0] - corner[:, 2])
    b = 0.5 * (corner[:, 2] + corner[:, 3] - corner[:, 0] - corner[:, 1])
    aa, ab, bb = ((p * q).sum(axis=1) for p, q in ((a, a), (a, b), (b, b)))
    ag, bg = (a * direction).sum(axis=1), (b * direction).sum(axis=1)
    square = aa * bb - ab * ab
    return np.stack([(bb * ag - ab * bg) / square, (aa * bg - ab * ag) / square], axis=1)


def nearest_heading(surface: FacetSurface, centre: Array, direction: Array) -> Array:
    """Direction at each node of the front nearest to it, averaged over a few of its facets.

    One facet alone may lie on the side of a step of the front.

    Args:
        surface: The surface.
        centre: Centres of the facets cut by the front, shape (n_cut, 3), length.
        direction: Unit growth directions there, shape (n_cut, 3).

    Returns:
        Shape (n_nodes, 3), unit vectors.
    """
    out = np.empty((surface.n_nodes, 3))
    # some hundred thousand distances at a time
    step = max(1, 500_000 // max(len(centre), 1))
    for start in range(0, surface.n_nodes, step):
        rows: Ints = np.arange(start, min(start + step, surface.n_nodes))
        distance = np.linalg.norm(surface.x[rows, None] - centre[None], axis=2)
        beyond = (distance - distance.min(axis=1, keepdims=True)) / (2.0 * surface.facet_size)
        weight = np.exp(-(beyond**2))
        mean = weight @ direction
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        # opposite fronts at one distance: no mean, one of them
        lost = length < 0.5 * weight.sum(axis=1, keepdims=True)
        nearest = direction[np.argmin(distance, axis=1)]
        for i in np.flatnonzero(lost[:, 0]):
            nearest[i] = direction[first_by_place(-distance[i], centre)]
        out[rows] = np.where(lost, nearest, mean / np.maximum(length, 1e-300))
    return out
