"""Crack tips and fronts on a slave surface: place, growth direction, distances to neighbours.

A front node is a bonded slave node with an open neighbour along an edge. Its growth direction s is
minus the gradient of the open/bonded indicator over the facets around it, so it needs no
structured mesh; with the normal n and the front tangent t = n x s it forms the local frame.
The wake point lies where the ray -s leaves the facets around the node; openings are
interpolated there. Second-order surfaces use the corner-midside-corner lines of their facets.

The last bonded node between two open parts is a tip of both (:attr:`Tips.ligament`): it takes the
means of what lies on either side, so that neither the numbering of the nodes nor the orientation of
the line has a say. Where places are equal otherwise, :func:`first_by_place` decides.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InterfaceError
from fxcrack.interface.surface import FacetSurface
from fxcrack.interface.swept_area import SweptArea, facet_parts, nearest_heading, swept
from fxcrack.interface.tips import Tip, Tips, cross, first_by_place, gradient, norm

_EDGES = {
    "interval": ((0, 1),),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 3), (3, 2), (2, 0)),
}
# lines corner-midside-corner (and midside-centre-midside) of second-order facets, basix order
_LINES = {
    "interval": ((0, 2, 1),),
    "quadrilateral": ((0, 4, 1), (2, 7, 3), (0, 5, 2), (1, 6, 3), (5, 8, 6), (4, 8, 7)),
}


class Front:
    """Finds the front nodes of a partly bonded surface and keeps their geometry up to date.

    Args:
        surface: Slave surface.
        bonded: Initially bonded nodes, shape (n_nodes,).
        title: Name of the interface in messages.
        by_corners: Whether the facets are the corners of second-order triangles
            (:mod:`fxcrack.interface.hierarchy`): a node then stands for its part of the line of the
            front, and lengths are on one line only where nodes are.

    Attributes:
        surface: The slave surface where it is now (:meth:`follow`).
        title: Name of the interface.
        bonded: Nodes bonded now, shape (n_nodes,).
        version: Counts the changes of ``bonded``.
        placed: Counts the changes of position.
        tied: Bonded nodes that are no front nodes, shape (n_nodes,).
        links: Per node the ends and midside nodes (-1 in first order) of its edges, shape
            (n_edges, 2).

    Raises:
        InterfaceError: A second-order tip starts at a midside node.
    """

    def __init__(
        self, surface: FacetSurface, bonded: Bools, title: str, *, by_corners: bool = False
    ) -> None:
        self.surface = self._undeformed = surface
        self.title = title
        self._by_corners = by_corners
        self.bonded = bonded.copy()
        self.version = 0
        self.placed = 0
        self.tied = np.zeros(surface.n_nodes, dtype=bool)
        self._cache: dict[int, Tip | None] = {}
        facets = surface.facets
        flat = np.argsort(facets.ravel(), kind="stable")
        counts = np.bincount(facets.ravel(), minlength=surface.n_nodes)
        self._facets_of = np.split(flat // facets.shape[1], np.cumsum(counts)[:-1])
        # second-order triangles may be tied, but no crack-closure unit is defined on them
        self._has_units = surface.order == 1 or surface.kind in _LINES
        pattern = (_EDGES if surface.order == 1 else _LINES).get(surface.kind, ((0, 3, 1),))
        ends = np.concatenate([facets[:, [e[0], e[-1]]] for e in pattern])
        middle = (
            np.concatenate([facets[:, e[1]] for e in pattern])
            if surface.order == 2
            else np.full(len(ends), -1)
        )
        links = np.unique(np.column_stack([np.sort(ends, axis=1), middle]), axis=0)
        both = np.concatenate([links, links[:, [1, 0, 2]]])
        both = both[np.lexsort((both[:, 1], both[:, 0]))]
        split = np.searchsorted(both[:, 0], np.arange(1, surface.n_nodes))
        self.links = np.split(both[:, 1:], split)
        self._near = self._pad_links()
        self._is_middle = np.zeros(surface.n_nodes, dtype=bool)
        if surface.order == 2:
            self._check_middles(facets)
        self._was_bonded = self.bonded.copy()

    @property
    def _by_lines(self) -> bool:
        return self.surface.order == 2

    def _check_middles(self, facets: Ints) -> None:
        """The open part must cover whole element faces, so midside nodes follow their ends."""
        if not self._has_units:
            return
        if self.surface.dim == 2:
            # midsides of edges from corners first, then centres from midsides
            for first, middle, last in _LINES[self.surface.kind]:
                ends = facets[:, [first, last]]
                self.bonded[facets[:, middle]] = self.bonded[ends].all(axis=1)
        else:
            self._is_middle[facets[:, 2]] = True
            ends = self.bonded[facets[:, :2]].sum(axis=1)
            wrong = self.bonded[facets[:, 2]] & (ends == 0) | ~self.bonded[facets[:, 2]] & (
                ends == 2
            )
            if np.any(wrong):
                where = format_point(self.surface.x[facets[np.argmax(wrong), 2]])
                raise InterfaceError(
                    f"interface '{self.title}': the tip at {where} is a midside node; on "
                    "second-order faces the open part must cover whole element faces, "
                    "let the bonded set begin at a corner node"
                )
            # a midside node belongs to the bonded part only if both its corners do
            loose = self.bonded[facets[:, 2]] & (ends < 2)
            self.bonded[facets[loose, 2]] = False

    @cached_property
    def _headings(self) -> Array:
        """Growth direction per node, that of the initial front nearest to it, shape (n_nodes, 3).

        Zero where the surface has no front.
        """
        s = self._undeformed
        indicator = (~self._was_bonded).astype(float)
        corner = s.facets[:, : s.n_corners]
        mixed = (indicator[corner].sum(axis=1) > 0) & (indicator[corner].sum(axis=1) < s.n_corners)
        if not mixed.any():
            return np.zeros((s.n_nodes, 3))
        direction = np.array([-gradient(s, int(f), indicator)[0] for f in np.flatnonzero(mixed)])
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-300)
        return nearest_heading(s, s.x[corner[mixed]].mean(axis=1), direction)

    def swept(self, node: int, nodes: Ints) -> float:
        """Area that the front sweeps when a front node is released, length^2.

        The last nodes of the surface, with nothing ahead of them, and those between two open parts
        count with the area they stand for. See :mod:`fxcrack.interface.swept_area`.

        Args:
            node: The front node.
            nodes: Itself and what is released with it: midside nodes, the other nodes of an
                element edge; shape (n,).
        """
        s = self._undeformed
        tip = self.tip(node)
        if tip.d_ahead <= 0.0 or tip.ligament:
            return float(s.areas[nodes].sum())
        if s.dim == 1:
            return self._swept_on_line(node, int(tip.wake_nodes[0, 0]))
        heading = self._headings[node]
        growth = heading if self._by_lines else self._growth(node, s)
        if growth is None:
            return float(s.areas[nodes].sum())
        area = sum(self._sweep.of_node(int(k), growth) for k in nodes)
        return area if area > 0.0 else float(s.areas[nodes].sum())

    def _swept_on_line(self, node: int, behind: int) -> float:
        """Area swept over a corner node of a line, the open corner behind it given."""
        facets = self._undeformed.facets
        areas = self._facet_areas
        around = [int(f) for f in self._facets_of[node]]
        ahead = next(f for f in around if behind not in facets[f])
        back = next(f for f in around if behind in facets[f])
        end = next(int(k) for k in facets[ahead, :2] if k != node)
        beyond = next((int(f) for f in self._facets_of[end] if f != ahead), ahead)
        grown = bool(self._was_bonded[behind])
        return swept(
            areas[ahead], areas[back if grown else ahead], areas[beyond], self._undeformed.order
        )

    @cached_property
    def _facet_areas(self) -> Array:
        """Areas of the facets of the undeformed surface, shape (n_facets,), length^2."""
        return facet_parts(self._undeformed).sum(axis=1)

    @cached_property
    def _sweep(self) -> SweptArea:
        return SweptArea(self._undeformed, self._headings, self._was_bonded)

    def follow(self, x: Array) -> None:
        """Take the slave nodes at other positions: the current configuration.

        Frames turn with it. Lengths and areas stay those of the undeformed surface: toughness is
        energy per undeformed area, as the open area of the history is, and so does not depend on
        how the face that is the slave has stretched.

        Args:
            x: Present positions, shape (n_nodes, 3), length.
        """
        self.surface = self.surface.moved(x)
        self.placed += 1
        self._cache.clear()

    def release(self, nodes: Ints) -> None:
        """Release slave nodes, shape (n,), and discard the cached geometry around them."""
        self._set(nodes, bonded=False)

    def undeformed(self) -> Front:
        """The front where the bodies are undeformed; this one stays."""
        out = copy(self)
        out.surface, out._cache = self._undeformed, {}
        return out

    def without(self, nodes: Ints) -> Front:
        """The front as releasing slave nodes, shape (n,), would leave it; this one stays."""
        out = copy(self)
        out.bonded, out._cache = self.bonded.copy(), {}
        out.bonded[nodes] = False
        return out

    def bond(self, nodes: Ints) -> None:
        """Bond slave nodes, shape (n,), again whose release is undone."""
        self._set(nodes, bonded=True)

    def _set(self, nodes: Ints, *, bonded: bool) -> None:
        self.bonded[nodes] = bonded
        self.version += 1
        for node in nodes:
            for facet in self._facets_of[node]:
                for other in self.surface.facets[facet]:
                    for second in self._facets_of[other]:
                        for third in self.surface.facets[second]:
                            self._cache.pop(int(third), None)

    def neighbours(self, node: int) -> Ints:
        """Nodes linked to a node along an edge, shape (n_edges,)."""
        return np.asarray(self.links[node][:, 0])

    def candidates(self) -> Ints:
        """Front nodes, ascending, shape (n_tips,).

        Raises:
            InterfaceError: The faces are second-order triangles.
        """
        if not self._has_units:
            raise InterfaceError(
                f"interface '{self.title}' has second-order triangular faces with a jump of its "
                "own at every node, on which no crack-closure unit is defined: only interfaces of "
                "Scene(debonds=...) have a front there, not those of Scene(bonds=...)"
            )
        bonded = np.flatnonzero(self.bonded & ~self._is_middle & ~self.tied)
        ends, middles = self._near
        far = ends[bonded]
        is_open = (far >= 0) & ~self.bonded[far]
        if self._by_lines:
            middle = middles[bonded]
            is_open &= ~self.bonded[middle]
            if self.surface.dim == 2:
                back = self.surface.x[bonded][:, None] - self.surface.x[far]
                length = np.linalg.norm(back, axis=2)
                along = np.einsum("nkc,nc->nk", back, self._headings[bonded])
                is_open &= along > 0.7 * length
        return bonded[is_open.any(axis=1)]

    def _pad_links(self) -> tuple[Ints, Ints]:
        width = max(len(link) for link in self.links)
        ends = np.full((self.surface.n_nodes, width), -1, dtype=np.int64)
        middles = np.full((self.surface.n_nodes, width), -1, dtype=np.int64)
        for i, link in enumerate(self.links):
            ends[i, : len(link)], middles[i, : len(link)] = link[:, 0], link[:, 1]
        return ends, middles

    def tips(self) -> Tips:
        """All front nodes with their geometry."""
        found = [self.tip(int(i)) for i in self.candidates()]
        k = 2 if self._by_lines else 1
        if not found:
            e, z = np.zeros(0, dtype=np.int64), np.zeros(0)
            return Tips(e, e.reshape(0, k), np.zeros((0, k, 2), dtype=np.int64),
                        np.zeros((0, k, 2)), np.zeros((0, 3, 3)), z, z, z, z,
                        e.reshape(0, 2), np.zeros((0, 2)), z, z > 0.0, z > 0.0)  # fmt: skip
        return Tips(
            np.array([t.node for t in found]),
            np.array([t.force_nodes for t in found]),
            np.array([t.wake_nodes for t in found]),
            np.array([t.wake_weights for t in found]),
            np.array([t.frame for t in found]),
            np.array([t.d_ahead for t in found]),
            np.array([t.d_behind for t in found]),
            np.array([t.width for t in found]),
            np.array([t.area for t in found]),
            np.array([t.further_nodes for t in found]),
            np.array([t.further_weights for t in found]),
            np.array([t.d_further for t in found]),
            np.array([t.straight for t in found], dtype=bool),
            np.array([t.ligament for t in found], dtype=bool),
        )

    def tip(self, node: int) -> Tip:
        """Geometry of one front node."""
        found = self._cache.get(node)
        if found is None:
            find = self._tip_on_lines if self._by_lines else self._tip
            found = find(node, self._undeformed)
            if self.surface is not self._undeformed:
                found = replace(found, frame=find(node, self.surface).frame)
            self._cache[node] = found
        return found

    def _growth(self, node: int, s: FacetSurface) -> Array | None:
        """Unit growth direction in the tangent plane; None where it is open on opposite sides."""
        indicator = (~self.bonded).astype(float)
        total = np.zeros(3)
        scale = 0.0
        for facet in self._facets_of[node]:
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
        reference = self._undeformed.x
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
        ends = self.neighbours(node)
        ends = ends[~self.bonded[ends]]
        growth, both, mean = self._across(node, s, ends)
        area = float(s.areas[node])
        width = float(s.breadth[node]) if s.dim == 1 else area / mean
        return Tip(
            node, np.array([node]), ends[both][None], np.array([[0.5, 0.5]]),
            self._frame(node, growth, s), mean, mean, width, area,
            ends[both], np.array([0.5, 0.5]), 0.0, False, True,
        )  # fmt: skip

    def _tip(self, node: int, s: FacetSurface) -> Tip:
        growth = self._growth(node, s)
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
        for facet in self._facets_of[node]:
            corners = s.facets[facet, : s.n_corners]
            other = corners[self.bonded[corners] & (corners != node)]
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
            ends = [int(k) for k in self.neighbours(corner) if int(k) != node]
            if not ends or self.bonded[ends[0]]:
                return none
            step = norm(s.x[ends[0]] - s.x[corner])
            return np.array([ends[0], ends[0]]), np.array([1.0, 0.0]), d_behind + step
        held = wake[weights > 0.0].tolist()
        facets = set(self._facets_of[held[0]].tolist())
        for k in held[1:]:
            facets &= set(self._facets_of[k].tolist())
        side, origin = cross(s.normals[node], back), s.x[node]
        best: tuple[float, Ints, Array] | None = None
        for facet in sorted(facets - set(self._facets_of[node].tolist())):
            corner_nodes = s.facets[facet, : s.n_corners]
            for a, b in _EDGES[s.kind]:
                i, j = int(corner_nodes[a]), int(corner_nodes[b])
                if i in held and j in held:
                    continue
                at = _crossing(s.x[i] - origin, s.x[j] - origin, back, side)
                if at is None or at[0] < d_behind * (1.0 + 1e-6):
                    continue
                if best is None or at[0] < best[0] * (1.0 - 1e-9):
                    best = at[0], np.array([i, j]), np.array([1.0 - at[1], at[1]])
        if best is None or self.bonded[best[1][best[2] > 0.0]].any():
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
            for facet in self._facets_of[node]:
                corner = s.facets[facet, : s.n_corners]
                for a, b in _EDGES[s.kind]:
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
        near = [k for k in self.neighbours(node) if not open_side or not self.bonded[k]]
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
        heading = self._headings[node]
        links = self.links[node]
        vectors = s.x[links[:, 0]] - s.x[node]
        length = np.linalg.norm(vectors, axis=1)
        is_open = ~self.bonded[links[:, 0]] & ~self.bonded[links[:, 1]]
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
        if cosine[ahead] < 0.3 or ahead == behind or not self.bonded[links[ahead, 1]]:
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
        links = self.links[corner]
        vectors = s.x[links[:, 0]] - s.x[corner]
        length = np.linalg.norm(vectors, axis=1)
        best = int(np.argmax(vectors @ back / length))
        far = int(links[best, 0])
        same = np.array([corner, corner]), np.array([1.0, 0.0])
        if (vectors[best] @ back) < 0.7 * length[best] or self.bonded[links[best]].any():
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


def why_no_tip(front: Front) -> str:
    """Why an interface has no tip, with where its slave nodes are, in words."""
    n, x = int(front.bonded.sum()), front.surface.x
    x = np.where(np.abs(x) < 1e-9 * np.ptp(x), 0.0, x)
    share = {0: "none", len(x): "all"}.get(n, f"{n}")
    return (
        f"interface '{front.title}' has no crack tip: {share} of its {len(x)} slave nodes, between "
        f"{format_point(x.min(axis=0))} and {format_point(x.max(axis=0))}, are bonded, and no open "
        "one is beside a bonded one"
    )
