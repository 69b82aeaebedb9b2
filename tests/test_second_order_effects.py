"""Membrane effects and compression of linear bodies: estimates against closed forms, and words."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from specimens import HELD_FAR, specimen
from thin_bodies import thin_body

import fxcrack as fx
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.second_order import SecondOrderCells
from fxcrack.demos.shell_blister import BENDING, FILM, scene
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.solvers.second_order_effects import SecondOrderEffects, second_order_effects

YOUNG, POISSON, LENGTH = 70e3, 0.3, 60.0


def estimate(scene: fx.Scene) -> SecondOrderEffects:
    u = scene.solver.displacement()
    now = u.array_r.copy()
    u.destroy()
    return second_order_effects(scene.solver, now)


def loaded(scene: fx.Scene, time: float = 1.0) -> fx.Scene:
    scene.run(fx.Static(until=fx.Time(time)), grow=[], progress=False)
    return scene


@pytest.mark.mpi
@pytest.mark.parametrize(
    "model", [fx.PlaneStrain(thickness=2.0), fx.PlaneStress(), fx.Axisymmetric(), fx.Solid()]
)
def test_energies_of_a_rotation(comm: MPI.Intracomm, model: Any) -> None:
    """A small rotation w has q = w^2/2 across its axis; stress s does (s_xx + s_yy) w^2 V on it."""
    if model.mesh_gdim == 2:
        mesh = dcb_2d(comm, length=6.0, dx=1.0, ny=1)
    else:
        mesh = dcb_3d(comm, length=6.0, width=20.0, dx=2.0, dy=10.0, ny=1)
    bodies = Continuum(mesh, fx.Isotropic(YOUNG, POISSON), model, order=2)
    x = bodies.positions()[: bodies.n_local // bodies.gdim]
    cells = SecondOrderCells(bodies)
    turn, stretch, w, d = (
        np.zeros((len(x), bodies.gdim)),
        np.zeros((len(x), bodies.gdim)),
        0.1,
        1e-3,
    )
    turn[:, 0], turn[:, 1], stretch[:, 0] = -w * x[:, 1], w * x[:, 0], d * x[:, 0]
    c = model.reduce(fx.Isotropic(YOUNG, POISSON).stiffness())
    ring = isinstance(model, fx.Axisymmetric)
    # a rotation has a hoop strain that is no constant: in a ring the stretch is its own direction
    moved = stretch if ring else turn
    q, e, section = np.zeros(len(c)), np.zeros(len(c)), 18.0
    q[:2], e[0] = 0.5 * w**2, d
    if ring:
        e[2] = d
    s = c @ e
    if ring:
        work, volume = d**2 * (s[0] + s[2]), 2.0 * np.pi * section * 3.0
        q[:] = 0.0
        q[[0, 2]] = 0.5 * d**2
    else:
        work = w**2 * (s[0] + s[1])
        volume = section * (20.0 if model.mesh_gdim == 3 else model.thickness)
    forces = cells.geometric(stretch.ravel(), moved.ravel())
    got = np.sum(comm.allgather(float(moved.ravel() @ forces)))
    assert got == pytest.approx(work * volume, rel=1e-12)
    found = cells.of(moved.ravel())
    assert found.fourth == pytest.approx(0.5 * q @ c @ q * volume, rel=1e-12)
    # r is the derivative of int C q : e, whose work on the stretch is that of C q on its strain
    got = np.sum(comm.allgather(float(stretch.ravel() @ found.stretching)))
    assert got == pytest.approx(q @ c @ e * volume, rel=1e-12)


@pytest.mark.mpi
@pytest.mark.parametrize("share", [0.05, 0.5, 1.5])
def test_part_of_the_buckling_load(
    comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture, share: float
) -> None:
    """A straight strut, two arms bonded nearly all along: its deflection says nothing of it."""
    force = 0.5 * share * np.pi**2 * YOUNG / (1.0 - POISSON**2) * 3.0**3 / 12.0 / 4.0 / LENGTH**2
    pushes = [fx.PointForce(p, (force, 0.0)) for p in ("pin_top", "pin_bottom")]
    mesh = dcb_2d(comm, length=LENGTH, dx=2.0, ny=1)
    strut = loaded(specimen(mesh, a0=2.0, order=2, supports=HELD_FAR, loads=pushes))
    if comm.size == 1:  # on several ranks it would take a factorisation of its own
        words = [m for m in caplog.messages if "would buckle" in m]
        assert len(words) == (share > 0.1)
        assert all(f"has reached {share:.2g} of" in m and "FiniteStrain()" in m for m in words)
        assert all(("the bodies have buckled" in m) == (share > 1.0) for m in words)
    found = estimate(strut)
    # the column shears as well, 0.1 % at this length
    assert found.buckling == pytest.approx(share, rel=3e-3)
    assert abs(found.stiffening) < 4e-3 * share
    loaded(strut, 1.01)
    assert sum("would buckle" in m for m in caplog.messages) <= 1
    strut.close()


@pytest.mark.parametrize(("length", "dx", "ny"), [(24.0, 1.0, 1), (30.0, 2.0, 2), (40.0, 2.0, 3)])
def test_arms_that_have_come_apart(
    caplog: pytest.LogCaptureFixture, length: float, dx: float, ny: int
) -> None:
    """They move without strain: their energy is round-off, over which nothing counts."""
    pins = fx.Displacement("pin_top", x=0.0, y=1.3), fx.Displacement("pin_bottom", x=0.1, y=-1.0)
    mesh = dcb_2d(MPI.COMM_SELF, length=length, dx=dx, ny=ny)
    apart = specimen(mesh, a0=6.0, criterion=fx.VCCT(GIc=2e-4), supports=pins)
    apart.run(fx.Static(until=fx.Time(1.0)), progress=False)
    assert not any("membrane" in m or "buckle" in m for m in caplog.messages)
    assert estimate(apart) == SecondOrderEffects(0.0, 0.0)
    apart.close()


def test_bodies_that_turn_as_rigid_ones(caplog: pytest.LogCaptureFixture) -> None:
    """They bear nothing but round-off, by which no stiffening can be divided."""
    for ny in (1, 2, 3):  # the sign of a strain energy of round-off is by chance
        turned = (lambda x: 0.1 * x[1]), 0.0
        ends = [fx.Displacement(f"end_{arm}", *turned) for arm in ("upper", "lower")]
        mesh = dcb_2d(MPI.COMM_SELF, length=30.0, dx=1.0, ny=ny)
        one = loaded(specimen(mesh, a0=2.0, supports=ends))
        assert estimate(one) == SecondOrderEffects(0.0, 0.0)
        assert "membrane" not in caplog.text
        one.close()


def test_clamped_circular_plate(caplog: pytest.LogCaptureFixture) -> None:
    """Stretching of w0 (1 - r^2/a^2)^2 between fixed edges: 0.4713 (w0/t)^2 at nu = 0.3.

    The displacement in the plane follows from w in closed form. Half the sum of both signs of the
    pressure: the film is held at its lower face, so that its edge bends against the base.
    """
    found = []
    for sign in (1.0, -1.0):
        one = scene(sign * 64.0 * BENDING * FILM, finite=False, n_around=4, n_inside=8)
        found.append(estimate(loaded(one)))
        one.close()
    assert 0.5 * (found[0].stiffening + found[1].stiffening) == pytest.approx(0.4713, rel=0.02)
    assert found[0].buckling < 1e-3
    words = next(m for m in caplog.messages if "membrane effects" in m)
    assert f"{100.0 * found[0].stiffening:.2g} % stiffer" in words and "FiniteStrain()" in words


@pytest.mark.slow
def test_arms_against_finite_strain() -> None:
    """What arms stiffen by as they turn, 0.15 radians: free ends contract and stretch nothing."""
    load = []
    for effects in ([], [fx.FiniteStrain()]):
        mesh = dcb_2d(MPI.COMM_SELF, length=40.0, dx=2.0, ny=1)
        one = loaded(specimen(mesh, order=2, effects=effects), 3.0)
        load.append(abs(float(one.history.rows[-1]["R[pin_top.y]"])))
        if not effects:
            found = estimate(one)
        one.close()
    assert found.buckling < 0.01
    # the next order is (0.15)^2 of it
    assert found.stiffening == pytest.approx(load[1] / load[0] - 1.0, rel=0.1)
    assert found.stiffening < 0.03


@pytest.mark.parametrize("order", [1, 2])
def test_continuum_shells(order: int) -> None:
    """A turned ply at a constant gradient, as a solid in the frame of its fibres."""
    ply = fx.Orthotropic((120e3, 10e3, 10e3), (0.3, 0.3, 0.4), (5e3, 5e3, 3.5e3))
    shell = fx.ContinuumShell(
        fx.Laminate([30.0], ply, 0.5), "inner", "outer", (1.0, 0.0, 0.0), shear_factors=(1.0, 1.0)
    )
    mesh = thin_body((2, 2), (4.0, 3.0), 0.5, order=order)
    found = []
    for material in (shell, replace(ply, frame=30.0)):
        bodies = Continuum(mesh, material, fx.Solid(), order=order)
        h = np.random.default_rng(1).uniform(-0.1, 0.1, (3, 3))
        found.append(SecondOrderCells(bodies).of((bodies.positions() @ h.T).ravel()))
    one, two = found
    assert (one.third, one.fourth) == pytest.approx((two.third, two.fourth), rel=1e-10)
    assert one.third != pytest.approx(0.0, abs=1e-3 * one.fourth)
