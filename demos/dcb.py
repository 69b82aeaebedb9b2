# # Double cantilever beam: the main job
#
# Two composite arms, bonded beyond a0 = 30 mm, are pulled apart until the crack has run 15 mm.
# Specimen: T300/1076 [0]24 of NASA/TM-2008-215123, in plane strain. Units N, mm, MPa.
#
# Corrected beam theory says
#
#     P = sqrt(Gc b E I)/(a + chi h),      opening = 2 P (a + chi h)^3/(3 E I).
#
# The whole propagation costs one factorisation, which is counted at the end.
"""Double cantilever beam in 2-D against corrected beam theory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d

G_IC = 0.1703
BEAM = CorrectedBeam(E=139.4e3, E22=10.16e3, G=4.6e3, h=1.5, b=25.0)
ARMS = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
)


def make_scene(dx: float = 0.25, ny: int = 8) -> tuple[fx.Scene, fx.Interface]:
    """The specimen with elements dx long and ny over the height of an arm."""
    mesh = dcb_2d(length=100.0, height=1.5, dx=dx, ny=ny)
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= 30.0 - 1e-9, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials=ARMS,
        model=fx.PlaneStrain(thickness=25.0),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IC))],
    )
    return scene, bond


def run(dx: float = 0.25, ny: int = 8, until: float = 45.0) -> tuple[fx.Scene, list[list[float]]]:
    """Grow the crack; rows of a, opening, load, load and opening of beam theory."""
    scene, bond = make_scene(dx, ny)
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until + dx)))
    rows = []
    for a in np.arange(30.0, until + 1e-9, 5.0):
        row = history.at("a[bond]", a, event="onset")
        load = BEAM.dcb_load(row["a[bond]"], G_IC)
        opening = BEAM.dcb_opening(row["a[bond]"], load)
        rows.append([row["a[bond]"], 2.0 * row["u[pin_top.y]"], row["R[pin_top.y]"], opening, load])
    return scene, rows


def main(out: Path, fine: bool = False) -> None:
    """Run, print the table, write plots, history and fields."""
    scene, rows = run(*((0.125, 16) if fine else (0.25, 8)))
    history = scene.history
    table(
        "Double cantilever beam beside corrected beam theory (CBT)",
        ["a / mm", "opening / mm", "load / N", "CBT opening", "CBT load", "load / CBT"],
        [[*row, row[2] / row[4]] for row in rows],
    )
    a = np.linspace(30.0, 45.0, 60)
    load = BEAM.dcb_load(a, G_IC)
    theory = [("corrected beam theory", 0.5 * BEAM.dcb_opening(a, load), load)]
    history.to_csv(out / "dcb.csv")
    history.to_json(out / "dcb.json")
    history.plot(
        out / "load_opening.png",
        x="u[pin_top.y]",
        y="R[pin_top.y]",
        xlabel="half opening u / mm",
        ylabel="load P / N",
        reference=theory,
    )
    fx.plots.r_curve(history, out / "r_curve.png", "bond", toughness=G_IC)
    fx.plots.deformed(scene, out / "deformed.png")
    fx.write_fields(scene, out / "dcb.pvd")
    if MPI.COMM_WORLD.rank == 0:
        d = history.details
        print(f"{d['releases']} releases, {d['factorizations']} factorisation(s), files in {out}")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/dcb"))
