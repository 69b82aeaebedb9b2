"""Splitting along internal surfaces, against counts by hand and meshes of separate bodies."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import dolfinx.mesh
from test_mesh_read import assert_same_on_ghosts, size

from fxcrack.base.errors import MeshError
from fxcrack.mesh import Split, mesh_from_gmsh, read_mesh
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import RawGroup, RawMesh
from fxcrack.mesh.read import gmsh_model, prepare
from fxcrack.mesh.split import split_surface
from fxcrack.meshes.blocks import Block, Blocks
from fxcrack.meshes.bodies import two_bodies

CASES = [
    (cell, order)
    for cell in ("triangle", "quadrilateral", "tetrahedron", "hexahedron")
    for order in (1, 2)
]
Where = Callable[[np.ndarray], np.ndarray]


def dimension(cell: str) -> int:
    return 2 if cell in ("triangle", "quadrilateral") else 3


def raw_mesh(model: Blocks, *splits: Split) -> RawMesh:
    with gmsh_model("test") as gmsh:
        model.write(gmsh.model)
        return prepare(gmsh.model, "test", split=splits)


def grid(cell: str, order: int, n: int = 4) -> tuple[Blocks, Block]:
    """Cells of size 1 on [0, n]^2 or [0, n]^3."""
    model = Blocks()
    axes = [np.arange(n + 1.0)] * dimension(cell)
    return model, model.add("body", axes, cell, order)


def add(model: Blocks, name: str, where: Where, **at: float) -> None:
    """A group of the parts of a grid on a plane or line whose midpoints fulfil a condition."""
    shape, rows = model.blocks["body"].part(**at)
    x = model.blocks["body"].points()[rows].mean(axis=1)
    model.group(name, (shape, rows[where(x)]))


def everywhere(x: np.ndarray) -> np.ndarray:
    return np.ones(len(x), dtype=bool)


def up(cell: str) -> tuple[float, ...]:
    return (0.3, 2.0, 0.1)[: dimension(cell)]


def places(raw: RawMesh, name: str) -> np.ndarray:
    """Midpoints of the entities of a group, sorted."""
    x = raw.points[raw.groups[name].rows].mean(axis=1)
    return x[np.lexsort(x.T[::-1])]


def side_of(raw: RawMesh, name: str) -> set[int]:
    """Whether the cells that hold the facets of a group are above (1) or below (-1) y = 2."""
    sides = set()
    for row in raw.groups[name].rows:
        (cell,) = np.flatnonzero(np.isin(raw.cells, row).sum(axis=1) == len(row))
        sides.add(int(np.sign(raw.points[raw.cells[cell], 1].mean() - 2.0)))
    return sides


@pytest.mark.parametrize(("cell", "order"), CASES)
def test_surface_that_ends_inside(cell: str, order: int) -> None:
    """Cut from x = 0 to x = 2 at y = 2: nodes on x = 2 are its inner border."""
    model, _ = grid(cell, order)
    add(model, "cut", lambda x: x[:, 0] < 2.0, y=2.0)
    raw = raw_mesh(model)
    new = split_surface(raw, Split("cut", "upper", "lower", up(cell)))
    along = 2 * order  # columns of nodes at x = 0, ... before 2
    across = 1 if dimension(cell) == 2 else 4 * order + 1
    assert len(new.points) - len(raw.points) == along * across
    assert "cut" not in new.groups
    assert len(new.groups["upper"].rows) == len(raw.groups["cut"].rows)
    assert side_of(new, "upper") == {1} and side_of(new, "lower") == {-1}
    # The copies coincide; only the border is shared; cells keep their places.
    assert np.array_equal(places(new, "upper"), places(raw, "cut"))
    assert np.array_equal(places(new, "lower"), places(raw, "cut"))
    shared = np.intersect1d(new.groups["upper"].rows, new.groups["lower"].rows)
    assert len(shared) == across and np.all(new.points[shared, 0] == 2.0)
    assert np.array_equal(new.points[new.cells], raw.points[raw.cells])


@pytest.mark.parametrize(
    ("cell", "order", "n_new", "n_facets"),
    # Only the middle node is off the border. With it go the midsides of the edges that meet there
    # (4, and 2 diagonals of triangles) and the centres of quadrilaterals; two of the triangles
    # have all their corners on the border.
    [
        ("hexahedron", 1, 1, 4),
        ("hexahedron", 2, 1 + 4 + 4, 4),
        ("tetrahedron", 1, 1, 6),
        ("tetrahedron", 2, 1 + 6, 6),
    ],
)
def test_patch_inside_a_body(cell: str, order: int, n_new: int, n_facets: int) -> None:
    """2 x 2 boxes of a plane."""
    model, _ = grid(cell, order)
    add(model, "cut", lambda x: (abs(x[:, [0, 2]] - 2.0) < 1.0).all(axis=1), y=2.0)
    raw = raw_mesh(model)
    new = split_surface(raw, Split("cut", "upper", "lower", (0, -1, 0)))
    assert len(new.points) - len(raw.points) == n_new
    assert len(new.groups["upper"].rows) == len(new.groups["lower"].rows) == n_facets
    assert side_of(new, "upper") == {-1} and side_of(new, "lower") == {1}


@pytest.mark.parametrize(("cell", "order"), CASES)
def test_like_separate_bodies(cell: str, order: int) -> None:
    """A cut right through gives the mesh that is built of two bodies."""
    lines = [np.linspace(0, 3, 4)] * (dimension(cell) - 1)
    y = np.array([0.0, 0.7, 1.0])
    z = lines[1:]
    apart, upper, _ = two_bodies((lines[0], lines[0]), (y, -y[::-1]), z, cell=cell, order=order)
    apart.group("wall", upper.part(x=0.0))
    whole = Blocks()
    # Without mirror, so that one grid divides both bodies alike.
    apart_like = Blocks()
    for name, side in (("upper", y), ("lower", -y[::-1])):
        block = apart_like.add(name, (lines[0], side, *z), cell, order)
        apart_like.group(f"{name}_face", block.part(y=0.0))
        apart_like.group("wall", block.part(x=0.0))
    block = whole.add("body", (lines[0], np.concatenate((-y[:0:-1], y)), *z), cell, order)
    whole.group("cut", block.part(y=0.0))
    whole.group("wall", block.part(x=0.0))
    two = raw_mesh(apart_like)
    one = raw_mesh(whole, Split("cut", "upper_face", "lower_face", up(cell)))
    assert len(one.points) == len(two.points)
    for name in ("upper_face", "lower_face", "wall"):
        assert np.allclose(places(one, name), places(two, name), rtol=0, atol=1e-14)
    # No cell above shares a node with one below.
    above = one.points[one.cells][:, :, 1].mean(axis=1) > 0
    assert not np.intersect1d(one.cells[above], one.cells[~above]).size
    assert set(np.unique(one.groups["upper_face"].rows)) <= set(one.cells[above].ravel())


@pytest.mark.parametrize(("cell", "order"), CASES)
def test_other_groups_stay_with_their_cells(cell: str, order: int) -> None:
    model, block = grid(cell, order)
    add(model, "cut", everywhere, y=2.0)
    add(model, "left_above", lambda x: x[:, 1] > 2.0, x=0.0)
    add(model, "left", everywhere, x=0.0)
    add(model, "part_of_cut", lambda x: x[:, 0] > 2.0, y=2.0)
    point = {"x": 0.0, "y": 2.0} | ({"z": 0.0} if dimension(cell) == 3 else {})
    model.group("monitor", block.part(**point))
    if dimension(cell) == 3:
        model.group("edge_on", block.part(x=0.0, y=2.0))
        model.group("edge_across", block.part(x=0.0, z=0.0))
    raw = raw_mesh(model)
    new = split_surface(raw, Split("cut", "upper", "lower", up(cell)))

    assert side_of(new, "left_above") == {1} and side_of(new, "left") == {-1, 1}
    assert np.array_equal(places(new, "left"), places(raw, "left"))
    assert "body" in new.cell_groups and len(new.cell_groups["body"]) == len(raw.cells)
    # What lies on the surface is there twice, with the nodes of either side.
    doubled = ["part_of_cut", "monitor"] + (["edge_on"] if dimension(cell) == 3 else [])
    for name in doubled:
        assert len(new.groups[name].rows) == 2 * len(raw.groups[name].rows), name
        for side in ("upper", "lower"):
            held = np.isin(new.groups[name].rows, new.groups[side].rows).all(axis=1)
            assert held.sum() == len(raw.groups[name].rows)
    if dimension(cell) == 3:
        assert len(new.groups["edge_across"].rows) == len(raw.groups["edge_across"].rows) == 4
        assert not np.array_equal(new.groups["edge_across"].rows, raw.groups["edge_across"].rows)


def test_second_split_crosses_the_first() -> None:
    """Two cuts through the whole square leave four pieces, at the crossing four nodes."""
    model, _ = grid("triangle", 2)
    add(model, "a", everywhere, y=2.0)
    add(model, "b", everywhere, x=2.0)
    new = raw_mesh(model, Split("a", "a+", "a-", (0, 1)), Split("b", "b+", "b-", (1, 0)))
    assert sum(np.all(new.points == 2.0, axis=1)) == 4
    assert len(new.points) == 4 * 25
    for name in ("a+", "a-", "b+", "b-"):
        assert len(new.groups[name].rows) == 4


@pytest.mark.parametrize("cell", ["triangle", "tetrahedron"])
def test_surface_that_ends_on_another_in_any_order(cell: str) -> None:
    """A ply crack on a delamination: three pieces around its end, whichever is given first."""
    model, _ = grid(cell, 1)
    add(model, "a", everywhere, y=2.0)
    add(model, "b", lambda x: x[:, 1] > 2.0 - 1e-9, x=2.0)
    splits = (
        Split("a", "a+", "a-", (0, 1, 0)[: dimension(cell)]),
        Split("b", "b+", "b-", (1, 0, 0)[: dimension(cell)]),
    )
    one, other = raw_mesh(model, *splits), raw_mesh(model, *splits[::-1])
    assert np.array_equal(one.points, other.points) and np.array_equal(one.cells, other.cells)
    at = np.isclose(one.points[:, :2], 2.0).all(axis=1)
    assert at.sum() == 3 * len(np.unique(one.points[at], axis=0))


def closed_surface(model: Blocks) -> None:
    """The boundary of the middle box of a 3 x 3 grid."""
    for axis in "xy":
        for value in (1.0, 2.0):
            add(model, "shell", lambda x: (abs(x[:, :2] - 1.5) < 0.6).all(axis=1), **{axis: value})


def test_closed_surface_by_the_cells_inside() -> None:
    model, _ = grid("quadrilateral", 1, 3)
    closed_surface(model)
    raw = raw_mesh(model)
    middle = raw.points[raw.cells].mean(axis=1)
    raw.cell_groups["core"] = np.flatnonzero((middle == 1.5).all(axis=1))
    new = split_surface(raw, Split("shell", "fibre", "matrix", "core"))
    assert len(new.points) == len(raw.points) + 4
    (core,) = new.cell_groups["core"]
    assert set(np.unique(new.groups["fibre"].rows)) == set(new.cells[core])
    with pytest.raises(MeshError, match="closes on itself; give a direction across"):
        split_surface(raw, Split("shell", "fibre", "matrix", (0, 1)))


def test_faults() -> None:
    model, block = grid("quadrilateral", 1)
    add(model, "cut", everywhere, y=2.0)
    add(model, "bottom", everywhere, y=0.0)
    add(model, "single", lambda x: abs(x[:, 0] - 1.5) < 0.1, y=2.0)
    add(model, "branched", everywhere, y=2.0)
    add(model, "branched", lambda x: x[:, 1] > 2.0, x=2.0)
    model.group("corner", block.part(x=0.0, y=0.0))
    raw = raw_mesh(model)

    def fails(match: str, surface: str, toward: tuple[float, ...] | str, *names: str) -> None:
        with pytest.raises(MeshError, match=match):
            split_surface(raw, Split(surface, *(names or ("s", "m")), toward))

    fails("no group of facets 'crack'.*: bottom, branched, cut, single", "crack", (0, 1))
    fails("no group of facets 'corner'", "corner", (0, 1))
    fails(r"4 of 4 facets of 'bottom' are on the boundary.*first at \(0.5, 0\)", "bottom", (0, 1))
    fails(r"toward=\(1, 0\) does not tell the sides of 'cut' apart near", "cut", (1, 0))
    fails("must be a direction of 2 components", "cut", (0, 1, 0))
    fails("must be a direction of 2 components", "cut", (0, 0))
    fails("toward='core' is no group of cells.*: body", "cut", "core")
    fails("does not tell the sides of 'cut' apart", "cut", "body")
    fails("cannot make a group 'bottom': the name is taken", "cut", (0, 1), "bottom", "m")
    fails("cannot make a group 'a': the name is taken", "cut", (0, 1), "a", "a")
    fails("separates nothing.*refine the mesh", "single", (0, 1))
    fails(r"'branched' branches or crosses itself at \(2, 2\)", "branched", (0, 1))


def test_surface_off_the_mesh() -> None:
    raw = RawMesh("triangle", 1, np.eye(3)[:, :2], np.array([[0, 1, 2]]))
    model, _ = grid("quadrilateral", 1, 2)
    add(model, "cut", everywhere, y=1.0)
    raw = raw_mesh(model)
    raw.groups["cut"].rows[0] = [0, 4]  # a diagonal
    with pytest.raises(MeshError, match="1 of 2 facets of 'cut' belong to no cell"):
        split_surface(raw, Split("cut", "s", "m", (0, 1)))


def test_one_sided_surface() -> None:
    """A ring of boxes glued with a twist; the surface runs round inside it."""
    n = 8
    angle = 2 * np.pi * np.arange(n) / n
    rows = []
    for i in range(n):
        a = 9 * i + np.arange(9)
        b = 9 * ((i + 1) % n) + (np.arange(9) if i < n - 1 else np.arange(9)[::-1])
        rows += [[*a[[k, k + 1, k + 3, k + 4]], *b[[k, k + 1, k + 3, k + 4]]] for k in (0, 1, 3, 4)]
    u, v = np.meshgrid([-1.0, 0, 1], [-1.0, 0, 1])
    turn = angle[:, None] / 2
    out = u.ravel() * np.cos(turn) - v.ravel() * np.sin(turn)
    height = u.ravel() * np.sin(turn) + v.ravel() * np.cos(turn)
    radius = 4 + out
    x = np.stack((radius * np.cos(angle[:, None]), radius * np.sin(angle[:, None]), height), -1)
    cells = np.array(rows)
    strip = [[9 * i + k for k in (3, 4, 5)] for i in range(n)] + [[5, 4, 3]]
    facets = [[a[k], a[k + 1], b[k], b[k + 1]] for a, b in pairwise(strip) for k in (0, 1)]
    raw = RawMesh("hexahedron", 1, x.reshape(-1, 3), cells)
    raw.groups["strip"] = RawGroup(2, np.array(facets))
    with pytest.raises(MeshError, match="only one side"):
        split_surface(raw, Split("strip", "s", "m", (0, 0, 1)))


@pytest.mark.mpi
def test_second_order_nodes_are_those_of_the_topology(comm: MPI.Comm) -> None:
    """DOLFINx knows edges by their vertices: one geometry node per vertex and per edge, no more."""
    model, _ = grid("tetrahedron", 2)
    add(model, "cut", lambda x: (abs(x[:, [0, 2]] - 2.0) < 1.0).all(axis=1), y=2.0)
    raw = raw_mesh(model, Split("cut", "upper", "lower", (0, 1, 0)))
    domain = distribute(raw if comm.rank == 0 else None, comm, "patch").domain
    domain.topology.create_entities(1)
    n_edges, n_vertices = (domain.topology.index_map(dim).size_global for dim in (1, 0))
    assert domain.geometry.index_map().size_global == n_edges + n_vertices


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["triangle", "hexahedron"])
def test_on_several_ranks(comm: MPI.Comm, shared_path: Path, cell: str) -> None:
    """The distributed mesh has the doubled nodes, and both faces on the boundary."""
    split = Split("cut", "upper", "lower", up(cell))
    path = shared_path / "cut.msh"
    model, _ = grid(cell, 2)
    add(model, "cut", lambda x: x[:, 0] < 2.0, y=2.0)
    whole = raw_mesh(model, split)
    if comm.rank == 0:
        with gmsh_model("cut") as gmsh:
            model.write(gmsh.model)
            gmsh.write(str(path))
            mesh = mesh_from_gmsh(gmsh.model, comm, split=[split])
    else:
        mesh = mesh_from_gmsh(None, comm, split=[split])
    for made in (mesh, read_mesh(path, comm, split=[split])):
        assert made.domain.geometry.index_map().size_global == len(whole.points)
        assert size(made, "upper") == size(made, "lower") == len(whole.groups["upper"].rows)
        assert_same_on_ghosts(made)
        topology = made.domain.topology
        topology.create_connectivity(made.tdim - 1, made.tdim)
        boundary = dolfinx.mesh.exterior_facet_indices(topology)
        for side in ("upper", "lower"):
            facets = made.group(side, dim=made.tdim - 1).entities
            owned = facets[facets < topology.index_map(made.tdim - 1).size_local]
            assert np.isin(owned, boundary).all()
    with pytest.raises(MeshError, match="mesh 'cut': there is no group of facets 'crack'"):
        read_mesh(path, comm, split=[Split("crack", "s", "m", (0, 1))])
