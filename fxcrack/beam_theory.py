"""Corrected beam theory of laminate specimens: closed forms to compare with.

    I = b h^3/12,  Gamma = 1.18 sqrt(E11 E22)/G13,
    chi = sqrt( E11/(11 G13) (3 - 2 (Gamma/(1 + Gamma))^2) )

Crack lengths are corrected to a + chi h in mode I and a + 0.42 chi h in mode II (Williams 1989,
Kinloch, Wang, Williams and Yayla 1993; ASTM D6671).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from fxcrack.base.arrays import Array

Number = TypeVar("Number", float, Array)


@dataclass(frozen=True)
class CorrectedBeam:
    """A specimen of two equal arms.

    Args:
        E: Young's modulus along the arms, force/length^2.
        E22: Young's modulus across them.
        G: Shear modulus in their plane.
        h: Thickness of one arm, length.
        b: Width, length.
    """

    E: float
    E22: float
    G: float
    h: float
    b: float

    @property
    def inertia(self) -> float:
        """Second moment of area of one arm, length^4."""
        return self.b * self.h**3 / 12.0

    @property
    def chi(self) -> float:
        """Crack length correction over the arm thickness."""
        gamma = 1.18 * np.sqrt(self.E * self.E22) / self.G
        factor = 3.0 - 2.0 * (gamma / (1.0 + gamma)) ** 2
        return float(np.sqrt(self.E / (11.0 * self.G) * factor))

    # -- double cantilever beam ----------------------------------------------------------

    def dcb_load(self, a: Number, toughness: float) -> Number:
        """Load at which a double cantilever beam grows from crack length a."""
        strength = np.sqrt(toughness * self.b * self.E * self.inertia)
        return strength / (a + self.chi * self.h)  # type: ignore[no-any-return]

    def dcb_opening(self, a: Number, load: Number) -> Number:
        """Opening of both arms together under a load."""
        return 2.0 * load * (a + self.chi * self.h) ** 3 / (3.0 * self.E * self.inertia)

    def dcb_load_at_opening(self, opening: Number, toughness: float) -> Number:
        """Load on the growth branch at a given opening of both arms together."""
        strength = np.sqrt(toughness * self.b * self.E * self.inertia)
        length = np.sqrt(1.5 * self.E * self.inertia * opening / strength)
        return strength / length  # type: ignore[no-any-return]

    # -- bending specimens ---------------------------------------------------------------

    def enf_load(self, a: Number, toughness: float) -> Number:
        """Load at which an end-notched flexure specimen grows."""
        ae = a + 0.42 * self.chi * self.h
        top = 16.0 * self.b**2 * self.E * self.h**3 * toughness
        return np.sqrt(top / 9.0) / ae  # type: ignore[no-any-return]

    def enf_rate(self, a: Number, load: Number) -> Number:
        """Mode II energy release rate of an end-notched flexure specimen."""
        ae = a + 0.42 * self.chi * self.h
        return 9.0 * load**2 * ae**2 / (16.0 * self.b**2 * self.E * self.h**3)

    def enf_deflection(self, a: Number, load: Number, half_span: float) -> Number:
        """Deflection under the load of an end-notched flexure specimen, with that of shear.

        P (2 L^3 + 3 a^3)/(8 E b h^3) + 3 P L/(10 G b h); both parts of the beam shear alike.
        """
        ae = a + 0.42 * self.chi * self.h
        bending = (2.0 * half_span**3 + 3.0 * ae**3) / (8.0 * self.E * self.b * self.h**3)
        return load * (bending + 0.3 * half_span / (self.G * self.b * self.h))

    def mmb_rates(
        self, a: Number, load: Number, lever: float, half_span: float
    ) -> tuple[Number, Number]:
        """G_I and G_II of a mixed-mode bending specimen with lever length c (ASTM D6671)."""
        scale = 16.0 * self.b**2 * self.h**3 * half_span**2 * self.E
        one = 12.0 * load**2 * (3.0 * lever - half_span) ** 2 * (a + self.chi * self.h) ** 2
        two = 9.0 * load**2 * (lever + half_span) ** 2 * (a + 0.42 * self.chi * self.h) ** 2
        return one / scale, two / scale
