"""Crack length as a given function of total time, measured from a reference point.

With initial tip 1, current tip 3 and node 2 behind it (on the open side),

    l_3 = l_1 + d_12 + d_23,    f = (l(t) - (l_3 - d_23))/d_23

l_1 is the straight line from the reference point (the mean position of a node set) to the initial
tip, or its part along a given direction; the other lengths run along the slave surface, and l(t) is
the user's curve. f grows from 0,
crack at node 2, to 1, crack at the tip: the tip debonds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools
from fxcrack.base.checks import flag, keep, not_negative, numbers, shown, table
from fxcrack.base.errors import InputError
from fxcrack.criteria.criterion import Criterion
from fxcrack.criteria.evaluator import Evaluator
from fxcrack.criteria.interface_temperature import InterfaceTemperature
from fxcrack.criteria.probe import FrontProbe, State
from fxcrack.criteria.release_laws import Driver
from fxcrack.interface.surface_paths import Origins, SurfacePaths
from fxcrack.interface.tips import Tips


@dataclass(frozen=True)
class CrackLengthVsTime(Criterion):
    """Growth that follows a curve of crack length against total time.

    Attributes:
        times: Total times, increasing, shape (n_entries,) [time].
        lengths: Crack lengths from the reference point, never decreasing, shape (n_entries,)
            [length].
        reference: Name of the node set whose mean position is the reference point.
        moving: Whether the reference point and the initial tips take their displacements along;
            positions are those of the undeformed body otherwise.
        tolerance: f_tol; growth is accepted while 1 - f_tol <= f <= 1 + f_tol.
        direction: Direction in which l_1 is measured, of any length and 2 or 3 components: a front
            that is straight across it then stays straight. By default l_1 is the distance itself.
    """

    times: Sequence[float]
    lengths: Sequence[float]
    reference: str = field(kw_only=True)
    moving: bool = field(default=False, kw_only=True)
    tolerance: float = field(default=0.1, kw_only=True)
    direction: Sequence[float] | None = field(default=None, kw_only=True)

    degree: ClassVar[float] = 1.0
    depends_on_load: ClassVar[bool] = False
    allows_normal_only: ClassVar[bool] = True
    release_drivers: ClassVar[frozenset[Driver]] = frozenset(("once", "time"))

    def __post_init__(self) -> None:
        """Check the curve."""
        owner = "CrackLengthVsTime"
        not_negative(owner, tolerance=self.tolerance)
        keep(self, moving=flag(owner, "moving", self.moving))
        if not isinstance(self.reference, str) or not self.reference:
            raise InputError(f"{owner}: reference = {shown(self.reference)} must name a node set")
        if self.direction is not None:
            direction = numbers(owner, "direction", self.direction, words="components")
            if not any(direction) or len(direction) > 3:
                raise InputError(
                    f"{owner}: direction = {direction} must have 2 or 3 components, not all zero"
                )
            object.__setattr__(self, "direction", direction)
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

    def evaluator(
        self, probe: FrontProbe, temperature: InterfaceTemperature | None, *, softens: bool = False
    ) -> LengthEvaluator:
        """The criterion on one interface; arguments as for :meth:`Criterion.evaluator`."""
        return LengthEvaluator(probe, self)

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

    def value(self, time: float, tip: npt.ArrayLike, d_behind: npt.ArrayLike) -> Array:
        """Value f of the criterion; 0 before the curve begins.

        There is no extrapolation: after the end of the curve its last length stays.

        Args:
            time: Total time [time].
            tip: Length l_3 of each tip node, shape (n,) [length].
            d_behind: Distance d_23 from the node behind, shape (n,) [length].

        Returns:
            Values, shape (n,).
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


_SAME_TIME = 1e-9
"""The curve begins, and f jumps up from 0, this fraction of the time before its first entry."""


class LengthEvaluator(Evaluator):
    """Growth along a curve of crack length against total time; collective.

    Args:
        probe: The interface, with its front in the initial state.
        criterion: Curve and reference nodes.

    Attributes:
        reference: Reference point of the undeformed body, shape (3,), length.
        ends: Time of the last entry of the curve: growth is over then.

    Raises:
        InputError: The reference nodes do not exist.
    """

    degree: ClassVar[float] = 1.0

    def __init__(self, probe: FrontProbe, criterion: CrackLengthVsTime) -> None:
        self.probe = probe
        self.criterion = criterion
        self.front = probe.front
        self.paths = SurfacePaths(self.front)
        self.reference = probe.mean_position(criterion.reference)
        self.ends = float(criterion.times[-1])
        self._known: tuple[int, int, bytes] | None = None
        self._origins: Origins
        surface, initial = probe.pair.surface, self.paths.initial  # undeformed
        self._x = surface.x
        self._begin = np.zeros((surface.n_nodes, 3))
        self._grown = np.zeros(surface.n_nodes)
        self._moves = np.zeros(surface.n_nodes, dtype=bool)
        first = self._initial_length(surface.x - self.reference)
        self._starts = criterion.can_start(first)
        self._followed: list[int] = []
        self._slot = np.zeros(surface.n_nodes, dtype=np.int64)
        if criterion.moving and len(initial):
            self._followed.append(probe.follow(criterion.reference))
            self._followed += [probe.follow(int(node)) for node in initial]
            self._slot[initial] = 1 + np.arange(len(initial))
        stuck = initial[~self._starts[initial]]
        if len(stuck):
            i = int(stuck[np.argmin(first[stuck])])
            log.warn(
                "interface '%s': the first tabulated crack length %g is larger than the distance "
                "%g from reference '%s' to the first bonded node at (%s); %s of %d tips will "
                "never propagate: let the curve begin with a smaller length",
                probe.pair.title,
                criterion.lengths[0],
                first[i],
                criterion.reference,
                ", ".join(f"{c:.6g}" for c in surface.x[i, : probe.gdim]),
                "all" if len(stuck) == len(initial) else str(len(stuck)),
                len(initial),
            )

    def _initial_length(self, way: Array) -> Array:
        """Length l_1 of the way from the reference point, shape (n, 3) to (n,), length."""
        if self.criterion.direction is None:
            return np.asarray(np.linalg.norm(way, axis=1))
        along = np.zeros(3)
        along[: len(self.criterion.direction)] = self.criterion.direction
        return np.asarray(way @ (along / np.linalg.norm(along)))

    def _look_at(self, tips: Tips) -> Origins:
        """Note where the tips come from, when the front has moved."""
        key = (self.front.version, self.front.placed, tips.node.tobytes())
        if key != self._known:
            origins = self._origins = self.paths.origins(tips)
            x = self._x[origins.nodes]
            self._begin[tips.node] = np.einsum("nk,nkc->nc", origins.weights, x)
            self._grown[tips.node] = origins.grown
            self._moves[tips.node] = self._starts[origins.nearest]
            self._known = key
        return self._origins

    def measure(self, tips: Tips, state: State, time: float) -> Array:
        """Length of the curve, 1 once it has begun, and displacement of the origins; shape (n, 5).

        The columns are the length [length], the number 1 or 0, and the three components of the
        displacement relative to the reference point [length].
        """
        begin = self.criterion.times[0]
        if abs(time - begin) <= _SAME_TIME * abs(begin):
            time = begin
        origins = self._look_at(tips)
        out = np.zeros((len(tips), 5))
        out[:, 0] = max(self.criterion.length(time), self.criterion.lengths[0])
        out[:, 1] = time >= begin
        if self._followed:
            motion = self.probe.motion(state)[self._followed]
            at_tips = motion[self._slot[origins.nodes]]
            way = np.einsum("nk,nkc->nc", origins.weights, at_tips) - motion[0]
            out[:, 2 : 2 + way.shape[1]] = way
        return out

    def value(self, tips: Tips, measured: Array) -> tuple[Array, dict[str, Array]]:
        """Values f, and the crack length from the reference point to the tip.

        Args:
            tips: Front nodes.
            measured: From :meth:`measure`, shape (n, 5).

        Returns:
            f, shape (n,), and "length", shape (n,) [length].
        """
        way = self._begin[tips.node] - self.reference + measured[:, 2:]
        length = self._initial_length(way) + self._grown[tips.node]
        f = self.criterion.fraction(measured[:, 0], length, tips.d_behind)
        begun = measured[:, 1] > 1.0 - 1e-12  # between two states it is 1 up to round-off, or not
        return np.where(begun & self._moves[tips.node], f, 0.0), {"length": length}

    def breaks(self) -> tuple[float, ...]:
        """Times at which the curve bends."""
        return tuple(self.criterion.times)
