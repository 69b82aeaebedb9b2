"""The two pictures of a study: error against seconds, and cost against problem size."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter
from mpi4py import MPI

from fxcrack.accuracy.fit import FIT_POINTS, FIT_RANGE
from fxcrack.accuracy.labels import Box, nearest, place
from fxcrack.accuracy.pareto import TARGETS
from fxcrack.accuracy.study import Setting
from fxcrack.base.arrays import Array
from fxcrack.output.plots.style import COLOURS, GREY, INK, LIGHT, new_figure, save

Result = dict[str, Any]

_SHAPES = (("quadrilateral", "hexahedron"), ("triangle", "tetrahedron"))
_MARKERS = {"vcct": "o", "closure": "s", "increment": "^", "solver": "D", "ranks": "P"}
_WORDS = {
    "vcct": "VCCT, events",
    "closure": "exact closure",
    "increment": "increments",
    "solver": "other solver",
    "ranks": "2 ranks",
}
_PHASES = {
    "setup": "mesh, spaces, pairing",
    "assemble": "assembly",
    "transform": "jump coordinates",
    "factor": "factorisation with S",
    "march": "crack growth on S",
}
_FLOOR = 1e-6  # errors below are drawn there


def draw_error(result: Result, path: Path) -> None:
    """Error against seconds with the Pareto front, each of its points labelled; collective."""
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
    _limits(ax, x[good], y[good], left=0.3)
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
    for i in front:
        ax.plot(
            x[i], y[i], _MARKERS[_kind(settings[i], settings[0])], color=_colour(settings[i]),
            markersize=9.0, markeredgecolor=INK, markeredgewidth=1.2, zorder=5,
        )  # fmt: skip
    _explain(ax, settings)
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
    unit = f" {result['unit']}" if result["unit"] else ""
    texts = [f"{settings[i].title}, {settings[i].size:g}{unit}" for i in front]
    corners = np.repeat(np.column_stack([x[front], y[front]]), 2, axis=0)
    corners[1:-1:2, 0] = x[front][1:]  # the front goes right, then down
    right = ax.get_xlim()[1]
    targets = [np.array([[right * 1e-9, t], [right, t]]) for t in TARGETS]
    _label(
        figure, ax, np.column_stack([x[front], y[front]]), texts, np.column_stack([x, y])[good],
        [corners, *targets],
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
    simplex = setting.cell in _SHAPES[1]
    return COLOURS[(setting.order - 1) + 2 * int(simplex)]


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


def _limits(ax: Axes, x: Array, y: Array, *, left: float) -> None:
    """Room below and to the left of the points, in decades, where labels go."""
    low, high = np.log10(x.min()), np.log10(x.max())
    ax.set_xlim(10 ** (low - left), 10 ** (high + 0.15))
    low, high = np.log10(y.min()), np.log10(y.max())
    ax.set_ylim(10 ** (low - 0.45), 10 ** (high + 0.15))


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


def _explain(ax: Axes, settings: list[Setting]) -> None:
    """What colours and shapes of points mean, beside the axes."""
    handles = [Line2D([], [], color=INK, linewidth=1.4, label="nothing faster is better")]
    seen = {_colour(s): s for s in reversed(settings)}
    for colour in COLOURS:
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
    ax.legend(
        handles=handles, frameon=False, fontsize=9, labelcolor=INK, loc="upper left",
        bbox_to_anchor=(1.08, 1.0), borderaxespad=0.0,
    )  # fmt: skip


def _label(
    figure: Figure, ax: Axes, anchors: Array, texts: list[str], points: Array, paths: list[Array]
) -> None:
    """Write a label beside each anchor, with a line to it, off points and paths."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    figure.set_layout_engine("none")  # the places found below belong to this layout
    renderer = canvas.get_renderer()
    trial = [ax.text(0.5, 0.5, t, fontsize=8.5, transform=ax.transAxes) for t in texts]
    sizes = []
    for text in trial:
        box = text.get_window_extent(renderer)
        sizes.append((box.width, box.height))
        text.remove()
    frame = ax.get_window_extent(renderer)
    _make_room(ax, anchors[:, 0], [(width + 45.0) / frame.width for width, _ in sizes])
    bounds: Box = (frame.x0 + 4, frame.y0 + 4, frame.x1 - 2, frame.y1 - 2)
    at = ax.transData.transform(anchors)
    pixels = [ax.transData.transform(path) for path in paths]
    segments = [(a, b) for path in pixels for a, b in itertools.pairwise(path)]
    placed = place(
        at, sizes, bounds, points=ax.transData.transform(points), segments=segments, radius=8.0,
        scale=figure.dpi / 100.0,
    )  # fmt: skip
    back = ax.transAxes.inverted()
    for anchor, where, words in zip(at, placed, texts, strict=True):
        x, y = back.transform((0.5 * (where[0] + where[2]), 0.5 * (where[1] + where[3])))
        ends = back.transform(np.array([anchor, nearest(where, anchor)]))
        ax.plot(*ends.T, color=GREY, linewidth=0.7, transform=ax.transAxes, zorder=4.5)
        ax.text(
            x, y, words, fontsize=8.5, color=INK, ha="center", va="center",
            transform=ax.transAxes, zorder=6,
            path_effects=[patheffects.withStroke(linewidth=2.5, foreground="white")],
        )  # fmt: skip


def _make_room(ax: Axes, x: Array, shares: list[float]) -> None:
    """Move the left end so that a label of some share of the width fits left of each x."""
    low, high = np.log10(ax.get_xlim())
    at = np.log10(x)
    for middle, share in zip(at, shares, strict=True):
        # (place - low)/(high - low) >= share
        low = min(low, float((middle - share * high) / (1.0 - share)))
    ax.set_xlim(10**low, 10**high)


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
