"""From one release to the next in cycles: what is known of all tips, and how long they need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.criteria import CycleJump, CycleRates, Fatigue, FatigueLaw, Regime, element_cycles
from fxcrack.criteria.evaluator import TipValues
from fxcrack.criteria.rate_evaluator import RateEvaluator
from fxcrack.interface.tips import Tips
from fxcrack.steps.crack import Crack
from fxcrack.steps.cycle_state import TipCycle


@dataclass(frozen=True)
class TipsBefore:
    """All tips at the beginning of a jump, of one interface after the other.

    Attributes:
        N: Cycles so far.
        law: Law of onset and growth.
        tips: Per interface.
        counts: Number of tips of each interface.
        rates: The stabilised cycle.
        da: Length of the element ahead of each tip, shape (n_tips,), length.
        grown: Growth within it that is kept, likewise.
        keep: Whether growth is kept, shape (n_tips,).
        initiated: Whether onset is over, shape (n_tips,).
        tolerance: f_tol of tips that are released together.
        lengths: Crack lengths of the tips, per interface.
        records: Number of bonds of each interface that failed so far.
    """

    N: float
    law: FatigueLaw
    tips: list[Tips]
    counts: list[int]
    rates: CycleRates
    da: Array
    grown: Array
    keep: Bools
    initiated: Bools
    tolerance: float
    lengths: list[list[float]]
    records: list[int]


def cycles_of(
    before: TipsBefore,
    chosen: Bools,
    seen: list[TipCycle],
    after: list[TipCycle],
    cracks: Sequence[Crack],
    now: Sequence[TipValues],
) -> float:
    """Cycles until the first of some tips has passed its element; inf if none ever does.

    Growth that is kept counts by the rate at the beginning of the element, as it was accumulated.

    Args:
        before: All tips, at the beginning of their elements.
        chosen: Those that were released, shape (n_tips,).
        seen: The cycle before, per interface.
        after: The cycle after, per interface; empty where no tip is left.
        cracks: The cracks, one per interface.
        now: Values at their tips after the release.
    """
    out = np.inf
    at = np.cumsum([0, *before.counts])
    for i, g in enumerate(cracks):
        part = slice(at[i], at[i + 1])
        rows = np.flatnonzero(chosen[part])
        if not len(rows):
            continue
        criterion, _ = cyclic_parts(g)
        law, tips = criterion.growth_law, before.tips[i]
        first = begin = end = seen[i].rates.rows(rows)
        if after and len(now[i].tips):
            reached = now[i].tips
            # the tip that stands at the end of the element now
            aim = tips.frame[rows, :, 1] * tips.d_ahead[rows, None]
            aim = aim + g.front.surface.x[tips.node[rows]]
            away = np.linalg.norm(aim[:, None] - g.front.surface.x[reached.node], axis=2)
            found = away.argmin(axis=1)
            end = after[i].rates.rows(found)
            if criterion.method == "closure":
                # exact closure gives means over elements: the tip is half an element before
                d, next_d = tips.d_ahead[rows], advance(reached)[found]
                half = d / (d + next_d)
                begin, end = begin.at(end, -half), begin.at(end, half)
        onset = np.maximum(law.onset(begin) - before.N, 0.0)
        wait = np.where(before.initiated[part][rows], 0.0, onset)
        passed = element_cycles(law, begin, end, before.da[part][rows])
        grown, pace = before.grown[part][rows], law.growth(first)
        spent = np.divide(grown, pace, out=np.zeros(len(rows)), where=pace > 0.0)
        out = min(out, float((wait + np.maximum(passed - spent, 0.0)).min()))
    return out


def after_jump(before: TipsBefore, jump: CycleJump, cycles: float) -> CycleJump:
    """The jump once the cycles are known that the released tips needed.

    Args:
        before: All tips.
        jump: The jump by the rates at the beginning of the elements.
        cycles: Cycles that were needed.
    """
    law, rates = before.law, before.rates
    regime = law.regimes(rates)
    moving = regime == Regime.PARIS
    rate = np.where(moving, law.growth(rates), 0.0)
    left = np.maximum(law.onset(rates) - before.N, 0.0)
    wait = np.where(before.initiated, 0.0, left)
    grown = before.grown + rate * np.maximum(cycles - wait, 0.0)
    return replace(
        jump,
        cycles=before.N + cycles,
        regime=regime,
        initiated=before.initiated | jump.release | (moving & (wait <= cycles)),
        credit=None if jump.credit is None else np.where(jump.release, 0.0, grown),
    )


@dataclass(frozen=True)
class _SideBySide:
    """Laws of several interfaces for the tips of all of them, one interface after the other.

    Attributes:
        laws: One per interface.
        counts: Number of tips of each.
    """

    laws: tuple[FatigueLaw, ...]
    counts: tuple[int, ...]

    def life_exponent(self, toughness: float) -> float:
        """The largest of all."""
        return max(law.life_exponent(toughness) for law in self.laws)

    def _parts(self, cycle: CycleRates) -> list[tuple[FatigueLaw, CycleRates]]:
        """Laws of interfaces with tips, and the cycle at these."""
        rows = np.split(np.arange(len(cycle.dG)), np.cumsum(self.counts)[:-1])
        return [(law, cycle.rows(r)) for law, r in zip(self.laws, rows, strict=True) if len(r)]

    def onset(self, cycle: CycleRates) -> Array:
        """Cycles until growth starts."""
        return np.concatenate([np.zeros(0), *(law.onset(c) for law, c in self._parts(cycle))])

    def growth(self, cycle: CycleRates) -> Array:
        """Growth per cycle in the Paris regime."""
        return np.concatenate([np.zeros(0), *(law.growth(c) for law, c in self._parts(cycle))])

    def regimes(self, cycle: CycleRates) -> Ints:
        """Regime of each tip."""
        none = np.zeros(0, dtype=np.int64)
        return np.concatenate([none, *(law.regimes(c) for law, c in self._parts(cycle))])


def cyclic_parts(crack: Crack) -> tuple[Fatigue, RateEvaluator]:
    """Criterion and evaluator of a crack that grows in cycles.

    :func:`fxcrack.steps.cycles.check_criteria` has let nothing else pass.
    """
    return cast(Fatigue, crack.criterion), cast(RateEvaluator, crack.evaluator)


def together(laws: Sequence[FatigueLaw], counts: Sequence[int]) -> FatigueLaw:
    """One law for the tips of several interfaces, given one interface after the other.

    Args:
        laws: One per interface.
        counts: Number of tips of each.
    """
    return _SideBySide(tuple(laws), tuple(counts))


def advance(tips: Tips) -> Array:
    """Distance by which releasing each tip moves the front, shape (n,), length."""
    return np.where(tips.d_ahead > 0.0, tips.d_ahead, tips.area / tips.width)


def with_passed_parts(crack: Crack, tips: Tips, part: Array) -> tuple[float, float]:
    """Length and area of a crack with the elements that its front has passed in part.

    Args:
        crack: The crack.
        tips: Its tips.
        part: Part of the element ahead of each tip, shape (n_tips,).
    """
    passed = float(part @ tips.area)
    grown = crack.extent.over_front(passed)
    if crack.front.surface.dim == 1:
        grown = float((part * advance(tips)).max(initial=0.0))
    return crack.extent.length(tips) + grown, crack.extent.area(tips) + passed


def lengths_of(crack: Crack, tips: Tips) -> list[float]:
    """Crack length of each tip: its own on a line, the mean of the front on a surface."""
    mean = crack.extent.length(tips)
    own = dict(crack.extent.lengths()) if crack.front.surface.dim == 1 else {}
    return [own.get(int(node), mean) for node in tips.node]
