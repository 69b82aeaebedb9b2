"""Jump coordinates: the transformation u = T q of design.md, section 2.

Columns of T, in this order on each rank:

* inner coordinates: free displacements, and jumps outside the window that are free;
* on rank 0 only, last: window jumps, one column per prescribed displacement component
  (u = d times its shape), and empty columns kept for the borders of force patterns and monitors.

A bonded jump outside the window has no column: it is zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InterfaceError
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pairing import Pair
from fxcrack.interface.supports import Supports, align_frames, check_slaves

FIXED, FREE, RETAINED = 0, 1, 2
"""Roles of a jump component: zero for good, free in the continuum, or part of the window."""


@dataclass
class JumpCoordinates:
    """The transformation T and the numbering of its columns.

    Attributes:
        transform: T, PETSc AIJ, shape (n_global, n_coordinates).
        frames: Frame of each slave node per pair, aligned with supports, (n_nodes, gdim, gdim).
        held: Jump components that supports hold at zero, per pair, shape (n_nodes, gdim).
        index: Window number of each jump component per pair, -1 outside, shape (n_nodes, gdim).
        n_retained: Number of window components.
        n_supports: Number of support columns, which follow the window.
        n_borders: Number of empty columns, which come last.
        n_inner: Inner coordinates of this rank.
        first: Global number of the first window column.
        inner_dofs: Owned displacement dof each inner coordinate belongs to, ascending; a free
            jump takes the place of its slave node's component, shape (n_inner,).
    """

    transform: PETSc.Mat
    frames: list[Array]
    held: list[npt.NDArray[np.bool_]]
    index: list[Ints]
    n_retained: int
    n_supports: int
    n_borders: int
    n_inner: int
    first: int
    inner_dofs: Ints

    @property
    def n_last(self) -> int:
        """Window, support and border columns together."""
        return self.n_retained + self.n_supports + self.n_borders


def build_coordinates(
    continuum: Continuum,
    pairs: list[Pair],
    roles: list[npt.NDArray[np.int8]],
    supports: Supports,
    n_borders: int,
) -> JumpCoordinates:
    """Number the coordinates and build T; collective.

    Args:
        continuum: Displacement space.
        pairs: Interfaces.
        roles: FIXED, FREE or RETAINED per pair and jump component, shape (n_nodes, gdim).
        supports: Prescribed components.
        n_borders: Empty columns to append.

    Raises:
        InterfaceError: A slave used twice, a cycle of slaves and masters, a support on a slave
            node that its masters do not share.
    """
    gdim, comm = continuum.gdim, continuum.comm
    # a node whose jump is free and of no interest keeps its own displacement
    jumped = [p.paired & (r != FREE).any(axis=1) for p, r in zip(pairs, roles, strict=True)]
    replica = InterfaceNodes(continuum, pairs, supports.which, supports.value, jumped)
    check_slaves(pairs, jumped, replica, supports)
    slaves = [replica.find(p.surface.dofs) for p in pairs]
    paired = [np.flatnonzero(j) for j in jumped]

    def at_slaves(table: Ints, fill: int) -> list[Ints]:
        out = []
        for p, s, k in zip(pairs, slaves, paired, strict=True):
            rows = np.full((p.surface.n_nodes, gdim), fill, dtype=table.dtype)
            rows[k] = table[s[k]]
            out.append(rows)
        return out

    frames, held = align_frames(
        pairs,
        at_slaves(replica.which, -1),
        jumped,
        supports,
        gdim,
    )
    roles = [
        np.where(h | ~j[:, None], FIXED, r) for r, h, j in zip(roles, held, jumped, strict=True)
    ]

    # which owned dof slots have a column of their own
    own = np.asarray(supports.which < 0)
    is_slave = np.zeros((len(replica.blocks), gdim), dtype=bool)
    inner_slave = np.zeros((len(replica.blocks), gdim), dtype=bool)
    for s, k, role in zip(slaves, paired, roles, strict=True):
        is_slave[s[k]] = True
        inner_slave[s[k]] = role[k] == FREE
    mine = (replica.blocks[replica.mine] - replica.low)[:, None] * gdim + np.arange(gdim)
    slave_here = is_slave[replica.mine]
    own[mine[slave_here]] = inner_slave[replica.mine][slave_here]

    index, n_retained = [], 0
    for role in roles:
        number = np.full(role.shape, -1, dtype=np.int64)
        inside = role == RETAINED
        number[inside] = n_retained + np.arange(int(inside.sum()))
        n_retained += int(inside.sum())
        index.append(number)
    n_supports = len(supports.columns)
    n_inner = int(own.sum())
    counts = comm.allgather(n_inner)
    extra = n_retained + n_supports + n_borders
    first = counts[0]
    start = sum(counts[: comm.rank]) + (extra if comm.rank > 0 else 0)
    n_columns = sum(counts) + extra
    column = np.full(continuum.n_local, -1, dtype=np.int64)
    column[own] = start + np.arange(n_inner)
    shared = replica.share(column[mine].astype(float)).astype(np.int64)

    rows = _interface_rows(
        replica,
        pairs,
        slaves,
        paired,
        frames,
        index,
        is_slave,
        shared,
        first,
        n_retained,
        n_columns,
    )
    transform = _assemble(
        continuum, supports, replica, is_slave, mine, column, rows, first + n_retained,
        (n_inner + (extra if comm.rank == 0 else 0), n_columns),
    )  # fmt: skip
    return JumpCoordinates(
        transform, frames, held, index, n_retained, n_supports, n_borders, n_inner, first,
        np.flatnonzero(own),
    )  # fmt: skip


def _interface_rows(
    replica: InterfaceNodes,
    pairs: list[Pair],
    slaves: list[Ints],
    paired: list[Ints],
    frames: list[Array],
    index: list[Ints],
    is_slave: npt.NDArray[np.bool_],
    shared: Ints,
    first: int,
    n_retained: int,
    n_columns: int,
) -> sp.csr_matrix:
    """Rows of T for all interface dofs, chains composed, shape (gdim n_blocks, n_columns)."""
    gdim = replica.gdim
    n = gdim * len(replica.blocks)
    slave_flat = is_slave.ravel()
    column, which, value = shared.ravel(), replica.which.ravel(), replica.value.ravel()
    base_rows = np.flatnonzero(~slave_flat & (column >= 0))
    # a supported component of a slave moves like its masters', but its reaction is its own
    held_rows = np.flatnonzero(which >= 0)
    entries = [
        (base_rows, column[base_rows], np.ones(len(base_rows))),
        (held_rows, first + n_retained + which[held_rows], value[held_rows]),
    ]
    links = []
    for pair, s, k, frame, number in zip(pairs, slaves, paired, frames, index, strict=True):
        masters = replica.find(pair.masters[k])
        weights = pair.weights[k]
        for c in range(gdim):
            row = np.broadcast_to((gdim * s[k] + c)[:, None], masters.shape)
            follows = np.where(replica.which[s[k], c] < 0, 1.0, 0.0)[:, None] * weights
            links.append((row.ravel(), (gdim * masters + c).ravel(), follows.ravel()))
        for j in range(gdim):
            inner = column[gdim * s[k] + j]
            target = np.where(number[k, j] >= 0, first + number[k, j], inner)
            has = target >= 0
            for c in range(gdim):
                entries.append((gdim * s[k][has] + c, target[has], frame[k, c, j][has]))

    def matrix(parts: list[tuple[Ints, Ints, Array]], width: int) -> sp.csr_matrix:
        r, c, v = (np.concatenate(p) for p in zip(*parts, strict=True))
        keep = v != 0.0
        return sp.csr_matrix((v[keep], (r[keep], c[keep])), shape=(n, width))

    base = matrix(entries, n_columns)
    if not links:
        return base
    chain = matrix(links, n)
    inside = chain[slave_flat][:, slave_flat]
    groups, _ = connected_components(inside, directed=True, connection="strong")
    if groups < inside.shape[0] or inside.diagonal().any():
        names = ", ".join(f"'{p.title}'" for p in pairs)
        raise InterfaceError(
            f"interfaces {names} form a cycle: a slave node is master of a node that is in turn "
            "its master; exchange slave and master of one of them"
        )
    rows = base
    for _ in range(len(pairs)):
        rows = base + chain @ rows
    return sp.csr_matrix(rows)


def _assemble(
    continuum: Continuum,
    supports: Supports,
    replica: InterfaceNodes,
    is_slave: npt.NDArray[np.bool_],
    mine: Ints,
    column: Ints,
    rows: sp.csr_matrix,
    support_column: int,
    size: tuple[int, int],
) -> PETSc.Mat:
    """T from the single-entry rows of ordinary dofs and the interface rows of slaves."""
    gdim, n_local = continuum.gdim, continuum.n_local
    slave_here = is_slave[replica.mine]
    local = mine[slave_here]
    global_rows = (gdim * replica.mine[:, None] + np.arange(gdim))[slave_here]
    single = (supports.which >= 0) | (column >= 0)
    single[local] = False
    r = np.flatnonzero(single)
    held = supports.which[r] >= 0
    c = np.where(held, support_column + supports.which[r], column[r])
    v = np.where(held, supports.value[r], 1.0)
    block = rows[global_rows].tocoo()
    csr = sp.csr_matrix(
        (
            np.concatenate([v, block.data]),
            (np.concatenate([r, local[block.row]]), np.concatenate([c, block.col])),
        ),
        shape=(n_local, size[1]),
    )
    csr.sort_indices()
    transform = PETSc.Mat().createAIJ(
        ((n_local, continuum.n_global), size),
        csr=(
            csr.indptr.astype(PETSc.IntType),
            csr.indices.astype(PETSc.IntType),
            csr.data.astype(PETSc.ScalarType),
        ),
        comm=continuum.comm,
    )
    transform.assemble()
    return transform
