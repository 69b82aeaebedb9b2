"""Element types of decks: cell shape, order, kinematic model, faces, and what replaces them.

Serendipity elements (8-node quadrilaterals, 20-node hexahedra) are raised to the elements with
centre nodes: a centre lies where their own shape functions put it,

    quadrilateral, face   x_c = 1/2 sum x_midside - 1/4 sum x_corner
    hexahedron            x_c = 1/4 sum x_midside - 1/4 sum x_corner

so that the geometry stays exactly what it was. First-order elements may be raised likewise.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.mesh.raw import reference

_CORNERS = {
    "triangle": ((0, 0), (1, 0), (0, 1)),
    "quadrilateral": ((0, 0), (1, 0), (1, 1), (0, 1)),
    "tetrahedron": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "hexahedron": (
        *((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)),
        *((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
    ),
}
_EDGES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetrahedron": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "hexahedron": (
        *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
        *((0, 4), (1, 5), (2, 6), (3, 7)),
    ),
}
FACES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetrahedron": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "hexahedron": (
        *((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1)),
        *((1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    ),
}
"""Corners of the faces S1, S2, ... of each shape."""

_SHAPES = {
    ("plane", 3): ("triangle", 1),
    ("plane", 4): ("quadrilateral", 1),
    ("plane", 6): ("triangle", 2),
    ("plane", 8): ("quadrilateral", 2),
    ("solid", 4): ("tetrahedron", 1),
    ("solid", 8): ("hexahedron", 1),
    ("solid", 10): ("tetrahedron", 2),
    ("solid", 20): ("hexahedron", 2),
}
_SHELLS = {"3": ("triangle", 1), "4": ("quadrilateral", 1), "8": ("quadrilateral", 2)}
_MODELS = {"CPE": "plane strain", "CPS": "plane stress", "CAX": "axisymmetric", "C3D": "solid"}

_REFUSED = (
    (r"STRI65|S6", "second-order triangles lock on curved shells; use S8R, S4R or S3"),
    (r"S9R", "it is not available; use S8R, whose centre nodes are added, or S4R"),
    (r"SAX", "axisymmetric shells are not available; use axisymmetric solids (CAX)"),
    (r"SC6", "prisms have facets of two kinds, which DOLFINx meshes do not; use SC8R"),
    (r"CSS8", "solid shells are not available; use solid elements such as C3D8I"),
    (r"C3D(6|15|18)", "prisms have facets of two kinds, which DOLFINx meshes do not; use hexahedra "
     "or tetrahedra"),
    (r"C3D5", "pyramids are not available; use hexahedra or tetrahedra"),
    (r"COH", "cohesive elements are not available; use *DEBOND along the two surfaces they join"),
    (r"CPEG", "generalised plane strain is not read from decks; use CPE elements, or "
     "GeneralisedPlaneStrain in a script"),
    (r"CGAX", "twist of axisymmetric bodies is not available; use CAX elements"),
    (r"(B|PIPE|ELBOW)[23]", "beams are not available; use solid elements"),
    (r"T[23]D", "trusses are not available; use solid elements"),
    (r"M3D|SFM|MAX|MGAX", "membranes and surface elements are not available; use solid elements"),
    (r"RB", "rigid beams are not available; mesh a stiff body"),
    (r"SPRING|DASHPOT|CONN|JOINT|GAP|MASS|ROTARYI",
     "springs, masses, gaps and connectors are not available; hold or load the bodies"),
    (r"U\d", "user elements cannot be run; use solid elements"),
    (r"C(IN)", "infinite elements are not available; mesh a larger body"),
    (r"AC|DC|EC|Q3D", "only stresses are computed; use stress elements such as C3D8"),
)  # fmt: skip
"""Patterns of element types that are refused, with what would help: the one place to look."""


RIGID_ELEMENTS = {"R2D2": 2, "RAX2": 2, "R3D3": 3, "R3D4": 4}
"""Types of rigid elements, which are no cells, with the number of their nodes."""


@dataclass(frozen=True)
class ElementType:
    """An element type of a deck.

    Attributes:
        name: As the deck calls it.
        cell: Cell shape.
        order: 1 or 2.
        model: Kinematic model: plane strain, plane stress, axisymmetric, solid or shell.
        n_nodes: Nodes the deck gives for each element.
        notes: What is computed in another way than the type says.
        stacked: Whether it is a continuum shell: plies lie from its face S1 to its face S2.
        bends_freely: Whether it is of first order and bends without locking in the deck's
            formulation, which plain elements of full integration do not.
    """

    name: str
    cell: str
    order: int
    model: str
    n_nodes: int
    notes: tuple[str, ...] = ()
    stacked: bool = False
    bends_freely: bool = False

    @property
    def gdim(self) -> int:
        """Dimension of space."""
        return 3 if self.model in ("solid", "shell") else 2

    @property
    def tdim(self) -> int:
        """Dimension of the cells."""
        return 3 if self.model == "solid" else 2

    @property
    def shell(self) -> bool:
        """Whether it is a shell on a surface."""
        return self.model == "shell"

    @property
    def serendipity(self) -> bool:
        """Whether centre nodes must be added."""
        return self.order == 2 and self.cell in ("quadrilateral", "hexahedron")


def element_type(name: str) -> ElementType | str:
    """What an element type stands for, or why it is refused, in words.

    Args:
        name: In capitals, e.g. "C3D20R".
    """
    if name in ("SC8", "SC8R"):
        return ElementType(name, "hexahedron", 1, "solid", 8, stacked=True)
    shell = re.fullmatch(r"S([348])(R?)(5?)(S?W?)", name)
    if shell or name == "STRI3":
        cell, order = _SHELLS[shell[1] if shell else "3"]
        return ElementType(name, cell, order, "shell", int(shell[1]) if shell else 3,
                           _shell_notes(cell, order))  # fmt: skip
    match = re.fullmatch(r"(CPE|CPS|CAX|C3D)(\d+)([A-Z]*)", name)
    if match and match[1] in _MODELS:
        family, n = match[1], int(match[2])
        shape = _SHAPES.get(("solid" if family == "C3D" else "plane", n))
        suffix = match[3]
        if shape and set(suffix) <= set("RIHM") and len(set(suffix)) == len(suffix):
            cell, order = shape
            free = order == 1 and bool(set(suffix) & set("RI"))
            notes = _notes(cell, order, suffix)
            return ElementType(name, cell, order, _MODELS[family], n, notes, bends_freely=free)
    for pattern, words in _REFUSED:
        if re.match(pattern, name):
            return words
    if match and set(match[3]) & set("TPE"):
        return "temperatures, pores and voltages are not computed; use the plain stress element"
    return (
        "this type is not known; plane (CPE, CPS), axisymmetric (CAX) and solid (C3D) stress "
        "elements of 3 to 20 nodes and shells (S3, S4R, S8R, SC8R) are"
    )


def _notes(cell: str, order: int, suffix: str) -> tuple[str, ...]:
    """What is computed in another way."""
    plural = {"tetrahedron": "tetrahedra", "hexahedron": "hexahedra"}.get(cell, f"{cell}s")
    words = {
        "R": f"reduced integration is replaced by full integration of plain {plural}",
        "I": f"incompatible modes are replaced by full integration of plain {plural}",
        "H": f"the hybrid formulation is replaced by displacements alone, plain {plural}",
        "M": f"the modified formulation is replaced by plain {plural}",
    }
    notes = [words[letter] for letter in suffix]
    if order == 2 and cell in ("quadrilateral", "hexahedron"):
        notes.append("centre nodes are added by the element's own shape functions")
    return tuple(notes)


def _shell_notes(cell: str, order: int) -> tuple[str, ...]:
    """What is computed in another way in a shell."""
    shape = f"{'first' if order == 1 else 'second'}-order {cell}s"
    notes = [
        f"the element is replaced by the seven-parameter shell of {shape}, whose director has no "
        "rotation about the normal; transverse shear strains are tied, or integrated with reduced "
        "points in second order, and the other strains are integrated fully"
    ]
    if order == 2:
        notes.append("centre nodes are added by the element's own shape functions")
    return tuple(notes)


@cache
def _local_nodes(cell: str, order: int) -> Array:
    """Reference coordinates of the nodes in the deck's order, centres (edges, faces, cell) last.

    Shape (n_nodes, tdim).
    """
    corners = np.array(_CORNERS[cell], dtype=float)
    if order == 1:
        return corners
    parts = [corners, *(corners[list(e)].mean(axis=0)[None] for e in _EDGES[cell])]
    if cell == "hexahedron":
        parts += [corners[list(f)].mean(axis=0)[None] for f in FACES[cell]]
    if cell in ("quadrilateral", "hexahedron"):
        parts.append(corners.mean(axis=0)[None])
    return np.concatenate(parts)


@cache
def to_dolfinx(cell: str, order: int) -> Ints:
    """Array p that takes nodes in the deck's order, centres last, to DOLFINx order: ``row[p]``."""
    mine, wanted = _local_nodes(cell, order), np.asarray(reference(cell, order).points)
    distance = np.abs(wanted[:, None, :] - mine[None, :, :]).max(axis=2)
    return np.asarray(distance.argmin(axis=1), dtype=np.int64)


@cache
def face_nodes(cell: str, order: int) -> Ints:
    """Local nodes of the faces S1, S2, ... in the deck's order of nodes, centres last.

    Each row is in the order of the rows of :class:`fxcrack.mesh.raw.RawGroup`; shape
    (n_faces, n_face_nodes).
    """
    element = reference(cell, order)
    tdim = len(_CORNERS[cell][0])
    closures = np.array(element.entity_closure_dofs[tdim - 1])
    mine = to_dolfinx(cell, order)[closures]
    rows = []
    for face in FACES[cell]:
        found = [row for row in mine if set(row[: len(face)]) == set(face)]
        rows.append(found[0])
    return np.array(rows, dtype=np.int64)


def added_nodes(kind: ElementType) -> tuple[list[Ints], list[Array]]:
    """Parents of the nodes that are added to make a whole second-order element, and their weights.

    To a serendipity element those of faces and cell are added, by its own shape functions; to a
    first-order element those of edges, faces and cell, by its own as well.

    Args:
        kind: The element of the deck.

    Returns:
        For each added node, in the order in which they follow the deck's nodes, the local parents
        and the weights of their positions.
    """
    cell = kind.cell
    n_corners = len(_CORNERS[cell])
    if kind.order == 1:
        ends = [np.array(e) for e in _EDGES[cell]]
        sides = [np.array(f) for f in FACES[cell]] if cell == "hexahedron" else []
        whole_cell = [np.arange(n_corners)] if cell in ("quadrilateral", "hexahedron") else []
        first = [*ends, *sides, *whole_cell]
        return first, [np.full(len(p), 1.0 / len(p)) for p in first]
    edges = [tuple(sorted(e)) for e in _EDGES[cell]]

    def of_face(face: tuple[int, ...]) -> tuple[Ints, Array]:
        around = zip(face, face[1:] + face[:1], strict=True)
        middles = [n_corners + edges.index((min(a, b), max(a, b))) for a, b in around]
        return (
            np.array([*face, *middles]),
            np.array([-0.25] * len(face) + [0.5] * len(middles)),
        )

    if cell == "quadrilateral":
        parents, weights = of_face((0, 1, 2, 3))
        return [parents], [weights]
    faces = [of_face(face) for face in FACES[cell]]
    whole = np.arange(20), np.array([-0.25] * 8 + [0.25] * 12)
    parts = [*faces, whole]
    return [p for p, _ in parts], [w for _, w in parts]
