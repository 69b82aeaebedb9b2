# # Skin and stringer as solids: the skin is wider than the foot
#
# The foot of a stringer is bonded to a skin that is wider than it. The whole outer face of the skin
# is the slave surface: what lies beside the foot has no partner, and is neither crack nor front. A
# corner of the foot has come off, and the web is pulled away from the skin until the debond has
# grown. The web stands on the foot in the same way: a narrow face on a wider one, tied.
#
# The energy release rate is checked without the front: with a straight debond of length a along the
# foot's edge, at a held opening,
#
#     G = -dU/dA,    by the difference of the strain energies at a - dx and a + dx.
#
# And with the sides exchanged, the foot as the slave of the skin, nothing changes.
"""A debond under the foot of a stringer, skin wider than the foot, solids."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.blocks import Blocks, build

Array = npt.NDArray[np.float64]

SKIN, FOOT, WEB, HIGH, LENGTH = 30.0, 10.0, 2.0, 8.0, 40.0
"""Half widths of skin, foot and web, height of the web, length along the stringer; mm."""
THICK = 2.0
CFRP = fx.Isotropic(E=60e3, nu=0.3)
CRITERION = fx.VCCT(GIc=0.3, GIIc=0.9, mix=fx.BK(eta=1.75))
HELD = 0.02
"""Opening at which G is looked at, before the onset; mm."""
CORNER = (4.0, 16.0)
"""The debond: from the foot's edge, along the stringer; mm."""


def panel(dx: float, dz: float, order: int = 2, comm: MPI.Intracomm = MPI.COMM_WORLD) -> fx.Mesh:
    """Skin, foot and web as blocks with nodes of their own; x across, y off the skin, z along."""

    def lines(half: float, step: float) -> Array:
        return np.linspace(-half, half, round(2.0 * half / step) + 1)

    def make() -> Blocks:
        model, z = Blocks(), np.linspace(0.0, LENGTH, round(LENGTH / dz) + 1)
        skin = model.add("skin", (lines(SKIN, dx), [-THICK, 0.0], z), "hexahedron", order)
        foot = model.add("foot", (lines(FOOT, dx), [0.0, THICK], z), "hexahedron", order)
        high = [THICK, 0.5 * (THICK + HIGH), HIGH]
        web = model.add("web", (lines(WEB, dx), high, z), "hexahedron", order)
        model.group("skin_outside", skin.part(y=0.0))
        model.group("skin_edges", skin.part(x=-SKIN), skin.part(x=SKIN))
        model.group("foot_bottom", foot.part(y=0.0))
        model.group("foot_top", foot.part(y=THICK))
        model.group("web_bottom", web.part(y=THICK))
        model.group("web_top", web.part(y=HIGH))
        return model

    return build(comm, "skin and stringer", make)


def under_foot(x: Array) -> npt.NDArray[np.bool_]:
    """Whether points of the skin have the foot above them."""
    return np.abs(x[0]) <= FOOT + 1e-9


def corner(x: Array) -> npt.NDArray[np.bool_]:
    """Whether the corner that has come off leaves a point under the foot bonded."""
    return under_foot(x) & ((x[0] >= -FOOT + CORNER[0] - 1e-9) | (x[2] >= CORNER[1] - 1e-9))


def strip(a: float) -> Callable[[Array], npt.NDArray[np.bool_]]:
    """A debond of length a along the whole edge of the foot."""
    return lambda x: under_foot(x) & (x[0] >= -FOOT + a - 1e-9)


def make_scene(mesh: fx.Mesh, bonded: Any, slave: str = "skin_outside") -> fx.Scene:
    """The web is pulled off by 1 at time 1; skin or foot is the slave of the bond."""
    master = "foot_bottom" if slave == "skin_outside" else "skin_outside"
    bond = fx.Interface(slave, master, bonded=bonded, contact=True, name="bond")
    web = fx.Interface("web_bottom", "foot_top", name="web")
    return fx.Scene(
        mesh,
        materials=CFRP,
        model=fx.Solid(),
        supports=[
            fx.Displacement("skin_edges", x=0.0, y=0.0, z=0.0),
            fx.Displacement("web_top", x=0.0, y=1.0),
        ],
        debonds=[fx.Debond(bond, CRITERION)],
        bonds=[web],
    )


def check(
    dx: float, dz: float, a: float, slave: str = "skin_outside", order: int = 2
) -> dict[str, float]:
    """Mean G along a straight front by VCCT and by the change of strain energy, and its area."""
    held = fx.Static(until=fx.Time(HELD))
    energy, found = [], {}
    for length in (a - dx, a + dx, a):
        scene = make_scene(panel(dx, dz, order), strip(length), slave)
        history = scene.run(held, progress=False)
        energy.append(float(history["strain_energy"][-1]))
        if length == a:
            tips = scene.cracks[0].tips()
            values = scene.cracks[0].evaluate(tips, scene.solver.state, scene.time)
            total = sum(values.report[mode] for mode in ("GI", "GII", "GIII"))
            found["VCCT"] = float(total @ tips.area / tips.area.sum())
            found["area"] = float(history["area[bond]"][-1])
            found["tips"] = float(len(tips))
        scene.close()
    found["-dU/dA"] = (energy[0] - energy[1]) / (2.0 * dx * LENGTH)
    return found


def run(dx: float = 2.0, dz: float = 2.0, releases: int = 120) -> fx.Scene:
    """Pull until so many nodes are released."""
    scene = make_scene(panel(dx, dz), corner)
    scene.run(fx.Static(until=[fx.Time(1.0), fx.Releases(releases)]))
    return scene


def main(out: Path, fine: bool = False) -> None:
    """The check, growth of the corner, and two pictures."""
    dx, dz = (1.0, 1.0) if fine else (2.0, 2.0)
    rows = []
    for slave in ("skin_outside", "foot_bottom"):
        found = check(dx, dz, 4.0, slave)
        rows.append([slave, found["area"], found["VCCT"], found["-dU/dA"]])
    table(
        f"Straight debond of 4 mm under the foot's edge, web held at {HELD} mm, before the onset",
        ["slave", "area of the debond", "mean G, VCCT", "-dU/dA"],
        rows,
    )
    scene = run(dx, dz)
    history = scene.history
    history.to_csv(out / "skin_stringer.csv")
    fx.plots.front_advance(scene, out / "skin_stringer_front.png", "bond")
    fx.plots.deformed(scene, out / "skin_stringer.png")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/skin_stringer"))
