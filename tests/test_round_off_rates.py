"""Faces that nothing pulls apart: rates are zero, not what round-off leaves, and nothing grows.

Without a limit for round-off the same scenes report onsets at load factors from 2e10 to 1e12.
"""

from __future__ import annotations

from typing import Any

import pytest
from mpi4py import MPI
from specimens import specimen

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d

TOGETHER = [
    fx.Displacement("pin_top", x=0.0, y=1.0),
    fx.Displacement("pin_bottom", x=0.0, y=1.0),
]
STRETCHED = [
    fx.Displacement("far_upper", x=1.0, y=0.0),
    fx.Displacement("far_lower", x=1.0, y=0.0),
    fx.Displacement("end_upper", x=0.0),
    fx.Displacement("end_lower", x=0.0),
]
PRESSED = [
    fx.Displacement("pin_top", x=0.0, y=-1.0),
    fx.Displacement("pin_bottom", x=0.0, y=1.0),
]


@pytest.mark.parametrize(
    "method", ["vcct", "closure", pytest.param("domain", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("supports", [TOGETHER, STRETCHED, PRESSED])
def test_no_onset_from_round_off(method: Any, supports: list[fx.Displacement]) -> None:
    scene = specimen(
        dcb_2d(MPI.COMM_WORLD, length=100.0, dx=2.0, ny=1),
        supports=supports,
        criterion=fx.VCCT(GIc=0.2, method=method),
    )
    history = scene.run(fx.Static(until=fx.Releases(2)), progress=False)
    assert [row["event"] for row in history] == ["start", "end"]
    assert "not reached" in history.reason
    scene.close()
