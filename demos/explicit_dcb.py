# # A double cantilever beam opened fast, implicitly and explicitly
#
# The specimen of `dynamic_dcb.py` with first-order elements. Explicit dynamics takes thousands of
# increments that cost a sparse product each; implicit dynamics takes few that cost a factorisation
# or a back-solve with iterations. Which is cheaper depends on the speed: explicit increments are
# what the waves need, whatever the loading, so their number goes with the duration.
#
# What must hold: both give the same crack, within a few percent of the opening on this mesh;
# energies that balance to round-off; exactly G_c per area.
# Units N, mm, s, tonne; plane strain.
"""Implicit and explicit dynamics of one specimen, from slow loading to impact."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.dynamic_dcb import A0, G_IC, HEIGHT, NU, PERIOD, RHO, WIDTH, E
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d

Array = npt.NDArray[np.float64]

SPEEDS = {"8 m/s": 8e3, "20 m/s": 2e4}
"""Speed of each pin, mm/s."""
SLOW = {"0.5 m/s": 5e2, "2 m/s": 2e3}
"""Those that --fine runs as well, ten minutes."""
UNTIL = 44.0


def run(
    dx: float,
    speed: float,
    *,
    explicit: bool,
    until: float = UNTIL,
    steps: float = 160.0,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
) -> tuple[fx.History, float]:
    """Grow the crack; the history, and seconds of processor time.

    Args:
        dx: Length of the elements.
        speed: Of each pin.
        explicit: Central differences instead of the generalised alpha method.
        until: Length of the crack at the end.
        steps: Implicit increments per period of an arm.
        comm: Communicator.
    """
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= A0 - 1e-9, name="bond",
        contact=True,
    )  # fmt: skip
    scene = fx.Scene(
        dcb_2d(comm, length=80.0, height=HEIGHT, dx=dx, ny=max(2, round(HEIGHT / dx))),
        materials=fx.Isotropic(E, NU, density=RHO),
        model=fx.PlaneStrain(thickness=WIDTH),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=speed),
            fx.Displacement("pin_bottom", x=0.0, y=-speed),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_IC), release=fx.ProgressiveRelease())],
        effects=[fx.Inertia(lumped=True)],
    )
    ends = [fx.CrackLength(bond, until), fx.Time(4.0 / speed)]
    start = time.process_time()
    if explicit:
        history = scene.run(fx.Explicit(until=ends, rows=1000))
    else:
        dt = min(PERIOD / steps, 0.01 / speed)
        history = scene.run(fx.Dynamic(until=ends, dt=dt))
    seconds = time.process_time() - start
    scene.close()
    return history, seconds


def openings(history: fx.History, speed: float, lengths: Array) -> Array:
    """Opening of both pins when the crack first has some lengths, shape (n,)."""
    a, at = history["a[bond]"].astype(float), history["time"].astype(float)
    return np.array([2.0 * speed * at[np.argmax(a >= x - 1e-6)] for x in lengths])


def main(out: Path, fine: bool = False) -> None:
    """All speeds, the table with the cost of both, crack length against opening."""
    dx = 0.5 if fine else 1.0
    lengths = np.arange(A0 + 2.0, UNTIL + 0.5, 2.0)
    rows, curves = [], []
    for name, speed in (SLOW | SPEEDS if fine else SPEEDS).items():
        (one, seconds), (other, others) = (run(dx, speed, explicit=e) for e in (True, False))
        ratio = openings(one, speed, lengths) / openings(other, speed, lengths)
        work = one["external_work"].astype(float)
        rows.append(
            [
                *(name, ratio.min(), ratio.max(), one["kinetic_energy"].max() / work.max()),
                f"{np.abs(one['balance'].astype(float)).max() / work.max():.0e}",
                *(seconds, others),
            ]
        )
        for kind, history in (("explicit", one), ("implicit", other)):
            x = 2.0 * speed * history["time"].astype(float)
            curves.append((f"{name}, {kind}", x, history["a[bond]"].astype(float)))
    table(
        f"Growth from {A0:g} to {UNTIL:g} mm",
        [
            "pins",
            "least opening / implicit",
            "largest",
            "kinetic energy / work",
            "balance / work",
            "s, explicit",
            "s, implicit",
        ],
        rows,
    )
    out.mkdir(parents=True, exist_ok=True)
    label, x, y = curves[-2]  # those of the last explicit run
    one.plot(
        out / "explicit_dcb.png",
        x=x,
        y=y,
        xlabel="opening of the pins / mm",
        ylabel="crack length a / mm",
        label=label,
        reference=[*curves[:-2], curves[-1]],
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/explicit_dcb"))
