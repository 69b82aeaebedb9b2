"""General contact of explicit dynamics: pairs, their bonded parts, and when these fail.

``*CONTACT``, ``*CONTACT INCLUSIONS``, ``*CONTACT PROPERTY ASSIGNMENT``, ``*CONTACT FORMULATION``,
``*CONTACT CLEARANCE`` with its ``ASSIGNMENT``, and ``*COHESIVE BEHAVIOR`` with ``*FRACTURE
CRITERION`` in the surface interaction. Contact is computed for the pairs of surfaces that these
cards name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Ints
from fxcrack.base.errors import InputError, did_you_mean
from fxcrack.deck.cards import Card, DeckError, Row, key, label
from fxcrack.deck.everywhere import Everywhere
from fxcrack.deck.flat import Flat
from fxcrack.deck.fracture import NodalRates, read_criterion
from fxcrack.deck.groups import Groups
from fxcrack.deck.interactions import friction, interaction, note_thickness
from fxcrack.deck.model import Family
from fxcrack.deck.report import Report
from fxcrack.interface.definition import Interface
from fxcrack.steps.debond import Debond

GENERAL = (
    *("CONTACT", "CONTACTINCLUSIONS", "CONTACTPROPERTYASSIGNMENT", "CONTACTFORMULATION"),
    *("CONTACTCLEARANCE", "CONTACTCLEARANCEASSIGNMENT"),
)
"""Keywords of general contact."""
_NEVER = (
    "general contact belongs to explicit dynamics; name the surfaces that meet by *CONTACT PAIR "
    "and bonded ones by *INITIAL CONDITIONS, TYPE=CONTACT"
)


@dataclass(eq=False)
class GeneralPair:
    """A pair of surfaces of general contact.

    Attributes:
        row: The line that named it first.
        slave: Name of the slave surface.
        master: Name of the master surface.
        clearance: Its ``*CONTACT CLEARANCE``, None without.
        property: Name of its surface interaction, None without.
        sides_known: Whether a card says which surface is the slave.
    """

    row: Row
    slave: str
    master: str
    clearance: Card | None = None
    property: str | None = None
    sides_known: bool = False


class GeneralContact:
    """The pairs of general contact.

    Args:
        cards: Model data and those of the first step.
        flat: The model.
        groups: Takes their surfaces.
        report: Takes what is replaced.
        explicit: Whether the steps are explicit.

    Attributes:
        pairs: The pairs.
        slave_nodes: Nodes of the slave surfaces that may come apart by titles, once they are built.

    Raises:
        DeckError: A card cannot be read, or the steps are not explicit.
    """

    def __init__(
        self, cards: Sequence[Card], flat: Flat, groups: Groups, report: Report, *, explicit: bool
    ) -> None:
        self._flat, self._groups, self._report = flat, groups, report
        self.pairs: list[GeneralPair] = []
        self.slave_nodes: dict[str, Ints] = {}
        self._clearances: dict[str, Card] = {}
        self._everywhere: Card | None = None
        self._default: str | None = None
        chosen = [card for card in cards if card.keyword in GENERAL]
        for card in chosen:
            if card.has("SEARCH NSET") and card.has("SEARCH ABOVE", "SEARCH BELOW"):
                card.fail("SEARCH NSET excludes SEARCH ABOVE and SEARCH BELOW; give one of them")
            if not explicit:
                card.fail(_NEVER)
        for card in chosen:
            if card.keyword == "CONTACTCLEARANCE":
                self._clearance(card)
        readers = {
            "CONTACTCLEARANCEASSIGNMENT": self._assign_clearance,
            "CONTACTFORMULATION": self._formulation,
            "CONTACTINCLUSIONS": self._inclusions,
            "CONTACTPROPERTYASSIGNMENT": self._assign_property,
        }
        for keyword, reader in readers.items():
            for card in chosen:
                if card.keyword == keyword:
                    reader(card)
        if self._everywhere is not None:
            if not self.pairs:
                self._everywhere.fail(
                    "contact of all faces with all others is not available; name the pairs of "
                    "surfaces that may meet"
                )
            names = ", ".join(f"'{p.slave}' on '{p.master}'" for p in self.pairs)
            report.replace(
                "contact is computed for the pairs that the deck names and for no other faces: "
                + names,
                self._everywhere,
            )

    # -- cards ---------------------------------------------------------------------------

    def _clearance(self, card: Card) -> None:
        name = card.text("NAME")
        if card.lines:
            card.fail("it has no data lines; clearances by node are not available")
        card.choose("ADJUST", ("YES", "NO"), "YES")
        if card.number("CLEARANCE", 0.0) != 0.0:
            card.fail("a clearance other than 0 is not available; move the nodes apart instead")
        self._clearances[key(name)] = card

    def _pair(self, row: Row, *, sides_known: bool) -> GeneralPair:
        """The pair of a line, made if it is new."""
        slave, master = label(row.text(0)), label(row.text(1))
        if not slave or not master or key(slave) == key(master):
            row.fail("name two surfaces; contact of a surface with itself is not available")
        for pair in self.pairs:
            names = key(pair.slave), key(pair.master)
            if names == (key(slave), key(master)):
                pair.sides_known |= sides_known
                return pair
            if names == (key(master), key(slave)):
                if sides_known and pair.sides_known:
                    row.fail(f"'{slave}' is the master surface of this pair in another card")
                if sides_known:
                    pair.slave, pair.master, pair.sides_known = slave, master, True
                return pair
        pair = GeneralPair(row, slave, master, sides_known=sides_known)
        self.pairs.append(pair)
        return pair

    def _assign_clearance(self, card: Card) -> None:
        for row in card.need_rows("slave surface, master surface, name of the clearance"):
            name = label(row.text(2))
            if key(name) not in self._clearances:
                meant = did_you_mean(key(name), self._clearances)
                row.fail(f"there is no *CONTACT CLEARANCE, NAME={name}{meant}; define it")
            side = row.text(3).upper()
            if side not in ("", "MASTER", "SLAVE", "MAIN", "SECONDARY"):
                row.fail(f"'{row.text(3)}' is neither MASTER (MAIN) nor SLAVE (SECONDARY)")
            if side in ("MASTER", "MAIN"):  # what the first surface is
                row = Row([row.text(1), row.text(0), *row.fields[2:]], card, row.index)
            pair = self._pair(row, sides_known=True)
            if pair.clearance is not None:
                row.fail("the pair has a clearance already; give one")
            pair.clearance = self._clearances[key(name)]

    def _formulation(self, card: Card) -> None:
        card.choose("TYPE", ("PURE MASTER-SLAVE", "PURE MAIN-SECONDARY"), card.text("TYPE"))
        for row in card.need_rows("surface, surface, SLAVE or MASTER"):
            side = row.text(2).upper() or "SLAVE"
            if side not in ("MASTER", "SLAVE", "MAIN", "SECONDARY"):
                row.fail(f"'{row.text(2)}' is neither MASTER (MAIN) nor SLAVE (SECONDARY)")
            if side in ("MASTER", "MAIN"):
                row = Row([row.text(1), row.text(0)], card, row.index)
            self._pair(row, sides_known=True)

    def _inclusions(self, card: Card) -> None:
        if card.has("ALL EXTERIOR", "ALL ELEMENT BASED"):
            self._everywhere = card
            return
        for row in card.need_rows("two surfaces"):
            self._pair(row, sides_known=False)

    def _assign_property(self, card: Card) -> None:
        for row in card.need_rows("surface, surface, name of the interaction"):
            name = label(row.text(2))
            if not name:
                row.fail("the name of the interaction is missing in the third field")
            if not row.text(0) and not row.text(1):
                self._default = name
                continue
            self._pair(row, sides_known=False).property = name

    # -- the scene -----------------------------------------------------------------------

    def build(
        self, interactions: Mapping[str, Family], nodal: NodalRates | None, *, finite: bool
    ) -> tuple[list[Debond], list[Interface]]:
        """Debonds and other interfaces.

        Args:
            interactions: Properties of contact by key.
            nodal: Critical rates at nodes, where the deck has any.
            finite: Whether bodies turn far.

        Raises:
            DeckError: A property is not available, or contradicts another.
        """
        debonds: list[Debond] = []
        bonds: list[Interface] = []
        titles: set[str] = set()
        for pair in self.pairs:
            name = pair.property or self._default
            family = None
            if name is not None:
                family = interaction(pair.row, name, interactions, explicit=True)
                note_thickness(family, self._flat, self._report)
            criterion = None if family is None else family.first("FRACTURECRITERION")
            title = (
                pair.slave if key(pair.slave) not in titles else f"{pair.slave} on {pair.master}"
            )
            titles.add(key(title))
            interface = self._interface(pair, family, title, may_fail=criterion is not None)
            if criterion is None or pair.clearance is None:
                bonds.append(interface)
                continue
            debonds.append(self._debond(interface, pair, criterion, nodal, finite=finite))
        return debonds, bonds

    def _interface(
        self, pair: GeneralPair, family: Family | None, title: str, *, may_fail: bool
    ) -> Interface:
        flat, card = self._flat, pair.row.card
        facets = [
            self._groups.surface(card, name, pair.row.index) for name in (pair.slave, pair.master)
        ]
        bonded: object = Everywhere(False)
        tolerance = None
        clearance = pair.clearance
        if clearance is not None:
            tolerance = max(clearance.number(f"SEARCH {side}", 0.0) for side in ("ABOVE", "BELOW"))
        cohesive = None if family is None else family.first("COHESIVEBEHAVIOR")
        if clearance is not None and clearance.has("SEARCH NSET"):
            name = clearance.text("SEARCH NSET")
            found = flat.nodes(clearance, name)
            if may_fail:
                bonded = self._groups.support(clearance, name, found, words="nodes")
            else:
                log.warn(
                    "%s: the nodes of '%s' have no *COHESIVE BEHAVIOR with *FRACTURE CRITERION in "
                    "their surface interaction: they are not bonded and separate without stress",
                    clearance.place,
                    name,
                )
        elif may_fail:
            assert cohesive is not None
            (clearance or cohesive).fail(
                f"no bonded nodes are named for '{pair.slave}' on '{pair.master}', so there is no "
                "tip and nothing fails; name them by *CONTACT CLEARANCE, SEARCH NSET and its "
                "ASSIGNMENT"
            )
        if cohesive is not None:
            self._bond_stiffness(cohesive, may_fail=may_fail)
        return Interface(
            facets[0],
            facets[1],
            bonded=bonded,  # type: ignore[arg-type]
            contact=True,
            friction=None if family is None else friction(family),
            tolerance=tolerance or None,
            name=title,
        )

    def _bond_stiffness(self, card: Card, *, may_fail: bool) -> None:
        if not may_fail:
            card.fail(
                "elastic bonds that never fail are not available; add *FRACTURE CRITERION, "
                "TYPE=VCCT directly after it, or join the bodies by *TIE"
            )
        if card.number("DEPENDENCIES", 0.0):
            card.fail("DEPENDENCIES on field variables are not available")
        card.choose("TYPE", ("UNCOUPLED", "COUPLED"), "UNCOUPLED")
        kinds = ("ORIGINAL CONTACTS", "CURRENT CONTACTS", "SPECIFIED CONTACTS")
        card.choose("ELIGIBILITY", kinds, "ORIGINAL CONTACTS")
        if card.word("REPEATEDCONTACTS") not in ("", "NO"):
            card.fail("bonds that failed do not heal here; leave REPEATED CONTACTS out")
        stiffness = "the stiffness of the bonds is left out: bonded" if card.lines else "bonded"
        self._report.replace(
            f"{stiffness} nodes move together exactly, without compliance, and a bond that fails "
            "is released progressively, so that just its toughness is spent",
            card,
        )

    def _debond(
        self,
        interface: Interface,
        pair: GeneralPair,
        card: Card,
        nodal: NodalRates | None,
        *,
        finite: bool,
    ) -> Debond:
        kind = card.word("TYPE")
        if kind != "VCCT":
            card.fail(f"TYPE={card.text('TYPE')} is not possible in explicit dynamics; VCCT is")
        if card.has("UNSTABLE GROWTH TOLERANCE", "VISCOSITY"):
            card.fail("UNSTABLE GROWTH TOLERANCE and VISCOSITY belong to quasi-static steps")
        slave = np.unique(self._flat.surface(pair.row.card, pair.slave, pair.row.index))
        self.slave_nodes[interface.title] = slave
        criterion = read_criterion(card, self._flat, self._groups, nodal, slave, finite=finite)
        try:
            return Debond(interface, criterion)
        except InputError as error:
            if isinstance(error, DeckError):
                raise
            card.fail(str(error))


__all__ = ["GENERAL", "GeneralContact", "GeneralPair"]
