"""Kinematic models: which strains a body has, and what an element of area stands for.

Each model turns a displacement into a Voigt strain vector (engineering shears), reduces the
6 x 6 stiffness to it, recovers the stresses out of its plane with the others, and names the weight
of the volume and surface integrals: thickness in plane models, 2 pi r for a full ring, 1 in three
dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import ufl

from fxcrack.errors import InputError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Plane:
    thickness: float = 1.0
    gdim: ClassVar[int] = 2
    labels: ClassVar[tuple[str, ...]] = ("xx", "yy", "xy")
    stress_labels: ClassVar[tuple[str, ...]] = ("xx", "yy", "zz", "xy")

    def __post_init__(self) -> None:
        number = isinstance(self.thickness, int | float | np.number)
        if not (number and 0.0 < self.thickness < np.inf):
            raise InputError(
                f"{type(self).__name__}: thickness = {self.thickness!r} is not positive and finite"
            )

    def strain(self, u: Any, x: Any) -> Any:
        """Voigt strain (xx, yy, xy) of a UFL displacement."""
        return ufl.as_vector([u[0].dx(0), u[1].dx(1), u[0].dx(1) + u[1].dx(0)])

    def weight(self, x: Any) -> Any:
        """Factor of the area element: the thickness, length."""
        return self.thickness

    def breadth(self, x: Array) -> Array:
        """Out-of-plane extent of the interface at points x, shape (n, 3) to (n,), length."""
        return np.full(len(x), self.thickness)


@dataclass(frozen=True)
class PlaneStrain(_Plane):
    """Plane strain of a slice of the given thickness (length)."""

    def reduce(self, c: Array) -> Array:
        """Stiffness of (xx, yy, xy), shape (3, 3)."""
        keep = [0, 1, 5]
        return c[np.ix_(keep, keep)]

    def recover(self, c: Array) -> Array:
        """Stress (xx, yy, zz, xy) per unit strain, shape (4, 3); zz keeps the slice flat."""
        return c[np.ix_([0, 1, 2, 5], [0, 1, 5])]


@dataclass(frozen=True)
class PlaneStress(_Plane):
    """Plane stress of a sheet of the given thickness (length)."""

    def reduce(self, c: Array) -> Array:
        """Stiffness of (xx, yy, xy) with the three out-of-plane stresses zero, shape (3, 3)."""
        keep, drop = [0, 1, 5], [2, 3, 4]
        inner = np.linalg.solve(c[np.ix_(drop, drop)], c[np.ix_(drop, keep)])
        return np.asarray(c[np.ix_(keep, keep)] - c[np.ix_(keep, drop)] @ inner)

    def recover(self, c: Array) -> Array:
        """Stress (xx, yy, zz, xy) per unit strain, shape (4, 3); zz is zero."""
        return np.insert(self.reduce(c), 2, 0.0, axis=0)


@dataclass(frozen=True)
class Axisymmetric:
    """Axisymmetric body, x = radius and y = axis; forces are those of the full ring.

    Material axes 1, 2, 3 are radius, axis, hoop.
    """

    gdim: ClassVar[int] = 2
    labels: ClassVar[tuple[str, ...]] = ("rr", "zz", "tt", "rz")
    stress_labels: ClassVar[tuple[str, ...]] = labels

    def strain(self, u: Any, x: Any) -> Any:
        """Voigt strain (rr, zz, hoop, rz) of a UFL displacement."""
        return ufl.as_vector([u[0].dx(0), u[1].dx(1), u[0] / x[0], u[0].dx(1) + u[1].dx(0)])

    def reduce(self, c: Array) -> Array:
        """Stiffness of (rr, zz, hoop, rz), shape (4, 4)."""
        keep = [0, 1, 2, 5]
        return c[np.ix_(keep, keep)]

    def recover(self, c: Array) -> Array:
        """Stress (rr, zz, hoop, rz) per unit strain, shape (4, 4)."""
        return self.reduce(c)

    def weight(self, x: Any) -> Any:
        """Factor of the area element: 2 pi r, length."""
        return 2.0 * np.pi * x[0]

    def breadth(self, x: Array) -> Array:
        """Circumference 2 pi r at points x, shape (n, 3) to (n,), length."""
        return np.asarray(2.0 * np.pi * x[:, 0])


@dataclass(frozen=True)
class Solid:
    """Three-dimensional body."""

    gdim: ClassVar[int] = 3
    labels: ClassVar[tuple[str, ...]] = ("xx", "yy", "zz", "yz", "xz", "xy")
    stress_labels: ClassVar[tuple[str, ...]] = labels

    def strain(self, u: Any, x: Any) -> Any:
        """Voigt strain (xx, yy, zz, yz, xz, xy) of a UFL displacement."""
        return ufl.as_vector(
            [
                u[0].dx(0),
                u[1].dx(1),
                u[2].dx(2),
                u[1].dx(2) + u[2].dx(1),
                u[0].dx(2) + u[2].dx(0),
                u[0].dx(1) + u[1].dx(0),
            ]
        )

    def reduce(self, c: Array) -> Array:
        """The whole stiffness, shape (6, 6)."""
        return c

    def recover(self, c: Array) -> Array:
        """Stress per unit strain: the stiffness, shape (6, 6)."""
        return c

    def weight(self, x: Any) -> Any:
        """One: the volume element needs no factor."""
        return 1.0

    def breadth(self, x: Array) -> Array:
        """One: the interface of a solid has its own width, shape (n,)."""
        return np.ones(len(x))


Model = PlaneStrain | PlaneStress | Axisymmetric | Solid
