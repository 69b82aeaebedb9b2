"""The linear continuum as its interfaces see it: one factorisation, then dense algebra.

A :class:`CondensedModel` knows which nodes are bonded, open or in contact, gives equilibrium
states for loads, bond forces and openings at the tips, and lets nodes go. It factors again only
when the front leaves the window.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy.linalg import cho_solve

from fxcrack import log
from fxcrack.continuum import Continuum
from fxcrack.errors import ComesApart, InputError, SolverError
from fxcrack.interface.front import Front, Tips
from fxcrack.interface.jumps import WINDOW, JumpCoordinates, build_coordinates
from fxcrack.interface.pairing import Pair
from fxcrack.interface.supports import Supports
from fxcrack.loads import Load, Monitor
from fxcrack.solve.cholesky import NotPositiveDefinite
from fxcrack.solve.condensation import Condensation, Timings, border_vectors
from fxcrack.solve.cost import too_large_for_direct
from fxcrack.solve.iterative_condensation import ColumnStore, IterativeCondensation, Roles
from fxcrack.solve.jump_system import Equilibrium, JumpSystem, bond_work, work_between
from fxcrack.solve.machine import machine_memory_mb
from fxcrack.solve.petsc_schur import mumps_message
from fxcrack.solve.rigid import check_held
from fxcrack.solve.rubbing import FrictionMemory, let_go, meet, nodes_of, rubs
from fxcrack.solve.soft_bond import SoftBond, SoftUnit
from fxcrack.solve.softening import SoftCounts
from fxcrack.solve.window import ColumnCost, CostModel, choose_roles

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_ROUND_OFF = 1e-12
"""Of an entry of S, by the diagonal of A. Measured: up to 2e-13 of it in nearly incompressible
bodies, with either PETSc; the pivots of slender ones (450 to 1) that are held are 7e-7 or more."""
_UNBOUNDED = 1e100
"""Jump per force of a unit that holds a body alone."""


METHODS = ("auto", "schur", "columns", "iterative")


@dataclass(frozen=True)
class CondensedOptions:
    """How the condensation is done.

    Args:
        method: "schur", "columns" (both factor the bodies, see :class:`Condensation`), "iterative"
            (columns by conjugate gradients with multigrid, no factorisation: for 3-D models too
            large for one) or "auto": "schur" where it is available, "iterative" where the factors
            of a 3-D model would not fit the memory of the machine.
        window_mb: Memory the dense matrices of the window may take, and the stored columns of
            "iterative" before old ones are dropped, MB.
        rows: Force the window to reach at most this distance ahead of the front (length);
            ``None`` lets the cost model decide.
        rtol: "iterative" only: energy norm of a column's error over that of the column. The error
            of S is its square.

    Raises:
        InputError: The method is unknown or the tolerance makes no sense.
    """

    method: str = "auto"
    window_mb: float = 2000.0
    rows: float | None = None
    rtol: float = 1e-6

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            names = ", ".join(f"'{m}'" for m in METHODS)
            raise InputError(f"method = '{self.method}': choose one of {names}")
        if not 1e-12 <= self.rtol <= 1e-2:
            raise InputError(f"rtol = {self.rtol}: choose a tolerance from 1e-12 to 1e-2")


class CondensedModel:
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
        self.soft_counts = SoftCounts()
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
        self._soft: list[SoftBond] = []
        self._taken = 0.0
        self._rubbed = FrictionMemory.empty(continuum.gdim) if rubs(pairs) else None
        self.friction_energy = 0.0
        self._cost = CostModel.guess(continuum.n_global, continuum.gdim)
        self._column_cost = ColumnCost.guess(continuum.n_global)
        self.columns: ColumnStore | None = None
        if options.method == "iterative" or (options.method == "auto" and self._too_large()):
            self.columns = ColumnStore(
                continuum, pairs, supports, rtol=options.rtol, cap_mb=options.window_mb
            )
        self._stiffness: PETSc.Mat | None = None
        self._borders: list[PETSc.Vec] = []
        self._condensation: Condensation | IterativeCondensation | None = None
        self.system: JumpSystem
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

    # -- the window ----------------------------------------------------------------------

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

    def take_over(self, bonds: list[SoftBond], finished: float) -> None:
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
        for front, held in zip(self.fronts, coordinates.held, strict=True):
            front.tied = held.all(axis=1)
        self._condense(coordinates)
        self.system.seconds, self.system.soft.counts = self.law_seconds, self.soft_counts
        start = time.perf_counter()
        self._restore_states()
        self.timings.add("march", start)
        log.info(
            "factorisation %d: %d coordinates in the window",
            self.timings.factorizations,
            coordinates.n_window,
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
        self._borders = border_vectors(self.continuum, self.loads, self.monitors, self._followed)
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
            self.continuum, self.pairs, roles, self.supports, len(self._borders)
        )
        self.timings.add("transform", start)
        return coordinates

    def _condense(self, coordinates: JumpCoordinates) -> None:
        """Factor, and set up the dense system of the window; collective."""
        assert self._stiffness is not None
        if self.columns is None:
            start = time.perf_counter()
            self._condensation = Condensation(
                self._stiffness,
                coordinates,
                self._borders,
                self.timings,
                method=self.options.method,
            )
            seconds = self.continuum.comm.bcast(time.perf_counter() - start)
            self._cost.observe(coordinates.n_window, seconds)
        assert self._condensation is not None
        self.system = JumpSystem(
            self._condensation.schur, coordinates.n_window, self.n_loads, len(self.loads)
        )
        if isinstance(self._condensation, Condensation):
            # a body that is nearly incompressible has a much larger diagonal than S
            diagonal = self._condensation.diagonal
            self.system.cholesky.round_off = _ROUND_OFF * np.abs(diagonal)
        self._face_loads = -self._condensation.borders_on_window[:, : len(self.loads)]
        # a temperature acts on no face; its force on a node at an end does not follow the crack
        self._face_loads[:, [not isinstance(x, Load) for x in self.loads]] = 0.0

    def _condense_by_columns(self, columns: ColumnStore, roles: Roles) -> JumpCoordinates:
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
            meet(self.system, self.pairs, self.fronts, self.index, self._rubbed)
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
            np.zeros(self.system.n_window),
            np.zeros(self.system.n_window),
            np.zeros(self.n_loads),
        )

    def start(self) -> None:
        """Find the equilibrium without loads; collective."""
        zero = np.zeros(self.system.n_window)
        self.state = self.system.equilibrium(np.zeros(self.n_loads), zero)

    def solve(self, force: Array) -> None:
        """Find the equilibrium at the present loads with given forces, shape (n_window,)."""
        self.state = self.system.equilibrium(self.state.loads, force)

    # -- quantities at the tips ----------------------------------------------------------

    def vectors(self, p: int, nodes: Ints, values: Array) -> Array:
        """Jump or force components at slave nodes as global vectors.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (...,).
            values: Values per window component, shape (n_window,).

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

    def bond_forces(self, p: int, tips: Tips, state: Equilibrium) -> Array:
        """Tension-positive bond forces at the tips in the tip frames, shape (n, k, 3).

        Loads on the crack faces are carried on to the faces that would open.
        """
        index = self.index[p][tips.force_nodes]
        rows = np.unique(index[index >= 0])
        values = np.zeros(self.system.n_window)
        values[rows] = -self.system.forces(state, rows)
        vectors = self.vectors(p, tips.force_nodes, values)
        if np.any(self._face_loads):
            vectors = vectors + self._loads_to_come(p, tips, state)
        out = np.einsum("nci,nkc->nki", tips.frame, vectors)
        if tips.force_nodes.shape[1] > 1:
            # at the end of a surface there is no midside node ahead
            out[tips.force_nodes[:, 0] == tips.force_nodes[:, 1], 1] = 0.0
        return np.asarray(out)

    def _loads_to_come(self, p: int, tips: Tips, state: Equilibrium) -> Array:
        """Load on the faces the crack is about to open, if that of the wake goes on there.

        A pressure p on the faces leaves the bond forces short by p times the part of the tip's
        tributary area that is still bonded (as superposing the uniform stress -p shows); without
        this the error of G goes with the square root of the element size only.

        Returns:
            Global vectors per force node, shape (n, k, 3).
        """
        areas = self.pairs[p].surface.areas
        loads = self._face_loads @ state.loads[self.n_loads - len(self.loads) :]
        wake = self.vectors(p, tips.wake_nodes, loads).sum(axis=(1, 2))
        density = wake / areas[tips.wake_nodes].sum(axis=(1, 2))[:, None]
        whole = areas[tips.force_nodes][..., None] * density[:, None]
        present = self.vectors(p, tips.force_nodes, loads)
        to_come = whole - present
        to_come[~np.any(density, axis=1)] = 0.0
        return np.asarray(to_come)

    def openings(self, p: int, tips: Tips, state: Equilibrium) -> Array:
        """Openings behind the tips in the tip frames, shape (n, k, 3), length."""
        jump = self.vectors(p, tips.wake_nodes, state.jump)
        jump = np.einsum("nkm,nkmc->nkc", tips.wake_weights, jump)
        return np.asarray(np.einsum("nci,nkc->nki", tips.frame, jump))

    def closure_jumps(self, p: int, tips: Tips, force: Array) -> Array:
        """Jumps that letting each unit go alone would open, shape (n, k, 3), length.

        Args:
            p: Number of the pair.
            tips: Front nodes.
            force: Their bond forces in tip frames, shape (n, k, 3).
        """
        out = np.zeros_like(force)
        gdim = self.continuum.gdim
        for i in range(len(tips)):
            nodes = np.unique(tips.force_nodes[i])
            index = self.index[p][nodes]
            slot = index >= 0
            if force[i, : len(nodes), 0].sum() <= 0.0:
                slot[:, 0] = False  # pressed together: it stays closed, shear alone is released
            star = self.system.reduced(index[slot])
            try:
                factor = self.system.cholesky.factorise(star, index[slot])
            except NotPositiveDefinite:
                factor = np.eye(len(star)) / np.sqrt(_UNBOUNDED)
            vector = np.einsum("ci,ki->kc", tips.frame[i], force[i, : len(nodes)])
            order = np.searchsorted(nodes, tips.force_nodes[i, : len(nodes)])
            local = np.einsum("kci,kc->ki", self.frames[p][nodes[order]], vector[:, :gdim])
            right = np.zeros((len(nodes), gdim))
            right[order] = local
            jump = np.zeros((len(nodes), gdim))
            jump[slot] = cho_solve((factor, True), right[slot])
            jump = jump[order]
            world = np.zeros((len(nodes), 3))
            world[:, :gdim] = np.einsum("kci,ki->kc", self.frames[p][nodes[order]], jump)
            out[i, : len(nodes)] = world @ tips.frame[i]
        return out

    # -- letting go ----------------------------------------------------------------------

    def soften(self, p: int, units: Sequence[SoftUnit]) -> None:
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
        for nodes, spend, pressed in units:
            row, local = np.nonzero(self.index[p][nodes] >= 0)
            components = self.index[p][nodes[row], local]
            traction = -system.forces(state, components)
            if pressed:
                stays = (local == 0) & (traction < 0.0)
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
                SoftBond(
                    components, traction / strength, strength, 2.0 * spend / strength,
                    (p, nodes[row], local),
                )
            )  # fmt: skip
        every = np.concatenate([unit.nodes for unit in units])
        self.fronts[p].release(every)
        if bonds:
            system.soften(bonds)
            if self.pairs[p].interface.contact:
                normals = self.index[p][every, 0]
                system.touches[normals[normals >= 0]] = True
        self.state = Equilibrium(state.loads, force, state.jump, state.conjugate)

    def components(self, p: int, nodes: Ints) -> Ints:
        """Window components of slave nodes."""
        index = self.index[p][nodes]
        return index[index >= 0]

    def open(self, p: int, nodes: Ints) -> None:
        """Make the forces of nodes known instead of their jumps; they keep their values.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
        """
        system, state = self.system, self.state
        if system.friction is not None and self.pairs[p].interface.contact:
            force = let_go(system, p, self.pairs[p], self.index[p], nodes, state)
            self.fronts[p].release(nodes)
            self.state = Equilibrium(state.loads, force, state.jump, state.conjugate)
            return
        components = self.components(p, nodes)
        components = components[~system.free[components]]
        force = state.force.copy()
        force[components] = system.forces(state, components)
        system.release(components)
        self.fronts[p].release(nodes)
        if self.pairs[p].interface.contact:
            self._let_touch(self.pairs[p], self.fronts[p], self.index[p])
        self.state = Equilibrium(state.loads, force, state.jump, state.conjugate)

    def release(self, p: int, nodes: Ints, force: Array) -> tuple[float, float]:
        """Let nodes go at constant load and find the new equilibrium.

        Args:
            p: Number of the pair.
            nodes: Slave nodes.
            force: Given forces afterwards, shape (n_window,).

        Returns:
            Energy set free by the bond forces on their way, and external work.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
            ComesApart: So it would once bonds that soften have opened; likewise.
        """
        before, saved, spent = self.state, self.remember(), self.friction_energy
        self.open(p, nodes)
        released, work, last = 0.0, 0.0, self.state
        try:
            for _, point in self.system.pieces(last, last.loads, force):
                more, out, _ = self.along(last, point)
                work, released = work + more, released + out
                self.rub(last, point)
                last = point
        except (NotPositiveDefinite, ComesApart):
            self.state, self.friction_energy = before, spent
            self.fronts[p].bond(nodes)
            self.recall(saved)
            raise
        self.state = last
        return released, work

    def accept(self) -> None:
        """The present state is good; linear bodies remember nothing else."""

    def remember(self) -> Any:
        """What :meth:`recall` needs to return to the present state, with the same bonds."""
        return self.system.snapshot()

    def recall(self, saved: Any) -> None:
        """Return to an earlier state; ``state`` itself is the caller's to set before."""
        self.system.restore(saved)

    def along(self, here: Equilibrium, point: Equilibrium) -> tuple[float, float, Array]:
        """External work, energy out through bonds, mean jumps of a linear piece."""
        work = work_between(here, point, len(self.loads))
        return work, bond_work(here, point), 0.5 * (here.jump + point.jump)

    def stored(self, state: Equilibrium) -> dict[str, float]:
        """Energies stored in the bodies, by name; collective."""
        return {"strain_energy": self.system.strain_energy(state) + self._thermal_part(state)}

    def spent(self) -> dict[str, float]:
        """Energies the bodies have turned into something else, by name; linear ones none."""
        return {}

    def extra_work(self, state: Equilibrium) -> float:
        """Work on the bodies beyond that of supports and force patterns: of a temperature."""
        return self._thermal_part(state)

    def _thermal_part(self, state: Equilibrium) -> float:
        """What a temperature, which counts as a load here, adds to work and stored energy alike.

        -sum_k a_k f_k u + 1/2 sum_kl a_k a_l E_kl  (:func:`fxcrack.thermal.held_energies`)
        """
        if not self._n_thermal:
            return 0.0
        if self._held is None:
            from fxcrack.thermal import held_energies

            self._held = held_energies(self.continuum)
        factors, answers = state.loads[-self._n_thermal :], state.conjugate[-self._n_thermal :]
        return float(0.5 * factors @ self._held @ factors - factors @ answers)

    def rub(self, here: Equilibrium, point: Equilibrium) -> None:
        """Account for the energy friction takes along a linear piece."""
        if self.system.friction is not None:
            self.friction_energy += self.system.friction.dissipation(self.system, here, point)

    # -- displacements that criteria follow ----------------------------------------------

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

    # -- the way back to fields ----------------------------------------------------------

    def displacement(self, state: Equilibrium | None = None) -> PETSc.Vec:
        """Displacement vector of a state; collective; the caller destroys it."""
        state = self.state if state is None else state
        assert self._condensation is not None
        last = np.zeros(len(self.system.schur))
        last[: self.system.n_window] = state.jump
        last[self.system.n_window : self.system.n_window + self.n_loads] = state.loads
        return self._condensation.displacement(last)

    def nodal_forces(self, u: PETSc.Vec, state: Equilibrium | None = None) -> PETSc.Vec:
        """Forces of interfaces and supports on the bodies, K u - f.

        Collective; the caller destroys the vector.

        Args:
            u: Displacements of the state, from :meth:`displacement`.
            state: The state whose loads act; the present one by default.
        """
        state = self.state if state is None else state
        assert self._stiffness is not None
        out = self._stiffness.createVecLeft()
        self._stiffness.mult(u, out)
        # the first borders are the force patterns with the minus sign; monitors follow
        factors = state.loads[self.n_loads - len(self.loads) :]
        for factor, border in zip(factors, self._borders, strict=False):
            out.axpy(float(factor), border)
        return out

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


__all__ = ["WINDOW", "CondensedModel", "CondensedOptions"]
