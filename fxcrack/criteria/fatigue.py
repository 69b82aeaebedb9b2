"""Fatigue growth by a Paris law of energy release rates (Paris and Erdogan 1963; ASTM D6115).

With the total rate G at the extremes of a cycle, dG = G_max - G_min, and G_c of the mode-mix law:

    onset    N0 = c1 dG^c2
    growth   da/dN = c3 dG^c4           r1 G_c < G_max < r2 G_c
             none                       G_max <= r1 G_c
             the element in one cycle   G_max >= r2 G_c

One stabilised cycle is solved per release, at the beginning of each element. It is at the same time
the end of the element before, and in between log dG and log G_max are linear in a: the cycles of an
element are the integral

    dN = int da/(c3 dG(a)^c4)

At constant amplitude N(a) is so the integral of the Paris law over G(a).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.checks import finite, flag, keep, keep_floats, not_negative, positive, shown
from fxcrack.base.errors import InputError
from fxcrack.criteria.energy_release import RateCriterion
from fxcrack.criteria.mixed_mode import total


class Regime(IntEnum):
    """Where the largest rate of the cycle lies between threshold and upper limit."""

    NONE = 0
    PARIS = 1
    UNSTABLE = 2


@dataclass(frozen=True)
class Paris:
    """Constants of onset and growth. Their units follow from that of G: [G]^-c2 and length [G]^-c4.

    Attributes:
        c1: Factor of onset [cycles]; 0: growth starts at once.
        c2: Exponent of onset, negative in practice.
        c3: Factor of growth, positive [length per cycle].
        c4: Exponent of growth, positive.
        r1: Threshold over toughness.
        r2: Upper limit of the Paris regime over toughness.
    """

    c1: float
    c2: float
    c3: float
    c4: float
    r1: float = 0.01
    r2: float = 0.85

    def __post_init__(self) -> None:
        """Check the constants."""
        not_negative("Paris", c1=self.c1, r1=self.r1)
        positive("Paris", c3=self.c3, c4=self.c4, r2=self.r2)
        finite("Paris", c2=self.c2)
        keep_floats(self, "c1", "c2", "c3", "c4", "r1", "r2")
        if self.r1 >= self.r2:
            raise InputError(
                f"Paris: threshold r1 = {self.r1} must be below the upper limit r2 = {self.r2}"
            )

    def onset_cycles(self, dG: npt.ArrayLike) -> Array:
        """Cycles N0 until growth starts, of the shape of ``dG`` [force/length]."""
        return _times_power(self.c1, dG, self.c2)

    def growth_rate(self, dG: npt.ArrayLike) -> Array:
        """Growth da/dN in the Paris regime, of the shape of ``dG`` [length per cycle]."""
        return _times_power(self.c3, dG, self.c4)

    def regime(self, G_max: npt.ArrayLike, G_c: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """Regime of each front node, values of :class:`Regime`.

        Args:
            G_max: Largest total rate of the cycle, shape (n,) [force/length].
            G_c: Critical total rate, shape (n,) or one number [force/length].
        """
        top = np.asarray(G_max, dtype=np.float64)
        critical = np.asarray(G_c, dtype=np.float64)
        return np.where(
            top >= self.r2 * critical,
            int(Regime.UNSTABLE),
            np.where(top > self.r1 * critical, int(Regime.PARIS), int(Regime.NONE)),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Fatigue(RateCriterion):
    """Growth under cyclic load by a Paris law. Toughness, mode mix and method as for VCCT.

    Attributes:
        paris: Constants of onset and growth.
        credit: Whether growth of front nodes that are not released is kept for later cycles; else
            each of them starts its element anew.
    """

    paris: Paris
    credit: bool = field(default=False)

    grows_in_cycles: ClassVar[bool] = True

    @property
    def life_exponent(self) -> float:
        """Exponent of growth."""
        return self.paris.c4

    def __post_init__(self) -> None:
        """Check everything that does not need the interface."""
        super().__post_init__()
        if not isinstance(self.paris, Paris):
            raise InputError(
                f"Fatigue: paris = {shown(self.paris)} must be a Paris(c1, c2, c3, c4)"
            )
        keep(self, credit=flag("Fatigue", "credit", self.credit))

    def cycle(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> tuple[Array, Array, Array]:
        """What the laws need from one stabilised cycle.

        Args:
            rates: Energy release rates by mode at m instants of the cycle, its extremes among
                them, shape (m, n, 3) [force/length].
            toughness: Toughness by mode, shape (n, 3) or (3,) [force/length].

        Returns:
            dG, G_max and G_c at the mode mix of G_max, each of shape (n,) [force/length].
        """
        g = np.asarray(rates, dtype=np.float64)
        totals = total(g)
        worst = totals.argmax(axis=0)
        at_worst = np.take_along_axis(g, worst[None, :, None], axis=0)[0]
        top = totals.max(axis=0)
        return top - totals.min(axis=0), top, self.critical(at_worst, toughness)


@dataclass(frozen=True, eq=False)
class CycleJump:
    """What happens at the end of a stabilised cycle.

    Attributes:
        cycles: Cycles N so far, after the jump.
        event: "growth" in the Paris regime; "unstable", at least one node beyond the upper limit;
            "arrest", no node will ever be released; "limit", the allowed cycles are over.
        release: Front nodes to release, shape (n,); none at "arrest" and "limit".
        regime: Regime of each front node, shape (n,).
        initiated: Front nodes at which onset is over, shape (n,).
        credit: Growth of each front node within its element, shape (n,) [length]; 0 for those
            released, None when no growth is kept.
    """

    cycles: float
    event: Literal["growth", "unstable", "arrest", "limit"]
    release: Bools
    regime: npt.NDArray[np.int64]
    initiated: Bools
    credit: Array | None


def cycle_jump(
    paris: Paris,
    dG: npt.ArrayLike,
    G_max: npt.ArrayLike,
    G_c: npt.ArrayLike,
    da: npt.ArrayLike,
    *,
    cycles: float = 0.0,
    initiated: npt.ArrayLike = False,
    credit: npt.ArrayLike | None = None,
    tolerance: float = 0.2,
    limit: float = np.inf,
    short: bool = False,
) -> CycleJump:
    """Jump over the cycles to the next release.

    With N0 counted once, until onset, a node in the Paris regime is released after

        dN = max(N0 - N, 0) + (da - credit)/(c3 dG^c4)

    The jump is the smallest dN; nodes within ``tolerance`` of it are released together. While a
    node is beyond the upper limit the jump is one cycle: those nodes are released, and others that
    finish within it.

    Args:
        paris: Constants of onset and growth.
        dG: Range of the total rate over the cycle, shape (n,) [force/length].
        G_max: Largest total rate of the cycle, shape (n,) [force/length].
        G_c: Critical total rate, shape (n,) or one number [force/length].
        da: Length by which releasing the node moves the front, shape (n,) or one number [length].
        cycles: Cycles N so far.
        initiated: Front nodes at which onset is over, shape (n,) or one truth value. Nodes that
            come to the front by growth are.
        credit: Growth so far within the element of each node, shape (n,) [length]; None when growth
            of nodes that are not released is not kept.
        tolerance: f_tol; nodes with dN <= (1 + f_tol) of the smallest are released together.
        limit: Cycles at which the analysis ends.
        short: Whether the limit is known to come before the next release.

    Returns:
        The jump.

    Raises:
        InputError: There is no front node, a rate is not finite or a length not positive.
    """
    dG, G_max, G_c, da = _front_arrays(dG, G_max, G_c, da)
    n = len(dG)
    onset_over = np.array(np.broadcast_to(np.asarray(initiated, dtype=np.bool_), (n,)))
    grown = np.zeros(n) if credit is None else np.array(credit, dtype=np.float64)
    regime = paris.regime(G_max, G_c)
    rate = np.where(regime == Regime.PARIS, paris.growth_rate(dG), 0.0)
    wait = np.where(onset_over, 0.0, np.maximum(paris.onset_cycles(dG) - cycles, 0.0))
    left = np.maximum(da - grown, 0.0)
    dN = wait + np.divide(left, rate, out=np.full(n, np.inf), where=rate > 0.0)

    beyond = regime == Regime.UNSTABLE
    event: Literal["growth", "unstable", "arrest", "limit"] = "growth"
    if beyond.any():
        event, jump = "unstable", 1.0
        release = beyond | (dN <= jump)
    else:
        jump = float(dN.min())
        release = np.isfinite(dN) & (dN <= (1.0 + tolerance) * jump)
        if not release.any():
            event, jump = "arrest", 0.0
    if cycles + jump > limit or short:
        event, jump, release = "limit", max(limit - cycles, 0.0), np.zeros(n, dtype=np.bool_)

    if credit is not None:
        moving = regime == Regime.PARIS
        grown[moving] += rate[moving] * np.maximum(jump - wait[moving], 0.0)
        grown[release] = 0.0
    onset_over |= release | ((regime == Regime.PARIS) & (wait <= jump))
    return CycleJump(
        cycles=cycles + jump,
        event=event,
        release=release,
        regime=regime,
        initiated=onset_over,
        credit=None if credit is None else grown,
    )


@dataclass(frozen=True)
class Rates:
    """What one stabilised cycle says of some front nodes.

    Attributes:
        dG: Range of the total rate, shape (n,), force/length.
        G_max: Its largest value, likewise.
        G_c: Critical total rate at the mode mix of G_max, likewise.
    """

    dG: Array
    G_max: Array
    G_c: Array

    def at(self, other: Rates, x: npt.ArrayLike) -> Rates:
        """Values on the way to others, log-linear.

        Args:
            other: Values at x = 1.
            x: Part of the way, shape (n,) or (m, n); may lie outside 0 to 1.
        """
        pairs = ((getattr(self, k), getattr(other, k)) for k in ("dG", "G_max", "G_c"))
        return Rates(*(_log_linear(a, b, np.asarray(x, dtype=np.float64)) for a, b in pairs))


def element_cycles(
    paris: Paris,
    begin: Rates,
    end: Rates,
    da: npt.ArrayLike,
    grown: npt.ArrayLike = 0.0,
) -> Array:
    """Cycles in which a front passes an element: the integral of da/(da/dN).

    Rates are log-linear between both ends of the element. Between points the growth rate is, too,
    so a power law is integrated exactly. What lies beyond the upper limit takes no cycles.

    Args:
        paris: Constants of growth.
        begin: Values at the beginning of each element, n of them.
        end: Values at its end.
        da: Length of each element, shape (n,) or one number [length].
        grown: Length of it that is passed already, likewise.

    Returns:
        Shape (n,); inf where the front comes to the threshold within the element.
    """
    n = len(begin.dG)
    da = np.broadcast_to(np.asarray(da, dtype=np.float64), (n,))
    first = np.clip(np.broadcast_to(np.asarray(grown, dtype=np.float64), (n,)) / da, 0.0, 1.0)
    out = np.zeros(n)
    for i in range(n):
        here = Rates(*(getattr(begin, k)[i : i + 1] for k in ("dG", "G_max", "G_c")))
        there = Rates(*(getattr(end, k)[i : i + 1] for k in ("dG", "G_max", "G_c")))
        x = np.linspace(first[i], 1.0, _POINTS)
        x = np.unique(np.append(x, [c for c in _limits(paris, here, there) if first[i] < c < 1.0]))
        middle = here.at(there, 0.5 * (x[1:] + x[:-1])[:, None])
        regime = paris.regime(middle.G_max, middle.G_c)[:, 0]
        if np.any(regime == Regime.NONE):
            out[i] = np.inf
            continue
        with np.errstate(divide="ignore"):
            slow = -np.log(paris.growth_rate(here.at(there, x[:, None]).dG[:, 0]))
        for k in np.flatnonzero(regime == Regime.PARIS):
            out[i] += da[i] * (x[k + 1] - x[k]) * _mean_of_exponential(slow[k], slow[k + 1])
    return out


_POINTS = 17
"""Points at which the growth rate is taken within an element."""


def _limits(paris: Paris, here: Rates, there: Rates) -> list[float]:
    """Parts of an element at which G_max/G_c passes the threshold or the upper limit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (float(np.log(r.G_max[0] / r.G_c[0])) for r in (here, there))
        found = [(np.log(limit) - a) / (b - a) for limit in (paris.r1, paris.r2) if limit > 0.0]
    return [float(x) for x in found if np.isfinite(x)]


def _mean_of_exponential(a: float, b: float) -> float:
    """Mean of exp over the straight way from a to b."""
    if not (np.isfinite(a) and np.isfinite(b)):
        return float("inf")
    difference = b - a
    if abs(difference) < 1e-9:
        return float(np.exp(0.5 * (a + b)))
    return float(np.exp(a) * np.expm1(difference) / difference)


def _log_linear(a: Array, b: Array, x: Array) -> Array:
    """a^(1 - x) b^x; where one of them is zero, linear and not negative."""
    good = (a > 0.0) & (b > 0.0)
    one, two = np.where(good, a, 1.0), np.where(good, b, 1.0)
    straight = np.maximum((1.0 - x) * a + x * b, 0.0)
    return np.where(good, np.exp((1.0 - x) * np.log(one) + x * np.log(two)), straight)


def _front_arrays(*given: npt.ArrayLike) -> list[Array]:
    """The four arrays of a front at their common shape (n,), checked."""
    arrays = [np.asarray(a, dtype=np.float64) for a in np.broadcast_arrays(*map(np.asarray, given))]
    if arrays[0].ndim != 1 or arrays[0].size == 0:
        raise InputError(
            f"fatigue: the front has shape {arrays[0].shape}; give one value per front node, at "
            "least one"
        )
    for name, values in zip(("dG", "G_max", "G_c", "da"), arrays, strict=True):
        good = np.isfinite(values) & (values > 0.0 if name in ("G_c", "da") else values >= 0.0)
        if not good.all():
            row = int(np.flatnonzero(~good)[0])
            raise InputError(
                f"fatigue: {name} = {values[row]} at front node {row}; it must be finite and "
                f"{'positive' if name in ('G_c', 'da') else 'not negative'}"
            )
    return arrays


def _times_power(factor: float, base: npt.ArrayLike, exponent: float) -> Array:
    """``factor * base**exponent`` in logarithms, so that no part of it overflows."""
    b = np.asarray(base, dtype=np.float64)
    if factor == 0.0 or exponent == 0.0:
        return np.full(b.shape, float(factor))
    with np.errstate(divide="ignore", over="ignore", under="ignore"):
        return np.asarray(np.exp(np.log(factor) + exponent * np.log(b)))
