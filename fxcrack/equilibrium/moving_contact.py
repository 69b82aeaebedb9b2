"""Contact over an increment of time: an impulse that does no work.

Where the faces of a node would overlap at the end of the increment, they stay at the distance they
have at its beginning, as long as the impulse presses; all others move freely:

    impulse >= 0,   delta(end) - delta(begin) >= 0,   and one of them is zero

The work of the impulse is that of its mean force on the change of the jump, which is zero: contact
takes no energy and gives none (Laursen and Chawla 1997). It acts before faces overlap, not after,
so that they never do; the distance left is less than the way of one increment. Faces that overlap
at the beginning, by a new pairing on a bent surface, are apart at the end; that work is counted.
With friction, slips begin where the increment does, and forces obey Coulomb's law.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.equilibrium.coulomb import OPEN


@dataclass(frozen=True)
class ImpulseWork:
    """Energies of an increment whose contact forces are impulses.

    The trapezoidal rule takes forces from both ends. An impulse belongs to its increment alone:
    what it does there is its mean force times the change, and nothing in the next one.

    Attributes:
        supports: What that adds to the mean reactions of supports, shape (n_supports,).
        bonds: What it adds to the energy that bonds release.
        friction: Energy dissipated by friction.
        beyond: Energy that contact takes by the trapezoidal rule beyond friction, with what it adds
            to supports and bonds.
        overlap: Work of impulses that pushed overlapping faces apart.
    """

    supports: Array
    bonds: float
    friction: float
    beyond: float
    overlap: float


class MovingContact:
    """Contact of a system over one increment of time.

    Args:
        system: The dense system, in the state of the increment's beginning.
        here: That state.
    """

    def __init__(self, system: ContactSystem, here: Equilibrium) -> None:
        self._system, self._here = system, here
        self._gap = system.gap.copy()
        self._held = np.zeros(system.n_retained, dtype=bool)
        self._overlaps = system.contact & (here.jump + self._gap < 0.0)
        if system.friction is not None:
            system.friction.commit(here.jump)
        rows = closed_components(system)
        self._contact = np.zeros(system.n_retained)
        self._contact[rows] = system.pressure(here, rows)

    def begin_again(self) -> None:
        """Forget which faces would overlap: the bodies are linearised anew."""
        self._held[:] = False
        self._set_gaps()

    def equilibrium(self, loads: Array, force: Array) -> Equilibrium:
        """Equilibrium of the increment's end on the present tangent.

        Args:
            loads: Amplitudes of supports and load factors at the end, shape (n_loads,).
            force: Given forces at the end, shape (n_retained,), force.

        Raises:
            ConvergenceError: There is none.
        """
        while True:
            state = self._system.equilibrium(loads, force)
            more = self._system.closed & ~self._held
            if not more.any():
                return state
            self._held |= more  # it only grows, so that this ends
            self._set_gaps()

    def _set_gaps(self) -> None:
        system = self._system
        stay = self._held & ~self._overlaps
        system.gap[:] = np.where(stay, -self._here.jump, self._gap)
        if system.friction is not None:
            system.friction.gap[:] = system.gap[system.friction.components[:, 0]]

    def end(self) -> None:
        """Give the system its gaps back."""
        self._held[:] = False
        self._set_gaps()

    def work(self, end: Equilibrium, means: Array, n_supports: int) -> ImpulseWork:
        """Energies of an increment whose forces are partly impulses.

        Args:
            end: State of the end.
            means: Mean forces of the impulses of the increment before and of this one on the last
                coordinates, which the forces of its beginning and end contain, shape (2, n_last).
            n_supports: Number of supports, the first of the loads.
        """
        n, before = self._system.n_retained, self._contact
        step = end.jump - self._here.jump
        after = np.zeros(n)
        after[closed_components(self._system)] = 1.0
        after *= means[1, :n]
        friction = 0.0
        if self._system.friction is not None:
            of = self._system.friction.of
            friction = -float(np.sum((of(step) * of(after))[:, 1:]))
        more = 0.5 * (means[1] - means[0])
        supports = more[n : n + n_supports]
        # those of contact are not among the bonds' forces, but for what it took over from a bond
        # released just now: that is no impulse
        bonds = -float(np.where((before != 0.0) | (after != 0.0), 0.0, more[:n]) @ step)
        bonds -= 0.5 * float(np.where(before != 0.0, before - means[0, :n], 0.0) @ step)
        moved = (end.loads - self._here.loads)[:n_supports]
        trapezoidal = 0.5 * float((before + after) @ step)
        pushed = float((after * step)[self._overlaps].sum())
        beyond = float(supports @ moved) - bonds - trapezoidal - friction + pushed
        return ImpulseWork(supports, bonds, friction, beyond, pushed)


def closed_components(system: ContactSystem) -> Ints:
    """Components that contact and friction exert a force on now, shape (k,)."""
    if system.friction is None:
        return np.flatnonzero(system.closed)
    rows = system.friction.components[system.friction.states.status != OPEN]
    return np.asarray(rows[rows >= 0])


def known_forces(system: ContactSystem, here: Equilibrium, force: Array) -> Array:
    """Interface forces to begin an increment with: those given at its end, no contact.

    Args:
        system: The dense system.
        here: State of its beginning.
        force: Given forces at its end, shape (n_retained,), force.

    Returns:
        Shape (n_retained,), force.
    """
    given: Bools = system.knows_force()
    soft = system.soft.components
    given[soft] = False
    out = np.where(given, force, system.forces(here, np.arange(system.n_retained)))
    touching = soft[system.closed[soft]]
    out[touching] = here.force[touching]  # that of the bonds
    return out


__all__ = ["MovingContact", "closed_components", "known_forces"]
