"""An interface that may debond, as the user describes it: where, criterion, release law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

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
from fxcrack.criteria import Criterion, ReleaseLaw, release_laws
from fxcrack.interface.definition import Interface


@dataclass(frozen=True, eq=False)
class Debond:
    """An interface and the criterion by which it comes apart.

    Args:
        interface: Where.
        criterion: When.
        release: How the bond force goes to zero. By default progressively in 3-D and in
            :class:`fxcrack.Explicit` steps (:class:`ProgressiveRelease`), at once in the plane
            (:class:`StepRelease`); at once in 3-D, too, with criteria that know no toughness, with
            :class:`Fatigue`, and where progressive release is not possible or of no use: beside
            friction, with ``method="closure"`` or ``"domain"``, with ``stepping="opening"``, with
            ``unstable_tolerance`` in static increments.
        temperature: Temperature of the interface, a number or a function of positions of shape
            (3, n), for toughness, strength or critical opening tabulated against it.
        watch: Criteria whose quantities the history reports as well; they do not decide.
    """

    interface: Interface
    criterion: Criterion
    release: ReleaseLaw | None = None
    watch: Sequence[Criterion] = ()
    temperature: float | Callable[[Array], npt.ArrayLike] | None = None

    @property
    def release_chosen(self) -> bool:
        """Whether the release law was named, and is not the default."""
        return self.release is not None

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
        if self.release is not None:
            self._check_release(where, self.release)
        named = self.release is not None and self.release.driver != "once"
        if (named or self.criterion.softens) and any(
            c.needs_free_faces for c in (self.criterion, *self.watch)
        ):
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

    def _check_release(self, where: str, release: ReleaseLaw) -> None:
        """Refuse what is no release law, and one that the criterion does not have."""
        missing = missing_members(release, ReleaseLaw)
        if missing:
            raise InputError(
                f"{where}: release = {shown(release)} is no release law ({missing}); give "
                "StepRelease(), ProgressiveRelease(), RampRelease(), AmplitudeRelease(...) or a "
                "class derived from ReleaseLaw"
            )
        possible = self.criterion.release_drivers
        if release.driver not in possible:
            raise InputError(
                f"{where}: {type(release).__name__} is not possible with "
                f"{type(self.criterion).__name__}"
                f"{'' if self.criterion.knows_toughness else ', which knows no toughness'}; use "
                f"{release_laws.names_of(possible)}"
            )

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
        kind = criterion if isinstance(criterion, type) else type(criterion)
        raise InputError(
            f"{where}: {kind.__name__} is not a criterion ({missing}); give VCCT or "
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
