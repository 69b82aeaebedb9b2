# # Enhanced VCCT: harder to start than to go on
#
# Onset needs G_Ic, propagation only G_Ic^p. When f = 1 the bond force of the tip node falls with
# its opening so that exactly G_Ic^p per area is dissipated:
#
#     F(w) = F0 (1 - w/w_f),      1/2 F0 w_f = G_Ic^p dA.
#
# With equal toughnesses the load history is that of VCCT with progressive release.
"""Double cantilever beam with different toughness for onset and propagation."""

from __future__ import annotations

from pathlib import Path

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d

ONSET = 0.20


def run(
    propagation: float, dx: float = 0.5, ny: int = 4, until: float = 45.0
) -> tuple[fx.Scene, dict[str, float]]:
    """Grow from 30 mm: onset load, load at the end, dissipated energy per area."""
    mesh = dcb_2d(length=100.0, height=1.5, dx=dx, ny=ny)
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= 30.0 - 1e-9, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials=fx.Isotropic(E=70e3, nu=0.3),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0),
        ],
        debonds=[fx.Debond(bond, fx.EnhancedVCCT(GIc=ONSET, GIc_p=propagation))],
    )
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until)))
    onsets = history.rows_of("onset", "unstable")
    first, last = onsets[0], onsets[-1]
    # at an onset every node behind the tip has opened all the way
    # what ran away where the next bond was stronger than the last one is no fracture energy
    spent = last["released_energy"] - last["snap_energy"]
    spent /= last["area[bond]"] - first["area[bond]"]
    return scene, {
        "onset load": first["R[pin_top.y]"],
        "last load": last["R[pin_top.y]"],
        "dissipated": spent,
        "balance": max(abs(r["balance"]) / max(r["external_work"], 1e-300) for r in onsets),
    }


def main(out: Path, fine: bool = False) -> None:
    """Three propagation toughnesses side by side."""
    rows = []
    for propagation in (0.20, 0.15, 0.10):
        scene, found = run(propagation, *((0.25, 8) if fine else (0.5, 4)))
        rows.append([propagation, found["onset load"], found["last load"], found["dissipated"]])
        scene.history.to_csv(out / f"enhanced_{propagation:.2f}.csv")
        scene.history.plot(
            out / f"load_opening_{propagation:.2f}.png", x="u[pin_top.y]", y="R[pin_top.y]"
        )
        scene.close()
    table(
        f"Enhanced VCCT, onset at G_Ic = {ONSET}",
        ["G_Ic propagation", "onset load / N", "load at the end / N", "dissipated per area"],
        rows,
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/enhanced_dcb"))
