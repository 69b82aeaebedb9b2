"""The mesh of a scene as nodes, elements, sets and surfaces of a deck."""

from __future__ import annotations

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.face import Face
from fxcrack.continuum.kinematics import Axisymmetric, PlaneStrain, PlaneStress
from fxcrack.continuum.section import Section
from fxcrack.deck.elements import FACES, added_nodes, element_type, face_nodes, to_dolfinx
from fxcrack.deck.gather import Gathered
from fxcrack.deck.lines import broken, number, set_lines
from fxcrack.deck.write_shells import MOVED, ROTATIONS, Stacks, shell_type, stacks, turned
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
        normals: Unit normals of the cells of shells to the top, shape (n_cells, 3).
    """

    def __init__(self, scene: Scene, mesh: Gathered | None) -> None:
        self.scene, self.mesh = scene, mesh
        self.dropped = np.zeros(0, dtype=bool)
        self.normals = np.zeros((0, 3))
        self._stacks: Stacks | None = None
        self._references: dict[tuple[object, ...], int] = {}

    def reference_node(self, mark: tuple[object, ...]) -> tuple[int, bool]:
        """Number of a node beside those of the mesh, and whether nothing has had it yet.

        Args:
            mark: What it belongs to.
        """
        new = mark not in self._references
        node = self._references.setdefault(mark, len(self._references) + 1)
        return node + (0 if self.mesh is None else len(self.mesh.points)), new

    @property
    def shell(self) -> bool:
        """Whether the bodies are shells on surfaces."""
        return self.scene.mesh.gdim > self.scene.mesh.tdim

    def lines(self, *, explicit: bool) -> list[str]:
        """Nodes, elements, sets and surfaces.

        Args:
            explicit: Whether the steps are explicit.
        """
        model, mesh = self.scene.input.model, self.mesh
        if mesh is None:
            return []
        prefix = {PlaneStrain: "CPE", PlaneStress: "CPS", Axisymmetric: "CAX"}.get(
            type(model), "C3D"
        )
        inverse = np.argsort(to_dolfinx(mesh.cell, mesh.order))
        cells = mesh.cells[:, inverse]
        blocks = np.zeros(len(cells), dtype=bool)
        name = f"{prefix}{_NODES[mesh.cell][mesh.order - 1]}"
        if self.shell:
            name = shell_type(mesh.cell, mesh.order)
            cells = turned(name, cells, mesh.signs)
            self.normals = _normals(mesh, cells)
        else:
            self._stacks = self._stack(cells)
        if self._stacks is not None:
            name, blocks = f"{prefix}8", self._stacks.stacked
            corners = cells[:, :8]
            cells = np.column_stack(
                (
                    np.take_along_axis(corners, ROTATIONS[self._stacks.rotation], axis=1),
                    cells[:, 8:],
                )
            )
            self.normals = _normals(mesh, cells[:, [0, 1, 2, 3]])
            if mesh.order == 1 and not explicit:
                log.warn(
                    "write_deck: continuum shells of first order: read the deck with order=1 "
                    "(--order 1), else they are raised to the second order"
                )
        kind = element_type(name)
        assert not isinstance(kind, str)
        n = kind.n_nodes
        dropped = np.ones(len(mesh.points), dtype=bool)
        dropped[cells[:, :n]] = False
        if self._stacks is None and kind.serendipity:
            self._check_centres(cells, kind, mesh)
        elif self._stacks is not None and mesh.order == 2:
            self._check_straight(mesh)
        out = ["*NODE"]
        out += [
            f"{i + 1}, " + ", ".join(number(c) for c in x)
            for i, x in enumerate(mesh.points)
            if not dropped[i]
        ]
        for title, chosen in ((kind.name, ~blocks), ("SC8R", blocks)):
            if chosen.any():
                out.append(f"*ELEMENT, TYPE={title}, ELSET=ALL_ELEMENTS")
            for i in np.flatnonzero(chosen):
                words = [str(i + 1), *(str(node + 1) for node in cells[i, :n])]
                out += broken(words, 16)
        for name, (dim, members) in mesh.groups.items():
            if dim == self.scene.mesh.tdim:
                out += set_lines("ELSET", name, members)
            elif dim == self.scene.mesh.tdim - 1 and members.ndim == 2:
                out += self.surface(name, members)
            elif len(members := members[~dropped[members]]):
                out += set_lines("NSET", name, members)
        self.dropped = dropped
        return out

    def _stack(self, cells: Ints) -> Stacks | None:
        """The continuum shells, None without."""
        mesh = self.mesh
        assert mesh is not None
        materials = self.scene.input.materials
        items = materials.items() if isinstance(materials, dict) else [(None, materials)]
        found = []
        for name, material in items:
            if isinstance(material, ContinuumShell):
                inside = np.arange(len(cells)) if name is None else mesh.groups[name][1]
                bottom = mesh.groups[material.bottom][1].copy()
                bottom[:, 1] = _sides(mesh.cell, mesh.order)[bottom[:, 1]]
                found.append((inside, bottom))
        return stacks(cells[:, :8], found) if found else None

    @staticmethod
    def _check_straight(mesh: Gathered) -> None:
        """Refuse midside nodes that are not in the middle: continuum shells have 8 nodes."""
        linear = element_type("C3D8")
        assert not isinstance(linear, str)
        cells = mesh.cells[:, np.argsort(to_dolfinx(mesh.cell, mesh.order))]
        size = float(np.ptp(mesh.points, axis=0).max())
        for i, (local, weight) in enumerate(zip(*added_nodes(linear), strict=True)):
            at = np.einsum("k,nkc->nc", weight, mesh.points[cells[:, local]])
            if np.abs(at - mesh.points[cells[:, 8 + i]]).max() > 1e-9 * size:
                refuse("curved cells of continuum shells, whose elements have 8 nodes in a deck")

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
        if self._stacks is not None:
            sides = MOVED[self._stacks.rotation[facets[:, 0]], sides]
        out, lines = [], []
        for side in np.unique(sides):
            elset = f"_{name}_S{side + 1}"
            out += set_lines("ELSET", elset, facets[sides == side, 0], ", INTERNAL")
            lines.append(f'"{elset}", S{side + 1}')
        return [*out, f'*SURFACE, TYPE=ELEMENT, NAME="{name}"', *lines] if lines else []

    def named_surface(self, name: str, where: str | Face) -> list[str]:
        """A surface of a name; none where the deck has it already."""
        if isinstance(where, Face):
            return self.side(name, where)
        if name == where or self.mesh is None:
            return []
        dim, members = self.mesh.groups[where]
        if members.ndim == 1 or dim != self.scene.mesh.tdim - 1:
            refuse(f"'{name}' on the edges '{where}' of shells")
        return self.surface(name, members)

    def side(self, name: str, face: Face) -> list[str]:
        """A surface that is a side of shells."""
        word = "SPOS" if face.side == "top" else "SNEG"
        return [f'*SURFACE, TYPE=ELEMENT, NAME="{name}"', f'"{face.group}", {word}']

    def side_points(self, face: Face) -> tuple[Ints, Array]:
        """Nodes of a side of shells, ascending, and positions near those of its points."""
        mesh = self.mesh
        assert mesh is not None
        members = mesh.groups[face.group][1]
        nodes = np.unique(mesh.cells[members])
        normal, height = np.zeros((len(mesh.points), 3)), np.zeros(len(mesh.points))
        materials = self.scene.input.materials
        items = materials.items() if isinstance(materials, dict) else [(None, materials)]
        of_cell = np.zeros(len(mesh.cells))
        for name, section in items:
            if isinstance(section, Section):
                inside = slice(None) if name is None else mesh.groups[name][1]
                of_cell[inside] = section.face(face.side)
        for column in mesh.cells[members].T:
            np.add.at(normal, column, self.normals[members])
            height[column] = of_cell[members]
        length = np.linalg.norm(normal[nodes], axis=1, keepdims=True)
        return nodes, mesh.points[nodes] + height[nodes, None] * normal[nodes] / length

    def whole(self, group: str) -> bool:
        """Whether the deck has all nodes of a group."""
        if self.mesh is None:
            return True
        dim, members = self.mesh.groups[group]
        if dim == self.scene.mesh.tdim:
            members = np.unique(self.mesh.cells[members])
        elif members.ndim == 2:
            local = reference(self.mesh.cell, self.mesh.order).entity_closure_dofs[
                self.scene.mesh.tdim - 1
            ]
            rows = [self.mesh.cells[c][local[f]] for c, f in members]
            members = np.unique(np.concatenate(rows)) if rows else np.zeros(0, dtype=np.int64)
        return not self.dropped[members].any()

    def nodes_of(self, group: str) -> Ints:
        """Nodes of a group that the deck has."""
        mesh = self.mesh
        if mesh is None:
            return np.zeros(0, dtype=np.int64)
        dim, members = mesh.groups[group]
        tdim = self.scene.mesh.tdim
        if dim == tdim:
            members = np.unique(mesh.cells[members])
        elif dim == tdim - 1 and members.ndim == 2:
            members = self.facet_nodes(members)
        return np.asarray(members[~self.dropped[members]])

    def facet_nodes(self, facets: Ints) -> Ints:
        """Nodes of facets, rows (cell, local facet), ascending."""
        mesh = self.mesh
        assert mesh is not None
        inverse = np.argsort(to_dolfinx(mesh.cell, mesh.order))
        rows = face_nodes(mesh.cell, mesh.order)[_sides(mesh.cell, mesh.order)[facets[:, 1]]]
        return np.unique(mesh.cells[facets[:, :1], inverse[rows]])


def _normals(mesh: Gathered, cells: Ints) -> Array:
    """Unit normals of cells by the order of their first nodes, shape (n_cells, 3)."""
    x = mesh.points[cells[:, :3] if mesh.cell == "triangle" else cells[:, [0, 1, 3]]]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))


def _sides(cell: str, order: int) -> Ints:
    """Number of the deck's face, from 0, of each local facet of DOLFINx."""
    tdim = 2 if cell in ("triangle", "quadrilateral") else 3
    perm = to_dolfinx(cell, order)
    closures = reference(cell, order).entity_closure_dofs[tdim - 1]
    n = len(FACES[cell][0])
    faces = [set(face) for face in FACES[cell]]
    return np.array([faces.index({int(perm[i]) for i in c[:n]}) for c in closures])


__all__ = ["MeshLines"]
