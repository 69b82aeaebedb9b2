"""From the text of a deck to its cards: every trap that real decks hold."""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
import pytest

from fxcrack.deck.cards import DeckError, fields_of, to_float
from fxcrack.deck.model import read_model
from fxcrack.deck.parameters import evaluate_parameters
from fxcrack.deck.reader import read_cards
from fxcrack.deck.report import Report
from fxcrack.deck.translate import translate
from tests.decks import PLATE, STEP, read


def cards(folder: Path, text: str, **others: str):
    for name, content in others.items():
        (folder / name.replace("_", ".")).write_text(content)
    path = folder / "model.inp"
    path.write_bytes(text.encode("latin-1"))
    return read_cards(path)


def test_keyword_parameters_and_places(tmp_path):
    found = cards(tmp_path, '*Solid Section , elset = A b,\n material="Steel 1"\n1.\n')
    (card,) = found
    assert card.keyword == "SOLIDSECTION" and card.title == "*SOLID SECTION"
    assert card.text("ELSET") == "A b" and card.text("MATERIAL") == "Steel 1"
    assert (card.place, card.place_of(0)) == ("model.inp, line 1", "model.inp, line 3")


@pytest.mark.parametrize(
    "text",
    [
        "*INITIAL CONDITIONS, TYPE =CONTACT",  # blanks around the equals sign
        "*INITIAL CONDITIONS,TYPE= CONTACT ,",  # a stray comma at the end
        "   *Initial Conditions,\ttype=contact",  # not in column 1, a tab
        "*INITIALCONDITIONS, TYPE=CONTACT",  # no blank in the keyword
        "*INITIAL CONDITIONS,\nTYPE=CONTACT",  # a continuation
        "*INITIAL CONDITIONS,\n** a comment\n TYPE=CONTACT",
    ],
)
def test_spellings_of_a_keyword_line(tmp_path, text):
    card = cards(tmp_path, text + "\nA, B, C\n")[0]
    assert card.keyword == "INITIALCONDITIONS" and card.word("TYPE") == "CONTACT"
    assert card.rows()[0].fields == ["A", "B", "C"]


def test_words_without_blanks_end_and_print(tmp_path):
    found = cards(tmp_path, "*STEP\n*STATIC\n*ELPRINT\nS\n*ENDSTEP\n")
    assert [c.keyword for c in found] == ["STEP", "STATIC", "ELPRINT", "ENDSTEP"]


def test_a_stray_comma_before_data_is_no_continuation(tmp_path):
    numbers, names = cards(tmp_path, "*NODE, NSET=A,\n1, 0., 0.\n*NSET, NSET=B,\nA, C\n")
    assert len(numbers.lines) == 1 and numbers.text("NSET") == "A"
    assert names.rows()[0].fields == ["A", "C"] and set(names.options) == {"NSET"}


def test_abbreviated_parameters(tmp_path):
    found = cards(
        tmp_path,
        "*NSET, NSET=A, GEN\n1, 3\n*SOLID SECTION, ELSET=E, MAT=M\n*BOUNDARY, AMP=R\nA, 1\n"
        "*DEBOND, SLAVE=A, MASTER=B, FREQ=10\n",
    )
    assert found[0].has("GENERATE") and found[1].text("MATERIAL") == "M"
    assert found[2].text("AMPLITUDE") == "R" and found[3].text("FREQUENCY") == "10"


def test_an_abbreviation_that_fits_two_parameters_is_refused(tmp_path):
    with pytest.raises(DeckError, match="the parameter SEARCH is not available"):
        read(tmp_path, PLATE + "*CONTACT CLEARANCE, NAME=A, SEARCH=1\n" + STEP)


def test_fortran_numbers_tabs_quotes_and_letters_of_other_alphabets(tmp_path):
    assert to_float("1.5D-3") == 1.5e-3 and to_float(" 2d2") == 200.0
    assert to_float("1.5-3") == 1.5e-3 and to_float("x") is None
    card = cards(tmp_path, "*NODE\n1,\t1.D0,\t2.5d-1\t,\n2, 3., 4.\n** M\xfcller\n")[0]
    assert np.array_equal(card.table(), [[1.0, 1.0, 0.25], [2.0, 3.0, 4.0]])
    assert fields_of('"TOP, LEFT", 3,') == ['"TOP, LEFT"', "3"]
    assert fields_of(",,,5") == ["", "", "", "5"]


def test_rows_of_unequal_length_and_empty_fields(tmp_path):
    card = cards(tmp_path, "*NODE\n1, 2.\n2, , 3.\n")[0]
    table = card.table()
    assert table[0, 1] == 2.0 and math.isnan(table[0, 2]) and math.isnan(table[1, 1])


def test_a_number_that_is_none_names_its_line(tmp_path):
    card = cards(tmp_path, "*NODE\n** c\n1, 0., 0.\n2, 0., O.5\n")[0]
    with pytest.raises(DeckError, match=r"model.inp, line 4: \*NODE: field 3, 'O.5'"):
        card.table()


def test_comments_and_blank_lines_among_data(tmp_path):
    card = cards(tmp_path, "*NODE\n\n1, 0.\n  ** a comment\n\n2, 1.\n***\n3, 2.\n")[0]
    assert card.table()[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert card.place_of(2).endswith("line 8")


def test_line_ends_and_byte_order_mark(tmp_path):
    (tmp_path / "model.inp").write_bytes(b"\xef\xbb\xbf*NODE\r\n1, 0.\r\n2, 1.\r\n")
    (card,) = read_cards(tmp_path / "model.inp")
    assert card.table().shape == (2, 2)


# -- files -----------------------------------------------------------------------------------------


def test_include_that_differs_in_case_and_continues_the_data_before(tmp_path):
    found = cards(
        tmp_path,
        "*NODE\n1, 0.\n*INCLUDE, INPUT=Nodes.INP\n3, 2.\n*STEP\n",
        nodes_inp="2, 1.\n*NSET, NSET=A\n1\n",
    )
    assert [c.keyword for c in found] == ["NODE", "NSET", "STEP"]
    assert found[0].table()[:, 0].tolist() == [1.0, 2.0]
    assert found[0].place_of(1) == "nodes.inp, line 1"
    assert found[1].lines == ["1", "3, 2."]


def test_input_of_a_card(tmp_path):
    (card,) = cards(tmp_path, "*NODE, INPUT=n.txt\n", n_txt="** c\n1, 0.\n2, 1.\n")
    assert card.table().shape == (2, 2) and card.place_of(0) == "n.txt, line 2"


@pytest.mark.parametrize(
    "text, words",
    [
        ("*INCLUDE, INPUT=no.inp\n", "there is no file 'no.inp'"),
        ("*INCLUDE, INPUT=model.inp\n", "includes itself"),
        ("*INCLUDE, INPUT=a.inp, PASSWORD=x\n", "encrypted"),
        ("*INCLUDE\n", "INPUT is missing"),
        ("1, 2\n*NODE\n", "stands before the first keyword"),
        ("** nothing\n", "holds no keyword"),
        ("*NODE\n\0\n", "not a text file"),
    ],
)
def test_files_that_cannot_be_read(tmp_path, text, words):
    with pytest.raises(DeckError, match=words):
        cards(tmp_path, text)


# -- parameters ------------------------------------------------------------------------------------


def test_parameters_numbers_texts_and_order(tmp_path):
    found = cards(
        tmp_path,
        "*SOLID SECTION, ELSET=<set>, MATERIAL=M\n<t>\n*PARAMETER\n"
        "************\nt = 2*w + sqrt(4.)  # thickness\nw = 1.5\nset = 'PLATE'\n** end\n"
        "*NODE\n< n >, <T>\n*PARAMETER\nn = int(7.0)\n",
    )
    section, node = found
    assert section.text("ELSET") == "PLATE" and section.rows()[0].number(0) == 5.0
    assert node.table().tolist() == [[7.0, 5.0]]


@pytest.mark.parametrize(
    "line, words",
    [
        ("a = b", "b is not defined anywhere"),
        ("a", "is no definition"),
        ("a = 1/0", "division by zero"),
        ("a = __import__('os')", "there is no function"),
        ("a = ().__class__", "only numbers"),
        ("a = 'x'*9", "cannot be multiplied"),
        ("a = 9**9**9**9", "(too large|out of range)"),
        ("a = 2.0**10000", "(too large|out of range)"),
        ("a = (1", "no arithmetic expression"),
        ("a = 1e999", "not a finite number"),
    ],
)
def test_parameters_that_cannot_be_evaluated(tmp_path, line, words):
    with pytest.raises(DeckError, match=words) as caught:
        cards(tmp_path, f"*PARAMETER\n{line}\n*NODE\n1, 0.\n")
    assert "model.inp, line 2" in str(caught.value)


def test_a_parameter_that_is_not_there(tmp_path):
    with pytest.raises(DeckError, match=r"model.inp, line 2: \*NODE: <w> is not a parameter"):
        cards(tmp_path, "*NODE\n1, <w>\n")
    assert evaluate_parameters([]) == {}


# -- speed -----------------------------------------------------------------------------------------


def test_large_blocks_are_read_by_numpy(tmp_path):
    n = 100_000
    lines = [f"{i}, {0.5 * i}, {0.25 * i}, 1." for i in range(1, n + 1)]
    start = time.process_time()
    card = cards(tmp_path, "*NODE\n" + "\n".join(lines) + "\n")[0]
    table = card.table()
    taken = time.process_time() - start
    assert table.shape == (n, 4) and table[-1, 1] == 0.5 * n
    assert taken < 5.0  # 0.15 s when alone; line by line it would be 100 times as much


@pytest.mark.slow
def test_a_quarter_of_a_million_nodes_are_read_in_two_and_a_half_seconds(tmp_path):
    n = 500
    i = np.arange(n * n)
    x, y = i % n, i // n
    e = np.arange((n - 1) ** 2)
    first = (e // (n - 1)) * n + e % (n - 1) + 1
    corners = np.stack([first, first + 1, first + n + 1, first + n], axis=1)
    with (tmp_path / "model.inp").open("w") as file:
        file.write("*NODE, NSET=ALL\n")
        file.write("\n".join(f"{a + 1}, {b}., {c}." for a, b, c in zip(i, x, y, strict=True)))
        file.write("\n*ELEMENT, TYPE=CPE4, ELSET=PLATE\n")
        rows = zip(e.tolist(), corners.tolist(), strict=True)
        file.write("\n".join(f"{a + 1}, {b}, {c}, {d}, {f}" for a, (b, c, d, f) in rows))
        file.write(f"\n*NSET, NSET=LEFT, GENERATE\n1, {n * n}, {n}\n*NSET, NSET=RIGHT\n{n}\n")
        file.write(PLATE[PLATE.index("*SOLID") :] + STEP)
    start = time.process_time()
    cards = read_cards(tmp_path / "model.inp")
    model = read_model(cards, Report("model.inp"))
    read_in = time.process_time() - start
    assert len(model.root.nodes.labels) == n * n
    found = translate(model, Report("model.inp"))
    assert found.raw.points.shape == (n * n, 2) and found.raw.cells.shape == ((n - 1) ** 2, 4)
    # the required 10 s for the text of a million (3 s when alone); with the mesh as well
    assert read_in < 2.5 and time.process_time() - start < 5.0
