# # What accuracy costs in time
#
# The five studies that come with fxcrack, and one of our own: the double cantilever beam in 3-D, as
# `fxcrack accuracy demos/accuracy.py:dcb3d` runs it. Each study solves one problem in a family of
# discretisations, from cheap to dear until its budget is spent, counts errors from a closed form
# where one is exact and else from the limit of its own finest runs, and ends with advice.
#
# A study of one's own is a function that takes a `Setting` and returns a `Case`: the scene in that
# discretisation, the step, and how to read load, G and crack length off the history.
"""Accuracy against time: every number and picture of docs/howto/accuracy.md, computed anew."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from mpi4py import MPI
from rich.console import Console

import fxcrack as fx
from fxcrack.accuracy import Case, Measured, Setting, report, study
from fxcrack.accuracy.run_study import run_study
from fxcrack.demos.dcb import ARMS, BEAM, G_IC
from fxcrack.demos.show import arguments
from fxcrack.meshes.dcb import dcb_3d

BUDGETS = {
    "dcb": 45.0,
    "enf": 30.0,
    "mmb": 30.0,
    "penny": 35.0,
    "fatigue_dcb": 30.0,
    "fxcrack.demos.accuracy:dcb3d": 85.0,
}
PICTURES = {
    "dcb": ("error", "cost"),
    "penny": ("error",),
    "fxcrack.demos.accuracy:dcb3d": ("error", "cost"),
}


def possible(setting: Setting) -> bool:
    """Second-order tetrahedra are refused on interfaces."""
    return setting.cell == "hexahedron" or setting.order == 1


@study(
    sizes=(2.0, 1.0, 0.5, 0.25),
    cells=("hexahedron", "tetrahedron"),
    methods=("vcct",),
    ranks=(1, 2),
    admits=possible,
    title="DCB of carbon fibre in 3-D, straight front at a = 30 mm",
    unit="mm",
)
def dcb3d(setting: Setting) -> Case:
    """Mean of G over the width at a load of 50 N, and the load at which it is critical."""
    h = setting.size
    mesh = dcb_3d(
        length=80.0, width=25.0, height=BEAM.h, dx=h, dy=2.5 * h, ny=max(1, round(BEAM.h / h)),
        fine=(28.0, 32.0), coarse_dx=4.0 * h, cell=setting.cell, order=setting.order,
    )  # fmt: skip
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= 30.0 - 1e-6, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials=ARMS,
        model=fx.Solid(),
        supports=[
            fx.Displacement("pin_top", y=1.0),
            fx.Displacement("pin_bottom", y=-1.0),
            fx.Displacement("far_upper", x=0.0, y=0.0, z=0.0),
            fx.Displacement("far_lower", x=0.0, y=0.0, z=0.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IC, **setting.rate_options()))],
        options=setting.options(),
    )

    def measure(history: fx.History) -> Measured:
        growth = scene.cracks[0]
        values = growth.evaluate(growth.tips(), scene.solver.state, scene.time)
        width = values.tips.width
        mean = float(values.report["GI"] @ width / width.sum())
        load = float(history.rows[-1]["R[pin_top.y]"])
        return Measured(load=load * float(np.sqrt(G_IC / mean)), G=mean * (50.0 / load) ** 2)

    # nothing grows before that time; the length says how little of the bond is retained
    return Case(scene, fx.Static(until=(fx.Time(0.5), fx.CrackLength(bond, 30.1))), measure)


def main(out: Path, fine: bool = False) -> None:
    """Run the studies; twice the budget where a finer look is asked for."""
    if MPI.COMM_WORLD.size > 1:
        raise fx.InputError("this demo starts processes of its own; call it without mpirun")
    console = Console(width=118, highlight=False)
    results = []
    for scene, budget in BUDGETS.items():
        result = run_study(scene, budget=2.0 * budget if fine else budget, tell=console.print)
        report.show(result, console)
        name = scene.rpartition(":")[2]
        report.write(result, out / name)
        for kind in PICTURES.get(scene, ()):
            shutil.copyfile(out / name / f"{kind}.png", out / f"accuracy_{name}_{kind}.png")
        results.append(result)
    (out / "README.md").write_text(report.summary(results), encoding="utf-8")
    console.print(f"pictures accuracy_*.png and their tables (README.md) are in {out}")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/accuracy"))
