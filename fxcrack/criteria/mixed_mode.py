"""Mode-mix laws: how far a front node with rates (G_I, G_II, G_III) is from growth.

The criterion is f = 1; G_c is the critical total rate at the present mode mix:

    BK      G_c = G_Ic + (G_IIc - G_Ic) B^eta,                  B = (G_II + G_III)/G_T,  f = G_T/G_c
    Reeder  G_c = G_Ic + (G_IIc - G_Ic) B^eta + (G_IIIc - G_IIc) G_III/(G_II + G_III) B^eta
    power   f = (G_I/G_Ic)^am + (G_II/G_IIc)^an + (G_III/G_IIIc)^ao

A user's own law is a function of the rates, :class:`FunctionLaw`. Negative rates count as zero. The
laws above depend on rates only through their ratios to the toughness, so any system of units will
do.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, cast

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import missing_members, positive, shown
from fxcrack.base.errors import InputError


class MixedMode(Protocol):
    """What every mode-mix law can do."""

    @property
    def degree(self) -> float | None:
        """Power of the rates with which f grows when all grow in proportion; None: no power."""
        return None

    def ratio(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Value f of the criterion, shape (n,); growth at 1."""
        ...

    def critical(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Total rate at which growth starts at this mode mix, shape (n,)."""
        ...


def clip(rates: npt.ArrayLike) -> Array:
    """Rates with the negative ones set to zero; NaN stays NaN.

    Args:
        rates: Energy release rates [force/length], any shape.
    """
    return np.maximum(np.asarray(rates, dtype=np.float64), 0.0)


def total(rates: npt.ArrayLike) -> Array:
    """Total rate G_T, the sum over the modes of the clipped rates, shape (n,) [force/length].

    Args:
        rates: Energy release rates by mode, shape (n, 3) [force/length].
    """
    return np.asarray(clip(rates).sum(axis=-1))


@dataclass(frozen=True)
class _ShearExponent(ABC):
    """What the laws have in common that blend toughnesses by the share of shear, B^eta."""

    eta: float

    degree: ClassVar[float] = 1.0

    def __post_init__(self) -> None:
        """Check the exponent."""
        positive(type(self).__name__, eta=self.eta)

    def critical(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Critical total rate at the present mode mix; G_Ic where all rates are zero.

        Args:
            rates: Energy release rates by mode, shape (n, 3) [force/length].
            toughness: G_Ic, G_IIc, G_IIIc, shape (n, 3) or (3,) [force/length].

        Returns:
            Critical rates, shape (n,) [force/length].
        """
        shear, tear = _shares(rates)
        g1, g2, g3 = _by_mode(toughness)
        return _blend(g1, self._in_shear(g2, g3, tear), shear**self.eta)

    def ratio(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Value f = G_T/G_c of the criterion; arguments as for :meth:`critical`.

        Returns:
            Values, shape (n,); 0 where all rates are zero.
        """
        return total(rates) / self.critical(rates, toughness)

    @abstractmethod
    def _in_shear(self, g2: Array, g3: Array, tear: Array) -> Array:
        """Toughness in pure shear of which mode III has a share, shape (n,)."""


@dataclass(frozen=True)
class BK(_ShearExponent):
    """Law of Benzeggagh and Kenane (1996); modes II and III share one toughness.

    Attributes:
        eta: Exponent, positive.
    """

    def _in_shear(self, g2: Array, g3: Array, tear: Array) -> Array:
        return g2


@dataclass(frozen=True)
class Reeder(_ShearExponent):
    """Law of Reeder et al. (2002): BK with a mode III toughness of its own.

    Attributes:
        eta: Exponent, positive.
    """

    def _in_shear(self, g2: Array, g3: Array, tear: Array) -> Array:
        return _blend(g2, g3, tear)


@dataclass(frozen=True)
class Power:
    """Power law of Wu and Reuter (1965).

    Attributes:
        am: Exponent of mode I, positive.
        an: Exponent of mode II, positive.
        ao: Exponent of mode III, positive; that of mode II when not given.
    """

    am: float
    an: float
    ao: float | None = None

    def __post_init__(self) -> None:
        """Check the exponents."""
        positive("Power", am=self.am, an=self.an)
        if self.ao is not None:
            positive("Power", ao=self.ao)

    @property
    def exponents(self) -> Array:
        """The three exponents, shape (3,)."""
        return np.array([self.am, self.an, self.an if self.ao is None else self.ao])

    @property
    def degree(self) -> float | None:
        """The exponent all modes share; None where they differ."""
        first = self.exponents[0]
        return float(first) if np.all(self.exponents == first) else None

    def ratio(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Value f of the criterion, the sum of the powers.

        Args:
            rates: Energy release rates by mode, shape (n, 3) [force/length].
            toughness: G_Ic, G_IIc, G_IIIc, shape (n, 3) or (3,) [force/length].

        Returns:
            Values, shape (n,); 0 where all rates are zero.
        """
        relative = clip(rates) / np.asarray(toughness, dtype=np.float64)
        with np.errstate(over="ignore"):  # infinite f: far beyond growth
            return np.asarray((relative**self.exponents).sum(axis=-1))

    def critical(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Critical total rate at the present mode mix; G_Ic where all rates are zero.

        It is lambda G_T, where rates scaled by lambda give f = 1. So it depends on the mix alone,
        as for the other laws; G_T/f, the same at f = 1, would depend on the load away from it.

        Args:
            rates: Energy release rates by mode, shape (n, 3) [force/length].
            toughness: G_Ic, G_IIc, G_IIIc, shape (n, 3) or (3,) [force/length].

        Returns:
            Critical rates, shape (n,) [force/length].
        """
        shares = _normalised(rates)
        tough = np.broadcast_to(np.asarray(toughness, dtype=np.float64), shares.shape)
        some = shares.max(axis=-1) != 0.0  # NaN counts as some, and stays
        relative = np.where(some[..., None], shares / tough, np.array([1.0, 0.0, 0.0]))
        scale = np.exp(_log_scale_to_one(relative, self.exponents))
        return np.where(some, scale * shares.sum(axis=-1), tough[..., 0])


@dataclass(frozen=True)
class FunctionLaw(MixedMode):
    """A law given as a function; what ``mix=`` of a criterion makes of one.

    Attributes:
        function: f = function(G_I, G_II, G_III, G_Ic, G_IIc, G_IIIc), or of the three rates alone:
            arrays of shape (n,) [force/length] to values of that shape, not negative and rising
            with each rate; growth at 1. Negative rates are given as zero, and f = 0 where all
            are. Each row must not depend on the others.
    """

    function: Callable[..., npt.ArrayLike]
    _n: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Find out how many arguments the function takes.

        Raises:
            InputError: Neither three nor six.
        """
        try:
            signature = inspect.signature(self.function)
        except ValueError:
            signature = inspect.Signature()
        for n in (6, 3):
            try:
                signature.bind(*range(n))
            except TypeError:
                continue
            object.__setattr__(self, "_n", n)
            return
        raise InputError(
            f"mix = {self._name} must be a function of (GI, GII, GIII) or of (GI, GII, GIII, GIc, "
            "GIIc, GIIIc) that returns f"
        )

    @property
    def _name(self) -> str:
        return str(getattr(self.function, "__name__", self.function))

    def ratio(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Value f of the function.

        Args:
            rates: Energy release rates by mode, shape (n, 3) [force/length].
            toughness: G_Ic, G_IIc, G_IIIc, shape (n, 3) or (3,) [force/length].

        Returns:
            Values, shape (n,); 0 where all rates are zero.

        Raises:
            InputError: The function returned another shape, NaN or negative values.
        """
        g = clip(rates)
        tough = np.broadcast_to(np.asarray(toughness, dtype=np.float64), g.shape)
        some = g.max(axis=-1) > 0.0
        # a mode mix is not defined where nothing is released: the function is not called there
        given = np.where(some[..., None], g, tough).reshape(-1, 3)
        arguments = (*given.T, *tough.reshape(-1, 3).T)[: self._n]
        try:
            f = np.asarray(self.function(*arguments))
        except Exception as error:  # whatever the user's function may raise
            raise InputError(
                f"mix: the function {self._name} fails: {type(error).__name__}: {error}; it gets "
                f"{self._n} arrays of shape {given.shape[:1]} and must return f of that shape"
            ) from error
        if f.dtype.kind not in "fiub":
            raise InputError(f"mix: {self._name} returned values of type {f.dtype}, not numbers")
        f = f.astype(np.float64)
        if f.shape != given.shape[:1]:
            raise InputError(
                f"mix: {self._name} returned shape {f.shape} for rates of shape "
                f"{given.shape[:1]}; it must return one value of f for each"
            )
        bad = np.flatnonzero(~(f >= 0.0))
        if bad.size:
            row = given[bad[0]]
            raise InputError(
                f"mix: {self._name} returned f = {f[bad[0]]:g} for GI = {row[0]:g}, GII = "
                f"{row[1]:g}, GIII = {row[2]:g}; f must be a number, zero or larger"
            )
        nothing = np.where(np.isnan(g).any(axis=-1), np.nan, 0.0)
        return np.where(some, f.reshape(some.shape), nothing)

    def critical(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Total rate at which f = 1 at the present mode mix; G_Ic where all rates are zero.

        Arguments as for :meth:`ratio`.

        Returns:
            Critical rates, shape (n,) [force/length].

        Raises:
            InputError: f does not pass 1 when the rates grow from zero at this mode mix.
        """
        shares = _normalised(rates)
        tough = np.broadcast_to(np.asarray(toughness, dtype=np.float64), shares.shape)
        some = shares.max(axis=-1) != 0.0
        unit = np.where(some[..., None], shares, np.array([1.0, 0.0, 0.0]))
        scale = np.ones(some.shape) * tough.max(axis=-1)
        low, high = scale.copy(), scale.copy()
        for _ in range(_DOUBLINGS):
            above = self.ratio(low[..., None] * unit, tough) > 1.0
            below = self.ratio(high[..., None] * unit, tough) < 1.0
            if not (above.any() or below.any()):
                break
            low, high = np.where(above, 0.5 * low, low), np.where(below, 2.0 * high, high)
        else:
            raise InputError(
                f"mix: f of {self._name} does not pass 1 when the rates grow at a constant mode "
                f"mix, e.g. at GI : GII : GIII = {unit[above | below][0]}; f must rise with the "
                "rates"
            )
        for _ in range(_DOUBLINGS):
            middle = 0.5 * (low + high)
            above = self.ratio(middle[..., None] * unit, tough) > 1.0
            low, high = np.where(above, low, middle), np.where(above, middle, high)
            if np.all(high - low <= 1e-15 * high):
                break
        return np.where(some, high * unit.sum(axis=-1), tough[..., 0])


_DOUBLINGS = 200
"""How often a bracket of the critical rate is doubled or halved at most."""


def law_of(owner: str, mix: MixedMode | Callable[..., npt.ArrayLike]) -> MixedMode:
    """A law from what a user gave as ``mix``: a law, or a function (:class:`FunctionLaw`).

    Args:
        owner: Name of the criterion, for messages.
        mix: A law, or f as a function of arrays of shape (n,) [force/length], see
            :class:`FunctionLaw`.

    Raises:
        InputError: It is neither.
    """
    if not hasattr(mix, "ratio") and callable(mix) and not isinstance(mix, type):
        return FunctionLaw(mix)
    missing = missing_members(mix, MixedMode)
    if missing:
        raise InputError(
            f"{owner}: mix = {shown(mix)} is no mode-mix law; give one with its exponents, "
            f"BK(eta=...), Reeder(eta=...) or Power(am=..., an=...), or a function of the rates "
            f"({missing})"
        )
    return cast(MixedMode, mix)


def _log_scale_to_one(x: Array, exponents: Array) -> Array:
    """Root t of sum_i (e^t x_i)^a_i = 1 for each row of ``x``, which has a positive entry.

    Newton on log sum_i exp(a_i (t + log x_i)), which is convex and increasing in t: from the second
    iterate on it descends to the root, without safeguards.
    """
    with np.errstate(divide="ignore"):
        logs = np.log(x)  # -inf drops out of the sum
    t = -logs.max(axis=-1)
    for _ in range(50):  # about six are needed; more only for exponents far apart
        terms = exponents * (t[..., None] + logs)
        top = terms.max(axis=-1, keepdims=True)
        weights = np.exp(terms - top)
        value = top[..., 0] + np.log(weights.sum(axis=-1))
        slope = (weights * exponents).sum(axis=-1) / weights.sum(axis=-1)
        step = value / slope
        t = t - step
        if not np.any(np.abs(step) > 1e-14 * np.maximum(np.abs(t), 1.0)):
            break
    return np.asarray(t)


def _normalised(rates: npt.ArrayLike) -> Array:
    """Clipped rates divided by the largest of their row; zeros stay."""
    g = clip(rates)
    top = g.max(axis=-1, keepdims=True)
    return np.divide(g, top, out=g.copy(), where=top != 0.0)


def _shares(rates: npt.ArrayLike) -> tuple[Array, Array]:
    """(G_II + G_III)/G_T and G_III/(G_II + G_III), each 0 where it would be 0/0."""
    g = _normalised(rates)
    shear = g[..., 1] + g[..., 2]
    whole = g[..., 0] + shear
    zero = np.zeros_like(shear)
    return (
        np.divide(shear, whole, out=zero.copy(), where=whole != 0.0),
        np.divide(g[..., 2], shear, out=zero.copy(), where=shear != 0.0),
    )


def _blend(a: Array, b: Array, share: Array) -> Array:
    """From a at share 0 to b at share 1, exact at both ends however far apart they are."""
    return np.asarray(a * (1.0 - share) + b * share)


def _by_mode(toughness: npt.ArrayLike) -> tuple[Array, Array, Array]:
    """Columns of the toughness."""
    g = np.asarray(toughness, dtype=np.float64)
    return g[..., 0], g[..., 1], g[..., 2]
