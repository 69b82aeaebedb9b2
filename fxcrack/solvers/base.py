"""What the steps, criteria and output of an analysis may ask of its solver."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.timings import Timings
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.loads import Load, Monitor
from fxcrack.equilibrium.cohesive_bonds import CohesiveCounts
from fxcrack.equilibrium.cohesive_law import CohesiveUnit
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.equilibrium.interface_state import Arrays, InterfaceState
from fxcrack.interface.crack_fluid import CrackFluid
from fxcrack.interface.front import Front
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports


class AnySolver(Protocol):
    """Bodies and interfaces, whatever the bodies are made of and however their state is found.

    The interfaces are known by their jumps: components of the jump between the faces at slave
    nodes, numbered from 0. All methods are collective.

    Attributes:
        continuum: Displacement space of the bodies.
        pairs: Interfaces.
        supports: Prescribed components.
        loads: Force patterns.
        monitors: Monitored displacements.
        fronts: Fronts per pair.
        n_loads: Number of supports and force patterns together.
        state: Present state: loads, given forces and jumps, and what is conjugate to the loads.
        index: Number of each jump that is known per pair, -1 elsewhere, shape (n_nodes, gdim).
        frames: Frame of each slave node per pair, shape (n_nodes, gdim, gdim).
        held_by_supports: Jumps that supports hold at zero per pair, shape (n_nodes, gdim).
        active: Whether the crack may grow, per pair.
        around: Distances ahead of and behind the tips that the criterion needs, per pair, length.
        timings: Seconds per phase and number of factorisations.
    """

    continuum: Continuum
    pairs: list[Pair]
    supports: Supports
    loads: list[Load]
    monitors: list[Monitor]
    fronts: list[Front]
    n_loads: int
    state: Equilibrium
    index: list[Ints]
    frames: list[Array]
    held_by_supports: list[Bools]
    active: list[bool]
    around: list[tuple[float, float]]
    timings: Timings

    def probe(self, p: int) -> Any:
        """The :class:`fxcrack.criteria.probe.FrontProbe` of a pair."""

    def holds(self, p: int, nodes: Ints) -> bool:
        """Whether all jumps of some slave nodes that may differ from zero are known.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (n,).
        """

    def remaining(self, p: int) -> tuple[Ints, Array]:
        """Bonds of a pair that soften with their opening.

        Returns:
            Their slave nodes, and the fraction of the force at debonding that remains at each,
            both of shape (n,).
        """

    def collect(self) -> Arrays:
        """The accepted state as plain arrays by name, for a checkpoint."""

    def resume(self, arrays: Arrays, time: float) -> None:
        """Take a state that :meth:`collect` gave.

        Args:
            arrays: By name, of the shapes that :meth:`collect` gave; the same on all ranks, of any
                number of ranks.
            time: Time of the state.

        Raises:
            InputError: The arrays do not fit the mesh.
        """

    def stored(self, state: Equilibrium) -> dict[str, float]:
        """Energies stored in the bodies, by name."""

    def spent(self) -> dict[str, float]:
        """Energies the bodies have turned into something else, by name."""

    def displacement(self, state: Equilibrium | None = None) -> PETSc.Vec:
        """Displacement of a state, the present one by default; the caller destroys it."""

    def nodal_forces(self, u: PETSc.Vec, state: Equilibrium | None = None) -> PETSc.Vec:
        """Forces of interfaces and supports on the bodies; the caller destroys them.

        Args:
            u: Displacements of the state, from :meth:`displacement`.
            state: The state whose loads act; the present one by default.
        """

    def vectors(self, p: int, nodes: Ints, values: Array) -> Array:
        """Jump or force components at slave nodes as global vectors.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (...,).
            values: Values of the numbered jumps, shape (n_jumps,).

        Returns:
            Shape (..., 3); zero where a component has no number.
        """

    def destroy(self) -> None:
        """Free all PETSc objects."""


class Solver(AnySolver, Protocol):
    """Bodies condensed onto their interfaces, in equilibrium.

    The interfaces are known by their retained jumps, numbered 0 to n_retained - 1. All methods are
    collective.

    How a solver moves along the load is its own: a linear one follows the exact pieces of
    ``system.pieces``, a nonlinear one finds trial equilibria
    (:meth:`fxcrack.solvers.newton.NewtonSolver.move`).

    Attributes:
        prepared: Whether :meth:`prepare` has been called.
        system: The dense system on the retained jumps.
        state: Set by the caller that moves along a piece of the load path.
        fluids: Pressures that follow the crack of bodies of finite strain.
        face_loads: Force of every force pattern on the retained jumps, shape (n_retained,
            n_forces).
        rebases: Sets of retained jumps chosen since the step began.
        friction_energy: Energy dissipated by friction so far.
        overlap_energy: Energy given by contact that pushed overlapping faces apart so far.
        law_seconds: Seconds per law of the interface (contact, friction, softening).
        soft_counts: Effort spent on softening bonds.
    """

    prepared: bool
    system: ContactSystem
    face_loads: Array
    fluids: list[CrackFluid]
    rebases: int
    friction_energy: float
    overlap_energy: float
    law_seconds: dict[str, float]
    soft_counts: CohesiveCounts

    # -- retained jumps ------------------------------------------------------------------

    def prepare(self, active: list[bool], reach: list[float]) -> None:
        """Choose the retained jumps for a step, and condense the bodies onto them.

        The state is carried over.

        Args:
            active: Interfaces that may grow in the step.
            reach: Distance the crack may grow per interface, inf if unknown, length.
        """

    def rebase(self) -> None:
        """Choose the retained jumps around the present fronts, and condense again.

        The state is carried over.
        """

    # -- from equilibrium to equilibrium -------------------------------------------------

    def begin_motion(self, dt: float) -> None:
        """Let bodies with inertia that nothing holds begin without an equilibrium.

        Called before the first :meth:`prepare`.

        Args:
            dt: Length of the first increment, time.
        """

    def start(self) -> None:
        """Find the equilibrium without loads."""

    def commit(self) -> None:
        """Accept the present state."""

    def remember(self) -> Any:
        """What :meth:`recall` needs to return to the present accepted state."""

    def recall(self, saved: Any) -> None:
        """Return to an earlier state: interfaces, bodies, loads, energies.

        Args:
            saved: From :meth:`remember`.
        """

    def interface_state(self) -> InterfaceState:
        """The present state of the interfaces alone."""

    def restore_interfaces(self, saved: InterfaceState) -> None:
        """Return to an earlier state of the interfaces alone, on the same retained jumps."""

    def undo(self, saved: Any, rebases: int) -> None:
        """Return to an earlier state, be the retained jumps others since.

        Collective.

        Args:
            saved: From :meth:`remember`.
            rebases: Value of :attr:`rebases` then.
        """

    # -- bonds ---------------------------------------------------------------------------

    def displacement_of_jumps(self, jump: Array) -> PETSc.Vec:
        """Change of displacement by a change of retained jumps, shape (n_retained,); collective.

        Loads stay as they are; the caller destroys it.
        """

    def release(self, p: int, nodes: Ints, force: Array) -> tuple[float, float]:
        """Release nodes at constant load and find the new equilibrium.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (n,).
            force: Given forces afterwards, shape (n_retained,), force.

        Returns:
            Energy released by the bond forces on their way, and external work.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
            ConvergenceError: No equilibrium without these bonds was found.
        """

    def soften(self, p: int, units: Sequence[CohesiveUnit]) -> None:
        """Let the bond forces of units fall linearly with their opening.

        Args:
            p: Number of the pair.
            units: What softens by one law each; bonded so far.

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
        """

    def open(self, p: int, nodes: Ints) -> None:
        """Make the forces of nodes known instead of their jumps; they keep their values.

        Args:
            p: Number of the pair.
            nodes: Slave nodes, shape (n,).

        Raises:
            NotPositiveDefinite: A body would come free; nothing is changed.
        """

    # -- energies ------------------------------------------------------------------------

    def along(self, here: Equilibrium, point: Equilibrium) -> tuple[float, float, Array]:
        """External work, energy released by bonds, and mean jumps of a piece of the load path.

        Args:
            here: Equilibrium at its beginning.
            point: Equilibrium at its end.

        Returns:
            Two energies, and the mean jumps, shape (n_retained,), length.
        """

    def book_contact(self, here: Equilibrium, point: Equilibrium) -> None:
        """Book the energies of contact along a piece of the load path.

        Friction dissipates; faces that overlap give energy as contact pushes them apart.
        """

    def extra_work(self, state: Equilibrium) -> float:
        """Work on the bodies beyond that of supports and force patterns."""

    # -- fields --------------------------------------------------------------------------

    def components(self, p: int, nodes: Ints) -> Ints:
        """Numbers of the retained jumps of slave nodes, shape (k,)."""

    def follow(self, nodes: npt.NDArray[np.integer]) -> int:
        """Follow the mean displacement of some nodes from the first step on.

        Args:
            nodes: Those of them that this rank owns, shape (n,).

        Returns:
            Its number in :meth:`motion`.
        """

    def motion(self, state: Equilibrium) -> Array:
        """Displacements that are followed, shape (n_followed, gdim), length."""


__all__ = ["AnySolver", "Solver"]
