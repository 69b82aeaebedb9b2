"""Laws of release: what remains of the bond force, and the energy it spends on its way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fxcrack.criteria import (
    AmplitudeRelease,
    Progressive,
    Ramp,
    Step,
    dissipated,
    final_opening,
    linear_fraction,
    secant_fraction,
    spent_fraction,
    viscous_damage,
    viscous_work,
)
from fxcrack.errors import InputError

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-12  # a few roundings of well-scaled numbers

# Zeros and numbers far from underflow.
opening = st.one_of(st.just(0.0), st.floats(1e-9, 3.0), st.floats(-1.0, -1e-9))
openings = arrays(np.float64, 4, elements=opening)
finals = arrays(np.float64, 4, elements=st.floats(0.1, 2.0))


def test_step_holds_in_its_increment_and_goes_in_the_next() -> None:
    assert Step().remaining([0, 1, 2]).tolist() == [1.0, 0.0, 0.0]
    assert Step().driver == "increments"


def test_ramp_over_increments_or_opening() -> None:
    assert Ramp(4).remaining([0, 1, 2, 4, 5]).tolist() == [1.0, 0.75, 0.5, 0.0, 0.0]
    assert Ramp(4).driver == "increments" and Ramp().driver == "opening"
    assert Ramp().remaining([0.0, 0.25, 1.0, 2.0]).tolist() == [1.0, 0.75, 0.0, 0.0]


def test_progressive_starts_whole_and_ends_at_the_final_opening() -> None:
    assert Progressive().remaining([-0.5, 0.0, 0.25, 1.0, 2.0]).tolist() == [1, 1, 0.75, 0, 0]
    assert Progressive().driver == "opening"


def test_final_opening_by_hand() -> None:
    w = final_opening([[3.0, 4.0, 0.0], [0.0, 0.0, 0.0]], [0.2, 0.2], [2.5, 1.0])
    assert w.tolist() == [0.2, math.inf]  # 2 * 0.2 * 2.5/5
    assert Progressive().remaining(0.1 / w[1]) == 1.0


@given(st.floats(0.1, 100.0), st.floats(0.01, 10.0), st.floats(0.01, 10.0))
def test_progressive_release_spends_the_toughness(force: float, gc: float, area: float) -> None:
    end = final_opening([[force, 0.0, 0.0]], gc, area)[0]
    w = np.linspace(0.0, end, 11)
    spent = np.trapezoid(force * Progressive().remaining(w / end), w)  # exact for a straight line
    assert spent == pytest.approx(gc * area, rel=ROUND_OFF)
    # On the way, too.
    half = np.trapezoid(force * Progressive().remaining(w[:6] / end), w[:6])
    assert half == pytest.approx(gc * area * spent_fraction(w[5], end), rel=ROUND_OFF)


@given(openings, openings, finals)
def test_fractions_stay_between_one_and_zero_and_never_rise(a: Array, b: Array, end: Array) -> None:
    low, high = np.minimum(a, b), np.maximum(a, b)
    one, two = linear_fraction(low, end), linear_fraction(high, end)
    assert ((0.0 <= two) & (two <= one) & (one <= 1.0)).all()
    assert (spent_fraction(low, end) <= spent_fraction(high, end)).all()


@given(openings, openings, finals)
def test_secant_unloading(w: Array, largest: Array, end: Array) -> None:
    largest = np.maximum(largest, w)
    f = secant_fraction(w, largest, end)
    assert ((f >= 0.0) & (f <= linear_fraction(largest, end))).all()
    # On the envelope while it opens; a line to the origin below; nothing when closed again.
    np.testing.assert_array_equal(secant_fraction(w, w, end), linear_fraction(w, end))
    np.testing.assert_array_equal(secant_fraction(w, 0.0 * w, end), linear_fraction(w, end))
    half = secant_fraction(0.5 * largest, largest, end)
    opened = largest > 0.0
    np.testing.assert_allclose(half[opened], 0.5 * linear_fraction(largest, end)[opened])
    assert (secant_fraction(0.0 * w, largest, end)[opened] == 0.0).all()


@given(st.floats(0.05, 1.5), st.floats(0.1, 100.0))
def test_energy_lost_in_a_cycle_of_opening(top: float, force: float) -> None:
    # Open to `top`, close along the secant: the work left over is what was dissipated.
    end = 1.0
    up = np.union1d(np.linspace(0.0, top, 5), [min(end, top)])  # exact: the law is piecewise linear
    down = np.linspace(top, 0.0, 5)
    work = np.trapezoid(force * secant_fraction(up, up, end), up)
    work += np.trapezoid(force * secant_fraction(down, np.full(5, top), end), down)
    lost = dissipated(force, top, end)
    assert work == pytest.approx(lost, rel=1e-11)  # a difference of two works
    assert dissipated(force, 2.0, end) == pytest.approx(0.5 * force * end)
    assert dissipated(force, -1.0, end) == 0.0


# --- amplitude ------------------------------------------------------------------------------------


def test_amplitude_release() -> None:
    law = AmplitudeRelease([0.0, 0.5, 1.0], [1.0, 0.75, 0.0])
    assert law.remaining([-1.0, 0.0, 0.25, 0.75, 1.0, 9.0]) == pytest.approx(
        [1.0, 1.0, 0.875, 0.375, 0.0, 0.0]
    )
    assert law.driver == "time"
    assert law.suggested_increment == 1.0
    assert AmplitudeRelease([0.0, 1.0], [1.0, 0.0], 0.1).suggested_increment == 0.1


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: AmplitudeRelease([0, 1], [0.9, 0]), "begins with fraction 0.9 at time 0; it must"),
        (lambda: AmplitudeRelease([0.1, 1], [1, 0]), "begins with fraction 1 at time 0.1; it must"),
        (lambda: AmplitudeRelease([0, 1], [1, 0.1]), "ends with fraction 0.1 at time 1; it must"),
        (lambda: AmplitudeRelease([0], [1]), "ends with fraction 1 at time 0"),
        (lambda: AmplitudeRelease([0, 1, 1], [1, 0.5, 0]), "times must increase"),
        (lambda: AmplitudeRelease([0, 1], [1, math.nan]), r"fractions\[1\] = nan"),
        (lambda: AmplitudeRelease([0, 1], [1, 0], 0.0), "first_increment = 0.0 must be positive"),
        (lambda: Ramp(0), "Ramp: increments = 0 must be a whole number, at least 1"),
        (lambda: Ramp(2.5), "Ramp: increments = 2.5 must be a whole number"),  # type: ignore[arg-type]
    ],
)
def test_bad_laws_are_refused_when_written(make: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        make()


# --- viscosity ------------------------------------------------------------------------------------


def test_viscous_damage_lags_and_catches_up() -> None:
    # Against D_v = 1 - exp(-t/mu) for D = 1: implicit Euler is of first order.
    errors = []
    for n in (50, 100, 200):
        d = np.zeros(1)
        for _ in range(n):
            d = viscous_damage([1.0], d, 2.0 / n, 0.5)
        errors.append(abs(d[0] - (1.0 - np.exp(-4.0))))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([1.0, 1.0], abs=0.1)
    assert viscous_damage([0.4], [0.1], 0.1, 0.0) == pytest.approx([0.4])


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(1e-6, 1e6), st.floats(0.0, 1e6))
def test_viscous_damage_stays_between_old_and_new(a: float, b: float, dt: float, mu: float) -> None:
    d = viscous_damage(b, a, dt, mu)
    assert min(a, b) - 1e-15 <= d <= max(a, b) + 1e-15  # round-off of numbers below 1


def test_viscous_work_by_hand() -> None:
    # |F0| (0.2 + 0.4)/2 over 0.5
    assert viscous_work([10.0], [0.2], [0.4], [0.1], [0.6]) == pytest.approx([1.5])
