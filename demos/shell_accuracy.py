# # Shells, continuum shells and solids: accuracy against time and memory
#
# Four delamination specimens in bending, each as solids, continuum shells and shells of first and
# second order, cells from 5 to 0.3 mm long: DCB, ENF with contact, single-leg bending, mixed-mode
# bending. `fxcrack accuracy strip_dcb` (or `strip_enf`, `strip_slb`, `strip_mmb`) runs one of them;
# here all are run one after the other and drawn in one picture. Errors of G are counted from the
# limit of the solids, for shells tend to values of their own: they have no root correction in mode
# II, unless their bonds have the compliance of the arms (`stiffness="arms"`).
"""Error of G against seconds and memory for solids, continuum shells and shells, with advice."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from mpi4py import MPI
from rich.console import Console

import fxcrack as fx
from fxcrack.accuracy import report
from fxcrack.accuracy.bending import SPECIMENS
from fxcrack.accuracy.pareto import TARGETS, duration, percent
from fxcrack.accuracy.run_study import run_study
from fxcrack.accuracy.study import Setting
from fxcrack.demos.show import arguments, table
from fxcrack.output.plots.style import COLOURS, save

BUDGET = 120.0
"""Seconds of each study."""
LOOKS = {
    "hexahedron": (COLOURS[0], "s", "solids"),
    "continuum shell": (COLOURS[1], "o", "continuum shells, one per arm"),
    "shell": (COLOURS[2], "^", "shells, one per arm"),
    "shell with compliant bonds": (COLOURS[3], "D", "shells with compliant bonds"),
}


def lines(result: dict[str, Any]) -> dict[Setting, list[dict[str, Any]]]:
    """Records of each kind and order of cells, coarse to fine."""
    out: dict[Setting, list[dict[str, Any]]] = {}
    for record in sorted(result["records"], key=lambda r: -r["setting"]["size"]):
        out.setdefault(Setting(**record["setting"]).line, []).append(record)
    return out


def memory_of(record: dict[str, Any]) -> float:
    """Peak above what Python and libraries take, MB."""
    return max(record["memory"].values(), default=0.0)


def picture(results: dict[str, dict[str, Any]]) -> Figure:
    """One column per specimen: error of G against seconds above, against memory below."""
    figure = Figure(figsize=(4.0 * len(results), 7.2), dpi=130, layout="constrained")
    axes = figure.subplots(2, len(results), sharey="row", squeeze=False)
    for column, (name, result) in enumerate(results.items()):
        for row, (label, value) in enumerate(
            (("seconds", lambda r: r["seconds"]), ("MB", memory_of))
        ):
            ax = axes[row, column]
            for line, records in lines(result).items():
                colour, marker, words = LOOKS[line.cell]
                points = [(value(r), 100.0 * r["error"]) for r in records if value(r) > 0.0]
                if points:
                    ax.loglog(
                        *zip(*points, strict=True), f"{marker}-", color=colour, markersize=4.5,
                        fillstyle="full" if line.order == 2 else "none",
                        label=f"{words}, order {line.order}",
                    )  # fmt: skip
            for target in TARGETS:
                ax.axhline(100.0 * target, color="0.8", linewidth=0.8, zorder=0)
            ax.set_xlabel(label)
            ax.xaxis.set_minor_formatter(NullFormatter())
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axes[1, column].set_xlabel("MB\n\n" + fill(result["advice"], 52), fontsize=9)
        axes[0, column].set_title(SPECIMENS[name].title, fontsize=11)
    for ax in axes[:, 0]:
        ax.set_ylabel("error of G / %")
    axes[0, 0].legend(fontsize=7)
    return figure


def rows(name: str, result: dict[str, Any]) -> list[list[Any]]:
    """The cheapest of each kind within 5 %, and the best of it."""
    out = []
    for cell, (_, _, words) in LOOKS.items():
        mine = [r for r in result["records"] if r["setting"]["cell"] == cell]
        good = [r for r in mine if r["error"] <= 0.05]
        best = min(mine, key=lambda r: r["error"], default=None)
        cheap = min(good, key=lambda r: r["seconds"], default=None)
        cells = ["", "", ""]
        if cheap is not None:
            cells = [cheap["name"], duration(cheap["seconds"]), f"{memory_of(cheap):.0f}"]
        out.append(
            [SPECIMENS[name].title, words, *cells, "" if best is None else percent(best["error"])]
        )
    return out


def main(out: Path, fine: bool = False) -> None:
    """Run the studies; three times the budget where a finer look is asked for."""
    if MPI.COMM_WORLD.size > 1:
        raise fx.InputError("this demo starts processes of its own; call it without mpirun")
    console = Console(width=118, highlight=False)
    results = {}
    for name in SPECIMENS:
        results[name] = run_study(name, budget=3.0 * BUDGET if fine else BUDGET, tell=console.print)
        report.show(results[name], console)
        report.write(results[name], out / name)
    head = ["specimen", "model", "within 5 %", "seconds", "MB", "best error of G"]
    table(
        "The cheapest of each kind", head,
        [row for name, result in results.items() for row in rows(name, result)],
    )  # fmt: skip
    save(MPI.COMM_SELF, out / "shell_accuracy.png", lambda: picture(results))


if __name__ == "__main__":
    main(*arguments(__doc__, "out/shell_accuracy"))
