"""Mixed-mode bending: a cracked beam bent at mid-span while a lever lifts its cracked end."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

from fxcrack.mesh import Mesh
from fxcrack.meshes.beam import bending
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.script import run


def mmb_2d(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    half_span: float = 50.0,
    height: float = 1.5,
    dx: float = 0.5,
    ny: int = 4,
    cell: str = "quadrilateral",
    order: int = 1,
    out: str | Path | None = None,
) -> Mesh:
    """Mixed-mode bending specimen in its plane, cracked from x = 0; collective.

    Groups: those of :func:`fxcrack.meshes.enf.enf_2d` (``support_left`` is under the cracked end,
    ``load`` at mid-span), and the node ``lever_end`` (0, height) that the lever lifts.

    Args:
        comm: Communicator to distribute the mesh over.
        half_span: Distance from a support to mid-span (length).
        height: Height of one arm, half the thickness of the beam (length).
        dx: Step along the beam (length).
        ny: Elements over the height of an arm.
        cell: quadrilateral or triangle.
        order: 1 or 2.
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: A length or number is not positive.
    """

    def make() -> Blocks:
        model = bending(half_span, height, dx, ny, cell, order)
        model.group("lever_end", model.blocks["upper"].part(x=0.0, y=height))
        return model

    return build(comm, "mmb_2d", make, out)


if __name__ == "__main__":
    run(mmb_2d)
