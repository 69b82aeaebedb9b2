"""Exchange of rows of a distributed array that other ranks need."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.arrays import Ints

Block = npt.NDArray[Any]

_TAG = 4711
"""Of messages that are on their way beside collective calls of others."""


class Halo:
    """Exchange of the rows of a block that neighbours need.

    Args:
        comm: Communicator.
        ranges: First row of every rank and the total, shape (n_ranks + 1,).
        ghosts: Global rows this rank needs from others, ascending.
    """

    def __init__(self, comm: MPI.Intracomm, ranges: Ints, ghosts: Ints) -> None:
        self._comm = comm
        owner = np.searchsorted(ranges, ghosts, side="right") - 1
        self._receive = np.bincount(owner, minlength=comm.size)
        wanted = comm.alltoall(np.split(ghosts, np.cumsum(self._receive)[:-1]))
        self._rows = np.concatenate(wanted).astype(np.int64) - ranges[comm.rank]
        self._send = np.array([len(w) for w in wanted])
        self.n_ghosts = len(ghosts)

    def _exchange(self, out: Block, n_out: Ints, into: Block, n_into: Ints) -> None:
        kind = MPI._typedict[out.dtype.char]
        width = out.shape[1]
        counts = [
            (n * width, np.concatenate([[0], np.cumsum(n)[:-1]]) * width) for n in (n_out, n_into)
        ]
        self._comm.Alltoallv([out, counts[0], kind], [into, counts[1], kind])

    def fetch(self, x: Block) -> Block:
        """Ghost rows of a block; collective."""
        into = np.empty((self.n_ghosts, x.shape[1]), dtype=x.dtype)
        if self._comm.size > 1:
            self._exchange(np.ascontiguousarray(x[self._rows]), self._send, into, self._receive)
        return into

    def add(self, ghosts: Block, x: Block) -> None:
        """Add ghost rows to the rows of their owners, in place; collective."""
        if self._comm.size == 1:
            return
        into = np.empty((len(self._rows), x.shape[1]), dtype=x.dtype)
        self._exchange(np.ascontiguousarray(ghosts), self._receive, into, self._send)
        np.add.at(x, self._rows, into)


class NodeUpdate:
    """Values of nodes that neighbours need, on their way while this rank goes on computing.

    Args:
        comm: Communicator.
        ranges: First node of every rank and the total, shape (n_ranks + 1,).
        ghosts: Global nodes this rank needs from others, shape (n_ghosts,), any order.
        width: Values of a node.

    Attributes:
        rows: Owned nodes that other ranks need, once for each of these, shape (n_sent,).
        values: Their values, to be set before :meth:`start`, shape (n_sent, width).
    """

    def __init__(self, comm: MPI.Intracomm, ranges: Ints, ghosts: Ints, width: int) -> None:
        self._comm = comm
        self._order = np.argsort(ghosts, kind="stable")
        halo = Halo(comm, ranges, np.asarray(ghosts)[self._order])
        self.rows = halo._rows
        self.values = np.zeros((len(self.rows), width))
        self._arrived = np.zeros((len(ghosts), width))
        self._to = _blocks(halo._send)
        self._from = _blocks(halo._receive)
        self._requests: list[MPI.Request] = []

    def start(self) -> None:
        """Send :attr:`values`, and take what neighbours send; :meth:`finish` must follow."""
        comm = self._comm
        self._requests = [
            comm.Irecv(self._arrived[part], source=rank, tag=_TAG) for rank, part in self._from
        ]
        self._requests += [
            comm.Isend(self.values[part], dest=rank, tag=_TAG) for rank, part in self._to
        ]

    def finish(self, ghosts: Block) -> None:
        """Wait for the neighbours; their values into ``ghosts``, shape (n_ghosts, width)."""
        MPI.Request.Waitall(self._requests)
        ghosts[self._order] = self._arrived


def _blocks(counts: Ints) -> list[tuple[int, slice]]:
    """Ranks with some rows, and these rows, of rows sorted by rank."""
    ends = np.cumsum(counts)
    return [
        (rank, slice(int(end - n), int(end)))
        for rank, (n, end) in enumerate(zip(counts.tolist(), ends.tolist(), strict=True))
        if n
    ]


__all__ = ["Halo", "NodeUpdate"]
