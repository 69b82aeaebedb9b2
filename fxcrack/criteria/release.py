"""How the bond force goes to zero after a node has debonded.

A law gives the fraction phi of the bond force F0 at debonding that remains, F = phi F0. What
drives it is told by ``driver``:

    "increments"  increments since debonding          Step, Ramp(increments=...)
    "time"        time since debonding                AmplitudeRelease
    "opening"     largest opening over final one      Ramp, Progressive

In the last case phi = 1 - w/w_f, w the opening along F0's direction. The final opening of
:class:`Progressive` makes the area below the force exactly the toughness times the area released,

    1/2 |F0| w_f = G_c A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from fxcrack.criteria.checks import Array, positive, table
from fxcrack.errors import InputError

Driver = Literal["increments", "time", "opening"]


def final_opening(force: npt.ArrayLike, toughness: npt.ArrayLike, area: npt.ArrayLike) -> Array:
    """Opening at which a linearly falling force has spent the toughness, w_f = 2 G A/|F0|.

    Args:
        force: Bond forces at debonding, shape (n, dim) [force].
        toughness: Energy per area to spend, shape (n,) or one number [force/length].
        area: Area the node stands for, shape (n,) or one number [length^2].

    Returns:
        Final openings along the direction of the force, shape (n,) [length]; infinite for no force.
    """
    size = np.linalg.norm(np.asarray(force, dtype=np.float64), axis=-1)
    energy = 2.0 * np.asarray(toughness, dtype=np.float64) * np.asarray(area, dtype=np.float64)
    energy = np.broadcast_to(energy, size.shape)
    return np.asarray(np.divide(energy, size, out=np.full(size.shape, np.inf), where=size > 0.0))


def linear_fraction(largest: npt.ArrayLike, final: npt.ArrayLike) -> Array:
    """Remaining fraction 1 - w/w_f at the largest opening so far, between 1 and 0.

    Args:
        largest: Largest opening so far, shape (n,) [length]; negative ones count as zero.
        final: Opening at which nothing remains, shape (n,) or one number [length].
    """
    w = np.maximum(np.asarray(largest, dtype=np.float64), 0.0)
    end = np.asarray(final, dtype=np.float64)
    return np.asarray(np.maximum(1.0 - w / end, 0.0))


def spent_fraction(largest: npt.ArrayLike, final: npt.ArrayLike) -> Array:
    """Part of G_c A that a linearly falling force has spent: q (2 - q), q = w/w_f, at most 1.

    Arguments as for :func:`linear_fraction`.
    """
    return np.asarray(1.0 - linear_fraction(largest, final) ** 2)


@dataclass(frozen=True)
class Step:
    """The whole force goes in the increment that follows debonding."""

    driver: ClassVar[Driver] = "increments"

    def remaining(self, increments: npt.ArrayLike) -> Array:
        """Remaining fraction after so many increments since debonding, of their shape."""
        return np.where(np.asarray(increments, dtype=np.float64) < 1.0, 1.0, 0.0)


@dataclass(frozen=True)
class Ramp:
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
                f"Ramp: increments = {self.increments!r} must be a whole number, at least 1; "
                "None for a ramp with opening"
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
        return linear_fraction(progress, 1.0 if self.increments is None else self.increments)


@dataclass(frozen=True)
class Progressive:
    """The force falls linearly with opening so that exactly the toughness is spent.

    The front moves continuously through an element: no saw-tooth, no dependence of the energy on
    the mesh. The opening never heals; see :func:`final_opening` for where the force ends.
    """

    driver: ClassVar[Driver] = "opening"

    def remaining(self, progress: npt.ArrayLike) -> Array:
        """Remaining fraction.

        Args:
            progress: Largest opening over final opening, shape (n,).
        """
        return linear_fraction(progress, 1.0)


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


Release = Step | Ramp | Progressive | AmplitudeRelease


def viscous_damage(
    damage: npt.ArrayLike, previous: npt.ArrayLike, dt: float, viscosity: float
) -> Array:
    """Damage that lags behind, mu dD_v/dt = D - D_v, by one step of implicit Euler.

    Args:
        damage: Damage D = 1 - phi at the end of the increment, shape (n,).
        previous: Lagging damage at its start, shape (n,).
        dt: Time increment, positive [time].
        viscosity: mu, zero or positive [time]; 0 gives ``damage``.

    Returns:
        Lagging damage D_v at the end of the increment, shape (n,); the bond force is (1 - D_v) F0.
    """
    d = np.asarray(damage, dtype=np.float64)
    old = np.asarray(previous, dtype=np.float64)
    return np.asarray((dt * d + viscosity * old) / (dt + viscosity))


def viscous_work(
    force: npt.ArrayLike,
    lag_start: npt.ArrayLike,
    lag_end: npt.ArrayLike,
    opening_start: npt.ArrayLike,
    opening_end: npt.ArrayLike,
) -> Array:
    """Work of the viscous part (D - D_v) F0 of the bond force over an increment, trapezoidal rule.

    Args:
        force: Size |F0| of the bond force at debonding, shape (n,) [force].
        lag_start: D - D_v at the start of the increment, shape (n,).
        lag_end: The same at its end.
        opening_start: Opening along F0's direction at the start, shape (n,) [length].
        opening_end: The same at the end.

    Returns:
        Work, shape (n,) [force length].
    """
    lag = np.asarray(lag_start, dtype=np.float64) + np.asarray(lag_end, dtype=np.float64)
    moved = np.asarray(opening_end, dtype=np.float64) - np.asarray(opening_start, dtype=np.float64)
    return np.asarray(0.5 * np.asarray(force, dtype=np.float64) * lag * moved)
