"""Cells near some positions, collected from all ranks with what an integral over them needs.

They come in the order of the input. So every rank integrates the same numbers in the same order,
and the result does not depend on their number.
"""

from __future__ import annotations

from typing import Any

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import basix
import dolfinx.mesh
import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.front_cells import FrontCells


class CellSource:
    """A :class:`fxcrack.criteria.probe.CellsAround`: what a rank knows of its own cells.

    Args:
        continuum: The bodies.
        groups: Cell groups whose cells are marked; ``None`` stands for the whole mesh.
    """

    def __init__(self, continuum: Continuum, groups: list[str | None]) -> None:
        domain, tdim = continuum.mesh.domain, continuum.mesh.tdim
        self._comm = continuum.comm
        n = int(domain.topology.index_map(tdim).size_local)
        geometry = compat.geometry_dofmap(domain)[:n]
        self._geometry = domain.geometry.x[geometry][:, :, : continuum.gdim]
        dofmap = continuum.space.dofmap
        nodes = np.asarray(dofmap.list)[:n]
        whole = np.asarray(dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32)))
        self._nodes = whole.reshape(nodes.shape).astype(np.int64)
        self._key = np.asarray(compat.original_cell_index(domain), dtype=np.int64)[:n]
        self._part = np.zeros(n, dtype=np.int64)
        for i, cells in enumerate(continuum.part_cells):
            self._part[cells] = i
        self._outer = _outer_facets(domain, tdim, n)
        self._temperatures = self._nodal = np.zeros((n, 0, 0))
        self._temperature_element: Any = None
        if continuum.temperature is not None:
            patterns = continuum.temperature.patterns
            space = patterns[0].function_space
            self._temperature_element = space.element.basix_element
            rows = np.asarray(space.dofmap.list)[:n]
            self._temperatures = np.stack([p.x.array[rows] for p in patterns], axis=1)
            nodal = continuum.temperature.nodal_patterns(continuum.space)
            self._nodal = np.moveaxis(nodal[:, nodes], 0, 1)
        self._marks = np.ones((n, len(groups)), dtype=bool)
        for j, group in enumerate(groups):
            if group is not None:
                self._marks[:, j] = False
                cells = continuum.mesh.group(group, dim=tdim).entities
                self._marks[cells[cells < n], j] = True
        self._kind = domain.topology.cell_name()
        self._order = continuum.order
        self._n_corners = len(basix.geometry(getattr(basix.CellType, self._kind)))
        corners = self._geometry[:, : self._n_corners]
        self._centre = corners.mean(axis=1)
        self._radius = np.linalg.norm(corners - self._centre[:, None], axis=2).max(
            axis=1, initial=0.0
        )

    def sizes(self, nodes: list[Ints], x: Array, along: Array) -> Array:
        """How far the cells at some nodes reach from a position; collective.

        Args:
            nodes: Global displacement nodes, per position those that lie there.
            x: Positions, shape (n, gdim) [length].
            along: Unit vectors of the front, along which nothing is measured, shape (n, gdim).

        Returns:
            Shape (n,) [length].
        """
        every = np.unique(np.concatenate(nodes)) if nodes else np.zeros(0, dtype=np.int64)
        near = np.flatnonzero(np.isin(self._nodes, every).any(axis=1))
        mine = np.zeros(len(x))
        for i, here in enumerate(nodes):
            cells = near[np.isin(self._nodes[near], here).any(axis=1)]
            away = self._geometry[cells][:, : self._n_corners] - x[i]
            away = away - (away @ along[i])[..., None] * along[i]
            mine[i] = np.linalg.norm(away, axis=2).max(initial=0.0)
        out = np.zeros(len(x))
        self._comm.Allreduce(mine, out, op=MPI.MAX)
        return out

    def temperature_table(self, points: Array) -> Array:
        """Values of the temperature's element at reference points, shape (n_points, n_values)."""
        return np.asarray(self._temperature_element.tabulate(0, points)[0, :, :, 0])

    def near(self, x: Array, radius: Array) -> FrontCells:
        """Cells that reach into spheres around some positions; collective.

        Args:
            x: Positions, shape (n, gdim) [length].
            radius: Radii, shape (n,) [length].

        Returns:
            The cells, the same on every rank.
        """
        mine = np.zeros(0, dtype=np.int64)
        if len(self._centre) and len(x):
            reach = float(radius.max())
            distance, _ = cKDTree(x).query(self._centre)
            mine = np.flatnonzero(distance <= (reach + self._radius) * (1.0 + 1e-9))
        parts = self._comm.allgather(
            (
                self._key[mine],
                self._geometry[mine],
                self._nodes[mine],
                self._part[mine],
                self._outer[mine],
                self._temperatures[mine],
                self._nodal[mine],
                self._marks[mine],
            )
        )
        key, *rest = (
            np.concatenate([p[k] for p in parts if len(p[0])] or [parts[0][k]])
            for k in range(len(parts[0]))
        )
        order = np.argsort(key, kind="stable")
        return FrontCells(self._kind, self._order, *(a[order] for a in rest))


def _outer_facets(domain: dolfinx.mesh.Mesh, tdim: int, n_cells: int) -> Bools:
    """Whether the facets of the owned cells are boundary, shape (n_cells, n_facets); collective."""
    topology = domain.topology
    topology.create_connectivity(tdim - 1, tdim)
    topology.create_connectivity(tdim, tdim - 1)
    links = topology.connectivity(tdim, tdim - 1)
    facets = links.array.reshape(len(links.offsets) - 1, -1)[:n_cells]
    index_map = topology.index_map(tdim - 1)
    outer = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=bool)
    outer[dolfinx.mesh.exterior_facet_indices(topology)] = True
    if index_map.num_ghosts:
        # whether a ghost facet is boundary its owner knows
        flags = dolfinx.la.vector(index_map, 1, dtype=np.int8)
        flags.array[:] = 0
        flags.array[: index_map.size_local] = outer[: index_map.size_local]
        flags.scatter_forward()
        outer = flags.array.astype(bool)
    return np.asarray(outer[facets])
