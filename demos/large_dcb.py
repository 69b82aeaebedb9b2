# # Double cantilever beam with large rotations
#
# Two thin spring-steel strips, glued together beyond a0 = 40 mm with a tough adhesive, are peeled
# apart. Before the crack grows each arm has bent by more than a third of its length, and the load
# is far above the one of a linear analysis. Units N, mm, MPa; plane strain, E' = E/(1 - nu^2).
#
# An arm is an elastica of length L = a + chi h, clamped at the crack tip, with a force P that keeps
# its direction. With the slope t along the arm and t0 at its end
#
#     E' I t'^2/2 = P (sin t0 - sin t),
#     L = sqrt(E' I/2P) int_0^t0 dt/sqrt(sin t0 - sin t),
#     w = sqrt(E' I/2P) int_0^t0 sin t dt/sqrt(sin t0 - sin t).
#
# By the first line the bending energy per length and P sin t have the same sum all along the arm.
# That sum is what the energy changes by per length of arm: at the root, where t = 0, it is the
# bending energy, at the end the load times the sine of the slope. So for both arms
#
#     G = M_root^2/(b E' I) = 2 P sin(t0)/b.
#
# The second form needs no beam: it is J for loads at a point, at any rotation. To first order in
# (opening/a)^2 these are the corrections of Williams (1987) in ISO 15024,
#
#     P = 3 E' I w/(L^3 N),  G = 3 P w F/(b L N),  N = 1 - 9/35 (2w/L)^2,  F = 1 - 3/10 (2w/L)^2.
"""Double cantilever beam at large rotations beside the elastica and a linear analysis."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.optimize import brentq

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.beam import two_arms
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.spacing import fine_region

Array = npt.NDArray[np.float64]

E, NU, HEIGHT, WIDTH, G_IC = 200e3, 0.3, 0.5, 25.0, 2.0
LENGTH, A0 = 100.0, 40.0
STRIP = E / (1.0 - NU**2)
BEAM = CorrectedBeam(E=STRIP, E22=STRIP, G=0.5 * E / (1.0 + NU), h=HEIGHT, b=WIDTH)


# ## The elastica
#
# t = t0 (1 - s^2) takes the root out of the integrals; Gauss points do the rest.
def elastica(t0: float) -> tuple[float, float]:
    """P L^2/(E I) and w/L of a cantilever whose end has turned by t0."""
    x, weight = np.polynomial.legendre.leggauss(40)
    s = 0.5 * (x + 1.0)
    t = t0 * (1.0 - s**2)
    d = 0.5 * weight * 2.0 * t0 * s / np.sqrt(np.sin(t0) - np.sin(t))
    return 0.5 * d.sum() ** 2, float(d @ np.sin(t) / d.sum())


def at_opening(a: float, opening: float) -> tuple[float, float]:
    """Load and G of the elastica at an opening of both arms together."""
    length = a + BEAM.chi * HEIGHT
    t0 = brentq(lambda t: elastica(t)[1] - 0.5 * opening / length, 1e-3, 1.5)
    load = elastica(t0)[0] * STRIP * BEAM.inertia / length**2
    return load, 2.0 * load * np.sin(t0) / WIDTH


def at_growth(a: float) -> tuple[float, float]:
    """Load and opening of the elastica at which G is the toughness."""
    length = a + BEAM.chi * HEIGHT
    scale = STRIP * BEAM.inertia / length**2
    t0 = brentq(lambda t: 2.0 * elastica(t)[0] * scale * np.sin(t) / WIDTH - G_IC, 1e-3, 1.5)
    load, w = elastica(t0)
    return load * scale, 2.0 * w * length


# ## The scene
#
# The pins sit on the middle line of the arms and move across only; the far end is held. Turning
# elements are slender: second order bends them well.
def strips(dx: float, ny: int, until: float, comm: MPI.Intracomm) -> fx.Mesh:
    """Both strips, with pins at mid-height and the corners that tell the slope of the end."""

    def make() -> Blocks:
        x = fine_region(LENGTH, dx, fine=(A0 - 2.0 * dx, until + 3.0 * dx), coarse_dx=8.0 * dx)
        model, upper, lower = two_arms(x, HEIGHT, ny, cell="quadrilateral", order=2)
        for name, arm, sign in (("top", upper, 1.0), ("bottom", lower, -1.0)):
            model.group(f"pin_{name}", arm.part(x=0.0, y=0.5 * sign * HEIGHT))
        model.group("outer", upper.part(x=0.0, y=HEIGHT))
        model.group("inner", upper.part(x=0.0, y=0.0))
        return model

    return build(comm, "large_dcb", make, None)


def make_scene(
    dx: float = 0.5,
    ny: int = 2,
    until: float = 60.0,
    *,
    law: str = "St. Venant-Kirchhoff",
    comm: MPI.Intracomm = MPI.COMM_WORLD,
) -> tuple[fx.Scene, fx.Interface]:
    """The specimen; the law is "linear", "St. Venant-Kirchhoff" or "neo-Hookean"."""
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= A0 - 1e-9, name="bond"
    )
    scene = fx.Scene(
        strips(dx, ny, until, comm),
        materials=fx.NeoHookean(E, NU) if law == "neo-Hookean" else fx.Isotropic(E, NU),
        model=fx.PlaneStrain(thickness=WIDTH),
        supports=[
            fx.Displacement("pin_top", y=0.5),
            fx.Displacement("pin_bottom", y=-0.5),
            fx.Displacement("far_upper", x=0.0, y=0.0),
            fx.Displacement("far_lower", x=0.0, y=0.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IC))],
        monitors=[
            fx.Monitor("outer", (1.0, 0.0), name="outer"),
            fx.Monitor("inner", (1.0, 0.0), name="inner"),
        ],
        effects=[] if law == "linear" else [fx.FiniteStrain()],
    )
    return scene, bond


def run(
    dx: float = 0.5, ny: int = 2, until: float = 60.0, **options: Any
) -> tuple[fx.Scene, Array]:
    """Grow the crack, options as above.

    Returns:
        The scene; columns a, opening, load, G, 2 P sin(slope of the end)/b at each onset.
    """
    scene, bond = make_scene(dx, ny, until, **options)
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until), maximum=4.0))
    at = np.isin(history["event"], ["onset", "unstable"])
    a, opening, load, rate, outer, inner = (
        history[c][at].astype(float)
        for c in ("a[bond]", "time", "R[pin_top.y]", "GI[bond]", "m[outer]", "m[inner]")
    )
    slope = (outer - inner) / HEIGHT  # sine of it, where the end stays straight
    return scene, np.array([a, opening, load, rate, 2.0 * load * slope / WIDTH]).T


def corrections(a: float, opening: float) -> tuple[float, float]:
    """Load over that of linear theory and G over 3 P w/(b L) after ISO 15024."""
    square = (opening / (a + BEAM.chi * HEIGHT)) ** 2
    n, f = 1.0 - 9.0 / 35.0 * square, 1.0 - 0.3 * square
    return 1.0 / n, f / n


def main(out: Path, fine: bool = False) -> None:
    """Both analyses, the table, the curves and the deformed specimen."""
    size = (0.25, 4) if fine else (0.5, 2)
    scene, found = run(*size)
    _, straight = run(*size, law="linear")
    rows = []
    for a, opening, load, rate, by_slope in found[:: max(1, len(found) // 5)]:
        exact, exact_rate = at_opening(a, opening)
        line = BEAM.dcb_load(a, 1.0) * opening / BEAM.dcb_opening(a, BEAM.dcb_load(a, 1.0))
        norm = line * corrections(a, opening)[0]
        rows.append(
            [a, opening, *(load / x for x in (1.0, exact, norm, line))]
            + [rate / x for x in (exact_rate, by_slope)]
        )
    table(
        "Load and G at the same crack length and opening",
        [
            "a / mm",
            "opening / mm",
            "load / N",
            "load / elastica",
            "load / ISO 15024",
            "load / linear",
            "G / elastica",
            "G b/(2 P sin t0)",
        ],
        rows,
    )
    a = np.linspace(A0, found[-1, 0], 60)
    growth = np.array([at_growth(x) for x in a])
    load = BEAM.dcb_load(a, G_IC)
    if MPI.COMM_WORLD.rank == 0:
        balance = np.abs(scene.history["balance"]).max() / scene.history["external_work"].max()
        print(f"energy balance within {balance:.1e} of the work")
    scene.history.to_csv(out / "large_dcb.csv")
    scene.history.plot(
        out / "load_opening.png",
        x="time",
        y="R[pin_top.y]",
        xlabel="opening / mm",
        ylabel="load P / N",
        label="finite strain",
        reference=[
            ("elastica, growing", growth[:, 1], growth[:, 0]),
            ("linear analysis", [0.0, *straight[:, 1]], [0.0, *straight[:, 2]]),
            ("linear beam, growing", BEAM.dcb_opening(a, load), load),
        ],
    )
    fx.plots.deformed(scene, out / "deformed.png", scale=1.0)


if __name__ == "__main__":
    main(*arguments(__doc__, "out/large_dcb"))
