"""Constraints of a deck: equations, couplings, rigid bodies, multi-point constraints.

    u_c = u_ref,c + (theta x r)_c,    r from the reference to the node, theta = components 4 to 6

Where the motion of a reference is prescribed in all steps a constraint is a prescribed
displacement (:class:`fxcrack.deck.supports.Link`), else a :class:`fxcrack.Coupling` or
:class:`fxcrack.Equation`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.deck.cards import Card, Row, label
from fxcrack.deck.distributing import (
    Distributing,
    by_reference,
    distributing,
    influenced,
    mean_supports,
)
from fxcrack.deck.equations import DeckEquation, Dummy, equation_supports, read_equations
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.deck.rigid import RigidSet, rigid_supports
from fxcrack.deck.rigid_elements import rigid_labels
from fxcrack.deck.supports import AnySupport, Boundary
from fxcrack.deck.transforms import Transforms


class Carrier(Protocol):
    """What carries the load of a node without elements."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def nodes(self) -> Ints:
        """Nodes on which the load acts, shape (n,)."""

    def forces(self, row: Row, force: Array, moment: Array, gdim: int) -> Array:
        """Forces on the nodes, shape (n, gdim)."""

    def turns(self, force: Array, moment: Array) -> bool:
        """Whether they would have to turn with the body where it turns far."""


@dataclass(frozen=True)
class Constraints:
    """All constraints of a deck.

    Attributes:
        rigid: Sets that follow reference nodes.
        distributed: Couplings of means by their reference nodes.
        equations: Linear equations.
        dummies: Nodes without elements that equations name, by node.
    """

    rigid: list[RigidSet] = field(default_factory=list)
    distributed: dict[int, Distributing] = field(default_factory=dict)
    equations: list[DeckEquation] = field(default_factory=list)
    dummies: dict[int, Dummy] = field(default_factory=dict)

    @property
    def carriers(self) -> Mapping[int, Carrier]:
        """What carries the loads of reference nodes, by node."""
        sets = {one.reference: one for one in reversed(self.rigid)}
        return {**self.dummies, **self.distributed, **sets}

    def check_axes(self, transforms: Transforms) -> None:
        """Refuse equations between components along axes of their own.

        Raises:
            DeckError: One has such a node.
        """
        for equation in self.equations:
            for nodes, _, _ in equation.terms:
                if transforms.turned[nodes].any():
                    equation.card.fail(
                        f"the equation of '{equation.name}' has nodes with a *TRANSFORM; write it "
                        "between components along the global axes"
                    )

    def supports(self, boundary: Boundary, groups: Groups) -> list[AnySupport]:
        """The constraints in the words of a scene; to be called before those of the boundary.

        Raises:
            DeckError: A constraint cannot hold as it is prescribed.
        """
        couplings, links = rigid_supports(self.rigid, boundary, groups)
        couplings += mean_supports(self.distributed.values(), boundary, groups)
        more, of_equations = equation_supports(
            self.equations, self.dummies, boundary, groups, {one.reference for one in self.rigid}
        )
        return [*couplings, *more, *boundary.link_displacements(links + of_equations, groups)]


def read_constraints(cards: Sequence[Card], flat: Flat) -> Constraints:
    """All constraint cards among model data.

    Raises:
        DeckError: A card is not complete, or of a kind that is not available.
    """
    rigid: list[RigidSet] = []
    equations: list[DeckEquation] = []
    distributed: list[Distributing] = []
    coupling: Card | None = None
    for card in cards:
        if card.keyword == "EQUATION":
            equations += read_equations(card, flat)
        elif card.keyword == "MPC":
            _multi_point(card, flat, rigid, equations)
        elif card.keyword == "COUPLING":
            if coupling is not None:
                coupling.fail("*KINEMATIC or *DISTRIBUTING must follow")
            coupling = card
        elif card.keyword == "KINEMATIC":
            if coupling is None:
                card.fail("it belongs directly after *COUPLING")
            rigid.append(_kinematic(coupling, card, flat))
            coupling = None
        elif card.keyword == "DISTRIBUTING":
            if coupling is None:
                card.fail("it belongs directly after *COUPLING")
            distributed.append(distributing(coupling, card, _reference(coupling, flat), flat))
            coupling = None
        elif card.keyword == "KINEMATICCOUPLING":
            rigid += _kinematic_by_nodes(card, flat)
        elif card.keyword == "RIGIDBODY":
            body = _rigid_body(card, flat)
            if body is not None:
                rigid.append(body)
    if coupling is not None:
        coupling.fail("*KINEMATIC or *DISTRIBUTING must follow")
    dummies: dict[int, Dummy] = {}
    for equation in equations:
        for node in equation.dummies(flat):
            dummies.setdefault(node, Dummy(node, equation))
    return Constraints(rigid, by_reference(distributed), equations, dummies)


def _reference(card: Card, flat: Flat) -> int:
    found = flat.nodes(card, card.text("REF NODE"))
    if len(found) != 1:
        card.fail(f"the reference '{card.text('REF NODE')}' holds {len(found)} nodes; give one")
    return int(found[0])


def _titled(card: Card, name: str) -> str:
    return f"{card.home}.{name}" if card.home else name


def _set(
    card: Card, name: str, nodes: Ints, dofs: set[int], reference: int, flat: Flat
) -> RigidSet:
    nodes = nodes[(nodes != reference) & flat.used[nodes]]
    if flat.used[reference]:
        nodes = np.union1d(nodes, [reference])
    if not len(nodes):
        card.fail(f"no element has a node of '{name}'; couple nodes of the body")
    if not any(d < flat.kind.gdim for d in dofs):
        card.fail(f"no displacement component of '{name}' follows; give some of 1 to 3")
    return RigidSet(card, name, nodes, frozenset(dofs), reference, flat)


def _kinematic(coupling: Card, card: Card, flat: Flat) -> RigidSet:
    name = coupling.text("SURFACE")
    nodes = flat.surface_nodes(coupling, name)
    title = _titled(coupling, coupling.text("CONSTRAINT NAME", default=name))
    dofs: set[int] = set()
    for row in card.rows():
        first = row.whole(0, 1)
        last = row.whole(1, first) or first
        if not 1 <= first <= last <= 6:
            row.fail(f"components {first} to {last} are none of 1 to 6")
        dofs |= set(range(first - 1, last))
    reference = _reference(coupling, flat)
    nodes = influenced(coupling, flat, reference, flat.with_centres(nodes))
    return _set(coupling, title, nodes, dofs or set(range(6)), reference, flat)


def _kinematic_by_nodes(card: Card, flat: Flat) -> list[RigidSet]:
    """The former ``*KINEMATIC COUPLING``: nodes with the components that follow, line by line."""
    reference = _reference(card, flat)
    dofs: dict[int, set[int]] = {}
    for row in card.need_rows("node or set, first and last component"):
        first = row.whole(1, 1)
        last = row.whole(2, first if row.text(1) else 6) or first
        if not 1 <= first <= last <= 6:
            row.fail(f"components {first} to {last} are none of 1 to 6")
        for node in flat.with_centres(flat.nodes(card, row.text(0), row.index)).tolist():
            dofs.setdefault(node, set()).update(range(first - 1, last))
    alike: dict[frozenset[int], list[int]] = {}
    for node, components in dofs.items():
        alike.setdefault(frozenset(components), []).append(node)
    name = _titled(card, f"coupling to {card.text('REF NODE')}")
    return [
        _set(card, name, np.array(sorted(nodes), dtype=np.int64), set(components), reference, flat)
        for components, nodes in alike.items()
    ]


def _rigid_body(card: Card, flat: Flat) -> RigidSet | None:
    """Nodes that follow a reference; ``None`` for rigid surfaces alone."""
    names = [n for n in ("TIE NSET", "PIN NSET", "NSET", "ELSET") if card.has(n)]
    parts = [flat.nodes(card, card.text(name)) for name in names if name != "ELSET"]
    of_rigid = card.has("ELSET") and rigid_labels(flat, card.home, card, card.text("ELSET"))
    if card.has("ELSET") and not of_rigid:
        parts.append(np.unique(flat.cells[flat.elements(card, card.text("ELSET"))]))
    if not parts:
        if not of_rigid and not card.has("ANALYTICAL SURFACE"):
            card.fail("give ELSET, TIE NSET, PIN NSET or ANALYTICAL SURFACE")
        return None
    nodes = flat.with_centres(np.unique(np.concatenate(parts)))
    title = _titled(card, card.text(names[0]))
    dofs = set(range(3 if names == ["PIN NSET"] else 6))
    return _set(card, title, nodes, dofs, _reference(card, flat), flat)


def _multi_point(
    card: Card, flat: Flat, rigid: list[RigidSet], equations: list[DeckEquation]
) -> None:
    """``*MPC`` of the kinds that are rigid sets and equations: BEAM, TIE, PIN."""
    beams: dict[int, list[Ints]] = {}
    for row in card.need_rows("kind, node or set that follows, node that is followed"):
        kind = row.text(0).upper()
        if kind not in ("BEAM", "TIE", "PIN"):
            row.fail(f"MPC {row.text(0)} is not available; BEAM, TIE and PIN are")
        if len(row) != 3:
            row.fail("give the node or set that follows and one node that is followed")
        nodes = flat.nodes(card, row.text(1), row.index)
        reference = flat.nodes(card, row.text(2), row.index)
        if len(reference) != 1:
            row.fail(f"'{row.text(2)}' holds {len(reference)} nodes; give one that is followed")
        if kind == "BEAM":
            beams.setdefault(int(reference[0]), []).append(nodes)
            continue
        if flat.kind.shell and kind == "TIE":
            row.fail("MPC TIE of shells is not available; BEAM is")
        equations += [
            DeckEquation(card, label(row.text(1)), [(nodes, c, 1.0), (reference, c, -1.0)])
            for c in range(flat.kind.gdim)
        ]
    for number, (reference_node, parts) in enumerate(beams.items(), start=1):
        nodes = np.unique(np.concatenate(parts))
        name = _titled(card, "MPC" if number == 1 else f"MPC {number}")
        rigid.append(_set(card, name, nodes, set(range(6)), reference_node, flat))


__all__ = ["Carrier", "Constraints", "read_constraints"]
