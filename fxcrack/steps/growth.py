"""A criterion at the tips of one interface: energy release rates and f, also along a load path.

Between two equilibria of the same states bond forces and openings are linear, F(x) and w(x), so
the rates are quadratic in x and the place where f reaches 1 is found without another solve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.criteria import VCCT, closure_rates, energy_release_rates
from fxcrack.interface.extent import CrackExtent
from fxcrack.interface.front import Tips
from fxcrack.interface.pairing import Interface
from fxcrack.solve.condensed import CondensedModel
from fxcrack.solve.jump_system import Equilibrium

Array = npt.NDArray[np.float64]

_TIE = 1e-6
"""Front nodes whose f lies within this fraction of the largest one are let go together."""


@dataclass(frozen=True, eq=False)
class Debond:
    """An interface and the criterion by which it comes apart.

    Args:
        interface: Where.
        criterion: When.
    """

    interface: Interface
    criterion: VCCT


@dataclass(frozen=True)
class TipValues:
    """What the criterion says at the tips of one interface.

    Attributes:
        tips: Front nodes.
        rates: Energy release rates I, II, III, shape (n, 3), force/length.
        f: Criterion, shape (n,).
    """

    tips: Tips
    rates: Array
    f: Array

    @property
    def largest(self) -> int:
        """Position of the critical tip."""
        return int(np.argmax(self.f))


class Growth:
    """Evaluates one debond on a condensed model.

    Args:
        model: The model.
        p: Number of the pair.
        debond: Interface and criterion.
    """

    def __init__(self, model: CondensedModel, p: int, debond: Debond) -> None:
        self.model = model
        self.p = p
        self.title = debond.interface.title
        self.criterion = debond.criterion
        self.front = model.fronts[p]
        self.extent = CrackExtent(self.front)
        surface = self.front.surface
        self._toughness = self.criterion.toughness_at(
            surface.x[:, : model.continuum.gdim], np.arange(surface.n_nodes), n_slave=surface.n_nodes
        )
        self.n_released = 0

    def tips(self) -> Tips:
        """Present front."""
        return self.front.tips()

    def products(self, tips: Tips, state: Equilibrium) -> tuple[Array, Array]:
        """Tip forces and what they are multiplied with, both linear in the load, (n, k, 3)."""
        force = self.model.bond_forces(self.p, tips, state)
        if self.criterion.method == "closure":
            return force, self.model.closure_jumps(self.p, tips, force)
        return force, self.model.openings(self.p, tips, state)

    def rates(self, tips: Tips, force: Array, opening: Array) -> Array:
        """Energy release rates, shape (n, 3)."""
        if self.criterion.method == "closure":
            return closure_rates(force, opening, tips.area)
        return energy_release_rates(
            force, opening, tips.d_ahead, tips.d_behind, tips.width,
            normalisation=self.criterion.normalisation,
        )  # fmt: skip

    def evaluate(self, tips: Tips, state: Equilibrium) -> TipValues:
        """Rates and f at the tips."""
        if not len(tips):
            return TipValues(tips, np.zeros((0, 3)), np.zeros(0))
        rates = self.rates(tips, *self.products(tips, state))
        return TipValues(tips, rates, self.criterion.ratio(rates, self._toughness[tips.node]))

    def crossing(
        self, tips: Tips, a: Equilibrium, b: Equilibrium, *, upward: bool = True
    ) -> float | None:
        """First fraction of the linear way from a to b at which the largest f crosses 1."""
        if not len(tips):
            return None
        ends = [self.products(tips, s) for s in (a, b)]
        toughness = self._toughness[tips.node]
        n = len(tips)

        def largest(x: Array) -> Array:
            many = [
                np.concatenate([(1.0 - y) * ends[0][k] + y * ends[1][k] for y in x])
                for k in (0, 1)
            ]
            repeat = _repeat(tips, len(x))
            rates = self.rates(repeat, many[0], many[1])
            f = self.criterion.ratio(rates, np.tile(toughness, (len(x), 1)))
            return np.asarray(f.reshape(len(x), n).max(axis=1))

        grid = np.linspace(0.0, 1.0, 9)
        root = np.sqrt(largest(grid)) - 1.0
        passed = root >= 0.0 if upward else root <= 0.0
        if not passed.any():
            return None
        k = int(np.argmax(passed))
        if k == 0:
            return 0.0
        low, high, f_low, f_high = grid[k - 1], grid[k], root[k - 1], root[k]
        for _ in range(60):
            # sqrt(f) is linear for proportional loads: the secant hits at once
            x = low - f_low * (high - low) / (f_high - f_low)
            if not low < x < high:
                break
            value = float(np.sqrt(largest(np.array([x]))[0]) - 1.0)
            if abs(value) < 4e-15:
                return float(x)
            if (value >= 0.0) == upward:
                high, f_high, f_low = x, value, 0.5 * f_low
            else:
                low, f_low, f_high = x, value, 0.5 * f_high
            if high - low < 1e-15:
                break
        return float(high)

    def ready(self, values: TipValues, level: float = 1.0) -> npt.NDArray[np.int64]:
        """Positions of the tips to let go: the critical one and those tied with it."""
        if not len(values.f) or values.f.max() < level * (1.0 - 1e-9):
            return np.zeros(0, dtype=np.int64)
        return np.flatnonzero(values.f >= values.f.max() * (1.0 - _TIE))


def _repeat(tips: Tips, times: int) -> Tips:
    """The same tips several times over, as far as rates need them."""
    if times == 1:
        return tips
    return Tips(
        tips.node, tips.force_nodes, tips.wake_nodes, tips.wake_weights, tips.frame,
        np.tile(tips.d_ahead, times), np.tile(tips.d_behind, times),
        np.tile(tips.width, times), np.tile(tips.area, times),
    )  # fmt: skip
