"""Laminates: notation, classical laminate theory, shear factors, the homogeneous body."""

from __future__ import annotations

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import dolfinx.mesh
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from scipy.sparse import csr_array
from scipy.sparse.linalg import spsolve

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.lay_up import angles_of
from fxcrack.mesh.domain import mesh_from_domain

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-12

CARBON = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.30, 0.30, 0.436), G=(4.6e3, 4.6e3, 3.54e3)
)
# Pagano 1969: E1/E2 = 25, G12 = G13 = E2/2, G23 = E2/5, nu = 0.25
PAGANO = fx.Orthotropic(E=(25.0, 1.0, 1.0), nu=(0.25, 0.25, 0.25), G=(0.5, 0.5, 0.2))
STEEL = fx.Isotropic(E=210e3, nu=0.3, expansion=12e-6)
ALUMINIUM = fx.Isotropic(E=70e3, nu=0.3, expansion=23e-6)


# -- notation --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("notation", "angles"),
    [
        ("[0]", [0]),
        ("[0/90]", [0, 90]),
        ("0/90", [0, 90]),
        ("[0, 90]", [0, 90]),
        ("[0/90]T", [0, 90]),
        ("[0/90]s", [0, 90, 90, 0]),
        ("[0/90]S", [0, 90, 90, 0]),
        ("[0/90]2", [0, 90, 0, 90]),
        ("[0/90]_2", [0, 90, 0, 90]),
        ("[0/90]2s", [0, 90, 0, 90, 90, 0, 90, 0]),
        (f"[0/90]_{2}s", [0, 90, 0, 90, 90, 0, 90, 0]),
        ("[0/45]s2", [0, 45, 45, 0, 0, 45, 45, 0]),
        ("[0_3/90]", [0, 0, 0, 90]),
        ("[+-45/0]", [45, -45, 0]),
        ("[±45_2/0]s", [45, -45, 45, -45, 0, 0, -45, 45, -45, 45]),
        ("[0/(45/-45)2/90]", [0, 45, -45, 45, -45, 90]),
        ("[22.5/-7.5e1]", [22.5, -75]),
    ],
)
def test_notation(notation: str, angles: list[float]) -> None:
    assert list(angles_of(notation)) == angles


@pytest.mark.parametrize(
    "notation",
    ["", "[", "[0/90", "[0//90]", "[0/90]]", "[0/x]", "[0/90]0", "[0_/90]", "[]", "[0 90]"],
)
def test_notation_faults(notation: str) -> None:
    with pytest.raises(InputError, match="lay-up"):
        angles_of(notation)


def test_ways_to_write_one_laminate() -> None:
    quarter = fx.Laminate("[0/45/-45/90]", CARBON, 0.125)
    whole = fx.Laminate([0, 45, -45, 90] * 2 + [90, -45, 45, 0] * 2, CARBON, 0.125)
    assert quarter.repeated(2).symmetric() == whole
    assert fx.Laminate("[0/45/-45/90]2s", material=CARBON, thickness=0.125) == whole
    assert quarter.clustered(2).angles == (0, 0, 45, 45, -45, -45, 90, 90)
    assert quarter.turned(45).angles == (45, 90, 0, 135)
    assert whole.thickness == pytest.approx(2.0, rel=ROUND_OFF)
    assert quarter.interfaces() == pytest.approx([-0.25, -0.125, 0, 0.125, 0.25], abs=ROUND_OFF)
    assert quarter.interfaces(0.25)[0] == pytest.approx(0.0, abs=ROUND_OFF)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fx.Laminate([]), "no ply"),
        (lambda: fx.Laminate([0, 90], CARBON), "thickness="),
        (lambda: fx.Laminate([fx.Ply(0.1)]), "no material"),
        (lambda: fx.Laminate([0], fx.Isotropic, 0.1), "not a material"),
        (lambda: fx.Laminate([0], fx.NeoHookean(1.0, 0.3), 0.1), "linear elastic"),
        (lambda: fx.Laminate(fx.Ply(0.1), CARBON), "list of plies"),
        (lambda: fx.Laminate(["0"], CARBON, 0.1), "neither a Ply"),
        (lambda: fx.Laminate([0], CARBON, 0.1).repeated(0), "positive number"),
        (lambda: fx.Laminate([0], CARBON, 0.1, frame=((1, 0, 0), (2, 0, 0))), "parallel"),
        (lambda: fx.Laminate([0], CARBON, 0.1, frame=((1, 0), (0, 1))), "two direction vectors"),
        (lambda: fx.Ply(-0.1), "positive"),
        (lambda: fx.Ply("0.1"), "not a number"),
        (lambda: fx.Ply(0.1, np.nan), "finite"),
    ],
)
def test_faults(make: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()  # type: ignore[operator]


# -- classical laminate theory ---------------------------------------------------------------------


def test_one_isotropic_ply() -> None:
    e, nu, t = 70e3, 0.3, 2.0
    plate = fx.Laminate([fx.Ply(t, 30.0)], fx.Isotropic(e, nu))
    unit = e / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    expected = np.kron(np.diag([t, t**3 / 12]), unit)
    assert plate.abd() == pytest.approx(expected, abs=ROUND_OFF * expected.max())
    assert plate.shear_factors() == pytest.approx([5 / 6, 5 / 6], rel=ROUND_OFF)
    shear = 5 / 6 * t * e / 2 / (1 + nu) * np.eye(2)
    assert plate.shear_stiffness() == pytest.approx(shear, abs=ROUND_OFF * shear.max())


@pytest.mark.verification
def test_textbook_laminate() -> None:
    """[0/30/-45] of graphite/epoxy, plies of 5 mm: Kaw 2006, Mechanics of Composite Materials,
    examples 4.2 and 4.3, printed to four digits."""
    ply = fx.Orthotropic(E=(181e9, 10.3e9, 10.3e9), nu=(0.28, 0.28, 0.4), G=(7.17e9, 7.17e9, 3.0e9))
    abd = fx.Laminate("[0/30/-45]", ply, 5e-3).abd()
    a = [[1.739e9, 3.884e8, 5.663e7], [3.884e8, 4.533e8, -1.141e8], [5.663e7, -1.141e8, 4.525e8]]
    b = [[-3.129e6, 9.855e5, -1.072e6], [9.855e5, 1.158e6, -1.072e6], [-1.072e6] * 2 + [9.855e5]]
    d = [[3.343e4, 6.461e3, -5.240e3], [6.461e3, 9.320e3, -5.596e3], [-5.240e3, -5.596e3, 7.663e3]]
    for block, printed in ((abd[:3, :3], a), (abd[:3, 3:], b), (abd[3:, 3:], d)):
        assert block == pytest.approx(np.array(printed), rel=1e-3)


def test_offset_moves_the_reference_surface() -> None:
    lam = fx.Laminate("[0/45/90]", CARBON, 0.2)
    m, moved, h = lam.moments(2), lam.moments(2, 0.3), 0.3
    expected = [m[0], m[1] + h * m[0], m[2] + 2 * h * m[1] + h**2 * m[0]]
    assert moved == pytest.approx(np.array(expected), abs=ROUND_OFF * np.abs(m[0]).max())
    z = np.linspace(lam.interfaces()[0], lam.interfaces()[-1], 30001)
    z = 0.5 * (z[1:] + z[:-1])
    which = np.minimum((np.arange(len(z)) * 3) // len(z), 2)
    c = np.array([p.stiffness() for p in lam.plies])[which]
    for k in range(3):
        numeric = np.tensordot(z**k, c, axes=1) * lam.thickness / len(z)
        assert m[k] == pytest.approx(numeric, abs=1e-7 * np.abs(m[0]).max())


def test_thermal_curvature_of_a_bimetal() -> None:
    """Timoshenko 1925; with equal nu the plate bends as the strip does."""
    t1, t2 = 0.4, 0.6
    lam = fx.Laminate([fx.Ply(t1, material=STEEL), fx.Ply(t2, material=ALUMINIUM)])
    strains = np.linalg.solve(lam.abd(), lam.thermal_forces())
    m, n = t1 / t2, STEEL.E / ALUMINIUM.E
    bend = 6 * (STEEL.expansion - ALUMINIUM.expansion) * (1 + m) ** 2
    bend /= (t1 + t2) * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n)))
    # a positive curvature of the plate, k = -w,xx, stretches the top
    assert strains[3:] == pytest.approx([-bend, -bend, 0.0], rel=1e-10)
    whole = lam.thermal_moments(1)
    assert whole.shape == (2, 6)
    assert whole[0][0] == pytest.approx(
        sum(m.E * m.expansion / (1 - 2 * m.nu) * t for m, t in ((STEEL, t1), (ALUMINIUM, t2))),
        rel=ROUND_OFF,
    )


def test_shear_factors_from_equilibrium() -> None:
    """[0/90/0] of Pagano's ply against the integral done by hand: stresses in thirds."""
    lam = fx.Laminate("[0/90/0]", PAGANO, 1 / 3)
    q0, q90 = 25 / (1 - 0.25**2 / 25), 1 / (1 - 0.25**2 / 25)
    # s falls off as q (1/4 - z^2)/2 in the outer plies; inside it goes on with the softer q
    z = (np.arange(600_000) + 0.5) / 1_200_000
    outer = z > 1 / 6
    s = np.where(
        outer, q0 * (0.25 - z**2) / 2, q0 * (0.25 - 1 / 36) / 2 + q90 * (1 / 36 - z**2) / 2
    )
    g = np.where(outer, 0.5, 0.2)
    d = 2 * np.mean(np.where(outer, q0, q90) * z**2) / 2
    expected = d**2 / (np.mean(s**2 / g) * np.mean(g))
    assert lam.shear_factors()[0] == pytest.approx(expected, rel=1e-5)
    assert expected == pytest.approx(0.583, abs=1e-3)
    # however one ply is cut into several, it stays one ply
    assert fx.Laminate("[30_7]", PAGANO, 0.1).shear_factors() == pytest.approx([5 / 6] * 2)


# -- the homogeneous body --------------------------------------------------------------------------


def plane_stress(c: Array) -> Array:
    return fx.PlaneStress().reduce(c)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-90, 90), min_size=1, max_size=6))
def test_smeared_stiffness(angles: list[float]) -> None:
    lam = fx.Laminate(angles, CARBON, 0.125)
    c = lam.stiffness()
    a = lam.abd()[:3, :3] / lam.thickness
    assert plane_stress(c) == pytest.approx(a, abs=1e-10 * a.max())
    # between the averages of the compliances (Reuss) and of the stiffnesses (Voigt)
    plies = [p.stiffness() for p in lam.plies]
    voigt = np.mean(plies, axis=0)
    reuss = np.linalg.inv(np.mean([np.linalg.inv(p) for p in plies], axis=0))
    assert np.linalg.eigvalsh(voigt - c).min() > -1e-9 * voigt.max()
    assert np.linalg.eigvalsh(c - reuss).min() > -1e-9 * voigt.max()


def test_smeared_frame_density_expansion() -> None:
    one = fx.Laminate([30.0], CARBON, 0.2, frame=((0, 1, 0), (-1, 0, 0)))
    angle = np.radians(120.0)
    turned = fx.Orthotropic(
        CARBON.E,
        CARBON.nu,
        CARBON.G,
        frame=((np.cos(angle), np.sin(angle), 0), (-np.sin(angle), np.cos(angle), 0)),
    )
    expected = turned.stiffness()
    assert one.stiffness() == pytest.approx(expected, abs=ROUND_OFF * expected.max())
    light, heavy = fx.Isotropic(1.0, 0.3, density=1.0), fx.Isotropic(1.0, 0.3, density=4.0)
    mixed = [fx.Ply(2.0, material=light), fx.Ply(1.0, material=heavy)]
    assert fx.Laminate(mixed).density == pytest.approx(2.0, rel=ROUND_OFF)
    assert fx.Laminate([0], CARBON, 1.0).density is None
    same = fx.Laminate([fx.Ply(1.0, 20, STEEL), fx.Ply(2.0, -70, STEEL)])
    assert same.thermal_expansion() == pytest.approx([12e-6] * 3 + [0] * 3, abs=1e-18)


def test_stacked_cells_and_the_smeared_body() -> None:
    """Plies as cells of their own, strained in their plane and squeezed across it, against the
    homogeneous body. Forces are linear in the strains and first-order cells hold the exact solution
    (strains even in each ply), so that only round-off remains."""
    lam = fx.Laminate([fx.Ply(0.5, 30), fx.Ply(0.25, -20), fx.Ply(0.25, 90)], CARBON)
    domain = dolfinx.mesh.create_box(
        MPI.COMM_SELF, [[0, 0, 0], [2, 3, 1]], [2, 2, 4], dolfinx.mesh.CellType.hexahedron
    )
    lies = lam.interfaces(0.5)
    groups = {
        name: (3, lambda x, a=a, b=b: (x[2] > a - 1e-9) & (x[2] < b + 1e-9))
        for name, a, b in zip(lam.layers("ply"), lies, lies[1:], strict=False)
    }
    mesh = mesh_from_domain(domain, groups)
    energies = []
    for materials in (lam.layers("ply"), lam):
        continuum = Continuum(mesh, materials, fx.Solid())
        ai, aj, av = continuum.stiffness().getValuesCSR()
        k = csr_array((av, aj, ai))
        x = continuum.positions()
        u = np.zeros((len(x), 3))
        u[:, 0], u[:, 1] = 2e-3 * x[:, 0] + 3e-3 * x[:, 1], -1e-3 * x[:, 1]
        u[:, 2] = -4e-3 * x[:, 2]
        side = (np.abs(x[:, :2] - [1, 1.5]) > np.array([1, 1.5]) - 1e-9).any(axis=1)
        ends = (x[:, 2] < 1e-9) | (x[:, 2] > 1 - 1e-9)
        fixed = np.column_stack([side, side, ends]).ravel()
        free = np.flatnonzero(~fixed)
        u = u.ravel() * fixed
        u[free] = spsolve(k[free][:, free].tocsc(), -(k @ u)[free])
        energies.append(0.5 * u @ k @ u)
    strain = np.array([2e-3, -1e-3, -4e-3, 0, 0, 3e-3])
    expected = 0.5 * strain @ lam.stiffness() @ strain * 6.0
    assert energies == pytest.approx([expected, expected], rel=1e-10)
