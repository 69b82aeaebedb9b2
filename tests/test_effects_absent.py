"""A scene has no form, no unknown and no part of what it does not ask for."""

from __future__ import annotations

import subprocess
import sys

import pytest

BARE = """
import sys
import fxcrack as fx
from dolfinx import fem
made, form = [], fem.form
fem.form = lambda *given, **options: made.append(given) or form(*given, **options)
from mpi4py import MPI
from fxcrack.meshes.dcb import dcb_2d
mesh = dcb_2d(MPI.COMM_SELF, length=4.0, dx=0.5, ny=1)
faces = fx.Interface(slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= 2.0)
scene = fx.Scene(
    mesh,
    materials=fx.Isotropic(1e3, 0.3),
    model=fx.PlaneStrain(),
    supports=[
        fx.Displacement("pin_top", x=0.0, y=1.0), fx.Displacement("pin_bottom", x=0.0, y=-1.0)
    ],
    debonds=[fx.Debond(faces, fx.VCCT(GIc=1.0, GIIc=1.0, mix=fx.BK(eta=1.5)))],
)
scene.run(fx.Static(until=fx.CrackLength(faces, 3.0)))
assert scene.continuum.temperature is None and scene.solver.system.friction is None
assert len(made) == 1, made  # the stiffness
print(*sys.modules)
"""


@pytest.mark.slow
def test_a_bare_scene_compiles_the_stiffness_alone() -> None:
    done = subprocess.run(
        [sys.executable, "-c", BARE], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    loaded = done.stdout.split()
    assert "fxcrack.scene" in loaded
    assert "matplotlib" not in loaded
