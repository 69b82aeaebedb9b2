"""``*TIE``: bonded interfaces without a criterion; slave nodes beyond the tolerance are free."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools
from fxcrack.deck.cards import Card, Row, key, label
from fxcrack.deck.everywhere import Everywhere
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.interface.definition import Interface

_REACH = 0.1
"""Tolerance over the median edge of the master's facets where the deck gives none."""
_ROUND_OFF = 1e-6
"""Part of the tolerance by which distances may differ."""
_TOGETHER = 4000
"""Triangles of the master that are looked at together."""


def tie(row: Row, flat: Flat, groups: Groups, *, explicit: bool) -> Interface:
    """The interface of a line of ``*TIE``.

    Args:
        row: The line.
        flat: The model.
        groups: Takes its surfaces.
        explicit: Whether the steps are explicit.

    Raises:
        DeckError: It is not complete, or no slave node reaches the master.
    """
    card = row.card
    slave, master = label(row.text(0)), label(row.text(1))
    if not slave or not master or key(slave) == key(master):
        row.fail("a tie needs two surfaces, slave and master")
    card.choose("TYPE", ("NODE TO SURFACE", "SURFACE TO SURFACE"), "SURFACE TO SURFACE")
    tolerance = card.number("POSITION TOLERANCE", 0.0) or None
    bonded, tolerance = _tied_nodes(row, (slave, master), flat, groups, tolerance)
    return Interface(
        groups.surface(card, slave, row.index, whole=False),
        groups.surface(card, master, row.index, whole=False),
        bonded=bonded,
        tolerance=tolerance,
        pairing=None if explicit else pairing_of(card),
        name=card.text("NAME", default=slave),
    )


def pairing_of(card: Card) -> str | None:
    """How nodes follow the master where the deck says so."""
    kinds = {"NODETOSURFACE": "node-to-surface", "SURFACETOSURFACE": "surface-to-surface"}
    return kinds[card.word("TYPE")] if card.has("TYPE") else None


def _tied_nodes(
    row: Row, names: tuple[str, str], flat: Flat, groups: Groups, tolerance: float | None
) -> tuple[Everywhere | str, float | None]:
    """All slave nodes, or the name of those that reach the master, and the search tolerance."""
    card, (slave, master) = row.card, names
    if flat.kind.shell:
        return Everywhere(True), tolerance
    nodes = np.unique(flat.surface(card, slave, row.index, whole=False))
    rows = flat.surface(card, master, row.index, whole=False)
    n = {"tetrahedron": 3, "hexahedron": 4}.get(flat.kind.cell, 2)
    facets = flat.points[rows[:, :n]]
    if tolerance is None:
        tolerance = _REACH * _size(facets)
    found = reached(flat.points[nodes], facets, tolerance)
    # the interface measures distances by itself, which round-off must not put beyond it
    tolerance *= 1.0 + 2.0 * _ROUND_OFF
    if not found.any():
        row.fail(
            "no slave node lies within the tolerance of the master surface; move the surfaces "
            "together, or give POSITION TOLERANCE"
        )
    if found.all():
        return Everywhere(True), tolerance
    log.warn(
        "%s: %d of %d slave nodes of '%s' lie beyond the tolerance of the master surface; they are "
        "not tied",
        card.place,
        int((~found).sum()),
        len(nodes),
        slave,
    )
    return groups.nodes(f"{slave} tied", nodes[found], words="nodes"), tolerance


def _size(facets: Array) -> float:
    """Median edge of facets, length; as that of the surfaces of interfaces."""
    corners = facets[:, [0, 1, 3, 2]] if facets.shape[1] == 4 else facets
    return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)))


def reached(x: Array, facets: Array, tolerance: float) -> Bools:
    """Which positions lie within a tolerance of some facets.

    Args:
        x: Positions, shape (n, 3), length.
        facets: Corners of the facets in the order of rows of facets, where the last corner of four
            lies across from the first, shape (n_facets, 2 to 4, 3), length.
        tolerance: Length.

    Returns:
        Shape (n,).
    """
    k = facets.shape[1]
    tolerance = (1.0 + _ROUND_OFF) * tolerance
    if k == 2:  # lines, as triangles without area
        triangles = facets[:, [0, 1, 1]]
    elif k == 3:
        triangles = facets
    else:
        triangles = np.concatenate([facets[:, [0, 1, 2]], facets[:, [1, 3, 2]]])
    centre = triangles.mean(axis=1)
    radius = np.linalg.norm(triangles - centre[:, None], axis=-1).max(axis=1)
    tree = cKDTree(x)
    out = np.zeros(len(x), dtype=bool)
    for first in range(0, len(triangles), _TOGETHER):
        part = slice(first, first + _TOGETHER)
        # all that a triangle may reach: among the nearest centres that of a large one may lack
        near = tree.query_ball_point(centre[part], radius[part] + tolerance)
        which = np.repeat(np.arange(len(near)), [len(found) for found in near])
        at = np.concatenate([np.zeros(0), *near]).astype(np.int64)
        out[at[_distance(x[at], triangles[part][which]) <= tolerance]] = True
    return out


def _distance(x: Array, triangles: Array) -> Array:
    """Distance of each position from a triangle of its own, shapes (n, 3), (n, 3, 3) to (n,)."""
    edges = np.full(len(x), np.inf)
    for i in range(3):
        a, b = triangles[:, i], triangles[:, (i + 1) % 3]
        t = b - a
        square = np.maximum(np.einsum("nc,nc->n", t, t), 1e-300)
        s = np.clip(np.einsum("nc,nc->n", x - a, t) / square, 0.0, 1.0)
        edges = np.minimum(edges, np.linalg.norm(x - a - s[:, None] * t, axis=1))
    a, b, c = triangles.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    has = length > 1e-12 * np.linalg.norm(b - a, axis=1) ** 2
    unit = normal / np.where(has, length, 1.0)[:, None]
    off = np.einsum("nc,nc->n", x - a, unit)
    foot = x - off[:, None] * unit
    inside = has.copy()
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("nc,nc->n", np.cross(q - p, foot - p), unit) >= 0.0
    return np.where(inside, np.abs(off), edges)


__all__ = ["pairing_of", "reached", "tie"]
