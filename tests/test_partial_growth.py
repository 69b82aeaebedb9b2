"""Fronts that advance through their elements in part: N(a), smooth fronts, energies, restart."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import (
    CLAMPED_3D,
    GROWS,
    HALF_OPENING,
    PARIS,
    PINS,
    bond,
    column,
    dcb,
    fatigue_law,
    fatigue_specimen,
    growth_curve,
    largest_imbalance,
    specimen,
    until_length,
)

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.steps import partial_growth

STEEP = fx.Paris(c1=50.0, c2=-2.0, c3=0.5, c4=10.6, r1=0.2, r2=0.95)


def test_a_tip_passes_its_elements_as_the_integral_says() -> None:
    curves = {}
    for partial in (False, True):
        scene = fatigue_specimen(criterion=fatigue_law(paris=STEEP, partial=partial))
        step = fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=until_length(scene, 34.0))
        history = scene.run(step)
        assert largest_imbalance(history) < 1e-9
        curves[partial] = growth_curve(history)
        if partial:
            # the same energy goes where the bonds did not snap
            assert history.details["tips"]["a"][:2] == pytest.approx([30.0, 30.25])
            dG = history.details["tips"]["dG"]
            assert all(b < a for a, b in pairwise(dG))  # no saw-tooth within elements
        scene.close()
    np.testing.assert_allclose(curves[True][0], curves[False][0], rtol=1e-9)
    # G within an element from four blocks and from its ends, at an exponent of 10.6
    np.testing.assert_allclose(curves[True][1][1:], curves[False][1][1:], rtol=0.02)


@pytest.mark.slow
def test_spacing_that_changes_does_not_show() -> None:
    # elements of 1, 0.5 and 1 again: the same life as from the rates at the nodes alone
    found = []
    for partial in (False, True):
        scene = specimen(
            dcb_2d(length=60.0, height=1.5, dx=0.5, ny=2, fine=(32.0, 34.0), coarse_dx=1.0),
            criterion=fatigue_law(partial=partial),
            supports=PINS,
        )
        step = fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=until_length(scene, 37.0))
        found.append(growth_curve(scene.run(step)))
        scene.close()
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=1e-9)
    assert np.ptp(np.diff(found[0][0])) > 0.1
    # the energy of releasing a node beside VCCT there: some per cent where lengths change
    np.testing.assert_allclose(found[1][1][1:], found[0][1][1:], rtol=0.05)


@pytest.mark.slow
def test_blocks_of_another_amplitude_add_up() -> None:
    whole = fatigue_specimen(criterion=fatigue_law(partial=True))
    parts = fatigue_specimen(criterion=fatigue_law(partial=True))
    until = until_length(whole, 33.0)
    curve = growth_curve(whole.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1, until=until)))
    whole.close()
    # a block of smaller cycles in between grows by its own integral, from within an element
    for _ in range(6):
        history = parts.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1, n_max=500.0))
        # the row at the end of a block shows its end, from within an element as well
        assert history["GI[bond]"][-1] == pytest.approx(history["G_max[bond]"][-1], rel=1e-9)
    rows = [r for r in history if r["event"] in ("release", "cycle", "limit")]
    a, N = column(rows, "a[bond]"), column(rows, "N")
    assert N[-1] == pytest.approx(3000.0)
    # the ends of blocks fall anywhere; a is linear between rows of elements only
    whole_a = np.interp(3000.0, curve[1], curve[0])
    assert a[-1] == pytest.approx(whole_a, abs=0.05)
    before = history.rows[-1]
    history = parts.run(fx.Cycles(maximum=0.8 * HALF_OPENING, ratio=0.1, n_max=1000.0))
    after = history.rows[-1]
    dG = [r["dG[bond]"] for r in history.rows if r.get("N", 0.0) >= 3000.0 and "dG[bond]" in r]
    grown = after["a[bond]"] - before["a[bond]"]
    low, high = (float(PARIS.growth_rate(g)) * 1000.0 for g in (min(dG[-2:]), max(dG[-2:])))
    assert 0.98 * low < grown < 1.02 * high
    assert dG[-1] == pytest.approx(0.64 * before["dG[bond]"], rel=0.1)
    assert largest_imbalance(history) < 1e-9
    parts.close()


def wide(comm: Any, dy: float, dx: float = 1.0, order: int = 1, **options: Any) -> fx.Scene:
    """A specimen in 3-D on which the front bows out."""
    law = fx.Paris(c1=0.0, c2=-2.0, c3=0.5, c4=5.0, r1=0.01, r2=0.99)
    mesh = dcb_3d(comm, length=24.0, height=1.5, width=10.0, dx=dx, dy=dy, ny=2, order=order)
    criterion = fx.Fatigue(**({"GIc": 5.0, "paris": law, "partial": True} | options))
    return specimen(mesh, a0=10.0, supports=CLAMPED_3D, criterion=criterion)


def front_of(scene: fx.Scene, dx: float = 1.0) -> tuple[fx.FrontLine, np.ndarray]:
    """The front, and how far it has come at its nodes."""
    (line,) = fx.front_lines(scene, "bond")
    return line, line.x[:, 0] + scene.fatigue.ligaments[0].part[line.node] * dx


def test_a_front_in_3d_whose_nodes_jump_is_warned_of(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once; not where the front grows in part, the default, nor where it is one element wide."""
    for dy, partial in ((2.5, None), (10.0, False), (2.5, False)):
        assert "jump one after" not in caplog.text
        scene = wide(MPI.COMM_SELF, dy, dx=2.0, partial=partial)
        for n in (1, 2):
            step = fx.Cycles(maximum=0.3, ratio=0.1, until=fx.Releases(n))
            history = scene.run(step, progress=False)
        assert bool((scene.fatigue.ligaments[0].part > 0.0).any()) == (partial is None)
        with monkeypatch.context() as patch:
            # whatever grows beside it in a further step, what has begun so goes on so
            patch.setattr(partial_growth, "why_by_node", lambda *_, **__: "friction")
            assert partial_growth.grows_in_part(scene.analysis) == (partial is None)
        if partial is None:  # rows at the beginning and the end of a step have the same front
            step = fx.Cycles(maximum=0.3, ratio=0.1, n_max=float(history["N"][-1]))
            n, reached = len(history), history["a[bond]"][-1]
            rows = scene.run(step, progress=False).rows[n:]
            assert rows[0]["a[bond]"] == pytest.approx(reached, rel=1e-12)
            assert rows[-1]["event"] == "end" and rows[-1]["a[bond]"] > reached
            assert rows[-1]["GI[bond]"] == pytest.approx(rows[-1]["G_max[bond]"], rel=1e-9)
        scene.close()
    assert caplog.text.count("jump one after") == 1
    for options, why in (
        ({"order": 2}, "elements of second order"),
        ({"method": "closure"}, "method='closure'"),
        ({"credit": True}, "credit=True"),
    ):
        order = options.pop("order", 1)
        scene = wide(MPI.COMM_SELF, 5.0, dx=4.0, partial=None, **options, order=order)
        scene.run(fx.Cycles(maximum=0.3, ratio=0.1, n_max=1e-6), progress=False)
        scene.close()
        assert f"({why})" in caplog.text


@pytest.mark.slow
def test_a_front_is_smooth_and_its_life_does_not_depend_on_the_width_of_elements() -> None:
    life = []
    for dy in (2.0, 1.0):
        scene = wide(MPI.COMM_WORLD, dy)
        history = scene.run(fx.Cycles(maximum=0.3, ratio=0.1, until=until_length(scene, 14.0)))
        assert largest_imbalance(history) < 1e-9
        tips = history.details["tips"]
        a, first = np.unique(tips["a"], return_index=True)
        N = np.exp(np.interp([12.0, 13.0], a[1:], np.log(np.array(tips["N"])[first][1:])))
        life.append(N[1] - N[0])
        line, x = front_of(scene)
        # the mirror image of itself; away from the edges G is the same all along the front
        np.testing.assert_allclose(x, x[::-1], atol=1e-5)
        G = line.values["GI"][1:-1]
        assert np.ptp(G) < 0.08 * G.mean()
        scene.close()
    # once the front has bowed out, cycles per millimetre do not depend on the mesh across
    np.testing.assert_allclose(life[1], life[0], rtol=0.03)
    # the front of static growth, whose bonds fade with their opening
    static = specimen(
        dcb_3d(length=24.0, height=1.5, width=10.0, dx=1.0, dy=1.0, ny=2),
        a0=10.0,
        supports=CLAMPED_3D,
        criterion=fx.VCCT(GIc=0.3),
        release=fx.ProgressiveRelease(),
    )
    static.run(fx.Static(until=until_length(static, 14.0)))
    nodes, left = static.solver.remaining(0)
    points = static.pairs[0].surface.x
    reached = {}
    for node, rest in zip(nodes, left, strict=True):
        z = round(float(points[node, 2]), 6)
        reached[z] = max(reached.get(z, 0.0), float(points[node, 0]) + 1.0 - float(rest))
    shape = np.array([reached[z] for z in np.round(line.x[:, 2], 6)])
    static.close()
    # both bow out by about one element; half an element at the edges, a tenth inside
    assert 0.4 < x.max() - x.min() < 1.2
    np.testing.assert_allclose(x - x.max(), shape - shape.max(), atol=0.5)
    np.testing.assert_allclose((x - x.max())[2:-2], (shape - shape.max())[2:-2], atol=0.1)


@pytest.mark.mpi
def test_ranks_agree(comm: Any) -> None:
    found = []
    for where in (comm, MPI.COMM_SELF):
        scene = wide(where, 2.5)
        history = scene.run(fx.Cycles(maximum=0.3, ratio=0.1, until=fx.Releases(4)))
        rows = [r for r in history if r["event"] in GROWS]
        found.append([(r["N"], r["a[bond]"], r["dG[bond]"]) for r in rows])
        scene.close()
    # ranks sum in another order; growth goes with the fifth power of G
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6)


@pytest.mark.slow
def test_going_on_from_a_checkpoint_within_an_element(tmp_path: Path) -> None:
    def make() -> fx.Scene:
        return dcb(MPI.COMM_WORLD, dx=1.0, ny=2, criterion=fatigue_law(partial=True))

    step = fx.Cycles(maximum=HALF_OPENING, ratio=0.1, n_max=2500.0)
    checkpoint = fx.Checkpoint(tmp_path / "state.npz", every=1)
    scene = make()
    whole = [scene.run(step), scene.run(step)][-1]
    part = scene.fatigue.ligaments[0].part.copy()
    scene.close()
    assert 0.0 < part.max() < 1.0
    for first in (True, False):
        # the second scene finds the first step finished, and its front within an element
        scene = make()
        scene.run(step, checkpoint=checkpoint, restart=True)
        if first:
            scene.close()
    again = scene.run(step)
    np.testing.assert_allclose(scene.fatigue.ligaments[0].part, part, rtol=1e-9)
    scene.close()
    for name in ("N", "a[bond]", "dG[bond]", "released_energy"):
        assert again.rows[-1][name] == pytest.approx(whole.rows[-1][name], rel=1e-9)


@pytest.mark.slow
def test_restart_within_a_step_goes_on_with_the_same_blocks(tmp_path: Path) -> None:
    """Where rates change much within an element blocks are short, and stay so after a restart."""
    step = fx.Cycles(maximum=0.1, ratio=0.1, until=fx.Releases(2))
    checkpoint = fx.Checkpoint(tmp_path / "state.npz", every=1)

    class Stopped(Exception):
        pass

    def stop(event: str, _: Any) -> None:
        if event == "release":
            raise Stopped

    def make() -> fx.Scene:
        paris = fx.Paris(c1=50.0, c2=-2.0, c3=0.5, c4=10.6, r1=0.01, r2=0.95)
        law = fatigue_law(GIc=0.6, paris=paris, partial=True)
        return specimen(dcb_2d(length=24.0, dx=2.0, ny=1), a0=8.0, criterion=law)

    scene = make()
    whole = scene.run(step, progress=False).rows
    scene.close()
    scene = make()
    with pytest.raises(Stopped):
        scene.run(step, checkpoint=checkpoint, observers=[stop], progress=False)
    scene.close()
    scene = make()
    again = scene.run(step, checkpoint=checkpoint, restart=True, progress=False).rows
    tips = scene.history.details["tips"]
    scene.close()
    # the premise: more blocks than four an element
    assert len(tips["N"]) > 2 * 4 + 1
    for name in ("N", "a[bond]", "dG[bond]"):
        assert again[-1][name] == pytest.approx(whole[-1][name], rel=1e-9)


def test_tips_whose_loads_are_out_of_phase_grow_by_their_own_rates() -> None:
    """Arms opened at both ends of a bond: together or in turn, each tip sees the same cycle.

    They are 13 thicknesses apart; what one end does at the other falls by exp(-13) and more.
    """
    law = fx.Paris(c1=50.0, c2=-2.0, c3=0.5, c4=4.0, r1=0.1, r2=0.95)
    times = (0.0, 1.0, 2.0, 3.0, 4.0)
    one = fx.Amplitude(times, (0.0, 1.0, 0.0, 0.0, 0.0))
    later = fx.Amplitude(times, (0.0, 0.0, 0.0, 1.0, 0.0))

    def lives(two: fx.Amplitude) -> dict[int, float]:
        interface = fx.Interface(
            "upper_face", "lower_face", lambda x: np.abs(x[0] - 30.0) <= 10.0 + 1e-9, name="bond"
        )
        scene = specimen(
            dcb_2d(length=60.0, dx=1.0, ny=2),
            interface=interface,
            criterion=fatigue_law(paris=law, partial=True),
            supports=[
                fx.Displacement("pin_top", x=0.0),
                fx.Displacement("pin_bottom", x=0.0),
                fx.Displacement("pin_top", y=0.5, amplitude=one),
                fx.Displacement("pin_bottom", y=-0.5, amplitude=one),
                fx.Displacement("far_upper", y=0.46, amplitude=two),
                fx.Displacement("far_lower", y=-0.46, amplitude=two),
            ],
        )
        step = fx.Cycles(period=(0.0, 4.0), until=fx.Releases(3))
        tips = scene.run(step, progress=False).details["tips"]
        scene.close()
        gone = np.flatnonzero(tips["released"])
        return {int(tips["node"][i]): float(tips["N"][i]) for i in gone}

    together, in_turn = lives(one), lives(later)
    assert sorted(together) == sorted(in_turn) and len(together) == 3
    for node, N in together.items():
        assert in_turn[node] == pytest.approx(N, rel=1e-5)


def test_arrest_within_an_element() -> None:
    law = fx.Paris(c1=0.0, c2=-2.0, c3=0.5, c4=4.0, r1=0.56, r2=0.9)  # stops at G = 0.224
    scene = fatigue_specimen(criterion=fatigue_law(paris=law, partial=True))
    history = scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1))
    assert history.reason.startswith("arrest")
    last = history.rows[-1]
    assert last["G_max[bond]"] == pytest.approx(0.56 * 0.4, rel=1e-3)
    assert 0.02 < last["a[bond]"] % 1.0 < 0.98
    scene.close()


@pytest.mark.parametrize(
    ("criterion", "options", "says"),
    [
        ({"method": "closure"}, {}, "partial=True needs method='vcct'"),
        ({}, {"order": 2}, "first-order elements only"),
        ({}, {"friction": 0.3}, "not available with friction"),
    ],
)
def test_where_fronts_cannot_advance_in_part(
    criterion: dict[str, Any], options: dict[str, Any], says: str
) -> None:
    rubs = {"contact": True, "friction": options["friction"]} if "friction" in options else {}
    with pytest.raises(fx.InputError, match=says):
        scene = specimen(
            dcb_2d(length=60.0, dx=2.0, ny=2, order=options.get("order", 1)),
            criterion=fatigue_law(partial=True, **criterion),
            interface=bond(30.0, **rubs),
        )
        scene.run(fx.Cycles(maximum=HALF_OPENING, ratio=0.1))
