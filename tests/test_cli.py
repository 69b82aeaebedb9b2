"""The command line: what it prints and writes, and how errors end it on one and several ranks."""

from __future__ import annotations

import json
import subprocess
import sys
import types
from pathlib import Path

import pytest
from mpi4py import MPI

import fxcrack
from fxcrack import cli

ROOT = Path(__file__).parent.parent


def run(*words: str) -> int:
    """Exit code of the command line run in this process."""
    with pytest.raises(SystemExit) as end:
        cli.main(list(words))
    assert end.value.code is None or isinstance(end.value.code, int)
    return end.value.code or 0


def run_on_two_ranks(program: str) -> subprocess.CompletedProcess[str]:
    """A Python program on two ranks; an error must end it long before the time limit."""
    return subprocess.run(
        [ROOT / ".ci" / "mpirun", *"-n 2 python3 -c".split(), program],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.mark.mpi
def test_info_names_versions_solvers_and_ranks(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("info") == 0
    out = capfd.readouterr().out
    if MPI.COMM_WORLD.rank > 0:
        assert out == ""  # rank 0 speaks for all
        return
    for word in ("fxcrack", fxcrack.__version__, "dolfinx", "PETSc", "petsc4py", "mpi4py", "gmsh"):
        assert word in out
    found = cli.information()
    assert found["ranks"] == str(MPI.COMM_WORLD.size)
    assert "gamg" in found["solvers"]
    assert all(found.values())


@pytest.mark.mpi
def test_an_error_of_fxcrack_is_one_short_message(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("demo", "nonsense") == 1
    out, err = capfd.readouterr()
    assert out == ""
    if MPI.COMM_WORLD.rank > 0:
        assert err == ""
        return
    assert err.startswith("fxcrack: there is no demo 'nonsense'; known: ")
    assert "Traceback" not in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("bench", "dcb4d"), 1, "choose dcb2d or dcb3d"),
        (("bench", "dcb2d", "--dx", "-1"), 1, "dx = -1.0"),
        (("bench", "dcb2d", "--ny", "0"), 1, "ny = 0"),
        (("bench", "dcb3d", "--dy", "21"), 1, "dy = 21.0"),
        (("bench", "scale", "--ranks", "0"), 1, "ranks = 0: choose at least 1"),
        (("bench", "scale", "--shapes", "cube"), 1, "shape = 'cube': choose one of"),
        (("bench", "scale", "--sizes", "few"), 1, "give numbers with commas"),
        (("bench", "dcb2d", "--json", "/dev/null/x/a.json"), 1, "--json"),
        (("cost", "--ranks", "0"), 1, "ranks = 0: choose at least 1"),
        (("accuracy", "dcb", "--out", "/dev/null/x"), 1, "cannot be written"),
        (("bench",), 2, "NAME"),
        (("bench", "dcb2d", "--dx", "half"), 2, "--dx"),
        (("nonsense",), 2, "nonsense"),
    ],
)
def test_wrong_words_say_what_is_wrong(
    capfd: pytest.CaptureFixture[str], words: tuple[str, ...], code: int, message: str
) -> None:
    assert run(*words) == code
    err = capfd.readouterr().err
    assert message in err
    assert "Traceback" not in err


@pytest.mark.mpi
def test_the_version_is_one_word(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("--version") == 0
    wanted = f"fxcrack {fxcrack.__version__}\n" if MPI.COMM_WORLD.rank == 0 else ""
    assert capfd.readouterr().out == wanted


def test_demos_are_listed_without_a_name(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("demo") == 0
    out = capfd.readouterr().out
    names = {p.stem for p in (ROOT / "demos").glob("*.py") if "\ndef main(" in p.read_text()}
    assert set(cli.demo_titles()) == names
    assert names <= set(out.split())


def test_a_demo_gets_its_folder_and_size(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[tuple[Path, bool]] = []
    toy = types.ModuleType("fxcrack.demos.toy")
    toy.main = lambda out, fine=False: calls.append((out, fine))  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, toy.__name__, toy)
    monkeypatch.setattr(cli, "demo_titles", lambda: {"toy": "A toy"})
    assert run("demo", "toy") == 0
    assert run("demo", "toy", "--out", str(tmp_path), "--fine") == 0
    assert calls == [(Path("out/toy"), False), (tmp_path, True)]


@pytest.mark.slow
def test_bench_writes_its_numbers(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "new" / "bench.json"
    assert run("bench", "dcb2d", "--dx", "1", "--ny", "2", "--json", str(file)) == 0
    result = json.loads(file.read_text())
    assert result["dx"] == 1.0 and result["ny"] == 2
    assert result["peak_memory_plain_mb"] > 10.0  # measured by a process of its own
    assert [p.name for p in file.parent.iterdir()] == ["bench.json"]  # nothing half-written
    assert "total / one static solve" in capfd.readouterr().out


def test_any_other_error_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise ZeroDivisionError("on purpose")

    monkeypatch.setattr(cli, "information", fail)
    with pytest.raises(ZeroDivisionError, match="on purpose"):
        cli.main(["info"])


_BROKEN = """
from mpi4py import MPI
from fxcrack import cli
from fxcrack.base import errors
cli._PATIENCE = {patience}
def broken():
    if MPI.COMM_WORLD.rank in {ranks}:
        raise {error}("on purpose")
    MPI.COMM_WORLD.Barrier()
cli.information = broken
cli.main(["info"])
"""


def test_an_error_on_one_rank_ends_all_with_its_message() -> None:
    done = run_on_two_ranks(_BROKEN.format(ranks="{1}", patience=0.5, error="ZeroDivisionError"))
    assert done.returncode != 0
    assert "rank 1 of 2" in done.stderr
    assert "ZeroDivisionError: on purpose" in done.stderr


@pytest.mark.slow
def test_an_error_of_fxcrack_on_one_rank_ends_all_with_its_message() -> None:
    done = run_on_two_ranks(_BROKEN.format(ranks="{1}", patience=0.5, error="errors.InputError"))
    assert done.returncode != 0
    assert "fxcrack: on purpose" in done.stderr


@pytest.mark.slow
def test_an_error_of_fxcrack_on_all_ranks_is_said_once() -> None:
    done = run_on_two_ranks(
        _BROKEN.format(ranks="{0, 1}", patience=30.0, error="errors.InputError")
    )
    assert done.returncode == 1
    assert done.stderr.count("fxcrack: on purpose") == 1
    assert "Traceback" not in done.stderr
