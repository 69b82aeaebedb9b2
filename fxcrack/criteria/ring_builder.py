"""Makes the rings of cells around the tips of a front."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError
from fxcrack.base.positions import numbers_at
from fxcrack.continuum.face import Face
from fxcrack.continuum.kinematics import Axisymmetric
from fxcrack.continuum.loads import BodyForce
from fxcrack.criteria.cell_laws import CellLaws, law_of, tensor_of_stress, voigt_strain
from fxcrack.criteria.cell_sides import cells_above, free_facets
from fxcrack.criteria.crack_tip_fields import TipFields
from fxcrack.criteria.face_tractions import FaceTractions, loads_on_faces, opened_facets
from fxcrack.criteria.front_ends import on_planes_of_symmetry
from fxcrack.criteria.front_ring import FIELDS_DEGREE, CellGeometry, TipState, divergence_in_rings
from fxcrack.criteria.front_smoothing import smoothing
from fxcrack.criteria.outer_faces import node_positions, outer_faces
from fxcrack.criteria.probe import FrontProbe
from fxcrack.criteria.ring import Interaction, Ring
from fxcrack.criteria.virtual_extension import Corners, FrontLine
from fxcrack.interface.front import Front
from fxcrack.interface.front_cells import FrontCells
from fxcrack.interface.surface import gather_surface
from fxcrack.interface.tips import Tips

_OPENING = 1
"""Place of mode I among the fields of a tip."""
_STRAIGHT = 30.001
"""Turn of the front from one element to the next above which single nodes are not reliable
[degrees]; a circle has 15 with 24 elements around it, and 30 up to round-off with 12."""
_CURVED = 45.0
"""Turn between planes of symmetry below which a front is as good as straight [degrees]; a quarter
of a circle has 60 with three elements."""


@dataclass(frozen=True)
class _Place:
    """A tip of a front for which a ring is made.

    Attributes:
        front: The front.
        tips: Its nodes.
        i: The tip.
        line: The front as segments.
        modes: The tip whose modes it has: itself, or the one beside it. The fields of a tip do not
            fit to a plane of symmetry at the end of a front, where one of mode III pulls.
        size: How far the cells at the tip reach [length].
        opened: Nodes that have opened before this front, or are about to, shape (n,).
        weights: Of the extensions of all tips in that of this one, shape (n_tips,); ``None``: its
            own alone.
        step: How far the front behind the nodes about to open is ahead [length].
    """

    front: Front
    tips: Tips
    i: int
    line: FrontLine
    modes: int
    size: float
    opened: Ints
    weights: Array | None
    step: float

    @property
    def normal(self) -> Array:
        """Normal of the interface where the modes are found, shape (3,)."""
        return self.tips.frame[self.modes, :, 0]


class RingBuilder:
    """Makes rings; those of tips around which nothing has changed are kept.

    Args:
        probe: The interface.
        rings: Outer radius of the ring, in lengths of the cells at the tip.
        length: Reference length of the modes between two materials; ``None``: the length of the
            element behind the tip, with a warning where it matters.
    """

    def __init__(self, probe: FrontProbe, rings: int, length: float | None) -> None:
        self._probe, self._bodies = probe, probe.bodies
        self._title = probe.pair.title
        self._rings, self._length = rings, length
        self._continuum = continuum = self._bodies.continuum
        self._laws = [law_of(continuum, i) for i in range(len(continuum.part_materials))]
        self._loads = list(self._bodies.loads)
        self._body_forces = [k for k, x in enumerate(self._loads) if isinstance(x, BodyForce)]
        groups = [self._loads[k].where for k in self._body_forces]
        self._cells = self._bodies.cells_around(groups)
        self._on_faces = loads_on_faces(continuum, self._loads)
        self._slaves = probe.pair.surface.dofs
        master = probe.pair.sides[1]
        self._masters = np.zeros(0, dtype=np.int64)  # a plane of symmetry has no nodes
        if isinstance(master, str | Face):
            self._masters = gather_surface(continuum, master).dofs
        self._halves = probe.pair.interface.opening_factor
        self._ring = isinstance(continuum.model, Axisymmetric)
        self._thickness = float(getattr(continuum.model, "thickness", 1.0))
        self._n_modes = 2 if probe.gdim == 2 else 3
        self._known: dict[tuple[Any, ...], Ring] = {}
        self._said: set[str] = set()

    def of(
        self,
        front: Front,
        tips: Tips,
        opened: Ints,
        *,
        ahead: Ints | None = None,
        step: float = 0.0,
    ) -> list[Ring]:
        """The rings of a front where the bodies are undeformed; collective.

        Args:
            front: The front there.
            tips: Its nodes there.
            opened: Nodes that were bonded and are open on this front, shape (n,); intensity factors
                are for fronts without such nodes.
            ahead: Of a front through irregular cells the nodes that are about to open, shape (n,):
                the rings serve the front behind them as well, and give rates that are smooth along
                the front.
            step: How far that front is ahead [length].
        """
        gdim = self._probe.gdim
        pair, surface = self._probe.pair, front.surface
        line = FrontLine.of(front, tips, pair.hierarchy)
        if not len(opened):
            self._look_at_turning(line)
        x = surface.x[tips.node]
        here = self._nodes_at(front, tips.node)
        tangent = tips.frame[:, :gdim, 2] if gdim == 3 else np.zeros((len(tips), 2))
        size = self._cells.sizes(here, x[:, :gdim], tangent)
        size = np.maximum(size, np.maximum(tips.d_behind, tips.d_ahead))
        # from the front, which runs between the tips
        reach = _reach(line)
        wide = float(np.hypot(self._rings * size.max(initial=0.0), 0.5 * reach))
        cells = self._cells.near(x[:, :gdim], np.full(len(x), wide))
        corners = Corners(cells, line)
        sides = cells_above(cells, self._slaves, self._masters)
        weights = None
        if cells.kind == "tetrahedron":
            along = corners.allowed(surface.dofs[tips.node], line.directions(tips))
            tips = replace(tips, frame=_turned(tips.frame, along))
        if ahead is not None:
            areas = np.array([line.widths(tips, i) for i in range(len(tips))])
            weights = smoothing(line.x, line.segments, areas)
            # nodes about to open change what their rings need
            opened, reach = ahead, np.inf
        rings, known = [], {}
        for i in range(len(tips)):
            key = (
                weights is not None,
                *self._key(front, tips, i, wide + reach, float(size[i]), opened),
            )
            ring = self._known.get(key)
            if ring is None:
                row = None if weights is None else weights[i] * areas[i] / areas
                beside = i if row is None else line.inward(i)
                where = _Place(front, tips, i, line, beside, float(size[i]), opened, row, step)
                ring = self._make(where, cells, corners, sides)
            known[key] = ring
            rings.append(ring)
        self._fresh = known
        return rings

    def is_smooth(self, front: Front, tips: Tips) -> bool:
        """Whether rates may be smooth along a front of tetrahedra; collective.

        What corrects them was found and verified on fronts whose lines are closed or curved from
        one plane of symmetry to another, without sharp turns.

        Args:
            front: The front where the bodies are undeformed.
            tips: Its nodes there.
        """
        line = FrontLine.of(front, tips)
        ends = line.ends()
        real = line.segments[:, 0] != line.segments[:, 1]
        if not len(real) or not real.all() or line.turning()[0] > _STRAIGHT:
            return False
        if not len(ends):
            return True
        if line.spans().min(initial=np.inf) < _CURVED:
            return False
        here = self._nodes_at(front, tips.node[ends])
        cells = self._cells.near(line.x[ends, : self._probe.gdim], np.zeros(len(ends)))
        return on_planes_of_symmetry(here, cells, self._own_facets(cells), self._bodies.held)

    def _nodes_at(self, front: Front, nodes: Ints) -> list[Ints]:
        """Global displacement nodes of both sides that lie at slave nodes."""
        pair, out = self._probe.pair, []
        for node in nodes:
            masters = pair.masters[node][np.abs(pair.weights[node]) > 1e-9]
            out.append(np.unique(np.append(masters, front.surface.dofs[node])))
        return out

    def keep(self, rings: dict[tuple[Any, ...], Ring]) -> None:
        """Keep these rings for later fronts, and no others."""
        self._known = rings

    @property
    def fresh(self) -> dict[tuple[Any, ...], Ring]:
        """The rings of the last front by what they depend on."""
        return self._fresh

    def _key(
        self, front: Front, tips: Tips, i: int, reach: float, size: float, opened: Ints
    ) -> tuple[Any, ...]:
        """All that the ring of a tip depends on: the front near it."""
        x = front.surface.x
        near = np.linalg.norm(x[tips.node] - x[tips.node[i]], axis=1) <= 2.0 * reach
        open_near = opened[np.linalg.norm(x[opened] - x[tips.node[i]], axis=1) <= 2.0 * reach]
        return (
            int(tips.node[i]), tips.node[near].tobytes(), tips.frame[near].tobytes(),
            open_near.tobytes(), len(opened) > 0, size, float(tips.d_behind[i]),
            float(tips.width[i]),
        )  # fmt: skip

    def _make(
        self, at: _Place, cells: FrontCells, corners: Corners, sides: tuple[Bools, Bools]
    ) -> Ring:
        """The largest ring of a tip with one material on each side, of one layer at least."""
        i, size = at.i, at.size * (1.0 + 1e-6)
        normal = at.tips.frame[i, :, 0]
        origin = at.front.surface.x[at.tips.node[i]]
        centre = np.zeros((len(cells.nodes), 3))
        centre[:, : self._probe.gdim] = cells.corners.mean(axis=1)
        above = np.where(sides[1], sides[0], (centre - origin) @ normal > 0.0)
        hat = np.zeros(len(at.tips))
        hat[at.line.members[at.modes]] = 1.0
        alone = np.broadcast_to(at.tips.frame[at.modes, :, 1], (len(at.tips), 3))
        for layers in range(self._rings, 0, -1):
            core = size if layers > 1 else 0.0
            q = corners.extension(hat, alone, layers * size, core)[corners.of_cell]
            wide = q
            if at.weights is not None:
                core = min(core + at.step, max(layers - 1, 0) * size)
                wide = corners.extension(at.weights, at.tips.frame[:, :, 1], layers * size, core)[
                    corners.of_cell
                ]
            rows = np.flatnonzero(np.abs(q).max(axis=(1, 2)) > 0.0)
            parts = [np.unique(cells.part[rows[above[rows] == side]]) for side in (True, False)]
            # a side without cells has no material that could differ
            alike = all(len(p) <= 1 for p in parts)
            if alike:
                break
        if not len(rows):
            raise InputError(
                f"interface '{self._title}': method='domain' finds no cells around the tip at "
                f"{format_point(origin)} that a growing crack would move; take method='vcct'"
            )
        if not alike:
            nearest = np.linalg.norm(centre[rows] - origin, axis=1)
            order = rows[np.argsort(nearest, kind="stable")]
            parts = [cells.part[order[above[order] == side]][:1] for side in (True, False)]
            self._say(
                "materials",
                "interface '%s': the cells at the tip at %s are of several materials on one "
                "side; the modes of method='domain' are those of the nearest ones, its total "
                "is right where the materials meet along the direction of growth",
                self._title,
                format_point(origin),
            )
        if not all(len(p) for p in parts):
            parts = [p if len(p) else parts[1 - k] for k, p in enumerate(parts)]
        rows = np.flatnonzero((np.abs(q) + np.abs(wide)).max(axis=(1, 2)) > 0.0)
        return self._fill(
            at, cells.chosen(rows), q[rows], wide[rows], above[rows], [int(p[0]) for p in parts],
            alike,
        )  # fmt: skip

    def _fill(
        self,
        at: _Place,
        cells: FrontCells,
        q: Array,
        wide: Array,
        above: Bools,
        parts: list[int],
        alike: bool,
    ) -> Ring:
        """A ring of given cells and extensions at their corners.

        Args:
            at: The tip.
            cells: The cells.
            q: Extension from which the modes are found, shape (n_cells, n_corners, gdim).
            wide: That of the energy, likewise.
            above: Whether each cell is on the side the normal points to, shape (n_cells,).
            parts: Part of the continuum that gives the crack-tip field above and below.
            alike: Whether each side is of one material.
        """
        continuum, gdim = self._continuum, self._probe.gdim
        front, tips, i = at.front, at.tips, at.i
        nodes, of_cell = np.unique(cells.nodes, return_inverse=True)
        of_cell = of_cell.reshape(cells.nodes.shape)
        x = np.zeros((len(nodes), 3))
        x[of_cell] = node_positions(cells)
        n_loads = len(self._loads)
        laws = CellLaws(self._laws, cells.part, finite=self._bodies.finite)
        faces = FaceTractions(self._on_faces, wide, cells, above, nodes, n_loads, gdim=gdim)
        fields = None
        if at.weights is not None or not len(at.opened):
            length = self._length or float(tips.d_behind[i])
            upper, lower = (self._laws[p].whole for p in parts)
            fields = TipFields(upper, lower, tips.frame[at.modes], length)
            self._look_at_oscillation(fields.oscillation, length)
        origin = front.surface.x[tips.node[at.modes]]
        area = at.line.widths(tips, i)
        if gdim == 2:
            area = float(continuum.model.breadth(origin[None])[0])
        if at.weights is None:
            interaction = self._interaction(
                at, fields, origin, cells, q, above, laws, faces, of_cell
            )
        else:
            some = np.flatnonzero(np.abs(q).max(axis=(1, 2)) > 0.0)
            few = cells.chosen(some)
            pulled = FaceTractions(
                self._on_faces, q[some], few, above[some], nodes, n_loads, gdim=gdim
            )
            interaction = self._interaction(
                at, fields, origin, few, q[some], above[some],
                CellLaws(self._laws, few.part, finite=self._bodies.finite), pulled, of_cell[some],
                len(nodes),
            )  # fmt: skip
            share = at.line.widths(tips, at.modes) / area
            interaction = replace(interaction, share=share)
        opening = opened_facets(
            front.surface, front.bonded, at.opened, nodes, cells, wide, self._probe.pair.hierarchy
        )
        # half a ring: J and K_I of the other half are the same, as if over half the area; jumps are
        # those of the whole crack
        area /= self._halves
        opening = replace(opening, weights=opening.weights / self._halves)
        # as the bodies have it
        plain = CellGeometry(cells, continuum.degree, ring=self._ring, thickness=self._thickness)
        volume = plain.weight
        shift = plain.at_corners(wide) * volume[..., None]
        rise, slope = self._temperatures(cells, plain, shift)
        body, _ = self._body(cells, plain, shift, np.zeros((1, *volume.shape, 3, 3)))
        return Ring(
            nodes, of_cell, plain, x[:, :gdim], laws,
            plain.gradient(wide, corners=True) * volume[..., None, None], rise, slope, body, faces,
            opening, interaction, area, alike,
        )  # fmt: skip

    def _interaction(
        self,
        at: _Place,
        fields: TipFields | None,
        origin: Array,
        cells: FrontCells,
        q: Array,
        above: Bools,
        laws: CellLaws,
        faces: FaceTractions,
        of_cell: Ints,
        n_nodes: int = 0,
    ) -> Interaction:
        """The interaction integrals; nothing where no fields are given."""
        m, gdim = self._n_modes, self._probe.gdim
        n_nodes = max(n_nodes, int(of_cell.max()) + 1)
        if fields is None:
            none = np.zeros(0)
            return Interaction(none, none, none, np.eye(m), 0.0)
        thickness = self._thickness
        # the fields of the tip are no polynomials
        degree = max(self._continuum.degree, FIELDS_DEGREE)
        geometry = CellGeometry(cells, degree, ring=self._ring, thickness=thickness)
        volume = geometry.weight
        moved = geometry.gradient(q, corners=True) * volume[..., None, None]
        shift = geometry.at_corners(q) * volume[..., None]
        stiffness, expansion = laws.stiffness, laws.expansion
        rise, slope = self._temperatures(cells, geometry, shift)
        tip = TipState.of(fields, geometry, origin, above, m)
        stress = tensor_of_stress(tip.strain @ np.swapaxes(stiffness, 1, 2))
        trace = np.einsum("cqii->cq", moved)
        # s : (H_a q') - s : e_a tr q', as C : (...) : (e - alpha T)
        turned = voigt_strain(tip.gradient @ moved)
        turned -= tip.strain * trace[..., None]
        turned[..., 2] += np.einsum("mcqi,cqi->mcq", tip.hoop, shift)
        held = turned @ np.swapaxes(stiffness, 1, 2)
        modes = tensor_of_stress(held) + stress @ np.swapaxes(moved, -1, -2)
        if self._ring:
            out = divergence_in_rings(stress, geometry.radius)
            modes += out[..., :, None] * shift[..., None, :]
        by_rise = -np.einsum("mcqi,ci,pcq->mp", held, expansion, rise)
        pressed = np.einsum("mcqij,cij->mcq", stress, _strain_tensor(expansion))
        by_rise += np.einsum("mcq,pcq->mp", pressed, slope)
        _, by_load = self._body(cells, geometry, shift, tip.gradient)
        by_load -= faces.interaction(fields, origin, m)
        by_node = np.zeros((m, n_nodes, gdim))
        each = geometry.weights_at_nodes(modes)
        each += outer_faces(
            cells, geometry, q,
            free_facets(cells, self._own_facets(cells), self._held(at.front), at.normal, origin),
            fields, origin, above, stiffness, m, thickness,
        )  # fmt: skip
        for mode in range(m):
            np.add.at(by_node[mode], of_cell, each[mode])
        energy = fields.energy[:m, :m]
        if self._halves > 1.0:
            # modes II and III of one half are the negative of those of the other
            for weights in (by_node, by_rise, by_load):
                weights[np.arange(m) != _OPENING] = 0.0
        return Interaction(by_node, by_rise, by_load, energy, fields.oscillation)

    def _held(self, front: Front) -> Ints:
        """Global displacement nodes of both sides that are bonded, shape (n,)."""
        pair, bonded = self._probe.pair, front.bonded
        # nodes without a weight may be those of an open facet beside the front
        masters = pair.masters[bonded][np.abs(pair.weights[bonded]) > 1e-9]
        return np.concatenate([front.surface.dofs[bonded], masters])

    def _own_facets(self, cells: FrontCells) -> Bools:
        """Whether each facet of a cell is one of the interface, shape (n_cells, n_facets)."""
        corners = cells.nodes[:, cells.facet_corners]
        return np.asarray(
            np.isin(corners, self._slaves).all(axis=2) | np.isin(corners, self._masters).all(axis=2)
        )

    def _temperatures(
        self, cells: FrontCells, geometry: CellGeometry, shift: Array
    ) -> tuple[Array, Array]:
        """Patterns at the points, and their gradients times extension and volume."""
        n = cells.temperatures.shape[1]
        if not n:
            empty = np.zeros((0, *geometry.weight.shape))
            return empty, empty
        table = self._cells.temperature_table(geometry.tables.points)
        rise = np.einsum("qa,cpa->pcq", table, cells.temperatures)
        slope = geometry.slope(np.moveaxis(cells.nodal_temperatures, 1, 0))
        return rise, np.einsum("pcqi,cqi->pcq", slope, shift)

    def _body(
        self, cells: FrontCells, geometry: CellGeometry, shift: Array, tip: Array
    ) -> tuple[Array | None, Array]:
        """Weights of H in the work of body forces, and what they do in the interaction."""
        by_load = np.zeros((len(tip), len(self._loads)))
        if not self._body_forces:
            return None, by_load
        body = np.zeros((len(self._loads), *geometry.weight.shape, 3, 3))
        for column, k in enumerate(self._body_forces):
            force = np.zeros((*geometry.weight.shape, 3))
            for axis, value in enumerate(self._loads[k].value):
                if callable(value):
                    where = f"load '{self._loads[k].title}'"
                    found = numbers_at(where, "value", value, geometry.x.reshape(-1, 3))
                    force[..., axis] = found.reshape(geometry.weight.shape)
                else:
                    force[..., axis] = float(value)
            force *= cells.marks[:, column, None, None]
            body[k] = force[..., :, None] * shift[..., None, :]
            by_load[:, k] = -np.einsum("cqij,mcqij->m", body[k], tip)
        return body, by_load

    # -- messages ------------------------------------------------------------------------

    def _say(self, what: str, words: str, *values: Any) -> None:
        """Warn once."""
        if what not in self._said:
            self._said.add(what)
            log.warn(words, *values)

    def _look_at_turning(self, line: FrontLine) -> None:
        """Warn once where the front is far from straight over the ring."""
        angle, tip = line.turning()
        if angle > _STRAIGHT:
            self._say(
                "turning",
                "interface '%s': the front turns by %.0f degrees from one element to the next, at "
                "%s among others; method='domain' is not reliable at single nodes of such a front: "
                "compare with method='vcct', or take elements that are shorter in the direction of "
                "growth than along the front",
                self._title,
                angle,
                format_point(line.x[tip]),
            )

    def _look_at_oscillation(self, oscillation: float, length: float) -> None:
        """Warn once where the modes depend on a length that nobody has stated."""
        if self._length is None and oscillation:
            self._say(
                "length",
                "interface '%s': the materials of its sides make the modes depend on a "
                "reference length (oscillation index %.3g); those of method='domain' are for "
                "%.4g, the length of the element behind the tip: give reference_length",
                self._title,
                oscillation,
                length,
            )


def _turned(frame: Array, along: Array) -> Array:
    """Frames with these directions of growth, shape (n, 3, 3)."""
    normal = frame[:, :, 0] - np.einsum("ni,ni->n", frame[:, :, 0], along)[:, None] * along
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([normal, along, np.cross(normal, along)], axis=2)


def _reach(line: FrontLine) -> float:
    """Length of the longest segment of a front."""
    ends = line.x[line.segments]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max(initial=0.0))


def _strain_tensor(strain: Array) -> Array:
    """Tensor of a Voigt strain, shape (..., 6) to (..., 3, 3)."""
    half = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
    return tensor_of_stress(strain * half)
