"""Meshes of decks: generators, sets, parts and instances, faces, added centre nodes."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from fxcrack.deck.cards import DeckError
from fxcrack.deck.elements import FACES, element_type, face_nodes, to_dolfinx
from fxcrack.mesh.raw import reference
from tests.decks import PLATE, STEP, read


def flat(tmp_path, text):
    return read(tmp_path, text + STEP).raw


def at(raw, name):
    """Positions of the nodes of a group, sorted."""
    nodes = np.unique(raw.groups[name].rows)
    return sorted(map(tuple, np.round(raw.points[nodes], 9).tolist()))


# -- elements --------------------------------------------------------------------------------------


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
@pytest.mark.parametrize("order", [1, 2])
def test_faces_and_node_order_agree_with_dolfinx(cell, order):
    rows, perm = face_nodes(cell, order), to_dolfinx(cell, order)
    assert sorted(perm) == list(range(len(perm)))
    n = len(FACES[cell][0])
    for row, corners in zip(rows, FACES[cell], strict=True):
        assert set(row[:n]) == set(corners)
    # a row of a face is a row of DOLFINx' closure of the facet in its own numbering
    tdim = reference(cell, order).points.shape[1]
    closures = {tuple(perm[c]) for c in reference(cell, order).entity_closure_dofs[tdim - 1]}
    assert {tuple(row) for row in rows} == closures


def test_replaced_and_refused_element_types():
    kind = element_type("C3D20R")
    assert kind.serendipity and len(kind.notes) == 2 and "reduced integration" in kind.notes[0]
    assert [element_type(f"CPE{n}").bends_freely for n in ("4I", "4R", "4", "8R")] == [
        True, True, False, False
    ]  # fmt: skip
    assert "incompatible modes are replaced" in element_type("CPE4I").notes[0]
    assert element_type("C3D10M").order == 2 and element_type("CAX8").model == "axisymmetric"
    for name, words in {
        "STRI65": "triangles", "SC6R": "prisms", "C3D6": "prisms", "COH3D8": "cohesive",
        "B31": "beams", "U1": "user elements", "CPE4RT": "temperatures", "CPEG4": "generalised",
        "C3D7": "not known", "RB3D2": "rigid",
    }.items():  # fmt: skip
        assert words in element_type(name)


def test_refused_elements_name_file_line_and_remedy(tmp_path):
    # what is made of them, and named by sets, is no fault beside
    made = "*ELGEN, ELSET=MORE\n1, 2, 1, 1\n*ELSET, ELSET=BOTH\nMORE\n"
    with pytest.raises(DeckError) as caught:
        read(tmp_path, PLATE.replace("CPE4", "COH2D4") + made + STEP)
    assert "model.inp, line 10: element type COH2D4 is refused: cohesive" in str(caught.value)
    assert "use *DEBOND" in str(caught.value)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("2, 2, 3, 6, 5", "2, 2, 3, 9, 5", "element 2 has node 9, which is not defined"),
        ("2, 2, 3, 6, 5", "2, 2, 3, 5, 5", "have a node more than once, the first is element 2"),
        ("2, 2, 3, 6, 5", "2, 2, 3, 6", "no whole number of CPE4 elements"),
        ("2, 2, 3, 6, 5", "2, 2, 3, 6.5, 5", "6.5 is not a positive whole number"),
        ("6, 2., 1.", "6, 2., 1., 3.", "must lie in one plane"),
        ("6, 2., 1.", "6, 2., 1e999", "coordinate is not finite"),
        (
            "*NSET, NSET=LEFT",
            "*ELEMENT, TYPE=CPE3\n9, 1, 2, 4\n*NSET, NSET=LEFT",
            "one of the shapes",
        ),
        (
            "*NSET, NSET=LEFT",
            "*ELEMENT, TYPE=CPS4\n9, 1, 2, 5, 4\n*NSET, NSET=LEFT",
            "one of the kinematic models",
        ),
        ("*NODE, NSET=ALL", "*NODE, NSET=ALL, SYSTEM=T", "SYSTEM=T is not available"),
        ("STEEL\n2.0", "STEEL\n-2.0", "the thickness -2 must be positive"),
        ("LAST, S2", "LAST, S5", "has faces 1 to 4, not 5"),
        ("LAST, S2", "LAST, S4", "lies inside; only"),
        ("LAST, S2", "LAST, SPOS", "face SPOS is not available"),
        ("LAST, S2", "NONE, S2", "there is no element set 'NONE'"),
        ("*SURFACE, NAME=END", "*SURFACE, NAME=END, TYPE=CYLINDER", "TYPE=CYLINDER is not"),
    ],
)
def test_faults_of_meshes(tmp_path, old, new, words):
    # a surface that nothing uses is not looked at
    step = STEP.replace("*END STEP", "*DSLOAD\nEND, P, 1.\n*END STEP")
    with pytest.raises(DeckError, match=words) as caught:
        read(tmp_path, PLATE.replace(old, new) + step)
    assert "line" in str(caught.value) or "plane" in words


def test_data_over_several_lines_without_a_comma(tmp_path):
    hexa = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
        dtype=float,
    )
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
    edges += [(0, 4), (1, 5), (2, 6), (3, 7)]
    x = np.concatenate([hexa, [hexa[list(e)].mean(axis=0) for e in edges]])
    x[12, 1] -= 0.1  # a curved edge of the faces z = 1 and y = 0
    nodes = "\n".join(f"{i + 1}, {a}, {b}, {c}" for i, (a, b, c) in enumerate(x))
    text = (
        f"*NODE\n{nodes}\n*ELEMENT, TYPE=C3D20, ELSET=E\n1, 1,2,3,4,5,6,7,8,9,10,11,12,13,14\n"
        "15,16,17,18,19,20\n*NSET, NSET=BASE\n1,2,3,4,9,10,11,12\n*SURFACE, NAME=ROOF\nE, S2\n"
        "*SURFACE, NAME=ALL\nE\n*SOLID SECTION, ELSET=E, MATERIAL=M\n*MATERIAL, NAME=M\n"
        "*ELASTIC\n1., 0.3\n*STEP\n*STATIC\n*BOUNDARY\nBASE, ENCASTRE\n*END STEP\n"
    )
    found = read(tmp_path, text)
    raw = found.raw
    assert raw.order == 2 and raw.cells.shape == (1, 27)
    # a centre lies where the serendipity functions put it: 1/2 midsides - 1/4 corners
    assert tuple(raw.points[22]) not in ((0.5, 0.5, 1.0),)
    centres = [tuple(np.round(p, 12)) for p in raw.points]
    assert (0.5, 0.45, 1.0) in centres and (0.5, -0.05, 0.5) in centres
    assert (0.5, 0.475, 0.5) in centres  # the cell's: 1/4 midsides - 1/4 corners
    assert (0.5, 0.5, 0.0) in at(raw, "BASE")  # the face's centre is held with it
    assert raw.groups["ROOF"].rows.shape == (1, 9) and raw.groups["ALL"].rows.shape == (6, 9)
    assert {p[2] for p in at(raw, "ROOF")} == {1.0}


def test_neighbours_share_the_centre_of_their_face(tmp_path):
    # two 20-node hexahedra side by side: 32 corner and midside nodes, 11 faces, 2 cells
    lines, number = [], {}
    for k in range(3):
        for j in range(3):
            for i in range(5):
                if (i % 2) + (j % 2) + (k % 2) <= 1:
                    number[i, j, k] = len(number) + 1
                    lines.append(f"{number[i, j, k]}, {0.5 * i}, {0.5 * j}, {0.5 * k}")

    def element(e):
        c = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
        pairs = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
        pairs += [(0, 4), (1, 5), (2, 6), (3, 7)]
        c += [tuple((np.array(c[a]) + c[b]) // 2) for a, b in pairs]
        return ", ".join(str(number[i + 2 * e, j, k]) for i, j, k in c)

    text = "*NODE\n" + "\n".join(lines) + "\n*ELEMENT, TYPE=C3D20R, ELSET=E\n"
    text += f"1, {element(0)}\n2, {element(1)}\n"
    text += "*NSET, NSET=N\n1\n*SOLID SECTION, ELSET=E, MATERIAL=M\n*MATERIAL, NAME=M\n*ELASTIC\n"
    text += "1., 0.3\n*STEP\n*STATIC\n*BOUNDARY\nN, PINNED\n*END STEP\n"
    raw = read(tmp_path, text).raw
    assert len(raw.points) == 5 * 3 * 3
    assert len(np.unique(np.round(raw.points, 9), axis=0)) == 45


def test_a_card_of_elements_without_any(tmp_path):
    raw = flat(tmp_path, PLATE.replace("*NSET", "*ELEMENT, TYPE=C3D8\n*NSET", 1))
    assert raw.cells.shape == (2, 4)


# -- generators ------------------------------------------------------------------------------------

GENERATED = """*NODE
1, 0., 0.
5, 4., 0.
21, 0., 2.
27, 6., 2.
*NGEN, NSET=A
1, 5
*NGEN, NSET=B
21, 27, 1
*NFILL, NSET=ALL
A, B, 2, 10
*ELEMENT, TYPE=CPE4
1, 1, 2, 12, 11
*ELGEN, ELSET=E
1, 4, 1, 1, 2, 10, 4
*SOLID SECTION, ELSET=E, MATERIAL=STEEL
*MATERIAL, NAME=STEEL
*ELASTIC
200., 0.25
*NSET, NSET=LEFT
1, 11, 21
*NSET, NSET=RIGHT
5, 15, 25
"""


def test_nfill_between_sets_of_unequal_length_and_elgen(tmp_path):
    raw = flat(tmp_path, GENERATED)
    assert raw.cells.shape == (8, 4) and len(raw.points) == 15
    assert at(raw, "RIGHT") == [(4.0, 0.0), (4.0, 1.0), (4.0, 2.0)]


def test_copies_with_shift_rotation_and_reflection(tmp_path):
    text = """*NODE, NSET=N
1, 1., 0.
2, 2., 0.
3, 2., 1.
4, 1., 1.
*NCOPY, OLD SET=N, NEW SET=TURNED, CHANGE NUMBER=10, SHIFT
0., 0., 0.
0., 0., 0., 0., 0., 1., 90.
*NCOPY, OLD SET=N, NEW SET=MIRRORED, CHANGE NUMBER=20, REFLECT=MIRROR
0., 5., 0., 1., 5., 0.
0., 5., 1.
*NCOPY, OLD SET=N, NEW SET=ROW, CHANGE NUMBER=100, SHIFT, MULTIPLE=2
10., 0., 0.
*ELEMENT, TYPE=CPE4, ELSET=ONE
1, 1, 2, 3, 4
*ELCOPY, OLD SET=ONE, NEW SET=TWO, ELEMENT SHIFT=1, SHIFT NODES=10
*ELCOPY, OLD SET=ONE, ELEMENT SHIFT=2, SHIFT NODES=20
*ELCOPY, OLD SET=ONE, ELEMENT SHIFT=3, SHIFT NODES=200
*ELSET, ELSET=E, GENERATE
1, 4
*SOLID SECTION, ELSET=E, MATERIAL=STEEL
*MATERIAL, NAME=STEEL
*ELASTIC
200., 0.25
*NSET, NSET=LEFT
1
*NSET, NSET=RIGHT
2
"""
    raw = flat(tmp_path, text)
    assert at(raw, "TURNED") == [(-1.0, 1.0), (-1.0, 2.0), (0.0, 1.0), (0.0, 2.0)]
    assert at(raw, "MIRRORED") == [(1.0, 9.0), (1.0, 10.0), (2.0, 9.0), (2.0, 10.0)]
    assert at(raw, "ROW") == [(21.0, 0.0), (21.0, 1.0), (22.0, 0.0), (22.0, 1.0)]
    assert raw.cell_groups["TWO"].tolist() == [1]


def test_ngen_on_a_circle(tmp_path):
    text = PLATE.replace(
        "*ELEMENT,", "*NGEN, LINE=C, NSET=ARC\n3, 103, 50, , 0., 0., 0.\n*ELEMENT,", 1
    ).replace("6, 2., 1.", "6, 2., 1.\n103, 0., 2.\n10, 0., 0.\n11, -1., 0.")
    text = text.replace("2, 2, 3, 6, 5", "2, 2, 3, 6, 5\n3, 11, 10, 53, 103")
    raw = flat(tmp_path, text)
    half = round(2.0 / 2.0**0.5, 9)
    assert at(raw, "ARC") == [(0.0, 2.0), (half, half), (2.0, 0.0)]


@pytest.mark.parametrize(
    "text, words",
    [
        ("*NGEN\n1, 6, 2", "increment 2 does not lead from node 1 to node 6"),
        ("*NGEN\n1, 99", "node 99 is not defined"),
        ("*NFILL\nLEFT, NO, 2, 1", "there is no set 'NO' yet"),
        ("*NFILL, BIAS=1.5\nLEFT, RIGHT, 2, 1", "BIAS is not available"),
        ("*NCOPY, OLD SET=NO, SHIFT\n1.", "no node set 'NO'"),
        ("*NCOPY, OLD SET=LEFT, CHANGE NUMBER=9, POLE\n1.", "the parameter POLE is not available"),
        ("*ELGEN\n9, 2, 1, 1", "element 9 is not defined"),
        ("*ELGEN\n1, 90000, 1, 1, 90000, 1, 1", "would make"),
        ("*ELCOPY, OLD SET=NO", "no element set 'NO'"),
        ("*NSET, NSET=A, GENERATE\n5, 1, 1", "increment 1 does not lead from 5 to 1"),
        ("*NSET, NSET=A\nNO", "there is no node set 'NO'"),
        ("*NSET, NSET=A\nLEFTT", "did you mean 'LEFT'"),
        ("*NSET, NSET=A, INSTANCE=I\n1", "there is no instance 'I'"),
        ("*NSET, NSET=A, ELSET=NO", "no element set 'NO'"),
    ],
)
def test_faults_of_generators_and_sets(tmp_path, text, words):
    with pytest.raises(DeckError, match=words) as caught:
        read(tmp_path, PLATE + text + "\n" + STEP)
    assert "model.inp, line" in str(caught.value)


# -- sets ------------------------------------------------------------------------------------------


def test_sets_append_name_sets_and_ignore_what_is_not_there(tmp_path, caplog):
    text = PLATE + (
        "*NSET, NSET=left\n5,\n*NSET, NSET=BOTH\nLEFT, right\n*NSET, NSET=GONE, GEN\n1, 99, 1\n"
        "*NSET, NSET=FROM, ELSET=LAST\n*ELSET, ELSET=E, GENERATE\n1, 2\n*ELSET, ELSET=Two\nE\n"
    )
    with caplog.at_level(logging.WARNING, "fxcrack"):
        raw = flat(tmp_path, text)
    assert len(at(raw, "LEFT")) == 3 and len(at(raw, "BOTH")) == 5 and len(at(raw, "GONE")) == 6
    assert at(raw, "FROM") == [(1.0, 0.0), (1.0, 1.0), (2.0, 0.0), (2.0, 1.0)]
    assert raw.cell_groups["Two"].tolist() == [0, 1]
    assert "93 of the 99 nodes of set 'GONE' do not exist, the first is 7" in caplog.text


def test_one_name_for_a_node_set_an_element_set_and_a_surface(tmp_path):
    text = PLATE + "*ELSET, ELSET=LEFT\n1\n*SURFACE, NAME=left\nLEFT, S4\n"
    raw = flat(tmp_path, text)
    assert raw.groups["LEFT"].dim == 0 and raw.cell_groups["LEFT (elements)"].tolist() == [0]
    assert raw.groups["left (surface)"].dim == 1


def test_internal_sets_and_reference_nodes_make_no_groups(tmp_path):
    text = PLATE + "*NSET, NSET=_HIDDEN, INTERNAL\n1\n*NODE, NSET=REF\n99, 5., 5.\n"
    raw = flat(tmp_path, text)
    assert "_HIDDEN" not in raw.groups and "REF" not in raw.groups and len(raw.points) == 6


def test_surface_of_nodes_and_of_the_outside(tmp_path):
    text = PLATE + "*SURFACE, NAME=NODES, TYPE=NODE\nRIGHT,\n*SURFACE, NAME=SKIN\nPLATE,\n"
    raw = flat(tmp_path, text)
    assert raw.groups["NODES"].rows.shape == (1, 2) and raw.groups["SKIN"].rows.shape == (6, 2)
    step = STEP.replace("*END STEP", "*DSLOAD\nODD, P, 1.\n*END STEP")
    with pytest.raises(DeckError, match="1 of 1 nodes of this surface belong to no element face"):
        read(tmp_path, PLATE + "*SURFACE, NAME=ODD, TYPE=NODE\n1\n" + step)


# -- parts and instances ---------------------------------------------------------------------------

PARTS = """*PART, NAME=Bar
*NODE
1, 0., 0.
2, 1., 0.
3, 1., 1.
4, 0., 1.
*ELEMENT, TYPE=CPS4, ELSET=All
1, 1, 2, 3, 4
*NSET, NSET=Foot
1, 4
*SURFACE, NAME=End
All, S2
*SOLID SECTION, ELSET=All, MATERIAL=M, ORIENTATION=O
1.
*ORIENTATION, NAME=O
0., 1., 0., -1., 0., 0.
*END PART
*ASSEMBLY, NAME=Whole
*INSTANCE, NAME=Bar-1, PART=Bar
*END INSTANCE
*INSTANCE, NAME="Bar 2", PART=BAR
10., 0., 0.
10., 0., 0., 10., 0., 1., 90.
*END INSTANCE
*NODE
1, 50., 50.
*NSET, NSET=Both
Bar-1.Foot, "Bar 2".Foot
*NSET, NSET=One, INSTANCE=Bar-1
2, 3
*NSET, NSET=Ref
1
*ELSET, ELSET=_S, INTERNAL, INSTANCE=Bar-1
1
*SURFACE, NAME=S
_S, S3
*END ASSEMBLY
*MATERIAL, NAME=M
*ELASTIC, TYPE=LAMINA
100., 10., 0.3, 5., 5., 5.
*BOUNDARY
Bar-1.Foot, ENCASTRE
"Bar 2.Foot", 1, 2
Whole.Bar-1.2, 2, 2
"""


def test_parts_instances_and_their_names(tmp_path):
    found = read(tmp_path, PARTS + "*STEP\n*STATIC\n*DSLOAD\nBar-1.End, P, 1.\n*END STEP\n")
    raw = found.raw
    assert raw.cells.shape == (2, 4) and len(raw.points) == 8
    # the rotation follows the translation: the second bar stands upright at x = 10
    assert at(raw, "Bar 2.Foot") == [(9.0, 0.0), (10.0, 0.0)]
    assert len(at(raw, "Both")) == 4 and at(raw, "One") == [(1.0, 0.0), (1.0, 1.0)]
    assert "Ref" not in raw.groups
    first, second = found.arguments["materials"].values()
    # the axes of the material turn with the instance
    assert np.allclose(first.frame, [[0, 1, 0], [-1, 0, 0]])
    assert np.allclose(second.frame, [[-1, 0, 0], [0, -1, 0]])
    assert at(raw, "Bar-1.End") == [(1.0, 0.0), (1.0, 1.0)]


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("PART=BAR", "PART=BARS", "there is no part 'BARS' \\(did you mean 'BAR'"),
        ("*END PART\n", "", "begins inside"),
        ("*END INSTANCE\n", "", "begins inside"),
        ("10., 0., 0.\n", "", "the first line is the translation"),
        ("*END PART\n", "*END PART\n*END PART\n", "it ends nothing"),
        ("NAME=Bar-1", 'NAME="Bar 2"', "exists already"),
        ("Bar-1.Foot, ENCASTRE", "Bar-3.Foot, ENCASTRE", "there is no node set 'Bar-3.Foot'"),
        ("Bar-1.Foot, ENCASTRE", "Bar-1.9, ENCASTRE", "node Bar-1.9 does not exist"),
        ("*END PART\n", "*END PART\n*END STEP\n", "it ends no step"),
    ],
)
def test_faults_of_parts(tmp_path, old, new, words):
    with pytest.raises(DeckError, match=words):
        read(tmp_path, PARTS.replace(old, new, 1) + "*STEP\n*STATIC\n*END STEP\n")


def test_a_part_without_an_instance(tmp_path):
    text = PARTS[: PARTS.index("*ASSEMBLY")] + PARTS[PARTS.index("*MATERIAL") :]
    with pytest.raises(DeckError, match=r"part 'Bar' has no \*INSTANCE"):
        read(tmp_path, text + "*STEP\n*STATIC\n*END STEP\n")


def test_sets_and_surfaces_may_name_what_is_defined_after_them(tmp_path):
    early = (
        "*NSET, NSET=BOTH\nL1, L2, 2\n*NSET, NSET=FROM, ELSET=LATER\n*ELSET, ELSET=TWO\nLATER, 1\n"
    )
    late = "*NSET, NSET=L1\n1\n*NSET, NSET=L2\nL3\n*NSET, NSET=L3\n4\n*ELSET, ELSET=LATER\n2\n"
    raw = flat(tmp_path, PLATE + early + late)
    assert at(raw, "BOTH") == [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)]
    assert at(raw, "FROM") == [(1.0, 0.0), (1.0, 1.0), (2.0, 0.0), (2.0, 1.0)]
    assert raw.cell_groups["TWO"].tolist() == [0, 1]
    with pytest.raises(DeckError, match=r"line 33: \*NSET: there is no node set 'L3'"):
        read(tmp_path, PLATE + early + late.replace("*NSET, NSET=L3", "*NSET, NSET=L4") + STEP)
    # those of a part are made where it ends, so that its instances have them
    inside = PARTS.replace("*END PART", "*NSET, NSET=HERE\nTHERE\n*NSET, NSET=THERE\n1\n*END PART")
    raw = read(tmp_path, inside + "*STEP\n*STATIC\n*END STEP\n").raw
    assert any(name.endswith(".HERE") for name in raw.groups)


def test_a_surface_that_is_the_union_of_others(tmp_path):
    text = PLATE + "*SURFACE, NAME=WHOLE, COMBINE=UNION\nTOP, END\n*SURFACE, NAME=TOP\nPLATE, S3\n"
    raw = flat(tmp_path, text)
    assert len(raw.groups["WHOLE"].rows) == 3
    other = "*SURFACE, NAME={}, COMBINE={}\n{}\n"
    for more, words in (
        (
            other.format("OTHER", "UNION", "WHOLE") + other.format("WHOLE", "UNION", "OTHER"),
            "itself",
        ),
        (other.format("WHOLE", "INTERSECTION", "END, END"), "COMBINE=INTERSECTION"),
    ):
        bad = text + more
        with pytest.raises(DeckError, match=words):
            read(tmp_path, bad + STEP.replace("*END", "*DSLOAD\nWHOLE, P, 1.\n*END"))
