"""Paris law of stress intensity factors: da/dN = C dK^m with K = sqrt(E' G).

E' = E/(1 - nu^2) in plane strain and E in plane stress, of isotropic bodies on both sides of the
interface. In mixed mode dK^2 = E' dG holds the sum of the modes, mode III included with the modulus
of the others.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import between, keep_floats, not_negative, one_of, positive
from fxcrack.base.errors import InputError
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.driving_force import Drive, check_drive, driving_force
from fxcrack.criteria.fatigue_law import (
    Regime,
    keep_onset_and_limits,
    regimes_between,
    times_power,
)
from fxcrack.criteria.mix_curve import MixCurve


@dataclass(frozen=True)
class ParisK:
    """Paris law of the range of the stress intensity factor.

    Attributes:
        C: Factor of growth, positive [length per cycle over [K]^m].
        m: Exponent of growth, positive.
        E: Young's modulus [force/length^2].
        nu: Poisson's ratio; needed in plane strain.
        state: "plane strain", E' = E/(1 - nu^2); or "plane stress", E' = E.
        drive: What dK is: "dK", K_max - K_min; "G_max", K_max; "dG", sqrt(E' (G_max - G_min));
            :class:`Walker` or :class:`Elber` for an effective range.
        dK_th: Threshold of this range [K]; no growth up to it.
        c1: Factor of onset, N0 = c1 dK^c2 [cycles]; 0: growth starts at once.
        c2: Exponent of onset.
        r1: Threshold over toughness, compared with G_max/G_c, see :class:`Paris`.
        r2: Upper limit of the Paris regime over toughness, likewise.
    """

    C: float
    m: float
    E: float
    nu: float | None = None
    state: Literal["plane strain", "plane stress"] = field(default="plane strain", kw_only=True)
    drive: Drive = field(default="dK", kw_only=True)
    dK_th: float = field(default=0.0, kw_only=True)
    c1: float = field(default=0.0, kw_only=True)
    c2: float = field(default=-1.0, kw_only=True)
    r1: MixCurve = field(default=0.0, kw_only=True)
    r2: MixCurve = field(default=0.85, kw_only=True)

    def __post_init__(self) -> None:
        """Check the constants."""
        positive("ParisK", C=self.C, m=self.m, E=self.E)
        not_negative("ParisK", dK_th=self.dK_th)
        one_of("ParisK", "state", self.state, ("plane strain", "plane stress"))
        if self.nu is not None:
            between("ParisK", "nu", self.nu, -1.0, 0.5, ends=False)
        elif self.state == "plane strain":
            raise InputError(
                "ParisK: plane strain needs Poisson's ratio nu, E' = E/(1 - nu^2); give it, or "
                "state='plane stress'"
            )
        keep_floats(self, "C", "m", "E", "nu", "dK_th")
        check_drive("ParisK", self.drive)
        keep_onset_and_limits(self)

    def life_exponent(self, toughness: float) -> float:
        """Exponent of growth with G, half of that with K."""
        return 0.5 * self.m

    @property
    def modulus(self) -> float:
        """E' with K^2 = E' G [force/length^2]."""
        return self.E if self.state == "plane stress" else self.E / (1.0 - float(self.nu or 0) ** 2)

    def dK(self, cycle: CycleRates) -> Array:
        """Range of the stress intensity factor by ``drive``, shape (n,) [K]."""
        return np.asarray(np.sqrt(self.modulus * driving_force(self.drive, cycle)))

    def onset(self, cycle: CycleRates) -> Array:
        """Cycles until growth starts, shape (n,)."""
        return times_power(self.c1, self.dK(cycle), self.c2)

    def growth(self, cycle: CycleRates) -> Array:
        """Growth da/dN in the Paris regime, shape (n,) [length per cycle]."""
        return times_power(self.C, self.dK(cycle), self.m)

    def regimes(self, cycle: CycleRates) -> Ints:
        """Regime of each front node, shape (n,)."""
        by_rate = regimes_between("ParisK", self.r1, self.r2, cycle)
        below = (by_rate == Regime.PARIS) & (self.dK(cycle) <= self.dK_th)
        return np.where(below, int(Regime.NONE), by_rate)
