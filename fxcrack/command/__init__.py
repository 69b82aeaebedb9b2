"""The command ``fxcrack``: answers ``--help`` and ``--version`` at once, and else hands on.

It is installed beside the package, as ``fxcrack_command``, because importing anything of the
package loads DOLFINx, which takes seconds. What the commands are is read from the source of
:mod:`fxcrack.cli`.
"""

from __future__ import annotations

import ast
import difflib
import importlib.metadata
import importlib.util
import os
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

_RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "PMIX_RANK", "MV2_COMM_WORLD_RANK", "SLURM_PROCID")
_HELP = ("--help", "-h")
_OPTIONS = (("--version", "Show the version and exit."), ("--help", "Show this message and exit."))


def main() -> None:
    """Run the command line and exit.

    Raises:
        SystemExit: With the exit code: 0, 1 (an error of fxcrack, no DOLFINx) or 2 (wrong words).
    """
    words = sys.argv[1:]
    if words == ["--version"]:
        _print(f"fxcrack {importlib.metadata.version('fxcrack')}")
        sys.exit(0)
    if not words or words[0] in _HELP:
        _print(overview())
        sys.exit(0 if words else 2)
    known = [name for name, _ in _commands()]
    if not words[0].startswith("-") and words[0] not in known:
        close = difflib.get_close_matches(words[0], known, n=1)
        meant = f" (did you mean '{close[0]}'?)" if close else ""
        commands = ", ".join(known)
        _print(f"fxcrack: there is no command '{words[0]}'{meant}; known: {commands}", error=True)
        sys.exit(2)
    try:
        from fxcrack import cli
    except ImportError as error:
        _print(f"fxcrack: {error}", error=True)
        sys.exit(1)
    cli.main()


def overview() -> str:
    """What ``fxcrack --help`` prints: what the program is, and each command in a line."""
    rows = list(_commands())
    width = max(len(name) for name, _ in (*rows, *_OPTIONS)) + 2
    lines = ["Usage: fxcrack [OPTIONS] COMMAND [ARGS]...", ""]
    lines += ["  Crack propagation along predefined, initially bonded interfaces, on FEniCSx.", ""]
    for title, entries in (("Options", _OPTIONS), ("Commands", rows)):
        lines.append(f"{title}:")
        for name, text in entries:
            first, *rest = textwrap.wrap(text, 76 - width) or [""]
            lines.append(f"  {name:<{width}}{first}")
            lines += [" " * (width + 2) + line for line in rest]
        lines.append("")
    return "\n".join([*lines, "'fxcrack COMMAND --help' says what a command takes."])


def _commands() -> Iterator[tuple[str, str]]:
    """Names and first lines of the commands in the source of the command line."""
    package = importlib.util.find_spec("fxcrack")
    assert package is not None and package.submodule_search_locations
    path = Path(package.submodule_search_locations[0]) / "cli.py"
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.FunctionDef):
            continue
        for mark in node.decorator_list:
            if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "app.command":
                given = [a.value for a in mark.args if isinstance(a, ast.Constant)]
                name = str(given[0]) if given else node.name.replace("_", "-")
                yield name, (ast.get_docstring(node) or "").partition("\n\n")[0].replace("\n", " ")


def _print(text: str, *, error: bool = False) -> None:
    """Print on one rank only; which one this is, is known from its environment, without MPI."""
    rank = next((os.environ[name] for name in _RANKS if name in os.environ), "0")
    if rank == "0":
        print(text, file=sys.stderr if error else sys.stdout, flush=True)
