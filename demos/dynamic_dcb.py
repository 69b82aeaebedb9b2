# # A double cantilever beam opened by impact
#
# Implicit dynamics with VCCT: the pins of a DCB at rest are torn apart at a constant speed. At
# 0.1 m/s the crack follows the quasi-static curve. At 8 m/s most of the work goes into the motion
# of the arms, and the waves in them bring the crack on its way at three quarters of the opening.
# Bonds are released progressively: a sudden release would shake the arms and break the next bonds
# at once.
# Units N, mm, s, tonne; plane strain.
#
# What must hold, whatever the speed: work of the pins = strain energy + kinetic energy + what the
# bonds took, to 1e-4 (all terms count by the trapezoidal rule; numerical damping is in the work);
# and the crack stays far below the Rayleigh wave speed. The scale of time is the first period of an
# arm as a cantilever,
#
#     T = (2 pi/3.516) sqrt(rho b h a^4/(E' I)),      E' = E/(1 - nu^2).
"""Crack growth under slow and fast opening, by implicit dynamics with VCCT."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d

Array = npt.NDArray[np.float64]

E, NU, RHO = 70e3, 0.3, 2.7e-9
HEIGHT, WIDTH, A0, UNTIL, G_IC = 1.5, 20.0, 30.0, 45.0, 0.2
STRIP = E / (1.0 - NU**2)
PERIOD = 2.0 * np.pi / 3.516 * np.sqrt(12.0 * RHO / STRIP) * A0**2 / HEIGHT
SHEAR_SPEED = np.sqrt(0.5 * E / (1.0 + NU) / RHO)
RAYLEIGH_SPEED = (0.862 + 1.14 * NU) / (1.0 + NU) * SHEAR_SPEED
"""Viktorov's approximation, within 0.5 %."""
SPEEDS = {"0.1 m/s": 1e2, "2 m/s": 2e3, "8 m/s": 8e3}
"""Speed of each pin, mm/s."""


def make_scene(
    dx: float, speed: float | None, comm: MPI.Intracomm = MPI.COMM_WORLD
) -> tuple[fx.Scene, fx.Interface]:
    """The specimen; without a speed of the pins there is no inertia, and time is their way."""
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= A0 - 1e-9, name="bond"
    )
    scene = fx.Scene(
        dcb_2d(comm, length=80.0, height=HEIGHT, dx=dx, ny=max(2, round(HEIGHT / dx)), order=2),
        materials=fx.Isotropic(E, NU, density=RHO),
        model=fx.PlaneStrain(thickness=WIDTH),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=speed or 1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-(speed or 1.0)),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IC), release=fx.ProgressiveRelease())],
        effects=[fx.Inertia(rho_inf=0.5)] if speed else [],
    )
    return scene, bond


def run(
    dx: float,
    speed: float | None,
    *,
    until: float = UNTIL,
    steps: float = 40.0,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
) -> fx.History:
    """Grow the crack, with so many time steps per period of an arm, or quasi-statically."""
    scene, bond = make_scene(dx, speed, comm)
    end = fx.CrackLength(bond, until)
    if speed is None:
        history = scene.run(fx.Static(until=end))
    else:
        dt = min(PERIOD / steps, 0.01 / speed)
        history = scene.run(fx.Dynamic(until=(end, fx.Time(4.0 / speed)), dt=dt))
    scene.close()
    return history


def passages(history: fx.History, lengths: Array) -> Array:
    """Times at which the crack has first reached some lengths."""
    a, time = history["a[bond]"].astype(float), history["time"].astype(float)
    return np.array([time[np.argmax(a >= x - 1e-6)] for x in lengths])


def main(out: Path, fine: bool = False) -> None:
    """All speeds, the table, crack length and load against the way of the pins."""
    dx = 0.5 if fine else 1.0
    checkpoint_point = run(dx, None)
    lengths = np.arange(A0 + 1.0, UNTIL + 0.5)
    way = passages(checkpoint_point, lengths)
    moving = {name: run(dx, speed) for name, speed in SPEEDS.items()}
    rows, curves = [], []
    for name, history in moving.items():
        speed = SPEEDS[name]
        times = passages(history, lengths)
        ratio = speed * times / way
        # over 3 mm: the front moves element by element
        fastest = (lengths[3:] - lengths[:-3]) / (times[3:] - times[:-3])
        work = history["external_work"].astype(float)
        balance = np.abs(history["balance"].astype(float)).max() / work.max()
        kinetic = history["kinetic_energy"].astype(float).max() / work.max()
        rows.append(
            [
                *(name, ratio.min(), ratio.max(), fastest.max() / 1e3),
                *(fastest.max() / RAYLEIGH_SPEED, kinetic, f"{balance:.0e}"),
            ]
        )
        curves.append((name, 2.0 * speed * history["time"].astype(float), history))
    table(
        f"Growth from {A0:g} to {UNTIL:g} mm; first period of an arm {1e3 * PERIOD:.2f} ms",
        [
            "pins",
            "least opening / static",
            "largest",
            "fastest growth / (m/s)",
            "/ Rayleigh speed",
            "kinetic energy / work",
            "balance / work",
        ],
        rows,
    )
    for name, _, history in curves:
        history.to_csv(out / f"{name.split()[0].replace('.', '_')}_m_s.csv")
    checkpoint_point.plot(
        out / "crack_length.png",
        x=2.0 * checkpoint_point["time"].astype(float),
        y="a[bond]",
        xlabel="opening of the pins / mm",
        ylabel="crack length a / mm",
        label="quasi-static",
        reference=[(name, x, h["a[bond]"].astype(float)) for name, x, h in curves],
    )
    checkpoint_point.plot(
        out / "load.png",
        x=2.0 * checkpoint_point["time"].astype(float),
        y="R[pin_top.y]",
        xlabel="opening of the pins / mm",
        ylabel="load P / N",
        label="quasi-static",
        reference=[
            (name, x, h["R[pin_top.y]"].astype(float))
            for name, x, h in curves[:-1]  # the fastest would hide the others
        ],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/dynamic_dcb"))
