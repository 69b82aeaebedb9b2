"""What a law of fatigue growth says, and what laws share: regimes, onset, powers.

A law gives the cycles until growth starts, the growth per cycle, and the regime of each front node:

    no growth                    G_max <= r1 G_c
    growth by the law            r1 G_c < G_max < r2 G_c
    the element in one cycle     G_max >= r2 G_c

r1 and r2 may depend on the mode mix (:mod:`fxcrack.criteria.mix_curve`).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import finite, keep, keep_floats, not_negative
from fxcrack.base.errors import InputError
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.mix_curve import MixCurve, mix_curve, value_at


class Regime(IntEnum):
    """Where the largest rate of the cycle lies between threshold and upper limit."""

    NONE = 0
    PARIS = 1
    UNSTABLE = 2


class FatigueLaw(Protocol):
    """What every law of fatigue growth can do."""

    def life_exponent(self, toughness: float) -> float:
        """Largest power of G with which growth per cycle rises, for estimates of errors.

        Args:
            toughness: Mode I toughness [force/length]: a law that is no power of G is judged
                below it.
        """
        ...

    def onset(self, cycle: CycleRates) -> Array:
        """Cycles until growth starts, shape (n,), zero or larger, may be inf."""
        ...

    def growth(self, cycle: CycleRates) -> Array:
        """Growth da/dN in the regime of growth, shape (n,) [length per cycle]."""
        ...

    def regimes(self, cycle: CycleRates) -> Ints:
        """Regime of each front node, shape (n,), values of :class:`Regime`."""
        ...


UserFunction = Callable[[CycleRates], npt.ArrayLike]
"""da/dN, shape (n,) [length per cycle], of a cycle at n front nodes."""


def keep_onset_and_limits(law: Any) -> None:
    """Check and keep the constants c1, c2, r1 and r2 of a law while it is being made.

    Raises:
        InputError: One is wrong, or the threshold is not below the upper limit at every mode mix.
    """
    owner = type(law).__name__
    not_negative(owner, c1=law.c1)
    finite(owner, c2=law.c2)
    keep_floats(law, "c1", "c2")
    keep(law, **{name: mix_curve(owner, name, getattr(law, name)) for name in ("r1", "r2")})
    b = np.linspace(0.0, 1.0, 101)
    low, high = value_at(owner, "r1", law.r1, b), value_at(owner, "r2", law.r2, b)
    wrong = np.flatnonzero(low >= high)
    if wrong.size:
        i = int(wrong[0])
        varies = not (isinstance(law.r1, float) and isinstance(law.r2, float))
        where = f" at a share of shear of {b[i]:g}" if varies else ""
        raise InputError(
            f"{owner}: threshold r1 = {low[i]:g} must be below the upper limit r2 = {high[i]:g}"
            f"{where}"
        )


def regimes_between(owner: str, r1: MixCurve, r2: MixCurve, cycle: CycleRates) -> Ints:
    """Regimes of a law with threshold r1 and upper limit r2, both over G_c, shape (n,)."""
    low, high = (
        value_at(owner, name, curve, cycle.shear) * cycle.G_c
        for name, curve in (("r1", r1), ("r2", r2))
    )
    return np.where(
        cycle.G_max >= high,
        int(Regime.UNSTABLE),
        np.where(cycle.G_max > low, int(Regime.PARIS), int(Regime.NONE)),
    )


def times_power(factor: npt.ArrayLike, base: npt.ArrayLike, exponent: npt.ArrayLike) -> Array:
    """``factor * base**exponent`` in logarithms, so that no part of it overflows.

    A factor of zero, or an exponent of zero, gives the factor whatever the base.
    """
    c, b, m = np.broadcast_arrays(
        *(np.asarray(v, dtype=np.float64) for v in (factor, base, exponent))
    )
    plain = (c == 0.0) | (m == 0.0)
    with np.errstate(divide="ignore", over="ignore", under="ignore", invalid="ignore"):
        out = np.exp(np.log(np.where(plain, 1.0, c)) + m * np.log(b))
    return np.where(plain, c, out)
