"""What a run says of its limits, each once and only where it matters."""

from __future__ import annotations

import logging
import re
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from specimens import FORCES, HELD_FAR, PINS, STEEL, grow_to, specimen

import fxcrack as fx
from fxcrack.continuum.cell_gradients import CellGradients
from fxcrack.continuum.linear_range import error_of_triangles, largest_rotation
from fxcrack.error_estimate import Estimate
from fxcrack.meshes.dcb import dcb_2d, dcb_3d


def plate(comm: MPI.Comm, length: float = 60.0) -> fx.Mesh:
    return dcb_2d(comm, length=length, dx=2.0, ny=1)


def test_unstable_growth_is_told_from_onsets_at_one() -> None:
    """Under forces f grows as a^2: every node after the first goes at the same load, at f > 1."""
    scene = specimen(plate(MPI.COMM_SELF), supports=HELD_FAR, loads=FORCES)
    history = grow_to(scene, 40.0)
    f = [float(r["f[bond]"]) for r in history.rows_of("onset", "unstable")]
    assert len(f) == 5
    assert f[0] == pytest.approx(1.0, abs=1e-6)
    assert min(f[1:]) > 1.1  # (32/30)^2 = 1.14, and a little less as arms shear, too
    # and the names of the rows say which is which
    assert [r["event"] for r in history.rows_of("onset", "unstable")] == [
        "onset",
        *4 * ["unstable"],
    ]
    said = history.describe()
    assert f"unstable growth: f is above 1 before 4 of 5 releases, up to {max(f):.3g}" in said
    scene.close()
    stable = specimen(plate(MPI.COMM_SELF))
    assert "unstable" not in grow_to(stable, 36.0).describe()
    stable.close()


def test_arms_on_their_last_bonded_node() -> None:
    scene = specimen(dcb_2d(MPI.COMM_SELF, length=20.0, dx=1.0, ny=2), a0=15.0)
    reason = scene.run(fx.Static(until=fx.Releases(99))).reason
    assert reason.startswith("total separation but for 1 bonded node, about which the bodies turn")
    scene.close()


def test_a_tie_needs_no_tip(caplog: pytest.LogCaptureFixture) -> None:
    whole = fx.Interface("upper_face", "lower_face", name="tie")
    parts = {"materials": STEEL, "model": fx.PlaneStrain(), "supports": PINS}
    tied = fx.Scene(plate(MPI.COMM_SELF), bonds=[whole], **parts)
    tied.run(fx.Static(until=fx.Time(1e-3)))
    assert not caplog.text
    fx.Scene(plate(MPI.COMM_SELF), debonds=[fx.Debond(whole, fx.VCCT(GIc=0.2))], **parts).close()
    assert "has no crack tip" in caplog.text
    tied.close()


def test_a_clamped_end(caplog: pytest.LogCaptureFixture) -> None:
    """Information, once."""
    caplog.set_level(logging.INFO, logger="fxcrack")
    scene = specimen(plate(MPI.COMM_SELF), supports=[*PINS, *HELD_FAR])
    for time in (1e-3, 2e-3):
        scene.run(fx.Static(until=fx.Time(time)))
    (said,) = (r for r in caplog.records if "supports hold both faces" in r.getMessage())
    assert said.levelname == "INFO"
    scene.close()


@pytest.mark.parametrize(("modulus", "toughness"), [(70e9, 0.2), (70e9, 200.0), (70e3, 0.2)])
def test_moduli_in_pa_beside_millimetres(
    caplog: pytest.LogCaptureFixture, modulus: float, toughness: float
) -> None:
    """Told once, with the strain; a toughness in J/m^2 beside Pa and mm is not told apart."""
    scene = specimen(
        plate(MPI.COMM_SELF, 40.0),
        materials=fx.Isotropic(modulus, 0.3),
        criterion=fx.VCCT(GIc=toughness),
    )
    for time in (1e-3, 2e-3):
        scene.run(fx.Static(until=fx.Time(time)), progress=False)
    words = [m for m in caplog.messages if "one system of units" in m]
    assert len(words) == (modulus > 1e9 and toughness < 1.0)
    assert all("strain by about 1e-06" in m for m in words)
    scene.close()


def test_a_tool_as_stiff_as_one_likes(caplog: pytest.LogCaptureFixture) -> None:
    """The softest body strains at growth: a nearly rigid one beside it is no other unit."""
    soft, tool = fx.Isotropic(70e3, 0.3), fx.Isotropic(70e9, 0.3)
    scene = specimen(plate(MPI.COMM_SELF, 40.0), materials={"upper": soft, "lower": tool})
    scene.run(fx.Static(until=fx.Time(1e-3)), progress=False)
    assert "system of units" not in caplog.text
    scene.close()


@pytest.mark.parametrize(
    ("order", "difference", "simplices", "words"),
    [
        (1, 0.008, False, "order=2 on this mesh, or in first order elements of at most about 0.62"),
        (1, 0.04, False, "order=2 with elements of at most about 0.25, or in first order"),
        (2, 0.04, False, "elements of at most about 0.25 at the crack.* [(]keep order=2[)]"),
        (2, 0.04, True, "0.25 at the crack.* first-order simplices, which are far too stiff"),
        (2, 0.04, None, "0.25 at the crack.* in first order they would have to be far smaller"),
    ],
)
def test_accuracy_recommends_order_and_size(
    order: int, difference: float, simplices: bool | None, words: str
) -> None:
    """1 % is asked for at size 1: errors fall with the size, in second order to half as much."""
    error = difference * (2.0 if order == 1 else 1.0)
    estimate = Estimate(error, error, 0.0, None, order, 1.0, difference, "bond", bool(simplices))
    if simplices is None:
        estimate = replace(estimate, domain=0.02)
        assert "from which G differs by 2 % at the same state" in str(estimate)
    assert re.search(words, estimate.remedy(0.01))


def opened(
    scene: fx.Scene, times: tuple[float, ...], caplog: pytest.LogCaptureFixture
) -> list[str]:
    """What is warned of at the ends of steps without growth."""
    for time in times:
        scene.run(fx.Static(until=fx.Time(time)), grow=[], progress=False)
    return [m for m in caplog.messages if "rotations as small" in m or "triangles jump" in m]


@pytest.mark.mpi
def test_rotations_that_are_not_small(
    comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture
) -> None:
    """A slender arm under an opening d turns by 3 d/(2 a) at its end, 30 long here."""
    scene = specimen(plate(comm, 40.0), order=2)
    assert not opened(scene, (3.0,), caplog)  # 0.15
    messages = opened(scene, (6.0, 6.5), caplog)  # 0.3
    # on several ranks it would take a factorisation of its own
    assert len(messages) == (comm.size == 1)
    u = scene.solver.displacement()
    cells = CellGradients.of(scene.continuum, u.array_r.copy())
    u.destroy()
    # the middle of the last cell, 2 long, has not all of it; the arms are held elastically
    assert largest_rotation(scene.continuum, cells) == pytest.approx(0.325, rel=0.05)
    for message in messages:
        assert "up to 0.29 radians" in message and "about 4." in message
        assert "FiniteStrain()" in message
    scene.close()


@pytest.mark.mpi
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_rotation_is_measured_exactly(comm: MPI.Intracomm, dimension: int) -> None:
    mesh = plate(comm) if dimension == 2 else dcb_3d(comm, length=6.0, dx=2.0, dy=10.0, ny=1)
    scene = specimen(mesh, a0=2.0, order=2)
    x = scene.continuum.positions()[: scene.continuum.n_local // dimension]
    turn = np.array([0.0, 0.0, 0.3] if dimension == 2 else [0.1, 0.2, 0.2])
    u = (np.cross(turn, x) + 0.01 * x)[:, :dimension]
    cells = CellGradients.of(scene.continuum, u.ravel())
    # an angle vector (0.1, 0.2, 0.2) is 0.3 long; stretching by 1 % does not turn
    assert largest_rotation(scene.continuum, cells) == pytest.approx(0.3, rel=1e-12)
    scene.close()


@pytest.mark.mpi
@pytest.mark.parametrize("ny", [2, 4])
def test_triangles_in_bending(
    comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture, ny: int
) -> None:
    """The part of the energy that is error is what second order on the same mesh does without."""
    mesh = dcb_2d(comm, length=60.0, dx=1.0, ny=ny, cell="triangle")
    stiff, soft = specimen(mesh), specimen(mesh, order=2)
    messages = opened(stiff, (0.5, 1.0), caplog)
    # on several ranks it would take a factorisation of its own
    assert len(messages) == (comm.size == 1)
    u = stiff.solver.displacement()
    part = error_of_triangles(stiff.continuum, CellGradients.of(stiff.continuum, u.array_r.copy()))
    u.destroy()
    caplog.clear()
    assert not opened(soft, (1.0,), caplog)
    energy = [float(s.history.rows[-1]["strain_energy"]) for s in (stiff, soft)]
    # the estimate is one: it is within a few percent of the whole energy at this error
    assert part == pytest.approx(1.0 - energy[1] / energy[0], abs=0.05)
    for message in messages:
        assert f"and {part:.2g} of the strain energy" in message and "order=2" in message
    stiff.close()
    soft.close()


def test_triangles_without_bending(caplog: pytest.LogCaptureFixture) -> None:
    """A strip between two rails: 1.5 % too stiff, which is not worth a word."""
    rails = [fx.Displacement("top", x=0.0, y=1.0), fx.Displacement("bottom", x=0.0, y=-1.0)]
    mesh = dcb_2d(MPI.COMM_SELF, length=20.0, dx=0.5, ny=4, cell="triangle")
    scene = specimen(mesh, a0=8.0, supports=rails)
    assert not opened(scene, (1e-2,), caplog)
    scene.close()


def test_rows_above_one_are_found_by_name(caplog: pytest.LogCaptureFixture) -> None:
    """What asks for rows at f = 1 is told where a row above it came first."""
    history = fx.History(MPI.COMM_SELF)
    for event, a, f, u, load in (
        ("start", 30.0, 0.0, 0.0, 0.0),
        ("onset", 30.0, 1.0, 1.0, 8.0),
        ("unstable", 31.0, 1.2, 1.0, 6.0),
        ("onset", 33.0, 1.0, 2.0, 5.0),
        ("unstable", 35.0, 1.1, 2.0, 4.0),
    ):
        row = {"time": u, "event": event, "a[bond]": a, "f[bond]": f, "u[p]": u, "R[p]": load}
        history.append(row)
    assert [r["a[bond]"] for r in history.rows_of("onset", "unstable")] == [30.0, 31.0, 33.0, 35.0]
    assert history.at("a[bond]", 31.0, event=("onset", "unstable"))["event"] == "unstable"
    assert history.at("a[bond]", 30.0, event="onset")["f[bond]"] == 1.0
    assert not caplog.text
    assert history.at("a[bond]", 31.0, event="onset")["a[bond]"] == 33.0
    assert "reaches 31 in unstable growth, at f above 1 (time 1)" in caplog.text
    with pytest.raises(fx.InputError, match=r"'unstable' .*reaches it: give event="):
        history.at("a[bond]", 35.0, event="onset")
    # from the last row of one opening to the next onset, as before rows had two names
    assert history.load_at(1.5) == pytest.approx(0.5 * (6.0 + 5.0))
    assert history.load_at(1.5, event="onset") == pytest.approx(0.5 * (8.0 + 5.0))
