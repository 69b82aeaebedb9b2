# # Blister: a film peeled off by pressure, from a plate to a membrane
#
# A film of thickness t is bonded to a rigid base but for a circle of radius a, and lifted there by
# a pressure p. Small deflections are those of a clamped plate,
#
#     w = p a^4/(64 D),             G = p^2 a^4/(128 D),        D = E t^3/(12 (1 - nu^2)),
#
# large ones (w >> t) those of a membrane (Gent and Lewandowski 1987, nu = 0.3):
#
#     p a^4/(E t^4) = 3.6 (w/t)^3,   G = 0.65 p w
#
# Film and base are shells, each a surface mesh with nodes of its own; the interface lies on their
# faces. A quarter is modelled.
"""Circular blister of a film: shells against the closed forms of plate and membrane."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.blister import blister

E, NU, RADIUS, FILM, BASE = 1000.0, 0.3, 1.0, 0.01, 0.05
BENDING = E * FILM**3 / (12.0 * (1.0 - NU**2))


def scene(pressure: float, *, finite: bool, **mesh: float) -> fx.Scene:
    """The film under a pressure that grows with the time to its value at 1."""
    shape = {"a": RADIUS, "film_z": 0.5 * FILM, "base_z": -0.5 * BASE, "front": 0.6 * FILM, **mesh}
    bond = fx.Interface(
        slave=fx.Face("film", "bottom"),
        master=fx.Face("base", "top"),
        bonded=lambda x: np.hypot(x[0], x[1]) >= RADIUS - 1e-6,
        name="bond",
    )
    film = fx.Isotropic(E, NU)
    return fx.Scene(
        blister(**shape),
        model=fx.Shell(),
        materials={
            "film": fx.Section(film, thickness=FILM, up=(0, 0, 1)),
            "base": fx.Section(film, thickness=BASE, up=(0, 0, 1)),
        },
        supports=[
            fx.Clamp("base"),
            fx.Symmetry("film_x0", "x"),
            fx.Symmetry("film_y0", "y"),
        ],
        loads=[fx.Pressure(fx.Face("blister", "bottom"), pressure)],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1e6))],
        monitors=[fx.Monitor("centre", (0, 0, 1), name="w")],
        effects=[fx.FiniteStrain()] if finite else [],
    )


def measured(one: fx.Scene) -> tuple[float, float]:
    """Deflection of the centre, and G as the mean along the front."""
    crack = one.cracks[0]
    tips = crack.tips()
    report = crack.evaluate(tips, one.solver.state, one.time).report
    rate = sum(report[mode] for mode in ("GI", "GII", "GIII"))
    return one.history["m[w]"][-1], float(tips.area @ rate / tips.area.sum())


def plate(**mesh: float) -> dict[str, float]:
    """Small deflection: w and G over those of the clamped plate."""
    pressure = 64.0 * BENDING * 0.01 * FILM / RADIUS**4
    one = scene(pressure, finite=False, **mesh)
    one.run(fx.Static(until=fx.Time(1.0)), progress=False)
    w, rate = measured(one)
    one.close()
    exact = pressure**2 * RADIUS**4 / (128.0 * BENDING)
    return {"w / plate": w / (0.01 * FILM), "G / plate": rate / exact}


def membrane(ratio: float = 12.0, **mesh: float) -> list[tuple[float, float, float, float]]:
    """Increments up to about w = ratio t: p a^4/(E t^4), w/t, and w and G over the membrane's."""
    load = 3.6 * ratio**3 + 5.9 * ratio
    pressure = load * E * FILM**4 / RADIUS**4
    one = scene(pressure, finite=True, **mesh)
    rows = []

    def watch(event: str, row: fx.history.Row) -> None:
        if event == "increment" and row["time"] > 0.0:
            _, rate = measured(one)
            here = row["m[w]"]
            p = row["time"] * pressure
            exact = (row["time"] * load / 3.6) ** (1.0 / 3.0) * FILM
            rows.append((row["time"] * load, here / FILM, here / exact, rate / (0.65 * p * here)))

    one.run(
        fx.Static(until=fx.Time(1.0), stepping="increment", initial=0.005, maximum=0.25),
        progress=False,
        observers=[watch],
    )
    one.close()
    return rows


def main(out: Path, fine: bool = False) -> None:
    """Both limits beside the closed forms."""
    mesh = {"n_around": 12, "n_inside": 20, "n_outside": 10} if fine else {}
    found = plate(**mesh)
    table("Small deflection beside the clamped plate", list(found), [list(found.values())])
    table(
        "Large deflection beside the membrane",
        ["p a^4/(E t^4)", "w/t", "w / membrane", "G / membrane"],
        [list(row) for row in membrane(**mesh)],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/shell_blister"))
