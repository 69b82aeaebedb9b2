"""Values of a criterion at the tips of one interface.

An evaluator measures quantities at the tips that are linear between two equilibria of the same
states (bond forces, openings, tractions, time), and turns them into f and what the history
reports. So the place where f reaches 1 on a linear piece is found without another solve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.base.roots import bracketed_root
from fxcrack.criteria.probe import FrontProbe, State, bond_forces, openings
from fxcrack.criteria.release_laws import ReleaseLaw
from fxcrack.equilibrium.cohesive_law import CohesiveUnit
from fxcrack.interface.tips import FrontUnits, Tips


@dataclass(frozen=True)
class TipValues:
    """Values of the criterion at the tips of one interface.

    Attributes:
        tips: Front nodes.
        f: Criterion, shape (n,).
        report: Quantities behind it by name, each of shape (n,), e.g. GI, GII, GIII.
        measured: What f was found from, shape (n, m), if it is to be used again.
        state: The equilibrium it belongs to.
    """

    tips: Tips
    f: Array
    report: dict[str, Array]
    measured: Array | None = None
    state: State | None = None

    @property
    def largest(self) -> int:
        """Position of the critical tip: the first of those whose f differ by round-off only."""
        top = self.f.max()
        return int(np.argmax(self.f >= top - 1e-9 * abs(top)))


class Evaluator(Protocol):
    """A criterion applied to a model.

    Attributes:
        ahead: Distance ahead of a tip whose bond forces are needed, length.
        behind: Distance behind a tip whose openings are needed, length.
        ends: Time after which nothing grows any more.
        toughness: Toughness by mode of the slave nodes when the analysis begins, shape (n_nodes, 3)
            [force/length], so that a restart detects a change; None without.
    """

    ahead: float = 0.0
    behind: float = 0.0
    ends: float = float("inf")
    toughness: Array | None = None

    @property
    def degree(self) -> float | None:
        """Power of a proportional load with which f grows; None where it does not so."""
        return None

    def measure(self, tips: Tips, state: State, time: float) -> Array:
        """Quantities linear between equilibria, shape (n_tips, m)."""
        ...

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """Values f and report.

        Args:
            tips: Front nodes.
            measured: From :meth:`measure`, or linear between such values, shape (n_tips, m).

        Returns:
            f, shape (n_tips,), and quantities behind it by name, each of shape (n_tips,).
        """
        ...

    def needs(self, tips: Tips) -> Ints:
        """Slave nodes beyond force and wake nodes whose jumps must be retained, shape (m,)."""
        return np.zeros(0, dtype=np.int64)

    def breaks(self) -> tuple[float, ...]:
        """Times at which the rate of what is measured changes."""
        return ()


class SofteningEvaluator(Evaluator, Protocol):
    """An evaluator that knows the energy which released bonds dissipate."""

    def units(self, tips: Tips) -> FrontUnits:
        """Tips that are released together, by one law."""
        ...

    def to_soften(self, nodes: Ints, values: TipValues, release: ReleaseLaw) -> list[CohesiveUnit]:
        """Nodes that soften by one law each, and the energy it dissipates until they are free.

        Args:
            nodes: All nodes that are released now, shape (n,).
            values: Values of the criterion at the front they are part of.
            release: How they are released.
        """
        ...


_AT_ONE = 4e-15
"""How near to 1 a power of f is at a crossing."""
_NARROWINGS = 24
"""Times an interval of 8 parts is divided in 4: a dip of 1e-14 of a piece is found."""
_ROUND_OFF = 1e-13
"""Differences below this fraction of the largest value do not make a path bend."""


def repeat_tips(tips: Tips, times: int) -> Tips:
    """The same tips several times over, first all of them once, then again."""
    if times == 1:
        return tips

    def tile(a: Any) -> Any:
        return np.tile(a, (times,) + (1,) * (a.ndim - 1))

    return Tips(**{name: tile(getattr(tips, name)) for name in Tips.__dataclass_fields__})


def first_tips(tips: Tips, n: int) -> Tips:
    """The first tips alone."""
    return tips if n == len(tips) else at_rows(tips, np.arange(n))


def at_rows(tips: Tips, rows: Ints) -> Tips:
    """Some of the tips, those at positions of shape (m,)."""
    return Tips(**{name: getattr(tips, name)[rows] for name in Tips.__dataclass_fields__})


def first_crossing(
    evaluator: Evaluator,
    tips: Tips,
    ends: tuple[tuple[State, float], tuple[State, float]],
    *,
    upward: bool = True,
    known: TipValues | None = None,
) -> float | None:
    """First fraction of a linear piece at which the largest f crosses 1.

    Args:
        evaluator: The criterion.
        tips: Front nodes.
        ends: State and time at both ends.
        upward: Look for f rising to 1, or falling to it.
        known: What was found before, perhaps at the first end.

    Returns:
        Fraction between 0 and 1, ``None`` if f stays on its side.
    """
    if not len(tips):
        return None
    a, b = (
        known.measured
        if known is not None and known.measured is not None and known.state is state
        else evaluator.measure(tips, state, time)
        for state, time in ends
    )
    n = len(tips)
    degree = evaluator.degree
    if degree is not None and known is not None and known.measured is a and known.f.max() > 0.0:
        scale = float(np.vdot(a, b) / np.vdot(a, a))
        if np.abs(b - scale * a).max() <= _ROUND_OFF * np.abs(b).max():
            # proportional: f grows with a power of the load
            rise = known.f.max() ** (-1.0 / degree) - 1.0
            if rise >= 0.0 and not upward:
                return 0.0  # below 1 already
            x = rise / (scale - 1.0) if scale != 1.0 else np.inf
            return float(x) if 0.0 <= x <= 1.0 else None

    # f^(1/degree) is linear under a proportional load; without a degree that of rates is usual
    power = 0.5 if degree is None else 1.0 / degree

    def excess(x: Array) -> Array:
        many = np.concatenate([(1.0 - y) * a + y * b for y in x])
        f, _ = evaluator.value(repeat_tips(tips, len(x)), many)
        largest = np.maximum(f.reshape(len(x), n).max(axis=1), 0.0)
        return np.asarray(largest**power - 1.0)

    grid = np.linspace(0.0, 1.0, 9)
    values = excess(grid)
    if not upward and not (values <= 0.0).any():
        grid, values = _around_least(excess, grid, values)
    passed = values >= 0.0 if upward else values <= 0.0
    if not passed.any():
        return None
    k = int(np.argmax(passed))
    if k == 0:
        return 0.0
    return bracketed_root(
        lambda x: float(excess(np.array([x]))[0]),
        *map(float, (grid[k - 1], grid[k], values[k - 1], values[k])),
        close=_AT_ONE,
    )


def _around_least(
    excess: Callable[[Array], Array], grid: Array, values: Array
) -> tuple[Array, Array]:
    """Values nearer to where a function that falls and rises again is least, until one is <= 0.

    Beside constant loads f falls as the proportional load goes back, and rises again where that
    load acts the other way round: it may be below 1 between two places at which it is above.

    Args:
        excess: The function of places, shape (m,) to (m,).
        grid: Places, increasing, shape (n,).
        values: Its values there, all positive, shape (n,).

    Returns:
        Places that begin and end as those given do, and the values there.
    """
    first, last = (grid[0], values[0]), (grid[-1], values[-1])
    for _ in range(_NARROWINGS):
        k = int(np.argmin(values))
        low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
        grid = np.linspace(low, high, 9)
        values = excess(grid)
        if (values <= 0.0).any() or high - low <= _ROUND_OFF * high:
            break
    places = np.concatenate([[first[0]], grid, [last[0]]])
    return places, np.concatenate([[first[1]], values, [last[1]]])


class TipEvaluator(Evaluator):
    """A criterion that is a function of bond forces and openings at the tips.

    Args:
        probe: The interface.
        function: Called with the tips, their bond forces (tension positive) and the openings behind
            them, both as (normal, growth direction, front tangent) of shape (n, k, 3), k = 1 or,
            for second order, 2 (corner, midside) [force, length]. It returns f of shape (n,), or f
            and a dictionary of arrays of shape (n,) that the history reports. f must not depend on
            the other tips of the call.
        degree: Power of a proportional load with which f grows; None if it is no power.
    """

    def __init__(
        self,
        probe: FrontProbe,
        function: Callable[[Tips, Array, Array], Array | tuple[Array, dict[str, Array]]],
        degree: float | None = None,
    ) -> None:
        self.probe = probe
        self._function = function
        self._degree = degree

    @property
    def degree(self) -> float | None:
        """As given."""
        return self._degree

    def measure(self, tips: Tips, state: State, time: float) -> Array:
        """Forces [force] and openings [length] in the tip frames, shape (n, 6 k)."""
        both = bond_forces(self.probe, tips, state), openings(self.probe, tips, state)
        return np.concatenate([x.reshape(len(tips), -1) for x in both], axis=1)

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """Values f and report of the function, each of shape (n,).

        Args:
            tips: Front nodes.
            measured: From :meth:`measure`, shape (n, 6 k).

        Raises:
            InputError: The function fails, f has another shape than (n,) or is NaN, or what it
                reports is no array of numbers of that shape.
        """
        n = len(tips)
        where = f"interface '{self.probe.pair.title}'"
        force, opening = np.split(measured, 2, axis=1)
        try:
            found = self._function(tips, force.reshape(n, -1, 3), opening.reshape(n, -1, 3))
            f, report = found if isinstance(found, tuple) else (found, {})
            f = np.asarray(f, dtype=np.float64)
            report = {name: np.asarray(v, dtype=np.float64) for name, v in dict(report).items()}
        except Exception as error:  # whatever the user's function may raise
            raise InputError(
                f"{where}: the function of the criterion fails with {type(error).__name__}: "
                f"{error}; it is called with the tips and arrays of shape ({n}, k, 3) of forces "
                "and openings, and returns f, or f and a dictionary of arrays"
            ) from error
        if f.shape != (n,) or np.isnan(f).any():
            what = f"has shape {f.shape}" if f.shape != (n,) else "is NaN"
            raise InputError(
                f"{where}: f of the criterion {what}; its function "
                f"must return one number per tip, shape ({n},), or such an array and a dictionary"
            )
        for name, values in report.items():
            if values.shape != (n,):
                raise InputError(
                    f"{where}: the criterion reports '{name}' of shape {values.shape}; it must be "
                    f"an array of one number per tip, shape ({n},)"
                )
        return f, report
