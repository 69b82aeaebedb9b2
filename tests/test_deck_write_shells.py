"""Shells and continuum shells written as decks: what is read again gives the same history."""

from __future__ import annotations

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.deck.write_shells import MOVED, ROTATIONS
from fxcrack.meshes.dcb import dcb_3d
from fxcrack.meshes.sheets import Sheet, sheets
from tests.shell_arms import UD, bond, two_arms
from tests.test_deck_write import round_trip

LAMINATE = fx.Laminate([fx.Ply(0.5, 0.0, UD), fx.Ply(0.4, 45.0, UD), fx.Ply(0.6, 90.0, UD)])
# the numbers of degrees of freedom, the order of the sums and the axis, which is found again from
# an orientation, differ from the scene's: round-off times the condition number
REL = 1e-9


def increments(end):
    return fx.Static(
        until=fx.Time(end), stepping="increment", initial=0.25 * end, minimum=1e-6, maximum=end
    )


def arms(comm, *, element, upper, lower):
    mesh = two_arms(
        comm, length=60.0, width=20.0, heights=(1.5, 1.5), dx=6.0, ny=2, element=element
    )
    return fx.Scene(
        mesh,
        model=fx.Shell(),
        materials={"upper": upper, "lower": lower},
        supports=[
            fx.Clamp("upper_a1"),
            fx.Clamp("lower_a1"),
            fx.Displacement("upper_a0", z=2.0),
            fx.Displacement("lower_a0", z=-2.0),
            fx.Rotation("upper_a0", x=0.0),
        ],
        loads=[fx.Pressure(fx.Face("upper", "top"), 1e-3, name="wind")],
        debonds=[
            fx.Debond(
                bond(30.0), fx.VCCT(0.17, 0.5, mix=fx.BK(1.7), tolerance=0.5), fx.StepRelease()
            )
        ],
    )


@pytest.mark.mpi
@pytest.mark.three
def test_a_dcb_of_shells_is_the_same(comm, shared_path):
    plain = fx.Section(fx.Isotropic(70e3, 0.3), thickness=1.5)
    one = arms(comm, element=("quadrilateral", 1), upper=fx.Section(LAMINATE), lower=plain)
    deck = round_trip(shared_path / "a.inp", one, [increments(1.0)], rel=REL)
    assert deck.scene.history.rows[-1]["released[bond]"] > 0


@pytest.mark.parametrize("element", [("quadrilateral", 2), ("triangle", 1)])
def test_shells_of_other_shapes_with_offset_and_normals_down(tmp_path, comm, element):
    """The lower arm's normal points down in the scene's words only: its elements are turned."""
    axis = (1.0, 0.2, 0.0)
    down = fx.Section(LAMINATE, axis=axis, offset=0.1)
    mesh = two_arms(comm, length=20.0, width=8.0, heights=(1.5, 1.5), dx=5.0, element=element)
    held = [fx.Clamp("upper_a1"), fx.Clamp("lower_a1")]
    turned = fx.Section(LAMINATE, axis=axis, offset=-0.1, up=(0.0, 0.0, -1.0))
    one = fx.Scene(
        mesh,
        model=fx.Shell(),
        materials={"upper": down, "lower": turned},
        supports=[*held, fx.Displacement("upper_a0", z=0.1)],
        loads=[
            fx.PointForce("lower_a0", (0.0, 0.0, 1.0)),
            fx.Pressure(fx.Face("lower", "top"), 1e-3),
        ],
    )
    round_trip(tmp_path / "a.inp", one, [increments(1.0)], rel=REL)


def test_joints_of_shells_are_common_nodes_again(tmp_path, comm):
    x, y = np.linspace(0.0, 4.0, 5), np.linspace(0.0, 2.0, 3)
    flange = Sheet("flange", x, y)
    web = Sheet("web", x, y, lambda a, b: (4.0 + 0.0 * a, b, a))
    mesh = sheets([flange, web], comm, joined=True)
    one = fx.Scene(
        mesh,
        model=fx.Shell(),
        materials=fx.Section(fx.Isotropic(70e3, 0.3), thickness=0.2, axis=(0.0, 1.0, 0.0)),
        supports=[fx.Clamp("flange_a0")],
        loads=[
            fx.PointForce("web_a1", (1.0, 0.0, 0.0)),
            fx.PointMoment("web_a1", (0.0, 1.0, 0.0), name="turn"),
        ],
    )
    names = {f"{of}[turn]": f"{of}[turn.moment]" for of in "Fv"}
    round_trip(tmp_path / "a.inp", one, [increments(1.0)], rel=REL, other_names=names)


def test_rotations_of_hexahedra():
    """All 24 keep the volume positive and bring each face everywhere."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0],
                        [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)  # fmt: skip
    assert ROTATIONS.shape == (24, 8)
    for rotation in ROTATIONS:
        x = corners[rotation]
        assert np.linalg.det(x[[1, 3, 4]] - x[0]) == pytest.approx(1.0)
    assert all(len(set(column)) == 6 for column in MOVED.T)


def dcb(order, *, upper, lower):
    mesh = dcb_3d(length=40.0, height=1.5, width=10.0, dx=5.0, dy=5.0, ny=1, order=order)
    delta = [fx.Displacement("pin_top", x=0.0, y=0.5), fx.Displacement("pin_bottom", x=0.0, y=-0.5)]
    held = [fx.Displacement("far_upper", z=0.0), fx.Displacement("far_lower", z=0.0)]
    interface = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 20.0 - 1e-9, name="bond", contact=True
    )
    return fx.Scene(
        mesh,
        model=fx.Solid(),
        materials={"upper": upper, "lower": lower},
        supports=delta + held,
        debonds=[
            fx.Debond(
                interface, fx.VCCT(0.17, 0.5, mix=fx.BK(1.7), tolerance=0.5), fx.StepRelease()
            )
        ],
    )


@pytest.mark.mpi
def test_continuum_shells_beside_solids_are_the_same(shared_path):
    shell = fx.ContinuumShell(LAMINATE, bottom="upper_face", top="top", axis=(1.0, 0.0, 0.0))
    one = dcb(2, upper=shell, lower=fx.Isotropic(70e3, 0.3))
    round_trip(shared_path / "a.inp", one, [increments(0.5)], rel=REL)


def test_continuum_shells_of_first_order_need_a_word_on_reading(tmp_path, caplog):
    shell = fx.ContinuumShell(LAMINATE, bottom="upper_face", top="top", axis=(1.0, 0.0, 0.0))
    one = dcb(1, upper=shell, lower=fx.ContinuumShell(UD, "bottom", "lower_face", axis=(1, 0, 0)))
    fx.write_deck(one, [increments(0.5)], tmp_path / "a.inp")
    assert "read the deck with order=1" in caplog.text
    deck = fx.read_deck(tmp_path / "a.inp", order=1)
    found, wanted = deck.run(), one.run(increments(0.5))
    for column in ("R[pin_top.y]", "a[bond]", "strain_energy"):
        assert found[column] == pytest.approx(wanted[column], rel=REL)


def test_what_a_deck_of_shells_has_no_word_for(tmp_path, comm):
    plain = fx.Section(fx.Isotropic(70e3, 0.3), thickness=1.5)
    for other, words in (
        (fx.Section(LAMINATE, shear_factor=0.8), "factors of transverse shear"),
        (
            fx.Section(
                fx.Orthotropic((1e3,) * 3, (0.3,) * 3, (400.0,) * 3, frame=30.0), thickness=1.5
            ),
            "frame of its own",
        ),
    ):
        one = arms(comm, element=("quadrilateral", 1), upper=other, lower=plain)
        with pytest.raises(fx.InputError, match=words):
            fx.write_deck(one, [increments(1.0)], tmp_path / "a.inp")
