"""Which way the thickness runs through the cells of a continuum shell.

Cells are hexahedra between a named bottom and a named top. From the bottom faces on, each cell is
entered through one face and left through the opposite one, column by column, until the top is
reached. The numbering of a cell's nodes is free: each cell has its own thickness axis.
"""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import dolfinx.la
import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError, raise_on_all_ranks
from fxcrack.mesh import Mesh

_AXIS = np.array([2, 1, 0, 0, 1, 2])
"""Reference axis across each facet of a hexahedron; facet 5 - f is opposite to facet f."""
_SHOWN = 3
"""Cells that a message names."""


@dataclass(frozen=True)
class Stacking:
    """The thickness direction in the cells of a group, as this rank sees it.

    Attributes:
        cells: Local cells, owned and ghost, shape (n_cells,).
        axis: Reference axis across the thickness, 0 to 2, shape (n_cells,).
        up: Whether that axis runs from the bottom to the top, shape (n_cells,).
        layer: Number of the cell from the bottom, from 0, shape (n_cells,).
        n_layers: Cells over the thickness.
    """

    cells: Ints
    axis: Ints
    up: Bools
    layer: Ints
    n_layers: int


def find_stacking(
    mesh: Mesh, cells: npt.NDArray[np.integer], bottom: str, top: str, name: str
) -> Stacking:
    """Follow the columns of cells from the bottom to the top; collective.

    Args:
        mesh: Hexahedra.
        cells: Local cells of the group, owned and ghost.
        bottom: Facet group below the cells.
        top: Facet group above them.
        name: What messages call the cells.

    Raises:
        InputError: The cells are no hexahedra or do not all lie in columns of one number of cells
            between bottom and top; the message names some that do not.
    """
    topology = mesh.domain.topology
    if topology.cell_name() != "hexahedron":
        raise InputError(
            f"ContinuumShell of '{name}': its cells must be hexahedra, and mesh '{mesh.name}' "
            f"has cells of kind {topology.cell_name()}; recombine the mesh, or use solid materials"
        )
    topology.create_entities(2)
    topology.create_connectivity(3, 2)
    topology.create_connectivity(2, 3)
    columns = _Columns(mesh, cells, name)
    lowest, highest = (columns.marked(mesh.group(g, dim=2).entities) for g in (bottom, top))
    columns.climb(lowest, highest, bottom)
    columns.check(lowest, highest, bottom, top)
    return Stacking(
        columns.cells,
        _AXIS[columns.low],
        columns.low < 3,
        columns.layer,
        columns.n_layers,
    )


class _Columns:
    """Cells of one group on their way up.

    Attributes:
        cells: Local cells, owned and ghost.
        low: Local facet through which a cell is entered, shape (n_cells,), -1 before.
        layer: Number of the cell from the bottom, -1 before.
        n_layers: Most cells of a column.
    """

    def __init__(self, mesh: Mesh, cells: npt.NDArray[np.integer], name: str) -> None:
        topology = mesh.domain.topology
        self._mesh, self._name = mesh, name
        self.cells = np.asarray(cells, dtype=np.int64)
        self._owned = self.cells < topology.index_map(3).size_local
        self._facets = np.asarray(topology.connectivity(3, 2).array).reshape(-1, 6)[self.cells]
        self.low = np.full(len(self.cells), -1)
        self.layer = np.full(len(self.cells), -1)
        self.n_layers = 0

    def marked(self, facets: npt.NDArray[np.int32]) -> Bools:
        """Facets of this rank that any rank names, shape (n_facets,)."""
        marks = dolfinx.la.vector(self._mesh.domain.topology.index_map(2), dtype=np.int32)
        marks.array[:] = 0
        marks.array[facets] = 1
        marks.scatter_reverse(dolfinx.la.InsertMode.add)
        marks.scatter_forward()
        return np.asarray(marks.array > 0)

    def climb(self, front: Bools, highest: Bools, bottom: str) -> None:
        """Enter cells through the facets of a front, and go on through their opposite facets."""
        comm = self._mesh.comm
        while True:
            hit = front[self._facets] & (self.layer < 0)[:, None]
            entered = np.bincount(self._facets[hit], minlength=len(front))
            wrong = (hit.sum(axis=1) > 1) | (entered[self._facets] > 1).any(axis=1)
            self._refuse(
                wrong,
                "are reached from several sides: "
                f"'{bottom}' must lie on one side of the cells alone, each cell have one face on "
                "it or on the cell below, and the faces lie at the border of the group",
            )
            new = hit.any(axis=1)
            if not comm.allreduce(int((new & self._owned).sum())):
                return
            self.low[new] = np.argmax(hit[new], axis=1)
            self.layer[new] = self.n_layers
            self.n_layers += 1
            above = self._facets[new, 5 - self.low[new]]
            front = self.marked(above[~highest[above]].astype(np.int32))

    def check(self, lowest: Bools, highest: Bools, bottom: str, top: str) -> None:
        """Refuse cells that lie in no complete column."""
        each = np.arange(len(self.cells))
        self._refuse(
            self.layer < 0,
            f"are in no column of cells that begins at '{bottom}'; name all faces below the group "
            "there, or give these cells a material of their own",
        )
        above = self._facets[each, 5 - self.low]
        below = self.marked(self._facets[each, self.low].astype(np.int32))
        self._refuse(
            ~highest[above] & ~below[above],
            f"end below no face of '{top}'; name all faces above the group there",
        )
        sides = np.ones((len(each), 6), dtype=bool)
        sides[each, self.low] = sides[each, 5 - self.low] = False
        self._refuse(
            (sides & (lowest | highest)[self._facets]).any(axis=1),
            f"have a side face in '{bottom}' or '{top}'; these must hold the faces across the "
            "thickness alone",
        )
        self._refuse(
            highest[above] & (self.layer != self.n_layers - 1),
            f"end a column of fewer cells than the {self.n_layers} of others; give columns of "
            "different numbers of cells groups and materials of their own",
        )

    def _refuse(self, wrong: Bools, why: str) -> None:
        """Raise on all ranks where cells are wrong; collective."""
        comm = self._mesh.comm
        found = np.flatnonzero(wrong & self._owned)
        nodes = compat.geometry_dofmap(self._mesh.domain)[self.cells[found[:_SHOWN]]]
        centres: Array = self._mesh.domain.geometry.x[nodes].mean(axis=1)
        n_wrong = comm.allreduce(len(found))
        where = ", ".join(format_point(x) for x in centres)
        raise_on_all_ranks(
            comm,
            f"ContinuumShell of '{self._name}': {n_wrong} of its cells, about {where}, {why}"
            if len(found)
            else None,
        )


__all__ = ["Stacking", "find_stacking"]
