"""Constraints of a deck as sums over reference nodes: equations, kinematic couplings, rigid bodies.

u_c = u_ref,c + (theta x r)_c,    r from the reference node to the node, theta = components 4 to 6
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.deck.cards import Card, label
from fxcrack.deck.distributing import Distributing, by_reference, distributing
from fxcrack.deck.flat import Flat
from fxcrack.deck.supports import Link


def read_links(cards: Sequence[Card], flat: Flat) -> tuple[list[Link], dict[int, Distributing]]:
    """Links of all constraint cards among model data, and couplings that distribute loads.

    Returns:
        The links, and the couplings by their reference nodes.

    Raises:
        DeckError: A card is not complete, or of a kind that is not available.
    """
    links: list[Link] = []
    distributed: list[Distributing] = []
    coupling: Card | None = None
    for card in cards:
        if card.keyword == "EQUATION":
            links += _equations(card, flat)
        elif card.keyword == "COUPLING":
            coupling = card
        elif card.keyword == "KINEMATIC":
            if coupling is None:
                card.fail("it belongs directly after *COUPLING")
            links += _kinematic(coupling, card, flat)
            coupling = None
        elif card.keyword == "DISTRIBUTING":
            if coupling is None:
                card.fail("it belongs directly after *COUPLING")
            distributed.append(distributing(coupling, card, _reference(coupling, flat), flat))
            coupling = None
        elif card.keyword == "RIGIDBODY":
            links += _rigid(card, flat)
    if coupling is not None:
        coupling.fail("*KINEMATIC or *DISTRIBUTING must follow")
    return links, by_reference(distributed)


def _equations(card: Card, flat: Flat) -> list[Link]:
    """Linear equations sum_i a_i u_i = 0: the nodes of the first term follow the others."""
    rows, links = card.rows(), []
    i = 0
    while i < len(rows):
        n = rows[i].whole(0, what="the number of terms")
        head, i = rows[i], i + 1
        terms: list[tuple[str, int, float, int]] = []
        while len(terms) < n:
            if i >= len(rows) or n < 2:
                head.fail(f"an equation of {n} terms needs as many of node, component, factor")
            row, i = rows[i], i + 1
            for j in range(0, len(row), 3):
                if row.text(j) and len(terms) < n:
                    terms.append((row.text(j), row.whole(j + 1) - 1, row.number(j + 2), row.index))
        (name, dof, factor, index), others = terms[0], terms[1:]
        nodes = flat.nodes(card, name, index)
        if not 0 <= dof < flat.kind.gdim or factor == 0.0:
            card.fail("the first term needs a displacement component and a factor not 0", index)
        references = []
        for other, of_dof, of_factor, at in others:
            found = flat.nodes(card, other, at)
            if len(found) != 1 or not 0 <= of_dof < 6:
                card.fail(
                    f"'{other}' holds {len(found)} nodes; the terms after the first must be single "
                    "nodes whose displacement is prescribed",
                    at,
                )
            factors = np.full(len(nodes), -of_factor / factor)
            references.append((int(found[0]), of_dof, factors))
        links.append(Link(card, label(name), nodes, dof, references))
    return links


def _reference(card: Card, flat: Flat) -> int:
    found = flat.nodes(card, card.text("REF NODE"))
    if len(found) != 1:
        card.fail(f"the reference '{card.text('REF NODE')}' holds {len(found)} nodes; give one")
    return int(found[0])


def _kinematic(coupling: Card, card: Card, flat: Flat) -> list[Link]:
    name = coupling.text("SURFACE")
    nodes = flat.surface_nodes(coupling, name)
    title = coupling.text("CONSTRAINT NAME", default=name)
    dofs: set[int] = set()
    for row in card.rows():
        first = row.whole(0, 1)
        dofs |= set(range(first - 1, row.whole(1, first)))
    reference = _reference(coupling, flat)
    return _rigid_motion(
        coupling, title, flat.with_centres(nodes), dofs or set(range(6)), reference, flat
    )


def _rigid(card: Card, flat: Flat) -> list[Link]:
    names = [n for n in ("TIE NSET", "PIN NSET", "NSET", "ELSET") if card.has(n)]
    parts = [flat.nodes(card, card.text(name)) for name in names if name != "ELSET"]
    if card.has("ELSET"):
        parts.append(np.unique(flat.cells[flat.elements(card, card.text("ELSET"))]))
    if not parts:
        card.fail("give ELSET, TIE NSET or PIN NSET; rigid surfaces are not available")
    nodes = flat.with_centres(np.unique(np.concatenate(parts)))
    name = card.text(names[0])
    dofs = set(range(3 if names == ["PIN NSET"] else 6))
    return _rigid_motion(card, name, nodes, dofs, _reference(card, flat), flat)


def _rigid_motion(
    card: Card, name: str, nodes: Ints, dofs: set[int], reference: int, flat: Flat
) -> list[Link]:
    nodes = nodes[nodes != reference]
    r = flat.points[nodes] - flat.points[reference]
    gdim, links = flat.kind.gdim, []
    one, none = np.ones(len(nodes)), np.zeros(len(nodes))
    x, y, z = r.T
    turn: list[list[tuple[int, Array]]] = [
        [(4, z), (5, -y)], [(3, -z), (5, x)], [(3, y), (4, -x)],
    ]  # fmt: skip
    if flat.kind.model == "axisymmetric":
        turn = [[(5, -y)], [(5, x)], []]
    for dof in sorted(dofs & set(range(gdim))):
        terms = [(reference, dof, one)]
        for of_dof, arm in turn[dof]:
            if np.abs(arm).max(initial=0.0) > 0.0 and (gdim == 3 or of_dof == 5):
                terms.append((reference, of_dof, arm if len(arm) else none))
        links.append(Link(card, name, nodes, dof, terms))
    if flat.kind.shell:
        links += [Link(card, name, nodes, d, [(reference, d, one)]) for d in sorted(dofs) if d >= 3]
    return links
