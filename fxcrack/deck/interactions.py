"""Properties of contact: ``*SURFACE INTERACTION`` with friction, behaviour, bonds, criterion."""

from __future__ import annotations

from collections.abc import Mapping

from fxcrack.base.errors import did_you_mean
from fxcrack.deck.cards import Card, Row, key
from fxcrack.deck.flat import Flat
from fxcrack.deck.model import Family
from fxcrack.deck.report import Report

_SOFT = 0.2
"""Compliance of linear contact over that of the elements, up to which it counts as exact."""
_COHESIVE = (
    "cohesive zones are not available; a crack along the same interface is *DEBOND with a "
    "*FRACTURE CRITERION"
)


def interaction(
    where: Card | Row, name: str, interactions: Mapping[str, Family], *, explicit: bool = False
) -> Family:
    """The interaction of a name, its pressure-overclosure looked at.

    Args:
        where: The card or line that names it.
        name: The name.
        interactions: All of them by key.
        explicit: Whether it belongs to general contact in explicit dynamics.

    Raises:
        DeckError: There is none, or it has a property that is not available.
    """
    if key(name) not in interactions:
        meant = did_you_mean(key(name), interactions)
        where.fail(f"there is no surface interaction '{name}'{meant}; define it")
    family = interactions[key(name)]
    if family.card.number("PAD THICKNESS", 0.0):
        family.card.fail("PAD THICKNESS is not available; move the surfaces apart instead")
    behavior = family.first("SURFACEBEHAVIOR")
    known = ("HARD",) if explicit else ("HARD", "LINEAR")
    if behavior is not None and behavior.word("PRESSURE-OVERCLOSURE", "HARD") not in known:
        behavior.fail(
            f"PRESSURE-OVERCLOSURE={behavior.text('PRESSURE-OVERCLOSURE')} is not available; "
            "contact is exact here, PRESSURE-OVERCLOSURE=HARD"
        )
    cohesive = family.first("COHESIVEBEHAVIOR")
    if cohesive is not None and not explicit:
        cohesive.fail(_COHESIVE)
    criterion = family.first("FRACTURECRITERION")
    if criterion is not None:
        before = family.cards[family.cards.index(criterion) - 1]
        if before is not cohesive:
            criterion.fail(
                "it must stand directly after *COHESIVE BEHAVIOR in explicit dynamics, or in a "
                "step directly after *DEBOND; cracks through elements, for which it follows "
                "*SURFACE BEHAVIOR, are not available"
            )
    return family


def note_softness(family: Family, flat: Flat, size: float, report: Report) -> None:
    """Take linear contact that is stiff beside the elements as exact contact.

    Args:
        family: The interaction.
        flat: The model.
        size: Of the slave's facets, length.
        report: Takes what is replaced.

    Raises:
        DeckError: It gives way by more than a fifth of what an element does.
    """
    card = family.first("SURFACEBEHAVIOR")
    if card is None or card.word("PRESSURE-OVERCLOSURE", "HARD") != "LINEAR":
        return
    stiffness = card.need_rows("the contact stiffness")[0].number(0)
    elastic = [m.first("ELASTIC") for m in flat.model.materials.values()]
    moduli = [c.rows()[0].number(0, 0.0) for c in elastic if c is not None and c.lines]
    if stiffness <= 0.0 or not moduli:
        card.fail("the contact stiffness must be positive, and bodies elastic")
    softness = max(moduli) / (stiffness * size)
    if softness > _SOFT:
        card.fail(
            f"PRESSURE-OVERCLOSURE=LINEAR with {stiffness:g} gives way {softness:.2g} times as "
            "much as an element beside it; softened contact is not available: contact is exact "
            "here, PRESSURE-OVERCLOSURE=HARD"
        )
    report.replace(
        f"linear contact of stiffness {stiffness:g}, which gives way {softness:.2g} times as much "
        "as an element beside it, is replaced by exact contact",
        card,
    )


def friction(family: Family) -> float | None:
    """Coefficient of friction of an interaction, None without.

    Raises:
        DeckError: It is rough, a table, or limited.
    """
    card = family.first("FRICTION")
    if card is None:
        return None
    if card.has("ROUGH"):
        card.fail("ROUGH is not available; give a large coefficient of friction")
    rows = card.rows()
    if len(rows) > 1 or any(row.text(i) for row in rows for i in range(1, len(row))):
        card.fail("only one coefficient is available; no tables, no shear limit")
    return (rows[0].number(0, 0.0) if rows else 0.0) or None


def note_thickness(family: Family, flat: Flat, report: Report) -> None:
    """Say so where the interface of a plane model would have another thickness than its bodies."""
    if flat.kind.gdim == 3:
        return
    rows = family.card.rows()
    given = rows[0].number(0, 1.0) if rows else 1.0
    for placed in flat.placed.values():
        for section in placed.space.sections:
            data = section.rows()
            if data and data[0].number(0, 1.0) != given:
                report.replace(
                    f"the interface has the thickness of the bodies, {data[0].number(0, 1.0):g}, "
                    f"not {given:g}",
                    family.card,
                )


__all__ = ["friction", "interaction", "note_softness", "note_thickness"]
