"""Bonds that let go with time: their force is a known fraction of that at debonding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.criteria import AmplitudeRelease
from fxcrack.criteria import Release as ReleaseLaw
from fxcrack.solve.condensed import CondensedModel

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class TimedRelease:
    """Nodes whose bond force falls along an amplitude of the time since debonding.

    Attributes:
        p: Number of the pair.
        nodes: Slave nodes, shape (n,).
        force: Force on the slave side at debonding in jump components, shape (n, gdim).
        law: The amplitude.
        start: Time of debonding.
    """

    p: int
    nodes: Ints
    force: Array
    law: AmplitudeRelease
    start: float

    @classmethod
    def begin(
        cls, model: CondensedModel, p: int, nodes: Ints, law: ReleaseLaw, time: float
    ) -> TimedRelease:
        """Note the bond forces of nodes that are about to let go."""
        assert isinstance(law, AmplitudeRelease)
        index = model.index[p][nodes]
        inside = (index >= 0) & ~model.system.free[np.maximum(index, 0)]
        force = np.zeros(index.shape)
        force[inside] = model.system.forces(model.state, index[inside])
        return cls(p, nodes, force, law, time)

    def fraction(self, time: float) -> float:
        """Remaining fraction of the force at a time."""
        return float(self.law.remaining(time - self.start))

    def breaks(self) -> tuple[float, ...]:
        """Times at which the amplitude bends."""
        return tuple(self.start + t for t in self.law.times)
