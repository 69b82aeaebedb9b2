"""A whole mesh as numpy arrays on one rank, before it is distributed.

gmsh is read into a :class:`RawMesh`, surfaces are split in it, faults of the input are found in it;
then :func:`fxcrack.mesh.distribute.distribute` makes the DOLFINx mesh from it. Cells hold their
nodes in DOLFINx order; of every row of nodes the corner nodes (vertices) come first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import TypeVar

import basix
import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.arrays import Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import FxcrackError, MeshError, raise_on_all_ranks

Floats = npt.NDArray[np.float64]

T = TypeVar("T")

_CHUNK = 50_000
_FLAT = 1e-10


@dataclass(frozen=True)
class RawGroup:
    """A named set of entities below the cells, given by their nodes.

    Attributes:
        dim: Topological dimension of the entities.
        rows: Nodes of each entity, vertices first, shape (n_entities, n_entity_nodes).
    """

    dim: int
    rows: Ints


@dataclass(frozen=True)
class RawMesh:
    """Points, cells and named groups, whole, on one rank.

    Attributes:
        cell: Cell shape: triangle, quadrilateral, tetrahedron or hexahedron.
        order: Order of the geometry, 1 or 2.
        points: Coordinates (length), one row per node used by a cell, shape (n_nodes, gdim).
        cells: Nodes of each cell in DOLFINx order, shape (n_cells, n_cell_nodes).
        cell_groups: Indices of the cells of each named group of cells.
        groups: Named groups of facets, edges and nodes.
        joints: Nodes that smooth parts of a surface have of their own where they meet, and the
            number of their joint, sorted by it, shape (n_nodes, 2).
    """

    cell: str
    order: int
    points: Floats
    cells: Ints
    cell_groups: dict[str, Ints] = field(default_factory=dict)
    groups: dict[str, RawGroup] = field(default_factory=dict)
    joints: Ints = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))

    @property
    def tdim(self) -> int:
        """Topological dimension of the cells."""
        return len(basix.topology(basix.CellType[self.cell])) - 1

    @property
    def gdim(self) -> int:
        """Geometric dimension; larger than that of the cells in a surface mesh."""
        return int(self.points.shape[1])

    @property
    def names(self) -> list[str]:
        """Names of all groups."""
        return [*self.cell_groups, *self.groups]

    def n_vertices(self, dim: int) -> int:
        """Number of vertices of an entity of dimension ``dim``."""
        return len(basix.topology(basix.CellType[self.cell])[dim][0])

    def n_entity_nodes(self, dim: int) -> int:
        """Number of nodes of an entity of dimension ``dim``, its vertices included."""
        return len(reference(self.cell, self.order).entity_closure_dofs[dim][0])


@cache
def reference(cell: str, order: int) -> basix.finite_element.FiniteElement:
    """The Lagrange element of the geometry of a cell shape."""
    return basix.create_element(
        basix.ElementFamily.P, basix.CellType[cell], order, basix.LagrangeVariant.equispaced
    )


def vertices_of(raw: RawMesh) -> npt.NDArray[np.bool_]:
    """Which nodes are vertices of cells, shape (n_nodes,)."""
    found = np.zeros(len(raw.points), dtype=bool)
    found[raw.cells[:, : raw.n_vertices(raw.tdim)]] = True
    return found


def row_ids(rows: Ints) -> Ints:
    """Number rows so that equal rows, and only those, get the same number.

    Args:
        rows: shape (n_rows, n_columns); sort each row first where order does not matter.

    Returns:
        Numbers 0, 1, ... without gaps, in the lexicographic order of the rows, shape (n_rows,).
    """
    ids = np.zeros(len(rows), dtype=np.int64)
    if len(rows):
        order = np.lexsort(rows.T[::-1])
        changes = np.any(np.diff(rows[order], axis=0) != 0, axis=1)
        ids[order] = np.concatenate(([0], np.cumsum(changes)))
    return ids


def distinct(rows: Ints, n_vertices: int) -> tuple[Ints, Ints]:
    """Find the rows that have the same vertices as an earlier one.

    Args:
        rows: Nodes of entities, vertices first, shape (n_rows, n_columns).
        n_vertices: Number of vertices.

    Returns:
        Indices of the rows to keep, sorted, shape (n_kept,), and for every row its position among
        those kept, shape (n_rows,).
    """
    ids = row_ids(np.sort(rows[:, :n_vertices], axis=1))
    _, first = np.unique(ids, return_index=True)
    kept = np.sort(first)
    position = np.empty(len(first), dtype=np.int64)
    position[ids[kept]] = np.arange(len(kept))
    return kept.astype(np.int64), position[ids]


def check_shapes(raw: RawMesh) -> None:
    """Refuse coordinates that are not numbers and cells without volume or folded over.

    The Jacobian determinant of the geometry must keep its sign over the quadrature points of a
    cell and stay above round-off. A negative sign alone is no fault: DOLFINx uses |det J|. On a
    surface in space it is the area, with the sign of the normal against that of the first point.

    Raises:
        MeshError: Says how many cells are degenerate and where the first one is.
    """
    bad_nodes = np.flatnonzero(~np.isfinite(raw.points).all(axis=1))
    if len(bad_nodes):
        raise MeshError(
            f"{len(bad_nodes)} of {len(raw.points)} nodes have a coordinate that is not a finite "
            f"number, the first is {format_point(raw.points[bad_nodes[0]])}; mesh the model again"
        )
    points, _ = basix.make_quadrature(basix.CellType[raw.cell], 2 * raw.order)
    gradients = reference(raw.cell, raw.order).tabulate(1, points)[1:, :, :, 0]
    bad = []
    for start in range(0, len(raw.cells), _CHUNK):
        x = raw.points[raw.cells[start : start + _CHUNK]]
        jacobians = np.tensordot(x, gradients, axes=(1, 2)).transpose(0, 3, 1, 2)
        det = _determinant(jacobians)
        det *= np.sign(det[:, :1])
        flat = _FLAT * np.linalg.norm(jacobians, axis=(2, 3)).max(axis=1) ** raw.tdim
        bad.append(start + np.flatnonzero(~(det.min(axis=1) > flat)))
    found = np.concatenate(bad)
    if len(found):
        centre = raw.points[raw.cells[found[0]]].mean(axis=0)
        raise MeshError(
            f"{len(found)} of {len(raw.cells)} cells are degenerate (no volume, or folded over), "
            f"the first at {format_point(centre)}; correct the geometry there or change the "
            "element size"
        )


def _determinant(jacobians: Floats) -> Floats:
    """Signed volume or area per reference cell, shape (n_cells, n_points).

    Args:
        jacobians: shape (n_cells, n_points, gdim, tdim).
    """
    if jacobians.shape[-1] == jacobians.shape[-2]:
        return np.asarray(np.linalg.det(jacobians))
    normal = np.cross(jacobians[..., 0], jacobians[..., 1])
    area = np.linalg.norm(normal, axis=-1)
    return area * np.where(np.einsum("cpx,cx->cp", normal, normal[:, 0]) < 0.0, -1.0, 1.0)


def on_root(
    comm: MPI.Comm, work: Callable[[], T], kind: type[FxcrackError] = MeshError
) -> T | None:
    """Run ``work`` on rank 0; whatever it raises is raised on every rank; collective.

    Args:
        comm: Communicator on which all ranks call.
        work: Called on rank 0 only; must not communicate.
        kind: Class of the exception that is raised.

    Returns:
        What ``work`` returned on rank 0, ``None`` on the others.

    Raises:
        FxcrackError: ``kind`` with the message of the exception on rank 0.
    """
    result: T | None = None
    problem: str | None = None
    cause: Exception | None = None
    if comm.rank == 0:
        try:
            result = work()
        except FxcrackError as error:
            problem, cause = str(error), error
        except Exception as error:  # any exception must reach the other ranks
            problem, cause = f"{type(error).__name__} while making a mesh: {error}", error
    try:
        raise_on_all_ranks(comm, problem, kind)
    except kind as error:
        raise error from cause
    return result
