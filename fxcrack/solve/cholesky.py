"""A dense Cholesky factor that grows and shrinks with the set of free unknowns.

    L L^t = S[free, free]

Appending k unknowns costs one forward substitution, removing some costs the trailing block.
All work is done on blocks of rows, by BLAS, without copies of the stored factor.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import lapack

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_BLOCK = 64


class NotPositiveDefinite(ArithmeticError):
    """A pivot vanished: the unknown ``index`` is not restrained by anything.

    Attributes:
        index: Number of the unknown in S.
    """

    def __init__(self, index: int) -> None:
        super().__init__(f"unknown {index} is not restrained")
        self.index = index


class GrowingCholesky:
    """Factor of a growing principal block of a symmetric matrix.

    Args:
        matrix: S, shape (n, n); only read.
        floor: A pivot below ``floor`` times the diagonal of S counts as zero.
    """

    def __init__(self, matrix: Array, *, floor: float = 1e-10) -> None:
        self._matrix = matrix
        self._floor = floor
        self._rows = np.zeros((0, 0))
        self._inverse: list[Array] = []
        self.free: Ints = np.zeros(0, dtype=np.int64)

    def __len__(self) -> int:
        """Number of free unknowns."""
        return len(self.free)

    def _reserve(self, n: int) -> None:
        if n > len(self._rows):
            size = min(max(2 * len(self._rows), n, 256), max(len(self._matrix), n))
            bigger = np.zeros((size, size))
            old = len(self.free)
            bigger[:old, :old] = self._rows[:old, :old]
            self._rows = bigger

    def _diagonal_inverse(self, block: int) -> Array:
        """Inverse of a whole diagonal block, kept once the block is full."""
        while len(self._inverse) <= block:
            i = len(self._inverse) * _BLOCK
            tile = np.asfortranarray(self._rows[i : i + _BLOCK, i : i + _BLOCK])
            inverse, _ = lapack.dtrtri(tile, lower=1)
            self._inverse.append(np.tril(inverse))
        return self._inverse[block]

    def forward(self, right: Array, start: int = 0) -> Array:
        """Solve L y = right.

        Args:
            right: Shape (n_free,) or (n_free, m).
            start: Entries of ``right`` before it are known to be zero.
        """
        n = len(self.free)
        y = np.array(right, dtype=float)
        for block in range(start // _BLOCK, (n + _BLOCK - 1) // _BLOCK):
            i, j = block * _BLOCK, min((block + 1) * _BLOCK, n)
            if i:
                y[i:j] -= self._rows[i:j, :i] @ y[:i]
            y[i:j] = self._solve_tile(block, j - i, y[i:j], transposed=False)
        return y

    def backward(self, right: Array) -> Array:
        """Solve L^t x = right, shape (n_free,) or (n_free, m)."""
        n = len(self.free)
        x = np.array(right, dtype=float)
        for block in range((n + _BLOCK - 1) // _BLOCK - 1, -1, -1):
            i, j = block * _BLOCK, min((block + 1) * _BLOCK, n)
            x[i:j] = self._solve_tile(block, j - i, x[i:j], transposed=True)
            if i:
                x[:i] -= self._rows[i:j, :i].T @ x[i:j]
        return x

    def _solve_tile(self, block: int, width: int, right: Array, *, transposed: bool) -> Array:
        if width == _BLOCK:
            inverse = self._diagonal_inverse(block)
            return np.asarray((inverse.T if transposed else inverse) @ right)
        i = block * _BLOCK
        tile = np.asfortranarray(self._rows[i : i + width, i : i + width])
        columns = right.reshape(width, -1)
        x, _ = lapack.dtrtrs(tile, columns, lower=1, trans=1 if transposed else 0)
        return np.asarray(x).reshape(right.shape)

    def solve(self, right: Array) -> Array:
        """Solve S[free, free] x = right, shape (n_free,) or (n_free, m)."""
        return self.backward(self.forward(right))

    def reduced(self, extra: Ints) -> tuple[Array, Array]:
        """What S[extra, extra] becomes once the free unknowns are condensed out.

        Args:
            extra: Unknowns that are not free, shape (k,).

        Returns:
            y = L^-1 S[free, extra], shape (n_free, k), and S* = S[extra, extra] - y^t y.
        """
        y = self.forward(self._matrix[np.ix_(self.free, extra)])
        return y, self._matrix[np.ix_(extra, extra)] - y.T @ y

    def append(self, extra: Ints) -> Array:
        """Free more unknowns.

        Args:
            extra: Their numbers in S, shape (k,), none of them free yet.

        Returns:
            The new rows left of the new diagonal block, shape (k, n_free before).

        Raises:
            NotPositiveDefinite: One of them is restrained by nothing; the factor is unchanged.
        """
        extra = np.asarray(extra, dtype=np.int64)
        y, star = self.reduced(extra)
        tile = self.factorise(star, extra)
        n, k = len(self.free), len(extra)
        self._reserve(n + k)
        self._rows[n : n + k, :n] = y.T
        self._rows[n : n + k, n : n + k] = tile
        self.free = np.concatenate([self.free, extra])
        return y.T

    def factorise(self, star: Array, extra: Ints) -> Array:
        """Lower Cholesky factor of S* from :meth:`reduced`, shape (k, k).

        Raises:
            NotPositiveDefinite: One of the unknowns is restrained by nothing.
        """
        tile, info = lapack.dpotrf(star, lower=1, clean=1)
        scale = self._matrix[extra, extra]
        bad = np.diagonal(tile) ** 2 <= self._floor * scale
        if info > 0:
            raise NotPositiveDefinite(int(extra[info - 1]))
        if np.any(bad):
            raise NotPositiveDefinite(int(extra[np.argmax(bad)]))
        return np.asarray(tile)

    def remove(self, gone: Ints) -> int:
        """Hold unknowns again.

        Args:
            gone: Their numbers in S.

        Returns:
            Position of the first one removed: rows before it are unchanged.
        """
        drop = np.isin(self.free, gone)
        if not drop.any():
            return len(self.free)
        n, first = len(self.free), int(np.argmax(drop))
        keep = np.flatnonzero(~drop[first:]) + first
        trailing = self._rows[first:n, first:n]
        square = trailing @ trailing.T
        inner = keep - first
        left = self._rows[keep, :first].copy()
        self.free = self.free[~drop]
        m = len(keep)
        if m:
            tile, _ = lapack.dpotrf(square[np.ix_(inner, inner)], lower=1, clean=1)
            self._rows[first : first + m, :first] = left
            self._rows[first : first + m, first : first + m] = tile
        self._inverse = self._inverse[: first // _BLOCK]
        return first

    def back_unit(self, position: int) -> Array:
        """Row of the inverse, S[free, free]^-1 e_position, shape (n_free,)."""
        unit = np.zeros(len(self.free))
        unit[position] = 1.0
        return self.backward(self.forward(unit, start=position))


__all__ = ["GrowingCholesky", "NotPositiveDefinite"]
