"""Condensation of the bodies onto retained jumps, supports, forces and monitors.

    A = T^t K T, bordered by -T^t f for every force pattern f and by T^t l for every monitor l,
    S = A_22 - A_21 A_11^-1 A_12   on x = (jumps, prescribed amplitudes, load factors, 0)

S x then holds, row by row: interface forces; reactions (work-conjugate to the amplitudes);
minus the work-conjugate displacements of the load patterns; monitored displacements.
"""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from fxcrack.base import compat
from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError, SolverError
from fxcrack.base.timings import Timings
from fxcrack.condensation.bordered_matrix import BorderedMatrix
from fxcrack.condensation.mumps_schur import (
    TOO_SMALL,
    WORKSPACE,
    Doubt,
    SchurFactor,
    check_factor,
    library,
    mumps_message,
)
from fxcrack.interface.jump_coordinates import JumpCoordinates

_LARGE = 1e150
"""Entries whose squares, which S is made of, exceed the largest number there is."""


class DirectCondensation:
    """S and the way back to displacements.

    Args:
        stiffness: K; stays with the caller.
        coordinates: T and its numbering; owned by the condensation from now on.
        borders: Force patterns and monitors from :func:`load_and_monitor_vectors`; stay with the
            caller.
        timings: Where seconds and factorisations are counted.
        method: "schur" takes S out of MUMPS, "columns" builds it by block solves, "auto" takes
            the first where it can.
        definite: Whether the inner block must be positive definite.
        doubt: What to ask where pivots may be round-off, see :class:`SchurFactor`.
        renewable: Whether :meth:`renew` is called later on; memory for that is kept then.

    Attributes:
        schur: S, shape (n_last, n_last), the same on every rank.
        n_negative: Negative pivots of the inner block, where it need not be definite.
        borders_on_retained: See :class:`BorderedMatrix`.
        diagonal: That of A on the last coordinates, shape (n_last,): S is a difference from it.
    """

    def __init__(
        self,
        stiffness: PETSc.Mat,
        coordinates: JumpCoordinates,
        borders: list[PETSc.Vec],
        timings: Timings,
        *,
        method: str = "auto",
        definite: bool = True,
        doubt: Doubt | None = None,
        renewable: bool = False,
    ) -> None:
        if method not in ("auto", "schur", "columns"):
            raise InputError(f"method = '{method}': choose 'auto', 'schur' or 'columns'")
        self.coordinates = coordinates
        self.timings = timings
        self.n_negative = 0
        self._definite, self._doubt, self._renewable = definite, doubt, renewable
        self._comm = compat.plain_comm(stiffness.getComm().tompi4py())
        self._factor: SchurFactor | None = None
        self._inner: PETSc.KSP | None = None
        self._inner_matrix: PETSc.Mat | None = None
        self._by_schur = method == "schur" or (method == "auto" and library() is not None)
        # supports may prescribe, and interfaces retain, all that there is: S is A itself then
        self._has_inner = self._comm.allreduce(coordinates.n_inner) > 0
        start = time.perf_counter()
        self._bordered = BorderedMatrix(stiffness, coordinates, borders, renewable=renewable)
        self.matrix, self.borders_on_retained = self._bordered.matrix, self._bordered.on_retained
        self.diagonal = self._last_diagonal()
        timings.add("transform", start)
        self._condense(gdim=stiffness.getBlockSize())

    def renew(self, stiffness: PETSc.Mat) -> None:
        """Condense another K with the same nonzero pattern, in the memory at hand; collective.

        Raises:
            SolverError: MUMPS failed; the message says why.
        """
        start = time.perf_counter()
        self._drop_inner()
        self._bordered.renew(stiffness)
        self.diagonal = self._last_diagonal()
        self.timings.add("transform", start)
        self._condense(gdim=stiffness.getBlockSize())

    def _condense(self, *, gdim: int) -> None:
        """Take S out of a factorisation of the matrix, or build it; collective."""
        start = time.perf_counter()
        if not self._has_inner:
            self.schur = self._all_last()
        elif self._by_schur and self.coordinates.n_last:
            try:
                self._factorise(gdim)
            except SolverError as error:
                raise SolverError(self._why_not(str(error))) from error
            assert self._factor is not None
            self.n_negative = self._factor.n_negative
            self.timings.factorizations += 1
            self.schur = self._factor.schur
            if not self._factor.solves:
                self._factor.destroy()  # nothing needs its memory any more
                self._factor = None
        else:
            self.schur = self._columns()
        self.timings.add("factor_with_schur", start)
        if not np.all(np.isfinite(self.schur)):
            raise SolverError(self._why_not(mumps_message(-10, 0)))

    def _factorise(self, gdim: int) -> None:
        if self._factor is None:
            self._factor = SchurFactor(
                self.matrix, self.coordinates.n_last, gdim=gdim, definite=self._definite,
                renewable=self._renewable, doubt=self._doubt,
            )  # fmt: skip
        else:
            self._factor.renew(self.matrix)

    def _why_not(self, otherwise: str) -> str:
        """Why there is no S, in words: numbers that are none or too large, or what else was said.

        Collective.
        """
        data = self.matrix.getValuesCSR()[2]
        good = bool(np.all(np.isfinite(data)))
        largest = float(np.abs(data).max(initial=0.0)) if good else np.inf
        entries = self._comm.allreduce(largest, op=MPI.MAX)
        if not np.isfinite(entries):
            return (
                "the stiffness matrix or a load pattern holds entries that are no finite numbers; "
                "look for NaN and for numbers that are too large in materials, loads and mesh"
            )
        if entries > _LARGE:
            return (
                f"numbers are too large to compute with: the largest entry of stiffness and load "
                f"patterns is {entries:.1e}, and its square overflows; state moduli and loads of a "
                "size that is physical in your units"
            )
        return otherwise

    def _all_last(self) -> Array:
        """S where no coordinate is eliminated, shape (n_last, n_last); collective."""
        out = np.zeros((self.coordinates.n_last, self.coordinates.n_last))
        indptr, indices, data = self.matrix.getValuesCSR()
        if self._comm.rank == 0:
            out[:] = sp.csr_matrix((data, indices, indptr), shape=out.shape).toarray()
        self._comm.Bcast(out)
        return 0.5 * (out + out.T)

    def _last_diagonal(self) -> Array:
        """Diagonal of A on the last coordinates, the same on every rank; collective."""
        diagonal = self.matrix.getDiagonal()
        out = np.zeros(self.coordinates.n_last)
        if self._comm.rank == 0:
            out[:] = diagonal.array_r[self.coordinates.n_inner :]
        diagonal.destroy()
        self._comm.Bcast(out)
        return out

    def _rows(self) -> tuple[PETSc.IS, PETSc.IS]:
        """Index sets of the inner and of the last rows of this rank."""
        start, _ = self.matrix.getOwnershipRange()
        n_inner = self.coordinates.n_inner
        n_last = self.coordinates.n_last if self._comm.rank == 0 else 0
        inner = PETSc.IS().createStride(n_inner, start, 1, comm=self._comm)
        return inner, PETSc.IS().createStride(n_last, start + n_inner, 1, comm=self._comm)

    def _inner_solver(self) -> PETSc.KSP:
        """An ordinary Cholesky factorisation of A_11, made on first use."""
        if self._inner is None:
            start = time.perf_counter()
            inner, last = self._rows()
            block = self.matrix.createSubMatrix(inner, inner)
            block.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            block.setOption(PETSc.Mat.Option.SPD, self._definite)
            if PETSc.Sys.hasExternalPackage("mumps"):
                solver = self._mumps_solver(block)
            else:
                solver = self._direct_solver(block)
                if self._comm.size > 1:
                    solver.getPC().setType(PETSc.PC.Type.LU)
                    solver.getPC().setFactorSolverType("superlu_dist")
                solver.setUp()
            inner.destroy()
            last.destroy()
            self._inner, self._inner_matrix = solver, block
            self.timings.factorizations += 1
            self.timings.add("factor_inner", start)
        return self._inner

    def _direct_solver(self, block: PETSc.Mat) -> PETSc.KSP:
        solver = PETSc.KSP().create(self._comm)
        solver.setOptionsPrefix("fxcrack_inner_")
        solver.setOperators(block)
        solver.setType(PETSc.KSP.Type.PREONLY)
        solver.getPC().setType(PETSc.PC.Type.CHOLESKY)
        return solver

    def _mumps_solver(self, block: PETSc.Mat) -> PETSc.KSP:
        for extra in WORKSPACE:
            solver = self._direct_solver(block)
            solver.getPC().setFactorSolverType("mumps")
            solver.getPC().setFactorSetUpSolverType()
            factor = solver.getPC().getFactorMatrix()
            factor.setMumpsIcntl(14, extra)
            solver.setUp()
            code = factor.getMumpsInfog(1)
            if code not in TOO_SMALL or extra == WORKSPACE[-1]:
                break
            solver.destroy()
        try:
            check_factor(
                factor.getMumpsInfog, factor.getMumpsRinfog, definite=self._definite,
                doubt=self._doubt,
            )  # fmt: skip
        except SolverError:
            solver.destroy()
            raise
        self.n_negative = factor.getMumpsInfog(12)
        return solver

    def _columns(self, block_size: int = 64) -> Array:
        """S by solves with blocks of right-hand sides: same result, slower."""
        solver = self._inner_solver()
        inner, last = self._rows()
        coupling = self.matrix.createSubMatrix(inner, last)
        corner = self.matrix.createSubMatrix(last, last)
        n_last, n_inner = self.coordinates.n_last, self.coordinates.n_inner
        factor = solver.getPC().getFactorMatrix()
        total_inner = solver.getOperators()[0].getSize()[0]
        out = np.zeros((n_last, n_last))
        whole = corner.createVecLeft()
        for begin in range(0, n_last, block_size):
            width = min(block_size, n_last - begin)
            right = PETSc.Mat().createDense(
                ((n_inner, total_inner), (PETSc.DECIDE, width)), comm=self._comm
            )
            right.setUp()
            solution = right.duplicate()
            unit, column = coupling.createVecRight(), coupling.createVecLeft()
            array = right.getDenseArray()
            for j in range(width):
                unit.set(0.0)
                if self._comm.rank == 0:
                    unit.array[begin + j] = 1.0
                coupling.mult(unit, column)
                array[:, j] = column.array
            right.assemble()
            solution.assemble()
            factor.matSolve(right, solution)
            x = solution.getDenseArray()
            for j in range(width):
                column.array[:] = x[:, j]
                coupling.multTranspose(column, unit)
                if self._comm.rank == 0:
                    out[:, begin + j] = -unit.array
                    whole.set(0.0)
                unit.set(0.0)
                if self._comm.rank == 0:
                    unit.array[begin + j] = 1.0
                corner.mult(unit, whole)
                if self._comm.rank == 0:
                    out[:, begin + j] += whole.array
            for thing in (right, solution, unit, column):
                thing.destroy()
        for thing in (coupling, corner, whole, inner, last):
            thing.destroy()
        self._comm.Bcast(out)
        return 0.5 * (out + out.T)

    @property
    def recovers(self) -> bool:
        """Whether displacements take no factorisation beside those that there are already."""
        return not self._has_inner or self._factor is not None or self._inner is not None

    def displacement(self, last: Array) -> PETSc.Vec:
        """Displacements for given last coordinates; collective, one back-solve.

        Args:
            last: x = (jumps, amplitudes, load factors, zeros), shape (n_last,).

        Returns:
            u on the displacement dofs; the caller destroys it.
        """
        return self._moved(last, None)

    def displacement_beside(self, inner: PETSc.Vec, last: Array) -> PETSc.Vec:
        """Displacements for given last coordinates beside those of forces; collective.

        Args:
            inner: A_11^-1 r_1 from :meth:`reduced`; stays with the caller.
            last: As in :meth:`displacement`.

        Returns:
            u on the displacement dofs; the caller destroys it.
        """
        return self._moved(last, inner)

    def _moved(self, last: Array, inner: PETSc.Vec | None) -> PETSc.Vec:
        start = time.perf_counter()
        q = self.expanded(last)
        if inner is not None:
            q.axpy(1.0, inner)
        u = self.coordinates.transform.createVecLeft()
        self.coordinates.transform.mult(q, u)
        q.destroy()
        self.timings.add("fields", start)
        return u

    def expanded(self, last: Array) -> PETSc.Vec:
        """Coordinates q for given last ones, q_1 = -A_11^-1 A_12 x; collective.

        Args:
            last: x, shape (n_last,).

        Returns:
            q in the numbering of T's columns; the caller destroys it.
        """
        n_inner = self.coordinates.n_inner
        q = self.matrix.createVecRight()
        if self._comm.rank == 0:
            q.array[n_inner:] = last
        right = self.matrix.createVecLeft()
        self.matrix.mult(q, right)
        right.scale(-1.0)
        self._solve_inner(right, q)
        right.destroy()
        return q

    def reduced(self, residual: PETSc.Vec) -> tuple[Array, PETSc.Vec]:
        """Forces r on the bodies condensed as K is: r_2 - A_21 A_11^-1 r_1; collective.

        Args:
            residual: r on the displacement dofs; stays with the caller.

        Returns:
            The condensed forces, shape (n_last,) on every rank, and A_11^-1 r_1 with zeros behind
            it, which the caller destroys.
        """
        n_inner = self.coordinates.n_inner
        right = self.matrix.createVecLeft()
        self.coordinates.transform.multTranspose(residual, right)
        direct = right.array[n_inner:].copy()
        q = self.matrix.createVecRight()
        self._solve_inner(right, q)
        self.matrix.mult(q, right)
        out = np.zeros(self.coordinates.n_last)
        if self._comm.rank == 0:
            out[:] = direct - right.array[n_inner:]
        right.destroy()
        self._comm.Bcast(out)
        return out, q

    def _solve_inner(self, right: PETSc.Vec, q: PETSc.Vec) -> None:
        """Set q_1 = A_11^-1 right_1; the last entries of ``right`` are overwritten."""
        n_inner = self.coordinates.n_inner
        if not self._has_inner:
            return
        if self._factor is not None and self._factor.solves:
            right.array[n_inner:] = 0.0
            solution = right.duplicate()
            self._factor.solve_inner(right, solution)
            q.array[:n_inner] = solution.array[:n_inner]
            solution.destroy()
        else:
            solver = self._inner_solver()
            inner = solver.getOperators()[0].createVecRight()
            found = inner.duplicate()
            inner.array[:] = right.array[:n_inner]
            solver.solve(inner, found)
            q.array[:n_inner] = found.array
            inner.destroy()
            found.destroy()

    def _drop_inner(self) -> None:
        if self._inner is not None:
            self._inner.destroy()
        if self._inner_matrix is not None:
            self._inner_matrix.destroy()
        self._inner = self._inner_matrix = None

    def destroy(self, *, keep_transform: bool = False) -> None:
        """Free matrices and factors, and T unless it is to be used again; collective."""
        if self._factor is not None:
            self._factor.destroy()
        self._drop_inner()
        self._bordered.destroy()
        if not keep_transform:
            self.coordinates.destroy()
