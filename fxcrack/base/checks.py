"""Checks of what kind of thing an argument is, with messages for the usual mistakes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.errors import InputError


def check_list(owner: str, name: str, value: Any, kinds: type | tuple[type, ...]) -> list[Any]:
    """The parts an argument lists.

    Args:
        owner: What is being made, for the message.
        name: The argument.
        value: What the user gave.
        kinds: What the parts may be.

    Raises:
        InputError: A single part without its list, or a part of another kind.
    """
    wanted = " or ".join(k.__name__ for k in (kinds if isinstance(kinds, tuple) else (kinds,)))
    if isinstance(value, kinds) or not isinstance(value, Iterable):
        raise InputError(
            f"{owner}: {name} must be a list of {wanted}, not {_kind(value)}; write {name}=[...]"
        )
    parts = list(value)
    for i, part in enumerate(parts):
        if not isinstance(part, kinds):
            raise InputError(f"{owner}: {name}[{i}] is {_kind(part)}; it must be a {wanted}")
    return parts


def check_instance(
    owner: str, name: str, value: Any, kinds: type | tuple[type, ...], example: str
) -> None:
    """Check that an argument is an instance of some classes.

    Raises:
        InputError: It is not, or a class was given where an instance of it belongs.
    """
    if isinstance(value, type):
        raise InputError(f"{owner}: {name} = {value.__name__} is a class; make one, e.g. {example}")
    if not isinstance(value, kinds):
        raise InputError(f"{owner}: {name} is {_kind(value)}; give e.g. {example}")


def missing_members(value: Any, protocol: type) -> str:
    """What an object lacks of a protocol, in words; empty where nothing is missing.

    Args:
        value: What the user gave.
        protocol: Class whose public members it must have.
    """
    if isinstance(value, type):
        return f"it is a class; make one, {value.__name__}(...)"
    names = sorted({*vars(protocol), *getattr(protocol, "__annotations__", {})})
    lacking = [n for n in names if not n.startswith("_") and not hasattr(value, n)]
    more = f" and {len(lacking) - 4} more" if len(lacking) > 4 else ""
    return f"it lacks {', '.join(lacking[:4])}{more}" if lacking else ""


def warn_of_same_titles(kind: str, parts: Iterable[Any]) -> None:
    """Warn of parts that the history would call the same."""
    titles = [part.title for part in parts]
    for title in dict.fromkeys(t for t in titles if titles.count(t) > 1):
        log.warn(
            "%d %s are called '%s' and the history shows the last of them only; tell them apart by "
            "name=...",
            titles.count(title),
            kind,
            title,
        )


def check_amplitudes(parts: Iterable[Any]) -> None:
    """Check that the factors in time of supports and loads are amplitudes.

    Raises:
        InputError: One is something else, a number or a function perhaps.
    """
    for part in parts:
        if isinstance(part.amplitude, type) or not hasattr(part.amplitude, "breaks"):
            raise InputError(
                f"{type(part).__name__}('{part.title}'): amplitude is {_kind(part.amplitude)}; "
                "give Amplitude(times, values), or put a constant factor into the value"
            )


def _kind(value: Any) -> str:
    return f"the class {value.__name__}" if isinstance(value, type) else type(value).__name__


def format_point(point: npt.ArrayLike) -> str:
    """A point, shape (dim,), as messages show it; round-off counts as 0."""
    x = np.ravel(point)
    x = np.where(np.abs(x) <= 1e-12 * np.abs(x).max(initial=0.0), 0.0, x)
    return "(" + ", ".join(f"{v:.6g}" for v in x.tolist()) + ")"


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
