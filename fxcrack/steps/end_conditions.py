"""When a step ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fxcrack.base.errors import InputError
from fxcrack.interface.pairing import Interface


@dataclass(frozen=True)
class Time:
    """Stop at a time, which is reached exactly."""

    time: float

    def __post_init__(self) -> None:
        """Refuse a time that is not after the start."""
        if not 0.0 < self.time < math.inf:
            raise InputError(f"Time({self.time}): the end time must be positive and finite")


@dataclass(frozen=True, eq=False)
class CrackLength:
    """Stop when the crack of an interface is at least this long (mean length in 3-D)."""

    interface: Interface
    length: float

    def __post_init__(self) -> None:
        """Refuse a length no crack can be compared with, and what is no interface."""
        if not isinstance(self.interface, Interface):
            raise InputError(
                f"CrackLength: interface = {self.interface!r} must be the Interface itself; write "
                "bond = Interface(...) and CrackLength(bond, length)"
            )
        if not math.isfinite(self.length):
            raise InputError(f"CrackLength({self.length}): the length must be a finite number")


@dataclass(frozen=True)
class Releases:
    """Stop after this many released nodes, over all interfaces."""

    count: int

    def __post_init__(self) -> None:
        """Refuse a number that is none."""
        if not self.count >= 1:
            raise InputError(f"Releases({self.count}): at least one node must be released")


Until = Time | CrackLength | Releases


def conditions(owner: str, until: object) -> tuple[Until, ...]:
    """One end condition or several as a tuple.

    Args:
        owner: Name of the step.
        until: What its user gave: a condition, or a tuple or list of them.

    Raises:
        InputError: It holds something that is no end condition.
    """
    ends = tuple(until) if isinstance(until, tuple | list) else (until,)
    for end in ends:
        if not isinstance(end, Until):
            raise InputError(
                f"{owner}: until = {end!r} is no end condition; give Time(t), "
                "CrackLength(interface, a), Releases(n), or a list of them"
            )
    return ends
