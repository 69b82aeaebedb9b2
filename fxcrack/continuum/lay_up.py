"""The notation of lay-ups: "[0/45/-45/90]2s" as the list of the plies' angles, bottom first.

* ``[0/90]``: two plies; ``[0/90]T``: the plies as written ("total")
* ``[0/90]s``: 0, 90, 90, 0, symmetric, the mirror image above
* ``[0/90]2`` or ``[0/90]_2``: 0, 90, 0, 90, repeated
* ``[0/90]2s``: repeated, then mirrored; ``[0/90]s2``: mirrored, then repeated
* ``[0_4/90]``: four plies of 0 side by side (clustered), then 90
* ``[+-45/0]`` or ``[±45/0]``: 45, -45, 0
* ``[0/(45/-45)2/90]``: a group within the lay-up; brackets of both kinds mean the same
"""

from __future__ import annotations

import re

from fxcrack.base.errors import InputError

_TOKEN = re.compile(r"\s*(±|\+-|[+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?|[+-]?\.\d+|[][()/_sST,])")
_OPEN = {"[": "]", "(": ")"}


def angles_of(notation: str) -> tuple[float, ...]:
    """Angles of the plies of a lay-up, degrees, bottom first.

    Args:
        notation: As described above.

    Raises:
        InputError: The text is no lay-up; the message shows where.
    """
    tokens, at = [], 0
    text = notation.rstrip()
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            raise _fault(notation, f"'{text[at:].strip()[:1]}' has no meaning there")
        tokens.append(found.group(1))
        at = found.end()
    reader = _Reader(notation, tokens)
    angles = reader.group() if tokens and tokens[0] in _OPEN else reader.items("")
    if reader.rest:
        raise _fault(notation, f"'{reader.rest[0]}' stands after its end")
    return tuple(angles)


def _fault(notation: str, what: str) -> InputError:
    return InputError(
        f"lay-up '{notation}': {what}; write angles in degrees between slashes, such as "
        "'[0/45/-45/90]2s' (s: symmetric, 2: repeated) or '[0_4/90]' (four plies of 0)"
    )


class _Reader:
    """Takes a lay-up apart from left to right.

    Attributes:
        rest: Tokens that are not read yet.
    """

    def __init__(self, notation: str, tokens: list[str]) -> None:
        self._notation = notation
        self.rest = tokens

    def _next(self) -> str:
        return self.rest[0] if self.rest else ""

    def _take(self) -> str:
        if not self.rest:
            raise _fault(self._notation, "it ends too early")
        return self.rest.pop(0)

    def group(self) -> list[float]:
        """A bracket with its repetitions and mirror images."""
        end = _OPEN[self._take()]
        angles = self.items(end)
        self._take()
        while True:
            token = self._next()
            if token in ("s", "S"):
                self._take()
                angles = angles + angles[::-1]
            elif token == "_" or token.isdigit():
                angles = angles * self._count()
            elif token == "T":
                self._take()
            else:
                return angles

    def items(self, end: str) -> list[float]:
        """Angles and groups up to a closing bracket, which is left."""
        angles = self._item()
        while self._next() in ("/", ","):
            self._take()
            angles += self._item()
        if self._next() != end:
            raise _fault(
                self._notation,
                f"'{self._next()}' has no meaning there" if self.rest else f"'{end}' is missing",
            )
        return angles

    def _item(self) -> list[float]:
        if self._next() in _OPEN:
            return self.group()
        token = self._take()
        both = token in ("±", "+-")
        if both:
            token = self._take()
        try:
            angle = float(token)
        except ValueError:
            raise _fault(self._notation, f"'{token}' is no angle") from None
        return ([angle, -angle] if both else [angle]) * (
            self._count() if self._next() == "_" else 1
        )

    def _count(self) -> int:
        if self._next() == "_":
            self._take()
        token = self._take()
        if not token.isdigit() or int(token) < 1:
            raise _fault(self._notation, f"'{token}' is no number of plies")
        return int(token)
