"""Fatigue: regimes, onset, the jump to the next release, and N(a) of a DCB in closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fxcrack import criteria
from fxcrack.base.errors import InputError
from fxcrack.criteria import BK, CycleJump, CycleRates, Fatigue, FatigueLaw, Paris, Regime

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-12  # powers are taken through logarithms of moderate size

# N0 = 100 dG^-2, da/dN = 0.01 dG^3, threshold 0.1, upper limit 0.8 of a toughness of 1
LAW = Paris(100.0, -2.0, 0.01, 3.0, r1=0.1, r2=0.8)
DONE: dict[str, Any] = {"initiated": True}


def cycle_jump(law: FatigueLaw, dG: Any, G_max: Any, G_c: Any, da: Any, **more: Any) -> CycleJump:
    """The jump of a front in mode I."""
    return criteria.cycle_jump(law, CycleRates(dG, G_max, G_c), da, **more)


ranges = arrays(np.float64, 5, elements=st.floats(0.11, 0.79))


def test_onset_and_growth_by_hand() -> None:
    assert LAW.onset_cycles([0.5, 0.0]) == pytest.approx([400.0, math.inf], rel=ROUND_OFF)
    assert LAW.growth_rate([0.5, 0.0]) == pytest.approx([0.00125, 0.0], rel=ROUND_OFF)
    at_once = Paris(0.0, -2.0, 0.01, 3.0)
    assert at_once.onset_cycles([0.5, 0.0]).tolist() == [0.0, 0.0]
    assert (at_once.r1, at_once.r2) == (0.01, 0.85)


def test_steep_laws_do_not_overflow_on_the_way() -> None:
    # (1e-40)^-8 alone is beyond the largest float.
    assert Paris(1e-200, -8.0, 1.0, 1.0).onset_cycles(1e-40) == pytest.approx(1e120, rel=1e-10)


def test_regimes_include_their_limits() -> None:
    top = np.array([0.0, 0.1, 0.1001, 0.7999, 0.8, 5.0])
    got = LAW.regimes(CycleRates(top, top, np.ones(6)))
    assert got.tolist() == [
        Regime.NONE, Regime.NONE, Regime.PARIS, Regime.PARIS, Regime.UNSTABLE, Regime.UNSTABLE,
    ]  # fmt: skip


def test_extremes_of_a_cycle() -> None:
    criterion = Fatigue(0.2, 0.8, mix=BK(1.0), paris=LAW)
    rates = np.array(
        [
            [[0.10, 0.10, 0.0], [0.01, -0.5, 0.0]],
            [[0.00, 0.05, 0.0], [0.03, 0.01, 0.0]],
            [[0.01, 0.01, 0.0], [0.02, 0.02, 0.0]],
        ]
    )
    found = criterion.cycle(rates, [0.2, 0.8, 0.8])
    dG, top, critical = found.dG, found.G_max, found.G_c
    assert found.shear == pytest.approx([0.5, 0.25])
    assert dG == pytest.approx([0.18, 0.03])
    assert top == pytest.approx([0.2, 0.04])
    # Mode mix of the largest rate: B = 0.5 and 0.25 (first of equals).
    assert critical == pytest.approx([0.5, 0.2 + 0.6 * 0.25])


def test_load_ratio_of_a_linear_structure() -> None:
    criterion = Fatigue(0.2, paris=LAW)
    g = np.array([[0.1, 0.05, 0.0]])
    found = criterion.cycle(np.stack([g, 0.3**2 * g]), [0.2, 0.2, 0.2])
    dG, top, critical = found.dG, found.G_max, found.G_c
    assert found.R == pytest.approx([0.3], rel=1e-12)
    assert dG == pytest.approx((1.0 - 0.3**2) * 0.15)
    assert (top[0], critical[0]) == pytest.approx((0.15, 0.2))


# --- one jump -------------------------------------------------------------------------------------


def test_onset_then_growth_in_one_jump() -> None:
    jump = cycle_jump(LAW, [0.5], [0.5], 1.0, 0.25)
    assert jump.cycles == pytest.approx(400.0 + 200.0)
    assert jump.event == "growth"
    assert jump.release.tolist() == [True] and jump.initiated.tolist() == [True]
    # Onset partly over, or over.
    assert cycle_jump(LAW, [0.5], [0.5], 1.0, 0.25, cycles=150.0).cycles == pytest.approx(600.0)
    assert cycle_jump(LAW, [0.5], [0.5], 1.0, 0.25, cycles=1e3).cycles == pytest.approx(1200.0)
    assert cycle_jump(LAW, [0.5], [0.5], 1.0, 0.25, **DONE).cycles == pytest.approx(200.0)


def test_onset_of_one_node_does_not_wait_for_another() -> None:
    # The first goes at 400 + 200; the second has its onset at 100/0.45^2 = 494, growth to 768.
    jump = cycle_jump(LAW, [0.5, 0.45, 0.2], [0.5, 0.45, 0.2], 1.0, 0.25, tolerance=0.2)
    assert jump.release.tolist() == [True, False, False]
    assert jump.initiated.tolist() == [True, True, False]


def test_ties_go_together() -> None:
    da = np.array([1.0, 1.19, 1.21])
    jump = cycle_jump(LAW, [0.5] * 3, [0.5] * 3, 1.0, da, tolerance=0.2, **DONE)
    assert jump.cycles == pytest.approx(800.0)
    assert jump.release.tolist() == [True, True, False]


def test_credit_is_kept_when_asked_for() -> None:
    dG = [0.5, 0.4]
    jump = cycle_jump(LAW, dG, dG, 1.0, 0.25, credit=[0.05, 0.0], **DONE)
    assert jump.cycles == pytest.approx(160.0)  # 0.2/0.00125
    assert jump.credit == pytest.approx([0.0, 160.0 * 0.01 * 0.4**3])
    assert cycle_jump(LAW, dG, dG, 1.0, 0.25, **DONE).credit is None
    # Credit is earned only after onset: the second has N0 = 625, past the release at 600.
    fresh = cycle_jump(LAW, dG, dG, 1.0, 0.25, credit=[0.0, 0.0])
    assert fresh.credit is not None and fresh.credit[1] == 0.0


def test_credit_makes_steps_of_growth_add_up() -> None:
    # Two fronts of constant, different rates and element lengths: each must move at its own speed.
    dG, da = np.array([0.5, 0.4]), np.array([0.1, 0.07])
    credit, cycles, moved = np.zeros(2), 0.0, np.zeros(2)
    for _ in range(200):
        jump = cycle_jump(LAW, dG, dG, 1.0, da, cycles=cycles, credit=credit, tolerance=0.0, **DONE)
        assert jump.credit is not None
        moved += np.where(jump.release, da, 0.0)
        cycles, credit = jump.cycles, jump.credit
    # 200 sums of round-off.
    assert moved + credit == pytest.approx(LAW.growth_rate(dG) * cycles, rel=1e-10)


def test_beyond_the_upper_limit_one_cycle_at_a_time() -> None:
    g = [0.9, 0.5, 0.05]
    jump = cycle_jump(LAW, g, g, 1.0, 0.25, cycles=7.0, credit=np.zeros(3), **DONE)
    assert (jump.cycles, jump.event) == (8.0, "unstable")
    assert jump.release.tolist() == [True, False, False]
    assert jump.regime.tolist() == [2, 1, 0]
    assert jump.credit == pytest.approx([0.0, 0.00125, 0.0])
    # A node of the Paris regime that finishes within this cycle goes with them.
    done = cycle_jump(LAW, g, g, 1.0, [0.25, 0.001, 0.25], **DONE)
    assert done.release.tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("dG", "top"),
    [([0.05, 0.1], [0.05, 0.1]), ([0.0, 0.0], [0.5, 0.5])],  # threshold; no range
)
def test_arrest(dG: Any, top: Any) -> None:
    jump = cycle_jump(LAW, dG, top, 1.0, 0.25, cycles=50.0)
    assert (jump.cycles, jump.event) == (50.0, "arrest")
    assert not jump.release.any() and not jump.initiated.any()


def test_limit_of_cycles() -> None:
    jump = cycle_jump(LAW, [0.5], [0.5], 1.0, 0.25, cycles=100.0, limit=500.0, credit=[0.0])
    assert (jump.cycles, jump.event) == (500.0, "limit")
    assert not jump.release.any() and jump.initiated.all()
    assert jump.credit == pytest.approx([100.0 * 0.00125])  # onset at 400
    # A release just at the limit still happens.
    free = cycle_jump(LAW, [0.5], [0.5], 1.0, 0.25)
    exact = cycle_jump(LAW, [0.5], [0.5], 1.0, 0.25, limit=free.cycles)
    assert exact.event == "growth" and exact.cycles == free.cycles
    unstable = cycle_jump(LAW, [0.9], [0.9], 1.0, 0.25, cycles=9.5, limit=10.0)
    assert (unstable.cycles, unstable.event) == (10.0, "limit") and not unstable.release.any()


@given(ranges, st.permutations(range(5)))
def test_order_of_nodes_does_not_matter(dG: Array, order: list[int]) -> None:
    a = cycle_jump(LAW, dG, dG, 1.0, 0.25, **DONE)
    b = cycle_jump(LAW, dG[order], dG[order], 1.0, 0.25, **DONE)
    assert a.cycles == pytest.approx(b.cycles, rel=ROUND_OFF)
    np.testing.assert_array_equal(a.release[order], b.release)


@given(ranges, st.floats(1.001, 2.0))
def test_more_load_means_fewer_cycles(dG: Array, load: float) -> None:
    # Toughness high enough to stay in the Paris regime.
    less = cycle_jump(LAW, dG, dG, 3.0 * dG.min(), 0.25, **DONE)
    more = cycle_jump(LAW, load * dG, load * dG, 3.0 * dG.min(), 0.25, **DONE)
    if (less.regime == 1).all() and (more.regime == 1).all():
        assert more.cycles < less.cycles
    assert less.release.any() and more.release.any()  # at least one per stabilised cycle


@given(ranges, st.integers(-30, 30))
def test_any_units(dG: Array, decades: int) -> None:
    u = 10.0**decades
    scaled = Paris(100.0 * u**2, -2.0, 0.01 * u**-3, 3.0, r1=0.1, r2=0.9)
    a = cycle_jump(Paris(100.0, -2.0, 0.01, 3.0, 0.1, 0.9), dG, dG, 1.0, 0.25)
    b = cycle_jump(scaled, dG * u, dG * u, u, 0.25)
    assert b.cycles == pytest.approx(a.cycles, rel=1e-11)  # logarithms of up to 1e90 lose digits


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Paris(-1.0, -2.0, 1.0, 1.0), "Paris: c1 = -1.0 must be zero or positive"),
        (lambda: Paris(1.0, math.inf, 1.0, 1.0), "Paris: c2 = inf must be finite"),
        (lambda: Paris(1.0, -2.0, 0.0, 1.0), "Paris: c3 = 0.0 must be positive"),
        (lambda: Paris(1.0, -2.0, 1.0, 1.0, 0.9, 0.8), "r1 = 0.9 must be below .* r2 = 0.8"),
        (lambda: Fatigue(0.2, paris=(1, 2, 3, 4)), r"must be a Paris\(c1, c2, c3, c4\)"),  # type: ignore[arg-type]
        (lambda: Fatigue(0.2, 0.8, paris=LAW), "Fatigue: GIIc or GIIIc is given but no mode-mix"),
        (lambda: cycle_jump(LAW, [0.5], [math.nan], 1.0, 1.0), "G_max = nan at front node 0"),
        (lambda: cycle_jump(LAW, [0.5], [0.5], 0.0, 1.0), "G_c = 0.0 at front node 0; .* positive"),
        (lambda: cycle_jump(LAW, [0.5], [0.5], 1.0, [0.0]), "da = 0.0 at front node 0"),
        (lambda: cycle_jump(LAW, [], [], 1.0, 1.0), "at least one"),
    ],
)
def test_bad_input_is_named(make: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        make()


# --- N(a) -----------------------------------------------------------------------------------------


def march(paris: Paris, g: Any, a0: float, a1: float, n: int, gc: float) -> tuple[Array, Array]:
    """Crack lengths and cycles at each release; G is taken in the middle of each element."""
    da = (a1 - a0) / n
    a, cycles, lengths, history = a0, 0.0, [], []
    for i in range(n):
        G = [g(a + da / 2.0)]
        jump = cycle_jump(paris, G, G, gc, da, cycles=cycles, initiated=i > 0)
        if jump.event == "arrest":
            break
        a, cycles = a0 + (i + 1) * da, jump.cycles
        lengths.append(a)
        history.append(cycles)
    return np.array(lengths), np.array(history)


def test_constant_rate_gives_a_straight_line() -> None:
    # Pure-moment DCB: G = 12 M^2/(b^2 E h^3) whatever the crack length.
    g = 12.0 * 300.0**2 / (25.0**2 * 70e3 * 1.5**3) * 0.1
    paris = Paris(0.0, -1.0, 1e3, 5.0)
    a, n = march(paris, lambda _: g, 30.0, 40.0, 50, 1.0)
    # Sums of 50 equal terms.
    np.testing.assert_allclose(n, (a - 30.0) / (1e3 * g**5), rtol=ROUND_OFF)


@pytest.mark.verification
def test_paris_dcb_under_displacement_control() -> None:
    # DCB-UD specimen of NASA/CR-2010-216723 (docs/reference-values.md), corrected beam theory:
    # G = G0 (ae0/ae)^4, ae = a + chi h,
    # N = N0 + [ae^(4m+1) - ae0^(4m+1)]/(C G0^m ae0^(4m) (4m + 1)); dG = G_max in these numbers.
    E, E2, G13, h, b, u = 139.4e3, 10.16e3, 4.6e3, 1.5, 25.0, 0.67
    gamma = 1.18 * np.sqrt(E * E2) / G13
    chi = np.sqrt(E / (11.0 * G13) * (3.0 - 2.0 * (gamma / (1.0 + gamma)) ** 2))
    inertia = b * h**3 / 12.0

    def g(a: float) -> float:
        return float(9.0 * E * inertia * u**2 / (b * (a + chi * h) ** 4))

    c, m, onset, gc = 2.44e6, 10.61, 165.0, 0.1703
    # Threshold 0.060, upper limit 0.9 of the toughness.
    c2 = -12.415
    elements = 1600  # of 0.01; the first is judged by G in its middle
    middle = g(30.005)
    paris = Paris(onset * middle**-c2, c2, c, m, r1=0.060 / gc, r2=0.9)
    a, n = march(paris, g, 30.0, 46.0, elements, gc)

    ae, ae0, k = a + chi * h, 30.0 + chi * h, 4.0 * m + 1.0
    exact = onset + (ae**k - ae0**k) / (c * g(30.0) ** m * ae0 ** (k - 1.0) * k)
    # Midpoint rule: (k da/ae)^2/24 = 7e-6 for each term.
    np.testing.assert_allclose(n, exact, rtol=1e-5)

    at = np.interp([31.0, 32.0, 33.0, 34.0, 35.0], a, n)
    # Three to four digits in docs/reference-values.md.
    assert at == pytest.approx([1.545e3, 6.35e3, 2.25e4, 7.51e4, 2.41e5], rel=3e-3)
    assert a[-1] == pytest.approx(37.4, abs=0.05)  # growth stops at the threshold
