"""Internal forces of explicit dynamics on several ranks."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

import fxcrack as fx
from fxcrack.base.sparse import Product
from fxcrack.continuum import block_product
from fxcrack.continuum.block_product import BlockProduct, fast_product
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.internal_forces import InternalForces
from fxcrack.continuum.stiffness_rows import StiffnessRows
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


@pytest.mark.parametrize("size", [2, 3])
def test_block_products_are_those_of_the_matrix(size: int) -> None:
    """Blocks that are full, those with zeros, rows without any, and matrices without rows."""
    random = np.random.default_rng(7)
    dense = random.standard_normal((12 * size, 20 * size))
    dense *= np.kron(random.random((12, 20)) < 0.3, np.ones((size, size)))
    dense[4 * size : 5 * size] = 0.0
    dense[7 * size] = 0.0
    product = fast_product(sp.csr_matrix(dense), size, MPI.COMM_SELF)
    x, y = random.standard_normal(20 * size), random.standard_normal(12 * size)
    wanted = y + 3.0 * dense @ x
    product.data *= 3.0
    product.add(x, y)
    assert isinstance(product, BlockProduct)
    assert product.shape == dense.shape
    # round-off of sums of some ten terms
    assert y == pytest.approx(wanted, rel=1e-13, abs=1e-13)
    assert product.into(x, np.ones(len(y))) == pytest.approx(3.0 * dense @ x, rel=1e-13, abs=1e-13)
    none = fast_product(sp.csr_matrix((0, 2 * size)), size, MPI.COMM_SELF)
    assert none(np.ones(2 * size)).shape == (0,)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_rows_of_a_symmetric_matrix(size: int) -> None:
    """Rows wanted by node and by dof, columns of other ranks; half of what is square is stored."""
    random = np.random.default_rng(3)
    n, more = 11, 4
    dense = random.standard_normal((n * size, (n + more) * size))
    dense *= np.kron(random.random((n, n + more)) < 0.4, np.ones((size, size)))
    square = dense[:, : n * size]
    square += square.T + np.eye(n * size)
    wanted = np.ones(n * size, dtype=bool)
    wanted[3 * size : 4 * size] = wanted[6 * size] = False
    rows = StiffnessRows(sp.csr_matrix(dense), wanted, size, MPI.COMM_SELF)
    u, v = random.standard_normal((n + more) * size), random.standard_normal(n * size)
    forces = np.where(wanted, dense @ u, 0.0)
    # round-off of sums of some ten terms
    close = {"rel": 1e-13, "abs": 1e-13}
    assert rows(u) == pytest.approx(forces, **close)
    factors = random.standard_normal(n * size)
    for _ in range(2):  # nothing is left of the first
        moved = v.copy()
        rows.push(u, factors, moved)
        assert moved == pytest.approx(v + factors * forces, **close)


def test_products_take_those_of_scipy_where_there_is_no_compiler(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse() -> None:
        raise OSError("no compiler")

    monkeypatch.setattr(block_product, "_loaded", {})
    monkeypatch.setattr(block_product, "_load", refuse)
    product = fast_product(sp.identity(4, format="csr"), 2, MPI.COMM_SELF)
    assert isinstance(product, Product)
    assert product(np.arange(4.0)) == pytest.approx(np.arange(4.0))
    assert "no compiler" in caplog.text
