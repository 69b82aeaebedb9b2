"""Tables and fields on disk: right numbers, whole files, on any number of ranks."""

from __future__ import annotations

import base64
import csv
import json
import xml.etree.ElementTree as ET
import zlib
from pathlib import Path
from typing import Any

import fxcrack as fx  # before DOLFINx

# isort: split
import dolfinx.mesh
import numpy as np
import pytest
from mpi4py import MPI

from fxcrack.base import compat
from fxcrack.base.parallel import all_or_none
from fxcrack.mesh import mesh_from_domain
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.output import fields
from fxcrack.output.fields import FieldSeries, displacement_function, write_fields
from fxcrack.output.interface_fields import interface_fields

STEEL = fx.Isotropic(E=70e3, nu=0.3)
ROUND_OFF = 1e-10  # of the largest value: what factorisation and back-solve leave over

# mesh, model: matching and not, both orders, plane and solid
MESHES: dict[str, Any] = {
    "2d": lambda: (dcb_2d(length=20.0, dx=1.0, ny=2), fx.PlaneStrain(thickness=2.0)),
    "2d quadratic": lambda: (dcb_2d(length=20.0, dx=1.0, ny=1, order=2), fx.PlaneStress()),
    "2d not matching": lambda: (dcb_2d(length=20.0, dx=1.0, ny=2, nx_lower=13), fx.PlaneStrain()),
    "3d": lambda: (dcb_3d(length=20.0, width=4.0, dx=1.0, dy=1.0, ny=1), fx.Solid()),
    "3d quadratic": lambda: (
        dcb_3d(length=20.0, width=2.0, dx=1.0, dy=1.0, ny=1, order=2),
        fx.Solid(),
    ),
}


def cracked(kind: str = "2d", until: float = 11.0, **release: Any) -> fx.Scene:
    """A small double cantilever beam whose crack has grown from 8."""
    mesh, model = MESHES[kind]()
    z = 0.0 if mesh.gdim == 3 else None
    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 8.0 - 1e-9, name="bond")
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=model,
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0, z=z),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0, z=z),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2), **release)],
    )
    scene.run(fx.Static(until=fx.CrackLength(bond, until)))
    return scene


def array_of(element: ET.Element) -> np.ndarray[Any, Any]:
    """What a binary, compressed VTK array holds."""
    kind = {"Float64": "<f8", "Int64": "<i8", "Int32": "<i4", "UInt8": "u1"}[element.get("type")]
    text = (element.text or "").strip()
    head = np.frombuffer(base64.b64decode(text[:44]), "<u8")  # four numbers
    raw = zlib.decompress(base64.b64decode(text[44:])) if len(head) == 4 else b""
    assert len(raw) == (head[1] if len(head) == 4 else 0)
    width = int(element.get("NumberOfComponents", "1"))
    out = np.frombuffer(raw, kind)
    return out.reshape(-1, width) if width > 1 else out


def read_vtu(path: Path) -> dict[str, Any]:
    """Arrays of a .vtu file by name, with "cells" and "names" of the stress components."""
    root = ET.parse(path).getroot()
    piece = root.find("UnstructuredGrid/Piece")
    found: dict[str, Any] = {e.get("Name"): array_of(e) for e in piece.iter("DataArray")}
    assert len(found["Points"]) == int(piece.get("NumberOfPoints"))
    assert len(found["types"]) == int(piece.get("NumberOfCells"))
    for element in piece.iter("DataArray"):
        if element.get("Name") == "stress":
            keys = sorted(k for k in element.keys() if k.startswith("ComponentName"))
            found["names"] = [element.get(k) for k in keys]
    return found


def read_bodies(pvd: Path) -> list[tuple[float, list[dict[str, Any]]]]:
    """Time and pieces of every step of a series."""
    out = []
    for step in ET.parse(pvd).getroot().iter("DataSet"):
        file = pvd.parent / step.get("file")
        pieces = [file]
        if file.suffix == ".pvtu":
            header = ET.parse(file).getroot()
            pieces = [file.parent / e.get("Source") for e in header.iter("Piece")]
            names = [e.get("Name") for e in header.iter("PDataArray")]
            assert set(names) <= set(read_vtu(pieces[0]))
        out.append((float(step.get("timestep")), [read_vtu(p) for p in pieces]))
    return out


# -- what the fields hold --------------------------------------------------------------------------


@pytest.mark.quick("2d")
@pytest.mark.mpi
@pytest.mark.parametrize("kind", MESHES)
def test_jumps_and_tractions_agree_with_the_retained_ones(kind: str) -> None:
    scene = cracked(kind)
    model, pair = scene.solver, scene.pairs[0]
    (found,) = interface_fields(scene, displacement_function(scene))
    inside = (model.index[0] >= 0).all(axis=1)
    assert inside.sum() > 3
    nodes = np.arange(pair.surface.n_nodes)
    jump = model.vectors(0, nodes, model.state.jump)
    largest = np.abs(found.opening).max()
    np.testing.assert_allclose(found.opening[inside], jump[inside], atol=ROUND_OFF * largest)
    force = -model.system.forces(model.state, np.arange(model.system.n_retained))
    traction = model.vectors(0, nodes, force) / pair.surface.areas[:, None]
    largest = np.abs(found.traction).max()
    np.testing.assert_allclose(found.traction[inside], traction[inside], atol=ROUND_OFF * largest)
    # outside the retained set as well: bonded nodes do not part, all bonds together carry the load
    bonded = found.state == 1
    assert np.abs(found.opening[bonded]).max() < ROUND_OFF * np.abs(found.opening).max()
    total = (found.traction * pair.surface.areas[:, None]).sum(axis=0)
    row = scene.history.rows[-1]
    sign = -1.0 if pair.exchanged else 1.0  # forces on the side that is the slave
    assert sign * total[1] == pytest.approx(row["R[pin_top.y]"], rel=1e-8)
    scene.close()


@pytest.mark.mpi
def test_state_front_and_rates_at_the_nodes() -> None:
    scene = cracked()
    (found,) = interface_fields(scene, displacement_function(scene))
    x, row = scene.pairs[0].surface.x[:, 0], scene.history.rows[-1]
    np.testing.assert_array_equal(found.state, x >= 11.0 - 1e-9)
    np.testing.assert_array_equal(x[found.front == 1], x[row["node[bond]"]])
    front = found.front == 1
    for name in ("f", "GI", "GII"):
        assert found.at_front[name][front] == pytest.approx(row[f"{name}[bond]"], abs=1e-12)
        assert not found.at_front[name][~front].any()
    assert found.at_front["G"][front] == pytest.approx(row["GI[bond]"] + row["GII[bond]"])
    times = [t for _, t in scene.cracks[0].released]
    order = np.argsort(x)
    assert not found.release_time[order][:8].any()
    np.testing.assert_array_equal(found.release_time[order][8:11], times)
    assert np.isnan(found.release_time[order][11:]).all()
    normal = np.einsum("nc,nc->n", found.normal, found.opening)
    assert normal[order][0] == pytest.approx(2.0 * row["u[pin_top.y]"], rel=1e-2)
    scene.close()


@pytest.mark.mpi
def test_bonds_that_let_go_still_pull() -> None:
    scene = cracked(release=fx.ProgressiveRelease())
    (found,) = interface_fields(scene, displacement_function(scene))
    force_ramps = found.state == 0.5
    assert force_ramps.any()
    nodes = {k for bond in scene.solver.system.soft.bonds for k in bond.where[1].tolist()}
    np.testing.assert_array_equal(np.flatnonzero(force_ramps), sorted(nodes))
    assert (np.einsum("nc,nc->n", found.traction, found.normal)[force_ramps] > 0.0).all()
    assert not found.front[force_ramps].any()
    total = (found.traction * scene.pairs[0].surface.areas[:, None]).sum(axis=0)
    assert total[1] == pytest.approx(scene.history.rows[-1]["R[pin_top.y]"], rel=1e-8)
    scene.close()


def junction(comm: MPI.Comm) -> fx.Mesh:
    """Unit squares: one on the left of the second and below the third, none sharing nodes."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    x = np.concatenate([corners + np.array(shift) for shift in ([0, 0], [1, 0], [0, 1])])
    cells = np.arange(12).reshape(3, 4)
    mine = slice(None) if comm.rank == 0 else slice(0, 0)
    domain = compat.create_mesh(
        comm, cells[mine], x[mine], compat.coordinate_element("quadrilateral", 1, 2)
    )
    # the cells that hold a facet tell coincident facets apart
    domain.topology.create_entities(1)
    domain.topology.create_connectivity(1, 2)
    domain.topology.create_connectivity(2, 1)
    centre = domain.geometry.x[compat.geometry_dofmap(domain)].mean(axis=1)
    facets = np.arange(domain.topology.index_map(1).size_local, dtype=np.int32)
    middle = dolfinx.mesh.compute_midpoints(domain, 1, facets)
    cell = np.array([domain.topology.connectivity(1, 2).links(f)[0] for f in facets], dtype=int)
    of = centre[cell] if len(cell) else np.zeros((0, 3))

    def where(body: tuple[float, float], at: tuple[float, float]) -> np.ndarray[Any, Any]:
        return np.flatnonzero(
            np.isclose(of[:, :2], body).all(axis=1) & np.isclose(middle[:, :2], at).all(axis=1)
        )

    return mesh_from_domain(
        domain,
        {
            "right": (1, where((0.5, 0.5), (1.0, 0.5))),
            "left": (1, where((1.5, 0.5), (1.0, 0.5))),
            "wall": (1, where((1.5, 0.5), (2.0, 0.5))),
            "above": (1, where((0.5, 0.5), (0.5, 1.0))),
            "below": (1, where((0.5, 1.5), (0.5, 1.0))),
            "top": (1, where((0.5, 1.5), (0.5, 2.0))),
        },
    )


@pytest.mark.mpi
def test_a_slave_that_carries_another_passes_its_force_on(comm: MPI.Comm) -> None:
    # the corner of the first square is a slave of the second and a master of the third
    carries = fx.Interface("right", "left", name="carries")
    rests = fx.Interface("below", "above", name="rests")
    scene = fx.Scene(
        junction(comm),
        materials=STEEL,
        model=fx.PlaneStress(thickness=3.0),
        supports=[fx.Displacement("wall", x=0.0, y=0.0)],
        loads=[fx.Traction("top", (1.0, 2.0))],
        bonds=[carries, rests],
    )
    scene.run(fx.Static(until=fx.Time(1.0)))
    for pair, found in zip(
        scene.pairs, interface_fields(scene, displacement_function(scene)), strict=True
    ):
        total = (found.traction * pair.surface.areas[:, None]).sum(axis=0)
        # on the slave side the bond pulls against the load: tension positive means along the load
        np.testing.assert_allclose(total, [3.0, 6.0, 0.0], atol=1e-9 * 6.0)
    scene.close()


@pytest.mark.mpi
def test_loads_and_supports_on_the_faces_are_no_bond_forces() -> None:
    mesh = dcb_2d(length=20.0, dx=1.0, ny=2)
    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 8.0 - 1e-9)
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("end_upper", x=0.0),  # holds an open slave node
            fx.Displacement("far_lower", x=0.0, y=0.0),
        ],
        loads=[fx.Pressure("upper_face", 3.0), fx.Pressure("lower_face", 3.0)],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1e9))],
    )
    scene.run(fx.Static(until=fx.Time(1.0)))
    (found,) = interface_fields(scene, displacement_function(scene))
    open_nodes = found.state == 0
    largest = np.abs(found.traction).max()
    assert np.abs(found.traction[open_nodes]).max() < ROUND_OFF * largest
    # nothing else holds the upper arm down against the pressure on its whole length
    total = (found.traction * scene.pairs[0].surface.areas[:, None]).sum(axis=0)
    assert total[1] == pytest.approx(3.0 * 20.0, rel=1e-8)
    scene.close()


def test_fields_need_a_state() -> None:
    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 8.0)
    scene = fx.Scene(
        dcb_2d(length=20.0, dx=1.0, ny=1),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("pin_top", y=1.0)],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2))],
    )
    with pytest.raises(fx.InputError, match="run a step before"):
        displacement_function(scene)


# -- files -----------------------------------------------------------------------------------------


@pytest.mark.smoke
@pytest.mark.three
@pytest.mark.quick("2d", "3d")
@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["2d", "2d quadratic", "3d", "3d quadratic"])
def test_files_hold_the_fields(kind: str, comm: MPI.Comm, shared_path: Path) -> None:
    scene = cracked(kind)
    u = displacement_function(scene)
    (surface,) = interface_fields(scene, u)
    write_fields(scene, shared_path / "out" / "fields.pvd")
    ((time, pieces),) = read_bodies(shared_path / "out" / "fields.pvd")
    assert time == scene.time
    assert len(pieces) == comm.size
    domain, tdim = scene.mesh.domain, scene.mesh.tdim
    assert sum(len(p["types"]) for p in pieces) == domain.topology.index_map(tdim).size_global
    mine = pieces[comm.rank]
    # every point this rank owns, with its displacement
    n_owned = scene.continuum.n_local // scene.continuum.gdim
    x = scene.continuum.positions()[:n_owned]
    moved = np.zeros_like(x)
    moved[:, : scene.mesh.gdim] = u.x.array.reshape(-1, scene.mesh.gdim)[:n_owned]
    # faces lie on each other, so a point is found by its place and its displacement
    wanted, there = np.hstack([x, moved]), np.hstack([mine["Points"], mine["displacement"]])
    if n_owned:
        distance = np.abs(wanted[:, None] - there[None]).max(axis=2).min(axis=1)
        assert distance.max() < 1e-12  # two back-solves differ by round-off on several ranks
    labels = mine["names"]
    assert sorted(labels) == sorted(scene.continuum.model.stress_labels)
    if len(labels) == 6:  # as VTK takes a symmetric tensor
        assert labels == ["xx", "yy", "zz", "xy", "yz", "xz"]
    assert mine["stress"].shape == (len(mine["types"]), len(labels))
    assert mine["von_mises"].shape == (len(mine["types"]),)

    ((_, (bond,)),) = read_bodies(shared_path / "out" / "fields_bond.pvd")
    pair = scene.pairs[0]
    np.testing.assert_array_equal(bond["Points"], pair.surface.x)
    np.testing.assert_array_equal(bond["offsets"][-1], pair.surface.facets.size)
    np.testing.assert_array_equal(bond["bond_state"], surface.state)
    np.testing.assert_array_equal(bond["front"], surface.front)
    for name in ("opening", "displacement"):
        np.testing.assert_allclose(bond[name], getattr(surface, name), atol=1e-12)
    np.testing.assert_allclose(bond["bond_traction"], surface.traction, atol=1e-8)
    np.testing.assert_array_equal(bond["release_time"], surface.release_time)
    np.testing.assert_allclose(bond["GI"], surface.at_front["GI"], rtol=1e-12)
    scene.close()


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("model", [fx.PlaneStress(), fx.PlaneStrain()])
def test_uniform_tension_is_found_in_the_file(
    model: fx.PlaneStress | fx.PlaneStrain, comm: MPI.Comm, shared_path: Path
) -> None:
    scene = fx.Scene(
        dcb_2d(length=20.0, dx=1.0, ny=2),
        materials=STEEL,
        model=model,
        supports=[fx.Displacement("bottom", y=0.0), fx.Displacement("pin_bottom", x=0.0)],
        loads=[fx.Traction("top", (0.0, 5.0))],
        bonds=[fx.Interface("upper_face", "lower_face", name="glue line 1/2")],
    )
    scene.run(fx.Static(until=fx.Time(1.0)))
    write_fields(scene, shared_path / "a.pvd", time=7.0)
    ((time, pieces),) = read_bodies(shared_path / "a.pvd")
    assert time == 7.0
    # plane strain holds the thickness with nu times the tension
    out_of_plane = 0.3 * 5.0 if isinstance(model, fx.PlaneStrain) else 0.0
    equivalent = np.sqrt(5.0**2 - 5.0 * out_of_plane + out_of_plane**2)
    for piece in pieces:
        assert piece["names"] == ["xx", "yy", "zz", "xy"]
        wanted = np.broadcast_to([0.0, 5.0, out_of_plane, 0.0], piece["stress"].shape)
        np.testing.assert_allclose(piece["stress"], wanted, atol=1e-8)
        np.testing.assert_allclose(piece["von_mises"], equivalent, rtol=1e-9)
    ((_, (bond,)),) = read_bodies(shared_path / "a_glue_line_1_2.pvd")
    np.testing.assert_allclose(bond["bond_traction"][:, 1], 5.0, rtol=1e-9)
    scene.close()


@pytest.mark.slow
@pytest.mark.mpi
def test_series_as_an_observer(comm: MPI.Comm, shared_path: Path) -> None:
    scene = cracked()
    path = shared_path / "fields.pvd"
    with FieldSeries(scene, path, events=("release",), every=2) as series:
        for i, event in enumerate(["start", "release", "onset", "release", "release", "end"]):
            series(event, {"time": float(i), "event": event})
    assert [t for t, _ in read_bodies(path)] == [1.0, 4.0]
    assert [t for t, _ in read_bodies(shared_path / "fields_bond.pvd")] == [1.0, 4.0]
    comm.Barrier()
    # a shorter series of the same name leaves nothing of the first behind, and no foreign file out
    if comm.rank == 0:
        (shared_path / "fields" / "notes.vtu").write_text("mine")
    comm.Barrier()
    with FieldSeries(scene, path) as series:
        series.write(2.5)
    assert [t for t, _ in read_bodies(path)] == [2.5]
    names = {p.name for p in (shared_path / "fields").iterdir()}
    assert "notes.vtu" in names
    assert not any("00001" in name for name in names)
    with pytest.raises(fx.InputError, match=r"\.pvd"):
        FieldSeries(scene, "fields.vtu")
    with pytest.raises(fx.InputError, match="every = 0"):
        FieldSeries(scene, path, every=0)
    scene.close()


@pytest.mark.mpi
def test_series_follows_a_run(shared_path: Path) -> None:
    scene = cracked()
    (bond,) = (d.interface for d in scene.debonds)
    with FieldSeries(scene, shared_path / "run.pvd", events=("release",)) as series:
        history = scene.run(fx.Static(until=fx.CrackLength(bond, 13.0)), observers=[series])
    steps = read_bodies(shared_path / "run_bond.pvd")
    rows = [r for r in history if r["event"] == "release" and r["released[bond]"] > 3]
    assert [time for time, _ in steps] == [r["time"] for r in rows]
    for (_, (surface,)), row in zip(steps, rows, strict=True):
        assert np.count_nonzero(surface["bond_state"] == 0.0) == 8 + row["released[bond]"]
        assert surface["GI"].max() == pytest.approx(row["GI[bond]"])
    scene.close()


@pytest.mark.quick("write_grid")
@pytest.mark.mpi
@pytest.mark.parametrize("broken", ["write_grid", "write_series"])
def test_a_failed_write_leaves_the_old_files(
    broken: str, comm: MPI.Comm, shared_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = cracked()
    path = shared_path / "fields.pvd"
    write_fields(scene, path, time=1.0)
    before = {p: p.read_bytes() for p in shared_path.rglob("*.pvd")}
    comm.Barrier()

    def fail(*_: object) -> None:
        raise OSError("no space left on device")

    # grids are written by every rank: let the last one fail alone; series by rank 0
    if comm.rank == (comm.size - 1 if broken == "write_grid" else 0):
        monkeypatch.setattr(fields, broken, fail)
    with pytest.raises(fx.FxcrackError, match=r"fields\.pvd.*no space left"):
        write_fields(scene, path, time=2.0)
    comm.Barrier()
    assert {p: p.read_bytes() for p in shared_path.rglob("*.pvd")} == before
    assert [t for t, _ in read_bodies(path)] == [1.0]
    assert not [p for p in shared_path.iterdir() if p.name.startswith(".")]
    scene.close()


@pytest.mark.mpi
def test_all_ranks_fail_together(comm: MPI.Comm) -> None:
    with pytest.raises(fx.FxcrackError, match=r"counting: KeyError") as caught:
        with all_or_none(comm, "counting"):
            if comm.rank == comm.size - 1:
                raise KeyError("three")
    mine = isinstance(caught.value.__cause__, KeyError)
    assert mine == (comm.rank == comm.size - 1)
    with all_or_none(comm, "counting"):
        pass


# -- tables ----------------------------------------------------------------------------------------


@pytest.mark.mpi
def test_history_as_csv_and_json(comm: MPI.Comm, shared_path: Path) -> None:
    history = fx.History(comm)
    history.append({"time": 0.0, "event": "start"})
    history.append({"time": 0.1, "event": "release", "f[bond]": 1.0})
    history.reason = "enough"
    history.details = {"ranks": comm.size}
    history.to_csv(shared_path / "new" / "h.csv")
    history.to_json(shared_path / "new" / "h.json")
    with (shared_path / "new" / "h.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows[0] == {"time": "0.0", "event": "start", "f[bond]": ""}
    assert [float(r["time"]) for r in rows] == [0.0, 0.1]
    content = json.loads((shared_path / "new" / "h.json").read_text())
    assert content["rows"] == history.rows
    assert content["reason"] == "enough"
    assert content["details"] == {"ranks": comm.size}
    np.testing.assert_array_equal(history["f[bond]"], [np.nan, 1.0])
    with pytest.raises(fx.InputError, match="no column 'g'"):
        history["g"]
    assert history[1:] == history.rows[1:]
    with pytest.raises(fx.InputError, match="column = None must be a name"):
        history[None]  # type: ignore[call-overload]
