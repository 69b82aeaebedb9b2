"""The front a part of an element behind the tips, whose energy release rate a mesh gives.

Finite elements store less energy around a tip than the crack-tip field does, by c h G per length of
the front. The derivative of the energy they store, with the mesh carried along, is therefore

    J L = G L - c h d(G L)/da = (G L)(a - c h)

to the first order in the element size h, with the length L of the front. On the front that
releasing all its nodes leads to, the same holds a length h_ahead further on, and G at the tip lies
between both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.criteria.probe import FrontProbe, State, load_density
from fxcrack.interface.front import Front
from fxcrack.interface.hierarchy import Hierarchy
from fxcrack.interface.surface import FacetSurface, triangle_areas
from fxcrack.interface.tips import Tips

_SHIFT = {
    (False, 1): (0.29, 0.43, 0.43),
    (False, 2): (0.0625, 0.104, 0.104),
    (True, 1): (0.33, 0.65, 0.65),
    (True, 2): (0.09, 0.153, 0.153),
}
"""c by mode, for other cells and for simplices, by the order of their displacement: J beside the
closed form of a centre crack in a wide plate, plane strain, even spacing, 8 elements of first and 4
of second order along half of it. Mode III is taken as mode II."""
_SHIFT_OF_TETRAHEDRA = {1: (0.83, 0.57, 1.05), 2: (0.165, 0.137, 0.285)}
"""c of unstructured tetrahedra likewise, from penny-shaped cracks under tension (Sneddon 1946) and
shear (Segedin 1951) with 4 and 6 elements of second order and 8 and 12 of first order per radius.
Those of second order are larger than for other cells, since jumps are linear beside the front."""
_RAGGED = {1: 1.15, 2: 1.5}
"""c of the next front over that of the present one, which is smoother."""
_LOADED = 0.1
"""Part of the load behind a tip from which on a node ahead is loaded as well."""
_FAR = 0.6
"""A node of the next front belongs to a tip if it is nearer to its aim than this part of an
element."""


@dataclass(frozen=True)
class NextFront:
    """The front once all its nodes are released.

    Attributes:
        front: This front, the bodies undeformed.
        tips: Its nodes.
        opened: Nodes that were bonded before, shape (n,).
        match: Per tip of the present front the node of the next one ahead of it, -1 where there
            is none, shape (n_tips,).
        here: Mean length of the elements around each tip, shape (n_tips,) [length].
        there: Around the node ahead, likewise.
        step: Length in between, likewise.
        shift: c by mode, shape (3,).
    """

    front: Front
    tips: Tips
    opened: Ints
    match: Ints
    here: Array
    there: Array
    step: Array
    shift: Array

    @classmethod
    def of(
        cls, front: Front, tips: Tips, *, simplices: bool, order: int, length: float | None = None
    ) -> NextFront | None:
        """The next front; ``None`` where the crack ends.

        Args:
            front: The present front, the bodies undeformed.
            tips: Its nodes.
            simplices: Whether the cells are triangles or tetrahedra.
            order: Order of their displacement.
            length: Length of the front through tetrahedra, where the next one is not as smooth as
                the present one and means of both are compared; ``None``, and 0 of single tips:
                node by node.
        """
        moves = (tips.d_ahead > 0.0) & ~tips.ligament
        opened = np.unique(tips.force_nodes[moves])
        if not moves.all() or not len(opened):
            return None
        after = front.without(opened)
        later = after.tips()
        if not len(later):
            return None
        surface = front.surface
        aim = surface.x[tips.node] + tips.d_ahead[:, None] * tips.frame[:, :, 1]
        away = np.linalg.norm(aim[:, None] - surface.x[later.node], axis=2)
        match = away.argmin(axis=1)
        if length is not None and length > 0.0:
            n = len(tips)
            size = np.full(n, 0.5 * float(np.mean(tips.d_ahead + tips.d_behind)))
            step = np.full(n, _area(surface, after.bonded, front.bonded) / length)
            shift = np.array(_SHIFT_OF_TETRAHEDRA[order])
            return cls(after, later, opened, match, size, _RAGGED[order] * size, step, shift)
        near = away[range(len(tips)), match] <= _FAR * tips.d_ahead
        near &= ~later.ligament[match] & (later.d_ahead[match] > 0.0)
        return cls(
            after, later, opened, np.where(near, match, -1),
            0.5 * (tips.d_ahead + tips.d_behind), 0.5 * (later.d_ahead + later.d_behind)[match],
            tips.d_ahead, np.array(_SHIFT[simplices, order]),
        )  # fmt: skip

    def weight(self, tip: int, shares: Array) -> float:
        """Share of the next front in G at a tip.

        Args:
            tip: Which of them.
            shares: Shares of the modes in G, shape (3,).
        """
        c = float(self.shift @ shares)
        here, there = c * self.here[tip], c * self.there[tip]
        return float(here / (self.step[tip] - there + here))

    def to_open(
        self, tips: Tips, force: Array, probe: FrontProbe, state: State
    ) -> tuple[Ints, Bools, Array]:
        """What is released on the way to this front.

        Args:
            tips: The present front.
            force: Bond forces at its force nodes in the tip frames, shape (n_tips, k, 3) [force].
            probe: The interface.
            state: State of the solver.

        Returns:
            Slave nodes, shape (n,); whether their faces stay closed, since contact presses them
            together, shape (n,); their bond forces, global vectors, shape (n, 3) [force].
        """
        vectors = np.einsum("nci,nki->nkc", tips.frame, force)
        pressed = np.zeros(force.shape[:2], dtype=bool)
        if probe.pair.interface.contact:
            pressed[:] = force[:, :, 0].sum(axis=1, keepdims=True) <= 0.0
        nodes, first = np.unique(tips.force_nodes, return_index=True)
        closed, pulls = pressed.reshape(-1)[first], vectors.reshape(-1, 3)[first]
        hierarchy = probe.pair.hierarchy
        if hierarchy is not None:
            # midside nodes have no tip of their own: they come free with the last corner beside
            midsides = hierarchy.opened_by(probe.front.bonded, nodes)
            nodes = np.append(nodes, midsides)
            closed = np.append(closed, np.zeros(len(midsides), dtype=bool))
            held = probe.bond_forces(midsides, state)
            if probe.has_face_loads:
                held = held + _loads_on_midsides(hierarchy, midsides, tips, probe, state)
            pulls = np.concatenate([pulls, held])
        return nodes, closed, pulls

    def to_come(self, tips: Tips, probe: FrontProbe, state: State) -> Array:
        """Traction that the loads behind the tips will have on the facets about to open.

        Zero where they are loaded already, shape (n_tips, 3).
        """
        if not probe.has_face_loads:
            return np.zeros((len(tips), 3))
        nodes, density = self.tips.node[self.match], load_density(probe, tips, state)
        ahead = np.linalg.norm(probe.face_loads(nodes, state), axis=1)
        # the edge of a load may lie beyond that of a curved element by a little
        whole = probe.pair.surface.areas[nodes] * np.linalg.norm(density, axis=1)
        return np.where((ahead > _LOADED * whole)[:, None], 0.0, density)


def _loads_on_midsides(
    hierarchy: Hierarchy, midsides: Ints, tips: Tips, probe: FrontProbe, state: State
) -> Array:
    """Loads on the faces about to open that belong to their midside jumps, shape (n, 3) [force].

    The function of an edge has a third of the area of each of its two triangles.
    """
    surface = probe.pair.surface
    density = np.zeros((surface.n_nodes, 3))
    density[tips.node] = load_density(probe, tips, state)
    ends = hierarchy.ends[np.searchsorted(hierarchy.midsides, midsides)]
    known = np.isin(ends, tips.node).sum(axis=1, keepdims=True)
    mean = density[ends].sum(axis=1) / np.maximum(known, 1)
    corner = surface.facets
    areas = triangle_areas(surface.x[corner])
    out = np.zeros(len(midsides))
    for k, (a, b) in enumerate(ends):
        out[k] = areas[(corner == a).any(axis=1) & (corner == b).any(axis=1)].sum() / 3.0
    return np.asarray(out[:, None] * mean)


def _area(surface: FacetSurface, bonded: Bools, before: Bools) -> float:
    """Area of the triangles that have an open corner but had none before [length^2]."""
    corner = surface.facets[:, : surface.n_corners]
    fresh = ~bonded[corner].all(axis=1) & before[corner].all(axis=1)
    return float(triangle_areas(surface.x[corner[fresh]]).sum())


def blend_to_tip(here: float, there: float, weight: float) -> float:
    """G at a tip from the rates of the present front and of the next one, times its stretch.

    A rate that is not positive, or that changes by more than itself, is no part of a smooth course:
    the present one alone is taken.
    """
    if here <= 0.0 or not 0.0 < there < _MOST * here:
        return here
    return (1.0 - weight) * here + weight * there


_MOST = 4.0
"""Largest ratio of the rates of two fronts between which G is interpolated."""
