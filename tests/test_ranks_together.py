"""What differs between ranks is found out, and no rank is left waiting where that can be known."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.base.together import check_same_call
from fxcrack.meshes.dcb import dcb_2d

ROOT = Path(__file__).parent.parent
STEP = fx.Static(until=fx.Releases(1))
SUPPORTS = [
    fx.Displacement("pin_top", x=0.0, y=1.0),
    fx.Displacement("pin_bottom", x=0.0, y=-1.0),
]


def scene(comm: MPI.Comm, **parts: Any) -> fx.Scene:
    criterion = fx.VCCT(GIc=parts.pop("GIc", 0.2))
    bonded = parts.pop("bonded", lambda x: x[0] >= 3.0)
    bond = fx.Interface("upper_face", "lower_face", bonded=bonded, name="bond")
    given = {"materials": fx.Isotropic(70e3, 0.3), "supports": SUPPORTS}
    mesh = dcb_2d(comm, length=8.0, dx=1.0, ny=1)
    debonds = [fx.Debond(bond, criterion)]
    return fx.Scene(mesh, model=fx.PlaneStrain(), debonds=debonds, **given | parts)


# -- arguments that differ -------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.three
def test_arguments_that_differ_between_ranks_are_refused(comm: MPI.Comm) -> None:
    """By all ranks, with the name of the argument and what two of them gave."""
    if comm.size == 1:
        scene(comm).close()
        return
    own = 1.0 + (comm.rank == comm.size - 1)
    where = f"on rank 0, .* on rank {comm.size - 1}"
    cases: dict[str, dict[str, Any]] = {
        "materials differs": {"materials": fx.Isotropic(70e3 * own, 0.3)},
        "loads differs": {"loads": [fx.PointForce("pin_top", (0.0, own))]},
        "supports differs": {"supports": [*SUPPORTS, fx.Displacement("top", x=own - 1.0)]},
        "bonded nodes .* differs": {"bonded": lambda x: x[0] >= 3.0 * own},
        "order differs": {"order": int(own)},
    }
    for words, parts in cases.items():
        with pytest.raises(fx.InputError, match=f"{words} between ranks: .* {where}"):
            scene(comm, **parts)
    tough = scene(comm, GIc=lambda x: 0.2 * own + 0.0 * x[0])
    with pytest.raises(fx.InputError, match=r"toughness .* differs between ranks"):
        tough.run(STEP, progress=False)
    made = scene(comm)
    with pytest.raises(fx.InputError, match="step differs between ranks"):
        made.run(fx.Static(until=fx.Releases(int(own))), progress=False)
    with pytest.raises(fx.InputError, match="checkpoint differs between ranks"):
        made.run(STEP, checkpoint=fx.Checkpoint(f"{own:g}.npz"), progress=False)
    assert len(made.run(STEP, progress=False)) > 2  # all ranks are still together


@pytest.mark.mpi
@pytest.mark.three
def test_different_functions_are_named(comm: MPI.Comm) -> None:
    if comm.size == 1:
        check_same_call(comm, "anything")
        return
    mine = "reading" if comm.rank == 0 else "writing"
    with pytest.raises(fx.FxcrackError, match=r"different tasks.*rank 0 reading, rank 1 writing"):
        check_same_call(comm, mine)
    check_same_call(comm, "both", {"number": 3})


# -- programs whose ranks part ---------------------------------------------------------------------

START = """
import sys, time
from mpi4py import MPI
import fxcrack as fx
from fxcrack.base import together
rank = MPI.COMM_WORLD.rank
def work():
    together.check_same_call(MPI.COMM_WORLD, "work")
"""


def run_on_two_ranks(program: str) -> subprocess.CompletedProcess[str]:
    """The program on two ranks."""
    return subprocess.run(
        [ROOT / ".ci" / "mpirun", *"-n 2 python3 -c".split(), START + program],
        capture_output=True,
        text=True,
        timeout=120,  # far below the limit of a test; a job that hangs is none that is slow
        check=False,
    )


LEAVE = {
    "with a message": ('sys.exit("no table")', "no table"),
    "with a code": ("sys.exit(5)", "code 5|exit code"),
    "without a word": ("sys.exit()", "work takes all ranks together, but rank 1 has left"),
    "at the end": ("pass", "work takes all ranks together, but rank 1 has left"),
    "in a function": ("raise SystemExit(3)", "work takes all ranks together, but rank 1 has left"),
}


@pytest.mark.quick("with a message")
@pytest.mark.parametrize("how", LEAVE)
def test_a_rank_that_leaves_ends_those_that_wait_for_it(how: str) -> None:
    words, says = LEAVE[how]
    program = f"if rank == 1:\n    {words}\nelse:\n    work()\n    print('went on')"
    done = run_on_two_ranks(program)
    assert done.returncode != 0
    assert "went on" not in done.stdout
    assert any(part in done.stderr for part in says.split("|"))


# Ranks that others wait for are away for longer than a rank that ends the job has patience.
HARMLESS = {
    "rank 1 leaves, rank 0 goes on alone": (
        "together.PATIENCE = 1.0\nwork()\nif rank == 1:\n    sys.exit()\ntime.sleep(3)\n"
        "print('done')",
        0,
    ),
    "an exit that is caught": (
        "together.PATIENCE = 1.0\nwork()\n"
        "try:\n    if rank == 1:\n        sys.exit(3)\nexcept SystemExit:\n    pass\n"
        "if rank == 0:\n    time.sleep(3)\nprint('done')",
        0,
    ),
    "all leave with a code": ("work()\nprint('done')\nsys.exit(7)", 7),
    "nobody ever met": ("print('done')", 0),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", HARMLESS)
def test_programs_that_end_properly_are_left_alone(what: str) -> None:
    program, code = HARMLESS[what]
    done = run_on_two_ranks(program)
    assert done.returncode == code
    assert "done" in done.stdout
    assert "left" not in done.stderr and "Traceback" not in done.stderr


@pytest.mark.slow
def test_a_rank_that_waits_long_says_for_what() -> None:
    """Nothing can be known of a rank that computes: it is waited for, and that is said."""
    program = "together.NOTICE = 1.0\nif rank == 1:\n    time.sleep(4)\nwork()\nprint('done')"
    done = run_on_two_ranks(program)
    assert done.returncode == 0
    assert "rank 0 has waited 1 s for the other ranks with work" in done.stderr
    assert done.stdout.count("done") == 2


@pytest.mark.slow
def test_an_exit_inside_a_run_leaves_nobody_waiting() -> None:
    """Linear bodies may end the run without a message; the next collective function tells."""
    program = """
from fxcrack.meshes.dcb import dcb_2d
bond = fx.Interface("upper_face", "lower_face", bonded=lambda x: x[0] >= 3.0, name="bond")
scene = fx.Scene(
    dcb_2d(length=8.0, dx=1.0, ny=1), materials=fx.Isotropic(70e3, 0.3), model=fx.PlaneStrain(),
    supports=[fx.Displacement("pin_top", x=0.0, y=1.0), fx.Displacement("pin_bottom", x=0.0, y=-1)],
    debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2))],
)
def observe(event, row):
    if rank == 1:
        sys.exit()
scene.run(fx.Static(until=fx.Releases(3)), observers=[observe], progress=False)
scene.history.to_csv("/dev/null")
print('went on')
"""
    done = run_on_two_ranks(program)
    assert done.returncode != 0
    assert "went on" not in done.stdout
