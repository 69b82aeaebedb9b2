"""From decks to scenes: materials, supports, loads, temperatures, amplitudes, steps."""

from __future__ import annotations

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.continuum.temperature import ByTemperature
from fxcrack.deck.cards import DeckError
from fxcrack.deck.cell_field import CellField
from tests.decks import PLATE, STEP, read, write
from tests.test_deck_mesh import PARTS


def arguments(tmp_path, text):
    return read(tmp_path, text).arguments


def refused(tmp_path, text, words):
    with pytest.raises(DeckError, match=words) as caught:
        read(tmp_path, text)
    assert "model.inp, line" in str(caught.value)


def stepped(*cards, static="0.5, 1."):
    """A step with further cards."""
    return "*STEP\n*STATIC\n" + static + "\n" + "\n".join(cards) + "\n*END STEP\n"


def solid(cards, model=PLATE):
    return model.replace("*ELASTIC\n200., 0.25", cards) + STEP


# -- materials -------------------------------------------------------------------------------------


def material(tmp_path, cards, model=PLATE):
    (found,) = arguments(tmp_path, solid(cards, model))["materials"].values()
    return found


def test_isotropic_plastic_and_neo_hookean(tmp_path):
    found = material(tmp_path, "*ELASTIC, TYPE=ISO\n200., 0.25\n*DENSITY\n2.5\n*EXPANSION\n1D-5")
    assert found == fx.Isotropic(200.0, 0.25, 1e-5, 2.5)
    found = material(tmp_path, "*ELASTIC\n200., 0.25\n*PLASTIC\n1., 0.\n2., 0.1")
    assert found == fx.Plastic(200.0, 0.25, hardening=((0.0, 1.0), (0.1, 2.0)))
    found = material(tmp_path, "*HYPERELASTIC, NEO HOOKE\n40., 0.02")
    # mu = 2 C10, K = 2/D1
    assert isinstance(found, fx.NeoHookean)
    assert found.E / (2 * (1 + found.nu)) == pytest.approx(80.0)
    assert found.E / (3 * (1 - 2 * found.nu)) == pytest.approx(100.0)


def test_engineering_constants_and_stiffness_are_the_same_material(tmp_path):
    nine = "100., 10., 8., 0.3, 0.25, 0.4, 5., 4.\n3."
    one = material(tmp_path, f"*ELASTIC, TYPE=ENGINEERING CONSTANTS\n{nine}")
    assert one == fx.Orthotropic((100.0, 10.0, 8.0), (0.3, 0.25, 0.4), (5.0, 4.0, 3.0))
    c = one.stiffness()
    values = [c[0, 0], c[0, 1], c[1, 1], c[0, 2], c[1, 2], c[2, 2], c[5, 5], c[4, 4], c[3, 3]]
    text = ", ".join(map(repr, map(float, values[:8]))) + f"\n{float(values[8])!r}"
    other = material(tmp_path, f"*ELASTIC, TYPE=ORTHOTROPIC\n{text}")
    assert np.allclose(other.stiffness(), c, rtol=1e-12, atol=1e-12)


def test_lamina_in_plane_stress(tmp_path):
    cards = "*ELASTIC, TYPE=LAMINA\n100., 10., 0.3, 5., 5., 5."
    found = material(tmp_path, cards, PLATE.replace("CPE4", "CPS4"))
    q = fx.PlaneStress().reduce(found.stiffness())
    assert q[0, 0] == pytest.approx(100.0 / (1 - 0.3**2 * 0.1))
    assert q[2, 2] == pytest.approx(5.0)
    refused(tmp_path, solid(cards), "TYPE=LAMINA is for plane stress")


def test_materials_tabulated_against_temperature(tmp_path):
    cards = "*ELASTIC\n200., 0.25, 0.\n100., 0.25, 100.\n*EXPANSION, ZERO=20.\n1E-5, 0.\n2E-5, 50."
    text = PLATE.replace("*ELASTIC\n200., 0.25", cards)
    start = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, {}\n"
    (found,) = arguments(tmp_path, text + start.format("20.") + STEP)["materials"].values()
    assert isinstance(found, ByTemperature) and found.temperatures == (0.0, 50.0, 100.0)
    assert found.table[50.0] == fx.Isotropic(150.0, 0.25, 2e-5)
    with pytest.raises(DeckError, match="refers to ZERO=20, but the bodies start from 0"):
        read(tmp_path, text + start.format("0.") + STEP)


@pytest.mark.parametrize(
    "cards, words",
    [
        ("*DENSITY\n1.", r"material 'STEEL' has no \*ELASTIC"),
        ("*ELASTIC\n-1., 0.3", "E = -1.0 must be positive"),
        ("*ELASTIC, TYPE=ANISOTROPIC\n1.", "TYPE=ANISOTROPIC is not available"),
        ("*ELASTIC, TYPE=ENGINEERING CONSTANTS\n1., 2., 3.", "needs nine constants"),
        ("*ELASTIC\n1., 0.3\n*ELASTIC\n1., 0.3", "two cards of this kind"),
        ("*ELASTIC\n1., 0.3\n*PLASTIC, HARDENING=KINEMATIC\n1., 0.", "HARDENING=KINEMATIC"),
        ("*HYPERELASTIC, NEO HOOKE\n1., 0.", "incompressible bodies"),
        ("*HYPERELASTIC, MOONEY-RIVLIN\n1., 0.", "MOONEY-RIVLIN is not available"),
        ("*USER MATERIAL, CONSTANTS=1\n1.", "user subroutines cannot be run"),
        ("*DAMAGE INITIATION, CRITERION=MAXS\n1.", "cohesive zones are not available"),
        ("*VISCOELASTIC\n1.", "viscoelasticity is not available"),
    ],
)
def test_materials_that_are_refused(tmp_path, cards, words):
    refused(tmp_path, solid(cards), words)


def test_orientation_turned_about_an_axis(tmp_path):
    cards = (
        "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n100., 10., 8., 0.3, 0.25, 0.4, 5., 4.\n3.\n"
        "*ORIENTATION, NAME=O\n1., 0., 0., 0., 1., 0.\n3, 90."
    )
    model = PLATE.replace("MATERIAL=STEEL", "MATERIAL=STEEL, ORIENTATION=O")
    found = material(tmp_path, cards, model)
    assert np.allclose(found.frame, [[0, 1, 0], [-1, 0, 0]], atol=1e-15)
    model = model.replace("ORIENTATION=O", "ORIENTATION=P")
    refused(tmp_path, solid(cards, model), "there is no orientation 'P'")
    cards = cards.replace("NAME=O\n", "NAME=O, SYSTEM=Z RECTANGULAR\n").replace("3, 90.", "1, 0.")
    found = material(tmp_path, cards, model.replace("ORIENTATION=P", "ORIENTATION=O"))
    # the first point is on Z', the second in the plane of X' and Z'
    assert np.allclose(found.frame, [[0, 1, 0], [0, 0, 1]], atol=1e-15)


def test_sections(tmp_path):
    twice = PLATE + "*SOLID SECTION, ELSET=PLATE, MATERIAL=STEEL\n2.\n"
    found = arguments(tmp_path, twice + STEP)  # the same section again says nothing new
    assert found["model"] == fx.PlaneStrain(2.0) and len(found["materials"]) == 1
    other = "*MATERIAL, NAME=B\n*ELASTIC\n1., 0.\n*SOLID SECTION, ELSET=LAST, MATERIAL=B\n2.\n"
    refused(tmp_path, PLATE + other + STEP, "1 elements of 'LAST' have another section already")
    less = PLATE.replace("ELSET=PLATE, M", "ELSET=LAST, M")
    refused(tmp_path, less + STEP, "1 elements have no section, the first is element 1")
    thick = PLATE.replace("ELSET=PLATE, M", "ELSET=LAST, M")
    thick += "*ELSET, ELSET=F\n1\n*SOLID SECTION, ELSET=F, MATERIAL=STEEL\n3.\n"
    refused(tmp_path, thick + STEP, "different thicknesses")
    refused(tmp_path, PLATE.replace("MATERIAL=STEEL", "MATERIAL=S") + STEP, "no material 'S'")
    refused(tmp_path, PLATE.replace("STEEL\n2", "STEEL, COMPOSITE\n2") + STEP, "COMPOSITE")


# -- supports --------------------------------------------------------------------------------------


def supports(tmp_path, text):
    return {s.where: s for s in arguments(tmp_path, text)["supports"]}


def test_named_supports_and_ramps(tmp_path):
    found = supports(tmp_path, PLATE + "*BOUNDARY\nLEFT, ENCASTRE\n" + stepped(
        "*BOUNDARY", "RIGHT, YSYMM", "RIGHT, 1, , 0.5", static="1., 2."))  # fmt: skip
    assert (found["LEFT"].x, found["LEFT"].y) == (0.0, 0.0)
    # 0.5 at the end of a step of 2: the default amplitude is the time
    assert (found["RIGHT"].x, found["RIGHT"].y) == (0.25, 0.0)
    assert found["RIGHT"].amplitude == fx.Ramp()


def test_the_last_card_counts_where_sets_overlap(tmp_path):
    cards = ("*BOUNDARY", "RIGHT, 1, 1, 0.5", "*BOUNDARY", "3, 1, 1, 0.2")
    found = supports(tmp_path, PLATE + "*BOUNDARY\nLEFT, PINNED\n" + stepped(*cards))
    assert found["3"].x == 0.2 and found["RIGHT (part)"].x == 0.5
    assert len(found) == 3


def test_steps_op_new_and_fixed(tmp_path):
    text = PLATE + "*BOUNDARY\nLEFT, PINNED\n" + stepped("*BOUNDARY", "RIGHT, 1, 1, 0.5")
    text += stepped("*BOUNDARY, OP=NEW", "LEFT, PINNED", "RIGHT, 1, 1, 0.2", static="1., 3.")
    text += stepped("*BOUNDARY, FIXED", "RIGHT, 1, 1")
    found = supports(tmp_path, text)
    assert found["RIGHT"].x == 1.0
    assert found["RIGHT"].amplitude == fx.Amplitude((0.0, 1.0, 4.0, 5.0), (0.0, 0.5, 0.2, 0.2))
    free = stepped("*BOUNDARY, OP=NEW", "LEFT, PINNED")
    refused(tmp_path, text + free, "prescribed in some steps and free in others")
    mixed = stepped("*BOUNDARY, OP=NEW", "LEFT, PINNED", "*BOUNDARY", "RIGHT, 1, 1")
    refused(tmp_path, text + mixed, "asks for it on all of them")


@pytest.mark.parametrize(
    "line, words",
    [
        ("LEFTY, 1", "there is no node set 'LEFTY' \\(did you mean 'LEFT'"),
        ("LEFT, 1, 9", "components 1 to 9 are not displacements"),
        ("LEFT, XSYM", "'XSYM' is no component"),
        ("LEFT, 1, 1, x", "field 4, 'x', is not a number"),
        ("LEFT", "field 2 is empty"),
        ("99, 1", "node 99 does not exist"),
    ],
)
def test_lines_of_boundary_that_are_refused(tmp_path, line, words):
    refused(tmp_path, PLATE + stepped("*BOUNDARY", line), words)


def test_velocities_are_integrated(tmp_path):
    text = PLATE + "*BOUNDARY\nLEFT, PINNED\n*AMPLITUDE, NAME=A\n0., 0., 1., 1.\n"
    text += stepped("*BOUNDARY, TYPE=VELOCITY, AMPLITUDE=A", "RIGHT, 1, 1, 4.")
    text += stepped("*CLOAD", "6, 2, 0.1", static="1., 2.")
    track = supports(tmp_path, text)["RIGHT"].amplitude
    # 4 t^2/2, then the last velocity 4 on and on
    for t in (0.25, 0.5, 1.0):
        assert track(t) == pytest.approx(2.0 * t * t, rel=1e-12)
    assert track(3.0) == pytest.approx(10.0, rel=1e-12)
    steady = (
        PLATE
        + "*BOUNDARY\nLEFT, PINNED\n"
        + stepped("*BOUNDARY, TYPE=VELOCITY", "RIGHT, 1, 1, 4.", static="1., 2.")
    )
    found = supports(tmp_path, steady)["RIGHT"]
    assert (found.x, found.amplitude) == (4.0, fx.Ramp())
    bad = steady.replace("TYPE=VELOCITY", "TYPE=ACCELERATION")
    refused(tmp_path, bad, "TYPE=ACCELERATION is not available")


# -- amplitudes ------------------------------------------------------------------------------------


def test_amplitudes_in_step_time_and_total_time(tmp_path):
    text = (
        PLATE + "*BOUNDARY\nLEFT, PINNED\n*AMPLITUDE, NAME=A\n0., 0., 0.5, 1., 1., 0.\n"
        "*AMPLITUDE, NAME=T, TIME=TOTAL TIME, VALUE=ABSOLUTE\n0., 0., 1., 3., 2., 6.\n"
    )
    text += stepped("*BOUNDARY, AMP=A", "RIGHT, 1, 1, 2.", "*CLOAD, AMPLITUDE=T", "6, 2, 7.")
    text += stepped("*BOUNDARY, AMPLITUDE=A", "RIGHT, 1, 1, 4.")
    found = arguments(tmp_path, text)
    right = next(s for s in found["supports"] if s.where == "RIGHT")
    assert right.amplitude == fx.Amplitude((0.0, 0.5, 1.0, 1.5, 2.0), (0.0, 2.0, 0.0, 4.0, 0.0))
    (force,) = found["loads"]  # total time and absolute values: 3 t, whatever the reference
    assert force.value == (0.0, 3.0) and force.amplitude == fx.Ramp()


def test_smooth_step_and_periodic_amplitudes(tmp_path):
    text = PLATE + "*BOUNDARY\nLEFT, PINNED\n*AMPLITUDE, NAME=A, DEFINITION={}\n{}\n"
    step = stepped("*BOUNDARY, AMPLITUDE=A", "RIGHT, 1, 1, 2.")
    found = read(tmp_path, text.format("SMOOTH STEP", "0., 0., 1., 1.") + step)
    track = next(s for s in found.arguments["supports"] if s.where == "RIGHT").amplitude
    assert track == fx.SmoothStep((0.0, 1.0), (0.0, 2.0))
    assert not found.report.replaced
    found = read(tmp_path, text.format("PERIODIC", "1, 6.283185307179586, 0., 1.\n0., 0.5") + step)
    track = next(s for s in found.arguments["supports"] if s.where == "RIGHT").amplitude
    assert track(0.25) == pytest.approx(3.0) and track(0.75) == pytest.approx(1.0)
    cycle = "1, 6.2832, 0., 1.\n0., 0.5"  # 2 pi with few digits returns after a cycle all the same
    cycles = step.replace("*STATIC", "*FATIGUE")
    found = read(tmp_path, text.format("PERIODIC", cycle) + cycles)
    track = next(s for s in found.arguments["supports"] if s.where == "RIGHT").amplitude
    assert track(1.0) == pytest.approx(track(0.0), rel=1e-12)
    assert any("6.2832 is taken as 6.283185307" in line for line in found.report.replaced)
    refused(tmp_path, text.format("DECAY", "1.") + step, "DEFINITION=DECAY is not available")
    bad = text.format("TABULAR", "0., 0., 0., 1.") + step
    refused(tmp_path, bad, "times must increase")
    refused(tmp_path, PLATE + step, "there is no amplitude 'A'")


def test_smooth_steps_over_several_steps(tmp_path):
    """Whole smooth steps are exact; where one is cut, straight lines within 1e-3 of its height."""

    def track(form, second, *, reported):
        text = PLATE + f"*BOUNDARY\nLEFT, PINNED\n*AMPLITUDE, NAME=A, DEFINITION=SMOOTH STEP{form}"
        found = read(tmp_path, text + stepped("*BOUNDARY, AMPLITUDE=A", "RIGHT, 1, 1, 2.") + second)
        assert bool(found.report.replaced) == reported
        return next(s for s in found.arguments["supports"] if s.where == "RIGHT")

    back = stepped("*BOUNDARY, AMPLITUDE=B", "RIGHT, 1, 1, 2.")
    back = "*AMPLITUDE, NAME=B, DEFINITION=SMOOTH STEP\n0., 1., 1., 0.5\n" + back
    held = stepped("*CLOAD", "6, 2, 1.")
    there = track("\n0., 0., 0.5, 1.\n", held, reported=False)
    assert there.amplitude == fx.SmoothStep((0.0, 0.5, 1.0, 2.0), (0.0, 2.0, 2.0, 2.0))
    there = track("\n0., 0., 0.5, 1.\n", back, reported=False)
    assert there.amplitude == fx.SmoothStep((0.0, 0.5, 1.0, 2.0), (0.0, 2.0, 2.0, 1.0))
    total = track(", TIME=TOTAL TIME\n0., 0., 1.5, 1.\n", held, reported=False)
    assert total.x == 2.0 and total.amplitude == fx.SmoothStep((0.0, 1.5), (0.0, 1.0))
    cut = track("\n0., 0., 1.5, 1.\n", held, reported=True)
    exact = fx.SmoothStep((0.0, 1.5), (0.0, 2.0))
    times = np.linspace(0.0, 1.0, 101)
    assert max(abs(cut.amplitude(t) - exact(t)) for t in times) < 2e-3
    assert cut.amplitude(2.0) == exact(1.0)


def test_a_jump_between_steps_takes_a_millionth_of_the_step(tmp_path):
    text = PLATE + "*BOUNDARY\nLEFT, PINNED\n" + stepped("*CLOAD", "6, 2, 1.")
    text += "*STEP, AMPLITUDE=STEP\n*STATIC\n0.5, 1.\n*CLOAD\n6, 2, 5.\n*END STEP\n"
    (force,) = arguments(tmp_path, text)["loads"]
    assert force.amplitude(1.0) == 1.0 and force.amplitude(1.0 + 2e-6) == 5.0


# -- loads -----------------------------------------------------------------------------------------


def test_a_concentrated_force_acts_on_every_node_of_a_set(tmp_path):
    text = PLATE + "*BOUNDARY\nLEFT, PINNED\n" + stepped("*CLOAD", "RIGHT, 2, 1.5", "6, 1, 1.")
    side, single = arguments(tmp_path, text)["loads"]
    assert side.value == (0.0, 3.0) and single.value == (1.0, 0.0)  # PointForce is the total


def test_pressures_tractions_body_forces_and_gravity(tmp_path):
    text = PLATE.replace("200., 0.25", "200., 0.25\n*DENSITY\n2.") + "*BOUNDARY\nLEFT, PINNED\n"
    text += stepped(
        "*DSLOAD", "END, P, 3.", "END, TRVEC, 2., 0., -1.", "*DLOAD", "LAST, P3, 1.",
        "PLATE, BY, 0.5", ", GRAV, 10., 0., -1., 0.", "LAST, HP3, 2., 0., 1.",
    )  # fmt: skip
    loads = {x.title: x for x in arguments(tmp_path, text)["loads"]}
    assert loads["END"].value == 3.0 and loads["END 2"].value == (0.0, -2.0)
    assert loads["LAST.P3"].where == "LAST.P3" and loads["PLATE.BY"].value == (0.0, 0.5)
    assert loads["gravity PLATE"].value == (0.0, -20.0)
    assert loads["LAST.P3 2"].value(np.array([[0.0], [0.5], [0.0]])) == pytest.approx(1.0)


def test_levels_of_hydrostatic_pressures_in_later_steps(tmp_path):
    """The level rises in the second step: OP=NEW says so, without it what is meant is not clear."""
    text = PLATE + "*BOUNDARY\nLEFT, PINNED\n" + stepped("*DLOAD", "LAST, HP3, 2., 0., 1.")
    risen = text + stepped("*DLOAD, OP=NEW", "LAST, HP3, 2., 0., 4.")
    before, after = arguments(tmp_path, risen)["loads"]
    at = np.array([[0.0], [0.5], [0.0]])
    assert [before.amplitude(t) * before.value(at) for t in (1.0, 2.0)] == [1.0, 0.0]
    assert [after.amplitude(t) * after.value(at) for t in (1.0, 2.0)] == [0.0, 0.25]
    refused(tmp_path, risen.replace(", OP=NEW", ""), "has the levels 0 and 1 from a step before")
    both = text.replace("2., 0., 1.\n", "2., 0., 1.\nLAST, HP3, 1., 0., 4.\n")
    assert len(arguments(tmp_path, both)["loads"]) == 2  # of one step they are added


def test_shear_tractions_lie_in_their_surface(tmp_path):
    """On the edge x = 2 the direction (3, 4) is projected on y: the magnitude stays."""
    step = stepped("*DSLOAD", "END, TRSHR, 5., 3., 4., 0.")
    (load,) = arguments(tmp_path, PLATE + step)["loads"]
    assert isinstance(load, fx.Traction) and load.value == pytest.approx((0.0, 5.0), abs=1e-15)
    refused(tmp_path, PLATE + step.replace("3., 4., 0.", "1., 0., 0."), "is that of the normal")
    corner = PLATE.replace("LAST, S2", "LAST, S2\nLAST, S3")
    refused(tmp_path, corner + step, "TRSHR is available on flat surfaces")


def test_gravity_on_a_part_of_the_model(tmp_path):
    text = PLATE.replace("200., 0.25", "200., 0.25\n*DENSITY\n2.") + "*BOUNDARY\nLEFT, PINNED\n"
    found = read(tmp_path, text + stepped("*DLOAD", "LAST, GRAV, 10., 0., -1., 0."))
    (weight,) = found.arguments["loads"]
    assert weight.value == (0.0, -20.0)
    assert found.raw.cell_groups[weight.where].tolist() == [1]


def test_loads_of_later_steps(tmp_path):
    text = (
        PLATE + "*BOUNDARY\nLEFT, PINNED\n" + stepped("*CLOAD", "6, 2, 1.", "*DSLOAD", "END,P,2.")
    )
    text += stepped("*CLOAD", "6, 2, 3.", "3, 2, 1.") + stepped("*CLOAD, OP=NEW", "3, 2, 1.")
    loads = {x.title: x.amplitude for x in arguments(tmp_path, text)["loads"]}
    times = (0.0, 1.0, 2.0, 3.0)
    assert loads["6"] == fx.Amplitude(times, (0.0, 1.0, 3.0, 0.0))
    assert loads["3"] == fx.Amplitude(times, (0.0, 0.0, 1.0, 1.0))
    assert loads["END"] == fx.Amplitude(times, (0.0, 2.0, 2.0, 2.0))


def test_a_load_given_twice_in_a_step_is_added_and_said_so(tmp_path):
    text = PLATE + "*BOUNDARY\nLEFT, PINNED\n" + stepped("*CLOAD", "6, 2, 1.", "6, 2, 1.")
    found = read(tmp_path, text)
    assert found.arguments["loads"][0].value == (0.0, 2.0)
    assert "the loads on '6' are added" in found.report.replaced[0]


@pytest.mark.parametrize(
    "cards, words",
    [
        (("*CLOAD", "6, 3, 1."), "component 3 of a force is not available"),
        (("*CLOAD, FOLLOWER", "6, 1, 1."), "turn with the body"),
        (("*DLOAD", "PLATE, CORIO, 1."), "load type CORIO is not available"),
        (("*DLOAD", "PLATE, P, 1."), "needs the face of solid elements"),
        (("*DLOAD", "PLATE, GRAV, 1., 0., -1."), "gravity needs the \\*DENSITY"),
        (("*DLOAD", "PLATE, P2, 1."), "lies inside; only"),
        (("*DSLOAD", "END, PNU, 1."), "user subroutine"),
        (("*DSLOAD", "NO, P, 1."), "there is no surface 'NO'"),
        (("*CONTACT PAIR", "A, B"), "it is model data"),
    ],
)
def test_loads_that_are_refused(tmp_path, cards, words):
    refused(tmp_path, PLATE + "*BOUNDARY\nLEFT, PINNED\n" + stepped(*cards), words)


def test_large_rotations_make_pressures_follow(tmp_path):
    step = stepped("*DSLOAD", "END, P, 3.", "*BOUNDARY", "LEFT, PINNED")
    found = arguments(tmp_path, PLATE + step.replace("*STEP", "*STEP, NLGEOM"))
    assert found["loads"][0].follows and isinstance(found["effects"][0], fx.FiniteStrain)
    step = step.replace("END, P, 3.", "END, TRVEC, 3., 1.").replace("*STEP", "*STEP, NLGEOM")
    refused(tmp_path, PLATE + step, "add FOLLOWER=NO")
    plastic = PLATE.replace("200., 0.25", "200., 0.25\n*PLASTIC\n1., 0.")
    found = read(tmp_path, plastic + STEP.replace("*STEP", "*STEP, NLGEOM"))
    assert not found.arguments["effects"]  # plasticity is for small strain
    assert any("computed as with NLGEOM=NO" in line for line in found.report.replaced)
    rubber = "*MATERIAL, NAME=R\n*HYPERELASTIC, NEO HOOKE\n1., 1.\n*ELSET, ELSET=F\n1\n"
    rubber += "*SOLID SECTION, ELSET=F, MATERIAL=R\n2.\n"
    both = plastic.replace("ELSET=PLATE, MATERIAL", "ELSET=LAST, MATERIAL") + rubber
    refused(tmp_path, both + STEP.replace("*STEP", "*STEP, NLGEOM"), "beside \\*HYPERELASTIC")


# -- temperature -----------------------------------------------------------------------------------


def test_temperatures_of_steps(tmp_path):
    text = PLATE + "*BOUNDARY\nLEFT, PINNED\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 20.\n"
    text += stepped("*TEMPERATURE", "ALL, 70.") + stepped("*TEMPERATURE", "RIGHT, 30.")
    (effect,) = arguments(tmp_path, text)["effects"]
    assert effect.reference == 20.0
    assert [t for t, _ in effect.value] == [0.0, 1.0, 2.0]
    assert list(effect.value[:2]) == [(0.0, 20.0), (1.0, 70.0)]
    field = effect.value[2][1]
    assert field(np.array([[2.0, 0.0], [0.0, 1.0], [0.0, 0.0]])).tolist() == [30.0, 70.0]


# -- constraints -----------------------------------------------------------------------------------

REFERENCE = "*NODE, NSET=REF\n99, 2., 0.5\n"


def test_an_equation_whose_reference_moves_as_prescribed(tmp_path):
    text = PLATE + REFERENCE + "*EQUATION\n2\nRIGHT, 1, 2., REF, 1, -1.\n*BOUNDARY\nLEFT, PINNED\n"
    found = supports(tmp_path, text + stepped("*BOUNDARY", "REF, 1, 1, 0.5"))
    assert found["RIGHT"].x == 0.25 and found["RIGHT"].y is None
    loaded = stepped("*CLOAD", "REF, 2, 1.")
    refused(tmp_path, text + loaded, "no equation has component 2 of this node without elements")


def test_a_kinematic_coupling_that_moves_and_turns(tmp_path):
    text = (
        PLATE + REFERENCE + "*COUPLING, CONSTRAINT NAME=C, REF NODE=REF, SURFACE=END\n*KINEMATIC\n"
    )
    text += "*BOUNDARY\nLEFT, PINNED\n"
    found = supports(tmp_path, text + stepped("*BOUNDARY", "REF, 1, 5", "REF, 6, 6, 0.1"))
    where = next(k for k in found if k.startswith("C"))
    x = np.array([[2.0, 2.0], [0.0, 1.0], [0.0, 0.0]])
    sides = [s for s in arguments(tmp_path, text + stepped(
        "*BOUNDARY", "REF, 1, 5", "REF, 6, 6, 0.1"))["supports"] if s.where == where]  # fmt: skip
    # u = theta x r about (2, 0.5): u_x = -0.1 (y - 0.5), u_y = 0
    along = next(s.x for s in sides if s.x is not None)
    assert along(x) == pytest.approx([0.05, -0.05], abs=1e-12)
    assert [s.y for s in sides if s.y is not None] == [0.0]
    once = stepped("*BOUNDARY", "REF, 1, 2") + stepped("*BOUNDARY", "REF, 6, 6, 0.1")
    refused(tmp_path, text + once, "component 6 of the reference node of 'C' is prescribed in some")


def test_a_rigid_body_that_is_held(tmp_path):
    text = PLATE + REFERENCE + "*RIGID BODY, REF NODE=99, TIE NSET=RIGHT\n*BOUNDARY\nLEFT, PINNED\n"
    found = supports(tmp_path, text + stepped("*BOUNDARY", "REF, 1, 6", "REF, 2, 2, 0.3"))
    assert found["RIGHT"].y == 0.3


# -- steps -----------------------------------------------------------------------------------------


def step_of(tmp_path, text):
    return read(tmp_path, PLATE + "*BOUNDARY\nLEFT, PINNED\n" + text).steps


def test_increments_of_static_steps(tmp_path):
    load = "*CLOAD\n6, 2, 1.\n*END STEP\n"
    (one,) = step_of(tmp_path, f"*STEP, NAME=A, INC=7\n*STATIC\n0.1, 2., 1D-6, 0.5\n{load}")
    assert one.name == "A" and one.step == fx.Static(
        until=fx.Time(2.0), stepping="increment", initial=0.1, minimum=1e-6, maximum=0.5,
        max_increments=7,
    )  # fmt: skip
    (one,) = step_of(tmp_path, f"*STEP\n*STATIC\n{load}")
    assert (one.step.initial, one.step.maximum, one.step.minimum) == (1.0, 1.0, 1e-5)
    (one,) = step_of(tmp_path, f"*STEP\n*STATIC, DIRECT\n0.25, 1.\n{load}")
    assert one.step.initial == one.step.minimum == one.step.maximum == 0.25


def test_controls(tmp_path):
    controls = (
        "*CONTROLS, PARAMETERS=TIME INCREMENTATION\n,,,,,,,10\n, 0.4, , , , , 2.\n"
        "*CONTROLS, TYPE=VCCT LINEAR SCALING\n"
    )
    load = "*CLOAD\n6, 2, 1.\n*END STEP\n"
    one, two = step_of(tmp_path, f"*STEP\n*STATIC\n0.1, 1.\n{controls}{load}*STEP\n*STATIC\n{load}")
    for step in (one.step, two.step):  # empty fields are defaults; later steps inherit
        assert (step.max_cutbacks, step.cutback, step.growth) == (10, 0.4, 2.0)
        assert step.linear_scaling == 0.9


def test_dynamic_steps(tmp_path):
    text = PLATE.replace("200., 0.25", "200., 0.25\n*DENSITY\n2.\n*DAMPING, ALPHA=0.5")
    text += "*BOUNDARY\nLEFT, PINNED\n*STEP\n*DYNAMIC, ALPHA=-0.1, DIRECT\n0.1, 1.\n"
    found = read(tmp_path, text + "*CLOAD\n6, 2, 1.\n*END STEP\n")
    (effect,) = found.arguments["effects"]
    assert (effect.alpha_f, effect.rayleigh) == (0.1, (0.5, 0.0))
    assert found.steps[0].step.dt == 0.1
    (force,) = found.arguments["loads"]  # loads jump in dynamic steps
    assert force.amplitude(0.0) == 0.0 and force.amplitude(2e-6) == force.amplitude(1.0) == 1.0
    explicit = text.replace(", ALPHA=-0.1, DIRECT", ", EXPLICIT")
    assert isinstance(read(tmp_path, explicit + "*END STEP\n").steps[0].step, fx.Explicit)


@pytest.mark.parametrize(
    "text, words",
    [
        ("*STEP\n*END STEP\n", "the step has 0 procedures"),
        ("*STEP\n*STATIC\n*STATIC\n*END STEP\n", "the step has 2 procedures"),
        ("*STEP\n*STATIC\n", r"no \*END STEP"),
        ("*STEP\n*STATIC\n*STEP\n*STATIC\n*END STEP\n", r"no \*END STEP before"),
        ("*STEP\n*STATIC, RIKS\n*END STEP\n", "stepping='path'"),
        ("*STEP\n*STATIC\n-1., 1.\n*END STEP\n", "must be positive"),
        ("*STEP\n*FREQUENCY\n5\n*END STEP\n", "FREQUENCY is refused"),
        ("*STEP\n*DIRECT CYCLIC\n0.1, 1.\n*END STEP\n", "available with FATIGUE only"),
        ("*STEP\n*FATIGUE\n0.1\n*END STEP\n", "the time of one cycle is missing"),
        ("*STATIC\n1., 1.\n", r"it belongs into a \*STEP"),
        ("*SHELL SECTION, ELSET=PLATE, MATERIAL=STEEL\n1.\n", "needs shell elements"),
        (
            "*SHELL GENERAL SECTION, ELSET=PLATE\n1.\n",
            "stiffnesses of the section itself",
        ),
        (2 * "*STEP, PERTURBATION\n*STATIC\n*END STEP\n", "PERTURBATION, a linear step"),
        ("*RESTART, READ, STEP=1\n", "RESTART, READ is refused"),
        ("*CONTACT DAMPING\n0.1\n", "damping between faces is not available"),
        ("*CONTACTPRIN\n", r"did you mean \*CONTACT PRINT"),
        ("*BOUNDRY\nLEFT, 1\n", r"did you mean \*BOUNDARY"),
        ("*BOUNDARY, AMPLITUD=A\nLEFT, 1\n", "there is no amplitude 'A'"),
        ("*BOUNDARY, WEIGHT=A\nLEFT, 1\n", "the parameter WEIGHT is not available"),
        ("*INITIAL CONDITIONS, TYPE=HARDENING\nALL, 1.\n", "TYPE=HARDENING is not available"),
    ],
)
def test_steps_and_cards_that_are_refused(tmp_path, text, words):
    refused(tmp_path, PLATE + text + (STEP if "*STEP" not in text else ""), words)


def test_cards_that_change_nothing_are_not_refused(tmp_path):
    text = PLATE + (
        "*ELEMENT MATRIX OUTPUT, ELSET=PLATE, STIFFNESS=YES\n*RESTART, WRITE, FREQUENCY=0\n"
        "*SURFACE INTERACTION, NAME=I, PAD THICKNESS=0.\n1.\n*BOUNDARY\nLEFT, PINNED\n"
    ) + stepped(
        "*CLOAD", "6, 2, 1.", "*CONTROLS, PARAMETERS=FIELD, FIELD=DISPLACEMENT", "0.01, 1.",
        "*CONTACT STABILIZATION", ",",
    )  # fmt: skip
    report = read(tmp_path, text).report
    assert report.ignored["*ELEMENT MATRIX OUTPUT"] == report.ignored["*RESTART"] == 1
    assert any("*CONTACT STABILIZATION: a control of" in line for line in report.replaced)


def test_several_refusals_are_counted(tmp_path):
    text = PLATE + "*GAP\n1.\n*SPRING\n1.\n" + STEP
    with pytest.raises(DeckError, match=r"and 1 more: 'fxcrack run DECK --check'"):
        read(tmp_path, text)


def test_large_rotations_in_a_later_step_count_from_the_first(tmp_path):
    steps = stepped("*CLOAD", "6, 2, 1.") + stepped("*CLOAD", "6, 2, 1.").replace(
        "*STEP\n", "*STEP, NLGEOM=YES\n", 1
    )
    found = read(tmp_path, PLATE + "*BOUNDARY\nLEFT, PINNED\n" + steps)
    assert "NLGEOM counts from the first step on" in found.report.replaced[0]


def test_monitors_of_history_output(tmp_path):
    cards = (
        "*OUTPUT, HISTORY",
        "*NODE OUTPUT, NSET=RIGHT",
        "U2, RF",
        "*NODE PRINT, NSET=LEFT",
        "U",
    )
    text = PLATE + "*BOUNDARY\nLEFT, PINNED\n" + stepped("*CLOAD", "6, 2, 1.", *cards)
    titles = [m.title for m in arguments(tmp_path, text)["monitors"]]
    assert titles == ["U2 RIGHT", "U1 LEFT", "U2 LEFT"]
    report = read(tmp_path, text.replace("*NODE PRINT, NSET=LEFT\nU\n", "*NODE PRINT\nRF\n")).report
    assert report.read[-2].startswith("column of the history: m[U2 RIGHT]")
    assert "*NODE OUTPUT" not in report.ignored and report.ignored["*NODE PRINT"] == 1


# -- whole scenes ----------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.three
def test_a_deck_gives_the_closed_form_on_any_number_of_ranks(comm, shared_path):
    # plane strain, free sideways: E' = E/(1 - nu^2); force 3 on the end of height 1, thickness 2
    text = PLATE + "*BOUNDARY\nLEFT, 1\n1, 2\n" + stepped("*DSLOAD", "END, P, -3.")
    deck = fx.read_deck(write(shared_path, text), comm)
    history = deck.run()
    strain = 3.0 / (200.0 / (1.0 - 0.25**2))
    assert history.rows[-1]["R[LEFT.x]"] == pytest.approx(-6.0, rel=1e-10)
    assert history.rows[-1]["v[END]"] == pytest.approx(3.0 * 2.0 * 2.0 * strain, rel=1e-10)
    deck.scene.close()


SECOND = """*NODE
1, 0., 0.
2, 2., 0.
3, 2., 1.
4, 0., 1.
5, 1., 0.
6, 2., 0.5
7, 1., 1.
8, 0., 0.5
12, 4., 0.
13, 4., 1.
15, 3., 0.
16, 4., 0.5
17, 3., 1.
*ELEMENT, TYPE=CPS8R, ELSET=E
1, 1,2,3,4,5,6,7,8
2, 2,12,13,3,15,16,17,6
*NSET, NSET=LEFT
1, 4, 8
*NSET, NSET=MIDDLE
8
*NSET, NSET=RIGHT
12, 13, 16
*SURFACE, NAME=END
E, S2
*SOLID SECTION, ELSET=E, MATERIAL=M
1.
*MATERIAL, NAME=M
*ELASTIC
100., 0.3
*BOUNDARY
LEFT, 1
MIDDLE, 2
"""


@pytest.mark.mpi
@pytest.mark.three
def test_midside_nodes_are_held_loaded_and_watched(comm, shared_path):
    # pure bending by forces on corner nodes alone: the support of the midside node carries nothing,
    # and the midside nodes of LEFT are held with its corners
    text = SECOND + stepped("*CLOAD", "12, 1, -1.", "13, 1, 1.", "16, 2, 0.", static="1., 1.")
    text = text.replace("*END STEP", "*NODE PRINT, NSET=RIGHT\nU\n*END STEP")
    deck = fx.read_deck(write(shared_path, text), comm)
    (points,) = [g for n, g in deck.scene.mesh.groups.items() if n == "MIDDLE"]
    assert comm.allreduce(len(points.entities)) == 0  # no vertex
    history = deck.run()
    row = history.rows[-1]
    assert row["R[MIDDLE.y]"] == pytest.approx(0.0, abs=1e-10)
    assert row["R[LEFT.x]"] == pytest.approx(0.0, abs=1e-10)
    # beam theory: u_y = -M L^2/(2 E I) with M = 1, I = 1/12, up to the ends' disturbance
    assert abs(row["m[U2 RIGHT]"]) == pytest.approx(16.0 / (2.0 * 100.0 / 12.0), rel=0.05)
    deck.scene.close()


def test_a_deck_may_be_changed_before_it_runs(tmp_path):
    deck = fx.read_deck(write(tmp_path, PLATE + STEP))
    soft = deck.run().rows[-1]["R[RIGHT.x]"]
    deck.scene = deck.scene.rebuilt(materials=fx.Isotropic(400.0, 0.25))
    assert deck.run().rows[-1]["R[RIGHT.x]"] == pytest.approx(2.0 * soft, rel=1e-12)
    deck.steps[0].step = fx.Static(until=fx.Time(0.5))
    deck.scene = deck.scene.rebuilt()
    assert deck.run().rows[-1]["R[RIGHT.x]"] == pytest.approx(soft, rel=1e-12)


def test_first_order_elements_raised_to_the_second_order(tmp_path):
    path = write(tmp_path, PLATE + STEP)
    coarse = fx.read_deck(path).run().rows[-1]["R[RIGHT.x]"]
    deck = fx.read_deck(path, order=2)
    fine = deck.run().rows[-1]["R[RIGHT.x]"]
    # the nodes added between those of LEFT are held with them: only the elements are softer
    assert 0.95 * coarse < fine < coarse
    assert deck.scene.mesh.order == 2
    second = write(tmp_path, SECOND + stepped("*CLOAD", "12, 1, -1."))
    with pytest.raises(DeckError, match="order = 1 is not possible with CPS8R"):
        fx.read_deck(second, order=1)


def test_two_bars_of_plane_stress_run(tmp_path):
    step = stepped("*DSLOAD", "Bar-1.End, P, -1.", "*BOUNDARY", "Bar-1.1, 2, 2")
    deck = fx.read_deck(write(tmp_path, PARTS + step))
    row = deck.run().rows[-1]
    # the fibres of the first bar stand upright: E = E_2
    assert row["v[Bar-1.End]"] > 0.0 and row["balance"] == pytest.approx(0.0, abs=1e-12)


def test_free_thermal_expansion(tmp_path):
    text = PLATE.replace("200., 0.25", "200., 0.25\n*EXPANSION\n1E-3")
    text += "*BOUNDARY\nLEFT, 1\n1, 2\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 20.\n"
    cards = ("*TEMPERATURE", "ALL, 70.", "*NODE PRINT, NSET=RIGHT", "U1")
    row = fx.read_deck(write(tmp_path, text + stepped(*cards))).run().rows[-1]
    # plane strain: (1 + nu) alpha dT along 2
    assert row["m[U1 RIGHT]"] == pytest.approx(2.0 * 1.25 * 1e-3 * 50.0, rel=1e-10)
    assert row["R[LEFT.x]"] == pytest.approx(0.0, abs=1e-10)


def test_a_temperature_that_varies_from_node_to_node(tmp_path):
    text = PLATE.replace("200., 0.25", "200., 0.\n*EXPANSION\n1E-3")
    text += "*NSET, NSET=CORNER\n3\n*NSET, NSET=TOP\n6\n*BOUNDARY\n1, 1, 2\n3, 2\n"
    text += "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 0.\n"
    cards = ("*TEMPERATURE", "LEFT, 10.", "2, 20.", "5, 20.", "RIGHT, 30.")
    cards += ("*NODE PRINT, NSET=CORNER", "U1", "*NODE PRINT, NSET=TOP", "U")
    path = write(tmp_path, text + stepped(*cards))
    row = fx.read_deck(path, order=2).run().rows[-1]
    # without stress in the plane u = alpha (10 x + 5 x^2 - 5 y^2, 10 y + 10 x y)
    assert row["m[U1 CORNER]"] == pytest.approx(1e-3 * 40.0, rel=1e-10)
    assert row["m[U1 TOP]"] == pytest.approx(1e-3 * 35.0, rel=1e-10)
    assert row["m[U2 TOP]"] == pytest.approx(1e-3 * 30.0, rel=1e-10)
    # first-order cells have the temperature of their middles, 15 and 25
    row = fx.read_deck(path, order=1).run().rows[-1]
    assert row["m[U1 CORNER]"] == pytest.approx(1e-3 * 40.0, rel=1e-10)


@pytest.mark.parametrize(
    ("cell", "order"), [(c, o) for c in ("quadrilateral", "hexahedron", "tetrahedron")
                        for o in (1, 2)],
)  # fmt: skip
def test_values_at_nodes_are_interpolated_within_cells(cell, order):
    """On slender cells that are sheared, where the nearest middle is often that of another cell."""
    tdim = 2 if cell == "quadrilateral" else 3
    kind = getattr(dolfinx.mesh.CellType, cell)
    sizes, ends = (3, 9, 2)[:tdim], (np.zeros(tdim), np.ones(tdim))
    create = dolfinx.mesh.create_rectangle if tdim == 2 else dolfinx.mesh.create_box
    mesh = create(MPI.COMM_SELF, ends, sizes, kind)
    space = dolfinx.fem.functionspace(mesh, ("Lagrange", order))
    scale = np.diag([30.0, 1.0, 2.0])
    scale[0, 1] = 4.0
    positions = space.tabulate_dof_coordinates() @ scale.T

    def given(x):
        return 3.0 + x[0] - 5.0 * x[1] + (0.2 * x[0] * x[1] - x[1] ** 2 if order > 1 else 0.0)

    found = CellField(
        cell, order, positions[:, :tdim], np.asarray(space.dofmap.list), given(positions.T)
    )
    rng = np.random.default_rng(1)
    at = np.zeros((3, 400))
    at[:tdim] = rng.random((tdim, 400))
    at = scale @ at
    assert np.allclose(found(at), given(at), rtol=0.0, atol=1e-9)
    outside = at + np.array([[100.0], [0.0], [0.0]])
    assert np.isfinite(found(outside)).all()


def test_a_dynamic_step_runs(tmp_path):
    text = PLATE.replace("200., 0.25", "200., 0.25\n*DENSITY\n2.") + "*BOUNDARY\nLEFT, PINNED\n"
    text += "*STEP\n*DYNAMIC, ALPHA=0., DIRECT\n0.01, 0.1\n*CLOAD\nRIGHT, 2, 1.\n*END STEP\n"
    history = fx.read_deck(write(tmp_path, text)).run()
    last = history.rows[-1]
    assert last["time"] == pytest.approx(0.1)
    assert last["kinetic_energy"] > 0.0
    assert abs(last["balance"]) < 1e-8 * last["external_work"]  # Newmark conserves energy


def test_large_rotations_run(tmp_path):
    step = stepped("*DSLOAD", "END, TRVEC, 4., 0., 1.", "*BOUNDARY", "LEFT, PINNED")
    step = step.replace("*STEP", "*STEP, NLGEOM").replace("*DSLOAD", "*DSLOAD, FOLLOWER=NO")
    small = fx.read_deck(write(tmp_path, PLATE + step.replace(", NLGEOM", ""))).run()
    large = fx.read_deck(write(tmp_path, PLATE + step)).run()
    # the arm of the load gets shorter as the body turns: stiffer, but not by much
    ratio = large.rows[-1]["v[END]"] / small.rows[-1]["v[END]"]
    assert 0.95 < ratio < 0.9999
