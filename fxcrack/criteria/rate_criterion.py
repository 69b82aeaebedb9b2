"""What VCCT, enhanced VCCT and fatigue share: toughness by mode, mode mix, how G is computed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from fxcrack.criteria.checks import Array, not_negative, one_of
from fxcrack.criteria.mixed_mode import BK, MixedMode
from fxcrack.criteria.toughness import Property, check_property, resolve
from fxcrack.errors import InputError

Normalisation = Literal["tributary", "ahead", "ahead_sqrt", "behind"]
NORMALISATIONS = ("tributary", "ahead", "ahead_sqrt", "behind")
Method = Literal["vcct", "closure"]


@dataclass(frozen=True, eq=False)
class RateCriterion:
    """What the criteria on energy release rates share: toughness, mode mix, how G is computed.

    Attributes:
        GIc: Mode I toughness [force/length]: a number, one value per slave node, a function of
            position (n, gdim) -> (n,), or a :class:`~fxcrack.criteria.toughness.Tabulated`.
        GIIc: Mode II toughness, likewise; GIc when not given.
        GIIIc: Mode III toughness, likewise; GIIc when not given.
        mix: Mode-mix law. Needed as soon as GIIc or GIIIc is given. Without them all modes have the
            toughness GIc and f = G_T/GIc.
        tolerance: f_tol; growth is accepted while 1 <= f <= 1 + f_tol.
        method: "vcct", or "closure": the exact energy of releasing the node.
        normalisation: Length VCCT divides by, see
            :func:`~fxcrack.criteria.vcct.energy_release_rates`.
    """

    GIc: Property
    GIIc: Property | None = None
    GIIIc: Property | None = None
    mix: MixedMode | None = field(default=None, kw_only=True)
    tolerance: float = field(default=0.2, kw_only=True)
    method: Method = field(default="vcct", kw_only=True)
    normalisation: Normalisation = field(default="tributary", kw_only=True)

    allows_normal_only: ClassVar[bool] = False
    """Whether a bond in the normal direction only is possible."""

    def __post_init__(self) -> None:
        """Check everything that does not need the interface."""
        not_negative(self._owner, tolerance=self.tolerance)
        one_of(self._owner, "method", self.method, ("vcct", "closure"))
        one_of(self._owner, "normalisation", self.normalisation, NORMALISATIONS)
        if self.mix is not None and (isinstance(self.mix, type) or not hasattr(self.mix, "ratio")):
            raise InputError(
                f"{self._owner}: mix = {self.mix!r} is no mode-mix law; give one with its "
                "exponents, BK(eta=...), Reeder(eta=...) or Power(am=..., an=...)"
            )
        if self.mix is None and not (self.GIIc is None and self.GIIIc is None):
            raise InputError(
                f"{self._owner}: GIIc or GIIIc is given but no mode-mix law; "
                "add mix=BK(eta=...), Reeder(eta=...) or Power(am=..., an=...)"
            )
        for name, value in self._properties().items():
            check_property(self._owner, name, value)

    @property
    def _owner(self) -> str:
        return type(self).__name__

    @property
    def law(self) -> MixedMode:
        """The mode-mix law; with a single toughness any would do."""
        return BK(eta=1.0) if self.mix is None else self.mix

    @property
    def window(self) -> tuple[float, float]:
        """Lower and upper limit of f at which a node may debond."""
        return 1.0, 1.0 + self.tolerance

    def _properties(self) -> dict[str, Property]:
        given = {"GIc": self.GIc, "GIIc": self.GIIc, "GIIIc": self.GIIIc}
        return {name: value for name, value in given.items() if value is not None}

    def check_slaves(self, n_slave: int) -> None:
        """Check values given per slave node against the interface, before the analysis.

        Args:
            n_slave: Number of slave nodes of the interface.

        Raises:
            InputError: Some slave nodes have no value, or there are too many; with their numbers.
        """
        for name, value in self._properties().items():
            check_property(self._owner, name, value, n_slave)

    def toughness_at(
        self,
        x: Array,
        nodes: npt.NDArray[np.integer],
        temperature: npt.ArrayLike | None = None,
        *,
        n_slave: int,
    ) -> Array:
        """Toughness by mode at front nodes.

        Args:
            x: Positions of the front nodes, shape (n, gdim) [length].
            nodes: Their numbers among the slave nodes of the interface, shape (n,).
            temperature: Temperature there, shape (n,) or one number; None without temperatures.
            n_slave: Number of slave nodes of the interface.

        Returns:
            G_Ic, G_IIc, G_IIIc, shape (n, 3) [force/length].

        Raises:
            InputError: A value is missing, NaN or not positive; with the slave node numbers.
        """
        return self._columns(
            [("GIc", self.GIc), ("GIIc", self.GIIc), ("GIIIc", self.GIIIc)],
            x,
            nodes,
            temperature,
            n_slave,
        )

    def _columns(
        self,
        given: list[tuple[str, Property | None]],
        x: Array,
        nodes: npt.NDArray[np.integer],
        temperature: npt.ArrayLike | None,
        n_slave: int,
    ) -> Array:
        """Resolve three properties; one that is not given equals the one before."""
        columns: list[Array] = []
        for name, value in given:
            columns.append(
                columns[-1]
                if value is None
                else resolve(
                    self._owner,
                    name,
                    value,
                    x=x,
                    nodes=nodes,
                    temperature=temperature,
                    n_slave=n_slave,
                )
            )
        return np.stack(columns, axis=-1)

    def ratio(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Value f of the criterion, shape (n,); growth starts at 1.

        Args:
            rates: Energy release rates by mode, shape (n, 3) [force/length].
            toughness: Toughness by mode, shape (n, 3) or (3,) [force/length].
        """
        return self.law.ratio(rates, toughness)

    def critical(self, rates: npt.ArrayLike, toughness: npt.ArrayLike) -> Array:
        """Total rate at which growth starts at this mode mix, shape (n,) [force/length].

        Arguments as for :meth:`ratio`.
        """
        return self.law.critical(rates, toughness)
