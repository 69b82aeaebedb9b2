"""Displacements and jumps of the interface nodes, whole on every rank.

    delta = R^t (u_s - sum_m W_sm u_m),    u = P q_node at the points of both surfaces

(:mod:`fxcrack.interface.jump_coordinates`). The nodes are sorted by their global numbers, of which
each rank owns a range; so the values of the ranks, one rank after the other, are those of all
nodes. They are exchanged by buffers in one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.interface.pair import Pair
from fxcrack.interface.surface import FacetSurface


class InterfaceNodes:
    """Some displacement nodes, the same on every rank, and the exchange of their values.

    Args:
        layout: Unknowns of nodes and their numbers.
        nodes: Global nodes, shape (n,), any order, repeated or not; the same on every rank.

    Attributes:
        layout: The layout.
        nodes: The nodes, ascending, shape (n_nodes,).
        mine: Rows of ``nodes`` that this rank owns.
        local: Numbers of these nodes on this rank, shape (n_mine,).
    """

    def __init__(self, layout: DofLayout, nodes: Ints) -> None:
        self.layout = layout
        self.nodes = np.unique(nodes)
        ends = np.searchsorted(self.nodes, layout.first_nodes)
        self._counts, self._starts = np.diff(ends), ends[:-1]
        rank = layout.comm.rank
        self.mine = slice(int(ends[rank]), int(ends[rank + 1]))
        self.local = layout.to_local(self.nodes[self.mine])

    @classmethod
    def of_pairs(
        cls,
        layout: DofLayout,
        pairs: Sequence[Pair],
        masters: Sequence[FacetSurface] = (),
        jumped: Sequence[npt.NDArray[np.bool_]] | None = None,
        further: Ints | None = None,
    ) -> InterfaceNodes:
        """Nodes of interfaces.

        Args:
            layout: Unknowns of nodes and their numbers.
            pairs: Interfaces; their slave nodes and the masters of these.
            masters: Master surfaces, all of whose nodes are wanted as well.
            jumped: Per pair, the slave nodes that count, shape (n_nodes,); all by default.
            further: Other global nodes that are wanted, shape (n,).
        """
        every = slice(None)
        used = [m.dofs for m in masters] + ([] if further is None else [further])
        for p, pair in enumerate(pairs):
            rows = every if jumped is None else jumped[p]
            used += [pair.surface.dofs[rows], pair.masters[rows].ravel()]
            if pair.feet is not None:
                used.append(pair.feet[0][rows].ravel())
            if pair.hierarchy is not None:
                used.append(pair.hierarchy.masters[rows].ravel())
        return cls(layout, np.concatenate(used) if used else np.zeros(0, dtype=np.int64))

    def __len__(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    def find(self, nodes: Ints) -> Ints:
        """Rows of some of the nodes, shape of ``nodes``."""
        return np.searchsorted(self.nodes, nodes)

    def gather(self, owned: Array) -> Array:
        """Values of the nodes' unknowns; collective.

        Args:
            owned: Values of the dofs that this rank owns, shape (n_local,).

        Returns:
            Shape (n_nodes, n_unknowns).
        """
        return np.asarray(self.share(self.layout.by_node(owned)[self.local]))

    def share(self, mine: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """What all ranks know of the nodes they own; collective.

        Args:
            mine: Numbers of this rank's nodes, of any type, shape (n_mine, ...).

        Returns:
            The same of all nodes, shape (n_nodes, ...).
        """
        comm = self.layout.comm
        out = np.empty((len(self.nodes), *mine.shape[1:]), dtype=mine.dtype)
        if comm.size == 1:
            out[:] = mine
            return out
        width = int(np.prod(mine.shape[1:]))
        whole = (out, (width * self._counts, width * self._starts))
        comm.Allgatherv(np.ascontiguousarray(mine), whole)
        return out


class JumpGather:
    """Reads the jumps of all pairs in a displacement.

    Args:
        layout: Unknowns of nodes and their numbers.
        pairs: Interfaces.
        masters: Master surfaces whose nodes are wanted as well.
    """

    def __init__(
        self, layout: DofLayout, pairs: Sequence[Pair], masters: Sequence[FacetSurface] = ()
    ) -> None:
        self._nodes = InterfaceNodes.of_pairs(layout, pairs, masters)

    def gather(self, owned: Array) -> Array:
        """Values for the other methods, shape (n_nodes, n_unknowns); collective.

        Args:
            owned: Values of the dofs that this rank owns, shape (n_local,).
        """
        return self._nodes.gather(owned)

    def displacements(self, values: Array, surface: FacetSurface) -> Array:
        """Displacements of the points of a surface, shape (n_nodes, gdim), length.

        Args:
            values: From :meth:`gather`.
            surface: Slave surface of a pair, or one of the master surfaces.
        """
        found = values[self._nodes.find(surface.dofs)]
        return point_displacements(found, surface.point_maps, self._nodes.layout.gdim)

    def jumps(self, values: Array, pair: Pair, frames: Array) -> Array:
        """Jumps of a pair in its frames; zero at nodes without a master point.

        Args:
            values: From :meth:`gather`.
            pair: Interface.
            frames: Frames of the slave nodes, shape (n_nodes, gdim, gdim).

        Returns:
            Shape (n_nodes, gdim), length.
        """
        masters = values[self._nodes.find(pair.masters)]
        masters = point_displacements(masters, pair.master_maps, self._nodes.layout.gdim)
        jump = self.displacements(values, pair.surface)
        jump = jump - np.einsum("nk,nkc->nc", pair.weights, masters)
        jump[~pair.paired] = 0.0
        return np.asarray(np.einsum("nci,nc->ni", frames, jump))


def point_displacements(values: Array, maps: Array | None, gdim: int) -> Array:
    """Displacements of surface points.

    Args:
        values: Unknowns of their nodes, shape (..., n_unknowns).
        maps: P at the points, shape (..., gdim, n_unknowns); ``None`` where points are nodes.
        gdim: Components of a displacement.

    Returns:
        Shape (..., gdim), length.
    """
    if maps is None:
        return values[..., :gdim]
    return np.asarray(np.einsum("...cj,...j->...c", maps, values))
