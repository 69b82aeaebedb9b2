"""Pressure that follows the crack, controlled by load factor and by injected volume.

Penny crack of radius a in an infinite body (Sneddon 1946), all of its faces under p:

    G = 4 (1 - nu^2) p^2 a/(pi E),    V = 16 (1 - nu^2) p a^3/(3 E)
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import HELD_FAR, STEEL, bond, column, largest_imbalance, onsets

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.meshes.penny import penny

E, NU, GC, A0 = 1000.0, 0.3, 0.01, 1.8
PATH: dict[str, Any] = {"stepping": "path"}
VOLUME: dict[str, Any] = {"stepping": "opening", "opening": "fluid"}


def critical_pressure(a: Any) -> Any:
    """p(a) at G = Gc."""
    return np.sqrt(np.pi * E * GC / (4.0 * (1.0 - NU**2) * a))


def volume(a: Any, p: Any) -> Any:
    """V(a, p)."""
    return 16.0 * (1.0 - NU**2) * p * a**3 / (3.0 * E)


def fractured(comm: MPI.Intracomm, *loads: Any, contact: bool = False, **scene: Any) -> fx.Scene:
    """A penny crack in a large cylinder, filled by a fluid without weight and viscosity."""
    crack = fx.Interface(
        "upper_face",
        "lower_face",
        bonded=lambda x: x[0] >= A0 - 1e-9,
        contact=contact,
        name="crack",
    )
    return fx.Scene(
        penny(comm, a=2.0, radius=30.0, half_height=30.0, dr=0.1, fine=0.3, growth=1.4, order=2),
        materials=fx.Isotropic(E, NU),
        model=fx.Axisymmetric(),
        supports=[
            fx.Displacement("axis_upper", x=0.0),
            fx.Displacement("axis_lower", x=0.0),
            fx.Displacement("outer_bottom", y=0.0),
        ],
        loads=[fx.Pressure("crack", 1.0, name="fluid", follows_crack=True), *loads],
        debonds=[fx.Debond(crack, fx.VCCT(GIc=GC), scene.pop("release", fx.StepRelease()))],
        **scene,
    )


@pytest.mark.mpi
@pytest.mark.three
def test_pressure_and_volume_of_a_penny_crack(comm: MPI.Intracomm) -> None:
    found = {}
    for name, step in (("path", PATH), ("volume", VOLUME)):
        history = fractured(comm).run(fx.Static(until=fx.Releases(8), **step), progress=False)
        found[name] = onsets(history)
        a, p = (column(found[name], c) for c in ("a[crack]", "F[fluid]"))
        assert len(a) == 4 and a[-1] > A0 + 0.25
        # 1.2 % by elements of a/18 with second order; 0.3 % by the body of 15 radii
        assert p == pytest.approx(critical_pressure(a), rel=0.02)
        assert column(found[name], "v[fluid]") == pytest.approx(volume(a, p), rel=0.02)
        assert largest_imbalance(history) < 1e-9
        if name == "volume":
            event, v = history["event"], history["v[fluid]"]
            assert v[event == "release"] == pytest.approx(
                v[np.isin(event, ["onset", "unstable"])], rel=1e-9
            )
    for c in ("F[fluid]", "v[fluid]"):  # elastic: one equilibrium at f = 1, however it is reached
        assert column(found["path"], c) == pytest.approx(column(found["volume"], c), rel=1e-9)


def test_pressure_beside_confinement() -> None:
    # superposition: the fluid must first carry what presses the faces together
    confined = 2.0
    squeeze = [
        fx.Pressure(side, confined, amplitude=fx.constant(), name=side)
        for side in ("top", "bottom")
    ]
    step = fx.Static(until=fx.Releases(4), **VOLUME)
    plain = onsets(fractured(MPI.COMM_SELF).run(step, progress=False))
    pressed = fractured(MPI.COMM_SELF, *squeeze, contact=True).run(step, progress=False)
    more = column(onsets(pressed), "F[fluid]") - column(plain, "F[fluid]")
    # a body of 15 radii: the stress between the faces differs from the pressure by 1e-3 of it
    assert more == pytest.approx(confined, rel=5e-3)
    assert largest_imbalance(pressed) < 1e-8


@pytest.mark.slow
def test_work_of_progressive_release_and_the_nonlinear_solver() -> None:
    law = fx.ProgressiveRelease()
    grown = fractured(MPI.COMM_SELF, release=law).run(
        fx.Static(until=fx.Releases(8), **PATH), progress=False
    )
    # each released area takes Gc; pressure does the work of all that opens
    first, last = onsets(grown)[0], onsets(grown)[-1]
    spent = last["released_energy"] - first["released_energy"]
    swept = last["area[crack]"] - first["area[crack]"]
    assert spent == pytest.approx(GC * swept, rel=0.1)  # bonds at the tip are on their way
    assert largest_imbalance(grown) < 1e-9
    step = fx.Static(until=fx.Releases(4), **PATH)
    one, two = (
        fractured(MPI.COMM_SELF, solver=s).run(step, progress=False) for s in (None, "newton")
    )
    assert column(onsets(two), "F[fluid]") == pytest.approx(
        column(onsets(one), "F[fluid]"), rel=1e-7
    )


@pytest.mark.parametrize("lower", [{}, {"nx_lower": 30}], ids=["matching", "not matching"])
def test_bonded_faces_do_not_feel_it(lower: dict[str, Any]) -> None:
    def arms(load: list[Any], criterion: Any, a0: float) -> fx.Scene:
        return fx.Scene(
            dcb_2d(MPI.COMM_SELF, length=20.0, dx=0.5, ny=3, **lower),
            materials=STEEL,
            model=fx.PlaneStrain(),
            supports=HELD_FAR,
            loads=load,
            debonds=[fx.Debond(bond(a0), criterion)],
        )

    # the opening of the first elements dies away within some heights, and no reaction is left
    fluid = [fx.Pressure("bond", lambda x: 1.0 + x[0], name="fluid", follows_crack=True)]
    whole = arms(fluid, fx.CriticalStress(1e9, distance=0.4), 1.0)
    history = whole.run(fx.Static(until=fx.Time(1.0)), progress=False)
    assert abs(history.rows[-1]["R[far_upper.y]"]) < 1e-9
    vector = whole.analysis.solver.displacement()
    with vector as u:
        x, value = whole.analysis.continuum.positions(), np.abs(u).reshape(-1, 2)
        far = value[x[: len(value), 0] > 10.0].max()
        assert value.max() > 0.0 and far < 1e-5 * value.max()
    vector.destroy()


def test_stress_ahead_of_the_tip_is_that_of_the_bond() -> None:
    # criteria of stress must not take the pressure for a stress of the bonds
    def first(load: list[Any]) -> float:
        scene = fx.Scene(
            dcb_2d(MPI.COMM_SELF, length=20.0, dx=0.5, ny=3),
            materials=STEEL,
            model=fx.PlaneStrain(),
            supports=HELD_FAR,
            loads=load,
            debonds=[fx.Debond(bond(10.0), fx.CriticalStress(30.0, distance=0.25))],
        )
        return float(onsets(scene.run(fx.Static(until=fx.Releases(1)), progress=False))[0]["time"])

    there = [
        fx.Pressure(side, lambda x: np.where(x[0] < 10.0, 1.0, 0.0))
        for side in ("upper_face", "lower_face")
    ]
    fluid = [fx.Pressure("upper_face", 1.0, name="fluid", follows_crack=True)]
    # the former acts where its function is 1, up to the tip
    assert first(fluid) == pytest.approx(first(there), rel=1e-9)


def test_what_cannot_follow_the_crack() -> None:
    with pytest.raises(InputError, match="exclude each other"):
        fx.Pressure("crack", 1.0, follows=True, follows_crack=True)
    other = fx.Pressure("top", 1.0, follows_crack=True)
    with pytest.raises(InputError, match=r"'top' is the name or a surface of none; .*'crack'"):
        fractured(MPI.COMM_SELF, other)
    with pytest.raises(InputError, match="monitor or pressure that follows the crack 'water'"):
        fractured(MPI.COMM_SELF).run(
            fx.Static(until=fx.Releases(1), stepping="opening", opening="water")
        )
