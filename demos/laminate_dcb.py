# # Double cantilever beams of multidirectional laminates
#
# The arms of a double cantilever beam are laminates, meshed ply by ply, and the crack runs between
# any two plies. In plane strain classical laminate theory gives the bending stiffness per width of
# an arm whose middle is free to stretch,
#
#     D = D11 - B11^2/A11,
#
# and with it the load at growth of two arms under equal forces,
#
#     P = b sqrt(2 Gc/(1/D_upper + 1/D_lower))/(a + chi h),
#
# chi from the bending modulus of the arms. A crack that is not at mid-thickness bends the thinner
# arm more, and part of G is mode II. Units N, mm.
"""Double cantilever beams of four lay-ups, meshed ply by ply, against laminate theory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import fxcrack as fx
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.laminate import laminate_2d

G_C = 0.1703
WIDTH, PLY, LENGTH, A0 = 25.0, 0.25, 90.0, 30.0
CFRP = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
)
CASES = {
    "unidirectional": ("[0]_12", 6),
    "cross-ply": ("[0/90]3s", 6),
    "30 degrees": ("[+-30/0/30/-30/0]s", 6),
    "crack off the middle": ("[0/90]3s", 4),
}


def lay_up_of(notation: str) -> fx.Laminate:
    """The laminate, stacked along y: the frame is turned about x."""
    return fx.Laminate(notation, CFRP, PLY, frame=("x", -90.0))


def bending_stiffness(arm: fx.Laminate) -> float:
    """Bending stiffness per width of an arm that is free to stretch [force x length]."""
    abd = arm.abd()
    return float(abd[3, 3] - abd[0, 3] ** 2 / abd[0, 0])


def theory(lay_up: fx.Laminate, crack: int, a: float) -> float:
    """Load at growth."""
    n = len(lay_up.plies)
    arms = [lay_up.part(0.0, crack / n), lay_up.part(crack / n, 1.0)]
    soft = sum(1.0 / bending_stiffness(arm) for arm in arms)
    corrections = []
    for arm in arms:
        h = arm.thickness
        beam = CorrectedBeam(
            E=12.0 * bending_stiffness(arm) / h**3, E22=CFRP.E[1], G=CFRP.G[1], h=h, b=WIDTH
        )
        corrections.append(beam.chi * h)
    return WIDTH * float(np.sqrt(2.0 * G_C / soft)) / (a + float(np.mean(corrections)))


def run(notation: str, crack: int, dx: float = 0.25, until: float = 40.0) -> list[list[float]]:
    """Grow the crack; rows of a, load, load of the theory, share of mode II."""
    lay_up = lay_up_of(notation)
    mesh = laminate_2d(
        plies=lay_up.thicknesses, crack=crack, length=LENGTH, dx=dx, per_ply=1, order=2
    )
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= A0 - 1e-9, name="bond"
    )
    scene = fx.Scene(
        mesh,
        materials=lay_up.layers("ply"),
        model=fx.PlaneStrain(thickness=WIDTH),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=G_C))],
    )
    history = scene.run(fx.Static(until=fx.CrackLength(bond, until + dx)), progress=False)
    rows = []
    for a in (A0, 0.5 * (A0 + until), until):
        row = history.at("a[bond]", a, event="onset")
        one, two = row["GI[bond]"], row["GII[bond]"]
        load = theory(lay_up, crack, row["a[bond]"])
        rows.append([row["a[bond]"], row["R[pin_top.y]"], load, two / (one + two)])
    scene.close()
    return rows


def main(out: Path, fine: bool = False) -> None:
    """Run all lay-ups and print the table."""
    rows: list[list[float | str]] = []
    for name, (notation, crack) in CASES.items():
        for a, load, expected, share in run(notation, crack, 0.125 if fine else 0.25):
            rows.append([name, notation, a, load, expected, load / expected, share])
    columns = ["case", "lay-up", "a / mm", "load / N", "theory", "ratio", "G_II/G"]
    table("Multidirectional double cantilever beams, crack between plies", columns, rows)


if __name__ == "__main__":
    main(*arguments(__doc__, "out/laminate_dcb"))
