"""Explicit dynamics tells where linear bodies turn by angles that are not small."""

from __future__ import annotations

import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d
from tests.test_shell_explicit_bonds import dcb

WORDS = "turned by up to"


@pytest.mark.mpi
@pytest.mark.three
def test_rotations_of_solids(comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture) -> None:
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= 29.0, name="bond"
    )
    scene = fx.Scene(
        dcb_2d(comm, length=40.0, height=1.5, dx=5.0, ny=1),
        materials=fx.Isotropic(70e3, 0.3, density=2.7e-9),
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("pin_top", x=0.0, y=1e5)],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1e6))],
        effects=[fx.Inertia()],
    )
    scene.run(fx.Explicit(until=fx.Time(1e-6), rows=2), progress=False)
    assert WORDS not in caplog.text
    scene.run(fx.Explicit(until=fx.Time(5e-5), rows=20), progress=False)
    scene.close()
    if comm.rank == 0:
        assert caplog.text.count(WORDS) == 1
        assert "FiniteStrain()" in caplog.text


def test_rotations_of_shells_with_interfaces(caplog: pytest.LogCaptureFixture) -> None:
    """They are for small rotations; what else is possible is said, as finite strain is not."""
    scene, _ = dcb(MPI.COMM_SELF, 16.0, 2.0, 1e5, contact=True)
    scene.run(fx.Explicit(until=fx.Time(1e-4), rows=20), progress=False)
    scene.close()
    assert caplog.text.count(WORDS) == 1
    assert "interfaces of shells are for small rotations" in caplog.text
