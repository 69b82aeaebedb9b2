"""The driver of a step of explicit dynamics: increments, releases, rows, checks, the end."""

from __future__ import annotations

import math
import time as clock
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.checks import format_point
from fxcrack.criteria.evaluator import TipValues
from fxcrack.history import Row
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.driver import CheckpointPoint, why_ended
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.explicit_increments import Increments
from fxcrack.steps.explicit_range import LinearRange
from fxcrack.steps.explicit_release import ReleaseControl
from fxcrack.steps.explicit_rows import CrackSpeed, explicit_row, imbalance
from fxcrack.steps.rows import Observer

FOLLOW = 20
"""Increments between looks at where fronts and faces of bodies that move far are now."""
LOOK = 10
"""Increments between looks at how far bodies have strained."""
STRAINED = 0.01
"""Change of strain from which on the stable increment may be another one."""
CHECK = 100
"""Increments between looks at signals and checkpoints."""
_NONE = 1e-9
"""Part of a row that is none."""
_FEW = 3.0
"""Increments in a step from which on the bodies can have moved."""
_SHORT = 3.0
"""Shortening of the increments by bulk viscosity that is told."""
_NONLINEAR = 1e3
"""By how much the energies of nonlinear bodies may be off more than those of linear ones."""
_OVERLAP = 1e-2
"""Overlaps below this fraction of the largest jump are not reported."""


class ExplicitDriver:
    """One step of explicit dynamics.

    Args:
        analysis: The analysis, its cracks activated.
        solver: Its solver.
        step: Controls and end conditions.
        observer: Called with every row.
        checkpoint_point: Called where the step could be resumed.
        resume: Progress of an earlier run of the step from which to continue.
    """

    def __init__(
        self,
        analysis: Analysis,
        solver: ExplicitSolver,
        step: Explicit,
        *,
        observer: Observer | None = None,
        checkpoint_point: CheckpointPoint | None = None,
        resume: dict[str, Any] | None = None,
    ) -> None:
        self.analysis, self.solver, self.step = analysis, solver, step
        self._observer, self._checkpoint_point = observer, checkpoint_point
        self._resume = resume
        self._start = float(resume["start"]) if resume else analysis.time
        self._n = 0 if resume is None else int(resume["increment"])
        self._rows = 0 if resume is None else int(resume["rows"])
        self.controls = [ReleaseControl(solver, g) for g in analysis.active]
        self.speeds = [CrackSpeed(g, self._start) for g in analysis.active]
        if resume is not None:
            for speed, passed in zip(self.speeds, resume["passed"], strict=True):
                speed.passed = [(float(t), float(a)) for t, a in passed]
        self._follows = solver.bodies.finite
        changes = solver.stability.changes
        self._adapts = changes and step.dt is None
        self._may_become_unstable = changes and not self._adapts
        self._told = False
        self._range = LinearRange(solver, analysis.said)
        self._good: tuple[Any, list[int], int] | None = None
        self._may_overlap = np.zeros(solver.lumped.n_rows, dtype=bool)
        for pair, rows in zip(solver.pairs, solver.row_of, strict=True):
            self._may_overlap[rows[rows >= 0]] = not pair.interface.contact

    def run(self) -> str:
        """Proceed until an end condition holds; collective.

        Returns:
            Why the step ended.
        """
        start = clock.perf_counter()
        analysis, solver = self.analysis, self.solver
        length = self.step.end_time - self._start
        if not length > 0.0:
            return f"time {self.step.end_time:g} reached"
        self._increments = increments = Increments(
            self._start, self.step.end_time, solver.dt, solver.stable
        )
        if self._resume is not None and "increments" in self._resume:
            increments.restore(self._resume["increments"])
        solver.dt = increments.dt
        # a further step of bodies that move, or a chosen increment, may be as short as it likes
        if length < _FEW * solver.dt and self.step.dt is None and not solver.increments:
            log.warn(
                "Explicit: increments are %g long and the step is over after %d of them, too few "
                "for anything to move; are end time and density of the same units as moduli and "
                "lengths? With mm, N and s a density is in tonnes per mm^3 (2.7e-9 for aluminium)",
                solver.dt,
                math.ceil(length / solver.dt),
            )
        now = analysis.loads_at(increments.time(self._n))
        resumed = self._resume is not None
        while True:
            n = self._n
            if self._adapts and not resumed:
                self._adapt(n)
            analysis.time = increments.time(n)
            then = analysis.loads_at(increments.time(n + 1))
            if self._follows and n % FOLLOW == 0:
                solver.follow_bodies()
            elif self._follows:
                solver.follow_curved()
            solver.begin(now, then)
            released = self._release()
            if not resumed:
                reason = self._ended(released, last=increments.is_end(n))
                if reason or self._row_due(n):
                    self._evaluate()
                    stopped = self._record("end" if reason else "increment" if n else "start")
                    reason = stopped or reason
                if reason:
                    solver.timings.add("increments", start)
                    return reason
                if n % CHECK == 0:
                    self._mark(n)
            resumed = False
            solver.finish()
            self._n, now = n + 1, then
            analysis.balance.increment += 1

    def _adapt(self, n: int) -> None:
        """Let the increments from number n on follow what is stable now; collective.

        Bodies strain little in LOOK increments; a shock comes within one.
        """
        solver, increments, regular = self.solver, self._increments, n % LOOK == 0
        if solver.bodies.finite:
            changed = regular and solver.stability.strained() >= STRAINED
        else:
            changed = solver.damping_changed(fallen=regular)
        if changed:
            increments.adapt(n, solver.renew_stable_increment(), self.step.safety)
        elif regular and increments.may_grow and not solver.bodies.finite:
            increments.adapt(n, solver.stable, self.step.safety)
        solver.dt = increments.dt
        self._tell_of_short_increments()

    def _tell_of_short_increments(self) -> None:
        """Say once where bulk viscosity has made increments much shorter."""
        increments = self._increments
        if self._told or self.solver.bodies.finite or increments.shortened < _SHORT:
            return
        self._told = True
        log.warn(
            "bulk viscosity has shortened the increments of explicit dynamics by a factor of %.2g "
            "at time %g, where bodies are compressed at a rate that small strain is not meant "
            "for; take a smaller quadratic part, Explicit(bulk=(%g, ...))",
            increments.shortened,
            self.solver.at,
            self.step.bulk[0],
        )

    def _release(self) -> bool:
        """Release nodes until none is critical; whether any was."""
        solver, any_released = self.solver, False
        while True:
            found: list[tuple[ReleaseControl, TipValues, CrackSpeed]] = []
            for control, speed in zip(self.controls, self.speeds, strict=True):
                values = control.critical()
                if values is not None:
                    found.append((control, values, speed))
            if not found:
                return any_released
            for control, values, speed in found:
                control.release(values)
                speed.note(self.analysis.time)
            solver.accelerate()
            any_released = True

    def _evaluate(self) -> None:
        self.analysis.tip_values = [control.values() for control in self.controls]

    def _ended(self, released: bool, *, last: bool) -> str:
        """Why the step ends now; empty if it continues."""
        if last:
            return f"time {self.step.end_time:g} reached"
        if not released and self._n:
            return ""
        self._evaluate()
        return why_ended(self.analysis, self.step.ends, self.step.end_time)

    # -- rows and checks -----------------------------------------------------------------

    def _row_due(self, n: int) -> bool:
        """Whether a row belongs to an increment: the first, and evenly spaced ones."""
        passed = self._increments.progress(n) * self.step.rows + _NONE
        if passed >= self._rows:
            self._rows = int(passed) + 1
            return True
        return False

    def _record(self, event: str) -> str:
        """Add a row; returns why the step must stop, if it must."""
        analysis = self.analysis
        row: Row = explicit_row(analysis, self.solver, event, self.speeds)
        off = imbalance(row)
        limit = self.step.tolerance * (1.0 if self.solver.bodies.linear else _NONLINEAR)
        if not off <= limit:
            return self._stop(off, limit)
        self._warn_of_overlap()
        self._range.look()
        if self._may_become_unstable and event == "increment":
            stable = self.solver.renew_stable_increment()
            if stable < self.solver.dt:
                return self._stopped(
                    f"motion has lowered the stable increment to {stable:g}, below dt = "
                    f"{self.solver.dt:g}; take Explicit(dt={0.9 * stable:.2g}), or leave dt out "
                    "for increments that follow the stable one"
                )
        analysis.history.append(row)
        if self._observer is not None:
            self._observer(event, row)
        released = [g.n_released for g in analysis.active]
        self._good = self.solver.remember(), released, self._n
        return ""

    def _stop(self, off: float, limit: float) -> str:
        """Return to the last good state, and say why."""
        analysis, solver = self.analysis, self.solver
        what = (
            "energies or motions are no numbers any more"
            if off != off
            else f"the energy balance is off by {off:.2e} of the energies, more than {limit:.1e}"
        )
        at = analysis.time
        if self._good is not None:
            saved, released, self._n = self._good
            for g, n in zip(analysis.active, released, strict=True):
                again = np.array([r.node for r in g.records[n:]], dtype=np.int64)
                if len(again):
                    g.front.bond(again)
                del g.records[n:]
                g.n_released = n
            solver.recall(saved)
            analysis.time = solver.at
            self._evaluate()
        reason = (
            f"stopped at time {at:g}: {what}; the motion is unstable. The state is that of time "
            f"{analysis.time:g}. Take a smaller Explicit(safety=...) or dt"
        )
        log.warn("%s", reason)
        return reason

    def _stopped(self, why: str) -> str:
        reason = f"stopped: {why}"
        log.warn("%s", reason)
        return reason

    def _warn_of_overlap(self) -> None:
        """Warn once per interface where faces without contact pass through each other."""
        solver = self.solver
        if not self._may_overlap.any():
            return
        dynamics = solver.dynamics
        rows = self._may_overlap & ~dynamics.elastic.active
        gap, row = dynamics.open_pairs.smallest_gap(rows, dynamics.gap)
        if row < 0 or gap >= -_OVERLAP * float(np.abs(solver.present.jumps).max()):
            return
        p = int(solver.lumped.pair[row])
        self._may_overlap[solver.lumped.pair == p] = False
        pair = solver.pairs[p]
        log.warn(
            "interface '%s': open faces overlap at %s, by %.3g, at time %g, and nothing keeps them "
            "apart: arms that are torn apart close again and drive the crack on. Add contact=True "
            "to the Interface",
            pair.title,
            format_point(pair.surface.x[solver.lumped.slave_node[row]]),
            -gap,
            solver.at,
        )

    def _mark(self, n: int) -> None:
        """Where the step could be resumed: signals, checkpoints."""
        if self._checkpoint_point is not None:
            passed = [[list(p) for p in speed.passed] for speed in self.speeds]
            self._checkpoint_point(
                {
                    "start": self._start,
                    "increment": n,
                    "rows": self._rows,
                    "passed": passed,
                    "increments": self._increments.state(),
                }
            )


def run_explicit(
    analysis: Analysis, solver: ExplicitSolver, step: Explicit, **controls: Any
) -> str:
    """Run a step of explicit dynamics; collective.

    Args:
        analysis: The analysis, prepared for the step, its cracks activated.
        solver: Its solver.
        step: Controls and end conditions.
        **controls: Observer, checkpoints and resumption, as for :class:`ExplicitDriver`.

    Returns:
        Why the step ended.
    """
    return ExplicitDriver(analysis, solver, step, **controls).run()


__all__ = ["ExplicitDriver", "run_explicit"]
