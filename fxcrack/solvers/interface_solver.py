"""What linear and nonlinear solvers share: the interfaces on their retained jumps.

The jumps around the crack fronts are retained when the bodies are condensed: a set is chosen for a
step, and another one when a front leaves it. What the interfaces must know beyond that (which bonds
are released or soften, what slips) is carried over.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.timings import Timings
from fxcrack.condensation.free_bodies import FreeBodies
from fxcrack.condensation.iterative import Roles
from fxcrack.condensation.options import CondensedOptions
from fxcrack.condensation.retained import ColumnCost, CostModel, choose_roles
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.loads import Load, Monitor
from fxcrack.equilibrium.cohesive_bonds import CohesiveCounts
from fxcrack.equilibrium.cohesive_law import CohesiveBond, CohesiveUnit
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.equilibrium.friction_state import release_to_contact
from fxcrack.equilibrium.interface_state import Arrays, InterfaceState, allow_contact
from fxcrack.interface.crack_fluid import CrackFluid
from fxcrack.interface.front import Front
from fxcrack.interface.jump_coordinates import FIXED, JumpCoordinates, global_vectors
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports
from fxcrack.solvers.base import Solver
from fxcrack.solvers.front_probe import CondensedFrontProbe


class Condensed(NamedTuple):
    """The bodies condensed onto a set of retained jumps.

    Attributes:
        coordinates: The set and its numbering.
        system: The dense system of the interfaces, all of them bonded.
        face_loads: Force of every force pattern on the retained jumps, shape (n_retained,
            n_forces).
    """

    coordinates: JumpCoordinates
    system: ContactSystem
    face_loads: Array


class InterfaceSolver(ABC):
    """Interfaces with their retained jumps; the bodies behind them are the subclass's.

    Until :meth:`prepare` no jump is retained and no load acts.

    Args:
        continuum: Bodies.
        pairs: Interfaces.
        supports: Prescribed components.
        loads: Force patterns.
        monitors: Monitored displacements.
        options: How to condense.

    Attributes:
        fronts: Fronts per pair.
        n_loads: Number of supports and force patterns together.
        prepared: Whether there is a set of retained jumps.
        system: The dense system on the present set of retained jumps.
        state: Present equilibrium.
        index: Number of each retained jump per pair, -1 elsewhere, shape (n_nodes, gdim).
        frames: Frame of each slave node per pair, shape (n_nodes, gdim, gdim).
        held_by_supports: Jumps that supports hold at zero per pair, shape (n_nodes, gdim).
        face_loads: Force of every force pattern on the retained jumps, shape (n_retained,
            n_forces).
        fluids: Pressures that follow the crack of bodies of finite strain.
        active: Whether the crack may grow, per pair.
        around: Distances ahead of and behind the tips that the criterion needs, per pair, length.
        rebases: Sets of retained jumps chosen since the step began.
        friction_energy: Energy dissipated by friction so far.
        overlap_energy: Energy given by contact that pushed overlapping faces apart so far.
        timings: Seconds per phase and number of factorisations.
        law_seconds: Seconds per law of the interface (contact, friction, softening).
        soft_counts: Effort spent on softening bonds.
    """

    def __init__(
        self,
        continuum: Continuum,
        pairs: list[Pair],
        supports: Supports,
        loads: list[Load],
        monitors: list[Monitor],
        options: CondensedOptions,
    ) -> None:
        self.continuum = continuum
        self.pairs = pairs
        self.supports = supports
        self.loads = loads
        self.monitors = monitors
        self.options = options
        self.timings = Timings()
        self.law_seconds: dict[str, float] = {}
        self.soft_counts = CohesiveCounts()
        self.fronts = [
            Front(p.surface, p.bonded, p.title, by_corners=p.hierarchy is not None) for p in pairs
        ]
        self.n_loads = n = len(supports.columns) + len(loads)
        self.active = [False] * len(pairs)
        self.around = [(0.0, 0.0)] * len(pairs)
        self.rebases = 0
        self.friction_energy = self.overlap_energy = 0.0
        self.prepared = False
        gdim = continuum.gdim
        self.index = [np.full((p.surface.n_nodes, gdim), -1, dtype=np.int64) for p in pairs]
        self.frames = [p.frames for p in pairs]
        self.held_by_supports = [i >= 0 for i in self.index]
        self.face_loads = np.zeros((0, len(loads)))
        self.fluids: list[CrackFluid] = []
        self.system = ContactSystem(np.zeros((n, n)), 0, n, len(loads))
        self.state = Equilibrium(np.zeros(n), np.zeros(0), np.zeros(0), np.zeros(n))
        self._reach = [np.inf] * len(pairs)
        self._cost: CostModel | ColumnCost = CostModel.guess(
            continuum.n_global, continuum.mesh.gdim
        )
        self._followed: list[Ints] = []
        self._resumed: InterfaceState | None = None
        self._roles: Roles = []
        self._resumed_roles: Roles | None = None
        self._free_bodies: tuple[JumpCoordinates, FreeBodies] | None = None

    # -- the retained jumps --------------------------------------------------------------

    @abstractmethod
    def _condense(self, roles: Roles, loads: Array) -> Condensed:
        """Condense the bodies onto the jumps that are to be retained; collective.

        Args:
            roles: FIXED, FREE or RETAINED per pair and jump component, shape (n_nodes, gdim).
            loads: Present loads, shape (n_loads,).
        """

    @abstractmethod
    def _equilibrium(self, before: InterfaceState, force: Array) -> Equilibrium:
        """The equilibrium of an earlier state on the present retained jumps; collective.

        Args:
            before: The state, which the system is in.
            force: Its given forces, shape (n_retained,).
        """

    def begin_motion(self, dt: float) -> None:  # noqa: B027 - bodies at rest have nothing to do
        """See :meth:`fxcrack.solvers.base.Solver.begin_motion`."""

    @abstractmethod
    def start(self) -> None:
        """Find the equilibrium without loads; collective."""

    def prepare(self, active: list[bool], reach: list[float]) -> None:
        """Choose the retained jumps for a step, and condense; collective.

        The state is carried over.

        Args:
            active: Interfaces that may grow in the step.
            reach: Distance the crack may grow per interface, inf if unknown, length.
        """
        self.active, self._reach = active, reach
        self._retain(self._resumed or self.interface_state())
        self._resumed = None
        self.prepared, self.rebases = True, 0

    def rebase(self) -> None:
        """Choose the retained jumps around the present fronts, and condense again; collective.

        The state is carried over.
        """
        self._retain(self.interface_state())
        self.rebases += 1

    def interface_state(self) -> InterfaceState:
        """The present state of the interfaces."""
        return InterfaceState.of(
            self.system,
            self.fronts,
            self.index,
            self.state,
            self.friction_energy,
            self.overlap_energy,
        )

    def restore_interfaces(self, saved: InterfaceState) -> None:
        """Return to an earlier state of the interfaces on the same retained jumps."""
        saved.restore_bonds(self.fronts)
        self.system.restore(saved.states)
        self.state, self.friction_energy = saved.equilibrium, saved.friction_energy
        self.overlap_energy = saved.overlap_energy

    def collect(self) -> Arrays:
        """The present state as plain arrays; collective.

        Returns:
            What :meth:`InterfaceState.arrays` gives; roles[p], which jumps are retained, per pair,
            shape (n_nodes, gdim).
        """
        roles = {f"roles[{p}]": role for p, role in enumerate(self._roles)}
        return self.interface_state().arrays() | roles

    def resume(self, arrays: Arrays, time: float) -> None:
        """Take the state that :meth:`collect` gave; the next :meth:`prepare` carries it over.

        Collective.

        Args:
            arrays: By name, of the shapes that :meth:`collect` gave; the same on all ranks, of any
                number of ranks.
            time: Time of the state.
        """
        state = InterfaceState.from_arrays(arrays, len(self.pairs))
        state.restore_bonds(self.fronts)
        self._resumed = state
        names = [f"roles[{p}]" for p in range(len(self.pairs))]
        if all(name in arrays for name in names):
            # the set it had, so that the history goes on on the same one
            self._resumed_roles = [arrays[name].astype(np.int8) for name in names]

    def _retain(self, state: InterfaceState) -> None:
        """Condense onto another set of retained jumps, and carry a state over."""
        roles = self._resumed_roles or self._choose_roles(state)
        self._roles, self._resumed_roles = roles, None
        contact_steps = self.system.contact_steps
        coordinates, self.system, self.face_loads = self._condense(roles, state.equilibrium.loads)
        self.frames, self.index = coordinates.frames, coordinates.index
        self.held_by_supports = coordinates.held
        for pair, front, held in zip(self.pairs, self.fronts, coordinates.held, strict=True):
            front.tied = held.all(axis=1) | (pair.bonded & ~pair.paired)
        self.system.seconds, self.system.soft.counts = self.law_seconds, self.soft_counts
        self.system.contact_steps = contact_steps
        start = time.perf_counter()
        state.carry_over(self.system, self.pairs, self.fronts, self.index)
        self.friction_energy = state.friction_energy
        self.overlap_energy = state.overlap_energy
        force = state.values(state.equilibrium.force, self.index, self.system.n_retained)
        self.state = self._equilibrium(state, force)
        self.timings.add("growth", start)
        log.info(
            "factorisation %d: %d retained jumps",
            self.timings.factorizations,
            coordinates.n_retained,
        )

    def _choose_roles(self, state: InterfaceState) -> Roles:
        """Roles of all jumps around the present fronts."""
        reach = self._reach
        if self.options.rows is not None:
            reach = [min(r, self.options.rows) for r in reach]
        return choose_roles(
            self.pairs,
            self.fronts,
            self.active,
            reach,
            self._cost,
            around=self.around,
            keep=state.nodes_to_retain(self.pairs),
            cap_mb=self.options.retained_mb,
            gdim=self.continuum.gdim,
        )

    def restraint(self, roles: Roles, coordinates: JumpCoordinates) -> FreeBodies:
        """What holds the bodies on a set of retained jumps.

        Args:
            roles: Roles of the jumps.
            coordinates: Their numbering.
        """
        if self._free_bodies is None or self._free_bodies[0] is not coordinates:
            bonded = [role == FIXED for role in roles]
            parts = self.continuum, self.supports, self.pairs, bonded
            found = FreeBodies(*parts, coordinates.index, coordinates.frames)
            if self._free_bodies is not None:
                found.warned = self._free_bodies[1].warned
            self._free_bodies = coordinates, found
        return self._free_bodies[1]

    # -- bonds ---------------------------------------------------------------------------

    def soften(self, p: int, units: Sequence[CohesiveUnit]) -> None:
        """Let the bond forces of units fall linearly with their opening.

        The forces of all nodes of a unit fall in proportion. Where its faces are pressed together,
        normal forces that press stay: these nodes are in contact from then on.

        Args:
            p: Number of the pair.
            units: What softens by one law each; bonded so far.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
        """
        system, state = self.system, self.state
        bonds, force = [], state.force.copy()
        for nodes, spend, pressed, _ in units:
            row, local = np.nonzero(self.index[p][nodes] >= 0)
            components = self.index[p][nodes[row], local]
            traction = -system.forces(state, components)
            if pressed:
                touch = self.pairs[p].can_touch[nodes[row]]
                stays = (local == 0) & (traction < 0.0) & touch
                closed = components[stays]
                system.contact[closed] = system.closed[closed] = True
                row, local, components, traction = (
                    v[~stays] for v in (row, local, components, traction)
                )
            strength = float(np.linalg.norm(traction))
            if not strength > 0.0:
                system.release(components)
                continue
            force[components] = -traction
            bonds.append(
                CohesiveBond(
                    components, traction / strength, strength, 2.0 * spend / strength,
                    (p, nodes[row], local),
                )
            )  # fmt: skip
        every = np.concatenate([unit.nodes for unit in units])
        self.fronts[p].release(every)
        if bonds:
            system.soften(bonds)
            if self.pairs[p].interface.contact:
                normals = self.index[p][every[self.pairs[p].can_touch[every]], 0]
                normals = normals[normals >= 0]
                system.touches[normals] = True
                if system.soft_contact:
                    system.contact[normals] = True
        self.state = Equilibrium(state.loads, force, state.jump, state.conjugate)

    def open(self, p: int, nodes: Ints) -> None:
        """Make the forces of nodes known instead of their jumps; they keep their values.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (n,).

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
        """
        system, state = self.system, self.state
        rubs = np.zeros(len(nodes), dtype=bool)
        if system.friction is not None and self.pairs[p].interface.contact:
            rubs = self.pairs[p].can_touch[nodes]
        components = self.components(p, nodes[~rubs])
        components = components[~system.free[components]]
        known = system.forces(state, components)
        force = state.force
        if rubs.any():
            force = release_to_contact(system, p, self.pairs[p], self.index[p], nodes[rubs], state)
        force = force.copy()
        force[components] = known
        system.release(components)
        self.fronts[p].release(nodes)
        if self.pairs[p].interface.contact and system.friction is None:
            allow_contact(system, self.pairs[p], self.fronts[p], self.index[p])
        self.state = Equilibrium(state.loads, force, state.jump, state.conjugate)

    # -- what criteria and output ask ----------------------------------------------------

    def probe(self, p: int) -> CondensedFrontProbe:
        """What criteria may ask of a pair."""
        return CondensedFrontProbe(cast(Solver, self), p)

    def remaining(self, p: int) -> tuple[Ints, Array]:
        """Slave nodes of a pair that soften, and the remaining fraction of the force at each."""
        nodes, fractions = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
        for bond in self.system.soft.bonds:
            pair, members, _ = bond.where
            if pair == p:
                left = bond.remaining(bond.opening(self.state.jump))
                nodes.append(members)
                fractions.append(np.full(len(members), left))
        return np.concatenate(nodes), np.concatenate(fractions)

    def holds(self, p: int, nodes: Ints) -> bool:
        """Whether all jumps of some slave nodes that may differ from zero are retained.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (n,).
        """
        pair, index, held = self.pairs[p], self.index[p], self.held_by_supports[p]
        missing = (index[nodes] < 0) & ~held[nodes]
        if pair.interface.normal_only:
            missing[:, 1:] = False
        missing[~pair.paired[nodes]] = False
        return not missing.any()

    def vectors(self, p: int, nodes: Ints, values: Array) -> Array:
        """Jump or force components at slave nodes as global vectors.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (...,).
            values: Values of the retained jumps, shape (n_retained,).

        Returns:
            Shape (..., 3); zero where a component is not retained.
        """
        return global_vectors(self.index[p][nodes], self.frames[p][nodes], values)

    def components(self, p: int, nodes: Ints) -> Ints:
        """Numbers of the retained jumps of slave nodes, shape (k,)."""
        index = self.index[p][nodes]
        return index[index >= 0]

    def follow(self, nodes: npt.NDArray[np.integer]) -> int:
        """Follow the mean displacement of some nodes from the first step on.

        Args:
            nodes: Those of them that this rank owns, shape (n,).

        Returns:
            Its number in :meth:`motion`.
        """
        self._followed.append(np.asarray(nodes, dtype=np.int64))
        return len(self._followed) - 1

    def motion(self, state: Equilibrium) -> Array:
        """Displacements that are followed, shape (n_followed, gdim), length."""
        values = self.system.monitors(state)[len(self.monitors) :]
        return values.reshape(len(self._followed), self.continuum.gdim)


__all__ = ["Condensed", "InterfaceSolver"]
