"""Quasi-static and dynamic steps: the controls a user may give."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from fxcrack.base.checks import keep, keep_floats, number, number_or_nan, shown, whole
from fxcrack.base.errors import InputError
from fxcrack.steps.end_conditions import Until, conditions

STEPPINGS = ("event", "increment", "path", "opening")


@dataclass(frozen=True)
class Static:
    """A quasi-static step.

    Args:
        until: End condition, or a list of them of which the first met ends the step.
        stepping: "event" advances from release to release, each at exactly f = 1;
            "increment" takes time increments and accepts 1 <= f <= 1 + tolerance, cutting back
            above; "path" keeps the load factor of a proportional load on the equilibrium path at
            f = 1, also where that means unloading (snap-back under load control); "opening" finds
            the load factor of a proportional load from a monitored displacement that never falls:
            after a release the load falls until the opening is what it was, and nodes whose f is
            still 1 or more are released at the same opening. Not with friction. Beside the
            proportional load, "path" and "opening" allow loads that are constant in the step; the
            load factor may then become negative.
        opening: With stepping="opening", the name of the monitor that is controlled, or of two of
            which it is the first less the second, e.g. both faces at the crack mouth. It must grow
            with the load. The name of a pressure with ``follows_crack`` controls the injected
            volume.
        initial: First increment, in time; ``maximum`` if that is smaller than the default.
            Increment stepping only, as all below but ``maximum`` (nonlinear bodies heed it always).
        minimum: Smallest increment; needing less ends the step.
        maximum: Largest increment.
        growth: Factor on the increment after an accepted one.
        cutback: Factor on the increment after a rejected one.
        max_increments: Increments allowed in the step.
        max_cutbacks: Cutbacks allowed in one increment.
        linear_scaling: Factor beta (0.9 is usual) with which increments before the first release
            head straight for it, assuming a proportional load; ``None`` does not.
    """

    until: Until | Sequence[Until]
    stepping: str = "event"
    opening: str | tuple[str, str] | None = field(default=None, kw_only=True)
    initial: float = 0.1
    minimum: float = 1e-9
    maximum: float = float("inf")
    growth: float = 1.5
    cutback: float = 0.5
    max_cutbacks: int = 5
    max_increments: int = 10_000
    linear_scaling: float | None = None

    def __post_init__(self) -> None:
        """Check the end and the controls."""
        conditions(type(self).__name__, self.until)
        if not isinstance(self.stepping, str) or self.stepping not in STEPPINGS:
            raise InputError(
                f"stepping = {shown(self.stepping)}: choose event, increment, path or opening"
            )
        if (self.stepping == "opening") != (self.opening is not None):
            raise InputError(
                f"stepping = {shown(self.stepping)} with opening = {shown(self.opening)}: "
                "stepping='opening' needs the name of a monitor, or of two to subtract; other "
                "steppings take none"
            )
        if not isinstance(self.opening, str | tuple | list | None):
            raise InputError(
                f"opening = {shown(self.opening)}: give the name of one monitor, or a pair of names"
            )
        names = self.monitors
        wrong = not all(isinstance(n, str) and n for n in names) or len(names) > 2
        if wrong or (self.opening is not None and not names):
            raise InputError(
                f"opening = {shown(self.opening)}: give the name of one monitor, or a pair of names"
            )
        owner = type(self).__name__
        for name in ("initial", "minimum", "maximum", "growth", "cutback"):
            # NaN satisfies none of the inequalities below, which say what is allowed
            keep(self, **{name: number_or_nan(owner, name, getattr(self, name))})
        if self.initial == Static.initial and 0.0 < self.maximum < self.initial:
            object.__setattr__(self, "initial", self.maximum)
        if not 0.0 < self.minimum <= self.initial <= self.maximum:
            raise InputError(
                f"increments must satisfy 0 < minimum <= initial <= maximum, "
                f"not {self.minimum}, {self.initial}, {self.maximum}"
            )
        cutbacks = whole(owner, "max_cutbacks", self.max_cutbacks, least=0)
        if not (self.growth >= 1.0 and 0.0 < self.cutback < 1.0):
            raise InputError(
                f"growth = {self.growth}, cutback = {self.cutback}: growth must be >= 1, cutback "
                "between 0 and 1, max_cutbacks >= 0"
            )
        if not math.isfinite(self.growth):
            raise InputError(f"{owner}: growth = {self.growth} must be finite")
        words = "allow at least one"
        increments = whole(owner, "max_increments", self.max_increments, words=words)
        keep(self, max_cutbacks=cutbacks, max_increments=increments)
        if self.linear_scaling is not None and not (
            0.0 < number(owner, "linear_scaling", self.linear_scaling) < 1.0
        ):
            raise InputError(
                f"linear_scaling = {self.linear_scaling} must lie between 0 and 1; 0.9 is usual"
            )

    @property
    def monitors(self) -> tuple[str, ...]:
        """Names of the monitors whose displacement, or its difference, is controlled."""
        if self.opening is None:
            return ()
        return (self.opening,) if isinstance(self.opening, str) else tuple(self.opening)

    @property
    def ends(self) -> tuple[Until, ...]:
        """End conditions as a tuple."""
        return conditions(type(self).__name__, self.until)


@dataclass(frozen=True)
class Dynamic(Static):
    """A step in real time, for a scene with :class:`fxcrack.Inertia`.

    Increments of the time step; an increment in which f overshoots 1 + tolerance is cut back and
    the time step grows back afterwards. Released bonds lose their force over the next increment.

    Args:
        dt: Time step, time; sets ``initial`` and ``maximum``.
    """

    stepping: str = "increment"
    dt: float = float("nan")

    def __post_init__(self) -> None:
        """Let the increments be the time step."""
        if not 0.0 < number_or_nan("Dynamic", "dt", self.dt) < float("inf"):
            raise InputError(f"Dynamic: dt = {self.dt} must be a positive time")
        keep_floats(self, "dt")
        keep(self, initial=self.dt, maximum=self.dt)
        number("Dynamic", "minimum", self.minimum)
        object.__setattr__(self, "minimum", min(self.minimum, 1e-6 * self.dt))
        super().__post_init__()
