"""Loads of a deck: concentrated forces, pressures, tractions, body forces, gravity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.amplitudes import AmplitudeLike
from fxcrack.continuum.face import Face
from fxcrack.continuum.loads import (
    BodyForce,
    Field,
    Load,
    PointForce,
    PointMoment,
    Pressure,
    Traction,
)
from fxcrack.deck.cards import Card, Row, fresh_cards, key, label, squeeze
from fxcrack.deck.constraints import Carrier
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.deck.joined_pairs import facet_normals
from fxcrack.deck.load_fields import Centrifugal, Hydrostatic
from fxcrack.deck.report import Report
from fxcrack.deck.thermal import NodalField
from fxcrack.deck.tracks import Amplitudes, Curve, Period, Track
from fxcrack.deck.transforms import Transforms

_BODY = {"BX": 0, "BY": 1, "BZ": 2}
_FLAT = 1e-6
"""Difference of unit normals that are the same."""
_KINDS = ("CLOAD", "DLOAD", "DSLOAD")


@dataclass(eq=False)
class LoadEntry:
    """A load with its history.

    Attributes:
        row: The line that defined it last.
        kind: Keyword of its card.
        name: Of the set or surface, empty for the whole model.
        type: P, BX, GRAV, TRVEC, ... or the component of a force.
        direction: Of gravity and tractions; of the axis of a rotation.
        point: A point of that axis.
        zero: Coordinates at which a hydrostatic pressure is 0 and has its value.
        track: What it does.
        value: Present reference value.
        curve: Present amplitude.
        follows: Whether it stays normal to the deformed surface.
    """

    row: Row
    kind: str
    name: str
    type: str
    direction: tuple[float, ...] = ()
    point: tuple[float, ...] = ()
    zero: tuple[float, float] = (0.0, 0.0)
    track: Track = field(default_factory=Track)
    value: float = 0.0
    curve: Curve | None = None
    follows: bool = False


class Loads:
    """The loads of all steps.

    Args:
        flat: The model.
        amplitudes: Its amplitudes.
        report: Takes notes.
        finite: Whether bodies turn far (NLGEOM).
        carriers: What carries the loads of reference nodes and nodes of equations, by node.
        transforms: Axes of nodes, along which their forces are.
    """

    def __init__(
        self,
        flat: Flat,
        amplitudes: Amplitudes,
        report: Report,
        *,
        finite: bool,
        carriers: Mapping[int, Carrier],
        transforms: Transforms,
    ) -> None:
        self._flat = flat
        self._transforms = transforms
        self._amplitudes = amplitudes
        self._report = report
        self._finite = finite
        self._carriers = carriers
        self._entries: dict[tuple[str, ...], LoadEntry] = {}
        self._past: list[Period] = []

    def take(self, cards: Sequence[Card], period: Period) -> None:
        """Read the load cards of a step and follow every load over it.

        Raises:
            DeckError: A line cannot be read.
        """
        moved: set[tuple[str, ...]] = set()
        for kind in _KINDS:
            chosen = [card for card in cards if card.keyword == kind]
            fresh = fresh_cards(chosen)
            if fresh:
                for mark, entry in self._entries.items():
                    if entry.kind == kind:
                        entry.value, entry.curve = 0.0, None
                        moved.add(mark)
            given: set[tuple[str, ...]] = set()
            for card in chosen:
                curve = self._amplitudes.of(card)
                if card not in fresh:
                    card.need_rows("node, element set or surface, type, value")
                for row in card.rows():
                    mark, value = self._read(row)
                    entry = self._entries[mark]
                    self._check_levels(row, entry, given)
                    if mark in given:
                        if entry.curve is not curve:
                            row.fail("the same load with two amplitudes in one step; give one")
                        value += entry.value
                        self._report.replace(f"the loads on '{entry.name}' are added", card)
                    entry.row, entry.value, entry.curve = row, value, curve
                    given.add(mark)
            moved |= given
        for mark, entry in self._entries.items():
            if mark in moved or (entry.curve is not None and entry.curve.total):
                entry.track.move(period, entry.value, entry.curve)
            else:
                entry.track.hold(period)
        self._past.append(period)

    def _check_levels(self, row: Row, entry: LoadEntry, given: set[tuple[str, ...]]) -> None:
        """Refuse a hydrostatic pressure whose levels change while it acts.

        Args:
            row: The line.
            entry: Its load.
            given: Loads of this step so far.
        """
        if entry.type[:2] != "HP":
            return
        for mark, other in self._entries.items():
            alike = (other.kind, key(other.name), other.type) == (
                entry.kind, key(entry.name), entry.type,
            )  # fmt: skip
            if alike and other is not entry and other.value != 0.0 and mark not in given:
                row.fail(
                    f"the hydrostatic pressure on '{entry.name}' has the levels "
                    f"{other.zero[0]:g} and {other.zero[1]:g} from a step before; to change them "
                    f"give OP=NEW on all *{entry.kind} cards of this step, and in them every load "
                    "that goes on"
                )

    def _read(self, row: Row) -> tuple[tuple[str, ...], float]:
        """The load that a line means, and its reference value."""
        card = row.card
        if card.keyword == "CLOAD":
            return self._force(row)
        name, word = row.text(0), squeeze(row.text(1))
        if word[-2:] == "NU":
            row.fail(f"load type {word} needs a user subroutine; give its values")
        entry = LoadEntry(row, card.keyword, label(name), word)
        follower = card.word("FOLLOWER", "YES")
        if card.keyword == "DSLOAD" and word not in ("P", "TRVEC", "TRSHR", "HP"):
            row.fail(
                f"load type {row.text(1)} is not available on surfaces; P, HP, TRVEC and TRSHR are"
            )
        if word in ("P", "HP") or (word[:1] == "P" and word[1:].isdigit()) or (
            word[:2] == "HP" and word[2:].isdigit()
        ):  # fmt: skip
            if card.keyword == "DLOAD" and (word in ("P", "HP")) != self._flat.kind.shell:
                row.fail(
                    "load type P needs the face of solid elements: P1, P2, ...; shells have P and "
                    "HP alone"
                )
            entry.follows = self._finite and not (self._flat.kind.shell and follower == "NO")
            if word[:2] == "HP":
                entry.zero = (row.number(3), row.number(4))
                if entry.zero[0] == entry.zero[1]:
                    row.fail("the two levels of a hydrostatic pressure are the same")
        elif word in ("TRVEC", "TRSHR"):
            entry.direction = self._direction(row, 3)
            if word == "TRSHR":
                entry.direction = self._along_surface(row, entry.direction)
            if self._finite and follower == "YES":
                row.fail("a traction that turns with the body is not available; add FOLLOWER=NO")
            if self._finite and card.word("CONSTANT RESULTANT", "NO") not in ("", "YES"):
                self._report.replace(
                    "the traction is per area of the undeformed surface (CONSTANT RESULTANT=YES)",
                    card,
                )
        elif word == "GRAV":
            entry.direction = self._direction(row, 3)
        elif word in ("CENTRIF", "CENT"):
            entry.point, entry.direction = self._axis_of_rotation(row)
            if self._finite:
                self._report.replace("the centrifugal force is that of the undeformed bodies", card)
        elif word not in _BODY or _BODY[word] >= self._flat.kind.gdim:
            row.fail(
                f"load type {row.text(1)} is not available; P1 to P6, HP1 to HP6, BX, BY, BZ, "
                "GRAV, CENTRIF and CENT are"
            )
        mark = (
            card.keyword,
            key(name),
            word,
            *(f"{d:.12g}" for d in (*entry.direction, *entry.point)),
            *(f"{level:.12g}" for level in entry.zero if word[:2] == "HP"),
        )
        self._entries.setdefault(mark, self._started(entry))
        return mark, row.number(2)

    def _direction(self, row: Row, start: int) -> tuple[float, ...]:
        found = np.array([row.number(start + i, 0.0) for i in range(3)])
        if not found.any():
            row.fail("the direction of the load is missing; give its components")
        return tuple(float(c) for c in found / np.linalg.norm(found))

    def _along_surface(self, row: Row, direction: tuple[float, ...]) -> tuple[float, ...]:
        """The direction of a shear traction: the given one, projected on a flat surface."""
        flat = self._flat
        if flat.kind.shell:
            row.fail("TRSHR is not available on shells; give TRVEC with a direction along them")
        rows = flat.surface(row.card, row.text(0), row.index)
        normals = facet_normals(flat, rows)
        along = np.array(direction) - normals * (normals @ np.array(direction))[:, None]
        if np.abs(np.abs(normals @ normals[0]) - 1.0).max() > _FLAT:
            row.fail("TRSHR is available on flat surfaces; divide it into flat ones, or give TRVEC")
        size = float(np.linalg.norm(along[0]))
        if size <= _FLAT:
            row.fail("the direction is that of the normal; give one along the surface")
        return tuple((along[0] / size).tolist())

    def _axis_of_rotation(self, row: Row) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """A point of the axis and its direction; in a plane z, of bodies of revolution y."""
        if self._flat.kind.model == "axisymmetric":
            return (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
        point = tuple(row.number(3 + i, 0.0) for i in range(3))
        if self._flat.kind.gdim == 2 and not any(row.text(i) for i in (6, 7, 8)):
            return point, (0.0, 0.0, 1.0)
        return point, self._direction(row, 6)

    def _force(self, row: Row) -> tuple[tuple[str, ...], float]:
        if row.card.has("FOLLOWER"):
            row.fail("forces that turn with the body are not available")
        dof = row.whole(1)
        nodes = self._flat.nodes(row.card, row.text(0), row.index)
        if len(nodes) == 1 and int(nodes[0]) in self._carriers:
            if dof not in ((1, 2, 6) if self._flat.kind.gdim == 2 else (1, 2, 3, 4, 5, 6)):
                row.fail(f"component {dof} of a load on a reference node is not available")
            return self._force_entry(row, dof)
        if not 1 <= dof <= (6 if self._flat.kind.shell else self._flat.kind.gdim):
            row.fail(
                f"component {dof} of a force is not available on {self._flat.kind.name} elements, "
                f"whose nodes have {self._flat.kind.gdim} displacements and no rotations"
            )
        if not self._flat.used[nodes].all():
            row.fail(
                f"'{row.text(0)}' has a node without elements, on which no force can act; load the "
                "nodes of the body"
            )
        return self._force_entry(row, dof)

    def _force_entry(self, row: Row, dof: int) -> tuple[tuple[str, ...], float]:
        mark = ("CLOAD", key(row.text(0)), str(dof))
        entry = LoadEntry(row, "CLOAD", label(row.text(0)), str(dof))
        self._entries.setdefault(mark, self._started(entry))
        return mark, row.number(2)

    def _started(self, entry: LoadEntry) -> LoadEntry:
        """The entry, its track 0 in the steps before it was defined."""
        for period in self._past:
            entry.track.hold(period)
        return entry

    @property
    def following(self) -> LoadEntry | None:
        """A pressure that follows the bodies, None without."""
        entries = self._entries.values()
        return next((e for e in entries if e.follows and not e.track.zero), None)

    def loads(self, groups: Groups, densities: dict[str, float | None]) -> list[Load]:
        """The loads of the scene.

        Args:
            groups: Takes the groups they act on.
            densities: Mass per volume of the cells of each section.

        Raises:
            DeckError: A load has no place, or gravity acts on a body without density.
        """
        out: list[Load] = []
        titles: set[str] = set()
        forces = self._forces(groups, titles)
        for entry in self._entries.values():
            if entry.kind != "CLOAD" and not entry.track.zero:
                out += self._of(entry, groups, densities, titles)
        return forces + out

    def _forces(self, groups: Groups, titles: set[str]) -> list[Load]:
        """Concentrated forces: one load for all components of a set that follow one amplitude."""
        found: dict[tuple[str, str], tuple[LoadEntry, AmplitudeLike, Array]] = {}
        for entry in self._entries.values():
            if entry.kind == "CLOAD" and not entry.track.zero:
                value, amplitude = entry.track.amplitude()
                mark = (entry.name, repr(amplitude))
                zero = np.zeros(6)
                force = found.setdefault(mark, (entry, amplitude, zero))[2]
                force[int(entry.type) - 1] += value
        out: list[Load] = []
        for (name, _), (entry, amplitude, force) in found.items():
            nodes = self._flat.nodes(entry.row.card, name, entry.row.index)
            if len(nodes) == 1 and int(nodes[0]) in self._carriers:
                carrier = self._carriers[int(nodes[0])]
                title = _new(name, titles)
                out.append(self._distribute(carrier, entry, amplitude, force, groups, title))
                continue
            where = groups.nodes(name, nodes, words="nodes of the deck")
            alone = sum(1 for other, _ in found if other == name) == 1
            if self._transforms.turned[nodes].any():
                axes = "".join("123456"[i] for i in np.flatnonzero(force))
                title = _new(name if alone else f"{name}.{axes}", titles)
                out.append(self._along_own_axes(entry, amplitude, force, nodes, where, title))
                continue
            moment, force = force[3:], force[: self._flat.kind.gdim]
            axes = "".join("xyz"[i] for i in np.flatnonzero(force))
            title = _new(name if alone else f"{name}.{axes}", titles)
            if axes:
                total = tuple((force * len(nodes)).tolist())
                out.append(PointForce(where, total, amplitude, title))
            if moment.any():
                total = tuple((moment * len(nodes)).tolist())
                out.append(PointMoment(where, total, amplitude, f"{title}.moment"))
        return out

    def _distribute(
        self,
        carrier: Carrier,
        entry: LoadEntry,
        amplitude: AmplitudeLike,
        load: Array,
        groups: Groups,
        title: str,
    ) -> Load:
        """A load on the reference node as forces on the nodes of its surface."""
        flat, gdim = self._flat, self._flat.kind.gdim
        if self._finite and carrier.turns(load[:3], load[3:]):
            entry.row.fail(
                "with NLGEOM a coupling distributes forces through the centre of its surface only, "
                "neither moments nor forces beside it; write NLGEOM=NO"
            )
        turn = self._transforms.frames[self._flat.nodes(entry.row.card, entry.name)[0]]
        force, moment = load[:3] @ turn, load[3:] @ turn
        forces = carrier.forces(entry.row, force, moment, gdim) * len(carrier.nodes)
        where = groups.nodes(carrier.name, carrier.nodes, words="coupling")
        x = flat.points[carrier.nodes][:, :gdim]
        return PointForce(where, _fields(x, forces), amplitude, title)

    def _along_own_axes(
        self, entry: LoadEntry, amplitude: AmplitudeLike, load: Array, nodes: Ints, where: str,
        title: str,
    ) -> Load:  # fmt: skip
        """A force on each of some nodes along the axes of that node."""
        if load[3:].any():
            entry.row.fail(
                "moments along axes of a *TRANSFORM are not available; give them along global axes"
            )
        gdim = self._flat.kind.gdim
        forces = np.einsum("nlg,l->ng", self._transforms.frames[nodes], load[:3])[:, :gdim]
        x = self._flat.points[nodes][:, :gdim]
        return PointForce(where, _fields(x, forces * len(nodes)), amplitude, title)

    def _of(
        self,
        entry: LoadEntry,
        groups: Groups,
        densities: dict[str, float | None],
        titles: set[str],
    ) -> list[Load]:
        value, amplitude = entry.track.amplitude()
        flat, gdim, card = self._flat, self._flat.kind.gdim, entry.row.card

        def title(name: str) -> str:
            return _new(name, titles)

        if entry.kind == "DSLOAD":
            where = groups.surface(card, entry.name, entry.row.index)
            if entry.type in ("TRVEC", "TRSHR") and flat.kind.shell:
                self._report.replace(
                    "the traction acts on the face of the shell, not on its reference surface", card
                )
            return [self._on_facets(entry, where, value, amplitude, title(entry.name))]
        cells = (
            flat.elements(card, entry.name, entry.row.index)
            if entry.name
            else np.arange(len(flat.cells))
        )
        if entry.type in ("P", "HP"):  # of shells: towards the positive side
            side = Face(groups.cells(entry.name or "all shells", cells), "bottom")
            return [self._on_facets(entry, side, value, amplitude, title(entry.name or "P"))]
        if entry.type.lstrip("H")[:1] == "P":
            face = int(entry.type.lstrip("HP"))
            rows = flat.faces(card, cells, face, entry.row.index)
            where = groups.facets(f"{entry.name}.P{face}", rows)
            return [self._on_facets(entry, where, value, amplitude, title(where))]
        name = entry.name or "gravity"
        if entry.type == "CENT":
            body = groups.cells(entry.name, cells) if entry.name else None
            force = self._centrifugal(entry, value)
            return [BodyForce(force, body, amplitude, title(f"{name}.CENT"))]
        if entry.type in ("GRAV", "CENTRIF"):
            what = "gravity" if entry.type == "GRAV" else "a centrifugal force"
            out: list[Load] = []
            for section, density in densities.items():
                if entry.name and not np.isin(cells, groups.cells_of(section)).any():
                    continue
                if density is None:
                    entry.row.fail(f"{what} needs the *DENSITY of the material of '{section}'")
                heavy = np.intersect1d(cells, groups.cells_of(section))
                weight: tuple[Field, ...] = tuple(
                    value * density * d for d in entry.direction[:gdim]
                )
                if entry.type == "CENTRIF":
                    weight = self._centrifugal(entry, value * density)
                where = section
                if len(heavy) < len(groups.cells_of(section)):
                    where = groups.cells(f"{name} {section}", heavy)
                out.append(BodyForce(weight, where, amplitude, title(f"{name} {section}")))
            return out
        constant = np.zeros(gdim)
        constant[_BODY[entry.type]] = value
        body = groups.cells(entry.name, cells) if entry.name else None
        return [BodyForce(tuple(constant.tolist()), body, amplitude, title(f"{name}.{entry.type}"))]

    def _centrifugal(self, entry: LoadEntry, factor: float) -> tuple[Field, ...]:
        """Force per volume of a rotation, per distance from the axis a factor."""
        px, py, pz = entry.point
        dx, dy, dz = entry.direction
        return tuple(
            Centrifugal(factor, (px, py, pz), (dx, dy, dz), i) for i in range(self._flat.kind.gdim)
        )

    def _on_facets(
        self, entry: LoadEntry, where: str | Face, value: float, amplitude: AmplitudeLike, name: str
    ) -> Load:
        if entry.type in ("TRVEC", "TRSHR"):
            traction = tuple(value * d for d in entry.direction[: self._flat.kind.gdim])
            return Traction(where, traction, amplitude, name)
        if entry.type[:2] == "HP":
            # from the level where it is 0 to that where it has its value
            axis = 1 if self._flat.kind.gdim == 2 else 2
            field = Hydrostatic(value, axis, *entry.zero)
            return Pressure(where, field, amplitude, name, entry.follows)
        return Pressure(where, value, amplitude, name, entry.follows)


def _new(name: str, titles: set[str]) -> str:
    """A name that no other load has, noted among those that are taken."""
    new, i = name, 2
    while new in titles:
        new, i = f"{name} {i}", i + 1
    titles.add(new)
    return new


def _fields(x: Array, forces: Array) -> tuple[Field, ...]:
    """Components of forces on nodes, shape (n, gdim): numbers where all nodes have the same."""
    fields: list[Field] = []
    for values in forces.T:
        same = np.ptp(values) <= 1e-14 * np.abs(forces).max()
        fields.append(float(values.mean()) if same else NodalField(x, values))
    return tuple(fields)
