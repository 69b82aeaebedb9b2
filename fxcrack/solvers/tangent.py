"""Nonlinear bodies condensed at a displacement: the tangent, its window, what SNES asks of them.

    S = (K_22 - K_21 K_11^-1 K_12)(u),    offset such that S x + offset are the forces at u

Bodies without their past: moves between equilibria are :mod:`fxcrack.solvers.newton`'s.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError, SolverError
from fxcrack.condensation.bordered_matrix import load_and_monitor_vectors
from fxcrack.condensation.direct import DirectCondensation
from fxcrack.condensation.rigid_motions import check_held
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.interface.finite_sliding import renewed
from fxcrack.interface.jump_coordinates import JumpCoordinates
from fxcrack.interface.nodes import JumpGather
from fxcrack.interface.surface import gather_surface
from fxcrack.solvers.linear import LinearSolver
from fxcrack.solvers.options import NewtonOptions
from fxcrack.solvers.snes import Counts

_FEW_COLUMNS = 256
"""Up to so many last coordinates block solves beat a second factorisation on several ranks."""


class _Tangent(NamedTuple):
    """A condensed tangent, the version of its terms, and how far it is off where it is used."""

    condensation: DirectCondensation
    version: tuple[int, ...]
    drift: float


class CondensedTangent(LinearSolver):
    """Nonlinear bodies with the dense system of their tangent.

    Args:
        parts: Those of :class:`~fxcrack.solvers.linear.LinearSolver`, in its order.
        bodies: The form terms.
        newton: Controls of the iteration.

    Raises:
        InputError: The options ask for a way to condense that only linear bodies allow.

    Attributes:
        u: Accepted displacement, owned dofs.
        counts: Solves and iterations so far.
        force_scale: Norm of the internal forces at the last residual.
        largest_force: The largest one of an accepted state.
        round_off: Residual that rounding alone may leave there.
        at: Time of the accepted state.
        pairing_energy: Energy that new pairings of faces that slide have taken so far.
        masters: Per pair the undeformed master surface, ``None`` where pairing is never renewed.
        drift: How far the tangent at hand is off at the accepted state: what was out of balance
            where it was made, over the forces.
        exact: Whether S itself counts, not only equilibria found with it, as for rates by exact
            crack closure: it is that of every state then.
    """

    linear = False

    def __init__(self, *parts: Any, bodies: WeakForm, newton: NewtonOptions) -> None:
        super().__init__(*parts)
        if self.columns is not None:
            raise InputError(
                "method='iterative' keeps its columns while the crack grows, which needs linear "
                "bodies; use method='auto' with nonlinear ones"
            )
        continuum = self.continuum
        self.bodies = bodies
        self.newton = newton
        self.counts = Counts()
        self.comm = continuum.comm
        self.force_scale = self.largest_force = self.round_off = 0.0
        self.u = PETSc.Vec().createMPI((continuum.n_local, continuum.n_global), comm=self.comm)
        self.coordinates: JumpCoordinates
        self._stiff = 0.0
        self._base = np.zeros(0)
        self._kept: _Tangent | None = None  # the one before a trial that made another
        self._spare: DirectCondensation | None = None  # whose memory the next tangent takes
        self._version: tuple[int, ...] = ()  # of the terms whose tangent is factored
        self.drift = 0.0
        self._current = bodies.finite
        self.masters = [
            gather_surface(continuum, p.interface.master)
            if self._current and p.interface.contact
            else None
            for p in self.pairs
        ]
        self._undeformed = [p.surface.x for p in self.pairs]
        self._reader = JumpGather(
            continuum.layout, self.pairs, [m for m in self.masters if m is not None]
        )
        self.at = 0.0
        self.pairing_energy = 0.0
        self.exact = False

    # -- the window and its tangent ------------------------------------------------------

    def _assemble(self) -> None:
        if self._stiffness is not None:
            return
        start = time.perf_counter()
        check_held(self.continuum, self.supports)
        self.bodies.compile()
        self.timings.add("compile", start)
        start = time.perf_counter()
        self.bodies.set(self.u)
        self._stiffness = self.bodies.tangent()
        self._borders = load_and_monitor_vectors(
            self.continuum, self.loads, self.monitors, self._followed
        )
        self.timings.add("assemble", start)

    def _condense(self, coordinates: JumpCoordinates) -> None:
        self.coordinates = coordinates
        self._base = self._jumps_from(self.u)
        n_retained, n_loads = coordinates.n_retained, self.n_loads
        loads = self.state.loads if hasattr(self, "state") else np.zeros(n_loads)
        self.bodies.set(self.u)
        self._factor()
        schur, offset = self.condensation.schur, np.zeros(coordinates.n_last)
        self.system = ContactSystem(schur, n_retained, n_loads, len(self.loads), offset=offset)
        residual = self._out_of_balance(loads)
        self._anchor(residual, self._base, loads)
        residual.destroy()
        self.face_loads = -self.condensation.borders_on_window[:, : len(self.loads)]

    @property
    def condensation(self) -> DirectCondensation:
        """The condensed tangent."""
        assert isinstance(self._condensation, DirectCondensation)
        return self._condensation

    def _choose_window(self) -> JumpCoordinates:
        self._drop_spare()
        return super()._choose_window()

    def _factor(self) -> None:
        """Condense the tangent at the bodies' present displacement; collective.

        The one at hand at the beginning of a trial is kept until the trial is accepted.
        """
        free, self._spare = self._spare, None
        if self._condensation is not None:
            if self._kept is None:
                self._kept = _Tangent(self.condensation, self._version, self.drift)
            else:
                free = self.condensation
        self._condensation = None
        method = self.options.method
        if method == "auto" and self.comm.size > 1 and self.coordinates.n_last <= _FEW_COLUMNS:
            method = "columns"
        matrix, self._stiffness = self.bodies.tangents()
        try:
            if free is None:
                free = DirectCondensation(
                    matrix, self.coordinates, self._borders, self.timings,
                    method=method, definite=False, renewable=True,
                )  # fmt: skip
            else:
                free.renew(matrix)
        except SolverError:
            self._spare = free
            self._drop_spare()
            raise
        self._condensation = free
        self._version, self.drift = self.bodies.version, 0.0
        self._stiff = float(self._stiffness.norm(PETSc.NormType.NORM_INFINITY))

    def _drop_spare(self) -> None:
        if self._spare is not None:
            self._spare.destroy(keep_transform=True)
            self._spare = None

    def _keep_tangent(self) -> None:
        """The tangent at hand is the accepted one from now on; collective."""
        if self._kept is not None:
            self._spare, self._kept = self._kept.condensation, None

    def _former_tangent(self) -> None:
        """Forget tangents made since the last accepted state; collective."""
        if self._kept is not None:
            self._spare = self._condensation  # type: ignore[assignment]
            self._condensation = self._kept.condensation
            self._version, self.drift = self._kept.version, self._kept.drift
            self._kept = None

    def _anchor(self, residual: PETSc.Vec, jump: Array, loads: Array) -> PETSc.Vec:
        """Offset of the dense system from a residual; returns A_11^-1 r_1."""
        values, q = self.condensation.reduced(residual)
        values[self.system.n_retained + len(self.supports.columns) :] += self._border_values()
        x = np.concatenate([jump, loads])
        schur = self.condensation.schur
        self.system.renew(schur, values - schur[:, : len(x)] @ x)
        return q

    def _border_values(self) -> Array:
        """Minus the work of each force pattern, then the monitors, at the bodies' displacement."""
        u = self.bodies.u.x.petsc_vec
        return np.array([float(border.dot(u)) for border in self._borders])

    def _jumps_from(self, u: PETSc.Vec) -> Array:
        """Jumps of the window in a displacement, shape (n_retained,); collective."""
        values = self._reader.gather(u.array_r)
        out = np.zeros(self.coordinates.n_retained)
        for pair, frames, index in zip(self.pairs, self.frames, self.index, strict=True):
            inside = index >= 0
            out[index[inside]] = self._reader.jumps(values, pair, frames)[inside]
        return out

    def _follow_fronts(self, u: PETSc.Vec) -> None:
        """Take normals and lengths at the fronts from a displacement, if it is finite."""
        if not self._current:
            return
        values = self._reader.gather(u.array_r)
        for pair, front, x in zip(self.pairs, self.fronts, self._undeformed, strict=True):
            moved = x.copy()
            moved[:, : self.continuum.gdim] += self._reader.displacements(values, pair.surface)
            front.follow(moved)

    @property
    def follows_sliding(self) -> bool:
        """Whether open nodes are paired anew where faces slide."""
        return any(m is not None for m in self.masters)

    def renew_pairs(self) -> bool:
        """Pair open nodes with the master surface where it is now; collective.

        Returns:
            Whether a pair has changed; the dense system is then another one, and the caller
            solves for its state (:meth:`solve`).
        """
        if not self.follows_sliding:
            return False
        values = self._reader.gather(self.u.array_r)
        changed = False
        for p, master in enumerate(self.masters):
            if master is None:
                continue
            pair = self.pairs[p]
            new = renewed(
                pair,
                self.fronts[p].bonded,
                master,
                self._reader.displacements(values, pair.surface),
                self._reader.displacements(values, master),
            )
            if new is not None:
                self.pairs[p], changed = new, True
        if changed:
            self.rebase()
        return changed

    # -- what SNES asks ------------------------------------------------------------------

    def forces_at(self, y: PETSc.Vec, loads: Array) -> PETSc.Vec:
        """R(u) minus dead loads at u = u_accepted + T y; the caller destroys it."""
        u = self.coordinates.transform.createVecLeft()
        self.coordinates.transform.mult(y, u)
        u.axpy(1.0, self.u)
        self.bodies.set(u)
        u.destroy()
        return self._out_of_balance(loads)

    def _out_of_balance(self, loads: Array) -> PETSc.Vec:
        residual = self.bodies.residual()
        self.force_scale = float(residual.norm())
        u = self.bodies.u.x.array[: self.continuum.n_local]  # PETSc's norm of it would be cached
        size = np.sqrt(self.comm.allreduce(float(u @ u)))
        self.round_off = 4.0 * np.finfo(float).eps * self._stiff * float(size)
        factors = loads[self.n_loads - len(self.loads) :]
        for factor, border in zip(factors, self._borders, strict=False):
            residual.axpy(float(factor), border)
        return residual

    def jumps_of(self, y: PETSc.Vec) -> Array:
        """Jumps of the window at a trial y, shape (n_retained,)."""
        out = self._base.copy()
        if self.comm.rank == 0:
            n = self.coordinates.n_inner
            out += y.array_r[n : n + len(out)]
        self.comm.Bcast(out)
        return out

    def linearise(
        self, jump: Array, loads: Array, residual: PETSc.Vec, out: PETSc.Vec, *, anew: bool
    ) -> bool:
        """Dense system of the tangent through the bodies' present forces.

        Args:
            jump: Jumps there, shape (n_retained,).
            loads: Shape (n_loads,).
            residual: Forces there, r.
            out: Becomes A_11^-1 r_1.
            anew: Make the tangent of the bodies' present displacement; else take the one at hand
                if the terms' data have not changed since.

        Returns:
            Whether a tangent was made.
        """
        anew = (anew and not self.bodies.constant) or self._version != self.bodies.version
        if anew:
            self._factor()
        q = self._anchor(residual, jump, loads)
        q.copy(out)
        q.destroy()
        return anew

    def interface_equilibrium(self, loads: Array, force: Array) -> Equilibrium:
        """Jumps and forces on the present tangent, softening bonds on their right branches."""
        system = self.system
        state = system.equilibrium(loads, force)
        for _ in range(4 * len(system.soft.bonds) + 4 if system.soft.bonds else 0):
            if not system.soft.stable():
                state = system.pass_unstable(state)
                continue
            at, leaving = system.soft.first_event(self.state.jump, state.jump)
            if not np.isfinite(at):
                break
            system.finish([b for b in leaving if system.soft.switch(b, state.jump)])
            state = system.equilibrium(loads, force)
        return state

    # -- for checkpoints -----------------------------------------------------------------

    def place(self, state: dict[str, Array], time: float) -> None:
        """Put the bodies into a state of :meth:`WeakForm.state` at a time; collective."""
        if self.continuum.temperature is not None:
            self.continuum.temperature.set(time)
        self.bodies.restore(state)
        self.u.array[:] = self.bodies.u.x.array[: self.continuum.n_local]
        self._follow_fronts(self.u)
        self.at = time

    def present_jump(self) -> Array:
        """Jumps of the window at the accepted displacement, shape (n_retained,)."""
        return self._base.copy()

    def anchor(self) -> None:
        """Let the dense system pass through the accepted state; collective."""
        residual = self._out_of_balance(self.state.loads)
        q = self._anchor(residual, self.state.jump, self.state.loads)
        q.destroy()
        residual.destroy()

    def dense(self) -> dict[str, Array]:
        """The dense system as it is, which need not be that of the accepted displacement."""
        assert self.system.offset is not None
        return {
            "schur": self.system.schur,
            "offset": self.system.offset,
            "faces": self.face_loads,
        }

    def take_dense(self, arrays: dict[str, Array]) -> None:
        """Go on with a dense system from :meth:`dense` of the same window."""
        self.system.renew(arrays["schur"], arrays["offset"])
        self.face_loads = arrays["faces"]

    # -- energies and fields -------------------------------------------------------------

    def stored(self, state: Equilibrium) -> dict[str, float]:
        """Energies stored in the bodies in the accepted state, by name; collective."""
        return self.bodies.stored()

    def spent(self) -> dict[str, float]:
        """Energies the bodies have turned into something else, by name; collective."""
        spent = self.bodies.spent()
        if self.follows_sliding:
            spent["pairing_energy"] = self.pairing_energy
        return spent

    def extra_work(self, state: Equilibrium) -> float:
        """Work of loads that follow the bodies and of a temperature; collective."""
        return sum(term.work() for term in self.bodies.terms)

    def displacement(self, state: Equilibrium | None = None) -> PETSc.Vec:
        """Accepted displacement; the caller destroys it."""
        return self.u.copy()

    def destroy(self) -> None:
        """Free all PETSc objects; collective."""
        self._keep_tangent()
        self._drop_spare()
        super().destroy()

    def nodal_forces(self, u: PETSc.Vec, state: Equilibrium | None = None) -> PETSc.Vec:
        """Forces of interfaces and supports on the bodies; the caller destroys them."""
        return self._out_of_balance(self.state.loads if state is None else state.loads)
