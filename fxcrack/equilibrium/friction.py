"""Friction of the open parts: the contact nodes and their states.

With friction anywhere, all contact nodes form one block (frictionless ones with mu = 0). Their
jumps are coordinates of a dense problem K delta = g + p, the other free jumps condensed out:

    K = S_RR - S_RF S_FF^-1 S_FR,     g = forces on the block at delta = 0, with the minus sign
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_triangular

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import ConvergenceError
from fxcrack.equilibrium.coulomb import (
    OPEN,
    SLIP,
    STICK,
    ContactBlock,
    FrictionState,
    Increment,
    NodeStates,
    Sliding,
    backward_euler,
    jumps_of,
)
from fxcrack.equilibrium.jump_system import Equilibrium, JumpSystem


class Friction:
    """The contact nodes of a jump system with friction.

    Args:
        dim: Jumps per node, 2 or 3.

    Attributes:
        components: Retained jumps per node, -1 where a support holds one, shape (m, d).
        where: Pair and slave node, shape (m, 2).
        mu: Friction coefficients, shape (m,).
        gap: Initial gaps, shape (m,), length.
        states: What the nodes do now.
        reference: Tangential jumps of the last accepted state, shape (m, d - 1), length.
        error: Difference of the dissipation by the forces at the end of increments and by the mean
            of both ends, an estimate of the error in 3-D; 0 in 2-D.
        steps: Linear systems solved.
        increments: Increments of backward Euler.
    """

    def __init__(self, dim: int) -> None:
        self.dim = dim
        self.components: Ints = np.zeros((0, dim), dtype=np.int64)
        self.where: Ints = np.zeros((0, 2), dtype=np.int64)
        self.mu, self.gap = np.zeros(0), np.zeros(0)
        self.states = NodeStates(np.zeros(0, dtype=np.int64), np.zeros((0, dim - 1)))
        self.reference = np.zeros((0, dim - 1))
        self.error = 0.0
        self.steps = self.increments = 0
        self._block: tuple[Array, Ints, ContactBlock] | None = None

    # -- nodes and states ----------------------------------------------------------------

    def add(
        self,
        components: Ints,
        where: Ints,
        mu: Array,
        gap: Array,
        status: Ints,
        direction: Array,
        reference: Array,
    ) -> None:
        """Take more nodes, whose bonds are released.

        Args:
            components: Retained jumps, -1 where a support holds one, shape (k, d).
            where: Pair and slave node, shape (k, 2).
            mu: Friction coefficients, shape (k,).
            gap: Initial gaps, shape (k,), length.
            status: OPEN, STICK or SLIP, shape (k,).
            direction: Slip directions, shape (k, d - 1).
            reference: Present tangential jumps, shape (k, d - 1), length.
        """
        mu = np.where((components[:, 1:] < 0).all(axis=1), 0.0, mu)
        status = np.where((mu == 0.0) & (status == STICK), SLIP, status)
        self.components = np.vstack([self.components, components])
        self.where = np.vstack([self.where, where])
        self.mu, self.gap = np.append(self.mu, mu), np.append(self.gap, gap)
        self.reference = np.vstack([self.reference, reference])
        self.states = NodeStates(
            np.append(self.states.status, status), np.vstack([self.states.direction, direction])
        )
        self._block = None

    def drop(self, k: int) -> None:
        """Remove the last k nodes."""
        n = len(self.mu) - k
        self.components, self.where = self.components[:n], self.where[:n]
        self.mu, self.gap, self.reference = self.mu[:n], self.gap[:n], self.reference[:n]
        self.states = NodeStates(self.states.status[:n], self.states.direction[:n])
        self._block = None

    @property
    def rows(self) -> Ints:
        """Retained jumps of the block, shape (n_block,)."""
        return self.components[self.components >= 0]

    def save(self) -> FrictionState:
        """What :meth:`restore` needs to return here."""
        return FrictionState(self.where, self.states, self.reference.copy(), self.error)

    def restore(self, saved: FrictionState) -> None:
        """Return to a saved state of the same nodes."""
        self.states, self.reference, self.error = saved.states, saved.reference.copy(), saved.error

    def commit(self, jump: Array) -> None:
        """Accept a state: slips of the next increment are measured from its jumps.

        Args:
            jump: Retained jumps, shape (n_retained,), length.
        """
        self.reference = self.of(jump)[:, 1:]

    def closed(self, n_retained: int) -> npt.NDArray[np.bool_]:
        """Which retained jumps are normals in contact, shape (n_retained,)."""
        out = np.zeros(n_retained, dtype=bool)
        out[self.components[self.states.status != OPEN, 0]] = True
        return out

    # -- the block -----------------------------------------------------------------------

    def of(self, values: Array) -> Array:
        """Values of retained jumps at the nodes, 0 where a support holds one, shape (m, d)."""
        return np.where(self.components >= 0, values[np.maximum(self.components, 0)], 0.0)

    def over(self, block: Array, n_retained: int) -> Array:
        """Values at the nodes, shape (m, d), as those of retained jumps, shape (n_retained,)."""
        out = np.zeros(n_retained)
        inside = self.components >= 0
        out[self.components[inside]] = block[inside]
        return out

    def block(self, system: JumpSystem) -> ContactBlock:
        """K at the present free set; kept until S, the nodes or the free set change."""
        free = system.cholesky.free
        known = self._block
        if known is None or known[0] is not system.schur or not np.array_equal(known[1], free):
            flat = self.components.ravel()
            inside = np.flatnonzero(flat >= 0)
            first, n = (int(flat[inside[0]]) if len(inside) else 0), len(inside)
            if not len(free) and np.array_equal(flat[inside], np.arange(first, first + n)):
                k = system.schur[first : first + n, first : first + n]  # only read
            else:
                _, k = system.cholesky.reduced(flat[inside])
            if len(inside) < len(flat):
                # a component that a support holds: its jump is zero
                star, k = k, np.diag(np.full(len(flat), np.diagonal(k).mean()))
                k[np.ix_(inside, inside)] = star
            self._block = known = system.schur, free.copy(), ContactBlock(k, self.gap, self.mu)
        return known[2]

    def load(self, system: JumpSystem, loads: Array, force: Array) -> Array:
        """Forces g on the block at loads and given forces.

        Args:
            system: The jump system.
            loads: Amplitudes of supports and load factors, shape (n_loads,).
            force: Given forces, shape (n_retained,), force.

        Returns:
            Shape (m d,), force.
        """
        flat = self.components.ravel()
        inside = np.flatnonzero(flat >= 0)
        rows, free = flat[inside], system.cholesky.free
        given = force[rows] - system.schur[np.ix_(rows, system.load_columns)] @ loads
        if system.offset is not None:
            given -= system.offset[rows]
        if len(free):
            still = system.linear(loads, force, np.zeros(system.n_retained))
            given -= system.schur[np.ix_(rows, free)] @ still.jump[free]
        out = np.zeros(len(flat))
        out[inside] = given
        return out

    def traction(self, system: JumpSystem, state: Equilibrium) -> Array:
        """Contact forces on the slave side at a state, shape (m, d), force."""
        load = self.load(system, state.loads, state.force)
        force = self.block(system).forces(self.of(state.jump), load)
        return np.where(self.components >= 0, force, 0.0)

    def dissipation(self, system: JumpSystem, a: Equilibrium, b: Equilibrium) -> float:
        """Energy that friction dissipates between two states, linear in between."""
        slip = (self.of(b.jump) - self.of(a.jump))[:, 1:]
        mean = 0.5 * (self.traction(system, a) + self.traction(system, b))[:, 1:]
        rough = self.mu > 0.0
        return -float(np.sum(mean[rough] * slip[rough]))

    # -- with the states as they are -----------------------------------------------------

    def _moving(self) -> Ints:
        """Components whose jumps are not known in the present states."""
        moving = np.zeros(self.components.shape, dtype=bool)
        moving[self.states.status == OPEN] = True
        moving[self.states.status == SLIP, 1:] = True
        return self.components[moving & (self.components >= 0)]

    def condensed(self, system: JumpSystem, extra: Ints) -> Array:
        """S on components outside the block, all free, open and slipping ones condensed out.

        Friction forces count as given.

        Args:
            system: The jump system.
            extra: Held components outside the block, shape (k,).

        Returns:
            Shape (k, k), force/length.

        Raises:
            NotPositiveDefinite: Nothing holds one of the open or slipping ones.
        """
        moving = self._moving()
        _, star = system.cholesky.reduced(np.concatenate([moving, extra]))
        n = len(moving)
        factor = system.cholesky.factorise(star[:n, :n], moving)
        y = solve_triangular(factor, star[:n, n:], lower=True)
        return np.asarray(star[n:, n:] - y.T @ y)

    def rates(self, system: JumpSystem, loads: Array, force: Array) -> tuple[Array, Array]:
        """Rates of jumps, shape (n_retained,), and conjugates, shape (n_loads,), states fixed.

        Args:
            system: The jump system.
            loads: Rates of the loads, shape (n_loads,).
            force: Rates of the given forces, shape (n_retained,).

        Raises:
            ConvergenceError: A body slides.
        """
        none = np.zeros(system.n_retained)
        idle = np.zeros(len(loads))
        load = self.load(system, loads, force) - self.load(system, idle, none)
        block = replace(self.block(system), gap=np.zeros(len(self.gap)), factored={})
        try:
            jump = jumps_of(block, load, self.states, np.zeros(self.reference.shape))
        except Sliding as error:
            raise ConvergenceError(
                "friction: a body that friction alone holds slides; support it, or pull it by a "
                "prescribed displacement"
            ) from error
        one = system.linear(loads, force, self.over(jump, system.n_retained))
        zero = system.linear(idle, none, none)
        return one.jump - zero.jump, one.conjugate - zero.conjugate

    # -- one increment -------------------------------------------------------------------

    def equilibrium(self, system: JumpSystem, loads: Array, force: Array) -> Equilibrium:
        """One increment of backward Euler from the committed state.

        Args:
            system: The jump system.
            loads: Amplitudes of supports and load factors at the end, shape (n_loads,).
            force: Given forces at the end, shape (n_retained,), force.

        Raises:
            ConvergenceError: No solution was found.
        """
        found = self.increment(self.block(system), self.load(system, loads, force))
        return system.linear(loads, force, self.over(found.jump, system.n_retained))

    def increment(self, block: ContactBlock, load: Array) -> Increment:
        """An increment of the block from the committed state; takes over its states.

        Args:
            block: K, gaps and friction coefficients of the nodes.
            load: g at the end, shape (m d,), force.

        Raises:
            ConvergenceError: No solution was found.
        """
        start = np.column_stack([-self.gap, self.reference])
        found = backward_euler(block, load, self.reference, self.states, start)
        self.states = found.states
        self.steps += found.steps
        self.increments += 1
        return found


__all__ = ["Friction"]
