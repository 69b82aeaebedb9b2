"""Typical decks of fracture specimens, each beside the same scene written in Python.

The decks are written in the manners of different authors: flat and by parts, generated and listed,
in capitals and small letters, with continuation lines, tabs, comments and Fortran numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import fxcrack as fx
from tests.decks import read, write

ARMS = """*heading
 arms of 60 x 2, nodes of the faces 1 to 31 and 1101 to 1131
** -------------------------------------------------------------
*node
  1,\t0.,\t0.
 31, 6.0D1, 0.
 101, 0., 2.
 131, 60., 2.
 1001, 0., -2.
 1031, 60., -2.
 1101, 0., 0.
 1131, 60., 0.
*ngen, nset = uface
1, 31, 1
*ngen, nset =utop
101, 131
** the lower arm
*ngen, nset=lbot
1001, 1031
*ngen, nset=lface
1101, 1131
*Element, Type=CPE4I
1, 1, 2, 102, 101
1001, 1001, 1002, 1102, 1101
*Elgen, elset=upper
1, 30, 1, 1
*Elgen, elset="lower"
1001, 30, 1, 1,
*nset, nset=bond, gen
11, 31
*surface, type = element, name="Slave Face"
upper, S1
*surface, name=master_face
lower, s3
*solid section, elset=upper, material = steel
 10.,
*solid section, elset=lower,
 material=steel
 10.,
*material, name=steel
*elastic, type = iso
 2.1E+5, .3
*surface interaction, name=int-1
 10.
"""
PAIR = """*contact pair, interaction=int-1, small sliding, type=surface to surface, adjust = 0.0
"Slave Face", master_face
*initial conditions, type =CONTACT
"Slave Face", master_face, bond
"""
STEP = """*step, inc=500
*static
0.05, 1.0, 1.0E-6, 0.05
*boundary, op=mod
{moves}
*debond, {names}{words}
{amplitude}*fracture criterion, {criterion}
*contact output, slave="Slave Face"
dbt, dbsf, bdstat, enrrt
*end step
"""
SIDES = 'slave="Slave Face", master=master_face, frequency=1'
OPEN = "101, 1, 1\n101, 2, 2, 1.5\n1001, 1, 1\n1001, 2, 2, -1.5"
BEND = "1001, 1, 2\n1031, 2\n116, 2, 2, -2.0"
OPENED = [fx.Displacement("101", x=0.0, y=1.5), fx.Displacement("1001", x=0.0, y=-1.5)]
BENT = [
    fx.Displacement("1001", x=0.0, y=0.0),
    fx.Displacement("1031", y=0.0),
    fx.Displacement("116", y=-2.0),
]
CYCLE = fx.Amplitude((0.0, 0.5, 1.0), (0.1, 1.0, 0.1))


@dataclass
class Case:
    """A deck and its scene.

    Attributes:
        criterion: Rest of the card and its data lines.
        expected: The criterion in Python.
        moves: Lines of the boundary conditions.
        supports: The same in Python.
        words: Further parameters of the debond card.
        amplitude: Its data lines.
        release: The release law in Python.
        interface: Further arguments of the interface.
        replaced: Parts of the deck that are other, old and new.
    """

    criterion: str
    expected: Any
    moves: str = OPEN
    supports: list[fx.Displacement] = field(default_factory=lambda: OPENED)
    words: str = ""
    amplitude: str = ""
    release: Any = None
    interface: dict[str, Any] = field(default_factory=dict)
    replaced: tuple[tuple[str, str], ...] = ()

    def text(self) -> str:
        """The deck."""
        step = STEP.format(
            moves=self.moves, names=SIDES, words=self.words, amplitude=self.amplitude,
            criterion=self.criterion,
        )  # fmt: skip
        text = ARMS + PAIR + step
        for old, new in self.replaced:
            assert old in text
            text = text.replace(old, new)
        return text


FATIGUE = (
    ("*static\n0.05, 1.0, 1.0E-6, 0.05", "*direct cyclic, fatigue\n0.1, 1.,,,\n,, 4.E6"),
    ("*boundary, op=mod", "*boundary, op=mod, amplitude=saw"),
    ("*step, inc=500", "*amplitude, name=saw\n0., .1, .5, 1., 1., .1\n*step, inc=500"),
)
CASES = {
    "dcb": Case(
        "type=vcct, mixed mode behavior=bk, tolerance=.1\n0.5, 1.2, 1.2, 1.75",
        fx.VCCT(0.5, 1.2, mix=fx.BK(1.75), tolerance=0.1),
    ),
    "enf with friction": Case(
        "type = VCCT, mixed mode behavior=POWER, unstable growth tolerance\n.3, .3, .3, 1., 1., 1.",
        fx.VCCT(0.3, 0.3, 0.3, mix=fx.Power(1.0, 1.0, 1.0), unstable_tolerance=np.inf),
        BEND,
        BENT,
        interface={"friction": 0.2},
        replaced=(("name=int-1\n 10.", "name=int-1\n 10.\n*friction\n 0.2,"),),
    ),
    "mmb, ramp": Case(
        "type=VCCT, tolerance=0.5\n0.3, 0.9, 0.9, 2.",
        fx.VCCT(0.3, 0.9, mix=fx.BK(2.0), tolerance=0.5),
        BEND.replace("-2.0", "-1.0") + "\n101, 2, 2, 1.0",
        [*BENT[:2], fx.Displacement("116", y=-1.0), fx.Displacement("101", y=1.0)],
        words=", debonding force=RAMP",
        release=fx.RampRelease(),
    ),
    "slb": Case(
        "mixed mode behavior=reeder, type=vcct, unstable growth tolerance=2.\n.2, .6, .8, 2.",
        fx.VCCT(0.2, 0.6, 0.8, mix=fx.Reeder(2.0), unstable_tolerance=2.0),
        "1, 2\n1031, 1, 2\n116, 2, 2, -2.",
        [
            fx.Displacement("1", y=0.0),
            fx.Displacement("1031", x=0.0, y=0.0),
            fx.Displacement("116", y=-2.0),
        ],
    ),
    "dcb, onset and propagation": Case(
        "type=ENHANCED VCCT, tolerance=0.3\n0.5, 1., 1., 0.4, 0.9, 0.9, 2.",
        fx.EnhancedVCCT(GIc=0.5, GIIc=1.0, GIc_p=0.4, GIIc_p=0.9, mix=fx.BK(2.0), tolerance=0.3),
    ),
    "dcb, fatigue": Case(
        "type=fatigue\n10., -1., 1.D-3, 2., .01, .95, 2., 2.\n2., 1.",
        fx.Fatigue(2.0, 2.0, mix=fx.BK(1.0), paris=fx.Paris(10.0, -1.0, 1e-3, 2.0, 0.01, 0.95)),
        supports=[
            fx.Displacement("101", x=0.0, y=1.5, amplitude=CYCLE),
            fx.Displacement("1001", x=0.0, y=-1.5, amplitude=CYCLE),
        ],
        replaced=FATIGUE,
    ),
    "dcb, opening of half a specimen": Case(
        "type=COD, distance=2., symmetry\n0.10, 0.\n0.14, 10.",
        fx.CrackOpening(((0.0, 10.0), (0.10, 0.14)), distance=2.0, symmetry=True),
        OPEN + "\n131, 2\n1031, 2",  # faces that slide would let both arms turn
        [*OPENED, fx.Displacement("131", y=0.0), fx.Displacement("1031", y=0.0)],
        interface={"normal_only": True},
        replaced=(("type =CONTACT", "type =CONTACT, normal"),),
    ),
    "dcb, critical stress": Case(
        "type=critical stress, distance=1.\n60., 0., 0.",
        fx.CriticalStress(60.0, distance=1.0),
        words=", time increment=0.01",
        amplitude="0., 1., 0.02, 0.75, 0.04, 0.\n",
        release=fx.AmplitudeRelease((0.0, 0.02, 0.04), (1.0, 0.75, 0.0), 0.01),
    ),
    "dcb, crack length": Case(
        "type=crack length, nset=start\n0., 19., 1., 31.",
        fx.CrackLengthVsTime((0.0, 1.0), (19.0, 31.0), reference="start"),
        replaced=(("*surface, name=m", "*nset,nset=start\n1, 1101\n*surface, name=m"),),
    ),
    "dcb, graded toughness": Case(
        "type=VCCT, nodal energy rate\n0., 0., 0., 2.",
        fx.VCCT(lambda x: 0.2 + 0.01 * x[0], lambda x: 0.4 + 0.02 * x[0], mix=fx.BK(2.0)),
        replaced=(
            ("*contact pair", "*nodal energy rate\n1, .2, .4, .4\n31, .8, 1.6, 1.6\n"
             "*nodal energy rate, generate\n1, 31, 30, 1\n*contact pair"),
        ),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_specimen_and_its_scene_in_python(tmp_path, name):
    case = CASES[name]
    deck = fx.read_deck(write(tmp_path, case.text()), order=1)
    bond = fx.Interface(
        "Slave Face", "master_face", bonded=lambda x: x[0] > 19.0, contact=True, name="Slave Face",
        **case.interface,
    )  # fmt: skip
    options = {} if case.release is None else {"release": case.release}
    by_hand = fx.Scene(
        deck.scene.mesh,
        materials=fx.Isotropic(2.1e5, 0.3),
        model=fx.PlaneStrain(10.0),
        supports=case.supports,
        debonds=[fx.Debond(bond, case.expected, **options)],
    )
    if "fatigue" in name:
        step: Any = fx.Cycles(period=(0.0, 1.0), n_max=4e6)
    else:
        step = fx.Static(
            until=fx.Time(1.0), stepping="increment", initial=0.05, minimum=1e-6, maximum=0.05,
            max_increments=500,
        )  # fmt: skip
    wanted, found = by_hand.run(step), deck.run()
    assert found.rows[-1]["released[Slave Face]"] > 0
    same(found, wanted)


def same(found: fx.History, wanted: fx.History) -> None:
    """Columns that do not hang on names of groups are equal."""
    assert list(found["event"]) == list(wanted["event"])
    names = [c for c in wanted.columns if c in found.columns and c not in ("event", "time")]
    assert any(c.startswith("R[") for c in names) and "strain_energy" in names
    for column in ["time", *names]:
        a, b = found[column].astype(float), wanted[column].astype(float)
        # of a mode that is not there, and of the balance, round-off alone is left
        kind = "R[" if column.startswith("R[") else column[:1] if column[0] == "G" else column
        size = max(
            np.nanmax(np.abs(wanted[c].astype(float)), initial=0.0)
            for c in wanted.columns if c.startswith(kind)
        )  # fmt: skip
        assert a == pytest.approx(b, rel=1e-8, abs=1e-8 * max(size, 1.0), nan_ok=True), column


PARTS = """*Heading
** Job name: dcb-3d Model name: Model-1
*Preprint, echo=NO, model=NO, history=NO, contact=NO
*Part, name=Arm
*Node
      1,           0.,           0.,           0.
     13,          24.,           0.,           0.
    101,           0.,           4.,           0.
    113,          24.,           4.,           0.
*Ngen, nset=A
1, 13
*Ngen, nset=B
101, 113
*Nset, nset=low
A, B
*Ncopy, old set=low, change number=1000, new set=high, shift
0., 0., 1.
0., 0., 0., 0., 0., 1., 0.
*Element, type=C3D8I
1, 1, 2, 102, 101, 1001, 1002, 1102, 1101
*Elgen, elset=All
1, 12, 1, 1
*Nset, nset=Tip
 1001, 1101
*Nset, nset=bonded, generate
   6,  13,   1
 106, 113,   1
*Nset, nset=ends
 13, 113, 1013, 1113
*Elset, elset=_Face_S1, internal, generate
  1,  12,   1
*Surface, type=ELEMENT, name=Face
_Face_S1, S1
*Solid Section, elset=All, material=Steel
,
*End Part
**
*Assembly, name=Assembly
*Instance, name=Upper, part=Arm
*End Instance
*Instance, name=Lower, part=Arm
          0.,           4.,           0.
          0.,           4.,           0.,           1.,           4.,           0.,   180.
*End Instance
*Nset, nset=held
Upper.ends, Lower.ends
*End Assembly
*Material, name=Steel
*Elastic
210000., 0.3
*Surface Interaction, name=IntProp-1
1.,
*Surface Behavior, pressure-overclosure=HARD
*Contact Pair, interaction=IntProp-1, small sliding
Upper.Face, Lower.Face
*Initial Conditions, type=CONTACT
Upper.Face, Lower.Face, Upper.bonded
*Boundary
held, PINNED
** ----------------------------------------------------------------
*Step, name=Preload, nlgeom=NO
*Static
0.5, 1., 1e-05, 1.
*Boundary
Upper.Tip, 3, 3, 0.1
Lower.Tip, 3, 3, -0.1
*End Step
*Step, name=Grow, nlgeom=NO, inc=1000
*Static
0.1, 1., 1e-05, 0.1
*Boundary
Upper.Tip, 3, 3, 1.
Lower.Tip, 3, 3, -1.
*Debond, secondary=Upper.Face, main=Lower.Face
*Fracture Criterion, type=VCCT, mixed mode behavior=BK,
 unstable growth tolerance
0.5, 1.5, 1.5, 2.
*Controls, type=VCCT LINEAR SCALING
0.9,
*Output, history
*Node Output, nset=Upper.Tip
RF3, U3
*End Step
"""


def test_solid_arms_by_parts_in_two_steps(tmp_path):
    deck = fx.read_deck(write(tmp_path, PARTS), order=1)
    assert deck.steps[0].grow == () and deck.steps[1].grow == ("Upper.Face",)
    moves = fx.Amplitude((0.0, 1.0, 2.0), (0.0, 0.1, 1.0))
    bond = fx.Interface(
        "Upper.Face", "Lower.Face", bonded=lambda x: x[0] > 9.0, contact=True, gap="keep",
        name="Upper.Face",
    )  # fmt: skip
    criterion = fx.VCCT(0.5, 1.5, mix=fx.BK(2.0), unstable_tolerance=np.inf)
    debond = fx.Debond(bond, criterion, fx.StepRelease())  # that of the deck
    by_hand = fx.Scene(
        deck.scene.mesh,
        materials=fx.Isotropic(210e3, 0.3),
        model=fx.Solid(),
        supports=[
            fx.Displacement("held", x=0.0, y=0.0, z=0.0),
            fx.Displacement("Upper.Tip", z=1.0, amplitude=moves),
            fx.Displacement("Lower.Tip", z=-1.0, amplitude=moves),
        ],
        debonds=[debond],
    )
    for deck_step, grow in zip(deck.steps, ([], [debond]), strict=True):
        by_hand.run(deck_step.step, grow=grow)
    found = deck.run()
    assert found.rows[-1]["released[Upper.Face]"] > 0
    same(found, by_hand.history)


def test_fronts_in_3d_under_fatigue_keep_their_elements(tmp_path):
    """Nodes go one after the other in a deck; of second order they are more, and slower."""
    assert read(tmp_path, PARTS).raw.order == 2
    law = "*Fracture Criterion, type=FATIGUE\n0., -2., 1e-3, 3., 0.01, 0.85, 0.5, 0.5\n0.5, 1."
    text = PARTS[: PARTS.index("*Fracture Criterion")] + law + "\n*End Step\n"
    text = text.replace("*Static\n0.1, 1., 1e-05, 0.1", "*Direct cyclic, fatigue\n0.1, 1.")
    found = read(tmp_path, text)
    assert found.raw.order == 1
    (said,) = (line for line in found.report.replaced if "lock" in line)
    assert "mesh the thickness with more elements" in said and "many times as many cycles" in said
