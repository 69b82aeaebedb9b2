"""``*DYNAMIC, EXPLICIT`` and the cards of its step as a step of explicit dynamics."""

from __future__ import annotations

from fxcrack.deck.cards import Card
from fxcrack.deck.model import Family
from fxcrack.deck.report import Report
from fxcrack.steps.end_conditions import Time
from fxcrack.steps.explicit import Explicit

_SCALING = ("FIXEDMASSSCALING", "VARIABLEMASSSCALING")
_WORDS = ("BULKVISCOSITY", *_SCALING)
SAFETY = 0.97
"""Part of the stable increment that a scale factor of 1 stands for."""
DEFAULT_BULK = (0.06, 1.2)
"""Linear and quadratic bulk viscosity of a step without ``*BULK VISCOSITY``."""
_MOST_ROWS = 20_000


def explicit_words(step: Family) -> list[Card]:
    """Cards of a step that belong to explicit dynamics alone."""
    return [card for card in step.cards if card.keyword in _WORDS]


def explicit_step(card: Card, step: Family, start: float, report: Report) -> tuple[float, Explicit]:
    """Length and step of an explicit procedure, without bulk viscosity: the bodies decide on it.

    Args:
        card: ``*DYNAMIC, EXPLICIT``.
        step: The step it stands in.
        start: Total time at the beginning of the step.
        report: Takes what is replaced.

    Raises:
        DeckError: A card asks for what explicit dynamics does not have here.
    """
    rows = card.rows()
    length = rows[0].number(1, 0.0) if rows else 0.0
    if length <= 0.0:
        card.fail("the length of the step is missing; give it in the second field")
    if card.has("ADIABATIC"):
        card.fail("ADIABATIC is not available: heat is not computed; leave it out")
    options: dict[str, object] = {}
    scale = card.number("SCALE FACTOR", 1.0)
    if not 0.0 < scale <= 1.0:
        card.fail(f"SCALE FACTOR={scale:g} must lie above 0, up to 1, to be stable")
    if scale < 1.0:
        options["safety"] = SAFETY * scale
    if card.has("DIRECT USER CONTROL"):
        options["dt"] = rows[0].number(0, what="the time increment")
    elif rows[0].number(3, 0.0) > 0.0:
        report.replace(
            "the largest increment is left out: increments are the stable one throughout", card
        )
    options |= _mass_scaling(step, report)
    return length, Explicit(
        until=Time(start + length),
        rows=_rows(step, length),
        **options,  # type: ignore[arg-type]
    )


def bulk_viscosity(
    procedure: Card, step: Family, report: Report, *, quadratic: bool, without: str | None
) -> tuple[float, float]:
    """Bulk viscosity of a step: that of its card, or what is there without one.

    Args:
        procedure: ``*DYNAMIC, EXPLICIT``.
        step: The step it stands in.
        report: Takes what is left out.
        quadratic: Whether the elements have the quadratic part; those of plane stress do not.
        without: Why the bodies have none, ``None`` where they have.

    Raises:
        DeckError: A number is negative, or more than the default is given to bodies without.
    """
    card = step.first("BULKVISCOSITY")
    given = [] if card is None else card.rows()
    found = tuple(
        given[0].number(i, default) if given else default for i, default in enumerate(DEFAULT_BULK)
    )
    if card is not None and min(found) < 0.0:
        card.fail(f"the bulk viscosity of {found[0]:g} and {found[1]:g} must not be negative")
    if without is None:
        return found[0], found[1] if quadratic else 0.0
    if card is not None and any(b > d for b, d in zip(found, DEFAULT_BULK, strict=True)):
        card.fail(
            f"bulk viscosity above the default of 0.06 and 1.2 is not available for {without}; "
            "leave the card out"
        )
    if any(found):
        report.replace(
            f"the bulk viscosity of {found[0]:g} and {found[1]:g}, which damps waves as short as "
            f"the elements, is left out: it is not available for {without}",
            card or procedure,
        )
    return 0.0, 0.0


def _mass_scaling(step: Family, report: Report) -> dict[str, object]:
    """Scaling of masses as arguments of the step.

    Raises:
        DeckError: It is for a part of the model, or of a kind that is not available.
    """
    found = [card for card in step.cards if card.keyword in _SCALING]
    if len(found) > 1:
        found[1].fail("the step has two cards of mass scaling; one is possible")
    if not found:
        return {}
    card = found[0]
    if card.has("ELSET"):
        card.fail("mass scaling of a part of the model is not available; leave ELSET out")
    if card.lines:
        card.fail("mass scaling against the frequency of increments has no data lines here")
    if card.has("FACTOR"):
        if card.has("DT", "TYPE"):
            card.fail("FACTOR beside DT or TYPE is not available; give one of them")
        factor = card.number("FACTOR", 1.0)
        if factor <= 0.0:
            card.fail(f"FACTOR={factor:g} must be positive")
        return {"mass_scale": factor}
    dt = card.number("DT", 0.0)
    if dt <= 0.0:
        card.fail("give FACTOR, or DT with TYPE=BELOW MIN")
    kinds = ("UNIFORM", "BELOW MIN", "SET EQUAL DT", "NONUNIFORM")
    kind = card.choose("TYPE", kinds, "UNIFORM")
    if kind != "BELOW MIN":
        card.fail(
            f"TYPE={kind} is not available; give FACTOR for the whole model, or TYPE=BELOW MIN, "
            "which adds mass where DT would not be stable"
        )
    if card.keyword == "VARIABLEMASSSCALING":
        report.replace("the masses are scaled once, at the beginning of the step", card)
    report.replace(
        f"all increments are DT = {dt:g}; mass is added to the nodes at which it would not be "
        "stable, and to no other",
        card,
    )
    return {"dt": dt, "mass_scale": "dt"}


def _rows(step: Family, length: float) -> int:
    """Rows of the history: as many as the densest history output of the step asks for."""
    n = 0
    for card in step.cards:
        if card.keyword != "OUTPUT" or not card.has("HISTORY"):
            continue
        if card.has("NUMBER INTERVAL"):
            n = max(n, int(card.number("NUMBER INTERVAL", 0.0)))
        interval = card.number("TIME INTERVAL", 0.0)
        if interval > 0.0:
            n = max(n, round(min(length / interval, _MOST_ROWS)))
    return min(n, _MOST_ROWS) or 200


__all__ = ["SAFETY", "bulk_viscosity", "explicit_step", "explicit_words"]
