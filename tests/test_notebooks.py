"""The notebooks are what the demos give, without outputs, and run from top to bottom."""

from __future__ import annotations

import ast
import importlib.util
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

import fxcrack as fx

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
NAMES = sorted(path.stem for path in FOLDER.glob("*.ipynb"))
# The container has the tests, not the pages.
pytestmark = pytest.mark.skipif(not NAMES, reason="the notebooks are not installed")


def maker() -> Any:
    spec = importlib.util.spec_from_file_location("make_notebooks", FOLDER / "make.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def code_cells(name: str) -> Iterator[str]:
    cells = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    return ("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")


def shown_by(cell: str, namespace: dict[str, Any]) -> object:
    """Run a cell; the value of its last line if that is an expression."""
    tree = ast.parse(cell)
    last = tree.body[-1]
    if not isinstance(last, ast.Expr):
        exec(compile(tree, "cell", "exec"), namespace)
        return None
    exec(compile(ast.Module(tree.body[:-1], []), "cell", "exec"), namespace)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), namespace)


def test_notebooks_are_made_from_the_demos() -> None:
    make = maker()
    assert sorted(make.ENDS) == NAMES
    for name in NAMES:
        stored = (FOLDER / f"{name}.ipynb").read_text(encoding="utf-8")
        assert stored == make.notebook(name), f"run 'make notebooks': {name} is another one"
        for cell in json.loads(stored)["cells"]:
            assert not cell.get("outputs") and cell.get("execution_count") is None


@pytest.mark.slow
@pytest.mark.demos
@pytest.mark.parametrize("name", NAMES)
def test_cells_run_in_one_namespace(name: str) -> None:
    """And what they end with shows itself in a notebook: tables as HTML, figures as pictures."""
    namespace: dict[str, Any] = {"__name__": "notebook"}
    sys.modules.setdefault("notebook", type(sys)("notebook"))
    kinds = []
    for cell in code_cells(name):
        value = shown_by(cell, namespace)
        if isinstance(value, fx.Scene | fx.History):
            html = value._repr_html_()
            assert "<pre>" in html and html.count("<table>") == html.count("</table>")
            kinds.append(type(value).__name__)
        elif isinstance(value, Figure):
            assert value._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
            kinds.append("Figure")
        else:
            assert value is None
    wanted = {"dcb": ["Scene", "History", "Figure", "Figure"], "identify_dcb": ["Figure"]}
    assert kinds == wanted[name]


@pytest.mark.slow
@pytest.mark.demos
@pytest.mark.parametrize("name", NAMES)
def test_notebooks_execute_in_a_kernel(name: str) -> None:
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    content = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    nbformat.validate(content)
    # the kernel is that of this environment, whatever kernels the machine knows
    client = nbclient.NotebookClient(content, timeout=200, kernel_name="python3")
    client.execute()
    outputs = [o for cell in content.cells for o in cell.get("outputs", ())]
    assert not [o for o in outputs if o.output_type == "error"]
    shown = [set(o.data) for o in outputs if o.output_type in ("display_data", "execute_result")]
    assert sum("image/png" in kinds for kinds in shown) == (2 if name == "dcb" else 1)
    assert sum("text/html" in kinds for kinds in shown) >= 2  # tables, scene and history
