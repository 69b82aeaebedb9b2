"""From one release to the next in cycles: what is known of all tips, and how long they need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.criteria import CycleJump, Fatigue, Paris, Rates, Regime, element_cycles
from fxcrack.criteria.energy_release import RateEvaluator
from fxcrack.criteria.evaluator import TipValues
from fxcrack.interface.tips import Tips
from fxcrack.steps.crack import Crack
from fxcrack.steps.cycle_state import TipCycle


@dataclass(frozen=True)
class TipsBefore:
    """All tips at the beginning of a jump, of one interface after the other.

    Attributes:
        N: Cycles so far.
        law: Constants of growth.
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
    law: Paris
    tips: list[Tips]
    counts: list[int]
    rates: Rates
    da: Array
    grown: Array
    keep: Bools
    initiated: Bools
    tolerance: float
    lengths: list[list[float]]
    records: list[int]


def joined(cycles: list[TipCycle]) -> Rates:
    """Rates of the tips of all interfaces."""
    return Rates(*(np.concatenate([getattr(c, k) for c in cycles]) for k in ("dG", "G_max", "G_c")))


def _rates_of(cycle: TipCycle, rows: Ints) -> Rates:
    """Rates of some tips of an interface."""
    return Rates(cycle.dG[rows], cycle.G_max[rows], cycle.G_c[rows])


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
        law, tips = criterion.paris, before.tips[i]
        first = begin = end = _rates_of(seen[i], rows)
        if after and len(now[i].tips):
            reached = now[i].tips
            # the tip that stands at the end of the element now
            aim = tips.frame[rows, :, 1] * tips.d_ahead[rows, None]
            aim = aim + g.front.surface.x[tips.node[rows]]
            away = np.linalg.norm(aim[:, None] - g.front.surface.x[reached.node], axis=2)
            found = away.argmin(axis=1)
            end = _rates_of(after[i], found)
            if criterion.method == "closure":
                # exact closure gives means over elements: the tip is half an element before
                d, next_d = tips.d_ahead[rows], advance(reached)[found]
                half = d / (d + next_d)
                begin, end = begin.at(end, -half), begin.at(end, half)
        onset = np.maximum(law.onset_cycles(begin.dG) - before.N, 0.0)
        wait = np.where(before.initiated[part][rows], 0.0, onset)
        passed = element_cycles(law, begin, end, before.da[part][rows])
        grown, pace = before.grown[part][rows], law.growth_rate(first.dG)
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
    regime = law.regime(rates.G_max, rates.G_c)
    moving = regime == Regime.PARIS
    rate = np.where(moving, law.growth_rate(rates.dG), 0.0)
    left = np.maximum(law.onset_cycles(rates.dG) - before.N, 0.0)
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


def advance(tips: Tips) -> Array:
    """Distance by which releasing each tip moves the front, shape (n,), length."""
    return np.where(tips.d_ahead > 0.0, tips.d_ahead, tips.area / tips.width)


def lengths_of(crack: Crack, tips: Tips) -> list[float]:
    """Crack length of each tip: its own on a line, the mean of the front on a surface."""
    mean = crack.extent.length(tips)
    own = dict(crack.extent.lengths()) if crack.front.surface.dim == 1 else {}
    return [own.get(int(node), mean) for node in tips.node]
