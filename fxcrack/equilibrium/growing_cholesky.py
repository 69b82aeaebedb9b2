"""A dense Cholesky factor that grows and shrinks with the set of free unknowns.

    L L^t = S[free, free]

Appending k unknowns costs one forward substitution, removing some costs the trailing block.
All work is done on strips of rows, by BLAS; a strip is no wider than its last diagonal entry, so
the factor takes half of S, and it grows without copies.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from scipy.linalg import lapack

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.condensation.mumps_schur import HELD_BY_ROUND_OFF

_BLOCK = 64
AT_ONCE = 1024
"""Unknowns appended at once: what that takes besides the factor stays small beside S."""
_MARGIN = 1e-2
"""Part of what counts as zero that round-off really makes, at most (see ``round_off``); pivots
between the two are real in bodies that are held."""
_SMALL = 1e8
"""Pivots beyond this multiple of the round-off of their own diagonal entry are no round-off."""


class NotPositiveDefinite(ArithmeticError):
    """A pivot vanished: the unknown ``index`` is not restrained by anything.

    Args:
        index: Number of the unknown in S.
        why: What else is known of it.

    Attributes:
        index: Number of the unknown in S.
        why: What else is known of it, in words; empty if nothing.
    """

    def __init__(self, index: int, why: str = "") -> None:
        super().__init__(f"unknown {index} is not restrained" + (f": {why}" if why else ""))
        self.index, self.why = index, why


class Restraint(Protocol):
    """What holds the unknowns, told from the geometry of the bodies instead of from pivots."""

    def find(self, free: Ints | None = None) -> str:
        """What can move once some unknowns, shape (k,), are free, in words; empty if nothing."""

    def warn(self, digits: float) -> None:
        """Take note that round-off changes a pivot by this part of it."""


class GrowingCholesky:
    """Factor of a growing principal block of a symmetric matrix.

    Args:
        matrix: S, shape (n, n); only read.
        floor: A pivot below ``floor`` times the diagonal of S counts as zero.

    Attributes:
        round_off: Round-off e of the entries of S, a number or one per unknown, shape (n,). A pivot
            is the energy v^t S v of the motion v of all free unknowns that it leaves least
            restrained, with v = 1 at its own; below sum e_i v_i^2 it counts as zero as well.
        restraint: Who is asked before a positive pivot counts as zero; ``None`` for nobody.
    """

    def __init__(self, matrix: Array, *, floor: float = 1e-10) -> None:
        self._matrix = matrix
        self._floor = floor
        self.round_off: float | Array = 0.0
        self.restraint: Restraint | None = None
        self._strips: list[Array] = []  # rows of L, 64 by 64, no wider than their last diagonal
        self._inverse: list[Array] = []
        self.free: Ints = np.zeros(0, dtype=np.int64)

    def __len__(self) -> int:
        """Number of free unknowns."""
        return len(self.free)

    def _write(self, first: int, rows: Array) -> None:
        """Store rows of L from a row on, shape (k, at least the columns up to their diagonals)."""
        for block, a, b, width in self._strips_of(first, first + len(rows)):
            if block == len(self._strips):
                self._strips.append(np.zeros((_BLOCK, width)))
            width = min(width, rows.shape[1])
            begin = block * _BLOCK
            self._strips[block][a - begin : b - begin, :width] = rows[a - first : b - first, :width]

    def _read(self, first: int, left: int, right: int) -> Array:
        """Rows of L from ``first`` on, columns ``left`` to ``right``, zero above the diagonal."""
        n = len(self.free)
        out = np.zeros((n - first, right - left))
        for block, a, b, width in self._strips_of(first, n):
            width = min(width, right)
            if width > left:
                begin = block * _BLOCK
                part = self._strips[block][a - begin : b - begin, left:width]
                out[a - first : b - first, : width - left] = part
        return out

    @staticmethod
    def _strips_of(first: int, last: int) -> Iterator[tuple[int, int, int, int]]:
        """Number, first and last row, and width of the strips that hold some rows."""
        for block in range(first // _BLOCK, (last + _BLOCK - 1) // _BLOCK):
            begin = block * _BLOCK
            yield block, max(first, begin), min(last, begin + _BLOCK), begin + _BLOCK

    def corner(self, k: int) -> Array:
        """Diagonal block of the last k unknowns, lower triangular, shape (k, k)."""
        n = len(self.free)
        return self._read(n - k, n - k, n)

    def _diagonal_inverse(self, block: int) -> Array:
        """Inverse of a whole diagonal block, kept once the block is full."""
        while len(self._inverse) <= block:
            i = len(self._inverse) * _BLOCK
            tile = np.asfortranarray(self._strips[len(self._inverse)][:, i:])
            inverse, _ = lapack.dtrtri(tile, lower=1)
            self._inverse.append(np.tril(inverse))
        return self._inverse[block]

    def forward(self, right: Array, start: int = 0) -> Array:
        """Solve L y = right.

        Args:
            right: Right-hand sides, shape (n_free,) or (n_free, m); y has the same shape.
            start: Entries of ``right`` before it are known to be zero.
        """
        n = len(self.free)
        y = np.array(right, dtype=float)
        for block in range(start // _BLOCK, (n + _BLOCK - 1) // _BLOCK):
            i, j = block * _BLOCK, min((block + 1) * _BLOCK, n)
            if i:
                y[i:j] -= self._strips[block][: j - i, :i] @ y[:i]
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
                x[:i] -= self._strips[block][: j - i, :i].T @ x[i:j]
        return x

    def _solve_tile(self, block: int, width: int, right: Array, *, transposed: bool) -> Array:
        if width == _BLOCK:
            inverse = self._diagonal_inverse(block)
            return np.asarray((inverse.T if transposed else inverse) @ right)
        i = block * _BLOCK
        tile = np.asfortranarray(self._strips[block][:width, i : i + width])
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
        star = self._matrix[np.ix_(extra, extra)]
        if not len(self.free):
            return np.zeros((0, len(extra))), star
        y = self.forward(self._matrix[np.ix_(self.free, extra)])
        star -= y.T @ y
        return y, star

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
        self._write(len(self.free), np.hstack([y.T, tile]))
        self.free = np.concatenate([self.free, extra])
        return y.T

    def factorise(self, star: Array, extra: Ints) -> Array:
        """Lower Cholesky factor of S* from :meth:`reduced`, shape (k, k).

        Raises:
            NotPositiveDefinite: One of the unknowns is restrained by nothing.
        """
        tile, info = lapack.dpotrf(star, lower=1, clean=1)
        if info > 0:
            every = np.concatenate([self.free, extra])
            why = "" if self.restraint is None else self.restraint.find(every)
            raise NotPositiveDefinite(int(extra[info - 1]), why)
        pivots = np.diagonal(tile) ** 2
        round_off = np.broadcast_to(self.round_off, len(self._matrix))
        zero = np.maximum(self._floor * self._matrix[extra, extra], round_off[extra])
        for j in np.flatnonzero((pivots > zero) & (pivots <= _SMALL * round_off[extra])):
            zero[j] = max(zero[j], self._round_off_of_pivot(tile, extra, int(j)))
        bad = pivots <= zero
        if np.any(bad):
            self._judge(extra, pivots / zero, bad)
        return np.asarray(tile)

    def _judge(self, extra: Ints, size: Array, bad: Bools) -> None:
        """Refuse pivots that may be round-off, unless they belong to bodies that are held.

        Args:
            extra: Unknowns to be freed, shape (k,).
            size: Their pivots over what counts as zero, shape (k,).
            bad: Those in doubt, shape (k,).

        Raises:
            NotPositiveDefinite: Nothing holds one, or round-off may be all that is seen of it.
        """
        index = int(extra[np.argmax(bad)])
        if self.restraint is None:
            raise NotPositiveDefinite(index)
        why = self.restraint.find(np.concatenate([self.free, extra]))
        least = float(size[bad].min())
        if why or least <= _MARGIN:
            raise NotPositiveDefinite(index, why or HELD_BY_ROUND_OFF)
        self.restraint.warn(_MARGIN / least)

    def _round_off_of_pivot(self, tile: Array, extra: Ints, j: int) -> float:
        """Round-off of the pivot of one of the unknowns of a factor of S*.

        A body that is free but for round-off turns about a far support: the few unknowns with long
        lever arms then carry the error, not the pivot's own diagonal entry.
        """
        unit = np.zeros((len(extra), 1))
        unit[j] = tile[j, j]
        own = lapack.dtrtrs(tile, unit, lower=1, trans=1)[0].ravel()
        others = self.solve(self._matrix[np.ix_(self.free, extra)] @ own)
        round_off = np.broadcast_to(self.round_off, len(self._matrix))
        return float(round_off[extra] @ own**2 + round_off[self.free] @ others**2)

    def remove(self, gone: Ints) -> int:
        """Hold unknowns again.

        Args:
            gone: Their numbers in S, shape (k,); those that are not free are ignored.

        Returns:
            Position of the first one removed: rows before it are unchanged.
        """
        drop = np.isin(self.free, gone)
        if not drop.any():
            return len(self.free)
        n, first = len(self.free), int(np.argmax(drop))
        keep = np.flatnonzero(~drop[first:]) + first
        if n - first > max(AT_ONCE, first):
            self._factor_anew(first, self.free[keep])
            return first
        trailing = self._read(first, first, n)
        square = trailing @ trailing.T
        inner = keep - first
        left = self._read(first, 0, first)[inner]
        self.free = self.free[~drop]
        if len(keep):
            tile, _ = lapack.dpotrf(square[np.ix_(inner, inner)], lower=1, clean=1)
            self._write(first, np.hstack([left, tile]))
        del self._strips[(len(self.free) + _BLOCK - 1) // _BLOCK :]
        self._inverse = self._inverse[: first // _BLOCK]
        return first

    def _factor_anew(self, first: int, keep: Ints) -> None:
        """Replace all rows from one on by those of other unknowns, shape (k,), taken from S.

        With few rows before it costs a sixth of a factor of the trailing block, and no memory.
        """
        self.free = self.free[:first]
        del self._strips[(first + _BLOCK - 1) // _BLOCK :]
        self._inverse = self._inverse[: first // _BLOCK]
        for i in range(0, len(keep), AT_ONCE):
            extra = keep[i : i + AT_ONCE]
            y, star = self.reduced(extra)
            tile, info = lapack.dpotrf(star, lower=1, clean=1)
            if info > 0:  # less is free than before: it cannot be but for round-off
                raise NotPositiveDefinite(int(extra[info - 1]))
            self._write(first + i, np.hstack([y.T, tile]))
            self.free = np.concatenate([self.free, extra])


__all__ = ["AT_ONCE", "GrowingCholesky", "NotPositiveDefinite", "Restraint"]
