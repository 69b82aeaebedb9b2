"""Paths along a slave surface from a tip, over the bonded part ahead or the open part behind.

On a line (2-D) the path is the line itself, whatever its shape. On a surface (3-D) it is the mesh
line most nearly along the growth direction; each step counts with its component in that direction,

    s_(k+1) = s_k + (x_(k+1) - x_k) . t_k,    t_k the direction in the tangent plane at node k,

so that a zig-zag line is as long as the straight one it follows. Positions are those of the front:
the current ones where bodies move far.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.errors import InputError
from fxcrack.interface.front import Front
from fxcrack.interface.projection import project
from fxcrack.interface.surface import FacetSurface
from fxcrack.interface.tips import Tips

_ALIGNED = 0.1
"""Least cosine between a step and the direction of the path on a surface (3-D)."""


@dataclass(frozen=True)
class SurfacePath:
    """A path along the nodes of a slave surface.

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


@dataclass(frozen=True)
class Origins:
    """Where the present tips come from.

    Attributes:
        nodes: Initial tips on either side of the origin (twice the same where it is one), shape
            (n_tips, 2).
        weights: Their weights, shape (n_tips, 2).
        grown: Length from the origin to the tip along the surface, shape (n_tips,).
    """

    nodes: Ints
    weights: Array
    grown: Array

    @property
    def nearest(self) -> Ints:
        """The initial tip that the origin is nearest to, shape (n_tips,)."""
        return np.asarray(self.nodes[np.arange(len(self.nodes)), self.weights.argmax(axis=1)])


class SurfacePaths:
    """Paths along one slave surface, and where the present tips come from.

    Args:
        front: Front of the interface in its initial state, which is remembered.

    Attributes:
        longest: Longest edge of a face, length.
        initial: Nodes of the initial front.
    """

    def __init__(self, front: Front) -> None:
        self._front = front
        self._was_bonded = front.bonded.copy()
        self.initial = front.candidates()
        corner = self._surface.x[self._surface.facets[:, : self._surface.n_corners]]
        between = np.linalg.norm(corner[:, :, None] - corner[:, None], axis=-1)
        self.longest = float(between.max())
        self._pieces = self._initial_pieces() if self._surface.dim == 2 else np.zeros((0, 2), int)
        n = self._surface.n_nodes
        self._origin = np.zeros((n, 2), dtype=np.int64)
        self._weights = np.zeros((n, 2))
        self._grown = np.full(n, np.nan)

    @property
    def _surface(self) -> FacetSurface:
        """The slave surface where it is now."""
        return self._front.surface

    def ahead(self, tips: Tips, i: int, reach: float) -> SurfacePath:
        """Path over bonded nodes ahead of a tip, until it is ``reach`` long or no node follows.

        Args:
            tips: Present front.
            i: Which of them.
            reach: Distance along the surface, length.
        """
        growth = tips.frame[i, :, 1]
        return self._walk(int(tips.node[i]), growth, self._front.bonded, reach, straight=False)

    def behind(self, tips: Tips, i: int, reach: float, inside: Bools) -> SurfacePath:
        """Path backwards from a tip, until a node is ``reach`` away from it or none follows.

        Args:
            tips: Present front.
            i: Which of them.
            reach: Straight-line distance from the tip, length.
            inside: Nodes that may be entered, shape (n_nodes,).
        """
        back = -tips.frame[i, :, 1]
        return self._walk(int(tips.node[i]), back, inside, reach, straight=True)

    def origins(self, tips: Tips) -> Origins:
        """Origin of every present tip on the initial front, and the length grown from there.

        On a line: the first node on the path back behind which the surface was open from the
        beginning. On a surface: the foot of the perpendicular on the initial front, a chain of
        straight pieces between its nodes. The length is that of the straight line between the two,
        laid on the surface (exact on planes, and across the axis of cylinders).
        """
        if self._surface.dim == 2:
            new = tips.node[np.isnan(self._grown[tips.node])]
            if len(new):
                self._trace(new)
            return Origins(
                self._origin[tips.node], self._weights[tips.node], self._grown[tips.node]
            )
        node, grown = tips.node.copy(), np.zeros(len(tips))
        for i in range(len(tips)):
            back = -tips.frame[i, :, 1]
            path = self._walk(int(node[i]), back, self._was_bonded, np.inf, straight=False)
            node[i], grown[i] = path.nodes[-1], path.s[-1]
        return Origins(np.stack([node, node], axis=1), np.tile([1.0, 0.0], (len(node), 1)), grown)

    def _initial_pieces(self) -> Ints:
        """Pairs of initial front nodes that share a facet cut by the front, shape (n, 2)."""
        at_front = np.zeros(self._surface.n_nodes, dtype=bool)
        at_front[self.initial] = True
        pieces = [(int(k), int(k)) for k in self.initial]
        for facet in self._surface.facets[(~self._was_bonded[self._surface.facets]).any(axis=1)]:
            pieces += combinations(facet[at_front[facet]].tolist(), 2)
        return np.array(pieces, dtype=np.int64).reshape(-1, 2)

    def _trace(self, nodes: Ints) -> None:
        """Find the origins of nodes on a surface; they do not change any more."""
        x = self._surface.x
        a, b = self._pieces.T
        along = x[b] - x[a]
        square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
        for node in nodes:
            part = np.clip(((x[node] - x[a]) * along).sum(axis=1) / square, 0.0, 1.0)
            away = np.linalg.norm(x[a] + part[:, None] * along - x[node], axis=1)
            k = int(np.argmin(away))
            foot = x[a[k]] + part[k] * along[k]
            self._origin[node] = a[k], b[k]
            self._weights[node] = 1.0 - part[k], part[k]
            self._grown[node] = self._laid(foot, x[node])

    def _laid(self, start: Array, end: Array) -> float:
        """Length of the straight line between two points, projected on the surface."""
        straight = float(np.linalg.norm(end - start))
        normals = self._surface.normals
        if straight == 0.0 or np.abs(normals - normals[0]).max() < 1e-9:
            return straight
        steps = 4 * math.ceil(straight / self.longest)
        line = start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (end - start)
        return float(
            np.linalg.norm(np.diff(project(line, self._surface).foot, axis=0), axis=1).sum()
        )

    def _walk(
        self, start: int, direction: Array, inside: Bools, reach: float, *, straight: bool
    ) -> SurfacePath:
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
                step_to = x[k] - x[nodes[-1]]
                if self._surface.dim == 1:
                    s.append(s[-1] + float(np.linalg.norm(step_to)))
                else:
                    s.append(s[-1] + float(step_to @ self._tangent(nodes[-1], direction)))
                nodes.append(k)
            direction, drift = self._carry(here, end, direction, drift)
            seen.add(end)
            here = end
        return SurfacePath(np.array(nodes, dtype=np.int64), np.array(s), x[nodes])

    def _next(
        self, here: int, direction: Array, drift: Array, seen: set[int]
    ) -> tuple[int, int] | None:
        """Midside node (-1 in first order) and end of the next edge; ``None`` at an end."""
        links = self._front.links[here]
        new = [k for k in range(len(links)) if int(links[k, 0]) not in seen]
        if not new:
            return None
        vectors = self._surface.x[links[new, 0]] - self._surface.x[here]
        t = self._tangent(here, direction)
        advance = vectors @ t
        length = np.linalg.norm(vectors, axis=1)
        if self._surface.dim == 1:
            # a line goes on in one direction; from its first node in two, one of them backwards
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
        """Direction after a step, and how far the path is beside the straight line."""
        step = self._surface.x[end] - self._surface.x[here]
        if self._surface.dim == 1:
            return step, drift
        t = self._tangent(here, direction)
        normal = self._surface.normals[here]
        aside = drift + step - (step @ t) * t
        return t, aside - (aside @ normal) * normal


def locate(owner: str, points: npt.ArrayLike, distance: float, order: int) -> tuple[slice, Array]:
    """Face and shape-function weights of the point at a straight-line distance from the first one.

    Args:
        owner: Who asks, for messages.
        points: Positions of the nodes of the path from the tip on, shape (m, dim) [length].
        distance: Straight-line distance from ``points[0]`` [length].
        order: Order of the faces, 1 or 2.

    Returns:
        The rows of the face's nodes and their weights, shape (order + 1,): the value there is
        ``weights @ values[rows]``. Of several such points the first one on the path.

    Raises:
        InputError: The path ends before the distance, or is no path of faces of this order.
    """
    x = np.asarray(points, dtype=np.float64)
    if order not in (1, 2) or x.ndim != 2 or len(x) < order + 1 or (len(x) - 1) % order:
        raise InputError(
            f"{owner}: a path of order {order} cannot have points of shape {x.shape}; first order "
            "needs at least 2 nodes, second order an odd number of at least 3: corner, midside, ..."
        )
    radius = np.linalg.norm(x - x[0], axis=1)
    if not np.isfinite(radius).all():
        raise InputError(f"{owner}: the path of face nodes contains NaN or infinite positions")
    reach = float(radius[::order].max())
    # A distance equal to the end of the path must not fail by round-off.
    if not 0.0 <= distance <= reach * (1.0 + 1e-12):
        raise InputError(
            f"{owner}: the distance {distance:g} lies outside the end points of the surface: the "
            f"path of face nodes reaches {reach:g} from the tip; give a distance between 0 and "
            "that, or extend the surfaces"
        )
    face = int(np.argmax(radius[order::order] >= min(distance, reach)))
    rows = slice(face * order, (face + 1) * order + 1)
    return rows, _weights(_solve(x[rows] - x[0], min(distance, reach), order), order)


def _weights(xi: float, order: int) -> Array:
    """Lagrange shape functions on [-1, 1], nodes in the order of the path."""
    if order == 1:
        return np.array([(1.0 - xi) / 2.0, (1.0 + xi) / 2.0])
    return np.array([xi * (xi - 1.0) / 2.0, 1.0 - xi * xi, xi * (xi + 1.0) / 2.0])


def _solve(x: Array, distance: float, order: int) -> float:
    """Coordinate xi on one face with |x(xi)| = distance: Newton inside a shrinking bracket."""
    low, high = -1.0, 1.0
    radius = np.linalg.norm(x, axis=1)
    gain = radius[-1] - radius[0]
    xi = -1.0 + 2.0 * float((distance - radius[0]) / gain) if gain > 0.0 else 1.0
    for _ in range(100):  # bisection alone needs 53
        point = _weights(xi, order) @ x
        slopes = np.array([-0.5, 0.5] if order == 1 else [xi - 0.5, -2.0 * xi, xi + 0.5])
        r = float(np.linalg.norm(point))
        miss = r - distance
        if abs(miss) <= 4e-16 * distance:
            break
        if miss > 0.0:
            high = xi
        else:
            low = xi
        slope = float(point @ (slopes @ x)) / r if r > 0.0 else 0.0
        step = xi - miss / slope if slope > 0.0 else np.inf
        new = float(step) if low < step < high else (low + high) / 2.0
        if abs(new - xi) <= 1e-16:
            break
        xi = new
    return xi
