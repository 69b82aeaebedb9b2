"""``*TRANSFORM``: nodes whose components are along axes of their own.

With the rows of R as these axes a node's own components are u' = R u. Of a node that is held in
some of them,

    sum_g R_lg u_g = u'_l    for the held l,

which is solved for as many global components; where all are held, or the axes are global ones in
another order, the global components themselves are prescribed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.continuum.couplings import Equation
from fxcrack.continuum.loads import Displacement
from fxcrack.deck.cards import Card, Row
from fxcrack.deck.distributions import same_values
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.deck.orientations import curved_axes
from fxcrack.deck.supports import AnySupport, Boundary
from fxcrack.deck.tracks import Track, combined

_ALIGNED = 1e-9
_AXES = "xyz"
_MOST_NODES = 2000
"""Nodes with different axes that are held in part: each needs an equation of its own."""


@dataclass(frozen=True, eq=False)
class Transforms:
    """Axes of nodes.

    Attributes:
        frames: Rows are the axes, shape (n_nodes, 3, 3).
        turned: Nodes that have axes of their own, shape (n_nodes,).
        owner: The card of each node, by number, -1 without, shape (n_nodes,).
        cards: The cards.
    """

    frames: Array
    turned: Bools
    owner: Ints
    cards: list[Card]

    def card_of(self, nodes: Ints) -> Card | None:
        """The card of the first of some nodes that has one."""
        found = self.owner[nodes]
        found = found[found >= 0]
        return self.cards[int(found[0])] if len(found) else None


def read_transforms(cards: Sequence[Card], flat: Flat) -> Transforms:
    """The axes of all nodes.

    Raises:
        DeckError: A card is not complete.
    """
    n = len(flat.points)
    owner = np.full(n, -1, dtype=np.int64)
    found = [card for card in cards if card.keyword == "TRANSFORM"]
    if not found:  # one frame stands for those of all nodes
        return Transforms(np.broadcast_to(np.eye(3), (n, 3, 3)), owner >= 0, owner, found)
    frames = np.tile(np.eye(3), (n, 1, 1))
    for number, card in enumerate(found):
        nodes = flat.with_centres(flat.nodes(card, card.text("NSET")))
        frames[nodes] = _frames(card, card.need_rows("two points")[0], nodes, flat)
        owner[nodes] = number
    frames[np.abs(frames) < 1e-15] = 0.0
    same = np.abs(frames - np.eye(3)).max(axis=(1, 2)) <= _ALIGNED
    owner[same] = -1
    return Transforms(frames, owner >= 0, owner, found)


def _frames(card: Card, row: Row, nodes: Ints, flat: Flat) -> Array:
    """Axes of some nodes, shape (n, 3, 3)."""
    placed = flat.placed.get(card.home)
    turn = np.eye(3) if placed is None else placed.space.rotation
    shift = np.zeros(3) if placed is None else placed.space.shift
    a, b = (np.array([row.number(3 * k + i, 0.0) for i in range(3)]) for k in range(2))
    kind = card.choose("TYPE", ("R", "C", "S"), "R")
    if kind == "R":
        normal = np.cross(a, b)
        if np.linalg.norm(normal) <= 1e-10 * np.linalg.norm(a) * np.linalg.norm(b):
            row.fail("the two points and the origin lie on a line; give others")
        one, three = a / np.linalg.norm(a), normal / np.linalg.norm(normal)
        axes = np.array([one, np.cross(three, one), three]) @ turn.T
        return np.tile(axes, (len(nodes), 1, 1))
    system = "CYLINDRICAL" if kind == "C" else "SPHERICAL"
    found = curved_axes(system, turn @ a + shift, turn @ b + shift, flat.points[nodes])
    if found is None:
        row.fail("two different points are needed, and no node may lie on the axis")
    return found


def turn_boundary(boundary: Boundary, transforms: Transforms, groups: Groups) -> list[AnySupport]:
    """Supports of nodes with axes of their own; those along global axes stay in the boundary.

    Args:
        boundary: What is prescribed; changed in place.
        transforms: The axes.
        groups: Takes the groups of the nodes.

    Raises:
        DeckError: A reference node or a rotation is held along axes that are not global ones, or
            a component is prescribed in some steps only.
    """
    owner = boundary.owner
    nodes = np.flatnonzero(transforms.turned & (owner >= 0).any(axis=(0, 1)))
    out: list[AnySupport] = []
    for at, values in same_values(transforms.frames[nodes].reshape(-1, 9)) if len(nodes) else []:
        axes, part = values.reshape(3, 3), nodes[at]
        aligned = np.abs(np.abs(axes).max(axis=1) - 1.0).max() <= _ALIGNED
        if aligned:
            _exchange(boundary, part, np.round(axes))
            continue
        columns, which = np.unique(
            owner[:, :, part].reshape(-1, len(part)), axis=1, return_inverse=True
        )
        for i in range(columns.shape[1]):
            of_dof = columns[:, i].reshape(-1, 6).astype(np.int64)
            out += _held(boundary, transforms, part[which.ravel() == i], of_dof, axes, groups)
    if len(out) > _MOST_NODES:
        transforms.cards[0].fail(
            f"{len(out)} supports along axes of their own are more than {_MOST_NODES}; hold fewer "
            "nodes, or in all components"
        )
    return out


def _exchange(boundary: Boundary, nodes: Ints, axes: Array) -> None:
    """Give components along global axes in another order, or backwards, to these."""
    before = boundary.owner[:, :, nodes].astype(np.int64)
    for half in (0, 3):
        for local in range(3):
            axis = int(np.argmax(np.abs(axes[local])))
            entries = before[:, half + local]
            if axes[local, axis] < 0.0:
                entries = _reversed(boundary, entries)
            boundary.owner[:, half + axis, nodes] = entries


def _reversed(boundary: Boundary, entries: Ints) -> Ints:
    """Entries with the opposite value."""
    out = entries.copy()
    for i in np.unique(entries[entries >= 0]).tolist():
        entry = boundary.entries[i]
        curve = entry.curve
        if curve is not None and curve.absolute:
            curve = replace(curve, values=-curve.values)
        boundary.entries.append(replace(entry, value=-entry.value, curve=curve))
        out[entries == i] = len(boundary.entries) - 1
    return out


def _held(
    boundary: Boundary,
    transforms: Transforms,
    nodes: Ints,
    owners: Ints,
    axes: Array,
    groups: Groups,
) -> list[AnySupport]:
    """Supports of nodes with the same axes and the same entries, shape (n_steps, 6)."""
    flat = boundary.flat
    gdim = flat.kind.gdim
    card = transforms.card_of(nodes)
    assert card is not None
    tracks: dict[int, Track] = {}
    for dof in range(6):
        if np.all(owners[:, dof] >= 0):
            tracks[dof] = boundary.track(owners[:, dof])
        elif np.any(owners[:, dof] >= 0):
            boundary.entries[int(owners[:, dof].max())].card.fail(
                f"component {dof + 1} is prescribed in some steps and free in others; fxcrack "
                "holds the same components in all steps"
            )
    still = [dof for dof, track in tracks.items() if track.zero]
    # what is zero in all components is so along any axes
    whole = all(d in still for d in range(gdim)), all(d in still for d in (3, 4, 5))
    turning = [d for d in tracks if d >= 3]
    relevant = flat.kind.shell or not flat.used[nodes].all()
    if turning and relevant and not whole[1]:
        card.fail("rotations along axes that are not global ones are held all three, or none")
    if whole[0]:
        return []
    if not flat.used[nodes].all():
        card.fail(
            "a reference node has axes that are not global ones; hold it in all components, or "
            "give it global axes"
        )
    boundary.owner[:, :3, nodes] = -1
    entry = boundary.entries[int(owners[:, :3].max())]
    held = [d for d in tracks if d < gdim]
    where = groups.support(entry.card, entry.name, nodes, words="part")
    # the held rows of the axes, solved for as many global components
    matrix, right = axes[held][:, :gdim].copy(), np.eye(len(held))
    pivots: list[int] = []
    for i in range(len(held)):
        free = [c for c in range(gdim) if c not in pivots]
        pivot = free[int(np.argmax(np.abs(matrix[i, free])))]
        right[i] /= matrix[i, pivot]
        matrix[i] /= matrix[i, pivot]
        for j in range(len(held)):
            if j != i:
                right[j] -= matrix[j, pivot] * right[i]
                matrix[j] = matrix[j] - matrix[j, pivot] * matrix[i]
        pivots.append(pivot)
    out: list[AnySupport] = []
    for i, pivot in enumerate(pivots):
        track = combined([tracks[d] for d in held], right[i].tolist())
        value, amplitude = (0.0, None) if track.zero else track.amplitude()
        options = {} if amplitude is None else {"amplitude": amplitude}
        others = [c for c in range(gdim) if c not in pivots and abs(matrix[i, c]) > _ALIGNED]
        if not others:
            out.append(Displacement(where, **{_AXES[pivot]: value}, **options))  # type: ignore[arg-type]
            continue
        terms = [
            (where, _AXES[pivot], 1.0),
            *((where, _AXES[c], float(matrix[i, c])) for c in others),
        ]
        name = f"{where}.{_AXES[pivot]}"
        out.append(Equation(tuple(terms), name=name, value=value, **options))
    return out


__all__ = ["Transforms", "read_transforms", "turn_boundary"]
