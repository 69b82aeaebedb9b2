"""What a law of fatigue growth is given: energy release rates of one stabilised cycle at a front.

Where loads reverse or faces close, G falls to zero within the cycle and G_min = 0, so that
R = sqrt(G_min/G_max) is the load ratio for 0 <= R < 1 and zero for negative load ratios.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints


@dataclass(frozen=True, eq=False)
class CycleRates:
    """One stabilised cycle at some front nodes; single numbers stand for all nodes.

    Attributes:
        dG: Range of the total rate, G_max - G_min, shape (n,) [force/length].
        G_max: Its largest value, shape (n,) [force/length].
        G_c: Critical total rate at the mode mix of G_max, shape (n,) [force/length].
        shear: Share of modes II and III in G_max, between 0 and 1, shape (n,).
        tear: Share of mode III in modes II and III, between 0 and 1, shape (n,).
    """

    dG: Array
    G_max: Array
    G_c: Array
    shear: Array = 0.0  # type: ignore[assignment]  # made an array below
    tear: Array = 0.0  # type: ignore[assignment]

    def __post_init__(self) -> None:
        """Bring all values to one shape."""
        names = [f.name for f in fields(self)]
        given = [np.asarray(getattr(self, name), dtype=np.float64) for name in names]
        for name, value in zip(names, np.broadcast_arrays(*given), strict=True):
            object.__setattr__(self, name, value)

    @property
    def G_min(self) -> Array:
        """Smallest total rate of the cycle, shape (n,) [force/length]."""
        return np.maximum(self.G_max - self.dG, 0.0)

    @property
    def R(self) -> Array:
        """sqrt(G_min/G_max), the load ratio if that is not negative, shape (n,); else 0."""
        none = np.zeros(self.G_max.shape)
        part = np.divide(self.G_min, self.G_max, out=none, where=self.G_max > 0.0)
        return np.asarray(np.sqrt(part))

    @property
    def modes(self) -> Array:
        """G_I, G_II, G_III at G_max, shape (n, 3) [force/length]."""
        shear = self.shear * self.G_max
        return np.stack([self.G_max - shear, shear * (1.0 - self.tear), shear * self.tear], axis=-1)

    def rows(self, rows: Ints) -> CycleRates:
        """Values of some front nodes, in the given order."""
        return CycleRates(*(getattr(self, f.name)[rows] for f in fields(self)))

    def at(self, other: CycleRates, x: npt.ArrayLike) -> CycleRates:
        """Values on the way to others: rates log-linear, shares of modes linear.

        Args:
            other: Values at x = 1.
            x: Part of the way, of a shape that fits (n,); may lie outside 0 to 1.
        """
        x = np.asarray(x, dtype=np.float64)
        pairs = ((getattr(self, k), getattr(other, k)) for k in ("dG", "G_max", "G_c"))
        shares = (
            np.clip((1.0 - x) * getattr(self, k) + x * getattr(other, k), 0.0, 1.0)
            for k in ("shear", "tear")
        )
        return CycleRates(*(_log_linear(a, b, x) for a, b in pairs), *shares)


def joined(parts: Sequence[CycleRates]) -> CycleRates:
    """Values of several groups of front nodes, one after the other."""
    return CycleRates(
        *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(CycleRates))
    )


def _log_linear(a: Array, b: Array, x: Array) -> Array:
    """a^(1 - x) b^x; where one of them is zero, linear and not negative."""
    good = (a > 0.0) & (b > 0.0)
    one, two = np.where(good, a, 1.0), np.where(good, b, 1.0)
    straight = np.maximum((1.0 - x) * a + x * b, 0.0)
    return np.where(good, np.exp((1.0 - x) * np.log(one) + x * np.log(two)), straight)
