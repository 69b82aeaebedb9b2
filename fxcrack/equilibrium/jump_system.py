"""The interface alone: dense equilibrium of the retained jumps on S, states as they are.

Every retained jump is either held (its jump is known, its force follows) or free (its force is
known, its jump follows):

    S_ff delta_f = p_f - S_fL a - S_fh delta_h,       p_h = S_hf delta_f + S_hh delta_h + S_hL a

a are the prescribed amplitudes and load factors. Contact holds normal components at -gap; which
ones, :mod:`fxcrack.equilibrium.contact` decides.

A nonlinear continuum is S x + c near its present state (tangent S, offset c).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.equilibrium.cohesive_bonds import CohesiveBonds
from fxcrack.equilibrium.cohesive_law import CohesiveBond
from fxcrack.equilibrium.coulomb import FrictionState
from fxcrack.equilibrium.growing_cholesky import AT_ONCE, GrowingCholesky, NotPositiveDefinite

_PROPORTIONAL = 4.0 * np.finfo(float).eps


@dataclass(frozen=True)
class Equilibrium:
    """One equilibrium state of the interface.

    Attributes:
        loads: Amplitudes of supports and load factors, shape (n_loads,).
        force: Given forces on free components, 0 elsewhere, shape (n_retained,), force.
        jump: Jumps, shape (n_retained,), length.
        conjugate: Reactions of supports and displacements of load patterns, shape (n_loads,).
        lost: Energy lost since the last equilibrium where contact changed in an unstable state: no
            given force did that work.
    """

    loads: Array
    force: Array
    jump: Array
    conjugate: Array
    lost: float = 0.0


@dataclass(frozen=True)
class ComponentStates:
    """States of the retained jumps.

    Attributes:
        free: Components whose force is known, shape (n_retained,).
        closed: Normal components in contact, shape (n_retained,).
        contact: Normal components that may be in contact, shape (n_retained,).
        bonds: Softening bonds.
        finished: Energy dissipated by those that have opened all the way.
        friction: What the contact nodes with friction remember
            (:class:`FrictionState`), if there are any.
    """

    free: Bools
    closed: Bools
    contact: Bools
    bonds: list[CohesiveBond]
    finished: float
    friction: FrictionState | None = None


class JumpSystem:
    """States of the retained jumps and the linear equilibrium they lead to.

    Args:
        schur: S over (retained jumps, supports, force patterns, monitors), shape (n_last, n_last),
            force/length between jumps.
        n_retained: Number of retained jumps.
        n_loads: Number of supports and force patterns together.
        n_forces: How many of these are force patterns (the last ones).
        offset: c, shape (len(schur),); ``None`` for a linear continuum.

    Attributes:
        free: Components whose force is known, shape (n_retained,).
        closed: Normal components held by contact, shape (n_retained,).
        contact: Normal components that may be in contact now, shape (n_retained,).
        touches: Normal components that may be in contact once their bond is released, likewise.
        soft_contact: Whether faces may touch while their bond softens; else once it is gone.
        gap: Initial gaps, shape (n_retained,), length.
        contact_steps: Number of active-set steps done, those on earlier sets of jumps included.
        seconds: Time spent following contact, friction or softening, by law.
    """

    def __init__(
        self,
        schur: Array,
        n_retained: int,
        n_loads: int,
        n_forces: int,
        *,
        offset: Array | None = None,
    ) -> None:
        self.schur = schur
        self.offset = offset
        self.n_retained = n_retained
        self.load_columns = np.arange(n_retained, n_retained + n_loads)
        # a slice, so that products need no copies
        self._load_rows = slice(n_retained, n_retained + n_loads)
        self.monitor_rows = np.arange(n_retained + n_loads, len(schur))
        self.sign = np.ones(n_loads)
        self.sign[n_loads - n_forces :] = -1.0
        self.free = np.zeros(n_retained, dtype=bool)
        self.closed = np.zeros(n_retained, dtype=bool)
        self.contact = np.zeros(n_retained, dtype=bool)
        self.touches = np.zeros(n_retained, dtype=bool)
        self.soft_contact = False
        self.gap = np.zeros(n_retained)
        self.contact_steps = 0
        self.seconds: dict[str, float] = {}
        self.cholesky = GrowingCholesky(schur)
        self.soft = CohesiveBonds(schur)
        # the offset is one more load whose factor is 1
        self._forward = np.zeros((0, n_loads + (offset is not None)))
        self._unit: tuple[Array, Array] | None = None

    def renew(self, schur: Array, offset: Array) -> None:
        """Take the tangent at another state of the continuum; the states stay as they are.

        Args:
            schur: S with the same numbering, shape (n_last, n_last), force/length between jumps.
            offset: c, shape (n_last,), force at jumps.

        Raises:
            NotPositiveDefinite: The free components have no stable equilibrium with it.
        """
        if schur is self.schur and self.offset is not None:
            self.offset = offset
            self._forward[:, -1] = self.cholesky.forward(offset[self.cholesky.free])
            return
        free, bonds, old = self.cholesky.free, self.soft.bonds, (self.schur, self.offset)
        try:
            self._take(schur, offset, free, bonds)
        except NotPositiveDefinite:
            self._take(*old, free, bonds)
            raise

    def _take(
        self, schur: Array, offset: Array | None, free: Ints, bonds: list[CohesiveBond]
    ) -> None:
        self.schur, self.offset = schur, offset
        restraint = self.cholesky.restraint
        self.cholesky = GrowingCholesky(schur)
        self.cholesky.restraint = restraint
        self._forward = np.zeros((0, len(self.load_columns) + (offset is not None)))
        self._unit = None
        self.soft.bonds = []
        self.free[:] = False
        self.release(free)
        self.soft.renew(schur, bonds, self.cholesky)

    def knows_force(self) -> Bools:
        """Components whose force the interface laws give, shape (n_retained,)."""
        known = self.free | self.contact
        known[self.soft.components] = True
        return known

    # -- states --------------------------------------------------------------------------

    def release(self, components: Ints) -> None:
        """Free components; their forces are given from now on.

        Args:
            components: Numbers of retained jumps, shape (k,); free ones are ignored.

        Raises:
            NotPositiveDefinite: Nothing restrains one of them any more; nothing is changed.
        """
        new = np.asarray(components)[~self.free[components]]
        before = len(self.cholesky)
        for i in range(0, len(new), AT_ONCE):
            try:
                self._append(new[i : i + AT_ONCE])
            except NotPositiveDefinite:
                if i:
                    self.hold(self.cholesky.free[before:])
                raise

    def _append(self, new: Ints) -> None:
        """Free some more components, shape (k,)."""
        left = self.cholesky.append(new)
        right = self._load_columns_at(new) - left @ self._forward
        tile = self.cholesky.corner(len(new))
        self._forward = np.vstack([self._forward, np.linalg.solve(tile, right)])
        if self.soft.bonds:
            self.soft.extend(new, left, tile)
        self.free[new] = True
        self._unit = None

    def soften(self, bonds: list[CohesiveBond]) -> None:
        """Let the forces of held bonds fall with their opening from now on."""
        self.soft.bonds += bonds
        self.soft.refresh(self.cholesky)

    def finish(self, gone: list[CohesiveBond]) -> None:
        """Free bonds that have opened all the way."""
        if not gone:
            return
        self.soft.bonds = [b for b in self.soft.bonds if all(b is not g for g in gone)]
        self.soft.refresh(self.cholesky)
        self.soft.finished += sum(0.5 * b.strength * b.final for b in gone)
        free = np.concatenate([b.components for b in gone])
        self.release(free[~(self.closed[free] & self.soft_contact)])
        self.contact[free] |= self.touches[free]

    def snapshot(self) -> ComponentStates:
        """What :meth:`restore` needs to return to the present states."""
        return ComponentStates(
            self.free.copy(),
            self.closed.copy(),
            self.contact.copy(),
            [replace(b) for b in self.soft.bonds],
            self.soft.finished,
        )

    def restore(self, saved: ComponentStates) -> None:
        """Return to earlier states of the same components.

        What was held is held first, so that no body comes free in between.
        """
        self.soft.finished = saved.finished
        self.soft.bonds = []
        extra = np.flatnonzero(self.free & ~saved.free)
        if len(extra):
            self.hold(extra)
        self.closed[:] = saved.closed
        self.contact[:] = saved.contact
        self.release(np.flatnonzero(saved.free & ~self.free))
        self.soft.bonds = saved.bonds
        self.soft.refresh(self.cholesky)

    def hold(self, components: Ints) -> None:
        """Hold components again (contact).

        Args:
            components: Numbers of retained jumps, shape (k,).
        """
        self.cholesky.remove(components)
        self.free[components] = False
        self._forward = self.cholesky.forward(self._load_columns_at(self.cholesky.free))
        if self.soft.bonds:
            self.soft.refresh(self.cholesky)
        self._unit = None

    @property
    def soft_held(self) -> Bools:
        """Which components of softening bonds contact holds, shape (r,)."""
        return np.asarray(self.closed[self.soft.components] & self.soft_contact)

    def _switch(self, components: Ints) -> None:
        """Close the open ones among the components and open the closed ones."""
        opening = components[self.closed[components]]
        closing = components[~self.closed[components]]
        self.closed[opening], self.closed[closing] = False, True
        if self.soft_contact:
            # those of bonds that soften are not in the factor, open or closed
            opening, closing = (np.setdiff1d(c, self.soft.components) for c in (opening, closing))
        if len(closing):
            self.hold(closing)
        if len(opening):
            self.release(opening)

    def _set_closed(self, closed: Bools) -> None:
        self._switch(np.flatnonzero(closed != self.closed))

    # -- equilibrium with given states ---------------------------------------------------

    def _load_columns_at(self, rows: Ints) -> Array:
        """Forces per load at some components, the offset as a last load, shape (n, n_loads)."""
        columns = self.schur[np.ix_(rows, self.load_columns)]
        return columns if self.offset is None else np.column_stack([columns, self.offset[rows]])

    def _product(self, rows: Ints | slice, x: Array) -> Array:
        """S x + c at some rows, for the leading entries x of all coordinates."""
        if not isinstance(rows, slice) and len(rows) > max(AT_ONCE, len(self.schur) // 8):
            out = (self.schur[:, : len(x)] @ x)[rows]  # without a copy of so much of S
        else:
            out = self.schur[rows, : len(x)] @ x
        return np.asarray(out if self.offset is None else out + self.offset[rows])

    def _products(self, rows: Ints, moved: Ints, jump: Array) -> Array:
        """S at some rows times jumps, shape (n_retained,), that are zero but for some, (k,)."""
        if len(rows) * len(moved) > max(AT_ONCE**2, self.schur.size // 8):
            out = (self.schur[:, : len(jump)] @ jump)[rows]  # without a copy of so much of S
        else:
            out = self.schur[np.ix_(rows, moved)] @ jump[moved]
        return np.asarray(out)

    def _response(self, loads: Array) -> Array:
        """Jumps of the free components under loads alone, shape (n_free,).

        Loads proportional to the last ones cost no further back-substitution; one with a single
        right-hand side takes a third of the time of one with several.
        """
        if self.offset is not None:
            return -self.cholesky.backward(self._forward @ np.append(loads, 1.0))
        if self._unit is not None:
            known, jump = self._unit
            k = int(np.argmax(np.abs(known)))
            scale = float(loads[k] / known[k])  # no squares: they vanish below 1e-162
            if np.abs(loads - scale * known).max() <= _PROPORTIONAL * np.abs(loads).max():
                return scale * jump
        if not loads.any():
            return np.zeros(len(self.cholesky))
        jump = -self.cholesky.backward(self._forward @ loads)
        self._unit = loads, jump
        return jump

    def linear(self, loads: Array, force: Array, held: Array | None = None) -> Equilibrium:
        """Equilibrium with the states as they are, contact conditions unchecked.

        Args:
            loads: Amplitudes of supports and load factors, shape (n_loads,).
            force: Given forces, shape (n_retained,), force.
            held: Jumps of the components that are not free, shape (n_retained,), length; by default
                0, closed normals at -gap.
        """
        free = self.cholesky.free
        jump = np.where(self.closed, -self.gap, 0.0) if held is None else held.copy()
        part = self._response(loads)
        right = force[free]
        moved = np.flatnonzero(jump)
        if len(moved):
            right = right - self._products(free, moved, jump)
        if np.any(right):
            part = part + self.cholesky.solve(right)
        jump[free] = part
        if self.soft.bonds:
            force = self._add_soft(jump, loads, force)
        conjugate = self._product(self._load_rows, np.concatenate([jump, loads]))
        return Equilibrium(loads, force, jump, self.sign * conjugate)

    def rates(self, loads: Array, force: Array) -> tuple[Array, Array]:
        """Change of jumps and conjugates per change of loads and given forces, states fixed.

        Args:
            loads: Rates of the loads, shape (n_loads,).
            force: Rates of the given forces, shape (n_retained,).

        Returns:
            Rates of the jumps, shape (n_retained,), and of the conjugates, shape (n_loads,).
        """
        free = self.cholesky.free
        jump = np.zeros(self.n_retained)
        forward = self._forward[:, : len(loads)] @ loads
        jump[free] = self.cholesky.solve(force[free]) - self.cholesky.backward(forward)
        if self.soft.bonds:
            mine = self.soft.components
            active = np.flatnonzero(jump)
            right = -self.schur[np.ix_(mine, active)] @ jump[active]
            right -= self.schur[np.ix_(mine, self.load_columns)] @ loads
            soft = self.soft.rates(right, self.soft_held)
            jump[free] -= self.cholesky.backward(self.soft.coupling @ soft)
            jump[mine] = soft
        x = np.concatenate([jump, loads])
        return jump, self.sign * (self.schur[self._load_rows, : len(x)] @ x)

    def _soft_right(self, jump: Array, loads: Array) -> Array:
        """-g*: minus the forces on the softening components if they did not open."""
        mine = self.soft.components
        active = np.flatnonzero(jump)
        right = -self.schur[np.ix_(mine, active)] @ jump[active]
        right -= self.schur[np.ix_(mine, self.load_columns)] @ loads
        return np.asarray(right if self.offset is None else right - self.offset[mine])

    def _add_soft(self, jump: Array, loads: Array, force: Array) -> Array:
        """Add the softening jumps and what they open elsewhere; returns all given forces."""
        mine, held = self.soft.components, self.soft_held
        soft, by_bonds = self.soft.solve(self._soft_right(jump, loads), jump[mine], held)
        # what the held ones open elsewhere is there already
        moved = np.where(held, 0.0, soft)
        jump[self.cholesky.free] -= self.cholesky.backward(self.soft.coupling @ moved)
        jump[mine] = soft
        force = force.copy()
        # as they act on the bodies: a stiff branch times the round-off of an opening is much more
        acting = self._product(mine, np.concatenate([jump, loads]))
        force[mine] = np.where(held, by_bonds, acting)
        return force

    def pass_unstable(self, state: Equilibrium) -> Equilibrium:
        """Descend in energy from an unstable state to the next stable one, at constant load."""
        mine = self.soft.components
        round_off = self.cholesky.round_off
        self.finish(self.soft.snap(state.jump[mine], self.soft_held, round_off))
        given = state.force.copy()
        given[mine] = 0.0
        return self.linear(state.loads, given)

    def _loaded(self, state: Equilibrium) -> Bools:
        """Components that may carry a force though they may have a jump, shape (n_retained,)."""
        return np.asarray(self.closed | (state.force != 0.0))

    def reduced(self, extra: Ints) -> Array:
        """S on held components once the free ones are condensed out, shape (k, k), force/length."""
        return self.cholesky.reduced(extra)[1]

    def forces(self, state: Equilibrium, rows: Ints) -> Array:
        """Interface forces on the slave side at some components, shape (len(rows),), force."""
        return self._product(rows, np.concatenate([state.jump, state.loads]))

    def monitors(self, state: Equilibrium) -> Array:
        """Monitored displacements, shape (n_monitors,), length."""
        return self._product(self.monitor_rows, np.concatenate([state.jump, state.loads]))

    def strain_energy(self, state: Equilibrium) -> float:
        """1/2 u^t K u of a linear continuum: half the work of all forces on their displacements."""
        rows = np.flatnonzero((state.jump != 0.0) & self._loaded(state))
        interface = state.jump[rows] @ self.forces(state, rows) if len(rows) else 0.0
        return 0.5 * float(interface + state.loads @ state.conjugate)


def blend(a: Equilibrium, b: Equilibrium, x: float) -> Equilibrium:
    """Linear interpolation between two equilibria of the same states."""
    fields = ("loads", "force", "jump", "conjugate")
    return Equilibrium(*[(1.0 - x) * getattr(a, k) + x * getattr(b, k) for k in fields])


def work_between(a: Equilibrium, b: Equilibrium, n_forces: int) -> float:
    """External work of supports and force patterns along a linear piece."""
    n = len(a.loads) - n_forces
    by_supports = 0.5 * (a.conjugate + b.conjugate)[:n] @ (b.loads - a.loads)[:n]
    by_forces = 0.5 * (a.loads + b.loads)[n:] @ (b.conjugate - a.conjugate)[n:]
    return float(by_supports + by_forces)


def bond_work(a: Equilibrium, b: Equilibrium) -> float:
    """Energy released by bonds whose force falls, on a linear piece or to a state after it."""
    return b.lost - 0.5 * float((a.force + b.force) @ (b.jump - a.jump))


__all__ = ["ComponentStates", "Equilibrium", "JumpSystem", "blend", "bond_work", "work_between"]
