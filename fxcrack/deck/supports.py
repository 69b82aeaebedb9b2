"""Prescribed displacements of a deck: ``*BOUNDARY``, and constraints whose reference moves so.

Every degree of freedom follows the card that named it last; where cards overlap, groups of nodes
with the same history are formed. Constraints whose reference moves as prescribed in all steps are
prescribed displacements (:mod:`fxcrack.deck.constraints` has the others).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fxcrack.base.arrays import Array, Ints
from fxcrack.continuum.couplings import Constraint
from fxcrack.continuum.loads import Displacement
from fxcrack.continuum.node_supports import Rotation, Support, Symmetry
from fxcrack.deck.cards import Card, Row, fresh_cards, label
from fxcrack.deck.flat import Flat
from fxcrack.deck.groups import Groups
from fxcrack.deck.tracks import Amplitudes, Curve, Period, Track, combined

_NAMED = {
    "ENCASTRE": (1, 2, 3, 4, 5, 6),
    "PINNED": (1, 2, 3),
    "XSYMM": (1, 5, 6),
    "YSYMM": (2, 4, 6),
    "ZSYMM": (3, 4, 5),
    "XASYMM": (2, 3, 4),
    "YASYMM": (1, 3, 5),
    "ZASYMM": (1, 2, 6),
}
AnySupport = Displacement | Support | Constraint
_DOFS = 6
_AXES = "xyz"


@dataclass(frozen=True, eq=False)
class Entry:
    """A line of a card: nodes, components, value and amplitude.

    Attributes:
        card: The card.
        name: Of the set, as written.
        value: Reference value.
        curve: Amplitude.
        fixed: Whether the present value is kept.
        rate: Whether the value is a velocity.
    """

    card: Card
    name: str
    value: float
    curve: Curve | None
    fixed: bool = False
    rate: bool = False


@dataclass(frozen=True, eq=False)
class Link:
    """Displacement components of nodes as sums over those of reference nodes.

    Attributes:
        card: The card it comes from.
        name: What it is called.
        nodes: Nodes that follow, shape (n,).
        dof: Their component, 0, 1 or 2; 3, 4 or 5 of rotations of shells.
        terms: Reference node and component, and its factor per node, shape (n,).
    """

    card: Card
    name: str
    nodes: Ints
    dof: int
    terms: list[tuple[int, int, Array]]


@dataclass(frozen=True)
class Pattern:
    """A displacement that is linear in position: offset + gradient x.

    Attributes:
        offset: At the origin, length.
        gradient: Per length, shape (3,).
    """

    offset: float
    gradient: tuple[float, float, float]

    def __call__(self, x: Array) -> Array:
        """Values at positions of shape (3, n)."""
        return np.asarray(self.offset + np.asarray(self.gradient) @ x)


@dataclass
class Boundary:
    """The prescribed components of all nodes in all steps.

    Args:
        flat: The model.
        periods: The steps in time.

    Attributes:
        entries: All lines, in order.
        owner: Entry of each component of each node per step, -1 where free, shape
            (n_steps, 6, n_nodes).
    """

    flat: Flat
    periods: Sequence[Period]
    entries: list[Entry] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Begin with free nodes."""
        n = len(self.flat.points)
        self._now = np.full((_DOFS, n), -1, dtype=np.int32)
        self.owner = np.zeros((0, _DOFS, n), dtype=np.int32)

    def take(self, cards: Sequence[Card], amplitudes: Amplitudes) -> None:
        """Read the cards of model data or of a step, in order.

        Raises:
            DeckError: A line cannot be read.
        """
        fresh = fresh_cards(cards)
        if fresh:
            self._now[:] = -1
        for card in cards:
            kind = card.word("TYPE", "DISPLACEMENT")
            if kind not in ("DISPLACEMENT", "VELOCITY"):
                card.fail(
                    f"TYPE={kind} is not available; DISPLACEMENT and VELOCITY are, and forces by "
                    "*CLOAD"
                )
            curve = amplitudes.of(card)
            if card not in fresh:
                card.need_rows("node or set, first and last component, value")
            for row in card.rows():
                self._take_row(row, curve)

    def _take_row(self, row: Row, curve: Curve | None) -> None:
        nodes = self.flat.with_centres(self.flat.nodes(row.card, row.text(0), row.index))
        word = row.text(1).upper()
        if word in _NAMED:
            dofs, value = _NAMED[word], 0.0
        else:
            if word and not word.isdigit():
                row.fail(f"'{row.text(1)}' is no component and none of {', '.join(_NAMED)}")
            first = row.whole(1)
            last = row.whole(2, first) or first
            if not 1 <= first <= last <= _DOFS:
                row.fail(
                    f"components {first} to {last} are not displacements (1 to 3) or rotations (4 "
                    "to 6)"
                )
            dofs, value = tuple(range(first, last + 1)), row.number(3, 0.0)
        fixed = row.card.has("FIXED")
        rate = row.card.word("TYPE") == "VELOCITY"
        entry = Entry(row.card, label(row.text(0)), value, curve, fixed, rate)
        self.entries.append(entry)
        for dof in dofs:
            self._now[dof - 1, nodes] = len(self.entries) - 1

    def end_step(self) -> None:
        """The cards of a step have been read."""
        self.owner = np.concatenate((self.owner, self._now[None]))

    # -- tracks --------------------------------------------------------------------------

    def track(self, owners: Ints) -> Track:
        """What a component does whose entries in the steps are given, shape (n_steps,)."""
        track, last = Track(), -1
        for i, period in zip(owners.tolist(), self.periods, strict=True):
            entry = self.entries[i]
            if entry.rate and not entry.fixed:
                value, curve = entry.value, entry.curve
                if i == last and curve is not None and not curve.total:
                    value = float(curve.values[-1]) * (1.0 if curve.absolute else value)
                    curve = None
                track.move_at_rate(period, value, curve)
            elif entry.fixed or (i == last and not (entry.curve and entry.curve.total)):
                track.hold(period)
            else:
                track.move(period, entry.value, entry.curve)
            last = i
        return track

    def histories(self, dof: int) -> list[tuple[Ints, Ints]]:
        """Groups of nodes of which a component has the same entries in all steps.

        Returns:
            Entries, shape (n_steps,), and nodes, of each group.

        Raises:
            DeckError: A component is prescribed in some steps only.
        """
        owner = self.owner[:, dof]
        chosen = np.flatnonzero((owner >= 0).any(axis=0))
        if not len(chosen):
            return []
        columns, which = np.unique(owner[:, chosen], axis=1, return_inverse=True)
        out = []
        for i in range(columns.shape[1]):
            entries = columns[:, i].astype(np.int64)
            nodes = chosen[which.ravel() == i]
            if np.any(entries < 0) and self.flat.used[nodes].any() and dof < self.flat.kind.gdim:
                entry = self.entries[int(entries.max())]
                entry.card.fail(
                    f"component {dof + 1} of '{entry.name}' is prescribed in some steps and free "
                    "in others; fxcrack holds the same components in all steps: prescribe it "
                    "from the first step on, or compute the steps as two decks"
                )
            out.append((entries, nodes))
        return out

    def of_node(self, node: int, dof: int) -> Track | None:
        """What a component of a node does; None where it is free in some step."""
        entries = self.owner[:, dof, node].astype(np.int64)
        return None if np.any(entries < 0) or not len(entries) else self.track(entries)

    def motion(self, node: int, dof: int, card: Card, name: str) -> Track | None:
        """What a component of a reference node does; None where it is free in all steps.

        Args:
            node: The node.
            dof: Its component, 0 to 5.
            card: The constraint, for messages.
            name: Its name.

        Raises:
            DeckError: It is prescribed in some steps and free in others.
        """
        entries = self.owner[:, dof, node].astype(np.int64)
        if not len(entries) or np.all(entries < 0):
            return None
        if np.any(entries < 0):
            card.fail(
                f"component {dof + 1} of the reference node of '{name}' is prescribed in some "
                "steps and free in others; fxcrack holds the same components in all steps"
            )
        return self.track(entries)

    def share(self, nodes: Ints, others: Ints) -> int:
        """Prescribe displacements of other nodes, where they are free, as those of nodes are.

        Args:
            nodes: The nodes, shape (n,).
            others: One for each, shape (n,).

        Returns:
            For how many of them something is new.
        """
        theirs, ours = self.owner[:, :3, others], self.owner[:, :3, nodes]
        new = (theirs < 0) & (ours >= 0)
        self.owner[:, :3, others] = np.where(new, ours, theirs)
        return int(new.any(axis=(0, 1)).sum())

    def release(self, node: int, dofs: Sequence[int]) -> None:
        """Leave it to a constraint to prescribe some components of a node."""
        self.owner[:, list(dofs), node] = -1

    # -- the scene -----------------------------------------------------------------------

    def displacements(self, groups: Groups) -> list[AnySupport]:
        """Supports of the scene, one for each component of each group of nodes.

        Raises:
            DeckError: As :meth:`histories`.
        """
        found: dict[tuple[str, object], list[tuple[str, float]]] = {}
        amplitudes: dict[object, object] = {}
        for dof in range(self.flat.kind.gdim):
            for entries, nodes in self.histories(dof):
                nodes = nodes[self.flat.used[nodes]]
                if not len(nodes):
                    continue
                entry, track = self.entries[int(entries[-1])], self.track(entries)
                where = groups.support(entry.card, entry.name, nodes, words="part")
                value, amplitude = track.amplitude()
                if track.zero:
                    value, amplitude = 0.0, Displacement(where, x=0.0).amplitude
                mark = repr(amplitude)
                amplitudes[mark] = amplitude
                found.setdefault((where, mark), []).append((_AXES[dof], value))
        out: list[AnySupport] = [
            Displacement(where, **dict(parts), amplitude=amplitudes[mark])  # type: ignore[arg-type]
            for (where, mark), parts in found.items()
        ]
        return out + (self._rotations(groups) if self.flat.kind.shell else [])

    def _rotations(self, groups: Groups) -> list[AnySupport]:
        """Rotations of shells, one support for each amplitude of each group of nodes.

        Raises:
            DeckError: A rotation is prescribed in some steps only, or is large.
        """
        chosen = np.flatnonzero((self.owner[:, 3:] >= 0).any(axis=(0, 1)) & self.flat.used)
        if not len(chosen):
            return []
        columns, which = np.unique(
            self.owner[:, :, chosen].reshape(-1, len(chosen)), axis=1, return_inverse=True
        )
        out: list[AnySupport] = []
        for i in range(columns.shape[1]):
            owners = columns[:, i].reshape(-1, _DOFS).astype(np.int64)
            nodes = chosen[which.ravel() == i]
            tracks: dict[int, Track] = {}
            for dof in range(_DOFS):
                if np.all(owners[:, dof] >= 0):
                    tracks[dof] = self.track(owners[:, dof])
                elif dof >= 3 and np.any(owners[:, dof] >= 0):
                    self.entries[int(owners[:, dof].max())].card.fail(
                        f"rotation {dof + 1} is prescribed in some steps and free in others; "
                        "fxcrack holds the same components in all steps"
                    )
            entry = self.entries[int(owners[:, 3:].max())]
            where = groups.support(entry.card, entry.name, nodes, words="part")
            out += self._rotation(where, tracks, entry.card)
        return out

    @staticmethod
    def _rotation(where: str, tracks: dict[int, Track], card: Card) -> list[AnySupport]:
        """Supports of the rotations among the tracks of one group of nodes."""
        still = {dof for dof, track in tracks.items() if track.zero}
        turning = {dof: track for dof, track in tracks.items() if dof >= 3 and not track.zero}
        held = {dof for dof in still if dof >= 3}
        for axis in range(3):  # planes of symmetry hold the director on curved shells as well
            others = {3 + (axis + 1) % 3, 3 + (axis + 2) % 3}
            if held == others and axis in still and not turning:
                return [Symmetry(where, _AXES[axis], name=f"{where} symmetry")]
        if not turning:
            return [Rotation(where, **{_AXES[d - 3]: 0.0 for d in sorted(held)})]  # type: ignore[arg-type]
        by_amplitude: dict[str, tuple[object, dict[str, float]]] = {}
        for dof, track in turning.items():
            value, amplitude = track.amplitude()
            by_amplitude.setdefault(repr(amplitude), (amplitude, {}))[1][_AXES[dof - 3]] = value
        if len(by_amplitude) > 1 and len(turning) + len(held) == 3:
            card.fail("rotations with different amplitudes on one node are not available")
        first = next(iter(by_amplitude.values()))[1]
        first |= {_AXES[d - 3]: 0.0 for d in sorted(held)}
        return [
            Rotation(where, **values, amplitude=amplitude)  # type: ignore[arg-type]
            for amplitude, values in by_amplitude.values()
        ]

    def link_displacements(self, links: Sequence[Link], groups: Groups) -> list[AnySupport]:
        """Supports that constraints stand for whose references are prescribed.

        Raises:
            DeckError: A reference moves in several ways at once.
        """
        out: list[AnySupport] = []
        turns: dict[str, tuple[Link, dict[int, Track]]] = {}
        for link in links:
            tracks = []
            for node, dof, _ in link.terms:
                track = self.of_node(node, dof)
                assert track is not None
                tracks.append(track)
            factors = [f for _, _, f in link.terms]
            moving = [i for i, t in enumerate(tracks) if not t.zero]
            where = groups.support(link.card, link.name, link.nodes, words="constraint")
            if link.dof >= 3:
                turns.setdefault(where, (link, {}))[1][link.dof] = tracks[0]
                continue
            axis = _AXES[link.dof]
            if not moving:
                out.append(Displacement(where, **{axis: 0.0}))  # type: ignore[arg-type]
                continue
            if all(np.ptp(factors[i]) <= 1e-12 * np.abs(factors[i]).max() for i in moving):
                track = combined(
                    [tracks[i] for i in moving], [float(factors[i][0]) for i in moving]
                )
                value, amplitude = track.amplitude()
                out.append(
                    Displacement(where, **{axis: value}, amplitude=amplitude)  # type: ignore[arg-type]
                )
                continue
            out.append(self._turning(link, tracks, factors, moving, where))
        for where, (link, of_dof) in turns.items():
            out += self._rotation(where, of_dof, link.card)
        return out

    def _turning(
        self,
        link: Link,
        tracks: list[Track],
        factors: list[Array],
        moving: list[int],
        where: str,
    ) -> Displacement:
        """A support whose value depends on position: the reference turns."""
        first = tracks[moving[0]]
        peak = int(np.argmax(np.abs(first.values)))
        shares = []
        for i in moving:
            share = float(np.interp(first.times[peak], tracks[i].times, tracks[i].values))
            share /= first.values[peak]
            rest = combined([tracks[i], first], [1.0, -share])
            if max(abs(v) for v in rest.values) > 1e-9 * max(abs(v) for v in tracks[i].values):
                link.card.fail(
                    f"the reference of '{link.name}' moves and turns with different amplitudes; "
                    "let both follow one amplitude"
                )
            shares.append(share)
        values = sum(s * factors[i] for s, i in zip(shares, moving, strict=True))
        x = self.flat.points[link.nodes]
        matrix = np.column_stack((np.ones(len(x)), x))
        solution = np.linalg.lstsq(matrix, np.asarray(values), rcond=None)[0]
        value, amplitude = first.amplitude()
        pattern = Pattern(
            value * float(solution[0]),
            tuple(float(value * g) for g in solution[1:]),  # type: ignore[arg-type]
        )
        return Displacement(
            where,
            **{_AXES[link.dof]: pattern},  # type: ignore[arg-type]
            amplitude=amplitude,
        )
