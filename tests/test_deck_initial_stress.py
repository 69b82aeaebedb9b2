"""Initial stresses of a deck."""

from __future__ import annotations

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.deck.cards import DeckError
from tests.decks import PLATE, STEP, read, write

HELD = "*STEP\n*STATIC\n1., 1.\n*BOUNDARY\nALL, 1, 2\n*END STEP\n"
FREE = (
    "*STEP\n*STATIC\n1., 1.\n*BOUNDARY\n1, 1, 2\n3, 2\n*NODE PRINT, NSET=RIGHT\nU1, U2\n*END STEP\n"
)


def stress(values, more=""):
    return f"*INITIAL CONDITIONS, TYPE=STRESS{more}\nPLATE, {values}\n"


def last(tmp_path, text):
    deck = fx.read_deck(write(tmp_path, text))
    row = deck.run().rows[-1]
    deck.scene.close()
    return row


def test_a_free_plate_lets_go_of_its_stress(tmp_path):
    """Plane strain: u = -S s0 x under the stresses of the plane that are left, s33 held."""
    s11, s22, s33, s12 = 10.0, -4.0, 3.0, 2.5
    row = last(tmp_path, PLATE + stress(f"{s11}, {s22}, {s33}, {s12}") + FREE)
    e, nu = 200.0, 0.25
    # without s11 and s22, and without a strain e33
    plane = np.array([[1.0 - nu**2, -nu * (1.0 + nu)], [-nu * (1.0 + nu), 1.0 - nu**2]]) / e
    strain = -plane @ np.array([s11, s22])
    shear = -s12 * 2.0 * (1.0 + nu) / e
    assert row["m[U1 RIGHT]"] == pytest.approx(2.0 * strain[0] + 0.5 * shear, rel=1e-9)
    assert row["m[U2 RIGHT]"] == pytest.approx(0.5 * strain[1], rel=1e-9)  # of y = 0 and 1


def test_a_held_plate_keeps_it(tmp_path):
    """The supports carry the stress: traction times area, 1 high and 2 thick."""
    text = PLATE + "*NSET, NSET=END\n3, 6\n" + stress("10., -4., 3., 0.")
    held = HELD.replace("ALL, 1, 2", "LEFT, 1, 2\n2, 1, 2\n5, 2\nEND, 1, 2")
    row = last(tmp_path, text + held)
    assert row["R[END.x]"] == pytest.approx(10.0 * 2.0, rel=1e-9)


CUBE = """*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
*NSET, NSET=FAR
7
*ELEMENT, TYPE=C3D8, ELSET=PLATE
1, 1, 2, 3, 4, 5, 6, 7, 8
*SOLID SECTION, ELSET=PLATE, MATERIAL=M
*MATERIAL, NAME=M
*ELASTIC
200., 0.25
"""


def test_a_cube_with_all_six_components(tmp_path):
    """Held as a statically determinate body, its corner moves by minus the strain of the stress."""
    s11, s22, s33, s12, s13, s23 = 3.0, -2.0, 1.0, 0.5, -0.7, 0.9
    step = "*STEP\n*STATIC\n1., 1.\n*BOUNDARY\n1, 1, 3\n2, 2, 3\n4, 3\n"
    step += "*NODE PRINT, NSET=FAR\nU\n*END STEP\n"
    row = last(tmp_path, CUBE + stress(f"{s11}, {s22}, {s33}, {s12}, {s13}, {s23}") + step)
    nu, e, g = 0.25, 200.0, 200.0 / 2.5
    total = s11 + s22 + s33
    normal = [-((1.0 + nu) * s - nu * total) / e for s in (s11, s22, s33)]
    wanted = [normal[0] - (s12 + s13) / g, normal[1] - s23 / g, normal[2]]
    found = [row[f"m[U{i} FAR]"] for i in (1, 2, 3)]
    assert found == pytest.approx(wanted, rel=1e-9)


def test_orthotropic_bodies_and_parts(tmp_path):
    """Two elements with different stresses are two groups; stress along the material's axes."""
    nine = "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n200., 100., 50., 0.2, 0.1, 0.05, 40., 30.\n20."
    text = PLATE.replace("*ELASTIC\n200., 0.25", nine)
    text += "*INITIAL CONDITIONS, TYPE=STRESS, UNBALANCED STRESS=STEP\n1, 5.\n2, 7.\n"
    found = read(tmp_path, text + STEP)
    one, other = found.arguments["materials"].values()
    assert one.expansion == pytest.approx((-5.0 / 200.0, 0.2 * 5.0 / 200.0, 0.1 * 5.0 / 200.0))
    assert other.expansion[0] == pytest.approx(-7.0 / 200.0)
    assert not any("in proportion to time" in line for line in found.report.replaced)


def test_expansions_without_temperatures_do_nothing(tmp_path):
    text = PLATE + "*EXPANSION\n1E-3\n*INITIAL CONDITIONS, TYPE=STRESS\n1, 5.\n"
    plain, stressed = sorted(
        read(tmp_path, text + STEP).arguments["materials"].values(), key=lambda m: str(type(m))
    )
    assert plain.expansion == 0.0 and stressed.expansion[0] == pytest.approx(-5.0 / 200.0)


@pytest.mark.parametrize(
    "text, words",
    [
        (PLATE + stress("1., 2., 3., 4., 5.") + STEP, "there are 5 components"),
        (PLATE.replace("CPE4", "CPS4") + stress("0., 0., 1.") + STEP, "normal to the plane"),
        (PLATE + "*PLASTIC\n1.\n" + stress("1.") + STEP, "linear elastic"),
        (PLATE + "300., 0.25, 9.\n" + stress("1.") + STEP, "tables against temperature"),
        (
            PLATE + "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 1.\n" + stress("1.") + STEP,
            "beside temperatures",
        ),
        (
            PLATE + "*DENSITY\n1.\n" + stress("1.") + STEP.replace("*STATIC", "*DYNAMIC"),
            "need a \\*STATIC first step",
        ),
        (PLATE + stress("1.", ", GEOSTATIC") + STEP, "the parameter GEOSTATIC"),
    ],
)
def test_initial_stresses_that_are_refused(tmp_path, text, words):
    with pytest.raises(DeckError, match=words):
        read(tmp_path, text)
