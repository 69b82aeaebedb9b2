"""Fields in the order of the mesh's input: the same arrays from any number of ranks, and back."""

from __future__ import annotations

from fxcrack.base import compat  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
import numpy.typing as npt
import pytest
from bodies import box
from dolfinx import fem
from mpi4py import MPI

import fxcrack as fx
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.input_order import FileOrder, Place
from fxcrack.continuum.plasticity import _at_points

pytestmark = pytest.mark.mpi

KINDS = [
    (m, simplex, order) for m in ("plane strain", "solid") for simplex in (0, 1) for order in (1, 2)
]
MODELS = {"plane strain": fx.PlaneStrain(), "solid": fx.Solid()}


class Body:
    """A block with fields that say where they are, on nodes and at points of its right half."""

    def __init__(self, comm: MPI.Intracomm, model: str, simplex: bool, order: int) -> None:
        mesh = box(comm, model, n=(4, 3, 2), simplex=simplex)
        parts = {"left": fx.Isotropic(70e3, 0.3), "right": fx.Isotropic(7e3, 0.3)}
        self.continuum = Continuum(mesh, parts, MODELS[model], order=order)
        self.order = FileOrder(mesh.domain)
        self.cells = self.continuum.part_cells[1]

    def fields(self) -> list[tuple[npt.NDArray[np.float64], Place]]:
        """Positions of the nodes, and of the quadrature points cell by cell."""
        c = self.continuum
        points = compat.interpolation_points(_at_points(c, ()))
        there = fem.Expression(c.x, points).eval(c.mesh.domain, self.cells)
        return [(c.positions(), c.space), (np.asarray(there), self.cells)]


@pytest.mark.quick("*-1-1")
@pytest.mark.three
@pytest.mark.parametrize(("model", "simplex", "order"), KINDS)
def test_one_rank_and_all_ranks_write_and_read_the_same(
    model: str, simplex: bool, order: int, comm: MPI.Intracomm
) -> None:
    one, all_ = (Body(c, model, simplex, order) for c in (MPI.COMM_SELF, comm))
    for (a, place_a), (b, place_b) in zip(one.fields(), all_.fields(), strict=True):
        alone = one.order.gather(a, place_a)
        whole = comm.bcast(all_.order.gather(b, place_b))
        assert len(np.unique(np.round(alone, 9), axis=0)) == len(alone)  # no two rows are alike
        assert np.abs(alone - whole).max() < 1e-14
        assert np.abs(one.order.scatter(whole, place_a).ravel() - a.ravel()).max() < 1e-14
        assert (
            np.abs(all_.order.scatter(alone, place_b).ravel() - b.ravel()).max(initial=0.0) < 1e-14
        )


@pytest.mark.three
def test_values_of_ghosts_do_not_count(comm: MPI.Intracomm) -> None:
    """Terms need not keep ghosts up to date: what a node holds is said by its owner."""
    body = Body(comm, "solid", False, 1)
    (positions, space), _ = body.fields()
    right = body.order.gather(positions, space)
    stale = positions.copy()
    stale[space.dofmap.index_map.size_local :] = 1e3
    found = body.order.gather(stale, space)
    assert np.array_equal(found, right)
