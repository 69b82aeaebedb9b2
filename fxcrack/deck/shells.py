"""Conventional shells of decks: normals, sections, rotations held by supports.

The positive side SPOS of an element is that from which its nodes are seen counter-clockwise; it is
the top of the shell. Material axis 1 is an axis of the orientation projected on the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.continuum.laminate import Laminate, Ply
from fxcrack.continuum.materials import Isotropic
from fxcrack.continuum.section import Section
from fxcrack.deck.cards import Card, DeckError
from fxcrack.deck.flat import Flat

_UPRIGHT = 0.1
"""Component along the normal that the axis of an orientation about which it turns must have."""
_ALONG = np.cos(np.radians(0.1))
"""Component of the normal along x beyond which the default axis 1 is z."""


def cell_normals(flat: Flat, cells: Ints) -> Array:
    """Unit normals of some shell elements to their positive side, shape (n, 3)."""
    n = 3 if flat.kind.cell == "triangle" else 4
    x = flat.points[flat.cells[cells, :n]]
    one, other = (x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) if n == 3 else (
        x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])  # fmt: skip
    normal = np.cross(one, other)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))


def check_normals(flat: Flat) -> None:
    """Refuse neighbours whose positive sides differ: SPOS and SNEG would change sides between them.

    Raises:
        DeckError: There are such neighbours; names two.
    """
    n = 3 if flat.kind.cell == "triangle" else 4
    ring = flat.cells[:, :n]
    edges = np.stack([ring, np.roll(ring, -1, axis=1)], axis=2).reshape(-1, 2)
    order = np.lexsort(edges.T[::-1])
    same = (np.diff(edges[order], axis=0) == 0).all(axis=1)
    if not same.any():
        return
    i = int(np.argmax(same))
    pair = sorted(int(edge) // n for edge in order[i : i + 2])
    names = []
    card = None
    for cell in pair:
        for placed in flat.placed.values():
            at = np.flatnonzero(placed.cells == cell)
            if len(at):
                names.append(int(placed.cell_labels[at[0]]))
                card = next(iter(placed.space.elements.values())).card
    assert card is not None
    card.fail(
        f"the positive sides of {int(same.sum())} pairs of neighbouring shell elements differ, "
        f"first of {' and '.join(map(str, names))}; number their nodes in the same sense, or give "
        "parts that meet in a joint nodes of their own"
    )


def section_axis(
    section: Card,
    orientation: tuple[Array, int] | None,
    normals: Array,
    *,
    isotropic: bool,
) -> tuple[float, float, float]:
    """Direction that is projected on the surface as material axis 1.

    Args:
        section: The section, for messages.
        orientation: Axes of its orientation (rows) and number (from 0) of the axis that is about
            the normal, ``None`` without an orientation.
        normals: Normals of its elements, shape (n, 3).
        isotropic: Whether the direction does not matter.

    Raises:
        DeckError: The axis of the orientation lies in the surface.
    """
    if isotropic:
        along = np.abs(normals).max(axis=0)
        return tuple(float(c) for c in np.eye(3)[int(np.argmin(along))])  # type: ignore[return-value]
    if orientation is None:
        axis = np.eye(3)[2 if np.abs(normals[:, 0]).min() > _ALONG else 0]
        return tuple(float(c) for c in axis)  # type: ignore[return-value]
    axes, about = orientation
    if np.abs(normals @ axes[about]).min() < _UPRIGHT:
        section.fail(
            f"axis {about + 1} of its *ORIENTATION lies in the surface; on the second data line of "
            "*ORIENTATION name the axis along the normal (for instance 3, 0.)"
        )
    return tuple(float(c) for c in axes[(about + 1) % 3])  # type: ignore[return-value]


def surface_section(card: Card, made: Sequence[Any], axis: tuple[float, float, float]) -> Section:
    """Section of a shell.

    Args:
        card: ``*SHELL SECTION``.
        made: Material of the section, or of each of its plies, bottom first.
        axis: Direction that is projected as axis 1.

    Raises:
        DeckError: A thickness, an angle or a material is not possible.
    """
    try:
        if card.has("COMPOSITE"):
            plies = [
                Ply(row.number(0), row.number(3, 0.0, what="the angle of the ply"), material)
                for row, material in zip(card.rows(), made, strict=True)
            ]
            if card.has("SYMMETRIC"):
                plies += plies[::-1]
            section = Section(Laminate(plies), axis=axis)
        else:
            rows = card.need_rows("the thickness")
            section = Section(made[0], thickness=rows[0].number(0), axis=axis)
        shift = _offset(card) * section.height
        return Section(section.material, section.thickness, axis=axis, offset=-shift)
    except InputError as error:
        if isinstance(error, DeckError):
            raise
        return card.fail(str(error))


def is_isotropic(made: Sequence[Any]) -> bool:
    """Whether no material of a section has axes."""
    return all(isinstance(material, Isotropic) for material in made)


def _offset(card: Card) -> float:
    """Reference surface from the middle, over the thickness, to the positive side."""
    word = card.word("OFFSET", "0")
    if word in ("SPOS", "SNEG"):
        return 0.5 if word == "SPOS" else -0.5
    return card.number("OFFSET", 0.0)


__all__ = ["cell_normals", "check_normals", "is_isotropic", "section_axis", "surface_section"]
