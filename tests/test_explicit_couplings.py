"""Rigid couplings and linear equations in explicit dynamics, against closed forms.

Lumped masses are condensed exactly, so that two masses, a rigid body and prescribed motions follow
central differences to round-off; tolerances of 1e-9 are a thousand times that.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.blocks import Blocks, build

E, RHO = 100.0, 3.0
SOFT = fx.Isotropic(E, 0.0, density=RHO)


def block(comm: MPI.Intracomm, n: int = 1, *, depth: int = 0) -> fx.Mesh:
    """A square or cube of the size 1 with n elements along each side."""

    def make() -> Blocks:
        model = Blocks()
        axes = [np.linspace(0.0, 1.0, n + 1)] * (3 if depth else 2)
        part = model.add("block", axes, "hexahedron" if depth else "quadrilateral", 1)
        ends = {} if not depth else {"z": 0.0}
        model.group("left", part.part(x=0.0))
        model.group("right", part.part(x=1.0))
        model.group("corner", part.part(x=1.0, y=1.0, **ends))
        model.group("other", part.part(x=0.0, y=0.0, **ends))
        return model

    return build(comm, "block", make)


def run(scene: fx.Scene, time: float, **options: Any) -> fx.History:
    history = scene.run(fx.Explicit(until=fx.Time(time), **options), progress=False)
    scene.close()
    return history


def imbalance(history: fx.History) -> float:
    sizes = [history[c].astype(float) for c in ("external_work", "kinetic_energy", "strain_energy")]
    return float(np.abs(history["balance"].astype(float)).max() / np.abs(sizes).max())


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("by", ["coupling", "equation"])
def test_two_masses(comm: MPI.Intracomm, by: str) -> None:
    """Two faces that move as one each are two masses m = rho/2 on a spring E.

    After n increments of central differences the jump is v dt sin(n w)/sin(w) with
    sin(w/2) = dt/2 sqrt(2 E/m), as the first increment begins at its start.
    """
    if by == "coupling":
        ties: list[Any] = [
            fx.Coupling(g, (x, 0.5), components="x") for g, x in (("left", 0.0), ("right", 1.0))
        ]
    else:
        ties = [
            fx.Equation(((corner, "x", 2.0), (group, "x", -2.0)), name=group)
            for corner, group in (("corner", "upper"), ("other", "lower"))
        ]
    mesh = two_corners(comm) if by == "equation" else block(comm)
    groups = ("left", "right")
    held = [fx.Displacement(g, y=0.0) for g in groups]
    scene = fx.Scene(
        mesh, materials=SOFT, model=fx.PlaneStress(), supports=[*held, *ties],
        effects=[fx.Inertia(velocity=(lambda x: 2.0 * x[0], 0.0))],
        monitors=[fx.Monitor(g, (1.0, 0.0), g) for g in groups],
    )  # fmt: skip
    history = run(scene, 1.0, safety=0.2, rows=40)
    time, left, right = (history[c].astype(float) for c in ("time", "m[left]", "m[right]"))
    dt = float(history["dt"][-1])
    half = np.arcsin(0.5 * dt * np.sqrt(2.0 * E / (0.5 * RHO)))
    jump = 2.0 * dt * np.sin(2.0 * half * time / dt) / np.sin(2.0 * half)
    assert right - left == pytest.approx(jump, abs=1e-9)
    assert 0.5 * (left + right) == pytest.approx(time, abs=1e-9)
    assert imbalance(history) <= 1e-12


def two_corners(comm: MPI.Intracomm) -> fx.Mesh:
    """One element, whose other corners are groups as well."""

    def make() -> Blocks:
        model = Blocks()
        part = model.add("block", [np.linspace(0.0, 1.0, 2)] * 2, "quadrilateral", 1)
        for name, at in {
            "left": {"x": 0.0}, "right": {"x": 1.0}, "corner": {"x": 1.0, "y": 1.0},
            "other": {"x": 0.0, "y": 0.0}, "upper": {"x": 1.0, "y": 0.0},
            "lower": {"x": 0.0, "y": 1.0},
        }.items():  # fmt: skip
            model.group(name, part.part(**at))
        return model

    return build(comm, "corners", make)


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("depth", [0, 1])
def test_a_rigid_body(comm: MPI.Intracomm, depth: int) -> None:
    """A coupled block under a force at its corner: u = F t^2/(2 m), theta = M t^2/(2 I).

    Moments of inertia are those of the lumped masses, about the centre. The reference point lies
    elsewhere: it is no matter.
    """
    gdim, n, force = 2 + depth, 2, np.array([0.3, -1.0, 0.4])[: 2 + depth]
    at = (3.0, -2.0, 5.0)[:gdim]
    scene = fx.Scene(
        block(comm, n, depth=depth), materials=SOFT,
        model=fx.Solid() if depth else fx.PlaneStress(),
        supports=[fx.Coupling("block", at)], effects=[fx.Inertia()],
        loads=[fx.PointForce("corner", tuple(force), amplitude=fx.Amplitude((0.0,), (1.0,)))],
        monitors=[fx.Monitor("other", tuple(np.eye(gdim)[c]), f"u{c}") for c in range(gdim)],
    )  # fmt: skip
    history = run(scene, 0.5, rows=4)
    x = np.array([0.0, 0.5, 1.0])
    m = np.array([0.25, 0.5, 0.25])
    second = float(m @ (x - 0.5) ** 2) * RHO  # of one axis; a cube is alike about every axis
    arm = np.array([0.5, 0.5, -0.5 if depth else 0.0])
    push = np.append(force, np.zeros(3 - gdim))
    turn = np.cross(arm, push) / (2.0 * second)
    other = np.cross(turn, -np.array([0.5, 0.5, 0.5 if depth else 0.0]))
    time = float(history["time"][-1])
    wanted = 0.5 * time**2 * (push / RHO + other)[:gdim]
    found = [float(history[f"m[u{c}]"][-1]) for c in range(gdim)]
    # the start at rest by half a step is exact for constant forces
    assert found == pytest.approx(wanted.tolist(), rel=1e-9)
    assert imbalance(history) <= 1e-12
    assert float(history["strain_energy"][-1]) <= 1e-12 * float(history["kinetic_energy"][-1])


@pytest.mark.mpi
@pytest.mark.three
def test_a_prescribed_rotation_and_a_mean(comm: MPI.Intracomm) -> None:
    """The moment that turns a rigid block is I theta''; a mean that is given is reached exactly."""
    spin = fx.Coupling("left", (0.0, 0.5), x=0.0, y=0.0, rz=0.1, name="end",
                       amplitude=fx.SmoothStep((0.0, 1.0), (0.0, 1.0)))  # fmt: skip
    pull = fx.Coupling("right", (1.0, 0.5), x=0.02, mean=True, name="mean",
                       amplitude=fx.SmoothStep((0.0, 1.0), (0.0, 1.0)))  # fmt: skip
    scene = fx.Scene(
        block(comm, 3), materials=SOFT, model=fx.PlaneStress(), supports=[spin, pull],
        effects=[fx.Inertia()],
        monitors=[fx.Monitor("other", (1.0, 0.0), "turn"), fx.Monitor("right", (1.0, 0.0), "mean")],
    )  # fmt: skip
    history = run(scene, 0.7, rows=7)
    s = history["time"].astype(float)
    shape = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    assert history["m[turn]"].astype(float) == pytest.approx(0.05 * shape, abs=1e-12)
    # a monitor is the plain mean of the nodes, as the coupling's is
    assert history["m[mean]"].astype(float) == pytest.approx(0.02 * shape, abs=1e-12)
    assert float(history["R[mean.x]"][-1]) != 0.0
    assert imbalance(history) <= 1e-10


def stack(comm: MPI.Intracomm, *, whole: bool) -> fx.Mesh:
    """Two squares on each other, or the same in one piece; "seam" are the nodes below the joint."""

    def make() -> Blocks:
        model = Blocks()
        x = np.linspace(0.0, 1.0, 4)
        kinds = ("quadrilateral", 1)
        if whole:
            upper = lower = model.add("lower", [x, np.linspace(-1.0, 1.0, 7)], *kinds)
            model.group("seam", lower.part(y=0.0))
        else:
            lower = model.add("lower", [x, np.linspace(-1.0, 0.0, 4)], *kinds)
            upper = model.add("upper", [x, np.linspace(0.0, 1.0, 4)], *kinds)
            model.group("seam", lower.part(y=0.0))
            model.group("face", upper.part(y=0.0))
        model.group("top", upper.part(y=1.0))
        model.group("bottom", lower.part(y=-1.0))
        model.group("corner", upper.part(x=1.0, y=1.0))
        return model

    return build(comm, "stack", make)


@pytest.mark.mpi
@pytest.mark.three
def test_a_rigid_set_below_bonds(comm: MPI.Intracomm) -> None:
    """Slaves bonded to a coupled face move as the nodes of one body do: 1e-9."""
    found = []
    for whole in (True, False):
        bonds = [] if whole else [fx.Interface(slave="face", master="seam", name="joint")]
        scene = fx.Scene(
            stack(comm, whole=whole), materials=fx.Isotropic(E, 0.3, density=RHO),
            model=fx.PlaneStress(), bonds=bonds, effects=[fx.Inertia()],
            supports=[fx.Displacement("bottom", x=0.0, y=0.0), fx.Coupling("seam", (0.0, 1.0))],
            loads=[fx.PointForce("corner", (1.0, -0.5), amplitude=fx.Amplitude((0.0,), (1.0,)))],
            monitors=[fx.Monitor("corner", (1.0, 0.0), "u"), fx.Monitor("seam", (1.0, 0.0), "s")],
        )  # fmt: skip
        history = run(scene, 1.0, rows=10, dt=0.0125)
        assert imbalance(history) <= 1e-11
        found.append(history)
    one, other = found
    for name in ("m[u]", "m[s]", "strain_energy", "kinetic_energy", "R[bottom.x]"):
        a, b = (h[name].astype(float) for h in (one, other))
        assert b == pytest.approx(a, rel=1e-9, abs=1e-9 * float(np.abs(a).max())), name


@pytest.mark.mpi
@pytest.mark.three
def test_impact_on_a_rigid_face(comm: MPI.Intracomm) -> None:
    """A square that flies onto a rigid face of a free one: momentum and energy are kept."""
    speed = -1.0
    joint = fx.Interface(
        slave="face", master="seam", bonded=lambda x: np.zeros(x.shape[1], dtype=bool),
        contact=True, name="joint", friction=0.3,
    )  # fmt: skip
    scene = fx.Scene(
        stack(comm, whole=False), materials=fx.Isotropic(E, 0.3, density=RHO),
        model=fx.PlaneStress(), bonds=[joint], supports=[fx.Coupling("seam", (0.5, 0.0))],
        effects=[fx.Inertia(velocity=(0.0, lambda x: np.where(x[1] > 0.5, speed, 0.0)))],
        monitors=[fx.Monitor("top", (0.0, 1.0), "top"), fx.Monitor("bottom", (0.0, 1.0), "low")],
    )  # fmt: skip
    history = run(scene, 1.5, rows=30)
    assert imbalance(history) <= 1e-10
    contact, start = (float(history[c][-1]) for c in ("contact_energy", "initial_energy"))
    assert 0.0 < contact < 0.1 * start
    assert float(history["m[low]"].astype(float).min()) < 0.1 * speed  # it was pushed


def test_restart_with_prescribed_references(tmp_path: Path) -> None:
    """A run that was interrupted goes on as one that was not, moments of references too."""

    class Enough(Exception):
        """Ends the run from inside."""

    def stop(event: str, row: dict[str, Any]) -> None:
        if row["time"] > 0.3:
            raise Enough

    def scene() -> fx.Scene:
        spin = fx.Coupling("left", (-1.0, 0.5), x=0.0, y=0.0, rz=0.1, name="end",
                           amplitude=fx.SmoothStep((0.0, 1.0), (0.0, 1.0)))  # fmt: skip
        return fx.Scene(
            block(MPI.COMM_SELF, 2), materials=SOFT, model=fx.PlaneStress(), supports=[spin],
            effects=[fx.Inertia()],
        )  # fmt: skip

    step = fx.Explicit(until=fx.Time(0.6), rows=10, safety=0.05)
    whole = scene().run(step, progress=False)
    kept = fx.Checkpoint(tmp_path / "run.npz", every=1)
    with pytest.raises(Enough):
        scene().run(step, checkpoint=kept, observers=[stop], progress=False)
    again = scene().run(step, checkpoint=kept, restart=True, progress=False)
    for name in ("time", "R[end.rz]", "external_work"):
        a, b = (h[name].astype(float) for h in (whole, again))
        assert b == pytest.approx(a, rel=1e-9, abs=1e-9 * float(np.abs(a).max())), name


def test_a_reference_at_a_node_of_inexact_position() -> None:
    """The lever of a pin coupled to its own position is none, whatever round-off says."""
    place = np.nextafter(1.0, 2.0)
    pin = fx.Coupling("corner", (place, 1.0), x=0.1, y=0.0, name="pin",
                      amplitude=fx.SmoothStep((0.0, 1.0), (0.0, 1.0)))  # fmt: skip
    scene = fx.Scene(
        block(MPI.COMM_SELF), materials=SOFT, model=fx.PlaneStress(), effects=[fx.Inertia()],
        supports=[fx.Displacement("left", x=0.0, y=0.0), pin],
        monitors=[fx.Monitor("corner", (1.0, 0.0), "u")],
    )  # fmt: skip
    history = run(scene, 1.0, rows=4)
    assert float(history["m[u]"][-1]) == pytest.approx(0.1, rel=1e-9)
