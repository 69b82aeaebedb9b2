"""What differs between DOLFINx 0.9, 0.10 and 0.11, behind one function each.

Found out by asking the library (``hasattr``, ``inspect``), never by version number. Imported before
``dolfinx`` everywhere: the binary wheel must load its MPI and PETSc first.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
from typing import Any

from fxcrack.base import requirements  # isort: skip  # noqa: F401  (says what is missing)
import numpy as np
import numpy.typing as npt

if importlib.util.find_spec("dolfinx_solver") is not None:
    importlib.import_module("dolfinx_solver")

import basix.ufl
import dolfinx.cpp
import dolfinx.graph
import dolfinx.io.utils
import dolfinx.jit
import dolfinx.mesh
from mpi4py import MPI
from petsc4py import PETSc

_COMPILING = 60
"""Seconds one job waits for another that compiles the same form; DOLFINx' 10 are too few for a
3-D form on a busy machine. A user's dolfinx_jit_options.json has precedence."""


def _wait_for_other_jobs() -> None:
    """Let jobs that start together share the cache of compiled forms."""
    options = getattr(dolfinx.jit, "DOLFINX_DEFAULT_JIT_OPTIONS", {})
    if "timeout" in options:
        options["timeout"] = (max(options["timeout"][0], _COMPILING), options["timeout"][1])


_wait_for_other_jobs()


def plain_comm(comm: MPI.Intracomm) -> MPI.Intracomm:
    """The predefined communicator with the same ranks in the same order, if there is one.

    DOLFINx and PETSc free their duplicates when their last object dies. mpi4py attaches a lock to
    a communicator on which Python objects were sent, and its callback cannot run while an exception
    is on its way: the process would hang. So fxcrack sends on communicators that are never freed.
    """
    for known in (MPI.COMM_WORLD, MPI.COMM_SELF):
        if MPI.Comm.Compare(comm, known) in (MPI.IDENT, MPI.CONGRUENT):
            return known
    return comm


def coordinate_element(cell_name: str, degree: int, gdim: int) -> Any:
    """Equispaced vector Lagrange element of a mesh's geometry, for :func:`create_mesh`."""
    variant = basix.LagrangeVariant.equispaced
    return basix.ufl.element("P", cell_name, degree, variant, shape=(gdim,), dtype=np.float64)


def create_mesh(
    comm: MPI.Comm,
    cells: npt.NDArray[np.int64],
    x: npt.NDArray[np.float64],
    element: Any,
    *,
    max_facet_to_cell_links: int = 2,
) -> dolfinx.mesh.Mesh:
    """Distribute a mesh so that the owner of a facet has the cells of both sides; collective.

    Args:
        comm: Communicator of the mesh.
        cells: Global nodes of this rank's input cells, DOLFINx order, shape (n_cells, n_nodes).
        x: Coordinates of this rank's input nodes, shape (n_nodes, gdim).
        element: Geometry element from :func:`coordinate_element`.
        max_facet_to_cell_links: Most cells that meet at one facet.

    Raises:
        ValueError: This DOLFINx does not know facets of more than two cells.
    """
    links = {"max_facet_to_cell_links": max_facet_to_cell_links}
    if "max_facet_to_cell_links" not in inspect.signature(dolfinx.mesh.create_mesh).parameters:
        if max_facet_to_cell_links != 2:
            raise ValueError("facets of more than two cells need DOLFINx 0.10 or newer")
        links = {}
    shared_facet = dolfinx.mesh.GhostMode.shared_facet
    partitioner = dolfinx.mesh.create_cell_partitioner(shared_facet, *links.values())
    return dolfinx.mesh.create_mesh(
        comm=comm, cells=cells, x=x, e=element, partitioner=partitioner, **links
    )


def distribute_entity_data(
    domain: dolfinx.mesh.Mesh, dim: int, entities: npt.NDArray[np.int64], values: npt.NDArray[Any]
) -> tuple[npt.NDArray[np.int32], npt.NDArray[Any]]:
    """Send values on mesh entities from the rank that read them to all that have them; collective.

    Args:
        domain: The mesh.
        dim: Topological dimension of the entities.
        entities: All nodes of each entity, global input indices, DOLFINx order, shape (n, n_nodes).
        values: One integer (kept as 32 bits) or one float per entity, shape (n,).

    Returns:
        Local vertices of each entity all of whose vertices this rank has, shape (n_local,
        n_vertices), and its value. Some may be cells or edges of other ranks only, for which
        :func:`entities_from_vertices` gives -1.
    """
    kind = np.int32 if np.issubdtype(np.asarray(values).dtype, np.integer) else np.float64
    vertices, local = dolfinx.io.utils.distribute_entity_data(
        domain, dim, np.ascontiguousarray(entities, np.int64), np.ascontiguousarray(values, kind)
    )
    return vertices, local


def entities_from_vertices(
    domain: dolfinx.mesh.Mesh, dim: int, vertices: npt.NDArray[np.int32]
) -> npt.NDArray[np.int32]:
    """Find mesh entities by their vertices; collective, as missing entities are made.

    Args:
        domain: The mesh.
        dim: Topological dimension of the entities.
        vertices: Local vertices of each entity, any order, no entity twice, shape (n, n_vertices).

    Returns:
        Local index of each entity, -1 where these vertices make none, shape (n,).
    """
    domain.topology.create_entities(dim)
    domain.topology.create_connectivity(dim, 0)
    links = dolfinx.graph.adjacencylist(np.ascontiguousarray(vertices, np.int32))
    position = np.arange(len(vertices), dtype=np.int32)
    tags = dolfinx.mesh.meshtags_from_entities(domain, dim, links, position)
    found = np.full(len(vertices), -1, np.int32)
    found[tags.values] = tags.indices
    return found


def geometry_of_entities(
    domain: dolfinx.mesh.Mesh, dim: int, entities: npt.NDArray[np.int32]
) -> npt.NDArray[np.int32]:
    """Geometry nodes of entities, shape (n, k): corners first.

    DOLFINx 0.9 divides by the number of entities, so that a rank without any ends in a signal.
    """
    if not len(entities):
        return np.zeros((0, dim + 1), dtype=np.int32)
    return np.asarray(dolfinx.mesh.entities_to_geometry(domain, dim, entities))


def coordinate_map(domain: dolfinx.mesh.Mesh) -> Any:
    """Coordinate element of a mesh of one cell type (``degree``, ``create_dof_layout()``)."""
    geometry = domain.geometry
    return geometry.cmaps[0] if hasattr(geometry, "cmaps") else geometry.cmap


def geometry_dofmap(domain: dolfinx.mesh.Mesh) -> npt.NDArray[np.int32]:
    """Geometry nodes of the cells of this rank, ghosts included, shape (n_cells, n_nodes)."""
    geometry = domain.geometry
    return np.asarray(geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap)


def original_cell_index(domain: dolfinx.mesh.Mesh) -> npt.NDArray[np.int64]:
    """Position of each local cell among the cells given to :func:`create_mesh`, rank after rank.

    Returns:
        Positions, ghosts included, shape (n_cells,).
    """
    return np.asarray(domain.topology.original_cell_index)


def gmsh_cell_permutation(cell: dolfinx.mesh.CellType, num_nodes: int) -> npt.NDArray[np.intp]:
    """Array p, shape (num_nodes,), that takes gmsh nodes into DOLFINx order: ``nodes[p]``."""
    return np.asarray(dolfinx.cpp.io.perm_gmsh(cell, num_nodes), np.intp)


def interpolation_points(space_or_element: Any) -> npt.NDArray[np.float64]:
    """Reference points at which a space or an element interpolates, shape (n_points, tdim)."""
    points = getattr(space_or_element, "element", space_or_element).interpolation_points
    return np.asarray(points() if callable(points) else points)


def create_vector(form_or_space: Any) -> PETSc.Vec:
    """Zero ghosted vector of a function space or of a compiled linear form on it; collective."""
    space = getattr(form_or_space, "function_spaces", [form_or_space])[0]
    dofmap = space.dofmap
    layout, bs = dofmap.index_map, dofmap.index_map_bs
    size = (layout.size_local * bs, layout.size_global * bs)
    ghosts = layout.ghosts.astype(PETSc.IntType)
    return PETSc.Vec().createGhost(ghosts, size, bsize=bs, comm=space.mesh.comm)
