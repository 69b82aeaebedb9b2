"""What the integrals over the ring of cells around one tip need, and the integrals themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.criteria.cell_laws import CellLaws
from fxcrack.criteria.face_tractions import FaceTractions, OpenedFacets
from fxcrack.criteria.front_ring import CellGeometry


@dataclass(frozen=True)
class Interaction:
    """What the interaction integrals of a ring are found from.

    Attributes:
        by_node: Weights of the displacements, shape (n_modes, n_nodes, gdim).
        by_rise: What each temperature pattern adds to them, shape (n_modes, n_patterns).
        by_load: What each load factor does, shape (n_modes, n_loads).
        energy: M of G = k . M k, shape (n_modes, n_modes).
        oscillation: Oscillation index of the two materials.
        share: Area that the extension of these integrals opens over that of the ring's energy.
    """

    by_node: Array
    by_rise: Array
    by_load: Array
    energy: Array
    oscillation: float
    share: float = 1.0


@dataclass(frozen=True)
class Ring:
    """One tip with all that its integrals need.

    Attributes:
        nodes: Global displacement nodes of the ring, shape (n_nodes,).
        of_cell: Their positions for each cell, shape (n_cells, n_cell_nodes).
        geometry: Cells, quadrature points and derivatives.
        x: Positions of the nodes, shape (n_nodes, gdim) [length].
        laws: Laws of the cells.
        moved: Gradient of the extension times the volume of each point, shape (n_cells, n_points,
            3, 3).
        rise: Temperature of each pattern at the points, shape (n_patterns, n_cells, n_points).
        slope: Its gradient times the extension and the volume, likewise.
        body: Body force of each load times the extension and the volume, shape (n_loads, n_cells,
            n_points, 3, 3), to be multiplied with H; ``None`` without.
        faces: Tractions on faces in the ring.
        opening: Derivative of the jump along the extension, integrated over facets that the crack
            is about to open: slave nodes and their weights.
        interaction: The interaction integrals.
        area: Area that the extension opens.
        alike: Whether each side is of one material, so that the crack-tip fields hold.
    """

    nodes: Ints
    of_cell: Ints
    geometry: CellGeometry
    x: Array
    laws: CellLaws
    moved: Array
    rise: Array
    slope: Array
    body: Array | None
    faces: FaceTractions
    opening: OpenedFacets
    interaction: Interaction
    area: float
    alike: bool

    def energy_rate(
        self, u: Array, heat: Array, load: Array, *, to_come: Array, jump: Array
    ) -> float:
        """The energy release rate J [force/length].

        Args:
            u: Displacements of the nodes, shape (n_nodes, gdim) [length].
            heat: Temperature factors, shape (n_patterns,).
            load: Load factors, shape (n_loads,).
            to_come: Traction on the slave side of the facets about to open, shape (3,)
                [force/length^2].
            jump: Jumps of their nodes, shape (n_opening, 3) [length].
        """
        gradient = self.geometry.gradient(u[self.of_cell])
        rise = np.einsum("p,pcq->cq", heat, self.rise)
        at = self.laws.at(gradient, rise)
        total = float(np.sum(at.nominal * (gradient @ self.moved)))
        total -= np.einsum("cq,cqii->", at.density, self.moved)
        if len(heat):
            slope = np.einsum("p,pcq->cq", heat, self.slope)
            total += np.einsum("cq,cq->", at.by_temperature, slope)
        if self.body is not None:
            total -= np.einsum("l,lcqij,cqij->", load, self.body, gradient)
        total += self.faces.work(u, load)
        total -= to_come @ (self.opening.weights @ jump) if len(jump) else 0.0
        return float(total) / self.area

    def factors(self, u: Array, heat: Array, load: Array) -> tuple[Array, Array]:
        """Intensity factors from the interaction integrals, and the energy of each.

        Args:
            u: Displacements of the nodes in the axes of the fields, shape (n_nodes, gdim) [length].
            heat: Temperature factors, shape (n_patterns,).
            load: Load factors, shape (n_loads,).

        Returns:
            K_I, K_II, K_III [force/length^1.5] and their parts of G [force/length], shape (3,)
            each.
        """
        weights = self.interaction
        found = np.einsum("mnc,nc->m", weights.by_node, u)
        found = found + weights.by_rise @ heat + weights.by_load @ load
        half = 0.5 * found / (self.area * weights.share)
        k = np.linalg.solve(weights.energy, half)
        parts, every = np.zeros(3), np.zeros(3)
        parts[: len(k)], every[: len(k)] = k * half, k
        return every[[1, 0, 2]], parts[[1, 0, 2]]

    def turned_back(self, u: Array) -> Array:
        """Displacements without the mean rotation of the ring, shape (n_nodes, gdim) [length].

        The polar decomposition of the mean deformation gradient.
        """
        gradient = self.geometry.gradient(u[self.of_cell])
        weight = self.geometry.weight
        mean = np.eye(3) + np.einsum("cqij,cq->ij", gradient, weight) / weight.sum()
        left, _, right = np.linalg.svd(mean)
        g = u.shape[1]
        rotation = (left @ right)[:g, :g]
        return np.asarray((self.x + u) @ rotation - self.x)
