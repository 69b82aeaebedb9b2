"""Linear bodies: condensed once per set of retained jumps, then dense algebra.

The stiffness does not change while the crack grows, so equilibria, releases and energies need the
condensed bodies only. They are condensed again when a front leaves the retained jumps.
"""

from __future__ import annotations

import time

import numpy as np
from petsc4py import PETSc

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import ComesApart, InputError
from fxcrack.base.machine import machine_memory_mb
from fxcrack.condensation.bordered_matrix import load_and_monitor_vectors
from fxcrack.condensation.cost_laws import too_large_for_direct
from fxcrack.condensation.direct import DirectCondensation
from fxcrack.condensation.iterative import IterativeCondensation, Roles, SchurColumnCache
from fxcrack.condensation.options import CondensedOptions
from fxcrack.condensation.retained import ColumnCost, CostModel
from fxcrack.condensation.rigid_motions import check_held
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.foundation import ENERGY, Foundation
from fxcrack.continuum.loads import Load, Monitor
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.thermal_strain import ThermalLoad, held_energies
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium, bond_work, work_between
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.equilibrium.interface_state import InterfaceState
from fxcrack.interface.bond_springs import bond_springs
from fxcrack.interface.jump_coordinates import build_coordinates
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports
from fxcrack.solvers.interface_solver import Condensed, InterfaceSolver

_ROUND_OFF = 1e-12
"""Of an entry of S, by the diagonal of A. Measured on pivots, the energy v^t S v of a motion v over
sum A_ii v_i^2: at most 2e-15 where nothing holds a body, nearly incompressible or not; of those
held 7e-10 or more in slender bodies (900 to 1), 1e-10 in thin ones (50 to 1) that are 1e4 times
softer than their slaves, 1e-12 where they are 1e7 times softer."""
_ROUND_OFF_OF_WORK = 1e-15
"""Of u K u, by the sum of K_ii u_i^2. Bodies that turn as rigid ones, as arms do that came apart,
have 1e-16 of it, a strut 1000 times as long as thick that is bent has 3e-14."""


class LinearSolver(InterfaceSolver):
    """Linear bodies, interfaces and loads.

    Args:
        continuum: Bodies.
        pairs: Interfaces.
        supports: Prescribed components.
        loads: Force patterns; those of a temperature come last.
        monitors: Monitored displacements.
        options: How to condense.
        foundation: What holds bodies that only contact would hold, if anything.

    Attributes:
        stiffness: K, once assembled.
        borders: Force patterns with the minus sign, then monitors, once assembled.
        condensation: The condensed bodies, once there are any.
        columns: Columns computed by iteration, ``None`` where the bodies are factored.
    """

    def __init__(
        self,
        continuum: Continuum,
        pairs: list[Pair],
        supports: Supports,
        loads: list[Load],
        monitors: list[Monitor],
        options: CondensedOptions,
        foundation: Foundation | None = None,
    ) -> None:
        super().__init__(continuum, pairs, supports, loads, monitors, options)
        self.foundation = foundation
        self.stiffness: PETSc.Mat | None = None
        self.borders: list[PETSc.Vec] = []
        self.condensation: DirectCondensation | IterativeCondensation | None = None
        self.columns: SchurColumnCache | None = None
        if options.method == "iterative" and isinstance(continuum, ShellBodies):
            raise InputError(
                "CondensedOptions(method='iterative') is not possible with shells, whose stiffness "
                "against bending and stretching differs too much; leave method out"
            )
        if options.method == "iterative" and continuum.layout.shared:
            raise InputError(
                "CondensedOptions(method='iterative') is not possible in generalised plane strain, "
                "whose strain out of the plane links all nodes; leave method out"
            )
        compliant = [p.title for p in pairs if p.interface.stiffness is not None]
        if options.method == "iterative" and compliant:
            raise InputError(
                f"CondensedOptions(method='iterative'): interface '{compliant[0]}' has bonds with "
                "a stiffness of their own, which need a factorisation; leave method or stiffness "
                "out"
            )
        if options.method == "iterative" or (
            options.method == "auto" and not compliant and self._too_large()
        ):
            self._cost = ColumnCost.guess(continuum.n_global)
            self.columns = SchurColumnCache(
                continuum, pairs, supports, rtol=options.rtol, cap_mb=options.retained_mb
            )
        self._n_thermal = sum(isinstance(x, ThermalLoad) for x in loads)
        self._held_energies: Array | None = None
        self._springs: list[Array | None] | None = None

    def _too_large(self) -> bool:
        """Whether a factorisation would not fit the memory, which is logged; collective."""
        if self.continuum.mesh.gdim < 3 or isinstance(self.continuum, ShellBodies):
            return False
        comm = self.continuum.comm
        reason = too_large_for_direct(self.continuum.n_global, 1e6 * machine_memory_mb(comm))
        if reason is not None:
            log.warn("%s: the iterative method is used (method='schur' insists)", reason)
        return reason is not None

    # -- condensation --------------------------------------------------------------------

    def _assembled(self) -> PETSc.Mat:
        """K; it and the borders are made on first use; collective."""
        if self.stiffness is None:
            start = time.perf_counter()
            check_held(self.continuum, self.supports, self.pairs)
            self.continuum.compile()
            self.timings.add("compile", start)
            start = time.perf_counter()
            self.stiffness = self.continuum.stiffness()
            if self.foundation is not None:
                self.foundation.add_to(self.stiffness)
            self.borders = load_and_monitor_vectors(
                self.continuum, self.loads, self.monitors, self._followed
            )
            self.timings.add("assemble", start)
        return self.stiffness

    def _condense(self, roles: Roles, loads: Array) -> Condensed:
        stiffness = self._assembled()
        if self.condensation is not None:
            self.condensation.destroy()
            self.condensation = None
        found: DirectCondensation | IterativeCondensation
        if self.columns is None:
            found = direct = self._factored(stiffness, roles)
        else:
            found = self._by_columns(self.columns, stiffness, roles)
        self.condensation = found
        coordinates = found.coordinates
        n_forces = len(self.loads)
        system = ContactSystem(found.schur, coordinates.n_retained, self.n_loads, n_forces)
        system.cholesky.restraint = self.restraint(roles, coordinates)
        if self.columns is None:
            # a body that is nearly incompressible has a much larger diagonal than S
            system.cholesky.round_off = _ROUND_OFF * np.abs(direct.diagonal)
        face_loads = -found.borders_on_retained[:, :n_forces]
        # a temperature acts on no face; its force on a node at an end does not follow the crack
        face_loads[:, n_forces - self._n_thermal :] = 0.0
        return Condensed(coordinates, system, face_loads)

    def _factored(self, stiffness: PETSc.Mat, roles: Roles) -> DirectCondensation:
        """The bodies condensed by a factorisation; collective."""
        start = time.perf_counter()
        if self._springs is None:
            self._springs = bond_springs(self.continuum, self.pairs)
        coordinates = build_coordinates(
            self.continuum.layout, self.pairs, roles, self.supports, len(self.borders),
            self._springs,
        )  # fmt: skip
        self.timings.add("transform", start)
        start = time.perf_counter()
        found = DirectCondensation(
            stiffness, coordinates, self.borders, self.timings, method=self.options.method,
            doubt=self.restraint(roles, coordinates).judge,
        )  # fmt: skip
        seconds = self.continuum.comm.bcast(time.perf_counter() - start)
        assert isinstance(self._cost, CostModel)
        self._cost.observe(coordinates.n_retained, seconds)
        return found

    def _by_columns(
        self, columns: SchurColumnCache, stiffness: PETSc.Mat, roles: Roles
    ) -> IterativeCondensation:
        """The bodies condensed by columns of S, no factorisation; collective."""
        may_open = []
        for pair, front, on in zip(self.pairs, self.fronts, self.active, strict=True):
            later = np.zeros((pair.surface.n_nodes, self.continuum.gdim), dtype=bool)
            later[front.bonded & pair.paired] = on
            if pair.interface.normal_only:
                later[:, 1:] = False
            may_open.append(later)
        start = time.perf_counter()
        made = columns.condense(roles, may_open, stiffness, self.borders, self.timings)
        spent = self.continuum.comm.bcast((made.column_seconds, time.perf_counter() - start))
        assert isinstance(self._cost, ColumnCost)
        self._cost.observe(made.computed, *spent)
        log.debug("%d new columns in %.2f s", made.computed, made.column_seconds)
        return made

    # -- from equilibrium to equilibrium -------------------------------------------------

    def _equilibrium(self, before: InterfaceState, force: Array) -> Equilibrium:
        system, loads = self.system, before.equilibrium.loads
        if system.friction is None:
            return system.linear(loads, force)
        # slip and stick do not follow from the loads: they follow from the jumps
        jump = before.values(before.equilibrium.jump, self.index, system.n_retained)
        held = system.friction.over(system.friction.of(jump), system.n_retained)
        return system.linear(loads, force, held)

    def start(self) -> None:
        """Find the equilibrium without loads; collective."""
        zero = np.zeros(self.system.n_retained)
        self.state = self.system.equilibrium(np.zeros(self.n_loads), zero)

    def release(self, p: int, nodes: Ints, force: Array) -> tuple[float, float]:
        """Release nodes at constant load and find the new equilibrium.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (n,).
            force: Given forces afterwards, shape (n_retained,), force.

        Returns:
            Energy released by the bond forces on their way, and external work.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
            ComesApart: So it would once bonds that soften have opened; likewise.
        """
        saved = self.interface_state()
        self.open(p, nodes)
        released, work, last = 0.0, 0.0, self.state
        try:
            for _, point in self.system.pieces(last, last.loads, force):
                more, out, _ = self.along(last, point)
                work, released = work + more, released + out
                self.book_contact(last, point)
                last = point
        except (NotPositiveDefinite, ComesApart):
            self.restore_interfaces(saved)
            raise
        self.state = last
        return released, work

    def commit(self) -> None:
        """The present state is accepted; linear bodies remember nothing else."""

    def remember(self) -> InterfaceState:
        """What :meth:`recall` needs to return to the present state."""
        return self.interface_state()

    def recall(self, saved: InterfaceState) -> None:
        """Return to an earlier state on the same retained jumps."""
        self.restore_interfaces(saved)

    def undo(self, saved: InterfaceState, rebases: int) -> None:
        """Return to an earlier state of the interfaces, be the retained jumps others since.

        Collective.

        Args:
            saved: The state.
            rebases: Value of :attr:`rebases` then.
        """
        if self.rebases == rebases:
            self.restore_interfaces(saved)
            return
        saved.restore_bonds(self.fronts)
        self._retain(saved)
        self.rebases += 1

    # -- energies and fields -------------------------------------------------------------

    def along(self, here: Equilibrium, point: Equilibrium) -> tuple[float, float, Array]:
        """External work, energy released by bonds, mean jumps of a linear piece.

        Args:
            here: Equilibrium at its beginning.
            point: Equilibrium at its end.

        Returns:
            Two energies, and the mean jumps, shape (n_retained,), length.
        """
        work = work_between(here, point, len(self.loads))
        return work, bond_work(here, point), 0.5 * (here.jump + point.jump)

    def book_contact(self, here: Equilibrium, point: Equilibrium) -> None:
        """Add to their energies what friction and faces that overlap do along a linear piece."""
        system = self.system
        if system.friction is not None:
            self.friction_energy += system.friction.dissipation(system, here, point)
        closing = system.closing(here, point)
        if len(closing):
            mean = 0.5 * (system.pressure(here, closing) + system.pressure(point, closing))
            self.overlap_energy += float(mean @ (point.jump - here.jump)[closing])

    def stored(self, state: Equilibrium) -> dict[str, float]:
        """Energies stored in the bodies, by name; collective."""
        whole = self.system.strain_energy(state) + self._thermal_part(state)
        if self.foundation is None:
            return {"strain_energy": whole}
        u = self.displacement(state)
        held = self.foundation.stored_in(u)
        u.destroy()
        return {"strain_energy": whole - held, ENERGY: held}

    def spent(self) -> dict[str, float]:
        """Energies the bodies have turned into something else, by name; linear ones none."""
        return {}

    def extra_work(self, state: Equilibrium) -> float:
        """Work on the bodies beyond that of supports and force patterns: of a temperature."""
        return self._thermal_part(state)

    def _thermal_part(self, state: Equilibrium) -> float:
        """What a temperature, which counts as a load here, adds to work and stored energy alike.

        -sum_k a_k f_k u + 1/2 sum_kl a_k a_l E_kl
        (:func:`fxcrack.continuum.thermal_strain.held_energies`)
        """
        if not self._n_thermal:
            return 0.0
        if self._held_energies is None:
            self._held_energies = held_energies(self.continuum)
        factors, answers = state.loads[-self._n_thermal :], state.conjugate[-self._n_thermal :]
        return float(0.5 * factors @ self._held_energies @ factors - factors @ answers)

    @property
    def recovers_displacement(self) -> bool:
        """Whether :meth:`displacement` takes a back-substitution and no new factorisation."""
        return self.condensation is not None and self.condensation.recovers

    def displacement(self, state: Equilibrium | None = None) -> PETSc.Vec:
        """Displacement vector of a state; collective; the caller destroys it."""
        state = self.state if state is None else state
        assert self.condensation is not None
        last = np.zeros(len(self.system.schur))
        last[: self.system.n_retained] = state.jump
        last[self.system.n_retained : self.system.n_retained + self.n_loads] = state.loads
        return self.condensation.displacement(last)

    def displacement_of_jumps(self, jump: Array) -> PETSc.Vec:
        """Displacement that retained jumps alone cause, shape (n_retained,) [length]; collective.

        Without loads; the caller destroys it.
        """
        assert self.condensation is not None
        last = np.zeros(len(self.system.schur))
        last[: self.system.n_retained] = jump
        return self.condensation.displacement(last)

    @property
    def responds(self) -> bool:
        """Whether :meth:`response` takes back-substitutions and no new factorisation.

        With friction there is none: what slips answers further forces by its direction.
        """
        condensation = self.condensation
        direct = isinstance(condensation, DirectCondensation) and condensation.recovers
        return direct and self.system.friction is None

    def response(self, forces: Array) -> Array:
        """Displacement by further forces, supports, loads, bonds and contact as they are.

        Collective.

        Args:
            forces: On the dofs that this rank owns, shape (n_local,).

        Returns:
            Of the dofs that this rank owns, shape (n_local,), length.
        """
        condensation = self.condensation
        assert isinstance(condensation, DirectCondensation)
        size = self.continuum.n_local, self.continuum.n_global
        right = PETSc.Vec().createMPI(size, comm=self.continuum.comm)
        right.array[:] = forces
        condensed, inner = condensation.reduced(right)
        right.destroy()
        jump, _ = self.system.rates(np.zeros(self.n_loads), condensed[: self.system.n_retained])
        u = condensation.displacement_beside(inner, np.pad(jump, (0, len(condensed) - len(jump))))
        inner.destroy()
        out = u.array_r.copy()
        u.destroy()
        return np.asarray(out)

    def elastic_work(self, u: Array) -> float:
        """Twice the energy u K u of a displacement, force x length; collective.

        Args:
            u: Of the dofs that this rank owns, shape (n_local,), length.
        """
        stiffness = self._assembled()
        right, left = stiffness.createVecs()
        right.array[:] = u
        stiffness.mult(right, left)
        out = float(right.dot(left))
        right.destroy()
        left.destroy()
        return out

    def round_off_of_work(self, u: Array) -> float:
        """How large :meth:`elastic_work` may be by round-off alone; collective.

        Args:
            u: Of the dofs that this rank owns, shape (n_local,), length.
        """
        diagonal = self._assembled().getDiagonal()
        mine = float(np.abs(diagonal.array_r) @ u**2)
        diagonal.destroy()
        return _ROUND_OFF_OF_WORK * float(np.sum(self.continuum.comm.allgather(mine)))

    def nodal_forces(self, u: PETSc.Vec, state: Equilibrium | None = None) -> PETSc.Vec:
        """Forces of interfaces and supports on the bodies, K u - f.

        Collective; the caller destroys the vector.

        Args:
            u: Displacements of the state, from :meth:`displacement`.
            state: The state whose loads act; the present one by default.
        """
        state = self.state if state is None else state
        stiffness = self._assembled()
        out = stiffness.createVecLeft()
        stiffness.mult(u, out)
        # the first borders are the force patterns with the minus sign; monitors follow
        factors = state.loads[self.n_loads - len(self.loads) :]
        for factor, border in zip(factors, self.borders, strict=False):
            out.axpy(float(factor), border)
        return out

    def destroy(self) -> None:
        """Free all PETSc objects; collective."""
        if self.condensation is not None:
            self.condensation.destroy()
            self.condensation = None
        if self.columns is not None:
            self.columns.destroy()
        for vector in self.borders:
            vector.destroy()
        if self.stiffness is not None:
            self.stiffness.destroy()
            self.stiffness = None
        self.borders = []
