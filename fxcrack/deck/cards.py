"""Cards of a deck: a keyword with its parameters and data lines, and where they stand.

Names of keywords and parameters are compared without blanks and in capitals (``*END STEP`` is
``ENDSTEP``), names of sets, surfaces, materials without regard to case and quotes.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError, did_you_mean

_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")
_NO_LETTER = re.compile(r"^([+-]?(?:\d+\.?\d*|\.\d+))([+-]\d+)$")


class DeckError(InputError):
    """A deck cannot be read, or asks for something that fxcrack has no word for."""


def squeeze(text: str) -> str:
    """A keyword or a parameter's name without blanks, in capitals."""
    return "".join(text.split()).upper()


def label(text: str) -> str:
    """A name as the deck's author wrote it, without quotes and outer blanks."""
    return text.replace('"', "").strip()


def key(text: str) -> str:
    """A name as it is compared."""
    return label(text).upper()


def fields_of(line: str) -> list[str]:
    """The comma-separated fields of a line, stripped; commas in quotes separate nothing.

    A comma at the end of a line begins no further field.
    """
    if '"' in line:
        parts = re.findall(r'(?:"[^"]*"?|[^,"])+|(?<=,)(?=,)|^(?=,)', line)
    else:
        parts = line.split(",")
    found = [part.strip() for part in parts]
    while found and not found[-1]:
        found.pop()
    return found


def to_float(text: str) -> float | None:
    """A number in any Fortran spelling, None where the text is none."""
    try:
        return float(text)
    except ValueError:
        pass
    text = _FORTRAN.sub("e", text.strip())
    match = _NO_LETTER.match(text)
    try:
        return float(f"{match[1]}e{match[2]}" if match else text)
    except ValueError:
        return None


@dataclass(frozen=True)
class Row:
    """One data line.

    Attributes:
        fields: Its fields, stripped; at least one.
        card: The card it belongs to.
        index: Its place among the card's data lines.
    """

    fields: list[str]
    card: Card
    index: int

    def __len__(self) -> int:
        """Number of fields."""
        return len(self.fields)

    def text(self, i: int) -> str:
        """Field ``i``, empty where there is none."""
        return self.fields[i] if i < len(self.fields) else ""

    def number(self, i: int, default: float | None = None, *, what: str = "a number") -> float:
        """Field ``i`` as a finite number.

        Args:
            i: Which field, from 0.
            default: Value of an empty field; None: it must not be empty.
            what: What the number is, for messages.

        Raises:
            DeckError: It is no number, or empty without a default.
        """
        text = self.text(i)
        if not text:
            if default is None:
                self.fail(f"field {i + 1} is empty; give {what} there")
            return default
        value = to_float(text)
        if value is None or not np.isfinite(value):
            self.fail(f"field {i + 1}, '{text}', is not a number; give {what} there")
        return value

    def whole(self, i: int, default: int | None = None, *, what: str = "a whole number") -> int:
        """Field ``i`` as a whole number; arguments and error as for :meth:`number`."""
        value = self.number(i, None if default is None else float(default), what=what)
        if value != int(value) or abs(value) > 2**53:
            self.fail(f"field {i + 1}, '{self.text(i)}', is not a whole number; give {what} there")
        return int(value)

    def numbers(self) -> list[float]:
        """All fields as numbers, empty ones as 0."""
        return [self.number(i, 0.0) for i in range(len(self.fields))]

    def fail(self, message: str) -> NoReturn:
        """Raise a :class:`DeckError` that names the line."""
        self.card.fail(message, self.index)


@dataclass(eq=False)
class Card:
    """A keyword with its parameters and data lines.

    Attributes:
        keyword: Without blanks, in capitals.
        title: As messages show it, e.g. "*SOLID SECTION".
        options: Value of each parameter by its squeezed name; None for one without a value.
        lines: Data lines without comments and blank lines.
        places: File and line of each data line, in runs (file, lines).
        file: File of the keyword.
        line: Its line, from 1.
        home: Key of the instance in whose part it stands, empty outside of parts.
    """

    keyword: str
    title: str
    options: dict[str, str | None]
    file: str
    line: int
    lines: list[str] = field(default_factory=list)
    places: list[tuple[str, Sequence[int]]] = field(default_factory=list)
    home: str = ""

    @property
    def place(self) -> str:
        """File and line of the keyword."""
        return f"{self.file}, line {self.line}"

    def place_of(self, index: int) -> str:
        """File and line of a data line."""
        for file, lines in self.places:
            if index < len(lines):
                return f"{file}, line {lines[index]}"
            index -= len(lines)
        return self.place

    def fail(self, message: str, index: int | None = None) -> NoReturn:
        """Raise a :class:`DeckError` that says where, optionally at a data line."""
        where = self.place if index is None else self.place_of(index)
        raise DeckError(f"{where}: {self.title}: {message}")

    # -- parameters ----------------------------------------------------------------------

    def has(self, *names: str) -> bool:
        """Whether one of some parameters is given."""
        return any(squeeze(name) in self.options for name in names)

    def text(self, *names: str, default: str | None = None) -> str:
        """Value of a parameter as it was written, without quotes.

        Args:
            *names: The parameter and other names of it.
            default: Value where it is not given; None: it must be.

        Raises:
            DeckError: It is missing, or has no value.
        """
        for name in names:
            if squeeze(name) in self.options:
                value = label(self.options[squeeze(name)] or "")
                if not value:
                    self.fail(f"{names[0]} has no value; write {names[0]}=...")
                return value
        if default is None:
            self.fail(f"{names[0]} is missing; write {self.title}, {names[0]}=...")
        return default

    def word(self, name: str, default: str = "") -> str:
        """Value of a parameter squeezed and in capitals; the default where it is not given."""
        return squeeze(self.options.get(squeeze(name)) or default)

    def number(self, name: str, default: float) -> float:
        """Value of a parameter as a number.

        Raises:
            DeckError: It is none.
        """
        if not self.has(name):
            return default
        value = to_float(self.text(name))
        if value is None or not np.isfinite(value):
            self.fail(f"{name}={self.text(name)} is not a number")
        return value

    def choose(self, name: str, known: Sequence[str], default: str) -> str:
        """Value of a parameter that must be one of some words.

        Raises:
            DeckError: It is another; the message lists those known.
        """
        given = self.word(name, default)
        words = {squeeze(word): word for word in known}
        if given not in words:
            meant = did_you_mean(given, words)
            self.fail(
                f"{name}={self.text(name)} is not available{meant}; fxcrack knows {name}="
                f"{', '.join(known)}"
            )
        return words[given]

    # -- data ----------------------------------------------------------------------------

    def rows(self) -> list[Row]:
        """The data lines; lines of commas alone are rows of empty fields."""
        return [Row(fields_of(line) or [""], self, i) for i, line in enumerate(self.lines)]

    def need_rows(self, what: str) -> list[Row]:
        """As :meth:`rows`, at least one.

        Raises:
            DeckError: There is none.
        """
        if not self.lines:
            self.fail(f"there is no data line; give {what}")
        return self.rows()

    def table(self) -> Array:
        """All data lines as numbers, one row a line; NaN where a field is empty or missing.

        Raises:
            DeckError: A field is no number.
        """
        if not self.lines:
            return np.zeros((0, 1))
        lines = [line.rstrip(" ,\t\r") for line in self.lines]
        for attempt in (lines, None):
            if attempt is None:
                attempt = _FORTRAN.sub("e", "\n".join(lines)).split("\n")
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    return np.loadtxt(attempt, delimiter=",", comments=None, ndmin=2)
            except (ValueError, UserWarning):
                continue
        rows = self.rows()
        out = np.full((len(rows), max(len(row) for row in rows)), np.nan)
        for i, row in enumerate(rows):
            for j, text in enumerate(row.fields):
                if text:
                    out[i, j] = row.number(j)
        return out

    def flat(self) -> Array:
        """All numbers of all data lines one after the other, shape (n,).

        Raises:
            DeckError: A field is empty or no number.
        """
        if not self.lines:
            return np.zeros(0)
        text = ",".join([line.rstrip(" ,\t\r") for line in self.lines])
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                found = np.fromstring(text, sep=",")
        except (ValueError, DeprecationWarning):
            found = np.zeros(0)
        if len(found) == text.count(",") + 1:
            return found
        values = [row.number(i) for row in self.rows() for i in range(len(row))]
        return np.array(values)


def fresh_cards(cards: Sequence[Card]) -> list[Card]:
    """Cards with OP=NEW among those of one keyword in a step, which take away what was before.

    All cards must have it, but for those that follow cards without data: they take all away, and
    what follows is added.

    Raises:
        DeckError: Some have it and others do not.
    """
    fresh = [card for card in cards if card.choose("OP", ("MOD", "NEW"), "MOD") == "NEW"]
    others = [card for card in cards if card not in fresh]
    first = list(cards[: len(fresh)]) == fresh and not any(card.lines for card in fresh)
    if fresh and others and not first:
        others[0].fail(
            f"OP=NEW on another {others[0].title} of the step asks for it on all of them"
        )
    return fresh


def whole_numbers(card: Card, values: Array, what: str) -> Ints:
    """Numbers of a card as positive whole ones.

    Raises:
        DeckError: One is not.
    """
    with np.errstate(invalid="ignore"):
        bad = ~((values == np.floor(values)) & (values > 0.0) & (values < 2.0**53))
    if np.any(bad):
        index = int(np.argwhere(bad)[0, 0]) if values.ndim > 1 else None
        card.fail(f"{what} {values[bad][0]:g} is not a positive whole number", index)
    return values.astype(np.int64)
