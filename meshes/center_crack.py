"""Plate with a central crack on y = 0, from x = -a to x = a."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI

from fxcrack.base.errors import MeshError
from fxcrack.mesh import Mesh
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.script import run
from fxcrack.meshes.spacing import even, growing, positive


def center_crack(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    a: float = 1.0,
    width: float = 20.0,
    height: float = 20.0,
    n_crack: int = 20,
    fine: float = 0.5,
    growth: float = 1.15,
    cell: str = "quadrilateral",
    order: int = 1,
    out: str | Path | None = None,
) -> Mesh:
    """Plate, whole width and height, centred at the origin; collective.

    Groups: cells ``upper``, ``lower``; facets ``upper_face`` (slave), ``lower_face`` (master) over
    the whole width, ``top``, ``bottom``, ``left``, ``right``; nodes ``bottom_left``,
    ``bottom_right``, ``top_left``, ``top_right`` at the corners.

    Args:
        comm: Communicator to distribute the mesh over.
        a: Half length of the crack (length).
        width: Width of the plate, along x (length).
        height: Height of the plate, along y (length).
        n_crack: Elements along half the crack; their step is kept around it.
        fine: Length of the even region beyond each tip and off the plane (length).
        growth: Ratio of neighbouring steps beyond it.
        cell: quadrilateral or triangle.
        order: 1 or 2.
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: A length or number is not positive or the crack does not fit into the plate.
    """

    def make() -> Blocks:
        positive(a=a, width=width, height=height, n_crack=n_crack)
        beyond = 0.5 * width - a
        if beyond <= 0:
            raise MeshError(f"the crack, 2 x {a:g} long, must be shorter than the width {width:g}")
        size = a / n_crack
        half = np.concatenate(
            (
                even(0.0, a, size),
                growing(a, 0.5 * width, size, growth=growth, even_length=min(fine, beyond))[1:],
            )
        )
        x = np.concatenate((-half[:0:-1], half))
        y = growing(0.0, 0.5 * height, size, growth=growth, even_length=min(fine, 0.5 * height))
        model, upper, lower = two_bodies((x, x), (y, -y[::-1]), cell=cell, order=order)
        for name, body, end in (("top", upper, 0.5 * height), ("bottom", lower, -0.5 * height)):
            for side, where in (("left", -0.5 * width), ("right", 0.5 * width)):
                model.group(side, body.part(x=where))
                model.group(f"{name}_{side}", body.part(x=where, y=end))
        return model

    return build(comm, "center_crack", make, out)


if __name__ == "__main__":
    run(center_crack)
