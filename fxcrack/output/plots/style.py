"""How every plot looks, and how it gets on disk: rank 0 draws and writes, all ranks agree.

Figures are made without pyplot, so no global state, no window and no backend is touched.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpi4py import MPI

from fxcrack.base.files import replacing
from fxcrack.base.parallel import all_or_none

DPI = 160
INK = "#1f2430"
GREY = "#8b929e"
LIGHT = "#e6e9ee"
COLOURS = ("#1b5e9e", "#d8611a", "#2a8f6a", "#7a4fa3", "#b8336a")


class NotebookFigure(Figure):
    """A figure that notebooks show as a picture, although pyplot does not know of it."""

    def _repr_png_(self) -> bytes:
        """The picture."""
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=0.6 * DPI)
        return stream.getvalue()


def new_figure(
    width: float = 6.4, height: float = 4.2, ax: Axes | None = None
) -> tuple[Figure, Axes]:
    """A figure of a size in inches with one pair of axes, or the axes given and their figure."""
    if ax is not None:
        figure = ax.figure
        while not isinstance(figure, Figure):  # axes of a subfigure
            figure = figure.figure
        return figure, ax
    figure = NotebookFigure(
        figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white"
    )
    return figure, figure.add_subplot()


def dress(ax: Axes, *, xlabel: str, ylabel: str, title: str | None = None) -> None:
    """Thin spines, labelled axes, a faint grid."""
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set(linewidth=0.8, color=GREY)
    ax.tick_params(labelsize=10, width=0.8, length=3.5, color=GREY, labelcolor=INK)
    ax.grid(color=LIGHT, linewidth=0.8)
    ax.set_axisbelow(True)
    ax.locator_params(nbins=8)
    ax.set_xlabel(xlabel, fontsize=11, color=INK, labelpad=6)
    ax.set_ylabel(ylabel, fontsize=11, color=INK, labelpad=6)
    if title:
        ax.set_title(title, fontsize=12, color=INK, loc="left", pad=10)


def legend(ax: Axes, **where: Any) -> None:
    """A legend without a frame around it, if there is anything to explain."""
    if ax.get_legend_handles_labels()[1] or "handles" in where:
        ax.legend(frameon=False, fontsize=10, labelcolor=INK, **where)


def colour_bar(
    figure: Figure, ax: Axes, mappable: Any, label: str, *, below: bool = False, **options: Any
) -> None:
    """A slim colour bar on the right, as high as the axes, or below them."""
    if below:
        bar = figure.colorbar(
            mappable, ax=ax, location="bottom", shrink=0.5, aspect=36, pad=0.03, **options
        )
    else:
        share = 0.15 / (figure.get_figwidth() - 1.5)
        cax = ax.inset_axes((1.0 + share, 0.0, share, 1.0))
        bar = figure.colorbar(mappable, cax=cax, **options)
    bar.outline.set(linewidth=0.6, edgecolor=GREY)
    bar.ax.tick_params(labelsize=9, width=0.6, length=3, color=GREY, labelcolor=INK)
    bar.set_label(label, fontsize=10, color=INK)


def from_zero(ax: Axes) -> None:
    """Let axes begin at zero whose data are nowhere negative, nor all far from it."""
    (x, y), (right, top) = ax.dataLim.min, ax.dataLim.max
    if -1e-9 * abs(right) <= x <= 0.5 * right:
        ax.set_xlim(left=0.0)
    if -1e-9 * abs(top) <= y <= 0.5 * top:
        ax.set_ylim(bottom=0.0)


def save(comm: MPI.Comm, path: str | Path | None, draw: Callable[[], Figure]) -> Figure | None:
    """Draw on rank 0 and write the file whole; collective.

    Args:
        comm: Communicator on which all ranks call.
        path: Picture file; its ending (.png, .pdf, .svg) names the format. ``None`` writes none.
        draw: Makes the figure; called on rank 0 only.

    Returns:
        The figure on rank 0, ``None`` on the others.

    Raises:
        FxcrackError: Drawing or writing failed; an older file is still there.
    """
    figure = None
    with all_or_none(comm, "plotting" if path is None else f"plotting '{path}'"):
        if comm.rank == 0:
            figure = draw()
            if path is not None:
                with replacing(path) as temporary:
                    figure.savefig(temporary, dpi=DPI)
    return figure
