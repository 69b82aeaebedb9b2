"""What the user says about inertia: density, damping and the time integration.

    M a_{n+1-alpha_m} + C v_{n+1-alpha_f} + f_{n+1-alpha_f} = 0        (generalised alpha)

Chung and Hulbert (1993); Hilber, Hughes and Taylor's method and Newmark's are choices of the
parameters. Pure data; :mod:`fxcrack.terms.inertia` makes forms of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.errors import InputError
from fxcrack.loads import Field


@dataclass(frozen=True)
class Inertia:
    """Inertia of the bodies: implicit dynamics.

    Args:
        density: Mass per undeformed volume of all bodies; that of the materials by default.
        rho_inf: What is left of a motion too fast for the increment after one increment, 0 to 1:
            1 damps nothing, 0 damps it at once. The parameters follow from it.
        alpha_m: Weight of the old acceleration, if chosen by hand (together with ``alpha_f``).
        alpha_f: Weight of the old forces and velocity.
        rayleigh: Damping C = r_M M + r_K K by mass (1/time) and by stiffness at zero strain (time).
        lumped: Mass at the nodes alone; first-order bodies only.
        velocity: Velocity at time 0, a number or a function of position per component; at rest by
            default.

    Raises:
        InputError: A number is out of range, or the method would be unstable or of first order.
    """

    density: float | None = None
    rho_inf: float = 0.8
    alpha_m: float | None = None
    alpha_f: float | None = None
    rayleigh: tuple[float, float] = (0.0, 0.0)
    lumped: bool = False
    velocity: tuple[Field, ...] | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.density is not None and not (np.isfinite(self.density) and self.density > 0.0):
            raise InputError(f"Inertia: density = {self.density} must be positive")
        if not 0.0 <= self.rho_inf <= 1.0:
            raise InputError(f"Inertia: rho_inf = {self.rho_inf} must lie between 0 and 1")
        if (self.alpha_m is None) != (self.alpha_f is None):
            raise InputError("Inertia: give alpha_m and alpha_f together, or rho_inf alone")
        if self.velocity is not None and not isinstance(self.velocity, tuple | list):
            raise InputError(
                f"Inertia: velocity = {self.velocity!r} must have one entry per component, each a "
                "number or a function of position, e.g. (0.0, 1.0)"
            )
        m, f, _, _ = self.parameters
        if not m <= f <= 0.5:
            raise InputError(
                f"Inertia: alpha_m = {m}, alpha_f = {f} is not unconditionally stable; "
                "alpha_m <= alpha_f <= 1/2 is"
            )
        if len(self.rayleigh) != 2 or not all(np.isfinite(r) and r >= 0.0 for r in self.rayleigh):
            raise InputError(
                f"Inertia: rayleigh = {self.rayleigh} must be two numbers that are not negative"
            )

    @classmethod
    def hht(cls, alpha: float = -0.05, **others: object) -> Inertia:
        """Hilber, Hughes and Taylor's method, -1/3 <= alpha <= 0."""
        if not -1.0 / 3.0 <= alpha <= 0.0:
            raise InputError(f"Inertia.hht: alpha = {alpha} must lie between -1/3 and 0")
        return cls(alpha_m=0.0, alpha_f=-alpha, **others)  # type: ignore[arg-type]

    @classmethod
    def newmark(cls, **others: object) -> Inertia:
        """Newmark's method with constant mean acceleration: no numerical damping."""
        return cls(alpha_m=0.0, alpha_f=0.0, **others)  # type: ignore[arg-type]

    @property
    def parameters(self) -> tuple[float, float, float, float]:
        """Alpha_m, alpha_f, beta, gamma; second order in the increment."""
        if self.alpha_m is not None and self.alpha_f is not None:
            m, f = self.alpha_m, self.alpha_f
        else:
            m = (2.0 * self.rho_inf - 1.0) / (self.rho_inf + 1.0)
            f = self.rho_inf / (self.rho_inf + 1.0)
        return m, f, 0.25 * (1.0 - m + f) ** 2, 0.5 - m + f
