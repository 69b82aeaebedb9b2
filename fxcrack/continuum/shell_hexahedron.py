"""Strains of the first-order continuum shell: matrices of its sampled covariant strains.

A hexahedron of 8 nodes, its third reference axis zeta across the thickness. With the positions x
of the nodes as vectors, the covariant strains are quadratic in them
(:mod:`fxcrack.continuum.strain_cells`):

    E_ij = (x,i . x,j - X,i . X,j)/2

Those in the plane are taken at the 2 x 2 x 3 integration points. Transverse shear is sampled on the
middle surface, E_13 at the middles of the edges along 1 and E_23 at those along 2 (Dvorkin and
Bathe 1984), and E_33 at the middles of the four edges across (Betsch and Stein 1995); between these
points they are interpolated. All strains at all points are combinations of 32 samples, of which
many integration points need the same one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fxcrack.base.arrays import Array

_MIDDLE = 0.5
N_NODES = 8


def gradients(points: Array) -> Array:
    """Derivatives of the shape functions at points (n_points, 3), shape (n_points, 3, 8)."""
    corners = np.array([(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)])
    x = np.atleast_2d(points)[:, None]
    value = np.where(corners == 1, x, 1.0 - x)  # (n_points, 8, 3)
    slope = np.where(corners == 1, 1.0, -1.0)
    out = np.empty((len(x), 3, N_NODES))
    for i in range(3):
        others = [k for k in range(3) if k != i]
        out[:, i] = slope[:, i] * value[:, :, others].prod(axis=2)
    return out


def values(points: Array) -> Array:
    """Shape functions at points (n_points, 3), shape (n_points, 8)."""
    corners = np.array([(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)])
    x = np.atleast_2d(points)[:, None]
    return np.asarray(np.where(corners == 1, x, 1.0 - x).prod(axis=2))


class Samples:
    """Sampled strains, each the product of two tangent vectors, of which each is taken once.

    Attributes:
        tangents: Derivatives of the shape functions along the tangent vectors, each of shape (8,).
        pairs: The numbers of the two tangent vectors of each sample.
    """

    def __init__(self) -> None:
        self.tangents: list[Array] = []
        self.pairs: list[tuple[int, int]] = []

    def _tangent(self, slope: Array) -> int:
        for i, known in enumerate(self.tangents):
            if np.abs(known - slope).max() < 1e-12:
                return i
        self.tangents.append(slope)
        return len(self.tangents) - 1

    def number(self, point: Sequence[float], i: int, j: int) -> int:
        """The number of the strain E_ij at a point."""
        g = gradients(np.array(point))[0]
        pair = self._tangent(g[i]), self._tangent(g[j])
        if pair not in self.pairs:
            self.pairs.append(pair)
        return self.pairs.index(pair)

    @property
    def matrices(self) -> Array:
        """Matrices of the samples, shape (n_samples, 8, 8)."""
        first, second = (np.stack([self.tangents[p[k]] for p in self.pairs]) for k in (0, 1))
        product = np.einsum("ki,kj->kij", first, second)
        return np.asarray(0.5 * (product + product.transpose(0, 2, 1)))


def at_points(points: Array) -> tuple[Samples, Array]:
    """Samples and their combinations for the strains at given points.

    Args:
        points: On the unit cube, shape (n_points, 3).

    Returns:
        The samples, and the strains 11, 22, 33, 23, 13, 12 of them, shape (n_points, 6, n_samples).
    """
    samples = Samples()
    rows: list[list[tuple[int, float, int]]] = []
    for x, y, z in np.atleast_2d(points):
        row = [(k, 1.0, samples.number((x, y, z), i, j)) for k, i, j in _IN_PLANE]
        for share, corner in (
            *(((1 - x) * (1 - y), (0, 0)), (x * (1 - y), (1, 0))),
            *(((1 - x) * y, (0, 1)), (x * y, (1, 1))),
        ):
            row.append((2, share, samples.number((*corner, _MIDDLE), 2, 2)))
        for share, at in ((1 - x, 0.0), (x, 1.0)):
            row.append((3, share, samples.number((at, _MIDDLE, _MIDDLE), 1, 2)))
        for share, at in ((1 - y, 0.0), (y, 1.0)):
            row.append((4, share, samples.number((_MIDDLE, at, _MIDDLE), 0, 2)))
        rows.append(row)
    out = np.zeros((len(rows), 6, len(samples.pairs)))
    for p, row in enumerate(rows):
        for k, share, number in row:
            out[p, k, number] += share
    return samples, out


_IN_PLANE = ((0, 0, 0), (1, 1, 1), (5, 0, 1))
"""Position in Voigt order and the two directions of each strain in the plane."""


@dataclass(frozen=True)
class Hexahedron:
    """Reference element.

    Attributes:
        points: Integration points, shape (n_points, 3), on the unit cube.
        weights: Their weights, shape (n_points,).
        samples: The sampled strains.
        interpolation: Covariant strains 11, 22, 33, 23, 13, 12 at the points, of the samples,
            shape (n_points, 6, n_samples).
    """

    points: Array
    weights: Array
    samples: Samples
    interpolation: Array


@lru_cache(maxsize=1)
def hexahedron() -> Hexahedron:
    """The element, integrated at 2 x 2 points in the plane and 3 across."""
    lines = [np.polynomial.legendre.leggauss(n) for n in (2, 2, 3)]
    grid = np.meshgrid(*((x + 1.0) / 2.0 for x, _ in lines), indexing="ij")
    points = np.stack(grid, axis=-1).reshape(-1, 3)
    parts = np.meshgrid(*(w / 2.0 for _, w in lines), indexing="ij")
    weights = np.prod(np.stack(parts, axis=-1), axis=-1).ravel()
    return Hexahedron(points, weights, *at_points(points))


__all__ = ["Hexahedron", "Samples", "at_points", "gradients", "hexahedron", "values"]
