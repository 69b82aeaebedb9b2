"""Plots of fatigue growth: da/dN against dG, and crack length against cycles."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError
from fxcrack.history import History
from fxcrack.interface.definition import Interface
from fxcrack.output.plots.style import COLOURS, dress, legend, new_figure, save


@dataclass(frozen=True)
class TipGrowth:
    """Growth of the tips of one interface, one value per tip and stabilised cycle.

    Attributes:
        N: Cycles, shape (n,).
        a: Crack length of the tip in 2-D, mean of the front in 3-D, shape (n,), length.
        dG: Range of the total rate over the cycle, shape (n,), force/length.
        dadN: Growth per cycle, shape (n,), length.
        node: Slave node of the tip, shape (n,).
    """

    N: Array
    a: Array
    dG: Array
    dadN: Array
    node: Ints


def tip_growth(history: History, interface: Interface | str) -> TipGrowth:
    """What the tips of an interface did in the cycles of an analysis.

    Args:
        history: The history.
        interface: Interface or its name.

    Raises:
        InputError: There were no cycles, or none in which this interface grew.
    """
    name = interface if isinstance(interface, str) else interface.title
    table = history.details.get("tips")
    if not table:
        raise InputError("the history has no cycles; run fx.Cycles(...) first")
    of = np.array(table["interface"]) == name
    if not of.any():
        known = ", ".join(f"'{n}'" for n in dict.fromkeys(table["interface"]))
        raise InputError(f"interface '{name}' has no tips in the cycles; those with are {known}")
    columns = {k: np.array(table[k], dtype=float)[of] for k in ("N", "a", "dG", "dadN")}
    return TipGrowth(**columns, node=np.array(table["node"], dtype=np.int64)[of])


def paris(
    history: History,
    path: str | Path | None,
    interface: Interface | str,
    *,
    show: Literal["rate", "length"] = "rate",
    xlabel: str | None = None,
    ylabel: str | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Figure | None:
    """Plot da/dN against dG, or the crack length against cycles, of all tips; collective.

    Args:
        history: The history.
        path: Picture file (.png, .pdf, .svg), or ``None`` for none.
        interface: Interface or its name.
        show: "rate", both axes logarithmic; or "length".
        xlabel: What x is and its unit.
        ylabel: What y is and its unit.
        title: Heading.
        ax: Axes to draw into, those of a new figure by default; needed on rank 0 only.

    Returns:
        The figure on rank 0, ``None`` on the others.

    Raises:
        InputError: ``show`` is unknown, or the history has no cycles of the interface.
        FxcrackError: The file could not be written.
    """
    if show not in ("rate", "length"):
        raise InputError(f"paris: show = '{show}', choose 'rate' or 'length'")
    data = tip_growth(history, interface)

    def draw() -> Figure:
        figure, axes = new_figure(ax=ax)
        if show == "rate":
            on = (data.dG > 0.0) & (data.dadN > 0.0)
            axes.plot(data.dG[on], data.dadN[on], "o", markersize=4.0, color=COLOURS[0])
            dress(
                axes,
                xlabel=xlabel or "Range of the energy release rate $\\Delta G$",
                ylabel=ylabel or "Growth per cycle d$a$/d$N$",
                title=title,
            )
            if on.any():
                axes.set(xscale="log", yscale="log")
            return figure
        axes.plot(data.N, data.a, "o-", markersize=4.0, color=COLOURS[0], linewidth=1.6)
        dress(axes, xlabel=xlabel or "Cycles $N$", ylabel=ylabel or "Crack length", title=title)
        legend(axes)
        return figure

    return save(history.comm, path, draw)
