"""From cards to the model they describe.

Parts, instances and sets; the cards of each material, interaction and step in their places.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import did_you_mean
from fxcrack.deck.cards import Card, DeckError, Row, key, label, to_float, whole_numbers
from fxcrack.deck.elements import RIGID_ELEMENTS, element_type
from fxcrack.deck.generators import (
    axis_rotation,
    copy_elements,
    copy_nodes,
    fill_nodes,
    generate_elements,
    generate_nodes,
)
from fxcrack.deck.left_out import OF_INTERACTIONS, OF_MATERIALS
from fxcrack.deck.markers import marker_nodes, nodes_of_markers, sort_out_markers
from fxcrack.deck.report import Report
from fxcrack.deck.spaces import HOME, Elements, Markers, Numbered, Space, SurfaceDef

_GENERATORS = {
    "NGEN": generate_nodes,
    "NFILL": fill_nodes,
    "NCOPY": copy_nodes,
    "ELGEN": generate_elements,
    "ELCOPY": copy_elements,
}
_MOST = 50_000_000


@dataclass
class Family:
    """A named card with those that belong to it: a material, an interaction or a step."""

    name: str
    card: Card
    cards: list[Card] = field(default_factory=list)

    def first(self, keyword: str) -> Card | None:
        """The card of a keyword, None without; a second one is refused."""
        found = [c for c in self.cards if c.keyword == keyword]
        if len(found) > 1:
            found[1].fail(f"'{self.name}' has two cards of this kind; give one")
        return found[0] if found else None


@dataclass
class Model:
    """What a deck describes.

    Attributes:
        root: What stands outside of parts and instances; the assembly.
        parts: By key.
        instances: By key, in order.
        materials: By key.
        interactions: Properties of contact by key.
        amplitudes: Cards by key.
        cards: Further model data, in order.
        steps: In order.
    """

    root: Space = field(default_factory=lambda: Space(""))
    parts: dict[str, Space] = field(default_factory=dict)
    instances: dict[str, Space] = field(default_factory=dict)
    materials: dict[str, Family] = field(default_factory=dict)
    interactions: dict[str, Family] = field(default_factory=dict)
    amplitudes: dict[str, Card] = field(default_factory=dict)
    cards: list[Card] = field(default_factory=list)
    steps: list[Family] = field(default_factory=list)


def read_model(cards: list[Card], report: Report) -> Model:
    """Put the cards of a deck in their places.

    Args:
        cards: In order.
        report: Refused element types are noted there.

    Raises:
        DeckError: A card stands in the wrong place, or is not complete.
    """
    return _Walk(report).run(cards)


class _Walk:
    """Goes through the cards in order and knows to what they belong."""

    def __init__(self, report: Report) -> None:
        self._report = report
        self._model = Model()
        self._space = self._model.root
        self._family: Family | None = None
        self._step: Family | None = None
        self._early: list[tuple[Space, Card]] = []
        self._system: tuple[Array, Array] | None = None

    def run(self, cards: list[Card]) -> Model:
        for card in cards:
            with self._if_not_refused():
                self._take(card)
        if self._step is not None:
            self._step.card.fail("the step has no *END STEP; the deck may be cut off")
        with self._if_not_refused():
            self._resolve_early()
        if self._space is not self._model.root:
            cards[-1].fail(f"the part or instance '{self._space.name}' never ends")
        sort_out_markers([self._model.root, *self._model.instances.values()], self._report)
        return self._model

    @contextmanager
    def _if_not_refused(self) -> Iterator[None]:
        """Pass on faults unless elements are refused: what was made of those is missing."""
        try:
            yield
        except DeckError:
            if not self._report.refused:
                raise

    def _resolve_early(self) -> None:
        """Make the sets of the present space that name sets defined after them.

        Raises:
            DeckError: A set that they name does not exist.
        """
        waiting = [card for space, card in self._early if space is self._space]
        while waiting:
            self._early = [(space, c) for space, c in self._early if space is not self._space]
            for card in waiting:
                _PLACES[card.keyword](self, card)
            still = [card for space, card in self._early if space is self._space]
            if len(still) == len(waiting):
                made = {key(card.text(card.keyword)) for card in still}
                lost = [c for c in still if key(self._unknown(c)) not in made]
                card = (lost or still)[0]
                name, of_elements = self._unknown(card), self._of_elements(card)
                sets = self._space.elsets if of_elements else self._space.nsets
                what = "element set" if of_elements else "node set"
                card.fail(f"there is no {what} '{name}'{did_you_mean(key(name), sets)}; define it")
            waiting = still

    @staticmethod
    def _of_elements(card: Card) -> bool:
        """Whether a card that makes a set names sets of elements."""
        return card.keyword == "ELSET" or card.has("ELSET")

    def _unknown(self, card: Card) -> str:
        """The first set named by a card that makes a set and not defined yet, empty without."""
        if card.keyword == "NSET" and card.has("ELSET"):
            name = card.text("ELSET")
            return "" if key(name) in self._space.elsets else name
        if card.has("GENERATE") or not any(c.isalpha() or c == '"' for c in "".join(card.lines)):
            return ""
        place = key(card.text("INSTANCE")) if card.has("INSTANCE") else ""
        space = self._model.instances.get(place, self._space)
        kind = "elsets" if self._of_elements(card) else "nsets"
        for row in card.rows():
            for i, text in enumerate(row.fields):
                if not text or text.isdigit() or to_float(key(row.text(i))) is not None:
                    continue
                first, _, rest = key(row.text(i)).rpartition(".")
                inside = self._model.instances.get(first)
                known = inside is not None and (rest.isdigit() or rest in getattr(inside, kind))
                if not known and key(row.text(i)) not in getattr(space, kind):
                    return row.text(i)
        return ""

    def _take(self, card: Card) -> None:
        word = card.keyword
        if self._step is not None and word not in ("ENDSTEP", "STEP"):
            self._step.cards.append(card)
            return
        if word in OF_MATERIALS + OF_INTERACTIONS:
            wanted = "materials" if word in OF_MATERIALS else "interactions"
            if self._family is None or self._family not in getattr(self._model, wanted).values():
                card.fail(
                    "there is no *MATERIAL before it"
                    if wanted == "materials"
                    else "there is no *SURFACE INTERACTION before it"
                )
            self._family.cards.append(card)
            return
        if word in _PLACES:
            _PLACES[word](self, card)
        elif word in _GENERATORS:
            _GENERATORS[word](card, self._space)
        elif self._space is self._model.root:
            self._model.cards.append(card)
        else:
            self._space.others.append(card)

    # -- parts and instances -------------------------------------------------------------

    def _part(self, card: Card) -> None:
        name = card.text("NAME")
        if self._space is not self._model.root or key(name) in self._model.parts:
            card.fail(f"part '{name}' begins inside another, or exists already")
        self._space = self._model.parts[key(name)] = Space(name)
        self._system = None

    def _instance(self, card: Card) -> None:
        name, part = card.text("NAME"), card.text("PART")
        if self._space is not self._model.root or key(name) in self._model.instances:
            card.fail(f"instance '{name}' begins inside a part, or exists already")
        if key(part) not in self._model.parts:
            meant = did_you_mean(key(part), self._model.parts)
            card.fail(f"there is no part '{part}'{meant}; define it before its instance")
        space = self._model.parts[key(part)].instance(name)
        rows = card.rows()
        if rows and len(rows[0]) > 3:
            rows[0].fail(
                "the first line is the translation, three numbers; write 0., 0., 0. before the "
                "line of the rotation"
            )
        if rows:
            space.shift = np.array([rows[0].number(i, 0.0) for i in range(3)])
        if len(rows) > 1:
            a = np.array([rows[1].number(i, 0.0) for i in range(3)])
            b = np.array([rows[1].number(i, 0.0) for i in range(3, 6)])
            if not (b - a).any():
                rows[1].fail("the two points of the axis of rotation are the same")
            # the rotation follows the translation
            space.rotation = axis_rotation(a, b, rows[1].number(6, 0.0))
            space.shift = a + space.rotation @ (space.shift - a)
        self._space = self._model.instances[key(name)] = space

    def _end_space(self, card: Card) -> None:
        if self._space is self._model.root:
            card.fail("it ends nothing; its beginning is missing")
        self._resolve_early()
        self._space, self._system = self._model.root, None

    def _nothing(self, card: Card) -> None:
        """Words that only bracket others."""

    # -- nodes and elements --------------------------------------------------------------

    def _node(self, card: Card) -> None:
        table = card.table()
        if not len(table):
            if card.lines:
                card.fail("the data lines hold no numbers")
            return
        x = np.zeros((len(table), 3))
        n = min(table.shape[1], 4) - 1
        given = table[:, 1 : n + 1]
        x[:, :n] = np.where(np.isnan(given), 0.0, given)
        if not np.all(np.isfinite(x)):
            card.fail("a coordinate is not finite", int(np.argwhere(~np.isfinite(x))[0, 0]))
        system = card.word("SYSTEM", "R")
        if system == "C":
            angle = np.radians(x[:, 1])
            x[:, 0], x[:, 1] = x[:, 0] * np.cos(angle), x[:, 0] * np.sin(angle)
        elif system == "S":  # distance, longitude from x, latitude from the plane of x and y
            distance, longitude, latitude = x[:, 0].copy(), *np.radians(x[:, 1:]).T
            x[:, 0] = distance * np.cos(latitude) * np.cos(longitude)
            x[:, 1] = distance * np.cos(latitude) * np.sin(longitude)
            x[:, 2] = distance * np.sin(latitude)
        elif system != "R":
            card.fail(f"SYSTEM={system} is not available; R, C (cylindrical) and S (spherical) are")
        if self._system is not None:
            origin, turn = self._system
            x = origin + x @ turn
        labels = whole_numbers(card, table[:, 0], "node number")
        self._space.nodes.add(labels, x)
        if card.has("NSET"):
            self._space.add_to_set(card, "nsets", card.text("NSET"), labels)

    def _local_system(self, card: Card) -> None:
        """Axes of the nodes that follow: a origin, b on axis 1, c in the plane of axes 1 and 2."""
        values = [row.number(i, 0.0) for row in card.rows()[:2] for i in range(6)][:9]
        if not card.lines:
            self._system = None
            return
        if not any(card.rows()[0].text(i) for i in (3, 4, 5)):
            self._system = np.array(values[:3]), np.eye(3)
            return
        a, b, c = (np.array(values[i : i + 3] or [0.0] * 3) for i in (0, 3, 6))
        if len(card.lines) < 2 or not any(values[6:]):  # axis 3 is then z
            third = np.array([0.0, 0.0, 1.0])
        else:
            third = np.cross(b - a, c - a)
        one = b - a
        if not np.linalg.norm(np.cross(third, one)) > 1e-10 * np.linalg.norm(one):
            card.fail("its points do not give axes; give the origin, a point on axis 1 and another")
        one, third = one / np.linalg.norm(one), third / np.linalg.norm(third)
        self._system = a, np.array([one, np.cross(third, one), third])

    def _element(self, card: Card) -> None:
        name = card.text("TYPE").upper()
        if name in RIGID_ELEMENTS:
            table = self._element_table(card, name, RIGID_ELEMENTS[name])
            rigid = self._space.rigid.setdefault(name, Numbered(RIGID_ELEMENTS[name]))
            rigid.add(table[:, 0], table[:, 1:])
            return
        kind = element_type(name)
        if isinstance(kind, str):
            line = f"{card.place}: element type {name} is refused: {kind}"
            n_nodes = marker_nodes(name)
            if n_nodes is not None:  # a body only where a section names it
                table = self._element_table(card, name, n_nodes)
                marks = Markers(card, line, Numbered(n_nodes))
                marks = self._space.markers.setdefault(name, marks)
                marks.table.add(table[:, 0], table[:, 1:])
                return
            self._report.refused.append(line)
            if card.has("ELSET"):
                self._space.add_to_set(
                    card, "elsets", card.text("ELSET"), np.zeros(0, dtype=np.int64)
                )
            return
        for note in kind.notes:
            self._report.replace(f"element type {name}: {note}", card)
        table = self._element_table(card, name, kind.n_nodes)
        block = self._space.elements.setdefault(name, Elements(kind, Numbered(kind.n_nodes), card))
        block.table.add(table[:, 0], table[:, 1:])

    def _element_table(self, card: Card, name: str, n_nodes: int) -> Ints:
        """Numbers and nodes of elements, shape (n, 1 + n_nodes); they come into their set."""
        values, width = card.flat(), n_nodes + 1
        if len(values) % width:
            card.fail(
                f"{len(values)} numbers are no whole number of {name} elements, which have a "
                f"number and {n_nodes} nodes each"
            )
        table = whole_numbers(card, values, "element or node number").reshape(-1, width)
        if card.has("ELSET"):
            self._space.add_to_set(card, "elsets", card.text("ELSET"), table[:, 0])
        return table

    # -- sets and surfaces ---------------------------------------------------------------

    def _nset(self, card: Card) -> None:
        if self._unknown(card):
            self._early.append((self._space, card))
        elif card.has("ELSET"):
            self._nodes_of_elements(card)
        else:
            self._set(card, "nsets", card.text("NSET"))

    def _elset(self, card: Card) -> None:
        if self._unknown(card):
            self._early.append((self._space, card))
        else:
            self._set(card, "elsets", card.text("ELSET"))

    def _nodes_of_elements(self, card: Card) -> None:
        name, elset = card.text("NSET"), card.text("ELSET")
        for place, labels in self._space.elsets[key(elset)].members.items():
            space = self._model.instances[place] if place else self._space
            for block in space.elements.values():
                at = block.table.find(labels)
                nodes = np.unique(block.table.rows[at[at >= 0]]).astype(np.int64)
                self._space.add_to_set(card, "nsets", name, nodes, space=place)
            nodes = nodes_of_markers(space, labels)
            self._space.add_to_set(card, "nsets", name, nodes, space=place)

    def _set(self, card: Card, kind: str, name: str) -> None:
        place = HOME
        if card.has("INSTANCE"):
            place = key(card.text("INSTANCE"))
            if place not in self._model.instances:
                meant = did_you_mean(place, self._model.instances)
                card.fail(f"there is no instance '{card.text('INSTANCE')}'{meant}")
        space = self._model.instances[place] if place else self._space
        self._space.add_to_set(card, kind, name, np.zeros(0, dtype=np.int64), space=place)
        if card.has("GENERATE"):
            for row in card.rows():
                self._space.add_to_set(card, kind, name, _sequence(row), space=place)
            return
        plain = None if any(c.isalpha() or c == '"' for c in "".join(card.lines)) else card.table()
        if plain is not None:
            given = plain[~np.isnan(plain)]
            if np.any(given != np.floor(given)) or np.any(np.abs(given) > 2.0**53):
                card.fail("a member is no whole number")
            self._space.add_to_set(card, kind, name, given.astype(np.int64), space=place)
            return
        numbers: list[int] = []
        for row in card.rows():
            for i, text in enumerate(row.fields):
                if not text:
                    continue
                if text.isdigit():
                    numbers.append(row.whole(i))
                    continue
                self._add_named(card, row, i, kind, name, space, place)
        if numbers:
            labels = np.array(numbers, dtype=np.int64)
            self._space.add_to_set(card, kind, name, labels, space=place)

    def _add_named(
        self, card: Card, row: Row, i: int, kind: str, name: str, space: Space, place: str
    ) -> None:
        """Append another set, or a member of an instance, which a field names."""
        text = key(row.text(i))
        value = to_float(text)
        if value is not None:
            labels = np.array([row.whole(i)], dtype=np.int64)
            self._space.add_to_set(card, kind, name, labels, space=place)
            return
        sets = getattr(space, kind)
        if text in sets:
            for other, labels in dict(sets[text].members).items():
                self._space.add_to_set(card, kind, name, labels, space=place or other)
            return
        first, _, rest = text.rpartition(".")
        inside = self._model.instances.get(first)
        if inside is not None and rest.isdigit():
            labels = np.array([int(rest)], dtype=np.int64)
            self._space.add_to_set(card, kind, name, labels, space=first)
        elif inside is not None and rest in getattr(inside, kind):
            labels = getattr(inside, kind)[rest].home
            self._space.add_to_set(card, kind, name, labels, space=first)
        else:
            meant = did_you_mean(text, sets)
            row.fail(f"there is no set '{label(row.text(i))}' yet{meant}; define it before")

    def _surface(self, card: Card) -> None:
        name = card.text("NAME")
        if key(name) in self._space.surfaces:
            log.warn("%s: surface '%s' is defined again; the last counts", card.place, name)
        self._space.surfaces[key(name)] = SurfaceDef(name, card)

    # -- properties ----------------------------------------------------------------------

    def _section(self, card: Card) -> None:
        if card.keyword == "SHELLGENERALSECTION":
            if not card.has("MATERIAL", "COMPOSITE"):
                card.fail(
                    "stiffnesses of the section itself are not available; give MATERIAL with the "
                    "thickness, or COMPOSITE with the plies"
                )
            card.keyword = "SHELLSECTION"
        self._space.sections.append(card)

    def _orientation(self, card: Card) -> None:
        self._space.orientations[key(card.text("NAME"))] = card

    def _distribution(self, card: Card) -> None:
        self._space.distributions[key(card.text("NAME"))] = card

    def _material(self, card: Card) -> None:
        self._named(card, self._model.materials)

    def _interaction(self, card: Card) -> None:
        self._named(card, self._model.interactions)

    def _named(self, card: Card, known: dict[str, Family]) -> None:
        name = card.text("NAME")
        if key(name) in known:
            card.fail(f"'{name}' is defined twice, first at {known[key(name)].card.place}")
        self._family = known[key(name)] = Family(name, card)

    def _amplitude(self, card: Card) -> None:
        self._model.amplitudes[key(card.text("NAME"))] = card

    # -- steps ---------------------------------------------------------------------------

    def _begin_step(self, card: Card) -> None:
        if self._step is not None:
            self._step.card.fail("the step has no *END STEP before the next one")
        number = len(self._model.steps) + 1
        self._step = Family(card.text("NAME", default=f"step {number}"), card)
        self._model.steps.append(self._step)

    def _end_step(self, card: Card) -> None:
        if self._step is None:
            card.fail("it ends no step; *STEP is missing")
        self._step = None


_PLACES = {
    "PART": _Walk._part,
    "ENDPART": _Walk._end_space,
    "INSTANCE": _Walk._instance,
    "ENDINSTANCE": _Walk._end_space,
    "ASSEMBLY": _Walk._nothing,
    "ENDASSEMBLY": _Walk._nothing,
    "NODE": _Walk._node,
    "SYSTEM": _Walk._local_system,
    "ELEMENT": _Walk._element,
    "NSET": _Walk._nset,
    "ELSET": _Walk._elset,
    "SURFACE": _Walk._surface,
    "SOLIDSECTION": _Walk._section,
    "SHELLSECTION": _Walk._section,
    "SHELLGENERALSECTION": _Walk._section,
    "ORIENTATION": _Walk._orientation,
    "DISTRIBUTION": _Walk._distribution,
    "DISTRIBUTIONTABLE": _Walk._nothing,
    "MATERIAL": _Walk._material,
    "SURFACEINTERACTION": _Walk._interaction,
    "AMPLITUDE": _Walk._amplitude,
    "STEP": _Walk._begin_step,
    "ENDSTEP": _Walk._end_step,
}


def _sequence(row: Row) -> Ints:
    """Numbers of a GENERATE line: first, last, increment."""
    first, last, step = row.whole(0), row.whole(1), row.whole(2, 1)
    if step == 0 or (last - first) * step < 0 or abs((last - first) // step) > _MOST:
        row.fail(f"increment {step} does not lead from {first} to {last}")
    return np.arange(first, last + (1 if step > 0 else -1), step, dtype=np.int64)
