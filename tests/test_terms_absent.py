"""What a scene does not ask for is not imported; what it does not use has no parts."""

from __future__ import annotations

import subprocess
import sys

import pytest

BARE = """
import sys
import fxcrack as fx
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
assert scene.continuum.temperature is None
print(*[m for m in sys.modules if m.startswith("fxcrack")])
"""


@pytest.mark.slow
def test_a_bare_scene_imports_no_effect() -> None:
    done = subprocess.run(
        [sys.executable, "-c", BARE], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    loaded = done.stdout.split()
    assert "fxcrack.scene" in loaded
    names = ("plastic", "inertia", "pressure", "neo_hookean", "thermal", "elastic", "bodies")
    effects = {"fxcrack.thermal", *(f"fxcrack.terms.{name}" for name in names)}
    assert not effects & set(loaded)
