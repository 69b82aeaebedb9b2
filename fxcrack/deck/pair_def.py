"""A contact pair of a deck, before an interface is made of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fxcrack.base.arrays import Ints
from fxcrack.deck.cards import Card, Row, label
from fxcrack.deck.flat import Flat
from fxcrack.interface.definition import Interface


@dataclass(eq=False)
class PairDef:
    """A contact pair of the deck.

    Attributes:
        row: Its data line.
        slave: Name of the slave surface.
        master: Name of the master surface.
        title: Name of the interface: that of its slave, with its master where that is not enough.
        bonded: Line of the initial conditions that bonds it, None: not bonded.
        normal_only: Whether the bond holds in the normal direction only.
        debonds: Its ``*DEBOND`` and ``*FRACTURE CRITERION`` cards, with the number of their step.
        interface: What is made of it.
        parts: The pairs that were joined to it, none for a pair of the deck itself.
    """

    row: Row
    slave: str
    master: str
    title: str
    bonded: Row | None = None
    normal_only: bool = False
    debonds: list[tuple[int, Card, Card]] = field(default_factory=list)
    interface: Interface | None = None
    parts: list[PairDef] = field(default_factory=list)


def slave_nodes(pair: PairDef, flat: Flat) -> Ints:
    """Nodes of the slave surface, ascending."""
    return np.unique(flat.surface(pair.row.card, pair.slave, pair.row.index))


def bonded_nodes(pair: PairDef, flat: Flat) -> Ints:
    """Slave nodes of the deck that are bonded, ascending."""
    slave = slave_nodes(pair, flat)
    slave = slave[slave < flat.n_given]
    if pair.bonded is None:
        return slave[:0]
    name = label(pair.bonded.text(2))
    if not name:
        return slave
    return np.intersect1d(slave, flat.nodes(pair.bonded.card, name, pair.bonded.index))


__all__ = ["PairDef", "bonded_nodes", "slave_nodes"]
