"""What VCCT, enhanced VCCT and fatigue share: toughness by mode, mode mix, how G is computed.

G itself is measured by :mod:`fxcrack.criteria.rate_evaluator`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, Literal, cast

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import keep_floats, not_negative, one_of, positive, whole
from fxcrack.base.errors import InputError
from fxcrack.criteria.crack_closure import NORMALISATIONS, Normalisation
from fxcrack.criteria.criterion import Criterion
from fxcrack.criteria.domain_integral import RINGS
from fxcrack.criteria.interface_temperature import InterfaceTemperature
from fxcrack.criteria.mixed_mode import BK, MixedMode, law_of
from fxcrack.criteria.probe import FrontProbe
from fxcrack.criteria.rate_evaluator import RateEvaluator
from fxcrack.criteria.release_laws import Driver
from fxcrack.criteria.toughness import Property, check_property, resolve

Method = Literal["vcct", "closure", "domain"]
METHODS = ("vcct", "closure", "domain")


@dataclass(frozen=True, eq=False)
class RateCriterion(Criterion):
    """What the criteria on energy release rates share: toughness, mode mix, how G is computed.

    Attributes:
        GIc: Mode I toughness [force/length]: a number, one value per slave node, a function of
            position (3, n) -> (n,), or a :class:`~fxcrack.criteria.toughness.Tabulated`.
        GIIc: Mode II toughness, likewise; GIc when not given.
        GIIIc: Mode III toughness, likewise; GIIc when not given.
        mix: Mode-mix law, or a function f(G_I, G_II, G_III[, G_Ic, G_IIc, G_IIIc]) as one, see
            :class:`~fxcrack.criteria.mixed_mode.FunctionLaw`. Needed as soon as GIIc or GIIIc is
            given. Without them all modes have the toughness GIc and f = G_T/GIc.
        tolerance: f_tol; growth is accepted while 1 <= f <= 1 + f_tol.
        method: "vcct"; "closure": the exact energy of releasing the node; or "domain": an integral
            over a ring of cells around the tip, for elastic bodies
            (:mod:`~fxcrack.criteria.domain_integral`).
        normalisation: Length VCCT divides by, see
            :func:`~fxcrack.criteria.crack_closure.energy_release_rates`.
        rings: Outer radius of the ring of method="domain", in lengths of the cells at the tip. It
            is less where the cells on one side are of several materials.
        reference_length: Length to which the modes of method="domain" belong where the two sides
            are of different materials [length]; see :mod:`~fxcrack.criteria.crack_tip_fields`.
        mode_length: Length of crack closure to which the modes of the other methods belong there
            [length]; ``None``: the length of the elements, so that they change with the mesh. See
            :mod:`~fxcrack.criteria.mode_length`.
    """

    GIc: Property
    GIIc: Property | None = None
    GIIIc: Property | None = None
    mix: MixedMode | Callable[..., npt.ArrayLike] | None = field(default=None, kw_only=True)
    tolerance: float = field(default=0.2, kw_only=True)
    method: Method = field(default="vcct", kw_only=True)
    normalisation: Normalisation = field(default="equal_length", kw_only=True)
    rings: int = field(default=RINGS, kw_only=True)
    reference_length: float | None = field(default=None, kw_only=True)
    mode_length: float | None = field(default=None, kw_only=True)

    knows_toughness: ClassVar[bool] = True
    release_drivers: ClassVar[frozenset[Driver]] = frozenset(("once", "increments", "opening"))
    smallest_increment_when_met: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check everything that does not need the interface."""
        not_negative(self._owner, tolerance=self.tolerance)
        keep_floats(self, "tolerance")
        one_of(self._owner, "method", self.method, METHODS)
        one_of(self._owner, "normalisation", self.normalisation, NORMALISATIONS)
        if self.method == "domain" and self.grows_in_cycles:
            raise InputError(
                f"{self._owner}: method='domain' is for static steps; take method='vcct' or "
                "method='closure' in cycles"
            )
        if whole(self._owner, "rings", self.rings) < 1:
            raise InputError(f"{self._owner}: rings = {self.rings}: give 1 or more, e.g. 3")
        if self.reference_length is not None:
            positive(self._owner, reference_length=self.reference_length)
            if self.method != "domain":
                raise InputError(
                    f"{self._owner}: reference_length = {self.reference_length:g} belongs to the "
                    f"modes of method='domain'; with method='{self.method}' give mode_length, or "
                    "leave it out"
                )
        if self.mode_length is not None:
            positive(self._owner, mode_length=self.mode_length)
            if self.method == "domain":
                raise InputError(
                    f"{self._owner}: mode_length = {self.mode_length:g} is a length of crack "
                    "closure; the modes of method='domain' belong to reference_length"
                )
        if self.mix is not None:
            object.__setattr__(self, "mix", law_of(self._owner, self.mix))
        if self.mix is None and not (self.GIIc is None and self.GIIIc is None):
            raise InputError(
                f"{self._owner}: GIIc or GIIIc is given but no mode-mix law; "
                "add mix=BK(eta=...), Reeder(eta=...) or Power(am=..., an=...)"
            )
        for name, value in self._properties().items():
            check_property(self._owner, name, value)

    def evaluator(
        self, probe: FrontProbe, temperature: InterfaceTemperature | None, *, softens: bool = False
    ) -> RateEvaluator:
        """The criterion on one interface; arguments as for :meth:`Criterion.evaluator`."""
        return RateEvaluator(probe, self, temperature, softens=softens)

    @property
    def needs_free_faces(self) -> bool:
        """The ring does not know tractions of bonds that are released little by little."""
        return self.method == "domain"

    @property
    def degree(self) -> float | None:
        """Twice the degree of the mode-mix law: rates grow with the square of the load."""
        return None if self.law.degree is None else 2.0 * self.law.degree

    @property
    def needs_exact_S(self) -> bool:
        """Exact crack closure and the domain integral release units in the present state."""
        return self.method in ("closure", "domain")

    @property
    def needs_wake_openings(self) -> bool:
        """Virtual crack closure multiplies forces with the openings behind."""
        return self.method == "vcct"

    @property
    def _owner(self) -> str:
        return type(self).__name__

    @property
    def law(self) -> MixedMode:
        """The mode-mix law; with a single toughness any would do."""
        return BK(eta=1.0) if self.mix is None else cast(MixedMode, self.mix)

    @property
    def release_range(self) -> tuple[float, float]:
        """Lower and upper limit of f at which a node may debond."""
        return 1.0, 1.0 + self.tolerance

    def _properties(self) -> dict[str, Property]:
        given = {"GIIc": self.GIIc, "GIIIc": self.GIIIc}
        others = {name: value for name, value in given.items() if value is not None}
        return {"GIc": self.GIc, **others}

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

    def propagation_toughness_at(
        self,
        x: Array,
        nodes: npt.NDArray[np.integer],
        temperature: npt.ArrayLike | None = None,
        *,
        n_slave: int,
    ) -> Array | None:
        """Toughness by mode that a bond dissipates once released, shape (n, 3) [force/length].

        Arguments and errors as for :meth:`toughness_at`.

        Returns:
            None where it is the toughness of onset.
        """
        return None

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
