# # Penny-shaped crack on unstructured second-order tetrahedra
#
# A quarter of a cylinder, meshed by gmsh from a CAD geometry with six elements over the radius a of
# the crack. Remote tension sigma; Sneddon (1946): G = 4 (1 - nu^2) sigma^2 a/(pi E). The second
# picture shows the order in which the nodes opened while the crack grew by half its radius.
"""Penny-shaped crack on unstructured second-order tetrahedra against Sneddon's solution."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.tet_penny import tet_penny

E, NU, SIGMA, RADIUS = 1000.0, 0.3, 1.0, 1.0
RATE = 4.0 * (1.0 - NU**2) * SIGMA**2 * RADIUS / (np.pi * E)
MATERIAL = fx.Isotropic(E, NU)


def make_scene(loads: Any, supports: Any, release: Any = None, **mesh: Any) -> fx.Scene:
    """A quarter with the crack r < RADIUS on z = 0."""
    bond = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: np.hypot(x[0], x[1]) >= RADIUS - 1e-6,
        name="crack",
    )
    return fx.Scene(
        tet_penny(a=RADIUS, **mesh),
        materials=MATERIAL,
        model=fx.Solid(),
        supports=[fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y"), *supports],
        loads=loads,
        debonds=[fx.Debond(bond, fx.VCCT(GIc=RATE), release or fx.StepRelease())],
    )


def onset(size: float = RADIUS / 6.0) -> tuple[fx.Scene, dict[str, float]]:
    """G along the front over Sneddon's: mean, least and largest."""
    scene = make_scene(
        [fx.Traction("top", (0.0, 0.0, SIGMA)), fx.Traction("bottom", (0.0, 0.0, -SIGMA))],
        [fx.Displacement("centre_bottom", z=0.0)],
        size=size,
    )
    found: dict[str, float] = {}

    def look(event: str, row: Any) -> None:
        if event == "onset" and not found:
            tips = scene.cracks[0].tips()
            values = scene.cracks[0].evaluate(tips, scene.solver.state, scene.time)
            rates = sum(values.report[k] for k in ("GI", "GII", "GIII")) / scene.time**2 / RATE
            found["mean"] = float(np.average(rates, weights=tips.width))
            found["least"], found["largest"] = float(rates.min()), float(rates.max())

    scene.run(fx.Static(until=fx.Releases(1)), observers=[look])
    return scene, found


def grow(releases: int = 45) -> tuple[fx.Scene, dict[str, Any]]:
    """Grow the crack under prescribed displacement; its radius, and that of thirds of the front."""
    scene = make_scene(
        [],
        [fx.Displacement("top", z=1.0), fx.Displacement("bottom", z=-1.0)],
        fx.ProgressiveRelease(),
        fine=0.6 * RADIUS,
    )
    scene.run(fx.Static(until=fx.Releases(releases)))
    crack = scene.cracks[0]
    tips = crack.tips()
    x = crack.front.surface.x[tips.node]
    r, third = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0]) // (np.pi / 6.0001)
    thirds = np.array([r[third == k].mean() for k in range(3)])
    return scene, {"a": float(np.sqrt(4.0 * crack.extent.area(tips) / np.pi)), "thirds": thirds}


def main(out: Path, fine: bool = False) -> None:
    """Print G along the front beside the exact one; grow the crack and show its fronts."""
    rows = []
    for n in (6, 10) if fine else (6,):
        scene, found = onset(RADIUS / n)
        rows.append([str(n), *found.values()])
        scene.close()
    table(
        "G along the front over Sneddon's",
        ["elements per radius", "mean", "least", "largest"],
        rows,
    )
    scene, grown = grow()
    table(
        "Radius of the grown crack, and of thirds of its front over it",
        ["a", "third 1", "third 2", "third 3"],
        [[f"{grown['a']:.4f}", *(grown["thirds"] / grown["a"])]],
    )
    scene.history.to_csv(out / "tet_penny.csv")
    fx.plots.front_advance(scene, out / "front.png", "crack")
    fx.write_fields(scene, out / "tet_penny.pvd")
    scene.close()


if __name__ == "__main__":
    main(*arguments(__doc__, "out/tet_penny"))
