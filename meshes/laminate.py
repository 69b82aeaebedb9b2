"""Laminates meshed ply by ply, with a crack between two of the plies, in 2-D and 3-D.

x runs along the specimen from its cracked end, y across the plies with the crack at y = 0, z across
the width. Cell groups ``ply_1``, ``ply_2``, ... are the plies from the bottom to the top, the names
of ``Laminate.layers("ply")``:

    lay_up = fx.Laminate("[0/45/-45/90]2s", cfrp, 0.125, frame=("x", -90.0))   # stacked along y
    mesh = laminate_3d(plies=lay_up.thicknesses, crack=8)
    fx.Scene(mesh, materials=lay_up.layers("ply"), ...)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.checks import as_float, list_of, number, shown
from fxcrack.base.errors import MeshError
from fxcrack.mesh import Mesh
from fxcrack.meshes.beam import name_ends
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.script import run
from fxcrack.meshes.spacing import even, fine_region, positive


def laminate_2d(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    plies: Sequence[float] = (0.75, 0.75, 0.75, 0.75),
    crack: int = 2,
    length: float = 100.0,
    dx: float = 0.5,
    per_ply: int = 1,
    cell: str = "quadrilateral",
    order: int = 1,
    fine: tuple[float, float] | None = None,
    coarse_dx: float | None = None,
    out: str | Path | None = None,
) -> Mesh:
    """Section of a laminate along its length and through its thickness; collective.

    Groups: cells ``ply_1`` (bottom) to ``ply_n`` (top); facets ``upper_face`` (slave) and
    ``lower_face`` (master) on both sides of the crack plane, ``end_upper``, ``end_lower`` (x = 0),
    ``far_upper``, ``far_lower`` (x = length), ``top``, ``bottom``; nodes ``pin_top`` and
    ``pin_bottom`` at the outer corners of the cracked end.

    Args:
        comm: Communicator to distribute the mesh over.
        plies: Thicknesses of the plies, bottom first (length).
        crack: Number of plies below the crack plane.
        length: Length of the specimen (length).
        dx: Step along it, in the fine region if there is one (length).
        per_ply: Layers of cells in each ply.
        cell: quadrilateral or triangle.
        order: 1 or 2.
        fine: Both ends of the region in which the step is dx, ``None`` for all (length).
        coarse_dx: Largest step outside it, ``None`` for 8 dx (length).
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: A length or number is not positive, or no ply lies above or below the crack.
    """

    def make() -> Blocks:
        x = fine_region(length, dx, fine=fine, coarse_dx=coarse_dx)
        return _two_stacks(x, (), plies, crack, per_ply, cell, order)

    return build(comm, "laminate_2d", make, out)


def laminate_3d(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    plies: Sequence[float] = (0.75, 0.75, 0.75, 0.75),
    crack: int = 2,
    length: float = 60.0,
    width: float = 25.0,
    dx: float = 1.0,
    dz: float = 2.5,
    per_ply: int = 1,
    cell: str = "hexahedron",
    order: int = 1,
    fine: tuple[float, float] | None = None,
    coarse_dx: float | None = None,
    out: str | Path | None = None,
) -> Mesh:
    """Laminate with a crack across its width; collective.

    Groups: those of :func:`laminate_2d`, with faces for edges; ``side_0`` (z = 0), ``side_w``
    (z = width); ``pin_top`` and ``pin_bottom`` are the outer edges of the cracked end.

    Args:
        comm: Communicator to distribute the mesh over.
        plies: Thicknesses of the plies, bottom first (length).
        crack: Number of plies below the crack plane.
        length: Length of the specimen (length).
        width: Its width (length).
        dx: Step along it, in the fine region if there is one (length).
        dz: Step across the width (length).
        per_ply: Layers of cells in each ply.
        cell: hexahedron or tetrahedron.
        order: 1 or 2.
        fine: Both ends of the region in which the step is dx, ``None`` for all (length).
        coarse_dx: Largest step outside it, ``None`` for 8 dx (length).
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: A length or number is not positive, or no ply lies above or below the crack.
    """

    def make() -> Blocks:
        x = fine_region(length, dx, fine=fine, coarse_dx=coarse_dx)
        return _two_stacks(x, (even(0.0, width, dz),), plies, crack, per_ply, cell, order)

    return build(comm, "laminate_3d", make, out)


def _two_stacks(
    x: npt.NDArray[np.float64],
    z: Sequence[npt.NDArray[np.float64]],
    plies: Sequence[float],
    crack: int,
    per_ply: int,
    cell: str,
    order: int,
) -> Blocks:
    """The plies above and below the crack plane, each a body with a group of cells per ply."""
    given = [] if isinstance(plies, str) else list_of(plies)
    if not given:
        raise MeshError(
            f"plies = {shown(plies)} must be the thicknesses of two plies or more, bottom first, "
            "such as Laminate.thicknesses"
        )
    thickness = [number("laminate", f"plies[{i}]", t) for i, t in enumerate(given)]
    layers = as_float(per_ply)
    if layers is None or not layers.is_integer():
        raise MeshError(f"per_ply = {shown(per_ply)} must be a whole number of layers of cells")
    positive(per_ply=per_ply, **{f"plies[{i}]": t for i, t in enumerate(thickness)})
    if isinstance(crack, bool) or crack != int(crack) or not 0 < crack < len(thickness):
        raise MeshError(
            f"crack = {crack}: the crack plane needs a ply below and above; give a whole number "
            f"from 1 to {len(thickness) - 1} for {len(thickness)} plies"
        )
    ends = np.concatenate(([0.0], np.cumsum(thickness)))
    ends -= ends[int(crack)]
    steps = np.linspace(0.0, 1.0, int(per_ply) + 1)[:-1]

    def lines(stack: slice) -> npt.NDArray[np.float64]:
        bottom, top = ends[:-1][stack], ends[1:][stack]
        inner = bottom[:, None] + np.diff(np.vstack((bottom, top)), axis=0).T * steps
        return np.append(inner.ravel(), top[-1])

    names = tuple((f"ply_{i}", int(per_ply)) for i in range(1, len(thickness) + 1))
    above, below = slice(int(crack), None), slice(None, int(crack))
    model, upper, lower = two_bodies(
        (x, x), (lines(above), lines(below)), z,
        cell=cell, order=order, layers=(names[above], names[below]),
    )  # fmt: skip
    name_ends(model, upper=upper, lower=lower)
    model.group("pin_top", upper.part(x=0.0, y=float(ends[-1])))
    model.group("pin_bottom", lower.part(x=0.0, y=float(ends[0])))
    return model


if __name__ == "__main__":
    run(laminate_2d, laminate_3d)
