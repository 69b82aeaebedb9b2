"""Contact of explicit dynamics between meshes that do not match, whichever side is the denser."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.optimize
from mpi4py import MPI
from test_explicit import beam, coarse, until

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.solvers.explicit_faces import FaceForces, OpenFaces, find_forces, without_gain


def rows(ratio: float, seed: int, mu: float = 0.0) -> tuple[OpenFaces, np.ndarray]:
    """Slaves of mass 1 that share masters of mass 1/ratio each by random weights, and H."""
    rng = np.random.default_rng(seed)
    n, m = 12, 4
    weights = np.zeros((n, m))
    for i, w in enumerate(rng.random(n)):
        j = i * (m - 1) // n
        weights[i, j], weights[i, j + 1] = w, 1.0 - w
    h = np.eye(n) + ratio * weights @ weights.T
    sums = np.repeat(np.abs(h).sum(axis=1)[:, None], 2, axis=1)
    faces = OpenFaces(
        np.tile([0.0, 1.0], (n, 1)), None, np.arange(n), np.full(n, mu),
        np.repeat(np.diag(h)[:, None], 2, axis=1), sums, lambda f: h @ f, False,
    )  # fmt: skip
    return faces, h


NONE: Any = SimpleNamespace(direction=np.zeros((0, 2)), origin=np.zeros(0))
NO_ROWS = np.zeros(0, dtype=np.int64)


def found(faces: OpenFaces, free: np.ndarray) -> FaceForces:
    return find_forces(faces, NONE, NO_ROWS, np.zeros_like(free), free, 1.0)


@pytest.mark.parametrize("ratio", [0.1, 5.0, 100.0])
def test_pressures_are_those_of_the_quadratic_programme(ratio: float) -> None:
    """min p.H p/2 + g.p, p >= 0, by least squares with positive unknowns (Lawson and Hanson)."""
    for seed in range(5):
        faces, h = rows(ratio, seed)
        free = np.zeros((len(h), 2))
        free[:, 1] = np.random.default_rng(seed + 50).normal(-0.3, 1.0, len(h))
        forces = found(faces, free)
        root = np.linalg.cholesky(h)
        known, _ = scipy.optimize.nnls(root.T, -np.linalg.solve(root, free[:, 1]))
        assert forces.settled
        # sweeps end at a change of 1e-12; the condition number of H is 40 times the ratio
        assert forces.pressure == pytest.approx(known, abs=1e-7 * known.max())


@pytest.mark.parametrize("ratio", [0.1, 5.0, 30.0])
def test_friction_sticks_or_slides_against_the_motion(ratio: float) -> None:
    for seed in range(4):
        faces, h = rows(ratio, seed, mu=0.4)
        free = np.random.default_rng(seed).normal(-0.3, 1.0, (len(h), 2))
        forces = found(faces, free)
        assert forces.settled
        after = free + h @ (forces.pressure[:, None] * faces.normal + forces.holding)
        held, limit = forces.holding[:, 0], 0.4 * forces.pressure
        size = 1e-7 * np.abs(free).max()
        assert after[:, 1].min() >= -size
        assert np.abs(after[:, 1] * forces.pressure).max() <= size * forces.pressure.max()
        slides = (limit - np.abs(held) < 1e-7 * limit.max()) & (forces.pressure > 0.0)
        sticks = (forces.pressure > 0.0) & ~slides
        assert np.abs(after[sticks, 0]).max(initial=0.0) <= size
        assert np.all(after[slides, 0] * held[slides] <= size * limit.max())


def test_forces_that_do_not_agree_add_no_energy() -> None:
    faces, h = rows(5.0, 1)
    rng = np.random.default_rng(3)
    before = rng.normal(-1.0, 0.2, (len(h), 2))
    after = rng.normal(-1.0, 0.2, (len(h), 2))
    forces = 100.0 * np.abs(rng.normal(size=(len(h), 1))) * faces.normal
    part = without_gain(faces, forces, before, after, 0.5)
    assert 0.0 < part < 1.0
    work = part * np.vdot(forces, before + after) + 0.5 * part**2 * np.vdot(forces, h @ forces)
    assert work <= 1e-9 * abs(np.vdot(forces, before))
    assert without_gain(faces, forces, -before, -after, 0.5) == 0.0


HEAVY = fx.Isotropic(210e3, 0.0, density=7.8e-9)
LIGHT = fx.Isotropic(10e3, 0.0, density=1.6e-9)


@pytest.mark.mpi
@pytest.mark.parametrize("slave", ["heavy", "light"])
def test_bars_of_unlike_meshes_meet(
    comm: MPI.Intracomm, slave: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Pressure Z1 Z2 v/(Z1 + Z2), Z = sqrt(E rho), at both sides, with 6 elements on 2."""
    length, width, speed = 10.0, 2.0, 1e3
    upper, lower = (HEAVY, LIGHT) if slave == "heavy" else (LIGHT, HEAVY)
    interface = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: np.zeros(x.shape[1], bool), name="faces",
        contact=True, friction=0.3, pairing="node-to-surface",
    )  # fmt: skip
    scene = fx.Scene(
        dcb_2d(comm, length=width, height=length, dx=width / 6, ny=40, nx_lower=2),
        materials={"upper": upper, "lower": lower},
        model=fx.PlaneStress(),
        debonds=[fx.Debond(interface, fx.VCCT(GIc=0.2))],
        effects=[fx.Inertia(velocity=(0.0, lambda x: np.where(x[1] > 0.0, -speed, 0.0)))],
    )
    fastest = np.sqrt(HEAVY.E / HEAVY.density)
    history = scene.run(fx.Explicit(until=fx.Time(0.8 * length / fastest), rows=10))
    dynamics, every = scene.solver.dynamics, np.ones(scene.solver.lumped.n_rows, dtype=bool)
    gap, _ = dynamics.open_pairs.smallest_gap(every, dynamics.gap)
    scene.close()
    z = [np.sqrt(m.E * m.density) for m in (HEAVY, LIGHT)]
    pressure = z[0] * z[1] / sum(z) * speed
    time = history["time"][-1]
    # strain energy behind both waves; the meeting of the end nodes and the ripples of 40 elements
    # take 4 % of it or less
    speeds = [np.sqrt(m.E / m.density) for m in (HEAVY, LIGHT)]
    behind = sum(c / m.E for c, m in zip(speeds, (HEAVY, LIGHT), strict=True)) * time * width
    strain = history["strain_energy"][-1]
    assert strain == pytest.approx(0.5 * pressure**2 * behind, rel=0.06)
    assert gap >= -1e-9 * speed * time
    assert "settle" not in caplog.text
    assert np.abs(history["balance"]).max() <= 1e-11 * history["initial_energy"][0]
    assert np.all(np.diff(history["contact_energy"]) >= -1e-12 * history["initial_energy"][0])


def test_returning_to_an_earlier_increment_takes_its_loads() -> None:
    """Bond forces of an increment that is returned to are those it had."""
    scene = beam(MPI.COMM_SELF, 8e3, mesh=coarse(MPI.COMM_SELF))
    scene.run(until(scene, 40.0, 2e-5, rows=4))
    solver = scene.solver
    loads = [np.full(solver.n_loads, 1e-6 * t) for t in (20.0, 21.0, 25.0)]
    solver.begin(loads[0], loads[1])
    saved, bonds = solver.remember(), solver.present.bonds.copy()
    reactions = solver.reactions()
    solver.finish()
    solver.begin(loads[1], loads[2])
    assert np.abs(solver.reactions() - reactions).max() > 1e-3 * np.abs(reactions).max()
    solver.recall(saved)
    assert solver.present.bonds == pytest.approx(bonds, rel=1e-9, abs=1e-9 * np.abs(bonds).max())
    assert solver.reactions() == pytest.approx(reactions, rel=1e-9)
    scene.close()


@pytest.mark.slow
@pytest.mark.mpi
def test_bonds_that_soften_in_shear_under_pressure_with_friction(
    comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture
) -> None:
    """Friction and softening bonds share one slip; their forces are found in every increment.

    Sweeps in which they gave way to each other needed more than 1,000 in some increments here.
    """
    slow = fx.SmoothStep((0.0, 1e-5), (0.0, 1.0))
    interface = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 3.0 - 1e-9, name="faces",
        contact=True, friction=1.0,
    )  # fmt: skip
    scene = fx.Scene(
        dcb_2d(comm, length=8.0, height=1.5, dx=0.5, ny=3),
        materials=fx.Isotropic(70e3, 0.3, density=2.7e-9),
        model=fx.PlaneStrain(),
        debonds=[fx.Debond(interface, fx.VCCT(0.05), fx.ProgressiveRelease())],
        effects=[fx.Inertia()],
        supports=[
            fx.Displacement("bottom", x=0.0, y=0.0),
            fx.Displacement.by_velocity("end_upper", x=5e3, amplitude=slow),
        ],
        loads=[fx.Pressure("top", 300.0, amplitude=slow)],
    )
    history = scene.run(fx.Explicit(until=fx.Time(3e-5), rows=10))
    scene.close()
    assert "did not settle" not in caplog.text
    assert history["released[faces]"][-1] > 5
    assert history["friction_energy"][-1] > 0.1 * history["external_work"][-1]
    assert np.abs(history["balance"]).max() <= 1e-11 * history["external_work"].max()
    assert history["spent[faces]"][-1] == pytest.approx(0.05, rel=1e-6)
