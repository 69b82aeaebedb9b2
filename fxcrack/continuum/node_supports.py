"""Supports of shells, and of other bodies, beside displacements: clamps, symmetry, rotations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import number_or_function, one_of, text
from fxcrack.base.errors import InputError
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.amplitudes import AmplitudeLike, Ramp
from fxcrack.continuum.loads import Field

_RAMP = Ramp()


@dataclass(frozen=True)
class Clamp:
    """Nodes of a named group held in all their unknowns; of shells the director too.

    Args:
        where: Name of a group.
        name: What the history calls it; the group's name by default.
    """

    where: str
    name: str | None = None
    amplitude: AmplitudeLike = _RAMP

    def __post_init__(self) -> None:
        """Check the names."""
        text("Clamp", "where", self.where)
        text(f"Clamp('{self.where}')", "name", self.name, optional=True)

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or self.where


@dataclass(frozen=True)
class Symmetry:
    """A plane of symmetry across a global axis through the nodes of a group.

    The displacement along the axis is zero, and of shells the change of the director along it.

    Args:
        where: Name of a group that lies in the plane.
        axis: "x", "y" or "z", the normal of the plane.
        name: What the history calls it; the group's name by default.
    """

    where: str
    axis: str
    name: str | None = None
    amplitude: AmplitudeLike = _RAMP

    def __post_init__(self) -> None:
        """Check the axis."""
        text("Symmetry", "where", self.where)
        owner = f"Symmetry('{self.where}')"
        text(owner, "name", self.name, optional=True)
        one_of(owner, "axis", self.axis, ("x", "y", "z"))

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or self.where


@dataclass(frozen=True)
class Rotation:
    """Prescribed components of the rotation of a shell on a named group.

    The director changes by w = theta x D, of small rotations theta. Components that are not given
    stay free; turning about the normal has no stiffness, and nothing is prescribed there. Given
    one or two components, the director must lie in coordinate planes that hold their axes; all
    three may be given everywhere.

    Args:
        where: Name of a group of nodes or edges.
        x: Rotation about x in radians: a number or a function of position; ``None`` free.
        y: About y.
        z: About z.
        amplitude: Factor in time; components that are 0 stay 0.
        name: What the history calls it; the group's name by default.
    """

    where: str
    x: Field | None = None
    y: Field | None = None
    z: Field | None = None
    amplitude: AmplitudeLike = _RAMP
    name: str | None = None

    def __post_init__(self) -> None:
        """Refuse a support that supports nothing."""
        text("Rotation", "where", self.where)
        owner = f"Rotation('{self.where}')"
        text(owner, "name", self.name, optional=True)
        for axis in ("x", "y", "z"):
            if getattr(self, axis) is not None:
                number_or_function(owner, axis, getattr(self, axis))
        if self.x is None and self.y is None and self.z is None:
            raise InputError(
                f"Rotation('{self.where}') prescribes nothing; give x, y or z (0.0 holds it)"
            )

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or self.where


_ALIGNED = 1e-6
"""Component of a unit director below which it lies in a coordinate plane."""


def rotation_values(
    support: Rotation, directors: Array, x: Array
) -> list[tuple[str, Array, Array]]:
    """Prescribed components of w at some nodes.

    Args:
        support: The support.
        directors: Directors of the nodes, shape (n, 3).
        x: Positions of the nodes, shape (n, 3).

    Returns:
        Name of each column, component of w per node (-1 where nothing is prescribed) and its
        value, both of shape (n,).

    Raises:
        InputError: A director is oblique to the axes, or a value has the wrong shape.
    """
    n = len(x)
    given = {}
    for axis, field in zip("xyz", (support.x, support.y, support.z), strict=True):
        if field is not None:
            if callable(field):
                value = numbers_at(f"Rotation('{support.title}')", axis, field, x)
            else:
                value = np.full(n, float(field))
            given["xyz".index(axis)] = value
    d = np.where(np.abs(directors) < _ALIGNED, 0.0, directors)
    if len(given) == 3:
        w = np.cross(np.stack([given[i] for i in range(3)], axis=1), directors)
        return [(f"w{'xyz'[c]}", np.full(n, c), w[:, c]) for c in range(3)]
    out = []
    for i, theta in given.items():
        j, k = (i + 1) % 3, (i + 2) % 3
        # theta_i turns D_j towards k and D_k towards -j
        component = np.where(d[:, j] != 0.0, k, np.where(d[:, k] != 0.0, j, -1))
        value = np.where(d[:, j] != 0.0, theta * d[:, j], -theta * d[:, k])
        both = (d[:, j] != 0.0) & (d[:, k] != 0.0)
        # the component also has a part of another rotation if the director has one along axis i
        oblique = both | ((d[:, i] != 0.0) & (component >= 0))
        if np.any(oblique):
            at = ", ".join(f"{v:.4g}" for v in x[np.argmax(oblique)])
            raise InputError(
                f"Rotation('{support.title}'): the director at ({at}) is oblique to the axes, so "
                f"rotation {'xyz'[i]} alone is no component of its change; give x, y and z, or "
                "use Symmetry or Clamp"
            )
        out.append((f"r{'xyz'[i]}", component, value))
    return out


Support = Clamp | Symmetry | Rotation

__all__ = ["Clamp", "Rotation", "Support", "Symmetry", "rotation_values"]
