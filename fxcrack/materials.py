"""Elastic materials as 6 x 6 stiffness matrices in global axes.

Voigt order 11, 22, 33, 23, 13, 12 with engineering shears. A material knows nothing of meshes;
the kinematic model (:mod:`fxcrack.models`) picks the rows it needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fxcrack.errors import InputError

Array = npt.NDArray[np.float64]


class Material(Protocol):
    """What the continuum needs of a material."""

    def stiffness(self) -> Array:
        """Stiffness in global axes, shape (6, 6), force/length^2."""


@dataclass(frozen=True)
class Isotropic:
    """Isotropic linear elasticity.

    Args:
        E: Young's modulus, force/length^2.
        nu: Poisson's ratio, -1 < nu < 0.5.
        expansion: Thermal strain per degree, 1/temperature.
        density: Mass per volume; ``None`` where inertia plays no part.
    """

    E: float
    nu: float
    expansion: float = 0.0
    density: float | None = None

    def __post_init__(self) -> None:
        """Check the constants."""
        name = type(self).__name__
        _check_numbers(name, E=self.E, nu=self.nu)
        if not (np.isfinite(self.E) and self.E > 0.0):
            raise InputError(f"{name}: E = {self.E} must be positive")
        if not -1.0 < self.nu < 0.5:
            raise InputError(f"{name}: nu = {self.nu} must lie between -1 and 0.5 (exclusive)")
        _check_common(name, self.expansion, self.density)

    def stiffness(self) -> Array:
        """Stiffness, shape (6, 6)."""
        shear = self.E / (2.0 * (1.0 + self.nu))
        lame = self.E * self.nu / ((1.0 + self.nu) * (1.0 - 2.0 * self.nu))
        c = np.zeros((6, 6))
        c[:3, :3] = lame
        c[np.arange(3), np.arange(3)] += 2.0 * shear
        c[np.arange(3, 6), np.arange(3, 6)] = shear
        return c

    def thermal_expansion(self) -> Array:
        """Thermal strain per degree, shape (6,), 1/temperature."""
        return self.expansion * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class Orthotropic:
    """Orthotropic linear elasticity in a material frame.

    Args:
        E: Young's moduli (E1, E2, E3), force/length^2.
        nu: Poisson's ratios (nu12, nu13, nu23); nu_ij/E_i = nu_ji/E_j.
        G: Shear moduli (G12, G13, G23), force/length^2.
        frame: Two global direction vectors, of axis 1 and of one in the plane of axes 1 and 2;
            the default puts axes 1, 2, 3 along x, y, z.
        expansion: Thermal strains per degree along axes 1, 2, 3, 1/temperature.
        density: Mass per volume; ``None`` where inertia plays no part.
    """

    E: tuple[float, float, float]
    nu: tuple[float, float, float]
    G: tuple[float, float, float]
    frame: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (1.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
    )
    expansion: tuple[float, float, float] = (0.0, 0.0, 0.0)
    density: float | None = None

    def __post_init__(self) -> None:
        """Check the constants and the frame."""
        parts = {"E": "E1, E2, E3", "nu": "nu12, nu13, nu23", "G": "G12, G13, G23"}
        for name, needed in parts.items():
            value = getattr(self, name)
            if np.shape(value) != (3,) or np.asarray(value).dtype.kind not in "fiu":
                raise InputError(
                    f"Orthotropic: {name} = {value!r} must be three numbers, ({needed}); a ply "
                    "that is alike across its fibres has E3 = E2, nu13 = nu12, G13 = G12"
                )
        if min(*self.E, *self.G) <= 0.0 or not np.all(np.isfinite([*self.E, *self.G, *self.nu])):
            raise InputError(f"Orthotropic: E = {self.E} and G = {self.G} must be positive numbers")
        if np.linalg.eigvalsh(self._compliance()).min() <= 0.0:
            raise InputError(
                f"Orthotropic: nu = {self.nu} with E = {self.E} is no stable material "
                "(compliance not positive definite); check the order nu12, nu13, nu23"
            )
        axis1, in_plane = (np.asarray(v, dtype=float) for v in self.frame)
        if not np.all(np.isfinite(self.frame)):
            raise InputError(f"Orthotropic: frame = {self.frame} must hold finite numbers")
        if np.linalg.norm(np.cross(axis1, in_plane)) < 1e-8 * np.linalg.norm(axis1) * max(
            float(np.linalg.norm(in_plane)), 1e-300
        ):
            raise InputError(f"Orthotropic: the two vectors of frame = {self.frame} are parallel")
        if np.shape(self.expansion) != (3,):
            raise InputError(
                f"Orthotropic: expansion = {self.expansion} must be three numbers, one per axis"
            )
        _check_common("Orthotropic", self.expansion, self.density)

    def _compliance(self) -> Array:
        e1, e2, e3 = self.E
        nu12, nu13, nu23 = self.nu
        g12, g13, g23 = self.G
        s = np.zeros((6, 6))
        s[:3, :3] = [
            [1.0 / e1, -nu12 / e1, -nu13 / e1],
            [-nu12 / e1, 1.0 / e2, -nu23 / e2],
            [-nu13 / e1, -nu23 / e2, 1.0 / e3],
        ]
        s[3, 3], s[4, 4], s[5, 5] = 1.0 / g23, 1.0 / g13, 1.0 / g12
        return s

    def stiffness(self) -> Array:
        """Stiffness in global axes, shape (6, 6)."""
        to_local = self._to_local()
        return np.asarray(to_local.T @ np.linalg.inv(self._compliance()) @ to_local)

    def thermal_expansion(self) -> Array:
        """Thermal strain per degree in global axes, shape (6,), 1/temperature."""
        local = np.array([*self.expansion, 0.0, 0.0, 0.0])
        return np.asarray(np.linalg.solve(self._to_local(), local))

    def _to_local(self) -> Array:
        """Takes a strain from global axes to the frame, shape (6, 6)."""
        e1, in_plane = (np.asarray(v, dtype=float) for v in self.frame)
        e1 = e1 / np.linalg.norm(e1)
        e3 = np.cross(e1, in_plane)
        e3 /= np.linalg.norm(e3)
        return strain_rotation(np.vstack([e1, np.cross(e3, e1), e3]))


def _check_numbers(name: str, **values: object) -> None:
    for field, value in values.items():
        if isinstance(value, str) or not np.isscalar(value):
            raise InputError(f"{name}: {field} = {value!r} is not a number; give one")


def _check_common(name: str, expansion: float | tuple[float, ...], density: float | None) -> None:
    if not np.all(np.isfinite(expansion)):
        raise InputError(f"{name}: expansion = {expansion} must be finite")
    if density is not None and not (np.isfinite(density) and density > 0.0):
        raise InputError(f"{name}: density = {density} must be positive; leave it out for none")


def strain_rotation(axes: Array) -> Array:
    """Matrix that takes a Voigt strain from global to local axes.

    Args:
        axes: Rows are the local unit vectors in global components, shape (3, 3).

    Returns:
        Shape (6, 6); engineering shears on both sides.
    """
    pairs = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
    out = np.zeros((6, 6))
    for j, (k, m) in enumerate(pairs):
        unit = np.zeros((3, 3))
        unit[k, m] = unit[m, k] = 1.0 if k == m else 0.5
        local = axes @ unit @ axes.T
        out[:, j] = [local[a, b] * (1.0 if a == b else 2.0) for a, b in pairs]
    return out
