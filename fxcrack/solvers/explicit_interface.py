"""Forces of the interfaces over one increment of explicit dynamics, the same on every rank.

Every pair of nodes is tied, softens, or is open. From the jumps d at the start of the increment and
those it would end with if no force acted on the open pairs, d* = d + dt B (v + h a), follow

    softening   the force that spends the energy of its law exactly (discrete gradient)
    contact     p_n = max(0, -(d*_n + gap)/(dt h H_n)), for which the pair just touches afterwards
    friction    the force that keeps touching pairs from sliding, at most mu p_n

one pair after the other where every slave has a master of its own; where slaves share masters, in a
few sweeps over all of them. Work counts with the mean velocity of the increment, so that the sum of
all energies stays what it was, whatever the forces are.

Most increments need little of this: softening bonds are solved alone, and only where a pair would
overlap afterwards are all open pairs looked at (:meth:`InterfaceDynamics._general`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.sparse import Product
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.pair import Pair
from fxcrack.solvers.explicit_bonds import Fading, SofteningBonds, older
from fxcrack.solvers.explicit_elastic import ElasticBonds
from fxcrack.solvers.explicit_faces import (
    SWEEPS,
    FaceForces,
    OpenFaces,
    find_forces,
    total_forces,
    without_gain,
)
from fxcrack.solvers.explicit_softening import LiveBonds

_LEFT = 1e-6
"""Energy left to an elastic bond over that it had stored, below which it is free at once."""


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
        softening: Forces of the live bonds, tension positive, shape (n_live,).
        fading: Rows among the open ones, and forces, of bonds that fade.
        contact: Likewise, of faces that touch; normal forces.
        friction: Likewise, tangential forces.
        total: Sum of all, shape (n_open, gdim); ``None`` where only live bonds act, or nothing.
    """

    softening: Array | None = None
    fading: tuple[Ints, Array] | None = None
    contact: tuple[Ints, Array] | None = None
    friction: tuple[Ints, Array] | None = None
    total: Array | None = None


@dataclass(frozen=True)
class ChosenBonds:
    """Bond forces of some tied rows, as long as ties stay as they are.

    Attributes:
        by_forces: From the forces on the nodes, (n gdim, n_nodes gdim); of elastic bonds jumps from
            their displacements.
        by_motion: From the accelerations that supports prescribe at nodes, (n gdim, n_prescribed).
        stiffness: Of elastic bonds, shape (n, gdim, gdim), force/length.
    """

    by_forces: Product
    by_motion: Product | None
    stiffness: Array | None = None


class InterfaceDynamics:
    """Replicated motion of the interface nodes, and the forces between their faces.

    Args:
        lumped: Masses and weights.
        pairs: Interfaces.
        tied: Rows that are tied at the beginning, shape (n_rows,).
        elastic: Bonds with a stiffness of their own; their rows are open.

    Attributes:
        fading: Bond forces that fall with time.
        energies: What has left the bodies through the interfaces.
        penalty: Stiffness of contact over m/dt^2 of the pair; ``None``: by multipliers.
    """

    def __init__(
        self, lumped: LumpedInterface, pairs: Sequence[Pair], tied: Bools, elastic: ElasticBonds
    ) -> None:
        gdim = lumped.frames.shape[-1]
        self.lumped, self.elastic = lumped, elastic
        self._shape = len(lumped.nodes), gdim
        n = len(lumped.nodes) * gdim
        # displacement and velocity, those of the end of the increment, and work space
        self._u, self._v, self._x, self._y = (np.zeros(n) for _ in range(4))
        self._a, self._given, self._work = np.zeros(n), np.zeros(n), np.zeros(n)
        self._forces = np.zeros(n)
        self._more: Array | None = None
        self._bonds = SofteningBonds.none(lumped.n_rows, gdim)
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
        self._fixed = np.flatnonzero(lumped.which.ravel() >= 0)
        self._fixed_column = lumped.which.ravel()[self._fixed]
        self._fixed_value = lumped.value.ravel()[self._fixed]
        self._h = self._dt = 1.0
        self._warned_of_sweeps = False
        self._acting = _Acting()
        self.set_ties(tied)

    # -- motion --------------------------------------------------------------------------

    @property
    def u(self) -> Array:
        """Displacement of the nodes, shape (n_nodes, gdim), length."""
        return self._u.reshape(self._shape)

    @u.setter
    def u(self, values: Array) -> None:
        self._u[:] = values.ravel()

    @property
    def v(self) -> Array:
        """Velocity in the middle of the last increment, shape (n_nodes, gdim), length/time."""
        return self._v.reshape(self._shape)

    @v.setter
    def v(self, values: Array) -> None:
        self._v[:] = values.ravel()

    @property
    def a(self) -> Array:
        """Acceleration of the present increment, shape (n_nodes, gdim), length/time^2."""
        out = self._a
        if self._more is not None:
            out = out + self.lumped.accelerations(self._more)
        return out.reshape(self._shape)

    @property
    def total(self) -> Array:
        """Forces on the nodes with what tied slaves give them, shape (n_nodes, gdim), force."""
        return self.lumped.collect(self.forces.copy())

    @property
    def forces(self) -> Array:
        """Forces on the nodes, those of open pairs included, shape (n_nodes, gdim), force."""
        out = self._forces if self._more is None else self._forces + self._more
        return out.reshape(self._shape)

    @property
    def gap(self) -> Array:
        """Jumps of the open rows at the start of the increment, shape (n_open, gdim), length."""
        return self.lumped.jumps(self.u)

    @property
    def bonds(self) -> SofteningBonds:
        """Laws of the softening bonds, up to date."""
        self._live.store()
        return self._bonds

    @bonds.setter
    def bonds(self, bonds: SofteningBonds) -> None:
        self._bonds = bonds
        self._live = LiveBonds(bonds, self.lumped)

    # -- ties and bonds ------------------------------------------------------------------

    def set_ties(self, tied: Bools) -> None:
        """Tie some rows, shape (n_rows,), and prepare what depends on that."""
        lumped = self.lumped
        lumped.set_ties(tied)
        if len(self._fixed):
            self._fixed_push = Product(lumped.following[:, self._fixed])
        self.set_frames()

    def set_frames(self) -> None:
        """Take the frames of the rows, which have turned, and prepare what depends on them."""
        lumped = self.lumped
        rows = lumped.open
        self.elastic.renew()
        self._normal = lumped.frames[rows][:, :, 0]
        self._compliance = np.einsum("nc,nc->n", lumped.compliance, self._normal**2)
        scale = self._compliance.max(initial=0.0)
        # prescribed on all sides along the normal: no force could keep such a pair apart
        may_touch = self._touches[rows] & (self._compliance > 1e-12 * scale)
        may_touch &= ~self.elastic.active[rows]
        self._may_touch = np.flatnonzero(may_touch)
        self._closing = lumped.jumps_along(rows[self._may_touch], self._normal[self._may_touch])
        self._has_gap = bool(np.any(lumped.gap[rows]))
        self._closing_gap = lumped.gap[rows[self._may_touch]]
        self._gaps = np.zeros(len(self._may_touch))
        self._faces = OpenFaces(
            self._normal, lumped.gap[rows] if self._has_gap else None, self._may_touch,
            self._friction[rows], lumped.compliance, lumped.reach, lumped.response, lumped.simple,
        )  # fmt: skip
        self._last_found: FaceForces | None = None
        self._soften()

    def _soften(self) -> None:
        """Find the bonds that soften among the open rows."""
        if hasattr(self, "_live"):
            self._live.store()
        self._live = LiveBonds(self._bonds, self.lumped)
        place = np.full(self.lumped.n_rows, -1, dtype=np.int64)
        place[self.lumped.open] = np.arange(len(self.lumped.open))
        self._place = place
        self._soft = place[self._live.rows]

    def release(self, rows: Ints) -> Array:
        """Untie rows; what holds them afterwards is given by the methods below.

        Returns:
            Energy that was stored in the bonds of the rows, shape (n,), force times length.
        """
        lost = np.zeros(len(rows))
        if self.elastic.exist:
            lost = self._stored_by_row()[rows]
            self.energies.bonds += float(lost.sum())
            held = self.elastic.active.copy()
            held[rows] = False
            self.elastic.hold(held)
        before = self.lumped.excess_energy(self.v)
        tied = self.lumped.tied.copy()
        tied[rows] = False
        self.set_ties(tied)
        self.energies.ties += before - self.lumped.excess_energy(self.v)
        return lost

    def _stored_by_row(self) -> Array:
        """Energy of elastic bonds in the middle of the last increment, shape (n_rows,)."""
        last = 2.0 * self._h - self._dt
        now = self.lumped.jumps(self.u)
        return self.elastic.energies(now - last * self.lumped.jumps(self.v), now)

    def stored(self) -> float:
        """Energy of elastic bonds in the middle of the last increment, force times length."""
        return float(self._stored_by_row().sum()) if self.elastic.exist else 0.0

    def elastic_forces(self) -> Array:
        """Forces of elastic bonds at the start of the increment, shape (n_nodes, gdim), force."""
        return self.lumped.on_nodes(self.elastic.forces(self.gap))

    def soften(
        self, rows: Ints, force: Array, onset: Array, energy: Array, area: Array, lost: Array
    ) -> None:
        """Let the bonds of rows that were released soften with their opening.

        Args:
            rows: Shape (n,).
            force: Bond forces on the slaves at debonding, shape (n, gdim), force.
            onset: Size of the force at which the law begins over the one at debonding, shape (n,).
            energy: What each bond is to spend, shape (n,), force times length.
            area: Area that the release of each sweeps, shape (n,), length^2.
            lost: Part of the energy that was stored in the bond and is gone, shape (n,).
        """
        bonds, size = self._bonds, np.linalg.norm(force, axis=1)
        bonds.spent[rows], bonds.area[rows] = lost, area
        energy = energy - lost
        some = (size > 0.0) & (energy > _LEFT * lost)
        bonds.freed[rows[~some]] = True
        rows, size, force = rows[some], size[some], force[some]
        bonds.direction[rows] = -force / size[:, None]
        bonds.strength[rows] = size * onset[some]
        bonds.final[rows] = 2.0 * energy[some] / bonds.strength[rows]
        bonds.low[rows] = bonds.top[rows] = 0.0
        if np.any(self.elastic.local[rows]):
            motion = self.u - (self._h - 0.5 * self._dt) * self.v
            at = self.lumped.jumps_along(rows, bonds.direction[rows])(motion.ravel())
            bonds.origin[rows] = at
        bonds.active[rows] = True
        self._soften()

    # -- one increment -------------------------------------------------------------------

    def accelerate(self, forces: Array, coordinates: Array, h: float, dt: float) -> None:
        """Find the motion of the nodes to the end of the increment, and all interface forces.

        Args:
            forces: On the nodes, without those of interfaces, shape (n_nodes gdim,), force; kept
                until the next call.
            coordinates: Prescribed displacements of the support columns at the end, shape
                (n_columns,).
            h: Time from the last velocity to the next, time.
            dt: Increment, time.
        """
        lumped = self.lumped
        if self.elastic.exist:
            forces = forces + self.elastic_forces().ravel()
        self._forces, self._more, self._h, self._dt = forces, None, h, dt
        a = lumped.accelerations.into(forces, self._a)
        if len(self._fixed):
            target = self._fixed_value * coordinates[self._fixed_column]
            self._given = ((target - self._u[self._fixed]) / dt - self._v[self._fixed]) / h
            self._fixed_push.add(self._given, a)
        x, y = self._free_motion()
        self._acting = acting = _Acting()
        if not len(lumped.open):
            return
        if not self.fading and self.penalty is None:
            live = self._live
            if len(live):
                acting.softening = pull = live.forces(self._u, x, dt * h)
                live.push.add(-h * pull, y)
                live.push.add((-h * dt) * pull, x)
            if not self._overlaps(x):
                if acting.softening is not None and not lumped.simple:
                    self._more = lumped.on_nodes(self._of_live(acting.softening)).ravel()
                return
            if acting.softening is not None:
                self._free_motion()
        self._acting = acting = self._general(h, dt)
        if acting.total is not None:
            self._more = lumped.on_nodes(acting.total).ravel()
            more = lumped.accelerations.into(self._more, self._work)
            more *= h
            y += more
            more *= dt
            x += more

    def _free_motion(self) -> tuple[Array, Array]:
        """Displacement and velocity at the end if no force acted on the open pairs."""
        np.multiply(self._a, self._h, out=self._y)
        self._y += self._v
        np.multiply(self._y, self._dt, out=self._x)
        self._x += self._u
        return self._x, self._y

    def _overlaps(self, x: Array) -> bool:
        """Whether a pair in contact would overlap at a displacement, shape (n_nodes gdim,)."""
        if not len(self._may_touch):
            return False
        gaps = self._closing.into(x, self._gaps)
        if self._has_gap:
            gaps += self._closing_gap
        return bool(gaps.min() < 0.0)

    def _of_live(self, pull: Array) -> Array:
        """Forces of the live bonds on the slave side of the open rows, shape (n_open, gdim)."""
        out = np.zeros((len(self.lumped.open), self._shape[1]))
        out[self._soft] = -pull[:, None] * self._live.direction
        return out

    def _general(self, h: float, dt: float) -> _Acting:
        """All forces between the faces of open pairs."""
        lumped, acting = self.lumped, _Acting()
        free = lumped.jumps(self._x.reshape(self._shape))
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
        rows, forces = [], []
        for f in self.fading:
            rows.append(self._place[f.rows])
            forces.append(f.left(dt) * f.force)
        at, force = np.concatenate(rows), np.concatenate(forces)
        acting.fading = at, force
        out = np.zeros((len(self.lumped.open), self._shape[1]))
        out[at] += force
        return out

    def _by_multipliers(self, acting: _Acting, free: Array, hh: float) -> Array | None:
        """Softening forces, exact contact and friction, (n_open, gdim); ``None``: there is none.

        Args:
            acting: Filled in.
            free: Jumps at the end without these forces, shape (n_open, gdim), length.
            hh: dt h.
        """
        soft, live, faces = self._soft, self._live, self._faces
        gap = self.gap
        found = find_forces(faces, live, soft, gap, free, hh, self._last_found)
        if not faces.separate:
            self._last_found = found
        if not len(soft) and not len(found.touch):
            return None
        if not found.settled:
            self._calm(found, gap, free)
        if len(soft):
            acting.softening = found.strength
        touch = found.touch
        if len(touch):
            acting.contact = touch, found.pressure[touch, None] * self._normal[touch]
            if faces.rough:
                acting.friction = touch, found.holding[touch]
        return total_forces(faces, live, soft, found.strength, found.pressure, found.holding)

    def _calm(self, found: FaceForces, gap: Array, free: Array) -> None:
        """Take of forces that do not agree a part that adds no energy, and say so once."""
        faces, live, soft = self._faces, self._live, self._soft
        none = np.zeros_like(found.pressure)
        pulled = total_forces(faces, live, soft, found.strength, none, 0.0 * found.holding)
        after = (free - gap) / self._dt + self._h * faces.response(pulled)
        between = found.pressure[:, None] * faces.normal + found.holding
        before = self.lumped.jumps(self.v)
        part = without_gain(faces, between, before, after, self._h)
        found.pressure, found.holding = part * found.pressure, part * found.holding
        if not self._warned_of_sweeps:
            self._warned_of_sweeps = True
            log.warn(
                "explicit dynamics: forces between faces that touch did not settle in %d sweeps of "
                "an increment; of these forces the part is taken that adds no energy, %.3g",
                SWEEPS,
                part,
            )

    def _by_penalty(self, acting: _Acting, free: Array, hh: float) -> Array | None:
        """Softening forces, and contact by a stiffness on present overlaps."""
        assert self.penalty is not None
        faces, may = self._faces, self._may_touch
        self._faces = replace(faces, may_touch=may[:0])
        forces = self._by_multipliers(acting, free, hh)
        self._faces = faces
        overlap = np.minimum(faces.normal_gaps(self.gap)[may], 0.0)
        touch, overlap = may[overlap < 0.0], overlap[overlap < 0.0]
        if not len(touch):
            return forces
        stiffness = self.penalty / (hh * self._compliance[touch])
        push = (stiffness * -overlap)[:, None] * self._normal[touch]
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
            mean = (0.5 * h) * (self._v + self._y)
            self._account(acting, self.lumped.jumps(mean.reshape(self._shape)))
        if acting.softening is not None:
            live = self._live
            self.energies.bonds += live.follow(acting.softening, self._u, self._v, self._y, h, dt)
        self._u, self._x = self._x, self._u
        self._v, self._y = self._y, self._v
        if self.fading:
            self.fading = older(self.fading, dt)
        if acting.softening is not None:
            broken = self._live.broken()
            if len(broken):
                self._bonds.active[broken] = False
                self._bonds.freed[broken] = True
                self._soften()

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

    def chosen_bonds(self, rows: Ints) -> ChosenBonds:
        """Prepare :meth:`bonds_at` for some tied rows, shape (n,)."""
        if np.any(self.elastic.active[rows]):
            jumps = self.lumped.mean_jumps(rows[:, None], np.ones((len(rows), 1)))
            return ChosenBonds(jumps, None, self.elastic.stiffness_of(rows))
        return ChosenBonds(*self.lumped.bonds_of(rows, self._fixed))

    def bonds_at(self, chosen: ChosenBonds) -> Array:
        """Bond forces on the slaves of chosen rows, shape (n gdim,), force."""
        if chosen.stiffness is not None:
            d = chosen.by_forces(self._u).reshape(-1, self._shape[1])
            return np.asarray(-np.einsum("ncd,nd->nc", chosen.stiffness, d)).ravel()
        more = self._more
        out = chosen.by_forces(self._forces if more is None else self._forces + more)
        if chosen.by_motion is not None:
            chosen.by_motion.add(self._given, out)
        return out

    def moved(self, product: Product) -> Array:
        """A product with the present displacement of the nodes, shape (n,)."""
        return product(self._u)

    def open_forces(self) -> Array:
        """Forces on the slave side of the open rows, shape (n_open, gdim), force."""
        acting = self._acting
        if acting.total is not None:
            return acting.total
        if acting.softening is not None and len(acting.softening) == len(self._soft):
            return self._of_live(acting.softening)
        return np.zeros((len(self.lumped.open), self._shape[1]))

    def smallest_gap(self, rows: Bools) -> tuple[float, int]:
        """Smallest normal gap among some rows, and the row; 0 and -1 where none is open."""
        chosen = np.flatnonzero(rows[self.lumped.open])
        if not len(chosen):
            return 0.0, -1
        gaps = self._faces.normal_gaps(self.gap)[chosen]
        i = int(np.argmin(gaps))
        return float(gaps[i]), int(self.lumped.open[chosen[i]])


__all__ = ["ChosenBonds", "InterfaceDynamics", "InterfaceEnergies"]
