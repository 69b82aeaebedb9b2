"""Forces of the interfaces over one increment of explicit dynamics, the same on every rank.

Every pair of nodes is tied, softens, or is open. From the jumps d at the start of the increment and
those it would end with if no force acted on the open pairs, d* = d + dt B (v + h a), follow

    softening   the force that spends the energy of its law exactly (discrete gradient)
    contact     p_n = max(0, -(d*_n + gap)/(dt h H_n)), for which the pair just touches afterwards
    friction    the force that keeps touching pairs from sliding, at most mu p_n

one pair after the other where every slave has a master of its own; where slaves share masters, in a
few sweeps over all of them. Work counts with the mean velocity of the increment, so that the sum of
all energies stays what it was, whatever the forces are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.equilibrium.discrete_gradient import softening_force
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.pairing import Pair
from fxcrack.solvers.explicit_bonds import Fading, SofteningBonds, older

SWEEPS = 200
"""Sweeps, at most, over nodes that share masters; those of stiff bonds take many."""
_SETTLED = 1e-12
"""Change of forces in a sweep, over the largest of them, that ends the sweeps."""
_FREE = 1.0 - 1e-12
"""Part of the final opening from which on a bond is free."""


@dataclass
class InterfaceEnergies:
    """Energy that has left the bodies through the interfaces, force times length.

    Attributes:
        bonds: Spent by bonds that are released.
        contact: Lost where faces meet.
        friction: Dissipated by friction.
        ties: Kinetic energy of row sums beyond that of the nodes, gone with released ties.
    """

    bonds: float = 0.0
    contact: float = 0.0
    friction: float = 0.0
    ties: float = 0.0


@dataclass
class _Acting:
    """Forces on the slave side of the open rows in the present increment, by what they are.

    Attributes:
        softening: Rows among the open ones that soften, and their forces.
        fading: Likewise, of bonds that fade.
        contact: Likewise, of faces that touch; normal forces.
        friction: Likewise, tangential forces.
        total: Sum of all, shape (n_open, gdim); ``None`` where nothing acts.
    """

    softening: tuple[Ints, Array] | None = None
    fading: tuple[Ints, Array] | None = None
    contact: tuple[Ints, Array] | None = None
    friction: tuple[Ints, Array] | None = None
    total: Array | None = None


class InterfaceDynamics:
    """Replicated motion of the interface nodes, and the forces between their faces.

    Args:
        lumped: Masses and weights.
        pairs: Interfaces.
        tied: Rows that are tied at the beginning, shape (n_rows,).

    Attributes:
        u: Displacement of the nodes, shape (n_nodes, gdim), length.
        v: Velocity in the middle of the last increment, same shape, length/time.
        a: Acceleration of the present increment, same shape.
        total: Forces on the nodes with what tied slaves give them, same shape.
        gap: Jumps of the open rows at the start of the increment, shape (n_open, gdim), length.
        bonds: Softening laws.
        fading: Bond forces that fall with time.
        energies: What has left the bodies through the interfaces.
        penalty: Stiffness of contact over m/dt^2 of the pair; ``None``: by multipliers.
    """

    def __init__(self, lumped: LumpedInterface, pairs: Sequence[Pair], tied: Bools) -> None:
        gdim = lumped.frames.shape[-1]
        self.lumped = lumped
        n = len(lumped.nodes)
        self.u, self.v = np.zeros((n, gdim)), np.zeros((n, gdim))
        self.a, self.total = np.zeros((n, gdim)), np.zeros((n, gdim))
        self.bonds = SofteningBonds.none(lumped.n_rows, gdim)
        self.fading: list[Fading] = []
        self.energies = InterfaceEnergies()
        self.penalty: float | None = None
        self._touches = np.zeros(lumped.n_rows, dtype=bool)
        self._friction = np.zeros(lumped.n_rows)
        for pair, rows in zip(pairs, lumped.row_of, strict=True):
            has = rows >= 0
            self._touches[rows[has]] = pair.interface.contact
            if pair.friction is not None:
                self._friction[rows[has]] = pair.friction[has]
        # prescribed on all sides along the normal: no force could keep such a pair apart
        self._fixed = np.nonzero(lumped.which >= 0)
        self._fixed_column = lumped.which[self._fixed]
        self._fixed_value = lumped.value[self._fixed]
        self._acting = _Acting()
        self.set_ties(tied)

    # -- ties and bonds ------------------------------------------------------------------

    def set_ties(self, tied: Bools) -> None:
        """Tie some rows, shape (n_rows,), and prepare what depends on that."""
        lumped = self.lumped
        lumped.set_ties(tied)
        rows = lumped.open
        self._normal = lumped.frames[rows][:, :, 0]
        self._compliance = np.einsum("nc,nc->n", lumped.compliance, self._normal**2)
        scale = self._compliance.max(initial=0.0)
        may_touch = self._touches[rows] & (self._compliance > 1e-12 * scale)
        self._may_touch = np.flatnonzero(may_touch)
        self._all_touch = len(self._may_touch) == len(rows)
        self._gap = lumped.gap[rows] if np.any(lumped.gap[rows]) else None
        self._mu = self._friction[rows]
        self._rough = bool(self._mu.any())
        self._soften()

    def _soften(self) -> None:
        """Find the rows that soften among the open ones, and copy their constants."""
        bonds, rows = self.bonds, self.lumped.open
        self._soft = soft = np.flatnonzero(bonds.active[rows])
        self._soft_rows = k = rows[soft]
        self._e = bonds.direction[k]
        self._soft_compliance = np.einsum("nc,nc->n", self.lumped.compliance[soft], self._e**2)
        self._strength, self._final = bonds.strength[k], bonds.final[k]

    def release(self, rows: Ints) -> None:
        """Untie rows; what holds them afterwards is given by the methods below."""
        before = self.lumped.excess_energy(self.v)
        tied = self.lumped.tied.copy()
        tied[rows] = False
        self.set_ties(tied)
        self.energies.ties += before - self.lumped.excess_energy(self.v)

    def soften(self, rows: Ints, force: Array, onset: Array, energy: Array, area: Array) -> None:
        """Let the bonds of rows that were released soften with their opening.

        Args:
            rows: Shape (n,).
            force: Bond forces on the slaves at debonding, shape (n, gdim), force.
            onset: Size of the force at which the law begins over the one at debonding, shape (n,).
            energy: What each bond is to spend, shape (n,), force times length.
            area: Area that the release of each sweeps, shape (n,), length^2.
        """
        bonds, size = self.bonds, np.linalg.norm(force, axis=1)
        some = size > 0.0
        rows, size, force = rows[some], size[some], force[some]
        bonds.direction[rows] = -force / size[:, None]
        bonds.strength[rows] = size * onset[some]
        bonds.final[rows] = 2.0 * energy[some] / bonds.strength[rows]
        bonds.low[rows] = bonds.top[rows] = 0.0
        bonds.area[rows] = area[some]
        bonds.active[rows] = True
        self._soften()

    # -- one increment -------------------------------------------------------------------

    def accelerate(self, forces: Array, coordinates: Array, h: float, dt: float) -> None:
        """Find the accelerations of the nodes and all interface forces.

        Args:
            forces: On the nodes, without those of interfaces, shape (n_nodes, gdim), force; not
                kept.
            coordinates: Prescribed displacements of the support columns at the end, shape
                (n_columns,).
            h: Time from the last velocity to the next, time.
            dt: Increment, time.
        """
        lumped = self.lumped
        self.total = total = lumped.collect(forces)
        self.a = a = total * lumped.inverse
        fixed: Array | None = None
        if len(self._fixed_column):
            target = self._fixed_value * coordinates[self._fixed_column]
            fixed = ((target - self.u[self._fixed]) / dt - self.v[self._fixed]) / h
            a[self._fixed] = fixed
        lumped.follow(a)
        self._acting = acting = self._open_forces(h, dt)
        if acting.total is None:
            return
        lumped.push(total, acting.total)
        np.multiply(total, lumped.inverse, out=a)
        if fixed is not None:
            a[self._fixed] = fixed
        lumped.follow(a)

    def _open_forces(self, h: float, dt: float) -> _Acting:
        """Forces between the faces of open pairs."""
        lumped, acting = self.lumped, _Acting()
        if not len(lumped.open):
            self.gap = np.zeros((0, self.u.shape[1]))
            return acting
        self.gap = gap = lumped.jumps(self.u)
        free = gap + dt * lumped.jumps(self.v + h * self.a)
        given = self._fading_forces(acting, dt)
        if given is not None:
            free = free + dt * h * lumped.response(given)
        if self.penalty is None:
            found = self._by_multipliers(acting, free, dt * h)
        else:
            found = self._by_penalty(acting, free, dt * h)
        if given is not None:
            found = given if found is None else found + given
        acting.total = found
        return acting

    def _fading_forces(self, acting: _Acting, dt: float) -> Array | None:
        """Forces of bonds that fall with time, shape (n_open, gdim)."""
        if not self.fading:
            return None
        lumped = self.lumped
        place = np.full(lumped.n_rows, -1, dtype=np.int64)
        place[lumped.open] = np.arange(len(lumped.open))
        rows, forces = [], []
        for f in self.fading:
            rows.append(place[f.rows])
            forces.append(f.left(dt) * f.force)
        at, force = np.concatenate(rows), np.concatenate(forces)
        acting.fading = at, force
        out = np.zeros_like(self.gap)
        out[at] += force
        return out

    def _by_multipliers(self, acting: _Acting, free: Array, hh: float) -> Array | None:
        """Softening forces and exact contact, shape (n_open, gdim); ``None`` where there is none.

        Args:
            acting: Filled in.
            free: Jumps at the end without these forces, shape (n_open, gdim), length.
            hh: dt h.
        """
        soft, lumped = self._soft, self.lumped
        strength = np.zeros(len(soft))
        pressure = np.zeros(len(free))
        touch = self._may_touch[:0]
        forces: Array | None = None
        for sweep in range(SWEEPS):
            there = free
            if sweep and forces is not None:
                there = free + hh * lumped.response(forces)
            before, pressed = strength, pressure
            after = there
            if len(soft):
                compliance = hh * self._soft_compliance
                opening = (there[soft] * self._e).sum(axis=1) + compliance * strength
                strength = self._softening(opening, compliance)
                # what this changes at once at its own place; the rest follows in the next sweep
                after = there.copy()
                pull = (before - strength)[:, None] * self._e
                after[soft] += hh * lumped.compliance[soft] * pull
            pressure, touch = self._pressures(after, pressure, hh)
            if not len(soft) and not len(touch):
                return None
            forces = pressure[:, None] * self._normal
            forces[soft] -= strength[:, None] * self._e
            if lumped.simple and not (len(soft) and pressure[soft].any()):
                break  # every pair moves by itself, and softens or touches
            if sweep and _settled(strength, before) and _settled(pressure, pressed):
                break
        assert forces is not None
        if len(soft):
            acting.softening = soft, -strength[:, None] * self._e
        if len(touch):
            acting.contact = touch, pressure[touch, None] * self._normal[touch]
            if self._rough:
                forces = forces + self._sticking(acting, free, forces, pressure, hh)
        return forces

    def _pressures(self, jumps: Array, pressure: Array, hh: float) -> tuple[Array, Ints]:
        """Contact forces for which touching pairs end at zero distance, and where there are any.

        Args:
            jumps: At the end of the increment with the present forces, shape (n_open, gdim).
            pressure: Those forces, shape (n_open,), force.
            hh: dt h.

        Returns:
            Pressures, shape (n_open,), and rows, shape (m,).
        """
        may = self._may_touch
        if not len(may):
            return pressure, may
        gaps = self._normal_gaps(jumps) if self._all_touch else self._normal_gaps(jumps)[may]
        old = pressure[may]
        if not old.any():
            if gaps.min() >= 0.0:
                return pressure, may[:0]
            new = np.maximum(-gaps / (hh * self._compliance[may]), 0.0)
        else:
            new = np.maximum(old - gaps / (hh * self._compliance[may]), 0.0)
        out = np.zeros(len(pressure))
        out[may] = new
        return out, may[new > 0.0]

    def _softening(self, without: Array, compliance: Array) -> Array:
        """Forces of the softening bonds, shape (n_soft,).

        Args:
            without: Openings at the end without them, shape (n_soft,), length.
            compliance: Of these openings, length/force.
        """
        k, bonds = self._soft_rows, self.bonds
        here = (self.gap[self._soft] * self._e).sum(axis=1)
        low = bonds.low[k]
        change = 0.5 * (here + without) - low
        top = bonds.top[k]
        return softening_force(self._strength, self._final, low, top, change, 0.5 * compliance)

    def _normal_gaps(self, jumps: Array) -> Array:
        gaps = (jumps * self._normal).sum(axis=1)
        return np.asarray(gaps if self._gap is None else gaps + self._gap)

    def _sticking(
        self, acting: _Acting, free: Array, forces: Array, pressure: Array, hh: float
    ) -> Array:
        """Friction of the touching pairs, shape (n_open, gdim), force."""
        assert acting.contact is not None
        touch, lumped = acting.contact[0], self.lumped
        out = np.zeros_like(free)
        rough = touch[self._mu[touch] > 0.0]
        if not len(rough):
            return out
        moved = (free + hh * lumped.response(forces) - self.gap)[rough]
        n = self._normal[rough]
        slide = moved - (moved * n).sum(axis=1)[:, None] * n
        # masses that differ by component: the lightest one decides
        holding = -slide / (hh * lumped.compliance[rough].max(axis=1))[:, None]
        size = np.linalg.norm(holding, axis=1)
        limit = self._mu[rough] * pressure[rough]
        holding *= np.minimum(1.0, limit / np.maximum(size, np.finfo(float).tiny))[:, None]
        acting.friction = rough, holding
        out[rough] = holding
        return out

    def _by_penalty(self, acting: _Acting, free: Array, hh: float) -> Array | None:
        """Softening forces, and contact by a stiffness on present overlaps."""
        assert self.penalty is not None
        may, self._may_touch = self._may_touch, self._may_touch[:0]
        forces = self._by_multipliers(acting, free, hh)
        self._may_touch = may
        gaps = self._normal_gaps(self.gap)[may]
        touch = may[gaps < 0.0]
        if not len(touch):
            return forces
        stiffness = self.penalty / (hh * self._compliance[touch])
        pressure = stiffness * -self._normal_gaps(self.gap)[touch]
        push = pressure[:, None] * self._normal[touch]
        acting.contact = touch, push
        out = np.zeros_like(free) if forces is None else forces
        out[touch] += push
        return out

    def advance(self, h: float, dt: float) -> None:
        """Move the nodes to the end of the increment, and account for the work of the interfaces.

        Args:
            h: Time from the last velocity to the next, time.
            dt: Increment, time.
        """
        acting = self._acting
        if acting.total is not None:
            lumped = self.lumped
            work = h * lumped.jumps(self.v + 0.5 * h * self.a)
            self._account(acting, work)
        self.v += h * self.a
        if acting.softening is not None:
            self._follow_bonds(acting, work, dt)
        if self.fading:
            self.fading = older(self.fading, dt)
        self.u += dt * self.v

    def _account(self, acting: _Acting, way: Array) -> None:
        """Add the work of the forces on the way of the open jumps, shape (n_open, gdim)."""
        energies = self.energies
        for name, found in (
            ("bonds", acting.fading),
            ("contact", acting.contact),
            ("friction", acting.friction),
        ):
            if found is not None:
                rows, forces = found
                lost = -float(np.vdot(forces, way[rows]))
                setattr(energies, name, getattr(energies, name) + lost)

    def _follow_bonds(self, acting: _Acting, way: Array, dt: float) -> None:
        """Openings, energies and ends of the softening bonds."""
        assert acting.softening is not None
        soft, forces = acting.softening
        k, bonds = self._soft_rows, self.bonds
        spent = -(forces * way[soft]).sum(axis=1)
        self.energies.bonds += float(spent.sum())
        middle = self.gap[soft] + 0.5 * dt * self.lumped.jumps(self.v)[soft]
        low = (middle * self._e).sum(axis=1)
        # by openings in the middle of increments, of which the first one counts whole
        bonds.spent[k] += -(forces * self._e).sum(axis=1) * (low - bonds.low[k])
        bonds.low[k] = low
        bonds.top[k] = top = np.maximum(bonds.top[k], low)
        done = top >= _FREE * self._final
        if done.any():
            bonds.active[k[done]] = False
            bonds.freed[k[done]] = True
            self._soften()

    def open_forces(self) -> Array:
        """Forces on the slave side of the open rows, shape (n_open, gdim), force."""
        total = self._acting.total
        return np.zeros_like(self.gap) if total is None else total

    def smallest_gap(self, rows: Bools) -> tuple[float, int]:
        """Smallest normal gap among some rows, and the row; 0 and -1 where none is open."""
        chosen = np.flatnonzero(rows[self.lumped.open])
        if not len(chosen):
            return 0.0, -1
        gaps = self._normal_gaps(self.gap)[chosen]
        i = int(np.argmin(gaps))
        return float(gaps[i]), int(self.lumped.open[chosen[i]])


def _settled(now: Array, before: Array) -> bool:
    """Whether forces, shape (n,), no longer change from sweep to sweep."""
    return bool(np.abs(now - before).max(initial=0.0) <= _SETTLED * np.abs(now).max(initial=0.0))


__all__ = ["InterfaceDynamics", "InterfaceEnergies"]
