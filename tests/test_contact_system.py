"""Equilibrium of the interface with contact: optimality of what it finds, energy along the way.

The structures are random: a full stiffness K over (inner, retained, support) unknowns and force
patterns, condensed here by plain linear algebra. Conditions of optimality on K are sufficient for
the (convex) contact problem, so checking them needs no second solver.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fxcrack.base.errors import ConvergenceError
from fxcrack.equilibrium import growing_cholesky, jump_system
from fxcrack.equilibrium.cohesive_law import CohesiveBond
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium, bond_work, work_between
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite

Array = npt.NDArray[np.float64]

N_INNER, N_SUPPORTS, N_FORCES = 6, 2, 2
ROUND_OFF = 1e-9  # condition numbers up to 1e4


@dataclass
class Structure:
    """K over (inner, retained, supports), force patterns f on the first two."""

    k: Array
    f: Array
    n_retained: int

    @classmethod
    def random(cls, n_retained: int, seed: int) -> Structure:
        rng = np.random.default_rng(seed)
        n = N_INNER + n_retained + N_SUPPORTS
        q, _ = np.linalg.qr(rng.standard_normal((n, n)))
        k = (q * np.geomspace(1e-3, 1.0, n)) @ q.T
        f = rng.standard_normal((n, N_FORCES))
        f[N_INNER + n_retained :] = 0.0
        return cls(k, f, n_retained)

    def system(self) -> ContactSystem:
        """S over (retained, supports, force patterns, one monitor: the first inner unknown)."""
        n = len(self.k)
        monitor = np.zeros((n, 1))
        monitor[0] = 1.0
        borders = np.hstack([-self.f, monitor])
        a = np.block([[self.k, borders], [borders.T, np.zeros((N_FORCES + 1, N_FORCES + 1))]])
        i = slice(0, N_INNER)
        r = slice(N_INNER, None)
        s = a[r, r] - a[r, i] @ np.linalg.solve(a[i, i], a[i, r])
        return ContactSystem(0.5 * (s + s.T), self.n_retained, N_SUPPORTS + N_FORCES, N_FORCES)

    def displacement(self, state: Equilibrium) -> Array:
        """All unknowns: inner ones from their equilibrium."""
        last = np.concatenate([state.jump, state.loads[:N_SUPPORTS]])
        load = self.f @ state.loads[N_SUPPORTS:]
        inner = np.linalg.solve(
            self.k[:N_INNER, :N_INNER], load[:N_INNER] - self.k[:N_INNER, N_INNER:] @ last
        )
        return np.concatenate([inner, last])

    def interface_forces(self, state: Equilibrium) -> Array:
        """K u - f on the retained jumps."""
        u = self.displacement(state)
        residual = self.k @ u - self.f @ state.loads[N_SUPPORTS:]
        assert residual[:N_INNER] == pytest.approx(np.zeros(N_INNER), abs=ROUND_OFF)
        return residual[N_INNER : N_INNER + self.n_retained]


def assert_optimal(structure: Structure, system: ContactSystem, state: Equilibrium) -> None:
    """Every row knows its force or its jump, and contact is complementary."""
    p = structure.interface_forces(state)
    assert system.forces(state, np.arange(system.n_retained)) == pytest.approx(p, abs=ROUND_OFF)
    contact, held = system.contact, ~system.free & ~system.contact
    free = system.free & ~contact
    assert np.all(state.jump[held] == 0.0)
    assert p[free] == pytest.approx(state.force[free], abs=ROUND_OFF)
    gap = (state.jump + system.gap)[contact]
    pressure = (p - np.where(system.free, state.force, 0.0))[contact]
    assert gap.min(initial=0.0) > -ROUND_OFF and pressure.min(initial=0.0) > -ROUND_OFF
    assert np.abs(gap * pressure).max(initial=0.0) < ROUND_OFF
    # conjugates: reactions; displacements of the force patterns; and the monitor
    u = structure.displacement(state)
    residual = structure.k @ u - structure.f @ state.loads[N_SUPPORTS:]
    assert state.conjugate[:N_SUPPORTS] == pytest.approx(residual[-N_SUPPORTS:], abs=ROUND_OFF)
    assert state.conjugate[N_SUPPORTS:] == pytest.approx(structure.f.T @ u, abs=100 * ROUND_OFF)
    assert system.monitors(state) == pytest.approx(u[:1], abs=100 * ROUND_OFF)
    assert system.strain_energy(state) == pytest.approx(
        0.5 * u @ structure.k @ u, rel=ROUND_OFF, abs=ROUND_OFF
    )


def opened(structure: Structure, rng: np.random.Generator, n_contact: int) -> ContactSystem:
    """A system with free components, some of which may touch over gaps, and held ones."""
    system = structure.system()
    free = rng.permutation(system.n_retained)[: system.n_retained - 2]
    system.release(free)
    touching = free[:n_contact]
    system.contact[touching] = True
    system.gap[touching] = rng.choice([0.0, 0.0, 0.3, 1.0], n_contact)
    return system


seeds = st.integers(0, 10**6)


@settings(max_examples=60)
@given(seeds)
def test_contact_is_optimal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    structure = Structure.random(12, seed)
    system = opened(structure, rng, 8)
    force = np.where(system.free & ~system.contact, rng.standard_normal(12), 0.0)
    for _ in range(3):
        state = system.equilibrium(rng.standard_normal(4), force)
        assert_optimal(structure, system, state)


@pytest.mark.parametrize("seed", range(8))
def test_contact_is_optimal_in_pieces(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Components are freed some at a time, products are of whole rows; nothing else changes."""
    rng = np.random.default_rng(seed)
    structure = Structure.random(12, seed)
    loads = rng.standard_normal(4)
    expected = opened(structure, np.random.default_rng(seed), 8).equilibrium(loads, np.zeros(12))
    for module in (growing_cholesky, jump_system):
        monkeypatch.setattr(module, "AT_ONCE", 2)
    system = opened(structure, np.random.default_rng(seed), 8)
    state = system.equilibrium(loads, np.zeros(12))
    assert_optimal(structure, system, state)
    assert state.jump == pytest.approx(expected.jump, abs=ROUND_OFF)


def test_what_was_freed_in_pieces_is_held_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last component is held by nothing: those before it are not free either."""
    schur = np.array([[1.0, -1.0, 0.5], [-1.0, 1.0, -0.5], [0.5, -0.5, 1.0]])
    monkeypatch.setattr(jump_system, "AT_ONCE", 1)
    system = ContactSystem(schur, 2, 1, 0)
    with pytest.raises(NotPositiveDefinite):
        system.release(np.array([0, 1]))
    assert not system.free.any() and not len(system.cholesky)
    system.release(np.array([0]))
    assert system.equilibrium(np.ones(1), np.zeros(2)).jump[0] == -0.5


@settings(max_examples=40)
@given(seeds)
def test_contact_by_enumeration(seed: int) -> None:
    """All closed sets tried: exactly one is consistent, the one found."""
    rng = np.random.default_rng(seed)
    structure = Structure.random(7, seed)
    system = opened(structure, rng, 4)
    loads, none = rng.standard_normal(4), np.zeros(7)
    state = system.equilibrium(loads, none)
    touching = np.flatnonzero(system.contact)
    s, consistent = system.schur, []
    for closed in product([False, True], repeat=4):
        jump = np.zeros(7)
        shut = touching[list(closed)]
        jump[shut] = -system.gap[shut]
        open_ones = np.setdiff1d(np.flatnonzero(system.free | system.contact), shut)
        g = s[:7, system.load_columns] @ loads + s[:7, shut] @ jump[shut]
        jump[open_ones] = np.linalg.solve(s[np.ix_(open_ones, open_ones)], -g[open_ones])
        pressure = s[:7, :7] @ jump + s[:7, system.load_columns] @ loads
        gap = (jump + system.gap)[touching]
        if gap.min() > -1e-12 and pressure[shut].min(initial=0.0) > -1e-12:
            consistent.append(jump)
    # a second one would differ by round-off only (a gap and a pressure that are both zero)
    assert consistent
    for jump in consistent:
        assert state.jump == pytest.approx(jump, abs=ROUND_OFF)


@pytest.mark.slow
@settings(max_examples=60)
@given(seeds)
def test_work_along_pieces_is_the_energy_gained(seed: int) -> None:
    """Every piece is linear between equilibria, so the trapezoidal rule is exact on it."""
    rng = np.random.default_rng(seed)
    structure = Structure.random(12, seed)
    system = opened(structure, rng, 8)
    none = np.zeros(12)
    state = system.equilibrium(np.zeros(4), none)
    start = system.strain_energy(state)
    work, largest = 0.0, 0.0
    for target in rng.standard_normal((3, 4)):
        begin, last = state, -1.0
        for fraction, point in system.pieces(state, target, none):
            assert last <= fraction <= 1.0
            way = (1.0 - fraction) * begin.loads + fraction * target
            assert point.loads == pytest.approx(way, abs=ROUND_OFF)
            work += work_between(state, point, N_FORCES)
            assert_optimal(structure, system, point)
            energy = system.strain_energy(point)
            largest = max(largest, energy)
            assert work == pytest.approx(energy - start, abs=ROUND_OFF * max(largest, 1.0))
            state, last = point, fraction
        assert last == 1.0
        assert np.array_equal(state.loads, target)
        again = system.equilibrium(target, none)
        assert state.jump == pytest.approx(again.jump, abs=ROUND_OFF)


@settings(max_examples=40)
@given(seeds)
def test_energy_of_a_release(seed: int) -> None:
    """Bond forces that go to zero at constant load: work = gain of strain energy + released."""
    rng = np.random.default_rng(seed)
    structure = Structure.random(12, seed)
    system = opened(structure, rng, 6)
    state = system.equilibrium(rng.standard_normal(4), np.zeros(12))
    energy = system.strain_energy(state)
    held = np.flatnonzero(~system.free & ~system.contact)
    force = np.zeros(12)
    force[held] = system.forces(state, held)
    system.release(held)
    system.contact[held[:1]] = rng.random() < 0.5
    last = Equilibrium(state.loads, force, state.jump, state.conjugate)
    work = released = 0.0
    for _, point in system.pieces(last, state.loads, np.zeros(12)):
        work += work_between(last, point, N_FORCES)
        released += bond_work(last, point)
        last = point
    assert_optimal(structure, system, last)
    gain = system.strain_energy(last) - energy
    assert work - released == pytest.approx(gain, rel=1e-8, abs=1e-8 * max(1.0, energy))
    assert released >= -ROUND_OFF


# -- cycling ---------------------------------------------------------------------------------------


def cycling() -> ContactSystem:
    """Three contacts on which the primal-dual active set cycles (Curtis, Han and Robinson 2015).

    Pressed by one load, only the first one opens, by 0.5.
    """
    schur = np.zeros((4, 4))
    schur[:3, :3] = [[4.0, 5.0, -5.0], [5.0, 9.0, -5.0], [-5.0, -5.0, 7.0]]
    schur[:3, 3] = schur[3, :3] = [-2.0, -1.0, 3.0]
    schur[3, 3] = 10.0
    system = ContactSystem(schur, 3, 1, 0)
    system.release(np.arange(3))
    system.contact[:] = True
    return system


def test_cycling_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """From every set of closed nodes the solution is found, from most by the second method."""
    calls = []
    plain = ContactSystem._least_squares
    monkeypatch.setattr(ContactSystem, "_least_squares", lambda *a: calls.append(1) or plain(*a))
    for closed in product([False, True], repeat=3):
        system = cycling()
        system._set_closed(np.array(closed))
        state = system.equilibrium(np.ones(1), np.zeros(3))
        assert state.jump == pytest.approx([0.5, 0.0, 0.0], abs=ROUND_OFF)
        assert np.array_equal(system.closed, [False, True, True])
    assert 4 <= len(calls) <= 8


def test_cycling_on_the_way() -> None:
    """All change at once at the first moment: the way to the end is still one linear piece."""
    system = cycling()
    none = np.zeros(3)
    start = system.equilibrium(np.zeros(1), none)
    ((fraction, end),) = system.pieces(start, np.ones(1), none)
    assert fraction == 1.0
    assert end.jump == pytest.approx([0.5, 0.0, 0.0], abs=ROUND_OFF)
    assert work_between(start, end, 0) == pytest.approx(system.strain_energy(end), rel=ROUND_OFF)


def test_no_solution_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    system = cycling()
    monkeypatch.setattr(system, "_least_squares", lambda *_: np.zeros(3, dtype=bool))
    with pytest.raises(ConvergenceError, match="nodes keep changing between open and closed"):
        system.equilibrium(np.ones(1), np.zeros(3))


@settings(max_examples=30)
@given(seeds)
def test_least_squares_finds_the_same_set(seed: int) -> None:
    """The method with guaranteed termination agrees with the active set."""
    rng = np.random.default_rng(seed)
    structure = Structure.random(20, seed)
    system = opened(structure, rng, 14)
    loads, none = rng.standard_normal(4), np.zeros(20)
    system.equilibrium(loads, none)
    expected = system.closed.copy()
    assert np.array_equal(system._least_squares(loads, none), expected)


def test_unrestrained_component() -> None:
    """Releasing the last bond of a body raises, and the system goes on as before."""
    schur = np.array([[1.0, -1.0, 0.5], [-1.0, 1.0, -0.5], [0.5, -0.5, 1.0]])
    system = ContactSystem(schur, 2, 1, 0)
    system.release(np.array([0]))
    before = system.equilibrium(np.ones(1), np.zeros(2))
    with pytest.raises(NotPositiveDefinite):
        system.release(np.array([1]))
    assert np.array_equal(system.free, [True, False])
    after = system.equilibrium(np.ones(1), np.zeros(2))
    assert np.array_equal(after.jump, before.jump) and after.jump[0] == -0.5


@given(st.integers(0, 2**31), st.integers(2, 6))
@settings(max_examples=30)
def test_an_offset_is_a_load_that_is_always_there(seed: int, n_retained: int) -> None:
    rng = np.random.default_rng(seed)
    whole = Structure.random(n_retained, seed).system()
    n_loads, last = N_SUPPORTS + N_FORCES, n_retained + N_SUPPORTS + N_FORCES - 1
    # the last force pattern, with factor 1, becomes the offset of a system without it
    keep = np.delete(np.arange(len(whole.schur)), last)
    part = ContactSystem(
        whole.schur[np.ix_(keep, keep)],
        n_retained,
        n_loads - 1,
        N_FORCES - 1,
        offset=whole.schur[keep, last],
    )
    loads = rng.standard_normal(n_loads)
    loads[-1] = 1.0
    force = np.zeros(n_retained)
    for system in (whole, part):
        system.contact[::2] = True
        system.release(np.arange(n_retained))
    one, other = whole.equilibrium(loads, force), part.equilibrium(loads[:-1], force)
    scale = np.abs(one.jump).max()
    assert other.jump == pytest.approx(one.jump, abs=ROUND_OFF * scale)
    assert np.array_equal(whole.closed, part.closed)
    assert part.monitors(other) == pytest.approx(whole.monitors(one), abs=ROUND_OFF * scale)
    rows = np.arange(n_retained)
    assert part.forces(other, rows) == pytest.approx(whole.forces(one, rows), abs=ROUND_OFF)
    # closed again and opened once more: the offset is not lost
    part.hold(np.array([1]))
    part.release(np.array([1]))
    again = part.equilibrium(loads[:-1], force)
    assert again.jump == pytest.approx(one.jump, abs=ROUND_OFF * scale)


@given(st.integers(0, 2**31), st.integers(2, 6))
@settings(max_examples=30)
def test_rates_are_differences_of_equilibria(seed: int, n_retained: int) -> None:
    rng = np.random.default_rng(seed)
    system = Structure.random(n_retained, seed).system()
    system.release(np.arange(0, n_retained, 2))
    loads, more = rng.standard_normal((2, N_SUPPORTS + N_FORCES))
    force, push = rng.standard_normal((2, n_retained))
    a, b = system.linear(loads, force), system.linear(loads + more, force + push)
    jump, conjugate = system.rates(more, push)
    scale = np.abs(a.jump).max() + np.abs(b.jump).max()
    assert b.jump - a.jump == pytest.approx(jump, abs=ROUND_OFF * scale)
    assert b.conjugate - a.conjugate == pytest.approx(conjugate, abs=ROUND_OFF * scale)


# -- contact of bonds that soften ------------------------------------------------------------------


def softening(seed: int, mixed: float) -> tuple[Structure, ContactSystem, CohesiveBond]:
    """Two open nodes in contact, and one whose bond softens in mixed mode; normals are 0, 2, 4."""
    structure = Structure.random(6, seed)
    system = structure.system()
    system.soft_contact = True
    system.release(np.arange(4))
    system.contact[[0, 2, 4]] = system.touches[4] = True
    direction = np.array([np.sin(mixed), np.cos(mixed)])
    # so slow that nothing is unstable: the smallest stiffness of the structure is 1e-3
    bond = CohesiveBond(
        np.array([4, 5]), direction, 1e-2, 50.0, (0, np.array([2, 2]), np.arange(2))
    )
    system.soften([bond])
    return structure, system, bond


@settings(max_examples=40)
@given(
    st.integers(0, 10_000),
    st.sampled_from([0.1, 0.8, 1.5]),
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
)
def test_contact_holds_faces_whose_bond_softens(
    seed: int, mixed: float, loads: list[float]
) -> None:
    """Conditions of optimality on K: the bond pulls by its law, contact pushes beside it."""
    structure, system, bond = softening(seed, mixed)
    force = np.zeros(6)
    state = system.equilibrium(np.array(loads), force)
    acting = structure.interface_forces(state)
    by_bond = -bond.force(bond.opening(state.jump)) * bond.direction
    size = 1.0 + np.abs(structure.k).sum(axis=1)[N_INNER : N_INNER + 6] @ np.abs(state.jump)
    pressure = acting.copy()
    pressure[4:] -= by_bond
    normals = np.array([0, 2, 4])
    assert np.abs(pressure[[1, 3, 5]]).max() < ROUND_OFF * size
    assert pressure[normals].min() > -ROUND_OFF * size
    assert state.jump[normals].min() > -ROUND_OFF * size
    assert np.abs(pressure * state.jump)[normals].max() < ROUND_OFF * size**2
    assert state.force[4:] == pytest.approx(by_bond, abs=ROUND_OFF * size)
    assert system.pressure(state, normals) == pytest.approx(pressure[normals], abs=ROUND_OFF * size)
    # in rates, and once the bond is gone, what is closed stays closed
    jump, _ = system.rates(np.ones(4), force)
    assert not jump[system.closed].any()
    closed = system.closed.copy()
    system.finish([bond])
    assert np.array_equal(system.closed, closed) and not system.free[closed].any()
    assert system.free[[1, 3, 5]].all()


def test_a_bond_runs_open_along_faces_that_contact_holds() -> None:
    """Unstable as it may slide, stable where it is held in both directions."""
    structure, system, bond = softening(3, 0.8)
    bond.final = 1e-3  # softens much faster than the bodies unload
    system.closed[4] = True
    assert not system.soft.stable(system.soft_held)
    assert system.soft.stable(np.array([True, True]))
    end = system.pass_unstable(Equilibrium(np.zeros(4), np.zeros(6), np.zeros(6), np.zeros(4)))
    assert not system.soft.bonds and system.closed[4] and not system.free[4]
    assert end.jump[4] == 0.0
    acting = structure.interface_forces(end)
    assert np.abs(acting[[0, 1, 2, 3, 5]]).max() < ROUND_OFF
