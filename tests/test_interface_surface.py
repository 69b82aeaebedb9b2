"""Surfaces of all facet shapes gathered from meshes: areas, normals, sizes, the same everywhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mpi4py import MPI
from specimens import tensor_surface

import fxcrack as fx
from fxcrack.base.errors import InterfaceError
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.frames import local_frames
from fxcrack.interface.surface import gather_surface
from fxcrack.mesh import Mesh
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.penny import penny

Array = npt.NDArray[np.float64]
Make = Callable[[MPI.Intracomm, int], Mesh]

ROUND_OFF = 1e-12  # of areas of order 10

X = np.array([0.0, 0.7, 1.5, 1.6, 3.0])
Z = np.array([0.0, 0.5, 1.7, 2.0])
# cell, its facet, the mesh
SHAPES: dict[str, Make] = {
    cell: (
        lambda comm, order, cell=cell: dcb_2d(
            comm, length=3.0, x_spacing=X, ny=1, cell=cell, order=order
        )
    )
    for cell in ("quadrilateral", "triangle")
} | {
    cell: (
        lambda comm, order, cell=cell: dcb_3d(
            comm, length=3.0, width=2.0, x_spacing=X, z_spacing=Z, ny=1, cell=cell, order=order
        )
    )
    for cell in ("hexahedron", "tetrahedron")
}
CASES = [(cell, order) for cell in SHAPES for order in (1, 2)]


def continuum(mesh: Mesh, order: int | None = None) -> Continuum:
    model = fx.PlaneStrain(thickness=2.0) if mesh.gdim == 2 else fx.Solid()
    return Continuum(mesh, fx.Isotropic(1.0, 0.3), model, order=order)


@pytest.mark.quick("*-1")
@pytest.mark.three
@pytest.mark.mpi
@pytest.mark.parametrize(("cell", "order"), CASES)
def test_gathered_surface(comm: MPI.Intracomm, cell: str, order: int) -> None:
    """Whole on every rank; nodes and facets in an order that no partition changes."""
    surface = gather_surface(continuum(SHAPES[cell](comm, order)), "upper_face")
    alone = gather_surface(continuum(SHAPES[cell](MPI.COMM_SELF, order)), "upper_face")
    assert np.array_equal(surface.facets, alone.facets)
    assert surface.x == pytest.approx(alone.x, abs=ROUND_OFF)
    assert len(np.unique(surface.dofs)) == surface.n_nodes
    # 3 long, 2 wide or thick
    assert surface.areas.sum() == pytest.approx(6.0, abs=ROUND_OFF)
    assert surface.normals == pytest.approx(
        np.tile([0.0, -1.0, 0.0], (surface.n_nodes, 1)), abs=ROUND_OFF
    )
    # integrals of the coordinate: shape functions reproduce it
    assert surface.areas @ surface.x[:, 0] == pytest.approx(9.0, abs=10 * ROUND_OFF)


def test_tributary_areas_by_hand() -> None:
    """Trapezoidal and Simpson weights, a third of each triangle, a quarter of each rectangle."""
    line = tensor_surface("interval", 1, X)
    assert line.areas == pytest.approx([0.35, 0.75, 0.45, 0.75, 0.7], abs=ROUND_OFF)
    simpson = tensor_surface("interval", 2, [0.0, 1.2])
    assert simpson.areas == pytest.approx([0.2, 0.8, 0.2], abs=ROUND_OFF)
    assert tensor_surface("quadrilateral", 1, [0.0, 2.0], [0.0, 3.0]).areas == pytest.approx(
        np.full(4, 1.5), abs=ROUND_OFF
    )
    # corners of a second-order triangle stand for nothing, midsides for a third
    areas = np.sort(tensor_surface("triangle", 2, [0.0, 1.0], [0.0, 1.0]).areas)
    assert areas == pytest.approx([0, 0, 0, 0, 1 / 6, 1 / 6, 1 / 6, 1 / 6, 1 / 3], abs=ROUND_OFF)


@pytest.mark.parametrize("order", [1, 2])
def test_ring(order: int) -> None:
    """Axisymmetric: areas are those of full rings, 2 pi r."""
    mesh = penny(MPI.COMM_SELF, radius=5.0, half_height=2.0, dr=0.25, order=order)
    rings = Continuum(mesh, fx.Isotropic(1.0, 0.3), fx.Axisymmetric())
    surface = gather_surface(rings, "upper_face")
    assert surface.areas.sum() == pytest.approx(np.pi * 25.0, abs=100 * ROUND_OFF)
    # the node on the axis: int 2 pi r (1 - r/h) dr = pi h^2/3, nothing in second order
    centre = int(np.argmin(surface.x[:, 0]))
    h = np.sort(surface.x[:, 0])[order]
    expected = np.pi * h**2 / 3.0 if order == 1 else 0.0
    assert surface.areas[centre] == pytest.approx(expected, abs=ROUND_OFF)


def test_second_order_displacement_on_first_order_mesh() -> None:
    surface = gather_surface(continuum(SHAPES["hexahedron"](MPI.COMM_SELF, 1), 2), "upper_face")
    assert surface.order == 2 and surface.facets.shape == (12, 9)
    assert surface.areas.sum() == pytest.approx(6.0, abs=ROUND_OFF)


@pytest.mark.parametrize(
    ("kind", "axes", "size"),
    [
        ("interval", ([0.0, 1.0, 3.0, 6.0],), 2.0),
        # edges of length 1 and 2 in equal number, no diagonals among them
        ("quadrilateral", ([0.0, 1.0, 2.0], [0.0, 2.0, 4.0]), 1.5),
        ("triangle", ([0.0, 1.0], [0.0, 1.0]), 1.0),
    ],
)
def test_facet_size(kind: str, axes: tuple[list[float], ...], size: float) -> None:
    assert tensor_surface(kind, 1, *axes).facet_size == pytest.approx(size)


@pytest.mark.mpi
def test_surface_inside_a_body_is_refused(comm: MPI.Intracomm) -> None:
    def make() -> Blocks:
        model = Blocks()
        block = model.add("body", ([0.0, 1.0, 2.0], [0.0, 1.0, 2.0]), "quadrilateral", 1)
        model.group("cut", block.part(y=1.0))
        return model

    with pytest.raises(InterfaceError, match="facet group 'cut' has facets inside the body"):
        gather_surface(continuum(build(comm, "block", make)), "cut")


@given(arrays(np.float64, (8, 3), elements=st.floats(-1.0, 1.0)))
def test_frames_are_orthonormal(v: Array) -> None:
    length = np.linalg.norm(v, axis=1, keepdims=True)
    normals = np.where(length > 1e-3, v / np.maximum(length, 1e-3), [0.0, 0.0, 1.0])
    frames = local_frames(normals, 3)
    assert np.einsum("nij,nik->njk", frames, frames) == pytest.approx(
        np.tile(np.eye(3), (8, 1, 1)), abs=1e-14 * 10
    )
    assert np.linalg.det(frames) == pytest.approx(np.ones(8), abs=1e-13)
    assert np.array_equal(frames[:, :, 0], normals)
    flat = normals[np.linalg.norm(normals[:, :2], axis=1) > 1e-3] * [1.0, 1.0, 0.0]
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    frames = local_frames(flat, 2)
    assert np.linalg.det(frames) == pytest.approx(np.ones(len(flat)), abs=1e-13)
    assert np.array_equal(frames[:, :, 0], flat[:, :2])
