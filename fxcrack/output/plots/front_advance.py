"""The advance of a crack front: a plane interface seen from above, coloured by when it opened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.tri import Triangulation

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import InputError, unknown_name
from fxcrack.interface.definition import Interface
from fxcrack.output.plots.style import GREY, INK, LIGHT, colour_bar, dress, new_figure, save
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of

_INITIAL = "#c3c9d3"
_SEAMLESS: dict[str, Any] = {"linewidths": 0.3, "edgecolors": "face"}

# facets as four-sided or three-sided pieces between neighbouring nodes, basix order
_PIECES = {
    ("triangle", 1): ((0, 1, 2),),
    ("quadrilateral", 1): ((0, 1, 3, 2),),
    ("quadrilateral", 2): ((0, 4, 8, 5), (4, 1, 6, 8), (5, 8, 7, 2), (8, 6, 3, 7)),
}


@dataclass(frozen=True)
class ReleaseMap:
    """An interface seen from above, and when its nodes were released.

    The crack reaches up to its bonded front nodes. So a triangle between two nodes and the centre
    of a facet is open when one of its corners is; the centre counts as open when two nodes of the
    facet are. A facet cut by the front is then half open, as in the crack area of the history.

    Attributes:
        points: Slave nodes, then centres of facets, in the plane of the picture, shape
            (n_points, 2), length.
        axes: Names of the two directions.
        triangles: Corners of each triangle, shape (n_triangles, 3).
        order: Order of release of each point from 1, 0 initially open, inf bonded, (n_points,).
        times: Time of each release, after the 0 of the initial crack, shape (n_released + 1,).
    """

    points: Array
    axes: tuple[str, str]
    triangles: Ints
    order: Array
    times: Array

    def opened(self) -> Array:
        """Order of release at which each triangle opened, inf if bonded, shape (n_triangles,)."""
        return np.asarray(self.order[self.triangles].min(axis=1))


def release_map(
    source: Analysis | HasAnalysis,
    interface: Interface | str,
    released: Sequence[tuple[int, float]] | None = None,
) -> ReleaseMap:
    """Where and when the nodes of an interface were released.

    Args:
        source: A scene in three dimensions, or its analysis.
        interface: Interface or its name.
        released: Slave node and time of each release, in order; those of the scene by default.

    Raises:
        InputError: The interface is unknown, or a line.
    """
    analysis = analysis_of(source)
    title = interface if isinstance(interface, str) else interface.title
    pair = next((p for p in analysis.pairs if p.title == title), None)
    if pair is None:
        unknown_name("interface", title, [p.title for p in analysis.pairs])
    surface = pair.surface
    if surface.dim == 1:
        raise InputError(
            f"interface '{title}' is a line: its front is a point; plot the crack length instead "
            "(r_curve, or load_opening with x='time', y='a[...]')"
        )
    normal = np.abs((surface.normals * surface.areas[:, None]).sum(axis=0))
    across = [i for i in range(3) if i != int(np.argmax(normal))]
    across.sort(key=lambda i: -float(np.ptp(surface.x[:, i])))
    if released is None:
        released = [r for g in analysis.cracks if g.title == title for r in g.released]
    order = np.where(pair.bonded, np.inf, 0.0)
    order[[node for node, _ in released]] = 1.0 + np.arange(len(released))
    pieces = np.concatenate([surface.facets[:, p] for p in _PIECES[surface.kind, surface.order]])
    centre = surface.x[pieces].mean(axis=1)
    ends = np.stack([pieces, np.roll(pieces, -1, axis=1)], axis=2)
    hub = np.broadcast_to(len(order) + np.arange(len(pieces))[:, None, None], (*pieces.shape, 1))
    return ReleaseMap(
        points=np.concatenate([surface.x, centre])[:, across],
        axes=("xyz"[across[0]], "xyz"[across[1]]),
        triangles=np.concatenate([ends, hub], axis=2).reshape(-1, 3),
        order=np.concatenate([order, np.sort(order[pieces], axis=1)[:, 1]]),
        times=np.array([0.0, *[time for _, time in released]]),
    )


def _around(data: ReleaseMap) -> tuple[Array, Array]:
    """Corners of the part of the interface worth showing: what opened and as much around it."""
    opened = data.opened()
    of_interest = data.triangles[np.isfinite(opened) & (opened > 0.0)]
    low, high = data.points.min(axis=0), data.points.max(axis=0)
    if not len(of_interest):
        return low, high
    first, last = (f(data.points[of_interest.ravel()], axis=0) for f in (np.min, np.max))
    margin = 0.6 * float((last - first).max())
    return np.maximum(low, first - margin), np.minimum(high, last + margin)


def front_advance(
    source: Analysis | HasAnalysis,
    path: str | Path | None,
    interface: Interface | str,
    *,
    released: Sequence[tuple[int, float]] | None = None,
    colour: str = "order",
    n_lines: int = 8,
    label: str | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Figure | None:
    """Plot an interface from above, coloured by when it opened, with fronts in between; collective.

    Args:
        source: A scene in three dimensions, or its analysis.
        path: Picture file (.png, .pdf, .svg), or ``None`` for none.
        interface: Interface or its name.
        released: Slave node and time of each release, in order; those of the scene by default.
        colour: "order" of release or "time" of release.
        n_lines: How many positions of the front are drawn.
        label: What the colours mean.
        title: Heading.
        ax: Axes to draw into, those of a new figure by default; needed on rank 0 only.

    Returns:
        The figure on rank 0, ``None`` on the others.

    Raises:
        InputError: The interface is unknown or a line, or ``colour`` is another word.
        FxcrackError: The file could not be written.
    """
    if colour not in ("order", "time"):
        raise InputError(f"front_advance: colour = '{colour}', choose 'order' or 'time'")
    data = release_map(source, interface, released)

    def draw() -> Figure:
        low, high = _around(data)
        size = high - low
        height = float(np.clip(6.3 * size[1] / size[0] + 1.5, 2.4, 7.5))
        figure, axes = new_figure(8.0, height, ax=ax)
        opened, corners = data.opened(), data.points[data.triangles]
        for part, plain in ((opened == 0.0, _INITIAL), (np.isinf(opened), LIGHT)):
            axes.add_collection(PolyCollection(list(corners[part]), facecolors=plain, **_SEAMLESS))
        grown = np.isfinite(opened) & (opened > 0.0)
        if np.any(grown):
            step = opened[grown]
            value = step if colour == "order" else data.times[step.astype(int)]
            paint = PolyCollection(list(corners[grown]), array=value, cmap="viridis", **_SEAMLESS)
            axes.add_collection(paint)
            words = {"order": "Order of release", "time": "Time of release"}
            colour_bar(figure, axes, paint, label or words[colour])
        total = len(data.times) - 1
        grid = Triangulation(data.points[:, 0], data.points[:, 1], data.triangles)
        for stage in np.unique(np.linspace(0, total, n_lines).astype(int)):
            # just behind the bonded nodes
            axes.tricontour(
                grid, (data.order <= stage).astype(float), levels=[1e-6], colors=[INK],
                linewidths=[1.8 if stage in (0, total) else 0.8],
            )  # fmt: skip
        dress(axes, xlabel=data.axes[0], ylabel=data.axes[1], title=title)
        axes.grid(False)
        axes.set_aspect("equal")
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        handles = [
            Patch(facecolor=_INITIAL, label="initial crack"),
            Patch(facecolor=LIGHT, edgecolor=GREY, linewidth=0.5, label="bonded"),
            Line2D([], [], color=INK, linewidth=1.0, label="front"),
        ]
        figure.legend(
            handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=10,
            labelcolor=INK, handlelength=1.4,
        )  # fmt: skip
        return figure

    return save(analysis_of(source).comm, path, draw)
