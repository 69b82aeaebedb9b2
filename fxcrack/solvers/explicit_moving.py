"""Interfaces of bodies that move far, in explicit dynamics: fronts and faces follow."""

from __future__ import annotations

from collections.abc import Sequence

from fxcrack.base.arrays import Ints
from fxcrack.interface.front import Front
from fxcrack.interface.pair import Pair
from fxcrack.interface.pairing import local_frames
from fxcrack.solvers.explicit_interface import InterfaceDynamics


class MovingInterfaces:
    """Front geometry and contact normals where the bodies are now.

    Args:
        dynamics: Motion of the interfaces.
        pairs: Interfaces.
        fronts: Their fronts.
    """

    def __init__(
        self, dynamics: InterfaceDynamics, pairs: Sequence[Pair], fronts: Sequence[Front]
    ) -> None:
        self._dynamics, self._pairs, self._fronts = dynamics, pairs, fronts
        self._row_of: Sequence[Ints] = dynamics.lumped.row_of

    def follow(self) -> None:
        """Take front geometry and contact normals from the present displacement."""
        dynamics, lumped = self._dynamics, self._dynamics.lumped
        gdim = lumped.frames.shape[-1]
        for pair, front, rows in zip(self._pairs, self._fronts, self._row_of, strict=True):
            x = pair.surface.x.copy()
            has = rows >= 0
            x[has, :gdim] += dynamics.u[lumped.slave[rows[has]]]
            front.follow(x)
            frames = local_frames(-front.surface.normals, gdim)
            lumped.frames[rows[has]] = frames[has]
        lumped.version += 1
        dynamics.set_frames()


__all__ = ["MovingInterfaces"]
