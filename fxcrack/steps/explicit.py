"""Explicit dynamics as a step: the controls a user may give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fxcrack.base.checks import keep, list_of, not_negative, number, one_of, positive, shown, whole
from fxcrack.base.errors import InputError
from fxcrack.solvers.options import ExplicitOptions
from fxcrack.steps.end_conditions import Time, Until, conditions

OPERATORS = ("auto", "product", "assembly")
CONTACTS = ("exact", "penalty")

MOST_BULK = (1.0, 10.0)
"""Largest linear and quadratic bulk viscosity."""


@dataclass(frozen=True)
class Explicit:
    """A step of explicit dynamics, for a scene with :class:`fxcrack.Inertia`.

    Central differences with lumped masses; no factorisation. Bonded nodes move together exactly:
    bonds have no stiffness and do not shorten the increment. Bonds are released progressively by
    default (:class:`fxcrack.ProgressiveRelease`): exactly the toughness is spent per area, whatever
    the speed of the crack.

    Args:
        until: End condition, or a list of them of which the first met ends the step. One of them
            must be a :class:`fxcrack.Time`.
        start: How the first explicit step of a scene begins: "rest", without strain, or
            "equilibrium", the static equilibrium with what loads and supports prescribe at the
            first moment and all bonds tied.
        dt: Increment, time; by default the stable one times ``safety``. The increments are made a
            little shorter where that makes them end at the end time.
        safety: Part of the stable increment that is used. At finite strain the increment follows it
            as it changes, unless ``dt`` is given.
        rows: Rows of the history, evenly spaced in time up to the end time.
        contact: How faces of interfaces with ``contact=True`` are kept apart: "exact" by the forces
            for which they just touch, "penalty" by a stiffness.
        penalty: That stiffness, as a part of m/dt^2 of the pair of nodes; the exact forces are
            those of 1.
        mass_scale: Factor on the mass of all bodies: quasi-static runs take larger increments with
            it. "dt" adds mass to the nodes at which ``dt`` would not be stable, and to no other.
        operator: How internal forces of linear bodies are found: "product" with the stiffness,
            "assembly", or "auto": the faster one, which is timed. Nonlinear bodies assemble.
        bulk: Bulk viscosity, linear and quadratic, of bodies of small strain: the fraction of
            critical damping of the highest mode of volume change, at most 1, and the width of
            shocks in cells, about, at most 10; (0.06, 1.2) is usual in impact. It shortens the
            increment, which follows the quadratic part where ``dt`` is not given, and dissipates
            ``viscous_energy``; exact bonds and progressive release need none.
        tolerance: Part of all energies by which their balance may be off before the run stops, for
            linear bodies; a thousand times as much for nonlinear ones.

    Raises:
        InputError: A control is out of range, or no end time is given.
    """

    until: Until | Sequence[Until]
    start: str = "rest"
    dt: float | None = None
    safety: float = 0.97
    rows: int = 200
    contact: str = "exact"
    penalty: float = 0.1
    mass_scale: float | str = 1.0
    operator: str = "auto"
    bulk: tuple[float, float] = (0.0, 0.0)
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        """Check the end and the controls."""
        ends = conditions("Explicit", self.until)
        if not any(isinstance(end, Time) for end in ends):
            raise InputError(
                "Explicit: no end time; a crack may stop for ever while the bodies move on. Write "
                "until=[..., Time(t)]"
            )
        one_of("Explicit", "start", self.start, ("rest", "equilibrium"))
        if self.dt is not None:
            positive("Explicit", dt=self.dt)
        if not 0.0 < number("Explicit", "safety", self.safety) <= 1.0:
            raise InputError(f"Explicit: safety = {self.safety} must lie between 0 and 1")
        keep(self, rows=whole("Explicit", "rows", self.rows))
        one_of("Explicit", "contact", self.contact, CONTACTS)
        one_of("Explicit", "operator", self.operator, OPERATORS)
        positive("Explicit", penalty=self.penalty, tolerance=self.tolerance)
        bulk = list_of(self.bulk)
        if bulk is None or len(bulk) != 2:
            raise InputError(
                f"Explicit: bulk = {shown(self.bulk)} must be two numbers, linear and quadratic "
                "bulk viscosity, e.g. (0.06, 1.2)"
            )
        not_negative("Explicit", **{f"bulk[{i}]": b for i, b in enumerate(bulk)})
        keep(self, bulk=(float(bulk[0]), float(bulk[1])))
        for name, value, most, usual in zip(
            ("linear", "quadratic"), self.bulk, MOST_BULK, (0.06, 1.2), strict=True
        ):
            if value > most:
                raise InputError(
                    f"Explicit: {name} bulk viscosity of {value:g} is above {most:g}, which damps "
                    "waves of volume change beyond critical and shortens the increments without "
                    f"need; {usual:g} is usual"
                )
        if self.penalty > 1.0:
            raise InputError(
                f"Explicit: penalty = {self.penalty} is above 1, the stiffness at which faces that "
                "overlap are parted in one increment; contact would not be stable"
            )
        if isinstance(self.mass_scale, str):
            one_of("Explicit", "mass_scale", self.mass_scale, ("dt",))
            if self.dt is None:
                raise InputError(
                    "Explicit: mass_scale='dt' adds mass until dt is stable; give dt as well"
                )
        else:
            positive("Explicit", mass_scale=self.mass_scale)

    @property
    def ends(self) -> tuple[Until, ...]:
        """End conditions as a tuple."""
        return conditions("Explicit", self.until)

    @property
    def end_time(self) -> float:
        """The first end time."""
        return min(end.time for end in self.ends if isinstance(end, Time))

    @property
    def options(self) -> ExplicitOptions:
        """The controls that concern the solver."""
        return ExplicitOptions(
            dt=self.dt,
            safety=self.safety,
            contact=self.contact,
            penalty=self.penalty,
            mass_scale=self.mass_scale,
            operator=self.operator,
            bulk=self.bulk,
            tolerance=self.tolerance,
        )
