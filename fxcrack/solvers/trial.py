"""Trial increments of nonlinear bodies: predicted on the tangent, corrected by SNES, integrated."""

from __future__ import annotations

import time

import numpy as np
from petsc4py import PETSc

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.base.errors import NO_EQUILIBRIUM
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.equilibrium.friction_state import FrictionWork
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.equilibrium.moving_contact import MovingContact, closed_components, known_forces
from fxcrack.solvers import snes
from fxcrack.solvers.impulses import ContactImpulses
from fxcrack.solvers.increment_work import TrialIncrement
from fxcrack.solvers.options import NewtonOptions
from fxcrack.solvers.tangent import CondensedTangent

_FAR_OFF = 1e-5
"""A tangent made where more than this part of the forces was out of balance is replaced by that
of the state itself when one is accepted."""
_NOISE = 10.0
"""Energies of an increment may be off by so many times the residual left times the step."""


class IncrementSolver:
    """Finds equilibria at other loads, and the work along the increments that lead there.

    Args:
        tangent: The bodies and their condensed tangent.
        options: Controls of the iteration.
        n_loads: Number of supports and force patterns together.
        n_forces: How many of these are force patterns (the last ones).

    Attributes:
        counts: Solves and iterations so far.
    """

    def __init__(
        self, tangent: CondensedTangent, options: NewtonOptions, n_loads: int, n_forces: int
    ) -> None:
        self._tangent, self._options = tangent, options
        self._n_loads, self._n_forces = n_loads, n_forces
        self.counts = snes.Counts()
        self._motion_of = tangent.bodies.inertia
        self._known_impulses: ContactImpulses | None = None

    @property
    def _impulses(self) -> ContactImpulses:
        if self._known_impulses is None:
            assert self._motion_of is not None
            self._known_impulses = ContactImpulses(self._motion_of)
        return self._known_impulses

    def destroy(self) -> None:
        """Free all PETSc objects; collective."""
        if self._known_impulses is not None:
            self._known_impulses.destroy()

    def find(
        self,
        system: ContactSystem,
        here: Equilibrium,
        u: PETSc.Vec,
        loads: Array,
        force: Array,
        at: float,
        *,
        follow: bool,
        largest_force: float,
        moving: bool = False,
    ) -> TrialIncrement:
        """Find the equilibrium at other loads and given forces; collective.

        The dense system passes through it on the tangent at hand, its contact and softening states
        are those of the trial.

        Args:
            system: The dense system, in the accepted state.
            here: The accepted equilibrium.
            u: Its displacement, owned dofs.
            loads: Amplitudes of supports and load factors at the end, shape (n_loads,).
            force: Given forces at the end, shape (n_retained,), force.
            at: Time of the end.
            follow: Follow contact and softening on the path; else go straight to the end.
            largest_force: Largest norm of the internal forces of an accepted state, force.
            moving: Whether it is an increment of time of bodies with inertia.

        Raises:
            ConvergenceError: None was found.
        """
        tangent, n = self._tangent, system.n_retained
        start = time.perf_counter()
        points = [(0.0, here)]
        motion = None
        if moving and (system.contact.any() or system.friction is not None):
            motion = MovingContact(system, here)
        if motion is not None:
            # the tangent at hand does not know of the motion: it predicts nothing
            points.append((1.0, Equilibrium(loads, force, here.jump, here.conjugate)))
        elif follow:
            points += system.pieces(here, loads, force)
        else:
            points.append((1.0, system.equilibrium(loads, force)))
        predicted = points[-1][1]
        if motion is None:
            rate = system.rates(loads - here.loads, force - here.force)
            guess = system.forces(predicted, np.arange(n))
        else:
            rate = np.zeros(n), np.zeros(self._n_loads)
            guess = known_forces(system, here, force)
        sliding = None
        if system.friction is not None and motion is None:
            sliding = FrictionWork.of(system, points)
        tangent.timings.add("interface", start)
        soft = system.soft.components
        last = np.zeros(tangent.coordinates.n_last)
        last[:n] = predicted.jump - here.jump
        last[n : n + self._n_loads] = predicted.loads - here.loads
        y = tangent.condensation.expanded(last)
        problem = snes.InterfaceSnes(
            tangent, system, here, u, loads, force, guess, options=self._options,
            counts=self.counts, largest_force=largest_force, motion=motion,
        )  # fmt: skip
        self.counts.residuals = []
        means = np.zeros((2, tangent.coordinates.n_last))
        if motion is not None:
            means[0] = self._impulses.last(tangent.coordinates)
        try:
            iterations = snes.solve(problem, y)
            if motion is not None:
                means[1] = self._impulses_of(system, problem)
            end, values = self._end(system, problem, predicted, loads)
            to = tangent.coordinates.transform.createVecLeft()
            tangent.coordinates.transform.mult(y, to)
        except NO_EQUILIBRIUM as error:
            log.debug("trial at t = %.9g: %s; residuals %s", at, error, self._residuals())
            raise
        finally:
            if motion is not None:
                motion.end()
            problem.destroy()
            y.destroy()
        # forces are known to what the iteration leaves out of balance, and so is their work
        noise = _NOISE * problem.level * float(to.norm())
        to.axpy(1.0, u)
        self.counts.solves += 1
        self.counts.iterations += iterations
        log.debug(
            "trial at t = %.9g: %d iterations; residuals %s", at, iterations, self._residuals()
        )
        drift = problem.drift + (0.0 if problem.renewed else tangent.drift)
        friction, impulses = 0.0, None
        if sliding is not None:
            friction = sliding.energy(system, end)
        elif motion is not None:
            n_supports = self._n_loads - self._n_forces
            impulses = motion.work(end, means, n_supports)
            friction = impulses.friction
        return TrialIncrement(
            points, end, rate, soft, iterations, friction, at, to, values, drift, noise, impulses
        )

    def _residuals(self) -> str:
        """Norms of the forces out of balance in the last solve, one per iteration."""
        return ", ".join(f"{norm:.2g}" for norm in self.counts.residuals) or "none"

    def _impulses_of(self, system: ContactSystem, problem: snes.InterfaceSnes) -> Array:
        """Give the bodies the contact impulses of an increment of time.

        Returns:
            Their mean forces on the last coordinates, shape (n_last,); the problem's values contain
            them.
        """
        rows, n = closed_components(system), system.n_retained
        if problem.solution is None or not len(rows):
            return np.zeros(len(problem.values))
        force = np.zeros(n)
        force[rows] = problem.values[rows] - problem.solution.force[rows]
        means, change = self._impulses.apply(self._tangent.coordinates, force, system.knows_force())
        problem.values = problem.values + change * means
        return means

    def _end(
        self,
        system: ContactSystem,
        problem: snes.InterfaceSnes,
        predicted: Equilibrium,
        loads: Array,
    ) -> tuple[Equilibrium, Array]:
        """The equilibrium SNES has found, with the dense system through it, and the values there.

        See :class:`TrialIncrement`.
        """
        last = predicted if problem.solution is None else problem.solution
        begin = system.n_retained
        end = begin + self._n_loads - self._n_forces
        borders = self._tangent.border_values()
        answers = np.concatenate([problem.values[begin:end], -borders[: self._n_forces]])
        state = Equilibrium(loads, last.force, last.jump, answers)
        values = np.concatenate([problem.values[:end], borders])
        self._tangent.pass_through(system, values, state.jump, loads)
        return state, values

    def integrate(self, trial: TrialIncrement, system: ContactSystem, *, exact: bool) -> None:
        """Have the tangent of the trial where it counts, and the work along the increment.

        Collective.

        Args:
            trial: From :meth:`find`.
            system: The dense system it has left.
            exact: Whether the tangent must be that of the trial to the last digit.

        Raises:
            NotPositiveDefinite: The equilibrium is unstable.
        """
        tangent, bodies = self._tangent, self._tangent.bodies
        here, end = trial.points[0][1], trial.end
        # where nothing was corrected bodies that yield did not, and the path predicted is exact
        trapezoidal = bodies.dynamic or (bodies.path_dependent and trial.iterations > 0)
        limit = 0.0 if exact else np.inf if trapezoidal else _FAR_OFF
        if trial.iterations and trial.drift > limit and not bodies.constant:
            tangent.factor()
            tangent.pass_through(system, trial.values, end.jump, end.loads)
            trial.drift = 0.0
        if tangent.renewed and tangent.condensation.n_negative:
            raise NotPositiveDefinite(0)
        after = trial.rate
        if trial.iterations and not trapezoidal:
            after = system.rates(end.loads - here.loads, end.force - here.force)
        soft = system.soft.components
        trial.work = trial.integrals(after, soft, trapezoidal=trapezoidal)


__all__ = ["IncrementSolver"]
