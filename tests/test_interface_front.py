"""Tips and fronts: where they are, which way they go, the lengths around them, crack length."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from specimens import tensor_surface

from fxcrack.base.errors import InterfaceError
from fxcrack.interface.crack_extent import CrackExtent
from fxcrack.interface.front import Front
from fxcrack.interface.surface import FacetSurface
from fxcrack.interface.tips import Tips

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-12  # lengths are of order 1
X = np.array([0.0, 0.3, 1.0, 1.4, 2.0, 2.5, 3.5])
Z = np.array([0.0, 0.4, 1.0, 1.3, 2.0])


def surface(kind: str, order: int = 1, x: npt.ArrayLike = X, z: npt.ArrayLike = Z) -> FacetSurface:
    axes = (x, z)[: 1 if kind == "interval" else 2]
    return tensor_surface(kind, order, *axes)


def beyond(s: FacetSurface, x0: float) -> npt.NDArray[np.bool_]:
    return s.x[:, 0] >= x0 - 1e-9


@pytest.mark.parametrize("order", [1, 2])
def test_tip_on_an_uneven_line(order: int) -> None:
    s = surface("interval", order)
    front = Front(s, beyond(s, 1.4), "i")
    tips = front.tips()
    (i,) = tips.node
    assert s.x[i, 0] == 1.4
    assert (tips.d_behind[0], tips.d_ahead[0]) == pytest.approx((0.4, 0.6))
    # the slave lies below y = 0: n points to it, s forward, t = n x s
    expected = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).T
    assert tips.frame[0] == pytest.approx(expected, abs=ROUND_OFF)
    forces = s.x[tips.force_nodes[0], 0]
    wakes = np.einsum("km,km->k", s.x[tips.wake_nodes[0], 0], tips.wake_weights[0])
    assert forces == pytest.approx([1.4, 1.7][:order])
    assert wakes == pytest.approx([1.0, 1.2][:order])
    assert tips.area[0] == pytest.approx(0.6) and tips.width[0] == 1.0
    front.release(tips.force_nodes[0])
    (moved,) = front.tips().node
    assert s.x[moved, 0] == 2.0


def test_last_node_has_nothing_ahead() -> None:
    s = surface("interval")
    front = Front(s, beyond(s, 3.5), "i")
    tips = front.tips()
    assert tips.d_ahead[0] == 0.0 and tips.d_behind[0] == 1.0
    assert tips.area[0] == pytest.approx(0.5, abs=ROUND_OFF)
    front.release(tips.node)
    assert len(front.tips()) == 0 and front.tips().frame.shape == (0, 3, 3)
    assert CrackExtent(front).length(front.tips()) == 3.5


@pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])
def test_straight_front(kind: str) -> None:
    s = surface(kind)
    front = Front(s, beyond(s, 1.4), "i")
    tips = front.tips()
    assert np.sort(s.x[tips.node, 2]) == pytest.approx(Z)
    assert np.all(s.x[tips.node, 0] == 1.4)
    assert tips.frame == pytest.approx(
        np.tile(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]).T, (len(Z), 1, 1)), abs=ROUND_OFF
    )
    assert tips.d_behind == pytest.approx(np.full(len(Z), 0.4))
    assert tips.d_ahead == pytest.approx(np.full(len(Z), 0.6))
    foot = np.einsum("nkm,nkmc->nkc", tips.wake_weights, s.x[tips.wake_nodes])[:, 0]
    assert foot == pytest.approx(s.x[tips.node] - [0.4, 0.0, 0.0], abs=ROUND_OFF)
    # together the nodes stand for the whole width
    assert tips.width.sum() == pytest.approx(2.0)
    if kind == "quadrilateral":
        order = np.argsort(s.x[tips.node, 2])
        assert tips.width[order] == pytest.approx([0.2, 0.5, 0.45, 0.5, 0.35])
    extent = CrackExtent(front)
    assert extent.area(tips) == pytest.approx(2.0 * 1.4)
    assert extent.length(tips) == pytest.approx(1.4)


def test_front_of_second_order_quadrilaterals() -> None:
    """Corner nodes and midside nodes of the front, each with its line ahead and behind."""
    s = surface("quadrilateral", 2)
    front = Front(s, beyond(s, 1.4), "i")
    tips = front.tips()
    across = np.sort(np.concatenate([Z, 0.5 * (Z[1:] + Z[:-1])]))
    assert np.sort(s.x[tips.node, 2]) == pytest.approx(across)
    assert s.x[tips.force_nodes[:, 1], 0] == pytest.approx(np.full(9, 1.7))
    assert s.x[tips.wake_nodes[:, :, 0], 0] == pytest.approx(np.tile([1.0, 1.2], (9, 1)))
    assert tips.width.sum() == pytest.approx(2.0)
    extent = CrackExtent(front)
    assert extent.area(tips) == pytest.approx(2.0 * 1.4)
    for node in np.argsort(s.x[tips.node, 2]):
        front.release(tips.force_nodes[node])
    assert extent.area(front.tips()) == pytest.approx(2.0 * 2.0)


@pytest.mark.parametrize("kind", ["interval", "quadrilateral"])
def test_midside_nodes_follow_their_corners(kind: str) -> None:
    """A bonded set that begins in the middle of an element begins at its next corner."""
    s = surface(kind, 2)
    from_middle = Front(s, beyond(s, 1.2), "i")
    from_corner = Front(s, beyond(s, 1.4), "i")
    assert np.array_equal(from_middle.bonded, from_corner.bonded)
    assert np.array_equal(from_middle.candidates(), from_corner.candidates())
    assert len(from_middle.tips())


@pytest.mark.parametrize("which", ["open", "bonded"])
def test_lone_midside_node_is_refused(which: str) -> None:
    s = surface("interval", 2)
    bonded = beyond(s, 1.4)
    at = 1.7 if which == "open" else 0.65
    bonded[np.argmin(abs(s.x[:, 0] - at))] = which == "bonded"
    with pytest.raises(InterfaceError, match=r"is a midside node; .* begin at a corner node"):
        Front(s, bonded, "i")


def test_second_order_triangles_are_refused() -> None:
    s = surface("triangle", 2)
    front = Front(s, beyond(s, 1.4), "i")  # it may be tied
    with pytest.raises(InterfaceError, match=r"second-order triangular faces .* not those of"):
        front.tips()


@pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("inside_bonded", [False, True])
def test_circular_front(kind: str, inside_bonded: bool) -> None:
    """On a staircase the growth direction is the radius to within the angle of a stair."""
    line = np.linspace(-2.0, 2.0, 41)
    s = surface(kind, 1, line, line)
    radius = np.hypot(s.x[:, 0], s.x[:, 2])
    front = Front(s, (radius <= 1.0) == inside_bonded, "i")
    tips = front.tips()
    assert len(tips) >= 40
    outward = s.x[tips.node] / radius[tips.node][:, None]
    cosine = np.einsum("nc,nc->n", tips.frame[:, :, 1], -outward if inside_bonded else outward)
    # directions of facets are multiples of 45 degrees: half of that is to be expected of a
    # staircase, and 45 with the arc of half an element where it has a corner
    assert cosine.min() > np.cos(np.radians(50.0)) and cosine.mean() > np.cos(np.radians(22.5))
    assert np.einsum("nij,nik->njk", tips.frame, tips.frame) == pytest.approx(
        np.tile(np.eye(3), (len(tips), 1, 1)), abs=ROUND_OFF
    )
    assert np.all(tips.d_behind > 0.05 - 1e-9) and np.all(tips.d_behind < 0.15)
    # stairs are longer than the circle, at most by 4/pi, and the front lies on one side of it
    length = 2.0 * np.pi
    assert 0.8 * length < tips.width.sum() < 4.0 / np.pi * length
    area = CrackExtent(front).area(tips)
    open_area = 16.0 - np.pi if inside_bonded else np.pi
    # the front lies within one element of the circle
    assert area == pytest.approx(open_area, abs=0.1 * length)


def same(a: Tips, b: Tips) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in Tips.__dataclass_fields__
    )


@pytest.mark.quick("interval")
@pytest.mark.parametrize("kind", ["interval", "triangle", "quadrilateral"])
@settings(max_examples=25)
@given(choice=st.lists(st.integers(0, 10**6), min_size=1, max_size=12))
def test_releases_update_all_that_changed(kind: str, choice: list[int]) -> None:
    """After any releases the remembered geometry is that of a front found from scratch."""
    s = surface(kind)
    front = Front(s, beyond(s, 1.0), "i")
    for number in choice:
        tips = front.tips()
        if not len(tips):
            break
        front.release(tips.force_nodes[number % len(tips)])
        assert same(front.tips(), Front(s, front.bonded, "i").tips())


def test_lengths_of_several_cracks_on_a_line() -> None:
    """One tip: from the end of the line; two: half the run; none: the run."""
    s = surface("interval", 1, np.arange(0.0, 11.0))
    bonded = np.isin(np.arange(11), [2, 3, 7, 8])
    front = Front(s, bonded, "i")
    extent = CrackExtent(front)
    assert dict(extent.lengths()) == {2: 2.0, 3: 2.0, 7: 2.0, 8: 2.0}
    assert extent.length(front.tips()) == 2.0
    # open runs of 1 + 3 + 1 nodes, and half a facet at each of the four tips
    assert extent.area(front.tips()) == pytest.approx(2.0 + 4.0 + 2.0)
    front.release(np.array([3]))
    assert dict(extent.lengths()) == {2: 2.5, 7: 2.5, 8: 2.0}
    alone = Front(s, np.zeros(11, dtype=bool), "i")
    assert CrackExtent(alone).lengths() == [(-1, 10.0)]


def test_lengths_on_two_separate_lines() -> None:
    """Pieces that do not touch have cracks of their own."""
    s = tensor_surface("interval", 1, [0.0, 1.0, 2.0, 3.0], warp=lambda f: f)
    gap = s.x[s.facets].mean(axis=1)[:, 0] != 1.5
    keep = np.unique(s.facets[gap])
    parts = FacetSurface(
        "two", "interval", 1, s.dofs[keep], s.x[keep],
        np.searchsorted(keep, s.facets[gap]), s.inner[gap], s.breadth[keep],
    )  # fmt: skip
    front = Front(parts, np.isin(parts.x[:, 0], [1.0, 3.0]), "i")
    assert sorted(a for _, a in CrackExtent(front).lengths()) == [1.0, 1.0]
    assert len(front.tips()) == 2
