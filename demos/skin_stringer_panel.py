# # Skin and stringer: a debond under the foot grows after buckling
#
# A panel of carbon-epoxy, 160 mm long and 100 mm wide, compressed along its stringer. The foot of
# the stringer has come off the skin over the middle 64 mm. The skin buckles; it opens
# the debond, which grows along the stringer. One continuum shell lies across the skin, one across
# the foot and one across half the web, each with all its plies; rotations are large. The web stands
# on the foot by an interface that stays bonded. A quarter is modelled.
#
# What must hold: the load is that of the flat panel until the skin buckles and falls below it then,
# the debond does not open before, and cells of first and of second order agree.
# Units N, mm. Printed and drawn: load and debonded length against shortening, the panel, and the
# front seen from above.
"""Compression of a stiffened panel through buckling, with a debond between skin and stringer."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.mesh import Mesh
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.output import plots

HALF_LENGTH, HALF_WIDTH, FOOT, HEIGHT = 80.0, 50.0, 16.0, 16.0
DEBONDED = 32.0
PLY = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
)
SKIN = fx.Laminate("[0/90]s", PLY, 0.25)
WEB = fx.Laminate("[0/90/0/0]", PLY, 0.25)  # half of it: the middle is the first ply's bottom
SHORTENING = 0.4
"""Of half the panel, at the end."""
SIDEWAYS = -2e-4
"""Pressure under the skin at the end, which decides to which side it buckles."""


@dataclass(frozen=True)
class Cells:
    """How finely the panel is divided.

    Attributes:
        order: Of the displacement.
        along: Length of the cells.
        foot: Cells across half the foot.
        bay: Cells across the skin beside it.
    """

    order: int
    along: float
    foot: int
    bay: int


FIRST = Cells(order=1, along=4.0, foot=5, bay=8)
SECOND = Cells(order=2, along=8.0, foot=3, bay=4)


def panel_mesh(cells: Cells, comm: MPI.Intracomm = MPI.COMM_WORLD) -> Mesh:
    """A quarter of the panel: x along the stringer, y across it, z upwards from the skin."""
    x = np.linspace(0.0, HALF_LENGTH, round(HALF_LENGTH / cells.along) + 1)
    under = np.linspace(0.0, FOOT, cells.foot + 1)
    y = np.concatenate([under, np.linspace(FOOT, HALF_WIDTH, cells.bay + 1)[1:]])
    t, half = SKIN.thickness, WEB.thickness

    def make() -> Blocks:
        model = Blocks()
        z = np.array([0.0, t])
        skin = model.add("skin", (x, y, z - t), "hexahedron", cells.order)
        foot = model.add("foot", (x, under, z), "hexahedron", cells.order)
        high = np.linspace(t, t + HEIGHT, max(2, cells.foot - 1) + 1)
        web = model.add("web", (x, np.array([0.0, half]), high), "hexahedron", cells.order)
        model.group("skin_outside", skin.part(z=-t))
        model.group("skin_bond", skin.part(z=0.0))
        model.group("foot_bond", foot.part(z=0.0))
        model.group("foot_top", foot.part(z=t))
        model.group("web_base", web.part(z=t))
        model.group("web_middle", web.part(y=0.0))
        model.group("web_side", web.part(y=half))
        parts = (skin, foot, web)
        model.group("middle", *(p.part(x=0.0) for p in parts))
        model.group("end", *(p.part(x=HALF_LENGTH) for p in parts))
        model.group("symmetry", *(p.part(y=0.0) for p in parts))
        model.group("edge", skin.part(y=HALF_WIDTH, z=-t))
        model.group("centre", skin.part(x=0.0, y=0.0, z=-t))
        model.group("bay", skin.part(x=0.0, y=HALF_WIDTH, z=-t))
        return model

    return build(comm, "panel", make)


def panel(cells: Cells, *, growing: bool = True, comm: MPI.Intracomm = MPI.COMM_WORLD) -> fx.Scene:
    """The panel, shortened in proportion to the time."""
    along = (1.0, 0.0, 0.0)
    debond = fx.Interface(
        slave="foot_bond",
        master="skin_bond",
        bonded=lambda x: x[0] >= DEBONDED - 1e-9,
        name="bond",
    )
    joint = fx.Interface(
        slave="web_base",
        master="foot_top",
        bonded=lambda x: np.full(x.shape[1], True),
        name="joint",
    )
    toughness = {"GIc": 0.25, "GIIc": 0.8} if growing else {"GIc": 1e6, "GIIc": 1e6}
    return fx.Scene(
        panel_mesh(cells, comm),
        model=fx.Solid(),
        materials={
            "skin": fx.ContinuumShell(SKIN, "skin_outside", "skin_bond", axis=along),
            "foot": fx.ContinuumShell(SKIN, "foot_bond", "foot_top", axis=along),
            "web": fx.ContinuumShell(WEB, "web_middle", "web_side", axis=along),
        },
        supports=[
            fx.Displacement("middle", x=0.0),
            fx.Displacement("symmetry", y=0.0),
            fx.Displacement("edge", z=0.0),
            fx.Displacement("end", x=-SHORTENING, z=0.0),
        ],
        loads=[fx.Pressure("skin_outside", SIDEWAYS)],
        debonds=[fx.Debond(debond, fx.VCCT(**toughness, mix=fx.BK(2.0)))],
        bonds=[joint],
        monitors=[fx.Monitor("centre", (0, 0, 1), name="w")],
        effects=[fx.FiniteStrain()],
    )


def run(cells: Cells, *, growing: bool = True, until: float = 0.6) -> tuple[fx.Scene, float]:
    """Compress the panel; the scene after it, and seconds."""
    scene = panel(cells, growing=growing)
    start = time.perf_counter()
    scene.run(fx.Static(until=fx.Time(until), maximum=0.05), progress=False)
    return scene, time.perf_counter() - start


def flat_load(shortening: float) -> float:
    """Load of the panel that stays flat, by the stiffness of its laminates along x."""
    areas = ((SKIN, HALF_WIDTH), (SKIN, FOOT), (WEB, HEIGHT))
    stiffness = 0.0
    for laminate, width in areas:
        a = laminate.abd()[:3, :3]
        stiffness += width * (a[0, 0] - a[0, 1] ** 2 / a[1, 1])
    return stiffness * shortening / HALF_LENGTH


def at(history: fx.History, column: str, moment: float) -> float:
    """A column at a time between increments."""
    return float(np.interp(moment, history["time"].astype(float), history[column].astype(float)))


def main(out: Path, fine: bool = False) -> None:
    """The growing debond; beside it one that is held, and with --fine second-order cells."""
    scene, seconds = run(FIRST)
    held, more = run(FIRST, growing=False)
    others = [("first order, held", held.history, more)]
    if fine:
        second, most = run(SECOND, growing=False, until=0.4)
        others.append(("second order, held", second.history, most))
    rows = []
    for name, history, taken in [("first order, growing", scene.history, seconds), *others]:
        for moment in (0.15, 0.3, 0.4):
            load = -at(history, "R[end.x]", moment)
            rows.append(
                [
                    *(name, SHORTENING * moment, load / 1e3),
                    load / flat_load(SHORTENING * moment),
                    at(history, "m[w]", moment),
                    at(history, "area[bond]", moment) / FOOT,
                    taken,
                ]
            )
    table(
        "A quarter of the panel",
        ["cells", "shortening", "load / kN", "/ flat", "w centre", "debonded", "s in all"],
        rows,
    )
    out.mkdir(parents=True, exist_ok=True)
    grown, still = scene.history, held.history
    scene.history.plot(
        out / "skin_stringer_panel_load.png",
        x=SHORTENING * grown["time"].astype(float),
        y=-grown["R[end.x]"].astype(float) / 1e3,
        xlabel="shortening of half the panel / mm",
        ylabel="load of a quarter / kN",
        label="growing debond",
        reference=[
            (
                "no growth",
                SHORTENING * still["time"].astype(float),
                -still["R[end.x]"].astype(float) / 1e3,
            ),
            ("stays flat", np.array([0.0, 0.16]), np.array([0.0, flat_load(0.16)]) / 1e3),
        ],
    )
    plots.front_advance(
        scene, out / "skin_stringer_panel_front.png", "bond", colour="time",
        label="part of the shortening", title="Debond under half the foot",
    )  # fmt: skip
    plots.deformed(
        scene, out / "skin_stringer_panel.png", component="xx", label="stress xx / MPa",
        title="A quarter of the panel", view=(-60.0, 25.0),
    )  # fmt: skip
    for each in (scene, held):
        each.close()


if __name__ == "__main__":
    main(*arguments(__doc__, "out/skin_stringer_panel"))
