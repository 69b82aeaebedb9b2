"""Cracks that meet, that run out of their surface, that share a laminate; steps in sequence."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from test_criteria_in_analysis import (
    CORNERS,
    ROUND_OFF,
    STEEL,
    TENSION,
    assert_balanced,
    outside_two_cracks,
    plate,
    release_times,
    run,
)

import fxcrack as fx
from fxcrack.demos import two_cracks

CRITERIA = {
    "stress": fx.CriticalStress(100.0, distance=0.25),
    "opening": fx.CrackOpening(2e-3, distance=0.25),
    "length": fx.CrackLengthVsTime((0.0, 1.0), (0.3, 2.0), reference="upper_face"),
}


@pytest.mark.quick("stress-1")
@pytest.mark.mpi
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", CRITERIA)
def test_tips_meet_and_the_crack_runs_out_of_its_surface(name: str, order: int) -> None:
    scene = plate(CRITERIA[name], bonded=outside_two_cracks, order=order)
    history = run(scene, fx.Releases(1000))
    assert history.reason == "total separation: no crack tip is left"
    assert not scene.solver.fronts[0].bonded.any()
    assert_balanced(history)
    times = release_times(scene)
    # the ligament from both sides to its middle, then the outer tips to the ends of the surface
    assert max(times[x] for x in (-0.3, 0.3, 0.0)) <= min(times[x] for x in (-1.0, 1.0))
    for side in (-1.0, 1.0):
        nodes = [round(side * (1.0 + 0.1 * k), 9) for k in range(11)]
        outer = [times[x] for x in nodes]
        assert (np.diff(outer) >= 0.0).all()
        # tips of equal f go together; which of them is first is round-off
        assert outer == pytest.approx([times[-x] for x in nodes], rel=1e-6)


def test_plate_that_comes_apart_under_a_force_ends_in_the_last_equilibrium() -> None:
    scene = plate(fx.CriticalStress(100.0, distance=0.25), supports=CORNERS, loads=TENSION)
    history = run(scene, fx.Releases(1000))
    assert history.reason == (
        "total separation: releasing the next node would leave a body unsupported (supports and "
        "bonds leave body 'upper' free to move along x and y, and free to turn); "
        "the step ends in the last equilibrium before it"
    )
    assert scene.solver.fronts[0].bonded.sum() in (1, 2)  # the last node, or both ends at once
    assert np.isfinite(history["strain_energy"]).all()
    assert_balanced(history)


@pytest.mark.parametrize("name", CRITERIA)
def test_bonds_in_the_normal_direction_only(name: str) -> None:
    def sheared(normal_only: bool) -> fx.Scene:
        whole = plate(CRITERIA[name])
        whole.close()
        bond = replace(whole.debonds[0].interface, normal_only=normal_only)
        return fx.Scene(
            whole.mesh,
            materials=STEEL,
            model=fx.PlaneStrain(),
            supports=[
                fx.Displacement("bottom", x=0.0, y=0.0), fx.Displacement("top", x=0.3, y=1.0)
            ],
            debonds=[fx.Debond(bond, CRITERIA[name])],
        )  # fmt: skip

    tied, slips = sheared(False), sheared(True)
    for scene in (tied, slips):
        history = run(scene, fx.Releases(6))
        assert_balanced(history)
        assert scene.cracks[0].n_released >= 6
    shear = [h.history["R[top.x]"] / np.maximum(h.history["time"], 1e-300) for h in (tied, slips)]
    assert (shear[0][1:] > 1.0).all()
    # nothing but the opening is transmitted, and the plate has no other hold of its upper half;
    # the stiffness is of order 1e5
    assert np.abs(slips.history["R[top.x]"]).max() < 1e-6
    if name == "length":
        assert release_times(slips) == pytest.approx(release_times(tied), rel=ROUND_OFF)


# --- one after the other, and not at all ----------------------------------------------------------


@pytest.mark.slow
@pytest.mark.mpi
def test_steps_in_sequence_and_pairs_that_stay_tied() -> None:
    scene = two_cracks.make_scene(dx=1.0, n_upper=4)
    first, second = scene.debonds

    def released() -> list[int]:
        return [g.n_released for g in scene.cracks]

    scene.run(fx.Static(until=fx.Time(2.5)), grow=[], progress=False)
    assert released() == [0, 0]
    load = scene.history["R[pin_upper.y]"]
    assert load[-1] > 1.3 * 52.6  # far above the load at which the first would have started
    scene.run(fx.Static(until=fx.Time(4.0)), grow=[first], progress=False)
    one = released()
    assert one[0] > 15
    assert one[1] == 0
    scene.run(fx.Static(until=fx.Time(9.0)), grow=[second], progress=False)
    two = released()
    assert two[0] == one[0]
    assert two[1] > 0
    history = scene.run(fx.Static(until=fx.Time(10.0)), progress=False)
    assert released()[0] > two[0]
    assert list(history["event"]).count("start") == 4
    assert history["time"][-1] == 10.0
    assert_balanced(history)


@pytest.mark.slow
def test_order_of_steps_does_not_matter_where_nothing_grows() -> None:
    at_once = two_cracks.make_scene(dx=1.0, n_upper=4)
    in_parts = two_cracks.make_scene(dx=1.0, n_upper=4)
    run(at_once, fx.Time(8.0))
    for end in (1.0, 3.0, 5.5, 8.0):
        run(in_parts, fx.Time(end))
    for g, h in zip(at_once.cracks, in_parts.cracks, strict=True):
        assert [n for n, _ in g.released] == [n for n, _ in h.released]
        times = [np.array([t for _, t in growth.released]) for growth in (g, h)]
        assert times[1] == pytest.approx(times[0], rel=1e-8)  # other retained sets, another factor


@pytest.mark.slow
@pytest.mark.mpi
def test_two_pairs_with_a_criterion_each() -> None:
    scene = two_cracks.make_scene(dx=1.0, n_upper=4)
    first, second = scene.debonds
    first = replace(first, criterion=fx.CrackOpening(0.06, distance=2.0))
    second = replace(second, criterion=fx.CriticalStress(12.0, 10.0, distance=1.0))
    mixed = fx.Scene(
        scene.mesh,
        materials=two_cracks.PLY,
        model=fx.PlaneStress(thickness=two_cracks.WIDTH),
        supports=[fx.Displacement("pin_upper", x=0.0, y=1.0),
                  fx.Displacement("pin_lower", x=0.0, y=-1.0)],
        debonds=[first, second],
    )  # fmt: skip
    history = run(mixed, fx.Time(8.0))
    assert_balanced(history)
    assert all(g.n_released > 0 for g in mixed.cracks)
    for title, quantities in (("first", {"cod", "grown"}), ("second", {"s11", "s12"})):
        columns = {c.split("[")[0] for c in history.columns if c.endswith(f"[{title}]")}
        assert quantities <= columns
    onsets = [r for r in history if r["event"] in ("onset", "unstable")]
    # whoever lets go is at f = 1 or, at constant load, above
    assert all(max(r.get("f[first]", 0), r.get("f[second]", 0)) > 1.0 - 1e-8 for r in onsets)


@pytest.mark.demos
def test_laminate_with_two_delaminations() -> None:
    scene, rows = two_cracks.run(dx=1.0, n_upper=4, until=9.0)
    start, past, woken, _ = rows
    theory = two_cracks.BEAM.dcb_load(two_cracks.A_FIRST, two_cracks.TOUGHNESS["first"])
    assert start[2] == pytest.approx(theory, rel=0.02)  # 4 elements over the arm's height: 1.2 %
    assert past[1] < woken[1]  # the first jumps into the region of the second before that grows
    assert woken[4] == pytest.approx(20.0)
    assert_balanced(scene.history)


# --- bonds that let go along an amplitude ---------------------------------------------------------

LAW = fx.AmplitudeRelease((0.0, 1e-5, 4e-5), (1.0, 0.75, 0.0))


def remaining(scene: fx.Scene, node: int) -> Any:
    """Bond force of a node in jump components."""
    index = scene.solver.index[0][node]
    return scene.solver.system.forces(scene.solver.state, index)


def test_force_follows_the_amplitude_through_steps() -> None:
    scene = plate(fx.CriticalStress(100.0, distance=0.3), release=LAW, watch=())
    run(scene, fx.Releases(2))
    node, start = scene.cracks[0].released[0]
    whole = remaining(scene, node)
    assert whole[0] < -1.0  # the slave side is held back
    for elapsed in (0.5e-5, 1e-5, 2e-5, 4e-5, 6e-5):
        history = run(scene, fx.Time(start + elapsed))
        part = float(LAW.remaining(elapsed))
        # forces are given exactly; what is left of one that is gone is round-off of the whole
        assert remaining(scene, node) == pytest.approx(part * whole, rel=1e-7, abs=1e-7)
    assert_balanced(history)
    assert history["released_energy"][-1] > 0.0


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("rows", [None, 0.1])
def test_release_in_progress_survives_steps_and_new_retained_sets(rows: float | None) -> None:
    criterion = fx.CriticalStress(100.0, distance=0.1)
    whole = plate(criterion, release=LAW, n_crack=20)
    parts = plate(criterion, release=LAW, n_crack=20, options=fx.CondensedOptions(rows=rows))
    run(whole, fx.Time(1.25e-3))
    for end in (1.0e-3, 1.1e-3, 1.16e-3, 1.25e-3):
        history = run(parts, fx.Time(end))
    times = [np.array([t for _, t in s.cracks[0].released]) for s in (whole, parts)]
    assert len(times[0]) > 30
    assert times[1] == pytest.approx(times[0], rel=ROUND_OFF)
    assert_balanced(history)
    # one per step; with a small set more while bonds behind the front still carry forces
    assert (history.details["factorizations"] > 4) == (rows is not None)


def test_first_increment_after_debonding() -> None:
    law = fx.AmplitudeRelease((0.0, 1e-4), (1.0, 0.0), first_increment=2e-5)
    scene = plate(fx.CriticalStress(100.0, distance=0.3), release=law)
    history = run(
        scene, fx.Releases(8), stepping="increment", initial=1e-4, maximum=2e-4, max_cutbacks=10
    )
    rows = history.rows
    after = [
        (b["time"] - a["time"], a["f[bond]"] >= 0.9)
        for a, b in pairwise(rows)
        if a["event"] == "release" and b["event"] == "increment"
    ]
    # the smallest one where the next tip is in its retained set from the start
    for size, met in after:
        assert size == pytest.approx(1e-9 if met else 2e-5, rel=1e-6)
    assert {met for _, met in after} == {True, False}
    assert_balanced(history)
    for a, b in pairwise(rows):
        if b["event"] == "release":  # nodes went inside the retained set of these criteria
            assert 0.9 <= a["f[bond]"] <= 1.1 + 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name", CRITERIA)
def test_increments_end_near_what_events_find(name: str) -> None:
    exact, marched = plate(CRITERIA[name]), plate(CRITERIA[name])
    run(exact, fx.Releases(4))
    step = {"length": 0.004, "stress": 1.4e-5, "opening": 6e-5}[name]
    run(marched, fx.Releases(4), stepping="increment", initial=step, maximum=step)
    first = [min(release_times(s).values()) for s in (exact, marched)]
    # f is accepted from 0.9 on, and grows by some hundredths per increment
    assert 0.85 * first[0] < first[1] <= first[0] * 1.011
