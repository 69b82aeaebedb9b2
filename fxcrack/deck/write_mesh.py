"""The mesh of a scene as nodes, elements, sets and surfaces of a deck."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Ints
from fxcrack.continuum.kinematics import Axisymmetric, PlaneStrain, PlaneStress
from fxcrack.deck.elements import FACES, added_nodes, element_type, face_nodes, to_dolfinx
from fxcrack.deck.gather import Gathered
from fxcrack.deck.lines import broken, number, set_lines
from fxcrack.deck.write_steps import refuse
from fxcrack.mesh.raw import reference
from fxcrack.scene import Scene

_NODES = {
    "triangle": (3, 6),
    "quadrilateral": (4, 8),
    "tetrahedron": (4, 10),
    "hexahedron": (8, 20),
}


class MeshLines:
    """Makes the lines of a mesh.

    Args:
        scene: The scene.
        mesh: Its mesh, on rank 0 only.

    Attributes:
        dropped: Nodes that the deck does not have, shape (n_nodes,); known once the lines are made.
    """

    def __init__(self, scene: Scene, mesh: Gathered | None) -> None:
        self.scene, self.mesh = scene, mesh
        self.dropped = np.zeros(0, dtype=bool)

    def lines(self) -> list[str]:
        """Nodes, elements, sets and surfaces."""
        model, mesh = self.scene.input.model, self.mesh
        if mesh is None:
            return []
        prefix = {PlaneStrain: "CPE", PlaneStress: "CPS", Axisymmetric: "CAX"}.get(
            type(model), "C3D"
        )
        n = _NODES[mesh.cell][mesh.order - 1]
        kind = element_type(f"{prefix}{n}")
        assert not isinstance(kind, str)
        inverse = np.argsort(to_dolfinx(mesh.cell, mesh.order))
        cells = mesh.cells[:, inverse]
        dropped = np.zeros(len(mesh.points), dtype=bool)
        if kind.serendipity:
            dropped[cells[:, n:]] = True
            self._check_centres(cells, kind, mesh)
        out = ["*NODE"]
        out += [
            f"{i + 1}, " + ", ".join(number(c) for c in x)
            for i, x in enumerate(mesh.points)
            if not dropped[i]
        ]
        out.append(f"*ELEMENT, TYPE={kind.name}, ELSET=ALL_ELEMENTS")
        for i, row in enumerate(cells[:, :n]):
            words = [str(i + 1), *(str(node + 1) for node in row)]
            out += broken(words, 16)
        for name, (dim, members) in mesh.groups.items():
            if dim == self.scene.mesh.tdim:
                out += set_lines("ELSET", name, members)
            elif dim == self.scene.mesh.tdim - 1:
                out += self.surface(name, members)
            elif len(members := members[~dropped[members]]):
                out += set_lines("NSET", name, members)
        self.dropped = dropped
        return out

    @staticmethod
    def _check_centres(cells: Ints, kind: object, mesh: Gathered) -> None:
        """Refuse centre nodes that a serendipity element would not put where they are."""
        n = _NODES[mesh.cell][1]
        parents, weights = added_nodes(kind)  # type: ignore[arg-type]
        size = float(np.ptp(mesh.points, axis=0).max())
        for i, (local, weight) in enumerate(zip(parents, weights, strict=True)):
            at = np.einsum("k,nkc->nc", weight, mesh.points[cells[:, local]])
            if np.abs(at - mesh.points[cells[:, n + i]]).max() > 1e-9 * size:
                refuse(
                    "curved elements whose centre nodes are not where an element without them "
                    "would put them; use straight elements, or triangles and tetrahedra"
                )

    def surface(self, name: str, facets: Ints) -> list[str]:
        """A surface by element sides, from rows (cell, local facet)."""
        mesh = self.mesh
        assert mesh is not None
        sides = _sides(mesh.cell, mesh.order)[facets[:, 1]] if len(facets) else facets[:, 1]
        out, lines = [], []
        for side in np.unique(sides):
            elset = f"_{name}_S{side + 1}"
            out += set_lines("ELSET", elset, facets[sides == side, 0], ", INTERNAL")
            lines.append(f'"{elset}", S{side + 1}')
        return [*out, f'*SURFACE, TYPE=ELEMENT, NAME="{name}"', *lines] if lines else []

    def nodes_of(self, group: str) -> Ints:
        """Nodes of a group that the deck has."""
        mesh = self.mesh
        if mesh is None:
            return np.zeros(0, dtype=np.int64)
        dim, members = mesh.groups[group]
        tdim = self.scene.mesh.tdim
        if dim == tdim:
            members = np.unique(mesh.cells[members])
        elif dim == tdim - 1:
            members = self.facet_nodes(members)
        return np.asarray(members[~self.dropped[members]])

    def facet_nodes(self, facets: Ints) -> Ints:
        """Nodes of facets, rows (cell, local facet), ascending."""
        mesh = self.mesh
        assert mesh is not None
        inverse = np.argsort(to_dolfinx(mesh.cell, mesh.order))
        rows = face_nodes(mesh.cell, mesh.order)[_sides(mesh.cell, mesh.order)[facets[:, 1]]]
        return np.unique(mesh.cells[facets[:, :1], inverse[rows]])


def _sides(cell: str, order: int) -> Ints:
    """Number of the deck's face, from 0, of each local facet of DOLFINx."""
    tdim = 2 if cell in ("triangle", "quadrilateral") else 3
    perm = to_dolfinx(cell, order)
    closures = reference(cell, order).entity_closure_dofs[tdim - 1]
    n = len(FACES[cell][0])
    faces = [set(face) for face in FACES[cell]]
    return np.array([faces.index({int(perm[i]) for i in c[:n]}) for c in closures])


__all__ = ["MeshLines"]
