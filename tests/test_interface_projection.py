"""Closest points on facets of all shapes and orders, against dense sampling and linear fields."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from specimens import tensor_surface

from fxcrack.interface.projection import project
from fxcrack.interface.surface import FacetSurface, shape_functions

Array = npt.NDArray[np.float64]

KINDS = [(kind, order) for kind in ("interval", "triangle", "quadrilateral") for order in (1, 2)]
ROUND_OFF = 1e-12  # lengths are of order 1
SNAP = 2e-8  # feet within 1e-8 of a node, on the reference facet, are put there


def uneven(kind: str, order: int, warp: object = None) -> FacetSurface:
    axes = ([0.0, 0.3, 1.0, 1.2, 2.0], [0.0, 0.5, 0.6, 1.5])
    return tensor_surface(kind, order, *axes[: 1 if kind == "interval" else 2], warp=warp)


def bent(x: Array) -> Array:
    """A valley: curved facets in second order."""
    out = x.copy()
    out[:, 1] = 0.1 * (x[:, 0] - 1.0) ** 2 + 0.05 * x[:, 2] * x[:, 0]
    return out


@pytest.mark.parametrize(("kind", "order"), KINDS)
@pytest.mark.parametrize("warp", [None, bent])
def test_nodes_of_the_surface_have_one_master(kind: str, order: int, warp: object) -> None:
    surface = uneven(kind, order, warp)
    found = project(surface.x, surface)
    masters = surface.facets[found.facet]
    assert np.array_equal(np.sort(found.weights, axis=1)[:, -1], np.ones(surface.n_nodes))
    assert np.count_nonzero(found.weights) == surface.n_nodes
    assert np.array_equal(
        np.take_along_axis(masters, found.weights.argmax(axis=1)[:, None], 1)[:, 0],
        np.arange(surface.n_nodes),
    )
    assert np.all(found.distance == 0.0)


@pytest.mark.quick("interval-*", "quadrilateral-1")
@pytest.mark.parametrize(("kind", "order"), KINDS)
@settings(max_examples=30)
@given(points=arrays(np.float64, (20, 3), elements=st.floats(-0.4, 2.4)))
def test_plane_surface(kind: str, order: int, points: Array) -> None:
    """Feet are where clipping to the rectangle puts them; weights reproduce linear fields."""
    if kind == "interval":
        points[:, 2] = 0.0
    surface = uneven(kind, order)
    found = project(points, surface)
    expected = np.clip(points, surface.x.min(axis=0), surface.x.max(axis=0))
    assert found.foot == pytest.approx(expected, abs=SNAP)
    assert found.distance == pytest.approx(np.linalg.norm(points - expected, axis=1), abs=SNAP)
    field = surface.x @ [0.7, 0.0, -1.3] + 0.2
    interpolated = np.einsum("nk,nk->n", found.weights, field[surface.facets[found.facet]])
    assert interpolated == pytest.approx(expected @ [0.7, 0.0, -1.3] + 0.2, abs=2 * SNAP)
    assert found.normal == pytest.approx(np.tile([0.0, 1.0, 0.0], (20, 1)), abs=ROUND_OFF)


@pytest.mark.quick("interval-*", "quadrilateral-1")
@pytest.mark.parametrize(("kind", "order"), KINDS)
def test_curved_surface(kind: str, order: int) -> None:
    """No sample of the surface is closer than the foot."""
    surface = uneven(kind, order, bent)
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.3, 2.3, (60, 3)) * [1.0, 0.2, 0.7]
    if kind == "interval":
        points[:, 2] = 0.0
    grid = np.linspace(0.0, 1.0, 41)
    xi = np.stack(np.meshgrid(*[grid] * surface.dim), axis=-1).reshape(-1, surface.dim)
    if kind == "triangle":
        xi = xi[xi.sum(axis=1) <= 1.0 + 1e-12]
    values, _ = shape_functions(kind, order, xi)
    samples = np.einsum("mk,fkc->fmc", values, surface.x[surface.facets]).reshape(-1, 3)
    nearest = np.linalg.norm(points[:, None] - samples, axis=2).min(axis=1)
    found = project(points, surface)
    foot = np.einsum("nk,nkc->nc", found.weights, surface.x[surface.facets[found.facet]])
    assert found.foot == pytest.approx(foot, abs=ROUND_OFF)
    assert np.all(found.distance <= nearest + SNAP)
    # samples are at most 0.02 apart: 41 on facets not longer than 0.8 x 0.9
    assert np.all(found.distance >= nearest - 0.02)


@pytest.mark.parametrize("kind", ["interval", "quadrilateral", "triangle"])
def test_graded_surface(kind: str) -> None:
    """A large facet beside small ones whose centres are all closer than its own."""
    x = np.concatenate([np.arange(0.0, 1.0, 0.02), [1.0, 9.0]])
    axes = (x,) if kind == "interval" else (x, [0.0, 3.0])
    surface = tensor_surface(kind, 1, *axes)
    points = np.array([[1.0 + s, 0.0, 0.0 if kind == "interval" else 1.0] for s in (0.1, 2.0, 7.0)])
    found = project(points, surface)
    assert np.all(surface.x[surface.facets[found.facet], 0].max(axis=1) == 9.0)
    assert found.distance == pytest.approx(np.zeros(3), abs=ROUND_OFF)


def test_one_facet_and_one_point() -> None:
    surface = tensor_surface("interval", 1, [0.0, 2.0])
    found = project(np.array([[0.5, -0.3, 0.0]]), surface)
    assert found.weights == pytest.approx(np.array([[0.75, 0.25]]), abs=ROUND_OFF)
    assert found.distance == pytest.approx([0.3], abs=ROUND_OFF)
