"""Faces of shells, named by the side of a group of cells."""

from __future__ import annotations

from dataclasses import dataclass

from fxcrack.base.checks import one_of, text


@dataclass(frozen=True)
class Face:
    """The top or the bottom of a shell.

    The top is the side to which the shell's normal points (:class:`fxcrack.Section`).

    Args:
        group: Group of cells, of one section or of a part of it.
        side: "top" or "bottom".
    """

    group: str
    side: str

    def __post_init__(self) -> None:
        """Check the side."""
        text("Face", "group", self.group)
        one_of("Face", "side", self.side, ("top", "bottom"))

    def __str__(self) -> str:
        """What the history calls it."""
        return f"{self.group}.{self.side}"


__all__ = ["Face"]
