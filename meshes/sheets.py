"""Surface meshes in space for shells: sheets given by a map from two coordinates.

Every sheet has nodes of its own, so that sheets bonded to each other are an interface, or they are
joined where their nodes are at one place. Cells and
nodes run along the first coordinate first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from fxcrack.base.errors import MeshError
from fxcrack.mesh import Mesh
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import RawGroup, RawMesh, check_shapes, on_root, reference

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Surface = Callable[[Floats, Floats], Sequence[npt.ArrayLike]]

_ON_GRID = 1e-9


@dataclass(frozen=True)
class Sheet:
    """A grid of cells over two coordinates, mapped into space.

    Groups: cells ``name``; edges ``name_a0``, ``name_a1`` (first and last a), ``name_b0``,
    ``name_b1``; nodes ``name_a0b0``, ``name_a1b0``, ``name_a0b1``, ``name_a1b1``, and ``points``.

    Attributes:
        name: Group of its cells.
        a: Increasing coordinates of the corner nodes along the first direction, shape (n,).
        b: Along the second direction, shape (m,).
        surface: Position of points a, b, each of shape (n_points,): x, y, z of that shape; the
            plane z = 0 by default. The top is the side of x,a cross x,b.
        points: Further groups of one corner node each, by name, at (a, b).
        distort: Inner corner nodes are moved by up to this part of a cell (with a fixed seed).
    """

    name: str
    a: npt.ArrayLike
    b: npt.ArrayLike
    surface: Surface = lambda a, b: (a, b, 0.0 * a)
    points: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    distort: float = 0.0


def sheets(
    parts: Sequence[Sheet],
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    cell: str = "quadrilateral",
    order: int = 1,
    joined: bool = False,
    name: str = "sheets",
) -> Mesh:
    """One mesh of several sheets; collective.

    Args:
        parts: The sheets.
        joined: Sheets meet where nodes of theirs are at one place (L and T joints of frames and
            stringers); otherwise only interfaces connect them.
        comm: Communicator to distribute the mesh over.
        cell: quadrilateral or triangle.
        order: 1, or 2 (quadrilaterals).
        name: What messages and files call the mesh.

    Raises:
        MeshError: A cell shape or order that does not exist, coordinates that do not increase, a
            point that is no corner node.
    """

    def make() -> RawMesh:
        if cell not in ("quadrilateral", "triangle") or order not in (1, 2):
            raise MeshError(f"sheets: no cells of kind '{cell}' of order {order}")
        if cell == "triangle" and order == 2:
            raise MeshError("sheets: triangles are of first order")
        points: list[Floats] = []
        cells: list[Ints] = []
        raw = RawMesh(cell, order, np.zeros((0, 3)), np.zeros((0, 0), dtype=np.int64))
        for part in parts:
            n, first = sum(len(p) for p in points), sum(len(c) for c in cells)
            x, mine = _grid(part, cell, order, n, raw)
            raw.cell_groups[part.name] = np.arange(first, first + len(mine))
            points.append(x)
            cells.append(mine)
        found = RawMesh(
            cell, order, np.concatenate(points), np.concatenate(cells), raw.cell_groups, raw.groups
        )
        check_shapes(found)
        return _merged(found) if joined else found

    return distribute(on_root(comm, make), comm, name)


def _merged(raw: RawMesh) -> RawMesh:
    """The same mesh with one node at each place."""
    size = float(np.ptp(raw.points, axis=0).max())
    near = KDTree(raw.points).query_pairs(_ON_GRID * size, output_type="ndarray")
    n = len(raw.points)
    graph = coo_array((np.ones(len(near), dtype=np.int8), (near[:, 0], near[:, 1])), (n, n))
    _, place = connected_components(graph, directed=False)
    _, first, number = np.unique(place, return_index=True, return_inverse=True)
    return replace(
        raw,
        points=raw.points[first],
        cells=number[raw.cells],
        groups={name: replace(g, rows=number[g.rows]) for name, g in raw.groups.items()},
    )


def _grid(part: Sheet, cell: str, order: int, n: int, raw: RawMesh) -> tuple[Floats, Ints]:
    """Positions and cells of a sheet whose first node is n; its groups go into ``raw``."""
    corners = [np.asarray(c, dtype=float) for c in (part.a, part.b)]
    if any(c.ndim != 1 or len(c) < 2 or np.any(np.diff(c) <= 0.0) for c in corners):
        raise MeshError(f"sheet '{part.name}': coordinates a and b must increase, two at least")
    na, nb = (len(c) - 1 for c in corners)
    number = n + np.arange((order * na + 1) * (order * nb + 1)).reshape(order * nb + 1, -1)
    grid = np.stack(np.meshgrid(*corners), axis=-1)  # row b, column a
    if part.distort:
        h = [np.diff(c).min() for c in corners]
        moves = np.random.default_rng(1).uniform(-1.0, 1.0, (na + 1, nb + 1, 2))
        grid[1:-1, 1:-1] += part.distort * moves.swapaxes(0, 1)[1:-1, 1:-1] * h
    flat = np.empty((*number.shape, 2))
    flat[::order, ::order] = grid
    if order == 2:
        flat[1::2, ::2] = 0.5 * (flat[:-1:2, ::2] + flat[2::2, ::2])
        flat[:, 1::2] = 0.5 * (flat[:, :-1:2] + flat[:, 2::2])
    a, b = flat.reshape(-1, 2).T
    x = np.stack([np.broadcast_to(np.asarray(c, float), a.shape) for c in part.surface(a, b)], 1)

    places = np.rint(order * np.asarray(reference("quadrilateral", order).points)).astype(int)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(na), np.arange(nb)))
    nodes = number[order * j[:, None] + places[:, 1], order * i[:, None] + places[:, 0]]
    if cell == "triangle":
        nodes = nodes[:, [[0, 1, 3], [0, 3, 2]]].reshape(-1, 3)
    edges = {"a0": number[:, 0], "a1": number[:, -1], "b0": number[0], "b1": number[-1]}
    for name, line in edges.items():
        rows = [line[:-1:order], line[order::order]] + ([line[1::2]] if order == 2 else [])
        raw.groups[f"{part.name}_{name}"] = RawGroup(1, np.stack(rows, axis=1))
    ends = {(0, 0): "a0b0", (0, -1): "a1b0", (-1, 0): "a0b1", (-1, -1): "a1b1"}
    for (row, column), name in ends.items():
        raw.groups[f"{part.name}_{name}"] = RawGroup(0, number[row, column].reshape(1, 1))
    size = max(np.ptp(c) for c in corners)
    for name, at in part.points.items():
        distance = np.linalg.norm(grid - np.asarray(at), axis=-1)
        row, column = divmod(int(np.argmin(distance)), distance.shape[1])
        if distance[row, column] > _ON_GRID * size:
            raise MeshError(f"sheet '{part.name}': point '{name}' at {at} is no corner node")
        raw.groups[name] = RawGroup(0, number[order * row, order * column].reshape(1, 1))
    return x, nodes


__all__ = ["Sheet", "Surface", "sheets"]
