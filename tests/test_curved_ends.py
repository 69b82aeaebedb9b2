"""Curved interfaces that end on a plane of symmetry, and lines that close on themselves."""

from __future__ import annotations

from itertools import pairwise

import gmsh
import numpy as np
import pytest
from mpi4py import MPI
from specimens import onsets, tensor_surface

import fxcrack as fx
from fxcrack.interface.crack_extent import CrackExtent
from fxcrack.interface.front import Front


def rings(comm: MPI.Intracomm, n: int, quarters: int) -> fx.Mesh:
    """Two concentric rings that meet at radius 1, from the x axis on over 2 or 4 quarters.

    Groups: cells ``fibre``, ``matrix``; curves ``fibre_face``, ``matrix_face``, ``rim``, ``hole``,
    ``symmetry`` (the ends of half rings).
    """
    if comm.rank == 0:
        gmsh.initialize(interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        g = gmsh.model.geo
        centre = g.addPoint(0, 0, 0)
        corners = [(1, 0), (0, 1), (-1, 0), (0, -1)][: quarters + 1]
        names: dict[str, list[int]] = {}
        for name, radii in (("fibre", (0.5, 1.0)), ("matrix", (1.0, 1.5))):
            points = [[g.addPoint(r * x, r * y, 0) for x, y in corners] for r in radii]
            loops = [p + p[:1] if quarters == 4 else p for p in points]
            arcs = [[g.addCircleArc(a, centre, b) for a, b in pairwise(p)] for p in loops]
            rays = [g.addLine(a, b) for a, b in zip(*points, strict=True)]
            for curve in arcs[0] + arcs[1]:
                g.mesh.setTransfiniteCurve(curve, n // quarters + 1)
            for curve in rays:
                g.mesh.setTransfiniteCurve(curve, 4)
            names[name] = []
            for i in range(quarters):
                k = (i + 1) % len(rays)
                loop = g.addCurveLoop([arcs[0][i], rays[k], -arcs[1][i], -rays[i]])
                face = g.addPlaneSurface([loop])
                g.mesh.setTransfiniteSurface(face)
                g.mesh.setRecombine(2, face)
                names[name].append(face)
            inner, outer = ("hole", "fibre_face") if name == "fibre" else ("matrix_face", "rim")
            names[inner], names[outer] = arcs
            if quarters == 2:
                names.setdefault("symmetry", []).extend([rays[0], rays[-1]])
        g.synchronize()
        for name, entities in names.items():
            gmsh.model.addPhysicalGroup(
                2 if name in ("fibre", "matrix") else 1, entities, name=name
            )
        gmsh.model.mesh.generate(2)
    mesh = fx.mesh_from_gmsh(gmsh.model, comm, gdim=2)
    if comm.rank == 0:
        gmsh.finalize()
    return mesh


def loads(comm: MPI.Intracomm, quarters: int) -> list[float]:
    """Load factors of the first onsets of a debond of 40 degrees to either side."""
    bond = fx.Interface(
        slave="matrix_face",
        master="fibre_face",
        bonded=lambda x: np.abs(np.arctan2(x[1], x[0])) >= np.radians(40.0) - 1e-6,
        contact=True,
        name="arc",
    )
    held = {"y": 0.0} if quarters == 2 else {}
    supports = [fx.Displacement("rim", x=lambda x: 0.01 * x[0], **({} if held else {"y": 0.0}))]
    if held:
        supports = [fx.Displacement("symmetry", **held),
                    fx.Displacement("rim", x=lambda x: 0.01 * x[0], y=0.0)]  # fmt: skip
    scene = fx.Scene(
        rings(comm, 18 * quarters, quarters),
        materials=fx.Isotropic(1e3, 0.3),
        model=fx.PlaneStrain(),
        supports=supports,
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1e-3))],
    )
    scene.run(fx.Static(until=fx.Releases(4 if quarters == 4 else 2), stepping="path"))
    found = [row["time"] for row in onsets(scene.history)]
    scene.close()
    return found


@pytest.mark.mpi
def test_half_a_fibre_gives_the_history_of_the_whole(comm: MPI.Intracomm) -> None:
    half, whole = loads(comm, 2), loads(comm, 4)
    assert len(half) == len(whole) == 2
    # the same elements; only the contact at the plane of symmetry has half the weight
    assert half == pytest.approx(whole, rel=1e-6)


def circle(x: np.ndarray) -> np.ndarray:
    angle = 2.0 * np.pi * x[:, 0]
    return np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])


@pytest.mark.parametrize("start", [0, 1, 5, 9, 17])
def test_length_on_a_closed_line_does_not_depend_on_where_it_begins(start: int) -> None:
    s = tensor_surface("interval", 1, np.linspace(0.0, 1.0, 19), warp=circle)
    assert s.n_nodes == 18
    order = np.argsort(np.arctan2(s.x[:, 1], s.x[:, 0]))
    side = 2.0 * np.sin(np.pi / 18.0)
    bonded = np.ones(18, dtype=bool)
    bonded[order[[(start + k) % 18 for k in range(5)]]] = False
    front = Front(s, bonded, "i")
    extent = CrackExtent(front)
    # six facets between two tips
    assert extent.length(front.tips()) == pytest.approx(3.0 * side, rel=1e-12)
    front.release(order[[(start + k) % 18 for k in range(5, 17)]])
    assert extent.length(front.tips()) == pytest.approx(9.0 * side, rel=1e-12)
    front.release(order[[(start + 17) % 18]])
    assert extent.length(front.tips()) == pytest.approx(9.0 * side, rel=1e-12)


def test_length_does_not_double_with_the_last_bond() -> None:
    s = tensor_surface("interval", 1, np.linspace(0.0, 8.0, 9))
    x = s.x[:, 0]
    front = Front(s, np.abs(x - 4.0) > 1.5, "i")
    extent = CrackExtent(front)
    lengths = [extent.length(front.tips())]
    for node in np.argsort(np.abs(x - 4.0) + 1e-3 * x, kind="stable"):
        if front.bonded[node]:
            front.release(np.array([node]))
            lengths.append(extent.length(front.tips()))
    assert lengths == pytest.approx([2.0, 2.5, 3.0, 3.5, 4.0, 4.0, 4.0])
