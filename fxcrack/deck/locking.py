"""What first-order elements of full integration cost in bending, and what avoids it."""

from __future__ import annotations

from fxcrack.deck.flat import Flat
from fxcrack.deck.report import Report
from fxcrack.deck.thickness import thickness_of

_MATTERS = 0.01
"""Excess of the bending stiffness from which it is said of elements that the deck itself has."""


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
    spaces = [flat.model.root, *flat.model.instances.values()]
    blocks = [
        b
        for space in spaces
        for b in space.elements.values()
        if not (b.kind.stacked or b.kind.shell) and len(b.table.labels)
    ]
    replaced = [b for b in blocks if b.kind.bends_freely]
    if flat.kind.order != 1 or not blocks or not (replaced or bonded):
        return
    found = thickness_of(flat.kind.cell, flat.points, flat.cells)
    if not replaced and (found is None or found.excess < _MATTERS):
        return
    known = ""
    if found is not None:
        elements = f"{found.number} element" + ("s" if found.number > 1 else "")
        known = (
            f": with {elements} over the smallest dimension of the bodies, {found.aspect:.3g} "
            f"times as long as high, by about {100.0 * found.excess:.2g} % (rectangles, nu = 0.3)"
        )
    help_ = (
        "explicit dynamics has no second order: mesh the thickness with more elements"
        if explicit
        else "--order 2 or read_deck(..., order=2) avoids it"
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


__all__ = ["warn_of_locking"]
