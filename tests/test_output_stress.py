"""Stresses in files and pictures: right at large rotations and at any temperature."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.output.fields import displacement_function, stress_function
from fxcrack.output.plots.deformed import shape

pytestmark = pytest.mark.mpi

E, NU, RISE, ALPHA = 70e3, 0.3, 10.0, 1e-5
CLOCK = np.linspace(0.0, 1.0, 11)


def whole(comm: MPI.Intracomm, **options: object) -> fx.Scene:
    """A bonded bar of 4 x 1 without crack, held at one corner and guided at others."""
    interface = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= -1.0, name="bond"
    )
    settings: dict[str, object] = {"materials": fx.Isotropic(E, NU, expansion=ALPHA)}
    return fx.Scene(
        dcb_2d(comm, length=4.0, height=0.5, dx=1.0, ny=1),
        model=fx.PlaneStrain(),
        bonds=[interface],
        **(settings | options),
    )


@pytest.mark.quick("linear")
@pytest.mark.parametrize("solver", ["linear", "newton"])
def test_held_bodies_are_pressed_as_they_warm(comm: MPI.Intracomm, solver: str) -> None:
    sides = ("end_upper", "end_lower", "far_upper", "far_lower", "top", "bottom")
    scene = whole(
        comm,
        supports=[fx.Displacement(s, x=0.0, y=0.0) for s in sides],
        effects=[fx.Temperature(RISE)],
        solver=solver,
    )
    scene.run(fx.Static(until=fx.Time(1.0)))
    stress = stress_function(scene, displacement_function(scene), scene.time).x.array.reshape(-1, 4)
    expected = np.array([-E * ALPHA * RISE / (1.0 - 2.0 * NU)] * 3 + [0.0])
    # rounding of one factorisation
    assert stress == pytest.approx(np.tile(expected, (len(stress), 1)), abs=1e-9 * E * ALPHA * RISE)


@pytest.mark.slow
def test_turned_bodies_are_not_stressed(comm: MPI.Intracomm) -> None:
    # the two ends of the lower edge go where a turn by 60 degrees takes them
    turn = np.radians(60.0) * CLOCK

    def guided(name: str, x: float, y: float) -> list[fx.Displacement]:
        u = (np.cos(turn) - 1.0) * x - np.sin(turn) * y
        v = np.sin(turn) * x + (np.cos(turn) - 1.0) * y
        along, across = (fx.Amplitude(tuple(CLOCK), tuple(w)) for w in (u, v))
        return [
            fx.Displacement(name, x=1.0, amplitude=along, name=f"{name}_x"),
            fx.Displacement(name, y=1.0, amplitude=across, name=f"{name}_y"),
        ]

    scene = whole(
        comm,
        supports=[*guided("pin_top", 0.0, 0.5), *guided("pin_bottom", 0.0, -0.5)],
        effects=[fx.FiniteStrain()],
    )
    scene.run(fx.Static(until=fx.Time(1.0), stepping="increment", initial=0.1, maximum=0.1))
    largest = comm.allreduce(np.abs(shape(scene).values).max(initial=0.0), op=MPI.MAX)
    # the iteration ends at 1e-10 of forces that a wrong guess of the turn brings about
    assert largest < 1e-6 * E
