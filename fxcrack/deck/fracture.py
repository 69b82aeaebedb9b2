"""``*FRACTURE CRITERION`` and ``*NODAL ENERGY RATE``: criteria of the scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Ints
from fxcrack.base.errors import InputError
from fxcrack.criteria import (
    BK,
    VCCT,
    CrackLengthVsTime,
    CrackOpening,
    Criterion,
    CriticalStress,
    EnhancedVCCT,
    Fatigue,
    Paris,
    Power,
    Reeder,
    Tabulated,
)
from fxcrack.deck.cards import Card, Row
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.deck.thermal import NodalField

_TYPES = ("CRITICAL STRESS", "COD", "CRACK LENGTH", "VCCT", "ENHANCED VCCT", "FATIGUE")
_LAWS = ("BK", "POWER", "REEDER")
_UPPER = 0.85
"""Upper limit r2 of fatigue where the deck gives none."""
_MODES = ("GIc", "GIIc", "GIIIc")


class NodalRates:
    """Critical rates of ``*NODAL ENERGY RATE`` at all nodes.

    Args:
        cards: The cards.
        flat: The model.

    Attributes:
        rates: G_Ic, G_IIc, G_IIIc of the deck's nodes, NaN where none are given, shape (n, 3).

    Raises:
        DeckError: A line cannot be read, or bounds of GENERATE have no value yet.
    """

    def __init__(self, cards: Sequence[Card], flat: Flat) -> None:
        self.rates = np.full((flat.n_given, 3), np.nan)
        self._flat = flat
        for card in cards:
            for row in card.need_rows("node or set, critical rates"):
                if card.has("GENERATE"):
                    self._fill(row)
                else:
                    nodes = flat.nodes(card, row.text(0), row.index)
                    first = row.number(1)
                    self.rates[nodes] = [first, row.number(2, first), row.number(3, math.nan)]

    def _fill(self, row: Row) -> None:
        """Values that vary linearly between those of two nodes or sets."""
        card, flat = row.card, self._flat
        a, b = (flat.nodes(card, row.text(i), row.index) for i in (0, 1))
        n, step = row.whole(2), row.whole(3, 1)
        if n < 1:
            row.fail(f"the number of intervals {n} must be 1 or more")
        a, b = a[: len(b)], b[: len(a)]
        if np.isnan(self.rates[[*a, *b], 0]).any():
            row.fail("the bounds have no critical rates yet; give theirs in a line before")
        for placed in flat.placed.values():
            labels = placed.space.nodes.labels
            mine = (a >= placed.first_node) & (a < placed.first_node + len(labels))
            if not mine.any():
                continue
            first = labels[a[mine] - placed.first_node]
            for i in range(1, n):
                at = placed.space.nodes.find(first + i * step)
                if np.any(at < 0):
                    row.fail(f"node {int((first + i * step)[at < 0][0])} does not exist")
                share = i / n
                self.rates[at + placed.first_node] = (1.0 - share) * self.rates[
                    a[mine]
                ] + share * self.rates[b[mine]]

    def on(self, card: Card, slave: Ints) -> dict[str, NodalField]:
        """Toughness on a slave surface by mode.

        Args:
            card: The criterion, for messages.
            slave: Nodes of the surface, shape (n,).

        Raises:
            DeckError: A slave node has no values.
        """
        flat = self._flat
        given = slave[slave < flat.n_given]
        lost = given[np.isnan(self.rates[given, 0])]
        if len(lost):
            where = ", ".join(f"{c:g}" for c in flat.points[lost[0]])
            card.fail(
                f"NODAL ENERGY RATE: {len(lost)} of {len(given)} slave nodes have no critical "
                f"rates, one of them at ({where}); give them by *NODAL ENERGY RATE"
            )
        rates = np.where(np.isnan(self.rates), self.rates[:, 1:2], self.rates)
        rates = np.nan_to_num(rates, nan=1.0)
        x = flat.points[slave][:, : flat.kind.gdim]
        return {
            mode: NodalField(x, flat.nodal(rates[:, i])[slave]) for i, mode in enumerate(_MODES)
        }


def read_criterion(
    card: Card,
    flat: Flat,
    groups: Groups,
    nodal: NodalRates | None,
    slave: Ints,
    *,
    finite: bool,
) -> Criterion:
    """The criterion of a ``*FRACTURE CRITERION`` card.

    Args:
        card: The card.
        flat: The model.
        groups: Takes the reference nodes of a crack length.
        nodal: Critical rates at nodes, where the deck has any.
        slave: Nodes of the slave surface.
        finite: Whether bodies turn far (NLGEOM).

    Raises:
        DeckError: A parameter or a number is missing, or contradicts another.
    """
    kind = card.choose("TYPE", _TYPES, card.text("TYPE"))
    if card.number("DEPENDENCIES", 0.0):
        card.fail("DEPENDENCIES on field variables are not available; tables of temperature are")
    if card.has("NODAL ENERGY RATE") and kind not in ("VCCT", "FATIGUE"):
        card.fail(f"NODAL ENERGY RATE is not possible with TYPE={kind}; VCCT and FATIGUE have it")
    if card.has("SYMMETRY") and kind != "COD":
        card.fail("SYMMETRY belongs to TYPE=COD")
    if card.has("DISTANCE") and kind not in ("CRITICAL STRESS", "COD"):
        card.fail("DISTANCE belongs to TYPE=CRITICAL STRESS and COD")
    if card.has("UNSTABLE GROWTH TOLERANCE", "VISCOSITY") and "VCCT" not in kind:
        card.fail("UNSTABLE GROWTH TOLERANCE and VISCOSITY belong to TYPE=VCCT and ENHANCED VCCT")
    try:
        if kind == "CRITICAL STRESS":
            return _stress(card)
        if kind == "COD":
            return _opening(card)
        if kind == "CRACK LENGTH":
            return _length(card, flat, groups, finite)
        rates = nodal.on(card, slave) if nodal and card.has("NODAL ENERGY RATE") else None
        if card.has("NODAL ENERGY RATE") and rates is None:
            card.fail("NODAL ENERGY RATE needs critical rates by *NODAL ENERGY RATE")
        return _rates(card, kind, rates)
    except InputError as error:
        if type(error) is not InputError:
            raise
        card.fail(str(error))


def _column(rows: list[Row], i: int, t: int) -> float | Tabulated | None:
    """A property of all lines: a number, or a table against the temperature in column ``t``."""
    values = [row.number(i, math.nan) for row in rows]
    if any(math.isnan(v) for v in values):
        return None
    if len(rows) == 1 or len(set(values)) == 1:
        return values[0]
    pairs = sorted((row.number(t), v) for row, v in zip(rows, values, strict=True))
    return Tabulated([p[0] for p in pairs], [p[1] for p in pairs])


def _joined(card: Card, lines: int) -> list[Row]:
    """Data lines that belong together in one row of eight fields each."""
    rows = card.need_rows("the critical values")
    if lines == 1:
        return rows
    out = []
    for start in range(0, len(rows), lines):
        fields: list[str] = []
        for row in rows[start : start + lines]:
            fields += row.fields + [""] * (8 - len(row))
        out.append(Row(fields, card, start))
    return out


def _stress(card: Card) -> Criterion:
    rows = card.need_rows("the critical stresses")
    strengths = [_column(rows, i, 3) for i in range(3)]
    if strengths[0] is None:
        rows[0].fail("the critical normal stress is missing; give it in the first field")
    if not card.has("DISTANCE"):
        card.fail("DISTANCE is missing; write DISTANCE=length ahead of the tip")
    return CriticalStress(
        strengths[0],
        strengths[1],
        strengths[2],
        distance=card.number("DISTANCE", 0.0),
        tolerance=card.number("TOLERANCE", 0.1),
    )


def _opening(card: Card) -> Criterion:
    rows = card.need_rows("critical opening, cumulative crack length")
    if not card.has("DISTANCE"):
        card.fail("DISTANCE is missing; write DISTANCE=length behind the tip")
    lengths = [row.number(1, 0.0) for row in rows]
    temperatures = {row.text(2) for row in rows}
    critical: Any
    if len(temperatures) > 1:
        if len(set(lengths)) > 1:
            card.fail("a critical opening against length and temperature is not available")
        critical = _column(rows, 0, 2)
    elif len(rows) > 1:
        critical = (lengths, [row.number(0) for row in rows])
    else:
        critical = rows[0].number(0)
    return CrackOpening(
        critical,
        distance=card.number("DISTANCE", 0.0),
        symmetry=card.has("SYMMETRY"),
        tolerance=card.number("TOLERANCE", 0.1),
    )


def _length(card: Card, flat: Flat, groups: Groups, finite: bool) -> Criterion:
    name = card.text("NSET")
    where = groups.support(card, name, flat.nodes(card, name), words="nodes")
    flat_numbers = [x for row in card.need_rows("time, crack length") for x in row.numbers()]
    if len(flat_numbers) % 2:
        card.fail("the numbers are no pairs of time and crack length")
    return CrackLengthVsTime(
        flat_numbers[::2],
        flat_numbers[1::2],
        reference=where,
        moving=finite,
        tolerance=card.number("TOLERANCE", 0.1),
    )


def _rates(card: Card, kind: str, nodal: dict[str, NodalField] | None) -> Criterion:
    law = card.choose("MIXED MODE BEHAVIOR", _LAWS, "BK")
    n_exponents = 3 if law == "POWER" else 1
    if kind == "FATIGUE":
        first, t = 6, 9 + n_exponents
    elif kind == "ENHANCED VCCT":
        first, t = 0, 6 + n_exponents
    else:
        first, t = 0, 3 + n_exponents
    rows = _joined(card, 2 if t >= 8 else 1)
    at = t - n_exponents
    toughness: dict[str, Any] = {}
    if nodal is not None:
        toughness = dict(nodal)
    else:
        for i, mode in enumerate(_MODES):
            toughness[mode] = _positive(_column(rows, first + i, t))
        if toughness["GIc"] is None:
            rows[0].fail("the critical rate of mode I is missing")
    one_for_all = toughness["GIIc"] is None and toughness["GIIIc"] is None
    exponents = [rows[0].number(at + i, 0.0) for i in range(n_exponents)]
    mix: Any = None
    if law == "POWER" and exponents[0]:
        mix = Power(exponents[0], exponents[1] or exponents[0], exponents[2] or None)
    elif law != "POWER" and exponents[0]:
        mix = BK(exponents[0]) if law == "BK" else Reeder(exponents[0])
    elif not one_for_all:
        if nodal is None and len({repr(v) for v in toughness.values() if v is not None}) == 1:
            toughness = {"GIc": toughness["GIc"]}
        else:
            rows[0].fail(
                f"the exponent{'s' if law == 'POWER' else ''} of the mode-mix law {law} "
                f"{'are' if law == 'POWER' else 'is'} missing in field {at + 1}"
            )
    if law == "BK" and nodal is None and "GIIIc" in toughness:
        toughness.pop("GIIIc")  # modes II and III share one toughness
    options: dict[str, Any] = {"mix": mix, "tolerance": card.number("TOLERANCE", 0.2)}
    if kind == "FATIGUE":
        row = rows[0]
        paris = Paris(
            row.number(0),
            row.number(1),
            row.number(2),
            row.number(3),
            row.number(4, 0.01),
            row.number(5, _UPPER) or _UPPER,
        )
        if row.text(5) and row.number(5) == 0.0:
            log.warn(
                "%s: r2 = 0 would let every element fail in one cycle; it counts as left out, %g",
                card.place,
                _UPPER,
            )
        # the card lets nodes go one after the other
        return Fatigue(**toughness, **options, paris=paris, partial=False)
    if card.has("UNSTABLE GROWTH TOLERANCE"):
        given = card.options["UNSTABLEGROWTHTOLERANCE"]
        options["unstable_tolerance"] = (
            card.number("UNSTABLE GROWTH TOLERANCE", 0.0) if given else math.inf
        )
    options["viscosity"] = card.number("VISCOSITY", 0.0)
    if kind == "VCCT":
        return VCCT(**toughness, **options)
    for i, mode in enumerate(_MODES):
        if mode in toughness:
            toughness[f"{mode}_p"] = _positive(_column(rows, 3 + i, t))
    if toughness["GIc_p"] is None:
        rows[0].fail("the critical rate of propagation in mode I is missing")
    return EnhancedVCCT(**toughness, **options)


def _positive(value: float | Tabulated | None) -> float | Tabulated | None:
    """None where the number is 0: the mode has no toughness of its own."""
    return None if value == 0.0 else value
