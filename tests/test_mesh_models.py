"""The parametric specimens: sizes of their groups, matching faces, spacing, files and scripts."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from test_mesh_read import ROUND_OFF, assert_same_on_ghosts, corners, measure, size

from fxcrack.base.errors import MeshError
from fxcrack.mesh import Mesh, read_mesh
from fxcrack.meshes.center_crack import center_crack
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.enf import enf_2d
from fxcrack.meshes.mmb import mmb_2d
from fxcrack.meshes.penny import penny
from fxcrack.meshes.script import run
from fxcrack.meshes.spacing import even, fine_region, growing

CASES_2D = [(cell, order) for cell in ("quadrilateral", "triangle") for order in (1, 2)]
CASES_3D = [(cell, order) for cell in ("hexahedron", "tetrahedron") for order in (1, 2)]
MESHES = Path(__file__).parents[1] / "meshes"


def point(mesh: Mesh, name: str) -> np.ndarray:
    """Where the one node of a group is."""
    found = mesh.comm.allgather(corners(mesh, mesh.group(name, dim=0)).reshape(-1, 3))
    (only,) = np.unique(np.concatenate(found), axis=0)
    return only


def face_nodes(mesh: Mesh, name: str) -> np.ndarray:
    """Corner nodes of a face, sorted by position."""
    found = mesh.comm.allgather(corners(mesh, mesh.group(name)).reshape(-1, 3))
    return np.unique(np.concatenate(found).round(9), axis=0)


@pytest.mark.parametrize(("cell", "order"), CASES_2D)
def test_dcb_2d(cell: str, order: int) -> None:
    comm = MPI.COMM_SELF
    mesh = dcb_2d(comm, length=10.0, height=1.5, dx=0.5, ny=3, cell=cell, order=order)
    nx, ny, parts = 20, 3, 2 if cell == "triangle" else 1
    nodes = 2 * (order * nx + 1) * (order * ny + 1)
    assert mesh.domain.geometry.index_map().size_global == nodes
    assert (mesh.gdim, mesh.order) == (2, order)
    for arm in ("upper", "lower"):
        assert size(mesh, arm) == nx * ny * parts
        assert measure(mesh, arm) == pytest.approx(15.0, rel=ROUND_OFF)
        assert size(mesh, f"{arm}_face") == nx
        assert size(mesh, f"end_{arm}") == size(mesh, f"far_{arm}") == ny
        assert measure(mesh, f"end_{arm}") == pytest.approx(1.5, rel=ROUND_OFF)
    assert size(mesh, "top") == size(mesh, "bottom") == nx
    assert np.all(point(mesh, "pin_top") == [0.0, 1.5, 0.0])
    assert np.all(point(mesh, "pin_bottom") == [0.0, -1.5, 0.0])
    assert np.array_equal(face_nodes(mesh, "upper_face"), face_nodes(mesh, "lower_face"))
    assert np.array_equal(face_nodes(mesh, "upper_face")[:, 0], np.linspace(0, 10, nx + 1))
    assert_same_on_ghosts(mesh)


@pytest.mark.quick("hexahedron-1")
@pytest.mark.mpi
@pytest.mark.parametrize(("cell", "order"), CASES_3D)
def test_dcb_3d(comm: MPI.Comm, cell: str, order: int) -> None:
    mesh = dcb_3d(comm, length=6.0, width=4.0, dx=1.0, dy=1.0, ny=1, cell=cell, order=order)
    boxes, parts, halves = 6 * 4 * 1, 6 if cell == "tetrahedron" else 1, 2 if cell[0] == "t" else 1
    nodes = 2 * (6 * order + 1) * (order + 1) * (4 * order + 1)
    assert mesh.domain.geometry.index_map().size_global == nodes
    for arm in ("upper", "lower"):
        assert size(mesh, arm) == boxes * parts
        assert measure(mesh, arm) == pytest.approx(6 * 4 * 1.5, rel=ROUND_OFF)
        assert size(mesh, f"{arm}_face") == 24 * halves
        assert measure(mesh, f"{arm}_face") == pytest.approx(24.0, rel=ROUND_OFF)
        assert measure(mesh, f"end_{arm}") == pytest.approx(6.0, rel=ROUND_OFF)
    for side in ("side_0", "side_w"):
        assert measure(mesh, side) == pytest.approx(18.0, rel=ROUND_OFF)
    assert size(mesh, "pin_top") == 4 and mesh.group("pin_top").dim == 1
    assert np.all(point(mesh, "mid_top") == [0.0, 1.5, 2.0])
    assert np.all(point(mesh, "mid_bottom") == [0.0, -1.5, 2.0])
    # Facets of the faces are the same, too: tetrahedra are mirrored.
    middles = [
        np.unique(np.concatenate(comm.allgather(x.mean(axis=1))).round(9), axis=0)
        for x in (corners(mesh, mesh.group(f"{arm}_face")) for arm in ("upper", "lower"))
    ]
    assert np.array_equal(*middles)
    assert_same_on_ghosts(mesh)


def test_dcb_spacing() -> None:
    comm = MPI.COMM_SELF
    mesh = dcb_2d(comm, length=10.0, dx=0.1, fine=(3.0, 6.0), coarse_dx=1.0)
    x = face_nodes(mesh, "upper_face")[:, 0]
    inside = (x > 3.0 - 1e-9) & (x < 6.0 + 1e-9)
    assert np.allclose(x[inside], np.linspace(3.0, 6.0, 31), atol=1e-9)
    assert np.diff(x).max() < 1.05 and len(x) < 60
    given = np.array([0.0, 0.3, 1.0, 1.2, 2.0])
    mesh = dcb_2d(comm, length=2.0, x_spacing=given, nx_lower=7, ny=1, ny_lower=3)
    assert np.array_equal(face_nodes(mesh, "upper_face")[:, 0], given)
    assert np.allclose(face_nodes(mesh, "lower_face")[:, 0], np.linspace(0, 2, 8), atol=1e-9)
    assert size(mesh, "lower") == 21 and size(mesh, "upper") == 4
    mesh = dcb_3d(comm, length=2.0, width=1.0, x_spacing=given, z_spacing=[0.0, 0.2, 1.0])
    assert np.array_equal(np.unique(face_nodes(mesh, "side_w")[:, 0]), given)
    assert "mid_top" not in mesh.groups  # no node in the middle of the width


def test_bending_specimens(comm: MPI.Comm) -> None:
    for mesh in (
        enf_2d(comm, half_span=5.08, height=2.0, dx=0.5, ny=2),
        mmb_2d(comm, half_span=5.08, height=2.0, dx=0.5, ny=2, cell="triangle", order=2),
    ):
        assert np.allclose(point(mesh, "load"), [5.08, 2.0, 0.0], rtol=0, atol=1e-14)
        assert np.all(point(mesh, "support_left") == [0.0, -2.0, 0.0])
        assert np.all(point(mesh, "support_right") == [10.16, -2.0, 0.0])
        assert measure(mesh, "upper") == pytest.approx(2.0 * 10.16, rel=ROUND_OFF)
        assert size(mesh, "upper_face") == size(mesh, "lower_face") == 22
    assert np.all(point(mesh, "lever_end") == [0.0, 2.0, 0.0])


@pytest.mark.mpi
def test_penny(comm: MPI.Comm) -> None:
    mesh = penny(comm, a=1.0, radius=6.0, half_height=5.0, dr=0.1, fine=0.3, growth=1.3)
    r = face_nodes(mesh, "upper_face")[:, 0]
    assert np.array_equal(r, face_nodes(mesh, "lower_face")[:, 0])
    near = abs(r - 1.0) < 0.3 + 1e-6
    assert np.allclose(r[near], np.linspace(0.7, 1.3, 7), atol=1e-9)  # r = a is a node
    assert np.diff(r).max() < 1.5 and (r[0], r[-1]) == (0.0, 6.0)
    assert measure(mesh, "upper") == pytest.approx(30.0, rel=ROUND_OFF)
    assert measure(mesh, "axis_upper") == pytest.approx(5.0, rel=ROUND_OFF)
    assert measure(mesh, "outer") == pytest.approx(10.0, rel=ROUND_OFF)
    assert np.all(point(mesh, "axis_bottom") == [0.0, -5.0, 0.0])
    assert np.all(point(mesh, "outer_top") == [6.0, 5.0, 0.0])
    assert size(mesh, "centre_upper") == 1 and np.all(point(mesh, "centre_lower") == 0.0)
    assert_same_on_ghosts(mesh)


def test_center_crack(comm: MPI.Comm) -> None:
    mesh = center_crack(comm, a=1.0, width=8.0, height=6.0, n_crack=5, fine=0.4, growth=1.3)
    x = face_nodes(mesh, "upper_face")[:, 0]
    assert np.allclose(x, -x[::-1], atol=1e-12)
    assert sum(abs(x) < 1.0 + 1e-9) == 11
    assert measure(mesh, "upper") == pytest.approx(24.0, rel=ROUND_OFF)
    for side in ("left", "right"):
        assert measure(mesh, side) == pytest.approx(6.0, rel=ROUND_OFF)
    assert np.all(point(mesh, "bottom_right") == [4.0, -3.0, 0.0])
    assert np.all(point(mesh, "top_left") == [-4.0, 3.0, 0.0])


@pytest.mark.mpi
def test_wrong_arguments(comm: MPI.Comm) -> None:
    def fails(match: str, function: Callable[..., Mesh], **options: Any) -> None:
        with pytest.raises(MeshError, match=match):
            function(comm, **options)

    fails("dx must be positive, not 0", dcb_2d, dx=0.0)
    fails("elements must be positive, not 0", dcb_2d, ny=0)
    fails("cells must be quadrilateral or triangle of order 1 or 2, not 'hex'", dcb_2d, cell="hex")
    fails("of order 3", dcb_3d, order=3)
    fails("must increase from 0 to 100", dcb_2d, x_spacing=[0.0, 2.0, 1.0, 100.0])
    fails("must increase from 0 to 100", dcb_2d, x_spacing=[0.0, 99.0])
    fails("fine region 50 to 120 must lie between 0 and 100", dcb_2d, fine=(50.0, 120.0))
    fails("crack radius 3 must be smaller than the radius 2", penny, a=3.0, radius=2.0)
    fails("must be shorter than the width 2", center_crack, a=1.0, width=2.0)
    fails(r"must end in \.msh", dcb_2d, out="dcb.vtk")
    fails("there is no folder 'nowhere'; make it", dcb_2d, out="nowhere/dcb.msh")


@pytest.mark.mpi
def test_model_written_and_read_again(comm: MPI.Comm, shared_path: Path) -> None:
    path = shared_path / "dcb.msh"
    mesh = dcb_3d(comm, length=4.0, width=2.0, ny=1, order=2, cell="tetrahedron", out=path)
    comm.Barrier()
    again = read_mesh(path, comm)
    assert sorted(again.groups) == sorted(mesh.groups)
    assert {n: size(again, n) for n in mesh.groups} == {n: size(mesh, n) for n in mesh.groups}
    assert np.array_equal(face_nodes(again, "upper_face"), face_nodes(mesh, "upper_face"))
    assert [p.name for p in shared_path.iterdir()] == ["dcb.msh"]


def test_scripts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.msh"
    words = ["--out", str(out), "--dx", "10", "--fine", "30", "60", "--coarse-dx", "20"]
    run(dcb_2d, dcb_3d, argv=words)
    assert "a.msh: " in capsys.readouterr().out and out.is_file()
    run(dcb_2d, dcb_3d, argv=["dcb_3d", "--out", str(out), "--dx", "10", "--cell", "tetrahedron"])
    assert read_mesh(out, MPI.COMM_SELF).gdim == 3
    with pytest.raises(SystemExit, match="error: dx must be positive"):
        run(dcb_2d, argv=["--out", str(out), "--dx", "-1"])
    with pytest.raises(SystemExit):
        run(dcb_2d, dcb_3d, argv=["dcb_3d", "--help"])
    assert "Step across the width" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["dcb", "enf", "mmb", "penny", "center_crack"])
def test_files_are_scripts(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "mesh.msh"
    monkeypatch.setattr(sys, "argv", [f"{name}.py", "--out", str(out)])
    runpy.run_path(str(MESHES / f"{name}.py"), run_name="__main__")
    assert out.stat().st_size > 0


def test_spacing() -> None:
    assert np.allclose(even(0.0, 1.0, 0.3), [0.0, 0.25, 0.5, 0.75, 1.0])
    assert len(even(0.0, 1.0, 0.1)) == 11  # round-off adds no element
    x = growing(2.0, 0.0, 0.1, growth=1.5, even_length=0.3, largest=0.4)
    steps = np.diff(x)[::-1]
    assert (x[0], x[-1]) == (0.0, 2.0) and np.allclose(steps[:3], 0.1)
    assert np.all(np.diff(steps) > -1e-12) and steps.max() < 0.4 * 1.3
    x = growing(0.0, 1.02, 0.1, even_length=1.0)  # no sliver of 0.02 at the end
    assert np.allclose(np.diff(x), [*[0.1] * 9, 0.12])
    assert np.array_equal(fine_region(1.0, 1.0), [0.0, 1.0])
    with pytest.raises(MeshError, match=r"even region of 3 .* does not fit into 2"):
        growing(0.0, 2.0, 0.1, even_length=3.0)
    with pytest.raises(MeshError, match=r"growth=0\.5 must be at least 1"):
        growing(0.0, 2.0, 0.1, growth=0.5)


@pytest.mark.parametrize("n", [5, 8])
@pytest.mark.parametrize("growth", [1.0, 1.1, 1.7])
def test_growing_hits_both_ends_with_smooth_steps(n: int, growth: float) -> None:
    for length in np.linspace(1.0, 40.0, 25):
        x = growing(0.0, length, 1.0 / n, growth=growth)
        steps = np.diff(x)
        assert (x[0], x[-1]) == (0.0, length) and np.all(steps > 0)
        # The steps are stretched to fit by less than half of the last one over the whole.
        ratio = steps[1:] / steps[:-1]
        assert ratio.min() > 0.6 and ratio.max() < 2 * growth
