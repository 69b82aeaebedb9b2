"""Named groups on a DOLFINx mesh the user has made, from markers or arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fxcrack.base.checks import check_instance, text

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import dolfinx.la
import dolfinx.mesh
import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.errors import MeshError, raise_on_all_ranks
from fxcrack.base.positions import marks_at
from fxcrack.mesh.mesh import Group, Mesh
from fxcrack.mesh.raw import RawMesh, check_shapes

Marker = Callable[[npt.NDArray[np.float64]], npt.NDArray[np.bool_]]


def mesh_from_domain(
    domain: dolfinx.mesh.Mesh,
    groups: Mapping[str, tuple[int, Marker | npt.ArrayLike]],
    *,
    name: str = "mesh",
) -> Mesh:
    """Give a DOLFINx mesh named groups; collective.

    Args:
        domain: The mesh. Make it with ghost mode ``shared_facet`` where facets inside it count.
        groups: For each name the dimension of the entities and either a function of position
            (``x`` of shape (3, n_points) to booleans, an entity is in where all its vertices are)
            or local entity indices. An entity that one rank names is in on every rank that sees it.
        name: What messages and files call the mesh.

    Raises:
        MeshError: Names or dimensions differ between ranks or an index is out of range.

    Example:
        ``mesh_from_domain(domain, {"left": (1, lambda x: np.isclose(x[0], 0.0))})``
    """
    comm = compat.plain_comm(domain.comm)
    tdim = domain.topology.dim
    asked = [(key, int(dim)) for key, (dim, _) in groups.items()]
    problem = None
    wrong = [key for key, dim in asked if not 0 <= dim <= tdim]
    if wrong:
        problem = (
            f"group '{wrong[0]}' has dimension {dict(asked)[wrong[0]]}; a mesh of {tdim}-D cells "
            f"has entities of dimension 0 (nodes) to {tdim} (cells)"
        )
    if any(other != asked for other in comm.allgather(asked)):
        problem = "the ranks name different groups; pass the same names and dimensions on each"
    raise_on_all_ranks(comm, _headed(name, problem), MeshError)

    raise_on_all_ranks(comm, _headed(name, _geometry_fault(domain)), MeshError)

    found: dict[str, Group] = {}
    for key, (dim, choice) in groups.items():
        domain.topology.create_entities(dim)
        domain.topology.create_connectivity(dim, tdim)
        domain.topology.create_connectivity(dim, 0)
        if callable(choice):
            entities = _marked(comm, domain, dim, name, key, choice)
        else:
            entities = np.asarray(choice)
            raise_on_all_ranks(comm, _headed(name, _fault(domain, key, dim, entities)), MeshError)
        found[key] = Group(dim, _on_all_ranks(domain, dim, entities))
    return Mesh(domain, found, name)


def from_dolfinx(
    domain: dolfinx.mesh.Mesh,
    cell_tags: dolfinx.mesh.MeshTags | None = None,
    facet_tags: dolfinx.mesh.MeshTags | None = None,
    names: Mapping[str, tuple[int, int]] | None = None,
    *,
    name: str = "mesh",
) -> Mesh:
    """A DOLFINx mesh whose tagged cells and facets become named groups; collective.

    Args:
        domain: The mesh. Make it with ghost mode ``shared_facet`` where facets inside it count.
        cell_tags: Tags of cells.
        facet_tags: Tags of facets.
        names: Dimension and tag of each named group, as ``physical_groups`` of DOLFINx' gmsh
            reader; tags without a name are called ``group_<dimension>_<tag>``.
        name: What messages and files call the mesh.

    Raises:
        MeshError: A name belongs to no tag, or as :func:`mesh_from_domain`.

    Example:
        ``from_dolfinx(domain, facet_tags=tags, names={"left": (1, 3), "right": (1, 4)})``
    """
    check_instance("from_dolfinx", "domain", domain, dolfinx.mesh.Mesh, "create_rectangle(...)")
    text("from_dolfinx", "name", name)
    for argument, given in (("cell_tags", cell_tags), ("facet_tags", facet_tags)):
        if given is not None:
            what = dolfinx.mesh.MeshTags
            check_instance("from_dolfinx", argument, given, what, "meshtags(...)")
    comm = compat.plain_comm(domain.comm)
    tdim = domain.topology.dim
    tags = {tdim: cell_tags, tdim - 1: facet_tags}
    found: dict[tuple[int, int], npt.NDArray[np.int32]] = {}
    for dim, marks in tags.items():
        values = np.zeros(0, np.int32) if marks is None else np.asarray(marks.values)
        for tag in sorted(set().union(*comm.allgather(set(values.tolist())))):
            found[dim, tag] = np.asarray(marks.indices)[values == tag] if marks else values[:0]
    titles = {}
    for title, (dim, tag) in (names or {}).items():
        if (dim, tag) not in found:
            known = ", ".join(map(str, found)) or "none"
            raise MeshError(
                f"mesh '{name}': '{title}' means tag {tag} of dimension {dim}, but there is none; "
                f"known (dimension, tag): {known}"
            )
        titles[dim, tag] = title
    groups = {titles.get(key, f"group_{key[0]}_{key[1]}"): (key[0], e) for key, e in found.items()}
    return mesh_from_domain(domain, groups, name=name)


def _marked(
    comm: MPI.Intracomm, domain: dolfinx.mesh.Mesh, dim: int, name: str, key: str, marker: Marker
) -> npt.NDArray[np.int32]:
    """Entities at whose vertices a user's function is true; collective."""
    problem: str | None = None

    def marks(x: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        nonlocal problem
        try:
            return marks_at(f"mesh '{name}'", f"group '{key}'", marker, x.T, error=MeshError)
        except MeshError as error:  # on this rank, perhaps: said by all ranks below
            problem = str(error)
            return np.zeros(x.shape[1], dtype=bool)

    entities = dolfinx.mesh.locate_entities(domain, dim, marks)
    raise_on_all_ranks(comm, problem, MeshError)
    return np.asarray(entities)


def _headed(name: str, problem: str | None) -> str | None:
    """The problem with the mesh it is about."""
    return problem and f"mesh '{name}': {problem}"


def _geometry_fault(domain: dolfinx.mesh.Mesh) -> str | None:
    """What is wrong with the nodes and cells of this rank."""
    geometry, cells = domain.geometry, compat.geometry_dofmap(domain)
    if not len(cells):
        return None
    cell, order = domain.topology.cell_name(), int(compat.coordinate_map(domain).degree)
    raw = RawMesh(cell, order, geometry.x[:, : geometry.dim], np.asarray(cells, np.int64))
    try:
        check_shapes(raw)
    except MeshError as error:
        return str(error)
    return None


def _fault(
    domain: dolfinx.mesh.Mesh, key: str, dim: int, entities: npt.NDArray[np.generic]
) -> str | None:
    """What is wrong with an array of entity indices on this rank."""
    index_map = domain.topology.index_map(dim)
    n_local = index_map.size_local + index_map.num_ghosts
    if entities.ndim != 1 or not (np.issubdtype(entities.dtype, np.integer) or not entities.size):
        return (
            f"group '{key}' needs a one-dimensional array of integers, got {entities.dtype} of "
            f"shape {entities.shape}; np.flatnonzero makes one from a mask"
        )
    if entities.size and not (0 <= int(entities.min()) and int(entities.max()) < n_local):
        return (
            f"group '{key}' holds index {int(entities.max())}, but rank {domain.comm.rank} has "
            f"entities 0 to {n_local - 1} of dimension {dim}; pass local indices"
        )
    return None


def _on_all_ranks(
    domain: dolfinx.mesh.Mesh, dim: int, entities: npt.NDArray[np.generic]
) -> npt.NDArray[np.int32]:
    """The marked entities, owned and ghost, sorted, the same seen from every rank."""
    marks = dolfinx.la.vector(domain.topology.index_map(dim), dtype=np.int32)
    marks.array[:] = 0
    marks.array[entities.astype(np.int32)] = 1
    marks.scatter_reverse(dolfinx.la.InsertMode.add)
    marks.scatter_forward()
    return np.flatnonzero(marks.array).astype(np.int32)
