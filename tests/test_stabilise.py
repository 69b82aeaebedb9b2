"""Bodies that only contact holds: named, and held by a weak foundation until faces touch."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import largest_imbalance

import fxcrack as fx
from fxcrack.meshes.blocks import Blocks, build

E, GAP, PRESS = 1000.0, 0.01, 2.0
STEP = fx.Static(until=fx.Time(1.0), maximum=0.5)


def blocks(comm: MPI.Intracomm, *, lid: bool = False) -> fx.Mesh:
    """Two unit squares, the upper one a gap above the lower one, and perhaps a third one above."""

    def make() -> Blocks:
        model = Blocks()
        x, y = np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 3)
        low = model.add("low", [x, y], "quadrilateral", 1)
        up = model.add("up", [x, y + 1.0 + GAP], "quadrilateral", 1)
        model.group("floor", low.part(y=0.0))
        model.group("under", low.part(y=1.0))
        model.group("over", up.part(y=1.0 + GAP))
        model.group("top", up.part(y=2.0 + GAP))
        model.group("corner", up.part(x=0.0, y=2.0 + GAP))
        if lid:
            third = model.add("lid", [x, y + 2.0 + 2 * GAP], "quadrilateral", 1)
            model.group("lid under", third.part(y=2.0 + 2 * GAP))
            model.group("roof", third.part(y=3.0 + 2 * GAP))
        return model

    return build(comm, "blocks", make)


def pressed(comm: MPI.Intracomm, supports: Any = (), **scene: Any) -> fx.Scene:
    """The upper block pressed down, free but for contact and further supports."""
    touch = fx.Interface(
        "over", "under", bonded=lambda x: np.zeros(x.shape[1], dtype=bool), contact=True,
        gap="keep", name="touch",
    )  # fmt: skip
    return fx.Scene(
        blocks(comm),
        materials=fx.Isotropic(E, 0.0),
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("floor", x=0.0, y=0.0), *supports],
        loads=[fx.Traction("top", (0.0, -PRESS))],
        bonds=[touch],
        monitors=[fx.Monitor("top", (0.0, -1.0), name="down")],
        **scene,
    )


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("solver", [None, "newton"])
def test_a_body_falls_onto_another(comm: MPI.Intracomm, solver: str | None) -> None:
    history = pressed(comm, stabilise={"up": 1e-6}, solver=solver).run(STEP, progress=False)
    # nu = 0: the gap, then the compression of two unit blocks; the foundation takes 6e-6 of it
    assert history["m[down]"][-1] == pytest.approx(GAP + 2.0 * PRESS / E, rel=1e-4)
    assert history["R[floor.y]"][-1] == pytest.approx(PRESS, rel=1e-4)
    last = history.rows[-1]
    assert 0.0 < last["stabilising_energy"] < 1e-4 * last["strain_energy"]
    # k = s E/L^2 with L = 1 on a body that has moved by the gap and a little more
    assert last["stabilising_energy"] == pytest.approx(0.5e-6 * E * 0.013**2, rel=0.05)
    assert largest_imbalance(history) < 1e-6


@pytest.mark.mpi
@pytest.mark.parametrize("solver", [None, "newton"])
def test_without_it_the_body_is_named(comm: MPI.Intracomm, solver: str | None) -> None:
    with pytest.raises(fx.FxcrackError, match=r"body 'up' free to move along x"):
        pressed(comm, solver=solver).run(STEP, progress=False)
    # held sideways it begins where the faces touch, and ends where they part
    held = [fx.Displacement("corner", x=0.0)]
    history = pressed(comm, held, solver=solver).run(STEP, progress=False)
    assert history["m[down]"][-1] == pytest.approx(GAP + 2.0 * PRESS / E, rel=1e-9)
    lift = fx.Amplitude((0.0, 1.0, 2.0), (0.0, 1.0, -1.0))
    up = [fx.Traction("top", (0.0, -PRESS), amplitude=lift)]
    parted = (
        pressed(comm, held, solver=solver)
        .rebuilt(loads=up)
        .run(fx.Static(until=fx.Time(2.0), maximum=0.5), progress=False)
    )
    assert parted["time"][-1] == pytest.approx(1.5, rel=1e-2)
    assert "faces part whose contact alone held a body" in parted.reason


@pytest.mark.mpi
@pytest.mark.parametrize("solver", [None, "newton"])
def test_a_body_between_two_others(comm: MPI.Intracomm, solver: str | None) -> None:
    # it cannot begin on both faces, and on neither nothing holds it along y
    floor, roof = (fx.Displacement(name, x=0.0, y=0.0) for name in ("floor", "roof"))
    lid = fx.Interface(
        "top", "lid under", bonded=lambda x: np.zeros(x.shape[1], dtype=bool), contact=True,
        gap="keep", name="lid",
    )  # fmt: skip
    weight = fx.BodyForce((0.0, -PRESS), where="up")
    scene = pressed(comm, solver=solver)
    between = scene.rebuilt(
        mesh=blocks(comm, lid=True),
        bonds=[*scene.input.bonds, lid],
        supports=[floor, roof, fx.Displacement("corner", x=0.0)],
        loads=[weight],
    )
    with pytest.raises(fx.FxcrackError, match=r"body 'up' free .*stabilise="):
        between.run(STEP, progress=False)
    founded = between.rebuilt(stabilise={"up": 1e-6})
    history = founded.run(STEP, progress=False)
    assert history["R[floor.y]"][-1] == pytest.approx(PRESS, rel=1e-4)
    assert abs(history["R[roof.y]"][-1]) < 1e-9
    assert largest_imbalance(history) < 1e-6


def test_a_body_that_is_lifted_off_again() -> None:
    # touching first, then pulled away: the foundation alone holds it, which is said
    there_and_back = fx.Amplitude((0.0, 1.0, 3.0), (0.0, 1.0, -1.0))
    scene = pressed(MPI.COMM_SELF, stabilise=1e-3)
    lifted = scene.rebuilt(loads=[fx.Traction("top", (0.0, -PRESS), amplitude=there_and_back)])
    history = lifted.run(fx.Static(until=fx.Time(3.0), maximum=0.5), progress=False)
    assert history.reason == "time 3 reached"
    # of both blocks on the foundation the upper one alone moves; L is the height of both
    assert history["m[down]"][-1] == pytest.approx(-PRESS * (2 + GAP) ** 2 / (1e-3 * E), rel=1e-2)
    assert largest_imbalance(history) < 1e-9


def test_a_foundation_that_carries_the_load_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    pressed(MPI.COMM_SELF, stabilise=0.5).run(STEP, progress=False)
    assert "it carries part of the loads; lower stabilise" in caplog.text


@pytest.mark.parametrize("wrong", [0.0, -1e-6, 2.0, "weak", {}, {"up": None}, {3: 1e-6}])
def test_wrong_fractions(wrong: Any) -> None:
    with pytest.raises(fx.InputError, match="stabilise"):
        pressed(MPI.COMM_SELF, stabilise=wrong)


def test_unknown_group() -> None:
    with pytest.raises(fx.InputError, match="'upper'"):
        pressed(MPI.COMM_SELF, stabilise={"upper": 1e-6})
