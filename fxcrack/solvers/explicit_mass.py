"""Mass of the dofs in explicit dynamics, and what mass scaling adds to it."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.continuum.lumped_mass import lumped_mass
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.shell_mass import shell_mass
from fxcrack.solvers.explicit_points import FacePoints
from fxcrack.solvers.options import ExplicitOptions


class ScaledMass:
    """Mass of the owned dofs.

    Args:
        bare: Lumped mass of the bodies, shape (n_local,), mass.
        enlarged: What of it was added to the inertia of the directors of shells, same shape.
        height: Height of the mass of the owned nodes of shells above their reference surface, shape
            (n_nodes,), length.

    Attributes:
        values: Present mass, shape (n_local,).
        inverse: One over it, shape (n_local,).
        added: What mass scaling has added, and to directors, shape (n_local,).
        is_scaled: Whether there is any of it.
        height: As above.
    """

    def __init__(
        self, bare: Array, enlarged: Array | None = None, height: Array | None = None
    ) -> None:
        self.height = np.zeros(0) if height is None else height
        self._bare, self._enlarged = bare, np.zeros(len(bare)) if enlarged is None else enlarged
        self.values, self.added = bare.copy(), self._enlarged.copy()
        self.inverse = 1.0 / self.values
        self.is_scaled = enlarged is not None
        self._chosen = False
        self._points: FacePoints | None = None

    def take_points(self, points: FacePoints) -> None:
        """Take the unknowns of nodes of shells; :attr:`added` stays on u and w."""
        self._points = points if points.exist else None
        self.values = points.masses(self._bare).copy()
        self.inverse = 1.0 / self.values

    def added_energy(self, velocity: Array) -> float:
        """Kinetic energy of what was added, this rank's part, at a velocity, shape (n_local,)."""
        v = velocity if self._points is None else self._points.nodal(velocity)
        return 0.5 * float(self.added @ (v * v))

    @classmethod
    def of(cls, continuum: Continuum, effect: Inertia) -> ScaledMass:
        """Mass of bodies; collective.

        Args:
            continuum: Solids or shells of first order.
            effect: Their density.

        Raises:
            InputError: A part has no density, or elements have no lumped mass.
        """
        if isinstance(continuum, ShellBodies):
            return cls(*shell_mass(continuum, effect))
        return cls(lumped_mass(continuum, effect))

    def director_factor(self, continuum: Continuum) -> float:
        """Inertia of all directors over what it is without the addition; 1 in solids; collective.

        Args:
            continuum: The bodies.
        """
        added, bare = (
            float(continuum.layout.by_node(m)[:, continuum.gdim :].sum())
            for m in (self._enlarged, self._bare)
        )
        added, bare = continuum.comm.allreduce(added), continuum.comm.allreduce(bare)
        return bare / (bare - added) if added else 1.0

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
            if self._points is not None:
                raise InputError(
                    "Explicit: mass_scale='dt' is not available beside interfaces of shells and "
                    "with sections whose mass lies off the mesh; give a number, which scales the "
                    "mass of all bodies"
                )
            mass = self._enough_for(options.dt, bodies)
        elif options.mass_scale != 1.0 or self._chosen:
            mass = options.mass_scale * self._bare
        else:
            return False
        self.values, self.added = mass, mass - self._bare + self._enlarged
        self.is_scaled = self._chosen = True
        if self._points is not None:
            self.values = self._points.masses(mass)
        self.inverse = 1.0 / self.values
        return True

    def _enough_for(self, dt: float, bodies: InternalForces) -> Array:
        """Masses for which an increment is stable, shape (n_local,); collective.

        Nodes get as much as Gershgorin's circles ask for, sum_j |K_ij|/m_i <= (2/dt)^2, which is
        more than needed but leaves all other nodes alone.
        """
        continuum = bodies.continuum
        layout, stiffness = continuum.layout, abs(bodies.stiffness())
        scale = np.ones(layout.n_unknowns)
        scale[continuum.gdim :] = self._per_length(continuum)
        sums = np.asarray(stiffness @ np.tile(scale, stiffness.shape[1] // len(scale)))
        by_node = layout.by_node(sums) / scale
        for unknowns in (slice(0, continuum.gdim), slice(continuum.gdim, None)):
            by_node[:, unknowns] = by_node[:, unknowns].max(axis=1, keepdims=True, initial=0.0)
        return np.maximum(self._bare, (0.25 * (1.0 + 1e-9) * dt**2 * by_node).ravel())

    def _per_length(self, continuum: Continuum) -> float:
        """Directors over displacements of equal inertia, 1/length; collective.

        Gershgorin's circles hold for unknowns of any scale; those of directors are of another unit.
        """
        by_node = continuum.layout.by_node(self._bare)
        parts = [float(by_node[:, c].sum()) for c in (0, -1)]
        mass, inertia = (continuum.comm.allreduce(p) for p in parts)
        return float(np.sqrt(mass / inertia))


__all__ = ["ScaledMass"]
