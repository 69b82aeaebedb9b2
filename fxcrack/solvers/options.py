"""Controls of the nonlinear solver."""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.base.checks import flag, keep, keep_floats, number, positive, whole
from fxcrack.base.errors import InputError


@dataclass(frozen=True)
class NewtonOptions:
    """Controls of the nonlinear iteration.

    Args:
        tolerance: Residual over the forces in the bodies at which the iteration ends; these are
            the larger ones of those at the increment's start and those at the iterate, at least
            round-off of the largest so far.
        max_iterations: Iterations with a new tangent allowed in one solve.
        reuse: Iterate with the tangent at hand as long as the residual falls fast with it; else
            every iteration has its own (Newton's method to the letter, quadratic at the end).
        balance: Part of the stored energy by which work and energies may be off after one
            increment; where it is more the increment is divided, down to 1/512 of it. inf takes
            every increment whole. Bodies that yield are held to it as well; those with inertia
            are not, as their time integration accounts for the energies.
    """

    tolerance: float = 1e-10
    max_iterations: int = 25
    reuse: bool = True
    balance: float = 1e-5

    def __post_init__(self) -> None:
        """Check the numbers."""
        owner = "NewtonOptions"
        positive(owner, tolerance=self.tolerance)
        if not number(owner, "balance", self.balance) > 0.0:
            raise InputError(
                f"{owner}: balance = {self.balance} must be positive; inf for no bound"
            )
        keep(
            self,
            max_iterations=whole(owner, "max_iterations", self.max_iterations),
            reuse=flag(owner, "reuse", self.reuse),
        )
        keep_floats(self, "tolerance", "balance")


@dataclass(frozen=True)
class ExplicitOptions:
    """Controls of explicit dynamics; arguments of :class:`fxcrack.Explicit` of the same names.

    Attributes:
        dt: Increment, time; ``None``: the stable one times ``safety``.
        safety: Part of the stable increment that is used.
        contact: "exact": by multipliers, "penalty": by a stiffness.
        penalty: That stiffness over m/dt^2.
        mass_scale: Factor on the mass of all bodies, or ``"dt"``: mass is added to nodes where
            ``dt`` would not be stable.
        operator: "product", "assembly", or "auto".
        bulk: Linear and quadratic bulk viscosity.
        tolerance: Part of the energies by which their balance may be off before the run stops.
    """

    dt: float | None = None
    safety: float = 0.97
    contact: str = "exact"
    penalty: float = 0.1
    mass_scale: float | str = 1.0
    operator: str = "auto"
    bulk: tuple[float, float] = (0.0, 0.0)
    tolerance: float = 1e-6
