"""Displacements of the interface nodes, whole on every rank.

delta = R^t (u_s - sum_m W_sm u_m)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.pairing import Pair
from fxcrack.interface.surface import FacetSurface


class NodeValues:
    """Values at some displacement nodes, gathered from their owners.

    Args:
        continuum: Displacement space.
        nodes: Global displacement nodes (block indices), any order, repeated or not.
    """

    def __init__(self, continuum: Continuum, nodes: Ints) -> None:
        self.nodes = np.unique(nodes)
        self._gdim, self._comm = continuum.gdim, continuum.comm
        low = continuum.offset // continuum.gdim
        mine = (self.nodes >= low) & (self.nodes < low + continuum.n_local // continuum.gdim)
        self._here = np.flatnonzero(mine)
        self._local = self.nodes[mine] - low

    def gather(self, owned: Array) -> Array:
        """Values at the nodes, shape (n_nodes, gdim); collective.

        Args:
            owned: Values on the owned dofs of this rank, shape (n_local,).
        """
        out = np.zeros((len(self.nodes), self._gdim))
        mine = owned.reshape(-1, self._gdim)[self._local]
        for here, values in self._comm.allgather((self._here, mine)):
            out[here] = values
        return out

    def find(self, nodes: Ints) -> Ints:
        """Rows of :meth:`gather` for some of the nodes."""
        return np.searchsorted(self.nodes, nodes)


class JumpGather:
    """Reads the jumps of all pairs off a displacement.

    Args:
        continuum: Displacement space.
        pairs: Interfaces.
        masters: Master surfaces whose nodes are wanted as well.
    """

    def __init__(
        self, continuum: Continuum, pairs: list[Pair], masters: Sequence[FacetSurface] = ()
    ) -> None:
        nodes = [p.surface.dofs for p in pairs] + [m.dofs for m in masters]
        nodes += [p.masters.ravel() for p in pairs]
        self.values = NodeValues(
            continuum, np.concatenate(nodes) if nodes else np.zeros(0, dtype=np.int64)
        )

    def slaves(self, values: Array, pair: Pair) -> Array:
        """Displacements of a pair's slave nodes, shape (n_nodes, gdim)."""
        return values[self.values.find(pair.surface.dofs)]

    def jumps(self, values: Array, pair: Pair, frames: Array) -> Array:
        """Jumps of a pair in its frames, shape (n_nodes, gdim); of paired nodes only."""
        masters = values[self.values.find(pair.masters)]
        jump = self.slaves(values, pair) - np.einsum("nk,nkc->nc", pair.weights, masters)
        jump[~pair.paired] = 0.0
        return np.asarray(np.einsum("nci,nc->ni", frames, jump))


class InterfaceNodes:
    """What every rank knows of the displacement nodes that take part in an interface.

    Args:
        continuum: Displacement space.
        pairs: Interfaces.
        which: Number of the support that prescribes a dof, -1 where none does, shape (n_local,).
        value: Values that supports prescribe, shape (n_local,).
        jumped: Per pair, whether a slave node has a jump, shape (n_nodes,).
    """

    def __init__(
        self,
        continuum: Continuum,
        pairs: list[Pair],
        which: Ints,
        value: Array,
        jumped: list[npt.NDArray[np.bool_]],
    ) -> None:
        gdim, comm = continuum.gdim, continuum.comm
        used = [p.surface.dofs[j] for p, j in zip(pairs, jumped, strict=True)]
        used += [p.masters[j].ravel() for p, j in zip(pairs, jumped, strict=True)]
        self.blocks = np.unique(np.concatenate(used)) if used else np.zeros(0, dtype=np.int64)
        self.gdim = gdim
        self.low = continuum.offset // gdim
        self.mine = np.flatnonzero(
            (self.blocks >= self.low) & (self.blocks < self.low + continuum.n_local // gdim)
        )
        self.comm = comm
        local = (self.blocks[self.mine] - self.low)[:, None] * gdim + np.arange(gdim)
        self.which = self.share(which[local].astype(float)).astype(np.int64)
        self.value = self.share(value[local])

    def share(self, mine: Array) -> Array:
        """Combine what owners know of their nodes, shape (n_mine, gdim) to (n_blocks, gdim)."""
        out = np.zeros((len(self.blocks), self.gdim))
        for where, what in self.comm.allgather((self.mine, mine)):
            out[where] = what
        return out

    def find(self, dofs: Ints) -> Ints:
        """Position of global displacement nodes in the replica."""
        return np.searchsorted(self.blocks, dofs)
