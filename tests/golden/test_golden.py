"""Histories of one small scene per capability are what they were, on any number of ranks.

They are the net under changes that must not change behaviour. A change that is meant to change a
history stores it anew, ``python tests/golden/make.py NAME``, and says so; the difference of the
text files shows what changed.
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from mpi4py import MPI

from golden.histories import FOLDER, beginning, deviation, read, text_of
from golden.scenes import SCENES, Result, run

TOLERANCE = 1e-9
"""Of the largest value of a kind of column, or of its own value for a norm of the last state.

The stored histories come from one rank and the Haswell kernels of OpenBLAS. Measured deviations,
the worst scene: 1.0e-11 with the kernels of Sandybridge and of Nehalem (the scene "progressive"),
none with those of Zen; 5.0e-12 on two ranks ("iterative", "restart") and 5.5e-12 on three
("restart"). The tolerance is a hundred times that, room for other versions of DOLFINx, PETSc and
MUMPS. On one machine and one number of ranks histories repeat bit by bit: compare with
``make.py --tolerance 1e-12`` there.
"""


def marked(name: str) -> object:
    """The scene; long ones are left out of the quick run on several ranks."""
    several = MPI.COMM_WORLD.size > 1
    return pytest.param(
        name, marks=[pytest.mark.slow] if several and SCENES[name].long else [], id=name
    )


@pytest.mark.mpi
@pytest.mark.each
@pytest.mark.parametrize("name", [marked(n) for n in SCENES])
def test_history_is_what_it_was(comm: MPI.Intracomm, name: str) -> None:
    """Of long scenes the beginning only on several ranks, through two releases."""
    stored = read(FOLDER / f"{name}.csv")
    golden, rows = SCENES[name], None
    if golden.long and comm.size > 1:
        releases = [i for i, row in enumerate(stored.rows) if row["event"] == "release"]
        # a restart is to be followed by some rows
        rows = max(releases[:2][-1] + 1, 0 if golden.stop is None else golden.stop + 3)
    found = run(name, comm, rows)
    if rows is not None:
        stored, found = beginning(stored, rows), beginning(found, rows)
        assert len(found.rows) == rows
    off, where = deviation(stored, found)
    assert off <= TOLERANCE, f"deviates by {off:.1e} in {where}"


def test_every_stored_history_has_its_scene() -> None:
    assert sorted(p.stem for p in FOLDER.iterdir()) == sorted(SCENES)


STORED = """# reason: done
# displacement: 2.0
time,event,GI[bond],GII[bond],node[bond],strain_energy,balance
0.0,start,0.0,0.0,3,0.0,0.0
1.0,end,0.5,1e-17,,4.0,1e-16
"""


@pytest.fixture
def stored(tmp_path_factory: pytest.TempPathFactory) -> Result:
    path = tmp_path_factory.mktemp("golden") / "stored.csv"
    path.write_text(STORED)
    return read(path)


def test_round_off_is_measured_by_what_is_large(stored: Result) -> None:
    assert text_of(stored) == STORED
    assert deviation(stored, stored) == (0.0, "")
    rows = [dict(row) for row in stored.rows]
    rows[1]["GII[bond]"], rows[1]["balance"] = "-1e-15", "-2e-14"
    off, where = deviation(stored, replace(stored, rows=rows))
    assert (off, where) == (pytest.approx(5e-15, rel=0.01), "balance")
    rows[1]["GII[bond]"] = "0.25"
    assert deviation(stored, replace(stored, rows=rows)) == (pytest.approx(0.5), "GII[bond]")
    ends = {**stored.ends, "displacement": "2.2"}
    assert deviation(stored, replace(stored, ends=ends)) == (pytest.approx(0.1), "displacement")


@pytest.mark.parametrize(
    ("row", "column", "value", "words"),
    [
        (1, "event", "release", "events are"),
        (0, "node[bond]", "4", r"node\[bond\] is"),
        (1, "node[bond]", "4", "is empty in other rows"),
        (1, "balance", "", "is empty in other rows"),
        (1, "balance", "nan", "is not a number in other rows"),
    ],
)
def test_what_is_no_round_off_is_refused(
    stored: Result, row: int, column: str, value: str, words: str
) -> None:
    rows = [dict(r) for r in stored.rows]
    rows[row][column] = value
    with pytest.raises(AssertionError, match=words):
        deviation(stored, replace(stored, rows=rows))


def test_columns_rows_and_reasons_count(stored: Result) -> None:
    for other, words in (
        (replace(stored, columns=stored.columns[::-1]), "columns are"),
        (replace(stored, rows=stored.rows[:1]), "events are"),
        (replace(stored, ends={**stored.ends, "reason": "stopped"}), "reason"),
        (replace(stored, ends={"reason": "done"}), "displacement"),
    ):
        with pytest.raises(AssertionError, match=words):
            deviation(stored, other)
