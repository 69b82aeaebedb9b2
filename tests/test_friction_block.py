"""Coulomb friction on small dense systems: the law, the increments, the exact path in 2-D."""

from __future__ import annotations

from itertools import pairwise

import hypothesis.strategies as st
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings

from fxcrack.base.errors import ConvergenceError
from fxcrack.equilibrium.contact import ContactSystem, Equilibrium, work_between
from fxcrack.equilibrium.coulomb import (
    OPEN,
    SLIP,
    STICK,
    ContactBlock,
    Increment,
    NodeStates,
    backward_euler,
)
from fxcrack.equilibrium.friction import Friction

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-8  # condition numbers up to 1e4, slip directions settle to 1e-10 of the forces

seeds = st.integers(0, 10**6)


def random_block(
    seed: int, m: int, d: int, *, weak: bool = False
) -> tuple[ContactBlock, Array, Array]:
    """A positive definite block with gaps and coefficients, a load, and a reference."""
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.standard_normal((m * d, m * d)))
    k = (q * np.geomspace(1e-2, 1.0, m * d)) @ q.T
    if weak:
        # normal and tangential jumps hardly coupled: no slip is unstable
        normal = np.arange(m * d) % d == 0
        k[normal[:, None] != normal] *= 0.05
    gap = rng.choice([0.0, 0.0, 0.3], m)
    mu = rng.choice([0.0, 0.1, 0.3, 0.5], m)
    load = rng.standard_normal(m * d)
    load[::d] -= 0.7
    return ContactBlock(0.5 * (k + k.T), gap, mu), load, 0.1 * rng.standard_normal((m, d - 1))


def free_states(m: int, d: int) -> NodeStates:
    direction = np.zeros((m, d - 1))
    direction[:, 0] = 1.0
    return NodeStates(np.full(m, STICK), direction)


def solved(block: ContactBlock, load: Array, reference: Array) -> Increment:
    start = np.column_stack([-block.gap, reference])
    return backward_euler(block, load, reference, free_states(len(block.mu), block.dim), start)


def assert_coulomb(block: ContactBlock, load: Array, reference: Array, found: Increment) -> None:
    """Signorini's and Coulomb's conditions, and the balance of forces, node by node."""
    p = block.forces(found.jump, load)
    assert p == pytest.approx(found.force, abs=ROUND_OFF)
    gap, normal = found.jump[:, 0] + block.gap, p[:, 0]
    assert gap.min() > -ROUND_OFF and normal.min() > -ROUND_OFF
    assert np.abs(gap * normal).max() < ROUND_OFF
    slip = found.jump[:, 1:] - reference
    shear, moved = np.linalg.norm(p[:, 1:], axis=1), np.linalg.norm(slip, axis=1)
    assert np.all(shear <= block.mu * normal + ROUND_OFF)
    closed = gap < ROUND_OFF
    # slip only at the bound, and against the traction
    assert np.all((moved * (block.mu * normal - shear))[closed] < ROUND_OFF)
    power = np.einsum("ni,ni->n", p[:, 1:], slip)
    assert power[closed] == pytest.approx(-(shear * moved)[closed], abs=ROUND_OFF)
    assert -power.sum() > -ROUND_OFF


@pytest.mark.slow
@given(seed=seeds, m=st.integers(1, 12), d=st.sampled_from([2, 3]))
@settings(max_examples=150)
def test_an_increment_obeys_the_laws(seed: int, m: int, d: int) -> None:
    block, load, reference = random_block(seed, m, d)
    assert_coulomb(block, load, reference, solved(block, load, reference))


@pytest.mark.slow
@given(seed=seeds, angle=st.floats(0.0, 6.28))
@settings(max_examples=40)
def test_a_turned_tangent_frame_turns_the_answer(seed: int, angle: float) -> None:
    m = 6
    block, load, reference = random_block(seed, m, 3)
    turn = np.eye(3)
    turn[1:, 1:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    whole = np.kron(np.eye(m), turn)
    other = ContactBlock(whole @ block.stiffness @ whole.T, block.gap, block.mu)
    one = solved(block, load, reference)
    two = solved(other, whole @ load, reference @ turn[1:, 1:].T)
    assert two.jump == pytest.approx(one.jump @ turn.T, abs=1e-6)  # S is 100 times softer than p


def system_of(block: ContactBlock, seed: int) -> tuple[ContactSystem, Array]:
    """A jump system with the jumps of the block retained, two supports, and a target for them."""
    rng = np.random.default_rng(seed)
    n = len(block.stiffness)
    m, d = len(block.mu), block.dim
    columns = rng.standard_normal((n, 2))
    columns[::d, 0] = np.abs(columns[::d, 0])
    own = columns.T @ np.linalg.solve(block.stiffness, columns) + np.eye(2)
    schur = np.block([[block.stiffness, columns], [columns.T, own]])
    system = ContactSystem(schur, n, 2, 0)
    system.gap[::d] = block.gap
    system.contact[::d] = True
    friction = Friction(d)
    states = free_states(m, d)
    friction.add(
        np.arange(n).reshape(m, d),
        np.column_stack([np.zeros(m, dtype=int), np.arange(m)]),
        block.mu,
        block.gap,
        np.where(block.gap > 0.0, OPEN, STICK),
        states.direction,
        np.zeros((m, d - 1)),
    )
    system.set_friction(friction)
    return system, columns


def follow(
    system: ContactSystem, state: Equilibrium, loads: Array, block: ContactBlock
) -> tuple[Equilibrium, float, float]:
    """Follow to loads; the end, the work and the energy friction took."""
    friction = system.friction
    assert friction is not None
    none = np.zeros(system.n_retained)
    work = taken = 0.0
    for _, point in system.pieces(state, loads, none):
        p = friction.traction(system, point)
        assert p[:, 0].min() > -ROUND_OFF
        assert np.all(np.linalg.norm(p[:, 1:], axis=1) <= block.mu * p[:, 0] + ROUND_OFF)
        gap = point.jump.reshape(p.shape)[:, 0] + block.gap
        assert gap.min() > -ROUND_OFF
        step = friction.dissipation(system, state, point)
        if block.dim == 2:
            assert step > -ROUND_OFF
            # the other way to compute it: pressure times slip, node by node
            before = friction.traction(system, state)
            slip = (point.jump - state.jump).reshape(p.shape)[:, 1]
            rough = block.mu > 0.0
            exact = 0.5 * block.mu * (before + p)[:, 0] * np.abs(slip)
            assert step == pytest.approx(exact[rough].sum(), abs=ROUND_OFF)
        work += work_between(state, point, 0)
        taken += step
        state = point
    return state, work, taken


def legs(seed: int, m: int, d: int) -> tuple[float, float, float]:
    """Work, stored and dissipated energy after four changes of the loads."""
    block, _, _ = random_block(seed, m, d, weak=True)
    system, _ = system_of(block, seed)
    rng = np.random.default_rng(seed + 1)
    state = system.equilibrium(np.zeros(2), np.zeros(system.n_retained))
    work = taken = 0.0
    for _ in range(4):
        state, w, t = follow(system, state, rng.standard_normal(2), block)
        work, taken = work + w, taken + t
    return work, system.strain_energy(state), taken


@pytest.mark.slow
@given(seed=seeds, m=st.integers(1, 10))
@settings(max_examples=40)
def test_the_path_in_the_plane_keeps_the_laws_and_the_energy(seed: int, m: int) -> None:
    work, energy, taken = legs(seed, m, 2)
    # exact but for round-off of the largest terms
    assert work == pytest.approx(energy + taken, abs=1e-11 * (1.0 + energy + taken))


@pytest.mark.quick("1-2")
@pytest.mark.parametrize(("seed", "m"), [(1, 2), (13, 4), (25, 6)])
def test_the_path_in_space_keeps_the_laws_and_the_energy(seed: int, m: int) -> None:
    work, energy, taken = legs(seed, m, 3)
    # contact that changes within an increment may lose 1e-7 of the energy each time
    assert work == pytest.approx(energy + taken, abs=1e-6 * (1.0 + energy + taken))


@pytest.mark.slow
@given(seed=seeds, m=st.integers(1, 8))
@settings(max_examples=8)
def test_many_increments_come_to_the_exact_path(seed: int, m: int) -> None:
    block, _, _ = random_block(seed, m, 2, weak=True)
    system, _ = system_of(block, seed)
    friction = system.friction
    assert friction is not None
    none = np.zeros(system.n_retained)
    start = system.equilibrium(np.zeros(2), none)
    target = np.array([0.8, 0.4])
    saved = system.snapshot()
    exact, _, _ = follow(system, start, target, block)
    system.restore(saved)
    friction.commit(start.jump)
    for x in np.linspace(0.0, 1.0, 201)[1:]:
        state = system.equilibrium(x * target, none)
        friction.commit(state.jump)
    # backward Euler is of first order
    assert state.jump == pytest.approx(exact.jump, abs=0.02 * (1.0 + np.abs(exact.jump).max()))


def test_a_spring_pulls_a_block_that_sticks_slips_and_sticks_again():
    # one node pressed by 2, mu = 0.25, tangential stiffness 1, pulled by u: slips at u = 0.5
    block = ContactBlock(np.diag([1.0, 1.0]), np.zeros(1), np.array([0.25]))
    system = ContactSystem(
        np.array([[1.0, 0, 2.0, 0], [0, 1.0, 0, -1.0], [2.0, 0, 9.0, 0], [0, -1.0, 0, 1.0]]),
        2, 2, 0,
    )  # fmt: skip
    system.contact[0] = True
    friction = Friction(2)
    friction.add(
        np.array([[0, 1]]), np.zeros((1, 2), dtype=int), block.mu, block.gap,
        np.array([STICK]), np.ones((1, 1)), np.zeros((1, 1)),
    )  # fmt: skip
    system.set_friction(friction)
    state = system.equilibrium(np.array([1.0, 0.0]), np.zeros(2))
    for target, slip, force, taken in [
        (0.4, 0.0, -0.4, 0.0),
        (1.5, 1.0, -0.5, 0.5),
        (0.9, 1.0, 0.1, 0.0),
        (-0.5, 0.0, 0.5, 0.5),
    ]:
        pieces = [(0.0, state)]
        pieces += list(system.pieces(state, np.array([1.0, target]), np.zeros(2)))
        energy = sum(friction.dissipation(system, a[1], b[1]) for a, b in pairwise(pieces))
        state = pieces[-1][1]
        assert state.jump[1] == pytest.approx(slip, abs=1e-14)
        assert friction.traction(system, state)[0, 1] == pytest.approx(force, abs=1e-14)
        assert energy == pytest.approx(taken, abs=1e-14)


def test_a_body_that_slides_away_is_an_error_in_words():
    # nothing but friction resists the tangential force
    block = ContactBlock(np.diag([1.0, 0.0]), np.zeros(1), np.array([0.3]))
    inside = backward_euler(
        block, np.array([-1.0, 0.2]), np.zeros((1, 1)), free_states(1, 2), np.zeros((1, 2))
    )
    assert inside.states.status[0] == STICK
    with pytest.raises(ConvergenceError, match="friction alone should hold a body it slides"):
        backward_euler(
            block, np.array([-1.0, 0.4]), np.zeros((1, 1)), free_states(1, 2), np.zeros((1, 2))
        )


def test_states_survive_a_snapshot():
    block, _, _ = random_block(3, 5, 2, weak=True)
    system, _ = system_of(block, 3)
    none = np.zeros(system.n_retained)
    start = system.equilibrium(np.zeros(2), none)
    half, _, _ = follow(system, start, np.array([0.7, -0.4]), block)
    saved = system.snapshot()
    once, _, _ = follow(system, half, np.array([0.1, 0.9]), block)
    system.restore(saved)
    assert np.array_equal(system.snapshot().closed, saved.closed)
    again, _, _ = follow(system, half, np.array([0.1, 0.9]), block)
    assert again.jump == pytest.approx(once.jump, abs=1e-13)
    assert SLIP in system.friction.states.status  # type: ignore[union-attr]
