# # Friction in end-notched flexure
#
# The cracked arms of an ENF specimen press on each other over the support with P/4 and slide. With
# a coefficient of friction mu the pair of forces mu P/4 works against the sliding: it bends and
# strains each arm back. Beams of height h, all friction at the support, give
#
#     G_II = 9 P^2 a^2/(16 b^2 E h^3) (1 - 2 mu h/(3 a))^2
#
# so that the load at the onset of growth rises by 1/(1 - 2 mu h/(3 a)); a toughness computed from
# it without friction is too large by the square of that. Loaded and unloaded below the onset, the
# specimen runs through a loop whose area friction has taken.
"""End-notched flexure with and without friction, and a loop of loading and unloading."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import fxcrack as fx
from fxcrack.demos.enf import ARMS, BEAM, G_IIC
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.enf import enf_2d
from fxcrack.output.plots import style as figure

A0, HEIGHT = 35.0, 2.25
COEFFICIENTS = (0.0, 0.2, 0.4, 0.6)


def beam_factor(mu: float, a: float = A0) -> float:
    """Onset load over the one without friction."""
    return 1.0 / (1.0 - 2.0 * mu * HEIGHT / (3.0 * a))


def make_scene(mu: float, dx: float, ny: int, amplitude: Any = None) -> fx.Scene:
    """The specimen under a prescribed deflection."""
    bond = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: x[0] >= A0 - 1e-9,
        contact=True,
        friction=mu,
        name="bond",
    )
    load = {} if amplitude is None else {"amplitude": amplitude}
    return fx.Scene(
        enf_2d(half_span=50.0, height=HEIGHT, dx=dx, ny=ny),
        materials=ARMS,
        model=fx.PlaneStress(thickness=BEAM.b),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
            fx.Displacement("load", y=-1.0, **load),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IIC))],
    )


def grow(mu: float, dx: float = 0.5, ny: int = 4, until: float = 40.0) -> tuple[fx.Scene, Any]:
    """Grow the crack from 35 mm under a rising deflection; the row of the first onset."""
    scene = make_scene(mu, dx, ny)
    bond = scene.debonds[0].interface
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until)))
    return scene, history.at("a[bond]", A0, event="onset")


def loop(
    mu: float, dx: float = 0.5, ny: int = 4, deflection: float = 1.0
) -> tuple[fx.Scene, npt.NDArray[np.float64], float, float]:
    """Load, unload and load again below the onset.

    Returns:
        The scene; deflection and load, shape (n, 2); the energy friction took from the first
        maximum to the second, and the area of that loop.
    """
    times = (0.0, 1.0, 2.0, 3.0)
    way = fx.Amplitude(times, (0.0, deflection, 0.1 * deflection, deflection))
    scene = make_scene(mu, dx, ny, way)
    history = scene.run(
        fx.Static(until=fx.Time(3.0), stepping="increment", initial=0.02, maximum=0.02)
    )
    curve = np.column_stack([-history["u[load.y]"], -history["R[load.y]"]]).astype(float)
    closed = history["time"].astype(float) > 1.0 - 1e-9
    spent = history["friction_energy"].astype(float)[closed]
    area = np.trapezoid(curve[closed, 1], curve[closed, 0])
    return scene, curve, float(spent[-1] - spent[0]), float(area)


def run(
    dx: float = 0.5, ny: int = 4, until: float = 40.0
) -> tuple[list[fx.Scene], list[list[float]]]:
    """Scenes and rows of mu, onset load, its ratio, that of beams, apparent G_IIc, friction."""
    scenes, rows = [], []
    for mu in COEFFICIENTS:
        scene, row = grow(mu, dx, ny, until)
        load = -row["R[load.y]"]
        first = rows[0][1] if rows else load
        scenes.append(scene)
        rows.append(
            [mu, load, load / first, beam_factor(mu), (load / first) ** 2 * G_IIC,
             row["friction_energy"]]
        )  # fmt: skip
    return scenes, rows


def picture(scenes: list[fx.Scene], loops: dict[float, Any], path: Path) -> None:
    """Load against deflection with growth; what the loop adds to the load of a linear specimen."""

    def draw() -> Any:
        fig, (left, right) = new_pair()
        for mu, scene, colour in zip(COEFFICIENTS, scenes, figure.COLOURS, strict=False):
            u, load = -scene.history["u[load.y]"], -scene.history["R[load.y]"]
            left.plot(u, load, color=colour, label=f"µ = {mu:g}")
        smooth = loops[0.0]
        stiffness = smooth[-1, 1] / smooth[-1, 0]
        for (mu, curve), colour in zip(loops.items(), figure.COLOURS, strict=False):
            right.plot(curve[:, 0], curve[:, 1] - stiffness * curve[:, 0], color=colour,
                       label=f"µ = {mu:g}")  # fmt: skip
        figure.dress(left, xlabel="deflection / mm", ylabel="load / N", title="growth from 35 mm")
        figure.dress(
            right,
            xlabel="deflection / mm",
            ylabel="load less that without friction / N",
            title="loading, unloading, loading",
        )
        u, load = -scenes[0].history["u[load.y]"], -scenes[0].history["R[load.y]"]
        left.set_xlim(0.93 * u.max(), 1.02 * u.max())
        left.set_ylim(0.93 * load[-1], 1.06 * load.max())
        right.set_xlim(left=0.0)
        figure.legend(right, loc="upper left")
        return fig

    figure.save(scenes[0].mesh.comm, path, draw)


def new_pair() -> tuple[Any, tuple[Any, Any]]:
    """A figure with two pairs of axes."""
    fig, ax = figure.new_figure(9.6, 4.0)
    ax.remove()
    left, right = fig.subplots(1, 2)
    return fig, (left, right)


def main(out: Path, fine: bool = False) -> None:
    """Run, print the tables, write picture and histories."""
    size = (0.25, 8) if fine else (0.5, 4)
    scenes, rows = run(*size)
    table(
        "End-notched flexure with friction beside beam theory",
        ["mu", "onset load / N", "over mu = 0", "beams", "apparent G_IIc", "friction / mJ"],
        rows,
    )
    loops, spent = {}, []
    for mu in COEFFICIENTS:
        scene, curve, energy, area = loop(mu, *size)
        loops[mu] = curve
        spent.append([mu, energy, area])
        scene.close()
    table(
        "A loop between 0.1 and 1 mm of deflection",
        ["mu", "friction / mJ", "area of the loop / mJ"],
        spent,
    )
    for mu, scene in zip(COEFFICIENTS, scenes, strict=True):
        scene.history.to_csv(out / f"friction_enf_{mu:g}.csv")
    picture(scenes, loops, out / "friction_enf.png")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/friction_enf"))
