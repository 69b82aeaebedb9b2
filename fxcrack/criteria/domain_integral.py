"""Energy release rates by an integral over a ring of cells around each tip, and their modes.

The equations are those of :mod:`fxcrack.criteria.front_ring`. The integral needs the displacements
of the bodies around the tip: one back-substitution per state for condensed bodies. They are linear
between two equilibria of linear bodies, so that the load at which G reaches its critical value is
found on them without a further one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Bools, Ints
from fxcrack.base.checks import format_point
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.kinematics import Axisymmetric, PlaneStress
from fxcrack.continuum.loads import BodyForce
from fxcrack.continuum.materials import stiffness_of
from fxcrack.continuum.temperature import ByTemperature, expansion_of
from fxcrack.criteria.crack_tip_fields import TipFields
from fxcrack.criteria.face_tractions import FaceTractions, loads_on_faces
from fxcrack.criteria.front_ring import (
    CellGeometry,
    TipState,
    divergence_in_rings,
    tensor_of_stress,
    voigt_strain,
)
from fxcrack.criteria.outer_faces import outer_faces
from fxcrack.criteria.probe import Bodies, FrontProbe, State
from fxcrack.criteria.virtual_extension import Corners, FrontLine
from fxcrack.interface.front_cells import FrontCells
from fxcrack.interface.surface import gather_surface
from fxcrack.interface.tips import Tips

RINGS = 3
"""Radius of the ring by default, in lengths of the cells at the tip."""


@dataclass(frozen=True)
class Law:
    """Linear elasticity of a part, on Voigt strains with all six components.

    Attributes:
        stiffness: Stress per strain, shape (6, 6); zero out of a sheet in plane stress.
        whole: Stiffness from which the crack-tip fields are made: that of the sheet in its plane,
            of the material otherwise, shape (6, 6).
        expansion: Thermal strain per degree, shape (6,).
    """

    stiffness: Array
    whole: Array
    expansion: Array


def law_of(continuum: Continuum, i: int) -> Law:
    """The law of a part."""
    material, model = continuum.part_materials[i], continuum.model
    c, alpha = stiffness_of(material), expansion_of(material)
    if not isinstance(model, PlaneStress):
        return Law(c, c, alpha)
    plane = np.ix_([0, 1, 5], [0, 1, 5])
    sheet = np.zeros((6, 6))
    sheet[plane] = model.reduce(c)
    # what is out of the plane does not enter the fields in it
    whole = c.copy()
    whole[:] = 0.0
    whole[plane] = sheet[plane]
    out = np.ix_([2, 3, 4], [2, 3, 4])
    whole[out] = c[out]
    keep = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    return Law(sheet, whole, alpha * keep)


@dataclass(frozen=True)
class Ring:
    """One tip with all that its integrals need.

    Attributes:
        nodes: Global displacement nodes of the ring, shape (n_nodes,).
        of_cell: Their positions for each cell, shape (n_cells, n_cell_nodes).
        geometry: Cells, quadrature points and derivatives.
        stiffness: Shape (n_cells, 6, 6).
        expansion: Shape (n_cells, 6).
        moved: Gradient of the extension times the volume of each point, shape (n_cells, n_points,
            3, 3).
        rise: Temperature of each pattern at the points, shape (n_patterns, n_cells, n_points).
        slope: Its gradient times the extension and the volume, likewise.
        body: Body force of each load times the extension and the volume, shape (n_loads, n_cells,
            n_points, 3, 3), to be multiplied with H; ``None`` without.
        faces: Tractions on faces in the ring.
        modes: Weights of H in the interaction integrals, shape (n_modes, n_cells, n_points, 3, 3).
        modes_by_node: Weights of the displacements in them, shape (n_modes, n_nodes, gdim).
        modes_by_rise: What each temperature pattern adds to them, shape (n_modes, n_patterns).
        modes_by_load: What each load factor does, shape (n_modes, n_loads).
        energy: M of G = k . M k, shape (n_modes, n_modes).
        area: Area that the extension opens.
        radius: Outer radius [length].
        oscillation: Oscillation index of the two materials.
    """

    nodes: Ints
    of_cell: Ints
    geometry: CellGeometry
    stiffness: Array
    expansion: Array
    moved: Array
    rise: Array
    slope: Array
    body: Array | None
    faces: FaceTractions
    modes: Array
    modes_by_node: Array
    modes_by_rise: Array
    modes_by_load: Array
    energy: Array
    area: float
    radius: float
    oscillation: float


@dataclass(frozen=True)
class DomainValues:
    """What the integrals give at some tips.

    Attributes:
        energy: Energy release rate, shape (n,) [force/length].
        shares: Part of each mode (I, II, III) in it, from the intensity factors; rows sum to 1,
            shape (n, 3).
        factors: Intensity factors K_I, K_II, K_III at the reference length, shape (n, 3)
            [force/length^1.5].
    """

    energy: Array
    shares: Array
    factors: Array


class DomainIntegral:
    """The integrals on the present front of one interface.

    Args:
        probe: The interface.
        rings: Outer radius of the ring, in lengths of the cells at the tip.
        length: Reference length of the modes between two materials; ``None``: the length of the
            element behind the tip, with a warning where it matters.

    Raises:
        InputError: The scene holds what the integral does not cover.
    """

    def __init__(self, probe: FrontProbe, rings: int, length: float | None) -> None:
        self._probe = probe
        self._bodies: Bodies = probe.bodies
        self._title = probe.pair.title
        self._rings, self._length = rings, length
        self._continuum = continuum = self._bodies.continuum
        where = f"interface '{self._title}': method='domain'"
        refused = self._bodies.uncovered or ("finite strain" if self._bodies.finite else "")
        if not refused and probe.pair.friction is not None:
            refused = "friction of the faces, whose tractions are not known to it"
        if refused:
            raise InputError(
                f"{where} does not cover {refused}; take method='vcct' or method='closure'"
            )
        for material in continuum.part_materials:
            if isinstance(material, ByTemperature):
                raise InputError(
                    f"{where} does not cover stiffness tabulated against temperature; take "
                    "method='vcct' or method='closure'"
                )
        self._laws = [law_of(continuum, i) for i in range(len(continuum.part_materials))]
        self._loads = list(self._bodies.loads)
        self._body_forces = [k for k, x in enumerate(self._loads) if isinstance(x, BodyForce)]
        groups = [self._loads[k].where for k in self._body_forces]
        self._cells = self._bodies.cells_around(groups)
        self._on_faces = loads_on_faces(continuum, self._loads)
        self._slaves = probe.pair.surface.dofs
        self._masters = gather_surface(continuum, probe.pair.sides[1]).dofs
        self._ring = isinstance(continuum.model, Axisymmetric)
        self._n_modes = 2 if probe.gdim == 2 else 3
        self._known: dict[tuple[Any, ...], Ring] = {}
        self._of: tuple[Tips, int, list[Ring], dict[int, int]] | None = None
        self._last: tuple[State, Array, Ints] | None = None
        self._said: set[str] = set()

    # -- rings ---------------------------------------------------------------------------

    def prepare(self, tips: Tips) -> None:
        """Make the rings of the present front; collective."""
        placed = self._probe.front.placed
        if self._of is not None and self._of[0] is tips and self._of[1] == placed:
            return
        gdim = self._probe.gdim
        line = FrontLine.of(self._probe.front, tips)
        pair = self._probe.pair
        surface = self._probe.front.surface
        x = surface.x[tips.node]
        here = []
        for node in tips.node:
            masters = pair.masters[node][np.abs(pair.weights[node]) > 1e-9]
            here.append(np.unique(np.append(masters, surface.dofs[node])))
        tangent = tips.frame[:, :gdim, 2] if gdim == 3 else np.zeros((len(tips), 2))
        size = self._cells.sizes(here, x[:, :gdim], tangent)
        behind = np.maximum(tips.d_behind, tips.d_ahead)
        size = np.maximum(size, behind)
        # from the front, which runs between the tips
        wide = np.hypot(self._rings * size.max(initial=0.0), 0.5 * _reach(line))
        cells = self._cells.near(x[:, :gdim], np.full(len(x), wide))
        corners = Corners(cells, line)
        rings = [
            self._make(tips, i, line, cells, corners, float(size[i])) for i in range(len(tips))
        ]
        row = {int(node): i for i, node in enumerate(tips.node)}
        self._of, self._last = (tips, placed, rings, row), None
        self._needed = np.unique(np.concatenate([r.nodes for r in rings]))

    def _make(
        self,
        tips: Tips,
        i: int,
        line: FrontLine,
        cells: FrontCells,
        corners: Corners,
        size: float,
    ) -> Ring:
        """The largest ring of a tip with one material on each side, of one layer at least."""
        size *= 1.0 + 1e-6
        normal = tips.frame[i, :, 0]
        origin = self._probe.front.surface.x[tips.node[i]]
        centre = np.zeros((len(cells.nodes), 3))
        centre[:, : self._probe.gdim] = cells.corners.mean(axis=1)
        above = (centre - origin) @ normal > 0.0
        for layers in range(self._rings, 0, -1):
            core = size if layers > 1 else 0.0
            q = corners.extension(tips, i, layers * size, core)[corners.of_cell]
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
        return self._fill(
            tips, i, line, cells.chosen(rows), q[rows], above[rows],
            [int(p[0]) for p in parts], layers * size,
        )  # fmt: skip

    def _fill(
        self,
        tips: Tips,
        i: int,
        line: FrontLine,
        cells: FrontCells,
        q: Array,
        above: Bools,
        parts: list[int],
        radius: float,
    ) -> Ring:
        """A ring of given cells and extension at their corners."""
        continuum, gdim = self._continuum, self._probe.gdim
        thickness = getattr(continuum.model, "thickness", 1.0)
        geometry = CellGeometry(
            cells, continuum.degree, ring=self._ring, thickness=float(thickness)
        )
        volume = geometry.weight
        moved = geometry.gradient(q, corners=True) * volume[..., None, None]
        shift = geometry.at_corners(q) * volume[..., None]
        nodes, of_cell = np.unique(cells.nodes, return_inverse=True)
        stiffness = np.array([self._laws[p].stiffness for p in cells.part])
        expansion = np.array([self._laws[p].expansion for p in cells.part])
        rise, slope = self._temperatures(cells, geometry, shift)
        origin = self._probe.front.surface.x[tips.node[i]]
        length = self._length or float(tips.d_behind[i])
        laws = [self._laws[p].whole for p in parts]
        fields = TipFields(laws[0], laws[1], tips.frame[i], length)
        self._look_at_oscillation(fields.oscillation, length)
        m = self._n_modes
        tip = TipState.of(fields, geometry, origin, above, m)
        stress = tensor_of_stress(np.einsum("cij,mcqj->mcqi", stiffness, tip.strain))
        trace = np.einsum("cqii->cq", moved)
        # s : (H_a q') - s : e_a tr q', as C : (...) : (e - alpha T)
        turned = voigt_strain(np.einsum("mcqij,cqjk->mcqik", tip.gradient, moved))
        turned -= tip.strain * trace[..., None]
        turned[..., 2] += np.einsum("mcqi,cqi->mcq", tip.hoop, shift)
        held = np.einsum("cij,mcqj->mcqi", stiffness, turned)
        modes = tensor_of_stress(held) + np.einsum("mcqij,cqkj->mcqik", stress, moved)
        if self._ring:
            out = divergence_in_rings(stress, geometry.radius)
            modes += out[..., :, None] * shift[..., None, :]
        by_rise = -np.einsum("mcqi,ci,pcq->mp", held, expansion, rise)
        pressed = np.einsum("mcqij,cij->mcq", stress, _strain_tensor(expansion))
        by_rise += np.einsum("mcq,pcq->mp", pressed, slope)
        body, by_load = self._body(cells, geometry, shift, tip.gradient)
        faces = FaceTractions(self._on_faces, q, cells, above, nodes, len(self._loads), gdim=gdim)
        by_load -= faces.interaction(fields, origin, m)
        by_node = np.zeros((m, len(nodes), gdim))
        outer = outer_faces(
            cells, geometry, q, self._own_facets(cells), fields, origin, above, stiffness, m,
            float(thickness),
        )  # fmt: skip
        for mode in range(m):
            np.add.at(by_node[mode], of_cell.reshape(cells.nodes.shape), outer[mode])
        area = line.widths(tips, i)
        if gdim == 2:
            area = float(continuum.model.breadth(origin[None])[0])
        return Ring(
            nodes, of_cell.reshape(cells.nodes.shape), geometry, stiffness, expansion, moved,
            rise, slope, body, faces, modes, by_node, by_rise, by_load, fields.energy[:m, :m], area,
            radius, fields.oscillation,
        )  # fmt: skip

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
                    flat = geometry.x.reshape(-1, 3).T
                    force[..., axis] = np.reshape(value(flat), geometry.weight.shape)
                else:
                    force[..., axis] = float(value)
            force *= cells.marks[:, column, None, None]
            body[k] = force[..., :, None] * shift[..., None, :]
            by_load[:, k] = -np.einsum("cqij,mcqij->m", body[k], tip)
        return body, by_load

    # -- evaluation ----------------------------------------------------------------------

    def measure(self, tips: Tips, state: State) -> Array:
        """What the integrals are found from, linear between equilibria; collective.

        Returns:
            Displacements of the ring of each tip, temperature and load factors, filled up with
            zeros, shape (n_tips, m).
        """
        self.prepare(tips)
        assert self._of is not None
        bodies = self._bodies
        if self._last is None or self._last[0] is not state:
            u = bodies.displacements(self._needed, state)
            self._last = state, u, self._needed
        u = self._last[1]
        factors = np.concatenate([bodies.temperature_factors(state), bodies.load_factors(state)])
        gdim, rings = self._probe.gdim, self._of[2]
        width = gdim * max(len(r.nodes) for r in rings)
        out = np.zeros((len(tips), width + len(factors)))
        out[:, width:] = factors
        for row, ring in enumerate(rings):
            at = np.searchsorted(self._needed, ring.nodes)
            out[row, : gdim * len(at)] = u[at].ravel()
        return out

    def values(self, tips: Tips, measured: Array) -> DomainValues:
        """The integrals at tips of the present front, some perhaps several times.

        Args:
            tips: Front nodes.
            measured: From :meth:`measure`, or linear between such values, shape (n_tips, m).
        """
        assert self._of is not None
        _, _, rings, row = self._of
        total = np.zeros(len(tips))
        shares, factors = np.zeros((len(tips), 3)), np.zeros((len(tips), 3))
        for i, node in enumerate(tips.node):
            ring = rings[row[int(node)]]
            total[i], shares[i], factors[i] = self._at(ring, measured[i])
        return DomainValues(total, shares, factors)

    def _at(self, ring: Ring, measured: Array) -> tuple[float, Array, Array]:
        """G, shares of the modes and intensity factors of one tip."""
        gdim, n_patterns, n_loads = self._probe.gdim, len(ring.rise), len(self._loads)
        u = measured[: gdim * len(ring.nodes)].reshape(-1, gdim)
        factors = measured[len(measured) - n_patterns - n_loads :]
        heat, load = factors[:n_patterns], factors[n_patterns:]
        gradient = ring.geometry.gradient(u[ring.of_cell])
        total = self._energy(ring, gradient, heat, load) + ring.faces.work(u, load)
        found = np.einsum("mcqij,cqij->m", ring.modes, gradient)
        found = found + np.einsum("mnc,nc->m", ring.modes_by_node, u)
        found = found + ring.modes_by_rise @ heat + ring.modes_by_load @ load
        half = 0.5 * found / ring.area
        k = np.linalg.solve(ring.energy, half)
        parts = np.zeros(3)
        parts[: len(k)] = k * half
        parts[[0, 1]] = parts[[1, 0]]
        every = np.zeros(3)
        every[: len(k)] = k
        every[[0, 1]] = every[[1, 0]]
        whole = parts.sum()
        # where nothing is released, there is nothing to share out
        shares = parts / whole if whole > 0.0 else np.array([1.0, 0.0, 0.0])
        shares[np.abs(shares) < _NO_SHARE] = 0.0
        return total / ring.area, shares, every

    def _energy(self, ring: Ring, gradient: Array, heat: Array, load: Array) -> float:
        """The integral over the cells."""
        rise = np.einsum("p,pcq->cq", heat, ring.rise)
        strain = voigt_strain(gradient) - rise[..., None] * ring.expansion[:, None]
        stress = np.einsum("cij,cqj->cqi", ring.stiffness, strain)
        density = 0.5 * np.einsum("cqi,cqi->cq", stress, strain)
        tensor = tensor_of_stress(stress)
        total = np.einsum("cqij,cqik,cqkj->", tensor, gradient, ring.moved, optimize=True)
        total -= np.einsum("cq,cqii->", density, ring.moved)
        if len(heat):
            slope = np.einsum("p,pcq->cq", heat, ring.slope)
            total += np.einsum("cqi,ci,cq->", stress, ring.expansion, slope)
        if ring.body is not None:
            total -= np.einsum("l,lcqij,cqij->", load, ring.body, gradient)
        return float(total)

    # -- messages ------------------------------------------------------------------------

    def _say(self, what: str, words: str, *values: Any) -> None:
        """Warn once."""
        if what not in self._said:
            self._said.add(what)
            log.warn(words, *values)

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


_NO_SHARE = 1e-12
"""Shares of a mode below this are round-off."""

_CLOSED = 1e-9
"""Openings below this part of the jump behind a tip are none."""


def domain_rates(found: DomainValues, opening: Array, *, contact: bool) -> Array:
    """Energy release rates by mode, shape (n, 3) [force/length].

    Mode I is left out where faces in contact are closed behind the tip, and where it closes the
    crack.

    Args:
        found: The integrals.
        opening: Jumps behind the tips in their frames, shape (n, k, 3) [length].
        contact: Whether open faces cannot pass through each other.
    """
    shares = found.shares.copy()
    if contact:
        size = np.abs(opening).max(axis=(1, 2))
        closed = opening[:, 0, 0] <= _CLOSED * size
        shares[closed, 0] = 0.0
        rest = shares[closed].sum(axis=1, keepdims=True)
        shares[closed] /= np.where(rest > 0.0, rest, 1.0)
    shares[found.factors[:, 0] <= 0.0, 0] = 0.0
    return np.asarray(found.energy[:, None] * shares)


def _reach(line: FrontLine) -> float:
    """Length of the longest segment of a front."""
    ends = line.x[line.segments]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max(initial=0.0))


def _strain_tensor(strain: Array) -> Array:
    """Tensor of a Voigt strain, shape (..., 6) to (..., 3, 3)."""
    half = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
    return tensor_of_stress(strain * half)
