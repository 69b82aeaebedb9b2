"""Roots of functions between two places where they have different signs.

:func:`bracketed_root` calls the function as often as it needs; :class:`Bracket` is for searches in
which every trial is an equilibrium that the caller looks for.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_MOST = 2200
"""Evaluations: halving from the largest to the smallest numbers needs fewer."""
_SLACK = 3
"""Trials by which a search may be slower than halving."""


def bracketed_root(
    function: Callable[[float], float],
    low: float,
    high: float,
    f_low: float,
    f_high: float,
    *,
    close: float,
) -> float:
    """Root by the method of Brent (1973): secants and inverse parabolas, guarded by halving.

    Args:
        function: The function.
        low: Lower end, not negative.
        high: Upper end.
        f_low: Value at the lower end.
        f_high: Value at the upper end, of the other sign or zero.
        close: Values below this are zero.

    Returns:
        The root, or, where round-off does not come closer or the function jumps, the upper end of
        the last bracket.
    """
    known = {low: f_low, high: f_high}
    end = high

    def value(x: float) -> float:
        nonlocal end
        y = known[x] if x in known else function(x)
        if abs(y) < close:
            end = x
            return 0.0
        if (y >= 0.0) == (f_high >= 0.0):
            end = min(end, x)
        return y

    from scipy.optimize import brentq  # slow to import, and many runs need no root

    brentq(
        value, low, high, xtol=float(np.finfo(float).tiny), rtol=4.0 * np.finfo(float).eps,
        maxiter=_MOST, disp=False,
    )  # fmt: skip
    return end


class Bracket:
    """Keeps a search by any guesses at most a few trials behind halving.

    After j trials the bracket is at most 2^(3 - j) times as wide as the first one: guesses near one
    end are moved towards the middle as far as that needs, the projection of the ITP method
    (Oliveira and Takahashi 2020).

    Args:
        low: One end of the first bracket.
        high: The other.

    Attributes:
        trials: Guesses admitted so far.
    """

    def __init__(self, low: float, high: float) -> None:
        self._limit = abs(high - low) * 2.0**_SLACK
        self.trials = 0

    def admit(self, guess: float, low: float, high: float) -> float:
        """The guess, or the place nearest to it that narrows the bracket enough.

        Args:
            guess: Where the root is expected.
            low: One end of the present bracket.
            high: The other, in any order.
        """
        self.trials += 1
        self._limit *= 0.5
        low, high = min(low, high), max(low, high)
        reach = max(self._limit, 0.5 * (high - low))
        return min(max(guess, high - reach), low + reach)
