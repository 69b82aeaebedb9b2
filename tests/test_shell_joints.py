"""Kinks and T joints of shells: frames, boxes, and a stringer whose foot comes off."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from scipy.integrate import solve_ivp
from scipy.optimize import root

import fxcrack as fx
from fxcrack.meshes.sheets import Sheet, sheets

Array = npt.NDArray[np.float64]

E, LENGTH, WIDTH = 70e3, 20.0, 1.0
ELEMENTS = {"Q1": ("quadrilateral", 1), "T1": ("triangle", 1), "Q2": ("quadrilateral", 2)}


def frame(
    comm: MPI.Intracomm,
    n: int,
    kind: str = "Q1",
    *,
    angle: float = 90.0,
    branch: bool = False,
    thickness: float = 1.0,
    width: float = WIDTH,
    nu: float = 0.0,
    **more: Any,
) -> fx.Scene:
    """A strip along x and another that goes on from its end, turned upwards by an angle."""
    cell, order = ELEMENTS[kind]
    s, across = np.linspace(0.0, LENGTH, n + 1), np.linspace(0.0, width, 2)
    c, q = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    parts = [
        Sheet("foot", s, across),
        Sheet("web", s, across, surface=lambda a, b: (LENGTH + c * a, b, q * a)),
    ]
    if branch:
        parts.append(Sheet("branch", s, across, surface=lambda a, b: (LENGTH + a, b, 0.0 * a)))
    given: dict[str, Any] = {
        "supports": [fx.Clamp("foot_a0")],
        "monitors": [
            fx.Monitor("web_a1", (1, 0, 0), name="x"),
            fx.Monitor("web_a1", (0, 0, 1), name="z"),
        ],
    }
    return fx.Scene(
        sheets(parts, comm, cell=cell, order=order, joined=True),
        model=fx.Shell(),
        materials=fx.Section(fx.Isotropic(E, nu), thickness=thickness, axis=(0, 1, 0)),
        **(given | more),
    )


def solved(scene: fx.Scene) -> fx.History:
    return scene.run(fx.Static(until=fx.Time(1.0)), progress=False)


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize(
    ("kind", "n", "branch"),
    [("Q1", 5, False), ("Q1", 10, True), ("T1", 10, False), ("Q2", 5, True)],
)
def test_l_frame(comm: MPI.Intracomm, kind: str, n: int, branch: bool) -> None:
    """Tip of the upright pushed sideways, over the theory of frames with shear and stretching.

    The error of n cells is that of bending, 1/(4 n^2) of the deflection at most.
    """
    force = 1e-3
    scene = frame(comm, n, kind, branch=branch, loads=[fx.Traction("web_a1", (force, 0, 0))])
    inertia, shear = 1.0 / 12.0, 5.0 / 6.0 * E / 2.0
    bending = (1.0 / 3.0 + 1.0) * LENGTH**3 / (E * inertia)
    exact = force * (bending + LENGTH / shear + LENGTH / E)
    assert solved(scene)["m[x]"][-1] / exact == pytest.approx(1.0, abs=0.25 / n**2 + 1e-5)


@pytest.mark.mpi
@pytest.mark.parametrize("angle", [50.0, 90.0, 140.0])
def test_rigid_motion(comm: MPI.Intracomm, angle: float) -> None:
    """The end of one strip turned about any axis takes the other along without strain."""
    turn = np.array([1e-3, -2e-3, 3e-3])
    x0 = np.array([0.0, 0.0, 0.0])

    def moved(x: Array) -> Array:
        return np.asarray(np.cross(turn, (x.T - x0)).T)

    held = fx.Displacement(
        "foot_a0", lambda x: moved(x)[0], lambda x: moved(x)[1], lambda x: moved(x)[2]
    )
    scene = frame(
        comm, 3, angle=angle,
        supports=[held, fx.Rotation("foot_a0", x=turn[0], y=turn[1], z=turn[2])],
    )  # fmt: skip
    history = solved(scene)
    q = scene.continuum.layout.by_node(fx.displacement_function(scene).x.array)
    x = scene.continuum.positions()
    # round-off of displacements of 0.1, and of energies beside E t area (1e-3)^2 = 1.4
    assert np.abs(q[:, :3] - moved(x.T).T).max(initial=0.0) < 1e-8
    assert abs(history["strain_energy"][-1]) < 1e-9


def test_box_corner(comm: MPI.Intracomm) -> None:
    """Three panels that meet in one node: two follow the third; a rigid turn strains nothing."""
    s = np.linspace(0.0, 4.0, 4)
    mesh = sheets(
        [
            Sheet("floor", s, s),
            Sheet("left", s, s, surface=lambda a, b: (0.0 * a, a, b)),
            Sheet("back", s, s, surface=lambda a, b: (a, 0.0 * a, b)),
        ],
        comm,
        joined=True,
    )
    corner, counts = np.unique(mesh.joints[:, 1], return_counts=True)
    assert len(corner) == 10
    assert sorted(counts)[-2:] == [2, 3]
    turn = (1e-3, -2e-3, 3e-3)
    scene = fx.Scene(
        mesh,
        model=fx.Shell(),
        materials={
            name: fx.Section(fx.Isotropic(E, 0.3), thickness=0.1, axis=axis)
            for name, axis in (("floor", (1, 0, 0)), ("left", (0, 1, 0)), ("back", (1, 0, 0)))
        },
        supports=[
            fx.Displacement(
                "floor_a1",
                x=lambda x: turn[1] * x[2] - turn[2] * x[1],
                y=lambda x: turn[2] * x[0] - turn[0] * x[2],
                z=lambda x: turn[0] * x[1] - turn[1] * x[0],
            ),
            fx.Rotation("floor_a1", x=turn[0], y=turn[1], z=turn[2]),
        ],
    )
    assert abs(solved(scene)["strain_energy"][-1]) < 1e-9


def _frame_of_bars(force: float, stiffness: float) -> Array:
    """Tip of the upright of an inextensible L frame under a dead force along x, large rotation.

    EI theta' = moment of the force about the point, integrated from the clamp with the unknown
    position of the tip.
    """

    def ends(tip: Array) -> Array:
        def slope(_: float, y: Array) -> list[float]:
            return [np.cos(y[2]), np.sin(y[2]), -force * (tip[1] - y[1]) / stiffness]

        y = np.zeros(3)
        for turn in (0.0, np.pi / 2.0):
            y = y + np.array([0.0, 0.0, turn])
            y = solve_ivp(slope, (0.0, LENGTH), y, rtol=1e-10, atol=1e-12).y[:, -1]
        return np.asarray(y[:2] - tip)

    found = root(ends, np.array([LENGTH, LENGTH]), tol=1e-10)
    assert found.success
    return np.asarray(found.x - LENGTH)


@pytest.mark.slow
def test_l_frame_of_large_rotation(comm: MPI.Intracomm) -> None:
    """The corner turns by 40 degrees and keeps its angle; reference: bars that bend only."""
    thickness = 0.2
    stiffness = E * thickness**3 / 12.0
    force = 0.8 * stiffness / LENGTH**2
    scene = frame(
        comm, 8, thickness=thickness,
        loads=[fx.Traction("web_a1", (force, 0, 0))], effects=[fx.FiniteStrain()],
    )  # fmt: skip
    history = solved(scene)
    wanted = _frame_of_bars(force, stiffness)
    found = np.array([history["m[x]"][-1], history["m[z]"][-1]])
    # 1/(4 n^2) of the deflection by the mesh, (t/L)^2 by shear and stretching
    assert np.linalg.norm(found - wanted) < 5e-3 * np.linalg.norm(wanted)
    assert np.linalg.norm(wanted) > 0.5 * LENGTH


@pytest.mark.mpi
def test_symmetry_plane_across_a_joint(comm: MPI.Intracomm) -> None:
    """Half the width of a frame with nu = 0.3 between planes of symmetry is the whole of it."""
    pull = [fx.Traction("web_a1", (1e-3, 0.0, 0.0))]
    found = []
    for parts in (1, 2):
        width = 4.0 / parts
        held: list[Any] = [fx.Clamp("foot_a0")]
        for edge in ("b0", "b1"):
            held += [fx.Symmetry(f"{name}_{edge}", "y") for name in ("foot", "web")]
        scene = frame(comm, 4, width=width, nu=0.3, supports=held, loads=pull)
        found.append(solved(scene)["m[x]"][-1])
    assert found[0] == pytest.approx(found[1], rel=1e-9)


@pytest.mark.mpi
@pytest.mark.three
def test_stringer_pulled_off(comm: MPI.Intracomm) -> None:
    """The foot of a T is bonded to a thick skin but for its middle, and its web is pulled.

    The open foot is a beam of length 2 a clamped at both ends with the force F in its middle,
    G = F^2 a^2 / (32 b EI); its roots turn, which adds 2 e/a at most, e = 0.64 h by shear.
    """
    a, half, force, h = 15.0, 25.0, 2.0, 0.5
    s, b = np.linspace(-half, half, 51), np.linspace(0.0, 2.0, 2)
    up = np.linspace(0.0, 3.0, 3)
    z = 5.0 + h / 2.0
    mesh = sheets(
        [
            Sheet("skin", s, b),
            Sheet("foot", s, b, surface=lambda p, q: (p, q, z + 0.0 * p)),
            Sheet("web", up, b, surface=lambda p, q: (0.0 * p, q, z + p)),
        ],
        comm,
        joined=True,
    )
    alloy = fx.Isotropic(E, 0.0)
    bond = fx.Interface(
        slave=fx.Face("foot", "bottom"), master=fx.Face("skin", "top"),
        bonded=lambda x: abs(x[0]) >= a - 1e-6, name="bond",
    )  # fmt: skip
    scene = fx.Scene(
        mesh,
        model=fx.Shell(),
        materials={
            "skin": fx.Section(alloy, thickness=10.0),
            "foot": fx.Section(alloy, thickness=h),
            "web": fx.Section(alloy, thickness=h, axis=(0, 1, 0)),
        },
        supports=[fx.Clamp("skin_a0"), fx.Clamp("skin_a1")],
        loads=[fx.PointForce("web_a1", (0.0, 0.0, force))],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1e9))],
    )
    history = solved(scene)
    clamped = force**2 * a**2 / (32.0 * 2.0 * E * 2.0 * h**3 / 12.0)
    found = (history["GI[bond]"][-1] + history["GII[bond]"][-1]) / clamped
    assert 1.0 < found < 1.0 + 2.0 * 0.64 * h / a + 0.02


def test_what_joints_refuse(comm: MPI.Intracomm) -> None:
    with pytest.raises(fx.InputError, match="shells meet at some of its edges"):
        solved(frame(comm, 2, loads=[fx.Traction("web_a0", (1e-3, 0, 0))]))
    with pytest.raises(fx.InputError, match="lie on each other"):
        frame(comm, 2, angle=175.0)
    with pytest.raises(fx.InputError, match="mesh of the order of the unknowns"):
        frame(comm, 2, order=2)
