"""Sections of shells: what lies above and below the reference surface.

    (N, M) = [A B; B D] (e0, e1),    A, B, D = int (1, z, z^2) C dz

with the 6 x 6 stiffness C of each ply in the axes of the section: 1 along ``axis`` in the tangent
plane, 3 along the normal, 2 = 3 x 1. Voigt order 11, 22, 33, 23, 13, 12, engineering shears.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import finite, keep, keep_floats, list_of, numbers, positive, shown
from fxcrack.base.errors import InputError
from fxcrack.continuum.laminate import Laminate
from fxcrack.continuum.ply import Ply


@dataclass(frozen=True)
class Section:
    """Material of a shell over its thickness.

    Args:
        material: A laminate, or one elastic material whose axes x, y, z are those of the section.
        thickness: Of the shell, length; that of the plies of a laminate.
        axis: Direction of axis 1, projected on the tangent plane.
        offset: Coordinate z of the middle of the thickness from the reference surface (the mesh)
            along the normal, length: thickness/2 puts the mesh on the bottom.
        up: Direction in which the normal is to point, for instance (0, 0, 1); by default to the
            side from which the nodes of the group's first cell are seen counter-clockwise, and the
            same side of all cells connected with it.
        shear_factor: Of transverse shear, a number, or two of 13 and 23; by default from
            equilibrium (:meth:`fxcrack.Laminate.shear_factors`), 5/6 for one layer.

    Attributes:
        laminate: The plies, in the axes of the section.

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
        if isinstance(self.material, Laminate):
            if self.thickness is not None:
                raise InputError(
                    "Section: the plies of a laminate have the thickness; leave it out"
                )
        elif isinstance(self.material, type) or not hasattr(self.material, "stiffness"):
            raise InputError(
                f"Section: {shown(self.material)} is not a material; give one, e.g. "
                "Isotropic(E=70e3, nu=0.3), or a Laminate"
            )
        elif self.thickness is None:
            raise InputError("Section: a section of one material needs thickness=...")
        else:
            positive("Section", thickness=self.thickness)
        _ = self.laminate  # refuses materials that are not linear elastic
        finite("Section", offset=self.offset)
        for name in ("axis", "up"):
            if name == "axis" or self.up is not None:
                direction = numbers("Section", name, getattr(self, name), 3, words="a direction")
                if not any(direction):
                    raise InputError(f"Section: {name} = {direction} has no direction")
                keep(self, **{name: direction})
        keep_floats(self, "thickness", "offset")
        given = self.shear_factor
        if given is None:
            return
        if list_of(given) is None:
            positive("Section", shear_factor=given)
            keep_floats(self, "shear_factor")
        else:
            factors = numbers("Section", "shear_factor", given, 2, words="those of 13 and 23")
            for i, value in enumerate(factors):
                positive("Section", **{f"shear_factor[{i}]": value})
            keep(self, shear_factor=factors)

    @property
    def laminate(self) -> Laminate:
        """The plies, in the axes of the section."""
        if isinstance(self.material, Laminate):
            return self.material
        assert self.thickness is not None
        return Laminate([Ply(self.thickness, 0.0, self.material)])

    @property
    def height(self) -> float:
        """Thickness of all plies together, length."""
        return self.laminate.thickness

    def face(self, side: str) -> float:
        """Coordinate z of the face "top" or "bottom", length."""
        return self.offset + (0.5 if side == "top" else -0.5) * self.height

    def shear_factors(self) -> tuple[float, float]:
        """Factors of the transverse shears 13 and 23."""
        if self.shear_factor is None:
            return self.laminate.shear_factors()
        k13, k23 = np.broadcast_to(np.asarray(self.shear_factor, dtype=float), 2).tolist()
        return k13, k23

    def stiffness(self) -> Array:
        """[A B; B D] with the shear factors, shape (12, 12); force/length and what follows."""
        factor = np.ones(6)
        factor[3], factor[4] = np.sqrt(self.shear_factors()[::-1])
        a, b, d = self.laminate.moments(2, self.offset) * np.outer(factor, factor)
        return np.block([[a, b], [b, d]])

    def mass(self, density: float | None = None) -> Array | None:
        """Moments of the density, int rho (1, z, z^2) dz.

        Args:
            density: Of all plies, mass/volume; their own by default.

        Returns:
            Shape (3,), mass/length^2 and what follows; ``None`` where a density is missing.
        """
        densities = [
            density if density is not None else getattr(p.material, "density", None)
            for p in self.laminate.plies
        ]
        if any(d is None for d in densities):
            return None
        rho = np.array(densities, dtype=float)
        return np.array([float(rho @ w) for w in self._weights()])

    def thermal_expansion(self) -> Array:
        """Mean thermal strain per degree of the plies as one body, shape (6,), 1/temperature."""
        return self.laminate.thermal_expansion()

    def thermal_strains(self) -> list[Array]:
        """Thermal strain per degree of each ply in the axes of the section, each of shape (6,).

        The strain across a shell is linear over its thickness and cannot jump between plies, which
        do not press on each other. So across a ply it is the strain at which its own thermal
        stress vanishes, plus what the expansions across exceed that by in the mean of all plies;
        in a section of one material it is the expansion of the material.
        """
        plies = self.laminate.plies
        stiffness = [p.stiffness() for p in plies]
        strains = [p.thermal_expansion().copy() for p in plies]
        excess = [c[2] @ e / c[2, 2] for c, e in zip(stiffness, strains, strict=True)]
        mean = float(np.dot(excess, [p.thickness for p in plies])) / self.height
        for e, own in zip(strains, excess, strict=True):
            e[2] += mean - own
        return strains

    def thermal_squares(self) -> Array:
        """Moments int (1, z, z^2) e . C e dz of the thermal strains e, shape (3,)."""
        e = self.thermal_strains()
        square = [s @ p.stiffness() @ s for s, p in zip(e, self.laminate.plies, strict=True)]
        return np.array([float(np.dot(square, w)) for w in self._weights()])

    def _weights(self) -> list[Array]:
        """Integrals of 1, z and z^2 over each ply, each of shape (n_plies,)."""
        z = self.laminate.interfaces(self.offset)
        return [np.diff(z**n) / n for n in (1, 2, 3)]

    def thermal_forces(self) -> Array:
        """Thermal stress resultants (N, M) of a temperature rise of 1 and of z, shape (2, 12)."""
        e = self.thermal_strains()
        stress = [p.stiffness() @ s for s, p in zip(e, self.laminate.plies, strict=True)]
        first, second, third = (w @ np.array(stress) for w in self._weights())
        return np.stack([np.append(first, second), np.append(second, third)])


__all__ = ["Section"]
