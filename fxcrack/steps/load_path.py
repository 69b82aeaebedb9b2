"""Moving along the load: pieces of equilibria, the load at which f = 1, and the way back.

States, energies and rows of the history are kept by :class:`~fxcrack.steps.driver.StepDriver`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from fxcrack.base.errors import ComesApart, InputError
from fxcrack.equilibrium.contact import Equilibrium, blend
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.steps.driver import LARGE, StepDriver

BEYOND = 1e30
"""A step without an end time that loads beyond this time would go on for ever."""


class LoadPath(StepDriver):
    """Ways along the load of one step, at constant bonds.

    Arguments as for :class:`~fxcrack.steps.driver.StepDriver`.
    """

    def _load_at_once(self) -> None:
        """Apply loads that are there from the first moment of the step, in proportion."""
        wanted, present = self.loads_at(self.time), self.solver.state.loads
        if np.abs(wanted - present).max(initial=0.0) > 1e-12 * np.abs(wanted).max(initial=0.0):
            self._follow(self._pieces(self.time), self.time)
            self.solver.commit()
            self._values = self._evaluate()

    def _pieces(self, target: float) -> list[tuple[float, Equilibrium]]:
        return list(
            self.solver.system.pieces(
                self.solver.state, self.loads_at(target), self._force_at(target)
            )
        )

    def _along(self, target: float) -> Iterator[tuple[float, Equilibrium]]:
        """Pieces of the way to a time; where it leads nowhere, back to the last one reached."""
        path = self.solver.system.pieces(
            self.solver.state, self.loads_at(target), self._force_at(target)
        )
        while True:
            books = self._snapshot()
            try:
                piece = next(path, None)
            except (NotPositiveDefinite, ComesApart):
                self._rollback(books)
                raise
            if piece is None:
                return
            yield piece

    def _follow(self, pieces: list[tuple[float, Equilibrium]], target: float) -> None:
        for _, point in pieces:
            self._advance(self.solver.state, point, target)
        self.time = target

    def _snapshot(self) -> Any:
        """What :meth:`_undo` needs to return to the present equilibrium."""
        kept = (
            self.time, self.increment, self.solver.state,
            self.work, self.released, self._by_force, self.viscous,
        )  # fmt: skip
        return kept, self.solver.remember(), self._values, self.solver.friction_energy

    def _rollback(self, books: Any) -> float:
        """Return to an earlier equilibrium, with the same bonds, and its time."""
        kept, states, self._values, self.solver.friction_energy = books
        (
            self.time, self.increment, self.solver.state,
            self.work, self.released, self._by_force, self.viscous,
        ) = kept  # fmt: skip
        self.solver.recall(states)
        return self.time

    def _breaks_ahead(self) -> list[float]:
        small = 1e-12 * abs(self.time)
        own = [t for ramp in self._ramps for t in ramp.breaks()]
        own += [t for g in self.cracks for t in g.evaluator.breaks()]
        return [b for b in (*self.breaks, *own) if b > self.time + small]

    def _load_to_event(self) -> bool:
        """Load until f = 1 somewhere, an amplitude bends or the end time comes.

        Returns:
            False if the load grew beyond all bounds without an event; the state is then that of
            the last event, or that of time 1, the loads as they were given, if none was before.
        """
        limit = min([self._end_time, *self._breaks_ahead()])
        if limit >= LARGE and self._only_round_off():
            return False
        begin, rows = None, len(self.history)
        if self.time > 0.0:
            begin = self._snapshot()
        guess = self._next_guess()
        while guess <= BEYOND or limit < LARGE:
            if self._to_crossing(min(guess, limit), upward=True) or self.time >= limit:
                return True
            if begin is None or len(self.history) > rows:
                begin, rows = self._snapshot(), len(self.history)
            guess = max(2.0 * self.time, self._next_guess())
        self._rollback(begin)
        return False

    def _only_round_off(self) -> bool:
        """Whether f under a proportional load is left over from releases, not a real force.

        Arms on their last bonded node may turn freely; only a load thousands of times (with an
        energy release rate) that of the last release would bring their f, which is round-off, to 1.
        """
        if self.breaks or self.solver.system.soft.bonds or self.time <= 0.0:
            return False
        by_load = all(g.criterion.depends_on_load for g in self.cracks)
        released = any(g.n_released for g in self.cracks)
        return by_load and released and max(self._largest()) < 1e-8

    def _next_guess(self) -> float:
        """A time a little after the one at which f would reach 1 under a proportional load."""
        largest = [
            v.f.max(initial=0.0) ** (1.0 / g.degree)
            for g, v in zip(self.cracks, self._values, strict=True)
            if v.f.max(initial=0.0) > 0.0
        ]
        if largest and self.time > 0.0:
            return float(self.time * min(1.02 / min(max(largest), 1.0), 1e3))
        return max(1.0, 2.0 * self.time)

    def _curves_have_ended(self) -> bool:
        """Whether growth follows curves of time alone, which end before the step does."""
        ends = [
            g.evaluator.ends for g, v in zip(self.cracks, self._values, strict=True) if len(v.tips)
        ]
        if not ends or max(ends) > self.time:
            return False
        return self._end_time >= LARGE and not self._breaks_ahead()

    def _unload_to_event(self) -> None:
        if not self._to_crossing(0.0, upward=False):
            raise InputError("stepping='path': f stays above 1 down to zero load; check prestress")

    def _unload_until(self, excess: Callable[[Equilibrium], float], close: float) -> bool:
        """Take load away until a quantity that is linear along pieces has fallen to zero.

        Args:
            excess: The quantity in a state.
            close: What counts as zero where it cannot be met exactly.

        Returns:
            Whether it did before the load was gone.
        """
        begin = self.time
        for fraction, point in self._along(0.0):
            here, start = self.solver.state, self.time
            a, b = excess(here), excess(point)
            end = begin * (1.0 - fraction)
            if b <= 0.0:
                hit = a / (a - b)
                self._advance(here, blend(here, point, hit), start + hit * (end - start))
                self._values = self._evaluate()
                return True
            self._advance(here, point, end)
        self._values = self._evaluate()
        return False

    def _to_crossing(self, target: float, *, upward: bool) -> bool:
        """Go towards a time; stop where the largest f crosses 1.

        Returns:
            Whether it did.
        """
        system = self.solver.system
        begin = self.time
        values = self._values
        snaps = system.soft.counts.snaps
        for fraction, point in self._along(target):
            here = self.solver.state
            times = (self.time, begin + fraction * (target - begin))
            if system.soft.counts.snaps > snaps:
                snaps = system.soft.counts.snaps
                # an unstable state was passed: no equilibrium lies in between
                self._advance(here, point, times[1])
                self._values = self._evaluate()
                self._record("snap")
                if upward and max(self._largest()) >= 1.0:
                    return True
                continue
            hit = self._hit(values, here, point, times, upward=upward)
            if hit is None:
                self._advance(here, point, times[1])
                continue
            self._advance(here, blend(here, point, hit), times[0] + hit * (times[1] - times[0]))
            self._values = self._evaluate()
            return True
        self.time = target
        self._values = self._evaluate()
        return False
