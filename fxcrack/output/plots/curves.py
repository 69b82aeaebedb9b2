"""Plots of an analysis: load against opening, R-curve, front advance, deformed mesh.

Every function is collective: all ranks gather the data, rank 0 draws and writes the file. What is
drawn comes from functions that return it as arrays. The last two plots have modules of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError, unknown_name
from fxcrack.history import History
from fxcrack.interface.definition import Interface
from fxcrack.output.plots.style import (
    COLOURS,
    GREY,
    INK,
    dress,
    from_zero,
    legend,
    new_figure,
    save,
)

__all__ = ["growth_rows", "load_curve", "load_opening", "r_curve", "resistance"]

Column = str | npt.ArrayLike
"""A column of a history by name, or an array with one value per row."""
Reference = Sequence[tuple[str, npt.ArrayLike, npt.ArrayLike]]
"""Curves to compare with: label, x, y."""


def _title(interface: Interface | str) -> str:
    return interface if isinstance(interface, str) else interface.title


def growth_rows(history: History, interface: Interface | str | None = None) -> Ints:
    """Rows just before nodes were released: the states at which a crack grew.

    Args:
        history: The history.
        interface: Which interface; any of them by default.

    Returns:
        Row numbers, increasing, shape (n,).
    """
    columns = [c for c in history.columns if c.startswith("released[")]
    if interface is not None:
        columns = [f"released[{_title(interface)}]"]
    rows = [np.flatnonzero(np.diff(history[c].astype(float)) > 0.0) for c in columns]
    return np.unique(np.concatenate(rows)) if rows else np.zeros(0, dtype=np.int64)


# -- load against opening --------------------------------------------------------------------------


@dataclass(frozen=True)
class LoadCurve:
    """What a load-opening plot shows.

    Attributes:
        x: Opening, shape (n_rows,).
        y: Load, shape (n_rows,).
        xlabel: What x is.
        ylabel: What y is.
        onset: Row at which the crack begins to grow, ``None`` if it does not.
    """

    x: Array
    y: Array
    xlabel: str
    ylabel: str
    onset: int | None


def load_curve(history: History, x: Column | None = None, y: Column | None = None) -> LoadCurve:
    """Choose the columns of a load-opening plot.

    Args:
        history: The history.
        x: Column; by default the first prescribed displacement that moves, else the displacement
            of the first load, absolute values.
        y: Column; by default the reaction or load that belongs to it, absolute values.

    Raises:
        InputError: A column is unknown or has the wrong length, or there is none to choose.
    """
    rows = growth_rows(history)
    names = history.columns
    moving = [c for c in names if c.startswith("u[") and f"R{c[1:]}" in names]
    loads = [c for c in names if c.startswith("F[")]
    if (x is None or y is None) and not (moving or loads):
        raise InputError("the history has no displacement or load to plot; name columns x and y")
    if moving:
        title = moving[0][2:-1]
        own = (moving[0], f"R[{title}]", f"Displacement {title}", f"Reaction {title}")
    elif loads:
        title = loads[0][2:-1]
        own = (f"v[{title}]", loads[0], f"Displacement of load {title}", f"Load {title}")
    else:
        own = ("", "", "", "")

    def values(chosen: Column | None, default: str, label: str) -> tuple[Array, str]:
        if chosen is None:
            return np.abs(history[default].astype(float)), label
        if isinstance(chosen, str):
            return history[chosen].astype(float), chosen
        found = np.asarray(chosen, dtype=float)
        if found.shape != (len(history),):
            raise InputError(
                f"an array of shape {found.shape} cannot be plotted over the {len(history)} rows "
                "of the history; give one value per row"
            )
        return found, ""

    (xs, xlabel), (ys, ylabel) = values(x, own[0], own[2]), values(y, own[1], own[3])
    return LoadCurve(xs, ys, xlabel, ylabel, int(rows[0]) if len(rows) else None)


def load_opening(
    history: History,
    path: str | Path | None = None,
    *,
    x: Column | None = None,
    y: Column | None = None,
    reference: Reference | None = None,
    xlabel: str | None = None,
    ylabel: str | None = None,
    label: str = "computed",
    title: str | None = None,
    ax: Axes | None = None,
) -> Figure | None:
    """Plot load against opening; collective.

    Args:
        history: The history.
        path: Picture file (.png, .pdf, .svg), or ``None`` for none.
        x: Column or array; see :func:`load_curve` for the default.
        y: Column or array.
        reference: Curves to compare with: (label, x, y) each.
        xlabel: What x is and its unit.
        ylabel: What y is and its unit.
        label: What the legend calls the computed curve.
        title: Heading.
        ax: Axes to draw into, those of a new figure by default; needed on rank 0 only.

    Returns:
        The figure on rank 0, ``None`` on the others.

    Raises:
        InputError: The columns do not exist.
        FxcrackError: The file could not be written.
    """
    curve = load_curve(history, x, y)

    def draw() -> Figure:
        figure, axes = new_figure(ax=ax)
        width = 2.0 if len(curve.x) <= 60 else 1.4  # every release is a drop of the load
        axes.plot(curve.x, curve.y, color=COLOURS[0], linewidth=width, label=label, zorder=3)
        if curve.onset is not None:
            at = curve.x[curve.onset], curve.y[curve.onset]
            name = f"crack starts to grow ({at[0]:.4g}, {at[1]:.4g})"
            axes.plot(
                *at, "o", markersize=7, color="white", markeredgecolor=COLOURS[0],
                markeredgewidth=1.8, label=name, zorder=4,
            )  # fmt: skip
        for i, (name, rx, ry) in enumerate(reference or ()):
            style = ("--", "-.", ":")[i % 3]
            axes.plot(rx, ry, style, color=COLOURS[1 + i % 4], linewidth=1.6, label=name, zorder=5)
        dress(axes, xlabel=xlabel or curve.xlabel, ylabel=ylabel or curve.ylabel, title=title)
        from_zero(axes)
        legend(axes)
        return figure

    return save(history.comm, path, draw)


# -- R-curve ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Resistance:
    """What an R-curve shows, one entry per release.

    Attributes:
        length: Crack length, shape (n,), length.
        rates: G I, II, III at the critical front node, shape (n, 3), force/length; NaN if the
            criterion does not report them.
        f: Criterion there, shape (n,).
        onset: Whether the load changed since the release before: growth that runs on at one load
            is no equilibrium, its G may lie anywhere, shape (n,).
    """

    length: Array
    rates: Array
    f: Array
    onset: npt.NDArray[np.bool_]


def resistance(history: History, interface: Interface | str) -> Resistance:
    """Crack length, G and f in the states just before each release.

    Raises:
        InputError: The history knows no such interface.
    """
    title = _title(interface)
    if f"a[{title}]" not in history.columns:
        known = [c[2:-1] for c in history.columns if c.startswith("a[")]
        unknown_name("debonding interface in the history:", title, known)
    rows = growth_rows(history, interface)
    if not len(rows):
        return Resistance(np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros(0, dtype=bool))
    names = [f"{name}[{title}]" for name in ("a", "f", "GI", "GII", "GIII")]
    length, f, *rates = (
        history[c][rows].astype(float) if c in history.columns else np.full(len(rows), np.nan)
        for c in names
    )
    onset = np.diff(history["time"][rows], prepend=np.nan) != 0.0
    return Resistance(length, np.stack(rates, axis=1), f, onset)


def r_curve(
    history: History,
    path: str | Path | None,
    interface: Interface | str,
    toughness: float | Callable[[Array], npt.ArrayLike] | None = None,
    *,
    quantity: str = "G",
    xlabel: str = "Crack length",
    ylabel: str | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Figure | None:
    """Plot G (or f) at which the crack grew against its length; collective.

    Args:
        history: The history.
        path: Picture file (.png, .pdf, .svg), or ``None`` for none.
        interface: Interface or its name.
        toughness: Critical G to compare with [force/length], a number or a function of crack length
            [length], shape (n,) -> (n,).
        quantity: "G" or "f".
        xlabel: What x is and its unit.
        ylabel: What y is and its unit.
        title: Heading.
        ax: Axes to draw into, those of a new figure by default; needed on rank 0 only.

    Returns:
        The figure on rank 0, ``None`` on the others.

    Raises:
        InputError: The history knows no such interface, or not the quantity.
        FxcrackError: The file could not be written.
    """
    if quantity not in ("G", "f"):
        raise InputError(f"r_curve: quantity = '{quantity}', choose 'G' or 'f'")
    data = resistance(history, interface)
    if quantity == "G" and np.isnan(data.rates).any():
        raise InputError(
            f"the criterion of interface '{_title(interface)}' reports no energy release rates; "
            "plot quantity='f'"
        )
    meaning = {"G": "Energy release rate at growth", "f": "Criterion f at growth"}

    def draw() -> Figure:
        figure, axes = new_figure(ax=ax)
        some, many = data.onset, not data.onset.all()

        def curve(y: Array, label: str, colour: str, width: float) -> None:
            if many:
                axes.plot(data.length, y, color=colour, linewidth=0.7, alpha=0.35, zorder=2)
            marker = "o" if some.sum() <= 40 else ""
            axes.plot(
                data.length[some], y[some], marker=marker, markersize=4.0, color=colour,
                linewidth=width, label=label, zorder=3,
            )  # fmt: skip

        if quantity == "f":
            curve(data.f, "f", COLOURS[0], 2.0)
            axes.axhline(1.0, color=INK, linewidth=1.2, linestyle="--", label="f = 1", zorder=4)
        else:
            total = data.rates.sum(axis=1)
            names = ["$G_\\mathrm{I}$", "$G_\\mathrm{II}$", "$G_\\mathrm{III}$"]
            largest = np.abs(data.rates).max(axis=0, initial=0.0)
            modes = np.flatnonzero(largest > 0.01 * np.abs(total).max(initial=0.0))
            alone = len(modes) == 1
            curve(total, f"$G$ = {names[modes[0]]}" if alone else "$G$", COLOURS[0], 2.0)
            for i in [] if alone else modes:
                curve(data.rates[:, i], names[i], COLOURS[2 + i], 1.4)
            if toughness is not None:
                x = data.length if len(data.length) else np.array([0.0, 1.0])
                y = toughness(x) if callable(toughness) else np.full(len(x), float(toughness))
                axes.plot(x, y, "--", color=COLOURS[1], linewidth=1.6, label="toughness", zorder=4)
        if many:
            axes.plot([], [], color=GREY, linewidth=0.7, label="growth running on at one load")
        dress(axes, xlabel=xlabel, ylabel=ylabel or meaning[quantity], title=title)
        axes.set_ylim(bottom=min(0.0, axes.dataLim.y0), top=1.12 * axes.dataLim.y1)
        legend(axes, loc="best")
        return figure

    return save(history.comm, path, draw)
