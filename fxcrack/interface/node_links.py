"""Which facets and which nodes are beside each node of a slave surface."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Ints
from fxcrack.interface.surface import FacetSurface

EDGES = {
    "interval": ((0, 1),),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 3), (3, 2), (2, 0)),
}
"""Corners of the edges of facets, basix order."""
LINES = {
    "interval": ((0, 2, 1),),
    "quadrilateral": ((0, 4, 1), (2, 7, 3), (0, 5, 2), (1, 6, 3), (5, 8, 6), (4, 8, 7)),
}
"""Lines corner-midside-corner (and midside-centre-midside) of second-order facets, basix order."""


class NodeLinks:
    """Facets and edges at each node of a surface.

    Args:
        surface: The surface.

    Attributes:
        facets_of: Per node its facets, shape (n_facets,).
        links: Per node the ends and midside nodes (-1 in first order) of its edges, shape
            (n_edges, 2).
        ends: The ends as one table, shape (n_nodes, largest number of edges), filled up with -1.
        middles: The midside nodes, likewise.
        has_units: Whether units of crack closure are defined: second-order triangles may be tied,
            but none is defined on them.
    """

    def __init__(self, surface: FacetSurface) -> None:
        facets = surface.facets
        flat = np.argsort(facets.ravel(), kind="stable")
        counts = np.bincount(facets.ravel(), minlength=surface.n_nodes)
        self.facets_of = np.split(flat // facets.shape[1], np.cumsum(counts)[:-1])
        self.has_units = surface.order == 1 or surface.kind in LINES
        pattern = (EDGES if surface.order == 1 else LINES).get(surface.kind, ((0, 3, 1),))
        ends = np.concatenate([facets[:, [e[0], e[-1]]] for e in pattern])
        middle = (
            np.concatenate([facets[:, e[1]] for e in pattern])
            if surface.order == 2
            else np.full(len(ends), -1)
        )
        links = np.unique(np.column_stack([np.sort(ends, axis=1), middle]), axis=0)
        both = np.concatenate([links, links[:, [1, 0, 2]]])
        both = both[np.lexsort((both[:, 1], both[:, 0]))]
        split = np.searchsorted(both[:, 0], np.arange(1, surface.n_nodes))
        self.links = np.split(both[:, 1:], split)
        self.ends, self.middles = self._table(surface.n_nodes)

    def _table(self, n_nodes: int) -> tuple[Ints, Ints]:
        width = max(len(link) for link in self.links)
        ends = np.full((n_nodes, width), -1, dtype=np.int64)
        middles = np.full((n_nodes, width), -1, dtype=np.int64)
        for i, link in enumerate(self.links):
            ends[i, : len(link)], middles[i, : len(link)] = link[:, 0], link[:, 1]
        return ends, middles

    def neighbours(self, node: int) -> Ints:
        """Nodes linked to a node along an edge, shape (n_edges,)."""
        return np.asarray(self.links[node][:, 0])
