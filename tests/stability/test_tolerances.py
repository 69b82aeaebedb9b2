"""Controls far from sensible: f_tol from 0.3 to 1e-6, increments 1e9 off, loads that jump or turn.

Hard: increments are cut back thirty times and more, or grow fifty times before anything happens;
at a jump of the load there is no smaller load to go back to; a load turns around just when a node
goes. Must hold: the same nodes go at loads within the tolerance; what cannot be reached ends the
step with the reason in words and the last good state; all invariants of
:class:`~stability.watch.Watch`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import specimen

import fxcrack as fx
from stability.beams import arms, grown, watched

pytestmark = pytest.mark.stability

A0 = 20.0


def beam(amplitude: Any = None, *, contact: bool = False, **criterion: Any) -> fx.Scene:
    way = fx.Ramp() if amplitude is None else amplitude
    return specimen(
        arms(MPI.COMM_SELF),
        a0=A0,
        contact=contact,
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0, amplitude=way),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0, amplitude=way),
        ],
        criterion=fx.VCCT(GIc=0.2, **criterion),
    )


def onset_time() -> float:
    return float(next(r for r in grown(beam(), 1) if r["event"] == "onset")["time"])


# -- tolerance -------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [0.3, 0.1, 1e-2, 1e-4, 1e-6])
def test_tolerance(tolerance: float) -> None:
    """Load over that at f = 1 within (1 + f_tol)^(1/2) at the first release, f within f_tol."""
    exact = onset_time()
    history = grown(
        beam(tolerance=tolerance), 4, stepping="increment", initial=0.1, max_cutbacks=60,
        minimum=1e-13,
    )  # fmt: skip
    assert history.reason == "4 nodes released"
    rows = [r for r in history if r["event"] == "increment"]
    assert max(float(r["f[bond]"]) for r in rows) <= 1.0 + tolerance + 1e-12
    first = next(float(r["time"]) for r in rows if r["f[bond]"] >= 1.0)
    assert exact * (1.0 - 1e-12) <= first <= exact * np.sqrt(1.0 + tolerance) * (1.0 + 1e-9)


def test_tolerance_that_needs_more_cutbacks_than_allowed() -> None:
    history = watched(
        beam(tolerance=1e-9), until=fx.Releases(3), stepping="increment", max_cutbacks=5
    )
    assert history.reason.startswith("stopped: f = ")
    assert "cutbacks; allow unstable growth" in history.reason or "minimum" in history.reason
    assert history.rows[-1]["f[bond]"] <= 1.0 + 1e-9 + 1e-12


# -- increments ------------------------------------------------------------------------------------


@pytest.mark.quick("True-*")
@pytest.mark.parametrize("factor", [1e-9, 1e-3, 1e3, 1e9])
@pytest.mark.parametrize("contact", [False, True])
def test_first_increment_far_off(factor: float, contact: bool) -> None:
    """Cut back, or grown, to the same nodes and nearly the same loads."""
    exact = onset_time()
    initial = factor * exact
    history = grown(
        beam(contact=contact), 4, stepping="increment", initial=initial,
        minimum=min(initial, 1e-6 * exact), max_cutbacks=60,
    )  # fmt: skip
    assert history.reason == "4 nodes released"
    first = next(float(r["time"]) for r in history if r.get("f[bond]", 0.0) >= 1.0)
    assert exact * (1.0 - 1e-12) <= first <= exact * np.sqrt(1.2)


def test_first_increment_too_large_for_the_cutbacks_allowed() -> None:
    history = watched(beam(), until=fx.Releases(3), stepping="increment", initial=1e9)
    assert history.reason.startswith("stopped: f = ") and "after 5 cutbacks" in history.reason
    assert history.rows[-1]["time"] == 0.0


@pytest.mark.parametrize("factor", [1e-200, 1e-9, 1e9, 1e200])
def test_load_given_far_off(factor: float) -> None:
    """A prescribed opening 1e-200 or 1e200 at time 1: the time of release scales, nothing else."""
    scene = specimen(
        arms(MPI.COMM_SELF),
        a0=A0,
        contact=True,
        supports=[
            fx.Displacement("pin_top", x=0.0, y=factor),
            fx.Displacement("pin_bottom", x=0.0, y=-factor),
        ],
        criterion=fx.VCCT(GIc=0.2),
    )
    if not 1e-30 < factor < 1e30:
        # times beyond 1e30 are taken for never, and squares beyond 1e308 do not exist
        with np.errstate(all="ignore"):
            try:
                reason = scene.run(fx.Static(until=fx.Releases(3)), progress=False).reason
            except fx.EnergyError as error:  # at time 1 energies are beyond all numbers
                reason = str(error)
        words = "not reached" if factor < 1.0 else "no finite number at time 1"
        assert reason == "3 nodes released" or words in reason
        return
    history = grown(scene, 3)
    onset = next(r for r in history if r["event"] == "onset")
    assert onset["time"] * factor == pytest.approx(onset_time(), rel=1e-9)


# -- loads that jump and turn ----------------------------------------------------------------------


@pytest.mark.parametrize("width", [1e-3, 1e-12])
def test_jump_of_the_load(width: float) -> None:
    """From a fifth of the load of onset to twice it within ``width``: nodes go on the way up."""
    exact = onset_time()
    way = fx.Amplitude((0.0, 1.0, 1.0 + width, 2.0), (0.0, 0.2 * exact, 2.0 * exact, 2.0 * exact))
    history = watched(beam(way), until=fx.Time(2.0))
    assert history.reason == "time 2 reached"
    even = watched(beam(fx.Amplitude((0.0, 2.0), (0.0, 2.0 * exact))), until=fx.Time(2.0))
    end, other = history.rows[-1], even.rows[-1]
    assert end["released[bond]"] == other["released[bond]"] > 3
    # the path of the load in time does not matter
    assert end["R[pin_top.y]"] == pytest.approx(other["R[pin_top.y]"], rel=1e-9)
    assert end["released_energy"] == pytest.approx(other["released_energy"], rel=1e-6)


@pytest.mark.quick("*-event", "1.0-increment")
@pytest.mark.parametrize("stepping", ["event", "increment"])
@pytest.mark.parametrize("turn", [0.9, 1.0, 1.1])
def test_load_turns_before_at_and_after_release(turn: float, stepping: str) -> None:
    """Up to ``turn`` times the onset, down past zero to pressing, and up again to the same.

    Before: nothing goes. After: what has gone stays gone, nothing more goes on the way down nor on
    the way up to the same load. Pressed, the faces touch and do not overlap.
    """
    top = turn * onset_time()
    way = fx.Amplitude((0.0, 1.0, 2.0, 3.0), (0.0, top, -0.1 * top, top))
    history = watched(
        beam(way, contact=True, tolerance=0.05), until=fx.Time(3.0), stepping=stepping,
        initial=0.01, maximum=0.01, max_cutbacks=40, minimum=1e-12,
    )  # fmt: skip
    assert history.reason == "time 3 reached"
    at = {t: [r for r in history if float(r["time"]) <= t * (1 + 1e-12)][-1] for t in (1.0, 3.0)}
    count = int(at[3.0]["released[bond]"])
    assert count == 0 if turn < 1.0 else count <= 1 if turn == 1.0 else count >= 1
    gone_up = [r for r in history if float(r["time"]) > 1.0 + 1e-9 and r["event"] == "release"]
    # with steps of time a node may wait at f <= 1 + f_tol for the next increment
    assert len(gone_up) <= (1 if stepping == "increment" or turn == 1.0 else 0)
    # the same load, the same crack: the same state
    if stepping == "event" and turn != 1.0 and at[1.0]["time"] == 1.0:
        assert at[3.0]["R[pin_top.y]"] == pytest.approx(at[1.0]["R[pin_top.y]"], rel=1e-9)
