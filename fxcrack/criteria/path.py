"""A point at a given distance along a path of face nodes, by the shape functions of the faces.

The path starts at the crack tip. First order: every node ends a face. Second order: corner,
midside, corner, ..., so that the number of nodes is odd. On a face

    x(xi) = sum_i N_i(xi) x_i,    values likewise,    xi in [-1, 1],    |x(xi) - x_tip| = distance
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fxcrack.criteria.checks import Array
from fxcrack.errors import InputError


def locate(owner: str, points: npt.ArrayLike, distance: float, order: int) -> tuple[slice, Array]:
    """Face and shape-function weights of the point at a straight-line distance from the first one.

    Args:
        owner: Who asks, for messages.
        points: Positions of the nodes of the path from the tip on, shape (m, dim) [length].
        distance: Straight-line distance from ``points[0]`` [length].
        order: Order of the faces, 1 or 2.

    Returns:
        The rows of the face's nodes and their weights, shape (order + 1,): the value there is
        ``weights @ values[rows]``. Of several such points the first one on the path.

    Raises:
        InputError: The path ends before the distance, or is no path of faces of this order.
    """
    x = np.asarray(points, dtype=np.float64)
    if order not in (1, 2) or x.ndim != 2 or len(x) < order + 1 or (len(x) - 1) % order:
        raise InputError(
            f"{owner}: a path of order {order} cannot have points of shape {x.shape}; first order "
            "needs at least 2 nodes, second order an odd number of at least 3: corner, midside, ..."
        )
    radius = np.linalg.norm(x - x[0], axis=1)
    if not np.isfinite(radius).all():
        raise InputError(f"{owner}: the path of face nodes contains NaN or infinite positions")
    reach = float(radius[::order].max())
    # A distance equal to the end of the path must not fail by round-off.
    if not 0.0 <= distance <= reach * (1.0 + 1e-12):
        raise InputError(
            f"{owner}: the distance {distance:g} lies outside the end points of the surface: the "
            f"path of face nodes reaches {reach:g} from the tip; give a distance between 0 and "
            "that, or extend the surfaces"
        )
    face = int(np.argmax(radius[order::order] >= min(distance, reach)))
    rows = slice(face * order, (face + 1) * order + 1)
    return rows, _weights(_solve(x[rows] - x[0], min(distance, reach), order), order)


def _weights(xi: float, order: int) -> Array:
    """Lagrange shape functions on [-1, 1], nodes in the order of the path."""
    if order == 1:
        return np.array([(1.0 - xi) / 2.0, (1.0 + xi) / 2.0])
    return np.array([xi * (xi - 1.0) / 2.0, 1.0 - xi * xi, xi * (xi + 1.0) / 2.0])


def _solve(x: Array, distance: float, order: int) -> float:
    """Coordinate xi on one face with |x(xi)| = distance: Newton inside a shrinking bracket."""
    low, high = -1.0, 1.0
    radius = np.linalg.norm(x, axis=1)
    gain = radius[-1] - radius[0]
    xi = -1.0 + 2.0 * float((distance - radius[0]) / gain) if gain > 0.0 else 1.0
    for _ in range(100):  # bisection alone needs 53
        point = _weights(xi, order) @ x
        slopes = np.array([-0.5, 0.5] if order == 1 else [xi - 0.5, -2.0 * xi, xi + 0.5])
        r = float(np.linalg.norm(point))
        miss = r - distance
        if abs(miss) <= 4e-16 * distance:
            break
        if miss > 0.0:
            high = xi
        else:
            low = xi
        slope = float(point @ (slopes @ x)) / r if r > 0.0 else 0.0
        step = xi - miss / slope if slope > 0.0 else np.inf
        new = float(step) if low < step < high else (low + high) / 2.0
        if abs(new - xi) <= 1e-16:
            break
        xi = new
    return xi
