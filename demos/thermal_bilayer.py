# # A bilayer debonds on cooling
#
# A layer that shrinks much on cooling is bonded to one that shrinks little. Free to bend, the pair
# stores energy because neither layer gets the strain it wants; where it has debonded both are free
# and store none. A crack much longer than the layers are thick turns the one state into the other,
# so its energy release rate does not depend on its length. Units N, mm, MPa, degrees.
#
# The layers hold each other back by a force N per width and bend by k (Timoshenko 1925). In plane
# strain with E' = E/(1 - nu^2) and the free strain e = (1 + nu) alpha dT,
#
#     N/(E1' h1) + N/(E2' h2) + k (h1 + h2)/2 = e1 - e2,      k (E1' I1 + E2' I2) = N (h1 + h2)/2,
#
# and the stored energy per length and width, which is G (Suo and Hutchinson 1990), is
#
#     G = (e1 - e2)^2/2 / (1/(E1' h1) + 1/(E2' h2) + (h1 + h2)^2/4/(E1' I1 + E2' I2)).
#
# A temperature that scales a fixed field is one load pattern of a linear scene: it costs one column
# of the condensed matrix, and no factorisation when it changes. The same scene through the
# nonlinear solver must give the same history.
#
# The toughness falls on cooling. The temperature at which the crack starts closes a small loop: it
# is where G(T) meets Gc(T).
"""A bilayer debonds on cooling: steady-state energy release rate against the closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.spacing import fine_region
from fxcrack.output.plots.style import COLOURS, dress, legend, new_figure, save

Array = npt.NDArray[np.float64]

# aluminium on alumina
UPPER = fx.Isotropic(70e3, 0.33, expansion=23e-6)
LOWER = fx.Isotropic(380e3, 0.22, expansion=8e-6)
H1, H2, LENGTH, A0 = 1.0, 1.0, 20.0, 0.5
HOT = 300.0
G_IC = 0.1


def steady_rate(drop: float) -> float:
    """The closed form for a drop of the temperature."""
    (s1, e1, i1), (s2, e2, i2) = (
        (
            m.E / (1.0 - m.nu**2) * h,
            (1.0 + m.nu) * m.expansion * drop,
            m.E / (1.0 - m.nu**2) * h**3 / 12.0,
        )
        for m, h in ((UPPER, H1), (LOWER, H2))
    )
    compliance = 1.0 / s1 + 1.0 / s2 + (H1 + H2) ** 2 / 4.0 / (i1 + i2)
    return float(0.5 * (e1 - e2) ** 2 / compliance)


def layers(dx: float) -> fx.Mesh:
    """Both layers; the right end is a plane of symmetry."""

    def make() -> Blocks:
        x = fine_region(LENGTH, dx, fine=(0.0, 0.75 * LENGTH), coarse_dx=4.0 * dx)
        y = np.linspace(0.0, H1, round(H1 / dx) + 1), np.linspace(-H2, 0.0, round(H2 / dx) + 1)
        model, upper, lower = two_bodies((x, x), y, cell="quadrilateral", order=2)
        model.group("middle_upper", upper.part(x=LENGTH))
        model.group("middle_lower", lower.part(x=LENGTH))
        model.group("foot", lower.part(x=LENGTH, y=-H2))
        return model

    return build(MPI.COMM_WORLD, "thermal_bilayer", make, None)


# ## The scene
#
# The crack grows from the free left end; the right end is a plane of symmetry. The toughness is
# tabulated against the temperature of the bodies, which the interface takes over by itself.
def run(dx: float = 0.25, until: float = 10.0, solver: str | None = None) -> tuple[fx.Scene, Array]:
    """Cool from 300 degrees on; columns a, drop of the temperature, G over the closed form."""
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= A0 - 1e-9, name="bond"
    )
    toughness = fx.Tabulated([0.0, HOT], [0.5 * G_IC, G_IC])
    scene = fx.Scene(
        layers(dx),
        materials={"upper": UPPER, "lower": LOWER},
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("middle_upper", x=0.0),
            fx.Displacement("middle_lower", x=0.0),
            fx.Displacement("foot", y=0.0),
        ],
        debonds=[
            fx.Debond(
                bond, fx.VCCT(GIc=toughness, GIIc=toughness, mix=fx.BK(1.0), method="closure")
            )
        ],
        effects=[fx.Temperature(HOT - 1.0, reference=HOT)],
        solver=solver,
    )
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until)))
    at = np.isin(history["event"], ["onset", "unstable"])
    a, drop = (history[c][at].astype(float) for c in ("a[bond]", "time"))
    rate = sum(history[f"{mode}[bond]"][at].astype(float) for mode in ("GI", "GII"))
    return scene, np.array([a, drop, rate / np.array([steady_rate(d) for d in drop])]).T


def main(out: Path, fine: bool = False) -> None:
    """G against the closed form as the crack grows, and the plot."""
    scene, rows = run(0.125 if fine else 0.25)
    shown = [list(row) for row in rows[:: max(1, len(rows) // 8)]]
    table("G of a bilayer that cools", ["a / mm", "drop / degrees", "G / closed form"], shown)
    scene.history.to_csv(out / "thermal_bilayer.csv")

    def draw() -> Figure:
        figure, axes = new_figure()
        axes.plot(rows[:, 0] / H1, rows[:, 2], "o-", ms=3, color=COLOURS[0], label="fxcrack")
        axes.axhline(1.0, color=COLOURS[1], ls="--", label="steady state, closed form")
        dress(axes, xlabel="crack length / layer thickness", ylabel="G / closed form")
        legend(axes)
        return figure

    save(scene.mesh.comm, out / "rate.png", draw)
    fx.plots.deformed(scene, out / "deformed.png")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/thermal_bilayer"))
