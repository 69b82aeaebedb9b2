"""Curves of crack length that a deck gives step by step, as one curve over total time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.deck.cards import Card
from fxcrack.deck.tracks import Period

_AT_ONCE = 1e-9
"""Part of a step over which the length jumps where the curve of a step begins higher."""


def joined_lengths(cards: Sequence[tuple[int, Card]], periods: Sequence[Period]) -> Card:
    """The card of a crack length criterion whose curve holds in all steps.

    Each step may give a curve of its own, which counts within the step and stays at its last length
    after its end.

    Args:
        cards: Number of the step and ``*FRACTURE CRITERION, TYPE=CRACK LENGTH`` card, in order.
        periods: All steps in time.

    Returns:
        The first card, its data those of all.

    Raises:
        DeckError: A number is missing, or the times of a curve do not increase.
    """
    first = cards[0][1]
    if all(card.lines == first.lines for _, card in cards):
        return first
    points: list[tuple[float, float]] = []
    for number, card in cards:
        own_times, own = _curve(card)
        start, end = periods[number].start, periods[number].end
        if own_times[0] >= end:
            continue  # it has not begun when the step is over
        begin = max(start, float(own_times[0]))
        inside = own_times[(own_times > begin) & (own_times < end)]
        times = np.array([begin, *inside, end])
        lengths = np.interp(times, own_times, own)
        if points:
            before, last = points[-1]
            lengths = np.maximum(lengths, last)  # a crack does not shrink
            soon = _AT_ONCE * (end - start)
            if begin > before + soon:
                points.append((begin - soon, last))
            else:
                times[0] = before + soon
        points += zip(times.tolist(), lengths.tolist(), strict=True)
    lines = [f"{t!r}, {x!r}" for t, x in points] or first.lines
    return replace(first, lines=lines, places=[(first.file, [first.line] * len(lines))])


def _curve(card: Card) -> tuple[Array, Array]:
    """Times and lengths of a card, each once."""
    numbers = [x for row in card.need_rows("time, crack length") for x in row.numbers()]
    if len(numbers) % 2:
        card.fail("the numbers are no pairs of time and crack length")
    times, lengths = np.array(numbers[::2]), np.array(numbers[1::2])
    if np.any(np.diff(times) <= 0.0):
        card.fail("the times of the curve must increase")
    return times, lengths


__all__ = ["joined_lengths"]
