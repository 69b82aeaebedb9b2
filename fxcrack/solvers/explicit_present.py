"""Bond forces and jumps of the present increment of explicit dynamics, at all rows."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.solvers.explicit_interface import InterfaceDynamics


class PresentInterface:
    """What criteria ask of the interfaces, found where it is asked for.

    Args:
        lumped: The interfaces.
        dynamics: Their motion.
    """

    def __init__(self, lumped: LumpedInterface, dynamics: InterfaceDynamics) -> None:
        self._lumped, self._dynamics = lumped, dynamics
        gdim = lumped.frames.shape[-1]
        self._bonds = np.zeros((lumped.n_rows + 1, gdim))
        self._jumps = np.zeros((lumped.n_rows + 1, gdim))
        self._any_held = bool(lumped.held.any())
        self._known = False

    def forget(self) -> None:
        """Another increment, or other ties."""
        self._known = False

    @property
    def bonds(self) -> Array:
        """Forces of the bonds on the slaves, shape (n_rows + 1, gdim), force; the last row is 0."""
        self._know()
        return self._bonds

    @property
    def jumps(self) -> Array:
        """Jumps of the rows without a bond, shape (n_rows + 1, gdim), length."""
        self._know()
        return self._jumps

    def _know(self) -> None:
        if self._known:
            return
        dynamics, lumped = self._dynamics, self._lumped
        rows, forces = lumped.bond_forces(dynamics.a, dynamics.total)
        if self._any_held:
            forces = self._without_supports(rows, forces)
        self._bonds[lumped.open] = 0.0
        self._bonds[rows] = forces
        self._jumps[lumped.open] = dynamics.gap
        if dynamics.elastic.exist:
            self._bonds[lumped.open] = dynamics.elastic.forces(dynamics.gap)
            self._jumps[dynamics.elastic.rows] = 0.0
        self._known = True

    def _without_supports(self, rows: Ints, forces: Array) -> Array:
        """Bond forces without the components that supports hold, which are their reactions."""
        frames = self._lumped.frames[rows]
        local = np.einsum("nci,nc->ni", frames, forces)
        local[self._lumped.held[rows]] = 0.0
        return np.asarray(np.einsum("nci,ni->nc", frames, local))


__all__ = ["PresentInterface"]
