"""Equilibrium of nonlinear bodies: SNES in the bodies, dense algebra at their interfaces.

    T^t r(u) = (0, p)      r internal minus external forces, p forces of bonds and contact

SNES works on y, the change of the jump coordinates since the last accepted state. Each of its
steps condenses the tangent onto the retained jumps, finds jumps and forces of the interface there
(bonds, contact, softening: the same code as for linear bodies), and expands them. The residual it
reduces is T^t r with the interface forces taken off where they are known.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from petsc4py import PETSc

from fxcrack.base.arrays import Array
from fxcrack.base.errors import NO_EQUILIBRIUM, ConvergenceError, SolverError
from fxcrack.condensation.mumps_schur import mumps_message
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.equilibrium.moving_contact import MovingContact
from fxcrack.solvers.options import NewtonOptions
from fxcrack.solvers.tangent import CondensedTangent

_NEAR = 1e-3
"""Where the prediction is out of balance by more than this part of the forces, the tangent there is
made first."""
_SLOW = 0.3
"""A tangent that leaves more of the residual than this is not used again."""
_MANY = 2
"""Nor one that would need more steps than this: they cost as much as a new one or more."""
_STALLED = 0.9
"""A shortened step that leaves more of the residual than this makes way for whole ones: in slender
bodies they lead through larger residuals (of stretching) to the end (of bending)."""
_DIVERGED = 10.0
"""Whole steps have diverged where the residual is this many times the one at their start or
after the first of them: the first may be the only one that knows of a new pressure or temperature.
"""
_SETTLING = 2
"""In so many iterations it is found anew which faces of bodies in motion would overlap; later ones
only add to them, so that none changes for ever."""

REASONS = {
    -1: "the function left its domain",
    -2: "too many function evaluations",
    -3: "the linear solve failed",
    -4: "the residual is not a number: the load step distorts elements beyond use",
    -5: "too many iterations",
    -6: "the line search found no smaller residual",
    -7: "the inner solve failed",
    -8: "it stopped at a local minimum of the residual",
    -9: "the residual grew",
    -10: "the Jacobian left its domain",
    -11: "the trust region shrank to nothing",
}
"""Negative values of SNES.ConvergedReason in words."""


@dataclass
class Counts:
    """What the nonlinear iterations have done so far.

    Attributes:
        solves: Equilibria found.
        iterations: Iterations they took in all.
        failures: Solves that did not converge.
        residuals: Norms of the last solve, one per iteration, force.
    """

    solves: int = 0
    iterations: int = 0
    failures: int = 0
    residuals: list[float] = field(default_factory=list)


def _part(norm: float, forces: float) -> float:
    """A residual over the forces in the bodies; 1 at most where these are zero, as in flight."""
    return norm / (forces or norm or 1.0)


class InterfaceSnes:
    """What SNES asks of the bodies and their interfaces at a trial y.

    The callbacks are small so that each can be tested alone.

    Args:
        tangent: The bodies and their condensed tangent.
        system: The dense system on the same retained jumps.
        accepted: The last accepted equilibrium.
        u: Its displacement, owned dofs.
        loads: Loads of the increment's end, shape (n_loads,).
        force: Given forces of its end, shape (n_retained,).
        guess: Interface forces at the initial guess, shape (n_retained,).
        options: Controls of the iteration.
        counts: Where solves and residuals are counted.
        largest_force: Largest norm of the internal forces of an accepted state, force.
        motion: Contact over the increment of time, where bodies that touch are in motion.
    """

    def __init__(
        self,
        tangent: CondensedTangent,
        system: ContactSystem,
        accepted: Equilibrium,
        u: PETSc.Vec,
        loads: Array,
        force: Array,
        guess: Array,
        *,
        options: NewtonOptions,
        counts: Counts,
        largest_force: float,
        motion: MovingContact | None = None,
    ) -> None:
        self.tangent, self.system = tangent, system
        self.motion = motion
        self._steps = 0
        self.accepted, self.u = accepted, u
        self.options, self.counts = options, counts
        self.loads, self.force = loads, force
        self.known = guess
        """Interface forces that belong to the present iterate, shape (n_retained,)."""
        self.fraction = 1.0
        """Length of the last line-search step."""
        self.solution: Equilibrium | None = None
        """Dense equilibrium of the last iteration."""
        self.values = np.zeros(0)
        """T^t r on the last rows at the last residual evaluated, shape (n_last,)."""
        self.scale = 0.0
        nothing = np.finfo(float).eps * largest_force
        self.start = max(tangent.force_scale, nothing), tangent.round_off
        """Forces in the bodies at the start, and what rounding leaves of them when they vanish."""
        self.error: Exception | None = None
        """What a callback raised; PETSc passes on an error code only."""
        self._last: tuple[PETSc.Vec, PETSc.Vec, Array, Array] | None = None
        self._residual: PETSc.Vec | None = None
        self.norms: list[float] = []
        """Residuals so far, force."""
        self.level = 0.0
        """The norm at which the iteration ends."""
        self._steps_since = 0  # with the present tangent
        self.drift = 0.0
        """What was out of balance where the last tangent was made, over the forces."""
        self.renewed = False
        """Whether a tangent was made on the way."""
        self._reused = 0
        self.whole = False
        """Whether steps are taken whole, whatever the residual does meanwhile."""
        self._limit = 0.0  # for their residual
        self.patient = False
        """Whether slow progress of shortened steps is put up with."""

    def _worn(self) -> bool:
        """Whether a new tangent costs less than continuing with the present one."""
        if not self.options.reuse:
            return True
        if self._steps_since == 0:
            return self.norms[-1] > _NEAR * self.scale
        if not self.norms[-2] > 0.0:
            return False  # where nothing acts, all that is left is round-off
        rate = self.norms[-1] / self.norms[-2]
        if self.fraction != 1.0 or rate >= _SLOW:
            return True
        if not self.tangent.bodies.symmetric:
            return False  # S is that of the symmetric part: another one is no better
        return float(np.log(self.level / self.norms[-1])) < _MANY * float(np.log(rate))

    def residual(self, snes: Any, y: PETSc.Vec, out: PETSc.Vec) -> None:
        """T^t r(u) minus the interface forces that belong to y."""
        tangent, system = self.tangent, self.system
        coordinates, comm = tangent.coordinates, tangent.comm
        forces = self._forces_at(y)
        self.scale = tangent.force_scale
        coordinates.transform.multTranspose(forces, out)
        n_inner, n = coordinates.n_inner, system.n_retained
        values = np.zeros(coordinates.n_last)
        if comm.rank == 0:
            values[:] = out.array[n_inner:]
            out.array[n_inner:] = 0.0
        comm.Bcast(values)
        self.values = values
        self._follow(y)
        if comm.rank == 0:
            known = system.knows_force()
            wrong = np.where(known, values[:n] - self.known, 0.0)
            out.array[n_inner : n_inner + n] = wrong
        if self._residual is not None:
            self._residual.destroy()
        self._residual = forces

    def _forces_at(self, y: PETSc.Vec) -> PETSc.Vec:
        """R(u) minus dead loads at u = u_accepted + T y; the caller destroys it."""
        transform = self.tangent.coordinates.transform
        u = transform.createVecLeft()
        transform.mult(y, u)
        u.axpy(1.0, self.u)
        self.tangent.bodies.set(u)
        u.destroy()
        return self.tangent.out_of_balance(self.loads)

    def _jumps_of(self, y: PETSc.Vec) -> Array:
        """Retained jumps at a trial y, shape (n_retained,); collective."""
        out, comm = self.accepted.jump.copy(), self.tangent.comm
        if comm.rank == 0:
            n = self.tangent.coordinates.n_inner
            out += y.array_r[n : n + len(out)]
        comm.Bcast(out)
        return out

    def _follow(self, y: PETSc.Vec) -> None:
        """Interface forces at a trial y: between those before and after the whole step."""
        if self._last is None:
            return
        start, step, before, after = self._last
        way = start.copy()
        way.axpy(-1.0, y)
        square = float(step.dot(step))
        self.fraction = float(way.dot(step)) / square if square > 0.0 else 1.0
        rounding = 1e3 * np.finfo(float).eps * float(y.norm()) / np.sqrt(square or 1.0)
        if abs(self.fraction - 1.0) < 1e-6 + rounding:
            self.fraction = 1.0  # a shortened step is shorter by a tenth at least
        way.destroy()
        self.known = before + self.fraction * (after - before)

    def step(self, y: PETSc.Vec, out: PETSc.Vec) -> None:
        """Newton step -dy (SNES subtracts it) from the condensed complementarity problem."""
        tangent, system = self.tangent, self.system
        assert self._residual is not None
        jump = self._jumps_of(y)
        if self._linearise(jump, self._residual, out):
            self.renewed, self._steps_since = True, 0
            self.drift = _part(self.norms[-1], self.scale)
        else:
            self._reused += 1
        self._steps_since += 1
        self._steps += 1
        if self.motion is not None and self._steps <= _SETTLING:
            self.motion.begin_again()
        start = time.perf_counter()
        self.solution = self._interface_equilibrium()
        tangent.timings.add("interface", start)
        last = np.zeros(tangent.coordinates.n_last)
        last[: system.n_retained] = self.solution.jump - jump
        dq = tangent.condensation.expanded(last)
        out.axpy(-1.0, dq)
        dq.destroy()
        after = system.forces(self.solution, np.arange(system.n_retained))
        if self._last is not None:
            self._last[0].destroy()
            self._last[1].destroy()
        self._last = (y.copy(), out.copy(), self.known.copy(), after)

    def _linearise(self, jump: Array, residual: PETSc.Vec, out: PETSc.Vec) -> bool:
        """Dense system of the tangent through the bodies' present forces.

        Args:
            jump: Jumps there, shape (n_retained,).
            residual: Forces there, r.
            out: Becomes A_11^-1 r_1.

        Returns:
            Whether a tangent of the bodies' present displacement was made; else the one at hand
            serves, as its terms' data have not changed since.
        """
        bodies = self.tangent.bodies
        anew = (self._worn() and not bodies.constant) or self.tangent.outdated
        if anew:
            self.tangent.factor()
        q = self.tangent.anchor(self.system, residual, jump, self.loads)
        q.copy(out)
        q.destroy()
        return anew

    def _interface_equilibrium(self) -> Equilibrium:
        """Jumps and forces on the present tangent, softening bonds on their right branches."""
        system = self.system
        equilibrium = system.equilibrium if self.motion is None else self.motion.equilibrium
        state = equilibrium(self.loads, self.force)
        for _ in range(4 * len(system.soft.bonds) + 4 if system.soft.bonds else 0):
            if not system.soft.stable(system.soft_held):
                state = system.pass_unstable(state)
                continue
            at, leaving = system.soft.first_event(self.accepted.jump, state.jump)
            if not np.isfinite(at):
                break
            system.finish([b for b in leaving if system.soft.switch(b, state.jump)])
            state = equilibrium(self.loads, self.force)
        return state

    def converged(self, snes: Any, its: int, norms: tuple[float, float, float]) -> int:
        """End when the residual is small beside the forces in the bodies, after a whole step."""
        norm = norms[2]
        if not np.isfinite(norm):
            return int(PETSc.SNES.ConvergedReason.DIVERGED_FNORM_NAN)
        self.counts.residuals.append(norm)
        forces, round_off = self.start
        level = max(
            self.options.tolerance * max(self.scale, forces), self.tangent.round_off, round_off
        )
        self.norms.append(norm)
        self.level = level
        if its == 0:
            self.drift = _part(norm, self.scale) if norm > level else 0.0
        whole = self.fraction == 1.0 or norm == 0.0  # no step is taken where nothing acts
        if norm <= level and whole and (its > 0 or self.motion is None):
            return int(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_ABS)
        if its - self._reused >= self.options.max_iterations:
            return int(PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT)
        if self.whole:
            if its <= 1:
                self._limit = _DIVERGED * max(self.norms[0], norm)
            return int(PETSc.SNES.ConvergedReason.DIVERGED_DTOL) if norm > self._limit else 0
        slow = its > 0 and self.fraction != 1.0 and norm > _STALLED * self.norms[-2]
        if slow and not self.patient:
            return int(PETSc.SNES.ConvergedReason.DIVERGED_LINE_SEARCH)
        return 0

    def again(self, known: Array, *, whole: bool) -> None:
        """Be ready for another run of SNES from the iterate at which the last one stalled.

        Args:
            known: Interface forces there, shape (n_retained,).
            whole: Take whole steps; else shortened ones, however slow.
        """
        self.whole, self.patient, self._reused = whole, not whole, 0
        self.known, self.error = known.copy(), None
        self.destroy()
        self._last = self._residual = None

    def destroy(self) -> None:
        """Free vectors; collective."""
        if self._last is not None:
            self._last[0].destroy()
            self._last[1].destroy()
        if self._residual is not None:
            self._residual.destroy()


class _MeritOperator:
    """The Jacobian as the line search needs it: on the Newton step it gives the residual back."""

    def __init__(self) -> None:
        self.residual: PETSc.Vec | None = None

    def mult(self, matrix: Any, x: PETSc.Vec, y: PETSc.Vec) -> None:
        assert self.residual is not None
        self.residual.copy(y)


class _StepSolver:
    """SNES' linear solver: the condensed complementarity problem of the present iterate."""

    def __init__(self, problem: InterfaceSnes) -> None:
        self._problem = problem
        self.iterate: PETSc.Vec | None = None

    def apply(self, pc: Any, right: PETSc.Vec, out: PETSc.Vec) -> None:
        assert self.iterate is not None
        try:
            self._problem.step(self.iterate, out)
        except Exception as error:  # PETSc passes on a code only: kept for solve() to raise
            self._problem.error = error
            raise


def solve(problem: InterfaceSnes, y: PETSc.Vec) -> int:
    """Drive SNES from an initial y to equilibrium; collective.

    Steps are shortened where the residual would grow. Where that stalls, full ones are tried,
    and if they fail shortened ones after all.

    Args:
        problem: Residual, step and convergence test.
        y: Initial guess; the solution on return.

    Returns:
        Number of iterations.

    Raises:
        ConvergenceError: It did not get there; the message carries SNES' reason in words.
    """
    iterations, reason = _drive(problem, y)
    if reason != PETSc.SNES.ConvergedReason.DIVERGED_LINE_SEARCH:
        return _found(problem, iterations, reason)
    begin, known = y.copy(), problem.known.copy()
    try:
        problem.again(known, whole=True)
        more, reason = _drive(problem, y)
        return _found(problem, iterations + more, reason)
    except NO_EQUILIBRIUM:
        begin.copy(y)
        problem.again(known, whole=False)
        more, reason = _drive(problem, y)
        return _found(problem, iterations + more, reason)
    finally:
        begin.destroy()


def _found(problem: InterfaceSnes, iterations: int, reason: int) -> int:
    """Number of iterations, if SNES' reason to end is a good one."""
    if reason <= 0:
        words, norm = REASONS.get(reason, f"SNES reason {reason}"), (problem.norms or [np.inf])[-1]
        raise ConvergenceError(
            f"nonlinear solve: {words} (iteration {iterations}, residual {norm:.2e} beside forces "
            f"of {problem.scale:.2e}); take smaller increments (maximum=, minimum=)"
        )
    return iterations


def _drive(problem: InterfaceSnes, y: PETSc.Vec) -> tuple[int, int]:
    """Run SNES once; returns its number of iterations and its reason to end."""
    comm = y.getComm()
    merit, stepper = _MeritOperator(), _StepSolver(problem)
    operator = PETSc.Mat().createPython((y.getSizes(), y.getSizes()), merit, comm=comm)
    operator.setUp()
    snes = PETSc.SNES().create(comm)
    prefix = "fxcrack_newton_"
    if problem.whole:
        prefix += "whole_"
        PETSc.Options(prefix).setValue("snes_linesearch_type", "basic")
    snes.setOptionsPrefix(prefix)
    work = y.duplicate()
    snes.setFunction(problem.residual, work)

    def jacobian(snes: Any, x: PETSc.Vec, matrix: Any, preconditioner: Any) -> None:
        stepper.iterate, merit.residual = x, work

    snes.setJacobian(jacobian, operator)
    snes.setConvergenceTest(problem.converged)
    ksp = snes.getKSP()
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.PYTHON)
    pc.setPythonContext(stepper)
    snes.setTolerances(max_it=(_MANY + 2) * (problem.options.max_iterations + 1))
    snes.setFromOptions()
    try:
        snes.solve(None, y)
        return int(snes.getIterationNumber()), int(snes.getConvergedReason())
    except PETSc.Error as error:
        if isinstance(problem.error, SolverError) and str(problem.error) != mumps_message(-10, 0):
            raise ConvergenceError(f"nonlinear solve: {problem.error}") from problem.error
        if isinstance(problem.error, NotPositiveDefinite | SolverError):
            raise ConvergenceError(
                "nonlinear solve: the tangent is not positive definite, so the load step is too "
                "large or the bodies lose their stability (buckling, a limit load); take smaller "
                "increments (maximum=, minimum=)"
            ) from problem.error
        raise problem.error or error from error
    finally:
        # All of them: on several ranks what is left to Python would keep the problem for ever.
        for thing in (pc, ksp, snes, operator, work):
            thing.destroy()


__all__ = ["Counts", "InterfaceSnes", "solve"]
