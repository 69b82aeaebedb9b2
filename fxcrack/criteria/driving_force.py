"""What drives fatigue growth: one number of a cycle, in the unit of an energy release rate.

    "dG"        G_max - G_min
    "G_max"     G_max
    "dK"        (sqrt(G_max) - sqrt(G_min))^2 = dK^2/E', as dK = K_max - K_min
    Walker      G_max (1 - R)^(2 gamma), from dK_eff = K_max (1 - R)^gamma   (Walker 1970)
    Elber       U^2 G_max (1 - R)^2, dK_eff = U dK, U = a + b R              (Elber 1971)

R = sqrt(G_min/G_max); see :mod:`fxcrack.criteria.cycle_rates`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import between, keep_floats, missing_members, not_negative, shown
from fxcrack.base.errors import InputError
from fxcrack.criteria.cycle_rates import CycleRates


class DrivingForce(Protocol):
    """What drives growth."""

    def of(self, cycle: CycleRates) -> Array:
        """Driving force of a cycle at each front node, shape (n,) [force/length]."""
        ...


Drive = DrivingForce | str
"""A driving force, or the name of one: "dG", "G_max" or "dK"."""

DRIVES = ("dG", "G_max", "dK")


@dataclass(frozen=True)
class Walker:
    """Effective range of Walker (1970): dK_eff = K_max (1 - R)^gamma = dK/(1 - R)^(1 - gamma).

    Attributes:
        gamma: Between 0, where K_max alone drives growth, and 1, where dK does.
    """

    gamma: float

    def __post_init__(self) -> None:
        """Check the exponent."""
        between("Walker", "gamma", self.gamma, 0.0, 1.0)
        keep_floats(self, "gamma")

    def of(self, cycle: CycleRates) -> Array:
        """dK_eff^2/E', shape (n,) [force/length]."""
        return np.asarray(cycle.G_max * (1.0 - cycle.R) ** (2.0 * self.gamma))


@dataclass(frozen=True)
class Elber:
    """Effective range of a crack that closes: dK_eff = (a + b R) dK (Elber 1971).

    Attributes:
        a: Open part of the range at R = 0; Elber found 0.5 for an aluminium alloy.
        b: How it rises with R; Elber found 0.4. The open part is at most 1.
    """

    a: float
    b: float

    def __post_init__(self) -> None:
        """Check the constants."""
        between("Elber", "a", self.a, 0.0, 1.0)
        not_negative("Elber", b=self.b)
        keep_floats(self, "a", "b")

    def of(self, cycle: CycleRates) -> Array:
        """dK_eff^2/E', shape (n,) [force/length]."""
        open_part = np.minimum(self.a + self.b * cycle.R, 1.0)
        return np.asarray(cycle.G_max * (open_part * (1.0 - cycle.R)) ** 2)


def check_drive(owner: str, drive: Drive) -> None:
    """Check what a user gave as driving force.

    Raises:
        InputError: It is neither the name of one nor one.
    """
    if isinstance(drive, str) and drive in DRIVES:
        return
    if isinstance(drive, str) or missing_members(drive, DrivingForce):
        raise InputError(
            f"{owner}: drive = {shown(drive)} is no driving force; choose 'dG', 'G_max' or 'dK', "
            "or give Walker(gamma) or Elber(a, b)"
        )


def driving_force(drive: Drive, cycle: CycleRates) -> Array:
    """Driving force of a cycle, shape (n,) [force/length].

    Args:
        drive: One, or its name.
        cycle: The cycle at n front nodes.
    """
    if drive == "dG":
        return cycle.dG
    if drive == "G_max":
        return cycle.G_max
    if drive == "dK":
        return np.asarray((np.sqrt(cycle.G_max) - np.sqrt(cycle.G_min)) ** 2)
    return cast(DrivingForce, drive).of(cycle)
