"""The stable increment of a step of explicit dynamics, and what limits it.

Bodies, bonds with a stiffness of their own and bulk viscosity do; exact bonds and contact do not.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.continuum.bulk_viscosity import BulkViscosity
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.solvers.explicit_further import FurtherForces
from fxcrack.solvers.explicit_interface import InterfaceDynamics
from fxcrack.solvers.options import ExplicitOptions
from fxcrack.solvers.stable_increment import (
    STEPS,
    HighestFrequency,
    damped_increment,
    rounded_down,
    start_vector,
)

_AGAIN = 6
"""Lanczos steps that follow a tangent which has changed little."""


class Stability:
    """Finds the largest stable increment.

    Args:
        bodies: The bodies.
        dynamics: Their interfaces.
        further: Where the bulk viscosity of a step is put.
        at_interface: Owned dofs of the interface nodes of this rank, shape (n,).
    """

    def __init__(
        self, bodies: InternalForces, dynamics: InterfaceDynamics, further: FurtherForces,
        at_interface: Ints,
    ) -> None:  # fmt: skip
        self._bodies, self._dynamics, self._further = bodies, dynamics, further
        self._at_interface = at_interface

    def take_viscosity(self, options: ExplicitOptions, effect: Inertia) -> bool:
        """Make the bulk viscosity that a step asks for; whether there is any; collective.

        Args:
            options: Controls of the step.
            effect: Density of the bodies.

        Raises:
            InputError: The bodies are not made for it.
        """
        linear, quadratic = options.bulk
        self._further.viscosity = None
        if not (linear or quadratic):
            return False
        continuum = self._bodies.continuum
        shells = isinstance(continuum, ShellBodies) or continuum.shell_cells
        if self._bodies.finite or shells:
            raise InputError(
                "Explicit: bulk viscosity is for solids of small strain: the volume change it "
                "counts is that of small rotations; leave bulk out"
            )
        self._further.viscosity = BulkViscosity(continuum, effect, linear, quadratic)
        return True

    @property
    def changes(self) -> bool:
        """Whether the stable increment changes as bodies move."""
        viscosity = self._further.viscosity
        return self._bodies.finite or (viscosity is not None and viscosity.changes)

    def find(self, mass: Array, velocity: Array) -> float:
        """The largest stable increment, time; collective.

        Args:
            mass: Of the owned dofs, shape (n_local,).
            velocity: Of the owned dofs, shape (n_local,), which bulk viscosity depends on.
        """
        continuum = self._bodies.continuum
        places = continuum.positions()[: continuum.layout.n_owned]
        start = start_vector(places, continuum.layout.n_unknowns)
        self._highest = HighestFrequency(continuum.comm, mass, start)
        self._damping = HighestFrequency(continuum.comm, mass, start)
        return self._by(STEPS, velocity)

    def again(self, velocity: Array) -> float:
        """The same with the present tangent and velocity, by a few more steps; collective."""
        return self._by(_AGAIN, velocity)

    def _by(self, steps: int, velocity: Array) -> float:
        omega, viscosity = self._highest(self._tangent_product, steps), self._further.viscosity
        rate = 0.0
        if viscosity is not None:
            viscosity.forces(velocity)
            rate = self._damping(viscosity.product, steps) ** 2
        return rounded_down(damped_increment(omega, rate))

    def _tangent_product(self, direction: Array) -> Array:
        """Tangent of bodies and elastic bonds times a direction, owned dofs; collective."""
        out = self._bodies.tangent_product(direction)
        elastic, lumped = self._dynamics.elastic, self._dynamics.lumped
        if elastic.exist:
            jumps = lumped.jumps(lumped.nodes.gather(direction))
            forces = lumped.on_nodes(elastic.forces(jumps))
            out[self._at_interface] -= forces[lumped.nodes.mine].ravel()
        return np.asarray(out)


__all__ = ["Stability"]
