"""Nodes, elements and sets of one part, of one instance, or of the deck outside of parts.

A space holds what has numbers of its own. Sets are kept by number; an assembly's sets may hold
nodes of several instances, so a set has one list of numbers for each space.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.deck.cards import Card
from fxcrack.deck.elements import ElementType

HOME = ""
"""Key of a set's members in its own space."""


def distinct(values: Ints) -> Ints:
    """Sorted values, each once, shape (n,); by sorting, as hashing is slow for millions."""
    found = np.sort(values)
    keep = np.ones(len(found), dtype=bool)
    keep[1:] = found[1:] != found[:-1]
    return found[keep]


class Numbered:
    """Rows with a number each; a number given again replaces the row before.

    Args:
        width: Columns of the rows.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._labels: list[Ints] = []
        self._rows: list[Any] = []
        self._dirty = False

    def add(self, labels: Ints, rows: Array | Ints) -> None:
        """Append rows, shape (n, width), with their numbers, shape (n,)."""
        self._labels.append(np.asarray(labels, dtype=np.int64))
        self._rows.append(rows)
        self._dirty = True

    def _merge(self) -> None:
        if not self._dirty:
            return
        labels, rows = np.concatenate(self._labels), np.concatenate(self._rows)
        if np.any(np.diff(labels) <= 0):
            # the last row of each number
            _, last = np.unique(labels[::-1], return_index=True)
            kept = len(labels) - 1 - last
            labels, rows = labels[kept], rows[kept]
        self._labels, self._rows, self._dirty = [labels], [rows], False

    @property
    def labels(self) -> Ints:
        """Numbers, ascending, shape (n,)."""
        self._merge()
        return self._labels[0] if self._labels else np.zeros(0, dtype=np.int64)

    @property
    def rows(self) -> Any:
        """Rows in the order of :attr:`labels`, shape (n, width)."""
        self._merge()
        return self._rows[0] if self._rows else np.zeros((0, self._width))

    def find(self, labels: Ints) -> Ints:
        """Position of each number among :attr:`labels`, -1 where there is none."""
        known = self.labels
        if not len(known):
            return np.full(np.shape(labels), -1, dtype=np.int64)
        at = np.minimum(np.searchsorted(known, labels), len(known) - 1)
        return np.where(known[at] == labels, at, -1)

    def copy(self) -> Numbered:
        """A copy to which rows can be added."""
        out = Numbered(self._width)
        out.add(self.labels, self.rows)
        return out


@dataclass
class Elements:
    """Elements of one type: numbers and nodes (by number), one row each."""

    kind: ElementType
    table: Numbered
    card: Card


@dataclass
class NamedSet:
    """A set of nodes or elements.

    Attributes:
        name: As the deck's author wrote it.
        members: Numbers in each space, unique; by name of the instance, :data:`HOME` for the
            set's own space.
        card: The card that made it.
        internal: Whether another program made it for itself.
    """

    name: str
    members: dict[str, Ints]
    card: Card
    internal: bool = False

    def add(self, space: str, labels: Ints, *, ordered: bool = False) -> None:
        """Append members of a space; sorted unless their order counts."""
        both = np.concatenate((self.members.get(space, np.zeros(0, dtype=np.int64)), labels))
        if ordered:
            both = both[np.sort(np.unique(both, return_index=True)[1])]
        self.members[space] = both if ordered else distinct(both)

    @property
    def home(self) -> Ints:
        """Members in its own space."""
        return self.members.get(HOME, np.zeros(0, dtype=np.int64))


@dataclass
class SurfaceDef:
    """A surface as the deck defines it: its data are read when all elements are known."""

    name: str
    card: Card


@dataclass
class Space:
    """What has numbers of its own.

    Attributes:
        name: Of the part or instance; empty outside of them.
        nodes: Coordinates by number, shape (n, 3).
        elements: Elements by type.
        nsets: Sets of nodes by key.
        elsets: Sets of elements by key.
        surfaces: By key.
        sections: Section cards.
        orientations: Orientation cards by key.
        others: Further cards that belong to it.
        rotation: Of an instance, shape (3, 3).
        shift: Of an instance, after the rotation, shape (3,).
    """

    name: str
    nodes: Numbered = field(default_factory=lambda: Numbered(3))
    elements: dict[str, Elements] = field(default_factory=dict)
    nsets: dict[str, NamedSet] = field(default_factory=dict)
    elsets: dict[str, NamedSet] = field(default_factory=dict)
    surfaces: dict[str, SurfaceDef] = field(default_factory=dict)
    sections: list[Card] = field(default_factory=list)
    orientations: dict[str, Card] = field(default_factory=dict)
    others: list[Card] = field(default_factory=list)
    rotation: Array = field(default_factory=lambda: np.eye(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))

    def instance(self, name: str) -> Space:
        """An instance of this part, with what it holds so far."""
        return Space(
            name,
            self.nodes.copy(),
            {k: Elements(e.kind, e.table.copy(), e.card) for k, e in self.elements.items()},
            {k: NamedSet(s.name, dict(s.members), s.card, s.internal)
             for k, s in self.nsets.items()},
            {k: NamedSet(s.name, dict(s.members), s.card, s.internal)
             for k, s in self.elsets.items()},
            dict(self.surfaces),
            list(self.sections),
            dict(self.orientations),
            list(self.others),
        )  # fmt: skip

    def places(self) -> Array:
        """Positions of the nodes, shape (n, 3), length."""
        return np.asarray(self.nodes.rows @ self.rotation.T + self.shift)

    @property
    def element_labels(self) -> Ints:
        """Numbers of all elements, ascending, shape (n,)."""
        parts = [e.table.labels for e in self.elements.values()]
        return distinct(np.concatenate(parts)) if parts else np.zeros(0, dtype=np.int64)

    def add_to_set(
        self, card: Card, kind: str, name: str, labels: Ints, *, space: str = HOME
    ) -> None:
        """Append members to a set, which is made if it does not exist.

        Args:
            card: The card that says so.
            kind: "nsets" or "elsets".
            name: Of the set, as written.
            labels: Numbers, shape (n,).
            space: Of the members.
        """
        sets: dict[str, NamedSet] = getattr(self, kind)
        found = sets.setdefault(
            name.upper(), NamedSet(name, {}, card, internal=card.has("INTERNAL"))
        )
        found.add(space, labels, ordered=card.has("UNSORTED"))


def existing(card: Card, name: str, labels: Ints, positions: Ints, what: str) -> Ints:
    """Positions of the members of a set that exist; the others are warned of."""
    lost = positions < 0
    if np.any(lost):
        log.warn(
            "%s: %d of the %d %s of set '%s' do not exist, the first is %d; they are ignored",
            card.place,
            int(lost.sum()),
            len(labels),
            what,
            name,
            int(labels[lost][0]),
        )
    return positions[~lost]
