"""Shells and continuum shells of a scene as elements, sections and surfaces of a deck.

A conventional shell has its positive side where the scene has its top: elements whose nodes run the
other way round are turned. A continuum shell is stacked from its face S1 to its face S2: the nodes
of its elements are renumbered so that these are its bottom and top.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.laminate import Laminate
from fxcrack.continuum.materials import Isotropic, Orthotropic, directions
from fxcrack.continuum.section import Section
from fxcrack.deck.elements import FACES
from fxcrack.deck.lines import number
from fxcrack.deck.write_properties import material_lines
from fxcrack.deck.write_steps import refuse

SHELLS = {("triangle", 1): "S3", ("quadrilateral", 1): "S4", ("quadrilateral", 2): "S8R"}
"""Element types of shells by cell and order."""
_TURNED = {"S3": (0, 2, 1), "S4": (0, 3, 2, 1), "S8R": (0, 3, 2, 1, 7, 6, 5, 4)}
_POINTS = 3
"""Integration points of a ply, which a deck must name."""
_GLOBAL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def shell_type(cell: str, order: int) -> str:
    """Element type of a shell on a surface mesh.

    Raises:
        InputError: Decks have none that is read.
    """
    if (cell, order) not in SHELLS:
        refuse(f"shells on a mesh of {cell}s of order {order}")
    return SHELLS[cell, order]


def turned(name: str, cells: Ints, signs: Array) -> Ints:
    """Nodes of shell elements in an order that gives them their positive side.

    Args:
        name: Element type.
        cells: Nodes in the deck's order, shape (n_cells, n_nodes).
        signs: -1 where the positive side is not that of the order of the nodes, shape (n_cells,).
    """
    order = np.array([*_TURNED[name], *range(len(_TURNED[name]), cells.shape[1])])
    return np.where(signs[:, None] < 0.0, cells[:, order], cells)


def _rotations() -> list[tuple[int, ...]]:
    """The 24 orders of the corners of a hexahedron that keep it right-handed."""
    ring = (1, 2, 3, 0, 5, 6, 7, 4)  # about the axis from S1 to S2
    tip = (4, 5, 1, 0, 7, 6, 2, 3)  # S3 and S5 come to lie where S1 and S2 were
    found = {tuple(range(8))}
    while True:
        more = {tuple(one[i] for i in turn) for one in found for turn in (ring, tip)}
        if more <= found:
            return sorted(found)
        found |= more


ROTATIONS = np.array(_rotations())
"""Orders of the corners, one a row."""


def _moved() -> Ints:
    """Where each face S1 to S6 (from 0) comes to lie by each rotation, shape (24, 6)."""
    faces = [set(face) for face in FACES["hexahedron"]]
    out = np.zeros((len(ROTATIONS), 6), dtype=np.int64)
    for i, rotation in enumerate(ROTATIONS):
        for new, face in enumerate(faces):
            out[i, faces.index({int(rotation[k]) for k in face})] = new
    return out


MOVED = _moved()


@dataclass(frozen=True)
class Stacks:
    """Elements of continuum shells of a mesh of hexahedra.

    Attributes:
        stacked: Whether a cell is one, shape (n_cells,).
        rotation: Row of :data:`ROTATIONS` that each cell is written with, shape (n_cells,).
    """

    stacked: Bools
    rotation: Ints


def stacks(corners: Ints, shells: list[tuple[Ints, Ints]]) -> Stacks:
    """Find the bottom of every cell of continuum shells.

    Args:
        corners: Corner nodes of the cells in the deck's order, shape (n_cells, 8).
        shells: Of each shell its cells, shape (n,), and the faces of its bottom as rows (cell, face
            from 0).

    Raises:
        InputError: Cells are not stacked on the bottom.
    """
    table = np.array(FACES["hexahedron"])
    opposite = np.array([1, 0, 4, 5, 2, 3])
    stacked = np.zeros(len(corners), dtype=bool)
    rotation = np.zeros(len(corners), dtype=np.int64)
    upright = np.array([int(np.flatnonzero(MOVED[:, face] == 0)[0]) for face in range(6)])
    for cells, bottom in shells:
        stacked[cells] = True
        faces = np.sort(corners[cells][:, table], axis=2)
        of_face: dict[tuple[int, ...], list[tuple[int, int]]] = {}
        for i, cell in enumerate(cells.tolist()):
            for f in range(6):
                of_face.setdefault(tuple(faces[i, f].tolist()), []).append((cell, f))
        place = {int(cell): i for i, cell in enumerate(cells)}
        todo = [(int(c), int(f)) for c, f in bottom if int(c) in place]
        done: set[int] = set()
        while todo:
            cell, face = todo.pop()
            if cell in done:
                continue
            done.add(cell)
            rotation[cell] = upright[face]
            above = tuple(faces[place[cell], opposite[face]].tolist())
            todo += [(c, f) for c, f in of_face[above] if c != cell]
        if len(done) < len(cells):
            refuse("continuum shells of which cells do not stand on the bottom")
    return Stacks(stacked, rotation)


def section_lines(
    name: str,
    title: str,
    section: Section | ContinuumShell,
    inertia: Inertia | None,
    normals: Array,
) -> list[str]:
    """Lines of a shell section with its materials and its orientation.

    Args:
        name: Group of cells.
        title: Beginning of the names of materials and of the orientation.
        section: The section.
        inertia: Density of all bodies and damping, in a scene whose bodies move.
        normals: Unit normals of its cells to the top, shape (n, 3).

    Raises:
        InputError: A deck has no word for it.
    """
    what = f"the section of '{name}'"
    factors = section.shear_factor if isinstance(section, Section) else section.shear_factors
    if factors is not None:
        refuse(f"{what}: factors of transverse shear")
    laminate = section.laminate
    found = section.material if isinstance(section, Section) else section.section
    composite = isinstance(found, Laminate)
    out: list[str] = []
    names: dict[object, str] = {}
    for ply in laminate.plies:
        material = ply.material
        if isinstance(material, Orthotropic) and not np.allclose(
            directions(title, material.frame), _GLOBAL, rtol=0.0, atol=1e-14
        ):
            refuse(f"{what}: a ply material with a frame of its own")
        if material not in names:
            names[material] = title if not names else f"{title} {len(names) + 1}"
            out += material_lines(names[material], material, inertia)[0]  # type: ignore[arg-type]
    card = f'*SHELL SECTION, ELSET="{name}"'
    if not all(isinstance(ply.material, Isotropic) for ply in laminate.plies):
        out += _orientation(what, title, section.axis, normals)
        card += f', ORIENTATION="{title}"'
    if isinstance(section, Section) and section.offset:
        card += f", OFFSET={number(-section.offset / section.height)}"
    if not composite:
        thickness = section.thickness if isinstance(section, Section) else 1.0
        assert thickness is not None
        return [*out, f'{card}, MATERIAL="{names[laminate.plies[0].material]}"', number(thickness)]
    return [
        *out,
        f"{card}, COMPOSITE",
        *(
            f'{number(ply.thickness)}, {_POINTS}, "{names[ply.material]}", {number(ply.angle)}'
            for ply in laminate.plies
        ),
    ]


def _orientation(what: str, title: str, axis: object, normals: Array) -> list[str]:
    """An orientation whose axis 1 is the axis, and whose axis 3 is near the normals."""
    if axis is None or callable(axis):
        refuse(f"{what}: an axis that is a function of position")
    first = np.asarray(axis, dtype=float)
    mean = normals.sum(axis=0)
    second = np.cross(mean, first)
    if np.linalg.norm(second) <= 1e-3 * np.linalg.norm(first) * len(normals):
        second = np.cross(np.eye(3)[int(np.argmin(np.abs(first)))], first)
    numbers = [*first.tolist(), *second.tolist()]
    return [f'*ORIENTATION, NAME="{title}"', ", ".join(map(number, numbers)), "3, 0."]


__all__ = ["MOVED", "ROTATIONS", "Stacks", "section_lines", "shell_type", "stacks", "turned"]
