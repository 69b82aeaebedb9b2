"""Shells: what may be given, on which side the top is, and messages for what cannot be."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.shell_stress import shell_stress
from fxcrack.mesh import mesh_from_gmsh
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import RawMesh
from fxcrack.meshes.dcb import dcb_3d
from fxcrack.meshes.sheets import Sheet, sheets

ALLOY = fx.Isotropic(70e3, 0.3, density=2.7e-9)
PLATE = fx.Section(ALLOY, thickness=2.0)


def plate(comm: MPI.Intracomm, order: int = 1, **more: Any) -> fx.Mesh:
    x = np.linspace(0.0, 4.0, 5)
    return sheets([Sheet("plate", x, x, **more)], comm, order=order)


def scene(mesh: fx.Mesh, **options: Any) -> fx.Scene:
    given: dict[str, Any] = {"model": fx.Shell(), "materials": PLATE}
    return fx.Scene(mesh, **{**given, "supports": [fx.Clamp("plate_a0")], **options})


@pytest.mark.mpi
def test_cells_that_alternate_get_one_top(comm: MPI.Intracomm) -> None:
    """Every second cell turns the other way; directors follow the first cell, or ``up``."""

    x, y = (a.ravel() for a in np.meshgrid(np.arange(5.0), np.arange(5.0)))
    first = (5 * np.arange(4)[:, None] + np.arange(4)).ravel()
    cells = first[:, None] + np.array([0, 1, 5, 6])
    cells[1::2] = cells[1::2][:, [0, 2, 1, 3]]  # seen clockwise from above
    raw = RawMesh("quadrilateral", 1, np.stack([x, y, 0.0 * x], axis=1), cells)
    mesh = distribute(raw if comm.rank == 0 else None, comm, "plate")

    def made(up: tuple[float, float, float] | None) -> ShellBodies:
        return ShellBodies(mesh, fx.Section(ALLOY, thickness=1.0, up=up), fx.Shell())

    assert made(None).directors[:, 2].min(initial=1.0) > 0.999
    assert made((0.0, 0.1, -1.0)).directors[:, 2].max(initial=-1.0) < -0.999


@pytest.mark.mpi
def test_gmsh_surface_in_space(comm: MPI.Intracomm) -> None:
    """A half cylinder of two gmsh surfaces, one of which runs the other way round."""
    model = None
    if comm.rank == 0:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        model = gmsh.model
        model.add("pipe")
        occ = model.occ
        c, s = np.cos(np.pi / 4), np.sin(np.pi / 4)
        p = [occ.addPoint(*q) for q in ((1, 0, 0), (c, s, 0), (0, 1, 0), (0, 0, 0))]
        q = [occ.addPoint(*r) for r in ((1, 0, 2), (c, s, 2), (0, 1, 2), (0, 0, 2))]
        arcs = [occ.addCircleArc(p[k], p[3], p[k + 1]) for k in (0, 1)]
        over = [occ.addCircleArc(q[k], q[3], q[k + 1]) for k in (0, 1)]
        up = [occ.addLine(p[k], q[k]) for k in range(3)]
        loops = [
            occ.addCurveLoop([arcs[0], up[1], over[0], up[0]]),
            occ.addCurveLoop([up[2], over[1], up[1], arcs[1]]),
        ]
        surfaces = [occ.addSurfaceFilling(loop) for loop in loops]
        occ.synchronize()
        for curve in (*arcs, *over, *up):
            model.mesh.setTransfiniteCurve(curve, 5)
        for surface in surfaces:
            model.mesh.setTransfiniteSurface(surface)
            model.mesh.setRecombine(2, surface)
        model.addPhysicalGroup(2, surfaces, name="pipe")
        model.addPhysicalGroup(1, [up[0]], name="low")
        model.mesh.generate(2)
    mesh = mesh_from_gmsh(model, comm, gdim=3)
    if comm.rank == 0:
        gmsh.finalize()
    assert (mesh.gdim, mesh.tdim, mesh.order) == (3, 2, 1)
    section = fx.Section(ALLOY, thickness=0.1, axis=(0, 0, 1), up=(1.0, 1.0, 0.0))
    shell = ShellBodies(mesh, section, fx.Shell())
    x = shell.positions()
    radial = x[:, :2] / np.linalg.norm(x[:, :2], axis=1, keepdims=True)
    along = np.einsum("nc,nc->n", shell.directors[:, :2], radial)
    assert along.min(initial=1.0) > 0.98  # the filled surface is no exact cylinder


def test_forces_and_stresses_on_the_faces(comm: MPI.Intracomm) -> None:
    """A strip under a moment M per length: N = 0, M11 = M, stress -+ 6 M/t^2."""
    mesh = sheets([Sheet("plate", np.linspace(0, 20, 11), np.linspace(0, 2, 3))], comm)
    one = scene(
        mesh,
        materials=fx.Section(fx.Isotropic(70e3, 0.0), thickness=2.0),
        loads=[fx.Moment("plate_a1", (0.0, -3.0, 0.0))],
    )
    one.run(fx.Static(until=fx.Time(1.0)), progress=False)
    shell = one.continuum
    assert isinstance(shell, ShellBodies)
    found = shell_stress(shell, fx.displacement_function(one).x.array)[0]
    assert np.abs(found.forces[:, :6]).max() < 1e-9
    assert found.forces[:, 6] == pytest.approx(-3.0, rel=1e-9)
    top = 6.0 * 3.0 / 2.0**2
    assert found.faces[0][:, 0] == pytest.approx(top, rel=1e-9)
    assert found.faces[1][:, 0] == pytest.approx(-top, rel=1e-9)


@pytest.mark.mpi
@pytest.mark.parametrize("order", [1, 2])
def test_files_show_both_faces(comm: MPI.Intracomm, shared_path: Path, order: int) -> None:
    one = scene(plate(comm, order), loads=[fx.Traction("plate_a1", (0.0, 0.0, 1e-3))])
    one.run(fx.Static(until=fx.Time(1.0)), progress=False)
    fx.write_fields(one, shared_path / "plate.pvd")
    comm.Barrier()
    assert (shared_path / "plate.pvd").is_file()
    text = "".join(f.read_text() for f in sorted((shared_path / "plate").glob("*.vtu")))
    for name in ("displacement", "director", "section_moment", "side"):
        assert f'Name="{name}"' in text


@pytest.mark.mpi
def test_loads_have_their_resultants(comm: MPI.Intracomm) -> None:
    """Reactions of a clamp carry pressure, traction, weight and their moments about its edge."""
    top, bottom = fx.Face("plate", "top"), fx.Face("plate", "bottom")
    cases: list[tuple[Any, str, float]] = [
        (fx.Pressure(top, 0.5), "z", 0.5 * 16.0),
        (fx.Pressure(bottom, 0.5), "z", -0.5 * 16.0),
        (fx.Traction(top, (0.25, 0.0, 0.0)), "x", -0.25 * 16.0),
        (fx.Traction(top, (0.25, 0.0, 0.0)), "wx", -0.25 * 16.0 * 1.0),  # at z = t/2
        (fx.BodyForce((0.0, 0.0, 3.0)), "z", -3.0 * 32.0),
        (fx.Traction("plate_a1", (0.0, 0.0, 0.5)), "z", -0.5 * 4.0),
        (fx.PointForce("plate_a1b1", (0.0, 0.0, 0.5)), "z", -0.5),
    ]
    for load, component, wanted in cases:
        one = scene(plate(comm), loads=[load])
        one.run(fx.Static(until=fx.Time(1.0)), progress=False)
        reaction = one.history[f"R[plate_a0.{component}]"][-1]
        assert reaction == pytest.approx(wanted, rel=1e-9), load


def run(one: fx.Scene) -> fx.Scene:
    one.run(fx.Static(until=fx.Time(1.0)), progress=False)
    return one


def folded(comm: MPI.Intracomm) -> fx.Mesh:
    """A plate folded after it was distributed, so that the smooth parts share their nodes."""
    mesh = plate(comm)
    x = mesh.domain.geometry.x
    x[:, 2] = 3.0 * np.abs(x[:, 0] - 2.0)
    return mesh


FAULTS: dict[str, tuple[Callable[[MPI.Intracomm], Any], str]] = {
    "solid on a surface": (lambda c: scene(plate(c), model=fx.Solid()), "dimension 3"),
    "shell on a volume": (
        lambda c: fx.Scene(
            dcb_3d(c, length=3.0, width=1.0, dx=1.0, dy=1.0, ny=1),
            model=fx.Shell(),
            materials=PLATE,
        ),
        "dimension 2",
    ),
    "no section": (lambda c: scene(plate(c), materials=ALLOY), "not a section"),
    "section in a solid": (
        lambda c: fx.Scene(
            dcb_3d(c, length=3.0, width=1.0, dx=1.0, dy=1.0, ny=1),
            model=fx.Solid(),
            materials=PLATE,
        ),
        "Section belongs to shells",
    ),
    "axis across": (
        lambda c: scene(plate(c), materials=fx.Section(ALLOY, thickness=1.0, axis=(0, 0, 1))),
        "normal to the shell",
    ),
    "pressure on cells": (
        lambda c: scene(plate(c), loads=[fx.Pressure("plate", 1.0)]).run(
            fx.Static(until=fx.Time(1.0)), progress=False
        ),
        "name one of its faces",
    ),
    "oblique rotation": (
        lambda c: scene(
            plate(c, surface=lambda a, b: (a, b, 0.5 * a)),
            supports=[fx.Rotation("plate_a1", x=0.0)],
        ),
        "oblique",
    ),
    "kink with common nodes": (lambda c: scene(folded(c)), "kink"),
    "iterative": (
        lambda c: scene(plate(c), options=fx.CondensedOptions(method="iterative")),
        "not possible with shells",
    ),
    "picture of stress": (
        lambda c: fx.plots.deformed(run(scene(plate(c))), "deformed.png"),
        "both faces",
    ),
    "temperature": (
        lambda c: run(
            scene(plate(c), effects=[fx.Temperature(lambda x: np.where(x[0] > 1, np.nan, 0.0))])
        ),
        "not a finite number",
    ),
    "inertia without density": (
        lambda c: scene(
            plate(c),
            materials=fx.Section(fx.Isotropic(70e3, 0.3), thickness=1.0),
            effects=[fx.Inertia()],
        ),
        "no density",
    ),
    "damping by stiffness": (
        lambda c: scene(plate(c), effects=[fx.Inertia(density=1.0, rayleigh=(0.0, 1.0))]),
        "damping by stiffness is not available",
    ),
    "pressure that follows": (
        lambda c: scene(plate(c), loads=[fx.Pressure(fx.Face("plate", "top"), 1.0, follows=True)]),
        "keeps its direction",
    ),
    "moment on a solid": (
        lambda c: run(
            fx.Scene(
                dcb_3d(c, length=3.0, width=1.0, dx=1.0, dy=1.0, ny=1),
                model=fx.Solid(),
                materials=ALLOY,
                supports=[fx.Clamp("far_upper"), fx.Clamp("far_lower")],
                loads=[fx.Moment("end_upper", (0.0, 1.0, 0.0))],
            )
        ),
        "only shells take moments",
    ),
    "rotation of a solid": (
        lambda c: fx.Scene(
            dcb_3d(c, length=3.0, width=1.0, dx=1.0, dy=1.0, ny=1),
            model=fx.Solid(),
            materials=ALLOY,
            supports=[fx.Rotation("end_upper", x=0.0)],
        ),
        "only shells have rotations",
    ),
}


@pytest.mark.mpi
@pytest.mark.parametrize("case", FAULTS)
def test_faults_are_named(comm: MPI.Intracomm, case: str) -> None:
    work, words = FAULTS[case]
    with pytest.raises(fx.InputError, match=words):
        work(comm)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"thickness": None}, "needs thickness"),
        ({"thickness": -1.0}, "positive"),
        ({"axis": (0.0, 0.0, 0.0)}, "direction"),
        ({"material": fx.Plastic(70e3, 0.3, yield_stress=100.0)}, "linear elastic"),
        ({"material": fx.Laminate([0.0], ALLOY, 1.0)}, "have the thickness"),
    ],
)
def test_sections_refuse(arguments: dict[str, Any], words: str) -> None:
    given: dict[str, Any] = {"material": ALLOY, "thickness": 1.0}
    with pytest.raises(fx.InputError, match=words):
        fx.Section(**{**given, **arguments})


def test_a_shell_explains_itself(comm: MPI.Intracomm) -> None:
    one = run(scene(plate(comm), effects=[fx.FiniteStrain()]))
    text = str(one.explain())
    assert "shells of large rotation" in text
    assert "finite strain" in text
