"""One ply of a laminate: its thickness, angle and material, seen in the axes of the laminate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import finite, keep_floats, positive
from fxcrack.base.errors import InputError
from fxcrack.continuum.materials import Material, strain_rotation
from fxcrack.continuum.temperature import expansion_of


@dataclass(frozen=True)
class Ply:
    """One ply of a laminate.

    Args:
        thickness: Length.
        angle: From axis 1 of the laminate to axis 1 of the ply, towards axis 2; degrees.
        material: Elastic material with axes 1, 2, 3 of the ply along x, y, z; that of the
            laminate by default.

    Raises:
        InputError: The thickness is not positive, the angle no number.
    """

    thickness: float
    angle: float = 0.0
    material: Material | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("thickness", "angle"):
            finite("Ply", **{name: getattr(self, name)})
        positive("Ply", thickness=self.thickness)
        keep_floats(self, "thickness", "angle")

    def stiffness(self) -> Array:
        """Stiffness in the axes of the laminate, shape (6, 6), force/length^2."""
        turn = self._turn()
        return np.asarray(turn.T @ self._own().stiffness() @ turn)

    def thermal_expansion(self) -> Array:
        """Thermal strain per degree in the axes of the laminate, shape (6,), 1/temperature."""
        return np.asarray(np.linalg.solve(self._turn(), expansion_of(self._own())))

    def to_ply(self, strain: Array) -> Array:
        """Strains in the axes of the ply of strains in those of the laminate, shape (..., 6)."""
        return np.asarray(strain @ self._turn().T)

    def stress_to_ply(self, stress: Array) -> Array:
        """Stresses in the axes of the ply of stresses in those of the laminate, shape (..., 6)."""
        return np.asarray(stress @ np.linalg.inv(self._turn()))

    def _own(self) -> Material:
        if self.material is None:
            raise InputError(
                "Ply: it has no material; give material= to the ply or to its laminate"
            )
        return self.material

    def _turn(self) -> Array:
        c, s = np.cos(np.radians(self.angle)), np.sin(np.radians(self.angle))
        return strain_rotation(np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def square_strain(a: Array) -> Array:
    """Square of a strain as a tensor, both in Voigt order with engineering shears, shape (6,)."""
    t = np.array(
        [[a[0], a[5] / 2, a[4] / 2], [a[5] / 2, a[1], a[3] / 2], [a[4] / 2, a[3] / 2, a[2]]]
    )
    s = t @ t
    return np.array([s[0, 0], s[1, 1], s[2, 2], 2 * s[1, 2], 2 * s[0, 2], 2 * s[0, 1]])


__all__ = ["Ply", "square_strain"]
