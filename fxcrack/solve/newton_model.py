"""A model whose bodies are nonlinear, with the interface of a condensed model.

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
from fxcrack.solve.newton_way import Move, Way
from fxcrack.solve.rubbing import Slide

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_FAR_OFF = 1e-5
"""A tangent made where more than this part of the forces was out of balance gives way to that of
the state itself when one is accepted."""
_UNSTABLE = (
    "the equilibrium found is unstable (buckling, or a limit load was passed); take smaller "
    "increments, or control a displacement instead of a force"
)
_SMALLEST_PIECE = 1e-4
"""Part of a bond force whose removal is the least that is tried at once."""


class NewtonModel(TangentModel):
    """Nonlinear bodies, interfaces and loads.

    Arguments as for :class:`~fxcrack.solve.newton_tangent.TangentModel`.

    Attributes:
        last_move: The last trial.
    """

    def __init__(self, *parts: Any, **controls: Any) -> None:
        super().__init__(*parts, **controls)
        self._trial_at = 0.0
        self._begun = False  # whether the last trial was an increment of time for the terms
        self._trial: PETSc.Vec | None = None
        self._trial_drift = 0.0
        self._answers = np.zeros(0)  # forces of the last coordinates at the trial's end
        self._way: Way | None = None  # to a trial that is not confirmed yet
        self.last_move: Move | None = None
        self._replaced: PETSc.Vec | None = None  # forces of interfaces before a new pairing

    # -- moving --------------------------------------------------------------------------

    def start(self) -> None:
        """Find the equilibrium without loads; collective."""
        zero = np.zeros(self.system.n_window)
        self.state = Equilibrium(np.zeros(self.n_loads), zero, zero, np.zeros(self.n_loads))
        self.solve(zero)

    def move(
        self,
        loads: Array,
        force: Array,
        at: float,
        dt: float,
        *,
        follow: bool = True,
        confirm: bool = True,
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

        Raises:
            ConvergenceError: None was found; the accepted state is in force again.
        """
        here = self.state
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
            self.confirm()
        return end

    def _fail(self, saved: Snapshot) -> None:
        self.counts.failures += 1
        self.reject(saved)

    def confirm(self) -> None:
        """Have the tangent of the trial where it counts, and the integrals along the way to it.

        Collective.

        Raises:
            ConvergenceError: The equilibrium is unstable; the accepted state is in force again.
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
        self.state = self.last_move.end
        self._base = self.state.jump.copy()
        if self._replaced is not None:
            self._count_pairing(step)
        step.destroy()
        if self._begun:
            self.bodies.commit()

    def reject(self, saved: Any) -> None:
        """Forget the last trial; collective.

        Args:
            saved: Snapshot of the dense system's states before it.
        """
        self.system.restore(saved)
        self._back()

    def along(self, here: Equilibrium, point: Equilibrium) -> tuple[float, float, Array]:
        """External work, energy out through bonds, mean jumps of the last move."""
        move = self.last_move
        assert move is not None and move.start is here and move.end is point
        n = self.n_loads - len(self.loads)
        a, b = here.loads, point.loads
        work = move.conjugate[:n] @ (b - a)[:n]
        work += b[n:] @ point.conjugate[n:] - a[n:] @ here.conjugate[n:]
        work -= move.conjugate[n:] @ (b - a)[n:]
        return float(work), move.bonds, move.jump

    def rub(self, here: Equilibrium, point: Equilibrium) -> None:
        """Account for the energy friction took in the last move."""
        move = self.last_move
        assert move is not None and move.start is here and move.end is point
        self.friction_energy += move.friction

    def release(self, p: int, nodes: Ints, force: Array) -> tuple[float, float]:
        """Let nodes go at constant load, in as many pieces as the iteration needs.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
            ConvergenceError: No equilibrium without these bonds was found.
        """
        self.open(p, nodes)
        if self.bodies.dynamic:
            return 0.0, 0.0  # the force goes to zero over the next increment
        energy, work, done, size = 0.0, 0.0, 0.0, 1.0
        begin = self.state.force
        while done < 1.0:
            to = min(done + size, 1.0)
            target = force if to == 1.0 else begin + to * (force - begin)
            here = self.state
            try:
                end = self.move(here.loads, target, self.at, 0.0)
            except ConvergenceError:
                size *= 0.25
                if size < _SMALLEST_PIECE:
                    raise
                continue
            more, out, _ = self.along(here, end)
            work, energy = work + more, energy + out
            self.rub(here, end)
            self.accept()
            done = to
        return energy, work

    def solve(self, force: Array) -> None:
        """Find the equilibrium at the present loads with given forces, shape (n_window,)."""
        if self.bodies.dynamic:
            force = self.state.force  # nothing happens in no time
        self.move(self.state.loads, force, self.at, 0.0, follow=False)
        self.accept()

    def settle(self, force: Array) -> float:
        """Find the equilibrium of a new pairing at constant loads, shape (n_window,); collective.

        Contact forces move to the master points of the new pairing, and gaps that are not zero in
        it close. The work of the interfaces on the way, by the trapezoidal rule, less what friction
        and bonds take, is :attr:`pairing_energy`. With inertia all that happens in the next
        increment.

        Returns:
            External work.
        """
        self._replaced = self.nodal_forces(self.u)
        if self.bodies.dynamic:
            return 0.0
        here = self.state
        self.solve(force)
        self.rub(here, self.state)
        return self.along(here, self.state)[0]

    def _count_pairing(self, step: PETSc.Vec) -> None:
        """Energy of the change of pairing in a move by a step, once it is accepted."""
        move = self.last_move
        assert move is not None and self._replaced is not None
        after = self.nodal_forces(self.u)
        after.axpy(1.0, self._replaced)
        n = self.n_loads - len(self.loads)
        supports = move.conjugate[:n] @ (move.end.loads - move.start.loads)[:n]
        given = 0.5 * float(after.dot(step)) - float(supports)
        self.pairing_energy -= given + move.bonds + move.friction
        after.destroy()
        self._forget_replaced()

    def _forget_replaced(self) -> None:
        if self._replaced is not None:
            self._replaced.destroy()
            self._replaced = None

    def prepare(self, active: list[bool], reach: list[float]) -> None:
        """Build the window for a step, as for a linear continuum."""
        old = self._numbered()
        super().prepare(active, reach)
        if old is not None:
            self._renumber(*old)

    def rebase(self) -> None:
        """Another window around the present fronts, at the same displacement; collective."""
        old = self._numbered()
        super().rebase()
        assert old is not None
        self._renumber(*old)

    def _numbered(self) -> tuple[list[Ints], Equilibrium] | None:
        """Numbers of the window's components and the state in them, once there is one."""
        return ([i.copy() for i in self.index], self.state) if hasattr(self, "state") else None

    def _renumber(self, numbers: list[Ints], old: Equilibrium) -> None:
        force = np.zeros(self.system.n_window)
        for before, now in zip(numbers, self.index, strict=True):
            both = (before >= 0) & (now >= 0)
            force[now[both]] = old.force[before[both]]
        self.state = Equilibrium(old.loads, force, self._base.copy(), old.conjugate)
        if self.system.friction is not None:
            # slips so far, in the jumps of the present pairing
            self.system.friction.commit(self._base)

    # -- back and forth -------------------------------------------------------------------

    def remember(self) -> Any:
        """What :meth:`recall` needs: interface states, displacement, state of the terms."""
        terms = [term.state() for term in self.bodies.terms]
        books = self.at, self.pairing_energy
        pairs = list(self.pairs), [index.copy() for index in self.index]
        return self.system.snapshot(), self.u.array.copy(), terms, books, pairs

    def recall(self, saved: Any) -> None:
        """Return to an earlier accepted state; ``state`` is the caller's to set before."""
        states, u, terms, books, (pairs, numbers) = saved
        here = min(self.comm.allgather(np.array_equal(self.u.array_r, u)))
        self.u.array[:] = u
        self.at, energy = books
        for term, kept in zip(self.bodies.terms, terms, strict=True):
            term.restore(kept)
        same = all(a is b for a, b in zip(pairs, self.pairs, strict=True))
        if not (same and here):
            self._keep_tangent()  # that of a state which is gone as well
            self.drift = np.inf
        if same:
            self._base = self.state.jump.copy()
            self.reject(states)
        else:
            self.pairs[:] = pairs
            self._soft, self._taken = states.bonds, states.finished
            self._rebase()
            self._renumber(numbers, self.state)
            if not self.bodies.dynamic:
                self.solve(self.state.force)
        self._forget_replaced()
        self.pairing_energy = energy

    def _back(self) -> None:
        """Dense system and bodies at the accepted state again."""
        self._way = None
        self.bodies.set(self.u)
        self._follow_fronts(self.u)
        self._former_tangent()
        if self._condensation is None or (self.drift == np.inf and not self.bodies.constant):
            self._factor()
            self._keep_tangent()
        self.drift = min(self.drift, 1.0)
        self.anchor()
