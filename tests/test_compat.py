"""The same answers from every supported DOLFINx, on one and on several ranks."""

from __future__ import annotations

import inspect
from itertools import permutations

import basix
import dolfinx
import dolfinx.fem.petsc
import gmsh
import numpy as np
import numpy.typing as npt
import pytest
import ufl
from mpi4py import MPI
from petsc4py import PETSc

import fxcrack as fx
from fxcrack.base import compat
from fxcrack.meshes.dcb import dcb_2d

CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
N = 3  # blocks per side

Arrays = tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]


def cell_type(name: str) -> dolfinx.mesh.CellType:
    return dolfinx.cpp.mesh.to_type(name)


def grid(name: str, degree: int) -> Arrays:
    """Cells in DOLFINx order and nodes of the block [0, N]^dim, cut into cells of one type."""
    cell = basix.CellType[name]
    variant = basix.LagrangeVariant.equispaced
    reference = basix.create_element(basix.ElementFamily.P, cell, degree, variant).points
    dim = reference.shape[1]
    maps = [np.eye(dim)]
    if name in ("triangle", "tetrahedron"):  # Kuhn's simplices: walks along the axes in each order
        maps = [np.cumsum(np.eye(dim)[list(axes)], axis=0) for axes in permutations(range(dim))]
    side = degree * N + 1
    x = np.stack(np.meshgrid(*[np.linspace(0, N, side)] * dim, indexing="ij"), -1).reshape(-1, dim)
    steps = [
        np.rint(degree * (np.array(origin) + reference @ a)).astype(np.int64)
        for origin in np.ndindex(*[N] * dim)
        for a in maps
    ]
    return np.array([np.ravel_multi_index(tuple(s.T), [side] * dim) for s in steps]), x


def build(comm: MPI.Comm, name: str, degree: int) -> tuple[dolfinx.mesh.Mesh, Arrays]:
    """Mesh of the block, its cells and nodes handed in by all ranks; and the arrays, whole."""
    cells, x = grid(name, degree)
    element = compat.coordinate_element(name, degree, x.shape[1])
    part = np.array_split(cells, comm.size)[comm.rank]
    points = np.array_split(x, comm.size)[comm.rank]
    return compat.create_mesh(comm, part, points, element), (cells, x)


@pytest.mark.quick("triangle-1", "tetrahedron-2")
@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", CELLS)
def test_cells_keep_their_nodes_and_their_place_in_the_input(
    comm: MPI.Comm, name: str, degree: int
) -> None:
    domain, (cells, x) = build(comm, name, degree)
    assert compat.coordinate_map(domain).degree == degree
    assert domain.topology.index_map(domain.topology.dim).size_global == len(cells)
    dofs = compat.geometry_dofmap(domain)
    mine = compat.original_cell_index(domain)[: len(dofs)]
    # Copied, not computed: no tolerance.
    np.testing.assert_array_equal(domain.geometry.x[dofs][..., : x.shape[1]], x[cells[mine]])


@pytest.mark.mpi
@pytest.mark.parametrize("name", CELLS)
def test_owned_facets_have_both_their_cells(comm: MPI.Comm, name: str) -> None:
    domain, (_, x) = build(comm, name, 1)
    dim = x.shape[1]
    topology = domain.topology
    topology.create_entities(dim - 1)
    topology.create_connectivity(dim - 1, dim)
    owned = topology.index_map(dim - 1).size_local
    links = topology.connectivity(dim - 1, dim)
    outside = sum(len(links.links(f)) == 1 for f in range(owned))
    per_square = 2 if name == "tetrahedron" else 1
    assert comm.allreduce(outside) == 2 * dim * N ** (dim - 1) * per_square


@pytest.mark.mpi
def test_branching_facets_are_refused_where_unknown(comm: MPI.Comm) -> None:
    # Three triangles at the edge 0-1.
    cells = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0]])
    if comm.rank > 0:
        cells, x = cells[:0], x[:0]
    element = compat.coordinate_element("triangle", 1, 3)
    if "max_facet_to_cell_links" in inspect.signature(dolfinx.mesh.create_mesh).parameters:
        domain = compat.create_mesh(comm, cells, x, element, max_facet_to_cell_links=3)
        assert domain.topology.index_map(2).size_global == 3
    else:
        with pytest.raises(ValueError, match="more than two cells"):
            compat.create_mesh(comm, cells, x, element, max_facet_to_cell_links=3)


@pytest.mark.quick("triangle-1", "tetrahedron-2")
@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", CELLS)
def test_values_on_entities_reach_every_rank_that_has_them(
    comm: MPI.Comm, name: str, degree: int
) -> None:
    domain, (cells, x) = build(comm, name, degree)
    tdim = x.shape[1]
    weights = np.array([1, 20, 400])[:tdim]  # make one number of a place
    layout = compat.coordinate_map(domain).create_dof_layout()
    for dim, kind in zip(range(tdim + 1), (int, np.int32, float, int), strict=False):
        # The first edge (facet, ...) of each cell, neighbours' common ones once.
        nodes = cells[:, layout.entity_closure_dofs(dim, 0)]
        nodes = nodes[np.unique(np.sort(nodes, axis=1), axis=0, return_index=True)[1]]
        values = (100 * x[nodes].mean(axis=1) @ weights).round().astype(kind)
        mine = slice(comm.rank, None, comm.size)
        vertices, found = compat.distribute_entity_data(domain, dim, nodes[mine], values[mine])
        entities = compat.entities_from_vertices(domain, dim, vertices)
        entities, found = entities[entities >= 0], found[entities >= 0]

        # The expected entities and values, owned and ghost, from the places of all entities.
        domain.topology.create_connectivity(dim, tdim)
        here = domain.topology.index_map(dim)
        everything = np.arange(here.size_local + here.num_ghosts, dtype=np.int32)
        middle = dolfinx.mesh.compute_midpoints(domain, dim, everything)[:, :tdim]
        place = (100 * middle @ weights).round().astype(kind)
        np.testing.assert_array_equal(np.sort(entities), everything[np.isin(place, values)])
        np.testing.assert_array_equal(found, place[entities])


@pytest.mark.mpi
def test_vertices_that_make_no_entity_are_not_found(comm: MPI.Comm) -> None:
    domain = dolfinx.mesh.create_unit_square(comm, 3, 3)
    domain.topology.create_connectivity(2, 0)
    triangle = domain.topology.connectivity(2, 0).links(0)
    pairs = np.array([triangle[:2], [triangle[0], triangle[0]], triangle[[2, 0]]], dtype=np.int32)
    found = compat.entities_from_vertices(domain, 1, pairs)
    assert found[0] >= 0
    assert found[1] == -1
    assert found[2] >= 0


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", ["interval", *CELLS])
def test_gmsh_permutation_orders_the_nodes_as_dolfinx_does(name: str, degree: int) -> None:
    family = {"interval": "line", "quadrilateral": "quadrangle"}.get(name, name)
    gmsh.initialize(readConfigFiles=False)
    try:
        code = gmsh.model.mesh.getElementType(family, degree)
        _, dim, _, count, nodes, _ = gmsh.model.mesh.getElementProperties(code)
    finally:
        gmsh.finalize()
    reference = np.array(nodes).reshape(count, dim)
    if name in ("interval", "quadrilateral", "hexahedron"):
        reference = (reference + 1) / 2  # gmsh's reference cell is [-1, 1]^dim
    element = compat.coordinate_element(name, degree, dim)
    permuted = reference[compat.gmsh_cell_permutation(cell_type(name), count)]
    # Round-off of a few operations on numbers of order one.
    np.testing.assert_allclose(permuted, element.basix_element.points, atol=1e-14)


def test_interpolation_points_of_a_lagrange_space_are_its_nodes(comm: MPI.Comm) -> None:
    domain = dolfinx.mesh.create_unit_square(comm, 2, 2)
    space = dolfinx.fem.functionspace(domain, ("P", 2, (2,)))
    nodes = basix.create_element(basix.ElementFamily.P, basix.CellType.triangle, 2).points
    for given in (space, space.element):
        np.testing.assert_array_equal(compat.interpolation_points(given), nodes)


def test_vector_of_a_form_or_a_space(comm: MPI.Comm) -> None:
    domain = dolfinx.mesh.create_unit_square(comm, 4, 4)
    space = dolfinx.fem.functionspace(domain, ("P", 1, (2,)))
    load = dolfinx.fem.form(ufl.dot(ufl.as_vector((1.0, 2.0)), ufl.TestFunction(space)) * ufl.dx)
    ghosts = space.dofmap.index_map.num_ghosts
    for given in (space, load):
        b = compat.create_vector(given)
        assert b.getBlockSize() == 2
        assert b.getSize() == 2 * 25
        assert b.norm() == 0.0
        with b.localForm() as local:
            assert local.getSize() == b.getLocalSize() + 2 * ghosts
        dolfinx.fem.petsc.assemble_vector(b, load)
        b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        # Integral of 1 + 2 over the unit square; sums of 25 numbers of order 0.1.
        assert b.sum() == pytest.approx(3.0, abs=1e-13)
        b.destroy()


@pytest.mark.mpi
def test_an_error_while_a_mesh_dies_is_raised(comm: MPI.Intracomm) -> None:
    # the mesh is only an argument of the call that fails; its communicator goes with it
    with pytest.raises(fx.InputError, match="no mode-mix law"):
        fx.Scene(
            dcb_2d(comm, dx=10.0, ny=1),
            materials=fx.Isotropic(1.0, 0.3),
            model=fx.PlaneStrain(),
            debonds=[fx.Debond(None, fx.VCCT(GIc=1.0, GIIc=2.0))],  # type: ignore[arg-type]
        )


def test_jobs_that_start_together_wait_for_each_others_forms() -> None:
    assert dolfinx.jit.get_options()["timeout"] >= 60
    assert dolfinx.jit.get_options({"timeout": 5})["timeout"] == 5
