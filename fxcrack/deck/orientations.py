"""``*ORIENTATION``: axes of materials, element by element.

Rectangular axes are the same in all elements, unless a distribution or the nodes of the elements
give them. Cylindrical and spherical ones are those at the centre of an element: radial, tangential
and axial, or radial, circumferential and meridional.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.deck.cards import Card, Row, key, to_float
from fxcrack.deck.distributions import distributed, find_distribution, same_values
from fxcrack.deck.flat import Flat
from fxcrack.deck.numbering import Placed

_MOST = 64
"""Different axes of one section: each makes a material of its own, whose forms are compiled."""
_SYSTEMS = ("RECTANGULAR", "Z RECTANGULAR", "CYLINDRICAL", "SPHERICAL")
_PARALLEL = 1e-10
_SAME_ANGLE = 0.01
"""Difference of angles that are the same, degrees."""
_UPRIGHT = 0.1
"""Component along the normal that the axis of an orientation about which it turns must have."""


@dataclass(frozen=True, eq=False)
class Axes:
    """Axes of some cells.

    Attributes:
        rows: Axes 1, 2, 3 in global components, shape (3, 3).
        about: Number (from 0) of the axis that shells take for their normal; ``None`` where the
            deck does not name it.
        cells: The cells, shape (n,).
    """

    rows: Array
    about: int | None
    cells: Ints


def global_axes(placed: Placed, cells: Ints) -> list[Axes]:
    """The axes of a part without an orientation: those of its instance."""
    return [Axes(_clean(placed.space.rotation.T), None, cells)]


def read_axes(card: Card, cells: Ints, placed: Placed, flat: Flat) -> list[Axes]:
    """Axes of some cells by an orientation, one entry for all cells that have the same.

    Args:
        card: ``*ORIENTATION``.
        cells: The cells, shape (n,).
        placed: Their space.
        flat: The model.

    Raises:
        DeckError: The points do not give axes, or there are too many different ones.
    """
    system = card.choose("SYSTEM", _SYSTEMS, "RECTANGULAR")
    rows = card.need_rows("two points, or the name of a distribution")
    first = rows[0]
    second = rows[1] if len(rows) > 1 else None
    if system in ("CYLINDRICAL", "SPHERICAL"):
        axes = _curved(system, first, cells, placed, flat)
    else:
        axes = _rectangular(system, first, cells, placed, flat)
    axis = 0
    if second is not None:
        axis = second.whole(0, 1) - 1
        if not 0 <= axis <= 2:
            second.fail(f"there is no axis {axis + 1}; 1, 2 and 3 are")
        axes = _turned(axes, axis, _angles(second, cells, placed, flat))
    groups = same_values(axes.reshape(-1, 9))
    if len(groups) > _MOST:
        card.fail(
            f"it gives {len(groups)} different sets of axes in {len(cells)} elements; more than "
            f"{_MOST} are not available: divide the section into parts with axes of their own"
        )
    about = None if second is None else axis
    return [Axes(_clean(rows.reshape(3, 3)), about, cells[at]) for at, rows in groups]


def _clean(axes: Array) -> Array:
    out = np.array(axes)
    out[np.abs(out) < 1e-15] = 0.0
    return out


def _centres(cells: Ints, flat: Flat) -> Array:
    n = 3 if flat.kind.cell == "triangle" else 4 if flat.kind.cell != "hexahedron" else 8
    return np.asarray(flat.points[flat.cells[cells, :n]].mean(axis=1))


# -- rectangular -----------------------------------------------------------------------------------


def _rectangular(system: str, row: Row, cells: Ints, placed: Placed, flat: Flat) -> Array:
    """Axes by two points a, b and an origin c, shape (n_cells, 3, 3)."""
    a, b, c = _points(row, cells, placed, flat)
    x, y = a - c, b - c
    normal = np.cross(x, y)
    length = np.linalg.norm(normal, axis=1)
    if np.any(length <= _PARALLEL * np.linalg.norm(x, axis=1) * np.linalg.norm(y, axis=1)):
        row.fail("the two points and the origin lie on a line; give others")
    unit = x / np.linalg.norm(x, axis=1)[:, None]
    across = normal / length[:, None]
    if system == "RECTANGULAR":  # a lies on axis 1
        return np.stack([unit, np.cross(across, unit), across], axis=1)
    return np.stack([np.cross(across, unit), across, unit], axis=1)  # a lies on axis 3


def _points(row: Row, cells: Ints, placed: Placed, flat: Flat) -> tuple[Array, Array, Array]:
    """Points a, b and c of each cell in the model's place, shapes (n_cells, 3)."""
    card, n = row.card, len(cells)
    turn, shift = placed.space.rotation, placed.space.shift
    kinds = ("COORDINATES", "NODES", "OFFSET TO NODES")
    kind = card.choose("DEFINITION", kinds, "COORDINATES")
    if kind == "NODES":
        found = []
        for i in range(3):
            if not row.text(i) and i == 2:
                found.append(shift)  # the origin of the part
                continue
            labels = np.array([row.whole(i, what="a node")])
            at = placed.space.nodes.find(labels)
            if at[0] < 0:
                row.fail(f"node {labels[0]} does not exist")
            found.append(flat.points[placed.first_node + at[0]])
        a, b, c = (np.tile(p, (n, 1)) for p in found)
        return a, b, c
    if kind == "OFFSET TO NODES":
        corners = flat.cells[cells]
        local = [row.whole(i, 1 if i == 2 else None, what="a node of the element") for i in
                 range(3)]  # fmt: skip
        if not all(1 <= j <= flat.given_kind.n_nodes for j in local):
            row.fail(f"the elements have nodes 1 to {flat.given_kind.n_nodes}, not {local}")
        a, b, c = (flat.points[corners[:, j - 1]] for j in local)
        return a, b, c
    if row.text(0) and to_float(row.text(0)) is None:
        source = find_distribution(card, row.text(0), placed, flat)
        values = distributed(source, cells, 6, placed, flat)
        zero = np.zeros((n, 3))
        return values[:, :3] @ turn.T, values[:, 3:] @ turn.T, zero
    values = np.tile([row.number(i, 0.0) for i in range(9)], (n, 1))
    a, b, c = (values[:, 3 * i : 3 * i + 3] @ turn.T for i in range(3))
    return a, b, c


# -- cylindrical and spherical ---------------------------------------------------------------------


def _curved(system: str, row: Row, cells: Ints, placed: Placed, flat: Flat) -> Array:
    """Axes about a line or a point at the centres of the cells, shape (n_cells, 3, 3)."""
    card = row.card
    card.choose("DEFINITION", ("COORDINATES",), "COORDINATES")
    turn, shift = placed.space.rotation, placed.space.shift
    a, b = (
        turn @ np.array([row.number(3 * k + i, 0.0) for i in range(3)]) + shift for k in range(2)
    )
    axes = curved_axes(system, a, b, _centres(cells, flat))
    if axes is None:
        row.fail("two different points are needed, and no element may have its centre on the axis")
    return axes


def curved_axes(system: str, a: Array, b: Array, x: Array) -> Array | None:
    """Cylindrical or spherical axes at positions.

    Args:
        system: "CYLINDRICAL": a and b lie on the axis; "SPHERICAL": a is the centre, b lies on the
            polar axis.
        a: Shape (3,), length.
        b: Shape (3,), length.
        x: Positions, shape (n, 3), length.

    Returns:
        Axes 1, 2, 3 at each, rows in global components, shape (n, 3, 3); ``None`` where they have
        no direction.
    """
    pole, r = b - a, x - a
    size = float(np.linalg.norm(pole))
    if size == 0.0:
        return None
    pole = pole / size
    away = r - np.outer(r @ pole, pole)
    length = np.linalg.norm(away, axis=1)
    if np.any(length <= _PARALLEL * np.maximum(np.linalg.norm(r, axis=1), 1e-300)):
        return None
    radial = away / length[:, None]
    around = np.cross(pole, radial)
    if system == "CYLINDRICAL":
        return np.stack([radial, around, np.tile(pole, (len(x), 1))], axis=1)
    out = r / np.linalg.norm(r, axis=1)[:, None]
    return np.stack([out, around, np.cross(out, around)], axis=1)


# -- further rotation ------------------------------------------------------------------------------


def _angles(row: Row, cells: Ints, placed: Placed, flat: Flat) -> Array:
    """Angles of the second line, degrees, shape (n_cells,)."""
    text = row.text(1)
    if text and to_float(text) is None:
        source = find_distribution(row.card, text, placed, flat)
        return np.asarray(distributed(source, cells, 1, placed, flat)[:, 0])
    return np.full(len(cells), row.number(1, 0.0))


def _turned(axes: Array, about: int, angles: Array) -> Array:
    """Axes turned about one of them by the right-hand rule."""
    i, j = (about + 1) % 3, (about + 2) % 3
    c, s = np.cos(np.radians(angles)), np.sin(np.radians(angles))
    c = np.where(np.abs(c - np.round(c)) < 1e-15, np.round(c), c)[:, None]
    s = np.where(np.abs(s - np.round(s)) < 1e-15, np.round(s), s)[:, None]
    out = axes.copy()
    out[:, i], out[:, j] = c * axes[:, i] + s * axes[:, j], c * axes[:, j] - s * axes[:, i]
    return out


def ply_angle(
    row: Row, cells: Ints, axis: Array, normals: Array, placed: Placed, flat: Flat
) -> float:
    """Angle of a ply of a shell from the section's axis 1, degrees.

    Args:
        row: The line of the ply: an angle, or the name of an orientation.
        cells: The section's cells, ascending, shape (n,).
        axis: Direction that is projected on them as axis 1, shape (3,).
        normals: Their normals, shape (n, 3).
        placed: Their space.
        flat: The model.

    Raises:
        DeckError: There is no such orientation, or the angle differs from element to element.
    """
    text = row.text(3)
    if not text or to_float(text) is not None:
        return row.number(3, 0.0, what="the angle of the ply")
    found = find_orientation(row.card, text, placed, flat)
    angles: list[float] = []
    for part in read_axes(found, cells, placed, flat):
        n = normals[np.searchsorted(cells, part.cells)]
        other = section_direction(row.card, part, n)
        e, f = axis - (n @ axis)[:, None] * n, other - (n @ other)[:, None] * n
        side = np.einsum("ij,ij->i", np.cross(e, f), n)
        angles += np.degrees(np.arctan2(side, np.einsum("ij,ij->i", e, f))).tolist()
    if np.ptp(angles) > _SAME_ANGLE:
        row.fail(
            f"the axes of '{text}' stand to those of the section at angles from {min(angles):.3g} "
            f"to {max(angles):.3g} degrees; give parts of one angle sections of their own"
        )
    return round(float(np.mean(angles)), 9)


def section_direction(card: Card, axes: Axes, normals: Array) -> Array:
    """The axis that is projected on a shell as its material axis 1, shape (3,).

    Raises:
        DeckError: The axis that should be along the normal lies in the surface.
    """
    about = 0 if axes.about is None else axes.about
    if np.abs(normals @ axes.rows[about]).min() < _UPRIGHT:
        card.fail(
            f"axis {about + 1} of its *ORIENTATION lies in the surface; on the second data line of "
            "*ORIENTATION name the axis along the normal (for instance 3, 0.)"
        )
    return np.asarray(axes.rows[(about + 1) % 3])


def find_orientation(section: Card, name: str, placed: Placed, flat: Flat) -> Card:
    """The orientation of a name, of the part or of the whole deck.

    Raises:
        DeckError: There is none.
    """
    own, root = placed.space.orientations, flat.model.root.orientations
    card = own.get(key(name)) or root.get(key(name))
    if card is None:
        section.fail(f"there is no orientation '{name}'; define it by *ORIENTATION")
    return card


__all__ = [
    "Axes",
    "curved_axes",
    "find_orientation",
    "global_axes",
    "ply_angle",
    "read_axes",
    "section_direction",
]
