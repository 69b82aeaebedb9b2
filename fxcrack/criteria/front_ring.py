"""The ring of cells around one tip over which energy is integrated when its crack grows.

    G A = int [P : (H q') - W tr q' + s : alpha (grad T . q)] dV
          - int f . (H q) dV - int t . (H q) dS

(Eshelby 1951; Rice 1968; deLorenzi 1982; Shih, Moran and Nakamura 1986), with the displacement
gradient H, the gradient q' of the virtual extension, the first Piola-Kirchhoff stress P (the stress
s for small strain), the energy density W, body forces f, tractions t on faces, and the area A that
the extension opens. On a ring H and q' have a hoop component, u_r/r and q_r/r.

With the fields of a unit intensity factor a (:mod:`fxcrack.criteria.crack_tip_fields`) the part of
it that is bilinear in both gives the factors k by themselves (Yau, Wang and Corten 1980):

    2 A (M k)_a = int [s : (H_a q') + s_a : (H q') - s_a : e tr q' + s_a : alpha (grad T . q)] dV
                  - int f . (H_a q) dV - int t . (H_a q) dS
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import basix
import numpy as np

from fxcrack.base.arrays import Array, Bools
from fxcrack.criteria.cell_laws import voigt_strain
from fxcrack.criteria.crack_tip_fields import TipFields
from fxcrack.interface.front_cells import FrontCells

FIELDS_DEGREE = 6
"""Quadrature degree of the fields of a tip at least: they are no polynomials."""


@dataclass(frozen=True)
class Tables:
    """Reference values of a cell type at quadrature points.

    Attributes:
        points: Reference points, shape (n_points, tdim).
        weights: Shape (n_points,).
        displacement: Shape functions of the displacement, value and derivatives, shape
            (1 + tdim, n_points, n_nodes).
        geometry: Of the geometry, likewise.
        corner: Of the corners, likewise.
    """

    points: Array
    weights: Array
    displacement: Array
    geometry: Array
    corner: Array


@lru_cache(maxsize=8)
def tables(kind: str, order: int, n_geometry: int, degree: int) -> Tables:
    """Reference values of a cell type.

    Args:
        kind: Its name in basix.
        order: Order of the displacement.
        n_geometry: Geometry nodes of a cell.
        degree: Quadrature degree.
    """
    cell = getattr(basix.CellType, kind)
    points, weights = basix.make_quadrature(cell, degree)

    def lagrange(n: int) -> basix.finite_element.FiniteElement:
        family, variant = basix.ElementFamily.P, basix.LagrangeVariant.equispaced
        return basix.create_element(family, cell, n, variant)

    def values(n: int) -> Array:
        return np.asarray(lagrange(n).tabulate(1, points)[..., 0])

    degree_of_geometry = next(n for n in (1, 2) if lagrange(n).dim == n_geometry)
    return Tables(
        np.asarray(points),
        np.asarray(weights),
        values(order),
        values(degree_of_geometry),
        values(1),
    )


class CellGeometry:
    """Cells with their quadrature points, derivatives and weights.

    Args:
        cells: The cells.
        degree: Quadrature degree.
        ring: Whether the cells are sections of rings.
        thickness: Thickness of a plane body, 1 otherwise [length].

    Attributes:
        x: Quadrature points, shape (n_cells, n_points, 3) [length].
        weight: Volumes they stand for, shape (n_cells, n_points) [length^3].
        radius: Distance from the axis of a ring, likewise; 1 otherwise [length].
    """

    def __init__(self, cells: FrontCells, degree: int, *, ring: bool, thickness: float) -> None:
        self.gdim = cells.geometry.shape[2]
        self.ring = ring
        self.tables = t = tables(cells.kind, cells.order, cells.geometry.shape[1], degree)
        jacobian = np.einsum("dqa,cai->cqid", t.geometry[1:], cells.geometry)
        self._inverse = np.linalg.inv(jacobian)
        self.x = np.zeros((len(cells.nodes), len(t.weights), 3))
        self.x[..., : self.gdim] = np.einsum("qa,cai->cqi", t.geometry[0], cells.geometry)
        self.weight = np.abs(np.linalg.det(jacobian)) * t.weights * thickness
        self.radius = np.ones_like(self.weight)
        if ring:
            self.radius = self.x[..., 0]
            self.weight = self.weight * 2.0 * np.pi * self.radius
        self._derivative = self._physical(t.displacement)

    def _physical(self, table: Array) -> Array:
        """Derivatives in space, shape (n_cells, n_points, n_functions, gdim)."""
        return np.asarray(np.einsum("dqa,cqdi->cqai", table[1:], self._inverse))

    def gradient(self, values: Array, *, corners: bool = False) -> Array:
        """Gradient of a vector field with its hoop component.

        Args:
            values: At the displacement nodes of each cell, or at its corners, shape (n_cells,
                n_nodes, gdim).
            corners: Whether at the corners.

        Returns:
            Shape (n_cells, n_points, 3, 3).
        """
        t = self.tables
        table = t.corner if corners else t.displacement
        slope = self._physical(table) if corners else self._derivative
        out = np.zeros((*self.weight.shape, 3, 3))
        g = self.gdim
        # products of small matrices: einsum takes several times as long
        out[..., :g, :g] = np.swapaxes(values, 1, 2)[:, None] @ slope
        if self.ring:
            out[..., 2, 2] = np.einsum("qa,ca->cq", table[0], values[..., 0]) / self.radius
        return out

    def weights_at_nodes(self, weights: Array) -> Array:
        """Weights of the displacements from those of their gradient.

        Args:
            weights: Shape (n, n_cells, n_points, 3, 3).

        Returns:
            Shape (n, n_cells, n_nodes, gdim): the sum over points and components of the weights
            times :meth:`gradient` is the sum of these times the displacements.
        """
        g = self.gdim
        out = (self._derivative @ np.swapaxes(weights[..., :g, :g], -1, -2)).sum(axis=2)
        if self.ring:
            table = self.tables.displacement[0]
            out[..., 0] += (weights[..., 2, 2] / self.radius) @ table
        return np.asarray(out)

    def slope(self, values: Array) -> Array:
        """Gradient of a scalar given at the displacement nodes, shape (..., n_cells, n_points, 3).

        Args:
            values: Shape (..., n_cells, n_nodes).
        """
        found = np.einsum("...ca,cqaj->...cqj", values, self._derivative)
        out = np.zeros((*found.shape[:-1], 3))
        out[..., : self.gdim] = found
        return out

    def at_corners(self, values: Array) -> Array:
        """A vector given at the corners, at the quadrature points.

        Args:
            values: Shape (n_cells, n_corners, gdim).

        Returns:
            Shape (n_cells, n_points, 3).
        """
        out = np.zeros((*self.weight.shape, 3))
        out[..., : self.gdim] = np.einsum("qa,cai->cqi", self.tables.corner[0], values)
        return out


def on_both_sides(
    fields: Callable[[Array, int], Array], x: Array, above: Bools, n_modes: int
) -> Array:
    """Crack-tip fields of unit intensity factors on both sides of an interface.

    Args:
        fields: Of positions, shape (n, 3), and the side, as
            :meth:`~fxcrack.criteria.crack_tip_fields.TipFields.gradients`.
        x: Positions from the tip, shape (n, m, 3) [length].
        above: Whether each row is on the side the normal points to, shape (n,).
        n_modes: Factors that are needed, 2 or 3.

    Returns:
        Shape (n_modes, n, m, ...).
    """
    out: Array | None = None
    for side, rows in enumerate((above, ~above)):
        if not rows.any():
            continue
        found = fields(x[rows].reshape(-1, 3), side)[:n_modes]
        if out is None:
            out = np.zeros((n_modes, *x.shape[:2], *found.shape[2:]))
        out[:, rows] = found.reshape(n_modes, -1, x.shape[1], *found.shape[2:])
    assert out is not None
    return out


@dataclass(frozen=True)
class TipState:
    """Fields of unit intensity factors at the quadrature points of a ring of cells.

    In sections of rings they are those of a straight front: their hoop strain is not that of their
    displacement, and their stress is not in equilibrium. Both is made up for (Nahta and Moran
    1993): by s_tt (d e/d x_k) q_k with e = u_r/r, and by (div s_a) . (H q).

    Attributes:
        gradient: Displacement gradient with u_r/r, shape (n_modes, n_cells, n_points, 3, 3).
        strain: Voigt strain without it, shape (n_modes, n_cells, n_points, 6).
        hoop: d e/d x, shape (n_modes, n_cells, n_points, 3); zero where there are no rings.
    """

    gradient: Array
    strain: Array
    hoop: Array

    @classmethod
    def of(
        cls, fields: TipFields, geometry: CellGeometry, origin: Array, above: Bools, n_modes: int
    ) -> TipState:
        """The fields at the points of some cells.

        Args:
            fields: The crack-tip fields.
            geometry: The cells.
            origin: The tip, shape (3,) [length].
            above: Whether each cell is on the side the normal points to, shape (n_cells,).
            n_modes: Factors that are needed, 2 or 3.
        """
        x = geometry.x - origin
        gradient = on_both_sides(fields.gradients, x, above, n_modes)
        strain = voigt_strain(gradient)
        hoop = np.zeros(gradient.shape[:-1])
        if geometry.ring:
            r = geometry.radius
            e = on_both_sides(fields.displacements, x, above, n_modes)[..., 0] / r
            hoop[..., 0] = (gradient[..., 0, 0] - e) / r
            hoop[..., 1] = gradient[..., 0, 1] / r
            gradient[..., 2, 2] = e
        return cls(gradient, strain, hoop)


def divergence_in_rings(stress: Array, radius: Array) -> Array:
    """Divergence that a stress in equilibrium in the plane has in rings.

    Args:
        stress: Axes (radius, axis, hoop), shape (..., 3, 3) [force/length^2].
        radius: Shape that broadcasts with (...) [length].

    Returns:
        Shape (..., 3) [force/length^3].
    """
    out = np.zeros(stress.shape[:-1])
    out[..., 0] = (stress[..., 0, 0] - stress[..., 2, 2]) / radius
    out[..., 1] = stress[..., 0, 1] / radius
    return out


__all__ = [
    "CellGeometry",
    "TipState",
    "divergence_in_rings",
    "on_both_sides",
]
