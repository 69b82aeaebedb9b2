"""Crack tips and fronts on a slave surface: place, growth direction, distances to neighbours.

A front node is a bonded slave node with an open neighbour along an edge; its geometry is that of
:mod:`fxcrack.interface.tip_geometry`.

The last bonded node between two open parts is a tip of both (:attr:`Tips.ligament`): it takes the
means of what lies on either side, so that neither the numbering of the nodes nor the orientation of
the line has a say. Where places are equal otherwise, :func:`first_by_place` decides.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InterfaceError
from fxcrack.interface.node_links import LINES, NodeLinks
from fxcrack.interface.surface import FacetSurface
from fxcrack.interface.swept_area import SweptArea, facet_parts, nearest_heading, swept
from fxcrack.interface.tip_geometry import TipGeometry
from fxcrack.interface.tips import Tip, Tips, gradient


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
        self._links = NodeLinks(surface)
        self._is_middle = np.zeros(surface.n_nodes, dtype=bool)
        if surface.order == 2:
            self._check_middles(surface.facets)
        self._was_bonded = self.bonded.copy()

    @property
    def _by_lines(self) -> bool:
        return self.surface.order == 2

    def _check_middles(self, facets: Ints) -> None:
        """The open part must cover whole element faces, so midside nodes follow their ends."""
        if not self._links.has_units:
            return
        if self.surface.dim == 2:
            # midsides of edges from corners first, then centres from midsides
            for first, middle, last in LINES[self.surface.kind]:
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
        growth = heading if self._by_lines else self._geometry.growth(node, s)
        if growth is None:
            return float(s.areas[nodes].sum())
        area = sum(self._sweep.of_node(int(k), growth) for k in nodes)
        return area if area > 0.0 else float(s.areas[nodes].sum())

    def _swept_on_line(self, node: int, behind: int) -> float:
        """Area swept over a corner node of a line, the open corner behind it given."""
        facets = self._undeformed.facets
        areas = self._facet_areas
        around = [int(f) for f in self._links.facets_of[node]]
        ahead = next(f for f in around if behind not in facets[f])
        back = next(f for f in around if behind in facets[f])
        end = next(int(k) for k in facets[ahead, :2] if k != node)
        beyond = next((int(f) for f in self._links.facets_of[end] if f != ahead), ahead)
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
            for facet in self._links.facets_of[node]:
                for other in self.surface.facets[facet]:
                    for second in self._links.facets_of[other]:
                        for third in self.surface.facets[second]:
                            self._cache.pop(int(third), None)

    @property
    def links(self) -> list[Ints]:
        """Per node the ends and midside nodes (-1 in first order) of its edges, (n_edges, 2)."""
        return self._links.links

    def neighbours(self, node: int) -> Ints:
        """Nodes linked to a node along an edge, shape (n_edges,)."""
        return self._links.neighbours(node)

    def candidates(self) -> Ints:
        """Front nodes, ascending, shape (n_tips,).

        Raises:
            InterfaceError: The faces are second-order triangles.
        """
        if not self._links.has_units:
            raise InterfaceError(
                f"interface '{self.title}' has second-order triangular faces with a jump of its "
                "own at every node, on which no crack-closure unit is defined: only interfaces of "
                "Scene(debonds=...) have a front there, not those of Scene(bonds=...)"
            )
        bonded = np.flatnonzero(self.bonded & ~self._is_middle & ~self.tied)
        ends, middles = self._links.ends, self._links.middles
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

    @property
    def _geometry(self) -> TipGeometry:
        headings = self._headings if self._by_lines else None
        return TipGeometry(
            self._links, self._undeformed, self.bonded, headings, by_corners=self._by_corners
        )

    def tip(self, node: int) -> Tip:
        """Geometry of one front node."""
        found = self._cache.get(node)
        if found is None:
            found = self._geometry.tip(node, self.surface)
            self._cache[node] = found
        return found


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
