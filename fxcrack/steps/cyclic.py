"""Marching through cycles: solve one, jump over those that are like it, let go, solve the next.

At each tip the total rate G takes its extremes on the way of the loads through the cycle. Between
two equilibria without a change of contact, forces and openings are linear in the fraction x of the
way and G is a parabola in it,

    G(x) = 1/2 F(x) w(x)/A,      dG = max G - min G,

so one dense equilibrium per corner of the cycle is enough; where contact changes in between, the
piece is halved until its middle lies on that parabola, to a tolerance. The number of cycles to the
next release is then a closed form (:func:`fxcrack.criteria.cycle_jump`), over all interfaces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.criteria import CycleJump, Fatigue, Paris, Regime, cycle_jump, total
from fxcrack.criteria.energy_release import RateEvaluator
from fxcrack.criteria.evaluator import TipValues, repeat_tips
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.history import History
from fxcrack.interface.tips import Tips
from fxcrack.solvers.base import Solver
from fxcrack.steps.crack import Crack
from fxcrack.steps.cycle_state import FatigueState, TipCycle
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.quasi_static import QuasiStaticDriver
from fxcrack.steps.static import Static

_GRID = np.linspace(0.0, 1.0, 5)
_HALVINGS = 8
"""How often a piece of the cycle on which contact changes is halved at most."""
_SETTLING = 20
"""Cycles that friction gets to settle."""


class CyclicDriver(QuasiStaticDriver):
    """One step of cycles on a condensed model.

    Args:
        solver: Model with its present state; prepared for the step.
        cracks: Activated debonds, all with a :class:`Fatigue` criterion.
        step: Controls.
        history: Where rows go: "cycle" for the first stabilised cycle; "release", or "unstable"
            beyond the upper limit, after each release with the cycle that follows; "arrest" or
            "limit". They have the columns N, and G_max, dG and da/dN at the tip of largest f.
        loads_at: Amplitudes and load factors at a time, shape (n_loads,).
        breaks: Times at which an amplitude changes its slope.
        fatigue: What earlier cycles left behind; continued.
        **carried: As for :class:`QuasiStaticDriver`.
    """

    def __init__(
        self,
        solver: Solver,
        cracks: list[Crack],
        step: Cycles,
        history: History,
        loads_at: Callable[[float], Array],
        breaks: tuple[float, ...],
        *,
        fatigue: FatigueState,
        **carried: Any,
    ) -> None:
        static = Static(until=step.until)
        super().__init__(solver, cracks, static, history, loads_at, breaks, **carried)
        self.cycles = step
        self.fatigue = fatigue
        self._limit = fatigue.N + step.n_max
        self._seen: list[TipCycle] = []
        self._event = "cycle"
        self._top = 0
        names = [load if moves else answer for load, answer, moves in self._names]
        self._corners = step.corners(loads_at, breaks, names)

    def carried(self) -> dict[str, Any]:
        """Energies and counters, and where in the cycles."""
        cycles = {"event": self._event, "top": self._top, "limit": self._limit}
        return {**super().carried(), **cycles}

    def _run_events(self) -> str:
        if self._resume is None:
            self._go_to_maximum()
        else:
            self._event, self._limit = self._resume["event"], self._resume["limit"]
            self._begin_at(self._resume["top"])
        while True:
            self._at_checkpoint_point()
            self._seen = self._stabilised_cycle()
            self._record(self._event)
            reason = self._ended()
            if reason:
                return reason
            jump = self._jump()
            if jump.event in ("arrest", "limit"):
                self._record(jump.event)
                if jump.event == "limit":
                    return f"{self.cycles.n_max:g} cycles done"
                return "arrest: no tip grows, however many cycles follow"
            self._event = "unstable" if jump.event == "unstable" else "release"
            self._let_go_after(jump)

    def _record(self, event: str) -> None:
        super()._record(event)
        row = self.history.rows[-1]
        row["N"] = self.fatigue.N
        for g, v, cycle in zip(self.cracks, self._values, self._seen, strict=False):
            if len(v.tips):
                for name in ("G_max", "dG", "dadN"):
                    row[f"{name}[{g.title}]"] = float(getattr(cycle, name)[v.largest])

    # -- one cycle -----------------------------------------------------------------------

    def _go_to_maximum(self) -> None:
        """Load to the maximum of the cycle; nothing grows on the way."""
        corners = self._corners
        if self.cycles.period is not None:
            largest = []
            for time, _ in corners:
                self._load_to(time)
                largest.append(max(self._largest()))
            self._begin_at(int(np.argmax(largest)))
        self._load_to(self._corners[0][0])
        for g, v in zip(self.cracks, self._values, strict=True):
            self.fatigue.meet(g.p, v.tips.node, g.front.surface.n_nodes)

    def _begin_at(self, top: int) -> None:
        """Count the corners of the cycle from one of them."""
        self._top = top
        self._corners = self._corners[top:] + self._corners[:top]

    def _load_to(self, time: float) -> None:
        self._follow(self._pieces(time), time)
        self._values = self._evaluate()

    def _stabilised_cycle(self) -> list[TipCycle]:
        """What the cycle does at the tips of each interface; the state stays at the maximum."""
        system = self.solver.system
        ends = [loads for _, loads in self._corners[1:]]
        if len(ends) > 1 or system.friction is not None:
            ends.append(self._corners[0][1])
        saved = self.solver.interface_state()
        corners, largest = self._once(self._instant(self.solver.state), ends)
        if system.friction is not None:
            # slips settle over some cycles
            for _ in range(_SETTLING):
                before = largest
                corners, largest = self._once(corners[-1], ends)
                if np.all(np.abs(largest - before) <= self.cycles.change * largest):
                    break
            else:
                log.warn("friction does not settle in the cycle at N = %g", self.fatigue.N)
        way = corners[:1]
        for a, b in pairwise(corners):
            way += self._between(a, b, largest, _HALVINGS)
        self.solver.restore_interfaces(saved)
        return self._extremes(way)

    def _once(self, start: _Instant, ends: list[Array]) -> tuple[list[_Instant], Array]:
        """Instants of one cycle and the largest rate at each tip."""
        corners = [start]
        for loads in ends:
            corners += self._way_to(corners[-1].state, loads)
        return corners, np.stack([self._totals(c.measured) for c in corners]).max(axis=0)

    def _instant(self, state: Equilibrium, *, straight: bool = False) -> _Instant:
        measured = [
            g.evaluator.measure(v.tips, state, self.time) if len(v.tips) else np.zeros((0, 0))
            for g, v in zip(self.cracks, self._values, strict=True)
        ]
        return _Instant(state, measured, self.solver.system.closed.tobytes(), straight)

    def _way_to(self, start: Equilibrium, loads: Array) -> list[_Instant]:
        """Instants from an equilibrium (left out) to other loads."""
        system, force = self.solver.system, self._force_at(self.time)
        if system.soft.bonds or system.friction is not None:
            # friction, and bonds an earlier step left half-way remember how they were loaded
            path = system.pieces(start, loads, force)
            return [self._instant(point, straight=True) for _, point in path]
        return [self._instant(system.equilibrium(loads, force))]

    def _between(self, a: _Instant, b: _Instant, largest: Array, halvings: int) -> list[_Instant]:
        """Instants after a up to b between which G is a parabola, to the tolerance of the step."""
        if b.follows(a):
            return [b]
        (middle,) = self._way_to(a.state, 0.5 * (a.state.loads + b.state.loads))
        found = self._totals(middle.measured)
        guess = self._totals([0.5 * (x + y) for x, y in zip(a.measured, b.measured, strict=True)])
        if np.all(np.abs(found - guess) <= self.cycles.change * np.maximum(largest, found)):
            return [middle, b]
        if not halvings:
            log.warn("contact changes too often in the cycle at N = %g to follow G", self.fatigue.N)
            return [middle, b]
        first = self._between(a, middle, largest, halvings - 1)
        return first + self._between(middle, b, largest, halvings - 1)

    def _totals(self, measured: list[Array]) -> Array:
        """Total rate at the tips of all interfaces, shape (n_tips,), force/length."""
        sums = [np.zeros(0)]
        for g, v, values in zip(self.cracks, self._values, measured, strict=True):
            if len(v.tips):
                sums.append(total(cyclic_parts(g)[1].rates(v.tips, values)))
        return np.concatenate(sums)

    def _extremes(self, way: list[_Instant]) -> list[TipCycle]:
        out: list[TipCycle] = []
        for i, (g, v) in enumerate(zip(self.cracks, self._values, strict=True)):
            criterion, evaluator = cyclic_parts(g)
            if not len(v.tips):
                out.append(TipCycle(*np.zeros((4, 0))))
                continue
            rates = [
                rates_between(evaluator, v.tips, a.measured[i], b.measured[i])
                for a, b in pairwise(way)
            ]
            dG, top, critical = criterion.cycle(
                np.concatenate(rates), evaluator.toughness[v.tips.node]
            )
            regime = criterion.paris.regime(top, critical)
            growth = np.where(regime == Regime.PARIS, criterion.paris.growth_rate(dG), 0.0)
            growth = np.where(regime == Regime.UNSTABLE, advance(v.tips), growth)
            out.append(TipCycle(dG, top, critical, growth))
        return out

    # -- over the cycles to the next release ---------------------------------------------

    def _jump(self) -> CycleJump:
        """Jump over cycles like the present one, all interfaces together; notes what it does."""
        fatigue, before = self.fatigue, self.fatigue.N
        criteria = [cyclic_parts(g)[0] for g in self.cracks]
        tips = [v.tips for v in self._values]
        counts = [len(t) for t in tips]
        on = [(g.p, t.node) for g, t in zip(self.cracks, tips, strict=True)]
        keep = np.repeat([c.credit for c in criteria], counts)
        credit = np.concatenate([fatigue.credit[p][nodes] for p, nodes in on])
        jump = cycle_jump(
            together([c.paris for c in criteria], counts),
            np.concatenate([c.dG for c in self._seen]),
            np.concatenate([c.G_max for c in self._seen]),
            np.concatenate([c.G_c for c in self._seen]),
            np.concatenate([advance(t) for t in tips]),
            cycles=before,
            initiated=np.concatenate([~fatigue.waiting[p][nodes] for p, nodes in on]),
            credit=credit if keep.any() else None,
            tolerance=min(c.tolerance for c in criteria),
            limit=self._limit,
        )
        fatigue.N = jump.cycles
        grown = np.where(keep, 0.0 if jump.credit is None else jump.credit, 0.0)
        at = np.cumsum([0, *counts])
        for i, (g, (p, nodes)) in enumerate(zip(self.cracks, on, strict=True)):
            part = slice(at[i], at[i + 1])
            fatigue.waiting[p][nodes] = ~jump.initiated[part]
            fatigue.credit[p][nodes] = grown[part]
            fatigue.note(
                before, g.title, nodes, _lengths(g, tips[i]), self._seen[i], jump.release[part]
            )
        return jump

    def _let_go_after(self, jump: CycleJump) -> None:
        """Let go at the maximum of the cycle."""
        self._seen = []
        counts = np.cumsum([len(v.tips) for v in self._values])
        parts = np.split(jump.release, counts[:-1])
        for g, v, chosen in zip(self.cracks, self._values, parts, strict=True):
            if chosen.any():
                self._release(g, g.nodes_of(v, np.flatnonzero(chosen)), v)
        self._update_tips()

    def _release(self, g: Crack, nodes: Ints, values: TipValues) -> None:
        super()._release(g, nodes, values)
        # these bonds failed at a number of cycles
        last = g.records[-len(nodes) :]
        g.records[-len(nodes) :] = [replace(record, DBT=self.fatigue.N) for record in last]


@dataclass(frozen=True)
class _Instant:
    """One instant of the cycle.

    Attributes:
        state: Equilibrium.
        measured: What evaluators measured per interface, linear between equilibria.
        contact: Which nodes are in contact.
        straight: Contact and bonds did not change since the instant before.
    """

    state: Equilibrium
    measured: list[Array]
    contact: bytes
    straight: bool

    def follows(self, before: _Instant) -> bool:
        """Whether everything is linear between an earlier instant and this one."""
        return self.straight or self.contact == before.contact


@dataclass(frozen=True)
class _SideBySide(Paris):
    """Laws of several interfaces for the tips of all of them, one interface after the other.

    Attributes:
        laws: One per interface.
        counts: Number of tips of each.
    """

    laws: tuple[Paris, ...] = ()
    counts: tuple[int, ...] = ()

    def _each(self, name: str, *values: npt.ArrayLike) -> npt.NDArray[Any]:
        parts = [np.split(np.asarray(v), np.cumsum(self.counts)[:-1]) for v in values]
        each = zip(self.laws, *parts, strict=True)
        return np.concatenate([getattr(law, name)(*part) for law, *part in each])

    def onset_cycles(self, dG: npt.ArrayLike) -> Array:
        """Cycles until growth starts."""
        return self._each("onset_cycles", dG)

    def growth_rate(self, dG: npt.ArrayLike) -> Array:
        """Growth per cycle in the Paris regime."""
        return self._each("growth_rate", dG)

    def regime(self, G_max: npt.ArrayLike, G_c: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """Regime of each tip."""
        return self._each("regime", G_max, G_c)


def cyclic_parts(crack: Crack) -> tuple[Fatigue, RateEvaluator]:
    """Criterion and evaluator of a crack that grows in cycles, which :func:`check_criteria` saw to.

    A criterion that says it grows in cycles has all members of these.
    """
    return cast(Fatigue, crack.criterion), cast(RateEvaluator, crack.evaluator)


def together(laws: Sequence[Paris], counts: Sequence[int]) -> Paris:
    """One law for the tips of several interfaces, given one interface after the other.

    Args:
        laws: One per interface.
        counts: Number of tips of each.
    """
    first = laws[0]
    constants = (first.c1, first.c2, first.c3, first.c4, first.r1, first.r2)
    return _SideBySide(*constants, laws=tuple(laws), counts=tuple(counts))


def rates_between(evaluator: RateEvaluator, tips: Tips, a: Array, b: Array) -> Array:
    """Energy release rates on a linear piece of the cycle, the extremes of their sum among them.

    The sum is a parabola wherever no mode is clipped at zero. It is taken at five points and at
    the vertices of the parabolas around the smallest and the largest of these.

    Args:
        evaluator: The criterion on its interface.
        tips: Front nodes.
        a: What it measured at the beginning of the piece, shape (n, m).
        b: The same at the end.

    Returns:
        Rates by mode, shape (7, n, 3), force/length.
    """
    n = len(tips)
    many = np.concatenate([(1.0 - x) * a + x * b for x in _GRID])
    rates = [evaluator.rates(repeat_tips(tips, len(_GRID)), many).reshape(len(_GRID), n, 3)]
    sums = total(rates[0])
    for place in (sums.argmin(axis=0), sums.argmax(axis=0)):
        i = np.clip(place, 1, len(_GRID) - 2)
        left, middle, right = (np.take_along_axis(sums, i[None] + k, 0)[0] for k in (-1, 0, 1))
        bend = left - 2.0 * middle + right
        shift = np.divide(0.5 * (left - right), bend, out=np.zeros(n), where=bend != 0.0)
        x = np.clip(_GRID[i] + _GRID[1] * shift, 0.0, 1.0)[:, None]
        rates.append(evaluator.rates(tips, (1.0 - x) * a + x * b)[None])
    return np.concatenate(rates)


def advance(tips: Tips) -> Array:
    """Distance by which releasing each tip moves the front, shape (n,), length."""
    return np.where(tips.d_ahead > 0.0, tips.d_ahead, tips.area / tips.width)


def _lengths(growth: Crack, tips: Tips) -> list[float]:
    """Crack length of each tip: its own on a line, the mean of the front on a surface."""
    mean = growth.extent.length(tips)
    own = dict(growth.extent.lengths()) if growth.front.surface.dim == 1 else {}
    return [own.get(int(node), mean) for node in tips.node]
