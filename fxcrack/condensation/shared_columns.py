"""Rows and columns of A = T^t K T that belong to unknowns which all nodes share.

Such a column of T has an entry in the rows of every node, and the sparse product T^t K T would
merge as many rows into one: its cost grows with the square of the number of nodes. With the column
c of T split off, T = [T_0 c], it is a vector instead,

    A c-column = T^t (K c)

and the sparse product is that of T_0.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from fxcrack.base import compat
from fxcrack.base.arrays import Array, Ints
from fxcrack.interface.jump_coordinates import JumpCoordinates


class SharedColumns:
    """The entries of these rows and columns, at the same places whatever K is.

    Args:
        coordinates: T and which of its columns are shared.

    Attributes:
        rows: Rows of this rank's entries, counted from its first one, shape (n,).
        columns: Columns of its entries, shape (n,). No place appears twice.
    """

    def __init__(self, coordinates: JumpCoordinates) -> None:
        self._transform = transform = coordinates.transform
        self._comm = compat.plain_comm(transform.getComm().tompi4py())
        start, end = transform.getOwnershipRangeColumn()
        self._n_here, n = end - start, transform.getSize()[1]
        self._numbers = coordinates.shared
        starts = np.array(self._comm.allgather(start))
        self._owners = np.searchsorted(starts, self._numbers, side="right") - 1
        self._others = np.setdiff1d(np.arange(n), self._numbers)
        rows, columns = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        for number, owner in zip(self._numbers, self._owners, strict=True):
            rows.append(np.arange(self._n_here))
            columns.append(np.full(self._n_here, number))
            if self._comm.rank == owner:
                rows.append(np.full(len(self._others), number - start))
                columns.append(self._others)
        self.rows: Ints = np.concatenate(rows)
        self.columns: Ints = np.concatenate(columns)

    def values(self, stiffness: PETSc.Mat) -> Array:
        """The entries of T^t K T there, shape (n,); collective."""
        unit, product = self._transform.createVecRight(), self._transform.createVecRight()
        moved, force = stiffness.createVecRight(), stiffness.createVecLeft()
        start, _ = self._transform.getOwnershipRangeColumn()
        out = [np.zeros(0)]
        for number, owner in zip(self._numbers, self._owners, strict=True):
            unit.set(0.0)
            if self._comm.rank == owner:
                unit.array[number - start] = 1.0
            self._transform.mult(unit, moved)
            stiffness.mult(moved, force)
            self._transform.multTranspose(force, product)
            out.append(product.array_r.copy())
            parts = self._comm.gather(product.array_r.copy(), root=int(owner))
            if parts is not None:
                out.append(np.concatenate(parts)[self._others])
        for vector in (unit, product, moved, force):
            vector.destroy()
        return np.concatenate(out)


__all__ = ["SharedColumns"]
