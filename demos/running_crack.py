# # A running crack in a strip
#
# Explicit dynamics with VCCT: a strip of half height h between clamped grips, pulled apart by u0
# each, in equilibrium. A long crack along its middle has the same energy release rate everywhere,
#
#     G0 = M u0^2/h,      M = E (1 - nu)/((1 + nu)(1 - 2 nu)),
#
# so that below its toughness it rests, and above it runs at a steady speed below the Rayleigh wave
# speed. How fast, the balance of energy says: what waves of the length of an element carry away is
# missing at the tip. `zone=2` lets bonds soften over two elements, which leaves those waves less.
#
# What must hold: rest at G0 = 0.98 G_c; a speed that grows with G0/G_c and stays below the Rayleigh
# speed; exactly G_c spent per area at any speed; energies that balance to round-off.
# Units N, mm, s, tonne; plane strain.
"""Rest, running and speed of a crack under constant G, by explicit dynamics with VCCT."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d

E, NU, RHO, G_C = 70e3, 0.3, 2.7e-9, 0.2
HALF = 2.0
START, END, LENGTH = 4.0, 11.0, 14.0
"""Crack length at first, where a run ends, and length of the strip, in half heights."""
MODULUS = E * (1.0 - NU) / ((1.0 + NU) * (1.0 - 2.0 * NU))
RAYLEIGH_SPEED = (0.862 + 1.14 * NU) / (1.0 + NU) * np.sqrt(0.5 * E / (1.0 + NU) / RHO)
RATIOS = (0.98, 1.05, 1.2, 1.5, 2.0, 3.0)


def run(
    ratio: float, per_half: int = 10, zone: int = 1, comm: MPI.Intracomm = MPI.COMM_WORLD
) -> fx.History:
    """Let go a crack whose energy release rate is so many times the toughness.

    Args:
        ratio: G0/G_c.
        per_half: Elements over half the height.
        zone: Elements over which a bond softens.
        comm: Communicator.
    """
    u0 = np.sqrt(ratio * G_C * HALF / MODULUS)
    bond = fx.Interface(
        slave="upper_face", master="lower_face", name="bond", contact=True,
        bonded=lambda x: x[0] >= START * HALF - 1e-9,
    )  # fmt: skip
    held = fx.Amplitude((0.0,), (1.0,))
    scene = fx.Scene(
        dcb_2d(comm, length=LENGTH * HALF, height=HALF, dx=HALF / per_half, ny=per_half),
        materials=fx.Isotropic(E, NU, density=RHO),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("top", x=0.0, y=u0, amplitude=held),
            fx.Displacement("bottom", x=0.0, y=-u0, amplitude=held),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_C), release=fx.ProgressiveRelease(zone=zone))],
        effects=[fx.Inertia()],
    )
    end = fx.Time((END - START) * HALF / (0.2 * RAYLEIGH_SPEED))
    history = scene.run(
        fx.Explicit(until=[fx.CrackLength(bond, END * HALF), end], start="equilibrium", rows=400)
    )
    scene.close()
    return history


def speed(history: fx.History) -> float:
    """Speed over the second half of the way, over the Rayleigh speed; 0 at rest."""
    a, time = (history[c].astype(float) for c in ("a[bond]", "time"))
    late = a >= 0.5 * (a[0] + END * HALF)
    if late.sum() < 2:
        return 0.0
    return float(np.polyfit(time[late], a[late], 1)[0] / RAYLEIGH_SPEED)


def main(out: Path, fine: bool = False) -> None:
    """All ratios with both zones, the table, and the way of the tips in time."""
    per_half = 20 if fine else 10
    rows, curves = [], []
    for ratio in RATIOS:
        found = [run(ratio, per_half, zone) for zone in (1, 2)]
        first = found[0]
        stored = float(first["initial_energy"][0])
        rows.append(
            [
                *(ratio, speed(first), speed(found[1]), float(first["spent[bond]"][-1]) / G_C),
                f"{np.abs(first['balance'].astype(float)).max() / stored:.0e}",
            ]
        )
        curves.append((f"G0 = {ratio:g} Gc", first))
    table(
        "Speed of a crack under constant G, over the Rayleigh speed",
        ["G0/Gc", "speed", "speed, zone=2", "energy spent / Gc", "balance / stored"],
        rows,
    )
    out.mkdir(parents=True, exist_ok=True)
    (label, last), *others = reversed(curves)
    last.plot(
        out / "running_crack.png",
        x=1e6 * last["time"].astype(float),
        y=last["a[bond]"].astype(float) / HALF,
        xlabel="time / us",
        ylabel="crack length / half height",
        label=label,
        reference=[
            (name, 1e6 * h["time"].astype(float), h["a[bond]"].astype(float) / HALF)
            for name, h in others
        ],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/running_crack"))
