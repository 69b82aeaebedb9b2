"""Quasi-static steps: load, find where f = 1, release, find the new equilibrium.

One function per stepping: from event to event, along the equilibrium path at f = 1, and at a
controlled opening; increments are in :mod:`fxcrack.steps.increment_stepping`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fxcrack.base.checks import counted
from fxcrack.base.errors import InputError, unknown_name
from fxcrack.criteria import ProgressiveRelease
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.history import AT_ONE
from fxcrack.interface.crack_pressure import CrackPressure
from fxcrack.solvers.base import Solver
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.crack import Crack
from fxcrack.steps.driver import BEYOND, LARGE, StepDriver
from fxcrack.steps.increment_stepping import step_by_increments
from fxcrack.steps.load_factor import LoadFactor
from fxcrack.steps.release import release_critical
from fxcrack.steps.static import Static

_NEVER = (
    "the criterion is not reached however large the load becomes; the step ends where that search "
    "began"
)
_ABOVE = 1.0 + 1e-9
"""Values of f above this are more than 1."""
_TINY = 1e-8
"""Values of f below this after a release may be round-off of what was set free."""
_ONE_LOAD = 1e-6
"""Loads along a path that differ by less than this part are one, to what searches resolve."""


def run_static(analysis: Analysis, step: Static, **controls: Any) -> str:
    """Run a quasi-static step; collective.

    Args:
        analysis: The analysis, prepared for the step, its cracks activated.
        step: Controls and end conditions.
        **controls: Observer, checkpoints and resumption, as for
            :class:`~fxcrack.steps.driver.StepDriver`.

    Returns:
        Why the step ended.

    Raises:
        InputError: Release laws, bodies and stepping are not compatible.
    """
    driver = StepDriver(analysis, step, **controls)
    _check_releases(analysis, step)
    return driver.run(_STEPPINGS[step.stepping])


def _check_releases(analysis: Analysis, step: Static) -> None:
    """Refuse releases over increments where the stepping has none."""
    for g in analysis.active:
        viscosity, law = g.criterion.viscosity, g.law
        if isinstance(law, ProgressiveRelease) and law.zone != 1:
            raise InputError(
                f"interface '{g.title}': ProgressiveRelease(zone={law.zone}) is for fast cracks in "
                "explicit dynamics; use zone=1"
            )
        over_increments = law.driver == "increments"
        if over_increments and step.stepping != "increment":
            raise InputError(
                f"interface '{g.title}' is released by {law} over increments, which "
                f"stepping='{step.stepping}' does not have; use stepping='increment', "
                "or a ramp with the opening (no number of increments)"
            )
        if viscosity > 0.0 and over_increments:
            raise InputError(
                f"interface '{g.title}': viscosity delays a release at once or with the "
                f"opening, not {law} over increments; use viscosity=0 or another release"
            )
        if viscosity > 0.0 and step.stepping != "increment":
            raise InputError(
                f"interface '{g.title}': viscosity acts over increments of time, which "
                f"stepping='{step.stepping}' does not have; use stepping='increment' "
                "or viscosity=0"
            )


# -- steppings -------------------------------------------------------------------------------------


def step_by_events(driver: StepDriver) -> str:
    """Advance from release to release, each at exactly f = 1; returns why the step ended."""
    analysis = driver.analysis
    while True:
        driver.checkpoint_point()
        reason = driver.ended()
        if reason:
            return reason
        if _reached(driver):
            _record_growth(driver)
            release_critical(analysis)
            driver.record("release")
            continue
        if _curves_have_ended(driver):
            return "the curves of crack length against time have ended"
        if not _load_to_event(driver):
            return driver.ended() or _never(driver)
        if not _reached(driver) and not driver.ended():
            driver.record("bend")


def step_along_path(driver: StepDriver) -> str:
    """Keep a proportional load on the equilibrium path at f = 1; returns why the step ended."""
    analysis = driver.analysis
    control = LoadFactor(driver)
    fell = math.nan  # load at which f, coming from above, jumped over 1 since the last release
    while True:
        driver.checkpoint_point()
        reason = driver.ended()
        if reason:
            return reason
        down = analysis.largest > _ABOVE
        if down:
            if not control.fall_to_one():
                return control.why_above()
        elif not _reached(driver) and not _load_to_event(driver):
            return driver.ended() or _never(driver)
        most = 1.0 + max(AT_ONE, driver.path.resolution)
        if down and (not _reached(driver) or analysis.largest > most):
            fell = analysis.time
        # faces in friction stick when the load turns back, and f with them jumps: where it does so
        # in both directions at one load, there is no state with f = 1, and the bond goes at f > 1
        turns = analysis.largest > most and abs(analysis.time - fell) <= _ONE_LOAD * abs(fell)
        if not turns and (not _reached(driver) or analysis.largest > most):
            continue  # f jumped over 1 where bonds ran through unstable states, or the end came
        fell = math.nan
        _record_growth(driver)
        release_critical(analysis)
        driver.record("release")


def step_by_opening(driver: StepDriver) -> str:
    """Find a proportional load from an opening that never falls; returns why the step ended."""
    analysis = driver.analysis
    factor = LoadFactor(driver)
    control = OpeningControl(analysis.condensed, analysis.active, driver.step.monitors)
    if factor.preloaded:
        control.begin_at(analysis.solver.state)
    while True:
        driver.checkpoint_point()
        reason = driver.ended()
        if reason:
            return reason
        if not _reached(driver) and not _load_to_event(driver):
            return driver.ended() or _never(driver)
        if not _reached(driver):
            continue  # the end time came first
        control.reach(analysis.solver.state)
        _record_growth(driver)
        release_critical(analysis)
        more = control.excess(analysis.solver.state)
        same = abs(more) <= control.close
        if not same and not (more > 0.0 and factor.fall_back(control.excess, control.close)):
            raise InputError(
                f"stepping='opening': nodes were released at {analysis.time:.6g} times the load, "
                f"and '{control.name}' = {control.opening:.6g} is not found again at less; control "
                "a displacement nearer to the crack, or use stepping='path'"
            )
        driver.record("release")


_STEPPINGS: dict[str, Callable[[StepDriver], str]] = {
    "event": step_by_events,
    "path": step_along_path,
    "opening": step_by_opening,
    "increment": step_by_increments,
}


def _reached(driver: StepDriver) -> bool:
    """Whether the largest f counts as 1 or more."""
    return driver.analysis.largest >= 1.0 - driver.path.resolution


def _record_growth(driver: StepDriver) -> None:
    """Add the row before a release: an onset at f = 1, or unstable growth at f above 1."""
    most = 1.0 + max(AT_ONE, driver.path.resolution)
    driver.record("onset" if driver.analysis.largest <= most else "unstable")


# -- loading ---------------------------------------------------------------------------------------


def _load_to_event(driver: StepDriver) -> bool:
    """Load until f = 1 somewhere, an amplitude changes its slope or the end time comes.

    Returns:
        False if the load grew beyond all bounds without an event; the state is then that of
        the last event, or that of time 1, the loads as they were given, if none was before.
    """
    analysis = driver.analysis
    limit = min([driver.end_time, *driver.breaks_ahead()])
    if limit >= LARGE and _only_round_off(driver):
        return False
    begin, rows = None, len(analysis.history)
    if analysis.time > 0.0:
        begin = analysis.snapshot()
    guess = _next_guess(analysis)
    while guess <= BEYOND or limit < LARGE:
        if driver.path.to_crossing(min(guess, limit), upward=True) or analysis.time >= limit:
            return True
        if begin is None or len(analysis.history) > rows:
            begin, rows = analysis.snapshot(), len(analysis.history)
        guess = max(2.0 * analysis.time, _next_guess(analysis))
    assert begin is not None
    analysis.rollback(begin)
    return False


def _only_round_off(driver: StepDriver) -> bool:
    """Whether f under a proportional load is left over from releases, not a real force.

    Arms on their last bonded node may turn freely; only a load thousands of times (with an
    energy release rate) that of the last release would bring their f, which is round-off, to 1.
    Where bonds bear a force, f is as small because the toughness ahead is so much larger.
    """
    analysis = driver.analysis
    if (
        driver.preloaded
        or driver.breaks
        or analysis.condensed.system.soft.bonds
        or analysis.time <= 0.0
    ):
        return False
    by_load = all(g.criterion.depends_on_load for g in analysis.active)
    released = any(g.n_released for g in analysis.active)
    if not (by_load and released and analysis.largest < _TINY):
        return False
    # iterations leave forces of nonlinear bodies that are larger than round-off
    if not analysis.linear or _on_last_bonds(analysis):
        return True
    state = analysis.solver.state
    return not any(g.bears(v.tips, state).any() for g, v in analysis.at_tips() if len(v.tips))


def _on_last_bonds(analysis: Analysis) -> bool:
    """Whether all bonds left are those of the front, about which bodies may turn freely."""
    tips = sum(len(v.tips) for _, v in analysis.at_tips())
    return tips == sum(int(g.front.bonded.sum()) for g in analysis.active)


def _next_guess(analysis: Analysis) -> float:
    """A time a little after the one at which f would reach 1 under a proportional load."""
    found = [
        v.f.max(initial=0.0) ** (1.0 / g.degree)
        for g, v in analysis.at_tips()
        if v.f.max(initial=0.0) > 0.0
    ]
    if found and analysis.time > 0.0:
        return float(analysis.time * min(1.02 / min(max(found), 1.0), 1e3))
    return max(1.0, 2.0 * analysis.time)


def _curves_have_ended(driver: StepDriver) -> bool:
    """Whether growth follows curves of time alone, which end before the step does."""
    ends = [g.evaluator.ends for g, v in driver.analysis.at_tips() if len(v.tips)]
    if not ends or max(ends) > driver.analysis.time:
        return False
    return driver.end_time >= LARGE and not driver.breaks_ahead()


def _never(driver: StepDriver) -> str:
    """Why raising the load made nothing grow."""
    analysis, breaks = driver.analysis, driver.breaks
    # with bonds behind the front it is a toughness beyond all bounds that leaves f at round-off
    if _only_round_off(driver) and _on_last_bonds(analysis):
        left = counted(sum(int(g.front.bonded.sum()) for g in analysis.active), "bonded node")
        return f"total separation but for {left}, about which the bodies turn freely: {_NEVER}"
    if not np.any(analysis.loads_at(analysis.time + 1.0)):
        return "no load acts in this step and no support moves, so the criterion is not reached"
    last = max([analysis.time, *breaks])
    if breaks and np.array_equal(analysis.loads_at(last), analysis.loads_at(last + 1.0)):
        return (
            f"the loads stay as they are from time {last:g} on, where their amplitudes end, "
            "and the criterion is not reached"
        )
    return _NEVER


# -- controlled opening ----------------------------------------------------------------------------


def _fills(load: object) -> bool:
    """Whether a load is a pressure that follows the crack."""
    return isinstance(load, CrackPressure)


SAME_OPENING = 1e-9
"""Openings that differ by less than this part of them are the same."""


class OpeningControl:
    """The controlled opening of a step.

    Args:
        solver: The solver, with its monitors.
        cracks: Active cracks.
        names: Name of a monitor, or of two of which the opening is the first less the second; or of
            a pressure that follows the crack, whose volume is controlled.

    Attributes:
        name: What is controlled, in words.
        opening: Opening at the last onset, length.

    Raises:
        InputError: No monitor has that name, faces have friction, or bonds are cohesive.
    """

    def __init__(self, solver: Solver, cracks: Sequence[Crack], names: Sequence[str]) -> None:
        self._solver = solver
        self.name = " - ".join(names)
        self.opening = 0.0
        titles = [m.title for m in solver.monitors]
        first = solver.n_loads - len(solver.loads)
        self._volumes = {x.title: first + k for k, x in enumerate(solver.loads) if _fills(x)}
        self._weight = np.zeros(len(titles))
        self._volume = np.zeros(solver.n_loads)
        self._preloaded = False
        for name, sign in zip(names, (1.0, -1.0), strict=False):
            if name in titles:
                self._weight[titles.index(name)] += sign
            elif name in self._volumes:
                self._volume[self._volumes[name]] += sign
            else:
                unknown_name(
                    "monitor or pressure that follows the crack", name, [*titles, *self._volumes]
                )
        if solver.system.friction is not None:
            raise InputError(
                "stepping='opening' moves the load back at each release, and faces with friction "
                "would slip back with it; leave friction out, or prescribe displacements"
            )
        for g in cracks:
            if g.opening_driven:
                raise InputError(
                    f"interface '{g.title}' is released progressively with its opening, which "
                    "stepping='opening' does not have; use StepRelease(), or prescribe "
                    "displacements"
                )

    @property
    def close(self) -> float:
        """Openings that differ by less are the same, length."""
        return SAME_OPENING * abs(self.opening)

    def begin_at(self, state: Equilibrium) -> None:
        """Let the opening grow from that of a state, in which constant loads act already."""
        self._preloaded = True
        self.opening = self.excess(state)

    def excess(self, state: Equilibrium) -> float:
        """What the opening of a state has over that of the last onset, length."""
        values = self._solver.system.monitors(state)[: len(self._weight)]
        more = sum(
            float(self._volume[self._volumes[fluid.pressure.title]]) * fluid.more_volume()
            for fluid in self._solver.fluids
        )
        return float(self._weight @ values + self._volume @ state.conjugate) + more - self.opening

    def reach(self, state: Equilibrium) -> None:
        """Control the opening of a state from now on.

        Raises:
            InputError: It is not positive, or smaller than the one before.
        """
        more = self.excess(state)
        positive = self._preloaded or self.opening + more > 0.0
        if not positive or more < -self.close:
            raise InputError(
                f"stepping='opening': '{self.name}' went from {self.opening:.6g} to "
                f"{self.opening + more:.6g} up to an onset; control a displacement that grows "
                "with load and crack, in its positive direction"
            )
        self.opening += more
