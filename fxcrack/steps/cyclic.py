"""Steps of load cycles: solve one, jump over those that are like it, release, solve the next.

At each tip the total rate G takes its extremes on the way of the loads through the cycle. Between
two equilibria without a change of contact, forces and openings are linear in the fraction x of the
way and G is a parabola in it,

    G(x) = 1/2 F(x) w(x)/A,      dG = max G - min G,

so one dense equilibrium per corner of the cycle is enough; where contact changes in between, the
piece is halved until its middle lies on that parabola, to a tolerance. The number of cycles to the
next release is then a closed form (:func:`fxcrack.criteria.cycle_jump`), over all interfaces.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.criteria import CycleJump, Fatigue, Paris, Regime, cycle_jump, total
from fxcrack.criteria.energy_release import RateEvaluator
from fxcrack.criteria.evaluator import repeat_tips
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.history import Row
from fxcrack.interface.tips import Tips
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.crack import Crack
from fxcrack.steps.cycle_state import TipCycle
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.driver import StepDriver
from fxcrack.steps.end_conditions import Releases
from fxcrack.steps.load_path import LoadPath
from fxcrack.steps.release import release_tips
from fxcrack.steps.rows import load_columns
from fxcrack.steps.static import Static

_GRID = np.linspace(0.0, 1.0, 5)
_HALVINGS = 8
"""How often a piece of the cycle on which contact changes is halved at most."""
_SETTLING = 20
"""Cycles that friction gets to settle."""


def run_cycles(analysis: Analysis, step: Cycles, **controls: Any) -> str:
    """Run a step of load cycles on linear bodies; collective.

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
        columns = load_columns(analysis.solver)
        names = [load if moves else answer for load, answer, moves in columns]
        self._corners = cycles.corners(analysis.loads_at, analysis.load_breaks(), names)

    def step(self, driver: StepDriver) -> str:
        """Solve a cycle, jump, release, until an end condition holds; why the step ended."""
        fatigue, event, resume = self._analysis.fatigue, "cycle", driver.resume
        if resume is None:
            top = self._go_to_maximum(driver.path)
        else:
            top, event, self._limit = resume["top"], resume["event"], resume["limit"]
            self._begin_at(top)
        while True:
            driver.checkpoint_point(event=event, top=top, limit=self._limit)
            self._seen = self._stabilised_cycle()
            driver.record(event)
            reason = driver.ended()
            if reason:
                return reason
            jump = self._jump()
            if jump.event in ("arrest", "limit"):
                driver.record(jump.event)
                if jump.event == "limit":
                    return f"{self._cycles.n_max:g} cycles done"
                return "arrest: no tip grows, however many cycles follow"
            event = "unstable" if jump.event == "unstable" else "release"
            self._seen = []
            self._release(jump, fatigue.N)

    def columns(self) -> Row:
        """Number of cycles, and what the present cycle does at the tips of largest f."""
        row: Row = {"N": self._analysis.fatigue.N}
        for (g, v), cycle in zip(self._analysis.at_tips(), self._seen, strict=False):
            if len(v.tips):
                for name in ("G_max", "dG", "dadN"):
                    row[f"{name}[{g.title}]"] = float(getattr(cycle, name)[v.largest])
        return row

    # -- one cycle -----------------------------------------------------------------------

    def _go_to_maximum(self, path: LoadPath) -> int:
        """Load to the maximum of the cycle, nothing grows on the way; number of its corner."""
        analysis, top = self._analysis, 0
        if self._cycles.period is not None:
            found = []
            for time, _ in self._corners:
                self._load_to(path, time)
                found.append(analysis.largest)
            top = int(np.argmax(found))
            self._begin_at(top)
        self._load_to(path, self._corners[0][0])
        for g, v in analysis.at_tips():
            analysis.fatigue.meet(g.p, v.tips.node, g.front.surface.n_nodes)
        return top

    def _begin_at(self, top: int) -> None:
        """Begin the cycle at one of its corners."""
        self._corners = self._corners[top:] + self._corners[:top]

    def _load_to(self, path: LoadPath, time: float) -> None:
        path.over_increment(time)
        self._analysis.evaluate_tips()

    def _stabilised_cycle(self) -> list[TipCycle]:
        """What the cycle does at the tips of each interface; the state stays at the maximum."""
        system = self._analysis.solver.system
        ends = [loads for _, loads in self._corners[1:]]
        if len(ends) > 1 or system.friction is not None:
            ends.append(self._corners[0][1])
        saved = self._analysis.solver.interface_state()
        corners, largest = self._once(self._instant(self._analysis.solver.state), ends)
        if system.friction is not None:
            # slips settle over some cycles
            for _ in range(_SETTLING):
                before = largest
                corners, largest = self._once(corners[-1], ends)
                if np.all(np.abs(largest - before) <= self._cycles.change * largest):
                    break
            else:
                N = self._analysis.fatigue.N
                log.warn("friction does not settle in the cycle at N = %g", N)
        way = corners[:1]
        for a, b in pairwise(corners):
            way += self._between(a, b, largest, _HALVINGS)
        self._analysis.solver.restore_interfaces(saved)
        return self._extremes(way)

    def _once(self, start: _Instant, ends: list[Array]) -> tuple[list[_Instant], Array]:
        """Instants of one cycle and the largest rate at each tip."""
        corners = [start]
        for loads in ends:
            corners += self._way_to(corners[-1].state, loads)
        return corners, np.stack([self._totals(c.measured) for c in corners]).max(axis=0)

    def _instant(self, state: Equilibrium, *, straight: bool = False) -> _Instant:
        time, none = self._analysis.time, np.zeros((0, 0))
        measured = [
            g.evaluator.measure(v.tips, state, time) if len(v.tips) else none
            for g, v in self._analysis.at_tips()
        ]
        return _Instant(state, measured, self._analysis.solver.system.closed.tobytes(), straight)

    def _way_to(self, start: Equilibrium, loads: Array) -> list[_Instant]:
        """Instants from an equilibrium (left out) to other loads."""
        system = self._analysis.solver.system
        force = self._analysis.given_force(self._analysis.time)
        if system.soft.bonds or system.friction is not None:
            # friction, and cohesive bonds that an earlier step opened in part, depend on the path
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
        if np.all(np.abs(found - guess) <= self._cycles.change * np.maximum(largest, found)):
            return [middle, b]
        if not halvings:
            N = self._analysis.fatigue.N
            log.warn("contact changes too often in the cycle at N = %g to follow G", N)
            return [middle, b]
        first = self._between(a, middle, largest, halvings - 1)
        return first + self._between(middle, b, largest, halvings - 1)

    def _totals(self, measured: list[Array]) -> Array:
        """Total rate at the tips of all interfaces, shape (n_tips,), force/length."""
        sums = [np.zeros(0)]
        for (g, v), values in zip(self._analysis.at_tips(), measured, strict=True):
            if len(v.tips):
                sums.append(total(cyclic_parts(g)[1].rates(v.tips, values)))
        return np.concatenate(sums)

    def _extremes(self, way: list[_Instant]) -> list[TipCycle]:
        out: list[TipCycle] = []
        for i, (g, v) in enumerate(self._analysis.at_tips()):
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
        """Jump over cycles like the present one, all interfaces together, and tabulate it."""
        fatigue, before = self._analysis.fatigue, self._analysis.fatigue.N
        criteria = [cyclic_parts(g)[0] for g in self._analysis.active]
        tips = [v.tips for v in self._analysis.tip_values]
        counts = [len(t) for t in tips]
        on = [(g.p, t.node) for g, t in zip(self._analysis.active, tips, strict=True)]
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
        for i, (g, (p, nodes)) in enumerate(zip(self._analysis.active, on, strict=True)):
            part = slice(at[i], at[i + 1])
            fatigue.waiting[p][nodes] = ~jump.initiated[part]
            fatigue.credit[p][nodes] = grown[part]
            fatigue.tabulate(
                before, g.title, nodes, _lengths(g, tips[i]), self._seen[i], jump.release[part]
            )
        return jump

    def _release(self, jump: CycleJump, N: float) -> None:
        """Release at the maximum of the cycle; these bonds fail at a number of cycles."""
        analysis = self._analysis
        counts = np.cumsum([len(v.tips) for v in analysis.tip_values])
        parts = np.split(jump.release, counts[:-1])
        for (g, v), chosen in zip(analysis.at_tips(), parts, strict=True):
            if chosen.any():
                release_tips(analysis, g, v, np.flatnonzero(chosen), N)
        analysis.update_tips()


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
    """Criterion and evaluator of a crack that grows in cycles.

    :func:`fxcrack.steps.cycles.check_criteria` has let nothing else pass.
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


def _lengths(crack: Crack, tips: Tips) -> list[float]:
    """Crack length of each tip: its own on a line, the mean of the front on a surface."""
    mean = crack.extent.length(tips)
    own = dict(crack.extent.lengths()) if crack.front.surface.dim == 1 else {}
    return [own.get(int(node), mean) for node in tips.node]
