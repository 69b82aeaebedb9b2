"""Explicit dynamics of bodies that move far: pairs that are renewed, increments that change.

E = 1000, density 1/1000: waves travel at about 1000.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import box
from mpi4py import MPI
from specimens import largest_imbalance

import fxcrack as fx
from fxcrack.mesh.distribute import distribute
from fxcrack.mesh.raw import RawMesh, on_root
from fxcrack.mesh.read import gmsh_model, prepare
from fxcrack.meshes.blocks import Blocks
from fxcrack.steps.explicit_increments import Increments

E, RHO = 1e3, 1e-3
RUBBER = fx.NeoHookean(E, 0.3, density=RHO)
SPEED, PRESSURE = 100.0, 1.0
LEDGE, GAP = 1.5, 1e-3


def block_on_ledge() -> RawMesh:
    """A block of 1 x 0.5 at the left end of a ledge of 1.5 x 0.5."""
    model = Blocks()
    high, low = np.linspace(0.5, 1.0, 3), np.linspace(-0.5, 0.0, 3)
    block = model.add("block", [np.linspace(0.0, 1.0, 5), high], "quadrilateral", 1)
    ledge = model.add("ledge", [np.linspace(0.0, LEDGE, 7), low], "quadrilateral", 1)
    model.group("sole", block.part(y=0.5))
    model.group("back", block.part(y=1.0))
    model.group("top", ledge.part(y=0.0))
    model.group("base", ledge.part(y=-0.5))
    with gmsh_model("ledge") as gmsh:
        model.write(gmsh.model)
        raw = prepare(gmsh.model, "ledge")
    points = raw.points.copy()
    points[points[:, 1] > 0.25, 1] -= 0.5 - GAP
    return replace(raw, points=points)


def slide(
    comm: MPI.Intracomm, time: float, *, checkpoint: Any = None, **options: Any
) -> tuple[fx.History, np.ndarray]:
    """The block slides over the ledge and off it; the history, and heights of its sole."""
    scene = fx.Scene(
        distribute(on_root(comm, block_on_ledge), comm, "ledge"),
        materials=RUBBER,
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("base", x=0.0, y=0.0)],
        loads=[fx.Pressure("back", PRESSURE, amplitude=fx.Amplitude((0.0,), (1.0,)))],
        bonds=[
            fx.Interface(
                "sole", "top", bonded=lambda x: np.zeros(x.shape[1], bool), contact=True,
                gap="keep", tolerance=0.01, name="touch",
            )
        ],
        monitors=[fx.Monitor("sole", (0.0, 1.0), name="sole")],
        effects=[fx.Inertia(velocity=(lambda x: np.where(x[1] > 0.5 * GAP, SPEED, 0.0), 0.0))],
    )  # fmt: skip
    history = scene.run(fx.Explicit(until=fx.Time(time), rows=40), checkpoint=checkpoint, **options)
    scene.close()
    return history, history["m[sole]"].astype(float)


@pytest.mark.mpi
@pytest.mark.three
def test_a_block_slides_off_a_ledge(comm: MPI.Intracomm) -> None:
    """It is held up over the ledge, and falls where there is none any more."""
    history, sole = slide(comm, 0.022)
    time = history["time"].astype(float)
    over = SPEED * time < 0.4
    # pressed by 1e-3 of E, struck at once: at most twice that over a height of one
    assert np.abs(sole[over]).max() < 3e-3
    gone = SPEED * time > LEDGE + 0.05
    assert gone.any()
    # without a ledge below its middle it turns about the edge, and then falls
    assert sole[gone].max() < -0.01
    assert sole[-1] < -0.03
    # of the energy that the block brings, of which the pressure adds 2 %
    balance = np.abs(history["balance"].astype(float)).max()
    assert balance <= 1e-5 * history["initial_energy"][0]


def pressed(comm: MPI.Intracomm, stretch: float, **options: Any) -> fx.History:
    """A column whose ends come together, or go apart, smoothly."""
    scene = fx.Scene(
        box(comm, "plane strain", n=(8, 2, 1), size=(4.0, 1.0, 1.0)),
        materials=RUBBER,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("x0", x=0.0, y=0.0),
            fx.Displacement(
                "x1", x=4.0 * (stretch - 1.0), y=0.0,
                amplitude=fx.SmoothStep((0.0, 0.08), (0.0, 1.0)),
            ),
        ],
        effects=[fx.Inertia()],
        bonds=[],
    )  # fmt: skip
    history = scene.run(fx.Explicit(until=fx.Time(0.08), rows=20, **options))
    scene.close()
    return history


@pytest.mark.parametrize("stretch", [0.5, 1.6])
def test_increments_follow_what_is_stable(stretch: float) -> None:
    history = pressed(MPI.COMM_SELF, stretch)
    assert not history.reason.startswith("stopped"), history.reason
    dt = history["dt"].astype(float)
    # cells of half the length, through which waves pass in less time
    assert (dt[-1] < 0.8 * dt[0]) if stretch < 1.0 else (dt.min() < 0.95 * dt[0])
    # of second order in the increment
    assert largest_imbalance(history) <= 2e-5
    even = pressed(MPI.COMM_SELF, stretch, safety=0.6)
    for name in ("strain_energy", "R[x1.x]"):
        assert history[name][-1] == pytest.approx(even[name][-1], rel=2e-3), name


def test_increments_are_those_of_the_stable_one() -> None:
    """Down at once and ahead of the next fall, up by 1 % a look, never past the end."""
    steps = Increments(1.0, 2.0, 0.1, 0.1)
    assert steps.dt == pytest.approx(0.1)
    assert steps.time(3) == pytest.approx(1.3)
    steps.adapt(3, 0.09, 1.0)
    # 10 % less, and 10 % less again ahead
    assert steps.dt <= 0.081
    assert steps.shortened == pytest.approx(0.1 / 0.081, rel=0.02)
    # a step that ends before its first increment would
    assert Increments(1.0, 1.001, 0.1, 0.1).shortened == 1.0
    at, n = steps.time(3), 3
    assert at == pytest.approx(1.3)
    kept = Increments(1.0, 2.0, 0.1, 0.1)
    kept.restore(steps.state())
    longer = [steps.dt]
    for _ in range(4):
        n += 1
        steps.adapt(n, 0.2, 1.0)
        kept.adapt(n, 0.2, 1.0)
        longer.append(steps.dt)
    assert np.all(np.diff(longer) >= 0.0) or steps.is_end(n + 2)
    assert kept.piece == steps.piece
    while not steps.is_end(n):
        n += 1
    assert steps.time(n) == pytest.approx(2.0, rel=1e-12)
    assert steps.progress(n) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.slow
def test_restart_goes_on_with_pairs_and_increments(tmp_path: Path) -> None:
    whole, _ = slide(MPI.COMM_SELF, 0.022)
    seen = []

    class Enough(Exception):
        """Ends the run from inside."""

    def stop(event: str, row: Any) -> None:
        seen.append(event)
        if len(seen) == 39:
            raise Enough

    kept = fx.Checkpoint(tmp_path / "run.npz", every=1)
    with pytest.raises(Enough):
        slide(MPI.COMM_SELF, 0.022, checkpoint=kept, observers=[stop])
    again, _ = slide(MPI.COMM_SELF, 0.022, checkpoint=kept, restart=True)
    assert [r["event"] for r in again] == [r["event"] for r in whole]
    for name in ("time", "m[sole]", "kinetic_energy", "external_work", "dt"):
        a, b = again[name].astype(float), whole[name].astype(float)
        # forces are differences of stresses of E; round-off of 100 increments
        assert np.abs(a - b).max() <= 1e-8 * np.abs(b).max(), name
