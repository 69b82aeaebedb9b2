"""Rigid elements (R2D2, R3D4, ...): no cells of the mesh, but surfaces that bodies meet."""

from __future__ import annotations

from collections.abc import Set as AbstractSet

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.deck.cards import Card, DeckError, key
from fxcrack.deck.flat import Flat
from fxcrack.deck.spaces import SurfaceDef

Label = tuple[str, int]
"""Instance and number of an element."""


def rigid_labels(flat: Flat, place: str, card: Card, name: str) -> AbstractSet[Label]:
    """The rigid elements of a set, or one of them by its number.

    Args:
        flat: The model.
        place: Space of the card that names it.
        card: That card, for messages.
        name: Of the set, or a number.
    """
    if key(name).rpartition(".")[2].isdigit():
        first, _, number = key(name).rpartition(".")
        found = {first or place: np.array([int(number)])}
    else:
        own = flat.placed[place].space.elsets.get(key(name))
        home, named = (place, own) if own is not None else flat.element_set(card, name)
        found = {(p or home): labels for p, labels in named.members.items()}
    out: set[Label] = set()
    for space, labels in found.items():
        if space not in flat.placed:
            continue
        known = flat.placed[space].space.rigid_labels
        out |= {(space, int(label)) for label in labels[np.isin(labels, known)]}
    return out


def rigid_faces(
    flat: Flat, place: str, surface: SurfaceDef
) -> tuple[list[Array], AbstractSet[Label]]:
    """Facets of rigid elements that a surface consists of.

    Args:
        flat: The model.
        place: Space of the surface.
        surface: The surface.

    Returns:
        Corners of each facet in the order in which its positive side, counter-clockwise, is that of
        the surface, shape (2 to 4, 3), length; and the elements.

    Raises:
        DeckError: A side is none of SPOS and SNEG.
    """
    corners: list[Array] = []
    every: set[Label] = set()
    if surface.card.word("TYPE", "ELEMENT") != "ELEMENT" or surface.card.has("COMBINE"):
        return corners, every
    for row in surface.card.rows():
        if not row.text(0):
            continue
        labels = rigid_labels(flat, place, surface.card, row.text(0))
        if not labels:
            continue
        side = row.text(1).upper()
        if side not in ("SPOS", "SNEG"):
            row.fail("rigid elements have the sides SPOS and SNEG; give the one the bodies meet")
        every |= labels
        for space, label in sorted(labels):
            found = _corners(flat, space, label)
            corners.append(found if side == "SPOS" else found[::-1])
    return corners, every


def _corners(flat: Flat, space: str, label: int) -> Array:
    placed = flat.placed[space]
    for table in placed.space.rigid.values():
        known, rows = table.look_up(np.array([label]))
        if known[0]:
            nodes: Ints = rows[0].astype(np.int64)
            at = placed.space.nodes.find(nodes)
            if np.any(at < 0):
                raise DeckError(
                    f"rigid element {label} has node {int(nodes[np.argmax(at < 0)])}, which is not "
                    "defined"
                )
            return np.asarray(flat.points[placed.first_node + at])
    return np.zeros((0, 3))


__all__ = ["rigid_faces", "rigid_labels"]
