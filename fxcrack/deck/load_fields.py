"""Functions of position that loads of decks need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array


@dataclass(frozen=True)
class Hydrostatic:
    """A pressure linear in one coordinate.

    Attributes:
        factor: Its value at the full level.
        axis: The coordinate, 0, 1 or 2.
        zero: Where the pressure is 0, length.
        full: Where it has its value, length.
    """

    factor: float
    axis: int
    zero: float
    full: float

    def __call__(self, x: Array) -> Array:
        """Values at positions of shape (3, n)."""
        return np.asarray(self.factor * ((x[self.axis] - self.zero) / (self.full - self.zero)))


@dataclass(frozen=True)
class Centrifugal:
    """A component of the vector from an axis of rotation to a position, times a factor.

    Attributes:
        factor: Density times the square of the angular velocity.
        point: A point of the axis, length.
        direction: Its direction, a unit vector.
        component: 0, 1 or 2.
    """

    factor: float
    point: tuple[float, float, float]
    direction: tuple[float, float, float]
    component: int

    def __call__(self, x: Array) -> Array:
        """Values at positions of shape (3, n)."""
        away = x - np.array(self.point)[:, None]
        along = np.array(self.direction) @ away
        return np.asarray(
            self.factor * (away[self.component] - along * self.direction[self.component])
        )


__all__ = ["Centrifugal", "Hydrostatic"]
