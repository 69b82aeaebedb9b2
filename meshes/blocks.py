"""Tensor-product blocks as gmsh models: exact coordinates, any spacing, any cell shape and order.

gmsh's transfinite curves know only even and geometric spacing. A block is therefore handed to gmsh
node by node and cell by cell as a discrete entity; it can be saved, shown and read as any model.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.errors import MeshError
from fxcrack.mesh import Mesh
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import RawMesh, distinct, on_root
from fxcrack.mesh.read import gmsh_model, prepare

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

_QUAD = ((0, 1, 2, 3),)
_HEX_EDGES = (
    *((0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3)),
    *((2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)),
)
_HEX_FACES = ((0, 1, 2, 3), (0, 1, 5, 4), (0, 3, 7, 4), (1, 2, 6, 5), (2, 3, 7, 6), (4, 5, 6, 7))
_TET_EDGES = ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3))
_TET_FACES = ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))
_TRI_EDGES = ((0, 1), (1, 2), (2, 0))
_QUAD_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))

# Vertices whose mean is each further node of a second-order element, in gmsh's order.
_MEANS: dict[str, tuple[tuple[int, ...], ...]] = {
    "point": (),
    "line": ((0, 1),),
    "triangle": _TRI_EDGES,
    "quadrilateral": (*_QUAD_EDGES, *_QUAD),
    "tetrahedron": _TET_EDGES,
    "hexahedron": (*_HEX_EDGES, *_HEX_FACES, tuple(range(8))),
}
# Shape and vertices of the parts of a cell, by how many dimensions they are below it.
_PARTS: dict[tuple[str, int], tuple[str, tuple[tuple[int, ...], ...]]] = {
    ("triangle", 1): ("line", _TRI_EDGES),
    ("triangle", 2): ("point", ((0,), (1,), (2,))),
    ("quadrilateral", 1): ("line", _QUAD_EDGES),
    ("quadrilateral", 2): ("point", ((0,), (1,), (2,), (3,))),
    ("tetrahedron", 1): ("triangle", _TET_FACES),
    ("tetrahedron", 2): ("line", _TET_EDGES),
    ("tetrahedron", 3): ("point", tuple((i,) for i in range(4))),
    ("hexahedron", 1): ("quadrilateral", _HEX_FACES),
    ("hexahedron", 2): ("line", _HEX_EDGES),
    ("hexahedron", 3): ("point", tuple((i,) for i in range(8))),
}
# Dimension, number of vertices, gmsh's element type in first and in second order.
_SHAPES = {
    "point": (0, 1, 15, 15),
    "line": (1, 2, 1, 8),
    "triangle": (2, 3, 2, 9),
    "quadrilateral": (2, 4, 3, 10),
    "tetrahedron": (3, 4, 4, 11),
    "hexahedron": (3, 8, 5, 12),
}
CELLS = {2: ("quadrilateral", "triangle"), 3: ("hexahedron", "tetrahedron")}
_ON_GRID = 1e-9


@dataclass(frozen=True)
class Block:
    """A grid of cells along the coordinate axes.

    Attributes:
        axes: Increasing coordinates of the corner nodes along each axis (length).
        cell: Shape of the cells; triangles and tetrahedra divide each box of the grid.
        order: 1 or 2.
        mirror: Axes along which the division into triangles or tetrahedra is mirrored.
        first: Number of the block's first node in the model.
        layers: Names of groups of cells, and how many layers of boxes along the second axis
            belong to each, in their order; empty where all cells are one group.
    """

    axes: tuple[Floats, ...]
    cell: str
    order: int
    mirror: tuple[int, ...] = ()
    first: int = 0
    layers: tuple[tuple[str, int], ...] = ()

    @property
    def dim(self) -> int:
        """Dimension of the block."""
        return len(self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of nodes along each axis."""
        return tuple(self.order * (len(x) - 1) + 1 for x in self.axes)

    def points(self) -> Floats:
        """Coordinates of the nodes, shape (n_nodes, 3); the last axis runs fastest."""
        lines = []
        for x in self.axes:
            steps = np.arange(self.order * (len(x) - 1) + 1) / self.order
            lines.append(np.interp(steps, np.arange(len(x)), x))
        grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, self.dim)
        return np.pad(grid, ((0, 0), (0, 3 - self.dim)))

    def cells(self) -> Ints:
        """Nodes of the cells in gmsh order, numbered in the model, shape (n_cells, n_nodes)."""
        return self._rows(self.cell, self._boxes(), {})

    def cell_groups(self, name: str) -> dict[str, Ints]:
        """Nodes of the cells of each group; of all cells as group ``name`` without layers."""
        if not self.layers:
            return {name: self.cells()}
        found, start = {}, 0
        for group, n in self.layers:
            chosen = [None, np.arange(start, start + n), *[None] * (self.dim - 2)]
            found[group] = self._rows(self.cell, self._boxes(chosen), {})
            start += n
        return found

    def part(self, **at: float) -> tuple[str, Ints]:
        """The facets, edges or nodes where coordinates have given values.

        Args:
            at: Values by axis, named x, y, z; two of them pick the edges of a 3-D block on a line.

        Returns:
            Shape of the entities, and their nodes in gmsh order, shape (n_entities, n_nodes).

        Raises:
            MeshError: The grid has no nodes at such a value.
        """
        sides: dict[int, int] = {}
        layers: list[Ints | None] = [None] * self.dim
        for label, value in at.items():
            axis = "xyz".index(label)
            x = self.axes[axis]
            i = int(np.argmin(np.abs(x - value)))
            if abs(x[i] - value) > _ON_GRID * np.ptp(x):
                raise MeshError(
                    f"the mesh has no corner nodes at {label} = {value:g}, the nearest are at "
                    f"{x[i]:g}; change the spacing so that there are"
                )
            sides[axis] = int(i == len(x) - 1)
            layers[axis] = np.array([i - sides[axis]])
        shape = _PARTS[self.cell, len(at)][0]
        rows = self._rows(shape, self._boxes(layers), sides)
        # Tetrahedra of one box share edges.
        return shape, rows[distinct(rows, _SHAPES[shape][1])[0]]

    def _boxes(self, layers: Sequence[Ints | None] = ()) -> Ints:
        """First node of each box of the grid, of chosen layers along some axes."""
        layers = layers or [None] * self.dim
        indices = [
            np.arange(len(x) - 1) if chosen is None else chosen
            for x, chosen in zip(self.axes, layers, strict=True)
        ]
        corner = np.meshgrid(*(self.order * i for i in indices), indexing="ij")
        first = np.ravel_multi_index([c.ravel() for c in corner], self.shape)
        return first.astype(np.int64)

    def _rows(self, shape: str, boxes: Ints, sides: dict[int, int]) -> Ints:
        """Nodes of the entities of a shape on given sides of the boxes, in gmsh order."""
        strides = np.array([int(np.prod(self.shape[a + 1 :])) for a in range(self.dim)])
        offsets = []
        for vertices in _entities(self.cell, self.dim, self.mirror, sides):
            between = _MEANS[shape] if self.order == 2 else ()
            means = [vertices[list(chosen)].mean(axis=0) for chosen in between]
            places = self.order * np.vstack([vertices, *means])
            offsets.append(np.rint(places).astype(np.int64) @ strides)
        rows: Ints = self.first + boxes[:, None, None] + np.array(offsets)[None]
        return rows.reshape(-1, rows.shape[-1])


@dataclass
class Blocks:
    """Blocks and named groups of one gmsh model, all of one cell shape and order.

    Attributes:
        blocks: The blocks by the names of their groups of cells, in the order of their nodes.
        groups: Shape and nodes of the parts of each named group of facets, edges or nodes.
    """

    blocks: dict[str, Block] = field(default_factory=dict)
    groups: dict[str, list[tuple[str, Ints]]] = field(default_factory=dict)

    def add(
        self,
        name: str,
        axes: Sequence[npt.ArrayLike],
        cell: str,
        order: int,
        mirror: tuple[int, ...] = (),
        layers: tuple[tuple[str, int], ...] = (),
    ) -> Block:
        """Add a block whose cells are the group ``name``, or those of its layers.

        Raises:
            MeshError: A cell shape or order that does not exist in this dimension.
        """
        if cell not in CELLS[len(axes)] or order not in (1, 2):
            raise MeshError(
                f"cells must be {' or '.join(CELLS[len(axes)])} of order 1 or 2, not "
                f"'{cell}' of order {order}"
            )
        first = sum(int(np.prod(b.shape)) for b in self.blocks.values())
        lines = tuple(np.asarray(x, dtype=float) for x in axes)
        self.blocks[name] = Block(lines, cell, order, mirror, first, layers)
        return self.blocks[name]

    def group(self, name: str, *parts: tuple[str, Ints]) -> None:
        """Name parts of blocks, all of one shape; a name used before gets these parts as well."""
        self.groups.setdefault(name, []).extend(parts)

    def write(self, model: Any) -> None:
        """Put blocks and groups into the current gmsh model."""
        order = 1
        tag = 0
        for name, block in self.blocks.items():
            order = block.order
            points = block.points()
            nodes = 1 + block.first + np.arange(len(points))
            kind = _SHAPES[block.cell][1 + order]
            for i, (group, cells) in enumerate(block.cell_groups(name).items()):
                tag += 1
                model.addDiscreteEntity(block.dim, tag)
                if i == 0:  # all groups of a block share its nodes
                    model.mesh.addNodes(block.dim, tag, nodes, points.ravel())
                model.mesh.addElementsByType(tag, kind, [], 1 + cells.ravel())
                model.addPhysicalGroup(block.dim, [tag], name=group)
        for name, parts in self.groups.items():
            tags = []
            for shape, rows in parts:
                dim = _SHAPES[shape][0]
                tags.append(model.addDiscreteEntity(dim))
                kind = _SHAPES[shape][1 + order]
                model.mesh.addElementsByType(tags[-1], kind, [], 1 + rows.ravel())
            model.addPhysicalGroup(dim, tags, name=name)


def build(
    comm: MPI.Comm, name: str, make: Callable[[], Blocks], out: str | Path | None = None
) -> Mesh:
    """Make the mesh of blocks, and write it to a .msh file if asked to; collective.

    Args:
        comm: Communicator to distribute the mesh over.
        name: What messages and files call the mesh.
        make: Makes the blocks; called on rank 0.
        out: File to write as well, ``None`` for none.

    Raises:
        MeshError: What ``make`` raised on rank 0, or the file cannot be written.
    """

    def work() -> RawMesh:
        blocks = make()
        with gmsh_model(name) as gmsh:
            blocks.write(gmsh.model)
            if out is not None:
                _save(gmsh, Path(out))
            return prepare(gmsh.model, name)

    return distribute(on_root(comm, work), comm, name)


def _save(gmsh: Any, path: Path) -> None:
    """Write the current model, whole or not at all."""
    if path.suffix != ".msh":
        raise MeshError(f"cannot write the mesh to '{path}': the name must end in .msh")
    if not path.parent.is_dir():
        raise MeshError(f"cannot write '{path}': there is no folder '{path.parent}'; make it first")
    draft = path.with_name(f".{path.stem}-{os.getpid()}.msh")
    try:
        gmsh.write(str(draft))
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def _entities(cell: str, dim: int, mirror: tuple[int, ...], sides: dict[int, int]) -> list[Floats]:
    """Vertices, in the unit box, of its cells or of their parts on given sides of the box."""
    found = []
    for vertices in _division(cell, dim, mirror):
        parts = _PARTS[cell, len(sides)][1] if sides else (tuple(range(len(vertices))),)
        for part in parts:
            chosen = vertices[list(part)]
            if all(np.all(chosen[:, axis] == side) for axis, side in sides.items()):
                found.append(chosen)
    return found


def _division(cell: str, dim: int, mirror: tuple[int, ...]) -> list[Floats]:
    """Vertices of the cells that make up the unit box, in gmsh order, positively oriented."""
    if cell in ("quadrilateral", "hexahedron"):
        square = [(0, 0), (1, 0), (1, 1), (0, 1)]
        corners = square if dim == 2 else [(*p, z) for z, p in product((0, 1), square)]
        return [np.array(corners, dtype=float)]
    cells = []
    for path in permutations(range(dim)):
        # Along the axes in this order from one corner of the box to the opposite one.
        vertices = np.vstack((np.zeros(dim), np.cumsum(np.eye(dim)[list(path)], axis=0)))
        for axis in mirror:
            vertices[:, axis] = 1 - vertices[:, axis]
        if np.linalg.det(vertices[1:] - vertices[0]) < 0:
            vertices[[-2, -1]] = vertices[[-1, -2]]
        cells.append(vertices)
    return cells
