"""Strain, stress and section forces of plies, against laminate theory and equilibrium."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from thin_bodies import thin_body

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.meshes.dcb import dcb_2d

PLY = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
)
LAY_UP = fx.Laminate([fx.Ply(0.2, 0), fx.Ply(0.2, 45), fx.Ply(0.1, 90)], PLY)


def stretched(x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return 1e-3 * x[0]


@pytest.mark.mpi
@pytest.mark.parametrize("layers", [1, 2])
def test_even_strain(layers: int) -> None:
    """e_xx = 1e-3 and nothing else in the plane, -1e-4 between the faces.

    Exact but for round-off: 1e-9 of the largest.
    """
    mesh = thin_body((3, 2), (6.0, 4.0), 0.5, layers=layers, comm=MPI.COMM_WORLD)
    scene = fx.Scene(
        mesh,
        materials={"body": fx.ContinuumShell(LAY_UP, "inner", "outer", axis=(1, 0, 0))},
        model=fx.Solid(),
        supports=[
            *(fx.Displacement(g, x=stretched, y=0.0) for g in ("a0", "a1", "b0", "b1")),
            fx.Displacement("inner", z=0.0),
            fx.Displacement("outer", z=-1e-4),
        ],
    )
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    found = fx.ply_results(scene, "body")
    # two layers of cells cut the middle ply
    assert len(found.cell) == {1: 6 * 3, 2: 6 * 4}[layers]
    assert sorted(set(found.ply.tolist())) == [0, 1, 2]
    assert np.array_equal(np.lexsort((found.ply, found.cell)), np.arange(len(found.cell)))
    top = found.of_ply(-1)
    assert top["x"][..., 2] == pytest.approx(np.tile([0.15, 0.2, 0.25], (6, 1)), abs=1e-9)
    assert top["strain"][..., 1] == pytest.approx(1e-3, abs=1e-12)  # the fibres are across
    assert np.abs(top["strain"][..., [0, 3, 4, 5]]).max() < 1e-12
    middle = found.of_ply(1)["strain"]
    assert middle[..., :2] == pytest.approx(5e-4, abs=1e-12)
    assert middle[..., 5] == pytest.approx(-1e-3, abs=1e-12)
    expected = found.strain @ PLY.stiffness()
    assert found.stress == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    # the normal stress goes on from ply to ply
    low, high = (found.of_ply(i)["stress"][..., 2] for i in (0, 2))
    between = found.stress[(found.ply == 1)][..., 2]
    if layers == 1:
        assert between[:, 0] == pytest.approx(low[:, 2], rel=1e-9)
        assert between[:, 2] == pytest.approx(high[:, 0], rel=1e-9)
    if layers == 1:
        # the strain across the cell is linear; its slope frees the cell of the moment of s_33
        m = LAY_UP.moments(2)
        mean = -2e-4
        slope = -(1e-3 * m[1][2, 0] + mean * m[1][2, 2]) / m[2][2, 2]
        n11 = 1e-3 * m[0][0, 0] + mean * m[0][0, 2] + slope * m[1][0, 2]
        m11 = 1e-3 * m[1][0, 0] + mean * m[1][0, 2] + slope * m[2][0, 2]
        assert found.forces[:, 0] == pytest.approx(n11, rel=1e-9)
        assert found.forces[:, 3] == pytest.approx(m11, rel=1e-9)
    scene.close()


def test_section_forces_of_a_cantilever() -> None:
    """Tip force 1 over a width of 2: Q13 is 1/2, M11 falls to nothing at the tip."""
    mesh = thin_body((8, 1), (10.0, 2.0), 0.5)
    scene = fx.Scene(
        mesh,
        materials=fx.ContinuumShell(LAY_UP, "inner", "outer", axis=(1, 0, 0)),
        model=fx.Solid(),
        supports=[
            fx.Displacement("a0", x=0.0, y=0.0, z=0.0),
            fx.Displacement("b0", y=0.0),
            fx.Displacement("b1", y=0.0),
        ],
        loads=[fx.Traction("a1", (0.0, 0.0, 1.0))],
    )
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    found = fx.ply_results(scene)
    x = found.centres[:, 0]
    inner = (x > 2.0) & (x < 9.0)  # away from the clamped and the loaded end
    assert found.forces[inner, 6] == pytest.approx(0.5, rel=0.01)
    # upwards at the tip: the top is pressed
    assert found.forces[inner, 3] == pytest.approx(-0.5 * (10.0 - x[inner]), rel=0.01)
    assert np.abs(found.forces[inner, 0]).max() < 1e-3
    scene.close()


def test_axes_of_the_ply_at_finite_strain(tmp_path: Path) -> None:
    """A rigid rotation strains nothing; the file has a line for each place of each ply."""
    mesh = thin_body((2, 1), (2.0, 1.0), 0.2)
    lam = fx.Laminate("[0/90]", PLY, 0.1)
    angle = 0.5

    def turned(k: int) -> object:
        c, s = np.cos(angle) - 1.0, np.sin(angle)
        return (lambda x: c * x[0] - s * x[2]) if k == 0 else (lambda x: s * x[0] + c * x[2])

    scene = fx.Scene(
        mesh,
        materials=fx.ContinuumShell(lam, "inner", "outer", axis=(1, 0, 0)),
        model=fx.Solid(),
        supports=[fx.Displacement(g, x=turned(0), y=0.0, z=turned(2)) for g in ("a0", "a1")],
        effects=[fx.FiniteStrain()],
    )
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    found = fx.ply_results(scene)
    assert np.abs(found.strain).max() < 1e-6
    assert found.angle.tolist() == [0.0, 90.0] * 2
    found.to_csv(tmp_path / "plies.csv")
    with open(tmp_path / "plies.csv", newline="") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 2 * 2 * 3
    assert lines[4]["place"] == "middle" and lines[4]["angle"] == "90.0"
    assert float(lines[4]["z"]) == pytest.approx(0.05)
    with pytest.raises(InputError, match="plies 0 to 1"):
        found.of_ply(2)
    with pytest.raises(InputError, match="no continuum shell 'skin'"):
        fx.ply_results(scene, "skin")
    scene.close()


def test_a_scene_without_shells() -> None:
    scene = fx.Scene(
        dcb_2d(MPI.COMM_SELF, dx=10.0),
        materials=PLY,
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("far_upper", x=0.0, y=0.0)],
    )
    with pytest.raises(InputError, match="no continuum shell; give"):
        fx.ply_results(scene)


# -- temperature -----------------------------------------------------------------------------------

CURED = fx.Orthotropic(PLY.E, PLY.nu, PLY.G, expansion=(-0.3e-6, 28e-6, 28e-6))
STEEL = fx.Isotropic(210e3, 0.3, expansion=12e-6)
ALUMINIUM = fx.Isotropic(70e3, 0.3, expansion=23e-6)
HOT_AND_COLD = {
    "cross-ply": (fx.Laminate("[0/90]", CURED, 0.25), -150.0),
    "bimetal": (fx.Laminate([fx.Ply(0.2, material=STEEL), fx.Ply(0.3, material=ALUMINIUM)]), 100.0),
}


@pytest.mark.verification
@pytest.mark.parametrize("finite", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", HOT_AND_COLD)
def test_free_plates_at_a_temperature(case: str, finite: bool) -> None:
    """One cell with all plies: curvatures, plies' stresses and energy of laminate theory.

    The strain across the plies is linear in the cell, not even in each ply: 1 % of the curvature,
    3 % of the largest stress.
    """
    lam, rise = HOT_AND_COLD[case]
    scene = fx.Scene(
        thin_body((4, 4), (4.0, 4.0), 0.5),
        materials=fx.ContinuumShell(lam, "inner", "outer", axis=(1, 0, 0)),
        model=fx.Solid(),
        supports=[
            fx.Displacement("a0", x=0.0),  # a quarter of the plate
            fx.Displacement("b0", y=0.0),
            fx.Displacement("corner", z=0.0),
        ],
        effects=[fx.Temperature(rise), *([fx.FiniteStrain()] if finite else [])],
    )
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    strain = np.linalg.solve(lam.abd(), rise * lam.thermal_forces())
    u = fx.displacement_function(scene)
    x = scene.continuum.positions()
    moved = u.x.array.reshape(-1, 3)
    low = np.isclose(x[:, 2], -0.25) & (x[:, :2].max(axis=1) < 3.01)  # free edges curl
    # the curvature is -w,xx
    w = -0.5 * (strain[3] * x[:, 0] ** 2 + strain[4] * x[:, 1] ** 2)
    assert moved[low, 2] == pytest.approx(w[low], abs=0.01 * np.abs(strain[3:5]).max() * 8.0)
    found = fx.ply_results(scene)
    scale = np.abs(found.stress).max()
    for i, ply in enumerate(lam.plies):
        at = found.of_ply(i)
        z = at["x"][..., 2]
        plane = strain[:3] + z[..., None] * strain[3:]
        whole = np.zeros((*z.shape, 6))
        whole[..., [0, 1, 5]] = plane
        free = ply.thermal_expansion() * rise
        c = ply.stiffness()
        # no stress across the ply
        whole[..., 2] = free[2] - (whole - free)[..., [0, 1, 5]] @ c[2, [0, 1, 5]] / c[2, 2]
        expected = ply.stress_to_ply((whole - free) @ c)
        inner = at["x"][:, 1, :2].max(axis=1) < 3.0  # away from the free edges
        assert at["stress"][inner][..., :2] == pytest.approx(
            expected[inner][..., :2], abs=0.03 * scale
        )
    assert np.abs(found.forces[:, :6]).max() < 0.02 * scale * 0.5
    # the work of the temperature is what is stored; at finite strain the trapezoidal rule adds up
    # to 1e-5 of it in each increment (NewtonOptions.balance)
    energy = scene.history.rows[-1]
    assert energy["strain_energy"] > 0.0
    assert abs(energy["balance"]) < (1e-4 if finite else 1e-8) * energy["strain_energy"]
    scene.close()
