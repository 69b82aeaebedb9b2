"""Hierarchical jump coordinates on the faces of second-order tetrahedra.

A uniform traction gives the corner nodes of a 6-node triangle no force: all of it is at the midside
nodes, so neither the force nor the opening of a single corner means anything at a crack front.
Therefore the jump of a midside node s between the corners a and b is divided,

    u_s - W_s u_m = ([u]_a + [u]_b)/2 + R_s beta,        [u]_a = u_a - W_a u_m

The jump of a corner then belongs to the first-order function phi_a of its triangles: its bond
force is int t phi_a dA, and the area it stands for, its neighbours on the front and the opening
behind it are those of first-order triangles with the same corners. Crack closure, release and swept
areas are defined on these (``Pair.surface``); beta, the curved part of the jump along an edge, is
zero until both ends of its edge are open and is released together with the second of them.

Written for u_s this is the general form of :mod:`fxcrack.interface.jump_coordinates`, with the
corners and their masters among the masters of a midside node:

    u_s = W_s u_m + (u_a - W_a u_m + u_b - W_b u_m)/2 + R_s beta

In contact the jumps of the corners cannot be negative, and beta is free where the edge is open.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.surface import FacetSurface

MIDSIDES = {3: (1, 2), 4: (0, 2), 5: (0, 1)}
"""Midside nodes of a second-order triangle in basix order, and the corners beside each."""

CLOSURE_BY_CORNERS = 1.02
"""Half the product of the force of a corner and the opening behind it, by the energy that growth
sets free, in the field of a crack tip. Measured beside the domain integral on even tetrahedra in
plane strain: 1.021 at 6 and 1.020 at 12 elements over the height of an arm; on unstructured fronts
1.02 on the mean."""


@dataclass(frozen=True)
class Hierarchy:
    """Midside nodes of a slave surface, whose jumps are measured from those of their corners.

    Attributes:
        midsides: The midside nodes that have a master point, ascending, shape (n,).
        ends: Corners of their edges, shape (n, 2).
        masters: Global displacement nodes under each slave node, shape (n_nodes, k): those of the
            whole jump.
        weights: Their weights, shape (n_nodes, k).
    """

    midsides: Ints
    ends: Ints
    masters: Ints
    weights: Array

    def opened_by(self, bonded: Bools, nodes: Ints) -> Ints:
        """Bonded midside nodes that come free with some corners, shape (k,).

        Args:
            bonded: Nodes bonded so far, shape (n_nodes,).
            nodes: Corners that are released, shape (m,).
        """
        still = bonded.copy()
        still[nodes] = False
        free = bonded[self.midsides] & ~still[self.ends].any(axis=1)
        return np.asarray(self.midsides[free])

    def beside(self, nodes: Ints) -> Ints:
        """Midside nodes of all edges at some corners, shape (k,)."""
        return np.asarray(self.midsides[np.isin(self.ends, nodes).any(axis=1)])

    def link(self, has_jump: Bools) -> None:
        """Mark midside nodes beside a marked corner, shape (n_nodes,), in place."""
        has_jump[self.midsides] |= has_jump[self.ends].any(axis=1)

    def most_beside(self) -> int:
        """Largest number of midside nodes at one corner."""
        return int(np.bincount(self.ends.ravel(), minlength=1).max())

    def nearest(self, distance: Array) -> Array:
        """Distances of nodes, of midside nodes the smaller one of their ends; (n_nodes,) both."""
        out = distance.copy()
        out[self.midsides] = distance[self.ends].min(axis=1)
        return out

    def bonded(self, corners: Bools) -> Bools:
        """Bonded nodes, those of the corners given; shape (n_nodes,) both."""
        out = corners.copy()
        out[self.midsides] = corners[self.ends].any(axis=1)
        return out

    def on_whole_jumps(self, weights: Array) -> Array:
        """Weights of whole jumps, turned to weights of the coordinates; shape (n_nodes,) both."""
        out = weights.copy()
        np.add.at(out, self.ends, 0.5 * weights[self.midsides, None])
        return out

    def curved(self, surface: FacetSurface) -> FacetSurface:
        """The second-order triangles of which the surface has the corners.

        Triangles with an edge whose midside node is not among the jumps are left out.

        Args:
            surface: First-order triangles on the corners.
        """
        middle = {
            (min(e), max(e)): m for e, m in zip(self.ends.tolist(), self.midsides, strict=True)
        }
        rows, kept = [], []
        for k, corner in enumerate(surface.facets.tolist()):
            edges = [(corner[a], corner[b]) for a, b in MIDSIDES.values()]
            found = [middle.get((min(e), max(e))) for e in edges]
            if None not in found:
                rows.append([*corner, *found])
                kept.append(k)
        facets = np.array(rows, dtype=np.int64).reshape(-1, 6)
        outward = None if surface.outward is None else surface.outward[kept]
        return replace(surface, order=2, facets=facets, inner=surface.inner[kept], outward=outward)

    def spread(self, values: Array) -> Array:
        """Values at corners, averaged onto the midside nodes; shape (n_nodes, ...) both."""
        out = values.copy()
        out[self.midsides] = 0.5 * (values[self.ends[:, 0]] + values[self.ends[:, 1]])
        return out


def is_hierarchical(surface: FacetSurface) -> bool:
    """Whether corners of its facets carry nothing of a uniform traction."""
    return surface.kind == "triangle" and surface.order == 2


def corner_surface(surface: FacetSurface) -> FacetSurface:
    """First-order triangles on the corners of second-order ones; midside nodes have no facet."""
    return replace(surface, order=1, facets=surface.facets[:, :3])


def edges_of(surface: FacetSurface) -> tuple[Ints, Ints]:
    """Midside nodes of second-order triangles, ascending, shape (n,), and ends, shape (n, 2)."""
    rows = [surface.facets[:, [m, a, b]] for m, (a, b) in MIDSIDES.items()]
    every = np.concatenate(rows)
    midsides, first = np.unique(every[:, 0], return_index=True)
    return midsides, every[first, 1:]


def linked(
    surface: FacetSurface, paired: Bools, grown: Bools, masters: Ints, weights: Array
) -> tuple[Hierarchy, Ints, Array]:
    """Let the midside nodes of a slave surface follow their corners as well.

    Args:
        surface: Slave surface, with all its second-order facets.
        paired: Slave nodes that have a master point, shape (n_nodes,).
        grown: Slave nodes that belong to the master as well; their jump is zero, shape (n_nodes,).
        masters: Global displacement nodes under each slave node, shape (n_nodes, k).
        weights: Their weights, shape (n_nodes, k).

    Returns:
        The hierarchy, and masters and weights of all slave nodes in it, each of shape (n_nodes, m).
        The edge of a corner that has neither a master nor a jump of zero counts with its other end
        alone.
    """
    midsides, ends = edges_of(surface)
    has_jump = paired[ends].all(axis=1) | (paired | grown)[ends].all(axis=1)
    kept = paired[midsides]
    midsides, ends, has_jump = midsides[kept], ends[kept], has_jump[kept]
    known, columns = np.unique(np.concatenate([masters.ravel(), surface.dofs]), return_inverse=True)
    n, size = surface.n_nodes, masters.size
    rows = np.broadcast_to(np.arange(n)[:, None], masters.shape).ravel()
    shape = (n, len(known))
    under = sp.csr_matrix((weights.ravel(), (rows, columns[:size])), shape=shape)
    itself = sp.csr_matrix((np.ones(n), (np.arange(n), columns[size:])), shape=shape)
    half = sp.csr_matrix(
        (
            np.where(paired[ends[has_jump]], 0.5, 0.0).ravel(),
            (np.repeat(midsides[has_jump], 2), ends[has_jump].ravel()),
        ),
        shape=(n, n),
    )
    new_masters, new_weights = _padded(sp.csr_matrix(under + half @ (itself - under)), known)
    return Hierarchy(midsides, ends, masters, weights), new_masters, new_weights


def _padded(matrix: sp.csr_matrix, known: Ints) -> tuple[Ints, Array]:
    """Columns and entries of rows of equal length, the first column repeated with weight 0."""
    matrix.sum_duplicates()
    matrix.data[np.abs(matrix.data) < 1e-13] = 0.0
    matrix.eliminate_zeros()
    matrix.sort_indices()
    counts = np.diff(matrix.indptr)
    n, width = matrix.shape[0], max(int(counts.max(initial=0)), 1)
    rows = np.repeat(np.arange(n), counts)
    places = np.arange(len(rows)) - matrix.indptr[rows]
    columns, weights = np.zeros((n, width), dtype=np.int64), np.zeros((n, width))
    has = counts > 0
    columns[has] = matrix.indices[matrix.indptr[:-1][has]][:, None]
    columns[rows, places], weights[rows, places] = matrix.indices, matrix.data
    return np.asarray(known[columns]), weights


def links_in_chain(hierarchies: Iterable[Hierarchy | None]) -> int:
    """Longest way from a slave node by its masters, over interfaces given by their hierarchies."""
    return sum(1 if h is None else 2 for h in hierarchies)
