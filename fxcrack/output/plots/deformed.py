"""The deformed mesh coloured by a stress: cells in the plane, outer facets of a solid.

A solid is projected orthographically, facets that look away are left out and the others are drawn
from back to front.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import dolfinx.mesh
import numpy as np
from dolfinx import fem
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import unknown_name
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.stress import von_mises
from fxcrack.interface.surface import facet_nodes
from fxcrack.output.fields import displacement_function, stress_function
from fxcrack.output.plots.style import GREY, INK, colour_bar, dress, new_figure, save
from fxcrack.steps.analysis import Analysis, HasAnalysis, analysis_of

TIMES = "\N{MULTIPLICATION SIGN}"

# nodes of a cell or facet in basix order along its outline
_OUTLINES = {
    ("interval", 1): (0, 1),
    ("interval", 2): (0, 2, 1),
    ("triangle", 1): (0, 1, 2),
    ("triangle", 2): (0, 5, 1, 3, 2, 4),
    ("quadrilateral", 1): (0, 1, 3, 2),
    ("quadrilateral", 2): (0, 4, 1, 6, 3, 7, 2, 5),
}


@dataclass(frozen=True)
class Shape:
    """What a picture of the deformed mesh shows; on rank 0 that of all ranks.

    Attributes:
        faces: Cells (2-D) or outer facets (3-D) along their outline, shape (n, k, 3), length.
        motion: Displacement at those points, shape (n, k, 3), length.
        values: Stress in the cell, shape (n,), force/length^2.
        inner: A point inside the cell, shape (n, 3).
        border: Outer edges of the undeformed mesh (2-D), shape (m, j, 3).
    """

    faces: Array
    motion: Array
    values: Array
    inner: Array
    border: Array


def outer_facets(continuum: Continuum) -> tuple[Ints, Ints]:
    """Outer facets of this rank.

    Returns:
        Their cells, shape (n_facets,), and their displacement nodes of this rank in basix order,
        shape (n_facets, nodes_per_facet).
    """
    topology, tdim = continuum.mesh.domain.topology, continuum.mesh.tdim
    topology.create_connectivity(tdim - 1, tdim)
    _, cells, _, nodes = facet_nodes(continuum, dolfinx.mesh.exterior_facet_indices(topology))
    return cells.astype(np.int64), nodes.astype(np.int64)


def _facet_kind(continuum: Continuum) -> str:
    name = continuum.mesh.domain.topology.cell_name()
    return {"tetrahedron": "triangle", "hexahedron": "quadrilateral"}.get(name, "interval")


def shape(source: Analysis | HasAnalysis, component: str = "von_mises") -> Shape:
    """Gather what a picture of the deformed mesh shows; collective, one back-solve.

    Args:
        source: A scene or its analysis, after a step.
        component: "von_mises" or one of ``scene.continuum.model.stress_labels``.

    Returns:
        The shape on rank 0; on the others their own part.

    Raises:
        InputError: The component is unknown, or no step was run yet.
    """
    analysis = analysis_of(source)
    continuum, comm = analysis.continuum, analysis.comm
    labels = list(continuum.model.stress_labels)
    if component != "von_mises" and component not in labels:
        unknown_name("stress component", component, ["von_mises", *labels])
    u = displacement_function(analysis)
    stress = stress_function(analysis, u, analysis.time)
    if component == "von_mises":
        values = _per_cell(von_mises(continuum, stress), 1)[:, 0]
    else:
        values = _per_cell(stress, len(labels))[:, labels.index(component)]
    x = continuum.positions()
    motion = np.zeros_like(x)
    motion[:, : continuum.gdim] = continuum.layout.displacements(u.x.array)
    cells, facets = outer_facets(continuum)
    facets = facets[:, _OUTLINES[_facet_kind(continuum), continuum.order]]
    border = np.zeros((0, 2, 3))
    if continuum.mesh.gdim == 2:
        border = x[facets]
        name = continuum.mesh.domain.topology.cell_name()
        n_cells = continuum.mesh.domain.topology.index_map(2).size_local
        cells = np.arange(n_cells)
        faces = continuum.space.dofmap.list[:n_cells][:, _OUTLINES[name, continuum.order]]
    else:
        faces = facets
    inner = x[continuum.space.dofmap.list[cells]].mean(axis=1)
    mine = (x[faces], motion[faces], values[cells], inner, border)
    parts = comm.gather(mine)
    if parts is None:
        return Shape(*mine)
    return Shape(*[np.concatenate(p) for p in zip(*parts, strict=True)])


def _per_cell(function: fem.Function, width: int) -> Array:
    """Values of a cellwise constant function on the cells of this rank, ghosts included."""
    dofs = function.function_space.dofmap.list[:, 0]
    return np.asarray(function.x.array.reshape(-1, width)[dofs])


def automatic_scale(shape: Shape) -> float:
    """Factor 1, 2 or 5 times a power of ten that shows displacements as a tenth of the body.

    At least 1: large displacements are shown as they are.
    """
    size = float(np.ptp(shape.faces.reshape(-1, 3), axis=0).max())
    largest = float(np.linalg.norm(shape.motion, axis=-1).max(initial=0.0))
    if largest == 0.0:
        return 1.0
    wanted = 0.1 * size / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return max(1.0, float(power * max(k for k in (1.0, 2.0, 5.0) if k * power <= wanted * 1.001)))


def view_axes(up: Array, along: Array, azimuth: float, elevation: float) -> Array:
    """Rows right, up and towards the viewer of a picture, shape (3, 3).

    Args:
        up: Direction that is upright in the picture, shape (3,).
        along: Direction to the right at azimuth 0, perpendicular to ``up``, shape (3,).
        azimuth: Degrees by which the viewer moves to the left.
        elevation: Degrees by which the viewer moves up.
    """
    a, e = np.radians([azimuth, elevation])
    level = np.cos(a) * np.cross(along, up) - np.sin(a) * along
    towards = np.cos(e) * level + np.sin(e) * up
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def _upright(analysis: Analysis) -> tuple[Array, Array]:
    """Up across the first interface, right along the longest of the other axes."""
    size = np.zeros(3)
    normal = np.array([0.0, 0.0, 1.0])
    if analysis.pairs:
        surface = analysis.pairs[0].surface
        normal = np.abs((surface.normals * surface.areas[:, None]).sum(axis=0))
        size = np.ptp(surface.x, axis=0)
    up = int(np.argmax(normal))
    size[up] = -1.0
    return np.eye(3)[up], np.eye(3)[int(np.argmax(size))]


def deformed(
    source: Analysis | HasAnalysis,
    path: str | Path | None = None,
    *,
    scale: float | None = None,
    component: str = "von_mises",
    label: str | None = None,
    title: str | None = None,
    view: tuple[float, float] = (35.0, 25.0),
    ax: Axes | None = None,
) -> Figure | None:
    """Plot the deformed mesh coloured by a stress; collective, one back-solve.

    Args:
        source: A scene or its analysis, after a step.
        path: Picture file (.png, .pdf, .svg), or ``None`` for none.
        scale: Factor on displacements; chosen by itself if ``None`` and named in the picture.
        component: "von_mises" or a component of the stress, e.g. "xx".
        label: What the colours mean and their unit.
        title: Heading, before the scale.
        view: Azimuth and elevation of the viewer in degrees (3-D).
        ax: Axes to draw into, those of a new figure by default; needed on rank 0 only.

    Returns:
        The figure on rank 0, ``None`` on the others.

    Raises:
        InputError: The component is unknown, or no step was run yet.
        FxcrackError: The file could not be written.
    """
    analysis = analysis_of(source)
    data = shape(analysis, component)
    flat = analysis.mesh.gdim == 2

    def draw() -> Figure:
        factor = automatic_scale(data) if scale is None else scale
        moved = data.faces + factor * data.motion
        norm, cmap, extend = _colours(data.values, signed=component != "von_mises")
        mapping = ScalarMappable(norm, cmap)
        colours = mapping.to_rgba(data.values)
        if flat:
            points, border = moved[..., :2], data.border[..., :2]
        else:
            axes = view_axes(*_upright(analysis), *view)
            points, colours = _project(moved, data.inner + factor * data.motion.mean(axis=1),
                                       axes, colours)  # fmt: skip
            border = np.zeros((0, 2, 2))
        every = np.concatenate([points.reshape(-1, 2), border.reshape(-1, 2)])
        size = np.ptp(every, axis=0)
        low_and_wide = size[1] < 0.25 * size[0]
        height = (8.3 if low_and_wide else 7.4) * size[1] / size[0]
        height += (1.7 if low_and_wide else 1.0) - (0.0 if flat else 0.25)
        figure, drawn = new_figure(9.0, float(np.clip(height, 2.2, 8.0)), ax=ax)
        width = float(np.clip(60.0 / np.sqrt(len(points)), 0.0, 0.4))
        edges = "face" if width < 0.15 else (0.1, 0.12, 0.16, 0.35)
        faces = PolyCollection(list(points), facecolors=colours, linewidths=width, edgecolors=edges)
        drawn.add_collection(faces)
        heading = f"{title}   " if title else ""
        heading += f"displacements {TIMES} {factor:g}"
        dress(drawn, xlabel="x", ylabel="y", title=heading)
        drawn.grid(False)
        if flat:
            drawn.add_collection(
                LineCollection(
                    list(border), colors=GREY, linewidths=0.7, linestyles="--", zorder=0.5
                )
            )
        else:
            drawn.set_axis_off()
        drawn.set_aspect("equal")
        low, high = every.min(axis=0), every.max(axis=0)
        drawn.set_xlim(low[0] - 0.02 * size[0], high[0] + 0.02 * size[0])
        drawn.set_ylim(low[1] - 0.04 * size[1], high[1] + 0.04 * size[1])
        if not flat:
            _triad(drawn, axes)
        words = "von Mises stress" if component == "von_mises" else f"Stress {component}"
        colour_bar(figure, drawn, mapping, label or words, below=low_and_wide, extend=extend)
        return figure

    return save(analysis.comm, path, draw)


def _colours(values: Array, *, signed: bool) -> tuple[Normalize, str, str]:
    """Colour scale that a few cells at a crack tip do not stretch."""
    top = float(np.quantile(np.abs(values), 0.995)) if len(values) else 1.0
    top = top or 1.0
    beyond_top, beyond_bottom = bool(np.any(values > top)), bool(np.any(values < -top))
    if not signed:
        return Normalize(0.0, top), "YlOrRd", "max" if beyond_top else "neither"
    extend = {(True, True): "both", (True, False): "max", (False, True): "min"}
    return Normalize(-top, top), "RdBu_r", extend.get((beyond_top, beyond_bottom), "neither")


def _project(faces: Array, inner: Array, axes: Array, colours: Array) -> tuple[Array, Array]:
    """Facets that face the viewer, from back to front, with shaded colours."""
    centre = faces.mean(axis=1)
    a, b = faces[:, 1] - faces[:, 0], faces[:, -1] - faces[:, 0]
    normal = np.cross(a, b)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= np.where(np.einsum("nc,nc->n", normal, centre - inner) < 0.0, -1.0, 1.0)[:, None]
    seen = normal @ axes[2] > 0.0
    order = np.flatnonzero(seen)[np.argsort(centre[seen] @ axes[2], kind="stable")]
    light = axes.T @ np.array([-0.35, 0.75, 0.56])
    bright = 0.84 + 0.16 * np.clip(normal[order] @ light, 0.0, 1.0)
    shaded = colours[order].copy()
    shaded[:, :3] *= bright[:, None]
    return faces[order] @ axes[:2].T, shaded


def _triad(ax: Axes, axes: Array) -> None:
    """Small arrows along x, y and z in the lower right corner."""
    inset = ax.inset_axes((0.88, 0.0, 0.12, 0.12 * 1.6))
    inset.set_axis_off()
    inset.set_aspect("equal")
    inset.set_xlim(-1.3, 1.3)
    inset.set_ylim(-1.3, 1.3)
    for name, tip in zip("xyz", axes[:2].T, strict=True):
        inset.annotate("", tip, (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1})
        inset.annotate(name, 1.25 * tip, ha="center", va="center", fontsize=9, color=INK)
