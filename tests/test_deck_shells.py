"""Continuum shells of decks: strips of SC8R elements beside beam theory."""

from __future__ import annotations

import pytest

import fxcrack as fx
from fxcrack.deck.cards import DeckError
from tests.decks import read, write

STRIP = """*NODE
1, 0., 0., 0.
11, 10., 0., 0.
101, 0., 1., 0.
111, 10., 1., 0.
*NGEN, NSET=A
1, 11
*NGEN, NSET=B
101, 111
*NSET, NSET=LOW
A, B
*NCOPY, OLD SET=LOW, CHANGE NUMBER=1000, SHIFT
0., 0., 0.2
*ELEMENT, TYPE=SC8R
1, 1, 2, 102, 101, 1001, 1002, 1102, 1101
*ELGEN, ELSET=STRIP
1, 10, 1, 1
*NSET, NSET=ROOT
1, 101, 1001, 1101
*NSET, NSET=TIP
11, 111, 1011, 1111
*ORIENTATION, NAME=O
1., 0., 0., 0., 1., 0.
3, {turn}
*MATERIAL, NAME=PLY
*ELASTIC, TYPE=ENGINEERING CONSTANTS
1000., 100., 100., 0., 0., 0., 100., 100.
100.
*BOUNDARY
ROOT, ENCASTRE
{section}
*STEP
*STATIC
1., 1.
*CLOAD
TIP, 3, 0.25E-3
*NODE PRINT, NSET=TIP
U3
*END STEP
"""
PLAIN = "*SHELL SECTION, ELSET=STRIP, MATERIAL=PLY, ORIENTATION=O\n0.2, 5"
LAYERS = """*SHELL SECTION, ELSET=STRIP, COMPOSITE, ORIENTATION=O
0.05, 3, PLY, 90.
0.1, 3, PLY, 0.
0.05, 3, PLY, 90."""


def deflection(tmp_path, section, turn=0.0):
    deck = fx.read_deck(write(tmp_path, STRIP.format(section=section, turn=turn)))
    value = deck.run().rows[-1]["m[U3 TIP]"]
    deck.scene.close()
    return value


def beam(bending):
    """Tip deflection of the strip, width 1, shear stiffness 5/6 G h."""
    return 1e-3 * (10.0**3 / (3.0 * bending) + 10.0 / (5.0 / 6.0 * 100.0 * 0.2))


def test_a_strip_of_one_ply_along_and_across(tmp_path):
    # one element over the thickness, 50 times as long as high
    inertia = 0.2**3 / 12.0
    assert deflection(tmp_path, PLAIN) == pytest.approx(beam(1000.0 * inertia), rel=0.01)
    across = deflection(tmp_path, PLAIN, turn=90.0)
    assert across == pytest.approx(beam(100.0 * inertia), rel=0.01)


def test_a_strip_of_three_plies(tmp_path):
    inner = 0.1**3 / 12.0
    bending = 1000.0 * inner + 100.0 * (0.2**3 / 12.0 - inner)
    # the laminate's shear factor is not 5/6; shear is 0.4 % of this deflection
    assert deflection(tmp_path, LAYERS) == pytest.approx(beam(bending), rel=0.015)


@pytest.mark.parametrize(
    "old, new, words",
    [
        (", ORIENTATION=O", ", STACK DIRECTION=1", "STACK DIRECTION must be 3"),
        (", ORIENTATION=O", ", POISSON=0.3", "POISSON is not available"),
        ("MATERIAL=PLY", "MATERIAL=NO", "there is no material 'NO'"),
        ("*SHELL SECTION", "*SOLID SECTION", "shell elements need"),
        (", ORIENTATION=O", ", OFFSET=SPOS", "OFFSET and SYMMETRIC are not available in continuum"),
    ],
)
def test_shell_sections_that_are_refused(tmp_path, old, new, words):
    text = STRIP.format(section=PLAIN.replace(old, new), turn=0.0)
    with pytest.raises(DeckError, match=words):
        read(tmp_path, text)


def test_what_is_replaced_is_said(tmp_path):
    found = read(tmp_path, STRIP.format(section=LAYERS, turn=0.0))
    assert found.raw.order == 2 and "second order with 27 nodes" in found.report.replaced[0]
    (shell,) = found.arguments["materials"].values()
    assert [p.angle for p in shell.laminate.plies] == [90.0, 0.0, 90.0]
    assert found.raw.groups[shell.top].rows.shape == (10, 9)
