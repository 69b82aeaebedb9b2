"""Functions of position that users give: one convention, checked wherever they are called.

A function is given positions x of shape (3, n), as DOLFINx gives them, so that ``x[0]`` is the
first coordinate of all of them, and returns n values (numbers: or one for all; booleans: or the
constant ``True`` or ``False``, while a single boolean that NumPy has found says nothing of the
other positions and is refused). The convention of earlier
versions for toughness and interface temperature, shape (n, gdim) with ``x[:, 0]``, is recognised by
the shape of what the function returns; it is called with a deprecation warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.errors import InputError

_TELLING = 4
"""Positions of a call, at least: more than a position has coordinates, so that shapes tell which
axis a function takes for the coordinates."""


def numbers_at(
    owner: str,
    name: str,
    function: Callable[..., Any],
    x: Array,
    *,
    error: type[InputError] = InputError,
) -> Array:
    """Numbers that a user's function gives at some positions; NaN and infinity are not checked.

    Args:
        owner: What the function was given to, for the message.
        name: The argument it was given as.
        function: The function.
        x: Positions, shape (n, 2) or (n, 3) [length].
        error: Class of the exception.

    Returns:
        Shape (n,).

    Raises:
        InputError: The function raises, returns another shape, or no real numbers.
    """
    found = _call(owner, name, function, x, "number", error)
    if found.dtype.kind not in "fiub":
        raise error(
            f"{owner}: {name} gives values of type {found.dtype}; one number per position is needed"
        )
    return found.astype(np.float64)


def marks_at(
    owner: str,
    name: str,
    function: Callable[..., Any],
    x: Array,
    *,
    error: type[InputError] = InputError,
) -> Bools:
    """Truth values that a user's function gives at some positions.

    Arguments as for :func:`numbers_at`.

    Returns:
        Shape (n,).

    Raises:
        InputError: The function raises, returns another shape, or other than booleans.
    """
    found = _call(owner, name, function, x, "boolean", error)
    return as_marks(owner, name, found, error=error)


def as_marks(
    owner: str, name: str, found: npt.NDArray[Any], *, error: type[InputError] = InputError
) -> Bools:
    """An array as booleans; the numbers 0 and 1 are taken for them.

    Raises:
        InputError: It holds anything else.
    """
    if found.dtype.kind == "f" and not np.all(np.isfinite(found)):
        raise error(f"{owner}: {name} gives NaN or infinity; return booleans")
    if found.dtype.kind not in "biuf" or not np.all((found == 0) | (found == 1)):
        other = next((v for v in found.ravel().tolist() if v not in (0, 1)), found.dtype)
        raise error(
            f"{owner}: {name} gives {other!r}; one boolean per position is needed, such as "
            "x[0] >= 30.0"
        )
    return found.astype(bool)


def _call(
    owner: str,
    name: str,
    function: Callable[..., Any],
    x: Array,
    kind: str,
    error: type[InputError],
) -> npt.NDArray[Any]:
    """Values of shape (n,), called by the present convention or by the former one."""
    n, gdim = np.shape(x)
    if not n:  # nothing is asked of a function that could not take the largest of no positions
        return np.zeros(0, dtype=bool if kind == "boolean" else np.float64)
    rows = np.asarray(x, dtype=np.float64)[np.arange(max(n, _TELLING)) % n]
    columns = np.zeros((3, len(rows)))
    columns[:gdim] = rows.T
    m = len(rows)
    found, problem, cause = _attempt(function, columns, m, kind)
    if found is None:
        former, _, _ = _attempt(function, rows.copy(), m, kind)
        if former is not None:
            warnings.warn(
                f"{owner}: the function given as {name} takes positions of shape (n, gdim); write "
                "it for shape (3, n), where x[0] is the first coordinate: the former shape will no "
                "longer be given",
                DeprecationWarning,
                stacklevel=4,
            )
            found = former
    if found is None:
        hint = ""
        if kind == "boolean" and "truth value" in problem:
            hint = "; join conditions by & or |, each in brackets"
        raise error(
            f"{owner}: {problem.format(name=name)} for positions x of shape (3, {m}); one "
            f"{kind} per position is needed, shape ({m},) (the first coordinate is x[0])"
            f"{hint}"
        ) from cause
    return found[:n]


def _attempt(
    function: Callable[..., Any], x: Array, n: int, kind: str
) -> tuple[npt.NDArray[Any] | None, str, Exception | None]:
    """What a function returns as an array of one value per position, or what is wrong."""
    try:
        given = function(x)
        found = np.asarray(given)
    except Exception as caught:  # whatever the user's function may raise
        text = f"{type(caught).__name__}: {caught}".replace("{", "{{").replace("}", "}}")
        return None, "the function {name} fails: " + text, caught
    if found.shape == () and found.dtype.kind in "fiub":
        if kind == "boolean" and not isinstance(given, bool | int | float):
            return None, f"{{name}} gives a single {given!r}", None
        return np.broadcast_to(found, (n,)), "", None
    if found.shape == (1, n):
        return found[0], "", None
    if found.shape != (n,):
        what = "{name} gives None" if given is None else f"{{name}} gives shape {found.shape}"
        return None, what, None
    return found, "", None
