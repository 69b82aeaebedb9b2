# # Penny-shaped crack: axisymmetric, pressure on the crack faces
#
# A disc-shaped crack of radius a in a large cylinder, opened by a pressure p. Sneddon (1946):
#
#     G = 4 (1 - nu^2) p^2 a/(pi E),      opening(0) = 8 (1 - nu^2) p a/(pi E)
#
# The load at which f = 1 for a toughness equal to that G must be p itself. Units SI.
"""Penny-shaped crack under internal pressure against Sneddon's solution."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.penny import penny

E, NU, PRESSURE, RADIUS = 2e11, 0.3, 1e6, 2.0
RATE = 4.0 * (1.0 - NU**2) * PRESSURE**2 * RADIUS / (np.pi * E)
OPENING = 8.0 * (1.0 - NU**2) * PRESSURE * RADIUS / (np.pi * E)


def run(
    dr: float = 0.05, order: int = 1, method: str = "vcct"
) -> tuple[fx.Scene, dict[str, float]]:
    """Onset of growth: computed G and opening over the exact ones."""
    mesh = penny(a=RADIUS, radius=30.0 * RADIUS, half_height=30.0 * RADIUS, dr=dr, order=order)
    bond = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: x[0] >= RADIUS - 1e-9,
        name="crack",
    )

    def pressure(x: np.ndarray) -> np.ndarray:
        return np.where(x[0] < RADIUS, PRESSURE, 0.0)

    scene = fx.Scene(
        mesh,
        materials=fx.Isotropic(E, NU),
        model=fx.Axisymmetric(),
        supports=[
            fx.Displacement("axis_upper", x=0.0),
            fx.Displacement("axis_lower", x=0.0),
            fx.Displacement("axis_bottom", y=0.0),
        ],
        loads=[fx.Pressure("upper_face", pressure), fx.Pressure("lower_face", pressure)],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=RATE, method=method))],
        monitors=[
            fx.Monitor("centre_upper", (0.0, 1.0), name="upper"),
            fx.Monitor("centre_lower", (0.0, 1.0), name="lower"),
        ],
    )
    history = scene.run(fx.Static(until=fx.Releases(1)))
    row = next(r for r in history if r["event"] == "onset")
    factor = row["time"]
    opening = (row["m[upper]"] - row["m[lower]"]) / factor
    return scene, {"G / exact": 1.0 / factor**2, "opening / exact": opening / OPENING}


def main(out: Path, fine: bool = False) -> None:
    """Run orders and methods, print the table, write the history."""
    rows = []
    for order, dr in ((1, 0.1), (1, 0.05), (2, 0.1), (2, 0.05)):
        for method in ("vcct", "closure"):
            scene, found = run(dr / 2.0 if fine else dr, order, method)
            rows.append([str(order), dr, method, *found.values()])
            if (order, method) == (1, "vcct"):
                scene.history.to_csv(out / "penny.csv")
                fx.plots.deformed(scene, out / "deformed.png")
            scene.close()
    table(
        "Penny-shaped crack beside Sneddon's solution",
        ["order", "element / m", "method", "G / exact", "opening / exact"],
        rows,
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/penny"))
