"""Virtual crack closure: energy release rates from bond forces and the openings behind them.

Even spacing d, width b (Rybicki and Kanninen 1977; in 3-D Shivakumar, Tan and Newman 1988):

    G_I = F_n w_n/(2 b d)    G_II = F_s w_s/(2 b d)    G_III = F_t w_t/(2 b d)

F is the bond force at the front node, w the opening at the wake node behind it, both as (normal,
growth direction, front tangent). Growth when f of the mode-mix law reaches 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import keep_floats, list_of, not_negative, number
from fxcrack.base.errors import InputError
from fxcrack.criteria.energy_release import RateCriterion
from fxcrack.criteria.toughness import Property


@dataclass(frozen=True, eq=False)
class VCCT(RateCriterion):
    """Growth when the energy release rate of the virtual crack closure technique reaches toughness.

    Attributes:
        GIc: Mode I toughness [force/length]: a number, one value per slave node, a function of
            position (3, n) -> (n,), or a :class:`~fxcrack.criteria.toughness.Tabulated`.
        GIIc: Mode II toughness, likewise; GIc when not given.
        GIIIc: Mode III toughness, likewise; GIIc when not given.
        mix: :class:`~fxcrack.BK`, :class:`~fxcrack.Power`, :class:`~fxcrack.Reeder`, or a function
            f(G_I, G_II, G_III[, G_Ic, G_IIc, G_IIIc]), see
            :class:`~fxcrack.criteria.mixed_mode.FunctionLaw`. Needed as soon as GIIc or GIIIc is
            given. Without them f = G_T/GIc.
        tolerance: f_tol; growth is accepted while 1 <= f <= 1 + f_tol.
        method: "vcct"; "closure": the exact energy of releasing the node; or "domain": an integral
            over a ring of cells around the tip (:mod:`~fxcrack.criteria.domain_integral`).
        rings: Outer radius of that ring, in lengths of the cells at the tip.
        reference_length: Length to which the modes of method="domain" belong between two
            materials [length].
        mode_length: Length of closure to which the modes of the other methods belong between two
            materials [length] (:mod:`~fxcrack.criteria.mode_length`).
        normalisation: Length VCCT divides by, see :func:`energy_release_rates`.
        unstable_tolerance: f_tol of unstable growth: several nodes may debond at one load
            while 1 + tolerance <= f <= 1 + unstable_tolerance. None: off; math.inf: unlimited.
        viscosity: Viscous regularisation mu of released nodes, also of those that soften [time];
            0: none.
    """

    unstable_tolerance: float | None = field(default=None, kw_only=True)
    viscosity: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        """Check everything that does not need the interface."""
        super().__post_init__()
        _check_release(self)


@dataclass(frozen=True, eq=False, kw_only=True)
class EnhancedVCCT(RateCriterion):
    """Growth by VCCT with a toughness for onset and one for propagation.

    ``GIc``, ``GIIc``, ``GIIIc`` and everything else of :class:`~fxcrack.criteria.vcct.VCCT` are
    for onset. Values per slave node are not possible.

    Attributes:
        unstable_tolerance: As for :class:`~fxcrack.criteria.vcct.VCCT`.
        viscosity: Likewise.
        GIc_p: Mode I toughness of propagation [force/length].
        GIIc_p: Mode II toughness of propagation; given when, and only when, GIIc is.
        GIIIc_p: Mode III toughness of propagation; given when, and only when, GIIIc is.
    """

    GIc_p: Property
    GIIc_p: Property | None = None
    GIIIc_p: Property | None = None
    unstable_tolerance: float | None = None
    viscosity: float = 0.0

    softens: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check everything that does not need the interface."""
        for name in ("GIIc", "GIIIc"):
            if (getattr(self, name) is None) != (getattr(self, f"{name}_p") is None):
                raise InputError(
                    f"{self._owner}: {name} and {name}_p belong together, for onset and for "
                    "propagation; give both or neither"
                )
        for name, value in self._properties().items():
            if list_of(value) is not None:
                raise InputError(
                    f"{self._owner}: {name} is given per slave node, which only VCCT and fatigue "
                    "allow; give a number, a function of position or a table against temperature"
                )
        super().__post_init__()
        _check_release(self)

    def _properties(self) -> dict[str, Property]:
        given = {"GIIc_p": self.GIIc_p, "GIIIc_p": self.GIIIc_p}
        others = {name: value for name, value in given.items() if value is not None}
        return {**super()._properties(), "GIc_p": self.GIc_p, **others}

    def propagation_toughness_at(
        self,
        x: Array,
        nodes: npt.NDArray[np.integer],
        temperature: npt.ArrayLike | None = None,
        *,
        n_slave: int,
    ) -> Array:
        """Toughness of propagation by mode, shape (n, 3) [force/length].

        Arguments and errors as for :meth:`toughness_at`. The energy to dissipate is
        ``critical(rates, propagation)`` with the rates of onset.
        """
        return self._columns(
            [("GIc_p", self.GIc_p), ("GIIc_p", self.GIIc_p), ("GIIIc_p", self.GIIIc_p)],
            x,
            nodes,
            temperature,
            n_slave,
        )


def _check_release(criterion: VCCT | EnhancedVCCT) -> None:
    """Check what belongs to the release of nodes, and make floats of numbers."""
    owner = type(criterion).__name__
    not_negative(owner, viscosity=criterion.viscosity)
    keep_floats(criterion, "viscosity")
    unstable, tolerance = criterion.unstable_tolerance, criterion.tolerance
    if unstable is not None and number(owner, "unstable_tolerance", unstable) < tolerance:
        raise InputError(
            f"{owner}: unstable_tolerance = {unstable} is below tolerance = {tolerance}; give a "
            "larger one, math.inf for no limit, or None to switch unstable growth off"
        )
