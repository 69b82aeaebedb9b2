"""Friction of the open parts: contact nodes, their states, and how they follow the loads.

With friction anywhere, all contact nodes form one block (frictionless ones with mu = 0). Their jumps
are coordinates of a dense problem K delta = g + p, the other free jumps condensed out:

    K = S_RR - S_RF S_FF^-1 S_FR,     g = forces on the block at delta = 0, with the minus sign

In 2-D everything is linear in the loads while no node changes its state, so the path is followed
from event to event: a slip starts where |p_t| = mu p_n, a node sticks again where its slip would
turn back, contact opens and closes. In 3-D slip directions turn: increments of backward Euler,
halved until the dissipation by the forces at their end and by the mean of both ends agree.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_triangular

from fxcrack.solve.coulomb import (
    OPEN,
    ROUND_OFF,
    SLIP,
    STICK,
    ContactBlock,
    Increment,
    NodeStates,
    Sliding,
    backward_euler,
    jumps_of,
)
from fxcrack.solve.linear_jumps import Equilibrium, LinearJumps, blend

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_SAME = 1e-12
"""Events closer together than this fraction of the way happen at once."""
_NUDGE = 1e-3
"""Fraction of the way done by backward Euler where following gets stuck."""
_SMALLEST = 1.0 / 128.0
"""Smallest increment in 3-D, as a fraction of the way."""
_SPREAD = 0.02
"""Where dissipation is small, the two ways to compute it may differ by this fraction of it."""
_LEVEL = 1e-4
"""... or by this fraction of the energy of the block."""
_LOCATE = 0.01
"""In 3-D, contact opens and closes within this fraction of the way from where it should."""


@dataclass(frozen=True)
class Committed:
    """Friction states at the last accepted state, the block's nodes in order.

    Attributes:
        states: Open, stick or slip.
        reference: Tangential jumps, shape (m, d - 1), length.
        error: Difference of the two ways to compute the dissipation so far, energy.
    """

    states: NodeStates
    reference: Array
    error: float


class Friction:
    """The contact nodes of a jump system with friction.

    Args:
        dim: Jumps per node, 2 or 3.

    Attributes:
        components: Window components per node, -1 where a support holds one, shape (m, d).
        where: Pair and slave node, shape (m, 2).
        mu: Friction coefficients, shape (m,).
        gap: Initial gaps, shape (m,).
        states: What the nodes do now.
        reference: Tangential jumps of the last accepted state, shape (m, d - 1).
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
        self._stiffness: tuple[Array, Ints, Array] | None = None

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
        """Take more nodes, whose bonds are gone.

        Args:
            components: Window components, -1 where a support holds one, shape (k, d).
            where: Pair and slave node, shape (k, 2).
            mu: Friction coefficients, shape (k,).
            gap: Initial gaps, shape (k,), length.
            status: OPEN, STICK or SLIP, shape (k,).
            direction: Slip directions, shape (k, d - 1).
            reference: Present tangential jumps, shape (k, d - 1).
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
        self._stiffness = None

    def drop(self, k: int) -> None:
        """Take back the last k nodes."""
        n = len(self.mu) - k
        self.components, self.where = self.components[:n], self.where[:n]
        self.mu, self.gap, self.reference = self.mu[:n], self.gap[:n], self.reference[:n]
        self.states = NodeStates(self.states.status[:n], self.states.direction[:n])
        self._stiffness = None

    @property
    def rows(self) -> Ints:
        """Window components of the block."""
        return self.components[self.components >= 0]

    def save(self) -> Committed:
        """What :meth:`restore` needs to return here."""
        return Committed(self.states, self.reference.copy(), self.error)

    def restore(self, saved: Committed) -> None:
        """Return to a saved state of the same nodes."""
        self.states, self.reference, self.error = saved.states, saved.reference.copy(), saved.error

    def commit(self, jump: Array) -> None:
        """Accept a state: slips of the next increment are measured from its jumps.

        Args:
            jump: Jumps of the window, shape (n_window,), length.
        """
        self.reference = self._of(jump)[:, 1:]

    def closed(self, n_window: int) -> npt.NDArray[np.bool_]:
        """Which window components are normals in contact, shape (n_window,)."""
        out = np.zeros(n_window, dtype=bool)
        out[self.components[self.states.status != OPEN, 0]] = True
        return out

    # -- the block -----------------------------------------------------------------------

    def _of(self, values: Array) -> Array:
        """Values of window components at the nodes, 0 where a support holds one, shape (m, d)."""
        return np.where(self.components >= 0, values[np.maximum(self.components, 0)], 0.0)

    def _over(self, block: Array, n_window: int) -> Array:
        """Values at the nodes as values of all window components."""
        out = np.zeros(n_window)
        inside = self.components >= 0
        out[self.components[inside]] = block[inside]
        return out

    def block(self, system: LinearJumps) -> ContactBlock:
        """K at the present free set; kept until S, the nodes or the free set change."""
        free = system.cholesky.free
        known = self._stiffness
        if known is None or known[0] is not system.schur or not np.array_equal(known[1], free):
            flat = self.components.ravel()
            inside = np.flatnonzero(flat >= 0)
            _, star = system.cholesky.reduced(flat[inside])
            # a component that a support holds: its jump is zero
            k = np.diag(np.full(len(flat), np.diagonal(star).mean()))
            k[np.ix_(inside, inside)] = star
            self._stiffness = known = system.schur, free.copy(), k
        return ContactBlock(known[2], self.gap, self.mu)

    def load(self, system: LinearJumps, loads: Array, force: Array) -> Array:
        """G at loads and given forces, shape (m d,)."""
        flat = self.components.ravel()
        inside = np.flatnonzero(flat >= 0)
        still = system.linear(loads, force, np.zeros(system.n_window))
        out = np.zeros(len(flat))
        out[inside] = force[flat[inside]] - system.forces(still, flat[inside])
        return out

    def traction(self, system: LinearJumps, state: Equilibrium) -> Array:
        """Contact forces on the slave side at a state, shape (m, d)."""
        out = np.zeros(self.components.shape)
        inside = self.components >= 0
        rows = self.components[inside]
        out[inside] = system.forces(state, rows) - state.force[rows]
        return out

    def dissipation(self, system: LinearJumps, a: Equilibrium, b: Equilibrium) -> float:
        """Energy that friction takes on the way between two states, linear in between."""
        slip = (self._of(b.jump) - self._of(a.jump))[:, 1:]
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

    def condensed(self, system: LinearJumps, extra: Ints) -> Array:
        """S on components outside the block, all free, open and slipping ones condensed out.

        Friction forces count as given.

        Raises:
            NotPositiveDefinite: Nothing holds one of the open or slipping ones.
        """
        moving = self._moving()
        _, star = system.cholesky.reduced(np.concatenate([moving, extra]))
        n = len(moving)
        factor = system.cholesky.factorise(star[:n, :n], moving)
        y = solve_triangular(factor, star[:n, n:], lower=True)
        return np.asarray(star[n:, n:] - y.T @ y)

    def rates(self, system: LinearJumps, loads: Array, force: Array) -> tuple[Array, Array]:
        """Rates of jumps, shape (n_window,), and conjugates, shape (n_loads,), states fixed."""
        none = np.zeros(system.n_window)
        idle = np.zeros(len(loads))
        load = self.load(system, loads, force) - self.load(system, idle, none)
        block = ContactBlock(self.block(system).stiffness, np.zeros(len(self.gap)), self.mu)
        jump = jumps_of(block, load, self.states, np.zeros(self.reference.shape))
        one = system.linear(loads, force, self._over(jump, system.n_window))
        zero = system.linear(idle, none, none)
        return one.jump - zero.jump, one.conjugate - zero.conjugate

    # -- one increment -------------------------------------------------------------------

    def equilibrium(self, system: LinearJumps, loads: Array, force: Array) -> Equilibrium:
        """One increment of backward Euler from the committed state.

        Raises:
            ConvergenceError: No solution was found.
        """
        found = self._increment(self.block(system), self.load(system, loads, force))
        return system.linear(loads, force, self._over(found.jump, system.n_window))

    def _increment(self, block: ContactBlock, load: Array) -> Increment:
        start = np.column_stack([-self.gap, self.reference])
        found = backward_euler(block, load, self.reference, self.states, start)
        self.states = found.states
        self.steps += found.steps
        self.increments += 1
        return found

    # -- following -----------------------------------------------------------------------

    def pieces(
        self, system: LinearJumps, start: Equilibrium, loads: Array, force: Array
    ) -> Iterator[tuple[float, Equilibrium]]:
        """Follow stick, slip and contact from an equilibrium, which is committed, to other loads.

        Args:
            system: The jump system.
            start: Equilibrium the present states belong to.
            loads: Loads at the end.
            force: Given forces at the end.

        Yields:
            (fraction of the way, equilibrium there), the last one at 1. States and committed slips
            change only when the next piece is asked for.

        Raises:
            ConvergenceError: No equilibrium was found.
        """
        self.commit(start.jump)
        way = _Way(self, system, start, loads, force)
        yield from way.linear() if self.dim == 2 else way.increments()


class _Way:
    """The way from one equilibrium to other loads."""

    def __init__(
        self,
        friction: Friction,
        system: LinearJumps,
        start: Equilibrium,
        loads: Array,
        force: Array,
    ) -> None:
        self.friction = friction
        self.system = system
        self.start = start
        self.loads, self.force = loads, force
        self.block = friction.block(system)
        self.g = (
            friction.load(system, start.loads, start.force),
            friction.load(system, loads, force),
        )
        self.jump = friction._of(start.jump)
        self.at = 0.0
        self.last = start

    def _load(self, x: float) -> Array:
        return (1.0 - x) * self.g[0] + x * self.g[1]

    def _state(self, x: float, jump: Array) -> Equilibrium:
        loads = (1.0 - x) * self.start.loads + x * self.loads
        force = (1.0 - x) * self.start.force + x * self.force
        if x == 1.0:
            loads, force = self.loads, self.force
        return self.system.linear(loads, force, self.friction._over(jump, self.system.n_window))

    def _accept(self, x: float, state: Equilibrium) -> None:
        self.at, self.last = x, state
        self.jump = self.friction._of(state.jump)
        self.friction.commit(state.jump)

    # -- 2-D: from event to event --------------------------------------------------------

    def linear(self) -> Iterator[tuple[float, Equilibrium]]:
        """Exact pieces; where the states do not settle, a short increment of backward Euler."""
        friction = self.friction
        m = len(friction.mu)
        most, stuck, nudges, done = 400 + 40 * m, 0, 0, 0
        while True:
            done += 1
            if stuck > 20 + 4 * m or done > most:
                x = self.at + min(_NUDGE * 4.0**nudges, 1.0) * (1.0 - self.at)
                x = 1.0 if x > 1.0 - _SAME or done > most else x
                found = friction._increment(self.block, self._load(x))
                state = self._state(x, found.jump)
                yield x, state
                if x == 1.0:
                    return
                self._accept(x, state)
                stuck, nudges = 0, nudges + 1
                continue
            try:
                end = jumps_of(self.block, self.g[1], friction.states, self.jump[:, 1:])
            except Sliding:
                stuck = most
                continue
            fraction, status, direction = self._events(end)
            step = float(fraction.min(initial=np.inf))
            if not np.isfinite(step):
                yield 1.0, self._state(1.0, end)
                return
            stuck = stuck + 1 if step < _SAME else 0
            now = np.flatnonzero(fraction <= step + _SAME)
            if stuck > 8:
                now = now[:1]  # least index first: it ends where all at once would go round
            if step > 0.0:
                x = self.at + step * (1.0 - self.at)
                state = blend(self.last, self._state(1.0, end), step)
                yield x, state
                self._accept(x, state)
            friction.steps += 1
            friction.states = friction.states.switched(now, status[now], direction[now])

    def _events(self, end: Array) -> tuple[Array, Ints, Array]:
        """When each node changes on the way to ``end``, inf if not, and what to."""
        block, states = self.block, self.friction.states
        m = len(block.mu)
        p0 = block.forces(self.jump, self._load(self.at))
        p1 = block.forces(end, self.g[1])
        small_force = ROUND_OFF * max(np.abs(p1).max(initial=0.0), np.abs(p0).max(initial=0.0))
        small_jump = ROUND_OFF * max(np.abs(end).max(initial=0.0), np.abs(self.jump).max(initial=0))
        fraction, status = np.full(m, np.inf), states.status.copy()
        direction = states.direction.copy()
        rough = block.mu > 0.0

        def crossing(nodes: npt.NDArray[np.bool_], before: Array, after: Array, to: Ints) -> None:
            """Values that should stay positive fall below zero."""
            before = np.maximum(before, 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                x = before / (before - after)
            first = nodes & (x < fraction)
            fraction[first], status[first] = x[first], to[first]

        is_open, sticks = states.status == OPEN, states.status == STICK
        gap0, gap1 = self.jump[:, 0] + block.gap, end[:, 0] + block.gap
        crossing(
            is_open & (gap1 < -small_jump), gap0, gap1, np.where(rough, STICK, SLIP)
        )
        crossing(
            ~is_open & (p1[:, 0] < -small_force), p0[:, 0], p1[:, 0], np.full(m, OPEN)
        )
        for sign in (1.0, -1.0):
            room0 = block.mu * p0[:, 0] - sign * p0[:, 1]
            room1 = block.mu * p1[:, 0] - sign * p1[:, 1]
            before = fraction.copy()
            crossing(sticks & (room1 < -small_force), room0, room1, np.full(m, SLIP))
            direction[fraction < before, 0] = -sign
        back = states.direction[:, 0] * (end - self.jump)[:, 1] < -small_jump
        back &= (states.status == SLIP) & rough
        fraction[back], status[back] = 0.0, STICK
        return fraction, status, direction

    # -- 3-D: increments of backward Euler -----------------------------------------------

    def increments(self) -> Iterator[tuple[float, Equilibrium]]:
        """Increments whose size follows the change of slip directions and of contact."""
        friction, size = self.friction, 1.0
        while True:
            size = min(size, 1.0 - self.at)
            before = friction.states
            while True:
                x = 1.0 if self.at + size > 1.0 - _SAME else self.at + size
                found = friction._increment(self.block, self._load(x))
                smaller, error = self._judge(x, found, before)
                if smaller >= 1.0 or size <= _SMALLEST:
                    break
                friction.states = before
                size *= max(smaller, _SMALLEST / size)
            state = self._state(x, found.jump)
            yield x, state
            friction.error += error
            if x == 1.0:
                return
            self._accept(x, state)
            size *= 2.0

    def _judge(self, x: float, found: Increment, before: NodeStates) -> tuple[float, float]:
        """Factor for the size of the increment, at least 1 if it is good; its error."""
        block = self.block
        p0 = block.forces(self.jump, self._load(self.at))
        rough = block.mu > 0.0
        slip = (found.jump - self.jump)[rough, 1:]
        at_end = -float(np.sum(found.force[rough, 1:] * slip))
        mean = -0.5 * float(np.sum((p0 + found.force)[rough, 1:] * slip))
        error = abs(at_end - mean)
        level = float(np.abs(found.jump.ravel()) @ np.abs(self._load(x)))
        factor = 1.0
        if error > max(_SPREAD * at_end, _LEVEL * level):
            factor = 0.5
        was, now = before.status != OPEN, found.states.status != OPEN
        r = np.diagonal(block.stiffness).reshape(found.jump.shape)[:, 0]
        gap0, gap1 = self.jump[:, 0] + block.gap, found.jump[:, 0] + block.gap
        closes, opens = ~was & now, was & ~now
        with np.errstate(divide="ignore", invalid="ignore"):
            way = np.where(closes, gap0 / (gap0 + found.force[:, 0] / r), np.inf)
            way = np.where(opens, p0[:, 0] / (p0[:, 0] + r * gap1), way)
        late = way[np.isfinite(way) & (way * (x - self.at) > _LOCATE)]
        if len(late) and late.min() < 0.99:
            factor = min(factor, float(late.min()))
        return factor, error


__all__ = ["Committed", "Friction"]
