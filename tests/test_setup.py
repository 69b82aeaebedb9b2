"""The package is installed whole, and a run of tests on several ranks is honest."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

import fxcrack
import fxcrack.demos
import fxcrack.meshes

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


@pytest.mark.smoke
def test_every_subpackage_is_installed() -> None:
    top = Path(fxcrack.__file__).parent
    found = {
        ".".join(("fxcrack", *path.parent.relative_to(top).parts))
        for path in top.rglob("__init__.py")
    }
    # In the source tree these two stand at the top level, and the command inside the package.
    found |= {"fxcrack.demos", "fxcrack.meshes", "fxcrack_command"}
    found.discard("fxcrack.command")
    assert sorted(found) == sorted(PROJECT["tool"]["setuptools"]["packages"])


@pytest.mark.parametrize("package", [fxcrack.demos, fxcrack.meshes])
def test_packages_of_the_top_level_are_importable(package: object) -> None:
    (folder,) = package.__path__
    assert {p.name for p in Path(folder).glob("*.py")} == {
        p.name for p in (ROOT / package.__name__.rpartition(".")[2]).glob("*.py")
    }


def test_command_is_installed() -> None:
    (command,) = importlib.metadata.entry_points(group="console_scripts", name="fxcrack")
    assert callable(command.load())


def test_version_is_the_same_everywhere() -> None:
    installed = importlib.metadata.version("fxcrack")
    assert installed == fxcrack.__version__ == PROJECT["project"]["version"]


def run_on_two_ranks(
    folder: Path, test: str, **environment: str
) -> subprocess.CompletedProcess[str]:
    """A file of tests on two ranks, with the settings of these tests but for less patience."""
    conftest = (ROOT / "tests" / "conftest.py").read_text()
    hasty = conftest.replace("PATIENCE = 30.0", "PATIENCE = 0.5")
    assert hasty != conftest
    (folder / "conftest.py").write_text(hasty)
    (folder / "test_one.py").write_text(test)
    return subprocess.run(
        [
            ROOT / ".ci" / "mpirun",
            *"-n 2 python3 -m pytest --color=no -p no:cacheprovider".split(),
            folder,
        ],
        env={**os.environ, "FXCRACK_TESTS_RUNNING": str(folder), **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("after", "message"),
    [
        ("", "passed on rank 0, failed on rank 1"),
        ("comm.Barrier()", "failed on rank 1, others hang"),
    ],
)
def test_failure_on_one_rank_ends_and_fails_the_run(
    tmp_path: Path, after: str, message: str
) -> None:
    lines = ["if comm.rank == 1:", "    raise ValueError('it broke')", after]
    run = run_on_two_ranks(tmp_path, "\n    ".join(["def test(comm):", *lines]))
    assert run.returncode != 0
    assert message in run.stdout + run.stderr
    assert "ValueError: it broke" in run.stdout + run.stderr


# A call that never returns and keeps the interpreter lock, as calls of PETSc do: time.sleep of
# ctypes.PyDLL. A timer in Python would not end it.
HANGING = """
import ctypes, pytest
def test_that_fails(comm):
    assert comm.rank < 0
@pytest.mark.parametrize("what", ["a call"])
def test_that_hangs(comm, what):
    if comm.rank == 1:
        ctypes.PyDLL(None).sleep(250)
    comm.Barrier()
"""


@pytest.mark.slow
def test_a_test_past_its_limit_is_named_and_ends_all_ranks(tmp_path: Path) -> None:
    # the limit of a quick test is then 5 s, more on a busy machine: enough for the first test
    run = run_on_two_ranks(tmp_path, HANGING, FXCRACK_TEST_PATIENCE="0.04")
    assert run.returncode != 0
    # though no summary was reached; paths depend on where this folder is
    assert re.search(r"FAILED \S*test_one\.py::test_that_fails - ", run.stdout)
    notes = [path.read_text() for path in tmp_path.glob("rank*")]
    assert all("test_one.py::test_that_hangs[a call] - " in note for note in notes)
    assert any("in test_that_hangs" in note for note in notes)
