"""Tangents used again: the same history with fewer of them, the same S from a renewed factor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import (
    HELD_FAR,
    PINS,
    bond,
    dcb,
    gathered_vector,
    grow_to,
    largest_imbalance,
    onsets,
    specimen,
)

import fxcrack as fx
from fxcrack.base.errors import ConvergenceError
from fxcrack.base.timings import Timings
from fxcrack.condensation.direct import DirectCondensation
from fxcrack.effects import FiniteStrain
from fxcrack.meshes.dcb import dcb_2d

SAME = 1e-7  # f = 1 is met to 1e-9, the residual to 1e-10 of the forces; slender arms amplify that


def peel(comm: MPI.Intracomm, *, reuse: bool, **options: Any) -> fx.Scene:
    """Arms that turn by some 20 degrees before the crack grows."""
    return dcb(
        comm,
        dx=2.0,
        ny=1,
        effects=[FiniteStrain()],
        newton=fx.NewtonOptions(reuse=reuse),
        **{"criterion": fx.VCCT(GIc=5.0), **options},
    )


@pytest.mark.slow
@pytest.mark.mpi
def test_same_history_with_fewer_tangents(comm: MPI.Intracomm) -> None:
    scenes = [peel(comm, reuse=reuse) for reuse in (True, False)]
    one, other = (grow_to(s, 36.0, maximum=1.0) for s in scenes)
    assert len(onsets(one)) == len(onsets(other)) == 3
    for a, b in zip(onsets(one), onsets(other), strict=True):
        for name in ("time", "R[pin_top.y]", "GI[bond]"):
            assert a[name] == pytest.approx(b[name], rel=SAME)
    # both integrals along the way are those of cubics; how many moves there are differs
    assert one["external_work"][-1] == pytest.approx(other["external_work"][-1], rel=1e-5)
    assert max(map(largest_imbalance, (one, other))) < 1e-5
    made = [s.solver.timings.factorizations for s in scenes]
    assert made[0] < 0.8 * made[1], made


@pytest.mark.quick("event-release0")
@pytest.mark.parametrize(
    ("stepping", "release"),
    [
        ("event", fx.StepRelease()),
        ("increment", fx.StepRelease()),
        ("path", fx.StepRelease()),
        ("event", fx.ProgressiveRelease()),
        ("increment", fx.ProgressiveRelease()),
    ],
)
def test_same_history_with_every_stepping(
    stepping: str, release: fx.StepRelease | fx.ProgressiveRelease
) -> None:
    controls: dict[str, Any] = {"stepping": stepping, "maximum": 0.5}
    if stepping == "increment":
        controls |= {"initial": 0.25, "max_cutbacks": 30}
    criterion = fx.VCCT(GIc=5.0, tolerance=0.05)
    ends = []
    for reuse in (True, False):
        scene = peel(MPI.COMM_SELF, reuse=reuse, criterion=criterion, release=release)
        history = grow_to(scene, 34.0, **controls)
        assert largest_imbalance(history) < 1e-4
        ends.append(history.rows[-1])
    assert ends[0]["a[bond]"] == ends[1]["a[bond]"]
    for name in ("time", "R[pin_top.y]", "strain_energy"):
        assert ends[0][name] == pytest.approx(ends[1][name], rel=1e-6)


def test_rates_by_exact_closure_are_those_of_the_state() -> None:
    """S itself counts there: with a tangent that is off G would be, too."""
    criterion = fx.VCCT(GIc=5.0, method="closure")
    found = [
        onsets(grow_to(peel(MPI.COMM_SELF, reuse=reuse, criterion=criterion), 34.0, maximum=1.0))
        for reuse in (True, False)
    ]
    assert len(found[0]) >= 2
    for a, b in zip(*found, strict=True):
        assert a["GI[bond]"] == pytest.approx(b["GI[bond]"], rel=1e-5)
        assert a["time"] == pytest.approx(b["time"], rel=1e-5)


@pytest.mark.slow
@pytest.mark.mpi
def test_a_trial_that_is_forgotten_leaves_the_tangent_as_it_was(comm: MPI.Intracomm) -> None:
    scene = peel(comm, reuse=True)
    scene.run(fx.Static(until=fx.Time(1.0), maximum=1.0))
    model: Any = scene.solver
    before, made = model.system.schur.copy(), model.timings.factorizations
    u = gathered_vector(model.u)
    model.move(scene.loads_at(2.0), model.state.force, 2.0, 1.0)
    assert model.timings.factorizations > made
    assert np.abs(model.system.schur - before).max() > 1e-6 * np.abs(before).max()
    made = model.timings.factorizations
    model.revert()
    assert model.timings.factorizations == made  # nothing is factored for it
    assert np.array_equal(model.system.schur, before)
    assert np.array_equal(gathered_vector(model.u), u)
    # and it serves: the same trial again gives the same end
    first = model.move(scene.loads_at(2.0), model.state.force, 2.0, 1.0)
    model.revert()
    again = model.move(scene.loads_at(2.0), model.state.force, 2.0, 1.0)
    size = np.abs(first.jump).max()  # sums of several ranks come in any order
    assert np.abs(first.jump - again.jump).max() < 1e-12 * size
    scene.close()


def test_a_tangent_that_cannot_be_factored_leaves_a_model_that_can_go_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from fxcrack.base.errors import SolverError

    scene = peel(MPI.COMM_SELF, reuse=True)
    scene.run(fx.Static(until=fx.Time(1.0), maximum=1.0))
    model: Any = scene.solver
    state, loads = model.state, scene.loads_at(2.0)

    def fail(self: Any, stiffness: Any) -> None:
        raise SolverError("MUMPS ran out of memory, by design")

    with monkeypatch.context() as patch:
        patch.setattr(DirectCondensation, "renew", fail)
        with pytest.raises(ConvergenceError, match="ran out of memory, by design"):
            model.move(loads, state.force, 2.0, 1.0)
    assert model.state is state
    assert np.isfinite(model.move(loads, state.force, 2.0, 1.0).jump).all()
    scene.close()


@pytest.mark.quick("False-schur")
@pytest.mark.mpi
@pytest.mark.parametrize("method", ["schur", "columns"])
@pytest.mark.parametrize("bordered", [True, False])
def test_condensing_again_is_condensing_anew(
    comm: MPI.Intracomm, method: str, bordered: bool
) -> None:
    """Another K of the same pattern in the memory at hand, with entries that were zero before."""
    more: dict[str, Any] = {}
    if bordered:
        more = {
            "loads": [fx.Traction("top", (0.1, 0.3))],
            "monitors": [fx.Monitor("far_upper", (0.0, 1.0))],
        }
    scene = specimen(dcb_2d(comm, length=20.0, dx=1.0, ny=2), a0=8.0, supports=PINS, **more)
    scene.run(fx.Static(until=fx.Releases(1)))
    model: Any = scene.solver
    stiffness, coordinates = model.stiffness, model.condensation.coordinates
    poor = stiffness.copy()
    poor.shift(0.1 * float(stiffness.norm()))  # any other one that is definite
    options = {"method": method, "definite": False}
    twice = DirectCondensation(
        poor, coordinates, model.borders, Timings(), renewable=True, **options
    )
    first = twice.schur.copy()
    twice.renew(stiffness)
    anew = DirectCondensation(stiffness, coordinates, model.borders, Timings(), **options)
    size = np.abs(anew.schur).max()
    assert np.abs(first - anew.schur).max() > 1e-3 * size
    assert np.abs(twice.schur - anew.schur).max() < 1e-10 * size
    assert np.abs(twice.diagonal - anew.diagonal).max() == 0.0
    x = np.linspace(-1.0, 1.0, len(first))
    ways = [c.expanded(x) for c in (twice, anew)]
    u = [gathered_vector(w) for w in ways]
    assert np.abs(u[0] - u[1]).max() < 1e-9 * np.abs(u[1]).max()
    for w in ways:
        w.destroy()
    twice.destroy(keep_transform=True)
    anew.destroy(keep_transform=True)
    poor.destroy()
    scene.close()


@pytest.mark.parametrize("reuse", [True, False])
def test_whole_steps_bend_a_slender_strip(reuse: bool) -> None:
    """Bisshopp and Drucker (1945): P L^2/(E I) = 5 bends a cantilever's end by 0.7138 of L."""
    length, height, modulus = 10.0, 0.1, 70e3 / (1.0 - 0.3**2)
    mesh = dcb_2d(length=11.0, height=height, dx=0.25, ny=1, order=2)
    force = 5.0 * modulus * height**3 / 12.0 / length**2
    scene = specimen(
        mesh,
        a0=length,
        criterion=fx.VCCT(GIc=1e3),
        supports=HELD_FAR,
        loads=[
            fx.PointForce("pin_top", (0.0, force)),
            fx.PointForce("pin_bottom", (0.0, -force)),
        ],
        monitors=[fx.Monitor("pin_top", (0.0, 1.0), name="end")],
        effects=[FiniteStrain()],
        newton=fx.NewtonOptions(reuse=reuse, balance=np.inf),  # in one increment
    )
    history = scene.run(fx.Static(until=fx.Time(1.0)))
    assert history["m[end]"][-1] == pytest.approx(0.7138 * length, rel=0.01)
    counts = scene.solver.counts
    assert counts.failures == 0
    assert counts.iterations < 40


# -- energies that must add up ---------------------------------------------------------------------


def closing(balance: float = 1e-5, **step: Any) -> fx.History:
    """Arms bent far apart, then pressed together in increments far too long for that."""
    way = fx.Amplitude((0.0, 1.0, 2.0, 3.0), (0.0, 3.0, -0.02, 3.0))
    supports = [fx.Displacement(f"far_{s}", x=0.0, y=0.0) for s in ("upper", "lower")]
    supports += [
        fx.Displacement(f"pin_{name}", y=sign, amplitude=way)
        for name, sign in (("top", 1.0), ("bottom", -1.0))
    ]
    scene = specimen(
        dcb_2d(MPI.COMM_SELF, length=20.0, dx=1.0, ny=1),
        interface=bond(8.0, contact=True),
        criterion=fx.VCCT(GIc=1e3, tolerance=0.3),
        supports=supports,
        effects=[FiniteStrain()],
        newton=fx.NewtonOptions(balance=balance),
    )
    return scene.run(fx.Static(until=fx.Time(3.0), **step))


@pytest.mark.slow
@pytest.mark.parametrize(
    "step",
    [
        {},
        {"stepping": "increment", "initial": 0.5, "maximum": 0.5},
        {"stepping": "increment", "initial": 0.1, "maximum": 0.1},
    ],
    ids=["event", "long increments", "increments"],
)
def test_increments_whose_energies_do_not_add_up_are_divided(step: dict[str, Any]) -> None:
    history = closing(**step)
    assert history.reason == "time 3 reached"
    if "maximum" in step:  # rows are those of the increments that were asked for
        size = np.diff(history["time"].astype(float))
        assert size[size > 0.0] == pytest.approx(step["maximum"], rel=1e-9)
    # integrals of one way are off by 1e-5 of the stored energy at most; undivided by up to 0.1
    assert largest_imbalance(history) < 1e-4


def test_increments_are_taken_whole_where_that_is_asked() -> None:
    step = {"stepping": "increment", "initial": 0.5, "maximum": 0.5}
    assert largest_imbalance(closing(np.inf, **step)) > 1e-2


def test_options_that_make_no_sense_are_refused() -> None:
    for wrong in ({"tolerance": 0.0}, {"max_iterations": 0}, {"balance": float("nan")}):
        with pytest.raises(fx.InputError, match="NewtonOptions: "):
            fx.NewtonOptions(**wrong)
