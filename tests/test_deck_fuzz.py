"""Cut, shuffled and mutated decks: an error that names the place, never a traceback."""

from __future__ import annotations

import tempfile
from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings

from fxcrack.deck.cards import DeckError
from fxcrack.deck.deck import translated
from tests.decks import BONDED, OPENED, PLATE, STEP, VCCT
from tests.test_deck_distributing import BLOCK
from tests.test_deck_explicit import DECK as EXPLICIT
from tests.test_deck_joined_pairs import two
from tests.test_deck_local_axes import ORTHOTROPIC
from tests.test_deck_mesh import GENERATED, PARTS
from tests.test_deck_rigid import BLOCK as RIGID
from tests.test_deck_rigid import CUBE, FACETS
from tests.test_deck_surface_shells import ARMS as SHELLS

BASE = [
    PLATE + STEP,
    BONDED + OPENED.format(criterion=VCCT),
    GENERATED + STEP,
    PARTS + "*STEP\n*STATIC\n*DSLOAD\nBar-1.End, P, 1.\n*END STEP\n",
    PLATE
    + "*PARAMETER\na = 2*3\n*AMPLITUDE, NAME=A\n0., 0., 1., <a>\n*NODE, NSET=REF\n99, 2., 0.5\n"
    "*COUPLING, CONSTRAINT NAME=C, REF NODE=REF, SURFACE=END\n*KINEMATIC\n1, 2\n"
    "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 20.\n*STEP, NLGEOM\n*STATIC\n0.1, 1.\n"
    "*BOUNDARY, AMPLITUDE=A\nLEFT, 1, 2\n*BOUNDARY\nREF, 1, 6, 0.1\n*CLOAD\n6, 2, 1.\n"
    "*DLOAD\nLAST, P3, 1.\n*TEMPERATURE\nALL, 30.\n*END STEP\n",
    EXPLICIT,
    SHELLS,
    two(),
    RIGID,
    CUBE.format(surface=FACETS, body="ELSET=R"),
    ORTHOTROPIC
    + "*DISTRIBUTION, NAME=D, LOCATION=ELEMENT\n, 1., 0., 0., 0., 1., 0.\nLAST, 0., 1., 0., -1.,"
    "0., 0.\n*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n0.5, 0., 0., 0.5, 0., 1.\n3, 90.\n"
    "*TRANSFORM, NSET=LEFT, TYPE=C\n-1., 0., 0., -1., 0., 1.\n*SYSTEM\n1., 2., 0., 1., 3., 0.\n"
    "*NODE\n77, 1., 1.\n*DENSITY\n1.\n*STEP\n*STATIC\n*BOUNDARY\nLEFT, 2\n*CLOAD\nLEFT, 1, 1.\n"
    "*DLOAD\nPLATE, CENTRIF, 1., 0., 0., 0., 0., 1., 0.\n*END STEP\n",
    BLOCK.format(nlgeom="", load="*CLOAD\nREF, 3, 1.\nREF, 4, 1."),
]
WORDS = st.sampled_from(
    [
        *("", ",", "*", "**", "=", '"', "0", "-1", "1e400", "nan", "1D5", "99999999999999999999"),
        *("A", "LEFT", "S1", "<a>", "<b>", "*NODE", "*STEP", "*END STEP", "GENERATE", "\t", "\x00"),
        *("TYPE=", "TYPE=CPE8", "NSET=LEFT", "NAME=", "INPUT=model.inp", "é", "1.5.5", "+", "/"),
        *("D", "O", "SYSTEM=SPHERICAL", "DEFINITION=NODES", "TYPE=R3D4"),
        *("TYPE=REVOLUTION", "CIRCL", "LINE", "ALL, 1, 1"),
        *("*ELGEN", "*NFILL", "*NCOPY, SHIFT", "*INCLUDE, INPUT=model.inp", "*EQUATION", "3"),
    ]
)


def check(text: str) -> None:
    """The deck is read, or refused by a DeckError."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.inp"
        path.write_text(text, encoding="utf-8")
        try:
            translated(path)
        except DeckError as error:
            assert str(error).strip()


FUZZ = settings(max_examples=120, suppress_health_check=list(HealthCheck))


@FUZZ
@given(st.sampled_from(BASE), st.integers(0, 10_000))
def test_decks_that_are_cut_off(text, end):
    check(text[: end % (len(text) + 1)])


@pytest.mark.slow
@FUZZ
@given(st.sampled_from(BASE), st.data())
def test_decks_whose_lines_are_lost_repeated_or_exchanged(text, data):
    lines = text.split("\n")
    for _ in range(data.draw(st.integers(1, 3))):
        i, j = (data.draw(st.integers(0, len(lines) - 1)) for _ in range(2))
        what = data.draw(st.sampled_from(["lose", "repeat", "exchange"]))
        if what == "lose" and len(lines) > 2:
            del lines[i]
        elif what == "repeat":
            lines.insert(j, lines[i])
        else:
            lines[i], lines[j] = lines[j], lines[i]
    check("\n".join(lines))


@pytest.mark.slow
@FUZZ
@given(st.sampled_from(BASE), st.data())
def test_decks_with_other_words(text, data):
    lines = text.split("\n")
    for _ in range(data.draw(st.integers(1, 3))):
        i = data.draw(st.integers(0, len(lines) - 1))
        parts = lines[i].split(",")
        k = data.draw(st.integers(0, len(parts) - 1))
        what = data.draw(st.sampled_from(["replace", "insert", "remove", "join"]))
        word = data.draw(WORDS)
        if what == "replace":
            parts[k] = word
        elif what == "insert":
            parts.insert(k, word)
        elif what == "remove":
            del parts[k]
        else:
            parts[k] += word
        lines[i] = ",".join(parts)
    check("\n".join(lines))


@FUZZ
@given(st.lists(st.sampled_from([line for text in BASE for line in text.split("\n")]), max_size=40))
def test_decks_of_lines_at_random(lines):
    check("\n".join(lines))


@pytest.mark.slow
@settings(max_examples=60)
@given(st.text(max_size=60))
def test_texts_that_are_no_decks(text):
    check(text)


@pytest.mark.parametrize("text", BASE)
def test_the_decks_themselves_are_read(text, tmp_path):
    path = tmp_path / "model.inp"
    path.write_text(text)
    translated(path)
