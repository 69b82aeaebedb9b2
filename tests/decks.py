"""Decks as text for several test files: a plate, a block, a double cantilever beam."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

from fxcrack.deck.deck import translated
from fxcrack.deck.translate import Translated

PLATE = """*HEADING
plate of two elements
*NODE, NSET=ALL
1, 0., 0.
2, 1., 0.
3, 2., 0.
4, 0., 1.
5, 1., 1.
6, 2., 1.
*ELEMENT, TYPE=CPE4, ELSET=PLATE
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*NSET, NSET=LEFT
1, 4
*NSET, NSET=RIGHT
3, 6
*ELSET, ELSET=LAST
2,
*SURFACE, NAME=END
LAST, S2
*SOLID SECTION, ELSET=PLATE, MATERIAL=STEEL
2.0
*MATERIAL, NAME=STEEL
*ELASTIC
200., 0.25
"""
STEP = """*STEP
*STATIC
0.5, 1.
*BOUNDARY
LEFT, 1, 2
RIGHT, 1, 1, 0.1
*END STEP
"""

BONDED = """*NODE, NSET=ALL
1, 0., 1.
2, 1., 1.
3, 2., 1.
4, 3., 1.
5, 4., 1.
11, 0., 2.
12, 1., 2.
13, 2., 2.
14, 3., 2.
15, 4., 2.
21, 0., 0.
22, 1., 0.
23, 2., 0.
24, 3., 0.
25, 4., 0.
31, 0., 1.
32, 1., 1.
33, 2., 1.
34, 3., 1.
35, 4., 1.
*ELEMENT, TYPE=CPE4, ELSET=UPPER
1, 1, 2, 12, 11
2, 2, 3, 13, 12
3, 3, 4, 14, 13
4, 4, 5, 15, 14
*ELEMENT, TYPE=CPE4, ELSET=LOWER
11, 21, 22, 32, 31
12, 22, 23, 33, 32
13, 23, 24, 34, 33
14, 24, 25, 35, 34
*SURFACE, NAME=TOP
UPPER, S1
*SURFACE, NAME=BOTTOM
LOWER, S3
*NSET, NSET=BOND
2, 3, 4, 5
*SOLID SECTION, ELSET=UPPER, MATERIAL=M
*SOLID SECTION, ELSET=LOWER, MATERIAL=M
*MATERIAL, NAME=M
*ELASTIC
1000., 0.3
*CONTACT PAIR, SMALL SLIDING, INTERACTION=I
TOP, BOTTOM
*SURFACE INTERACTION, NAME=I
*INITIAL CONDITIONS, TYPE=CONTACT
TOP, BOTTOM, BOND
"""
"""Two bars of four elements, bonded but for their first node; the criterion is missing."""

OPENED = """*STEP
*STATIC
0.1, 1.
*BOUNDARY
11, 1, 1
11, 2, 2, 0.2
21, 1, 1
21, 2, 2, -0.2
*DEBOND, SLAVE=TOP, MASTER=BOTTOM
{criterion}
*END STEP
"""
VCCT = "*FRACTURE CRITERION, TYPE=VCCT\n0.5, 1.0, 1.0, 2.0"


def bonded(criterion: str = VCCT, *, model: str = BONDED, step: str = OPENED) -> str:
    """The bonded bars with a criterion."""
    return model + step.format(criterion=criterion)


def write(folder: Path, text: str, name: str = "model.inp") -> Path:
    """Write a deck on rank 0; the folder is the same on all ranks."""
    path = folder / name
    if MPI.COMM_WORLD.rank == 0:
        path.write_text(text, encoding="utf-8")
    MPI.COMM_WORLD.Barrier()
    return path


def read(folder: Path, text: str, name: str = "model.inp") -> Translated:
    """The deck in the words of a scene; on one rank."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return translated(path)
