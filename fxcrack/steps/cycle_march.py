"""Marching through cycles: solve one, jump over those that are like it, let go, solve the next.

At each tip the total rate G takes its extremes on the way of the loads through the cycle. Between
two equilibria without a change of contact, forces and openings are linear in the fraction x of the
way and G is a parabola in it,

    G(x) = 1/2 F(x) w(x)/A,      dG = max G - min G,

so one dense equilibrium per corner of the cycle is enough. The number of cycles to the next release
is then a closed form (:func:`fxcrack.criteria.cycle_jump`), over all interfaces together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack import log
from fxcrack.criteria import CycleJump, Fatigue, Paris, Regime, cycle_jump, total
from fxcrack.interface.front import Tips
from fxcrack.output.history import History
from fxcrack.solve.condensed import CondensedModel
from fxcrack.steps.evaluate import RateEvaluator, repeat_tips
from fxcrack.steps.fatigue import Cycles, FatigueState, TipCycle
from fxcrack.steps.growth import Growth
from fxcrack.steps.march import March
from fxcrack.steps.static import Static

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

_GRID = np.linspace(0.0, 1.0, 5)
_HALVINGS = 6
"""A piece of the cycle with changes of contact is cut into at most 2^this parts."""


class CycleMarch(March):
    """One step of cycles on a condensed model.

    Args:
        model: Model with its present state; prepared for the step.
        growths: Activated debonds, all with a :class:`Fatigue` criterion.
        step: Controls.
        history: Where rows go: "cycle", the first stabilised cycle; "release" and "unstable"
            after each release, with the cycle that follows; "arrest" or "limit".
        loads_at: Amplitudes and load factors at a time, shape (n_loads,).
        breaks: Times at which an amplitude changes its slope.
        state: What earlier cycles left behind; continued.
        **carried: As for :class:`March`.
    """

    def __init__(
        self,
        model: CondensedModel,
        growths: list[Growth],
        step: Cycles,
        history: History,
        loads_at: Callable[[float], Array],
        breaks: tuple[float, ...],
        *,
        state: FatigueState,
        **carried: Any,
    ) -> None:
        static = Static(until=step.until)
        super().__init__(model, growths, static, history, loads_at, breaks, **carried)
        self.cycles = step
        self.fatigue = state
        self._limit = state.N + step.n_max
        self._seen: list[TipCycle] = []
        names = [load if moves else answer for load, answer, moves in self._names]
        self._corners = step.corners(loads_at, breaks, names)

    def _run_events(self) -> str:
        self._go_to_maximum()
        event = "cycle"
        while True:
            self._seen = self._stabilised_cycle()
            self._record(event)
            reason = self._ended()
            if reason:
                return reason
            jump = self._jump()
            self.fatigue.N = jump.cycles
            if not jump.release.any():
                self._record(jump.event)
                return (
                    f"{self.cycles.n_max:g} cycles done"
                    if jump.event == "limit"
                    else "arrest: no tip grows, however many cycles follow"
                )
            event = "release" if jump.event == "growth" else jump.event
            self._let_go_after(jump)

    # -- one cycle -----------------------------------------------------------------------

    def _go_to_maximum(self) -> None:
        """Load to the maximum of the cycle; nothing grows on the way."""
        if self.cycles.period is not None:
            largest = []
            for time, _ in self._corners:
                self._follow(self._pieces(time), time)
                self._values = self._evaluate()
                largest.append(max(self._largest()))
            top = int(np.argmax(largest))
            self._corners = self._corners[top:] + self._corners[:top]
        time = self._corners[0][0]
        self._follow(self._pieces(time), time)
        self._values = self._evaluate()
        for g, v in zip(self.growths, self._values, strict=True):
            self.fatigue.meet(g.p, v.tips.node, g.front.surface.n_nodes)

    def _stabilised_cycle(self) -> list[TipCycle]:
        """Extremes of G at all tips, per interface; the state stays at the maximum."""
        system = self.model.system
        loads = [c[1] for c in self._corners]
        if len(loads) > 2:
            loads.append(loads[0])
        saved = system.snapshot()
        instants = [self._instant()]
        extremes = _Extremes(self.growths, [v.tips for v in self._values])
        for end in loads[1:]:
            instants += self._way(instants[-1], end)
        for a, b in zip(instants[:-1], instants[1:], strict=True):
            if a.follows(b):
                extremes.include(a, b)
            else:
                self._halve(extremes, a, b)
        system.restore(saved)
        return [c.cycle() for c in extremes.parts]

    def _instant(self) -> _Instant:
        return _Instant()
