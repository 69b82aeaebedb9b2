"""``fxcrack run``, real decks of others, usual names of columns."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.deck.deck import check_deck
from fxcrack.output.usual_names import usual_name, with_usual_names
from tests.decks import PLATE, STEP, bonded, write
from tests.test_cli import run

REAL = os.environ.get("FXCRACK_DECKS")
"""Folder with sixteen decks of others, where a developer has them."""


@pytest.mark.mpi
@pytest.mark.three
def test_run_writes_history_report_fields_and_tips(shared_path, capfd):
    path = write(shared_path, bonded())
    assert run("run", str(path), "--out", str(shared_path / "out")) == 0
    out = capfd.readouterr().out
    if MPI.COMM_WORLD.rank == 0:
        assert "step 'step 1': time 1 reached" in out
        for name in ("report.txt", "history.csv", "history.json", "fields.pvd", "tips.txt",
                     "releases.csv"):  # fmt: skip
            assert (shared_path / "out" / name).is_file()
        assert "debond: slave 'TOP', master 'BOTTOM'" in (
            (shared_path / "out" / "report.txt").read_text()
        )
    MPI.COMM_WORLD.Barrier()


@pytest.mark.mpi
@pytest.mark.three
def test_check_lists_what_is_read_replaced_and_refused(shared_path, capfd):
    text = PLATE.replace("CPE4", "CPE4R") + "*HEADING\nx\n*CONTACT CONTROLS, STABILIZE\n" + STEP
    assert run("run", str(write(shared_path, text)), "--check") == 0
    out = capfd.readouterr().out
    bad = text + "*GAP\n1.\n*MEMBRANE SECTION, ELSET=PLATE, MATERIAL=STEEL\n1.\n*NONSENSE\n"
    assert run("run", str(write(shared_path, bad, "bad.inp")), "--check") == 1
    listed, err = capfd.readouterr()
    if MPI.COMM_WORLD.rank > 0:
        assert out == listed == err == ""
        return
    assert "6 nodes, 2 elements CPE4R" in out and "*HEADING (2 times)" in out
    assert "reduced integration is replaced" in out
    assert "*CONTACT CONTROLS: a control of the other program" in out
    assert "refused" not in out and out.count("reduced integration is replaced") == 1
    for words in ("*GAP is refused", "*MEMBRANE SECTION is refused", "*NONSENSE is not known"):
        assert words in listed
    assert "3 entries are refused" in err and "Traceback" not in err


@pytest.mark.mpi
def test_a_deck_that_is_refused_is_one_message_on_all_ranks(shared_path, capfd):
    path = write(shared_path, PLATE + "*GAP\n1.\n" + STEP)
    assert run("run", str(path)) == 1
    err = capfd.readouterr().err
    if MPI.COMM_WORLD.rank == 0:
        assert err.startswith("fxcrack: model.inp, line 26: *GAP is refused: gap elements")
    assert run("run", str(shared_path / "no.inp")) == 1
    if MPI.COMM_WORLD.rank == 0:
        assert "cannot read" in capfd.readouterr().err


def test_tips_are_written_in_the_numbers_of_the_deck(tmp_path):
    def tips(frequency, text):
        text = text.replace("MASTER=BOTTOM", f"MASTER=BOTTOM, FREQUENCY={frequency}")
        assert run("run", str(write(tmp_path, text)), "--out", str(tmp_path)) == 0
        return (tmp_path / "tips.txt").read_text().split("\nCRACK TIP LOCATION")

    start, *blocks = tips(1, bonded())
    assert "crack 1: slave 'TOP', master 'BOTTOM': 4 slave nodes bonded, 1 open; tips: 2" in start
    heads = blocks[0].split("\n")[2].split()
    assert heads == ["crack", "initial", "tip", "current", "tip", "crack", "length", "f", "ENRRT11",
                     "ENRRT12", "ENRRT13"]  # fmt: skip
    first, last = (b.split("\n")[3].split() for b in (blocks[0], blocks[-1]))
    assert first[:4] == ["1", "2", "2", "0"] and int(last[2]) > 2
    assert float(last[3]) == int(last[2]) - 2  # nodes 2, 3, ... lie one apart
    assert "step 'step 1', increment" in blocks[-1] and ", time 1\n" in blocks[-1]
    fewer = tips(3, bonded())[1:]
    assert len(fewer) == (len(blocks) + 2) // 3 and ", time 1\n" in fewer[-1]
    assert not tips(0, bonded())[1:]


def test_order_and_usual_names_from_the_command_line(tmp_path):
    path = write(tmp_path, bonded())
    words = ["--out", str(tmp_path), "--order", "2", "--usual-names"]
    assert run("run", str(path), *words) == 0
    with (tmp_path / "history.csv").open() as stream:
        columns = next(csv.reader(stream))
    for name in ("U2[11]", "RF2[11]", "ENRRT11[TOP]", "EFENRRTR[TOP]", "DBT[TOP]", "ALLSE"):
        assert name in columns
    assert "R[11.y]" not in columns


def test_usual_names(tmp_path):
    assert usual_name("R[a.b.z]") == "RF3[a.b]" and usual_name("GIII[x]") == "ENRRT13[x]"
    assert usual_name("external_work") == "ALLWK" and usual_name("a[bond]") == "a[bond]"
    deck = fx.read_deck(write(tmp_path, bonded()))
    history = deck.run()
    found = with_usual_names(history)
    last = found.rows[-1]
    assert last["ENRRT11[TOP]"] == history.rows[-1]["GI[TOP]"]
    released = [r["time"] for r in history if r["event"] == "release"]
    assert last["DBT[TOP]"] == released[-1] and found.rows[0]["DBT[TOP]"] != released[-1]


# -- decks of others -------------------------------------------------------------------------------

OTHERS = {
    "axi_instance": "",
    "beam_cps3": "line 983: *BOUNDARY: TYPE=FORCE is not available",
    "cpe8_one": "",
    "cps4r_parametric": "*USER MATERIAL is refused",
    "cube_mixed_case": "",
    "dcb3d_coh": "COH3D8 is refused: cohesive elements",
    "dcb3d_tie": None,
    "dcbenf_wedges": "C3D15 is refused: prisms",
    "distributing": "",
    "gaps_in_numbers": "",
    "hertz_cax4": "have a node more than once",
    "necking_cax4rt": "CAX4RT is refused: temperatures",
    "plastic_cpe4": "",
    "plate_s4r": "the positive sides of 2 pairs of neighbouring shell elements differ",
    "preform_shear": "*DAMAGE INITIATION is refused",
    "two_instances": "*PLASTIC: the parameter PROPERTIES is not available",
}
"""What becomes of each: it runs (""), part of a refusal, or it is only read (``None``)."""


@pytest.mark.skipif(REAL is None, reason="the decks of others are not part of this repository")
@pytest.mark.parametrize("name", sorted(OTHERS))
def test_decks_of_others_run_or_are_refused_by_name(name):
    assert REAL is not None
    path = Path(REAL) / f"{name}.inp"
    report = check_deck(path)
    words = OTHERS[name]
    if words:
        assert any(words in line for line in report.refused)
        return
    assert not report.refused
    if words is None:
        return
    deck = fx.read_deck(path)
    history = deck.run()
    assert "reached" in history.reason
    deck.scene.close()
