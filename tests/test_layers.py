"""The design that the source must keep: layers, flat inheritance, no citation that leads nowhere.

A folder or a module at the top level imports from those before it in :data:`ORDER` only. Imports
for the type checker count as well. The rules are read from the source; nothing is imported.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from dataclasses import dataclass, field
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

pytestmark = pytest.mark.skipif(
    not (ROOT / "fxcrack").is_dir(),
    reason="rules of the source tree, which the container removes after installing the package",
)
FOLDERS = ("fxcrack", "meshes", "demos", "tests")
ORDER = (
    *("base", "mesh", "meshes", "continuum", "interface", "condensation", "equilibrium"),
    *("solvers", "criteria", "history", "steps", "restart", "output"),
    *("effects", "error_estimate", "beam_theory", "scene_input", "step_run", "scene", "deck"),
    *("public names", "environment", "identify", "demos", "accuracy", "bench", "cli", "command"),
)
"""From the bottom up; "public names" is ``fxcrack/__init__.py``."""

ON_USE = {
    "mesh.read -> gmsh": "only a gmsh model or file needs it, and it loads a large library",
    "history -> output.plots": "matplotlib is loaded by those who plot; the one arrow upwards",
    "base.roots -> scipy.optimize": "a tenth of a second that runs without such a root save",
    "equilibrium.contact -> scipy.optimize": "likewise: the fallback of the active set alone",
    "history -> pandas": "an optional library that only to_frame needs",
    "scene -> output.report": "it loads Jinja2, an optional library, and matplotlib",
    "accuracy.scenes -> demos": "a study loads its own demo alone; one of them loads matplotlib",
    "command -> cli": "it answers --help and --version without DOLFINx",
    "cli": "its help does not wait for the libraries of its commands",
}
"""Imports inside functions, or beginnings of such arrows, with the reason."""

LEVELS = 2
"""Classes of this package above a class."""


@dataclass
class Module:
    """What the rules need of one module: what it imports, and the bases of its classes.

    The syntax trees themselves are not kept: millions of objects would make each later garbage
    collection take most of a second.
    """

    imports: set[str] = field(default_factory=set)
    inside: set[str] = field(default_factory=set)  # of functions
    bases: dict[str, list[str]] = field(default_factory=dict)

    def read(self, node: ast.AST, in_function: bool = False) -> None:
        """Read the statements below a node; only they have imports and classes in them."""
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Import | ast.ImportFrom):
                self.imports.update(imported(child))
                self.inside.update(imported(child) if in_function else ())
            elif isinstance(child, ast.stmt | ast.ExceptHandler | ast.match_case):
                if isinstance(child, ast.ClassDef):
                    names = [ast.unparse(b).partition("[")[0] for b in child.bases]
                    self.bases[child.name] = [name.split(".")[-1] for name in names]
                self.read(child, in_function or isinstance(child, ast.FunctionDef))


@pytest.fixture(scope="module")
def modules() -> dict[str, Module]:
    """The package's modules by their names without "fxcrack."."""
    found = {}
    for path in sorted((ROOT / "fxcrack").rglob("*.py")):
        words = path.relative_to(ROOT / "fxcrack").with_suffix("").parts
        name = ".".join(w for w in words if w != "__init__") or "public names"
        found[name] = Module()
        found[name].read(ast.parse(path.read_text(encoding="utf-8")))
    return found


def imported(node: ast.Import | ast.ImportFrom) -> set[str]:
    """Modules that a statement imports, those of fxcrack without "fxcrack."."""
    if isinstance(node, ast.Import):
        found = [alias.name for alias in node.names]
    elif node.module in ("fxcrack", "fxcrack.output"):
        found = [f"{node.module}.{alias.name}" for alias in node.names]
    else:
        found = [node.module or ""]
    return {"public names" if n == "fxcrack" else n.removeprefix("fxcrack.") for n in found}


def test_no_import_runs_upwards(modules: dict[str, Module]) -> None:
    found = set()
    for name, module in modules.items():
        for wanted in module.imports:
            here, there = name.partition(".")[0], wanted.partition(".")[0]
            arrow = f"{name} -> {wanted}"
            if there in ORDER and ORDER.index(there) > ORDER.index(here) and arrow not in ON_USE:
                found.add(arrow)
    assert sorted(found) == []


def test_no_import_inside_a_function(modules: dict[str, Module]) -> None:
    found = {f"{name} -> {wanted}" for name, m in modules.items() for wanted in m.inside}
    assert all(any(arrow.startswith(known) for arrow in found) for known in ON_USE)
    assert sorted(a for a in found if not a.startswith(tuple(ON_USE))) == []


def test_inheritance_is_flat(modules: dict[str, Module]) -> None:
    bases = {name: above for m in modules.values() for name, above in m.bases.items()}

    def levels(name: str) -> int:
        above = [b for b in bases[name] if b in bases]
        return max((1 + levels(b) for b in above), default=0)

    deep = sorted(name for name in bases if levels(name) > LEVELS)
    assert deep == []


def test_nothing_cites_a_file_that_is_not_here() -> None:
    found = set()
    for path in sorted(p for f in FOLDERS for p in (ROOT / f).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if ".md" not in text:
            continue
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        texts = [t.string for t in tokens if t.type == tokenize.COMMENT]
        documented = ast.Module, ast.ClassDef, ast.FunctionDef
        texts += [
            ast.get_docstring(n) or ""
            for n in ast.walk(ast.parse(text))
            if isinstance(n, documented)
        ]
        cited = set(re.findall(r"[\w/-]+\.md\b", " ".join(texts)))
        found |= {f"{path.relative_to(ROOT)}: {c}" for c in cited if not (ROOT / c).is_file()}
    assert sorted(found) == []


def test_text_files_have_one_encoding_whatever_the_locale_is() -> None:
    found = []
    for path in sorted((ROOT / "fxcrack").rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not re.search(r"(write|read)_text\(|\bopen\(", text):
            continue
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.Call):
                continue
            name, given = ast.unparse(node.func).rpartition(".")[2], [k.arg for k in node.keywords]
            written = name == "open" and any(
                isinstance(a, ast.Constant) and a.value in ("w", "a", "x") for a in node.args
            )
            if (written or name in ("write_text", "read_text")) and "encoding" not in given:
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert found == []
