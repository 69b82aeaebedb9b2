"""Whether bodies with inertia begin their motion held by nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.condensation.free_bodies import FreeBodies
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.front import Front
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports

_APART = 1e-9
"""Part of the length of a facet by which faces that do not touch are apart at least."""


def moves_freely(
    continuum: Continuum, supports: Supports, pairs: Sequence[Pair], fronts: Sequence[Front]
) -> bool:
    """Whether a body can move freely; collective.

    Faces that may touch hold a body where they do: it rests on them under its loads. Where some are
    apart, nothing holds it.

    Args:
        continuum: The bodies.
        supports: Prescribed components.
        pairs: Interfaces.
        fronts: Their fronts.
    """
    gdim = continuum.gdim
    bonded, touching, apart = [], [], False
    for pair, front in zip(pairs, fronts, strict=True):
        fixed = np.zeros((pair.surface.n_nodes, gdim), dtype=bool)
        fixed[front.bonded & pair.paired, : 1 if pair.interface.normal_only else gdim] = True
        held = fixed.copy()
        if pair.interface.contact:
            faces = ~front.bonded & pair.can_touch
            held[faces, : gdim if pair.friction is not None else 1] = True
            apart |= bool(np.any(pair.gap[faces] > _APART * pair.surface.facet_size))
        bonded.append(fixed)
        touching.append(held)
    none = [np.full(fixed.shape, -1, dtype=np.int64) for fixed in bonded]
    frames = [pair.frames for pair in pairs]
    for constraints in (touching, bonded) if apart else (touching,):
        bodies = FreeBodies(continuum, supports, pairs, constraints, none, frames)
        if bodies.find():
            return True
    return False


__all__ = ["moves_freely"]
