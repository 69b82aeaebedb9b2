# # A keyword deck with *DEBOND
#
# Users of keyword programs bring their models as decks. This one is the double cantilever beam of
# `demos/dcb.py` in their words: generated nodes and elements, a contact pair of which a node set is
# bonded, and a step in which `*DEBOND` with `*FRACTURE CRITERION, TYPE=VCCT` lets it come apart.
#
#     fxcrack run dcb.inp            # runs it
#     fxcrack run dcb.inp --check    # says what is read, replaced, refused
#
# In Python, `fx.read_deck` gives the scene and its steps, which can be changed before they run.
# Here the scene of the deck is compared with the same scene written in Python.
"""A keyword deck with *DEBOND beside the same scene in Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.dcb import dcb_2d

# Nodes are numbered 10000 j + i, those of the lower arm 1000000 more.
TEXT = """*HEADING
double cantilever beam, T300/1076, units N, mm, MPa
*PARAMETER
n = {n}
m = {m}
last = n + 1
top = 10000*m + 1
topend = 10000*m + n + 1
first = int(0.3*n) + 1
*NODE
1, 0., 0.
<last>, 100., 0.
<top>, 0., 1.5
<topend>, 100., 1.5
1000001, 0., -1.5
<lowend>, 100., -1.5
<face>, 0., 0.
<faceend>, 100., 0.
*PARAMETER
lowend = 1000000 + last
face = 1000000 + top
faceend = 1000000 + topend
upperelement = 1
lowerelement = 1000001
right = 2
rightup = 10002
up = 10001
lowright = 1000002
lowrightup = 1010002
lowup = 1010001
*NGEN, NSET=UPPER_FACE
1, <last>
*NGEN, NSET=TOP
<top>, <topend>
*NFILL
UPPER_FACE, TOP, <m>, 10000
*NGEN, NSET=BOTTOM
1000001, <lowend>
*NGEN, NSET=LOWER_FACE
<face>, <faceend>
*NFILL
BOTTOM, LOWER_FACE, <m>, 10000
*ELEMENT, TYPE=CPE4
<upperelement>, 1, <right>, <rightup>, <up>
<lowerelement>, 1000001, <lowright>, <lowrightup>, <lowup>
*ELGEN, ELSET=ARMS
1, <n>, 1, 1, <m>, 10000, 10000
1000001, <n>, 1, 1, <m>, 10000, 10000
*NSET, NSET=BONDED, GENERATE
<first>, <last>
*SURFACE, NAME=UPPER, TYPE=NODE
UPPER_FACE
*SURFACE, NAME=LOWER, TYPE=NODE
LOWER_FACE
*SOLID SECTION, ELSET=ARMS, MATERIAL=PLY
25.
*MATERIAL, NAME=PLY
*ELASTIC, TYPE=ENGINEERING CONSTANTS
139400., 10160., 10160., 0.30, 0.30, 0.436, 4600., 4600.
3540.
*CONTACT PAIR, INTERACTION=FACES, SMALL SLIDING, ADJUST=0.
UPPER, LOWER
*SURFACE INTERACTION, NAME=FACES
25.
*INITIAL CONDITIONS, TYPE=CONTACT
UPPER, LOWER, BONDED
*STEP, NAME=OPEN, INC=2000
*STATIC
0.05, 1., 1E-7, 0.05
*BOUNDARY
<top>, 1, 1
<top>, 2, 2, {opening}
1000001, 1, 1
1000001, 2, 2, -{opening}
*DEBOND, SLAVE=UPPER, MASTER=LOWER
*FRACTURE CRITERION, TYPE=VCCT, TOLERANCE=0.05
0.1703, 0.494, 0.494, 1.62
*CONTROLS, TYPE=VCCT LINEAR SCALING
0.9
*END STEP
"""


def write(path: Path, n: int = 200, m: int = 4, opening: float = 1.0) -> Path:
    """Write the deck with n elements along an arm and m over its height; collective."""
    comm = MPI.COMM_WORLD
    if comm.rank == 0:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(TEXT.format(n=n, m=m, opening=opening))
    comm.Barrier()
    return path


def same_in_python(n: int = 200, m: int = 4, opening: float = 1.0) -> tuple[fx.Scene, fx.Static]:
    """The scene and the step of the deck, written by hand."""
    bond = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: x[0] >= 30.0 - 1e-9,
        contact=True,
        name="UPPER",
    )
    scene = fx.Scene(
        dcb_2d(length=100.0, height=1.5, dx=100.0 / n, ny=m),
        materials=fx.Orthotropic(
            E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
        ),
        model=fx.PlaneStrain(thickness=25.0),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=opening),
            fx.Displacement("pin_bottom", x=0.0, y=-opening),
        ],
        debonds=[
            fx.Debond(bond, fx.VCCT(GIc=0.1703, GIIc=0.494, mix=fx.BK(eta=1.62), tolerance=0.05))
        ],
    )
    step = fx.Static(
        until=fx.Time(1.0), stepping="increment", initial=0.05, minimum=1e-7, maximum=0.05,
        max_increments=2000, linear_scaling=0.9,
    )  # fmt: skip
    return scene, step


def run(out: Path, n: int = 200, m: int = 4) -> tuple[fx.History, fx.History]:
    """Histories of the deck and of the scene in Python."""
    deck = fx.read_deck(write(out / "dcb.inp", n, m))
    by_hand, step = same_in_python(n, m)
    history, other = deck.run(), by_hand.run(step)
    deck.scene.close()
    by_hand.close()
    return history, other


def main(out: Path, fine: bool = False) -> None:
    """Run both, print the table, write histories."""
    history, other = run(out, *((400, 8) if fine else (200, 4)))
    rows = []
    for name, found in (("deck", history), ("Python", other)):
        column = next(c for c in found.columns if c.startswith("R[") and c.endswith(".y]"))
        last = found.rows[-1]
        rows.append([name, len(found), float(np.max(found[column])), last["a[UPPER]"]])
    table("The deck and the same scene in Python",
          ["", "rows", "largest load / N", "last a / mm"], rows)  # fmt: skip
    history.to_csv(out / "deck.csv")
    history.plot(out / "load_opening.png")
    if MPI.COMM_WORLD.rank == 0:
        print(f"files in {out}; try: fxcrack run {out / 'dcb.inp'} --check")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/deck"))
