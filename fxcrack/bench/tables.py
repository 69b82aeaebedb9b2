"""Results of benchmarks and estimates of cost as tables for a terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console, Group
from rich.table import Table

from fxcrack.base.terminal import new_table
from fxcrack.bench.cost import CostEstimate, Task
from fxcrack.condensation.cost_laws import Constants

Result = dict[str, Any]

_PHASES = {
    "scene": "spaces, pairing, supports",
    "assemble": "assemble K",
    "transform": "T and T^t K T",
    "factor_with_schur": "factorisation with S",
    "growth": "crack growth on S",
    "total": "total, mesh to last onset",
    "plain_factor": "plain factorisation",
    "plain_factor_same_order": "plain factorisation, ordered as with S",
    "one_solve": "one back-solve",
}


def show_speed(result: Result, console: Console) -> None:
    """Print a result of :func:`fxcrack.bench.speed.run`."""
    console.print(Group(_summary(result), _seconds(result), _curve(result)))
    if "beam_theory" in result:
        console.print(_beam_theory(result["beam_theory"]))
    if "baselines" in result:
        console.print(_baselines(result))


def show_explicit(results: list[Result], console: Console) -> None:
    """Print results of :func:`fxcrack.bench.explicit.run`."""
    table = new_table(
        "explicit dynamics, ms of processor time per increment",
        *("dofs", "ranks", "operator", "increment", results[0]["once"], "ratio", "difference"),
    )
    for r in results:
        numbers = [f"{r[k]:.3f}" for k in ("ms_per_increment", "ms_once", "ratio", "ms_beside")]
        table.add_row(str(r["dofs"]), str(r["ranks"]), r["operator"], *numbers)
    console.print(table)


def _summary(result: Result) -> Table:
    size = ", ".join(f"{k} {result[k]:g}" for k in ("dx", "dy", "ny") if k in result)
    table = new_table(f"{result['problem']} ({size})", "", "")
    table.show_header = False
    for key in ("dofs", "retained", "releases", "events", "factorizations", "ranks", "threads"):
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


def _seconds(result: Result) -> Table:
    table = new_table("seconds", "phase", "s")
    for phase, seconds in result["seconds"].items():
        table.add_row(_PHASES[phase], f"{seconds:.3f}")
    table.add_row("compilation of forms (apart)", f"{result['compile']:.3f}")
    return table


def _curve(result: Result) -> Table:
    table = new_table("onset", "a", "opening", "load")
    for point in result["curve"]:
        table.add_row(f"{point['a']:g}", f"{point['opening']:.4f}", f"{point['load']:.4f}")
    return table


def _beam_theory(beside: Result) -> Table:
    low, high = beside["between"]
    table = new_table(
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


def _baselines(result: Result) -> Table:
    table = new_table("baselines", "", "s", "measured", "of", "differs by", "speed-up")
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


def show_scale(result: Result, console: Console) -> None:
    """Print a result of :func:`fxcrack.bench.scale.run`."""
    table = new_table(
        f"direct and iterative, {result['date']}, {result['machine']}",
        *("shape", "dofs", "method", "ranks", "retained", "condense s", "per column ms"),
        *("iterations", "total s", "memory MB", "kB/dof"),
    )
    for c in result["cases"]:
        start = c["shape"], f"{c['dofs']:.0f}", c["method"], str(c["ranks"])
        if "failed" in c:
            table.add_row(*start, c["failed"][:40])
            continue
        s = c["seconds"]
        condense = sum(s[k] for k in ("transform", "factor_with_schur", "multigrid", "columns"))
        column = f"{1e3 * s['columns'] / c['columns']:.1f}" if c["columns"] else ""
        table.add_row(
            *start, str(c["retained"]), f"{condense:.2f}", column,
            f"{c['iterations']:.0f}" if c["columns"] else "", f"{s['total']:.2f}",
            f"{c['memory_mb']:.0f}", f"{1e-3 * c['bytes_per_dof']:.1f}",
        )  # fmt: skip
    console.print(table)
    strong = _strong(result["cases"])
    if strong.row_count:
        console.print(strong)
    unshared = result.get("unshared", {})
    for ranks, found in unshared.items():
        if ranks == "1" or not {"memory", "caches"} <= found.keys() & unshared["1"].keys():
            continue
        gains = [int(ranks) * unshared["1"][k] / found[k] for k in ("memory", "caches")]
        console.print(
            f"{ranks} processes that share nothing but this machine do {gains[0]:.2f} x the work "
            f"of one if it comes from memory, {gains[1]:.2f} x if it stays in the caches: no "
            "program gains more from its ranks"
        )


def _strong(cases: list[Result]) -> Table:
    """One rank against several, phase by phase."""
    table = new_table(
        "time on 1 rank over that on P", "case", "P", "phase", "1 rank s", "P s", "ratio"
    )
    done = [c for c in cases if "failed" not in c]
    for many in (c for c in done if c["ranks"] > 1):
        for one in done:
            same = all(one[k] == many[k] for k in ("shape", "dofs", "method", "ahead"))
            if not same or one["ranks"] != 1:
                continue
            title = f"{many['shape']} {many['dofs']} {many['method']}"
            for phase, seconds in one["seconds"].items():
                if seconds > 0.02 * one["seconds"]["total"]:
                    other = many["seconds"][phase]
                    ratio = f"{seconds / other:.2f}" if other > 0.0 else ""
                    table.add_row(
                        title, str(many["ranks"]), phase, f"{seconds:.2f}", f"{other:.2f}", ratio
                    )
    return table


def show_cost(
    found: list[tuple[Task, list[CostEstimate]]], constants: Constants, console: Console
) -> None:
    """Print estimates, the best method of each task first."""
    console.print(f"constants measured {constants.date} on {constants.machine}")
    console.print("* extrapolated: outside the sizes or ranks measured")
    for task, estimates in found:
        title = f"{task.dofs:.3g} dofs, {task.dim}-D, {task.retained:g} retained jumps, "
        title += f"{task.releases:g} releases"
        if not estimates:
            console.print(
                f"{title}: no method fits the memory; more ranks, or more memory per rank"
            )
            continue
        table = new_table(title, "", *(f"{e.method}, {e.ranks} ranks" for e in estimates))
        for kind, unit in (("seconds", "s"), ("memory", "GB")):
            names = list(dict.fromkeys(k for e in estimates for k in getattr(e, kind)))
            for name in names:
                table.add_row(
                    f"{name}, {unit}",
                    *(
                        _number(getattr(e, kind).get(name), unit, e.measured.get(name, True))
                        for e in estimates
                    ),
                )
            totals = [e.total_seconds if unit == "s" else e.total_memory for e in estimates]
            sure = [all(e.measured[k] for k in getattr(e, kind)) for e in estimates]
            table.add_row(
                f"in all, {unit}",
                *(_number(t, unit, ok) for t, ok in zip(totals, sure, strict=True)),
                end_section=True,
            )
        console.print(table)
        best = estimates[0]
        word = "schur" if best.method == "direct" else "iterative"
        console.print(f"take CondensedOptions(method='{word}') on {best.ranks} ranks\n")


def _number(value: float | None, unit: str, measured: bool) -> str:
    if value is None:
        return ""
    value = value if unit == "s" else value / 1e9
    return f"{value:.3g}{'' if measured else ' *'}"
