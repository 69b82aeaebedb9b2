"""Coordinates of nodes along a line: even, graded away from a point, fine in a region."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fxcrack.base.checks import list_of, number, shown
from fxcrack.base.errors import MeshError

Floats = npt.NDArray[np.float64]


def positive(**values: float) -> None:
    """Refuse lengths, sizes and numbers of elements that are not positive.

    Raises:
        MeshError: Names the first value that is not.
    """
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            raise MeshError(f"{name} must be positive, not {value}")


def even(start: float, stop: float, size: float) -> Floats:
    """Even steps close to ``size`` and not much longer, shape (n,)."""
    positive(length=stop - start, size=size)
    return np.linspace(start, stop, max(1, int(np.ceil((stop - start) / size - 1e-6))) + 1)


def growing(
    start: float,
    stop: float,
    size: float,
    *,
    growth: float = 1.2,
    largest: float = np.inf,
    even_length: float = 0.0,
) -> Floats:
    """Steps that grow from ``start`` towards ``stop``; ``stop`` may be the smaller one.

    Args:
        start: Where the steps are smallest (length).
        stop: The other end (length).
        size: Step of the even region; growth starts from it (length).
        growth: Ratio of neighbouring steps.
        largest: Upper bound of the steps (length).
        even_length: Length over which the steps stay ``size``, rounded up to whole steps.

    Returns:
        Increasing coordinates with both ends, shape (n,).
    """
    length = abs(stop - start)
    positive(length=length, size=size)
    n_even = int(np.ceil(even_length / size - 1e-6))
    if not (growth >= 1.0 and largest > 0.0):
        raise MeshError(
            f"growth={growth} must be at least 1 and the largest step {largest} positive"
        )
    if n_even * size > length * (1 + 1e-9):
        raise MeshError(
            f"an even region of {even_length:g} with steps of {size:g} does not fit into {length:g}"
        )
    if n_even and length - n_even * size < 0.5 * size:
        n_even -= 1  # no sliver between the even region and the end
    places = [size * i for i in range(n_even + 1)]
    rest, step = length - places[-1], size
    steps: list[float] = []
    while rest > 1e-9 * length and sum(steps) < rest * (1 - 1e-9):
        step = max(min(step * growth, largest), size)
        steps.append(step)
    if len(steps) > 1 and sum(steps) - rest > 0.5 * steps[-1]:
        steps.pop()
    if steps:
        tail = np.cumsum(steps)
        places = [*places, *(places[-1] + tail * rest / tail[-1])]
    x = start + np.sign(stop - start) * np.array(places)
    x[-1] = stop
    return np.sort(x)


def fine_region(
    stop: float,
    dx: float,
    *,
    fine: tuple[float, float] | None = None,
    coarse_dx: float | None = None,
    given: npt.ArrayLike | None = None,
) -> Floats:
    """Coordinates from 0 to ``stop``: given ones, even ones, or ones fine in a region only.

    Args:
        stop: Length of the line.
        dx: Step, in the fine region if there is one.
        fine: Both ends of the fine region, ``None`` for even steps throughout.
        coarse_dx: Largest step outside it, ``None`` for 8 dx; steps never fall below dx.
        given: All the coordinates, to use as they are.

    Raises:
        MeshError: The region leaves the line, or the given ones do not run from 0 to ``stop``.
    """
    positive(length=stop, dx=dx)
    if given is not None:
        x = np.array(given, dtype=float)
        increases = x.ndim == 1 and len(x) > 1 and bool(np.all(np.diff(x) > 0))
        if not increases or not np.allclose(x[[0, -1]], [0.0, stop], rtol=0, atol=1e-9 * stop):
            raise MeshError(
                f"given coordinates must increase from 0 to {stop:g} in one array; got shape "
                f"{x.shape}: {np.array2string(x, threshold=6, precision=6)}"
            )
        x[[0, -1]] = 0.0, stop
        return x
    if fine is None:
        return even(0.0, stop, dx)
    ends = list_of(fine)
    if ends is None or len(ends) != 2:
        raise MeshError(f"fine = {shown(fine)} must be both ends of the fine region, (20.0, 40.0)")
    low, high = (number("mesh", "an end of the fine region", end) for end in ends)
    if not 0.0 <= low < high <= stop:
        raise MeshError(f"the fine region {low:g} to {high:g} must lie between 0 and {stop:g}")
    largest = 8.0 * dx if coarse_dx is None else coarse_dx
    pieces = [even(low, high, dx)]
    if low > 0.0:
        pieces.insert(0, growing(low, 0.0, dx, largest=largest)[:-1])
    if high < stop:
        pieces.append(growing(high, stop, dx, largest=largest)[1:])
    return np.concatenate(pieces)
