"""Circular blister under a film on a base: a quarter of two surface meshes, for shells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from fxcrack.base.errors import MeshError
from fxcrack.mesh import Mesh
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import on_root
from fxcrack.mesh.read import gmsh_model, prepare
from fxcrack.meshes.script import run

_CORE = 0.45
"""Size of the square core by the radius of the blister."""


def blister(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    a: float = 1.0,
    radius: float = 1.5,
    film_z: float = 0.0,
    base_z: float = -0.1,
    n_around: int = 8,
    n_inside: int = 10,
    n_outside: int = 8,
    front: float = 0.03,
    order: int = 1,
    out: str | Path | None = None,
) -> Mesh:
    """Quarters of two discs of quadrilaterals around a circle; collective.

    Groups: cells ``film``, ``base``, and ``blister``, those of the film inside the circle; edges
    ``film_x0``, ``film_y0`` (planes of symmetry), ``film_rim``; node ``centre``.

    Args:
        comm: Communicator to distribute the mesh over.
        a: Radius of the circle, a line of nodes (length).
        radius: Radius of the discs (length).
        film_z: Height of the film's reference surface (length).
        base_z: Of the base's (length).
        n_around: Elements over an eighth of the circle.
        n_inside: Elements from the core to the circle.
        n_outside: Elements from the circle to the rim.
        front: Length of the elements beside the circle (length).
        order: 1 or 2.
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: Radii or numbers that do not fit.
    """

    def make() -> Any:
        if not 0.0 < a < radius or order not in (1, 2) or film_z <= base_z:
            raise MeshError("blister: 0 < a < radius, base_z < film_z and order 1 or 2 are needed")
        with gmsh_model("blister") as gmsh:
            model = gmsh.model
            cells: dict[str, list[int]] = {"film": [], "base": [], "blister": []}
            edges: dict[str, list[int]] = {"film_x0": [], "film_y0": [], "film_rim": []}
            for name, z in (("film", film_z), ("base", base_z)):
                centre = _disc(
                    gmsh, name, z, a, radius, (n_around, n_inside, n_outside), front, cells, edges
                )
                if name == "film":
                    model.addPhysicalGroup(0, [centre], name="centre")
            for name, tags in cells.items():
                model.addPhysicalGroup(2, tags, name=name)
            for name, tags in edges.items():
                model.addPhysicalGroup(1, tags, name=name)
            model.mesh.generate(2)
            model.mesh.setOrder(order)
            if out is not None:
                gmsh.write(str(out))
            return prepare(model, "blister", 3)

    return distribute(on_root(comm, make), comm, "blister")


def _disc(
    gmsh: Any,
    name: str,
    z: float,
    a: float,
    radius: float,
    counts: tuple[int, int, int],
    front: float,
    cells: dict[str, list[int]],
    edges: dict[str, list[int]],
) -> int:
    """A quarter disc of five transfinite patches; its groups are added, its centre is returned."""
    geo = gmsh.model.geo
    n_around, n_inside, n_outside = counts
    half = np.sqrt(0.5)
    core = _CORE * a
    centre = geo.addPoint(0.0, 0.0, z)
    inner = [geo.addPoint(x, y, z) for x, y in ((core, 0.0), (0.8 * core, 0.8 * core), (0.0, core))]
    rings = [
        [geo.addPoint(x, y, z) for x, y in ((r, 0.0), (r * half, r * half), (0.0, r))]
        for r in (a, radius)
    ]
    spokes = [geo.addLine(centre, inner[0]), geo.addLine(centre, inner[2])]
    sides = [geo.addLine(inner[k], inner[k + 1]) for k in (0, 1)]
    arcs = [[geo.addCircleArc(r[k], centre, r[k + 1]) for k in (0, 1)] for r in rings]
    inside = [geo.addLine(inner[k], rings[0][k]) for k in range(3)]
    outside = [geo.addLine(rings[0][k], rings[1][k]) for k in range(3)]
    patches = [[spokes[0], sides[0], sides[1], -spokes[1]]]
    patches += [[inside[k], arcs[0][k], -inside[k + 1], -sides[k]] for k in (0, 1)]
    patches += [[outside[k], arcs[1][k], -outside[k + 1], -arcs[0][k]] for k in (0, 1)]
    surfaces = [geo.addPlaneSurface([geo.addCurveLoop(p)]) for p in patches]
    for curve in (*spokes, *sides, *arcs[0], *arcs[1]):
        geo.mesh.setTransfiniteCurve(curve, n_around + 1)
    shrink = _ratio(a - core, front, n_inside)
    for curve in inside:
        geo.mesh.setTransfiniteCurve(curve, n_inside + 1, "Progression", 1.0 / shrink)
    grow = _ratio(radius - a, front, n_outside)
    for curve in outside:
        geo.mesh.setTransfiniteCurve(curve, n_outside + 1, "Progression", grow)
    for surface in surfaces:
        geo.mesh.setTransfiniteSurface(surface)
        geo.mesh.setRecombine(2, surface)
    geo.synchronize()
    cells[name] += surfaces
    if name == "film":
        cells["blister"] += surfaces[:3]
        edges["film_y0"] += [spokes[0], inside[0], outside[0]]
        edges["film_x0"] += [spokes[1], inside[2], outside[2]]
        edges["film_rim"] += arcs[1]
    return int(centre)


def _ratio(length: float, first: float, n: int) -> float:
    """Ratio q of n lengths first, first q, ... that add up to a length, at least 1."""
    if first * n >= length:
        return 1.0
    low, high = 1.0, 10.0
    for _ in range(60):
        q = 0.5 * (low + high)
        low, high = (q, high) if first * (q**n - 1.0) / (q - 1.0) < length else (low, q)
    return low


if __name__ == "__main__":
    run(blister)
