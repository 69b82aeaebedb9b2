"""Nonlinear bodies condensed at a displacement: their tangent and the forces in them.

S = (K_22 - K_21 K_11^-1 K_12)(u),    offset such that S x + offset are the forces at u
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import SolverError
from fxcrack.base.timings import Timings
from fxcrack.condensation.bordered_matrix import load_and_monitor_vectors
from fxcrack.condensation.direct import DirectCondensation
from fxcrack.condensation.free_bodies import FreeBodies
from fxcrack.condensation.rigid_motions import check_held
from fxcrack.continuum.loads import Load, Monitor
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.equilibrium.contact import ContactSystem
from fxcrack.interface.jump_coordinates import JumpCoordinates
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports

_FEW_COLUMNS = 256
"""Up to so many last coordinates block solves beat a second factorisation on several ranks."""


class Origin(NamedTuple):
    """Where the tangent was made: not in the accepted state where it still serves there.

    Attributes:
        local: From :meth:`WeakForm.snapshot`.
        began: End and length of the increment, time.
    """

    local: dict[str, Array]
    began: tuple[float, float]


class _Factored(NamedTuple):
    """A condensed tangent, the version of its terms, and how far it is off where it is used."""

    condensation: DirectCondensation
    version: tuple[int, ...]
    drift: float
    origin: Origin | None


class CondensedTangent:
    """The tangent of nonlinear bodies on a set of retained jumps.

    While an increment is tried, the tangent of the accepted state is kept beside the one at hand:
    :meth:`accept` forgets the former, :meth:`revert` the latter.

    Args:
        bodies: The form terms.
        supports: Prescribed components.
        loads: Force patterns.
        monitors: Monitored displacements.
        method: How to condense, see :class:`~fxcrack.condensation.options.CondensedOptions`.
        timings: Where seconds and factorisations are counted.

    Attributes:
        force_scale: Norm of the internal forces at the last residual, force.
        round_off: Residual that rounding alone may leave there, force.
        drift: How far the tangent at hand is off at the accepted state: what was out of balance
            where it was made, over the forces.
        origin: Where the one at hand was made, ``None`` for bodies whose tangent is constant.
        restraint: What holds the bodies; ``None`` where nothing must.
    """

    def __init__(
        self,
        bodies: WeakForm,
        supports: Supports,
        loads: list[Load],
        monitors: list[Monitor],
        *,
        method: str,
        timings: Timings,
    ) -> None:
        self.bodies = bodies
        self.timings = timings
        self.comm = bodies.continuum.comm
        self._coordinates: JumpCoordinates | None = None
        self.force_scale = self.round_off = self.drift = 0.0
        self._supports, self._loads, self._monitors = supports, loads, monitors
        self._method = method
        self._borders: list[PETSc.Vec] | None = None
        self._condensation: DirectCondensation | None = None
        self._version: tuple[int, ...] = ()  # of the terms whose tangent is condensed
        self._accepted: _Factored | None = None  # where a trial has made another one
        self._spare: DirectCondensation | None = None  # whose memory the next tangent takes
        self._stiff = 0.0  # norm of K
        self.origin: Origin | None = None
        self.restraint: FreeBodies | None = None
        self._first = True  # whether no tangent was made yet

    def assemble(self, pairs: Sequence[Pair], followed: list[Ints]) -> int:
        """Compile the forms and make the borders on first use; collective.

        Args:
            pairs: Interfaces.
            followed: Sets of this rank's nodes whose mean displacement is wanted, each of shape
                (n,).

        Returns:
            Number of borders.
        """
        if self._borders is None:
            continuum = self.bodies.continuum
            start = time.perf_counter()
            if not self.bodies.dynamic:  # inertia holds every body
                check_held(continuum, self._supports, pairs)
            self.bodies.compile()
            self.timings.add("compile", start)
            start = time.perf_counter()
            self._borders = load_and_monitor_vectors(
                continuum, self._loads, self._monitors, followed
            )
            self.timings.add("assemble", start)
        return len(self._borders)

    @property
    def borders(self) -> list[PETSc.Vec]:
        """Force patterns with the minus sign, then monitors; none before :meth:`assemble`."""
        return self._borders or []

    # -- condensation --------------------------------------------------------------------

    @property
    def coordinates(self) -> JumpCoordinates:
        """The retained jumps and their numbering."""
        assert self._coordinates is not None
        return self._coordinates

    @property
    def condensation(self) -> DirectCondensation:
        """The condensed tangent at hand."""
        assert self._condensation is not None
        return self._condensation

    @property
    def at_hand(self) -> bool:
        """Whether there is a tangent: not where its factorisation failed."""
        return self._condensation is not None

    @property
    def renewed(self) -> bool:
        """Whether one was made since the last accepted state."""
        return self._accepted is not None

    @property
    def outdated(self) -> bool:
        """Whether data of the terms have changed since the tangent was made."""
        return self._version != self.bodies.version

    def release_memory(self) -> None:
        """Free the tangents of a set of retained jumps that is discarded; collective."""
        self._drop_spare()
        if self._condensation is not None:
            self._condensation.destroy()
            self._condensation = None

    def condense(self, coordinates: JumpCoordinates) -> None:
        """Condense at the bodies' present displacement onto another set of jumps; collective."""
        self._coordinates = coordinates
        self.factor()

    def factor(self) -> None:
        """Condense the tangent at the bodies' present displacement; collective.

        Raises:
            SolverError: It failed; no tangent is at hand then until :meth:`revert`.
        """
        free, self._spare = self._spare, None
        if self._condensation is not None:
            if self._accepted is None:
                self._accepted = _Factored(
                    self._condensation, self._version, self.drift, self.origin
                )
            else:
                free = self._condensation
        self._condensation = None
        method = self._method
        if method == "auto" and self.comm.size > 1 and self.coordinates.n_last <= _FEW_COLUMNS:
            method = "columns"
        matrix, stiffness = self.bodies.tangents()
        try:
            if free is None:
                free = DirectCondensation(
                    matrix, self.coordinates, self.borders, self.timings,
                    method=method, definite=False, doubt=self._doubt, renewable=True,
                )  # fmt: skip
            else:
                free.renew(matrix)
        except SolverError:
            self._spare = free
            self._drop_spare()
            raise
        self._condensation, self._first = free, False
        self._version, self.drift = self.bodies.version, 0.0
        if not self.bodies.constant:
            self.origin = Origin(self.bodies.snapshot(), self.bodies.began)
        self._stiff = float(stiffness.norm(PETSc.NormType.NORM_INFINITY))

    def _doubt(self, ratio: float) -> None:
        """Refuse a tangent with small pivots where a body is free; at limit points it is not."""
        if self.restraint is None:
            return
        if self._first:  # of bodies that no load has brought near a limit yet
            self.restraint.judge(ratio)
        else:
            self.restraint.check()

    def _drop_spare(self) -> None:
        if self._spare is not None:
            self._spare.destroy(keep_transform=True)
            self._spare = None

    def accept(self) -> None:
        """The tangent at hand is that of the accepted state from now on."""
        if self._accepted is not None:
            self._spare, self._accepted = self._accepted.condensation, None

    def revert(self) -> None:
        """Take the tangent of the accepted state again."""
        if self._accepted is not None:
            self._spare = self._condensation
            self._condensation, self._version, self.drift, self.origin = self._accepted
            self._accepted = None

    def displacement(self, jump: Array, loads: Array) -> PETSc.Vec:
        """Change of displacement by changes of jumps and loads; collective.

        Args:
            jump: Change of the retained jumps, shape (n_retained,), length.
            loads: Change of the loads, shape (n_loads,).

        Returns:
            Owned dofs; the caller destroys it.
        """
        last = np.zeros(self.coordinates.n_last)
        last[: len(jump) + len(loads)] = np.concatenate([jump, loads])
        return self.condensation.displacement(last)

    # -- forces --------------------------------------------------------------------------

    def out_of_balance(self, loads: Array) -> PETSc.Vec:
        """Internal forces minus dead loads at the bodies' present displacement; collective.

        Args:
            loads: Amplitudes of supports and load factors, shape (n_loads,).

        Returns:
            R on the displacement dofs, which the caller destroys.
        """
        residual = self.bodies.residual()
        self.force_scale = float(residual.norm())
        n_local = self.bodies.continuum.n_local
        u = self.bodies.u.x.array[:n_local]  # PETSc's norm of it would be cached
        size = np.sqrt(self.comm.allreduce(float(u @ u)))
        self.round_off = 4.0 * np.finfo(float).eps * self._stiff * float(size)
        factors = loads[len(self._supports.columns) :]
        for factor, border in zip(factors, self.borders, strict=False):
            residual.axpy(float(factor), border)
        return residual

    def border_values(self) -> Array:
        """Minus the work of each force pattern, then the monitors, at the bodies' displacement.

        Returns:
            Values of shape (n_borders,): work per unit load factor, monitors in units of length.
        """
        u = self.bodies.u.x.petsc_vec
        return np.array([float(border.dot(u)) for border in self.borders])

    def anchor(
        self, system: ContactSystem, residual: PETSc.Vec, jump: Array, loads: Array
    ) -> PETSc.Vec:
        """Let a dense system have this tangent and pass through the bodies' present state.

        Collective.

        Args:
            system: The dense system on the same retained jumps.
            residual: Forces there, r, from :meth:`out_of_balance`.
            jump: Retained jumps there, shape (n_retained,), length.
            loads: Amplitudes of supports and load factors there, shape (n_loads,).

        Returns:
            A_11^-1 r_1, which the caller destroys.
        """
        values, q = self.condensation.reduced(residual)
        values[system.n_retained + len(self._supports.columns) :] += self.border_values()
        self.pass_through(system, values, jump, loads)
        return q

    def pass_through(self, system: ContactSystem, values: Array, jump: Array, loads: Array) -> None:
        """Let a dense system have this tangent and given values at a state.

        Args:
            system: The dense system on the same retained jumps.
            values: Forces of the last coordinates and values of the borders, shape (n_last,).
            jump: Retained jumps, shape (n_retained,), length.
            loads: Amplitudes of supports and load factors, shape (n_loads,).
        """
        x, schur = np.concatenate([jump, loads]), self.condensation.schur
        system.renew(schur, values - schur[:, : len(x)] @ x)

    def destroy(self) -> None:
        """Free all PETSc objects; collective."""
        self.accept()
        self.release_memory()
        for vector in self.borders:
            vector.destroy()
        self._borders = None


__all__ = ["CondensedTangent"]
