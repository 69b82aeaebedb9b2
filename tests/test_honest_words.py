"""What a run says of its limits, each once and only where it matters."""

from __future__ import annotations

import logging
import re

import pytest
from mpi4py import MPI
from specimens import FORCES, HELD_FAR, PINS, STEEL, grow_to, interface_of, specimen

import fxcrack as fx
from fxcrack.error_estimate import Estimate
from fxcrack.meshes.dcb import dcb_2d


def plate(comm: MPI.Comm, length: float = 60.0) -> fx.Mesh:
    return dcb_2d(comm, length=length, dx=2.0, ny=1)


def test_unstable_growth_is_told_from_onsets_at_one() -> None:
    """Under forces f grows as a^2: every node after the first goes at the same load, at f > 1."""
    scene = specimen(plate(MPI.COMM_SELF), supports=HELD_FAR, loads=FORCES)
    history = grow_to(scene, 40.0)
    f = [float(r["f[bond]"]) for r in history if r["event"] == "onset"]
    assert len(f) == 5
    assert f[0] == pytest.approx(1.0, abs=1e-6)
    assert min(f[1:]) > 1.1  # (32/30)^2 = 1.14, and a little less as arms shear, too
    said = history.describe()
    assert f"unstable growth: f is above 1 at 4 of 5 onsets, up to {max(f):.3g}" in said
    scene.close()
    stable = specimen(plate(MPI.COMM_SELF))
    assert "unstable" not in grow_to(stable, 36.0).describe()
    stable.close()


def test_arms_on_their_last_bonded_node() -> None:
    scene = specimen(dcb_2d(MPI.COMM_SELF, length=20.0, dx=1.0, ny=2), a0=15.0)
    reason = scene.run(fx.Static(until=fx.CrackLength(interface_of(scene), 50.0))).reason
    assert reason.startswith("total separation but for 1 bonded node, about which the bodies turn")
    scene.close()


def test_a_tie_needs_no_tip(caplog: pytest.LogCaptureFixture) -> None:
    whole = fx.Interface("upper_face", "lower_face", name="tie")
    parts = {"materials": STEEL, "model": fx.PlaneStrain(), "supports": PINS}
    tied = fx.Scene(plate(MPI.COMM_SELF), bonds=[whole], **parts)
    tied.run(fx.Static(until=fx.Time(1e-3)))
    assert not caplog.text
    fx.Scene(plate(MPI.COMM_SELF), debonds=[fx.Debond(whole, fx.VCCT(GIc=0.2))], **parts).close()
    assert "has no crack tip" in caplog.text
    tied.close()


def test_a_clamped_end(caplog: pytest.LogCaptureFixture) -> None:
    """Information, once."""
    caplog.set_level(logging.INFO, logger="fxcrack")
    scene = specimen(plate(MPI.COMM_SELF), supports=[*PINS, *HELD_FAR])
    for time in (1e-3, 2e-3):
        scene.run(fx.Static(until=fx.Time(time)))
    (said,) = (r for r in caplog.records if "supports hold both faces" in r.getMessage())
    assert said.levelname == "INFO"
    scene.close()


@pytest.mark.parametrize(
    ("order", "difference", "simplices", "words"),
    [
        (1, 0.008, False, "order=2 on this mesh, or in first order elements of at most about 0.62"),
        (1, 0.04, False, "order=2 with elements of at most about 0.25, or in first order"),
        (2, 0.04, False, "elements of at most about 0.25 at the crack.* [(]keep order=2[)]"),
        (2, 0.04, True, "0.25 at the crack.* first-order simplices, which are far too stiff"),
    ],
)
def test_accuracy_recommends_order_and_size(
    order: int, difference: float, simplices: bool, words: str
) -> None:
    """1 % is asked for at size 1: errors fall with the size, in second order to half as much."""
    error = difference * (2.0 if order == 1 else 1.0)
    estimate = Estimate(error, error, 0.0, None, order, 1.0, difference, "bond", simplices)
    assert re.search(words, estimate.remedy(0.01))
