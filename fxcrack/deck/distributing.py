"""``*COUPLING`` with ``*DISTRIBUTING``: loads on a reference node as forces on a surface.

    f_i = w_i (F + (T^-1 M) x r_i),    T = sum w_i (|r_i|^2 1 - r_i r_i^t)

with the weights w_i (their sum is 1), r_i from the weighted centre of the nodes, and M the moment
about that centre. These forces have the resultant F and the moment M, and do the work of F and M on
the weighted mean motion of the surface.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.couplings import MOTIONS, Coupling
from fxcrack.continuum.loads import AmplitudeLike, Ramp
from fxcrack.deck.cards import Card, Row
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.deck.supports import AnySupport, Boundary
from fxcrack.deck.thermal import NodalField

_LINE = 1e-10


@dataclass(frozen=True, eq=False)
class Distributing:
    """A reference node whose loads are distributed.

    Attributes:
        card: Its ``*COUPLING``.
        name: What it is called.
        reference: The node.
        nodes: Nodes of the surface, shape (n,).
        weights: Their weights, shape (n,).
        arms: From the weighted centre to the nodes, shape (n, 3), length.
        lever: From the centre to the reference node, shape (3,), length.
    """

    card: Card
    name: str
    reference: int
    nodes: Ints
    weights: Array
    arms: Array
    lever: Array

    def forces(self, row: Row, force: Array, moment: Array, gdim: int) -> Array:
        """Forces on the nodes, shape (n, gdim).

        Args:
            row: The load, for messages.
            force: On the reference node, shape (3,), force.
            moment: On the reference node, shape (3,), force x length.
            gdim: Dimension of space.

        Raises:
            DeckError: The nodes lie on a line about which the load turns.
        """
        about = moment + np.cross(self.lever, force)
        r, w = self.arms, self.weights
        inertia = np.eye(3) * (w @ (r * r).sum(axis=1)) - np.einsum("i,ij,ik->jk", w, r, r)
        values, axes = np.linalg.eigh(inertia)
        stiff = values > _LINE * max(values[-1], 1e-300)
        parts = axes.T @ about
        if np.abs(parts[~stiff]).max(initial=0.0) > 1e-9 * np.linalg.norm(about):
            row.fail(
                f"the nodes of coupling '{self.name}' lie on a line or at a point, about which no "
                "moment can be distributed; couple a surface"
            )
        turn = axes[:, stiff] @ (parts[stiff] / values[stiff])
        return np.asarray((w[:, None] * (force + np.cross(turn, r)))[:, :gdim])

    def turns(self, force: Array, moment: Array) -> bool:
        """Whether a load has a moment about the centre of the nodes."""
        about = moment + np.cross(self.lever, force)
        size = np.linalg.norm(moment) + np.linalg.norm(self.arms, axis=1).max() * np.linalg.norm(
            force
        )
        return bool(np.linalg.norm(about) > 1e-9 * size)


def distributing(coupling: Card, card: Card, reference: int, flat: Flat) -> Distributing:
    """The coupling of two cards.

    Args:
        coupling: ``*COUPLING``.
        card: ``*DISTRIBUTING``, directly after it.
        reference: The reference node.
        flat: The model.

    Raises:
        DeckError: It releases components, or has weights that are not available.
    """
    card.choose("WEIGHTING METHOD", ("UNIFORM",), "UNIFORM")
    given: set[int] = set()
    for row in card.rows():
        first = row.whole(0, 1)
        given |= set(range(first, row.whole(1, first) + 1))
    all_of = {1, 2, 6} if flat.kind.gdim == 2 else {1, 2, 3, 4, 5, 6}
    if given and not all_of <= given:
        card.fail("a coupling that releases components is not available; give 1, 6 or leave it out")
    if flat.kind.model == "axisymmetric":
        card.fail("it is not available in axisymmetric models; load the surface by *DSLOAD")
    name = coupling.text("SURFACE")
    nodes = influenced(coupling, flat, reference, flat.surface_nodes(coupling, name))
    nodes = nodes[(nodes != reference) & flat.used[nodes] & (nodes < flat.n_given)]
    if not len(nodes):
        coupling.fail(f"no element has a node of surface '{name}'; couple a surface of the body")
    weights = _areas(flat, coupling, name, nodes)
    x = flat.points[nodes]
    centre = weights @ x
    title = coupling.text("CONSTRAINT NAME", default=name)
    title = f"{coupling.home}.{title}" if coupling.home else title
    lever = flat.points[reference] - centre
    return Distributing(coupling, title, reference, nodes, weights, x - centre, lever)


def influenced(coupling: Card, flat: Flat, reference: int, nodes: Ints) -> Ints:
    """Nodes of a coupling's surface within INFLUENCE RADIUS of its reference, all without.

    Raises:
        DeckError: There is none.
    """
    if not coupling.has("INFLUENCE RADIUS"):
        return nodes
    radius = coupling.number("INFLUENCE RADIUS", 0.0)
    away = np.linalg.norm(flat.points[nodes] - flat.points[reference], axis=1)
    near: Ints = nodes[away <= radius]
    if not len(near):
        coupling.fail(
            f"no node of the surface lies within INFLUENCE RADIUS={radius:g} of the reference, the "
            f"nearest is {away.min(initial=np.inf):.4g} away"
        )
    return near


def _areas(flat: Flat, card: Card, name: str, nodes: Ints) -> Array:
    """Shares of the area of the surface that belong to the nodes; equal ones where it has none."""
    if flat.kind.shell or flat.surface_is_nodes(card, name):
        return np.full(len(nodes), 1.0 / len(nodes))
    rows = flat.surface(card, name)
    n_corners = 2 if flat.kind.tdim == 2 else (3 if flat.kind.cell == "tetrahedron" else 4)
    x = flat.points[rows[:, :n_corners]]
    if n_corners == 2:
        area = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    elif n_corners == 3:
        area = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    else:  # corners in the order of a tensor product
        area = np.linalg.norm(np.cross(x[:, 3] - x[:, 0], x[:, 2] - x[:, 1]), axis=1)
    share = np.zeros(len(flat.points))
    inside = np.isin(rows, nodes)
    per_node = area / inside.sum(axis=1)
    np.add.at(share, rows[inside], np.broadcast_to(per_node[:, None], rows.shape)[inside])
    return np.asarray(share[nodes] / share[nodes].sum())


def mean_supports(
    found: Iterable[Distributing], boundary: Boundary, groups: Groups
) -> list[AnySupport]:
    """Prescribed motions of references as those of the weighted mean of their surfaces.

    Args:
        found: The couplings.
        boundary: What is prescribed.
        groups: Takes the groups of their nodes.

    Raises:
        DeckError: A component is prescribed in some steps only.
    """
    out: list[AnySupport] = []
    flat = boundary.flat
    gdim = flat.kind.gdim
    for one in found:
        by: dict[str, tuple[AmplitudeLike, dict[str, float]]] = {}
        for dof in (0, 1, 5) if gdim == 2 else range(6):
            track = boundary.motion(one.reference, dof, one.card, one.name)
            if track is not None:
                value, amplitude = (0.0, Ramp()) if track.zero else track.amplitude()
                by.setdefault(repr(amplitude), (amplitude, {}))[1][MOTIONS[dof]] = value
        if not by:
            continue
        if flat.used[one.reference]:
            one.card.fail(
                "the reference node belongs to elements and is prescribed; take a node without "
                "elements as the reference"
            )
        where = groups.nodes(one.name, one.nodes, words="coupling")
        weight = NodalField(flat.points[one.nodes][:, :gdim], one.weights)
        point = tuple(flat.points[one.reference][:gdim].tolist())
        out += [
            Coupling(
                where, point, **motions, rotations=False, mean=True, weight=weight,  # type: ignore[arg-type]
                amplitude=amplitude, name=one.name,
            )
            for amplitude, motions in by.values()
        ]  # fmt: skip
    return out


def by_reference(found: Sequence[Distributing]) -> dict[int, Distributing]:
    """Couplings by their reference nodes.

    Raises:
        DeckError: A node is the reference of two.
    """
    out: dict[int, Distributing] = {}
    for coupling in found:
        if coupling.reference in out:
            coupling.card.fail("its reference node has another distributing coupling already")
        out[coupling.reference] = coupling
    return out


__all__ = ["Distributing", "by_reference", "distributing", "influenced", "mean_supports"]
