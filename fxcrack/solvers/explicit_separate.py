"""Contact, friction and softening of open pairs that move by themselves, over one increment.

Where every slave has one master of its own a force on a row moves no other row. With the strength s
of its bond given, contact and friction of a row follow at once: the pressure for which it just
touches, and the tangential force that keeps it from sliding, at most mu p. So one equation is left,

    G(s) - s = 0,    0 <= s <= F0

with G(s) the force of the bond's law (its discrete gradient) under the contact and friction that s
leaves. G lies between 0 and F0 and is continuous, so that there is a solution, which is found by
secants within its bracket: the number of steps is bounded, while sweeps in which bond and friction
give way to each other may take thousands where both hold the same slip. Where the law is vertical
(a bond that has not opened) and friction alone holds the pair, the bond takes no force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.solvers.explicit_faces import FaceForces, OpenFaces
from fxcrack.solvers.explicit_softening import LiveBonds

_STEPS = 200
"""Steps, at most; every fourth one halves the bracket."""
_EXACT = 1e-14
"""Width of the bracket, or the value, over F0 that ends the steps."""
_ALIKE = 1e-12
"""Part of the compliance by which components may differ."""


@dataclass(frozen=True)
class SeparateRows:
    """Open rows that move by themselves, normal and tangential forces apart.

    Attributes:
        faces: The rows.
        along: Compliance along the normals, shape (n_open,).
        across: Compliance across them, same shape.
    """

    faces: OpenFaces
    along: Array
    across: Array

    @classmethod
    def of(cls, faces: OpenFaces) -> SeparateRows | None:
        """The rows, or ``None`` where they act on each other, or normal and tangent do.

        The latter is so where supports hold components that are oblique to the interface.

        Args:
            faces: Open rows.
        """
        if not faces.separate:
            return None
        compliance, n = faces.compliance, faces.normal
        most = compliance.max(axis=1, initial=0.0)
        alike = most - compliance.min(axis=1, initial=np.inf) <= _ALIKE * most
        axis = np.abs(n).argmax(axis=1) if len(n) else np.zeros(0, dtype=np.int64)
        aligned = np.take_along_axis(np.abs(n), axis[:, None], axis=1)[:, 0] >= 1.0 - _ALIKE
        along = np.take_along_axis(compliance, axis[:, None], axis=1)[:, 0]
        others = compliance.copy()
        np.put_along_axis(others, axis[:, None], -np.inf, axis=1)
        across = others.max(axis=1, initial=-np.inf)
        np.put_along_axis(others, axis[:, None], np.inf, axis=1)
        least = others.min(axis=1, initial=np.inf)
        # of two tangential components a support may hold one, which then does not move
        even = (across - least <= _ALIKE * most) | (least <= _ALIKE * most)
        known = alike | (aligned & even)
        if not known[faces.may_touch].all():
            return None
        return cls(faces, np.where(alike, most, along), np.where(alike, most, across))

    def forces(self, live: LiveBonds, soft: Ints, gap: Array, free: Array, hh: float) -> FaceForces:
        """Forces of all rows over an increment.

        Args:
            live: Bonds that soften.
            soft: Their places among the rows, shape (n_soft,).
            gap: Jumps at the start, shape (n_open, gdim), length.
            free: Jumps at the end without these forces, same shape.
            hh: dt h.
        """
        none = np.zeros(len(soft))
        if not len(soft):
            return self._between(none, free, gap, hh)
        here = (gap[soft] * live.direction).sum(axis=1) - live.origin
        compliance = self.faces.compliance[soft]
        pull = hh * compliance * live.direction

        def excess(strength: Array) -> Array:
            """G(s) - s of the bonds, shape (n_soft,)."""
            jumps = free.copy()
            jumps[soft] -= strength[:, None] * pull
            found = self._between(none, jumps, gap, hh)
            held = found.pressure[soft, None] * self.faces.normal[soft] + found.holding[soft]
            without = ((free[soft] + hh * compliance * held) * live.direction).sum(axis=1)
            return np.asarray(live.alone(here, without - live.origin, hh) - strength)

        strength = _bracketed(excess, live.largest)
        jumps = free.copy()
        jumps[soft] -= strength[:, None] * pull
        return self._between(strength, jumps, gap, hh)

    def _between(self, strength: Array, jumps: Array, gap: Array, hh: float) -> FaceForces:
        """Contact and friction where jumps would end without them, shape (n_open, gdim)."""
        faces = self.faces
        pressure, holding = np.zeros(len(jumps)), np.zeros_like(jumps)
        may = faces.may_touch
        gaps = faces.normal_gaps(jumps)[may]
        pressure[may] = np.maximum(-gaps / (hh * self.along[may]), 0.0)
        touch = may[pressure[may] > 0.0]
        rough = touch[faces.mu[touch] > 0.0]
        if len(rough):
            moved, n = jumps[rough] - gap[rough], faces.normal[rough]
            slide = moved - (moved * n).sum(axis=1)[:, None] * n
            loose = self.across[rough] > 0.0
            force = np.zeros_like(slide)
            force[loose] = -slide[loose] / (hh * self.across[rough][loose, None])
            size, limit = np.linalg.norm(force, axis=1), faces.mu[rough] * pressure[rough]
            force *= np.divide(limit, size, out=np.ones_like(size), where=size > limit)[:, None]
            holding[rough] = force
        return FaceForces(strength, pressure, holding, touch)


def _bracketed(excess: Callable[[Array], Array], most: Array) -> Array:
    """Zeros of functions that are not below 0 at 0, nor above it at ``most``.

    By secants within the bracket, of which an end that stays counts half (the Illinois method,
    Dowell and Jarratt, BIT 11, 1971); every fourth step halves it.

    Args:
        excess: Takes arguments of shape (n,) and gives values, all at once.
        most: Upper ends, shape (n,).

    Returns:
        Shape (n,); 0 where the value there is none.
    """
    low, high = np.zeros_like(most), most.copy()
    at_low, at_high = excess(low), excess(high)
    exact = _EXACT * most
    out = np.where(at_low <= exact, low, high)
    done = (at_low <= exact) | (at_high >= -exact)
    side = np.zeros(len(most))
    for step in range(_STEPS):
        if done.all():
            break
        slope = at_low - at_high
        part = np.divide(at_low, slope, out=np.full_like(slope, 0.5), where=slope > 0.0)
        if step % 4 == 3:
            part = np.full_like(part, 0.5)
        middle = np.clip(low + part * (high - low), low, high)
        value = excess(np.where(done, out, middle))
        out = np.where(done, out, middle)
        above = value > 0.0
        # an end that stays for the second time counts half
        at_high = np.where(above, np.where(side > 0.0, 0.5 * at_high, at_high), value)
        at_low = np.where(above, value, np.where(side < 0.0, 0.5 * at_low, at_low))
        low, high = np.where(above, middle, low), np.where(above, high, middle)
        side = np.where(above, 1.0, -1.0)
        done = done | (np.abs(value) <= exact) | (high - low <= exact)
    return np.asarray(out)


__all__ = ["SeparateRows"]
