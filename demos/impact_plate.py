# # A plate with a delamination is hit
#
# Explicit dynamics in three dimensions. A square plate of two equal layers, clamped at its edge,
# has a round delamination in its middle. A smooth pulse of pressure of a few microseconds hits a
# patch above it. The layers bend together and slide on each other; contact keeps them from passing
# through each other, and the front runs in shear where the toughness is reached.
#
# A quarter is computed. What must hold: below some impulse the front rests, above it the
# delaminated area grows with the impulse; the growth is in shear, so the bonds dissipate G_IIc per
# area; energies balance to round-off through contact, friction and releases.
# Units N, mm, s, tonne.
"""Growth of a delamination in a plate by the impulse of an impact, by explicit dynamics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_3d

E, NU, RHO = 60e3, 0.3, 1.6e-9
G_IC, G_IIC, BK_POWER = 0.3, 0.9, 1.8
SIDE, LAYER = 30.0, 1.5
"""Half the side of the plate and thickness of a layer, mm."""
START, PATCH = 8.0, 4.0
"""Radius of the delamination at first, and of the patch that is hit, mm."""
PULSE, END = 6e-6, 40e-6
"""Duration of the pulse and of the run, s."""
PRESSURES = (50.0, 200.0, 400.0, 600.0)
"""Peaks of the pulse, MPa."""


def run(
    peak: float, dx: float = 1.5, end: float = END, comm: MPI.Intracomm = MPI.COMM_WORLD
) -> fx.History:
    """Hit the plate.

    Args:
        peak: Largest pressure of the pulse.
        dx: Length of the elements in the plane of the plate.
        end: Time at which the run ends.
        comm: Communicator.
    """
    bond = fx.Interface(
        slave="upper_face", master="lower_face", name="bond", contact=True, friction=0.3,
        bonded=lambda x: np.hypot(x[0], x[2]) >= START - 1e-9,
    )  # fmt: skip
    pulse = fx.SmoothStep((0.0, 0.5 * PULSE, PULSE), (0.0, 1.0, 0.0))
    hit = fx.Pressure(
        "top", lambda x: np.where(np.hypot(x[0], x[2]) < PATCH, peak, 0.0), amplitude=pulse
    )
    clamped = [
        fx.Displacement(name, x=0.0, y=0.0, z=0.0) for name in ("far_upper", "far_lower", "side_w")
    ]
    scene = fx.Scene(
        dcb_3d(comm, length=SIDE, width=SIDE, height=LAYER, dx=dx, dy=dx, ny=2),
        materials=fx.Isotropic(E, NU, density=RHO),
        model=fx.Solid(),
        supports=[
            fx.Displacement("end_upper", x=0.0), fx.Displacement("end_lower", x=0.0),
            fx.Displacement("side_0", z=0.0), *clamped,
        ],
        loads=[hit],
        debonds=[fx.Debond(bond, fx.VCCT(G_IC, G_IIC, mix=fx.BK(BK_POWER)))],
        monitors=[fx.Monitor("pin_top", (0.0, 1.0, 0.0), "line")],
        effects=[fx.Inertia()],
    )  # fmt: skip
    history = scene.run(fx.Explicit(until=fx.Time(end), rows=100))
    scene.close()
    return history


def main(out: Path, fine: bool = False) -> None:
    """All pulses, the table, and the growth of the area in time."""
    dx = 0.75 if fine else 1.5
    rows, curves = [], []
    for peak in PRESSURES:
        history = run(peak, dx)
        area, spent = (history[c].astype(float) for c in ("area[bond]", "spent[bond]"))
        work = float(history["external_work"].astype(float).max())
        mixity = history["GII[bond]"].astype(float) + history["GIII[bond]"].astype(float)
        total = mixity + history["GI[bond]"].astype(float)
        at = int(np.argmax(total))
        rows.append(
            [
                *(peak, float(area[-1] - area[0]), float(history["released[bond]"][-1])),
                *(float(spent[-1]), float(mixity[at] / total[at])),
                float(history["contact_energy"][-1] + history["friction_energy"][-1]) / work,
                f"{np.abs(history['balance'].astype(float)).max() / work:.0e}",
            ]
        )
        curves.append((f"{peak:g} MPa", 1e6 * history["time"].astype(float), area - area[0]))
    table(
        "A quarter of a plate with a delamination under a pulse of pressure",
        [
            *("peak / MPa", "growth / mm^2", "nodes", "spent / (N/mm)", "shear share of G"),
            *("contact and friction / work", "balance / work"),
        ],
        rows,
    )
    out.mkdir(parents=True, exist_ok=True)
    label, x, y = curves[-1]
    history.plot(
        out / "impact_plate.png",
        x=x,
        y=y,
        xlabel="time / us",
        ylabel="growth of a quarter / mm$^2$",
        label=label,
        reference=curves[:-1],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/impact_plate"))
