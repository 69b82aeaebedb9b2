"""A number that may depend on the mode mix: a constant, a table, or a function of the shear share.

The mode mix is B = (G_II + G_III)/G, 0 in mode I and 1 in shear.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import as_float, is_function, list_of, not_negative, shown, table
from fxcrack.base.errors import InputError

MixCurve = float | tuple[tuple[float, ...], tuple[float, ...]] | Callable[[Array], npt.ArrayLike]
"""A number, a table ([B_0, B_1, ...], [value_0, value_1, ...]) or a function of B."""


def mix_curve(owner: str, name: str, value: Any) -> MixCurve:
    """A curve as it is kept, checked over all mode mixes.

    Args:
        owner: What is being made, for messages.
        name: The argument.
        value: What the user gave.

    Raises:
        InputError: It is no curve, or a value of it is negative or not finite.
    """
    if is_function(value):
        value_at(owner, name, value, np.linspace(0.0, 1.0, 101))
        return value
    entries = list_of(value)
    if entries is None:
        not_negative(owner, **{name: value})
        return float(as_float(value) or 0.0)
    if len(entries) != 2:
        raise InputError(
            f"{owner}: {name} = {shown(value)} must be a number, a table (shares of shear, values) "
            "or a function of the share of shear"
        )
    shares, values = table(owner, (f"the shares of {name}", "values"), *entries)
    if shares[0] < 0.0 or shares[-1] > 1.0:
        raise InputError(
            f"{owner}: the shares of {name} reach from {shares[0]:g} to {shares[-1]:g}; a share of "
            "shear lies between 0 and 1"
        )
    for share, entry in zip(shares, values, strict=True):
        not_negative(owner, **{f"{name} at a share of shear of {share:g}": entry})
    return shares, values


def value_at(owner: str, name: str, curve: MixCurve, shear: npt.ArrayLike) -> Array:
    """Values at mode mixes; beyond the ends of a table, those at its ends.

    Args:
        owner: What the curve belongs to, for messages.
        name: What it is called there.
        curve: From :func:`mix_curve`.
        shear: Shares of shear B, shape (n,).

    Returns:
        Shape (n,).

    Raises:
        InputError: A function fails, or returns another shape, or negative values.
    """
    b = np.asarray(shear, dtype=np.float64)
    if callable(curve):
        try:
            found = np.asarray(curve(b), dtype=np.float64)
        except Exception as error:  # whatever the user's function may raise
            raise InputError(
                f"{owner}: the function {name} fails: {type(error).__name__}: {error}; it gets an "
                f"array of shape {b.shape}, shares of shear between 0 and 1"
            ) from error
        if found.shape not in ((), b.shape):
            raise InputError(
                f"{owner}: the function {name} returned shape {found.shape} for {b.shape}; it must "
                "return one value for each share of shear"
            )
        found = np.array(np.broadcast_to(found, b.shape))
        bad = np.flatnonzero(~(np.isfinite(found) & (found >= 0.0)).ravel())
        if bad.size:
            raise InputError(
                f"{owner}: {name} = {found.ravel()[bad[0]]:g} at a share of shear of "
                f"{b.ravel()[bad[0]]:g}; it must be finite and not negative"
            )
        return found
    if isinstance(curve, tuple):
        return np.asarray(np.interp(b, *curve), dtype=np.float64)
    return np.full(b.shape, float(curve))
