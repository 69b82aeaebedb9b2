"""Opening control: the load of a specimen whose crack mouth, slip or deflection grows steadily."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import FORCES, HELD_FAR, STEEL, assert_same, bond, column, largest_imbalance, onsets

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.demos.enf import ARMS, BEAM, G_IIC
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.meshes.enf import enf_2d

GIC, HALF_SPAN = 0.2, 50.0
STRIP = STEEL.E / (1.0 - STEEL.nu**2)  # plane strain
ARM = CorrectedBeam(E=STRIP, E22=STRIP, G=0.5 * STEEL.E / (1.0 + STEEL.nu), h=1.5, b=1.0)
PINS = tuple(fx.Monitor(p, (0.0, 1.0), name=p) for p in ("pin_top", "pin_bottom"))
MOUTH = {"stepping": "opening", "opening": ("pin_top", "pin_bottom")}


def short_dcb(comm: MPI.Intracomm, release: Any = None, gic: float = GIC, **scene: Any) -> fx.Scene:
    """A double cantilever beam under forces, held at its far end."""
    debond = fx.Debond(
        bond(10.0, **scene.pop("faces", {})), fx.VCCT(GIc=gic), release or fx.StepRelease()
    )
    parts: dict[str, Any] = {"loads": FORCES, "monitors": PINS} | scene
    return fx.Scene(
        dcb_2d(comm, length=30.0, dx=0.5, ny=2, order=2),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=HELD_FAR,
        debonds=[debond],
        **parts,
    )


def flexure(a0: float, until: float, *, by_force: bool, **step: Any) -> fx.History:
    """End-notched flexure of unidirectional carbon fibre, grown to a crack length."""
    interface = bond(a0, contact=True)
    supports = [
        fx.Displacement("support_left", y=0.0),
        fx.Displacement("support_right", x=0.0, y=0.0),
    ]
    if not by_force:
        supports.append(fx.Displacement("load", y=-1.0))
    scene = fx.Scene(
        enf_2d(MPI.COMM_SELF, half_span=HALF_SPAN, height=BEAM.h, dx=0.5, ny=2, order=2),
        materials=ARMS,
        model=fx.PlaneStress(thickness=BEAM.b),
        supports=supports,
        loads=[fx.PointForce("load", (0.0, -1.0))] if by_force else [],
        debonds=[fx.Debond(interface, fx.VCCT(GIc=G_IIC))],
        monitors=[
            fx.Monitor("lower_face", (1.0, 0.0), name="lower"),
            fx.Monitor("upper_face", (1.0, 0.0), name="upper"),
            fx.Monitor("load", (0.0, -1.0), name="deflection"),
        ],
    )
    return scene.run(fx.Static(until=fx.CrackLength(interface, until), **step))


@pytest.mark.mpi
def test_the_mouth_opens_steadily_while_the_load_falls(comm: MPI.Intracomm) -> None:
    scene = short_dcb(comm)
    history = scene.run(fx.Static(until=fx.Releases(6), **MOUTH))
    opening = column(history, "m[pin_top]") - column(history, "m[pin_bottom]")
    # never falls, and stays as nodes let go
    assert (np.diff(opening) > -1e-12 * opening[-1]).all()
    event = history["event"]
    assert opening[event == "release"] == pytest.approx(
        opening[np.isin(event, ["onset", "unstable"])], rel=1e-12
    )
    found = onsets(history)
    a, load = column(found, "a[bond]"), column(found, "F[pin_top]")
    # a is 7 heights: 0.6 % in load, 1.5 % in opening
    assert load == pytest.approx(ARM.dcb_load(a, GIC), rel=0.02)
    assert opening[np.isin(event, ["onset", "unstable"])] == pytest.approx(
        ARM.dcb_opening(a, load), rel=0.02
    )
    assert (np.diff(load) < 0.0).all()
    # each onset is one equilibrium, however it is reached
    traced = short_dcb(comm).run(fx.Static(until=fx.Releases(6), stepping="path"))
    assert load == pytest.approx(column(onsets(traced), "F[pin_top]"), rel=1e-10)
    assert largest_imbalance(history) < 1e-12


@pytest.mark.slow
@pytest.mark.mpi
def test_linear_bodies_on_the_nonlinear_path_open_alike(comm: MPI.Intracomm) -> None:
    one, other = (
        short_dcb(comm, solver=solver).run(fx.Static(until=fx.Releases(3), **MOUTH))
        for solver in (None, "newton")
    )
    assert_same(one, other, 1e-8, R=1e-8)  # the forces hold each other: no reaction


@pytest.mark.slow
@pytest.mark.mpi
def test_arms_that_turn_far_open_steadily_too(comm: MPI.Intracomm) -> None:
    """A tough bond: the ends turn by some 20 degrees before the first node lets go."""

    def run(**step: Any) -> tuple[fx.Scene, fx.History]:
        scene = short_dcb(comm, effects=[fx.FiniteStrain()], gic=60.0)
        return scene, scene.run(fx.Static(until=fx.Releases(3), maximum=15.0, **step))

    _, history = run(**MOUTH)
    opening = column(history, "m[pin_top]") - column(history, "m[pin_bottom]")
    assert (np.diff(opening) > -1e-9 * opening[-1]).all()
    event = history["event"]
    assert opening[event == "release"] == pytest.approx(
        opening[np.isin(event, ["onset", "unstable"])], rel=2e-9
    )
    assert opening[-1] > 4.0  # arms of 10
    _, traced = run(stepping="path")
    for name in ("F[pin_top]", "m[pin_top]", "a[bond]"):  # each onset is one equilibrium
        found, expected = (column(onsets(h), name) for h in (history, traced))
        assert found == pytest.approx(expected, rel=1e-7)
    assert largest_imbalance(history) < 1e-4


@pytest.mark.slow
def test_the_slip_of_flexure_grows_while_its_deflection_snaps_back() -> None:
    history = flexure(17.0, 38.0, by_force=True, stepping="opening", opening=("lower", "upper"))
    found = onsets(history)
    a, load, deflection = (column(found, c) for c in ("a[bond]", "F[load]", "m[deflection]"))
    slip = column(found, "m[lower]") - column(found, "m[upper]")
    assert (np.diff(slip) > 0.0).all()
    # beams misjudge the root by a quarter of h: 3 % at a = 17, 1.4 % at 37, on finer meshes too
    assert load == pytest.approx(BEAM.enf_load(a, G_IIC), rel=0.035)
    assert deflection == pytest.approx(BEAM.enf_deflection(a, load, HALF_SPAN), rel=0.015)  # 1 %
    # it falls until the effective length is 3^(-1/3) = 0.69 of the half span
    turn = a[np.argmin(deflection)] + 0.42 * BEAM.chi * BEAM.h
    assert turn == pytest.approx(3.0 ** (-1.0 / 3.0) * HALF_SPAN, abs=2.0)
    traced = flexure(17.0, 38.0, by_force=True, stepping="path")
    assert load == pytest.approx(column(onsets(traced), "F[load]"), rel=1e-9)
    assert largest_imbalance(history) < 1e-10


@pytest.mark.slow
def test_a_controlled_deflection_is_a_prescribed_one() -> None:
    # below 0.69 L growth at a given deflection is unstable and arrests beyond
    controlled = flexure(25.0, 46.0, by_force=True, stepping="opening", opening="deflection")
    prescribed = flexure(25.0, 46.0, by_force=False)
    deflection = column(onsets(controlled), "m[deflection]")
    assert np.count_nonzero(np.diff(deflection) < 1e-9) >= 5
    assert deflection == pytest.approx(column(onsets(prescribed), "m[deflection]"), rel=1e-9)
    load = -column(onsets(prescribed), "R[load.y]")
    assert column(onsets(controlled), "F[load]") == pytest.approx(load, rel=1e-9)


@pytest.mark.parametrize(
    ("scene", "step", "words"),
    [
        ({}, {"opening": "pin_topp"}, "did you mean 'pin_top'"),
        ({}, {"opening": "pin_bottom"}, "in its positive direction"),
        ({"release": fx.ProgressiveRelease()}, {}, "is released progressively"),
        ({"faces": {"contact": True, "friction": 0.2}}, {}, "leave friction out"),
    ],
)
def test_what_opening_control_cannot_do_is_refused(
    scene: dict[str, Any], step: dict[str, Any], words: str
) -> None:
    with pytest.raises(fx.InputError, match=words):
        short_dcb(MPI.COMM_SELF, **scene).run(fx.Static(until=fx.Releases(2), **(MOUTH | step)))


@pytest.mark.parametrize(
    "options",
    [{"stepping": "opening"}, {"opening": "top"}, {"stepping": "opening", "opening": ("a",) * 3}],
)
def test_an_opening_belongs_to_opening_control(options: dict[str, Any]) -> None:
    with pytest.raises(fx.InputError, match="opening"):
        fx.Static(until=fx.Releases(1), **options)
