"""Rows of T for dofs that follow others: slave nodes, joints, couplings and equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import InterfaceError
from fxcrack.continuum.dof_layout import DofLayout
from fxcrack.interface.following import Following
from fxcrack.interface.hierarchy import links_in_chain
from fxcrack.interface.nodes import InterfaceNodes
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports


@dataclass(frozen=True)
class Link:
    """Slave nodes of a pair that have a jump.

    Attributes:
        pair: The pair.
        slaves: Which of its slave nodes, shape (n,).
        nodes: Their rows among the interface nodes, shape (n,).
    """

    pair: Pair
    slaves: Ints
    nodes: Ints


def interface_rows(
    nodes: InterfaceNodes,
    links: Sequence[Link],
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


def constraint_rows(
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
    nodes: InterfaceNodes, link: Link, free: Bools
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


__all__ = ["Link", "constraint_rows", "interface_rows"]
