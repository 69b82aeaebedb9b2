"""What growth refuses and warns of, and that the words say what, where and how to correct it."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from test_criteria_in_analysis import STEEL, STRETCH, beyond_crack, outside_two_cracks, plate, run

import fxcrack as fx
from fxcrack.base.errors import InterfaceError
from fxcrack.meshes.center_crack import center_crack

STRESS = fx.CriticalStress(100.0, distance=0.25)
VCCT = fx.VCCT(GIc=0.1)
ENHANCED = fx.EnhancedVCCT(GIc=0.1, GIc_p=0.05)


def interface(**options: Any) -> fx.Interface:
    options = {"bonded": beyond_crack, "name": "bond", **options}
    return fx.Interface("upper_face", "lower_face", **options)


def scene_of(*debonds: fx.Debond) -> fx.Scene:
    return fx.Scene(
        center_crack(a=1.0, width=4.0, height=4.0, n_crack=5, fine=1.0, growth=1.0),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=STRETCH,
        debonds=debonds,
    )


def warnings(log: pytest.LogCaptureFixture) -> str:
    """Everything warned of so far."""
    return "\n".join(r.getMessage() for r in log.records if r.levelno == logging.WARNING)


# --- refused when it is written down --------------------------------------------------------------

REFUSED: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "normal only with VCCT": (
        lambda: fx.Debond(interface(normal_only=True), VCCT),
        ("interface 'bond'", "normal direction only", "not possible with VCCT", "bond in all"),
    ),
    "normal only with enhanced VCCT": (
        lambda: fx.Debond(interface(normal_only=True), ENHANCED),
        ("not possible with EnhancedVCCT",),
    ),
    "symmetry without normal only": (
        lambda: fx.Debond(interface(), fx.CrackOpening(1.0, distance=0.1, symmetry=True)),
        ("CrackOpening", "symmetry needs a bond in the normal direction only", "leave symmetry"),
    ),
    "amplitude with VCCT": (
        lambda: fx.Debond(interface(), VCCT, fx.AmplitudeRelease((0.0, 1.0), (1.0, 0.0))),
        (
            "interface 'bond'",
            "AmplitudeRelease is not possible with VCCT",
            "RampRelease(increments=...) or Prog",
        ),
    ),
    "progressive without toughness": (
        lambda: fx.Debond(interface(), STRESS, fx.ProgressiveRelease()),
        ("ProgressiveRelease is not possible with CriticalStress", "StepRelease or Amplitude"),
    ),
    "ramp with crack length": (
        lambda: fx.Debond(
            interface(), fx.CrackLengthVsTime((0.0,), (1.0,), reference="top"), fx.RampRelease()
        ),
        ("RampRelease is not possible with CrackLengthVsTime",),
    ),
    "amplitude that does not begin with 1": (
        lambda: fx.AmplitudeRelease((0.0, 1.0), (0.9, 0.0)),
        ("begins with fraction 0.9", "must begin with 1 at time 0"),
    ),
    "amplitude that begins late": (
        lambda: fx.AmplitudeRelease((0.1, 1.0), (1.0, 0.0)),
        ("at time 0.1", "must begin with 1 at time 0"),
    ),
    "amplitude that does not end with 0": (
        lambda: fx.AmplitudeRelease((0.0, 1.0), (1.0, 0.1)),
        ("ends with fraction 0.1", "must end with 0"),
    ),
    "no criterion": (
        lambda: fx.Debond(interface(), 0.17),  # type: ignore[arg-type]
        ("interface 'bond'", "float is not a criterion", "derive yours from Criterion"),
    ),
    "self-contact": (
        lambda: fx.Interface("upper_face", "upper_face"),
        ("'upper_face'", "self-contact", "two distinct facet groups"),
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_when_written(case: str) -> None:
    make, words = REFUSED[case]
    with pytest.raises(fx.InputError) as error:
        make()
    for word in words:
        assert word in str(error.value)


def test_two_criteria_on_a_pair() -> None:
    with pytest.raises(fx.InputError, match="'bond' appears twice; give one criterion per"):
        scene_of(fx.Debond(interface(), STRESS), fx.Debond(interface(), VCCT))
    # under another name it is still the same pair
    twice = scene_of(fx.Debond(interface(), STRESS), fx.Debond(interface(name="again"), VCCT))
    with pytest.raises(InterfaceError, match="can be a slave only once"):
        run(twice, fx.Releases(1))


# --- refused when the mesh is known ---------------------------------------------------------------


def test_opening_beyond_the_end_of_the_pair() -> None:
    # the left tip is 1 from the left end, but its way back leads to the right: 3
    far = plate(fx.CrackOpening(1.0, distance=3.5))
    with pytest.raises(fx.InputError) as error:
        run(far, fx.Releases(1))
    for word in ("interface 'bond'", "tip at (-1, 0)", "distance 3.5", "outside the end points",
                 "3 behind the tip", "give a smaller distance"):  # fmt: skip
        assert word in str(error.value)


def test_stress_beyond_the_bonded_part() -> None:
    # the ligament between the two cracks is 0.6 long
    far = plate(fx.CriticalStress(1.0, distance=0.7), bonded=outside_two_cracks)
    with pytest.raises(fx.InputError) as error:
        run(far, fx.Releases(1))
    for word in ("interface 'bond'", "tip at (", "distance 0.7", "ends 0.6 ahead"):
        assert word in str(error.value)
    assert re.search(r"tip at \(-?0\.3, 0\)", str(error.value))


def test_strength_of_temperature_without_temperatures() -> None:
    table = fx.Tabulated((0.0, 100.0), (100.0, 80.0))
    scene = plate(fx.CriticalStress(table, distance=0.2))
    with pytest.raises(fx.InputError, match="sigma_f depends on temperature"):
        run(scene, fx.Releases(1))


def test_reference_nodes_that_do_not_exist() -> None:
    scene = plate(fx.CrackLengthVsTime((0.0, 1.0), (0.5, 2.0), reference="nowhere"))
    with pytest.raises(fx.InputError, match=r"no group 'nowhere'; it has: .*upper_face"):
        run(scene, fx.Releases(1))


def test_path_stepping_has_no_time() -> None:
    curve = fx.CrackLengthVsTime((0.0, 1.0), (0.5, 2.0), reference="upper_face")
    amplitude = fx.AmplitudeRelease((0.0, 1.0), (1.0, 0.0))
    for scene in (plate(curve), plate(STRESS, release=amplitude)):
        with pytest.raises(fx.InputError, match="'bond' grows or is released with time, which"):
            run(scene, fx.Releases(2), stepping="path")


def test_growth_of_a_debond_of_another_scene() -> None:
    scene, other = plate(STRESS), plate(STRESS)
    with pytest.raises(fx.InputError, match="'bond' is not part of the scene"):
        scene.run(fx.Static(until=fx.Releases(1)), grow=other.debonds)


# --- warned of ------------------------------------------------------------------------------------


def test_first_tabulated_length_beyond_the_first_bonded_node(
    caplog: pytest.LogCaptureFixture,
) -> None:
    scene = plate(fx.CrackLengthVsTime((0.0, 1.0), (1.2, 2.0), reference="upper_face"))
    history = run(scene, fx.Time(2.0))
    for word in ("interface 'bond'", "first tabulated crack length 1.2", "distance 1 from",
                 "'upper_face'", "all of 2 tips will never propagate"):  # fmt: skip
        assert word in warnings(caplog)
    assert scene.cracks[0].n_released == 0
    assert history["f[bond]"].max() == 0.0


def test_one_tip_that_never_propagates(caplog: pytest.LogCaptureFixture) -> None:
    # from the left side the left tip is at 1, the right one at 3
    scene = plate(fx.CrackLengthVsTime((0.0, 1.0), (2.0, 4.0), reference="left"))
    run(scene, fx.Time(1.0))
    assert "1 of 2 tips will never propagate" in warnings(caplog)
    x = scene.pairs[0].surface.x[[n for n, _ in scene.cracks[0].released], 0]
    assert len(x)
    assert (x >= 1.0 - 1e-9).all()


def test_opening_measured_across_another_bonded_part(caplog: pytest.LogCaptureFixture) -> None:
    # 0.7 long cracks: 0.9 behind the outer tip lies in the bonded ligament
    scene = plate(fx.CrackOpening(1.0, distance=0.9), bonded=outside_two_cracks)
    run(scene, fx.Time(1e-3))
    assert "distance 0.9 reaches back to bonded nodes" in warnings(caplog)


def test_set_with_nodes_off_the_surface(caplog: pytest.LogCaptureFixture) -> None:
    scene = scene_of(fx.Debond(interface(bonded="right"), STRESS))
    # 21 nodes on each body's right side, of which the upper body's lowest one is a slave
    assert "nodes of bonded set 'right' are not slave nodes" in warnings(caplog)
    assert scene.solver.fronts[0].bonded.sum() == 1


def test_no_set_bonds_everything(caplog: pytest.LogCaptureFixture) -> None:
    scene = scene_of(fx.Debond(interface(bonded=None), STRESS))
    assert "no bonded set given; the whole pair is bonded" in warnings(caplog)
    history = run(scene, fx.Releases(1))
    assert warnings(caplog).count("no crack tip") == 1  # said once
    assert history.reason == "no crack tip is left"
    assert scene.solver.fronts[0].bonded.all()


def test_nothing_bonded_has_no_tip(caplog: pytest.LogCaptureFixture) -> None:
    scene = scene_of(fx.Debond(interface(bonded=lambda x: np.zeros(x.shape[1], dtype=bool)), VCCT))
    run(scene, fx.Releases(1))
    assert "'bond' has no crack tip" in warnings(caplog)


def test_too_many_cutbacks_keep_what_was_found(caplog: pytest.LogCaptureFixture) -> None:
    # f doubles from one increment to the next and cannot come to lie between 0.999 and 1.001
    scene = plate(fx.CriticalStress(100.0, distance=0.25, tolerance=1e-3))
    history = run(scene, fx.Releases(2), stepping="increment", initial=1e-3, max_cutbacks=2)
    assert history.reason.startswith("stopped: f = ")
    assert "after 2 cutbacks" in history.reason
    assert "max_cutbacks" in history.reason
    assert history.reason in warnings(caplog)
    assert history["time"][-1] > 0.0
    assert history["event"][-1] == "end"


def test_load_that_never_opens_the_crack() -> None:
    pressed = plate(STRESS, supports=[
        fx.Displacement("bottom", x=0.0, y=0.0), fx.Displacement("top", x=0.0, y=-1.0)
    ])  # fmt: skip
    history = run(pressed, fx.Releases(1))
    assert "not reached however large the load" in history.reason
