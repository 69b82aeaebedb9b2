"""Increment control as a pure object: grow, cut back, give up.

accepted: dt <- min(dt growth, maximum)      rejected: dt <- dt cutback
"""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.steps.static import Static


class TooManyCutbacks(ArithmeticError):
    """The increment cannot be made small enough."""


@dataclass
class IncrementControl:
    """Size of the next time increment.

    Args:
        step: The user's limits.

    Attributes:
        size: Next increment, time.
        cutbacks: Cutbacks in the present increment.
    """

    step: Static
    size: float = 0.0
    cutbacks: int = 0

    def __post_init__(self) -> None:
        """Begin with the initial increment."""
        self.size = self.step.initial

    def accepted(self) -> None:
        """The increment was good: the next may be larger."""
        if self.cutbacks == 0:
            self.size = min(self.size * self.step.growth, self.step.maximum)
        self.cutbacks = 0

    def suggest(self, size: float) -> None:
        """Take another size for the next increment; infinite for no suggestion."""
        if size < float("inf"):
            self.size = min(max(size, self.step.minimum), self.step.maximum)

    def rejected(self, used: float, why: str) -> None:
        """The increment ``used`` was too large.

        Raises:
            TooManyCutbacks: Limit of cutbacks or smallest increment reached; says what to change.
        """
        self.cutbacks += 1
        self.size = used * self.step.cutback
        if self.cutbacks > self.step.max_cutbacks:
            raise TooManyCutbacks(
                f"{why} after {self.step.max_cutbacks} cutbacks; allow unstable growth "
                "(unstable_tolerance), raise the tolerance or max_cutbacks, or use "
                "stepping='event'"
            )
        if self.size < self.step.minimum:
            raise TooManyCutbacks(
                f"{why} and the next increment {self.size:.3g} would be below the minimum "
                f"{self.step.minimum:.3g}; lower the minimum, or use stepping='event'"
            )
