"""Axes of materials and nodes in decks: *ORIENTATION, *DISTRIBUTION, *TRANSFORM, *SYSTEM."""

from __future__ import annotations

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.deck.cards import DeckError
from tests.decks import PLATE, STEP, read, write
from tests.test_deck_surface_shells import STRIP

ORTHOTROPIC = PLATE.replace("MATERIAL=STEEL", "MATERIAL=STEEL, ORIENTATION=O").replace(
    "*ELASTIC\n200., 0.25",
    "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n100., 10., 8., 0.3, 0.25, 0.4, 5., 4.\n3.",
)


def frames(tmp_path, orientation):
    """Axes 1 and 2 of the two elements of the plate, whose centres are (0.5, 0.5), (1.5, 0.5)."""
    found = read(tmp_path, ORTHOTROPIC + orientation + STEP)
    out = {}
    for name, material in found.arguments["materials"].items():
        for cell in found.raw.cell_groups[name].tolist():
            out[cell] = np.array(material.frame)
    return [out[0], out[1]]


def refused(tmp_path, text, words):
    with pytest.raises(DeckError, match=words) as caught:
        read(tmp_path, text)
    assert "model.inp" in str(caught.value)


def test_cylindrical_axes_are_those_of_element_centres(tmp_path):
    # the axis is z through (0.5, 0): the first centre lies above it, the second at 26.57 degrees
    card = "*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n0.5, 0., 0., 0.5, 0., 1.\n"
    one, other = frames(tmp_path, card)
    assert np.allclose(one, [[0, 1, 0], [-1, 0, 0]], atol=1e-15)
    radial = np.array([1.0, 0.5, 0.0]) / np.hypot(1.0, 0.5)
    assert np.allclose(other, [radial, [-radial[1], radial[0], 0]], atol=1e-15)
    one, _ = frames(tmp_path, card + "3, 90.\n")  # turned further about the axis
    assert np.allclose(one, [[-1, 0, 0], [0, -1, 0]], atol=1e-15)
    refused(tmp_path, ORTHOTROPIC + card.replace("0.5, 0., 1.", "0.5, 0., 0.") + STEP, "different")


def test_spherical_axes(tmp_path):
    # radial, around the polar axis, and along the meridian, which is across both
    card = "*ORIENTATION, NAME=O, SYSTEM=SPHERICAL\n0.5, 0., 0., 0.5, 0., 1.\n"
    one, _ = frames(tmp_path, card)
    assert np.allclose(one, [[0, 1, 0], [-1, 0, 0]], atol=1e-15)


def test_axes_by_nodes(tmp_path):
    # node 4 on axis 1, node 3 in the plane of axes 1 and 2, from node 1
    one, other = frames(tmp_path, "*ORIENTATION, NAME=O, DEFINITION=NODES\n4, 3, 1\n")
    assert np.allclose([one, other], [[[0, 1, 0], [1, 0, 0]]] * 2, atol=1e-15)
    card = "*ORIENTATION, NAME=O, DEFINITION=OFFSET TO NODES\n4, 2\n"  # of each element
    one, other = frames(tmp_path, card)
    assert np.allclose([one, other], [[[0, 1, 0], [1, 0, 0]]] * 2, atol=1e-15)
    refused(tmp_path, ORTHOTROPIC + card.replace("4, 2", "4, 9") + STEP, "have nodes 1 to 4")
    nodes = "*ORIENTATION, NAME=O, DEFINITION=NODES\n4, 77, 1\n"
    refused(tmp_path, ORTHOTROPIC + nodes + STEP, "node 77 does not exist")


def test_axes_by_a_distribution(tmp_path):
    table = (
        "*DISTRIBUTION TABLE, NAME=T\nCOORD3D, COORD3D\n"
        "*DISTRIBUTION, NAME=D, LOCATION=ELEMENT, TABLE=T\n"
        ", 1., 0., 0., 0., 1., 0.\n2, 0., 1., 0., -1., 0., 0.\n"
    )
    one, other = frames(tmp_path, table + "*ORIENTATION, NAME=O\nD\n3, 0.\n")
    assert np.allclose(one, [[1, 0, 0], [0, 1, 0]]) and np.allclose(other, [[0, 1, 0], [-1, 0, 0]])
    angles = "*DISTRIBUTION, NAME=D, LOCATION=ELEMENT\n, 0.\nLAST, 90.\n"  # by a set
    one, other = frames(tmp_path, angles + "*ORIENTATION, NAME=O\n1., 0., 0., 0., 1., 0.\n3, D\n")
    assert np.allclose(one, [[1, 0, 0], [0, 1, 0]]) and np.allclose(other, [[0, 1, 0], [-1, 0, 0]])
    alone = table.replace(", 1., 0., 0., 0., 1., 0.\n", "") + "*ORIENTATION, NAME=O\nD\n"
    refused(tmp_path, ORTHOTROPIC + alone + STEP, "1 of 2 elements have no complete value")
    refused(tmp_path, ORTHOTROPIC + "*ORIENTATION, NAME=O\nD\n" + STEP, "no distribution 'D'")


def test_an_isotropic_body_needs_no_axes(tmp_path):
    text = PLATE.replace("MATERIAL=STEEL", "MATERIAL=STEEL, ORIENTATION=O")
    card = "*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n0.5, 0., 0., 0.5, 0., 1.\n"
    assert len(read(tmp_path, text + card + STEP).arguments["materials"]) == 1


def test_expansion_along_axes_of_an_isotropic_material(tmp_path):
    text = PLATE + "*EXPANSION, TYPE=ORTHO\n1E-5, 2E-5, 3E-5\n" + STEP
    (material,) = read(tmp_path, text).arguments["materials"].values()
    assert material.expansion == (1e-5, 2e-5, 3e-5) and material.E == (200.0,) * 3
    assert material.G == (80.0,) * 3 and material.nu == (0.25,) * 3


def test_shell_thickness_by_a_distribution(tmp_path):
    table = "*DISTRIBUTION, NAME=D, LOCATION=ELEMENT\n, 0.2\n1, 0.3\n2, 0.3\n"
    section = table + "*SHELL SECTION, ELSET=STRIP, MATERIAL=PLAIN, SHELL THICKNESS=D\n1., 5"
    found = read(tmp_path, STRIP.format(section=section, load="*CLOAD\nTIP, 3, 1."))
    made = found.arguments["materials"]
    sizes = {s.thickness: len(found.raw.cell_groups[n]) for n, s in made.items()}
    assert sizes == {0.2: 8, 0.3: 2}


def test_plies_whose_angle_an_orientation_gives(tmp_path):
    section = (
        "*ORIENTATION, NAME=P\n1., 1., 0., -1., 1., 0.\n3, 0.\n"
        "*SHELL GENERAL SECTION, ELSET=STRIP, COMPOSITE, ORIENTATION=O\n0.1, , PLY, P\n"
        "0.1, , PLY, 90."
    )
    (made,) = read(tmp_path, STRIP.format(section=section, load="")).arguments["materials"].values()
    assert [ply.angle for ply in made.laminate.plies] == [45.0, 90.0]


# -- nodes -----------------------------------------------------------------------------------------


def turned(angle, text):
    """A deck with its nodes turned about z, and a *TRANSFORM back to its axes, degrees."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    head, rest = text.split("*ELEMENT", 1)
    lines = []
    for line in head.splitlines():
        if line[:1].isdigit():
            n, x, y = (float(v) for v in line.split(","))
            line = f"{n:.0f}, {c * x - s * y!r}, {s * x + c * y!r}".replace("np.float64", "")
            line = line.replace("(", "").replace(")", "")
        lines.append(line)
    card = f"*TRANSFORM, NSET=ALL\n{c}, {s}, 0., {-s}, {c}, 0.\n"
    return "\n".join(lines) + "\n*ELEMENT" + rest.replace("*MATERIAL", card + "*MATERIAL", 1)


LOADED = """*STEP
*STATIC
1., 1.
*BOUNDARY
LEFT, 1
1, 2
RIGHT, 1, 1, 0.1
*CLOAD
5, 1, 3.
5, 2, -2.
*END STEP
"""


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("angle", [30.0, 90.0])
def test_components_along_axes_of_nodes(shared_path, angle):
    """A plate that is turned, supports and loads with it, moves as the plate does."""
    deck = fx.read_deck(write(shared_path, PLATE + LOADED))
    work = deck.run()["external_work"][-1]
    deck.scene.close()
    other = fx.read_deck(write(shared_path, turned(angle, PLATE) + LOADED, "turned.inp"))
    history = other.run()
    # the same arithmetic in turned axes: differences are round-off
    assert history["external_work"][-1] == pytest.approx(work, rel=1e-10)
    other.scene.close()


def test_axes_of_nodes_about_a_line(tmp_path):
    """Nodes that cannot move along circles about z, or not at all, or along x through them."""
    card = "*TRANSFORM, NSET=LEFT, TYPE=C\n-1., 0., 0., -1., 0., 1.\n"
    step = "*STEP\n*STATIC\n*BOUNDARY\nLEFT, {}\n*END STEP\n"
    held = read(tmp_path, PLATE + card + step.format("2")).arguments["supports"]
    # node 1 lies along x from the axis, node 4 at 45 degrees
    plain = [s for s in held if isinstance(s, fx.Displacement)]
    (equation,) = (s for s in held if isinstance(s, fx.Equation))
    assert [(s.x, s.y) for s in plain] == [(None, 0.0)]
    assert sorted(axis for _, axis, _ in equation.terms) == ["x", "y"]
    factors = {axis: factor for _, axis, factor in equation.terms}
    assert factors["x"] == pytest.approx(-factors["y"], rel=1e-12)
    (both,) = read(tmp_path, PLATE + card + step.format("1, 2")).arguments["supports"]
    assert isinstance(both, fx.Displacement) and (both.x, both.y) == (0.0, 0.0)


def test_transforms_that_are_refused(tmp_path):
    card = "*TRANSFORM, NSET=LEFT\n1., 1., 0., -1., 1., 0.\n"
    equation = "*EQUATION\n2\n4, 1, 1., 6, 1, -1.\n"
    refused(tmp_path, PLATE + card + equation + STEP, "has nodes with a \\*TRANSFORM")
    line = card.replace("-1., 1.", "1., 1.")
    refused(tmp_path, PLATE + line + STEP, "the two points and the origin lie on a line")
    axis = "*TRANSFORM, NSET=LEFT, TYPE=C\n0., 0., 0., 0., 0., 1.\n"
    refused(tmp_path, PLATE + axis + STEP, "no node may lie on the axis")


def test_nodes_in_a_local_system(tmp_path):
    start = "*SYSTEM\n1., 2., 0., 1., 3., 0.\n0., 2., 0.\n"  # axes 1 and 2 are y and -x
    text = PLATE.replace("*NODE", start + "*NODE").replace("*ELEMENT", "*SYSTEM\n*ELEMENT", 1)
    x = read(tmp_path, text + STEP).raw.points
    plain = read(tmp_path, PLATE + STEP).raw.points
    assert np.allclose(x, np.column_stack([1.0 - plain[:, 1], 2.0 + plain[:, 0]]))
    moved = text.replace("1., 2., 0., 1., 3., 0.\n0., 2., 0.", "1., 2.")
    assert np.allclose(read(tmp_path, moved + STEP).raw.points, plain + np.array([1.0, 2.0]))


def test_nodes_in_spherical_coordinates(tmp_path):
    far = "*NODE, SYSTEM=S\n6, 2., 60., 0.\n*ELEMENT"
    x = read(tmp_path, PLATE.replace("*ELEMENT", far, 1) + STEP).raw.points
    assert np.allclose(x[5], [1.0, np.sqrt(3.0)])
