"""From the text of a deck to its cards.

Files are read whole and cut at the lines that begin with one star; what is between two of them
stays a slice of lines until a reader asks for its numbers, so that large blocks cost little.
Continued keyword lines, comments, included files and parameters are dealt with here.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

from fxcrack.deck.cards import Card, DeckError, fields_of, label, squeeze
from fxcrack.deck.keywords import KEYWORDS, full_name
from fxcrack.deck.parameters import evaluate_parameters, substitute, uses_parameters

_NESTED = 20
"""How deep files may include each other."""


def read_cards(path: Path) -> list[Card]:
    """The cards of a deck and of the files it includes, in order.

    Args:
        path: The deck.

    Raises:
        DeckError: A file is missing, includes itself or is no text, data stand before the first
            keyword, or a parameter has no value.
    """
    cards = _Reader(path).read(path, None, ())
    if not cards:
        raise DeckError(f"'{path}' holds no keyword; a deck has lines such as *NODE")
    _put_parameters(cards)
    return [card for card in cards if card.keyword != "PARAMETER"]


class _Reader:
    """Reads a deck with the files it includes.

    Args:
        top: The deck; names of other files are relative to its folder or to that of the file that
            names them.
    """

    def __init__(self, top: Path) -> None:
        self._top = top

    def read(self, path: Path, before: Card | None, above: tuple[Path, ...]) -> list[Card]:
        """Cards of a file.

        Args:
            path: The file.
            before: Card to which data lines before the first keyword belong.
            above: Files that include this one.
        """
        lines = text_of(path).split("\n")
        name = path.name
        cards: list[Card] = []
        starred = [i for i, line in enumerate(lines) if "*" in line]
        starred = [i for i in starred if lines[i].lstrip()[:1] == "*"]
        comments = {i for i in starred if lines[i].lstrip()[:2] == "**"}
        keywords = [i for i in starred if i not in comments]
        first = keywords[0] if keywords else len(lines)
        self._give_data(before, name, lines, range(first), comments)
        for i, end in pairwise([*keywords, len(lines)]):
            card, start = _keyword(name, lines, i, end, comments)
            if card.keyword == "INCLUDE":
                found = self._file(card, path)
                if found in above or found == path or len(above) > _NESTED:
                    card.fail(f"file '{found.name}' includes itself")
                inner = self.read(found, cards[-1] if cards else before, (*above, path))
                cards += inner
                last = cards[-1] if cards else before
                self._give_data(last, name, lines, range(start, end), comments)
                continue
            cards.append(card)
            if card.has("INPUT"):
                found = self._file(card, path)
                extra = text_of(found).split("\n")
                stars = {j for j, line in enumerate(extra) if line.lstrip()[:2] == "**"}
                self._give_data(card, found.name, extra, range(len(extra)), stars)
            self._give_data(card, name, lines, range(start, end), comments)
        return cards

    def _give_data(
        self, card: Card | None, name: str, lines: list[str], chosen: range, comments: set[int]
    ) -> None:
        """Append lines to a card as its data."""
        if not comments or not any(i in comments for i in chosen):
            kept = [line for line in lines[chosen.start : chosen.stop] if not line.isspace()]
            if len(kept) == len(chosen) and "" not in kept:
                numbers: range | list[int] = range(chosen.start + 1, chosen.stop + 1)
                self._append(card, name, kept, numbers)
                return
        numbers = [i + 1 for i in chosen if i not in comments and lines[i].strip()]
        self._append(card, name, [lines[i - 1] for i in numbers], numbers)

    def _append(
        self, card: Card | None, name: str, lines: list[str], numbers: range | list[int]
    ) -> None:
        if not lines:
            return
        if card is None:
            raise DeckError(
                f"{name}, line {numbers[0]}: '{lines[0].strip()[:40]}' stands before the first "
                "keyword; a deck begins with a line such as *HEADING"
            )
        card.lines = lines if not card.lines else card.lines + lines
        card.places.append((name, numbers))

    def _file(self, card: Card, here: Path) -> Path:
        """The file that ``INPUT`` of a card names; its name may differ in case."""
        if card.has("PASSWORD"):
            card.fail("encrypted files cannot be read; give the text of the file")
        given = Path(card.text("INPUT"))
        folders = [here.parent, self._top.parent]
        for folder in folders:
            path = folder / given
            try:
                if path.is_file():
                    return path
                for other in path.parent.iterdir() if path.parent.is_dir() else ():
                    if other.name.lower() == given.name.lower() and other.is_file():
                        return other
            except (OSError, ValueError):
                break
        return card.fail(
            f"there is no file '{given}' (looked in {folders[0].resolve()}); put it there, or give "
            "its path"
        )


def text_of(path: Path) -> str:
    """Text of a file of any usual encoding, lines ended by newlines.

    Raises:
        DeckError: It cannot be read.
    """
    try:
        raw = path.read_bytes()
    except (OSError, ValueError) as error:
        raise DeckError(f"cannot read '{path}': {error}") from error
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    if "\0" in text:
        raise DeckError(f"'{path}' is not a text file; give the deck, not a result file")
    return text


def _keyword(name: str, lines: list[str], i: int, end: int, comments: set[int]) -> tuple[Card, int]:
    """The card that begins at line ``i``, and the first line of its data.

    A comma at the end of the keyword line is a continuation only if the next line holds parameters;
    else it is a stray comma before data.
    """
    text, start = lines[i].strip(), i + 1
    while text.endswith(","):
        j = start
        while j < end and (j in comments or not lines[j].strip()):
            j += 1
        if j >= end or not _holds_parameters(text, lines[j]):
            break
        text, start = text + lines[j].strip(), j + 1
    head, *parts = fields_of(text)
    keyword = squeeze(head[1:])
    card = Card(keyword, "*" + " ".join(head[1:].split()).upper(), {}, name, i + 1)
    for part in parts:
        option, equals, value = part.partition("=")
        if not option.strip():
            if part:
                card.fail(f"'{part}' has no parameter before the equals sign")
            continue
        known = full_name(keyword, squeeze(label(option)))
        card.options[known] = value.strip() if equals else None
    return card, start


def _holds_parameters(text: str, line: str) -> bool:
    """Whether a line continues a keyword line: all it names are parameters of the keyword."""
    keyword = squeeze(fields_of(text)[0][1:])
    parts = [part for part in fields_of(line) if part]
    if not parts or not all(part.lstrip('"')[:1].isalpha() for part in parts):
        return False
    known = KEYWORDS[keyword].parameters if keyword in KEYWORDS else frozenset()
    names = [full_name(keyword, squeeze(part.partition("=")[0])) for part in parts]
    return all(n in known or "=" in part for n, part in zip(names, parts, strict=True))


def _put_parameters(cards: list[Card]) -> None:
    """Replace every ``<name>`` by the value of the parameter."""
    values = evaluate_parameters([card for card in cards if card.keyword == "PARAMETER"])
    for card in cards:
        if card.keyword == "PARAMETER":
            if card.options:
                card.fail("tables of dependent parameters are not available; give expressions")
            continue
        for option, value in card.options.items():
            if value and uses_parameters(value):
                card.options[option] = substitute(value, values, card.fail)
        for i in [i for i, line in enumerate(card.lines) if "<" in line]:
            card.lines[i] = substitute(card.lines[i], values, _at(card, i))


def _at(card: Card, i: int) -> Callable[[str], object]:
    """Fails at a data line of a card."""
    return lambda message: card.fail(message, i)
