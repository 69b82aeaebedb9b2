"""Condensation onto retained jumps without any factorisation of the bodies.

The retained jumps are a selection of a :class:`SchurColumns`: they keep their columns, components
that are free by now and of no interest are condensed out by dense algebra, the others are zero.
A new selection costs only the columns nobody has computed yet.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import SolverError
from fxcrack.base.timings import Timings
from fxcrack.condensation.columns import SchurColumns
from fxcrack.condensation.mumps_schur import mumps_message
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.jump_coordinates import (
    FIXED,
    FREE,
    RETAINED,
    JumpCoordinates,
    build_coordinates,
)
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports

Roles = list[npt.NDArray[np.int8]]

_MANY = 4  # columns kept beyond the memory allowed, over those the retained jumps need


class IterativeCondensation:
    """S and the way back to displacements, as :class:`Condensation` gives them; collective.

    Args:
        space: Where the columns are; outlives the condensation.
        roles: Roles of the jumps.
        timings: Where seconds are counted.

    Attributes:
        coordinates: Numbering of the retained jumps. Their transformation is that of the space.
        schur: S, shape (n_last, n_last), the same on every rank.
        borders_on_retained: What each border holds in the rows of retained jumps, shape
            (n_retained, n_borders).
        computed: Columns that had to be computed.
        column_seconds: Seconds they took.
    """

    def __init__(self, space: SchurColumns, roles: Roles, timings: Timings) -> None:
        self._space = space
        self.timings = timings
        start = time.perf_counter()
        whole = space.coordinates
        self.coordinates, retained, free = _select(whole, roles)
        rest = np.arange(whole.n_retained, whole.n_last)
        self.computed = space.require(np.concatenate([retained, free, rest]))
        self.column_seconds = time.perf_counter() - start
        order = np.argsort(space.known)
        self._kept, self._free = (
            order[np.searchsorted(space.known, numbers, sorter=order)]
            for numbers in (np.concatenate([retained, rest]), free)
        )
        self.schur = space.schur[np.ix_(self._kept, self._kept)]
        self._follow = np.zeros((len(free), len(self._kept)))
        if len(free):
            try:
                factor = cho_factor(space.schur[np.ix_(self._free, self._free)], lower=True)
            except LinAlgError as error:
                raise SolverError(mumps_message(-10, 0)) from error
            coupling = space.schur[np.ix_(self._free, self._kept)]
            self._follow = -cho_solve(factor, coupling)
            self.schur += coupling.T @ self._follow
            self.schur = 0.5 * (self.schur + self.schur.T)
        self.borders_on_retained = space.on_retained(whole.n_borders)[retained]
        timings.add("columns", start)

    @property
    def recovers(self) -> bool:
        """Whether displacements take no factorisation: never one here."""
        return True

    def displacement(self, last: Array) -> PETSc.Vec:
        """Displacements for given last coordinates; collective, one solve.

        Args:
            last: x = (jumps, amplitudes, load factors, zeros), shape (n_last,).

        Returns:
            u on the displacement dofs; the caller destroys it.
        """
        start = time.perf_counter()
        values = np.zeros(len(self._space.known))
        values[self._kept] = last
        values[self._free] = self._follow @ last
        u = self._space.expand(values)
        self.timings.add("fields", start)
        return u

    def destroy(self, *, keep_transform: bool = False) -> None:
        """Forget S; the columns stay with their space."""
        self.schur = np.zeros((0, 0))


def _select(whole: JumpCoordinates, roles: Roles) -> tuple[JumpCoordinates, Ints, Ints]:
    """Numbering of some retained jumps; numbers in the whole set of these and of free ones."""
    index, retained, free = [], [], []
    n = 0
    for role, number in zip(roles, whole.index, strict=True):
        inside = (role == RETAINED) & (number >= 0)
        mine = np.full(role.shape, -1, dtype=np.int64)
        mine[inside] = n + np.arange(int(inside.sum()))
        n += int(inside.sum())
        index.append(mine)
        retained.append(number[inside])
        free.append(number[(role == FREE) & (number >= 0)])
    coordinates = replace(whole, index=index, n_retained=n)
    return coordinates, np.concatenate(retained), np.concatenate(free)


class SchurColumnCache:
    """Keeps the column space of an analysis, and makes another where it does not fit.

    Args:
        continuum: Elastic bodies.
        pairs: Interfaces.
        supports: Prescribed components.
        rtol: Tolerance of the columns.
        cap_mb: Memory columns may take before those no longer needed are dropped, MB.
    """

    def __init__(
        self,
        continuum: Continuum,
        pairs: list[Pair],
        supports: Supports,
        *,
        rtol: float,
        cap_mb: float,
    ) -> None:
        self._continuum, self._pairs, self._supports = continuum, pairs, supports
        self._rtol, self._cap = rtol, cap_mb
        self._roles: Roles = []
        self.space: SchurColumns | None = None

    def condense(
        self,
        roles: Roles,
        may_open: list[npt.NDArray[np.bool_]],
        stiffness: PETSc.Mat,
        borders: list[PETSc.Vec],
        timings: Timings,
    ) -> IterativeCondensation:
        """A condensation onto the retained jumps of some roles; collective.

        Args:
            roles: FIXED, FREE or RETAINED per pair and jump component, shape (n_nodes, gdim).
            may_open: Held components that may be retained later, likewise.
            stiffness: K.
            borders: Force patterns and monitors.
            timings: Where seconds are counted.
        """
        if not self._fits(roles):
            self.destroy()
            start = time.perf_counter()
            self._roles = [
                np.where((r == FIXED) & m, RETAINED, r).astype(np.int8)
                for r, m in zip(roles, may_open, strict=True)
            ]
            coordinates = build_coordinates(
                self._continuum.layout, self._pairs, self._roles, self._supports, len(borders)
            )
            timings.add("transform", start)
            start = time.perf_counter()
            self.space = SchurColumns(
                self._continuum, stiffness, coordinates, borders, rtol=self._rtol
            )
            timings.add("multigrid", start)
        assert self.space is not None
        return IterativeCondensation(self.space, roles, timings)

    def _fits(self, roles: Roles) -> bool:
        """Whether the present space can serve some roles, and is not too full of old columns."""
        if self.space is None:
            return False
        for role, known in zip(roles, self._roles, strict=True):
            if np.any((known == FREE) & (role != FREE)) or np.any(
                (known == FIXED) & (role != FIXED)
            ):
                return False
        needed = sum(int((r == RETAINED).sum()) for r in roles)
        many = len(self.space.known) > _MANY * max(needed, 1)
        if many and self.space.memory_mb() > self._cap:
            log.info("columns of the wake are dropped: they exceed %.0f MB", self._cap)
            return False
        return True

    def destroy(self) -> None:
        """Free the space; collective."""
        if self.space is not None:
            self.space.destroy()
            self.space = None
