"""Steps of load cycles: solve one, jump over those that are like it, release, solve the next.

The cycle itself is solved by :mod:`fxcrack.steps.cycle_path`. The rates at the beginning of an
element say which tips are next (:func:`fxcrack.criteria.cycle_jump`, over all interfaces),
those at its end, once these are released, in how many cycles
(:func:`fxcrack.criteria.element_cycles`). Where that takes too many, the release is undone.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from fxcrack.base.arrays import Bools
from fxcrack.criteria import (
    CycleJump,
    cycle_jump,
)
from fxcrack.criteria.cycle_rates import joined
from fxcrack.history import Row
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.cycle_equilibria import corners_of, equilibria_of, load_to
from fxcrack.steps.cycle_path import StabilisedCycle
from fxcrack.steps.cycle_state import TipCycle
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.driver import StepDriver
from fxcrack.steps.element_growth import (
    TipsBefore,
    advance,
    after_jump,
    cycles_of,
    cyclic_parts,
    lengths_of,
    together,
)
from fxcrack.steps.end_conditions import Releases
from fxcrack.steps.load_path import LoadPath
from fxcrack.steps.partial_growth import (
    Block,
    PartialGrowth,
    attach_ligaments,
    grows_in_part,
)
from fxcrack.steps.release import release_tips
from fxcrack.steps.static import Static


def run_cycles(analysis: Analysis, step: Cycles, **controls: Any) -> str:
    """Run a step of load cycles; collective.

    Rows of the history: "cycle" for the first stabilised cycle; "release", or "unstable" beyond the
    upper limit, after each release with the cycle that follows; "arrest" or "limit". They have the
    columns N, and G_max, dG and da/dN at the tip of largest f.

    Args:
        analysis: The analysis, prepared for the step; all active cracks have a :class:`Fatigue`
            criterion.
        step: The cycle and the end conditions.
        **controls: Observer, checkpoints and resumption, as for
            :class:`~fxcrack.steps.driver.StepDriver`.

    Returns:
        Why the step ended.

    Raises:
        InputError: An amplitude is not cyclic, or no load changes.
    """
    cycling = _Cycling(analysis, step)
    # cycles may end by their number alone: no count of releases is reached then
    until = step.ends or (Releases(sys.maxsize),)
    driver = StepDriver(analysis, Static(until=until), columns=cycling.columns, **controls)
    return driver.run(cycling.step)


class _Cycling:
    """The cycles of one step.

    Args:
        analysis: The analysis.
        cycles: What the cycle is.
    """

    def __init__(self, analysis: Analysis, cycles: Cycles) -> None:
        self._analysis = analysis
        self._cycles = cycles
        self._limit = analysis.fatigue.N + cycles.n_max
        self._seen: list[TipCycle] = []
        self._partly = False
        self._cycle = StabilisedCycle(analysis, equilibria_of(analysis), cycles.change)
        self._corners = corners_of(analysis, cycles)

    def step(self, driver: StepDriver) -> str:
        """Solve a cycle, jump, release, until an end condition holds; why the step ended."""
        fatigue, event, resume = self._analysis.fatigue, "cycle", driver.resume
        if resume is None:
            top = self._go_to_maximum(driver.path)
        else:
            top, event, self._limit = resume["top"], resume["event"], resume["limit"]
            self._begin_at(top)
        self._partly = grows_in_part(self._analysis)
        partly = None
        if self._partly:
            partly = PartialGrowth(self._analysis, self._stabilised_cycle, self._limit)
            if resume is not None:
                partly.block = resume.get("block", partly.block)
        attach_ligaments(self._analysis)
        self._analysis.evaluate_tips()
        known = False
        while True:
            block = None if partly is None else partly.block
            driver.checkpoint_point(event=event, top=top, limit=self._limit, block=block)
            if not known:
                self._seen = self._stabilised_cycle()
            driver.record(event)
            reason = driver.ended()
            if reason:
                return reason
            jump: CycleJump | Block
            if partly is not None:
                jump = partly.until_release(self._seen)
                self._seen = jump.seen
            else:
                jump = self._grow()
            if jump.event in ("arrest", "limit"):
                driver.record(jump.event)
                if jump.event == "limit":
                    return f"{self._cycles.n_max:g} cycles done"
                return "arrest: no tip grows, however many cycles follow"
            event = "unstable" if jump.event == "unstable" else "release"
            known = event == "release" or self._partly
            if isinstance(jump, CycleJump) and not known:
                self._seen = []
                self._release(jump.release, fatigue.N)

    def columns(self) -> Row:
        """Number of cycles, and what the present cycle does at the tips of largest f."""
        row: Row = {"N": self._analysis.fatigue.N}
        for (g, v), cycle in zip(self._analysis.at_tips(), self._seen, strict=False):
            if len(v.tips):
                for name in ("G_max", "dG", "dadN"):
                    row[f"{name}[{g.title}]"] = float(cycle.column(name)[v.largest])
        return row

    def _go_to_maximum(self, path: LoadPath) -> int:
        """Load to the maximum of the cycle, nothing grows on the way; number of its corner."""
        analysis, top = self._analysis, 0
        if self._cycles.period is not None:
            found = []
            for corner in self._corners:
                self._load_to(path, corner.time)
                found.append(analysis.largest)
            top = int(np.argmax(found))
            self._begin_at(top)
        self._load_to(path, self._corners[0].time)
        for g, v in analysis.at_tips():
            analysis.fatigue.register_front(g.p, v.tips.node, g.front.surface.n_nodes)
        return top

    def _begin_at(self, top: int) -> None:
        """Begin the cycle at one of its corners."""
        self._corners = self._corners[top:] + self._corners[:top]

    def _load_to(self, path: LoadPath, time: float) -> None:
        load_to(self._analysis, path, time)
        self._analysis.evaluate_tips()

    # -- one cycle -----------------------------------------------------------------------

    def _stabilised_cycle(self) -> list[TipCycle]:
        """What the cycle does at the tips of each interface; the state stays at the maximum."""
        return self._cycle.stabilised(self._corners)

    # -- over the cycles to the next release ---------------------------------------------

    def _grow(self) -> CycleJump:
        """Cycles to the next release, all interfaces together; the release, unless it is unstable.

        Tips are tried in the order in which the rates at the beginning of their elements let them
        pass; those that come to the threshold within their element stay where they are. Where the
        cycles that are allowed do not suffice, nothing is released.
        """
        front, seen = self._front(), self._seen
        tried = np.zeros(len(front.da), dtype=np.bool_)
        best: tuple[float, CycleJump] | None = None
        jump = self._jump(front, tried, np.inf)
        while jump.event == "growth" and (best is None or jump.cycles - front.N < best[0]):
            undo = self._undoing()
            self._seen = []
            self._release(jump.release, front.N)
            after = self._stabilised_cycle() if self._has_tips() else []
            needed = cycles_of(
                front, jump.release, seen, after, self._analysis.active, self._analysis.tip_values
            )
            tried = tried | jump.release
            if best is None or needed < best[0]:
                best = (needed, jump)
            following = self._jump(front, tried, np.inf) if not tried.all() else None
            more = (
                following is not None
                and following.event == "growth"
                and following.cycles - front.N < best[0]
            )
            allowed = np.isfinite(needed) and front.N + needed <= self._limit
            if not more and best[1] is jump and allowed:
                done = after_jump(front, jump, needed)
                self._keep(front, done, seen)
                self._seen = after
                return done
            undo()
            self._seen = seen
            if following is None or not more:
                break
            jump = following
        if best is not None and np.isfinite(best[0]) and front.N + best[0] <= self._limit:
            # another group of tips is first after all
            needed, jump = best
            self._seen = []
            self._release(jump.release, front.N)
            after = self._stabilised_cycle() if self._has_tips() else []
            done = after_jump(front, jump, needed)
            self._keep(front, done, seen)
            self._seen = after
            return done
        if best is not None:
            waits = np.isfinite(best[0])
            jump = self._jump(front, np.zeros_like(tried) if waits else tried, self._limit,
                              short=bool(waits))  # fmt: skip
        elif jump.event == "unstable" and jump.cycles > self._limit:
            jump = self._jump(front, tried, self._limit)
        self._keep(front, jump, seen)
        return jump

    def _front(self) -> TipsBefore:
        """What is known of all tips at the present number of cycles."""
        fatigue = self._analysis.fatigue
        criteria = [cyclic_parts(g)[0] for g in self._analysis.active]
        tips = [v.tips for v in self._analysis.tip_values]
        counts = [len(t) for t in tips]
        on = [(g.p, t.node) for g, t in zip(self._analysis.active, tips, strict=True)]
        keep = np.repeat([c.credit for c in criteria], counts)
        return TipsBefore(
            N=fatigue.N,
            law=together([c.growth_law for c in criteria], counts),
            tips=tips,
            counts=counts,
            rates=joined([c.rates for c in self._seen]),
            da=np.concatenate([advance(t) for t in tips]),
            grown=np.where(
                keep, np.concatenate([fatigue.credit[p][nodes] for p, nodes in on]), 0.0
            ),
            keep=keep,
            initiated=np.concatenate([~fatigue.waiting[p][nodes] for p, nodes in on]),
            tolerance=min(c.tolerance for c in criteria),
            lengths=[lengths_of(g, t) for g, t in zip(self._analysis.active, tips, strict=True)],
            records=[len(g.records) for g in self._analysis.active],
        )

    def _jump(
        self, front: TipsBefore, stopped: Bools, limit: float, *, short: bool = False
    ) -> CycleJump:
        """Jump by the rates at the beginning of the elements.

        Args:
            front: All tips.
            stopped: Tips that do not pass their element, shape (n_tips,).
            limit: Cycles at which the analysis ends.
            short: Whether the limit comes first whatever these rates say.
        """
        rates = front.rates
        return cycle_jump(
            front.law,
            replace(
                rates,
                dG=np.where(stopped, 0.0, rates.dG),
                G_max=np.where(stopped, 0.0, rates.G_max),
            ),
            front.da,
            cycles=front.N,
            initiated=front.initiated,
            credit=front.grown if front.keep.any() else None,
            tolerance=front.tolerance,
            limit=limit,
            short=short,
        )

    def _keep(self, front: TipsBefore, jump: CycleJump, seen: list[TipCycle]) -> None:
        """Keep what a jump has changed, tabulate the cycle it began with, date its releases."""
        fatigue = self._analysis.fatigue
        fatigue.N = jump.cycles
        grown = np.where(front.keep, 0.0 if jump.credit is None else jump.credit, 0.0)
        at = np.cumsum([0, *front.counts])
        for i, g in enumerate(self._analysis.active):
            part, nodes = slice(at[i], at[i + 1]), front.tips[i].node
            fatigue.waiting[g.p][nodes] = ~jump.initiated[part]
            fatigue.credit[g.p][nodes] = grown[part]
            fatigue.tabulate(front.N, g.title, nodes, front.lengths[i], seen[i], jump.release[part])
            if jump.event == "growth":
                new = g.records[front.records[i] :]
                g.records[front.records[i] :] = [replace(r, DBT=jump.cycles) for r in new]

    def _has_tips(self) -> bool:
        return any(len(v.tips) for v in self._analysis.tip_values)

    def _release(self, chosen: Bools, N: float) -> None:
        """Release tips at the maximum of the cycle; these bonds fail at a number of cycles."""
        analysis = self._analysis
        counts = np.cumsum([len(v.tips) for v in analysis.tip_values])
        parts = np.split(chosen, counts[:-1])
        for (g, v), mine in zip(analysis.at_tips(), parts, strict=True):
            if mine.any():
                release_tips(analysis, g, v, np.flatnonzero(mine), N)
        analysis.update_tips()

    def _undoing(self) -> Callable[[], None]:
        """Remember the present state; the result returns to it."""
        analysis, solver = self._analysis, self._analysis.condensed
        state, rebases = solver.remember(), solver.rebases
        balance = analysis.balance.copy()
        known = [(g, len(g.records), g.n_released) for g in analysis.active]

        def undo() -> None:
            solver.undo(state, rebases)
            analysis.balance = balance
            for g, n_records, n_released in known:
                del g.records[n_records:]
                g.n_released = n_released
            analysis.update_tips()

        return undo
