"""What was read of a deck, what was replaced, what has no effect, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass, field

from fxcrack.base.errors import did_you_mean
from fxcrack.deck.cards import Card, DeckError
from fxcrack.deck.keywords import KEYWORDS, TITLES, keyword_of


@dataclass
class Report:
    """Account of a deck.

    Attributes:
        name: Name of the deck.
        read: What the scene consists of, one line each.
        replaced: What is computed in another way than the deck says, one line each.
        doubts: Where the deck's own choice costs accuracy, one line each.
        ignored: Output requests and the like, by their titles with how often they occur.
        refused: What fxcrack has no word for: file, line, card, and what would help.
    """

    name: str
    read: list[str] = field(default_factory=list)
    replaced: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    ignored: dict[str, int] = field(default_factory=dict)
    refused: list[str] = field(default_factory=list)

    def replace(self, text: str, card: Card | None = None) -> None:
        """Note a replacement once."""
        line = text if card is None else f"{card.place}: {card.title}: {text}"
        if line not in self.replaced:
            self.replaced.append(line)

    def doubt(self, text: str, card: Card) -> None:
        """Note what costs accuracy."""
        self.doubts.append(f"{card.place}: {card.title}: {text}")

    def leave(self, text: str) -> None:
        """Note something that plays no part in what is computed."""
        self.ignored[text] = self.ignored.get(text, 0) + 1

    def screen(self, cards: list[Card]) -> None:
        """Note every card that is ignored, left out or refused because of its words alone."""
        for card in cards:
            known = keyword_of(card.keyword)
            if known is None:
                near = did_you_mean(card.keyword, KEYWORDS)
                if near:
                    close = near.split("'")[1]
                    near = f" (did you mean *{TITLES.get(close, close)}?)"
                self.refused.append(
                    f"{card.place}: {card.title} is not known to fxcrack{near}; if it only asks "
                    "for output, take it out of the deck"
                )
            elif card.keyword == "RESTART":
                if card.has("READ"):
                    self.refused.append(
                        f"{card.place}: {card.title}, READ is refused: states of other analyses "
                        "are not read; give the whole analysis in this deck"
                    )
                self.ignored[card.title] = self.ignored.get(card.title, 0) + 1
            elif known.kind == "output":
                self.ignored[card.title] = self.ignored.get(card.title, 0) + 1
            elif known.kind == "numerics":
                self.replace("a control of the other program's solution method; left out", card)
            elif known.kind == "replaced":
                self.replace(known.help, card)
            elif known.kind == "refused":
                self.refused.append(f"{card.place}: {card.title} is refused: {known.help}")
            else:
                for name in card.options:
                    if name not in known.parameters and name not in known.harmless:
                        near = did_you_mean(name, known.parameters)
                        self.refused.append(
                            f"{card.place}: {card.title}: the parameter {name} is not "
                            f"available{near}; known: {', '.join(sorted(known.parameters)) or '-'}"
                        )

    def answer(self, card: Card) -> None:
        """Note that an output request is answered, so that it is not without effect."""
        left = self.ignored.pop(card.title, 0) - 1
        if left > 0:
            self.ignored[card.title] = left

    def check(self) -> None:
        """Stop if something is refused.

        Raises:
            DeckError: Something is; with the first place, and how many more there are.
        """
        if self.refused:
            more = len(self.refused) - 1
            rest = f" (and {more} more: 'fxcrack run DECK --check' lists them)" if more else ""
            raise DeckError(self.refused[0] + rest)

    def __str__(self) -> str:
        """The whole account as text."""
        lines = [f"deck {self.name}"]
        for title, entries in (
            ("read", self.read),
            ("replaced", self.replaced),
            ("accuracy", self.doubts),
            ("without effect", [f"{k} ({n} times)" for k, n in self.ignored.items()]),
            ("refused", self.refused),
        ):
            if entries:
                lines += [f"{title}:", *(f"  {entry}" for entry in entries)]
        return "\n".join(lines) + "\n"
