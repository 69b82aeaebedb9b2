"""A crack: an interface with its criterion, tips and extent, and which nodes are released."""

from __future__ import annotations

import inspect
from typing import cast

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point, missing_members, shown
from fxcrack.base.errors import InputError
from fxcrack.criteria import Criterion, ReleaseLaw
from fxcrack.criteria.evaluator import (
    Evaluator,
    SofteningEvaluator,
    TipValues,
    at_rows,
    first_crossing,
)
from fxcrack.criteria.interface_temperature import given_temperature, scene_temperature
from fxcrack.criteria.probe import FrontProbe, openings
from fxcrack.equilibrium.cohesive_law import CohesiveUnit
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.interface.crack_extent import CrackExtent
from fxcrack.interface.surface_paths import SurfacePaths
from fxcrack.interface.tips import Tips
from fxcrack.solvers.base import AnySolver
from fxcrack.steps.bond_records import ReleaseRecord, release_records
from fxcrack.steps.debond import Debond
from fxcrack.steps.release_choice import softens

_TIE = 1e-6
"""Front nodes whose f lies within this fraction of the largest one are released together."""

_OVERLAP = 1e-2
"""Overlaps below this fraction of the relative motion of the faces are not reported."""


class Crack:
    """A debond on a condensed model.

    Args:
        solver: The model.
        p: Number of the pair.
        debond: Interface and criterion.
        law: How its bonds are released in the first step.

    Attributes:
        law: How its bonds are released in the present step.
        probe: The interface as the criterion sees it.
        n_released: Nodes released so far.
        records: What is known of every release, in order.
        paths: Where tips come from.
    """

    def __init__(self, solver: AnySolver, p: int, debond: Debond, law: ReleaseLaw) -> None:
        self.solver = solver
        self.p = p
        self.title = debond.interface.title
        self.debond = debond
        self.criterion = debond.criterion
        self.law = law
        self.front = solver.fronts[p]
        self.extent = CrackExtent(self.front)
        self.probe: FrontProbe = solver.probe(p)
        self.evaluator, *self.watched = (
            make_evaluator(
                solver, self.probe, debond, c,
                softens=c is debond.criterion and softens(debond, law),
            )
            for c in (debond.criterion, *debond.watch)
        )  # fmt: skip
        self._tell_reach()
        self.n_released = 0
        self.records: list[ReleaseRecord] = []
        self.paths = SurfacePaths(self.front)
        self._may_overlap = not debond.interface.contact

    def release_by(self, law: ReleaseLaw) -> None:
        """Release bonds by a law from now on; collective."""
        before, self.law = self.opening_driven, law
        if self.opening_driven != before:
            self.evaluator = make_evaluator(
                self.solver, self.probe, self.debond, self.criterion, softens=self.opening_driven
            )
            self._tell_reach()

    def _tell_reach(self) -> None:
        """Let the solver know how many nodes around a tip are evaluated."""
        every = [self.evaluator, *self.watched]
        self.solver.around[self.p] = (max(e.ahead for e in every), max(e.behind for e in every))

    @property
    def released(self) -> list[tuple[int, float]]:
        """(node, time) of every release in order."""
        return [(r.node, r.DBT) for r in self.records]

    def tips(self) -> Tips:
        """Present front."""
        return self.front.tips()

    def held(self, tips: Tips) -> bool:
        """Whether the retained jumps hold all that evaluating these tips needs."""
        if not len(tips):
            return True
        needed = [tips.force_nodes.ravel(), tips.wake_nodes.ravel()]
        needed += [e.needs(tips) for e in (self.evaluator, *self.watched)]
        hierarchy = self.solver.pairs[self.p].hierarchy
        if hierarchy is not None:
            beside = hierarchy.beside(tips.node)
            needed.append(beside[self.front.bonded[beside]])
        return self.solver.holds(self.p, np.concatenate(needed))

    def check_wake(self, tips: Tips) -> None:
        """Refuse tips whose opening behind cannot be known with any set of retained jumps.

        Raises:
            InputError: A support holds the node behind a tip but not its master in the same way.
        """
        if not self.criterion.needs_wake_openings:
            return
        for i in range(len(tips)):
            tip = at_rows(tips, np.array([i]))
            # what is behind the wake point counts on uneven spacing only
            needed = np.concatenate([tip.wake_nodes.ravel(), self.evaluator.needs(tip)])
            if not self.solver.holds(self.p, needed):
                where = format_point(self.front.surface.x[tips.node[i]])
                raise InputError(
                    f"interface '{self.title}': a support holds a node behind the tip at "
                    f"{where} but not its master in the same "
                    "way, so the opening there cannot be measured; open one more element, take "
                    "method='closure', or end the support before the crack faces"
                )

    def evaluate(self, tips: Tips, state: Equilibrium, time: float) -> TipValues:
        """F at the tips and what is behind it."""
        if not len(tips):
            return TipValues(tips, np.zeros(0), {})
        measured = self.evaluator.measure(tips, state, time)
        f, report = self.evaluator.value(tips, measured)
        for criterion, other in zip(self.debond.watch, self.watched, strict=True):
            found = other.value(tips, other.measure(tips, state, time))[1]
            report = {**_named_apart(found, report, criterion), **report}
        return TipValues(tips, f, report, measured, state)

    def bears(self, tips: Tips, state: Equilibrium) -> Bools:
        """Whether the bonds of tips bear more than round-off in a state, shape (n_tips,)."""
        force = np.abs(self.probe.bond_forces(tips.force_nodes, state)).max(axis=-1)
        return np.asarray((force > self.probe.round_off(tips.force_nodes, state)).any(axis=1))

    def look_for_overlap(self, tips: Tips, state: Equilibrium) -> None:
        """Warn once where faces without contact pass through each other behind a tip."""
        if not self._may_overlap or not len(tips):
            return
        behind = openings(self.probe, tips, state)
        behind = np.where(self.bears(tips, state)[:, None, None], behind, 0.0)
        size = float(np.abs(behind).max())
        if size < max(1e-12 * self.front.surface.facet_size, 1e-9 * np.abs(state.jump).max()):
            return  # round-off
        i, k = np.unravel_index(np.argmin(behind[..., 0]), behind.shape[:2])
        if behind[i, k, 0] < -_OVERLAP * size:
            self._may_overlap = False
            log.warn(
                "interface '%s': the open faces overlap behind the tip at %s, by %.3g, and nothing "
                "keeps them apart; add contact=True to the Interface, or check the sign of the "
                "loads",
                self.title,
                format_point(self.front.surface.x[tips.node[i]]),
                -behind[i, k, 0],
            )

    def crossing(
        self,
        values: TipValues,
        a: Equilibrium,
        b: Equilibrium,
        times: tuple[float, float],
        *,
        upward: bool,
    ) -> float | None:
        """First fraction of the linear way from a to b at which the largest f crosses 1."""
        ends = ((a, times[0]), (b, times[1]))
        return first_crossing(self.evaluator, values.tips, ends, upward=upward, known=values)

    def ready(self, values: TipValues, level: float = 1.0) -> Ints:
        """Positions of the tips to release, the critical one and those tied with it, shape (m,)."""
        if not len(values.f) or values.f.max() < level * (1.0 - 1e-9):
            return np.zeros(0, dtype=np.int64)
        return np.flatnonzero(values.f >= values.f.max() * (1.0 - _TIE))

    @property
    def degree(self) -> float:
        """Power of the load with which f grows, for predictions; 2, as of rates, if unknown."""
        return 2.0 if self.evaluator.degree is None else self.evaluator.degree

    @property
    def opening_driven(self) -> bool:
        """Whether bond forces fall with their opening."""
        return softens(self.debond, self.law)

    def nodes_of(self, values: TipValues, chosen: Ints) -> Ints:
        """Nodes to release where some tips are chosen: where bonds soften, by whole units.

        Args:
            values: Values of the criterion at the front.
            chosen: Positions of tips, shape (m,).

        Returns:
            Slave nodes, sorted, shape (n,).
        """
        tips = values.tips
        if self.opening_driven:
            units = self._softening.units(tips)
            chosen = np.union1d(chosen, np.nonzero(units.shares[np.isin(units.leaders, chosen)])[1])
        return np.unique(tips.force_nodes[chosen])

    def to_soften(self, nodes: Ints, values: TipValues) -> list[CohesiveUnit]:
        """Nodes that soften by one law each, and the energy it dissipates until they are free.

        Progressive release: the critical rate at the present mode mix times the area; enhanced
        VCCT: that of propagation; ramp: half the force times the wake opening at onset.

        Args:
            nodes: Slave nodes that are released now, shape (n,).
            values: Values of the criterion at the front they are part of.
        """
        return joined_units(self._softening.to_soften(nodes, values, self.law), values)

    @property
    def _softening(self) -> SofteningEvaluator:
        """The evaluator, of a criterion that knows its toughness: others never soften."""
        return cast(SofteningEvaluator, self.evaluator)

    def record(self, nodes: Ints, values: TipValues, state: Equilibrium, time: float) -> None:
        """Record slave nodes that are about to be released, shape (n,)."""
        self.n_released += len(nodes)
        self.records += release_records(self, nodes, values, state, time)


def joined_units(units: list[CohesiveUnit], values: TipValues) -> list[CohesiveUnit]:
    """Units that are equally critical, as mirror images or along a front in plane strain, as one.

    Each by a law of its own, one of them would open before the others wherever bonds run through
    unstable states, and round-off would decide which. That holds however far they are from each
    other: the two tips of a crack in the middle of a body are mirror images. Units whose faces are
    pressed together share a law with each other only.

    Args:
        units: Units that are released now.
        values: Values of the criterion at the front.
    """
    f_of = dict(zip(values.tips.node.tolist(), values.f.tolist(), strict=True))
    f = [max((f_of[n] for n in unit.nodes.tolist() if n in f_of), default=0.0) for unit in units]
    out: list[CohesiveUnit] = []
    level, place = np.inf, dict[bool, int]()  # f of the present group, and where its units are
    for i in np.argsort(-np.array(f), kind="stable"):
        unit = units[i]
        if not f[i] >= level * (1.0 - _TIE):
            level, place = f[i], {}
        if unit.pressed in place:
            first = out[place[unit.pressed]]
            nodes = np.union1d(first.nodes, unit.nodes)
            energy, area = first.energy + unit.energy, first.area + unit.area
            out[place[unit.pressed]] = CohesiveUnit(nodes, energy, unit.pressed, area)
        else:
            place[unit.pressed] = len(out)
            out.append(unit)
    return out


def _named_apart(
    found: dict[str, Array], report: dict[str, Array], criterion: Criterion
) -> dict[str, Array]:
    """What a watched criterion reports, with the method, and a number, in names that are taken.

    Args:
        found: Its quantities by name.
        report: What is reported so far.
        criterion: The criterion.
    """
    method = getattr(criterion, "method", type(criterion).__name__)
    suffix, number = f"_{method}", 1
    while True:
        named = {f"{name}{suffix}" if name in report else name: name for name in found}
        if not any(name in report for name in named):
            return {name: found[own] for name, own in named.items()}
        number += 1
        suffix = f"_{method}_{number}"


def make_evaluator(
    solver: AnySolver, probe: FrontProbe, debond: Debond, criterion: Criterion, *, softens: bool
) -> Evaluator:
    """The evaluator of a criterion on an interface; collective.

    Raises:
        InputError: The criterion does not fit the interface, or a temperature is missing or wrong.
    """
    temperature = given_temperature(probe.pair, probe.gdim, debond.temperature)
    if temperature is None and criterion.needs_temperature:
        temperature = scene_temperature(probe.pair, solver.continuum)
    try:
        inspect.signature(criterion.evaluator).bind(probe, temperature, softens=softens)
    except TypeError as error:
        raise InputError(
            f"interface '{probe.pair.title}': {type(criterion).__name__}.evaluator must take "
            f"(probe, temperature, *, softens=False): {error}"
        ) from error
    found = criterion.evaluator(probe, temperature, softens=softens)
    missing = missing_members(found, Evaluator)
    if missing:
        raise InputError(
            f"interface '{probe.pair.title}': {type(criterion).__name__}.evaluator returned "
            f"{shown(found)} ({missing}); it must return an Evaluator, such as "
            "TipEvaluator(probe, function)"
        )
    return found
