"""Factors in time of loads, supports and temperatures.

Every amplitude is a curve of pieces between knots, each a polynomial. Steps that are not explicit
follow straight lines in time: increments end at the times of :meth:`breaks`, which divide curved
pieces into so many parts that a chord is off by 0.1 % of the change over the piece at most.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from fxcrack.base.checks import keep, list_of, number, shown, table
from fxcrack.base.errors import InputError

_CHORDS = 32
"""Chords of a curved piece: of the quintic smooth step they are within 7e-4 of its height."""


class AmplitudeLike(Protocol):
    """A factor in time."""

    def __call__(self, time: float) -> float:
        """Factor at a time."""
        ...

    def breaks(self) -> tuple[float, ...]:
        """Times between which the factor may be taken as linear in time."""
        ...


@dataclass(frozen=True)
class _Curve:
    """Polynomials in the time since the knot before, one more than there are knots.

    Attributes:
        knots: Increasing times; the first polynomial belongs to times before the first knot and
            counts from there.
        pieces: Coefficients by ascending power.
    """

    knots: tuple[float, ...]
    pieces: tuple[tuple[float, ...], ...]

    def __call__(self, time: float) -> float:
        i = bisect_right(self.knots, time)
        x, out = time - self.knots[max(i - 1, 0)], 0.0
        for c in reversed(self.pieces[i]):
            out = out * x + c
        return out

    def breaks(self) -> tuple[float, ...]:
        out = list(self.knots)
        for a, b, c in zip(self.knots, self.knots[1:], self.pieces[1:], strict=False):
            if any(c[2:]):
                out += np.linspace(a, b, _CHORDS + 1)[1:-1].tolist()
        return tuple(sorted(out))

    def integral(self) -> _Curve:
        """The curve whose slope this one is; 0 at time 0."""
        pieces, value = [], 0.0
        for i, c in enumerate(self.pieces):
            pieces.append((value, *(x / (k + 1) for k, x in enumerate(c))))
            if 0 < i < len(self.knots):
                length = self.knots[i] - self.knots[i - 1]
                value = sum(x * length**k for k, x in enumerate(pieces[-1]))
        start = _Curve(self.knots, tuple(pieces))(0.0)
        return _Curve(self.knots, tuple((c[0] - start, *c[1:]) for c in pieces))


@dataclass(frozen=True)
class Amplitude:
    """Piecewise linear factor in time, held constant outside the table.

    Args:
        times: Increasing times.
        values: Factor at those times.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the table."""
        _check_table(self, "Amplitude", self.times, self.values)

    def __call__(self, time: float) -> float:
        """Factor at a time."""
        return float(np.interp(time, self.times, self.values))

    def breaks(self) -> tuple[float, ...]:
        """Times at which the slope changes."""
        return self.times

    def curve(self) -> _Curve:
        """The pieces."""
        t, v = self.times, self.values
        rising = [
            (v[i], (v[i + 1] - v[i]) / (t[i + 1] - t[i])) for i in range(len(t) - 1)
        ]  # fmt: skip
        return _Curve(t, ((v[0],), *rising, (v[-1],)))


@dataclass(frozen=True)
class SmoothStep:
    """Factor that goes from value to value without a jump of its first and second derivative.

    Between two entries it is v_i + (v_{i+1} - v_i) x^3 (10 - 15 x + 6 x^2), x from 0 to 1;
    constant outside the table. Supports and loads that begin so excite few waves. Explicit steps
    and the increments of others follow the curve; between the ends of increments loads are linear
    in time, which is off by 0.1 % of the step at most.

    Args:
        times: Increasing times.
        values: Factor at those times.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    _curve: _Curve = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the table."""
        _check_table(self, "SmoothStep", self.times, self.values)
        t, v = self.times, self.values
        steps = []
        for i in range(len(t) - 1):
            rise, length = v[i + 1] - v[i], t[i + 1] - t[i]
            powers = (10.0 / length**3, -15.0 / length**4, 6.0 / length**5)
            steps.append((v[i], 0.0, 0.0, *(rise * p for p in powers)))
        keep(self, _curve=_Curve(t, ((v[0],), *steps, (v[-1],))))

    def __call__(self, time: float) -> float:
        """Factor at a time."""
        return self._curve(time)

    def breaks(self) -> tuple[float, ...]:
        """Times between which the factor may be taken as linear in time."""
        return self._curve.breaks()

    def curve(self) -> _Curve:
        """The pieces."""
        return self._curve


@dataclass(frozen=True)
class Integral:
    """The integral over time of an amplitude, from time 0: way of a velocity.

    Args:
        of: The amplitude: :class:`Amplitude`, :class:`SmoothStep` or an integral of one.
        start: Value at time 0.

    Raises:
        InputError: The amplitude has no integral, or goes on growing with its square in time.
    """

    of: Amplitude | SmoothStep | Integral
    start: float = 0.0
    _curve: _Curve = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Integrate, and refuse what no chords can follow."""
        if not isinstance(self.of, Amplitude | SmoothStep | Integral):
            raise InputError(
                f"Integral: of = {shown(self.of)} must be an Amplitude, a SmoothStep or an "
                "Integral; a velocity that grows with time is Amplitude((0.0, t), (0.0, v))"
            )
        keep(self, start=number("Integral", "start", self.start))
        inner = self.of.curve()
        if len(inner.pieces[-1]) > 1 and any(inner.pieces[-1][1:]):
            raise InputError(
                "Integral: what is integrated goes on growing after its table, so that no "
                "increments could follow the integral; let the table of an acceleration end with 0"
            )
        curve = inner.integral()
        pieces = tuple((c[0] + self.start, *c[1:]) for c in curve.pieces)
        keep(self, _curve=_Curve(curve.knots, pieces))

    def __call__(self, time: float) -> float:
        """Integral up to a time."""
        return self._curve(time)

    def breaks(self) -> tuple[float, ...]:
        """Times between which the factor may be taken as linear in time."""
        return self._curve.breaks()

    def curve(self) -> _Curve:
        """The pieces."""
        return self._curve


@dataclass(frozen=True)
class Ramp:
    """The factor is the time itself, without end: the default amplitude."""

    def __call__(self, time: float) -> float:
        """Factor at a time."""
        return float(time)

    def breaks(self) -> tuple[float, ...]:
        """No change of slope."""
        return ()


def constant(value: float = 1.0) -> Amplitude:
    """An amplitude that is there from the first moment and stays."""
    return Amplitude((0.0,), (value,))


def _check_table(amplitude: object, owner: str, times: object, values: object) -> None:
    n, m = (len(list_of(v) or ()) for v in (times, values))
    if n != m or not n:
        raise InputError(
            f"{owner}: {n} times but {m} values; give as many of one as of the other, at least one"
        )
    checked = table(owner, ("times", "values"), times, values)
    keep(amplitude, times=checked[0], values=checked[1])


__all__ = ["Amplitude", "AmplitudeLike", "Integral", "Ramp", "SmoothStep", "constant"]
