"""On which side of an interface the cells around its front lie.

A cell with a facet on the slave face is above, one with a facet on the master below, and every
other belongs with the nearest of these, going from cell to cell through facets. Where the interface
is curved the tangent plane at a tip would tell some of them wrong: their part of the crack-tip
field would be that of the other face.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.front_cells import FrontCells


def cells_above(cells: FrontCells, slaves: Ints, masters: Ints) -> tuple[Bools, Bools]:
    """Sides of some cells.

    Args:
        cells: The cells.
        slaves: Global displacement nodes of the slave face, shape (n,).
        masters: Of the master, shape (m,); none on a plane of symmetry.

    Returns:
        Whether each cell is on the side of the slave, to which the normal points, and whether its
        side is known; it is not where no way leads to the interface. Shape (n_cells,) each.
    """
    corners = cells.nodes[:, cells.facet_corners]
    side = np.zeros(len(corners), dtype=np.int64)
    for nodes, sign in ((slaves, 1), (masters, -1)):
        on_face = (np.isin(corners, nodes).all(axis=2) & cells.outer).any(axis=1)
        side[on_face & (side == 0)] = sign
    n, k, width = corners.shape
    rows = np.sort(corners, axis=2).reshape(n * k, width)
    _, facet = np.unique(rows, axis=0, return_inverse=True)
    owner = np.repeat(np.arange(n), k)
    ones = np.ones(n * k, dtype=np.int64)
    holds = coo_array((ones, (owner, facet.ravel()))).tocsr()
    while True:
        votes = holds @ (holds.T @ side)
        fresh = (side == 0) & (votes != 0)
        if not fresh.any():
            return side > 0, side != 0
        side[fresh] = np.sign(votes[fresh])


def curved_faces(
    x: Array, corners: Array, normal: Array, origin: Array, *, own: Bools, opened: Bools
) -> Bools:
    """Facets of the open crack that lie off the tangent plane of a tip, shape (n_cells, n_facets).

    Args:
        x: Positions of the displacement nodes of the cells, shape (n_cells, n_nodes, 3) [length].
        corners: Nodes of each facet within a cell, shape (n_facets, k).
        normal: Of the interface at the tip, shape (3,).
        origin: The tip, shape (3,) [length].
        own: Whether each facet is one of the interface, shape (n_cells, n_facets).
        opened: Whether it has a node that is not bonded, likewise.
    """
    height = np.abs((x - origin) @ normal)[:, corners].max(axis=2)
    size = np.ptp(x[:, corners], axis=2).max(axis=2)
    return np.asarray(own & opened & (height > _FLAT * size))


_FLAT = 1e-6
"""Height over the tangent plane, by the size of a facet, below which a face is flat."""
