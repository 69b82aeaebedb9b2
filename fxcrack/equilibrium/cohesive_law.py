"""One bond that softens with its opening.

    F(w) = F0 (1 - w/w_f)            w the opening along F0, while it grows
    F(w) = F(w_max) w/w_max          when it decreases (secant), w_max never decreases

Nodes of a second-order element edge share one such law: F0 and w go over all of their components.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from fxcrack.base.arrays import Array, Ints

STIFFEST = 1e-7
"""The secant of a bond that unloads at once is that of this fraction of its final opening."""

NEUTRAL = 1e-8
"""A state counts as unstable if it were so with bonds that soften faster by this fraction. A bond
whose onset is found by exact crack closure is neutral there, up to round-off."""


class CohesiveUnit(NamedTuple):
    """Nodes that are to soften by one law.

    Attributes:
        nodes: Slave nodes, shape (n,).
        energy: What they dissipate together until they are free, force times length.
        pressed: Whether their faces are pressed together: mode I takes no part.
        area: Area that their release sweeps, length^2.
    """

    nodes: Ints
    energy: float
    pressed: bool
    area: float


@dataclass
class CohesiveBond:
    """One bond, or several by one law, that softens.

    Attributes:
        components: Its components among the retained jumps, shape (k,).
        direction: Unit vector of the opening w in them, shape (k,).
        strength: F0, force.
        final: w_f, length.
        where: Pair, and per component slave node and jump component, each of shape (k,), to find
            the bond again after a rebase.
        largest: w_max on the secant branch, ``None`` while the opening grows, length.
        fixed: Whether it stays on its secant whatever its opening: the elastic rest of an element
            through which the front has come in part, ``largest`` of ``final``.
    """

    components: Ints
    direction: Array
    strength: float
    final: float
    where: tuple[int, Ints, Ints]
    largest: float | None = None
    fixed: bool = False

    def opening(self, jump: Array) -> float:
        """Opening w at retained jumps of shape (n_retained,), length."""
        return float(self.direction @ jump[self.components])

    def force(self, opening: float) -> float:
        """Tensile force at an opening (length) on the present branch, force."""
        if self.fixed:
            return self.secant * opening
        if self.largest is None:
            return self._envelope(opening)
        return self._envelope(self.largest) + self.secant * (opening - self.largest)

    def _envelope(self, opening: float) -> float:
        return self.strength * (1.0 - opening / self.final)

    def taken(self, opening: float) -> float:
        """Energy the bond has taken up to an opening (length), the recoverable part included."""
        if self.fixed:
            return 0.5 * self.secant * opening**2
        most = opening if self.largest is None else self.largest
        back = most - opening
        given_back = back * (self._envelope(most) - 0.5 * self.secant * back)
        return self.strength * most * (1.0 - 0.5 * most / self.final) - given_back

    def remaining(self, opening: float) -> float:
        """Remaining part of the force at an opening (length)."""
        if self.fixed and self.largest is not None:
            return 1.0 - self.largest / self.final
        return self.force(opening) / self.strength

    @property
    def secant(self) -> float:
        """Stiffness of the secant branch, force/length."""
        w = max(self.largest or 0.0, STIFFEST * self.final)
        return self._envelope(w) / w
