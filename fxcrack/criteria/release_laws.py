"""How the bond force goes to zero after a node has debonded.

A law gives the fraction phi of the bond force F0 at debonding that remains, F = phi F0. What
drives it is told by ``driver``:

    "increments"  increments since debonding          StepRelease, RampRelease(increments=...)
    "time"        time since debonding                AmplitudeRelease
    "opening"     largest opening over final one      RampRelease, ProgressiveRelease

In the last case phi = 1 - w/w_f, w the opening along F0's direction. The final opening of
:class:`ProgressiveRelease` makes the area below the force exactly the toughness times the area
released,

    1/2 |F0| w_f = G_c A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array
from fxcrack.base.checks import positive, table
from fxcrack.base.errors import InputError

Driver = Literal["increments", "time", "opening"]


def _linear(largest: npt.ArrayLike, final: float) -> Array:
    """Remaining fraction 1 - w/w_f at the largest opening so far, between 1 and 0."""
    w = np.maximum(np.asarray(largest, dtype=np.float64), 0.0)
    return np.asarray(np.maximum(1.0 - w / final, 0.0))


@dataclass(frozen=True)
class StepRelease:
    """The whole force goes in the increment that follows debonding."""

    driver: ClassVar[Driver] = "increments"

    def remaining(self, increments: npt.ArrayLike) -> Array:
        """Remaining fraction after so many increments since debonding, of their shape."""
        return np.where(np.asarray(increments, dtype=np.float64) < 1.0, 1.0, 0.0)


@dataclass(frozen=True)
class RampRelease:
    """The force goes linearly, with opening or over a number of increments.

    With opening it ends at the opening the wake node had when the front node debonded, so that on
    even spacing about the toughness is spent.

    Attributes:
        increments: Number of increments after which nothing remains; None: with opening.
    """

    increments: int | None = None

    def __post_init__(self) -> None:
        """Check the number of increments."""
        if self.increments is not None and not (
            isinstance(self.increments, int | np.integer) and self.increments >= 1
        ):
            raise InputError(
                f"RampRelease: increments = {self.increments!r} must be a whole number, at "
                "least 1; None for a ramp with opening"
            )

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


@dataclass(frozen=True)
class ProgressiveRelease:
    """The force falls linearly with opening so that exactly the toughness is spent.

    The front moves continuously through an element: no saw-tooth, no dependence of the energy on
    the mesh. The opening never heals; the force ends at w_f = 2 G_c A/|F0|.
    """

    driver: ClassVar[Driver] = "opening"

    def remaining(self, progress: npt.ArrayLike) -> Array:
        """Remaining fraction.

        Args:
            progress: Largest opening over final opening, shape (n,).
        """
        return _linear(progress, 1.0)


@dataclass(frozen=True)
class AmplitudeRelease:
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

    def remaining(self, elapsed: npt.ArrayLike) -> Array:
        """Remaining fraction at times since debonding, of their shape."""
        return np.asarray(
            np.interp(np.asarray(elapsed, dtype=np.float64), self.times, self.fractions)
        )


Release = StepRelease | RampRelease | ProgressiveRelease | AmplitudeRelease
