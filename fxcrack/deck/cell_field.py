"""Values at the nodes of a deck, interpolated within its cells.

A temperature is taken at points within cells, where the value of the nearest node is another one:
in the middle of a first-order cell all of its nodes are equally near, and at the points of a
second-order one gradients would be too large by the factor sqrt(3).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before basix)
import basix
import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base.arrays import Array, Bools, Ints

_NEAREST = 8
"""Cells tried first of each point: those whose middles are the nearest."""
_SAME = 1e-12
"""Part of the size of the bodies within which a point is a node."""
_INSIDE = 1e-6
"""Reference coordinates by which points may lie outside their cell."""
_ITERATIONS = 12
_PAIRS = 2_000_000
"""Points times cells whose boxes are compared together."""


@dataclass(frozen=True, eq=False)
class CellField:
    """Values at nodes, interpolated by the shape functions of the cells.

    Attributes:
        cell: Shape of the cells.
        order: Their order, 1 or 2.
        x: Positions of the nodes, shape (n, tdim), length.
        cells: Nodes of the cells in DOLFINx order, shape (n_cells, n_cell_nodes).
        values: Shape (n,).
    """

    cell: str
    order: int
    x: Array = field(repr=False)
    cells: Ints = field(repr=False)
    values: Array = field(repr=False)

    @cached_property
    def _element(self) -> basix.finite_element.FiniteElement:
        return basix.create_element(
            basix.ElementFamily.P,
            getattr(basix.CellType, self.cell),
            self.order,
            basix.LagrangeVariant.gll_warped,
        )

    @cached_property
    def _boxes(self) -> tuple[Array, Array]:
        """Corners of boxes around the cells, a little larger, each of shape (n_cells, tdim)."""
        x = self.x[self.cells]
        low, high = x.min(axis=1), x.max(axis=1)
        # cells of second order may bulge beyond their nodes
        more = (0.01 if self.order == 1 else 0.3) * (high - low).max(axis=1, keepdims=True)
        return low - more, high + more

    @cached_property
    def _middles(self) -> cKDTree:
        return cKDTree(self.x[self.cells].mean(axis=1))

    @cached_property
    def _nodes(self) -> cKDTree:
        return cKDTree(self.x[self._used])

    @cached_property
    def _used(self) -> Ints:
        return np.unique(self.cells)

    def __call__(self, x: Array) -> Array:
        """Values at positions of shape (3, m), shape (m,).

        Outside all cells it is the value of the nearest node.
        """
        points = np.ascontiguousarray(np.asarray(x).T[:, : self.x.shape[1]])
        if not len(points):
            return np.zeros(0)
        far, nearest = self._nodes.query(points)
        out = self.values[self._used[nearest]]
        missing = far > _SAME * np.ptp(self.x[self._used], axis=0).max()
        for at, cells in self._candidates(points, missing):
            found, inside = self._within(points[at], cells)
            out[at[inside]] = found[inside]
            missing[at[inside]] = False
        return np.asarray(out)

    def _candidates(self, points: Array, missing: Bools) -> Iterator[tuple[Ints, Ints]]:
        """Points that are missing still, and a cell of each in which it may lie."""
        count = min(_NEAREST, len(self.cells))
        near = self._middles.query(points, k=count)[1].reshape(len(points), count)
        for k in range(count):
            at = np.flatnonzero(missing)
            if not len(at):
                return
            yield at, near[at, k]
        low, high = self._boxes
        rest = np.flatnonzero(missing)
        chunk = max(1, _PAIRS // len(self.cells))
        for first in range(0, len(rest), chunk):
            mine = rest[first : first + chunk]
            boxed = np.ones((len(mine), len(self.cells)), dtype=bool)
            for d in range(points.shape[1]):
                p = points[mine, d][:, None]
                boxed &= (p >= low[:, d]) & (p <= high[:, d])
            while boxed.any():
                has = np.flatnonzero(boxed.any(axis=1))
                cells = boxed[has].argmax(axis=1)
                yield mine[has], cells
                boxed[has, cells] = False
                boxed[~missing[mine]] = False

    def _within(self, points: Array, cells: Ints) -> tuple[Array, Bools]:
        """Values at points in cells, and whether the points lie in them, each of shape (m,)."""
        values, inside = np.zeros(len(points)), np.zeros(len(points), dtype=bool)
        low, high = self._boxes
        at = np.flatnonzero(((points >= low[cells]) & (points <= high[cells])).all(axis=1))
        if not len(at):  # Basix 0.9 ends the process when it tabulates at no point
            return values, inside
        simplex = self.cell in ("triangle", "tetrahedron")
        middle = basix.geometry(self._element.cell_type).mean(axis=0)
        reference = np.tile(middle, (len(at), 1))
        for _ in range(_ITERATIONS):
            nodes = self.cells[cells[at]]
            corners = self.x[nodes]
            table = self._element.tabulate(1, reference)[..., 0]
            error = points[at] - np.einsum("mk,mkc->mc", table[0], corners)
            near = np.linalg.norm(error, axis=1) < 1e-9 * np.ptp(corners, axis=1).max(axis=1)
            good = (reference > -_INSIDE).all(axis=1)
            upper = reference.sum(axis=1) if simplex else reference.max(axis=1)
            good &= near & (upper < 1.0 + _INSIDE)
            values[at[good]] = np.einsum("mk,mk->m", table[0], self.values[nodes])[good]
            inside[at[good]] = True
            slope = np.einsum("dmk,mkc->mcd", table[1:], corners)
            flat = np.linalg.det(slope) == 0.0
            slope[flat] = np.eye(slope.shape[1])
            reference = reference + np.linalg.solve(slope, error[..., None])[..., 0]
            # a point in the cell is found without a detour far out of it
            going = ~near & ~flat & (np.abs(reference - 0.5) < 1.5).all(axis=1)
            at, reference = at[going], reference[going]
            if not len(at):
                break
        return values, inside


__all__ = ["CellField"]
