"""Bonds released with time or over increments: a known fraction of their force remains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.criteria import ReleaseLaw
from fxcrack.equilibrium.cohesive_law import CohesiveUnit
from fxcrack.equilibrium.friction_state import contact_share
from fxcrack.solvers.base import Solver


@dataclass(frozen=True)
class PrescribedRamp:
    """Nodes whose bond force falls with the time, or the increments, since debonding.

    Attributes:
        p: Number of the pair.
        nodes: Slave nodes, shape (n,).
        force: Force on the slave side at debonding in jump components, shape (n, gdim), force.
        law: The amplitude, or the number of increments.
        start: Time of debonding, or number of the increment.
    """

    p: int
    nodes: Ints
    force: Array
    law: ReleaseLaw
    start: float

    @classmethod
    def begin(
        cls, solver: Solver, p: int, nodes: Ints, law: ReleaseLaw, time: float
    ) -> PrescribedRamp:
        """Record the bond forces of slave nodes, shape (n,), that are about to be released."""
        return cls(p, nodes, bond_forces_of(solver, p, nodes), law, time)

    @property
    def by_time(self) -> bool:
        """Whether time drives it, and not increments."""
        return self.law.driver == "time"

    def fraction(self, now: float) -> float:
        """Remaining fraction of the force at a time or an increment."""
        return float(self.law.remaining(now - self.start))

    def breaks(self) -> tuple[float, ...]:
        """Times at which the amplitude changes its slope."""
        return tuple(self.start + t for t in self.law.breaks()) if self.by_time else ()

    @property
    def suggested_increment(self) -> float:
        """Increment suggested for the first one after debonding, time."""
        return self.law.suggested_increment

    def accept(self, time: float, solver: Solver) -> None:
        """Nothing: the fraction depends on what has passed since debonding alone."""

    def viscous_part(self, spent: float, solver: Solver, here: Array, there: Array) -> float:
        """Viscous part of the energy between two states (jumps, shape (n_retained,)): none."""
        return 0.0

    def now(self, time: float, increment: int) -> float:
        """What drives it: the time or the number of the increment."""
        return time if self.by_time else float(increment)


@dataclass
class ViscousRamp:
    """Nodes whose release is delayed: damage D_v follows 1 with dD_v/dt = (1 - D_v)/mu.

    The force left is (1 - D_v) F0; one step of implicit Euler per increment multiplies it by
    mu/(mu + dt).

    Attributes:
        p: Number of the pair.
        nodes: Slave nodes, shape (n,).
        force: Force on the slave side at debonding in jump components, shape (n, gdim), force.
        viscosity: mu, time.
        time: Time of the last accepted increment.
        remaining: Fraction 1 - D_v then.
    """

    p: int
    nodes: Ints
    force: Array
    viscosity: float
    time: float
    remaining: float = 1.0
    by_time: bool = True
    start: float = float("nan")

    suggested_increment: ClassVar[float] = float("inf")

    def fraction(self, now: float) -> float:
        """Remaining fraction at the end of an increment."""
        return self.remaining * self.viscosity / (self.viscosity + max(now - self.time, 0.0))

    def viscous_part(self, spent: float, solver: Solver, here: Array, there: Array) -> float:
        """Viscous part of the energy between two states (jumps, shape (n_retained,)): all of it."""
        return spent

    def accept(self, time: float, solver: Solver) -> None:
        """Continue from the end of an accepted increment."""
        self.remaining, self.time = self.fraction(time), time

    def breaks(self) -> tuple[float, ...]:
        """None: the force is known at increments only."""
        return ()

    def now(self, time: float, increment: int) -> float:
        """What drives it: the time."""
        return time


@dataclass
class ViscousCohesiveRamp:
    """Nodes whose softening with opening is delayed: D_v follows D = w/w_f.

    dD_v/dt = (D - D_v)/mu; the force left is (1 - D_v) F0. One step of implicit Euler per increment
    takes D from the end of the one before, so that forces are known when an increment begins:
    D_v <- (dt D + mu D_v)/(dt + mu). The softening law is met as mu and dt go to zero.

    Attributes:
        p: Number of the pair.
        nodes: Slave nodes, shape (n,).
        unit: Number of the law of each of them, shape (n,).
        force: Force on the slave side at debonding in jump components, shape (n, gdim), force.
        final: w_f per law, shape (n_laws,), length.
        viscosity: mu, time.
        time: Time of the last accepted increment.
        damage: D then per law, shape (n_laws,).
        lagging: D_v then per law, shape (n_laws,).
    """

    p: int
    nodes: Ints
    unit: Ints
    force: Array
    final: Array
    viscosity: float
    time: float
    damage: Array
    lagging: Array
    by_time: bool = True
    start: float = float("nan")

    suggested_increment: ClassVar[float] = float("inf")

    @classmethod
    def begin(
        cls,
        solver: Solver,
        p: int,
        units: Sequence[CohesiveUnit],
        viscosity: float,
        time: float,
    ) -> ViscousCohesiveRamp:
        """Note the bond forces of nodes that are about to soften.

        Args:
            solver: The solver.
            p: Number of the pair.
            units: What softens by one law each.
            viscosity: mu, time.
            time: Present time.
        """
        nodes = np.concatenate([u.nodes for u in units])
        unit = np.repeat(np.arange(len(units)), [len(u.nodes) for u in units])
        force, zero = bond_forces_of(solver, p, nodes), np.zeros(len(units))
        energy = np.array([u.energy for u in units])
        final = 2.0 * energy / _sizes(force, unit)
        return cls(p, nodes, unit, force, final, viscosity, time, zero, zero.copy())

    def fraction(self, now: float) -> Array:
        """Remaining fractions at the end of an increment, shape (n,)."""
        return np.asarray(1.0 - self._lagging_at(now))[self.unit]

    def _lagging_at(self, now: float) -> Array:
        dt = max(now - self.time, 0.0)
        return (dt * self.damage + self.viscosity * self.lagging) / (dt + self.viscosity)

    def damage_at(self, solver: Solver, jump: Array) -> Array:
        """D of a state, shape (n_laws,): of the largest opening along the force at debonding.

        Args:
            solver: The solver.
            jump: Jumps of the state, shape (n_retained,), length.
        """
        index = solver.index[self.p][self.nodes]
        at = np.where(index >= 0, jump[np.maximum(index, 0)], 0.0)
        work = np.bincount(self.unit, (self.force * at).sum(axis=1), len(self.final))
        opening = -work / _sizes(self.force, self.unit)
        return np.asarray(np.maximum(self.damage, np.clip(opening / self.final, 0.0, 1.0)))

    def fracture_energy(self, solver: Solver, jump: Array) -> float:
        """Energy the law without viscosity has dissipated up to a state, force times length.

        Args:
            solver: The solver.
            jump: Jumps of the state, shape (n_retained,), length.
        """
        left = 1.0 - self.damage_at(solver, jump)
        whole = 0.5 * _sizes(self.force, self.unit) * self.final
        return float(whole @ (1.0 - left**2))

    def viscous_part(self, spent: float, solver: Solver, here: Array, there: Array) -> float:
        """Part of the energy dissipated between two states by viscosity, force times length.

        It is what the law without viscosity would not have dissipated.

        Args:
            spent: Energy dissipated, force times length.
            solver: The solver.
            here: Jumps of the first state, shape (n_retained,), length.
            there: Jumps of the second state, likewise.
        """
        law = [self.fracture_energy(solver, jump) for jump in (here, there)]
        return spent - (law[1] - law[0])

    def accept(self, time: float, solver: Solver) -> None:
        """Continue from the end of an accepted increment."""
        self.lagging = self._lagging_at(time)
        self.damage, self.time = self.damage_at(solver, solver.state.jump), time

    def breaks(self) -> tuple[float, ...]:
        """None: the force is known at increments only."""
        return ()

    def now(self, time: float, increment: int) -> float:
        """What drives it: the time."""
        return time


def _sizes(force: Array, unit: Ints) -> Array:
    """Norms of the forces of each unit, never quite 0, shape (n_units,), force."""
    square = np.bincount(unit, (force**2).sum(axis=1))
    return np.maximum(np.sqrt(square), np.finfo(float).tiny)


ForceRamp = PrescribedRamp | ViscousRamp | ViscousCohesiveRamp
"""Bonds whose force is given while they are released."""

_SPENT = 1e-12
"""Bonds of which less than this fraction of the force is left are free."""


def still_pulling(ramps: Sequence[ForceRamp], time: float, increment: int) -> list[ForceRamp]:
    """Those of some bonds that still carry a force."""
    return [r for r in ramps if np.any(np.abs(r.fraction(r.now(time, increment))) > _SPENT)]


def bond_forces_of(solver: Solver, p: int, nodes: Ints) -> Array:
    """Forces on the slave side of bonded nodes in jump components, shape (n, gdim), force.

    With friction, less the part that contact carries at once.
    """
    index = solver.index[p][nodes]
    inside = (index >= 0) & ~solver.system.free[np.maximum(index, 0)]
    force = np.zeros(index.shape)
    force[inside] = solver.system.forces(solver.state, index[inside])
    pair = solver.pairs[p]
    if solver.system.friction is not None and pair.interface.contact:
        taken, _, _ = contact_share(solver.system, pair, solver.index[p], nodes, solver.state)
        force[inside] -= taken[inside]
    return force


def given_forces(solver: Solver, ramps: Sequence[ForceRamp], time: float, increment: int) -> Array:
    """Forces that remain at a time and an increment, shape (n_retained,), force."""
    force = np.zeros(solver.system.n_retained)
    for ramp in ramps:
        components = solver.index[ramp.p][ramp.nodes]
        inside = components >= 0
        left = np.reshape(ramp.fraction(ramp.now(time, increment)), (-1, 1)) * ramp.force
        force[components[inside]] = left[inside]
    return force
