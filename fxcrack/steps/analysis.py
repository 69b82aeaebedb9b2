"""The state of an analysis: everything that changes while the steps of a scene are run.

A scene builds one :class:`Analysis`; the drivers of the steps change it; output, restart and the
error estimate read it. Energy is accounted for piece by piece: the work of supports and force
patterns by the trapezoidal rule (exact where everything is linear in between), the released energy
by the bond forces on their way to zero. The balance with the stored energy is a check on all of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools
from fxcrack.base.checks import shown
from fxcrack.base.errors import InputError, SolverError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.follower_pressure import FollowerPressure
from fxcrack.continuum.foundation import Stabilise
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.loads import AmplitudeLike, Ramp
from fxcrack.criteria.evaluator import TipValues
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.history import History
from fxcrack.interface.pair import Pair
from fxcrack.mesh import Mesh
from fxcrack.solvers.base import AnySolver, Solver
from fxcrack.solvers.linear import LinearSolver
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.solvers.plan import Plan
from fxcrack.steps.crack import Crack
from fxcrack.steps.cycle_state import FatigueState
from fxcrack.steps.debond import Debond
from fxcrack.steps.force_ramps import ForceRamp, given_forces, still_pulling
from fxcrack.steps.release_choice import Step, choose_release

_ROUND_OFF = 1e-10
"""Overlap of faces over the size of their facets that is round-off of coordinates."""


@dataclass
class EnergyBalance:
    """Time, increments and energies since the first step began.

    Attributes:
        time: Present time.
        increment: Number of increments so far, those that were undone not counted.
        external_work: Work of supports and force patterns, force times length.
        released: Energy that left through bonds; cohesive bonds give some of it back as they close.
        by_force: The part of it that left through all other bonds.
        viscous: The part of that which viscosity dissipated.
        kinetic: Kinetic energy of a velocity that bodies are given at the start.
        held_from: Loads that are not proportional to time are taken at no earlier time than this,
            so that they stay as they are where a step moves the proportional ones back.
    """

    time: float = 0.0
    increment: int = 0
    external_work: float = 0.0
    released: float = 0.0
    by_force: float = 0.0
    viscous: float = 0.0
    kinetic: float = 0.0
    held_from: float = 0.0

    def copy(self) -> EnergyBalance:
        """The present values, to return to."""
        return replace(self)

    def asdict(self) -> dict[str, Any]:
        """Plain values by name, from which ``EnergyBalance(**values)`` makes the same again."""
        return asdict(self)


@dataclass(frozen=True)
class Snapshot:
    """What :meth:`Analysis.rollback` needs to return to an equilibrium with the same bonds.

    Attributes:
        balance: Time, increments and energies.
        tip_values: Values of the criteria at the tips.
        solver: State of interfaces and bodies, and the energy that friction had dissipated.
    """

    balance: EnergyBalance
    tip_values: list[TipValues]
    solver: Any


@dataclass(eq=False)
class Analysis:
    """Bodies, interfaces and all that changes while steps are run.

    Attributes:
        continuum: Bodies.
        solver: Bodies, interfaces, supports and loads with their present equilibrium.
        debonds: Interfaces that may debond; they are the first ones among :attr:`pairs`.
        plan: How it is solved and why.
        effects: Effects the user asked for.
        history: Rows of all steps so far.
        balance: Time, increments and energies.
        cracks: One per debond, once a step was run.
        active: Those of them that may grow in the present step.
        tip_values: Values of their criteria at the present tips, in the order of :attr:`active`.
        ramps: Bonds whose force is released with time or over increments.
        fatigue: What cycles leave behind for later ones.
        started: Whether there is an equilibrium yet.
        stabilise: The weak foundation of bodies, as the user gave it.
        said: What was said of the scene, each once.
    """

    continuum: Continuum
    solver: AnySolver
    debonds: Sequence[Debond]
    plan: Plan
    effects: Sequence[Any]
    history: History
    balance: EnergyBalance = field(default_factory=EnergyBalance)
    cracks: list[Crack] = field(default_factory=list)
    active: list[Crack] = field(default_factory=list)
    tip_values: list[TipValues] = field(default_factory=list)
    ramps: list[ForceRamp] = field(default_factory=list)
    fatigue: FatigueState = field(default_factory=FatigueState)
    started: bool = False
    stabilise: Stabilise | None = None
    said: set[str] = field(default_factory=set)

    # -- what it consists of -------------------------------------------------------------

    @property
    def comm(self) -> MPI.Comm:
        """Communicator of the bodies."""
        return self.continuum.comm

    @property
    def mesh(self) -> Mesh:
        """Mesh of the bodies."""
        return self.continuum.mesh

    @property
    def pairs(self) -> list[Pair]:
        """Paired interfaces; the solver pairs their faces anew where these slide far."""
        return self.solver.pairs

    @property
    def condensed(self) -> Solver:
        """The solver of bodies that are condensed onto their interfaces.

        Raises:
            SolverError: The bodies move by explicit dynamics.
        """
        if not isinstance(self.solver, LinearSolver | NewtonSolver):
            raise SolverError("bodies in explicit dynamics are not condensed")
        return self.solver

    @property
    def linear(self) -> bool:
        """Whether the bodies are linear, and tips fixed by the bonds alone."""
        return self.plan.solver == "linear"

    @property
    def time(self) -> float:
        """Present time."""
        return self.balance.time

    @time.setter
    def time(self, time: float) -> None:
        self.balance.time = time

    @property
    def snap_energy(self) -> float:
        """Energy lost where cohesive bonds ran through unstable states, force times length."""
        soft, jump = self.condensed.system.soft, self.solver.state.jump
        return self.balance.released - self.balance.by_force - soft.taken(jump)

    def check_started(self, wanted: str) -> None:
        """Refuse to read results before there are any.

        Args:
            wanted: What was asked for.

        Raises:
            InputError: No step was run yet.
        """
        if not self.started:
            raise InputError(f"the scene has no state yet; run a step before asking for {wanted}")

    def retained_nodes(self, p: int) -> Bools:
        """Whether jumps of the slave nodes of a pair are retained, shape (n_nodes,)."""
        return np.asarray((self.solver.index[p] >= 0).any(axis=1))

    def given_forces_at(self, p: int) -> Array:
        """Force components on the slave nodes of a pair that the state prescribes.

        Returns:
            Array of shape (n_nodes, gdim), force; zero where a component is not retained.
        """
        return np.append(self.solver.state.force, 0.0)[self.solver.index[p]]

    def book_start(self) -> None:
        """Book the energy that is there before any load acts; collective, once at the start.

        It is that of a given velocity, and that of faces that overlap and are pushed apart.
        """
        solver = self.condensed
        system = solver.system
        overlap = np.where(system.contact, np.maximum(-system.gap, 0.0), 0.0)
        size = max((pair.surface.facet_size for pair in self.pairs), default=0.0)
        overlap[overlap <= _ROUND_OFF * size] = 0.0
        dynamic = any(isinstance(e, Inertia) for e in self.effects)
        if not dynamic and not overlap.any():
            return
        stored = solver.stored(solver.state)
        self.balance.kinetic = stored.get("kinetic_energy", 0.0)
        strain = sum(stored.values()) - self.balance.kinetic
        solver.overlap_energy = (
            strain + sum(solver.spent().values()) - solver.extra_work(solver.state)
        )
        if overlap.any():
            log.warn(
                "%d open nodes overlap the face they are to touch by up to %.3g before any load "
                "acts (gap='keep'). Contact pushes them apart, which stores %.3g "
                "(overlap_energy); where no press fit is meant, refine coarse facets on curved "
                "faces, or use gap='adjust'",
                int(np.count_nonzero(overlap)), float(overlap.max()), solver.overlap_energy,
            )  # fmt: skip

    # -- loads ---------------------------------------------------------------------------

    def loads_at(self, time: float) -> Array:
        """Amplitudes of all supports and load factors at a time, shape (n_loads,)."""
        held = max(time, self.balance.held_from)

        def at(amplitude: AmplitudeLike) -> float:
            return time if isinstance(amplitude, Ramp) else held

        values = [c.coordinate(at(c.support.amplitude)) for c in self.solver.supports.columns]
        loads = self.solver.loads
        return np.array(values + [x.amplitude(at(x.amplitude)) for x in loads])

    def load_breaks(self) -> tuple[float, ...]:
        """Times at which an amplitude changes its slope, sorted."""
        return tuple(sorted({b for a in self.amplitudes() for b in a.breaks()}))

    def amplitudes(self) -> list[AmplitudeLike]:
        """Factors in time of all that moves or loads the bodies."""
        every = [c.support.amplitude for c in self.solver.supports.columns if c.moves]
        every += [load.amplitude for load in self.solver.loads]
        return every + self.amplitudes_of_bodies()

    def amplitudes_of_bodies(self) -> list[AmplitudeLike]:
        """Those that the forms of the bodies evaluate: of a temperature, of pressures that follow.

        In linear bodies a temperature is one of the loads as well.
        """
        found = [] if self.continuum.temperature is None else self.continuum.temperature.amplitudes
        solver = self.solver
        terms = solver.bodies.terms if isinstance(solver, NewtonSolver) else ()
        return [*found, *(t.amplitude for t in terms if isinstance(t, FollowerPressure))]

    def given_force(self, time: float) -> Array:
        """Given forces of bonds on a ramp at a time, shape (n_retained,), force."""
        return given_forces(self.condensed, self.ramps, time, self.balance.increment)

    def add_ramp(self, ramp: ForceRamp) -> None:
        """Prescribe the forces of further bonds; ramps that have ended are removed."""
        still = still_pulling(self.ramps, self.time, self.balance.increment)
        self.ramps = [*still, ramp]

    # -- cracks and tips -----------------------------------------------------------------

    def activate(self, chosen: Sequence[Debond], step: Step) -> None:
        """Let some debonds grow in a step; all cracks are made before the first step begins.

        Collective.

        Raises:
            InputError: A criterion does not fit its interface.
        """
        choices = [choose_release(d, step, self.pairs) for d in self.debonds]
        if not self.started:
            self.cracks = [
                Crack(self.solver, p, debond, choices[p].law)
                for p, debond in enumerate(self.debonds)
            ]
        for g, choice in zip(self.cracks, choices, strict=True):
            g.release_by(choice.law)
            if (
                choice.why_at_once
                and g.debond in chosen
                and f"release of {g.title}" not in self.said
            ):
                self.said.add(f"release of {g.title}")
                log.info(
                    "interface '%s': bonds are released at once (StepRelease); the default in 3-D, "
                    "progressive release, is not taken with %s",
                    g.title, choice.why_at_once,
                )  # fmt: skip
        self.active = [g for g in self.cracks if g.debond in chosen]
        self.tip_values = []

    @property
    def largest(self) -> float:
        """Largest f at the present tips of all active cracks."""
        return largest(self.tip_values)

    def update_tips(self) -> None:
        """Find the tips anew, condense anew if what they need is not retained, and evaluate."""
        tips = [g.tips() for g in self.active]
        if not all(g.held(t) for g, t in zip(self.active, tips, strict=True)):
            self.condensed.rebase()
            for g, t in zip(self.active, tips, strict=True):
                g.check_wake(t)
        self.tip_values = [
            g.evaluate(t, self.solver.state, self.time)
            for g, t in zip(self.active, tips, strict=True)
        ]

    def evaluate(self, state: Equilibrium, time: float) -> list[TipValues]:
        """Values of the criteria in a state with the present bonds, one entry per active crack."""
        # normals and lengths at a front follow bodies that move far: their tips are made anew
        return [
            g.evaluate(v.tips if self.linear else g.tips(), state, time) for g, v in self.at_tips()
        ]

    def evaluate_tips(self) -> None:
        """Evaluate the criteria in the present state."""
        self.tip_values = self.evaluate(self.solver.state, self.time)

    def at_tips(self) -> list[tuple[Crack, TipValues]]:
        """Active cracks with the values of their criteria."""
        return list(zip(self.active, self.tip_values, strict=True))

    # -- advance and rollback ------------------------------------------------------------

    def advance(self, point: Equilibrium, time: float) -> None:
        """Make the end of a piece the present state and account for the energy of the piece.

        Args:
            point: An equilibrium the solver has found from the present one, with nothing but a
                linear piece (or the last move of the Newton solver) in between.
            time: Its time.
        """
        here = self.solver.state
        self.book(here, point, *self.condensed.along(here, point))
        self.condensed.book_contact(here, point)
        self.solver.state = point
        self.balance.time = time

    def book(
        self, here: Equilibrium, point: Equilibrium, work: float, released: float, mean: Array
    ) -> None:
        """Account for the work of a piece and for what bonds released on it.

        Args:
            here: Its beginning.
            point: Its end.
            work: External work.
            released: Energy that bonds released.
            mean: Mean jumps, shape (n_retained,), length.
        """
        balance = self.balance
        balance.external_work += work
        balance.released += released
        for ramp in self.ramps:
            index = self.condensed.components(ramp.p, ramp.nodes)
            force, last = here.force[index], point.force[index]
            spent = float(force @ here.jump[index] - last @ point.jump[index])
            spent += float((last - force) @ mean[index])
            balance.by_force += spent
            balance.viscous += ramp.viscous_part(spent, self.condensed, here.jump, point.jump)

    def snapshot(self) -> Snapshot:
        """What :meth:`rollback` needs to return to the present equilibrium."""
        return Snapshot(self.balance.copy(), self.tip_values, self.condensed.remember())

    def rollback(self, saved: Snapshot) -> None:
        """Return to an earlier equilibrium, with the same bonds."""
        self.balance = saved.balance.copy()
        self.tip_values = saved.tip_values
        self.condensed.recall(saved.solver)


def largest(values: Sequence[TipValues]) -> float:
    """Largest f of several interfaces, 0 without tips."""
    return max((float(v.f.max(initial=0.0)) for v in values), default=0.0)


class HasAnalysis(Protocol):
    """What is made of an analysis: a scene."""

    @property
    def analysis(self) -> Analysis:
        """The analysis."""


def analysis_of(source: Analysis | HasAnalysis) -> Analysis:
    """The analysis of a scene, or the analysis itself.

    Raises:
        InputError: It is neither.
    """
    found = source if isinstance(source, Analysis) else getattr(source, "analysis", None)
    if not isinstance(found, Analysis):
        raise InputError(f"source = {shown(source)} must be a scene, or its analysis")
    return found
