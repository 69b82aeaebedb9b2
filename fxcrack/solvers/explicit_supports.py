"""Prescribed motion of dofs in explicit dynamics, and its reactions.

    v^{n+1/2} = (u_D^{n+1} - u^n)/dt,    R = m (v^{n+1/2} - v^{n-1/2})/h - f

At interface nodes m and f are those of the node with the slaves tied to it; what is tied itself
shows no reaction of its own.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.sparse import Product
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.supports import Supports
from fxcrack.solvers.explicit_interface import InterfaceDynamics


class PrescribedMotion:
    """The prescribed dofs of this rank: those within the bodies, at interfaces, of references.

    Args:
        supports: Prescribed components.
        lumped: Interfaces.
        at_interface: Owned dofs of interface nodes, shape (n,).

    Attributes:
        dofs: Those within the bodies, shape (n_dofs,).
        columns: Support column of all of them, shape (n_prescribed,).
        values: Entry of the column, shape (n_prescribed,).
        holds_nodes: Whether any of them are at interfaces, or of references.
    """

    def __init__(self, supports: Supports, lumped: LumpedInterface, at_interface: Ints) -> None:
        inside = supports.which >= 0
        inside[at_interface] = False
        self.dofs = np.flatnonzero(inside)
        self._column, self._value = supports.which[self.dofs], supports.value[self.dofs]
        mine = np.zeros((len(lumped.nodes), 1), dtype=bool)
        mine[lumped.nodes.mine] = True
        self._nodes = np.nonzero((lumped.which >= 0) & mine)
        self._gives: Product | None = None
        # references belong to no rank; the first one counts their work
        self._n_motions = lumped.n_motions if lumped.nodes.layout.comm.rank == 0 else 0
        self.holds_nodes = bool(len(self._nodes[0]) or self._n_motions)
        motions = len(supports.columns) - lumped.n_motions + np.arange(self._n_motions)
        columns = [self._column, lumped.which[self._nodes], motions]
        self.columns = np.concatenate(columns).astype(np.int64)
        if lumped.constraints is not None:
            at = lumped.which.shape[1] * self._nodes[0] + self._nodes[1]
            given = lumped.given_motion(at)[:, : len(at) + self._n_motions]
            self._gives = Product(given.T)
        ones = np.ones(self._n_motions)
        self.values = np.concatenate([self._value, lumped.value[self._nodes], ones])

    def velocities(self, u: Array, coordinates: Array, dt: float) -> Array:
        """Velocities of :attr:`dofs` that lead to the prescribed displacement, shape (n_dofs,).

        Args:
            u: Displacement of the owned dofs, shape (n_local,).
            coordinates: Of the support columns at the end, shape (n_columns,).
            dt: The increment.
        """
        return np.asarray((self._value * coordinates[self._column] - u[self.dofs]) / dt)

    def velocity(self, owned: Array, dynamics: InterfaceDynamics) -> Array:
        """The velocity at all prescribed dofs, shape (n_prescribed,), length/time.

        Args:
            owned: Of the owned dofs, shape (n_local,).
            dynamics: Motion of the interface nodes and of references.
        """
        within = owned[self.dofs]
        if not self.holds_nodes:
            return within
        motions = dynamics.references[1, : self._n_motions]
        return np.concatenate([within, dynamics.v[self._nodes], motions])

    def at_nodes(self, lumped: LumpedInterface, dynamics: InterfaceDynamics) -> Array:
        """Reactions at interface nodes and references, shape (n_prescribed - n_dofs,), force."""
        node = self._nodes[0]
        if self._gives is not None:
            wanted = lumped.group_mass[:, None] * dynamics.a - dynamics.total
            wanted[lumped.slave[lumped.tied & ~lumped.rigid]] = 0.0
            return self._gives(wanted.ravel())
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
