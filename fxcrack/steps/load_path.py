"""Moving along the load at constant bonds: to where f = 1, back to an opening, over an increment.

:class:`LoadPath` says what a driver may ask for; :class:`LinearLoadPath` is that of linear bodies,
on which equilibria are known piece by piece (contact and cohesive bonds change in between).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

from fxcrack.base.errors import ComesApart
from fxcrack.criteria.evaluator import TipValues
from fxcrack.equilibrium.contact import Equilibrium, blend
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.steps.analysis import Analysis, largest
from fxcrack.steps.rows import Recorder

_SAME = 1e-9
"""Values of f that differ by less are the same."""


class LoadPath(Protocol):
    """Moves an analysis along the load of its step, at constant bonds; collective.

    Attributes:
        resolution: How near to 1 the largest f is at a crossing at least.
    """

    resolution: float

    def to_crossing(self, target: float, *, upward: bool) -> bool:
        """Advance towards a time; stop where the largest f crosses 1.

        Args:
            target: The time.
            upward: Whether f is expected to rise to 1, or to fall to it.

        Returns:
            Whether it crossed 1. The tip values are those of the state reached: f is 1 there, but
            for a state reached through unstable ones, at which f has jumped over 1.
        """

    def back_to(
        self, excess: Callable[[Equilibrium], float], tolerance: float, floor: float = 0.0
    ) -> bool:
        """Take load away until a quantity has fallen to zero.

        Args:
            excess: The quantity in a state, linear along linear pieces.
            tolerance: What counts as zero where it cannot be met exactly.
            floor: Time at which the search ends; at 0 no proportional load is left.

        Returns:
            Whether it fell to zero before that time.
        """

    def over_increment(self, target: float) -> None:
        """Advance to a time, whatever f becomes on the way; this may be undone by a rollback."""


def crossing(
    analysis: Analysis,
    values: list[TipValues],
    ends: tuple[Equilibrium, Equilibrium],
    times: tuple[float, float],
    *,
    upward: bool,
) -> float | None:
    """Fraction of a linear piece at which the largest f of all active cracks crosses 1.

    Args:
        analysis: The analysis.
        values: Values of the criteria before, one entry per active crack.
        ends: Equilibria at both ends of the piece.
        times: Their times.
        upward: Look for f rising to 1, or falling to it.

    Returns:
        Fraction between 0 and 1, ``None`` if f stays on its side.
    """
    found = [
        g.crossing(v, *ends, times, upward=upward)
        for g, v in zip(analysis.active, values, strict=True)
    ]
    if upward:
        return min([x for x in found if x is not None], default=None)
    # all interfaces must be below 1; one without tips does not count
    waiting = [x for x, v in zip(found, values, strict=True) if len(v.tips)]
    if not waiting or None in waiting:
        return None
    last = max(x for x in waiting if x is not None)
    if len(waiting) > 1:
        # beside constant loads one may have risen above 1 again before another has fallen to it
        time = times[0] + last * (times[1] - times[0])
        if largest(analysis.evaluate(blend(*ends, last), time)) > 1.0 + _SAME:
            return None
    return last


class LinearLoadPath:
    """The way along the load of linear bodies.

    Args:
        analysis: The analysis, prepared for the step.
        record: Adds a row to the history; event "snap" where cohesive bonds ran through unstable
            states.
    """

    resolution = 1e-9

    def __init__(self, analysis: Analysis, record: Recorder) -> None:
        self._analysis = analysis
        self._record = record

    def to_crossing(self, target: float, *, upward: bool) -> bool:
        """See :meth:`LoadPath.to_crossing`."""
        analysis, system = self._analysis, self._analysis.condensed.system
        begin, values = analysis.time, analysis.tip_values
        snaps = system.soft.counts.snaps
        for fraction, point in self._pieces_to(target):
            here = analysis.solver.state
            times = (analysis.time, begin + fraction * (target - begin))
            if system.soft.counts.snaps > snaps:
                snaps = system.soft.counts.snaps
                # an unstable state was passed: no equilibrium lies in between
                analysis.advance(point, times[1])
                analysis.evaluate_tips()
                self._record("snap")
                if (analysis.largest >= 1.0) == upward:
                    return True
                continue
            hit = crossing(analysis, values, (here, point), times, upward=upward)
            if hit is None:
                analysis.advance(point, times[1])
                continue
            time = times[0] + hit * (times[1] - times[0])
            analysis.advance(blend(here, point, hit), time)
            analysis.evaluate_tips()
            return True
        analysis.time = target
        analysis.evaluate_tips()
        return False

    def back_to(
        self, excess: Callable[[Equilibrium], float], tolerance: float, floor: float = 0.0
    ) -> bool:
        """See :meth:`LoadPath.back_to`; zero is met exactly."""
        analysis = self._analysis
        begin = analysis.time
        for fraction, point in self._pieces_to(floor):
            here, start = analysis.solver.state, analysis.time
            a, b = excess(here), excess(point)
            end = begin * (1.0 - fraction) + fraction * floor
            if b <= 0.0:
                hit = a / (a - b)
                analysis.advance(blend(here, point, hit), start + hit * (end - start))
                analysis.evaluate_tips()
                return True
            analysis.advance(point, end)
        analysis.evaluate_tips()
        return False

    def over_increment(self, target: float) -> None:
        """See :meth:`LoadPath.over_increment`."""
        # all pieces first: where one leads nowhere, no energy is accounted for
        for _, point in list(self._pieces(target)):
            self._analysis.advance(point, target)
        self._analysis.time = target

    def _pieces(self, target: float) -> Iterator[tuple[float, Equilibrium]]:
        """Linear pieces of the way to a time: the fraction at which each ends, and its end."""
        analysis = self._analysis
        loads, force = analysis.loads_at(target), analysis.given_force(target)
        return analysis.condensed.system.pieces(analysis.solver.state, loads, force)

    def _pieces_to(self, target: float) -> Iterator[tuple[float, Equilibrium]]:
        """The same; where a piece leads nowhere, back to the end of the last one."""
        path = self._pieces(target)
        while True:
            saved = self._analysis.snapshot()
            try:
                piece = next(path, None)
            except (NotPositiveDefinite, ComesApart):
                self._analysis.rollback(saved)
                raise
            if piece is None:
                return
            yield piece
