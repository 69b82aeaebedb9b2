"""``*DEBOND`` of decks: what comes apart, by which criterion, and how its bond force falls."""

from __future__ import annotations

from collections.abc import Sequence

from fxcrack.base import log
from fxcrack.criteria import (
    AmplitudeRelease,
    CrackLengthVsTime,
    CrackOpening,
    CriticalStress,
    EnhancedVCCT,
    Fatigue,
    ProgressiveRelease,
    RampRelease,
    StepRelease,
)
from fxcrack.deck.lines import broken, number
from fxcrack.deck.write_properties import criterion_lines
from fxcrack.deck.write_steps import refuse
from fxcrack.interface.pair import Pair
from fxcrack.steps.debond import Debond
from fxcrack.steps.release_choice import Step, choose_release


def debond_lines(
    debond: Debond, step: Step, pairs: Sequence[Pair], *, nodal: bool, in_part: bool
) -> list[str]:
    """Lines of a debond in a step that is not explicit.

    Args:
        debond: The debond.
        step: The step.
        pairs: All paired interfaces of the scene.
        nodal: Whether the toughness is given at the slave nodes.
        in_part: Whether fronts of fatigue grow in part where nothing else is named.

    Raises:
        InputError: A deck has no word for it.
    """
    title = debond.interface.title
    head = f'*DEBOND, SLAVE="{title}", MASTER="{title} master", FREQUENCY=1'
    lines: list[str] = []
    if nodal and isinstance(debond.criterion, EnhancedVCCT):
        refuse(f"interface '{title}': toughness of EnhancedVCCT as a function of position")
    old = isinstance(debond.criterion, CriticalStress | CrackOpening | CrackLengthVsTime)
    release = choose_release(debond, step, pairs).law
    if isinstance(release, ProgressiveRelease) and not debond.release_chosen:
        log.warn(
            "write_deck: interface '%s' is released progressively by default, which a deck does "
            "not have; it is written with DEBONDING FORCE=STEP, and a front in 3-D carries less "
            "load so. Name the law, release=StepRelease(), if that is meant",
            title,
        )
        release = StepRelease()
    criterion = debond.criterion
    if in_part and isinstance(criterion, Fatigue) and criterion.partial is None:
        log.warn(
            "write_deck: interface '%s' grows in part by default (solids of first order in 3-D), "
            "which a deck does not have: read again its nodes go one after the other, and cycles "
            "come out too many. Name it, partial=False, if that is meant",
            title,
        )
    if isinstance(release, AmplitudeRelease):
        points = zip(release.times, release.fractions, strict=True)
        lines = broken([number(x) for point in points for x in point], 8, comma=False)
        if release.first_increment is not None:
            head += f", TIME INCREMENT={number(release.first_increment)}"
    elif isinstance(release, RampRelease) and release.increments is None and not old:
        head += ", DEBONDING FORCE=RAMP"
    elif not isinstance(release, StepRelease):
        refuse(f"interface '{title}': the release law {release}")
    if debond.temperature is not None or debond.watch:
        refuse(f"interface '{title}': temperature= and watch= of a Debond")
    return [head, *lines, *criterion_lines(title, debond.criterion, nodal)]


__all__ = ["debond_lines"]
