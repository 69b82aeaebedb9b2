"""Displacement and velocity of the bodies in explicit dynamics, and those of interface nodes.

Every rank moves all interface nodes and the dofs that it owns. Among the latter those of interface
nodes are put right only where somebody looks: in most increments nobody does.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.solvers.explicit_interface import InterfaceDynamics
from fxcrack.solvers.explicit_points import FacePoints
from fxcrack.solvers.explicit_state import InterfaceSnapshot


class Kinematics:
    """Displacement and velocity of the owned dofs, beside those that the interfaces have.

    Args:
        continuum: Displacement space.
        bodies: Internal forces, with the displacement.
        points: Unknowns of nodes that are not displacement and change of the director.
        dynamics: Motion of the interface nodes, which takes the velocity.
        velocity: Of the owned dofs at the start, shape (n_local,), length/time; kept.

    Attributes:
        u: Displacement of the owned dofs, part of that of the bodies, shape (n_local,), length.
        v: Their velocity in the middle of the last increment, up to date within the bodies; see
            :attr:`velocity`.
        at_interface: Owned dofs of interface nodes, shape (n,).
        whole: Whether :attr:`v` is up to date at interface nodes as well.
    """

    def __init__(
        self, continuum: Continuum, bodies: InternalForces, points: FacePoints,
        dynamics: InterfaceDynamics, velocity: Array,
    ) -> None:  # fmt: skip
        nodes = dynamics.lumped.nodes
        self._x, self._points, self._dynamics, self._nodes = bodies.u.x, points, dynamics, nodes
        self._gdim = continuum.gdim
        self.u = self._x.array[: continuum.n_local]
        self.v = velocity
        self.whole = True
        layout = continuum.layout
        self.at_interface: Ints = layout.dof(nodes.local[:, None], np.arange(self._gdim)).ravel()
        dynamics.v = self.at_nodes(velocity)

    @property
    def velocity(self) -> Array:
        """In the middle of the last increment, owned dofs, shape (n_local,), length/time."""
        if not self.whole:
            self.take_velocity()
        self.whole = True
        return self.v

    def at_nodes(self, owned: Array) -> Array:
        """A motion at the points of the interface nodes, shape (n_nodes, gdim); collective."""
        return self._nodes.gather(owned)[:, : self._gdim]

    def take_velocity(self) -> None:
        """Put the velocity of interface nodes right."""
        if len(self.at_interface):
            self.v[self.at_interface] = self._dynamics.v[self._nodes.mine].ravel()

    def take_displacement(self) -> None:
        """Put the displacement of interface nodes right, to the last digit that of a tie."""
        if len(self.at_interface):
            self.u[self.at_interface] = self._dynamics.u[self._nodes.mine].ravel()

    def set_displacement(self, owned: Array) -> None:
        """Begin with displacement and change of directors, shape (n_local,), length; collective."""
        self.u[:] = self._points.motion(owned)
        self._x.scatter_forward()

    def begin(self, coordinates: Array) -> None:
        """Let the interface nodes begin where the bodies are; collective.

        Args:
            coordinates: Of the support columns, those of references last, shape (n_columns,).
        """
        self._dynamics.u = self.at_nodes(self.u)
        self._dynamics.begin(coordinates)
        self.take_displacement()
        self.take_velocity()
        self._x.scatter_forward()

    def restore(self, u: Array, v: Array, interfaces: InterfaceSnapshot) -> None:
        """Return to an earlier motion, shape (n_local,) each; collective."""
        self.u[:] = u
        self._x.scatter_forward()
        self.velocity[:] = v
        self._dynamics.u = self.at_nodes(self.u)
        self._dynamics.v = self.at_nodes(self.v)
        interfaces.restore(self._dynamics)


__all__ = ["Kinematics"]
