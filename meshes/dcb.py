"""Double cantilever beam: two arms pulled apart at x = 0, in 2-D and 3-D."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.mesh import Mesh
from fxcrack.meshes.beam import name_ends, two_arms
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.script import run
from fxcrack.meshes.spacing import even, fine_region, positive


def dcb_2d(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    length: float = 100.0,
    height: float = 1.5,
    dx: float = 0.5,
    ny: int = 4,
    cell: str = "quadrilateral",
    order: int = 1,
    fine: tuple[float, float] | None = None,
    coarse_dx: float | None = None,
    x_spacing: npt.ArrayLike | None = None,
    nx_lower: int | None = None,
    ny_lower: int | None = None,
    out: str | Path | None = None,
) -> Mesh:
    """Double cantilever beam in its plane; collective.

    Groups: cells ``upper``, ``lower``; facets ``upper_face`` (slave), ``lower_face`` (master),
    ``end_upper``, ``end_lower`` (x = 0), ``far_upper``, ``far_lower`` (x = length), ``top``,
    ``bottom``; nodes ``pin_top`` (0, height), ``pin_bottom`` (0, -height).

    Args:
        comm: Communicator to distribute the mesh over.
        length: Length of the arms (length).
        height: Height of one arm (length).
        dx: Step along the arms, in the fine region if there is one (length).
        ny: Elements over the height of an arm.
        cell: quadrilateral or triangle.
        order: 1 or 2.
        fine: Both ends of the region in which the step is dx, ``None`` for the whole arm (length).
        coarse_dx: Largest step outside it, ``None`` for 8 dx (length).
        x_spacing: Coordinates of the corner nodes along the arms instead of dx, from 0 to length.
        nx_lower: Even elements along the lower arm, ``None`` for nodes that match the upper arm's.
        ny_lower: Elements over the height of the lower arm, ``None`` for ny.
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: A length or number is not positive, or the coordinates do not fit the length.
    """

    def make() -> Blocks:
        x = fine_region(length, dx, fine=fine, coarse_dx=coarse_dx, given=x_spacing)
        model, upper, lower = two_arms(
            x, height, ny, cell=cell, order=order, nx_lower=nx_lower, ny_lower=ny_lower
        )
        model.group("pin_top", upper.part(x=0.0, y=height))
        model.group("pin_bottom", lower.part(x=0.0, y=-height))
        return model

    return build(comm, "dcb_2d", make, out)


def dcb_3d(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    length: float = 100.0,
    height: float = 1.5,
    width: float = 20.0,
    dx: float = 1.0,
    dy: float = 2.0,
    ny: int = 2,
    cell: str = "hexahedron",
    order: int = 1,
    fine: tuple[float, float] | None = None,
    coarse_dx: float | None = None,
    x_spacing: npt.ArrayLike | None = None,
    z_spacing: npt.ArrayLike | None = None,
    nx_lower: int | None = None,
    ny_lower: int | None = None,
    out: str | Path | None = None,
) -> Mesh:
    """Double cantilever beam, x along, y opening, z across the width from 0; collective.

    Groups: those of :func:`dcb_2d`, with faces for edges; ``side_0`` (z = 0), ``side_w``
    (z = width); ``pin_top`` and ``pin_bottom`` are the edges of the end faces at y = +-height;
    where the width has a corner node in its middle also the nodes ``mid_top`` and ``mid_bottom``
    on those edges.

    Args:
        comm: Communicator to distribute the mesh over.
        length: Length of the arms (length).
        height: Height of one arm (length).
        width: Width of the specimen (length).
        dx: Step along the arms, in the fine region if there is one (length).
        dy: Step across the width (length).
        ny: Elements over the height of an arm.
        cell: hexahedron or tetrahedron.
        order: 1 or 2.
        fine: Both ends of the region in which the step is dx, ``None`` for the whole arm (length).
        coarse_dx: Largest step outside it, ``None`` for 8 dx (length).
        x_spacing: Coordinates of the corner nodes along the arms instead of dx, from 0 to length.
        z_spacing: Coordinates across the width instead of dy, from 0 to width.
        nx_lower: Even elements along the lower arm, ``None`` for nodes that match the upper arm's.
        ny_lower: Elements over the height of the lower arm, ``None`` for ny.
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: A length or number is not positive, or the coordinates do not fit.
    """

    def make() -> Blocks:
        x = fine_region(length, dx, fine=fine, coarse_dx=coarse_dx, given=x_spacing)
        z = even(0.0, width, dy) if z_spacing is None else fine_region(width, dy, given=z_spacing)
        model, upper, lower = two_arms(
            x, height, ny, z=(z,), cell=cell, order=order, nx_lower=nx_lower, ny_lower=ny_lower
        )
        for name, arm, y in (("top", upper, height), ("bottom", lower, -height)):
            model.group(f"pin_{name}", arm.part(x=0.0, y=y))
            if abs(z - 0.5 * width).min() < 1e-9 * width:
                model.group(f"mid_{name}", arm.part(x=0.0, y=y, z=0.5 * width))
        return model

    return build(comm, "dcb_3d", make, out)


def half_dcb(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    length: float = 100.0,
    height: float = 1.5,
    width: float | None = None,
    dx: float = 0.5,
    dy: float = 2.0,
    ny: int = 4,
    cell: str | None = None,
    order: int = 1,
    x_spacing: npt.ArrayLike | None = None,
    out: str | Path | None = None,
) -> Mesh:
    """Upper arm of :func:`dcb_2d` or :func:`dcb_3d` on the plane of symmetry y = 0; collective.

    Groups: those of the upper arm there: cells ``upper``; facets ``upper_face`` (y = 0),
    ``end_upper``, ``far_upper``, ``top``, in 3-D ``side_0`` and ``side_w``; nodes ``pin_top``.

    Args:
        comm: Communicator to distribute the mesh over.
        length: Length of the arm (length).
        height: Its height (length).
        width: Width of the specimen (length); ``None`` for a mesh in the plane.
        dx: Step along the arm (length).
        dy: Step across the width (length).
        ny: Elements over the height.
        cell: ``None`` for quadrilaterals or hexahedra; triangle or tetrahedron.
        order: 1 or 2.
        x_spacing: Coordinates of the corner nodes along the arm instead of dx, from 0 to length.
        out: .msh file to write as well, ``None`` for none.

    Raises:
        MeshError: A length or number is not positive, or the coordinates do not fit the length.
    """

    def make() -> Blocks:
        positive(height=height, elements=ny)
        x = fine_region(length, dx, given=x_spacing)
        y = np.linspace(0.0, height, int(ny) + 1)
        z = () if width is None else (even(0.0, width, dy),)
        model = Blocks()
        shape = cell or ("quadrilateral" if width is None else "hexahedron")
        upper = model.add("upper", (x, y, *z), shape, order)
        model.group("upper_face", upper.part(y=0.0))
        model.group("top", upper.part(y=height))
        name_ends(model, upper=upper)
        model.group("pin_top", upper.part(x=0.0, y=height))
        return model

    return build(comm, "half_dcb", make, out)


if __name__ == "__main__":
    run(dcb_2d, dcb_3d)
