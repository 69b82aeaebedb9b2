"""Unknowns of the nodes of shells: displacement u and change w of the director.

The point of a face at the distance z from the reference surface moves by u + z w.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.arrays import Array
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.continuum.face import Face


class ShellLayout(DofLayout):
    """Dof layout of shells.

    Args:
        comm: Communicator that objects may be sent on.
        directors: Directors of the local nodes, owned first, shape (n_local_nodes, 3).
        n_owned: Nodes that this rank owns.
        height: Coordinate z of a face, length.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        directors: Array,
        n_owned: int,
        height: Callable[[Face], float],
    ) -> None:
        super().__init__(comm, 3, n_owned, 6)
        self.directors = directors
        self._height = height

    def point_maps(self, name: str | Face, nodes: npt.NDArray[np.integer]) -> Array | None:
        """P = [1, z 1] at nodes of a face, shape (..., 3, 6)."""
        if not isinstance(name, Face):
            return None
        one = np.eye(3)
        return np.broadcast_to(
            np.hstack([one, self._height(name) * one]), (*nodes.shape, 3, 6)
        ).copy()

    def rigid_motion(self, displacement: Array, rotation: Array) -> Array:
        """Unknowns of the owned nodes in a small rigid motion, shape (n_local,)."""
        turn = np.cross(rotation, self.directors[: self.n_owned])
        return np.hstack([displacement, turn]).ravel()


__all__ = ["ShellLayout"]
