"""Cycles in which a front passes an element: the law of growth integrated between both ends."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.fatigue_law import FatigueLaw, Regime


def element_cycles(
    law: FatigueLaw,
    begin: CycleRates,
    end: CycleRates,
    da: npt.ArrayLike,
    grown: npt.ArrayLike = 0.0,
) -> Array:
    """Cycles in which a front passes an element: the integral of da/(da/dN).

    Rates are log-linear between both ends of the element, shares of modes linear. Between points
    the growth rate is log-linear, too, so a power law at constant mode mix is integrated exactly.
    What lies beyond the upper limit takes no cycles.

    Args:
        law: Law of growth.
        begin: Values at the beginning of each element, n of them.
        end: Values at its end.
        da: Length of each element, shape (n,) or one number [length].
        grown: Length of it that is passed already, likewise.

    Returns:
        Shape (n,); inf where the front comes to the threshold within the element.
    """
    n = len(begin.dG)
    da = np.broadcast_to(np.asarray(da, dtype=np.float64), (n,))
    first = np.clip(np.broadcast_to(np.asarray(grown, dtype=np.float64), (n,)) / da, 0.0, 1.0)
    out = np.zeros(n)
    for i in range(n):
        here, there = begin.rows(np.array([i])), end.rows(np.array([i]))
        x = np.linspace(first[i], 1.0, _POINTS)
        x = np.unique(np.append(x, _limits(law, here, there, x)))
        if len(x) < 2:
            continue
        regime = law.regimes(here.at(there, 0.5 * (x[1:] + x[:-1])))
        if np.any(regime == Regime.NONE):
            out[i] = np.inf
            continue
        with np.errstate(divide="ignore"):
            slow = -np.log(law.growth(here.at(there, x)))
        for k in np.flatnonzero(regime == Regime.PARIS):
            out[i] += da[i] * (x[k + 1] - x[k]) * _mean_of_exponential(slow[k], slow[k + 1])
    return out


_POINTS = 17
"""Points at which the growth rate is taken within an element."""
_BISECTIONS = 50
"""How often a piece of an element is halved on which the regime changes."""


def _limits(law: FatigueLaw, here: CycleRates, there: CycleRates, x: Array) -> Array:
    """Parts of an element at which the regime changes, one in each piece between points x."""
    regime = law.regimes(here.at(there, x))
    at = np.flatnonzero(regime[1:] != regime[:-1])
    if not at.size:
        return np.zeros(0)
    low, high, first = x[at], x[at + 1], regime[at]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        same = law.regimes(here.at(there, middle)) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.asarray(0.5 * (low + high))


def _mean_of_exponential(a: float, b: float) -> float:
    """Mean of exp over the straight way from a to b."""
    if not (np.isfinite(a) and np.isfinite(b)):
        return float("inf")
    difference = b - a
    if abs(difference) < 1e-9:
        return float(np.exp(0.5 * (a + b)))
    return float(np.exp(a) * np.expm1(difference) / difference)
