"""What a criterion says at the tips of one interface.

An evaluator measures quantities at the tips that are linear between two equilibria of the same
states (bond forces, openings, tractions, time), and turns them into f and what the history
reports. So the place where f reaches 1 on a linear piece is found without another solve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from fxcrack.criteria import (
    EnhancedVCCT,
    Ramp,
    RateCriterion,
    Release,
    closure_rates,
)
from fxcrack.criteria.mixed_mode import total
from fxcrack.criteria.vcct import closure_weights, weighted_rates
from fxcrack.interface.tip import Tips
from fxcrack.interface.units import FrontUnits, edge_midsides, units_of
from fxcrack.solve.cholesky import NotPositiveDefinite
from fxcrack.solve.condensed import CondensedModel
from fxcrack.solve.jump_system import Equilibrium
from fxcrack.solve.soft_bond import SoftUnit
from fxcrack.solve.tips import bond_forces, closure_jumps, openings
from fxcrack.steps.interface_temperature import InterfaceTemperature

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class TipValues:
    """What the criterion says at the tips of one interface.

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
    state: Equilibrium | None = None

    @property
    def largest(self) -> int:
        """Position of the critical tip: the first of those whose f differ by round-off only."""
        top = self.f.max()
        return int(np.argmax(self.f >= top - 1e-9 * abs(top)))


class Evaluator(Protocol):
    """A criterion applied to a model.

    Attributes:
        degree: f grows with this power of a proportional load.
        ahead: Distance ahead of a tip whose bond forces are needed, length.
        behind: Distance behind a tip whose openings are needed, length.
    """

    degree: int
    ahead: float
    behind: float

    def measure(self, tips: Tips, state: Equilibrium, time: float) -> Array:
        """Quantities linear between equilibria, shape (n_tips, m)."""

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """F and report from measured quantities, shape (n_tips, m)."""

    def needs(self, tips: Tips) -> Ints:
        """Slave nodes beyond force and wake nodes whose jumps the window must hold."""

    def breaks(self) -> tuple[float, ...]:
        """Times at which what is measured bends."""


class RateEvaluator:
    """Energy release rates by crack closure, for VCCT and the criteria built on it.

    Args:
        model: Condensed model.
        p: Number of the pair.
        criterion: Criterion with toughness and mode mix.
        temperature: Temperature of the slave nodes; None without.
        softens: Whether bonds soften with their opening: second-order fronts then let go by element
            edges, and f is that of the edge.
    """

    degree = 2
    ahead = 0.0
    behind = 0.0

    def __init__(
        self,
        model: CondensedModel,
        p: int,
        criterion: RateCriterion,
        temperature: InterfaceTemperature | None = None,
        *,
        softens: bool = False,
    ) -> None:
        self.model = model
        self.p = p
        self.criterion = criterion
        self._edges = edge_midsides(model.fronts[p].surface) if softens else {}
        self._grouped: tuple[Tips, FrontUnits] | None = None
        self._weighed: Tips | None = None
        self._weights = np.zeros((0, 1))
        surface = model.pairs[p].surface
        criterion.check_slaves(surface.n_nodes)
        x = surface.x[:, : model.continuum.gdim]
        self._temperature = temperature
        self._moving = temperature is not None and not temperature.steady
        at_start = None if temperature is None else temperature(0.0)
        self.toughness = criterion.toughness_at(x, np.arange(len(x)), at_start, n_slave=len(x))

    def measure(self, tips: Tips, state: Equilibrium, time: float) -> Array:
        """Tip forces and the openings they are multiplied with, shape (n, 6 k).

        A last column holds the temperature of the tips where it changes in time.
        """
        force = bond_forces(self.model, self.p, tips, state)
        if self.criterion.method == "closure":
            opening = closure_jumps(self.model, self.p, tips, force)
        else:
            opening = openings(self.model, self.p, tips, state)
            if force.shape[1] == 2:
                # on a ring the midside force belongs to its own circumference
                breadth = self.model.fronts[self.p].surface.breadth
                force[:, 1] *= (breadth[tips.node] / breadth[tips.force_nodes[:, 1]])[:, None]
        columns = [force.reshape(len(tips), -1), opening.reshape(len(tips), -1)]
        if self._moving and self._temperature is not None:
            columns.append(self._temperature(time)[tips.node, None])
        return np.concatenate(columns, 1)

    def rates(self, tips: Tips, measured: Array) -> Array:
        """Energy release rates by mode, shape (n, 3), force/length."""
        half = measured.shape[1] // 2
        force, opening = (
            m.reshape(len(tips), -1, 3) for m in (measured[:, :half], measured[:, half : 2 * half])
        )
        force = _real(force)
        if self.criterion.method == "closure":
            return closure_rates(force, opening, tips.area)
        if tips is not self._weighed:
            lengths = (tips.d_ahead, tips.d_behind, tips.width)
            self._weights = closure_weights(*lengths, force.shape[1], self.criterion.normalisation)
            self._weighed = tips
        return weighted_rates(force, opening, self._weights)

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """F and GI, GII, GIII."""
        rates = self.rates(tips, measured)
        toughness = self._toughness(tips, measured)
        report = dict(zip(("GI", "GII", "GIII"), rates.T, strict=True))
        if not self._edges:
            return self.criterion.ratio(rates, toughness), report
        units = self.units(tips)
        n = units.shares.shape[1]
        rates, toughness = (units.mean(v.reshape(-1, n, 3)) for v in (rates, toughness))
        f = self.criterion.ratio(rates.reshape(-1, 3), toughness.reshape(-1, 3))
        return units.at_tips(f.reshape(rates.shape[:2])).ravel(), report

    def units(self, tips: Tips) -> FrontUnits:
        """Tips that let go together; of tips that were repeated, those of the first time."""
        if self._grouped is None or self._grouped[0] is not tips:
            once = np.unique(tips.node).size
            self._grouped = tips, units_of(self._edges, first_tips(tips, once))
        return self._grouped[1]

    def _tip_temperature(self, tips: Tips, measured: Array | None) -> Array | None:
        if self._temperature is None:
            return None
        if self._moving and measured is not None:
            return measured[:, -1]
        return self._temperature(0.0)[tips.node]

    def _toughness(self, tips: Tips, measured: Array | None) -> Array:
        """Toughness by mode at the tips, shape (n, 3), force/length."""
        if not self._moving or measured is None:
            return self.toughness[tips.node]
        surface = self.model.pairs[self.p].surface
        x = surface.x[tips.node, : self.model.continuum.gdim]
        return self.criterion.toughness_at(x, tips.node, measured[:, -1], n_slave=surface.n_nodes)

    def to_soften(self, nodes: Ints, values: TipValues, release: Release) -> list[SoftUnit]:
        """Nodes that soften by one law each, and the energy it dissipates until they are free.

        All nodes of a unit share a law: their forces, pressed ones included, fall in proportion,
        and together they spend what the area of the unit asks for.

        Args:
            nodes: All nodes that let go now, shape (n,).
            values: What the criterion says at the front they are part of.
            release: How they let go.

        Raises:
            NotPositiveDefinite: A body would come free: without bound is what its last unit frees.
        """
        surface = self.model.fronts[self.p].surface
        tips, units = values.tips, self.units(values.tips)
        rates = np.stack([values.report[k] for k in ("GI", "GII", "GIII")], axis=1)
        toughness = self._toughness(tips, values.measured)
        if isinstance(self.criterion, EnhancedVCCT):
            toughness = self.criterion.propagation_toughness_at(
                self.model.pairs[self.p].surface.x[tips.node, : self.model.continuum.gdim],
                tips.node,
                self._tip_temperature(tips, values.measured),
                n_slave=surface.n_nodes,
            )
        rates, toughness = units.mean(rates), units.mean(toughness)
        critical = self.criterion.critical(rates, toughness)
        if isinstance(release, Ramp) and not isinstance(self.criterion, EnhancedVCCT):
            # 1/2 F0 w_c with the opening of the wake: what crack closure calls G A
            critical = total(rates)
        if np.any(critical > UNBOUNDED_RATE * toughness[:, 0]):
            worst = units.leaders[np.argmax(critical)]
            raise NotPositiveDefinite(int(tips.node[worst]))
        out, left = [], np.unique(nodes)
        # a corner row that two edges share goes with the one that is more critical; rows that are
        # to go alone (fatigue) come last
        order = np.argsort(-values.f[units.leaders], kind="stable")
        groups = [(k, units.leaders[k], units.shares[k] > 0.0) for k in order]
        for i in np.setdiff1d(np.arange(len(tips)), units.leaders):
            groups.append((np.argmax(units.shares[:, i]), i, np.arange(len(tips)) == i))
        for k, first, rows in groups:
            if tips.node[first] not in left:
                continue
            unit = np.intersect1d(tips.force_nodes[rows], left)
            left = np.setdiff1d(left, unit)
            energy = float(critical[k] * surface.areas[unit].sum())
            out.append(SoftUnit(unit, energy, bool(rates[k, 0] <= 0.0)))
        return out

    def needs(self, tips: Tips) -> Ints:
        """Nothing beyond the tips themselves."""
        return np.zeros(0, dtype=np.int64)

    def breaks(self) -> tuple[float, ...]:
        """Rates do not depend on time as such; a temperature does."""
        return self._temperature.breaks() if self._temperature is not None else ()


_NO_MODE = 1e-11
"""Forces of a mode below this fraction of the largest are round-off. A mode so weak would have
1e-22 of the rate of the others; alone, beside pressure, it would ask for loads without end."""


def _real(force: Array) -> Array:
    """Bond forces without the modes that are there by round-off alone, shape (n, k, 3)."""
    size = np.abs(force).max(axis=1, initial=0.0)
    none = size < _NO_MODE * size.max(axis=1, keepdims=True, initial=0.0)
    return np.where(none[:, None], 0.0, force)


UNBOUNDED_RATE = 1e50
"""Rates beyond this multiple of the toughness belong to units that hold a body alone."""
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
    if n == len(tips):
        return tips
    return Tips(**{name: getattr(tips, name)[:n] for name in Tips.__dataclass_fields__})


def first_crossing(
    evaluator: Evaluator,
    tips: Tips,
    ends: tuple[tuple[Equilibrium, float], tuple[Equilibrium, float]],
    *,
    upward: bool = True,
    known: TipValues | None = None,
) -> float | None:
    """First fraction of a linear piece at which the largest f crosses 1.

    Args:
        evaluator: The criterion.
        tips: Front nodes.
        ends: Equilibrium and time at both ends.
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
    if known is not None and known.measured is a and known.f.max() > 0.0:
        scale = float(np.vdot(a, b) / np.vdot(a, a))
        if np.abs(b - scale * a).max() <= _ROUND_OFF * np.abs(b).max():
            # proportional: f grows with a power of the load
            rise = known.f.max() ** (-1.0 / evaluator.degree) - 1.0
            x = rise / (scale - 1.0) if scale != 1.0 else np.inf
            return float(x) if 0.0 <= x <= 1.0 else None

    def root(x: Array) -> Array:
        many = np.concatenate([(1.0 - y) * a + y * b for y in x])
        f, _ = evaluator.value(repeat_tips(tips, len(x)), many)
        largest = np.maximum(f.reshape(len(x), n).max(axis=1), 0.0)
        return np.asarray(largest ** (1.0 / evaluator.degree) - 1.0)

    grid = np.linspace(0.0, 1.0, 9)
    values = root(grid)
    passed = values >= 0.0 if upward else values <= 0.0
    if not passed.any():
        return None
    k = int(np.argmax(passed))
    if k == 0:
        return 0.0
    low, high, f_low, f_high = grid[k - 1], grid[k], values[k - 1], values[k]
    for _ in range(60):
        # linear for proportional loads: the secant hits at once (Illinois safeguard otherwise)
        x = low - f_low * (high - low) / (f_high - f_low)
        if not low < x < high:
            break
        value = float(root(np.array([x]))[0])
        if abs(value) < 4e-15:
            return float(x)
        if (value >= 0.0) == upward:
            high, f_high, f_low = x, value, 0.5 * f_low
        else:
            low, f_low, f_high = x, value, 0.5 * f_high
        if high - low < 1e-15:
            break
    return float(high)
