"""An interface that may debond, as the user describes it: where, criterion, release law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import (
    check_instance,
    keep,
    list_of,
    missing_members,
    number,
    number_or_function,
    shown,
)
from fxcrack.base.errors import InputError
from fxcrack.criteria import Criterion, ReleaseLaw, StepRelease, release_laws
from fxcrack.interface.definition import Interface
from fxcrack.interface.pair import Pair

_BY_DEFAULT = StepRelease()
"""The law of debonds that name none; told from one that was chosen by identity."""


@dataclass(frozen=True, eq=False)
class Debond:
    """An interface and the criterion by which it comes apart.

    Args:
        interface: Where.
        criterion: When.
        release: How the bond force goes to zero; by default at once (:class:`StepRelease`), in an
            :class:`fxcrack.Explicit` step progressively. In 3-D prefer
            :class:`ProgressiveRelease` unless friction excludes it: see :class:`StepRelease` for
            what releasing at once costs there.
        temperature: Temperature of the interface, a number or a function of positions of shape
            (3, n), for toughness, strength or critical opening tabulated against it.
        watch: Criteria whose quantities the history reports as well; they do not decide.
    """

    interface: Interface
    criterion: Criterion
    release: ReleaseLaw = _BY_DEFAULT
    watch: Sequence[Criterion] = ()
    temperature: float | Callable[[Array], npt.ArrayLike] | None = None

    @property
    def release_chosen(self) -> bool:
        """Whether the release law was named, and is not the default."""
        return self.release is not _BY_DEFAULT

    def __getstate__(self) -> dict[str, Any]:
        """What is copied or sent to other ranks: a law that was not named stays unnamed."""
        state = dict(self.__dict__)
        if not self.release_chosen:
            del state["release"]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what :meth:`__getstate__` gave."""
        self.__dict__.update({"release": _BY_DEFAULT} | state)

    def __post_init__(self) -> None:
        """Refuse what no model could make right."""
        example = "Interface('upper_face', 'lower_face', bonded=...)"
        check_instance("Debond", "interface", self.interface, Interface, example)
        where = f"interface '{self.interface.title}'"
        watch = list_of(self.watch)
        if watch is None:
            raise InputError(f"{where}: watch must be a list of criteria; write watch=[...]")
        keep(self, watch=tuple(watch))
        if self.temperature is not None:
            number_or_function(f"Debond of {where}", "temperature", self.temperature)
        for criterion in (self.criterion, *self.watch):
            check_criterion(where, criterion)
        missing = missing_members(self.release, ReleaseLaw)
        if missing:
            raise InputError(
                f"{where}: release = {shown(self.release)} is no release law ({missing}); give "
                "StepRelease(), ProgressiveRelease(), RampRelease(), AmplitudeRelease(...) or a "
                "class derived from ReleaseLaw"
            )
        possible = self.criterion.release_drivers
        if self.release.driver not in possible:
            raise InputError(
                f"{where}: {type(self.release).__name__} is not possible with "
                f"{type(self.criterion).__name__}"
                f"{'' if self.criterion.knows_toughness else ', which knows no toughness'}; use "
                f"{release_laws.names_of(possible)}"
            )
        gradual = self.release.driver != "once" or self.criterion.softens
        if gradual and any(c.needs_free_faces for c in (self.criterion, *self.watch)):
            raise InputError(
                f"{where}: method='domain' needs crack faces without bond forces, which a gradual "
                "release leaves behind the tip; use StepRelease() (and VCCT), or method='vcct' or "
                "method='closure'"
            )
        self._check_rigid(where)
        # a rigid surface on which faces slip takes no shear: rates are those of mode I alone
        waived = self.interface.mode_i_only and not self.criterion.allows_normal_only
        try:
            self.criterion.check_bond(normal_only=self.interface.normal_only and not waived)
        except InputError as error:
            raise InputError(f"{where}: {error}") from error

    def _check_rigid(self, where: str) -> None:
        """Refuse criteria that a rigid master does not have."""
        if not self.interface.is_rigid:
            return
        for criterion in (self.criterion, *self.watch):
            if criterion.needs_free_faces and not self.interface.symmetry:
                raise InputError(
                    f"{where}: method='domain' integrates over the bodies on both sides, and one "
                    "side is a rigid surface; use method='vcct' or method='closure', or say "
                    "symmetry=True if it is a plane of symmetry"
                )
            if getattr(criterion, "mode_length", None) is not None:
                raise InputError(
                    f"{where}: mode_length divides modes by the crack-tip fields of the bodies on "
                    "both sides, and one side is a rigid surface; leave it out"
                )
            if self.interface.symmetry and getattr(criterion, "symmetry", False):
                raise InputError(
                    f"{where}: the interface says symmetry=True already, and its openings are "
                    f"those of the whole crack; leave symmetry out of {type(criterion).__name__}"
                )


def check_criterion(where: str, criterion: Criterion) -> None:
    """Refuse what is no criterion.

    Raises:
        InputError: A member of the protocol is missing, or a number is none.
    """
    missing = missing_members(criterion, Criterion)
    if missing:
        raise InputError(
            f"{where}: {type(criterion).__name__} is not a criterion ({missing}); give VCCT or "
            "another of them, or derive yours from Criterion"
        )
    owner = f"{where}: {type(criterion).__name__}"
    low, high = criterion.release_range
    number(owner, "release_range[0]", low)
    number(owner, "release_range[1]", high)
    number(owner, "viscosity", criterion.viscosity)
    for name in ("degree", "unstable_tolerance"):
        if getattr(criterion, name) is not None:
            number(owner, name, getattr(criterion, name))


def check_friction(debonds: Sequence[Debond], pairs: Sequence[Pair]) -> None:
    """Refuse bonds that soften with their opening beside friction, but for explicit dynamics.

    Raises:
        InputError: A debond has such a release law.
    """
    rough = [pair.title for pair in pairs if pair.friction is not None]
    for debond in debonds:
        if rough and softens(debond):
            raise InputError(
                f"interface '{debond.interface.title}' is released progressively with its opening, "
                f"which is not possible beside friction (interface '{rough[0]}') but in explicit "
                "dynamics; use StepRelease(), RampRelease(increments=...) or "
                "AmplitudeRelease(...), leave friction out, or take an Explicit step"
            )


def softens(debond: Debond) -> bool:
    """Whether bond forces fall with their opening."""
    return debond.release.driver == "opening" or debond.criterion.softens
