"""Inertia of shells in implicit dynamics: frequency, offset sections, and a crack under way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.sheets import Sheet, sheets

E, RHO, LENGTH, WIDTH = 70e3, 2.7e-9, 20.0, 2.0
UNDAMPED = {"rho_inf": 1.0}


def beam(comm: MPI.Intracomm, height: float, order: int, offset: float) -> fx.Scene:
    """A beam on two supports that is given the velocity of its first mode, 1 in the middle."""
    mesh = sheets(
        [
            Sheet(
                "beam", np.linspace(0.0, LENGTH, 9), [0.0, WIDTH],
                points={"middle": (0.5 * LENGTH, 0.0)},
            )
        ],
        comm,
        order=order,
    )  # fmt: skip
    start = (0.0, 0.0, lambda x: np.sin(np.pi * x[0] / LENGTH))
    return fx.Scene(
        mesh,
        model=fx.Shell(),
        materials=fx.Section(fx.Isotropic(E, 0.0, density=RHO), thickness=height, offset=offset),
        supports=[
            fx.Displacement("beam_a0", x=0.0, z=0.0),
            fx.Displacement("beam_a1", z=0.0),
            fx.Displacement("beam_b0", y=0.0),
        ],
        effects=[fx.Inertia(velocity=start, **UNDAMPED)],
        monitors=[fx.Monitor("middle", (0, 0, 1), name="w")],
    )


def timoshenko(height: float) -> float:
    """Lowest circular frequency of a simply supported beam with shear and rotatory inertia."""
    area, inertia = WIDTH * height, WIDTH * height**3 / 12.0
    k, shear = np.pi / LENGTH, 5.0 / 6.0 * 0.5 * E * WIDTH * height
    # w, theta: [GA k^2, -GA k; -GA k, EI k^2 + GA] - omega^2 [rho A, rho I]
    stiffness = np.array([[shear * k**2, -shear * k], [-shear * k, E * inertia * k**2 + shear]])
    mass = RHO * np.array([area, inertia])
    return float(np.sqrt(np.linalg.eigvals(stiffness / mass[:, None]).real.min()))


@pytest.mark.mpi
@pytest.mark.parametrize(("order", "height"), [(1, 0.5), (2, 2.0)])
def test_frequency_of_a_beam(comm: MPI.Intracomm, order: int, height: float) -> None:
    """The middle comes back after half a period, at the height v/omega after a quarter."""
    period = 2.0 * np.pi / timoshenko(height)
    scene = beam(comm, height, order, 0.0)
    n = 30
    step = fx.Dynamic(until=fx.Time(0.6 * period), dt=period / n)
    history = scene.run(step, progress=False)
    t, w = (history[c].astype(float) for c in ("time", "m[w]"))
    down = int(np.flatnonzero((w[1:] < 0.0) & (w[:-1] >= 0.0))[0])
    zero = t[down] + (t[down + 1] - t[down]) * w[down] / (w[down] - w[down + 1])
    # increments of the trapezoidal rule lengthen the period by (omega dt)^2/12; linear cells with
    # consistent mass shorten it by (k h)^2/8: (k h)^2/12 of the stiffness and (k h)^2/6 of the mass
    expected = 0.5 * period * (1.0 + (2.0 * np.pi / n) ** 2 / 12.0)
    if order == 1:
        expected *= 1.0 - (np.pi / 8.0) ** 2 / 8.0
    assert zero == pytest.approx(expected, rel=3e-3)
    assert w.max() == pytest.approx(period / (2.0 * np.pi), rel=3e-2)
    work = history["kinetic_energy"].astype(float).max()
    assert np.abs(history["balance"]).max() < 1e-8 * work


def test_offset_moves_mass_and_stiffness_alike(comm: MPI.Intracomm) -> None:
    """The mesh on the bottom of the same beam, on rollers: bending as about the middle."""
    found = []
    for offset in (0.0, 0.25):
        scene = beam(comm, 0.5, 2, offset)
        period = 2.0 * np.pi / timoshenko(0.5)
        history = scene.run(
            fx.Dynamic(until=fx.Time(0.3 * period), dt=period / 30.0), progress=False
        )
        found.append(history["m[w]"].astype(float).max())
    # the supports now hold the bottom along, which moves the mass with the slope: (pi h/2L)^2
    assert found[1] == pytest.approx(found[0], rel=1e-2)


@pytest.mark.mpi
def test_crack_under_way(comm: MPI.Intracomm) -> None:
    """Arms torn apart: the crack grows and the energies balance to round-off of the increments."""
    x = np.linspace(0.0, 40.0, 21)
    across = [0.0, 2.0]
    mesh = sheets(
        [
            Sheet("upper", x, across, lambda a, b: (a, b, 0.5 + 0.0 * a)),
            Sheet("lower", x, across, lambda a, b: (a, b, -0.5 + 0.0 * a)),
        ],
        comm,
    )
    bond = fx.Interface(
        slave=fx.Face("lower", "top"), master=fx.Face("upper", "bottom"),
        bonded=lambda x: x[0] >= 16.0 - 1e-9, name="bond",
    )  # fmt: skip
    given: dict[str, Any] = {
        "model": fx.Shell(),
        "materials": fx.Section(fx.Isotropic(E, 0.0, density=RHO), thickness=1.0),
        "supports": [
            fx.Displacement("upper_a0", x=0.0, z=8e3),
            fx.Displacement("lower_a0", x=0.0, z=-8e3),
            *(fx.Symmetry(f"{arm}_{b}", "y") for arm in ("upper", "lower") for b in ("b0", "b1")),
        ],
        "debonds": [fx.Debond(bond, fx.VCCT(GIc=0.2), release=fx.ProgressiveRelease())],
        "effects": [fx.Inertia(**UNDAMPED)],
    }
    scene = fx.Scene(mesh, **given)
    history = scene.run(fx.Dynamic(until=fx.Time(5e-5), dt=2e-6), progress=False)
    assert history["a[bond]"][-1] > 17.9
    work = float(history["external_work"].max())
    assert np.abs(history["balance"].astype(float)).max() < 1e-6 * work
