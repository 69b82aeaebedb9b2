"""Path following: a load-controlled specimen that snaps back is traced, linear and not."""

from __future__ import annotations

from typing import Any

import pytest
from mpi4py import MPI
from specimens import STEEL, bond, column, largest_imbalance, onsets

import fxcrack as fx
from fxcrack.effects import FiniteStrain
from fxcrack.meshes.dcb import dcb_2d


def short_dcb(comm: MPI.Intracomm, *, force: bool, effects: list[Any], GIc: float) -> fx.Scene:
    """A double cantilever beam, opened by forces or by displacements of its pins."""
    pins = ("pin_top", "pin_bottom")
    if force:
        supports = [fx.Displacement("far_upper", x=0.0, y=0.0)]
        supports.append(fx.Displacement("far_lower", x=0.0, y=0.0))
        loads = [fx.PointForce(p, (0.0, s)) for p, s in zip(pins, (1.0, -1.0), strict=True)]
    else:
        supports = [fx.Displacement("far_upper", x=0.0, y=0.0)]
        supports.append(fx.Displacement("far_lower", x=0.0, y=0.0))
        supports += [fx.Displacement(p, y=s) for p, s in zip(pins, (1.0, -1.0), strict=True)]
        loads = []
    return fx.Scene(
        dcb_2d(comm, length=40.0, dx=2.0, ny=2),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=supports,
        loads=loads,
        debonds=[fx.Debond(bond(10.0), fx.VCCT(GIc=GIc))],
        monitors=[fx.Monitor("pin_top", (0.0, 1.0), name="top")],
        effects=effects,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "effects", [[], pytest.param([FiniteStrain()], marks=pytest.mark.mpi)], ids=["linear", "finite"]
)
def test_load_control_traces_what_displacement_control_finds(
    comm: MPI.Intracomm, effects: list[Any]
) -> None:
    # elastic arms: each onset is one equilibrium, however it is reached
    toughness = 20.0 if effects else 0.2
    step = fx.Releases(4)
    by_force = short_dcb(comm, force=True, effects=effects, GIc=toughness)
    traced = by_force.run(fx.Static(until=step, stepping="path"))
    by_pins = short_dcb(comm, force=False, effects=effects, GIc=toughness)
    found = by_pins.run(fx.Static(until=step))
    assert len(onsets(traced)) == len(onsets(found)) == 4
    load, opening = column(onsets(traced), "F[pin_top]"), column(onsets(traced), "m[top]")
    # f = 1 is met to 1e-9 on the nonlinear path
    assert load == pytest.approx(column(onsets(found), "R[pin_top.y]"), rel=1e-7)
    assert opening == pytest.approx(column(onsets(found), "m[top]"), rel=1e-7)
    # the load falls from release to release: under load control growth is unstable
    assert (load[1:] < load[:-1]).all()
    assert largest_imbalance(traced) < (1e-4 if effects else 1e-10)
