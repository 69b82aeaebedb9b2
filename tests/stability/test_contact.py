"""Contact: nodes that chatter, closed cracks, all nodes at once, one node, cycling active sets.

Hard: the set of closed nodes is what is looked for, and every guess changes all others. Must hold:
gaps and pressures are complementary to 1e-10 whatever way it came about, without a loop that does
not end; checked on the state itself, against a quadratic program solved by enumeration or by
another method, and by all invariants of :class:`~stability.watch.Watch`.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from specimens import bond, specimen

import fxcrack as fx
from fxcrack.base import compat
from fxcrack.equilibrium.contact import ContactSystem
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from stability.beams import FAR, SELF, arms, shift, watched

pytestmark = pytest.mark.stability

Array = npt.NDArray[np.float64]

A0 = 30.0


def contact_of(scene: fx.Scene) -> tuple[Array, Array]:
    """Gaps and pressures of the nodes that may touch, checked to be complementary."""
    system, state = scene.solver.system, scene.solver.state
    where = np.flatnonzero(system.contact)
    gap = (state.jump + system.gap)[where]
    push = system.forces(state, where) - state.force[where]
    last = np.abs(np.concatenate([state.jump, state.loads]))
    # forces are small differences of these: their round-off
    force = 0.1 * float((np.abs(system.schur[: len(last), : len(last)]) @ last).max())
    jump = np.abs(state.jump).max()
    assert gap.min() >= -1e-10 * jump
    assert push.min() >= -1e-10 * force
    assert np.abs(gap * push).max() <= 1e-10 * jump * force
    return gap, push


def beam(**options: Any) -> fx.Scene:
    return specimen(arms(), a0=A0, contact=True, criterion=fx.VCCT(GIc=1e9), **options)


def pins(amplitude: fx.Amplitude) -> list[fx.Displacement]:
    return [
        fx.Displacement("pin_top", x=0.0, y=1.0, amplitude=amplitude),
        fx.Displacement("pin_bottom", x=0.0, y=-1.0, amplitude=amplitude),
    ]


# -- scenes ----------------------------------------------------------------------------------------


def test_gaps_of_alternating_sign() -> None:
    """Faces with a ripple of 1e-3 of an element: every second node touches, the others must not.

    The slave nodes are moved by turns up and down and their gaps kept; pressed together, the ones
    below carry all, and the ones above follow as the press flattens the ripple.
    """
    mesh = arms()
    x = mesh.domain.geometry.x
    cells = mesh.group("upper", dim=2).entities
    nodes = np.unique(compat.geometry_dofmap(mesh.domain)[cells])
    face = nodes[np.abs(x[nodes, 1]) < 1e-9]
    ripple = 1e-3 * np.where(np.round(x[face, 0]).astype(int) % 2, 1.0, -1.0)
    x[face, 1] += np.where(x[face, 0] < A0 - 0.5, ripple, 0.0)
    loads = [
        fx.Pressure(side, 1.0, amplitude=fx.Amplitude((0.0, 1.0, 2.0), (0.0, 2.0, 0.0)))
        for side in ("top", "bottom")
    ]
    scene = specimen(
        mesh,
        supports=[*FAR, fx.Displacement("pin_bottom", x=0.0, y=0.0)],
        loads=loads,
        interface=bond(A0, contact=True, gap="keep"),
        criterion=fx.VCCT(GIc=1e9),
    )
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    gap, push = contact_of(scene)
    closed = np.count_nonzero(push > 0.0)
    assert 10 <= closed < len(gap)
    # taken off again: where overlapping nodes push each other apart, and nothing else
    scene.run(fx.Static(until=fx.Time(2.0)), progress=False)
    contact_of(scene)


def test_closed_crack_under_shear() -> None:
    """Pressed all over and sheared: it slips closed, G_I is zero, it grows in mode II."""
    scene = specimen(
        arms(),
        a0=A0,
        contact=True,
        supports=[
            fx.Displacement("far_lower", x=0.0, y=0.0),
            fx.Displacement("bottom", y=0.0),
            fx.Displacement("end_upper", x=1.0),
        ],
        loads=[fx.Pressure("top", 2e3)],
        criterion=fx.VCCT(GIc=0.2, GIIc=0.2, mix=fx.BK(eta=1.0)),
    )
    history = watched(scene, until=fx.Releases(6))
    assert history.reason == "6 nodes released"
    onsets = [r for r in history if r["event"] in ("onset", "unstable")]
    shear = np.array([r["GII[bond]"] for r in onsets], dtype=float)
    normal = np.array([r["GI[bond]"] for r in onsets], dtype=float)
    assert np.all(normal <= 1e-9 * shear) and np.all(shear > 0.0)
    _, push = contact_of(scene)
    assert np.count_nonzero(push > 0.0) > 20


@pytest.mark.parametrize("stepping", ["event", "increment"])
def test_all_nodes_close_at_once(stepping: str) -> None:
    """A body over a gap of 0.1 everywhere, moved down as a whole: all touch at one moment."""

    def make() -> Blocks:
        x, y = np.linspace(0.0, 20.0, 21), np.linspace(0.0, 2.0, 3)
        model, _, _ = two_bodies((x, x), (y, -y[::-1]), (), cell="quadrilateral", order=1)
        return model

    mesh = build(SELF, "blocks", make, None)
    shift(mesh, 0.1)
    scene = fx.Scene(
        mesh,
        materials=fx.Isotropic(70e3, 0.0),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("bottom", x=0.0, y=0.0),
            fx.Displacement("top", x=0.0, y=-0.2),
        ],
        bonds=[
            fx.Interface(
                "upper_face",
                "lower_face",
                bonded=lambda x: x[0] < -1.0,
                contact=True,
                gap="keep",
                tolerance=0.2,
                name="bond",
            )
        ],
    )
    step = fx.Static(until=fx.Time(1.0), stepping=stepping, initial=0.3)
    history = scene.run(step, progress=False)
    assert history.reason == "time 1 reached"
    _, push = contact_of(scene)
    # a column of height 4 shortened by 0.2 - 0.1, nu = 0: uniform pressure
    assert np.count_nonzero(push > 0.0) == 21
    pressure = push / scene.pairs[0].surface.areas
    assert pressure == pytest.approx(np.full(21, 70e3 * 0.1 / 4.0), rel=1e-9)
    # no reaction until it touches
    assert history["R[top.y]"][-1] == pytest.approx(-70e3 * 0.1 / 4.0 * 20.0, rel=1e-9)


@pytest.mark.parametrize("stepping", ["event", "increment"])
def test_contact_at_a_single_node(stepping: str) -> None:
    """Ends pressed together: the outermost pair alone carries it; opened and pressed again."""
    way = fx.Amplitude((0.0, 1.0, 2.0, 3.0), (0.0, -1e-3, 1.0, -1e-3))
    scene = beam(supports=[*pins(way), *FAR])
    step = fx.Static(until=fx.Time(1.0), stepping=stepping, initial=0.3)
    scene.run(step, progress=False)
    _, push = contact_of(scene)
    assert np.count_nonzero(push > 1e-6 * push.max()) <= 3  # the pair, and what tilts beside it
    first = push.sum()
    for time in (2.0, 3.0):
        step = fx.Static(until=fx.Time(time), stepping=stepping, initial=0.3)
        history = scene.run(step, progress=False)
        _, push = contact_of(scene)
        assert (push.max() > 1e-6 * first) == (time == 3.0)
    assert push.sum() == pytest.approx(first, rel=1e-9)
    assert np.abs(history["balance"]).max() <= 1e-9 * history["external_work"].max()


# -- the dense problem alone -----------------------------------------------------------------------


def chattering(n: int, seed: int) -> ContactSystem:
    """S = tridiagonal with off-diagonals of both signs, nearly singular, pushed by turns."""
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.standard_normal((n, n)))
    schur = np.zeros((n + 1, n + 1))
    schur[:n, :n] = (q * np.geomspace(1e-6, 1.0, n)) @ q.T
    schur[:n, :n] = 0.5 * (schur[:n, :n] + schur[:n, :n].T)
    schur[:n, n] = schur[n, :n] = np.where(np.arange(n) % 2, 1.0, -1.0) * rng.uniform(0.1, 1.0, n)
    schur[n, n] = 1e9
    system = ContactSystem(schur, n, 1, 0)
    system.release(np.arange(n))
    system.contact[:] = True
    return system


def enumerate_closed(system: ContactSystem) -> Array:
    """Jumps of the only consistent set, all 2^n tried."""
    n = system.n_retained
    s, g = system.schur[:n, :n], system.schur[:n, n]
    best, least = np.zeros(n), np.inf
    for closed in product([False, True], repeat=n):
        open_ones = np.flatnonzero(~np.array(closed))
        jump = np.zeros(n)
        if len(open_ones):
            jump[open_ones] = np.linalg.solve(s[np.ix_(open_ones, open_ones)], -g[open_ones])
        push = s @ jump + g
        wrong = max(float(np.max(-jump)), float(np.max(-push[list(closed)], initial=0.0)))
        if wrong < least:
            best, least = jump, wrong
    return best


@pytest.mark.slow
@settings(max_examples=25, phases=(Phase.explicit, Phase.generate))
@given(st.integers(0, 10**6))
def test_chattering_set_is_found(seed: int) -> None:
    """Ten nodes pushed by turns with condition 1e6, from any beginning; and on the way there."""
    system = chattering(10, seed)
    expected = enumerate_closed(system)
    scale = np.abs(expected).max()
    state = system.equilibrium(np.ones(1), np.zeros(10))
    assert state.jump == pytest.approx(expected, abs=1e-8 * scale)  # condition times round-off
    other = chattering(10, seed)
    other._set_closed(np.random.default_rng(seed).random(10) < 0.5)
    assert other.equilibrium(np.ones(1), np.zeros(10)).jump == pytest.approx(
        expected, abs=1e-8 * scale
    )
    walked = chattering(10, seed)
    start = walked.equilibrium(np.zeros(1), np.zeros(10))
    *_, (fraction, end) = walked.pieces(start, np.ones(1), np.zeros(10))
    assert fraction == 1.0
    assert end.jump == pytest.approx(expected, abs=1e-8 * scale)


def test_active_set_that_cycles_is_left() -> None:
    """The cycle of Curtis, Han and Robinson (2015), in blocks: every block cycles, all are left."""
    block = np.array([[4.0, 5.0, -5.0], [5.0, 9.0, -5.0], [-5.0, -5.0, 7.0]])
    n = 12
    schur = np.zeros((n + 1, n + 1))
    for k in range(0, n, 3):
        schur[k : k + 3, k : k + 3] = block
        schur[k : k + 3, n] = schur[n, k : k + 3] = [-2.0, -1.0, 3.0]
    schur[n, n] = 100.0
    for closed in product([False, True], repeat=3):
        system = ContactSystem(schur, n, 1, 0)
        system.release(np.arange(n))
        system.contact[:] = True
        system._set_closed(np.tile(closed, n // 3))
        state = system.equilibrium(np.ones(1), np.zeros(n))
        assert state.jump == pytest.approx(np.tile([0.5, 0.0, 0.0], n // 3), abs=1e-9)
