"""Bonds that let go with time or over increments: a known fraction of the force remains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.criteria import AmplitudeRelease, Ramp
from fxcrack.criteria import Release as ReleaseLaw
from fxcrack.errors import InputError
from fxcrack.solve.condensed import CondensedModel

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class TimedRelease:
    """Nodes whose bond force falls with the time, or the increments, since debonding.

    Attributes:
        p: Number of the pair.
        nodes: Slave nodes, shape (n,).
        force: Force on the slave side at debonding in jump components, shape (n, gdim).
        law: The amplitude, or the number of increments.
        start: Time of debonding, or number of the increment.
    """

    p: int
    nodes: Ints
    force: Array
    law: AmplitudeRelease | Ramp
    start: float

    @classmethod
    def begin(
        cls, model: CondensedModel, p: int, nodes: Ints, law: ReleaseLaw, time: float
    ) -> TimedRelease:
        """Note the bond forces of nodes that are about to let go."""
        if not isinstance(law, AmplitudeRelease | Ramp):
            raise InputError(f"{type(law).__name__} is no release with time or increments")
        return cls(p, nodes, bond_forces_of(model, p, nodes), law, time)

    @property
    def by_time(self) -> bool:
        """Whether time drives it, and not increments."""
        return self.law.driver == "time"

    def fraction(self, now: float) -> float:
        """Remaining fraction of the force at a time or an increment."""
        return float(self.law.remaining(now - self.start))

    def breaks(self) -> tuple[float, ...]:
        """Times at which the amplitude bends."""
        if not isinstance(self.law, AmplitudeRelease):
            return ()
        return tuple(self.start + t for t in self.law.times)

    def now(self, time: float, increment: int) -> float:
        """What drives it: the time or the number of the increment."""
        return time if self.by_time else float(increment)


@dataclass
class ViscousRelease:
    """Nodes whose release is delayed: damage D_v follows 1 with dD_v/dt = (1 - D_v)/mu.

    The force left is (1 - D_v) F0; one step of implicit Euler per increment multiplies it by
    mu/(mu + dt).

    Attributes:
        p: Number of the pair.
        nodes: Slave nodes, shape (n,).
        force: Force on the slave side at debonding in jump components, shape (n, gdim).
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

    def fraction(self, now: float) -> float:
        """Remaining fraction at the end of an increment."""
        return self.remaining * self.viscosity / (self.viscosity + max(now - self.time, 0.0))

    def accept(self, time: float) -> None:
        """Go on from the end of an accepted increment."""
        self.remaining, self.time = self.fraction(time), time

    def breaks(self) -> tuple[float, ...]:
        """None: the force is known at increments only."""
        return ()

    def now(self, time: float, increment: int) -> float:
        """What drives it: the time."""
        return time


Letting = TimedRelease | ViscousRelease


def bond_forces_of(model: CondensedModel, p: int, nodes: Ints) -> Array:
    """Forces on the slave side of bonded nodes in jump components, shape (n, gdim)."""
    index = model.index[p][nodes]
    inside = (index >= 0) & ~model.system.free[np.maximum(index, 0)]
    force = np.zeros(index.shape)
    force[inside] = model.system.forces(model.state, index[inside])
    return force


def given_forces(
    model: CondensedModel, ramps: Sequence[Letting], time: float, increment: int
) -> Array:
    """Forces that remain at a time and an increment, shape (n_window,)."""
    force = np.zeros(model.system.n_window)
    for ramp in ramps:
        components = model.index[ramp.p][ramp.nodes]
        inside = components >= 0
        force[components[inside]] = ramp.fraction(ramp.now(time, increment)) * ramp.force[inside]
    return force
