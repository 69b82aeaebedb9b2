# # A crack that closes, is pinched by friction, and opens again
#
# A plate with a central crack is pulled, pressed, sheared while it is pressed, and unloaded. While
# its faces press with a stress |s| they carry a shear of mu |s|, which works against the slip. In
# an infinite plate all of the crack slips at once; at its middle
#
#     slip = 4 a/E' (t -+ mu |s|),        opening = 4 a/E' s   (s > 0)
#
# so that a slip remains when the shear has gone: it is pinched until the crack opens.
"""A crack that closes, sticks, slips and opens again, beside closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.center_crack import center_crack
from fxcrack.output.plots import style as figure

MU = 0.4
STEEL = fx.Isotropic(E=210e3, nu=0.3)
STIFF = 210e3 / (1.0 - 0.3**2)
"""E' in plane strain."""
TIMES = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
STRESS = (0.0, 50.0, -100.0, -100.0, -100.0, 0.0, 50.0)
SHEAR = (0.0, 0.0, 0.0, 100.0, 0.0, 0.0, 0.0)
STAGES = ("", "pulled", "pressed", "sheared", "shear gone", "pressure gone", "pulled")


def closed_form(a: float) -> npt.NDArray[np.float64]:
    """Opening and slip at the middle at the end of each stage, shape (7, 2)."""
    unit, hold = 4.0 * a / STIFF, MU * 100.0
    slip = np.array([0.0, 0.0, 0.0, 100.0 - hold, hold, 0.0, 0.0])
    # the last slip goes together with the pressure: mu |s| holds less and less of it
    return unit * np.column_stack([np.maximum(STRESS, 0.0), slip])


def run(
    n_crack: int = 20, width: float = 40.0
) -> tuple[fx.Scene, npt.NDArray[np.float64], list[list[Any]]]:
    """Load, press, shear and unload.

    Returns:
        The scene; time, opening and slip at the middle over the load, shape (n, 3); rows of stage,
        opening, closed form, slip, closed form, energy that friction took.
    """
    a = 1.0
    mesh = center_crack(a=a, width=width, height=width, n_crack=n_crack)
    face = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: np.abs(x[0]) >= a - 1e-9,
        contact=True,
        friction=MU,
        name="crack",
    )
    pull, shear = fx.Amplitude(TIMES, STRESS), fx.Amplitude(TIMES, SHEAR)
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("bottom_left", x=0.0, y=0.0),
            fx.Displacement("bottom_right", y=0.0),
        ],
        loads=[
            fx.Traction("top", (0.0, 1.0), pull, "pull_top"),
            fx.Traction("bottom", (0.0, -1.0), pull, "pull_bottom"),
            fx.Traction("top", (1.0, 0.0), shear, "shear_top"),
            fx.Traction("bottom", (-1.0, 0.0), shear, "shear_bottom"),
            fx.Traction("right", (0.0, 1.0), shear, "shear_right"),
            fx.Traction("left", (0.0, -1.0), shear, "shear_left"),
        ],
        bonds=[face],
    )
    way: list[list[float]] = []

    def look(event: str, row: dict[str, Any]) -> None:
        friction, model = scene.solver.system.friction, scene.solver
        assert friction is not None
        x = scene.pairs[0].surface.x[friction.where[:, 1], 0]
        opening, slip = friction.of(model.state.jump)[np.argmin(np.abs(x))]
        way.append([row["time"], opening, abs(slip), row["friction_energy"]])

    scene.run(
        fx.Static(until=fx.Time(TIMES[-1]), stepping="increment", initial=0.1, maximum=0.1),
        observers=[look],
    )
    curve = np.array(way)
    exact = closed_form(a)
    rows: list[list[Any]] = []
    for i in range(1, len(TIMES)):
        at = curve[np.argmin(np.abs(curve[:, 0] - TIMES[i]))]
        rows.append([STAGES[i], at[1], exact[i, 0], at[2], exact[i, 1], at[3]])
    return scene, curve[:, :3], rows


def picture(scene: fx.Scene, curve: npt.NDArray[np.float64], path: Path) -> None:
    """Opening and slip over the stages beside the closed forms."""

    def draw() -> Any:
        fig, ax = figure.new_figure(7.2, 4.2)
        exact = 1e3 * closed_form(1.0)
        for k, name in ((1, "opening"), (2, "slip")):
            colour = figure.COLOURS[k - 1]
            ax.plot(curve[:, 0], 1e3 * curve[:, k], color=colour, label=f"{name} at the middle")
            ax.plot(TIMES, exact[:, k - 1], "o", mfc="white", color=colour, label="infinite plate")
        for begin, end, stage in zip(TIMES[:-1], TIMES[1:], STAGES[1:], strict=True):
            at = 0.5 * (begin + end)
            ax.annotate(stage, (at, 1.0), xycoords=("data", "axes fraction"), ha="center",
                        va="bottom", fontsize=9, color=figure.GREY)  # fmt: skip
        figure.dress(ax, xlabel="time", ylabel="jump / µm")
        figure.from_zero(ax)
        figure.legend(ax, loc="upper left", ncols=2)
        ax.set_ylim(top=1.35 * max(1e3 * curve[:, 1:].max(), exact.max()))
        return fig

    figure.save(scene.mesh.comm, path, draw)


def main(out: Path, fine: bool = False) -> None:
    """Run, print the table, write picture and history."""
    scene, curve, rows = run(40 if fine else 20)
    table(
        "A crack that is pinched: middle of the crack beside the infinite plate",
        ["stage", "opening", "closed form", "slip", "closed form", "friction energy"],
        rows,
    )
    scene.history.to_csv(out / "pinch.csv")
    picture(scene, curve, out / "pinch.png")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/pinch"))
