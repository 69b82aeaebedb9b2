"""Crack length as a given function of total time, measured from a reference point.

With initial tip 1, current tip 3 and node 2 behind it (on the open side),

    l_3 = l_1 + d_12 + d_23,    f = (l(t) - (l_3 - d_23))/d_23

l_1 is the straight line from the reference point (the mean position of a node set) to the initial
tip, the other lengths run along the slave surface, and l(t) is the user's curve. f grows from 0,
crack at node 2, to 1, crack at the tip: the tip debonds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from fxcrack.criteria.checks import Array, Bools, not_negative, table
from fxcrack.errors import InputError


@dataclass(frozen=True)
class CrackLengthVsTime:
    """Growth that follows a curve of crack length against total time.

    Attributes:
        times: Total times, increasing, shape (n_entries,) [time].
        lengths: Crack lengths from the reference point, never decreasing, shape (n_entries,)
            [length].
        reference: Name of the node set whose mean position is the reference point.
        moving: Whether the reference point and the initial tips take their displacements along;
            positions are those of the undeformed body otherwise.
        tolerance: f_tol; growth is accepted while 1 - f_tol <= f <= 1 + f_tol.
    """

    times: Sequence[float]
    lengths: Sequence[float]
    reference: str = field(kw_only=True)
    moving: bool = field(default=False, kw_only=True)
    tolerance: float = field(default=0.1, kw_only=True)

    allows_normal_only: ClassVar[bool] = True
    """Whether a bond in the normal direction only is possible."""

    def __post_init__(self) -> None:
        """Check the curve."""
        owner = "CrackLengthVsTime"
        not_negative(owner, tolerance=self.tolerance)
        if not isinstance(self.reference, str) or not self.reference:
            raise InputError(f"{owner}: reference = {self.reference!r} must name a node set")
        times, lengths = table(owner, ("times", "lengths"), self.times, self.lengths)
        drops = np.flatnonzero(np.diff(lengths) < 0.0)
        if drops.size:
            i = int(drops[0])
            raise InputError(
                f"{owner}: lengths fall from {lengths[i]:g} to {lengths[i + 1]:g} at entry "
                f"{i + 1}; a crack does not shrink: give lengths that never decrease"
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "lengths", lengths)

    @property
    def window(self) -> tuple[float, float]:
        """Lower and upper limit of f at which a node may debond."""
        return 1.0 - self.tolerance, 1.0 + self.tolerance

    def can_start(self, first_distance: npt.ArrayLike) -> Bools:
        """Whether the crack can ever start: not if the curve begins beyond the first bonded node.

        Args:
            first_distance: Distance from the reference point to the initial tip, the first bonded
                node, shape (n,) or one number [length].

        Returns:
            Truth values of that shape. Equal lengths count as a start, up to round-off.
        """
        first = np.asarray(first_distance, dtype=np.float64)
        return np.asarray(self.lengths[0] <= first * (1.0 + 1e-9))

    def length(self, time: float) -> float:
        """Crack length of the curve; -inf before it begins, the last length after it ends [length].

        Args:
            time: Total time [time].
        """
        if time < self.times[0]:
            return -np.inf
        return float(np.interp(time, self.times, self.lengths))

    def time_of(self, length: float) -> float:
        """First time at which the curve reaches a length; infinite when it never does [time].

        Args:
            length: Crack length from the reference point [length].
        """
        if length > self.lengths[-1]:
            return np.inf
        i = int(np.searchsorted(self.lengths, length, side="left"))
        if i == 0:
            return float(self.times[0])
        low, high = self.lengths[i - 1], self.lengths[i]
        part = (length - low) / (high - low)
        return float(self.times[i - 1] + part * (self.times[i] - self.times[i - 1]))

    def value(self, time: float, tip: npt.ArrayLike, d_behind: npt.ArrayLike) -> Array:
        """Value f of the criterion; 0 before the curve begins.

        There is no extrapolation: after the end of the curve its last length stays.

        Args:
            time: Total time [time].
            tip: As for :meth:`fraction`.
            d_behind: Likewise.
        """
        length = self.length(time)
        begun = length > -np.inf
        return np.where(begun, self.fraction(length if begun else 0.0, tip, d_behind), 0.0)

    def fraction(self, length: npt.ArrayLike, tip: npt.ArrayLike, d_behind: npt.ArrayLike) -> Array:
        """Value f of the criterion when the curve has reached a length.

        Args:
            length: Length of the curve, shape (n,) or one number [length].
            tip: Length l_3 of each tip node, shape (n,) [length].
            d_behind: Distance d_23 along the slave surface from the node behind, shape (n,)
                [length].

        Raises:
            InputError: A distance is not positive.
        """
        l3 = np.asarray(tip, dtype=np.float64)
        d = np.asarray(d_behind, dtype=np.float64)
        if not (d > 0.0).all():
            raise InputError(
                "CrackLengthVsTime: the distance from the node behind the tip must be positive, "
                f"not {d.min():g}; look at the slave surface near the tip"
            )
        return np.asarray((np.asarray(length, dtype=np.float64) - (l3 - d)) / d)
