"""Plastic arms, inertia and pressures that follow, each in a scene whose crack grows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import PINS, STEEL, bond, column, largest_imbalance, onsets

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d

LENGTH = 34.0


def cracked(comm: MPI.Intracomm, material: Any, **more: Any) -> tuple[fx.Scene, fx.Interface]:
    """A double cantilever beam, opened at its pins unless told otherwise."""
    interface = bond(30.0)
    options: dict[str, Any] = {"supports": PINS, "criterion": fx.VCCT(GIc=0.2), **more}
    criterion = options.pop("criterion")
    scene = fx.Scene(
        dcb_2d(comm, dx=2.0, ny=2),
        materials=material,
        model=fx.PlaneStrain(),
        debonds=[fx.Debond(interface, criterion)],
        **options,
    )
    return scene, interface


@pytest.mark.slow
@pytest.mark.mpi
def test_plastic_arms_keep_their_books(comm: MPI.Intracomm) -> None:
    plastic = fx.Plastic(70e3, 0.3, yield_stress=40.0, hardening=1e3)
    scene, interface = cracked(comm, plastic, criterion=fx.VCCT(GIc=0.5))
    history = scene.run(fx.Static(until=fx.CrackLength(interface, LENGTH), maximum=1.0))
    assert len(onsets(history)) == 2
    spent = history["plastic_energy"].astype(float)
    assert spent[-1] > 0.1 * history["external_work"][-1]
    assert (np.diff(spent) >= -1e-12 * spent[-1]).all()
    # the trapezoidal rule of all terms closes; the iteration ends at 1e-10 of the forces
    assert largest_imbalance(history) < 1e-9
    elastic, interface = cracked(comm, STEEL, criterion=fx.VCCT(GIc=0.5))
    brittle = elastic.run(fx.Static(until=fx.CrackLength(interface, LENGTH)))
    # arms that yield must be opened further for the same rate
    assert onsets(history)[0]["time"] > onsets(brittle)[0]["time"]


@pytest.mark.quick("True")
@pytest.mark.parametrize("contact", [pytest.param(False, marks=pytest.mark.mpi), True])
def test_slow_dynamics_is_the_quasi_static_answer(comm: MPI.Intracomm, contact: bool) -> None:
    end = 1.0  # hundreds of periods of the arms
    opening = fx.Amplitude((0.0, end), (0.0, 1.5))
    supports = [
        fx.Displacement("pin_top", x=0.0, y=1.0, amplitude=opening),
        fx.Displacement("pin_bottom", x=0.0, y=-1.0, amplitude=opening),
    ]
    interface = bond(30.0, contact=contact)
    histories = []
    for moving in (False, True):
        scene = fx.Scene(
            dcb_2d(comm, dx=2.0, ny=2),
            materials=fx.Isotropic(70e3, 0.3, density=2.7e-9),
            model=fx.PlaneStrain(),
            supports=supports,
            debonds=[fx.Debond(interface, fx.VCCT(GIc=0.2))],
            effects=[fx.Inertia(rho_inf=0.0)] if moving else [],
        )
        until = (fx.CrackLength(interface, LENGTH), fx.Time(end))
        step = fx.Dynamic(until=until, dt=0.02) if moving else fx.Static(until=until)
        histories.append(scene.run(step))
    still, moved = histories
    assert still.reason == moved.reason and "crack length" in still.reason
    first = [r for r in moved if r["event"] == "release"]
    checkpoint_point = column(onsets(still), "time")
    assert len(first) == len(checkpoint_point) == 2
    # a release comes at the end of an increment of 0.02 or less, and opens over the next one
    late = column(first, "time") - checkpoint_point
    assert (late > -1e-9).all() and (late < 0.04).all()
    assert moved["kinetic_energy"].astype(float).max() < 1e-3 * moved["external_work"][-1]
    # contact that closes within an increment does work by the trapezoidal rule
    assert largest_imbalance(moved) < (1e-4 if contact else 1e-9)


def test_a_fast_opening_is_not_the_quasi_static_answer() -> None:
    scene, interface = cracked(
        MPI.COMM_WORLD,
        fx.Isotropic(70e3, 0.3, density=2.7e-9),
        effects=[fx.Inertia()],
        supports=[
            fx.Displacement(p, x=0.0, y=s, amplitude=fx.Amplitude((0.0, 1e-3), (0.0, 4.0)))
            for p, s in (("pin_top", 1.0), ("pin_bottom", -1.0))
        ],
    )
    until = (fx.CrackLength(interface, LENGTH), fx.Time(1e-3))
    history = scene.run(fx.Dynamic(until=until, dt=5e-6))
    assert "crack length" in history.reason
    assert history["kinetic_energy"].astype(float).max() > 1e-2 * history["external_work"][-1]
    assert largest_imbalance(history) < 1e-9


def test_equilibria_are_not_looked_for_in_motion() -> None:
    moving = fx.Isotropic(70e3, 0.3, density=2.7e-9)
    scene, _ = cracked(MPI.COMM_WORLD, moving, effects=[fx.Inertia()])
    with pytest.raises(fx.InputError, match="use a Dynamic step"):
        scene.run(fx.Static(until=fx.Releases(1)))


@pytest.mark.slow  # its tangent is symmetrised in the solver: many iterations
@pytest.mark.mpi
def test_a_pressure_that_follows_turns_with_the_arms(comm: MPI.Intracomm) -> None:
    """Its resultant is p times the chord of the pressed line, turned by a right angle."""
    far = [fx.Displacement(f"far_{side}", x=0.0, y=0.0) for side in ("upper", "lower")]
    pressure = 0.3

    def loaded(follows: bool) -> fx.History:
        scene, _ = cracked(
            comm,
            STEEL,
            supports=far,
            criterion=fx.VCCT(GIc=1e6),
            loads=[
                fx.Pressure(
                    f"{side}_face",
                    lambda x: np.where(x[0] < 30.0, pressure, 0.0),
                    follows=follows,
                    name=side,
                )
                for side in ("upper", "lower")
            ],
            effects=[fx.FiniteStrain()],
            monitors=[fx.Monitor("end_upper", (0.0, 1.0), name="y")],
        )
        return scene.run(fx.Static(until=fx.Time(1.0), maximum=0.5))

    following, dead = loaded(True), loaded(False)
    along = [abs(h["R[far_upper.x]"][-1] + h["R[far_lower.x]"][-1]) for h in (following, dead)]
    # from the tip, which stays, to the end: both arms; the end face is a little shorter turned
    assert following["m[y]"][-1] > 0.5
    assert along[0] == pytest.approx(2.0 * pressure * following["m[y]"][-1], rel=0.02)
    assert along[1] < 1e-6 * along[0]
    assert largest_imbalance(following) < 1e-4  # asked for on nonlinear scenes
