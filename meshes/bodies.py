"""Two bodies of blocks that meet along y = 0 with nodes of their own; what all specimens share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy.typing as npt

from fxcrack.meshes.blocks import Block, Blocks


def two_bodies(
    x: tuple[npt.ArrayLike, npt.ArrayLike],
    y: tuple[npt.ArrayLike, npt.ArrayLike],
    z: Sequence[npt.ArrayLike] = (),
    *,
    cell: str,
    order: int,
    layers: tuple[tuple[tuple[str, int], ...], tuple[tuple[str, int], ...]] = ((), ()),
) -> tuple[Blocks, Block, Block]:
    """Bodies above and below y = 0, with the groups every specimen has.

    Groups: cells ``upper`` and ``lower``; facets ``upper_face``, ``lower_face`` (y = 0), ``top``
    and ``bottom``. Triangles and tetrahedra of the bodies are mirror images.

    Args:
        x: Coordinates along the crack of the upper and of the lower body (length).
        y: Coordinates across it, upper from 0 and lower up to 0 (length).
        z: Coordinates along the front, one array or none for a 2-D mesh (length).
        cell: Shape of the cells.
        order: 1 or 2.
        layers: Groups of cells of the upper and of the lower body instead of ``upper`` and
            ``lower``: names and numbers of layers of cells, from their lowest upwards.

    Returns:
        The model, the upper and the lower block.
    """
    model = Blocks()
    upper = model.add("upper", (x[0], y[0], *z), cell, order, (), layers[0])
    lower = model.add("lower", (x[1], y[1], *z), cell, order, (1,), layers[1])
    model.group("upper_face", upper.part(y=0.0))
    model.group("lower_face", lower.part(y=0.0))
    model.group("top", upper.part(y=float(upper.axes[1][-1])))
    model.group("bottom", lower.part(y=float(lower.axes[1][0])))
    return model, upper, lower
