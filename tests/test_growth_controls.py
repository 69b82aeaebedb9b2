"""How a step begins, hurries, gives up and ends: small increments, cutbacks, loads without end."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI
from specimens import FORCES, HELD_FAR, dcb, grow_to, largest_imbalance, onsets, specimen
from test_criteria_in_analysis import assert_balanced, plate, run

import fxcrack as fx
from fxcrack.continuum.loads import Field
from fxcrack.demos import dcb as demo
from fxcrack.meshes.dcb import dcb_2d

PRESSED = [fx.Displacement("bottom", x=0.0, y=0.0), fx.Displacement("top", x=0.0, y=-1.0)]


# --- the criterion is met when an increment begins ------------------------------------------------

RUNAWAY = {
    "stress": fx.CriticalStress(100.0, distance=0.25),
    "opening": fx.CrackOpening(([0.0, 0.1], [2e-3, 1e-4]), distance=0.25),
}


@pytest.mark.parametrize("name", RUNAWAY)
def test_what_is_met_at_the_start_goes_in_the_smallest_increment(name: str) -> None:
    # under a constant tension the crack runs away: f of every next tip is above its range at once
    loads = [fx.Traction("top", (0.0, 1.0)), fx.Traction("bottom", (0.0, -1.0))]
    corners = [
        fx.Displacement("bottom_left", x=0.0, y=0.0), fx.Displacement("bottom_right", y=0.0)
    ]  # fmt: skip
    scene = plate(RUNAWAY[name], supports=corners, loads=loads)
    step = {"stepping": "increment", "initial": 1.0, "maximum": 1.0, "minimum": 1e-6}
    history = run(scene, fx.Releases(16), **step, max_cutbacks=10)
    assert history.reason == "16 nodes released"
    assert_balanced(history)
    met = [
        (a, b)
        for a, b in pairwise(history.rows)
        if a["event"] == "release" and b["event"] == "increment" and a["f[bond]"] >= 0.9
    ]
    assert len(met) >= 5
    assert max(a["f[bond]"] for a, _ in met) > 1.1  # no cutback could have brought it down
    for a, b in met:
        assert b["time"] - a["time"] == pytest.approx(1e-6, rel=1e-6)
        # the force is all but the same: nodes go one after the other
        assert b["released[bond]"] == a["released[bond]"]
    # without it, increments are those of the step
    first = next(r for r in history if r["event"] == "increment")
    assert first["time"] == pytest.approx(1.0)


def test_energy_release_rates_are_not_hurried_so() -> None:
    """VCCT has its unstable growth tolerance for that."""
    scene = specimen(
        dcb_2d(length=60.0, dx=1.0, ny=2), supports=HELD_FAR, loads=FORCES
    )  # fmt: skip
    history = grow_to(scene, 99.0, stepping="increment", initial=0.05, maximum=0.05)
    assert history.reason.startswith("stopped: f = ")
    steps = np.diff([r["time"] for r in history if r["event"] in ("start", "increment")])
    assert steps.min() > 1e-4


def test_neutral_growth_goes_on_in_small_increments() -> None:
    """Pure moments: f is the same at every crack length, at last the upper end of its range."""

    def moment(sign: float, y: float) -> tuple[Field, ...]:
        return (lambda x: sign * (x[1] - y), 0.0)

    loads = [
        fx.Traction("end_upper", moment(1.0, 0.75)),
        fx.Traction("end_lower", moment(-1.0, -0.75)),
    ]
    scene = specimen(dcb_2d(length=110.0, dx=1.0, ny=2), supports=HELD_FAR, loads=loads)
    history = grow_to(scene, 90.0, stepping="increment", initial=7.0, maximum=7.0)
    assert history.reason == "crack length 90 of 'bond' reached"
    at = [r for r in history if r["event"] == "increment" and r["f[bond]"] >= 1.0]
    assert len(at) == 60 and max(r["f[bond]"] for r in at) < 1.2
    # the last nodes go one by one at one load
    assert 0.0 < at[-1]["time"] - at[-20]["time"] < 1e-6
    assert_balanced(history)


# --- giving up ------------------------------------------------------------------------------------


def test_needing_less_than_the_smallest_increment_keeps_what_was_found(
    caplog: pytest.LogCaptureFixture,
) -> None:
    scene = dcb(MPI.COMM_SELF, dx=1.0, ny=2, criterion=fx.VCCT(GIc=0.2, tolerance=1e-4))
    history = grow_to(
        scene, 40.0, stepping="increment", initial=0.1, maximum=0.1, minimum=0.02, max_cutbacks=99
    )
    assert history.reason.startswith("stopped: f = ")
    assert "would be below the minimum 0.02; lower the minimum" in history.reason
    assert history.reason in caplog.text
    # rows so far stay, and the state is that of the last of them
    assert [r["event"] for r in history].count("increment") >= 5
    end = history.rows[-1]
    assert end["event"] == "end" and end["time"] == pytest.approx(scene.time)
    assert end["f[bond]"] <= 1.0 + 1e-4
    assert end["strain_energy"] == pytest.approx(end["external_work"], rel=1e-9)
    assert largest_imbalance(history) < 1e-9
    # and a following step goes on from there
    more = grow_to(scene, 32.0)
    assert more.reason == "crack length 32 of 'bond' reached"
    assert largest_imbalance(more) < 1e-9


# --- a criterion that no load reaches -------------------------------------------------------------


@pytest.mark.parametrize("stepping", ["event", "path"])
def test_a_load_that_never_opens_the_crack_is_not_raised_without_end(stepping: str) -> None:
    scene = plate(fx.CriticalStress(100.0, distance=0.25), supports=PRESSED)
    history = run(scene, fx.Releases(1), stepping=stepping)
    assert history.reason.startswith("the criterion is not reached however large the load becomes")
    end = history.rows[-1]
    # nothing had happened before: the loads as they were given
    assert end["time"] == scene.time == 1.0
    assert end["u[top.y]"] == -1.0
    assert end["f[bond]"] == 0.0
    assert_balanced(history)
    again = run(scene, fx.Time(2.0))
    assert again.rows[-1]["u[top.y]"] == -2.0


def test_round_off_of_a_stress_that_vanishes_by_symmetry_is_no_cause_of_growth() -> None:
    # an arm's height ahead of the tip of a bent beam the interface is pressed together, and the
    # shear stress is zero up to round-off
    made = fx.CriticalStress(40.0, 80.0, distance=1.5)
    scene = dcb(MPI.COMM_SELF, dx=0.5, ny=4, criterion=made)
    history = scene.run(fx.Static(until=fx.Releases(1)))
    assert history.reason.startswith("the criterion is not reached however large the load becomes")
    assert history["s11[bond]"][-1] < -1.0
    assert history["time"][-1] == 1.0


def test_a_crack_that_stops_for_good_ends_in_the_state_of_its_last_release() -> None:
    # it runs into a part of the interface that is stronger by far
    scene = dcb(
        MPI.COMM_SELF, dx=1.0, ny=2,
        criterion=fx.VCCT(GIc=lambda x: np.where(x[0] < 34.5, 0.2, 1e70)),
    )  # fmt: skip
    history = grow_to(scene, 60.0)
    assert history.reason.startswith("the criterion is not reached however large the load becomes")
    last = onsets(history)[-1]
    end = history.rows[-1]
    assert end["released[bond]"] == 5
    assert end["time"] == last["time"] and end["u[pin_top.y]"] == last["u[pin_top.y]"]
    assert largest_imbalance(history) < 1e-9


def test_a_weak_beginning_does_not_end_the_growth() -> None:
    # f ahead of it is 1e-9/0.2 of 1 after the last weak bond, but no round-off
    weak, plain = (
        dcb(MPI.COMM_SELF, dx=1.0, ny=2, a0=a0, criterion=fx.VCCT(GIc=toughness))
        for a0, toughness in ((30.0, lambda x: np.where(x[0] < 31.5, 1e-9, 0.2)), (32.0, 0.2))
    )
    history = weak.run(fx.Static(until=fx.Releases(4)), progress=False)
    expected = plain.run(fx.Static(until=fx.Releases(2)), progress=False)
    assert history.reason == "4 nodes released"
    loads, wanted = ([r["R[pin_top.y]"] for r in onsets(h)] for h in (history, expected))
    assert loads[-2:] == pytest.approx(wanted, rel=1e-9)
    assert largest_imbalance(history) < 1e-9


def test_softening_bonds_are_as_they_were_where_the_search_began() -> None:
    scene = dcb(
        MPI.COMM_SELF, dx=1.0, ny=2, release=fx.ProgressiveRelease(),
        criterion=fx.VCCT(GIc=lambda x: np.where(x[0] < 31.5, 0.2, 1e70)),
    )  # fmt: skip
    history = grow_to(scene, 60.0)
    assert history.reason.startswith("the criterion is not reached however large the load becomes")
    assert history.rows[-1]["time"] < 10.0
    assert largest_imbalance(history) < 1e-9


# --- loads that come and go -----------------------------------------------------------------------


def test_rows_where_amplitudes_bend() -> None:
    """Up, down and up again: between two rows everything is linear in time."""
    up_and_down = fx.Amplitude((0.0, 1.0, 2.0, 3.0), (0.0, 1.5, 0.0, 0.5))
    pins = [
        fx.Displacement("pin_top", x=0.0, y=1.0, amplitude=up_and_down),
        fx.Displacement("pin_bottom", x=0.0, y=-1.0, amplitude=up_and_down),
    ]
    scene = specimen(dcb_2d(length=60.0, dx=1.0, ny=2), supports=pins)
    history = scene.run(fx.Static(until=fx.CrackLength(scene.debonds[0].interface, 55.0)))
    peak, down = (r for r in history if r["event"] == "bend" and r["time"] < 3.0)
    assert (peak["time"], peak["u[pin_top.y]"]) == (1.0, 1.5)
    assert (down["time"], down["u[pin_top.y]"]) == (2.0, 0.0)
    assert peak["a[bond]"] == down["a[bond]"] > 31.0
    assert abs(down["R[pin_top.y]"]) < 1e-12 * peak["R[pin_top.y]"]
    assert_balanced(history)
    assert history.reason == (
        "the loads stay as they are from time 3 on, where their amplitudes end, and the criterion "
        "is not reached"
    )
    # at the end of the step there is one row
    scene = specimen(dcb_2d(length=60.0, dx=1.0, ny=2), supports=pins)
    to_the_peak = scene.run(fx.Static(until=fx.Time(1.0)))
    assert [r["event"] for r in to_the_peak if r["time"] == 1.0] == ["end"]


def test_a_crack_that_is_longer_already_cannot_be_told_to_stop_there():
    scene, bond = demo.make_scene(1.0, 2)
    with pytest.raises(fx.InputError, match=r"CrackLength\(20\): .* 30 long already"):
        scene.run(fx.Static(until=fx.CrackLength(bond, 20.0)), progress=False)
    scene.run(fx.Static(until=fx.CrackLength(bond, 31.0)), progress=False)
    # a length that is just reached is no mistake: the step ends at once
    history = scene.run(fx.Static(until=fx.CrackLength(bond, 31.0)), progress=False)
    assert history["a[bond]"][-1] == pytest.approx(31.0)
    scene.close()
