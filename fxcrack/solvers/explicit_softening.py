"""The bonds that soften at present in explicit dynamics, and their forces over an increment."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.equilibrium.discrete_gradient import force_of_one, softening_force
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.lumped_rows import jumps_along, pull_along
from fxcrack.solvers.explicit_bonds import SofteningBonds

SWEEPS = 200
"""Sweeps, at most, over nodes that share masters; those of stiff bonds take many."""
_AT_ONCE = 30
"""Sweeps in which all bonds take the forces of the sweep before."""
_SETTLED = 1e-12
"""Change of forces in a sweep, over the largest of them, that ends the sweeps."""
_FREE = 1.0 - 1e-12
"""Part of the final opening from which on a bond is free."""
_FEW = 16
"""Bonds up to which plain numbers are faster than arrays."""


class LiveBonds:
    """The bonds that soften at present.

    Args:
        bonds: Laws of all rows.
        lumped: The interfaces.

    Attributes:
        rows: Rows of the interface, shape (n,).
        direction: Directions of their openings, shape (n, gdim).
        origin: Jumps from which openings count, shape (n,), length.
        along: Openings by the motion of the nodes, (n, n_nodes gdim).
        push: Accelerations of the nodes by forces along the openings, (n_nodes gdim, n).
        coupling: Accelerations of the openings by such forces, shape (n, n).
        coupled: Whether bonds act on each other.
    """

    def __init__(self, bonds: SofteningBonds, lumped: LumpedInterface) -> None:
        self._bonds = bonds
        self.rows = k = np.flatnonzero(bonds.active & ~lumped.tied)
        self.direction = bonds.direction[k]
        self.along = jumps_along(lumped, k, self.direction)
        self.push, self.coupling = pull_along(lumped, k, self.direction)
        self.coupled = not lumped.separate
        self._strength, self._final = bonds.strength[k], bonds.final[k]
        self.origin = bonds.origin[k]
        self._numbers = list(zip(self._strength.tolist(), self._final.tolist(), strict=True))
        self.low, self.top = bonds.low[k].tolist(), bonds.top[k].tolist()
        self._diagonal = self.coupling.diagonal().copy()
        self._others = self.coupling - np.diag(self._diagonal)
        self._last = np.zeros(len(k))
        self._buffers = [np.zeros(len(k)) for _ in range(3)]

    @property
    def largest(self) -> Array:
        """Largest forces of the laws, shape (n,), force."""
        return self._strength

    def __len__(self) -> int:
        """How many bonds soften."""
        return len(self.rows)

    def alone(self, here: Array, without: Array, hh: float) -> Array:
        """Forces of bonds that only their own force and the given motion move, tension positive.

        All of shape (n,).

        Args:
            here: Openings at the start of the increment, length.
            without: Openings at its end without the bond's own force, length.
            hh: dt h.
        """
        if len(self) > _FEW:
            low = np.array(self.low)
            change = 0.5 * (here + without) - low
            return softening_force(
                self._strength, self._final, low, np.array(self.top), change,
                0.5 * hh * self._diagonal,
            )  # fmt: skip
        return np.array(
            [
                force_of_one(f0, wf, low, top, 0.5 * (a + b) - low, 0.5 * hh * c)
                for (f0, wf), low, top, a, b, c in zip(
                    self._numbers, self.low, self.top, here.tolist(), without.tolist(),
                    self._diagonal.tolist(), strict=True,
                )
            ]
        )  # fmt: skip

    def forces(self, u: Array, x: Array, hh: float) -> Array:
        """Forces over an increment in which nothing else acts on open pairs, shape (n,).

        Args:
            u: Displacement of the nodes at the start, shape (n_nodes gdim,).
            x: At the end without these forces, same shape.
            hh: dt h.
        """
        here, free = self.along.into(u, self._buffers[0]), self.along.into(x, self._buffers[1])
        return self.together(here - self.origin, free - self.origin, hh)

    def together(self, here: Array, free: Array, hh: float) -> Array:
        """Forces of the bonds on each other's openings, tension positive, shape (n,).

        All at once, as long as that converges; one after the other where stiff secants share
        masters.

        Args:
            here: Openings at the start of the increment from :attr:`origin`, shape (n,), length.
            free: Openings at its end without the forces of any of them, same shape.
            hh: dt h.
        """
        if not self.coupled:
            self._last = self.alone(here, free, hh)
            return self._last
        force = self._last
        for _ in range(_AT_ONCE):
            before = force
            force = self.alone(here, free - hh * (self._others @ before), hh)
            if settled(force, before):
                break
        else:
            force = self._in_turn(here, free, force, hh)
        self._last = force
        return force

    def _in_turn(self, here: Array, free: Array, force: Array, hh: float) -> Array:
        force = force.copy()
        at, own = here.tolist(), (0.5 * hh * self._diagonal).tolist()
        for _ in range(SWEEPS):
            before = force.copy()
            for i, (f0, wf) in enumerate(self._numbers):
                change = 0.5 * (at[i] + free[i] - hh * (self._others[i] @ force)) - self.low[i]
                force[i] = force_of_one(f0, wf, self.low[i], self.top[i], change, own[i])
            if settled(force, before):
                break
        return force

    def follow(
        self, forces: Array, u: Array, before: Array, v: Array, h: float, dt: float
    ) -> float:
        """Take the openings of an increment; the energy that the bonds take in it.

        Args:
            forces: Of the bonds, tension positive, shape (n,), force.
            u: Displacement of the nodes at its start, shape (n_nodes gdim,).
            before: Velocity in the middle of the last increment, same shape.
            v: In the middle of this one, same shape.
            h: Time between both.
            dt: The increment.
        """
        old, new, at = self._buffers
        self.along.into(before, old)
        self.along.into(v, new)
        self.along.into(u, at)
        at -= self.origin
        bonds, k, spent = self._bonds, self.rows, 0.0
        numbers = zip(
            forces.tolist(), old.tolist(), new.tolist(), at.tolist(), k.tolist(), strict=True
        )
        for i, (force, r0, r1, w, row) in enumerate(numbers):
            spent += 0.5 * h * force * (r0 + r1)
            # by openings in the middle of increments, of which the first one counts whole
            low = w + 0.5 * dt * r1
            bonds.spent[row] += force * (low - self.low[i])
            self.low[i] = low
            self.top[i] = max(self.top[i], low)
        return spent

    def broken(self) -> Ints:
        """Rows of the bonds that have reached their final opening."""
        done = [t >= _FREE * wf for t, (_, wf) in zip(self.top, self._numbers, strict=True)]
        return self.rows[done] if any(done) else self.rows[:0]

    def store(self) -> None:
        """Write the openings into the laws of all rows."""
        self._bonds.low[self.rows], self._bonds.top[self.rows] = self.low, self.top


def settled(now: Array, before: Array) -> bool:
    """Whether forces, shape (n,), no longer change from sweep to sweep."""
    return bool(np.abs(now - before).max(initial=0.0) <= _SETTLED * np.abs(now).max(initial=0.0))


__all__ = ["SWEEPS", "LiveBonds", "settled"]
