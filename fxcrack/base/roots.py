"""The root of a function between two places where it has different signs."""

from __future__ import annotations

from collections.abc import Callable

_ROUND_OFF = 1e-15
"""A bracket smaller than this part of its upper end is not divided any more."""
_SECANTS = 3
"""Secants that may fail to halve the bracket before it is halved itself."""
_MOST = 600
"""Evaluations, more than halving needs from the largest to the smallest numbers."""


def bracketed_root(
    function: Callable[[float], float],
    low: float,
    high: float,
    f_low: float,
    f_high: float,
    *,
    close: float,
) -> float:
    """Root by secants with the Illinois weights, and by halving where they are slow.

    A linear function is solved by the first secant. Four evaluations halve the bracket at least, so
    that their number is bounded whatever the function is.

    Args:
        function: The function.
        low: Lower end, not negative.
        high: Upper end.
        f_low: Value at the lower end.
        f_high: Value at the upper end, of the other sign or zero.
        close: Values below this are zero.

    Returns:
        The root, or the upper end of a bracket that round-off does not divide.
    """
    rising = f_high >= 0.0
    width, tried = high - low, 0
    for _ in range(_MOST):
        if tried == _SECANTS:
            x, width, tried = 0.5 * (low + high), 0.5 * (high - low), 0
        else:
            x, tried = low - f_low * (high - low) / (f_high - f_low), tried + 1
        if not low < x < high:
            break
        value = function(x)
        if abs(value) < close:
            return x
        if (value >= 0.0) == rising:
            high, f_high, f_low = x, value, 0.5 * f_low
        else:
            low, f_low, f_high = x, value, 0.5 * f_high
        if high - low < _ROUND_OFF * high:
            break
        if high - low <= 0.5 * width:
            width, tried = high - low, 0
    return high
