"""A study as a table for a terminal, and as the files that are kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from fxcrack.accuracy.pareto import duration, percent
from fxcrack.accuracy.pictures import draw_cost, draw_error
from fxcrack.accuracy.study import Setting
from fxcrack.base.files import replacing, write_json
from fxcrack.base.terminal import new_table

Result = dict[str, Any]

FILES = ("accuracy.json", "accuracy.md", "error.png", "cost.png")
_PHASES = {
    "set up": ("setup",),
    "K, T": ("assemble", "transform"),
    "factor": ("factor", "multigrid", "columns"),
    "growth": ("growth",),
}
_HEADINGS = ("setting", "size", "dofs", "seconds", *_PHASES, "MB")
_WIDTH = 136  # characters of the table where the terminal is not at least as wide


def write(result: Result, out: Path) -> list[Path]:
    """Write numbers, table and pictures into a folder, each file whole or not at all.

    Args:
        result: What :func:`fxcrack.accuracy.run_study.run_study` returned.
        out: Folder, made if missing.

    Returns:
        The files.
    """
    out.mkdir(parents=True, exist_ok=True)
    files = [out / name for name in FILES]
    write_json(files[0], result)
    with replacing(files[1]) as temporary:
        temporary.write_text(markdown(result), encoding="utf-8")
    draw_error(result, files[2])
    draw_cost(result, files[3])
    return files


def show(result: Result, console: Console) -> None:
    """Print a study; the advice comes last."""
    parts: list[RenderableType] = [_table(result)]
    parts += [Text(line) for line in notes(result)]
    parts.append(Text(result["advice"], style="bold"))
    console.width = max(console.width, _WIDTH)
    console.print(Group(*parts))


def _rows(result: Result, names: list[str]) -> list[tuple[bool, list[str]]]:
    """Rows of the table from cheap to costly, whether each is on the front."""
    rows = []
    for record in sorted(result["records"], key=lambda r: r["seconds"]):
        setting = Setting(**record["setting"])
        phases = [sum(record["phases"].get(k, 0.0) for k in ks) for ks in _PHASES.values()]
        errors = [record["errors"].get(n) for n in names]
        rows.append(
            (
                record["pareto"],
                [
                    setting.title,
                    f"{setting.size:g}",
                    f"{record['dofs']:,}",
                    _seconds(record["seconds"]),
                    *(_seconds(t) for t in phases),
                    f"{max(record['memory'].values(), default=0.0):.0f}",
                    *("" if e is None else percent(e) for e in errors),
                ],
            )
        )
    return rows


def _seconds(seconds: float) -> str:
    """Three decimals for short times, two digits for long ones."""
    return f"{seconds:.3f}" if seconds < 0.1 else f"{seconds:#.3g}".rstrip(".")


def _table(result: Result) -> Table:
    names = list(result["reference"]["values"])
    title = f"{result['title']}; * nothing faster is better"
    table = new_table(title, "", *_HEADINGS, *names)
    table.columns[0].min_width, table.columns[1].justify = 1, "left"
    for column in table.columns[1:]:
        column.no_wrap = True
    for pareto, row in _rows(result, names):
        table.add_row("*" if pareto else "", *row, style="bold" if pareto else None)
    return table


def notes(result: Result) -> list[str]:
    """What must be known to read the numbers, one line each."""
    known = result["reference"]
    lines = [f"Errors are counted from {known['source']}."]
    if not known["exact"]:
        sure = ", ".join(f"{n} {percent(u)}" for n, u in known["uncertainty"].items())
        lines.append(f"It is known to about: {sure}.")
    theory = result["theory"]
    if theory is not None and not theory["exact"]:
        off = ", ".join(f"{n} {100 * v:+.2f} %" for n, v in theory["relative_to_reference"].items())
        lines.append(f"Beside it {theory['source']}: {off}.")
    repeated = sum(r["repeats"] > 1 for r in result["records"])
    lines.append(
        f"Seconds of wall-clock time from calling the scene function to the result, the best of 3 "
        f"for the {repeated} short runs; the start of Python and compilation are not in them. MB: "
        "peak above what Python and libraries take."
    )
    if result["failed"]:
        lines.append(
            "No result: " + "; ".join(f"{f['name']} ({f['why']})" for f in result["failed"]) + "."
        )
    if result["left_out"]:
        costly = sorted(result["left_out"], key=lambda s: s["predicted_seconds"])
        some = ", ".join(f"{s['name']} ({duration(s['predicted_seconds'])})" for s in costly[:4])
        more = f" and {len(costly) - 4} more" if len(costly) > 4 else ""
        lines.append(
            f"Left out for the budget of {result['budget']:g} s, with predicted seconds: "
            f"{some}{more}."
        )
    return lines


def markdown(result: Result) -> str:
    """The settings on the front as a Markdown table, with notes and advice."""
    names = list(result["reference"]["values"])
    m = result["machine"]
    headings = [*_HEADINGS, *(f"error of {n}" for n in names)]
    lines = [
        f"### {result['title']}",
        "",
        "| " + " | ".join(headings) + " |",
        "|---" * len(headings) + "|",
    ]
    lines += ["| " + " | ".join(row) + " |" for pareto, row in _rows(result, names) if pareto]
    lines += ["", *notes(result), "", f"**{result['advice']}**", ""]
    lines.append(
        f"{m['processor']}, {m['cores']} cores, fxcrack {m['fxcrack']}, DOLFINx {m['dolfinx']}, "
        f"PETSc {m['PETSc']}, {m['date']}."
    )
    return "\n".join(lines) + "\n"


def summary(results: list[Result]) -> str:
    """Several studies as one Markdown table, a row each, with what was measured on which machine.

    Args:
        results: What :func:`fxcrack.accuracy.run_study.run_study` returned.
    """
    lines = [
        "| problem | errors from | 5 % | 1 % | 0.1 % |",
        "|---|---|---|---|---|",
    ]
    for result in results:
        known = result["reference"]
        source = "exact closed form" if known["exact"] else "its finest runs"
        sure = "" if known["exact"] else f", known to {percent(result['uncertainty'])}"
        cells = [_cheapest(result, target) for target in result["targets"]]
        lines.append(f"| {result['title']} | {source}{sure} | " + " | ".join(cells) + " |")
    wall = sum(r["wall"] for r in results)
    m = results[-1]["machine"]
    lines += [
        "",
        f"Measured in {wall:.0f} s on {m['processor']}, {m['cores']} cores, one thread per rank, "
        f"DOLFINx {m['dolfinx']}, PETSc {m['PETSc']}, {m['date']}.",
        "",
    ]
    lines += [f"* {r['title']}: {r['advice']}" for r in results]
    return "\n".join(lines) + "\n"


def _cheapest(result: Result, target: Result) -> str:
    """The cheapest setting for a target as a cell of a table."""
    if target["record"] is None:
        return "not reached"
    record = result["records"][target["record"]]
    setting = Setting(**record["setting"])
    unit = f" {result['unit']}" if result["unit"] else ""
    return f"{setting.title}, {setting.size:g}{unit}: {duration(record['seconds'])}"
