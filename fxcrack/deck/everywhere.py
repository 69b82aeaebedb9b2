"""A mark that is the same at all nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array


@dataclass(frozen=True)
class Everywhere:
    """Marks all nodes or none.

    Attributes:
        value: Whether all of them.
    """

    value: bool

    def __call__(self, x: Array) -> Array:
        """One truth value per position; x of shape (3, n)."""
        return np.full(np.shape(x)[1], self.value)


__all__ = ["Everywhere"]
