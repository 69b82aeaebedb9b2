# # Double cantilever beam in 3-D: a front that bows
#
# The specimen of `dcb.py` with its width. A straight front feels more G at mid-width than at the
# edges, so it starts there and bows. Published (NASA/TM-2008-215123): mid-width onset loads about
# 2.6 % below corrected beam theory.
"""Double cantilever beam in 3-D: onset along straight fronts, and growth of a bowed one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import fxcrack as fx
from fxcrack.demos.dcb import ARMS, BEAM, G_IC
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_3d

PUBLISHED = {30: 60.7, 31: 58.8, 32: 57.3, 33: 55.6, 34: 54.2, 35: 52.5}
WIDTH = 25.0


def make_scene(
    a: float, dx: float, dy: float, ny: int, reach: float
) -> tuple[fx.Scene, fx.Interface]:
    """The specimen with a straight front at a, fine up to ``reach`` ahead of it."""
    mesh = dcb_3d(
        length=80.0, width=WIDTH, dx=dx, dy=dy, ny=ny, fine=(a - 2.0, a + reach), coarse_dx=2.0
    )
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= a - 1e-6, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials=ARMS,
        model=fx.Solid(),
        supports=[
            fx.Displacement("pin_top", y=1.0),
            fx.Displacement("pin_bottom", y=-1.0),
            fx.Displacement("far_upper", x=0.0, y=0.0, z=0.0),
            fx.Displacement("far_lower", x=0.0, y=0.0, z=0.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IC))],
    )
    return scene, bond


def onset(a: float, dx: float = 0.5, dy: float = 1.25, ny: int = 4) -> dict[str, float]:
    """Load and opening at which a straight front at a starts, and where it does."""
    scene, _ = make_scene(a, dx, dy, ny, 3.0)
    history = scene.run(fx.Static(until=fx.Releases(1)))
    row = next(r for r in history if r["event"] == "onset")
    x = scene.pairs[0].surface.x
    scene.close()
    return {
        "load": row["R[pin_top.y]"],
        "u": row["u[pin_top.y]"],
        "z": float(x[row["node[bond]"], 2]),
    }


def grow(dx: float = 0.5, dy: float = 1.25, ny: int = 2, until: float = 34.0) -> fx.Scene:
    """Grow the front node by node."""
    scene, bond = make_scene(30.0, dx, dy, ny, until - 30.0 + 4.0)
    scene.run(fx.Static(until=fx.CrackLength(bond, until)))
    return scene


def bow(scene: fx.Scene) -> float:
    """How far mid-width is ahead of the edges, length."""
    surface, bonded = scene.pairs[0].surface, scene.solver.fronts[0].bonded

    def front_at(z: float) -> float:
        line = np.isclose(surface.x[:, 2], z, atol=1e-6)
        return float(surface.x[line & bonded, 0].min())

    return front_at(0.5 * WIDTH) - 0.5 * (front_at(0.0) + front_at(WIDTH))


def main(out: Path, fine: bool = False) -> None:
    """Onset loads beside the published ones, then a growing front."""
    rows = []
    for a, published in PUBLISHED.items():
        found = onset(a, 0.25 if fine else 0.5)
        theory = BEAM.dcb_load(float(a), G_IC)
        rows.append([str(a), found["load"], published, found["load"] / published, theory])
    table(
        "Mid-width onset of straight fronts",
        ["a / mm", "load / N", "published / N", "ratio", "CBT / N"],
        rows,
    )
    scene = grow()
    scene.history.to_csv(out / "dcb3d.csv")
    fx.plots.front_advance(scene, out / "front.png", "bond")
    scene.history.plot(
        out / "load_opening.png",
        x="u[pin_top.y]",
        y="R[pin_top.y]",
        xlabel="half opening / mm",
        ylabel="load / N",
    )
    fx.write_fields(scene, out / "dcb3d.pvd")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/dcb3d"))
