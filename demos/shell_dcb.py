# # Double cantilever beam: continuum shells beside solid cells
#
# The carbon-fibre specimen of NASA/TM-2008-215123 in 3-D, cracked to 30 mm, at an opening of
# 1 mm. One continuum shell per arm bends without locking, so that its cells may be several times
# as long as the arm is high; solid cells of the same size are too stiff. Fine solids of second
# order are the reference for the load at this opening and for G across the width.
#
# Then arms of plies at 0 and 90 degrees: one continuum shell holds all plies of an arm where
# solids need a layer of cells for each.
"""Load and G of a double cantilever beam with continuum shells and with solids, and their cost."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from mpi4py import MPI

import fxcrack as fx
from fxcrack.base import compat
from fxcrack.demos.show import arguments, table
from fxcrack.mesh import Group
from fxcrack.meshes.dcb import dcb_3d

LENGTH, HEIGHT, WIDTH, A0 = 100.0, 1.5, 25.0, 30.0
PLY = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
)
UNIDIRECTIONAL = fx.Laminate([0.0], PLY, HEIGHT)
CROSS_PLY = fx.Laminate("[0/90]s", PLY, HEIGHT / 4)
UPWARDS = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0))  # x along the beam, plies stacked along y
STRIPS = 10  # of the width, over which G is averaged


@dataclass(frozen=True)
class Model:
    """Cells of one model.

    Attributes:
        shells: Continuum shells, one per arm, or solids.
        dx: Length of the cells at the front.
        dy: Their width.
        ny: Cells over an arm.
        order: 1 or 2.
        coarse: Length of the cells far from the front.
    """

    shells: bool
    dx: float
    dy: float
    ny: int = 1
    order: int = 2
    coarse: float = 5.0

    @property
    def title(self) -> str:
        """In words."""
        if self.shells:
            return f"continuum shells, {self.dx:g} long"
        return f"solids of order {self.order}, {self.ny} per arm, {self.dx:g} long"


REFERENCE = Model(False, 1.0, 2.5, ny=2, coarse=1.5)
FINE_REFERENCE = Model(False, 0.5, 1.25, ny=2, coarse=1.5)
MODELS = (
    Model(True, 5.0, 2.5, coarse=10.0),
    Model(True, 5.0, 2.5),
    Model(True, 2.5, 2.5),
    Model(False, 5.0, 2.5),
    Model(False, 2.5, 2.5),
    Model(False, 1.0, 2.5, ny=2, order=1),
    Model(False, 0.5, 2.5, ny=4, order=1),
)


def materials(mesh: fx.Mesh, model: Model, arm: fx.Laminate) -> dict[str, Any]:
    """Continuum shells, or solids with cells of their own for each ply."""
    if model.shells:
        return {
            "upper": fx.ContinuumShell(arm, bottom="upper_face", top="top", axis=(1, 0, 0)),
            "lower": fx.ContinuumShell(arm, bottom="bottom", top="lower_face", axis=(1, 0, 0)),
        }
    centres = mesh.domain.geometry.x[compat.geometry_dofmap(mesh.domain)].mean(axis=1)[:, 1]
    found: dict[str, Any] = {}
    for name, middle in (("upper", 0.5 * HEIGHT), ("lower", -0.5 * HEIGHT)):
        stack = fx.Laminate(arm.plies, frame=UPWARDS).layers(name)
        ends = arm.interfaces(middle)
        for group, low, high in zip(stack, ends, ends[1:], strict=False):
            cells = np.flatnonzero((centres > low) & (centres < high)).astype(np.int32)
            mesh.groups[group] = Group(3, cells)
        found |= stack
    return found


def solve(model: Model, arm: fx.Laminate = UNIDIRECTIONAL) -> dict[str, Any]:
    """Load, G of each strip of the width, unknowns and seconds without compilation."""
    mesh = dcb_3d(
        length=LENGTH,
        height=HEIGHT,
        width=WIDTH,
        dx=model.dx,
        dy=model.dy,
        ny=model.ny,
        order=model.order,
        fine=(A0 - 10.0, A0 + 10.0) if model.dx >= 5.0 else (A0 - 5.0, A0 + 5.0),
        coarse_dx=model.coarse,
    )
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= A0 - 1e-6, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials=materials(mesh, model, arm),
        model=fx.Solid(),
        supports=[
            fx.Displacement("pin_top", y=0.5),
            fx.Displacement("pin_bottom", y=-0.5),
            fx.Displacement("far_upper", x=0.0, z=0.0),
            fx.Displacement("far_lower", x=0.0, y=0.0, z=0.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1.0e3))],  # no growth: G is looked at
    )
    scene.run(fx.Static(until=fx.Time(1.0)))
    seconds = scene.history.details["seconds"]
    found = {
        "load": scene.history.rows[-1]["R[pin_top.y]"],
        "rates": across_the_width(scene),
        "unknowns": scene.continuum.n_global,
        "seconds": sum(s for phase, s in seconds.items() if phase != "compile"),
    }
    scene.close()
    return found


def across_the_width(scene: fx.Scene) -> np.ndarray:
    """Mean G of each strip of the width: a front node counts half on either side of it."""
    crack = scene.cracks[0]
    values = crack.evaluate(crack.tips(), scene.solver.state, scene.time)
    z = scene.pairs[0].surface.x[values.tips.node, 2] / WIDTH * STRIPS
    share = 0.5 * values.report["GI"] * values.tips.width / (WIDTH / STRIPS)
    out = np.zeros(STRIPS)
    for side in (-1e-6, 1e-6):
        np.add.at(out, np.clip(np.floor(z + side), 0, STRIPS - 1).astype(int), share)
    return out


def beside(found: dict[str, Any], reference: dict[str, Any]) -> tuple[float, float, float]:
    """Errors: load at the opening, G at one load (mean), G at one load (worst strip)."""
    load = found["load"] / reference["load"] - 1.0
    rates = found["rates"] / found["load"] ** 2
    exact = reference["rates"] / reference["load"] ** 2
    return load, rates.mean() / exact.mean() - 1.0, float(np.abs(rates / exact - 1.0).max())


def picture(
    out: Path, results: list[tuple[Model, dict[str, Any], tuple[float, float, float]]]
) -> None:
    """Error of the load against unknowns and against seconds."""
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.0), sharey=True, layout="constrained")
    kinds = (
        ("continuum shells, one per arm", "o", lambda m: m.shells),
        ("solids, order 2", "s", lambda m: not m.shells and m.order == 2),
        ("solids, order 1", "^", lambda m: not m.shells and m.order == 1),
    )
    for axis, key, label in zip(
        axes, ("unknowns", "seconds"), ("unknowns", "seconds without compilation"), strict=True
    ):
        for name, marker, belongs in kinds:
            chosen = sorted((r for r in results if belongs(r[0])), key=lambda r: r[1]["unknowns"])
            axis.loglog(
                [r[1][key] for r in chosen], [100 * abs(r[2][0]) for r in chosen], f"{marker}-",
                label=name,
            )  # fmt: skip
            for m, r, errors in chosen:
                axis.annotate(
                    f"{m.dx:g}", (r[key], 100 * abs(errors[0])), textcoords="offset points",
                    xytext=(5, 4), fontsize=8,
                )  # fmt: skip
        axis.set_xlabel(label)
        axis.margins(0.15)
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:,g}"))
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axis.grid(alpha=0.3, which="both")
    axes[0].set_ylabel("error of the load at an opening of 1 mm / %")
    axes[1].legend(fontsize=8)
    figure.suptitle("DCB, arms of 1.5 mm: the numbers are lengths of cells in mm", fontsize=10)
    figure.savefig(out / "shell_dcb.png", dpi=150)
    plt.close(figure)


def main(out: Path, fine: bool = False) -> None:
    """Solve all models, print the tables, draw the picture."""
    out.mkdir(parents=True, exist_ok=True)
    best = FINE_REFERENCE if fine else REFERENCE
    reference = solve(best)
    results = []
    for model in MODELS:
        found = solve(model)
        results.append((model, found, beside(found, reference)))
    rows: list[list[float | str]] = [
        [best.title, reference["unknowns"], reference["seconds"], reference["load"], "", "", ""]
    ]
    for model, found, errors in results:
        numbers = [found["unknowns"], found["seconds"], found["load"]]
        rows.append([model.title, *numbers, *(f"{100 * e:.2f} %" for e in errors)])
    head = ["model", "unknowns", "seconds", "P / N", "P", "G at one load", "G, worst strip"]
    table("DCB of 25 x 3 mm at an opening of 1 mm, beside the first line", head, rows)
    if MPI.COMM_WORLD.rank == 0:
        picture(out, results)
    plies = Model(False, 1.0, 2.5, ny=4, coarse=2.5)
    reference = solve(plies, CROSS_PLY)
    found = solve(Model(True, 5.0, 2.5), CROSS_PLY)
    errors = [f"{100 * e:.2f} %" for e in beside(found, reference)]
    table(
        "Arms [0/90/90/0]: one continuum shell per arm beside a layer of solids for each ply",
        head,
        [
            [
                plies.title,
                reference["unknowns"],
                reference["seconds"],
                reference["load"],
                *[""] * 3,
            ],
            [
                "continuum shells, 5 long",
                found["unknowns"],
                found["seconds"],
                found["load"],
                *errors,
            ],
        ],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/shell_dcb"))
