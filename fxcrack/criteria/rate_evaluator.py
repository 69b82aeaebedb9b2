"""Energy release rates at the tips of one interface, and f of the mode-mix law made of them.

What is measured (bond forces, openings, displacements of a ring of cells) is linear between two
equilibria; rates are made of it by the method of the criterion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.criteria.closure_openings import ClosureOpenings
from fxcrack.criteria.crack_closure import closure_rates, closure_weights, weighted_rates
from fxcrack.criteria.domain_integral import DomainIntegral, DomainValues, domain_rates
from fxcrack.criteria.evaluator import SofteningEvaluator, TipValues, first_tips
from fxcrack.criteria.interface_temperature import InterfaceTemperature
from fxcrack.criteria.ligaments import Ligaments
from fxcrack.criteria.mixed_mode import total
from fxcrack.criteria.mode_length import ModesAtLength, lengths_of_closure, warn_of_turning_modes
from fxcrack.criteria.probe import (
    FrontProbe,
    State,
    bond_forces,
    closure_jumps,
    closure_units,
    openings,
)
from fxcrack.criteria.release_laws import ReleaseLaw
from fxcrack.equilibrium.cohesive_law import CohesiveUnit
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.interface.hierarchy import CLOSURE_BY_CORNERS
from fxcrack.interface.tips import FrontUnits, Tips, edge_midsides, units_of

if TYPE_CHECKING:
    from fxcrack.criteria.energy_release import RateCriterion


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
        self._openings = ClosureOpenings(probe)
        self._weights = np.zeros((0, 1))
        self._domain: DomainIntegral | None = None
        if criterion.method == "domain":
            self._domain = DomainIntegral(probe, criterion.rings, criterion.reference_length)
        self._modes: ModesAtLength | None = None
        if criterion.mode_length is not None:
            self._modes = ModesAtLength(probe, criterion.mode_length)
        elif criterion.mix is not None and criterion.method != "domain":
            warn_of_turning_modes(probe)
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
        if criterion.method == "closure" and surface.dim == 2:
            _warn_of_rows(probe)
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
            if self.criterion.normalisation == "equal_length":
                opening = self._openings.measure(tips, state)
            else:
                opening = openings(self.probe, tips, state)
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

    def needs(self, tips: Tips) -> Ints:
        """On uneven spacing the second corner node behind each tip, shape (m,)."""
        criterion = self.criterion
        if criterion.method == "closure" or criterion.normalisation != "equal_length":
            return np.zeros(0, dtype=np.int64)
        return self._openings.needs(tips)

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
            weights = np.repeat(0.5 / tips.area[:, None], force.shape[1], axis=1)
            plain = closure_rates(force, opening, tips.area, signed=signed)
        else:
            weights = self._closure_weights(tips, force.shape[1])
            plain = weighted_rates(force, opening, weights)
        if self._modes is None:
            return plain
        lengths = lengths_of_closure(tips, force.shape[1], self.criterion.method)
        return self._modes.split(tips, force, opening, weights, plain, lengths)

    def _closure_weights(self, tips: Tips, n_products: int) -> Array:
        """What multiplies the products of force and opening, shape (n, k) [1/length^2]."""
        if tips is not self._weighed:
            lengths = (tips.d_ahead, tips.d_behind, tips.width)
            self._weights = closure_weights(
                *lengths, n_products, self.criterion.normalisation, tips.straight
            )
            if self._largest_unit:
                self._weights = self._weights / CLOSURE_BY_CORNERS
            self._weighed = tips
        return self._weights

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


def _warn_of_rows(probe: FrontProbe) -> None:
    """Warn where releasing one node of a front says little of releasing its row."""
    if probe.pair.interface.stiffness is not None:
        log.warn(
            "interface '%s': method='closure' releases one node of a front while the compliant "
            "bonds beside it hold, so that G is too small (by 5 %% in single leg bending, with a "
            "mode II fraction of 0.43 instead of 0.37); take method='vcct'",
            probe.pair.title,
        )


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
