"""Forces between the faces of open pairs in an increment, and the energy that leaves by them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints


@dataclass
class InterfaceEnergies:
    """Energy that has left the bodies through the interfaces, force times length.

    Attributes:
        bonds: Spent by bonds that are released.
        contact: Lost where faces meet.
        friction: Dissipated by friction.
        ties: Kinetic energy of row sums beyond that of the nodes, gone with released ties.
    """

    bonds: float = 0.0
    contact: float = 0.0
    friction: float = 0.0
    ties: float = 0.0


@dataclass
class ActingForces:
    """Forces on the slave side of the open rows in the present increment, by what they are.

    Attributes:
        softening: Forces of the live bonds, tension positive, shape (n_live,).
        fading: Rows among the open ones, and forces, of bonds that fade.
        contact: Likewise, of faces that touch; normal forces.
        friction: Likewise, tangential forces.
        total: Sum of all, shape (n_open, gdim); ``None`` where only live bonds act, or nothing.
    """

    softening: Array | None = None
    fading: tuple[Ints, Array] | None = None
    contact: tuple[Ints, Array] | None = None
    friction: tuple[Ints, Array] | None = None
    total: Array | None = None

    def account(self, energies: InterfaceEnergies, way: Array) -> None:
        """Add what fading bonds, contact and friction dissipate on a way of the open jumps.

        Args:
            energies: Sums so far, added to.
            way: Change of the jumps, shape (n_open, gdim), length.
        """
        if self.fading is not None:
            energies.bonds -= _work(self.fading, way)
        if self.contact is not None:
            energies.contact -= _work(self.contact, way)
        if self.friction is not None:
            energies.friction -= _work(self.friction, way)


def _work(acting: tuple[Ints, Array], way: Array) -> float:
    rows, forces = acting
    return float(np.vdot(forces, way[rows]))


__all__ = ["ActingForces", "InterfaceEnergies"]
