"""Numbers of README and pages from runs of the demos: ``make numbers``.

A number in a page stands between marks that name it,

    the load is <!--n large_dcb.load-->1.18 to 1.35<!--/n--> times the linear one,

and so does a table, on lines of its own. A mark within a paragraph must not begin a line, where
Markdown takes it for a block. ``records.json`` holds the tables that each demo prints,
with a digest of the code that it was made from (that of ``demos/pictures/make.py``: the demo and
other demos that it imports, without comments and layout). What solvers answer is not part of it;
tests hold it. Numbers that stand in the code, thresholds and defaults, are read from it.
``tests/test_numbers.py`` tells records whose demo is another one since, and pages that say other
numbers than the records.

    python docs/numbers/make.py              # demos that have changed, then all pages
    python docs/numbers/make.py large_dcb    # these, then all pages
    python docs/numbers/make.py --pages      # pages alone
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
RECORDS = HERE / "records.json"
Table = dict[str, Any]
"""Title, columns and rows that a demo prints."""
_MARK = re.compile(r"<!--n ([\w.]+)-->(.*?)<!--/n-->", re.S)
_RECORD = "--record"


# -- numbers of runs ------------------------------------------------------------------


def column(table: Table, name: str, *, last: bool = False) -> list[float]:
    """A column of a table, the last of those that have the name if several do."""
    places = [i for i, title in enumerate(table["columns"]) if title == name]
    place = places[-1] if last else places[0]
    return [float(row[place]) for row in table["rows"]]


def span(values: Sequence[float], form: str = ".3g") -> str:
    """The smallest and the largest value."""
    return f"{min(values):{form}} to {max(values):{form}}"


def off(values: Sequence[float], digits: int = 1) -> str:
    """Largest deviation from 1 in per cent, rounded up."""
    worst = 100.0 * max(abs(v - 1.0) for v in values)
    scale = 10**digits
    return f"{-(-worst * scale // 1) / scale:.{digits}f} %"


def lines(table: Table) -> str:
    """A table of results beside reference values in Markdown."""
    out = ["", "| " + " | ".join(table["columns"]) + " |", "|---" * len(table["columns"]) + "|"]
    for row in table["rows"]:
        cells = [x if isinstance(x, str) else f"{x:.5g}" for x in row]
        out.append("| " + " | ".join(cells) + " |")
    return "\n".join([*out, "", ""])


def _late(table: Table) -> list[float]:
    """G over the closed form of the bilayer where the crack is longer than its layers are thick."""
    a, rate = column(table, "a / mm"), column(table, "G / closed form")
    return [g for length, g in zip(a, rate, strict=True) if length > 1.0]


def _yielding(table: Table) -> float:
    """Load of elastic arms over that of arms that yield, at the last row."""
    return column(table, "load / N", last=True)[-1] / column(table, "load / N")[-1]


def _slow(table: Table) -> list[float]:
    """Openings of the slowest test over the static ones."""
    return [float(table["rows"][0][i]) for i in (1, 2)]


def _identified(tables: list[Table]) -> str:
    """Toughness of two tests by the fit and by the methods of the standard."""
    fits = {(row[0], row[1]): row[2:] for row in tables[0]["rows"]}
    reduced = {(row[0], row[1]): row[2] for row in tables[1]["rows"]}
    methods = ("MBT", "CC", "MCC")
    rows = []
    for test, title in (
        ("synthetic", "DCB, 1 % noise"),
        ("DCB-UD", "DCB-UD, onsets at mid-width in 3-D"),
    ):
        found, spread, given = fits[test, "GIc"]
        by_method = [f"{reduced[test, m]:.4f}" for m in methods]
        rows.append([title, f"{found:.4f} ± {spread:.4f}", *by_method, f"{given:g}"])
    columns = ["data", "fit on load and opening", *methods, "put in"]
    return lines({"columns": columns, "rows": rows})


def _resistance(tables: list[Table]) -> str:
    """Confidence intervals of a resistance curve over its parameters."""
    shares = [f"{100.0 * r[3] / r[2]:.2g}" for r in tables[0]["rows"] if r[0] == "resistance"]
    return f"{', '.join(shares[:-1])} and {shares[-1]} %"


FROM_RUNS: dict[str, tuple[str, Callable[[list[Table]], str]]] = {
    "large_dcb.load": ("large_dcb", lambda t: span(column(t[0], "load / linear"))),
    "large_dcb.elastica": ("large_dcb", lambda t: off(column(t[0], "load / elastica"))),
    "large_dcb.J": ("large_dcb", lambda t: off(column(t[0], "G b/(2 P sin t0)"))),
    "thermal_bilayer.G": ("thermal_bilayer", lambda t: off(_late(t[0]))),
    "plastic_cod.load": ("plastic_cod", lambda t: f"{_yielding(t[0]):.3g}"),
    "dynamic_dcb.slow": ("dynamic_dcb", lambda t: off(_slow(t[0]))),
    "skin_stringer_panel.load": (
        "skin_stringer_panel",
        lambda t: off(column(t[0], "/ flat")[:1], 2),
    ),
    "identify_dcb.table": ("identify_dcb", _identified),
    "identify_dcb.resistance": ("identify_dcb", _resistance),
    "verify.table": ("verify", lambda t: lines(t[0])),
}
"""Number: the demo that gives it, and how it follows from the tables that this prints."""


# -- numbers of the code --------------------------------------------------------------


def _percent(share: float) -> str:
    return f"{100.0 * share:g} %"


def _of(module: str, name: str) -> Any:
    return getattr(importlib.import_module(module), name)


FROM_CODE: dict[str, Callable[[], str]] = {
    "balance.warned": lambda: _percent(_of("fxcrack.steps.energy_check", "WARNED")),
    "balance.refused": lambda: _percent(_of("fxcrack.steps.energy_check", "REFUSED")),
    "growth.tolerance": lambda: f"{1.0 + _of('fxcrack', 'VCCT')(GIc=1.0).tolerance:g}",
    "range.rotation": lambda: f"{_of('fxcrack.continuum.linear_range', 'LARGE'):g}",
    "range.second_order": lambda: f"{_of('fxcrack.solvers.second_order_effects', 'LARGE'):g}",
}
"""Number: how it is read from the package."""


# -- records --------------------------------------------------------------------------


def _pictures() -> Any:
    """The script that makes the pictures, for its digest of code."""
    spec = importlib.util.spec_from_file_location(
        "make_figures", ROOT / "demos" / "pictures" / "make.py"
    )
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def demos() -> list[str]:
    """Demos that numbers come from."""
    return sorted({demo for demo, _ in FROM_RUNS.values()})


def digest(demo: str) -> str:
    """Of the code that a record is made from."""
    pictures = _pictures()
    total = hashlib.sha256(demo.encode())
    for path in pictures.sources(demo):
        total.update(path.relative_to(ROOT).as_posix().encode())
        total.update(pictures.code_of(path.read_text(encoding="utf-8")).encode())
    return total.hexdigest()[:16]


def records() -> dict[str, Any]:
    """What the runs gave."""
    if not RECORDS.exists():
        return {}
    found: dict[str, Any] = json.loads(RECORDS.read_text(encoding="utf-8"))
    return found


def stale() -> list[str]:
    """Demos whose record was made from other code than there is now, or is not there."""
    known = records()
    return [d for d in demos() if known.get(d, {}).get("made_from") != digest(d)]


def tables_of(demo: str, out: Path) -> list[Table]:
    """Run a demo in this process and keep what it prints as tables."""
    show = importlib.import_module("fxcrack.demos.show")
    found: list[Table] = []

    def keep(title: str, columns: Sequence[str], rows: Sequence[Sequence[float | str]]) -> None:
        plain = [[x if isinstance(x, str) else float(x) for x in row] for row in rows]
        found.append({"title": title, "columns": list(columns), "rows": plain})

    show.table = keep  # type: ignore[attr-defined]
    importlib.import_module(f"fxcrack.demos.{demo}").main(out, False)
    return found


def record(names: Sequence[str]) -> None:
    """Run demos, each in a process of its own, and keep their tables."""
    for name in names:
        print(f"{name} ...", flush=True)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "tables.json"
            command = [sys.executable, __file__, _RECORD, name, str(file)]
            subprocess.run(command, check=True, cwd=ROOT)
            tables = json.loads(file.read_text(encoding="utf-8"))
        known = records() | {name: {"made_from": digest(name), "tables": tables}}
        RECORDS.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")


# -- pages ----------------------------------------------------------------------------


def texts() -> dict[str, str]:
    """What each number is."""
    known = records()
    out = {k: make(known[demo]["tables"]) for k, (demo, make) in FROM_RUNS.items()}
    return out | {k: make() for k, make in FROM_CODE.items()}


def pages() -> Iterator[Path]:
    """README and all pages."""
    yield ROOT / "README.md"
    yield from sorted((ROOT / "docs").rglob("*.md"))


def marks(page: str) -> list[tuple[str, str]]:
    """Names and texts of the numbers in the text of a page."""
    return [(m[1], m[2]) for m in _MARK.finditer(page)]


def filled(page: str, numbers: dict[str, str]) -> str:
    """The text of a page with its numbers as they are now.

    Raises:
        KeyError: It names a number that nothing gives.
    """
    return _MARK.sub(lambda m: f"<!--n {m[1]}-->{numbers[m[1]]}<!--/n-->", page)


def fill() -> None:
    """Write all pages whose numbers are others now."""
    numbers = texts()
    for path in pages():
        page = path.read_text(encoding="utf-8")
        now = filled(page, numbers)
        if now != page:
            print(path.relative_to(ROOT))
            path.write_text(now, encoding="utf-8")


def main(words: list[str]) -> None:
    """The command line."""
    if words[:1] == [_RECORD]:
        name, file = words[1], Path(words[2])
        file.write_text(json.dumps(tables_of(name, file.parent)), encoding="utf-8")
        return
    if words != ["--pages"]:
        unknown = [word for word in words if word not in demos()]
        if unknown:
            sys.exit(f"no number comes from {', '.join(unknown)}; known: {', '.join(demos())}")
        record(words or stale())
    fill()


if __name__ == "__main__":
    main(sys.argv[1:])
