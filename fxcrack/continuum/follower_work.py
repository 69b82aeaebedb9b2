"""Work of a load that follows the bodies, on straight paths between accepted displacements.

On such a path load factor and displacement are linear, and the deformed area is at most quadratic,
so that Simpson's rule is exact.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from dolfinx import fem

from fxcrack.base.arrays import Array
from fxcrack.continuum.input_order import Place

SIMPSON = ((0.0, 1.0 / 6.0), (0.5, 4.0 / 6.0), (1.0, 1.0 / 6.0))
"""Places on a path from 0 to 1 and their weights."""


class FollowerWork:
    """The last accepted state of a load that follows the bodies, and its work up to there.

    Args:
        space: Space of the displacement.

    Attributes:
        u: Displacement of the last accepted state, local dofs, ghosts too, shape (n_dofs,), length.
        factor: Load factor there.
        work: Work so far, force x length; the same on all ranks.
    """

    def __init__(self, space: fem.FunctionSpace) -> None:
        self._space = space
        self.u: Array = np.zeros_like(fem.Function(space).x.array)
        self.factor = self.work = 0.0

    def along(self, factor: float, power: Callable[[float, float], float]) -> float:
        """Work on the path from the last accepted state.

        Args:
            factor: Load factor at the end of the path.
            power: Work per unit of path of the load at a place between 0 and 1 and with a load
                factor.
        """
        start = self.factor
        return sum(w * power(s, (1.0 - s) * start + s * factor) for s, w in SIMPSON)

    def accept(self, u: fem.Function, factor: float, work: float) -> None:
        """Go on from another state, with the work on the way there."""
        self.work += work
        self.u[:] = u.x.array
        self.factor = factor

    def state(self) -> dict[str, Array]:
        """Displacement and load factor of the last accepted state, work so far.

        Returns:
            "last": displacement of the local dofs, ghosts too, shape (n_dofs,), length; "sums":
            load factor and work (force x length), shape (2,).
        """
        return {"last": self.u.copy(), "sums": np.array([self.factor, self.work])}

    def places(self) -> dict[str, Place]:
        """Space of the displacement."""
        return {"last": self._space}

    def restore(self, state: dict[str, Array]) -> None:
        """Set the accepted state from :meth:`state`, arrays of the same shapes."""
        self.u[:] = state["last"]
        self.factor, self.work = (float(x) for x in state["sums"])


__all__ = ["SIMPSON", "FollowerWork"]
