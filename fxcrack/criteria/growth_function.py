"""A user's own law of fatigue growth, and what may be given as a law."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import cast

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import missing_members, shown
from fxcrack.base.errors import InputError
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.fatigue_law import FatigueLaw, Regime, UserFunction


@dataclass(frozen=True)
class GrowthFunction:
    """A law given as a function; what ``growth=`` of a criterion makes of one.

    Growth starts at once. There is none where the function returns zero, and the element is passed
    in one cycle where G_max reaches G_c.

    Attributes:
        function: da/dN = function(cycle), of shape (n,) [length per cycle], finite and not
            negative, for a :class:`CycleRates` of n front nodes. Each value must depend on its own
            node alone.
    """

    function: UserFunction

    def __post_init__(self) -> None:
        """Check that the function takes one argument.

        Raises:
            InputError: It does not.
        """
        try:
            inspect.signature(self.function).bind(None)
        except ValueError:
            return  # a builtin without signature
        except TypeError:
            raise InputError(
                f"growth = {self._name} must be a function of one cycle (fx.CycleRates: dG, G_max, "
                "G_min, R, G_c, shear, tear, modes) that returns da/dN"
            ) from None

    @property
    def _name(self) -> str:
        return str(getattr(self.function, "__name__", self.function))

    def life_exponent(self, toughness: float) -> float:
        """Steepest rise of growth with G in mode I between G_c/10 and G_c at R = 0, at least 1.

        Args:
            toughness: G_c [force/length].
        """
        g = toughness * np.geomspace(0.1, 1.0, _LEVELS)
        rate = self.growth(CycleRates(g, g, np.full_like(g, toughness)))
        grows = (rate[1:] > 0.0) & (rate[:-1] > 0.0)
        slopes = np.diff(np.log(np.where(rate > 0.0, rate, 1.0))) / np.diff(np.log(g))
        return float(slopes[grows].max(initial=1.0))

    def onset(self, cycle: CycleRates) -> Array:
        """Zero, shape (n,)."""
        return np.zeros(cycle.dG.shape)

    def growth(self, cycle: CycleRates) -> Array:
        """Growth da/dN, shape (n,) [length per cycle].

        Raises:
            InputError: The function fails, or returns another shape, NaN or negative values.
        """
        n = cycle.dG.shape
        try:
            found = np.asarray(self.function(cycle))
        except Exception as error:  # whatever the user's function may raise
            raise InputError(
                f"growth: the function {self._name} fails: {type(error).__name__}: {error}; it "
                f"gets a cycle whose arrays have shape {n} and must return da/dN of that shape"
            ) from error
        if found.dtype.kind not in "fiu":
            raise InputError(
                f"growth: {self._name} returned values of type {found.dtype}, not numbers"
            )
        if found.shape != n:
            raise InputError(
                f"growth: {self._name} returned shape {found.shape} for a cycle of shape {n}; "
                "it must return da/dN for each"
            )
        bad = np.flatnonzero(~(np.isfinite(found) & (found >= 0.0)))
        if bad.size:
            i = int(bad[0])
            raise InputError(
                f"growth: {self._name} returned da/dN = {found[i]:g} for dG = {cycle.dG[i]:g}, "
                f"G_max = {cycle.G_max[i]:g}; it must be finite and not negative"
            )
        return found.astype(np.float64)

    def regimes(self, cycle: CycleRates) -> Ints:
        """Regime of each front node, shape (n,)."""
        grows = np.where(self.growth(cycle) > 0.0, int(Regime.PARIS), int(Regime.NONE))
        return np.where(cycle.G_max >= cycle.G_c, int(Regime.UNSTABLE), grows)


_LEVELS = 25
"""Levels of G at which the rise of a function of the user is looked at."""


def fatigue_law_of(owner: str, law: FatigueLaw | UserFunction) -> FatigueLaw:
    """A law from what a user gave as ``growth``: a law, or a function of the cycle.

    Args:
        owner: Name of the criterion, for messages.
        law: A law, or da/dN as a function, see :class:`GrowthFunction`.

    Raises:
        InputError: It is neither.
    """
    if not hasattr(law, "growth") and callable(law) and not isinstance(law, type):
        return GrowthFunction(law)
    missing = missing_members(law, FatigueLaw)
    if missing:
        raise InputError(
            f"{owner}: growth = {shown(law)} is no law of fatigue growth; give Paris(...), "
            "ParisK(...), Blanco(...), KenaneBenzeggagh(...) or a function of the cycle that "
            f"returns da/dN ({missing})"
        )
    return cast(FatigueLaw, law)
