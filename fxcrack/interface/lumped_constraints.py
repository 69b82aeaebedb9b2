"""Couplings and equations between nodes of lumped mass, whole on every rank.

Some components of nodes follow others and the prescribed motions q of references,

    u = T y + S q

with y the components that follow nothing (:mod:`fxcrack.interface.following`). Their masses are
those of T^t m T, which is diagonal but for small sets: the dofs that are followed by common
followers F,

    T^t m T = m_y + W^t m_F W

Its inverse is kept as D + X K X^t. A rigid set, of which few dofs are followed, has D = 0, X = 1
and K the inverse itself. A mean, with few followers, has D = 1/m_y, X = W^t/m_y and
K = -(1/m_F + W D W^t)^-1 (Woodbury). Nothing is added to the motion: a rigid set has the mass and
the moments of inertia of its nodes about its reference, and momentum is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.sparse import Product
from fxcrack.interface.following import Following
from fxcrack.interface.nodes import InterfaceNodes


@dataclass(frozen=True)
class SparseInverse:
    """The inverse of a mass matrix as D + X K X^t on components of the nodes.

    Attributes:
        direct: D, shape (n,).
        shape: X, shape (n, k).
        small: K, shape (k, k), in blocks.
    """

    direct: Array
    shape: sp.csr_matrix
    small: sp.csr_matrix


class SetAccelerations:
    """Accelerations of nodes by the forces on them, T D T^t + Y K Y^t with Y = T X.

    Args:
        motion: T, motion of all components by those that follow nothing, shape (n, n).
        inverse: Inverse of the mass matrix of these.
    """

    def __init__(self, motion: sp.csr_matrix, inverse: SparseInverse) -> None:
        self._direct = sp.csr_matrix(motion @ sp.diags(inverse.direct) @ motion.T)
        self._by_sets = sp.csr_matrix(motion @ inverse.shape)
        self._small = inverse.small
        self._product = Product(self._direct)
        self._sum = Product(self._by_sets.T)
        self._spread = Product(self._by_sets)
        self._solve = Product(self._small)
        self._summed, self._solved = (np.zeros(self._small.shape[0]) for _ in range(2))

    def into(self, x: Array, y: Array) -> Array:
        """Write the accelerations by forces x over y, shape (n,) each, and return y."""
        self._product.into(x, y)
        self._sum.into(x, self._summed)
        self._solve.into(self._summed, self._solved)
        self._spread.add(self._solved, y)
        return y

    def __call__(self, x: Array) -> Array:
        """Accelerations by forces x, a new array of shape (n,)."""
        return self.into(x, np.empty(len(x)))

    def rows(self, at: Ints) -> sp.csr_matrix:
        """Some rows of the matrix, shape (len(at), n)."""
        return self.left(sp.csr_matrix(sp.identity(self._direct.shape[0], format="csr")[at]))

    def times(self, columns: sp.csr_matrix) -> sp.csr_matrix:
        """The matrix times a sparse one, shape (n, m)."""
        return sp.csr_matrix(self.left(columns.T).T)

    def left(self, rows: sp.csr_matrix) -> sp.csr_matrix:
        """A sparse matrix of shape (m, n) times this one, which is symmetric."""
        by_sets = rows @ self._by_sets
        return sp.csr_matrix(rows @ self._direct + by_sets @ self._small @ self._by_sets.T)

    def moves_sets(self, rows: sp.csr_matrix) -> bool:
        """Whether forces on rows of shape (m, n) accelerate any set as a whole."""
        by_sets = sp.csr_matrix(rows @ self._by_sets)
        by_sets.eliminate_zeros()
        return bool(by_sets.nnz)

    def diagonal_of(self, rows: sp.csr_matrix) -> Array:
        """Diagonal of R A R^t with rows R of shape (m, n), shape (m,)."""
        by_sets = sp.csr_matrix(rows @ self._by_sets)
        direct = sp.csr_matrix(rows @ self._direct).multiply(rows)
        sets = sp.csr_matrix(by_sets @ self._small).multiply(by_sets)
        return np.asarray(direct.sum(axis=1) + sets.sum(axis=1)).ravel()

    def bound_of(self, rows: sp.csr_matrix) -> Array:
        """Bound on the sums of |R A R^t| over its rows, shape (m,)."""
        each = np.ones(rows.shape[0])
        size, by_sets = abs(rows), abs(rows @ self._by_sets)
        direct = size @ (abs(self._direct) @ (size.T @ each))
        return np.asarray(direct + by_sets @ (abs(self._small) @ (by_sets.T @ each)))


class LumpedConstraints:
    """Components of nodes that follow others.

    Args:
        following: All dofs that follow others, and what they follow.
        nodes: Nodes that have all of these.

    Attributes:
        n_motions: Number of prescribed motions of references.
        motion: T, shape (n, n): the identity where a component follows nothing.
        shares: S, shape (n, n_motions).
    """

    def __init__(self, following: Following, nodes: InterfaceNodes) -> None:
        layout = nodes.layout
        width = layout.n_unknowns  # those of solids: displacements alone

        def place(dofs: Ints) -> Ints:
            return np.asarray(width * nodes.find(dofs // width) + dofs % width)

        n = width * len(nodes)
        self._rows, self._columns = place(following.dofs), place(following.masters)
        self._weights = following.matrix
        self.n_motions = following.prescribed.shape[1]
        follows = np.zeros(n, dtype=bool)
        follows[self._rows] = True
        self._follows = follows
        self.motion = self._placed(following.matrix, self._columns, n) + sp.diags(
            np.where(follows, 0.0, 1.0)
        )
        self.motion = sp.csr_matrix(self.motion)
        self.shares = self._placed(following.prescribed, np.arange(self.n_motions), self.n_motions)

    def _placed(self, matrix: sp.csr_matrix, columns: Ints, width: int) -> sp.csr_matrix:
        """Rows of the followers among those of all components."""
        entries = sp.coo_matrix(matrix)
        at = self._rows[entries.row], columns[entries.col]
        return sp.csr_matrix((entries.data, at), shape=(len(self._follows), width))

    @property
    def involved(self) -> Ints:
        """Components that follow or are followed, shape (m,)."""
        return np.union1d(self._rows, self._columns)

    def displaced(self, u: Array, q: Array) -> Array:
        """Displacements with those of the followers put right, shape (n,), length.

        Args:
            u: Of all components, shape (n,).
            q: Motions of references, shape (n_motions,).
        """
        return np.asarray(self.motion @ u + self.shares @ q)

    def inverse(self, mass: Array, free: Bools) -> SparseInverse:
        """(T^t m T)^-1 on the components that follow nothing and are not prescribed.

        Args:
            mass: Of all components, shape (n,).
            free: Components that no support prescribes, shape (n,).
        """
        roots = free & ~self._follows
        direct = np.where(roots, 1.0 / mass, 0.0)
        keep = np.flatnonzero(roots[self._columns])
        weights = sp.csr_matrix(self._weights[:, keep])
        columns, n = self._columns[keep], len(mass)
        graph = sp.bmat([[None, weights], [weights.T, None]], format="csr")
        shape = sp.csr_matrix((n, 0))
        if not len(keep):
            return SparseInverse(direct, shape, sp.csr_matrix((0, 0)))
        count, label = connected_components(graph, directed=False)
        first = len(self._rows)
        by_label = np.argsort(label, kind="stable")
        parts = np.split(by_label, np.cumsum(np.bincount(label, minlength=count))[:-1])
        shapes: list[tuple[Ints, Ints, Array]] = []
        blocks: list[Array] = []
        width = 0
        for part in parts:
            f, m = part[part < first], part[part >= first] - first
            if not len(m) or not len(f):
                continue
            w = weights[f][:, m].toarray()
            of_f, of_m = mass[self._rows[f]], mass[columns[m]]
            if len(m) <= len(f):
                direct[columns[m]] = 0.0
                x = np.eye(len(m))
                k = np.linalg.inv(np.diag(of_m) + (w.T * of_f) @ w)
            else:
                x = w.T / of_m[:, None]
                k = -np.linalg.inv(np.diag(1.0 / of_f) + w @ x)
            r, c = np.nonzero(x)
            shapes.append((columns[m][r], width + c, x[r, c]))
            blocks.append(0.5 * (k + k.T))
            width += x.shape[1]
        if width:
            r, c, v = (np.concatenate(p) for p in zip(*shapes, strict=True))
            shape = sp.csr_matrix((v, (r, c)), shape=(n, width))
        return SparseInverse(direct, shape, _in_blocks(blocks, width))


def _in_blocks(blocks: list[Array], width: int) -> sp.csr_matrix:
    """A matrix of square blocks along its diagonal, shape (width, width)."""
    rows, columns, first = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)], 0
    for block in blocks:
        k = len(block)
        at = first + np.arange(k)
        rows.append(np.repeat(at, k))
        columns.append(np.tile(at, k))
        first += k
    data = np.concatenate([np.zeros(0), *(b.ravel() for b in blocks)])
    return sp.csr_matrix((data, (np.concatenate(rows), np.concatenate(columns))),
                         shape=(width, width))  # fmt: skip


__all__ = ["LumpedConstraints", "SetAccelerations", "SparseInverse"]
