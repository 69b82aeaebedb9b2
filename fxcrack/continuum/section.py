"""Sections of shells: what lies above and below the reference surface.

    (N, M) = [A B; B D] (e0, e1),    A, B, D = int (1, z, z^2) C dz

with the 6 x 6 stiffness C of each layer in the axes of the section: 1 along ``axis`` in the tangent
plane, 3 along the normal, 2 = 3 x 1. Voigt order 11, 22, 33, 23, 13, 12, engineering shears.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import positive
from fxcrack.base.errors import InputError


@dataclass(frozen=True)
class Layer:
    """One layer of a section.

    Attributes:
        bottom: Coordinate z of its lower side, length.
        top: Of its upper side, length.
        stiffness: In the axes of the section, shape (6, 6), force/length^2.
        expansion: Thermal strain per degree in these axes, shape (6,), 1/temperature.
        density: Mass per volume, ``None`` where it is not given.
    """

    bottom: float
    top: float
    stiffness: Array
    expansion: Array
    density: float | None


@dataclass(frozen=True)
class Section:
    """Material of a shell over its thickness.

    Args:
        material: An elastic material, whose frame is meant in the axes of the section.
        thickness: Of the shell, length.
        axis: Direction of axis 1, projected on the tangent plane.
        offset: Coordinate z of the middle of the thickness from the reference surface (the mesh)
            along the normal, length: thickness/2 puts the mesh on the bottom.
        up: Direction in which the normal is to point, for instance (0, 0, 1); by default to the
            side from which the nodes of the group's first cell are seen counter-clockwise, and the
            same side of all cells connected with it.
        shear_factor: Of transverse shear, a number, or two of 13 and 23; by default from
            equilibrium: 5/6 for one layer.

    Raises:
        InputError: A number is out of range, or the material is none a section may have.
    """

    material: Any
    thickness: float | None = None
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    offset: float = 0.0
    up: tuple[float, float, float] | None = None
    shear_factor: float | tuple[float, float] | None = None
    form: ClassVar[str] = "shell"

    def __post_init__(self) -> None:
        """Check the arguments."""
        material = self.material
        if isinstance(material, type) or not hasattr(material, "stiffness"):
            raise InputError(
                f"Section: {material!r} is not a material; give one, e.g. Isotropic(E=70e3, nu=0.3)"
            )
        if getattr(material, "form", "elastic") != "elastic" or hasattr(material, "temperatures"):
            raise InputError(
                f"Section: {type(material).__name__} is not possible in shells, which are linear "
                "elastic; give Isotropic or Orthotropic, or model the part with solids"
            )
        if self.thickness is None:
            raise InputError("Section: a section of one material needs thickness=...")
        positive("Section", thickness=self.thickness)
        if not np.isfinite(self.offset):
            raise InputError(f"Section: offset = {self.offset} must be finite")
        for name in ("axis", "up"):
            value = getattr(self, name)
            if value is not None and not (
                np.shape(value) == (3,) and np.all(np.isfinite(value)) and np.any(value)
            ):
                raise InputError(
                    f"Section: {name} = {value!r} must be a direction, three numbers of which "
                    "one is not zero"
                )
        if self.shear_factor is not None and not np.all(np.asarray(self.shear_factor) > 0.0):
            raise InputError(f"Section: shear_factor = {self.shear_factor} must be positive")

    @property
    def height(self) -> float:
        """Thickness of all layers together, length."""
        return float(self.layers[-1].top - self.layers[0].bottom)

    @property
    def bottom(self) -> float:
        """Coordinate z of the bottom face, length."""
        return float(self.layers[0].bottom)

    @property
    def top(self) -> float:
        """Coordinate z of the top face, length."""
        return float(self.layers[-1].top)

    def face(self, side: str) -> float:
        """Coordinate z of the face "top" or "bottom", length."""
        return self.top if side == "top" else self.bottom

    @property
    def layers(self) -> tuple[Layer, ...]:
        """From the bottom up."""
        material = self.material
        assert self.thickness is not None
        expansion = np.zeros(6)
        if hasattr(material, "thermal_expansion"):
            expansion = np.asarray(material.thermal_expansion())
        half = 0.5 * self.thickness
        return (
            Layer(
                self.offset - half,
                self.offset + half,
                np.asarray(material.stiffness()),
                expansion,
                getattr(material, "density", None),
            ),
        )

    def shear_factors(self) -> Array:
        """Factors of the transverse shears 13 and 23, shape (2,).

        From the energy of the shear stress that equilibrium of cylindrical bending asks for,

            s(z) = -int Q (z - z_n) dz,    k = D^2/(int s^2/G dz int G dz)

        with the reduced stiffness Q of each layer along the axis, D and the neutral z_n of the
        strip (Whitney 1973); 5/6 for one layer.
        """
        if self.shear_factor is not None:
            return np.broadcast_to(np.asarray(self.shear_factor, dtype=float), 2).copy()
        return np.array([self._shear_factor(0, 4), self._shear_factor(1, 3)])

    def _shear_factor(self, axis: int, shear: int) -> float:
        c = [la.stiffness for la in self.layers]
        q = np.array([m[axis, axis] - m[axis, 2] ** 2 / m[2, 2] for m in c])
        g = np.array([m[shear, shear] for m in c])
        low = np.array([la.bottom for la in self.layers])
        high = np.array([la.top for la in self.layers])
        neutral = (q * (high**2 - low**2)).sum() / 2.0 / (q * (high - low)).sum()
        low, high = low - neutral, high - neutral
        bending = (q * (high**3 - low**3)).sum() / 3.0
        x, w = np.polynomial.legendre.leggauss(4)
        begin, energy = 0.0, 0.0
        for k in range(len(q)):
            z = 0.5 * (low[k] + high[k]) + 0.5 * (high[k] - low[k]) * x
            stress = begin - 0.5 * q[k] * (z**2 - low[k] ** 2)
            energy += float((stress**2 * w).sum()) * 0.5 * (high[k] - low[k]) / g[k]
            begin -= 0.5 * q[k] * (high[k] ** 2 - low[k] ** 2)
        return float(bending**2 / (energy * (g * (high - low)).sum()))

    def stiffness(self) -> Array:
        """[A B; B D] with the shear factors, shape (12, 12); force/length and what follows."""
        factor = np.ones(6)
        k13, k23 = self.shear_factors()
        factor[3], factor[4] = np.sqrt(k23), np.sqrt(k13)
        square = np.outer(factor, factor)
        out = np.zeros((2, 6, 2, 6))
        for layer in self.layers:
            for i in range(2):
                for j in range(2):
                    n = i + j + 1
                    moment = (layer.top**n - layer.bottom**n) / n
                    out[i, :, j] += moment * square * layer.stiffness
        return out.reshape(12, 12)

    def mass(self) -> Array | None:
        """Moments of the density, int rho (1, z, z^2) dz.

        Shape (3,); ``None`` where a density is missing.
        """
        if any(la.density is None for la in self.layers):
            return None
        return np.array(
            [
                sum((la.density or 0.0) * (la.top**n - la.bottom**n) / n for la in self.layers)
                for n in (1, 2, 3)
            ]
        )

    def thermal_forces(self) -> Array:
        """Thermal stress resultants of a temperature rise of 1 and of z, shape (2, 12).

        N, M = int (1, z) C alpha dT dz for dT = 1, and for dT = z.
        """
        out = np.zeros((2, 2, 6))
        for layer in self.layers:
            stress = layer.stiffness @ layer.expansion
            for power in range(2):
                for i in range(2):
                    n = power + i + 1
                    out[power, i] += (layer.top**n - layer.bottom**n) / n * stress
        return out.reshape(2, 12)


__all__ = ["Layer", "Section"]
