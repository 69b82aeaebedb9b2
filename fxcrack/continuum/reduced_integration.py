"""Partially reduced integration of thin cells (Arnold and Brezzi 1997, Math. Comput. 66, 1-14).

    W = (1 - k) W(2 x 2 points in the plane) + k W(all points),    k = min(1, t^2/A)

with the thickness t and the area A of the cell. Reduced integration removes the locking of thin
second-order cells; the part k of the full integral lifts the deformations that have no
energy at the reduced points to the order of bending, at any thickness. k is one number per
cell: if it varied within a cell, even strains would not be exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fxcrack.base.arrays import Array


@dataclass(frozen=True)
class WeightedMeasure:
    """Several measures of the same cells, each with a weight: a UFL integrand times it is a form.

    Attributes:
        parts: Weight (UFL) and measure of each.
        whole: Measure of the same cells for integrals that need no reduction, such as mass.
    """

    parts: Sequence[tuple[Any, Any]]
    whole: Any

    def __rmul__(self, integrand: Any) -> Any:
        """The sum of the weighted integrals, a UFL form."""
        return sum(weight * integrand * measure for weight, measure in self.parts)


def whole_measure(measure: Any) -> Any:
    """The unreduced measure of the cells of a measure."""
    return measure.whole if isinstance(measure, WeightedMeasure) else measure


def rule(axis: int, in_plane: int, across: int) -> dict[str, Any]:
    """Gauss points of a hexahedron, as the metadata of a UFL measure.

    Args:
        axis: Reference axis across the thickness.
        in_plane: Points along each of the other axes.
        across: Points along that axis.
    """
    lines: list[tuple[Array, Array]] = []
    for i in range(3):
        points, weights = np.polynomial.legendre.leggauss(across if i == axis else in_plane)
        lines.append(((points + 1.0) / 2.0, weights / 2.0))
    points = np.stack(np.meshgrid(*(x for x, _ in lines), indexing="ij"), axis=-1)
    weights = np.prod(np.stack(np.meshgrid(*(w for _, w in lines), indexing="ij"), -1), axis=-1)
    return {
        "quadrature_rule": "custom",
        "quadrature_points": points.reshape(-1, 3),
        "quadrature_weights": weights.ravel(),
    }


__all__ = ["WeightedMeasure", "rule", "whole_measure"]
