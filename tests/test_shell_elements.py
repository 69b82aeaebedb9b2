"""Shells: patch tests, thin strips, and the classical locking tests, on structured meshes.

Reference deflections: Scordelis-Lo roof 0.3024, pinched cylinder 1.8248e-5, pinched hemisphere with
a hole 0.094 (MacNeal and Harder 1985, and for the last Simo, Fox and Rifai 1989 with 0.0930). Every
value is compared with that of the element on the same mesh, to 0.2 %: a change of the element, not
the mesh's error, is what fails.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.sheets import Sheet, sheets

Array = npt.NDArray[np.float64]

ELEMENTS = {"Q1": ("quadrilateral", 1), "T1": ("triangle", 1), "Q2": ("quadrilateral", 2)}
SAME = 2e-3
ROUND_OFF = 1e-11
"""Of patch tests: solutions are exact but for round-off, times the condition of thin shells."""


def solved(scene: fx.Scene) -> float:
    """Monitor "w" at the load factor 1."""
    return float(scene.run(fx.Static(until=fx.Time(1.0)), progress=False)["m[w]"][-1])


def flat(
    comm: MPI.Intracomm, kind: str, n: Sequence[int], size: Sequence[float], distort: float = 0.0
) -> fx.Mesh:
    cell, order = ELEMENTS[kind]
    axes = [np.linspace(0.0, s, k + 1) for s, k in zip(size, n, strict=True)]
    points = {"middle": (axes[0][n[0] // 2], 0.0)}
    shape = Sheet("plate", *axes, points=points, distort=distort)
    return sheets([shape], comm, cell=cell, order=order)


@pytest.mark.mpi
@pytest.mark.parametrize("case", ["membrane", "bending"])
@pytest.mark.parametrize("kind", ELEMENTS)
def test_constant_strains_and_curvatures_are_exact(
    comm: MPI.Intracomm, kind: str, case: str
) -> None:
    mesh = flat(comm, kind, (4, 4), (10.0, 10.0), 0.25)
    kx, ky, kxy = 1e-3, 5e-4, 3e-4

    def exact(x: Array) -> Array:
        """Displacement and change of the director, shape (6, n)."""
        zero = 0.0 * x[0]
        if case == "membrane":
            u = 1e-3 * np.array([x[0] + 0.5 * x[1], 0.2 * x[0] - 0.4 * x[1]])
            return np.stack([*u, zero, zero, zero, -1e-3 * 0.3 / 0.7 * 0.6 + zero])
        w = 0.5 * (kx * x[0] ** 2 + ky * x[1] ** 2) + kxy * x[0] * x[1]
        return np.stack([zero, zero, w, -kx * x[0] - kxy * x[1], -ky * x[1] - kxy * x[0], zero])

    held: list[fx.Displacement | fx.Rotation] = []
    for edge in ("a0", "a1", "b0", "b1"):
        fields = [lambda x, c=c: exact(x)[c] for c in range(6)]
        held.append(fx.Displacement(f"plate_{edge}", *fields[:3]))
        held.append(fx.Rotation(f"plate_{edge}", x=lambda x: -exact(x)[4], y=fields[3]))
    section = fx.Section(fx.Isotropic(70e3, 0.3), thickness=0.5)
    scene = fx.Scene(mesh, model=fx.Shell(), materials=section, supports=held)
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    q = scene.continuum.layout.by_node(fx.displacement_function(scene).x.array)
    wanted = exact(scene.continuum.positions().T).T
    largest = comm.allreduce(float(np.abs(wanted).max(initial=0.0)), op=MPI.MAX)
    assert np.abs(q - wanted).max(initial=0.0) < ROUND_OFF * largest


@pytest.mark.parametrize("ratio", [10.0, 1000.0])
@pytest.mark.parametrize("kind", ELEMENTS)
def test_strip_does_not_lock(comm: MPI.Intracomm, kind: str, ratio: float) -> None:
    length, width, load, modulus = 100.0, 5.0, 1e-3, 70e3
    height = length / ratio
    mesh = flat(comm, kind, (8 if kind == "Q2" else 16, 1), (length, width))
    scene = fx.Scene(
        mesh,
        model=fx.Shell(),
        materials=fx.Section(fx.Isotropic(modulus, 0.0), thickness=height),
        supports=[fx.Clamp("plate_a0")],
        loads=[fx.Traction("plate_a1", (0.0, 0.0, load / width))],
        monitors=[fx.Monitor("plate_a1", (0, 0, 1), name="w")],
    )
    inertia = width * height**3 / 12.0
    shear = 5.0 / 6.0 * modulus / 2.0 * width * height
    exact = load * length * (length**2 / (3.0 * modulus * inertia) + 1.0 / shear)
    assert solved(scene) / exact == pytest.approx(1.0, abs=1.2e-3)  # 16 elements: 1 - 1/(4 n^2)


def test_strip_turned_by_a_moment(comm: MPI.Intracomm) -> None:
    """Pure bending, by a moment per length and by one at nodes, and the work of the rotation."""
    length, width, height, modulus, moment = 40.0, 4.0, 0.5, 70e3, 3.0
    mesh = flat(comm, "Q1", (8, 2), (length, width))
    section = fx.Section(fx.Isotropic(modulus, 0.0), thickness=height)
    exact = moment * length**2 / (2.0 * modulus * height**3 / 12.0)
    monitors = [fx.Monitor("plate_a1", (0, 0, 1), name="w")]
    common = {"model": fx.Shell(), "materials": section, "monitors": monitors}
    clamp = fx.Clamp("plate_a0")
    edge = fx.Scene(
        mesh, supports=[clamp], loads=[fx.Moment("plate_a1", (0.0, -moment, 0.0))], **common
    )
    assert solved(edge) == pytest.approx(exact, rel=1e-9)
    slope = 2.0 * exact / length
    turned = fx.Scene(mesh, supports=[clamp, fx.Rotation("plate_a1", y=-slope)], **common)
    assert solved(turned) == pytest.approx(exact, rel=1e-9)
    total = turned.history["R[plate_a1.ry]"][-1]
    assert total == pytest.approx(-moment * width, rel=1e-9)
    nodal = fx.Scene(
        mesh,
        supports=[clamp],
        loads=[fx.PointMoment("plate_a1", (0.0, -moment * width, 0.0))],
        **common,
    )
    assert solved(nodal) == pytest.approx(exact, rel=2e-3)  # equal shares are not consistent


def test_web_bends_in_its_plane(comm: MPI.Intracomm) -> None:
    length, height, thickness, modulus = 100.0, 10.0, 0.5, 70e3
    inertia, shear = thickness * height**3 / 12.0, modulus / 2.6 * 5 / 6 * height * thickness
    beam = length**3 / (3.0 * modulus * inertia) + length / shear
    for kind, enhanced, wanted in (
        ("Q1", False, 0.665),
        ("Q1", True, 0.988),
        ("T1", False, 0.206),
        ("Q2", False, 0.998),
    ):
        mesh = flat(comm, kind, (10, 1), (length, height))
        scene = fx.Scene(
            mesh,
            model=fx.Shell(enhanced_membrane=enhanced),
            materials=fx.Section(fx.Isotropic(modulus, 0.3), thickness=thickness),
            supports=[fx.Clamp("plate_a0"), fx.Displacement("plate", z=0.0)],
            loads=[fx.Traction("plate_a1", (0.0, 1.0 / height, 0.0))],
            monitors=[fx.Monitor("plate_a1", (0, 1, 0), name="w")],
        )
        assert solved(scene) / beam == pytest.approx(wanted, abs=2e-3), kind


# -- curved shells ---------------------------------------------------------------------------------


def roof(comm: MPI.Intracomm, kind: str, n: int, enhanced: bool = False) -> float:
    """Deflection of the Scordelis-Lo roof at the middle of its free edge, over 0.3024."""
    radius, length, thickness = 25.0, 50.0, 0.25
    cell, order = ELEMENTS[kind]
    grid = np.linspace(0.0, np.radians(40.0), n + 1), np.linspace(0.0, length / 2, n + 1)
    shape = Sheet("roof", *grid, lambda a, b: (radius * np.sin(a), b, radius * np.cos(a)))
    scene = fx.Scene(
        sheets([shape], comm, cell=cell, order=order),
        model=fx.Shell(enhanced_membrane=enhanced),
        materials=fx.Section(fx.Isotropic(4.32e8, 0.0), thickness=thickness, axis=(0, 1, 0)),
        supports=[
            fx.Displacement("roof_b0", x=0.0, z=0.0),
            fx.Symmetry("roof_b1", "y"),
            fx.Symmetry("roof_a0", "x"),
        ],
        loads=[fx.BodyForce((0.0, 0.0, -90.0 / thickness))],
        monitors=[fx.Monitor("roof_a1b1", (0, 0, -1), name="w")],
    )
    return solved(scene) / 0.3024


def cylinder(comm: MPI.Intracomm, kind: str, n: int) -> float:
    """Deflection under a pinching force on a cylinder with end diaphragms, over 1.8248e-5."""
    radius, length = 300.0, 600.0
    cell, order = ELEMENTS[kind]
    grid = np.linspace(0.0, np.pi / 2, n + 1), np.linspace(0.0, length / 2, n + 1)
    shape = Sheet("pipe", *grid, lambda a, b: (radius * np.sin(a), b, radius * np.cos(a)))
    scene = fx.Scene(
        sheets([shape], comm, cell=cell, order=order),
        model=fx.Shell(),
        materials=fx.Section(fx.Isotropic(3e6, 0.3), thickness=3.0, axis=(0, 1, 0)),
        supports=[
            fx.Displacement("pipe_b0", x=0.0, z=0.0),
            fx.Symmetry("pipe_b1", "y"),
            fx.Symmetry("pipe_a0", "x"),
            fx.Symmetry("pipe_a1", "z"),
        ],
        loads=[fx.PointForce("pipe_a0b1", (0.0, 0.0, -0.25))],
        monitors=[fx.Monitor("pipe_a0b1", (0, 0, -1), name="w")],
    )
    return solved(scene) / 1.8248e-5


def hemisphere(comm: MPI.Intracomm, kind: str, n: int, distort: float = 0.0) -> float:
    """Deflection under pinching forces on a hemisphere with a hole, R/t = 250, over 0.094."""
    radius = 10.0
    cell, order = ELEMENTS[kind]
    grid = np.linspace(0.0, np.pi / 2, n + 1), np.linspace(0.0, np.radians(72.0), n + 1)

    def sphere(a: Array, b: Array) -> tuple[Array, Array, Array]:
        return (
            radius * np.cos(a) * np.cos(b),
            radius * np.sin(a) * np.cos(b),
            radius * np.sin(b),
        )

    scene = fx.Scene(
        sheets([Sheet("ball", *grid, sphere, distort=distort)], comm, cell=cell, order=order),
        model=fx.Shell(),
        materials=fx.Section(fx.Isotropic(6.825e7, 0.3), thickness=0.04, axis=(0, 0, 1)),
        supports=[
            fx.Symmetry("ball_a0", "y"),
            fx.Symmetry("ball_a1", "x"),
            fx.Displacement("ball_a0b0", z=0.0),
        ],
        loads=[
            fx.PointForce("ball_a0b0", (1.0, 0.0, 0.0), name="A"),
            fx.PointForce("ball_a1b0", (0.0, -1.0, 0.0), name="B"),
        ],
        monitors=[fx.Monitor("ball_a0b0", (1, 0, 0), name="w")],
    )
    return solved(scene) / 0.094


ROOF = {"Q1": (0.943, 0.973, 0.989), "T1": (0.646, 0.860, 0.957), "Q2": (1.026, 1.001, 0.998)}
PIPE = {"Q1": (0.740, 0.927, 0.989), "T1": (0.446, 0.797, 0.953), "Q2": (0.852, 0.935, 0.988)}
BALL = {"Q1": (0.995, 0.988, 0.988), "T1": (0.046, 0.340, 0.862), "Q2": (1.000, 0.991, 0.992)}
DISTORTED = {"Q1": (0.618, 0.869, 0.965), "Q2": (0.905, 0.986, 0.988)}


def counts(kind: str, *n: int) -> list[int]:
    return [k // 2 if kind == "Q2" else k for k in n]


@pytest.mark.parametrize("kind", ELEMENTS)
def test_scordelis_lo_roof(comm: MPI.Intracomm, kind: str) -> None:
    found = [roof(comm, kind, n) for n in counts(kind, 4, 8, 16)]
    assert found == pytest.approx(ROOF[kind], abs=SAME)


def test_enhanced_membrane_on_the_roof(comm: MPI.Intracomm) -> None:
    """Simo and Rifai's five terms: as measured with continuum shells, 1.048, 1.005, 0.997."""
    found = [roof(comm, "Q1", n, enhanced=True) for n in (4, 8, 16)]
    assert found == pytest.approx((1.048, 1.005, 0.997), abs=SAME)


@pytest.mark.parametrize("kind", ELEMENTS)
def test_pinched_cylinder(comm: MPI.Intracomm, kind: str) -> None:
    found = [cylinder(comm, kind, n) for n in counts(kind, 8, 16, 32)]
    assert found == pytest.approx(PIPE[kind], abs=SAME)


@pytest.mark.parametrize("kind", ELEMENTS)
def test_pinched_hemisphere(comm: MPI.Intracomm, kind: str) -> None:
    found = [hemisphere(comm, kind, n) for n in counts(kind, 4, 8, 16)]
    assert found == pytest.approx(BALL[kind], abs=SAME)


def test_distorted_hemisphere(comm: MPI.Intracomm) -> None:
    for kind, wanted in DISTORTED.items():
        found = [hemisphere(comm, kind, n, 0.2) for n in counts(kind, 4, 8, 16)]
        assert found == pytest.approx(wanted, abs=SAME), kind


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ELEMENTS)
def test_ranks_agree(comm: MPI.Intracomm, kind: str) -> None:
    n = 4 if kind == "Q2" else 8
    assert hemisphere(comm, kind, n) == pytest.approx(BALL[kind][1], abs=SAME)
    assert roof(comm, kind, n) == pytest.approx(ROOF[kind][1], abs=SAME)


# -- sections --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("angles", "ratio", "wanted"),
    [((0, 90, 0), 10, 0.997), ((0, 90, 0), 100, 0.994), ((0, 90), 100, 0.993)],
)
def test_laminated_strip(
    comm: MPI.Intracomm, angles: tuple[float, ...], ratio: int, wanted: float
) -> None:
    """Cylindrical bending under q = sin(pi x/L) (Pagano 1969), over first-order shear theory."""
    ply = fx.Orthotropic(E=(25e6, 1e6, 1e6), nu=(0.25, 0.25, 0.25), G=(0.5e6, 0.5e6, 0.2e6))
    height = 1.0 / ratio
    laminate = fx.Laminate([fx.Ply(height / len(angles), a) for a in angles], material=ply)
    scene = fx.Scene(
        flat(comm, "Q1", (16, 1), (1.0, 0.05)),
        model=fx.Shell(),
        materials=fx.Section(laminate),
        supports=[
            fx.Displacement("plate_a0", z=0.0),
            fx.Displacement("plate_a1", z=0.0),
            fx.Symmetry("plate", "y"),
            # both ends move alike; the middle stays
            fx.Displacement("plate_a0b0", x=0.0),
        ],
        loads=[fx.Traction(fx.Face("plate", "top"), (0.0, 0.0, lambda x: np.sin(np.pi * x[0])))],
        monitors=[fx.Monitor("middle", (0, 0, 1), name="w")],
    )
    abd = laminate.abd()
    bending = abd[3, 3] - abd[0, 3] ** 2 / abd[0, 0]
    shear = laminate.shear_stiffness()[1, 1]
    exact = 1.0 / (bending * np.pi**4) + 1.0 / (shear * np.pi**2)
    assert solved(scene) / exact == pytest.approx(wanted, abs=SAME)


def test_offset_moves_the_reference_surface(comm: MPI.Intracomm) -> None:
    """A plate whose mesh lies on its bottom bends as one whose mesh lies in its middle."""
    material, thickness = fx.Isotropic(70e3, 0.0), 2.0
    found = []
    for offset in (0.0, 0.5 * thickness):
        scene = fx.Scene(
            flat(comm, "Q1", (16, 1), (50.0, 4.0)),
            model=fx.Shell(),
            materials=fx.Section(material, thickness=thickness, offset=offset),
            supports=[fx.Clamp("plate_a0")],
            loads=[fx.Moment("plate_a1", (0.0, -1.0, 0.0))],
            monitors=[fx.Monitor("plate_a1", (0, 0, 1), name="w")],
        )
        found.append(solved(scene))
    assert found[1] == pytest.approx(found[0], rel=1e-9)
