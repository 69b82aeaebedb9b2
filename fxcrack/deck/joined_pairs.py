"""Contact pairs whose slave surfaces continue each other, as one interface.

A node can be a slave of one interface only. Pairs that share slave nodes where their surfaces go on
smoothly become one interface, so that a crack passes from the one to the next; where their
toughness differs it is a function of position.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fxcrack.base.arrays import Array, Ints
from fxcrack.criteria import Criterion
from fxcrack.criteria.energy_release import RateCriterion
from fxcrack.deck.cards import Card, Row, key
from fxcrack.deck.flat import Flat
from fxcrack.deck.pair_def import PairDef, bonded_nodes, slave_nodes
from fxcrack.deck.release import check_alike, release_words
from fxcrack.deck.report import Report
from fxcrack.deck.spaces import HOME, NamedSet, SurfaceDef
from fxcrack.deck.thermal import NodalField

_SMOOTH = np.cos(np.radians(30.0))
"""Cosine of the angle between facets up to which surfaces continue each other."""
_TOUGHNESS = ("GIc", "GIIc", "GIIIc", "GIc_p", "GIIc_p", "GIIIc_p")


def continuing(flat: Flat, surfaces: Sequence[Ints]) -> list[list[int]]:
    """Groups of two or more surfaces that share nodes where they go on smoothly.

    Args:
        flat: The model.
        surfaces: Nodes of the facets of each surface.
    """
    n = len(surfaces)
    if n < 2:
        return []
    normals = [facet_normals(flat, rows) for rows in surfaces]
    links = []
    for i in range(n):
        for j in range(i + 1, n):
            shared = np.intersect1d(surfaces[i], surfaces[j])
            if len(shared):
                a, b = (_at(s, f, shared) for s, f in ((surfaces[i], normals[i]),
                                                        (surfaces[j], normals[j])))  # fmt: skip
                if (np.abs((a * b).sum(axis=1)) >= _SMOOTH).all():
                    links.append((i, j))
    if not links:
        return []
    at = np.array(links)
    graph = coo_array((np.ones(len(at)), (at[:, 0], at[:, 1])), (n, n))
    _, group = connected_components(graph, directed=False)
    found = [np.flatnonzero(group == g).tolist() for g in np.unique(group)]
    return [members for members in found if len(members) > 1]


def facet_normals(flat: Flat, rows: Ints) -> Array:
    """Unit normals of facets, up to their sign, shape (n, 3)."""
    x = flat.points[rows]
    if flat.kind.tdim == 2:
        edge = x[:, 1] - x[:, 0]
        normal = np.column_stack((-edge[:, 1], edge[:, 0], np.zeros(len(rows))))
    else:
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))


def _at(rows: Ints, normals: Array, nodes: Ints) -> Array:
    """Normal of one facet at each of some nodes, shape (n, 3)."""
    return np.stack([normals[np.flatnonzero((rows == node).any(axis=1))[0]] for node in nodes])


def _union(flat: Flat, card: Card, names: Sequence[str]) -> str:
    """Name of a surface that is the union of others, made where there are several.

    Args:
        flat: The model.
        card: The card that names them, for messages.
        names: Of the surfaces.
    """
    distinct = list(dict.fromkeys(names))
    if len(distinct) == 1:
        return distinct[0]
    title = " + ".join(distinct)
    made = Card("SURFACE", card.title, {"NAME": title, "COMBINE": "UNION"}, card.file, card.line)
    made.lines = [f'"{name}"' for name in distinct]
    made.places = [(card.file, [card.line] * len(distinct))]
    flat.model.root.surfaces[key(title)] = SurfaceDef(title, made)
    return title


def _name_nodes(flat: Flat, card: Card, title: str, nodes: Ints) -> None:
    """Make a set of nodes of the whole model."""
    members = {}
    for place, placed in flat.placed.items():
        labels = placed.space.nodes.labels
        mine = nodes[(nodes >= placed.first_node) & (nodes < placed.first_node + len(labels))]
        if len(mine):
            members[place or HOME] = labels[mine - placed.first_node]
    hidden = Card("NSET", card.title, {"INTERNAL": None}, card.file, card.line)
    flat.model.root.nsets[key(title)] = NamedSet(title, members, hidden, internal=True)


def join_pairs(pairs: list[PairDef], flat: Flat, report: Report) -> list[PairDef]:
    """The pairs, where those whose slave surfaces continue each other are one.

    Args:
        pairs: Pairs of the deck, those that are bonded and others.
        flat: The model; gets the surfaces and sets of joined pairs.
        report: Says which were joined.

    Raises:
        DeckError: Pairs that continue each other have different parameters.
    """
    surfaces = [flat.surface(p.row.card, p.slave, p.row.index) for p in pairs]
    joined: list[PairDef] = []
    gone: list[PairDef] = []
    for members in continuing(flat, surfaces):
        parts = [pairs[i] for i in members]
        bonded = [p for p in parts if p.bonded is not None]
        if not bonded:
            continue
        first, card = parts[0], parts[0].row.card
        for part in parts[1:]:
            same = part.row.card.options == card.options
            if not same or any(p.normal_only != bonded[0].normal_only for p in bonded):
                part.row.fail(
                    f"its slave surface continues that of '{first.title}' and has nodes of it; "
                    "both pairs need the same parameters and the same interaction then"
                )
        slave = _union(flat, card, [p.slave for p in parts])
        master = _union(flat, card, [p.master for p in parts])
        title = " + ".join(p.title for p in parts)
        marked = np.unique(np.concatenate([bonded_nodes(p, flat) for p in parts]))
        _name_nodes(flat, card, f"{title} bonded", marked)
        assert bonded[0].bonded is not None
        row = Row([slave, master, f"{title} bonded"], bonded[0].bonded.card, bonded[0].bonded.index)
        joined.append(
            PairDef(
                first.row, slave, master, title,
                bonded=row, normal_only=bonded[0].normal_only, parts=parts,
            )
        )  # fmt: skip
        gone += parts
        names = " and ".join(f"'{p.title}'" for p in parts)
        report.replace(f"the pairs {names} continue each other and are one interface", card)
    return [p for p in pairs if p not in gone] + joined


def joined_criterion(pair: PairDef, flat: Flat, read: Callable[[PairDef], Criterion]) -> Criterion:
    """One criterion for all parts of a joined pair, with toughness by position where it differs.

    At a node of two parts the toughness is that of the part that is wholly bonded, into which the
    crack goes from there; the mean if both are, or neither is.

    Args:
        pair: The joined pair.
        flat: The model.
        read: Gives the criterion of a part.

    Raises:
        DeckError: The criteria differ in more than their toughness, or hold in different steps.
    """
    parts = [part for part in pair.parts if part.bonded is not None]
    for part in parts:
        if [n for n, _, _ in part.debonds] != [n for n, _, _ in parts[0].debonds]:
            part.row.fail(
                "the pair continues another one, which has *DEBOND in other steps; let both have "
                "it in the same steps"
            )
        check_alike(part)
        if release_words(part.debonds[0][1]) != release_words(parts[0].debonds[0][1]):
            part.debonds[0][1].fail("the bond force falls in another way than in the pair beside")
    criteria = [read(part) for part in parts]
    first = criteria[0]
    if all(repr(criterion) == repr(first) for criterion in criteria):  # they compare by identity
        return first
    names = [name for name in _TOUGHNESS if getattr(first, name, None) is not None]
    for part, criterion in zip(parts, criteria, strict=True):
        same = isinstance(first, RateCriterion) and type(criterion) is type(first)
        if not same or _without(criterion) != _without(first):
            part.debonds[0][2].fail(
                "the pair continues another one, whose criterion differs in more than its critical "
                "energy release rates; give both the same type, law, exponents and tolerances"
            )
    slave = slave_nodes(pair, flat)
    x = flat.points[slave][:, : flat.kind.gdim]
    places = [np.searchsorted(slave, slave_nodes(part, flat)) for part in parts]
    closed = [len(bonded_nodes(p, flat)) == int((slave[at] < flat.n_given).sum())
              for p, at in zip(parts, places, strict=True)]  # fmt: skip
    ahead = np.zeros(len(slave), dtype=bool)
    for at, whole in zip(places, closed, strict=True):
        ahead[at] |= whole
    total, weight = np.zeros((len(names), len(slave))), np.zeros(len(slave))
    for part, criterion, at, whole in zip(parts, criteria, places, closed, strict=True):
        counts = np.where(ahead[at], float(whole), 1.0)
        weight[at] += counts
        for i, name in enumerate(names):
            total[i, at] += counts * _values(part, getattr(criterion, name), x[at])
    # nodes of parts that are not bonded have no toughness of their own, and none is asked for
    mean = total / np.maximum(weight, 1.0)
    mean = np.where(weight > 0.0, mean, total.sum(axis=1, keepdims=True) / weight.sum())
    given = {name: NodalField(x, mean[i]) for i, name in enumerate(names)}
    return replace(first, **given)  # type: ignore[type-var]


def _without(criterion: Criterion) -> str:
    """All of a criterion but its toughness, in words."""
    given = [n for n in _TOUGHNESS if getattr(criterion, n, None) is not None]
    return repr(replace(criterion, **dict.fromkeys(given, 1.0)))  # type: ignore[type-var]


def _values(part: PairDef, value: object, x: Array) -> Array:
    """A toughness of a part at some nodes."""
    if callable(value):
        return np.asarray(value(np.vstack((x.T, np.zeros((3 - x.shape[1], len(x)))))))
    if not isinstance(value, float | int):
        part.debonds[0][2].fail(
            "the pair continues another one with a different toughness; a table against "
            "temperature is not available then"
        )
    return np.full(len(x), float(value))


__all__ = ["continuing", "facet_normals", "join_pairs", "joined_criterion"]
