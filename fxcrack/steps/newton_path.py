"""Marching a nonlinear continuum: predict on the tangent, correct, find where f = 1 by secants.

Every accepted state is an equilibrium. The next one is sought where the tangent says f = 1 (for
linear bodies exactly there). If f is below 1 it is a step on the way; if above, it is forgotten
and the secant through both ends gives the next guess.
"""

from __future__ import annotations

from collections.abc import Callable

from fxcrack.base import log
from fxcrack.base.errors import ConvergenceError, InputError
from fxcrack.criteria.evaluator import TipValues
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.solvers.increment_work import FINE, EnergyImbalance
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.increment_stepping import TooManyCutbacks
from fxcrack.steps.quasi_static import QuasiStaticDriver

_AT_ONE = 1e-9
"""How near to 1 the criterion must be at an onset."""
_NEAR_ONE = 1e-7
"""How near to 1 the iteration's own tolerance may leave f, where it no longer comes nearer."""
_MANY = 30
"""Times f = 1 is looked for on the way back."""
_NO_WAY = 4e-16
"""Part of the time below which no way is made."""
_SMALLEST = 1e-6
"""Smallest piece of a way, before it counts as impassable."""


class NewtonLoadPath(QuasiStaticDriver):
    """One step on a :class:`~fxcrack.solvers.newton.NewtonSolver`.

    Arguments as for :class:`~fxcrack.steps.driver.StepDriver`.
    """

    solver: NewtonSolver

    def run(self) -> str:
        """March until an end condition holds; returns why the step ended."""
        if self.solver.bodies.dynamic and self.step.stepping != "increment":
            raise InputError(
                f"stepping='{self.step.stepping}' looks for equilibria, but Inertia moves the "
                "bodies in time; use a Dynamic step, or leave Inertia out"
            )
        self.solver.exact = any(
            c.needs_exact_S for g in self.cracks for c in (g.debond.criterion, *g.debond.watch)
        )
        return super().run()

    def _to_crossing(self, target: float, *, upward: bool) -> bool:
        """Go towards a time; stop where the largest f crosses 1.

        Returns:
            Whether it did.

        Raises:
            TooManyCutbacks: No equilibrium was found, however small the increment.
        """
        whole = abs(target - self.time)
        size = self.step.maximum
        beyond: tuple[float, float] | None = None
        idle, strict = 0, True
        while True:
            if self._renew():
                beyond = None  # with other pairs f was another one there
            begin = self.time
            way = min(size, abs(target - begin)) * (1.0 if upward else -1.0)
            guess = self._predicted(begin + way, upward=upward)
            if beyond is not None:
                guess = self._secant(beyond, guess)
                guess = begin + min(max(guess - begin, -size), size)
            here = self.solver.state
            try:
                point, values = self._try(guess, strict=strict)
                level = _largest(values)
                off = level - 1.0 if upward else 1.0 - level
                crossed = off > _AT_ONE and abs(guess - begin) > _SMALLEST * _AT_ONE * whole
                if crossed and not self._goes_back:
                    self.solver.revert()
                    beyond = (guess, level)
                    continue
                if not self.solver.exact:
                    self.solver.confirm(strict=strict)
            except EnergyImbalance as error:
                size = 0.5 * abs(guess - begin)
                strict = size > FINE * whole
                log.info("cut back to an increment of %g: %s", size, error)
                continue
            except ConvergenceError as error:
                size = 0.25 * abs(guess - begin)
                if size < _SMALLEST * whole:
                    raise TooManyCutbacks(str(error)) from error
                log.info("cut back to an increment of %g: %s", size, error)
                continue
            strict = True
            before, self._values = max(self._largest()), values
            self._advance(here, point, guess)
            self.solver.commit()
            if crossed:
                self._back_to_one((begin, before))
                return True
            if off >= -_AT_ONE:
                return True
            if guess == target:
                return False
            idle = idle + 1 if abs(guess - begin) <= _NO_WAY * abs(begin) else 0
            if idle:
                beyond = None
            if idle > _MANY:
                raise TooManyCutbacks(f"f stays at {level:.9g} where it should reach 1")
            if beyond is None:
                size = min(2.0 * size, self.step.maximum)
                self._record("increment")

    @property
    def _goes_back(self) -> bool:
        """Whether a way back leads through the same equilibria: nothing remembers the way there."""
        solver = self.solver
        remembers = solver.bodies.path_dependent or solver.system.soft.bonds or self._ramps
        slides = solver.system.friction is not None or solver.interfaces.follow_sliding
        return not (remembers or slides)

    def _try(self, at: float, *, strict: bool = False) -> tuple[Equilibrium, list[TipValues]]:
        """The equilibrium at a time, a trial, and the criteria there."""
        point = self._move(at, confirm=self.solver.exact, strict=strict)
        return point, self._evaluate_at(point, at)

    def _move(self, at: float, **options: bool) -> Equilibrium:
        loads, force = self.loads_at(at), self._force_at(at)
        return self.solver.move(loads, force, at, at - self.time, **options)

    def _back_to_one(self, other: tuple[float, float]) -> None:
        """From beyond f = 1 to where it is, along the way that led here.

        Args:
            other: A time on the other side of it, with the largest f there.

        Raises:
            TooManyCutbacks: No equilibrium was found.
        """
        for _ in range(_MANY):
            level = max(self._largest())
            if abs(level - 1.0) <= _AT_ONE:
                return
            guess = self._predicted(other[0], upward=other[0] > self.time)
            if guess == other[0]:
                guess = self._secant(other, guess)
            here, begin = self.solver.state, (self.time, level)
            try:
                point, values = self._try(guess)
                if not self.solver.exact:
                    self.solver.confirm()
            except ConvergenceError as error:
                raise TooManyCutbacks(str(error)) from error
            self._values = values
            self._advance(here, point, guess)
            self.solver.commit()
            after = _largest(values)
            if (level - 1.0) * (after - 1.0) < 0.0:
                other = begin
            if abs(after - 1.0) < _NEAR_ONE and abs(after - 1.0) > 0.5 * abs(level - 1.0):
                return  # nearer than the iteration can tell

    def _unload_until(self, excess: Callable[[Equilibrium], float], close: float) -> bool:
        whole, size, back = self.time, self.step.maximum, self.time
        for _ in range(_MANY + int(min(whole / size, 1e4))):
            here, begin, value = self.solver.state, self.time, excess(self.solver.state)
            self._values = self._evaluate()
            if abs(value) <= close:
                return True
            if value > 0.0 and begin <= 0.0:
                return False
            guess = self._zero(excess, value, max(begin - size, 0.0) if value > 0.0 else back)
            try:
                point = self._move(guess)
            except ConvergenceError as error:
                size = 0.25 * abs(guess - begin)
                if size < _SMALLEST * whole:
                    raise TooManyCutbacks(str(error)) from error
                continue
            self._advance(here, point, guess)
            self.solver.commit()
            if value > 0.0:
                back = begin
        raise TooManyCutbacks("the load at the controlled opening is not found")

    def _zero(self, excess: Callable[[Equilibrium], float], value: float, target: float) -> float:
        """Time on the way to a target where the tangent has a quantity at zero, or the target."""
        system = self.solver.system
        saved = self.solver.interface_state()
        begin, done, found = self.time, 0.0, target
        state, loads, force = self.solver.state, self.loads_at(target), self._force_at(target)
        for fraction, point in system.pieces(state, loads, force):
            after = excess(point)
            if value * after <= 0.0:
                found = begin + (target - begin) * (
                    done + value / (value - after) * (fraction - done)
                )
                break
            done, value = fraction, after
        self.solver.restore_interfaces(saved)
        return found

    def _predicted(self, target: float, *, upward: bool) -> float:
        """Time before a target at which f reaches 1 on the tangent; the target if it does not."""
        system = self.solver.system
        saved = self.solver.interface_state()
        here, begin, done, found = self.solver.state, self.time, 0.0, target
        for fraction, point in system.pieces(here, self.loads_at(target), self._force_at(target)):
            a, b = (begin + x * (target - begin) for x in (done, fraction))
            hit = self._hit(self._values, here, point, (a, b), upward=upward) if a != b else None
            if hit is not None:
                found = a + hit * (b - a)
                break
            here, done = point, fraction
        self.solver.restore_interfaces(saved)
        return found

    def _secant(self, beyond: tuple[float, float], predicted: float) -> float:
        """Time between the present one and one at which f was beyond 1, near f = 1."""
        far, level = beyond
        present = max(self._largest())
        degree = max(g.degree for g in self.cracks)
        a, b = present ** (1.0 / degree) - 1.0, level ** (1.0 / degree) - 1.0
        secant = self.time - a * (far - self.time) / (b - a)
        low, high = sorted((self.time, far))
        inside = low < predicted < high
        margin = 1e-3 * (high - low)
        guess = predicted if inside and present > 0.9 else secant
        return float(min(max(guess, low + margin), high - margin))

    def _evaluate_at(self, state: Equilibrium, time: float) -> list[TipValues]:
        # tips anew: normals and lengths at the front follow the bodies
        return [g.evaluate(g.tips(), state, time) for g in self.cracks]

    def _evaluate(self) -> list[TipValues]:
        return self._evaluate_at(self.solver.state, self.time)

    def _renew(self) -> bool:
        """Renew the pairing of faces that have slid, where the bodies move far; whether it has."""
        changed = self.solver.renew_pairs()
        if changed:
            self.work += self.solver.settle(self._force_at(self.time))
            self._values = self._evaluate()
        return changed

    def _pieces(self, target: float) -> list[tuple[float, Equilibrium]]:
        self._renew()
        return [(1.0, self._approach(target, FINE * abs(target - self.time)))]

    def _approach(self, target: float, least: float) -> Equilibrium:
        """A trial at a time; where energies of the way do not add up, half of it is gone first.

        Args:
            target: Time of the trial.
            least: Ways in time that are taken whatever their energies are.
        """
        try:
            return self._move(target, strict=abs(target - self.time) > least)
        except EnergyImbalance as error:
            log.info("half of an increment first: %s", error)
        middle = 0.5 * (self.time + target)
        point = self._approach(middle, least)
        self._advance(self.solver.state, point, middle)
        self.solver.commit()
        self._renew()
        return self._approach(target, least)


def _largest(values: list[TipValues]) -> float:
    return max((float(v.f.max(initial=0.0)) for v in values), default=0.0)
