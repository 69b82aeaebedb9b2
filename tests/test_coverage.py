"""Each criterion in each model, on any number of ranks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import PARIS, assert_same, bond, largest_imbalance

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.penny import penny

Cell = tuple[fx.Scene, Any]

STEEL = fx.Isotropic(70e3, 0.3)
SAME = 1e-8  # of the largest value: what factorisations on other ranks differ by


def beam(comm: MPI.Intracomm, model: Any) -> dict[str, Any]:
    """A double cantilever beam, a0 = 10."""
    plane = not isinstance(model, fx.Solid)
    mesh = (
        dcb_2d(comm, length=24.0, dx=1.0, ny=2)
        if plane
        else dcb_3d(comm, length=24.0, width=4.0, dx=1.0, dy=2.0, ny=1)
    )
    z = {} if plane else {"z": 0.0}
    # uneven across the width, so that no two front nodes are alike
    pull: Any = 0.5 if plane else lambda x: 0.5 + 0.05 * x[2]
    return {
        "mesh": mesh,
        "model": model,
        "supports": [
            fx.Displacement("pin_top", x=0.0, y=pull, **z),
            fx.Displacement("pin_bottom", x=0.0, y=-0.5, **z),
        ],
    }


def ring(comm: MPI.Intracomm, model: Any) -> dict[str, Any]:
    """A penny-shaped crack under a stretched cylinder, a0 = 10."""
    return {
        "mesh": penny(comm, a=10.0, radius=24.0, half_height=12.0, dr=1.0),
        "model": model,
        "supports": [
            fx.Displacement("axis_upper", x=0.0),
            fx.Displacement("axis_lower", x=0.0),
            fx.Displacement("bottom", y=0.0),
            fx.Displacement("top", y=0.1),
        ],
    }


MODELS: dict[str, tuple[Any, Any]] = {
    "plane": (beam, fx.PlaneStrain(4.0)),
    "axisymmetric": (ring, fx.Axisymmetric()),
    "3-D": (beam, fx.Solid()),
}

MIX = {"GIc": 0.1, "GIIc": 0.3, "mix": fx.BK(eta=1.5)}
CRITERIA: dict[str, tuple[Any, str]] = {
    # the criterion, and a quantity of its own in the history
    "critical stress": (fx.CriticalStress(40.0, 80.0, distance=0.5), "s11"),
    "crack opening": (fx.CrackOpening(([0.0, 2.0], [4e-3, 6e-3]), distance=2.5), "cod"),
    "crack length": (
        fx.CrackLengthVsTime((0.0, 1.0), (9.0, 16.0), reference="REFERENCE"),
        "length",
    ),
    "VCCT": (fx.VCCT(**MIX), "GI"),
    "enhanced VCCT": (fx.EnhancedVCCT(**MIX, GIc_p=0.08, GIIc_p=0.2), "GI"),
    "fatigue": (fx.Fatigue(**MIX, paris=PARIS, partial=False), "dG"),
}


def grown(comm: MPI.Intracomm, model: str, criterion: Any) -> fx.Scene:
    make, kinematics = MODELS[model]
    parts = make(comm, kinematics)
    if isinstance(criterion, fx.CrackLengthVsTime):
        reference = "axis_upper" if model == "axisymmetric" else "pin_top"
        criterion = fx.CrackLengthVsTime(criterion.times, criterion.lengths, reference=reference)
    debond = fx.Debond(bond(10.0), criterion)
    scene = fx.Scene(materials=STEEL, debonds=[debond], **parts)
    if isinstance(criterion, fx.Fatigue):
        # to just below the static toughness at the start, then some releases
        scene.run(fx.Cycles(maximum=LOADS[model], ratio=0.1, until=fx.Releases(4)))
    else:
        scene.run(fx.Static(until=fx.Releases(4)))
    return scene


LOADS = {"plane": 0.15, "axisymmetric": 0.1, "3-D": 0.15}


@pytest.mark.quick("plane-VCCT", "plane-fatigue", "axisymmetric-critical stress", "3-D-VCCT")
@pytest.mark.three
@pytest.mark.mpi
@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("model", MODELS)
def test_every_cell_on_any_number_of_ranks(comm: MPI.Intracomm, model: str, criterion: str) -> None:
    what, quantity = CRITERIA[criterion]
    together = grown(comm, model, what)
    history = together.history
    assert together.cracks[0].n_released >= 4
    assert f"{quantity}[bond]" in history.columns
    assert largest_imbalance(history) < 1e-8
    if criterion != "fatigue":
        at = np.isin(history["event"], ["onset", "unstable"])
        # f = 1 at every release under event stepping, above it where a release left more
        assert np.all(history["f[bond]"][at] >= 1.0 - 1e-8)
        assert history["f[bond]"][at][0] == pytest.approx(1.0, abs=1e-8)
    if comm.size > 1:
        alone = grown(MPI.COMM_SELF, model, what)
        assert_same(alone.history, history, SAME)
        alone.close()
    together.close()
