"""Front nodes of a surface in their order along the front.

The front separates open from bonded nodes. In a facet that it cuts, it enters through one edge with
an open and a bonded end and leaves through another; followed from facet to facet, the bonded ends
of these edges are the front nodes in order, whatever the mesh.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.interface.front import Front

_CORNERS = {"triangle": (0, 1, 2), "quadrilateral": (0, 1, 3, 2)}
"""Corners of a facet along its outline, basix order."""


def ordered_fronts(front: Front, points: Array) -> list[tuple[list[int], bool]]:
    """Front nodes of a surface in order, each connected part with whether it is closed.

    A node that the front passes twice is listed once, where it is passed first.

    Args:
        front: The front.
        points: Positions of the slave nodes, shape (n_nodes, 3), that decide where a line begins.
    """
    surface, bonded = front.surface, front.bonded
    corners = surface.facets[:, _CORNERS[surface.kind]]
    cut = np.flatnonzero(bonded[corners].any(axis=1) & ~bonded[corners].all(axis=1))
    joins: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for around in corners[cut].tolist():
        n = len(around)
        # (bonded end, open end) of each edge at which a run of bonded corners begins or ends
        begins = [i for i in range(n) if bonded[around[i]] and not bonded[around[i - 1]]]
        for i in begins:
            j = i
            while bonded[around[(j + 1) % n]]:
                j += 1
            one = (around[i], around[i - 1])
            two = (around[j % n], around[(j + 1) % n])
            joins.setdefault(one, []).append(two)
            joins.setdefault(two, []).append(one)
    # whole numbers, so that round-off in the positions has no say
    x = np.rint(points / (1e-7 * np.ptp(points, axis=0).max())).astype(np.int64).tolist()
    place = {edge: (x[edge[0]], x[edge[1]]) for edge in joins}
    left = set(joins)
    out: list[tuple[list[int], bool]] = []
    while left:
        ends = [e for e in left if sum(n in left for n in joins[e]) < 2]
        here = min(ends or left, key=place.__getitem__)
        closed, path = not ends, [here]
        left.discard(here)
        while True:
            following = [e for e in joins[here] if e in left]
            if not following:
                break
            here = min(following, key=place.__getitem__)
            path.append(here)
            left.discard(here)
        out.append((list(dict.fromkeys(edge[0] for edge in path)), closed))
    return out
