"""Rigid planes, cylinders and spheres as masters; half models beside whole ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from specimens import assert_same

import fxcrack as fx
from fxcrack.base.errors import InputError, InterfaceError
from fxcrack.mesh import Mesh
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.dcb import dcb_2d, dcb_3d, half_dcb
from fxcrack.meshes.penny import penny
from fxcrack.meshes.sheets import Sheet, sheets
from fxcrack.meshes.spacing import growing
from fxcrack.output.fields import displacement_function
from fxcrack.output.interface_fields import interface_fields

Array = npt.NDArray[np.float64]

SAME = 1e-10  # relative; both models are the same but for round-off, measured at 1e-14 to 1e-11
ENERGIES = ("strain_energy", "external_work", "released_energy")
COMPARED = ("R[pin_top.y", "u[pin_top", "a[", "area[", "f[", "G", "time", *ENERGIES)
PLANE = fx.RigidPlane((0.0, 0.0), (0.0, 1.0))
STEEL = fx.Isotropic(70e3, 0.3)


def body(
    comm: MPI.Intracomm,
    *axes: npt.ArrayLike,
    cell: str | None = None,
    order: int = 1,
) -> Mesh:
    """A block with its faces named by axis and end, x0 and x1 and so on; cells ``body``."""

    def make() -> Blocks:
        model = Blocks()
        shape = cell or {2: "quadrilateral", 3: "hexahedron"}[len(axes)]
        block = model.add("body", axes, shape, order)
        for name, x in zip("xyz", axes, strict=False):
            ends = np.asarray(x, dtype=float)[[0, -1]]
            for i, value in enumerate(ends.tolist()):
                model.group(f"{name}{i}", block.part(**{name: value}))
        return model

    return build(comm, "body", make)


def dcb(comm: MPI.Intracomm, *, half: bool, gdim: int = 2, order: int = 1, **options: Any) -> Any:
    """A DCB opened by displacements, whole or its upper half on the plane of symmetry."""
    size: dict[str, Any] = {"length": 24.0, "height": 1.5, "dx": 1.0, "ny": 2, "order": order}
    across = {"width": 4.0, "dy": 2.0} if gdim == 3 else {}
    make = half_dcb if half else (dcb_2d if gdim == 2 else dcb_3d)
    pins = {"x": 0.0} | ({"z": 0.0} if gdim == 3 else {})
    supports = [fx.Displacement("pin_top", y=1.0, **pins)]
    if not half:
        supports.append(fx.Displacement("pin_bottom", y=-1.0, **pins))
    bond = fx.Interface(
        slave="upper_face",
        master=PLANE if half else "lower_face",
        bonded=lambda x: x[0] >= 10.0 - 1e-6,
        contact=options.pop("contact", True),
        symmetry=half,
        name="bond",
    )
    criterion = options.pop("criterion", fx.VCCT(GIc=0.2))
    release = options.pop("release", fx.StepRelease())
    scene = fx.Scene(
        make(comm, **size, **across),
        materials=STEEL,
        model=fx.PlaneStrain(thickness=25.0) if gdim == 2 else fx.Solid(),
        supports=supports,
        debonds=[fx.Debond(bond, criterion, release)],
        **options,
    )
    return scene, bond


def assert_half_of(half: fx.History, whole: fx.History) -> None:
    """Loads, openings, rates and lengths alike; energies half those of the whole body."""
    assert [row["event"] for row in half] == [row["event"] for row in whole]
    compared = 0
    for name in whole[-1]:
        if name.startswith(
            ("R[pin_top.y", "u[pin_top", "a[", "area[", "f[", "G", "KI[", "time", *ENERGIES)
        ):
            a, b = (np.array([row.get(name, 0.0) for row in h]) for h in (half, whole))
            factor = 2.0 if name in ENERGIES else 1.0
            scale = max(np.abs(b).max(), 0.1)  # modes that are absent, and lengths not yet grown
            assert np.abs(factor * a - b).max() <= SAME * scale, name
            compared += 1
    assert compared >= 8
    largest = np.abs(half["strain_energy"]).max()
    assert np.abs(half["balance"]).max() < 1e-5 * largest


WAYS = {
    "2d": {},
    "progressive": {"order": 2, "release": fx.ProgressiveRelease()},
    "closure": {"criterion": fx.VCCT(GIc=0.2, method="closure")},
    # the whole body has no contact here: at finite strain its pairs of nodes slide on each other's
    # facets, which moves the opening by 6e-6; on the plane nothing slides
    "finite": {"effects": [fx.FiniteStrain()], "contact": False},
    "3d": {"gdim": 3},
    "domain": {"criterion": fx.VCCT(GIc=0.2, method="domain"), "order": 2},
    "domain, 3d": {"criterion": fx.VCCT(GIc=0.2, method="domain"), "gdim": 3},
    "opening": {"criterion": fx.CrackOpening(0.02, distance=1.0)},
    "stress": {"criterion": fx.CriticalStress(30.0, distance=0.5)},
}


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.quick("2d", "progressive", "finite", "3d")
@pytest.mark.parametrize("way", WAYS)
def test_half_of_a_dcb_is_the_whole(comm: MPI.Intracomm, way: str) -> None:
    found = []
    for half in (True, False):
        scene, bond = dcb(comm, half=half, **WAYS[way])
        found.append(scene.run(fx.Static(until=fx.CrackLength(bond, 12.0))))
    assert_half_of(*found)


STEPS = {
    "path": (fx.Static, {"stepping": "path"}, {}),
    "increment": (fx.Static, {"stepping": "increment", "initial": 0.05, "maximum": 0.05}, {}),
    "ramp": (
        fx.Static,
        {"stepping": "increment", "initial": 0.05, "maximum": 0.05},
        {"release": fx.RampRelease(increments=3)},
    ),
    "viscous": (
        fx.Static,
        {"stepping": "increment", "initial": 0.02, "maximum": 0.02},
        {"criterion": fx.EnhancedVCCT(GIc=0.2, GIc_p=0.1, viscosity=0.01)},
    ),
    "enhanced": (
        fx.Static,
        {},
        {"criterion": fx.EnhancedVCCT(GIc=0.2, GIc_p=0.3), "release": fx.ProgressiveRelease()},
    ),
    "path finite": (
        fx.Static,
        {"stepping": "path"},
        {"effects": [fx.FiniteStrain()], "contact": False, "release": fx.ProgressiveRelease()},
    ),
    "cycles": (
        fx.Cycles,
        {"maximum": 0.08, "ratio": 0.1, "n_max": 1e6},
        {"criterion": fx.Fatigue(GIc=0.2, paris=fx.Paris(0.0, -1.0, 1e-2, 2.0))},
    ),
    "cycles, partial": (
        fx.Cycles,
        {"maximum": 0.08, "ratio": 0.1, "n_max": 1e6},
        {"criterion": fx.Fatigue(GIc=0.2, paris=fx.Paris(0.0, -1.0, 1e-2, 2.0), partial=True)},
    ),
}


@pytest.mark.mpi
@pytest.mark.quick("path", "cycles", "cycles, partial")
@pytest.mark.parametrize("way", STEPS)
def test_half_of_a_dcb_in_every_step(comm: MPI.Intracomm, way: str) -> None:
    kind, asked, options = STEPS[way]
    found = []
    for half in (True, False):
        scene, bond = dcb(comm, half=half, **options)
        until = fx.Releases(2) if kind is fx.Cycles else fx.CrackLength(bond, 12.0)
        found.append(scene.run(kind(until=until, **asked)))
    assert_half_of(*found)


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.quick("False")
@pytest.mark.parametrize("finite", [False, True])
def test_half_of_a_penny_crack(comm: MPI.Intracomm, finite: bool) -> None:
    """Axisymmetric, pulled at its ends; SAME holds as the meshes are mirror images."""
    size = {"a": 1.0, "radius": 4.0, "half_height": 4.0, "dr": 0.25}
    found = []
    for half in (True, False):
        if half:
            inner = growing(1.0, 0.0, 0.25, growth=1.15, even_length=0.5)
            beyond = growing(1.0, 4.0, 0.25, growth=1.15, even_length=0.5)
            y = growing(0.0, 4.0, 0.25, growth=1.15, even_length=0.5)
            mesh = body(comm, np.concatenate((inner[:-1], beyond)), y)
            names = {"slave": "y0", "master": fx.RigidPlane((0.0, 0.0), (0.0, 2.0))}
            supports = [fx.Displacement("x0", x=0.0), fx.Displacement("y1", y=0.1, name="top")]
        else:
            mesh = penny(comm, **size)
            names = {"slave": "upper_face", "master": "lower_face"}
            supports = [
                fx.Displacement("axis_upper", x=0.0),
                fx.Displacement("axis_lower", x=0.0),
                fx.Displacement("top", y=0.1),
                fx.Displacement("bottom", y=-0.1),
            ]
        bond = fx.Interface(
            **names, bonded=lambda x: x[0] >= 1.0 - 1e-9, symmetry=half, name="crack"
        )
        scene = fx.Scene(
            mesh,
            materials=fx.Isotropic(1000.0, 0.3),
            model=fx.Axisymmetric(),
            supports=supports,
            debonds=[fx.Debond(bond, fx.VCCT(GIc=0.1))],
            effects=[fx.FiniteStrain()] if finite else [],
        )
        found.append(scene.run(fx.Static(until=fx.Releases(2))))
    a, b = found
    assert [row["event"] for row in a] == [row["event"] for row in b]
    for name, factor in {"R[top.y]": 1.0, "GI[crack]": 1.0, "area[crack]": 1.0, "time": 1.0,
                         "released_energy": 2.0, "strain_energy": 2.0}.items():  # fmt: skip
        assert factor * a[name] == pytest.approx(b[name], rel=SAME, abs=SAME), name


@pytest.mark.slow
@pytest.mark.mpi
def test_half_on_second_order_tetrahedra(comm: MPI.Intracomm) -> None:
    """Hierarchical jumps on a rigid plane: the blocks of both halves are mirror images."""
    found = []
    for half in (True, False):
        size: dict[str, Any] = {"length": 12.0, "height": 1.5, "dx": 1.0, "ny": 2, "order": 2}
        make = half_dcb if half else dcb_3d
        mesh = make(comm, **size, width=2.0, dy=1.0, cell="tetrahedron")
        master = PLANE if half else "lower_face"
        bond = fx.Interface("upper_face", master, bonded=lambda x: x[0] >= 6.0 - 1e-6,
                            symmetry=half, contact=True, name="bond")  # fmt: skip
        supports = [fx.Displacement("pin_top", x=0.0, y=0.5, z=0.0)]
        supports += [] if half else [fx.Displacement("pin_bottom", x=0.0, y=-0.5, z=0.0)]
        scene = fx.Scene(mesh, materials=STEEL, model=fx.Solid(), supports=supports,
                         debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2))])  # fmt: skip
        found.append(scene.run(fx.Static(until=fx.Releases(4))))
    assert_half_of(*found)


def test_without_symmetry_the_energy_is_that_of_the_half(comm: MPI.Intracomm) -> None:
    """Half the toughness on a rigid support is the whole toughness of two halves."""
    scene, bond = dcb(comm, half=True)
    known = scene.run(fx.Static(until=fx.CrackLength(bond, 12.0)))
    other, _ = dcb(comm, half=True)
    alone = fx.Interface(
        "upper_face", PLANE, bonded=lambda x: x[0] >= 10.0 - 1e-6, normal_only=True, contact=True,
        name="bond",
    )  # fmt: skip
    given = other.input
    scene = fx.Scene(
        given.mesh,
        materials=given.materials,
        model=given.model,
        supports=given.supports,
        debonds=[fx.Debond(alone, fx.VCCT(GIc=0.1))],
    )
    found = scene.run(fx.Static(until=fx.CrackLength(alone, 12.0)))
    assert found["R[pin_top.y]"] == pytest.approx(known["R[pin_top.y]"], rel=SAME)
    assert 2.0 * found["GI[bond]"] == pytest.approx(known["GI[bond]"], rel=SAME)
    assert found["released_energy"] == pytest.approx(known["released_energy"], rel=SAME, abs=SAME)


@pytest.mark.mpi
@pytest.mark.quick("False")
@pytest.mark.parametrize("finite", [False, True])
def test_half_of_a_dcb_of_shells(comm: MPI.Intracomm, finite: bool) -> None:
    found = []
    x, y = np.linspace(0.0, 20.0, 11), np.linspace(0.0, 4.0, 3)
    for half in (True, False):
        arms = [Sheet("upper", x, y, lambda a, b: (a, b, 0.75 + 0.0 * a))]
        supports = [fx.Displacement("upper_a0", x=0.0, y=0.0, z=1.0)]
        if not half:
            arms.append(Sheet("lower", x, y, lambda a, b: (a, b, -0.75 + 0.0 * a)))
            supports.append(fx.Displacement("lower_a0", x=0.0, y=0.0, z=-1.0))
        bond = fx.Interface(
            slave=fx.Face("upper", "bottom"),
            master=fx.RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
            if half
            else fx.Face("lower", "top"),
            bonded=lambda x: x[0] >= 10.0 - 1e-6,
            symmetry=half,
            name="bond",
        )
        scene = fx.Scene(
            sheets(arms, comm, name="arms"),
            materials=fx.Section(STEEL, thickness=1.5),
            model=fx.Shell(),
            supports=supports,
            debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2), fx.ProgressiveRelease())],
            effects=[fx.FiniteStrain()] if finite else [],
        )
        found.append(scene.run(fx.Static(until=fx.CrackLength(bond, 12.0))))
    a, b = found
    assert [row["event"] for row in a] == [row["event"] for row in b]
    for name in ("time", "R[upper_a0.z]", "GI[bond]"):
        scale = np.abs(b[name]).max()
        assert a[name] == pytest.approx(b[name], rel=SAME, abs=SAME * scale), name


def pulled(comm: MPI.Intracomm, *planes: str, left: float, contact: bool = False) -> fx.Scene:
    """A block with a crack of half length 1 on y = 0, pulled at its top; planes are held."""
    bond = fx.Interface(
        "y0", PLANE, bonded=lambda x: np.abs(x[0]) >= 1.0 - 1e-9, symmetry=True, name="crack",
        contact=contact,
    )  # fmt: skip
    supports = [fx.Displacement(name, x=0.0) for name in planes]
    n = round((2.0 - left) / 0.25)
    return fx.Scene(
        body(comm, np.linspace(left, 2.0, n + 1), np.linspace(0.0, 2.0, 5)),
        materials=STEEL,
        model=fx.PlaneStrain(thickness=1.0),
        supports=[fx.Displacement("y1", x=0.0, y=0.01), *supports],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.1))],
    )


def test_quarter_of_a_plate(comm: MPI.Intracomm) -> None:
    half, quarter = pulled(comm, left=-2.0), pulled(comm, "x0", left=0.0)
    a, b = (scene.run(fx.Static(until=fx.Releases(n))) for scene, n in ((half, 2), (quarter, 1)))
    assert b["time"][1] == pytest.approx(a["time"][1], rel=SAME)
    assert 2.0 * b["R[y1.y]"][1] == pytest.approx(a["R[y1.y]"][1], rel=SAME)
    assert b["GI[crack]"][1] == pytest.approx(a["GI[crack]"][1], rel=SAME)


def test_two_planes_that_share_an_edge(comm: MPI.Intracomm) -> None:
    """The second plane is bonded where the first is open; with contact there its node has two."""
    other = fx.Interface("x0", fx.RigidPlane((0.0, 0.0), (1.0, 0.0)), symmetry=True, name="other")
    known = pulled(comm, "x0", left=0.0).run(fx.Static(until=fx.Releases(1)))
    for contact in (False, True):
        given = pulled(comm, left=0.0, contact=contact).input
        scene = fx.Scene(
            given.mesh,
            materials=given.materials,
            model=given.model,
            supports=given.supports,
            debonds=given.debonds,
            bonds=[other],
        )
        if contact:
            with pytest.raises(InterfaceError, match=r"Displacement\(group, x=0.0\) in place"):
                scene.run(fx.Static(until=fx.Releases(1)))
        else:
            found = scene.run(fx.Static(until=fx.Releases(1)))
            assert found["R[y1.y]"] == pytest.approx(known["R[y1.y]"], rel=SAME, abs=SAME)
            assert found["GI[crack]"] == pytest.approx(known["GI[crack]"], rel=SAME)


def test_the_whole_boundary_may_be_the_slave(comm: MPI.Intracomm) -> None:
    """Nodes on its edge have an oblique mean normal; what does not lie on the plane has no part."""
    given = pulled(comm, "x0", left=0.0)
    known = given.run(fx.Static(until=fx.Releases(1)))
    mesh = given.input.mesh.joined("outside", ["y0", "x0", "x1", "y1"])
    bond = fx.Interface(
        "outside", PLANE, bonded=lambda x: (x[0] >= 1.0 - 1e-9) & (x[1] < 1e-9), symmetry=True,
        name="crack",
    )  # fmt: skip
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(thickness=1.0),
        supports=given.input.supports,
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.1))],
    )
    found = scene.run(fx.Static(until=fx.Releases(1)))
    for name in ("time", "R[y1.y]", "GI[crack]", "area[crack]"):
        assert found[name] == pytest.approx(known[name], rel=SAME, abs=SAME), name


# -- contact and friction ------------------------------------------------------------------


def everywhere_open(x: Array) -> npt.NDArray[np.bool_]:
    """No node is bonded."""
    return np.zeros(x.shape[1], dtype=bool)


@pytest.mark.mpi
@pytest.mark.three
def test_tube_on_a_rigid_shaft(comm: MPI.Intracomm) -> None:
    """Lame: u = A r + B/r with u(a) = 0 and sigma_r(b) = -p, on elements of second order.

    sigma_r = E/(1 + nu) (A/(1 - 2 nu) - B/r^2). Contact holds u(a) exactly; ten elements leave an
    error of u(b) of the order (h/a)^4 = 1e-4.
    """
    a, b, e, nu, p = 1.0, 2.0, 1000.0, 0.3, 1.0
    mesh = body(comm, np.linspace(a, b, 11), np.linspace(0.0, 0.5, 3), order=2)
    shaft = fx.Interface(
        "x0", fx.RigidCylinder((0.0, 0.0), (0.0, 1.0), a), bonded=everywhere_open, contact=True,
        friction=0.0, name="shaft",
    )  # fmt: skip
    scene = fx.Scene(
        mesh,
        materials=fx.Isotropic(e, nu),
        model=fx.Axisymmetric(),
        supports=[fx.Displacement("y0", y=0.0), fx.Displacement("y1", y=0.0)],
        loads=[fx.Pressure("x1", p)],
        bonds=[shaft],
        monitors=[fx.Monitor("x1", (1.0, 0.0), name="outer")],
    )
    row = scene.run(fx.Static(until=fx.Time(1.0)))[-1]
    # A a + B/a = 0
    unit = e / (1.0 + nu) * (1.0 / (1.0 - 2.0 * nu) + a**2 / b**2)
    slope = -p / unit
    assert row["m[outer]"] == pytest.approx(slope * (b - a**2 / b), rel=1e-3)
    assert row["balance"] == pytest.approx(0.0, abs=1e-10 * row["strain_energy"] + 1e-14)


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize(("pushed", "slides"), [(1e-5, False), (0.05, True)])
def test_block_on_a_rigid_floor(comm: MPI.Intracomm, pushed: float, slides: bool) -> None:
    """Pressed down it sticks under a small push; under a large one all nodes slide, T = mu N."""
    times = (0.0, 1.0, 2.0)
    floor = fx.Interface(
        "y0", PLANE, bonded=everywhere_open, contact=True, friction=0.3, name="floor"
    )
    scene = fx.Scene(
        body(comm, np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3)),
        materials=fx.Isotropic(1000.0, 0.0),
        model=fx.PlaneStrain(thickness=1.0),
        supports=[
            fx.Displacement("y1", y=-4e-3, amplitude=fx.Amplitude(times, (0.0, 1.0, 1.0))),
            fx.Displacement(
                "y1",
                x=pushed,
                name="push",
                amplitude=fx.Amplitude(times, (0.0, 0.0, 1.0)),
            ),
        ],
        bonds=[floor],
    )
    step = fx.Static(until=fx.Time(2.0), stepping="increment", initial=0.25, maximum=0.25)
    rows = scene.run(step).rows
    pressed = next(row for row in rows if row["time"] == 1.0)
    assert pressed["R[y1.y]"] == pytest.approx(-8.0, rel=1e-9)  # E eps times the area, nu = 0
    normal, shear = abs(rows[-1]["R[y1.y]"]), abs(rows[-1]["R[push.x]"])
    if slides:
        assert shear == pytest.approx(0.3 * normal, rel=1e-9)
        assert rows[-1]["friction_energy"] > 0.05
    else:
        assert 0.0 < shear < 0.3 * normal


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.quick("False")
@pytest.mark.parametrize("finite", [False, True])
def test_block_on_a_rigid_sphere(comm: MPI.Intracomm, finite: bool) -> None:
    """Nodes do not pass the sphere, and contact balances the load along its normals."""
    x = np.linspace(-1.0, 1.0, 5)
    radius = 4.0
    sphere = fx.RigidSphere((0.0, -radius, 0.0), radius)
    floor = fx.Interface("y0", sphere, bonded=everywhere_open, contact=True, gap="keep",
                         tolerance=1.0, name="ball")  # fmt: skip
    scene = fx.Scene(
        body(comm, x, np.linspace(0.0, 1.0, 3), x),
        materials=fx.Isotropic(1000.0, 0.3),
        model=fx.Solid(),
        supports=[fx.Displacement("y1", x=0.0, y=-0.2, z=0.0)],
        bonds=[floor],
        effects=[fx.FiniteStrain()] if finite else [],
    )
    scene.run(fx.Static(until=fx.Time(1.0), stepping="increment", initial=0.25, maximum=0.25))
    pair = scene.pairs[0]
    fields = interface_fields(scene, displacement_function(scene))[0]
    x_now = pair.surface.x + fields.displacement
    distance, normals = sphere.measure(x_now)
    pressed = -np.einsum("nc,nc->n", fields.traction, normals) > 1e-6
    assert 1 <= pressed.sum() < pair.surface.n_nodes
    # normals of the start leave the curvature of the way along it: s^2/(2 R); those of the present
    # position are renewed at 0.01 rad, an error of the gap below R 0.01^2
    slack = 1e-4 * radius if finite else 0.02
    assert distance.min() > -slack
    assert np.abs(distance[pressed]).max() < slack


# -- words ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("master", "options", "words"),
    [
        (fx.RigidPlane((0.0, 0.1), (0.0, 1.0)), {}, "do not lie on the rigid plane.*by 0.1"),
        (fx.RigidPlane((0.0, 0.0), (0.0, -1.0)), {}, "wrong side.*reverse its normal"),
        (fx.RigidPlane((0.0, 1.0), (0.0, 1.0)), {"slave": "y1"}, "wrong side"),
        (fx.RigidPlane((0.0, 0.0), (0.0, 1.0, 0.5)), {}, "z component"),
        (fx.RigidCylinder((0.0, -9.0), (1.0, 0.0, 0.0), 9.0), {}, r"must be \(0, 0, 1\)"),
        (fx.RigidSphere((0.0, -9.0), 9.0), {}, "none in a plane"),
        (fx.RigidCylinder((0.0, 9.0), (0.0, 0.0, 1.0), 9.0), {"tolerance": 1.0}, "inside=True"),
    ],
)  # fmt: skip
def test_a_surface_that_does_not_fit_is_refused(
    comm: MPI.Intracomm, master: Any, options: dict[str, Any], words: str
) -> None:
    mesh = body(comm, np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3))
    given = {"slave": "y0", "master": master, "bonded": lambda x: x[0] >= 1.0} | options
    with pytest.raises(InterfaceError, match=words):
        fx.Scene(
            mesh,
            materials=STEEL,
            model=fx.PlaneStrain(thickness=1.0),
            debonds=[fx.Debond(fx.Interface(**given), fx.VCCT(GIc=1.0))],
        )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"master": "b", "symmetry": True}, "needs a plane of symmetry"),
        ({"master": fx.RigidSphere((0, 0, 0), 1.0), "symmetry": True}, "needs a plane"),
        ({"master": PLANE, "symmetry": True, "friction": 0.3, "contact": True}, "friction is not"),
        ({"master": PLANE, "pairing": "surface-to-surface"}, "no facets to average"),
        ({"master": PLANE, "stiffness": "auto"}, "not available on a rigid"),
        ({"master": PLANE, "symmetry": "yes"}, "must be True or False"),
    ],
)
def test_contradictions_of_an_interface(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        fx.Interface("a", **options)


@pytest.mark.parametrize("curvature", [None, 1e-3])
def test_no_curvature_across_a_plane_of_symmetry(curvature: float | None) -> None:
    """A half that is free to bend about its own middle is not half of the whole."""
    bond = fx.Interface("upper_face", PLANE, lambda x: x[0] >= 10.0, symmetry=True)
    made = {"materials": STEEL, "debonds": [fx.Debond(bond, fx.VCCT(GIc=1.0))]}
    mesh = half_dcb(MPI.COMM_SELF, length=24.0, height=1.5, dx=2.0, ny=1)
    with pytest.raises(InterfaceError, match="does not allow curvature_y"):
        fx.Scene(mesh, model=fx.GeneralisedPlaneStrain(curvature_y=curvature), **made)
    fx.Scene(mesh, model=fx.GeneralisedPlaneStrain(curvature_x=curvature), **made).close()


def test_criteria_that_a_rigid_master_does_not_have() -> None:
    half = fx.Interface("a", PLANE, symmetry=True)
    with pytest.raises(InputError, match="one side is a rigid surface"):
        fx.Debond(fx.Interface("a", PLANE), fx.VCCT(GIc=1.0, method="domain"))
    with pytest.raises(InputError, match="mode_length"):
        fx.Debond(half, fx.CriticalStress(1.0, distance=1.0), watch=[fx.VCCT(1.0, mode_length=1.0)])
    with pytest.raises(InputError, match="says symmetry=True already"):
        fx.Debond(half, fx.CrackOpening(1.0, distance=1.0, symmetry=True))
    assert half.normal_only
    with pytest.raises(InputError, match="no direction"):
        fx.RigidPlane((0.0, 0.0), (0.0, 0.0))
    with pytest.raises(InputError, match=r"must be 3 numbers"):
        fx.RigidPlane((0.0, 0.0, 0.0, 0.0), (0.0, 1.0))


def test_a_support_that_moves_a_bonded_node_is_refused(comm: MPI.Intracomm) -> None:
    scene, bond = dcb(comm, half=True)
    given = scene.input
    with pytest.raises(InterfaceError, match="moves the slave node"):
        fx.Scene(
            given.mesh,
            materials=given.materials,
            model=given.model,
            supports=[*given.supports, fx.Displacement("far_upper", y=0.1)],
            debonds=given.debonds,
        ).run(fx.Static(until=fx.CrackLength(bond, 12.0)))


# -- restart -------------------------------------------------------------------------------


def test_rings_of_a_half_with_loads_on_its_faces() -> None:
    """Tractions in the ring, and those the crack is about to open: as in the whole."""
    found = []
    for half in (True, False):
        faces = ("upper_face",) if half else ("upper_face", "lower_face")
        scene, _ = dcb(MPI.COMM_SELF, half=half, criterion=fx.VCCT(GIc=0.2, method="domain"))
        blown = scene.rebuilt(
            supports=[fx.Displacement("far_upper", x=0.0, y=0.0)]
            + ([] if half else [fx.Displacement("far_lower", x=0.0, y=0.0)]),
            loads=[fx.Pressure(f, lambda x: np.where(x[0] < 10.0, 1.0, 0.0)) for f in faces],
        )
        rows = blown.run(fx.Static(until=fx.Releases(1)))
        found.append([rows.at("a[bond]", 10.0, event="onset")[c] for c in ("time", "KI[bond]")])
    assert found[0] == pytest.approx(found[1], rel=SAME)


@pytest.mark.mpi
@pytest.mark.quick("False")
@pytest.mark.parametrize("finite", [False, True])
def test_restart_of_a_half_model(comm: MPI.Intracomm, shared_path: Path, finite: bool) -> None:
    options = {"effects": [fx.FiniteStrain()]} if finite else {}
    kept = fx.Checkpoint(shared_path / "half.npz", every=1)

    class Stopped(Exception):
        """Ends the run."""

    left = [4]

    def stop(event: str, row: Any) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise Stopped

    (scene, bond), (first, at), (again, same) = (dcb(comm, half=True, **options) for _ in range(3))
    whole = scene.run(fx.Static(until=fx.CrackLength(bond, 13.0)))
    with pytest.raises(Stopped):
        first.run(fx.Static(until=fx.CrackLength(at, 13.0)), checkpoint=kept, observers=[stop])
    step = fx.Static(until=fx.CrackLength(same, 13.0))
    found = again.run(step, checkpoint=kept, restart=True)
    assert_same(whole, found, 1e-9)  # increments of Newton's method begin anew
