"""Mode-mix laws: hand-computed values, limits, and what holds for any rates."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fxcrack.base.errors import InputError
from fxcrack.criteria import BK, MixedMode, Power, Reeder, clip, total

Array = npt.NDArray[np.float64]

LAWS = [BK(1.62), BK(0.7), Reeder(2.1), Power(1.0, 1.0, 1.0), Power(1.5, 2.5, 0.8), Power(2.0, 1.0)]

# Rates over six decades, and exact zeros, which are the limits of the laws.
rate = st.one_of(st.just(0.0), st.floats(1e-3, 1e3))
rates = arrays(np.float64, (4, 3), elements=rate)
toughness = arrays(np.float64, (4, 3), elements=st.floats(0.01, 100.0))
laws = st.sampled_from(LAWS)

# A dozen roundings of the mode mix, amplified by toughnesses up to 1e4 apart between modes.
ROUND_OFF = 1e-11


@pytest.fixture(autouse=True)
def _zeros_and_units_raise_nothing() -> object:
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        yield


def test_hand_computed_values() -> None:
    g, gc = [[0.1, 0.2, 0.1]], [0.2, 0.8, 1.0]
    # B = 0.75, B^2 = 0.5625; G_III/(G_II + G_III) = 1/3
    assert BK(2.0).critical(g, gc) == pytest.approx([0.2 + 0.6 * 0.5625])
    assert BK(2.0).ratio(g, gc) == pytest.approx([0.4 / 0.5375])
    assert Reeder(2.0).critical(g, gc) == pytest.approx([0.2 + (0.6 + 0.2 / 3.0) * 0.5625])
    assert Reeder(2.0).ratio(g, gc) == pytest.approx([0.4 / 0.575])
    assert Power(2.0, 1.0, 3.0).ratio(g, gc) == pytest.approx([0.25 + 0.25 + 0.001])
    assert Power(2.0, 1.0).ratio(g, gc) == pytest.approx([0.25 + 0.25 + 0.1])
    # Mode I and II in equal parts of a toughness of 1: x^2 + x = 1
    x = (np.sqrt(5.0) - 1.0) / 2.0
    assert Power(2.0, 1.0).critical([[3.0, 3.0, 0.0]], [1.0, 1.0, 1.0]) == pytest.approx([2.0 * x])


@pytest.mark.parametrize("law", LAWS)
def test_pure_modes_grow_at_their_toughness(law: MixedMode) -> None:
    gc = np.array([0.2, 0.8, 0.8 if isinstance(law, BK) else 1.3])
    pure = np.diag(gc)
    assert law.ratio(pure, gc) == pytest.approx(np.ones(3), rel=ROUND_OFF)
    assert law.critical(0.3 * pure, gc) == pytest.approx(gc, rel=ROUND_OFF)


@pytest.mark.parametrize("law", LAWS)
def test_no_rate_means_no_growth(law: MixedMode) -> None:
    none = np.array([[0.0, 0.0, 0.0], [-1.0, -2.0, 0.0]])
    assert (law.ratio(none, [0.2, 0.8, 1.0]) == 0.0).all()
    assert (law.critical(none, [0.2, 0.8, 1.0]) == 0.2).all()
    assert law.ratio(np.zeros((0, 3)), [0.2, 0.8, 1.0]).shape == (0,)


@pytest.mark.parametrize("law", LAWS)
def test_nan_is_not_hidden(law: MixedMode) -> None:
    bad = np.array([[np.nan, 0.1, 0.0], [0.1, 0.1, 0.1]])
    f = law.ratio(bad, [0.2, 0.8, 1.0])
    assert np.isnan(f[0]) and f[1] > 0.0
    assert np.isnan(law.critical(bad, [0.2, 0.8, 1.0])[0])


def test_clip_and_total() -> None:
    g = [[1.0, -2.0, 0.5], [-1.0, 0.0, -0.0]]
    assert clip(g).tolist() == [[1.0, 0.0, 0.5], [0.0, 0.0, 0.0]]
    assert total(g).tolist() == [1.5, 0.0]


@pytest.mark.slow
@given(laws, rates, toughness, arrays(np.float64, (4, 3), elements=st.floats(0.0, 1e3)))
def test_negative_rates_count_as_zero(law: MixedMode, g: Array, gc: Array, below: Array) -> None:
    negative = np.where(g == 0.0, -below, g)
    np.testing.assert_array_equal(law.ratio(negative, gc), law.ratio(g, gc))
    np.testing.assert_array_equal(law.critical(negative, gc), law.critical(g, gc))


@pytest.mark.slow
@given(laws, rates, toughness, st.floats(1.01, 100.0))
def test_grows_with_the_load(law: MixedMode, g: Array, gc: Array, load: float) -> None:
    f = law.ratio(g, gc)
    some = g.max(axis=1) > 0.0
    assert (law.ratio(load * g, gc)[some] > f[some]).all()


@pytest.mark.slow
@given(laws, rates, toughness, st.integers(-250, 250))
def test_any_units(law: MixedMode, g: Array, gc: Array, decades: int) -> None:
    unit = 10.0**decades
    np.testing.assert_allclose(law.ratio(g * unit, gc * unit), law.ratio(g, gc), rtol=ROUND_OFF)
    np.testing.assert_allclose(
        law.critical(g * unit, gc * unit) / unit, law.critical(g, gc), rtol=ROUND_OFF
    )


@given(laws, rates, toughness, st.floats(1e-3, 1e3))
def test_critical_depends_on_the_mix_alone_and_gives_one(
    law: MixedMode, g: Array, gc: Array, load: float
) -> None:
    critical = law.critical(g, gc)
    np.testing.assert_allclose(law.critical(load * g, gc), critical, rtol=ROUND_OFF)
    some = g.max(axis=1) > 0.0
    at_growth = g[some] * (critical[some] / total(g[some]))[:, None]
    np.testing.assert_allclose(law.ratio(at_growth, gc[some]), 1.0, rtol=ROUND_OFF)


@given(laws, rates, toughness)
def test_rows_are_independent(law: MixedMode, g: Array, gc: Array) -> None:
    single = [law.ratio(g[i : i + 1], gc[i])[0] for i in range(4)]
    # Vector and scalar code of numpy may round powers differently.
    np.testing.assert_allclose(law.ratio(g, gc), single, rtol=ROUND_OFF)


@given(rates, toughness, st.floats(0.2, 5.0))
def test_reeder_is_bk_when_both_shear_modes_are_equally_tough(
    g: Array, gc: Array, eta: float
) -> None:
    gc[:, 2] = gc[:, 1]
    np.testing.assert_allclose(Reeder(eta).ratio(g, gc), BK(eta).ratio(g, gc), rtol=ROUND_OFF)


@given(rates, toughness, st.floats(0.2, 5.0))
def test_all_laws_agree_for_one_toughness(g: Array, gc: Array, eta: float) -> None:
    one = np.repeat(gc[:, :1], 3, axis=1)
    expected = total(g) / gc[:, 0]
    for law in (BK(eta), Reeder(eta), Power(1.0, 1.0, 1.0)):
        np.testing.assert_allclose(law.ratio(g, one), expected, rtol=ROUND_OFF)
        np.testing.assert_allclose(law.critical(g, one), gc[:, 0], rtol=ROUND_OFF)


@given(rates, toughness)
def test_linear_laws_agree_without_mode_three(g: Array, gc: Array) -> None:
    # 1/G_c of the linear power law is the mean of 1/G_ic, that of BK with eta = 1 is 1/mean.
    g[:, 2] = 0.0
    some = total(g) > 0.0
    share = g[some] / total(g[some])[:, None]
    power = (share / gc[some]).sum(axis=1)
    np.testing.assert_allclose(Power(1.0, 1.0).critical(g, gc)[some], 1.0 / power, rtol=ROUND_OFF)
    bk = share[:, 0] * gc[some, 0] + share[:, 1] * gc[some, 1]
    np.testing.assert_allclose(BK(1.0).critical(g, gc)[some], bk, rtol=ROUND_OFF)


@given(rates, toughness, st.integers(0, 2), st.floats(1.01, 10.0))
def test_power_law_grows_with_each_mode(g: Array, gc: Array, mode: int, more: float) -> None:
    larger = g.copy()
    larger[:, mode] = (larger[:, mode] + 0.1) * more
    law = Power(1.5, 0.6, 2.0)
    assert (law.ratio(larger, gc) >= law.ratio(g, gc)).all()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: BK(0.0), "BK: eta = 0.0 must be positive"),
        (lambda: Reeder(float("nan")), "Reeder: eta is NaN"),
        (lambda: Reeder(float("inf")), "Reeder: eta = inf must be positive and finite"),
        (lambda: Power(1.0, -1.0), "Power: an = -1.0 must be positive"),
        (lambda: Power(1.0, 1.0, 0.0), "Power: ao = 0.0 must be positive"),
        (lambda: BK("high"), "BK: eta = 'high' is not a number"),
    ],
)
def test_bad_exponents_are_named(make: object, says: str) -> None:
    with pytest.raises(InputError, match=says):
        make()  # type: ignore[operator]
