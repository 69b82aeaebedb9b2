"""Beams of two arms of any heights and spacings, for the hard cases."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from specimens import specimen

import fxcrack as fx
from fxcrack.base import compat
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from stability.watch import Watch, assert_in_balance

Array = npt.NDArray[np.float64]

SELF = MPI.COMM_SELF
LENGTH = 60.0
FAR = (
    fx.Displacement("far_upper", x=0.0, y=0.0),
    fx.Displacement("far_lower", x=0.0, y=0.0),
)


def arms(
    comm: MPI.Intracomm = SELF,
    *,
    length: float = LENGTH,
    heights: tuple[float, float] = (1.5, 1.5),
    ny: int = 2,
    upper: npt.ArrayLike | None = None,
    lower: npt.ArrayLike | None = None,
    cell: str = "quadrilateral",
    order: int = 1,
    gap: float = 0.0,
) -> fx.Mesh:
    """Arms along x, bonded along y = 0, with the groups of the double cantilever beam.

    ``gap`` moves the upper arm up; a negative one makes the arms overlap.
    """

    def make() -> Blocks:
        x = np.linspace(0.0, length, round(length) + 1) if upper is None else upper
        y = np.linspace(0.0, heights[0], ny + 1), np.linspace(-heights[1], 0.0, ny + 1)
        model, top, bottom = two_bodies(
            (x, x if lower is None else lower), y, (), cell=cell, order=order
        )
        for name, arm, end in (("upper", top, heights[0]), ("lower", bottom, -heights[1])):
            model.group(f"end_{name}", arm.part(x=0.0))
            model.group(f"far_{name}", arm.part(x=length))
            model.group("pin_top" if end > 0 else "pin_bottom", arm.part(x=0.0, y=end))
        return model

    mesh = build(comm, "arms", make, None)
    if gap:
        shift(mesh, gap)
    return mesh


def shift(mesh: fx.Mesh, gap: float) -> None:
    """Move the nodes of the upper body up."""
    geometry = mesh.domain.geometry
    cells = mesh.group("upper", dim=mesh.tdim).entities
    geometry.x[np.unique(compat.geometry_dofmap(mesh.domain)[cells]), 1] += gap


def watched(scene: fx.Scene, **controls: Any) -> fx.History:
    """Run a step; everything of :class:`~stability.watch.Watch` holds after every event."""
    toughness = getattr(scene.debonds[0].criterion, "GIc", 0.2)
    watch = Watch(scene, toughness if isinstance(toughness, float) else 0.2)
    known = len(scene.history)
    history = scene.run(fx.Static(**controls), observers=[watch], progress=False)
    assert watch.count == len(history) - known
    assert_in_balance(scene)
    return history


def grown(scene: fx.Scene, count: int, **controls: Any) -> fx.History:
    """Run until so many nodes have gone, watched."""
    return watched(scene, until=fx.Releases(count), **controls)


def released_energies(history: fx.History) -> tuple[Array, Array]:
    """G at each onset, and the energy that release set free."""
    rates, energies = [], []
    for before, after in zip(history.rows, history.rows[1:], strict=False):
        if before["event"] in ("onset", "unstable") and after["event"] == "release":
            rates.append(sum(float(before[f"{m}[bond]"]) for m in ("GI", "GII", "GIII")))
            energies.append(float(after["released_energy"]) - float(before["released_energy"]))
    return np.array(rates), np.array(energies)


__all__ = ["FAR", "LENGTH", "SELF", "arms", "grown", "released_energies", "specimen", "watched"]
