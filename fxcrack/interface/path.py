"""Walking along a slave surface from a tip, over the bonded part ahead or the open part behind.

On a line (2-D) the way is the line itself, whatever its shape. On a surface (3-D) it is the mesh
line most nearly along the growth direction; each step counts with its component in that direction,

    s_(k+1) = s_k + (x_(k+1) - x_k) . t_k,    t_k the direction in the tangent plane at node k,

so that a zig-zag line is as long as the straight one it follows. Reference positions are used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack.interface.front import Front, Tips

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

_ALIGNED = 0.1
"""Least cosine between a step and the direction of the way on a surface (3-D)."""


@dataclass(frozen=True)
class Way:
    """A way along the nodes of a slave surface.

    Attributes:
        nodes: From the tip on, shape (m,); second order: corner, midside, corner, ...
        s: Distance from the tip along the surface, shape (m,), length.
        x: Positions, shape (m, 3), length.
    """

    nodes: Ints
    s: Array
    x: Array

    @property
    def radius(self) -> Array:
        """Straight-line distance from the tip, shape (m,), length."""
        return np.asarray(np.linalg.norm(self.x - self.x[0], axis=1))


class SurfacePaths:
    """Ways along one slave surface, and where the present tips come from.

    Args:
        front: Front of the interface in its initial state, which is remembered.

    Attributes:
        longest: Longest edge of a face, length.
    """

    def __init__(self, front: Front) -> None:
        self._front = front
        self._surface = front.surface
        self._was_bonded = front.bonded.copy()
        self.initial = front.candidates()
        corner = self._surface.x[self._surface.facets[:, : self._surface.n_corners]]
        between = np.linalg.norm(corner[:, :, None] - corner[:, None], axis=-1)
        self.longest = float(between.max())

    def ahead(self, tips: Tips, i: int, reach: float) -> Way:
        """Way over bonded nodes ahead of a tip, until it is ``reach`` long or no node follows.

        Args:
            tips: Present front.
            i: Which of them.
            reach: Distance along the surface, length.
        """
        growth = tips.frame[i, :, 1]
        return self._walk(int(tips.node[i]), growth, self._front.bonded, reach, straight=False)

    def behind(self, tips: Tips, i: int, reach: float, inside: Bools) -> Way:
        """Way backwards from a tip, until a node is ``reach`` away from it or none follows.

        Args:
            tips: Present front.
            i: Which of them.
            reach: Straight-line distance from the tip, length.
            inside: Nodes that may be entered, shape (n_nodes,).
        """
        back = -tips.frame[i, :, 1]
        return self._walk(int(tips.node[i]), back, inside, reach, straight=True)

    def origins(self, tips: Tips) -> tuple[Ints, Array]:
        """Initial tip of every present tip, and the length grown from it along the surface.

        On a line: the first node on the way back behind which the surface was open from the
        beginning. On a surface: the nearest node of the initial front, and the distance to it
        (the length along the surface where that is flat).

        Returns:
            Slave nodes and lengths, shape (n_tips,) each.
        """
        x = self._surface.x
        if self._surface.dim == 2:
            away = np.linalg.norm(x[tips.node][:, None] - x[self.initial][None], axis=2)
            nearest = np.argmin(away, axis=1)
            return self.initial[nearest], away[np.arange(len(tips)), nearest]
        node, grown = tips.node.copy(), np.zeros(len(tips))
        for i in range(len(tips)):
            back = -tips.frame[i, :, 1]
            way = self._walk(int(node[i]), back, self._was_bonded, np.inf, straight=False)
            node[i], grown[i] = way.nodes[-1], way.s[-1]
        return node, grown

    def _walk(
        self, start: int, direction: Array, inside: Bools, reach: float, *, straight: bool
    ) -> Way:
        x = self._surface.x
        nodes, s = [start], [0.0]
        here, drift = start, np.zeros(3)
        seen = {start}
        while True:
            far = float(np.linalg.norm(x[here] - x[start])) if straight else s[-1]
            if far >= reach:
                break
            step = self._next(here, direction, drift, seen)
            if step is None or not inside[[k for k in step if k >= 0]].all():
                break
            middle, end = step
            for k in (middle, end):
                if k < 0:
                    continue
                way = x[k] - x[nodes[-1]]
                if self._surface.dim == 1:
                    s.append(s[-1] + float(np.linalg.norm(way)))
                else:
                    s.append(s[-1] + float(way @ self._tangent(nodes[-1], direction)))
                nodes.append(k)
            direction, drift = self._carry(here, end, direction, drift)
            seen.add(end)
            here = end
        return Way(np.array(nodes, dtype=np.int64), np.array(s), x[nodes])

    def _next(
        self, here: int, direction: Array, drift: Array, seen: set[int]
    ) -> tuple[int, int] | None:
        """Midside node (-1 in first order) and end of the next edge; ``None`` at an end."""
        links = self._front._links[here]
        new = [k for k in range(len(links)) if int(links[k, 0]) not in seen]
        if not new:
            return None
        vectors = self._surface.x[links[new, 0]] - self._surface.x[here]
        t = self._tangent(here, direction)
        advance = vectors @ t
        length = np.linalg.norm(vectors, axis=1)
        if self._surface.dim == 1:
            # a line has one way on; at its first node two, of which one is not backwards
            best = int(np.argmax(advance / length))
            if len(seen) == 1 and advance[best] <= 0.0:
                return None
        else:
            whole = vectors + drift
            score = np.where(
                advance > _ALIGNED * length, (whole @ t) / np.linalg.norm(whole, axis=1), -np.inf
            )
            best = int(np.argmax(score))
            if not np.isfinite(score[best]):
                return None
        end, middle = links[new[best]]
        return int(middle), int(end)

    def _tangent(self, node: int, direction: Array) -> Array:
        """A direction turned into the tangent plane at a node."""
        normal = self._surface.normals[node]
        t = direction - (direction @ normal) * normal
        length = float(np.linalg.norm(t))
        return np.asarray(t / length) if length > 0.0 else direction

    def _carry(self, here: int, end: int, direction: Array, drift: Array) -> tuple[Array, Array]:
        """Direction after a step, and how far the way has left the straight line sideways."""
        step = self._surface.x[end] - self._surface.x[here]
        if self._surface.dim == 1:
            return step, drift
        t = self._tangent(here, direction)
        normal = self._surface.normals[here]
        aside = drift + step - (step @ t) * t
        return t, aside - (aside @ normal) * normal
