"""Nonlinear bodies: from one equilibrium to the next, accepted or rejected.

Between two accepted states the dense system holds the tangent: it predicts the path, SNES corrects
the end (:mod:`fxcrack.solvers.increment_work`).
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import NO_EQUILIBRIUM, ConvergenceError, EnergyImbalance, InputError
from fxcrack.condensation.iterative import Roles
from fxcrack.condensation.options import CondensedOptions
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.loads import Load, Monitor
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.equilibrium.interface_state import Arrays, InterfaceState
from fxcrack.interface.crack_fluid import CrackFluid
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports
from fxcrack.solvers.accepted_bodies import AcceptedBodies
from fxcrack.solvers.condensed_tangent import CondensedRequest, condense_tangent
from fxcrack.solvers.deformed_interfaces import DeformedInterfaces
from fxcrack.solvers.free_motion import moves_freely
from fxcrack.solvers.increment_balance import ANOTHER
from fxcrack.solvers.increment_work import in_pieces
from fxcrack.solvers.interface_solver import Condensed, InterfaceSolver
from fxcrack.solvers.new_pairings import pressed, pulling
from fxcrack.solvers.newton_state import NewtonState, ResumedTangent, tangent_arrays
from fxcrack.solvers.options import NewtonOptions
from fxcrack.solvers.tangent import CondensedTangent
from fxcrack.solvers.trial import IncrementSolver
from fxcrack.solvers.trial_account import TrialAccount, overlap_work

_UNSTABLE = (
    "the equilibrium found is unstable (buckling, or a limit load was passed); take smaller "
    "increments, or control a displacement instead of a force"
)


class NewtonSolver(InterfaceSolver):
    """Nonlinear bodies, interfaces and loads.

    Args:
        continuum: Displacement space.
        pairs: Interfaces.
        supports: Prescribed components.
        loads: Force patterns.
        monitors: Monitored displacements.
        options: How to condense.
        bodies: The form terms.
        newton: Controls of the iteration.

    Raises:
        InputError: The options ask for a way to condense that only linear bodies allow.

    Attributes:
        tangent: The bodies' condensed tangent.
        interfaces: The interfaces as the displacement has them.
        accepted: The bodies in the accepted state.
        counts: Solves and iterations so far.
        exact: Whether S itself counts, not only equilibria found with it, as for rates by exact
            crack closure: it is that of every state then.
        free_start: Whether the motion began without an equilibrium, see :meth:`begin_motion`.
    """

    def __init__(
        self,
        continuum: Continuum,
        pairs: list[Pair],
        supports: Supports,
        loads: list[Load],
        monitors: list[Monitor],
        options: CondensedOptions,
        *,
        bodies: WeakForm,
        newton: NewtonOptions,
    ) -> None:
        super().__init__(continuum, pairs, supports, loads, monitors, options)
        if options.method == "iterative":
            raise InputError(
                "method='iterative' keeps its columns while the crack grows, which needs linear "
                "bodies; use method='auto' with nonlinear ones"
            )
        self.bodies = bodies
        self.newton = newton
        self.fluids = [t for t in bodies.terms if isinstance(t, CrackFluid)]
        self.tangent = CondensedTangent(
            bodies, supports, loads, monitors, method=options.method, timings=self.timings
        )
        self._increments = IncrementSolver(self.tangent, newton, self.n_loads, len(loads))
        self.counts = self._increments.counts
        self.interfaces = DeformedInterfaces(continuum, pairs, self.fronts, finite=bodies.finite)
        self.accepted = AcceptedBodies(bodies, self.tangent)
        self.exact = self.free_start = False
        self._before = self.interface_state()  # of the accepted state, before the last trial
        self._begun = False  # whether the last trial was an increment of time for the terms
        self._account = TrialAccount()
        self._resumed_tangent: ResumedTangent | None = None

    @property
    def u(self) -> PETSc.Vec:
        """Accepted displacement, owned dofs."""
        return self.accepted.u

    # -- condensation --------------------------------------------------------------------

    def _condense(self, roles: Roles, loads: Array) -> Condensed:
        return condense_tangent(
            self.tangent,
            CondensedRequest(self.pairs, roles, self.supports, loads, self._followed),
            self.u,
            restraint=self.restraint,
            jumps=self.interfaces.jumps,
            resumed=self._resumed_tangent,
            at=self.accepted.at,
        )

    def _equilibrium(self, before: InterfaceState, force: Array) -> Equilibrium:
        jump = self.interfaces.jumps(self.u, self.tangent.coordinates)
        return Equilibrium(before.equilibrium.loads, force, jump, before.equilibrium.conjugate)

    def prepare(self, active: list[bool], reach: list[float]) -> None:
        """Choose the retained jumps for a step, and condense; collective.

        Arguments as for :meth:`InterfaceSolver.prepare`.
        """
        super().prepare(active, reach)
        made, self._resumed_tangent = self._resumed_tangent, None
        if made is not None and made.fits(self.index):
            self.system.renew(made.schur, made.offset)
            self.face_loads = made.face_loads
            self.tangent.drift = made.drift

    def renew_pairs(self) -> bool:
        """Pair open nodes with the master surface where it is now; collective.

        Returns:
            Whether a pair has changed; the dense system is then another one, and the caller
            goes on to its equilibrium (:meth:`settle`).
        """
        changed = self.interfaces.pair_anew(
            self.u,
            pulling(self.index, self.state.force, self.system.soft),
            pressed(self.index, self.system.closed),
        )
        if changed:
            self.rebase()
            if self.system.friction is not None:
                # slips so far, in the jumps of the present pairing
                self.system.friction.commit(self.state.jump)
        return changed

    # -- trials --------------------------------------------------------------------------

    def begin_motion(self, dt: float) -> None:
        """Let bodies with inertia that nothing holds begin without an equilibrium; collective.

        Before an increment of time the tangent holds no inertia, so that it is singular where a
        body can move freely. There is then no equilibrium to begin with, and loads and a
        temperature that are there from the first moment are applied within the first increment.

        Args:
            dt: Length of the first increment, time.
        """
        inertia = self.bodies.inertia
        if inertia is not None and moves_freely(
            self.continuum, self.supports, self.pairs, self.fronts
        ):
            self.free_start = True
            inertia.expect(dt)

    def start(self) -> None:
        """Find the equilibrium without loads; collective."""
        zero = np.zeros(self.system.n_retained)
        self.state = Equilibrium(np.zeros(self.n_loads), zero, zero, np.zeros(self.n_loads))
        if not self.free_start:
            self._solve(zero)
        elif self.continuum.temperature is not None:
            self.continuum.temperature.clear()
            self.bodies.set(self.u)

    def _solve(self, force: Array) -> None:
        """Find the equilibrium at the present loads with given forces, shape (n_retained,)."""
        if self.bodies.dynamic:
            force = self.state.force  # no motion over a zero time step
        soft = bool(self.system.soft.bonds)  # they may run through unstable states on the way
        self.move(self.state.loads, force, self.accepted.at, 0.0, follow=soft, confirm=False)
        # overlapping faces and new pairings have energies of their own
        self.confirm(strict=None)
        self.commit()

    def move(
        self,
        loads: Array,
        force: Array,
        at: float,
        dt: float,
        *,
        follow: bool = True,
        confirm: bool = True,
        strict: bool = False,
    ) -> Equilibrium:
        """Find the equilibrium at other loads and given forces; collective.

        The result is a trial until :meth:`commit`; :meth:`revert` rejects it. The dense system's
        contact and softening states are those of the trial.

        Args:
            loads: Amplitudes of supports and load factors at the end, shape (n_loads,).
            force: Given forces at the end, shape (n_retained,), force.
            at: Time of the end.
            dt: Time since the accepted state.
            follow: Follow contact and softening on the path; else go straight to the end.
            confirm: Call :meth:`confirm` as well; else it must be before :meth:`commit`.
            strict: What :meth:`confirm` gets.

        Raises:
            ConvergenceError: None was found; the accepted state is in force again.
        """
        if self.bodies.accountable:
            self.accepted.energy.now()
        self._before = self.interface_state()
        dynamic = self.bodies.dynamic
        self._begun = dt > 0.0 or not dynamic
        if self._begun:
            self.bodies.begin(at, dt)
        try:
            trial = self._increments.find(
                self.system, self.state, self.u, loads, force, at,
                follow=follow and not dynamic,
                largest_force=self.accepted.largest_force,
                moving=dynamic and self._begun,
            )  # fmt: skip
        except NO_EQUILIBRIUM:
            self._fail()
            raise
        self.interfaces.move_fronts(trial.u)
        self._account.take(trial)
        if confirm:
            self.confirm(strict=strict)
        return trial.end

    def confirm(self, *, strict: bool | None = False) -> None:
        """Have the tangent of the trial where it counts, and the work along the increment.

        Collective.

        Args:
            strict: Refuse an increment whose energies do not balance to the tolerance, where they
                are known; else one that is off by more than a part of them that no equilibrium
                on the way could be, or none at all (``None``).

        Raises:
            EnergyImbalance: They do not; the accepted state is in force again.
            ConvergenceError: The equilibrium is unstable; likewise.
        """
        trial = self._account.at_hand
        try:
            self._increments.integrate(trial, self.system, exact=self.exact)
        except NotPositiveDefinite as error:
            self._fail()
            raise ConvergenceError(_UNSTABLE) from error
        if strict is not None and trial.iterations and self.bodies.accountable:
            overlap = self._overlap_work(trial.points[0][1], trial.end)
            part = self.newton.balance if strict else ANOTHER
            off = self.accepted.energy.imbalance(trial, len(self.loads), overlap, part)
            if off:
                self.revert()
                raise EnergyImbalance(off)

    def commit(self) -> None:
        """The last trial becomes the accepted state; collective."""
        trial = self._account.at_hand
        assert trial.work is not None
        self.accepted.take(trial, len(self.loads))
        self.state = trial.end
        self._account.accept()
        inertia = self.bodies.inertia
        if self._begun:
            self.bodies.commit()
        elif inertia is not None:
            self.bodies.set(self.u)
            self.bodies.begin_at()
        if trial.work.contact:
            assert inertia is not None
            inertia.add_loss(trial.work.contact)

    def revert(self) -> None:
        """Reject the last trial; collective."""
        try:
            self.restore_interfaces(self._before)
        except NotPositiveDefinite:
            # the tangent at hand is that of an unstable trial, which holds less than the accepted
            # state: nothing is freed until the tangent is that of the accepted state again
            self.system.hold(self.system.cholesky.free.copy())
            self._return()
            self.restore_interfaces(self._before)
        self._return()

    def _fail(self) -> None:
        self.counts.failures += 1
        self.revert()

    def _return(self) -> None:
        """Dense system and bodies at the accepted state again."""
        self._account.give_up()
        self._begin_again()
        tangent = self.tangent
        self.bodies.set(self.u)
        self.interfaces.move_fronts(self.u)
        tangent.revert()
        if not tangent.at_hand or (tangent.drift == np.inf and not self.bodies.constant):
            tangent.factor()
            tangent.accept()
        tangent.drift = min(tangent.drift, 1.0)
        residual = tangent.out_of_balance(self.state.loads)
        tangent.anchor(self.system, residual, self.state.jump, self.state.loads).destroy()
        residual.destroy()

    def _begin_again(self) -> None:
        """Take pressures and temperature of the accepted state."""
        if self._begun and not self.bodies.dynamic:
            self.bodies.begin(self.accepted.at, 0.0)

    # -- releases and new pairings -------------------------------------------------------

    def release(self, p: int, nodes: Ints, force: Array) -> tuple[float, float]:
        """Release nodes at constant load, in as many pieces as the iteration needs.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (n,).
            force: Given forces afterwards, shape (n_retained,).

        Returns:
            Energy released by the bond forces on their way, and external work.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
            ConvergenceError: No equilibrium without these bonds was found.
        """
        self.open(p, nodes)
        if self.bodies.dynamic:
            return 0.0, 0.0  # the force goes to zero over the next increment
        energy = work = 0.0
        begin = self.state.force

        def go(to: float, strict: bool) -> None:
            nonlocal energy, work
            target = force if to == 1.0 else begin + to * (force - begin)
            here = self.state
            end = self.move(here.loads, target, self.accepted.at, 0.0, strict=strict)
            more, out, _ = self.along(here, end)
            work, energy = work + more, energy + out
            self.book_contact(here, end)
            self.commit()

        in_pieces(go)
        return energy, work

    def settle(self, force: Array) -> tuple[float, float, Array] | None:
        """Find the equilibrium of a new pairing at constant loads, shape (n_retained,); collective.

        Contact forces move to the master points of the new pairing, and gaps that are not zero in
        it close. The work of the interfaces on the way, by Simpson's rule in elastic bodies and by
        the trapezoidal one in others, less what friction and bonds take, goes to :attr:`pairing`.
        With inertia all that happens in the next increment.

        Returns:
            What :meth:`along` does for the way there; ``None`` with inertia.
        """
        self.accepted.pairing.begin(self.nodal_forces(self.u))
        if self.bodies.dynamic:
            return None
        here = self.state
        self._solve(force)
        self.friction_energy += self._account.work_of(here, self.state).friction
        return self.along(here, self.state)

    # -- back to an accepted state -------------------------------------------------------

    def remember(self) -> NewtonState:
        """What :meth:`recall` needs: interfaces, pairing, displacement, state of the terms."""
        return self.accepted.remember(self.interface_state(), self.pairs)

    def recall(self, saved: NewtonState, *, retained: bool = True) -> None:
        """Return to an earlier accepted state; collective.

        Args:
            saved: The state.
            retained: Whether the retained jumps are still those of then.
        """
        self._account.give_up()
        here = self.accepted.recall(saved)
        same = retained and all(a is b for a, b in zip(saved.pairs, self.pairs, strict=True))
        if not (same and here):
            self.tangent.accept()  # that of a state which is rejected as well
            self.tangent.drift = np.inf
        if same:
            self.restore_interfaces(saved.interfaces)
        else:
            self._begin_again()
            self.pairs[:] = saved.pairs
            saved.interfaces.restore_bonds(self.fronts)
            self._retain(saved.interfaces)
        self._return()

    def undo(self, saved: NewtonState, rebases: int) -> None:
        """See :meth:`fxcrack.solvers.base.Solver.undo`."""
        retained = self.rebases == rebases
        self.recall(saved, retained=retained)
        self.rebases += not retained

    def collect(self) -> Arrays:
        """The accepted state as plain arrays; collective.

        Returns:
            What :meth:`InterfaceSolver.collect` gives; on rank 0 bodies.* of
            :meth:`WeakForm.state`; pairing.*[p] where faces slide far; sums, shape (6,); and the
            tangent, see :func:`~fxcrack.solvers.newton_state.tangent_arrays`.
        """
        out = super().collect() | self.accepted.arrays(self.interfaces)
        return out | tangent_arrays(self.tangent, self.system, self.face_loads)

    def resume(self, arrays: Arrays, time: float) -> None:
        """Take the state that :meth:`collect` gave; the next :meth:`prepare` carries it over.

        Collective.

        Args:
            arrays: By name, of the shapes that :meth:`collect` gave; the same on all ranks, of any
                number of ranks.
            time: Time of the state.

        Raises:
            InputError: The mesh has its cells in another order than when the state was saved.
        """
        drift = self.accepted.resume(arrays, self.interfaces, time)
        self.interfaces.move_fronts(self.u)
        super().resume(arrays, time)
        assert self._resumed is not None
        self._resumed_tangent = ResumedTangent.from_arrays(arrays, self._resumed.index, drift)

    # -- energies and fields -------------------------------------------------------------

    def along(self, here: Equilibrium, point: Equilibrium) -> tuple[float, float, Array]:
        """External work, energy released by bonds, mean jumps of the last trial.

        Args:
            here: Equilibrium at its beginning.
            point: Equilibrium at its end.

        Returns:
            Two energies, and the mean jumps, shape (n_retained,), length.
        """
        work = self._account.work_of(here, point)
        return work.external_work(len(self.loads)), work.bonds, work.jump

    def book_contact(self, here: Equilibrium, point: Equilibrium) -> None:
        """Add to their energies what friction and faces that overlap did in the last trial."""
        self.friction_energy += self._account.work_of(here, point).friction
        if not self.accepted.pairing.pending:
            self.overlap_energy += self._overlap_work(here, point)

    def _overlap_work(self, here: Equilibrium, point: Equilibrium) -> float:
        """Work of contact that pushed overlapping faces apart in the last trial."""
        if self.bodies.dynamic:
            return self._account.work_of(here, point).overlap
        return overlap_work(self.system, here, point)

    def stored(self, state: Equilibrium) -> dict[str, float]:
        """Energies stored in the bodies in the accepted state, by name; collective."""
        return self.accepted.energy.now()

    def spent(self) -> dict[str, float]:
        """Energies the bodies have turned into something else, by name; collective."""
        spent = self.bodies.spent()
        if self.interfaces.follow_sliding:
            spent["pairing_energy"] = self.accepted.pairing.energy
        return spent

    def extra_work(self, state: Equilibrium) -> float:
        """Work of loads that follow the bodies and of a temperature; collective."""
        return self.bodies.work()

    def displacement(self, state: Equilibrium | None = None) -> PETSc.Vec:
        """Displacement of a state; collective; the caller destroys it.

        Args:
            state: The accepted state (the default), the last trial, or one that the tangent
                predicts from the accepted state.
        """
        if state is None or state is self.state:
            return self.u.copy()
        trial = self._account.displacement_of(state)
        if trial is not None:
            return trial
        here = self.state
        out = self.tangent.displacement(state.jump - here.jump, state.loads - here.loads)
        out.axpy(1.0, self.u)
        return out

    def displacement_of_jumps(self, jump: Array) -> PETSc.Vec:
        """Change of displacement by a change of retained jumps, shape (n_retained,); collective.

        By the tangent, loads as they are; the caller destroys it.
        """
        return self.tangent.displacement(jump, np.zeros(self.n_loads))

    def nodal_forces(self, u: PETSc.Vec, state: Equilibrium | None = None) -> PETSc.Vec:
        """Forces of interfaces and supports on the bodies; the caller destroys them."""
        return self.tangent.out_of_balance((self.state if state is None else state).loads)

    def destroy(self) -> None:
        """Free all PETSc objects; collective."""
        self._account.give_up()
        self.accepted.pairing.forget()
        self._increments.destroy()
        self.tangent.destroy()


__all__ = ["NewtonSolver"]
