"""How golden histories are stored and compared.

A file per scene: lines ``# name: value`` with why the step ended and norms of the last state, then
the history as comma-separated values, numbers with all their digits.
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from golden.scenes import Result

FOLDER = Path(__file__).parent / "histories"

RENAMED: dict[str, str] = {}
"""Kinds of columns (the part before the bracket) that have a new name since they were stored."""

EXACT = ("node", "released")
"""Kinds of columns that are whole numbers of nodes: they must be equal."""

RELATED = (
    ("GI", "GII", "GIII", "G_max", "dG"),
    ("u", "v", "m"),
    ("s11", "s12", "s13"),
    ("cod", "grown", "length", "a"),
)
"""Kinds that share a scale: one that is zero but for round-off is measured by the others."""


def text_of(result: Result) -> str:
    """A result as the text of its file."""
    out = io.StringIO()
    for name, value in result.ends.items():
        out.write(f"# {name}: {value if isinstance(value, str) else repr(value)}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(result.columns)
    for row in result.rows:
        writer.writerow(_cell(row.get(c)) for c in result.columns)
    return out.getvalue()


def _cell(value: float | int | str | None) -> str:
    if value is None:
        return ""
    if isinstance(value, float):  # numpy's too, which writes its type
        return repr(float(value))
    return str(value)


def read(path: Path) -> Result:
    """A stored result; cells are texts."""
    lines = path.read_text().splitlines()
    ends: dict[str, float | str] = {}
    while lines[0].startswith("# "):
        name, _, value = lines.pop(0)[2:].partition(": ")
        ends[name] = value
    columns, *rows = csv.reader(lines)
    return Result(columns, [dict(zip(columns, row, strict=True)) for row in rows], ends)


def beginning(result: Result, rows: int) -> Result:
    """The first rows, with the columns that hold something there; nothing of the last state."""
    first = result.rows[:rows]
    columns = [c for c in result.columns if any(_cell(row.get(c)) != "" for row in first)]
    return Result(columns, first, {"reason": ""})


def kind_of(column: str) -> str:
    """The part of a column's name before its bracket."""
    return column.split("[")[0]


def renamed(column: str) -> str:
    """Present name of a stored column."""
    kind = kind_of(column)
    return RENAMED.get(kind, kind) + column[len(kind) :]


def deviation(stored: Result, found: Result) -> tuple[float, str]:
    """Largest difference over the largest value of the kind of column, and where it is.

    Raises:
        AssertionError: Columns, their order, texts, whole numbers of nodes, the number of rows or
            the empty cells differ.
    """
    names = [renamed(c) for c in stored.columns]
    assert found.columns == names, f"columns are {found.columns}, stored are {names}"
    assert list(found.ends) == list(stored.ends), (list(found.ends), list(stored.ends))
    before = [[row[c] for c in stored.columns] for row in stored.rows]
    now = [[_cell(row.get(c)) for c in names] for row in found.rows]
    event = names.index("event")
    events = [[row[event] for row in table] for table in (before, now)]
    assert events[1] == events[0], f"events are {events[1]}, stored are {events[0]}"
    reasons = found.ends["reason"], stored.ends["reason"]
    assert reasons[0] == reasons[1], "reason is {!r}, stored is {!r}".format(*reasons)

    columns: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for i, name in enumerate(names):
        if name == "event":
            continue
        a, b = ([row[i] for row in table] for table in (before, now))
        assert [x == "" for x in a] == [x == "" for x in b], f"{name} is empty in other rows"
        if kind_of(name) in EXACT:
            assert a == b, f"{name} is {b}, stored is {a}"
        columns[name] = x, y = _numbers(a), _numbers(b)
        assert np.array_equal(np.isnan(x), np.isnan(y)), f"{name} is not a number in other rows"
    scale = _scales({name: a for name, (a, _) in columns.items()})
    worst, where = 0.0, ""
    for name, (a, b) in columns.items():
        size = scale[kind_of(name)]
        differ = (a != b) & ~np.isnan(a)  # infinite values are equal to each other
        off = float(np.abs(a[differ] - b[differ]).max(initial=0.0))
        if off > worst * size:
            worst, where = (off / size if size else float("inf")), name
    for name, value in stored.ends.items():
        if name == "reason":
            continue
        a, b = float(value), float(found.ends[name])
        if abs(a - b) > worst * abs(a):
            worst, where = (abs(a - b) / abs(a) if a else float("inf")), name
    return worst, where


def _numbers(cells: list[str]) -> np.ndarray:
    return np.array([float(x) for x in cells if x != ""])


def _scales(columns: dict[str, np.ndarray]) -> dict[str, float]:
    """Largest finite value of each kind of column."""
    scale: dict[str, float] = {}
    for name, values in columns.items():
        kind = kind_of(name)
        largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
        scale[kind] = max(scale.get(kind, 0.0), largest)
    energies = [k for k in scale if k.endswith(("energy", "work", "dissipation")) or k == "balance"]
    for group in (*RELATED, tuple(energies)):
        present = [k for k in group if k in scale]
        scale |= dict.fromkeys(present, max((scale[k] for k in present), default=0.0))
    return scale
