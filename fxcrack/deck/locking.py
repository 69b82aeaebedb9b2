"""What first-order elements of full integration cost in bending, and what avoids it."""

from __future__ import annotations

from fxcrack.deck.flat import Flat
from fxcrack.deck.report import Report
from fxcrack.deck.spaces import Elements
from fxcrack.deck.thickness import Thickness, thickness_of

_MATTERS = 0.01
"""Excess of the bending stiffness from which it is said of elements that the deck itself has."""
_TOO_STIFF = 0.05
"""Excess from which elements in place of others that bend freely are raised."""
_MOST = 50_000
"""Nodes up to which a mesh is raised unasked: beyond, its factorisation would surprise."""


def raised_to_bend(flat: Flat, report: Report) -> bool:
    """Whether the elements are to be raised to the second order to bend as those of the deck do.

    So it is where reduced integration or incompatible modes let elements of first order bend
    without locking, and those of full integration in their place would be 5 % too stiff or more.
    Not so in fatigue of fronts in 3-D, whose nodes go one after the other in a deck: of those of
    second-order elements there are twice as many along the front, and each is farther ahead of its
    neighbours, which costs more cycles than locking does.

    Args:
        flat: The model with the elements as the deck gives them.
        report: Takes what is said.
    """
    replaced = [b for b in _blocks(flat) if b.kind.bends_freely]
    if flat.kind.order != 1 or not replaced or _front_in_cycles(flat):
        return False
    found = thickness_of(flat.kind.cell, flat.points, flat.cells)
    dimension = 2 if flat.kind.tdim == 2 else 3
    if found is None or found.excess < _TOO_STIFF or len(flat.points) * 2**dimension > _MOST:
        return False
    names = ", ".join(sorted({block.kind.name for block in replaced}))
    report.replace(
        f"{names} elements bend without locking; those of first order and full integration in "
        f"their place would be too stiff by about {100.0 * found.excess:.2g} % with "
        f"{_elements(found)} over the smallest dimension of the bodies, so all elements of the "
        "deck are raised to the second order (read_deck(..., order=1) or --order 1: they are not)",
        replaced[0].card,
    )
    return True


def _front_in_cycles(flat: Flat) -> bool:
    """Whether a front in 3-D grows by fatigue."""
    cards = (card for family in flat.model.steps for card in family.cards)
    return flat.kind.tdim == 3 and any(
        c.keyword == "FRACTURECRITERION" and c.word("TYPE") == "FATIGUE" for c in cards
    )


def _blocks(flat: Flat) -> list[Elements]:
    """Elements that are no shells."""
    spaces = [flat.model.root, *flat.model.instances.values()]
    blocks = [b for space in spaces for b in space.elements.values() if len(b.table.labels)]
    return [b for b in blocks if not (b.kind.stacked or b.kind.shell)]


def _elements(found: Thickness) -> str:
    return f"{found.number} element" + ("s" if found.number > 1 else "")


def warn_of_locking(flat: Flat, report: Report, *, explicit: bool, bonded: bool) -> None:
    """Say by how much bodies that bend are too stiff, and what helps.

    Where elements that bend freely are replaced it is always said; of elements that lock in the
    deck itself only where bodies are bonded, whose arms bend as a crack opens.

    Args:
        flat: The model.
        report: Takes what is said.
        explicit: Whether the steps are explicit.
        bonded: Whether an interface bonds bodies.
    """
    blocks = _blocks(flat)
    replaced = [b for b in blocks if b.kind.bends_freely]
    if flat.kind.order != 1 or not blocks or not (replaced or bonded):
        return
    found = thickness_of(flat.kind.cell, flat.points, flat.cells)
    if not replaced and (found is None or found.excess < _MATTERS):
        return
    known = ""
    if found is not None:
        known = (
            f": with {_elements(found)} over the smallest dimension of the bodies, "
            f"{found.aspect:.3g} times as long as high, by about {100.0 * found.excess:.2g} % "
            "(rectangles, nu = 0.3)"
        )
    help_ = (
        "explicit dynamics has no second order: mesh the thickness with more elements"
        if explicit
        else "--order 2 or read_deck(..., order=2) avoids it"
    )
    if not explicit and _front_in_cycles(flat):
        help_ = (
            "mesh the thickness with more elements; the second order (--order 2) avoids it, but "
            "nodes of a front in 3-D go one after the other in fatigue, and those of second-order "
            "elements take many times as many cycles"
        )
    names = ", ".join(sorted({block.kind.name for block in replaced or blocks}))
    if replaced:
        report.replace(
            f"first-order elements of full integration in place of {names} lock in bending, where "
            f"they are too stiff{known}; {help_}",
            replaced[0].card,
        )
    else:
        report.doubt(
            f"first-order elements of full integration ({names}) lock in bending, in any program, "
            f"where they are too stiff{known}; {help_}",
            blocks[0].card,
        )


__all__ = ["raised_to_bend", "warn_of_locking"]
