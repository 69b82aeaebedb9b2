"""When a step ends."""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.errors import InputError
from fxcrack.interface.pairing import Interface


@dataclass(frozen=True)
class Time:
    """Stop at a time, which is reached exactly."""

    time: float

    def __post_init__(self) -> None:
        """Refuse a time that is not after the start."""
        if not self.time > 0.0:
            raise InputError(f"Time({self.time}): the end time must be positive")


@dataclass(frozen=True, eq=False)
class CrackLength:
    """Stop when the crack of an interface is at least this long (mean length in 3-D)."""

    interface: Interface
    length: float


@dataclass(frozen=True)
class Releases:
    """Stop after this many released nodes, over all interfaces."""

    count: int


Until = Time | CrackLength | Releases
