"""The two pictures of a study: error against seconds, and cost against problem size."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter
from mpi4py import MPI

from fxcrack.accuracy.pareto import TARGETS
from fxcrack.accuracy.prediction import FIT_POINTS, FIT_RANGE
from fxcrack.accuracy.study import Setting
from fxcrack.base.arrays import Array
from fxcrack.output.plots.style import COLOURS, GREY, INK, LIGHT, new_figure, save

Result = dict[str, Any]

_COLOUR = {
    **{"quadrilateral": 0, "hexahedron": 0, "triangle": 2, "tetrahedron": 2},
    **{"continuum shell": 2, "shell": 4, "shell with compliant bonds": 1},
}
"""Colour of the first order of each shape, the next one that of the second."""
_PALETTE = (*COLOURS, "#8c6d1f")
_MARKERS = {
    **{"vcct": "o", "closure": "s", "domain": "v", "increment": "^", "solver": "D", "ranks": "h"},
}
_WORDS = {
    "vcct": "VCCT, events",
    "closure": "exact closure",
    "domain": "domain integral",
    "increment": "increments",
    "solver": "other solver",
    "ranks": "2 ranks",
}
_PHASES = {
    "setup": "mesh, spaces, pairing",
    "assemble": "assembly",
    "transform": "jump coordinates",
    "factor": "factorisation with S",
    "growth": "crack growth on S",
}
_FLOOR = 1e-6  # errors below are drawn there


def draw_error(result: Result, path: Path) -> None:
    """Error against seconds with the Pareto front, its points numbered; collective."""
    save(MPI.COMM_SELF, path, lambda: error_figure(result))


def draw_cost(result: Result, path: Path) -> None:
    """Seconds and memory against the number of dofs, with fitted powers; collective."""
    save(MPI.COMM_SELF, path, lambda: cost_figure(result))


# -- error against seconds -----------------------------------------------------------


def error_figure(result: Result) -> Figure:
    """See :func:`draw_error`."""
    records = result["records"]
    settings = [Setting(**r["setting"]) for r in records]
    x = np.array([r["seconds"] for r in records])
    y = np.maximum([r["error"] for r in records], _FLOOR)
    figure, ax = new_figure(8.2, 5.1)
    _logarithmic(ax, "seconds from mesh to result", "error")
    good = np.isfinite(y)
    _limits(ax, x[good], y[good])
    _targets(ax)
    _blur(ax, result["uncertainty"])
    lines: dict[Setting, list[int]] = {}
    for i, setting in enumerate(settings):
        lines.setdefault(setting.line, []).append(i)
    for line, places in lines.items():
        at = sorted(places, key=lambda i: -settings[i].size)
        ax.plot(x[at], y[at], color=_colour(line), linewidth=0.9, alpha=0.35, zorder=2)
        ax.plot(
            x[at], y[at], _MARKERS[_kind(line, settings[0])], color=_colour(line), markersize=5.5,
            alpha=0.6, markeredgewidth=0.0, linestyle="none", zorder=3,
        )  # fmt: skip
    front = result["pareto"]
    ax.step(x[front], y[front], where="post", color=INK, linewidth=1.4, zorder=4)
    for number, i in enumerate(front, 1):
        ax.plot(x[i], y[i], **_front_marker(settings[i], settings[0]), zorder=5)
        ax.text(
            x[i], y[i], str(number), fontsize=7.5, color="white", ha="center",
            va="center_baseline", fontweight="bold", zorder=6,
        )  # fmt: skip
    _explain(ax, settings, front, result["unit"])
    ax.set_title(
        f"{_sentence(result['title'])}\n",
        fontsize=11.5,
        color=INK,
        loc="left",
        pad=4,
        fontweight="bold",
    )
    ax.text(
        0.0, 1.015, _counted(result), transform=ax.transAxes, fontsize=9.5, color=GREY,
        va="bottom",
    )  # fmt: skip
    return figure


def _counted(result: Result) -> str:
    """Of what the error is and where it is counted from."""
    source = result["reference"]["source"].partition(":")[0]
    if result["measure"] != "worst":
        return f"error of {result['measure']}, counted from {source}"
    names = {"load": "critical load", "G": "G", "length": "crack length"}
    found = [words for name, words in names.items() if name in result["reference"]["values"]]
    what = f"largest error of {', '.join(found[:-1])} and {found[-1]}" if found[1:] else found[0]
    return f"{what}, counted from {source}"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _kind(setting: Setting, base: Setting) -> str:
    if setting.ranks != base.ranks:
        return "ranks"
    if setting.solver != base.solver:
        return "solver"
    if setting.stepping == "increment":
        return "increment"
    return setting.method


def _colour(setting: Setting) -> str:
    return _PALETTE[setting.order - 1 + _COLOUR[setting.cell]]


def _logarithmic(ax: Axes, xlabel: str, ylabel: str) -> None:
    ax.set_xscale("log")
    ax.set_yscale("log")
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set(linewidth=0.8, color=GREY)
    ax.tick_params(which="both", labelsize=9.5, width=0.8, color=GREY, labelcolor=INK)
    ax.grid(which="major", color=LIGHT, linewidth=0.8)
    ax.set_axisbelow(True)
    ax.set_xlabel(xlabel, fontsize=10.5, color=INK, labelpad=5)
    ax.set_ylabel(ylabel, fontsize=10.5, color=INK, labelpad=5)
    ax.xaxis.set_major_formatter(FuncFormatter(_plain))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_minor_formatter(NullFormatter())
    if ylabel == "error":
        ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{100.0 * v:g} %"))
    else:
        ax.yaxis.set_major_formatter(FuncFormatter(_plain))


def _plain(value: float, _: Any = None) -> str:
    return f"{value:,.0f}" if value >= 1e3 else f"{value:g}"


def _limits(ax: Axes, x: Array, y: Array) -> None:
    """A margin around the points, in decades; the reference's uncertainty is named at the foot."""
    for values, setter, below in ((x, ax.set_xlim, 0.15), (y, ax.set_ylim, 0.3)):
        low, high = np.log10(values.min()), np.log10(values.max())
        setter(10 ** (low - below), 10 ** (high + 0.15))


def _targets(ax: Axes) -> None:
    low, high = ax.get_ylim()
    for target in TARGETS:
        if low < target < high:
            ax.axhline(target, color=COLOURS[4], linewidth=0.9, linestyle=(0, (5, 4)), zorder=1)
            ax.annotate(
                f"{100.0 * target:g} %", (1.0, target), xycoords=("axes fraction", "data"),
                xytext=(4, 0), textcoords="offset points", va="center", fontsize=9.5,
                color=COLOURS[4],
            )  # fmt: skip


def _blur(ax: Axes, uncertainty: float) -> None:
    low, _ = ax.get_ylim()
    if uncertainty > low:
        ax.axhspan(low, uncertainty, color=LIGHT, alpha=0.6, linewidth=0.0, zorder=0)
        ax.annotate(
            "grey: the reference is not known better", (1.0, 0.0), xycoords="axes fraction",
            xytext=(-4, 4), textcoords="offset points", ha="right", va="bottom", fontsize=8.5,
            color=GREY,
        )  # fmt: skip


def _front_marker(setting: Setting, base: Setting) -> dict[str, Any]:
    """How a point of the front is drawn, large enough for its number."""
    return {
        "marker": _MARKERS[_kind(setting, base)], "color": _colour(setting), "markersize": 12.0,
        "markeredgecolor": INK, "markeredgewidth": 1.2, "linestyle": "none",
    }  # fmt: skip


def _explain(ax: Axes, settings: list[Setting], front: list[int], unit: str) -> None:
    """Beside the axes: what colours and shapes of points mean, and which settings are the front."""
    handles = [Line2D([], [], color=INK, linewidth=1.4, label="nothing faster is better")]
    seen = {_colour(s): s for s in reversed(settings)}
    for colour in _PALETTE:
        if colour in seen:
            name = f"{seen[colour].title.partition(',')[0]}s".replace("hexs", "hexes")
            handles.append(
                Line2D([], [], color=colour, marker="o", markersize=6, linewidth=0.9, label=name)
            )
    kinds = {_kind(s, settings[0]) for s in settings}
    for kind, marker in _MARKERS.items():
        if kind in kinds:
            handles.append(
                Line2D(
                    [], [], color=GREY, marker=marker, markersize=6, linestyle="none",
                    label=_WORDS[kind],
                )
            )  # fmt: skip
    for number, i in enumerate(front, 1):
        words = f"{number}  {settings[i].title}, {settings[i].size:g} {unit}".rstrip()
        look = _front_marker(settings[i], settings[0]) | {"markersize": 8.0}
        handles.append(Line2D([], [], **look, label=words))
    ax.legend(
        handles=handles, frameon=False, fontsize=9, labelcolor=INK, loc="upper left",
        bbox_to_anchor=(1.1, 1.0), borderaxespad=0.0,
    )  # fmt: skip


# -- cost against size ---------------------------------------------------------------


def cost_figure(result: Result) -> Figure:
    """See :func:`draw_cost`."""
    records = result["records"]
    settings = [Setting(**r["setting"]) for r in records]
    lines: dict[str, list[int]] = {}
    for i, setting in enumerate(settings):
        if setting.line.title in result["exponents"]:
            lines.setdefault(setting.line.title, []).append(i)
    figure = Figure(figsize=(10.4, 4.3), dpi=160, layout="constrained", facecolor="white")
    left, right = figure.subplots(1, 2)
    _logarithmic(left, "dofs", "seconds")
    _logarithmic(right, "dofs", "MB")
    largest = max(lines, key=lambda k: max(records[i]["dofs"] for i in lines[k]), default=None)
    if largest is None:
        return figure
    at = sorted(lines[largest], key=lambda i: records[i]["dofs"])
    dofs = np.array([records[i]["dofs"] for i in at], dtype=float)
    fits = result["exponents"][largest]
    whole = np.array([records[i]["seconds"] for i in at])
    _series(left, dofs, whole, fits.get("seconds"), "all", INK, 2.0)
    for colour, (phase, name) in zip(COLOURS, _PHASES.items(), strict=True):
        values = np.array([records[i]["phases"].get(phase, 0.0) for i in at])
        if values.max(initial=0.0) > 0.02 * whole.max():
            _series(left, dofs, values, fits.get(phase), name, colour, 1.3)
    figure.suptitle(
        f"{_sentence(result['title'])}: cost against size", fontsize=11.5, color=INK, x=0.01,
        ha="left", fontweight="bold",
    )  # fmt: skip
    left.set_title(f"time by phase, {largest}", fontsize=10.5, color=GREY, loc="left", pad=6)
    left.legend(frameon=False, fontsize=8.5, labelcolor=INK, loc="upper left")
    shown = 0
    for title, places in lines.items():
        setting = settings[places[0]]
        if setting.method != settings[0].method or shown >= len(COLOURS):
            continue
        at = sorted(places, key=lambda i: records[i]["dofs"])
        dofs = np.array([records[i]["dofs"] for i in at], dtype=float)
        memory = np.array([max(records[i]["memory"].values(), default=0.0) for i in at])
        fit = result["exponents"][title].get("memory")
        _series(right, dofs, memory, fit, title, _colour(setting), 1.3)
        shown += 1
    right.set_title(
        "peak memory, that of Python and libraries apart", fontsize=10.5, color=GREY, loc="left",
        pad=6,
    )  # fmt: skip
    right.legend(frameon=False, fontsize=8.5, labelcolor=INK, loc="upper left")
    for ax in (left, right):  # room for the legend
        low, high = ax.get_ylim()
        ax.set_ylim(low, high * (high / low) ** 0.35)
    return figure


def _series(
    ax: Axes, x: Array, y: Array, fit: dict[str, float] | None, name: str, colour: str, width: float
) -> None:
    """Points, and the fitted power through the largest of them."""
    label = name if fit is None else f"{name}: n$^{{{fit['exponent']:.2f}}}$"
    good = y > 0.0
    ax.plot(x[good], y[good], "o", color=colour, markersize=4.5, zorder=3)
    if fit is None:
        ax.plot([], [], "o-", color=colour, markersize=4.5, label=label)
        return
    fitted = x[x >= x.max() / 10**FIT_RANGE][-FIT_POINTS:]
    ends = fitted[[0, -1]]
    ax.plot(ends, fit["factor"] * ends ** fit["exponent"], color=colour, linewidth=width, zorder=2)
    ax.plot([], [], "o-", color=colour, markersize=4.5, linewidth=width, label=label)
