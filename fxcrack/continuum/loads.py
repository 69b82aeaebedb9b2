"""What acts on a body: supports, tractions, pressures, body forces, point forces, amplitudes.

Every entry is a pattern in space times an amplitude in time; a scene may hold any number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import (
    as_float,
    check_list,
    flag,
    is_function,
    keep,
    list_of,
    number_or_function,
    numbers,
    text,
)
from fxcrack.base.errors import InputError
from fxcrack.continuum.amplitudes import (
    Amplitude,
    AmplitudeLike,
    Integral,
    Ramp,
    SmoothStep,
    constant,
)
from fxcrack.continuum.face import Face

Field = float | Callable[[Array], Array]
"""A number, or a function of positions, shape (3, n), that returns shape (n,)."""

_RAMP = Ramp()


@dataclass(frozen=True)
class Displacement:
    """Prescribed displacement components on a named group, each with its reaction in the history.

    Args:
        where: Name of a group of nodes, edges, facets or cells.
        x: Displacement along x in length units: a number or a function of position; ``None`` free.
        y: Along y.
        z: Along z.
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
        _check_names("Displacement", self.where, self.name)
        if self.x is None and self.y is None and self.z is None:
            raise InputError(
                f"Displacement('{self.where}') prescribes nothing; give x, y or z (0.0 holds it)"
            )
        owner = f"Displacement('{self.where}')"
        for axis in "xyz":
            if getattr(self, axis) is not None:
                number_or_function(owner, axis, getattr(self, axis))

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or self.where

    @classmethod
    def by_velocity(
        cls, where: str, *, amplitude: Amplitude | SmoothStep | Integral | None = None,
        **others: Any,
    ) -> Displacement:  # fmt: skip
        """A support that moves with a velocity, from no displacement at time 0.

        Args:
            where: Name of a group.
            amplitude: Factor on the velocity in time; constant by default.
            **others: x, y, z, here velocities in length/time, and name.
        """
        return cls(where, amplitude=Integral(constant() if amplitude is None else amplitude),
                   **others)  # fmt: skip

    @classmethod
    def by_acceleration(
        cls, where: str, *, amplitude: Amplitude | SmoothStep, **others: Any
    ) -> Displacement:
        """A support that moves with an acceleration, from rest and no displacement at time 0.

        Args:
            where: Name of a group.
            amplitude: Factor on the acceleration in time; its table ends with 0, after which the
                velocity stays.
            **others: x, y, z, here accelerations in length/time^2, and name.
        """
        return cls(where, amplitude=Integral(Integral(amplitude)), **others)


@dataclass(frozen=True)
class Traction:
    """Force per area on a named facet group.

    Of shells: force per area on a face (:class:`fxcrack.Face`), or force per length on a group of
    edges at the border.

    Args:
        where: Name of a facet group, or a face of a shell.
        value: Components, force/length^2, each a number or a function of position.
        amplitude: Factor in time.
        name: What the history calls it.
    """

    where: str | Face
    value: tuple[Field, ...]
    amplitude: AmplitudeLike = _RAMP
    name: str | None = None

    def __post_init__(self) -> None:
        """Check names and components."""
        _keep_components(self)

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or str(self.where)


@dataclass(frozen=True)
class Pressure:
    """Pressure on a named facet group, positive when it pushes into the body.

    Args:
        where: Name of a facet group, or a face of a shell (:class:`fxcrack.Face`); with
            ``follows_crack`` the name of an interface, or of one of its two surfaces.
        value: Force/length^2, a number or a function of (undeformed) position.
        amplitude: Factor in time.
        name: What the history calls it.
        follows: Stay normal to the deformed facets and act on their deformed area, instead of
            keeping direction and size.
        follows_crack: Act on both faces of an interface wherever it is open, also on what the crack
            opens later on, as a fluid does that fills the crack at once. The conjugate displacement
            ``v[..]`` in the history is the volume between the faces times ``value``.
    """

    where: str | Face
    value: Field
    amplitude: AmplitudeLike = _RAMP
    name: str | None = None
    follows: bool = False
    follows_crack: bool = False

    def __post_init__(self) -> None:
        """Check names and value."""
        _check_names(type(self).__name__, self.where, self.name)
        owner = f"load '{self.title}'"
        number_or_function(owner, "value", self.value)
        keep(self, follows=flag(owner, "follows", self.follows))
        keep(self, follows_crack=flag(owner, "follows_crack", self.follows_crack))
        if self.follows and self.follows_crack:
            raise InputError(
                f"{owner}: follows (deformed facets) and follows_crack (facets that open) exclude "
                "each other; give one of them"
            )
        if self.follows_crack and isinstance(self.where, Face):
            raise InputError(f"{owner}: follows_crack is not possible in shells; use solids")

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or str(self.where)


@dataclass(frozen=True)
class BodyForce:
    """Force per volume.

    Args:
        value: Components, force/length^3.
        where: Name of a cell group; ``None`` is the whole mesh.
        amplitude: Factor in time.
        name: What the history calls it.
    """

    value: tuple[Field, ...]
    where: str | None = None
    amplitude: AmplitudeLike = _RAMP
    name: str | None = None

    def __post_init__(self) -> None:
        """Check names and components."""
        text("BodyForce", "where", self.where, optional=True)
        text("BodyForce", "name", self.name, optional=True)
        keep(self, value=_components(f"load '{self.title}'", self.value))

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or (self.where or "body") + "_force"


@dataclass(frozen=True)
class PointForce:
    """A total force, shared by the nodes of a group.

    Args:
        where: Name of a group, usually of one node.
        value: Components, force (the whole thickness or ring), each a number, shared equally, or a
            function of position: the force on a node is its value there over the number of nodes.
        amplitude: Factor in time.
        name: What the history calls it.
    """

    where: str
    value: tuple[Field, ...]
    amplitude: AmplitudeLike = _RAMP
    name: str | None = None

    def __post_init__(self) -> None:
        """Check names and components."""
        _keep_components(self)

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or self.where


def _check_names(owner: str, where: object, name: object) -> None:
    """Check the name of a group, or the face of a shell, and the name in the history."""
    if not isinstance(where, Face):
        text(owner, "where", where)
    text(owner, "name", name, optional=True)


def _keep_components(load: Any, *, functions: bool = True) -> None:
    """Check the names and the components of a load and keep the components as a tuple."""
    _check_names(type(load).__name__, load.where, load.name)
    keep(load, value=_components(f"load '{load.title}'", load.value, functions=functions))


def _components(owner: str, value: Any, *, functions: bool = True) -> Any:
    """Components of a load as a tuple, if each is a number (or a function of position).

    How many there must be is known with the mesh only; what is no list is refused there as well.
    """
    entries = list_of(value)
    if entries is None:
        return value
    for i, entry in enumerate(entries):
        found = as_float(entry)
        if found is not None and not np.isfinite(found):
            raise InputError(f"{owner} is not a finite number: value[{i}] = {entry}; correct it")
        if functions or not is_function(entry):
            number_or_function(owner, f"value[{i}]", entry)
        else:
            raise InputError(
                f"{owner}: value[{i}] is a function, but a total force at one place is a number"
            )
    return tuple(entries)


@dataclass(frozen=True)
class Moment:
    """Moment per length on a named group of edges of a shell.

    It does the work of m . (D x w) and acts on the director as the dead couple m x D.

    Args:
        where: Name of a group of edges at the border.
        value: Components, force, each a number or a function of position.
        amplitude: Factor in time.
        name: What the history calls it.
    """

    where: str
    value: tuple[Field, ...]
    amplitude: AmplitudeLike = _RAMP
    name: str | None = None

    def __post_init__(self) -> None:
        """Check names and components."""
        _keep_components(self)

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or self.where


@dataclass(frozen=True)
class PointMoment:
    """A total moment, shared equally by the nodes of a group of a shell.

    Args:
        where: Name of a group, usually of one node.
        value: Components, force x length.
        amplitude: Factor in time.
        name: What the history calls it.
    """

    where: str
    value: tuple[float, ...]
    amplitude: AmplitudeLike = _RAMP
    name: str | None = None

    def __post_init__(self) -> None:
        """Check names and components."""
        _keep_components(self, functions=False)

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or self.where


Load = Traction | Pressure | BodyForce | PointForce | Moment | PointMoment


@dataclass(frozen=True)
class Monitor:
    """Mean displacement of a named group in one direction, written to the history.

    The value is the product of the displacement with ``direction``, plus those of the monitors in
    ``plus``: directions that are no unit vectors are factors. The load point of a lever of length c
    on a beam of half span L, for instance, moves by c/L of its end and (c + L)/L of its middle.

    Args:
        where: Name of a group.
        direction: Components of the direction; the displacement along it is reported.
        name: Column of the history; group and direction by default.
        plus: Further monitors that are added, for a linear combination of displacements.
    """

    where: str
    direction: tuple[float, ...]
    name: str | None = None
    plus: Sequence[Monitor] = ()

    def __post_init__(self) -> None:
        """Refuse a direction that is none."""
        _check_names("Monitor", self.where, self.name)
        owner = f"Monitor('{self.where}')"
        direction = numbers(owner, "direction", self.direction, words="components of a direction")
        if not any(direction):
            raise InputError(
                f"{owner}: direction = {direction} must hold finite numbers, not all of them zero"
            )
        keep(self, direction=direction)
        keep(self, plus=tuple(check_list(owner, "plus", self.plus, Monitor)))

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or f"u_{self.where}"

    @property
    def terms(self) -> list[Monitor]:
        """This monitor and all that are added to it."""
        return [self, *(term for monitor in self.plus for term in monitor.terms)]


__all__ = [
    "Amplitude",
    "AmplitudeLike",
    "BodyForce",
    "Displacement",
    "Field",
    "Load",
    "Moment",
    "Monitor",
    "PointForce",
    "PointMoment",
    "Pressure",
    "Ramp",
    "Traction",
    "constant",
]
