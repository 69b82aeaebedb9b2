"""Columns of S by iteration, each computed once in an analysis.

    A_11 X = A_12,     S = V^t A V  with  V = [-X; 1]

A_11 holds the displacements and the free jumps. Jumps bonded at the start are no part of it,
whether they open later or not: it stays what it is while the crack grows, and so do the columns.
S is evaluated as the energy of the approximate X, so its error is the square of that of X and it
is never smaller than the exact one: what is positive definite stays so.

The unknowns are laid out on the displacement dofs, a free jump in the place of its slave node's
component and the identity in the places left over: the aggregates of the multigrid are nodes. The
rigid motions in these coordinates are those of the bodies, with jumps of zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.halo import Halo
from fxcrack.condensation.block_cg import block_cg
from fxcrack.condensation.block_matrix import Block, BlockMatrix
from fxcrack.condensation.multigrid import Multigrid
from fxcrack.condensation.rigid_motions import rigid_motions
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.jump_coordinates import JumpCoordinates

BLOCK = 32
"""Columns solved together: more share more directions, but leave the cache."""
_FLOOR = 1e-6
"""Least energy of a column over that of its own coordinate: rigid motions have none."""
_FIELD = 0.1
"""Tolerance of displacements over that of columns: their error is that of X, not its square."""


@dataclass(frozen=True)
class _Parts:
    """A split by inner and last coordinates.

    Attributes:
        inner: A_11 on the displacement dofs, owned rows, global columns.
        coupling: A_12, owned rows, shape (n_local, n_last).
        corner: A_22, whole, shape (n_last, n_last).
    """

    inner: sp.csr_matrix
    coupling: sp.csc_matrix
    corner: sp.csr_matrix


class SchurColumns:
    """Columns of S over all jumps that may open; collective.

    Args:
        continuum: Elastic bodies.
        stiffness: K; stays with the caller.
        coordinates: T with all jumps that may open retained; owned from now on.
        borders: Force patterns and monitors from :func:`load_and_monitor_vectors`; stay with the
            caller.
        rtol: Energy norm of a column's error over that of the column.

    Attributes:
        known: Numbers of the last coordinates whose columns are there, in their order in S, shape
            (n_known,).
        schur: S on them, the same on every rank, shape (n_known, n_known), force/length between
            jumps.
        iterations: Block iterations per block so far.
    """

    def __init__(
        self,
        continuum: Continuum,
        stiffness: PETSc.Mat,
        coordinates: JumpCoordinates,
        borders: list[PETSc.Vec],
        *,
        rtol: float,
    ) -> None:
        self.coordinates = coordinates
        self.rtol = rtol
        self.comm = continuum.comm
        self.n_global = continuum.n_global
        parts = _split(continuum, stiffness, coordinates, borders)
        self._coupling, self._corner = parts.coupling, parts.corner
        ranges = np.asarray(stiffness.getOwnershipRangesColumn(), dtype=np.int64)
        self.matrix = BlockMatrix(self.comm, parts.inner, ranges)
        petsc = _petsc(parts.inner, stiffness)
        self.multigrid = Multigrid(petsc, self.matrix, _motions(continuum, coordinates))
        petsc.destroy()
        self.known: Ints = np.zeros(0, dtype=np.int64)
        self.schur = np.zeros((0, 0))
        self.iterations: list[int] = []
        self._columns: list[Block] = []  # X in single precision, block by block
        log.info("multigrid: %s unknowns", " < ".join(str(n) for n in self.multigrid.sizes))

    def memory_mb(self) -> float:
        """Memory of the stored columns over all ranks, MB."""
        return 4e-6 * self.n_global * len(self.known)

    def require(self, numbers: Ints) -> int:
        """Compute the columns that are not there yet; collective.

        Args:
            numbers: Last coordinates, shape (k,).

        Returns:
            How many were computed.

        Raises:
            SolverError: The iteration does not converge; the message says why.
        """
        new = np.setdiff1d(numbers, self.known)
        for begin in range(0, len(new), BLOCK):
            self._add(new[begin : begin + BLOCK])
        return len(new)

    def _add(self, new: Ints) -> None:
        right = np.ascontiguousarray(self._coupling[:, new].toarray())
        diagonal = np.abs(self._corner.diagonal()[new])

        def allowed(energy: Array) -> Array:
            rest = np.abs(diagonal - energy)
            out: Array = self.rtol**2 * np.maximum(rest, _FLOOR * np.maximum(diagonal, energy))
            return out

        x, residual, iterations = block_cg(self.matrix, self.multigrid, right, allowed)
        self.iterations.append(iterations)
        every = np.concatenate([self.known, new])
        small, m = x.astype(np.float32), len(self.known)
        rest = residual.astype(np.float32)
        found = np.asarray(self._coupling[:, every].T @ x)
        begin = 0
        for stored in [*self._columns, small]:
            end = begin + stored.shape[1]
            found[begin:end] += stored.T @ rest
            begin = end
        found = self.comm.allreduce(found)
        found = self._corner[every][:, new].toarray() - found
        grown = np.empty((len(every), len(every)))
        grown[:m, :m] = self.schur
        grown[:, m:] = found
        grown[m:, :m] = found[:m].T
        grown[m:, m:] = 0.5 * (found[m:] + found[m:].T)
        self.schur, self.known = grown, every
        self._columns.append(small)

    def expand(self, values: Array) -> PETSc.Vec:
        """Displacements for given values of the known coordinates; collective.

        Args:
            values: Jumps (length), amplitudes of supports and load factors, in the order of
                ``known``, shape (n_known,).

        Returns:
            u on the displacement dofs; the caller destroys it.

        Raises:
            SolverError: The iteration does not converge.
        """
        last = np.zeros(self.coordinates.n_last)
        last[self.known] = values
        right = -np.asarray(self._coupling @ last)[:, None]
        start = np.zeros_like(right)
        begin = 0
        for stored in self._columns:
            end = begin + stored.shape[1]
            start[:, 0] -= stored @ values[begin:end].astype(np.float32)
            begin = end
        stored_energy = abs(float(values @ self.schur @ values))

        def allowed(energy: Array) -> Array:
            least = np.maximum(stored_energy, _FLOOR * np.abs(energy))
            out: Array = (_FIELD * self.rtol) ** 2 * least
            return out

        x, _, _ = block_cg(self.matrix, self.multigrid, right, allowed, start=start)
        transform = self.coordinates.transform
        q, u = transform.createVecs()
        q.array[: self.coordinates.n_inner] = x[self.coordinates.inner_dofs, 0]
        if self.comm.rank == 0:
            q.array[self.coordinates.n_inner :] = last
        transform.mult(q, u)
        q.destroy()
        return u

    def on_retained(self, n_borders: int) -> Array:
        """What each border holds in the rows of retained jumps, shape (n_retained, n_borders)."""
        n, first = self.coordinates.n_retained, self.coordinates.n_last - n_borders
        out: Array = self._corner[:n, first:].toarray()
        return out

    def destroy(self) -> None:
        """Free the transformation; collective."""
        self.coordinates.destroy()


def _split(
    continuum: Continuum,
    stiffness: PETSc.Mat,
    coordinates: JumpCoordinates,
    borders: list[PETSc.Vec],
) -> _Parts:
    """T^t K T and the borders, laid out on the displacement dofs; collective."""
    comm, n_inner, n_last = continuum.comm, coordinates.n_inner, coordinates.n_last
    slots = coordinates.inner_dofs
    product = stiffness.ptap(coordinates.transform)
    indptr, indices, data = product.getValuesCSR()
    ranges = np.asarray(product.getOwnershipRangesColumn(), dtype=np.int64)
    product.destroy()
    columns = _places(continuum, coordinates, ranges, indices)
    rows = sp.csr_matrix(
        (data, columns, indptr), shape=(len(indptr) - 1, continuum.n_global + n_last)
    )
    del indices, data, columns
    n_first = n_last - len(borders)
    spread = sp.csr_matrix(
        (np.ones(n_inner), (slots, np.arange(n_inner))), shape=(continuum.n_local, n_inner)
    )
    coupling = (spread @ rows[:n_inner, continuum.n_global :]).tocsc()
    corner = rows[n_inner:, continuum.n_global :]  # on rank 0; empty elsewhere
    right = coordinates.transform.createVecRight()
    dense = np.zeros((continuum.n_local, len(borders)))
    edge = sp.lil_matrix((n_last, n_last))
    for i, border in enumerate(borders):
        coordinates.transform.multTranspose(border, right)
        dense[slots, i] = right.array[:n_inner]
        if comm.rank == 0:
            edge[n_first + i, :n_first] = right.array[n_inner : n_inner + n_first]
    right.destroy()
    if borders:
        coupling = sp.hstack([coupling[:, :n_first], sp.csc_matrix(dense)], format="csc")
    inner = (spread @ rows[:n_inner, : continuum.n_global]).tocsr()
    del rows
    own = inner[:, continuum.offset : continuum.offset + continuum.n_local]
    mean = comm.allreduce(float(own.diagonal().sum())) / max(comm.allreduce(n_inner), 1)
    left = np.setdiff1d(np.arange(continuum.n_local), slots)
    unit = sp.csr_matrix(
        (np.full(len(left), mean), (left, continuum.offset + left)), shape=inner.shape
    )
    inner = (inner + unit).tocsr()
    inner.sort_indices()
    edge = edge.tocsr()
    whole = corner + edge + edge.T if comm.rank == 0 else None
    return _Parts(inner, coupling, sp.csr_matrix(comm.bcast(whole)))


def _places(
    continuum: Continuum, coordinates: JumpCoordinates, ranges: Ints, indices: npt.NDArray[np.int32]
) -> Ints:
    """Global dof of each coordinate in ``indices``; n_global + k for the last coordinate k."""
    comm = continuum.comm
    mine = (coordinates.inner_dofs + continuum.offset).astype(np.int64)
    if comm.rank == 0:
        mine = np.concatenate([mine, continuum.n_global + np.arange(coordinates.n_last)])
    first, end = int(ranges[comm.rank]), int(ranges[comm.rank + 1])
    used = np.unique(indices)
    ghosts = used[(used < first) | (used >= end)].astype(np.int64)
    # doubles hold whole numbers up to 2^53
    fetched = Halo(comm, ranges, ghosts).fetch(mine[:, None].astype(np.float64))[:, 0]
    known = np.concatenate([np.arange(first, end), ghosts])
    place = np.concatenate([mine, fetched.astype(np.int64)])
    order = np.argsort(known)
    return np.asarray(place[order][np.searchsorted(known[order], indices)])


def _motions(continuum: Continuum, coordinates: JumpCoordinates) -> Array:
    """Rigid motions in jump coordinates on the owned dofs; jumps and places left over are zero."""
    indptr, _, _ = coordinates.transform.getValuesCSR()
    motions = rigid_motions(continuum)
    inner = np.zeros(continuum.n_local, dtype=bool)
    inner[coordinates.inner_dofs] = True
    # a slave's displacement has its masters' beside its own jump
    motions[~inner | (np.diff(indptr) > 1)] = 0.0
    return motions


def _petsc(local: sp.csr_matrix, like: PETSc.Mat) -> PETSc.Mat:
    """A copy for PETSc with the layout and blocks of another matrix."""
    matrix = PETSc.Mat().createAIJ(
        like.getSizes(),
        bsize=like.getBlockSize(),
        csr=(
            local.indptr.astype(PETSc.IntType),
            local.indices.astype(PETSc.IntType),
            local.data,
        ),
        comm=like.getComm(),
    )
    matrix.assemble()
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    return matrix
