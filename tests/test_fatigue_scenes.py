"""Cycles with contact, on several interfaces, in turn with static steps, in 3-D, on ranks."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import (
    CLAMPED_3D,
    GROWS,
    HALF_OPENING,
    PARIS,
    STEEL,
    bond,
    column,
    fatigue_enf,
    fatigue_law,
    fatigue_specimen,
    growth_curve,
    largest_imbalance,
    onsets,
    until_length,
)

import fxcrack as fx
from fxcrack.criteria import total
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.penny import penny

# --- the cycle itself -----------------------------------------------------------------------------


def sampled(scene: fx.Scene, corners: list[np.ndarray], n: int = 101) -> tuple[float, float]:
    """Extremes of G over equilibria sampled along the way of the loads."""
    system, growth = scene.solver.system, scene.cracks[0]
    tips, saved, found = growth.tips(), scene.solver.system.snapshot(), []
    for a, b in pairwise(corners):
        for x in np.linspace(0.0, 1.0, n):
            state = system.equilibrium((1.0 - x) * a + x * b, np.zeros(system.n_retained))
            measured = growth.evaluator.measure(tips, state, 0.0)
            found.append(float(total(growth.evaluator.rates(tips, measured))[0]))
    system.restore(saved)
    return max(found), min(found)


@pytest.mark.quick("0.1", "-1.0")
@pytest.mark.parametrize("ratio", [0.5, 0.1, 0.0, -0.4, -1.0])
def test_end_notched_flexure_with_contact_equals_its_sampled_cycle(ratio):
    scene = fatigue_enf(a0=35.0, dx=1.0)
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
        debonds=[fx.Debond(bond(30.0, contact=True), fatigue_law())],
    )


@pytest.mark.slow
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


def stacked(
    comm: Any, debonds: list[tuple[float, Any]], **options: Any
) -> tuple[fx.Scene, list[fx.Interface]]:
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
        **options,
    )
    return scene, interfaces


@pytest.mark.mpi
def test_two_interfaces_grow_as_each_would_alone(comm):
    other = fx.Paris(c1=0.0, c2=-1.0, c3=2.0, c4=5.0, r1=0.1, r2=0.9)
    criteria = [
        fatigue_law(tolerance=0.0, credit=True),
        fatigue_law(tolerance=0.0, credit=True, GIc=0.3, paris=other),
    ]
    lengths = [30.0, 28.0]
    pairs = list(zip(lengths, criteria, strict=True))
    scene, (first, _) = stacked(comm, pairs)
    together = scene.run(
        fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=fx.CrackLength(first, 34.0))
    )
    scene.close()
    for i in range(2):
        scene, interfaces = stacked(comm, pairs)
        goal = together.rows[-1][f"a[bond{i}]"]
        step = fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=fx.CrackLength(interfaces[i], goal))
        alone = scene.run(step, grow=[scene.debonds[i]])
        a, N = growth_curve(alone, f"bond{i}")
        both, cycles = growth_curve(together, f"bond{i}")
        first_at = [int(np.argmax(both >= x - 1e-9)) for x in a]
        # credit is exact between releases of one's own: the other specimen does not matter
        np.testing.assert_allclose(cycles[first_at][1:], N[1:], rtol=1e-9)
        assert len(a) >= 4
        scene.close()
    tips = together.details["tips"]
    assert set(tips["interface"]) == {"bond0", "bond1"}
    assert largest_imbalance(together) < 1e-9


def test_alike_interfaces_let_go_together():
    scene, interfaces = stacked(MPI.COMM_WORLD, [(30.0, fatigue_law()), (30.0, fatigue_law())])
    history = scene.run(
        fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=fx.CrackLength(interfaces[0], 33.0))
    )
    rows = [r for r in history if r["event"] == "release"]
    assert len(rows) == 3
    assert [r["a[bond0]"] for r in rows] == pytest.approx([r["a[bond1]"] for r in rows])
    scene.close()


@pytest.mark.mpi
def test_static_growth_cycles_and_static_growth_in_turn(comm):
    scene, (one, _) = stacked(comm, [(30.0, fx.VCCT(GIc=0.2)), (30.0, fatigue_law())])
    brittle, tired = scene.debonds
    scene.run(fx.Static(until=fx.CrackLength(one, 33.0)), grow=[brittle])
    before = scene.history.rows[-1]
    assert "f[bond1]" not in before  # tied
    scene.run(fx.Cycles(maximum=before["time"], ratio=0.1, n_max=2000.0), grow=[tired])
    after = scene.history.rows[-1]
    assert after["released[bond1]"] > 0
    # by hand: the law at onset, then its integral over each element, log-linear in a
    rows = [r for r in scene.history if r["event"] in GROWS and "dG[bond1]" in r]
    dG, N = column(rows, "dG[bond1]"), column(rows, "N")
    slow = 1.0 / PARIS.growth_rate(dG)
    each = np.diff(slow) / np.diff(np.log(slow))
    np.testing.assert_allclose(N[1:], PARIS.onset_cycles(dG[0]) + np.cumsum(each), rtol=1e-9)
    assert after["released_energy"] > before["released_energy"]
    assert after["external_work"] == pytest.approx(before["external_work"])  # displacements held
    history = scene.run(fx.Static(until=fx.CrackLength(one, 35.0)), grow=[brittle])
    assert history.rows[-1]["a[bond0]"] >= 35.0 - 1e-9
    assert history.rows[-1]["time"] > before["time"]
    assert largest_imbalance(history) < 1e-9
    scene.close()


def test_one_way_to_grow_for_all_interfaces():
    """Where one grows in part because it says so, an interface without a word must be able to."""
    for other in ({"method": "closure"}, {"partial": False}):
        criteria = [(30.0, fatigue_law(partial=True)), (30.0, fatigue_law(**other))]
        scene, _ = stacked(MPI.COMM_SELF, criteria)
        with pytest.raises(fx.InputError, match="steps of their own"):
            scene.run(fx.Cycles(maximum=0.5, ratio=0.1, n_max=10.0), progress=False)
        scene.close()


def test_cycles_beside_bonds_that_soften():
    # a progressive front half-way through its elements stays as it is while another one is cycled
    scene, (one, _) = stacked(MPI.COMM_WORLD, [(30.0, fx.VCCT(GIc=0.2)), (30.0, fatigue_law())])
    softening = fx.Debond(one, fx.VCCT(GIc=0.2), release=fx.ProgressiveRelease())
    scene = scene.rebuilt(debonds=[softening, scene.debonds[1]])
    brittle, tired = scene.debonds
    scene.run(fx.Static(until=fx.CrackLength(one, 32.0)), grow=[brittle])
    before = scene.history.rows[-1]
    assert scene.solver.system.soft.bonds
    maximum = before["time"]
    history = scene.run(fx.Cycles(maximum=maximum, ratio=0.1, n_max=2000.0), grow=[tired])
    rows = [r for r in history if "dG[bond1]" in r]
    dG, G_max = column(rows, "dG[bond1]"), column(rows, "G_max[bond1]")
    np.testing.assert_allclose(dG, 0.99 * G_max, rtol=1e-9)
    assert largest_imbalance(history) < 1e-9
    scene.close()


# --- other models, several ranks ------------------------------------------------------------------


@pytest.mark.slow
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
    history = scene.run(fx.Static(until=until_length(scene, 2.5), stepping="path"))
    rows = onsets(history)
    a, rate = column(rows, "a[bond]"), 1.0 / column(rows, "time") ** 2  # G at a load factor of 1
    scene.close()
    law = fx.Paris(c1=0.0, c2=-1.0, c3=1.0, c4=3.0, r1=1e-6, r2=0.9)
    scene = make(fatigue_law(GIc=1.0, paris=law))
    history = scene.run(fx.Cycles(maximum=1.0, minimum=0.3, until=until_length(scene, 2.5)))
    rows = [r for r in history if r["event"] in GROWS]
    dG = column(rows, "dG[bond]")[: len(a)]
    np.testing.assert_allclose(dG, 0.91 * rate[: len(dG)], rtol=1e-8)
    slow = 0.1 / law.growth_rate(dG)
    # log-linear between the ends of an element
    steps = np.diff(slow) / np.diff(np.log(slow))
    np.testing.assert_allclose(np.diff(column(rows, "N"))[: len(steps)], steps, rtol=1e-6)
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
        debonds=[fx.Debond(bond(8.0), fatigue_law(partial=False, **options))],
    )


def test_a_front_in_3d_stays_symmetric_and_keeps_its_energy():
    law = fx.Paris(c1=0.0, c2=-1.0, c3=0.5, c4=4.0, r1=0.05, r2=0.99)
    for credit in (False, True):
        scene = wide(MPI.COMM_WORLD, GIc=5.0, paris=law, credit=credit)
        history = scene.run(fx.Cycles(maximum=0.3, ratio=0.1, until=until_length(scene, 11.0)))
        x = scene.pairs[0].surface.x
        mirror = np.array([np.argmin(np.abs(x - [p[0], p[1], 8.0 - p[2]]).sum(axis=1)) for p in x])
        is_open = ~scene.solver.fronts[0].bonded
        np.testing.assert_array_equal(is_open, is_open[mirror])
        assert largest_imbalance(history) < 1e-9
        assert history.details["factorizations"] <= 2
        N = np.array([r["N"] for r in history])
        assert np.all(np.diff(N) >= 0.0)
        tips = history.details["tips"]
        assert len(tips["N"]) > 2 * len(history)  # a row per front node
        scene.close()


@pytest.mark.slow
@pytest.mark.mpi
def test_ranks_agree(comm):
    for make, step in (
        (fatigue_specimen, {"maximum": HALF_OPENING, "ratio": 0.1, "n_max": 2e4}),
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
