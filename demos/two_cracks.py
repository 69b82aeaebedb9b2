# # Two delaminations in one laminate
#
# A laminate of three sublaminates is opened at its left end. The first delamination, at mid-plane,
# starts there; the second lies inside, between the middle and the lower sublaminate, right in front
# of the first. Each interface has its own toughness. A specimen of the kind of Robinson, Besant and
# Hitchings (2000). Units N, mm.
#
#      ____________________________________________
#     |  upper                                     |      P up at x = 0
#     |=================----- first interface -----|
#     |  middle                                    |
#     |-------------------------======-- second ---|
#     |  lower                                     |      P down at x = 0
#
# As long as the first tip is far from the second delamination the specimen is a double cantilever
# beam of two equal arms:
#
#     P = sqrt(G_c b E I)/(a + chi h)
#
# Then the thin middle sublaminate is all that parts the two cracks: the second opens, wakes up and
# runs on beside the first one. In between the load falls at constant opening: the states that event
# stepping passes there are the releases of an unstable crack.
"""Two delaminations of different toughness in one laminate of three sublaminates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.spacing import fine_region

WIDTH, LENGTH = 20.0, 200.0
UPPER, MIDDLE, LOWER = 1.59, 0.265, 1.325
A_FIRST = 40.0
SECOND = (60.0, 80.0)
TOUGHNESS = {"first": 0.33, "second": 0.25}
PLY = fx.Orthotropic(E=(115e3, 8.5e3, 8.5e3), nu=(0.29, 0.29, 0.3), G=(4.5e3, 4.5e3, 3.3e3))
BEAM = CorrectedBeam(E=115e3, E22=8.5e3, G=4.5e3, h=UPPER, b=WIDTH)


def laminate(dx: float = 0.5, n_upper: int = 6) -> fx.Mesh:
    """Three sublaminates with nodes of their own; elements dx long in the region of growth."""

    def make() -> Blocks:
        model = Blocks()
        x = fine_region(LENGTH, dx, fine=(A_FIRST - 4.0, 140.0), coarse_dx=4.0 * dx)
        layers = {"upper": (0.0, UPPER, n_upper), "middle": (-MIDDLE, 0.0, 2),
                  "lower": (-MIDDLE - LOWER, -MIDDLE, n_upper - 1)}  # fmt: skip
        for name, (low, high, n) in layers.items():
            y = np.linspace(low, high, n + 1)
            block = model.add(name, (x, y), "quadrilateral", 1)
            model.group(f"{name}_top", block.part(y=high))
            model.group(f"{name}_bottom", block.part(y=low))
            model.group("far_end", block.part(x=LENGTH))
            if name != "middle":
                model.group(f"pin_{name}", block.part(x=0.0, y=high if name == "upper" else low))
        return model

    return build(MPI.COMM_WORLD, "two_cracks", make)


def make_scene(dx: float = 0.5, n_upper: int = 6) -> fx.Scene:
    """The specimen with both delaminations; open faces cannot pass through each other."""
    first = fx.Interface(
        slave="upper_bottom",
        master="middle_top",
        bonded=lambda x: x[0] >= A_FIRST - 1e-9,
        contact=True,
        name="first",
    )
    second = fx.Interface(
        slave="middle_bottom",
        master="lower_top",
        bonded=lambda x: (x[0] <= SECOND[0] + 1e-9) | (x[0] >= SECOND[1] - 1e-9),
        contact=True,
        name="second",
    )
    mix = fx.BK(eta=2.0)
    return fx.Scene(
        laminate(dx, n_upper),
        materials=PLY,
        model=fx.PlaneStress(thickness=WIDTH),
        supports=[
            fx.Displacement("pin_upper", x=0.0, y=1.0),
            fx.Displacement("pin_lower", x=0.0, y=-1.0),
        ],
        debonds=[
            fx.Debond(first, fx.VCCT(GIc=TOUGHNESS["first"], GIIc=0.8, mix=mix)),
            fx.Debond(second, fx.VCCT(GIc=TOUGHNESS["second"], GIIc=0.6, mix=mix)),
        ],
    )


def run(
    dx: float = 0.5, n_upper: int = 6, until: float = 12.0
) -> tuple[fx.Scene, list[list[float | str]]]:
    """Open the end to ``until`` on each side; rows of what happens, u, load and both lengths."""
    scene = make_scene(dx, n_upper)
    history = scene.run(fx.Static(until=fx.Time(until)))
    grown = history["released[second]"].astype(int)
    over = next(i for i, r in enumerate(history) if r["a[first]"] >= SECOND[0] + 5.0)
    marks = [
        ("first starts", history.at("f[first]", 1.0, event="onset")),
        ("first has jumped 5 mm past its end", history.rows[over]),
        ("second starts", history.rows[int(np.argmax(grown > 0)) - 1]),
        ("end", history.rows[-1]),
    ]
    rows = [
        [name, row["time"], row["R[pin_upper.y]"], row["a[first]"], row["area[second]"] / WIDTH]
        for name, row in marks
    ]
    return scene, rows


def main(out: Path, fine: bool = False) -> None:
    """Run, print the table, write history and plots."""
    scene, rows = run(*((0.25, 12) if fine else (0.5, 6)))
    history = scene.history
    table(
        "Two delaminations in one laminate",
        ["", "u / mm", "load / N", "length of the first / mm", "of the second / mm"],
        rows,
    )
    theory = BEAM.dcb_load(A_FIRST, TOUGHNESS["first"])
    if MPI.COMM_WORLD.rank == 0:
        d = history.details
        lost = abs(history["balance"]).max() / history["external_work"].max()
        print(f"first onset {rows[0][2]:.2f} N, corrected beam theory {theory:.2f} N")
        print(f"energy balance to {lost:.1e} of the work, {d['releases']} releases, "
              f"{d['factorizations']} factorisation(s)")  # fmt: skip
    history.to_csv(out / "two_cracks.csv")
    a = np.linspace(A_FIRST, 58.0, 50)
    load = BEAM.dcb_load(a, TOUGHNESS["first"])
    history.plot(
        out / "load_opening.png",
        x="u[pin_upper.y]",
        y="R[pin_upper.y]",
        xlabel="half opening u / mm",
        ylabel="load P / N",
        reference=[("first alone, beam theory", 0.5 * BEAM.dcb_opening(a, load), load)],
    )
    second = history["area[second]"] / WIDTH
    history.plot(
        out / "lengths.png",
        x="u[pin_upper.y]",
        y="a[first]",
        xlabel="half opening u / mm",
        ylabel="length / mm",
        label="first",
        reference=[("second", history["u[pin_upper.y]"], second)],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/two_cracks"))
