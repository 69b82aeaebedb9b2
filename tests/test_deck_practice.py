"""Decks as they are written in practice: by hand with generators, and by a modelling program."""

from __future__ import annotations

import re

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.deck.cards import DeckError
from fxcrack.deck.spaces import Numbered
from tests.decks import BONDED, OPENED, VCCT, bonded, read, write

LENGTH, HEIGHT, WIDTH, A0, E, NU = 60.0, 1.5, 25.0, 30.0, 70e3, 0.3
NX = 30


def part() -> str:
    """A part of one arm as a modelling program writes it: no generators, internal sets."""
    lines = ["*Part, name=Arm", "*Node"]
    for j, y in enumerate((0.0, HEIGHT)):
        lines += [f"{j * (NX + 1) + i + 1:7d}, {LENGTH * i / NX:12.6g}, {y:12.6g}"
                  for i in range(NX + 1)]  # fmt: skip
    lines.append("*Element, type=CPE4R")
    lines += [f"{i + 1:3d}, {i + 1}, {i + 2}, {i + NX + 3}, {i + NX + 2}" for i in range(NX)]
    return "\n".join([
        *lines, f"*Elset, elset=_PickedSet2, internal, generate\n  1,  {NX},   1",
        "** Section: Section-1", "*Solid Section, elset=_PickedSet2, material=Material-1",
        f"{WIDTH},", "*End Part", "**  ", "",
    ])  # fmt: skip


PROGRAM = (
    """*Heading
** Job name: Job-1 Model name: Model-1
*Preprint, echo=NO, model=NO, history=NO, contact=NO
**
** PARTS
**
"""
    + part()
    + f"""*Assembly, name=Assembly
*Instance, name=Arm-1, part=Arm
*End Instance
*Instance, name=Arm-2, part=Arm
          0.,         -{HEIGHT},           0.
*End Instance
*Node
      1,           0.,          {HEIGHT},           0.
*Node
      2,           0.,         -{HEIGHT},           0.
*Nset, nset=m_Set-1
 1,
*Nset, nset=m_Set-2
 2,
*Nset, nset=bonded, instance=Arm-1, generate
 16,  31,   1
*Nset, nset=clamped, instance=Arm-1
 31,
*Elset, elset=_Slave_S1, internal, instance=Arm-1, generate
  1,  30,   1
*Surface, type=ELEMENT, name=Slave
_Slave_S1, S1
*Elset, elset=_Master_S3, internal, instance=Arm-2, generate
  1,  30,   1
*Surface, type=ELEMENT, name=Master
_Master_S3, S3
*Elset, elset=_End1_S4, internal, instance=Arm-1
  1,
*Surface, type=ELEMENT, name=End1
_End1_S4, S4
*Elset, elset=_End2_S4, internal, instance=Arm-2
  1,
*Surface, type=ELEMENT, name=End2
_End2_S4, S4
** Constraint: Constraint-1
*Coupling, constraint name=Constraint-1, ref node=m_Set-1, surface=End1
*Kinematic
1, 1
2, 2
*Coupling, constraint name=Constraint-2, ref node=m_Set-2, surface=End2
*Kinematic
1, 1
2, 2
*End Assembly
*Amplitude, name=Amp-1
             0.,              0.,              1.,              1.
*Material, name=Material-1
*Elastic
{E:g}, {NU}
*Surface Interaction, name=IntProp-1
{WIDTH},
*Friction, slip tolerance=0.005
 0.1,
*Surface Behavior, pressure-overclosure=HARD
*Contact Pair, interaction=IntProp-1, small sliding, type=SURFACE TO SURFACE, adjust=0.0
Slave, Master
*Initial Conditions, type=CONTACT
Slave, Master, bonded
** ----------------------------------------------------------------
*Step, name=Step-1, nlgeom=NO, inc=10000
*Static
0.1, 1., 1e-08, 0.1
*Boundary, amplitude=Amp-1
m_Set-1, 1, 1
m_Set-1, 2, 2, 0.5
*Boundary, amplitude=Amp-1
m_Set-2, 1, 1
m_Set-2, 2, 2, -0.5
*Debond, slave=Slave, master=Master, debonding force=RAMP

*Fracture Criterion, type=VCCT, mixed mode behavior=POWER, tolerance=0.1, unstable growth tolerance
 5., 6., 6., 1., 1., 1.
*Controls, reset
*Controls, parameters=time incrementation
4, 8, 9, 16, 10, 4, , 20, , ,
*Controls, analysis=discontinuous
*Restart, write, frequency=0
*Output, field
*Node Output
CF, RF, U
*Element Output, directions=YES
LE, PE, S
*Contact Output
BDSTAT, CDISP, CSTRESS, DBSF, DBT, ENRRT
*Output, history
*Node Output, nset=m_Set-1
RF2, U2
*Output, history, variable=PRESELECT
*End Step
"""
)


def test_a_double_cantilever_beam_of_a_modelling_program(tmp_path):
    """Load and G before growth are those of beam theory, load blocks hinged at the ends.

    CPE4R is raised to the second order unasked; the arm's root gives, as if it were 0.64 h longer
    (Williams, isotropic): 2 % are what is left of the approximation at a/h = 20.
    """
    deck = fx.read_deck(write(tmp_path, PROGRAM))
    assert any("RAMP beside *FRICTION" in line for line in deck.report.replaced)
    (debond,) = deck.scene.debonds
    assert debond.interface.pairing == "surface-to-surface" and debond.interface.friction == 0.1
    assert debond.release.increments == 5
    row = deck.run(progress=False).rows[-1]
    modulus = E / (1.0 - NU**2)
    a = A0 + 0.64 * HEIGHT
    force = 0.5 * modulus * WIDTH * HEIGHT**3 / (4.0 * a**3)
    assert row["R[Constraint-1.y]"] == pytest.approx(force, rel=0.02)
    rate = 12.0 * (force * a) ** 2 / (modulus * WIDTH**2 * HEIGHT**3)
    assert row["GI[Slave]"] == pytest.approx(rate, rel=0.03)
    deck.scene.close()


def spelled(text: str) -> str:
    """The same deck in another hand: case, blanks, tabs, comments, continuation, exponents."""
    text = text.replace("*CONTACT PAIR, SMALL SLIDING,", "  *Contact Pair , small sliding,\n")
    text = text.replace("TYPE=CPE4", "Type = cpe4").replace("*NODE, NSET=ALL", "*node,nset = all,")
    text = text.replace("1000., 0.3", "\t1.D+3,\t3.0d-1").replace("0.1, 1.", " 1.0-1, .1E1")
    text = text.replace("*NSET, NSET=BOND\n2, 3, 4, 5", "*NSET, NSET=bond, GEN\n** tip\n5, 2, -1")
    text = text.replace("*END STEP\n", "*EndStep").replace("TOP, BOTTOM", "top ,\tBottom")
    return text.replace("\n", "\r\n")


def test_another_hand(tmp_path):
    """Upper and lower case, blanks, CRLF, tabs, Fortran numbers, no newline at the end."""
    text = bonded()
    assert text.count("0.1, 1.") == 1
    plain = fx.read_deck(write(tmp_path, text))
    path = tmp_path / "other.inp"
    path.write_bytes(spelled(text).encode())
    other = fx.read_deck(path)
    a, b = (d.run(progress=False).rows[-1] for d in (plain, other))
    assert a["strain_energy"] > 0.0
    assert b["strain_energy"] == pytest.approx(a["strain_energy"], rel=1e-12)
    assert b["released[top]"] == a["released[TOP]"]
    plain.scene.close()
    other.scene.close()


def test_supports_of_bonded_nodes(tmp_path):
    """A support that names the slave node of a bond holds its master too, and says so."""
    step = OPENED.replace("*DEBOND", "5, 1, 2\n*DEBOND")
    deck = fx.read_deck(write(tmp_path, bonded(step=step)))
    assert any("hold the nodes of the master surface" in line for line in deck.report.replaced)
    last = deck.run(progress=False).rows[-1]
    both = OPENED.replace("*DEBOND", "5, 1, 2\n35, 1, 2\n*DEBOND")
    reference = fx.read_deck(write(tmp_path, bonded(step=both)))
    wanted = reference.run(progress=False).rows[-1]
    assert last["strain_energy"] == pytest.approx(wanted["strain_energy"], rel=1e-12)
    deck.scene.close()
    reference.scene.close()


def test_a_step_that_stops_ends_the_analysis(tmp_path, caplog):
    """Unstable under dead load: later steps are not run, and the deck's words are given."""
    step = OPENED[: OPENED.index("11, 1, 1")] + "14, 1, 2\n15, 1, 2\n24, 1, 2\n25, 1, 2\n"
    step += "*CLOAD\n11, 2, 100.\n21, 2, -100.\n" + OPENED[OPENED.index("*DEBOND") :]
    text = bonded(step=step) + step.format(criterion=VCCT)
    deck = fx.read_deck(write(tmp_path, text))
    history = deck.run(progress=False)
    assert float(history["time"].max()) < 1.0
    f = float(re.search(r"stopped: f = ([0-9.e+-]+) after 5 cutbacks", history.reason)[1])
    said = re.search(r"UNSTABLE GROWTH TOLERANCE=([0-9.e+-]+) at least", caplog.text)
    assert float(said[1]) == pytest.approx(1.1 * (f - 1.0), rel=0.06)
    assert "*FRACTURE CRITERION (without a value it has no limit" in caplog.text
    deck.scene.close()
    given = VCCT.replace("TYPE=VCCT", "TYPE=VCCT, UNSTABLE GROWTH TOLERANCE")
    deck = fx.read_deck(write(tmp_path, bonded(given, step=step)))
    history = deck.run(progress=False)
    assert not history.reason.startswith("stopped") and history.rows[-1]["released[TOP]"] >= 2
    deck.scene.close()


def test_fatigue_limits_left_at_zero(tmp_path, caplog):
    law = "*FRACTURE CRITERION, TYPE=FATIGUE\n1., -1., 1E-3, 2., 0., 0., 0.5, 0.5\n0.5, 1."
    step = OPENED.replace("*STATIC\n0.1, 1.", "*DIRECT CYCLIC, FATIGUE\n0.1, 1.").replace(
        "*BOUNDARY", "*BOUNDARY, AMPLITUDE=A"
    )
    cycle = "*AMPLITUDE, NAME=A\n0., 0., 0.5, 1., 1., 0.\n"
    found = read(tmp_path, BONDED + cycle + step.format(criterion=law))
    (debond,) = found.arguments["debonds"]
    assert (debond.criterion.growth.r1, debond.criterion.growth.r2) == (0.0, 0.85)
    assert "r2 = 0" in caplog.text


def test_the_former_kinematic_coupling(tmp_path):
    """*KINEMATIC COUPLING names nodes and components itself."""
    ref = "*NODE, NSET=REF\n99, 0., 3.\n"
    old = "*KINEMATIC COUPLING, REF NODE=REF\n11, 1, 6\n12, 1, 6\n13, 2\n"
    step = OPENED.replace("11, 1, 1\n11, 2, 2, 0.2", "99, 1, 1\n99, 2, 2, 0.2")
    with pytest.raises(DeckError, match="in other components"):
        read(tmp_path, BONDED + ref + old + step.format(criterion=VCCT))
    found = read(tmp_path, BONDED + ref + old.replace("13, 2\n", "") + step.format(criterion=VCCT))
    (one,) = (s for s in found.arguments["supports"] if isinstance(s, fx.Coupling))
    assert one.prescribed == {"x": 0.0, "y": 0.2} and one.point == (0.0, 3.0)


# -- numbers ---------------------------------------------------------------------------------------


def test_rows_by_number():
    """Portions in any order, with numbers given again, against a dictionary."""
    rng = np.random.default_rng(1)
    table, wanted = Numbered(2), {}
    for portion in range(60):
        n = int(rng.integers(0, 40 if portion % 7 else 400))
        labels = rng.integers(1, 900, n)
        if portion % 3 == 0:
            labels = np.unique(labels)
        rows = rng.random((len(labels), 2))
        table.add(labels, rows)
        wanted |= {int(k): row for k, row in zip(labels, rows, strict=True)}
        asked = rng.integers(1, 1000, 20)
        known, found = table.look_up(asked)
        assert known.tolist() == [int(k) in wanted for k in asked]
        assert all(
            np.array_equal(found[i], wanted[int(k)]) for i, k in enumerate(asked) if known[i]
        )
    assert table.labels.tolist() == sorted(wanted)
    assert np.array_equal(table.rows, [wanted[k] for k in sorted(wanted)])
    assert table.find(np.array([0, table.labels[3]])).tolist() == [-1, 3]
    assert np.array_equal(table.copy().rows, table.rows)


def test_fixed_increments_that_miss_the_onset_say_what_helps(tmp_path, caplog):
    step = OPENED.replace("*STATIC\n0.1, 1.", "*STATIC, DIRECT\n1., 1.")
    deck = fx.read_deck(write(tmp_path, bonded(VCCT, step=step)))
    assert deck.run().reason.startswith("stopped")
    assert "third field of the procedure's data line, which DIRECT takes away" in caplog.text
    deck.scene.close()
