"""Trials of a nonlinear model: from one equilibrium to the next, kept or forgotten.

Between two accepted states the dense system holds the tangent: it predicts the way, SNES corrects
the end (:mod:`fxcrack.solve.newton_way`).
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fxcrack.errors import ConvergenceError
from fxcrack.solve import newton
from fxcrack.solve.cholesky import NotPositiveDefinite
from fxcrack.solve.jump_system import Equilibrium
from fxcrack.solve.linear_jumps import Snapshot
from fxcrack.solve.newton import InterfaceProblem
from fxcrack.solve.newton_tangent import TangentModel
from fxcrack.solve.newton_way import Move, OffBalance, Way
from fxcrack.solve.rubbing import Slide

Array = npt.NDArray[np.float64]

_FAR_OFF = 1e-5
"""A tangent made where more than this part of the forces was out of balance gives way to that of
the state itself when one is accepted."""
_NOISE = 10.0
"""Energies on a way may be off by so many times the residual left times the step."""
_UNSTABLE = (
    "the equilibrium found is unstable (buckling, or a limit load was passed); take smaller "
    "increments, or control a displacement instead of a force"
)


class TrialModel(TangentModel):
    """Nonlinear bodies that move from equilibrium to equilibrium.

    Arguments as for :class:`~fxcrack.solve.newton_tangent.TangentModel`.

    Attributes:
        last_move: The last trial.
        largest_energy: The largest one stored in an accepted state that was looked at.
    """

    def __init__(self, *parts: Any, **controls: Any) -> None:
        super().__init__(*parts, **controls)
        self._trial_at = 0.0
        self._begun = False  # whether the last trial was an increment of time for the terms
        self._trial: PETSc.Vec | None = None
        self._trial_drift = 0.0
        self._energies: dict[str, float] | None = None  # of the accepted state, once looked at
        self._trial_energies: dict[str, float] | None = None
        self._noise = 0.0  # of the energies on the way to the trial
        self.largest_energy = 0.0
        self._answers = np.zeros(0)  # forces of the last coordinates at the trial's end
        self._way: Way | None = None  # to a trial that is not confirmed yet
        self.last_move: Move | None = None

    def move(
        self,
        loads: Array,
        force: Array,
        at: float,
        dt: float,
        *,
        follow: bool = True,
        confirm: bool = True,
        strict: bool = False,
    ) -> Equilibrium:
        """Find the equilibrium at other loads and given forces; collective.

        The result is a trial until :meth:`accept`; :meth:`reject` forgets it. The dense system's
        contact and softening states are those of the trial.

        Args:
            loads: Shape (n_loads,).
            force: Shape (n_window,).
            at: Time of the end.
            dt: Time since the accepted state.
            follow: Follow contact and softening on the way; else go straight to the end.
            confirm: Call :meth:`confirm` as well; else it must be before :meth:`accept`.
            strict: What :meth:`confirm` gets.

        Raises:
            ConvergenceError: None was found; the accepted state is in force again.
        """
        here = self.state
        if self.bodies.closed:
            self.stored(here)
        saved = self.system.snapshot()
        self._trial_at = at
        dynamic = self.bodies.dynamic
        self._begun = dt > 0.0 or not dynamic
        if self._begun:
            self.bodies.begin(at, dt)
        start = time.perf_counter()
        points = [(0.0, here)]
        if follow and not dynamic:
            points += self.system.pieces(here, loads, force)
        else:
            points.append((1.0, self.system.equilibrium(loads, force)))
        predicted = points[-1][1]
        rate = self.system.rates(loads - here.loads, force - here.force)
        slide = None if self.system.friction is None else Slide.of(self.system, points)
        self.timings.add("interface", start)
        soft = self.system.soft.components
        y = self._toward(predicted)
        rows = np.arange(self.system.n_window)
        problem = InterfaceProblem(self, loads, force, self.system.forces(predicted, rows))
        self.counts.residuals = []
        try:
            iterations = newton.solve(problem, y)
            end = self._end(problem, y, predicted, loads)
        except ConvergenceError:
            self._fail(saved)
            raise
        finally:
            problem.destroy()
            y.destroy()
        self.counts.solves += 1
        self.counts.iterations += iterations
        self._trial_drift = problem.drift + (0.0 if problem.renewed else self.drift)
        friction = 0.0 if slide is None else slide.energy(self.system, end)
        self._way = Way(saved, points, end, rate, soft, iterations, friction)
        self.last_move = None
        if confirm:
            self.confirm(strict=strict)
        return end

    def _fail(self, saved: Snapshot) -> None:
        self.counts.failures += 1
        self.reject(saved)

    def confirm(self, *, strict: bool = False) -> None:
        """Have the tangent of the trial where it counts, and the integrals along the way to it.

        Collective.

        Args:
            strict: Refuse a way whose integrals do not add up, where bodies store all work.

        Raises:
            OffBalance: So it is; the accepted state is in force again.
            ConvergenceError: The equilibrium is unstable; likewise.
        """
        way = self._way
        assert way is not None
        here, end, iterations = way.points[0][1], way.end, way.iterations
        trapezoidal = self.bodies.dynamic or self.bodies.path_dependent
        limit = 0.0 if self.exact else np.inf if trapezoidal else _FAR_OFF
        try:
            if iterations and self._trial_drift > limit and not self.bodies.constant:
                self._factor()
                self._through(end)
                self._trial_drift = 0.0
            if self._kept is not None and self.condensation.n_negative:
                raise NotPositiveDefinite(0)
        except NotPositiveDefinite as error:
            self._fail(way.saved)
            raise ConvergenceError(_UNSTABLE) from error
        after = way.rate
        if iterations and not trapezoidal:
            after = self.system.rates(end.loads - here.loads, end.force - here.force)
        soft = self.system.soft.components
        self.last_move = way.integrals(after, soft, trapezoidal=trapezoidal)
        self._way = None
        self._trial_energies = None
        if strict and iterations and self.bodies.closed:
            self._check_balance(way.saved, self.last_move)

    def _check_balance(self, saved: Snapshot, move: Move) -> None:
        assert self._energies is not None
        self._trial_energies = self.bodies.stored()
        before, after = (sum(e.values()) for e in (self._energies, self._trial_energies))
        taken = move.bonds + move.friction
        given = move.external_work(len(self.loads)) + self.bodies.way_work()
        off = given - (after - before) - taken
        size = max(after, self.largest_energy)
        if abs(off) > self.newton.balance * size + self._noise:
            self.reject(saved)
            raise OffBalance(
                f"the energies of an increment are off by {off:.2e} beside {size:.2e} stored"
            )

    def _toward(self, predicted: Equilibrium) -> PETSc.Vec:
        """Y of a state on the present tangent."""
        last = np.zeros(self.coordinates.n_last)
        n = self.system.n_window
        last[:n] = predicted.jump - self._base
        last[n : n + self.n_loads] = predicted.loads - self.state.loads
        return self.condensation.expanded(last)

    def _end(
        self, problem: InterfaceProblem, y: PETSc.Vec, predicted: Equilibrium, loads: Array
    ) -> Equilibrium:
        """The equilibrium SNES has found, and the dense system through it."""
        last = predicted if problem.solution is None else problem.solution
        values = problem.values
        n = self.system.n_window + len(self.supports.columns)
        borders = self._border_values()
        conjugate = np.concatenate([values[self.system.n_window : n], -borders[: len(self.loads)]])
        end = Equilibrium(loads, last.force, last.jump, conjugate)
        self._answers = np.concatenate([values[:n], borders])
        self._through(end)
        trial = self.coordinates.transform.createVecLeft()
        self.coordinates.transform.mult(y, trial)
        # forces are known to what the iteration leaves out of balance, and so is their work
        self._noise = _NOISE * problem.level * float(trial.norm())
        trial.axpy(1.0, self.u)
        if self._trial is not None:
            self._trial.destroy()
        self._trial = trial
        self._follow_fronts(trial)
        return end

    def _through(self, end: Equilibrium) -> None:
        """Let the dense system of the tangent at hand pass through the trial's end."""
        x, schur = np.concatenate([end.jump, end.loads]), self.condensation.schur
        self.system.renew(schur, self._answers - schur[:, : len(x)] @ x)

    def accept(self) -> None:
        """The last trial becomes the accepted state; collective."""
        assert self._trial is not None and self.last_move is not None
        step = self.u.copy()
        step.aypx(-1.0, self._trial)
        self._trial.copy(self.u)
        self.at = self._trial_at
        self.largest_force = max(self.largest_force, self.force_scale)
        self.drift = self._trial_drift
        self._keep_tangent()
        self._energies = self._trial_energies
        self.largest_energy = max(self.largest_energy, sum((self._energies or {}).values()))
        self.state = self.last_move.end
        self._base = self.state.jump.copy()
        self._account(step)
        step.destroy()
        if self._begun:
            self.bodies.commit()

    def _account(self, step: PETSc.Vec) -> None:
        """What else there is to book of a step that is accepted; the accepted state is its end."""

    def reject(self, saved: Any) -> None:
        """Forget the last trial; collective.

        Args:
            saved: Snapshot of the dense system's states before it.
        """
        self.system.restore(saved)
        self._back()

    def stored(self, state: Equilibrium) -> dict[str, float]:
        """Energies stored in the bodies in the accepted state, by name; collective."""
        if self._energies is None:
            self._energies = super().stored(state)
        return self._energies

    def along(self, here: Equilibrium, point: Equilibrium) -> tuple[float, float, Array]:
        """External work, energy out through bonds, mean jumps of the last move."""
        move = self.last_move
        assert move is not None and move.start is here and move.end is point
        return move.external_work(len(self.loads)), move.bonds, move.jump

    def rub(self, here: Equilibrium, point: Equilibrium) -> None:
        """Account for the energy friction took in the last move."""
        move = self.last_move
        assert move is not None and move.start is here and move.end is point
        self.friction_energy += move.friction

    def _back(self) -> None:
        """Dense system and bodies at the accepted state again."""
        self._way = None
        if self._begun and not self.bodies.dynamic:
            self.bodies.begin(self.at, 0.0)  # pressures and temperature of the accepted state
        self.bodies.set(self.u)
        self._follow_fronts(self.u)
        self._former_tangent()
        if self._condensation is None or (self.drift == np.inf and not self.bodies.constant):
            self._factor()
            self._keep_tangent()
        self.drift = min(self.drift, 1.0)
        self.anchor()
