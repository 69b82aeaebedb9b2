"""Paris law of energy release rates (Paris and Erdogan 1963; ASTM D6115).

    onset    N0 = c1 D^c2
    growth   da/dN = c3 D^c4           r1 G_c < G_max < r2 G_c

D is dG = G_max - G_min unless another driving force is chosen, or D/G_c with ``normalised=True``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import flag, keep, keep_floats, positive
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.driving_force import Drive, check_drive, driving_force
from fxcrack.criteria.fatigue_law import keep_onset_and_limits, regimes_between, times_power
from fxcrack.criteria.mix_curve import MixCurve


@dataclass(frozen=True)
class Paris:
    """Constants of onset and growth. Their units follow from that of G: [G]^-c2 and length [G]^-c4.

    Attributes:
        c1: Factor of onset [cycles]; 0: growth starts at once.
        c2: Exponent of onset, negative in practice.
        c3: Factor of growth, positive [length per cycle].
        c4: Exponent of growth, positive.
        r1: Threshold over toughness, compared with G_max/G_c: a number, a table (shares of shear,
            values) or a function of the share of shear, see :mod:`fxcrack.criteria.mix_curve`.
        r2: Upper limit of the Paris regime over toughness, likewise.
        drive: Driving force D: "dG", "G_max", "dK", :class:`Walker` or :class:`Elber`.
        normalised: Whether D/G_c takes the place of D.
    """

    c1: float
    c2: float
    c3: float
    c4: float
    r1: MixCurve = 0.01
    r2: MixCurve = 0.85
    drive: Drive = field(default="dG", kw_only=True)
    normalised: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        """Check the constants."""
        positive("Paris", c3=self.c3, c4=self.c4)
        keep_floats(self, "c3", "c4")
        keep_onset_and_limits(self)
        check_drive("Paris", self.drive)
        keep(self, normalised=flag("Paris", "normalised", self.normalised))

    def life_exponent(self, toughness: float) -> float:
        """Exponent of growth."""
        return self.c4

    def onset_cycles(self, drive: npt.ArrayLike) -> Array:
        """Cycles N0 until growth starts, of the shape of the driving force D."""
        return times_power(self.c1, drive, self.c2)

    def growth_rate(self, drive: npt.ArrayLike) -> Array:
        """Growth da/dN in the Paris regime, of the shape of the driving force D."""
        return times_power(self.c3, drive, self.c4)

    def onset(self, cycle: CycleRates) -> Array:
        """Cycles until growth starts, shape (n,)."""
        return self.onset_cycles(self._drive(cycle))

    def growth(self, cycle: CycleRates) -> Array:
        """Growth da/dN in the Paris regime, shape (n,) [length per cycle]."""
        return self.growth_rate(self._drive(cycle))

    def regimes(self, cycle: CycleRates) -> Ints:
        """Regime of each front node, shape (n,)."""
        return regimes_between("Paris", self.r1, self.r2, cycle)

    def _drive(self, cycle: CycleRates) -> Array:
        drive = driving_force(self.drive, cycle)
        return np.asarray(drive / cycle.G_c) if self.normalised else drive
