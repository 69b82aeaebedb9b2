"""What errors are counted from: an exact closed form, or what the study's own finest runs tend to.

The second needs no theory: on each line of settings that differ in size alone, the values are
extrapolated to size zero, v(h) = v0 + c h^p. The line that changes least between its two finest
sizes is the reference. How far the limits of the next best lines are from it, if they change not
much more, says how well it is known; else the correction by the extrapolation does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fxcrack.accuracy.prediction import extrapolate
from fxcrack.accuracy.study import Setting

MAIN = ("load", "G", "length")
"""Quantities whose largest error counts by default."""
_OTHERS = 2
"""How many lines beside the best say how well it is known."""
_COMPARABLE = 3.0
"""Lines that change more than so many times as much as the best one are not compared with it."""
_TOLD = 3
"""Sizes a line needs to be trusted; two are taken only where no line has more."""

Values = Mapping[str, float]


@dataclass(frozen=True)
class Reference:
    """What errors are counted from.

    Attributes:
        source: In words.
        values: Reference values by quantity.
        uncertainty: How well they are known, relative, by quantity.
        exact: Whether they come from an exact closed form.
    """

    source: str
    values: Values
    uncertainty: Values = field(default_factory=dict)
    exact: bool = False

    def errors(self, values: Values) -> dict[str, float]:
        """Relative errors of what was measured, by quantity that has a reference."""
        return {
            name: abs(values[name] / want - 1.0)
            for name, want in self.values.items()
            if name in values and want != 0.0
        }


def own_reference(runs: Sequence[tuple[Setting, Values]], stepping: str) -> Reference | None:
    """The reference that a study's runs give themselves.

    Args:
        runs: Settings with their values.
        stepping: The stepping without an error of its own; other runs are not considered.

    Returns:
        ``None`` if no line has two sizes.
    """
    lines: dict[Setting, list[tuple[float, Values]]] = {}
    for setting, values in runs:
        if setting.stepping == stepping and setting.tolerance is None:
            lines.setdefault(setting.line, []).append((setting.size, values))
    limits = []
    most = max((len(points) for points in lines.values()), default=0)
    for line, points in lines.items():
        points.sort(key=lambda p: -p[0])
        if len(points) < min(max(most, 2), _TOLD):
            continue
        sizes = [size for size, _ in points]
        names = [n for n in points[-1][1] if all(n in values for _, values in points)]
        found = {n: extrapolate(sizes, [values[n] for _, values in points]) for n in names}
        limit = {n: v for n, (v, _, _) in found.items() if v != 0.0}
        main = [n for n in limit if n in MAIN] or list(limit)
        if main:
            last, before = (points[i][1] for i in (-1, -2))
            change = max(abs((last[n] - before[n]) / limit[n]) for n in main)
            shares = {n: abs(found[n][2] / limit[n]) for n in limit}
            limits.append((change, line, sizes, limit, shares))
    if not limits:
        return None
    limits.sort(key=lambda entry: entry[0])
    _, line, sizes, limit, shares = limits[0]
    near = _COMPARABLE * limits[0][0]
    beside = [
        other
        for change, _, points, other, _ in limits[1:]
        if len(points) >= _TOLD and change <= near
    ][:_OTHERS]
    uncertainty = {
        n: max((abs(o[n] / v - 1.0) for o in beside if n in o), default=shares[n])
        for n, v in limit.items()
    }
    used = ", ".join(f"{s:g}" for s in sizes[-3:])
    return Reference(
        f"the study's own finest runs: {line.title}, sizes {used} extrapolated to 0",
        limit,
        uncertainty,
    )


def reference(
    runs: Sequence[tuple[Setting, Values]], theory: Mapping[str, object] | None, stepping: str
) -> Reference | None:
    """The exact closed form if there is one, else :func:`own_reference`.

    Args:
        runs: Settings with their values.
        theory: Closed form as the worker reports it.
        stepping: The stepping without an error of its own.
    """
    if theory is not None and theory["exact"]:
        values = theory["values"]
        assert isinstance(values, Mapping)
        return Reference(f"exact closed form: {theory['source']}", dict(values), exact=True)
    return own_reference(runs, stepping)


def worst(errors: Values, measure: str) -> float:
    """The error that counts: the largest of load, G and length, or that of one quantity."""
    if measure != "worst":
        return errors.get(measure, float("nan"))
    return max((e for name, e in errors.items() if name in MAIN), default=float("nan"))
