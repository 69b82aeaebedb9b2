"""Explicit dynamics: central differences, lumped masses, exact bonds; no factorisation.

    f = f_ext - f_int(u^n) - r_M M v^{n-1/2} + forces of interfaces and supports
    v^{n+1/2} = v^{n-1/2} + h f/m,    u^{n+1} = u^n + dt v^{n+1/2}

h is the mean of the last increment and the present one, half of it in the first. Energies belong to
the middle of increments. Work counts with the mean velocity, f . h (v^{n-1/2} + v^{n+1/2})/2, with
which for linear bodies and constant dt

    T = 1/2 v . M v,   U = 1/2 u^n . f_int(u^{n+1}),   change of T + U = work of all other forces

holds to round-off (of nonlinear bodies to the square of the increment, with U below).

An increment has two halves: :meth:`ExplicitSolver.begin` finds forces and accelerations at the
present displacement, where criteria look at them and bonds are released;
:meth:`ExplicitSolver.finish` moves the bodies.
"""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from typing import Any

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.sparse import add_multiple
from fxcrack.base.timings import Timings
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.follower_pressure import FollowerPressure
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.continuum.loads import Load, Monitor
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.starting_velocity import starting_velocity
from fxcrack.continuum.term import Term
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.interface.front import Front
from fxcrack.interface.jump_coordinates import global_vectors
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports
from fxcrack.solvers.explicit_accounts import EnergyAccounts
from fxcrack.solvers.explicit_bodies import BodyMotion
from fxcrack.solvers.explicit_checkpoints import MotionCheckpoints
from fxcrack.solvers.explicit_energies import MotionEnergies, sums_over_ranks
from fxcrack.solvers.explicit_fields import MotionFields
from fxcrack.solvers.explicit_further import FurtherForces
from fxcrack.solvers.explicit_ghosts import GhostMotion
from fxcrack.solvers.explicit_interface import dynamics_of
from fxcrack.solvers.explicit_joints import JointForces
from fxcrack.solvers.explicit_kinematics import Kinematics
from fxcrack.solvers.explicit_loads import LoadsAndMonitors
from fxcrack.solvers.explicit_mass import ScaledMass
from fxcrack.solvers.explicit_moving import MovingInterfaces, sliding_masters
from fxcrack.solvers.explicit_outer import OuterForces
from fxcrack.solvers.explicit_points import FacePoints
from fxcrack.solvers.explicit_present import PresentInterface
from fxcrack.solvers.explicit_probe import ExplicitFrontProbe
from fxcrack.solvers.explicit_stability import Stability
from fxcrack.solvers.explicit_state import Arrays, InterfaceSnapshot, MotionSnapshot
from fxcrack.solvers.explicit_supports import PrescribedMotion
from fxcrack.solvers.options import ExplicitOptions
from fxcrack.solvers.stable_increment import chosen_increment


class ExplicitSolver:
    """Bodies, interfaces and loads in explicit dynamics.

    Args:
        continuum: Displacement space; first order.
        pairs: Interfaces.
        supports: Prescribed components.
        loads: Force patterns.
        monitors: Monitored displacements.
        terms: What acts in the bodies, all but inertia.
        effect: Density, damping and velocity at the start.

    Raises:
        InputError: The bodies are not made for explicit dynamics.

    Attributes:
        Those of :class:`fxcrack.solvers.base.AnySolver`, and
        bodies: Internal forces, with the displacement.
        mass: Mass of the owned dofs, and what mass scaling has added to it.
        energies: What went in and out so far.
        lumped: Interfaces with lumped masses.
        dynamics: Motion and forces of the interfaces.
        present: Bond forces and jumps of the present increment.
        joints: Forces at kinks and T joints of shells.
        stability: The stable increment.
        further: Pressures that follow the bodies, bulk viscosity.
        dt: Increment, time.
        stable: Largest stable increment, time.
        at: Time of the displacement.
        increments: How many were done.
        seconds: Seconds per part of an increment.
    """

    def __init__(
        self,
        continuum: Continuum,
        pairs: list[Pair],
        supports: Supports,
        loads: list[Load],
        monitors: list[Monitor],
        *,
        terms: Sequence[Term],
        effect: Inertia,
    ) -> None:
        self.continuum, self.pairs, self.supports = continuum, pairs, supports
        self.loads, self.monitors = loads, monitors
        self.comm = continuum.comm
        self.timings = Timings()
        self.fronts = [Front(p.surface, p.bonded, p.title) for p in pairs]
        self.n_loads = len(supports.columns) + len(loads)
        self.active = [False] * len(pairs)
        self.around = [(0.0, 0.0)] * len(pairs)
        following = [t for t in terms if isinstance(t, FollowerPressure)]
        self.bodies = InternalForces(continuum, [t for t in terms if t not in following])
        self.mass = ScaledMass.of(continuum, effect)
        self.points = points = FacePoints(
            continuum, pairs, self.mass.values, self.mass.height, supports
        )
        self.supports = supports = points.supports
        self.mass.take_points(points)
        if points.exist:
            self.bodies.on_unknowns = points
        self._effect = effect
        self.further = FurtherForces(continuum, following, self.bodies.u)
        starting = points.motion(starting_velocity(continuum, effect.velocity))
        self.at, self.increments = 0.0, 0
        self.dt = self.stable = self.last_dt = 0.0
        self.seconds = {"internal forces": 0.0, "interface": 0.0, "update": 0.0}
        self.energies = MotionEnergies(self.comm)
        self.monitored: list[float] = []
        self._patterns = LoadsAndMonitors(continuum, loads, monitors, points)
        self._masters = sliding_masters(continuum, pairs, finite=self.bodies.finite)
        self.lumped = LumpedInterface(
            continuum.layout, pairs, supports, self.mass.values, self._masters
        )
        self._make_interfaces(starting)
        at_interface = self._kinematics.at_interface
        self.prescribed = PrescribedMotion(supports, self.lumped, at_interface)
        self.joints = JointForces(continuum, supports, points, self.lumped.nodes.nodes)
        chosen = np.concatenate([at_interface, self.prescribed.dofs, self.joints.free])
        self._inside = slice(len(at_interface), len(chosen) - len(self.joints.free))
        self._joined = slice(self._inside.stop, len(chosen))
        self._chosen, self._at_chosen = chosen, np.zeros(len(chosen))
        self._ghosts = ghosts = GhostMotion(continuum, self.bodies.u, at_interface)
        self.motion = BodyMotion(self.bodies, chosen, ghosts.dofs)
        damping = float(effect.rayleigh[0])
        self._outer = OuterForces(
            self._patterns, self.further, self.mass, damping, chosen, self.energies
        )
        self._accounts = EnergyAccounts(
            self.bodies, self.motion, self.mass, self.dynamics, self._patterns, pairs,
            self.energies, damped=damping > 0.0,
        )  # fmt: skip
        # coordinates at the start of the present increment and at its end
        self._now: Array | None = None
        self._then = np.zeros(self.n_loads)
        self._checkpoints = MotionCheckpoints(
            continuum, self.bodies, self.fronts, self._moving, self.present, self.stability
        )
        self._fields = MotionFields(
            continuum, self.bodies, points, self.joints, self.lumped, self.dynamics, self.prescribed
        )
        zero = np.zeros(self.lumped.n_rows * continuum.gdim)
        self.state = Equilibrium(np.zeros(self.n_loads), zero, zero, np.zeros(self.n_loads))

    # -- what does not change ------------------------------------------------------------

    def _make_interfaces(self, velocity: Array) -> None:
        lumped, gdim = self.lumped, self.continuum.gdim
        nodes = lumped.nodes
        self.row_of = lumped.row_of
        self.frames, self.held_by_supports = lumped.pair_frames, lumped.pair_held
        self.dynamics = dynamics_of(lumped, self.pairs, self.fronts, self.continuum)
        self._moving = MovingInterfaces(self.dynamics, self.pairs, self.fronts, self._masters)
        self._kinematics = Kinematics(
            self.continuum, self.bodies, self.points, self.dynamics, velocity
        )
        self.present = PresentInterface(lumped, self.dynamics)
        self.index = self.present.index
        self.stability = Stability(
            self.bodies, self.dynamics, self.further, self._kinematics.at_interface
        )
        self._at_nodes = np.zeros(gdim * len(nodes))
        self._has_face_loads = self._patterns.take_faces(lumped)

    @property
    def velocity(self) -> Array:
        """In the middle of the last increment, owned dofs, shape (n_local,), length/time."""
        return self._kinematics.velocity

    # -- a step begins -------------------------------------------------------------------

    def prepare(self, options: ExplicitOptions, active: list[bool], coordinates: Array) -> None:
        """Choose operator, mass and increment for a step; collective.

        Args:
            options: Controls of the step.
            active: Interfaces that may grow in the step.
            coordinates: Amplitudes of supports and load factors at the start, shape (n_loads,).

        Raises:
            InputError: The increment asked for is not stable.
        """
        start = clock.perf_counter()
        self.active = active
        self.bodies.choose(options.operator)
        self.timings.add("operator", start)
        start = clock.perf_counter()
        if self.mass.choose(options, self.bodies):
            self._take_mass()
        self.energies.is_viscous |= self.stability.take_viscosity(options, self._effect)
        self.stable = self.stability.find(self.mass.values, self.velocity)
        self.motion.prepare(self.mass.inverse)
        self._outer.prepare()
        self.joints.prepare(self.mass.inverse)
        self.dt = chosen_increment(options, self.stable)
        self.timings.add("stable increment", start)
        self.dynamics.open_pairs.penalty = options.penalty if options.contact == "penalty" else None
        if self.increments == 0:
            self._start(coordinates)

    def _take_mass(self) -> None:
        """Give the interfaces the mass that was chosen; collective."""
        lumped = self.lumped
        lumped.mass = lumped.nodes.gather(self.mass.values)[:, 0]
        self.dynamics.set_ties(lumped.tied)

    def follow_bodies(self) -> None:
        """Take front geometry, contact normals and pairs of bodies that move far; collective."""
        self._moving.follow()

    def follow_curved(self) -> None:
        """Take normals and gaps of curved rigid surfaces, in every increment; collective."""
        if self._moving.curved:
            self._moving.follow_curved()

    def renew_stable_increment(self) -> float:
        """The stable increment with the present tangent, by a few more steps; collective."""
        self.stable = self.stability.again(self.velocity)
        return self.stable

    def damping_changed(self, *, fallen: bool) -> bool:
        """Whether quadratic bulk viscosity damps otherwise than at the last look; collective.

        Args:
            fallen: Whether less damping is looked for as well as more.
        """
        return self.stability.damping_changed(self.velocity, self.dt, fallen=fallen)

    def set_displacement(self, owned: Array) -> None:
        """Begin with a displacement of the owned dofs, shape (n_local,), length; collective."""
        self._kinematics.set_displacement(owned)

    def _start(self, coordinates: Array) -> None:
        """Displacements that supports prescribe from the first moment, and the first energies."""
        u = self.bodies.u.x.array
        fixed = np.flatnonzero(self.supports.which >= 0)
        u[fixed] = self.supports.value[fixed] * coordinates[self.supports.which[fixed]]
        self._kinematics.begin(coordinates[: len(self.supports.columns)])
        self._outer.factors = coordinates[len(self.supports.columns) :]
        self.bodies.begin(self.at)
        self.energies.heated = self._accounts.thermal_part(*self._middle())
        stored = self.stored_now()
        stored.pop("mass_scaling_energy", None)  # part of the kinetic energy
        self.energies.initial = sum(stored.values())

    # -- one increment -------------------------------------------------------------------

    def begin(self, now: Array, then: Array) -> None:
        """Forces and accelerations at the present displacement; collective.

        Args:
            now: Coordinates of support columns, then load factors, at present, shape (n_loads,).
            then: The same at the end of the increment.
        """
        t0 = clock.perf_counter()
        columns = len(self.supports.columns)
        self._h = 0.5 * (self.last_dt + self.dt)
        self._now, self._then = now, then
        self._outer.factors, self._coordinates = now[columns:], then[:columns]
        chosen = self._at_chosen
        self.bodies.begin(self.at)
        self.motion.forces(chosen, self._h)
        self.bodies.commit()
        np.negative(chosen, out=chosen)
        if self.dt != self.last_dt:
            self._internal = self.motion.whole()
        moves = self._kinematics
        velocity = moves.velocity if self._outer.needs_velocity else moves.v
        self._outer.begin(chosen, self.at, velocity)
        t1 = clock.perf_counter()
        if len(self.lumped.nodes):
            mine = chosen[: len(moves.at_interface)]
            if self.comm.size > 1:
                mine = self.lumped.nodes.share(mine.reshape(-1, self.continuum.gdim)).ravel()
            self._at_nodes = mine
            self.accelerate()
        if self.joints.exist:
            given = self.prescribed.velocities(moves.u, self._coordinates, self.dt)
            self.joints.find(chosen[self._joined], moves.v, self.prescribed.dofs, given, self._h)
        t2 = clock.perf_counter()
        self.seconds["internal forces"] += t1 - t0
        self.seconds["interface"] += t2 - t1

    def accelerate(self) -> None:
        """Motion of the interface nodes and the forces between them, with the present ties."""
        self.dynamics.accelerate(self._at_nodes, self._coordinates, self._h, self.dt)
        self.present.forget()

    @property
    def face_loads(self) -> Array | None:
        """Loads on the slave side, shape (n_rows + 1, gdim), force; ``None``: there are none."""
        if not self._has_face_loads:
            return None
        out = np.zeros_like(self.present.jumps)
        out[:-1] = self._patterns.on_faces(self._outer.factors)
        return out

    def finish(self) -> None:
        """Move the bodies to the end of the increment; collective."""
        start = clock.perf_counter()
        h, dt, moves, u = self._h, self.dt, self._kinematics, self._kinematics.u
        prescribed, dynamics, outer = self.prescribed, self.dynamics, self._outer
        given = prescribed.velocities(u, self._coordinates, dt)
        reactions = self._reactions_to(given)
        # loads, damping and changes of the increment look at all dofs
        whole = outer.exist or dt != self.last_dt
        v = moves.velocity if whole else moves.v
        before = v.copy() if whole else v
        at_joints = v[self.joints.free]
        old = prescribed.velocity(v, dynamics)
        elastic = None
        if dynamics.elastic.exist and dt != self.last_dt:
            elastic = dynamics.v.copy(), dynamics.gap
        outer.damp(v, h)
        outer.push(v, h)
        self.motion.change_first(v)
        dynamics.advance(h, dt)
        v[prescribed.dofs] = given
        self.joints.move(v, at_joints, self._at_chosen[self._joined], h)
        if whole:
            moves.take_velocity()
        # what neighbours need is on its way during the product
        self._ghosts.start(v, dt, dynamics.u[self.lumped.nodes.mine])
        self.motion.change_others(v)
        power = float(reactions @ (old + prescribed.velocity(v, dynamics)))
        if whole:
            power += outer.power(before, v, h)
        self.energies.work += 0.5 * h * power
        if dt != self.last_dt:
            self._accounts.take_change(
                dt - self.last_dt, self._internal, v - before, elastic, first=not self.increments
            )
        moves.whole = whole
        outer.end()
        add_multiple(u, dt, v)
        moves.take_displacement()
        self._ghosts.finish()
        self.at += dt
        self.last_dt = dt
        self.increments += 1
        self.present.forget()
        self.seconds["update"] += clock.perf_counter() - start

    def reactions(self) -> Array:
        """Reactions of the prescribed dofs of this rank, in the order of :attr:`prescribed`.

        Between :meth:`begin` and :meth:`finish`. Shape (n_prescribed,), force.
        """
        return self._reactions_to(
            self.prescribed.velocities(self._kinematics.u, self._coordinates, self.dt)
        )

    def _reactions_to(self, velocities: Array) -> Array:
        """Reactions where dofs within the bodies are given velocities, shape (n_dofs,)."""
        prescribed, dofs = self.prescribed, self.prescribed.dofs
        acceleration = (velocities - self._kinematics.v[dofs]) / self._h
        within = self.mass.values[dofs] * acceleration - self._at_chosen[self._inside]
        if self.joints.exist:
            within -= self.joints.forces[dofs]
        if not prescribed.holds_nodes:
            return within
        return np.concatenate([within, prescribed.at_nodes(self.lumped, self.dynamics)])

    # -- energies ------------------------------------------------------------------------

    def _middle(self) -> tuple[Array, float, Array]:
        """Velocity, length and load factors of the last increment, in its middle."""
        return self.velocity, self.last_dt, self._outer.mean_factors

    def stored_now(self) -> dict[str, float]:
        """Strain and kinetic energy in the middle of the last increment; collective.

        Before the first increment they are those of the start.
        """
        return self._accounts.stored(*self._middle())

    def stored(self, state: Equilibrium) -> dict[str, float]:
        """Energies stored in the bodies, by name, of the present state; collective."""
        return self.stored_now()

    def spent(self) -> dict[str, float]:
        """Energies that have left the bodies, by name; collective."""
        return self._accounts.spent()

    def external_work(self) -> float:
        """Work of supports, loads and temperature up to the middle of the last increment.

        Collective.
        """
        return self._accounts.external_work(*self._middle())

    # -- going back, and checkpoints -----------------------------------------------------

    def remember(self) -> MotionSnapshot:
        """What :meth:`recall` needs to return to the start of this increment; collective."""
        return MotionSnapshot(
            self._kinematics.u.copy(), self.velocity.copy(),
            InterfaceSnapshot.of(self.dynamics), self.at, self.last_dt,
            self.energies.totals(), self.increments,
            None if self._now is None else (self._now, self._then), self.bodies.state(),
        )  # fmt: skip

    def recall(self, saved: MotionSnapshot) -> None:
        """Return to the start of an earlier increment; fronts are the caller's. Collective."""
        self._kinematics.restore(saved.u, saved.v, saved.interfaces)
        self.at, self.last_dt, self.increments = saved.at, saved.last_dt, saved.increments
        self.energies.restore(saved.sums)
        self.bodies.restore(saved.bodies)
        self._outer.forget()
        if saved.coordinates is not None:
            self.begin(*saved.coordinates)

    def collect(self) -> Arrays:
        """The state at the start of this increment as plain arrays; collective.

        See :class:`fxcrack.solvers.explicit_checkpoints.MotionCheckpoints`.
        """
        self.record_state()
        return self._checkpoints.arrays(self.remember(), self.state, self.stable)

    def resume(self, arrays: Arrays, time: float) -> None:
        """Take a state that :meth:`collect` gave; collective.

        Args:
            arrays: By name, of the shapes that :meth:`collect` gave.
            time: Time of the state.

        Raises:
            InputError: The arrays do not fit the mesh.
        """
        self.recall(self._checkpoints.resumed(arrays))

    # -- what criteria and output ask ----------------------------------------------------

    def record_state(self) -> None:
        """Take the present loads, reactions, jumps and forces as :attr:`state`; collective."""
        assert self._now is not None
        columns = len(self.supports.columns)
        u = self._kinematics.u
        reactions = self._fields.reactions_by_column(self.reactions(), columns)
        conjugate = [*reactions.tolist(), *self._patterns.conjugates(u)]
        sums = sums_over_ranks(self.comm, *conjugate, *self._patterns.monitored(u))
        self.monitored = sums[len(conjugate) :]
        force, jumps = self.present.in_frames()
        self.state = Equilibrium(self._now, force, jumps, np.array(sums[: len(conjugate)]))

    def about(self) -> dict[str, Any]:
        """What is worth keeping with a history, plain types."""
        choice = self.bodies.choice
        shells = isinstance(self.continuum, ShellBodies)
        more = {"director_inertia": self.mass.director_factor(self.continuum)} if shells else {}
        return more | {
            "increments": self.increments,
            "dt": self.dt,
            "stable_increment": self.stable,
            "operator": choice.name,
            "operator_reason": choice.why,
            "increment_seconds": dict(self.seconds),
        }

    def probe(self, p: int) -> ExplicitFrontProbe:
        """What criteria may ask of a pair."""
        return ExplicitFrontProbe(self, p)

    def holds(self, p: int, nodes: Ints) -> bool:
        """Whether all of some slave nodes, shape (n,), have a jump, or no master."""
        return bool(np.all((self.row_of[p][nodes] >= 0) | ~self.pairs[p].paired[nodes]))

    def remaining(self, p: int) -> tuple[Ints, Array]:
        """Slave nodes of a pair that soften, and the remaining fraction of the force at each."""
        rows, bonds = self.row_of[p], self.dynamics.bonds
        nodes = np.flatnonzero(rows >= 0)
        nodes = nodes[bonds.active[rows[nodes]]]
        return nodes, bonds.remaining(rows[nodes])

    def vectors(self, p: int, nodes: Ints, values: Array) -> Array:
        """Jump or force components at slave nodes, shape (...,), as global vectors.

        Args:
            p: Number of the pair.
            nodes: Slave nodes.
            values: Values of the numbered jumps, shape (n_jumps,).

        Returns:
            Shape (..., 3).
        """
        return global_vectors(self.index[p][nodes], self.frames[p][nodes], values)

    def displacements_of(self, where: list[Ints]) -> Array:
        """Mean displacements of sets of owned nodes, shape (n_sets, gdim); collective."""
        return self._fields.means(where)

    def displacement(self, state: Equilibrium | None = None) -> PETSc.Vec:
        """Present displacement; collective; the caller destroys it."""
        return self._fields.displacement()

    def nodal_forces(self, u: PETSc.Vec, state: Equilibrium | None = None) -> PETSc.Vec:
        """Forces of interfaces, joints and supports on the bodies; the caller destroys them.

        They are what the acceleration needs beyond internal forces and loads, M a - f. Collective,
        between :meth:`begin` and :meth:`finish`, of the present state alone.
        """
        forces = self._at_nodes.reshape(-1, self.continuum.gdim)
        return self._fields.forces(self._kinematics.at_interface, forces, self.reactions())

    def destroy(self) -> None:
        """Nothing is kept that must be freed collectively."""
