"""When a step ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fxcrack.base.checks import finite, keep, keep_floats, number, shown, whole
from fxcrack.base.errors import InputError
from fxcrack.interface.definition import Interface


@dataclass(frozen=True)
class Time:
    """Stop at a time, which is reached exactly."""

    time: float

    def __post_init__(self) -> None:
        """Refuse a time that is not after the start."""
        if not 0.0 < number("Time", "time", self.time) < math.inf:
            raise InputError(f"Time({self.time}): the end time must be positive and finite")
        keep_floats(self, "time")


@dataclass(frozen=True, eq=False)
class CrackLength:
    """Stop when the crack of an interface is at least this long (mean length in 3-D)."""

    interface: Interface
    length: float

    def __post_init__(self) -> None:
        """Refuse a length no crack can be compared with, and what is no interface."""
        if not isinstance(self.interface, Interface):
            raise InputError(
                f"CrackLength: interface = {shown(self.interface)} must be the Interface itself; "
                "write bond = Interface(...) and CrackLength(bond, length)"
            )
        owner = f"CrackLength({shown(self.length)}): the length must be a finite number"
        finite(owner, length=self.length)
        keep_floats(self, "length")


@dataclass(frozen=True)
class Releases:
    """Stop after this many released nodes, over all interfaces."""

    count: int

    def __post_init__(self) -> None:
        """Refuse a number that is none."""
        words = "at least one node must be released"
        keep(self, count=whole("Releases", "count", self.count, words=words))


Until = Time | CrackLength | Releases


def conditions(owner: str, until: object, *, may_be_empty: bool = False) -> tuple[Until, ...]:
    """One end condition or several as a tuple.

    Args:
        owner: Name of the step.
        until: What its user gave: a condition, or a tuple or list of them.
        may_be_empty: Whether the step can end without any.

    Raises:
        InputError: It holds something that is no end condition, or nothing.
    """
    ends = tuple(until) if isinstance(until, tuple | list) else (until,)
    if not ends and not may_be_empty:
        raise InputError(
            f"{owner}: until = {shown(until)} names no end; give Time(t), "
            "CrackLength(interface, a), Releases(n), or a list of them"
        )
    for end in ends:
        if not isinstance(end, Until):
            raise InputError(
                f"{owner}: until = {shown(end)} is no end condition; give Time(t), "
                "CrackLength(interface, a), Releases(n), or a list of them"
            )
    return ends
