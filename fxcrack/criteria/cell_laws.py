"""Elastic laws of the bodies at the quadrature points of some cells: energy and nominal stress.

    small strain        W = 1/2 (e - e_th) : C : (e - e_th),  P = s
    Green's strain      the same of E = (F^t F - 1)/2,        P = F S
    neo-Hookean         W = t^3 w(F/t),  w = mu/2 (tr F^t F - 3 - 2 ln J) + lambda/2 (ln J)^2

per undeformed volume, with the thermal stretch t = 1 + alpha (T - T_ref); of Green's strain the
thermal one is a T + (a T)^2/2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.kinematics import PlaneStress
from fxcrack.continuum.materials import NeoHookean, stiffness_of
from fxcrack.continuum.ply import square_strain
from fxcrack.continuum.temperature import expansion_of
from fxcrack.criteria.crack_tip_fields import VOIGT


@dataclass(frozen=True)
class Law:
    """Elasticity of a part, on Voigt strains with all six components.

    Attributes:
        stiffness: Stress per strain, shape (6, 6); zero out of a sheet in plane stress.
        whole: Stiffness from which the crack-tip fields are made: that of the sheet in its plane,
            of the material otherwise, shape (6, 6).
        expansion: Thermal strain per degree, shape (6,).
        neo: Whether the part is neo-Hookean.
    """

    stiffness: Array
    whole: Array
    expansion: Array
    neo: bool


def law_of(continuum: Continuum, i: int) -> Law:
    """The law of a part."""
    material, model = continuum.part_materials[i], continuum.model
    c, alpha = stiffness_of(material), expansion_of(material)
    neo = isinstance(material, NeoHookean)
    if not isinstance(model, PlaneStress):
        return Law(c, c, alpha, neo)
    plane = np.ix_([0, 1, 5], [0, 1, 5])
    sheet = np.zeros((6, 6))
    sheet[plane] = model.reduce(c)
    # what is out of the plane does not enter the fields in it
    whole = c.copy()
    whole[:] = 0.0
    whole[plane] = sheet[plane]
    out = np.ix_([2, 3, 4], [2, 3, 4])
    whole[out] = c[out]
    keep = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    return Law(sheet, whole, alpha * keep, neo)


@dataclass(frozen=True)
class PointEnergies:
    """What a law gives at points.

    Attributes:
        density: Energy per undeformed volume W, shape (n_cells, n_points).
        nominal: First Piola-Kirchhoff stress P = dW/dF, rows of the force, shape (n_cells,
            n_points, 3, 3).
        by_temperature: -dW/dT at constant F, shape (n_cells, n_points).
    """

    density: Array
    nominal: Array
    by_temperature: Array


class CellLaws:
    """Laws of some cells.

    Args:
        laws: Of all parts.
        part: Part of each cell, shape (n_cells,).
        finite: Whether the strain is finite.

    Attributes:
        stiffness: Shape (n_cells, 6, 6).
        expansion: Shape (n_cells, 6).
    """

    def __init__(self, laws: list[Law], part: Ints, *, finite: bool) -> None:
        self.stiffness = np.array([laws[p].stiffness for p in part])
        self.expansion = np.array([laws[p].expansion for p in part])
        self._square = np.array([square_strain(laws[p].expansion) for p in part])
        self._neo: Bools = np.array([laws[p].neo for p in part], dtype=bool)
        self._finite = finite

    def at(self, gradient: Array, rise: Array) -> PointEnergies:
        """Energies and stresses.

        Args:
            gradient: Displacement gradient H, shape (n_cells, n_points, 3, 3).
            rise: Temperature above the reference, shape (n_cells, n_points).
        """
        strain = voigt_strain(gradient)
        thermal = rise[..., None] * self.expansion[:, None]
        slope = np.broadcast_to(self.expansion[:, None], strain.shape)
        if self._finite:
            quadratic = np.swapaxes(gradient, -1, -2) @ gradient
            strain = strain + 0.5 * voigt_strain(quadratic)
            thermal = thermal + 0.5 * rise[..., None] ** 2 * self._square[:, None]
            slope = slope + rise[..., None] * self._square[:, None]
        strain = strain - thermal
        stress = strain @ np.swapaxes(self.stiffness, 1, 2)
        density = 0.5 * np.einsum("cqi,cqi->cq", stress, strain)
        heat = np.einsum("cqi,cqi->cq", stress, slope)
        nominal = tensor_of_stress(stress)
        if self._finite:
            nominal = (np.eye(3) + gradient) @ nominal
        if self._neo.any():
            found = self._neo_hookean(gradient, rise)
            one, two = self._neo[:, None], self._neo[:, None, None, None]
            density = np.where(one, found.density, density)
            heat = np.where(one, found.by_temperature, heat)
            nominal = np.where(two, found.nominal, nominal)
        return PointEnergies(density, nominal, heat)

    def _neo_hookean(self, gradient: Array, rise: Array) -> PointEnergies:
        """The law of neo-Hookean cells, at all of them."""
        mu, lame = self.stiffness[:, 3, 3, None], self.stiffness[:, 0, 1, None]
        alpha = self.expansion[:, :1]
        stretch = 1.0 + alpha * rise
        f = (np.eye(3) + gradient) / stretch[..., None, None]
        # cells of other laws may be anywhere; their values are not taken
        f = np.where(self._neo[:, None, None, None], f, np.eye(3))
        log_j = np.log(np.linalg.det(f))
        back = np.swapaxes(np.linalg.inv(f), -1, -2)
        square = np.einsum("cqij,cqij->cq", f, f)
        density = 0.5 * mu * (square - 3.0 - 2.0 * log_j) + 0.5 * lame * log_j**2
        elastic = mu[..., None, None] * (f - back) + (lame * log_j)[..., None, None] * back
        work = np.einsum("cqij,cqij->cq", elastic, f)
        heat = -alpha * stretch**2 * (3.0 * density - work)
        return PointEnergies(
            stretch**3 * density, stretch[..., None, None] ** 2 * elastic, np.asarray(heat)
        )


def voigt_strain(gradient: Array) -> Array:
    """Voigt strain (engineering shears) of displacement gradients, (..., 3, 3) to (..., 6)."""
    h = gradient
    pairs = [h[..., i, i] for i in range(3)]
    pairs += [h[..., i, j] + h[..., j, i] for i, j in VOIGT[3:]]
    return np.stack(pairs, axis=-1)


def tensor_of_stress(stress: Array) -> Array:
    """Tensor of a Voigt stress, shape (..., 6) to (..., 3, 3)."""
    out = np.empty((*stress.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(VOIGT):
        out[..., i, j] = out[..., j, i] = stress[..., k]
    return out
