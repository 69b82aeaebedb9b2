"""What all elements of a deck must be like: of one kind, without repeated nodes; shared faces."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Ints
from fxcrack.deck.cards import Card, DeckError
from fxcrack.deck.elements import ElementType
from fxcrack.deck.spaces import Space
from fxcrack.mesh.raw import row_ids

_FACTORS = np.array(
    [0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB8669FD5B3],
    dtype=np.uint64,
)
"""Odd numbers with bits all over, for a hash of up to four node numbers."""


def repetitions(rows: Ints) -> Ints:
    """How often each row occurs, shape (n_rows,).

    Args:
        rows: Each sorted, shape (n_rows, k), k at most 4.
    """
    hashes = (rows.astype(np.uint64) * _FACTORS[: rows.shape[1]]).sum(axis=1, dtype=np.uint64)
    order = np.argsort(hashes)
    ordered = hashes[order]
    same = ordered[1:] == ordered[:-1]
    if not np.array_equal(rows[order[1:][same]], rows[order[:-1][same]]):
        ids = row_ids(rows)  # two rows with one hash: it may happen once in a million meshes
        return np.asarray(np.bincount(ids)[ids])
    number = np.concatenate(([0], np.cumsum(~same)))
    out = np.empty(len(rows), dtype=np.int64)
    out[order] = np.bincount(number)[number]
    return out


def one_kind(spaces: list[Space]) -> ElementType:
    """The shape, order and kinematic model that all elements share."""
    blocks = [b for space in spaces for b in space.elements.values() if len(b.table.labels)]
    if not blocks:
        raise DeckError("the deck has no elements that fxcrack can compute; add *ELEMENT")
    first = blocks[0]
    for block in blocks[1:]:
        for what, a, b in (
            ("kinematic models", first.kind.model, block.kind.model),
            ("shapes", first.kind.cell, block.kind.cell),
            ("orders", first.kind.order, block.kind.order),
        ):
            if a != b:
                block.card.fail(
                    f"{block.kind.name} elements stand beside {first.kind.name} elements "
                    f"({first.card.place}): all elements must be of one of the {what}; mesh the "
                    "model with one element shape and order"
                )
    return first.kind


def check_nodes(card: Card, labels: Ints, nodes: Ints) -> None:
    """Refuse elements that have one node twice."""
    ordered = np.sort(nodes, axis=1)
    bad = np.flatnonzero((np.diff(ordered, axis=1) == 0).any(axis=1))
    if len(bad):
        card.fail(
            f"{len(bad)} of {len(labels)} elements have a node more than once, the first is "
            f"element {int(labels[bad[0]])}; degenerate elements are not available: mesh that "
            "place with whole elements"
        )


__all__ = ["check_nodes", "one_kind", "repetitions"]
