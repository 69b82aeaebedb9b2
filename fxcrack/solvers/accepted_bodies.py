"""Nonlinear bodies in the accepted state: where they are, what they store, what they may owe."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from fxcrack.continuum.weak_form import WeakForm
from fxcrack.equilibrium.interface_state import Arrays, InterfaceState
from fxcrack.interface.pair import Pair
from fxcrack.solvers.deformed_interfaces import DeformedInterfaces
from fxcrack.solvers.increment_balance import StoredEnergy
from fxcrack.solvers.increment_work import TrialIncrement
from fxcrack.solvers.new_pairings import PairingEnergy
from fxcrack.solvers.newton_state import NewtonState, Sums, body_arrays, restore_bodies
from fxcrack.solvers.tangent import CondensedTangent


class AcceptedBodies:
    """The accepted state of bodies; trials are measured from it and return to it.

    Args:
        bodies: The form terms.
        tangent: Their condensed tangent.

    Attributes:
        u: Displacement, owned dofs.
        at: Time.
        largest_force: Largest norm of the internal forces of an accepted state, force.
        energy_noise: Work that the round-off of the bodies' forces may have done in an accepted
            state at most, force times length.
        energy: What is stored.
        pairing: Energy that new pairings of faces that slide have taken.
    """

    def __init__(self, bodies: WeakForm, tangent: CondensedTangent) -> None:
        self._bodies, self._tangent = bodies, tangent
        continuum = bodies.continuum
        size = continuum.n_local, continuum.n_global
        self.u = PETSc.Vec().createMPI(size, comm=continuum.comm)
        self.at = 0.0
        self.largest_force = self.energy_noise = 0.0
        self.energy = StoredEnergy(bodies)
        self.pairing = PairingEnergy()

    def take(self, trial: TrialIncrement, n_forces: int) -> None:
        """A trial becomes the accepted state; collective.

        Args:
            trial: The trial, its work known; the bodies are in its state.
            n_forces: Number of force patterns.
        """
        assert trial.work is not None
        step, tangent = self.u.copy(), self._tangent
        step.aypx(-1.0, trial.u)
        trial.u.copy(self.u)
        self.at = trial.at
        self.largest_force = max(self.largest_force, tangent.force_scale)
        noise = tangent.round_off * float(self.u.norm())
        self.energy_noise = max(self.energy_noise, noise)
        tangent.drift = trial.drift
        tangent.accept()
        self.energy.accept(trial.energies)
        self.pairing.book(
            self._bodies, self.u, step, trial.work, n_forces,
            lambda: tangent.out_of_balance(trial.end.loads),
        )  # fmt: skip
        step.destroy()

    def remember(self, interfaces: InterfaceState, pairs: list[Pair]) -> NewtonState:
        """What :meth:`recall` needs, with the state of the interfaces and their pairing."""
        return NewtonState(
            interfaces,
            list(pairs),
            self.u.array.copy(),
            [term.state() for term in self._bodies.terms],
            self.at,
            self.pairing.energy,
        )

    def recall(self, saved: NewtonState) -> bool:
        """Return to an earlier accepted state, pending new pairings forgotten; collective.

        Returns:
            Whether the displacement is the same; the tangent at hand is that of another one else.
        """
        self.energy.forget()
        self.pairing.forget()
        self.pairing.energy = saved.pairing_energy
        same = np.array_equal(self.u.array_r, saved.u)
        self.u.array[:] = saved.u
        self.at = saved.at
        for term, kept in zip(self._bodies.terms, saved.terms, strict=True):
            term.restore(kept)
        return bool(min(self._bodies.continuum.comm.allgather(same)))

    def arrays(self, interfaces: DeformedInterfaces) -> Arrays:
        """Plain arrays, see :func:`~fxcrack.solvers.newton_state.body_arrays`; collective."""
        energy = self.energy
        sums = Sums(
            self.pairing.energy, self.largest_force, energy.largest, self._tangent.drift,
            energy.most, self.energy_noise,
        )  # fmt: skip
        return body_arrays(self._bodies, interfaces, sums)

    def resume(self, arrays: Arrays, interfaces: DeformedInterfaces, time: float) -> float:
        """Take the state that :meth:`arrays` gave on any number of ranks; collective.

        Args:
            arrays: By name, of the shapes that :meth:`arrays` gave; the same on all ranks.
            interfaces: The interfaces, whose pairing is taken as well.
            time: Time of the state.

        Returns:
            Drift of the tangent.

        Raises:
            InputError: The mesh has its cells in another order than when the state was saved.
        """
        sums = restore_bodies(arrays, self._bodies, interfaces, time)
        self.u.array[:] = self._bodies.u.x.array[: self._bodies.continuum.n_local]
        self.at = time
        self.pairing.energy, self.largest_force = sums.pairing_energy, sums.largest_force
        self.energy.largest, self.energy.most = sums.largest_energy, sums.most_energy
        self.energy_noise = sums.energy_noise
        return sums.drift


__all__ = ["AcceptedBodies"]
