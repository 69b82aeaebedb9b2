"""Whole Newton steps where shortened ones crawl: pressures that follow thin arms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import HELD_FAR, dcb, onsets, specimen

import fxcrack as fx
from fxcrack.base.errors import ConvergenceError
from fxcrack.effects import FiniteStrain
from fxcrack.history import Row
from fxcrack.meshes.dcb import dcb_2d


def inflated(maximum: float) -> tuple[fx.Scene, Row]:
    """Thin arms blown apart by a pressure that follows them; the scene and its first onset."""

    def pressure(x: np.ndarray) -> np.ndarray:
        return np.where(x[0] < 10.0, 0.1, 0.0)

    faces = ("upper_face", "lower_face")
    scene = specimen(
        dcb_2d(length=14.0, height=0.1, dx=0.5, ny=1, order=2),
        a0=10.0,
        criterion=fx.VCCT(GIc=0.3),
        supports=HELD_FAR,
        loads=[fx.Pressure(face, pressure, follows=True) for face in faces],
        effects=[FiniteStrain()],
    )
    history = scene.run(fx.Static(until=fx.Releases(1), maximum=maximum))
    return scene, onsets(history)[0]


@pytest.mark.slow
def test_follower_pressure_in_one_increment_or_in_many() -> None:
    """The first whole step alone knows of the new pressure; a failed trial leaves none behind."""
    (one, coarse), (_, fine) = inflated(1.0), inflated(0.05)
    assert one.solver.counts.failures <= 1
    for name in ("GI[bond]", "strain_energy"):
        assert coarse[name] == pytest.approx(fine[name], rel=1e-6)
    # rounding of the forces that stretch arms 100 times as long as thick is 1e-6 of the pressure
    assert coarse["time"] == pytest.approx(fine["time"], rel=1e-5)


def test_no_equilibrium_between_here_and_beyond(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the way to f = 1 guessed from a state beyond it has no equilibrium, it is cut."""
    material = fx.Plastic(70e3, 0.3, yield_stress=300.0)
    scene = dcb(MPI.COMM_SELF, dx=2.0, ny=2, materials=material)
    move, calls = type(scene.solver).move, []

    def stubborn(model: Any, loads: Any, force: Any, at: float, dt: float, **more: Any) -> Any:
        calls.append(dt)
        assert len(calls) < 200
        if dt > 2.0 and len(calls) > 2:
            raise ConvergenceError("for the test")
        return move(model, loads, force, at, dt, **more)

    monkeypatch.setattr(type(scene.solver), "move", stubborn)
    history = scene.run(fx.Static(until=fx.Releases(1), maximum=50.0))
    assert history.reason == "1 node released"
    assert onsets(history)[0]["f[bond]"] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.slow
def test_a_turn_without_stress_is_not_divided() -> None:
    """What rounding leaves of its energies does not add up, and need not."""
    clock = np.linspace(0.0, 1.0, 41)
    turn = np.radians(80.0) * clock
    supports = []
    for name, y in (("pin_top", 1.5), ("pin_bottom", -1.5)):
        ways = {"x": -np.sin(turn) * y, "y": (np.cos(turn) - 1.0) * y}
        supports += [
            fx.Displacement(
                name,
                **{axis: 1.0},
                amplitude=fx.Amplitude(tuple(clock), tuple(way)),
                name=name + axis,
            )
            for axis, way in ways.items()
        ]
    scene = specimen(
        dcb_2d(length=40.0, dx=2.0, ny=2), a0=20.0, supports=supports, effects=[FiniteStrain()]
    )
    assert scene.run(fx.Static(until=fx.Time(1.0))).reason == "time 1 reached"
    assert scene.solver.counts.solves == len(clock)


@pytest.mark.mpi
@pytest.mark.three
def test_a_rejected_trial_that_is_unstable_ends_no_step(comm: MPI.Intracomm) -> None:
    """An arm sheared by half its height in one increment or in ten, with contact.

    The first trial buckles and is rejected; its tangent holds fewer faces than the start does.
    """
    energies = []
    for increment in (1.0, 0.1):
        scene = specimen(
            dcb_2d(comm, length=24.0, height=1.5, dx=1.0, ny=2),
            a0=10.0,
            contact=True,
            criterion=fx.VCCT(GIc=1e4),
            supports=[
                fx.Displacement("pin_top", x=0.8, y=0.16),
                fx.Displacement("bottom", x=0.0, y=0.0),
            ],
            effects=[FiniteStrain()],
        )
        step = fx.Static(
            until=fx.Time(1.0), stepping="increment", initial=increment, maximum=increment
        )
        history = scene.run(step, progress=False)
        assert history[-1]["time"] == 1.0
        energies.append(float(history[-1]["strain_energy"]))
        scene.close()
    # faces slide: pairs renewed in one increment or in ten, first order
    assert energies[0] == pytest.approx(energies[1], rel=1e-3)
