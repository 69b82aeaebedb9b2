"""Make the pictures of README and documentation from the demos: ``make figures``.

``made_from.json`` holds for each picture a digest of the code that it was made from: of the demo
and of other demos that it imports, without comments, docstrings and layout. What solvers answer,
meshes and the look of plots are not part of it; tests hold these. ``tests/test_figures.py`` tells
pictures whose demo is another one since, that no demo makes, or that no page shows.

    python demos/pictures/make.py             # those that are stale
    python demos/pictures/make.py dcb pinch   # these
    python demos/pictures/make.py --list      # what each is made from, and whether it is stale
"""

from __future__ import annotations

import ast
import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
import tokenize
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
MADE_FROM = HERE / "made_from.json"

# Picture: demo, the file it writes, further words of its command line.
FIGURES: dict[str, tuple[str, str, tuple[str, ...]]] = {
    **{
        f"accuracy_{study}": ("accuracy", f"accuracy_{study}.png", ())
        for study in ("dcb_cost", "dcb_error", "dcb3d_cost", "dcb3d_error", "penny_error")
    },
    "dcb": ("dcb", "deformed.png", ()),
    "domain_integral": ("domain_integral", "domain_integral.png", ()),
    "dynamic_dcb": ("dynamic_dcb", "crack_length.png", ()),
    "friction_enf": ("friction_enf", "friction_enf.png", ()),
    "front": ("front3d", "front_progressive.png", ()),
    "identify_dcb": ("identify_dcb", "resistance.png", ()),
    "large_dcb": ("large_dcb", "load_opening.png", ()),
    "pinch": ("pinch", "pinch.png", ()),
    "impact_panel": ("impact_panel", "impact_panel.png", ()),
    "shell_accuracy": ("shell_accuracy", "shell_accuracy.png", ()),
    "shell_dcb": ("shell_dcb", "shell_dcb.png", ()),
    "skin_stringer": ("skin_stringer", "skin_stringer.png", ()),
    "skin_stringer_panel": ("skin_stringer_panel", "skin_stringer_panel.png", ()),
}


def sources(demo: str) -> list[Path]:
    """Files whose code decides what a demo draws: the demo, and other demos that it imports."""
    found: set[Path] = set()
    waiting = [ROOT / "demos" / f"{demo}.py"]
    while waiting:
        path = waiting.pop()
        if path in found:
            continue
        found.add(path)
        waiting += _imported(path)
    return sorted(found - {ROOT / "demos" / "show.py"})


def _imported(path: Path) -> Iterator[Path]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{a.name}" for a in node.names)]
        elif isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        for name in names:
            parts = name.split(".")
            if parts[:2] == ["fxcrack", "demos"] and len(parts) > 2:
                file = ROOT.joinpath("demos", parts[2]).with_suffix(".py")
                if file.exists():
                    yield file


def code_of(text: str) -> str:
    """The code of a module without comments, docstrings and layout, whatever Python reads it."""
    lines = text.splitlines(keepends=True)
    left_out: list[tuple[tuple[int, int], tuple[int, int]]] = []
    for token in tokenize.generate_tokens(iter(lines).__next__):
        if token.type == tokenize.COMMENT:
            left_out.append((token.start, token.end))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and node.body:
            first = node.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                end = first.end_lineno or first.lineno, first.end_col_offset or 0
                left_out.append(((first.lineno, first.col_offset), end))
    for (row, column), (last, end) in sorted(left_out, reverse=True):
        rest = lines[last - 1][end:]
        lines[row - 1 : last] = [lines[row - 1][:column] + rest, *[""] * (last - row)]
    return "".join("".join(lines).split())


def digest(figure: str) -> str:
    """Of the code that makes a picture, and of the words of its command."""
    demo, file, words = FIGURES[figure]
    total = hashlib.sha256(" ".join((demo, file, *words)).encode())
    for path in sources(demo):
        total.update(path.relative_to(ROOT).as_posix().encode())
        total.update(code_of(path.read_text(encoding="utf-8")).encode())
    return total.hexdigest()[:16]


def stale() -> list[str]:
    """Pictures that were made from other code than there is now, or are not there."""
    made = json.loads(MADE_FROM.read_text(encoding="utf-8"))
    return [
        name
        for name in FIGURES
        if made.get(name) != digest(name) or not (HERE / f"{name}.png").exists()
    ]


def make(names: list[str]) -> None:
    """Run the demos of some pictures, each once; keep the pictures and their digests."""
    by_command: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for name in names:
        demo, _, words = FIGURES[name]
        by_command.setdefault((demo, words), []).append(name)
    for (demo, words), figures in by_command.items():
        print(f"{demo}: {', '.join(figures)}", flush=True)
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, str(ROOT / "demos" / f"{demo}.py"), "--out", folder, *words]
            subprocess.run(command, check=True, cwd=ROOT)
            for name in figures:
                shutil.copyfile(Path(folder) / FIGURES[name][1], HERE / f"{name}.png")
        made = json.loads(MADE_FROM.read_text(encoding="utf-8")) if MADE_FROM.exists() else {}
        made |= {name: digest(name) for name in figures}
        MADE_FROM.write_text(json.dumps(made, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def main(words: list[str]) -> None:
    """The command line."""
    if words == ["--list"]:
        now = stale()
        for name, (demo, file, _) in FIGURES.items():
            print(f"{name}.png: {file} of demo {demo}{', stale' if name in now else ''}")
        return
    unknown = [word for word in words if word not in FIGURES]
    if unknown:
        sys.exit(f"there is no picture {', '.join(unknown)}; known: {', '.join(FIGURES)}")
    make(words or stale())


if __name__ == "__main__":
    main(sys.argv[1:])
