"""Toughness and strength that vary: with position, from node to node, with temperature."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from specimens import assert_same, column, dcb, grow_to, interface_of, onsets
from test_criteria_in_analysis import plate, release_times, run

import fxcrack as fx

Array = npt.NDArray[np.float64]

HEAT = fx.Tabulated((0.0, 100.0), (0.3, 0.15))
LAW = fx.Paris(c1=0.0, c2=-1.0, c3=0.5, c4=4.0, r1=0.2, r2=0.9)


def tough(x: Array) -> Array:
    """Toughness that falls along the beam."""
    return 0.3 - 0.0015 * x[0]


def warm(x: Array) -> Array:
    """Temperature for which the table above gives the same."""
    return x[0]


def per_node() -> Array:
    scene = dcb(MPI.COMM_SELF, dx=1.0, ny=2)
    values = tough(scene.pairs[0].surface.x.T)
    scene.close()
    return values


def criterion(kind: str, toughness: Any) -> Any:
    if kind == "fatigue":
        return fx.Fatigue(GIc=toughness, paris=LAW)
    if kind == "enhanced":
        return fx.EnhancedVCCT(GIc=toughness, GIc_p=toughness)
    return fx.VCCT(GIc=toughness)


def grown(kind: str, toughness: Any, temperature: Any = None) -> fx.Scene:
    made = criterion(kind, toughness)
    scene = dcb(MPI.COMM_SELF, dx=1.0, ny=2, criterion=made, temperature=temperature)
    if kind == "fatigue":
        end = fx.CrackLength(interface_of(scene), 36.0)
        scene.run(fx.Cycles(maximum=1.0, ratio=0.1, until=end))
    else:
        grow_to(scene, 36.0)
    return scene


@pytest.mark.quick("vcct")
@pytest.mark.parametrize("kind", ["vcct", "enhanced", "fatigue"])
def test_three_ways_to_say_the_same(kind: str) -> None:
    """A function of position, a value per slave node, a table against a field of temperature."""
    by_place = grown(kind, tough)
    others = [grown(kind, HEAT, warm)]
    if kind != "enhanced":  # for which values per node are not defined
        others.append(grown(kind, per_node()))
    for other in others:
        assert_same(by_place.history, other.history, 1e-12)
    x = by_place.pairs[0].surface.x
    if kind == "fatigue":
        tips = by_place.history.details["tips"]
        assert tips["G_c"] == pytest.approx(tough(x[tips["node"]].T), rel=1e-12)
    else:
        rows = onsets(by_place.history)
        at = x[column(rows, "node[bond]").astype(int)]
        assert column(rows, "GI[bond]") == pytest.approx(tough(at.T), rel=1e-4)  # some mode II
        assert len(rows) >= 6


def test_threshold_and_upper_limit_of_fatigue_follow_the_local_toughness() -> None:
    # G = 0.26 at a = 30: above the upper limit of 0.28, below the threshold of 1.5. The first node
    # is released at once; the element after it ends where the toughness is 1.5, so that the crack
    # comes to rest inside it.
    for value in (0.28, 1.5):
        scene = dcb(
            MPI.COMM_SELF, dx=1.0, ny=2,
            criterion=criterion("fatigue", lambda x, v=value: np.where(x[0] < 31.5, v, 1.5)),
        )  # fmt: skip
        history = scene.run(fx.Cycles(maximum=1.0, ratio=0.0))
        events = [r["event"] for r in history]
        assert ("unstable" in events) == (value == 0.28)
        assert history.reason.startswith("arrest")
        assert scene.cracks[0].n_released == (1 if value == 0.28 else 0)


@pytest.mark.parametrize("kind", ["stress", "opening"])
def test_strength_and_critical_opening_follow_the_temperature(kind: str) -> None:
    def make(value: Any, temperature: Any = None) -> fx.Scene:
        made = (
            fx.CriticalStress(value, value, distance=0.25)
            if kind == "stress"
            else fx.CrackOpening(value, distance=0.25)
        )
        scene = plate(made)
        scene.close()
        debond = fx.Debond(scene.debonds[0].interface, made, temperature=temperature)
        return fx.Scene(
            scene.mesh,
            materials=fx.Isotropic(200e3, 0.3),
            model=fx.PlaneStrain(),
            supports=[
                fx.Displacement("bottom", x=0.0, y=0.0), fx.Displacement("top", x=0.0, y=1.0)
            ],
            debonds=[debond],
        )  # fmt: skip

    high = 100.0 if kind == "stress" else 2e-3
    table = fx.Tabulated((-2.0, 2.0), (high, 0.5 * high))

    def first(scene: fx.Scene) -> dict[float, float]:
        run(scene, fx.Releases(1))
        return release_times(scene)

    cold, warm_all = first(make(high)), first(make(table, 2.0))
    assert set(cold) == set(warm_all) == {-1.0, 1.0}
    assert warm_all[1.0] == pytest.approx(0.5 * cold[1.0], rel=1e-9)  # f goes with the load
    # warmer to the right: the right tip goes first, at the strength of its own temperature
    uneven = first(make(table, lambda x: x[0]))
    assert set(uneven) == {1.0}
    assert uneven[1.0] == pytest.approx(0.625 * cold[1.0], rel=1e-9)
    with pytest.raises(fx.InputError, match=r"depends on temperature.*Debond\(temperature=...\)"):
        first(make(table))


def test_what_a_temperature_cannot_be() -> None:
    wrong = dcb(MPI.COMM_SELF, dx=2.0, ny=1, temperature=lambda x: np.ones(3))
    with pytest.raises(
        fx.InputError, match=r"'bond': temperature gives shape \(3,\) for positions"
    ):
        run(wrong, fx.Releases(1))
    hole = dcb(
        MPI.COMM_SELF, dx=2.0, ny=1, temperature=lambda x: np.where(x[0] > 50.0, np.nan, 1.0)
    )
    with pytest.raises(fx.InputError, match=r"temperature is nan at \(52, 0\); give a number"):
        run(hole, fx.Releases(1))


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["vcct", "fatigue"])
def test_every_slave_node_needs_a_value(kind: str) -> None:
    scene = dcb(MPI.COMM_WORLD, dx=1.0, ny=2, criterion=criterion(kind, np.full(99, 0.2)))
    step = fx.Cycles(maximum=1.0, ratio=0.0) if kind == "fatigue" else fx.Static(fx.Releases(1))
    with pytest.raises(fx.InputError) as error:
        scene.run(step)
    for word in (
        "GIc has 99 values for 101 slave nodes",
        "slave nodes 99, 100",
        "every slave node",
    ):
        assert word in str(error.value)
    scene.close()
