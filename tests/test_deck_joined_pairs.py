"""Contact pairs of a deck whose slave surfaces continue each other and share a node."""

from __future__ import annotations

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.deck.cards import DeckError
from tests.decks import BONDED, OPENED, VCCT, bonded, read, write

SPLIT = (
    BONDED.replace(
        "*SURFACE, NAME=TOP\nUPPER, S1\n",
        "*SURFACE, NAME=WEST\n1, S1\n2, S1\n*SURFACE, NAME=EAST\n3, S1\n4, S1\n",
    )
    .replace("INTERACTION=I\nTOP, BOTTOM", "INTERACTION=I\nWEST, BOTTOM\nEAST, BOTTOM")
    .replace("CONTACT\nTOP, BOTTOM, BOND", "CONTACT\nWEST, BOTTOM, BOND\nEAST, BOTTOM, BOND")
)
LAW = "*FRACTURE CRITERION, TYPE=VCCT, UNSTABLE GROWTH TOLERANCE\n{}, {}, {}, 2.0"


def two(west=(0.05, 0.1), east=(0.2, 0.4), law=LAW):
    step = OPENED.replace("SLAVE=TOP", "SLAVE=WEST").format(criterion=law.format(*west, west[1]))
    more = f"*DEBOND, SLAVE=EAST, MASTER=BOTTOM\n{LAW.format(*east, east[1])}\n*END STEP"
    return SPLIT + step.replace("*END STEP", more)


def compare(found, wanted, ours="WEST + EAST"):
    assert len(found) == len(wanted)
    for column in ("R[11.y]", "a[TOP]", "GI[TOP]", "strain_energy", "released_energy"):
        mine = found[column.replace("TOP", ours)].astype(float)
        other = wanted[column].astype(float)
        # one scene in two numberings: round-off times the condition number
        assert mine == pytest.approx(other, rel=1e-9, abs=1e-9 * np.nanmax(np.abs(other)))


@pytest.mark.mpi
@pytest.mark.three
def test_a_crack_passes_from_one_pair_to_the_next(shared_path):
    """As in one pair with critical rates at the nodes; the common node has those ahead of it."""
    rates = "*NODAL ENERGY RATE\n1, 0.05, 0.1, 0.1\n2, 0.05, 0.1, 0.1\n" + "".join(
        f"{node}, 0.2, 0.4, 0.4\n" for node in (3, 4, 5)
    )
    law = LAW.format(0, 0, 0).replace("VCCT,", "VCCT, NODAL ENERGY RATE,")
    whole = fx.read_deck(write(shared_path, bonded(law, model=BONDED + rates), "one.inp"))
    pairs = fx.read_deck(write(shared_path, two(), "two.inp"))
    assert "'WEST' and 'EAST' continue each other" in str(pairs.report)
    compare(pairs.run(), whole.run())
    assert pairs.scene.history.rows[-1]["released[WEST + EAST]"] > 2  # beyond the common node
    for deck in (whole, pairs):
        deck.scene.close()


def test_an_open_pair_beside_a_bonded_one(tmp_path):
    """The open part of a crack as a pair of its own: the criterion is that of the bonded part."""
    text = SPLIT.replace("WEST, BOTTOM, BOND\n", "")
    step = OPENED.replace("SLAVE=TOP", "SLAVE=EAST").format(criterion=VCCT)
    found = read(tmp_path, text + step)
    (debond,) = found.arguments["debonds"]
    assert debond.interface.title == "WEST + EAST" and debond.criterion.GIc == 0.5
    assert [n for n in found.nodes["WEST + EAST"].names] == ["1", "2", "3", "4", "5"]
    assert len(found.raw.groups[debond.interface.bonded].rows) == 3


def test_equal_criteria_stay_numbers(tmp_path):
    (debond,) = read(tmp_path, two(east=(0.05, 0.1))).arguments["debonds"]
    assert debond.criterion.GIc == 0.05


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda t: t.replace(", 2.0\n*DEBOND, SLAVE=EAST", ", 1.5\n*DEBOND, SLAVE=EAST"),
         "differs in more than its critical"),
        (lambda t: t.replace("SLAVE=EAST, MASTER=BOTTOM\n*F",
                             "SLAVE=EAST, MASTER=BOTTOM, DEBONDING FORCE=RAMP\n*F"),
         "falls in another way"),
        (lambda t: t[: t.index("*DEBOND, SLAVE=EAST")] + "*END STEP\n", "in other steps"),
        (lambda t: t.replace("\nEAST, BOTTOM\n*SURF",
                             "\n*CONTACT PAIR, INTERACTION=I\nEAST, BOTTOM\n*SURF"),
         "the same parameters"),
    ],
)  # fmt: skip
def test_pairs_that_cannot_be_one(tmp_path, change, words):
    assert change(two()) != two()
    with pytest.raises(DeckError, match=words):
        read(tmp_path, change(two()))


def test_surfaces_at_an_angle_stay_two(tmp_path):
    """The second slave surface goes round the corner: it is no continuation."""
    text = SPLIT.replace("NAME=EAST\n3, S1\n4, S1", "NAME=EAST\n1, S4")
    text = text.replace("EAST, BOTTOM\n*SURF", "EAST, SIDE\n*SURF").replace(
        "EAST, BOTTOM, BOND\n", ""
    )
    text = text.replace("*NSET, NSET=BOND", "*SURFACE, NAME=SIDE\n14, S2\n*NSET, NSET=BOND")
    step = OPENED.replace("SLAVE=TOP", "SLAVE=WEST").format(criterion=VCCT)
    titles = {d.interface.title for d in read(tmp_path, text + step).arguments["debonds"]}
    assert titles == {"WEST"}
