"""Strains of shells: matrices of the covariant strains of each reference element.

A point of a shell is x = X + u + z (D + w): X + u on the reference surface and the director D + w,
whose change w is a vector and no angle. With x and d = D + w of the nodes as vectors, in the order
x_1, d_1, x_2, d_2, ..., the covariant strains are quadratic in them
(:mod:`fxcrack.continuum.strain_cells`):

    E0_ab = (x,a . x,b - ...)/2      E1_ab = (x,a . d,b + x,b . d,a - ...)/2        a, b = 1, 2
    E0_a3 = (x,a . d - ...)/2        E0_33 = (d . d - ...)/2

where "..." is the same of the undeformed shell. E1_a3 is left out (of order thickness/radius), and
E1_33 is an enhanced strain (seven parameters: Buechter, Ramm, Roehl 1994). Where the middle of the
section lies at z = s off the reference surface, E_a3 is that of the middle, with x + s d in the
place of x, and the enhanced strain is 0 there: so the shell is the same wherever its mesh lies.

First order: E0_a3 is tied at the middles of the edges (quadrilaterals: Dvorkin and Bathe 1984;
triangles: Lee and Bathe 2004) and E0_33 at the corners (Betsch and Stein 1995). Second-order
quadrilaterals: all but bending with the weight 1 - k at the 2 x 2 points and k at the 3 x 3 points,
k = min(1, t^2/area) (Arnold and Brezzi 1997), bending at the latter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import basix
import numpy as np

from fxcrack.base.arrays import Array

COVARIANT = ("0_11", "0_22", "0_33", "0_23", "0_13", "0_12", "1_11", "1_22", "1_12")
"""Order of the covariant strains: at the reference surface, then per unit of z."""


@dataclass(frozen=True)
class ShellElement:
    """Reference element of a shell.

    Attributes:
        values: Shape functions at the integration points, shape (n_points, n_nodes).
        gradients: Their derivatives, shape (2, n_points, n_nodes).
        points: Integration points, shape (n_points, 2).
        weights: Their weights, shape (n_points,).
        soft: Share of all energy but bending at each point for k = 0 and k = 1, shape (2,
            n_points).
        bending: Share of the bending energy, shape (n_points,).
        matrices: Of the covariant strains, shape (n_points, 9, 2 n_nodes, 2 n_nodes).
        centre_gradients: Derivatives of the shape functions at the middle, shape (2, n_nodes).
        node_gradients: Derivatives at the nodes, shape (2, n_nodes, n_nodes).
        corners: Vertices of the reference cell, shape (3 or 4, 2).
    """

    values: Array
    gradients: Array
    points: Array
    weights: Array
    soft: Array
    bending: Array
    matrices: Array
    centre_gradients: Array
    node_gradients: Array
    corners: Array

    def matrices_at(self, offset: float) -> Array:
        """Matrices of a section whose middle lies off the reference surface, shape as theirs.

        Args:
            offset: Coordinate z of the middle, length.
        """
        if not offset:
            return self.matrices
        n = self.matrices.shape[-1] // 2
        to_middle = np.kron(np.eye(n), np.array([[1.0, offset], [0.0, 1.0]]))
        out = self.matrices.copy()
        out[:, 3:5] = to_middle.T @ out[:, 3:5] @ to_middle
        return out


@lru_cache(maxsize=8)
def shell_element(kind: str, order: int) -> ShellElement:
    """The reference element of a cell shape.

    Args:
        kind: "triangle" or "quadrilateral".
        order: 1, or 2 for quadrilaterals.
    """
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType[kind], order, basix.LagrangeVariant.equispaced
    )

    def tabulate(x: Array) -> tuple[Array, Array]:
        table = element.tabulate(1, np.atleast_2d(x))[..., 0]
        return np.asarray(table[0]), np.asarray(table[1:])

    points, weights = (np.asarray(a) for a in basix.make_quadrature(basix.CellType[kind], 2))
    one = np.ones(len(points))
    soft, bending = np.stack([one, one]), one
    if order == 2:
        full, full_weights = (np.asarray(a) for a in basix.make_quadrature(element.cell_type, 5))
        zero, whole = np.zeros(len(points)), np.ones(len(full))
        soft = np.stack([np.append(one, 0.0 * whole), np.append(zero, whole)])
        bending = np.append(zero, whole)
        points, weights = np.concatenate([points, full]), np.append(weights, full_weights)
    values, gradients = tabulate(points)
    matrices = np.stack(
        [_at_point(n, g) for n, g in zip(values, gradients.swapaxes(0, 1), strict=True)]
    )
    if order == 1:
        tie = _tied_quadrilateral if kind == "quadrilateral" else _tied_triangle

        def sample(x: tuple[float, float]) -> Array:
            n, g = tabulate(np.array(x))
            return _at_point(n[0], g[:, 0])

        for i, x in enumerate(points):
            matrices[i, 2:5] = tie(sample, float(x[0]), float(x[1]))
    middle = np.asarray(basix.geometry(element.cell_type)).mean(axis=0)
    at_nodes = tabulate(np.asarray(element.points))[1]
    return ShellElement(
        values, gradients, points, weights, soft, bending, matrices, tabulate(middle)[1][:, 0],
        at_nodes, np.asarray(basix.geometry(element.cell_type)),
    )  # fmt: skip


def _at_point(n: Array, g: Array) -> Array:
    """Matrices of the nine strains at a point, untied.

    Args:
        n: Shape functions, shape (n_nodes,).
        g: Their derivatives, shape (2, n_nodes).
    """
    x: list[Array] = [np.kron(row, np.array([1.0, 0.0])) for row in g]
    d: list[Array] = [np.kron(row, np.array([0.0, 1.0])) for row in g]
    director: Array = np.kron(n, np.array([0.0, 1.0]))

    def product(a: Array, b: Array) -> Array:
        return 0.5 * (np.outer(a, b) + np.outer(b, a))

    return np.stack(
        [
            product(x[0], x[0]),
            product(x[1], x[1]),
            product(director, director),
            product(x[1], director),
            product(x[0], director),
            product(x[0], x[1]),
            2.0 * product(x[0], d[0]),
            2.0 * product(x[1], d[1]),
            product(x[0], d[1]) + product(x[1], d[0]),
        ]
    )


Sample = Callable[[tuple[float, float]], Array]


def _tied_quadrilateral(sample: Sample, x: float, y: float) -> Array:
    """E0_33, E0_23, E0_13 at a point of the unit square."""
    low, high, left, right = (sample(p) for p in ((0.5, 0.0), (0.5, 1.0), (0.0, 0.5), (1.0, 0.5)))
    corners = [sample(p)[2] for p in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))]
    share = ((1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y)
    thickness = sum(s * m for s, m in zip(share, corners, strict=True))
    return np.stack([thickness, (1 - x) * left[3] + x * right[3], (1 - y) * low[4] + y * high[4]])


def _tied_triangle(sample: Sample, x: float, y: float) -> Array:
    """E0_33, E0_23, E0_13 at a point of the unit triangle."""
    low, left, slope = (sample(p) for p in ((0.5, 0.0), (0.0, 0.5), (0.5, 0.5)))
    corners = [sample(p)[2] for p in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))]
    thickness = (1 - x - y) * corners[0] + x * corners[1] + y * corners[2]
    change = slope[4] - slope[3] - low[4] + left[3]
    return np.stack([thickness, left[3] - change * x, low[4] + change * y])


__all__ = ["COVARIANT", "ShellElement", "shell_element"]
