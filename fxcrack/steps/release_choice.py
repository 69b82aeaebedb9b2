"""Which release law a debond follows in a step: the one it names, or the default of the scene.

Released at once, a front in 3-D spends less than the toughness
(:class:`~fxcrack.criteria.StepRelease`), so the default there is progressive release, wherever it
can be combined with the rest of the scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fxcrack.base.errors import InputError
from fxcrack.criteria import ProgressiveRelease, ReleaseLaw, StepRelease
from fxcrack.interface.pair import Pair, with_friction
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.debond import Debond
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.static import Dynamic, Static

Step = Static | Cycles | Explicit


@dataclass(frozen=True)
class Choice:
    """The release law of a debond in a step.

    Attributes:
        law: The law.
        why_at_once: Why a default in 3-D is not progressive, in words; empty where it is, where a
            law was named, and where progressive release does not exist at all.
    """

    law: ReleaseLaw
    why_at_once: str = ""


def choose_release(debond: Debond, step: Step, pairs: Sequence[Pair]) -> Choice:
    """The release law of a debond in a step.

    Args:
        debond: The debond.
        step: The step.
        pairs: All paired interfaces of the scene.
    """
    if isinstance(step, Explicit):
        return Choice(explicit_law(debond))
    if debond.release is not None:
        return Choice(debond.release)
    criterion = debond.criterion
    # fatigue has its own partial release; where bonds soften in any case the law changes nothing
    gradual = "opening" in criterion.release_drivers
    in_3d = any(pair.surface.dim == 2 for pair in pairs)
    if not in_3d or not gradual or criterion.grows_in_cycles or criterion.softens:
        return Choice(StepRelease())
    why = _why_at_once(debond, step, pairs)
    return Choice(StepRelease(), why) if why else Choice(ProgressiveRelease())


def explicit_law(debond: Debond) -> ReleaseLaw:
    """The release law in explicit dynamics: progressive unless one was named."""
    return ProgressiveRelease() if debond.release is None else debond.release


def _why_at_once(debond: Debond, step: Step, pairs: Sequence[Pair]) -> str:
    """What excludes progressive release, in words; empty if nothing does."""
    rough = with_friction(pairs)
    if rough:
        return f"friction (interface '{rough[0].title}')"
    if any(c.needs_free_faces for c in (debond.criterion, *debond.watch)):
        return "method='domain'"
    if debond.criterion.needs_exact_S:
        return "onset by method='closure'"
    if isinstance(step, Static) and step.stepping == "opening":
        return "stepping='opening'"
    at_any_f = debond.criterion.unstable_tolerance is not None
    in_motion = isinstance(step, Dynamic)
    if at_any_f and not in_motion and isinstance(step, Static) and step.stepping == "increment":
        # a bond that softens sheds its load as the load grows on, so that a front advances by a
        # row per increment at most, at any f that is allowed; bonds that go at once catch up
        return "unstable_tolerance in stepping='increment'"
    return ""


def softens(debond: Debond, law: ReleaseLaw) -> bool:
    """Whether bond forces fall with their opening."""
    return law.driver == "opening" or debond.criterion.softens


def check_friction(debonds: Sequence[Debond], pairs: Sequence[Pair]) -> None:
    """Refuse bonds that soften with their opening beside friction, but for explicit dynamics.

    Raises:
        InputError: A debond names such a release law, or has such a criterion.
    """
    rough = with_friction(pairs)
    for debond in debonds:
        named = debond.release is not None and debond.release.driver == "opening"
        if rough and (named or debond.criterion.softens):
            raise InputError(
                f"interface '{debond.interface.title}' is released progressively with its opening, "
                f"which is not possible beside friction (interface '{rough[0].title}') but in "
                "explicit dynamics; use StepRelease(), RampRelease(increments=...) or "
                "AmplitudeRelease(...), leave friction out, or take an Explicit step"
            )


__all__ = ["Choice", "Step", "check_friction", "choose_release", "explicit_law", "softens"]
