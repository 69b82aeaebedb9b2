"""Rigid surfaces of decks as masters: analytical ones, and flat ones of rigid elements.

A profile is drawn in a plane of its own (x, y) by straight lines and arcs; the bodies lie to its
left. In two dimensions that is the plane of the model; TYPE=CYLINDER draws it across generators,
TYPE=REVOLUTION in the half plane beside an axis, x being the distance from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array, Bools
from fxcrack.base.errors import InputError
from fxcrack.deck.cards import Card, DeckError, Row, squeeze
from fxcrack.deck.flat import Flat
from fxcrack.deck.rigid_elements import rigid_faces, rigid_labels
from fxcrack.deck.spaces import SurfaceDef
from fxcrack.deck.supports import Boundary
from fxcrack.interface.rigid import RigidCylinder, RigidPlane, RigidSphere

Surface = RigidPlane | RigidCylinder | RigidSphere
ANALYTICAL = ("SEGMENTS", "CYLINDER", "REVOLUTION")
"""Types of ``*SURFACE`` that are given by a profile."""
_SAME = 1e-6
"""Part of a profile's size within which points and lengths are the same."""
_OTHERS = (
    "planes, cylinders along the generators and spheres about the axis are available, which do not "
    "move; mesh a stiff body with the surface for others"
)


@dataclass(frozen=True, eq=False)
class _Piece:
    """A line or an arc of a profile.

    Attributes:
        row: Its data line.
        a: Beginning, shape (2,), length.
        b: End, shape (2,), length.
        centre: Of an arc, shape (2,); ``None`` of a line.
    """

    row: Row
    a: Array
    b: Array
    centre: Array | None

    @property
    def radius(self) -> float:
        """Of an arc."""
        assert self.centre is not None
        return float(np.linalg.norm(self.a - self.centre))

    @property
    def turns_left(self) -> bool:
        """Whether an arc runs counter-clockwise: its centre is on the side of the bodies."""
        assert self.centre is not None
        r, s = self.a - self.centre, self.b - self.centre
        return bool(r[0] * s[1] - r[1] * s[0] > 0.0)

    @property
    def normal(self) -> Array:
        """Of a line, to the side of the bodies, shape (2,)."""
        t = (self.b - self.a) / np.linalg.norm(self.b - self.a)
        return np.array([-t[1], t[0]])

    def same(self, other: _Piece, size: float) -> bool:
        """Whether two pieces lie on one line or circle, with the bodies on the same side."""
        if (self.centre is None) != (other.centre is None):
            return False
        if self.centre is None:
            off = abs(float(self.normal @ (other.a - self.a)))
            return bool(off <= _SAME * size and self.normal @ other.normal > 1.0 - _SAME)
        assert other.centre is not None
        apart = float(np.linalg.norm(self.centre - other.centre))
        unlike = abs(self.radius - other.radius)
        return max(apart, unlike) <= _SAME * size and self.turns_left == other.turns_left

    def distance(self, x: Array) -> Array:
        """Distances of points, shape (n, 2) to (n,), from the piece itself, not beyond its ends."""
        ends = np.minimum(np.linalg.norm(x - self.a, axis=1), np.linalg.norm(x - self.b, axis=1))
        if self.centre is None:
            inside = ~self.beyond(x, 0.0)
            return np.where(inside, np.abs((x - self.a) @ self.normal), ends)
        r, s, p = self.a - self.centre, self.b - self.centre, x - self.centre
        turn = 1.0 if self.turns_left else -1.0
        after = turn * (r[0] * p[:, 1] - r[1] * p[:, 0]) >= 0.0
        before = turn * (p[:, 0] * s[1] - p[:, 1] * s[0]) >= 0.0
        return np.where(after & before, np.abs(np.linalg.norm(p, axis=1) - self.radius), ends)

    def beyond(self, x: Array, slack: float) -> Bools:
        """Which points have their foot beyond the ends of a line by more than a length."""
        length = float(np.linalg.norm(self.b - self.a))
        along = (x - self.a) @ ((self.b - self.a) / length)
        return (along < -slack) | (along > length + slack)


class RigidSurfaces:
    """The rigid surfaces of a deck.

    Args:
        cards: Model data, ``*RIGID BODY`` among them.
        flat: The model.
    """

    def __init__(self, cards: Sequence[Card], flat: Flat) -> None:
        self._flat = flat
        self._bodies = [card for card in cards if card.keyword == "RIGIDBODY"]

    def has(self, where: Row) -> bool:
        """Whether the master of a contact pair is rigid."""
        try:
            place, found = self._flat.surface_def(where.card, where.text(1), where.index)
        except DeckError:
            return False  # what is wrong with it is said elsewhere
        if found.card.word("TYPE", "ELEMENT") in ANALYTICAL:
            return True
        if not any(placed.space.rigid for placed in self._flat.placed.values()):
            return False
        return bool(rigid_faces(self._flat, place, found)[1])

    def master(self, where: Row, slave: Array, boundary: Boundary) -> Surface:
        """The rigid master of a contact pair.

        Args:
            where: The line of the pair.
            slave: Positions of the slave nodes, shape (n, 3), length.
            boundary: What is prescribed.

        Raises:
            DeckError: It moves, is of another shape, or ends before the slave surface.
        """
        place, found = self._flat.surface_def(where.card, where.text(1), where.index)
        kind = found.card.word("TYPE", "ELEMENT")
        self._check_held(place, found, kind in ANALYTICAL, boundary)
        try:
            if kind in ANALYTICAL:
                return self._analytical(place, found, kind, slave)
            return self._meshed(place, found, slave)
        except InputError as error:
            if isinstance(error, DeckError):
                raise
            return found.card.fail(str(error))

    # -- its body ------------------------------------------------------------------------

    def _check_held(
        self, place: str, found: SurfaceDef, analytical: bool, boundary: Boundary
    ) -> None:
        """Refuse a rigid body that moves or is free."""
        flat = self._flat
        body = None
        for card in self._bodies:
            if analytical and card.has("ANALYTICAL SURFACE"):
                name = card.text("ANALYTICAL SURFACE")
                named = flat.surface_def(card, name, None)
                if named[1] is found and card.home in ("", place):
                    body = card
            elif not analytical and card.has("ELSET"):
                labels = rigid_labels(flat, card.home, card, card.text("ELSET"))
                if labels & rigid_faces(flat, place, found)[1]:
                    body = card
        if body is None:
            found.card.fail("no *RIGID BODY has this surface; add it, with a reference node")
        nodes = flat.nodes(body, body.text("REF NODE"))
        if len(nodes) != 1:
            body.fail(f"the reference '{body.text('REF NODE')}' holds {len(nodes)} nodes; give one")
        dofs = range(6) if flat.kind.gdim == 3 else (0, 1, 5)
        for dof in dofs:
            if flat.kind.model == "axisymmetric" and dof != 1:
                continue  # it can move along the axis only
            track = boundary.motion(int(nodes[0]), dof, body, body.text("REF NODE"))
            if track is None:
                body.fail(
                    f"component {dof + 1} of the reference node is free; rigid surfaces that move "
                    "are not available: hold it by *BOUNDARY (ENCASTRE), and load the other body"
                )
            if not track.zero:
                body.fail(
                    f"component {dof + 1} of the reference node is moved; rigid surfaces that move "
                    "are not available: hold it, and give the supports of the other body the "
                    "opposite motion"
                )

    # -- analytical ----------------------------------------------------------------------

    def _analytical(self, place: str, found: SurfaceDef, kind: str, slave: Array) -> Surface:
        card, flat = found.card, self._flat
        rows = card.need_rows("START, LINE, CIRCL")
        first = next((i for i, row in enumerate(rows) if squeeze(row.text(0)) == "START"), None)
        if first is None:
            card.fail("the profile needs a line START, x, y")
        points = [[row.number(i, 0.0) for i in range(6)] for row in rows[:first]]
        pieces = _pieces(rows[first:])
        if kind == "SEGMENTS" and (flat.kind.gdim == 3 or points):
            card.fail("TYPE=SEGMENTS is for two dimensions; use TYPE=CYLINDER or REVOLUTION")
        if kind != "SEGMENTS" and flat.kind.gdim == 2:
            card.fail(f"TYPE={kind} is for three dimensions; use TYPE=SEGMENTS")
        space = flat.placed[place].space
        axes, origin = _local_axes(card, kind, points)
        axes, origin = axes @ space.rotation.T, space.rotation @ origin + space.shift
        local = (slave - origin) @ axes.T
        if kind == "REVOLUTION":  # local: distance from the axis, along it
            local = np.column_stack((np.linalg.norm(local[:, (0, 2)], axis=1), local[:, 1]))
        else:
            local = local[:, :2]
        piece = _nearest(card, pieces, local)
        if piece.centre is None:
            self._check_ends(piece, pieces, local)
        if kind == "REVOLUTION":
            return _revolved(piece, axes, origin)
        return self._extruded(piece, axes, origin)

    @staticmethod
    def _check_ends(piece: _Piece, pieces: Sequence[_Piece], local: Array) -> None:
        """Refuse a line that ends before the slave surface: the plane would go on."""
        size = float(max(np.linalg.norm(p.b - p.a) for p in pieces))
        line = [p for p in pieces if piece.same(p, size)]
        beyond = np.all([p.beyond(local, _SAME * size) for p in line], axis=0)
        if np.any(beyond):
            piece.row.fail(
                f"the line ends before the slave surface, of which {int(beyond.sum())} nodes lie "
                "beyond; lengthen it, or take these nodes out of the slave surface"
            )

    def _extruded(self, piece: _Piece, axes: Array, origin: Array) -> Surface:
        """The surface of a piece of TYPE=SEGMENTS or CYLINDER."""

        def place(p: Array) -> tuple[float, float, float]:
            x, y, z = (origin + p @ axes[:2]).tolist()
            return x, y, z

        if piece.centre is None:
            nx, ny, nz = (piece.normal @ axes[:2]).tolist()
            return RigidPlane(place(piece.a), (nx, ny, nz))
        if self._flat.kind.model == "axisymmetric":
            centre = place(piece.centre)
            if abs(centre[0]) > _SAME * piece.radius:
                piece.row.fail(f"a circle beside the axis is a torus; {_OTHERS}")
            return RigidSphere((0.0, centre[1], 0.0), piece.radius, inside=piece.turns_left)
        dx, dy, dz = axes[2].tolist()
        return RigidCylinder(
            place(piece.centre), (dx, dy, dz), piece.radius, inside=piece.turns_left
        )

    # -- of elements ---------------------------------------------------------------------

    def _meshed(self, place: str, found: SurfaceDef, slave: Array) -> RigidPlane:
        """The plane on which all facets of a surface of rigid elements lie."""
        facets, _ = rigid_faces(self._flat, place, found)
        x = np.concatenate(facets)
        size = float(np.ptp(x, axis=0).max())
        normals = np.stack([_facet_normal(corners) for corners in facets])
        normal, point = normals[0], x[0]
        off = np.abs((x - point) @ normal).max()
        if off > _SAME * size or np.any(normals @ normal < 1.0 - _SAME):
            found.card.fail(
                f"the rigid elements do not lie on one plane, facing one way; {_OTHERS}"
            )
        slack = _SAME * size
        low, high = x.min(axis=0) - slack, x.max(axis=0) + slack
        foot = slave - ((slave - point) @ normal)[:, None] * normal
        beyond = np.any((foot < low) | (foot > high), axis=1)
        if np.any(beyond):
            found.card.fail(
                f"the rigid elements end before the slave surface, of which {int(beyond.sum())} "
                "nodes lie beyond; take these out of the slave surface, or add elements"
            )
        px, py, pz = point.tolist()
        nx, ny, nz = normal.tolist()
        return RigidPlane((px, py, pz), (nx, ny, nz))


def _facet_normal(corners: Array) -> Array:
    """Unit normal of a line, to its left, or of a facet seen counter-clockwise, shape (3,)."""
    if len(corners) == 2:
        along = corners[1] - corners[0]
        normal = np.array([-along[1], along[0], 0.0])
    else:
        normal = np.cross(corners[2] - corners[0], corners[-1] - corners[1])
        if len(corners) == 3:
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return np.asarray(normal / max(float(np.linalg.norm(normal)), 1e-300))


def _pieces(rows: Sequence[Row]) -> list[_Piece]:
    """The lines and arcs of a profile from its data lines, START first."""
    here = np.array([rows[0].number(1), rows[0].number(2)])
    out = []
    for row in rows[1:]:
        word = squeeze(row.text(0))
        if word not in ("LINE", "CIRCL"):
            row.fail(f"'{row.text(0)}' is not available in a profile; LINE and CIRCL are")
        end = np.array([row.number(1), row.number(2)])
        centre = None
        if word == "CIRCL":
            centre = np.array([row.number(3), row.number(4)])
            r, s = np.linalg.norm(here - centre), np.linalg.norm(end - centre)
            if not r > 0.0 or abs(r - s) > 1e-3 * r:
                row.fail(f"its ends are at different distances from the centre, {r:.6g}, {s:.6g}")
        if not np.linalg.norm(end - here) > 0.0:
            row.fail("it has no length")
        out.append(_Piece(row, here, end, centre))
        here = end
    if not out:
        rows[0].fail("a profile needs a line or an arc behind START")
    return out


def _nearest(card: Card, pieces: Sequence[_Piece], local: Array) -> _Piece:
    """The line or circle of a profile that all slave nodes are nearest to."""
    size = float(max(np.linalg.norm(p.b - p.a) for p in pieces))
    distance = np.stack([p.distance(local) for p in pieces], axis=1)
    least = distance.min(axis=1)
    for piece in pieces:
        alike = [i for i, p in enumerate(pieces) if piece.same(p, size)]
        if np.all(distance[:, alike].min(axis=1) <= least + _SAME * size):
            return piece
    return card.fail(
        "the slave surface faces several lines or arcs of the profile; give one rigid surface for "
        f"each, with its part of the slave surface; {_OTHERS}"
    )


def _local_axes(card: Card, kind: str, points: Sequence[Sequence[float]]) -> tuple[Array, Array]:
    """Axes of the plane of a profile and its normal, rows, shape (3, 3), and its origin.

    Of a surface of revolution the second axis is that of revolution.
    """
    given = np.zeros((2, 6))
    for i, numbers in enumerate(points[:2]):
        given[i] = numbers
    a, b, c = given[0, :3], given[0, 3:], given[1, :3]
    if kind == "SEGMENTS" or not len(points):
        return np.eye(3), np.zeros(3)
    along = b - a
    if not along.any():
        card.fail("the two points of its first data line are the same")
    along = along / np.linalg.norm(along)
    if kind == "REVOLUTION":
        other = np.eye(3)[int(np.argmin(np.abs(along)))]
        first = np.cross(other, along)
        first /= np.linalg.norm(first)
        return np.array([first, along, np.cross(first, along)]), a
    generator = c - a
    across = np.cross(along, generator)
    if len(points) < 2 or not np.linalg.norm(across) > 1e-10 * np.linalg.norm(generator):
        card.fail("its second data line needs a point on the generator beside the first axis")
    second = across / np.linalg.norm(across)
    return np.array([along, second, np.cross(along, second)]), a


def _revolved(piece: _Piece, axes: Array, origin: Array) -> Surface:
    """The surface of a piece of TYPE=REVOLUTION."""
    axis, side = axes[1], axes[0]
    if piece.centre is None:
        n = piece.normal
        x, y, z = (origin + piece.a[1] * axis).tolist()
        if abs(n[0]) <= _SAME:  # across the axis
            nx, ny, nz = (n[1] * axis).tolist()
            return RigidPlane((x, y, z), (nx, ny, nz))
        if abs(n[1]) <= _SAME:
            ax, ay, az = axis.tolist()
            return RigidCylinder((x, y, z), (ax, ay, az), float(piece.a[0]), inside=n[0] < 0.0)
        piece.row.fail(f"a line oblique to the axis is a cone; {_OTHERS}")
    if abs(piece.centre[0]) > _SAME * piece.radius:
        piece.row.fail(f"a circle beside the axis is a torus; {_OTHERS}")
    x, y, z = (origin + piece.centre[0] * side + piece.centre[1] * axis).tolist()
    return RigidSphere((x, y, z), piece.radius, inside=piece.turns_left)


__all__ = ["ANALYTICAL", "RigidSurfaces", "Surface"]
