"""Borders of the bordered matrix: force patterns and monitored displacements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from fxcrack import compat
from fxcrack.continuum import Continuum
from fxcrack.errors import InputError, agree
from fxcrack.interface.jumps import JumpCoordinates
from fxcrack.loads import Load, Monitor

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def border_vectors(
    continuum: Continuum, loads: list[Load], monitors: list[Monitor], followed: Sequence[Ints] = ()
) -> list[PETSc.Vec]:
    """Force patterns with the minus sign, then monitors, as vectors on displacements; collective.

    Args:
        continuum: Displacement space.
        loads: Force patterns.
        monitors: Monitored displacements.
        followed: Sets of this rank's nodes whose mean displacement is wanted, all components.
    """
    out = []
    for load in loads:
        vector = continuum.load_vector(load)
        good = np.all(np.isfinite(vector.array_r))
        bad = f"load '{load.title}' is not a finite number everywhere; mend its value"
        agree(continuum.comm, None if good else bad)
        vector.scale(-1.0)
        out.append(vector)
    for monitor in monitors:
        if len(monitor.direction) != continuum.gdim:
            raise InputError(
                f"Monitor('{monitor.title}'): direction has {len(monitor.direction)} components, "
                f"{continuum.gdim} are needed"
            )
        nodes = continuum.owned_nodes(monitor.where)
        count = continuum.comm.allreduce(len(nodes))
        vector = PETSc.Vec().createMPI((continuum.n_local, continuum.n_global), comm=continuum.comm)
        for i, component in enumerate(monitor.direction):
            vector.array[continuum.gdim * nodes + i] = component / count
        out.append(vector)
    for mine in followed:
        count = continuum.comm.allreduce(len(mine))
        for i in range(continuum.gdim):
            size = (continuum.n_local, continuum.n_global)
            vector = PETSc.Vec().createMPI(size, comm=continuum.comm)
            vector.array[continuum.gdim * mine + i] = 1.0 / count
            out.append(vector)
    return out


def bordered_matrix(
    stiffness: PETSc.Mat, coordinates: JumpCoordinates, borders: list[PETSc.Vec]
) -> tuple[PETSc.Mat, Array]:
    """A with its borders; destroys nothing; collective.

    Returns:
        The matrix, and what each border holds in the window rows (for a force pattern minus the
        load on the slave face), shape (n_window, n_borders), on every rank.
    """
    inner = stiffness.ptap(coordinates.transform)
    on_window = np.zeros((coordinates.n_window, len(borders)))
    if not borders:
        return inner, on_window
    comm = compat.plain_comm(inner.getComm().tompi4py())
    (n_rows, n_columns), _ = inner.getSizes()
    indptr, indices, data = inner.getValuesCSR()
    first = coordinates.first + coordinates.n_window + coordinates.n_supports
    parts: list[Any] = [sp.csr_matrix((data, indices, indptr), shape=(n_rows, n_columns))]
    start, _ = inner.getOwnershipRange()
    right = inner.createVecRight()
    for i, border in enumerate(borders):
        coordinates.transform.multTranspose(border, right)
        if comm.rank == 0:
            window = slice(coordinates.n_inner, coordinates.n_inner + coordinates.n_window)
            on_window[:, i] = right.array[window]
        local = np.flatnonzero(right.array)
        values = right.array[local]
        parts.append(
            sp.csr_matrix(
                (values, (local, np.full(len(local), first + i))), shape=(n_rows, n_columns)
            )
        )
        found: Any = comm.gather((local + start, values))
        if comm.rank == 0:
            columns, entries = (np.concatenate(p) for p in zip(*found, strict=True))
            # a stored diagonal, however small: without one the symmetric conversion goes wrong
            columns = np.append(columns, first + i)
            entries = np.append(entries, 1e-300)
            row = np.full(len(columns), first + i)
            parts.append(sp.csr_matrix((entries, (row, columns)), shape=(n_rows, n_columns)))
    right.destroy()
    inner.destroy()
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    total.sort_indices()
    matrix = PETSc.Mat().createAIJ(
        ((n_rows, n_columns), (n_rows, n_columns)),
        csr=(
            total.indptr.astype(PETSc.IntType),
            total.indices.astype(PETSc.IntType),
            total.data,
        ),
        comm=stiffness.getComm(),
    )
    matrix.assemble()
    comm.Bcast(on_window)
    return matrix, on_window
