"""The stable increment of a step of explicit dynamics, and what limits it.

Bodies, bonds with a stiffness of their own and bulk viscosity do; exact bonds and contact do not.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

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

_DAMPED = 0.01
"""Change of the damping by quadratic bulk viscosity, over critical, that is looked at."""
_AGAIN = 6
"""Lanczos steps that follow a tangent which has changed little."""


class Stability:
    """Finds the largest stable increment.

    Args:
        bodies: The bodies.
        dynamics: Their interfaces.
        further: Where the bulk viscosity of a step is put.
        at_interface: Owned dofs of the interface nodes of this rank, shape (n,).

    Attributes:
        looked: Displacement at the last look, owned dofs, shape (n_local,), length.
        compressed: Damping over critical by quadratic bulk viscosity at the last look, about.
    """

    def __init__(
        self, bodies: InternalForces, dynamics: InterfaceDynamics, further: FurtherForces,
        at_interface: Ints,
    ) -> None:  # fmt: skip
        self._bodies, self._dynamics, self._further = bodies, dynamics, further
        self._at_interface = at_interface
        self.looked = np.zeros(0)
        self.compressed = 0.0
        self._known: tuple[Array, float, Array] | None = None
        self._edges: tuple[Ints, Ints, Array] | None = None
        self._edges_then = np.zeros(0)

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
        self._damping = HighestFrequency(continuum.comm, mass, start)
        known, self._known = self._known, None
        if known is not None:
            self._highest = HighestFrequency(continuum.comm, mass, known[0])
            self._damping = HighestFrequency(continuum.comm, mass, known[2])
            return known[1]
        self._highest = HighestFrequency(continuum.comm, mass, start)
        return self._by(STEPS, velocity)

    @property
    def highest(self) -> Array:
        """The vector that the highest mode is seen in, owned dofs, shape (n_local,)."""
        return self._highest.vector

    @property
    def most_damped(self) -> Array:
        """The vector that the most damped mode is seen in, owned dofs, shape (n_local,)."""
        return self._damping.vector

    def again(self, velocity: Array) -> float:
        """The same with the present tangent and velocity, by a few more steps; collective."""
        return self._by(_AGAIN, velocity)

    def restore(
        self, highest: Array, stable: float, looked: Array, damped: Array, compressed: float
    ) -> None:
        """Take a look before a checkpoint, which the next :meth:`find` gives again; collective.

        Args:
            highest: As :attr:`highest`.
            stable: What it found, time.
            looked: As :attr:`looked`.
            damped: As :attr:`most_damped`.
            compressed: As :attr:`compressed`.
        """
        self._known, self.compressed = (highest, stable, damped), compressed
        if not self._bodies.finite:
            return
        x = self._bodies.u.x
        now = x.array.copy()
        x.array[: len(looked)] = looked
        x.scatter_forward()
        self._look()
        x.array[:] = now

    def _look(self) -> None:
        self.looked = self._bodies.u.x.array[: self._bodies.continuum.n_local].copy()
        self._edges_then = self._edges_now()

    def strained(self) -> float:
        """Largest change of an edge since the last look, over its undeformed length; collective.

        Edges lead from the first node of each cell to the others.
        """
        change = self._edges_now() - self._edges_then
        largest = float(np.sqrt((change**2).sum(axis=1).max(initial=0.0)))
        return float(self._bodies.continuum.comm.allreduce(largest, op=MPI.MAX))

    def damping_changed(self, velocity: Array, dt: float, *, fallen: bool) -> bool:
        """Whether quadratic bulk viscosity damps otherwise than at the last look; collective.

        Cells that are compressed at the rate e are damped as by a linear viscosity of b2^2 e L/c,
        with L/c about the increment. Of bodies that move slowly the range of the velocity shows
        that e is small.

        Args:
            velocity: Of the owned dofs, shape (n_local,).
            dt: The increment.
            fallen: Whether less damping is looked for as well as more.
        """
        viscosity, continuum = self._further.viscosity, self._bodies.continuum
        assert viscosity is not None
        factor = viscosity.quadratic**2 * dt
        # component by component: several times as fast as along the first axis of few columns
        components = continuum.layout.by_node(velocity).T[: continuum.gdim]
        most_of = [c.max(initial=-np.inf) for c in components]
        ends = np.array(most_of + [-c.min(initial=np.inf) for c in components])
        continuum.comm.Allreduce(MPI.IN_PLACE, ends, op=MPI.MAX)
        width = float(np.linalg.norm(ends[: continuum.gdim] + ends[continuum.gdim :]))
        most = factor * width * viscosity.rate_of_range
        if most <= self.compressed + _DAMPED and not fallen:
            return False
        now = factor * viscosity.compression(velocity)
        return now > self.compressed + _DAMPED or (fallen and now < self.compressed - _DAMPED)

    def _edges_now(self) -> Array:
        """Differences of the displacement along the edges over their lengths, (n_edges, gdim)."""
        continuum = self._bodies.continuum
        if self._edges is None:
            cells = continuum.space.dofmap.list
            first = np.repeat(cells[:, 0], cells.shape[1] - 1).astype(np.int64)
            other, x = cells[:, 1:].ravel().astype(np.int64), continuum.positions()
            lengths = np.linalg.norm(x[other] - x[first], axis=1)
            self._edges = first, other, 1.0 / lengths
        first, other, per_length = self._edges
        u = self._bodies.u.x.array.reshape(-1, continuum.layout.n_unknowns)[:, : continuum.gdim]
        return np.asarray((u[other] - u[first]) * per_length[:, None])

    def _by(self, steps: int, velocity: Array) -> float:
        if self._bodies.finite:
            self._look()
        omega, viscosity = self._highest(self._tangent_product, steps), self._further.viscosity
        rate = 0.0
        if viscosity is not None:
            viscosity.forces(velocity)
            rate = self._damping(viscosity.product, steps) ** 2
            if viscosity.changes:
                factor = viscosity.quadratic**2 * 2.0 / omega
                self.compressed = factor * viscosity.compression(velocity)
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
