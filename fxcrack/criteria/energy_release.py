"""What VCCT, enhanced VCCT and fatigue share: toughness by mode, mode mix, how G is computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, Literal, cast

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.checks import (
    format_point,
    keep_floats,
    not_negative,
    one_of,
    positive,
    whole,
)
from fxcrack.base.errors import InputError
from fxcrack.criteria.closure_lengths import LARGEST_RATIO, opening_shares, uneven
from fxcrack.criteria.crack_closure import (
    NORMALISATIONS,
    Normalisation,
    closure_rates,
    closure_weights,
    weighted_rates,
)
from fxcrack.criteria.criterion import Criterion
from fxcrack.criteria.domain_integral import RINGS, DomainIntegral, DomainValues, domain_rates
from fxcrack.criteria.evaluator import SofteningEvaluator, TipValues, first_tips
from fxcrack.criteria.interface_temperature import InterfaceTemperature
from fxcrack.criteria.ligaments import Ligaments
from fxcrack.criteria.mixed_mode import BK, MixedMode, law_of, total
from fxcrack.criteria.probe import (
    FrontProbe,
    State,
    bond_forces,
    closure_jumps,
    closure_units,
    further_openings,
    openings,
)
from fxcrack.criteria.release_laws import Driver, ReleaseLaw
from fxcrack.criteria.toughness import Property, check_property, resolve
from fxcrack.equilibrium.cohesive_law import CohesiveUnit
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.interface.hierarchy import CLOSURE_BY_CORNERS
from fxcrack.interface.tips import FrontUnits, Tips, edge_midsides, units_of

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
        reference_length: Length to which the modes belong where the two sides are of different
            materials [length]; see :mod:`~fxcrack.criteria.crack_tip_fields`.
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


class RateEvaluator(SofteningEvaluator):
    """Energy release rates by crack closure, for VCCT and the criteria built on it.

    Args:
        probe: The interface.
        criterion: Criterion with toughness and mode mix.
        temperature: Temperature of the slave nodes; None without.
        softens: Whether bonds soften with their opening: second-order fronts are then released by
            element edges, and f is that of the edge.
    """

    toughness: Array
    ligaments: Ligaments | None = None

    def __init__(
        self,
        probe: FrontProbe,
        criterion: RateCriterion,
        temperature: InterfaceTemperature | None = None,
        *,
        softens: bool = False,
    ) -> None:
        self.probe = probe
        self.criterion = criterion
        self._edges = edge_midsides(probe.front.surface) if softens else {}
        self._grouped: tuple[Tips, FrontUnits] | None = None
        self._weighed: Tips | None = None
        self._shared: tuple[Tips, Array | None, Ints] | None = None
        self._uneven_said = False
        self._weights = np.zeros((0, 1))
        self._domain: DomainIntegral | None = None
        if criterion.method == "domain":
            self._domain = DomainIntegral(probe, criterion.rings, criterion.reference_length)
        hierarchy = probe.pair.hierarchy
        self._largest_unit = 0 if hierarchy is None else 1 + hierarchy.most_beside()
        surface = probe.pair.surface
        criterion.check_slaves(surface.n_nodes)
        if softens and criterion.needs_exact_S and not criterion.softens:
            # The energy of releasing the node is the one its bond is to dissipate: the bond softens
            # as fast as the bodies unload.
            log.warn(
                "interface '%s': a bond whose onset is found by method='closure' is neutral there "
                "and runs open at once, as with StepRelease, though its release is to follow the "
                "opening; wide fronts carry a third too much so. Take method='vcct', or use "
                "StepRelease",
                probe.pair.title,
            )
        x = surface.x[:, : probe.gdim]
        self._temperature = temperature
        self._moving = temperature is not None and not temperature.steady
        at_start = None if temperature is None else temperature(0.0)
        self.toughness = criterion.toughness_at(x, np.arange(len(x)), at_start, n_slave=len(x))

    @property
    def degree(self) -> float | None:
        """That of the criterion; toughness that changes in time leaves none."""
        return None if self._moving else self.criterion.degree

    def measure(self, tips: Tips, state: State, time: float) -> Array:
        """Tip forces [force] and the openings they are multiplied with [length], shape (n, 6 k).

        A further column holds the temperature of the tips where it changes in time; then comes what
        method="domain" measures.
        """
        force = bond_forces(self.probe, tips, state)
        # what nothing pulls apart would otherwise grow under loads of 1e10 and more
        noise = self.probe.round_off(tips.force_nodes, state).max(axis=1)
        force = np.where(np.abs(force) < noise[:, None, None], 0.0, force)
        if self._closes_units:
            force, opening = closure_units(self.probe, tips, force, state, self._rows(tips))
        elif self.criterion.method == "closure":
            opening = closure_jumps(self.probe, tips, force)
        else:
            opening = self._openings(tips, state)
            if force.shape[1] == 2:
                # on a ring the midside force belongs to its own circumference
                breadth = self.probe.front.surface.breadth
                force[:, 1] *= (breadth[tips.node] / breadth[tips.force_nodes[:, 1]])[:, None]
        if self.ligaments is not None:
            normalisation = self.criterion.normalisation
            self.ligaments.put(self.probe, tips, state, normalisation, force, opening)
        columns = [force.reshape(len(tips), -1), opening.reshape(len(tips), -1)]
        if self._moving and self._temperature is not None:
            columns.append(self._temperature(time)[tips.node, None])
        if self._domain is not None:
            columns.append(self._domain.measure(tips, state, force))
        return np.concatenate(columns, 1)

    @property
    def _closes_units(self) -> bool:
        """Whether a corner is closed together with the midside nodes that open with it."""
        return self._largest_unit > 0 and self.criterion.method == "closure"

    def _rows(self, tips: Tips) -> int:
        """Nodes per tip whose forces and openings are measured."""
        return self._largest_unit if self._closes_units else int(tips.force_nodes.shape[1])

    def _openings(self, tips: Tips, state: State) -> Array:
        """Openings that the forces at tips are multiplied with, shape (n, k, 3), length."""
        opening = openings(self.probe, tips, state)
        if self.criterion.normalisation != "equal_length":
            return opening
        shares, rows = self._shares_of(tips)
        if shares is None:
            return opening
        far = np.zeros((len(tips), 1, 3))
        far[rows, 0] = further_openings(self.probe, tips, rows, state)
        return np.asarray(np.einsum("nkj,njc->nkc", shares, np.concatenate([opening, far], axis=1)))

    def _shares_of(self, tips: Tips) -> tuple[Array | None, Ints]:
        """Shares of the measured openings, None where spacing is even; tips that need the further.

        The second has shape (m,).
        """
        if self._shared is None or self._shared[0] is not tips:
            behind, none = tips.d_behind, np.zeros(0, dtype=np.int64)
            # an opening that does not lie behind the force on one line stays where it is
            ahead = np.where(tips.straight, tips.d_ahead, behind)
            if not uneven(ahead, behind).any():
                self._shared = tips, None, none
            else:
                self._look_at_lengths(tips)
                shares = opening_shares(ahead, behind, tips.d_further, tips.force_nodes.shape[1])
                rows = np.flatnonzero(np.any(shares[:, :, -1] != 0.0, axis=1))
                self._shared = tips, shares, rows
        return self._shared[1:]

    def _look_at_lengths(self, tips: Tips) -> None:
        """Warn once where lengths behind and ahead differ by more than is calibrated."""
        on = (tips.d_ahead > 0.0) & tips.straight
        ratio = np.divide(tips.d_ahead, tips.d_behind, out=np.ones(len(tips)), where=on)
        far = np.maximum(ratio, 1.0 / ratio)
        i = int(np.argmax(far))
        if self._uneven_said or far[i] <= LARGEST_RATIO * (1.0 + 1e-6):
            return
        self._uneven_said = True
        log.warn(
            "interface '%s': at the tip at %s the elements are %.4g long behind it and %.4g "
            "ahead, a ratio of %.3g; virtual crack closure is calibrated for ratios up to %g, and "
            "G may be off by more than 5 %% there: grade the mesh in several steps, or take "
            "method='closure'",
            self.probe.pair.title,
            format_point(self.probe.pair.surface.x[tips.node[i]]),
            tips.d_behind[i],
            tips.d_ahead[i],
            far[i],
            LARGEST_RATIO,
        )

    def needs(self, tips: Tips) -> Ints:
        """On uneven spacing the second corner node behind each tip, shape (m,)."""
        criterion = self.criterion
        if criterion.method == "closure" or criterion.normalisation != "equal_length":
            return np.zeros(0, dtype=np.int64)
        _, rows = self._shares_of(tips)
        return np.unique(tips.further_nodes[rows])

    def rates(self, tips: Tips, measured: Array) -> Array:
        """Energy release rates by mode, shape (n, 3), force/length.

        Args:
            tips: Front nodes.
            measured: From :meth:`measure`.
        """
        return self._rates(tips, measured, self._integrals(tips, measured))

    def _rates(self, tips: Tips, measured: Array, found: DomainValues | None) -> Array:
        """The same, with what method="domain" has found."""
        half = 3 * self._rows(tips)
        force, opening = (
            m.reshape(len(tips), -1, 3) for m in (measured[:, :half], measured[:, half : 2 * half])
        )
        force = _real(force)
        if found is not None:
            rates = domain_rates(found, opening, contact=self.probe.pair.interface.contact)
            # where no bond is pulled, the ring holds round-off alone
            rates = np.where(force.any(axis=(1, 2))[:, None], rates, 0.0)
            if not tips.ligament.any():
                return rates
            # a crack that grows from both sides at once is no extension of one tip
            return np.where(tips.ligament[:, None], self._closed(tips, force, opening), rates)
        return self._closed(tips, force, opening)

    def _closed(self, tips: Tips, force: Array, opening: Array) -> Array:
        """Rates by crack closure, shape (n, 3), force/length."""
        if self.criterion.method == "closure":
            signed = 1 if self._closes_units else None
            return closure_rates(force, opening, tips.area, signed=signed)
        if tips is not self._weighed:
            lengths = (tips.d_ahead, tips.d_behind, tips.width)
            self._weights = closure_weights(
                *lengths, force.shape[1], self.criterion.normalisation, tips.straight
            )
            if self._largest_unit:
                self._weights = self._weights / CLOSURE_BY_CORNERS
            self._weighed = tips
        return weighted_rates(force, opening, self._weights)

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """Values f and the energy release rates.

        Args:
            tips: Front nodes.
            measured: From :meth:`measure`.

        Returns:
            f, shape (n,), and "GI", "GII", "GIII", each of shape (n,) [force/length]; of
            method="domain" the intensity factors "KI", "KII", "KIII" as well
            [force/length^1.5].
        """
        found = self._integrals(tips, measured)
        rates = self._rates(tips, measured, found)
        toughness = self._toughness(tips, measured)
        report = dict(zip(("GI", "GII", "GIII"), rates.T, strict=True))
        if found is not None:
            report |= dict(zip(("KI", "KII", "KIII"), found.factors.T, strict=True))
        if not self._edges:
            return self.criterion.ratio(rates, toughness), report
        units = self.units(tips)
        n = units.shares.shape[1]
        rates, toughness = (units.mean(v.reshape(-1, n, 3)) for v in (rates, toughness))
        f = self.criterion.ratio(rates.reshape(-1, 3), toughness.reshape(-1, 3))
        return units.at_tips(f.reshape(rates.shape[:2])).ravel(), report

    def _integrals(self, tips: Tips, measured: Array) -> DomainValues | None:
        """What method="domain" finds, ``None`` for the others."""
        if self._domain is None:
            return None
        return self._domain.values(tips, measured[:, self._columns_before(tips) :])

    def _columns_before(self, tips: Tips) -> int:
        """Columns of what is measured before those of method="domain"."""
        return 6 * self._rows(tips) + int(self._moving)

    def _temperature_column(self, tips: Tips, measured: Array) -> Array:
        return np.asarray(measured[:, 6 * self._rows(tips)])

    def units(self, tips: Tips) -> FrontUnits:
        """Tips that are released together; of tips that were repeated, those of the first time."""
        if self._grouped is None or self._grouped[0] is not tips:
            once = np.unique(tips.node).size
            self._grouped = tips, units_of(self._edges, first_tips(tips, once))
        return self._grouped[1]

    def _tip_temperature(self, tips: Tips, measured: Array | None) -> Array | None:
        if self._temperature is None:
            return None
        if self._moving and measured is not None:
            return self._temperature_column(tips, measured)
        return self._temperature(0.0)[tips.node]

    def _toughness(self, tips: Tips, measured: Array | None) -> Array:
        """Toughness by mode at the tips, shape (n, 3), force/length."""
        if not self._moving or measured is None:
            return self.toughness[tips.node]
        surface = self.probe.pair.surface
        x = surface.x[tips.node, : self.probe.gdim]
        at = self._temperature_column(tips, measured)
        return self.criterion.toughness_at(x, tips.node, at, n_slave=surface.n_nodes)

    def to_soften(self, nodes: Ints, values: TipValues, release: ReleaseLaw) -> list[CohesiveUnit]:
        """Nodes that soften by one law each, and the energy it dissipates until they are free.

        All nodes of a unit share a law: their forces, pressed ones included, fall in proportion,
        and together they dissipate the energy per area of the law times the area the front sweeps
        when the unit is released.

        Args:
            nodes: All nodes that are released now, shape (n,).
            values: Values of the criterion at the front they are part of.
            release: How they are released.

        Raises:
            NotPositiveDefinite: A body would come free: its last unit frees unbounded energy.
        """
        front = self.probe.front
        tips, units = values.tips, self.units(values.tips)
        rates = np.stack([values.report[k] for k in ("GI", "GII", "GIII")], axis=1)
        toughness = self._toughness(tips, values.measured)
        propagation = self.criterion.propagation_toughness_at(
            self.probe.pair.surface.x[tips.node, : self.probe.gdim],
            tips.node,
            self._tip_temperature(tips, values.measured),
            n_slave=front.surface.n_nodes,
        )
        if propagation is not None:
            toughness = propagation
        rates, toughness = units.mean(rates), units.mean(toughness)
        critical = self.criterion.critical(rates, toughness)
        if propagation is None:
            critical = release.spent(total(rates), critical)
        if np.any(critical > UNBOUNDED_RATE * toughness[:, 0]):
            worst = units.leaders[np.argmax(critical)]
            raise NotPositiveDefinite(int(tips.node[worst]))
        out, left = [], np.unique(nodes)
        bonded = front.bonded.copy()
        # a corner row that two edges share belongs to the one that is more critical; rows that are
        # released alone (fatigue) come last
        order = np.argsort(-values.f[units.leaders], kind="stable")
        groups = [(k, units.leaders[k], units.shares[k] > 0.0) for k in order]
        for i in np.setdiff1d(np.arange(len(tips)), units.leaders):
            groups.append((np.argmax(units.shares[:, i]), i, np.arange(len(tips)) == i))
        for k, first, rows in groups:
            if tips.node[first] not in left:
                continue
            unit = np.intersect1d(tips.force_nodes[rows], left)
            left = np.setdiff1d(left, unit)
            area = front.swept(int(tips.node[first]), unit)
            # on a plane of symmetry the other half dissipates as much
            energy = float(critical[k] * area) / self.probe.pair.interface.opening_factor
            every = self.probe.pair.opened_with(bonded, unit)
            bonded[every] = False
            out.append(CohesiveUnit(every, energy, bool(rates[k, 0] <= 0.0), area))
        return out

    def breaks(self) -> tuple[float, ...]:
        """Rates do not depend on time as such; a temperature does."""
        return self._temperature.breaks() if self._temperature is not None else ()


_NO_MODE = 1e-11
"""Forces of a mode below this fraction of the largest are round-off. A mode so weak would have
1e-22 of the rate of the others; alone, beside pressure, it would require unbounded loads."""


def _real(force: Array) -> Array:
    """Bond forces without the modes that are there by round-off alone, shape (n, k, 3)."""
    size = np.abs(force).max(axis=1, initial=0.0)
    none = size < _NO_MODE * size.max(axis=1, keepdims=True, initial=0.0)
    return np.where(none[:, None], 0.0, force)


UNBOUNDED_RATE = 1e50
"""Rates beyond this multiple of the toughness belong to units that hold a body alone."""
