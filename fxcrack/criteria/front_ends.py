"""Whether a front ends on planes of symmetry, so that it may be thought to be reflected there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.front_cells import FrontCells

_ALONG = 0.01
"""Components of a unit normal below this are none: faces of curved elements are not quite even."""


def on_planes_of_symmetry(
    ends: list[Ints], cells: FrontCells, interface: Bools, held: Callable[[Ints], Bools]
) -> bool:
    """Whether the outer faces beside all ends of a front are planes of symmetry; collective.

    Supports hold the displacement normal to such a face, or both displacements within it, where the
    loads change their sign in the reflection. A face on which they hold all three is clamped.

    Args:
        ends: Global displacement nodes that lie at each end.
        cells: The cells around the ends, the same on all ranks.
        interface: Facets that belong to the interface, shape (n_cells, n_facets).
        held: Gives which components supports hold at global nodes of shape (n,), shape (n, gdim),
            the same on all ranks; collective.
    """
    corners = cells.nodes[:, cells.facet_corners]
    chosen = cells.outer & ~interface
    facets, x = corners[chosen], cells.corners[:, cells.facet_corners][chosen]
    beside = [np.isin(facets, nodes).any(axis=1) for nodes in ends]
    nodes = np.unique(facets)
    known = held(nodes)
    if not all(rows.any() for rows in beside):
        return False  # inside of a body
    rows = np.flatnonzero(np.any(beside, axis=0))
    at_all = known[np.searchsorted(nodes, facets[rows])].all(axis=1)
    across = np.abs(_normals(x[rows])) > _ALONG
    symmetric = (at_all | ~across).all(axis=1)
    antisymmetric = (at_all | across).all(axis=1) & (across.sum(axis=1) == 1)
    return bool(np.all(symmetric != antisymmetric))


def _normals(x: Array) -> Array:
    """Unit normals of facets with these corners, shape (n, 3)."""
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))
