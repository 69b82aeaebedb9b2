"""The Schur complement of the last rows of rank 0 out of a MUMPS factorisation.

    S = A_22 - A_21 A_11^-1 A_12

petsc4py wraps none of the calls needed, so they are made through ctypes on the very library
petsc4py is linked against. MUMPS fills one triangle of S, the lower on one rank and the upper on
several; the other is mirrored here. PETSc wants all Schur rows on rank 0.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
from petsc4py import PETSc

from fxcrack.base import compat
from fxcrack.base.arrays import Array
from fxcrack.base.errors import SolverError

_FACTOR_CHOLESKY = 2
_SMALLEST_PIVOT = 1e-10
_ICNTL_ORDERING, _ICNTL_MEMORY, _ICNTL_REDUCED = 7, 14, 26
_AMD, _AUTOMATIC = 0, 7
WORKSPACE = (40, 200, 1000)
"""Per cent added to MUMPS' estimate of its workspace, one after the other until it is enough."""
TOO_SMALL = (-8, -9, -11, -14, -15, -17, -20)
"""INFOG(1) that more workspace may cure."""
SINGULAR = (-10, -40)
"""INFOG(1) of a matrix that is singular to MUMPS."""
HELD_BY_ROUND_OFF = (
    "all bodies are held, but some so much more weakly than the stiffest is stiff that round-off "
    "is all that is left; bring moduli or thicknesses nearer together"
)
"""Why a pivot counts as zero in bodies that are held."""
Doubt = Callable[[float], None]
"""What is asked where pivots may be round-off, see :class:`SchurFactor`."""


def library() -> ctypes.CDLL | None:
    """PETSc's C interface, ``None`` where it or MUMPS cannot be reached."""
    if not PETSc.Sys.hasExternalPackage("mumps"):
        return None
    try:
        lib = ctypes.CDLL(PETSc.__file__)
        lib.MatFactorSetSchurIS  # noqa: B018 - looks the symbol up
    except (OSError, AttributeError):
        return None
    return lib


def _handle(thing: Any) -> ctypes.c_void_p:
    return ctypes.c_void_p(thing.handle)


def _let_go(lib: ctypes.CDLL, factor: ctypes.c_void_p) -> None:
    """Free a factor whose Python object is gone, as petsc4py does with its own objects.

    Ranks collect garbage at different times, and freeing is collective: PETSc keeps what belongs to
    several ranks until :func:`petsc4py.PETSc.garbage_cleanup`.
    """
    if factor and PETSc.Sys.isInitialized() and not PETSc.Sys.isFinalized():
        lib.PetscObjectDelayedDestroy(ctypes.byref(factor))


class _DenseInPlace:
    """The entries of PETSc's dense S as an array of numpy, kept after the factor is gone.

    Args:
        lib: PETSc's C interface.
        dense: Sequential dense matrix, of which this keeps a reference.
        address: That of its entries.
        n: Number of its rows.
    """

    def __init__(self, lib: ctypes.CDLL, dense: ctypes.c_void_p, address: int, n: int) -> None:
        lib.PetscObjectReference(dense)
        weakref.finalize(self, _let_go, lib, ctypes.c_void_p(dense.value)).atexit = False
        self.__array_interface__ = {
            "data": (address, False),
            "shape": (n, n),
            "typestr": np.dtype(float).str,
            "version": 3,
        }


class SchurFactor:
    """Cholesky factor of A_11 together with the dense S; collective.

    Args:
        matrix: Symmetric AIJ matrix whose leading block is positive definite, with an explicit
            diagonal. Its last ``n_last`` rows on rank 0 are the Schur rows.
        n_last: Number of Schur rows; at least 1.
        gdim: Dimension of the bodies, which decides the ordering.
        definite: Whether the leading block must be positive definite; a tangent on the way to an
            equilibrium need not be.
        renewable: Whether :meth:`renew` is called later on. Else S stays, on one rank, where PETSc
            has put it, instead of in a copy beside.
        doubt: Called on all ranks with the smallest pivot over the largest where that may be
            round-off, 0 where it has the wrong sign; raises if the factor must not be used. By
            default such a factor is refused where the block must be positive definite.

    Attributes:
        schur: S, shape (n_last, n_last), the same array on every rank.
        n_negative: Negative pivots of the leading block.

    Raises:
        SolverError: MUMPS failed; the message says why.
    """

    def __init__(
        self,
        matrix: PETSc.Mat,
        n_last: int,
        *,
        gdim: int = 3,
        definite: bool = True,
        renewable: bool = True,
        doubt: Doubt | None = None,
    ) -> None:
        lib = library()
        if lib is None:
            raise SolverError(
                "PETSc's C interface with MUMPS cannot be reached; "
                "use the column method (method='columns')"
            )
        self._lib = lib
        self._ordering = ordering(gdim)
        self._factor = ctypes.c_void_p()
        weakref.finalize(self, _let_go, lib, self._factor).atexit = False
        self._comm = compat.plain_comm(matrix.getComm().tompi4py())
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setOption(PETSc.Mat.Option.SPD, definite)
        self._n_last, self._definite, self._doubt = n_last, definite, doubt
        self._in_place = not renewable and self._comm.size == 1
        self._from_scratch(matrix)

    def renew(self, matrix: PETSc.Mat) -> None:
        """Factor a matrix with the same nonzero pattern; the analysis of the pattern is kept.

        Raises:
            SolverError: MUMPS failed; the message says why, and the factor is gone.
        """
        self._call("MatCholeskyFactorNumeric", self._factor, _handle(matrix), None)
        if self._infog(1) in TOO_SMALL:
            self._from_scratch(matrix)
        else:
            self._take()

    def _from_scratch(self, matrix: PETSc.Mat) -> None:
        _, end = matrix.getOwnershipRange()
        mine = np.arange(end - self._n_last, end) if self._comm.rank == 0 else np.zeros(0)
        rows = PETSc.IS().createGeneral(mine.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        for extra in WORKSPACE:
            self._factorise(matrix, rows, extra)
            if self._infog(1) not in TOO_SMALL:
                break
        rows.destroy()
        self._take()

    def _take(self) -> None:
        """Take S and the signs of the pivots out of a new factor."""
        self.n_negative = self._infog(12)
        try:
            check_factor(self._infog, self._rinfog, definite=self._definite, doubt=self._doubt)
        except SolverError:
            self.destroy()
            raise
        self.schur = self._fetch(self._n_last)

    def _factorise(self, matrix: PETSc.Mat, rows: PETSc.IS, extra: int) -> None:
        self.destroy()
        self._call(
            "MatGetFactor", _handle(matrix), b"mumps", _FACTOR_CHOLESKY, ctypes.byref(self._factor)
        )
        self._call("MatFactorSetSchurIS", self._factor, _handle(rows))
        self._call("MatMumpsSetIcntl", self._factor, _ICNTL_MEMORY, extra)
        self._call("MatMumpsSetIcntl", self._factor, _ICNTL_ORDERING, self._ordering)
        self._call("MatCholeskyFactorSymbolic", self._factor, _handle(matrix), None, None)
        self._call("MatCholeskyFactorNumeric", self._factor, _handle(matrix), None)

    def _call(self, name: str, *arguments: Any) -> None:
        code = getattr(self._lib, name)(*arguments)
        if code:
            raise SolverError(f"PETSc's {name} returned error code {code}")

    def _infog(self, number: int) -> int:
        value = ctypes.c_int()
        self._call("MatMumpsGetInfog", self._factor, number, ctypes.byref(value))
        return value.value

    def _rinfog(self, number: int) -> float:
        value = ctypes.c_double()
        self._call("MatMumpsGetRinfog", self._factor, number, ctypes.byref(value))
        return value.value

    def _fetch(self, n_last: int) -> Array:
        dense, status = ctypes.c_void_p(), ctypes.c_int()
        self._call(
            "MatFactorGetSchurComplement", self._factor, ctypes.byref(dense), ctypes.byref(status)
        )
        out = np.empty((0, 0) if self._in_place else (n_last, n_last))
        if self._comm.rank == 0:
            data = ctypes.POINTER(ctypes.c_double)()
            self._call("MatDenseGetArrayRead", dense, ctypes.byref(data))
            # stored by columns; the other triangle may hold remains of the elimination
            if self._in_place:
                address = ctypes.cast(data, ctypes.c_void_p).value
                assert address is not None
                out = np.asarray(_DenseInPlace(self._lib, dense, address, n_last))
                mirror_lower(out.T)
            else:
                raw = np.ctypeslib.as_array(data, (n_last, n_last))
                np.copyto(out, raw.T if self._comm.size == 1 else raw)
                mirror_lower(out)
            self._call("MatDenseRestoreArrayRead", dense, ctypes.byref(data))
        self._call("MatFactorRestoreSchurComplement", self._factor, ctypes.byref(dense), status)
        self._comm.Bcast(out)
        return out

    @property
    def solves(self) -> bool:
        """Whether the factor itself can solve: PETSc allows it on one rank only."""
        return bool(self._comm.size == 1)

    def solve_inner(self, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve A_11 x_1 = b_1; the last entries of ``right`` must be zero. One rank only."""
        self._call("MatMumpsSetIcntl", self._factor, _ICNTL_REDUCED, 0)
        self._call("MatSolve", self._factor, _handle(right), _handle(solution))

    def destroy(self) -> None:
        """Free the factor; collective."""
        if self._factor:
            self._call("MatDestroy", ctypes.byref(self._factor))  # and sets the handle to NULL


def ordering(gdim: int) -> int:
    """Value of MUMPS' ICNTL(7) for bodies of a dimension.

    Approximate minimum degree takes a tenth of the time of nested dissection. In 2-D it leaves as
    little to factor (slender arms, 211,332 dofs: 0.46 s instead of 1.04 s in all) or nearly so
    (square, 206,082 dofs: 0.84 s, 1.0 s); in 3-D it would cost more than twice as much.
    """
    return _AMD if gdim == 2 else _AUTOMATIC


def mirror_lower(square: Array) -> None:
    """Copy the lower triangle onto the upper one, shape (n, n), in place, block by block."""
    n, step = len(square), 256
    for i in range(0, n, step):
        block = square[i : i + step, i : i + step]
        block[:] = np.tril(block) + np.tril(block, -1).T
        square[i : i + step, i + step :] = square[i + step :, i : i + step].T


def check_factor(
    infog: Callable[[int], int],
    rinfog: Callable[[int], float],
    *,
    definite: bool = True,
    doubt: Doubt | None = None,
) -> None:
    """Refuse a factor of a stiffness matrix that must not be used; collective.

    MUMPS reports no error for a body held by nothing: round-off leaves it a last pivot of either
    sign, below 1e-10 of the largest in the cases tried. So small are those of some bodies that are
    held as well, thin ones or soft ones beside stiff ones: pivots raise the question only.

    Args:
        infog: MUMPS' INFOG by number.
        rinfog: MUMPS' RINFOG by number.
        definite: Whether negative pivots are a fault.
        doubt: See :class:`SchurFactor`.

    Raises:
        SolverError: It must not be used; the message says why.
    """
    code = infog(1)
    if code < 0 and code not in SINGULAR:
        raise SolverError(mumps_message(code, infog(2)))
    ratio = 0.0
    if code >= 0 and not (definite and infog(12) > 0):
        smallest, largest = rinfog(19), rinfog(21)  # pivots; 0 if not told
        if smallest >= _SMALLEST_PIVOT * largest:
            return
        ratio = smallest / largest
    if doubt is not None:
        doubt(ratio)
    if code < 0 or (doubt is None and definite):
        raise SolverError(mumps_message(-10, 0))


def mumps_message(code: int, detail: int) -> str:
    """What a negative INFOG(1) of MUMPS means, in words."""
    if code in SINGULAR:
        return (
            "the stiffness matrix is singular: some body or part of one can still move freely; "
            "hold it by supports, or bond it to something held"
        )
    if code in (-9, -8, -7, -13, -11, -14, -15, -17, -20):
        return f"MUMPS ran out of memory (INFOG(1) = {code}, INFOG(2) = {detail})"
    return f"MUMPS failed with INFOG(1) = {code}, INFOG(2) = {detail}"
