"""Bond forces and jumps of the present increment of explicit dynamics, at all rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.interface.front import Front
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.solvers.explicit_interface import InterfaceDynamics


class PresentInterface:
    """What criteria ask of the interfaces, found where it is asked for.

    Args:
        lumped: The interfaces.
        dynamics: Their motion.

    Attributes:
        index: Number of each jump per pair, -1 where there is none or a support holds it, shape
            (n_nodes, gdim).
    """

    def __init__(self, lumped: LumpedInterface, dynamics: InterfaceDynamics) -> None:
        self._lumped, self._dynamics = lumped, dynamics
        gdim = lumped.frames.shape[-1]
        self._bonds = np.zeros((lumped.n_rows + 1, gdim))
        self._jumps = np.zeros((lumped.n_rows + 1, gdim))
        self._any_held = bool(lumped.held.any())
        self._known = False
        self.index = []
        for rows, held in zip(lumped.row_of, lumped.pair_held, strict=True):
            numbers = gdim * rows[:, None] + np.arange(gdim)
            self.index.append(np.where((rows >= 0)[:, None] & ~held, numbers, -1))

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

    def in_frames(self) -> tuple[Array, Array]:
        """Forces on the slave side of open rows, and jumps, in the frames of the rows.

        Returns:
            Force and length, shape (n_rows gdim,) each; zero where a row is tied.
        """
        lumped = self._lumped
        jumps = np.einsum("nci,nc->ni", lumped.frames, self.jumps[:-1])
        force = np.zeros_like(jumps)
        force[lumped.open] = self._dynamics.open_forces()
        force = np.einsum("nci,nc->ni", lumped.frames, force)
        return force.ravel(), jumps.ravel()

    def arrays(self, fronts: Sequence[Front], jump: Array) -> dict[str, npt.NDArray[Any]]:
        """Bonds and jumps of a checkpoint.

        Args:
            fronts: Per pair.
            jump: Values of the numbered jumps, shape (n_rows gdim,), length.

        Returns:
            bonded[p], shape (n_nodes,), and jump[p], shape (n_nodes, gdim), per pair.
        """
        out: dict[str, npt.NDArray[Any]] = {}
        for p, (front, index) in enumerate(zip(fronts, self.index, strict=True)):
            out[f"bonded[{p}]"] = front.bonded
            out[f"jump[{p}]"] = np.append(jump, 0.0)[index]
        return out

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
