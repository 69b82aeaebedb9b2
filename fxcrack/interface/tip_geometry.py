"""Geometry of one front node: growth direction, distances, wake points, width and area.

The growth direction s is minus the gradient of the open/bonded indicator over the facets around the
node, so it needs no structured mesh; with the normal n and the front tangent t = n x s it forms the
local frame. The wake point lies where the ray -s leaves the facets around the node. Second-order
surfaces use the corner-midside-corner lines of their facets.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.interface.node_links import EDGES, NodeLinks
from fxcrack.interface.surface import FacetSurface
from fxcrack.interface.tips import Tip, cross, first_by_place, gradient, norm


class TipGeometry:
    """Finds the geometry of front nodes while some nodes of the surface are bonded.

    Args:
        links: Facets and edges at each node.
        reference: The undeformed surface.
        bonded: Nodes bonded now, shape (n_nodes,); not copied.
        headings: Growth direction per node of a second-order surface, shape (n_nodes, 3); ``None``
            for first order.
        by_corners: As for :class:`~fxcrack.interface.front.Front`.
    """

    def __init__(
        self,
        links: NodeLinks,
        reference: FacetSurface,
        bonded: Bools,
        headings: Array | None,
        *,
        by_corners: bool,
    ) -> None:
        self._links = links
        self._reference = reference
        self._bonded = bonded
        self._headings = headings
        self._by_corners = by_corners

    def tip(self, node: int, surface: FacetSurface) -> Tip:
        """Geometry of one front node; its frame is that of the surface where it is now.

        Args:
            node: The node.
            surface: The surface where it is now.
        """
        find = self._tip if self._headings is None else self._tip_on_lines
        found = find(node, self._reference)
        if surface is not self._reference:
            found = replace(found, frame=find(node, surface).frame)
        return found

    def growth(self, node: int, s: FacetSurface) -> Array | None:
        """Unit growth direction in the tangent plane; None where it is open on opposite sides."""
        indicator = (~self._bonded).astype(float)
        total = np.zeros(3)
        scale = 0.0
        for facet in self._links.facets_of[node]:
            slope, size = gradient(s, int(facet), indicator)
            total -= size * slope
            scale += size * norm(slope)
        normal = s.normals[node]
        total -= (total @ normal) * normal
        length = norm(total)
        if length < 1e-6 * max(scale, 1e-300):
            return None
        return np.asarray(total / length)

    def _frame(self, node: int, growth: Array, s: FacetSurface) -> Array:
        normal = -s.normals[node]
        return np.array([normal, growth, cross(normal, growth)]).T

    def _across(self, node: int, s: FacetSurface, ends: Ints) -> tuple[Array, Ints, float]:
        """Opposite open neighbours of a node between two open parts.

        Args:
            node: The node.
            s: The surface, where it is now or undeformed.
            ends: Its open neighbours, shape (k,).

        Returns:
            Unit vector in the tangent plane away from the nearest of them; positions in ``ends`` of
            that and of the one most nearly opposite to it, shape (2,), twice the same where none
            is; their mean distance, length.
        """
        # the undeformed surface chooses, so that bodies that move do not change it
        reference = self._reference.x
        length = np.linalg.norm(reference[ends] - reference[node], axis=1)
        near = first_by_place(-length, reference[ends])
        normal = s.normals[node]
        growth = s.x[node] - s.x[ends[near]]
        growth = growth - (growth @ normal) * normal
        growth = growth / norm(growth)
        back = reference[node] - reference[ends[near]]
        cosine = (reference[ends] - reference[node]) @ back / (length * length[near])
        far = first_by_place(cosine, reference[ends])
        both = np.array([near, far if cosine[far] >= 0.3 else near])
        return np.asarray(growth), both, float(length[both].mean())

    def _ligament(self, node: int, s: FacetSurface) -> Tip:
        """Geometry of a first-order node between two open parts: means of both sides."""
        ends = self._links.neighbours(node)
        ends = ends[~self._bonded[ends]]
        growth, both, mean = self._across(node, s, ends)
        area = float(s.areas[node])
        width = float(s.breadth[node]) if s.dim == 1 else area / mean
        return Tip(
            node, np.array([node]), ends[both][None], np.array([[0.5, 0.5]]),
            self._frame(node, growth, s), mean, mean, width, area,
            ends[both], np.array([0.5, 0.5]), 0.0, False, True,
        )  # fmt: skip

    def _tip(self, node: int, s: FacetSurface) -> Tip:
        growth = self.growth(node, s)
        if growth is None:
            return self._ligament(node, s)
        d_behind, wake, weights, met = self._ray(node, -growth, s, open_side=True)
        d_ahead, ahead, at_ahead, met_ahead = self._ray(node, growth, s, open_side=False)
        if s.dim == 1:
            width = float(s.breadth[node])
            across = 0.5 * (width + float(s.breadth[ahead[0]]))
        else:
            width = across = float(s.areas[node]) / (0.5 * (d_ahead + d_behind))
        area = across * d_ahead if d_ahead > 0.0 else float(s.areas[node])
        straight = met and met_ahead
        if self._by_corners:
            width = max(self._front_part(node, s), 0.5 * width)
            straight &= bool(weights.max() == 1.0 and at_ahead.max() == 1.0)
        return Tip(
            node, np.array([node]), wake[None], weights[None], self._frame(node, growth, s),
            d_ahead, d_behind, width, area,
            *self._further(node, wake, weights, d_behind, -growth, s), straight,
        )  # fmt: skip

    def _front_part(self, node: int, s: FacetSurface) -> float:
        """Half the length of the edges at a node along which the front runs, length.

        They belong to facets whose third corner is open.
        """
        total = 0.0
        for facet in self._links.facets_of[node]:
            corners = s.facets[facet, : s.n_corners]
            other = corners[self._bonded[corners] & (corners != node)]
            if len(other) == 1:
                total += 0.5 * norm(s.x[other[0]] - s.x[node])
        return total

    def _further(
        self, node: int, wake: Ints, weights: Array, d_behind: float, back: Array, s: FacetSurface
    ) -> tuple[Ints, Array, float]:
        """The next point behind the wake point: two nodes, their weights, distance from the tip.

        On a line the next node; on a surface where the ray leaves the facets behind the wake
        point. The distance is 0 where there is none or a part of it is bonded.
        """
        none = wake, weights, 0.0
        if s.dim == 1:
            corner = int(wake[0])
            ends = [int(k) for k in self._links.neighbours(corner) if int(k) != node]
            if not ends or self._bonded[ends[0]]:
                return none
            step = norm(s.x[ends[0]] - s.x[corner])
            return np.array([ends[0], ends[0]]), np.array([1.0, 0.0]), d_behind + step
        held = wake[weights > 0.0].tolist()
        facets = set(self._links.facets_of[held[0]].tolist())
        for k in held[1:]:
            facets &= set(self._links.facets_of[k].tolist())
        side, origin = cross(s.normals[node], back), s.x[node]
        best: tuple[float, Ints, Array] | None = None
        for facet in sorted(facets - set(self._links.facets_of[node].tolist())):
            corner_nodes = s.facets[facet, : s.n_corners]
            for a, b in EDGES[s.kind]:
                i, j = int(corner_nodes[a]), int(corner_nodes[b])
                if i in held and j in held:
                    continue
                at = _crossing(s.x[i] - origin, s.x[j] - origin, back, side)
                if at is None or at[0] < d_behind * (1.0 + 1e-6):
                    continue
                if best is None or at[0] < best[0] * (1.0 - 1e-9):
                    best = at[0], np.array([i, j]), np.array([1.0 - at[1], at[1]])
        if best is None or self._bonded[best[1][best[2] > 0.0]].any():
            return none
        return best[1], best[2], best[0]

    def _ray(
        self, node: int, direction: Array, s: FacetSurface, *, open_side: bool
    ) -> tuple[float, Ints, Array, bool]:
        """Where a ray leaves the facets around a node: distance, two nodes, their weights.

        The last value says whether it does so at all: at an edge the ray may leave the surface at
        once, and the best aligned neighbour stands for it.
        """
        origin = s.x[node]
        best: tuple[float, Ints, Array] | None = None
        if s.dim == 2:
            side = cross(s.normals[node], direction)
            for facet in self._links.facets_of[node]:
                corner = s.facets[facet, : s.n_corners]
                for a, b in EDGES[s.kind]:
                    i, j = corner[a], corner[b]
                    if node in (i, j):
                        continue
                    found = _crossing(s.x[i] - origin, s.x[j] - origin, direction, side)
                    if found is None:
                        continue
                    distance, w = found
                    if distance > 0.0 and (best is None or distance < best[0] * (1.0 - 1e-9)):
                        best = distance, np.array([i, j]), np.array([1.0 - w, w])
            if best is not None:
                return *best, True
        # along a line, or where the ray leaves the surface at once: the best aligned neighbour
        near = [k for k in self._links.neighbours(node) if not open_side or not self._bonded[k]]
        vectors = s.x[near] - origin if near else np.zeros((0, 3))
        length = np.linalg.norm(vectors, axis=1)
        cosine = vectors @ direction / np.where(length > 0.0, length, 1.0)
        on_line = s.dim == 1
        if not near or cosine.max() < 0.3:
            if open_side:
                k = first_by_place(-length, s.x[near])
                return float(length[k]), np.array([near[k], near[k]]), np.array([1.0, 0.0]), on_line
            return 0.0, np.array([node, node]), np.array([1.0, 0.0]), on_line
        k = first_by_place(cosine, s.x[near])
        return float(length[k]), np.array([near[k], near[k]]), np.array([1.0, 0.0]), on_line

    def _tip_on_lines(self, node: int, s: FacetSurface) -> Tip:
        assert self._headings is not None
        heading = self._headings[node]
        links = self._links.links[node]
        vectors = s.x[links[:, 0]] - s.x[node]
        length = np.linalg.norm(vectors, axis=1)
        is_open = ~self._bonded[links[:, 0]] & ~self._bonded[links[:, 1]]
        if s.dim == 1 and is_open.sum() > 1:
            return self._ligament_on_line(node, s, links[is_open])
        if s.dim == 1:
            behind = int(np.argmax(is_open))
        else:
            along = np.where(is_open, -(vectors @ heading) / length, -2.0)
            behind = first_by_place(along, s.x[links[:, 0]])
        growth = -vectors[behind] / length[behind]
        normal = s.normals[node]
        growth = growth - (growth @ normal) * normal
        growth /= np.linalg.norm(growth)
        cosine = vectors @ growth / length
        ahead = first_by_place(cosine, s.x[links[:, 0]])
        corner, middle = links[behind]
        if cosine[ahead] < 0.3 or ahead == behind or not self._bonded[links[ahead, 1]]:
            # the surface ends, or the tip on the other side has released the midside node
            force_nodes, d_ahead = np.array([node, node]), 0.0
        else:
            force_nodes, d_ahead = np.array([node, links[ahead, 1]]), float(length[ahead])
        d_behind = float(length[behind])
        if s.dim == 1:
            width = float(s.breadth[node])
            across = 0.5 * (width + float(s.breadth[links[ahead, 0]]))
        else:
            # a midside node between two facets collects both; a line has one facet on each side
            width = across = float(s.areas[middle]) / (d_behind * 2.0 / 3.0)
        return Tip(
            node, force_nodes, np.array([[corner, corner], [middle, middle]]),
            np.array([[1.0, 0.0], [1.0, 0.0]]), self._frame(node, growth, s), d_ahead, d_behind,
            width, across * d_ahead if d_ahead > 0.0 else 0.5 * width * d_behind,
            *self._further_corner(int(corner), d_behind, -growth, s), True,
        )  # fmt: skip

    def _ligament_on_line(self, node: int, s: FacetSurface, links: Ints) -> Tip:
        """Geometry of a second-order corner node between two open parts: means of both sides.

        Args:
            node: The node.
            s: The surface, where it is now or undeformed.
            links: Its open neighbours and the midside nodes before them, shape (k, 2).
        """
        growth, both, mean = self._across(node, s, links[:, 0])
        width = float(s.breadth[node])
        # both tips have released their midside nodes: half of an element is left, of their mean
        return Tip(
            node, np.array([node, node]), links[both].T, np.full((2, 2), 0.5),
            self._frame(node, growth, s), 0.0, mean, width, 0.5 * width * mean,
            links[both, 0], np.array([0.5, 0.5]), 0.0, False, True,
        )  # fmt: skip

    def _further_corner(
        self, corner: int, d_behind: float, back: Array, s: FacetSurface
    ) -> tuple[Ints, Array, float]:
        """The corner node behind a wake corner, as :meth:`_further` gives it."""
        links = self._links.links[corner]
        vectors = s.x[links[:, 0]] - s.x[corner]
        length = np.linalg.norm(vectors, axis=1)
        best = int(np.argmax(vectors @ back / length))
        far = int(links[best, 0])
        same = np.array([corner, corner]), np.array([1.0, 0.0])
        if (vectors[best] @ back) < 0.7 * length[best] or self._bonded[links[best]].any():
            return *same, 0.0
        return np.array([far, far]), same[1], d_behind + float(length[best])


def _crossing(pi: Array, pj: Array, direction: Array, side: Array) -> tuple[float, float] | None:
    """Where a ray from the origin crosses an edge: distance and weight of its second end.

    Args:
        pi: First end, shape (3,), length.
        pj: Second end, likewise.
        direction: Unit vector of the ray, shape (3,).
        side: Unit vector across it in the surface, shape (3,).
    """
    ci, cj = float(pi @ side), float(pj @ side)
    if abs(ci - cj) < 1e-300:
        return None
    w = ci / (ci - cj)
    if not -1e-6 <= w <= 1.0 + 1e-6:
        return None
    w = 0.0 if abs(w) < 1e-6 else 1.0 if abs(w - 1.0) < 1e-6 else w
    return float(((1.0 - w) * pi + w * pj) @ direction), w
