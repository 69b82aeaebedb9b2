"""Cycles on a scene: N(a) beside integrals and closed forms, how a step ends, what is refused."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import CLAMPED_3D, PINS, STEEL, bond, column, interface_of, largest_imbalance, onsets

import fxcrack as fx
from fxcrack.criteria import total
from fxcrack.demos import fatigue_dcb, moment_dcb
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.enf import enf_2d
from fxcrack.meshes.penny import penny

LAW = fx.Paris(c1=50.0, c2=-2.0, c3=0.5, c4=4.0, r1=0.2, r2=0.9)
GROWS = ("cycle", "release", "unstable")
U = 1.0  # opens the bench specimen's arms to G = 0.22 at a = 30


def fatigue(**options: Any) -> fx.Fatigue:
    options = {"GIc": 0.4, "paris": LAW} | options
    return fx.Fatigue(**options)


def dcb(comm: Any = MPI.COMM_WORLD, criterion: Any = None, **options: Any) -> fx.Scene:
    """The bench specimen, coarse, to be fatigued."""
    mesh = dcb_2d(comm, length=100.0, height=1.5, dx=1.0, ny=2)
    return fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=PINS,
        debonds=[fx.Debond(bond(30.0), criterion or fatigue(), **options)],
    )


def until(scene: fx.Scene, length: float) -> fx.CrackLength:
    return fx.CrackLength(interface_of(scene), length)


def curve(history: fx.History, name: str = "bond") -> tuple[np.ndarray, np.ndarray]:
    """Crack lengths and the cycles at which they are reached."""
    rows = [r for r in history if r["event"] in GROWS]
    return column(rows, f"a[{name}]"), column(rows, "N")


# --- N(a) -----------------------------------------------------------------------------------------


def test_cycles_add_up_to_the_sum_of_the_law():
    scene = dcb()
    history = scene.run(fx.Cycles(maximum=U, ratio=0.1, until=until(scene, 40.0)))
    rows = [r for r in history if r["event"] in GROWS]
    a, N = curve(history)
    np.testing.assert_allclose(np.diff(a), 1.0, rtol=1e-12)
    dG, G_max = column(rows, "dG[bond]"), column(rows, "G_max[bond]")
    np.testing.assert_allclose(dG, (1.0 - 0.1**2) * G_max, rtol=1e-12)
    onset = LAW.onset_cycles(dG[0])
    expected = onset + np.concatenate([[0.0], np.cumsum(1.0 / LAW.growth_rate(dG[:-1]))])
    np.testing.assert_allclose(N[1:], expected[1:], rtol=1e-11)
    assert (N[0], history.rows[-1]["N"]) == (0.0, N[-1])
    np.testing.assert_allclose(column(rows, "dadN[bond]"), LAW.growth_rate(dG), rtol=1e-12)
    # the same cycles, tip by tip
    tips = history.details["tips"]
    np.testing.assert_allclose(tips["dG"], dG[:-1], rtol=1e-12)
    np.testing.assert_allclose(tips["N"], N[:-1], rtol=1e-12)
    np.testing.assert_allclose(tips["a"], a[:-1], rtol=1e-12)
    assert all(tips["released"]) and set(tips["interface"]) == {"bond"}
    assert history.reason == "crack length 40 of 'bond' reached"
    assert history.details["factorizations"] == 1
    assert largest_imbalance(history) < 1e-9  # bonds let go at the maximum; all is linear
    scene.close()


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


@pytest.mark.verification
def test_vcct_sums_the_rate_at_the_beginning_of_each_element():
    static = fatigue_dcb.static_rate(0.1, 8)
    found = fatigue_dcb.run(0.1, 8, method="vcct")
    dG = (1.0 - fatigue_dcb.RATIO**2) * static(found.a)
    expected = static.onset() + np.cumsum(0.1 / fatigue_dcb.PARIS.growth_rate(dG))
    # G by crack closure and by the stiffness differ by 2e-6 in the first element, N by 22e-6
    np.testing.assert_allclose(found.N[1:], expected[:-1], rtol=5e-5)


def test_closed_form_is_that_of_the_reference():
    # reference.md: dG = G_max, E11 as it is, onset at 165; three to four digits
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


def test_onset_comes_first_and_cycles_may_be_divided_into_steps():
    scene = dcb(criterion=fatigue(credit=True))
    whole = curve(scene.run(fx.Cycles(maximum=U, ratio=0.1, until=until(scene, 36.0))))
    scene.close()
    scene = dcb(criterion=fatigue(credit=True))
    history = scene.run(fx.Cycles(maximum=U, ratio=0.1, n_max=500.0))
    assert history.reason == "500 cycles done"
    assert [r["event"] for r in history] == ["start", "cycle", "limit", "end"]
    assert scene.fatigue.waiting[0].any()  # N0 = 50/0.22^2 = 1e3
    for _ in range(20):
        history = scene.run(fx.Cycles(maximum=U, ratio=0.1, n_max=250.0))
    assert history.rows[-1]["N"] == pytest.approx(500.0 + 20 * 250.0)
    rows = [r for r in history if r["event"] == "release"]
    assert len(rows) >= 2
    # 250 cycles of growth at a time add up, but for round-off
    np.testing.assert_allclose(column(rows, "N"), whole[1][1 : len(rows) + 1], rtol=1e-9)
    assert not scene.fatigue.waiting[0].any()
    assert largest_imbalance(history) < 1e-9
    scene.close()


def test_without_credit_each_step_begins_its_element_anew():
    scene = dcb()
    for _ in range(3):
        history = scene.run(fx.Cycles(maximum=U, ratio=0.0, n_max=1500.0))
    # N0 = 1e3 is counted once; the growth of 1 mm takes 800 cycles, of which no step has done less
    assert history.rows[-1]["released[bond]"] > 0
    assert not np.any(scene.fatigue.credit[0])
    scene.close()


def test_beyond_the_upper_limit_one_cycle_per_release():
    scene = dcb()
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
    assert history.rows[-1]["G_max[bond]"] <= 0.2 * 0.4
    scene.close()


def test_no_growth_below_the_threshold():
    scene = dcb()
    history = scene.run(fx.Cycles(maximum=0.1, ratio=0.1))
    assert [r["event"] for r in history] == ["start", "cycle", "arrest", "end"]
    assert history.rows[-1]["dadN[bond]"] == 0.0
    scene.close()


def test_equal_extremes_of_g_do_not_grow():
    # above the threshold, but no range: fixed arms and a load elsewhere that cycles
    mesh = dcb_2d(length=60.0, height=1.5, dx=1.0, ny=2)
    open_arms = tuple(
        fx.Displacement(p.where, x=0.0, y=p.y, amplitude=fx.Amplitude((0.0, 1.0), (0.0, U)))
        for p in PINS
    )
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=open_arms,
        loads=[fx.PointForce("pin_top", (0.0, 1.0))],
        debonds=[fx.Debond(bond(30.0), fatigue())],
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
        debonds=[fx.Debond(bond(8.0), fatigue())],
    )
    history = scene.run(fx.Cycles(maximum=u, minimum=0.0))
    assert history.reason == "no crack tip is left"
    assert scene.fatigue.N > 0.0 and not scene.model.fronts[0].bonded.any()
    inside = [r for r in history if r["event"] in GROWS and r["a[bond]"] < 15.0]
    # exact but for the exponential decay towards both ends: 4 heights away
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
        debonds=[fx.Debond(bond(30.0), fatigue())],
    )
    history = scene.run(fx.Cycles(maximum=2.5, minimum=0.0))
    assert history.reason.startswith("total separation")
    assert np.isfinite(history.rows[-1]["N"]) and history.rows[-1]["a[bond]"] > 37.0
    assert largest_imbalance(history) < 1e-9
    scene.close()


# --- the cycle itself -----------------------------------------------------------------------------


def sampled(scene: fx.Scene, corners: list[np.ndarray], n: int = 101) -> tuple[float, float]:
    """Extremes of G over equilibria sampled along the way of the loads."""
    system, growth = scene.model.system, scene.growths[0]
    tips, saved, found = growth.tips(), scene.model.system.snapshot(), []
    for a, b in pairwise(corners):
        for x in np.linspace(0.0, 1.0, n):
            state = system.equilibrium((1.0 - x) * a + x * b, np.zeros(system.n_window))
            measured = growth.evaluator.measure(tips, state, 0.0)
            found.append(float(total(growth.evaluator.rates(tips, measured))[0]))
    system.restore(saved)
    return max(found), min(found)


@pytest.mark.parametrize("ratio", [0.5, 0.1, 0.0, -0.4, -1.0])
def test_end_notched_flexure_with_contact_equals_its_sampled_cycle(ratio):
    mesh = enf_2d(half_span=50.0, height=2.25, dx=1.0, ny=2)
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStress(thickness=25.0),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
            fx.Displacement("load", y=-1.0),
        ],
        debonds=[fx.Debond(bond(35.0, contact=True), fatigue(GIc=10.0))],
    )
    history = scene.run(fx.Cycles(maximum=1.5, ratio=ratio, n_max=1e-6))
    row, loads = history.rows[-1], scene.loads_at(1.5)
    top, bottom = sampled(scene, [loads, ratio * loads])
    if ratio >= 0.0:
        # proportional loads: contact does not change, the two extremes say it all
        assert row["G_max[bond]"] == pytest.approx(top, rel=1e-9)
        assert row["dG[bond]"] == pytest.approx(top - bottom, rel=1e-9)
        assert row["dG[bond]"] == pytest.approx((1.0 - ratio**2) * top, rel=1e-9)
    else:
        # G falls to zero in between, where contact changes sides; followed to 5e-3 of G_max
        assert row["G_max[bond]"] == pytest.approx(top, rel=5e-3)
        assert row["dG[bond]"] == pytest.approx(top - bottom, abs=5e-3 * top)
    # mode II, and no release: contact is back in the state of the maximum
    assert row["GI[bond]"] < 1e-4 * row["GII[bond]"]
    assert row["balance"] == pytest.approx(0.0, abs=1e-9 * row["external_work"])
    scene.close()


def pressed(comm: Any = MPI.COMM_WORLD) -> fx.Scene:
    """Arms pulled apart at the end and pressed together in the middle, not at the same time."""
    mesh = dcb_2d(comm, length=100.0, height=1.5, dx=1.0, ny=2)
    pull = fx.Amplitude((0.0, 1.0, 2.0, 3.0, 4.0), (0.0, 1.0, 1.0, 0.2, 0.0))
    press = fx.Amplitude((0.0, 1.0, 2.0, 3.0, 4.0), (0.0, 0.0, 1.0, 1.0, 0.0))
    return fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=[fx.Displacement(f"far_{s}", x=0.0, y=0.0) for s in ("upper", "lower")],
        loads=[
            fx.PointForce("pin_top", (0.0, 0.5), pull),
            fx.PointForce("pin_bottom", (0.0, -0.5), pull),
            fx.Pressure("top", lambda x: np.where(x[0] < 20.0, 0.075, 0.0), press),
            fx.Pressure("bottom", lambda x: np.where(x[0] < 20.0, 0.025, 0.0), press),
        ],
        debonds=[fx.Debond(bond(30.0, contact=True), fatigue())],
    )


@pytest.mark.mpi
def test_loads_out_of_step_with_contact_equal_their_sampled_cycle(comm):
    scene = pressed(comm)
    history = scene.run(fx.Cycles(period=(0.0, 4.0), n_max=1e-6))
    top, bottom = sampled(scene, [scene.loads_at(t) for t in (0.0, 1.0, 2.0, 3.0, 4.0)])
    row = history.rows[-1]
    assert row["time"] == 1.0  # bonds let go at the corner of largest G
    assert row["G_max[bond]"] == pytest.approx(top, rel=5e-3)
    assert row["dG[bond]"] == pytest.approx(top - bottom, abs=5e-3 * top)
    # straight from one state to another, G with a minimum in between
    history = scene.run(fx.Cycles(maximum=1.0, minimum=3.0, n_max=1e-6))
    top, bottom = sampled(scene, [scene.loads_at(t) for t in (1.0, 3.0)])
    row = history.rows[-1]
    assert row["dG[bond]"] == pytest.approx(top - bottom, abs=5e-3 * top)
    at_minimum, _ = sampled(scene, [scene.loads_at(3.0)] * 2, 2)
    assert top - at_minimum < 0.95 * row["dG[bond]"]
    scene.close()


# --- several interfaces, steps in turn ------------------------------------------------------------


def stacked(comm: Any, debonds: list[tuple[float, Any]]) -> tuple[fx.Scene, list[fx.Interface]]:
    """Two bench specimens far from each other, with initial length and criterion of each."""

    def make() -> Blocks:
        model, x = Blocks(), np.linspace(0.0, 60.0, 61)
        for i, y in enumerate((0.0, 10.0)):
            upper = model.add(f"upper{i}", (x, y + np.array([0.0, 0.75, 1.5])), "quadrilateral", 1)
            lower = model.add(f"lower{i}", (x, y - np.array([1.5, 0.75, 0.0])), "quadrilateral", 1)
            model.group(f"slave{i}", upper.part(y=y))
            model.group(f"master{i}", lower.part(y=y))
            model.group(f"top{i}", upper.part(x=0.0, y=y + 1.5))
            model.group(f"bottom{i}", lower.part(x=0.0, y=y - 1.5))
        return model

    interfaces = [
        fx.Interface(
            slave=f"slave{i}",
            master=f"master{i}",
            bonded=lambda x, a0=a0: x[0] >= a0 - 1e-9,
            name=f"bond{i}",
        )
        for i, (a0, _) in enumerate(debonds)
    ]
    scene = fx.Scene(
        build(comm, "stacked", make),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement(f"{name}{i}", x=0.0, y=sign)
            for i in range(2)
            for name, sign in (("top", 1.0), ("bottom", -1.0))
        ],
        debonds=[fx.Debond(f, c) for f, (_, c) in zip(interfaces, debonds, strict=True)],
    )
    return scene, interfaces


@pytest.mark.mpi
def test_two_interfaces_grow_as_each_would_alone(comm):
    other = fx.Paris(c1=0.0, c2=-1.0, c3=2.0, c4=5.0, r1=0.1, r2=0.9)
    criteria = [
        fatigue(tolerance=0.0, credit=True),
        fatigue(tolerance=0.0, credit=True, GIc=0.3, paris=other),
    ]
    lengths = [30.0, 28.0]
    pairs = list(zip(lengths, criteria, strict=True))
    scene, (first, _) = stacked(comm, pairs)
    together = scene.run(fx.Cycles(maximum=U, ratio=0.1, until=fx.CrackLength(first, 34.0)))
    scene.close()
    for i in range(2):
        scene, interfaces = stacked(comm, pairs)
        goal = together.rows[-1][f"a[bond{i}]"]
        step = fx.Cycles(maximum=U, ratio=0.1, until=fx.CrackLength(interfaces[i], goal))
        alone = scene.run(step, grow=[scene.debonds[i]])
        a, N = curve(alone, f"bond{i}")
        both, cycles = curve(together, f"bond{i}")
        first_at = [int(np.argmax(both >= x - 1e-9)) for x in a]
        # credit is exact between releases of one's own: the other specimen does not matter
        np.testing.assert_allclose(cycles[first_at][1:], N[1:], rtol=1e-9)
        assert len(a) >= 4
        scene.close()
    tips = together.details["tips"]
    assert set(tips["interface"]) == {"bond0", "bond1"}
    assert largest_imbalance(together) < 1e-9


def test_alike_interfaces_let_go_together():
    scene, interfaces = stacked(MPI.COMM_WORLD, [(30.0, fatigue()), (30.0, fatigue())])
    history = scene.run(fx.Cycles(maximum=U, ratio=0.1, until=fx.CrackLength(interfaces[0], 33.0)))
    rows = [r for r in history if r["event"] == "release"]
    assert len(rows) == 3
    assert [r["a[bond0]"] for r in rows] == pytest.approx([r["a[bond1]"] for r in rows])
    scene.close()


@pytest.mark.mpi
def test_static_growth_cycles_and_static_growth_in_turn(comm):
    scene, (one, _) = stacked(comm, [(30.0, fx.VCCT(GIc=0.2)), (30.0, fatigue())])
    brittle, tired = scene.debonds
    scene.run(fx.Static(until=fx.CrackLength(one, 33.0)), grow=[brittle])
    before = scene.history.rows[-1]
    assert "f[bond1]" not in before  # tied
    scene.run(fx.Cycles(maximum=before["time"], ratio=0.1, n_max=2000.0), grow=[tired])
    after = scene.history.rows[-1]
    assert after["released[bond1]"] > 0
    assert after["released_energy"] > before["released_energy"]
    assert after["external_work"] == pytest.approx(before["external_work"])  # displacements held
    history = scene.run(fx.Static(until=fx.CrackLength(one, 35.0)), grow=[brittle])
    assert history.rows[-1]["a[bond0]"] >= 35.0 - 1e-9
    assert history.rows[-1]["time"] > before["time"]
    assert largest_imbalance(history) < 1e-9
    scene.close()


def test_cycles_beside_bonds_that_soften():
    # a progressive front half-way through its elements stays as it is while another one is cycled
    scene, (one, _) = stacked(MPI.COMM_WORLD, [(30.0, fx.VCCT(GIc=0.2)), (30.0, fatigue())])
    scene.debonds[0] = fx.Debond(one, fx.VCCT(GIc=0.2), release=fx.Progressive())
    brittle, tired = scene.debonds
    scene.run(fx.Static(until=fx.CrackLength(one, 32.0)), grow=[brittle])
    before = scene.history.rows[-1]
    assert scene.model.system.soft.bonds
    maximum = before["time"]
    history = scene.run(fx.Cycles(maximum=maximum, ratio=0.1, n_max=2000.0), grow=[tired])
    rows = [r for r in history if "dG[bond1]" in r]
    dG, G_max = column(rows, "dG[bond1]"), column(rows, "G_max[bond1]")
    np.testing.assert_allclose(dG, 0.99 * G_max, rtol=1e-9)
    assert largest_imbalance(history) < 1e-9
    scene.close()


# --- other models, several ranks ------------------------------------------------------------------


@pytest.mark.mpi
def test_axisymmetric_rates_are_those_of_static_growth(comm):
    def make(criterion: Any) -> fx.Scene:
        mesh = penny(comm, a=2.0, radius=10.0, half_height=10.0, dr=0.1, fine=1.0)
        load = {"value": lambda x: np.where(x[0] < 2.0, 1.0, 0.0)}
        return fx.Scene(
            mesh,
            materials=fx.Isotropic(2e5, 0.3),
            model=fx.Axisymmetric(),
            supports=[
                fx.Displacement("axis_upper", x=0.0),
                fx.Displacement("axis_lower", x=0.0),
                fx.Displacement("axis_bottom", y=0.0),
            ],
            loads=[fx.Pressure("upper_face", **load), fx.Pressure("lower_face", **load)],
            debonds=[fx.Debond(bond(2.0), criterion)],
        )

    scene = make(fx.VCCT(GIc=1.0))
    history = scene.run(fx.Static(until=until(scene, 2.5), stepping="path"))
    rows = onsets(history)
    a, rate = column(rows, "a[bond]"), 1.0 / column(rows, "time") ** 2  # G at a load factor of 1
    scene.close()
    law = fx.Paris(c1=0.0, c2=-1.0, c3=1.0, c4=3.0, r1=1e-6, r2=0.9)
    scene = make(fatigue(GIc=1.0, paris=law))
    history = scene.run(fx.Cycles(maximum=1.0, minimum=0.3, until=until(scene, 2.5)))
    rows = [r for r in history if r["event"] in GROWS]
    dG = column(rows, "dG[bond]")[: len(a)]
    np.testing.assert_allclose(dG, 0.91 * rate[: len(dG)], rtol=1e-8)
    steps = 0.1 / law.growth_rate(dG)
    np.testing.assert_allclose(np.diff(column(rows, "N")), steps[: len(rows) - 1], rtol=1e-6)
    assert largest_imbalance(history) < 1e-9
    scene.close()


def wide(comm: Any, **options: Any) -> fx.Scene:
    """A short specimen in 3-D."""
    mesh = dcb_3d(comm, length=20.0, height=1.5, width=8.0, dx=1.0, dy=1.0, ny=1)
    return fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.Solid(),
        supports=CLAMPED_3D,
        debonds=[fx.Debond(bond(8.0), fatigue(**options))],
    )


def test_a_front_in_3d_stays_symmetric_and_keeps_its_energy():
    law = fx.Paris(c1=0.0, c2=-1.0, c3=0.5, c4=4.0, r1=0.05, r2=0.99)
    for credit in (False, True):
        scene = wide(MPI.COMM_WORLD, GIc=5.0, paris=law, credit=credit)
        history = scene.run(fx.Cycles(maximum=0.3, ratio=0.1, until=until(scene, 11.0)))
        x = scene.pairs[0].surface.x
        mirror = np.array([np.argmin(np.abs(x - [p[0], p[1], 8.0 - p[2]]).sum(axis=1)) for p in x])
        is_open = ~scene.model.fronts[0].bonded
        np.testing.assert_array_equal(is_open, is_open[mirror])
        assert largest_imbalance(history) < 1e-9
        assert history.details["factorizations"] <= 2
        N = np.array([r["N"] for r in history])
        assert np.all(np.diff(N) >= 0.0)
        tips = history.details["tips"]
        assert len(tips["N"]) > 2 * len(history)  # a row per front node
        scene.close()


@pytest.mark.mpi
def test_ranks_agree(comm):
    for make, step in (
        (dcb, {"maximum": U, "ratio": 0.1, "n_max": 2e4}),
        (wide, {"maximum": 0.1, "ratio": 0.1, "n_max": 2e4}),
        (pressed, {"period": (0.0, 4.0), "n_max": 2e5}),
    ):
        found = []
        for where in (comm, MPI.COMM_SELF):
            scene = make(where)
            history = scene.run(fx.Cycles(**step))
            found.append(
                [(r["event"], r["N"], r["a[bond]"], r["dG[bond]"]) for r in history.rows[1:]]
            )
            scene.close()
        ours, alone = found
        assert len(ours) == len(alone) > 2
        assert [r[0] for r in ours] == [r[0] for r in alone]
        # ranks sum in another order; N takes dG to the fourth power
        np.testing.assert_allclose(
            [r[1:] for r in ours], [r[1:] for r in alone], rtol=1e-7, atol=1e-12
        )


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
    scene = dcb(comm)
    with pytest.raises(fx.InputError, match=r"'bond' has a Fatigue criterion.*run fx.Cycles"):
        scene.run(fx.Static(until=fx.Time(1.0)))
    with pytest.raises(fx.InputError, match="no interface may grow in this step"):
        scene.run(fx.Cycles(maximum=1.0, ratio=0.1), grow=[])
    scene.run(fx.Static(until=fx.Time(1.0)), grow=[])  # tied it may be loaded
    scene.close()
    scene = dcb(comm, criterion=fx.VCCT(GIc=0.2))
    with pytest.raises(fx.InputError, match=r"criterion VCCT, which does not grow in cycles"):
        scene.run(fx.Cycles(maximum=1.0, ratio=0.1))
    scene.close()
    scene = dcb(comm, release=fx.Progressive())
    with pytest.raises(fx.InputError, match=r"let go at once; use release=Step\(\)"):
        scene.run(fx.Cycles(maximum=1.0, ratio=0.1))
    scene.close()


def test_amplitudes_must_be_cyclic_and_change():
    scene = dcb()
    with pytest.raises(
        fx.InputError,
        match=r"u\[pin_top.y\] is not cyclic: 0.5 at the beginning and 1.5 at the end",
    ):
        scene.run(fx.Cycles(period=(0.5, 1.5)))
    with pytest.raises(fx.InputError, match="no load changes in the cycle"):
        scene.run(fx.Cycles(maximum=0.5, minimum=0.5))
    scene.close()
