"""Mass of the dofs in explicit dynamics, and what mass scaling adds to it."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.solvers.options import ExplicitOptions


class ScaledMass:
    """Mass of the owned dofs.

    Args:
        bare: Lumped mass of the bodies, shape (n_local,), mass.

    Attributes:
        values: Present mass, shape (n_local,).
        inverse: One over it, shape (n_local,).
        added: What mass scaling has added, shape (n_local,).
        is_scaled: Whether mass scaling has been at work.
    """

    def __init__(self, bare: Array) -> None:
        self._bare = bare
        self.values, self.added = bare.copy(), np.zeros(len(bare))
        self.inverse = 1.0 / self.values
        self.is_scaled = False

    def choose(self, options: ExplicitOptions, bodies: InternalForces) -> bool:
        """Scale the mass as a step asks for; collective.

        Args:
            options: Controls of the step.
            bodies: The bodies, their operator chosen.

        Returns:
            Whether the mass may be another one now.
        """
        if isinstance(options.mass_scale, str):
            assert options.dt is not None
            mass = self._enough_for(options.dt, bodies)
        elif options.mass_scale != 1.0 or self.is_scaled:
            mass = options.mass_scale * self._bare
        else:
            return False
        self.values, self.added, self.is_scaled = mass, mass - self._bare, True
        self.inverse = 1.0 / mass
        return True

    def _enough_for(self, dt: float, bodies: InternalForces) -> Array:
        """Masses for which an increment is stable, shape (n_local,); collective.

        Nodes get as much as Gershgorin's circles ask for, sum_j |K_ij|/m_i <= (2/dt)^2, which is
        more than needed but leaves all other nodes alone.
        """
        layout = bodies.continuum.layout
        sums = np.asarray(abs(bodies.stiffness()).sum(axis=1)).ravel()
        by_node = layout.by_node(sums).max(axis=1)
        needed = np.repeat(0.25 * (1.0 + 1e-9) * dt**2 * by_node, bodies.continuum.gdim)
        return np.maximum(self._bare, needed)


__all__ = ["ScaledMass"]
