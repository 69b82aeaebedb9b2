"""Nodes, elements and sets of one part, of one instance, or of the deck outside of parts.

A space holds what has numbers of its own. Sets are kept by number; an assembly's sets may hold
nodes of several instances, so a set has one list of numbers for each space.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
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

    Rows that are added in many portions are kept as sorted runs, of which a later one that has come
    up to half the size of the one before is merged with it: the work is n log n in all.

    Args:
        width: Columns of the rows.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._runs: list[tuple[Ints, Any]] = []

    def add(self, labels: Ints, rows: Array | Ints) -> None:
        """Append rows, shape (n, width), with their numbers, shape (n,)."""
        labels = np.asarray(labels, dtype=np.int64)
        if not len(labels):
            return
        if np.any(labels[1:] <= labels[:-1]):
            labels, rows = _last_of_each(labels, np.asarray(rows))
        self._runs.append((labels, rows))
        while len(self._runs) > 1 and 2 * len(self._runs[-1][0]) >= len(self._runs[-2][0]):
            self._join()

    def _join(self) -> None:
        """Merge the last two runs; rows of the later one count."""
        (old, old_rows), (new, new_rows) = self._runs[-2:]
        if new[-1] < old[0]:
            merged = np.concatenate((new, old)), np.concatenate((new_rows, old_rows))
        else:
            labels, rows = np.concatenate((old, new)), np.concatenate((old_rows, new_rows))
            merged = (labels, rows) if old[-1] < new[0] else _last_of_each(labels, rows)
        self._runs[-2:] = [merged]

    def _merged(self) -> tuple[Ints, Any]:
        while len(self._runs) > 1:
            self._join()
        if not self._runs:
            return np.zeros(0, dtype=np.int64), np.zeros((0, self._width))
        return self._runs[0]

    @property
    def labels(self) -> Ints:
        """Numbers, ascending, shape (n,)."""
        return self._merged()[0]

    @property
    def rows(self) -> Any:
        """Rows in the order of :attr:`labels`, shape (n, width)."""
        return self._merged()[1]

    def find(self, labels: Ints) -> Ints:
        """Position of each number among :attr:`labels`, -1 where there is none."""
        return _places(self.labels, labels)

    def look_up(self, labels: Ints) -> tuple[Bools, Any]:
        """Rows of some numbers without merging what was added.

        Args:
            labels: The numbers, shape (n,).

        Returns:
            Whether each exists, shape (n,), and their rows, shape (n, width); rows of those that do
            not are 0.
        """
        labels = np.asarray(labels, dtype=np.int64)
        known = np.zeros(len(labels), dtype=bool)
        kind = self._runs[0][1].dtype if self._runs else float
        out = np.zeros((len(labels), self._width), dtype=kind)
        for numbers, rows in reversed(self._runs):
            left = np.flatnonzero(~known)
            if not len(left):
                break
            at = _places(numbers, labels[left])
            out[left[at >= 0]] = rows[at[at >= 0]]
            known[left[at >= 0]] = True
        return known, out

    def copy(self) -> Numbered:
        """A copy to which rows can be added."""
        out = Numbered(self._width)
        out.add(self.labels, self.rows)
        return out


def _ascends(labels: Ints) -> bool:
    """Whether every number is larger than the one before."""
    return bool(np.all(labels[1:] > labels[:-1]))


def _places(known: Ints, labels: Ints) -> Ints:
    """Position of each number among ascending ones, -1 where there is none."""
    if not len(known):
        return np.full(np.shape(labels), -1, dtype=np.int64)
    at = np.minimum(np.searchsorted(known, labels), len(known) - 1)
    return np.where(known[at] == labels, at, -1)


def _last_of_each(labels: Ints, rows: Any) -> tuple[Ints, Any]:
    """Numbers in ascending order, each once, with the last of its rows."""
    order = np.argsort(labels, kind="stable")
    ordered = labels[order]
    last = np.append(ordered[1:] != ordered[:-1], True)
    return ordered[last], rows[order[last]]


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
        known = self.members.get(space, np.zeros(0, dtype=np.int64))
        both = np.concatenate((known, labels))
        if ordered:
            both = both[np.sort(np.unique(both, return_index=True)[1])]
        elif not (
            _ascends(labels) and (not len(known) or not len(labels) or labels[0] > known[-1])
        ):
            both = distinct(both)
        self.members[space] = both

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
        rigid: Nodes of rigid elements by type.
        nsets: Sets of nodes by key.
        elsets: Sets of elements by key.
        surfaces: By key.
        sections: Section cards.
        orientations: Orientation cards by key.
        distributions: Distribution cards by key.
        others: Further cards that belong to it.
        rotation: Of an instance, shape (3, 3).
        shift: Of an instance, after the rotation, shape (3,).
    """

    name: str
    nodes: Numbered = field(default_factory=lambda: Numbered(3))
    elements: dict[str, Elements] = field(default_factory=dict)
    rigid: dict[str, Numbered] = field(default_factory=dict)
    nsets: dict[str, NamedSet] = field(default_factory=dict)
    elsets: dict[str, NamedSet] = field(default_factory=dict)
    surfaces: dict[str, SurfaceDef] = field(default_factory=dict)
    sections: list[Card] = field(default_factory=list)
    orientations: dict[str, Card] = field(default_factory=dict)
    distributions: dict[str, Card] = field(default_factory=dict)
    others: list[Card] = field(default_factory=list)
    rotation: Array = field(default_factory=lambda: np.eye(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))

    def instance(self, name: str) -> Space:
        """An instance of this part, with what it holds so far."""
        return Space(
            name,
            self.nodes.copy(),
            {k: Elements(e.kind, e.table.copy(), e.card) for k, e in self.elements.items()},
            {k: table.copy() for k, table in self.rigid.items()},
            {k: NamedSet(s.name, dict(s.members), s.card, s.internal)
             for k, s in self.nsets.items()},
            {k: NamedSet(s.name, dict(s.members), s.card, s.internal)
             for k, s in self.elsets.items()},
            dict(self.surfaces),
            list(self.sections),
            dict(self.orientations),
            dict(self.distributions),
            list(self.others),
        )  # fmt: skip

    def places(self) -> Array:
        """Positions of the nodes, shape (n, 3), length."""
        return np.asarray(self.nodes.rows @ self.rotation.T + self.shift)

    @property
    def rigid_labels(self) -> Ints:
        """Numbers of all rigid elements, ascending, shape (n,)."""
        parts = [table.labels for table in self.rigid.values()]
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


def missing(card: Card, name: str, labels: Ints, positions: Ints, what: str) -> str | None:
    """A warning of the members of a set that do not exist, ``None`` where all do.

    Args:
        card: The card of the set.
        name: Its name.
        labels: Its members, shape (n,).
        positions: Where they are, -1 where they do not exist, shape (n,).
        what: "nodes" or "elements".
    """
    lost = positions < 0
    if not np.any(lost):
        return None
    return (
        f"{card.place}: {int(lost.sum())} of the {len(labels)} {what} of set '{name}' do not "
        f"exist, the first is {int(labels[lost][0])}; they are ignored"
    )
