"""A model whose bodies are nonlinear, with the interface of a condensed model.

Between two accepted states the dense system holds the tangent: it predicts the way (contact and
softening followed exactly on it), SNES corrects the end, and the integrals along the way are those
of the prediction plus the correction e, whose value and rate are zero at the start:

    int_0^1 e ds = e(1)/2 - e'(1)/12      (cubic in s)
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fxcrack.continuum import Continuum
from fxcrack.errors import ConvergenceError, InputError
from fxcrack.interface.jumps import JumpCoordinates
from fxcrack.interface.pairing import Pair
from fxcrack.interface.replica import JumpReader
from fxcrack.interface.sliding import renewed
from fxcrack.interface.supports import Supports
from fxcrack.interface.surface import gather_surface
from fxcrack.loads import Load, Monitor
from fxcrack.solve import newton
from fxcrack.solve.borders import border_vectors
from fxcrack.solve.condensation import Condensation
from fxcrack.solve.condensed import CondensedModel
from fxcrack.solve.jump_system import Equilibrium, JumpSystem, bond_work
from fxcrack.solve.newton import Counts, InterfaceProblem, NewtonOptions
from fxcrack.solve.options import CondensedOptions
from fxcrack.solve.rigid import check_held
from fxcrack.solve.rubbing import Slide
from fxcrack.terms.bodies import Bodies

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_SMALLEST_PIECE = 1e-4
"""Part of a bond force whose removal is the least that is tried at once."""
_FEW_COLUMNS = 256
"""Up to so many last coordinates block solves beat a second factorisation on several ranks."""


@dataclass(frozen=True)
class Move:
    """The way from one equilibrium to another, loads and given forces linear in s from 0 to 1.

    Attributes:
        start: Where it begins.
        end: Where it ends.
        conjugate: Integral of the conjugates over s, shape (n_loads,).
        jump: Integral of the jumps over s, shape (n_window,).
        bonds: Energy that bonds which are letting go took out on the way.
        friction: Energy that friction took on the way.
    """

    start: Equilibrium
    end: Equilibrium
    conjugate: Array
    jump: Array
    bonds: float
    friction: float


class NewtonModel(CondensedModel):
    """Nonlinear bodies, interfaces and loads.

    Args:
        continuum: Displacement space.
        pairs: Interfaces.
        supports: Prescribed components.
        loads: Force patterns (dead loads).
        monitors: Monitored displacements.
        options: How to condense.
        bodies: The form terms.
        newton: Controls of the iteration.

    Raises:
        InputError: The options ask for a way to condense that only linear bodies allow.

    Attributes:
        u: Accepted displacement, owned dofs.
        counts: Solves and iterations so far.
        force_scale: Norm of the internal forces at the last residual.
        largest_force: The largest one of an accepted state.
        round_off: Residual that rounding alone may leave there.
        at: Time of the accepted state.
        pairing_energy: Energy that new pairings of faces that slide have taken so far.
    """

    linear = False

    def __init__(
        self,
        continuum: Continuum,
        pairs: list[Pair],
        supports: Supports,
        loads: list[Load],
        monitors: list[Monitor],
        options: CondensedOptions,
        *,
        bodies: Bodies,
        newton: NewtonOptions,
    ) -> None:
        if options.method == "iterative":
            raise InputError(
                "method='iterative' keeps its columns while the crack grows, which needs linear "
                "bodies; use method='auto' with nonlinear ones"
            )
        super().__init__(continuum, pairs, supports, loads, monitors, options)
        self.bodies = bodies
        self.newton = newton
        self.counts = Counts()
        self.comm = continuum.comm
        self.force_scale = self.largest_force = self.round_off = 0.0
        self.at = 0.0
        self.u = PETSc.Vec().createMPI((continuum.n_local, continuum.n_global), comm=self.comm)
        self.coordinates: JumpCoordinates
        self._stiff = 0.0
        self._base = np.zeros(0)
        self._moved = False  # whether the tangent is that of a trial
        self._version: tuple[int, ...] = ()  # of the terms whose tangent is factored
        self._trial_at = 0.0
        self._begun = False  # whether the last trial was an increment of time for the terms
        self._current = bodies.finite
        self._masters = [
            gather_surface(continuum, p.interface.master)
            if self._current and p.interface.contact
            else None
            for p in pairs
        ]
        self._undeformed = [p.surface.x for p in pairs]
        self._reader = JumpReader(continuum, pairs, [m for m in self._masters if m is not None])
        self._trial: PETSc.Vec | None = None
        self.last_move: Move | None = None
        self.pairing_energy = 0.0
        self._replaced: PETSc.Vec | None = None  # forces of interfaces before a new pairing

    # -- the window and its tangent ------------------------------------------------------

    def _assemble(self) -> None:
        if self._stiffness is not None:
            return
        start = time.perf_counter()
        check_held(self.continuum, self.supports)
        self.bodies.compile()
        self.timings.add("compile", start)
        start = time.perf_counter()
        self.bodies.set(self.u)
        self._stiffness = self.bodies.tangent()
        self._borders = border_vectors(self.continuum, self.loads, self.monitors)
        self.timings.add("assemble", start)

    def _condense(self, coordinates: JumpCoordinates) -> None:
        self.coordinates = coordinates
        self._base = self._jumps_from(self.u)
        n_window, n_loads = coordinates.n_window, self.n_loads
        loads = self.state.loads if hasattr(self, "state") else np.zeros(n_loads)
        self.bodies.set(self.u)
        self._factor()
        self.system = JumpSystem(
            self.condensation.schur,
            n_window,
            n_loads,
            len(self.loads),
            offset=np.zeros(coordinates.n_last),
        )
        residual = self._out_of_balance(loads)
        self._anchor(residual, self._base, loads)
        residual.destroy()
        self.face_loads = -self.condensation.borders_on_window[:, : len(self.loads)]

    @property
    def condensation(self) -> Condensation:
        """The condensed tangent."""
        assert isinstance(self._condensation, Condensation)
        return self._condensation

    def _factor(self) -> None:
        """Condense the tangent at the bodies' present displacement; collective."""
        if self._condensation is not None:
            self._condensation.destroy(keep_transform=True)
            self._condensation = None
        method = self.options.method
        if method == "auto" and self.comm.size > 1 and self.coordinates.n_last <= _FEW_COLUMNS:
            method = "columns"
        matrix = self._stiffness = self.bodies.tangent()
        if not self.bodies.symmetric:
            # the interface algebra stands on a symmetric S: its part of the tangent converges too
            matrix = matrix.copy()
            transposed = matrix.transpose(PETSc.Mat())
            matrix.axpy(1.0, transposed)
            matrix.scale(0.5)
            transposed.destroy()
        self._condensation = Condensation(
            matrix, self.coordinates, self._borders, self.timings, method=method, definite=False
        )
        if matrix is not self._stiffness:
            matrix.destroy()
        self._version = self.bodies.version
        self._stiff = float(self._stiffness.norm(PETSc.NormType.NORM_INFINITY))

    def _anchor(self, residual: PETSc.Vec, jump: Array, loads: Array) -> PETSc.Vec:
        """Offset of the dense system from a residual; returns A_11^-1 r_1."""
        values, q = self.condensation.reduced(residual)
        values[self.system.n_window + len(self.supports.columns) :] += self._border_values()
        x = np.concatenate([jump, loads])
        schur = self.condensation.schur
        self.system.renew(schur, values - schur[:, : len(x)] @ x)
        return q

    def _border_values(self) -> Array:
        """Minus the work of each force pattern, then the monitors, at the bodies' displacement."""
        u = self.bodies.u.x.petsc_vec
        return np.array([float(border.dot(u)) for border in self._borders])

    def _jumps_from(self, u: PETSc.Vec) -> Array:
        """Jumps of the window in a displacement, shape (n_window,); collective."""
        values = self._reader.values.gather(u.array_r)
        out = np.zeros(self.coordinates.n_window)
        for pair, frames, index in zip(self.pairs, self.frames, self.index, strict=True):
            inside = index >= 0
            out[index[inside]] = self._reader.jumps(values, pair, frames)[inside]
        return out

    def _follow_fronts(self, u: PETSc.Vec) -> None:
        """Take normals and lengths at the fronts from a displacement, if it is finite."""
        if not self._current:
            return
        values = self._reader.values.gather(u.array_r)
        for pair, front, x in zip(self.pairs, self.fronts, self._undeformed, strict=True):
            moved = x.copy()
            moved[:, : self.continuum.gdim] += self._reader.slaves(values, pair)
            front.follow(moved)

    def renew_pairs(self) -> bool:
        """Pair open nodes with the master surface where it is now; collective.

        Returns:
            Whether a pair has changed; the dense system is then another one, and the caller
            solves for its state (:meth:`solve`).
        """
        if not any(m is not None for m in self._masters):
            return False
        values = self._reader.values.gather(self.u.array_r)
        changed = False
        for p, master in enumerate(self._masters):
            if master is None:
                continue
            pair = self.pairs[p]
            new = renewed(
                pair,
                self.fronts[p].bonded,
                master,
                self._reader.slaves(values, pair),
                values[self._reader.values.find(master.dofs)],
            )
            if new is not None:
                self.pairs[p], changed = new, True
        if changed:
            self.rebase()
        return changed

    # -- what SNES asks ------------------------------------------------------------------

    def forces_at(self, y: PETSc.Vec, loads: Array) -> PETSc.Vec:
        """R(u) minus dead loads at u = u_accepted + T y; the caller destroys it."""
        u = self.coordinates.transform.createVecLeft()
        self.coordinates.transform.mult(y, u)
        u.axpy(1.0, self.u)
        self.bodies.set(u)
        u.destroy()
        return self._out_of_balance(loads)

    def _out_of_balance(self, loads: Array) -> PETSc.Vec:
        residual = self.bodies.residual()
        self.force_scale = float(residual.norm())
        size = float(self.bodies.u.x.petsc_vec.norm())
        self.round_off = 4.0 * np.finfo(float).eps * self._stiff * size
        factors = loads[self.n_loads - len(self.loads) :]
        for factor, border in zip(factors, self._borders, strict=False):
            residual.axpy(float(factor), border)
        return residual

    def jumps_of(self, y: PETSc.Vec) -> Array:
        """Jumps of the window at a trial y, shape (n_window,)."""
        out = self._base.copy()
        if self.comm.rank == 0:
            n = self.coordinates.n_inner
            out += y.array_r[n : n + len(out)]
        self.comm.Bcast(out)
        return out

    def linearise(self, jump: Array, loads: Array, residual: PETSc.Vec, out: PETSc.Vec) -> None:
        """Dense system of the tangent at the bodies' present displacement.

        ``out`` becomes A_11^-1 r_1.
        """
        if not self.bodies.constant or self._version != self.bodies.version:
            self._factor()
            self._moved = True
        q = self._anchor(residual, jump, loads)
        q.copy(out)
        q.destroy()

    def interface_equilibrium(self, loads: Array, force: Array) -> Equilibrium:
        """Jumps and forces on the present tangent, softening bonds on their right branches."""
        system = self.system
        state = system.equilibrium(loads, force)
        for _ in range(4 * len(system.soft.bonds) + 4 if system.soft.bonds else 0):
            if not system.soft.stable():
                state = system.pass_unstable(state)
                continue
            at, leaving = system.soft.first_event(self.state.jump, state.jump)
            if not np.isfinite(at):
                break
            system.finish([b for b in leaving if system.soft.switch(b, state.jump)])
            state = system.equilibrium(loads, force)
        return state

    # -- moving --------------------------------------------------------------------------

    def start(self) -> None:
        """Find the equilibrium without loads; collective."""
        zero = np.zeros(self.system.n_window)
        self.state = Equilibrium(np.zeros(self.n_loads), zero, zero, np.zeros(self.n_loads))
        self.solve(zero)

    def move(
        self, loads: Array, force: Array, at: float, dt: float, *, follow: bool = True
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
            if iterations and self.condensation.n_negative:
                raise ConvergenceError(
                    "the equilibrium found is unstable (buckling, or a limit load was passed); "
                    "take smaller increments, or control a displacement instead of a force"
                )
            end = self._end(problem, y, predicted, loads)
        except ConvergenceError:
            self.counts.failures += 1
            self.reject(saved)
            raise
        finally:
            problem.destroy()
            y.destroy()
        self.counts.solves += 1
        self.counts.iterations += iterations
        if dynamic or self.bodies.path_dependent:
            # their terms count by the trapezoidal rule: with the same rule here nothing is lost
            points, predicted, iterations = [(0.0, here), (1.0, end)], end, 0
        after = self.system.rates(loads - here.loads, force - here.force) if iterations else rate
        jump = (end.jump - predicted.jump) / 2.0 - (after[0] - rate[0]) / 12.0
        conjugate = (end.conjugate - predicted.conjugate) / 2.0 - (after[1] - rate[1]) / 12.0
        given = force - here.force
        given[soft] = given[self.system.soft.components] = 0.0
        way = [*(point for _, point in points), end]
        bonds = sum(bond_work(a, b) for a, b in pairwise(way))
        self.last_move = Move(
            here,
            end,
            _along(points, "conjugate") + conjugate,
            _along(points, "jump") + jump,
            bonds + float(given @ jump),
            0.0 if slide is None else slide.energy(self.system, end),
        )
        return end

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
        x = np.concatenate([last.jump, loads])
        target = np.concatenate([values[:n], borders])
        self.system.renew(self.system.schur, target - self.system.schur[:, : len(x)] @ x)
        trial = self.coordinates.transform.createVecLeft()
        self.coordinates.transform.mult(y, trial)
        trial.axpy(1.0, self.u)
        if self._trial is not None:
            self._trial.destroy()
        self._trial = trial
        self._follow_fronts(trial)
        return Equilibrium(loads, last.force, last.jump, conjugate)

    def accept(self) -> None:
        """The last trial becomes the accepted state; collective."""
        assert self._trial is not None and self.last_move is not None
        step = self.u.copy()
        step.aypx(-1.0, self._trial)
        self._trial.copy(self.u)
        self.at = self._trial_at
        self.largest_force = max(self.largest_force, self.force_scale)
        self._moved = False
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

    # -- energies and fields -------------------------------------------------------------

    def stored(self, state: Equilibrium) -> dict[str, float]:
        """Energies stored in the bodies in the accepted state, by name; collective."""
        return self.bodies.stored()

    def spent(self) -> dict[str, float]:
        """Energies the bodies have turned into something else, by name; collective."""
        spent = self.bodies.spent()
        if any(m is not None for m in self._masters):
            spent["pairing_energy"] = self.pairing_energy
        return spent

    def extra_work(self, state: Equilibrium) -> float:
        """Work of loads that follow the bodies and of a temperature; collective."""
        return sum(term.work() for term in self.bodies.terms)

    def displacement(self, state: Equilibrium | None = None) -> PETSc.Vec:
        """Accepted displacement; the caller destroys it."""
        return self.u.copy()

    def nodal_forces(self, u: PETSc.Vec, state: Equilibrium | None = None) -> PETSc.Vec:
        """Forces of interfaces and supports on the bodies; the caller destroys them."""
        return self._out_of_balance(self.state.loads if state is None else state.loads)

    def remember(self) -> Any:
        """What :meth:`recall` needs: interface states, displacement, state of the terms."""
        terms = [term.state() for term in self.bodies.terms]
        books = self.at, self.pairing_energy
        pairs = list(self.pairs), [index.copy() for index in self.index]
        return self.system.snapshot(), self.u.array.copy(), terms, books, pairs

    def recall(self, saved: Any) -> None:
        """Return to an earlier accepted state; ``state`` is the caller's to set before."""
        states, u, terms, books, (pairs, numbers) = saved
        self.u.array[:] = u
        self.at, energy = books
        for term, kept in zip(self.bodies.terms, terms, strict=True):
            term.restore(kept)
        self._moved = True
        if all(a is b for a, b in zip(pairs, self.pairs, strict=True)):
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
        self.bodies.set(self.u)
        self._follow_fronts(self.u)
        if self._moved or self._condensation is None:
            self._factor()  # the next prediction and the energies need the tangent of this state
            self._moved = False
        residual = self._out_of_balance(self.state.loads)
        q = self._anchor(residual, self.state.jump, self.state.loads)
        q.destroy()
        residual.destroy()


def _along(points: list[tuple[float, Equilibrium]], name: str) -> Array:
    """Integral of a quantity over s along linear pieces."""
    return np.sum(
        [
            0.5 * (t - s) * (getattr(a, name) + getattr(b, name))
            for (s, a), (t, b) in pairwise(points)
        ],
        axis=0,
    )
