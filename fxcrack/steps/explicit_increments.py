"""Times of the increments of a step of explicit dynamics: even, or following what is stable.

Increments are even in pieces; a piece ends where another increment is chosen. Of bodies that move
far the largest stable increment is looked at whenever they have strained enough since the last
look. Where it has fallen, the next piece has shorter increments, ahead of what it may fall until
the next look; where it has risen, they grow by one grade a look. Grades are 1 % apart, so that the
increment is not another one after each look and does not hang on round-off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

_GRADE = 0.99
"""Ratio of the increments of two neighbouring grades."""
_NONE = 1e-9
"""Part of an increment that is none."""


@dataclass(frozen=True)
class Piece:
    """Even increments up to the end of the step.

    Attributes:
        first: Number of the first of them in the step.
        at: Time at which it begins.
        count: How many there are up to the end of the step.
        dt: Their length.
    """

    first: int
    at: float
    count: int
    dt: float


class Increments:
    """Increments of a step.

    Args:
        start: Time at which the step begins.
        end: Time at which it ends, after the start.
        dt: Longest increment.
        stable: Largest stable increment at the start.

    Attributes:
        piece: The present even increments.
        may_grow: Whether longer ones were stable at the last look, one grade at a time.
    """

    def __init__(self, start: float, end: float, dt: float, stable: float) -> None:
        self._start, self._end = start, end
        self.piece = self._even(0, start, dt)
        self._grade, self._longest = 0, dt
        self._stable = stable
        self.may_grow = False

    def _even(self, first: int, at: float, dt: float) -> Piece:
        left = self._end - at
        count = max(int(np.ceil(left / dt - _NONE)), 1)
        return Piece(first, at, count, left / count)

    @property
    def dt(self) -> float:
        """Length of the present increments."""
        return self.piece.dt

    @property
    def shortened(self) -> float:
        """The longest increment over the present one; what the end of the step cuts off is none."""
        return float(_GRADE**-self._grade)

    def time(self, n: int) -> float:
        """Time at which increment n begins; n from the present piece on."""
        return self.piece.at + (n - self.piece.first) * self.piece.dt

    def is_end(self, n: int) -> bool:
        """Whether increment n would begin at the end of the step."""
        return n - self.piece.first >= self.piece.count

    def progress(self, n: int) -> float:
        """Part of the step that is over where increment n begins, 0 to 1."""
        piece = self.piece
        passed = (piece.at - self._start) / (self._end - self._start)
        return passed + (1.0 - passed) * (n - piece.first) / piece.count

    def adapt(self, n: int, stable: float, safety: float) -> None:
        """Choose the increments from number n on.

        Args:
            n: Number of the increment that is about to begin.
            stable: Largest stable increment at present, time.
            safety: Part of it that is used.
        """
        fall = max(self._stable / stable - 1.0, 0.0)
        self._stable = stable
        allowed = safety * stable / (1.0 + fall)
        needed = int(np.ceil(np.log(allowed / self._longest) / np.log(_GRADE) - _NONE))
        grade = self._grade
        if needed > grade:
            grade = needed
        elif needed < grade - 1:
            grade -= 1
        self.may_grow = needed < grade - 1
        if grade != self._grade and not self.is_end(n):
            self._grade = grade
            self.piece = self._even(n, self.time(n), self._longest * _GRADE**grade)

    def state(self) -> dict[str, Any]:
        """What :meth:`restore` needs, plain values."""
        return asdict(self.piece) | {
            "grade": self._grade,
            "longest": self._longest,
            "stable": self._stable,
            "may_grow": self.may_grow,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take what :meth:`state` gave."""
        self.piece = Piece(
            int(state["first"]), float(state["at"]), int(state["count"]), float(state["dt"])
        )
        self._grade, self._longest = int(state["grade"]), float(state["longest"])
        self._stable = float(state["stable"])
        self.may_grow = bool(state.get("may_grow", False))


__all__ = ["Increments", "Piece"]
