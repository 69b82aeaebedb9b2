"""Criteria at a distance from the tip: stress ahead of it, opening behind it.

Both are weighted sums of nodal values on one face of the slave surface, with the shape functions
N of that face at the distance (small strain: reference positions decide where that is):

    t(d) = sum_k N_k(d) t_k,    t_k = bond force / tributary area of node k
    w(n) = sum_k N_k(n) w_k,    w_k = opening of node k, initial gap included

so they are linear between two equilibria of the same states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.criteria.probe import FrontProbe
from fxcrack.interface.surface_paths import SurfacePath, SurfacePaths, locate
from fxcrack.interface.tips import Tips

_ELEMENTS = 2.0
"""Distances below so many lengths of an element give a warning."""


@dataclass(frozen=True)
class Stencil:
    """Nodes of one face per tip and what they weigh at a distance.

    Attributes:
        nodes: Slave nodes, shape (n_tips, k).
        weights: Shape functions there, shape (n_tips, k).
    """

    nodes: Ints
    weights: Array

    @classmethod
    def of(cls, parts: list[tuple[Ints, Array]], order: int) -> Stencil:
        """Stack the parts of several tips; a single node is repeated with weight 0.

        Args:
            parts: Slave nodes and weights of each tip, both of shape (order + 1,) or (1,).
            order: Order of the faces, 1 or 2.
        """
        k = order + 1
        nodes, weights = np.zeros((len(parts), k), dtype=np.int64), np.zeros((len(parts), k))
        for i, (n, w) in enumerate(parts):
            nodes[i], weights[i, : len(w)] = n[0], w
            nodes[i, : len(n)] = n
        return cls(nodes, weights)

    def __call__(self, values: Array) -> Array:
        """Weighted sums, shape (n_tips, ...), of values of shape (n_tips, k, ...)."""
        return np.asarray(np.einsum("nk,nk...->n...", self.weights, values))


class TipStencils:
    """Stencils of the tips of one interface, kept for the present front.

    Args:
        probe: The interface, with its front in the initial state.
        part: Slave nodes and weights at a tip, given all tips and its number among them, both of
            shape (order + 1,) or (1,).

    Attributes:
        front: The front.
        surface: The slave surface.
        paths: Paths along it.
    """

    def __init__(self, probe: FrontProbe, part: Callable[[Tips, int], tuple[Ints, Array]]) -> None:
        self.front = probe.front
        self.surface = self.front.surface
        self.paths = SurfacePaths(self.front)
        self._probe, self._part = probe, part
        self._known: dict[tuple[int, int, bytes], Stencil] = {}

    def _key(self, tips: Tips) -> tuple[int, int, bytes]:
        return self.front.version, self.front.placed, tips.node.tobytes()

    def is_known(self, tips: Tips) -> bool:
        """Whether the stencil of the tips is that of the present front already."""
        return self._key(tips) in self._known

    def at(self, tips: Tips) -> Stencil:
        """Stencil of the tips, found anew when the front or the bodies have moved."""
        key = self._key(tips)
        if key not in self._known:
            parts = [self._part(tips, i) for i in range(len(tips))]
            self._known = {key: Stencil.of(parts, self.surface.order)}
        return self._known[key]

    def look_at_elements(self, tips: Tips, owner: str, distance: float, lengths: Array) -> None:
        """Warn where a distance is shorter than two elements, in which values are not resolved.

        Args:
            tips: The initial tips.
            owner: Name of the criterion.
            distance: Its distance [length].
            lengths: Of the elements at the tips on its side, shape (n,); 0 where there is none.
        """
        ratio = distance / np.where(lengths > 0.0, lengths, np.inf)
        i = int(np.argmin(np.where(lengths > 0.0, ratio, np.inf)))
        if lengths[i] > 0.0 and ratio[i] < _ELEMENTS * (1.0 - 1e-6):
            log.warn(
                "%s: %s distance %g is %.2g lengths of the element at the tip, where the value is "
                "that of the mesh: in an elastic crack-tip field it is up to 11 %% low between one "
                "and two elements and more below one, within 5 %% in first and 1.5 %% in second "
                "order from three on; refine the mesh at the tip",
                self.where(int(tips.node[i])),
                owner,
                distance,
                ratio[i],
            )

    def where(self, node: int) -> str:
        """Interface and tip in words."""
        x = self.surface.x[node, : self._probe.gdim]
        x = np.where(np.abs(x) < 1e-9 * self.paths.longest, 0.0, x)
        place = ", ".join(f"{c:.6g}" for c in x)
        return f"interface '{self._probe.pair.title}', tip at ({place})"


def at_nodes(values: Array | None, nodes: Ints) -> Array | None:
    """Values of slave nodes, shape (n_nodes,), at some of them, shape (n,); None without."""
    return None if values is None else values[nodes]


def on_face(path: SurfacePath, points: Array, distance: float, order: int) -> tuple[Ints, Array]:
    """Nodes and weights of the point on a path at a distance from its beginning."""
    rows, weights = locate("path", points, distance, order)
    return path.nodes[rows], weights
