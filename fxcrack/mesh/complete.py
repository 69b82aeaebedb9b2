"""Second-order cells without centre nodes (8-node quadrilaterals, 20-node hexahedra) made complete.

The displacement of this package has 9 and 27 nodes in such cells. The nodes that are missing are
put where the shape functions of the incomplete (serendipity) cell have the centres of its faces and
of itself, so that the geometry stays the same:

    centre of a face: -1/4 of its corners + 1/2 of its edge nodes
    centre of a hexahedron: -1/4 of its corners + 1/4 of its edge nodes

Nodes are in gmsh order: corners, edges, faces, centre.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Ints
from fxcrack.base.errors import MeshError
from fxcrack.mesh.raw import Floats, row_ids

INCOMPLETE = {16: "quadrilateral", 17: "hexahedron"}
"""Shape of the cells of each of gmsh's types of second order without centre nodes."""

_EDGES = (
    *((0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3)),
    *((2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)),
)
_FACES = ((0, 3, 2, 1), (0, 1, 5, 4), (0, 4, 7, 3), (1, 2, 6, 5), (2, 3, 7, 6), (4, 5, 6, 7))


def _edges_of(face: tuple[int, ...]) -> list[int]:
    """Nodes in the middle of the edges of a face of a hexahedron."""
    return [8 + i for i, edge in enumerate(_EDGES) if set(edge) <= set(face)]


class Completion:
    """The nodes that make cells complete.

    Args:
        cell: "quadrilateral" or "hexahedron".
        points: Coordinates of the nodes so far, shape (n_nodes, 3).
        nodes: Nodes of the cells in gmsh order, shape (n_cells, 8 or 20).

    Attributes:
        points: Coordinates with the new nodes appended, shape (n_all, 3).
        nodes: Nodes of the complete cells in gmsh order, shape (n_cells, 9 or 27).
    """

    def __init__(self, cell: str, points: Floats, nodes: Ints) -> None:
        self._faces: dict[tuple[int, ...], int] = {}
        x = points[nodes]
        n = len(points)
        if cell == "quadrilateral":
            centres = 0.5 * x[:, 4:].sum(axis=1) - 0.25 * x[:, :4].sum(axis=1)
            self.points = np.concatenate([points, centres])
            self.nodes = np.column_stack([nodes, n + np.arange(len(nodes))])
            return
        corners = np.sort(nodes[:, np.array(_FACES)].reshape(-1, 4), axis=1)
        number = row_ids(corners)
        n_faces = int(number.max()) + 1
        on_faces = np.empty((n_faces, 3))
        for i, face in enumerate(_FACES):
            middle = 0.5 * x[:, _edges_of(face)].sum(axis=1) - 0.25 * x[:, list(face)].sum(axis=1)
            on_faces[number.reshape(-1, 6)[:, i]] = middle
        centres = 0.25 * x[:, 8:].sum(axis=1) - 0.25 * x[:, :8].sum(axis=1)
        self.points = np.concatenate([points, on_faces, centres])
        self.nodes = np.column_stack(
            [nodes, n + number.reshape(-1, 6), n + n_faces + np.arange(len(nodes))]
        )
        first = np.unique(number, return_index=True)[1]
        for i, row in zip(number[first], corners[first], strict=True):
            self._faces[tuple(row.tolist())] = n + int(i)

    def facets(self, rows: Ints, label: str) -> Ints:
        """Complete the facets of a group.

        Args:
            rows: Nodes of 8-node quadrilaterals in gmsh order, shape (n, 8).
            label: What messages call the group.

        Returns:
            Shape (n, 9).

        Raises:
            MeshError: A facet is no face of a cell.
        """
        keys = [tuple(sorted(r)) for r in rows[:, :4].tolist()]
        stray = sum(key not in self._faces for key in keys)
        if stray:
            raise MeshError(
                f"{stray} of the {len(rows)} facets of {label} are no faces of the cells; make the "
                "geometry conforming there (fragment)"
            )
        return np.column_stack([rows, [self._faces[key] for key in keys]])


__all__ = ["INCOMPLETE", "Completion"]
