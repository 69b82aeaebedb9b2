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
from fxcrack.criteria.outer_faces import node_positions
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


def free_facets(cells: FrontCells, own: Bools, held: Ints, normal: Array, origin: Array) -> Bools:
    """Free facets that the fields of a tip may load, shape (n_cells, n_facets).

    Those of the interface count where it is open and lies off the tangent plane at the tip, in
    which the fields are free of tractions.

    Args:
        cells: The cells.
        own: Whether each facet is one of the interface, shape (n_cells, n_facets).
        held: Global displacement nodes of both sides that are bonded, shape (n,).
        normal: Of the interface at the tip, shape (3,).
        origin: The tip, shape (3,) [length].
    """
    corners = cells.facet_corners
    x = node_positions(cells)[:, corners]
    height = np.abs((x - origin) @ normal).max(axis=2)
    flat = height < _FLAT * np.ptp(x, axis=2).max(axis=2)
    tied = np.isin(cells.nodes[:, corners], held).all(axis=2)
    return np.asarray(cells.outer & ~(own & (flat | tied)))


_FLAT = 1e-6
"""Height over the tangent plane, by the size of a facet, below which a face is flat."""
