"""Trials of a nonlinear model: from one equilibrium to the next, kept or forgotten.

Between two accepted states the dense system holds the tangent: it predicts the way, SNES corrects
the end (:mod:`fxcrack.solvers.increment_work`).
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import ConvergenceError
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.equilibrium.friction_state import Slide
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.equilibrium.jump_system import Snapshot
from fxcrack.solvers import snes as newton
from fxcrack.solvers.increment_work import FINE, EnergyImbalance, IncrementWork, TrialIncrement
from fxcrack.solvers.snes import InterfaceSnes
from fxcrack.solvers.tangent import CondensedTangent

_FAR_OFF = 1e-5
"""A tangent made where more than this part of the forces was out of balance gives way to that of
the state itself when one is accepted."""
_NOISE = 10.0
"""Energies on a way may be off by so many times the residual left times the step."""
_UNSTABLE = (
    "the equilibrium found is unstable (buckling, or a limit load was passed); take smaller "
    "increments, or control a displacement instead of a force"
)


class NewtonTrial(CondensedTangent):
    """Nonlinear bodies that move from equilibrium to equilibrium.

    Arguments as for :class:`~fxcrack.solvers.tangent.CondensedTangent`.

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
        self._way: TrialIncrement | None = None  # to a trial that is not confirmed yet
        self.last_move: IncrementWork | None = None

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
            force: Shape (n_retained,).
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
        rows = np.arange(self.system.n_retained)
        problem = InterfaceSnes(self, loads, force, self.system.forces(predicted, rows))
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
        self._way = TrialIncrement(saved, points, end, rate, soft, iterations, friction)
        self.last_move = None
        if confirm:
            self.confirm(strict=strict)
        return end

    def _fail(self, saved: Snapshot) -> None:
        self.counts.failures += 1
        self.revert(saved)

    def confirm(self, *, strict: bool = False) -> None:
        """Have the tangent of the trial where it counts, and the integrals along the way to it.

        Collective.

        Args:
            strict: Refuse a way whose integrals do not add up, where bodies store all work.

        Raises:
            EnergyImbalance: So it is; the accepted state is in force again.
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

    def _check_balance(self, saved: Snapshot, move: IncrementWork) -> None:
        assert self._energies is not None
        self._trial_energies = self.bodies.stored()
        before, after = (sum(e.values()) for e in (self._energies, self._trial_energies))
        taken = move.bonds + move.friction
        given = move.external_work(len(self.loads)) + self.bodies.path_work()
        off = given - (after - before) - taken
        size = max(after, self.largest_energy)
        if abs(off) > self.newton.balance * size + self._noise:
            self.revert(saved)
            raise EnergyImbalance(
                f"the energies of an increment are off by {off:.2e} beside {size:.2e} stored"
            )

    def _toward(self, predicted: Equilibrium) -> PETSc.Vec:
        """Y of a state on the present tangent."""
        last = np.zeros(self.coordinates.n_last)
        n = self.system.n_retained
        last[:n] = predicted.jump - self._base
        last[n : n + self.n_loads] = predicted.loads - self.state.loads
        return self.condensation.expanded(last)

    def _end(
        self, problem: InterfaceSnes, y: PETSc.Vec, predicted: Equilibrium, loads: Array
    ) -> Equilibrium:
        """The equilibrium SNES has found, and the dense system through it."""
        last = predicted if problem.solution is None else problem.solution
        values = problem.values
        n = self.system.n_retained + len(self.supports.columns)
        borders = self._border_values()
        conjugate = np.concatenate(
            [values[self.system.n_retained : n], -borders[: len(self.loads)]]
        )
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

    def commit(self) -> None:
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

    def revert(self, saved: Any) -> None:
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

    def book_friction(self, here: Equilibrium, point: Equilibrium) -> None:
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


_SMALLEST_PIECE = 1e-4
"""Part of a bond force whose removal is the least that is tried at once."""


class NewtonSolver(NewtonTrial):
    """Nonlinear bodies, interfaces and loads.

    Arguments as for :class:`~fxcrack.solvers.tangent.CondensedTangent`.
    """

    def __init__(self, *parts: Any, **controls: Any) -> None:
        super().__init__(*parts, **controls)
        self._replaced: PETSc.Vec | None = None  # forces of interfaces before a new pairing

    def start(self) -> None:
        """Find the equilibrium without loads; collective."""
        zero = np.zeros(self.system.n_retained)
        self.state = Equilibrium(np.zeros(self.n_loads), zero, zero, np.zeros(self.n_loads))
        self.solve(zero)

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
                end = self.move(here.loads, target, self.at, 0.0, strict=size > FINE)
            except EnergyImbalance:
                size *= 0.5
                continue
            except ConvergenceError:
                size *= 0.25
                if size < _SMALLEST_PIECE:
                    raise
                continue
            more, out, _ = self.along(here, end)
            work, energy = work + more, energy + out
            self.book_friction(here, end)
            self.commit()
            done = to
        return energy, work

    def solve(self, force: Array) -> None:
        """Find the equilibrium at the present loads with given forces, shape (n_retained,)."""
        if self.bodies.dynamic:
            force = self.state.force  # nothing happens in no time
        self.move(self.state.loads, force, self.at, 0.0, follow=False)
        self.commit()

    def settle(self, force: Array) -> float:
        """Find the equilibrium of a new pairing at constant loads, shape (n_retained,); collective.

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
        self.book_friction(here, self.state)
        return self.along(here, self.state)[0]

    def _account(self, step: PETSc.Vec) -> None:
        """Book the energy of a change of pairing."""
        if self._replaced is None:
            return
        move = self.last_move
        assert move is not None
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
        force = np.zeros(self.system.n_retained)
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
        self._energies = None
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
            self.revert(states)
        else:
            self.pairs[:] = pairs
            self._soft, self._taken = states.bonds, states.finished
            self._rebase()
            self._renumber(numbers, self.state)
            if not self.bodies.dynamic:
                self.solve(self.state.force)
        self._forget_replaced()
        self.pairing_energy = energy
