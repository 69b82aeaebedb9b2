"""Opening control: the load factor follows from a monitored displacement that never falls.

With the bonds as they are the opening of linear bodies is linear in the load factor t on each piece
of its way, so that the factor at a given opening d is found in closed form,

    t = t_a + (d - d_a)/(d_b - d_a) (t_b - t_a).

With nonlinear bodies that is where their tangent leads, and it is repeated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.errors import InputError, unknown_name
from fxcrack.solve.condensed import CondensedModel
from fxcrack.solve.jump_system import Equilibrium
from fxcrack.steps.growth import Growth

SAME_OPENING = 1e-9
"""Openings that differ by less than this part of them are the same."""


class OpeningControl:
    """The controlled opening of a step.

    Args:
        model: The bodies, with their monitors.
        growths: Activated debonds.
        names: Name of a monitor, or of two of which the opening is the first less the second.

    Attributes:
        name: What is controlled, in words.
        opening: Opening at the last onset, length.

    Raises:
        InputError: No monitor has that name, faces rub, or bonds soften.
    """

    def __init__(
        self, model: CondensedModel, growths: Sequence[Growth], names: Sequence[str]
    ) -> None:
        self._model = model
        self.name = " - ".join(names)
        self.opening = 0.0
        titles = [m.title for m in model.monitors]
        self._weight = np.zeros(len(titles))
        for name, sign in zip(names, (1.0, -1.0), strict=False):
            if name not in titles:
                unknown_name("monitor", name, titles)
            self._weight[titles.index(name)] += sign
        if model.system.friction is not None:
            raise InputError(
                "stepping='opening' moves the load back at each release, and faces with friction "
                "would slip back with it; leave friction out, or prescribe displacements"
            )
        for g in growths:
            if g.opening_driven:
                raise InputError(
                    f"interface '{g.title}' lets go progressively with its opening, which "
                    "stepping='opening' does not have; release by Step, or prescribe displacements"
                )

    @property
    def close(self) -> float:
        """Openings that differ by less are the same, length."""
        return SAME_OPENING * self.opening

    def excess(self, state: Equilibrium) -> float:
        """What the opening of a state has over that of the last onset, length."""
        values = self._model.system.monitors(state)[: len(self._weight)]
        return float(self._weight @ values) - self.opening

    def reach(self, state: Equilibrium) -> None:
        """Control the opening of a state from now on.

        Raises:
            InputError: It is not positive, or smaller than the one before.
        """
        more = self.excess(state)
        if self.opening + more <= 0.0 or more < -self.close:
            raise InputError(
                f"stepping='opening': '{self.name}' went from {self.opening:.6g} to "
                f"{self.opening + more:.6g} up to an onset; control a displacement that grows "
                "with load and crack, in its positive direction"
            )
        self.opening += more
