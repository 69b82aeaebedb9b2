"""Which settings are worth their time, and what to advise: pure functions.

A setting is on the Pareto front if none is as fast and as accurate. Accuracies that differ by less
than a few per cent count as the same: differences in round-off make no front.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

GAIN = 0.05
"""Share of the error that a costlier setting must save to be on the front."""
NOISE = 0.1
"""Share of a time that repeated measurements differ by."""
TARGETS = (0.05, 0.01, 0.001)
"""Accuracies for which the cheapest setting is named."""


def pareto_front(seconds: npt.ArrayLike, errors: npt.ArrayLike, *, gain: float = GAIN) -> list[int]:
    """Positions of the points that no other point dominates, fastest first.

    Of points equal in both the first one is taken. Points that are not finite are left out.

    Args:
        seconds: Cost of each point, shape (n,).
        errors: Error of each point, shape (n,).
        gain: Share of the error that a costlier point must save.
    """
    t, e = np.asarray(seconds, dtype=float), np.asarray(errors, dtype=float)
    best, out = np.inf, []
    for i in np.lexsort((np.arange(len(t)), e, t)):
        if np.isfinite(t[i]) and np.isfinite(e[i]) and e[i] < best:
            best = float(e[i]) * (1.0 - gain)
            out.append(int(i))
    return out


def cheapest(seconds: npt.ArrayLike, errors: npt.ArrayLike, target: float) -> int | None:
    """Position of the fastest point with an error of at most ``target``; ``None`` if there is none.

    Among points as fast within the noise of a measurement the most accurate counts, among those as
    accurate the first.

    Args:
        seconds: Cost of each point, shape (n,).
        errors: Error of each point, its uncertainty included, shape (n,); the simplest first.
        target: Largest error, relative.
    """
    t, e = np.asarray(seconds, dtype=float), np.asarray(errors, dtype=float)
    good = (e <= target) & np.isfinite(t)
    if not good.any():
        return None
    good &= t <= (1.0 + NOISE) * t[good].min()
    good &= e <= (1.0 + GAIN) * e[good].min()
    return int(np.argmax(good))


def percent(share: float) -> str:
    """A share as per cent in two digits."""
    return f"{100.0 * share:.2g} %"


def duration(seconds: float) -> str:
    """Seconds in two digits, with a unit."""
    if seconds < 0.0995:
        return f"{1e3 * seconds:.2g} ms"
    return f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds:.0f} s"


def advice(
    names: Sequence[str],
    seconds: npt.ArrayLike,
    errors: npt.ArrayLike,
    *,
    targets: Sequence[float] = TARGETS,
    uncertainty: float = 0.0,
) -> str:
    """One sentence: the cheapest setting for each accuracy, or that none reached it.

    Args:
        names: What the points are, shape (n,).
        seconds: Their cost, shape (n,).
        errors: Their errors, shape (n,).
        targets: Accuracies, coarse to fine.
        uncertainty: How well the reference is known; counted as error.
    """
    t, e = np.asarray(seconds, dtype=float), np.asarray(errors, dtype=float) + uncertainty
    parts: list[str] = []
    found: list[tuple[int | None, list[str]]] = []
    for target in targets:
        i = cheapest(t, e, target)
        if found and found[-1][0] == i:
            found[-1][1].append(percent(target))
        else:
            found.append((i, [percent(target)]))
    for i, reached in found:
        words = " and ".join(reached)
        if i is None:
            known = np.any(np.isfinite(e))
            best = f" (the best has {percent(float(np.nanmin(e)))})" if known else ""
            parts.append(f"none reached {words}{best}")
        else:
            parts.append(f"for {words} use {names[i]} ({duration(float(t[i]))})")
    sentence = "; ".join(parts) + "."
    return sentence[0].upper() + sentence[1:]
