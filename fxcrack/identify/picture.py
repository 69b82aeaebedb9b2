"""Measured points and fitted curves in one picture."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fxcrack.base.arrays import Array
from fxcrack.output.plots.style import COLOURS, INK, dress, from_zero, legend, new_figure

Series = tuple[str, Array, Array, Array, Array]
"""Name, measured opening and load, predicted opening and load."""


def draw_fit(
    series: Sequence[Series],
    words: str,
    *,
    xlabel: str = "opening",
    ylabel: str = "load",
    title: str | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draw each test in a colour: its points, and the curve of the fitted parameters.

    Args:
        series: The tests.
        words: What was found, written into the picture.
        xlabel: Label of the axis of openings, with the unit.
        ylabel: Label of the axis of loads, with the unit.
        title: Title.
        ax: Axes to draw into; a new figure by default.
    """
    figure, axes = new_figure(ax=ax)
    for i, (name, x, y, u, p) in enumerate(series):
        colour = COLOURS[i % len(COLOURS)]
        axes.plot(x, y, "o", ms=3.5, mfc="none", color=colour, label=f"{name}, measured")
        shown = u <= 1.1 * x.max()
        axes.plot(u[shown], p[shown], color=colour, lw=1.6, label=f"{name}, fitted")
    dress(axes, xlabel=xlabel, ylabel=ylabel, title=title)
    from_zero(axes)
    note = "\n".join(words.splitlines()[:-1])
    axes.text(0.98, 0.03, note, transform=axes.transAxes, ha="right", fontsize=9, color=INK)
    legend(axes)
    return figure
