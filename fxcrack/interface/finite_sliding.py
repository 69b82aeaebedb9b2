"""Pairing in the current configuration: open slave nodes meet the master surface where it is now.

    n . (x_s - sum_m W_m x_m) >= 0,    x = X + u,    W and n those of the projection of x_s

In the unknowns of the jump coordinates this is delta_n + g >= 0 with g = n . (X_s - sum W_m X_m).
n is the master's normal, interpolated from those of its nodes: over a facet it is on the mean that
of the facet, so that contact forces do no work on what slides over it. Where the pair is
surface-to-surface, W are means over the facets as they are now. Bonded nodes keep the weights they
are bonded with, as long as their bonds carry any force.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.frames import local_frames
from fxcrack.interface.mortar import surface_weights
from fxcrack.interface.pair import NEAR, Pair, has_slid
from fxcrack.interface.projection import project
from fxcrack.interface.rigid import RigidSurface
from fxcrack.interface.rigid_pairing import renewed_on
from fxcrack.interface.surface import FacetSurface

_OF_MASTERS = ("masters", "weights")
_CHANGING = ("paired", "frames", "gap")


def renewed(
    pair: Pair, bonded: Bools, master: FacetSurface | RigidSurface, u_slave: Array,
    u_master: Array, *, pressed: Bools | None = None, turned: float = np.inf,
) -> Pair | None:  # fmt: skip
    """A pair with its open nodes projected on the present master surface.

    Args:
        pair: The pair as it is.
        bonded: Slave nodes that are bonded now, or whose bonds still pull, shape (n_nodes,).
        master: Undeformed master surface.
        u_slave: Displacements of the slave nodes, shape (n_nodes, gdim), length.
        u_master: Displacements of the master nodes, shape (master.n_nodes, gdim), length; none,
            shape (0, gdim), of a rigid surface.
        pressed: Nodes that faces press on, which follow the smallest change, shape (n_nodes,);
            ``None`` where that is not known.
        turned: Angle by which the normal may turn where gaps are too large to close; not of rigid
            surfaces.

    Returns:
        ``None`` if no gap that may close has changed enough to matter, and no normal has turned too
        far.
    """
    if pair.hierarchy is not None:
        found = renewed(
            pair.by_nodes(), bonded, master, u_slave, u_master, pressed=pressed, turned=turned
        )  # fmt: skip
        return None if found is None else found.by_corners()
    if not isinstance(master, FacetSurface):
        return renewed_on(pair, bonded, u_slave, pressed)
    gdim = u_slave.shape[1]
    x, y = pair.surface.x.copy(), master.x.copy()
    x[:, :gdim] += u_slave
    y[:, :gdim] += u_master
    now = master.moved(y)
    foot = project(x, now)
    normals = foot.normal
    away = x - foot.foot
    gap = np.einsum("nc,nc->n", away, normals)
    aside = np.linalg.norm(away - gap[:, None] * normals, axis=1)
    size = now.facet_size
    over = ~bonded & (aside <= 0.1 * size + 0.1 * np.abs(gap))
    nodes, new = now.facets[foot.facet], foot.weights
    if pair.surface_to_surface:
        means = surface_weights(pair.whole_surface.moved(x), now, foot, NEAR * size)
        nodes, new = means.masters, means.weights
    # by nodes: above a node the facet is one or the other by round-off, its weights are the same
    slid = has_slid(_change(pair, now.dofs[nodes], new), pressed)
    near = over & (gap < NEAR * size)
    turn = np.linalg.norm(normals[:, :gdim] - pair.frames[:, :, 0], axis=1)
    slid |= has_slid(turn, pressed)
    if not np.any(near & (slid | ~pair.paired)) and not np.any(over & (turn > turned)):
        return None
    frames, gaps = pair.frames.copy(), pair.gap.copy()
    frames[over] = local_frames(normals, gdim)[over]
    width = max(new.shape[1], pair.weights.shape[1])
    weights = np.where(over[:, None], _wide(new, width), _wide(pair.weights, width))
    node_of = _nodes_of(master, pair.masters)
    all_nodes = np.where(over[:, None], _wide_nodes(nodes, width), _wide_nodes(node_of, width))
    undeformed = np.einsum("nk,nkc->nc", new, master.x[nodes])
    gaps[over] = np.einsum("nc,nc->n", pair.surface.x - undeformed, normals)[over]
    return replace(
        pair,
        paired=np.where(bonded, pair.paired, over),
        masters=master.dofs[all_nodes],
        weights=weights,
        frames=frames,
        gap=gaps,
        master_maps=master.maps_at(all_nodes),
    )


def _change(pair: Pair, masters: Ints, weights: Array) -> Array:
    """Largest change of a weight of each slave node, shape (n_nodes,)."""
    n = len(masters)
    rows = np.broadcast_to(np.arange(n)[:, None], masters.shape).ravel()
    before = np.broadcast_to(np.arange(n)[:, None], pair.masters.shape).ravel()
    known, column = np.unique(
        np.concatenate([pair.masters.ravel(), masters.ravel()]), return_inverse=True
    )
    shape = (n, len(known))
    split = len(before)
    old = sp.csr_matrix((pair.weights.ravel(), (before, column[:split])), shape=shape)
    new = sp.csr_matrix((weights.ravel(), (rows, column[split:])), shape=shape)
    return np.asarray(abs(new - old).max(axis=1).todense()).ravel()


def _wide(weights: Array, width: int) -> Array:
    """Weights with zeros appended, shape (n_nodes, width)."""
    return np.pad(weights, ((0, 0), (0, width - weights.shape[1])))


def _wide_nodes(nodes: Ints, width: int) -> Ints:
    """Nodes with their first repeated at the end, shape (n_nodes, width)."""
    return np.concatenate([nodes, np.repeat(nodes[:, :1], width - nodes.shape[1], axis=1)], axis=1)


def _nodes_of(master: FacetSurface, dofs: Ints) -> Ints:
    """Nodes of the master surface with given global displacement nodes, same shape."""
    order = np.argsort(master.dofs)
    return np.asarray(order[np.searchsorted(master.dofs[order], dofs)])


def names_changing(master: FacetSurface | RigidSurface) -> tuple[str, ...]:
    """Attributes of a pair that a new pairing changes."""
    return _CHANGING + _OF_MASTERS if isinstance(master, FacetSurface) else _CHANGING


def changing(pair: Pair, master: FacetSurface | RigidSurface) -> dict[str, npt.NDArray[Any]]:
    """What a new pairing changes of a pair, independent of the number of ranks.

    Args:
        pair: The pair.
        master: Its master surface.

    Returns:
        Arrays by the names of :func:`names_changing`, shapes as in :class:`Pair`; "masters", shape
        (n_nodes, k), as node numbers of the master surface.
    """
    pair = pair.by_nodes()
    out = {name: getattr(pair, name) for name in names_changing(master)}
    if isinstance(master, FacetSurface):
        out["masters"] = _nodes_of(master, pair.masters)
    return out


def with_changing(
    pair: Pair, master: FacetSurface | RigidSurface, known: dict[str, npt.NDArray[Any]]
) -> Pair:
    """A pair with the arrays of :func:`changing`.

    Args:
        pair: The pair.
        master: Its master surface.
        known: From :func:`changing`, same shapes, on any number of ranks.
    """
    changed: dict[str, Any] = dict(known)
    if isinstance(master, FacetSurface):
        nodes = known["masters"]
        changed |= {"masters": master.dofs[nodes], "master_maps": master.maps_at(nodes)}
    found = replace(pair.by_nodes(), **changed)
    return found if pair.hierarchy is None else found.by_corners()
