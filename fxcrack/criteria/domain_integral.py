"""Energy release rates by an integral over a ring of cells around each tip, and their modes.

The equations are those of :mod:`fxcrack.criteria.front_ring`. The integral needs the displacements
of the bodies around the tip: back-substitutions for condensed bodies. They are linear between two
equilibria of linear bodies, so that the load at which G reaches its critical value is found on them
without a further one.

The bodies of finite elements are too stiff around a tip, as a crack is that is shorter by a part C
of an element: the integral gives G of the front a distance C h behind the tip, h the mean length
of the elements before and behind it. So it is evaluated on the present front, and on the one that
releasing all its nodes would lead to, and G at the tip follows from both, linear in between
(:mod:`fxcrack.criteria.front_shift`). Intensity factors from the interaction integral have another
error of that kind; they are scaled to G.

With finite strain the total is J of the nominal stress; intensity factors are those of the
displacements less the mean rotation of the ring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.continuum.temperature import ByTemperature
from fxcrack.criteria.front_shift import NextFront, blend_to_tip
from fxcrack.criteria.probe import FrontProbe, State
from fxcrack.criteria.ring import Ring
from fxcrack.criteria.ring_builder import RingBuilder
from fxcrack.criteria.virtual_extension import FrontLine
from fxcrack.interface.front import Front
from fxcrack.interface.tips import Tips

_ROUGH = {
    1: "interface '%s': method='domain' on first-order tetrahedra along a front that ends on free "
    "faces, is straight or turns sharply: G of single nodes is not reliable (at the edges of a "
    "double cantilever beam it is off by its own size), and the mean of a front is 2 to 3 %% off, "
    "in bending up to 17 %%; take method='vcct'",
    2: "interface '%s': method='domain' on second-order tetrahedra along a front that ends on free "
    "faces, is straight or turns sharply: G of single nodes is off by up to 20 %%, more at kinks "
    "and free edges, and the mean of a front is 2 %% short in bending and 5 to 10 %% at 4 elements "
    "per radius; take method='vcct'",
}
"""Warnings where rates of single nodes stay as they are, by the order of the tetrahedra."""

RINGS = 3
"""Radius of the ring by default, in lengths of the cells at the tip."""


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


@dataclass(frozen=True)
class _Rings:
    """The rings of a front.

    Attributes:
        tips: Its nodes, by which it is recognised.
        placed: Position of the interface, likewise.
        now: Rings at the front, one per tip.
        following: The next front; ``None`` where there is none.
        later: Rings at its nodes.
        needed: Global displacement nodes of all rings, sorted, shape (n,).
        row: Position of each front node among the tips.
    """

    tips: Tips
    placed: int
    now: list[Ring]
    following: NextFront | None
    later: list[Ring]
    needed: Ints
    row: dict[int, int]

    def behind(self, i: int, j: int) -> Ring:
        """The ring that serves tip i on the next front, whose node j is ahead of it."""
        return self.later[j] if self.later else self.now[i]

    @property
    def stretch(self) -> float:
        """Length of the next front over that of the present one, as the rings have it."""
        if not self.later:
            return 1.0
        return sum(r.area for r in self.later) / sum(r.area for r in self.now)


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
        self._bodies = probe.bodies
        where = f"interface '{probe.pair.title}': method='domain'"
        refused = self._bodies.uncovered
        if not refused and probe.pair.friction is not None:
            refused = "friction of the faces, whose tractions are not known to it"
        if refused:
            raise InputError(
                f"{where} does not cover {refused}; take method='vcct' or method='closure'"
            )
        for material in self._bodies.continuum.part_materials:
            if isinstance(material, ByTemperature):
                raise InputError(
                    f"{where} does not cover stiffness tabulated against temperature; take "
                    "method='vcct' or method='closure'"
                )
        self._builder = RingBuilder(probe, rings, length)
        domain = self._bodies.continuum.mesh.domain
        self._cell = domain.topology.cell_name()
        self._of: _Rings | None = None
        self._said = False

    def prepare(self, tips: Tips) -> _Rings:
        """The rings of the present front; collective."""
        front = self._probe.front
        if self._of is not None and self._of.tips is tips and self._of.placed == front.placed:
            return self._of
        here = front.undeformed()
        there = here.tips()
        none = np.zeros(0, dtype=np.int64)
        order = self._bodies.continuum.order
        simplices = self._cell in ("triangle", "tetrahedron")
        later: list[Ring] = []
        if self._cell == "tetrahedron" and self._is_smooth(here, there):
            line = FrontLine.of(here, there)
            following = NextFront.of(here, there, simplices=True, order=order, length=line.length)
            opened, step = none, 0.0
            if following is not None:
                opened, step = following.opened, float(following.step[0])
            now = self._builder.of(here, there, none, ahead=opened, step=step)
            known = self._builder.fresh
        else:
            now = self._builder.of(here, there, none)
            known = self._builder.fresh
            following = NextFront.of(here, there, simplices=simplices, order=order)
            if following is not None:
                later = self._builder.of(following.front, following.tips, following.opened)
                known = known | self._builder.fresh
        self._builder.keep(known)
        needed = np.unique(np.concatenate([r.nodes for r in (*now, *later)]))
        row = {int(node): i for i, node in enumerate(tips.node)}
        self._of = _Rings(tips, front.placed, now, following, later, needed, row)
        return self._of

    def _is_smooth(self, front: Front, tips: Tips) -> bool:
        """Whether rates along a front of tetrahedra may be smooth; warns where not; collective."""
        if self._builder.is_smooth(front, tips):
            return True
        if not self._said:
            self._said = True
            order = self._bodies.continuum.order
            log.warn(_ROUGH[order], self._probe.pair.title)
        return False

    # -- evaluation ----------------------------------------------------------------------

    def measure(self, tips: Tips, state: State, force: Array) -> Array:
        """What the integrals are found from, linear between equilibria; collective.

        Args:
            tips: Front nodes.
            state: State of the solver.
            force: Bond forces at their force nodes in the tip frames, shape (n_tips, k, 3) [force].

        Returns:
            Per tip the displacements of its ring and of that of the next front, what the facets in
            between carry, temperature and load factors, filled up with zeros, shape (n_tips, m).
        """
        rings = self.prepare(tips)
        bodies = self._bodies
        u = bodies.displacements(rings.needed, state)
        factors = np.concatenate([bodies.temperature_factors(state), bodies.load_factors(state)])
        rows = [[_of_nodes(u, rings.needed, r)] for r in rings.now]
        if rings.following is not None:
            nodes, closed, pulls = rings.following.to_open(tips, force, self._probe, state)
            after = self._probe.opened(nodes, closed, pulls, state)
            v = u + bodies.changes(rings.needed, state, after)
            density = rings.following.to_come(tips, self._probe, state)
            for i, j in enumerate(rings.following.match):
                if j >= 0:
                    ring = rings.behind(i, j)
                    jump = self._probe.jumps(ring.opening.nodes, after)
                    rows[i] += [_of_nodes(v, rings.needed, ring), density[i], jump.ravel()]
        flat = [np.concatenate(row) for row in rows]
        width = max(len(row) for row in flat)
        out = np.zeros((len(tips), width + len(factors)))
        out[:, width:] = factors
        for i, row in enumerate(flat):
            out[i, : len(row)] = row
        return out

    def values(self, tips: Tips, measured: Array) -> DomainValues:
        """The integrals at tips of the present front, some perhaps several times.

        Args:
            tips: Front nodes.
            measured: From :meth:`measure`, or linear between such values, shape (n_tips, m).
        """
        rings = self._of
        assert rings is not None
        total = np.zeros(len(tips))
        shares, factors = np.zeros((len(tips), 3)), np.zeros((len(tips), 3))
        for i, node in enumerate(tips.node):
            row = rings.row[int(node)]
            total[i], shares[i], factors[i] = self._at(rings, row, measured[i])
        return DomainValues(total, shares, factors)

    def _at(self, rings: _Rings, row: int, measured: Array) -> tuple[float, Array, Array]:
        """G, shares of the modes and intensity factors of one tip."""
        gdim, ring = self._probe.gdim, rings.now[row]
        n_loads, n_patterns = len(self._bodies.loads), len(ring.rise)
        last = measured[len(measured) - n_patterns - n_loads :]
        heat, load = last[:n_patterns], last[n_patterns:]
        end = gdim * len(ring.nodes)
        u = measured[:end].reshape(-1, gdim)
        local = ring.turned_back(u) if self._bodies.finite else u
        k, parts = ring.factors(local, heat, load)
        whole = float(parts.sum())
        # where nothing is released, there is nothing to share out
        shares = parts / whole if whole > 0.0 else np.array([1.0, 0.0, 0.0])
        shares[np.abs(shares) < _NO_SHARE] = 0.0
        total = ring.energy_rate(u, heat, load, to_come=np.zeros(3), jump=np.zeros((0, 3)))
        following = rings.following
        if following is not None and following.match[row] >= 0:
            after = rings.behind(row, following.match[row])
            first, end = end, end + gdim * len(after.nodes)
            v = measured[first:end].reshape(-1, gdim)
            density = measured[end : end + 3]
            jump = measured[end + 3 : end + 3 + 3 * len(after.opening.nodes)].reshape(-1, 3)
            stretch = after.area / ring.area if gdim == 2 else rings.stretch
            later = stretch * after.energy_rate(v, heat, load, to_come=density, jump=jump)
            total = blend_to_tip(total, later, following.weight(row, np.clip(shares, 0.0, 1.0)))
        if whole > 0.0 and total > 0.0 and ring.alike:
            k = k * np.sqrt(total / whole)
        return total, shares, k


def _of_nodes(u: Array, nodes: Ints, ring: Ring) -> Array:
    """Displacements of the nodes of a ring, one after the other."""
    return np.asarray(u[np.searchsorted(nodes, ring.nodes)].ravel())


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
