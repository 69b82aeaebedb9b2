"""Decks of explicit dynamics: general contact with bonds that fail, masses, velocities."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.criteria import ProgressiveRelease
from fxcrack.deck.cards import DeckError
from fxcrack.meshes.dcb import dcb_2d
from tests.decks import BONDED, PLATE, read, write
from tests.test_deck_write import round_trip, scene

BARS = BONDED.split("*CONTACT PAIR")[0] + "*DENSITY\n1.\n"
GLUE = """*SURFACE INTERACTION, NAME=GLUE
*FRICTION
0.1
*COHESIVE BEHAVIOR
1e6, 1e6, 1e6
*FRACTURE CRITERION, TYPE=VCCT
0.5, 1.0, 1.0, 2.0
*CONTACT CLEARANCE, NAME=Clear, SEARCH NSET=BOND
*AMPLITUDE, NAME=A
0., 0., 1., 0.5, 2., 2.
"""
EXPLICIT = """*STEP, NLGEOM=NO
*DYNAMIC, EXPLICIT
, 2.
*BOUNDARY, AMPLITUDE=A
11, 1, 1
11, 2, 2, 0.1
21, 1, 1
21, 2, 2, -0.1
*CONTACT
*CONTACT INCLUSIONS
TOP, BOTTOM
*CONTACT PROPERTY ASSIGNMENT
TOP, BOTTOM, GLUE
*CONTACT CLEARANCE ASSIGNMENT
TOP, BOTTOM, CLEAR
*OUTPUT, HISTORY, TIME INTERVAL=0.1
*ENERGY OUTPUT
ALLSE
*END STEP
"""
DECK = BARS + GLUE + EXPLICIT


def same_in_python(deck: fx.Scene, *, upper: fx.Coupling | None = None) -> fx.Scene:
    """The scene of the deck by hand, on its mesh."""
    bond = fx.Interface(
        "TOP", "BOTTOM", bonded=lambda x: x[0] > 0.5, contact=True, friction=0.1, name="TOP"
    )
    moves = fx.Amplitude((0.0, 1.0, 2.0), (0.0, 0.5, 2.0))
    return fx.Scene(
        deck.mesh,
        materials=fx.Isotropic(1000.0, 0.3, density=1.0),
        model=fx.PlaneStrain(),
        supports=[
            upper or fx.Displacement("11", x=0.0, y=0.1, amplitude=moves),
            fx.Displacement("21", x=0.0, y=-0.1, amplitude=moves),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(0.5, 1.0, mix=fx.BK(2.0)))],
        effects=[fx.Inertia()],
    )


def test_a_deck_and_the_scene_in_python_give_the_same_history(tmp_path):
    deck = fx.read_deck(write(tmp_path, DECK))
    assert deck.steps[0].grow == ("TOP",) and deck.steps[0].step.rows == 20
    assert not deck.scene.debonds[0].release_chosen  # progressive, as is the default there
    by_hand = same_in_python(deck.scene)
    found = deck.run()
    wanted = by_hand.run(fx.Explicit(until=fx.Time(2.0), rows=20, bulk=(0.06, 1.2)))
    assert found.rows[-1]["released[TOP]"] == wanted.rows[-1]["released[TOP]"] > 0
    assert len(found) == len(wanted)
    for column in ("R[11.y]", "R[21.y]", "u[11.y]", "a[TOP]", "strain_energy", "kinetic_energy"):
        size = np.abs(wanted[column]).max()
        assert found[column] == pytest.approx(wanted[column], rel=1e-10, abs=1e-10 * size)
    said = "\n".join(deck.report.replaced)
    assert "the stiffness of the bonds is left out" in said and "released progressively" in said


def test_kinematic_couplings_in_explicit_decks(tmp_path):
    """The end of one arm turns with a reference that is moved along y: a Coupling in Python."""
    sets = "*NODE\n99, -0.5, 1.5\n*NSET, NSET=HEAD\n1, 11\n"
    couple = "*SURFACE, TYPE=NODE, NAME=GRIPS\nHEAD,\n*COUPLING, CONSTRAINT NAME=C, REF NODE=99, "
    couple += "SURFACE=GRIPS\n*KINEMATIC\n"
    moved = EXPLICIT.replace("11, 1, 1\n11, 2, 2, 0.1", "99, 1, 1\n99, 2, 2, 0.1")
    deck = fx.read_deck(write(tmp_path, BARS + GLUE + sets + couple + moved))
    found = deck.run()
    moves = fx.Amplitude((0.0, 1.0, 2.0), (0.0, 0.5, 2.0))
    grip = fx.Coupling("HEAD", (-0.5, 1.5), x=0.0, y=0.1, amplitude=moves, name="grip")
    by_hand = same_in_python(deck.scene, upper=grip)
    wanted = by_hand.run(fx.Explicit(until=fx.Time(2.0), rows=20, bulk=(0.06, 1.2)))
    assert found.rows[-1]["released[TOP]"] == wanted.rows[-1]["released[TOP]"] > 0
    reaction = wanted["R[grip.y]"].astype(float)
    (column,) = (
        c for c in found.columns if c.startswith("R[") and c.endswith("y]") and "21" not in c
    )
    assert found[column] == pytest.approx(reaction, rel=1e-10, abs=1e-10 * np.abs(reaction).max())


def test_a_law_that_was_not_chosen_stays_so_on_other_ranks_and_in_copies():
    bond = fx.Interface("a", "b", bonded=lambda x: x[0] > 0.0)
    debond = copy.deepcopy(fx.Debond(bond, fx.VCCT(0.5)))
    assert not debond.release_chosen and debond.release == fx.StepRelease()
    chosen = copy.deepcopy(fx.Debond(bond, fx.VCCT(0.5), ProgressiveRelease()))
    assert chosen.release_chosen and chosen.release == ProgressiveRelease()


def test_controls_of_the_step(tmp_path):
    def step(head, cards=""):
        text = DECK.replace("*DYNAMIC, EXPLICIT\n, 2.\n", head + cards)
        return read(tmp_path, text).steps[0].step

    plain = step("*DYNAMIC, EXPLICIT\n, 2.\n")
    assert (plain.end_time, plain.safety, plain.dt, plain.mass_scale) == (2.0, 0.97, None, 1.0)
    assert step("*DYNAMIC, EXPLICIT, SCALE FACTOR=0.5\n, 2.\n").safety == 0.485
    assert step("*DYNAMIC, EXPLICIT, DIRECT USER CONTROL\n1E-3, 2.\n").dt == 1e-3
    scaled = step("*DYNAMIC, EXPLICIT\n, 2.\n", "*FIXED MASS SCALING, FACTOR=4.\n")
    assert (scaled.mass_scale, scaled.dt) == (4.0, None)
    added = "*VARIABLE MASS SCALING, TYPE=BELOW MIN, DT=0.01, FREQUENCY=10\n"
    scaled = step("*DYNAMIC, EXPLICIT\n, 2.\n", added)
    assert (scaled.mass_scale, scaled.dt) == ("dt", 0.01)
    # NLGEOM is on where an explicit step says nothing
    found = read(tmp_path, DECK.replace(", NLGEOM=NO", ""))
    assert any(isinstance(e, fx.FiniteStrain) for e in found.arguments["effects"])
    assert any("NLGEOM is on" in line for line in found.report.replaced)


def test_all_exterior_with_named_pairs(tmp_path):
    text = DECK.replace("*CONTACT INCLUSIONS\nTOP, BOTTOM", "*CONTACT INCLUSIONS, ALL EXTERIOR")
    found = read(tmp_path, text)
    assert any("'TOP' on 'BOTTOM'" in line for line in found.report.replaced)
    assert len(found.arguments["debonds"]) == 1
    # the second field of the assignment may say that the first surface is the master
    turned = text.replace("TOP, BOTTOM, CLEAR", "BOTTOM, TOP, CLEAR, MAIN")
    assert read(tmp_path, turned).arguments["debonds"][0].interface.slave == "TOP"


def test_a_bonded_set_without_a_criterion_separates(tmp_path, caplog):
    plain = GLUE.replace(GLUE[GLUE.index("*COHESIVE") : GLUE.index("*CONTACT C")], "")
    found = read(tmp_path, BARS + plain + EXPLICIT)
    (interface,) = found.arguments["bonds"]
    assert not found.arguments["debonds"] and not interface.bonded(np.zeros((3, 2))).any()
    assert "they are not bonded and separate without stress" in caplog.text


def test_a_surface_that_ends_with_the_bonded_set_is_warned_of(tmp_path, caplog):
    text = DECK.replace("*NSET, NSET=BOND\n2, 3, 4, 5", "*NSET, NSET=BOND\n1, 2, 3, 4, 5")
    deck = fx.read_deck(write(tmp_path, text))
    deck.run()
    assert "has no crack tip" in caplog.text
    assert deck.scene.history.rows[-1]["released[TOP]"] == 0


@pytest.mark.parametrize(
    "old, new, words",
    [
        (", 2.\n*BOUND", "\n*BOUND", "the length of the step is missing"),
        ("EXPLICIT\n", "EXPLICIT, ADIABATIC\n", "ADIABATIC is not available"),
        ("EXPLICIT\n", "EXPLICIT, SCALE FACTOR=2.\n", "SCALE FACTOR=2 must lie above 0"),
        (", 2.\n*B", ", 2.\n*FIXED MASS SCALING, FACTOR=4., ELSET=UPPER\n*B", "leave ELSET out"),
        (", 2.\n*B", ", 2.\n*FIXED MASS SCALING, DT=1.\n*B", "TYPE=UNIFORM is not available"),
        (", 2.\n*B", ", 2.\n*FIXED MASS SCALING\n*B", "give FACTOR, or DT"),
        ("TYPE=VCCT", "TYPE=ENHANCED VCCT", "TYPE=ENHANCED VCCT is not possible in explicit"),
        ("TYPE=VCCT", "TYPE=FATIGUE", "TYPE=FATIGUE is not possible in explicit"),
        ("TYPE=VCCT", "TYPE=COD", "TYPE=COD is not possible in explicit"),
        ("TYPE=VCCT", "TYPE=VCCT, VISCOSITY=1.", "belong to quasi-static steps"),
        ("SEARCH NSET=BOND", "SEARCH NSET=BOND, SEARCH ABOVE=1.", "SEARCH NSET excludes"),
        ("SEARCH NSET=BOND", "SEARCH ABOVE=1.", "no bonded nodes are named"),
        ("SEARCH NSET=BOND", "SEARCH NSET=BOND, CLEARANCE=0.1", "a clearance other than 0"),
        ("*FRACTURE CRITERION, TYPE=VCCT\n0.5, 1.0, 1.0, 2.0\n", "", "elastic bonds that never"),
        ("*COHESIVE BEHAVIOR\n1e6, 1e6, 1e6\n", "", "directly after \\*COHESIVE BEHAVIOR"),
        ("BOTTOM, CLEAR", "BOTTOM, CLAER", "there is no \\*CONTACT CLEARANCE, NAME=CLAER"),
        ("BOTTOM, GLUE", "BOTTOM, GLEU", "there is no surface interaction 'GLEU'"),
        ("INCLUSIONS\nTOP, BOTTOM", "INCLUSIONS\nTOP, TOP", "contact of a surface with itself"),
        ("11, 2, 2, 0.1", "11, 2, 2, 0.1\n*DEBOND, SLAVE=TOP, MASTER=BOTTOM", "quasi-static steps"),
        ("*DENSITY\n1.\n", "", "has no \\*DENSITY"),
        ("*DENSITY", "*DAMPING, BETA=1E-3\n*DENSITY", "BETA shortens the increments"),
        ("*BOUNDARY, AMPLITUDE=A", "*BOUNDARY", "jumps at the beginning of an explicit step"),
        ("*STEP, NLGEOM=NO\n*DYN", "*STEP\n*DYNAMIC\n0.1, 1.\n*END STEP\n*STEP\n*DYN", "as two"),
    ],
)
def test_decks_that_are_refused(tmp_path, old, new, words):
    assert old in DECK
    with pytest.raises(DeckError, match=words) as caught:
        read(tmp_path, DECK.replace(old, new))
    assert "model.inp, line" in str(caught.value)


def bulk_of(folder, text, numbers=None):
    """Bulk viscosity of a deck, and what is said of it."""
    if numbers is not None:
        text = text.replace(", 2.\n*B", f", 2.\n*BULK VISCOSITY\n{numbers}\n*B")
    found = read(folder, text)
    return found.steps[0].step.bulk, [x for x in found.report.replaced if "bulk" in x]


def test_bulk_viscosity_of_the_card_or_by_default(tmp_path):
    assert bulk_of(tmp_path, DECK) == ((0.06, 1.2), [])
    assert bulk_of(tmp_path, DECK, "0., 0.") == ((0.0, 0.0), [])
    assert bulk_of(tmp_path, DECK, "0.5") == ((0.5, 1.2), [])
    # elements of plane stress have the linear part alone
    assert bulk_of(tmp_path, DECK.replace("CPE4", "CPS4"))[0] == (0.06, 0.0)
    with pytest.raises(DeckError, match="must not be negative"):
        bulk_of(tmp_path, DECK, "-0.1, 1.2")


def test_bulk_viscosity_that_bodies_do_not_have(tmp_path):
    turning = DECK.replace(", NLGEOM=NO", "")
    rubber = DECK.replace("*ELASTIC\n1000., 0.3", "*HYPERELASTIC, NEO HOOKE\n200., 2e-3")
    for text, why in ((turning, "steps with NLGEOM"), (rubber, "hyperelastic bodies")):
        bulk, (said,) = bulk_of(tmp_path, text)
        assert bulk == (0.0, 0.0)
        assert "the bulk viscosity of 0.06 and 1.2" in said and why in said
        assert bulk_of(tmp_path, text, "0., 0.") == ((0.0, 0.0), [])
        assert "viscosity of 0.03 and 1.2" in bulk_of(tmp_path, text, "0.03")[1][0]
        with pytest.raises(DeckError, match=f"above the default .* not available for {why}"):
            bulk_of(tmp_path, text, "0.5, 1.2")


LOADED = """*AMPLITUDE, NAME=A
0., 0., 0.5, 1., 9., 1.
*STEP, NLGEOM={finite}
*DYNAMIC, EXPLICIT
, 1.
*BOUNDARY
LEFT, 1, 2
*DSLOAD, AMPLITUDE=A
END, P, {pressure}
{cards}*OUTPUT, HISTORY, NUMBER INTERVAL=10
*END STEP
"""


def same_rows(deck, by_hand, bulk):
    """The last row of a deck whose history is that of the scene by hand; both are closed."""
    found = deck.run()
    wanted = by_hand.run(fx.Explicit(until=fx.Time(1.0), rows=10, bulk=bulk))
    assert len(found) == len(wanted)
    columns = ("strain_energy", "kinetic_energy", "external_work", "plastic_energy")
    for column in (c for c in columns if c in wanted.columns):
        size = np.abs(wanted[column]).max()
        assert found[column] == pytest.approx(wanted[column], rel=1e-10, abs=1e-10 * size)
    for one in (deck.scene, by_hand):
        one.close()
    return found.rows[-1]


def test_bodies_that_yield_and_are_heated(tmp_path):
    material = "*DENSITY\n2.\n*EXPANSION\n1e-5\n*PLASTIC\n0.1, 0.\n10.1, 0.2\n"
    text = PLATE + material + LOADED.format(
        finite="NO", pressure=0.3, cards="*TEMPERATURE, AMPLITUDE=A\nALL, 100.\n"
    )  # fmt: skip
    deck = fx.read_deck(write(tmp_path, text))
    by_hand = fx.Scene(
        deck.scene.mesh,
        materials=fx.Plastic(
            200.0, 0.25, yield_stress=0.1, hardening=50.0, density=2.0, expansion=1e-5
        ),
        model=fx.PlaneStrain(2.0),
        supports=[fx.Displacement("LEFT", x=0.0, y=0.0)],
        loads=[fx.Pressure("END", 0.3, amplitude=fx.Amplitude((0.0, 0.5, 9.0), (0.0, 1.0, 1.0)))],
        effects=[
            fx.Temperature(100.0, amplitude=fx.Amplitude((0.0, 0.5, 9.0), (0.0, 1.0, 1.0))),
            fx.Inertia(),
        ],
    )
    assert same_rows(deck, by_hand, (0.06, 1.2))["plastic_energy"] > 0.0


def test_a_pressure_follows_the_bodies_with_nlgeom(tmp_path):
    step = LOADED.format(finite="YES", pressure=1.0, cards="*DLOAD\nLAST, P3, 0.5\n")
    text = PLATE + "*DENSITY\n2.\n" + step
    deck = fx.read_deck(write(tmp_path, text))
    assert all(load.follows for load in deck.scene.loads)
    assert any("the bulk viscosity of 0.06 and 1.2" in line for line in deck.report.replaced)

    def by_hand(*, follows):
        rise = fx.Amplitude((0.0, 0.5, 9.0), (0.0, 1.0, 1.0))
        at_once = fx.Amplitude((0.0, 1e-6), (0.0, 1.0))
        return fx.Scene(
            deck.scene.mesh,
            materials=fx.Isotropic(200.0, 0.25, density=2.0),
            model=fx.PlaneStrain(2.0),
            supports=[fx.Displacement("LEFT", x=0.0, y=0.0)],
            loads=[
                fx.Pressure("END", 1.0, amplitude=rise, follows=follows),
                fx.Pressure("LAST.P3", 0.5, amplitude=at_once, follows=follows),
            ],
            effects=[fx.FiniteStrain(), fx.Inertia()],
        )

    kept = by_hand(follows=False)
    others = kept.run(fx.Explicit(until=fx.Time(1.0), rows=10)).rows[-1]
    kept.close()
    last = same_rows(deck, by_hand(follows=True), (0.0, 0.0))
    assert abs(last["external_work"] / others["external_work"] - 1.0) > 1e-3


def test_an_unstable_increment_is_said_in_words_of_the_deck(tmp_path, caplog):
    """Heat of 1 % strain at once compresses elements so fast that their viscosity asks for more."""
    step = LOADED.format(finite="NO", pressure=0, cards="*TEMPERATURE\nALL, 10.\n")
    text = PLATE + "*DENSITY\n2.\n*EXPANSION\n1e-3\n" + step
    deck = fx.read_deck(write(tmp_path, text))
    followed = deck.run()
    dt = followed["dt"].astype(float)
    assert not followed.reason.startswith("stopped") and dt.min() < 0.97 * dt[0]
    deck.scene.close()
    given = text.replace("EXPLICIT\n,", f"EXPLICIT, DIRECT USER CONTROL\n{1.001 * dt[0]:.9g},")
    deck = fx.read_deck(write(tmp_path, given))
    assert deck.run().reason.startswith("stopped")
    assert "leaving out DIRECT USER CONTROL" in caplog.text
    assert "*BULK VISCOSITY with 0., 0." in caplog.text and "UNSTABLE GROWTH" not in caplog.text
    deck.scene.close()


@pytest.mark.slow
def test_sudden_heat_lets_a_plate_swing_about_its_new_length(tmp_path):
    """A free plate of the same expansion everywhere: waves of 2 alpha T L at most, mean alpha T."""
    cards = "*TEMPERATURE\nALL, 1.\n*NODE PRINT, NSET=RIGHT\nU1\n"
    material = "*DENSITY\n2.\n*EXPANSION\n1e-3\n"
    step = LOADED.format(finite="NO", pressure=0, cards=cards)
    step = step.replace(", 1.\n*BOUND", ", 20.\n*BOUND").replace("LEFT, 1, 2", "LEFT, 1\n1, 2")
    step = step.replace("INTERVAL=10", "INTERVAL=400")
    deck = fx.read_deck(write(tmp_path, PLATE.replace("0.25", "0.") + material + step))
    assert deck.steps[0].step.bulk == (0.06, 1.2)
    moved = deck.run()["m[U1 RIGHT]"].astype(float)
    deck.scene.close()
    assert 0.003 < moved.max() <= 0.0045
    assert moved[len(moved) // 2 :].mean() == pytest.approx(0.002, rel=0.02)


@pytest.mark.parametrize(
    "cards, words",
    [
        ("*BULK VISCOSITY\n", "it belongs to explicit dynamics"),
        ("*FIXED MASS SCALING, FACTOR=2.\n", "it belongs to explicit dynamics"),
        ("*CONTACT\n", "general contact belongs to explicit dynamics"),
    ],
)
def test_cards_that_belong_to_explicit_dynamics(tmp_path, cards, words):
    text = PLATE + f"*STEP\n*STATIC\n*BOUNDARY\nLEFT, 1, 2\n{cards}*END STEP\n"
    with pytest.raises(DeckError, match=words):
        read(tmp_path, text)


VELOCITY = "*INITIAL CONDITIONS, TYPE=VELOCITY\nALL, 1, 3.\n"
MOVING = PLATE.replace("200., 0.25", "200., 0.25\n*DENSITY\n2.") + VELOCITY


def test_bodies_begin_with_a_velocity(tmp_path):
    boundary = EXPLICIT[EXPLICIT.index("*BOUNDARY") : EXPLICIT.index("*CONTACT\n")]
    flight = EXPLICIT.replace(boundary, "*NODE PRINT, NSET=BOND\nU1\n")
    deck = fx.read_deck(write(tmp_path, BARS + GLUE + VELOCITY + flight))
    last = deck.run().rows[-1]
    # free flight of two bars of mass 4 over the time 2
    assert last["kinetic_energy"] == pytest.approx(0.5 * 8.0 * 9.0, rel=1e-10)
    assert last["m[U1 BOND]"] == pytest.approx(6.0, rel=1e-10)
    deck.scene.close()


def test_a_body_without_interfaces_moves_freely(tmp_path):
    text = MOVING + "*STEP, NLGEOM=NO\n*DYNAMIC, EXPLICIT\n, 0.1\n*END STEP\n"
    deck = fx.read_deck(write(tmp_path, text))
    assert deck.run().rows[-1]["kinetic_energy"] == pytest.approx(0.5 * 8.0 * 9.0, rel=1e-10)
    deck.scene.close()


def test_velocities_that_vary_and_those_that_cannot_be(tmp_path):
    step = "*STEP\n*DYNAMIC\n0.1, 1.\n*END STEP\n"
    found = read(tmp_path, MOVING.replace("ALL, 1, 3.", "LEFT, 2, 1.\nRIGHT, 2, 5.") + step)
    (effect,) = (e for e in found.arguments["effects"] if isinstance(e, fx.Inertia))
    assert effect.velocity[0] == 0.0
    x = np.array([[0.0, 1.0, 2.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    assert effect.velocity[1](x) == pytest.approx([1.0, 0.0, 5.0])
    with pytest.raises(DeckError, match="in dynamic steps only"):
        read(tmp_path, MOVING + "*STEP\n*STATIC\n*END STEP\n")
    with pytest.raises(DeckError, match="component 6 of a velocity"):
        read(tmp_path, MOVING.replace("ALL, 1, 3.", "ALL, 6, 3.") + step)
    faces = DECK.replace(
        "*STEP", "*INITIAL CONDITIONS, TYPE=VELOCITY\n3, 2, 1.\n33, 2, 2.\n*STEP", 1
    )
    with pytest.raises(DeckError, match="have different velocities"):
        read(tmp_path, faces)


@pytest.mark.slow
def test_what_is_written_gives_the_same_history(tmp_path):
    moving = {"materials": fx.Isotropic(70e3, 0.3), "supports": [
        fx.Displacement("far_upper", x=0.0, y=0.0), fx.Displacement("far_lower", x=0.0, y=0.0)],
        "loads": [fx.PointForce("pin_top", (0.0, 60.0)), fx.PointForce("pin_bottom", (0.0, -60.0))],
    }  # fmt: skip
    step = fx.Explicit(until=fx.Time(1e-4), rows=5, safety=0.9, mass_scale=3.0, bulk=(0.1, 0.5))
    effects = [
        fx.Inertia(density=2.7e-9, rayleigh=(5.0, 0.0), velocity=(0.5, lambda x: 0.1 * x[0]))
    ]
    one = scene(dcb_2d(dx=10.0, ny=1), interface={"friction": 0.2}, effects=effects, **moving)
    deck = round_trip(tmp_path / "a.inp", one, [step], rel=1e-9)
    assert deck.steps[0].step.safety == pytest.approx(0.9)
    assert deck.steps[0].step.bulk == (0.1, 0.5)
    effects = [fx.Inertia.hht(-0.1, density=2.7e-9)]
    one = scene(dcb_2d(dx=10.0, ny=1), effects=effects, **moving)
    # Newton's method ends at another residual after another numbering of the unknowns
    round_trip(tmp_path / "b.inp", one, [fx.Dynamic(until=fx.Time(1e-4), dt=2e-5)], rel=1e-8)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"step": {"start": "equilibrium"}}, "start='equilibrium'"),
        ({"step": {"contact": "penalty"}}, "contact='penalty'"),
        ({"step": {"bulk": (0.0, 1.0)}, "model": fx.PlaneStress()}, "viscosity in plane stress"),
        ({"release": fx.StepRelease()}, "the release law StepRelease"),
        ({"interface": {"gap": "keep"}}, "gap='keep'"),
        ({"criterion": fx.VCCT(0.2, viscosity=0.1)}, "viscosity and unstable_tolerance"),
    ],
)
def test_explicit_scenes_that_a_deck_has_no_word_for(tmp_path, change, words):
    step = fx.Explicit(until=fx.Time(1e-4), **change.pop("step", {}))
    one = scene(dcb_2d(dx=10.0, ny=1), effects=[fx.Inertia(density=1e-9)], **change)
    with pytest.raises(fx.InputError, match=words):
        fx.write_deck(one, [step], tmp_path / "a.inp")
