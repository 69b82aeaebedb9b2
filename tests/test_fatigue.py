"""Cycles on a scene: N(a) beside integrals and closed forms, how a step ends, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from specimens import (
    GROWS,
    HALF_OPENING,
    PARIS,
    PINS,
    STEEL,
    bond,
    column,
    fatigue_law,
    fatigue_specimen,
    growth_curve,
    largest_imbalance,
    until_length,
)

import fxcrack as fx
from fxcrack.demos import fatigue_dcb, moment_dcb
from fxcrack.meshes.dcb import dcb_2d

# --- N(a) -----------------------------------------------------------------------------------------


def log_mean(a, b):
    """Mean of what is log-linear between two values."""
    return (a - b) / np.log(a / b)


def elements(dG, law=PARIS, length=1.0):
    """Cycles of each element whose ends have given ranges: dG is log-linear between them."""
    slow = length / law.growth_rate(dG)
    return log_mean(slow[1:], slow[:-1])


def test_cycles_add_up_to_the_integral_of_the_law():
    scene = fatigue_specimen()
    history = scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=until_length(scene, 40.0)))
    rows = [r for r in history if r["event"] in GROWS]
    a, N = growth_curve(history)
    np.testing.assert_allclose(np.diff(a), 1.0, rtol=1e-12)
    dG, G_max = column(rows, "dG[bond]"), column(rows, "G_max[bond]")
    np.testing.assert_allclose(dG, (1.0 - 0.1**2) * G_max, rtol=1e-12)
    onset = PARIS.onset_cycles(dG[0])
    np.testing.assert_allclose(N[1:], onset + np.cumsum(elements(dG)), rtol=1e-11)
    assert (N[0], history.rows[-1]["N"]) == (0.0, N[-1])
    np.testing.assert_allclose(column(rows, "dadN[bond]"), PARIS.growth_rate(dG), rtol=1e-12)
    # the same cycles, tip by tip
    tips = history.details["tips"]
    np.testing.assert_allclose(tips["dG"], dG[:-1], rtol=1e-12)
    np.testing.assert_allclose(tips["N"], N[:-1], rtol=1e-12)
    np.testing.assert_allclose(tips["a"], a[:-1], rtol=1e-12)
    assert all(tips["released"]) and set(tips["interface"]) == {"bond"}
    # and the cycle in which each bond failed
    np.testing.assert_allclose([r.DBT for r in scene.cracks[0].records], N[1:], rtol=1e-12)
    assert history.reason == "crack length 40 of 'bond' reached"
    assert history.details["factorizations"] == 1
    assert largest_imbalance(history) < 1e-9  # bonds let go at the maximum; all is linear
    scene.close()


@pytest.mark.slow
@pytest.mark.verification
@pytest.mark.demos
def test_n_of_a_is_the_integral_of_the_paris_law_over_the_static_rate():
    static = fatigue_dcb.static_rate(0.05, 8)
    found = fatigue_dcb.run(0.05, 8)
    at = np.array([31.0, 32.0, 33.0, 34.0, 35.0, 37.0])
    integral = static.onset() + static.cycles(at)
    # the midpoint rule errs by (43 da/ae)^2/24 = 2e-4, the onset by half an element: 4 % of N0
    np.testing.assert_allclose(found.cycles(at), integral, rtol=5e-3)
    np.testing.assert_allclose(found.cycles(at[2:]), integral[2:], rtol=5e-4)
    # growth stops where G falls to the threshold, within an element
    a = np.linspace(37.0, 37.9, 901)
    stop = a[np.argmin(np.abs(static(a) - 0.060))]
    assert abs(found.a[-1] - stop) < 0.05
    assert found.history.reason.startswith("arrest")
    assert found.history.details["factorizations"] <= 2
    assert largest_imbalance(found.history) < 1e-9
    # beam theory: G of this mesh (8 over the height) is 0.8 % above it, and N goes with G^10.6
    beam = fatigue_dcb.closed_form(at, fatigue_dcb.STRAIN_BEAM)
    np.testing.assert_allclose(found.cycles(at), beam, rtol=0.1)


@pytest.mark.slow
@pytest.mark.verification
@pytest.mark.parametrize("method", ["vcct", "closure"])
def test_half_a_millimetre_is_short_enough(method):
    # the whole of N(a), onset included, on elements of 0.5 at an exponent of 10.6
    static = fatigue_dcb.static_rate(0.5, 8)
    found = fatigue_dcb.run(0.5, 8, method=method)
    expected = static.onset() + static.cycles(found.a[1:])
    # log-linear G and, with closure, its means over elements: (43 da/ae)^2/24 = 0.002 of each
    np.testing.assert_allclose(found.N[1:], expected, rtol=0.01)


def test_closed_form_is_that_of_the_reference():
    # docs/reference-values.md: dG = G_max, E11 as it is, onset at 165; three to four digits
    at = fatigue_dcb.closed_form([30.0, 31.0, 32.0, 33.0, 34.0, 35.0], ratio=0.0)
    assert 165.0 + at[1:] - at[0] == pytest.approx(
        [1.545e3, 6.35e3, 2.25e4, 7.51e4, 2.41e5], rel=3e-3
    )


@pytest.mark.verification
@pytest.mark.demos
@pytest.mark.parametrize("method", ["vcct", "closure"])
def test_pure_moments_give_a_straight_line(method):
    scene, found = moment_dcb.run(1.0, 2, order=2, until=35.0, method=method)
    assert found["bend"] < 1e-6  # G is the same at every crack length
    # quadratic arms bend exactly; what is left is the neighbourhood of the tip
    assert found["G / exact"] == pytest.approx(1.0, abs=1e-4)
    assert found["slope / exact"] == pytest.approx(1.0, abs=2e-3)
    assert largest_imbalance(scene.history) < 1e-9
    scene.close()


# --- ends of a step -------------------------------------------------------------------------------


@pytest.mark.slow
def test_onset_comes_first_and_cycles_may_be_divided_into_steps():
    scene = fatigue_specimen(criterion=fatigue_law(credit=True))
    whole = growth_curve(
        scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=until_length(scene, 36.0)))
    )
    scene.close()
    scene = fatigue_specimen(criterion=fatigue_law(credit=True))
    history = scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1, n_max=500.0))
    assert history.reason == "500 cycles done"
    assert [r["event"] for r in history] == ["start", "cycle", "limit", "end"]
    assert scene.fatigue.waiting[0].any()  # N0 = 50/0.256^2 = 763
    for _ in range(20):
        history = scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1, n_max=250.0))
    assert history.rows[-1]["N"] == pytest.approx(500.0 + 20 * 250.0)
    rows = [r for r in history if r["event"] == "release"]
    assert len(rows) >= 2
    # 250 cycles of growth at a time add up, but for round-off
    np.testing.assert_allclose(column(rows, "N"), whole[1][1 : len(rows) + 1], rtol=1e-9)
    assert not scene.fatigue.waiting[0].any()
    assert largest_imbalance(history) < 1e-9
    scene.close()


@pytest.mark.parametrize("credit", [False, True])
def test_an_element_is_begun_anew_in_each_step_unless_growth_is_credited(credit):
    scene = fatigue_specimen(criterion=fatigue_law(credit=credit))
    history = scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.0, n_max=800.0))
    dG = history.rows[-1]["dG[bond]"]
    history = scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.0, n_max=800.0))
    (first, *_) = [r for r in history if r["event"] == "release"]
    onset, (element,) = PARIS.onset_cycles(dG), elements(np.array([dG, first["dG[bond]"]]))
    assert onset < 800.0 < onset + element
    expected = (onset if credit else 800.0) + element
    assert first["N"] == pytest.approx(expected, rel=1e-9)
    assert np.any(scene.fatigue.credit[0]) == credit
    scene.close()


def test_beyond_the_upper_limit_one_cycle_per_release():
    scene = fatigue_specimen()
    history = scene.run(fx.Cycles(maximum=2.0, ratio=0.1, n_max=1e9))
    rows = [r for r in history if r["event"] in GROWS]
    fast = [r for r in rows if r["event"] == "unstable"]
    assert len(fast) > 5
    np.testing.assert_allclose(column(fast, "N"), np.arange(1, len(fast) + 1), rtol=1e-12)
    # each of them left a state beyond the limit; slower growth begins below it
    assert all(r["f[bond]"] >= 0.9 for r in rows[: len(fast)])
    assert rows[0]["dadN[bond]"] == pytest.approx(1.0)  # the element in one cycle
    assert rows[len(fast)]["f[bond]"] < 0.9
    assert history.reason.startswith("arrest")
    assert history.rows[-2]["event"] == "arrest"
    # the crack stands where the next node would bring G below the threshold
    last, before = (r["G_max[bond]"] for r in (history.rows[-1], rows[-2]))
    assert 0.2 * 0.4 <= last and last**2 / before < 0.2 * 0.4
    scene.close()


def test_no_growth_below_the_threshold():
    scene = fatigue_specimen()
    history = scene.run(fx.Cycles(maximum=0.1, ratio=0.1))
    assert [r["event"] for r in history] == ["start", "cycle", "arrest", "end"]
    assert history.rows[-1]["dadN[bond]"] == 0.0
    scene.close()


def test_equal_extremes_of_g_do_not_grow():
    # above the threshold, but no range: fixed arms and a load elsewhere that cycles
    mesh = dcb_2d(length=60.0, height=1.5, dx=1.0, ny=2)
    open_arms = tuple(
        fx.Displacement(
            p.where, x=0.0, y=p.y, amplitude=fx.Amplitude((0.0, 1.0), (0.0, HALF_OPENING))
        )
        for p in PINS
    )
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=open_arms,
        loads=[fx.PointForce("pin_top", (0.0, 1.0))],
        debonds=[fx.Debond(bond(30.0), fatigue_law())],
    )
    history = scene.run(fx.Cycles(maximum=2.0, minimum=1.0))
    assert history.rows[-1]["G_max[bond]"] > 0.2 * 0.4
    assert history.rows[-1]["dG[bond]"] == pytest.approx(0.0, abs=1e-12)
    assert history.reason.startswith("arrest")
    scene.close()


def test_a_crack_runs_out_of_its_interface():
    # a strip between two rails: G = M u^2/h for any crack length
    u, height = 2e-3, 1.5
    modulus = 70e3 * 0.7 / (1.3 * 0.4)
    scene = fx.Scene(
        dcb_2d(length=20.0, height=height, dx=0.5, ny=4),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("top", x=0.0, y=1.0), fx.Displacement("bottom", x=0.0, y=-1.0)],
        debonds=[fx.Debond(bond(8.0), fatigue_law())],
    )
    history = scene.run(fx.Cycles(maximum=u, minimum=0.0))
    assert history.reason == "total separation: no crack tip is left"
    assert scene.fatigue.N > 0.0 and not scene.solver.fronts[0].bonded.any()
    inside = [r for r in history if r["event"] in GROWS and r["a[bond]"] < 11.0]
    # exact but for the exponential decay towards the far end, 6 heights away
    np.testing.assert_allclose(column(inside, "G_max[bond]"), modulus * u**2 / height, rtol=1e-3)
    assert largest_imbalance(history) < 1e-9
    scene.close()


def test_bodies_that_come_apart_end_the_step():
    scene = fx.Scene(
        dcb_2d(length=40.0, height=1.5, dx=1.0, ny=2),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("far_lower", x=0.0, y=0.0)],
        loads=[fx.PointForce("pin_top", (0.0, 1.0)), fx.PointForce("pin_bottom", (0.0, -1.0))],
        debonds=[fx.Debond(bond(30.0), fatigue_law())],
    )
    history = scene.run(fx.Cycles(maximum=2.5, minimum=0.0))
    assert history.reason.startswith("total separation")
    assert np.isfinite(history.rows[-1]["N"]) and history.rows[-1]["a[bond]"] > 37.0
    assert largest_imbalance(history) < 1e-9
    scene.close()


@pytest.mark.slow
def test_growth_of_the_tips_is_ready_to_plot(tmp_path):
    scene = fatigue_specimen()
    history = scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=until_length(scene, 34.0)))
    scene.close()
    found = fx.plots.tip_growth(history, "bond")
    rows = [r for r in history if r["event"] in GROWS]
    np.testing.assert_allclose(found.a, [30.0, 31.0, 32.0, 33.0], rtol=1e-12)
    np.testing.assert_allclose(found.N, column(rows, "N")[:-1], rtol=1e-12)
    np.testing.assert_allclose(found.dadN, PARIS.growth_rate(found.dG), rtol=1e-12)
    for show in ("rate", "length"):
        fx.plots.paris(history, tmp_path / f"{show}.png", "bond", show=show)
        assert (tmp_path / f"{show}.png").stat().st_size > 5000
    with pytest.raises(fx.InputError, match="interface 'other' has no tips in the cycles"):
        fx.plots.paris(history, tmp_path / "no.png", "other")
    with pytest.raises(fx.InputError, match="choose 'rate' or 'length'"):
        fx.plots.paris(history, tmp_path / "no.png", "bond", show="N")


# --- messages -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({}, "give maximum and minimum, or maximum and ratio, or period"),
        ({"maximum": 1.0}, "give maximum and minimum"),
        ({"maximum": 1.0, "minimum": 0.0, "ratio": 0.0}, "and nothing beside"),
        ({"maximum": 1.0, "ratio": 0.1, "period": (0.0, 1.0)}, "and nothing beside"),
        ({"maximum": np.nan, "ratio": 0.1}, "must be finite"),
        ({"maximum": 1.0, "ratio": 1.0}, "ratio = 1.0 must be below 1"),
        ({"period": (1.0, 1.0)}, "must end after it begins"),
        ({"maximum": 1.0, "ratio": 0.1, "n_max": 0.0}, "n_max = 0.0 must be positive"),
        ({"maximum": 1.0, "ratio": 0.1, "change": 0.0}, "change = 0.0 must lie between 0 and 1"),
        ({"maximum": 1.0, "ratio": 0.1, "until": fx.Time(2.0)}, "time stands still"),
    ],
)
def test_what_cycles_cannot_be(given, says):
    with pytest.raises(fx.InputError, match=says):
        fx.Cycles(**given)


@pytest.mark.mpi
def test_criterion_and_step_must_go_together(comm):
    scene = fatigue_specimen(comm)
    with pytest.raises(fx.InputError, match=r"'bond' has a Fatigue criterion.*run fx.Cycles"):
        scene.run(fx.Static(until=fx.Time(1.0)))
    with pytest.raises(fx.InputError, match="no interface may grow in this step"):
        scene.run(fx.Cycles(maximum=1.0, ratio=0.1), grow=[])
    scene.run(fx.Static(until=fx.Time(1.0)), grow=[])  # tied it may be loaded
    scene.close()
    scene = fatigue_specimen(comm, criterion=fx.VCCT(GIc=0.2))
    with pytest.raises(fx.InputError, match=r"criterion VCCT, which does not grow in cycles"):
        scene.run(fx.Cycles(maximum=1.0, ratio=0.1))
    scene.close()
    scene = fatigue_specimen(comm, release=fx.ProgressiveRelease())
    with pytest.raises(fx.InputError, match=r"released at once; use release=StepRelease\(\)"):
        scene.run(fx.Cycles(maximum=1.0, ratio=0.1))
    scene.close()


def test_amplitudes_must_be_cyclic_and_change():
    scene = fatigue_specimen()
    with pytest.raises(
        fx.InputError,
        match=r"u\[pin_top.y\] is not cyclic: 0.5 at the beginning and 1.5 at the end",
    ):
        scene.run(fx.Cycles(period=(0.5, 1.5)))
    with pytest.raises(fx.InputError, match="no load changes in the cycle"):
        scene.run(fx.Cycles(maximum=0.5, minimum=0.5))
    scene.close()
