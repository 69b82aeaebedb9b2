"""Degenerate input: next to nothing bonded, NaN in the data, meshes with flat parts.

Hard: every formula that divides by a length, counts tips or compares numbers meets a case nobody
meant. Must hold: what has a meaning runs to a named end in balance; what has none is refused with
the thing and the place named, by every rank. Checked by the end's reason, by the energies, and by
the words of the message.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import basix.ufl
import dolfinx.mesh
import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from specimens import PINS, STEEL, largest_imbalance, specimen

import fxcrack as fx
from fxcrack.mesh import Mesh, mesh_from_domain
from fxcrack.meshes.dcb import dcb_2d

pytestmark = pytest.mark.stability

Array = npt.NDArray[np.float64]
NAN, INF = float("nan"), float("inf")
HELD = (
    fx.Displacement("far_upper", x=0.0, y=0.0),
    fx.Displacement("far_lower", x=0.0, y=0.0),
)


def scene(**options: Any) -> fx.Scene:
    return specimen(dcb_2d(MPI.COMM_SELF, length=20.0, dx=1.0, ny=2), a0=5.0, **options)


def run(**options: Any) -> fx.History:
    return scene(**options).run(fx.Static(until=fx.Releases(99)), progress=False)


def interface(bonded: Any, **options: Any) -> fx.Interface:
    return fx.Interface("upper_face", "lower_face", bonded=bonded, name="bond", **options)


# -- next to nothing, and everything ---------------------------------------------------------------


@pytest.mark.parametrize("at", [0.0, 7.0])
def test_one_bonded_node(at: float) -> None:
    """It goes, whichever way the crack is said to run, and nothing is left."""
    history = run(interface=interface(lambda x: np.isclose(x[0], at)), supports=[*PINS, *HELD])
    assert history.reason == "total separation: no crack tip is left"
    assert history.rows[-1]["released[bond]"] == 1
    assert history.rows[-1]["released_energy"] > 0.0
    assert largest_imbalance(history) < 1e-9  # round-off


def test_one_bonded_node_that_holds_a_body() -> None:
    """Letting it go would leave an arm to turn freely."""
    history = run(interface=interface(lambda x: np.isclose(x[0], 7.0)))
    assert history.reason.startswith(("total separation: ", "the criterion is not reached"))
    assert history.rows[-1]["released[bond]"] == 0


def test_nothing_bonded() -> None:
    history = run(interface=interface(lambda x: x[0] > 1e9), supports=[*PINS, *HELD])
    assert history.reason == "total separation: no crack tip is left"
    with pytest.raises(
        fx.FxcrackError, match="can still move freely; hold it by supports, or bond"
    ):
        run(interface=interface(lambda x: x[0] > 1e9))


def test_everything_bonded(caplog: pytest.LogCaptureFixture) -> None:
    history = run(interface=interface(lambda x: x[0] > -1.0))
    assert history.reason == "no crack tip is left"
    assert "has no crack tip" in caplog.text


# -- numbers that are none -------------------------------------------------------------------------

REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "modulus": (lambda: fx.Isotropic(NAN, 0.3), "E = nan must be positive"),
    "ratio": (lambda: fx.Isotropic(1.0, NAN), "nu = nan must lie between"),
    "frame": (
        lambda: fx.Orthotropic((1.0,) * 3, (0.1,) * 3, (1.0,) * 3, ((NAN, 0, 0), (0, 1, 0))),
        "frame = .* finite numbers",
    ),
    "thickness": (lambda: fx.PlaneStrain(INF), "thickness = inf is not positive and finite"),
    "end time": (lambda: fx.Time(INF), "positive and finite"),
    "no release": (lambda: fx.Releases(0), "at least one node"),
    "length": (lambda: fx.CrackLength(interface(None), NAN), "length must be a finite number"),
    "increments": (lambda: fx.Static(until=fx.Time(1.0), max_increments=0), "allow at least one"),
    "first increment": (lambda: fx.Static(until=fx.Time(1.0), initial=NAN), "must satisfy 0 < min"),
    "toughness": (lambda: fx.VCCT(GIc=NAN), "GIc is NaN"),
    "toughness somewhere": (
        lambda: run(criterion=fx.VCCT(GIc=lambda x: np.where(x[0] > 8.0, NAN, 0.2))),
        "GIc = nan at slave node 9",
    ),
    "support": (
        lambda: run(supports=[PINS[0], fx.Displacement("pin_bottom", x=0.0, y=NAN)]),
        r"'pin_bottom'\): y is not a finite number",
    ),
    "load": (
        lambda: run(supports=HELD, loads=[fx.PointForce("pin_top", (0.0, NAN))]),
        "load 'pin_top' is not a finite number",
    ),
    "load somewhere": (
        lambda: run(
            supports=HELD,
            loads=[fx.Traction("top", (0.0, lambda x: np.where(x[0] > 3.0, NAN, 1.0)))],
        ),
        "load 'top' is not a finite number everywhere",
    ),
    "monitor": (lambda: fx.Monitor("top", (0.0, 0.0)), "not all of them zero"),
    "bonded set": (
        lambda: run(interface=interface(lambda x: np.where(x[0] > 5.0, NAN, 0.0))),
        "bonded gives NaN",
    ),
    "search tolerance": (lambda: interface(None, tolerance=0.0), "tolerance = 0.0 must be pos"),
    "amplitude that jumps": (lambda: fx.Amplitude((0.0, 1.0, 1.0), (0.0, 1.0, 2.0)), "increase"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str) -> None:
    make, words = REFUSED[name]
    with pytest.raises(fx.InputError, match=words):
        make()


# -- meshes with flat parts ------------------------------------------------------------------------

N = 11  # nodes along each face of the two rows of squares below


def two_rows(change: Callable[[Array], Array]) -> Mesh:
    """Two rows of unit squares on either side of y = 0, their nodes changed."""
    x = np.arange(float(N))
    points = np.concatenate([np.column_stack([x, np.full(N, y)]) for y in (0.0, 1.0, -1.0, 0.0)])
    cells = [(b + i, b + i + 1, b + N + i, b + N + i + 1) for b in (0, 2 * N) for i in range(N - 1)]
    element = basix.ufl.element("Lagrange", "quadrilateral", 1, shape=(2,))
    domain = dolfinx.mesh.create_mesh(
        MPI.COMM_SELF, cells=np.array(cells), e=element, x=change(points)
    )
    domain.topology.create_connectivity(1, 2)
    outer = dolfinx.mesh.exterior_facet_indices(domain.topology)
    middle = dolfinx.mesh.compute_midpoints(domain, 1, outer)
    cell = [domain.topology.connectivity(1, 2).links(f)[0] for f in outer]
    above = dolfinx.mesh.compute_midpoints(domain, 2, np.array(cell, dtype=np.int32))[:, 1] > 0.0
    face, end = np.abs(middle[:, 1]) < 1e-9, np.abs(middle[:, 0]) < 1e-9
    return mesh_from_domain(
        domain,
        {
            "upper_face": (1, outer[face & above]),
            "lower_face": (1, outer[face & ~above]),
            "end_upper": (1, outer[end & above]),
            "end_lower": (1, outer[end & ~above]),
        },
    )


def move(**to: int) -> Callable[[Array], Array]:
    """Put nodes, by number, on top of others."""

    def change(points: Array) -> Array:
        out = points.copy()
        for node, target in to.items():
            out[int(node[1:])] = points[target]
        return out

    return change


def lost(points: Array) -> Array:
    out = points.copy()
    out[N + 3] = NAN
    return out


FLAT: dict[str, tuple[Callable[[Array], Array], str]] = {
    "zero-length edge": (move(n5=4), "'upper_face' has 1 facets without length or area, the"),
    "zero-length edges on both faces": (move(n5=4, n38=37), "facets without length or area"),
    "duplicate nodes": (move(n5=4, n16=15), "1 of 20 cells are degenerate .* the first at"),
    "NaN": (lost, "1 of 44 nodes have a coordinate that is not a finite number"),
}  # fmt: skip


@pytest.mark.parametrize("name", ["sound", *FLAT])
def test_flat_parts(name: str) -> None:
    change, words = FLAT.get(name, (lambda points: points, ""))

    def grow() -> fx.History:
        supports = [
            fx.Displacement("end_upper", x=0.0, y=1.0),
            fx.Displacement("end_lower", x=0.0, y=-1.0),
        ]
        built = specimen(two_rows(change), a0=2.5, supports=supports, materials=STEEL)
        return built.run(fx.Static(until=fx.Releases(3)), progress=False)

    if not words:
        assert grow().reason == "3 nodes released"
        return
    with pytest.raises(fx.InputError, match=words):
        grow()


def test_bonded_nodes_at_one_place() -> None:
    """A slave surface of two pieces whose end nodes coincide: both nodes go, one after the other.

    The lower body is one, the upper one is cut at x = 10; both parts are held.
    """
    from fxcrack.meshes.blocks import Blocks, build

    def make() -> Blocks:
        model = Blocks()
        half = np.arange(0.0, 10.5, 1.0)
        y = np.linspace(0.0, 1.5, 3)
        left = model.add("left", (half, y), "quadrilateral", 1)
        right = model.add("right", (10.0 + half, y), "quadrilateral", 1)
        lower = model.add("lower", (np.arange(0.0, 20.5, 1.0), y - 1.5), "quadrilateral", 1)
        for block in (left, right):
            model.group("upper_face", block.part(y=0.0))
        model.group("lower_face", lower.part(y=0.0))
        model.group("bottom", lower.part(y=-1.5))
        model.group("pull", left.part(x=0.0, y=1.5))
        model.group("hold", right.part(x=20.0, y=1.5))
        return model

    built = specimen(
        build(MPI.COMM_SELF, "cut", make, None),
        a0=5.0,
        supports=[
            fx.Displacement("bottom", x=0.0, y=0.0),
            fx.Displacement("pull", x=0.0, y=1.0),
            fx.Displacement("hold", x=0.0, y=0.0),
        ],
    )
    history = built.run(fx.Static(until=fx.Releases(99)), progress=False)
    # the left part comes off node by node until one node holds it: it could turn about that one
    assert history.reason.startswith(
        ("total separation: ", "the criterion is not reached", "no cr")
    )
    assert history.rows[-1]["released[bond]"] >= 4
    assert largest_imbalance(history) < 1e-9


def test_opening_that_a_support_hides() -> None:
    """One open element, whose end face is moved: the node behind the tip has no jump of its own.

    Its opening would count as zero, and the crack would never grow without a word; exact closure
    needs no opening and goes on.
    """
    supports = [
        fx.Displacement("end_upper", x=0.0, y=1.0),
        fx.Displacement("end_lower", x=0.0, y=-1.0),
    ]

    def grow(method: str) -> fx.History:
        mesh = dcb_2d(MPI.COMM_SELF, length=20.0, dx=1.0, ny=2)
        criterion = fx.VCCT(GIc=0.2, method=method)  # type: ignore[arg-type]
        built = specimen(mesh, a0=1.0, supports=supports, criterion=criterion)
        return built.run(fx.Static(until=fx.Releases(3)), progress=False)

    with pytest.raises(fx.InputError, match=r"behind the tip at \(1, 0, 0\) but not"):
        grow("vcct")
    assert grow("closure").reason == "3 nodes released"
