"""What decks hold that plays no part in what is computed, and cards without data."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.deck.cards import DeckError
from fxcrack.deck.ties import reached
from tests.decks import BONDED, OPENED, PLATE, STEP, VCCT, read, write


def test_materials_and_interactions_that_nothing_names(tmp_path):
    unused = (
        "*MATERIAL, NAME=USER\n*DEPVAR\n3\n*USER MATERIAL, CONSTANTS=1\n1.\n*MYSTERY\n"
        "*SURFACE INTERACTION, NAME=J\n*COHESIVE BEHAVIOR\n*DAMAGE INITIATION, CRITERION=MAXS\n1.\n"
    )
    text = BONDED.replace("*CONTACT PAIR", unused + "*CONTACT PAIR")
    report = read(tmp_path, text + OPENED.format(criterion=VCCT)).report
    assert [name for name in report.ignored if "nothing in the deck names" in name] == [
        "material 'USER', which nothing in the deck names",
        "surface interaction 'J', which nothing in the deck names",
    ]
    named = text.replace("INTERACTION=I\nT", "INTERACTION=J\nT")
    with pytest.raises(DeckError, match="DAMAGE INITIATION is refused"):
        read(tmp_path, named + OPENED.format(criterion=VCCT))
    with pytest.raises(DeckError, match="DEPVAR is refused"):
        read(tmp_path, text.replace("MATERIAL=M", "MATERIAL=USER") + OPENED.format(criterion=VCCT))


def test_what_follows_a_material_that_nothing_names(tmp_path):
    spare = "*MATERIAL, NAME=SPARE\n*CONDUCTIVITY\n1.\n*DENSITY\n7.\n*EXPANSION\n1e-5\n*MYSTERY\n"
    found = read(tmp_path, PLATE + spare + STEP)
    (steel,) = found.arguments["materials"].values()
    assert steel == fx.Isotropic(200.0, 0.25)  # density and expansion are not those of SPARE
    assert "*MYSTERY, taken for data of the material 'SPARE'" in found.report.ignored
    with pytest.raises(DeckError, match="EMBEDDED ELEMENT is refused"):
        read(tmp_path, PLATE + spare + "*EMBEDDED ELEMENT\nLAST\n" + STEP)


def test_perturbation_steps_beside_others(tmp_path):
    frequency = "*STEP, NAME=MODES, PERTURBATION\n*FREQUENCY\n5\n*BOUNDARY\nLEFT, 2\n*END STEP\n"
    found = read(tmp_path, PLATE + STEP + frequency + STEP)
    assert [step.name for step in found.steps] == ["step 1", "step 2"]
    assert any("'MODES' is left out" in line for line in found.report.replaced)
    alone = STEP.replace("*STEP", "*STEP, PERTURBATION, NLGEOM")
    (step,) = read(tmp_path, PLATE + alone).steps
    assert isinstance(step.step, fx.Static)
    assert not read(tmp_path, PLATE + alone).arguments["effects"]  # it is linear


def test_point_masses_in_static_steps(tmp_path):
    mass = "*ELEMENT, TYPE=MASS, ELSET=POINT\n9, 6\n*MASS, ELSET=POINT\n1.\n"
    found = read(tmp_path, PLATE + mass + STEP)
    assert sum("point masses play no part" in line for line in found.report.replaced) == 1
    heavy = STEP.replace("*END STEP", "*DLOAD\n, GRAV, 9.81, 0., -1., 0.\n*END STEP")
    with pytest.raises(DeckError, match="MASS is refused: a point mass of 1 at node 6"):
        read(tmp_path, PLATE + mass + heavy)


def test_op_new_without_data_takes_all_away(tmp_path):
    first = STEP.replace("*END STEP", "*CLOAD\n6, 2, 1.\n*END STEP")
    second = "*STEP\n*STATIC\n0.5, 1.\n*CLOAD, OP=NEW\n*TEMPERATURE, OP=NEW\n*END STEP\n"
    (load,) = read(tmp_path, PLATE + first + second).arguments["loads"]
    assert load.amplitude(1.0) * load.value[1] == 1.0 and load.amplitude(2.0) == 0.0
    with pytest.raises(DeckError, match="there is no data line"):
        read(tmp_path, PLATE + first + second.replace(", OP=NEW", ""))


def test_ties_reach_large_facets_beside_small_ones():
    """Nodes on a facet of 20 x 1 reach it, though 12 small ones beside it are nearer by centre."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    places = np.array([[i, j, 0.0] for i in range(6) for j in range(20)])
    facets = [*(corners + p for p in places), corners * [-20.0, 20.0, 1.0]]
    x = np.array([[-0.9, y, 0.0] for y in np.linspace(0.0, 20.0, 9)])
    assert reached(x, np.array(facets), 0.1).all()
    off = np.array([0.0, 0.0, 0.1])  # just the tolerance, whatever the round-off
    assert reached(x + off, np.array(facets), 0.1).all()
    assert not reached(x + 1.001 * off, np.array(facets), 0.1).any()
    assert not reached(x - [20.0, 0.0, 0.0], np.array(facets), 0.1).any()


def test_ties_reach_all_of_a_face_of_hexahedra(tmp_path, caplog):
    """A block of 3 x 3 elements on one that is three times as wide: all nodes lie on its face."""
    fine = [(i, j, k) for k in (0, 1) for j in range(4) for i in range(4)]
    nodes = [f"{n + 1}, {i}., {j}., {k}." for n, (i, j, k) in enumerate(fine)]
    wide = [(0, 0), (3, 0), (3, 3), (0, 3)]
    nodes += [f"{41 + n}, {i}., {j}., -1." for n, (i, j) in enumerate(wide)]
    nodes += [f"{45 + n}, {i}., {j}., 0." for n, (i, j) in enumerate(wide)]
    around = [1, 2, 6, 5, 17, 18, 22, 21]
    cells = [[4 * j + i + n for n in around] for j in range(3) for i in range(3)]
    elements = [", ".join(map(str, [1 + e, *cell])) for e, cell in enumerate(cells)]
    text = "\n".join(
        ["*NODE", *nodes, "*ELEMENT, TYPE=C3D8, ELSET=FINE", *elements,
         "*ELEMENT, TYPE=C3D8, ELSET=WIDE", "11, 41, 42, 43, 44, 45, 46, 47, 48",
         "*SURFACE, NAME=UPPER", "FINE, S1", "*SURFACE, NAME=LOWER", "WIDE, S2",
         "*SOLID SECTION, ELSET=FINE, MATERIAL=M", "*SOLID SECTION, ELSET=WIDE, MATERIAL=M",
         "*MATERIAL, NAME=M", "*ELASTIC", "200., 0.25", "*TIE, NAME=T", "UPPER, LOWER",
         "*STEP", "*STATIC", "*BOUNDARY", "41, 1, 3", "*END STEP", ""]
    )  # fmt: skip
    (interface,) = read(tmp_path, text).arguments["bonds"]
    assert callable(interface.bonded) and "beyond the tolerance" not in caplog.text


@pytest.mark.mpi
@pytest.mark.three
def test_rotation_of_a_body(shared_path):
    """The support of a plate that spins about its edge carries rho omega^2 int x dV."""
    text = PLATE + "*DENSITY\n3.\n"
    step = "*STEP\n*STATIC\n1., 1.\n*BOUNDARY\nLEFT, 1\n1, 2\n*DLOAD\n{}\n*END STEP\n"
    for line, expected in (
        ("PLATE, CENTRIF, 4., 0., 0., 0., 0., 1., 0.", 3.0 * 4.0 * 4.0),
        (", CENT, 5., 0.5, 0., 0., 0., 1., 0.", 5.0 * 2.0),  # int (x - 0.5) dV = 2
    ):
        deck = fx.read_deck(write(shared_path, text + step.format(line)))
        # constant strains of the mean: linear elements integrate the force exactly
        assert deck.run()["R[LEFT.x]"][-1] == pytest.approx(-expected, rel=1e-12)
        deck.scene.close()


def test_an_element_set_where_a_node_set_is_meant(tmp_path, caplog):
    text = PLATE + "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nPLATE, 20.\n"
    assert read(tmp_path, text + STEP).arguments["effects"][0].reference == 20.0
    assert "the nodes of the element set of this name are meant" in caplog.text
    with pytest.raises(DeckError, match="there is no node set 'PLATES'"):
        read(tmp_path, text.replace("PLATE, 20.", "PLATES, 20.") + STEP)


def test_axis_of_rotation_in_a_plane(tmp_path):
    text = PLATE + "*DENSITY\n3.\n"
    step = "*STEP\n*STATIC\n*DLOAD\n{}\n*END STEP\n"
    (spin,) = read(tmp_path, text + step.format(", CENT, 2.")).arguments["loads"]
    x = np.array([[1.0], [2.0], [0.0]])  # in a plane the axis is z
    assert [f(x)[0] for f in spin.value] == [2.0, 4.0]


def test_slave_nodes_beyond_the_tolerance_are_not_tied(tmp_path, caplog):
    """Half of the upper bar hangs over the lower one: its nodes there are free."""
    tied = BONDED[: BONDED.index("*CONTACT PAIR")] + "*TIE, NAME=T\nTOP, BOTTOM\n"
    short = tied.replace("13, 23, 24, 34, 33\n14, 24, 25, 35, 34\n", "")
    step = "*STEP\n*STATIC\n*BOUNDARY\n11, 1, 2\n*END STEP\n"
    found = read(tmp_path, short + step)
    (interface,) = found.arguments["bonds"]
    assert "2 of 5 slave nodes of 'TOP' lie beyond the tolerance" in caplog.text
    x = found.raw.points[found.raw.groups[interface.bonded].rows[:, 0]]
    assert np.array_equal(np.sort(x[:, 0]), [0.0, 1.0, 2.0])
    whole = read(tmp_path, tied + step).arguments["bonds"][0].bonded
    assert whole(np.zeros((3, 4))).all()
    far = tied.replace("0., 1.\n32, 1., 1.", "0., 1.\n32, 1., 0.9")
    for n in (31, 33, 34, 35):
        far = far.replace(f"\n{n}, {n - 31}., 1.", f"\n{n}, {n - 31}., 0.7")
    with pytest.raises(DeckError, match="no slave node lies within the tolerance"):
        read(tmp_path, far.replace("32, 1., 0.9", "32, 1., 0.7") + step)


def test_bonded_bodies_that_lock_are_told_how_much(tmp_path):
    """Square elements, one over the thickness: 48 % (Cook et al., 4th ed., section 3.6)."""
    text = BONDED + OPENED.format(criterion=VCCT)
    (line,) = read(tmp_path, text).report.doubts
    assert "(CPE4) lock in bending, in any program" in line and "by about 48 %" in line
    assert not read(tmp_path, PLATE + STEP).report.doubts  # nothing is bonded
    path = write(tmp_path, text)
    assert not fx.read_deck(path, order=2).report.doubts


def test_field_variables_on_which_nothing_depends(tmp_path):
    fields = "*INITIAL CONDITIONS, TYPE=FIELD, VARIABLE=1\nALL, 1.\n"
    step = STEP.replace("*END STEP", "*FIELD, VARIABLE=1\nALL, 2.\n*END STEP")
    assert not read(tmp_path, PLATE + fields + step).arguments["effects"]
    with pytest.raises(DeckError, match="DEPENDENCIES is not available"):
        read(tmp_path, PLATE.replace("*ELASTIC", "*ELASTIC, DEPENDENCIES=1") + fields + step)


@pytest.mark.mpi
@pytest.mark.three
def test_bodies_that_yield_at_large_strain_are_warned_of(shared_path, caplog):
    """A bar drawn by 10 % of its length: the strain is 0.1, and so is the error."""
    text = PLATE.replace("200., 0.25", "200., 0.25\n*PLASTIC\n1., 0.\n2., 1.")
    step = STEP.replace("RIGHT, 1, 1, 0.1", "RIGHT, 1, 1, {}").replace("0.5, 1.", "1., 1.")
    for pull, warned in ((0.2, True), (0.02, False)):
        caplog.clear()
        deck = fx.read_deck(write(shared_path, text + step.format(pull)))
        deck.run()
        if MPI.COMM_WORLD.rank == 0:
            assert ("bodies that yield have strained by up to" in caplog.text) == warned
        deck.scene.close()
