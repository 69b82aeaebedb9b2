"""``*DISTRIBUTION``: values that differ from element to element."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import did_you_mean
from fxcrack.deck.cards import Card, key, to_float
from fxcrack.deck.flat import Flat
from fxcrack.deck.numbering import Placed


def find_distribution(owner: Card, name: str, placed: Placed, flat: Flat) -> Card:
    """The distribution of a name, of the part or of the whole deck.

    Args:
        owner: The card that names it.
        name: Its name.
        placed: Space of that card.
        flat: The model.

    Raises:
        DeckError: There is none, or its values are not those of elements.
    """
    known = {**flat.model.root.distributions, **placed.space.distributions}
    if key(name) not in known:
        owner.fail(f"there is no distribution '{name}'{did_you_mean(key(name), known)}; define it")
    card = known[key(name)]
    card.choose("LOCATION", ("ELEMENT",), "ELEMENT")
    return card


def distributed(card: Card, cells: Ints, width: int, placed: Placed, flat: Flat) -> Array:
    """Values of some cells.

    Args:
        card: ``*DISTRIBUTION``: its first line has no element and holds what others have.
        cells: The cells, shape (n,).
        width: Numbers a cell has.
        placed: Space of the card that names it.
        flat: The model.

    Returns:
        Shape (n, width).

    Raises:
        DeckError: A cell has no value, or a line is not complete.
    """
    values = np.full((len(flat.cells), width), np.nan)
    if any(to_float(c) is None for line in card.lines for c in line.split(",") if c.strip()):
        for row in card.rows():
            numbers = [row.number(1 + i) for i in range(width)]
            if not row.text(0):
                values[:] = numbers
            else:
                values[_cells_of(card, row.text(0), row.index, placed, flat)] = numbers
    else:
        table = card.table()
        if table.shape[1] < 1 + width:
            card.fail(f"a line needs an element and {width} numbers")
        values[:] = table[0, 1 : 1 + width] if len(table) and np.isnan(table[0, 0]) else np.nan
        rows = table[~np.isnan(table[:, 0])]
        at = placed.cell_of(rows[:, 0].astype(np.int64))
        values[at[at >= 0]] = rows[at >= 0, 1 : 1 + width]
    found = values[cells]
    lost = ~np.isfinite(found).all(axis=1)
    if np.any(lost):
        card.fail(
            f"{int(lost.sum())} of {len(cells)} elements have no complete value; give them one, or "
            "a first line without an element for all others"
        )
    return found


def _cells_of(card: Card, name: str, index: int, placed: Placed, flat: Flat) -> Ints:
    """Cells of an element number or set of the space, or of the whole deck."""
    value = to_float(name)
    if value is not None and float(value).is_integer():
        at = placed.cell_of(np.array([int(value)]))
        return at[at >= 0]
    sets = placed.space.elsets
    if key(name) in sets:
        return placed.cell_of(sets[key(name)].home)
    return flat.elements(card, name, index)


def same_values(values: Array) -> list[tuple[Ints, Array]]:
    """Rows that are the same but for round-off, with their values.

    Args:
        values: Shape (n, k).

    Returns:
        Of each group its rows, and the values of its first row.
    """
    scale = max(float(np.abs(values).max(initial=0.0)), 1e-300)
    rounded = np.round(values / scale, 6) + 0.0
    _, first, which = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    which = which.ravel()
    return [(np.flatnonzero(which == i).astype(np.int64), values[f]) for i, f in enumerate(first)]


__all__ = ["distributed", "find_distribution", "same_values"]
