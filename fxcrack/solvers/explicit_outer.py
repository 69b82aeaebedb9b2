"""Forces on the bodies in explicit dynamics beside the internal ones and those of interfaces.

Loads, pressures that follow, bulk viscosity and damping by mass: their forces at the chosen dofs of
:class:`fxcrack.solvers.explicit_bodies.BodyMotion`, what they do to the velocity elsewhere, and
their work with the mean velocity of an increment.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.solvers.explicit_energies import MotionEnergies
from fxcrack.solvers.explicit_further import FurtherForces
from fxcrack.solvers.explicit_loads import LoadsAndMonitors
from fxcrack.solvers.explicit_mass import ScaledMass


class OuterForces:
    """Loads, following pressures, bulk viscosity and damping by mass.

    Args:
        loads: Loads and monitored displacements.
        further: Forces that are assembled anew in each increment.
        mass: Mass of the owned dofs.
        damping: Damping over mass, 1/time.
        chosen: Owned dofs whose forces are wanted, shape (n_chosen,).
        energies: Takes what damping and viscosity dissipate.

    Attributes:
        factors: Load factors of the present increment, shape (n_forces,).
        damping: As above.
    """

    def __init__(
        self, loads: LoadsAndMonitors, further: FurtherForces, mass: ScaledMass, damping: float,
        chosen: Ints, energies: MotionEnergies,
    ) -> None:  # fmt: skip
        self._loads, self._further, self._mass = loads, further, mass
        self.damping, self._chosen, self._energies = damping, chosen, energies
        self._found: Array | None = None
        self.factors = np.zeros(loads.n_loads)
        self._before: Array | None = None

    def prepare(self) -> None:
        """Take masses that may have changed."""
        self._loads.divide(self._chosen, self._mass.inverse)

    @property
    def exist(self) -> bool:
        """Whether there are any."""
        return bool(self._loads.n_loads) or self.damping > 0.0 or self._further.exist

    @property
    def needs_velocity(self) -> bool:
        """Whether forces depend on the velocity."""
        return self.damping > 0.0 or self._further.exist

    @property
    def mean_factors(self) -> Array:
        """Load factors in the middle of the last increment, shape (n_forces,)."""
        before = self.factors if self._before is None else self._before
        return np.asarray(0.5 * (before + self.factors))

    def begin(self, forces: Array, at: float, velocity: Array) -> None:
        """Add the forces at the chosen dofs, in place; collective.

        Args:
            forces: At the chosen dofs, shape (n_chosen,).
            at: Time.
            velocity: In the middle of the last increment, owned dofs, shape (n_local,).
        """
        self._loads.add_at_chosen(forces, self.factors)
        self._found = None
        if self._further.exist:
            self._found = self._further.find(at, velocity)
            forces += self._found[self._chosen]
        if self.damping:
            at_chosen = self._chosen
            forces -= self.damping * self._mass.values[at_chosen] * velocity[at_chosen]

    def damp(self, velocity: Array, h: float) -> None:
        """Change the velocity of the owned dofs by damping, in place; before other forces do."""
        if self.damping:
            velocity *= 1.0 - h * self.damping

    def push(self, velocity: Array, h: float) -> None:
        """Change the velocity at all dofs but the chosen ones by the other forces, in place."""
        self._loads.add_elsewhere(velocity, self.factors, h)
        if self._found is not None:
            velocity += h * self._mass.inverse * self._found

    def power(self, before: Array, after: Array, h: float) -> float:
        """Twice the mean power of external forces, this rank's part; what dissipates is counted.

        Args:
            before: Velocity in the middle of the last increment, owned dofs, shape (n_local,).
            after: In the middle of this one, same shape.
            h: Time between both.
        """
        out, energies = 0.0, self._energies
        if self._loads.n_loads:
            out += self._loads.power(self.factors, before)
            out += self._loads.power(self.factors, after)
        if self._found is not None:
            out += energies.take_further(self._further, before + after, h)
        if self.damping:
            rate = 0.5 * h * self.damping
            energies.damped += rate * float((before * self._mass.values) @ (before + after))
        return out

    def end(self) -> None:
        """The increment is over: the present factors are those before."""
        self._before = self.factors

    def forget(self) -> None:
        """The state is another one, whose loads before are not known."""
        self._before = None


__all__ = ["OuterForces"]
