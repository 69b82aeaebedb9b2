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
(:mod:`fxcrack.interface.supports`).

Columns of T, in this order on each rank:

* inner coordinates: free displacements, and free jumps that are not retained;
* on rank 0 only, last: retained jumps, one column per prescribed displacement component
  (u = d times its shape), and empty columns for the borders of force patterns and monitors.

A fixed jump has no column: it is zero. Where a bond has a spring of its own, a fixed or retained
jump has an inner coordinate beside it, the elongation e of the spring
(:mod:`fxcrack.interface.bond_springs`): R (e + delta) in place of R delta. T has more columns than
rows then.

Dofs that follow others by couplings and equations (:mod:`fxcrack.interface.following`) have no
column of their own but rows of T with the columns of what they follow. The jump of a slave node
among them is zero where it is bonded and its masters belong to the same rigid set, and is given up
where it is open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import InterfaceError
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.interface.bond_springs import Springs, assembled_springs
from fxcrack.interface.constrained_slaves import drop_constrained
from fxcrack.interface.following import Following
from fxcrack.interface.hierarchy import links_in_chain
from fxcrack.interface.joints import joint_terms
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports, align_frames, check_slaves

FIXED, FREE, RETAINED = 0, 1, 2
"""Roles of a jump component: always zero, free in the continuum, or retained."""


@dataclass
class JumpCoordinates:
    """The transformation T and the numbering of its columns.

    Attributes:
        transform: T, PETSc AIJ, shape (n_global, n_coordinates).
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


def global_vectors(index: Ints, frames: Array, values: Array) -> Array:
    """Jump or force components at slave nodes as global vectors.

    Args:
        index: Number of each component, -1 where it has none, shape (..., gdim).
        frames: Frames of the nodes, shape (..., gdim, gdim).
        values: Values of the numbered components, shape (n,).

    Returns:
        Shape (..., 3); zero where a component has no number.
    """
    local = np.append(values, 0.0)[index]  # the last one where the index is -1
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
    gdim, comm = layout.gdim, layout.comm
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
        _Link(pair, np.flatnonzero(j), nodes.find(pair.surface.dofs[j]))
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
    for link, role, yields in zip(links, roles, elastic, strict=True):
        follows[link.nodes, :gdim] = True
        free_jump[link.nodes, :gdim] = ((role == FREE) | yields)[link.slaves]
    local = layout.dofs(nodes.local)
    follows_here = follows[nodes.mine]
    own[local[follows_here]] = free_jump[nodes.mine][follows_here]

    index, n_retained = [], 0
    for role in roles:
        number = np.full(role.shape, -1, dtype=np.int64)
        inside = role == RETAINED
        number[inside] = n_retained + np.arange(int(inside.sum()))
        n_retained += int(inside.sum())
        index.append(number)
    n_supports = len(supports.columns)
    n_inner = int(own.sum())
    counts = np.zeros(comm.size, dtype=np.int64)
    comm.Allgather(np.array([n_inner], dtype=np.int64), counts)
    extra = n_retained + n_supports + n_borders
    first = int(counts[0])
    start = int(counts[: comm.rank].sum()) + (extra if comm.rank > 0 else 0)
    n_columns = int(counts.sum()) + extra
    column = np.full(layout.n_local, -1, dtype=np.int64)
    column[own] = start + np.arange(n_inner)

    composed: tuple[Ints, sp.csr_matrix] | None = None
    if following is not None:
        their = _constraint_rows(following, layout, supports, column, first + n_retained, n_columns)
        composed = following.dofs, their
    rows = _interface_rows(
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
    transform = _assemble(
        layout, supports, column, followers, of_followers, first + n_retained,
        (n_inner + (extra if comm.rank == 0 else 0), n_columns),
    )  # fmt: skip
    return JumpCoordinates(
        transform, frames, held, index, n_retained, n_supports, n_borders, n_inner, first,
        np.flatnonzero(own),
        _springs(layout, nodes, links, frames, springs, elastic, column),
    )  # fmt: skip


def _springs(
    layout: DofLayout,
    nodes: InterfaceNodes,
    links: Sequence[_Link],
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
    for link, frame, stiffness, yields in zip(links, frames, springs, elastic, strict=True):
        if stiffness is None:
            continue
        dofs = nodes.nodes[link.nodes]
        k = link.slaves[layout.is_owned(dofs)]
        local = layout.dofs(layout.to_local(dofs[layout.is_owned(dofs)]))[:, : layout.gdim]
        own = np.where(yields[k], column[local], -1)
        out.append(assembled_springs(stiffness[k], frame[k], own))
    return tuple(out)


@dataclass(frozen=True)
class _Link:
    """Slave nodes of a pair that have a jump.

    Attributes:
        pair: The pair.
        slaves: Which of its slave nodes, shape (n,).
        nodes: Their rows among the interface nodes, shape (n,).
    """

    pair: Pair
    slaves: Ints
    nodes: Ints


def _interface_rows(
    nodes: InterfaceNodes,
    links: Sequence[_Link],
    frames: Sequence[Array],
    retained: Sequence[Ints],
    follows: Bools,
    column: Ints,
    support: Ints,
    value: Array,
    n_columns: int,
    joined: Sequence[Any],
    constrained: tuple[Ints, sp.csr_matrix] | None,
) -> sp.csr_matrix:
    """Rows of T for the dofs of all interface nodes, chains composed.

    Args:
        nodes: The interface nodes.
        links: Slave nodes that have a jump, per pair.
        frames: Frames of slave nodes per pair, shape (n_nodes, gdim, gdim).
        retained: Columns of retained jumps per pair, -1 for others, shape (n_nodes, gdim).
        follows: Dofs that follow other dofs, shape (n_interface_nodes, n_unknowns).
        column: Columns of the dofs' own, -1 where they have none, same shape.
        support: Columns of the supports that prescribe dofs, -1 where none does, same shape.
        value: Entries of these columns, same shape.
        n_columns: Columns of T.
        joined: Rows, columns and entries of what the nodes of joints follow.
        constrained: Global dofs that follow by couplings and equations, ascending, and their rows.

    Returns:
        Shape (n_unknowns n_interface_nodes, n_columns).

    Raises:
        InterfaceError: Slaves and masters form a cycle.
    """
    layout = nodes.layout
    n = layout.n_unknowns * len(nodes)
    follows_flat, own, prescribed = follows.ravel(), column.ravel(), support.ravel()
    rows = np.flatnonzero(~follows_flat & (own >= 0))
    # a supported component of a slave moves like its masters', but its reaction is its own
    held = np.flatnonzero(prescribed >= 0)
    entries = [(rows, own[rows], np.ones(len(rows))), (held, prescribed[held], value.ravel()[held])]
    if constrained is not None and len(constrained[0]):
        dofs, its_rows = constrained
        here = layout.dofs(nodes.nodes).ravel()
        at = np.minimum(np.searchsorted(dofs, here), len(dofs) - 1)
        inside = np.flatnonzero(dofs[at] == here)
        block = its_rows[at[inside]].tocoo()
        entries.append((inside[block.row], block.col, block.data))
    followed: list[tuple[Ints, Ints, Array]] = []
    if len(joined[0]):
        followed.append((joined[0], joined[1], joined[2]))
    for link, frame, jumps in zip(links, frames, retained, strict=True):
        k, s = link.slaves, link.nodes
        followed += _followed_unknowns(nodes, link, support[s] < 0)
        for j in range(layout.gdim):
            for target in (jumps[k, j], column[s, j]):  # both: a retained jump and its elongation
                has = target >= 0
                for c in range(layout.gdim):
                    entries.append((layout.dof(s[has], c), target[has], frame[k, c, j][has]))

    def matrix(parts: list[tuple[Ints, Ints, Array]], width: int) -> sp.csr_matrix:
        r, c, v = (np.concatenate(p) for p in zip(*parts, strict=True))
        keep = v != 0.0
        return sp.csr_matrix((v[keep], (r[keep], c[keep])), shape=(n, width))

    base = matrix(entries, n_columns)
    if not followed:
        return base
    chain = matrix(followed, n)
    inside = chain[follows_flat][:, follows_flat]
    groups, _ = connected_components(inside, directed=True, connection="strong")
    if groups < inside.shape[0] or inside.diagonal().any():
        names = ", ".join(f"'{link.pair.title}'" for link in links)
        raise InterfaceError(
            f"interfaces {names} form a cycle: a slave node is master of a node that is in turn "
            "its master; exchange slave and master of one of them, or make one interface of "
            "surfaces that continue each other, mesh.joined('whole', ['first', 'second'])"
        )
    composed = base
    longest = links_in_chain(link.pair.hierarchy for link in links)
    for _ in range(longest if not len(joined[0]) else 2 * longest + 1):
        composed = base + chain @ composed
    return sp.csr_matrix(composed)


def _constraint_rows(
    following: Following,
    layout: DofLayout,
    supports: Supports,
    column: Ints,
    support_column: int,
    n_columns: int,
) -> sp.csr_matrix:
    """Rows of T of all dofs that follow by couplings and equations; collective.

    Args:
        following: These dofs.
        layout: Unknowns of nodes and their numbers.
        supports: Prescribed components.
        column: Column of each owned dof's own, -1 where it has none, shape (n_local,).
        support_column: First column of the supports.
        n_columns: Columns of T.

    Returns:
        Shape (n_following, n_columns), the same on every rank.
    """
    held = supports.which >= 0
    columns = np.where(held, support_column + supports.which, column)
    entries = np.where(held, supports.value, 1.0)
    pairs = following.share_masters(layout, np.column_stack([columns.astype(float), entries]))
    target = pairs[:, 0].astype(np.int64)  # a double holds whole numbers up to 2^53
    rows = np.arange(len(target))
    to_columns = sp.csr_matrix((pairs[:, 1], (rows, target)), shape=(len(target), n_columns))
    first = support_column + len(supports.columns) - supports.n_motions
    spread = sp.csr_matrix(
        (np.ones(supports.n_motions), (np.arange(supports.n_motions),
                                       first + np.arange(supports.n_motions))),
        shape=(supports.n_motions, n_columns),
    )  # fmt: skip
    return sp.csr_matrix(following.matrix @ to_columns + following.prescribed @ spread)


def _followed_unknowns(
    nodes: InterfaceNodes, link: _Link, free: Bools
) -> list[tuple[Ints, Ints, Array]]:
    """Blocks W P_m of the masters and -Z_s of the slaves themselves, as rows, columns, entries.

    Args:
        nodes: The interface nodes, in whose order rows and columns are numbered.
        link: Slave nodes of a pair.
        free: Their unknowns that no support prescribes, shape (n, n_unknowns).
    """
    layout, pair, k = nodes.layout, link.pair, link.slaves
    masters, slave_maps = nodes.find(pair.masters[k]), pair.surface.point_maps
    out = []
    for c in range(layout.gdim):
        row = layout.dof(link.nodes, c)
        follows = np.where(free[:, c], 1.0, 0.0)
        weights = follows[:, None] * pair.weights[k]
        blocks = [(c, weights)]
        if pair.master_maps is not None:
            maps = pair.master_maps[k, :, c]
            blocks = [(j, weights * maps[..., j]) for j in range(layout.n_unknowns)]
        rows = np.broadcast_to(row[:, None], masters.shape).ravel()
        out += [(rows, layout.dof(masters, j).ravel(), block.ravel()) for j, block in blocks]
        if slave_maps is not None:
            out += [
                (row, layout.dof(link.nodes, j), -follows * slave_maps[k, c, j])
                for j in range(layout.gdim, layout.n_unknowns)
            ]
    return out


def _assemble(
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
        layout: Unknowns of nodes and their numbers.
        supports: Prescribed components.
        column: Column of each owned dof's own, -1 where it has none, shape (n_local,).
        followers: Owned dofs that follow others, shape (n_followers,).
        rows: Their rows, shape (n_followers, n_columns).
        support_column: First column of the supports.
        size: Columns that this rank owns, and all columns.
    """
    single = (supports.which >= 0) | (column >= 0)
    single[followers] = False
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
