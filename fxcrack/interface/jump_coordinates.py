"""Jump coordinates: the transformation u = T q from jumps of slave nodes to displacements.

A slave node s lies on a facet of the master surface with the shape functions W (they sum to 1),
and R = [n t1 t2] is its local frame (columns; n points from master to slave):

    u_s = sum_m W_sm u_m + R_s delta_s,    delta = (opening, slip, tear)

Every other dof keeps its own displacement. So u = T q with T square, invertible and sparse, and
constant while slave nodes keep their master points (small sliding). On matching meshes the only
weight is 1. In these coordinates residual and stiffness are

    r_q = T^t r_u,    A = T^t K T

and the states of an interface are statements about single coordinates:

* bonded: delta = 0, and its row of r_q is the force of the bond on the slave node in the local
  frame, without penalty, multiplier or recovery; bonded in the normal direction only: delta_n = 0;
* released: delta is free and its force is zero, or prescribed while a release ramp lasts;
* in contact: delta_n >= 0, p_n >= 0, delta_n p_n = 0, with friction |p_t| <= mu p_n.

T stays as it is when nodes are released, and slave and master may belong to different ranks.

Nodes at which shells meet in a kink or a T joint follow each other as
:mod:`fxcrack.continuum.shell_joints` says; they have no jump.

Where the unknowns of a node are more than its displacement (shells), u_s and u_m above are those of
points on the bonded faces, u_point = P q_node with P = [1 Z] (:mod:`fxcrack.continuum.dof_layout`).
Solved for the displacement of the slave node, a row of T holds a small block for each master,

    u_s = sum_m W_sm P_m q_m - Z_s w_s + R_s delta_s

and the slave's further unknowns w_s keep columns of their own.

Rules, each with an error on all ranks together: a node is a slave once only; a slave may be a
master of another interface (such chains are composed) but not, over any number of interfaces, of
itself; a bonded slave node projects onto the master surface within the search tolerance
(:mod:`fxcrack.interface.pairing`); where a support holds a displacement component of a bonded
slave node, it holds its masters in the same way. The frame's tangent then lies along that
component, and this jump is held at zero and carries no bond force
(:mod:`fxcrack.interface.supported_slaves`).

Columns of T, in this order on each rank:

* inner coordinates: free displacements, and free jumps that are not retained;
* on rank 0 only, last: retained jumps, one column per prescribed displacement component
  (u = d times its shape), and empty columns for the borders of force patterns and monitors.

A fixed jump has no column: it is zero. Where a bond has a spring of its own, a fixed or retained
jump has an inner coordinate beside it, the elongation e of the spring
(:mod:`fxcrack.interface.bond_springs`): R (e + delta) in place of R delta. T has more columns than
rows then.

Unknowns that all nodes share (the strain out of the plane of generalised plane strain) have one
inner column together, with ones in the rows of their dofs.

Dofs that follow others by couplings and equations (:mod:`fxcrack.interface.following`) have no
column of their own but rows of T with the columns of what they follow. The jump of a slave node
among them is zero where it is bonded and its masters belong to the same rigid set, and is given up
where it is open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.interface.bond_springs import Springs, assembled_springs
from fxcrack.interface.constrained_slaves import drop_constrained
from fxcrack.interface.follower_rows import Link, constraint_rows, interface_rows
from fxcrack.interface.joints import joint_terms
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair
from fxcrack.interface.shared_unknowns import SharedUnknowns
from fxcrack.interface.supported_slaves import align_frames, check_slaves
from fxcrack.interface.supports import Supports

_NONE = np.zeros(1)
"""Value of a component that has no number."""

FIXED, FREE, RETAINED = 0, 1, 2
"""Roles of a jump component: always zero, free in the continuum, or retained."""


@dataclass
class JumpCoordinates:
    """The transformation T and the numbering of its columns.

    Attributes:
        transform: T, PETSc AIJ, shape (n_global, n_coordinates).
        sparse: T without the columns of unknowns that all nodes share; T itself without them.
        shared: Columns of these, shape (n_shared,).
        frames: Frame of each slave node per pair, aligned with supports, (n_nodes, gdim, gdim).
        held: Jump components that supports hold at zero, per pair, shape (n_nodes, gdim).
        index: Number among the retained jumps of each jump component per pair, -1 where it is not
            retained, shape (n_nodes, gdim).
        n_retained: Number of retained jumps.
        n_supports: Number of support columns, which follow the retained jumps.
        n_borders: Number of empty columns, which come last.
        n_inner: Inner coordinates of this rank.
        first: Global number of the first retained column.
        inner_dofs: Owned dof each inner coordinate belongs to, ascending; a free jump takes the
            place of its slave node's component, and so does an elongation, shape (n_inner,).
        springs: Springs of bonds, of this rank's elongations, per pair that has some.
    """

    transform: PETSc.Mat
    sparse: PETSc.Mat
    shared: Ints
    frames: list[Array]
    held: list[Bools]
    index: list[Ints]
    n_retained: int
    n_supports: int
    n_borders: int
    n_inner: int
    first: int
    inner_dofs: Ints
    springs: tuple[Springs, ...] = ()

    @property
    def n_last(self) -> int:
        """Retained, support and border columns together."""
        return self.n_retained + self.n_supports + self.n_borders

    def destroy(self) -> None:
        """Free the matrices; collective."""
        self.transform.destroy()
        if self.sparse is not self.transform:
            self.sparse.destroy()


def global_vectors(index: Ints, frames: Array, values: Array) -> Array:
    """Jump or force components at slave nodes as global vectors.

    Args:
        index: Number of each component, -1 where it has none, shape (..., gdim).
        frames: Frames of the nodes, shape (..., gdim, gdim).
        values: Values of the numbered components, shape (n,).

    Returns:
        Shape (..., 3); zero where a component has no number.
    """
    local = np.concatenate((values, _NONE))[index]  # the last one where the index is -1
    out = np.zeros((*index.shape[:-1], 3))
    out[..., : index.shape[-1]] = np.einsum("...ck,...k->...c", frames, local)
    return out


def build_coordinates(
    layout: DofLayout,
    pairs: Sequence[Pair],
    roles: Sequence[npt.NDArray[np.int8]],
    supports: Supports,
    n_borders: int,
    springs: Sequence[Array | None] = (),
) -> JumpCoordinates:
    """Number the coordinates and build T; collective.

    Args:
        layout: Unknowns of nodes and their numbers.
        pairs: Interfaces.
        roles: FIXED, FREE or RETAINED per pair and jump component, shape (n_nodes, gdim).
        supports: Prescribed components.
        n_borders: Empty columns to append.
        springs: Stiffness of the bonds in global axes per pair, shape (n_nodes, gdim, gdim),
            force/length, or ``None`` where they are exact; exact everywhere by default.

    Raises:
        InterfaceError: A slave used twice, a cycle of slaves and masters, a support on a slave
            node that its masters do not share.
    """
    gdim = layout.gdim
    # a node whose jump is free and of no interest keeps its own displacement
    jumped = [p.paired & (r != FREE).any(axis=1) for p, r in zip(pairs, roles, strict=True)]
    for pair, has_jump in zip(pairs, jumped, strict=True):
        if pair.hierarchy is not None:
            # loads on open faces belong to the corners as well, so that theirs are those of hats
            pair.hierarchy.link(has_jump)
    nodes = InterfaceNodes.of_pairs(layout, pairs, jumped=jumped, further=layout.joints.nodes)
    which, value = supports.at_nodes(nodes)
    check_slaves(pairs, jumped, nodes, which, value, supports)
    rigid = drop_constrained(pairs, jumped, supports.following, layout)
    slaves = {
        int(dof): (pair.title, x)
        for pair, j in zip(pairs, jumped, strict=True)
        for dof, x in zip(pair.surface.dofs[j], pair.surface.x[j], strict=True)
        if len(layout.joints.nodes)
    }
    joined, *joint_entries = joint_terms(layout.joints, nodes, which, slaves)
    links = [
        Link(pair, np.flatnonzero(j), nodes.find(pair.surface.dofs[j]))
        for pair, j in zip(pairs, jumped, strict=True)
    ]

    prescribed = []
    for link in links:
        rows = np.full((link.pair.surface.n_nodes, gdim), -1, dtype=np.int64)
        rows[link.slaves] = which[link.nodes, :gdim]
        prescribed.append(rows)
    frames, held = align_frames(pairs, prescribed, jumped, supports, gdim)
    held = [h | r[:, None] for h, r in zip(held, rigid, strict=True)]
    springs = list(springs) or [None] * len(pairs)
    elastic = [
        (r != FREE) & ~h & j[:, None] & (k is not None)
        for r, h, j, k in zip(roles, held, jumped, springs, strict=True)
    ]
    roles = [
        np.where(h | ~j[:, None], FIXED, r) for r, h, j in zip(roles, held, jumped, strict=True)
    ]

    # which owned dofs have a column of their own
    own = np.asarray(supports.which < 0)
    following = supports.following
    constrained: Ints = np.zeros(0, dtype=np.int64)
    if following is not None:
        constrained = following.mine(layout)[1]
        own[constrained] = False
    follows = joined  # other dofs, by T
    free_jump = np.zeros_like(follows)
    for link, role, sprung in zip(links, roles, elastic, strict=True):
        follows[link.nodes, :gdim] = True
        free_jump[link.nodes, :gdim] = ((role == FREE) | sprung)[link.slaves]
    shared = SharedUnknowns(layout, supports)
    shared.keep_one(own)
    local = layout.dofs(nodes.local)
    follows_here = follows[nodes.mine]
    own[local[follows_here]] = free_jump[nodes.mine][follows_here]

    index, n_retained = _number_retained(roles)
    n_supports = len(supports.columns)
    column, first, size = _number_columns(layout, own, n_retained + n_supports + n_borders)
    n_inner, n_columns = int(own.sum()), size[1]
    at_shared = shared.spread(column, first + n_retained)

    composed: tuple[Ints, sp.csr_matrix] | None = None
    if following is not None:
        their = constraint_rows(following, layout, supports, column, first + n_retained, n_columns)
        composed = following.dofs, their
    rows = interface_rows(
        nodes,
        links,
        frames,
        [np.where(number < 0, -1, first + number) for number in index],
        follows,
        nodes.share(column[local]),
        np.where(which < 0, -1, first + n_retained + which),
        value,
        n_columns,
        joint_entries,
        composed,
    )
    mine = layout.dofs(np.arange(len(nodes))[nodes.mine])
    followers, of_followers = local[follows_here], rows[mine[follows_here]]
    if following is not None and composed is not None:
        followers = np.concatenate([followers, constrained])
        of_followers = sp.vstack(
            [of_followers, composed[1][following.mine(layout)[0]]], format="csr"
        )
    single = (supports.which >= 0) | (column >= 0)
    single[followers] = False
    given = layout, supports, column, followers, of_followers, first + n_retained, size
    transform = _assemble(single, *given)
    sparse = transform
    if layout.shared:
        sparse = _assemble(shared.without(single), *given)
    return JumpCoordinates(
        transform, sparse, at_shared, frames, held, index, n_retained, n_supports, n_borders,
        n_inner, first, np.flatnonzero(own),
        _springs(layout, nodes, links, frames, springs, elastic, column),
    )  # fmt: skip


def _number_retained(roles: Sequence[npt.NDArray[np.int8]]) -> tuple[list[Ints], int]:
    """Numbers of the retained jumps and how many there are.

    Args:
        roles: FIXED, FREE or RETAINED per pair and jump component, shape (n_nodes, gdim).

    Returns:
        Per pair the number of each component, -1 where it is not retained, shape (n_nodes, gdim);
        their sum.
    """
    index, n_retained = [], 0
    for role in roles:
        number = np.full(role.shape, -1, dtype=np.int64)
        inside = role == RETAINED
        number[inside] = n_retained + np.arange(int(inside.sum()))
        n_retained += int(inside.sum())
        index.append(number)
    return index, n_retained


def _number_columns(
    layout: DofLayout, own: Bools, n_last: int
) -> tuple[Ints, int, tuple[int, int]]:
    """Number the columns of T: those of dofs rank by rank, the last ones behind those of rank 0.

    Collective.

    Args:
        layout: Unknowns of nodes and their numbers.
        own: Whether each owned dof has a column of its own, shape (n_local,).
        n_last: Columns of no dof.

    Returns:
        Column of each owned dof, -1 where it has none, shape (n_local,); the first one of no dof;
        columns on this rank and in all.
    """
    comm, n_inner = layout.comm, int(own.sum())
    counts = np.zeros(comm.size, dtype=np.int64)
    comm.Allgather(np.array([n_inner], dtype=np.int64), counts)
    start = int(counts[: comm.rank].sum()) + (n_last if comm.rank > 0 else 0)
    column = np.full(layout.n_local, -1, dtype=np.int64)
    column[own] = start + np.arange(n_inner)
    here = n_inner + (n_last if comm.rank == 0 else 0)
    return column, int(counts[0]), (here, int(counts.sum()) + n_last)


def _springs(
    layout: DofLayout,
    nodes: InterfaceNodes,
    links: Sequence[Link],
    frames: Sequence[Array],
    springs: Sequence[Array | None],
    elastic: Sequence[Bools],
    column: Ints,
) -> tuple[Springs, ...]:
    """Springs of the bonds whose elongations are coordinates of this rank.

    Args:
        layout: Unknowns of nodes and their numbers.
        nodes: The interface nodes.
        links: Slave nodes that have a jump, per pair.
        frames: Frames of slave nodes per pair, shape (n_nodes, gdim, gdim).
        springs: Stiffness in global axes per pair, shape (n_nodes, gdim, gdim), or ``None``.
        elastic: Components that have an elongation per pair, shape (n_nodes, gdim).
        column: Column of each owned dof's own, shape (n_local,).
    """
    out = []
    for link, frame, stiffness, sprung in zip(links, frames, springs, elastic, strict=True):
        if stiffness is None:
            continue
        dofs = nodes.nodes[link.nodes]
        k = link.slaves[layout.is_owned(dofs)]
        local = layout.dofs(layout.to_local(dofs[layout.is_owned(dofs)]))[:, : layout.gdim]
        own = np.where(sprung[k], column[local], -1)
        out.append(assembled_springs(stiffness[k], frame[k], own))
    return tuple(out)


def _assemble(
    single: Bools,
    layout: DofLayout,
    supports: Supports,
    column: Ints,
    followers: Ints,
    rows: sp.csr_matrix,
    support_column: int,
    size: tuple[int, int],
) -> PETSc.Mat:
    """T from the single-entry rows of ordinary dofs and the rows of dofs that follow others.

    Args:
        single: Owned dofs that have a single entry, shape (n_local,); others that follow none have
            an empty row.
        layout: Unknowns of nodes and their numbers.
        supports: Prescribed components.
        column: Column of each owned dof's own, -1 where it has none, shape (n_local,).
        followers: Owned dofs that follow others, shape (n_followers,).
        rows: Their rows, shape (n_followers, n_columns).
        support_column: First column of the supports.
        size: Columns that this rank owns, and all columns.
    """
    r = np.flatnonzero(single)
    held = supports.which[r] >= 0
    c = np.where(held, support_column + supports.which[r], column[r])
    v = np.where(held, supports.value[r], 1.0)
    block = rows.tocoo()
    csr = sp.csr_matrix(
        (
            np.concatenate([v, block.data]),
            (np.concatenate([r, followers[block.row]]), np.concatenate([c, block.col])),
        ),
        shape=(layout.n_local, size[1]),
    )
    csr.sort_indices()
    transform = PETSc.Mat().createAIJ(
        ((layout.n_local, layout.n_global), size),
        csr=(
            csr.indptr.astype(PETSc.IntType),
            csr.indices.astype(PETSc.IntType),
            csr.data.astype(PETSc.ScalarType),
        ),
        comm=layout.comm,
    )
    transform.assemble()
    return transform
