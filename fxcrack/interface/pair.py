"""An interface on a mesh: slave nodes, their masters and weights, frames, gaps, bonded set.

u_s = sum_m W_sm u_m + R_s delta_s,    delta = (opening, slip, tear)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.face import Face
from fxcrack.interface.definition import Interface
from fxcrack.interface.hierarchy import Hierarchy, linked
from fxcrack.interface.rigid import RIGID, RigidSurface
from fxcrack.interface.surface import FacetSurface

FACING = -0.5
"""Cosine between the outward normals of two surfaces that face each other, at most."""
NEAR = 0.5
"""Parts of a facet within which a gap may close in the next increment."""
_SLID, _PRESSED = 1e-3, 1e-7
"""Changes of weights (parts of a facet) and normals (angles) below which the pairing of open faces,
and of those that press on each other, stays. The latter is round-off: where contact forces act, no
threshold decides. Following open faces always as well changes loads at onset by 2e-6 and takes up
to 1.7 times as long."""


def has_slid(change: Array, pressed: Bools | None) -> Bools:
    """Whether slave nodes have slid so far that they are paired anew, shape (n_nodes,).

    Args:
        change: Changes of their weights or normals, shape (n_nodes,).
        pressed: Nodes that faces press on, shape (n_nodes,); ``None`` where that is not known.
    """
    least = _SLID if pressed is None else np.where(pressed, _PRESSED, _SLID)
    return np.asarray(change > least)


def with_friction(pairs: Sequence[Pair]) -> list[Pair]:
    """The interfaces whose faces have friction."""
    return [pair for pair in pairs if pair.friction is not None]


@dataclass(frozen=True)
class Pair:
    """An interface on a mesh, the same on every rank.

    Attributes:
        interface: What the user asked for.
        surface: Slave surface; its node numbers are the slave node numbers. Where it lies on the
            master in part only, its facets are those that do: what has no partner is neither crack
            nor front.
        paired: Slave nodes that have a master point, shape (n_nodes,); not the nodes of a border
            inside a body, which belong to both sides.
        masters: Global displacement nodes of the masters, shape (n_nodes, k); k = 0 on a rigid
            surface.
        weights: Their weights, shape (n_nodes, k).
        frames: Columns n, t1, t2 (n, t in 2-D), shape (n_nodes, gdim, gdim).
        gap: Initial normal gap, shape (n_nodes,), length.
        bonded: Initially bonded nodes, shape (n_nodes,).
        friction: Coefficient of friction per slave node, shape (n_nodes,); ``None`` without.
        master_maps: Displacement of a master's point per unknown of its node, shape
            (n_nodes, k, gdim, n_unknowns); ``None`` where the unknowns are the displacement
            (:mod:`fxcrack.continuum.dof_layout`).
        feet: Masters of the point under each node, and its weights on them, each of shape
            (n_nodes, n_facet_nodes), where ``weights`` are means over facets; ``None`` where
            they are those of this point.
        exchanged: Whether the nodes are those of the side that the interface calls the master
            (:mod:`fxcrack.interface.roles`).
        whole: Slave surface with all its facets where ``surface`` has not; ``None`` where it has.
        hierarchy: Midside nodes whose jumps are measured from those of their corners
            (:mod:`fxcrack.interface.hierarchy`). ``surface`` consists of first-order triangles
            then, and masters and weights of these nodes hold their corners. ``None`` where each
            node has its own jump.
        rigid: The master, where it is a rigid surface, which has no nodes; ``None`` elsewhere.
    """

    interface: Interface
    surface: FacetSurface
    paired: Bools
    masters: Ints
    weights: Array
    frames: Array
    gap: Array
    bonded: Bools
    friction: Array | None = None
    master_maps: Array | None = None
    feet: tuple[Ints, Array] | None = None
    exchanged: bool = False
    whole: FacetSurface | None = None
    hierarchy: Hierarchy | None = None
    rigid: RigidSurface | None = None

    @property
    def title(self) -> str:
        """Name in the history."""
        return self.interface.title

    @property
    def sides(self) -> tuple[str | Face, str | Face | RigidSurface]:
        """The side whose nodes hold the jumps, and the other one."""
        slave, master = self.interface.slave, self.interface.master
        if self.exchanged and not isinstance(master, RIGID):
            return master, slave
        return slave, master

    @property
    def whole_surface(self) -> FacetSurface:
        """Slave surface with all its facets."""
        return self.whole or self.surface

    @property
    def under(self) -> tuple[Ints, Array]:
        """Masters of the whole jump of each node and their weights, each (n_nodes, k)."""
        if self.hierarchy is None:
            return self.masters, self.weights
        return self.hierarchy.masters, self.hierarchy.weights

    @property
    def can_touch(self) -> Bools:
        """Slave nodes whose normal jump contact bounds, shape (n_nodes,)."""
        if self.hierarchy is None:
            return self.paired
        out = self.paired.copy()
        out[self.hierarchy.midsides] = False
        return out

    def opened_with(self, bonded: Bools, nodes: Ints) -> Ints:
        """Some nodes and those that come free with them, sorted, shape (k,).

        Args:
            bonded: Nodes bonded so far, shape (n_nodes,).
            nodes: Nodes that are released, shape (m,).
        """
        if self.hierarchy is None:
            return nodes
        return np.union1d(nodes, self.hierarchy.opened_by(bonded, nodes))

    def by_nodes(self) -> Pair:
        """The same pair with a jump of its own at every node, on the same facets."""
        if self.hierarchy is None:
            return self
        masters, weights = self.under
        return replace(self, masters=masters, weights=weights, hierarchy=None)

    def by_corners(self) -> Pair:
        """The pair with jumps of midside nodes measured from those of their corners."""
        grown = self.bonded & ~self.paired
        hierarchy, masters, weights = linked(
            self.whole_surface, self.paired, grown, self.masters, self.weights
        )
        return replace(self, masters=masters, weights=weights, hierarchy=hierarchy)

    @property
    def surface_to_surface(self) -> bool:
        """Whether weights are means over facets."""
        return self.feet is not None

    def masters_under(self, node: int) -> Ints:
        """Global nodes whose shape functions do not vanish at the point under a slave node."""
        masters, weights = self.feet or self.under
        return np.asarray(masters[node][weights[node] != 0.0])

    def forces_on_masters(self, forces: Array) -> Array:
        """Forces on the masters' unknowns that do the work of given forces on the slave side.

        Args:
            forces: On the slave nodes' displacements, shape (n_nodes, gdim), force.

        Returns:
            W P_m^t f of each master, shape (n_nodes, k, n_unknowns); force in the components of the
            displacement.
        """
        each = self.weights[:, :, None] * forces[:, None, :]
        if self.master_maps is None:
            return each
        return np.asarray(np.einsum("nkc,nkcj->nkj", each, self.master_maps))
