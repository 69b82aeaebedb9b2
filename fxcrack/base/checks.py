"""Checks of what kind of thing an argument is, with messages for the usual mistakes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base import log
from fxcrack.base.arrays import Array
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
    no_list = isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable)
    if isinstance(value, kinds) or no_list:
        raise InputError(
            f"{owner}: {name} must be a list of {wanted}, not {_kind(value)}; write {name}=[...]"
        )
    try:
        parts = list(value)
    except Exception as error:  # an array of shape (), a user's own iterator
        raise InputError(f"{owner}: {name} cannot be read as a list: {error}") from error
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


def counted(n: int, what: str) -> str:
    """A number of things in words of messages, "1 node" or "2 nodes".

    Args:
        n: How many.
        what: One of them; an s makes several of it.
    """
    return f"{n} {what}" if n == 1 else f"{n} {what}s"


def number(owner: str, name: str, value: object) -> float:
    """Return ``value`` as a float; numbers of numpy and arrays of shape () are numbers.

    Raises:
        InputError: ``value`` is not a real number, or NaN.
    """
    result = as_float(value)
    if result is None:
        raise InputError(f"{owner}: {name} = {shown(value)} is not a number; give one")
    if math.isnan(result):
        raise InputError(f"{owner}: {name} is NaN; give a number")
    return result


def as_float(value: object) -> float | None:
    """A real number as a float, None where it is none; too large ones are infinite."""
    if isinstance(value, str | bytes | bool | np.bool_ | type | complex | np.complexfloating):
        return None
    if isinstance(value, np.ndarray) and (value.ndim > 0 or value.dtype.kind not in "fiu"):
        return None
    try:
        return float(value)  # type: ignore[arg-type]
    except OverflowError:
        return math.inf
    except Exception:  # whatever the conversion of a foreign type raises: it is no number
        return None


def _ranged(owner: str, name: str, value: object, good: bool, words: str) -> None:
    """Raise unless ``good``; ``words`` say what the value must be."""
    if not good:
        # NaN is said twice, as it passes for a number in the value and for none in the words
        nan = f"{name} is NaN; " if as_float(value) != as_float(value) else ""
        raise InputError(f"{owner}: {nan}{name} = {value} must be {words}")


def number_or_nan(owner: str, name: str, value: object) -> float:
    """As :func:`number`, but NaN is returned, for a caller who says what range it is out of."""
    found = as_float(value)
    return number(owner, name, value) if found is None else found


def positive(owner: str, **values: object) -> None:
    """Check that every named value is a positive finite number.

    Raises:
        InputError: One is not.
    """
    for name, value in values.items():
        good = 0.0 < number_or_nan(owner, name, value) < np.inf
        _ranged(owner, name, value, good, "positive and finite")


def not_negative(owner: str, **values: object) -> None:
    """Check that every named value is a finite number, zero or larger.

    Raises:
        InputError: One is not.
    """
    for name, value in values.items():
        good = 0.0 <= number_or_nan(owner, name, value) < np.inf
        _ranged(owner, name, value, good, "zero or positive, and finite")


def finite(owner: str, **values: object) -> None:
    """Check that every named value is a finite number.

    Raises:
        InputError: One is not.
    """
    for name, value in values.items():
        good = math.isfinite(number_or_nan(owner, name, value))
        _ranged(owner, name, value, good, "finite")


def between(
    owner: str, name: str, value: object, low: float, high: float, *, ends: bool = True
) -> None:
    """Check that a number lies in a range.

    Args:
        owner: What is being made, for the message.
        name: The argument.
        value: What the user gave.
        low: Lower end of the range.
        high: Upper end of the range.
        ends: Whether the ends belong to it.

    Raises:
        InputError: It does not, or is no number.
    """
    x = number_or_nan(owner, name, value)
    good = low <= x <= high if ends else low < x < high
    if not good:
        nan = f"{name} is NaN; " if x != x else ""
        words = f"between {low:g} and {high:g}" + ("" if ends else " (exclusive)")
        raise InputError(f"{owner}: {nan}{name} = {value} must lie {words}")


def whole(owner: str, name: str, value: object, *, least: int = 1, words: str = "") -> int:
    """Return a count as an int; floats without a fraction, 1e4, are counts as well.

    Args:
        owner: What is being made, for the message.
        name: The argument.
        value: What the user gave.
        least: Smallest count allowed.
        words: What to do, for the message; empty for nothing beyond the range.

    Raises:
        InputError: It is not a whole number, or less than ``least``.
    """
    x = number(owner, name, value)
    if not (math.isfinite(x) and x == math.floor(x) and x >= least):
        more = f"; {words}" if words else ""
        raise InputError(
            f"{owner}: {name} = {value} must be a whole number, at least {least}{more}"
        )
    return int(x)


def flag(owner: str, name: str, value: object) -> bool:
    """Return a truth value as a bool; 0 and 1 are truth values as well.

    Raises:
        InputError: It is anything else: the text "no" would count as true.
    """
    if isinstance(value, bool | np.bool_) or (
        isinstance(value, int | np.integer) and value in (0, 1)
    ):
        return bool(value)
    raise InputError(f"{owner}: {name} = {shown(value)} must be True or False")


def text(owner: str, name: str, value: object, *, optional: bool = False) -> None:
    """Check that a name is a text that is not empty.

    Args:
        owner: What is being made, for the message.
        name: The argument.
        value: What the user gave.
        optional: Whether None stands for no name.

    Raises:
        InputError: It is not.
    """
    if value is None and optional:
        return
    if not isinstance(value, str) or not value:
        other = "; None for the default" if optional else ""
        raise InputError(f"{owner}: {name} = {shown(value)} must be a name, a text{other}")


def file_path(owner: str, name: str, value: object) -> Path:
    """Return the path of a file.

    Raises:
        InputError: It is neither a text nor a path.
    """
    if not isinstance(value, str | Path):
        raise InputError(f"{owner}: {name} = {shown(value)} must be a path, a text or a Path")
    return Path(value)


def communicator(owner: str, value: object) -> None:
    """Check that a value is a communicator of mpi4py.

    Raises:
        InputError: It is not.
    """
    if not isinstance(value, MPI.Comm):
        raise InputError(
            f"{owner}: comm = {shown(value)} must be a communicator of mpi4py, e.g. MPI.COMM_WORLD"
        )


def numbers(
    owner: str, name: str, value: object, n: int | None = None, *, words: str = ""
) -> tuple[float, ...]:
    """Return a list of finite numbers as a tuple of floats.

    Args:
        owner: What is being made, for the message.
        name: The argument.
        value: What the user gave: a list, a tuple or an array of shape (n,).
        n: How many there must be; None for any number, at least one.
        words: What they are, for the message.

    Raises:
        InputError: It is no flat list, of another length, or an entry is not a finite number.
    """
    entries = list_of(value)
    count = "some" if n is None else f"{n}"
    if entries is None or not entries or (n is not None and len(entries) != n):
        more = f", {words}" if words else ""
        raise InputError(f"{owner}: {name} = {shown(value)} must be {count} numbers{more}")
    for i, entry in enumerate(entries):
        finite(owner, **{f"{name}[{i}]": entry})
    return tuple(number(owner, name, entry) for entry in entries)


def list_of(value: object) -> list[Any] | None:
    """The entries of a list, a tuple or an array of at least one dimension; None for others."""
    if isinstance(value, np.ndarray):
        return list(value) if value.ndim > 0 else None
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Sequence):
        return None
    return list(value)


def is_count(value: object) -> bool:
    """Whether a value is of a type of whole numbers; truth values are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def is_function(value: object) -> TypeGuard[Callable[..., Any]]:
    """Whether a value can stand for a function of position: callable, and no class."""
    return callable(value) and not isinstance(value, type)


def number_or_function(owner: str, name: str, value: object) -> None:
    """Check that a value is a finite number or a function of position.

    Raises:
        InputError: It is neither.
    """
    if is_function(value):
        return
    found = as_float(value)
    if found is None:
        raise InputError(
            f"{owner}: {name} = {shown(value)} is not a number; give one, or a function of position"
        )
    if not math.isfinite(found):
        raise InputError(f"{owner}: {name} is not a finite number ({name} = {found}); give one")


def keep(frozen: Any, **values: object) -> None:
    """Set attributes of a frozen dataclass, while it is being made."""
    for name, value in values.items():
        object.__setattr__(frozen, name, value)


def keep_floats(frozen: Any, *names: str) -> None:
    """Make floats of checked numbers of a frozen dataclass; None stays."""
    for name in names:
        value = getattr(frozen, name)
        if value is not None:
            object.__setattr__(frozen, name, as_float(value))


def shown(value: object) -> str:
    """A value as messages show it, cut to one line, whatever its class says of itself."""
    try:
        shown = repr(value)
    except Exception:  # a user's own class may fail to describe itself
        shown = f"a {type(value).__name__}"
    shown = " ".join(shown.split())
    return shown if len(shown) <= 80 else f"{shown[:77]}..."


def one_of(owner: str, name: str, value: object, known: Sequence[str]) -> None:
    """Check that a word is one of those known.

    Raises:
        InputError: It is not; the message lists the known words.
    """
    if not isinstance(value, str) or value not in known:
        raise InputError(
            f"{owner}: {name} = {shown(value)} is unknown; choose from {', '.join(known)}"
        )


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
    a, b = (_column(owner, names, column) for column in (x, y))
    if a.ndim != 1 or a.shape != b.shape or a.size == 0:
        raise InputError(
            f"{owner}: {names[0]} has shape {a.shape} and {names[1]} has {b.shape}; "
            "give two lists of the same length, at least one entry each"
        )
    for name, column in zip(names, (a, b), strict=True):
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


def _column(owner: str, names: tuple[str, str], given: object) -> Array:
    """One column of a table as an array; a single number is a column of one entry."""
    entries = [given] if list_of(given) is None else list_of(given)
    found = [as_float(entry) for entry in entries or []]
    if any(x is None for x in found):
        raise InputError(f"{owner}: {names[0]} and {names[1]} must be lists of numbers")
    return np.array(found, dtype=np.float64)
