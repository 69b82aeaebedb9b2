"""One numbering of the nodes and cells of all instances of a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.deck.cards import DeckError
from fxcrack.deck.element_checks import check_nodes
from fxcrack.deck.spaces import Space


@dataclass(frozen=True)
class Placed:
    """A space in the numbering of the whole model.

    Attributes:
        space: The part's instance, or what stands outside of instances.
        first_node: Number of its first node.
        cell_labels: Numbers of its elements, ascending.
        cells: The cell of each of them.
    """

    space: Space
    first_node: int
    cell_labels: Ints
    cells: Ints

    def cell_of(self, labels: Ints) -> Ints:
        """Cell of each element number, -1 where there is none."""
        if not len(self.cell_labels):
            return np.full(len(labels), -1, dtype=np.int64)
        at = np.minimum(np.searchsorted(self.cell_labels, labels), len(self.cell_labels) - 1)
        return np.where(self.cell_labels[at] == labels, self.cells[at], -1)


@dataclass(frozen=True)
class Numbering:
    """Nodes and cells of all spaces, one space after the other.

    Attributes:
        placed: Each space with its numbers, by name.
        points: Positions of the nodes, shape (n_nodes, 3).
        cells: Nodes of each cell in the deck's order, shape (n_cells, n_cell_nodes).
    """

    placed: dict[str, Placed]
    points: Array
    cells: Ints


def number_spaces(spaces: Mapping[str, Space]) -> Numbering:
    """Number the nodes and cells of some spaces.

    Args:
        spaces: Instances, and what stands outside of them, by name; their elements are all of one
            kind, and there is one at least.

    Raises:
        DeckError: An element names a node that does not exist, or one node twice; two elements of a
            space have one number.
    """
    placed: dict[str, Placed] = {}
    points: list[Array] = []
    blocks: list[Ints] = []
    n_nodes = n_cells = 0
    for name, space in spaces.items():
        labels, rows = _elements_of(space)
        by_label = np.argsort(labels, kind="stable")
        ordered = labels[by_label]
        twice = np.flatnonzero(np.diff(ordered) == 0)
        if len(twice):
            raise DeckError(
                f"element {int(ordered[twice[0]])} is defined with two types; give every element "
                "a number of its own"
            )
        placed[name] = Placed(space, n_nodes, ordered, n_cells + by_label)
        blocks += [block + n_nodes for block in rows]
        points.append(space.places())
        n_nodes += len(space.nodes.labels)
        n_cells += len(labels)
    return Numbering(placed, np.concatenate(points), np.concatenate(blocks))


def _elements_of(space: Space) -> tuple[Ints, list[Ints]]:
    """Numbers of the elements of a space, and their nodes block by block, within the space."""
    labels, rows = [np.zeros(0, dtype=np.int64)], []
    for block in space.elements.values():
        if not len(block.table.labels):
            continue
        nodes = np.asarray(block.table.rows, dtype=np.int64)
        at = space.nodes.find(nodes)
        if np.any(at < 0):
            row, column = np.argwhere(at < 0)[0]
            block.card.fail(
                f"element {int(block.table.labels[row])} has node {int(nodes[row, column])}, which "
                "is not defined"
            )
        check_nodes(block.card, block.table.labels, nodes)
        labels.append(block.table.labels)
        rows.append(at)
    return np.concatenate(labels), rows


__all__ = ["Numbering", "Placed", "number_spaces"]
