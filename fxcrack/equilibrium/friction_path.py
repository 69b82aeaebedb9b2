"""Following stick, slip and contact from one equilibrium to other loads.

In 2-D everything is linear in the loads while no node changes its state, so the path is followed
from event to event: a slip starts where |p_t| = mu p_n, a node sticks again where its slip would
turn back, contact opens and closes. In 3-D slip directions turn: increments of backward Euler,
halved until the dissipation by the forces at their end and by the mean of both ends agree.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.equilibrium.coulomb import (
    OPEN,
    ROUND_OFF,
    SLIP,
    STICK,
    Increment,
    NodeStates,
    Sliding,
    jumps_of,
)
from fxcrack.equilibrium.friction import Friction
from fxcrack.equilibrium.jump_system import Equilibrium, JumpSystem, blend

_SAME = 1e-12
"""Events closer together than this fraction of the way happen at once."""
_STUCK = 60
"""Changes at one load after which an increment of backward Euler finds the states of all nodes at
once: one by one, forces at round-off far from the load could be changed thousands of times."""
_NUDGE = 1e-3
"""Fraction of the way done by backward Euler where following gets stuck."""
_SMALLEST = 1.0 / 128.0
"""Smallest increment in 3-D, as a fraction of the way."""
_SPREAD = 0.02
"""Where dissipation is small, the two ways to compute it may differ by this fraction of it."""
_LEVEL = 1e-4
"""... or by this fraction of the energy of the block."""
_LOST = 1e-9
"""Work of pressure on openings in an increment in 3-D, as a fraction of the energy of the block:
contact that changes on the way has some, which is missing from the balance."""
_AT_EVENT = 1e-9
"""Changes of contact nearer to the end of an increment than this fraction of it are at its end."""
_TRIES = 20
"""Trials to end an increment where contact changes; the estimate of that place is linear."""


def follow(
    friction: Friction, system: JumpSystem, start: Equilibrium, loads: Array, force: Array
) -> Iterator[tuple[float, Equilibrium]]:
    """Follow stick, slip and contact from an equilibrium, which is committed, to other loads.

    Args:
        friction: The contact nodes.
        system: The jump system.
        start: Equilibrium the present states belong to.
        loads: Amplitudes of supports and load factors at the end, shape (n_loads,).
        force: Given forces at the end, shape (n_retained,), force.

    Yields:
        (fraction of the way, equilibrium there), the last one at 1. States and committed slips
        change only when the next piece is requested.

    Raises:
        ConvergenceError: No equilibrium was found.
    """
    friction.commit(start.jump)
    way = _Way(friction, system, start, loads, force)
    yield from way.linear() if friction.dim == 2 else way.increments()


class _Way:
    """The way from one equilibrium to other loads."""

    def __init__(
        self,
        friction: Friction,
        system: JumpSystem,
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
        self.jump = friction.of(start.jump)
        self.at = 0.0
        self.last = start

    def _load(self, x: float) -> Array:
        return (1.0 - x) * self.g[0] + x * self.g[1]

    def _state(self, x: float, jump: Array) -> Equilibrium:
        loads = (1.0 - x) * self.start.loads + x * self.loads
        force = (1.0 - x) * self.start.force + x * self.force
        if x == 1.0:
            loads, force = self.loads, self.force
        return self.system.linear(loads, force, self.friction.over(jump, self.system.n_retained))

    def _accept(self, x: float, state: Equilibrium) -> None:
        self.at, self.last = x, state
        self.jump = self.friction.of(state.jump)
        self.friction.commit(state.jump)

    # -- 2-D: from event to event --------------------------------------------------------

    def linear(self) -> Iterator[tuple[float, Equilibrium]]:
        """Exact pieces; where the states do not settle, a short increment of backward Euler."""
        friction = self.friction
        m = len(friction.mu)
        most, stuck, nudges, done = 400 + 40 * m, 0, 0, 0
        while True:
            done += 1
            found = None
            if stuck > min(20 + 4 * m, _STUCK) or done > most:
                x = self.at + min(_NUDGE * 4.0**nudges, 1.0) * (1.0 - self.at)
                x = 1.0 if x > 1.0 - _SAME or done > most else x
                found = friction.increment(self.block, self._load(x))
            try:
                end = jumps_of(self.block, self.g[1], friction.states, self.jump[:, 1:])
                fraction, status, direction = self._events(end)
                step = float(fraction.min(initial=np.inf))
            except Sliding:
                stuck, step = most, 0.0
            if found is not None and step < _SAME:
                # the states of the increment are not those of a linear piece: take it as it is
                state = self._state(x, found.jump)
                yield x, state
                if x == 1.0:
                    return
                self._accept(x, state)
                stuck, nudges = 0, nudges + 1
                continue
            if stuck >= most:
                continue
            if not np.isfinite(step):
                yield 1.0, self._state(1.0, end)
                return
            stuck = stuck + 1 if step < _SAME else 0
            now = np.flatnonzero(fraction <= step + _SAME)
            if stuck > 8:
                now = now[:1]  # least index first: terminates where all at once would cycle
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
        crossing(is_open & (gap1 < -small_jump), gap0, gap1, np.where(rough, STICK, SLIP))
        crossing(~is_open & (p1[:, 0] < -small_force), p0[:, 0], p1[:, 0], np.full(m, OPEN))
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
        friction, usual = self.friction, 1.0
        while True:
            size, before, tries = min(usual, 1.0 - self.at), friction.states, 0
            while True:
                x = 1.0 if self.at + size > 1.0 - _SAME else self.at + size
                found = friction.increment(self.block, self._load(x))
                good, event, error = self._judge(x, found, before)
                tries += 1
                if not good and size > _SMALLEST:
                    size = usual = 0.5 * size
                elif event < 1.0 and tries <= _TRIES:
                    size *= event
                else:
                    break
                friction.states = before
            state = self._state(x, found.jump)
            yield x, state
            friction.error += error
            if x == 1.0:
                return
            self._accept(x, state)
            usual = min(2.0 * usual, 1.0)

    def _judge(self, x: float, found: Increment, before: NodeStates) -> tuple[bool, float, float]:
        """Whether an increment is small enough; the part of it up to a change of contact; error."""
        block = self.block
        p0 = block.forces(self.jump, self._load(self.at))
        rough = block.mu > 0.0
        slip = (found.jump - self.jump)[rough, 1:]
        at_end = -float(np.sum(found.force[rough, 1:] * slip))
        mean = -0.5 * float(np.sum((p0 + found.force)[rough, 1:] * slip))
        error = abs(at_end - mean)
        level = float(np.abs(found.jump.ravel()) @ np.abs(self._load(x)))
        good = error <= max(_SPREAD * at_end, _LEVEL * level)
        lost = 0.5 * float(np.sum((p0 + found.force)[:, 0] * (found.jump - self.jump)[:, 0]))
        if abs(lost) <= _LOST * level:
            return good, 1.0, error
        return good, self._change_of_contact(x, before, p0), error

    def _change_of_contact(self, x: float, before: NodeStates, p0: Array) -> float:
        """Fraction of an increment at which contact seems to change, less than 1.

        The states before the increment, kept to its end, tell when they fail first.
        """
        block, closed, load = self.block, before.status != OPEN, self._load(x)
        try:
            kept = jumps_of(block, load, before, self.jump[:, 1:])
        except Sliding:
            return 0.5
        p1 = block.forces(kept, load)
        gap0, gap1 = self.jump[:, 0] + block.gap, kept[:, 0] + block.gap
        with np.errstate(divide="ignore", invalid="ignore"):
            way = np.where(closed, p0[:, 0] / (p0[:, 0] - p1[:, 0]), gap0 / (gap0 - gap1))
        return float(way[(way > 0.1) & (way < 1.0 - _AT_EVENT)].min(initial=0.5))


__all__ = ["follow"]
