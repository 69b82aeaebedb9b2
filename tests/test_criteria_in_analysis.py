"""Critical stress, critical opening and crack length against time, in whole analyses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from specimens import time_of

import fxcrack as fx
from fxcrack.demos import center_crack as demo
from fxcrack.interface.front import Front
from fxcrack.interface.surface_paths import SurfacePaths
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.center_crack import center_crack
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.penny import penny
from fxcrack.output.fields import displacement_function
from fxcrack.output.interface_fields import interface_fields

Array = npt.NDArray[np.float64]

STEEL = fx.Isotropic(E=200e3, nu=0.3)
STEP = fx.StepRelease()
A = 1.0
ROUND_OFF = 1e-9  # linear pieces, each solved to 1e-13 or so, some dozens one after another
TENSION = [fx.Traction("top", (0.0, 1.0)), fx.Traction("bottom", (0.0, -1.0))]
CORNERS = [fx.Displacement("bottom_left", x=0.0, y=0.0), fx.Displacement("bottom_right", y=0.0)]
STRETCH = [fx.Displacement("bottom", x=0.0, y=0.0), fx.Displacement("top", x=0.0, y=1.0)]


def beyond_crack(x: Array) -> Array:
    return np.asarray(np.abs(x[0]) >= A - 1e-9)


def outside_two_cracks(x: Array) -> Array:
    """Cracks from -1 to -0.3 and from 0.3 to 1."""
    return np.asarray((np.abs(x[0]) <= 0.3 + 1e-9) | (np.abs(x[0]) >= A - 1e-9))


def plate(
    criterion: Any,
    *,
    release: Any = STEP,
    watch: tuple[Any, ...] = (),
    bonded: Callable[[Array], Array] = beyond_crack,
    supports: list[fx.Displacement] = STRETCH,
    loads: Any = (),
    options: fx.CondensedOptions | None = None,
    **mesh: Any,
) -> fx.Scene:
    """A plate with a crack along y = 0; elements of size 0.1 unless told otherwise."""
    mesh = {"width": 4.0, "height": 4.0, "n_crack": 10, "fine": 1.0, "growth": 1.0, **mesh}
    bond = fx.Interface("upper_face", "lower_face", bonded=bonded, name="bond")
    return fx.Scene(
        center_crack(a=A, **mesh),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=supports,
        loads=loads,
        debonds=[fx.Debond(bond, criterion, release, watch)],
        options=options,
    )


def beam(criterion: Any, release: Any = STEP, *, solid: bool = False, **o: Any) -> fx.Scene:
    """A double cantilever beam 4 wide, in plane strain or a solid that cannot get narrower."""
    mesh = (
        dcb_3d(length=30.0, width=4.0, dx=0.5, dy=2.0, ny=3, **o.pop("mesh", {}))
        if solid
        else dcb_2d(length=30.0, dx=0.5, ny=3, **o.pop("mesh", {}))
    )
    supports = [fx.Displacement("pin_top", x=0.0, y=1.0), fx.Displacement("pin_bottom", x=0, y=-1)]
    if solid:
        supports += [fx.Displacement("upper", z=0.0), fx.Displacement("lower", z=0.0)]
    bond = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 10.0 - 1e-9, name="bond"
    )
    return fx.Scene(
        mesh,
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.Solid() if solid else fx.PlaneStrain(thickness=4.0),
        supports=supports,
        debonds=[fx.Debond(bond, criterion, release)],
        **o,
    )


def run(scene: fx.Scene, *until: Any, **controls: Any) -> fx.History:
    return scene.run(fx.Static(until=until, **controls), progress=False)


def onset(scene: fx.Scene) -> float:
    """Time of the first release."""
    history = run(scene, fx.Releases(1))
    scene.close()
    return float(next(r["time"] for r in history if r["event"] == "onset"))


def release_times(scene: fx.Scene) -> dict[float, float]:
    """Time of release by the x of the node."""
    x = scene.pairs[0].surface.x[:, 0]
    return {round(float(x[n]), 9): t for n, t in scene.cracks[0].released}


def assert_balanced(history: fx.History) -> None:
    # sums of exact linear pieces; every factorisation anew adds its own round-off, some 1e-10
    assert abs(history["balance"]).max() <= 1e-8 * abs(history["external_work"]).max()


# --- closed forms ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.verification
@pytest.mark.convergence
def test_centre_crack_starts_at_the_closed_form_load() -> None:
    coarse = np.array(demo.onset_errors(20))
    fine = np.array(demo.onset_errors(40))
    assert (np.abs(fine) < 0.02).all()  # asked for at 40 elements per half crack
    assert (
        np.log2(coarse / fine) > 0.9
    ).all()  # a field in 1/sqrt(r) on even elements: first order


@pytest.mark.slow
@pytest.mark.verification
def test_second_order_faces_start_at_the_closed_form_load() -> None:
    # twice the nodes of 20 first-order elements, and interpolation by parabolas
    assert np.abs(demo.onset_errors(20, order=2)).max() < 0.01


@pytest.mark.slow
@pytest.mark.verification
def test_shear_strength_under_remote_shear() -> None:
    ahead, width = 0.2, 40.0
    sides = {"top": (1.0, 0.0), "bottom": (-1.0, 0.0), "left": (0.0, -1.0), "right": (0.0, 1.0)}
    scene = plate(
        fx.CriticalStress(1.0, 50.0, distance=ahead),  # no normal stress arises: sigma_f is idle
        supports=CORNERS,
        loads=[fx.Traction(side, t) for side, t in sides.items()],
        width=width, height=width, n_crack=20, growth=1.25, order=2,
    )  # fmt: skip
    k = np.sqrt(1.0 / np.cos(np.pi * A / width))
    exact = 50.0 * np.sqrt((A + ahead) ** 2 - A**2) / (A + ahead) / k
    # 1.4 %, of which the sides of the plate explain less than 0.3
    assert onset(scene) == pytest.approx(exact, rel=0.02)


@pytest.mark.verification
@pytest.mark.parametrize("quantity", ["stress", "opening"])
def test_penny_shaped_crack_starts_at_sneddons_load(quantity: str) -> None:
    a, distance, pressure = 2.0, 0.4, 1.0
    if quantity == "stress":
        r = a + distance
        value = 2.0 / np.pi * (a / np.sqrt(r**2 - a**2) - np.arcsin(a / r))
        criterion: Any = fx.CriticalStress(value, distance=distance)
    else:
        r = a - distance
        value = 8.0 * (1.0 - 0.3**2) / (np.pi * 200e3) * np.sqrt(a**2 - r**2)
        criterion = fx.CrackOpening(value, distance=distance)
    bond = fx.Interface("upper_face", "lower_face", bonded=lambda x: x[0] >= a - 1e-9)
    scene = fx.Scene(
        penny(a=a, radius=40.0, half_height=40.0, dr=0.05, growth=1.25, order=2),
        materials=STEEL,
        model=fx.Axisymmetric(),
        supports=[
            fx.Displacement("axis_upper", x=0.0),
            fx.Displacement("axis_lower", x=0.0),
            fx.Displacement("axis_bottom", y=0.0),
        ],
        loads=[
            fx.Pressure(face, lambda x: np.where(x[0] < a, pressure, 0.0))
            for face in ("upper_face", "lower_face")
        ],
        debonds=[fx.Debond(bond, criterion)],
    )
    # 8 elements over the distance, as 40 per half of the plane crack; first order leaves 4 % in the
    # stress, which is the difference of a singular field and the pressure
    assert onset(scene) == pytest.approx(1.0, rel=0.02)


# --- the criteria beside each other ---------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("order", [1, 2])
def test_circle_of_three_criteria(order: int) -> None:
    scenes, table = demo.run(n_crack=10, releases=5, order=order)
    for scene in scenes:
        assert_balanced(scene.history)
        assert scene.history.reason == f"{10 * order} nodes released"
        scene.close()
    a, stress, opening, length = table.T
    assert a == pytest.approx(1.0 + 0.1 * np.arange(5))
    assert opening == pytest.approx(stress, rel=1e-6)  # asked for; reached: 1e-14
    assert length == pytest.approx(stress, rel=1e-6)
    if order == 1:  # the same on any number of ranks, up to the solver's round-off
        assert stress[[0, -1]] == pytest.approx(RANKS, rel=1e-9)


RANKS = (261.560777198, 281.538426262)
"""Pressures at the first and the fifth release, on one rank."""


@pytest.mark.quick("1-*")
@pytest.mark.parametrize(
    "criterion",
    [fx.CriticalStress(30.0, distance=0.3), fx.CrackOpening(0.01, distance=1.2)],
    ids=["stress", "opening"],
)
@pytest.mark.parametrize("order", [1, 2])
def test_solid_held_across_its_width_is_in_plane_strain(criterion: Any, order: int) -> None:
    times = []
    for solid, per_row in ((False, order), (True, 3 if order == 1 else 10)):
        scene = beam(criterion, solid=solid, mesh={"order": order})
        history = run(scene, fx.Releases(3 * per_row))
        at = np.isin(history["event"], ["onset", "unstable"])
        times.append(history["time"][at])
        scene.close()
    plane, solid_times = times
    assert len(plane) == 3
    assert solid_times == pytest.approx(plane, rel=1e-7)  # front nodes go together within 1e-6


def test_symmetric_half_opens_as_the_whole() -> None:
    n, height, criterion = 8, 3.0, {"critical": 1e-3, "distance": 0.3}
    mesh = {"width": 6.0, "height": 2.0 * height, "n_crack": n, "fine": 0.5, "growth": 1.2}
    whole = plate(fx.CrackOpening(**criterion), supports=CORNERS, loads=TENSION, **mesh)
    x = np.unique(whole.pairs[0].surface.x[:, 0])
    y = np.unique(whole.continuum.positions()[:, 1].round(9))

    def make() -> Blocks:
        model, upper, _ = two_bodies(
            (x, x), (y[y >= 0.0], [-0.1, 0.0]), cell="quadrilateral", order=1
        )
        model.group("top_left", upper.part(x=-3.0, y=height))
        return model

    bond = fx.Interface("upper_face", "lower_face", bonded=beyond_crack, normal_only=True)
    half = fx.Scene(
        build(MPI.COMM_WORLD, "half", make),
        materials=STEEL,
        model=fx.PlaneStrain(),
        # the lower body stands still: it is the plane of symmetry, on which the upper one slides
        supports=[fx.Displacement("lower", x=0.0, y=0.0), fx.Displacement("top_left", x=0.0)],
        loads=TENSION[:1],
        debonds=[fx.Debond(bond, fx.CrackOpening(**criterion, symmetry=True))],
    )
    assert onset(half) == pytest.approx(onset(whole), rel=ROUND_OFF)


def test_watched_criteria_are_reported_and_decide_nothing() -> None:
    stress = fx.CriticalStress(100.0, distance=0.3)
    alone, watched = plate(stress), plate(
        stress, watch=(
            fx.CrackOpening(1e-9, distance=0.25),
            fx.CriticalStress(1.0, distance=0.1),
            fx.CriticalStress(1.0, distance=0.2),
        )
    )  # fmt: skip
    for scene in (alone, watched):
        run(scene, fx.Releases(4))
    times = [np.array(list(release_times(s).values())) for s in (alone, watched)]
    assert times[1] == pytest.approx(times[0], rel=ROUND_OFF)  # the retained sets differ
    assert set(watched.history.columns) - set(alone.history.columns) == {
        *("cod[bond]", "grown[bond]"),
        *("s11_CriticalStress[bond]", "s12_CriticalStress[bond]"),  # the names s11, s12 are taken
        *("s11_CriticalStress_2[bond]", "s12_CriticalStress_2[bond]"),
    }
    row = watched.history.at("released[bond]", 2)
    assert row["grown[bond]"] == pytest.approx(0.1)
    same = alone.history.at("released[bond]", 2)["s11[bond]"]  # not that of the watched criterion
    assert row["s11[bond]"] == pytest.approx(same, rel=ROUND_OFF)


# --- crack length against time --------------------------------------------------------------------

CURVES = {
    "straight": ((0.0, 1.0), (0.5, 2.5)),
    "with a rest and a bend": ((0.2, 0.5, 0.9, 1.0), (0.9, 1.3, 1.3, 2.0)),
}


@pytest.mark.quick("straight-1")
@pytest.mark.mpi
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)
def test_symmetric_tips_go_when_the_curve_passes_them(curve: Any, order: int) -> None:
    criterion = fx.CrackLengthVsTime(*curve, reference="upper_face")
    scene = plate(criterion, order=order)
    history = run(scene, fx.Time(0.98))
    times = release_times(scene)
    assert_balanced(history)
    length = criterion.length(0.98)
    for k in range(11):
        x = round(1.0 + 0.1 * k, 9)
        assert (x in times) == (-x in times) == (x < length)
        if x in times:
            assert [times[x], times[-x]] == pytest.approx(
                [time_of(criterion, x)] * 2, rel=ROUND_OFF
            )


def test_reference_point_elsewhere() -> None:
    # from the corner (-2, -2) the left tip is nearer than the right one
    corner = np.array([-2.0, -2.0])
    criterion = fx.CrackLengthVsTime((0.0, 1.0), (2.0, 4.0), reference="bottom_left")
    scene = plate(criterion)
    run(scene, fx.Time(0.9))
    times = release_times(scene)
    for tip in (-1.0, 1.0):
        first = float(np.hypot(*(np.array([tip, 0.0]) - corner)))
        for k in range(8):
            x, wanted = round(tip * (1.0 + 0.1 * k), 9), time_of(criterion, first + 0.1 * k)
            assert times.get(x, np.inf) == pytest.approx(
                wanted if wanted < 0.9 else np.inf, rel=ROUND_OFF
            )


def test_moving_along_with_the_body_changes_no_length() -> None:
    curve = ((0.2, 0.5, 0.9, 1.0), (0.9, 1.3, 1.3, 2.0))
    criterion = fx.CrackLengthVsTime(*curve, reference="upper_face", moving=True)
    # the plate is carried along by twelve elements
    carried = [fx.Displacement("bottom", x=1.2, y=0.0), fx.Displacement("top", x=1.2, y=1e-3)]
    scene = plate(criterion, supports=carried)
    history = run(scene, fx.Time(0.98))
    # displacements are a thousand times those that strain it: a million times the round-off
    assert abs(history["balance"]).max() <= 1e-6 * abs(history["external_work"]).max()
    times = release_times(scene)
    assert len(times) > 10
    for x, t in times.items():
        # lengths change by the strain of 1e-3/4; a reference point left behind would be off by 1.2
        assert t == pytest.approx(time_of(criterion, abs(x)), rel=5e-4)


@pytest.mark.slow
@pytest.mark.mpi
def test_reference_point_and_tip_that_move_are_followed() -> None:
    """Arms turned by a tenth: the way from the pin to the tip is that of their displacements."""
    criterion = fx.CrackLengthVsTime((0.0, 1.0), (9.0, 14.0), reference="pin_top", moving=True)
    still = fx.CrackLengthVsTime((0.0, 1.0), (9.0, 14.0), reference="pin_top")
    found = []
    for made in (criterion, still):
        scene = beam(made)
        seen: list[float] = []

        def look(event: str, row: Any, scene: fx.Scene = scene, seen: list[float] = seen) -> None:
            if event not in ("onset", "unstable"):
                return
            (fields,) = interface_fields(scene, displacement_function(scene), row["time"])
            first = scene.cracks[0].paths.initial[0]
            pin = np.array([0.0, 1.5 + row["u[pin_top.y]"], 0.0])
            tip = scene.pairs[0].surface.x[first] + fields.displacement[first]
            seen.append(float(np.linalg.norm(tip - pin)) + row["a[bond]"] - 10.0)

        scene.run(fx.Static(until=fx.Time(0.9)), observers=[look])
        times = np.array([t for _, t in scene.cracks[0].released])
        assert len(times) >= 4
        assert_balanced(scene.history)
        found.append((times, np.array(seen)))
        scene.close()
    (moved, ways), (fixed, other) = found
    assert [criterion.length(t) for t in moved] == pytest.approx(ways, rel=ROUND_OFF)
    assert [still.length(t) for t in fixed] != pytest.approx(other, rel=1e-3)


def test_front_of_a_solid_follows_the_curve() -> None:
    # the mean of the loaded edge is the middle of the width: nodes at the sides are farther away
    criterion = fx.CrackLengthVsTime((0.0, 1.0), (9.0, 14.0), reference="pin_top")
    scene = beam(criterion, solid=True)
    run(scene, fx.Time(0.99))
    surface = scene.pairs[0].surface
    times = dict(scene.cracks[0].released)
    for node in np.flatnonzero(surface.x[:, 0] >= 10.0 - 1e-9):
        x, _, z = surface.x[node]
        length = np.sqrt(10.0**2 + 1.5**2 + (z - 2.0) ** 2) + x - 10.0
        wanted = time_of(criterion, length)
        # nodes that a faster neighbour has left behind have their distance behind along the front's
        # normal, which f is scaled with; at f = 1 the scale is gone
        assert times.get(int(node), 2.0) == pytest.approx(
            wanted if wanted < 0.99 else 2.0, rel=1e-6
        )


def test_curve_that_ends_ends_the_growth() -> None:
    scene = plate(fx.CrackLengthVsTime((0.0, 1.0), (0.5, 1.25), reference="upper_face"))
    history = run(scene, fx.Releases(100))
    assert history.reason == "the curves of crack length against time have ended"
    assert set(release_times(scene)) == {-1.2, -1.1, -1.0, 1.0, 1.1, 1.2}
    assert history["time"][-1] == 1.0  # not at some huge load


# --- ways along the surface -----------------------------------------------------------------------


def test_ways_on_a_line_and_where_tips_come_from() -> None:
    front = plate(fx.CriticalStress(1.0, distance=0.1), order=2).solver.fronts[0]
    paths = SurfacePaths(front)
    for _ in range(2):  # the tip at x = 1 goes on to 1.2, by a corner and the midside ahead of it
        tips = front.tips()
        front.release(tips.force_nodes[np.argmax(front.surface.x[tips.node, 0])])
    tips = front.tips()
    right = int(np.argmax(front.surface.x[tips.node, 0]))
    ahead = paths.ahead(tips, right, 0.25)
    assert ahead.x[:, 0] == pytest.approx(1.2 + 0.05 * np.arange(7))  # whole faces
    assert ahead.s == pytest.approx(0.05 * np.arange(7))
    behind = paths.behind(tips, right, 0.099, np.ones(front.surface.n_nodes, dtype=bool))
    assert behind.x[:, 0] == pytest.approx([1.2, 1.15, 1.1])
    whole = paths.ahead(tips, right, 99.0)
    assert whole.x[-1, 0] == pytest.approx(2.0)  # the end of the surface
    found = paths.origins(tips)
    begin = front.surface.x[found.nearest, 0]
    assert begin == pytest.approx(np.sign(front.surface.x[tips.node, 0]))
    assert sorted(found.grown) == pytest.approx([0.0, 0.2])


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_ways_across_the_mesh_lines_of_a_surface(cell: str) -> None:
    surface = beam(fx.CrackOpening(1.0, distance=1.0), solid=True, mesh={"cell": cell}).pairs[0]
    surface = surface.surface
    oblique = surface.x @ np.array([1.0, 0.0, 0.5])  # mesh lines run along x and z
    front = Front(surface, oblique >= 12.0 - 1e-9, "oblique")
    paths, tips = SurfacePaths(front), front.tips()
    looked_at = 0
    for i in range(len(tips)):
        way, growth = paths.ahead(tips, i, 3.0), tips.frame[i, :, 1]
        if not 0.0 <= way.x[0, 2] + 3.0 * growth[2] <= 4.0:
            continue  # it leaves by the side
        looked_at += 1
        offset = way.x - way.x[0]
        # each step counts with its part along the growth direction, and the way keeps to that line
        assert way.s == pytest.approx(offset @ growth, abs=1e-12)
        aside = offset - np.outer(way.s, growth)
        assert np.linalg.norm(aside, axis=1).max() < paths.longest
        assert way.s[-1] >= 3.0
    assert looked_at >= 2


@pytest.mark.parametrize("elements", [1, 3])
def test_values_at_a_distance_in_the_field_of_a_crack(
    elements: int, caplog: pytest.LogCaptureFixture
) -> None:
    """Stress ahead of and opening behind a centre crack of second order, elements a/8.

    Closed forms of an infinite plate; measured -1.4 and -1.2 % at three elements. At one, where
    they are 11 and 5 % low, a warning says so.
    """
    d = elements / 8
    mesh = center_crack(width=40.0, height=40.0, n_crack=8, fine=0.5, growth=1.5, order=2)
    stress, opening = fx.CriticalStress(1e6, distance=d), fx.CrackOpening(1.0, distance=d)
    bond = fx.Interface("upper_face", "lower_face", beyond_crack, name="bond")
    scene = fx.Scene(
        mesh, materials=STEEL, model=fx.PlaneStrain(), supports=CORNERS, loads=TENSION,
        debonds=[fx.Debond(bond, stress, watch=[opening])],
    )  # fmt: skip
    with caplog.at_level("WARNING", logger="fxcrack"):
        row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)[-1]
    scene.close()
    ahead = (1.0 + d) / np.sqrt((1.0 + d) ** 2 - 1.0)
    behind = 4.0 * (1.0 - STEEL.nu**2) / STEEL.E * np.sqrt(1.0 - (1.0 - d) ** 2)
    near = {1: 0.12, 3: 0.025}[elements]
    assert float(row["s11[bond]"]) == pytest.approx(ahead, rel=near)
    assert float(row["cod[bond]"]) == pytest.approx(behind, rel=near)
    for owner in ("CriticalStress", "CrackOpening"):
        said = any(owner in r.message and "lengths of the element" in r.message
                   for r in caplog.records)  # fmt: skip
        assert said == (elements == 1)
