"""Beams of two arms, bonded along y = 0: the common shape of DCB, ENF and MMB specimens.

x runs from the cracked end (0) to the far end (length), y through the thickness (-height to
height), z across the width.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fxcrack.meshes.blocks import Block, Blocks
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.spacing import even, positive


def two_arms(
    x: npt.ArrayLike,
    height: float,
    ny: int,
    *,
    z: Sequence[npt.ArrayLike] = (),
    cell: str,
    order: int,
    nx_lower: int | None = None,
    ny_lower: int | None = None,
) -> tuple[Blocks, Block, Block]:
    """Two arms with their faces named.

    Groups, besides those of :func:`fxcrack.meshes.bodies.two_bodies`: facets ``end_upper``,
    ``end_lower`` (x = 0), ``far_upper``, ``far_lower`` (x = length), in 3-D ``side_0`` and
    ``side_w`` (both ends of z, both arms).

    Args:
        x: Coordinates along the arms (length), shape (nx + 1,).
        height: Height of one arm (length).
        ny: Elements over the height of the upper arm.
        z: Coordinates across the width, one array or none (length).
        cell: Shape of the cells.
        order: 1 or 2.
        nx_lower: Even elements along the lower arm, ``None`` for those of the upper one.
        ny_lower: Elements over the height of the lower arm, ``None`` for ``ny``.

    Returns:
        The model, the upper and the lower arm.
    """
    x_upper = np.asarray(x, dtype=float)
    length = float(x_upper[-1])
    x_lower = x_upper if nx_lower is None else _evenly(0.0, length, nx_lower)
    y_upper = _evenly(0.0, height, ny)
    y_lower = _evenly(-height, 0.0, ny if ny_lower is None else ny_lower)
    model, upper, lower = two_bodies(
        (x_upper, x_lower), (y_upper, y_lower), z, cell=cell, order=order
    )
    name_ends(model, upper=upper, lower=lower)
    return model, upper, lower


def name_ends(model: Blocks, **arms: Block) -> None:
    """Name the end faces of arms, and in 3-D their sides, as :func:`two_arms` says."""
    for name, arm in arms.items():
        model.group(f"end_{name}", arm.part(x=0.0))
        model.group(f"far_{name}", arm.part(x=float(arm.axes[0][-1])))
        if arm.dim == 3:
            model.group("side_0", arm.part(z=float(arm.axes[2][0])))
            model.group("side_w", arm.part(z=float(arm.axes[2][-1])))


def bending(half_span: float, height: float, dx: float, ny: int, cell: str, order: int) -> Blocks:
    """Two arms of length 2 half_span with corner nodes named where bending fixtures act.

    Groups, besides those of :func:`two_arms`: nodes ``support_left`` (0, -height),
    ``support_right`` (2 half_span, -height) and ``load`` (half_span, height).
    """
    positive(half_span=half_span, dx=dx)
    half = even(0.0, half_span, dx)
    x = np.concatenate((half, half_span + half[1:]))
    model, upper, lower = two_arms(x, height, ny, cell=cell, order=order)
    model.group("support_left", lower.part(x=0.0, y=-height))
    model.group("support_right", lower.part(x=2.0 * half_span, y=-height))
    model.group("load", upper.part(x=half_span, y=height))
    return model


def _evenly(start: float, stop: float, n: int) -> npt.NDArray[np.float64]:
    """Coordinates of n even elements."""
    positive(length=stop - start, elements=n)
    return np.linspace(start, stop, int(n) + 1)
