"""How the bond force of ``*DEBOND`` goes to zero."""

from __future__ import annotations

from fxcrack.base.errors import InputError
from fxcrack.criteria import (
    AmplitudeRelease,
    Criterion,
    EnhancedVCCT,
    Fatigue,
    RampRelease,
    ReleaseLaw,
    StepRelease,
)
from fxcrack.criteria.energy_release import RateCriterion
from fxcrack.deck.cards import Card
from fxcrack.deck.pair_def import PairDef

_NO_RELEASE = ("FREQUENCY", "OUTPUT", "SLAVE", "MASTER", "SECONDARY", "MAIN")
"""Parameters of ``*DEBOND`` that say nothing of how the force falls."""


def release_words(card: Card) -> tuple[object, ...]:
    """All that a ``*DEBOND`` says of how the force falls, to be compared."""
    words = {k: v for k, v in card.options.items() if k not in _NO_RELEASE}
    return tuple(sorted(words.items(), key=str)), tuple(card.lines)


def read_release(card: Card, criterion: Criterion) -> ReleaseLaw:
    """How the bond force goes to zero."""
    force = card.choose("DEBONDING FORCE", ("STEP", "RAMP"), "STEP")
    numbers = [x for row in card.rows() for x in row.numbers()]
    if isinstance(criterion, RateCriterion):
        if numbers:
            card.fail(
                "a debonding amplitude belongs to critical stress, COD and crack length; with "
                "energy release rates give DEBONDING FORCE=STEP or RAMP"
            )
        if isinstance(criterion, Fatigue | EnhancedVCCT) or force == "STEP":
            if force == "RAMP" and isinstance(criterion, Fatigue):
                card.fail("in cycles bonds are released at once; give DEBONDING FORCE=STEP")
            return StepRelease()
        return RampRelease()
    if card.has("DEBONDING FORCE"):
        card.fail("DEBONDING FORCE belongs to energy release rates; give an amplitude instead")
    if not numbers:
        return StepRelease()
    if len(numbers) % 2:
        card.fail("the amplitude's numbers are no pairs of relative time and relative force")
    first = card.number("TIME INCREMENT", 0.0) or None
    try:
        return AmplitudeRelease(numbers[::2], numbers[1::2], first)
    except InputError as error:
        card.fail(str(error))


def check_alike(pair: PairDef) -> None:
    """Refuse a criterion or a release that differs from step to step.

    Raises:
        DeckError: It does.
    """
    _, card, criterion_card = pair.debonds[0]
    by_steps = criterion_card.word("TYPE") == "CRACKLENGTH"  # joined to one curve
    for _, other, of_other in pair.debonds[1:]:
        alike = by_steps or of_other.lines == criterion_card.lines
        if of_other.options != criterion_card.options or not alike:
            of_other.fail(
                f"the pair has another criterion before ({criterion_card.place}); a pair has "
                "one criterion in all steps"
            )
        if release_words(other) != release_words(card):
            other.fail("the bond force falls in another way than in the step before")


__all__ = ["check_alike", "read_release", "release_words"]
