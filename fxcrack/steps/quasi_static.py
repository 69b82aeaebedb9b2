"""Marching a quasi-static step: load, find where f = 1, let go, find the new equilibrium.

The way along the load is :class:`~fxcrack.steps.load_path.LoadPath`'s.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.errors import ComesApart, ConvergenceError, InputError, unknown_name
from fxcrack.criteria.evaluator import TipValues
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.history import Row
from fxcrack.solvers.base import Solver
from fxcrack.steps.crack import Crack
from fxcrack.steps.driver import LARGE
from fxcrack.steps.increment_stepping import IncrementControl, TooManyCutbacks
from fxcrack.steps.load_path import BEYOND, LoadPath

Observer = Callable[[str, Row], None]

_AT_TOP, _NEAR_TOP = 1e-6, 1e-2
"""How far f may differ from the upper end of its window by what one node has of the next, and the
fraction of the window in which it is so near that end that cutting back gains nothing."""
_NEVER = (
    "the criterion is not reached however large the load becomes; the step ends where that search "
    "began"
)


class QuasiStaticDriver(LoadPath):
    """One quasi-static step on a condensed model: the three ways to step.

    Arguments as for :class:`~fxcrack.steps.driver.StepDriver`.

    Attributes:
        control: Size of the next increment.
        done: Increments tried so far.
    """

    def __init__(self, *parts: Any, **carried: Any) -> None:
        super().__init__(*parts, **carried)
        self.control = IncrementControl(self.step)
        self.done = 0
        if self._resume is not None:
            self.control.size = self._resume["size"]
            self.control.cutbacks = self._resume["cutbacks"]
            self.done = self._resume["done"]

    def carried(self) -> dict[str, Any]:
        """Energies and counters, those of increments included."""
        control = {"size": self.control.size, "cutbacks": self.control.cutbacks}
        return {**super().carried(), **control, "done": self.done}

    def run(self) -> str:
        """March until an end condition holds; returns why the step ended."""
        for g in self.cracks:
            viscosity, law = g.criterion.viscosity, g.debond.release
            over_increments = law.driver == "increments"
            if over_increments and self.step.stepping != "increment":
                raise InputError(
                    f"interface '{g.title}' is released by {law} over increments, which "
                    f"stepping='{self.step.stepping}' does not have; use stepping='increment', "
                    "or a ramp with the opening (no number of increments)"
                )
            if viscosity > 0.0 and over_increments:
                raise InputError(
                    f"interface '{g.title}': viscosity delays a release at once or with the "
                    f"opening, not {law} over increments; use viscosity=0 or another release"
                )
            if viscosity > 0.0 and self.step.stepping != "increment":
                raise InputError(
                    f"interface '{g.title}': viscosity acts over increments of time, which "
                    f"stepping='{self.step.stepping}' does not have; use stepping='increment' "
                    "or viscosity=0"
                )
        start = clock.perf_counter()
        before = {k: v for k, v in self.solver.timings.seconds.items() if k.startswith("factor")}
        self._update_tips()
        if self._resume is None:
            self._load_at_once()
            self._record("start")
        try:
            if self.step.stepping == "increment":
                reason = self._run_increments()
            elif self.step.stepping == "path":
                reason = self._run_path()
            elif self.step.stepping == "opening":
                reason = self._run_opening()
            else:
                reason = self._run_events()
        except (NotPositiveDefinite, ComesApart) as error:
            reason = self._separated(error)
        except (TooManyCutbacks, ConvergenceError) as error:
            reason = f"stopped: {error}"
            log.warn("%s", reason)
        self._record("end")
        after = {k: v for k, v in self.solver.timings.seconds.items() if k.startswith("factor")}
        inside = sum(after.values()) - sum(before.values())
        self.solver.timings.add("growth", start + inside)
        return reason

    def _run_events(self) -> str:
        while True:
            self._at_checkpoint_point()
            reason = self._ended()
            if reason:
                return reason
            if max(self._largest()) >= 1.0 - 1e-9:
                self._record("onset")
                self._release_critical()
                continue
            if self._curves_have_ended():
                return "the curves of crack length against time have ended"
            if not self._load_to_event():
                return self._ended() or self._never()
            if max(self._largest()) < 1.0 - 1e-9 and not self._ended():
                self._record("bend")

    def _never(self) -> str:
        """Why the load was raised in vain."""
        if not np.any(self.loads_at(self.time + 1.0)):
            return "no load acts in this step and no support moves, so the criterion is not reached"
        last = max([self.time, *self.breaks])
        if self.breaks and np.array_equal(self.loads_at(last), self.loads_at(last + 1.0)):
            return (
                f"the loads stay as they are from time {last:g} on, where their amplitudes end, "
                "and the criterion is not reached"
            )
        return _NEVER

    def _only_proportional(self) -> None:
        """Refuse what a load that moves forth and back cannot do."""
        stepping = f"stepping='{self.step.stepping}'"
        if self.breaks:
            raise InputError(
                f"{stepping} follows one proportional load; use the default amplitude for "
                "all loads of the step"
            )
        for g in self.cracks:
            if g.evaluator.breaks() or g.debond.release.driver == "time" or self._ramps:
                raise InputError(
                    f"interface '{g.title}' grows or lets go with time, which {stepping} does "
                    "not have: it moves the load forth and back; use 'event' or 'increment'"
                )

    def _run_opening(self) -> str:
        self._only_proportional()
        control = OpeningControl(self.solver, self.cracks, self.step.monitors)
        while True:
            self._at_checkpoint_point()
            reason = self._ended()
            if reason:
                return reason
            if max(self._largest()) < 1.0 - 1e-9 and not self._load_to_event():
                return self._ended() or self._never()
            if max(self._largest()) < 1.0 - 1e-9:
                continue  # the end time came first
            control.reach(self.solver.state)
            self._record("onset")
            self._free()
            more = control.excess(self.solver.state)
            same = abs(more) <= control.close
            if not same and not (more > 0.0 and self._unload_until(control.excess, control.close)):
                raise InputError(
                    f"stepping='opening': nodes let go at {self.time:.6g} times the load, and "
                    f"'{control.name}' = {control.opening:.6g} is not found again at less; control "
                    "a displacement nearer to the crack, or use stepping='path'"
                )
            self._record("release")

    def _run_path(self) -> str:
        self._only_proportional()
        while True:
            self._at_checkpoint_point()
            reason = self._ended()
            if reason:
                return reason
            if max(self._largest()) > 1.0 + 1e-9:
                self._unload_to_event()
            elif max(self._largest()) < 1.0 - 1e-9 and not self._load_to_event():
                return self._ended() or self._never()
            self._record("onset")
            self._release_critical()

    def _run_increments(self) -> str:
        control, creeps = self.control, False
        while True:
            self._at_checkpoint_point()
            reason = self._ended()
            if reason:
                return reason
            self.done += 1
            if self.done > self.step.max_increments:
                return (
                    f"stopped: {self.step.max_increments} increments done without reaching the "
                    "end condition; raise max_increments or maximum, or end the step at a Time"
                )
            if self.time > BEYOND and self._end_time >= LARGE:
                return "the criterion is not reached however large the load becomes"
            control.size = max(control.size, min(self._scaled(), self.step.maximum))
            met = self._met_at_start()
            smallest = creeps or any(met)
            size = self.step.minimum if smallest else control.size
            target = min([self.time + size, self._end_time, *self._breaks_ahead()])
            books = self._snapshot()
            self.increment += 1
            try:
                pieces = self._pieces(target)
            except (NotPositiveDefinite, ComesApart):
                self._rollback(books)  # contact and bonds have changed half of the way
                raise
            except ConvergenceError as error:
                self._rollback(books)
                control.rejected(target - self.time, str(error))
                continue
            self._follow(pieces, target)
            values = self._evaluate()
            excess = [
                v.f.max(initial=0.0) - self._upper(g)
                for g, v, no_matter in zip(self.cracks, values, met, strict=True)
                if not no_matter
            ]
            if max(excess, default=-1.0) > (_AT_TOP if creeps else 1e-12):
                used = target - self._rollback(books)
                creeps = not creeps and self._cuts_in_vain(values, used)
                if not creeps:
                    control.rejected(used, f"f = {max(v.f.max(initial=0.0) for v in values):.4g}")
                continue
            self._values = values
            self.solver.commit()
            for ramp in self._ramps:
                ramp.accept(self.time, self.solver)
            self._record("increment")
            if not smallest:
                control.accepted()
            creeps = False
            while self._any_ready() and not self._ended():
                self._release_critical(all_ready=True)
                control.suggest(self._first_increment())
                if not self._may_run_on():
                    break

    def _scaled(self) -> float:
        """Increment that brings a proportional load near the first release, else 0."""
        beta = self.step.linear_scaling
        if beta is None or self.time <= 0.0 or any(g.n_released for g in self.cracks):
            return 0.0
        reach = [
            float(v.f.max()) ** (-1.0 / g.degree)
            for g, v in zip(self.cracks, self._values, strict=True)
            if v.f.max(initial=0.0) > 0.0
        ]
        return max(self.time * (beta * min(reach) - 1.0), 0.0) if reach else 0.0

    def _any_ready(self) -> bool:
        """Whether some f has reached the lower end of its window."""
        return any(
            v.f.max(initial=0.0) >= g.criterion.release_range[0]
            for g, v in zip(self.cracks, self._values, strict=True)
        )

    def _first_increment(self) -> float:
        """Increment suggested after nodes have just begun to let go, inf without a suggestion."""
        return min(
            (r.suggested_increment for r in self._ramps if r.by_time and r.start == self.time),
            default=np.inf,
        )

    def _upper(self, g: Crack) -> float:
        upper, unstable = g.criterion.release_range[1], g.criterion.unstable_tolerance
        if unstable is not None and g.n_released:
            upper = max(upper, 1.0 + unstable)
        return upper

    def _met_at_start(self) -> list[bool]:
        """Per interface, whether f is in its window already at the start of an increment.

        That goes for criteria other than energy release rates, right after nodes have let go. The
        smallest increment is used then, and the nodes go at its end whatever their f is: cutting
        back could not make it smaller.
        """
        return [
            g.criterion.smallest_increment_when_met
            and bool(v.f.max(initial=0.0) >= g.criterion.release_range[0])
            for g, v in zip(self.cracks, self._values, strict=True)
        ]

    def _cuts_in_vain(self, after: list[TipValues], used: float) -> bool:
        """Whether the cutbacks left cannot keep f in its window, and the smallest increment can.

        So it is where growth is neutral: f stays what it was when a node goes, at the upper end of
        its window at last. The next node then goes at the same load.

        Args:
            after: What the criteria said at the end of the increment that was undone.
            used: Its size, time.
        """
        left = self.step.cutback ** (self.step.max_cutbacks - self.control.cutbacks)
        left = max(left, self.step.minimum / used)
        for g, v, w in zip(self.cracks, self._values, after, strict=True):
            upper, f, later = self._upper(g), v.f.max(initial=0.0), w.f.max(initial=0.0)
            if later <= upper:
                continue
            low = g.criterion.release_range[0]
            near = f >= upper - _NEAR_TOP * (upper - low) or left * (later - f) > upper - f
            if not (low <= f <= upper + _AT_TOP and near):
                return False
        return True

    def _may_run_on(self) -> bool:
        """Whether more nodes may go at this load: within the unstable growth tolerance."""
        over = [
            (float(v.f.max(initial=0.0)), g.criterion.unstable_tolerance)
            for g, v in zip(self.cracks, self._values, strict=True)
            if v.f.max(initial=0.0) >= g.criterion.release_range[0]
        ]
        return all(t is not None and f <= 1.0 + t for f, t in over)


SAME_OPENING = 1e-9
"""Openings that differ by less than this part of them are the same."""


class OpeningControl:
    """The controlled opening of a step.

    Args:
        model: The bodies, with their monitors.
        cracks: Activated debonds.
        names: Name of a monitor, or of two of which the opening is the first less the second.

    Attributes:
        name: What is controlled, in words.
        opening: Opening at the last onset, length.

    Raises:
        InputError: No monitor has that name, faces rub, or bonds soften.
    """

    def __init__(self, solver: Solver, cracks: Sequence[Crack], names: Sequence[str]) -> None:
        self._model = solver
        self.name = " - ".join(names)
        self.opening = 0.0
        titles = [m.title for m in solver.monitors]
        self._weight = np.zeros(len(titles))
        for name, sign in zip(names, (1.0, -1.0), strict=False):
            if name not in titles:
                unknown_name("monitor", name, titles)
            self._weight[titles.index(name)] += sign
        if solver.system.friction is not None:
            raise InputError(
                "stepping='opening' moves the load back at each release, and faces with friction "
                "would slip back with it; leave friction out, or prescribe displacements"
            )
        for g in cracks:
            if g.opening_driven:
                raise InputError(
                    f"interface '{g.title}' lets go progressively with its opening, which "
                    "stepping='opening' does not have; release by Step, or prescribe displacements"
                )

    @property
    def close(self) -> float:
        """Openings that differ by less are the same, length."""
        return SAME_OPENING * self.opening

    def excess(self, state: Equilibrium) -> float:
        """What the opening of a state has over that of the last onset, length."""
        values = self._model.system.monitors(state)[: len(self._weight)]
        return float(self._weight @ values) - self.opening

    def reach(self, state: Equilibrium) -> None:
        """Control the opening of a state from now on.

        Raises:
            InputError: It is not positive, or smaller than the one before.
        """
        more = self.excess(state)
        if self.opening + more <= 0.0 or more < -self.close:
            raise InputError(
                f"stepping='opening': '{self.name}' went from {self.opening:.6g} to "
                f"{self.opening + more:.6g} up to an onset; control a displacement that grows "
                "with load and crack, in its positive direction"
            )
        self.opening += more
