"""What slave and master surfaces, bonded sets and supports may not do, and what they may."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from specimens import STEEL, bond, gathered, specimen

import fxcrack as fx
from fxcrack.base.errors import InputError, InterfaceError
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.jump_coordinates import RETAINED, JumpCoordinates, build_coordinates
from fxcrack.interface.pair import Pair
from fxcrack.interface.pairing import make_pair
from fxcrack.interface.supports import collect_supports
from fxcrack.mesh import Mesh
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.dcb import dcb_2d, dcb_3d

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-13


def small(comm: MPI.Intracomm, **options: object) -> Mesh:
    return dcb_2d(comm, length=4.0, dx=0.5, ny=2, **options)


def three_blocks(comm: MPI.Intracomm) -> Mesh:
    """Two blocks side by side on a third one, no two meshes matching.

    The corner (1, 0) belongs to all three: it is a node of each.
    """

    def make() -> Blocks:
        model = Blocks()
        a = model.add("a", (np.linspace(0, 2, 6), np.linspace(-1, 0, 3)), "quadrilateral", 1)
        b = model.add("b", (np.linspace(0, 1, 4), np.linspace(0, 1, 4)), "quadrilateral", 1)
        c = model.add("c", (np.linspace(1, 2, 3), np.linspace(0, 1, 6)), "quadrilateral", 1)
        for name, block, at in (
            ("a_top", a, {"y": 0.0}),
            ("a_bottom", a, {"y": -1.0}),
            ("b_bottom", b, {"y": 0.0}),
            ("b_right", b, {"x": 1.0}),
            ("c_left", c, {"x": 1.0}),
            ("c_bottom", c, {"y": 0.0}),
            ("c_top", c, {"y": 1.0}),
        ):
            model.group(name, block.part(**at))
        return model

    return build(comm, "blocks", make)


def coordinates(
    mesh: Mesh,
    interfaces: list[fx.Interface],
    supports: list[fx.Displacement] | tuple[fx.Displacement, ...] = (),
) -> tuple[list[Pair], JumpCoordinates, Array]:
    """Pairs, their coordinates with all jumps retained, and T dense."""
    model = fx.PlaneStrain() if mesh.gdim == 2 else fx.Solid()
    continuum = Continuum(mesh, STEEL, model)
    pairs = [
        make_pair(continuum, i, others=[j for j in interfaces if j is not i]) for i in interfaces
    ]
    roles = [np.full((p.surface.n_nodes, mesh.gdim), RETAINED, dtype=np.int8) for p in pairs]
    columns = collect_supports(continuum, list(supports))
    found = build_coordinates(continuum.layout, pairs, roles, columns, 0)
    transform = gathered(found.transform).toarray()
    found.transform.destroy()
    return pairs, found, transform


def refused(
    comm: MPI.Intracomm, match: str, act: Callable[[], object], kind: type[Exception]
) -> None:
    """The same error on every rank."""
    with pytest.raises(kind, match=match) as found:
        act()
    assert len(set(comm.allgather(str(found.value)))) == 1


def tie(slave: str, master: str, **options: object) -> fx.Interface:
    everything = options.pop("bonded", lambda x: np.ones(x.shape[1], dtype=bool))
    return fx.Interface(slave=slave, master=master, bonded=everything, **options)


# -- rules of the jump coordinates (docs/theory.md) ---------------------------------------------


@pytest.mark.mpi
def test_slave_used_twice(comm: MPI.Intracomm) -> None:
    mesh = three_blocks(comm)
    pairs = [tie("c_left", "b_right"), tie("c_bottom", "a_top")]
    refused(
        comm,
        r"the node at \(1, 0, 0\) is a slave of interface 'c_left' and of 'c_bottom'; "
        "a node can be a slave only once: .* exchange slave and master",
        lambda: coordinates(mesh, pairs),
        InterfaceError,
    )


@pytest.mark.mpi
def test_cycle(comm: MPI.Intracomm) -> None:
    """Exchanged roles; and a cycle of three through the common corner."""
    mesh = small(comm)
    there, back = tie("upper_face", "lower_face"), tie("lower_face", "upper_face")
    message = "form a cycle: a slave node is master of a node .* exchange slave and master of one"
    refused(comm, message, lambda: coordinates(mesh, [there, back]), InterfaceError)
    mesh = three_blocks(comm)
    ring = [tie("b_bottom", "a_top"), tie("c_left", "b_right"), tie("a_top", "c_bottom")]
    ring[2] = tie("a_top", "c_bottom", bonded=lambda x: x[0] > 0.9, tolerance=0.1)
    refused(comm, message, lambda: coordinates(mesh, ring), InterfaceError)


@pytest.mark.mpi
def test_chain_is_composed(comm: MPI.Intracomm) -> None:
    """c on b on a: the corner of c follows that of b, which follows the edge of a."""
    mesh = three_blocks(comm)
    pairs, found, t = coordinates(mesh, [tie("b_bottom", "a_top"), tie("c_left", "b_right")])
    rng = np.random.default_rng(0)
    q = rng.standard_normal(t.shape[1])
    u = (t @ q).reshape(-1, 2)
    for pair, index in zip(pairs, found.index, strict=True):
        mean = np.einsum("nk,nkc->nc", pair.weights, u[pair.masters])
        jump = np.einsum("nij,nj->ni", pair.frames, q[found.first + index])
        assert u[pair.surface.dofs] == pytest.approx(mean + jump, abs=ROUND_OFF)
    # T is invertible: every displacement has coordinates
    assert np.linalg.matrix_rank(t) == len(t) == t.shape[1]


@pytest.mark.mpi
def test_bonded_node_outside_the_master(comm: MPI.Intracomm) -> None:
    mesh = three_blocks(comm)
    refused(
        comm,
        r"3 bonded slave nodes lie outside the master surface 'b_bottom', the farthest at "
        r"\(2, 0, 0\) by 1 \(search tolerance 0\.0333\); let the master surface extend .* "
        r"take them out of the bonded set, or raise Interface\(tolerance=\.\.\.\)",
        lambda: coordinates(mesh, [tie("a_top", "b_bottom")]),
        InterfaceError,
    )
    # left out of the bonded set they are free; with a generous tolerance they hang on the border
    (pair,), _, _ = coordinates(mesh, [tie("a_top", "b_bottom", bonded=lambda x: x[0] < 1.01)])
    assert pair.paired.sum() == pair.bonded.sum() == 3
    (pair,), _, _ = coordinates(mesh, [tie("a_top", "b_bottom", tolerance=1.1)])
    assert pair.paired.all()


@pytest.mark.three
@pytest.mark.mpi
@pytest.mark.parametrize(
    "supports",
    [
        [fx.Displacement("far_upper", x=0.0)],
        [fx.Displacement("far_upper", y=0.0), fx.Displacement("far_lower", x=0.0)],
        [fx.Displacement("far_upper", x=1.0), fx.Displacement("far_lower", x=0.0)],
        [
            fx.Displacement("far_upper", x=1.0),
            fx.Displacement("far_lower", x=1.0, amplitude=fx.Amplitude((0.0, 1.0), (0.0, 1.0))),
        ],
    ],
    ids=["free", "other component", "other value", "other amplitude"],
)
def test_support_on_slave_but_not_on_master(
    comm: MPI.Intracomm, supports: list[fx.Displacement]
) -> None:
    mesh = small(comm)
    refused(
        comm,
        r"support 'far_upper\.[xy]' holds the slave node at \(4, 0, 0\) of interface 'bond', "
        "but not its master nodes in the same way; support both faces there alike",
        lambda: coordinates(mesh, [bond(0.0)], supports),
        InterfaceError,
    )


@pytest.mark.mpi
def test_support_shared_by_slave_and_master(comm: MPI.Intracomm) -> None:
    """The held jump has no column; the other one stays; values prescribed are met."""
    mesh = small(comm, nx_lower=8)
    supports = [
        fx.Displacement("far_upper", x=0.25),
        fx.Displacement("far_lower", x=0.25),
        fx.Displacement("bottom", y=lambda x: 0.1 * x[0]),
    ]
    (pair,), found, t = coordinates(mesh, [bond(0.0)], supports)
    (corner,) = np.flatnonzero(np.isclose(pair.surface.x[:, 0], 4.0))
    # frame: n = (0, 1), slip along x
    assert found.index[0][corner, 1] == -1 and found.index[0][corner, 0] >= 0
    assert found.held[0].sum() == 1
    q = np.zeros(t.shape[1])
    amplitudes = found.first + found.n_retained + np.arange(3)
    q[amplitudes] = [0.25, 0.25, 1.0]  # two displacements, and the factor of the ramp
    u = (t @ q).reshape(-1, 2)
    assert u[pair.surface.dofs[corner]] == pytest.approx([0.25, 0.0], abs=ROUND_OFF)


@pytest.mark.mpi
def test_support_oblique_to_the_interface(comm: MPI.Intracomm) -> None:
    mesh = small(comm)
    turn(mesh, 30.0)
    supports = [fx.Displacement("far_upper", x=0.0), fx.Displacement("far_lower", x=0.0)]
    refused(
        comm,
        r"support 'far_\w+\.x' holds slave node \d+ of interface 'bond' at .* in a direction "
        "oblique to it; hold it along the interface or across it",
        lambda: coordinates(mesh, [tie("upper_face", "lower_face", name="bond")], supports),
        InterfaceError,
    )
    # held whole there is nothing oblique about it
    supports = [fx.Displacement(s.where, x=0.0, y=0.0) for s in supports]
    _, found, _ = coordinates(mesh, [tie("upper_face", "lower_face")], supports)
    assert found.held[0].sum() == 2


def turn(mesh: Mesh, degrees: float) -> None:
    """Turn a mesh about z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    x = mesh.domain.geometry.x
    x[:] = x @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def test_frames_turn_to_supports_along_the_interface() -> None:
    """3-D: a tangent is held, whichever axis it is; two of them, or all three components."""
    mesh = dcb_3d(MPI.COMM_SELF, length=2.0, width=2.0, dx=1.0, dy=1.0, ny=1)
    for held, n in (("x", 1), ("z", 1), ("xz", 2), ("xyz", 3), ("y", 1)):
        values = dict.fromkeys(held, 0.0)
        supports = [fx.Displacement(f"far_{side}", **values) for side in ("upper", "lower")]
        (pair,), found, t = coordinates(mesh, [bond(0.0)], supports)
        at_end = np.isclose(pair.surface.x[:, 0], 2.0)
        assert np.array_equal(found.held[0].sum(axis=1), n * at_end)
        frames = found.frames[0]
        assert np.linalg.det(frames) == pytest.approx(np.ones(len(frames)), abs=ROUND_OFF)
        # no column moves a held component
        for axis in held:
            rows = 3 * pair.surface.dofs[at_end] + "xyz".index(axis)
            inner = t[:, : found.first + found.n_retained]  # one rank: supports come last
            assert inner[rows] == pytest.approx(
                np.zeros((len(rows), inner.shape[1])), abs=ROUND_OFF
            )


# -- interfaces ------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("gap", ["adjust", "keep"])
def test_gap(comm: MPI.Intracomm, gap: str) -> None:
    """The slave face lies 0.02 above the master face."""
    mesh = small(comm, nx_lower=5)
    upper = mesh.domain.geometry.x[:, 1] > 0.0
    continuum = Continuum(mesh, STEEL, fx.PlaneStrain())
    cells = mesh.group("upper").entities
    nodes = np.unique(fx.compat.geometry_dofmap(mesh.domain)[cells])
    mesh.domain.geometry.x[nodes, 1] += 0.02
    del upper
    pair = make_pair(continuum, bond(0.0, gap=gap, pairing="surface-to-surface"))
    expected = 0.02 if gap == "keep" else 0.0
    assert pair.gap == pytest.approx(np.full(9, expected), abs=ROUND_OFF)
    assert pair.frames == pytest.approx(
        np.tile(np.array([[0.0, -1.0], [1.0, 0.0]]), (9, 1, 1)), abs=ROUND_OFF
    )


def test_gaps_of_round_off_are_none() -> None:
    """Faces that touch hold a body, wherever it is and however it is turned."""
    for pairing in ("node-to-surface", "surface-to-surface"):
        mesh = small(MPI.COMM_SELF, nx_lower=5)
        turn(mesh, 17.0)
        continuum = Continuum(mesh, STEEL, fx.PlaneStrain())
        pair = make_pair(continuum, bond(-1.0, gap="keep", pairing=pairing))
        assert pair.paired.all() and not pair.gap.any()


@pytest.mark.mpi
def test_bonded_sets(comm: MPI.Intracomm) -> None:
    """A function, an array, a group of nodes and all say the same."""
    mesh = small(comm)
    continuum = Continuum(mesh, STEEL, fx.PlaneStrain())

    def pair(bonded: object) -> Pair:
        return make_pair(
            continuum, fx.Interface(slave="upper_face", master="lower_face", bonded=bonded)
        )

    x = pair(None).surface.x[:, 0]
    assert pair(None).bonded.all() and pair("upper_face").bonded.all()
    assert np.array_equal(pair("far_upper").bonded, np.isclose(x, 4.0))
    assert np.array_equal(pair(x > 2.0).bonded, x > 2.0)
    assert np.array_equal(pair(lambda y: y[0] > 2.0).bonded, x > 1.9)  # with its border
    refused(
        comm,
        r"bonded gives shape \(3,\); one boolean for each of the 9 slave nodes",
        lambda: pair(np.ones(3, dtype=bool)),
        InterfaceError,
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"master": "upper_face"}, "pairs a surface with itself; .* name two distinct"),
        ({"gap": "close"}, "gap = 'close': choose 'adjust' or 'keep'"),
    ],
)
def test_contradictions(options: dict[str, str], message: str) -> None:
    with pytest.raises(InterfaceError, match=message):
        fx.Interface(**{"slave": "upper_face", "master": "lower_face", **options})


def test_shared_nodes() -> None:
    """Two sides of one node: they cannot part."""

    def make() -> Blocks:
        model = Blocks()
        block = model.add("body", ([0.0, 1.0, 2.0], [0.0, 1.0, 2.0]), "quadrilateral", 1)
        model.group("left", block.part(x=0.0))
        model.group("bottom", block.part(y=0.0))
        return model

    with pytest.raises(InterfaceError, match=r"share 1 nodes; .* \(split the mesh there"):
        coordinates(build(MPI.COMM_SELF, "block", make), [tie("left", "bottom", tolerance=9.0)])


def test_one_name_for_two_interfaces() -> None:
    with pytest.raises(InputError, match="interface 'bond' appears twice"):
        specimen(small(MPI.COMM_SELF), bonds=[bond(0.0)])


# -- supports --------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize(
    "second",
    [
        fx.Displacement("far_upper", x=0.5),
        fx.Displacement("far_upper", x=1.0, amplitude=fx.Amplitude((0.0, 1.0), (0.0, 1.0))),
    ],
    ids=["value", "amplitude"],
)
def test_supports_that_contradict_each_other(comm: MPI.Intracomm, second: fx.Displacement) -> None:
    continuum = Continuum(small(comm), STEEL, fx.PlaneStrain())
    first = fx.Displacement("top", x=1.0)
    refused(
        comm,
        r"supports 'far_upper\.x' and 'top\.x' prescribe different values or amplitudes at "
        r"\(4, 1.5, 0\); let only one of them hold that node",
        lambda: collect_supports(continuum, [first, second]),
        InputError,
    )


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("support", "message"),
    [
        (fx.Displacement("top", z=0.0), "prescribes z in 2 dimensions"),
        (fx.Displacement("top", x=lambda x: 1.0 / x[1] - np.inf), "x is not a finite number"),
        (fx.Displacement("tip", x=0.0), "has no group 'tip'; it has: .*top"),
    ],
)
def test_impossible_supports(comm: MPI.Intracomm, support: fx.Displacement, message: str) -> None:
    continuum = Continuum(small(comm), STEEL, fx.PlaneStrain())
    refused(comm, message, lambda: collect_supports(continuum, [support]), InputError)


def test_support_of_nothing() -> None:
    with pytest.raises(InputError, match="prescribes nothing; give x, y or z"):
        fx.Displacement("top")


@pytest.mark.parametrize(
    "region",
    [
        lambda x: x[0] >= 30.0 + 1e-9,
        lambda x: x[0] > 30.0,
        lambda x: ~(x[0] <= 30.0),
        lambda x: x[0] + x[1] >= 30.0 + 1e-7,
    ],
    ids=["round-off", "open", "complement", "inclined"],
)
def test_a_node_on_the_border_of_the_bonded_region_is_bonded(region: Callable[..., Any]) -> None:
    """Within 1e-6 of a facet length; none of the positions asked for leaves the surface."""
    mesh = dcb_2d(dx=1.0, ny=1)
    asked = []

    def bonded(x: Any) -> Any:
        asked.append(x)
        return region(x)

    scene = fx.Scene(
        mesh,
        materials=fx.Isotropic(E=1.0, nu=0.0),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0),
        ],
        debonds=[
            fx.Debond(fx.Interface("upper_face", "lower_face", bonded=bonded), fx.VCCT(GIc=1.0))
        ],
    )
    history = scene.run(fx.Static(until=fx.Releases(1)))
    assert history["a[upper_face]"][0] == pytest.approx(30.0, abs=1e-9)
    x = np.concatenate(asked, axis=1)
    assert x[0].min() > -1e-12 and abs(x[1]).max() < 1e-12
