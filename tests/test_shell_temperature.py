"""Thermal strain of shells: bending by a gradient, bimetals, the rate that mismatch releases."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.shell_stress import shell_stress
from fxcrack.meshes.sheets import Sheet, sheets

Array = npt.NDArray[np.float64]

ELEMENTS = {"Q1": ("quadrilateral", 1), "T1": ("triangle", 1), "Q2": ("quadrilateral", 2)}
ALLOY = fx.Isotropic(70e3, 0.3, expansion=2.3e-5)
STEEL = fx.Isotropic(210e3, 0.0, expansion=1.2e-5)
BRASS = fx.Isotropic(100e3, 0.0, expansion=1.9e-5)


def plate(
    comm: MPI.Intracomm, kind: str, section: fx.Section, temperature: fx.Temperature, **more: Any
) -> fx.Scene:
    cell, order = ELEMENTS[kind]
    s = np.linspace(0.0, 4.0, 5 if kind == "Q1" else 3)
    mesh = sheets([Sheet("plate", s, s, distort=0.2)], comm, cell=cell, order=order)
    given: dict[str, Any] = {
        "supports": [
            fx.Displacement("plate_a0b0", x=0.0, y=0.0, z=0.0),
            fx.Displacement("plate_a1b0", y=0.0, z=0.0),
            fx.Displacement("plate_a0b1", z=0.0),
        ],
        "monitors": [fx.Monitor("plate_a1b1", (0, 0, 1), name="w")],
    }
    return fx.Scene(
        mesh, model=fx.Shell(), materials=section, effects=[temperature, *more.pop("effects", [])],
        **(given | more),
    )  # fmt: skip


def solved(scene: fx.Scene) -> fx.History:
    return scene.run(fx.Static(until=fx.Time(1.0)), progress=False)


@pytest.mark.mpi
@pytest.mark.parametrize("solver", [None, "newton"])
@pytest.mark.parametrize("kind", ELEMENTS)
def test_gradient_over_the_thickness(comm: MPI.Intracomm, kind: str, solver: str | None) -> None:
    """A free plate becomes a sphere, w = -kappa/2 ((x-x0)^2 + ...) without stress and energy."""
    t, offset, slope = 0.2, 0.05, 30.0
    section = fx.Section(ALLOY, thickness=t, offset=offset)
    warm = fx.Temperature(lambda x: 20.0 + slope * x[2], reference=5.0)
    scene = plate(comm, kind, section, warm, solver=solver)
    history = solved(scene)
    # about the corner a0b0 held flat at three corners: w(4, 4) = -kappa (x y)/... of a sphere
    kappa = 2.3e-5 * slope
    q = scene.continuum.layout.by_node(fx.displacement_function(scene).x.array)
    x = scene.continuum.positions()
    # sphere through the three corners: w = -kappa/2 (x^2 + y^2 - 4 x - 4 y)
    w = -0.5 * kappa * (x[:, 0] ** 2 + x[:, 1] ** 2 - 4.0 * x[:, 0] - 4.0 * x[:, 1])
    if kind == "Q2":  # first-order cells hold the curvature of each cell only in the mean
        assert np.abs(q[:, 2] - w).max(initial=0.0) < 1e-9 * kappa * 16.0
    shell = scene.continuum
    assert isinstance(shell, ShellBodies)
    assert shell.temperature is not None
    shell.temperature.set(1.0)
    found = shell_stress(shell, fx.displacement_function(scene).x.array)[0]
    held = 70e3 * t * 2.3e-5 * 15.0 / 0.7
    assert np.abs(found.forces).max(initial=0.0) < 1e-8 * held
    assert np.abs(found.faces).max(initial=0.0) < 1e-8 * held / t
    assert abs(history["strain_energy"][-1]) < 1e-9 * held
    assert abs(history["balance"][-1]) < 1e-9


def _bimetal(rise: float, thicknesses: tuple[float, float]) -> tuple[float, float]:
    """Curvature and strain energy per area of a strip of steel below brass (Timoshenko 1925)."""
    (t1, t2), (e1, e2), (a1, a2) = thicknesses, (210e3, 100e3), (1.2e-5, 1.9e-5)
    m, n, h = t1 / t2, e1 / e2, t1 + t2
    shape = 3.0 * (1.0 + m) ** 2 + (1.0 + m * n) * (m**2 + 1.0 / (m * n))
    curvature = 6.0 * (a2 - a1) * rise * (1.0 + m) ** 2 / (h * shape)
    # forces -+ P and moments E I curvature in the layers, P h/2 = sum of the moments
    bending = (e1 * t1**3 + e2 * t2**3) / 12.0
    force = 2.0 * bending * curvature / h
    energy = 0.5 * bending * curvature**2 + 0.5 * force**2 * (1 / (e1 * t1) + 1 / (e2 * t2))
    return curvature, energy


@pytest.mark.mpi
@pytest.mark.parametrize("effects", [[], [fx.FiniteStrain()]], ids=["small", "large"])
def test_bimetal(comm: MPI.Intracomm, effects: list[Any]) -> None:
    """Curvature of a strip of two plies, at small and at large rotation, and the energies."""
    section = fx.Section(
        fx.Laminate([fx.Ply(0.5, 0.0, STEEL), fx.Ply(0.7, 0.0, BRASS)]), axis=(1, 0, 0)
    )
    rise, length = 100.0, 20.0
    mesh = sheets([Sheet("strip", np.linspace(0, length, 9), [0.0, 1.0])], comm)
    scene = fx.Scene(
        mesh,
        model=fx.Shell(),
        materials=section,
        supports=[
            fx.Symmetry("strip_a0", "x"),
            fx.Displacement("strip_a0", z=0.0),
            fx.Displacement("strip_a0b0", y=0.0),
        ],
        effects=[fx.Temperature(rise), *effects],
        monitors=[fx.Monitor("strip_a1b0", (0, 0, 1), name="w")],
    )
    history = solved(scene)
    curvature, energy = _bimetal(rise, (0.5, 0.7))
    across = _bimetal(rise, (0.5, 0.7))[1]
    # concave on the side of the steel, which expands less
    assert history["m[w]"][-1] == pytest.approx(-0.5 * curvature * length**2, rel=5e-3)
    assert history["strain_energy"][-1] == pytest.approx((energy + across) * length, rel=5e-3)
    assert abs(history["balance"][-1]) < 1e-5


@pytest.mark.mpi
def test_rate_of_thermal_mismatch(comm: MPI.Intracomm) -> None:
    """Two bonded strips without loads: G is the energy per area that the bonded part holds."""
    rise, t1, t2 = 100.0, 0.5, 0.7
    x = np.linspace(0.0, 40.0, 41)
    width = np.array([0.0, 0.5])
    mesh = sheets(
        [
            Sheet("steel", x, width),
            Sheet("brass", x, width, surface=lambda a, b: (a, b, 0.5 * (t1 + t2) + 0.0 * a)),
        ],
        comm,
    )
    bond = fx.Interface(
        slave=fx.Face("brass", "bottom"), master=fx.Face("steel", "top"),
        bonded=lambda x: x[0] >= 20.0 - 1e-9, name="bond",
    )  # fmt: skip
    scene = fx.Scene(
        mesh,
        model=fx.Shell(),
        materials={
            "steel": fx.Section(STEEL, thickness=t1),
            "brass": fx.Section(BRASS, thickness=t2),
        },
        supports=[
            fx.Symmetry("steel_a1", "x"),
            fx.Symmetry("brass_a1", "x"),
            *(fx.Symmetry(f"{s}_{b}", "y") for s in ("steel", "brass") for b in ("b0", "b1")),
            fx.Displacement("steel_a1b0", z=0.0),
        ],
        effects=[fx.Temperature(rise)],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1e9))],
    )
    history = solved(scene)
    # held across: nu = 0, so that the strains along and across do not know of each other
    energy = _bimetal(rise, (t1, t2))[1]
    found = history["GI[bond]"][-1] + history["GII[bond]"][-1]
    assert found == pytest.approx(energy, rel=2e-2)
