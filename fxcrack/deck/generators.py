"""Cards that make nodes and elements from others: NGEN, NFILL, NCOPY, ELGEN, ELCOPY."""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.deck.cards import Card, Row, key, label
from fxcrack.deck.spaces import Elements, Space

_MOST = 50_000_000
"""Nodes or elements that one card may make at most: a misprint must not fill the memory."""


def axis_rotation(a: Array, b: Array, degrees: float) -> Array:
    """Rotation about the axis from a to b, shape (3, 3).

    Args:
        a: Point on the axis, shape (3,), length.
        b: Another one.
        degrees: Angle, right-handed.
    """
    axis = (b - a) / np.linalg.norm(b - a)
    cross = np.cross(np.eye(3), axis)
    t = np.radians(degrees)
    return np.asarray(
        np.cos(t) * np.eye(3) + np.sin(t) * cross + (1 - np.cos(t)) * np.outer(axis, axis)
    )


def _members(row: Row, i: int, space: Space, kind: str) -> Ints:
    """Numbers that a field names: one number, or a set of this space."""
    text = row.text(i)
    if text.lstrip("+-").isdigit():
        return np.array([row.whole(i)], dtype=np.int64)
    sets = getattr(space, kind)
    if key(text) not in sets:
        row.fail(f"there is no set '{label(text)}' yet; define it before this card")
    return np.asarray(sets[key(text)].home)


def _at(row: Row, space: Space, labels: Ints) -> Array:
    """Positions of nodes that must exist, shape (n, 3)."""
    known, rows = space.nodes.look_up(labels)
    if not known.all():
        row.fail(f"node {int(labels[~known][0])} is not defined; define it before this card")
    return np.asarray(rows)


def _check_size(row: Row, count: int) -> None:
    if not 0 <= count <= _MOST:
        row.fail(f"this would make {count} entries; look at the numbers and increments")


def generate_nodes(card: Card, space: Space) -> None:
    """``*NGEN``: nodes on straight lines, or on arcs of circles with LINE=C, between two nodes."""
    curve = card.word("LINE", "S")
    if curve not in ("S", "C"):
        card.fail(f"LINE={curve} is not available; LINE=C (circle) and straight lines are")
    made = []
    for row in card.need_rows("first node, last node, increment"):
        first, last, step = row.whole(0), row.whole(1), row.whole(2, 1)
        if step == 0 or (last - first) % step or (last - first) // step < 1:
            row.fail(f"increment {step} does not lead from node {first} to node {last}")
        _check_size(row, (last - first) // step)
        labels = np.arange(first, last + (1 if step > 0 else -1), step, dtype=np.int64)
        a, b = _at(row, space, labels[[0, -1]])
        share = np.linspace(0.0, 1.0, len(labels))[1:-1, None]
        if curve == "C":
            inner = _on_arc(row, space, a, b, share[:, 0])
        else:
            inner = a + share * (b - a)
        space.nodes.add(labels[1:-1], inner)
        made.append(labels)
    if card.has("NSET"):
        space.add_to_set(card, "nsets", card.text("NSET"), np.concatenate(made))


def _on_arc(row: Row, space: Space, a: Array, b: Array, share: Array) -> Array:
    """Points on the arc of a circle from a to b, at shares of its angle, shape (n, 3)."""
    if row.text(3):
        centre = _at(row, space, np.array([row.whole(3)], dtype=np.int64))[0]
    else:
        centre = np.array([row.number(i, 0.0) for i in (4, 5, 6)])
    normal = np.array([row.number(i, 0.0) for i in (7, 8, 9)])
    u, v = a - centre, b - centre
    if not normal.any():
        normal = np.cross(u, v)
        if np.linalg.norm(normal) < 1e-9 * np.linalg.norm(u) * np.linalg.norm(v):
            row.fail("first node, last node and centre lie on a line; give the arc's normal")
    if not u.any():
        row.fail("the centre of the arc is its first node; give another centre")
    normal = normal / np.linalg.norm(normal)
    angle = np.arctan2(np.cross(u, v) @ normal, u @ v)
    angle = angle + 2.0 * np.pi if angle <= 0.0 else angle
    t = angle * share[:, None]
    radius = 1.0 + share[:, None] * (np.linalg.norm(v) / np.linalg.norm(u) - 1.0)
    return np.asarray(centre + radius * (np.cos(t) * u + np.sin(t) * np.cross(normal, u)))


def fill_nodes(card: Card, space: Space) -> None:
    """``*NFILL``: nodes on straight lines between the nodes of two sets.

    Nodes that the longer of the two sets has in excess are left alone.
    """
    if card.number("BIAS", 1.0) != 1.0:
        card.fail("BIAS is not available; give the nodes of uneven spacing themselves")
    made = []
    for row in card.need_rows("first set, second set, number of intervals, increment"):
        a, b = (_members(row, i, space, "nsets") for i in (0, 1))
        n, step = row.whole(2), row.whole(3, 1)
        if n < 1:
            row.fail(f"the number of intervals {n} must be 1 or more")
        a, b = a[: len(b)], b[: len(a)]
        _check_size(row, n * len(a))
        x, y = _at(row, space, a), _at(row, space, b)
        share = (np.arange(1, n) / n)[:, None, None]
        labels = a + step * np.arange(1, n)[:, None]
        if np.any(labels <= 0):
            row.fail(f"increment {step} leads to a node number that is not positive")
        space.nodes.add(labels.ravel(), (x + share * (y - x)).reshape(-1, 3))
        made += [a, labels.ravel(), b]
    if card.has("NSET"):
        space.add_to_set(card, "nsets", card.text("NSET"), np.concatenate(made))


def copy_nodes(card: Card, space: Space) -> None:
    """``*NCOPY``: shifted and rotated, or reflected copies of a set of nodes."""
    old = card.text("OLD SET")
    if old.upper() not in space.nsets:
        card.fail(f"there is no node set '{old}' yet; define it before this card")
    labels = space.nsets[old.upper()].home
    rows = card.need_rows("the translation or the points of the reflection")
    x = _at(rows[0], space, labels)
    change = int(card.number("CHANGE NUMBER", 0.0))
    times = int(card.number("MULTIPLE", 1.0))
    _check_size(rows[0], times * len(labels))
    made = []
    for i in range(1, times + 1):
        if card.has("REFLECT"):
            x = _reflected(card, rows, x)
        elif card.has("SHIFT"):
            x = _shifted(rows, x)
        else:
            card.fail("give SHIFT or REFLECT=LINE, MIRROR or POINT; others are not available")
        if np.any(labels + i * change <= 0):
            card.fail(f"CHANGE NUMBER={change} leads to a node number that is not positive")
        space.nodes.add(labels + i * change, x)
        made.append(labels + i * change)
    if card.has("NEW SET"):
        space.add_to_set(card, "nsets", card.text("NEW SET"), np.concatenate(made))


def _point(row: Row, start: int) -> Array:
    return np.array([row.number(start + i, 0.0) for i in range(3)])


def _shifted(rows: list[Row], x: Array) -> Array:
    out = x + _point(rows[0], 0)
    if len(rows) > 1:
        a, b, angle = _point(rows[1], 0), _point(rows[1], 3), rows[1].number(6, 0.0)
        if angle:
            if not (b - a).any():
                rows[1].fail("the two points of the axis are the same; give another one")
            out = a + (out - a) @ axis_rotation(a, b, angle).T
    return np.asarray(out)


def _reflected(card: Card, rows: list[Row], x: Array) -> Array:
    kind = card.choose("REFLECT", ("LINE", "MIRROR", "POINT"), "")
    a, b = _point(rows[0], 0), _point(rows[0], 3)
    if kind == "POINT":
        return np.asarray(2.0 * a - x)
    if kind == "LINE":
        axis = b - a
        if not axis.any():
            rows[0].fail("the two points of the line are the same; give another one")
        foot = a + np.outer((x - a) @ axis, axis) / (axis @ axis)
        return np.asarray(2.0 * foot - x)
    if len(rows) < 2:
        rows[0].fail("a mirror needs three points; give the third on the next line")
    normal = np.cross(b - a, _point(rows[1], 0) - a)
    if np.linalg.norm(normal) == 0.0:
        rows[0].fail("the three points of the mirror lie on a line; give another one")
    normal /= np.linalg.norm(normal)
    return np.asarray(x - 2.0 * np.outer((x - a) @ normal, normal))


def _find(row: Row, space: Space, element: int) -> tuple[Elements, Ints]:
    """The block of an element and its nodes."""
    for block in space.elements.values():
        known, rows = block.table.look_up(np.array([element]))
        if known[0]:
            return block, np.asarray(rows[0], dtype=np.int64)
    return row.fail(f"element {element} is not defined; define it before this card")


def generate_elements(card: Card, space: Space) -> None:
    """``*ELGEN``: rows, layers and columns of elements like a given one."""
    made = []
    for row in card.need_rows("element, number of elements, node increment, element increment"):
        element = row.whole(0)
        block, nodes = _find(row, space, element)
        labels, shifts = np.array([element]), np.array([0])
        for start in (1, 4, 7):
            n = row.whole(start, 1)
            of_node, of_element = row.whole(start + 1, 1), row.whole(start + 2, 1)
            _check_size(row, n * len(labels))
            if n < 1:
                row.fail(f"the number of elements {n} must be 1 or more")
            steps = np.arange(n)[:, None]
            labels = (labels + of_element * steps).ravel()
            shifts = (shifts + of_node * steps).ravel()
        rows = nodes + shifts[:, None]
        if labels.min() <= 0 or rows.min() <= 0:
            row.fail("the increments lead to a number that is not positive")
        block.table.add(labels, rows)
        made.append(labels)
    if card.has("ELSET"):
        space.add_to_set(card, "elsets", card.text("ELSET"), np.concatenate(made))


def copy_elements(card: Card, space: Space) -> None:
    """``*ELCOPY``: copies of a set of elements with shifted numbers."""
    old = card.text("OLD SET")
    if old.upper() not in space.elsets:
        card.fail(f"there is no element set '{old}' yet; define it before this card")
    wanted = space.elsets[old.upper()].home
    of_element = int(card.number("ELEMENT SHIFT", 0.0))
    of_node = int(card.number("SHIFT NODES", 0.0))
    for block in space.elements.values():
        known, found = block.table.look_up(wanted)
        labels, rows = wanted[known] + of_element, found[known] + of_node
        if len(labels):
            if labels.min() <= 0 or rows.min() <= 0:
                card.fail("the shifts lead to a number that is not positive")
            block.table.add(labels, rows)
    if card.has("NEW SET"):
        space.add_to_set(card, "elsets", card.text("NEW SET"), wanted + of_element)
