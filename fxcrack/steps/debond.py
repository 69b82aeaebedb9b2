"""An interface that may debond, as the user describes it: where, criterion, release law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.criteria import (
    VCCT,
    AmplitudeRelease,
    CrackLengthVsTime,
    CrackOpening,
    CriticalStress,
    EnhancedVCCT,
    RateCriterion,
    Release,
    StepRelease,
)
from fxcrack.interface.pairing import Interface, Pair

Criterion = RateCriterion | CriticalStress | CrackOpening | CrackLengthVsTime


@dataclass(frozen=True, eq=False)
class Debond:
    """An interface and the criterion by which it comes apart.

    Args:
        interface: Where.
        criterion: When.
        release: How the bond force goes to zero.
        temperature: Temperature of the interface, a number or a function of positions of shape
            (n, gdim), for toughness, strength or critical opening tabulated against it.
        watch: Criteria whose quantities the history reports as well; they do not decide.
    """

    interface: Interface
    criterion: Criterion
    release: Release = field(default_factory=StepRelease)
    watch: Sequence[Criterion] = ()
    temperature: float | Callable[[Array], npt.ArrayLike] | None = None

    def __post_init__(self) -> None:
        """Refuse what no model could mend."""
        where = f"interface '{self.interface.title}'"
        name, law = type(self.criterion).__name__, type(self.release).__name__
        if not isinstance(self.criterion, Criterion):
            raise InputError(f"{where}: {name} is not a criterion; give VCCT or another of them")
        if not hasattr(self.release, "driver") or isinstance(self.release, type):
            raise InputError(
                f"{where}: release = {self.release!r} is no release law; give "
                "StepRelease(), ProgressiveRelease(), RampRelease() or AmplitudeRelease(...)"
            )
        if not isinstance(self.criterion, RateCriterion):
            if not isinstance(self.release, StepRelease | AmplitudeRelease):
                raise InputError(
                    f"{where}: {law} is not possible with {name}, which knows no toughness; "
                    "use StepRelease or AmplitudeRelease"
                )
            if isinstance(self.criterion, CrackOpening):
                self.criterion.check_bond(normal_only=self.interface.normal_only)
            return
        if self.interface.normal_only:
            raise InputError(
                f"{where}: bonds in the normal direction only are not possible with {name}; bond "
                "in all directions, or use a critical stress, opening or crack length criterion"
            )
        if isinstance(self.release, AmplitudeRelease):
            raise InputError(
                f"{where}: {law} is not possible with {name}; its bonds are released by "
                "StepRelease, RampRelease or ProgressiveRelease; an amplitude of time serves the "
                "critical stress, opening and crack length criteria"
            )


def check_friction(debonds: Sequence[Debond], pairs: Sequence[Pair]) -> None:
    """Refuse bonds that soften with their opening beside friction.

    Raises:
        InputError: A debond has such a release law.
    """
    rough = [pair.title for pair in pairs if pair.friction is not None]
    for debond in debonds:
        if rough and softens(debond):
            raise InputError(
                f"interface '{debond.interface.title}' is released progressively with its opening, "
                f"which is not possible beside friction (interface '{rough[0]}'); use "
                "StepRelease(), RampRelease(increments=...) or AmplitudeRelease(...), or leave "
                "friction out"
            )


def _warn_of_neutral_onset(criterion: VCCT, title: str) -> None:
    """Say what softening from an onset by exact crack closure does.

    There the energy of letting the node go is the one it is to spend: its bond softens as fast as
    the bodies give way.
    """
    if criterion.method == "closure" and not isinstance(criterion, EnhancedVCCT):
        log.warn(
            "interface '%s': a bond whose onset is found by method='closure' is neutral there and "
            "opens at once, as with StepRelease, though its release is to follow the opening; wide "
            "fronts then carry a third too much load. Take method='vcct', or use StepRelease",
            title,
        )


def softens(debond: Debond) -> bool:
    """Whether bond forces fall with their opening."""
    return debond.release.driver == "opening" or isinstance(debond.criterion, EnhancedVCCT)
