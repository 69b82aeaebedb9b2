"""Every demo in a small size: one of its numbers, and the energy balance of its history.

The balance is the issue's 1e-6 of the work; pieces are linear, so it should be round-off.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.demos import (
    center_crack,
    dcb,
    dcb3d,
    domain_integral,
    effects_cost,
    enf,
    enhanced_dcb,
    fatigue_front,
    friction_enf,
    front3d,
    half_dcb,
    large_dcb,
    mmb,
    moment_dcb,
    penny,
    pinch,
    shell_dcb,
    skin_stringer,
    skin_stringer_panel,
    thermal_bilayer,
    two_cracks,
)

pytestmark = pytest.mark.demos


def balanced(history: fx.History) -> bool:
    """Whether the energy balance closes to 1e-6 of the largest work."""
    return bool(np.abs(history["balance"]).max() <= 1e-6 * np.abs(history["external_work"]).max())


@pytest.mark.smoke
def test_dcb_is_close_to_beam_theory():
    scene, rows = dcb.run(dx=0.5, ny=4, until=35.0)
    # plane strain is 0.35 % above the theory, the coarse mesh another 0.6 %
    assert all(row[2] == pytest.approx(row[4], rel=0.012) for row in rows)
    assert scene.solver.timings.factorizations == 1
    assert balanced(scene.history)


@pytest.mark.slow
def test_half_of_a_dcb_costs_half() -> None:
    (scene, half), (_, whole) = (half_dcb.run(h, dx=2.5, until=32.5) for h in (True, False))
    for name, part in {"load": 1.0, "G": 1.0, "released": 0.5, "unknowns": 0.5}.items():
        assert half[name] == pytest.approx(
            part * whole[name], rel=1e-9
        )  # the same but for rounding
    assert balanced(scene.history)


@pytest.mark.verification
def test_dcb_at_a_finer_mesh_is_within_one_per_cent():
    scene, rows = dcb.run(dx=0.25, ny=8, until=35.0)
    assert all(row[2] == pytest.approx(row[4], rel=0.01) for row in rows)
    scene.close()


def test_enf_is_close_to_beam_theory_and_does_not_penetrate():
    scene, rows = enf.run(dx=0.25, ny=8, until=42.0)
    for row in rows[:2]:
        # 1.2 % at this mesh, 0.9 % at half the size
        assert row[2] == pytest.approx(row[3], rel=0.02)
    assert balanced(scene.history)
    system = scene.solver.system
    gap = (scene.solver.state.jump + system.gap)[system.contact]
    assert gap.min() > -1e-10 * np.abs(scene.solver.state.jump).max()


@pytest.mark.quick("42.0")
@pytest.mark.parametrize("lever", mmb.LEVERS)
def test_mmb_is_close_to_the_standard(lever):
    scene, rows = mmb.run(lever)
    for _, _, one, beam_one, two, beam_two in rows:
        # the required 4 %; mode II is the slower one, 1.8 % on this mesh
        assert one == pytest.approx(beam_one, rel=0.04)
        assert two == pytest.approx(beam_two, rel=0.04)
    assert balanced(scene.history)


@pytest.mark.quick("1")
@pytest.mark.parametrize("order", [1, 2])
def test_penny_meets_sneddon(order):
    scene, found = penny.run(0.05, order)
    assert found["G / exact"] == pytest.approx(1.0, rel=0.01)  # the required 1 %
    assert found["opening / exact"] == pytest.approx(1.0, rel=0.01)
    assert balanced(scene.history)


def test_dcb3d_starts_at_mid_width_within_three_per_cent_of_the_published_load():
    found = dcb3d.onset(30.0, dx=0.5, dy=2.5, ny=2)
    assert found["load"] == pytest.approx(dcb3d.PUBLISHED[30], rel=0.03)  # the required 3 %
    assert found["z"] == pytest.approx(0.5 * dcb3d.WIDTH, abs=1.3)  # a node off at most


@pytest.mark.slow
@pytest.mark.parametrize("a", [31.0, 33.0, 35.0])
def test_dcb3d_onset_loads_along_the_way(a):
    found = dcb3d.onset(a)
    assert found["load"] == pytest.approx(dcb3d.PUBLISHED[round(a)], rel=0.03)  # the required 3 %


@pytest.mark.slow
def test_dcb3d_front_bows():
    scene = dcb3d.grow(dx=0.5, dy=1.25, ny=2, until=34.0)
    assert dcb3d.bow(scene) > 0.0
    assert balanced(scene.history)


@pytest.mark.slow
def test_shell_dcb_is_close_to_the_solids_with_long_cells():
    """Against a coarser reference than the demo's: second-order solids, 2 per arm, 2.5 long."""
    reference = shell_dcb.solve(shell_dcb.Model(False, 2.5, 5.0, ny=2, coarse=2.5))
    found = shell_dcb.solve(shell_dcb.Model(True, 5.0, 5.0, coarse=10.0))
    load, rate, strip = shell_dcb.beside(found, reference)
    assert abs(load) < 0.02 and abs(rate) < 0.02 and strip < 0.02  # the required 2 %
    assert found["unknowns"] < 0.25 * reference["unknowns"]


@pytest.mark.slow
def test_skin_stringer_counts_only_what_lies_under_the_foot():
    """Whole skin as slave, or the foot: one crack, whose G is the change of strain energy."""
    found = [
        skin_stringer.check(2.0, 10.0, 4.0, slave, order=1)
        for slave in ("skin_outside", "foot_bottom")
    ]
    for one in found:
        assert one["area"] == pytest.approx(160.0) and one["tips"] == 5.0
        # VCCT on elements half as long as the debond; the difference spans four of them
        assert one["VCCT"] == pytest.approx(one["-dU/dA"], rel=0.05)
    assert found[0]["VCCT"] == pytest.approx(found[1]["VCCT"], rel=1e-9)


@pytest.mark.slow
def test_skin_stringer_grows_under_the_foot():
    scene = skin_stringer.run(dx=2.0, dz=4.0, releases=60)
    history = scene.history
    assert balanced(history)
    grown = float(history["area[bond]"][-1] - history["area[bond]"][0])
    assert 50.0 < grown < 400.0
    released = scene.pairs[0].surface.x[[node for node, _ in scene.cracks[0].released]]
    assert np.all(np.abs(released[:, 0]) <= skin_stringer.FOOT + 1e-9)
    scene.close()


@pytest.mark.slow
def test_skin_stringer_panel_buckles_and_comes_off():
    """Flat, it has the stiffness of its laminates; then it buckles, and the debond grows."""
    demo = skin_stringer_panel
    scene, _ = demo.run(demo.Cells(order=1, along=8.0, foot=3, bay=5), until=0.4)
    history = scene.history
    flat = [
        -demo.at(history, "R[end.x]", t) / demo.flat_load(demo.SHORTENING * t) for t in (0.15, 0.4)
    ]
    assert flat[0] == pytest.approx(1.0, abs=5e-3)  # what is held at the end adds 0.06 %
    assert flat[1] < 0.9
    area = history["area[bond]"].astype(float)
    assert demo.at(history, "area[bond]", 0.15) == pytest.approx(area[0])
    assert area[-1] > 1.1 * area[0]
    scene.close()


def test_enhanced_dcb_spends_the_propagation_toughness():
    scene, found = enhanced_dcb.run(0.15, dx=1.0, ny=2, until=36.0)
    assert found["dissipated"] == pytest.approx(0.15, rel=0.01)  # the required 1 %
    assert balanced(scene.history)


@pytest.mark.slow
def test_front3d_progressive_release_spends_the_toughness():
    scene, found = front3d.run(fx.ProgressiveRelease(), until=42.0)
    assert found["dissipated"] == pytest.approx(front3d.G_IC, rel=0.015)  # the required 1.5 %
    assert balanced(scene.history)


@pytest.mark.slow
def test_center_crack_closes_the_circle():
    scenes, columns = center_crack.run(n_crack=10, releases=4, width=10.0)
    # the required 1e-6 between the three criteria
    np.testing.assert_allclose(columns[:, 2], columns[:, 1], rtol=1e-6)
    np.testing.assert_allclose(columns[:, 3], columns[:, 1], rtol=1e-6)
    assert all(balanced(scene.history) for scene in scenes)


@pytest.mark.slow
def test_two_cracks_grow_in_turn():
    scene, _ = two_cracks.run(dx=1.0, n_upper=3)
    released = [g.n_released for g in scene.cracks]
    assert min(released) > 0
    assert balanced(scene.history)


@pytest.mark.slow
def test_fatigue_front_bows_out_in_part_and_arrests_by_node():
    smooth = fatigue_front.run(True, dy=2.0, lengths=(11.0, 12.0))
    np.testing.assert_allclose(smooth.x[-1], smooth.x[-1][::-1], atol=1e-5)
    assert 0.4 < np.ptp(smooth.x[-1]) < 1.2  # as the front of static growth has it
    assert balanced(smooth.history)
    jumping = fatigue_front.run(False, dy=1.0, lengths=(11.0, 12.0))
    assert jumping.history.reason.startswith("arrest")
    assert float(jumping.history.rows[-1]["N"]) > float(smooth.history.rows[-1]["N"])


def test_moment_dcb_is_straight():
    scene, found = moment_dcb.run(dx=0.5, ny=4, until=26.0)
    assert found["bend"] < 0.005  # the required 0.5 %
    assert balanced(scene.history)


def test_friction_raises_the_onset_load_of_enf_as_beams_say():
    scenes, rows = friction_enf.run(dx=1.0, ny=3, until=36.0)
    for _, _, ratio, beams, _, _ in rows:
        assert ratio == pytest.approx(beams, abs=1e-3)  # 3e-4 was measured at mu = 0.6
    assert all(balanced(scene.history) for scene in scenes)


def test_the_loop_of_enf_with_friction_has_the_area_friction_took():
    scene, _, spent, area = friction_enf.loop(0.4, dx=1.0, ny=3)
    assert spent == pytest.approx(area, rel=0.02)  # corners of the loop lie between increments
    assert balanced(scene.history)


def test_pinch_keeps_the_slip_until_the_crack_opens():
    scene, _, rows = pinch.run(n_crack=20)
    for _, opening, exact_opening, slip, exact_slip, _ in rows:
        # 1.8 % at 20 elements per half crack, falling with the element size
        assert opening == pytest.approx(exact_opening, rel=0.025, abs=1e-9)
        assert slip == pytest.approx(exact_slip, rel=0.025, abs=1e-9)
    assert balanced(scene.history)


@pytest.mark.slow
def test_main_writes_what_it_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    dcb.main(tmp_path)
    names = {p.name for p in tmp_path.iterdir()}
    assert {"dcb.csv", "dcb.json", "load_opening.png", "r_curve.png", "deformed.png"} <= names
    assert "61 releases, 1 factorisation(s)" in capsys.readouterr().out


@pytest.mark.slow
def test_large_rotation_follows_the_elastica() -> None:
    scene, rows = large_dcb.run(dx=0.5, ny=2, until=41.0)
    for a, opening, load, rate, _ in rows:
        exact, exact_rate = large_dcb.at_opening(a, opening)
        # asked for are 2 %; 0.7 % of the load is left, 1.1 % of G: beam theory has no shear in it
        assert load == pytest.approx(exact, rel=0.02)
        assert rate == pytest.approx(exact_rate, rel=0.02)
        assert large_dcb.corrections(a, opening)[0] > 1.1  # far from small rotations
    largest = np.abs(scene.history["external_work"]).max()
    assert np.abs(scene.history["balance"]).max() <= 1e-4 * largest


@pytest.mark.slow
def test_the_domain_integral_does_not_see_jumps_of_the_spacing() -> None:
    # two elements over an arm, ratios of 1:4 to 4:1
    rows = np.array(domain_integral.run(ny=2))
    vcct, domain = rows[:, 2], rows[:, 4]
    assert domain == pytest.approx(np.ones(len(rows)), rel=0.01)
    assert np.ptp(domain) < 0.2 * np.ptp(vcct)


@pytest.mark.quick("None")
@pytest.mark.parametrize("solver", [None, "newton"])
def test_a_bilayer_that_cools_releases_its_steady_rate(solver: str | None) -> None:
    scene, rows = thermal_bilayer.run(dx=0.5, until=4.0, solver=solver)
    # steady once the crack is longer than two layers: 1 % asked for, 0.1 % found
    steady = rows[rows[:, 0] >= 2.0]
    assert len(steady) >= 3
    assert steady[:, 2] == pytest.approx(np.ones(len(steady)), rel=0.005)
    assert balanced(scene.history)


@pytest.mark.slow
def test_the_ladder_of_cost_counts_what_each_rung_adds() -> None:
    ladder = {name: found for name, _, found in effects_cost.run(dx=2.0, ny=1, until=34.0)}
    bare = ladder["bare"]
    assert bare.counts["factorisations"] == 1 and not bare.effects
    for name in ("contact", "friction", "temperature"):
        assert ladder[name].solver == "linear" and ladder[name].counts["factorisations"] == 1
    for name in ("finite strain", "plasticity"):
        assert ladder[name].solver == "newton" and ladder[name].counts["iterations"] > 0
