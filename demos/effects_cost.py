# # What each effect costs
#
# One specimen, a double cantilever beam that grows its crack by a few millimetres, from the bare
# linear scene upwards: each rung names one effect more. An effect that is not named has no form
# term, no unknown and no second in the table. A second table has the same beam as solids, continuum
# shells and shells. Units N, mm, MPa.
"""The ladder of cost: a bare linear scene, then one effect after the other."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from mpi4py import MPI

import fxcrack as fx
from fxcrack.accuracy.bending import strip_dcb
from fxcrack.accuracy.study import Setting
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


# ## The bodies
#
# The same beam as a strip in 3-D, under a unit load: solids, continuum shells and shells, at small
# strain and at large rotation.
BODIES = (
    Setting(size=2.5, order=1, cell="hexahedron"),
    Setting(size=2.5, order=2, cell="hexahedron"),
    Setting(size=2.5, order=1, cell="continuum shell"),
    Setting(size=2.5, order=2, cell="continuum shell"),
    Setting(size=2.5, order=1, cell="shell"),
    Setting(size=2.5, order=2, cell="shell"),
)


def run_bodies() -> list[tuple[str, int, float, float]]:
    """Kind of cells, unknowns, seconds of the linear scene and of the one with large rotation."""
    out = []
    for setting in BODIES:
        seconds = []
        unknowns = 0
        for effects in ([], [fx.FiniteStrain()]):
            for _ in ("forms are compiled", "counted"):
                case = strip_dcb(setting)
                scene = case.scene.rebuilt(effects=effects)
                start = time.perf_counter()
                scene.run(fx.Static(until=fx.Time(1.0), initial=1.0), progress=False)
                took = time.perf_counter() - start
                unknowns = scene.continuum.n_global
                scene.close()
                case.scene.close()
            seconds.append(took)
        out.append((setting.title, unknowns, *seconds))
    return out


def main(out: Path, fine: bool = False) -> None:
    """The tables and the picture."""
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

    table(
        "Seconds of one strip as solids and shells, cells of 2.5 mm",
        ["cells", "unknowns", "s, small strain", "s, large rotation"],
        [[name, f"{n:,}", *took] for name, n, *took in run_bodies()],
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
