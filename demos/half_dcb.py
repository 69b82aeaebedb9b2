# # Half of a double cantilever beam
#
# The specimen of `dcb` is symmetric about the plane of the crack. Its upper arm alone, on a rigid
# plane with `symmetry=True`, gives the load and the energy release rate of the whole with half of
# the unknowns; the energies of the history are those of the half. Units N, mm, MPa.
"""Half of a double cantilever beam on its plane of symmetry beside the whole."""

from __future__ import annotations

import time
from pathlib import Path

import fxcrack as fx
from fxcrack.demos.dcb import ARMS, G_IC
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_3d, half_dcb

WIDTH, FIRST = 10.0, 30.0


def run(
    half: bool, dx: float = 1.0, ny: int = 2, until: float = 34.0
) -> tuple[fx.Scene, dict[str, float]]:
    """Grow the crack; load, G and energies at its end, seconds and unknowns."""
    began = time.perf_counter()
    mesh = (half_dcb if half else dcb_3d)(
        length=60.0, height=1.5, width=WIDTH, dx=dx, dy=2.0 * dx, ny=ny, order=2
    )
    bond = fx.Interface(
        slave="upper_face",
        master=fx.RigidPlane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)) if half else "lower_face",
        bonded=lambda x: x[0] >= FIRST - 1e-9,
        symmetry=half,
        contact=True,
        name="bond",
    )
    supports = [fx.Displacement("pin_top", x=0.0, y=1.0, z=0.0)]
    if not half:
        supports.append(fx.Displacement("pin_bottom", x=0.0, y=-1.0, z=0.0))
    scene = fx.Scene(
        mesh,
        materials=ARMS,
        model=fx.Solid(),
        supports=supports,
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IC), fx.ProgressiveRelease())],
    )
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until)))
    row = [r for r in history if r["event"] == "onset"][-1]
    return scene, {
        "load": float(row["R[pin_top.y]"]),
        "opening": 2.0 * float(row["u[pin_top.y]"]),
        "G": float(row["GI[bond]"]),
        "strain energy": float(row["strain_energy"]),
        "released": float(row["released_energy"]),
        "unknowns": float(scene.analysis.continuum.n_global),
        "seconds": time.perf_counter() - began,
    }


def main(out: Path, fine: bool = False) -> None:
    """Run both, print the table, write the histories."""
    out.mkdir(parents=True, exist_ok=True)
    found = {}
    for name, half in (("whole", False), ("half", True)):
        scene, found[name] = run(half, *((0.5, 4) if fine else (1.0, 2)))
        scene.history.to_csv(out / f"half_dcb_{name}.csv")
    table(
        "A double cantilever beam and its half, at the last onset",
        ["", "whole", "half", "half / whole"],
        [[k, v, found["half"][k], found["half"][k] / v] for k, v in found["whole"].items()],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/half_dcb"))
