"""The interface alone: dense equilibrium of the retained jumps on S, with unilateral contact.

Contact holds normal components at -gap while they press (p_n >= 0) and frees them while they gape
(delta_n >= -gap). With friction, :mod:`fxcrack.equilibrium.friction` finds and follows the states.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import ConvergenceError
from fxcrack.equilibrium.cohesive_law import CohesiveBond
from fxcrack.equilibrium.friction import Friction
from fxcrack.equilibrium.friction_path import follow
from fxcrack.equilibrium.jump_system import (
    ComponentStates,
    Equilibrium,
    JumpSystem,
    blend,
    bond_work,
    work_between,
)

_ROUND_OFF = 1e-11
"""Gaps and pressures below this fraction of the largest one count as zero."""


class ContactSystem(JumpSystem):
    """States of the retained jumps, contact followed along loads.

    Arguments as for :class:`~fxcrack.equilibrium.jump_system.JumpSystem`.

    Attributes:
        friction: The contact nodes if some of them have friction; none of their components is in
            the Cholesky factor then, though they count as free.
    """

    friction: Friction | None = None

    # -- with friction -------------------------------------------------------------------

    def set_friction(self, friction: Friction) -> None:
        """Take contact nodes with friction, or note that there are more of them."""
        self.friction = friction
        self.free[friction.rows] = True
        self.closed = friction.closed(self.n_retained)

    def snapshot(self) -> ComponentStates:
        """What :meth:`restore` needs to return to the present states."""
        saved = super().snapshot()
        if self.friction is None:
            return saved
        return replace(saved, friction=self.friction.save())

    def restore(self, saved: ComponentStates) -> None:
        """Return to earlier states of the same components."""
        super().restore(saved)
        if saved.friction is not None and self.friction is not None:
            self.friction.restore(saved.friction)

    def _take(
        self, schur: Array, offset: Array | None, free: Ints, bonds: list[CohesiveBond]
    ) -> None:
        super()._take(schur, offset, free, bonds)
        if self.friction is not None:
            self.free[self.friction.rows] = True

    def _loaded(self, state: Equilibrium) -> Bools:
        loaded = super()._loaded(state)
        if self.friction is not None:
            loaded[self.friction.rows] = True
        return loaded

    def reduced(self, extra: Ints) -> Array:
        """S on held components once all that may move is condensed out, shape (k, k)."""
        if self.friction is None:
            return super().reduced(extra)
        return self.friction.condensed(self, extra)

    def rates(self, loads: Array, force: Array) -> tuple[Array, Array]:
        """Change of jumps and conjugates per change of loads and given forces, states fixed.

        Args:
            loads: Rates of the loads, shape (n_loads,).
            force: Rates of the given forces, shape (n_retained,).

        Returns:
            Rates of the jumps, shape (n_retained,), and of the conjugates, shape (n_loads,).
        """
        if self.friction is None:
            return super().rates(loads, force)
        return self.friction.rates(self, loads, force)

    def _follow_friction(
        self, friction: Friction, start: Equilibrium, loads: Array, force: Array
    ) -> Iterator[tuple[float, Equilibrium]]:
        for fraction, point in follow(friction, self, start, loads, force):
            self.closed = friction.closed(self.n_retained)
            yield fraction, point

    # -- contact -------------------------------------------------------------------------

    def pressure(self, state: Equilibrium, rows: Ints) -> Array:
        """Contact forces on the slave side at some normal components, shape (len(rows),), force.

        A bond whose force still falls carries its given force beside them.
        """
        return self.forces(state, rows) - state.force[rows]

    def closing(self, here: Equilibrium, point: Equilibrium) -> Ints:
        """Closed components whose faces overlap in one state and no longer in a later one.

        Args:
            here: The first state.
            point: The later state, whose contact states the present ones are.

        Returns:
            Numbers of retained jumps, shape (k,): none unless faces overlap initially.
        """
        rows = np.flatnonzero(self.closed & (self.gap < 0.0))
        if len(rows):
            overlap = -(here.jump + self.gap)[rows]
            rows = rows[overlap > _ROUND_OFF * np.abs(self.gap[rows]).max()]
        return rows

    def _violations(self, state: Equilibrium) -> tuple[Bools, Array, Array]:
        """Contact components on the wrong side; gaps; pressures of the closed ones.

        A bond whose force still falls carries its given force beside the contact pressure.
        """
        gap = np.where(self.contact, state.jump + self.gap, 0.0)
        pressure = np.zeros(self.n_retained)
        rows = np.flatnonzero(self.closed)
        if len(rows):
            pressure[rows] = self.forces(state, rows) - state.force[rows]
        small_gap = _ROUND_OFF * np.abs(state.jump).max(initial=0.0)
        small_force = _ROUND_OFF * np.abs(pressure).max(initial=0.0)
        wrong = self.closed & (pressure < -small_force)
        wrong |= self.contact & ~self.closed & (gap < -small_gap)
        return wrong, gap, pressure

    def equilibrium(self, loads: Array, force: Array) -> Equilibrium:
        """Equilibrium with contact: primal-dual active set from the present one.

        With friction, one increment of backward Euler from the committed slips.

        A repeated set ends the active-set iteration; a non-negative least-squares problem with
        the same solution, whose solver terminates, takes over.

        Args:
            loads: Amplitudes of supports and load factors, shape (n_loads,).
            force: Given forces, shape (n_retained,), force.

        Raises:
            ConvergenceError: Neither gives a solution.
        """
        if self.friction is not None:
            state = self.friction.equilibrium(self, loads, force)
            self.closed = self.friction.closed(self.n_retained)
            return state
        state = self.linear(loads, force)
        if not self.contact.any():
            return state
        seen: set[bytes] = set()
        for _ in range(100):
            wrong, _, _ = self._violations(state)
            if not wrong.any():
                return state
            key = np.packbits(self.closed).tobytes()
            if key in seen:
                break
            seen.add(key)
            self.contact_steps += 1
            self._switch(np.flatnonzero(wrong))
            state = self.linear(loads, force)
        self._set_closed(self._least_squares(loads, force))
        state = self.linear(loads, force)
        wrong, gap, pressure = self._violations(state)
        if wrong.any() and max(-gap.min(), 0.0) > 1e-7 * np.abs(state.jump).max():
            raise ConvergenceError(
                f"contact: {int(wrong.sum())} of {int(self.contact.sum())} nodes keep changing "
                f"between open and closed (penetration {-gap.min():.2e}, "
                f"tension {-pressure.min():.2e})"
            )
        return state

    def _least_squares(self, loads: Array, force: Array) -> Bools:
        """Closed set by the dual problem min 1/2 p^t C p + g^t p, p >= 0, as a NNLS problem.

        Raises:
            ConvergenceError: Bonds that soften leave no stable equilibrium with all faces open.
        """
        normal, soft = np.flatnonzero(self.contact), self.soft.components
        every = np.union1d(np.union1d(self.cholesky.free, normal), soft)
        stiffness, given = self.schur[np.ix_(every, every)], force[every]
        if len(soft):
            at = np.searchsorted(every, soft)
            given[at], by_opening = self.soft.laws()
            stiffness[np.ix_(at, at)] -= by_opening
        try:
            factor = cho_factor(stiffness, lower=True)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(
                "contact: nodes keep changing between open and closed beside bonds that soften"
            ) from error
        where = np.searchsorted(every, normal)
        right = given - self.schur[np.ix_(every, self.load_columns)] @ loads
        if self.offset is not None:
            right -= self.offset[every]
        gap = cho_solve(factor, right)[where] + self.gap[normal]
        unit = np.zeros((len(every), len(normal)))
        unit[where, np.arange(len(normal))] = 1.0
        compliance = cho_solve(factor, unit)[where]
        scale = 1.0 / np.sqrt(np.diagonal(compliance))
        lower = np.linalg.cholesky(compliance * scale[:, None] * scale)
        target = np.linalg.solve(lower, -gap * scale)
        from scipy.optimize import nnls  # rarely needed, and slow to import

        pressure, _ = nnls(lower.T, target, maxiter=50 * len(normal))
        closed = np.zeros(self.n_retained, dtype=bool)
        closed[normal[pressure > 0.0]] = True
        return closed

    def pieces(
        self, start: Equilibrium, loads: Array, force: Array
    ) -> Iterator[tuple[float, Equilibrium]]:
        """Follow contact from one equilibrium to other loads and forces, both changing linearly.

        Args:
            start: Equilibrium the present states belong to.
            loads: Loads at the end, shape (n_loads,).
            force: Given forces at the end, shape (n_retained,).

        Yields:
            (fraction of the way, equilibrium there) at every change of contact and at the end;
            between two of them everything is linear. The states change only when the next piece
            is asked for, so a caller may stop in the middle of a piece.
        """
        if self.friction is not None:
            law = "friction"
        elif self.soft.bonds:
            law = "softening"
        elif self.contact.any():
            law = "contact"
        else:
            yield from self._pieces(start, loads, force)
            return
        inner, goes_on = self._pieces(start, loads, force), True
        while goes_on:
            begin = time.perf_counter()
            piece = next(inner, None)
            self.seconds[law] = self.seconds.get(law, 0.0) + time.perf_counter() - begin
            goes_on = piece is not None
            if piece is not None:
                yield piece

    def _pieces(
        self, start: Equilibrium, loads: Array, force: Array
    ) -> Iterator[tuple[float, Equilibrium]]:
        if self.friction is not None:
            yield from self._follow_friction(self.friction, start, loads, force)
            return
        here, last = 0.0, start
        stuck = done = 0
        while True:
            if self.soft.bonds and not self.soft.stable(self.soft_held):
                done += 1
                if done > 4 * self.n_retained + 20:
                    raise ConvergenceError(
                        f"{len(self.soft.bonds)} softening bonds stay unstable at one load"
                    )
                last = self._run_through(last)
                yield here, last
                continue
            end = self.linear(loads, force)
            if not self.contact.any() and not self.soft.bonds:
                yield 1.0, end
                return
            wrong, gap, pressure = self._violations(end)
            fraction = self._first_change(last, wrong, gap, pressure)
            at_soft, leaving = self.soft.first_event(last.jump, end.jump)
            step = min(float(fraction.min(initial=np.inf)), at_soft)
            if not np.isfinite(step):
                yield 1.0, end
                return
            changing = np.flatnonzero(fraction <= step + 1e-12)
            stuck = stuck + 1 if step < 1e-12 else 0
            done += 1
            if stuck == 2 and len(changing) and self._settle(last, loads, force):
                continue
            if stuck > 3 + 2 * len(self.soft.bonds) or done > 4 * self.n_retained + 20:
                # degenerate: several nodes change at once; the active set finds the end
                yield 1.0, self.equilibrium(loads, force)
                return
            at = here + step * (1.0 - here)
            point = blend(last, end, step)
            if step > 0.0:
                yield at, point
            self.contact_steps += len(changing) > 0
            self._switch(changing)
            here, last = at, point
            if at_soft <= step + 1e-12:
                self.finish([b for b in leaving if self.soft.switch(b, point.jump)])
                if self._penetrates(point):
                    last = self._put_right(point, point)
                    yield here, last

    def _run_through(self, state: Equilibrium) -> Equilibrium:
        """The next stable equilibrium at constant load after an unstable one, contact included.

        Contact is kept fixed while bonds open unstably, and is corrected afterwards.
        """
        return self._put_right(state, self.pass_unstable(state))

    def _penetrates(self, state: Equilibrium) -> bool:
        """Whether faces overlap where a bond has opened all the way that allowed them to.

        While a bond softens its faces are not in contact, unless they were pressed from the start.
        """
        gap = np.where(self.contact & ~self.closed, state.jump + self.gap, 0.0)
        return bool(gap.min(initial=0.0) < -_ROUND_OFF * np.abs(state.jump).max(initial=0.0))

    def _put_right(self, state: Equilibrium, last: Equilibrium) -> Equilibrium:
        """The equilibrium with contact at the loads of ``last``, which does not meet it.

        What changes does so away from zero gap and pressure: the work of the pressures since
        ``state``, the last equilibrium that met contact, is lost energy.
        """
        given = last.force.copy()
        given[self.soft.components] = 0.0
        for _, point in self._pieces(last, last.loads, given):
            last = point
        touching = np.flatnonzero(self.contact)
        pressures = [self.forces(s, touching) - s.force[touching] for s in (state, last)]
        moved = last.jump[touching] - state.jump[touching]
        return replace(last, lost=-0.5 * float(sum(pressures) @ moved))

    def _settle(self, last: Equilibrium, loads: Array, force: Array) -> bool:
        """Choose which of the nodes that just touch stay closed on the way to given loads.

        At ``last`` their gaps and pressures are zero, so the rates decide: a complementarity
        problem whose matrix is positive definite, solved by switching the wrong component of
        least index (Murty 1974), which terminates.

        Returns:
            Whether it did within a bounded number of steps.
        """
        rows = np.flatnonzero(self.closed)
        before = np.zeros(self.n_retained)
        before[rows] = self.forces(last, rows) - last.force[rows]
        small_gap = 1e-9 * np.abs(last.jump).max(initial=0.0)
        small_force = 1e-9 * max(np.abs(before).max(initial=0.0), np.abs(last.force).max())
        gaps = last.jump + self.gap
        touching = (self.closed & (before <= small_force)) | (
            self.contact & ~self.closed & (gaps <= small_gap)
        )
        for _ in range(200 + 20 * int(touching.sum())):
            end = self.linear(loads, force)
            rate_gap = end.jump + self.gap - np.maximum(gaps, 0.0)
            rows = np.flatnonzero(self.closed)
            after = np.zeros(self.n_retained)
            after[rows] = self.forces(end, rows) - end.force[rows]
            none = _ROUND_OFF * np.abs(rate_gap[touching]).max(initial=0.0)
            slack = _ROUND_OFF * np.abs(after).max(initial=0.0)
            wrong = touching & np.where(self.closed, after < -slack, rate_gap < -none)
            if not wrong.any():
                return True
            self.contact_steps += 1
            self._switch(np.flatnonzero(wrong)[:1])
        return False

    def _first_change(self, last: Equilibrium, wrong: Bools, gap: Array, pressure: Array) -> Array:
        """Fraction of the step at which each wrong component changes, inf elsewhere."""
        out = np.full(self.n_retained, np.inf)
        for c in np.flatnonzero(wrong):
            if self.closed[c]:
                before = self.forces(last, np.array([c]))[0] - last.force[c]
                after = pressure[c]
            else:
                before, after = last.jump[c] + self.gap[c], gap[c]
            before = max(before, 0.0)
            out[c] = before / (before - after)
        return out


__all__ = ["ContactSystem", "Equilibrium", "blend", "bond_work", "work_between"]
