"""Equilibria on the way of the loads through a cycle, of linear and of nonlinear bodies.

Bonds and fronts stay as they are within a cycle. Linear bodies are in equilibrium by one dense
solution; nonlinear ones (finite strain, temperature, pressures that follow) by Newton's method from
the last one found, whose tangent is used again. They are elastic, so that equilibria depend on the
loads alone, and the state at the maximum is put back as it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.base.errors import NO_EQUILIBRIUM, ConvergenceError, EnergyImbalance, InputError
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.load_path import LoadPath
from fxcrack.steps.rows import load_columns

_DIVIDED = 8
"""How often a piece of the cycle is halved at most until an equilibrium at its end is found."""


class Corner(NamedTuple):
    """Loads at an instant of the cycle.

    Attributes:
        time: Time, at which amplitudes of a temperature and of pressures that follow are taken.
        loads: Amplitudes of supports and load factors, shape (n_loads,).
    """

    time: float
    loads: Array

    def middle(self, other: Corner) -> Corner:
        """Half way to another one."""
        return self.towards(other, 0.5)

    def towards(self, other: Corner, part: float) -> Corner:
        """A part of the way to another one."""
        rest = 1.0 - part
        return Corner(rest * self.time + part * other.time, rest * self.loads + part * other.loads)


@dataclass(frozen=True)
class Instant:
    """One instant of the cycle.

    Attributes:
        corner: Its loads.
        state: Equilibrium; of nonlinear bodies it is in force at this instant only.
        measured: What evaluators measured per interface; linear between equilibria of linear
            bodies.
        contact: Which nodes are in contact.
        straight: Contact and bonds did not change since the instant before.
    """

    corner: Corner
    state: Equilibrium
    measured: list[Array]
    contact: bytes
    straight: bool

    def follows(self, before: Instant) -> bool:
        """Whether everything is linear between an earlier instant and this one."""
        return self.straight or self.contact == before.contact


class CycleEquilibria(Protocol):
    """Finds equilibria within a cycle; collective.

    Attributes:
        settles: Whether the first cycle is not yet a stabilised one.
        in_order: Whether an instant is found from the one before it in the cycle only, so that a
            piece cannot be halved afterwards.
    """

    @property
    def settles(self) -> bool:
        """As above."""
        ...

    @property
    def in_order(self) -> bool:
        """As above."""
        ...

    def begin(self, corner: Corner) -> Instant:
        """The present state, to which :meth:`end` returns.

        Args:
            corner: Its loads.
        """
        ...

    def to(self, start: Instant, corner: Corner) -> list[Instant]:
        """Instants from one (left out) to other loads."""
        ...

    def end(self) -> None:
        """Return to the state of :meth:`begin`."""
        ...


class LinearEquilibria:
    """The :class:`CycleEquilibria` of linear bodies.

    Args:
        analysis: The analysis, at the maximum of the cycle.
    """

    in_order = False

    def __init__(self, analysis: Analysis) -> None:
        self._analysis = analysis
        self._saved: Any = None

    @property
    def settles(self) -> bool:
        """With friction slips settle over some cycles."""
        return self._analysis.condensed.system.friction is not None

    def begin(self, corner: Corner) -> Instant:
        """See :meth:`CycleEquilibria.begin`."""
        self._saved = self._analysis.condensed.interface_state()
        return self._instant(corner, self._analysis.solver.state)

    def to(self, start: Instant, corner: Corner) -> list[Instant]:
        """See :meth:`CycleEquilibria.to`."""
        system = self._analysis.condensed.system
        force = self._analysis.given_force(self._analysis.time)
        if system.soft.bonds or system.friction is not None:
            # friction, and cohesive bonds that an earlier step opened in part, depend on the path
            path = system.pieces(start.state, corner.loads, force)
            return [
                self._instant(Corner(corner.time, point.loads), point, straight=True)
                for _, point in path
            ]
        return [self._instant(corner, system.equilibrium(corner.loads, force))]

    def end(self) -> None:
        """See :meth:`CycleEquilibria.end`."""
        self._analysis.condensed.restore_interfaces(self._saved)

    def _instant(self, corner: Corner, state: Equilibrium, *, straight: bool = False) -> Instant:
        contact = self._analysis.condensed.system.closed.tobytes()
        measured = measure(self._analysis, state, self._analysis.time)
        return Instant(corner, state, measured, contact, straight)


class NewtonEquilibria:
    """The :class:`CycleEquilibria` of nonlinear elastic bodies.

    Args:
        analysis: The analysis, at the maximum of the cycle.
        solver: Its solver.
    """

    def __init__(self, analysis: Analysis, solver: NewtonSolver) -> None:
        self._analysis, self._solver = analysis, solver
        self._saved: Any = None
        self._found = 0

    @property
    def settles(self) -> bool:
        """With friction slips settle over some cycles."""
        return self._solver.system.friction is not None

    @property
    def in_order(self) -> bool:
        """With friction an equilibrium depends on the one before."""
        return self.settles

    def begin(self, corner: Corner) -> Instant:
        """See :meth:`CycleEquilibria.begin`."""
        self._saved = self._solver.remember()
        return self._instant(corner)

    def to(self, start: Instant, corner: Corner) -> list[Instant]:
        """See :meth:`CycleEquilibria.to`.

        Raises:
            ConvergenceError: None was found, however small the pieces of the way.
        """
        self._go(corner, _DIVIDED)
        return [self._instant(corner)]

    def end(self) -> None:
        """See :meth:`CycleEquilibria.end`."""
        self._solver.recall(self._saved)

    def _go(self, corner: Corner, divisions: int) -> None:
        """From the equilibrium found last to another one, in as many pieces as it needs."""
        solver = self._solver
        here = Corner(solver.accepted.at, solver.state.loads)
        force = self._analysis.given_force(self._analysis.time)
        try:
            solver.move(corner.loads, force, corner.time, corner.time - here.time)
        except (*NO_EQUILIBRIUM, EnergyImbalance) as error:
            if not divisions:
                raise ConvergenceError(
                    f"no equilibrium within the cycle at N = {self._analysis.fatigue.N:g}: {error}"
                ) from error
            log.info("half of a piece of the cycle first: %s", error)
        else:
            solver.commit()
            return
        self._go(here.middle(corner), divisions - 1)
        self._go(corner, divisions - 1)

    def _instant(self, corner: Corner) -> Instant:
        """The present equilibrium; nothing is linear up to it unless its middle shows so."""
        self._found += 1
        measured = measure(self._analysis, self._solver.state, corner.time)
        number = self._found.to_bytes(8, "little")
        return Instant(corner, self._solver.state, measured, number, straight=False)


def measure(analysis: Analysis, state: Equilibrium, time: float) -> list[Array]:
    """What the evaluators of all active cracks measure in a state.

    Args:
        analysis: The analysis.
        state: The state, of nonlinear bodies the accepted one.
        time: Its time.
    """
    none = np.zeros((0, 0))
    return [
        # frames at a front follow bodies that move far
        g.evaluator.measure(v.tips if analysis.linear else g.tips(), state, time)
        if len(v.tips)
        else none
        for g, v in analysis.at_tips()
    ]


def equilibria_of(analysis: Analysis) -> CycleEquilibria:
    """Equilibria of the bodies of an analysis.

    Raises:
        InputError: The cycle of these bodies depends on more than its loads.
    """
    solver = analysis.solver
    if not isinstance(solver, NewtonSolver):
        return LinearEquilibria(analysis)
    bodies, refused = solver.bodies, ""
    if bodies.path_dependent:
        refused = "plasticity, as bodies that yield do not come back in a cycle"
    elif bodies.dynamic:
        refused = "Inertia, as cycles are sequences of equilibria; take Dynamic for vibrations"
    elif solver.system.soft.bonds:
        refused = (
            "bonds that an earlier step has opened in part on nonlinear bodies; end that step "
            "where its bonds are free, or take StepRelease"
        )
    elif any(getattr(g.criterion, "partial", False) for g in analysis.active):
        refused = "Fatigue(partial=True) on nonlinear bodies; leave partial out"
    if refused:
        raise InputError(f"Cycles does not cover {refused}")
    return NewtonEquilibria(analysis, solver)


def corners_of(analysis: Analysis, cycles: Cycles) -> list[Corner]:
    """Corners of the cycle of a step, the maximum first unless a period is given.

    Args:
        analysis: The analysis.
        cycles: What the cycle is.

    Raises:
        InputError: An amplitude does not return to its beginning, no load changes, or the loads of
            these bodies cannot be what the cycle says.
    """
    columns = load_columns(analysis.solver)
    names = [load if moves else answer for load, answer, moves in columns]
    n = len(names)
    # of linear bodies a temperature is one of the loads
    others = [] if analysis.linear else analysis.amplitudes_of_bodies()

    def at(time: float) -> Array:
        return np.append(analysis.loads_at(time), [float(a(time)) for a in others])

    names += ["a temperature or a pressure that follows"] * len(others)
    found = cycles.corners(at, analysis.load_breaks(), names)
    corners = [Corner(time, loads[:n]) for time, loads in found]
    check_body_amplitudes(
        analysis, corners, ratio=cycles.ratio is not None, period=cycles.period is not None
    )
    return corners


def check_body_amplitudes(
    analysis: Analysis, corners: Sequence[Corner], *, ratio: bool, period: bool
) -> None:
    """Refuse cycles in which a temperature or pressure that follows cannot be what they say.

    The forms of nonlinear bodies take them at a time, all other loads are given as numbers.

    Args:
        analysis: The analysis.
        corners: Corners of the cycle.
        ratio: Whether the minimum is a part of the maximum.
        period: Whether the cycle is a turn through the amplitudes.

    Raises:
        InputError: Says which, and what to give instead.
    """
    if analysis.linear or period:
        return
    amplitudes = analysis.amplitudes_of_bodies()
    if amplitudes and ratio:
        raise InputError(
            "Cycles: ratio scales all loads at one time, but nonlinear bodies take a temperature "
            "or a pressure that follows at a time; give minimum= instead of ratio="
        )
    a, b = corners[0].time, corners[-1].time
    for amplitude in amplitudes:
        x = np.linspace(0.0, 1.0, 9)
        values = np.array([amplitude(a + y * (b - a)) for y in x])
        straight = (1.0 - x) * values[0] + x * values[-1]
        if np.abs(values - straight).max() > 1e-9 * max(np.abs(values).max(), 1e-300):
            raise InputError(
                f"Cycles: the amplitude of a temperature or a pressure that follows is not linear "
                f"between the maximum at {a:g} and the minimum at {b:g}; give period= with the "
                "first and last time of a turn"
            )


def load_to(analysis: Analysis, path: LoadPath, time: float, divisions: int = _DIVIDED) -> None:
    """Go to a time at constant bonds, in as many pieces as nonlinear bodies need; collective.

    Args:
        analysis: The analysis.
        path: The way along its load.
        time: The time.
        divisions: How often the way may be halved.

    Raises:
        ConvergenceError: No equilibrium was found.
    """
    try:
        path.over_increment(time)
    except NO_EQUILIBRIUM as error:
        if analysis.linear or not divisions:
            raise
        log.info("half of the way to the cycle first: %s", error)
    else:
        analysis.condensed.commit()
        return
    load_to(analysis, path, 0.5 * (analysis.time + time), divisions - 1)
    load_to(analysis, path, time, divisions - 1)
