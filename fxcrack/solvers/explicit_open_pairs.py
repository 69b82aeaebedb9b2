"""The open pairs of all interfaces in explicit dynamics: overlaps, and the forces between faces.

Most increments need little of this: only where a pair would overlap at the end of an increment, or
bonds fade with time, are all open pairs looked at (:meth:`OpenPairs.forces`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.lumped_rows import jumps_along
from fxcrack.interface.pair import Pair
from fxcrack.solvers.explicit_acting import ActingForces
from fxcrack.solvers.explicit_bonds import Fading
from fxcrack.solvers.explicit_faces import (
    SWEEPS,
    FaceForces,
    OpenFaces,
    find_forces,
    total_forces,
    without_gain,
)
from fxcrack.solvers.explicit_separate import SeparateRows
from fxcrack.solvers.explicit_softening import LiveBonds


@dataclass(frozen=True)
class FreeMotion:
    """An increment of the open jumps without the forces between faces.

    Attributes:
        gap: Jumps at its start, shape (n_open, gdim), length.
        velocity: Their velocity in the middle of the increment before, same shape, length/time.
        free: Jumps at its end, same shape, length.
        h: Time from the last velocity to the next.
        dt: The increment.
    """

    gap: Array
    velocity: Array
    free: Array
    h: float
    dt: float

    @property
    def hh(self) -> float:
        """Factor dt h by which an acceleration changes the jumps at the end."""
        return self.dt * self.h


class OpenPairs:
    """Forces between the faces of open pairs.

    Args:
        lumped: Masses and weights.
        pairs: Interfaces.

    Attributes:
        penalty: Stiffness of contact over m/dt^2 of the pair; ``None``: by multipliers.
    """

    def __init__(self, lumped: LumpedInterface, pairs: Sequence[Pair]) -> None:
        self._lumped = lumped
        self.penalty: float | None = None
        self._touches = np.zeros(lumped.n_rows, dtype=bool)
        self._friction = np.zeros(lumped.n_rows)
        for pair, rows in zip(pairs, lumped.row_of, strict=True):
            has = rows >= 0
            self._touches[rows[has]] = pair.interface.contact
            if pair.friction is not None:
                self._friction[rows[has]] = pair.friction[has]
        self._warned_of_sweeps = False

    def renew(self, springs: Bools) -> None:
        """Take ties, masses and frames of the rows, which have changed.

        Args:
            springs: Rows that a bond with a stiffness of its own holds, shape (n_rows,).
        """
        lumped = self._lumped
        rows = lumped.open
        self._normal = lumped.frames[rows][:, :, 0]
        self._compliance = np.einsum("nc,nc->n", lumped.compliance, self._normal**2)
        scale = self._compliance.max(initial=0.0)
        # prescribed on all sides along the normal: no force could keep such a pair apart
        may_touch = self._touches[rows] & (self._compliance > 1e-12 * scale)
        may_touch &= ~springs[rows] & lumped.paired[rows]
        self._may_touch = np.flatnonzero(may_touch)
        self._closing = jumps_along(lumped, rows[self._may_touch], self._normal[self._may_touch])
        self._has_gap = bool(np.any(lumped.gap[rows]))
        self._closing_gap = lumped.gap[rows[self._may_touch]]
        self._gaps = np.zeros(len(self._may_touch))
        self._faces = OpenFaces(
            self._normal, lumped.gap[rows] if self._has_gap else None, self._may_touch,
            self._friction[rows], lumped.compliance, lumped.reach, lumped.response, lumped.separate,
        )  # fmt: skip
        self._separate = SeparateRows.of(self._faces)
        self._last_found: FaceForces | None = None

    def overlap(self, x: Array) -> bool:
        """Whether a pair in contact would overlap at a displacement, shape (n_nodes gdim,)."""
        if not len(self._may_touch):
            return False
        gaps = self._closing.into(x, self._gaps)
        if self._has_gap:
            gaps += self._closing_gap
        return bool(gaps.min() < 0.0)

    def smallest_gap(self, rows: Bools, jumps: Array) -> tuple[float, int]:
        """Smallest normal gap among some rows, and the row; 0 and -1 where none is open.

        Args:
            rows: Shape (n_rows,).
            jumps: Of the open rows, shape (n_open, gdim), length.
        """
        chosen = np.flatnonzero(rows[self._lumped.open])
        if not len(chosen):
            return 0.0, -1
        gaps = self._faces.normal_gaps(jumps)[chosen]
        i = int(np.argmin(gaps))
        return float(gaps[i]), int(self._lumped.open[chosen[i]])

    def forces(
        self, live: LiveBonds, fading: Sequence[Fading], place: Ints, motion: FreeMotion
    ) -> ActingForces:
        """All forces between the faces of open pairs in an increment.

        Args:
            live: Bonds that soften.
            fading: Bond forces that fall with time.
            place: Place of each row among the open ones, shape (n_rows,).
            motion: The increment without these forces.
        """
        acting = ActingForces()
        given = _fading_forces(acting, fading, place, motion)
        if given is not None:
            free = motion.free + motion.hh * self._lumped.response(given)
            motion = replace(motion, free=free)
        soft = place[live.rows]
        if self.penalty is None:
            found = self._by_multipliers(acting, live, soft, motion)
        else:
            found = self._by_penalty(acting, live, soft, motion)
        if given is not None:
            found = given if found is None else found + given
        acting.total = found
        return acting

    def _by_multipliers(
        self, acting: ActingForces, live: LiveBonds, soft: Ints, motion: FreeMotion
    ) -> Array | None:
        """Softening forces, exact contact and friction, (n_open, gdim); ``None``: there is none."""
        faces = self._faces
        if self._separate is not None:
            rows = replace(self._separate, faces=faces)
            found = rows.forces(live, soft, motion.gap, motion.free, motion.hh)
        else:
            found = find_forces(
                faces, live, soft, motion.gap, motion.free, motion.hh, self._last_found
            )  # fmt: skip
        if not faces.separate:
            self._last_found = found
        if not len(soft) and not len(found.touch):
            return None
        if not found.settled:
            self._calm(found, live, soft, motion)
        if len(soft):
            acting.softening = found.strength
        touch = found.touch
        if len(touch):
            acting.contact = touch, found.pressure[touch, None] * self._normal[touch]
            if faces.rough:
                acting.friction = touch, found.holding[touch]
        return total_forces(faces, live, soft, found.strength, found.pressure, found.holding)

    def _calm(self, found: FaceForces, live: LiveBonds, soft: Ints, motion: FreeMotion) -> None:
        """Take of forces that do not agree a part that adds no energy, and say so once."""
        faces = self._faces
        none = np.zeros_like(found.pressure)
        pulled = total_forces(faces, live, soft, found.strength, none, 0.0 * found.holding)
        after = (motion.free - motion.gap) / motion.dt + motion.h * faces.response(pulled)
        between = found.pressure[:, None] * faces.normal + found.holding
        part = without_gain(faces, between, motion.velocity, after, motion.h)
        found.pressure, found.holding = part * found.pressure, part * found.holding
        if not self._warned_of_sweeps:
            self._warned_of_sweeps = True
            log.warn(
                "explicit dynamics: forces between faces that touch did not settle in %d sweeps of "
                "an increment; of these forces the part is taken that adds no energy, %.3g",
                SWEEPS,
                part,
            )

    def _by_penalty(
        self, acting: ActingForces, live: LiveBonds, soft: Ints, motion: FreeMotion
    ) -> Array | None:
        """Softening forces, and contact by a stiffness on present overlaps."""
        assert self.penalty is not None
        faces, may = self._faces, self._may_touch
        self._faces = replace(faces, may_touch=may[:0])
        forces = self._by_multipliers(acting, live, soft, motion)
        self._faces = faces
        overlap = np.minimum(faces.normal_gaps(motion.gap)[may], 0.0)
        touch, overlap = may[overlap < 0.0], overlap[overlap < 0.0]
        if not len(touch):
            return forces
        stiffness = self.penalty / (motion.hh * self._compliance[touch])
        push = (stiffness * -overlap)[:, None] * self._normal[touch]
        acting.contact = touch, push
        out = np.zeros_like(motion.free) if forces is None else forces
        out[touch] += push
        return out


def _fading_forces(
    acting: ActingForces, fading: Sequence[Fading], place: Ints, motion: FreeMotion
) -> Array | None:
    """Forces of bonds that fall with time, shape (n_open, gdim); noted among those that act."""
    if not fading:
        return None
    at = np.concatenate([place[f.rows] for f in fading])
    force = np.concatenate([f.left(motion.dt) * f.force for f in fading])
    acting.fading = at, force
    out = np.zeros_like(motion.free)
    out[at] += force
    return out


__all__ = ["FreeMotion", "OpenPairs"]
