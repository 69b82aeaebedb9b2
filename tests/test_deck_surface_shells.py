"""Conventional shells of decks (S4R, S3, S8R): sections, sides, rotations, bonded arms."""

from __future__ import annotations

import numpy as np
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
*ELEMENT, TYPE=S4R
1, 1, 2, 102, 101
*ELGEN, ELSET=STRIP
1, 10, 1, 1
*NSET, NSET=ROOT
1, 101
*NSET, NSET=TIP
11, 111
*SURFACE, NAME=ABOVE
STRIP, SPOS
*SURFACE, NAME=BELOW
STRIP, SNEG
*ORIENTATION, NAME=O
1., 0., 0., 0., 1., 0.
3, 0.
*MATERIAL, NAME=PLY
*ELASTIC, TYPE=LAMINA
1000., 100., 0., 100., 100., 100.
*MATERIAL, NAME=PLAIN
*ELASTIC
1000., 0.
{section}
*BOUNDARY
ROOT, ENCASTRE
*STEP
*STATIC
1., 1.
{load}
*NODE PRINT, NSET=TIP
U1, U3
*END STEP
"""
PLAIN = "*SHELL SECTION, ELSET=STRIP, MATERIAL=PLAIN\n0.2, 5"
FORCE = "*CLOAD\nTIP, 3, 0.5E-3"
EI, GA = 1000.0 * 0.2**3 / 12.0, 5.0 / 6.0 * 500.0 * 0.2


def tip(tmp_path, section=PLAIN, load=FORCE, text=STRIP):
    """Tip displacement, shape (2,): along x and z."""
    deck = fx.read_deck(write(tmp_path, text.format(section=section, load=load)))
    last = deck.run().rows[-1]
    deck.scene.close()
    return np.array([last["m[U1 TIP]"], last["m[U3 TIP]"]])


def test_a_force_a_moment_and_pressures_bend_a_strip(tmp_path):
    bent = 1e-3 * (10.0**3 / (3.0 * EI) + 10.0 / GA)
    assert tip(tmp_path)[1] == pytest.approx(bent, rel=4e-3)  # ten elements
    # the rotation about -y lifts the tip
    turned = tip(tmp_path, load="*CLOAD\nTIP, 5, -0.5E-3")[1]
    assert turned == pytest.approx(1e-3 * 10.0**2 / (2.0 * EI), rel=4e-3)
    pressed = 1e-3 * (10.0**4 / (8.0 * EI) + 10.0**2 / (2.0 * GA))
    # P pushes towards the positive side; on a side it pushes into the shell
    for load, sign in (("DLOAD\nSTRIP, P", 1), ("DSLOAD\nBELOW, P", 1), ("DSLOAD\nABOVE, P", -1)):
        found = tip(tmp_path, load=f"*{load}, 1E-3")[1]
        assert sign * found == pytest.approx(pressed, rel=6e-3)
    weight = PLAIN + "\n*MATERIAL, NAME=M\n*DENSITY\n2.\n*ELASTIC\n1000., 0."
    weight = weight.replace("=PLAIN", "=M")
    found = tip(tmp_path, section=weight, load="*DLOAD\n, GRAV, 2.5E-3, 0., 0., 1.")[1]
    assert found == pytest.approx(2.0 * 2.5e-3 * 0.2 / 1e-3 * pressed, rel=6e-3)


def test_offset_lays_the_nodes_on_a_face(tmp_path):
    """A pull along nodes on the top side bends the strip: the middle lies 0.1 below it."""
    pull = "*CLOAD\nTIP, 1, 0.5E-3"
    section = PLAIN.replace("MATERIAL=PLAIN", "MATERIAL=PLAIN, OFFSET=SPOS")
    found = tip(tmp_path, section, pull)
    moment = 1e-3 * 0.1  # about the middle; the end of the middle goes up where the top is pulled
    assert found[1] == pytest.approx(-moment * 10.0**2 / (2.0 * EI), rel=4e-3)
    assert tip(tmp_path, section.replace("SPOS", "-0.5"), pull)[1] == pytest.approx(-found[1])
    assert tip(tmp_path, PLAIN, pull)[1] == pytest.approx(0.0, abs=1e-9)


def test_plies_and_their_directions(tmp_path):
    def bend(section):
        return tip(tmp_path, section)[1]

    along = PLAIN.replace("MATERIAL=PLAIN", "MATERIAL=PLY, ORIENTATION=O")
    stiff = bend(along)
    assert bend(along.replace(", ORIENTATION=O", "")) == pytest.approx(stiff, rel=1e-9)
    across = "*SHELL SECTION, ELSET=STRIP, COMPOSITE, ORIENTATION=O\n0.2, 3, PLY, 90."
    shear = 1e-3 * 10.0 / (5.0 / 6.0 * 100.0 * 0.2)
    bending = 1e-3 * 10.0**3 / (3.0 * EI)
    assert stiff - shear == pytest.approx(bending, rel=4e-3)
    assert bend(across) - shear == pytest.approx(10.0 * bending, rel=4e-3)
    layers = across.replace("0.2, 3, PLY, 90.", "0.05, 3, PLY, 90.\n0.05, 3, PLY, 0.")
    layers = layers.replace("COMPOSITE", "COMPOSITE, SYMMETRIC")
    inner = 0.1**3 / 12.0
    ei = 1000.0 * inner + 100.0 * (0.2**3 / 12.0 - inner)
    found = read(tmp_path, STRIP.format(section=layers, load=FORCE))
    (section,) = found.arguments["materials"].values()
    assert [p.angle for p in section.laminate.plies] == [90.0, 0.0, 0.0, 90.0]
    assert section.laminate.plies[0].material.nu == (0.0, 0.0, 0.0)
    # the laminate's shear factor is not 5/6; shear is 0.4 % of this deflection
    assert bend(layers) == pytest.approx(1e-3 * 10.0**3 / (3.0 * ei), rel=0.015)


def test_orientations_by_another_axis_and_the_default_one(tmp_path):
    def axis(section, text=STRIP):
        found = read(tmp_path, text.format(section=section, load=FORCE))
        return next(iter(found.arguments["materials"].values())).axis

    section = PLAIN.replace("MATERIAL=PLAIN", "MATERIAL=PLY, ORIENTATION=O")
    assert axis(section, STRIP.replace("3, 0.", "3, 30.")) == pytest.approx(
        (np.cos(np.pi / 6), 0.5, 0.0)
    )
    # axis 1 is the normal: axis 2 is projected as the first of the material
    turned = STRIP.replace("1., 0., 0., 0., 1., 0.\n3, 0.", "0., 0., 1., 0., 1., 0.\n1, 0.")
    assert axis(section, turned) == pytest.approx((0.0, 1.0, 0.0))
    with pytest.raises(DeckError, match="axis 1 of its \\*ORIENTATION lies in the surface"):
        axis(section, STRIP.replace("\n3, 0.", ""))
    assert axis(section.replace(", ORIENTATION=O", "")) == (1.0, 0.0, 0.0)
    upright = STRIP.replace("10., 0., 0.", "0., 10., 0.")
    upright = upright.replace("0., 1., 0.\n111, 10., 1., 0.", "0., 0., 1.\n111, 0., 10., 1.")
    assert axis(section.replace(", ORIENTATION=O", ""), upright) == (0.0, 0.0, 1.0)


def test_rotations_of_supports(tmp_path):
    def supports(lines, step=""):
        text = STRIP.replace("ROOT, ENCASTRE", lines)
        return read(tmp_path, text.format(section=PLAIN, load=step or FORCE)).arguments["supports"]

    found = supports("ROOT, ENCASTRE")
    assert found == [fx.Displacement("ROOT", x=0.0, y=0.0, z=0.0),
                     fx.Rotation("ROOT", x=0.0, y=0.0, z=0.0)]  # fmt: skip
    assert fx.Symmetry("ROOT", "x", "ROOT symmetry") in supports("ROOT, XSYMM\nROOT, 2, 3")
    assert fx.Rotation("ROOT", y=0.0) in supports("ROOT, 1, 3\nROOT, 5")
    turn = supports("ROOT, 1, 4", "*BOUNDARY\nROOT, 5, 5, 0.01")[1]
    assert turn == fx.Rotation("ROOT", x=0.0, y=0.01)
    with pytest.raises(DeckError, match="rotation 5 is prescribed in some steps and free"):
        supports("ROOT, 1, 3", FORCE + "\n*END STEP\n*STEP\n*STATIC\n*BOUNDARY\nROOT, 5, 5, 0.1")


def test_a_kinematic_coupling_turns_the_end_of_a_strip(tmp_path):
    text = STRIP.replace("*BOUNDARY\nROOT", """*NODE, NSET=REF
999, 10., 0.5, 0.
*SURFACE, NAME=END
10, E2
*COUPLING, CONSTRAINT NAME=C, REF NODE=REF, SURFACE=END
*KINEMATIC
1, 6
*BOUNDARY
REF, 1, 6
ROOT""")  # fmt: skip
    found = tip(tmp_path, load="*BOUNDARY\nREF, 3, 3, 0.1\nREF, 5, 5, -0.01", text=text)
    assert found == pytest.approx([0.0, 0.1], abs=1e-12)
    supports = read(tmp_path, text.format(section=PLAIN, load=FORCE)).arguments["supports"]
    (end,) = (s for s in supports if s.title == "C" and isinstance(s, fx.Rotation))
    assert (end.x, end.y, end.z) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("kind, replaced", [("S8R", "centre nodes are added"), ("S3", "shell of")])
def test_other_shells(tmp_path, kind, replaced):
    if kind == "S3":
        cells = "1, 1, 2, 102\n2, 102, 101, 1\n*ELGEN, ELSET=STRIP\n1, 10, 1, 2\n2, 10, 1, 2"
        text = STRIP.replace("1, 1, 2, 102, 101\n*ELGEN, ELSET=STRIP\n1, 10, 1, 1", cells)
    else:
        text = STRIP.replace("*ELEMENT", "*NODE\n51, 0., 0.5, 0.\n61, 10., 0.5, 0.\n*NGEN\n51, 61\n"
                             "*NSET, NSET=ROOT\n51\n*ELEMENT", 1)  # fmt: skip
        text = text.replace("1, 1, 2, 102, 101", "1, 1, 3, 103, 101, 2, 53, 102, 51")
        text = text.replace("1, 10, 1, 1", "1, 5, 2, 1")
    text = text.replace("S4R", kind)
    report = read(tmp_path, text.format(section=PLAIN, load=FORCE)).report
    assert any(replaced in line for line in report.replaced)
    bent = 1e-3 * (10.0**3 / (3.0 * EI) + 10.0 / GA)
    assert tip(tmp_path, text=text)[1] == pytest.approx(bent, rel=1e-2)


# -- bonded arms -----------------------------------------------------------------------------------

ARMS = """*NODE
1, 0., 0., 0.5
13, 12., 0., 0.5
101, 0., 1., 0.5
113, 12., 1., 0.5
1001, 0., 0., -0.5
1013, 12., 0., -0.5
1101, 0., 1., -0.5
1113, 12., 1., -0.5
*NGEN, NSET=UP
1, 13
101, 113
*NGEN, NSET=LOW
1001, 1013
1101, 1113
*ELEMENT, TYPE=S4R
1, 1, 2, 102, 101
1001, 1001, 1002, 1102, 1101
*ELGEN, ELSET=UPPER
1, 12, 1, 1
*ELGEN, ELSET=LOWER
1001, 12, 1, 1
*NSET, NSET=ENDS
1, 101, 13, 113, 1013, 1113
*NSET, NSET=TIPUP
1, 101
*NSET, NSET=TIPLOW
1001, 1101
*NSET, NSET=FAR
13, 113, 1013, 1113
*NSET, NSET=BOND, GENERATE
5, 13
105, 113
*SURFACE, NAME=UNDER
UPPER, SNEG
*SURFACE, NAME=OVER
LOWER, SPOS
*SHELL SECTION, ELSET=UPPER, MATERIAL=M
1., 5
*SHELL SECTION, ELSET=LOWER, MATERIAL=M
1., 5
*MATERIAL, NAME=M
*ELASTIC
1000., 0.3
*CONTACT PAIR, INTERACTION=I, SMALL SLIDING
UNDER, OVER
*SURFACE INTERACTION, NAME=I
*INITIAL CONDITIONS, TYPE=CONTACT
UNDER, OVER, BOND
*BOUNDARY
FAR, ENCASTRE
*STEP, INC=100
*STATIC
0.1, 1., 1E-6, 0.1
*BOUNDARY
TIPUP, 3, 3, 1.
TIPLOW, 3, 3, -1.
*DEBOND, SLAVE=UNDER, MASTER=OVER
*FRACTURE CRITERION, TYPE=VCCT
1.0, 2.0, 2.0, 2.0
*END STEP
"""


@pytest.mark.mpi
def test_arms_of_shells_come_apart_as_in_python(shared_path):
    deck = fx.read_deck(write(shared_path, ARMS))
    bond = fx.Interface(
        fx.Face("UPPER", "bottom"), fx.Face("LOWER", "top"), bonded=lambda x: x[0] > 3.5,
        contact=True, gap="keep", name="UNDER",
    )  # fmt: skip
    by_hand = fx.Scene(
        deck.scene.mesh,
        materials=fx.Section(fx.Isotropic(1000.0, 0.3), thickness=1.0),
        model=fx.Shell(),
        supports=[
            fx.Clamp("FAR"), fx.Displacement("TIPUP", z=1.0), fx.Displacement("TIPLOW", z=-1.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(1.0, 2.0, mix=fx.BK(2.0)), fx.StepRelease())],
    )  # fmt: skip
    wanted = by_hand.run(deck.steps[0].step)
    found = deck.run()
    assert len(found) == len(wanted) and found.rows[-1]["released[UNDER]"] > 0
    for column in ("R[TIPUP.z]", "GI[UNDER]", "released[UNDER]", "strain_energy"):
        a, b = found[column].astype(float), wanted[column].astype(float)
        assert a == pytest.approx(b, rel=1e-8, abs=1e-10, nan_ok=True), column


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("UPPER, SNEG", "UPPER", "is no side of a shell; give SPOS or SNEG"),
        ("UPPER, SNEG", "UPPER, SNEG\nLOWER, SPOS", "SPOS and SNEG sides; make it two"),
        ("NAME=UNDER\nUPPER, SNEG", "NAME=UNDER, TYPE=NODE\nUP", "a surface of nodes has no side"),
        ("*ELGEN, ELSET=UPPER\n1, 12", "2, 3, 2, 102, 103\n*ELGEN, ELSET=UPPER\n1, 1",
         "positive sides"),
        ("*SHELL SECTION, ELSET=UPPER", "*SOLID SECTION, ELSET=UPPER", "need \\*SHELL SECTION"),
        ("1., 5\n*SHELL", "-1., 5\n*SHELL", "thickness"),
        ("*STATIC\n0.1, 1., 1E-6, 0.1", "*DYNAMIC\n0.1, 1.", "no \\*DENSITY"),
        ("*STEP, INC=100", "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nUP, 5., 1.\n*STEP",
         "over the thickness"),
        ("*DEBOND", "*DLOAD\nUPPER, P1, 1.\n*DEBOND", "load type P needs the face of solid"),
        ("*ELASTIC\n1000., 0.3", "*ELASTIC\n1000., 0.3\n*PLASTIC\n1.", "plies are linear elastic"),
        ("TYPE=S4R", "TYPE=S9R5", "S9R5 is refused"),
    ],
)  # fmt: skip
def test_decks_of_shells_that_are_refused(tmp_path, old, new, words):
    assert old in ARMS
    text = ARMS.replace(old, new, 1)
    with pytest.raises(DeckError, match=words):
        read(tmp_path, text)


def test_a_pressure_under_large_rotations(tmp_path):
    text = ARMS.replace("*STEP", "*STEP, NLGEOM", 1).replace("*DEBOND", "{}*DEBOND", 1)
    with pytest.raises(DeckError, match="add FOLLOWER=NO"):
        read(tmp_path, text.format("*DLOAD\nUPPER, P, 1.\n"))
    (load,) = read(tmp_path, text.format("*DLOAD, FOLLOWER=NO\nUPPER, P, 1.\n")).arguments["loads"]
    assert load.where == fx.Face("UPPER", "bottom") and not load.follows


def test_shells_that_meet_at_common_nodes(tmp_path):
    """The tip of an upright at the end of a strip, pushed along the strip, over frame theory."""
    upright = """*NODE
211, 10., 0., 1.
220, 10., 0., 10.
311, 10., 1., 1.
320, 10., 1., 10.
*NGEN, NSET=C
211, 220
*NGEN, NSET=D
311, 320
*ELEMENT, TYPE=S4R
21, 11, 211, 311, 111
22, 211, 212, 312, 311
*ELGEN, ELSET=WEB
21
22, 9, 1, 1
*NSET, NSET=END
220, 320
"""
    text = STRIP.replace("*NSET, NSET=ROOT", upright + "*NSET, NSET=ROOT", 1)
    section = PLAIN + "\n*SHELL SECTION, ELSET=WEB, MATERIAL=PLAIN\n0.2, 5"
    text = text.replace("NODE PRINT, NSET=TIP", "NODE PRINT, NSET=END")
    deck = fx.read_deck(
        write(tmp_path, text.format(section=section, load="*CLOAD\nEND, 1, 0.5E-3"))
    )
    found = deck.run().rows[-1]["m[U1 END]"]
    deck.scene.close()
    exact = 1e-3 * ((1.0 / 3.0 + 1.0) * 10.0**3 / EI + 10.0 / GA + 10.0 / 200.0)
    assert found == pytest.approx(exact, rel=4e-3)  # ten elements a side


def test_a_heated_strip_becomes_longer(tmp_path):
    section = PLAIN + "\n*MATERIAL, NAME=M\n*EXPANSION\n1E-3\n*ELASTIC\n1000., 0."
    section = section.replace("=PLAIN", "=M") + "\n*NSET, NSET=ALL\nA, B"
    section += "\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 20."
    found = tip(tmp_path, section, "*TEMPERATURE\nALL, 30.")
    assert found == pytest.approx([1e-3 * 10.0 * 10.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("kind", ["implicit", "explicit"])
def test_a_strip_that_is_let_go_of_swings(tmp_path, kind):
    """A load that stays from the first moment bends the strip to twice the static deflection."""
    section = PLAIN + "\n*MATERIAL, NAME=M\n*DENSITY\n0.01\n*ELASTIC\n1000., 0."
    text = STRIP.format(section=section.replace("=PLAIN", "=M"), load=FORCE)
    half = np.pi / (1.8751**2 * np.sqrt(EI / (0.01 * 0.2 * 10.0**4)))  # of the first mode
    text = text.replace("*NODE PRINT", "*OUTPUT, HISTORY\n*NODE OUTPUT")
    steps = f"*DYNAMIC, ALPHA=0., DIRECT\n{half / 20}, {half}", f"*DYNAMIC, EXPLICIT\n, {half}"
    if kind == "explicit":
        text = text.replace("*STEP", "*STEP, NLGEOM=NO")
    deck = fx.read_deck(write(tmp_path, text.replace("*STATIC\n1., 1.", steps[kind == "explicit"])))
    last = deck.run().rows[-1]
    deck.scene.close()
    static = 1e-3 * (10.0**3 / (3.0 * EI) + 10.0 / GA)
    # the first mode has 97 % of the deflection; that of the others depends on their phase
    assert last["m[U3 TIP]"] == pytest.approx(2.0 * static, rel=0.06)
    assert last["balance"] == pytest.approx(0.0, abs=1e-9 * last["external_work"])
