"""Interfaces of bodies that move: jumps in a displacement, fronts and pairs that follow it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Bools
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.face import Face
from fxcrack.interface.finite_sliding import changing, names_changing, renewed, with_changing
from fxcrack.interface.front import Front
from fxcrack.interface.jump_coordinates import JumpCoordinates
from fxcrack.interface.nodes import JumpGather
from fxcrack.interface.pair import Pair
from fxcrack.interface.rigid import RigidSurface
from fxcrack.interface.surface import FacetSurface, gather_surface


class DeformedInterfaces:
    """The interfaces as a displacement of the bodies has them.

    Args:
        continuum: Displacement space.
        pairs: Interfaces; replaced in this list where nodes are paired anew.
        fronts: Their fronts.
        finite: Whether the bodies turn and stretch by any amount, so that fronts and pairs follow.
    """

    def __init__(
        self, continuum: Continuum, pairs: list[Pair], fronts: list[Front], *, finite: bool
    ) -> None:
        self._pairs, self._fronts, self._finite = pairs, fronts, finite
        self._gdim = continuum.gdim
        # undeformed master surfaces of those whose pairing is renewed
        self._masters = [
            _master_of(continuum, p) if finite and p.interface.contact else None for p in pairs
        ]
        self._undeformed = [p.surface.x for p in pairs]
        known = [m for m in self._masters if isinstance(m, FacetSurface)]
        self._reader = JumpGather(continuum.layout, pairs, known)

    @property
    def follow_sliding(self) -> bool:
        """Whether open nodes are paired anew where faces slide."""
        return any(m is not None for m in self._masters)

    def jumps(self, u: PETSc.Vec, coordinates: JumpCoordinates) -> Array:
        """Retained jumps in a displacement, shape (n_retained,), length; collective."""
        values = self._reader.gather(u.array_r)
        out = np.zeros(coordinates.n_retained)
        for pair, frames, index in zip(
            self._pairs, coordinates.frames, coordinates.index, strict=True
        ):
            inside = index >= 0
            out[index[inside]] = self._reader.jumps(values, pair, frames)[inside]
        return out

    def move_fronts(self, u: PETSc.Vec) -> None:
        """Take normals and lengths at the fronts from a displacement; collective."""
        if not self._finite:
            return
        values = self._reader.gather(u.array_r)
        for pair, front, x in zip(self._pairs, self._fronts, self._undeformed, strict=True):
            moved = x.copy()
            moved[:, : self._gdim] += self._reader.displacements(values, pair.surface)
            front.follow(moved)

    def pair_anew(self, u: PETSc.Vec, pulling: list[Bools], pressed: list[Bools]) -> bool:
        """Pair open nodes with the master surface where it is now; whether any changed.

        Collective.

        Args:
            u: Displacement, owned dofs.
            pulling: Per pair, nodes whose bonds are released but still carry a force: it acts on
                the master point they were bonded to, shape (n_nodes,).
            pressed: Per pair, nodes in contact, shape (n_nodes,).
        """
        if not self.follow_sliding:
            return False
        values = self._reader.gather(u.array_r)
        changed = False
        for p, master in enumerate(self._masters):
            if master is None:
                continue
            pair = self._pairs[p]
            new = renewed(
                pair,
                self._fronts[p].bonded | pulling[p],
                master,
                self._reader.displacements(values, pair.surface),
                self._reader.displacements(values, master)
                if isinstance(master, FacetSurface)
                else np.zeros((0, self._gdim)),
                pressed=pressed[p],
            )
            if new is not None:
                self._pairs[p], changed = new, True
        return changed

    def pairing(self) -> list[dict[str, npt.NDArray[Any]]]:
        """What renewed pairings have changed, per pair; the same on any number of ranks.

        Returns:
            Arrays by name, those of :class:`~fxcrack.interface.pair.Pair` and of their shapes:
            paired and gap, shape (n_nodes,), masters (nodes of the master surface) and weights,
            shape (n_nodes, k), frames, shape (n_nodes, gdim, gdim).
        """
        return [
            {} if master is None else changing(pair, master)
            for pair, master in zip(self._pairs, self._masters, strict=True)
        ]

    def restore_pairing(self, arrays: Mapping[str, npt.NDArray[Any]], key: str) -> None:
        """Take over pairings from :meth:`pairing`.

        Args:
            arrays: Its values by ``key.format(name, p)``, of the same shapes.
            key: Format of their names.
        """
        for p, master in enumerate(self._masters):
            if master is not None:
                known = {name: arrays[key.format(name, p)] for name in names_changing(master)}
                self._pairs[p] = with_changing(self._pairs[p], master, known)


def _master_of(continuum: Continuum, pair: Pair) -> FacetSurface | RigidSurface:
    """Undeformed master surface of a pair; collective."""
    master = pair.sides[1]
    if isinstance(master, str | Face):
        return gather_surface(continuum, master)
    return master


__all__ = ["DeformedInterfaces"]
