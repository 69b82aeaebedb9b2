"""Make the notebooks of some demos from their scripts: ``make notebooks``.

Prose, imports and functions of a notebook are those of the script; its last cells stand here, in
place of what the script does with files. Notebooks are committed without outputs, and
``tests/test_notebooks.py`` fails where one of them is not what its script gives.
"""

from __future__ import annotations

import ast
import hashlib
import json
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
DEMOS = HERE.parents[1] / "demos"

# Text and code of the last cells, by demo.
ENDS: dict[str, list[tuple[str, str]]] = {
    "dcb": [
        (
            "## The run\n\nProgress comes as lines of the log here, if the run takes longer than "
            "two seconds. A scene shows how it was solved, and why.",
            "scene, rows = run()\nscene",
        ),
        (
            "A history shows what happened, and its first and last rows.",
            "history = scene.history\nhistory",
        ),
        (
            "Load and opening at some crack lengths beside corrected beam theory (CBT).",
            "table(\n"
            '    "Double cantilever beam beside corrected beam theory (CBT)",\n'
            '    ["a / mm", "opening / mm", "load / N", "CBT opening", "CBT load", "load / CBT"],\n'
            "    [[*row, row[2] / row[4]] for row in rows],\n"
            ")",
        ),
        (
            "Plots return the figure of matplotlib; without a file name they write none.",
            "a = np.linspace(30.0, 45.0, 60)\n"
            "load = BEAM.dcb_load(a, G_IC)\n"
            'theory = [("corrected beam theory", 0.5 * BEAM.dcb_opening(a, load), load)]\n'
            "history.plot(\n"
            '    x="u[pin_top.y]",\n'
            '    y="R[pin_top.y]",\n'
            '    xlabel="half opening u / mm",\n'
            '    ylabel="load P / N",\n'
            "    reference=theory,\n"
            ")",
        ),
        ("The deformed mesh.", "fx.plots.deformed(scene)"),
    ],
    "identify_dcb": [
        (
            "## The fits\n\nThe scene is solved once; each fit takes a fraction of a second.",
            'found = run()\ntrue = {"synthetic": {"GIc": G_IC}, "resistance": RISING, '
            '"DCB-UD": {"GIc": 0.1703}}\n'
            "rows = [\n"
            "    [test, name, value, fit.half_widths[name], true[test][name]]\n"
            "    for test, fit in found.items()\n"
            "    for name, value in fit.values.items()\n"
            "]\n"
            'table("Least squares on whole curves", '
            '["data", "", "found", "+- (95 %)", "put in"], rows)',
        ),
        (
            "Beside them stand the methods of ASTM D5528, which need the crack length at each "
            "point.",
            "reduced = [\n"
            "    [test, method.method, method.mean, float(method.G.std(ddof=1))]\n"
            '    for test in ("synthetic", "DCB-UD")\n'
            "    for method in reduce(found[test].tests[0].record).values()\n"
            "]\n"
            'table("Data reduction of ASTM D5528", ["data", "method", "G_Ic", "deviation"], '
            "reduced)",
        ),
        (
            "Measured points and the fitted resistance curve.",
            'found["resistance"].plot(xlabel="opening / mm", ylabel="load / N")',
        ),
    ],
}
UNUSED = {"main"}  # functions that write files, and the command line of a script


def cells_of(name: str) -> list[dict[str, Any]]:
    """The cells of the notebook of a demo."""
    text = (DEMOS / f"{name}.py").read_text(encoding="utf-8")
    lines = text.splitlines()
    prose = []
    for line in lines:
        if not line.startswith("#"):
            break
        prose.append(line[2:])
    out = [_cell("markdown", "\n".join(prose), name, 0)]
    begin, imports, parts = 0, True, []
    for node in ast.parse(text).body:
        # comments before a statement belong to it
        begin, last = node.end_lineno or 0, begin
        source = "\n".join(lines[last:begin])
        future = isinstance(node, ast.ImportFrom) and node.module == "__future__"
        if isinstance(node, ast.Expr) or future or _is_left_out(node):
            continue
        is_import = isinstance(node, ast.Import | ast.ImportFrom)
        if isinstance(node, ast.FunctionDef | ast.ClassDef) or (imports and not is_import):
            parts.append([source])
        else:
            parts[-1:] = [[*parts[-1], source]] if parts else [[source]]
        imports = is_import
    for part in parts:
        out.append(_cell("code", _used(part, parts), name, len(out)))
    for words, code in ENDS[name]:
        out.append(_cell("markdown", words, name, len(out)))
        out.append(_cell("code", code, name, len(out)))
    return out


def _is_left_out(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) or (isinstance(node, ast.FunctionDef) and node.name in UNUSED)


def _used(part: list[str], parts: list[list[str]]) -> str:
    """The text of a cell, without what only the script needs."""
    text = "\n".join(part).strip("\n")
    while "\n\n\n" in text and not text.startswith(("def ", "class ")):
        text = text.replace("\n\n\n", "\n\n")
    rest = "\n".join("\n".join(p) for p in parts)
    if "from pathlib import Path" in text and "Path(" not in rest:
        text = text.replace("from pathlib import Path\n", "")
    if "from mpi4py import MPI" in text and "MPI." not in rest:
        text = text.replace("from mpi4py import MPI\n", "")
    text = text.replace("import arguments, table", "import table")
    return text.strip("\n")


def _cell(kind: str, source: str, name: str, number: int) -> dict[str, Any]:
    """A cell; its identifier follows from its place, so that a notebook is always the same."""
    identifier = hashlib.sha256(f"{name} {number}".encode()).hexdigest()[:8]
    cell = {"cell_type": kind, "id": identifier, "metadata": {}}
    if kind == "code":
        cell |= {"execution_count": None, "outputs": []}
    return {**cell, "source": source.splitlines(keepends=True)}


def notebook(name: str) -> str:
    """The notebook of a demo, version 4.5 of the format, without outputs."""
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    content = {
        "cells": cells_of(name),
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    for demo in ENDS:
        (HERE / f"{demo}.ipynb").write_text(notebook(demo), encoding="utf-8")
