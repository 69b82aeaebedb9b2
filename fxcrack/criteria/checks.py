"""Checks of what the user typed; each error names the criterion and the field."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fxcrack.errors import InputError

Array = npt.NDArray[np.float64]
"""Array of floats."""

Bools = npt.NDArray[np.bool_]
"""Array of truth values."""


def number(owner: str, name: str, value: object) -> float:
    """Return ``value`` as a float.

    Raises:
        InputError: ``value`` is not a number, or NaN.
    """
    try:
        if isinstance(value, str):
            raise TypeError
        result = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InputError(f"{owner}: {name} = {value!r} is not a number; give one") from None
    if np.isnan(result):
        raise InputError(f"{owner}: {name} is NaN; give a number")
    return result


def positive(owner: str, **values: object) -> None:
    """Check that every named value is a positive finite number.

    Raises:
        InputError: One is not.
    """
    for name, value in values.items():
        if not 0.0 < number(owner, name, value) < np.inf:
            raise InputError(f"{owner}: {name} = {value} must be positive and finite")


def not_negative(owner: str, **values: object) -> None:
    """Check that every named value is a finite number, zero or larger.

    Raises:
        InputError: One is not.
    """
    for name, value in values.items():
        if not 0.0 <= number(owner, name, value) < np.inf:
            raise InputError(f"{owner}: {name} = {value} must be zero or positive, and finite")


def one_of(owner: str, name: str, value: object, known: Sequence[str]) -> None:
    """Check that a word is one of those known.

    Raises:
        InputError: It is not; the message lists the known words.
    """
    if value not in known:
        raise InputError(f"{owner}: {name} = {value!r} is unknown; choose from {', '.join(known)}")


def table(
    owner: str, names: tuple[str, str], x: object, y: object
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the two columns of a table as tuples of floats.

    Args:
        owner: Criterion or law the table belongs to.
        names: What the columns are called.
        x: First column, strictly increasing.
        y: Second column, of the same length.

    Raises:
        InputError: A column is empty, not finite or of another length, or ``x`` does not increase.
    """
    try:
        columns = [np.atleast_1d(np.asarray(c, dtype=np.float64)) for c in (x, y)]
    except (TypeError, ValueError):
        raise InputError(f"{owner}: {names[0]} and {names[1]} must be lists of numbers") from None
    a, b = columns
    if a.ndim != 1 or a.shape != b.shape or a.size == 0:
        raise InputError(
            f"{owner}: {names[0]} has shape {a.shape} and {names[1]} has {b.shape}; "
            "give two lists of the same length, at least one entry each"
        )
    for name, column in zip(names, columns, strict=True):
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise InputError(
                f"{owner}: {name}[{bad[0]}] = {column[bad[0]]}; every entry must be finite"
            )
    flat = np.flatnonzero(np.diff(a) <= 0.0)
    if flat.size:
        i = int(flat[0])
        raise InputError(
            f"{owner}: {names[0]} must increase, but entry {i + 1} ({a[i + 1]:g}) follows "
            f"entry {i} ({a[i]:g}); sort the table and remove repeated entries"
        )
    return tuple(a.tolist()), tuple(b.tolist())
