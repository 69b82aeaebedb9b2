"""gmsh models and .msh files become meshes with the right groups, whole on any number of ranks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix
import dolfinx.la
import dolfinx.mesh

from fxcrack.base.errors import MeshError
from fxcrack.mesh import Group, Mesh, mesh_from_domain, mesh_from_gmsh, read_mesh
from fxcrack.mesh.raw import reference
from fxcrack.mesh.read import gmsh_model

CASES = [
    (cell, order)
    for cell in ("triangle", "quadrilateral", "tetrahedron", "hexahedron")
    for order in (1, 2)
]
ROUND_OFF = 1e-12  # sums of some hundred exact measures


def size(mesh: Mesh, name: str) -> int:
    """Number of entities of a group, each counted on its owner."""
    group = mesh.group(name)
    owned = group.entities < mesh.domain.topology.index_map(group.dim).size_local
    return int(mesh.comm.allreduce(int(owned.sum())))


def measure(mesh: Mesh, name: str) -> float:
    """Length, area or volume of a group of straight-sided entities; hexahedra must be boxes."""
    group = mesh.group(name)
    n_owned = mesh.domain.topology.index_map(group.dim).size_local
    x = corners(mesh, Group(group.dim, group.entities[group.entities < n_owned]))
    n_vertices = x.shape[1]
    if group.dim == 1:
        each = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    elif group.dim == 2 and n_vertices == 3:
        each = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2
    elif group.dim == 2:
        each = np.linalg.norm(np.cross(x[:, 3] - x[:, 0], x[:, 2] - x[:, 1]), axis=1) / 2
    elif n_vertices == 4:
        each = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 6
    else:
        each = np.prod(np.ptp(x, axis=1), axis=1)
    return float(mesh.comm.allreduce(each.sum()))


def corners(mesh: Mesh, group: Group) -> np.ndarray:
    """Coordinates of the vertices of the entities, shape (n_entities, n_vertices, 3)."""
    domain = mesh.domain
    domain.topology.create_connectivity(group.dim, 0)
    domain.topology.create_connectivity(group.dim, mesh.tdim)
    element = reference(domain.topology.cell_name(), mesh.order)
    width = len(element.entity_closure_dofs[group.dim][0])
    n_vertices = len(basix.topology(element.cell_type)[group.dim][0])
    if not len(group.entities):  # DOLFINx 0.9 divides by their number
        return np.zeros((0, n_vertices, 3))
    nodes = dolfinx.mesh.entities_to_geometry(domain, group.dim, group.entities)
    return domain.geometry.x[nodes.reshape(len(group.entities), width)[:, :n_vertices]]


def assert_same_on_ghosts(mesh: Mesh) -> None:
    """Every rank that sees an entity has it in the group if its owner has."""
    for name, group in mesh.groups.items():
        marks = dolfinx.la.vector(mesh.domain.topology.index_map(group.dim), dtype=np.int32)
        marks.array[:] = 0
        marks.array[group.entities] = 1
        before = marks.array.copy()
        marks.scatter_forward()
        assert np.array_equal(before, marks.array), name
        assert np.all(np.diff(group.entities) > 0) and group.entities.dtype == np.int32


@contextmanager
def on_root(comm: MPI.Comm, build: Callable[[Any], None]) -> Iterator[Any]:
    """The gmsh module with a model on rank 0, None elsewhere."""
    if comm.rank == 0:
        with gmsh_model("test") as gmsh:
            build(gmsh)
            yield gmsh
    else:
        yield None


def box(gmsh: Any, cell: str, order: int) -> None:
    """Two unit squares or cubes side by side, meshed by gmsh itself, with overlapping groups."""
    dim = 2 if cell in ("triangle", "quadrilateral") else 3
    geometry = gmsh.model.occ
    squares = [geometry.addRectangle(x, 0, 0, 1, 1) for x in (0, 1)]
    geometry.fragment([(2, squares[0])], [(2, squares[1])])
    structured = cell in ("quadrilateral", "hexahedron")
    if dim == 3:
        geometry.extrude(
            [(2, t) for t in squares], 0, 0, 1, [2] if structured else [], [1], structured
        )
    geometry.synchronize()

    def inside(d: int, *limits: float) -> list[int]:
        eps = 1e-6
        low, high = np.array(limits[:3]) - eps, np.array(limits[3:]) + eps
        return [t for _, t in gmsh.model.getEntitiesInBoundingBox(*low, *high, d)]

    top = float(dim - 2)
    everything = [t for _, t in gmsh.model.getEntities(dim)]
    left = inside(dim, 0, 0, 0, 1, 1, top)
    boundary = [
        t for _, t in gmsh.model.getBoundary([(dim, t) for t in everything], oriented=False)
    ]
    gmsh.model.addPhysicalGroup(dim, everything, name="both")
    gmsh.model.addPhysicalGroup(dim, left, name="left_half")
    gmsh.model.addPhysicalGroup(dim - 1, inside(dim - 1, 0, 0, 0, 0, 1, top), name="left")
    gmsh.model.addPhysicalGroup(dim - 1, inside(dim - 1, 1, 0, 0, 1, 1, top), name="middle")
    gmsh.model.addPhysicalGroup(dim - 1, boundary, name="boundary")
    gmsh.model.addPhysicalGroup(0, inside(0, 0, 0, 0, 0, 0, 0), name="origin")
    gmsh.model.addPhysicalGroup(0, inside(0, 0, 0, 0, 2, 0, 0), 77)
    if dim == 3:
        gmsh.model.addPhysicalGroup(1, inside(1, 0, 0, 0, 0, 0, 1), name="z_axis")
    if structured:
        for _, t in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(t, 3)
        for _, t in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(t)
            gmsh.model.mesh.setRecombine(2, t)
    else:
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    gmsh.model.mesh.generate(dim)
    gmsh.model.mesh.setOrder(order)


def check_box(mesh: Mesh, cell: str, order: int) -> None:
    dim = mesh.tdim
    assert (mesh.gdim, mesh.order) == (dim, order)
    assert mesh.domain.topology.cell_name() == cell
    assert measure(mesh, "both") == pytest.approx(2.0, rel=ROUND_OFF)
    assert measure(mesh, "left_half") == pytest.approx(1.0, rel=ROUND_OFF)
    assert measure(mesh, "left") == pytest.approx(1.0, rel=ROUND_OFF)
    assert measure(mesh, "middle") == pytest.approx(1.0, rel=ROUND_OFF)
    assert measure(mesh, "boundary") == pytest.approx(6.0 if dim == 2 else 10.0, rel=ROUND_OFF)
    assert size(mesh, "origin") == 1 and size(mesh, "group_0_77") == 3
    assert np.all(corners(mesh, mesh.group("origin", dim=0)) == 0.0)
    # Left is a part of the boundary: the same entities are in both.
    assert np.isin(mesh.group("left").entities, mesh.group("boundary").entities).all()
    assert size(mesh, "both") == mesh.domain.topology.index_map(dim).size_global
    if cell == "quadrilateral":
        assert [size(mesh, n) for n in ("both", "left", "boundary")] == [8, 2, 12]
    if cell == "hexahedron":
        assert [size(mesh, n) for n in ("both", "left", "boundary")] == [16, 4, 40]
    if dim == 3:
        assert measure(mesh, "z_axis") == pytest.approx(1.0, rel=ROUND_OFF)
        assert size(mesh, "z_axis") == 2 or cell == "tetrahedron"
    assert_same_on_ghosts(mesh)


@pytest.mark.quick("triangle-1", "hexahedron-1")
@pytest.mark.three
@pytest.mark.mpi
@pytest.mark.parametrize(("cell", "order"), CASES)
def test_model(comm: MPI.Comm, cell: str, order: int) -> None:
    with on_root(comm, lambda gmsh: box(gmsh, cell, order)) as gmsh:
        mesh = mesh_from_gmsh(gmsh and gmsh.model, comm)
    check_box(mesh, cell, order)


@pytest.mark.mpi
@pytest.mark.parametrize("version", [2.2, 4.1])  # 2.2 repeats an element for each of its groups
@pytest.mark.parametrize(("cell", "order"), [("triangle", 2), ("hexahedron", 1)])
def test_file(comm: MPI.Comm, shared_path: Path, cell: str, order: int, version: float) -> None:
    with on_root(comm, lambda gmsh: box(gmsh, cell, order)) as gmsh:
        if gmsh:
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.write(str(shared_path / "box.msh"))
    comm.Barrier()
    mesh = read_mesh(shared_path / "box.msh", comm)
    check_box(mesh, cell, order)
    assert mesh.name == "box"


def test_gaps_and_unused_nodes(comm: MPI.Comm) -> None:
    def build(gmsh: Any) -> None:
        gmsh.model.addDiscreteEntity(2, 1)
        gmsh.model.addDiscreteEntity(0, 9)
        gmsh.model.mesh.addNodes(0, 9, [4], [5.0, 5.0, 5.0])  # a point of the geometry, no cell's
        xy = [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 2, 0, 0]
        gmsh.model.mesh.addNodes(2, 1, [1000, 7, 300, 20, 500], xy)
        gmsh.model.mesh.addElementsByType(
            1, 2, [90, 11, 40], [1000, 7, 300, 1000, 300, 20, 7, 500, 300]
        )
        gmsh.model.addDiscreteEntity(1, 1)
        gmsh.model.mesh.addElementsByType(1, 1, [], [1000, 7])
        gmsh.model.addPhysicalGroup(1, [1], name="bottom")
        gmsh.model.addPhysicalGroup(2, [1], name="plate")

    with on_root(comm, build) as gmsh:
        mesh = mesh_from_gmsh(gmsh and gmsh.model, comm, gdim=2)
    assert mesh.domain.geometry.index_map().size_global == 5
    assert measure(mesh, "plate") == pytest.approx(1.5, rel=ROUND_OFF)
    assert measure(mesh, "bottom") == pytest.approx(1.0, rel=ROUND_OFF)


def test_callers_gmsh_session_is_left_alone(comm: MPI.Comm) -> None:
    with on_root(comm, lambda gmsh: gmsh.model.occ.addPoint(0, 0, 0)) as gmsh:
        before = gmsh and gmsh.model.getCurrent()
        with pytest.raises(MeshError):
            read_mesh("nowhere.msh", comm)
        assert gmsh is None or gmsh.isInitialized()
        assert gmsh is None or gmsh.model.getCurrent() == before


def discrete(gmsh: Any, kind: int, nodes: list[list[float]], dim: int = 2) -> None:
    """One element of a gmsh kind per entity of ``dim`` with nodes of its own."""
    for tag, xyz in enumerate(np.reshape(nodes, (len(nodes), -1)), 1):
        gmsh.model.addDiscreteEntity(dim, tag)
        tags = 100 * tag + np.arange(len(xyz) // 3)
        gmsh.model.mesh.addNodes(dim, tag, tags, xyz)
        gmsh.model.mesh.addElementsByType(tag, kind, [], tags)


TRIANGLE = [0.0, 0, 0, 1, 0, 0, 0, 1, 0]


def mixed(gmsh: Any) -> None:
    discrete(gmsh, 2, [TRIANGLE])
    gmsh.model.addDiscreteEntity(2, 2)
    gmsh.model.mesh.addNodes(2, 2, [1, 2, 3, 4], [2, 0, 0, 3, 0, 0, 3, 1, 0, 2, 1, 0])
    gmsh.model.mesh.addElementsByType(2, 3, [], [1, 2, 3, 4])


def with_part(
    gmsh: Any, dim: int, kind: int, xyz: list[float], tags: list[int], **named: str
) -> None:
    """The triangle, and one element of its own or of the triangle's nodes (101, 102, 103)."""
    discrete(gmsh, 2, [TRIANGLE])
    gmsh.model.addDiscreteEntity(dim, 9)
    if xyz:
        gmsh.model.mesh.addNodes(dim, 9, tags, xyz)
    gmsh.model.mesh.addElementsByType(9, kind, [], tags)
    gmsh.model.addPhysicalGroup(dim, [9], **named)


def stray_node(gmsh: Any) -> None:
    with_part(gmsh, 0, 15, [0.5, 0.5, 0.0], [9], name="load")


def two_dimensions(gmsh: Any) -> None:
    with_part(gmsh, 1, 1, [], [100, 101], name="pin")
    gmsh.model.addPhysicalGroup(2, [1], name="pin")


def no_facet(gmsh: Any) -> None:
    square = [[0.0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0]]
    discrete(gmsh, 3, square)
    gmsh.model.addDiscreteEntity(1, 1)
    gmsh.model.mesh.addElementsByType(1, 1, [], [100, 102, 100, 101])
    gmsh.model.addPhysicalGroup(1, [1], name="face")


def empty_group(gmsh: Any) -> None:
    discrete(gmsh, 2, [TRIANGLE])
    gmsh.model.addDiscreteEntity(1, 1)
    gmsh.model.addPhysicalGroup(1, [1], name="support")


def midside_node(gmsh: Any) -> None:
    discrete(gmsh, 9, [[*TRIANGLE, 0.5, 0, 0, 0.5, 0.5, 0, 0, 0.5, 0]])
    gmsh.model.addDiscreteEntity(0, 9)
    gmsh.model.mesh.addElementsByType(9, 15, [], [103])
    gmsh.model.addPhysicalGroup(0, [9], name="load")


PRISM = [0.0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1]
FAULTS: list[tuple[str, Callable[[Any], None]]] = [
    (
        "no triangles, quadrilaterals.*mesh the model",
        lambda g: g.model.occ.addBox(0, 0, 0, 1, 1, 1),
    ),
    ("2 kinds.*triangle.*recombine", mixed),
    ("prism.*not supported; use", lambda g: discrete(g, 6, [PRISM], 3)),
    (
        r"plane z = 0, but 1 of 3 nodes.*\(0, 1, 0.5\)",
        lambda g: discrete(g, 2, [[*TRIANGLE[:-1], 0.5]]),
    ),
    (r"1 of 3 nodes.*finite", lambda g: discrete(g, 2, [[*TRIANGLE[:-2], np.nan, 0.0]])),
    (
        r"1 of 2 cells are degenerate.*first at \(1, 0\)",
        lambda g: discrete(g, 2, [TRIANGLE, [0, 0, 0, 1, 0, 0, 2, 0, 0]]),
    ),
    (
        "1 of 1 cells are degenerate.*folded",
        lambda g: discrete(g, 3, [[0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0]]),
    ),
    (r"'load' \(dimension 0\) has a node at \(0.5, 0.5, 0\).*no cell", stray_node),
    ("'pin' is used for physical groups of dimension 2 and 1; give", two_dimensions),
    ("1 of the 2 entities of group 'face' are not facets", no_facet),
    ("'support'.*holds no elements", empty_group),
    (r"midside node at \(0.5, 0\)", midside_node),
    (
        "no parts of a triangle of order 1",
        lambda g: with_part(g, 1, 8, [], [100, 101, 102], name="edge"),
    ),
]


def _faults() -> Iterator[Any]:
    """Every fault on one rank; on several a fault found before and one found after distribution."""
    for message, build in FAULTS:
        marks = [pytest.mark.mpi] if build in (stray_node, no_facet) else []
        yield pytest.param(message, build, marks=marks, id=message[:30])


@pytest.mark.parametrize(("message", "build"), list(_faults()))
def test_faults_are_raised_on_all_ranks(
    comm: MPI.Comm, message: str, build: Callable[[Any], None]
) -> None:
    with on_root(comm, build) as gmsh, pytest.raises(MeshError, match=f"^mesh 'part'.*{message}"):
        mesh_from_gmsh(gmsh and gmsh.model, comm, name="part")


def test_wrong_dimension_and_missing_model(comm: MPI.Comm) -> None:
    build = lambda gmsh: discrete(gmsh, 2, [TRIANGLE])  # noqa: E731
    with on_root(comm, build) as gmsh, pytest.raises(MeshError, match="2-dimensional, but gdim=4"):
        mesh_from_gmsh(gmsh and gmsh.model, comm, gdim=4)
    with pytest.raises(MeshError, match="rank 0 got no gmsh model"):
        mesh_from_gmsh(None, comm)


@pytest.mark.mpi
def test_wrong_files(comm: MPI.Comm, shared_path: Path) -> None:
    with pytest.raises(MeshError, match=r"no mesh file .*missing.msh' \(looked in"):
        read_mesh(shared_path / "missing.msh", comm)
    with pytest.raises(MeshError, match=r"not a .msh file; write one"):
        read_mesh(shared_path / "part.stl", comm)
    if comm.rank == 0:
        (shared_path / "broken.msh").write_text("no mesh")
    with pytest.raises(MeshError, match=r"gmsh cannot read.*broken\.msh"):
        read_mesh(shared_path / "broken.msh", comm)


def test_group_lookup(comm: MPI.Comm) -> None:
    with on_root(comm, lambda gmsh: box(gmsh, "quadrilateral", 1)) as gmsh:
        mesh = mesh_from_gmsh(gmsh and gmsh.model, comm, name="box")
    with pytest.raises(MeshError, match=r"'box' has no group 'rigth'; it has: .*left \(dim 1\)"):
        mesh.group("rigth")
    with pytest.raises(MeshError, match="'left' of mesh 'box' holds entities of dimension 1, but"):
        mesh.group("left", dim=0)


@pytest.mark.mpi
def test_groups_on_a_dolfinx_mesh(comm: MPI.Comm) -> None:
    domain = dolfinx.mesh.create_unit_square(
        comm,
        4,
        4,
        dolfinx.mesh.CellType.quadrilateral,
        ghost_mode=dolfinx.mesh.GhostMode.shared_facet,
    )
    # Owners name their cells; ghosts follow.
    owned = np.arange(domain.topology.index_map(2).size_local)
    mesh = mesh_from_domain(
        domain,
        {
            "all": (2, owned),
            "none": (1, []),
            "left": (1, lambda x: np.isclose(x[0], 0.0)),
            "inside": (1, lambda x: np.isclose(x[1], 0.5)),
            "corner": (0, lambda x: np.isclose(x[0] + x[1], 0.0)),
        },
        name="square",
    )
    assert [size(mesh, n) for n in mesh.groups] == [16, 0, 4, 4, 1]
    assert measure(mesh, "inside") == pytest.approx(1.0, rel=ROUND_OFF)
    assert_same_on_ghosts(mesh)
    last = comm.size - 1
    bad = np.array([10**6 if comm.rank == last else 0])
    with pytest.raises(MeshError, match=f"'x' holds index 1000000, but rank {last} has entities"):
        mesh_from_domain(domain, {"x": (1, bad)})
    with pytest.raises(MeshError, match="'x' needs a one-dimensional array of integers"):
        mesh_from_domain(domain, {"x": (1, np.zeros(3))})
    with pytest.raises(MeshError, match="'x' has dimension 3"):
        mesh_from_domain(domain, {"x": (3, [])})
    if comm.size > 1:
        with pytest.raises(MeshError, match="ranks name different groups"):
            mesh_from_domain(domain, {f"x{comm.rank}": (1, [])})


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_second_order_nodes_are_in_place(comm: MPI.Comm, cell: str) -> None:
    with on_root(comm, lambda gmsh: box(gmsh, cell, 2)) as gmsh:
        mesh = mesh_from_gmsh(gmsh and gmsh.model, comm)
    x = mesh.domain.geometry.x[compat.geometry_dofmap(mesh.domain)]
    linear, quadratic = (reference(cell, order) for order in (1, 2))
    # Straight sides: first-order functions of the corners give all nodes.
    weights = linear.tabulate(0, quadratic.points)[0, :, :, 0]
    assert np.allclose(weights @ x[:, : linear.dim], x, rtol=0, atol=1e-12)


# -- second order without centre nodes -------------------------------------------------------------


def quarter_ring(gmsh: Any, dim: int, incomplete: int) -> None:
    """Two by two (by two) curved second-order cells between the radii 1 and 2."""
    geo = gmsh.model.geo
    corner = [geo.addPoint(*p, 0) for p in ((1, 0), (2, 0), (0, 2), (0, 1))]
    centre = geo.addPoint(0, 0, 0)
    lines = [
        geo.addLine(corner[0], corner[1]),
        geo.addCircleArc(corner[1], centre, corner[2]),
        geo.addLine(corner[2], corner[3]),
        geo.addCircleArc(corner[3], centre, corner[0]),
    ]
    surface = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    for line in lines:
        geo.mesh.setTransfiniteCurve(line, 3)
    geo.mesh.setTransfiniteSurface(surface, cornerTags=corner)
    geo.mesh.setRecombine(2, surface)
    made = geo.extrude([(2, surface)], 0, 0, 1, [2], recombine=True) if dim == 3 else []
    geo.synchronize()
    groups = [(2, [surface], "ring")] if dim == 2 else [(3, [made[1][1]], "ring")]
    groups += [(1, [lines[1]], "outer")] if dim == 2 else [(2, [made[3][1]], "outer")]
    for d, tags, name in groups:
        gmsh.model.addPhysicalGroup(d, tags, name=name)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
    gmsh.model.mesh.generate(dim)
    gmsh.model.mesh.setOrder(2)


@pytest.mark.mpi
@pytest.mark.parametrize("dim", [2, 3])
def test_cells_without_centre_nodes_are_completed(dim: int) -> None:
    """The new nodes lie where gmsh itself puts those of complete cells, but for the centres of
    curved faces, which the shape functions of the incomplete cell leave a little elsewhere."""
    found = []
    for incomplete in (1, 0):
        with on_root(MPI.COMM_WORLD, lambda g, i=incomplete: quarter_ring(g, dim, i)) as gmsh:
            mesh = mesh_from_gmsh(None if gmsh is None else gmsh.model)
        x = mesh.domain.geometry
        owned = x.x[: x.index_map().size_local]
        everywhere = np.concatenate(mesh.comm.allgather(owned))
        found.append(everywhere[np.lexsort(everywhere.round(6).T)])
        assert mesh.order == 2
        assert size(mesh, "ring") == 2**dim
        assert size(mesh, "outer") == 2 ** (dim - 1)
    assert len(found[0]) == len(found[1]) == 5**dim
    # nodes of the two meshes beside each other; the sagitta of an edge is 8 % of the radius
    distance = np.linalg.norm(found[0][:, None] - found[1][None], axis=2).min(axis=1)
    assert distance.max() < 0.02
    assert np.sum(distance < 1e-9) >= 5**dim - (4 if dim == 2 else 4 * 3 + 8)
