"""Moving along the load of nonlinear bodies: predict on the tangent, correct, secants to f = 1.

Every accepted state is an equilibrium. The next one is sought where the tangent gives f = 1 (for
linear bodies exactly there). If f is below 1 it is a step on the way; if above, it is undone and
the secant through both ends gives the next guess. Guesses never fall far behind halving
(:class:`fxcrack.base.roots.Bracket`), so that the number of trials is bounded also where f jumps
over 1: softening bonds that run through unstable states.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from fxcrack.base import log
from fxcrack.base.errors import NO_EQUILIBRIUM, EnergyImbalance, InputError
from fxcrack.base.roots import Bracket
from fxcrack.criteria.evaluator import TipValues
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.solvers.increment_work import FINE
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.analysis import Analysis, largest
from fxcrack.steps.increment_control import TooManyCutbacks
from fxcrack.steps.load_path import crossing
from fxcrack.steps.rows import Recorder
from fxcrack.steps.static import Static

_AT_ONE = 1e-9
"""How near to 1 the criterion must be at an onset."""
_NEAR_ONE = 1e-7
"""How near to 1 the iteration's own tolerance may leave f, where it no longer comes nearer."""
_MANY = 30
"""Increments of next to no length after which f is said to stay where it is."""
_MOST = 60
"""Trials in which the controlled opening must be found; halving to round-off needs 53."""
_RESOLVED = 1e-13
"""Part of the time below which a bracket is not divided: f jumps over 1 there."""
_NO_PROGRESS = 1e-7
"""Increments below this part of the time, one after the other, do not lead on."""
_ROUND_OFF = 4e-16
"""Increments below this part of the time are round-off; those in a bracket may be short."""
_NUDGE = 1e-12
"""Part of the time by which the load goes on where increments of next to no length leave f below
1; twice as much with each of them."""
_SMALLEST = 1e-6
"""Smallest increment, as a part of the whole, before the search is given up."""


class NewtonLoadPath:
    """The way along the load of nonlinear bodies.

    Args:
        analysis: The analysis, prepared for the step.
        solver: Its solver.
        step: Controls; ``maximum`` limits the increments.
        record: Adds a row to the history; event "increment" at each equilibrium on the way.

    Raises:
        InputError: The step looks for equilibria, but the bodies move in time.
    """

    resolution = _NEAR_ONE

    def __init__(
        self, analysis: Analysis, solver: NewtonSolver, step: Static, record: Recorder
    ) -> None:
        if solver.bodies.dynamic and step.stepping != "increment":
            raise InputError(
                f"stepping='{step.stepping}' looks for equilibria, but Inertia moves the "
                "bodies in time; use a Dynamic step, or leave Inertia out"
            )
        self._analysis = analysis
        self._solver = solver
        self._maximum = step.maximum
        self._record = record
        solver.exact = any(
            c.needs_exact_S for g in analysis.active for c in (g.debond.criterion, *g.debond.watch)
        )

    def to_crossing(self, target: float, *, upward: bool) -> bool:
        """See :meth:`fxcrack.steps.load_path.LoadPath.to_crossing`.

        Raises:
            TooManyCutbacks: No equilibrium was found, however small the increment.
        """
        whole = abs(target - self._analysis.time)
        size = self._maximum
        beyond: tuple[float, float] | None = None
        bracket: Bracket | None = None
        accepted, idle, strict = 0, 0, True  # increments accepted since the last cutback
        undecided = 0  # how often f was on both sides of 1 at one load
        previous: tuple[float, float] | None = None  # time and f before the last increment
        while True:
            if self._renew():
                beyond = bracket = None  # with other pairs f was another one there
                off = (self._analysis.largest - 1.0) * (1.0 if upward else -1.0)
                if off >= -_AT_ONE:
                    # f = 1 lies between its values before and after: it is that of the new pairs
                    if off > _AT_ONE and previous is not None and self._reversible:
                        self._back_to_one(previous)
                    return True
            begin = self._analysis.time
            way = min(size, abs(target - begin)) * (1.0 if upward else -1.0)
            guess = self._predicted(begin + way, upward=upward)
            if idle and beyond is None:
                # the tangent has bonds run through unstable states at this very load, and the
                # iteration finds the state before them: go on, a little at first
                least = min(abs(way), _NUDGE * 2.0**idle * abs(begin))
                if abs(guess - begin) < least:
                    guess = begin + (least if upward else -least)
            jumps = False
            if beyond is not None:
                bracket = bracket or Bracket(begin, beyond[0])
                guess = bracket.admit(self._secant(beyond, guess), begin, beyond[0])
                guess = begin + min(max(guess - begin, -size), size)
                jumps = abs(beyond[0] - begin) <= _RESOLVED * max(abs(begin), abs(beyond[0]))
                if jumps:
                    guess, strict = beyond[0], False
            try:
                point, values = self._try(guess, strict=strict)
                level = largest(values)
                off = level - 1.0 if upward else 1.0 - level
                crossed = off > _AT_ONE and abs(guess - begin) > _SMALLEST * _AT_ONE * whole
                crossed = crossed and not jumps
                if crossed and not self._reversible:
                    self._solver.revert()
                    beyond = (guess, level)
                    continue
                if not self._solver.exact:
                    self._solver.confirm(strict=strict)
            except EnergyImbalance as error:
                size, accepted = 0.5 * abs(guess - begin), 0
                strict = size > FINE * whole
                if size < _SMALLEST * whole:
                    raise TooManyCutbacks(str(error)) from error
                log.info("cut back to an increment of %g: %s", size, error)
                continue
            except NO_EQUILIBRIUM as error:
                size, accepted = 0.25 * abs(guess - begin), 0
                if size < _SMALLEST * whole:
                    raise TooManyCutbacks(str(error)) from error
                log.info("cut back to an increment of %g: %s", size, error)
                continue
            strict = True
            before, self._analysis.tip_values = self._analysis.largest, values
            self._analysis.advance(point, guess)
            self._solver.commit()
            previous = begin, before
            if crossed:
                self._back_to_one((begin, before))
                return True
            if off >= -_AT_ONE:
                if jumps and off > _AT_ONE:
                    self._report_jump(before, level, bracket)
                return True
            undecided += jumps
            if undecided and self._by_yielding:
                self._until_yielding(target, upward=upward)
                self._report_jump(level, self._analysis.largest, bracket)
                return True
            if undecided > 1:
                self._report_jump(before, level, bracket)
                return True
            if -off < _NEAR_ONE and -off > 0.5 * abs(before - 1.0):
                return True  # nearer than the iteration can resolve
            if guess == target:
                return False
            short = _NO_PROGRESS if beyond is None else _ROUND_OFF
            still = abs(guess - begin) <= short * abs(begin)
            if still:
                idle += 1
            elif beyond is None:
                idle = 0
            if still or jumps:
                beyond = bracket = None
            if idle > _MANY:
                raise TooManyCutbacks(f"f stays at {level:.9g} where it should reach 1")
            accepted += 1
            if beyond is None or accepted > 1:
                size = min(2.0 * size, self._maximum)
            if beyond is None:
                self._record("increment")

    def _report_jump(self, before: float, level: float, bracket: Bracket | None) -> None:
        """Say that f has no value of 1: it jumps, where bonds run through unstable states."""
        trials = 0 if bracket is None else bracket.trials
        log.info(
            "f jumps from %.6g to %.6g at time %.9g, found in %d trials",
            before, level, self._analysis.time, trials,
        )  # fmt: skip
        self._record("snap")

    @property
    def _by_yielding(self) -> bool:
        """Whether f is that of a tangent which is another one where the bodies yield."""
        return self._solver.exact and self._solver.bodies.path_dependent

    def _until_yielding(self, target: float, *, upward: bool) -> None:
        """Go on, a little at first, until bodies whose yielding takes f over 1 do yield.

        They begin to at the present load, but increments of next to no length do not show it: f
        would be found on both sides of 1 at this load again and again.
        """
        step = _RESOLVED
        while (self._analysis.largest < 1.0) == upward and step < _NO_PROGRESS:
            begin = self._analysis.time
            way = min(step * abs(begin), abs(target - begin))
            guess = begin + (way if upward else -way)
            try:
                point, values = self._try(guess)
            except NO_EQUILIBRIUM:
                return
            self._analysis.tip_values = values
            self._analysis.advance(point, guess)
            self._solver.commit()
            step *= 2.0

    @property
    def _reversible(self) -> bool:
        """Whether the way back passes through the same equilibria: nothing depends on the path."""
        solver = self._solver
        dependent = solver.bodies.path_dependent or solver.system.soft.bonds or self._analysis.ramps
        # faces are paired anew before an increment only, never on the way back
        return not (dependent or solver.system.friction is not None)

    def _try(self, at: float, *, strict: bool = False) -> tuple[Equilibrium, list[TipValues]]:
        """The equilibrium at a time, a trial, and the criteria there."""
        point = self._move(at, confirm=self._solver.exact, strict=strict)
        return point, self._analysis.evaluate(point, at)

    def _move(self, at: float, **options: bool) -> Equilibrium:
        loads, force = self._analysis.loads_at(at), self._analysis.given_force(at)
        return self._solver.move(loads, force, at, at - self._analysis.time, **options)

    def _back_to_one(self, other: tuple[float, float]) -> None:
        """From beyond f = 1 to where it is, along the way that led here.

        Args:
            other: A time on the other side of it, with the largest f there.

        Raises:
            TooManyCutbacks: No equilibrium was found.
        """
        bracket = Bracket(self._analysis.time, other[0])
        while True:
            begin, level = self._analysis.time, self._analysis.largest
            if abs(level - 1.0) <= _AT_ONE:
                return
            guess = self._predicted(other[0], upward=other[0] > begin)
            if guess == other[0]:
                guess = self._secant(other, guess)
            guess = bracket.admit(guess, begin, other[0])
            if abs(other[0] - begin) <= _RESOLVED * max(abs(begin), abs(other[0])):
                log.info("f comes no nearer to 1 than %.9g in %d trials", level, bracket.trials)
                return
            try:
                point, values = self._try(guess)
                if not self._solver.exact:
                    self._solver.confirm()
            except NO_EQUILIBRIUM as error:
                raise TooManyCutbacks(str(error)) from error
            self._analysis.tip_values = values
            self._analysis.advance(point, guess)
            self._solver.commit()
            after = largest(values)
            if (level - 1.0) * (after - 1.0) < 0.0:
                other = (begin, level)
            if abs(after - 1.0) < _NEAR_ONE and abs(after - 1.0) > 0.5 * abs(level - 1.0):
                return  # nearer than the iteration can resolve

    def back_to(
        self, excess: Callable[[Equilibrium], float], tolerance: float, floor: float = 0.0
    ) -> bool:
        """See :meth:`fxcrack.steps.load_path.LoadPath.back_to`.

        Raises:
            TooManyCutbacks: No equilibrium was found.
        """
        whole, size = self._analysis.time - floor, self._maximum
        above, below = (
            self._analysis.time,
            None,
        )  # times at which the quantity is positive and negative
        bracket: Bracket | None = None
        for _ in range(_MOST + int(min(whole / size, 1e4))):
            begin, value = self._analysis.time, excess(self._solver.state)
            self._analysis.evaluate_tips()
            if abs(value) <= tolerance:
                return True
            if value > 0.0 and begin <= floor:
                return False
            if value > 0.0:
                above, end = begin, max(begin - size, floor)
            else:
                below, end = begin, above
            guess = self._zero(excess, value, end)
            if below is not None:
                bracket = bracket or Bracket(below, above)
                guess = bracket.admit(guess, below, above)
            try:
                point = self._move(guess)
            except NO_EQUILIBRIUM as error:
                size = 0.25 * abs(guess - begin)
                if size < _SMALLEST * whole:
                    raise TooManyCutbacks(str(error)) from error
                continue
            self._analysis.advance(point, guess)
            self._solver.commit()
        raise TooManyCutbacks("the load at the controlled opening is not found")

    def _predictions(self, target: float) -> Iterator[tuple[float, Equilibrium]]:
        """Linear pieces to a time on the tangent: the fraction at which each ends, and its end."""
        loads, force = self._analysis.loads_at(target), self._analysis.given_force(target)
        return self._solver.system.pieces(self._solver.state, loads, force)

    def _zero(self, excess: Callable[[Equilibrium], float], value: float, target: float) -> float:
        """Time on the way to a target where the tangent has a quantity at zero, or the target."""
        saved = self._solver.interface_state()
        begin, done, found = self._analysis.time, 0.0, target
        for fraction, point in self._predictions(target):
            after = excess(point)
            if value * after <= 0.0:
                found = begin + (target - begin) * (
                    done + value / (value - after) * (fraction - done)
                )
                break
            done, value = fraction, after
        self._solver.restore_interfaces(saved)
        return found

    def _predicted(self, target: float, *, upward: bool) -> float:
        """Time before a target at which f reaches 1 on the tangent; the target if it does not."""
        saved = self._solver.interface_state()
        here, begin, done, found = self._solver.state, self._analysis.time, 0.0, target
        for fraction, point in self._predictions(target):
            a, b = (begin + x * (target - begin) for x in (done, fraction))
            hit = None
            if a != b:
                values = self._analysis.tip_values
                hit = crossing(self._analysis, values, (here, point), (a, b), upward=upward)
            if hit is not None:
                found = a + hit * (b - a)
                break
            here, done = point, fraction
        self._solver.restore_interfaces(saved)
        return found

    def _secant(self, beyond: tuple[float, float], predicted: float) -> float:
        """Time between the present one and one at which f was beyond 1, near f = 1."""
        far, level = beyond
        present = self._analysis.largest
        degree = max(g.degree for g in self._analysis.active)
        a, b = present ** (1.0 / degree) - 1.0, level ** (1.0 / degree) - 1.0
        secant = self._analysis.time - a * (far - self._analysis.time) / (b - a)
        low, high = sorted((self._analysis.time, far))
        inside = low < predicted < high
        margin = 1e-3 * (high - low)
        guess = predicted if inside and present > 0.9 else secant
        return float(min(max(guess, low + margin), high - margin))

    def _renew(self) -> bool:
        """Renew the pairing of faces that have slid, where the bodies move far; whether it has."""
        changed = self._solver.renew_pairs()
        if changed:
            here = self._solver.state
            work = self._solver.settle(self._analysis.given_force(self._analysis.time))
            if work is not None:
                self._analysis.book(here, self._solver.state, *work)
            self._analysis.evaluate_tips()
        return changed

    def over_increment(self, target: float) -> None:
        """See :meth:`fxcrack.steps.load_path.LoadPath.over_increment`.

        Raises:
            ConvergenceError: No equilibrium was found.
        """
        self._renew()
        end = self._approach(target, FINE * abs(target - self._analysis.time))
        self._analysis.advance(end, target)

    def _approach(self, target: float, least: float) -> Equilibrium:
        """A trial at a time; where the energies of the increment do not balance, half of it first.

        Args:
            target: Time of the trial.
            least: Increments of time that are not divided; their energies are known less well.

        Raises:
            EnergyImbalance: An increment of that length ends in no equilibrium of its work.
        """
        try:
            return self._move(target, strict=abs(target - self._analysis.time) > least)
        except EnergyImbalance as error:
            if abs(target - self._analysis.time) <= least:
                raise
            log.info("half of an increment first: %s", error)
        middle = 0.5 * (self._analysis.time + target)
        point = self._approach(middle, least)
        self._analysis.advance(point, middle)
        self._solver.commit()
        self._renew()
        return self._approach(target, least)
