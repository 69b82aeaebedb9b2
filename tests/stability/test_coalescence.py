"""Tips that meet, the last bond, a body that comes free, a crack that runs out of its edge.

Hard: the last node between two tips belongs to both, a body on one bond is nearly free, and after
the last release there is no tip to look at. Must hold: every node goes once, the step ends with the
right reason, the state after it (or the last one before a body would fly off) is an equilibrium,
and all invariants of :class:`~stability.watch.Watch`; on any number of ranks.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from specimens import specimen

import fxcrack as fx
from stability.beams import FAR, SELF, arms, watched

pytestmark = pytest.mark.stability

LAWS = {"at once": fx.StepRelease(), "softening": fx.ProgressiveRelease()}


def island(
    comm: MPI.Intracomm, order: int, release: fx.StepRelease | fx.ProgressiveRelease
) -> fx.Scene:
    """A bonded island from 8 to 16 in arms pulled apart at both ends."""
    interface = fx.Interface(
        "upper_face",
        "lower_face",
        bonded=lambda x: (x[0] >= 8.0 - 1e-9) & (x[0] <= 16.0 + 1e-9),
        contact=True,
        name="bond",
    )
    return fx.Scene(
        arms(comm, length=24.0, order=order),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("end_upper", x=0.0, y=1.0),
            fx.Displacement("end_lower", x=0.0, y=-1.0),
            # not the same as at the other end: the tips do not arrive together
            fx.Displacement("far_upper", x=0.0, y=0.8),
            fx.Displacement("far_lower", x=0.0, y=-0.8),
        ],
        debonds=[fx.Debond(interface, fx.VCCT(GIc=0.2), release)],
    )


@pytest.mark.quick("1-softening", "2-at once")
@pytest.mark.mpi
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("order", [1, 2])
def test_tips_meet(comm: MPI.Intracomm, order: int, law: str) -> None:
    histories = []
    for where in (SELF, comm):
        scene = island(where, order, LAWS[law])
        bonded = int(scene.solver.fronts[0].bonded.sum())
        # softening bonds need more load after the last has begun to let go
        history = watched(scene, until=fx.Time(50.0))
        assert history.reason == "time 50 reached"
        assert history.rows[-1]["released[bond]"] == bonded == (9 if order == 1 else 17)
        assert not scene.solver.fronts[0].bonded.any() and not scene.solver.system.soft.bonds
        assert len({r.node for r in scene.cracks[0].records}) == bonded
        histories.append(history)
        scene.close()
    one, several = histories
    assert [r["event"] for r in one] == [r["event"] for r in several]
    assert several["strain_energy"] == pytest.approx(one["strain_energy"], rel=1e-8, abs=1e-12)
    # 8 of bond (and half an element at each end, which stands for itself)
    if law == "softening" and order == 1:
        assert one["released_energy"][-1] - one["snap_energy"][-1] == pytest.approx(
            0.2 * 9.0, rel=1e-6
        )


@pytest.mark.parametrize("law", LAWS)
def test_body_that_comes_free(law: str) -> None:
    """The upper arm hangs on the bond and is pulled: at the end nothing would hold it."""
    scene = specimen(
        arms(length=20.0),
        supports=[FAR[1], fx.Displacement("end_lower", x=0.0, y=0.0)],
        loads=[fx.Traction("top", (0.0, 1.0))],
        interface=fx.Interface(
            "upper_face", "lower_face", bonded=lambda x: x[0] >= 15.0 - 1e-9, name="bond"
        ),
        criterion=fx.VCCT(GIc=0.2, unstable_tolerance=np.inf),
        release=LAWS[law],
    )
    history = watched(scene, until=fx.Releases(99))
    assert history.reason.startswith("total separation: ")
    assert history.reason.endswith("the step ends in the last equilibrium before it")
    assert np.isfinite(history["v[top]"]).all()


@pytest.mark.parametrize("contact", [False, True])
def test_crack_runs_out_of_its_edge(contact: bool) -> None:
    """Arms held at x = 0 alone: the crack runs to the free end, and both arms are held still."""
    scene = specimen(
        arms(length=20.0),
        a0=15.0,
        contact=contact,
        supports=[
            fx.Displacement("end_upper", x=0.0, y=1.0),
            fx.Displacement("end_lower", x=0.0, y=-1.0),
        ],
        criterion=fx.VCCT(GIc=0.2),
    )
    history = watched(scene, until=fx.Releases(99))
    assert history.reason == "total separation: no crack tip is left"
    assert history["a[bond]"][-1] == pytest.approx(20.0)
    assert history["strain_energy"][-1] == pytest.approx(0.0, abs=1e-9)


def test_last_bond_that_lets_bodies_turn() -> None:
    """Pinned arms on their last bond turn about it: no load reaches the criterion."""
    scene = specimen(arms(length=20.0), a0=15.0, criterion=fx.VCCT(GIc=0.2))
    history = watched(scene, until=fx.Releases(99))
    assert history.reason.startswith("total separation but for 1 bonded node, about which the ")
    assert history["a[bond]"][-1] == pytest.approx(20.0)
