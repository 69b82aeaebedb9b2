"""Pairing in the current configuration: open slave nodes meet the master surface where it is now.

    n . (x_s - sum_m W_m x_m) >= 0,    x = X + u,    W and n those of the projection of x_s

In the unknowns of the jump coordinates this is delta_n + g >= 0 with g = n . (X_s - sum W_m X_m).
n is the master's normal, interpolated from those of its nodes: over a facet it is on the mean that
of the facet, so that contact forces do no work on what slides over it. Bonded nodes keep the master
point they are bonded to, as long as their bonds carry any force.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools
from fxcrack.interface.pairing import Pair, local_frames
from fxcrack.interface.projection import project
from fxcrack.interface.surface import FacetSurface

_SLIDE = 0.01
"""Part of a facet a node may slide, and angle its normal may turn, before it is paired anew."""
_NEAR = 0.5
"""Parts of a facet within which a gap may close in the next increment."""
CHANGING = ("paired", "masters", "weights", "frames", "gap")
"""What a new pairing changes of a pair."""


def renewed(
    pair: Pair, bonded: Bools, master: FacetSurface, u_slave: Array, u_master: Array
) -> Pair | None:
    """A pair with its open nodes projected on the present master surface.

    Args:
        pair: The pair as it is.
        bonded: Slave nodes that are bonded now, or whose bonds still pull, shape (n_nodes,).
        master: Undeformed master surface.
        u_slave: Displacements of the slave nodes, shape (n_nodes, gdim), length.
        u_master: Displacements of the master nodes, shape (master.n_nodes, gdim), length.

    Returns:
        ``None`` if no gap that may close has changed enough to matter.
    """
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
    nodes = now.facets[foot.facet]
    masters = now.dofs[nodes]
    near = over & (gap < _NEAR * size)
    slid = (masters != pair.masters).any(axis=1)
    slid |= np.abs(foot.weights - pair.weights).max(axis=1) > _SLIDE
    slid |= np.linalg.norm(normals[:, :gdim] - pair.frames[:, :, 0], axis=1) > _SLIDE
    if not np.any(near & (slid | ~pair.paired)):
        return None
    frames, weights, gaps = pair.frames.copy(), pair.weights.copy(), pair.gap.copy()
    new_masters = pair.masters.copy()
    frames[over] = local_frames(normals, gdim)[over]
    weights[over], new_masters[over] = foot.weights[over], masters[over]
    maps = pair.master_maps
    if maps is not None and master.point_maps is not None:
        maps = maps.copy()
        maps[over] = master.point_maps[nodes[over]]
    undeformed = np.einsum("nk,nkc->nc", foot.weights, master.x[nodes])
    gaps[over] = np.einsum("nc,nc->n", pair.surface.x - undeformed, normals)[over]
    return replace(
        pair,
        paired=np.where(bonded, pair.paired, over),
        masters=new_masters,
        weights=weights,
        frames=frames,
        gap=gaps,
        master_maps=maps,
    )


def changing(pair: Pair, master: FacetSurface) -> dict[str, npt.NDArray[Any]]:
    """:data:`CHANGING` of a pair, independent of the number of ranks.

    Args:
        pair: The pair.
        master: Its master surface.

    Returns:
        Arrays by name, shapes as in :class:`Pair`; "masters", shape (n_nodes, k), as node numbers
        of the master surface.
    """
    order = np.argsort(master.dofs)
    nodes = order[np.searchsorted(master.dofs[order], pair.masters)]
    return {name: getattr(pair, name) for name in CHANGING} | {"masters": nodes}


def with_changing(pair: Pair, master: FacetSurface, known: dict[str, npt.NDArray[Any]]) -> Pair:
    """A pair with the arrays of :func:`changing`.

    Args:
        pair: The pair.
        master: Its master surface.
        known: From :func:`changing`, same shapes, on any number of ranks.
    """
    nodes = known["masters"]
    changed = {**known, "masters": master.dofs[nodes], "master_maps": master.maps_at(nodes)}
    return replace(pair, **changed)
