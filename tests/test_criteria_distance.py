"""Criteria at a distance from the tip: stress, opening, and crack length against time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from specimens import time_of

from fxcrack.base.errors import InputError
from fxcrack.criteria import (
    CrackLengthVsTime,
    CrackOpening,
    CriticalStress,
    Tabulated,
)
from fxcrack.interface.surface_paths import locate

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-12  # a few roundings of well-scaled numbers

steps = arrays(np.float64, 6, elements=st.floats(0.1, 2.0))
fractions = st.floats(0.0, 1.0)


def at_distance(s: Any, values: Any, distance: float, order: int) -> Array:
    """Values at a distance from the first node along a line of face nodes."""
    rows, weights = locate("line", np.asarray(s, dtype=float)[:, None], distance, order)
    return np.asarray(weights @ np.asarray(values)[rows])


def opening_behind(slave: Array, master: Array, distance: float, order: int) -> Array:
    """From the point at a distance on one line of face nodes to that on another, shape (2,)."""
    points = []
    for name, x in (("slave", slave), ("master", master)):
        rows, weights = locate(name, x, distance, order)
        points.append(weights @ x[rows])
    return np.asarray(points[0] - points[1])


# --- along a path of face nodes -------------------------------------------------------------------


def test_interpolation_by_hand() -> None:
    s, v = [0.0, 1.0, 3.0], [[1.0, 0.0], [3.0, 10.0], [7.0, 20.0]]
    assert at_distance(s, v, 2.0, 1) == pytest.approx([5.0, 15.0])
    # One second-order face 0, 1, 2: the parabola through (0, 0), (1, 1), (2, 4) at 1.5
    assert at_distance([0.0, 1.0, 2.0], [0.0, 1.0, 4.0], 1.5, 2) == pytest.approx(2.25)


@given(steps, fractions)
def test_linear_faces_are_numpy_interp(d: Array, part: float) -> None:
    s = np.concatenate([[0.0], d.cumsum()])
    v = np.cos(s)
    got = at_distance(s, v, part * s[-1], 1)
    # Values of order 1, found at a place known to round-off.
    assert got == pytest.approx(np.interp(part * s[-1], s, v), abs=1e-13)


@given(st.floats(0.5, 2.0), fractions, arrays(np.float64, 3, elements=st.floats(-3.0, 3.0)))
def test_quadratic_faces_are_exact_for_parabolas(d: float, part: float, c: Array) -> None:
    s = d * np.arange(7)
    x = part * s[-1]
    got = at_distance(s, np.polyval(c, s), x, 2)
    # Values up to 3 * 12^2, found at a place known to round-off.
    assert got == pytest.approx(np.polyval(c, x), abs=1e-11)


@given(arrays(np.float64, 3, elements=st.floats(-0.45, 0.45)), fractions)
def test_shifted_midside_nodes_keep_straight_lines(shift: Array, part: float) -> None:
    # The face maps isoparametrically as long as the midside node stays in the middle half.
    s = np.arange(7.0)
    s[1::2] += shift
    x = part * s[-1]
    assert at_distance(s, 2.0 * s - 1.0, x, 2) == pytest.approx(2.0 * x - 1.0, abs=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_nodes_and_end_points_return_their_values(order: int) -> None:
    s = np.array([0.0, 0.7, 1.5, 2.1, 3.3])
    v = np.array([1.0, -2.0, 3.0, 5.0, 8.0])
    got = [at_distance(s, v, x, order) for x in s]
    assert got == pytest.approx(v, abs=1e-12)
    # A distance that passes the end by round-off only is the end.
    assert at_distance(s, v, 3.3 * (1.0 + 1e-15), order) == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (([0.0, 1.0, 2.0], [1.0, 2.0, 3.0], 2.1, 1), "distance 2.1 lies outside .* reaches 2 from"),
        (([0.0, 1.0, 2.0], [1.0, 2.0, 3.0], -0.1, 1), "distance -0.1 lies outside the end points"),
        (([0.0, 1.0, 2.0], [1.0, 2.0, 3.0], math.nan, 2), "distance nan lies outside"),
        (([0.0, 1.0], [1.0, 2.0], 0.5, 2), "second order an odd number of at least 3"),
        (([0.0, 1.0, 2.0, 3.0], [1.0] * 4, 0.5, 2), "second order an odd number of at least 3"),
        (([0.0], [1.0], 0.0, 1), "needs at least 2 nodes"),
    ],
)
def test_bad_paths_are_named(args: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        at_distance(*args)


# --- critical stress ------------------------------------------------------------------------------

# Zeros and numbers far from underflow, in the smallest units too.
component = st.one_of(st.just(0.0), st.floats(1e-6, 100.0), st.floats(-100.0, -1e-6))
tractions = arrays(np.float64, (4, 3), elements=component)


def test_critical_stress_by_hand() -> None:
    criterion = CriticalStress(10.0, 20.0, 50.0, distance=1.0)
    t = [[6.0, 16.0, 0.0], [-6.0, 16.0, 0.0], [0.0, 0.0, -25.0], [6.0, 12.0, 26.457513110645905]]
    assert criterion.value(t) == pytest.approx([1.0, 0.8, 0.5, 1.0], rel=ROUND_OFF)
    assert criterion.release_range == (0.9, 1.1)
    assert CriticalStress.allows_normal_only


@pytest.mark.parametrize("nothing", [None, 0.0])
def test_missing_shear_strength_has_no_effect(nothing: Any) -> None:
    criterion = CriticalStress(10.0, nothing, nothing, distance=1.0)
    assert criterion.value([[5.0, 1e6, -1e6]]) == pytest.approx([0.5])


@pytest.mark.slow
@given(tractions, st.floats(1.01, 10.0), st.integers(-200, 200))
def test_critical_stress_grows_with_load_in_any_units(t: Array, load: float, decades: int) -> None:
    criterion = CriticalStress(10.0, 20.0, 30.0, distance=1.0)
    f = criterion.value(t)
    np.testing.assert_allclose(criterion.value(load * t), load * f, rtol=ROUND_OFF)
    u = 2.0**decades  # exact
    scaled = CriticalStress(10.0 * u, 20.0 * u, 30.0 * u, distance=1.0)
    np.testing.assert_allclose(scaled.value(t * u), f, rtol=ROUND_OFF)


@given(tractions, st.floats(0.0, 6.3))
def test_equal_shear_strengths_do_not_know_the_tangents(t: Array, angle: float) -> None:
    criterion = CriticalStress(10.0, 20.0, 20.0, distance=1.0)
    c, s = np.cos(angle), np.sin(angle)
    turned = t @ np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    np.testing.assert_allclose(criterion.value(turned), criterion.value(t), rtol=1e-11)


def test_strength_against_temperature() -> None:
    criterion = CriticalStress(Tabulated([0.0, 100.0], [10.0, 5.0]), 20.0, distance=1.0)
    t = [[5.0, 0.0, 0.0]] * 3
    f = criterion.value(t, np.array([0.0, 50.0, 200.0]))
    assert f == pytest.approx([0.5, 5.0 / 7.5, 1.0])
    with pytest.raises(InputError, match="sigma_f depends on temperature"):
        criterion.value(t)


@pytest.mark.parametrize("order", [1, 2])
def test_centre_crack_under_critical_stress(order: int) -> None:
    # Stress ahead s x/sqrt(x^2 - a^2); f = 1 at s = s_f sqrt((a + d)^2 - a^2)/(a + d).
    a, d, strength = 10.0, 2.0, 40.0
    load = strength * np.sqrt((a + d) ** 2 - a**2) / (a + d)
    criterion = CriticalStress(strength, distance=d)
    errors = []
    for h in (0.2, 0.1, 0.05):
        r = np.arange(0, round(4.0 / h) + 1) * h + h / 3.0  # nodes do not hit the distance
        stress = load * (a + r) / np.sqrt((a + r) ** 2 - a**2)
        t = at_distance(r, np.stack([stress, 0 * r, 0 * r], axis=1), d - h / 3.0, order)
        errors.append(abs(criterion.value(t[None])[0] - 1.0))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    # Interpolation of order p converges with p + 1; the place within the face varies with h.
    assert errors[-1] < 1e-4 and rates.mean() > order + 1 - 0.5


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (
            lambda: CriticalStress(0.0, distance=1.0),
            "CriticalStress: sigma_f = 0.0 must be positive",
        ),
        (lambda: CriticalStress(1.0, -1.0, distance=1.0), "tau1_f = -1.0 must be positive; None"),
        (lambda: CriticalStress(1.0, distance=-1.0), "distance = -1.0 must be zero or positive"),
        (lambda: CrackOpening(0.1, distance=0.0), "CrackOpening: distance = 0.0 must be positive"),
        (lambda: CrackOpening(-0.1, distance=1.0), "critical = -0.1 must be positive"),
        (lambda: CrackOpening(([0.0],), distance=1.0), "critical has 1 parts"),
        (
            lambda: CrackOpening(([0.0, 1.0], [1.0, 0.0]), distance=1.0),
            r"critical openings\[1\] = 0\.0 must be positive",
        ),
        (
            lambda: CrackLengthVsTime([0.0, 1.0, 2.0], [3.0, 5.0, 4.0], reference="left"),
            r"lengths fall from 5 to 4 at entry 2",
        ),
        (
            lambda: CrackLengthVsTime([0.0, 1.0, 1.0], [3.0, 5.0, 6.0], reference="left"),
            r"times must increase, but entry 2 \(1\) follows entry 1 \(1\)",
        ),
        (lambda: CrackLengthVsTime([0.0], [1.0], reference=""), "must name a node set"),
    ],
)
def test_bad_criteria_are_refused_when_written(make: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        make()


# --- crack opening --------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 2])
def test_opening_of_a_wedge(order: int) -> None:
    # Faces at +-0.1 rad: the points at 3 from the tip are 2 * 3 sin(0.1) apart.
    r = np.linspace(0.0, 5.0, 9)
    tip = np.array([7.0, -2.0])
    slave = tip + np.stack([-r * np.cos(0.1), r * np.sin(0.1)], axis=1)
    master = tip + np.stack([-r * np.cos(0.1), -r * np.sin(0.1)], axis=1)
    got = opening_behind(slave, master, 3.0, order=order)
    assert got == pytest.approx([0.0, 6.0 * np.sin(0.1)], rel=ROUND_OFF, abs=1e-14)


@given(st.floats(0.0, 6.3), st.floats(0.05, 0.95), st.sampled_from([1, 2]))
def test_opening_turns_with_the_body(angle: float, part: float, order: int) -> None:
    s = np.linspace(0.0, 4.0, 9) ** 1.2
    slave = np.stack([-s, 0.2 * np.sqrt(s)], axis=1)
    master = np.stack([-0.9 * s, -0.1 * np.sqrt(s)], axis=1)
    c, i = np.cos(angle), np.sin(angle)
    turn = np.array([[c, i], [-i, c]])
    distance = part * 0.9 * s[-1]
    still = opening_behind(slave, master, distance, order)
    moved = opening_behind(slave @ turn + [3.0, 4.0], master @ turn + [3.0, 4.0], distance, order)
    # Coordinates of about 10 are turned and shifted: 1e-15 each; shallow faces amplify a little.
    assert moved == pytest.approx(still @ turn, abs=1e-12)


def test_quadratic_faces_find_the_point_on_a_curve() -> None:
    # The face (0, 0), (-1, 1), (-2, 4) is the parabola y = x^2 exactly.
    x = np.array([0.0, -1.0, -2.0])
    slave = np.stack([x, x**2], axis=1)
    master = np.stack([np.linspace(0.0, -4.0, 3), np.zeros(3)], axis=1)
    distance = np.sqrt(1.5**2 + 1.5**4)  # of the point (-1.5, 2.25)
    got = opening_behind(slave, master, distance, order=2)
    assert got[1] == pytest.approx(2.25, rel=ROUND_OFF)


@pytest.mark.parametrize("order", [1, 2])
def test_centre_crack_under_critical_opening(order: int) -> None:
    # Elliptic opening 4 s/E' sqrt(a^2 - x^2): at n behind the tip it is 4 s/E' sqrt(2 a n - n^2).
    a, n, strain = 10.0, 1.0, 1e-5
    exact = 4.0 * strain * np.sqrt(2.0 * a * n - n**2)
    h = 0.02 * np.arange(201)  # 50 nodes up to n: faces follow the ellipse to 1e-4
    half = 2.0 * strain * np.sqrt(2.0 * a * h - h**2)
    slave, master = (np.stack([a - h, y], axis=1) for y in (half, -half))
    got = opening_behind(slave, master, n, order)[1]
    # The straight line to the point is longer than n by (opening/n)^2/8 ~ 4e-9 only.
    assert got == pytest.approx(exact, rel=1e-4)
    assert CrackOpening(exact, distance=n).value([got]) == pytest.approx([1.0], rel=1e-4)


def test_path_that_ends_or_is_no_path_is_an_error() -> None:
    x = np.array([[0.0, 0.0], [-1.0, 0.1], [-2.0, 0.2]])
    with pytest.raises(InputError, match=r"master: the distance 1\.8 lies outside the end points"):
        opening_behind(x, 0.5 * x, 1.8, order=1)
    with pytest.raises(InputError, match=r"slave: .* NaN or infinite"):
        opening_behind(x * [np.nan, 1.0], x, 1.0, order=1)


def test_critical_opening_of_temperature() -> None:
    criterion = CrackOpening(Tabulated((0.0, 100.0), (0.2, 0.1)), distance=1.0)
    assert criterion.critical_at([0.0, 5.0], np.array([0.0, 50.0])) == pytest.approx([0.2, 0.15])
    half = CrackOpening(criterion.critical, distance=1.0, symmetry=True)
    assert half.value(0.05, temperature=100.0) == pytest.approx(1.0)
    with pytest.raises(InputError, match=r"critical depends on temperature.*Debond\(temperature"):
        criterion.value(0.1)


def test_critical_opening_against_crack_length() -> None:
    criterion = CrackOpening(([0.0, 2.0], [0.1, 0.3]), distance=1.0)
    # Not extrapolated: the end values hold outside.
    assert criterion.critical_at([-1.0, 0.0, 1.0, 5.0]) == pytest.approx([0.1, 0.1, 0.2, 0.3])
    assert criterion.value([0.1, 0.1, -1.0], [0.0, 1.0, 0.0]) == pytest.approx([1.0, 0.5, 0.0])
    assert criterion.release_range == (0.9, 1.1) and CrackOpening.allows_normal_only


def test_symmetry_halves_the_critical_opening_and_needs_a_normal_bond() -> None:
    criterion = CrackOpening(0.2, distance=1.0, symmetry=True)
    assert criterion.value([0.1, 0.05]) == pytest.approx([1.0, 0.5])
    criterion.check_bond(normal_only=True)
    with pytest.raises(InputError, match="symmetry needs a bond in the normal direction only"):
        criterion.check_bond(normal_only=False)
    CrackOpening(0.2, distance=1.0).check_bond(normal_only=False)


# --- crack length against time --------------------------------------------------------------------

CURVE = CrackLengthVsTime([1.0, 2.0, 4.0], [10.0, 12.0, 13.0], reference="left")


def test_crack_length_by_hand() -> None:
    # Tips at 11 and 12, nodes 1 and 0.5 behind; l(1.5) = 11.
    assert CURVE.value(1.5, [11.0, 12.0], [1.0, 0.5]) == pytest.approx([1.0, -1.0])
    assert CURVE.value(1.25, [11.0], [1.0]) == pytest.approx([0.5])
    assert CURVE.release_range == (0.9, 1.1) and CrackLengthVsTime.allows_normal_only


def test_no_extrapolation() -> None:
    assert CURVE.value(0.999, [10.0, 11.0], [1.0, 1.0]).tolist() == [0.0, 0.0]
    assert CURVE.value(1.0, [10.0], [1.0]) == pytest.approx([1.0])
    assert CURVE.value(100.0, [13.5], [1.0]) == CURVE.value(4.0, [13.5], [1.0])
    assert time_of(CURVE, 13.0) == pytest.approx(4.0)
    assert time_of(CURVE, 13.1) == math.inf
    assert time_of(CURVE, 5.0) == 1.0


def test_can_start() -> None:
    assert CURVE.can_start([9.9, 10.0, 10.0 * (1.0 - 1e-12), 11.0]).tolist() == [
        False, True, True, True,
    ]  # fmt: skip


@given(
    arrays(np.float64, 5, elements=st.floats(0.1, 3.0)),
    arrays(np.float64, 5, elements=st.one_of(st.just(0.0), st.floats(0.1, 3.0))),
    fractions,
)
def test_a_node_goes_when_the_curve_reaches_it(dt: Array, dl: Array, part: float) -> None:
    curve = CrackLengthVsTime(dt.cumsum(), 5.0 + dl.cumsum(), reference="left")
    tip = 5.0 + dl[0] + part * (dl.cumsum()[-1] - dl[0])
    time = time_of(curve, tip)
    # Times and lengths of about 20 over steps of at least 0.1.
    assert curve.value(time, [tip], [0.5]) == pytest.approx([1.0], abs=1e-12)
    if time > curve.times[0]:
        # Before that, f is below 1: it is the first such time.
        assert curve.value(time - 1e-6, [tip], [0.5])[0] < 1.0


def test_a_node_without_length_is_an_error() -> None:
    with pytest.raises(InputError, match="the node behind the tip must be positive, not 0"):
        CURVE.value(1.0, [10.0], [0.0])
