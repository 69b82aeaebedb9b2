"""What criteria ask of one interface, answered by the present increment of explicit dynamics."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.front import Front
from fxcrack.interface.pair import Pair


class InterfaceValues(Protocol):
    """The present forces and jumps at the rows of all interfaces, a row of zeros last.

    Attributes:
        continuum: Bodies.
        pairs: Interfaces.
        fronts: Their fronts.
        row_of: Row of each slave node per pair, -1 where it has no jump, shape (n_nodes,).
    """

    continuum: Continuum
    pairs: list[Pair]
    fronts: list[Front]
    row_of: list[Ints]

    @property
    def bonds(self) -> Array:
        """Forces of the bonds on the slaves, shape (n_rows + 1, gdim), force."""

    @property
    def jumps(self) -> Array:
        """Jumps, shape (n_rows + 1, gdim), length."""

    @property
    def face_loads(self) -> Array | None:
        """Forces of loads on the slave side, shape (n_rows + 1, gdim), force.

        ``None`` where no load acts on any interface.
        """

    def displacements_of(self, where: list[Ints]) -> Array:
        """Mean displacements of sets of owned nodes, shape (n_sets, gdim); collective."""


class ExplicitFrontProbe:
    """A :class:`fxcrack.criteria.probe.FrontProbe`, where all shapes and signs are given.

    Bond forces are those of the instant: what keeps a slave on its masters, less what its own mass
    and its own side of the body do. There is one state, the present one; the argument ``state`` of
    the methods is not read.

    Args:
        values: The solver's present values.
        p: Number of the pair.
    """

    def __init__(self, values: InterfaceValues, p: int) -> None:
        self._values = values
        self._p = p
        self.front: Front = values.fronts[p]
        self.gdim: int = values.continuum.gdim
        self._followed: list[Ints] = []

    @property
    def pair(self) -> Pair:
        """The interface, paired anew where its faces slide."""
        return self._values.pairs[self._p]

    def _vectors(self, nodes: Ints, values: Array) -> Array:
        found = values[self._values.row_of[self._p][nodes]]
        if self.gdim == 3:
            return found
        out = np.zeros((*found.shape[:-1], 3))
        out[..., :2] = found
        return out

    def bond_forces(self, nodes: Ints, state: Any) -> Array:
        """Bond forces, tension positive, global vectors of shape (..., 3) [force]."""
        return -self._vectors(nodes, self._values.bonds)

    def round_off(self, nodes: Ints, state: Any) -> Array:
        """Nothing: forces of explicit dynamics are not searched for a load, shape (...) [force]."""
        return np.zeros(np.shape(nodes))

    def jumps(self, nodes: Ints, state: Any) -> Array:
        """Jumps, global vectors of shape (..., 3) [length]."""
        return self.pair.interface.opening_factor * self._vectors(nodes, self._values.jumps)

    @property
    def bodies(self) -> Any:
        """Not to be integrated over: their state is no equilibrium.

        Raises:
            InputError: Always.
        """
        raise InputError(
            "method='domain' integrates over bodies in equilibrium, which explicit dynamics does "
            "not have; use method='vcct'"
        )

    @property
    def has_face_loads(self) -> bool:
        """Whether loads act on the faces of any interface."""
        return self._values.face_loads is not None

    def face_loads(self, nodes: Ints, state: Any) -> Array:
        """Loads on the faces, global vectors of shape (..., 3) [force]."""
        loads = self._values.face_loads
        if loads is None:
            return np.zeros((*np.shape(nodes), 3))
        return self._vectors(nodes, loads)

    def released_jumps(self, nodes: Ints, force: Array, normal: Array | None = None) -> Array:
        """Not known without a condensed stiffness.

        Raises:
            InputError: Always.
        """
        raise InputError(
            "exact crack closure needs the condensed stiffness of the bodies, which explicit "
            "dynamics does not have; use method='vcct'"
        )

    def mean_position(self, group: str) -> Array:
        """Mean reference position of the nodes of a group, shape (3,) [length]; collective.

        Raises:
            InputError: The mesh has no such group, or it holds no node.
        """
        return self._values.continuum.mean_position(group)

    def follow(self, where: str | int) -> int:
        """Follow the mean displacement of a group or of a slave node; its row in :meth:`motion`."""
        continuum = self._values.continuum
        if isinstance(where, str):
            self._followed.append(np.asarray(continuum.owned_nodes(where), dtype=np.int64))
        else:
            layout = continuum.layout
            node = self.pair.surface.dofs[where]
            here = np.array([node])[: int(layout.is_owned(node))]
            self._followed.append(layout.to_local(here))
        return len(self._followed) - 1

    def motion(self, state: Any) -> Array:
        """Displacements that are followed, shape (n_followed, gdim) [length]."""
        return self._values.displacements_of(self._followed)


__all__ = ["ExplicitFrontProbe", "InterfaceValues"]
