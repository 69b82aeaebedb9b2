"""The domain integral on specimens and element types beside plates of quadrilaterals.

End-notched flexure under a given force: G_II = 9 P^2 (a + 0.42 chi h)^2/(16 b^2 E' h^3), corrected
beam theory (Wang and Williams 1992; chi = 0.663 in plane strain at nu = 0.3). The converged
solution of the specimen is 0.989 of it. Penny-shaped crack under tension: Sneddon (1946), under
shear: Segedin (1951). Elliptical crack: Irwin (1962). Along an arc: Cotterell and Rice (1980).
"""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from mpi4py import MPI
from scipy.special import ellipe
from specimens import bond, specimen
from test_domain_integral import INFLATED, NU, WIDE, E, domain, plate

import fxcrack as fx
from fxcrack.base import log
from fxcrack.criteria.front_ends import on_planes_of_symmetry
from fxcrack.criteria.front_smoothing import smoothing
from fxcrack.criteria.virtual_extension import FrontLine
from fxcrack.demos import tet_penny
from fxcrack.interface.front_cells import FrontCells
from fxcrack.interface.tips import Tips
from fxcrack.mesh.read import gmsh_model
from fxcrack.meshes.dcb import dcb_3d
from fxcrack.meshes.enf import enf_2d
from fxcrack.meshes.tet_penny import tet_penny as tet_mesh


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_end_notched_flexure(cell: str) -> None:
    """Elements nearly as long as an arm is high, with contact: measured -0.7 and -0.4 %.

    VCCT is 2.1 and 2.6 % short there; the tolerance of 1 % is the error of the closed form.
    """
    e, h, half, a, force = 70e3, 2.25, 50.0, 30.0, 100.0
    scene = fx.Scene(
        enf_2d(half_span=half, height=h, dx=2.0, ny=2, cell=cell, order=2),
        materials=fx.Isotropic(e, NU),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
        ],
        loads=[fx.PointForce("load", (0.0, -force))],
        debonds=[fx.Debond(bond(a, contact=True), fx.VCCT(GIc=1e5), watch=[domain()])],
    )
    row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)[-1]
    scene.close()
    ratio = 1.18 * 2.0 * (1.0 + NU)
    chi = np.sqrt(2.0 * (1.0 + NU) / 11.0 * (3.0 - 2.0 * (ratio / (1.0 + ratio)) ** 2))
    stiff = e / (1.0 - NU**2)
    exact = 9.0 * force**2 * (a + 0.42 * chi * h) ** 2 / (16.0 * stiff * h**3)
    assert float(row["GII_domain[bond]"]) == pytest.approx(exact, rel=0.01)
    assert float(row["GII[bond]"]) < 0.985 * exact
    assert abs(float(row["GI_domain[bond]"])) < 1e-3 * exact


def test_pressure_on_faces_between_second_order_triangles() -> None:
    # measured 4e-5; VCCT is 2.7 % short
    row = plate(INFLATED, domain(), order=2, cell="triangle")
    assert float(row["GI[bond]"]) == pytest.approx(np.pi * (1.0 - NU**2) / E * WIDE, rel=2e-3)


@pytest.mark.slow
def test_crack_along_an_arc() -> None:
    """A crack over 90 degrees of a circle, biaxial tension (Cotterell and Rice 1980).

    Measured at 4 elements per half arc and 3 rings: 0.1 and 0.8 %. With sides told by the tangent
    plane and faces taken as straight K_II is 10 % off.
    """
    half, reach = np.radians(45.0), np.radians(75.0)
    with gmsh_model("arc") as gmsh:
        occ, far = gmsh.model.occ, 10.0
        plate_ = occ.addRectangle(-far, -far, 0.0, 2.0 * far, 2.0 * far)
        centre = occ.addPoint(0.0, 0.0, 0.0)
        angles = np.array([-reach, -half, 0.0, half, reach])
        points = [occ.addPoint(np.sin(t), np.cos(t), 0.0) for t in angles]
        arcs = [occ.addCircleArc(a, centre, b) for a, b in pairwise(points)]
        _, parts = occ.fragment([(2, plate_)], [(1, arc) for arc in arcs])
        occ.synchronize()
        line = [tag for part in parts[1:] for _, tag in part]
        sides = {"top": (1, far), "bottom": (1, -far), "right": (0, far), "left": (0, -far)}
        for name, (axis, at) in sides.items():
            found = [
                tag
                for _, tag in gmsh.model.getEntities(1)
                if abs(occ.getCenterOfMass(1, tag)[axis] - at) < 1e-6
            ]
            gmsh.model.addPhysicalGroup(1, found, name=name)
        corners = {"corner": (-far, -far), "other": (far, -far)}
        for name, where in corners.items():
            found = [
                tag
                for _, tag in gmsh.model.getEntities(0)
                if np.allclose(gmsh.model.getValue(0, tag, [])[:2], where)
            ]
            gmsh.model.addPhysicalGroup(0, found, name=name)
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in parts[0]], name="body")
        gmsh.model.addPhysicalGroup(1, line, name="line")
        tip = np.array([np.sin(half), np.cos(half)])

        def size(dim: int, tag: int, x: float, y: float, z: float, given: float) -> float:
            away = float(np.hypot(abs(x) - tip[0], y - tip[1]))
            return min(4.0, 0.15 + 0.3 * max(0.0, away - 0.5))

        gmsh.model.mesh.setSizeCallback(size)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        mesh = fx.mesh_from_gmsh(
            gmsh.model, MPI.COMM_SELF, split=[fx.Split("line", "above", "below", (0.0, 1.0))]
        )
    crack = fx.Interface(
        "above", "below", lambda x: np.abs(np.arctan2(x[0], x[1])) >= half - 1e-9, name="crack"
    )
    loads = {"top": (0.0, 1.0), "bottom": (0.0, -1.0), "right": (1.0, 0.0), "left": (-1.0, 0.0)}
    scene = fx.Scene(
        mesh, materials=fx.Isotropic(E, NU), model=fx.PlaneStrain(),
        supports=[fx.Displacement("corner", x=0.0, y=0.0), fx.Displacement("other", y=0.0)],
        loads=[fx.Traction(name, value) for name, value in loads.items()],
        debonds=[fx.Debond(crack, domain())],
    )  # fmt: skip
    row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)[-1]
    scene.close()
    part = np.sin(0.5 * half)
    size_ = np.sqrt(np.pi * np.sin(half)) / (1.0 + part**2)
    assert float(row["KI[crack]"]) == pytest.approx(size_ * np.cos(0.5 * half), rel=0.015)
    assert abs(float(row["KII[crack]"])) == pytest.approx(size_ * part, rel=0.02)


IN_CYLINDER = 1.0054
"""G of a penny-shaped crack in a cylinder of six radii over that in space (Tada, Paris, Irwin)."""


def tetrahedra(
    size: float, loads: list[Any], supports: list[Any], *, order: int = 2, b: float = 1.0
) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Front of a crack with the half axes 1 and b in unstructured tetrahedra: angle and rates."""
    mesh = tet_mesh(a=1.0, size=size, radius=6.0, half_height=6.0, order=order)
    mesh.domain.geometry.x[:, 1] *= b
    crack = fx.Interface(
        "upper_face", "lower_face", lambda x: np.hypot(x[0], x[1] / b) >= 1.0 - 1e-6, name="crack"
    )
    scene = fx.Scene(
        mesh,
        materials=tet_penny.MATERIAL,
        model=fx.Solid(),
        supports=supports,
        loads=loads,
        debonds=[fx.Debond(crack, fx.VCCT(GIc=1e3), watch=[domain()])],
    )
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    (line,) = fx.front_lines(scene, crack)
    scene.close()
    angle = np.arctan2(line.x[:, 1] / b, line.x[:, 0])
    rates = {m: line.values[f"G{m}_domain"] for m in ("I", "II", "III")}
    return angle, sum(rates.values()), rates


def inside(size: float) -> Any:
    return lambda x: np.where(np.hypot(x[0], x[1]) < 1.0 - 1e-9, size, 0.0)


QUARTER = [
    *(fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")),
    fx.Displacement("centre_bottom", z=0.0),
]
TENSION = [fx.Traction("top", (0.0, 0.0, 1.0)), fx.Traction("bottom", (0.0, 0.0, -1.0))]
PRESSURE = [fx.Pressure(face, inside(1.0)) for face in ("upper_face", "lower_face")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("loads", "order", "size", "mean", "node"),
    [
        # measured with mean and nodes over the closed form
        (TENSION, 2, 0.25, 0.01, 0.015),  # 0.996; 0.993 to 1.000
        (PRESSURE, 2, 0.25, 0.01, 0.015),  # within 0.1 % of those of remote tension
        (TENSION, 1, 0.125, 0.015, 0.04),  # 1.003; 0.987 to 1.02; by VCCT 0.71 to 0.94
    ],
    ids=["tension", "pressure", "first order"],
)
def test_penny_crack_in_tetrahedra(
    loads: list[Any], order: int, size: float, mean: float, node: float
) -> None:
    """Sneddon's rate along the whole front, planes of symmetry included."""
    _, found, _ = tetrahedra(size, loads, QUARTER, order=order)
    ratio = found / (IN_CYLINDER * tet_penny.RATE)
    assert ratio.mean() == pytest.approx(1.0, abs=mean)
    np.testing.assert_allclose(ratio, 1.0, atol=node)


@pytest.mark.slow
def test_sheared_penny_crack_in_tetrahedra() -> None:
    """Modes II and III that change along the front (Segedin 1951): measured -0.7 to 0.1 %."""
    nu, stiff = tet_penny.NU, tet_penny.E
    loads = [fx.Traction(f"{s}_face", (inside(t), 0.0, 0.0)) for s, t in SIDES]
    supports = [
        *(fx.Displacement("x0", y=0.0, z=0.0), fx.Displacement("y0", y=0.0)),
        fx.Displacement("bottom", x=0.0, y=0.0, z=0.0),
    ]
    angle, found, rates = tetrahedra(0.25, loads, supports)
    k = 4.0 / (2.0 - nu) / np.sqrt(np.pi)
    two = (1.0 - nu**2) / stiff * (k * np.cos(angle)) ** 2
    exact = two + (1.0 + nu) / stiff * ((1.0 - nu) * k * np.sin(angle)) ** 2
    np.testing.assert_allclose(found / exact, 1.0, atol=0.015)
    # shares of the modes: fields of a straight front, four elements per radius
    np.testing.assert_allclose(rates["II"] / found, two / exact, atol=0.08)
    assert np.all(rates["I"] < 0.01 * found)


SIDES = (("upper", -1.0), ("lower", 1.0))


@pytest.mark.slow
def test_elliptical_crack_in_tetrahedra() -> None:
    """Irwin's (1962) rate, which goes from 0.6 to 1 along the front: the mean within 0.5 %.

    Nodes are 0.985 to 1.04 of it, the largest where the front turns by 30 degrees per element; by
    VCCT 0.965 to 1.048.
    """
    b = 0.6
    angle, found, _ = tetrahedra(0.25, TENSION, QUARTER, b=b)
    whole = ellipe(1.0 - b**2)
    shape = np.sqrt(np.sin(angle) ** 2 + b**2 * np.cos(angle) ** 2)
    exact = np.pi * b / whole**2 * shape * (1.0 - tet_penny.NU**2) / tet_penny.E
    ratio = found / exact
    assert ratio.mean() == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(ratio, 1.0, atol=0.05)


def test_smoothing_keeps_sum_and_mean() -> None:
    """A closed and an open front of uneven segments; noise of one flux between two nodes goes."""
    turn = np.cumsum([0.0, 0.3, 0.2, 0.3, 0.25, 0.2, 0.3, 0.3, 0.25])
    x = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    n = len(x)
    for closed in (False, True):
        segments = np.array([(i, i + 1) for i in range(n - 1)] + [(n - 1, 0)] * closed)
        length = np.linalg.norm(x[segments[:, 1]] - x[segments[:, 0]], axis=1)
        areas = np.bincount(segments.ravel(), np.repeat(0.5 * length, 2), minlength=n)
        weights = smoothing(x, segments, areas)
        np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-12)
        # weights below a thousandth are left out
        np.testing.assert_allclose(areas @ weights, areas, rtol=5e-3)
        rates = np.ones(n)
        rates[4], rates[5] = 1.0 + 0.02 / areas[4], 1.0 - 0.02 / areas[5]
        assert np.abs(rates - 1.0).max() > 0.07
        assert np.abs(weights @ rates - 1.0).max() < 0.02


def test_directions_at_kinks_open_an_area() -> None:
    """A tip that grows along a segment beside it is turned to the side that its line grows to.

    The front of a double cantilever beam of tetrahedra after single releases: the node at (9, 2)
    was moved along the front, its area was round-off and f was 6e14.
    """
    x = np.array([(8.0, 0.0, 2.0), (9, 0, 0), (9, 0, 1), (9, 0, 2), (10, 0, 3)])
    segments = np.array([(1, 2), (2, 3), (3, 0), (0, 4)])
    growth = np.array([(0.707, 0, -0.707), (1, 0, 0), (1, 0, 0), (0.447, 0, -0.894), (1, 0, 0)])
    line = FrontLine(x, segments, [np.array([i]) for i in range(5)], 2, np.zeros((4, 3)))
    up = np.broadcast_to([0.0, 1.0, 0.0], growth.shape)
    frame = np.stack([up, growth, np.cross(up, growth)], axis=2)
    found = line.directions(cast(Tips, SimpleNamespace(frame=frame)))
    frame = np.stack([up, found, np.cross(up, found)], axis=2)
    turned = cast(Tips, SimpleNamespace(frame=frame))
    areas = [line.widths(turned, i) for i in range(5)]
    # half of the way from the tip before to the one behind
    ways = np.array([x[4] - x[3], x[2] - x[1], x[3] - x[1], x[0] - x[2], x[4] - x[0]])
    np.testing.assert_allclose(areas, 0.5 * np.linalg.norm(ways, axis=1), rtol=1e-12)
    assert found[3] @ found[2] > 0.5


@pytest.mark.slow
def test_straight_front_of_tetrahedra_between_free_faces() -> None:
    """G of a double cantilever beam of second order, six segments wide, is not levelled.

    Measured: mean -2.3 % beside -dU/dA, the derivative that of ln U over two elements (0.2 %);
    beside hexahedra middle +1.8 %, others +5 % at most, free faces -21 %. Smooth rates have a mean
    of -4.5 %, 18 % too little in the middle and 60 % too much at the free faces.
    """
    width, a, step = 3.0, 6.0, 0.5

    def beam(cell: str, a0: float, method: str) -> tuple[np.ndarray, float]:
        mesh = dcb_3d(
            MPI.COMM_SELF, length=11.0, width=width, dx=step, dy=0.5, ny=2, cell=cell, order=2
        )
        scene = specimen(mesh, a0=a0, criterion=fx.VCCT(GIc=1e5, method=method))
        row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)[-1]
        (line,) = fx.front_lines(scene, "bond")
        scene.close()
        return sum(line.values[f"G{m}"] for m in ("I", "II", "III")), float(row["strain_energy"])

    found, energy = beam("tetrahedron", a, "domain")
    before, after = (beam("tetrahedron", a + s, "vcct")[1] for s in (-step, step))
    mean = energy * np.log(before / after) / (2.0 * step * width)
    assert np.trapezoid(found, dx=0.5) / width == pytest.approx(mean, rel=0.03)
    even, _ = beam("hexahedron", a, "domain")
    np.testing.assert_allclose(found[1:-1], even[1:-1], rtol=0.08)
    assert found[3] == pytest.approx(even[3], rel=0.03)
    assert max(found[0], found[-1]) < 1.1 * even[0]


@pytest.mark.mpi
@pytest.mark.three
def test_quarter_of_a_penny_crack_has_smooth_rates(comm: MPI.Intracomm) -> None:
    """A front curved from one plane of symmetry to another, three segments of 30 degrees each."""
    mesh = tet_mesh(comm, a=1.0, size=0.5, radius=1.5, half_height=1.0, growth=2.0, order=1)
    crack = fx.Interface(
        "upper_face", "lower_face", lambda x: np.hypot(x[0], x[1]) >= 1.0 - 1e-6, name="crack"
    )
    scene = fx.Scene(
        mesh, materials=tet_penny.MATERIAL, model=fx.Solid(), loads=TENSION, supports=QUARTER,
        debonds=[fx.Debond(crack, fx.VCCT(GIc=1e3, method="domain"))],
    )  # fmt: skip
    said = log.n_warned()
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    scene.close()
    assert not any("ends on free faces" in text for text in log.warned_since(said))


def test_planes_of_symmetry() -> None:
    """Faces on which supports hold the normal displacement or both others, but not all three."""
    x = np.array([[(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)]])
    facets = np.array([(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)])
    outer = np.array([[False, False, True, True]])  # z = 0, the interface, and x = 0
    cells = SimpleNamespace(
        nodes=np.array([[7, 5, 9, 8]]), facet_corners=facets, corners=x, outer=outer
    )
    interface = np.array([[False, False, True, False]])

    def symmetric(*held: bool, ends: tuple[int, ...] = (7,)) -> bool:
        return on_planes_of_symmetry(
            [np.array([end]) for end in ends], cast(FrontCells, cells), interface,
            lambda nodes: np.broadcast_to(held, (len(nodes), 3)),
        )  # fmt: skip

    assert symmetric(True, False, False)
    assert symmetric(False, True, True)
    assert not symmetric(False, True, False)
    assert not symmetric(True, True, True)
    assert not symmetric(True, False, False, ends=(7, 8))  # one in the interior


@pytest.mark.mpi
@pytest.mark.three
def test_tetrahedra_on_any_number_of_ranks(comm: MPI.Intracomm) -> None:
    """Rates along a front of second-order tetrahedra do not depend on the ranks."""
    found = []
    for chosen in (MPI.COMM_SELF, comm):
        mesh = dcb_3d(
            chosen, length=8.0, height=1.0, width=2.0, dx=1.0, dy=1.0, ny=1, cell="tetrahedron",
            order=2,
        )  # fmt: skip
        scene = specimen(mesh, a0=4.0, criterion=fx.VCCT(GIc=1e5, method="domain"))
        said = log.n_warned()
        scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
        assert any("ends on free faces" in text for text in log.warned_since(said))
        (line,) = fx.front_lines(scene, "bond")
        found.append(line.values["GI"])
        scene.close()
    assert found[0].min() > 0.0
    np.testing.assert_allclose(found[1], found[0], rtol=1e-7)
