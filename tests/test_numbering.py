"""Numbers of nodes and cells are names: histories do not depend on them.

The last bonded node between two open parts has no growth direction of its own; it is the case in
which the number of a neighbour once decided.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.interface.crack_extent import CrackExtent
from fxcrack.interface.front import Front
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import RawGroup, RawMesh
from fxcrack.mesh.read import gmsh_model, prepare
from fxcrack.meshes.bodies import two_bodies
from tests.specimens import assert_same, tensor_surface

X = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 4.5, 5.0, 6.5, 8.0, 9.0, 10.0])
"""The node at 5 has 0.5 on one side and 1.5 on the other."""
Z = np.array([0.0, 0.8, 2.0])


MIXED = fx.VCCT(GIc=1e-4, GIIc=2e-4, mix=fx.BK(1.5))


def raw_mesh(cell: str, order: int, *, matching: bool = True) -> RawMesh:
    y = np.linspace(0.0, 1.0, 3)
    solid = cell in ("hexahedron", "tetrahedron")
    lower = X if matching else np.linspace(0.0, 10.0, 8)
    model, up, lo = two_bodies(
        (X, lower), (y, y - 1.0), [Z] if solid else (), cell=cell, order=order
    )
    for name, part in (
        ("pin_top", up.part(x=0.0, y=1.0)),
        ("pin_bottom", lo.part(x=0.0, y=-1.0)),
        ("far_upper", up.part(x=10.0)),
        ("far_lower", lo.part(x=10.0)),
    ):
        model.group(name, part)
    with gmsh_model("m") as gmsh:
        model.write(gmsh.model)
        return prepare(gmsh.model, "m")


def renumbered(raw: RawMesh, seed: int) -> RawMesh:
    """The same mesh with other numbers of nodes and cells."""
    rng = np.random.default_rng(seed)
    nodes, cells = rng.permutation(len(raw.points)), rng.permutation(len(raw.cells))
    points = np.empty_like(raw.points)
    points[nodes] = raw.points
    back = np.argsort(cells)
    return RawMesh(
        raw.cell, raw.order, points, nodes[raw.cells][cells],
        {k: np.sort(back[v]) for k, v in raw.cell_groups.items()},
        {k: RawGroup(g.dim, nodes[g.rows]) for k, g in raw.groups.items()},
    )  # fmt: skip


def history(
    raw: RawMesh, debond: dict[str, Any], bonded: Any, *, until: int, contact: bool = True
) -> fx.History:
    solid = raw.cell in ("hexahedron", "tetrahedron")
    zero, up, down = (
        ({"x": 0.0, "y": v} | ({"z": 0.0} if solid else {})) for v in (0.0, 1.0, -0.8)
    )
    interface = fx.Interface("upper_face", "lower_face", bonded=bonded, name="b", contact=contact)
    scene = fx.Scene(
        distribute(raw, MPI.COMM_SELF, "m"),
        materials=fx.Isotropic(1.0, 0.3),
        model=fx.Solid() if solid else fx.PlaneStrain(),
        supports=[
            fx.Displacement("far_upper", **zero),
            fx.Displacement("far_lower", **zero),
            fx.Displacement("pin_top", **up),
            fx.Displacement("pin_bottom", **down),
        ],
        debonds=[fx.Debond(interface, **debond)],
    )
    return scene.run(fx.Static(until=fx.Releases(until)), progress=False)


def between(x: np.ndarray) -> np.ndarray:
    """One bonded node, or row of nodes, between two open parts."""
    return np.isclose(x[0], 5.0) | (x[0] > 7.9)


def edge(x: np.ndarray) -> np.ndarray:
    return x[0] > 3.9


CASES = {
    "vcct": ("quadrilateral", 1, dict(criterion=MIXED), between),
    "closure": ("quadrilateral", 1, dict(criterion=fx.VCCT(GIc=1e-4, method="closure")), between),
    "progressive": (
        "triangle", 1,
        dict(criterion=MIXED, release=fx.ProgressiveRelease()), between,
    ),
    "second order": ("quadrilateral", 2, dict(criterion=MIXED), between),
    "stress": (
        "quadrilateral", 1,
        dict(criterion=fx.CriticalStress(1e-3, 2e-3, distance=0.0)), between,
    ),
    "row of nodes": ("hexahedron", 1, dict(criterion=fx.VCCT(GIc=1e-4)), between),
    "tetrahedra": ("tetrahedron", 1, dict(criterion=fx.VCCT(GIc=1e-4)), between),
    "solid, second order": ("hexahedron", 2, dict(criterion=fx.VCCT(GIc=1e-4)), between),
    "one node": (
        "hexahedron", 1, dict(criterion=fx.VCCT(GIc=1e-4)),
        lambda x: (np.isclose(x[0], 5.0) & np.isclose(x[2], 0.8)) | (x[0] > 7.9),
    ),
    "curved front": (
        "tetrahedron", 1, dict(criterion=MIXED, release=fx.ProgressiveRelease()),
        lambda x: x[0] ** 2 + x[2] ** 2 > 15.0,
    ),
    "edge": ("quadrilateral", 1, dict(criterion=MIXED), edge),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_renumbered_meshes_give_the_same_history(name: str) -> None:
    cell, order, debond, bonded = CASES[name]
    raw = raw_mesh(cell, order)
    seeds = (1, 2) if cell in ("hexahedron", "tetrahedron") else (1, 2, 4, 5)
    first = history(raw, debond, bonded, until=2)
    assert any(r["event"] == "release" for r in first)
    for seed in seeds:
        assert_numbering_free(first, history(renumbered(raw, seed), debond, bonded, until=2))


def test_faces_that_do_not_match() -> None:
    raw = raw_mesh("quadrilateral", 1, matching=False)
    debond = dict(criterion=MIXED)
    first = history(raw, debond, between, until=2)
    for seed in (1, 2, 4):
        assert_numbering_free(first, history(renumbered(raw, seed), debond, between, until=2))


def assert_numbering_free(one: fx.History, other: fx.History) -> None:
    """The same rows to 1e-8 but for the numbers of nodes."""
    for history in (one, other):
        for row in history.rows:
            row["node[b]"] = 0
    assert_same(one, other, 1e-8)


@pytest.mark.parametrize("order", [1, 2])
def test_last_node_takes_the_mean_of_both_sides(order: int) -> None:
    """Exchanging the two sides changes nothing, and all of the node's surroundings are open."""
    found = []
    for flip in (False, True):
        corners = np.array([0.0, 1.0, 1.5, 3.0, 4.0])
        s = tensor_surface("interval", order, 4.0 - corners[::-1] if flip else corners)
        here = 4.0 - 1.5 if flip else 1.5
        front = Front(s, np.isclose(s.x[:, 0], here), "i")
        tips = front.tips()
        assert tips.ligament.tolist() == [True]
        left, right = (1.5, 0.5) if flip else (0.5, 1.5)
        wake = sorted(s.x[tips.wake_nodes[0, 0], 0])
        assert wake == pytest.approx([here - left, here + right])
        assert tips.d_behind[0] == pytest.approx(1.0)
        extent = CrackExtent(front)
        assert extent.area(tips) == pytest.approx(4.0)
        found.append([float(tips.width[0]), float(tips.area[0]), float(tips.d_ahead[0])])
    assert found[0] == pytest.approx(found[1])


def lengths_until_open(bonded: np.ndarray, order: list[int]) -> list[float]:
    s = tensor_surface("interval", 1, np.arange(0.0, len(bonded)))
    front = Front(s, bonded, "i")
    extent = CrackExtent(front)
    out = [extent.length(front.tips())]
    for node in order:
        front.release(np.array([node]))
        out.append(extent.length(front.tips()))
    return out


def test_length_of_a_crack_with_two_tips_does_not_double() -> None:
    """Half of the open length, also after a tip has reached the end of the surface."""
    bonded = np.ones(9, dtype=bool)
    bonded[4] = False
    found = lengths_until_open(bonded, [3, 5, 2, 6, 1, 7, 0, 8])
    assert found == [1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.0, 4.0]


def test_length_of_two_cracks_that_meet() -> None:
    """From both ends of the surface: the open length of each tip, not of both together."""
    bonded = np.ones(9, dtype=bool)
    bonded[[0, 8]] = False
    assert lengths_until_open(bonded, [1, 7, 2, 6, 3, 5, 4])[-3:] == [4.0, 4.0, 4.0]


def test_length_of_one_crack_is_that_of_the_surface_at_last() -> None:
    bonded = np.ones(6, dtype=bool)
    bonded[0] = False
    assert lengths_until_open(bonded, [1, 2, 3, 4, 5]) == [1.0, 2.0, 3.0, 4.0, 5.0, 5.0]
