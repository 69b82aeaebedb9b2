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
overlap afterwards are all open pairs looked at (:mod:`fxcrack.solvers.explicit_open_pairs`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.sparse import Product
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.front import Front
from fxcrack.interface.lumped import LumpedInterface
from fxcrack.interface.lumped_rows import bonds_of, jumps_along, mean_jumps
from fxcrack.interface.pair import Pair
from fxcrack.solvers.explicit_acting import ActingForces, InterfaceEnergies
from fxcrack.solvers.explicit_bonds import Fading, SofteningBonds, older
from fxcrack.solvers.explicit_elastic import ElasticBonds
from fxcrack.solvers.explicit_open_pairs import FreeMotion, OpenPairs
from fxcrack.solvers.explicit_softening import LiveBonds

_LEFT = 1e-6
"""Energy left to an elastic bond over that it had stored, below which it is free at once."""


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
        references: Prescribed motions of references, of their displacement and velocity rows as of
            the nodes, shape (2, n_motions).
        open_pairs: Contact and friction of the pairs that are not tied.
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
        self.open_pairs = OpenPairs(lumped, pairs)
        self._fixed = np.flatnonzero(lumped.which.ravel() >= 0)
        self._fixed_column = lumped.which.ravel()[self._fixed]
        self._fixed_value = lumped.value.ravel()[self._fixed]
        self.references = np.zeros((2, lumped.n_motions))
        self._target = np.zeros(lumped.n_motions)
        self._h = self._dt = 1.0
        self._acting = ActingForces()
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
        self._any_given = bool(len(self._fixed) or lumped.n_motions)
        if self._any_given:
            self._given_push = Product(lumped.given_accelerations(self._fixed))
        self.set_frames()

    def set_frames(self) -> None:
        """Take the frames of the rows, which have turned, and prepare what depends on them."""
        self.elastic.renew()
        self.open_pairs.renew(self.elastic.active)
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
            at = jumps_along(self.lumped, rows, bonds.direction[rows])(motion.ravel())
            bonds.origin[rows] = at
        bonds.active[rows] = True
        self._soften()

    # -- one increment -------------------------------------------------------------------

    def accelerate(self, forces: Array, coordinates: Array, h: float, dt: float) -> None:
        """Find the motion of the nodes to the end of the increment, and all interface forces.

        Args:
            forces: On the nodes, without those of interfaces, shape (n_nodes gdim,), force; kept
                until the next call.
            coordinates: Prescribed displacements of the support columns at the end, those of
                references last, shape (n_columns,).
            h: Time from the last velocity to the next, time.
            dt: Increment, time.
        """
        lumped = self.lumped
        if self.elastic.exist:
            forces = forces + self.elastic_forces().ravel()
        self._forces, self._more, self._h, self._dt = forces, None, h, dt
        a = lumped.accelerations.into(forces, self._a)
        if self._any_given:
            target = self._fixed_value * coordinates[self._fixed_column]
            self._given = ((target - self._u[self._fixed]) / dt - self._v[self._fixed]) / h
            if lumped.n_motions:
                self._target = coordinates[len(coordinates) - lumped.n_motions :]
                q, rate = self.references
                given = ((self._target - q) / dt - rate) / h
                self._given = np.concatenate([self._given, given])
            self._given_push.add(self._given, a)
        x, y = self._free_motion()
        self._acting = acting = ActingForces()
        if not len(lumped.open):
            return
        if not self.fading and self.open_pairs.penalty is None:
            live = self._live
            if len(live):
                acting.softening = pull = live.forces(self._u, x, dt * h)
                live.push.add(-h * pull, y)
                live.push.add((-h * dt) * pull, x)
            if not self.open_pairs.overlap(x):
                if acting.softening is not None and not lumped.simple:
                    self._more = lumped.on_nodes(self._of_live(acting.softening)).ravel()
                return
            if acting.softening is not None:
                self._free_motion()
        motion = FreeMotion(
            self.gap, lumped.jumps(self.v), lumped.jumps(x.reshape(self._shape)), h, dt
        )
        self._acting = acting = self.open_pairs.forces(
            self._live, self.fading, self._place, motion
        )  # fmt: skip
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

    def _of_live(self, pull: Array) -> Array:
        """Forces of the live bonds on the slave side of the open rows, shape (n_open, gdim)."""
        out = np.zeros((len(self.lumped.open), self._shape[1]))
        out[self._soft] = -pull[:, None] * self._live.direction
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
            acting.account(self.energies, self.lumped.jumps(mean.reshape(self._shape)))
        if acting.softening is not None:
            live = self._live
            self.energies.bonds += live.follow(acting.softening, self._u, self._v, self._y, h, dt)
        self._u, self._x = self._x, self._u
        self._v, self._y = self._y, self._v
        if self.lumped.n_motions:
            self.references = np.array([self._target, (self._target - self.references[0]) / dt])
        if self.fading:
            self.fading = older(self.fading, dt)
        if acting.softening is not None:
            broken = self._live.broken()
            if len(broken):
                self._bonds.active[broken] = False
                self._bonds.freed[broken] = True
                self._soften()

    def chosen_bonds(self, rows: Ints) -> ChosenBonds:
        """Prepare :meth:`bonds_at` for some tied rows, shape (n,)."""
        if np.any(self.elastic.active[rows]):
            jumps = mean_jumps(self.lumped, rows[:, None], np.ones((len(rows), 1)))
            return ChosenBonds(jumps, None, self.elastic.stiffness_of(rows))
        return ChosenBonds(*bonds_of(self.lumped, rows, self._fixed))

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

    def begin(self, coordinates: Array) -> None:
        """Take the displacement of the start: couplings and equations hold there.

        Args:
            coordinates: Of the support columns, those of references last, shape (n_columns,).
        """
        lumped = self.lumped
        constraints = lumped.constraints
        if constraints is not None:
            self.references[0] = coordinates[len(coordinates) - lumped.n_motions :]
            self._u[:] = constraints.displaced(self._u, self.references[0])
            moved = constraints.involved
            # of velocities that contradict them the momentum is kept
            momentum = np.repeat(lumped.mass, self._shape[1]) * self._v
            self._v[moved] = lumped.accelerations(momentum)[moved]
        lumped.follow(self.v)

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


def dynamics_of(
    lumped: LumpedInterface, pairs: Sequence[Pair], fronts: Sequence[Front], continuum: Continuum
) -> InterfaceDynamics:
    """The interfaces of a scene at the start: bonded rows are tied, or held by springs; collective.

    Args:
        lumped: Masses and weights.
        pairs: Interfaces.
        fronts: Their fronts, which learn what supports hold.
        continuum: The bodies.
    """
    bonded = np.zeros(lumped.n_rows, dtype=bool)
    for pair, front, rows, held in zip(pairs, fronts, lumped.row_of, lumped.pair_held, strict=True):
        front.tied = held.all(axis=1) | (pair.bonded & ~pair.paired)
        has = rows >= 0
        bonded[rows[has]] = front.bonded[has]
    elastic = ElasticBonds(lumped, pairs, continuum)
    sprung = np.any(elastic.local > 0.0, axis=1)
    elastic.active = bonded & sprung
    return InterfaceDynamics(lumped, pairs, bonded & ~sprung, elastic)


__all__ = ["ChosenBonds", "InterfaceDynamics", "dynamics_of"]
