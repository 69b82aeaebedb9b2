"""Enhanced VCCT: a toughness for onset, another for propagation, and softening by energy.

Onset as in VCCT, with G_equivC from the onset values. After onset the bond force falls along the
opening w in its own direction, and spends the propagation toughness at the mode mix of onset:

    F(w) = F0 (1 - w/w_f),    1/2 |F0| w_f = G_equivC^P dA

Unloading follows the secant to the origin; what has opened never bonds again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.criteria.checks import Array
from fxcrack.criteria.toughness import Property, Tabulated
from fxcrack.criteria.vcct import VCCT
from fxcrack.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class EnhancedVCCT(VCCT):
    """Growth by VCCT with a toughness for onset and one for propagation.

    ``GIc``, ``GIIc``, ``GIIIc`` and everything else of :class:`~fxcrack.criteria.vcct.VCCT` are
    for onset. Values per slave node are not possible.

    Attributes:
        GIc_p: Mode I toughness of propagation [force/length].
        GIIc_p: Mode II toughness of propagation; given when, and only when, GIIc is.
        GIIIc_p: Mode III toughness of propagation; given when, and only when, GIIIc is.
    """

    GIc_p: Property
    GIIc_p: Property | None = None
    GIIIc_p: Property | None = None

    def __post_init__(self) -> None:
        """Check everything that does not need the interface."""
        for name in ("GIIc", "GIIIc"):
            if (getattr(self, name) is None) != (getattr(self, f"{name}_p") is None):
                raise InputError(
                    f"{self._owner}: {name} and {name}_p belong together, for onset and for "
                    "propagation; give both or neither"
                )
        for name, value in self._properties().items():
            if not (isinstance(value, Tabulated) or callable(value)) and np.ndim(value) > 0:
                raise InputError(
                    f"{self._owner}: {name} is given per slave node, which only VCCT and fatigue "
                    "allow; give a number, a function of position or a table against temperature"
                )
        super().__post_init__()

    def _properties(self) -> dict[str, Property]:
        given = {"GIc_p": self.GIc_p, "GIIc_p": self.GIIc_p, "GIIIc_p": self.GIIIc_p}
        return super()._properties() | {k: v for k, v in given.items() if v is not None}

    def propagation_toughness_at(
        self,
        x: Array,
        nodes: npt.NDArray[np.integer],
        temperature: npt.ArrayLike | None = None,
        *,
        n_slave: int,
    ) -> Array:
        """Toughness of propagation by mode, shape (n, 3) [force/length].

        Arguments and errors as for :meth:`toughness_at`. The energy to spend is
        ``critical(rates, propagation)`` with the rates of onset.
        """
        return self._columns(
            [("GIc_p", self.GIc_p), ("GIIc_p", self.GIIc_p), ("GIIIc_p", self.GIIIc_p)],
            x,
            nodes,
            temperature,
            n_slave,
        )
