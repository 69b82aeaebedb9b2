"""Internal forces of explicit dynamics on several ranks."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.meshes.dcb import dcb_3d


@pytest.mark.mpi
@pytest.mark.three
def test_product_is_that_of_the_whole_matrix(comm: MPI.Intracomm) -> None:
    """Rows may need nodes with which their rank shares no cell, where three ranks meet.

    On 3 ranks this mesh has such nodes; the product is compared with that of PETSc.
    """
    mesh = dcb_3d(comm, length=30.0, width=30.0, height=1.5, dx=3.0, dy=3.0, ny=2)
    continuum = Continuum(mesh, fx.Isotropic(70e3, 0.3), fx.Solid(), order=1)
    matrix = continuum.stiffness()
    u, forces = matrix.createVecs()
    x = continuum.positions()[: continuum.layout.n_owned]
    u.array[:] = np.sin(x * [3.0, 5.0, 7.0]).ravel()
    matrix.mult(u, forces)
    bodies = InternalForces(continuum, [])
    bodies.u.x.array[: continuum.n_local] = u.array_r
    bodies.u.x.scatter_forward()
    found = bodies.stiffness() @ bodies.columns()
    largest = comm.allreduce(float(np.abs(forces.array_r).max(initial=0.0)), op=MPI.MAX)
    assert np.abs(found - forces.array_r).max(initial=0.0) < 1e-12 * largest
    for thing in (matrix, u, forces):
        thing.destroy()
