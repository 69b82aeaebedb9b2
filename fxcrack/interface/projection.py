"""Closest-point projection of points onto the facets of a surface; pure numpy.

    min_xi | x - sum_k N_k(xi) x_k |,   xi inside the facet

Nodes of the surface itself get the single weight 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base.arrays import Array, Ints
from fxcrack.interface.surface import FacetSurface, facet_element, shape_functions


@dataclass(frozen=True)
class Projection:
    """Projections of points onto a surface.

    Attributes:
        facet: Facet number per point, shape (n,).
        weights: Shape-function weights on the facet's nodes, rows sum to 1, shape (n, k).
        foot: Projected points, shape (n, 3), length.
        normal: Outward unit normal of the surface there, shape (n, 3).
        distance: Distance from point to foot, shape (n,), length.
    """

    facet: Ints
    weights: Array
    foot: Array
    normal: Array
    distance: Array


def project(points: Array, surface: FacetSurface) -> Projection:
    """Project points onto a surface.

    Args:
        points: Positions, shape (n, 3), length.
        surface: Facets to project on.

    Returns:
        The closest points, one per row; points beyond the border are projected on the border.
    """
    n, k = len(points), surface.facets.shape[1]
    best = np.full(n, np.inf)
    facet = np.zeros(n, dtype=np.int64)
    xi_best = np.zeros((n, surface.dim))

    def attempt(chosen: Ints, column: Ints) -> None:
        nodes = surface.x[surface.facets[column]]
        xi = closest(points[chosen], nodes, surface)
        values, _ = shape_functions(surface.kind, surface.order, xi)
        foot = np.einsum("nk,nkc->nc", values, nodes)
        distance = np.linalg.norm(points[chosen] - foot, axis=1)
        better = distance < best[chosen] * (1.0 - 1e-12)
        won = chosen[better]
        best[won], facet[won], xi_best[won] = distance[better], column[better], xi[better]

    for members, centre, radius in by_size(surface):
        tree, waiting, n_near = cKDTree(centre), np.arange(n), min(4, len(members))
        while len(waiting):
            far, near = tree.query(points[waiting], k=n_near)
            far, near = far.reshape(len(waiting), -1), near.reshape(len(waiting), -1)
            for away, column in zip(far.T, near.T, strict=True):
                # a facet lies within its radius of its centre, and none is closer than touching
                hopeful = (away - radius < best[waiting]) & (best[waiting] > 1e-12 * radius)
                if hopeful.any():
                    attempt(waiting[hopeful], members[column[hopeful]])
            open_end = (far[:, -1] - radius < best[waiting]) & (best[waiting] > 1e-12 * radius)
            if n_near == len(members):
                break
            waiting, n_near = waiting[open_end], min(2 * n_near, len(members))
    weights, _ = shape_functions(surface.kind, surface.order, xi_best)
    weights = np.where(np.abs(weights) < 1e-9, 0.0, weights)
    at_node = facet_element(surface.kind, surface.order).points
    one = (np.abs(xi_best[:, None] - at_node).max(axis=2) < 1e-8).any(axis=1)
    weights[one] = np.round(weights[one])
    weights /= weights.sum(axis=1, keepdims=True)
    foot = np.einsum("nk,nkc->nc", weights, surface.x[surface.facets[facet]])
    normal = np.einsum("nk,nkc->nc", weights.reshape(n, k), surface.normals[surface.facets[facet]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Projection(facet, weights, foot, normal, np.linalg.norm(points - foot, axis=1))


def by_size(surface: FacetSurface) -> list[tuple[Ints, Array, float]]:
    """Facets of similar size together: their numbers, centres and largest radius.

    On a graded surface the closest centre may belong to a small facet beside the large one that
    holds the point; among facets of one size few centres need to be looked at.

    Args:
        surface: The surface.

    Returns:
        Per size the facets, shape (n,), their centres, shape (n, 3), length, and the radius.
    """
    nodes = surface.x[surface.facets]
    centre = nodes[:, : surface.n_corners].mean(axis=1)
    radius = np.linalg.norm(nodes - centre[:, None], axis=2).max(axis=1)
    size = np.floor(np.log2(radius / radius.max() * (1.0 + 1e-9))).astype(np.int64)
    groups = [np.flatnonzero(size == s) for s in np.unique(size)]
    return [(g, centre[g], float(radius[g].max())) for g in groups]


def closest(points: Array, nodes: Array, surface: FacetSurface) -> Array:
    """Reference coordinates of the closest points, one facet per point (projected Gauss-Newton).

    Args:
        points: Positions, shape (n, 3), length.
        nodes: Nodes of the facet of each point, shape (n, k, 3), length.
        surface: Says the shape functions of the facets.

    Returns:
        Shape (n, dim).
    """
    xi = np.full((len(points), surface.dim), 0.5 if surface.kind != "triangle" else 1.0 / 3.0)
    for _ in range(30):
        values, gradient = shape_functions(surface.kind, surface.order, xi)
        residual = points - np.einsum("nk,nkc->nc", values, nodes)
        jacobian = np.einsum("dnk,nkc->ndc", gradient, nodes)
        normal_matrix = np.einsum("ndc,nec->nde", jacobian, jacobian)
        right = np.einsum("ndc,nc->nd", jacobian, residual)
        step = np.linalg.solve(normal_matrix, right[..., None])[..., 0]
        new = _clip(xi + step, xi, step, normal_matrix, surface.kind)
        moved = np.abs(new - xi).max(initial=0.0)
        xi = new
        if moved < 1e-14:
            break
    return xi


def _clip(trial: Array, xi: Array, step: Array, metric: Array, kind: str) -> Array:
    """Bring reference points back into the facet; coordinate-wise minimisation on its border."""
    if kind == "triangle":
        return _clip_triangle(trial, metric)
    clipped = np.clip(trial, 0.0, 1.0)
    if clipped.shape[1] == 2:
        # with one coordinate on its bound, the other minimises the quadratic model along it
        for a, b in ((0, 1), (1, 0)):
            bound = trial[:, a] != clipped[:, a]
            excess = clipped[:, a] - trial[:, a]
            free = trial[:, b] - metric[:, a, b] / metric[:, b, b] * excess
            clipped[bound, b] = np.clip(free[bound], 0.0, 1.0)
    return clipped


def _clip_triangle(trial: Array, metric: Array) -> Array:
    """Closest point of the reference triangle in the metric of the facet."""
    inside = (trial.min(axis=1) >= 0.0) & (trial.sum(axis=1) <= 1.0)
    out = trial.copy()
    best = np.full(len(trial), np.inf)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    for i in range(3):
        start, along = corners[i], corners[(i + 1) % 3] - corners[i]
        offset = trial - start
        s = np.einsum("nd,nde,e->n", offset, metric, along)
        s = np.clip(s / np.einsum("d,nde,e->n", along, metric, along), 0.0, 1.0)
        foot = start + s[:, None] * along
        gap = trial - foot
        distance = np.einsum("nd,nde,ne->n", gap, metric, gap)
        better = ~inside & (distance < best)
        best[better], out[better] = distance[better], foot[better]
    return out
