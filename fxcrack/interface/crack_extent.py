"""Extent of a crack: open length along a line, or open area over the front width.

2-D: the length of the open run that ends at a tip, measured along the slave surface from the end
of the surface; half of it when both its ends are tips, or were until one of them reached the end of
the surface. Lines that close on themselves have no end, and a run there has two tips. Once nothing
is bonded, the open length of each initial tip.
3-D: open area divided by the length of the initial front; the facets cut by the front count half.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.front import Front
from fxcrack.interface.tips import Tips


class CrackExtent:
    """Crack length and open area of one interface.

    Args:
        front: Its front, in the initial state.
    """

    def __init__(self, front: Front) -> None:
        self._front = front
        self._surface = surface = front.surface  # lengths are those of the undeformed surface
        self._line = surface.dim == 1
        tips = front.tips()
        self._front_length = float(tips.width.sum()) if len(tips) else 0.0
        self._known: tuple[int, list[tuple[int, float]]] = (-1, [])
        self._was_bonded = front.bonded.copy()
        if self._line:
            self._paths = [_along(path, surface.x) for path in _polylines(surface.facets[:, :2])]
            self._n_tips = [_changes(self._was_bonded[nodes]) for nodes, _ in self._paths]

    def area(self, tips: Tips) -> float:
        """Open area (length times thickness or ring in 2-D), length^2."""
        surface, bonded = self._surface, self._front.bonded
        total = float(surface.areas[~bonded].sum())
        # the front stands half-way into the facets it cuts; with second-order shape functions
        # a corner node stands for a sixth of each facet
        share = 0.5 if surface.order == 1 else 1.0 / 6.0
        # with open parts on both sides of a node all of its area counts
        beside = np.where(
            tips.ligament, surface.areas[tips.node], share * tips.width * tips.d_behind
        )
        return total + float(beside.sum())

    def length(self, tips: Tips) -> float:
        """Crack length: of the longest run in 2-D, the mean over the front in 3-D."""
        if not self._line:
            return self.area(tips) / self._front_length if self._front_length else 0.0
        return max((a for _, a in self.lengths()), default=0.0)

    def over_front(self, area: float) -> float:
        """Mean advance of the first front of a surface over an area, length."""
        return area / self._front_length if self._front_length else 0.0

    @property
    def largest(self) -> float:
        """What the crack length cannot exceed, the interface being open all over."""
        if not self._line:
            return (
                float(self._surface.areas.sum()) / self._front_length if self._front_length else 0.0
            )
        out = 0.0
        for nodes, s in self._paths:
            closed = nodes[0] == nodes[-1]
            shared = closed or bool(self._was_bonded[nodes[[0, -1]]].all())
            out = max(out, float(s[-1]) / (2.0 if shared else 1.0))
        return out

    def lengths(self) -> list[tuple[int, float]]:
        """Tip node and crack length of every tip on a line; -1 where a run has no tip."""
        if self._known[0] != self._front.version:
            self._known = (self._front.version, self._measure())
        return self._known[1]

    def _measure(self) -> list[tuple[int, float]]:
        out: list[tuple[int, float]] = []
        for (nodes, s), n_tips in zip(self._paths, self._n_tips, strict=True):
            bonded = self._front.bonded[nodes]
            closed = nodes[0] == nodes[-1]
            if closed and bonded.any():
                # a closed line is walked from a bonded node on, so that no run is cut in two
                begin = int(np.argmax(bonded))
                steps = np.roll(np.diff(s), -begin)
                nodes = np.append(np.roll(nodes[:-1], -begin), nodes[begin])
                s, bonded = np.concatenate([[0.0], np.cumsum(steps)]), self._front.bonded[nodes]
            # runs of open nodes; each reaches to the bonded nodes on both sides
            edge = np.flatnonzero(np.diff(np.concatenate([[True], bonded, [True]]).astype(int)))
            for first, stop in edge.reshape(-1, 2):
                left, right = max(first - 1, 0), min(stop, len(nodes) - 1)
                total = float(s[right] - s[left])
                ends = nodes[[left, right]]
                # tips that have reached an end of the surface still share the length
                share = (
                    2
                    if closed
                    else sum(int(bonded[k] or self._was_bonded[nodes[k]]) for k in (left, right))
                )
                share = share or max(n_tips, 1)
                tips = {int(k) for k in ends if self._front.bonded[k]}
                out += [(tip, total / share) for tip in sorted(tips)] or [(-1, total / share)]
        return out


def _changes(bonded: Bools) -> int:
    """Number of places along a line where open nodes are beside bonded ones."""
    return int(np.count_nonzero(np.diff(bonded.astype(int))))


def _polylines(ends: Ints) -> list[Ints]:
    """Corner nodes of a line of facets in order, one array per connected piece.

    A closed line ends with the node it begins with.
    """
    around: dict[int, list[int]] = {}
    for a, b in ends.tolist():
        around.setdefault(a, []).append(b)
        around.setdefault(b, []).append(a)
    left = set(around)
    out = []
    while left:
        # begin at an end of the line; a closed line begins anywhere
        start = min((n for n in left if len(around[n]) == 1), default=min(left))
        path, here = [start], start
        left.discard(start)
        while True:
            nxt = [n for n in around[here] if n in left]
            if not nxt:
                break
            here = nxt[0]
            path.append(here)
            left.discard(here)
        if len(path) > 2 and start in around[here]:
            path.append(start)
        out.append(np.array(path))
    return out


def _along(path: Ints, x: Array) -> tuple[Ints, Array]:
    """Nodes of a line and their distance from its beginning."""
    steps = np.linalg.norm(np.diff(x[path], axis=0), axis=1)
    return path, np.concatenate([[0.0], np.cumsum(steps)])
