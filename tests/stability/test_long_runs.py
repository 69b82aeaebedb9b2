"""Up to 10,000 increments: the energy balance does not drift, memory does not grow.

Hard: round-off of every increment adds up, contact opens and closes thousands of times, and what an
increment forgets to free is there ten thousand times. Checked on beams that are opened and pressed
together again and again while their crack grows slowly: the balance over the largest work done so
far, PETSc objects by count, memory beyond the rows of the history.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from specimens import bond
from test_memory import alive, resident_mb

import fxcrack as fx
from fxcrack.history import Row
from fxcrack.meshes.dcb import dcb_2d

pytestmark = [pytest.mark.stability, pytest.mark.memory]

PER_TURN = 40  # increments
GROWS = fx.VCCT(GIc=0.2, tolerance=0.3, unstable_tolerance=10.0)


def beam(
    comm: MPI.Intracomm, release: fx.StepRelease | fx.ProgressiveRelease, turns: int
) -> fx.Scene:
    """Arms opened a little more in every turn, and pressed together in between."""
    times = np.arange(2 * turns + 1) / (2 * turns)
    values = np.where(np.arange(2 * turns + 1) % 2, 0.18 + 0.25 * times, -0.02 * (times > 0.0))
    way = fx.Amplitude(tuple(times), tuple(values))
    return fx.Scene(
        dcb_2d(comm, length=30.0, dx=1.0, ny=1),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0, amplitude=way),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0, amplitude=way),
        ],
        debonds=[fx.Debond(bond(6.0, contact=True), GROWS, release)],
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("release", "increments"), [(fx.StepRelease(), 2_000), (fx.ProgressiveRelease(), 10_000)]
)
def test_many_increments(
    release: fx.StepRelease | fx.ProgressiveRelease, increments: int, tmp_path: Path
) -> None:
    """Turns of loading, unloading and pressing together."""
    PETSc.Log.begin()
    turns = increments // PER_TURN
    scene = beam(MPI.COMM_SELF, release, turns)
    memory: list[float] = []
    objects: list[dict[str, int]] = []
    worst: list[float] = []
    turned_over = 0.0  # work done and given back, all of it
    last = largest = 0.0

    def look(event: str, row: Row) -> None:
        nonlocal turned_over, last, largest
        work = float(row["external_work"])
        turned_over, largest, last = turned_over + abs(work - last), max(largest, abs(work)), work
        worst.append(abs(float(row["balance"])) / max(largest, 1e-300))
        if len(worst) % (increments // 10) == 0:
            # rows of the history are expected to grow; what is left without them would be a leak
            del scene.history.rows[:-1]
            memory.append(resident_mb())
            objects.append(alive(MPI.COMM_SELF, tmp_path))

    scene.run(
        fx.Static(
            until=fx.Time(1.0),
            stepping="increment",
            initial=1.0 / increments,
            minimum=1e-12,
            maximum=1.0 / increments,
            max_increments=2 * increments,
            max_cutbacks=30,
        ),
        observers=[look],
    )
    assert scene.history.reason == "time 1 reached"
    assert len(worst) >= increments
    assert scene.history.rows[-1]["released[bond]"] >= 10
    assert scene.history.details["contact_steps"] > 10 * turns
    # the sums of the account are right to a few units in the last place of what passed through
    # them: a rounding of each increment, which add up as a random walk at best and in line at worst
    assert max(worst) <= 10.0 * np.finfo(float).eps * turned_over / largest
    assert objects[0]["Matrix"] > 0  # the table was read
    assert all(later == objects[0] for later in objects[1:])
    # steps of the allocator are some tenths of a MB; a forgotten equilibrium per increment would be
    # 1 kB for this set, 8 MB in all
    assert memory[-1] - memory[1] < 2.0
    scene.close()


@pytest.mark.slow
def test_restoring_states_again_and_again_changes_nothing() -> None:
    """Contact closes and opens 200 times: the updated factor stays that of the open nodes."""
    turns = 250
    scene = beam(MPI.COMM_SELF, fx.StepRelease(), turns)
    scene.run(fx.Static(until=fx.Time(1.0 / turns), stepping="increment", initial=1e-3))
    system, zero = scene.solver.system, np.zeros(scene.solver.system.n_retained)
    apart, together = (scene.loads_at(k / (2 * turns)) for k in (1, 2))
    first = system.equilibrium(apart, zero), system.equilibrium(together, zero)
    steps = system.contact_steps
    for _ in range(100):
        again = system.equilibrium(apart, zero), system.equilibrium(together, zero)
    assert system.contact_steps >= steps + 200
    for a, b in zip(first, again, strict=True):
        # the factor is rebuilt from S from the first node that closed on: round-off of one turn
        assert np.abs(a.jump - b.jump).max() <= 1e-11 * np.abs(a.jump).max()
    scene.close()
