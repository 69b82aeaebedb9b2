# # Ductile arms and a critical crack opening
#
# Two strips of soft aluminium, glued together beyond a0 = 30 mm, are pulled apart. The arms yield
# at the crack tip, so the energy release rate of an elastic analysis means little; the ductile
# criterion is the opening at a fixed distance behind the tip, which has to grow with the crack:
# a resistance curve. Units N, mm, MPa; plane strain; J2 plasticity, small strain.
#
# What the load may do is known from limit analysis. An arm is a cantilever of length a; its root
# yields first at the moment M_y = 2/3 M_p and cannot carry more than
#
#     M_p = k sigma_y b h^2/4,      k = 2/sqrt(3) in plane strain (1 in plane stress)
#
# so that P a stays near M_p (1.5 % above on the finer mesh), however far the pins move. The elastic
# arms of the same specimen know no such limit: their load follows the opening that the resistance
# curve asks for.
"""Crack growth at a critical opening between arms that yield, beside elastic ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d

Array = npt.NDArray[np.float64]

E, NU, YIELD = 70e3, 0.3, 100.0
HEIGHT, WIDTH, A0, UNTIL = 3.0, 25.0, 30.0, 38.0
BEHIND = 1.0
"""Distance behind the tip at which the opening counts, mm."""
RESISTANCE = ((0.0, 2.0, 6.0), (0.005, 0.009, 0.018))
"""Critical opening against the growth of the crack, mm."""
PLASTIC_MOMENT = 2.0 / np.sqrt(3.0) * YIELD * WIDTH * HEIGHT**2 / 4.0


def make_scene(
    dx: float,
    *,
    yield_stress: float | None = YIELD,
    until: float = UNTIL,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
) -> tuple[fx.Scene, fx.Interface]:
    """The specimen; elastic without a yield stress."""
    mesh = dcb_2d(
        comm, length=80.0, height=HEIGHT, dx=dx, ny=max(4, round(HEIGHT / dx)), order=2,
        fine=(A0 - 6.0, until + 6.0), coarse_dx=4.0 * dx,
    )  # fmt: skip
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= A0 - 1e-9, name="bond"
    )
    arms = fx.Isotropic(E, NU)
    if yield_stress is not None:
        arms = fx.Plastic(E, NU, yield_stress=yield_stress)
    scene = fx.Scene(
        mesh,
        materials=arms,
        model=fx.PlaneStrain(thickness=WIDTH),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=0.5),
            fx.Displacement("pin_bottom", x=0.0, y=-0.5),
        ],
        debonds=[fx.Debond(bond, fx.CrackOpening(RESISTANCE, distance=BEHIND))],
    )
    return scene, bond


def run(
    dx: float = 0.5, *, until: float = UNTIL, maximum: float = 0.1, **options: object
) -> fx.History:
    """Grow the crack; options as for :func:`make_scene`."""
    scene, bond = make_scene(dx, until=until, **options)
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until), maximum=maximum))
    scene.close()
    return history


def onsets(history: fx.History) -> Array:
    """Columns a, opening of the pins, load, opening behind the tip, plastic work at each onset."""
    at = np.isin(history["event"], ["onset", "unstable"])
    names = "a[bond]", "time", "R[pin_top.y]", "cod[bond]"
    columns = [history[c][at].astype(float) for c in names]
    spent = history["plastic_energy"][at] if "plastic_energy" in history.columns else 0.0 * at[at]
    return np.array([*columns, spent.astype(float)]).T


def main(out: Path, fine: bool = False) -> None:
    """Both analyses, the table, load and crack length against the opening."""
    dx = 0.5 if fine else 1.0
    ductile, elastic = run(dx), run(dx, yield_stress=None)
    found, straight = onsets(ductile), onsets(elastic)
    table(
        "At the same crack length and the same opening behind the tip",
        [
            "a / mm",
            "opening behind / mm",
            "pins / mm",
            "load / N",
            "elastic: pins / mm",
            "load / N",
            "P a/M_p",
            "plastic work / mJ",
        ],
        [
            [*row[[0, 3, 1, 2]], *other[1:3], row[2] * row[0] / PLASTIC_MOMENT, row[4]]
            for row, other in zip(found, straight, strict=True)
        ],
    )
    if MPI.COMM_WORLD.rank == 0:
        work = ductile["external_work"].astype(float)
        balance = np.abs(ductile["balance"].astype(float)).max() / work.max()
        spent = float(ductile["plastic_energy"][-1]) / work[-1]
        print(
            f"energy balance within {balance:.1e} of the work, of which yielding took {spent:.0%}"
        )
    ductile.to_csv(out / "plastic_cod.csv")
    elastic.to_csv(out / "elastic_cod.csv")
    yielded = found[:, 2] * found[:, 0] > 0.5 * PLASTIC_MOMENT
    ductile.plot(
        out / "load_opening.png",
        x="time",
        y="R[pin_top.y]",
        xlabel="opening of the pins / mm",
        ylabel="load P / N",
        label="arms that yield",
        reference=[
            ("elastic arms", elastic["time"].astype(float), elastic["R[pin_top.y]"].astype(float)),
            ("M_p/a", found[yielded, 1], PLASTIC_MOMENT / found[yielded, 0]),
        ],
    )
    ductile.plot(
        out / "crack_length.png",
        x="time",
        y="a[bond]",
        xlabel="opening of the pins / mm",
        ylabel="crack length a / mm",
        label="arms that yield",
        reference=[
            ("elastic arms", elastic["time"].astype(float), elastic["a[bond]"].astype(float))
        ],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/plastic_cod"))
