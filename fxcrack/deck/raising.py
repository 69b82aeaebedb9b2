"""Whole second-order elements of first-order and serendipity ones: the nodes that they lack."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.deck.elements import ElementType, added_nodes
from fxcrack.mesh.raw import row_ids


@dataclass(frozen=True)
class Raised:
    """A mesh of whole second-order elements.

    Attributes:
        points: Positions of the nodes, added ones last, shape (n_nodes, 3), length.
        cells: Nodes of each cell, added ones last, shape (n_cells, n_cell_nodes).
        parents: Nodes of which each added node is made, shape (n_added, k), -1 for none.
        weights: Their weights, same shape.
    """

    points: Array
    cells: Ints
    parents: Ints
    weights: Array


def raise_order(kind: ElementType, points: Array, cells: Ints) -> Raised:
    """Append the nodes that whole second-order elements lack, each once.

    Args:
        kind: The element of the deck.
        points: Positions of its nodes, shape (n, 3), length.
        cells: Nodes of the cells in the deck's order, shape (n_cells, n_cell_nodes).
    """
    locals_, of_local = added_nodes(kind)
    width = max(len(p) for p in locals_)
    parents: Ints = np.zeros((0, width), dtype=np.int64)
    weights = np.zeros((0, width))
    numbers = []
    n, columns = len(points), cells[:, : kind.n_nodes]
    for local, weight in zip(locals_, of_local, strict=True):
        nodes = columns[:, local]
        whole = len(local) == kind.n_nodes
        if whole:
            first = np.arange(len(nodes))
            inverse = first
        else:
            ids = row_ids(np.sort(nodes, axis=1))
            _, first, inverse = np.unique(ids, return_index=True, return_inverse=True)
        kept = np.full((len(first), width), -1, dtype=np.int64)
        kept[:, : len(local)] = nodes[first]
        scale = np.zeros((len(first), width))
        scale[:, : len(local)] = weight
        known = np.full(len(kept), -1, dtype=np.int64)
        if len(parents) and not whole:
            known = _known(n, parents[:, : len(local)], kept[:, : len(local)])
        new = known < 0
        number = known.copy()
        number[new] = n + len(parents) + np.arange(int(new.sum()))
        parents = np.concatenate((parents, kept[new]))
        weights = np.concatenate((weights, scale[new]))
        numbers.append(number[inverse])
    added = np.einsum("nk,nkc->nc", weights, points[np.maximum(parents, 0)])
    return Raised(
        np.concatenate((points, added)), np.column_stack((columns, *numbers)), parents, weights
    )


def _known(n: int, parents: Ints, nodes: Ints) -> Ints:
    """Number of the centre that faces of another local number already have, -1 for none.

    Args:
        n: Number of the first added node.
        parents: Nodes of the faces that have a centre, shape (n_added, k).
        nodes: Nodes of faces, shape (n_faces, k).
    """
    out = np.full(len(nodes), -1, dtype=np.int64)
    ids = row_ids(np.sort(np.concatenate((parents, nodes)), axis=1))
    old, mine = ids[: len(parents)], ids[len(parents) :]
    order = np.argsort(old)
    at = np.minimum(np.searchsorted(old[order], mine), len(old) - 1)
    found = old[order][at] == mine
    out[found] = n + order[at][found]
    return out


__all__ = ["Raised", "raise_order"]
