# # A front in 3-D under fatigue: partial growth against node by node
#
# A double cantilever beam, 10 wide, is opened to and fro (R = 0.1) and grows by a Paris law,
# da/dN = 0.5 dG^5. With `partial=True` every node of the front advances through its element as its
# own G says, and what is left of its bond fades in proportion: the front bows out, stays smooth and
# has one G along it but at its ends.
#
# Node by node, each bond holds until its element is passed. A node that is ahead of its neighbours
# has less G than the smooth front, so the front takes longer, and on elements 1 wide it comes to
# the threshold (0.01 of the toughness) within the first row; on elements 2 wide it does not.
# `partial=True` is the default in 3-D.
#
# `fx.plots.tip_growth` gives N, a, dG and da/dN of every tip, `fx.front_lines` the front with its
# G, and `scene.fatigue.ligaments` the part of its element that each node has passed.
"""Fronts of a 3-D double cantilever beam under fatigue, with and without partial growth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.front3d import make_scene
from fxcrack.demos.show import arguments, table
from fxcrack.history import Row
from fxcrack.output.plots.style import COLOURS, dress, legend, new_figure, save

Array = npt.NDArray[np.float64]

A0, WIDTH, DX = 10.0, 10.0, 1.0
LAW = fx.Paris(c1=0.0, c2=-2.0, c3=0.5, c4=5.0, r1=0.01, r2=0.99)


@dataclass(frozen=True)
class Fronts:
    """What a run shows.

    Attributes:
        z: Places across the width, shape (n,) [length].
        x: The front at each mean length that it has reached, and where it has arrested before the
            last of them, shape (m, n) [length].
        rates: G_max along the last of them, shape (n,) [force/length].
        history: Its history.
    """

    z: Array
    x: Array
    rates: Array
    history: fx.History


def run(partial: bool, dy: float = 1.0, lengths: tuple[float, ...] = (11.0, 12.0, 13.0)) -> Fronts:
    """Grow the front until its mean has passed some lengths."""
    criterion = fx.Fatigue(GIc=5.0, paris=LAW, partial=partial)
    scene, bond = make_scene(A0, None, DX, dy, 2, length=24.0, width=WIDTH, criterion=criterion)
    shapes: list[tuple[Array, Array, Array]] = []

    def look(event: str, row: Row) -> None:
        if len(shapes) < len(lengths) and float(row["a[bond]"]) >= lengths[len(shapes)] - 1e-9:
            shapes.append(front(scene))

    end = fx.CrackLength(bond, lengths[-1])
    history = scene.run(
        fx.Cycles(maximum=0.3, ratio=0.1, until=end), observers=[look], progress=False
    )
    if len(shapes) < len(lengths):
        shapes.append(front(scene))  # where it has arrested
    scene.close()
    z, _, rates = shapes[-1]
    return Fronts(z, np.array([x for _, x, _ in shapes]), rates, history)


def front(scene: fx.Scene) -> tuple[Array, Array, Array]:
    """Places across the width, how far the front has come there, and its G."""
    (line,) = fx.front_lines(scene, "bond")
    passed = scene.fatigue.ligaments[0].part[line.node] * DX
    x, z = line.x[:, 0] + passed, line.x[:, 2]
    rates = line.values["GI"]
    # a column that is a node ahead has nodes at its flanks as well: the foremost one counts
    places = np.unique(np.round(z, 6))
    first = [int(np.flatnonzero(np.abs(z - k) < 1e-5)[x[np.abs(z - k) < 1e-5].argmax()])
             for k in places]  # fmt: skip
    return places, x[first], rates[first]


def spread(found: Fronts) -> float:
    """Largest difference of G along the front away from its ends, over the mean there."""
    inside = found.rates[1:-1]
    return float(np.ptp(inside) / inside.mean())


def main(out: Path, fine: bool = False) -> None:
    """Print cycles and G along the front, draw the fronts."""
    both = {name: run(name == "partial", 0.5 if fine else 1.0) for name in ("partial", "by node")}
    rows: list[list[Any]] = []
    for name, found in both.items():
        file = out / f"fatigue_front_{name.replace(' ', '_')}"
        growth = fx.plots.tip_growth(found.history, "bond")
        found.history.to_csv(file.with_suffix(".csv"))
        fx.plots.paris(found.history, file.with_suffix(".png"), "bond")
        last = found.history.rows[-1]
        rows.append(
            [name, float(last["N"]), float(last["a[bond]"]), float(np.ptp(found.x[-1])),
             spread(found), float(len(growth.N)), found.history.reason.partition(":")[0]]
        )  # fmt: skip
    table(
        "Front of a DCB under fatigue",
        ["growth", "cycles", "a", "bow", "G: (max - min)/mean", "tips in the table", "end"],
        rows,
    )

    def draw() -> Figure:
        figure, ax = new_figure()
        for (name, found), colour in zip(both.items(), COLOURS, strict=False):
            for i, x in enumerate(found.x):
                ax.plot(found.z, x, color=colour, marker=".", label=None if i else name)
        dress(ax, xlabel="z / mm", ylabel="front / mm")
        legend(ax)
        return figure

    save(MPI.COMM_WORLD, out / "fatigue_front.png", draw)


if __name__ == "__main__":
    main(*arguments(__doc__, "out/fatigue_front"))
