"""Where energy is and where it has gone in explicit dynamics, by the names of the history."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.interface.pair import Pair
from fxcrack.solvers.explicit_bodies import BodyMotion
from fxcrack.solvers.explicit_energies import MotionEnergies, stored_energies, sums_over_ranks
from fxcrack.solvers.explicit_interface import InterfaceDynamics
from fxcrack.solvers.explicit_loads import LoadsAndMonitors
from fxcrack.solvers.explicit_mass import ScaledMass


class EnergyAccounts:
    """Energies that are stored, those that have left the bodies, and the work done on them.

    Args:
        bodies: Internal forces, with the displacement.
        motion: What they do to the motion.
        mass: Mass of the bodies.
        dynamics: Interfaces.
        loads: Loads, those of the temperature among them.
        pairs: Interfaces, which may have contact and friction.
        sums: What went in and out so far.
        damped: Whether bodies have damping by mass.
    """

    def __init__(
        self, bodies: InternalForces, motion: BodyMotion, mass: ScaledMass,
        dynamics: InterfaceDynamics, loads: LoadsAndMonitors, pairs: Sequence[Pair],
        sums: MotionEnergies, *, damped: bool,
    ) -> None:  # fmt: skip
        self._bodies, self._motion, self._mass = bodies, motion, mass
        self._dynamics, self._loads, self._sums = dynamics, loads, sums
        self._damped = damped
        self._contact = any(pair.interface.contact for pair in pairs)
        self._friction = any(pair.interface.friction is not None for pair in pairs)
        self._elastic = bool(dynamics.elastic.local.any())

    def stored(self, velocity: Array, dt: float, factors: Array) -> dict[str, float]:
        """Energies stored in the middle of the last increment, by name; collective.

        Args:
            velocity: There, owned dofs, shape (n_local,), length/time.
            dt: Its length, time; 0 before the first one.
            factors: Load factors there, shape (n_forces,).
        """
        out = stored_energies(self._bodies, self._motion, self._mass, velocity, dt)
        dynamics = self._dynamics
        out["kinetic_energy"] += dynamics.lumped.excess_energy(dynamics.v)
        out["strain_energy"] -= self.thermal_part(velocity, dt, factors)
        if self._elastic:
            out["bond_energy"] = dynamics.stored()
        return out

    def thermal_part(self, velocity: Array, dt: float, factors: Array) -> float:
        """What the temperature of linear bodies takes off 1/2 u K u to give what is stored.

        In the middle of the last increment, arguments as for :meth:`stored`; collective.
        """
        if not self._loads.n_thermal:
            return 0.0
        u = self._bodies.u.x.array[: len(velocity)] - 0.5 * dt * velocity
        comm = self._bodies.continuum.comm
        answers = sums_over_ranks(comm, *self._loads.conjugates(u))
        return self._loads.thermal_part(factors, np.array(answers))

    def take_change(
        self, longer: float, internal: Array, more: Array, elastic: tuple[Array, Array] | None,
        *, first: bool,
    ) -> None:  # fmt: skip
        """Account for a change of the increment, with which the middle of increments moves.

        U of linear bodies is u^n . f_int(u^{n+1})/2, that of elastic bonds likewise; the work of
        f_int in the increment is the change of U less (dt - last dt)/4 f_int . more. Collective.

        Args:
            longer: The increment less the last one, time.
            internal: Internal forces at its start, owned dofs, shape (n_local,).
            more: Change of the velocity, same shape, length/time.
            elastic: Where bonds have a stiffness, velocity of the interface nodes before the
                increment and jumps of the open rows at its start.
            first: Whether it is the first increment of all.
        """
        change, dynamics = 0.25 * longer, self._dynamics
        comm = self._bodies.continuum.comm
        gone = sums_over_ranks(comm, change * float(internal @ more))[0]
        if elastic is not None:
            before, gap = elastic
            pull = dynamics.elastic.forces(gap)
            jumps = dynamics.lumped.jumps(dynamics.v - before)
            gone -= change * float(np.vdot(pull, jumps))
        self._sums.take_change(gone, first=first)

    def spent(self) -> dict[str, float]:
        """Energies that have left the bodies, by name; collective."""
        gone, sums = self._dynamics.energies, self._sums
        out = {"released_energy": gone.bonds}
        if self._contact:
            out["contact_energy"] = gone.contact
        if self._friction:
            out["friction_energy"] = gone.friction
        if not self._dynamics.lumped.simple:
            out["tie_energy"] = gone.ties
        if sums.renewed:
            out["dt_energy"] = sums.renewed
        if self._damped:
            out["damping_energy"] = sums.totals()[1]
        if sums.is_viscous:
            out["viscous_energy"] = sums.totals()[2]
        return out | self._bodies.spent()

    def external_work(self, velocity: Array, dt: float, factors: Array) -> float:
        """Work of supports, loads and temperature up to the middle of the last increment.

        Arguments as for :meth:`stored`; collective.
        """
        heat = self._sums.heated - self.thermal_part(velocity, dt, factors)
        return self._sums.totals()[0] + heat + self._bodies.work()


__all__ = ["EnergyAccounts"]
