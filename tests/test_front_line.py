"""Rates along a front as arrays, straight fronts driven by a curve, combined displacements."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import (
    CLAMPED_3D,
    FORCES,
    HELD_FAR,
    STEEL,
    bond,
    interface_of,
    onsets,
    specimen,
    tensor_surface,
)

import fxcrack as fx
from fxcrack.demos.mmb import ARMS, HALF_SPAN
from fxcrack.interface.front import Front
from fxcrack.interface.front_order import ordered_fronts
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.mmb import mmb_2d


def wide(comm: Any = MPI.COMM_WORLD, criterion: Any = None, **options: Any) -> fx.Scene:
    """A short specimen in 3-D, symmetric about its middle."""
    mesh = dcb_3d(comm, length=20.0, height=1.5, width=8.0, dx=1.0, dy=2.0, ny=1)
    return specimen(mesh, a0=8.0, supports=CLAMPED_3D, criterion=criterion, **options)


@pytest.mark.mpi
def test_rates_along_a_front(comm: Any) -> None:
    scene = wide(comm)
    scene.run(fx.Static(until=fx.Releases(1)))
    (line,) = fx.front_lines(scene, "bond")
    # from edge to edge, past the node that was released in the middle
    assert line.x[0].tolist() == pytest.approx([8.0, 0.0, 0.0], abs=1e-12)
    assert line.x[-1].tolist() == pytest.approx([8.0, 0.0, 8.0], abs=1e-12)
    assert line.x[:, 0].max() == pytest.approx(9.0) and not line.closed
    steps = np.linalg.norm(np.diff(line.x, axis=0), axis=1)
    np.testing.assert_allclose(np.diff(line.s), steps, rtol=1e-12)
    assert line.s[0] == 0.0 and steps.max() < 2.3  # neighbours, none left out
    # symmetric in the width; the history holds the largest f
    np.testing.assert_allclose(line.values["GI"], line.values["GI"][::-1], rtol=1e-6)
    last = scene.history.rows[-1]
    assert line.f.max() == pytest.approx(last["f[bond]"], rel=1e-9)
    assert line.values["GI"][line.f.argmax()] == pytest.approx(last["GI[bond]"], rel=1e-6)
    scene.close()


@pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])
def test_order_of_a_closed_front(kind: str) -> None:
    axis = np.linspace(0.0, 6.0, 13)
    surface = tensor_surface(kind, 1, axis, axis)
    is_open = np.linalg.norm(surface.x[:, [0, 2]] - 3.0, axis=1) < 1.7
    front = Front(surface, ~is_open, "test")
    ((nodes, closed),) = ordered_fronts(front, surface.x)
    assert closed
    # every front node once, each beside the next, round the centre once
    assert sorted(nodes) == front.candidates().tolist()
    way = surface.x[nodes][:, [0, 2]] - 3.0
    angle = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    assert abs(angle[-1] - angle[0]) == pytest.approx(2.0 * np.pi, abs=0.5)
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() < 0.75  # 0.5 sqrt(2) at most


def test_two_fronts_and_what_has_none() -> None:
    axis = np.linspace(0.0, 6.0, 13)
    surface = tensor_surface("quadrilateral", 1, axis, np.linspace(0.0, 1.0, 3))
    front = Front(surface, np.abs(surface.x[:, 0] - 3.0) < 1.3, "test")
    found = ordered_fronts(front, surface.x)
    assert [(len(nodes), closed) for nodes, closed in found] == [(3, False), (3, False)]
    flat = specimen(dcb_2d(length=40.0, dx=1.0, ny=2))
    flat.run(fx.Static(until=fx.Releases(1)))
    with pytest.raises(fx.InputError, match="is a line: its front is a point"):
        fx.front_lines(flat, "bond")
    with pytest.raises(fx.InputError, match="bond2"):
        fx.front_lines(flat, "bond2")
    flat.close()


@pytest.mark.mpi
def test_a_curve_drives_a_straight_front(comm: Any) -> None:
    # the reference is the middle of the end: distances to the edges of the front are longer
    criterion = fx.CrackLengthVsTime(
        (0.0, 1.0), (8.0, 12.5), reference="end_upper", direction=(2.0, 0.0, 0.0)
    )
    scene = wide(comm, criterion)
    history = scene.run(fx.Static(until=fx.Time(1.0)))
    rows = onsets(history)
    # a node of the front is passed when the curve reaches it
    at = np.array([r["time"] for r in rows])
    np.testing.assert_allclose([r["a[bond]"] for r in rows], 8.0 + 4.5 * at, rtol=1e-9)
    assert len(rows) == 5
    (line,) = fx.front_lines(scene, "bond")
    assert np.ptp(line.x[:, 0]) < 1e-9
    scene.close()
    with pytest.raises(fx.InputError, match="2 or 3 components, not all zero"):
        fx.CrackLengthVsTime((0.0,), (1.0,), reference="a", direction=(0.0, 0.0))


@pytest.mark.mpi
def test_the_load_point_of_a_lever(comm: Any) -> None:
    lever, span = 42.0, HALF_SPAN
    up, down = lever / span, (lever + span) / span
    middle = fx.Monitor("load", (0.0, -down), "middle")
    scene = fx.Scene(
        mmb_2d(comm, half_span=span, height=1.5, dx=2.0, ny=2),
        materials=ARMS,
        model=fx.PlaneStress(thickness=25.0),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
        ],
        loads=[fx.PointForce("lever_end", (0.0, up)), fx.PointForce("load", (0.0, -down))],
        monitors=[
            fx.Monitor("lever_end", (0.0, up), "end"),
            fx.Monitor("lever_end", (0.0, up), "lever", plus=[middle]),
        ],
        debonds=[fx.Debond(bond(26.0, contact=True), fx.VCCT(GIc=0.1703))],
    )
    history = scene.run(fx.Static(until=fx.CrackLength(interface_of(scene), 28.0), stepping="path"))
    row = history.rows[-1]
    # conjugates of both force patterns: P times the lever's displacement is their work
    both = row["v[lever_end]"] + row["v[load]"]
    assert row["m[lever]"] == pytest.approx(both, rel=1e-9)
    assert row["m[end]"] == pytest.approx(row["v[lever_end]"], rel=1e-9)
    assert row["F[load]"] * row["m[lever]"] / 2.0 == pytest.approx(row["strain_energy"], rel=1e-9)
    scene.close()
    with pytest.raises(fx.InputError, match=r"write plus=\[...\]"):
        fx.Monitor("a", (1.0, 0.0), plus=middle)  # type: ignore[arg-type]


def test_the_last_bond_between_two_tips_leaves_the_crack_length_as_it_is() -> None:
    # open from both ends towards the middle: half of the whole is each tip's
    interface = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: np.abs(x[0] - 12.0) < 2.5,
        name="bond",
    )
    scene = fx.Scene(
        dcb_2d(length=20.0, height=1.5, dx=1.0, ny=2),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=HELD_FAR,
        loads=FORCES,
        debonds=[fx.Debond(interface, fx.VCCT(GIc=0.2))],
    )
    history = scene.run(fx.Static(until=fx.Releases(9), stepping="path"))
    lengths = history["a[bond]"].astype(float)
    assert not scene.solver.fronts[0].bonded.any()
    assert np.diff(lengths).max() <= 1.0 + 1e-9
    scene.close()
