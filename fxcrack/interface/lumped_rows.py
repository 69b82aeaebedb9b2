"""Products for chosen rows of interfaces between lumped masses, on components of the nodes.

Their jumps, what forces on them do, and the bond forces of tied rows. Where every slave has one
master of its own, rows have as many entries each and are written down at once.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.sparse import Product, by_component
from fxcrack.interface.lumped import LumpedInterface


def mean_jumps(lumped: LumpedInterface, rows: Ints, weights: Array) -> Product:
    """Weighted means of jumps by the motion of the nodes.

    Args:
        lumped: Masses and ties.
        rows: Shape (n, k).
        weights: Same shape; rows of weight 0 need not exist.

    Returns:
        On components of the nodes, shape (n gdim, n_nodes gdim).
    """
    gdim = lumped.which.shape[1]
    rows = np.where(weights != 0.0, rows, 0)
    if lumped.simple:
        assert lumped.master is not None
        nodes = np.hstack([lumped.slave[rows], lumped.master[rows]])[:, None, :]
        columns = gdim * nodes + np.arange(gdim)[None, :, None]
        data = np.repeat(np.hstack([weights, -weights]), gdim, axis=0)
        return Product.of_rows(columns.reshape(-1, nodes.shape[2]), data, gdim * len(lumped.nodes))
    out = sp.csr_matrix((len(rows), len(lumped.nodes)))
    for k in range(rows.shape[1]):
        out = out + sp.diags(weights[:, k]) @ lumped.separations(rows[:, k])
    return Product(by_component(out, gdim))


def jumps_along(lumped: LumpedInterface, rows: Ints, directions: Array) -> Product:
    """Jumps of some rows along one direction each by the motion of the nodes.

    Args:
        lumped: Masses and ties.
        rows: Shape (n,).
        directions: Unit vectors, shape (n, gdim).

    Returns:
        On components of the nodes, shape (n, n_nodes gdim).
    """
    gdim = directions.shape[1]
    if lumped.simple:
        columns, data = _pairs_along(lumped, rows, directions, 1.0, 1.0)
        return Product.of_rows(columns, data, gdim * len(lumped.nodes))
    return Product(_along(lumped, rows, directions))


def _pairs_along(
    lumped: LumpedInterface,
    rows: Ints,
    directions: Array,
    slave: Array | float,
    master: Array | float,
) -> tuple[Ints, Array]:
    """Components of the nodes of pairs, and a direction times factors, (n, 2 gdim) each."""
    assert lumped.master is not None
    gdim = directions.shape[1]
    nodes = np.stack([lumped.slave[rows], lumped.master[rows]], axis=1)
    columns = gdim * nodes[:, :, None] + np.arange(gdim)
    data = np.stack([slave * directions, -master * directions], axis=1)
    return columns.reshape(-1, 2 * gdim), data.reshape(-1, 2 * gdim)


def _along(lumped: LumpedInterface, rows: Ints, directions: Array) -> sp.csr_matrix:
    nodes = lumped.separations(rows)
    gdim = directions.shape[1]
    at = np.repeat(np.arange(len(rows)), np.diff(nodes.indptr))
    data = nodes.data[:, None] * directions[at]
    columns = gdim * nodes.indices.astype(np.int64)[:, None] + np.arange(gdim)
    return sp.csr_matrix(
        (data.ravel(), columns.ravel(), gdim * nodes.indptr.astype(np.int64)),
        shape=(len(rows), gdim * len(lumped.nodes)),
    )


def pull_along(lumped: LumpedInterface, rows: Ints, directions: Array) -> tuple[Product, Array]:
    """What forces of open rows along one direction each do.

    Args:
        lumped: Masses and ties.
        rows: Shape (n,).
        directions: Unit vectors, shape (n, gdim).

    Returns:
        Accelerations of the nodes by such forces on the slaves and their reactions, shape
        (n_nodes gdim, n); accelerations of the jumps along the directions, shape (n, n).
    """
    if lumped.simple:
        assert lumped.master is not None
        slave, master = lumped.inverse[lumped.slave[rows]], lumped.inverse[lumped.master[rows]]
        columns, data = _pairs_along(lumped, rows, directions, slave, master)
        own = ((slave + master) * directions**2).sum(axis=1)
        height = directions.shape[1] * len(lumped.nodes)
        return Product.of_columns(columns, data, height), np.diag(own)
    along = _along(lumped, rows, directions)
    push = lumped.accelerations.times(along.T)
    return Product(push), (along @ push).toarray()


def bonds_of(
    lumped: LumpedInterface, rows: Ints, prescribed: Ints
) -> tuple[Product, Product | None]:
    """Bond forces on the slaves of some tied rows, without what supports of slaves hold.

    Args:
        lumped: Masses and ties.
        rows: Shape (n,).
        prescribed: Components of the nodes whose accelerations are given, shape (m,).

    Returns:
        By the forces on the nodes, on components, shape (n gdim, n_nodes gdim); by the given
        accelerations, those of the motions of references last, shape (n gdim, m + n_motions),
        ``None`` where there are none.
    """
    gdim, s = lumped.which.shape[1], lumped.slave[rows]
    width = gdim * len(lumped.nodes)
    if lumped.simple and not len(prescribed):
        assert lumped.master is not None
        m = lumped.master[rows]
        nodes = np.stack([s, m], axis=1)[:, None, :]
        columns = gdim * nodes + np.arange(gdim)[None, :, None]
        share = lumped.mass[s, None] * lumped.inverse[m]
        data = np.stack([share - 1.0, share], axis=2)
        return Product.of_rows(columns.reshape(-1, 2), data.reshape(-1, 2), width), None
    at = (gdim * s[:, None] + np.arange(gdim)).ravel()
    mass = sp.diags(np.repeat(lumped.group_mass[s], gdim))
    if lumped.depth.any():
        own = by_component(lumped.collected()[s], gdim)
    else:
        n = len(at)
        own = sp.csr_matrix((np.ones(n), at, np.arange(n + 1)), shape=(n, width))
    force = mass @ lumped.accelerations.rows(at) - own
    given = mass @ lumped.given_accelerations(prescribed)[at]
    held = lumped.held[rows]
    if held.any():
        frames = lumped.frames[rows]
        free = np.einsum("nci,ni,ndi->ncd", frames, ~held, frames)
        n = len(rows)
        project = sp.bsr_matrix((free, np.arange(n), np.arange(n + 1)), shape=(n * gdim, n * gdim))
        force, given = project @ force, project @ given
    return Product(force), Product(given)


__all__ = ["bonds_of", "jumps_along", "mean_jumps", "pull_along"]
