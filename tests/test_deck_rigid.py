"""Rigid surfaces in decks: analytical ones, and flat ones of rigid elements."""

from __future__ import annotations

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.deck.cards import DeckError
from fxcrack.deck.deck import translated as read_path
from tests.decks import BONDED, OPENED, VCCT, read, write

FLOOR = "*SURFACE, TYPE=SEGMENTS, NAME=FLOOR\nSTART, -5., 0.\nLINE, 5., 0.\n"
ROLL = "*SURFACE, TYPE=SEGMENTS, NAME=FLOOR\nSTART, -5., -5.\nCIRCL, 5., -5., 0., -5.\n"
BODY = "*RIGID BODY, REF NODE=REF, ANALYTICAL SURFACE=FLOOR\n"
BLOCK = f"""*NODE
1, 0., 0.
2, 1., 0.
3, 2., 0.
4, 0., 1.
5, 1., 1.
6, 2., 1.
90, 0., 0.
*NSET, NSET=REF
90
*NSET, NSET=TOP
4, 5, 6
*NSET, NSET=LEFT
1, 4
*ELEMENT, TYPE=CPE4, ELSET=B
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*SURFACE, NAME=LOW
B, S1
*SOLID SECTION, ELSET=B, MATERIAL=M
*MATERIAL, NAME=M
*ELASTIC
100., 0.
{FLOOR}{BODY}*SURFACE INTERACTION, NAME=I
*CONTACT PAIR, INTERACTION=I
LOW, FLOOR
*BOUNDARY
REF, ENCASTRE
LEFT, 1
*STEP
*STATIC
1., 1.
*BOUNDARY
TOP, 2, 2, -0.1
*END STEP
"""
"""A block of area 2 x 1 and modulus 100 above a floor, pressed on it by 0.1."""


def profile(text, kind="SEGMENTS"):
    """The block on another profile."""
    return BLOCK.replace(FLOOR, f"*SURFACE, TYPE={kind}, NAME=FLOOR\n{text}\n")


def master(tmp_path, text):
    (interface,) = read(tmp_path, text).arguments["bonds"]
    return interface.master


def refused(tmp_path, text, words):
    with pytest.raises(DeckError, match=words) as caught:
        read(tmp_path, text)
    assert "model.inp, line" in str(caught.value)


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize(
    ("level", "force", "kind"),
    [(0.0, 20.0, "SURFACE TO SURFACE"), (-0.05, 10.0, "NODE TO SURFACE")],
)
def test_a_block_pressed_on_a_floor(shared_path, level, force, kind):
    """E times strain times width: the gap of the floor below is no part of the strain."""
    text = profile(f"START, -5., {level}\nLINE, 5., {level}")
    text = text.replace("*CONTACT PAIR,", f"*CONTACT PAIR, TYPE={kind},")
    deck = fx.read_deck(write(shared_path, text))
    # the strain is the same everywhere: exact but for round-off
    assert deck.run()["R[TOP.y]"][-1] == pytest.approx(-force, rel=1e-10)
    deck.scene.close()


def test_lines_and_arcs_of_a_plane(tmp_path):
    assert master(tmp_path, BLOCK) == fx.RigidPlane((-5.0, 0.0), (0.0, 1.0))
    two = profile("START, -5., 0.\nLINE, 1., 0.\nLINE, 5., 0.")
    assert master(tmp_path, two) == fx.RigidPlane((-5.0, 0.0), (0.0, 1.0))
    # a clockwise arc has the bodies outside, on its left; a shaft behind it is not met
    roll = profile("START, -5., -9.\nLINE, -5., -5.\nCIRCL, 5., -5., 0., -5.\nLINE, 5., -9.")
    assert master(tmp_path, roll) == fx.RigidCylinder((0.0, -5.0), (0, 0, 1), 5.0)
    bowl = profile("START, -5., 5.\nCIRCL, 0., 0., 0., 5.\nCIRCL, 5., 5., 0., 5.")
    assert master(tmp_path, bowl) == fx.RigidCylinder((0.0, 5.0), (0, 0, 1), 5.0, inside=True)
    ball = profile("START, 0., 0.\nCIRCL, 5., -5., 0., -5.").replace("CPE4", "CAX4")
    assert master(tmp_path, ball) == fx.RigidSphere((0.0, -5.0), 5.0)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("REF, ENCASTRE\n", "", "component 1 of the reference node is free"),
        ("TOP, 2, 2, -0.1", "REF, 2, 2, 0.1", "component 2 of the reference node is moved"),
        ("LINE, 5., 0.", "LINE, 1.5, 0.", "of which 1 nodes lie beyond"),
        ("LINE, 5., 0.", "LINE, 1., 0.\nLINE, 5., -3.", "faces several lines or arcs"),
        ("LINE, 5., 0.", "PARAB, 1., 0., 2., 1.", "'PARAB' is not available"),
        ("LINE, 5., 0.", "CIRCL, 5., 0., 1., 0.", "different distances from the centre"),
        ("START, -5., 0.\n", "", "needs a line START"),
        (BODY, "", r"no \*RIGID BODY has this surface"),
        ("LOW, FLOOR", "FLOOR, LOW", "rigid surfaces are masters"),
        ("TYPE=SEGMENTS", "TYPE=CYLINDER", "is for three dimensions"),
    ],
)  # fmt: skip
def test_rigid_surfaces_that_are_refused(tmp_path, old, new, words):
    refused(tmp_path, BLOCK.replace(old, new), words)


def test_a_floor_of_rigid_elements(tmp_path):
    floor = (
        "*NODE\n91, -5., 0.\n92, 1., 0.\n93, 5., {}\n*ELEMENT, TYPE=R2D2, ELSET=R\n"
        "101, 91, 92\n102, 92, 93\n*SURFACE, NAME=FLOOR\nR, {}\n"
    )
    text = BLOCK.replace(FLOOR, floor).replace("ANALYTICAL SURFACE=FLOOR", "ELSET=R")
    assert master(tmp_path, text.replace("{}", "0.", 1).replace("{}", "SPOS")) == fx.RigidPlane(
        (-5.0, 0.0), (0.0, 1.0)
    )
    refused(tmp_path, text.replace("{}", "1.", 1).replace("{}", "SPOS"), "not lie on one plane")
    refused(tmp_path, text.replace("{}", "0.", 1).replace("{}", "S1"), "have the sides SPOS")
    short = text.replace("5., {}", "1.5, 0.").replace("{}", "SPOS")
    refused(tmp_path, short, "end before the slave surface, of which 1 nodes")


CUBE = """*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
90, 0., 0., 0.
*ELEMENT, TYPE=C3D8, ELSET=B
1, 1, 2, 3, 4, 5, 6, 7, 8
*SURFACE, NAME=LOW
B, S1
*SOLID SECTION, ELSET=B, MATERIAL=M
*MATERIAL, NAME=M
*ELASTIC
100., 0.
{surface}
*RIGID BODY, REF NODE=90, {body}
*SURFACE INTERACTION, NAME=I
*CONTACT PAIR, INTERACTION=I
LOW, FLOOR
*BOUNDARY
90, 1, 6
*STEP
*STATIC
1., 1.
*BOUNDARY
5, 1, 3
*END STEP
"""


@pytest.mark.parametrize(
    ("kind", "lines", "expected"),
    [
        # generators along y: the second axis of the profile is x cross generator = z
        (
            "CYLINDER",
            "0., 0., 0., 1., 0., 0.\n0., 1., 0.\nSTART, -5., 0.\nLINE, 5., 0.",
            fx.RigidPlane((-5.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ),
        (
            "CYLINDER",
            "0., 0., -5., 1., 0., -5.\n0., 1., -5.\nSTART, -5., 0.\nCIRCL, 5., 0., 0., 0.",
            fx.RigidCylinder((0.0, 0.0, -5.0), (0.0, -1.0, 0.0), 5.0),
        ),
        # about z: a disc, and a ball below
        (
            "REVOLUTION",
            "0., 0., 0., 0., 0., 1.\nSTART, 0., 0.\nLINE, 9., 0.",
            None,
        ),
        (
            "REVOLUTION",
            "0., 0., 0., 0., 0., 1.\nSTART, 0., 0.\nCIRCL, 5., -5., 0., -5.",
            fx.RigidSphere((0.0, 0.0, -5.0), 5.0),
        ),
    ],
)
def test_surfaces_in_space(tmp_path, kind, lines, expected):
    surface = f"*SURFACE, TYPE={kind}, NAME=FLOOR\n{lines}"
    text = CUBE.format(surface=surface, body="ANALYTICAL SURFACE=FLOOR")
    found = master(tmp_path, text)
    if expected is None:
        distance, normals = found.measure(np.array([[0.3, 0.4, 2.0]]))
        assert found.flat and distance[0] == 2.0 and np.allclose(normals, [[0, 0, 1]])
    else:
        assert found == expected
    refused(tmp_path, text.replace("90, 1, 6", "90, 1, 5"), "component 6 of the reference")


FACETS = (
    "*NODE\n91, -5., -5.\n92, 5., -5.\n93, 5., 5.\n94, -5., 5.\n*ELEMENT, TYPE=R3D4, ELSET=R\n"
    "9, 91, 92, 93, 94\n*SURFACE, NAME=FLOOR\nR, SPOS"
)


def test_surfaces_of_rigid_facets(tmp_path):
    text = CUBE.format(surface=FACETS, body="ELSET=R")
    assert master(tmp_path, text) == fx.RigidPlane((-5.0, -5.0, 0.0), (0.0, 0.0, 1.0))
    assert master(tmp_path, text.replace("SPOS", "SNEG")).normal == (0.0, 0.0, -1.0)


def test_an_analytical_surface_in_an_instance(tmp_path):
    """A plane y = 0 of a part that its instance turns to z = 0 and moves."""
    lines = CUBE.splitlines()
    floor = (
        "*PART, NAME=F",
        *("*NODE", lines[9], "*SURFACE, TYPE=CYLINDER, NAME=FLOOR"),
        *("START, -5., 0.", "LINE, 5., 0."),
        "*RIGID BODY, REF NODE=90, ANALYTICAL SURFACE=FLOOR",
        "*END PART",
    )
    body = ("*PART, NAME=P", *lines[:9], *lines[10:15], "*END PART")
    part = "\n".join((*body, *floor))
    assembly = (
        "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=P1, PART=P\n*END INSTANCE\n*INSTANCE, NAME=F1, PART=F\n"
        "0., 0., -0.1\n0., 0., -0.1, 1., 0., -0.1, 90.\n*END INSTANCE\n*END ASSEMBLY"
    )
    rest = "\n".join(lines[15:18] + lines[20:]).replace("LOW, FLOOR", "P1.LOW, F1.FLOOR")
    rest = rest.replace("90, 1, 6", "F1.90, 1, 6").replace("5, 1, 3", "P1.5, 1, 3")
    found = master(tmp_path, f"{part}\n{assembly}\n{rest}\n")
    distance, normals = found.measure(np.array([[0.0, 0.0, 0.0]]))
    assert distance[0] == pytest.approx(0.1) and np.allclose(normals, [[0, 0, 1]])


def test_a_half_model_on_a_plane_of_symmetry(tmp_path):
    """Bonds on a rigid plane may hold the opening only, with energy release rates as well."""
    plane = (
        "*NODE\n99, 0., 0.\n*SURFACE, TYPE=SEGMENTS, NAME=PLANE\nSTART, -1., 1.\nLINE, 9., 1.\n"
        "*RIGID BODY, REF NODE=99, ANALYTICAL SURFACE=PLANE\n*BOUNDARY\n99, ENCASTRE\n"
    )
    text = BONDED.replace("TYPE=CONTACT\n", "TYPE=CONTACT, NORMAL\n").replace("BOTTOM", "PLANE")
    text = text.replace("*CONTACT PAIR", plane + "*CONTACT PAIR").replace(
        "*SURFACE, NAME=PLANE", "*SURFACE, NAME=BOTTOM"
    )
    step = OPENED.replace("BOTTOM", "PLANE") + ""
    found = read(tmp_path, text + step.format(criterion=VCCT))
    (debond,) = found.arguments["debonds"]
    assert debond.interface.normal_only and not debond.interface.symmetry
    assert debond.interface.master == fx.RigidPlane((-1.0, 1.0), (0.0, 1.0))
    assert any("of a half model half of the whole" in line for line in found.report.replaced)
    far = text.replace("START, -1., 1.\nLINE, 9., 1.", "START, -1., 0.5\nLINE, 9., 0.5")
    refused(tmp_path, far + step.format(criterion=VCCT), "bonded nodes do not lie on the rigid")


def test_adjusted_gaps_to_a_rigid_surface(tmp_path):
    """Nodes on it begin closed; those of a body beside a cylinder keep their gaps."""
    text = BLOCK.replace("INTERACTION=I\nLOW", "INTERACTION=I, ADJUST=0.\nLOW")
    (flat,) = read(tmp_path, text).arguments["bonds"]
    assert flat.gap == "adjust" and flat.tolerance is None
    found = read(tmp_path, text.replace(FLOOR, ROLL))
    (round_one,) = found.arguments["bonds"]
    assert round_one.gap == "keep" and round_one.tolerance > 0.38  # of the corner, sqrt(29) - 5
    assert any("those to the rigid surface stay" in line for line in found.report.replaced)


def test_stiff_linear_contact_is_exact_contact(tmp_path):
    soft = "NAME=I\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{}\n*CONTACT"
    text = BLOCK.replace("NAME=I\n*CONTACT", soft)
    found = read(tmp_path, text.format("1E4"))  # E / (k h) = 100 / (1E4 1)
    assert any("gives way 0.01 times as much" in line for line in found.report.replaced)
    refused(tmp_path, text.format("100."), "gives way 1 times as much")


SCENES = [
    ("CPE4", fx.RigidPlane((0.3, -0.1), (0.6, 0.8))),
    ("CPE4", fx.RigidCylinder((0.7, -3.0), (0, 0, 1), 2.9)),
    ("CAX4", fx.RigidSphere((0.0, -3.0), 2.9)),
    ("CAX4", fx.RigidCylinder((0.0, 0.0), (0, 1, 0), 2.1, inside=True)),
    ("C3D8", fx.RigidPlane((0.3, 0.2, -0.1), (0.48, 0.36, 0.8))),
    ("C3D8", fx.RigidCylinder((0.7, 0.0, -3.0), (0.6, 0.8, 0.0), 2.9)),
    ("C3D8", fx.RigidSphere((0.3, 0.4, -3.0), 2.9)),
]


@pytest.mark.parametrize(("kind", "surface"), SCENES, ids=lambda v: str(v)[:30])
def test_rigid_masters_that_are_written(tmp_path, kind, surface):
    """A scene written and read again meets the same surface."""
    text = CUBE.format(surface=FACETS, body="ELSET=R") if kind == "C3D8" else BLOCK
    if isinstance(surface, fx.RigidCylinder) and surface.inside:  # it faces the end of the block
        pair = "*CONTACT PAIR, INTERACTION=I\nLOW, FLOOR\n"
        text = text.replace("B, S1", "2, S2").replace(pair, "")
    deck = fx.read_deck(write(tmp_path, text.replace("CPE4", kind)))
    away = fx.Interface("LOW", surface, contact=True, gap="keep", bonded=_nowhere, tolerance=5.0)
    scene = deck.scene.rebuilt(bonds=[away])
    fx.write_deck(scene, deck.steps, tmp_path / "out.inp")
    (found,) = read_path(tmp_path / "out.inp").arguments["bonds"]
    x = scene.pairs[0].surface.x
    mine, its = surface.measure(x), found.master.measure(x)
    # coordinates are written to the last bit, axes are found anew from points: round-off
    assert np.allclose(mine[0], its[0], atol=1e-14) and np.allclose(mine[1], its[1], atol=1e-14)
    scene.close()


def _nowhere(x):
    return np.zeros(np.shape(x)[1], dtype=bool)


def test_rigid_masters_that_are_not_written(tmp_path):
    deck = fx.read_deck(write(tmp_path, BLOCK))
    plane = fx.RigidPlane((0.0, 0.0), (0.0, 1.0))
    whole = fx.Interface("LOW", plane, contact=True, symmetry=True)
    scene = deck.scene.rebuilt(bonds=[whole])
    with pytest.raises(fx.InputError, match="symmetry=True, where rates are those of the whole"):
        fx.write_deck(scene, deck.steps, tmp_path / "out.inp")
    roll = fx.RigidCylinder((0.0, -5.0), (0, 0, 1), 5.0)
    near = fx.Interface("LOW", roll, contact=True, bonded=_nowhere)
    scene = deck.scene.rebuilt(bonds=[near])
    with pytest.raises(fx.InputError, match="slave nodes away from the rigid surface"):
        fx.write_deck(scene, deck.steps, tmp_path / "out.inp")
