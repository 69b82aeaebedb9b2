"""Low-cycle fatigue: what the user may say about a step of cycles, and what cycles leave behind.

A cycle runs between two load states, or once through amplitudes that end where they began. Bodies
are elastic, so an equilibrium without friction depends on the loads alone and not on the way to
them: every cycle is a stabilised one, and solving its corners replaces the Fourier series of a
direct cyclic analysis exactly. Friction settles over some cycles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.checks import between, finite, keep, keep_floats, number, numbers
from fxcrack.base.errors import InputError
from fxcrack.steps.debond import Debond
from fxcrack.steps.end_conditions import Time, Until, conditions
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.static import Static


@dataclass(frozen=True, kw_only=True)
class Cycles:
    """A step of load cycles, in which interfaces with a :class:`Fatigue` criterion grow.

    Say what the cycle is in one of three ways:

    ==================== =======================================================================
    maximum, minimum     times of the amplitudes (with the default ramp: load factors) of the two
                         extremes; the loads vary linearly from one to the other and back
    maximum, ratio       the same, with all loads of the maximum times R at the minimum
    period               first and last time of one turn through the amplitudes, for loads that are
                         not in phase with each other; they must return to where they began
    ==================== =======================================================================

    G_max and G_min are the extremes of the total rate on this way, for each tip its own. On a
    piece of linear bodies without a change of contact they follow from its two ends exactly; other
    pieces are halved until they are known to ``change`` of G_max.

    On nonlinear bodies (finite strain, pressures that follow, moduli that change with the
    temperature) each instant is an equilibrium of its own, found on the tangent of the one before.
    A temperature and pressures that follow must be linear in time between maximum and minimum. With
    friction the whole cycle is passed at 2, 4, 8, ... instants per piece, until the extremes of G
    change by less than ``change`` of G_max.

    Bonds are released at the maximum of the cycle (with ``period`` at its corner of largest f);
    the step ends there, too. With neither ``n_max`` nor ``until`` it ends when no tip grows any
    more.

    Args:
        maximum: Time of the largest loads.
        minimum: Time of the smallest loads.
        ratio: Loads at the minimum over loads at the maximum, R < 1.
        period: First and last time of a turn through the amplitudes.
        n_max: Number of cycles after which the step ends.
        until: End condition, or a list of them of which the first met ends the step.
        change: How far G may lie from the parabola between two equilibria, over G_max, where
            contact changes between them or bodies are not linear.
    """

    maximum: float | None = None
    minimum: float | None = None
    ratio: float | None = None
    period: tuple[float, float] | None = None
    n_max: float = float("inf")
    until: Until | Sequence[Until] = ()
    change: float = 5e-3

    def __post_init__(self) -> None:
        """Check what needs no loads."""
        given = [self.minimum is not None, self.ratio is not None]
        if self.period is not None:
            complete = self.maximum is None and not any(given)
        else:
            complete = self.maximum is not None and sum(given) == 1
        if not complete:
            raise InputError(
                "Cycles: give maximum and minimum, or maximum and ratio, or period, and nothing "
                "beside"
            )
        for name in ("maximum", "minimum", "ratio"):
            if getattr(self, name) is not None:
                finite(
                    "Cycles: times and ratio must be finite numbers", **{name: getattr(self, name)}
                )
        keep_floats(self, "maximum", "minimum", "ratio")
        if self.period is not None:
            words = "first and last time of a turn"
            keep(self, period=numbers("Cycles", "period", self.period, 2, words=words))
        if self.ratio is not None and self.ratio >= 1.0:
            raise InputError(f"Cycles: ratio = {self.ratio} must be below 1")
        if self.period is not None and self.period[0] >= self.period[1]:
            raise InputError(f"Cycles: period = {self.period} must end after it begins")
        if not number("Cycles", "n_max", self.n_max) > 0.0:
            raise InputError(f"Cycles: n_max = {self.n_max} must be positive")
        between("Cycles", "change", self.change, 0.0, 1.0, ends=False)
        keep_floats(self, "n_max", "change")
        if any(isinstance(end, Time) for end in self.ends):
            raise InputError(
                "Cycles: time stands still while cycles are counted; end with n_max, CrackLength "
                "or Releases instead of Time"
            )

    @property
    def ends(self) -> tuple[Until, ...]:
        """End conditions as a tuple."""
        return conditions("Cycles", self.until, may_be_empty=True)

    def corners(
        self,
        loads_at: Callable[[float], Array],
        breaks: Sequence[float],
        names: Sequence[str],
    ) -> list[tuple[float, Array]]:
        """Time and loads at the corners of the cycle, the maximum first unless a period is given.

        Args:
            loads_at: Amplitudes and load factors at a time, shape (n_loads,).
            breaks: Times at which an amplitude changes its slope.
            names: Names of the loads, n_loads of them.

        Raises:
            InputError: An amplitude does not return to its beginning, or no load changes.
        """
        if self.period is not None:
            first, last = self.period
            times = [first, *sorted(t for t in set(breaks) if first < t < last)]
            found = [(t, loads_at(t)) for t in times]
            self._check_return(found[0][1], loads_at(last), names)
        else:
            assert self.maximum is not None
            top = loads_at(self.maximum)
            if self.ratio is not None:
                found = [(self.maximum, top), (self.maximum, self.ratio * top)]
            else:
                assert self.minimum is not None
                found = [(self.maximum, top), (self.minimum, loads_at(self.minimum))]
        if not any(np.any(loads != found[0][1]) for _, loads in found[1:]):
            raise InputError(
                f"Cycles: no load changes in the cycle (they are {found[0][1]} all the time); "
                "look at the amplitudes and at the times given"
            )
        return found

    def _check_return(self, begin: Array, end: Array, names: Sequence[str]) -> None:
        far = np.abs(end - begin) > 1e-9 * max(np.abs(begin).max(), np.abs(end).max())
        if np.any(far):
            i = int(np.argmax(far))
            raise InputError(
                f"Cycles: the amplitude of {names[i]} is not cyclic: {begin[i]:.6g} at the "
                f"beginning and {end[i]:.6g} at the end of the period {self.period}; amplitudes "
                "must end at the value they begin with"
            )


def check_criteria(step: Static | Cycles | Explicit, debonds: Sequence[Debond]) -> None:
    """Fatigue grows in cycles, everything else outside them.

    Args:
        step: The step.
        debonds: Those that are to grow in it.

    Raises:
        InputError: A criterion and the step are not compatible.
    """
    for debond in debonds:
        who = f"interface '{debond.interface.title}'"
        if not isinstance(step, Cycles):
            if debond.criterion.grows_in_cycles:
                raise InputError(
                    f"{who} has a {type(debond.criterion).__name__} criterion, which needs cycles: "
                    "run fx.Cycles(...), or leave it out of this step, grow=[other debonds]; it "
                    "stays tied then"
                )
            continue
        if not debond.criterion.grows_in_cycles:
            raise InputError(
                f"{who} has the criterion {type(debond.criterion).__name__}, which does not grow "
                "in cycles: use Fatigue, or leave it out of this step, grow=[other debonds]; it "
                "stays tied then"
            )
        if debond.release is not None and debond.release.driver != "once":
            raise InputError(
                f"{who}: in cycles bonds are released at once; use release=StepRelease() (the "
                f"default) instead of {type(debond.release).__name__}"
            )
    if isinstance(step, Cycles) and not debonds:
        raise InputError("Cycles: no interface may grow in this step; give a Debond with Fatigue")
