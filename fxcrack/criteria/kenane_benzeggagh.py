"""Paris law whose constants depend on the mode mix (Kenane and Benzeggagh 1997).

With phi = (G_II + G_III)/G at G_max,

    da/dN = C D^m
    log C = log C_II + (log C_I - log C_II) (1 - phi)^p
    m     = m_I + (m_II - m_I) phi^q

(Compos. Sci. Technol. 57, 597-605): monotonic between the constants of mode I and of mode II.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import flag, keep, keep_floats, positive
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.driving_force import Drive, check_drive, driving_force
from fxcrack.criteria.fatigue_law import keep_onset_and_limits, regimes_between, times_power
from fxcrack.criteria.mix_curve import MixCurve


@dataclass(frozen=True)
class KenaneBenzeggagh:
    """Constants of growth by the mode mix, monotonic from mode I to mode II.

    Attributes:
        C_I: Factor of growth in mode I, positive [length per cycle].
        m_I: Exponent of growth in mode I, positive.
        C_II: Factor of growth in mode II, positive [length per cycle].
        m_II: Exponent of growth in mode II, positive.
        p: Exponent of the mode mix in the factor, positive.
        q: Exponent of the mode mix in the exponent, positive.
        drive: Driving force D, see :class:`Paris`.
        normalised: Whether D/G_c drives growth, or D alone, as in the source.
        c1: Factor of onset, N0 = c1 x^c2 [cycles], x = D/G_c if
            `normalised`, else D; 0: growth starts at once.
        c2: Exponent of onset.
        r1: Threshold over toughness, see :class:`Paris`.
        r2: Upper limit of the Paris regime over toughness, likewise.
    """

    C_I: float
    m_I: float
    C_II: float
    m_II: float
    p: float
    q: float
    drive: Drive = field(default="dG", kw_only=True)
    normalised: bool = field(default=False, kw_only=True)
    c1: float = field(default=0.0, kw_only=True)
    c2: float = field(default=-1.0, kw_only=True)
    r1: MixCurve = field(default=0.01, kw_only=True)
    r2: MixCurve = field(default=0.85, kw_only=True)

    def __post_init__(self) -> None:
        """Check the constants."""
        names = ("C_I", "m_I", "C_II", "m_II", "p", "q")
        positive("KenaneBenzeggagh", **{name: getattr(self, name) for name in names})
        keep_floats(self, *names)
        check_drive("KenaneBenzeggagh", self.drive)
        keep(self, normalised=flag("KenaneBenzeggagh", "normalised", self.normalised))
        keep_onset_and_limits(self)

    def life_exponent(self, toughness: float) -> float:
        """Largest exponent of growth over all mode mixes."""
        return max(self.m_I, self.m_II)

    def constants(self, phi: Array) -> tuple[Array, Array]:
        """C [length per cycle] and m at shares of shear, both of the shape of ``phi``."""
        first, second = np.log([self.C_I, self.C_II])
        log_c = second + (first - second) * (1.0 - phi) ** self.p
        return np.exp(log_c), self.m_I + (self.m_II - self.m_I) * phi**self.q

    def onset(self, cycle: CycleRates) -> Array:
        """Cycles until growth starts, shape (n,)."""
        return times_power(self.c1, self._drive(cycle), self.c2)

    def growth(self, cycle: CycleRates) -> Array:
        """Growth da/dN in the Paris regime, shape (n,) [length per cycle]."""
        c, m = self.constants(cycle.shear)
        return times_power(c, self._drive(cycle), m)

    def regimes(self, cycle: CycleRates) -> Ints:
        """Regime of each front node, shape (n,)."""
        return regimes_between("KenaneBenzeggagh", self.r1, self.r2, cycle)

    def _drive(self, cycle: CycleRates) -> Array:
        drive = driving_force(self.drive, cycle)
        return np.asarray(drive / cycle.G_c) if self.normalised else drive
