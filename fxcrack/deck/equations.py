"""``*EQUATION``: linear equations between displacement components, dummy nodes among them.

A node without elements (dummy) is an unknown, or a prescribed value, that equations share. A free
one is taken out of them: with b d + sum a_i u_i = 0 for the first pair of nodes of the first
equation that has it,

    d = -sum (a_i / b) u_i

stands for it in all others, and a force F on it is the forces -F a_i / b on these nodes. A
prescribed one is the right-hand side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.couplings import Equation
from fxcrack.deck.cards import Card, Row, label
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.deck.supports import AnySupport, Boundary, Link
from fxcrack.deck.tracks import Track, combined

_MOST_SINGLE = 2000
"""Equations between single nodes that are made at most: each needs groups of its own."""
Term = tuple[Ints, int, float]


@dataclass(frozen=True, eq=False)
class DeckEquation:
    """An equation of the deck.

    Attributes:
        card: The card.
        name: Of its first set.
        terms: Nodes (n of the first one; n or 1 of the others), component and factor.
    """

    card: Card
    name: str
    terms: list[Term]

    def dummies(self, flat: Flat) -> list[int]:
        """Nodes without elements that it names."""
        return [int(n) for nodes, _, _ in self.terms for n in nodes if not flat.used[n]]


@dataclass(eq=False)
class Dummy:
    """A node without elements that equations name; carries loads once they are solved for it.

    Attributes:
        node: The node.
        equation: The first equation that names it.
        means: What it stands for per component: nodes, components, factors.
        prescribed: Components that are prescribed.
    """

    node: int
    equation: DeckEquation
    means: dict[int, list[tuple[int, int, float]]] = field(default_factory=dict)
    prescribed: set[int] = field(default_factory=set)

    @property
    def name(self) -> str:
        """Name of its equation."""
        return self.equation.name

    @property
    def nodes(self) -> Ints:
        """Nodes that it stands for, ascending."""
        return np.unique([n for terms in self.means.values() for n, _, _ in terms]).astype(np.int64)

    def forces(self, row: Row, force: Array, moment: Array, gdim: int) -> Array:
        """Forces on the nodes, shape (n, gdim).

        Raises:
            DeckError: The load has a component that no equation has, or a prescribed one.
        """
        nodes = self.nodes
        out = np.zeros((len(nodes), gdim))
        if np.any(moment):
            row.fail("a node of equations carries no moment; load it by forces")
        for c in np.flatnonzero(force).tolist():
            if c in self.prescribed:
                row.fail(
                    f"component {c + 1} of '{self.name}' is prescribed by *BOUNDARY: a load there "
                    "moves nothing; leave one of them out"
                )
            if c not in self.means:
                row.fail(
                    f"no equation has component {c + 1} of this node without elements, so that no "
                    "force can act on it; load the nodes of the body"
                )
            for node, dof, factor in self.means[c]:
                out[int(np.searchsorted(nodes, node)), dof] += factor * force[c]
        return out

    def turns(self, force: Array, moment: Array) -> bool:
        """Forces of equations keep their direction."""
        return False


def read_equations(card: Card, flat: Flat) -> list[DeckEquation]:
    """Linear equations sum_i a_i u_i = 0: the nodes of the first term follow the others.

    Raises:
        DeckError: An equation is not complete, or sets have different numbers of nodes.
    """
    rows, out = card.rows(), []
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
        found: list[Term] = []
        for k, (name, dof, factor, index) in enumerate(terms):
            nodes = flat.ordered_nodes(card, name, index)
            if k == 0 and (not 0 <= dof < flat.kind.gdim or factor == 0.0):
                card.fail("the first term needs a displacement component and a factor not 0", index)
            if not 0 <= dof < 6:
                card.fail(f"component {dof + 1} is none of 1 to 6", index)
            if k and len(nodes) not in (1, len(found[0][0])):
                card.fail(
                    f"'{name}' holds {len(nodes)} nodes; the terms after the first must be single "
                    f"nodes, or sets of as many as the first, {len(found[0][0])}",
                    index,
                )
            if factor:
                found.append((nodes, dof, factor))
        if len(found) > 1:
            out.append(DeckEquation(card, label(terms[0][0]), found))
    return out


def equation_supports(
    equations: Sequence[DeckEquation],
    dummies: Mapping[int, Dummy],
    boundary: Boundary,
    groups: Groups,
    references: AbstractSet[int],
) -> tuple[list[AnySupport], list[Link]]:
    """Equations of the scene, and links of those all of whose followed terms are prescribed.

    Args:
        equations: Those of the deck.
        dummies: Nodes without elements that they name; what they stand for is put there.
        boundary: What is prescribed.
        groups: Takes the groups.
        references: Reference nodes of rigid sets.

    Raises:
        DeckError: An equation cannot be solved for a node of the body.
    """
    made = _Equations(dummies, boundary, groups, references)
    for equation in equations:
        made.take(equation)
    return made.supports, made.links


class _Equations:
    def __init__(
        self,
        dummies: Mapping[int, Dummy],
        boundary: Boundary,
        groups: Groups,
        references: AbstractSet[int],
    ) -> None:
        self._dummies, self._boundary, self._groups = dummies, boundary, groups
        self._references = references
        self._flat = boundary.flat
        self._titles: set[str] = set()
        self.supports: list[AnySupport] = []
        self.links: list[Link] = []

    def take(self, equation: DeckEquation) -> None:
        """Make of an equation what it is in the scene."""
        card, flat = equation.card, self._flat
        terms = _with_centres(flat, equation.terms)
        tracks = [self._track(equation, term) for term in terms]
        first = terms[0][0]
        if flat.used[first].all() and all(t is not None for t in tracks[1:]):
            factor = terms[0][2]
            nodes = flat.with_centres(first)
            references = [
                (int(n[0]), dof, np.full(len(nodes), -f / factor)) for n, dof, f in terms[1:]
            ]
            name = f"{card.home}.{equation.name}" if card.home else equation.name
            self.links.append(Link(card, name, nodes, terms[0][1], references))
            return
        size = max(len(nodes) for nodes, _, _ in terms)
        kept: list[Term] = []
        sides: list[tuple[Track, float]] = []
        for (nodes, dof, factor), track in zip(terms, tracks, strict=True):
            if flat.used[nodes].all():
                kept.append((nodes, dof, factor))
            elif flat.used[nodes].any() or len(nodes) > 1:
                card.fail(
                    f"a set of '{equation.name}' has nodes without elements; give such nodes one "
                    "by one"
                )
            elif track is not None:
                self._dummies[int(nodes[0])].prescribed.add(dof)
                sides.append((track, factor))
            else:
                self._put_dummy(equation, kept, int(nodes[0]), dof, factor)
        free = [k for k, t in enumerate(kept) if not flat.used[t[0]].all()]
        if free:
            kept = self._solve(equation, kept, free, sides, size)
        if kept:
            self._emit(equation, kept, sides)

    def _track(self, equation: DeckEquation, term: Term) -> Track | None:
        """What a single node does that is prescribed, None where it is free or a set."""
        nodes, dof, _ = term
        if len(nodes) != 1:
            return None
        node = int(nodes[0])
        if node in self._references and not self._flat.used[node]:
            equation.card.fail(
                "a term is the reference node of a coupling or rigid body; name a node of the set "
                "that follows it"
            )
        return self._boundary.motion(node, dof, equation.card, equation.name)

    def _put_dummy(
        self, equation: DeckEquation, kept: list[Term], node: int, dof: int, factor: float
    ) -> None:
        """Append a free dummy's term, or what it stands for."""
        means = self._dummies[node].means.get(dof)
        if means is None:
            kept.append((np.array([node], dtype=np.int64), dof, factor))
            return
        kept += [(np.array([n], dtype=np.int64), c, factor * f) for n, c, f in means]

    def _solve(
        self,
        equation: DeckEquation,
        kept: list[Term],
        free: list[int],
        sides: list[tuple[Track, float]],
        size: int,
    ) -> list[Term]:
        """Solve the first pair of nodes for a dummy; the equation is left for the other pairs."""
        card = equation.card
        if len(free) > 1 or any(not track.zero for track, _ in sides):
            card.fail(
                f"the equation of '{equation.name}' has several nodes without elements, of which "
                "one is free and another free or moved; let it have one, or none"
            )
        node, dof, factor = int(kept[free[0]][0][0]), kept[free[0]][1], kept[free[0]][2]
        others = [t for k, t in enumerate(kept) if k != free[0]]
        means = [(int(n[0]), c, -f / factor) for n, c, f in others]
        self._dummies[node].means[dof] = means
        if size == 1:
            return []  # it only says what the dummy does
        rest = [(n[1:] if len(n) > 1 else n, c, f) for n, c, f in others]
        return [
            *rest,
            *((np.array([n], dtype=np.int64), c, factor * f) for n, c, f in means),
        ]

    # -- in the scene --------------------------------------------------------------------

    def _emit(
        self, equation: DeckEquation, kept: list[Term], sides: list[tuple[Track, float]]
    ) -> None:
        """One equation for all pairs of nodes where positions match them, else one for each."""
        card, flat = equation.card, self._flat
        size = max(len(nodes) for nodes, _, _ in kept)
        kept = sorted(kept, key=lambda term: len(term[0]) < size)  # sets first
        options: dict[str, object] = {}
        if sides:
            track = combined([t for t, _ in sides], [-f for _, f in sides])
            value, amplitude = (0.0, None) if track.zero else track.amplitude()
            options["value"] = value
            if amplitude is not None:
                options["amplitude"] = amplitude
        several = [nodes for nodes, _, _ in kept if len(nodes) > 1]
        if all(_matches(flat, several[0], other) for other in several[1:]):
            self._add(equation, kept, options)
            return
        if size > _MOST_SINGLE:
            card.fail(
                f"the sets of the equation of '{equation.name}' have {size} nodes that do not "
                f"stand to each other alike; more than {_MOST_SINGLE} equations between single "
                "nodes are not available: let the sets be congruent"
            )
        for i in range(size):
            self._add(equation, [(n[i : i + 1] if len(n) > 1 else n, c, f) for n, c, f in kept],
                      options)  # fmt: skip

    def _add(self, equation: DeckEquation, kept: list[Term], options: dict[str, object]) -> None:
        terms = []
        for nodes, dof, factor in kept:
            group = self._groups.nodes(f"{equation.name} (equation)", nodes, words="nodes")
            terms.append((group, "xyz"[dof], factor))
        title, i = equation.name, 2
        while title.upper() in self._titles:
            title, i = f"{equation.name} {i}", i + 1
        self._titles.add(title.upper())
        self.supports.append(
            Equation(tuple(terms), name=title, **options)  # type: ignore[arg-type]
        )


def _with_centres(flat: Flat, terms: list[Term]) -> list[Term]:
    """Terms whose sets hold the centres added between their nodes, where they match each other."""
    first = terms[0][0]
    if not len(flat.parents) or len(first) == 1:
        return terms
    inside = flat.used[first].all()
    extra = np.setdiff1d(flat.with_centres(first), first) if inside else first[:0]
    out = []
    for nodes, dof, factor in terms:
        if len(nodes) > 1 and len(extra):
            mine = np.setdiff1d(flat.with_centres(nodes), nodes)
            if len(mine) != len(extra):
                return terms
            a = flat.points[extra] - flat.points[first].mean(axis=0)
            b = flat.points[mine] - flat.points[nodes].mean(axis=0)
            distance, found = cKDTree(b).query(a)
            if distance.max() > 1e-6 * float(np.ptp(a, axis=0).max()) or len(
                np.unique(found)
            ) != len(found):
                return terms
            nodes = np.concatenate([nodes, mine[found]])
        out.append((nodes, dof, factor))
    return out


def _matches(flat: Flat, one: Ints, other: Ints) -> bool:
    """Whether nodes of two sets that belong together stand at the same place in their sets."""
    a, b = flat.points[one], flat.points[other]
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    distance, found = cKDTree(b).query(a)
    near = distance.max(initial=0.0) <= 1e-6 * float(np.ptp(a, axis=0).max(initial=0.0))
    return bool(near and np.array_equal(found, np.arange(len(found))))


__all__ = ["DeckEquation", "Dummy", "equation_supports", "read_equations"]
