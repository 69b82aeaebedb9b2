"""A stringer on a skin, its foot come off at one end, as shells beside continuum shells."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from shell_arms import FAST, mean_rates

import fxcrack as fx
from fxcrack.demos.skin_stringer_panel import (
    DEBONDED,
    FOOT,
    HALF_LENGTH,
    HALF_WIDTH,
    HEIGHT,
    SKIN,
    WEB,
)
from fxcrack.meshes.sheets import Sheet, sheets

THICK = SKIN.thickness


def panel(comm: MPI.Intracomm, dx: float, **bond: Any) -> fx.Scene:
    """A quarter of the panel of the demo skin_stringer_panel as shells, the skin pulled downwards.

    The web is joined to the foot, whose other face is the interface.
    """
    x, foot = np.linspace(0.0, HALF_LENGTH, round(HALF_LENGTH / dx) + 1), np.linspace(0.0, FOOT, 9)
    y = np.concatenate([foot, np.linspace(FOOT, HALF_WIDTH, 9)[1:]])
    z = np.linspace(0.0, HEIGHT + 0.5 * THICK, 9)
    parts = [
        Sheet("skin", x, y, lambda a, b: (a, b, -0.5 * THICK + 0.0 * a)),
        Sheet("foot", x, foot, lambda a, b: (a, b, 0.5 * THICK + 0.0 * a)),
        Sheet("web", x, z, lambda a, b: (a, 0.0 * b, 0.5 * THICK + b)),
    ]
    names = [part.name for part in parts]
    along, up = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    interface = fx.Interface(
        slave=fx.Face("foot", "bottom"), master=fx.Face("skin", "top"), name="bond",
        bonded=lambda x: x[0] >= DEBONDED - 1e-9, **bond,
    )  # fmt: skip
    return fx.Scene(
        sheets(parts, comm, joined=True),
        model=fx.Shell(),
        materials={
            "skin": fx.Section(SKIN, axis=along, up=up),
            "foot": fx.Section(SKIN, axis=along, up=up),
            "web": fx.Section(WEB, axis=along, up=(0.0, 1.0, 0.0)),
        },
        supports=[
            *(fx.Symmetry(f"{name}_{end}", "x") for name in names for end in ("a0", "a1")),
            *(fx.Symmetry(where, "y") for where in ("skin_b0", "foot_b0", "web")),
            *(fx.Symmetry(f"{name}_a1", "z") for name in ("skin", "foot")),
            *(fx.Displacement(where, z=0.0) for where in ("web_a1", "skin_b1")),
        ],
        loads=[fx.Pressure(fx.Face("skin", "bottom"), -1e-3)],
        debonds=[fx.Debond(interface, fx.VCCT(GIc=1e6))],
        monitors=[fx.Monitor("skin_a0b0", (0, 0, 1), name="w")],
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "low", "high"), [({}, 0.97, 0.99), ({"stiffness": "arms"}, 0.985, 1.005)],
    ids=["exact bonds", "compliant bonds"],
)  # fmt: skip
def test_rates_under_the_foot(
    comm: MPI.Intracomm, given: dict[str, Any], low: float, high: float
) -> None:
    """G and modes of 27-node continuum shells 2 long (44,469 unknowns), one per part.

    The web of the reference stands on the foot by an interface, which the joint here replaces: the
    deflection agrees within 2 %, shares of the modes within 0.02.
    """
    scene = panel(comm, 2.0, **given)
    history = scene.run(FAST, progress=False)
    found = mean_rates(scene)
    assert low < found.sum() / 2.939e-5 < high
    assert found / found.sum() == pytest.approx([0.608, 0.092, 0.300], abs=0.02)
    assert history["m[w]"][-1] == pytest.approx(-1.1034e-2, rel=0.02)
    assert abs(history["balance"][-1]) < 1e-9 * history["strain_energy"][-1]
    scene.close()
