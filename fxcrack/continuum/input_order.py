"""Fields of the bodies in the order of the mesh's input, whatever the ranks and their parts.

The order of nodes and points inside a cell is that of the reference cell, and the input's order of
a cell's vertices says how that lies in space. So cells in the order of the input give every value a
place of its own: nodes come in the order in which the cells name them first.
"""

from __future__ import annotations

from typing import TypeAlias

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.mesh import Mesh as Domain

from fxcrack.base.arrays import Array, Ints

Place: TypeAlias = fem.FunctionSpace | npt.NDArray[np.int32]
"""Where an array is defined: a Lagrange space (as ``x.array`` of its functions, ghosts too), or
owned cells (the same number of values for each, cell by cell)."""


class FileOrder:
    """Local arrays of a mesh into the order of its input, and back.

    Args:
        domain: The mesh.
    """

    def __init__(self, domain: Domain) -> None:
        self._comm = compat.plain_comm(domain.comm)
        self._original = compat.original_cell_index(domain)
        self._n_cells = domain.topology.index_map(domain.topology.dim).size_local
        self._known: list[tuple[Place, Ints]] = []  # places compare by identity

    def gather(self, values: Array, place: Place) -> Array:
        """The whole field on rank 0, shape (n_nodes or n_cells, values of each); collective.

        Args:
            values: Those of this rank, in the order of ``place``, node by node or cell by cell.
                Of a node only the value of its owner counts.
            place: Where they are defined.
        """
        rows = self._rows_of(place)
        if not isinstance(place, np.ndarray) and len(rows):
            owned = int(place.dofmap.index_map.size_local)
            values = values.reshape(len(rows), -1)[:owned]
            rows = rows[:owned]
        parts = [p for p in self._comm.gather((rows, values)) or [] if len(p[0])]
        if not parts:
            return np.zeros((0, 0))
        width = parts[0][1].size // len(parts[0][0])
        out = np.zeros((1 + max(int(r.max()) for r, _ in parts), width))
        for where, mine in parts:
            out[where] = mine.reshape(len(where), width)
        return out

    def scatter(self, whole: Array, place: Place) -> Array:
        """The rows of this rank out of a whole field; collective.

        Args:
            whole: From :meth:`gather`, on every rank, shape (n_nodes or n_cells, values of each).
            place: Where the values are defined.

        Returns:
            Shape (n_local_nodes or n_local_cells, values of each).
        """
        return whole[self._rows_of(place)]

    def _rows_of(self, place: Place) -> Ints:
        for known, rows in self._known:
            if known is place:
                return rows
        rows = self._cells(place) if isinstance(place, np.ndarray) else self._nodes(place)
        self._known.append((place, rows))
        return rows

    def _cells(self, cells: npt.NDArray[np.int32]) -> Ints:
        """Place of each cell among those of all ranks; collective."""
        mine = self._original[cells]
        whole = np.sort(np.concatenate(self._comm.allgather(mine)))
        return np.asarray(np.searchsorted(whole, mine))

    def _nodes(self, space: fem.FunctionSpace) -> Ints:
        """Place of each local node among all, in the order of their first cells; collective."""
        index_map, n = space.dofmap.index_map, self._n_cells
        size = index_map.size_local + index_map.num_ghosts
        nodes = index_map.local_to_global(np.arange(size, dtype=np.int32))
        parts = self._comm.gather((self._original[:n], nodes[space.dofmap.list[:n]]))
        place = np.empty(index_map.size_global, dtype=np.int64)
        if parts is not None:
            cells, named = (np.concatenate(c) for c in zip(*parts, strict=True))
            unique, first = np.unique(named[np.argsort(cells)], return_index=True)
            place[unique[np.argsort(first)]] = np.arange(len(unique))
        self._comm.Bcast(place)
        return np.asarray(place[nodes])


__all__ = ["FileOrder", "Place"]
