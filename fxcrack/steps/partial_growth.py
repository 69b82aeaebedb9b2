"""Fronts that advance through their elements in part, block of cycles by block of cycles.

In a block no node passes more than a part of its element. The bodies are solved at its beginning
and at the end that the rates at the beginning predict; in between the rate of each node is
log-linear in N, so that the second solution corrects the block. A node is released once its
element is passed; its ligament (:mod:`fxcrack.criteria.ligaments`) carries nothing by then.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import ComesApart, InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.criteria import Fatigue, Regime
from fxcrack.criteria.evaluator import TipValues
from fxcrack.equilibrium.cohesive_law import CohesiveBond
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.interface.pair import Pair, with_friction
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.crack import Crack
from fxcrack.steps.cycle_state import TipCycle
from fxcrack.steps.element_growth import advance, cyclic_parts, lengths_of

_STEP = 0.25
"""Part of its element that a node passes in a block at most."""
_LEAST = 1e-3
"""Smaller parts are not tried, where the front comes to the threshold for instance."""
_CHANGE = 1.0
"""Largest change of the logarithm of a growth rate in a block. A node that is ahead of its
neighbours slows down: with rates that follow a high power of G, longer blocks would overshoot."""
_SLENDER = 1.5
"""Length over width of elements from which on a warning is given."""
_SLOW = 0.05
"""Nodes slower than this fraction of the fastest do not decide on the length of a block."""
_DONE = 0.995
"""Part of an element at which its node is released with others."""

Event = Literal["growth", "unstable", "arrest", "limit"]


@dataclass(frozen=True)
class Block:
    """What a block of cycles has led to.

    Attributes:
        event: As of :class:`~fxcrack.criteria.cycle_jump.CycleJump`.
        seen: The stabilised cycle at its end, per interface.
    """

    event: Event
    seen: list[TipCycle]


def attach_ligaments(analysis: Analysis) -> None:
    """Let the evaluators of all active cracks know of elements that are passed in part.

    Raises:
        InputError: Some cracks grow in part and others do not, or where that is not possible.
    """
    ways = {cyclic_parts(g)[0].partial for g in analysis.active}
    if ways >= {True, False}:
        raise InputError(
            "Cycles: some interfaces have Fatigue(partial=True) and others have not; give all of "
            "them the same, or let them grow in steps of their own, grow=[...]"
        )
    if not grows_in_part(analysis):
        _warn_of_jumps(analysis)
        return
    if analysis.condensed.system.friction is not None:
        raise InputError(
            "Cycles: Fatigue(partial=True) is not available with friction: what is left of a bond "
            "would rub; leave friction or partial=True out"
        )
    for g in analysis.active:
        method = cyclic_parts(g)[0].method
        if method != "vcct":
            raise InputError(
                f"interface '{g.title}': Fatigue(method='{method}') cannot grow in part beside "
                "interfaces with partial=True; take method='vcct', or let them grow in steps of "
                "their own, grow=[...]"
            )
        if analysis.continuum.order > 1:
            raise InputError(
                f"interface '{g.title}': Fatigue(partial=True) is available for first-order "
                "elements only; use them, or partial=False"
            )
        cyclic_parts(g)[1].ligaments = analysis.fatigue.ligaments[g.p]
        tips = g.tips()
        if g.front.surface.dim == 2 and len(tips):
            slender = float(np.median(advance(tips) / tips.width))
            key = f"long elements of {g.title}"
            if slender > _SLENDER and key not in analysis.said:
                analysis.said.add(key)
                log.warn(
                    "interface '%s': elements at the front are %.3g times as long in the growth "
                    "direction as they are wide; with growth in part (partial=True, the "
                    "default in 3-D) lives then depend on the mesh by more than 10 %%: make them "
                    "at most as long as wide",
                    g.title,
                    slender,
                )


def _warn_of_jumps(analysis: Analysis) -> None:
    """Warn, once per crack, of fronts in 3-D whose nodes are released one after the other.

    A node ahead of its neighbours has a small rate, which the cycles of its element pay for with
    the power of the growth law. A front one element wide advances as a straight line.
    """
    for g in analysis.active:
        key = f"jumps of {g.title}"
        if g.front.surface.dim < 2 or len(g.tips()) <= 2 or key in analysis.said:
            continue
        analysis.said.add(key)
        log.warn(
            "interface '%s': without Fatigue(partial=True) (%s) nodes of a front in 3-D jump one "
            "after the other, the rate at a node ahead of its neighbours is low, and cycles come "
            "out too many: 10 to 100 times in a double cantilever beam at an exponent of 4",
            g.title,
            _why_by_node(analysis) or "partial=False",
        )


def grows_in_part(analysis: Analysis) -> bool:
    """Whether fronts advance through their elements in part.

    Where no interface says so, they do in 3-D, if that is possible, and where a front has begun to
    in an earlier step.
    """
    ways = {cyclic_parts(g)[0].partial for g in analysis.active}
    if True in ways or False in ways:
        return True in ways
    begun = any((analysis.fatigue.ligaments[g.p].part > 0.0).any() for g in analysis.active)
    return begun or not _why_by_node(analysis)


def _why_by_node(analysis: Analysis) -> str:
    """Why the fronts of an analysis do not grow in part by default, in words."""
    criteria = [cyclic_parts(g)[0] for g in analysis.active]
    return why_by_node(analysis.continuum, analysis.pairs, criteria, linear=analysis.linear)


def why_by_node(
    continuum: Continuum, pairs: Sequence[Pair], criteria: Sequence[Fatigue], *, linear: bool
) -> str:
    """Why fronts do not grow in part by default, in words; empty where they do.

    Args:
        continuum: The bodies.
        pairs: All interfaces.
        criteria: Criteria of the interfaces that grow together.
        linear: Whether the bodies are linear.
    """
    if all(pair.surface.dim < 2 for pair in pairs):
        return "a model in the plane"
    if not linear:
        return "bodies are not linear"
    if isinstance(continuum, ShellBodies) or any(
        isinstance(m, ContinuumShell) for m in continuum.part_materials
    ):
        return "shells"
    if continuum.order > 1:
        return "elements of second order"
    if with_friction(pairs):
        return "friction"
    others = [c.method for c in criteria if c.method != "vcct"]
    if others:
        return f"method='{others[0]}'"
    return "credit=True" if any(c.credit for c in criteria) else ""


class PartialGrowth:
    """Advance of fronts through their elements.

    Args:
        analysis: The analysis, at the maximum of the cycle.
        cycle: Solves a stabilised cycle.
        limit: Cycles at which the analysis ends.

    Attributes:
        block: Part of its element that a node passes in the next block at most.
    """

    def __init__(
        self, analysis: Analysis, cycle: Callable[[], list[TipCycle]], limit: float
    ) -> None:
        self._analysis = analysis
        self._cycle = cycle
        self._limit = limit
        self.block = _STEP

    # -- all tips, one interface after the other -------------------------------------------

    def _gather(self, of: Callable[[Crack, TipValues], Array]) -> Array:
        parts = [of(g, v) for g, v in self._analysis.at_tips()]
        return np.concatenate([np.zeros(0), *parts])

    def _parts(self) -> Array:
        """Passed parts phi of the elements, shape (n_tips,)."""
        ligaments = self._analysis.fatigue.ligaments
        return self._gather(lambda g, v: ligaments[g.p].part[v.tips.node])

    def _speeds(self, seen: list[TipCycle]) -> Array:
        """Parts of their elements that nodes pass per cycle, shape (n_tips,)."""
        out = []
        for (g, v), found in zip(self._analysis.at_tips(), seen, strict=True):
            law = cyclic_parts(g)[0].growth_law
            grows = law.regimes(found.rates) == Regime.PARIS
            waits = self._analysis.fatigue.waiting[g.p][v.tips.node]
            out.append(np.where(grows & ~waits, law.growth(found.rates) / advance(v.tips), 0.0))
        return np.concatenate([np.zeros(0), *out])

    def _onsets(self, seen: list[TipCycle]) -> Array:
        """Cycles at which nodes that wait begin to grow, inf for the others, shape (n_tips,)."""
        out = []
        for (g, v), found in zip(self._analysis.at_tips(), seen, strict=True):
            law = cyclic_parts(g)[0].growth_law
            may = law.regimes(found.rates) == Regime.PARIS
            waits = self._analysis.fatigue.waiting[g.p][v.tips.node]
            out.append(np.where(waits & may, law.onset(found.rates), np.inf))
        return np.concatenate([np.zeros(0), *out])

    def _split(self, values: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
        counts = np.cumsum([len(v.tips) for v in self._analysis.tip_values])
        return np.split(values, counts[:-1])

    def until_release(self, seen: list[TipCycle]) -> Block:
        """Advance the fronts until a node is released, or none grows any more; collective.

        Args:
            seen: The stabilised cycle in the present state, per interface.
        """
        while True:
            event, seen = self._block(seen)
            if event is not None:
                # fronts have moved since tips were found
                self._analysis.evaluate_tips()
                return Block(event, seen)

    # -- one block -------------------------------------------------------------------------

    def _block(self, seen: list[TipCycle]) -> tuple[Event | None, list[TipCycle]]:
        """One block of cycles; what ends the growth, if anything, and the cycle after it."""
        fatigue = self._analysis.fatigue
        unstable = np.concatenate([
            np.zeros(0, dtype=bool),
            *(
                cyclic_parts(g)[0].growth_law.regimes(found.rates) == Regime.UNSTABLE
                for (g, _), found in zip(self._analysis.at_tips(), seen, strict=True)
            ),
        ])  # fmt: skip
        begin, onsets = self._parts(), self._onsets(seen)
        if unstable.any():
            if fatigue.N + 1.0 > self._limit:
                return "limit", self._stand(seen)
            end = np.minimum(begin + self._speeds(seen), 1.0)
            return self._end("unstable", seen, begin, np.where(unstable, 1.0, end), 1.0)
        self._initiate(onsets <= fatigue.N * (1.0 + 1e-12))
        speed = self._speeds(seen)
        onsets = self._onsets(seen)
        following = float(onsets.min(initial=np.inf)) - fatigue.N
        if not (speed > 0.0).any():
            if not np.isfinite(following):
                self._tabulate(seen, begin, np.zeros(len(speed), dtype=bool))
                return "arrest", seen
            if fatigue.N + following > self._limit:
                return "limit", self._stand(seen)
            fatigue.N += following
            self._initiate(onsets <= fatigue.N * (1.0 + 1e-12))
            return None, seen
        with np.errstate(divide="ignore"):
            needed = np.where(speed > 0.0, np.minimum(self.block, 1.0 - begin) / speed, np.inf)
        lead = int(needed.argmin())
        cycles = min(float(needed[lead]), following)
        while True:
            self._set(np.minimum(begin + cycles * speed, 1.0), seen)
            after = self._speeds(self._cycle())
            change = _largest_change(speed, after)
            moved = float(cycles * speed[lead])
            if moved <= _LEAST or (after[lead] > 0.0 and change <= _CHANGE):
                break
            cycles *= 0.5
            self.block = max(0.5 * moved, _LEAST)
        if change < 0.5 * _CHANGE:
            self.block = min(1.5 * self.block, _STEP)
        taken = moved / _log_mean(speed, after)[lead]
        event: Event | None = None
        if fatigue.N + taken > self._limit:
            taken, event = self._limit - fatigue.N, "limit"
        end = np.minimum(begin + taken * _log_mean(speed, after), 1.0)
        return self._end(event, seen, begin, end, taken)

    def _stand(self, seen: list[TipCycle]) -> list[TipCycle]:
        """The remaining cycles pass without growth."""
        self._tabulate(seen, self._parts(), np.zeros(len(self._parts()), dtype=bool))
        self._analysis.fatigue.N = self._limit
        return seen

    def _initiate(self, over: Bools) -> None:
        """Onset is over at some tips, shape (n_tips,)."""
        for (g, v), mine in zip(self._analysis.at_tips(), self._split(over), strict=True):
            self._analysis.fatigue.waiting[g.p][v.tips.node[mine]] = False

    def _end(
        self, event: Event | None, seen: list[TipCycle], begin: Array, end: Array, cycles: float
    ) -> tuple[Event | None, list[TipCycle]]:
        """Fronts at the end of a block; release what has passed its element."""
        analysis = self._analysis
        done = end >= _DONE
        self._tabulate(seen, begin, done)
        analysis.fatigue.N += cycles
        self._set(end, seen, done)
        if done.any():
            analysis.update_tips()
            event = event or "growth"
        if not any(len(v.tips) for v in analysis.tip_values):
            return event, []
        return event, self._cycle()

    def _tabulate(self, seen: list[TipCycle], parts: Array, released: Bools) -> None:
        """Keep the cycle at the beginning of a block in the table of tips."""
        fatigue = self._analysis.fatigue
        at, passed, gone = self._analysis.at_tips(), self._split(parts), self._split(released)
        for (g, v), found, part, mine in zip(at, seen, passed, gone, strict=True):
            tips = v.tips
            if g.front.surface.dim == 1:
                grown = part * advance(tips)
            else:
                grown = np.full(len(tips), g.extent.over_front(float(part @ tips.area)))
            lengths = (np.array(lengths_of(g, tips)) + grown).tolist()
            fatigue.tabulate(fatigue.N, g.title, tips.node, lengths, found, mine)

    # -- ligaments -------------------------------------------------------------------------

    def _set(self, parts: Array, seen: list[TipCycle], done: Bools | None = None) -> None:
        """Move the fronts, and release nodes; bonds of no work at closure stay as they are.

        Args:
            parts: Passed parts of the elements, shape (n_tips,).
            seen: The cycle in the state from which the fronts move.
            done: Nodes to release, shape (n_tips,).
        """
        done = np.zeros(len(parts), dtype=bool) if done is None else done
        for i, (g, v) in enumerate(self._analysis.at_tips()):
            if len(v.tips):
                self._set_front(g, v, seen[i], self._split(parts)[i], self._split(done)[i])

    def _set_front(
        self, g: Crack, values: TipValues, seen: TipCycle, part: Array, done: Bools
    ) -> None:
        analysis, tips = self._analysis, values.tips
        ligaments = analysis.fatigue.ligaments[g.p]
        new = np.flatnonzero((part > 0.0) & np.isnan(ligaments.stiffness[tips.node, 0]))
        if len(new):
            # loads may be out of phase: this node's rate is largest at an instant of its own
            measured = seen.peak[new]
            good = ligaments.begin(tips, new, measured[:, :3], measured[:, 3:6])
            part = part.copy()
            part[new[~good]] = 0.0
        ligaments.part[tips.node] = np.where(done, 0.0, part)
        nodes = np.unique(tips.force_nodes[done]) if done.any() else np.zeros(0, dtype=np.int64)
        if len(nodes):
            g.record(nodes, values, analysis.solver.state, analysis.fatigue.N)
            ligaments.stiffness[nodes] = np.nan
            analysis.fatigue.waiting[g.p][nodes] = False
        soft, before = analysis.condensed.system.soft, analysis.solver.state
        taken = soft.taken(before.jump)
        energy, work = renew_ligaments(analysis, g, ligament_bonds(analysis, g), nodes)
        taken = analysis.condensed.system.soft.taken(analysis.solver.state.jump) - taken
        analysis.balance.released += energy
        analysis.balance.by_force += energy - taken
        analysis.balance.external_work += work


def ligament_bonds(analysis: Analysis, g: Crack) -> list[CohesiveBond]:
    """What is left of the bonds of a crack in elements that its front has passed in part."""
    ligaments, index = analysis.fatigue.ligaments[g.p], analysis.condensed.index[g.p]
    # k belongs to openings of the whole crack, bonds to jumps of their nodes
    factor = g.debond.interface.opening_factor
    bonds = []
    for node in np.flatnonzero(ligaments.part > 0.0):
        part = float(ligaments.part[node])
        for local in range(index.shape[1]):
            stiffness = factor * float(ligaments.stiffness[node, min(local, 1)])
            if index[node, local] < 0 or not np.isfinite(stiffness):
                continue
            bonds.append(
                CohesiveBond(
                    index[node, [local]], np.ones(1), stiffness, 1.0,
                    (g.p, np.array([node]), np.array([local])), part, fixed=True,
                )
            )  # fmt: skip
    return bonds


def renew_ligaments(
    analysis: Analysis, g: Crack, bonds: list[CohesiveBond], released: Ints
) -> tuple[float, float]:
    """Put other ligaments in place of those of a crack, and release nodes, at constant load.

    Args:
        analysis: The analysis.
        g: The crack.
        bonds: Its ligaments from now on.
        released: Slave nodes that are released, shape (n,).

    Returns:
        Energy released by the forces of bonds on their way, and external work.

    Raises:
        NotPositiveDefinite: A body would come free; nothing is changed.
        ComesApart: Likewise.
    """
    solver = analysis.condensed
    system, state, saved = solver.system, solver.state, solver.interface_state()
    others = [b for b in system.soft.bonds if not (b.fixed and b.where[0] == g.p)]
    force = state.force.copy()
    mine = np.concatenate([np.zeros(0, dtype=np.int64), *(b.components for b in bonds)])
    force[mine] = system.forces(state, mine)
    system.soft.bonds = others + bonds
    system.soft.refresh(system.cholesky)
    solver.state = last = Equilibrium(state.loads, force, state.jump, state.conjugate)
    energy = work = 0.0
    try:
        if len(released):
            solver.open(g.p, released)
            last = solver.state
        given = analysis.given_force(analysis.time)
        for _, point in system.pieces(last, last.loads, given):
            more, out, _ = solver.along(last, point)
            energy, work = energy + out, work + more
            solver.book_contact(last, point)
            last = point
    except (NotPositiveDefinite, ComesApart):
        solver.restore_interfaces(saved)
        raise
    solver.state = last
    return energy, work


def _largest_change(before: Array, after: Array) -> float:
    """Largest change of the logarithm of two rates among those that are not slow."""
    fastest = max(before.max(initial=0.0), after.max(initial=0.0))
    counts = np.maximum(before, after) > _SLOW * fastest
    least = 1e-3 * _SLOW * fastest
    one, two = np.maximum(before[counts], least), np.maximum(after[counts], least)
    return float(np.abs(np.log(two / one)).max(initial=0.0))


def _log_mean(a: Array, b: Array) -> Array:
    """Mean of what is log-linear between two values, half of the first where the second is 0."""
    good = (a > 0.0) & (b > 0.0)
    one, two = np.where(good, a, 1.0), np.where(good, b, 1.0)
    difference = np.log(two / one)
    same = np.abs(difference) < 1e-9
    mean = np.where(same, np.sqrt(one * two), (two - one) / np.where(same, 1.0, difference))
    return np.where(good, mean, 0.5 * a)
