"""Nodes of lumped mass that a bond ties to a rigid surface along its normal alone.

The surface does not move, so that such a node keeps what its motion has along the surface,

    a = (1 - n n^t) f/m,    p = n n . (m a - f)

with the force f on it and the bond force p.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import InterfaceError
from fxcrack.interface.pair import Pair


class SlippingTies:
    """Tied rows whose slaves slip along a rigid surface.

    Args:
        rows: The rows, shape (n,).
        slaves: Their nodes, shape (n,).
        normals: Unit normals of the surface at them, shape (n, gdim).
    """

    def __init__(self, rows: Ints, slaves: Ints, normals: Array) -> None:
        self.rows, self.slaves, self._normals = rows, slaves, normals

    def __len__(self) -> int:
        """How many there are."""
        return len(self.rows)

    def along_normals(self, values: Array) -> Array:
        """The part of vectors of the slaves along the normals, shape (n, gdim)."""
        along = np.einsum("nc,nc->n", values, self._normals)
        return np.asarray(along[:, None] * self._normals)

    def follow(self, values: Array) -> None:
        """Take the motion along the normals off that of the nodes, shape (n_nodes, gdim)."""
        values[self.slaves] -= self.along_normals(values[self.slaves])

    def projection(self, n_nodes: int) -> sp.csr_matrix:
        """What :meth:`follow` does, on components of the nodes, square."""
        gdim = self._normals.shape[1]
        at = gdim * self.slaves[:, None] + np.arange(gdim)
        row = np.repeat(at, gdim, axis=1).ravel()
        column = np.tile(at, (1, gdim)).ravel()
        taken = np.einsum("nc,nd->ncd", self._normals, self._normals).ravel()
        size = n_nodes * gdim
        matrix = sp.csr_matrix((taken, (row, column)), shape=(size, size))
        return sp.csr_matrix(sp.identity(size, format="csr") - matrix)


def slipping(pairs: Sequence[Pair], row_of: Sequence[Ints], n_rows: int) -> tuple[Bools, Bools]:
    """Rows with a rigid master, and those among them whose bonds hold along the normal alone.

    Args:
        pairs: Interfaces.
        row_of: Row of each slave node per pair, -1 where it has no jump.
        n_rows: Number of rows.

    Returns:
        Shape (n_rows,) each.
    """
    rigid, slips = np.zeros(n_rows, dtype=bool), np.zeros(n_rows, dtype=bool)
    for pair, rows in zip(pairs, row_of, strict=True):
        if pair.rigid is not None:
            chosen = rows[rows >= 0]
            rigid[chosen], slips[chosen] = True, pair.interface.normal_only
    return rigid, slips


def refuse_masters_that_slip(slips: Bools, masters: Ints) -> None:
    """Refuse slaves of one interface that follow a node which slips in another.

    Args:
        slips: Whether each row's bond holds along the normal alone, shape (n_rows,).
        masters: Rows of slaves that are masters of others, shape (n,).

    Raises:
        InterfaceError: There is one.
    """
    if np.any(slips[masters]):
        raise InterfaceError(
            "Explicit: a node on a plane of symmetry, or bonded to a rigid surface along its "
            "normal alone, is master of another interface; exchange slave and master of that "
            "interface, or hold the node by Displacement instead"
        )


__all__ = ["SlippingTies", "refuse_masters_that_slip", "slipping"]
