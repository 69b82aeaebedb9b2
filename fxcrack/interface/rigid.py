"""Rigid surfaces given by a formula: a plane, a cylinder or a sphere that does not move.

As the master of an interface such a surface has no nodes, so that W is empty and the jump of a
slave node is its own displacement,

    u_s = R_s delta_s,    g = n . (X_s - foot),    n = grad phi

with the signed distance phi of a position from the surface, positive on the side of the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import flag, format_point, keep, keep_floats, list_of, numbers, positive
from fxcrack.base.errors import InputError, InterfaceError
from fxcrack.continuum.kinematics import Axisymmetric

_ALIGNED = 1e-9
"""Sine of the angle between two directions that are the same, and part of a length that is zero."""


class RigidSurface(Protocol):
    """A surface that does not move, with bodies on one side of it."""

    @property
    def flat(self) -> bool:
        """Whether it is a plane."""
        ...

    def measure(self, x: Array) -> tuple[Array, Array]:
        """Signed distances and normals.

        Args:
            x: Positions, shape (n, 3) [length].

        Returns:
            Distance from the surface, positive on the side of the body, shape (n,) [length]; unit
            normals there, which point away from the surface to the side of the body, shape (n, 3).
        """
        ...

    def check_model(self, where: str, model: object, gdim: int) -> None:
        """Refuse a surface that is none of the model.

        Args:
            where: Beginning of the message.
            model: Model of the bodies.
            gdim: Dimension, 2 or 3.

        Raises:
            InterfaceError: Bodies in a plane or of revolution cannot meet it.
        """
        ...


def _vector(owner: str, name: str, value: object) -> tuple[float, float, float]:
    """Two or three finite numbers as three."""
    entries = list_of(value)
    if entries is None or len(entries) not in (2, 3):
        numbers(owner, name, value, 3, words="or 2 in a plane")  # says what is wrong
    found = numbers(owner, name, value)
    if len(found) not in (2, 3):
        raise InputError(f"{owner}: {name} has {len(found)} numbers; give 3, or 2 in a plane")
    x, y, z = (*found, 0.0)[:3]
    return x, y, z


def _direction(owner: str, name: str, value: object) -> tuple[float, float, float]:
    """A vector made of unit length."""
    given = np.array(_vector(owner, name, value))
    largest = float(np.abs(given).max())
    if not largest > 0.0:
        raise InputError(f"{owner}: {name} has no direction, all of its components are 0")
    unit = given / largest
    x, y, z = (unit / np.linalg.norm(unit)).tolist()
    return x, y, z


def _in_plane(where: str, surface: object, **vectors: tuple[float, float, float]) -> None:
    """Refuse vectors with a third component in two dimensions."""
    for name, v in vectors.items():
        if abs(v[2]) > _ALIGNED * max(abs(c) for c in v):
            raise InterfaceError(
                f"{where}: {name} of {surface} has a z component, {v[2]:g}, and the bodies lie in "
                "the plane of x and y; give two components, or z = 0"
            )


def _unit(away: Array) -> tuple[Array, Array]:
    """Lengths of vectors and their directions, the first axis where there is none."""
    length = np.linalg.norm(away, axis=1)
    unit = away / np.where(length > 0.0, length, 1.0)[:, None]
    unit[length == 0.0] = np.eye(3)[0]
    return length, unit


@dataclass(frozen=True)
class RigidPlane:
    """A plane that does not move, as the master of an interface.

    In two dimensions a line; in axisymmetry a plane across the axis, a cylinder or a cone.

    Args:
        point: A point of the plane, two or three coordinates, length.
        normal: Direction across the plane that points to the side of the body, of any length.
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def __post_init__(self) -> None:
        """Check the numbers, and make the normal a unit vector."""
        keep(
            self,
            point=_vector("RigidPlane", "point", self.point),
            normal=_direction("RigidPlane", "normal", self.normal),
        )

    def __str__(self) -> str:
        """What messages and tables call it."""
        return f"rigid plane at {format_point(self.point)} across {format_point(self.normal)}"

    @property
    def flat(self) -> bool:
        """It is."""
        return True

    def measure(self, x: Array) -> tuple[Array, Array]:
        """See :meth:`RigidSurface.measure`; shapes (n, 3) to (n,) and (n, 3)."""
        normal = np.array(self.normal)
        return (x - np.array(self.point)) @ normal, np.tile(normal, (len(x), 1))

    def check_model(self, where: str, model: object, gdim: int) -> None:
        """See :meth:`RigidSurface.check_model`.

        Raises:
            InterfaceError: It is oblique to the plane of the bodies.
        """
        if gdim == 2:
            _in_plane(where, self, normal=self.normal)


@dataclass(frozen=True)
class RigidCylinder:
    """A circular cylinder that does not move, as the master of an interface.

    In plane bodies its axis is z; in axisymmetry it is that of revolution, the line x = 0.

    Args:
        point: A point of the axis, two or three coordinates, length.
        axis: Its direction, three components (in axisymmetry also two, (0, 1)), of any length.
        radius: Length.
        inside: Whether the body lies inside (the cylinder is a bore); it lies around it otherwise.
    """

    point: tuple[float, float, float]
    axis: tuple[float, float, float]
    radius: float
    inside: bool = False

    def __post_init__(self) -> None:
        """Check the numbers, and make the axis a unit vector."""
        keep(
            self,
            point=_vector("RigidCylinder", "point", self.point),
            axis=_direction("RigidCylinder", "axis", self.axis),
            inside=flag("RigidCylinder", "inside", self.inside),
        )
        positive("RigidCylinder", radius=self.radius)
        keep_floats(self, "radius")

    def __str__(self) -> str:
        """What messages and tables call it."""
        return (
            f"rigid cylinder of radius {self.radius:g} around {format_point(self.axis)} at "
            f"{format_point(self.point)}"
        )

    @property
    def flat(self) -> bool:
        """It is not."""
        return False

    def measure(self, x: Array) -> tuple[Array, Array]:
        """See :meth:`RigidSurface.measure`; shapes (n, 3) to (n,) and (n, 3)."""
        away, axis = x - np.array(self.point), np.array(self.axis)
        length, unit = _unit(away - (away @ axis)[:, None] * axis)
        side = -1.0 if self.inside else 1.0
        return side * (length - self.radius), side * unit

    def check_model(self, where: str, model: object, gdim: int) -> None:
        """See :meth:`RigidSurface.check_model`.

        Raises:
            InterfaceError: Its axis is not z in a plane, or not that of revolution.
        """
        if gdim == 3:
            return
        along = 1 if isinstance(model, Axisymmetric) else 2
        if abs(self.axis[along]) < 1.0 - _ALIGNED:
            raise InterfaceError(
                f"{where}: the axis of {self} must be "
                f"{'(0, 1, 0), that of revolution' if along == 1 else '(0, 0, 1)'}; a cylinder in "
                "any other direction is none in this model"
            )
        if along == 1 and abs(self.point[0]) > _ALIGNED * self.radius:
            raise InterfaceError(
                f"{where}: the axis of {self} is not that of revolution; give a point with x = 0"
            )


@dataclass(frozen=True)
class RigidSphere:
    """A sphere that does not move, as the master of an interface; in 3-D and in axisymmetry.

    Args:
        point: Its centre, two or three coordinates, length; in axisymmetry on the axis, x = 0.
        radius: Length.
        inside: Whether the body lies inside (a socket); it lies around the sphere otherwise.
    """

    point: tuple[float, float, float]
    radius: float
    inside: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        keep(
            self,
            point=_vector("RigidSphere", "point", self.point),
            inside=flag("RigidSphere", "inside", self.inside),
        )
        positive("RigidSphere", radius=self.radius)
        keep_floats(self, "radius")

    def __str__(self) -> str:
        """What messages and tables call it."""
        return f"rigid sphere of radius {self.radius:g} at {format_point(self.point)}"

    @property
    def flat(self) -> bool:
        """It is not."""
        return False

    def measure(self, x: Array) -> tuple[Array, Array]:
        """See :meth:`RigidSurface.measure`; shapes (n, 3) to (n,) and (n, 3)."""
        length, unit = _unit(x - np.array(self.point))
        side = -1.0 if self.inside else 1.0
        return side * (length - self.radius), side * unit

    def check_model(self, where: str, model: object, gdim: int) -> None:
        """See :meth:`RigidSurface.check_model`.

        Raises:
            InterfaceError: The bodies lie in a plane, or its centre is not on the axis.
        """
        if gdim == 3:
            return
        if not isinstance(model, Axisymmetric):
            raise InterfaceError(
                f"{where}: {self} is none in a plane; give RigidCylinder(point, (0, 0, 1), radius)"
            )
        if max(abs(self.point[0]), abs(self.point[2])) > _ALIGNED * self.radius:
            raise InterfaceError(
                f"{where}: the centre of {self} is not on the axis of revolution; give a point "
                "with x = 0"
            )


RIGID = (RigidPlane, RigidCylinder, RigidSphere)
"""The rigid surfaces there are."""

__all__ = ["RIGID", "RigidCylinder", "RigidPlane", "RigidSphere", "RigidSurface"]
