"""The linear continuum in a window around its fronts: condensed, with the states that are open.

A window is made for a step and made anew when a front leaves it. What the interfaces must know
beyond it (which bonds are gone, what softens, what slips) is carried over.
"""

from __future__ import annotations

import time

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import SolverError
from fxcrack.base.machine import machine_memory_mb
from fxcrack.base.timings import Timings
from fxcrack.condensation.bordered_matrix import load_and_monitor_vectors
from fxcrack.condensation.direct import DirectCondensation, too_large_for_direct
from fxcrack.condensation.iterative import IterativeCondensation, Roles, SchurColumnCache
from fxcrack.condensation.mumps_schur import mumps_message
from fxcrack.condensation.options import CondensedOptions
from fxcrack.condensation.retained import ColumnCost, CostModel, choose_roles
from fxcrack.condensation.rigid_motions import check_held
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.loads import Load, Monitor
from fxcrack.equilibrium.cohesive_bonds import CohesiveCounts
from fxcrack.equilibrium.cohesive_law import CohesiveBond
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.equilibrium.friction_state import FrictionMemory, has_friction, make_friction, nodes_of
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.interface.front import Front
from fxcrack.interface.jump_coordinates import JumpCoordinates, build_coordinates
from fxcrack.interface.pairing import Pair
from fxcrack.interface.supports import Supports

_ROUND_OFF = 1e-12
"""Of an entry of S, by the diagonal of A. Measured on pivots, the energy v^t S v of a motion v over
sum A_ii v_i^2: at most 2e-15 where nothing holds a body, nearly incompressible or not; of those
held 7e-10 or more in slender bodies (900 to 1), 1e-10 in thin ones (50 to 1) that are 1e4 times
softer than their slaves, 1e-12 where they are 1e7 times softer."""


class InterfaceSolver:
    """Bodies, interfaces and loads, condensed.

    Args:
        continuum: Elastic bodies.
        pairs: Interfaces.
        supports: Prescribed components.
        loads: Force patterns.
        monitors: Monitored displacements.
        options: How to condense.

    Attributes:
        fronts: Fronts per pair.
        system: The dense system of the present window.
        state: Present equilibrium.
        around: Distances ahead of and behind the tips that the criterion looks at, per pair.
        keep: (pair, slave node) of bonds that still carry a given force.
        friction_energy: Energy that friction has taken so far.
        columns: Columns computed by iteration, ``None`` where the bodies are factored.
        timings: Seconds per phase and number of factorisations.
        linear: Whether the bodies are, so that S outlives an increment.
        law_seconds: Seconds per law of the interface (contact, friction, softening).
        soft_counts: Effort spent on softening bonds.
    """

    linear = True

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
        self.fronts = [Front(p.surface, p.bonded, p.title) for p in pairs]
        self.n_loads = len(supports.columns) + len(loads)
        self.active = [False] * len(pairs)
        self.reach = [np.inf] * len(pairs)
        self.around = [(0.0, 0.0)] * len(pairs)
        self.rebases = 0
        # temperature patterns come last among the loads
        self._n_thermal = sum(type(x).__name__ == "ThermalLoad" for x in loads)
        self._held: Array | None = None
        self.keep: list[tuple[int, int]] = []
        self._followed: list[Ints] = []
        self._soft: list[CohesiveBond] = []
        self._taken = 0.0
        self._rubbed = FrictionMemory.empty(continuum.gdim) if has_friction(pairs) else None
        self.friction_energy = 0.0
        self._cost = CostModel.guess(continuum.n_global, continuum.gdim)
        self._column_cost = ColumnCost.guess(continuum.n_global)
        self.columns: SchurColumnCache | None = None
        if options.method == "iterative" or (options.method == "auto" and self._too_large()):
            self.columns = SchurColumnCache(
                continuum, pairs, supports, rtol=options.rtol, cap_mb=options.window_mb
            )
        self._stiffness: PETSc.Mat | None = None
        self._borders: list[PETSc.Vec] = []
        self._condensation: DirectCondensation | IterativeCondensation | None = None
        self.system: ContactSystem
        self.state: Equilibrium

    def _too_large(self) -> bool:
        """Whether a factorisation would not fit the memory, which is logged; collective."""
        if not self.linear or self.continuum.gdim < 3:
            return False
        comm = self.continuum.comm
        reason = too_large_for_direct(self.continuum.n_global, 1e6 * machine_memory_mb(comm))
        if reason is not None:
            log.warn("%s: the iterative method is used (method='schur' insists)", reason)
        return reason is not None

    def prepare(self, active: list[bool], reach: list[float]) -> None:
        """Build the window for a step; collective.

        Args:
            active: Interfaces that may grow in the step.
            reach: Distance the crack may grow per interface, inf if unknown.
        """
        self.active, self.reach = active, reach
        if hasattr(self, "system"):
            self._remember()
        self._rebase()
        self.rebases = 0

    def take_over(self, bonds: list[CohesiveBond], finished: float) -> None:
        """Go on with bonds that soften and energy spent by others in the next window."""
        self._soft, self._taken = bonds, finished
        if hasattr(self, "system"):
            self.system.soft.bonds, self.system.soft.finished = bonds, finished

    def take_over_friction(self, memory: FrictionMemory, energy: float) -> None:
        """Go on with states of friction in the next window, and the energy it has taken."""
        self._rubbed, self.friction_energy = memory, energy
        if hasattr(self, "system"):
            self.system.friction = None  # that of an earlier step

    def _remember(self) -> None:
        """Keep what the states of the interface depend on while the window changes."""
        self._soft, self._taken = self.system.soft.bonds, self.system.soft.finished
        if self.system.friction is not None:
            self._rubbed = FrictionMemory.of(self.system.friction, self.state)

    def _rebase(self) -> None:
        self._assemble()
        coordinates = self._choose_window()
        self.frames, self.index = coordinates.frames, coordinates.index
        self.held_by_supports = coordinates.held
        for pair, front, held in zip(self.pairs, self.fronts, coordinates.held, strict=True):
            front.tied = held.all(axis=1) | (pair.bonded & ~pair.paired)
        self._condense(coordinates)
        self.system.seconds, self.system.soft.counts = self.law_seconds, self.soft_counts
        start = time.perf_counter()
        self._restore_states()
        self.timings.add("march", start)
        log.info(
            "factorisation %d: %d coordinates in the window",
            self.timings.factorizations,
            coordinates.n_retained,
        )

    def _assemble(self) -> None:
        """Make K and the borders on first use; collective."""
        if self._stiffness is not None:
            return
        start = time.perf_counter()
        check_held(self.continuum, self.supports)
        self.continuum.compile()
        self.timings.add("compile", start)
        start = time.perf_counter()
        self._stiffness = self.continuum.stiffness()
        self._borders = load_and_monitor_vectors(
            self.continuum, self.loads, self.monitors, self._followed
        )
        self.timings.add("assemble", start)

    def _choose_window(self) -> JumpCoordinates:
        """Coordinates around the present fronts; collective."""
        reach = self.reach
        if self.options.rows is not None:
            reach = [min(r, self.options.rows) for r in reach]
        roles = choose_roles(
            self.pairs,
            self.fronts,
            self.active,
            reach,
            self._cost if self.columns is None else self._column_cost,
            around=self.around,
            keep=[*((b.where[0], k) for b in self._soft for k in b.where[1].tolist()), *self.keep],
            cap_mb=self.options.window_mb,
            gdim=self.continuum.gdim,
        )
        if self._condensation is not None:
            self._condensation.destroy()
            self._condensation = None
        if self.columns is not None:
            return self._condense_by_columns(self.columns, roles)
        start = time.perf_counter()
        coordinates = build_coordinates(
            self.continuum.layout, self.pairs, roles, self.supports, len(self._borders)
        )
        self.timings.add("transform", start)
        return coordinates

    def _condense(self, coordinates: JumpCoordinates) -> None:
        """Factor, and set up the dense system of the window; collective."""
        assert self._stiffness is not None
        if self.columns is None:
            start = time.perf_counter()
            self._condensation = DirectCondensation(
                self._stiffness,
                coordinates,
                self._borders,
                self.timings,
                method=self.options.method,
            )
            seconds = self.continuum.comm.bcast(time.perf_counter() - start)
            self._cost.observe(coordinates.n_retained, seconds)
        assert self._condensation is not None
        self.system = ContactSystem(
            self._condensation.schur, coordinates.n_retained, self.n_loads, len(self.loads)
        )
        if isinstance(self._condensation, DirectCondensation):
            # a body that is nearly incompressible has a much larger diagonal than S
            diagonal = self._condensation.diagonal
            self.system.cholesky.round_off = _ROUND_OFF * np.abs(diagonal)
        self.face_loads = -self._condensation.borders_on_window[:, : len(self.loads)]
        # a temperature acts on no face; its force on a node at an end does not follow the crack
        self.face_loads[:, [not isinstance(x, Load) for x in self.loads]] = 0.0

    def _condense_by_columns(self, columns: SchurColumnCache, roles: Roles) -> JumpCoordinates:
        """Coordinates of the window with S on them, no factorisation; collective."""
        assert self._stiffness is not None
        may_open = []
        for pair, front, on in zip(self.pairs, self.fronts, self.active, strict=True):
            later = np.zeros((pair.surface.n_nodes, self.continuum.gdim), dtype=bool)
            later[front.bonded & pair.paired] = on
            if pair.interface.normal_only:
                later[:, 1:] = False
            may_open.append(later)
        start = time.perf_counter()
        made = columns.condense(roles, may_open, self._stiffness, self._borders, self.timings)
        spent = self.continuum.comm.bcast((made.column_seconds, time.perf_counter() - start))
        self._column_cost.observe(made.computed, *spent)
        self._condensation = made
        log.info("%d new columns in %.2f s", made.computed, made.column_seconds)
        return made.coordinates

    def _restore_states(self) -> None:
        """Free what is open in the new window, soften what softens, mark what may touch."""
        bonds = self._soft
        for bond in bonds:
            p, nodes, local = bond.where
            bond.components = self.index[p][nodes, local]
        soft = np.concatenate([b.components for b in bonds]) if bonds else np.zeros(0, np.int64)
        for pair, front, index in zip(self.pairs, self.fronts, self.index, strict=True):
            is_open = ~front.bonded
            self.system.gap[index[:, 0][index[:, 0] >= 0]] = pair.gap[index[:, 0] >= 0]
            if self._rubbed is not None:
                # their bonds are gone as well, but contact and friction decide on them
                is_open[nodes_of(pair, front, index)] = False
            free = index[is_open]
            free = free[(free >= 0) & ~np.isin(free, soft)]
            if len(free):
                self._free_open(pair, index[is_open & pair.paired, 0], free)
            if pair.interface.contact:
                self._let_touch(pair, front, index)
        if self._rubbed is not None:
            make_friction(self.system, self.pairs, self.fronts, self.index, self._rubbed)
        self.system.soft.finished = self._taken
        if bonds:
            self.system.contact[soft] = False
            self.system.soften(bonds)

    def _free_open(self, pair: Pair, normals: Ints, free: Ints) -> None:
        """Free open components; a body that only contact holds begins with all of it closed.

        Raises:
            SolverError: Nothing holds a body once its open part is open.
        """
        try:
            self.system.release(free)
        except NotPositiveDefinite as error:
            if not pair.interface.contact:
                raise SolverError(mumps_message(-10, 0)) from error
            normals = normals[normals >= 0]
            self.system.closed[normals] = True
            self.system.release(np.setdiff1d(free, normals))

    def _let_touch(self, pair: Pair, front: Front, index: Ints) -> None:
        normals = index[~front.bonded & pair.paired, 0]
        normals = normals[normals >= 0]
        self.system.touches[normals] = True
        self.system.contact[normals[~np.isin(normals, self.system.soft.components)]] = True

    def holds(self, p: int, nodes: Ints) -> bool:
        """Whether the window holds all jumps of some slave nodes that may differ from zero."""
        pair, index, held = self.pairs[p], self.index[p], self.held_by_supports[p]
        missing = (index[nodes] < 0) & ~held[nodes]
        if pair.interface.normal_only:
            missing[:, 1:] = False
        missing[~pair.paired[nodes]] = False
        return not missing.any()

    def rebase(self) -> None:
        """Factor again around the present fronts; the state is solved for anew; collective.

        Given forces are lost: the caller sets them again (see :meth:`solve`).
        """
        self.rebases += 1
        self._remember()
        loads = self.state.loads
        self._rebase()
        self.state = Equilibrium(
            loads,
            np.zeros(self.system.n_retained),
            np.zeros(self.system.n_retained),
            np.zeros(self.n_loads),
        )

    def start(self) -> None:
        """Find the equilibrium without loads; collective."""
        zero = np.zeros(self.system.n_retained)
        self.state = self.system.equilibrium(np.zeros(self.n_loads), zero)

    def solve(self, force: Array) -> None:
        """Find the equilibrium at the present loads with given forces, shape (n_retained,)."""
        self.state = self.system.equilibrium(self.state.loads, force)

    def vectors(self, p: int, nodes: Ints, values: Array) -> Array:
        """Jump or force components at slave nodes as global vectors.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (...,).
            values: Values per window component, shape (n_retained,).

        Returns:
            Shape (..., 3); zero where a component is outside the window.
        """
        index = self.index[p][nodes]
        local = np.where(index >= 0, values[np.maximum(index, 0)], 0.0)
        out = np.zeros((*index.shape[:-1], 3))
        out[..., : self.continuum.gdim] = np.einsum(
            "...ck,...k->...c", self.frames[p][nodes], local
        )
        return out

    def components(self, p: int, nodes: Ints) -> Ints:
        """Window components of slave nodes."""
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

    def destroy(self) -> None:
        """Free all PETSc objects; collective."""
        if self._condensation is not None:
            self._condensation.destroy()
            self._condensation = None
        if self.columns is not None:
            self.columns.destroy()
        for vector in self._borders:
            vector.destroy()
        if self._stiffness is not None:
            self._stiffness.destroy()
            self._stiffness = None
        self._borders = []
