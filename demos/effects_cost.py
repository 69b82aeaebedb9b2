# # What each effect costs
#
# One specimen, a double cantilever beam that grows its crack by a few millimetres, from the bare
# linear scene upwards: each rung names one effect more. An effect that is not named has no form
# term, no unknown and no second in the table. Units N, mm, MPa.
"""The ladder of cost: a bare linear scene, then one effect after the other."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.output.explain import explain
from fxcrack.output.plots.style import COLOURS, dress, new_figure, save

ELASTIC = fx.Isotropic(70e3, 0.3, expansion=1e-5)

# ## The rungs
#
# Name, material, what the interface says, what the scene says.
RUNGS: list[tuple[str, Any, dict[str, Any], dict[str, Any]]] = [
    ("bare", ELASTIC, {}, {}),
    ("contact", ELASTIC, {"contact": True}, {}),
    ("friction", ELASTIC, {"contact": True, "friction": 0.3}, {}),
    ("temperature", ELASTIC, {}, {"effects": [fx.Temperature(1.0)]}),
    ("nonlinear solver", ELASTIC, {}, {"solver": "newton"}),
    ("finite strain", ELASTIC, {}, {"effects": [fx.FiniteStrain()]}),
    ("plasticity", fx.Plastic(70e3, 0.3, yield_stress=60.0, hardening=1e3), {}, {}),
]


def run(dx: float = 0.5, ny: int = 4, until: float = 33.0) -> list[tuple[str, float, Any]]:
    """Name, seconds and explanation of each rung; forms are compiled in a run before."""
    out = []
    for name, material, interface, more in RUNGS:
        for counted in (False, True):
            bond = fx.Interface(
                slave="upper_face",
                master="lower_face",
                bonded=lambda x: x[0] >= 30.0 - 1e-9,
                name="bond",
                **interface,
            )
            scene = fx.Scene(
                dcb_2d(dx=dx, ny=ny),
                materials=material,
                model=fx.PlaneStrain(),
                supports=[
                    fx.Displacement("pin_top", x=0.0, y=1.0),
                    fx.Displacement("pin_bottom", x=0.0, y=-1.0),
                ],
                debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2))],
                **more,
            )
            start = time.perf_counter()
            length = until if counted else 30.0 + 2.0 * dx
            scene.run(fx.Static(until=fx.CrackLength(bond, length)), progress=False)
            if counted:
                out.append((name, time.perf_counter() - start, explain(scene)))
            scene.close()
    return out


def main(out: Path, fine: bool = False) -> None:
    """The table and the picture."""
    ladder = run(0.25, 8) if fine else run()
    bare = ladder[0][1]
    rows = [
        [
            name,
            seconds,
            seconds / bare,
            found.solver,
            str(found.counts["form terms"]),
            str(found.counts["factorisations"]),
            str(found.unknowns["retained jumps"]),
        ]
        for name, seconds, found in ladder
    ]
    table(
        "Seconds of one specimen with one effect more",
        ["effect", "s", "over bare", "solver", "form terms", "factorisations", "jumps"],
        rows,
    )

    def draw() -> Figure:
        figure, axes = new_figure()
        places = range(len(ladder), 0, -1)
        axes.barh(places, [s for _, s, _ in ladder], color=COLOURS[0], height=0.6)
        dress(axes, xlabel="seconds", ylabel="")
        axes.set_yticks(places, [name for name, _, _ in ladder])
        axes.set_xscale("log")
        return figure

    save(MPI.COMM_WORLD, out / "ladder.png", draw)


if __name__ == "__main__":
    main(*arguments(__doc__, "out/effects_cost"))
