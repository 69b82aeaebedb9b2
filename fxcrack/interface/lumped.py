"""Interfaces between bodies of lumped mass: ties, masses and compliances, whole on every rank.

A bonded slave node follows its masters exactly, a_s = sum_m W_sm a_m, and gives them its force and
its mass:

    a_m = (f_m + sum_s W_sm f_s)/(m_m + sum_s W_sm m_s)

Row sums of the tied mass keep the mass diagonal and all momentum. The bond force on the slave is
what is left, p = m_s a_s - f_s. The kinetic energy of row sums is a little larger than that of the
nodes; it is :meth:`LumpedInterface.excess_energy`, zero where meshes match.

For open nodes d = u_s - sum_m W_sm u_m is free, and a force p on the slave side with its reaction
on the masters accelerates the jump by H p, with a compliance H per component of

    H = sum_j B_j^2/m_j,    B = (E_s - W) T

where T takes the motion of the nodes that follow nothing to that of all nodes and prescribed
components count as infinite mass. Rows on a rigid surface have no masters: bonded ones rest, or
slip along it (:mod:`fxcrack.interface.slipping_ties`). Where every slave has one master of its own,
all of this is indexing; otherwise sparse products. Products for chosen rows are in
:mod:`fxcrack.interface.lumped_rows`, couplings and equations, which T knows as well, in
:mod:`fxcrack.interface.lumped_constraints`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import InterfaceError
from fxcrack.base.sparse import Product, by_component
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.interface.constrained_slaves import drop_constrained
from fxcrack.interface.lumped_constraints import LumpedConstraints, SetAccelerations
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair
from fxcrack.interface.rigid import RigidSurface
from fxcrack.interface.slipping_ties import SlippingTies, refuse_masters_that_slip, slipping
from fxcrack.interface.supported_slaves import align_frames, check_slaves
from fxcrack.interface.supports import Supports
from fxcrack.interface.surface import FacetSurface


@dataclass(frozen=True)
class _Tie:
    """Tied rows whose slaves follow nodes that are settled before them.

    Attributes:
        rows: The rows.
        slaves: Their nodes.
        masters: One node each where there is one master, else ``None``.
        weights: W of these rows, and its transpose, where there are several.
    """

    rows: Ints
    slaves: Ints
    masters: Ints | None
    weights: tuple[Any, Any] | None


class LumpedInterface:
    """All pairs of a scene, one row for each slave node that has a jump.

    Args:
        layout: Unknowns of nodes and their numbers.
        pairs: Interfaces.
        supports: Prescribed components.
        mass: Mass of the owned dofs, shape (n_local,).
        masters: Master surfaces per pair that open nodes may be paired with anew, rigid ones among
            them; ``None`` where they stay as they are, as all do by default.

    Raises:
        InterfaceError: A support holds a bonded slave but not its masters alike, a node is a slave
            twice, or interfaces form a cycle.

    Attributes:
        nodes: The interface nodes, and those that couplings and equations move; arrays below have
            one row for each of them.
        constraints: Couplings and equations; ``None`` where there are none.
        mass: Their mass, shape (n_nodes,).
        pair: Pair of each row, shape (n_rows,).
        slave_node: Slave node of each row in its pair's surface, shape (n_rows,).
        row_of: Row of each slave node per pair, -1 where it has no jump, shape (n_slaves,).
        jumped: Per pair, the slave nodes that have a jump, shape (n_slaves,).
        slave: Interface node of each row's slave, shape (n_rows,).
        paired: Whether each row has a master at present, shape (n_rows,).
        rigid: Whether that is a rigid surface, shape (n_rows,).
        simple: Whether every slave has one master of its own.
        separate: Whether forces on open rows move no jump but their own.
        frames: Frame of each row, columns normal and tangents, shape (n_rows, gdim, gdim).
        held: Components of these frames that supports hold, shape (n_rows, gdim).
        gap: Initial normal gap of each row, shape (n_rows,), length.
        which: Support column of each component of the nodes, -1 if free, shape (n_nodes, gdim).
        value: Entry of that column, same shape.
        tied: Whether each row is tied, shape (n_rows,); set by :meth:`set_ties`.
        open: Rows that are not tied.
        group_mass: Mass of the nodes with that of the slaves tied to them, shape (n_nodes,).
        inverse: 1/group_mass per component, 0 where prescribed, shape (n_nodes, gdim).
        compliance: H of the open rows per component, shape (n_open, gdim).
        reach: Bound on what forces of one size on all open rows do to each of them, in any
            direction: the compliance where rows do not act on each other, else the sum of
            |B_i/m B_j| over the rows j, shape (n_open, gdim).
        accelerations: Accelerations of the nodes by the forces on them, those that are prescribed
            zero; on components of the nodes, shape (n_nodes gdim, n_nodes gdim).
        n_motions: Number of prescribed motions of references.
        version: How often ties, masses or frames have changed.
    """

    accelerations: Product | SetAccelerations

    def __init__(
        self, layout: DofLayout, pairs: Sequence[Pair], supports: Supports, mass: Array,
        masters: Sequence[FacetSurface | RigidSurface | None] = (),
    ) -> None:  # fmt: skip
        gdim = layout.gdim
        self.jumped = [p.paired.copy() for p in pairs]
        moving = [p for p, m in enumerate(masters) if m is not None]
        for p in moving:
            self.jumped[p] |= ~pairs[p].bonded  # they may come to a master later
        following = supports.following
        rigid = drop_constrained(pairs, self.jumped, following, layout, open_ones=False)
        further = [pairs[p].surface.dofs for p in moving]
        if following is not None:
            further += [d // layout.n_unknowns for d in (following.dofs, following.masters)]
        self.nodes = nodes = InterfaceNodes.of_pairs(
            layout, pairs, [m for m in masters if isinstance(m, FacetSurface)], self.jumped,
            _joined(further),
        )  # fmt: skip
        self.constraints = None if following is None else LumpedConstraints(following, nodes)
        self.n_motions = 0 if self.constraints is None else self.constraints.n_motions
        which, value = supports.at_nodes(nodes)
        self.which, self.value = which[:, :gdim], value[:, :gdim]
        check_slaves(pairs, self.jumped, nodes, which, value, supports)
        self.mass = nodes.gather(mass)[:, 0] if len(nodes) else np.zeros(0)
        at_slaves = [
            np.where(j[:, None], self._support_of(p), -1)
            for p, j in zip(pairs, self.jumped, strict=True)
        ]
        frames, held = align_frames(list(pairs), at_slaves, self.jumped, supports, gdim)
        held = [h | r[:, None] for h, r in zip(held, rigid, strict=True)]
        self.pair_frames, self.pair_held = frames, held
        counts = [int(j.sum()) for j in self.jumped]
        self.pair = np.repeat(np.arange(len(pairs)), counts)
        self.slave_node = _joined([np.flatnonzero(j) for j in self.jumped])
        self.row_of = []
        first = 0
        for jumped, count in zip(self.jumped, counts, strict=True):
            rows = np.full(len(jumped), -1, dtype=np.int64)
            rows[jumped] = first + np.arange(count)
            self.row_of.append(rows)
            first += count
        self.n_rows = first
        self.slave = _joined(
            [nodes.find(p.surface.dofs[j]) for p, j in zip(pairs, self.jumped, strict=True)]
        )
        self.frames = _stacked(
            [f[j] for f, j in zip(frames, self.jumped, strict=True)], (gdim, gdim)
        )
        self.held = _stacked([h[j] for h, j in zip(held, self.jumped, strict=True)], (gdim,), bool)
        self.gap = np.concatenate(
            [np.zeros(0), *(p.gap[j] for p, j in zip(pairs, self.jumped, strict=True))]
        )
        self.version = 0
        self.rigid, self._slips = slipping(pairs, self.row_of, self.n_rows)
        self.set_pairing(pairs)

    def _support_of(self, pair: Pair) -> Ints:
        """Support column of each slave's displacement; those without a jump do not count."""
        found = np.clip(self.nodes.find(pair.surface.dofs), 0, max(len(self.nodes) - 1, 0))
        if not len(self.nodes):
            return np.full((len(found), self.which.shape[1]), -1)
        return np.asarray(self.which[found])

    def set_pairing(self, pairs: Sequence[Pair]) -> None:
        """Take masters and weights of pairs, the same slave nodes and masters among the nodes.

        :meth:`set_ties` must follow.
        """
        n, row, column, weight = len(self.nodes), [], [], []
        self.paired = np.ones(self.n_rows, dtype=bool)
        self._partner: Ints | None = None
        for pair, rows in zip(pairs, self.row_of, strict=True):
            has = rows >= 0
            self.paired[rows[has]] = pair.paired[has]
            weights, masters = pair.weights[has], self.nodes.find(pair.masters[has])
            row.append(np.repeat(rows[has], weights.shape[1]))
            column.append(masters.ravel())
            weight.append(weights.ravel())
        self.weights = sp.csr_matrix(
            (np.concatenate([np.zeros(0), *weight]), (_joined(row), _joined(column))),
            shape=(self.n_rows, n),
        )
        self.weights.eliminate_zeros()
        self.weights.sort_indices()
        single = bool(np.all(np.diff(self.weights.indptr) == 1))
        self.master = self.weights.indices.astype(np.int64) if single else None
        self.depth = self._depths()
        self.simple = (
            self.master is not None
            and len(np.unique(self.master)) == self.n_rows
            and not self.depth.any()
            and self.constraints is None
        )

    def _depths(self) -> Ints:
        """How many slaves stand between each row and nodes that are no slaves, shape (n_rows,)."""
        row_at = np.full(len(self.nodes), -1, dtype=np.int64)
        row_at[self.slave] = np.arange(self.n_rows)
        rows = np.repeat(np.arange(self.n_rows), np.diff(self.weights.indptr))
        below = row_at[self.weights.indices]
        rows, below = rows[below >= 0], below[below >= 0]
        refuse_masters_that_slip(self._slips, below)
        depth = np.zeros(self.n_rows, dtype=np.int64)
        for _ in range(self.n_rows + 1):
            deeper = depth.copy()
            np.maximum.at(deeper, rows, depth[below] + 1)
            if np.array_equal(deeper, depth):
                return depth
            depth = deeper
        raise InterfaceError(
            "interfaces form a cycle: a slave node is master of a node that is in turn its master; "
            "exchange slave and master of one of them"
        )

    # -- ties ----------------------------------------------------------------------------

    def set_ties(self, tied: Bools) -> None:
        """Tie some rows, shape (n_rows,), and leave the others open."""
        self.tied, self.open = tied.copy(), np.flatnonzero(~tied)
        self._ties = [
            self._tie(np.flatnonzero(tied & ~self._slips & (self.depth == d)))
            for d in range(int(self.depth.max(initial=0)), -1, -1)
        ]
        self._ties = [t for t in self._ties if len(t.rows)]
        rows = np.flatnonzero(tied & self._slips)
        self._slipping = SlippingTies(rows, self.slave[rows], self.frames[rows][:, :, 0])
        self.group_mass = self.collect(self.mass[:, None].copy())[:, 0]
        self.inverse = np.where(self.which < 0, 1.0 / self.group_mass[:, None], 0.0)
        self.version += 1
        self._following: sp.csr_matrix | None = None
        self._open_slaves = self.slave[self.open]
        self.separate = True
        if self.simple:
            assert self.master is not None
            self._open_masters = self.master[self.open]
            both = self.inverse[self._open_slaves] + self.inverse[self._open_masters]
            self.compliance = self.reach = np.asarray(both)
            self._accelerate_pairs()
            return
        self._jump = self.separations(self.open)
        self._jump_t = self._jump.T.tocsr()
        following = self.following
        if self.constraints is not None:
            self._accelerate_sets(self.constraints)
            return
        self.accelerations = Product(following @ sp.diags(self.inverse.ravel()) @ following.T)
        self._root = sp.csr_matrix(self._jump @ self._motion())
        self._root_t = self._root.T.tocsr()
        self.compliance = np.asarray(self._root.multiply(self._root) @ self.inverse)
        self._root.eliminate_zeros()
        if np.bincount(self._root.indices).max(initial=0) <= 1:
            self.reach = self.compliance
            return
        self.separate = False
        size = abs(self._root)
        loose = self.inverse.max(axis=1, initial=0.0)  # forces of any direction, unlike supports
        sums = size @ (loose * (size.T @ np.ones(len(self.open))))
        self.reach = np.repeat(np.asarray(sums)[:, None], self.which.shape[1], axis=1)

    def _accelerate_sets(self, constraints: LumpedConstraints) -> None:
        """Accelerations and compliances where couplings and equations move some components."""
        gdim = self.which.shape[1]
        mass, free = np.repeat(self.group_mass, gdim), (self.which < 0).ravel()
        inverse = constraints.inverse(mass, free)
        self._of_sets = SetAccelerations(constraints.motion, inverse)
        motion = sp.csr_matrix(self.following @ constraints.motion)
        self.accelerations = sets = SetAccelerations(motion, inverse)
        jumps = by_component(self._jump, gdim)
        self.compliance = self.reach = sets.diagonal_of(jumps).reshape(-1, gdim)
        root = sp.csr_matrix(jumps @ motion)
        root.eliminate_zeros()
        if np.bincount(root.indices).max(initial=0) <= 1 and not sets.moves_sets(jumps):
            return
        self.separate = False
        reach = sets.bound_of(jumps).reshape(-1, gdim).max(axis=1, initial=0.0)
        self.reach = np.repeat(reach[:, None], gdim, axis=1)

    def given_motion(self, components: Ints) -> sp.csr_matrix:
        """What couplings and equations make of given motions, before slaves follow.

        Args:
            components: Components of the nodes whose motion is given, shape (m,).

        Returns:
            Shape (n_nodes gdim, m + n_motions), the motions of references last.
        """
        one = sp.identity(self.which.size, format="csc")
        if self.constraints is None:
            return sp.csr_matrix(one[:, components])
        given = self.constraints.motion[:, components]
        return sp.csr_matrix(sp.hstack([given, self.constraints.shares], format="csr"))

    def given_accelerations(self, components: Ints) -> sp.csr_matrix:
        """Accelerations of the nodes by given ones; arguments as for :meth:`given_motion`."""
        given = self.given_motion(components)
        if self.constraints is not None:
            # what else belongs to a set moves as well, as its masses are connected
            mass = sp.diags(np.repeat(self.group_mass, self.which.shape[1]))
            given = given - self._of_sets.times(sp.csr_matrix(mass @ given))
        return sp.csr_matrix(self.following @ given)

    def _accelerate_pairs(self) -> None:
        """Accelerations where every slave has one master of its own: both of a tied pair share."""
        n, gdim = self.which.shape
        if self._partner is None:
            assert self.master is not None
            self._partner = np.arange(n)
            self._partner[self.slave], self._partner[self.master] = self.master, self.slave
            nodes = np.column_stack([np.arange(n), self._partner])[:, None, :]
            columns = gdim * nodes + np.arange(gdim)[None, :, None]
            self._shares = np.zeros((n, gdim, 2))
            self.accelerations = Product.of_rows(
                columns.reshape(-1, 2), self._shares.reshape(-1, 2), n * gdim
            )
            self._shares = self.accelerations.data.reshape(n, gdim, 2)
        shares = self._shares
        shares[:, :, 0], shares[:, :, 1] = self.inverse, 0.0
        s = self.slave[self.tied]
        m = self._partner[s]
        shared = self.inverse[m]
        shares[s, :, 0] = shares[s, :, 1] = shares[m, :, 1] = shared

    @property
    def following(self) -> sp.csr_matrix:
        """Motion of the nodes by that of those that follow nothing, on components, square."""
        if self._following is None:
            following = by_component(self._motion(), self.which.shape[1])
            if len(self._slipping):
                following = self._slipping.projection(len(self.nodes)) @ following
            self._following = sp.csr_matrix(following)
        return self._following

    def _tie(self, rows: Ints) -> _Tie:
        if self.simple:
            assert self.master is not None
            return _Tie(rows, self.slave[rows], self.master[rows], None)
        weights = self.weights[rows]
        return _Tie(rows, self.slave[rows], None, (weights, weights.T.tocsr()))

    def _motion(self) -> sp.csr_matrix:
        """T, motion of all nodes by that of those that follow nothing, (n_nodes, n_nodes)."""
        n = len(self.nodes)
        if self.simple:
            assert self.master is not None
            leads = np.arange(n)
            leads[self.slave[self.tied]] = self.master[self.tied]
            return sp.csr_matrix((np.ones(n), leads, np.arange(n + 1)), shape=(n, n))
        keep = np.ones(n)
        keep[self.slave[self.tied & ~self._slips]] = 0.0
        out = sp.csr_matrix(sp.diags(keep))
        for tie in reversed(self._ties):
            m = len(tie.rows)
            place = sp.csr_matrix((np.ones(m), (tie.slaves, np.arange(m))), shape=(n, m))
            out = out + place @ (self.weights[tie.rows] @ out)
        return sp.csr_matrix(out)

    def collected(self) -> sp.csr_matrix:
        """What :meth:`collect` does to the values of the nodes, as a matrix (n_nodes, n_nodes)."""
        out = sp.identity(len(self.nodes), format="csr")
        for tie in self._ties:
            out = out + self.weights[tie.rows].T @ out[tie.slaves]
        return sp.csr_matrix(out)

    # -- motion and forces of the nodes --------------------------------------------------

    def collect(self, values: Array) -> Array:
        """Add to the masters what tied slaves give them, in place.

        Args:
            values: Forces or masses of the nodes, shape (n_nodes, k); slaves keep what they had
                with what their own slaves gave them.
        """
        for tie in self._ties:
            if tie.masters is not None:
                values[tie.masters] += values[tie.slaves]
            elif tie.weights is not None:
                values += tie.weights[1] @ values[tie.slaves]
        return values

    def follow(self, values: Array) -> Array:
        """Let tied slaves follow their masters, in place; motion of the nodes, (n_nodes, gdim)."""
        for tie in reversed(self._ties):
            if tie.masters is not None:
                values[tie.slaves] = values[tie.masters]
            elif tie.weights is not None:
                values[tie.slaves] = tie.weights[0] @ values
        if len(self._slipping):
            self._slipping.follow(values)
        return values

    def bond_forces(self, acceleration: Array, total: Array) -> tuple[Ints, Array]:
        """Bond forces on the slaves of the tied rows.

        Args:
            acceleration: Of the nodes, after :meth:`follow`, shape (n_nodes, gdim).
            total: Forces on the nodes, after :meth:`collect`, same shape.

        Returns:
            The rows, and p, shape (n_tied, gdim), force.
        """
        rows, forces = [], []
        for tie in self._ties:
            s = tie.slaves
            rows.append(tie.rows)
            forces.append(self.group_mass[s, None] * acceleration[s] - total[s])
        if len(self._slipping):
            s = self._slipping.slaves
            held = self.group_mass[s, None] * acceleration[s] - total[s]
            rows.append(self._slipping.rows)
            forces.append(self._slipping.along_normals(held))
        if len(rows) == 1:
            return rows[0], forces[0]
        return _joined(rows), _stacked_vectors(forces, acceleration.shape[1])

    def excess_energy(self, velocity: Array) -> float:
        """Kinetic energy that row sums of tied masses hold beyond that of the nodes.

        Args:
            velocity: Of the nodes, shape (n_nodes, gdim), length/time.
        """
        if self.simple:
            return 0.0
        square = (velocity**2).sum(axis=1)
        slaves = self.slave[self.tied & ~self._slips]
        root = np.ones(len(self.nodes), dtype=bool)
        root[slaves] = False
        more = float((self.group_mass - self.mass)[root] @ square[root])
        return 0.5 * (more - float(self.mass[slaves] @ square[slaves]))

    # -- open rows -----------------------------------------------------------------------

    def separations(self, rows: Ints) -> sp.csr_matrix:
        """E_s - W of some rows, on nodes: jumps by the motion of the nodes, (n, n_nodes)."""
        m, n = len(rows), len(self.nodes)
        picks = sp.csr_matrix((np.ones(m), (np.arange(m), self.slave[rows])), shape=(m, n))
        return sp.csr_matrix(picks - self.weights[rows])

    def jumps(self, values: Array) -> Array:
        """Jumps of the open rows in a motion of the nodes, shape (n_open, gdim)."""
        if self.simple:
            return np.asarray(values[self._open_slaves] - values[self._open_masters])
        return np.asarray(self._jump @ values)

    def on_nodes(self, forces: Array) -> Array:
        """Forces on the slave side of the open rows and their reactions, shape (n_nodes, gdim).

        Args:
            forces: Shape (n_open, gdim).
        """
        if not self.simple:
            return np.asarray(self._jump_t @ forces)
        out = np.zeros((len(self.nodes), forces.shape[1]))
        out[self._open_slaves] = forces
        out[self._open_masters] = -forces
        return out

    def response(self, forces: Array) -> Array:
        """Acceleration of the open jumps by forces on all of them, shape (n_open, gdim)."""
        if self.simple:
            return np.asarray(self.compliance * forces)
        if self.constraints is not None:
            moved = self.accelerations(self.on_nodes(forces).ravel())
            return self.jumps(moved.reshape(self.which.shape))
        return np.asarray(self._root @ (self.inverse * (self._root_t @ forces)))


def _joined(parts: Sequence[Any]) -> Ints:
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts]).astype(np.int64)


def _stacked(parts: Sequence[Any], tail: tuple[int, ...], kind: Any = float) -> Any:
    return np.concatenate([np.zeros((0, *tail), dtype=kind), *parts])


def _stacked_vectors(parts: Sequence[Array], gdim: int) -> Array:
    return np.concatenate([np.zeros((0, gdim)), *parts])


__all__ = ["LumpedInterface"]
