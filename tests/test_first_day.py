"""What a first-day user gets wrong, and what he is told."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from specimens import FORCES, HELD_FAR, PINS, bond, grow_to, interface_of, specimen

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.meshes.enf import enf_2d
from fxcrack.meshes.laminate import laminate_2d


def mesh(comm: MPI.Comm) -> fx.Mesh:
    return dcb_2d(comm, length=60.0, dx=2.0, ny=1)


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ({"E": (1e5, 1e4)}, r"E = \(100000.0, 10000.0\) must be three numbers, \(E1, E2, E3\)"),
        ({"nu": 0.3}, r"nu = 0.3 must be three numbers, \(nu12, nu13, nu23\)"),
        ({"G": ("5e3", 5e3, 5e3)}, r"G = .* must be three numbers, \(G12, G13, G23\)"),
    ],
)
def test_constants_of_an_orthotropic_ply(part: dict[str, object], words: str) -> None:
    ply = {"E": (1e5, 1e4, 1e4), "nu": (0.3, 0.3, 0.4), "G": (5e3, 5e3, 4e3)}
    with pytest.raises(fx.InputError, match=words):
        fx.Orthotropic(**{**ply, **part})


def test_crack_length_by_name() -> None:
    with pytest.raises(fx.InputError, match="interface = 'bond' must be the Interface itself"):
        fx.CrackLength("bond", 40.0)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("supports", "words"),
    [
        ([], "free to move along x and y, and free to turn"),
        ([fx.Displacement("pin_top", y=1.0)], "free to move along x, and free to turn"),
        ([fx.Displacement("pin_top", x=0.0, y=1.0)], "leave the whole model free to turn"),
        ([fx.Displacement("top", y=1.0)], r"leave the whole model free to move along x\)"),
    ],
)
def test_forgotten_support(comm: MPI.Comm, supports: list[fx.Displacement], words: str) -> None:
    with pytest.raises(fx.FxcrackError, match=f"can still move freely.*{words}"):
        grow_to(specimen(mesh(comm), supports=supports), 40.0)


@pytest.mark.mpi
def test_section_on_both_sides_of_the_axis(comm: MPI.Comm) -> None:
    plate = mesh(comm)
    plate.domain.geometry.x[:, 0] -= 20.0
    with pytest.raises(fx.InputError, match=r"nodes at radius x = -.*; model one half-section"):
        specimen(plate, model=fx.Axisymmetric())


def test_material_left_out(comm: MPI.Comm) -> None:
    with pytest.raises(fx.InputError, match=r"given: upper; not given: lower\)"):
        specimen(mesh(comm), materials={"upper": fx.Isotropic(7e4, 0.3)})


@pytest.mark.parametrize(("first", "share"), [(-1.0, "all"), (3e4, "none")])
def test_bonded_set_in_other_units(
    comm: MPI.Comm, caplog: pytest.LogCaptureFixture, first: float, share: str
) -> None:
    grow_to(specimen(mesh(comm), interface=bond(first), supports=[*PINS, *HELD_FAR]), 40.0)
    assert f"{share} of its 31 slave nodes, between (0, 0, 0) and (60, 0, 0), are" in caplog.text


def test_an_empty_bonded_set_that_should_hold_the_bodies(comm: MPI.Comm) -> None:
    with pytest.raises(fx.FxcrackError, match="free to turn; the bonded set of interface 'bond' h"):
        grow_to(specimen(mesh(comm), interface=bond(3e4)), 40.0)


def test_a_crack_longer_than_its_interface(
    comm: MPI.Comm, caplog: pytest.LogCaptureFixture
) -> None:
    scene = specimen(mesh(comm))
    ends = [fx.CrackLength(interface_of(scene), 60.1), fx.Releases(1)]
    assert scene.run(fx.Static(until=ends)).reason == "1 node released"
    if comm.rank == 0:
        assert "CrackLength(60.1): the crack of 'bond' cannot be longer than 60" in caplog.text


def test_rows_that_do_not_exist(comm: MPI.Comm) -> None:
    history = grow_to(specimen(mesh(comm)), 34.0)
    with pytest.raises(fx.InputError, match=r"no row with a\[bond\] >= 99 among"):
        history.at("a[bond]", 99.0)
    with pytest.raises(fx.InputError, match=r"no row of event 'onst'.*did you mean 'onset'"):
        history.at("a[bond]", 31.0, event="onst")
    with pytest.raises(fx.InputError, match="no column 'bond'"):
        history.at("bond", 31.0)


def test_faces_that_pass_through_each_other(
    comm: MPI.Comm, caplog: pytest.LogCaptureFixture
) -> None:
    for contact in (True, False):
        beam = specimen(
            enf_2d(comm, half_span=50.0, dx=2.0, ny=1),
            contact=contact,
            supports=[
                fx.Displacement("support_left", y=0.0),
                fx.Displacement("support_right", x=0.0, y=0.0),
            ],
            loads=[fx.PointForce("load", (0.0, -1.0))],
        )
        beam.run(fx.Static(until=fx.Releases(1)))
        assert ("open faces overlap behind the tip at (30, 0, 0)" in caplog.text) != contact
    assert caplog.text.count("overlap") == 1


def test_faces_that_move_alike_do_not_overlap(caplog: pytest.LogCaptureFixture) -> None:
    """A film compressed with its substrate: only round-off is left between the faces."""
    for push in (-0.3, -0.5, -0.7):  # the sign of a jump of round-off is by chance
        film = laminate_2d(MPI.COMM_SELF, plies=(2.0, 0.1), crack=1, length=12.0, dx=0.5, order=2)
        ends = (("end", 0.0), ("far", push))
        sides = [fx.Displacement(f"{e}_{s}", x=x) for e, x in ends for s in ("upper", "lower")]
        supports = [*sides, fx.Displacement("bottom", y=0.0)]
        pressed = specimen(film, a0=3.0, materials=fx.Isotropic(70e3, 0.3), supports=supports)
        pressed.run(fx.Static(until=fx.Time(1.0)), progress=False)
        assert "overlap" not in caplog.text
        pressed.close()


def test_loads_of_the_wrong_sign(comm: MPI.Comm, caplog: pytest.LogCaptureFixture) -> None:
    closing = [fx.PointForce(f.where, tuple(-np.array(f.value))) for f in FORCES]
    history = specimen(mesh(comm), supports=HELD_FAR, loads=closing).run(
        fx.Static(until=fx.Time(9.0))
    )
    assert history.rows[-1]["f[bond]"] == 0.0
    assert "or check the sign of the loads" in caplog.text


def test_classes_where_their_instances_belong() -> None:
    with pytest.raises(fx.InputError, match="is no mode-mix law; give one with its exponents"):
        fx.VCCT(GIc=0.2, GIIc=0.5, mix=fx.BK)
    with pytest.raises(fx.InputError, match=r"interface 'bond': release = .*is no release law"):
        fx.Debond(bond(30.0), fx.VCCT(GIc=0.2), fx.ProgressiveRelease)


def test_one_boolean_for_all_nodes(comm: MPI.Comm) -> None:
    one = fx.Interface("upper_face", "lower_face", bonded=lambda x: (x[0] >= 30.0).any())
    with pytest.raises(fx.InputError, match=r"bonded gives a single .*one boolean per position"):
        specimen(mesh(comm), interface=one)
    every = fx.Interface("upper_face", "lower_face", bonded=lambda x: True)
    assert specimen(mesh(comm), interface=every).solver.fronts[0].bonded.all()


def test_bonded_by_a_chain_of_comparisons(comm: MPI.Comm) -> None:
    chain = fx.Interface("upper_face", "lower_face", bonded=lambda x: 30.0 <= x[0] <= 50.0)
    with pytest.raises(fx.InputError, match=r"function bonded fails: .*join conditions by & or"):
        specimen(mesh(comm), interface=chain)


@pytest.mark.slow
@pytest.mark.mpi
def test_pressure_by_functions(comm: MPI.Comm) -> None:
    def loads(value: object) -> list[fx.Pressure]:
        return [fx.Pressure("upper_face", value), fx.Pressure("lower_face", value)]

    values = 1.0, lambda x: 1.0, lambda x: np.ones(x.shape[1])
    times = []
    for value in values:
        history = specimen(mesh(comm), supports=HELD_FAR, loads=loads(value)).run(
            fx.Static(until=fx.Releases(1))
        )
        times.append(history.rows[-1]["time"])
    assert times[0] == pytest.approx(times[1], rel=1e-12) == pytest.approx(times[2], rel=1e-12)
    with pytest.raises(fx.InputError, match=r"gives shape \(4,\) for .* one number per position"):
        specimen(mesh(comm), supports=HELD_FAR, loads=loads(lambda x: np.ones(4))).run(
            fx.Static(until=fx.Releases(1))
        )


def test_columns_of_one_name(comm: MPI.Comm, caplog: pytest.LogCaptureFixture) -> None:
    ways = [fx.Monitor("pin_top", (0.0, 1.0)), fx.Monitor("pin_top", (1.0, 0.0))]
    specimen(mesh(comm), supports=HELD_FAR, loads=[*FORCES, FORCES[0]], monitors=ways)
    assert "2 loads are called 'pin_top'" in caplog.text
    assert "2 monitors are called 'u_pin_top'" in caplog.text
