"""Tips of a second-order front that soften together: the rows of one element edge.

On second-order quadrilaterals the front runs through rows of corner and rows of midside nodes. Bond
forces of a row alone say little: consistent forces jump from row to row and are negative at some
corners, above all where the front meets a free edge, so that such a row would never let go. Over an
element edge they make sense (Krueger 2002, element-wise closure for 20-node bricks):

    G_edge = sum_r k_r A_r G_r / sum_r k_r A_r,      r: midside row, corner rows beside it

k_r = 1/2 for a corner row that two such edges share, 1 else; A_r is the area a row opens.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.interface.surface import FacetSurface
from fxcrack.interface.tip import Tips

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_EDGES = ((0, 4, 1), (2, 7, 3), (0, 5, 2), (1, 6, 3))
"""Corner, midside, corner of second-order quadrilaterals in basix order."""


@dataclass(frozen=True)
class FrontUnits:
    """Which tips soften together.

    Attributes:
        leaders: Position of the tip that stands for each unit, shape (n_units,): the midside row,
            or the one row of a unit.
        shares: Part of each tip in the rate of each unit, rows sum to 1, shape (n_units, n_tips).
    """

    leaders: Ints
    shares: Array

    def mean(self, values: Array) -> Array:
        """Values of tips averaged over units, shape (..., n_tips, m) to (..., n_units, m)."""
        return np.asarray(self.shares @ values)

    def at_tips(self, values: Array) -> Array:
        """The largest value of the units a tip is part of, (..., n_units) to (..., n_tips)."""
        spread = np.where(self.shares > 0.0, values[..., None], -np.inf)
        return np.asarray(spread.max(axis=-2, initial=-np.inf))


def edge_midsides(surface: FacetSurface) -> dict[int, tuple[int, int]]:
    """Corners of the element edge of each midside node; empty on other than such faces."""
    if surface.kind != "quadrilateral" or surface.order != 2:
        return {}
    edges = np.concatenate([surface.facets[:, e] for e in _EDGES])
    return {m: (a, b) for a, m, b in edges.tolist()}


def units_of(edges: dict[int, tuple[int, int]], tips: Tips) -> FrontUnits:
    """Units of the present front.

    Args:
        edges: From :func:`edge_midsides`.
        tips: The front.
    """
    n = len(tips)
    at = {node: i for i, node in enumerate(tips.node.tolist())}
    share = np.zeros((n, n))
    for node, i in at.items():
        share[i, i] = 1.0
        for corner in edges.get(node, ()):
            if corner in at:
                share[i, at[corner]] = 1.0
    beside = share.sum(axis=0) - 1.0  # edges a corner row belongs to
    leads = np.array([node in edges for node in at], dtype=bool) | (beside == 0.0)
    share = share[leads] / np.maximum(beside, 1.0) * tips.area
    return FrontUnits(np.flatnonzero(leads), share / share.sum(axis=1, keepdims=True))
