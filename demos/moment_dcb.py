# # Double cantilever beam under pure moments: N(a) is a straight line
#
# Two opposed moments M on the ends of the arms, as linear tractions. Each arm is a beam under the
# same moment wherever the crack ends, and so (plane stress)
#
#     G = 12 M^2/(b^2 E h^3)
#
# does not depend on the crack length: dG = (1 - R^2) G neither, and the crack grows by the same
# c3 dG^c4 in every cycle. Units N, mm.
"""Fatigue growth at a constant energy release rate."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d

E, HEIGHT, WIDTH, MOMENT = 70e3, 1.5, 20.0, 300.0
RATE = 12.0 * MOMENT**2 / (WIDTH**2 * E * HEIGHT**3)
RATIO = 0.1
# Growth of 1e-4 mm per cycle at dG = G.
PARIS = fx.Paris(c1=0.0, c2=-1.0, c3=1e-4 * RATE**-10.61, c4=10.61)


def run(
    dx: float = 0.5, ny: int = 4, order: int = 1, until: float = 40.0, **options: object
) -> tuple[fx.Scene, dict[str, float]]:
    """Grow from 20 mm; G and da/dN over the exact ones, and how straight N(a) is.

    Returns:
        The scene; "G / exact", "slope / exact", and the largest distance of N(a) from the line
        between its ends over the cycles in all, "bend".
    """
    mesh = dcb_2d(length=60.0, height=HEIGHT, dx=dx, ny=ny, order=order)
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= 20.0 - 1e-6, name="bond"
    )

    def bending(x: np.ndarray) -> np.ndarray:
        return 12.0 * MOMENT * (np.abs(x[1]) - 0.5 * HEIGHT) / (WIDTH * HEIGHT**3)

    scene = fx.Scene(
        mesh,
        materials=fx.Isotropic(E, 0.3),
        model=fx.PlaneStress(thickness=WIDTH),
        supports=[
            fx.Displacement("far_upper", x=0.0, y=0.0),
            fx.Displacement("far_lower", x=0.0, y=0.0),
        ],
        loads=[fx.Traction("end_upper", (bending, 0.0)), fx.Traction("end_lower", (bending, 0.0))],
        debonds=[fx.Debond(bond, fx.Fatigue(GIc=2.0 * RATE, paris=PARIS, **options))],
    )
    history = scene.run(fx.Cycles(maximum=1.0, ratio=RATIO, until=fx.CrackLength(bond, until)))
    rows = [row for row in history if row["event"] in ("cycle", "release")]
    a, N, G = (np.array([row[k] for row in rows]) for k in ("a[bond]", "N", "G_max[bond]"))
    line = N[-1] * (a - a[0]) / (a[-1] - a[0])
    exact = float(PARIS.growth_rate((1.0 - RATIO**2) * RATE))
    return scene, {
        "G / exact": float(G.mean() / RATE),
        "slope / exact": float((a[-1] - a[0]) / N[-1] / exact),
        "bend": float(np.abs(N - line).max() / N[-1]),
    }


def main(out: Path, fine: bool = False) -> None:
    """Run some meshes, print the table, write a history and its plot."""
    rows = []
    for order, dx, ny in ((1, 0.5, 4), (1, 0.25, 8), (1, 0.125, 16), (2, 0.5, 4)):
        scene, found = run(dx / 2.0 if fine else dx, 2 * ny if fine else ny, order)
        rows.append([str(order), dx / 2.0 if fine else dx, *found.values()])
        history = scene.history
        scene.close()
    table(
        "N(a) under pure moments beside the closed form",
        ["order", "element / mm", "G / exact", "da/dN / exact", "distance from a line"],
        rows,
    )
    history.to_csv(out / "moment_dcb.csv")
    a = history["a[bond]"]
    exact = (a - a[0]) / PARIS.growth_rate((1.0 - RATIO**2) * RATE)
    history.plot(
        out / "cycles.png",
        x="N",
        y="a[bond]",
        xlabel="cycles N",
        ylabel="crack length a / mm",
        reference=[("closed form", exact, a)],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/moment_dcb"))
