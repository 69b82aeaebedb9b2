"""Where labels of points go so that none covers another or a point: pure geometry in pixels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fxcrack.base.arrays import Array

Box = tuple[float, float, float, float]
"""Left, bottom, right, top."""

_ANGLES = np.radians(np.arange(0, 360, 15))
_PREFERRED = np.radians(215.0)  # below a falling front and left of it nothing else is drawn
_DISTANCES = (12.0, 20.0, 32.0, 48.0, 68.0, 92.0, 120.0, 160.0)
_CANDIDATES = sorted(
    (0.25 * distance + 4.0 * (1.0 - float(np.cos(angle - _PREFERRED))), distance, float(angle))
    for distance in _DISTANCES
    for angle in _ANGLES
)
"""How little each place beside an anchor is liked, distance, angle; the best first."""
_GAP = 3.0


def overlap(a: Box, b: Box) -> float:
    """Common area of two boxes."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return max(width, 0.0) * max(height, 0.0)


def place(
    anchors: Array,
    sizes: Sequence[tuple[float, float]],
    bounds: Box,
    *,
    points: Array | None = None,
    segments: Sequence[tuple[Array, Array]] = (),
    radius: float = 5.0,
    scale: float = 1.0,
) -> list[Box]:
    """Boxes for labels, one beside each anchor.

    Labels are placed one after the other, each where it covers no other label, no leader of
    another label and as few points and drawn lines as possible, near its anchor.

    Args:
        anchors: Points to be labelled, shape (n, 2).
        sizes: Width and height of each label.
        bounds: Where labels must stay.
        points: Other points to keep free, shape (m, 2).
        segments: Drawn lines, by their ends, that labels should not cover.
        radius: Half width of a point.
        scale: Factor on distances.
    """
    every = anchors if points is None or not len(points) else np.vstack([anchors, points])
    spots = [(x - radius, y - radius, x + radius, y + radius) for x, y in every]
    placed: list[Box] = []
    leaders: list[tuple[Array, Array]] = []
    for anchor, (width, height) in zip(anchors, sizes, strict=True):
        least, best = np.inf, (0.0, 0.0, 0.0, 0.0)
        for taste, distance, angle in _CANDIDATES:
            if taste >= least:
                break  # what comes now is no better even if it covers nothing
            box = _beside(anchor, width, height, angle, distance * scale)
            cost = taste + _trouble(box, anchor, bounds, placed, spots, leaders, segments)
            if cost < least:
                least, best = cost, box
        placed.append(best)
        leaders.append((np.asarray(anchor, dtype=float), nearest(best, anchor)))
    return placed


def nearest(box: Box, point: Array) -> Array:
    """The place on a box nearest to a point, shape (2,)."""
    return np.array([np.clip(point[0], box[0], box[2]), np.clip(point[1], box[1], box[3])])


def _beside(anchor: Array, width: float, height: float, angle: float, distance: float) -> Box:
    """A box whose near side or corner lies in a direction from the anchor."""
    dx, dy = np.cos(angle), np.sin(angle)
    x = anchor[0] + distance * dx + 0.5 * width * (dx if abs(dx) < 0.3 else np.sign(dx))
    y = anchor[1] + distance * dy + 0.5 * height * dy
    return (x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height)


def _trouble(
    box: Box,
    anchor: Array,
    bounds: Box,
    taken: Sequence[Box],
    spots: Sequence[Box],
    leaders: Sequence[tuple[Array, Array]],
    segments: Sequence[tuple[Array, Array]],
) -> float:
    """What a box would cover or cross, weighed."""
    wide = (box[0] - _GAP, box[1] - _GAP, box[2] + _GAP, box[3] + _GAP)
    area = (box[2] - box[0]) * (box[3] - box[1])
    trouble = 1e3 * (area - overlap(box, bounds)) / area
    trouble += sum(1e3 for other in taken if overlap(wide, other) > 0.0)
    trouble += sum(60.0 for spot in spots if overlap(box, spot) > 0.0)
    trouble += sum(25.0 for a, b in segments if _covers(box, a, b))
    leader = (np.asarray(anchor, dtype=float), nearest(box, anchor))
    for a, b in leaders:
        trouble += 200.0 * _cross(leader, (a, b)) + 300.0 * _hits(wide, a, b)
    return float(trouble + sum(300.0 for other in taken if _hits(other, *leader)))


def _hits(box: Box, a: Array, b: Array) -> bool:
    """Whether a segment enters a box."""
    for share in np.linspace(0.0, 1.0, 9):
        x, y = a + share * (b - a)
        if box[0] < x < box[2] and box[1] < y < box[3]:
            return True
    return False


def _covers(box: Box, a: Array, b: Array) -> bool:
    """Whether a segment along an axis lies partly in a box."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    return bool(low[0] < box[2] and high[0] > box[0] and low[1] < box[3] and high[1] > box[1])


def _cross(one: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    """Whether two segments cross."""

    def side(a: Array, b: Array, p: Array) -> float:
        return float((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]))

    (a, b), (c, d) = one, other
    return side(a, b, c) * side(a, b, d) < 0.0 and side(c, d, a) * side(c, d, b) < 0.0
