"""Rigid couplings to a reference point and linear equations between displacements."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import STEEL, dcb, grow_to, specimen

import fxcrack as fx
from fxcrack.base.errors import InterfaceError, SolverError
from fxcrack.meshes.beam import two_arms
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.dcb import dcb_2d

LENGTH, HEIGHT, E = 10.0, 1.0, 1000.0
ONCE = fx.Static(until=fx.Time(1.0))


def bar(*, order: int = 2, depth: float | None = None, comm: Any = MPI.COMM_WORLD) -> fx.Mesh:
    """A bar along x from 0 to LENGTH, of the height HEIGHT about y = 0."""

    def make() -> Blocks:
        model = Blocks()
        y = np.array([-0.5, 0.0, 0.5]) * HEIGHT
        axes = [np.linspace(0.0, LENGTH, 6), y]
        if depth is not None:
            axes.append(np.linspace(-0.5, 0.5, 3) * depth)
        block = model.add("bar", axes, "quadrilateral" if depth is None else "hexahedron", order)
        model.group("left", block.part(x=0.0))
        model.group("right", block.part(x=LENGTH))
        model.group("below", block.part(y=-0.5 * HEIGHT))
        model.group("above", block.part(y=0.5 * HEIGHT))
        at = {} if depth is None else {"z": 0.0}
        model.group("origin", block.part(x=0.0, y=0.0, **at))
        model.group("end", block.part(x=LENGTH, y=0.0, **at))
        return model

    return build(comm, "bar", make)


def run(mesh: fx.Mesh, *supports: Any, **options: Any) -> dict[str, Any]:
    """Last row of a step to time 1."""
    model = fx.PlaneStress() if mesh.gdim == 2 else fx.Solid()
    scene = fx.Scene(
        mesh, materials=fx.Isotropic(E, 0.0), model=model, supports=supports, **options
    )
    row = scene.run(ONCE, progress=False).rows[-1]
    scene.close()
    return row


CLAMPED = (fx.Displacement("left", x=0.0), fx.Displacement("origin", y=0.0))


@pytest.mark.mpi
def test_bending_by_a_rotation() -> None:
    """Plane sections of a bar without Poisson's ratio stay plane: M = E I theta / L exactly.

    The deflection at the end is theta L/2. Second-order elements hold that state, so that round-off
    is left: 1e-9.
    """
    end = fx.Coupling("right", (LENGTH, 0.0), rz=0.01, name="block")
    watch = [fx.Monitor("end", (0.0, 1.0), "tip")]
    row = run(bar(), *CLAMPED, end, monitors=watch)
    assert row["R[block.rz]"] == pytest.approx(E * HEIGHT**3 / 12.0 * 0.01 / LENGTH, rel=1e-9)
    assert row["m[tip]"] == pytest.approx(0.01 * LENGTH / 2.0, rel=1e-9)
    # free motions leave no resultant: x and y of the reference carry nothing
    assert abs(row["R[origin.y]"]) < 1e-9 * row["R[block.rz]"]


def test_a_reference_beside_the_body() -> None:
    """A force at a reference that is pulled is that on the body; its lever bends the bar."""
    lever = 2.0
    end = fx.Coupling("right", (LENGTH, lever), x=0.01, name="block")
    row = run(bar(), *CLAMPED, end)
    compliance = LENGTH / E * (1.0 / HEIGHT + lever**2 / (HEIGHT**3 / 12.0))
    assert row["R[block.x]"] == pytest.approx(0.01 / compliance, rel=1e-9)


@pytest.mark.mpi
def test_loads_act_on_the_set_as_a_whole() -> None:
    """A force on one node of a rigid set is a force and a moment on its reference."""
    watch = [fx.Monitor("end", (0.0, 1.0), "tip")]
    force = fx.PointForce("end", (0.0, 2.0))
    row = run(bar(), *CLAMPED, fx.Coupling("right", (3.0, 4.0)), loads=[force], monitors=watch)
    i = HEIGHT**3 / 12.0
    # no shear deflection is in E I; with nu = 0 and kappa = 5/6 of Timoshenko's beam
    beam = 2.0 * LENGTH**3 / (3.0 * E * i)
    shear = 2.0 * LENGTH / (5.0 / 6.0 * 0.5 * E * HEIGHT)
    # both ends hold back warping, which takes a part of the shear deflection (0.6 % of all)
    assert row["m[tip]"] == pytest.approx(beam + shear, rel=5e-3)


def test_three_dimensions() -> None:
    """Torsion by rx, bending about both axes: what the free reference does not hold is free."""
    mesh = bar(depth=2.0, order=2)
    held = (
        fx.Displacement("left", x=0.0),
        fx.Displacement("origin", y=0.0, z=0.0),
        fx.Coupling("left", (0.0, 0.0, 0.0), rx=0.0, components="yz", name="far"),
    )
    end = fx.Coupling("right", (LENGTH, 0.0, 0.0), ry=0.01, name="block")
    row = run(mesh, *held, end)
    stiffness = E * HEIGHT * 2.0**3 / 12.0 / LENGTH
    assert row["R[block.ry]"] == pytest.approx(0.01 * stiffness, rel=1e-8)
    assert abs(row["R[far.rx]"]) < 1e-9 * row["R[block.ry]"]


def test_all_prescribed_is_a_displacement() -> None:
    """A coupling whose motions all are given is the same as a displacement linear in position."""
    shape = {"x": lambda x: 0.002 - 0.01 * x[1], "y": lambda x: 0.01 * (x[0] - LENGTH)}
    one = run(bar(), *CLAMPED, fx.Displacement("right", **shape, name="block"))
    end = fx.Coupling("right", (LENGTH, 0.0), x=0.002, y=0.0, rz=0.01, name="block")
    other = run(bar(), *CLAMPED, end)
    assert other["strain_energy"] == pytest.approx(one["strain_energy"], rel=1e-10)


@pytest.mark.parametrize("solver", ["linear", "newton"])
def test_both_solvers(solver: str) -> None:
    """The nonlinear solver works on the same transformation."""
    end = fx.Coupling("right", (LENGTH, 1.0), y=0.1, name="block")
    row = run(bar(), *CLAMPED, end, solver=solver)
    reference = run(bar(), *CLAMPED, end)
    assert row["R[block.y]"] == pytest.approx(reference["R[block.y]"], rel=1e-9)


@pytest.mark.mpi
def test_components_and_symmetry() -> None:
    """Nodes that supports hold at zero take motions from the set: a half bar on its symmetry plane.

    The left end may only move along y as a whole (no rotation, x held by symmetry), so the bar is
    in uniform tension between rigid plates that do not hinder its contraction.
    """
    plate = fx.Coupling("right", (LENGTH, 0.0), x=0.01, components="x", name="plate")
    turn = fx.Coupling("left", (0.0, 0.0), components="xy", name="root")
    row = run(bar(), fx.Displacement("origin", x=0.0, y=0.0), turn, plate,
              fx.Displacement("end", y=0.0))  # fmt: skip
    assert row["R[plate.x]"] == pytest.approx(E * HEIGHT * 0.01 / LENGTH, rel=1e-9)


@pytest.mark.mpi
@pytest.mark.three
def test_the_mean_motion() -> None:
    """A prescribed mean is reached, and what pulls is spread evenly over the weights.

    Weights 1 : 4 : 1 (Simpson) on the three nodes of each element's face are those of a uniform
    traction on second-order faces: the bar is in uniform tension, and free to contract.
    """

    def simpson(x: Any) -> Any:
        corner = np.abs(np.round(2.0 * x[1] / HEIGHT) - 2.0 * x[1] / HEIGHT) < 1e-9
        return np.where(corner, np.where(np.abs(x[1]) < 1e-9, 2.0, 1.0), 4.0)

    end = fx.Coupling("right", (LENGTH, 0.0), x=0.01, rz=0.0, mean=True, weight=simpson)
    row = run(bar(), *CLAMPED, end, monitors=[fx.Monitor("end", (1.0, 0.0), "pull")])
    assert row["R[right.x]"] == pytest.approx(E * HEIGHT * 0.01 / LENGTH, rel=1e-9)
    assert row["m[pull]"] == pytest.approx(0.01, rel=1e-9)
    turned = fx.Coupling("right", (LENGTH, 0.0), rz=0.01, mean=True, weight=simpson)
    assert run(bar(), *CLAMPED, turned)["R[right.rz]"] == pytest.approx(
        E * HEIGHT**3 / 12.0 * 0.01 / LENGTH, rel=0.02
    )
    line = fx.Coupling("end", (LENGTH, 0.0), rz=0.0, mean=True)
    with pytest.raises(fx.InputError, match="no mean motion rz"):
        run(bar(), *CLAMPED, line)


@pytest.mark.mpi
def test_an_equation_with_a_side() -> None:
    """The side of an equation is a prescribed drift between faces, with its force."""
    drift = fx.Equation((("right", "x", 1.0), ("left", "x", -1.0)), value=0.1, name="drift")
    row = run(bar(), fx.Displacement("origin", x=0.0, y=0.0), drift,
              fx.Coupling("left", (0.0, 0.0), x=0.0, rz=0.0, components="x"))  # fmt: skip
    assert row["R[drift.value]"] == pytest.approx(E * HEIGHT * 0.1 / LENGTH, rel=1e-9)


@pytest.mark.mpi
def test_equations_between_faces() -> None:
    """Periodic faces with a drift: u(above) - u(below) = u(end drift) gives uniform strain."""
    supports = (
        fx.Displacement("left", x=0.0),
        fx.Displacement("origin", y=0.0),
        fx.Displacement("right", x=0.1),
        fx.Equation((("above", "y", 1.0), ("below", "y", 1.0)), name="antisymmetric"),
        fx.Equation((("above", "x", 1.0), ("below", "x", -1.0)), name="alike"),
    )
    row = run(bar(), *supports)
    assert row["R[right.x]"] == pytest.approx(E * HEIGHT * 0.1 / LENGTH, rel=1e-9)


def test_an_equation_with_one_node() -> None:
    """All nodes of a face follow one node, which a force pulls: the face stays plane."""
    rest = fx.Equation((("above", "y", 2.0), ("below", "y", 2.0)))
    row = run(
        bar(),
        fx.Displacement("left", x=0.0), fx.Displacement("origin", y=0.0), rest,
        fx.Coupling("right", (LENGTH, 0.0), rz=0.0, components="x"),
        loads=[fx.PointForce("end", (3.0, 0.0))],
        monitors=[fx.Monitor("right", (1.0, 0.0), "pull")],
    )  # fmt: skip
    assert row["m[pull]"] == pytest.approx(3.0 * LENGTH / (E * HEIGHT), rel=1e-9)


# -- cracks ----------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.three
def test_crack_between_blocks() -> None:
    """A DCB opened by blocks that may turn grows like one pulled at its pins.

    Blocks on the end faces, hinged at their middle: with arms of 30 by 1.5 the loads of onset
    differ by what a stiff end section changes, far below 1 %; the ranks agree to round-off.
    """
    pins = dcb(MPI.COMM_WORLD, dx=1.0, ny=2)
    loads = grow_to(pins, 33.0)
    blocks = specimen(
        dcb_2d(MPI.COMM_WORLD, dx=1.0, ny=2),
        supports=[
            fx.Coupling("end_upper", (0.0, 1.5), x=0.0, y=1.0, name="pin_top"),
            fx.Coupling("end_lower", (0.0, -1.5), x=0.0, y=-1.0, name="pin_bottom"),
        ],
    )
    found = grow_to(blocks, 33.0)
    assert found.reason == loads.reason
    a, b = (
        np.array([r["R[pin_top.y]"] for r in h if r["event"] in ("onset", "unstable")], float)
        for h in (found, loads)
    )
    assert a == pytest.approx(b, rel=1e-2)
    assert abs(a - b).max() > 0.0
    work = float(np.abs(found["external_work"]).max())
    assert float(np.abs(found["balance"]).max()) < 1e-9 * work
    pins.close()
    blocks.close()


def ended(comm: Any = MPI.COMM_WORLD) -> fx.Mesh:
    """The bench problem, coarse, with both arms in one group "far"."""

    def make() -> Blocks:
        model, upper, lower = two_arms(np.linspace(0.0, 100.0, 51), 1.5, 2, cell="quadrilateral",
                                       order=1)  # fmt: skip
        model.group("far", upper.part(x=100.0), lower.part(x=100.0))
        model.group("pin_top", upper.part(x=0.0, y=1.5))
        model.group("pin_bottom", lower.part(x=0.0, y=-1.5))
        return model

    return build(comm, "ended", make)


@pytest.mark.mpi
@pytest.mark.three
def test_bonded_end_in_one_rigid_set() -> None:
    """Both faces of a bond in one rigid set: it carries nothing there.

    The far end of the bench problem held by its reference, against a clamp by supports: the same
    to 1e-9; a coupling of one arm alone would tear a bond that cannot open.
    """
    pins = [fx.Displacement("pin_top", y=1.0), fx.Displacement("pin_bottom", y=-1.0)]
    clamped = specimen(ended(), supports=[*pins, fx.Displacement("far", x=0.0, y=0.0)])
    rigid = fx.Coupling("far", (100.0, 0.0), x=0.0, y=0.0, rz=0.0)
    coupled = clamped.rebuilt(supports=[*pins, rigid])
    a, b = (
        [float(r["R[pin_top.y]"]) for r in grow_to(s, 34.0) if r["event"] in ("onset", "unstable")]
        for s in (clamped, coupled)
    )
    assert len(a) > 1 and b == pytest.approx(a, rel=1e-9)
    one = clamped.rebuilt(supports=[*pins, fx.Coupling("far_upper", (100.0, 0.0), x=0.0, y=0.0)])
    with pytest.raises(InterfaceError, match="otherwise than its master nodes"):
        grow_to(one, 34.0)
    for scene in (clamped, coupled, one):
        scene.close()


# -- what is refused -------------------------------------------------------------------------------


def test_free_references_are_named() -> None:
    """A bar that hangs on one hinge turns about it."""
    hinge = fx.Coupling("left", (0.0, 0.0), x=0.0, y=0.0)
    with pytest.raises(SolverError, match="free to turn"):
        run(bar(), hinge)
    bar_ends = (hinge, fx.Coupling("right", (LENGTH, 0.0), y=0.0))
    assert abs(run(bar(), *bar_ends)["R[left.y]"]) < 1e-12


@pytest.mark.parametrize(
    "supports, words",
    [
        ([fx.Displacement("right", x=0.1), fx.Coupling("right", (1.0, 0.0))], "moves it as well"),
        ([fx.Displacement("right", x=0.0), fx.Coupling("right", (1.0, 0.0), y=0.1)], "moves it"),
        ([fx.Coupling("right", (1.0, 0.0)), fx.Coupling("end", (1.0, 0.0))], "only one of them"),
        ([fx.Coupling("right", (1.0, 0.0, 0.0))], "3 coordinates in 2 dimensions"),
        ([fx.Coupling("right", (1.0, 0.0), rx=0.0)], "no motion rx"),
        ([fx.Coupling("right", (1.0, 0.0), components="z")], "no component"),
        (
            [fx.Coupling("right", (1.0, 0.0), x=0.0), fx.Coupling("right", (1.0, 0.0), x=0.1)],
            "prescribed twice",
        ),
        ([fx.Equation((("right", "x", 1.0), ("above", "x", 1.0)))], "as many as the first"),
        ([fx.Equation((("right", "z", 1.0), ("end", "x", 1.0)))], "no axis z"),
        (
            [
                fx.Displacement("right", x=0.1),
                fx.Equation((("right", "x", 1.0), ("end", "x", 1.0))),
            ],
            "prescribe all displacements",
        ),
        (
            [
                fx.Equation((("above", "x", 1.0), ("below", "x", 1.0))),
                fx.Equation((("below", "x", 1.0), ("above", "x", 2.0))),
            ],
            "in a circle",
        ),
        (
            [fx.Equation((("end", "x", 1.0), ("end", "x", -1.0)), value=1.0)],
            r"Equation\('end'\): its terms cancel",
        ),
    ],
)  # fmt: skip
@pytest.mark.mpi
def test_contradictions(supports: list[Any], words: str) -> None:
    with pytest.raises(fx.InputError, match=words):
        fx.Scene(bar(order=1), materials=STEEL, model=fx.PlaneStress(), supports=supports)


@pytest.mark.parametrize(
    "make",
    [
        lambda: fx.Coupling("a", (1.0,)),
        lambda: fx.Coupling("a", (1.0, 2.0), x="b"),  # type: ignore[arg-type]
        lambda: fx.Coupling("a", (1.0, 2.0), components="xq"),
        lambda: fx.Coupling("a", (1.0, 2.0), x=0.0, mean=True, weight=0.0),
        lambda: fx.Coupling("a", (1.0, 2.0), x=0.0, mean=True, weight=-1.0),
        lambda: fx.Equation((("a", "x", 1.0),)),
        lambda: fx.Equation((("a", "x", 0.0), ("b", "x", 1.0))),
        lambda: fx.Equation((("a", "q", 1.0), ("b", "x", 1.0))),
    ],
)
def test_arguments(make: Any) -> None:
    with pytest.raises(fx.InputError):
        make()


@pytest.mark.mpi
def test_large_rotations_are_said(caplog: pytest.LogCaptureFixture) -> None:
    """With finite strain a reference that turns far gives the angle."""
    end = fx.Coupling("right", (LENGTH, 0.0), rz=0.2, name="block")
    mesh = bar(order=1)
    scene = fx.Scene(
        mesh, materials=fx.Isotropic(E, 0.0), model=fx.PlaneStress(), supports=[*CLAMPED, end],
        effects=[fx.FiniteStrain()],
    )  # fmt: skip
    scene.run(fx.Static(until=fx.Time(0.1)), progress=False)
    assert "has turned" not in caplog.text
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    if MPI.COMM_WORLD.rank == 0:
        assert "Coupling('block') has turned by 0.2 radians" in caplog.text
    scene.close()
