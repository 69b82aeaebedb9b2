"""Penny-shaped crack in a cylinder of unstructured tetrahedra, meshed from a CAD geometry."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from fxcrack.base.errors import MeshError
from fxcrack.mesh import Mesh, Split
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import on_root
from fxcrack.mesh.read import gmsh_model, prepare
from fxcrack.meshes.script import run
from fxcrack.meshes.spacing import positive


def tet_penny(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    a: float = 1.0,
    radius: float = 8.0,
    half_height: float = 8.0,
    size: float = 1.0 / 6.0,
    fine: float = 0.3,
    growth: float = 0.5,
    order: int = 2,
    out: str | Path | None = None,
) -> Mesh:
    """Quarter of a cylinder around the axis z, with a circle on its plane z = 0; collective.

    Groups: cells ``upper``, ``lower``; facets ``upper_face`` (slave), ``lower_face`` (master) over
    the whole plane z = 0, ``x0`` and ``y0`` (planes of symmetry), ``rim``, ``top``, ``bottom``;
    nodes ``centre_top`` and ``centre_bottom`` at the ends of the axis.

    Args:
        comm: Communicator to distribute the mesh over.
        a: Radius of the circle, a line of nodes: the front of the crack (length).
        radius: Outer radius of the cylinder (length).
        half_height: Height of each half (length).
        size: Length of the elements at the circle (length).
        fine: Distance from the circle within which elements have this length (length).
        growth: Growth of the length of elements per distance beyond it.
        order: 1 or 2.
        out: .msh file to write as well, without the split of the plane; ``None`` for none.

    Raises:
        MeshError: A length is not positive or the circle does not fit into the cylinder.
    """

    def make() -> Any:
        positive(a=a, radius=radius, half_height=half_height, size=size, growth=growth)
        if a >= radius or order not in (1, 2):
            raise MeshError("tet_penny: 0 < a < radius and order 1 or 2 are needed")
        with gmsh_model("tet_penny") as gmsh:
            model, occ = gmsh.model, gmsh.model.occ
            halves = [
                occ.addCylinder(0.0, 0.0, z, 0.0, 0.0, half_height, radius, angle=0.5 * np.pi)
                for z in (0.0, -half_height)
            ]
            disc = occ.addDisk(0.0, 0.0, 0.0, a, a)
            quarter, _ = occ.intersect([(2, disc)], [(3, halves[0])], removeTool=False)
            occ.fragment([(3, half) for half in halves], quarter)
            occ.synchronize()
            front = _groups(model, a, radius, half_height)
            field = model.mesh.field
            distance = field.add("Distance")
            field.setNumbers(distance, "CurvesList", front)
            field.setNumber(distance, "Sampling", 200)
            law = field.add("MathEval")
            beyond = f"(F{distance}-{fine:.17g})"
            text = f"{size:.17g}+{0.5 * growth:.17g}*({beyond}+Abs({beyond}))"
            field.setString(law, "F", text)
            field.setAsBackgroundMesh(law)
            for option in ("FromPoints", "FromCurvature", "ExtendFromBoundary"):
                gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
            model.mesh.generate(3)
            model.mesh.setOrder(order)
            if out is not None:
                gmsh.write(str(out))
            split = Split("plane", "upper_face", "lower_face", toward=(0.0, 0.0, 1.0))
            return prepare(model, "tet_penny", 3, [split])

    return distribute(on_root(comm, make), comm, "tet_penny")


def _groups(model: Any, a: float, radius: float, half_height: float) -> list[int]:
    """Name volumes, faces and points by where they are; the curves of the circle are returned."""
    eps = 1e-6 * radius
    groups: dict[tuple[int, str], list[int]] = {}
    for dim, tag in model.getEntities():
        low, high = np.split(np.array(model.getBoundingBox(dim, tag)), 2)
        flat = [axis for axis in range(3) if high[axis] - low[axis] < eps]
        name = None
        if dim == 3:
            name = "upper" if low[2] > -eps else "lower"
        elif dim == 2 and 2 in flat:
            ends = {0.0: "plane", half_height: "top", -half_height: "bottom"}
            name = next(n for z, n in ends.items() if abs(low[2] - z) < eps)
        elif dim == 2:
            name = "x0" if 0 in flat else "y0" if 1 in flat else "rim"
        elif dim == 0 and np.hypot(low[0], low[1]) < eps and abs(low[2]) > eps:
            name = "centre_top" if low[2] > 0.0 else "centre_bottom"
        if name is not None:
            groups.setdefault((dim, name), []).append(tag)
    for (dim, name), tags in groups.items():
        model.addPhysicalGroup(dim, tags, name=name)
    curves = []
    for _, tag in model.getEntities(1):
        low, high = np.split(np.array(model.getBoundingBox(1, tag)), 2)
        arc = abs(high[0] - a) < eps and abs(high[1] - a) < eps and high[2] - low[2] < eps
        if arc and abs(low[2]) < eps:
            curves.append(tag)
    return curves


if __name__ == "__main__":
    run(tet_penny)
