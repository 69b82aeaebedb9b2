"""The demo of a blister: a film lifted by pressure against closed forms of plate and membrane."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos import shell_blister
from fxcrack.meshes.blister import blister

COARSE = {"n_around": 4, "n_inside": 6, "n_outside": 4, "front": 0.03}


@pytest.mark.mpi
def test_small_deflection_is_that_of_a_clamped_plate(comm: MPI.Intracomm) -> None:
    """Shear and the root of the film add 1 % to the deflection at a/t = 100."""
    found = shell_blister.plate(**COARSE)
    assert found["w / plate"] == pytest.approx(1.012, abs=1.5e-2)
    assert found["G / plate"] == pytest.approx(1.0, abs=4e-2)


@pytest.mark.slow
def test_large_deflection_tends_to_a_membrane(comm: MPI.Intracomm) -> None:
    """At w = 12 t; the pressure keeps its direction, which takes a few per cent of G."""
    rows = np.array(shell_blister.membrane())
    assert np.all(np.diff(rows[:, 2]) > 0.0)
    assert rows[-1, 1] == pytest.approx(12.0, abs=0.2)
    assert rows[-1, 2] == pytest.approx(0.993, abs=5e-3)
    assert rows[-1, 3] == pytest.approx(0.938, abs=1e-2)


@pytest.mark.parametrize("order", [1, 2])
def test_mesh_of_the_blister(comm: MPI.Intracomm, order: int) -> None:
    mesh = blister(comm, **{**COARSE, "order": order})
    assert (mesh.gdim, mesh.tdim, mesh.order) == (3, 2, order)
    assert set(mesh.groups) == {
        "film", "base", "blister", "film_x0", "film_y0", "film_rim", "centre"
    }  # fmt: skip
    with pytest.raises(fx.FxcrackError, match="base_z < film_z"):
        blister(comm, base_z=1.0)
