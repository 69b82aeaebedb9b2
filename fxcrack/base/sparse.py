"""Products of sparse matrices that add to an array in place: one compiled call, no new array.

An increment of a small model of explicit dynamics is a few dozen such calls; ``A @ x`` costs
ten times as much for a small matrix, in checks and in an array for the result.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg.blas import daxpy

from fxcrack.base.arrays import Array, Ints

try:  # no public function of SciPy adds to an array
    from scipy.sparse._sparsetools import csr_matvec
except ImportError:  # it may move: the public product, which costs more for small matrices

    def csr_matvec(
        n: int, m: int, starts: Ints, columns: Ints, data: Array, x: Array, y: Array
    ) -> None:
        """Add A x to y."""
        y += sp.csr_matrix((data, columns, starts), shape=(n, m)) @ x


_ON_ONE_THREAD = 8192
"""Entries of a vector that OpenBLAS does not share among threads: to wake one takes longer than the
sum itself, and threads that wait for the next one take the cores of other processes."""


class Product:
    """y += A x with a matrix in compressed rows.

    Args:
        matrix: A, shape (n, m), of scipy.

    Attributes:
        shape: Shape of A.
        data: Its entries by rows, shape (n_entries,); may be changed in place.
    """

    __slots__ = ("_columns", "_starts", "data", "shape")

    def __init__(self, matrix: Any) -> None:
        rows = sp.csr_matrix(matrix)
        self.shape: tuple[int, int] = rows.shape
        self._starts, self._columns = rows.indptr, rows.indices
        self.data: Array = np.ascontiguousarray(rows.data, dtype=np.float64)

    @classmethod
    def of_rows(cls, columns: Ints, data: Array, width: int) -> Product:
        """A matrix with as many entries in every row.

        Args:
            columns: Shape (n, k).
            data: Entries, same shape.
            width: m.
        """
        out = cls.__new__(cls)
        n, k = columns.shape
        out.shape = n, width
        out._starts = np.arange(0, n * k + 1, max(k, 1), dtype=np.int32)[: n + 1]
        if not k:
            out._starts = np.zeros(n + 1, dtype=np.int32)
        out._columns = columns.astype(np.int32).ravel()
        out.data = np.ascontiguousarray(data, dtype=np.float64).ravel()
        return out

    @classmethod
    def of_columns(cls, rows: Ints, data: Array, height: int) -> Product:
        """A matrix with as many entries in every column.

        Args:
            rows: Shape (m, k).
            data: Entries, same shape.
            height: n.
        """
        out = cls.__new__(cls)
        m, k = rows.shape
        out.shape = height, m
        flat = rows.ravel()
        order = np.argsort(flat, kind="stable")
        out._starts = np.zeros(height + 1, dtype=np.int32)
        np.cumsum(np.bincount(flat, minlength=height), out=out._starts[1:])
        out._columns = np.repeat(np.arange(m, dtype=np.int32), k)[order]
        out.data = np.ascontiguousarray(data, dtype=np.float64).ravel()[order]
        return out

    def add(self, x: Array, y: Array) -> None:
        """Add A x to y.

        Args:
            x: Shape (m,), contiguous.
            y: Shape (n,), contiguous.
        """
        n, m = self.shape
        csr_matvec(n, m, self._starts, self._columns, self.data, x, y)

    def into(self, x: Array, y: Array) -> Array:
        """Write A x over y, and return y; shapes as for :meth:`add`."""
        y.fill(0.0)
        n, m = self.shape
        csr_matvec(n, m, self._starts, self._columns, self.data, x, y)
        return y

    def __call__(self, x: Array) -> Array:
        """A x as a new array of shape (n,)."""
        return self.into(x, np.empty(self.shape[0]))

    def rows(self, at: Ints) -> sp.csr_matrix:
        """Some rows of A, shape (len(at), m)."""
        return sp.csr_matrix(self.matrix()[at])

    def times(self, columns: sp.csr_matrix) -> sp.csr_matrix:
        """A times a sparse matrix of shape (m, k)."""
        return sp.csr_matrix(self.matrix() @ columns)

    def matrix(self) -> sp.csr_matrix:
        """A, sharing its entries."""
        return sp.csr_matrix((self.data, self._columns, self._starts), shape=self.shape)


def add_multiple(y: Array, factor: float, x: Array) -> None:
    """Add factor x to y in place, in one pass through memory; both contiguous, shape (n,)."""
    for begin in range(0, len(y), _ON_ONE_THREAD):
        part = slice(begin, begin + _ON_ONE_THREAD)
        daxpy(x[part], y[part], a=factor)


def by_component(matrix: Any, n: int) -> sp.csr_matrix:
    """A matrix on nodes as one on n components of each of them, node by node."""
    return sp.kron(matrix, sp.identity(n, format="csr"), format="csr")


__all__ = ["Product", "add_multiple", "by_component"]
