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
from fxcrack.continuum.laminate import Laminate
from fxcrack.continuum.ply import Ply
from fxcrack.continuum.section import Section
from fxcrack.deck.cards import Card, DeckError
from fxcrack.deck.flat import Flat

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


def default_direction(normals: Array, *, isotropic: bool) -> Array:
    """Direction that is projected on the surface as axis 1 without an orientation, shape (3,).

    Args:
        normals: Normals of the elements, shape (n, 3).
        isotropic: Whether the direction does not matter.
    """
    if isotropic:
        return np.asarray(np.eye(3)[int(np.argmin(np.abs(normals).max(axis=0)))])
    return np.asarray(np.eye(3)[2 if np.abs(normals[:, 0]).min() > _ALONG else 0])


def surface_section(
    card: Card,
    made: Sequence[Any],
    axis: tuple[float, float, float],
    angles: Sequence[float],
    thickness: float | None,
) -> Section:
    """Section of a shell.

    Args:
        card: ``*SHELL SECTION``.
        made: Material of the section, or of each of its plies, bottom first.
        axis: Direction that is projected as axis 1.
        angles: Of the plies, degrees.
        thickness: Of the whole section where a distribution gives it: plies are scaled to it.

    Raises:
        DeckError: A thickness, an angle or a material is not possible.
    """
    try:
        if card.has("COMPOSITE"):
            heights = [row.number(0) for row in card.rows()]
            whole = sum(heights) * (2.0 if card.has("SYMMETRIC") else 1.0)
            factor = 1.0 if thickness is None else thickness / whole
            plies = [
                Ply(factor * height, angle, material)
                for height, angle, material in zip(heights, angles, made, strict=True)
            ]
            if card.has("SYMMETRIC"):
                plies += plies[::-1]
            section = Section(Laminate(plies), axis=axis)
        else:
            if thickness is None:
                thickness = card.need_rows("the thickness")[0].number(0)
            section = Section(made[0], thickness=thickness, axis=axis)
        shift = _offset(card) * section.height
        return Section(section.material, section.thickness, axis=axis, offset=-shift)
    except InputError as error:
        if isinstance(error, DeckError):
            raise
        return card.fail(str(error))


def _offset(card: Card) -> float:
    """Reference surface from the middle, over the thickness, to the positive side."""
    word = card.word("OFFSET", "0")
    if word in ("SPOS", "SNEG"):
        return 0.5 if word == "SPOS" else -0.5
    return card.number("OFFSET", 0.0)


__all__ = ["cell_normals", "check_normals", "default_direction", "surface_section"]
