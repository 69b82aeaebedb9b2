"""Installation: what a user meets before the first scene."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
from pathlib import Path

import fxcrack_command
import pytest

import fxcrack
from fxcrack import cli
from fxcrack.base import processes, requirements
from fxcrack.base.errors import InputError
from fxcrack.base.files import check_writable

ROOT = Path(__file__).parent.parent


def python(program: str, *words: str, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program, *words],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
        **options,  # type: ignore[call-overload]
    )


START = "import sys, fxcrack_command\nsys.argv[0] = 'fxcrack'\n"
LOADED = "import atexit\natexit.register(lambda: print(sorted(sys.modules), file=sys.stderr))\n"


@pytest.mark.parametrize(
    ("word", "says"), [("--help", "accuracy"), ("--version", fxcrack.__version__)]
)
def test_help_and_version_answer_at_once(word: str, says: str) -> None:
    """Less than half a second of processor time, without DOLFINx, MPI and numpy."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = python(START + "fxcrack_command.main()", word)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert done.returncode == 0 and says in done.stdout
    assert spent < 0.5
    modules = python(START + LOADED + "fxcrack_command.main()", word).stderr
    assert all(f"'{name}'" not in modules for name in ("dolfinx", "mpi4py", "numpy", "fxcrack"))


def test_the_overview_names_every_command() -> None:
    unknown = python(START + LOADED + "fxcrack_command.main()", "benhc")
    assert unknown.returncode == 2
    assert "no command 'benhc' (did you mean 'bench'?)" in unknown.stderr
    assert "'dolfinx'" not in unknown.stderr
    text = fxcrack_command.overview()
    for command in cli.app.registered_commands:
        assert command.callback is not None
        assert f"  {command.name or command.callback.__name__} " in text


def test_only_one_rank_prints(monkeypatch: pytest.MonkeyPatch) -> None:
    for rank, lines in (("0", 1), ("1", 0)):
        done = python(
            START + "fxcrack_command.main()", "--version", env={**os.environ, "PMI_RANK": rank}
        )
        assert len(done.stdout.splitlines()) == lines


def test_without_dolfinx_the_import_says_how_to_get_it() -> None:
    program = "import sys\nsys.modules['dolfinx'] = None\nimport fxcrack"
    done = python(program)
    assert done.returncode == 1
    assert "ImportError: fxcrack needs DOLFINx 0.9 to 0.11" in done.stderr
    for words in ("pip install 'fxcrack[wheel]'", "python3-dolfinx-real", "conda-forge", "README"):
        assert words in done.stderr
    command = python(
        "import sys\nsys.modules['dolfinx'] = None\n" + START + "fxcrack_command.main()", "info"
    )
    assert command.returncode == 1
    assert command.stderr.startswith("fxcrack: fxcrack needs DOLFINx")
    assert "Traceback" not in command.stderr
    assert requirements.is_installed("dolfinx") and not requirements.is_installed("no_such_module")


def test_types_are_part_of_the_package() -> None:
    assert (Path(fxcrack.__file__).parent / "py.typed").is_file()
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert "py.typed" in tools["package-data"]["fxcrack"]
    assert "fxcrack_command" in tools["packages"]


EDITED = "site-packages" not in fxcrack.__file__ and "dist-packages" not in fxcrack.__file__


@pytest.mark.slow
def test_mypy_checks_a_script_of_a_user(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    script = tmp_path / "mine.py"
    sound = "import fxcrack as fx\nsteel = fx.Isotropic(E=70e3, nu=0.3)\nend = fx.Time(1.0)\n"
    script.write_text(sound + "wrong: str = fx.Isotropic(70e3, 0.3).E\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--follow-imports=silent", str(script)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        # an installation for editing is known to Python only, not to mypy
        env={**os.environ, "MYPYPATH": str(Path(fxcrack.__file__).parents[1])} if EDITED else None,
    )
    assert "mine.py:4: error: Incompatible types in assignment" in done.stdout
    assert "py.typed" not in done.stdout and done.stdout.count("error:") == 1


def test_a_file_of_the_present_folder_is_not_taken_for_a_module(tmp_path: Path) -> None:
    """A json.py of the user's stands in the folder in which processes of fxcrack are started."""
    (tmp_path / "json.py").write_text("raise SystemExit('imported by accident')")
    words = processes.command("json.tool", ["--help"], 1)
    assert words is not None
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0 and "accident" not in done.stderr


def test_outputs_that_cannot_be_written_are_refused_beforehand(tmp_path: Path) -> None:
    check_writable("--json", tmp_path / "new" / "a.json")
    assert list((tmp_path / "new").iterdir()) == []
    check_writable("--out", tmp_path / "other", folder=True)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"--json '.*' cannot be written: .*folder, not a file"):
        check_writable("--json", tmp_path)
    with pytest.raises(InputError, match=r"--out '.*' cannot be written: "):
        check_writable("--out", tmp_path / "file", folder=True)
    with pytest.raises(InputError, match=r"--json '.*' cannot be written: "):
        check_writable("--json", tmp_path / "file" / "a.json")


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / "fxcrack").is_dir(), reason="the sources are not here")
def test_distributions_are_whole(tmp_path: Path) -> None:
    """A wheel made from the source distribution alone, in a new environment, grows a crack."""
    pytest.importorskip("setuptools.build_meta")
    sources = tmp_path / "sources"
    shutil.copytree(
        ROOT, sources, ignore=shutil.ignore_patterns(".*", "out", "build", "*.egg-info")
    )

    def build(what: str, folder: Path) -> Path:
        program = f"from setuptools import build_meta as b; print(b.{what}({str(tmp_path)!r}))"
        done = subprocess.run(
            [sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return tmp_path / done.stdout.splitlines()[-1]

    sdist = build("build_sdist", sources)
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path / "unpacked", filter="data")
    wheel = build("build_wheel", next((tmp_path / "unpacked").iterdir()))
    fresh = tmp_path / "fresh"
    venv.create(fresh)
    into = [sys.executable, "-m", "pip", "--python", fresh / "bin/python", "install", "-q"]
    subprocess.run([*into, "--no-index", "--no-deps", wheel], check=True, capture_output=True)
    # The libraries are those of this environment; its own .pth files, one of which would lead to
    # the sources here, are not read.
    packages = next((fresh / "lib").glob("python*/site-packages"))
    (packages / "libraries.pth").write_text(
        "\n".join(p for p in sys.path if p.endswith("packages"))
    )
    for library in Path(sys.prefix, "lib").iterdir():  # where mpi4py looks for MPI
        if not (fresh / "lib" / library.name).exists():
            (fresh / "lib" / library.name).symlink_to(library)
    program = (
        "import fxcrack as fx, fxcrack.demos.dcb\n"
        "print(fx.__file__)\n"
        "import pathlib; fxcrack.demos.dcb.main(pathlib.Path('out'))\n"
    )
    done = subprocess.run(
        [fresh / "bin/python", "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert str(fresh) in done.stdout.splitlines()[0]
    named = subprocess.run(
        [fresh / "bin/fxcrack", "--version"], capture_output=True, text=True, check=True
    )
    assert fxcrack.__version__ in named.stdout
