# # Mixed-mode bending: the BK law
#
# A lever of length c on a beam of half span L turns one force P into P c/L upwards at the cracked
# end and P (c + L)/L downwards at mid-span: the longer the lever, the more mode I. Both forces
# follow one load factor; the path is followed through its load drop at f = 1.
#
#     f = (G_I + G_II)/(G_Ic + (G_IIc - G_Ic) (G_II/(G_I + G_II))^eta)
"""Mixed-mode bending at three mixities against the formulas of ASTM D6671."""

from __future__ import annotations

from pathlib import Path

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.mmb import mmb_2d

HALF_SPAN = 50.0
LEVERS = (30.0, 42.0, 80.0)
BEAM = CorrectedBeam(E=139.4e3, E22=10.16e3, G=4.6e3, h=1.5, b=25.0)
ARMS = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
)
CRITERION = fx.VCCT(GIc=0.1703, GIIc=0.494, mix=fx.BK(eta=1.62))


def run(lever: float, dx: float = 0.25, ny: int = 8) -> tuple[fx.Scene, list[list[float]]]:
    """Grow from 25 to 45 mm; rows of a, P, G_I and G_II, each beside the beam's at the same P."""
    mesh = mmb_2d(half_span=HALF_SPAN, height=1.5, dx=dx, ny=ny)
    bond = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: x[0] >= 25.0 - 1e-9,
        contact=True,
        name="bond",
    )
    scene = fx.Scene(
        mesh,
        materials=ARMS,
        model=fx.PlaneStress(thickness=25.0),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
        ],
        loads=[
            fx.PointForce("lever_end", (0.0, lever / HALF_SPAN)),
            fx.PointForce("load", (0.0, -(lever + HALF_SPAN) / HALF_SPAN)),
        ],
        debonds=[fx.Debond(bond, CRITERION)],
    )
    history = scene.run(fx.Static(until=fx.CrackLength(bond, 45.0), stepping="path"))
    rows = []
    for a in (25.0, 35.0, 44.0):
        row = history.at("a[bond]", a, event="onset")
        load = row["F[load]"]
        one, two = BEAM.mmb_rates(row["a[bond]"], load, lever, HALF_SPAN)
        rows.append([row["a[bond]"], load, row["GI[bond]"], one, row["GII[bond]"], two])
    return scene, rows


def main(out: Path, fine: bool = False) -> None:
    """Run three levers, print the table, write histories and a plot of each."""
    rows = []
    for lever in LEVERS:
        scene, found = run(lever, *((0.125, 16) if fine else (0.25, 8)))
        rows += [[lever, *row] for row in found]
        scene.history.to_csv(out / f"mmb_{lever:.0f}.csv")
        scene.history.plot(
            out / f"load_displacement_{lever:.0f}.png",
            x="v[lever_end]",
            y="F[load]",
            xlabel="work-conjugate displacement of the lever end / mm",
            ylabel="lever force P / N",
        )
        scene.close()
    table(
        "Mixed-mode bending beside ASTM D6671 at the same load",
        ["c / mm", "a / mm", "P / N", "G_I", "ASTM G_I", "G_II", "ASTM G_II"],
        rows,
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/mmb"))
