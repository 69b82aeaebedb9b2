"""End-notched flexure: a cracked beam in three-point bending, sheared along its mid-plane."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

from fxcrack.mesh import Mesh
from fxcrack.meshes.beam import bending
from fxcrack.meshes.blocks import build
from fxcrack.meshes.script import run


def enf_2d(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    half_span: float = 50.8,
    height: float = 2.25,
    dx: float = 0.5,
    ny: int = 4,
    cell: str = "quadrilateral",
    order: int = 1,
    out: str | Path | None = None,
) -> Mesh:
    """End-notched flexure specimen in its plane, cracked from x = 0; collective.

    Groups: cells ``upper``, ``lower``; facets ``upper_face`` (slave), ``lower_face`` (master),
    ``end_upper``, ``end_lower`` (x = 0), ``far_upper``, ``far_lower`` (x = 2 half_span), ``top``,
    ``bottom``; nodes ``support_left`` (0, -height), ``support_right`` (2 half_span, -height),
    ``load`` (half_span, height).

    Args:
        comm: Communicator to distribute the mesh over.
        half_span: Distance from a support to the load (length).
        height: Height of one arm, half the thickness of the beam (length).
        dx: Step along the beam (length).
        ny: Elements over the height of an arm.
        cell: quadrilateral or triangle.
        order: 1 or 2.
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: A length or number is not positive.
    """
    return build(comm, "enf_2d", lambda: bending(half_span, height, dx, ny, cell, order), out)


if __name__ == "__main__":
    run(enf_2d)
