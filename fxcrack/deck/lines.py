"""Numbers, words and sets as lines of a deck."""

from __future__ import annotations

from collections.abc import Sequence

from fxcrack.base.arrays import Ints

_PER_LINE = 12


def number(value: float) -> str:
    """A number with all its digits."""
    return repr(float(value))


def broken(words: Sequence[str], width: int, *, comma: bool = True) -> list[str]:
    """Words in lines of so many; a comma says that the next line continues."""
    parts = [", ".join(words[i : i + width]) for i in range(0, len(words), width)]
    return [p + "," for p in parts[:-1]] + parts[-1:] if comma else parts


def set_lines(kind: str, name: str, members: Ints, more: str = "") -> list[str]:
    """A set of nodes or elements.

    Args:
        kind: NSET or ELSET.
        name: Of the set.
        members: Counted from 0, shape (n,).
        more: Further parameters.
    """
    words = [str(int(m) + 1) for m in members]
    rows = [", ".join(words[i : i + _PER_LINE]) for i in range(0, len(words), _PER_LINE)]
    return [f'*{kind}, {kind}="{name}"{more}', *rows]
