"""Couplings of decks that distribute the load of a reference node."""

from __future__ import annotations

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.deck.cards import DeckError
from tests.decks import PLATE, read, write

BLOCK = """*NODE, NSET=ALL
1, 0., 0., 0.
2, 1., 0., 0.
3, 3., 0., 0.
11, 0., 2., 0.
12, 1., 2., 0.
13, 3., 2., 0.
101, 0., 0., 4.
102, 1., 0., 4.
103, 3., 0., 4.
111, 0., 2., 4.
112, 1., 2., 4.
113, 3., 2., 4.
*NODE, NSET=REF
999, 2., 1.5, 5.
*ELEMENT, TYPE=C3D8, ELSET=BLOCK
1, 1, 2, 12, 11, 101, 102, 112, 111
2, 2, 3, 13, 12, 102, 103, 113, 112
*NSET, NSET=BELOW
1, 2, 3, 11, 12, 13
*SURFACE, NAME=TOP
BLOCK, S2
*SOLID SECTION, ELSET=BLOCK, MATERIAL=M
*MATERIAL, NAME=M
*ELASTIC
1000., 0.
*COUPLING, CONSTRAINT NAME=C, REF NODE=REF, SURFACE=TOP
*DISTRIBUTING
1, 6
*BOUNDARY
BELOW, 1, 3
*STEP{nlgeom}
*STATIC
1., 1.
{load}
*END STEP
"""


def nodal_forces(tmp_path, text):
    """Positions and forces of the only load, each of shape (n, 3)."""
    found = read(tmp_path, text)
    (load,) = found.arguments["loads"]
    x = found.raw.points[found.raw.groups[load.where].rows[:, 0]]
    space = np.zeros((len(x), 3))
    space[:, : x.shape[1]] = x
    forces = np.zeros_like(space)
    for i, value in enumerate(load.value):
        forces[:, i] = (value(space.T) if callable(value) else value) / len(x)
    return space, forces


@pytest.mark.parametrize(
    "load, moment",
    [
        ((1.0, 2.0, -3.0), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (4.0, -5.0, 6.0)),
        ((0.5, 0.0, 2.0), (0.0, 1.0, 1.0)),
    ],
)
def test_the_forces_have_the_resultants_of_the_load(tmp_path, load, moment):
    lines = [f"REF, {i + 1}, {v}" for i, v in enumerate((*load, *moment)) if v]
    x, f = nodal_forces(tmp_path, BLOCK.format(nlgeom="", load="*CLOAD\n" + "\n".join(lines)))
    assert len(x) == 6 and np.all(x[:, 2] == 4.0)
    assert f.sum(axis=0) == pytest.approx(load, abs=1e-12)
    about = np.cross(x - np.array([2.0, 1.5, 5.0]), f).sum(axis=0)
    assert about == pytest.approx(moment, abs=1e-11)


def test_a_force_through_the_centre_is_shared_by_area(tmp_path):
    # faces of 1 x 2 and 2 x 2: the centre of the nodes, weighted by their areas, is at x = 1.5
    text = BLOCK.format(nlgeom=", NLGEOM", load="*CLOAD\nREF, 3, 6.")
    text = text.replace("2., 1.5, 5.", "1.5, 1., 5.")
    x, f = nodal_forces(tmp_path, text)
    shares = {0.0: 0.5, 1.0: 1.5, 3.0: 1.0}
    assert f[:, 2] == pytest.approx([shares[c] for c in x[:, 0]])
    deck = fx.read_deck(write(tmp_path, text.replace(", NLGEOM", "")))
    last = deck.run().rows[-1]
    # such forces are those of a uniform traction of 1: u = 1 x 4 / 1000, v is the work per factor
    assert last["v[REF]"] == pytest.approx(6.0 * 0.004, rel=1e-10)
    assert last["R[BELOW.z]"] == pytest.approx(-6.0, rel=1e-10)
    deck.scene.close()


def test_a_couple_in_the_plane(tmp_path):
    text = PLATE + (
        "*NODE, NSET=REF\n99, 3., 0.5\n*COUPLING, CONSTRAINT NAME=C, REF NODE=99, SURFACE=END\n"
        "*DISTRIBUTING\n*STEP\n*STATIC\n*BOUNDARY\nLEFT, 1, 2\n*CLOAD\nREF, 6, 2.\nREF, 2, 4.\n"
        "*END STEP\n"
    )
    x, f = nodal_forces(tmp_path, text)
    assert f.sum(axis=0) == pytest.approx([0.0, 4.0, 0.0])
    # 2 and the arm of 1 make a couple of 6 over the height of 1
    assert sorted(f[:, 0]) == pytest.approx([-6.0, 6.0])
    assert np.cross(x - np.array([3.0, 0.5, 0.0]), f).sum(axis=0)[2] == pytest.approx(2.0)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("*DISTRIBUTING\n1, 6", "*DISTRIBUTING\n1, 3", "releases components"),
        ("*DISTRIBUTING\n", "*DISTRIBUTING, WEIGHTING METHOD=CUBIC\n", "WEIGHTING METHOD=CUBIC"),
        ("REF, 3, 1.", "REF, 7, 1.", "component 7 of a load on a reference node"),
        ("*STEP\n", "*STEP, NLGEOM\n", "through the centre of its surface only"),
        ("SURFACE=TOP\n*D", "SURFACE=EDGE\n*D", "lie on a line or at a point"),
        (
            "*COUPLING, CONSTRAINT NAME=C, REF NODE=REF, SURFACE=TOP\n",
            "",
            "directly after \\*COUPL",
        ),
        ("*DISTRIBUTING\n1, 6\n", "", "or \\*DISTRIBUTING must follow"),
    ],
)
def test_couplings_that_are_refused(tmp_path, old, new, words):
    text = BLOCK.format(nlgeom="", load="*CLOAD\nREF, 3, 1.\nREF, 4, 1.")
    edge = "*NSET, NSET=LINE\n101, 102, 103\n*SURFACE, TYPE=NODE, NAME=EDGE\nLINE\n*MATERIAL"
    text = text.replace("*MATERIAL", edge)
    assert old in text
    with pytest.raises(DeckError, match=words):
        read(tmp_path, text.replace(old, new))


def test_forces_that_vary_with_position(tmp_path):
    deck = fx.read_deck(write(tmp_path, BLOCK.format(nlgeom="", load="*CLOAD\nREF, 3, 1.")))
    bent = fx.PointForce("BELOW", (0.0, 0.0, lambda x: x[0]))
    scene = deck.scene.rebuilt(loads=[bent])
    last = scene.run(fx.Static(until=fx.Time(1.0))).rows[-1]
    # on six nodes at x = 0, 1, 3, each the sixth part of its value
    assert last["R[BELOW.z]"] == pytest.approx(-8.0 / 6.0, rel=1e-12)
    for wrong in (lambda x: x[:, :1], lambda x: "a"):
        with pytest.raises(fx.InputError, match="load 'BELOW'"):
            scene.rebuilt(loads=[fx.PointForce("BELOW", (0.0, 0.0, wrong))]).run(
                fx.Static(until=fx.Time(1.0))
            )
    deck.scene.close()
