"""Plots: the right data are drawn, and a picture comes out on any number of ranks."""

from __future__ import annotations

import struct
from pathlib import Path

import fxcrack as fx  # before DOLFINx

# isort: split
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from mpi4py import MPI

from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.output import plots
from fxcrack.output.plots import style as looks
from fxcrack.output.plots.deformed import Shape, automatic_scale, shape, view_axes
from fxcrack.output.plots.front_advance import release_map

STEEL = fx.Isotropic(E=70e3, nu=0.3)


def scene_of(mesh: fx.Mesh, model: fx.PlaneStrain | fx.Solid) -> fx.Scene:
    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 8.0 - 1e-9, name="bond")
    z = 0.0 if mesh.gdim == 3 else None
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=model,
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0, z=z),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0, z=z),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2))],
    )
    scene.run(fx.Static(until=fx.CrackLength(bond, 11.0)))
    return scene


def plane(order: int = 1) -> fx.Scene:
    return scene_of(dcb_2d(length=20.0, dx=1.0, ny=2, order=order), fx.PlaneStrain())


def solid(cell: str = "hexahedron", order: int = 1) -> fx.Scene:
    mesh = dcb_3d(length=20.0, width=4.0, dx=1.0, dy=1.0, ny=1, cell=cell, order=order)
    return scene_of(mesh, fx.Solid())


def made_up(comm: MPI.Comm) -> fx.History:
    """Loading, two releases at one load, loading, a release."""
    history = fx.History(comm)
    rows = [
        # event, time, released, a, GI, GII
        ("start", 0.0, 0, 5.0, 0.0, 0.0),
        ("onset", 1.0, 0, 5.0, 0.20, 0.10),
        ("release", 1.0, 1, 6.0, 0.25, 0.10),
        ("onset", 1.0, 1, 6.0, 0.25, 0.10),
        ("release", 1.0, 2, 7.0, 0.15, 0.10),
        ("onset", 1.5, 2, 7.0, 0.20, 0.12),
        ("release", 1.5, 3, 8.0, 0.12, 0.10),
        ("end", 1.5, 3, 8.0, 0.12, 0.10),
    ]
    for event, time, released, a, g1, g2 in rows:
        history.append(
            {
                "time": time,
                "event": event,
                "R[held.x]": 0.1,
                "u[pin.y]": -2.0 * time,
                "R[pin.y]": -30.0 * time,
                "a[bond]": a,
                "released[bond]": released,
                "f[bond]": 5.0 * g1,
                "GI[bond]": g1,
                "GII[bond]": g2,
                "GIII[bond]": 0.0,
            }
        )
    return history


def size_of(path: Path) -> tuple[int, int]:
    """Width and height of a PNG file in pixels."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert len(data) > 5000  # something is drawn
    width, height = struct.unpack(">II", data[16:24])
    return width, height


# -- curves ----------------------------------------------------------------------------------------


def test_load_curve_takes_the_first_displacement_that_moves(comm: MPI.Comm) -> None:
    curve = plots.load_curve(made_up(comm))
    np.testing.assert_allclose(curve.x, 2.0 * np.array([0, 1, 1, 1, 1, 1.5, 1.5, 1.5]))
    np.testing.assert_allclose(curve.y, 15.0 * curve.x)
    assert (curve.xlabel, curve.ylabel) == ("Displacement pin.y", "Reaction pin.y")
    assert curve.onset == 1


def test_load_curve_takes_what_it_is_given(comm: MPI.Comm) -> None:
    history = made_up(comm)
    curve = plots.load_curve(history, x="a[bond]", y=2.0 * history["u[pin.y]"])
    np.testing.assert_array_equal(curve.x, history["a[bond]"])
    np.testing.assert_array_equal(curve.y, 2.0 * history["u[pin.y]"])
    assert (curve.xlabel, curve.ylabel) == ("a[bond]", "")
    with pytest.raises(fx.InputError, match="no column 'b'"):
        plots.load_curve(history, x="b")
    with pytest.raises(fx.InputError, match=r"shape \(3,\).*8 rows"):
        plots.load_curve(history, y=np.zeros(3))


def test_load_curve_falls_back_on_loads(comm: MPI.Comm) -> None:
    history = fx.History(comm)
    with pytest.raises(fx.InputError, match="no displacement or load"):
        plots.load_curve(history)
    history.append({"time": 0.0, "event": "start", "F[tip]": 0.0, "v[tip]": 0.0})
    history.append({"time": 1.0, "event": "end", "F[tip]": 4.0, "v[tip]": -0.5})
    curve = plots.load_curve(history)
    np.testing.assert_array_equal(curve.x, [0.0, 0.5])
    np.testing.assert_array_equal(curve.y, [0.0, 4.0])
    assert curve.onset is None


def test_resistance_is_the_state_before_each_release(comm: MPI.Comm) -> None:
    history = made_up(comm)
    np.testing.assert_array_equal(plots.growth_rows(history), [1, 3, 5])
    data = plots.resistance(history, "bond")
    np.testing.assert_array_equal(data.length, [5.0, 6.0, 7.0])
    np.testing.assert_array_equal(data.rates, [[0.2, 0.1, 0], [0.25, 0.1, 0], [0.2, 0.12, 0]])
    np.testing.assert_array_equal(data.f, [1.0, 1.25, 1.0])
    np.testing.assert_array_equal(data.onset, [True, False, True])
    with pytest.raises(fx.InputError, match="'glue'; known: bond"):
        plots.resistance(history, "glue")


def test_r_curve_of_a_criterion_without_rates(comm: MPI.Comm, tmp_path: Path) -> None:
    history = fx.History(comm)
    for released in (0, 1):
        row = {"time": 1.0, "event": "onset", "a[b]": 1.0, "f[b]": 1.0, "released[b]": released}
        history.append(row)
    plots.r_curve(history, tmp_path / "f.png", "b", quantity="f")
    with pytest.raises(fx.InputError, match="no energy release rates"):
        plots.r_curve(history, tmp_path / "g.png", "b")
    with pytest.raises(fx.InputError, match="quantity = 'J'"):
        plots.r_curve(history, tmp_path / "g.png", "b", quantity="J")


def test_curves_hold_the_data(
    comm: MPI.Comm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    history = made_up(comm)
    history.plot(tmp_path / "p.png", reference=[("theory", [0.0, 1.0], [0.0, 9.0])], xlabel="mm")
    plots.r_curve(history, tmp_path / "r.png", "bond", lambda a: 0.01 * a)
    lines = [
        {line.get_label(): line.get_xydata() for line in figure.axes[0].get_lines()}
        for figure in drawn
    ]
    curve = plots.load_curve(history)
    np.testing.assert_array_equal(lines[0]["computed"], np.column_stack([curve.x, curve.y]))
    np.testing.assert_array_equal(lines[0]["theory"], [[0.0, 0.0], [1.0, 9.0]])
    assert drawn[0].axes[0].get_xlabel() == "mm"
    np.testing.assert_allclose(lines[1]["$G$"], [[5.0, 0.3], [7.0, 0.32]])
    np.testing.assert_allclose(lines[1]["$G_\\mathrm{II}$"], [[5.0, 0.1], [7.0, 0.12]])
    np.testing.assert_allclose(lines[1]["toughness"], [[5.0, 0.05], [6.0, 0.06], [7.0, 0.07]])
    assert "$G_\\mathrm{III}$" not in lines[1]


# -- front advance ---------------------------------------------------------------------------------


def triangle_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b = points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]]
    b = b - points[triangles[:, 0]]
    return 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


@pytest.mark.quick("hexahedron-1")
@pytest.mark.mpi
@pytest.mark.parametrize(("cell", "order"), [("hexahedron", 1), ("hexahedron", 2)])
def test_release_map_has_the_crack_area_of_the_history(cell: str, order: int) -> None:
    scene = solid(cell, order)
    data = release_map(scene, "bond")
    assert data.axes == ("x", "z")
    opened, areas = data.opened(), triangle_areas(data.points, data.triangles)
    assert areas.sum() == pytest.approx(20.0 * 4.0)
    assert areas[opened == 0.0].sum() == pytest.approx(8.0 * 4.0)
    # straight fronts: it ends with a row complete
    row = scene.history.rows[-1]
    assert areas[np.isfinite(opened)].sum() == pytest.approx(row["area[bond]"])
    assert len(data.times) == scene.cracks[0].n_released + 1
    assert np.all(np.diff(data.times) >= 0.0)
    with pytest.raises(fx.InputError, match="no interface 'glue'; known: bond"):
        release_map(scene, "glue")
    scene.close()


def test_a_facet_cut_by_the_front_is_half_open() -> None:
    scene = solid("tetrahedron")
    pair = scene.pairs[0]
    chosen = int(np.flatnonzero(pair.bonded[pair.surface.facets].all(axis=1))[0])
    node = int(pair.surface.facets[chosen, 0])
    data = release_map(scene, "bond", released=[(node, 2.0)])
    here = data.triangles[:, 2] == pair.surface.n_nodes + chosen  # around its centre
    areas = triangle_areas(data.points, data.triangles)
    np.testing.assert_array_equal(np.sort(data.opened()[here]), [1.0, 1.0, np.inf])
    assert areas[here].sum() == pytest.approx(0.5 * 1.0 * 1.0)
    np.testing.assert_array_equal(data.times, [0.0, 2.0])
    scene.close()


def test_front_advance_needs_a_surface() -> None:
    scene = plane()
    with pytest.raises(fx.InputError, match="is a line"):
        plots.front_advance(scene, "front.png", "bond")
    with pytest.raises(fx.InputError, match="colour = 'load'"):
        plots.front_advance(scene, "front.png", "bond", colour="load")
    scene.close()


# -- deformed mesh ---------------------------------------------------------------------------------


@pytest.mark.quick("1")
@pytest.mark.mpi
@pytest.mark.parametrize("order", [1, 2])
def test_shape_of_a_plane_body_is_its_cells(comm: MPI.Comm, order: int) -> None:
    scene = plane(order)
    data = shape(scene)
    if comm.rank == 0:
        assert data.faces.shape == (20 * 4, 4 * order, 3)
        x, y = data.faces[..., 0], data.faces[..., 1]
        # the outline goes round without crossing itself: the shoelace formula gives the area
        area = 0.5 * np.abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1))
        np.testing.assert_allclose(area, 0.75)
        edges = np.linalg.norm(np.diff(data.border, axis=1), axis=2).sum()
        assert edges == pytest.approx(2 * 2 * (20.0 + 1.5))
        top = np.all(np.isclose(data.faces, [0.0, 1.5, 0.0], atol=1e-9), axis=2)
        moved = scene.history.rows[-1]["u[pin_top.y]"]
        np.testing.assert_allclose(data.motion[top], [[0.0, moved, 0.0]], atol=1e-12)
        assert (data.values > 0.0).all()
    scene.close()


@pytest.mark.quick("hexahedron-1")
@pytest.mark.mpi
@pytest.mark.parametrize(("cell", "order"), [("tetrahedron", 1), ("hexahedron", 1)])
def test_shape_of_a_solid_is_its_skin(comm: MPI.Comm, cell: str, order: int) -> None:
    scene = solid(cell, order)
    data = shape(scene, "xx")
    if comm.rank == 0:
        sides = 3 if cell == "tetrahedron" else 4
        assert data.faces.shape[1:] == (sides * order, 3)
        # a fan of triangles around the first corner
        a = data.faces[:, 1:-1] - data.faces[:, :1]
        b = data.faces[:, 2:] - data.faces[:, :1]
        normal = np.cross(a, b).sum(axis=1)
        skin = 2 * 2 * (20.0 * 4.0 + 20.0 * 1.5 + 4.0 * 1.5)
        assert 0.5 * np.linalg.norm(normal, axis=1).sum() == pytest.approx(skin)
        assert data.values.min() < 0.0 < data.values.max()
    with pytest.raises(fx.InputError, match=r"no stress component 'rr'; known: von_mises, xx"):
        shape(scene, "rr")
    scene.close()


@given(st.floats(1e-12, 1e3), st.floats(1e-3, 1e6))
def test_automatic_scale_is_round_and_shows_a_tenth(largest: float, size: float) -> None:
    face = np.array([[[0.0, 0.0, 0.0], [size, 0.0, 0.0], [0.0, 0.1 * size, 0.0]]])
    motion = np.zeros_like(face)
    motion[0, 0, 1] = -largest
    none = np.zeros((0, 2, 3))
    scale = automatic_scale(Shape(face, motion, np.zeros(1), face[:, 0], none))
    assert scale >= 1.0
    assert f"{scale:.0e}"[0] in "125"
    shown = scale * largest / size
    # steps 1, 2, 5: at most a factor 2.5 below the tenth
    assert shown <= 0.1001 or scale == 1.0
    assert shown >= 0.1 / 2.51
    still = Shape(face, 0.0 * motion, np.zeros(1), face[:, 0], none)
    assert automatic_scale(still) == 1.0


@given(st.floats(-80.0, 80.0), st.floats(-80.0, 80.0))
def test_view_axes_are_a_frame_with_up_upright(azimuth: float, elevation: float) -> None:
    along, up = np.eye(3)[:2]
    axes = view_axes(up, along, azimuth, elevation)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[0] @ up == pytest.approx(0.0, abs=1e-12)
    assert axes[1] @ up > 0.0
    np.testing.assert_allclose(view_axes(up, along, 0.0, 0.0), np.eye(3), atol=1e-12)


# -- files -----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.mpi
def test_pictures_come_out_on_all_ranks(comm: MPI.Comm, shared_path: Path) -> None:
    flat, thick = plane(), solid()
    out = shared_path / "pictures"
    flat.history.plot(out / "load.png", title="Load")
    plots.r_curve(flat.history, out / "r.png", flat.debonds[0].interface, 0.2)
    plots.deformed(flat, out / "flat.png")
    plots.deformed(thick, out / "thick.png", component="xx", scale=3.0)
    plots.front_advance(thick, out / "front.png", "bond", colour="time")
    flat.history.plot(out / "load.svg")
    for name in ("load", "r"):
        assert size_of(out / f"{name}.png") == (int(6.4 * looks.DPI), int(4.2 * looks.DPI))
    assert size_of(out / "flat.png")[0] == size_of(out / "thick.png")[0] == 9 * looks.DPI
    assert size_of(out / "front.png")[0] == 8 * looks.DPI
    assert (out / "load.svg").read_text().startswith("<?xml")
    assert len(list(out.iterdir())) == 6  # no temporary file is left
    flat.close()
    thick.close()


@pytest.mark.mpi
def test_a_failed_plot_leaves_the_old_picture(comm: MPI.Comm, shared_path: Path) -> None:
    history = made_up(comm)
    path = shared_path / "load.png"
    history.plot(path)
    before = path.read_bytes()
    comm.Barrier()
    with pytest.raises(fx.FxcrackError, match=r"plotting .*load\.png"):
        history.plot(path, reference=[("theory", [0.0, 1.0], [0.0])])
    with pytest.raises(fx.FxcrackError, match="plotting"):
        history.plot(shared_path / "load.picture")
    comm.Barrier()
    assert path.read_bytes() == before
    assert [p.name for p in shared_path.iterdir()] == ["load.png"]
