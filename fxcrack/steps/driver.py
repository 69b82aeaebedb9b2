"""The driver of one step: its controls, its end, its rows, and the path along its load.

How the step proceeds is a function of the driver, one per stepping: event, path and opening in
:mod:`fxcrack.steps.quasi_static`, then :mod:`fxcrack.steps.increment_stepping` and
:mod:`fxcrack.steps.cyclic`.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.checks import counted
from fxcrack.base.errors import (
    ComesApart,
    ConvergenceError,
    EnergyImbalance,
    InputError,
    SolverError,
)
from fxcrack.base.timings import Timings
from fxcrack.condensation.mumps_schur import HELD_BY_ROUND_OFF
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.history import Row
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.crack import Crack
from fxcrack.steps.end_conditions import CrackLength, Releases, Time, Until
from fxcrack.steps.increment_control import TooManyCutbacks
from fxcrack.steps.load_path import LinearLoadPath, LoadPath
from fxcrack.steps.newton_path import NewtonLoadPath
from fxcrack.steps.rows import Observer, Recorder
from fxcrack.steps.static import Static

CheckpointPoint = Callable[[dict[str, Any]], None]
"""Called between two increments or releases with the progress of the step, plain values."""

BEYOND = 1e30
"""A step without an end time that loads beyond this time would never end."""

LARGE = 1e60
"""A time that is never reached: the step has no end time."""

_NOTHING = 1e-9
"""Part of a step that is none."""


class StepDriver:
    """One step of an analysis.

    Args:
        analysis: The analysis, prepared for the step, its cracks activated.
        step: Controls and end conditions.
        observer: Called with every row.
        checkpoint_point: Called where the step could be resumed from the state of the analysis and
            the progress it is given.
        resume: Progress of an earlier run of the step from which to continue.
        columns: Further columns of every row.

    Attributes:
        record: Adds a row of the present state to the history, given the name of the event.
        path: The way along the load.
        breaks: Times at which an amplitude changes its slope.
        end_time: Time at which the step ends; :data:`LARGE` if it has none.
        preloaded: Whether constant loads act beside the one that the step moves forth and back.

    Raises:
        InputError: The bodies and the stepping are not compatible.
    """

    def __init__(
        self,
        analysis: Analysis,
        step: Static,
        *,
        observer: Observer | None = None,
        checkpoint_point: CheckpointPoint | None = None,
        resume: dict[str, Any] | None = None,
        columns: Callable[[], Row] | None = None,
    ) -> None:
        self.analysis = analysis
        self.step = step
        self.resume = resume
        self.breaks = analysis.load_breaks()
        self.end_time = min([u.time for u in step.ends if isinstance(u, Time)], default=LARGE)
        self.record = Recorder(analysis, observer, columns)
        self.preloaded = False
        self._checkpoint_point = checkpoint_point
        solver = analysis.solver
        self.path: LoadPath
        if isinstance(solver, NewtonSolver):
            self.path = NewtonLoadPath(analysis, solver, step, self.record)
        else:
            self.path = LinearLoadPath(analysis, self.record)

    def run(self, stepping: Callable[[StepDriver], str]) -> str:
        """Proceed until an end condition holds; collective.

        Args:
            stepping: Proceeds from the equilibrium at the start, and returns why it ended.

        Returns:
            Why the step ended.
        """
        analysis, timings = self.analysis, self.analysis.solver.timings
        begin = analysis.time
        start, factored = clock.perf_counter(), _seconds_of_factorisations(timings)
        analysis.update_tips()
        if self.resume is None:
            self._apply_loads()
            self.record("start")
        try:
            reason = stepping(self)
        except (NotPositiveDefinite, ComesApart) as error:
            tips = any(len(v.tips) for v in analysis.tip_values)
            done = (analysis.time - begin) / (self.end_time - begin)
            at_once = self.end_time < LARGE and done <= _NOTHING
            if isinstance(error, NotPositiveDefinite) and not tips and at_once:
                # round-off alone decides whether faces part before or after the first load
                raise SolverError(held_by_contact(error.why)) from error
            reason = _separated(error, releasing=tips)
        except (TooManyCutbacks, ConvergenceError, EnergyImbalance) as error:
            reason = f"stopped: {error}"
            log.warn("%s", reason)
        self.record("end")
        reason += self._overflow()
        timings.add("growth", start + _seconds_of_factorisations(timings) - factored)
        return reason

    def _overflow(self) -> str:
        """Words for the reason where energies of the last row are no finite numbers, and a warning.

        Energies are sums of squares: they overflow first.
        """
        row = self.analysis.history[-1]
        lost = [
            name
            for name in ("strain_energy", "external_work", "released_energy")
            if not np.isfinite(float(row.get(name, 0.0)))
        ]
        if not lost:
            return ""
        words = (
            f"; but numbers overflow ({', '.join(lost)} of the last row), so no result holds: "
            "state loads, moduli and times of a size that is physical in your units"
        )
        log.warn("the step ended%s", words)
        return words

    def _apply_loads(self) -> None:
        """Apply loads that are there from the first moment of the step, in proportion."""
        analysis = self.analysis
        if isinstance(analysis.solver, NewtonSolver) and analysis.solver.free_start:
            return  # the first increment applies them
        wanted, present = analysis.loads_at(analysis.time), analysis.solver.state.loads
        if np.abs(wanted - present).max(initial=0.0) > 1e-12 * np.abs(wanted).max(initial=0.0):
            self.path.over_increment(analysis.time)
            analysis.condensed.commit()
            analysis.evaluate_tips()

    def checkpoint_point(self, **progress: Any) -> None:
        """Mark a consistent state; ``progress`` is what the stepping needs to continue from it."""
        if self._checkpoint_point is not None:
            self._checkpoint_point(progress)

    def ended(self) -> str:
        """Why the step ends in the present state; empty if it continues."""
        return why_ended(self.analysis, self.step.ends, self.end_time)

    def breaks_ahead(self) -> list[float]:
        """Later times at which an amplitude, a ramp or a criterion changes its slope."""
        small = 1e-12 * abs(self.analysis.time)
        own = [t for ramp in self.analysis.ramps for t in ramp.breaks()]
        own += [t for g in self.analysis.active for t in g.evaluator.breaks()]
        return [b for b in (*self.breaks, *own) if b > self.analysis.time + small]


def why_ended(analysis: Analysis, ends: Sequence[Until], end_time: float) -> str:
    """Why a step ends in the present state; empty if it continues.

    Args:
        analysis: The analysis, its tip values up to date.
        ends: End conditions.
        end_time: Time at which the step ends; :data:`LARGE` if it has none.
    """
    for end in ends:
        if isinstance(end, Time) and analysis.time >= end.time * (1.0 - 1e-14):
            return f"time {end.time:g} reached"
        if isinstance(end, Releases):
            if sum(g.n_released for g in analysis.active) >= end.count:
                return f"{counted(end.count, 'node')} released"
        if isinstance(end, CrackLength):
            g = _crack_of(analysis, end)
            tips = analysis.tip_values[analysis.active.index(g)].tips
            if g.extent.length(tips) >= end.length * (1.0 - 1e-9):
                return f"crack length {end.length:g} of '{g.title}' reached"
    if analysis.active and not any(len(v.tips) for v in analysis.tip_values):
        if end_time < LARGE and analysis.time < end_time:
            return ""
        opened = all(not g.front.bonded.any() for g in analysis.active)
        return "total separation: no crack tip is left" if opened else "no crack tip is left"
    return ""


def _crack_of(analysis: Analysis, end: CrackLength) -> Crack:
    for g in analysis.active:
        if g.debond.interface is end.interface:
            return g
    title = end.interface.title
    if any(g.title == title for g in analysis.active):
        raise InputError(
            f"CrackLength was given another Interface that is called '{title}' as well; give it "
            "the one that the Debond of this scene has"
        )
    known = ", ".join(f"'{g.title}'" for g in analysis.active) or "none"
    raise InputError(
        f"CrackLength names interface '{title}', which has no active Debond in this step; those "
        f"that have one: {known}"
    )


def _seconds_of_factorisations(timings: Timings) -> float:
    return sum(v for k, v in timings.seconds.items() if k.startswith("factor"))


def held_by_contact(why: str) -> str:
    """What to do about bodies that only contact could hold.

    Args:
        why: Which body can move, and how, as far as it is known.
    """
    return (
        "there is no equilibrium: open faces would have to hold a body that nothing presses "
        f"against them yet{f' ({why})' if why else ''}. Hold it by supports, prescribe its "
        "displacement until it touches, or let a weak foundation hold it: Scene(..., "
        "stabilise={'name of its cell group': 1e-6})"
    )


def _separated(error: NotPositiveDefinite | ComesApart, *, releasing: bool) -> str:
    what = (
        "the load exceeds what is left of the interface"
        if isinstance(error, ComesApart)
        else "releasing the next node would leave a body unsupported"
    )
    if isinstance(error, NotPositiveDefinite) and not releasing:
        what = "faces part whose contact alone held a body, which stabilise= of the scene may hold"
    if isinstance(error, NotPositiveDefinite) and error.why == HELD_BY_ROUND_OFF:
        what = f"releasing the next node, {error.why}"
    elif isinstance(error, NotPositiveDefinite) and error.why:
        what += f" ({error.why})"
    reason = f"total separation: {what}; the step ends in the last equilibrium before it"
    log.warn("%s", reason)
    return reason
