"""Penny-shaped crack in a cylinder, axisymmetric: x[0] is the radius, x[1] the axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI

from fxcrack.base.errors import MeshError
from fxcrack.mesh import Mesh
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.script import run
from fxcrack.meshes.spacing import growing, positive


def penny(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    a: float = 2.0,
    radius: float = 40.0,
    half_height: float = 40.0,
    dr: float = 0.05,
    fine: float = 0.5,
    growth: float = 1.15,
    cell: str = "quadrilateral",
    order: int = 1,
    out: str | Path | None = None,
) -> Mesh:
    """Half-section of a cylinder with a crack plane at mid-height; collective.

    Groups: cells ``upper``, ``lower``; facets ``upper_face`` (slave), ``lower_face`` (master) over
    the whole radius, ``axis_upper``, ``axis_lower`` (r = 0), ``outer`` (r = radius), ``top``,
    ``bottom``; nodes ``axis_top``, ``axis_bottom``, ``outer_top``, ``outer_bottom`` at the corners,
    ``centre_upper`` and ``centre_lower`` at the middle of the crack.

    Args:
        comm: Communicator to distribute the mesh over.
        a: Radius around which the mesh is fine, a node of it: that of the crack (length).
        radius: Outer radius of the cylinder (length).
        half_height: Height of each body (length).
        dr: Step around r = a, along the radius and off the plane (length).
        fine: Length of the even region on either side of r = a and of the plane (length).
        growth: Ratio of neighbouring steps beyond it.
        cell: quadrilateral or triangle.
        order: 1 or 2.
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: A length is not positive or the crack does not fit into the cylinder.
    """

    def make() -> Blocks:
        positive(a=a, radius=radius, half_height=half_height, dr=dr)
        if a >= radius:
            raise MeshError(f"the crack radius {a:g} must be smaller than the radius {radius:g}")
        inner = growing(a, 0.0, dr, growth=growth, even_length=min(fine, a))
        beyond = growing(a, radius, dr, growth=growth, even_length=min(fine, radius - a))
        r = np.concatenate((inner[:-1], beyond))
        y = growing(0.0, half_height, dr, growth=growth, even_length=min(fine, half_height))
        model, upper, lower = two_bodies((r, r), (y, -y[::-1]), cell=cell, order=order)
        for side, body, end in (("upper", upper, half_height), ("lower", lower, -half_height)):
            name = "top" if end > 0 else "bottom"
            model.group(f"axis_{side}", body.part(x=0.0))
            model.group("outer", body.part(x=radius))
            model.group(f"axis_{name}", body.part(x=0.0, y=end))
            model.group(f"outer_{name}", body.part(x=radius, y=end))
            model.group(f"centre_{side}", body.part(x=0.0, y=0.0))
        return model

    return build(comm, "penny", make, out)


if __name__ == "__main__":
    run(penny)
