"""Prescribed motion of dofs in explicit dynamics, and its reactions.

    v^{n+1/2} = (u_D^{n+1} - u^n)/dt,    R = m (v^{n+1/2} - v^{n-1/2})/h - f

At interface nodes m and f are those of the node with the slaves tied to it; what is tied itself
shows no reaction of its own.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.supports import Supports
from fxcrack.solvers.explicit_interface import InterfaceDynamics


class PrescribedMotion:
    """The prescribed dofs of this rank: first those within the bodies, then those at interfaces.

    Args:
        supports: Prescribed components.
        lumped: Interfaces.
        at_interface: Owned dofs of interface nodes, shape (n,).

    Attributes:
        dofs: Those within the bodies, shape (n_dofs,).
        columns: Support column of all of them, shape (n_prescribed,).
        values: Entry of the column, shape (n_prescribed,).
        holds_nodes: Whether any of them are at interfaces.
    """

    def __init__(self, supports: Supports, lumped: LumpedInterface, at_interface: Ints) -> None:
        inside = supports.which >= 0
        inside[at_interface] = False
        self.dofs = np.flatnonzero(inside)
        self._column, self._value = supports.which[self.dofs], supports.value[self.dofs]
        mine = np.zeros((len(lumped.nodes), 1), dtype=bool)
        mine[lumped.nodes.mine] = True
        self._nodes = np.nonzero((lumped.which >= 0) & mine)
        self.holds_nodes = bool(len(self._nodes[0]))
        self.columns = np.concatenate([self._column, lumped.which[self._nodes]]).astype(np.int64)
        self.values = np.concatenate([self._value, lumped.value[self._nodes]])

    def velocities(self, u: Array, coordinates: Array, dt: float) -> Array:
        """Velocities of :attr:`dofs` that lead to the prescribed displacement, shape (n_dofs,).

        Args:
            u: Displacement of the owned dofs, shape (n_local,).
            coordinates: Of the support columns at the end, shape (n_columns,).
            dt: The increment.
        """
        return np.asarray((self._value * coordinates[self._column] - u[self.dofs]) / dt)

    def motion(self, owned: Array, nodes: Array) -> Array:
        """A motion at all prescribed dofs, shape (n_prescribed,).

        Args:
            owned: Of the owned dofs, shape (n_local,).
            nodes: Of the interface nodes, shape (n_nodes, gdim).
        """
        within = owned[self.dofs]
        return np.concatenate([within, nodes[self._nodes]]) if self.holds_nodes else within

    def at_nodes(self, lumped: LumpedInterface, dynamics: InterfaceDynamics) -> Array:
        """Reactions at interface nodes, shape (n_prescribed - n_dofs,), force."""
        node = self._nodes[0]
        if not len(node):
            return np.zeros(0)
        needed = lumped.group_mass[node] * dynamics.a[self._nodes]
        follows = np.zeros(len(lumped.nodes), dtype=bool)
        # on a rigid surface no master shows the reaction instead
        follows[lumped.slave[lumped.tied & ~lumped.rigid]] = True
        return np.where(follows[node], 0.0, needed - dynamics.total[self._nodes])

    def by_column(self, reactions: Array, n_columns: int) -> Array:
        """Reactions summed over the dofs of each column, shape (n_columns,); this rank's part."""
        return np.bincount(self.columns, self.values * reactions, n_columns)

    def on_unknowns(self, reactions: Array, lumped: LumpedInterface) -> Array:
        """Reactions at the owned dofs, shape (n_local,), 0 where nothing is prescribed."""
        layout, (node, component) = lumped.nodes.layout, self._nodes
        out = np.zeros(layout.n_local)
        out[self.dofs] = reactions[: len(self.dofs)]
        at = layout.dof(lumped.nodes.local[node - lumped.nodes.mine.start], component)
        out[at] = reactions[len(self.dofs) :]
        return out


__all__ = ["PrescribedMotion"]
