"""The factor of a proportional load that a step moves forth and back, beside constant loads.

With constant loads (weight, pretension, residual stress, a temperature) forces and openings are

    F(t) = F_0 + t F_1,    w(t) = w_0 + t w_1    and so    G(t) = G_00 + t G_01 + t^2 G_11

at constant bonds: f is no longer a power of the load factor t, and f = 1 may be found at a negative
factor, where the constant loads alone would drive the crack and the load must hold it closed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from fxcrack.base import log
from fxcrack.base.errors import InputError
from fxcrack.continuum.loads import AmplitudeLike, Ramp
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.steps.driver import StepDriver

_WIDER = 4.0
"""Factor from one search below zero load to the next."""
_SEARCHES = 50
"""Searches below zero load at most: factors of up to 1e30."""
_FALLS = 1e-9
"""Part of itself by which a quantity must fall so that a search goes on."""


class LoadFactor:
    """The load factor of a step.

    Args:
        driver: The step.

    Attributes:
        begin: Time at which the step began, or the latest one before it that loads have seen; those
            that are not proportional stay what they are then.
        preloaded: Whether there are such loads.

    Raises:
        InputError: A load changes in the step otherwise than in proportion to time, or a crack
            grows with time.
    """

    def __init__(self, driver: StepDriver) -> None:
        self._driver = driver
        balance = driver.analysis.balance
        if driver.resume is None:
            balance.held_from = max(balance.held_from, balance.time)
        self.begin = balance.held_from
        self._check()
        self.preloaded = bool(driver.breaks)
        if self.preloaded:
            driver.preloaded, driver.breaks = True, ()
        self._least = np.inf

    def _check(self) -> None:
        driver, analysis = self._driver, self._driver.analysis
        stepping = f"stepping='{driver.step.stepping}'"
        small = 1e-12 * abs(self.begin)
        if any(_changes_after(a, self.begin + small) for a in analysis.amplitudes()):
            raise InputError(
                f"{stepping} follows one proportional load beside constant ones; use the default "
                "amplitude for loads that grow, constant() for those that stay, or let their "
                "amplitudes end before the step"
            )
        if not analysis.linear and any(_changes_after(a) for a in analysis.amplitudes_of_bodies()):
            raise InputError(
                f"{stepping}: a temperature or a pressure that follows, which has changed before, "
                "would change back with the load of nonlinear bodies; give it the amplitude "
                "constant()"
            )
        if driver.breaks and not any(isinstance(a, Ramp) for a in analysis.amplitudes()):
            raise InputError(
                f"{stepping} needs a load that is proportional to time; leave out the amplitude of "
                "one load or prescribed displacement"
            )
        for g in analysis.active:
            if g.evaluator.breaks() or g.law.driver == "time" or analysis.ramps:
                raise InputError(
                    f"interface '{g.title}' grows or is released with time, which {stepping} does "
                    "not have: it moves the load forth and back; use 'event' or 'increment'"
                )

    def _below(self) -> Iterator[float]:
        """Factors down to which the load is taken, one after the other: zero, then below."""
        present = self._driver.analysis.time
        if present > 0.0:
            yield 0.0
        if self.preloaded:
            reach = max(abs(present), abs(self.begin)) or 1.0
            for k in range(_SEARCHES):
                yield min(present, 0.0) - reach * _WIDER**k

    def fall_to_one(self) -> bool:
        """Take load away until f is 1; whether it is somewhere, else the state is unchanged."""
        analysis = self._driver.analysis
        saved, lowest = analysis.snapshot(), analysis.largest
        for floor in self._below():
            before = analysis.largest
            if self._driver.path.to_crossing(floor, upward=False):
                return True
            lowest = min(lowest, analysis.largest)
            if floor < 0.0 and analysis.largest > before * (1.0 - _FALLS):
                break
        analysis.rollback(saved)
        self._least = lowest
        return False

    def why_above(self) -> str:
        """Why no load factor makes f = 1, which ends the step, with a warning.

        Raises:
            InputError: There are no constant loads that could be the cause.
        """
        if not self.preloaded:
            raise InputError("stepping='path': f stays above 1 down to zero load")
        reason = (
            f"stopped: the constant loads alone drive the crack: f stays above 1 (it is "
            f"{self._least:.4g} where it was looked for) whatever the proportional load; there is "
            "no equilibrium at f = 1, and event stepping lets the crack run"
        )
        log.warn("%s", reason)
        return reason

    def fall_back(self, excess: Callable[[Equilibrium], float], tolerance: float) -> bool:
        """Take load away until a quantity has fallen to zero; whether it has.

        Args:
            excess: The quantity in a state.
            tolerance: What counts as zero.
        """
        analysis = self._driver.analysis
        for floor in self._below():
            before = excess(analysis.solver.state)
            if self._driver.path.back_to(excess, tolerance, floor):
                return True
            after = excess(analysis.solver.state)
            if floor < 0.0 and after > before - _FALLS * abs(before):
                return False
        return False


def _changes_after(amplitude: AmplitudeLike, time: float = -np.inf) -> bool:
    """Whether an amplitude changes after a time, otherwise than in proportion to time."""
    if isinstance(amplitude, Ramp):
        return False
    breaks = amplitude.breaks() or (0.0,)
    # beyond its breaks an amplitude goes on in a straight line
    first, last = min(breaks), max(breaks)
    begin = max(time, first - 1.0)
    places = [begin, *(t for t in breaks if t > begin), max(begin, last) + 1.0]
    return len({amplitude(t) for t in places}) > 1
