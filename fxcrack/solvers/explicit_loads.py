"""Loads and monitored displacements in explicit dynamics, as vectors on the owned dofs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.load_vectors import LoadPattern, load_vector, monitor_weights
from fxcrack.continuum.loads import Load, Monitor
from fxcrack.continuum.thermal_strain import ThermalLoad, held_energies
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.solvers.explicit_points import FacePoints


class LoadsAndMonitors:
    """Force patterns and monitored displacements; collective.

    Args:
        continuum: Displacement space.
        loads: Force patterns, those of the temperature last.
        monitors: Monitored displacements.
        points: Unknowns at interfaces of shells.

    Raises:
        InputError: A load or a monitor does not fit the bodies.

    Attributes:
        n_loads: How many force patterns there are.
        n_thermal: How many patterns belong to the temperature.
    """

    def __init__(
        self, continuum: Continuum, loads: Sequence[Any], monitors: Sequence[Monitor],
        points: FacePoints,
    ) -> None:  # fmt: skip
        self._n_local = continuum.n_local
        self._gdim = continuum.gdim
        self._loads = [_load_pattern(continuum, load, points) for load in loads]
        weights = [monitor_weights(continuum, m) for m in monitors]
        self._monitors = [LoadPattern(points.forces(w)) for w in weights]
        self.n_loads = len(loads)
        self.n_thermal = sum(isinstance(load, ThermalLoad) for load in loads)
        self._held = held_energies(continuum) if self.n_thermal else np.zeros((0, 0))
        self._on_faces: list[Array] = []
        self._at_chosen: list[LoadPattern] = []
        self._elsewhere: list[LoadPattern] = []

    def take_faces(self, lumped: LumpedInterface) -> bool:
        """Find the forces of loads on slave nodes; whether there are any.

        Args:
            lumped: The interfaces.
        """
        nodes, n = lumped.nodes, self._n_local
        # a temperature acts within the bodies, which its forces at their faces only balance
        outer = self._loads[: len(self._loads) - self.n_thermal]
        found = [nodes.gather(p.dense(n))[lumped.slave, : self._gdim] for p in outer]
        has = any(np.any(f) for f in found)
        self._on_faces = found if has else []
        return has

    def divide(self, chosen: Ints, inverse_mass: Array) -> None:
        """Prepare :meth:`add_at_chosen` and :meth:`add_elsewhere`.

        Args:
            chosen: Owned dofs whose forces are wanted, shape (n_chosen,).
            inverse_mass: One over the mass of the owned dofs, shape (n_local,).
        """
        self._at_chosen, self._elsewhere = [], []
        for pattern in self._loads:
            values = pattern.dense(self._n_local)
            self._at_chosen.append(LoadPattern(values[chosen]))
            values[chosen] = 0.0
            self._elsewhere.append(LoadPattern(values * inverse_mass))

    def add_at_chosen(self, forces: Array, factors: Array) -> None:
        """Add the loads to the forces at the chosen dofs, shape (n_chosen,), in place.

        Args:
            forces: The forces.
            factors: Load factors, shape (n_forces,).
        """
        for pattern, factor in zip(self._at_chosen, factors.tolist(), strict=True):
            if factor and len(pattern.values):
                pattern.add(forces, factor)

    def add_elsewhere(self, velocity: Array, factors: Array, h: float) -> None:
        """Add what the loads do to the velocity of all other dofs, shape (n_local,), in place.

        Args:
            velocity: The velocity.
            factors: Load factors, shape (n_forces,).
            h: Time in which they act.
        """
        for pattern, factor in zip(self._elsewhere, factors.tolist(), strict=True):
            if factor and len(pattern.values):
                pattern.add(velocity, h * factor)

    def on_faces(self, factors: Array) -> Array:
        """Forces on the slave nodes, shape (n_rows, gdim), force."""
        return sum(
            (factor * f for factor, f in zip(factors.tolist(), self._on_faces, strict=False)),
            np.zeros(1),
        )

    def power(self, factors: Array, velocity: Array) -> float:
        """Power of the loads in a motion of the owned dofs, this rank's part."""
        return sum(
            float(factor) * float(p.values @ velocity[p.at])
            for p, factor in zip(self._loads, factors, strict=True)
            if factor
        )

    def conjugates(self, u: Array) -> list[float]:
        """Displacements conjugate to the loads, length; this rank's part of each."""
        return [float(p.values @ u[p.at]) for p in self._loads]

    def thermal_part(self, factors: Array, answers: Array) -> float:
        """What the temperature takes off 1/2 u K u to give the energy stored, force x length.

        Args:
            factors: Load factors, those of temperature patterns last, shape (n_forces,).
            answers: Displacements conjugate to the loads, sums over ranks, same shape.
        """
        factors, answers = factors[-self.n_thermal :], answers[-self.n_thermal :]
        return float(factors @ answers - 0.5 * factors @ self._held @ factors)

    def monitored(self, u: Array) -> list[float]:
        """Monitored displacements, length; this rank's part of each."""
        return [float(p.values @ u[p.at]) for p in self._monitors]


def _load_pattern(
    continuum: Continuum, load: Load | ThermalLoad, points: FacePoints
) -> LoadPattern:
    vector = load_vector(continuum, load)
    out = LoadPattern(points.forces(np.array(vector.array_r)))
    vector.destroy()
    return out


__all__ = ["LoadsAndMonitors"]
