"""The part of the energy that belongs to jumps of the strain, beside closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.strain_jumps import part_of_jumps
from fxcrack.mesh import from_dolfinx

LENGTH = 1.0


def bodies(comm: MPI.Intracomm, cell: str, order: int, n: int) -> Continuum:
    from dolfinx import mesh

    kind = getattr(mesh.CellType, cell)
    if cell in ("hexahedron", "tetrahedron"):
        corners = [np.zeros(3), np.array([LENGTH, 0.4, 0.4])]
        domain = mesh.create_box(comm, corners, [n, 2, 2], kind)
        model: fx.PlaneStrain | fx.Solid = fx.Solid()
    else:
        domain = mesh.create_rectangle(comm, [(0.0, 0.0), (LENGTH, 0.4)], [n, 2], kind)
        model = fx.PlaneStrain()
    return Continuum(from_dolfinx(domain), fx.Isotropic(1.0, 0.3), model, order=order)


def displaced(continuum: Continuum, power: int) -> np.ndarray:
    """u_x = x to a power at the owned nodes."""
    x = continuum.positions()[: continuum.n_local // continuum.gdim]
    out = np.zeros((len(x), continuum.gdim))
    out[:, 0] = x[:, 0] ** power
    return out.ravel()


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle", "hexahedron", "tetrahedron"])
def test_strains_that_do_not_jump_have_no_part(comm: MPI.Intracomm, cell: str) -> None:
    """A linear field at first order, a quadratic one at second: to round-off."""
    for order in (1, 2):
        continuum = bodies(comm, cell, order, 4)
        assert part_of_jumps(continuum, displaced(continuum, order)) < 1e-24
        assert part_of_jumps(continuum, np.zeros(continuum.n_local)) == 0.0


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("n", [5, 8])
@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
def test_a_parabola_at_first_order(comm: MPI.Intracomm, cell: str, n: int) -> None:
    """The strain is h (2 i + 1) in cell i, recovered 2 x: h^2/3 of (4 - h^2)/3, at the ends too."""
    h = LENGTH / n
    continuum = bodies(comm, cell, 1, n)
    found = part_of_jumps(continuum, displaced(continuum, 2))
    assert found == pytest.approx(h**2 / (4.0 - h**2), rel=1e-12)
