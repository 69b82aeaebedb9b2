"""Virtual extension of a crack: how far the points around a tip move when the crack grows there.

The extension q of a tip has the size 1 at the tip and falls to zero at the outer radius, along the
front from 1 at the tip to 0 at its neighbours. It is a function of the position, so that it is the
same on both sides of the bonded faces, interpolated between the corners of the cells. Nowhere does
it move the boundary of a body, or that between two materials, out of its place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.interface.front import Front
from fxcrack.interface.front_cells import FrontCells
from fxcrack.interface.front_order import ordered_fronts
from fxcrack.interface.hierarchy import Hierarchy
from fxcrack.interface.tips import Tips

_ONE_FACE = 0.75
"""Cosine between the normals of two facets of one smooth face, at least; at edges it is less."""
_NOTHING = 1e-6
"""Extensions below this are zero."""
_SOME = 0.1
"""Part of a direction at least that must be left where a corner may not move freely."""


@dataclass(frozen=True)
class FrontLine:
    """The front as segments between its corner nodes; in 2-D single points.

    Attributes:
        x: Positions of the tips, shape (n_tips, 3) [length].
        segments: Tips at both ends of each segment in their order along the front, twice the same
            for a point, shape (n_segments, 2).
        members: Corner tips that stand for each tip: itself, or those beside a midside node.
        dim: Dimension of the interface, 1 or 2.
        bulge: From the middle of each segment to the midside node of its edge, shape (n_segments,
            3) [length]; zero where the edge is straight or has none in the hierarchy of jumps.
    """

    x: Array
    segments: Ints
    members: list[Ints]
    dim: int
    bulge: Array

    @classmethod
    def of(cls, front: Front, tips: Tips, hierarchy: Hierarchy | None = None) -> FrontLine:
        """The line of a present front.

        Args:
            front: The front.
            tips: Its nodes.
            hierarchy: Midside nodes of second-order tetrahedra, which are no tips.
        """
        surface = front.surface
        x = surface.x[tips.node]
        corners = np.isin(tips.node, surface.facets[:, : surface.n_corners])
        at = {int(node): i for i, node in enumerate(tips.node)}
        segments: list[tuple[int, int]] = []
        if surface.dim == 2:
            for nodes, closed in ordered_fronts(front, surface.x):
                following = nodes[1:] + nodes[:1] if closed else nodes[1:]
                segments += [
                    (at[a], at[b])
                    for a, b in zip(nodes, following, strict=False)
                    if a in at and b in at and a != b
                ]
        found = np.array(segments, dtype=np.int64).reshape(-1, 2)
        alone = np.setdiff1d(np.flatnonzero(corners), found.ravel())
        found = np.concatenate([found, np.stack([alone, alone], axis=1)])
        members = []
        for tip in range(len(tips)):
            if corners[tip]:
                members.append(np.array([tip]))
                continue
            away = np.linalg.norm(x[corners] - x[tip], axis=1)
            near = np.flatnonzero(corners)[np.argsort(away, kind="stable")[:2]]
            members.append(np.sort(near))
        bulge = np.zeros((len(found), 3))
        if hierarchy is not None:
            ends = [tuple(sorted(k)) for k in hierarchy.ends.tolist()]
            middle = dict(zip(ends, surface.x[hierarchy.midsides], strict=True))
            for k, (a, b) in enumerate(tips.node[found].tolist()):
                at_middle = middle.get((min(a, b), max(a, b)))
                if at_middle is not None:
                    bulge[k] = at_middle - 0.5 * (surface.x[a] + surface.x[b])
        return cls(x, found, members, surface.dim, bulge)

    @property
    def length(self) -> float:
        """Sum of the segments [length]."""
        ends = self.x[self.segments]
        return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())

    def ends(self) -> Ints:
        """Tips at which lines end, also those of lines of a single tip."""
        passed = np.bincount(self.segments.ravel(), minlength=len(self.x))
        single = self.segments[self.segments[:, 0] == self.segments[:, 1], 0]
        return np.union1d(np.flatnonzero(passed == 1), single)

    def spans(self) -> Array:
        """Angles between the first and the last segment of each open line [degrees]."""
        tips = self.segments
        if not len(tips):
            return np.zeros(0)
        first = np.flatnonzero(np.append(True, tips[1:, 0] != tips[:-1, 1]))
        last = np.append(first[1:], len(tips)) - 1
        chord = self.x[tips[:, 1]] - self.x[tips[:, 0]]
        out = []
        for one, two in zip(first.tolist(), last.tolist(), strict=True):
            if tips[one, 0] != tips[two, 1]:
                across = float(np.linalg.norm(np.cross(chord[one], chord[two])))
                out.append(float(np.degrees(np.arctan2(across, float(chord[one] @ chord[two])))))
        return np.array(out)

    def inward(self, i: int) -> int:
        """The tip beside one at the end of the front; any other tip itself."""
        mine = self.segments[(self.segments == i).any(axis=1)]
        if len(mine) != 1:
            return i
        a, b = mine[0].tolist()
        return int(b if a == i else a)

    def directions(self, tips: Tips) -> Array:
        """Directions of growth: those of the tips, but normal to the segments beside them.

        Where cells are irregular the former are several degrees off, which would move the front
        along itself. At kinks, where a tip moves along a segment beside it, the side that all of a
        line grows to tells the sign of both segments; one by one they could sum up to a direction
        along the front, in which it opens no area. Shape (n_tips, 3).

        Args:
            tips: Front nodes.
        """
        out = tips.frame[:, :, 1].copy()
        if self.dim == 1 or not len(self.segments):
            return out
        ends = self.segments
        chord = (self.x[ends[:, 1]] - self.x[ends[:, 0]])[:, None]
        across = np.cross(tips.frame[ends, :, 0], chord)
        line = np.concatenate([[0], np.cumsum(ends[1:, 0] != ends[:-1, 1])])
        votes = np.bincount(line, weights=np.einsum("kec,kec->k", across, out[ends]))
        across *= np.where(votes < 0.0, -1.0, 1.0)[line][:, None, None]
        total = np.zeros_like(out)
        np.add.at(total, ends, across)
        size = np.linalg.norm(total, axis=1)
        known = size > _NOTHING * np.abs(chord).max()
        out[known] = total[known] / size[known, None]
        return out

    def widths(self, tips: Tips, i: int) -> float:
        """Area that the extension of a tip opens per length, in the direction it grows [length].

        In 2-D what is out of the plane is not counted: 1. A tip of a surface without others beside
        it opens the width that belongs to it.
        """
        total, swept = 0.0, 0.0
        normal, growth = tips.frame[i, :, 0], tips.frame[i, :, 1]
        for member in self.members[i]:
            for k in np.flatnonzero((self.segments == member).any(axis=1)):
                a, b = self.segments[k]
                if a == b:
                    total += 1.0 if self.dim == 1 else float(tips.width[i])
                else:  # segments run along the front: one that is swept backwards counts as such
                    # int (1 - t) dx or int t dx of the parabola through the midside node
                    bent = (4.0 / 3.0) * self.bulge[k] * (1.0 if a == member else -1.0)
                    along = self.x[b] - self.x[a] + bent
                    swept += 0.5 * float(np.cross(normal, along) @ growth)
        return total + abs(swept)

    def turning(self) -> tuple[float, int]:
        """The largest angle between neighbouring segments [degrees], and the tip between them."""
        largest, where = 0.0, 0
        before = {int(b): int(a) for a, b in self.segments if a != b}
        for a, b in self.segments.tolist():
            if a == b or a not in before:
                continue
            one, two = self.x[a] - self.x[before[a]], self.x[b] - self.x[a]
            cosine = float(one @ two) / float(np.linalg.norm(one) * np.linalg.norm(two))
            angle = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
            if angle > largest:
                largest, where = angle, a
        return largest, where

    def nearest(self, x: Array) -> tuple[Array, Ints, Array]:
        """The nearest point of the front.

        Args:
            x: Positions, shape (n, 3) [length].

        Returns:
            Distances, shape (n,) [length]; the two tips around the nearest points, shape (n, 2);
            the share of each, likewise.
        """
        a, b = self.x[self.segments[:, 0]], self.x[self.segments[:, 1]]
        chord = b - a
        square = np.einsum("sc,sc->s", chord, chord)
        away = x[:, None] - a[None]
        share = np.einsum("nsc,sc->ns", away, chord) / np.where(square > 0.0, square, 1.0)
        share = np.clip(share, 0.0, 1.0)
        distance = np.linalg.norm(away - share[..., None] * chord[None], axis=2)
        # of equal ones the first: which of them it is makes no difference to the shares
        best = np.argmin(distance, axis=1)
        row = np.arange(len(x))
        last = share[row, best]
        return distance[row, best], self.segments[best], np.stack([1.0 - last, last], axis=1)


class Corners:
    """Corners of cells around a front and how they may move.

    Args:
        cells: The cells.
        line: The front.
    """

    def __init__(self, cells: FrontCells, line: FrontLine) -> None:
        ids = cells.nodes[:, : cells.n_corners]
        unique, first, inverse = np.unique(ids, return_index=True, return_inverse=True)
        self._gdim = cells.corners.shape[2]
        self.of_cell = inverse.reshape(ids.shape)
        self.node = unique
        self.x = np.zeros((len(unique), 3))
        self.x[:, : self._gdim] = cells.corners.reshape(-1, self._gdim)[first]
        self.distance, self._tips, self._shares = line.nearest(self.x)
        self._line = line
        self._fixed = self._directions(cells)

    def _directions(self, cells: FrontCells) -> dict[int, Array]:
        """Orthonormal directions in which some corners must not move, shape (m, gdim) each."""
        local = cells.facet_corners
        ids = self.of_cell[:, local]
        flat = np.sort(ids.reshape(-1, local.shape[1]), axis=1)
        part = np.repeat(cells.part, len(local))
        between = np.zeros(len(flat), dtype=bool)
        if len(np.unique(cells.part)) > 1:
            _, group = np.unique(flat, axis=0, return_inverse=True)
            group = group.ravel()
            low = np.full(group.max() + 1, np.iinfo(np.int64).max)
            high = np.full(group.max() + 1, -1)
            np.minimum.at(low, group, part)
            np.maximum.at(high, group, part)
            between = (low != high)[group]
        chosen = np.flatnonzero(cells.outer.ravel() | between)
        x = self.x[ids.reshape(-1, local.shape[1])[chosen]]
        if self._gdim == 2:
            normals = np.cross(x[:, 1] - x[:, 0], [0.0, 0.0, 1.0])
        else:
            normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        groups: dict[int, list[Array]] = {}
        for corners, normal in zip(ids.reshape(-1, local.shape[1])[chosen], normals, strict=True):
            for corner in corners.tolist():
                _add(groups.setdefault(corner, []), normal[: self._gdim])
        return {corner: _orthonormal(found) for corner, found in groups.items()}

    def allowed(self, nodes: Ints, directions: Array) -> Array:
        """Directions at some corners as far as these may move there, of length 1.

        One that is not allowed at all stays as it is.

        Args:
            nodes: Global displacement nodes, shape (n,).
            directions: Shape (n, 3).
        """
        out = directions.copy()
        at = np.searchsorted(self.node, nodes)
        for i, corner in enumerate(at.tolist()):
            known = corner < len(self.node) and self.node[corner] == nodes[i]
            fixed = self._fixed.get(corner) if known else None
            if fixed is None:
                continue
            moved = out[i].copy()
            moved[: self._gdim] -= (fixed @ moved[: self._gdim]) @ fixed
            size = float(np.linalg.norm(moved))
            if size > _SOME:
                out[i] = moved / size
        return out

    def extension(self, weights: Array, directions: Array, radius: float, core: float) -> Array:
        """Extension at the corners, shape (n_corners, gdim).

        Args:
            weights: Of the hat functions of the tips along the front, shape (n_tips,).
            directions: In which they move, shape (n_tips, 3).
            radius: Where it has fallen to zero [length].
            core: Where it begins to fall [length].
        """
        fall = np.clip((radius - self.distance) / (radius - core), 0.0, 1.0)
        share = self._shares.copy()
        share[self._tips[:, 0] == self._tips[:, 1], 1] = 0.0
        share *= weights[self._tips] * fall[:, None]
        share[np.abs(share) < _NOTHING] = 0.0
        q = np.einsum("nk,nkc->nc", share, directions[self._tips][..., : self._gdim])
        for corner in np.flatnonzero(share.any(axis=1)):
            fixed = self._fixed.get(int(corner))
            if fixed is not None:
                q[corner] -= (fixed @ q[corner]) @ fixed
        return np.asarray(q)


def _add(groups: list[Array], normal: Array) -> None:
    """Add a facet's normal to those of its face, or as a face of its own."""
    for k, total in enumerate(groups):
        cosine = float(total @ normal) / float(np.linalg.norm(total))
        if abs(cosine) > _ONE_FACE:
            groups[k] = total + np.sign(cosine) * normal
            return
    groups.append(normal)


def _orthonormal(vectors: list[Array]) -> Array:
    """An orthonormal basis of what some vectors span, shape (m, gdim)."""
    _, size, basis = np.linalg.svd(np.array(vectors), full_matrices=False)
    return np.asarray(basis[size > 0.3 * size[0]])
