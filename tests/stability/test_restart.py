"""A restart from any point gives the history of the run that was not stopped, to 1e-10.

Hard: everything that later rows depend on must be in the checkpoint: bonds that are half open,
contact, ramps that go on with time, the size of the increment, cycles so far. Checked on every way
to step and every release law, stopped early, in the middle and late; on ranks, and from one number
of ranks to another.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import bond, specimen

import fxcrack as fx
from fxcrack.base.parallel import all_or_none
from fxcrack.criteria import RampRelease
from fxcrack.history import Row
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.enf import enf_2d

pytestmark = [pytest.mark.stability, pytest.mark.mpi]

SAME = 1e-10  # of the largest value of a column of its kind; asked for by the specification
NOTHING = 1e-8
"""A column below this fraction of the largest of its kind is round-off, and may differ by all of
itself: a reaction that is zero by symmetry."""

PINS = (
    fx.Displacement("pin_top", x=0.0, y=0.25),
    fx.Displacement("pin_bottom", x=0.0, y=-0.25),
)
HELD_FAR = tuple(fx.Displacement(f"far_{s}", x=0.0, y=0.0) for s in ("upper", "lower"))
FORCES = (fx.PointForce("pin_top", (0.0, 1.0)), fx.PointForce("pin_bottom", (0.0, -1.0)))
LAW = fx.Paris(c1=50.0, c2=-2.0, c3=0.5, c4=4.0, r1=0.2, r2=0.9)
INCREMENTS: dict[str, Any] = {"stepping": "increment", "max_cutbacks": 30}


class Stopped(Exception):
    """Stands for whatever ends a job."""


class StopAt:
    """Observer that raises at a row of the history."""

    def __init__(self, row: int) -> None:
        self._left = row

    def __call__(self, event: str, row: Row) -> None:
        self._left -= 1
        if self._left < 0:
            raise Stopped


def short(comm: MPI.Intracomm, release: Any = None, criterion: Any = None, **options: Any):
    """A short cantilever pair whose bonds let go in one of the ways."""
    interface = bond(6.0, contact=options.pop("contact", False))
    debond = fx.Debond(interface, criterion or fx.VCCT(GIc=0.2), release or fx.StepRelease())
    return fx.Scene(
        dcb_2d(comm, length=20.0, dx=1.0, ny=1),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.PlaneStrain(),
        debonds=[debond],
        **{"supports": PINS, **options},
    )


def turning(comm: MPI.Intracomm) -> fx.Scene:
    """Opened, closed until the faces press on each other, opened further."""
    way = fx.Amplitude((0.0, 1.0, 2.0, 4.0), (0.0, 0.6, -0.2, 1.2))
    pins = [fx.Displacement(p.where, x=0.0, y=p.y, amplitude=way) for p in PINS]
    return short(comm, contact=True, supports=pins)


def flexure(comm: MPI.Intracomm, **options: Any) -> fx.Scene:
    """End-notched flexure: the faces press on each other over the support."""
    return specimen(
        enf_2d(comm, half_span=20.0, height=1.5, dx=1.0, ny=1),
        a0=14.0,
        interface=bond(14.0, contact=True, **options),
        criterion=fx.VCCT(GIc=0.2, GIIc=0.8, mix=fx.BK(eta=1.6)),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
            fx.Displacement("load", y=-1.0),
        ],
    )


def solid(comm: MPI.Intracomm, order: int = 1, **options: Any) -> fx.Scene:
    """Opened more on one side than on the other: no two nodes of the front are alike."""
    ends = [
        fx.Displacement(f"end_{side}", y=lambda x, sign=sign: sign * (0.2 + 0.02 * x[2]))
        for side, sign in (("upper", 1.0), ("lower", -1.0))
    ]
    held = [fx.Displacement(f"far_{s}", x=0.0, y=0.0, z=0.0) for s in ("upper", "lower")]
    return fx.Scene(
        dcb_3d(comm, length=20.0, width=3.0, dx=1.0, dy=1.0, ny=1, order=order),
        materials=fx.Isotropic(70e3, 0.3),
        model=fx.Solid(),
        supports=[*held, *ends],
        debonds=[fx.Debond(bond(10.0, contact=True), **options)],
    )


def fatigue(comm: MPI.Intracomm) -> fx.Scene:
    return short(comm, criterion=fx.Fatigue(GIc=0.4, paris=LAW))


def bent(comm: MPI.Intracomm, **options: Any) -> fx.Scene:
    """Arms that turn far: opened, pressed together, opened further; the faces slide."""
    way = fx.Amplitude((0.0, 1.0, 2.0, 4.0), (0.0, 3.0, -0.02, 6.0))
    pins = [fx.Displacement(p.where, y=np.sign(p.y), amplitude=way) for p in PINS]
    interface = bond(6.0, contact=True, friction=options.pop("friction", None))
    return fx.Scene(
        dcb_2d(comm, length=20.0, dx=1.0, ny=1),
        materials=options.pop("materials", fx.Isotropic(7e3, 0.3)),
        model=fx.PlaneStrain(),
        supports=[*HELD_FAR, *pins],
        debonds=[fx.Debond(interface, fx.VCCT(GIc=2.0, tolerance=0.3))],
        **{"effects": [fx.FiniteStrain()], **options},
    )


def yielding(comm: MPI.Intracomm) -> fx.Scene:
    """The same arms, which yield at once and do not turn."""
    return bent(comm, materials=fx.Plastic(70e3, 0.3, yield_stress=40.0, hardening=1e3), effects=[])


RUNS: dict[str, tuple[Callable[[MPI.Intracomm], fx.Scene], Sequence[fx.Static | fx.Cycles]]] = {
    "event": (short, [fx.Static(until=fx.Releases(10))]),
    "event, contact, small retained sets": (
        lambda comm: short(comm, contact=True, options=fx.CondensedOptions(rows=2.0)),
        [fx.Static(until=fx.Releases(10))],
    ),
    "event, turning load": (turning, [fx.Static(until=fx.Time(4.0))]),
    "event, shear and contact": (flexure, [fx.Static(until=fx.Releases(8))]),
    "event, friction": (
        lambda comm: flexure(comm, friction=0.4),
        [fx.Static(until=fx.Releases(8))],
    ),
    "increments, friction": (
        lambda comm: flexure(comm, friction=0.4),
        [fx.Static(until=fx.Releases(6), initial=0.1, maximum=0.1, **INCREMENTS)],
    ),
    "increments": (short, [fx.Static(until=fx.Releases(6), initial=0.03, **INCREMENTS)]),
    "increments, turning load": (
        turning,
        [fx.Static(until=fx.Time(4.0), initial=0.05, maximum=0.2, **INCREMENTS)],
    ),
    "path": (
        lambda comm: short(comm, supports=HELD_FAR, loads=FORCES),
        [fx.Static(until=fx.Releases(8), stepping="path")],
    ),
    "progressive": (
        lambda comm: short(comm, fx.ProgressiveRelease()),
        [fx.Static(until=fx.Releases(8))],
    ),
    "progressive, increments, turning load": (
        lambda comm: short(
            comm,
            fx.ProgressiveRelease(),
            contact=True,
            supports=[
                fx.Displacement(
                    p.where,
                    x=0.0,
                    y=p.y,
                    amplitude=fx.Amplitude((0.0, 1.0, 2.0, 3.0), (0.0, 0.5, 0.2, 0.9)),
                )
                for p in PINS
            ],
        ),
        [fx.Static(until=fx.Time(3.0), initial=0.02, maximum=0.05, **INCREMENTS)],
    ),
    "enhanced": (
        lambda comm: short(comm, criterion=fx.EnhancedVCCT(GIc=0.2, GIc_p=0.12)),
        [fx.Static(until=fx.Releases(6))],
    ),
    "ramp over increments": (
        lambda comm: short(comm, RampRelease(increments=4)),
        [fx.Static(until=fx.Releases(5), initial=0.02, maximum=0.02, **INCREMENTS)],
    ),
    "viscosity": (
        lambda comm: short(comm, criterion=fx.VCCT(GIc=0.2, viscosity=1e-2)),
        [fx.Static(until=fx.Releases(4), initial=0.01, maximum=0.01, **INCREMENTS)],
    ),
    "viscosity, softening": (
        lambda comm: short(
            comm, fx.ProgressiveRelease(), criterion=fx.VCCT(GIc=0.2, viscosity=1e-2)
        ),
        [fx.Static(until=fx.Releases(4), initial=0.01, maximum=0.01, **INCREMENTS)],
    ),
    "release along an amplitude": (
        lambda comm: short(
            comm,
            fx.AmplitudeRelease((0.0, 0.02, 0.05), (1.0, 0.6, 0.0)),
            fx.CriticalStress(20.0, distance=0.2),
        ),
        [fx.Static(until=fx.Releases(4), initial=0.02, **INCREMENTS)],
    ),
    "crack length against time": (
        lambda comm: short(
            comm,
            criterion=fx.CrackLengthVsTime(
                reference="pin_top", times=(0.0, 1.0), lengths=(6.0, 12.0)
            ),
        ),
        [fx.Static(until=fx.Time(1.0))],
    ),
    "finite strain, event, turning load": (bent, [fx.Static(until=fx.Time(2.2))]),
    "finite strain, increments, friction": (
        lambda comm: bent(comm, friction=0.3),
        [fx.Static(until=fx.Time(3.0), initial=0.2, maximum=0.2, **INCREMENTS)],
    ),
    "plastic": (
        yielding,
        [fx.Static(until=fx.Time(1.6), initial=0.1, maximum=0.1, **INCREMENTS)],
    ),
    "plastic, short": (
        yielding,
        [fx.Static(until=fx.Releases(3), initial=0.1, maximum=0.1, **INCREMENTS)],
    ),
    "nonlinear path, progressive": (
        lambda comm: short(comm, fx.ProgressiveRelease(), solver="newton"),
        [fx.Static(until=fx.Releases(4))],
    ),
    "inertia, finite strain": (
        lambda comm: bent(
            comm, effects=[fx.FiniteStrain(), fx.Inertia(density=1e-5, rayleigh=(0.0, 1e-3))]
        ),
        # before the impact of the last bonds, which takes shorter increments
        [fx.Dynamic(until=fx.Time(1.6), dt=0.2)],
    ),
    "pressure that follows, temperature": (
        lambda comm: bent(
            comm,
            materials=fx.Isotropic(7e3, 0.3, expansion=1e-5),
            loads=[
                fx.Pressure(
                    "top", 0.5, amplitude=fx.Amplitude((0.0, 4.0), (0.0, 4.0)), follows=True
                )
            ],
            effects=[
                fx.FiniteStrain(),
                fx.Temperature([(0.0, 0.0), (4.0, lambda x: 50.0 + x[0])]),
            ],
        ),
        [fx.Static(until=fx.Time(3.0), initial=0.4, maximum=0.4, **INCREMENTS)],
    ),
    "fatigue": (fatigue, [fx.Cycles(maximum=0.5, ratio=0.1, until=fx.Releases(6))]),
    "fatigue in two steps": (
        fatigue,
        [
            fx.Cycles(maximum=0.4, ratio=0.1, until=fx.Releases(3)),
            fx.Cycles(maximum=0.5, ratio=-0.5, until=fx.Releases(6)),
        ],
    ),
    "3-D": (
        lambda comm: solid(comm, criterion=fx.VCCT(GIc=0.2, method="closure")),
        [fx.Static(until=fx.Releases(15))],
    ),
    "3-D, progressive": (
        lambda comm: solid(comm, criterion=fx.VCCT(GIc=0.2), release=fx.ProgressiveRelease()),
        [fx.Static(until=fx.Releases(12))],
    ),
    "3-D, progressive, second order": (
        lambda comm: solid(comm, 2, criterion=fx.VCCT(GIc=0.2), release=fx.ProgressiveRelease()),
        [fx.Static(until=fx.Releases(30))],
    ),
    "3-D, viscosity, second order": (
        lambda comm: solid(
            comm, 2, criterion=fx.VCCT(GIc=0.2, viscosity=1e-2), release=fx.ProgressiveRelease()
        ),
        [fx.Static(until=fx.Releases(20), initial=0.02, maximum=0.02, **INCREMENTS)],
    ),
}

QUICK = ("progressive", "nonlinear path, progressive", "3-D")


def run(
    name: str, comm: MPI.Intracomm, checkpoint: fx.Checkpoint | None = None, **options: Any
) -> fx.History:
    make, steps = RUNS[name]
    if MPI.COMM_WORLD.size > 1:
        steps = [replace(step, until=SHORTER.get(name, step.until)) for step in steps]
    scene = make(comm)
    try:
        for step in steps:
            scene.run(step, checkpoint=checkpoint, **options)
    finally:
        scene.close()
    return scene.history


def assert_same_history(whole: fx.History, found: fx.History) -> None:
    """Same events and nodes; numbers to SAME of the largest of their kind."""
    assert found.reason == whole.reason
    assert found["event"].tolist() == whole["event"].tolist()
    assert found.columns == whole.columns
    columns = {c: whole[c].astype(float) for c in whole.columns if c != "event"}
    largest: dict[str, float] = {}
    for name, values in columns.items():
        kind = name.split("[")[0]
        largest[kind] = max(largest.get(kind, 0.0), float(np.nanmax(np.abs(values), initial=0.0)))
    # modes that are absent, and what must be zero: by the size of what they belong to
    rates = max(largest.get(k, 0.0) for k in ("GI", "GII", "GIII"))
    largest |= {k: rates for k in ("GI", "GII", "GIII")}
    if "s11" in largest:
        largest |= {k: largest["s11"] for k in ("s12", "s13")}
    energies = ("balance", "snap_energy", "released_energy", "viscous_energy")
    energies += ("friction_energy", "pairing_energy")
    largest |= {k: largest["external_work"] for k in energies}
    # reactions beside the forces they balance
    largest["R"] = max(largest["R"], largest.get("F", 0.0))
    for name, values in columns.items():
        kind, other = name.split("[")[0], found[name].astype(float)
        assert np.array_equal(np.isnan(values), np.isnan(other)), name
        off = float(np.nanmax(np.abs(values - other), initial=0.0))
        nothing = float(np.nanmax(np.abs(values), initial=0.0)) < NOTHING * largest[kind]
        assert off <= (NOTHING if nothing else SAME) * largest[kind], (name, off, largest[kind])


OTHER_RANKS = (
    *("event, shear and contact", "3-D", "viscosity", "finite strain, event, turning load"),
    *("finite strain, increments, friction", "plastic, short", "nonlinear path, progressive"),
    *("inertia, finite strain", "pressure that follows, temperature"),
)
"""Runs that are restarted on another number of ranks."""

SHORTER = {
    "finite strain, event, turning load": fx.Time(0.8),
    "plastic, short": fx.Releases(2),
    "finite strain, increments, friction": fx.Time(1.4),
    "pressure that follows, temperature": fx.Time(0.55),
    "inertia, finite strain": fx.Time(1.0),
}
"""Where these end on several ranks: five runs each, and most of their time is spent in waiting."""


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in RUNS],
)
def test_restarted_anywhere_a_run_ends_the_same(
    name: str, comm: MPI.Intracomm, shared_path: Path
) -> None:
    if comm.size > 1 and name not in QUICK and name in (*OTHER_RANKS, "plastic"):
        pytest.skip("on several ranks these runs are restarted on another number of ranks")
    whole = run(name, comm)
    checkpoint = fx.Checkpoint(shared_path / "state.npz", every=1)
    done = 0
    # stopped early, continued, stopped late, continued
    for part in (0.3, 0.8) if comm.size == 1 else (0.6,):
        row = round(part * len(whole))
        with pytest.raises(Stopped):
            run(name, comm, checkpoint, observers=[StopAt(row - done)], restart=done > 0)
        done = row
    assert_same_history(whole, run(name, comm, checkpoint, restart=True))
    # all steps are done: nothing is computed, everything is there
    assert_same_history(whole, run(name, comm, checkpoint, restart=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHER_RANKS)
def test_restart_on_another_number_of_ranks(
    name: str, comm: MPI.Intracomm, shared_path: Path
) -> None:
    if comm.size == 1:
        pytest.skip("there is no other number of ranks")
    whole = run(name, comm)
    stop = round(0.5 * len(whole))
    # one rank, then all of them
    first = fx.Checkpoint(shared_path / "alone.npz", every=1)
    with all_or_none(comm, "the run that rank 0 begins alone"), suppress(Stopped):
        if comm.rank == 0:
            run(name, MPI.COMM_SELF, first, observers=[StopAt(stop)])
    assert_same_history(whole, run(name, comm, first, restart=True))
    # all ranks, then one
    shared = fx.Checkpoint(shared_path / "shared.npz", every=1)
    with pytest.raises(Stopped):
        run(name, comm, shared, observers=[StopAt(stop)])
    with all_or_none(comm, "the run that rank 0 ends alone"):
        if comm.rank == 0:
            assert_same_history(whole, run(name, MPI.COMM_SELF, shared, restart=True))


@pytest.mark.smoke
@pytest.mark.three
def test_tips_released_and_tables_are_restored(comm: MPI.Intracomm, shared_path: Path) -> None:
    """What is not in the rows: records of releases and the table of fatigue."""
    checkpoint = fx.Checkpoint(shared_path / "state.npz", every=1)
    make, (step,) = RUNS["fatigue"]
    whole = make(comm)
    whole.run(step)
    with pytest.raises(Stopped):
        run("fatigue", comm, checkpoint, observers=[StopAt(5)])
    again = make(comm)
    again.run(step, checkpoint=checkpoint, restart=True)
    assert len(again.cracks[0].records) == len(whole.cracks[0].records) == 6
    for a, b in zip(again.cracks[0].records, whole.cracks[0].records, strict=True):
        assert (a.node, a.DBT) == (b.node, pytest.approx(b.DBT, rel=SAME))
        assert a.CRSTS == pytest.approx(b.CRSTS, rel=SAME, abs=SAME * max(map(abs, b.CRSTS)))
    assert again.fatigue.table["node"] == whole.fatigue.table["node"]
    assert again.fatigue.table["dG"] == pytest.approx(whole.fatigue.table["dG"], rel=SAME)
    # fields come from the state, not from the rows
    u, v = again.solver.displacement(), whole.solver.displacement()
    v.axpy(-1.0, u)
    assert v.norm() <= 1e-9 * u.norm()  # an equilibrium solved on another factor: round-off
    for vector in (u, v):
        vector.destroy()
    again.close()
    whole.close()


OTHERS: dict[str, tuple[Callable[[MPI.Intracomm], fx.Scene], fx.Static, str]] = {
    "material": (
        lambda comm: specimen(
            dcb_2d(comm, length=20.0, dx=1.0, ny=1), a0=6.0, materials=fx.Isotropic(71e3, 0.3)
        ),
        fx.Static(until=fx.Releases(4)),
        r"materials\[0\].E: was 70000.0, is 71000.0",
    ),
    "mesh": (
        lambda comm: specimen(dcb_2d(comm, length=21.0, dx=1.0, ny=1), a0=6.0),
        fx.Static(until=fx.Releases(4)),
        "mesh.cells: was 40, is 42",
    ),
    "toughness": (
        lambda comm: short(comm, criterion=fx.VCCT(GIc=0.21)),
        fx.Static(until=fx.Releases(4)),
        r"interfaces.bond.criterion.GIc: was 0.2, is 0.21",
    ),
    "initial crack": (
        lambda comm: specimen(dcb_2d(comm, length=20.0, dx=1.0, ny=1), a0=7.0),
        fx.Static(until=fx.Releases(4)),
        "interfaces.bond.bonded.digest",
    ),
    "step": (short, fx.Static(until=fx.Releases(5)), "step.until.count: was 4, is 5"),
    "a function": (
        lambda comm: short(
            comm,
            supports=[
                fx.Displacement("pin_top", x=0.0, y=lambda x: np.full(x.shape[1], 0.25)),
                fx.Displacement("pin_bottom", x=0.0, y=-0.25),
            ],
        ),
        fx.Static(until=fx.Releases(4)),
        "supports",
    ),
}


@pytest.mark.quick("material")
@pytest.mark.parametrize(
    "what",
    [
        what if what in ("material", "step") else pytest.param(what, marks=pytest.mark.slow)
        for what in OTHERS
    ],
)
def test_another_scene_is_refused_and_named(
    what: str, comm: MPI.Intracomm, shared_path: Path
) -> None:
    checkpoint = fx.Checkpoint(shared_path / "state.npz", every=2)
    scene = short(comm)
    scene.run(fx.Static(until=fx.Releases(4)), checkpoint=checkpoint)
    scene.close()
    make, step, message = OTHERS[what]
    other = make(comm)
    with pytest.raises(fx.InputError, match=message):
        other.run(step, checkpoint=checkpoint, restart=True)
    other.close()


def test_functions_that_give_something_else_are_found_by_the_equilibrium(
    comm: MPI.Intracomm, shared_path: Path
) -> None:
    def scene(size: float) -> fx.Scene:
        return short(
            comm,
            supports=[
                fx.Displacement("pin_top", x=0.0, y=lambda x: np.full(x.shape[1], size)),
                fx.Displacement("pin_bottom", x=0.0, y=-0.25),
            ],
        )

    step = fx.Static(until=fx.Releases(4))
    checkpoint = fx.Checkpoint(shared_path / "state.npz")
    first = scene(0.25)
    first.run(step, checkpoint=checkpoint)
    first.close()
    other = scene(0.24)
    with pytest.raises(fx.InputError, match=r"the checkpoint does not fit.*amplitudes and load"):
        other.run(step, checkpoint=checkpoint, restart=True)
    other.close()


@pytest.mark.slow
def test_nonlinear_bodies_need_their_cells_in_the_same_order(
    comm: MPI.Intracomm, shared_path: Path
) -> None:
    step = fx.Static(until=fx.Time(0.2))
    checkpoint = fx.Checkpoint(shared_path / "state.npz")
    bent(comm).run(step, checkpoint=checkpoint)
    comm.Barrier()
    if comm.rank == 0:
        with np.load(checkpoint.path) as content:
            arrays = dict(content)
        arrays["bodies.positions"][[0, -1]] = arrays["bodies.positions"][[-1, 0]]
        np.savez(checkpoint.path, **arrays)
    comm.Barrier()
    with pytest.raises(fx.InputError, match=r"same cells in another order.*without restart"):
        bent(comm).run(step, checkpoint=checkpoint, restart=True)


def test_without_a_checkpoint_a_restart_begins_and_rubbish_is_refused(
    comm: MPI.Intracomm, shared_path: Path
) -> None:
    step = fx.Static(until=fx.Releases(2))
    checkpoint = fx.Checkpoint(shared_path / "state.npz")
    scene = short(comm)
    assert len(scene.run(step, checkpoint=checkpoint, restart=True)) > 3
    with pytest.raises(fx.InputError, match="needs checkpoint"):
        scene.run(step, restart=True)
    scene.close()
    comm.Barrier()
    for content in (b"", b"rubbish", (shared_path / "state.npz").read_bytes()[:-100]):
        comm.Barrier()
        if comm.rank == 0:
            (shared_path / "state.npz").write_bytes(content)
        comm.Barrier()
        scene = short(comm)
        with pytest.raises(fx.InputError, match=r"state.npz is no checkpoint of fxcrack"):
            scene.run(step, checkpoint=checkpoint, restart=True)
        scene.close()
    with pytest.raises(fx.InputError, match=r"must end in \.npz"):
        fx.Checkpoint("state.pickle")
    with pytest.raises(fx.InputError, match="at least 1"):
        fx.Checkpoint("state.npz", every=0)
    with pytest.raises(fx.InputError, match="must not be negative"):
        fx.Checkpoint("state.npz", seconds=-1.0)


@pytest.mark.slow
def test_files_of_another_run_are_not_mixed_in(comm: MPI.Intracomm, shared_path: Path) -> None:
    """Stopped in its first step, a run must not go on with a second step of an older one."""
    make, steps = RUNS["fatigue in two steps"]
    checkpoint = fx.Checkpoint(shared_path / "state.npz", every=1)
    whole = run("fatigue in two steps", comm, checkpoint)
    with pytest.raises(Stopped):
        run("fatigue in two steps", comm, checkpoint, observers=[StopAt(3)])
    scene = make(comm)
    scene.run(steps[0], checkpoint=checkpoint, restart=True)
    n = len(scene.history)
    assert scene.history["event"].tolist() == whole["event"].tolist()[:n]
    scene.run(steps[1], checkpoint=checkpoint, restart=True)
    assert_same_history(whole, scene.history)
    scene.close()
