"""Temperature in scenes: toughness that follows it, loads from the first moment, both paths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import bond, column, largest_imbalance, onsets

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d

HEATED = fx.Amplitude((0.0, 1.0, 2.0), (0.0, 0.0, 1.0))
HELD = fx.Amplitude((0.0, 1.0), (0.0, 1.0))
TOUGHNESS = fx.Tabulated([20.0, 120.0], [0.2, 0.05])


def heated_dcb(comm: MPI.Intracomm, solver: str | None) -> fx.Scene:
    """Opened until time 1, then heated from 20 to 120 degrees; nothing expands."""
    return fx.Scene(
        dcb_2d(comm, dx=2.0, ny=2),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=0.7, amplitude=HELD),
            fx.Displacement("pin_bottom", x=0.0, y=-0.7, amplitude=HELD),
        ],
        debonds=[fx.Debond(bond(30.0), fx.VCCT(GIc=TOUGHNESS))],
        effects=[fx.Temperature(120.0, reference=20.0, amplitude=HEATED)],
        solver=solver,
    )


@pytest.mark.slow
@pytest.mark.mpi
def test_toughness_follows_the_temperature_of_the_bodies(comm: MPI.Intracomm) -> None:
    scene = heated_dcb(comm, None)
    history = scene.run(fx.Static(until=fx.Time(2.0)))
    first = onsets(history)
    assert len(first) >= 2
    heat = np.interp(column(first, "time"), (1.0, 2.0), (20.0, 120.0))
    critical = np.interp(heat, (20.0, 120.0), (0.2, 0.05))
    # f = 1 is located to round-off on linear pieces
    assert column(first, "GI[bond]") == pytest.approx(critical, rel=1e-10)
    # the specimen stands still while it warms up: the first onset is where the table says
    checkpoint_point = first[0]["GI[bond]"]
    assert first[0]["time"] == pytest.approx(1.0 + (0.2 - checkpoint_point) / 0.15, rel=1e-12)


def test_toughness_follows_the_temperature_on_the_nonlinear_path(comm: MPI.Intracomm) -> None:
    one, other = (heated_dcb(comm, p).run(fx.Static(until=fx.Time(2.0))) for p in (None, "newton"))
    a, b = column(onsets(one), "time"), column(onsets(other), "time")
    # f = 1 is met to 1e-9 there
    assert b == pytest.approx(a, rel=1e-8)


@pytest.mark.quick("None")
@pytest.mark.parametrize("solver", [None, "newton"])
def test_a_steady_temperature_loads_the_bodies_at_once(solver: str | None) -> None:
    steel, other = (fx.Isotropic(200e3, 0.3, expansion=a) for a in (1e-5, 2e-5))
    scene = fx.Scene(
        dcb_2d(dx=2.0, ny=2),
        materials={"upper": steel, "lower": other},
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("pin_bottom", x=0.0, y=0.0), fx.Displacement("far_lower", x=0.0)],
        debonds=[fx.Debond(bond(30.0), fx.VCCT(GIc=1e3))],
        effects=[fx.Temperature(-100.0, amplitude=fx.Amplitude((0.0,), (1.0,)))],
        solver=solver,
    )
    history = scene.run(fx.Static(until=fx.Time(1.0)))
    assert history["GI[bond]"][0] + history["GII[bond]"][0] > 0.0
    assert history["strain_energy"][0] > 0.0
    assert history["strain_energy"][-1] == pytest.approx(history["strain_energy"][0], rel=1e-12)
    assert largest_imbalance(history) < 1e-9  # the iteration ends at 1e-10 of the forces


def test_cooling_on_both_paths() -> None:
    def run(solver: str | None) -> fx.History:
        scene = fx.Scene(
            dcb_2d(dx=2.0, ny=2),
            materials={
                "upper": fx.Isotropic(70e3, 0.3, expansion=2e-5),
                "lower": fx.Isotropic(200e3, 0.3, expansion=1e-5),
            },
            model=fx.PlaneStrain(),
            supports=[
                fx.Displacement("pin_bottom", x=0.0, y=0.0),
                fx.Displacement("far_lower", x=0.0),
            ],
            debonds=[fx.Debond(bond(30.0), fx.VCCT(GIc=1e3))],
            effects=[fx.Temperature([(0.0, 0.0), (1.0, -100.0), (2.0, -50.0)])],
            solver=solver,
        )
        return scene.run(
            fx.Static(until=fx.Time(2.0), stepping="increment", initial=0.25, maximum=0.25)
        )

    one, other = run(None), run("newton")
    for name in ("GI[bond]", "GII[bond]", "strain_energy", "external_work"):
        assert other[name] == pytest.approx(one[name], rel=1e-8, abs=1e-8 * np.abs(one[name]).max())
    assert largest_imbalance(one) < 1e-10 and largest_imbalance(other) < 1e-8


@pytest.mark.mpi
@pytest.mark.parametrize("bodies", ["small", "finite", "plastic"])
@pytest.mark.parametrize("held", [True, False])
def test_energy_of_motions_that_begin_warm(comm: MPI.Intracomm, held: bool, bodies: str) -> None:
    """Arms of two materials, warm from the first moment on and then cooled."""
    supports = [fx.Displacement("pin_bottom", x=0.0, y=0.0), fx.Displacement("pin_top", x=0.0)]
    warm = fx.Temperature([(0.0, 500.0), (5e-3, 500.0), (1e-2, -300.0)])
    upper: Any = fx.Isotropic(7e4, 0.3, 2e-4, 1e-3)
    if bodies == "plastic":
        upper = fx.Plastic(7e4, 0.3, yield_stress=1e3, hardening=1e3, expansion=2e-4, density=1e-3)
    effects: list[Any] = [fx.FiniteStrain()] if bodies == "finite" else []
    scene = fx.Scene(
        dcb_2d(comm, length=10.0, dx=2.5, ny=1),
        materials={
            "upper": upper, "lower": fx.Isotropic(7e4, 0.3, 1e-5, 1e-3)
        },
        model=fx.PlaneStrain(),
        supports=supports if held else [],
        bonds=[bond(5.0)],
        effects=[*effects, fx.Inertia(rho_inf=1.0), warm],
    )  # fmt: skip
    history = scene.run(fx.Dynamic(until=fx.Time(1e-2), dt=1e-3), progress=False)
    energy = column(history, "strain_energy") + column(history, "kinetic_energy")
    assert column(history, "kinetic_energy").max() > 1e-4 * energy.max()
    # the residual that the iteration leaves; measured 3e-11
    assert np.abs(column(history, "balance")).max() < 1e-8 * energy.max()
