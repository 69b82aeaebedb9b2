"""Bonds of explicit dynamics whose force falls: with their opening, or with time alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints

_SPENT = 1e-12
"""Bonds of which less than this fraction of the force is left are free."""


@dataclass(frozen=True)
class Fading:
    """A bond force that falls with time alone: over increments, or with a viscosity.

    Attributes:
        rows: Rows of the interface, shape (n,).
        force: Force on the slaves at debonding, shape (n, gdim), force.
        increments: Increments until nothing is left; 0 where a viscosity decides.
        viscosity: mu: what is left is multiplied by mu/(mu + dt) in each increment, time.
        age: Increments since debonding.
    """

    rows: Ints
    force: Array
    increments: int
    viscosity: float
    age: int = 0

    def left(self, dt: float) -> float:
        """Fraction of the force that is left one increment of a length later."""
        age = self.age + 1
        if self.increments:
            return 1.0 - age / self.increments
        return (self.viscosity / (self.viscosity + dt)) ** age


@dataclass
class SofteningBonds:
    """Laws of the bonds that soften, one entry for each row of the interface.

    Attributes:
        active: Whether the bond still softens, shape (n_rows,).
        strength: F0, force.
        final: w_f, length.
        low: Opening in the middle of the last increment, length.
        top: Largest one so far, length.
        origin: Jump along the direction from which openings count, length: that at debonding of a
            bond with a stiffness of its own, else 0.
        direction: Direction of the opening, shape (n_rows, gdim).
        spent: Energy the bond has taken, force times length.
        area: Area that its release sweeps, length^2; 0 before.
        freed: Whether the bond has softened and is free, shape (n_rows,).
    """

    active: Bools
    strength: Array
    final: Array
    low: Array
    top: Array
    origin: Array
    direction: Array
    spent: Array
    area: Array
    freed: Bools

    @classmethod
    def none(cls, n: int, gdim: int) -> SofteningBonds:
        """No bond of n rows softens."""
        return cls(
            active=np.zeros(n, dtype=bool),
            strength=np.zeros(n),
            final=np.zeros(n),
            low=np.zeros(n),
            top=np.zeros(n),
            origin=np.zeros(n),
            direction=np.zeros((n, gdim)),
            spent=np.zeros(n),
            area=np.zeros(n),
            freed=np.zeros(n, dtype=bool),
        )

    def remaining(self, rows: Ints) -> Array:
        """Fraction of the force at debonding that is left at some rows, shape (n,)."""
        top, one = self.top[rows], np.ones(len(rows))
        back = np.divide(self.low[rows], top, out=one, where=top > 0.0)
        return np.asarray((1.0 - top / self.final[rows]) * np.clip(back, 0.0, 1.0))


def older(fading: list[Fading], dt: float) -> list[Fading]:
    """Fading bonds one increment later, without those that have ended."""
    return [replace(f, age=f.age + 1) for f in fading if f.left(dt) > _SPENT]


__all__ = ["Fading", "SofteningBonds", "older"]
