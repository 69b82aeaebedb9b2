"""Energies of bodies in explicit dynamics, in the middle of increments.

    T = 1/2 v . M v,    U = 1/2 u^n . f_int(u^{n+1})

of linear bodies; of nonlinear ones U is the mean of the energies stored at both ends, less
dt/4 v . (f_int(u^{n+1}) - f_int(u^n)). Where energies depend on the states passed, only those of
the end can be told: U is what is stored there, less dt/2 v . f_int(u^{n+1}).
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fxcrack.base.arrays import Array
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.solvers.explicit_bodies import BodyMotion
from fxcrack.solvers.explicit_further import FurtherForces
from fxcrack.solvers.explicit_mass import ScaledMass


def sums_over_ranks(comm: MPI.Intracomm, *parts: float) -> list[float]:
    """Sums of numbers that each rank has a part of; collective."""
    values = np.array(parts, dtype=float)  # bincount of nothing gives integers
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, values)
    return [float(x) for x in values]


Totals = tuple[float, float, float, float, float, float]


class MotionEnergies:
    """Energies that went in and out so far; every rank holds its part of the first three.

    Args:
        comm: Communicator of the bodies.

    Attributes:
        work: Of supports and loads.
        damped: Dissipated by damping.
        viscous: Dissipated by bulk viscosity.
        is_viscous: Whether there is or was any.
        initial: Stored at the start, that of all ranks.
        renewed: Gone with changes of the increment, that of all ranks: energies belong to the
            middle of increments, which a change of dt moves.
        heated: What the temperature of linear bodies took off 1/2 u K u at the start.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self._comm = comm
        self.work = self.damped = self.viscous = self.initial = self.renewed = self.heated = 0.0
        self.is_viscous = False

    def take_further(self, forces: FurtherForces, motion: Array, h: float) -> float:
        """Count what bulk viscosity dissipates; the power of pressures, of this rank.

        Args:
            forces: Forces of the increment.
            motion: Sum of the velocities before and after, owned dofs, shape (n_local,).
            h: Time between both.
        """
        if forces.viscous is not None:
            self.viscous -= 0.5 * h * float(forces.viscous @ motion)
        return 0.0 if forces.pressures is None else float(forces.pressures @ motion)

    def take_change(self, gone: float, *, first: bool) -> None:
        """Count the energy that a change of the increment moves out of the middle of increments.

        Args:
            gone: The energy, that of all ranks.
            first: Whether it is the first increment, which begins at half its length.
        """
        if first:
            self.initial += gone
        else:
            self.renewed -= gone

    def totals(self) -> Totals:
        """Work, damping, viscosity, energy at the start, gone with dt, of heat; collective."""
        work, damped, viscous = sums_over_ranks(self._comm, self.work, self.damped, self.viscous)
        return work, damped, viscous, self.initial, self.renewed, self.heated

    def restore(self, totals: Totals) -> None:
        """Take what :meth:`totals` gave."""
        mine = float(self._comm.rank == 0)
        self.work, self.damped, self.viscous = (mine * x for x in totals[:3])
        self.initial, self.renewed, self.heated = totals[3:]
        self.is_viscous |= totals[2] != 0.0


def stored_energies(
    bodies: InternalForces, motion: BodyMotion, mass: ScaledMass, velocity: Array, dt: float
) -> dict[str, float]:
    """Strain and kinetic energy in the middle of the last increment, by name; collective.

    Args:
        bodies: The bodies at its end.
        motion: Their internal forces.
        mass: Their mass; what scaling has added to it has an entry of its own.
        velocity: Velocity in its middle, owned dofs, shape (n_local,), length/time.
        dt: Its length, time; 0 before the first one.
    """
    comm, n = bodies.continuum.comm, len(velocity)
    square = velocity * velocity
    kinetic, added = 0.5 * float(mass.values @ square), mass.added_energy(velocity)
    now = bodies.u.x.array[:n].copy()
    if bodies.linear:
        strain = 0.5 * float((now - dt * velocity) @ motion.whole())
    else:
        strain = 0.0
        force = bodies.forces().copy()
        energy = bodies.stored()
        if dt > 0.0 and bodies.path_dependent:
            strain = -0.5 * dt * float(force @ velocity)
        elif dt > 0.0:
            bodies.u.x.array[:n] = now - dt * velocity
            bodies.u.x.scatter_forward()
            energy = 0.5 * (energy + bodies.stored())
            strain = -0.25 * dt * float((force - bodies.forces()) @ velocity)
            bodies.u.x.array[:n] = now
            bodies.u.x.scatter_forward()
        strain += energy / comm.size
    strain, kinetic, added = sums_over_ranks(comm, strain, kinetic, added)
    out = {"strain_energy": strain, "kinetic_energy": kinetic}
    if mass.is_scaled:
        out["mass_scaling_energy"] = added
    return out


__all__ = ["MotionEnergies", "stored_energies", "sums_over_ranks"]
