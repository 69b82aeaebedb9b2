"""Elements that only mark lines and surfaces of a mesh.

Mesh generators export them beside the elements of the bodies (trusses on lines, plane elements on
the surfaces of solids). They have no section and a lower dimension than the bodies: they are no
bodies, and their nodes may be used as sets.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Ints
from fxcrack.deck.cards import key
from fxcrack.deck.report import Report
from fxcrack.deck.spaces import Markers, Numbered, Space, distinct

_LINES = re.compile(r"T[23]D(\d)|B[23](\d)")
_FACES = re.compile(r"(?:M3D|SFM3D)(\d)R?")


@dataclass(frozen=True)
class _Shape:
    """Nodes and dimension of an element that may mark a part of a mesh."""

    n_nodes: int
    dimension: int


def marker_nodes(name: str) -> int | None:
    """Nodes of an element type that has no word here but may mark lines or surfaces.

    Args:
        name: Of the type, in capitals.

    Returns:
        Their number; ``None`` for other types.
    """
    shape = _shape(name)
    return None if shape is None else shape.n_nodes


def _shape(name: str) -> _Shape | None:
    line, face = _LINES.fullmatch(name), _FACES.fullmatch(name)
    if line:
        return _Shape(int(line[1]) if line[1] else int(line[2]) + 1, 1)
    return _Shape(int(face[1]), 2) if face else None


def sort_out_markers(spaces: Iterable[Space], report: Report) -> None:
    """Take elements that only mark parts of the mesh away from those of the bodies.

    Args:
        spaces: The instances, and what stands outside of them; changed in place.
        report: Takes what is left out, and the types that are no marks and have no word here.
    """
    spaces = list(spaces)
    with_section = [_with_section(space) for space in spaces]
    bodies = [
        block.kind.tdim
        for space, sections in zip(spaces, with_section, strict=True)
        for block in space.elements.values()
        if np.isin(block.table.labels, sections).any()
    ]
    dimension = max(bodies, default=0)
    for space, sections in zip(spaces, with_section, strict=True):
        for name, block in list(space.elements.items()):
            if block.kind.tdim < dimension and not _any(block.table, sections):
                del space.elements[name]
                space.markers[name] = Markers(block.card, "", block.table)
        for name, marks in space.markers.items():
            shape = _shape(name)
            lower = shape is None or shape.dimension < dimension
            if marks.refusal and (not lower or _any(marks.table, sections)):
                if marks.refusal not in report.refused:
                    report.refused.append(marks.refusal)
                continue
            n = len(marks.table.labels)
            report.replace(
                f"{n} element{'s' if n > 1 else ''} of type {name} {'have' if n > 1 else 'has'} no "
                "section and only mark lines or surfaces of the mesh: left out",
                marks.card,
            )


def _with_section(space: Space) -> Ints:
    """Numbers of the elements of a space that a section names."""
    named = [card.text("ELSET", default="") for card in space.sections]
    sets = [space.elsets[key(name)] for name in named if key(name) in space.elsets]
    parts = [one.home for one in sets]
    return distinct(np.concatenate(parts)) if parts else np.zeros(0, dtype=np.int64)


def _any(table: Numbered, labels: Ints) -> bool:
    return bool(np.isin(table.labels, labels).any())


def nodes_of_markers(space: Space, labels: Ints) -> Ints:
    """Numbers of the nodes of marks with some element numbers, ascending.

    Args:
        space: Where they are.
        labels: Numbers of elements, shape (n,).
    """
    found = []
    for marks in space.markers.values():
        at = marks.table.find(labels)
        found.append(np.asarray(marks.table.rows[at[at >= 0]], dtype=np.int64).ravel())
    return distinct(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)


__all__ = ["marker_nodes", "nodes_of_markers", "sort_out_markers"]
