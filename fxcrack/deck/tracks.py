"""What a load or a prescribed displacement does in time: amplitudes of decks and their tracks.

A deck says for each step where a value goes; over the steps that makes one track of total time,
piecewise linear or of smooth steps, and an amplitude of the scene.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.continuum.amplitudes import Amplitude, AmplitudeLike, Ramp, SmoothStep
from fxcrack.deck.cards import Card, key
from fxcrack.deck.model import Model
from fxcrack.deck.report import Report

_SMOOTH = 32
"""Straight pieces of a smooth step that ends within its rise, and of a parabola."""
_PER_PERIOD = 64
"""Straight pieces of one period of the highest harmonic."""
_JUMP = 1e-6
"""Part of a step over which a value that jumps at its beginning moves there."""
_NEAR = 1e-3
"""Part by which a circular frequency may miss that of whole periods in a cycle."""
_SAME = 1e-12


@dataclass(frozen=True)
class Period:
    """A step in total time.

    Attributes:
        start: Total time at its beginning.
        end: At its end.
        ramp: Whether values without an amplitude move linearly over it; else they jump.
        moving: Whether bodies have inertia: a load that is there from the first moment must find
            them at rest, not in equilibrium with it.
    """

    start: float
    end: float
    ramp: bool = True
    moving: bool = False


@dataclass(frozen=True, eq=False)
class Curve:
    """An amplitude of a deck, piecewise linear or of smooth steps.

    Attributes:
        times: Increasing, shape (n,).
        values: Shape (n,).
        total: Whether the times are total times; else they begin with the step.
        absolute: Whether the values are those of the load itself, whatever its reference value.
        smooth: Whether it goes from value to value by smooth steps.
        cut: Called where straight lines must take the place of a smooth step.
    """

    times: Array
    values: Array
    total: bool = False
    absolute: bool = False
    smooth: bool = False
    cut: Callable[[], None] | None = None

    def start(self, period: Period) -> float:
        """Total time at which its own time is 0, for a step."""
        return 0.0 if self.total else period.start

    def over(self, period: Period) -> tuple[Array, Array]:
        """Total times and values over a step, its beginning and end included.

        Between them the value is linear; a smooth step is followed by chords.
        """
        times = self.times + self.start(period)
        if self.smooth:
            step = SmoothStep(tuple(times.tolist()), tuple(self.values.tolist()))
            inner = np.unique(step.breaks())
            inner = inner[(inner > period.start) & (inner < period.end)]
            knots = np.array([period.start, *inner, period.end])
            return knots, np.array([step(t) for t in knots])
        inner = times[(times > period.start) & (times < period.end)]
        knots = np.array([period.start, *inner, period.end])
        return knots, np.interp(knots, times, self.values)

    def corners(self, period: Period) -> tuple[Array, Array] | None:
        """Total times and values over a step between which it makes whole smooth steps.

        None where it does not: it is piecewise linear, or a rise begins or ends outside the step.
        """
        if not self.smooth:
            return None
        times = self.times + self.start(period)
        inside = (times > period.start) & (times < period.end)
        for edge in (period.start, period.end):
            i = int(np.searchsorted(times, edge))
            between = 0 < i < len(times) and times[i] != edge
            if between and self.values[i] != self.values[i - 1]:
                return None
        knots = np.array([period.start, *times[inside], period.end])
        return knots, np.interp(knots, times, self.values)


class Amplitudes:
    """The amplitudes of a deck.

    Args:
        model: The deck.
        report: Takes what is replaced.
        end: Total time of the last step's end.
        cycles: Times of one cycle of the steps of cycles.
    """

    def __init__(
        self, model: Model, report: Report, end: float, cycles: Sequence[float] = ()
    ) -> None:
        self._cards = model.amplitudes
        self._report = report
        self._end = end
        self._cycles = cycles
        self._known: dict[str, Curve] = {}

    def of(self, card: Card) -> Curve | None:
        """The amplitude that a card names, None without.

        Raises:
            DeckError: It does not exist, or is of a kind that is not available.
        """
        if not card.has("AMPLITUDE"):
            return None
        name = card.text("AMPLITUDE")
        if key(name) not in self._cards:
            card.fail(f"there is no amplitude '{name}'; define it by *AMPLITUDE")
        if key(name) not in self._known:
            self._known[key(name)] = self._read(self._cards[key(name)])
        return self._known[key(name)]

    def _read(self, card: Card) -> Curve:
        total = card.choose("TIME", ("STEP TIME", "TOTAL TIME"), "STEP TIME") == "TOTAL TIME"
        absolute = card.choose("VALUE", ("RELATIVE", "ABSOLUTE"), "RELATIVE") == "ABSOLUTE"
        kinds = ("TABULAR", "SMOOTH STEP", "PERIODIC", "EQUALLY SPACED")
        kind = card.choose("DEFINITION", kinds, "TABULAR")
        if card.number("SMOOTH", 0.0) != 0.0:
            self._report.replace("SMOOTH is left out: corners stay corners", card)
        card.need_rows("times and values")
        if kind == "PERIODIC":
            times, values = self._periodic(card)
        elif kind == "EQUALLY SPACED":
            values = card.flat()
            step, begin = card.number("FIXED INTERVAL", 0.0), card.number("BEGIN", 0.0)
            if step <= 0.0:
                card.fail("FIXED INTERVAL must be positive")
            times = np.asarray(begin + step * np.arange(len(values)), dtype=np.float64)
        else:
            times, values = self._pairs(card)
        if kind != "SMOOTH STEP":
            return Curve(times, values, total, absolute)

        def cut() -> None:
            self._report.replace(
                "a smooth step that begins or ends within another step, or beside loads of other "
                f"kinds, is followed by {_SMOOTH} straight lines",
                card,
            )

        return Curve(times, values, total, absolute, smooth=True, cut=cut)

    def _pairs(self, card: Card) -> tuple[Array, Array]:
        flat = [x for row in card.rows() for x in row.numbers()]
        if len(flat) % 2:
            card.fail(f"{len(flat)} numbers are no pairs of time and value")
        times, values = np.array(flat[::2]), np.array(flat[1::2])
        bad = np.flatnonzero(np.diff(times) <= 0.0)
        if len(bad):
            card.fail(f"time {times[bad[0] + 1]:g} follows {times[bad[0]]:g}; times must increase")
        return times, values

    def _periodic(self, card: Card) -> tuple[Array, Array]:
        rows = card.need_rows("number of terms, frequency, start, initial value")
        n, omega = rows[0].whole(0), rows[0].number(1)
        begin, base = rows[0].number(2, 0.0), rows[0].number(3, 0.0)
        terms = np.array([x for row in rows[1:] for x in row.numbers()])
        if n < 1 or len(terms) != 2 * n or omega <= 0.0:
            card.fail(f"{n} terms with a positive frequency need {2 * n} coefficients A, B")
        omega = self._whole_periods(card, omega)
        pieces = max(1.0, (self._end - begin) * omega * n / (2.0 * np.pi)) * _PER_PERIOD
        if pieces > 1e6:
            card.fail("the amplitude has more than a million corners over the steps")
        self._report.replace(
            f"the periodic amplitude is followed by {_PER_PERIOD} straight lines a period", card
        )
        times = np.linspace(begin, max(self._end, begin + 1e-9), int(np.ceil(pieces)) + 1)
        k = omega * np.arange(1, n + 1) * (times[:, None] - begin)
        values = base + np.cos(k) @ terms[::2] + np.sin(k) @ terms[1::2]
        if begin > 0.0:
            times, values = np.append(0.0, times), np.append(base, values)
        return times, values

    def _whole_periods(self, card: Card, omega: float) -> float:
        """The circular frequency with which a cycle has whole periods, if the given one is near.

        Decks give 2 pi with a few digits, and an amplitude that does not return exactly after the
        time of a cycle is none of a cycle.
        """
        for time in self._cycles:
            n = round(omega * time / (2.0 * np.pi))
            exact = 2.0 * np.pi * n / time
            if n >= 1 and 0.0 < abs(exact - omega) <= _NEAR * omega:
                self._report.replace(
                    f"the circular frequency {omega:.10g} is taken as {exact:.10g}, with which the "
                    f"amplitude returns after the time {time:g} of a cycle",
                    card,
                )
                return exact
        return omega


@dataclass
class Track:
    """A value over total time.

    Attributes:
        times: Times, increasing from 0.
        values: Values at them; between them it is linear, or on a smooth step of which they are
            points.
    """

    times: list[float] = field(default_factory=lambda: [0.0])
    values: list[float] = field(default_factory=lambda: [0.0])
    _made_of: list[tuple[float, Curve] | None] = field(default_factory=list)
    _corners: list[tuple[float, float]] | None = field(default_factory=lambda: [(0.0, 0.0)])
    _smooth: list[Curve] = field(default_factory=list)

    def move(self, period: Period, value: float, curve: Curve | None) -> None:
        """Go over a step to a reference value, along a curve if there is one."""
        whole = curve is not None and curve.total and not curve.absolute
        self._made_of.append((value, curve) if whole and curve is not None else None)
        before = self.values[-1]
        if curve is not None:
            times, values = curve.over(period)
            self._put(times, values if curve.absolute else value * values, period)
            self._turn(curve, 1.0 if curve.absolute else value, period)
        elif period.ramp:
            self._append(period.end, value)
            self._stay(before, period)
        else:
            self._put(np.array([period.start, period.end]), np.array([value, value]), period)
            self._stay(before, period)

    def move_at_rate(self, period: Period, rate: float, curve: Curve | None) -> None:
        """Go over a step at a rate, constant or along a curve: the value is its integral.

        Where the rate changes, the parabola is followed by straight lines.
        """
        times, rates = np.array([period.start, period.end]), np.array([rate, rate])
        if curve is not None:
            times, rates = curve.over(period)
            rates = rates if curve.absolute else rate * rates
        self._made_of.append(None)
        here = self.values[-1]
        self._corners = None
        for i in range(len(times) - 1):
            length, change = times[i + 1] - times[i], rates[i + 1] - rates[i]
            n = _SMOOTH if change else 1
            for s in np.arange(1, n + 1) / n:
                gone = (rates[i] * s + 0.5 * change * s * s) * length
                self._append(float(times[i] + s * length), float(here + gone))
            here = self.values[-1]

    def hold(self, period: Period) -> None:
        """Stay over a step as it was at its beginning."""
        self._made_of.append(None)
        self._append(period.end, self.values[-1])
        self._stay(self.values[-1], period)

    def scaled(self, factor: float) -> Track:
        """The track times a factor."""
        corners = None if self._corners is None else [(t, factor * v) for t, v in self._corners]
        made = [None if m is None else (factor * m[0], m[1]) for m in self._made_of]
        values = [factor * v for v in self.values]
        return Track(list(self.times), values, made, corners, list(self._smooth))

    def _stay(self, before: float, period: Period) -> None:
        """After a step without an amplitude: corners of smooth steps are left where it moved."""
        if self.values[-1] != before:
            self._corners = None
        elif self._corners is not None:
            self._corners.append((period.end, before))

    def _turn(self, curve: Curve, factor: float, period: Period) -> None:
        """After a step along an amplitude: its corners, where it makes whole smooth steps."""
        if curve.smooth:
            self._smooth.append(curve)
        found = curve.corners(period)
        if found is None or self._corners is None:
            self._corners = None
            return
        times, values = found[0], factor * found[1]
        last = self._corners[-1][1]
        if period.start == 0.0 and not period.moving:
            self._corners[-1] = (0.0, float(values[0]))
        elif abs(values[0] - last) > _SAME * max(abs(values[0]), abs(last)):
            self._corners = None
            return
        self._corners += zip(times[1:].tolist(), values[1:].tolist(), strict=True)

    def _put(self, times: Array, values: Array, period: Period) -> None:
        first = float(values[0])
        if period.start == 0.0 and not period.moving:
            self.values[0] = first
        elif abs(first - self.values[-1]) > _SAME * max(abs(first), abs(self.values[-1])):
            after = period.start + _JUMP * (period.end - period.start)
            self._append(after, float(np.interp(after, times, values)))
            times, values = times[times > after], values[times > after]
            for t, v in zip(times, values, strict=True):
                self._append(float(t), float(v))
            return
        for t, v in zip(times[1:], values[1:], strict=True):
            self._append(float(t), float(v))

    def _append(self, time: float, value: float) -> None:
        self.times.append(time)
        self.values.append(value)

    @property
    def constant(self) -> bool:
        """Whether it never changes."""
        return all(v == self.values[0] for v in self.values)

    @property
    def zero(self) -> bool:
        """Whether it is 0 all the time."""
        return not any(self.values)

    def amplitude(self) -> tuple[float, AmplitudeLike]:
        """A reference value and an amplitude of which it is the product.

        A track that grows in proportion to time is a :class:`Ramp`. One that follows the same
        amplitude of total time in all steps keeps its reference value; of others it is 1.
        """
        if self._smooth and self._corners is not None:
            times, values = zip(*self._corners, strict=True)
            return 1.0, SmoothStep(times, values)
        first = self._made_of[0] if self._made_of else None
        starts = first is None or self.values[0] == first[0] * first[1].values[0]
        if first is not None and starts and all(made == first for made in self._made_of):
            value, curve = first
            times, values = tuple(curve.times.tolist()), tuple(curve.values.tolist())
            if curve.smooth:
                return value, SmoothStep(times, values)
            if times == values and times[0] == 0.0:
                return value, Ramp()
            return value, Amplitude(times, values)
        for curve in self._smooth:
            if curve.cut is not None:
                curve.cut()
        end, last = self.times[-1], self.values[-1]
        straight = [last * (t / end) for t in self.times]
        scale = _SAME * max(abs(v) for v in self.values)
        if last and all(abs(a - b) <= scale for a, b in zip(straight, self.values, strict=True)):
            return last / end, Ramp()
        return 1.0, Amplitude(tuple(self.times), tuple(self.values))


def combined(tracks: Sequence[Track], factors: Sequence[float]) -> Track:
    """Sum of tracks times factors."""
    if len(tracks) == 1:
        return tracks[0].scaled(factors[0])
    times = np.unique(np.concatenate([t.times for t in tracks]))
    total = np.zeros(len(times))
    for track, factor in zip(tracks, factors, strict=True):
        total += factor * np.interp(times, track.times, track.values)
    return Track(times.tolist(), total.tolist())
