"""How many elements bodies have over their smallest dimension, and what that costs in bending."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Array, Ints
from fxcrack.deck.elements import FACES
from fxcrack.mesh.raw import row_ids

_OPPOSITE = {"quadrilateral": ((0, 2), (1, 3)), "hexahedron": ((0, 1), (2, 4), (3, 5))}
"""Pairs of opposite faces, one pair an axis of the cell."""


@dataclass(frozen=True)
class Thickness:
    """Elements over the smallest dimension where it has the fewest of them.

    Attributes:
        number: How many they are.
        aspect: Length of these elements across that dimension over their height, the smaller one
            in 3-D; median.
    """

    number: int
    aspect: float

    @property
    def excess(self) -> float:
        """How much too stiff rectangular elements of full integration are in bending.

        The bending part of one bilinear element in plane stress is too stiff by the factor
        (1/(1 - nu) + a^2/2)/(1 + nu), a its length over its height (Cook, Malkus, Plesha and Witt,
        Concepts and Applications of Finite Element Analysis, 4th ed., section 3.6). Of n elements
        over the thickness 1/n^2 of the stiffness is of that kind. Here nu = 0.3.
        """
        nu = 0.3
        factor = (1.0 / (1.0 - nu) + 0.5 * self.aspect**2) / (1.0 + nu)
        return float((factor - 1.0) / self.number**2)


def thickness_of(cell: str, points: Array, cells: Ints) -> Thickness | None:
    """Elements over the smallest dimension of a mesh of quadrilaterals or hexahedra.

    From each cell a row of cells goes through opposite faces to the surface of the body, along each
    axis of the cell; the shortest of these rows, by length, is taken as its thickness.

    Args:
        cell: Shape of the cells.
        points: Positions of the nodes, shape (n_nodes, 3), length.
        cells: Their corners, first, in the deck's order, shape (n_cells, at least n_corners).

    Returns:
        The fewest elements of all cells; ``None`` for triangles and tetrahedra, whose faces have no
        opposites, and where all rows are closed rings.
    """
    if cell not in _OPPOSITE:
        return None
    faces, pairs = FACES[cell], np.array(_OPPOSITE[cell])
    n_cells, n_axes = len(cells), len(pairs)
    centres = np.stack([points[cells[:, list(f)]].mean(axis=1) for f in faces], axis=1)
    size = np.linalg.norm(centres[:, pairs[:, 0]] - centres[:, pairs[:, 1]], axis=2)
    rows = np.concatenate([np.sort(cells[:, list(f)], axis=1) for f in faces])
    axis = np.empty(len(faces), dtype=np.int64)
    axis[pairs] = np.arange(n_axes)[:, None]
    links = (axis[:, None] + n_axes * np.arange(n_cells)).ravel()  # of each row: cell and axis
    ids = row_ids(rows)
    order = np.argsort(ids, kind="stable")
    same = ids[order][1:] == ids[order][:-1]
    a, b = links[order[:-1][same]], links[order[1:][same]]
    n = n_cells * n_axes
    graph = sp.coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
    _, chain = connected_components(graph, directed=False)
    members = np.bincount(chain)
    length = np.bincount(chain, size.ravel())
    length[np.bincount(chain[a], minlength=len(members)) >= members] = np.inf  # closed rings
    of_cell = chain.reshape(n_cells, n_axes)
    # lengths that differ by round-off alone are the same, and then the fewer elements count
    lengths = length[of_cell]
    shortest = lengths.min(axis=1, keepdims=True)
    near = np.where(lengths <= 1.001 * shortest, members[of_cell], np.iinfo(np.int64).max)
    across = near.argmin(axis=1)
    at = np.arange(n_cells)
    number = np.where(np.isfinite(shortest[:, 0]), near[at, across], np.iinfo(np.int64).max)
    fewest = int(number.min())
    if fewest == np.iinfo(np.int64).max:
        return None
    height = size[at, across]
    size[at, across] = np.inf
    thin = (number == fewest) & (height > 0.0)  # degenerate cells are refused elsewhere
    if not thin.any():
        return None
    return Thickness(fewest, float(np.median(size.min(axis=1)[thin] / height[thin])))


__all__ = ["Thickness", "thickness_of"]
