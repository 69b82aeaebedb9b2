"""Borders of the bordered matrix: force patterns and monitored displacements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base import compat
from fxcrack.base.arrays import Ints
from fxcrack.base.errors import raise_on_all_ranks
from fxcrack.condensation.shared_columns import SharedColumns
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.load_vectors import load_vector, monitor_weights
from fxcrack.continuum.loads import Load, Monitor
from fxcrack.interface.jump_coordinates import JumpCoordinates


def load_and_monitor_vectors(
    continuum: Continuum, loads: list[Load], monitors: list[Monitor], followed: Sequence[Ints] = ()
) -> list[PETSc.Vec]:
    """Force patterns with the minus sign, then monitors, as vectors on displacements; collective.

    Args:
        continuum: Displacement space.
        loads: Force patterns.
        monitors: Monitored displacements.
        followed: Sets of this rank's nodes whose mean displacement is wanted, all components, each
            of shape (n,).

    Returns:
        One vector per load (force), per monitor and per component of each set (dimensionless).
    """
    out = []
    for load in loads:
        vector = load_vector(continuum, load)
        good = np.all(np.isfinite(vector.array_r))
        bad = f"load '{load.title}' is not a finite number everywhere; correct its value"
        raise_on_all_ranks(continuum.comm, None if good else bad)
        vector.scale(-1.0)
        out.append(vector)
    for monitor in monitors:
        vector = PETSc.Vec().createMPI((continuum.n_local, continuum.n_global), comm=continuum.comm)
        vector.array[:] = monitor_weights(continuum, monitor)
        out.append(vector)
    for mine in followed:
        count = continuum.comm.allreduce(len(mine))
        for i in range(continuum.gdim):
            size = (continuum.n_local, continuum.n_global)
            vector = PETSc.Vec().createMPI(size, comm=continuum.comm)
            vector.array[continuum.layout.dof(mine, i)] = 1.0 / count
            out.append(vector)
    return out


def _with_springs(matrix: PETSc.Mat, coordinates: JumpCoordinates) -> PETSc.Mat:
    """Add the springs of bonds to T^t K T, which holds their entries already; collective."""
    for one in coordinates.springs:
        for row, column, value in zip(one.rows, one.columns, one.values, strict=True):
            matrix.setValue(row, column, value, addv=PETSc.InsertMode.ADD_VALUES)
    if coordinates.springs:
        matrix.assemble()
    return matrix


class BorderedMatrix:
    """A = T^t K T + D with its borders; collective. D: springs of bonds that have some.

    Args:
        stiffness: K; stays with the caller.
        coordinates: T and its numbering.
        borders: From :func:`load_and_monitor_vectors`; stay with the caller.
        renewable: Whether K changes later on; memory for that is kept then.

    Attributes:
        matrix: The matrix.
        on_retained: What each border holds in the rows of retained jumps (for a force pattern minus
            the load on the slave face), shape (n_retained, n_borders), on every rank.
    """

    def __init__(
        self,
        stiffness: PETSc.Mat,
        coordinates: JumpCoordinates,
        borders: list[PETSc.Vec],
        *,
        renewable: bool = False,
    ) -> None:
        self._transform = coordinates.sparse
        self._inner: PETSc.Mat | None = None  # without borders, where that is another matrix
        self._where: Ints = np.zeros(0, dtype=np.int64)  # its entries among those of the whole
        self._where_shared: Ints = self._where  # likewise those of shared unknowns
        inner = _with_springs(stiffness.ptap(coordinates.sparse), coordinates)
        self.on_retained = np.zeros((coordinates.n_retained, len(borders)))
        self._shared = SharedColumns(coordinates) if len(coordinates.shared) else None
        if not borders and self._shared is None:
            self.matrix = inner
            return
        comm = compat.plain_comm(inner.getComm().tompi4py())
        shape, _ = inner.getSizes()
        indptr, indices, data = inner.getValuesCSR()
        parts: list[Any] = [sp.csr_matrix((data, indices, indptr), shape=shape)]
        shared = np.zeros(0)
        if self._shared is not None:
            shared = self._shared.values(stiffness)
            places = self._shared.rows, self._shared.columns
            parts.append(sp.coo_matrix((shared, places), shape=shape))
        parts += self._border_parts(inner, coordinates, borders, comm)
        comm.Bcast(self.on_retained)
        if renewable:  # zeros are stored as well: they may not be zero next time
            coo = [part.tocoo() for part in parts]
            row, col, value = (
                np.concatenate([getattr(c, name) for c in coo]) for name in ("row", "col", "data")
            )
            total = sp.coo_matrix((value, (row, col)), shape=shape).tocsr()
        else:
            total = sum(parts[1:], parts[0]).tocsr()
        total.sort_indices()
        structure = tuple(x.astype(PETSc.IntType) for x in (total.indptr, total.indices))
        self.matrix = PETSc.Mat().createAIJ(
            (shape, shape), csr=(*structure, total.data), comm=stiffness.getComm()
        )
        self.matrix.assemble()
        if not renewable:
            inner.destroy()
            return
        self._inner, self._structure = inner, structure
        own, all_ = (
            np.repeat(np.arange(shape[0], dtype=np.int64), np.diff(p)) * shape[1] + i
            for p, i in ((indptr, indices), (total.indptr, total.indices))
        )
        self._where = np.searchsorted(all_, own)
        self._borders = total.data
        self._borders[self._where] -= data  # the borders alone are left
        if self._shared is not None:
            theirs = self._shared.rows * shape[1] + self._shared.columns
            self._where_shared = np.searchsorted(all_, theirs)
            self._borders[self._where_shared] -= shared

    def _border_parts(
        self,
        inner: PETSc.Mat,
        coordinates: JumpCoordinates,
        borders: list[PETSc.Vec],
        comm: MPI.Intracomm,
    ) -> list[Any]:
        """This rank's rows and columns of every border."""
        shape, _ = inner.getSizes()
        first = coordinates.first + coordinates.n_retained + coordinates.n_supports
        start, _ = inner.getOwnershipRange()
        right, parts = inner.createVecRight(), []
        for i, border in enumerate(borders):
            coordinates.transform.multTranspose(border, right)
            if comm.rank == 0:
                retained = slice(coordinates.n_inner, coordinates.n_inner + coordinates.n_retained)
                self.on_retained[:, i] = right.array[retained]
            local = np.flatnonzero(right.array)
            values = right.array[local]
            parts.append(
                sp.csr_matrix((values, (local, np.full(len(local), first + i))), shape=shape)
            )
            found: Any = comm.gather((local + start, values))
            if comm.rank == 0:
                columns, entries = (np.concatenate(p) for p in zip(*found, strict=True))
                # a stored diagonal, however small: without one the symmetric conversion goes wrong
                columns = np.append(columns, first + i)
                entries = np.append(entries, 1e-300)
                row = np.full(len(columns), first + i)
                parts.append(sp.csr_matrix((entries, (row, columns)), shape=shape))
        right.destroy()
        return parts

    def renew(self, stiffness: PETSc.Mat) -> None:
        """Take another K with the same nonzero pattern; collective."""
        if self._inner is None:
            stiffness.ptap(self._transform, result=self.matrix)
            return
        stiffness.ptap(self._transform, result=self._inner)
        data = self._borders.copy()
        data[self._where] += self._inner.getValuesCSR()[2]
        if self._shared is not None:
            data[self._where_shared] += self._shared.values(stiffness)
        self.matrix.setValuesCSR(*self._structure, data)
        self.matrix.assemble()

    def destroy(self) -> None:
        """Free the matrices; collective."""
        self.matrix.destroy()
        if self._inner is not None:
            self._inner.destroy()
