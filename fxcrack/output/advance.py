"""The advance of a crack front: a plane interface seen from above, coloured by when it opened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.tri import Triangulation

from fxcrack.errors import InputError, unknown_name
from fxcrack.interface.pairing import Interface
from fxcrack.output.figure import GREY, INK, LIGHT, colour_bar, dress, legend, new_figure, save

if TYPE_CHECKING:
    from fxcrack.scene import Scene

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_INITIAL = "#c3c9d3"

# facets as four-sided or three-sided pieces between neighbouring nodes, basix order
_PIECES = {
    ("triangle", 1): ((0, 1, 2),),
    ("quadrilateral", 1): ((0, 1, 3, 2),),
    ("quadrilateral", 2): ((0, 4, 8, 5), (4, 1, 6, 8), (5, 8, 7, 2), (8, 6, 3, 7)),
}


@dataclass(frozen=True)
class ReleaseMap:
    """An interface seen from above, and when its nodes were released.

    Attributes:
        points: Slave nodes in the plane of the picture, shape (n_nodes, 2), length.
        axes: Names of the two directions.
        pieces: Pieces of facets, shape (n_pieces, 3 or 4).
        order: Order of release of each node from 1, 0 initially open, inf bonded, (n_nodes,).
        time: Time of release likewise.
    """

    points: Array
    axes: tuple[str, str]
    pieces: Ints
    order: Array
    time: Array


def release_map(
    scene: Scene,
    interface: Interface | str,
    released: Sequence[tuple[int, float]] | None = None,
) -> ReleaseMap:
    """Where and when the nodes of an interface were released.

    Args:
        scene: A scene in three dimensions.
        interface: Interface or its name.
        released: Slave node and time of each release, in order; those of the scene by default.

    Raises:
        InputError: The interface is unknown, or a line.
    """
    title = interface if isinstance(interface, str) else interface.title
    pair = next((p for p in scene.pairs if p.title == title), None)
    if pair is None:
        unknown_name("interface", title, [p.title for p in scene.pairs])
    surface = pair.surface
    if surface.dim == 1:
        raise InputError(
            f"interface '{title}' is a line: its front is a point; plot the crack length instead "
            "(r_curve, or load_opening with x='time', y='a[...]')"
        )
    normal = np.abs((surface.normals * surface.areas[:, None]).sum(axis=0))
    across = [i for i in range(3) if i != int(np.argmax(normal))]
    across.sort(key=lambda i: -float(np.ptp(surface.x[:, i])))
    order = np.where(pair.bonded, np.inf, 0.0)
    time = order.copy()
    if released is None:
        released = [r for g in scene.growths if g.title == title for r in g.released]
    for i, (node, when) in enumerate(released):
        order[node], time[node] = i + 1, when
    return ReleaseMap(
        points=surface.x[:, across],
        axes=("xyz"[across[0]], "xyz"[across[1]]),
        pieces=np.concatenate([surface.facets[:, p] for p in _PIECES[surface.kind, surface.order]]),
        order=order,
        time=time,
    )


def front_line(data: ReleaseMap, stage: int) -> tuple[Triangulation, Array]:
    """Triangles and an indicator whose contour at 0.5 is the front after some releases.

    Args:
        data: From :func:`release_map`.
        stage: Number of releases done.

    Returns:
        Triangles around the centre of each piece, and 1 where open, 0 where bonded, per corner.
    """
    centre = data.points[data.pieces].mean(axis=1)
    number = len(data.points) + np.arange(len(centre))
    ends = np.stack([data.pieces, np.roll(data.pieces, -1, axis=1)], axis=2)
    hub = np.broadcast_to(number[:, None, None], (*ends.shape[:2], 1))
    triangles = np.concatenate([ends, hub], axis=2).reshape(-1, 3)
    is_open = (data.order <= stage).astype(float)
    x, y = np.concatenate([data.points, centre]).T
    values = np.concatenate([is_open, is_open[data.pieces].mean(axis=1)])
    return Triangulation(x, y, triangles), values


def front_advance(
    scene: Scene,
    path: str | Path,
    interface: Interface | str,
    *,
    released: Sequence[tuple[int, float]] | None = None,
    colour: str = "order",
    n_lines: int = 8,
    label: str | None = None,
    title: str | None = None,
) -> None:
    """Plot an interface from above, coloured by when it opened, with fronts in between; collective.

    Args:
        scene: A scene in three dimensions.
        path: Picture file (.png, .pdf, .svg).
        interface: Interface or its name.
        released: Slave node and time of each release, in order; those of the scene by default.
        colour: "order" of release or "time" of release.
        n_lines: How many positions of the front are drawn.
        label: What the colours mean.
        title: Heading.

    Raises:
        InputError: The interface is unknown or a line, or ``colour`` is another word.
        FxcrackError: The file could not be written.
    """
    if colour not in ("order", "time"):
        raise InputError(f"front_advance: colour = '{colour}', choose 'order' or 'time'")
    data = release_map(scene, interface, released)

    def draw() -> Figure:
        size = np.ptp(data.points, axis=0)
        height = float(np.clip(7.0 * size[1] / size[0] + 1.5, 2.4, 7.0))
        figure, ax = new_figure(8.0, height)
        value = data.order if colour == "order" else data.time
        last = value[data.pieces].max(axis=1)
        initial = data.order[data.pieces].max(axis=1) == 0.0
        open_now = np.isfinite(last) & ~initial
        outline = data.points[data.pieces]
        edge: dict[str, Any] = {"linewidths": 0.3, "edgecolors": "white"}
        ax.add_collection(PolyCollection(list(outline[initial]), facecolors=_INITIAL, **edge))
        bonded = ~np.isfinite(last)
        ax.add_collection(PolyCollection(list(outline[bonded]), facecolors=LIGHT, **edge))
        if np.any(open_now):
            norm = Normalize(value[np.isfinite(value)].min(), value[np.isfinite(value)].max())
            paint = PolyCollection(
                list(outline[open_now]), array=last[open_now], cmap="viridis", norm=norm,
                linewidths=0.3, edgecolors="face",
            )  # fmt: skip
            ax.add_collection(paint)
            words = {"order": "Order of release", "time": "Time of release"}
            colour_bar(figure, ax, paint, label or words[colour])
        total = int(np.isfinite(data.order).sum() - (data.order == 0.0).sum())
        for stage in np.unique(np.linspace(0, total, n_lines).astype(int)):
            grid, inside = front_line(data, int(stage))
            width = 1.8 if stage in (0, total) else 0.8
            ax.tricontour(grid, inside, levels=[0.5], colors=[INK], linewidths=[width])
        dress(ax, xlabel=data.axes[0], ylabel=data.axes[1], title=title)
        ax.grid(False)
        ax.set_aspect("equal")
        ax.autoscale_view()
        ax.margins(0.01)
        handles = [
            Patch(facecolor=_INITIAL, label="initial crack"),
            Patch(facecolor=LIGHT, edgecolor=GREY, linewidth=0.5, label="bonded"),
            Line2D([], [], color=INK, linewidth=1.0, label="front"),
        ]
        legend(
            ax, handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3,
            borderaxespad=0.2, handlelength=1.4,
        )  # fmt: skip
        return figure

    save(scene.mesh.comm, path, draw)
