"""A model whose bodies are nonlinear, with the interface of a condensed model.

Nodes let go and faces paired anew, on the trials of :mod:`fxcrack.solve.newton_trial`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fxcrack.errors import ConvergenceError
from fxcrack.solve.jump_system import Equilibrium
from fxcrack.solve.newton_trial import TrialModel
from fxcrack.solve.newton_way import FINE, OffBalance

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_SMALLEST_PIECE = 1e-4
"""Part of a bond force whose removal is the least that is tried at once."""


class NewtonModel(TrialModel):
    """Nonlinear bodies, interfaces and loads.

    Arguments as for :class:`~fxcrack.solve.newton_tangent.TangentModel`.
    """

    def __init__(self, *parts: Any, **controls: Any) -> None:
        super().__init__(*parts, **controls)
        self._replaced: PETSc.Vec | None = None  # forces of interfaces before a new pairing

    def start(self) -> None:
        """Find the equilibrium without loads; collective."""
        zero = np.zeros(self.system.n_window)
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
            except OffBalance:
                size *= 0.5
                continue
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
