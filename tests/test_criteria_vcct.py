"""Energy release rates by virtual and exact closure, toughness, and the criteria holding them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fxcrack.base.errors import InputError
from fxcrack.criteria import (
    BK,
    VCCT,
    EnhancedVCCT,
    Power,
    Reeder,
    Tabulated,
    closure_rates,
    energy_release_rates,
)

Array = npt.NDArray[np.float64]

KINDS = ("equal_length", "tributary", "ahead", "ahead_sqrt", "behind")
ROUND_OFF = 1e-12  # a few roundings of well-scaled products

# Zeros and numbers far from underflow: products of tiny ones would round differently.
component = st.one_of(st.just(0.0), st.floats(1e-3, 10.0), st.floats(-10.0, -1e-3))
vectors = arrays(np.float64, (3, 1, 3), elements=component)
pairs = arrays(np.float64, (3, 2, 3), elements=component)
lengths = arrays(np.float64, 3, elements=st.floats(0.1, 10.0))
kinds = st.sampled_from(KINDS)
of_any_order = st.sampled_from(KINDS[1:])  # others: opening and force of one node

F = np.array([[[2.0, 3.0, -4.0]]])
W = np.array([[[0.1, 0.2, -0.3]]])


# --- virtual crack closure ------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_textbook_values_on_even_spacing(kind: Any) -> None:
    g = energy_release_rates(F, W, 0.5, 0.5, 2.0, normalisation=kind)
    assert g == pytest.approx(np.array([[0.1, 0.3, 0.6]]), rel=ROUND_OFF)
    second = energy_release_rates(
        np.concatenate([F, 2.0 * F], axis=1),
        np.concatenate([W, 0.5 * W], axis=1),
        0.5, 0.5, 2.0, normalisation=kind,
    )  # fmt: skip
    assert second == pytest.approx(2.0 * g, rel=ROUND_OFF)


@pytest.mark.parametrize(
    ("kind", "corner", "midside"),
    # ahead 1, behind 4: tributary length 2.5
    [
        ("tributary", np.sqrt(10.0), 2.0),
        ("ahead", 1.0, 1.0),
        ("ahead_sqrt", 2.0, 2.0),
        ("behind", 4.0, 4.0),
    ],
)
def test_lengths_on_uneven_spacing(kind: Any, corner: float, midside: float) -> None:
    product = np.array([[0.2, 0.6, 1.2]])
    g = energy_release_rates(F, W, 1.0, 4.0, 1.0, normalisation=kind)
    assert g == pytest.approx(product / 2.0 / corner, rel=ROUND_OFF)
    second = energy_release_rates(
        np.concatenate([0.0 * F, F], axis=1),
        np.concatenate([W, W], axis=1),
        1.0, 4.0, 1.0, normalisation=kind,
    )  # fmt: skip
    assert second == pytest.approx(product / 2.0 / midside, rel=ROUND_OFF)


def test_midside_term_of_the_singular_field_does_not_depend_on_the_spacing() -> None:
    # Nodal force of the traction 1/sqrt(r) over the element ahead, by its midside shape function
    # 4 x (1 - x), x = r/d: int_0^1 4 x (1 - x)/sqrt(x) dx = 16/15; opening sqrt(r) at d_behind/2.
    ahead, behind = np.array([1.0, 0.3, 5.0]), np.array([1.0, 2.0, 0.7])
    force, opening = np.zeros((2, 3, 2, 3))
    force[:, 1, 0] = 16.0 / 15.0 * np.sqrt(ahead)
    opening[:, 1, 0] = np.sqrt(behind / 2.0)
    g = energy_release_rates(force, opening, ahead, behind, 1.0, normalisation="tributary")[:, 0]
    assert g == pytest.approx(np.full(3, g[0]), rel=ROUND_OFF)


@pytest.mark.slow
@given(pairs, pairs, lengths, lengths, lengths, of_any_order)
def test_second_order_without_midside_nodes_is_first_order(
    f: Array, w: Array, ahead: Array, behind: Array, width: Array, kind: Any
) -> None:
    f[:, 1] = 0.0
    np.testing.assert_array_equal(
        energy_release_rates(f, w, ahead, behind, width, normalisation=kind),
        energy_release_rates(f[:, :1], w[:, :1], ahead, behind, width, normalisation=kind),
    )


def test_signs() -> None:
    closed = W * [-1.0, 1.0, 1.0]
    g = energy_release_rates(F, closed, 1.0, 1.0, 1.0)[0]
    assert g == pytest.approx([0.0, 0.3, 0.6], rel=ROUND_OFF)
    pressed = F * [-1.0, 1.0, -1.0]
    g = energy_release_rates(pressed, W, 1.0, 1.0, 1.0)[0]
    assert g[0] < 0.0 < g[1] and g[2] < 0.0
    # Pressed and closed: the product is positive, but no energy of opening.
    assert energy_release_rates(pressed, closed, 1.0, 1.0, 1.0)[0, 0] == 0.0


@pytest.mark.slow
@given(pairs, pairs, lengths, lengths, st.floats(0.0, 2.0 * np.pi), of_any_order)
def test_turning_the_tangents_keeps_the_shear_rate_and_bk(
    f: Array, w: Array, ahead: Array, behind: Array, angle: float, kind: Any
) -> None:
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    w[..., 1:] = f[..., 1:] * 0.1  # proportional: rates are positive in every frame
    a = energy_release_rates(f, w, ahead, behind, 1.0, normalisation=kind)
    b = energy_release_rates(f @ turn.T, w @ turn.T, ahead, behind, 1.0, normalisation=kind)
    np.testing.assert_array_equal(a[:, 0], b[:, 0])
    # Squares of components up to 10 cancel: round-off of products up to 10 over lengths of 0.1.
    np.testing.assert_allclose(a[:, 1:].sum(1), b[:, 1:].sum(1), rtol=ROUND_OFF, atol=1e-12)
    np.testing.assert_allclose(
        BK(1.5).ratio(a, [0.2, 0.8, 0.8]), BK(1.5).ratio(b, [0.2, 0.8, 0.8]), rtol=1e-9, atol=1e-9
    )


@pytest.mark.slow
@given(vectors, vectors, lengths, lengths, kinds)
def test_reversing_a_tangent_changes_nothing(
    f: Array, w: Array, ahead: Array, behind: Array, kind: Any
) -> None:
    for flip in ([1.0, -1.0, 1.0], [1.0, 1.0, -1.0]):
        np.testing.assert_array_equal(
            energy_release_rates(f * flip, w * flip, ahead, behind, 1.0, normalisation=kind),
            energy_release_rates(f, w, ahead, behind, 1.0, normalisation=kind),
        )


@pytest.mark.slow
@given(vectors, vectors, lengths, lengths, kinds, st.integers(-60, 60), st.integers(-60, 60))
def test_any_units_of_rates(
    f: Array, w: Array, ahead: Array, behind: Array, kind: Any, force: int, length: int
) -> None:
    # Powers of two are exact: [force/length] = [force][length]/[length^2]
    p, q = 4.0**force, 4.0**length
    np.testing.assert_array_equal(
        energy_release_rates(f * p, w * q, ahead * q, behind * q, q, normalisation=kind) * q / p,
        energy_release_rates(f, w, ahead, behind, 1.0, normalisation=kind),
    )


def test_areas_instead_of_lengths() -> None:
    np.testing.assert_allclose(
        energy_release_rates(F, W, 1.0 * 3.0, 4.0 * 3.0, 1.0),
        energy_release_rates(F, W, 1.0, 4.0, 3.0),
        rtol=ROUND_OFF,
    )


def test_last_node_of_the_surface() -> None:
    g = energy_release_rates(F, W, 0.0, 2.0, 1.0)
    assert g == pytest.approx(np.array([[0.2, 0.6, 1.2]]) / 2.0 / np.sqrt(2.0))
    with pytest.raises(InputError, match=r"d_ahead = 0\.0 at row 0"):
        energy_release_rates(F, W, 0.0, 2.0, 1.0, normalisation="ahead")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"d_behind": [1.0, 0.0]}, r"d_behind = 0\.0 at row 1"),
        ({"d_ahead": [math.nan, 1.0]}, r"d_ahead = nan at row 0"),
        ({"width": -1.0}, r"width = -1\.0 at row 0 .* must be positive"),
        ({"normalisation": "both"}, "'both' is unknown; choose from equal_length, tributary"),
        ({"opening": np.zeros((2, 2, 3))}, r"forces have shape \(2, 1, 3\) and openings"),
    ],
)
def test_bad_geometry_is_named(change: dict[str, Any], says: str) -> None:
    good: dict[str, Any] = {
        "force": np.ones((2, 1, 3)),
        "opening": np.ones((2, 1, 3)),
        "d_ahead": 1.0,
        "d_behind": 1.0,
        "width": 1.0,
    }
    with pytest.raises(InputError, match=says):
        energy_release_rates(**(good | change))


# --- exact crack closure --------------------------------------------------------------------------


def unit(seed: int, k: int) -> tuple[Array, Array, float]:
    """Forces and jumps of one unit with a random stiffness, and twice its closure energy."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(3 * k, 3 * k))
    stiffness = a @ a.T + np.eye(3 * k)
    p = rng.normal(size=3 * k)
    p[0] = np.abs(p[::3]).sum() + 0.1  # in tension as a whole
    delta = np.linalg.solve(stiffness, p)
    return p.reshape(1, k, 3), delta.reshape(1, k, 3), float(p @ delta)


@pytest.mark.parametrize("k", [1, 2])
@pytest.mark.parametrize("seed", range(5))
def test_closure_splits_the_energy(seed: int, k: int) -> None:
    p, delta, twice = unit(seed, k)
    rates = closure_rates(p, delta, 0.25)
    assert rates.sum() == pytest.approx(0.5 * twice / 0.25, rel=ROUND_OFF)
    # Hand: by component, over the nodes of the unit.
    assert rates[0, 1] == pytest.approx(2.0 * sum(p[0, i, 1] * delta[0, i, 1] for i in range(k)))


def test_closure_turns_with_the_frame() -> None:
    p, delta, _ = unit(1, 2)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    a, b = closure_rates(p, delta, 1.0)[0], closure_rates(p @ turn.T, delta @ turn.T, 1.0)[0]
    assert a[0] == b[0]
    assert a[1:].sum() == pytest.approx(b[1:].sum(), rel=ROUND_OFF)


def test_a_unit_in_compression_does_not_open() -> None:
    p = np.array([[[-1.0, 2.0, 0.0]], [[1.0, 2.0, 0.0]]])
    rates = closure_rates(p, 0.1 * p, [1.0, 2.0])
    assert rates == pytest.approx(np.array([[0.0, 0.2, 0.0], [0.025, 0.1, 0.0]]), rel=ROUND_OFF)


def test_a_pressed_corner_of_a_pulled_unit_counts() -> None:
    # Serendipity faces under uniform tension: corner -1/12, midside 1/3 of the face's force.
    p = np.array([[[-1.0, 0.0, 0.0], [4.0, 0.0, 0.0]]])
    delta = np.array([[[0.2, 0.0, 0.0], [0.3, 0.0, 0.0]]])
    assert closure_rates(p, delta, 1.0)[0, 0] == pytest.approx(0.5 * (1.2 - 0.2))


def test_a_unit_pressed_ahead_opens_if_that_sets_energy_free() -> None:
    # Arms thinner than an element is long: pulled at the tip, pressed harder at the midside ahead.
    p = np.array([[[2.0, 0.0, 0.0], [-3.0, 0.0, 0.0]]])
    delta = np.array([[[0.5, 0.0, 0.0], [0.1, 0.0, 0.0]]])
    assert closure_rates(p, delta, 1.0)[0, 0] == pytest.approx(0.5 * (1.0 - 0.3))
    assert closure_rates(p, -delta, 1.0)[0, 0] == 0.0


def test_closure_errors() -> None:
    p = np.ones((2, 1, 3))
    with pytest.raises(InputError, match=r"the area of unit 1 is 0\.0"):
        closure_rates(p, p, [1.0, 0.0])
    with pytest.raises(InputError, match=r"jumps \(2, 3\); both must be"):
        closure_rates(p, p[:, 0], 1.0)


# --- toughness ------------------------------------------------------------------------------------

X = np.array([[0.0, 1.0], [2.0, 1.0], [4.0, 1.0]])
NODES = np.array([1, 3, 4])
N_SLAVE = 6


def test_toughness_of_every_kind() -> None:
    per_node = np.arange(1.0, 7.0)
    table = Tabulated([20.0, 120.0], [1.0, 3.0])
    criterion = VCCT(GIc=per_node, GIIc=lambda x: 10.0 + x[0], GIIIc=table, mix=Reeder(1.5))
    got = criterion.toughness_at(X, NODES, np.array([0.0, 70.0, 500.0]), n_slave=N_SLAVE)
    # The table is linear between and constant beyond its ends.
    assert got.tolist() == [[2.0, 10.0, 1.0], [4.0, 12.0, 2.0], [5.0, 14.0, 3.0]]
    one = VCCT(GIc=table).toughness_at(X, NODES, 45.0, n_slave=N_SLAVE)
    assert (one == 1.5).all() and one.shape == (3, 3)


def test_shear_modes_default_to_the_mode_before() -> None:
    assert VCCT(0.2).toughness_at(X, NODES, n_slave=6)[0].tolist() == [0.2, 0.2, 0.2]
    two = VCCT(0.2, 0.8, mix=BK(1.5))
    assert two.toughness_at(X, NODES, n_slave=6)[0].tolist() == [0.2, 0.8, 0.8]


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ([1.0] * 4, r"GIc has 4 values for 6 slave nodes: without one: slave nodes 4, 5;"),
        ([1.0] * 5, r"5 values for 6 slave nodes: without one: slave node 5;"),
        ([1.0] * 8, r"8 values for 6 slave nodes: entries 6 to 7 are too many"),
        (lambda x: x[0], r"GIc = 0\.0 at slave node 1; .* not at slave node 1"),
        (lambda x: np.where(x[0] > 1.0, np.nan, 1.0), r"not at slave nodes 3, 4"),
        (
            lambda x: np.ones(7),
            r"GIc gives shape \(7,\) for positions x of shape \(3, 4\); one number per position",
        ),
        (Tabulated([0.0, 1.0], [1.0, 2.0]), "depends on temperature, but the debond has none"),
    ],
)
def test_missing_toughness_names_the_nodes(value: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        VCCT(GIc=value).toughness_at(X, NODES, n_slave=N_SLAVE)


def test_values_per_node_are_checked_before_the_analysis() -> None:
    with pytest.raises(InputError, match=r"GIc = nan at slave node 2; .* slave nodes 2, 5"):
        VCCT(GIc=[1.0, 1.0, np.nan, 1.0, 1.0, 0.0])
    with pytest.raises(InputError, match=r"slave nodes 0, 1, 2, 3, 4, 5, 6, 7 and 12 more"):
        VCCT(GIc=np.zeros(20))
    criterion = VCCT(GIc=[1.0, 2.0])
    criterion.check_slaves(2)
    with pytest.raises(InputError, match="2 values for 3 slave nodes"):
        criterion.check_slaves(3)


def test_nan_temperature_is_named() -> None:
    with pytest.raises(InputError, match="GIc = nan at slave node 3"):
        VCCT(GIc=Tabulated([0.0, 1.0], [1.0, 2.0])).toughness_at(
            X, NODES, np.array([0.0, np.nan, 1.0]), n_slave=N_SLAVE
        )


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Tabulated([0.0, 0.0], [1.0, 2.0]), r"entry 1 \(0\) follows entry 0 \(0\)"),
        (lambda: Tabulated([0.0, 1.0], [1.0]), r"has shape \(2,\) and values has \(1,\)"),
        (lambda: Tabulated([0.0, 1.0], [1.0, -2.0]), r"values\[1\] = -2\.0 must be positive"),
        (lambda: Tabulated([0.0, math.inf], [1.0, 2.0]), r"temperatures\[1\] = inf"),
        (lambda: Tabulated("cold", [1.0]), "must be lists of numbers"),
        (lambda: VCCT(-0.2), r"VCCT: GIc = -0\.2 must be positive"),
        (lambda: VCCT("tough"), "VCCT: GIc = 'tough' is not a number"),
        (lambda: VCCT([[1.0, 2.0]]), r"flat list .* but it is a list of shape \(1, 2\)"),
        (lambda: VCCT(0.2, 0.8), "no mode-mix law; add mix=BK"),
        (lambda: VCCT(0.2, GIIIc=0.8), "no mode-mix law; add mix=BK"),
        (lambda: VCCT(0.2, tolerance=-0.1), "tolerance = -0.1 must be zero or positive"),
        (lambda: VCCT(0.2, viscosity=math.inf), "viscosity = inf must be"),
        (lambda: VCCT(0.2, unstable_tolerance=0.1), "unstable_tolerance = 0.1 is below tolerance"),
        (lambda: VCCT(0.2, unstable_tolerance=math.nan), "unstable_tolerance is NaN"),
        (lambda: VCCT(0.2, method="j"), "method = 'j' is unknown; choose from vcct, closure"),
        (lambda: VCCT(0.2, normalisation="x"), "normalisation = 'x' is unknown"),
        (lambda: EnhancedVCCT(0.2, GIc_p=[0.1, 0.2]), "EnhancedVCCT: GIc_p is given per slave"),
        (lambda: EnhancedVCCT([0.2], GIc_p=0.1), "EnhancedVCCT: GIc is given per slave node"),
        (lambda: EnhancedVCCT(0.2, 0.8, GIc_p=0.1, mix=BK(1.0)), "GIIc and GIIc_p belong"),
        (lambda: EnhancedVCCT(0.2, GIc_p=0.0), r"GIc_p = 0\.0 must be positive"),
    ],
)
def test_bad_criteria_are_refused_when_written(make: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        make()


# --- the criteria ---------------------------------------------------------------------------------


@pytest.mark.parametrize("mix", [None, BK(2.0), Reeder(0.5), Power(1.0, 1.0)])
def test_one_toughness_needs_no_law(mix: Any) -> None:
    criterion = VCCT(GIc=0.2, mix=mix)
    toughness = criterion.toughness_at(X[:1], NODES[:1], n_slave=6)
    assert criterion.ratio([[0.1, 0.1, 0.04]], toughness) == pytest.approx([1.2])
    assert criterion.critical([[0.1, 0.1, 0.04]], toughness) == pytest.approx([0.2])


def test_release_ranges() -> None:
    assert VCCT(0.2).release_range == (1.0, 1.2)
    assert not VCCT(0.2).allows_normal_only


def test_enhanced_vcct_has_two_toughnesses() -> None:
    criterion = EnhancedVCCT(0.3, 0.9, mix=BK(2.0), GIc_p=0.2, GIIc_p=0.5)
    onset = criterion.toughness_at(X, NODES, n_slave=6)
    growth = criterion.propagation_toughness_at(X, NODES, n_slave=6)
    assert onset[0].tolist() == [0.3, 0.9, 0.9] and growth[0].tolist() == [0.2, 0.5, 0.5]
    mix = np.array([[1.0, 1.0, 0.0]] * 3)
    assert criterion.critical(mix, onset) == pytest.approx(np.full(3, 0.3 + 0.6 * 0.25))
    assert criterion.critical(mix, growth) == pytest.approx(np.full(3, 0.2 + 0.3 * 0.25))
