"""One cycle: equilibria on the way of its loads, and the extremes of G at each tip.

Between two equilibria without a change of contact, forces and openings of linear bodies are linear
in the fraction x of the way and G is a parabola in it,

    G(x) = 1/2 F(x) w(x)/A,      dG = max G - min G,

so one equilibrium per corner of the cycle is enough. Where contact changes in between, or bodies
are not linear, the piece is halved until its middle lies on that parabola, to a tolerance. With
friction on nonlinear bodies the way cannot be taken up in its middle; there the whole cycle is
passed anew, at twice as many instants each time, until the extremes of G keep to the tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.base.errors import NO_EQUILIBRIUM
from fxcrack.criteria import CycleRates, Regime, total
from fxcrack.criteria.evaluator import repeat_tips
from fxcrack.criteria.rate_evaluator import RateEvaluator
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.interface.tips import Tips
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.cycle_equilibria import Corner, CycleEquilibria, Instant
from fxcrack.steps.cycle_state import TipCycle
from fxcrack.steps.element_growth import advance, cyclic_parts

_GRID = np.linspace(0.0, 1.0, 5)
_HALVINGS = 8
"""How often a piece of the cycle that is no parabola is halved at most."""
_SAMPLINGS = 6
"""How often each piece of a cycle with friction is halved at most."""
_NOTHING = 1e-6
"""Rates below this part of the largest one along the fronts are round-off."""
_SETTLING = 20
"""Cycles that friction gets to settle."""


class StabilisedCycle:
    """Solves the cycle of a step at the present fronts.

    Args:
        analysis: The analysis, at the maximum of the cycle.
        equilibria: Finds equilibria of its bodies.
        change: How far G may lie from the parabola between two equilibria, over G_max.
    """

    def __init__(self, analysis: Analysis, equilibria: CycleEquilibria, change: float) -> None:
        self._analysis = analysis
        self._equilibria = equilibria
        self._change = change

    def stabilised(self, corners: Sequence[Corner]) -> list[TipCycle]:
        """What the cycle does at the tips of each interface; collective.

        The state is that of the first corner, before and after.

        Args:
            corners: Corners of the cycle, the first at its maximum.
        """
        try:
            way = self._way(corners)
        except (NotPositiveDefinite, *NO_EQUILIBRIUM):
            self._equilibria.end()  # the step ends at the maximum of the cycle
            raise
        self._equilibria.end()
        return self._extremes(way)

    def _way(self, corners: Sequence[Corner]) -> list[Instant]:
        """Instants of the stabilised cycle between which G is a parabola."""
        equilibria, ends = self._equilibria, list(corners[1:])
        if len(ends) > 1 or equilibria.settles:
            ends.append(corners[0])
        instants, largest = self._once(equilibria.begin(corners[0]), ends)
        if equilibria.settles:
            # slips settle over some cycles
            for _ in range(_SETTLING):
                before = largest
                instants, largest = self._once(instants[-1], ends)
                if np.all(np.abs(largest - before) <= self._change * largest):
                    break
            else:
                N = self._analysis.fatigue.N
                log.warn("friction does not settle in the cycle at N = %g", N)
        if equilibria.in_order:
            return self._sampled(instants, [corners[0], *ends])
        way = instants[:1]
        for a, b in pairwise(instants):
            way += self._between(a, b, largest, _HALVINGS)
        return way

    def _sampled(self, way: list[Instant], corners: list[Corner]) -> list[Instant]:
        """Instants of a cycle so close that the extremes of G do not change by twice as many.

        Args:
            way: Instants of the settled cycle, one per corner.
            corners: Corners of the cycle from its maximum back to it.
        """
        before = self._ranges(way)
        for halvings in range(1, _SAMPLINGS + 1):
            parts = np.arange(1, 2**halvings + 1) / 2**halvings
            fine = [a.towards(b, x) for a, b in pairwise(corners) for x in parts.tolist()]
            way, _ = self._once(way[-1], fine)
            now = self._ranges(way)
            # rates of round-off must not ask for more instants
            size = np.maximum(now[1], _NOTHING * now[1].max(initial=0.0))
            if np.all(np.abs(now - before) <= self._change * size):
                return way
            before = now
        N = self._analysis.fatigue.N
        log.warn("friction changes too often in the cycle at N = %g to follow G", N)
        return way

    def _ranges(self, way: list[Instant]) -> Array:
        """Smallest and largest total rate at each tip, shape (2, n_tips) [force/length]."""
        pieces = []
        for a, b in pairwise(way):
            sums = [np.zeros((2, 0))]
            for i, (g, v) in enumerate(self._analysis.at_tips()):
                if len(v.tips):
                    evaluator = cyclic_parts(g)[1]
                    rates, _ = rates_between(evaluator, v.tips, a.measured[i], b.measured[i])
                    found = total(rates)
                    sums.append(np.stack([found.min(axis=0), found.max(axis=0)]))
            pieces.append(np.concatenate(sums, axis=1))
        every = np.array(pieces)
        return np.stack([every[:, 0].min(axis=0), every[:, 1].max(axis=0)])

    def _once(self, start: Instant, ends: list[Corner]) -> tuple[list[Instant], Array]:
        """Instants of one cycle and the largest rate at each tip."""
        found = [start]
        for corner in ends:
            found += self._equilibria.to(found[-1], corner)
        return found, np.stack([self._totals(c.measured) for c in found]).max(axis=0)

    def _between(self, a: Instant, b: Instant, largest: Array, halvings: int) -> list[Instant]:
        """Instants after a up to b between which G is a parabola, to the tolerance of the step."""
        if b.follows(a):
            return [b]
        (middle,) = self._equilibria.to(a, a.corner.middle(b.corner))
        found = self._totals(middle.measured)
        guess = self._totals([0.5 * (x + y) for x, y in zip(a.measured, b.measured, strict=True)])
        if np.all(np.abs(found - guess) <= self._change * np.maximum(largest, found)):
            return [middle, b]
        if not halvings:
            N = self._analysis.fatigue.N
            log.warn("contact or stiffness changes too often in the cycle at N = %g to follow G", N)
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

    def _extremes(self, way: list[Instant]) -> list[TipCycle]:
        out: list[TipCycle] = []
        for i, (g, v) in enumerate(self._analysis.at_tips()):
            criterion, evaluator = cyclic_parts(g)
            if not len(v.tips):
                out.append(TipCycle(CycleRates(*np.zeros((5, 0))), np.zeros(0), np.zeros((0, 0))))
                continue
            pieces = [
                rates_between(evaluator, v.tips, a.measured[i], b.measured[i])
                for a, b in pairwise(way)
            ]
            rates, measured = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
            found = criterion.cycle(rates, evaluator.toughness[v.tips.node])
            peak = measured[total(rates).argmax(axis=0), range(len(v.tips))]
            law = criterion.growth_law
            regime = law.regimes(found)
            growth = np.where(regime == Regime.PARIS, law.growth(found), 0.0)
            growth = np.where(regime == Regime.UNSTABLE, advance(v.tips), growth)
            out.append(TipCycle(found, growth, peak))
        return out


def rates_between(evaluator: RateEvaluator, tips: Tips, a: Array, b: Array) -> tuple[Array, Array]:
    """Energy release rates on a linear piece of the cycle, the extremes of their sum among them.

    The sum is a parabola wherever no mode is clipped at zero. It is taken at five points and at
    the vertices of the parabolas around the smallest and the largest of these.

    Args:
        evaluator: The criterion on its interface.
        tips: Front nodes.
        a: What it measured at the beginning of the piece, shape (n, m).
        b: The same at the end.

    Returns:
        Rates by mode, shape (7, n, 3), force/length; what belongs to them, shape (7, n, m).
    """
    n = len(tips)
    many = np.stack([(1.0 - x) * a + x * b for x in _GRID])
    flat = many.reshape(-1, many.shape[2])
    rates = [evaluator.rates(repeat_tips(tips, len(_GRID)), flat).reshape(len(_GRID), n, 3)]
    measured = [many]
    sums = total(rates[0])
    for place in (sums.argmin(axis=0), sums.argmax(axis=0)):
        i = np.clip(place, 1, len(_GRID) - 2)
        left, middle, right = (np.take_along_axis(sums, i[None] + k, 0)[0] for k in (-1, 0, 1))
        bend = left - 2.0 * middle + right
        shift = np.divide(0.5 * (left - right), bend, out=np.zeros(n), where=bend != 0.0)
        x = np.clip(_GRID[i] + _GRID[1] * shift, 0.0, 1.0)[:, None]
        measured.append(((1.0 - x) * a + x * b)[None])
        rates.append(evaluator.rates(tips, measured[-1][0])[None])
    return np.concatenate(rates), np.concatenate(measured)
