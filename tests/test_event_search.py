"""Where f = 1 is looked for: other powers of the load, several interfaces, bonds that soften."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.bodies import two_bodies
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.steps.newton_path import NewtonLoadPath

FAR = {"x": 0.0, "y": 0.0}
CLAMPED = [fx.Displacement("far_upper", **FAR), fx.Displacement("far_lower", **FAR)]
MET = {"linear": 1e-9, "newton": 1e-7}
"""How near to 1 f is at an onset: what the search for it accepts, on each solver."""


def arms(comm: MPI.Intracomm, debond: dict[str, Any], load: str, **options: Any) -> fx.Scene:
    """Arms opened by displacements ("pins"), by forces, or sheared ("slip")."""
    bond = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 10.0 - 1e-9, name="b", contact=True
    )
    supports, loads = list(CLAMPED), []
    if load == "forces":
        loads = [fx.PointForce("pin_top", (0.0, 1.0)), fx.PointForce("pin_bottom", (0.0, -0.2))]
    elif load == "slip":
        supports.append(fx.Displacement("pin_top", x=0.0, y=-1.0))
    else:
        supports += [
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0 if load == "mode I" else -0.2),
        ]
    return fx.Scene(
        dcb_2d(comm, length=20.0, dx=1.0, ny=2),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        supports=supports,
        loads=loads,
        debonds=[fx.Debond(bond, **debond)],
        **options,
    )


def onsets(history: fx.History, name: str) -> np.ndarray:
    return np.array([r[name] for r in history if r["event"] in ("onset", "unstable")], dtype=float)


def imbalance(history: fx.History) -> float:
    work = np.abs(history["external_work"].astype(float)).max()
    return float(np.abs(history["balance"].astype(float)).max() / work)


def run(scene: fx.Scene, stepping: str, n: int = 4) -> fx.History:
    return scene.run(fx.Static(until=fx.Releases(n), stepping=stepping), progress=False)


@pytest.mark.parametrize("solver", ["linear", "newton"])
@pytest.mark.parametrize("stepping", ["event", "path"])
def test_exponents_have_no_say_in_mode_one(stepping: str, solver: str) -> None:
    """The power law gives the loads of the exponent 1, and f = 1, at every onset."""
    found = []
    for exponent in (1.0, 0.5, 2.0, 3.5):
        criterion = fx.VCCT(GIc=0.2, GIIc=0.5, mix=fx.Power(am=exponent, an=exponent))
        scene = arms(MPI.COMM_SELF, {"criterion": criterion}, "mode I", solver=solver)
        history = run(scene, stepping)
        assert onsets(history, "f[b]") == pytest.approx([1.0] * 4, abs=MET[solver])
        found.append(onsets(history, "R[pin_top.y]"))
    for other in found[1:]:
        assert other == pytest.approx(found[0], rel=MET[solver])


def cubic(GI: Any, GII: Any, GIII: Any, GIc: Any, GIIc: Any, GIIIc: Any) -> Any:
    """A user's law that is no power of the load."""
    g = GI / GIc + GII / GIIc
    return 0.3 * g + 0.7 * g**3


@pytest.mark.parametrize("mix", [fx.Power(2.0, 3.0), fx.BK(2.0), cubic], ids=["power", "BK", "own"])
@pytest.mark.parametrize("release", [fx.StepRelease(), fx.ProgressiveRelease()])
@pytest.mark.parametrize("load", ["forces", "slip"])
def test_path_meets_every_onset_at_1(load: str, release: Any, mix: Any) -> None:
    """Also where softening bonds run through unstable states; both solvers find one history."""
    debond = {"criterion": fx.VCCT(GIc=0.2, GIIc=0.5, mix=mix), "release": release}
    found = []
    for solver in ("linear", "newton"):
        history = run(arms(MPI.COMM_SELF, debond, load, solver=solver), "path")
        assert onsets(history, "f[b]") == pytest.approx([1.0] * 4, abs=MET[solver])
        assert imbalance(history) < {"linear": 1e-12, "newton": 1e-7}[solver]
        found.append(onsets(history, "time"))
    assert found[1] == pytest.approx(found[0], rel=1e-7)
    if load == "forces":
        # growth at falling load: the load goes back after each release
        assert (np.diff(found[0]) < 0.0).all()


def three_layers(comm: MPI.Intracomm) -> Any:
    model = Blocks()
    x, y = np.linspace(0.0, 20.0, 21), np.linspace(0.0, 1.0, 3)
    low, mid, top = (
        model.add(name, (x, y + j), "quadrilateral", 1)
        for j, name in enumerate(("low", "mid", "top"))
    )
    for name, part in (
        ("low_top", low.part(y=1.0)), ("mid_low", mid.part(y=1.0)),
        ("mid_top", mid.part(y=2.0)), ("top_low", top.part(y=2.0)),
        ("pin top", top.part(x=0.0, y=3.0)), ("pin bottom", low.part(x=0.0, y=0.0)),
        ("far low", low.part(x=20.0)), ("far mid", mid.part(x=20.0)), ("far top", top.part(x=20.0)),
    ):  # fmt: skip
        model.group(name, part)
    return build(comm, "three layers", lambda: model, None)


def layered(comm: MPI.Intracomm, second: float, release: Any, **options: Any) -> fx.Scene:
    """Three layers pulled apart by forces; the toughness of the lower interface is given."""
    upper = fx.Interface("top_low", "mid_top", lambda x: x[0] >= 5.0 - 1e-9, name="upper")
    lower = fx.Interface("mid_low", "low_top", lambda x: x[0] >= 3.0 - 1e-9, name="lower")
    return fx.Scene(
        three_layers(comm),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        supports=[fx.Displacement(name, **FAR) for name in ("far low", "far mid", "far top")],
        loads=[fx.PointForce("pin top", (0.0, 1.0)), fx.PointForce("pin bottom", (0.0, -1.0))],
        debonds=[
            fx.Debond(upper, fx.VCCT(GIc=0.2), release),
            fx.Debond(lower, fx.VCCT(GIc=second), release),
        ],
        **options,
    )


@pytest.mark.mpi
@pytest.mark.parametrize("release", [fx.StepRelease(), fx.ProgressiveRelease()])
@pytest.mark.parametrize("second", [0.2, 0.02])
def test_path_with_two_interfaces(comm: MPI.Intracomm, second: float, release: Any) -> None:
    """The load goes to where the largest f of both is 1, whichever interface grows."""
    found = []
    for solver in ("linear", "newton"):
        history = run(layered(comm, second, release, solver=solver), "path", n=5)
        both = np.array([onsets(history, f"f[{name}]") for name in ("upper", "lower")])
        assert np.nanmax(both, axis=0) == pytest.approx([1.0] * 5, abs=MET[solver])
        assert imbalance(history) < {"linear": 1e-12, "newton": 1e-7}[solver]
        found.append(onsets(history, "time"))
    assert found[1] == pytest.approx(found[0], rel=1e-7)
    last = history.rows[-1]
    grown = last["released[upper]"], last["released[lower]"]
    assert grown == ((5, 0) if second == 0.2 else (0, 5))


# -- f that jumps over 1 ---------------------------------------------------------------------------

X = np.array([
    0.0, 0.5819280067173768, 1.757979546909272, 2.428218323995548, 3.208952756281671,
    3.6745139843117904, 4.592485817490262, 5.324983703491961, 6.3508146102378165,
    6.989476209267999, 7.841274590740383, 8.435421937920307, 9.104879410054513, 10.0,
])  # fmt: skip


def yielding(first: int = 5) -> fx.Scene:
    """Arms of unequal stiffness that yield while their bonds soften."""
    up, down = 0.5957258841562629, 1.741446757988873

    def mesh() -> Blocks:
        y = np.linspace(0.0, up, 4), np.linspace(-down, 0.0, 4)
        model, upper, lower = two_bodies((X, X), y, cell="quadrilateral", order=1)
        for name, part in (
            ("pin_top", upper.part(x=0.0, y=up)), ("pin_bottom", lower.part(x=0.0, y=-down)),
            ("far_upper", upper.part(x=10.0)), ("far_lower", lower.part(x=10.0)),
        ):  # fmt: skip
            model.group(name, part)
        return model

    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= X[first] - 1e-5, name="b")
    plastic = {"yield_stress": 0.048030817971857445, "hardening": 0.05}
    pull = 0.1227866109341413
    return fx.Scene(
        build(MPI.COMM_SELF, "arms", mesh),
        model=fx.PlaneStrain(1.5),
        materials={
            "upper": fx.Plastic(1.0, 0.45, **plastic),
            "lower": fx.Plastic(25.82819598505742, 0.3, **plastic),
        },
        supports=[
            *CLAMPED,
            fx.Displacement("pin_top", x=0.0, y=pull),
            fx.Displacement("pin_bottom", x=0.11480787124864769, y=-0.3655941963148421),
        ],
        debonds=[
            fx.Debond(
                bond, fx.VCCT(GIc=1e-4, GIIc=3e-4, mix=fx.BK(eta=1.6)), fx.ProgressiveRelease()
            )
        ],
    )


@pytest.mark.slow
def test_search_among_yielding_bodies_and_softening_bonds_is_bounded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Bonds that may run through unstable states in bodies that yield; f may jump over 1."""
    trials: list[float] = []
    original = NewtonLoadPath._try

    def spy(self: NewtonLoadPath, at: float, **options: Any) -> Any:
        trials.append(at)
        return original(self, at, **options)

    monkeypatch.setattr(NewtonLoadPath, "_try", spy)
    history = run(yielding(), "event")
    met = onsets(history, "f[b]")
    jumps = [r["f[b]"] for r in history if r["event"] == "snap"]
    assert len(met) == 4 and all(f > 1.0 for f in jumps)
    assert np.sort(met)[: 4 - len(jumps)] == pytest.approx([1.0] * (4 - len(jumps)), abs=1e-7)
    # halving to round-off needs 44 trials an event, and is never more than 3 behind
    assert len(trials) < 4 * (44 + 3)


@pytest.mark.slow
def test_bonds_that_soften_at_one_load_in_finite_strain() -> None:
    """Increments of next to no length lead on where bonds run through unstable states.

    In mode II a front of three nodes, whose bonds soften one after the other, made increments of
    1e-12 of the load there, each of which left f below 1: hundreds of rows, and no end. The scene
    has 39 rows to the end now, of which round-off may change some.
    """
    bond = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 20.0 - 1e-9, name="b", contact=True
    )
    clamped = {"x": 0.0, "y": 0.0, "z": 0.0}
    scene = fx.Scene(
        dcb_3d(MPI.COMM_SELF, length=40.0, width=5.0, height=1.5, dx=1.0, dy=2.5, ny=1),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.Solid(),
        supports=[
            fx.Displacement("far_upper", **clamped),
            fx.Displacement("far_lower", **clamped),
            fx.Displacement("pin_top", y=-1.0),
        ],
        debonds=[
            fx.Debond(
                bond,
                fx.VCCT(GIc=0.2, GIIc=0.3, mix=fx.BK(eta=1.6)),
                release=fx.ProgressiveRelease(),
            )
        ],
        effects=[fx.FiniteStrain()],
    )
    rows = []

    def look(event: str, row: Any) -> None:
        rows.append(event)
        assert len(rows) < 100, "it crawls"

    step = fx.Static(until=fx.CrackLength(bond, 23.0))
    history = scene.run(step, progress=False, observers=[look])
    assert history.reason == "crack length 23 of 'b' reached"
    assert imbalance(history) < 1e-4
