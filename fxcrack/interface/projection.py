"""Closest-point projection of points onto the facets of a surface; pure numpy.

    min_xi | x - sum_k N_k(xi) x_k |,   xi inside the facet

Matching nodes are recognised first and get the single weight 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from fxcrack.interface.surface import FacetSurface, shape_functions

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Projection:
    """Where points fall on a surface.

    Attributes:
        facet: Facet number per point, shape (n,).
        weights: Shape-function weights on the facet's nodes, rows sum to 1, shape (n, k).
        foot: Projected points, shape (n, 3).
        normal: Outward unit normal of the surface there, shape (n, 3).
        distance: Distance from point to foot, shape (n,), length.
    """

    facet: Ints
    weights: Array
    foot: Array
    normal: Array
    distance: Array


def project(points: Array, surface: FacetSurface, *, n_candidates: int = 12) -> Projection:
    """Project points onto a surface.

    Args:
        points: Shape (n, 3).
        surface: Facets to project on.
        n_candidates: Facets with the closest centres that are tried for each point.

    Returns:
        The closest feet found; points beyond the border fall on the border.
    """
    corners = surface.x[surface.facets[:, : surface.n_corners]]
    tree = cKDTree(corners.mean(axis=1))
    n_candidates = min(n_candidates, len(surface.facets))
    _, candidate = tree.query(points, k=n_candidates)
    candidate = np.asarray(candidate).reshape(len(points), n_candidates)
    n, k = len(points), surface.facets.shape[1]
    best = np.full(n, np.inf)
    facet = np.zeros(n, dtype=np.int64)
    xi_best = np.zeros((n, surface.dim))
    for column in candidate.T:
        xi = _closest(points, surface.x[surface.facets[column]], surface)
        values, _ = shape_functions(surface.kind, surface.order, xi)
        foot = np.einsum("nk,nkc->nc", values, surface.x[surface.facets[column]])
        distance = np.linalg.norm(points - foot, axis=1)
        better = distance < best * (1.0 - 1e-12)
        best[better], facet[better], xi_best[better] = distance[better], column[better], xi[better]
    weights, _ = shape_functions(surface.kind, surface.order, xi_best)
    weights = np.where(np.abs(weights) < 1e-9, 0.0, weights)
    one = np.abs(weights).max(axis=1) > 1.0 - 1e-8
    weights[one] = np.round(weights[one])
    weights /= weights.sum(axis=1, keepdims=True)
    foot = np.einsum("nk,nkc->nc", weights, surface.x[surface.facets[facet]])
    normal = np.einsum("nk,nkc->nc", weights.reshape(n, k), surface.normals[surface.facets[facet]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Projection(facet, weights, foot, normal, np.linalg.norm(points - foot, axis=1))


def _closest(points: Array, nodes: Array, surface: FacetSurface) -> Array:
    """Reference coordinates of the closest points, one facet per point (projected Gauss-Newton)."""
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
