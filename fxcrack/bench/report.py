"""Benchmark results as tables for a terminal."""

from __future__ import annotations

from typing import Any

from rich import box
from rich.console import Console, Group
from rich.table import Table

_PHASES = {
    "scene": "spaces, pairing, supports",
    "assemble": "assemble K",
    "transform": "T and T^t K T",
    "factor_with_schur": "factorisation with S",
    "march": "crack growth on S",
    "total": "total, mesh to last onset",
    "plain_factor": "plain factorisation",
    "plain_factor_same_order": "plain factorisation, ordered as with S",
    "one_solve": "one back-solve",
}


def show(result: dict[str, Any], console: Console) -> None:
    """Print a result of :func:`fxcrack.bench.run.run`."""
    console.print(Group(_summary(result), _seconds(result), _curve(result)))
    if "beam_theory" in result:
        console.print(_beam_theory(result["beam_theory"]))
    if "baselines" in result:
        console.print(_baselines(result))


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right")
    return table


def _summary(result: dict[str, Any]) -> Table:
    size = ", ".join(f"{k} {result[k]:g}" for k in ("dx", "dy", "ny") if k in result)
    table = _table(f"{result['problem']} ({size})", "", "")
    table.show_header = False
    for key in ("dofs", "window", "releases", "events", "factorizations", "ranks", "threads"):
        table.add_row(key, str(result[key]))
    table.add_row("total / one static solve", f"{result['ratio_to_one_solve']:.2f}")
    same = result["ratio_to_one_solve_same_order"]
    table.add_row("the same, ordered as with S", f"{same:.2f}")
    plain = result["peak_memory_plain_mb"]
    beside = "" if plain is None else f" ({result['peak_memory_mb'] / plain:.2f} x plain)"
    table.add_row("peak memory, MB", f"{result['peak_memory_mb']:.0f}{beside}")
    deviation = result.get("largest_deviation_from_reference")
    if deviation is not None:
        table.add_row("off the reference by", f"{deviation:.2g}")
    return table


def _seconds(result: dict[str, Any]) -> Table:
    table = _table("seconds", "phase", "s")
    for phase, seconds in result["seconds"].items():
        table.add_row(_PHASES[phase], f"{seconds:.3f}")
    table.add_row("compilation of forms (apart)", f"{result['compile']:.3f}")
    return table


def _curve(result: dict[str, Any]) -> Table:
    table = _table("onset", "a", "opening", "load")
    for point in result["curve"]:
        table.add_row(f"{point['a']:g}", f"{point['opening']:.4f}", f"{point['load']:.4f}")
    return table


def _beam_theory(beside: dict[str, Any]) -> Table:
    low, high = beside["between"]
    table = _table(
        f"beside corrected beam theory; mean ratio {beside['mean_load_ratio']:.3f} "
        f"while a = {low:g} to {high:g}",
        *("mean a", "opening", "load", "theory", "ratio"),
    )
    for point in beside["curve"]:
        a, opening, load, theory = (point[k] for k in ("a", "opening", "load", "beam_load"))
        table.add_row(
            f"{a:.2f}", f"{opening:.3f}", f"{load:.2f}", f"{theory:.2f}", f"{load / theory:.3f}"
        )
    return table


def _baselines(result: dict[str, Any]) -> Table:
    table = _table("baselines", "", "s", "measured", "of", "differs by", "speed-up")
    for name, unit in (("refactor", "releases"), ("columns", "columns")):
        found = result["baselines"][name]
        table.add_row(
            f"{name}{' (scaled)' if found['scaled'] else ''}",
            f"{found['seconds']:.1f}",
            str(found[f"measured_{unit}"]),
            f"{found[f'all_{unit}']} {unit}",
            f"{found['largest_difference']:.1e}",
            f"{result[f'speedup_over_{name}']:.1f}",
        )
    return table
