"""Temperatures of a deck: initial ones and those of the steps, as one effect of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base.arrays import Array
from fxcrack.continuum.temperature import Spatial, Temperature
from fxcrack.deck.cards import Card, DeckError, Row
from fxcrack.deck.cell_field import CellField
from fxcrack.deck.flat import Flat
from fxcrack.deck.report import Report
from fxcrack.deck.tracks import Amplitudes, Curve, Period


@dataclass(frozen=True, eq=False)
class NodalField:
    """Values known at nodes, found again at their positions.

    Attributes:
        x: Positions of the nodes, shape (n, gdim), length.
        values: Shape (n,).
    """

    x: Array
    values: Array

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.x)

    def __call__(self, x: Array) -> Array:
        """Values at positions of shape (3, m), those of the nearest node, shape (m,)."""
        _, found = self._tree.query(np.asarray(x).T[:, : self.x.shape[1]])
        return np.asarray(self.values[found])


class Temperatures:
    """Temperature of all nodes over the steps.

    Args:
        flat: The model.
        report: Takes notes.
    """

    def __init__(self, flat: Flat, report: Report) -> None:
        self._flat = flat
        self._report = report
        self._initial = np.zeros(flat.n_given)
        self._fields: list[tuple[float, Array]] = []
        self._given = False
        self._first: Card | None = None

    @property
    def first(self) -> Card | None:
        """The first card that gives a temperature, None without."""
        return self._first

    def start(self, cards: Sequence[Card]) -> None:
        """Read ``*INITIAL CONDITIONS, TYPE=TEMPERATURE``."""
        for card in cards:
            self._given, self._first = True, self._first or card
            for row in card.need_rows("node or set, temperature"):
                nodes = self._flat.nodes(card, row.text(0), row.index)
                self._initial[nodes] = self._uniform(row)
        self._fields = [(0.0, self._initial.copy())]

    def take(self, cards: Sequence[Card], amplitudes: Amplitudes, period: Period) -> None:
        """Read the ``*TEMPERATURE`` cards of a step and follow the field over it.

        Raises:
            DeckError: A line cannot be read.
        """
        begin = self._fields[-1][1]
        wanted = begin.copy()
        curves: list[Curve] = []
        if any(card.choose("OP", ("MOD", "NEW"), "MOD") == "NEW" for card in cards):
            wanted = self._initial.copy()
        for card in cards:
            self._given, self._first = True, self._first or card
            curve = amplitudes.of(card)
            if curve is not None and curve not in curves:
                curves.append(curve)
            if card.word("OP") != "NEW":
                card.need_rows("node or set, temperature")
            for row in card.rows():
                nodes = self._flat.nodes(card, row.text(0), row.index)
                wanted[nodes] = self._uniform(row)
        if len(curves) > 1 or (curves and any(not c.has("AMPLITUDE") for c in cards)):
            cards[0].fail("temperatures of one step with several amplitudes are not available")
        if curves:
            times, factors = curves[0].over(period)
            changed = wanted != begin
            for t, factor in zip(times[1:], factors[1:], strict=True):
                field = begin.copy()
                field[changed] = factor * wanted[changed]
                self._fields.append((float(t), field))
        elif cards and not period.ramp:
            soon = period.start + 1e-6 * (period.end - period.start)
            self._fields += [(soon, wanted), (period.end, wanted)]
        else:
            self._fields.append((period.end, wanted))

    def _uniform(self, row: Row) -> float:
        """The temperature of a line, the same over the thickness of a shell."""
        if self._flat.kind.shell and any(row.number(i, 0.0) for i in range(2, len(row))):
            row.fail(
                "a temperature that varies over the thickness is not available from a deck; give "
                "one value, or Temperature with a gradient in Python"
            )
        return row.number(1)

    def effect(self, zero: float | None) -> list[Temperature]:
        """The effect of the scene: one, or none where the deck has no temperature.

        Args:
            zero: Temperature to which expansions tabulated against temperature refer, if any are.

        Raises:
            DeckError: The bodies are free of thermal strain at different temperatures.
        """
        if not self._given:
            return []
        used = self._flat.used[: self._flat.n_given]
        start = self._initial[used]
        reference = float(start[0])
        if np.ptp(start) > 0.0:
            assert self._first is not None
            self._first.fail(
                "the initial temperature varies; all bodies must start from one temperature, at "
                "which they are free of thermal strain"
            )
        if zero is not None and zero != reference:
            raise DeckError(
                f"an *EXPANSION tabulated against temperature refers to ZERO={zero:g}, but the "
                f"bodies start from {reference:g}; give secant values that refer to it"
            )
        same = all(np.array_equal(f[used], self._fields[0][1][used]) for _, f in self._fields)
        fields = self._fields[:1] if same else self._fields
        series = [(t, self._spatial(f)) for t, f in fields]
        return [Temperature(series, reference)]

    def _spatial(self, field: Array) -> Spatial:
        flat = self._flat
        used = flat.used
        values = flat.nodal(field)[used]
        if np.ptp(values) == 0.0:
            return float(values[0])
        x = flat.points[used][:, : flat.kind.gdim]
        check_unique(x, values, self._first, "temperatures")
        if flat.kind.shell:  # asked for above and below nodes
            return NodalField(x, values)
        kind, number = flat.kind, np.cumsum(used) - 1
        return CellField(kind.cell, kind.order, x, number[flat.dolfinx_cells()], values)


def check_unique(x: Array, values: Array, card: Card | None, what: str) -> None:
    """Refuse different values at nodes of one position (the two faces of a crack).

    Args:
        x: Positions, shape (n, gdim), length.
        values: Shape (n,).
        card: The card that gives them.
        what: What they are, in words.

    Raises:
        DeckError: They differ.
    """
    size = float(np.ptp(x, axis=0).max())
    pairs = cKDTree(x).query_pairs(1e-9 * size, output_type="ndarray")
    if len(pairs) and np.any(values[pairs[:, 0]] != values[pairs[:, 1]]):
        assert card is not None
        card.fail(
            f"two nodes at one place (the two faces of an interface) have different {what}, which "
            "is not available; give them the same"
        )
