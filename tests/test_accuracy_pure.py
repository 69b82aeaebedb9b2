"""Accuracy studies, the pure parts: front, cheapest setting, exponents, plan, advice."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fxcrack.accuracy import Setting, Study
from fxcrack.accuracy.family import settings
from fxcrack.accuracy.pareto import advice, cheapest, duration, pareto_front, percent
from fxcrack.accuracy.prediction import extrapolate, fit_power, plan, predict, unknowns
from fxcrack.accuracy.reference import own_reference, reference, worst
from fxcrack.accuracy.scenes import STUDIES
from fxcrack.base.errors import InputError

positive = st.floats(1e-3, 1e3)
points = st.lists(st.tuples(positive, positive), min_size=1, max_size=30)


# -- front and advice ----------------------------------------------------------------


@given(points)
def test_the_front_is_beaten_by_nobody_and_beats_everybody(
    found: list[tuple[float, float]],
) -> None:
    t, e = np.array(found).T
    front = pareto_front(t, e, gain=0.0)
    assert np.all(np.diff(t[front]) >= 0.0)
    assert np.all(np.diff(e[front]) < 0.0)
    for i in range(len(t)):
        better = (t[front] <= t[i]) & (e[front] <= e[i])
        assert better.any()  # by itself, or by another
    for i in front:
        assert not np.any((t < t[i]) & (e <= e[i]))


@pytest.mark.slow
@given(points, st.floats(0.0, 0.5))
def test_each_step_of_the_front_saves_its_share(
    found: list[tuple[float, float]], gain: float
) -> None:
    t, e = np.array(found).T
    front = pareto_front(t, e, gain=gain)
    for a, b in itertools.pairwise(front):
        assert e[b] < e[a] * (1.0 - gain)
    assert set(front) <= set(range(len(t)))
    assert t[front[0]] == t.min()


def test_points_that_are_no_numbers_are_not_on_the_front() -> None:
    assert pareto_front([1.0, 2.0, np.nan], [np.nan, 0.1, 0.01]) == [1]
    assert pareto_front([1.0], [np.nan]) == []


@given(points, positive)
def test_the_cheapest_is_good_enough_and_nothing_as_good_is_faster_than_noise(
    found: list[tuple[float, float]], target: float
) -> None:
    t, e = np.array(found).T
    i = cheapest(t, e, target)
    good = e <= target
    if i is None:
        assert not good.any()
    else:
        assert good[i]
        assert t[i] <= 1.1 * t[good].min()  # within the noise the more accurate one


def test_of_equals_the_plainer_one_is_advised() -> None:
    assert cheapest([1.0, 0.95, 2.0], [0.01, 0.01, 0.001], 0.05) == 0
    assert cheapest([1.0, 0.95, 2.0], [0.02, 0.01, 0.001], 0.05) == 1
    assert cheapest([1.0, 0.8, 2.0], [0.01, 0.02, 0.001], 0.05) == 1


def test_advice_names_the_cheapest_for_each_accuracy_or_says_that_none_reached_it() -> None:
    names, t, e = ["coarse", "middle", "fine"], [0.1, 0.4, 2.0], [0.03, 0.008, 0.004]
    said = advice(names, t, e)
    assert said == (
        "For 5 % use coarse (0.1 s); for 1 % use middle (0.4 s); none reached 0.1 % "
        "(the best has 0.4 %)."
    )
    # what is not known of the reference counts as error
    said = advice(names, t, e, uncertainty=0.005)
    assert "for 1 % use fine (2 s)" in said
    assert "the best has 0.9 %" in said
    assert advice(names, t, [1e-4] * 3) == "For 5 % and 1 % and 0.1 % use coarse (0.1 s)."
    assert advice(names, t, [np.nan] * 3) == "None reached 5 % and 1 % and 0.1 %."


def test_shares_and_seconds_are_written_in_two_digits() -> None:
    assert [percent(x) for x in (0.05, 0.0123, 0.00056)] == ["5 %", "1.2 %", "0.056 %"]
    assert [duration(x) for x in (0.0123, 0.456, 12.3, 123.4)] == [
        "12 ms",
        "0.46 s",
        "12 s",
        "123 s",
    ]


# -- exponents and plans -------------------------------------------------------------


@given(st.floats(1e-6, 1e3), st.floats(-3.0, 3.0), st.integers(2, 6))
def test_a_power_is_found_again(factor: float, exponent: float, n: int) -> None:
    x = 10.0 ** np.arange(1, n + 1)
    power = fit_power(x, factor * x**exponent)
    assert power is not None
    assert power.exponent == pytest.approx(exponent, abs=1e-9)  # round-off of logarithms
    np.testing.assert_allclose(power(x), factor * x**exponent, rtol=1e-8)


def test_no_power_goes_through_one_point() -> None:
    assert fit_power([1.0], [2.0]) is None
    assert fit_power([1.0, 1.0], [2.0, 3.0]) is None
    assert fit_power([1.0, 2.0], [0.0, 3.0]) is None


@given(
    st.floats(0.1, 10.0), st.floats(-1.0, 1.0).filter(lambda c: abs(c) > 1e-2),
    st.floats(0.6, 1.95),
)  # fmt: skip
def test_extrapolation_finds_limit_and_rate(limit: float, c: float, rate: float) -> None:
    sizes = [0.4, 0.2, 0.1]
    found, exponent, correction = extrapolate(sizes, [limit + c * h**rate for h in sizes])
    assert found == pytest.approx(limit, abs=1e-9)  # three points determine it; round-off
    assert exponent == pytest.approx(rate, abs=1e-6)
    assert correction == pytest.approx(abs(c) * 0.1**rate, rel=1e-5)


def test_extrapolation_is_of_first_order_where_nothing_tells_the_rate() -> None:
    assert extrapolate([0.2, 0.1], [1.2, 1.1])[0] == pytest.approx(1.0)
    assert extrapolate([0.4, 0.2, 0.1], [1.0, 1.2, 1.1])[:2] == pytest.approx((1.0, 1.0))


sizes = st.floats(0.01, 10.0)
some = st.builds(
    Setting, size=sizes, order=st.sampled_from([1, 2]), ranks=st.sampled_from([1, 2]),
    cell=st.sampled_from(["quadrilateral", "hexahedron"]),
)  # fmt: skip


@given(st.dictionaries(some, positive, max_size=6), some)
def test_predictions_are_seconds_and_finer_is_dearer(
    done: dict[Setting, float], setting: Setting
) -> None:
    seconds = predict(setting, done)
    assert 0.0 < seconds < np.inf
    line = {s: t for s, t in done.items() if s.line == setting.line}
    finer = replace(setting, size=0.5 * min([s.size for s in line] + [setting.size]))
    if line:
        last = min(line, key=lambda s: s.size)
        assert predict(finer, done) > done[last]


def test_a_line_predicts_itself() -> None:
    base = Setting(size=1.0)
    done = {replace(base, size=h): 0.01 * unknowns(replace(base, size=h)) for h in (1.0, 0.5, 0.25)}
    assert predict(replace(base, size=0.125), done) == pytest.approx(0.64)


@given(st.sets(some, max_size=8), st.dictionaries(some, positive, max_size=4), positive)
def test_the_plan_is_cheap_first_and_fits(
    waiting: set[Setting], done: dict[Setting, float], left: float
) -> None:
    setting, seconds = plan(waiting, done, left)
    costs = {s: predict(s, done) for s in waiting}
    assert seconds == min(costs.values(), default=np.inf)
    if setting is None:
        assert not costs or min(costs.values()) > left
    else:
        assert costs[setting] == seconds <= left


# -- reference -----------------------------------------------------------------------


def _line(
    setting: Setting, limit: float, c: float, rate: float
) -> list[tuple[Setting, dict[str, float]]]:
    return [
        (replace(setting, size=h), {"load": limit + c * h**rate, "other": 1.0})
        for h in (1.0, 0.5, 0.25)
    ]


def test_the_reference_is_the_limit_of_the_best_line_and_the_others_say_how_good_it_is() -> None:
    runs = _line(Setting(size=1.0), 10.0, 0.06, 1.0)  # changes by 0.015 at last
    runs += _line(Setting(size=1.0, order=2), 10.01, 0.07, 2.0)  # by 0.013
    runs += _line(Setting(size=1.0, stepping="increment"), 12.0, 0.0, 1.0)
    known = own_reference(runs, "event")
    assert known is not None
    assert known.values["load"] == pytest.approx(10.01)
    assert known.uncertainty["load"] == pytest.approx(0.01 / 10.01)
    assert "2nd-order quad" in known.source
    assert known.errors({"load": 10.51})["load"] == pytest.approx(0.5 / 10.01)


def test_lines_far_from_their_limit_do_not_speak_for_the_reference() -> None:
    runs = _line(Setting(size=1.0, cell="triangle"), 11.0, 4.0, 1.0)
    runs += _line(Setting(size=1.0), 10.0, 0.1, 2.0)
    known = own_reference(runs, "event")
    assert known is not None
    assert known.values["load"] == pytest.approx(10.0)
    # nobody else comes near: the correction itself says how well it is known
    assert known.uncertainty["load"] == pytest.approx(0.1 / 16.0 / 10.0)


def test_an_exact_closed_form_is_preferred_and_beam_theory_is_not() -> None:
    runs = _line(Setting(size=1.0), 10.0, 1.0, 1.0)
    theory = {"source": "somebody", "exact": True, "values": {"load": 9.0}}
    known = reference(runs, theory, "event")
    assert known is not None
    assert known.exact
    assert known.values == {"load": 9.0}
    known = reference(runs, {**theory, "exact": False}, "event")
    assert known is not None
    assert known.values["load"] == pytest.approx(10.0)
    assert reference(runs[:1], None, "event") is None


def test_the_worst_error_is_of_load_g_and_length() -> None:
    errors = {"load": 0.1, "G": 0.2, "cycles": 0.9}
    assert worst(errors, "worst") == 0.2
    assert worst(errors, "cycles") == 0.9
    assert np.isnan(worst(errors, "length"))


# -- settings ------------------------------------------------------------------------


@pytest.mark.parametrize("name", STUDIES)
def test_families_are_whole_lines_without_repetition(name: str) -> None:
    study = STUDIES[name]
    found = settings(study)
    assert len(set(found)) == len(found)
    base = found[0]
    for order in study.orders:
        for cell in study.cells:
            for size in study.sizes:
                one = replace(base, order=order, cell=cell, size=size)
                assert (one in found) == (study.admits is None or study.admits(one))
    assert {s.ranks for s in found} == set(study.ranks)
    assert {s.tolerance for s in found} == {None, *study.tolerances}
    assert len({str(s) for s in found}) == len(found)  # names tell them apart


def test_a_study_says_what_it_lacks() -> None:
    with pytest.raises(InputError, match="--sizes"):
        settings(Study(lambda s: None, title="mine"))  # type: ignore[arg-type,return-value]
    none = replace(STUDIES["dcb"], admits=lambda s: False)
    with pytest.raises(InputError, match="admits none"):
        settings(none)
    with pytest.raises(InputError, match="orders empty"):
        settings(replace(STUDIES["dcb"], orders=()))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"size": 0.0}, "size = 0.0"),
        ({"size": float("nan")}, "size = nan"),
        ({"size": 1.0, "cell": "pyramid"}, "pyramid"),
        ({"size": 1.0, "order": 3}, "order = 3"),
        ({"size": 1.0, "tolerance": 0.1}, "increment"),
    ],
)
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Setting(**wrong)  # type: ignore[arg-type]
