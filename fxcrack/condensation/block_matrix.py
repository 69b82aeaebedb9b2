"""Sparse matrices times blocks of vectors, on all ranks.

A block of k vectors is an array with one row per local unknown, stored by rows: a sparse product
then reads the matrix once for all k, which takes a quarter of the time per vector.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.halo import Halo

Block = npt.NDArray[Any]


class BlockMatrix:
    """The rows of a sparse matrix this rank owns.

    Args:
        comm: Communicator.
        local: Owned rows with global columns, shape (n_rows, n_columns in all).
        ranges: First column of every rank and the total, shape (n_ranks + 1,).
    """

    def __init__(self, comm: MPI.Intracomm, local: sp.csr_matrix, ranges: Ints) -> None:
        self.comm = comm
        first, end = ranges[comm.rank], ranges[comm.rank + 1]
        used = np.unique(local.indices)
        ghosts = used[(used < first) | (used >= end)].astype(np.int64)
        self.halo = Halo(comm, ranges, ghosts)
        self.n_owned = int(end - first)
        position = local.indices.astype(np.int64) - first
        outside = (position < 0) | (position >= self.n_owned)
        position[outside] = self.n_owned + np.searchsorted(ghosts, local.indices[outside])
        self.local = sp.csr_matrix(
            (local.data, position.astype(np.int32), local.indptr.astype(np.int32)),
            shape=(local.shape[0], self.n_owned + len(ghosts)),
        )

    @classmethod
    def from_petsc(cls, matrix: PETSc.Mat, kind: npt.DTypeLike = np.float64) -> BlockMatrix:
        """Copy of a PETSc AIJ matrix; collective."""
        indptr, indices, data = matrix.getValuesCSR()
        shape = (len(indptr) - 1, matrix.getSize()[1])
        local = sp.csr_matrix((data.astype(kind), indices, indptr), shape=shape)
        ranges = np.asarray(matrix.getOwnershipRangesColumn(), dtype=np.int64)
        return cls(matrix.getComm().tompi4py(), local, ranges)

    def rounded(self) -> BlockMatrix:
        """The same in single precision; the pattern is shared."""
        out = object.__new__(BlockMatrix)
        out.comm, out.halo, out.n_owned = self.comm, self.halo, self.n_owned
        out.local = sp.csr_matrix(
            (self.local.data.astype(np.float32), self.local.indices, self.local.indptr),
            shape=self.local.shape, copy=False,
        )  # fmt: skip
        return out

    def __matmul__(self, x: Block) -> Block:
        """Product with a block, shape (n_owned, k) to (n_rows, k); collective."""
        if self.comm.size > 1:
            x = np.concatenate([x, self.halo.fetch(x)])
        return np.asarray(self.local @ x)

    def transposed_times(self, x: Block) -> Block:
        """Product of the transpose with a block, (n_rows, k) to (n_owned, k); collective."""
        whole = np.asarray(self.local.T @ x)
        out = whole[: self.n_owned]
        self.halo.add(whole[self.n_owned :], out)
        return out

    def diagonal(self) -> Block:
        """Diagonal of a square matrix, shape (n_rows,)."""
        return np.asarray(self.local.diagonal())[: self.local.shape[0]]


def inner_products(comm: MPI.Intracomm, *pairs: tuple[Block, Block]) -> Array:
    """a^t b of some pairs of blocks of k columns over all ranks, shape (n_pairs, k, k).

    Collective, the same on every rank.
    """
    return _summed(comm, np.stack([a.T @ b for a, b in pairs]))


def column_products(comm: MPI.Intracomm, *pairs: tuple[Block, Block]) -> Array:
    """a_j . b_j of some pairs of blocks of k columns over all ranks, shape (n_pairs, k).

    Collective, the same on every rank.
    """
    return _summed(comm, np.stack([np.einsum("ij,ij->j", a, b) for a, b in pairs]))


def _summed(comm: MPI.Intracomm, local: Block) -> Array:
    out = np.ascontiguousarray(local, dtype=np.float64)
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, out)
    return out
