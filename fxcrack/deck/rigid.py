"""Sets of nodes that move with a reference node: kinematic couplings, rigid bodies, MPC BEAM."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.couplings import MOTIONS, Coupling
from fxcrack.continuum.loads import AmplitudeLike, Ramp
from fxcrack.deck.cards import Card, Row
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.deck.supports import AnySupport, Boundary, Link
from fxcrack.deck.tracks import Track

_TINY = 1e-9


@dataclass(frozen=True, eq=False)
class RigidSet:
    """Nodes that follow a reference node as a rigid body does, in some components.

    Attributes:
        card: The card it comes from.
        name: What it is called.
        nodes: The nodes, with the reference where that belongs to an element, shape (n,).
        dofs: Components that follow, 0 to 5.
        reference: The reference node.
        flat: The model.
    """

    card: Card
    name: str
    nodes: Ints
    dofs: frozenset[int]
    reference: int
    flat: Flat

    def _motions(self) -> tuple[Ints, Array]:
        """Component and node of each displacement that follows, and what it does in each motion.

        Shapes (n, 2), nodes by their place in :attr:`nodes`, and (n, 6).
        """
        flat = self.flat
        r = flat.points[self.nodes] - flat.points[self.reference]
        which, parts = [], []
        axes = np.eye(3)
        for c in sorted(d for d in self.dofs if d < flat.kind.gdim):
            turns = [np.cross(axes[i], r)[:, c] for i in range(3)]
            if flat.kind.gdim == 2:
                turns[:2] = [np.zeros(len(r))] * 2
            parts.append(np.column_stack([np.tile(axes[c], (len(r), 1)), *turns]))
            which.append(np.column_stack([np.full(len(r), c), np.arange(len(r))]))
        return np.concatenate(which), np.concatenate(parts)

    @property
    def moved_by(self) -> list[int]:
        """Components of the reference that move some node of the set."""
        return np.flatnonzero(np.abs(self._motions()[1]).max(axis=0) > 0.0).tolist()

    def forces(self, row: Row, force: Array, moment: Array, gdim: int) -> Array:
        """Forces on the nodes with the resultants of a load on the reference, shape (n, gdim).

        Args:
            row: The load, for messages.
            force: Shape (3,), force.
            moment: About the reference, shape (3,), force x length.
            gdim: Dimension of space.

        Raises:
            DeckError: The set does not follow the reference in a component of the load.
        """
        which, motions = self._motions()
        load = np.concatenate([force, moment])
        size = np.abs(motions).max(axis=0)
        scale = np.where(size > 0.0, size, 1.0)
        found = np.linalg.lstsq((motions / scale).T, load / scale, rcond=_TINY)[0]
        rest = motions.T @ found - load
        if np.abs(rest / scale).max() > 1e-8 * np.abs(load / scale).max():
            i = int(np.argmax(np.abs(rest / scale)))
            row.fail(
                f"'{self.name}' does not follow its reference node in component {i + 1}, so a load "
                "there moves nothing; couple that component, or load another one"
            )
        out = np.zeros((len(self.nodes), gdim))
        out[which[:, 1], which[:, 0]] = found
        return out

    def turns(self, force: Array, moment: Array) -> bool:
        """Rotations of a coupling are small: its forces need not turn with it."""
        return False

    def links(self) -> list[Link]:
        """The set as sums over components of the reference."""
        flat, links = self.flat, []
        nodes = self.nodes[self.nodes != self.reference]
        r = flat.points[nodes] - flat.points[self.reference]
        one, none = np.ones(len(nodes)), np.zeros(len(nodes))
        x, y, z = r.T
        turn: list[list[tuple[int, Array]]] = [
            [(4, z), (5, -y)], [(3, -z), (5, x)], [(3, y), (4, -x)],
        ]  # fmt: skip
        gdim = flat.kind.gdim
        for dof in sorted(d for d in self.dofs if d < gdim):
            terms = [(self.reference, dof, one)]
            for of_dof, arm in turn[dof]:
                if np.abs(arm).max(initial=0.0) > 0.0 and (gdim == 3 or of_dof == 5):
                    terms.append((self.reference, of_dof, arm if len(arm) else none))
            links.append(Link(self.card, self.name, nodes, dof, terms))
        if flat.kind.shell:
            links += [
                Link(self.card, self.name, nodes, d, [(self.reference, d, one)])
                for d in sorted(self.dofs)
                if d >= 3
            ]
        return links


def rigid_supports(
    sets: Sequence[RigidSet], boundary: Boundary, groups: Groups
) -> tuple[list[AnySupport], list[Link]]:
    """Couplings of sets with a reference that is free in part, and links of the others.

    Prescribed components of references that belong to elements are taken out of the boundary: the
    coupling prescribes them.

    Args:
        sets: The sets.
        boundary: What is prescribed.
        groups: Takes the groups of the sets.

    Raises:
        DeckError: A component is prescribed in some steps only, or several sets of one free
            reference follow it in different components.
    """
    out: list[AnySupport] = []
    links: list[Link] = []
    titles: set[str] = set()
    together: dict[int, list[RigidSet]] = {}
    for one in sets:
        together.setdefault(one.reference, []).append(one)
    for reference, members in together.items():
        first = members[0]
        flat = first.flat
        used = bool(flat.used[reference])
        involved = sorted({d for one in members for d in one.moved_by})
        if flat.kind.shell:
            involved = sorted({*involved, *(d for one in members for d in one.dofs if d >= 3)})
        tracks = {d: boundary.motion(reference, d, first.card, first.name) for d in involved}
        given = {d: track for d, track in tracks.items() if track is not None}
        if len(given) == len(involved) and not used:
            for one in members:
                links += one.links()
            continue
        if len({one.dofs for one in members}) > 1:
            members[1].card.fail(
                f"the reference node has another set, '{first.name}', that follows it in other "
                "components; where it is free, all its sets must follow in the same ones"
            )
        nodes = np.unique(np.concatenate([one.nodes for one in members]))
        if used:
            boundary.release(reference, [d for d in given if d in first.dofs])
        where = groups.support(first.card, first.name, nodes, words="constraint")
        title, i = first.name, 2
        while title.upper() in titles:
            title, i = f"{first.name} {i}", i + 1
        titles.add(title.upper())
        out += _couplings(first, where, title, given)
    return out, links


def _couplings(one: RigidSet, where: str, title: str, given: dict[int, Track]) -> list[AnySupport]:
    """A coupling for each amplitude of its prescribed motions; at least one."""
    gdim = one.flat.kind.gdim
    by: dict[str, tuple[AmplitudeLike, dict[str, float]]] = {}
    for dof, track in given.items():
        value, amplitude = (0.0, Ramp()) if track.zero else track.amplitude()
        by.setdefault(repr(amplitude), (amplitude, {}))[1][MOTIONS[dof]] = value
    point = tuple(one.flat.points[one.reference][:gdim].tolist())
    components = "".join("xyz"[d] for d in sorted(one.dofs) if d < gdim)
    return [
        Coupling(
            where,
            point,
            **motions,  # type: ignore[arg-type]
            components=components,
            rotations=bool(one.dofs & {3, 4, 5}),
            amplitude=amplitude,
            name=title,
        )
        for amplitude, motions in (list(by.values()) or [(Ramp(), {})])
    ]


__all__ = ["RigidSet", "rigid_supports"]
