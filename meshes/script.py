"""Command line of the mesh files: the keywords of a mesh function as options."""

from __future__ import annotations

import argparse
import inspect
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any

from mpi4py import MPI

from fxcrack.base.errors import FxcrackError
from fxcrack.mesh import Mesh

_KINDS: dict[str, dict[str, Any]] = {
    "float": {"type": float},
    "int": {"type": int},
    "str": {"type": str},
    "float | None": {"type": float},
    "int | None": {"type": int},
    "Sequence[float]": {"type": float, "nargs": "+"},
    "tuple[float, float] | None": {"type": float, "nargs": 2},
}


def run(*functions: Callable[..., Mesh], argv: Sequence[str] | None = None) -> None:
    """Write the .msh file one of the functions makes, as the command line asks.

    Args:
        functions: Mesh functions; the first argument may pick one by name, else it is the first.
        argv: Arguments, ``None`` for those of the command line.

    Raises:
        SystemExit: The arguments are wrong or the mesh cannot be made; the message says why.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    names = {function.__name__: function for function in functions}
    picked = names[words.pop(0)] if words and words[0] in names else functions[0]
    parser = argparse.ArgumentParser(
        description=_text(picked).partition("\n")[0].partition("; collective")[0],
        epilog=f"Put {' or '.join(names)} first to choose the model." if len(names) > 1 else None,
    )
    _add_options(parser, picked)
    options = vars(parser.parse_args(words))
    try:
        mesh = picked(MPI.COMM_SELF, **options)
    except FxcrackError as error:
        sys.exit(f"error: {error}")
    n_cells = mesh.domain.topology.index_map(mesh.tdim).size_global
    groups = ", ".join(sorted(mesh.groups))
    print(f"{options['out']}: {n_cells} cells of order {mesh.order}; groups {groups}")


def _text(function: Callable[..., Mesh]) -> str:
    """Docstring of a function without its indentation."""
    return inspect.getdoc(function) or ""


def _add_options(parser: argparse.ArgumentParser, function: Callable[..., Mesh]) -> None:
    """One option for every keyword that fits on a command line, explained as in the docstring."""
    explained = dict(
        re.findall(r"^    (\w+): (.*(?:\n        .*)*)", _text(function), re.MULTILINE)
    )
    for name, parameter in inspect.signature(function).parameters.items():
        flag = "--" + name.replace("_", "-")
        if name == "out":
            parser.add_argument(flag, required=True, help=".msh file to write")
        elif parameter.annotation in _KINDS:
            default = "" if parameter.default is None else f" [{parameter.default}]"
            text = " ".join(explained[name].replace("``", "").split()) + default
            parser.add_argument(
                flag, default=parameter.default, help=text, **_KINDS[parameter.annotation]
            )
