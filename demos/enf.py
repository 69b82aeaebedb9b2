# # End-notched flexure: mode II with contact
#
# A beam with a crack from its left end is bent by a force at mid-span. The cracked arms slide on
# each other: without contact the upper arm would sink into the lower one. IM7/8552, units N, mm.
#
#     G_II = 9 P^2 (a + 0.42 chi h)^2/(16 b^2 E h^3)
#
# Under a prescribed deflection growth is stable only for a > 0.693 L, so the load factor is
# followed along the equilibrium path f = 1 ("path" stepping).
"""End-notched flexure specimen with contact of the crack faces."""

from __future__ import annotations

from pathlib import Path

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.enf import enf_2d

G_IIC = 0.774
BEAM = CorrectedBeam(E=161e3, E22=11.38e3, G=5.2e3, h=2.25, b=25.4)
ARMS = fx.Orthotropic(E=(161e3, 11.38e3, 11.38e3), nu=(0.32, 0.32, 0.45), G=(5.2e3, 5.2e3, 3.9e3))


def run(
    dx: float = 0.25, ny: int = 8, until: float = 45.0, *, contact: bool = True
) -> tuple[fx.Scene, list[list[float]]]:
    """Grow the crack from 35 mm; rows of a, deflection, load, load of beam theory, G_II."""
    # the first bonded node lies at 35 mm: the step divides both 35 and the half span of 50 mm
    mesh = enf_2d(half_span=50.0, height=2.25, dx=dx, ny=ny)
    bond = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: x[0] >= 35.0 - 1e-9,
        contact=contact,
        name="bond",
    )
    scene = fx.Scene(
        mesh,
        materials=ARMS,
        model=fx.PlaneStress(thickness=25.4),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
            fx.Displacement("load", y=-1.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IIC))],
    )
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until + dx), stepping="path"))
    rows = []
    for a in (35.0, 40.0, until):
        row = history.at("a[bond]", a, event="onset")
        theory = BEAM.enf_load(row["a[bond]"], G_IIC)
        rate = BEAM.enf_rate(row["a[bond]"], row["R[load.y]"])
        rows.append(
            [row["a[bond]"], -row["u[load.y]"], -row["R[load.y]"], theory, row["GII[bond]"], rate]
        )
    return scene, rows


def main(out: Path, fine: bool = False) -> None:
    """Run, print the table, write plots and history."""
    scene, rows = run(*((0.125, 16) if fine else (0.25, 8)))
    table(
        "End-notched flexure beside corrected beam theory (CBT)",
        ["a / mm", "deflection / mm", "load / N", "CBT load", "G_II", "CBT G_II at this load"],
        rows,
    )
    scene.history.to_csv(out / "enf.csv")
    scene.history.plot(
        out / "load_deflection.png",
        x="u[load.y]",
        y="R[load.y]",
        xlabel="deflection / mm",
        ylabel="load / N",
    )
    fx.plots.deformed(scene, out / "deformed.png")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/enf"))
