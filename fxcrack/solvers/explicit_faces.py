"""Contact, friction and softening of open pairs over one increment of explicit dynamics, together.

With H the acceleration of the jumps by forces on them, the jumps end at d = d* + dt h H F. Each row
asks of its own force

    contact     p >= 0,  gap(d) >= 0,  p gap(d) = 0
    friction    the tangential force that keeps the pair from sliding, at most mu p
    softening   the discrete gradient of its law

Where every slave has one master of its own, H is diagonal and a row is solved alone. Otherwise rows
share masters, and all of them are solved in sweeps: a row moves its force as if its compliance were
the sum of |H_ij| over its row, which no combination of rows exceeds (Gershgorin). That is a
projected gradient step which never overshoots, whatever meshes and densities are; it is
accelerated by what the last sweep changed (Beck and Teboulle, SIAM J. Imaging Sci. 2, 2009), and
begins anew where that turns against the descent (O'Donoghue and Candes, Found. Comput. Math. 15,
2015).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.solvers.explicit_softening import LiveBonds, settled

SWEEPS = 1000
"""Sweeps, at most. They go with the root of the ratio of densities: 50 for 5, 190 for 32."""
_SECANTS = 40
"""Sweeps in which separate rows take secants, which need ten at most where they converge."""


@dataclass(frozen=True)
class OpenFaces:
    """Open rows as contact and friction see them.

    Attributes:
        normal: Normals, shape (n_open, gdim).
        gap: Initial normal gaps, shape (n_open,), length; ``None``: there are none.
        may_touch: Open rows that contact keeps apart, shape (m,).
        mu: Coefficients of friction, shape (n_open,).
        compliance: H of each row on itself per component, shape (n_open, gdim).
        reach: Bound of H per component: the compliance where rows do not act on each other, else
            the sum of |H_ij| over the row, shape (n_open, gdim).
        response: Accelerations of the jumps by forces on all of them, shape (n_open, gdim) each.
        separate: Whether rows do not act on each other.
    """

    normal: Array
    gap: Array | None
    may_touch: Ints
    mu: Array
    compliance: Array
    reach: Array
    response: Callable[[Array], Array]
    separate: bool
    _along: Array = field(init=False, repr=False)
    _across: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Take the bounds along the normals and across them."""
        object.__setattr__(self, "_along", np.einsum("nc,nc->n", self.reach, self.normal**2))
        # masses that differ by component: the lightest one decides
        object.__setattr__(self, "_across", self.reach.max(axis=1, initial=0.0))

    @property
    def rough(self) -> bool:
        """Whether there is friction anywhere."""
        return bool(self.mu.any())

    def normal_gaps(self, jumps: Array) -> Array:
        """Normal gaps of jumps, shape (n_open, gdim), as shape (n_open,), length."""
        gaps = (jumps * self.normal).sum(axis=1)
        return np.asarray(gaps if self.gap is None else gaps + self.gap)

    def pressures(self, jumps: Array, pressure: Array, hh: float) -> tuple[Array, Ints]:
        """Contact forces for which touching pairs end at zero distance, and where there are any.

        Args:
            jumps: At the end of the increment with the present forces, shape (n_open, gdim).
            pressure: Those forces, shape (n_open,), force.
            hh: dt h.

        Returns:
            Pressures, shape (n_open,), and rows, shape (m,).
        """
        may, out = self.may_touch, np.zeros(len(pressure))
        gaps = self.normal_gaps(jumps)[may]
        new = np.maximum(pressure[may] - gaps / (hh * self._along[may]), 0.0)
        out[may] = new
        return out, may[new > 0.0]

    def sticking(
        self, moved: Array, before: Array, touch: Ints, pressure: Array, hh: float
    ) -> Array:
        """Friction of the touching pairs, shape (n_open, gdim), force.

        Args:
            moved: Change of the jumps over the increment with the present forces, those of friction
                among them, shape (n_open, gdim), length.
            before: The present forces of friction, same shape.
            touch: Rows that touch, shape (m,).
            pressure: Of all open rows, shape (n_open,), force.
            hh: dt h.
        """
        out = np.zeros_like(moved)
        rough = touch[self.mu[touch] > 0.0]
        if not len(rough):
            return out
        moved, n = moved[rough], self.normal[rough]
        slide = moved - (moved * n).sum(axis=1)[:, None] * n
        holding = before[rough] - slide / (hh * self._across[rough])[:, None]
        size = np.linalg.norm(holding, axis=1)
        limit = self.mu[rough] * pressure[rough]
        holding *= np.divide(limit, size, out=np.ones_like(size), where=size > limit)[:, None]
        out[rough] = holding
        return out


@dataclass
class FaceForces:
    """Forces of the open rows in an increment.

    Attributes:
        strength: Of the softening bonds, tension positive, shape (n_soft,).
        pressure: Of contact, shape (n_open,).
        holding: Of friction, shape (n_open, gdim).
        touch: Rows with a pressure, shape (m,).
        settled: Whether they agree with each other.
    """

    strength: Array
    pressure: Array
    holding: Array
    touch: Ints
    settled: bool = True


def find_forces(
    faces: OpenFaces, live: LiveBonds, soft: Ints, gap: Array, free: Array, hh: float,
    start: FaceForces | None = None,
) -> FaceForces:  # fmt: skip
    """Forces of all open rows over an increment.

    Args:
        faces: The rows.
        live: Bonds that soften.
        soft: Their places among the open rows, shape (n_soft,).
        gap: Jumps at the start, shape (n_open, gdim), length.
        free: Jumps at the end without these forces, same shape.
        hh: dt h.
        start: Forces to begin with, those of the last increment, where ties are the same.
    """
    here = (gap[soft] * live.direction).sum(axis=1) - live.origin
    last = FaceForces(
        np.zeros(len(soft)), np.zeros(len(free)), np.zeros_like(free), faces.may_touch[:0]
    )
    if start is not None:
        last.pressure, last.holding = start.pressure, start.holding
    # the present forces, and those a sweep begins at, which acceleration puts ahead of them
    pressure, holding, gain = last.pressure, last.holding, 1.0
    before: tuple[Array, Array] | None = None
    for sweep in range(SWEEPS):
        there, first = free, not sweep and start is None
        if not first:
            there = free + hh * faces.response(pressure[:, None] * faces.normal + holding)
        strength, after = last.strength, there
        # where a bond and friction hold the same slip, friction goes first: the bond takes what is
        # left, while the other way round each would give way to the other little by little
        waits = first and faces.rough and len(soft) > 0
        if len(soft) and not waits:
            opening = (there[soft] * live.direction).sum(axis=1) - live.origin
            strength = live.together(here, opening, hh)
            pull = np.zeros_like(there)
            pull[soft] = -strength[:, None] * live.direction
            after = there + hh * faces.response(pull)
        new, touch = faces.pressures(after, pressure, hh)
        held = holding
        if faces.rough:
            moved = after + hh * faces.reach * ((new - pressure)[:, None] * faces.normal)
            held = faces.sticking(moved - gap, holding, touch, new, hh)
        found = FaceForces(strength, new, held, touch)
        if faces.separate and not waits and not (len(soft) and new[soft].any()):
            return found  # every pair moves by itself, and softens or touches
        if (
            not waits
            and not (first and len(touch))
            and settled(new, pressure)
            and settled(held, holding)
        ):
            return found
        if faces.separate and not faces.rough and sweep < _SECANTS:
            change = new - pressure
            ahead = _secant(before, (pressure, change))
            before, pressure = (pressure, change), ahead
        else:
            pressure, holding, gain = _ahead(last, found, pressure, holding, gain)
        last = found
    last.settled = False
    return last


def _secant(before: tuple[Array, Array] | None, now: tuple[Array, Array]) -> Array:
    """Where the changes of pressures of separate rows would be zero, by their last two values.

    A bond that has hardly opened is stiff: alone, each sweep would take a thousandth of the way.

    Args:
        before: Pressures of the sweep before the last and what it changed, shape (n_open,) each.
        now: Those of the last.
    """
    pressure, change = now
    factor = np.ones(len(change))
    if before is not None:
        way, less = pressure - before[0], before[1] - change
        some = (way * less > 0.0) & (np.abs(less) > 0.0)
        factor[some] = np.clip(way[some] / less[some], 1.0, 1e9)
    return np.asarray(np.maximum(pressure + factor * change, 0.0))


def _ahead(
    last: FaceForces, found: FaceForces, pressure: Array, holding: Array, gain: float
) -> tuple[Array, Array, float]:
    """Where the next sweep begins: ahead of what was found, in the direction of the last change."""
    more, more_held = found.pressure - last.pressure, found.holding - last.holding
    turned = (pressure - found.pressure) @ more + float(np.vdot(holding - found.holding, more_held))
    if turned > 0.0:
        return found.pressure, found.holding, 1.0
    later = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * gain**2))
    part = (gain - 1.0) / later
    return found.pressure + part * more, found.holding + part * more_held, later


def total_forces(
    faces: OpenFaces, live: LiveBonds, soft: Ints, strength: Array, pressure: Array, holding: Array
) -> Array:
    """Forces on the slave side of the open rows, shape (n_open, gdim)."""
    forces = pressure[:, None] * faces.normal + holding
    forces[soft] -= strength[:, None] * live.direction
    return forces


def without_gain(faces: OpenFaces, forces: Array, before: Array, after: Array, h: float) -> float:
    """Part of some forces, 0 to 1, that adds no energy to the bodies.

    Their work in the increment with the mean velocity is F . h (w + w* + h H F)/2.

    Args:
        faces: The rows.
        forces: F, shape (n_open, gdim).
        before: w, velocity of the jumps before the increment, same shape.
        after: w*, in its middle without the forces, same shape.
        h: Time between both.
    """
    given = float(np.vdot(forces, before + after))
    own = h * float(np.vdot(forces, faces.response(forces)))
    return float(np.clip(-given / own, 0.0, 1.0)) if own > 0.0 else 0.0


__all__ = ["SWEEPS", "FaceForces", "OpenFaces", "find_forces", "total_forces", "without_gain"]
