"""Contact pairs, bonded parts and ties of a deck as interfaces, and ``*DEBOND`` as debonds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.continuum.face import Face
from fxcrack.criteria import (
    Criterion,
    RampRelease,
)
from fxcrack.criteria.energy_release import RateCriterion
from fxcrack.deck.cards import Card, Row, key, label
from fxcrack.deck.crack_lengths import joined_lengths
from fxcrack.deck.everywhere import Everywhere
from fxcrack.deck.flat import Flat
from fxcrack.deck.fracture import NodalRates, read_criterion
from fxcrack.deck.general_contact import GeneralContact
from fxcrack.deck.groups import Groups
from fxcrack.deck.interactions import friction, interaction, note_softness, note_thickness
from fxcrack.deck.joined_pairs import join_pairs, joined_criterion
from fxcrack.deck.model import Family
from fxcrack.deck.pair_def import PairDef, bonded_nodes, slave_nodes
from fxcrack.deck.release import check_alike, read_release
from fxcrack.deck.report import Report
from fxcrack.deck.rigid_surfaces import RigidSurfaces, Surface
from fxcrack.deck.supports import Boundary
from fxcrack.deck.ties import pairing_of, tie
from fxcrack.deck.tracks import Period
from fxcrack.interface.definition import Interface
from fxcrack.interface.rigid import RIGID
from fxcrack.steps.debond import Debond

_RAMP = 5
"""Increments over which a ramp falls that cannot fall with the opening."""
_BEYOND = 1.001
"""Search tolerance of rigid masters over the largest distance of a slave node."""
_NEAR = 0.1
"""Distance from a rigid master up to which nodes lie on it, over the size of the facets."""
_COINCIDENT = 1e-6
"""Distance of nodes at one place, over the size of the facets."""


class Contacts:
    """All interfaces of a deck.

    Args:
        cards: Model data.
        flat: The model.
        groups: Takes their surfaces.
        report: Takes what is replaced.
        finite: Whether bodies turn far (NLGEOM).
        explicit: Whether the steps are explicit.

    Attributes:
        pairs: The contact pairs.

    Raises:
        DeckError: A card cannot be read, or names what does not exist.
    """

    def __init__(
        self,
        cards: Sequence[Card],
        flat: Flat,
        groups: Groups,
        report: Report,
        *,
        finite: bool,
        explicit: bool,
    ) -> None:
        self._flat, self._groups, self._report, self._finite = flat, groups, report, finite
        self._explicit = explicit
        self.pairs: list[PairDef] = []
        self._rigid = RigidSurfaces(cards, flat)
        self._clearances = [card for card in cards if card.keyword == "CLEARANCE"]
        for card in cards:
            if card.keyword == "CONTACTPAIR":
                for row in card.need_rows("slave surface, master surface"):
                    self._add_pair(row)
        for card in cards:
            if card.keyword == "INITIALCONDITIONS" and card.word("TYPE") == "CONTACT":
                for row in card.need_rows("slave surface, master surface, bonded node set"):
                    self._bond(row, card.has("NORMAL"))
        if not explicit:
            self.pairs = join_pairs(self.pairs, flat, report)
        self._ties = [card for card in cards if card.keyword == "TIE"]
        nodal = [card for card in cards if card.keyword == "NODALENERGYRATE"]
        self._nodal = NodalRates(nodal, flat) if nodal else None
        self._general = GeneralContact(cards, flat, groups, report, explicit=explicit)

    # -- pairs ---------------------------------------------------------------------------

    def _add_pair(self, row: Row) -> None:
        card = row.card
        slave, master = label(row.text(0)), label(row.text(1))
        if not master or key(slave) == key(master):
            row.fail(
                f"surface '{slave}' is paired with itself; self-contact is not available: name two "
                "surfaces"
            )
        if not slave:
            row.fail("the slave surface is missing")
        if any(key(p.slave) == key(slave) and key(p.master) == key(master) for p in self.pairs):
            row.fail("this pair is defined already")
        if self._flat.kind.shell and card.has("NO THICKNESS"):
            row.fail(
                "NO THICKNESS is not available: faces of shells meet, not their reference "
                "surfaces; give the shells an OFFSET, or leave it out"
            )
        alone = all(key(p.slave) != key(slave) for p in self.pairs)
        title = slave if alone else f"{slave} on {master}"
        self.pairs.append(PairDef(row, slave, master, title))
        card.choose("TYPE", ("NODE TO SURFACE", "SURFACE TO SURFACE"), "NODE TO SURFACE")

    def _bond(self, row: Row, normal_only: bool) -> None:
        slave, master = key(row.text(0)), key(row.text(1))
        chosen = [
            p
            for p in self.pairs
            if (not slave or key(p.slave) == slave) and (not master or key(p.master) == master)
        ]
        if not chosen or not (slave or master):
            row.fail(
                f"there is no contact pair of '{label(row.text(0))}' and '{label(row.text(1))}'; "
                "define it by *CONTACT PAIR"
            )
        name = label(row.text(2))
        if len(chosen) > 1 and name:
            marked = self._flat.nodes(row.card, name, row.index)
            chosen = [p for p in chosen if np.isin(slave_nodes(p, self._flat), marked).any()]
        for pair in chosen:
            if pair.bonded is not None:
                row.fail(f"the pair '{pair.title}' is bonded already")
            word = pair.row.card.word("TYPE", "NODETOSURFACE")
            if word == "SURFACETOSURFACE" and not pair.row.card.has("SMALL SLIDING"):
                pair.row.fail(
                    "finite-sliding surface-to-surface contact is not possible for a pair that is "
                    "bonded; add SMALL SLIDING"
                )
            pair.bonded, pair.normal_only = row, normal_only

    @property
    def bonds_bodies(self) -> bool:
        """Whether an interface is bonded, in part at least."""
        pairs = any(p.bonded is not None or p.row.card.has("TIED") for p in self.pairs)
        return pairs or bool(self._ties or self._general.slave_nodes)

    def slave_nodes(self) -> dict[str, Ints]:
        """Nodes of the slave surfaces by the titles of the interfaces."""
        found = {pair.title: slave_nodes(pair, self._flat) for pair in self.pairs if pair.debonds}
        return found | self._general.slave_nodes

    # -- debonds of the steps ------------------------------------------------------------

    def take(self, number: int, cards: Sequence[Card]) -> dict[str, int]:
        """Read the ``*DEBOND`` cards of a step.

        Args:
            number: Of the step.
            cards: Of the step.

        Returns:
            Titles of the interfaces that may grow in it, and the increments between two outputs.

        Raises:
            DeckError: The criterion is missing, or the pair does not exist or is not bonded.
        """
        grow: dict[str, int] = {}
        for i, card in enumerate(cards):
            if card.keyword == "FRACTURECRITERION" and (i == 0 or cards[i - 1].keyword != "DEBOND"):
                card.fail("it must stand directly after *DEBOND")
            if card.keyword != "DEBOND":
                continue
            if self._explicit:
                card.fail(
                    "it belongs to quasi-static steps; in explicit dynamics the bond and its "
                    "criterion are *COHESIVE BEHAVIOR and *FRACTURE CRITERION of a surface "
                    "interaction"
                )
            if i + 1 == len(cards) or cards[i + 1].keyword != "FRACTURECRITERION":
                card.fail("*FRACTURE CRITERION must stand directly after it")
            slave, master = card.text("SLAVE", "SECONDARY"), card.text("MASTER", "MAIN")
            found = [
                (p, whole)
                for whole in self.pairs
                for p in whole.parts or [whole]
                if key(p.slave) == key(slave) and key(p.master) == key(master)
            ]
            if not found:
                card.fail(
                    f"there is no contact pair of '{slave}' and '{master}'; define it by *CONTACT "
                    "PAIR"
                )
            pair, whole = found[0]
            if pair.bonded is None:
                card.fail(
                    f"the pair of '{slave}' and '{master}' is not bonded; bond it by *INITIAL "
                    "CONDITIONS, TYPE=CONTACT"
                )
            if any(n == number for n, _, _ in pair.debonds):
                card.fail("the pair has a criterion in this step already; one is possible")
            pair.debonds.append((number, card, cards[i + 1]))
            if whole is not pair:
                whole.debonds.append((number, card, cards[i + 1]))
            grow[whole.title] = max(int(card.number("FREQUENCY", 1.0)), 0)
        return grow

    # -- supports of bonded nodes --------------------------------------------------------

    def share_supports(self, boundary: Boundary) -> None:
        """Let supports of bonded slave nodes hold the master nodes at the same places as well.

        A bond makes them one as long as it holds, and the deck may name either.

        Args:
            boundary: What is prescribed; changed in place.
        """
        for pair in self.pairs:
            card = pair.row.card
            if pair.bonded is None and not card.has("TIED"):
                continue
            if self._rigid.has(pair.row):
                continue
            slave = slave_nodes(pair, self._flat)
            name = "" if pair.bonded is None else label(pair.bonded.text(2))
            if name and pair.bonded is not None:
                bonded = self._flat.nodes(pair.bonded.card, name, pair.bonded.index)
                slave = slave[np.isin(slave, self._flat.with_centres(bonded))]
            self._share(boundary, card, pair.title, slave, (pair.master, pair.row.index))
        for card in self._ties:
            for row in card.rows():
                slave = np.unique(self._flat.surface(card, row.text(0), row.index, whole=False))
                self._share(boundary, card, row.text(0), slave, (row.text(1), row.index))

    def _share(
        self, boundary: Boundary, card: Card, title: str, slave: Ints, of_master: tuple[str, int]
    ) -> None:
        held = slave[(boundary.owner[:, :, slave] >= 0).any(axis=(0, 1))]
        if not len(held):
            return
        rows = self._flat.surface(card, *of_master, whole=not self._ties)
        x = self._flat.points
        master = np.setdiff1d(np.unique(rows), slave)
        if not len(master):
            return
        size = float(np.linalg.norm(np.ptp(x[rows], axis=1), axis=1).mean())
        distance, found = cKDTree(x[master]).query(x[held])
        near = distance <= _COINCIDENT * size
        changed = boundary.share(held[near], master[found[near]])
        if changed:
            self._report.replace(
                f"the supports of {changed} bonded nodes of '{title}' hold the nodes of the master "
                "surface at the same places as well",
                card,
            )

    # -- the scene -----------------------------------------------------------------------

    def build(
        self, interactions: dict[str, Family], supported: Ints, boundary: Boundary
    ) -> tuple[list[Debond], list[Interface]]:
        """Debonds and bonds of the scene.

        Args:
            interactions: Properties of contact by key.
            supported: Nodes that supports hold, ascending.
            boundary: What is prescribed.

        Raises:
            DeckError: A property is not available, or contradicts another.
        """
        debonds, bonds = [], []
        for pair in self.pairs:
            pair.interface = self._interface(pair, interactions, boundary)
            if not pair.debonds:
                bonds.append(pair.interface)
                continue
            rubs = any(self._friction(p, interactions) is not None for p in self.pairs)
            debonds.append(self._debond(pair, boundary.periods, rubs=rubs))
            held = np.intersect1d(slave_nodes(pair, self._flat), supported)
            if len(held):
                log.warn(
                    "%s: supports hold %d nodes of the crack surface '%s'",
                    pair.row.card.place,
                    len(held),
                    pair.slave,
                )
            self._check_wake(pair)
        for card in self._ties:
            bonds += [
                tie(row, self._flat, self._groups, explicit=self._explicit)
                for row in card.need_rows("slave surface, master surface")
            ]
        more, others = self._general.build(interactions, self._nodal, finite=self._finite)
        return debonds + more, bonds + others

    def _check_wake(self, pair: PairDef) -> None:
        """Look at the tips on a line: at corner nodes, with two open elements behind them.

        Surface-to-surface pairs need the latter; fewer are warned of.

        Raises:
            DeckError: A tip is a midside node.
        """
        if self._flat.kind.gdim == 3:
            return
        assert pair.bonded is not None
        name = label(pair.bonded.text(2))
        if not name:
            return
        bonded = self._flat.nodes(pair.bonded.card, name, pair.bonded.index)
        rows = self._flat.surface(pair.row.card, pair.slave, pair.row.index)
        marks = np.isin(rows, bonded)
        if rows.shape[1] == 3 and self._flat.given_kind.order == 2:
            at_middle = marks[:, 2] & ~marks[:, :2].all(axis=1)
            if np.any(at_middle):
                x = self._flat.points[rows[np.argmax(at_middle), 2]]
                pair.bonded.fail(
                    f"the tip at ({x[0]:g}, {x[1]:g}) is a midside node; the open part must cover "
                    "whole element faces: let the bonded set begin at a corner node"
                )
        n_open = int((~marks[:, :2]).any(axis=1).sum())
        if 0 < n_open < 2 and pair.row.card.word("TYPE") == "SURFACETOSURFACE":
            log.warn(
                "%s: only %d element of '%s' lies behind the crack tip; surface-to-surface pairs "
                "need two or more",
                pair.row.card.place,
                n_open,
                pair.slave,
            )

    def _interface(
        self, pair: PairDef, interactions: dict[str, Family], boundary: Boundary
    ) -> Interface:
        card, flat, groups = pair.row.card, self._flat, self._groups
        index = pair.row.index
        slave = groups.surface(card, pair.slave, index)
        master: str | Face | Surface
        tolerance = None
        if self._rigid.has(pair.row):
            x = flat.points[slave_nodes(pair, flat)]
            master = self._rigid.master(pair.row, x, boundary)
            # all slave nodes may meet it, wherever they are at the start
            tolerance = _BEYOND * max(float(np.abs(master.measure(x)[0]).max()), _least(x))
            self._check_bonded(pair, master)
        else:
            master = groups.surface(card, pair.master, index)
        bonded: object = Everywhere(card.has("TIED"))
        if pair.bonded is not None:
            name = label(pair.bonded.text(2))
            bonded = None
            if name:
                found = flat.nodes(pair.bonded.card, name, pair.bonded.index)
                bonded = groups.support(pair.bonded.card, name, found, words="nodes")
        friction = self._friction(pair, interactions)
        if friction and pair.normal_only:
            pair.row.fail("NORMAL bonds and *FRICTION exclude each other; leave one out")
        gap = "adjust" if card.has("ADJUST") or card.has("TIED") else "keep"
        if self._clearance_of(pair):
            gap = "adjust"
        if tolerance is not None and gap == "adjust":
            gap, tolerance = self._gap_to_rigid(pair, tolerance)
        return Interface(
            slave,
            master,
            bonded=bonded,  # type: ignore[arg-type]
            contact=not card.has("TIED"),
            friction=friction,
            normal_only=pair.normal_only,
            # a rigid surface has no facets: nodes and surfaces meet it in the same way
            pairing=None if self._rigid.has(pair.row) else pairing_of(card),
            gap=gap,
            tolerance=tolerance,
            name=pair.title,
        )

    def _gap_to_rigid(self, pair: PairDef, distance: float) -> tuple[str, float | None]:
        """How gaps to a rigid master begin where the deck adjusts them, and the search tolerance.

        Args:
            pair: The pair.
            distance: That tolerance, which reaches all slave nodes.
        """
        if distance <= _NEAR * self._facet_size(pair):
            return "adjust", None
        self._report.replace(
            "only gaps that are small beside the elements count as zero; those to the rigid "
            "surface stay as they are",
            pair.row.card,
        )
        return "keep", distance

    def _facet_size(self, pair: PairDef) -> float:
        """Mean size of the facets of the slave surface, length."""
        rows = self._flat.surface(pair.row.card, pair.slave, pair.row.index)
        return float(np.linalg.norm(np.ptp(self._flat.points[rows], axis=1), axis=1).mean())

    def _check_bonded(self, pair: PairDef, master: Surface) -> None:
        """Refuse bonded nodes away from a rigid master."""
        nodes = bonded_nodes(pair, self._flat)
        near = _NEAR * self._facet_size(pair)
        off = np.abs(master.measure(self._flat.points[nodes])[0])
        if pair.bonded is not None and off.max(initial=0.0) > near:
            pair.bonded.fail(
                f"{int((off > near).sum())} bonded nodes do not lie on the {master}, the "
                f"farthest is {off.max():.3g} away; move it to them, or take them out of the set"
            )

    def _clearance_of(self, pair: PairDef) -> bool:
        """Whether a clearance that is nothing beside the elements is given for a pair."""
        for card in self._clearances:
            names = key(card.text("SLAVE", "SECONDARY")), key(card.text("MASTER", "MAIN"))
            known = [(key(p.slave), key(p.master)) for p in [pair, *pair.parts]]
            if names not in known:
                continue
            value = card.number("VALUE", 0.0)
            if not card.has("VALUE") or card.lines:
                card.fail("give VALUE; clearances by node are not available")
            size = self._facet_size(pair)
            if abs(value) > 1e-3 * size:
                card.fail(
                    f"the clearance {value:g} is no small part of the element size {size:.3g}; "
                    "move the nodes apart instead"
                )
            self._report.replace(
                f"the clearance {value:g} of '{pair.title}' counts as zero: it only serves the "
                "other program's contact iterations",
                card,
            )
            return True
        return False

    def _friction(self, pair: PairDef, interactions: dict[str, Family]) -> float | None:
        card = pair.row.card
        if not card.has("INTERACTION"):
            return None
        family = interaction(card, card.text("INTERACTION"), interactions)
        note_softness(family, self._flat, self._facet_size(pair), self._report)
        note_thickness(family, self._flat, self._report)
        return friction(family)

    def _debond(self, pair: PairDef, periods: Sequence[Period], *, rubs: bool) -> Debond:
        assert pair.interface is not None
        _, card, criterion_card = pair.debonds[0]
        if not pair.parts:
            check_alike(pair)
        criterion = self._criterion(pair, periods)
        if self._flat.kind.gdim == 3 and not isinstance(criterion, RateCriterion):
            self._report.replace(
                "this criterion is for 2-D in other programs; it is used on the 3-D front",
                criterion_card,
            )
        if pair.normal_only and isinstance(criterion, RateCriterion):
            if not isinstance(pair.interface.master, RIGID):
                criterion_card.fail("a bond in the NORMAL direction only is not possible with it")
            self._report.replace(
                "the bond holds the opening only, as on a plane of symmetry; energy release rates "
                "are those of the body that is modelled, of a half model half of the whole ones",
                criterion_card,
            )
        release = read_release(card, criterion)
        if rubs and isinstance(release, RampRelease):
            release = RampRelease(increments=_RAMP)
            self._report.replace(
                f"DEBONDING FORCE=RAMP beside *FRICTION: the force falls over {_RAMP} increments",
                card,
            )
        try:
            return Debond(pair.interface, criterion, release)
        except InputError as error:
            criterion_card.fail(str(error))

    def _criterion(self, pair: PairDef, periods: Sequence[Period]) -> Criterion:
        """The criterion of a pair; of joined ones that of all of them."""
        if pair.parts:
            return joined_criterion(pair, self._flat, lambda p: self._criterion(p, periods))
        card = pair.debonds[0][2]
        if card.word("TYPE") == "CRACKLENGTH":
            card = joined_lengths([(n, c) for n, _, c in pair.debonds], periods)
        return read_criterion(
            card,
            self._flat,
            self._groups,
            self._nodal,
            slave_nodes(pair, self._flat),
            finite=self._finite,
        )


def _least(x: Array) -> float:
    """A length that is small beside a surface: a search tolerance must not be 0."""
    return 1e-6 * float(np.ptp(x, axis=0).max())
