"""Cells of the bodies around a crack front, the same on every rank."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import basix
import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints


@dataclass(frozen=True)
class FrontCells:
    """Some cells, each of them once, in the order of the input.

    Attributes:
        kind: Cell type by its name in basix.
        order: Order of the displacement.
        geometry: Positions of the geometry nodes, shape (n_cells, n_geometry, gdim) [length].
        nodes: Global displacement nodes, corners first, shape (n_cells, n_nodes).
        part: Number of the part of the continuum, shape (n_cells,).
        outer: Whether each facet is one of the boundary, shape (n_cells, n_facets).
        temperatures: Values of the temperature patterns on their own element, shape (n_cells,
            n_patterns, n_values); no pattern where there is no temperature.
        nodal_temperatures: Of the patterns at the displacement nodes, shape (n_cells, n_patterns,
            n_nodes).
        marks: Whether each of some cell groups holds the cell, shape (n_cells, n_groups).
    """

    kind: str
    order: int
    geometry: Array
    nodes: Ints
    part: Ints
    outer: Bools
    temperatures: Array
    nodal_temperatures: Array
    marks: Bools

    @property
    def cell_type(self) -> basix.CellType:
        """Cell type in basix."""
        return getattr(basix.CellType, self.kind)

    @property
    def n_corners(self) -> int:
        """Corners of a cell; their nodes come first in its row."""
        return len(basix.geometry(self.cell_type))

    @cached_property
    def corners(self) -> Array:
        """Positions of the corners, shape (n_cells, n_corners, gdim) [length]."""
        return self.geometry[:, : self.n_corners]

    @cached_property
    def facet_corners(self) -> Ints:
        """Corners of each facet of a cell, shape (n_facets, n_facet_corners)."""
        topology = basix.topology(self.cell_type)
        return np.array(topology[len(topology) - 2])

    def chosen(self, rows: Ints) -> FrontCells:
        """Some of the cells, those at positions of shape (m,)."""
        return FrontCells(
            self.kind,
            self.order,
            *(getattr(self, name)[rows] for name in _PER_CELL),
        )


_PER_CELL = (
    *("geometry", "nodes", "part", "outer"),
    *("temperatures", "nodal_temperatures", "marks"),
)
