"""Increment control alone, and what a step refuses before it starts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from specimens import PINS, STEEL, bond, dcb, interface_of

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.steps.increment_control import IncrementControl, TooManyCutbacks

END = fx.Time(1.0)


def control(**controls: float) -> IncrementControl:
    return IncrementControl(fx.Static(until=END, stepping="increment", **controls))


def test_grows_up_to_the_maximum() -> None:
    c = control(initial=0.1, maximum=0.3)
    sizes = []
    for _ in range(5):
        sizes.append(c.size)
        c.accepted()
    assert sizes == pytest.approx([0.1, 0.15, 0.225, 0.3, 0.3])


def test_cuts_back_and_does_not_grow_at_once() -> None:
    c = control(initial=0.4, cutback=0.25)
    c.rejected(0.4, "f = 2")
    assert c.size == pytest.approx(0.1)
    c.accepted()
    assert c.size == pytest.approx(0.1) and c.cutbacks == 0
    c.accepted()
    assert c.size == pytest.approx(0.15)
    # an increment shortened by an end of the step is cut from what was used
    c.rejected(0.02, "f = 2")
    assert c.size == pytest.approx(0.005)


def test_gives_up() -> None:
    c = control(initial=1.0, max_cutbacks=2)
    c.rejected(1.0, "f = 1.7")
    c.rejected(0.5, "f = 1.6")
    with pytest.raises(
        TooManyCutbacks, match=r"f = 1\.5 after 2 cutbacks; allow unstable growth .*='event'"
    ):
        c.rejected(0.25, "f = 1.5")
    c = control(initial=1.0, minimum=0.9)
    with pytest.raises(
        TooManyCutbacks, match=r"next increment 0\.5 would be below the minimum 0\.9"
    ):
        c.rejected(1.0, "f = 2")


@given(st.lists(st.booleans(), max_size=60), st.floats(1.0, 3.0), st.floats(0.1, 0.9))
def test_stays_within_its_limits(verdicts: list[bool], growth: float, cutback: float) -> None:
    c = control(initial=0.1, minimum=1e-3, maximum=0.7, growth=growth, cutback=cutback)
    try:
        for good in verdicts:
            assert 1e-3 <= c.size <= 0.7 and 0 <= c.cutbacks <= 5
            if good:
                c.accepted()
            else:
                c.rejected(c.size, "f = 2")
    except TooManyCutbacks:
        assert c.cutbacks > 5 or c.size < 1e-3


@pytest.mark.parametrize(
    ("controls", "message"),
    [
        ({"stepping": "leap"}, "stepping = 'leap': choose event, increment, path or opening"),
        ({"initial": 0.0}, "0 < minimum <= initial <= maximum"),
        ({"minimum": 0.2}, "0 < minimum <= initial <= maximum"),
        ({"initial": 0.2, "maximum": 0.1}, "0 < minimum <= initial <= maximum"),
        ({"growth": 0.9}, "growth must be >= 1"),
        ({"cutback": 1.0}, "cutback between 0 and 1"),
        ({"max_cutbacks": -1}, "max_cutbacks = -1"),
    ],
)
def test_impossible_controls(controls: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        fx.Static(until=END, **controls)


def test_impossible_ends() -> None:
    with pytest.raises(InputError, match=r"Time\(0\.0\): the end time must be positive"):
        fx.Time(0.0)
    scene = dcb(MPI.COMM_SELF, dx=2.0, ny=1)
    other = bond(10.0)
    with pytest.raises(InputError, match="CrackLength was given another Interface that is called"):
        scene.run(fx.Static(until=fx.CrackLength(other, 40.0)))
    with pytest.raises(InputError, match="is not part of the scene"):
        scene.run(fx.Static(until=END), grow=[fx.Debond(other, fx.VCCT(GIc=1.0))])


def test_path_needs_one_proportional_load() -> None:
    pulled = [
        fx.Displacement(s.where, x=0.0, y=s.y, amplitude=fx.Amplitude((0.0, 1.0), (0.0, 1.0)))
        for s in PINS
    ]
    scene = dcb(MPI.COMM_SELF, dx=2.0, ny=1, supports=pulled)
    with pytest.raises(InputError, match="stepping='path' follows one proportional load"):
        scene.run(fx.Static(until=fx.Releases(1), stepping="path"))


def test_retained_set_that_exceeds_its_cap() -> None:
    scene = dcb(MPI.COMM_SELF, dx=2.0, ny=1, options=fx.CondensedOptions(retained_mb=1e-4))
    with pytest.raises(InputError, match=r"exceed the cap of 0 MB; raise retained_mb, or coarsen"):
        scene.run(fx.Static(until=fx.Releases(1)))


def test_unknown_way_of_condensing() -> None:
    words = "choose one of 'auto', 'schur', 'columns', 'iterative'"
    with pytest.raises(InputError, match=words):
        fx.CondensedOptions(method="guess")


def test_nothing_can_grow(caplog: pytest.LogCaptureFixture) -> None:
    """A scene without tips says so and ends; one without debonds is a static solve."""
    mesh = dcb_2d(MPI.COMM_SELF, dx=2.0, ny=1)
    whole = fx.Interface(slave="upper_face", master="lower_face", name="whole")
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=PINS,
        debonds=[fx.Debond(whole, fx.VCCT(GIc=1.0))],
    )
    assert scene.run(fx.Static(until=fx.Releases(1))).reason == "no crack tip is left"
    assert "has no crack tip" in caplog.text
    tied = fx.Scene(mesh, materials=STEEL, model=fx.PlaneStrain(), supports=PINS, bonds=[whole])
    history = tied.run(fx.Static(until=fx.Time(2.0)))
    assert history.reason == "time 2 reached"
    assert history["u[pin_top.y]"][-1] == 2.0
    assert history["external_work"][-1] == pytest.approx(history["strain_energy"][-1], rel=1e-9)


def test_time_is_reached_exactly_and_ends_hold_together() -> None:
    """Whichever end comes first ends the step."""
    scene = dcb(MPI.COMM_SELF, dx=1.0, ny=2)
    crack = interface_of(scene)
    history = scene.run(
        fx.Static(until=(fx.Time(1.0), fx.CrackLength(crack, 90.0), fx.Releases(50)))
    )
    assert history.reason == "time 1 reached" and history["time"][-1] == 1.0
    history = scene.run(fx.Static(until=(fx.Time(9.0), fx.CrackLength(crack, 34.0))))
    assert history.reason == "crack length 34 of 'bond' reached"
    assert history["a[bond]"][-1] == pytest.approx(34.0, rel=1e-9)
    released = history["released[bond]"][-1]
    history = scene.run(fx.Static(until=(fx.Time(9.0), fx.Releases(int(released) + 2))))
    assert history.reason == f"{released + 2} nodes released"
    assert np.all(np.diff(history["time"].astype(float)) >= 0.0)
    scene.close()
