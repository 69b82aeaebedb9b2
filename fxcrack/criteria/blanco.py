"""Paris law whose constants depend on the mode mix (Blanco, Gamstedt, Asp and Costa 2004).

With phi = (G_II + G_III)/G at G_max and the driving force D over toughness,

    da/dN = C (D/G_c)^m
    log C = log C_I + log C_m phi + log(C_II/(C_m C_I)) phi^2
    m     = m_I + m_m phi + (m_II - m_I - m_m) phi^2

(Int. J. Solids Struct. 41, 4219-4235): parabolas through the constants of mode I and of mode II,
so that growth in mixed mode may be faster than in either.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import finite, flag, keep, keep_floats, positive
from fxcrack.base.errors import InputError
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.driving_force import Drive, check_drive, driving_force
from fxcrack.criteria.fatigue_law import keep_onset_and_limits, regimes_between, times_power
from fxcrack.criteria.mix_curve import MixCurve


@dataclass(frozen=True)
class Blanco:
    """Constants of growth as parabolas of the mode mix.

    Attributes:
        C_I: Factor of growth in mode I, positive [length per cycle].
        m_I: Exponent of growth in mode I.
        C_II: Factor of growth in mode II, positive [length per cycle].
        m_II: Exponent of growth in mode II.
        C_m: Factor of mixed mode, positive.
        m_m: Exponent of mixed mode.
        drive: Driving force D, see :class:`Paris`.
        normalised: Whether D/G_c drives growth, as in the source, or D alone.
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
    C_m: float
    m_m: float
    drive: Drive = field(default="dG", kw_only=True)
    normalised: bool = field(default=True, kw_only=True)
    c1: float = field(default=0.0, kw_only=True)
    c2: float = field(default=-1.0, kw_only=True)
    r1: MixCurve = field(default=0.01, kw_only=True)
    r2: MixCurve = field(default=0.85, kw_only=True)

    def __post_init__(self) -> None:
        """Check the constants, and that growth rises with the load at every mode mix."""
        positive("Blanco", C_I=self.C_I, m_I=self.m_I, C_II=self.C_II, m_II=self.m_II, C_m=self.C_m)
        finite("Blanco", m_m=self.m_m)
        keep_floats(self, "C_I", "m_I", "C_II", "m_II", "C_m", "m_m")
        check_drive("Blanco", self.drive)
        keep(self, normalised=flag("Blanco", "normalised", self.normalised))
        keep_onset_and_limits(self)
        phi = np.linspace(0.0, 1.0, 101)
        m = self.constants(phi)[1]
        if m.min() <= 0.0:
            raise InputError(
                f"Blanco: the exponent falls to {m.min():.3g} at a share of shear of "
                f"{phi[m.argmin()]:g}; growth must rise with the load at every mode mix"
            )

    def life_exponent(self, toughness: float) -> float:
        """Largest exponent of growth over all mode mixes."""
        return float(self.constants(np.linspace(0.0, 1.0, 101))[1].max())

    def constants(self, phi: Array) -> tuple[Array, Array]:
        """C [length per cycle] and m at shares of shear, both of the shape of ``phi``."""
        first, mixed, second = np.log([self.C_I, self.C_m, self.C_II])
        log_c = first + mixed * phi + (second - mixed - first) * phi**2
        m = self.m_I + self.m_m * phi + (self.m_II - self.m_I - self.m_m) * phi**2
        return np.exp(log_c), m

    def onset(self, cycle: CycleRates) -> Array:
        """Cycles until growth starts, shape (n,)."""
        return times_power(self.c1, self._drive(cycle), self.c2)

    def growth(self, cycle: CycleRates) -> Array:
        """Growth da/dN in the Paris regime, shape (n,) [length per cycle]."""
        c, m = self.constants(cycle.shear)
        return times_power(c, self._drive(cycle), m)

    def regimes(self, cycle: CycleRates) -> Ints:
        """Regime of each front node, shape (n,)."""
        return regimes_between("Blanco", self.r1, self.r2, cycle)

    def _drive(self, cycle: CycleRates) -> Array:
        drive = driving_force(self.drive, cycle)
        return np.asarray(drive / cycle.G_c) if self.normalised else drive
