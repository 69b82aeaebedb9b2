"""Constraints between displacements: rigid couplings to a reference point, linear equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fxcrack.base.checks import (
    flag,
    is_function,
    keep,
    list_of,
    number,
    number_or_function,
    positive,
    text,
)
from fxcrack.base.errors import InputError
from fxcrack.continuum.loads import AmplitudeLike, Field, Ramp

MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Motions of a reference point: displacements along, and rotations about, the global axes."""
_RAMP = Ramp()


@dataclass(frozen=True)
class Coupling:
    """Nodes of a named group that move with a reference point as one rigid body.

        u_c = u_ref,c + (theta x (x - point))_c      of small rotations theta

    Motions of the reference point that are given are prescribed, each with its reaction (a force or
    a moment about the point) in the history; the others are free. Couplings of one group with the
    same point are one: each prescribes motions of its own, with an amplitude of its own.

    Loads on the nodes act on the coupled set as a whole, by their resultant alone.

    With ``mean=True`` it is the weighted mean motion of the nodes that the reference has, the least
    squares of u - u_ref - theta x (x - point): the nodes may move against each other, motions that
    are not given put nothing on them, and given ones hold only the mean. Forces of the reaction are
    then distributed over the nodes by their weights.

    Args:
        where: Name of a group.
        point: Position of the reference point, one number per dimension of space, length; no node
            need be there.
        x: Displacement of the point along x, length; ``None`` free.
        y: Along y.
        z: Along z.
        rx: Rotation about x in radians; ``None`` free.
        ry: About y.
        rz: About z, the only rotation of plane models.
        components: Displacement components of the nodes that follow; the others stay free.
        rotations: Whether the directors of shells turn with the point.
        mean: Whether the mean motion follows, in place of every node.
        weight: Weights of the nodes in the mean, a positive number or a function of position; any
            factor of all of them cancels.
        amplitude: Factor in time; motions that are 0 stay 0.
        name: What the history calls it; the group's name by default.

    Raises:
        InputError: A number is none, a weight is not positive, or nothing follows.
    """

    where: str
    point: tuple[float, ...]
    x: float | None = None
    y: float | None = None
    z: float | None = None
    rx: float | None = None
    ry: float | None = None
    rz: float | None = None
    components: str = "xyz"
    rotations: bool = True
    mean: bool = False
    weight: Field = 1.0
    amplitude: AmplitudeLike = _RAMP
    name: str | None = None

    def __post_init__(self) -> None:
        """Check names and numbers."""
        text("Coupling", "where", self.where)
        owner = f"Coupling('{self.where}')"
        text(owner, "name", self.name, optional=True)
        given = list_of(self.point)
        if given is None or len(given) not in (2, 3):
            raise InputError(f"{owner}: point must be the 2 or 3 coordinates of the reference")
        keep(self, point=tuple(number(owner, "point", p) for p in given))
        for motion in MOTIONS:
            value = getattr(self, motion)
            if value is not None:
                keep(self, **{motion: number(owner, motion, value)})
        for name in ("rotations", "mean"):
            keep(self, **{name: flag(owner, name, getattr(self, name))})
        number_or_function(owner, "weight", self.weight)
        if not is_function(self.weight):
            positive(owner, weight=self.weight)
        text(owner, "components", self.components)
        if not set(self.components) <= set("xyz"):
            raise InputError(
                f"{owner}: components = '{self.components}' must name some of the axes x, y, z"
            )

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.name or self.where

    @property
    def prescribed(self) -> dict[str, float]:
        """Prescribed motions at amplitude 1, by name."""
        found = {motion: getattr(self, motion) for motion in MOTIONS}
        return {motion: value for motion, value in found.items() if value is not None}


@dataclass(frozen=True)
class Equation:
    """A linear equation between displacement components, sum_i factor_i u_i = value.

    The nodes of the first group follow those of the others. Each further group holds one node, or
    as many as the first one at the same positions relative to each other (opposite faces of a
    periodic cell): these are matched.

    Args:
        terms: Group, axis ("x", "y" or "z") and factor of each term, two or more.
        value: Right-hand side, length; the history has the force conjugate to it, the sum of
            forces in the direction of the equation, where it is not ``None``.
        amplitude: Factor of the value in time.
        name: What messages and the history call it; the first group by default.

    Raises:
        InputError: There are fewer than two terms, or one is not complete.
    """

    terms: tuple[tuple[str, str, float], ...]
    value: float | None = None
    amplitude: AmplitudeLike = _RAMP
    name: str | None = None

    def __post_init__(self) -> None:
        """Check the terms."""
        text("Equation", "name", self.name, optional=True)
        found: list[tuple[str, str, float]] = []
        listed: Sequence[object] = list_of(self.terms) or ()
        for term in listed:
            parts = list_of(term)
            if parts is None or len(parts) != 3 or parts[1] not in ("x", "y", "z"):
                raise InputError(
                    f"Equation: {term!r} is no term; write (group, axis, factor), e.g. ('left', "
                    "'x', 1.0)"
                )
            text("Equation", "group", parts[0])
            found.append((parts[0], parts[1], number("Equation", "factor", parts[2])))
        if len(found) < 2 or found[0][2] == 0.0:
            raise InputError("Equation: give two terms or more; the first factor must not be 0")
        keep(self, terms=tuple(found))
        if self.value is not None:
            keep(self, value=number("Equation", "value", self.value))

    @property
    def title(self) -> str:
        """Name in messages."""
        return self.name or self.terms[0][0]


Constraint = Coupling | Equation

__all__ = ["MOTIONS", "Constraint", "Coupling", "Equation"]
