"""Criteria at a distance from the tip: stress ahead of it, opening behind it.

Both are weighted sums of nodal values on one face of the slave surface, with the shape functions
N of that face at the distance (small strain: reference positions decide where that is):

    t(d) = sum_k N_k(d) t_k,    t_k = bond force / tributary area of node k
    w(n) = sum_k N_k(n) w_k,    w_k = opening of node k, initial gap included

so they are linear between two equilibria of the same states.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fxcrack import log
from fxcrack.criteria import CrackOpening, CriticalStress
from fxcrack.criteria.path import locate
from fxcrack.errors import InputError
from fxcrack.interface.path import SurfacePaths, Way
from fxcrack.interface.tip import Tips
from fxcrack.solve.condensed import CondensedModel
from fxcrack.solve.jump_system import Equilibrium

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_ROUND_OFF = 1e-11
"""Tractions below this fraction of the largest one count as zero."""


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
        """Stack the parts of several tips; a single node is repeated with weight 0."""
        k = order + 1
        nodes, weights = np.zeros((len(parts), k), dtype=np.int64), np.zeros((len(parts), k))
        for i, (n, w) in enumerate(parts):
            nodes[i], weights[i, : len(w)] = n[0], w
            nodes[i, : len(n)] = n
        return cls(nodes, weights)

    def __call__(self, values: Array) -> Array:
        """Weighted sums, shape (n_tips, ...), of values of shape (n_tips, k, ...)."""
        return np.asarray(np.einsum("nk,nk...->n...", self.weights, values))


class _AtDistance:
    """What both criteria share: ways along the surface and stencils kept for the present front.

    Args:
        model: Condensed model, with its front in the initial state.
        p: Number of the pair.
        distance: From the tip, length.
        temperature: Temperature of the slave nodes, shape (n_nodes,); None without.
    """

    degree = 1

    def __init__(
        self, model: CondensedModel, p: int, distance: float, temperature: Array | None
    ) -> None:
        self.model = model
        self.p = p
        self.distance = distance
        self.temperature = temperature
        self.front = model.fronts[p]
        self.surface = self.front.surface
        self.paths = SurfacePaths(self.front)
        self._known: dict[tuple[int, int, bytes], Stencil] = {}

    def _key(self, tips: Tips) -> tuple[int, int, bytes]:
        return self.front.version, self.front.placed, tips.node.tobytes()

    def stencil(self, tips: Tips) -> Stencil:
        """Stencil of the tips, found anew when the front or the bodies have moved."""
        key = self._key(tips)
        if key not in self._known:
            parts = [self._part(tips, i) for i in range(len(tips))]
            self._known = {key: Stencil.of(parts, self.surface.order)}
        return self._known[key]

    def temperature_at(self, tips: Tips) -> Array | None:
        """Temperature of the tips, shape (n,); None without."""
        return None if self.temperature is None else self.temperature[tips.node]

    def _part(self, tips: Tips, i: int) -> tuple[Ints, Array]:
        """Slave nodes and weights at one tip; each evaluator has its own."""
        raise NotImplementedError

    def _check_start(self) -> None:
        """Find the stencils of the initial tips, which complains about a wrong distance."""
        tips = self.front.tips()
        if len(tips):
            self.stencil(tips)

    def where(self, node: int) -> str:
        """Interface and tip in words."""
        x = self.surface.x[node, : self.model.continuum.gdim]
        x = np.where(np.abs(x) < 1e-9 * self.paths.longest, 0.0, x)
        place = ", ".join(f"{c:.6g}" for c in x)
        return f"interface '{self.model.pairs[self.p].title}', tip at ({place})"

    def breaks(self) -> tuple[float, ...]:
        """What is measured does not depend on time as such."""
        return ()


class StressEvaluator(_AtDistance):
    """Critical stress at a distance ahead of the tip, measured along the slave surface.

    Where fewer bonded nodes than that lie ahead (the end of the surface or another crack is
    near), the last of them counts.

    Args:
        model: Condensed model, with its front in the initial state.
        p: Number of the pair.
        criterion: Strengths and distance.
        temperature: Temperature of the slave nodes, shape (n_nodes,); None without.

    Raises:
        InputError: The distance lies outside the bonded part ahead of an initial tip on a line
            (a warning on a surface), or a strength depends on temperature and there is none.
    """

    behind = 0.0

    def __init__(
        self,
        model: CondensedModel,
        p: int,
        criterion: CriticalStress,
        temperature: Array | None = None,
    ) -> None:
        super().__init__(model, p, criterion.distance, temperature)
        self.criterion = criterion
        criterion.strength(temperature)
        self.ahead = criterion.distance + self.paths.longest
        self._starting = True
        self._check_start()
        self._starting = False

    def _part(self, tips: Tips, i: int) -> tuple[Ints, Array]:
        way = self.paths.ahead(tips, i, self.distance * (1.0 - 1e-12))
        reach = float(way.s[-1])
        if self.distance > reach * (1.0 + 1e-12) and self._starting:
            problem = (
                f"{self.where(int(tips.node[i]))}: CriticalStress distance {self.distance:g} lies "
                f"outside the bonded part, which ends {reach:g} ahead of the tip"
            )
            if self.surface.dim == 1:
                raise InputError(f"{problem}; give a smaller distance")
            # the direction of growth may point out of the side of a body
            log.warn("%s; the stress at its last node is used", problem)
        if len(way.nodes) == 1:
            return way.nodes, np.ones(1)
        return _on_face(way, way.s[:, None], min(self.distance, reach), self.surface.order)

    def measure(self, tips: Tips, state: Equilibrium, time: float) -> Array:
        """Traction in the tip frame (normal, growth direction, front), shape (n, 3)."""
        stencil = self.stencil(tips)
        index = self.model.index[self.p][stencil.nodes]
        rows = np.unique(index[index >= 0])
        values = np.zeros(self.model.system.n_window)
        values[rows] = -self.model.system.forces(state, rows)
        traction = self.model.vectors(self.p, stencil.nodes, values)
        traction = stencil(traction / self.surface.areas[stencil.nodes][..., None])
        out = np.asarray(np.einsum("nci,nc->ni", tips.frame, traction))
        # a component that symmetry makes vanish must not become a cause of growth by its round-off
        out[np.abs(out) < _ROUND_OFF * np.abs(out).max(initial=0.0)] = 0.0
        return out

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """F and the stresses s11 (normal), s12 (growth direction) and in 3-D s13 (front)."""
        names = ("s11", "s12", "s13")[: self.model.continuum.gdim]
        f = self.criterion.value(measured, self.temperature_at(tips))
        return f, dict(zip(names, measured.T, strict=False))

    def needs(self, tips: Tips) -> Ints:
        """The nodes whose forces are used."""
        return np.asarray(self.stencil(tips).nodes.ravel())


class OpeningEvaluator(_AtDistance):
    """Critical opening at a straight-line distance behind the tip.

    The critical value belongs to the length grown from the initial tip along the slave surface.

    Args:
        model: Condensed model, with its front in the initial state.
        p: Number of the pair.
        criterion: Critical openings and distance.
        temperature: Temperature of the slave nodes, shape (n_nodes,); None without.

    Raises:
        InputError: The distance lies outside the end points of the pair, or the critical opening
            depends on temperature and there is none.
    """

    ahead = 0.0

    def __init__(
        self,
        model: CondensedModel,
        p: int,
        criterion: CrackOpening,
        temperature: Array | None = None,
    ) -> None:
        super().__init__(model, p, criterion.distance, temperature)
        self.criterion = criterion
        criterion.critical_at(0.0, temperature)
        self.behind = criterion.distance + self.paths.longest
        self._grown = np.zeros(self.surface.n_nodes)
        self._warned = False
        self._check_start()

    def _part(self, tips: Tips, i: int) -> tuple[Ints, Array]:
        paired = self.model.pairs[self.p].paired
        way = self.paths.behind(tips, i, self.distance * (1.0 - 1e-12), paired)
        reach = float(way.radius.max())
        if self.distance > reach * (1.0 + 1e-12):
            raise InputError(
                f"{self.where(int(tips.node[i]))}: CrackOpening distance {self.distance:g} lies "
                f"outside the end points of the pair, {reach:g} behind the tip; give a smaller "
                "distance, or extend both surfaces"
            )
        nodes, weights = _on_face(way, way.x, min(self.distance, reach), self.surface.order)
        bonded = self.front.bonded[nodes] & (nodes != tips.node[i])
        if bonded[np.abs(weights) > 1e-9].any() and not self._warned:
            self._warned = True
            log.warn(
                "%s: CrackOpening distance %g reaches back to bonded nodes behind the crack, "
                "which do not open; give a smaller distance",
                self.where(int(tips.node[i])),
                self.distance,
            )
        return nodes, weights

    def stencil(self, tips: Tips) -> Stencil:
        """Stencil of the tips; the lengths they have grown are found with it."""
        if self._key(tips) not in self._known:
            self._grown[tips.node] = self.paths.origins(tips).grown
        return super().stencil(tips)

    def measure(self, tips: Tips, state: Equilibrium, time: float) -> Array:
        """Opening, and length grown so far, shape (n, 2), length."""
        stencil = self.stencil(tips)
        pair = self.model.pairs[self.p]
        jump = self.model.vectors(self.p, stencil.nodes, state.jump)
        normal = np.zeros((*stencil.nodes.shape, 3))
        if self.front.placed:  # the arms turn to both sides of the normal at the tip
            normal[:] = tips.frame[:, None, :, 0]
        else:
            normal[..., : self.model.continuum.gdim] = pair.frames[stencil.nodes, :, 0]
        opening = np.einsum("nkc,nkc->nk", normal, jump) + pair.gap[stencil.nodes]
        return np.stack([stencil(opening), self._grown[tips.node]], axis=1)

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """F, the opening cod and the length the tip has grown."""
        opening, grown = measured.T
        f = self.criterion.value(opening, grown, self.temperature_at(tips))
        return f, {"cod": opening, "grown": grown}

    def needs(self, tips: Tips) -> Ints:
        """The open nodes whose openings are used."""
        nodes = self.stencil(tips).nodes.ravel()
        return np.asarray(nodes[~self.front.bonded[nodes]])


def _on_face(way: Way, points: Array, distance: float, order: int) -> tuple[Ints, Array]:
    """Nodes and weights of the place on a way at a distance from its beginning."""
    rows, weights = locate("path", points, distance, order)
    return way.nodes[rows], weights
