"""Where the tips of a front come from, and how far along the surface that is."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from specimens import tensor_surface

from fxcrack.interface.front import Front
from fxcrack.interface.surface import FacetSurface
from fxcrack.interface.surface_paths import SurfacePaths

Array = npt.NDArray[np.float64]

GRID = np.linspace(0.0, 4.0, 17)
KINDS = ["quadrilateral", "triangle"]


def rolled(x: Array, radius: float = 3.0) -> Array:
    """A plane rolled up along x to a part of a cylinder."""
    out = x.copy()
    out[:, 0] = radius * np.sin(x[:, 0] / radius)
    out[:, 1] = radius * (np.cos(x[:, 0] / radius) - 1.0)
    return out


def grown(surface: FacetSurface, begin: Array, now: Array) -> tuple[Front, SurfacePaths]:
    """A front that began with some bonded nodes and has left fewer of them."""
    front = Front(surface, begin, "bond")
    paths = SurfacePaths(front)
    front.release(np.flatnonzero(begin & ~now))
    return front, paths


@pytest.mark.parametrize("kind", KINDS)
def test_straight_front_that_has_bowed(kind: str) -> None:
    surface = tensor_surface(kind, 1, GRID, GRID)
    x, _, z = surface.x.T
    begin = x >= 1.0 - 1e-9
    front, paths = grown(surface, begin, x >= 2.5 - 0.2 * (z - 2.0) ** 2 - 1e-9)
    tips = front.tips()
    found = paths.origins(tips)
    # whatever way the front has turned: straight back to the nodes at x = 1
    assert found.grown == pytest.approx(x[tips.node] - 1.0, abs=1e-12)
    assert x[found.nearest] == pytest.approx(1.0)
    assert z[found.nearest] == pytest.approx(z[tips.node])
    assert np.ptp(found.grown) > 0.5


@pytest.mark.parametrize("kind", KINDS)
def test_oblique_front_is_met_between_its_nodes(kind: str) -> None:
    surface = tensor_surface(kind, 1, GRID, GRID)
    normal = np.array([1.0, 0.0, 0.5]) / np.hypot(1.0, 0.5)
    along = surface.x @ normal
    front, paths = grown(surface, along >= 1.5 - 1e-9, along >= 2.5 - 1e-9)
    tips = front.tips()
    found = paths.origins(tips)
    # the initial front is a staircase around 1.5, within an element of 0.25
    initial = along[paths.initial]
    assert np.ptp(initial) < 0.25
    x = surface.x[tips.node]
    foot = np.einsum("nk,nkc->nc", found.weights, surface.x[found.nodes])
    assert found.grown == pytest.approx(np.linalg.norm(x - foot, axis=1), rel=1e-12)
    inside = (foot[:, 2] > 1e-9) & (foot[:, 2] < 4.0 - 1e-9)
    low, high = along[tips.node] - initial.max(), along[tips.node] - initial.min()
    assert inside.sum() > 5
    assert (found.grown >= low - 1e-9)[inside].all()
    assert (found.grown <= high + 1e-9)[inside].all()


@pytest.mark.parametrize("kind", KINDS)
def test_nodes_that_come_from_between_two_nodes_of_the_initial_front(kind: str) -> None:
    def sheared(x: Array) -> Array:
        out = x.copy()
        out[:, 2] += 0.3 * np.maximum(x[:, 0] - 1.0, 0.0)
        return out

    surface = tensor_surface(kind, 1, GRID, GRID, warp=sheared)
    x, _, z = surface.x.T
    front, paths = grown(surface, x >= 1.0 - 1e-9, x >= 2.25 - 1e-9)
    tips = front.tips()
    found = paths.origins(tips)
    beside = z[tips.node] <= 4.0  # the others have left the width of the initial front
    assert beside.sum() > 10
    assert found.grown[beside] == pytest.approx(1.25, abs=1e-12)
    assert (found.weights[beside].min(axis=1) > 0.1).any()
    nodes = np.linalg.norm(surface.x[tips.node] - surface.x[found.nearest], axis=1)
    assert (nodes[beside] > 1.25 + 1e-3).any()  # what the nearest node alone would say


@pytest.mark.parametrize("kind", KINDS)
def test_round_front_grows_along_its_radii(kind: str) -> None:
    surface = tensor_surface(kind, 1, np.linspace(0.0, 4.0, 41), np.linspace(0.0, 4.0, 41))
    r = np.hypot(surface.x[:, 0], surface.x[:, 2])
    front, paths = grown(surface, r >= 1.0 - 1e-9, r >= 2.0 - 1e-9)
    tips = front.tips()
    found = paths.origins(tips)
    # the front is a staircase of elements of 0.1 outside the circle
    assert (np.abs(found.grown - (r[tips.node] - 1.0)) < 0.1).all()


@pytest.mark.parametrize("kind", KINDS)
def test_length_runs_along_a_curved_surface(kind: str) -> None:
    surface = tensor_surface(kind, 1, GRID, GRID, warp=rolled)
    arc = 3.0 * np.arctan2(surface.x[:, 0], surface.x[:, 1] + 3.0)
    front, paths = grown(surface, arc >= 1.0 - 1e-9, arc >= 3.5 - 1e-9)
    tips = front.tips()
    found = paths.origins(tips)
    # facets are chords of the arc, (h/r)^2/24 = 3e-4 shorter; the samples cut corners of those
    assert found.grown == pytest.approx(2.5, rel=1e-3)
    straight = np.linalg.norm(surface.x[tips.node] - surface.x[found.nearest], axis=1)
    assert (straight < 2.5 * (1.0 - 0.02)).all()  # 2 sin(2.5/6)/(2.5/3) - 1 = -2.8 %
