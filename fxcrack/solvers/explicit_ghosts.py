"""Displacements of ghost nodes in explicit dynamics, sent while the rest is computed."""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.halo import NodeUpdate
from fxcrack.continuum.continuum import Continuum


class GhostMotion:
    """Displacements at the end of an increment, for the ranks that have them as ghosts.

    Args:
        continuum: Displacement space.
        u: Displacement of the bodies.
        at_interface: Owned dofs of interface nodes, whose displacement is known before.

    Attributes:
        dofs: Owned dofs that other ranks need, shape (n_sent,).
    """

    def __init__(self, continuum: Continuum, u: fem.Function, at_interface: Ints) -> None:
        index_map, comm = continuum.space.dofmap.index_map, continuum.comm
        self._n, self._u, self._width = continuum.n_local, u.x.array, continuum.layout.n_unknowns
        self.dofs: Ints = np.zeros(0, dtype=np.int64)
        self._update: NodeUpdate | None = None
        if comm.size == 1:
            return
        sizes = comm.allgather(int(index_map.size_local))
        ranges = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self._update = NodeUpdate(comm, ranges, np.asarray(index_map.ghosts), self._width)
        rows = self._update.rows
        self._sent = (self._width * rows[:, None] + np.arange(self._width)).ravel()
        self.dofs = np.unique(self._sent)
        # those of them at interfaces, by their places among what is sent and among the latter
        place = np.full(self._n, -1, dtype=np.int64)
        place[at_interface] = np.arange(len(at_interface))
        self._known = np.flatnonzero(place[self._sent] >= 0)
        self._known_from = place[self._sent[self._known]]

    def start(self, velocity: Array, dt: float, at_interface: Array) -> None:
        """Send the displacement at the end of the increment; :meth:`finish` must follow.

        Args:
            velocity: Of the owned dofs, up to date at :attr:`dofs`, shape (n_local,).
            dt: The increment.
            at_interface: Displacement of the interface nodes there, shape (n_nodes, gdim).
        """
        if self._update is None:
            return
        values = self._update.values.reshape(-1)
        np.take(velocity, self._sent, out=values)
        values *= dt
        values += self._u[self._sent]
        values[self._known] = at_interface.ravel()[self._known_from]
        self._update.start()

    def finish(self) -> None:
        """Take the displacements of the ghosts; the owned ones are at the end by now."""
        if self._update is None:
            return
        # to the last digit the same as on the ranks that have them as ghosts
        self._u[self._sent] = self._update.values.reshape(-1)
        self._update.finish(self._u[self._n :].reshape(-1, self._width))


__all__ = ["GhostMotion"]
