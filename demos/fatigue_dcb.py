# # Fatigue of a double cantilever beam: N(a) by a Paris law
#
# The specimen of `dcb.py` is opened to u = 0.67 mm and closed to a tenth of it (R = 0.1), with the
# laws of NASA/CR-2010-216723 for T300/1076, in N/mm and mm:
#
#     onset   N0 = 2.8461e-9 dG^-12.415       growth   da/dN = 2.44e6 dG^10.61
#
# between the threshold G_max = 0.060 and the limit 0.9 G_Ic, dG = G_max - G_min = (1 - R^2) G_max.
# At fixed opening G falls with a, G = G0 (ae0/ae)^4 with ae = a + chi h, and so
#
#     N(a) = N0 + (ae^(4m+1) - ae0^(4m+1))/(C ((1 - R^2) G0)^m ae0^(4m) (4m+1)),   C, m of growth.
#
# N goes with G^10.6: one per cent in G is eleven in N. The cycles of an element are therefore the
# integral of its Paris law between G at its beginning and G at its end, log-linear in between.
#
# A cycle costs two small dense equilibria, and one is solved per release: millions of cycles take a
# second, on one factorisation.
"""Fatigue growth in a double cantilever beam beside the integral of its Paris law."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from mpi4py import MPI
from scipy.interpolate import CubicSpline

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.demos.dcb import ARMS, BEAM, G_IC
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.output.plots.style import COLOURS, dress, legend, new_figure, save

Array = npt.NDArray[np.float64]

A0, U_MAX, RATIO = 30.0, 0.67, 0.1
PARIS = fx.Paris(c1=2.8461e-9, c2=-12.415, c3=2.44e6, c4=10.61, r1=0.060 / G_IC, r2=0.9)
# What may drive growth at a load ratio R, beside dG.
DRIVES = {"dG": "dG", "G_max": "G_max", "dK": "dK", "Walker, gamma = 0.4": fx.Walker(0.4)}
# The arms of the beam in plane strain: E11/(1 - nu12 nu21).
STRAIN_BEAM = replace(BEAM, E=BEAM.E / (1.0 - 0.30**2 * BEAM.E22 / BEAM.E))


def make_scene(
    dx: float, ny: int, criterion: fx.VCCT | fx.Fatigue
) -> tuple[fx.Scene, fx.Interface]:
    """The specimen with elements dx long where the crack runs."""
    mesh = dcb_2d(length=100.0, height=1.5, dx=dx, ny=ny, fine=(29.5, 38.5), coarse_dx=0.25)
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= A0 - 1e-6, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials=ARMS,
        model=fx.PlaneStrain(thickness=BEAM.b),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0),
        ],
        debonds=[fx.Debond(bond, criterion)],
    )
    return scene, bond


@dataclass(frozen=True)
class StaticRate:
    """G(a) at the largest opening, from the stiffness k(a) of a static run: G = -u^2 k'(a)/b."""

    stiffness: CubicSpline

    def __call__(self, a: npt.ArrayLike) -> Array:
        """G at crack lengths, force/length."""
        return np.asarray(-(U_MAX**2) * self.stiffness(a, 1) / BEAM.b)

    def cycles(self, a: npt.ArrayLike, law: fx.Paris = PARIS, ratio: float = RATIO) -> Array:
        """Cycles of growth from A0: the integral of da/(c3 dG^c4)."""
        x = np.linspace(A0, float(np.max(a)), 20001)
        top = self(x)
        inverse = 1.0 / law.growth(fx.CycleRates((1.0 - ratio**2) * top, top, np.array(G_IC)))
        steps = 0.5 * (inverse[1:] + inverse[:-1]) * np.diff(x)
        return np.interp(a, x, np.concatenate([[0.0], np.cumsum(steps)]))

    def onset(self, law: fx.Paris = PARIS, ratio: float = RATIO) -> float:
        """Cycles until growth starts."""
        return float(law.onset_cycles((1.0 - ratio**2) * self(A0)))


def static_rate(dx: float = 0.05, ny: int = 16, until: float = 38.0) -> StaticRate:
    """Grow the crack statically and differentiate the stiffness: no crack closure is involved."""
    scene, bond = make_scene(dx, ny, fx.VCCT(GIc=G_IC))
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until)))
    scene.close()
    rows = [row for row in history if row["event"] == "onset"]
    a = [row["a[bond]"] for row in rows]
    return StaticRate(CubicSpline(a, [row["R[pin_top.y]"] / row["u[pin_top.y]"] for row in rows]))


def closed_form(a: npt.ArrayLike, beam: CorrectedBeam = BEAM, ratio: float = RATIO) -> Array:
    """N(a) of corrected beam theory."""
    shift = beam.chi * beam.h
    ae, ae0, power = np.asarray(a) + shift, A0 + shift, 4.0 * PARIS.c4 + 1.0
    rate = 9.0 * beam.E * beam.inertia * U_MAX**2 / (beam.b * ae0**4)
    dG = (1.0 - ratio**2) * rate
    grown = ae0 / (PARIS.growth_rate(dG) * power) * ((ae / ae0) ** power - 1.0)
    return np.asarray(PARIS.onset_cycles(dG) + grown)


@dataclass(frozen=True)
class Result:
    """A fatigue run.

    Attributes:
        history: Its history.
        a: Crack lengths, from A0 on.
        N: Cycles at which they are reached; at A0, those until growth starts.
        seconds: Wall-clock time of the whole curve, setting up the scene apart.
    """

    history: fx.History
    a: Array
    N: Array
    seconds: float

    def cycles(self, a: npt.ArrayLike) -> Array:
        """N at crack lengths."""
        return np.interp(a, self.a, self.N)


def run(
    dx: float = 0.05,
    ny: int = 16,
    *,
    ratio: float = RATIO,
    method: str = "closure",
    law: fx.Paris = PARIS,
) -> Result:
    """Cycle until the crack arrests at the threshold."""
    scene, _ = make_scene(dx, ny, fx.Fatigue(GIc=G_IC, paris=law, method=method))
    start = time.perf_counter()
    history = scene.run(fx.Cycles(maximum=U_MAX, ratio=ratio))
    seconds = time.perf_counter() - start
    scene.close()
    rows = [row for row in history if row["event"] in ("cycle", "release")]
    a, N = (np.array([row[name] for row in rows]) for name in ("a[bond]", "N"))
    top, dG = np.array([rows[0]["G_max[bond]"]]), np.array([rows[0]["dG[bond]"]])
    N[0] = law.onset(fx.CycleRates(dG, top, np.array(G_IC)))[0]
    return Result(history, a, N, seconds)


def main(out: Path, fine: bool = False) -> None:
    """Run, print the tables, write N(a) as a picture and as a table of numbers."""
    dx, ny = (0.025, 32) if fine else (0.05, 16)
    static, found = static_rate(dx, ny), run(dx, ny)
    at = np.array([31.0, 32.0, 33.0, 34.0, 35.0, 37.0])
    integral = static.onset() + static.cycles(at)
    beam = closed_form(at, STRAIN_BEAM)
    table(
        f"Cycles to a crack length, u = {U_MAX}, R = {RATIO}, elements of {dx}",
        ["a / mm", "N", "Paris integral", "ratio", "beam, plane strain", "ratio", "beam, E11"],
        np.column_stack(
            [at, found.cycles(at), integral, found.cycles(at) / integral, beam,
             found.cycles(at) / beam, closed_form(at)]
        ).tolist(),
    )  # fmt: skip
    rows = []
    for size in (4.0 * dx, 2.0 * dx, dx):
        same = static if size == dx else static_rate(size, ny)
        for method in ("closure", "vcct"):
            other = run(size, ny, method=method)
            share = other.cycles(at) / (same.onset() + same.cycles(at))
            rows.append([method, size, *share])
    table(
        "N over the Paris integral on the same mesh",
        ["method", "element / mm", *(f"a = {a:g}" for a in at)],
        rows,
    )
    # The same constants with other driving forces: at R = 0 all of them are G_max.
    rows, coarser = [], static_rate(2.0 * dx, ny)
    for name, drive in DRIVES.items():
        law = replace(PARIS, c1=0.0, drive=drive)
        for ratio in (0.1, 0.5):
            other = run(2.0 * dx, ny, ratio=ratio, law=law).cycles(34.0)
            expected = coarser.cycles(34.0, law, ratio)
            rows.append([name, ratio, float(other), float(expected), float(other / expected)])
    table(
        "Cycles of growth from 30 to 34 mm by the driving force of the law",
        ["D", "R", "N", "integral", "ratio"],
        rows,
    )
    found.history.to_csv(out / "fatigue_dcb.csv")
    found.history.to_json(out / "fatigue_dcb.json")

    def draw() -> Figure:
        figure, ax = new_figure()
        a = np.linspace(A0, found.a[-1], 200)
        ax.plot(found.N, found.a, color=COLOURS[0], linewidth=2.0, label="computed")
        ax.plot(
            static.onset() + static.cycles(a), a, "--", color=COLOURS[1], linewidth=1.6,
            label="Paris integral over the static G(a)",
        )  # fmt: skip
        ax.plot(
            closed_form(a, STRAIN_BEAM), a, ":", color=COLOURS[2], linewidth=1.6,
            label="corrected beam theory",
        )  # fmt: skip
        dress(ax, xlabel="Cycles N", ylabel="Crack length a / mm")
        ax.set_xscale("log")
        legend(ax)
        return figure

    save(MPI.COMM_WORLD, out / "cycles.png", draw)
    fx.plots.paris(
        found.history,
        out / "paris.png",
        "bond",
        xlabel="Range $\\Delta G$ / (N/mm)",
        ylabel="d$a$/d$N$ / mm",
    )
    if MPI.COMM_WORLD.rank == 0:
        d = found.history.details
        print(
            f"{d['releases']} releases in {found.N[-1]:.3g} cycles, {d['factorizations']} "
            f"factorisation(s), {found.seconds:.2f} s; {found.history.reason} (a = "
            f"{found.a[-1]:.5g}); files in {out}"
        )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/fatigue_dcb"))
