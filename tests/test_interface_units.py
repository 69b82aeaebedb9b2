"""Element edges of second-order fronts: which rows let go together, and what a unit weighs."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from specimens import CLAMPED_3D, specimen

import fxcrack as fx
from fxcrack.demos import front3d
from fxcrack.interface.tips import Tips, edge_midsides, units_of
from fxcrack.meshes.dcb import dcb_3d


def front(nodes, area):
    """Tips of which only node numbers and areas matter."""
    n = len(nodes)
    zero = np.zeros(n)
    none = np.zeros((n, 2, 2))
    return Tips(
        np.array(nodes), none[..., 0].astype(int), none.astype(int), none, np.zeros((n, 3, 3)),
        zero, zero, zero, np.array(area, dtype=float),
        none[:, 0].astype(int), none[:, 0], zero, zero == 0.0, zero > 0.0,
    )  # fmt: skip


def test_corner_rows_count_half_for_each_of_two_edges():
    # corners 0, 1, 2 with midsides 10 and 11 between them; Simpson's areas of edges 6 and 12 wide
    units = units_of({10: (0, 1), 11: (1, 2)}, front([0, 1, 2, 10, 11], [1, 3, 2, 4, 8]))
    assert units.leaders.tolist() == [3, 4]
    np.testing.assert_allclose(
        units.shares, np.array([[1, 1.5, 0, 4, 0], [0, 1.5, 2, 0, 8]]) / [[6.5], [11.5]], rtol=1e-15
    )
    assert units.at_tips(np.array([2.0, 3.0])).tolist() == [2.0, 3.0, 3.0, 2.0, 3.0]
    # a rate that is the same everywhere is that of every unit
    np.testing.assert_allclose(units.mean(np.full((5, 3), 7.0)), 7.0, rtol=1e-15)


def test_rows_without_an_edge_stand_alone():
    # corner 1 has gone ahead with the edge on its left; corner 5 has no midside in the front
    units = units_of({11: (1, 2)}, front([2, 11, 5], [1, 4, 1]))
    assert units.leaders.tolist() == [1, 2]
    np.testing.assert_allclose(units.shares, [[0.2, 0.8, 0.0], [0.0, 0.0, 1.0]], rtol=1e-15)


def test_first_order_tips_are_units_of_their_own():
    mesh = dcb_3d(MPI.COMM_SELF, length=8.0, width=4.0, dx=2.0, dy=2.0, ny=1)
    scene = specimen(mesh, a0=4.0)
    surface = scene.pairs[0].surface
    assert edge_midsides(surface) == {}
    tips = front([4, 7, 9], [1, 2, 3])
    units = units_of({}, tips)
    np.testing.assert_array_equal(units.shares, np.eye(3))
    assert units.at_tips(np.array([5.0, 6.0, 7.0])).tolist() == [5.0, 6.0, 7.0]
    scene.close()


@pytest.mark.slow
def test_wide_second_order_front_softens_edge_by_edge():
    # Elements longer than an arm is thick: let go one by one, rows carried up to twice the load,
    # as G of the row at the free edge is negative.
    scene, interface = front3d.make_scene(
        30.0, fx.ProgressiveRelease(), dx=2.0, dy=5.0, ny=1, order=2
    )
    history = scene.run(fx.Static(until=fx.CrackLength(interface, 40.0)))
    opening, load = front3d.curve(history)
    # mean load over beam theory at the same opening, both taken over the opening: 1.5 % asked for
    between = np.linspace(opening[8], opening[-1], 500)
    theory = front3d.BEAM.dcb_load_at_opening(between, front3d.G_IC)
    work = history["external_work"]
    assert work[-1] - work[8] == pytest.approx(np.trapezoid(theory, between), rel=0.015)
    # the saw-tooth a front of four elements leaves, on 1.25 rows per arm thickness
    of_theory = load[8:] / front3d.BEAM.dcb_load_at_opening(opening[8:], front3d.G_IC)
    assert 0.96 < of_theory.min() and of_theory.max() < 1.04
    # bonds that are free have spent what their area asks for, no more and no less
    system, front = scene.solver.system, scene.solver.fronts[0]
    free = ~front.bonded & (front.surface.x[:, 0] > 30.0 - 1e-9)
    for soft in system.soft.bonds:
        free[soft.where[1]] = False
    area = front.surface.areas[free].sum()
    assert area > 100.0
    assert system.soft.finished == pytest.approx(front3d.G_IC * area, rel=1e-9)
    # and all that left the bodies agrees with it where the front is straight again
    straight = [np.flatnonzero(np.isclose(history["a[bond]"], a))[0] for a in (34.0, 36.0, 38.0)]
    spent = np.polyfit(history["area[bond]"][straight], history["released_energy"][straight], 1)[0]
    assert spent == pytest.approx(front3d.G_IC, rel=0.015)
    assert abs(history["balance"]).max() <= 1e-9 * work.max()
    scene.close()


def bowed():
    """A front in steps of up to two elements between neighbouring rows."""
    mesh = dcb_3d(MPI.COMM_SELF, length=60.0, width=20.0, dx=1.0, dy=2.5, ny=1, order=2)
    interface = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: x[0] >= 28.0 + 0.04 * (x[2] - 10.0) ** 2 - 1e-9,
        name="bond",
    )
    scene = specimen(
        mesh,
        interface=interface,
        criterion=fx.VCCT(GIc=front3d.G_IC),
        release=fx.ProgressiveRelease(),
        supports=CLAMPED_3D,
    )
    return scene, interface


def test_no_node_stays_behind_a_bowed_second_order_front():
    # one facet at a step says the front runs sideways; with that heading a node was never a tip
    scene, _ = bowed()
    front = scene.solver.fronts[0]
    for _ in range(12):
        tips = front.tips()
        front.release(np.unique(tips.force_nodes))
    x, z = front.surface.x[:, 0], front.surface.x[:, 2]
    assert not front.bonded[x < 28.0 + 11.0 + 0.04 * (z - 10.0) ** 2].any()
    scene.close()


@pytest.mark.slow
def test_bowed_second_order_front_straightens():
    scene, interface = bowed()
    history = scene.run(fx.Static(until=fx.CrackLength(interface, 37.0)))
    opening, load = front3d.curve(history)
    inside = history["a[bond]"] >= 34.0
    theory = front3d.BEAM.dcb_load_at_opening(opening[inside], front3d.G_IC)
    # 1.5 % asked for of a straight front, and what is left of the bow
    np.testing.assert_allclose(load[inside] / theory, 1.0, atol=0.02)
    area, spent = history["area[bond]"][inside], history["released_energy"][inside]
    assert np.polyfit(area, spent, 1)[0] == pytest.approx(front3d.G_IC, rel=0.015)
    scene.close()
