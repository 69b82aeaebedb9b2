"""Constraints of decks whose reference nodes are free, loaded, or prescribed in part."""

from __future__ import annotations

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.deck.cards import DeckError
from tests.decks import write

LENGTH, E = 10.0, 1000.0
BEAM = """*NODE
1, 0., -0.5
11, 10., -0.5
101, 0., 0.5
111, 10., 0.5
*NODE, NSET=REF
999, 12., 0.
*NGEN, NSET=BELOW
1, 11, 1
*NGEN, NSET=ABOVE
101, 111, 1
*ELEMENT, TYPE=CPS4, ELSET=BEAM
1, 1, 2, 102, 101
*ELGEN, ELSET=BEAM
1, 10, 1, 1
*NSET, NSET=LEFT
1, 101
*NSET, NSET=RIGHT
11, 111
*ELSET, ELSET=LAST
10,
*SURFACE, NAME=END
LAST, S2
*SOLID SECTION, ELSET=BEAM, MATERIAL=M
1.,
*MATERIAL, NAME=M
*ELASTIC
1000., 0.
*BOUNDARY
LEFT, 1, 2
"""
"""A cantilever of the length 10 and the height 1, its reference node 2 beyond its end."""
KINEMATIC = "*COUPLING, CONSTRAINT NAME=BLOCK, REF NODE=REF, SURFACE=END\n*KINEMATIC\n"
INERTIA = 1.0 / 12.0


def last_row(tmp_path, text, order=2):
    """Last row of the history of a deck, and its scene's supports."""
    deck = fx.read_deck(write(tmp_path, text), order=order)
    row = deck.run(progress=False).rows[-1]
    supports = deck.scene.input.supports
    deck.scene.close()
    return row, supports


def stepped(*cards):
    return "\n".join(["*STEP", "*STATIC", "1., 1.", *cards, "*END STEP", ""])


RIGID = [
    KINEMATIC,
    KINEMATIC + "1, 6\n",
    KINEMATIC + "1, 2\n",  # both components of a plane follow: a rigid section as well
    "*RIGID BODY, REF NODE=999, TIE NSET=RIGHT\n",
    "*RIGID BODY, REF NODE=999, PIN NSET=RIGHT\n",
    "*MPC\nBEAM, RIGHT, REF\n",
]


@pytest.mark.parametrize("constraint", RIGID)
def test_a_moment_on_a_free_reference(tmp_path, constraint):
    """Pure bending: the reference turns by M L / E I, exactly with nu = 0 and second order."""
    row, _ = last_row(tmp_path, BEAM + constraint + stepped("*CLOAD", "REF, 6, 2."))
    work = 2.0 * 2.0 * LENGTH / (E * INERTIA)  # of the load factor 1
    assert row["v[REF]"] == pytest.approx(work, rel=1e-9)


def test_a_force_beside_the_body(tmp_path):
    """A force at the reference bends the beam with its lever of 2; axial force stretches it."""
    text = BEAM + KINEMATIC + stepped("*CLOAD", "REF, 2, 1.")
    row, _ = last_row(tmp_path, text)
    bending = ((LENGTH + 2.0) ** 3 - 2.0**3) / (3.0 * E * INERTIA)
    shear = LENGTH / (5.0 / 6.0 * 0.5 * E)
    # the clamp and the rigid end hold back warping, part of the 0.4 % that shear gives
    assert row["v[REF]"] == pytest.approx(bending + shear, rel=2e-3)
    row, _ = last_row(tmp_path, BEAM + KINEMATIC + stepped("*CLOAD", "REF, 1, 1."))
    assert row["v[REF]"] == pytest.approx(LENGTH / E, rel=1e-9)


def test_a_reference_that_is_prescribed_in_part(tmp_path):
    """Hinged loading: the displacement is given, the rotation is free; and the other way round."""
    text = BEAM + KINEMATIC + stepped("*BOUNDARY", "REF, 6, 6, 0.01")
    row, supports = last_row(tmp_path, text)
    assert row["R[BLOCK.rz]"] == pytest.approx(E * INERTIA * 0.01 / LENGTH, rel=1e-9)
    (one,) = (s for s in supports if isinstance(s, fx.Coupling))
    assert one.point == (12.0, 0.0) and one.prescribed == {"rz": 0.01} and one.components == "xy"
    text = BEAM + KINEMATIC + stepped("*BOUNDARY", "REF, 2, 2, 0.1", "REF, 1, 1")
    row, _ = last_row(tmp_path, text)
    force = row["R[BLOCK.y]"]
    bending = ((LENGTH + 2.0) ** 3 - 2.0**3) / (3.0 * E * INERTIA)
    assert force == pytest.approx(0.1 / bending, rel=6e-3)  # shear: 0.4 %
    text = BEAM + KINEMATIC + stepped("*BOUNDARY", "REF, 2, 2, 0.1", "*CLOAD", "REF, 6, 1.")
    row, _ = last_row(tmp_path, text)
    assert row["R[BLOCK.y]"] < force  # the moment helps


def test_a_reference_on_the_body(tmp_path):
    """The reference may be a node of the body; what is prescribed there moves the whole set."""
    for text in (
        KINEMATIC.replace("NODE=REF", "NODE=111") + "1, 1\n",
        "*MPC\nPIN, 11, 111\n",
        "*EQUATION\n2\n11, 1, 1., 111, 1, -1.\n",
    ):
        row, _ = last_row(tmp_path, BEAM + text + stepped("*CLOAD", "111, 1, 2."), order=1)
        if "KINEMATIC" in text:  # the set may turn, and the force is beside its middle
            assert row["v[111]"] > 2.0 * LENGTH / E
        else:
            # both nodes have one displacement: the same as a force on each
            assert row["v[111]"] == pytest.approx(4.0 * LENGTH / E, rel=1e-9)


@pytest.mark.parametrize("factor", [1.0, -2.0])
def test_a_force_on_a_dummy_node(tmp_path, factor):
    """u(RIGHT) = factor u(REF): a force F on the dummy is F / factor on the face."""
    equation = f"*EQUATION\n2\nRIGHT, 1, 1., REF, 1, {-factor}\n"
    row, _ = last_row(tmp_path, BEAM + equation + stepped("*CLOAD", "REF, 1, 3."))
    assert row["v[REF]"] == pytest.approx((3.0 / factor) ** 2 * LENGTH / E, rel=1e-9)


def test_faces_that_differ_by_a_dummy_node(tmp_path):
    """u(RIGHT) - u(LEFT) = u(REF), free and loaded or prescribed: uniform strain."""
    free = BEAM.replace("LEFT, 1, 2", "1, 1, 2\n11, 2, 2")
    faces = "*EQUATION\n3\nRIGHT, 1, 1., LEFT, 1, -1., REF, 1, -1.\n"
    row, _ = last_row(tmp_path, free + faces + stepped("*CLOAD", "REF, 1, 4."))
    assert row["v[REF]"] == pytest.approx(4.0 * 4.0 * LENGTH / E, rel=1e-9)
    row, _ = last_row(tmp_path, free + faces + stepped("*BOUNDARY", "REF, 1, 1, 0.2"))
    assert row["R[RIGHT.value]"] == pytest.approx(E * 0.2 / LENGTH, rel=1e-9)
    # sets in another order: nodes belong together as the deck says, not by their place
    crossed = free.replace("*NSET, NSET=LEFT\n1, 101", "*NSET, NSET=LEFT, UNSORTED\n101, 1")
    row, supports = last_row(
        tmp_path, crossed + faces + stepped("*BOUNDARY", "REF, 1, 1, 0.2"), order=1
    )
    assert sum(isinstance(s, fx.Equation) for s in supports) == 2
    total = row["R[RIGHT.value]"] + row["R[RIGHT 2.value]"]
    assert total == pytest.approx(E * 0.2 / LENGTH, rel=1e-9)


def test_a_mean_that_is_prescribed(tmp_path):
    """*DISTRIBUTING with a prescribed reference: the mean of the face moves and turns."""
    mean = KINEMATIC.replace("*KINEMATIC", "*DISTRIBUTING")
    row, _ = last_row(tmp_path, BEAM + mean + stepped("*BOUNDARY", "REF, 6, 6, 0.01"), order=1)
    rigid, _ = last_row(
        tmp_path, BEAM + KINEMATIC + stepped("*BOUNDARY", "REF, 6, 6, 0.01"), order=1
    )
    # two nodes have no motion that is not rigid in the plane but their distance
    assert row["R[BLOCK.rz]"] == pytest.approx(rigid["R[BLOCK.rz]"], rel=1e-6)


PART = (
    "*PART, NAME=P\n"
    + BEAM.replace("*BOUNDARY\nLEFT, 1, 2\n", "").split("*MATERIAL")[0]
    + KINEMATIC
    + "*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I1, PART=P\n*END INSTANCE\n"
    "*INSTANCE, NAME=I2, PART=P\n0., 5., 0.\n0., 5., 0., 0., 5., 1., 90.\n*END INSTANCE\n"
    "*END ASSEMBLY\n*MATERIAL, NAME=M\n*ELASTIC\n1000., 0.\n"
    "*BOUNDARY\nI1.LEFT, 1, 2\nI2.LEFT, 1, 2\n"
)


def test_constraints_inside_parts(tmp_path):
    """A constraint of a part holds in each of its instances, turned with it."""
    row, supports = last_row(tmp_path, PART + stepped("*CLOAD", "I1.REF, 6, 2.", "I2.REF, 6, 2."))
    points = sorted(s.point for s in supports if isinstance(s, fx.Coupling))
    assert np.allclose(points, [(0.0, 17.0), (12.0, 0.0)])
    for name in ("I1.REF", "I2.REF"):
        assert row[f"v[{name}]"] == pytest.approx(4.0 * LENGTH / (E * INERTIA), rel=1e-9)


@pytest.mark.parametrize(
    "text, words",
    [
        (KINEMATIC + "2, 2\n" + stepped("*CLOAD", "REF, 1, 1."), "not follow its reference node"),
        (KINEMATIC + "1, 7\n" + stepped(), "none of 1 to 6"),
        (
            KINEMATIC.replace("SURFACE", "INFLUENCE RADIUS=1., SURFACE") + stepped(),
            "no node of the surface lies within",
        ),
        ("*MPC\nLINK, 11, 111\n" + stepped(), "BEAM, TIE and PIN are"),
        ("*EQUATION\n2\nRIGHT, 1, 1., BELOW, 1, -1.\n" + stepped(), "sets of as many as the first"),
        ("*EQUATION\n2\nRIGHT, 1, 1., REF, 7, -1.\n" + stepped(), "none of 1 to 6"),
        (
            "*EQUATION\n2\nRIGHT, 1, 1., REF, 1, -1.\n" + stepped("*CLOAD", "REF, 6, 1."),
            "carries no moment",
        ),
        (
            KINEMATIC + "*EQUATION\n2\n6, 1, 1., REF, 1, -1.\n" + stepped("*CLOAD", "REF, 1, 1."),
            "reference node of a coupling",
        ),
        (KINEMATIC + stepped("*BOUNDARY", "RIGHT, 1, 1, 0.1"), "moves it as well"),
        (KINEMATIC.replace("*KINEMATIC\n", "") * 2 + stepped(), "must follow"),
    ],
)
def test_constraints_that_are_refused(tmp_path, text, words):
    with pytest.raises(DeckError, match=words):
        fx.read_deck(write(tmp_path, BEAM + text)).run(progress=False)


def test_loads_of_a_reference_node_by_amplitudes_of_their_own(tmp_path):
    """Each is a load of the scene with a name of its own, as are those of a surface named alike."""
    curves = "*AMPLITUDE, NAME=A\n0., 0., 1., 1.\n*AMPLITUDE, NAME=B\n0., 1., 1., 1.\n"
    pull = "*CLOAD, AMPLITUDE=A\nREF, 1, 2.", "*CLOAD, AMPLITUDE=B\nREF, 2, 3."
    push = "*CLOAD\nEND, 1, 1.", "*DSLOAD\nEND, P, 1."
    ends = "*NSET, NSET=END\n11, 111\n"
    deck = fx.read_deck(
        write(tmp_path, BEAM + KINEMATIC + curves + ends + stepped(*pull, *push)), order=2
    )
    names = [load.title for load in deck.scene.input.loads]
    assert len(names) == 4 == len(set(names))
    deck.scene.close()
