"""Powers fitted to measurements, and what they predict: pure functions.

y = c x^p,      log y = log c + p log x      (least squares)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.accuracy.study import Setting

_GUESS = 1.2
"""Exponent of the cost in the unknowns while too little is known."""
_POSSIBLE = (0.8, 1.8)
"""Exponents outside are noise or overheads: large problems cost between n and n^1.8."""
FIT_POINTS = 4
"""The largest problems of a line determine its exponents,"""
FIT_RANGE = 1.5
"""those within so many decades below the largest."""
_FIRST = 0.5
"""Seconds for a setting before anything is known."""


@dataclass(frozen=True)
class PowerLaw:
    """y = factor x^exponent."""

    factor: float
    exponent: float

    def __call__(self, x: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Values, the shape of x."""
        return np.asarray(self.factor * np.asarray(x, dtype=float) ** self.exponent)


def fit_power(x: npt.ArrayLike, y: npt.ArrayLike) -> PowerLaw | None:
    """Fit a power to positive points; ``None`` for fewer than two different x.

    Args:
        x: Abscissas, shape (n,).
        y: Ordinates, shape (n,). Points that are not positive and finite are left out.
    """
    a, b = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    good = (a > 0.0) & (b > 0.0) & np.isfinite(a) & np.isfinite(b)
    a, b = np.log(a[good]), np.log(b[good])
    if len(a) < 2 or np.ptp(a) < 1e-9:
        return None
    mean = a.mean()
    slope = float((a - mean) @ b / ((a - mean) @ (a - mean)))
    return PowerLaw(float(np.exp(b.mean() - slope * mean)), slope)


def unknowns(setting: Setting) -> float:
    """Number the unknowns of a setting are proportional to: (order/size)^dimension."""
    return float((setting.order / setting.size) ** setting.dimension)


def predict(setting: Setting, done: Mapping[Setting, float]) -> float:
    """Seconds a setting will take, from those that others took.

    The last points of the same line determine the exponent; without any, the nearest in unknowns
    of the same dimension is scaled with an assumed one.

    Args:
        setting: What is to be run.
        done: Seconds of what has been run.
    """
    if not done:
        return _FIRST
    n = unknowns(setting)
    own = sorted((unknowns(s), t) for s, t in done.items() if s.line == setting.line)
    exponent = _GUESS
    if own:
        power = fit_power(*zip(*own[-3:], strict=True))
        if power is not None:
            exponent = float(np.clip(power.exponent, *_POSSIBLE))
        n_last, seconds = own[-1]
        return float(seconds * (n / n_last) ** exponent)
    near = min(done, key=lambda s: (s.dimension != setting.dimension, abs(np.log(unknowns(s) / n))))
    return float(done[near] * (n / unknowns(near)) ** exponent)


def plan(
    waiting: Iterable[Setting],
    done: Mapping[Setting, float],
    remaining: float,
    extra: Callable[[Setting, float], float] = lambda setting, seconds: seconds,
) -> tuple[Setting | None, float]:
    """The cheapest setting that waits, if it fits into what is left of the budget.

    Args:
        waiting: Settings not yet run.
        done: Seconds of what has been run.
        remaining: Seconds left.
        extra: Wall-clock time of a setting and its predicted seconds, s, e.g. with repeats.

    Returns:
        The setting and its predicted wall-clock time, s; ``None`` if nothing fits, with the time
        of the cheapest (infinite if nothing waits).
    """
    best, seconds = None, np.inf
    for setting in waiting:
        predicted = extra(setting, predict(setting, done))
        if predicted < seconds:
            best, seconds = setting, predicted
    return (best if seconds <= remaining else None), float(seconds)


def extrapolate(sizes: Sequence[float], values: Sequence[float]) -> tuple[float, float, float]:
    """Limit of values for size 0, from the three finest of them.

        v(h) = v0 + c h^p,      p = log((v1 - v2)/(v2 - v3)) / log r

    for sizes in one ratio r. p is kept between 1/2 and 2 (a larger one shows that the sizes are too
    coarse), and is 1 for two sizes or where the values do not approach each other.

    Args:
        sizes: Coarse to fine.
        values: One each.

    Returns:
        The limit, the exponent, and how far the finest value is from the limit.
    """
    h, v = np.asarray(sizes, dtype=float)[-3:], np.asarray(values, dtype=float)[-3:]
    if len(h) < 2:
        raise ValueError("at least two sizes are needed")
    exponent = 1.0
    steps = np.diff(v)
    ratio = float(h[-2] / h[-1])
    even = len(h) == 3 and abs(h[0] / h[1] / ratio - 1.0) < 1e-6
    if even and steps[0] * steps[1] > 0.0 and abs(steps[1]) < abs(steps[0]):
        exponent = float(np.clip(np.log(steps[0] / steps[1]) / np.log(ratio), 0.5, 2.0))
    correction = float(steps[-1] / (ratio**exponent - 1.0))
    return float(v[-1] + correction), exponent, abs(correction)
