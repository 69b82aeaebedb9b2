# # G by the domain integral beside VCCT, on spacing that jumps
#
# The ends of a double cantilever beam are pulled by given forces. Its tip lies where the length of
# the elements changes. Corrected beam theory gives the load of growth,
#
#     P = sqrt(Gc b E I)/(a + chi h).
#
# VCCT multiplies the force at the tip with the opening behind it, so that it must know how both go
# with the lengths of the two elements. The domain integral takes the energy that a ring of cells
# sets free; only the tip's own elements enter what the mesh is off by. Units N, mm, MPa.
#
# The last columns say what an onset costs in this process, mesh and interface included.
"""Load of growth by the domain integral and by VCCT where element lengths jump at the tip."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.dcb import ARMS, BEAM, G_IC
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d, dcb_3d

A0, LENGTH = 30.0, 60.0
JUMPS = ((1.0, 0.25), (1.0, 0.5), (0.5, 0.5), (0.5, 1.0), (0.25, 1.0))
METHODS = ("vcct", "domain")


def spacing(behind: float, ahead: float) -> np.ndarray:
    """Coordinates of the corner nodes along the beam [mm]."""
    return np.concatenate([np.arange(0.0, A0 - 1e-9, behind), np.arange(A0, LENGTH + 1e-9, ahead)])


def onset(mesh: fx.Mesh, method: str, model: fx.PlaneStrain | fx.Solid) -> tuple[float, float]:
    """Load factor of the first growth, and seconds."""
    start = time.perf_counter()
    flat = isinstance(model, fx.PlaneStrain)
    pins = ("pin_top", "pin_bottom") if flat else ("end_upper", "end_lower")
    held = {"x": 0.0, "y": 0.0} if flat else {"x": 0.0, "y": 0.0, "z": 0.0}
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= A0 - 1e-9, name="bond"
    )
    zero = () if flat else (0.0,)
    scene = fx.Scene(
        mesh,
        materials=ARMS,
        model=model,
        supports=[fx.Displacement(f"far_{side}", **held) for side in ("upper", "lower")],
        loads=[
            fx.PointForce(pin, (0.0, sign, *zero))
            for pin, sign in zip(pins, (1.0, -1.0), strict=True)
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IC, method=method))],
    )
    history = scene.run(fx.Static(until=fx.Releases(1)), progress=False)
    load = float(next(r for r in history if r["event"] == "onset")["time"])
    scene.close()
    return load, time.perf_counter() - start


def run(ny: int = 4) -> list[list[float]]:
    """Rows of lengths behind and ahead, and per method load over theory and seconds."""
    model = fx.PlaneStrain(thickness=25.0)
    exact = BEAM.dcb_load(A0, G_IC)
    rows = []
    for behind, ahead in JUMPS:
        mesh = dcb_2d(length=LENGTH, ny=ny, order=2, x_spacing=spacing(behind, ahead))
        found = [onset(mesh, method, model) for method in METHODS]
        rows.append([behind, ahead, *(x for load, s in found for x in (load / exact, s))])
    return rows


def cost_in_space(dx: float = 1.0) -> list[list[float | str]]:
    """Rows of method and seconds up to the first onset of the specimen in 3-D."""
    mesh = dcb_3d(length=LENGTH, width=25.0, dx=dx, dy=2.5, ny=2)
    return [[method, onset(mesh, method, fx.Solid())[1]] for method in METHODS]


def draw(rows: list[list[float]], out: Path) -> None:
    """Load over theory against the ratio of the lengths."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 3.6), layout="constrained")
    axes = figure.subplots()
    ratio = [row[1] / row[0] for row in rows]
    for k, (method, mark) in enumerate(zip(METHODS, ("s--", "o-"), strict=True)):
        axes.plot(ratio, [row[2 + 2 * k] for row in rows], mark, label=f"method='{method}'")
    axes.axhline(1.0, color="0.5", lw=0.8)
    axes.set_xscale("log", base=2)
    axes.set_xlabel("element ahead of the tip over element behind it")
    axes.set_ylabel("load of growth over beam theory")
    axes.legend()
    figure.savefig(out / "domain_integral.png", dpi=150)


def main(out: Path, fine: bool = False) -> None:
    """Run, print both tables, draw the picture."""
    out.mkdir(parents=True, exist_ok=True)
    rows = run(8 if fine else 4)
    table(
        "Load of growth over corrected beam theory, second order",
        ["behind / mm", "ahead / mm", "VCCT", "seconds", "domain", "seconds"],
        rows,
    )
    table(
        "Seconds to the first onset in 3-D",
        ["method", "seconds"],
        cost_in_space(0.5 if fine else 1.0),
    )
    if MPI.COMM_WORLD.rank == 0:
        draw(rows, out)


if __name__ == "__main__":
    main(*arguments(__doc__, "out/domain_integral"))
