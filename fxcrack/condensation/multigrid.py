"""Smoothed-aggregation multigrid on blocks of vectors, in single precision.

PETSc's GAMG makes the levels from the matrix and the rigid motions; the cycle itself runs here, on
many right-hand sides at once: V(1,1) with Chebyshev polynomials of degree 2 of D^-1 A, exact on the
coarsest level. It is a symmetric positive operator, and a preconditioner needs no more digits.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy.linalg import cho_factor, cho_solve

from fxcrack.base.arrays import Array
from fxcrack.base.errors import SolverError
from fxcrack.condensation.block_matrix import Block, BlockMatrix
from fxcrack.condensation.mumps_schur import mumps_message

_PREFIX = "fxcrack_gamg_"
_BOTTOM = 400  # unknowns a dense factor solves for sooner than more levels do
_DEGREE = 2
_LOWEST = 0.1  # the polynomial damps eigenvalues above this part of the largest
_SAFETY = 1.1  # the power method comes from below
_SINGULAR = 1e-13  # a coarse eigenvalue below it, of the scaled matrix, is round-off


class Multigrid:
    """A hierarchy for one matrix; collective.

    Args:
        matrix: Symmetric positive definite, PETSc AIJ with blocks of ``gdim`` rows.
        fine: The same as a block matrix.
        motions: Rigid motions on the owned rows, shape (n_local, n_motions).

    Attributes:
        sizes: Number of unknowns per level, coarsest first.

    Raises:
        SolverError: The coarsest matrix is singular: a body can move freely.
    """

    def __init__(self, matrix: PETSc.Mat, fine: BlockMatrix, motions: Array) -> None:
        vectors = []
        for motion in motions.T:
            vector = matrix.createVecLeft()
            vector.array[:] = motion
            vectors.append(vector)
        _orthonormalise(vectors)
        space = PETSc.NullSpace().create(vectors=vectors, comm=matrix.getComm())
        matrix.setNearNullSpace(space)
        pc = PETSc.PC().create(matrix.getComm())
        pc.setOptionsPrefix(_PREFIX)
        options = PETSc.Options(_PREFIX)
        if not options.hasName("pc_gamg_coarse_eq_limit"):
            options["pc_gamg_coarse_eq_limit"] = _BOTTOM
        pc.setOperators(matrix)
        pc.setType(PETSc.PC.Type.GAMG)
        pc.setFromOptions()
        pc.setUp()
        n_levels = pc.getMGLevels()
        coarse = [pc.getMGSmoother(i).getOperators()[0] for i in range(n_levels - 1)]
        self._levels = [BlockMatrix.from_petsc(a, np.float32) for a in coarse]
        self._levels.append(fine.rounded())
        self._prolong = [
            BlockMatrix.from_petsc(pc.getMGInterpolation(i), np.float32) for i in range(1, n_levels)
        ]
        self.sizes = [a.getSize()[0] for a in coarse] + [matrix.getSize()[0]]
        bottom = coarse[0] if coarse else matrix
        self._first, self._bottom = _dense(bottom)
        pc.destroy()
        for thing in (space, *vectors):
            thing.destroy()
        self._inverse = [(1.0 / a.diagonal()).astype(np.float32)[:, None] for a in self._levels]
        self._largest = [
            _SAFETY * _largest_eigenvalue(a, d)
            for a, d in zip(self._levels, self._inverse, strict=True)
        ]

    def __call__(self, right: Block) -> Block:
        """One cycle from zero on a block, shape (n_owned, k); collective."""
        return self._cycle(len(self._levels) - 1, np.ascontiguousarray(right, dtype=np.float32))

    def _cycle(self, level: int, right: Block) -> Block:
        if level == 0:
            return self._solve_bottom(right)
        matrix, prolong = self._levels[level], self._prolong[level - 1]
        x = self._smooth(level, right, None)
        residual = matrix @ x
        np.subtract(right, residual, out=residual)
        x += prolong @ self._cycle(level - 1, prolong.transposed_times(residual))
        return self._smooth(level, right, x)

    def _smooth(self, level: int, right: Block, x: Block | None) -> Block:
        """Chebyshev iteration (Saad 2003, algorithm 12.1) on D^-1 A."""
        matrix, inverse = self._levels[level], self._inverse[level]
        high = self._largest[level]
        low = _LOWEST * high
        centre, half = 0.5 * (high + low), 0.5 * (high - low)
        sigma = centre / half
        rho = 1.0 / sigma
        if x is None:
            residual = right.copy()
        else:
            residual = matrix @ x
            np.subtract(right, residual, out=residual)
        step = residual * inverse
        step *= np.float32(1.0 / centre)
        x = step.copy() if x is None else x + step
        for _ in range(1, _DEGREE):
            residual -= matrix @ step
            after = 1.0 / (2.0 * sigma - rho)
            step *= np.float32(after * rho)
            scaled = residual * inverse
            scaled *= np.float32(2.0 * after / half)
            step += scaled
            x += step
            rho = after
        return x

    def _solve_bottom(self, right: Block) -> Block:
        comm = self._levels[0].comm
        whole = np.concatenate(comm.allgather(right)) if comm.size > 1 else right
        x = cho_solve(self._bottom, whole.astype(np.float64), check_finite=False)
        return np.ascontiguousarray(x[self._first : self._first + len(right)], dtype=np.float32)


def _orthonormalise(vectors: list[PETSc.Vec]) -> None:
    """Gram-Schmidt in place; a vector that the others span becomes zero."""
    for i, vector in enumerate(vectors):
        before = vector.norm()
        for other in vectors[:i]:
            vector.axpy(-vector.dot(other), other)
        length = vector.norm()
        if length > 1e-10 * before:
            vector.scale(1.0 / length)
        else:
            vector.set(0.0)


def _dense(matrix: PETSc.Mat) -> tuple[int, tuple[Array, bool]]:
    """First row of this rank, and the Cholesky factor of the whole matrix on every rank."""
    block = BlockMatrix.from_petsc(matrix)
    comm = block.comm
    first, end = matrix.getOwnershipRange()
    unit = np.zeros((end - first, matrix.getSize()[0]))
    unit[np.arange(end - first), np.arange(first, end)] = 1.0
    dense = np.concatenate(comm.allgather(block @ unit))
    dense = 0.5 * (dense + dense.T)
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(dense), 1e-300))
    smallest = np.linalg.eigvalsh(dense * scale[:, None] * scale)[0]
    if not comm.bcast(bool(smallest > _SINGULAR)):
        raise SolverError(mumps_message(-10, 0))
    return first, cho_factor(dense, lower=True)


def _largest_eigenvalue(matrix: BlockMatrix, inverse: Block, steps: int = 20) -> float:
    """Largest eigenvalue of D^-1 A by the power method; the same on every rank."""
    comm = matrix.comm
    x = np.random.default_rng(comm.rank).standard_normal((matrix.n_owned, 1)).astype(np.float32)
    value = 1.0
    for _ in range(steps):
        length = np.sqrt(comm.allreduce(float((x * x).sum())))
        x = inverse * (matrix @ (x / np.float32(length)))
        value = np.sqrt(comm.allreduce(float((x * x).sum())))
    return float(comm.bcast(value))
