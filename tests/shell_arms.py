"""Two bonded arms of shells for tests: DCB, single leg bending and end notched flexure.

The ply is that of the DCB-UD specimen of NASA/TM-2008-215123.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.sheets import Sheet, sheets

UD = fx.Orthotropic(
    E=(139400.0, 10160.0, 10160.0), nu=(0.30, 0.30, 0.436), G=(4600.0, 4600.0, 3540.0)
)
E1, E3, G13 = 139400.0, 10160.0, 4600.0
FAST = fx.Static(until=fx.Time(1.0))


def two_arms(
    comm: MPI.Intracomm,
    *,
    length: float,
    width: float,
    heights: tuple[float, float],
    dx: float,
    ny: int = 1,
    element: tuple[str, int] = ("quadrilateral", 1),
    load_at: float | None = None,
) -> fx.Mesh:
    """Upper and lower arm as sheets in the middles of their heights."""
    x, y = np.linspace(0.0, length, round(length / dx) + 1), np.linspace(0.0, width, ny + 1)
    points = {}
    if load_at is not None:
        points = {f"load_{i}": (load_at, s) for i, s in enumerate((0.0, width))}
    upper = Sheet("upper", x, y, lambda a, b: (a, b, 0.5 * heights[0] + 0.0 * a), points)
    lower = Sheet("lower", x, y, lambda a, b: (a, b, -0.5 * heights[1] + 0.0 * a))
    return sheets([upper, lower], comm, cell=element[0], order=element[1], name="arms")


def bond(a0: float, **options: Any) -> fx.Interface:
    return fx.Interface(
        slave=fx.Face("lower", "top"),
        master=fx.Face("upper", "bottom"),
        bonded=lambda x: x[0] >= a0 - 1e-6,
        name="bond",
        **options,
    )


def mean_rates(scene: fx.Scene) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Energy release rates of the modes, means over the width of the front, shape (3,)."""
    crack = scene.cracks[0]
    tips = crack.tips()
    values = crack.evaluate(tips, scene.solver.state, scene.time)
    share = tips.area / tips.area.sum()
    return np.array([float(share @ values.report[mode]) for mode in ("GI", "GII", "GIII")])


LENGTH, WIDTH, HEIGHT, A0 = 100.0, 25.0, 1.5, 30.0


def dcb(
    comm: MPI.Intracomm,
    element: tuple[str, int],
    dx: float,
    ny: int = 1,
    height: float = HEIGHT,
    **more: Any,
) -> Any:
    mesh = two_arms(
        comm, length=LENGTH, width=WIDTH, heights=(height, height), dx=dx, ny=ny, element=element
    )
    given: dict[str, Any] = {
        "model": fx.Shell(),
        "materials": fx.Section(UD, thickness=height),
        "supports": [
            fx.Clamp("upper_a1"),
            fx.Clamp("lower_a1"),
            fx.Displacement("upper_a0", z=0.5),
            fx.Displacement("lower_a0", z=-0.5),
        ],
        "debonds": [fx.Debond(bond(A0), fx.VCCT(GIc=0.17))],
    }
    return fx.Scene(mesh, **{**given, **more})


def over_beam_theory(scene: fx.Scene, height: float = HEIGHT) -> tuple[float, float]:
    """Load over corrected beam theory's at its opening, G over its G at the model's own load."""
    scene.run(fx.Static(until=fx.Time(0.01)), progress=False)  # before the onset
    load = float(scene.history["R[upper_a0.z]"][-1]) / 0.01
    ratio = 1.18 * np.sqrt(E1 * E3) / G13
    chi = np.sqrt(E1 / (11.0 * G13) * (3.0 - 2.0 * (ratio / (1.0 + ratio)) ** 2))
    inertia, a = WIDTH * height**3 / 12.0, A0 + chi * height
    rate = float(mean_rates(scene).sum()) / 0.01**2
    return load * 2.0 * a**3 / (3.0 * E1 * inertia), rate * WIDTH * E1 * inertia / (load * a) ** 2


def slb(
    comm: MPI.Intracomm, sections: tuple[fx.Section, fx.Section], dx: float = 1.0,
    a: float = 16.0, **options: Any,
) -> fx.Scene:  # fmt: skip
    """Single leg bending under a unit load, half span 32, 1 wide: sections above and below, run."""
    above, below = sections
    scene = fx.Scene(
        two_arms(
            comm, length=64.0, width=1.0, heights=(above.height, below.height), dx=dx, load_at=32.0
        ),
        model=fx.Shell(),
        materials={"upper": above, "lower": below},
        supports=[
            fx.Displacement("upper_a0", z=0.0),
            fx.Displacement("upper_a1", x=0.0, z=0.0),
            fx.Displacement("upper_b0", y=0.0),
        ],
        loads=[fx.PointForce(f"load_{i}", (0.0, 0.0, -0.5)) for i in (0, 1)],
        debonds=[fx.Debond(bond(a, **options), fx.VCCT(GIc=1.0))],
    )
    scene.run(FAST, progress=False)
    return scene


def of_one_ply(heights: tuple[float, float]) -> tuple[fx.Section, fx.Section]:
    """Sections of the ply along the arms."""
    upper, lower = (fx.Section(UD, thickness=h) for h in heights)
    return upper, lower


def enf(comm: MPI.Intracomm, dx: float = 1.0, **options: Any) -> fx.Scene:
    """End notched flexure, a = 34, half span 88, h = 2.25, with contact of the offset faces."""
    mesh = two_arms(comm, length=176.0, width=1.0, heights=(2.25, 2.25), dx=dx, load_at=88.0)
    interface = fx.Interface(
        slave=fx.Face("upper", "bottom"),
        master=fx.Face("lower", "top"),
        bonded=lambda x: x[0] >= 34.0 - 1e-6,
        contact=True,
        name="bond",
        **options,
    )
    return fx.Scene(
        mesh,
        model=fx.Shell(),
        materials=fx.Section(UD, thickness=2.25),
        supports=[
            fx.Displacement("lower_a0", z=0.0),
            fx.Displacement("lower_a1", x=0.0, z=0.0),
            fx.Displacement("lower_b0", y=0.0),
        ],
        loads=[fx.PointForce(f"load_{i}", (0.0, 0.0, -0.5)) for i in (0, 1)],
        debonds=[fx.Debond(interface, fx.VCCT(GIc=1.0))],
    )
