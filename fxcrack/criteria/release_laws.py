"""How the bond force goes to zero after a node has debonded.

A law gives the fraction phi of the bond force F0 at debonding that remains, F = phi F0. What
drives it is given by ``driver``:

    "once"        nothing: all of it is removed       StepRelease
    "increments"  increments since debonding          RampRelease(increments=...)
    "time"        time since debonding                AmplitudeRelease
    "opening"     largest opening over final one      RampRelease, ProgressiveRelease

In the last case phi = 1 - w/w_f, w the opening along F0's direction. The final opening of
:class:`ProgressiveRelease` makes the area below the force exactly the toughness times the area
released,

    1/2 |F0| w_f = G_c A.

A new law is one class derived from :class:`ReleaseLaw`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import is_count, positive, shown, table, whole
from fxcrack.base.errors import InputError

Driver = Literal["once", "increments", "time", "opening"]

_NAMES: dict[Driver, str] = {
    "once": "StepRelease",
    "increments": "RampRelease(increments=...)",
    "time": "AmplitudeRelease",
    "opening": "ProgressiveRelease",
}


def names_of(drivers: Iterable[Driver]) -> str:
    """The laws of this module that some drivers stand for, in words."""
    *some, last = [name for driver, name in _NAMES.items() if driver in set(drivers)]
    return f"{', '.join(some)} or {last}" if some else last


class ReleaseLaw(Protocol):
    """How the bond force of a node goes to zero after debonding.

    A class that does not derive from it must have all of its members.
    """

    @property
    def driver(self) -> Driver:
        """What the force falls with; this decides how a release begins.

        "once": it is removed in the increment after debonding. "increments", "time": it follows
        :meth:`remaining`. "opening": it falls linearly until the energy :meth:`spent` is
        dissipated.
        """
        ...

    def remaining(self, progress: npt.ArrayLike) -> Array:
        """Remaining fraction of the force at debonding, of the shape of ``progress``.

        Args:
            progress: Increments or time since debonding, or the largest opening over the final one.
        """
        ...

    def breaks(self) -> tuple[float, ...]:
        """Times since debonding at which the fraction changes its slope [time]."""
        return ()

    @property
    def suggested_increment(self) -> float:
        """Increment suggested for the first one after debonding [time]; inf: none."""
        return float("inf")

    def spent(self, rate: Array, critical: Array) -> Array:
        """Energy per area dissipated by bonds whose force falls with opening, shape (n,).

        Args:
            rate: Total energy release rate at debonding, shape (n,) [force/length].
            critical: Total rate at which growth starts at this mode mix, likewise.
        """
        return critical


def _linear(largest: npt.ArrayLike, final: float) -> Array:
    """Remaining fraction 1 - w/w_f at the largest opening so far, between 1 and 0."""
    w = np.maximum(np.asarray(largest, dtype=np.float64), 0.0)
    return np.asarray(np.maximum(1.0 - w / final, 0.0))


@dataclass(frozen=True)
class StepRelease(ReleaseLaw):
    """The whole force is removed in the increment that follows debonding.

    The default in 2-D, where the load at every onset is right. On a front in 3-D it loses energy: a
    single node that runs ahead of its neighbours is released when its own f is 1, and the energy
    set free per area stays below the toughness. A double cantilever beam 20 wide with elements of
    1 x 2 carries 14 % less load at the same opening than corrected beam theory, whatever the
    spacing across; with :class:`ProgressiveRelease`, the default in 3-D, it is 1.7 % more, of which
    the bending stiffness of first-order elements is the most (demo ``front3d``).
    """

    driver: ClassVar[Driver] = "once"

    def remaining(self, increments: npt.ArrayLike) -> Array:
        """Remaining fraction after so many increments since debonding, of their shape."""
        return np.where(np.asarray(increments, dtype=np.float64) < 1.0, 1.0, 0.0)


@dataclass(frozen=True)
class RampRelease(ReleaseLaw):
    """The force falls linearly, with opening or over a number of increments.

    With opening it ends at the opening the wake node had when the front node debonded, so that on
    even spacing about the toughness is dissipated.

    Attributes:
        increments: Number of increments after which nothing remains; None: with opening.
    """

    increments: int | None = None

    def __post_init__(self) -> None:
        """Check the number of increments."""
        if self.increments is not None:
            words = "None for a ramp with opening"
            number_of = whole("RampRelease", "increments", self.increments, words=words)
            object.__setattr__(self, "increments", number_of)

    @property
    def driver(self) -> Driver:
        """What the force falls with."""
        return "opening" if self.increments is None else "increments"

    def remaining(self, progress: npt.ArrayLike) -> Array:
        """Remaining fraction.

        Args:
            progress: Largest opening over final opening, or increments since debonding, shape (n,).
        """
        return _linear(progress, 1.0 if self.increments is None else self.increments)

    def spent(self, rate: Array, critical: Array) -> Array:
        """The rate itself: 1/2 F0 w_c with the opening of the wake is what crack closure calls G A.

        Arguments as for :meth:`ReleaseLaw.spent`.
        """
        return rate


@dataclass(frozen=True)
class ProgressiveRelease(ReleaseLaw):
    """The force falls linearly with opening so that exactly the toughness is dissipated.

    The front moves continuously through an element: no saw-tooth, no dependence of the energy on
    the mesh. Damage is irreversible; the force ends at w_f = 2 G_c A divided by the size of F0. The
    default in 3-D and in :class:`fxcrack.Explicit` steps.

    Attributes:
        zone: Elements over which a bond softens, 1 or 2. With 2 softening begins at f = 1/2 and
            spends the same energy, which leaves a fast crack (above a third of the Rayleigh speed)
            less energy to lose to waves of mesh length; explicit dynamics only.
    """

    zone: int = 1

    driver: ClassVar[Driver] = "opening"

    def __post_init__(self) -> None:
        """Check the zone."""
        if not is_count(self.zone) or self.zone not in (1, 2):
            raise InputError(
                f"ProgressiveRelease: zone = {shown(self.zone)}: choose 1 or 2 elements"
            )

    @property
    def onset(self) -> float:
        """Value of f at which softening begins."""
        return 1.0 / self.zone

    def remaining(self, progress: npt.ArrayLike) -> Array:
        """Remaining fraction.

        Args:
            progress: Largest opening over final opening, shape (n,).
        """
        return _linear(progress, 1.0)


@dataclass(frozen=True)
class AmplitudeRelease(ReleaseLaw):
    """The force follows a curve of time since debonding, from 1 to 0.

    Attributes:
        times: Times since debonding, increasing from 0, shape (n_entries,) [time].
        fractions: Remaining fractions, first 1, last 0, shape (n_entries,).
        first_increment: Increment suggested for the first one after debonding [time]; the last
            time of the curve when not given.
    """

    times: Sequence[float]
    fractions: Sequence[float]
    first_increment: float | None = None

    driver: ClassVar[Driver] = "time"

    def __post_init__(self) -> None:
        """Check the curve."""
        owner = "AmplitudeRelease"
        times, fractions = table(owner, ("times", "fractions"), self.times, self.fractions)
        if times[0] != 0.0 or fractions[0] != 1.0:
            raise InputError(
                f"{owner}: the curve begins with fraction {fractions[0]:g} at time {times[0]:g}; "
                "it must begin with 1 at time 0, the whole force at debonding"
            )
        if len(times) < 2 or fractions[-1] != 0.0:
            raise InputError(
                f"{owner}: the curve ends with fraction {fractions[-1]:g} at time {times[-1]:g}; "
                "it must end with 0, or the force would never go"
            )
        if self.first_increment is not None:
            positive(owner, first_increment=self.first_increment)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "fractions", fractions)

    @property
    def suggested_increment(self) -> float:
        """Increment suggested for the first one after debonding [time]."""
        return self.times[-1] if self.first_increment is None else self.first_increment

    def breaks(self) -> tuple[float, ...]:
        """Times since debonding at which the curve bends [time]."""
        return tuple(self.times)

    def remaining(self, progress: npt.ArrayLike) -> Array:
        """Remaining fraction at times since debonding, of their shape."""
        return np.asarray(
            np.interp(np.asarray(progress, dtype=np.float64), self.times, self.fractions)
        )
