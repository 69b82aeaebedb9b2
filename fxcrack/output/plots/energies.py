"""Energies of an analysis against time: supplied, stored, released, dissipated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fxcrack.base.errors import InputError
from fxcrack.history import History
from fxcrack.output.plots.style import COLOURS, dress, legend, new_figure, save

WORDS = {
    "external_work": "work of loads and supports",
    "initial_kinetic_energy": "kinetic energy at the start",
    "overlap_energy": "supplied to overlapping faces",
    "strain_energy": "strain energy",
    "kinetic_energy": "kinetic energy",
    "released_energy": "energy released by growth",
    "friction_energy": "dissipated by friction",
    "plastic_energy": "dissipated by yielding",
    "viscous_energy": "dissipated by viscosity",
    "damping_energy": "dissipated by damping",
}
"""Columns of a history that are drawn, and what a legend calls them. `snap_energy` is part of the
energy released by growth."""


def energies(
    history: History,
    path: str | Path | None = None,
    *,
    xlabel: str = "Time",
    ylabel: str = "Energy",
    title: str | None = None,
    ax: Axes | None = None,
) -> Figure | None:
    """Plot the energies of a history against time; collective.

    Args:
        history: The history.
        path: Picture file (.png, .pdf, .svg), or ``None`` for none.
        xlabel: What x is and its unit.
        ylabel: What y is and its unit.
        title: Heading.
        ax: Axes to draw into, those of a new figure by default; needed on rank 0 only.

    Returns:
        The figure on rank 0, ``None`` on the others.

    Raises:
        InputError: The history has no rows.
        FxcrackError: The file could not be written.
    """
    if not len(history):
        raise InputError("the history has no rows, so there are no energies to plot")
    names = [n for n in WORDS if n in history.columns]
    largest = max(float(np.nanmax(np.abs(history[n].astype(float)), initial=0.0)) for n in names)

    def draw() -> Figure:
        figure, axes = new_figure(ax=ax)
        time, styles = history["time"].astype(float), ("-", "--", "-.", ":")
        shown = 0
        for name in names:
            values = history[name].astype(float)
            if np.nanmax(np.abs(values), initial=0.0) > 1e-3 * largest:
                style = styles[shown // len(COLOURS) % len(styles)]
                colour = COLOURS[shown % len(COLOURS)]
                axes.plot(time, values, style, color=colour, linewidth=1.6, label=WORDS[name])
                shown += 1
        dress(axes, xlabel=xlabel, ylabel=ylabel, title=title)
        legend(axes)
        return figure

    return save(history.comm, path, draw)


__all__ = ["WORDS", "energies"]
