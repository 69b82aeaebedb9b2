# # A laminated panel with a delamination under impact, by shells
#
# Explicit dynamics of shells on surface meshes. A square cross-ply panel of carbon fibre, 4 mm
# thick and simply supported at its edge, has a round delamination in its middle plane: two shells,
# one below and one above it, bonded outside. A pulse of pressure of 80 microseconds hits a square
# patch in the middle. The shells bend together and slide on each other, contact holds them apart,
# and the front runs in shear where the toughness is reached. A quarter is computed.
#
# What must hold: the panel without a delamination deflects as the Navier series of a plate with
# shear deformation says; below some pressure the front rests, above it the delaminated area grows;
# it takes G_IIc per area; energies balance to round-off; continuum shells of first order on the
# same grid deflect and open alike.
# Units N, mm, s, tonne.
"""Impact on a laminated panel with a delamination: shells beside Navier and continuum shells."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpi4py import MPI

import fxcrack as fx
from fxcrack.base.arrays import Array
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.sheets import Sheet, sheets
from fxcrack.output import plots
from fxcrack.output.plots.style import COLOURS, dress, legend, save

SIDE, PLY_THICKNESS = 100.0, 0.125
"""Side of the panel and thickness of a ply, mm."""
RADIUS, PATCH = 15.0, 10.0
"""Radius of the delamination at first, and half the side of the patch that is hit, mm."""
PULSE, END = 80e-6, 400e-6
"""Duration of the pulse and of the run, s."""
G_IC, G_IIC, BK_POWER = 0.25, 0.8, 1.8
PRESSURES = (10.0, 15.0, 20.0)
"""Peaks of the pulse, MPa."""
PLY = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3),
    density=1.6e-9,
)  # fmt: skip
HALF = fx.Laminate("[0/90]s", PLY, PLY_THICKNESS).repeated(4)
PULSE_SHAPE = fx.SmoothStep((0.0, 0.5 * PULSE, PULSE), (0.0, 1.0, 0.0))


def _shells(dx: float, comm: MPI.Intracomm) -> dict[str, Any]:
    """Two surface meshes in the middles of the halves, z upwards."""
    grid = np.linspace(0.0, 0.5 * SIDE, round(0.5 * SIDE / dx) + 1)
    z = 0.5 * HALF.thickness
    parts = [
        Sheet(name, grid, grid, lambda a, b, z=z: (a, b, z + 0.0 * a))
        for name, z in (("above", z), ("below", -z))
    ]
    supports: list[Any] = []
    for name in ("above", "below"):
        supports += [fx.Symmetry(f"{name}_a0", "x"), fx.Symmetry(f"{name}_b0", "y")]
        supports += [fx.Symmetry(f"{name}_{edge}", "z") for edge in ("a1", "b1")]
        supports += [fx.Symmetry(f"{name}_a1", "y"), fx.Symmetry(f"{name}_b1", "x")]
    return {
        "mesh": sheets(parts, comm), "model": fx.Shell(), "materials": fx.Section(HALF),
        "supports": supports, "hit": fx.Face("above", "top"), "across": (0, 1),
        "slave": fx.Face("below", "top"), "master": fx.Face("above", "bottom"),
        "centre": ("above_a0b0", (0.0, 0.0, -1.0)),
    }  # fmt: skip


def _continuum_shells(dx: float, comm: MPI.Intracomm) -> dict[str, Any]:
    """Two layers of hexahedra, y upwards."""
    grid = np.linspace(0.0, 0.5 * SIDE, round(0.5 * SIDE / dx) + 1)
    t, along = HALF.thickness, (1.0, 0.0, 0.0)

    def make() -> Blocks:
        model, above, below = two_bodies(
            (grid, grid), (np.array([0.0, t]), np.array([-t, 0.0])), (grid,), cell="hexahedron",
            order=1,
        )  # fmt: skip
        halves = (above, below)
        model.group("middle_x", *(half.part(x=0.0) for half in halves))
        model.group("middle_z", *(half.part(z=0.0) for half in halves))
        model.group("end_x", *(half.part(x=0.5 * SIDE) for half in halves))
        model.group("end_z", *(half.part(z=0.5 * SIDE) for half in halves))
        model.group("centre", above.part(x=0.0, y=t, z=0.0))
        return model

    return {
        "mesh": build(comm, "panel", make),
        "model": fx.Solid(),
        "materials": {
            "upper": fx.ContinuumShell(HALF, "upper_face", "top", axis=along),
            "lower": fx.ContinuumShell(HALF, "bottom", "lower_face", axis=along),
        },
        "supports": [
            fx.Displacement("middle_x", x=0.0), fx.Displacement("middle_z", z=0.0),
            fx.Displacement("end_x", y=0.0, z=0.0), fx.Displacement("end_z", x=0.0, y=0.0),
        ],
        "hit": "top", "across": (0, 2), "slave": "lower_face", "master": "upper_face",
        "centre": ("centre", (0.0, -1.0, 0.0)),
    }  # fmt: skip


def panel(
    peak: float, dx: float = 2.5, *, radius: float = RADIUS, grows: bool = True,
    continuum: bool = False, comm: MPI.Intracomm = MPI.COMM_WORLD,
) -> fx.Scene:  # fmt: skip
    """A quarter of the panel.

    Args:
        peak: Largest pressure of the pulse.
        dx: Length of the cells.
        radius: Of the delamination, 0 for none.
        grows: Whether bonds may fail.
        continuum: Continuum shells in place of shells on surface meshes.
        comm: Communicator.
    """
    given = (_continuum_shells if continuum else _shells)(dx, comm)
    a, b = given.pop("across")
    faces = {side: given.pop(side) for side in ("slave", "master")}
    hit = fx.Pressure(
        given.pop("hit"),
        lambda x: np.where(np.maximum(x[a], x[b]) < PATCH, peak, 0.0),
        amplitude=PULSE_SHAPE,
    )
    if radius > 0.0:
        bond = fx.Interface(
            **faces, name="bond", contact=True,
            bonded=lambda x: np.hypot(x[a], x[b]) >= radius - 1e-9,
        )  # fmt: skip
        tough = 1.0 if grows else 1e6
        criterion = fx.VCCT(tough * G_IC, tough * G_IIC, mix=fx.BK(BK_POWER))
        given["debonds"] = [fx.Debond(bond, criterion)]
    else:
        given["bonds"] = [fx.Interface(**faces, name="bond")]
    where, direction = given.pop("centre")
    return fx.Scene(
        given.pop("mesh"),
        loads=[hit],
        monitors=[fx.Monitor(where, direction, "deflection")],
        effects=[fx.Inertia()],
        **given,
    )


def run(scene: fx.Scene, end: float = END, rows: int = 80) -> tuple[fx.History, float]:
    """Hit the panel; the history and seconds."""
    start = time.perf_counter()
    history = scene.run(fx.Explicit(until=fx.Time(end), rows=rows), progress=False)
    return history, time.perf_counter() - start


def navier(times: Array, peak: float, terms: int = 35) -> Array:
    """Deflection of the middle without a delamination, shape of the times.

    Each term of the double sine series is a system of three unknowns, w and the rotations of the
    normal, of a cross-ply plate with shear deformation (Reddy 2004, section 6.3), whose modes are
    oscillators under the pulse.
    """
    whole = HALF.repeated(2)
    d, shear = whole.abd()[3:, 3:], whole.shear_stiffness()
    mass = PLY.density * whole.thickness
    inertia = np.array([mass, *[mass * whole.thickness**2 / 12.0] * 2])
    fine = np.linspace(0.0, times[-1], 6001)
    pulse = np.array([PULSE_SHAPE(t) for t in fine.tolist()])
    w = np.zeros(len(fine))
    for m in range(1, terms + 1, 2):
        for n in range(1, terms + 1, 2):
            a, b = m * np.pi / SIDE, n * np.pi / SIDE
            s1, s2 = shear[0, 0], shear[1, 1]
            mixed = (d[0, 1] + d[2, 2]) * a * b
            k = np.array(
                [
                    [s1 * a**2 + s2 * b**2, s1 * a, s2 * b],
                    [s1 * a, d[0, 0] * a**2 + d[2, 2] * b**2 + s1, mixed],
                    [s2 * b, mixed, d[2, 2] * a**2 + d[1, 1] * b**2 + s2],
                ]
            )
            q = 16.0 * peak / (np.pi**2 * m * n) * np.sin(a * PATCH) * np.sin(b * PATCH)
            root = np.sqrt(inertia)
            squares, modes = np.linalg.eigh(k / np.outer(root, root))
            for omega, share in zip(np.sqrt(squares), modes[0] ** 2 / mass, strict=True):
                w += q * share / omega * _duhamel(fine, pulse, omega)
    return np.interp(times, fine, w)


def _duhamel(t: Array, f: Array, omega: float) -> Array:
    """int_0^t f(s) sin(omega (t - s)) ds by the trapezoidal rule, shape (n,)."""

    def so_far(values: Array) -> Array:
        steps = 0.5 * (values[1:] + values[:-1]) * np.diff(t)
        return np.concatenate([[0.0], np.cumsum(steps)])

    sine, cosine = np.sin(omega * t), np.cos(omega * t)
    return np.asarray(sine * so_far(f * cosine) - cosine * so_far(f * sine))


def values(history: fx.History, column: str) -> Array:
    """A column as numbers."""
    return history[column].astype(float)


def main(out: Path, fine: bool = False) -> None:
    """All pulses, the tables, and the picture of the hardest one."""
    dx = 1.25 if fine else 2.5
    rows, curves = [], []
    whole, seconds = run(panel(PRESSURES[0], dx, radius=0.0, grows=False))
    theory = navier(values(whole, "time"), PRESSURES[0])
    off = np.abs(values(whole, "m[deflection]") - theory).max() / theory.max()
    table(
        "The panel without a delamination",
        ["cells", "peak / MPa", "largest deflection / mm", "off Navier / largest", "s"],
        [[f"{dx:g} mm", PRESSURES[0], float(theory.max()), float(off), seconds]],
    )
    for peak in PRESSURES:
        scene = panel(peak, dx)
        history, seconds = run(scene)
        if peak < PRESSURES[-1]:
            scene.close()
        rows.append(["shells", *_row(history, peak), seconds])
        curves.append((peak, values(history, "time"), values(history, "m[deflection]")))
    hardest = scene
    scene = panel(PRESSURES[-1], dx, continuum=True)
    history, seconds = run(scene)
    rows.append(["continuum shells", *_row(history, PRESSURES[-1]), seconds])
    solid = values(history, "time"), values(history, "m[deflection]")
    scene.close()
    table(
        "A quarter of the panel with a delamination",
        [
            *("cells", "peak / MPa", "deflection / mm", "growth / mm^2"),
            *("spent / (N/mm)", "balance / work", "s"),
        ],
        rows,
    )

    out.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(12.0, 5.0), dpi=130, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
    t = 1e6 * values(whole, "time")
    left.plot(t, theory / PRESSURES[0], color="0.3", linewidth=1.2, label="no delamination, Navier")
    left.plot(
        t[::4], values(whole, "m[deflection]")[::4] / PRESSURES[0], "o", color="0.3",
        fillstyle="none", markersize=4.5, label="no delamination, shells",
    )  # fmt: skip
    for (peak, at, w), colour in zip(curves, COLOURS, strict=False):
        left.plot(1e6 * at, w / peak, color=colour, label=f"delaminated, {peak:g} MPa")
    left.plot(
        1e6 * solid[0], solid[1] / PRESSURES[-1], "--", color=COLOURS[4], linewidth=1.2,
        label=f"continuum shells, {PRESSURES[-1]:g} MPa",
    )  # fmt: skip
    dress(left, xlabel="time / us", ylabel="deflection of the middle / peak, mm/MPa")
    legend(left)
    plots.front_advance(
        hardest, None, "bond", colour="time", ax=right,
        label="time of release / s", title=f"Delamination of a quarter, {PRESSURES[-1]:g} MPa",
    )  # fmt: skip
    save(MPI.COMM_WORLD, out / "impact_panel.png", lambda: figure)
    hardest.close()


def _row(history: fx.History, peak: float) -> list[Any]:
    area, work = values(history, "area[bond]"), values(history, "external_work")
    return [
        *(peak, float(values(history, "m[deflection]").max()), float(area[-1] - area[0])),
        float(history["spent[bond]"][-1]) if area[-1] > area[0] else "",
        f"{np.abs(values(history, 'balance')).max() / work.max():.0e}",
    ]


if __name__ == "__main__":
    main(*arguments(__doc__, "out/impact_panel"))
