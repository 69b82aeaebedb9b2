"""States of the interfaces are carried over to other retained jumps, never found anew."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.equilibrium.interface_state import InterfaceState
from fxcrack.meshes.dcb import dcb_2d


def sheared(comm: MPI.Intracomm, release: Any, *, contact: bool, **options: Any) -> fx.Scene:
    """End-loaded split: bonds that soften in shear run open at once, pressed or not."""
    bond = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 5.0 - 1e-9, name="b", contact=contact
    )
    return fx.Scene(
        dcb_2d(comm, length=12.0, dx=1.0, ny=2),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("far_upper", x=0.0, y=0.0),
            fx.Displacement("far_lower", x=0.0, y=0.0),
            fx.Displacement("pin_top", x=0.0, y=-1.0),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=0.2), release)],
        **options,
    )


def releases(history: fx.History) -> list[tuple[float, float]]:
    return [(r["time"], r["released[b]"]) for r in history if r["event"] == "release"]


@pytest.mark.mpi
@pytest.mark.parametrize("contact", [True, False])
@pytest.mark.parametrize("release", [fx.ProgressiveRelease(), fx.RampRelease()])
def test_one_step_two_steps_and_small_sets_give_one_history(
    comm: MPI.Intracomm, release: Any, contact: bool
) -> None:
    whole = sheared(comm, release, contact=contact).run(fx.Static(until=fx.Releases(6)))
    twice = sheared(comm, release, contact=contact)
    twice.run(fx.Static(until=fx.Releases(3)))
    small = sheared(comm, release, contact=contact, options=fx.CondensedOptions(rows=1.0))
    for history in (
        twice.run(fx.Static(until=fx.Releases(6))),
        small.run(fx.Static(until=fx.Releases(6))),
    ):
        assert np.array(releases(history)) == pytest.approx(np.array(releases(whole)), rel=1e-9)
        work = history["external_work"].astype(float)
        # round-off of some condensations, each of which moves the openings by 1e-13
        assert np.abs(history["balance"].astype(float)).max() < 1e-11 * np.abs(work).max()


@pytest.mark.mpi
def test_arrays_of_a_state_give_it_back(comm: MPI.Intracomm) -> None:
    scene = sheared(comm, fx.ProgressiveRelease(), contact=True)
    scene.run(fx.Static(until=fx.Releases(3)))
    state = scene.solver.interface_state()
    again = InterfaceState.from_arrays(state.arrays(), 1)
    n = scene.solver.system.n_retained
    assert len(state.states.bonds) >= 1 and state.states.closed.any()
    assert again.nodes_to_retain(scene.pairs) == state.nodes_to_retain(scene.pairs)
    assert np.array_equal(again.bonded[0], state.bonded[0])
    for name in ("jump", "force"):
        values = getattr(again.equilibrium, name)
        there = again.values(values, scene.solver.index, n)
        assert np.array_equal(there, getattr(state.equilibrium, name))
    for name in ("closed", "contact"):
        there = again.values(getattr(again.states, name), scene.solver.index, n)
        assert np.array_equal(there, getattr(state.states, name))
    for a, b in zip(again.states.bonds, state.states.bonds, strict=True):
        assert (a.strength, a.final, a.largest) == (b.strength, b.final, b.largest)
    assert again.states.finished == state.states.finished
