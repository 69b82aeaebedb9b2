"""Generalised plane strain against laminate theory, closed forms and slices in three dimensions.

Strips whose ends stay plane are even along their length, so that elements of the order of their
displacement are exact: what is left is round-off, here below 1e-9 of strains of order 1e-3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import dolfinx.mesh
import numpy as np
import pytest
from mpi4py import MPI
from specimens import dcb

import fxcrack as fx
from fxcrack.mesh.domain import mesh_from_domain
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.meshes.laminate import laminate_2d

WORLD = MPI.COMM_WORLD
CFRP = fx.Orthotropic(
    E=(139.4e3, 10.16e3, 10.16e3), nu=(0.3, 0.3, 0.436), G=(4.6e3, 4.6e3, 3.54e3),
    expansion=(-0.5e-6, 28e-6, 28e-6),
)  # fmt: skip
STEEL = fx.Isotropic(E=210e3, nu=0.3, expansion=1.2e-5)
FREE = fx.GeneralisedPlaneStrain(thickness=2.0)
ENDS = ("end_upper", "end_lower", "far_upper", "far_lower")
STRAIN, LENGTH = 1e-3, 10.0
EXACT = 1e-9


def laminate(notation: str) -> fx.Laminate:
    return fx.Laminate(notation, CFRP, 0.25, frame=("x", -90.0))


def strip(
    lay_up: fx.Laminate,
    model: Any = FREE,
    *,
    strain: float = STRAIN,
    held: bool = True,
    comm: MPI.Intracomm = WORLD,
    order: int = 1,
    **scene: Any,
) -> tuple[fx.History, float]:
    """A strip stretched along x, its ends held along z or not; mean stress along x at the end."""
    n = len(lay_up.plies)
    mesh = laminate_2d(comm, plies=lay_up.thicknesses, crack=n // 2, length=LENGTH, dx=2.0,
                       order=order)  # fmt: skip
    across = {"z": 0.0} if held else {}
    ends = [
        fx.Displacement(name, x=strain * LENGTH if "far" in name else 0.0, **across)
        for name in ENDS
    ]
    made = fx.Scene(
        mesh,
        materials=lay_up.layers("ply"),
        model=model,
        supports=[*ends, fx.Displacement("pin_bottom", y=0.0, z=0.0)],
        bonds=[fx.Interface("upper_face", "lower_face", name="bond")],
        **scene,
    )
    history = made.run(fx.Static(until=fx.Time(1.0)), grow=[], progress=False)
    made.close()
    force = sum(history.rows[-1][f"R[{name}.x]"] for name in ENDS if "far" in name)
    return history, force / (lay_up.thickness * model.thickness)


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("solver", ["linear", "newton"])
def test_a_45_degree_ply_is_as_compliant_as_the_turned_ply(solver: str):
    history, stress = strip(laminate("[45]_2"), held=False, solver=solver)
    c, s = np.cos(np.pi / 4), np.sin(np.pi / 4)
    e1, e2, g12, nu12 = CFRP.E[0], CFRP.E[1], CFRP.G[0], CFRP.nu[0]
    shear = 1.0 / g12 - 2.0 * nu12 / e1
    s11 = c**4 / e1 + shear * c**2 * s**2 + s**4 / e2
    s12 = (1.0 / e1 + 1.0 / e2 - 1.0 / g12) * c**2 * s**2 - nu12 / e1 * (c**4 + s**4)
    assert stress * s11 / STRAIN == pytest.approx(1.0, abs=EXACT)
    row = history.rows[-1]
    assert row["strain_zz"] == pytest.approx(STRAIN * s12 / s11, rel=EXACT)
    assert row["force_zz"] == 0.0
    assert abs(row["balance"]) < 1e-10 * row["external_work"]


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize(("notation", "order"), [("[0/90]s", 1), ("[0/45/-45/90]s", 2)])
def test_symmetric_laminates_in_tension_follow_laminate_theory(notation: str, order: int):
    lay_up = laminate(notation)
    history, stress = strip(lay_up, order=order)
    soft = np.linalg.inv(lay_up.abd()[:3, :3])
    assert stress * soft[0, 0] * lay_up.thickness / STRAIN == pytest.approx(1.0, abs=EXACT)
    found = history.rows[-1]["strain_zz"]
    assert found == pytest.approx(STRAIN * soft[0, 1] / soft[0, 0], rel=EXACT)


def test_a_smeared_laminate_stretches_as_its_membrane():
    lay_up = laminate("[0/45/-45/90]s")
    whole = fx.Laminate([fx.Ply(0.25, a, CFRP) for a in lay_up.angles], frame=("x", -90.0))
    mesh = dcb_2d(MPI.COMM_SELF, length=LENGTH, dx=2.0, ny=1)
    scene = fx.Scene(
        mesh,
        materials=whole,
        model=FREE,
        supports=[
            *(fx.Displacement(k, x=0.01 if "far" in k else 0.0, z=0.0) for k in ENDS),
            fx.Displacement("pin_bottom", y=0.0),
        ],
        bonds=[fx.Interface("upper_face", "lower_face", name="bond")],
    )
    row = scene.run(fx.Static(until=fx.Time(1.0)), grow=[], progress=False).rows[-1]
    soft = np.linalg.inv(lay_up.abd()[:3, :3]) * lay_up.thickness
    stress = sum(row[f"R[{k}.x]"] for k in ENDS if "far" in k) / (3.0 * FREE.thickness)
    assert stress * soft[0, 0] / STRAIN == pytest.approx(1.0, abs=EXACT)
    assert row["strain_zz"] == pytest.approx(STRAIN * soft[0, 1] / soft[0, 0], rel=EXACT)


def test_plane_strain_is_a_prescribed_strain_of_zero():
    _, flat = strip(laminate("[0]_2"), fx.GeneralisedPlaneStrain(2.0, strain_zz=0.0))
    c = CFRP.stiffness()
    keep = np.linalg.inv(c[np.ix_([0, 1], [0, 1])])  # e_zz = 0, s_yy = 0
    # axes of the mesh: the ply lies in x-z
    assert flat * keep[0, 0] / STRAIN == pytest.approx(1.0, abs=EXACT)


def test_a_prescribed_strain_has_a_resultant_and_a_prescribed_resultant_a_strain():
    area = 4 * 0.25 * LENGTH
    steel = fx.Laminate([0.0] * 4, STEEL, 0.25)
    pull = fx.GeneralisedPlaneStrain(3.0, strain_zz=2e-3)
    history, stress = strip(steel, pull, strain=0.0, held=False)
    # held along x, free along y: s_zz = E/(1 - nu^2) e_zz
    wanted = STEEL.E / (1.0 - STEEL.nu**2) * 2e-3
    row = history.rows[-1]
    assert row["strain_zz"] == pytest.approx(2e-3, rel=1e-12)
    assert row["force_zz"] == pytest.approx(wanted * area, rel=EXACT)
    assert stress == pytest.approx(STEEL.nu * wanted, rel=EXACT)
    assert row["external_work"] == pytest.approx(0.5 * wanted * 2e-3 * area * 3.0, rel=EXACT)
    back, _ = strip(
        steel, fx.GeneralisedPlaneStrain(3.0, force_zz=wanted * area), strain=0.0, held=False
    )
    assert back.rows[-1]["strain_zz"] == pytest.approx(2e-3, rel=EXACT)
    assert back.rows[-1]["force_zz"] == pytest.approx(wanted * area, rel=1e-12)
    assert back.rows[-1]["external_work"] == pytest.approx(row["external_work"], rel=EXACT)


# -- temperature -----------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize("solver", ["linear", "newton"])
def test_curing_strains_of_a_cross_ply_follow_laminate_theory(solver: str):
    lay_up = laminate("[0/90]")
    heat = fx.Temperature(value=-100.0)
    model = fx.GeneralisedPlaneStrain(2.0, curvature_y=None)
    history, stress = strip(lay_up, model, strain=0.0, order=2, effects=[heat], solver=solver)
    # e_x = kappa_x = 0, as the ends stay plane and upright; along z nothing acts
    abd, thermal = lay_up.abd(), lay_up.thermal_forces()
    free = [1, 4]
    middle = np.linalg.solve(abd[np.ix_(free, free)], -100.0 * thermal[free])
    row = history.rows[-1]
    # z of the laminate runs from its middle, y = 0 of the mesh lies between the plies
    assert row["curvature_y"] == pytest.approx(middle[1], rel=1e-7)
    assert row["strain_zz"] == pytest.approx(middle[0], rel=1e-7)
    along = abd[0, free] @ middle + 100.0 * thermal[0]
    assert stress == pytest.approx(along / lay_up.thickness, rel=1e-7)
    assert row["moment_y"] == 0.0
    assert abs(row["balance"]) < 1e-9 * row["strain_energy"]


def test_a_free_bar_under_a_temperature_has_no_stress():
    mesh = dcb_2d(MPI.COMM_SELF, length=20.0, dx=4.0, ny=1)
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=FREE,
        supports=[
            fx.Displacement("pin_bottom", x=0.0, y=0.0, z=0.0),
            fx.Displacement("pin_top", x=0.0),
        ],
        bonds=[fx.Interface("upper_face", "lower_face")],
        effects=[fx.Temperature(value=50.0)],
    )
    row = scene.run(fx.Static(until=fx.Time(1.0)), grow=[], progress=False).rows[-1]
    assert row["strain_zz"] == pytest.approx(1.2e-5 * 50.0, rel=EXACT)
    assert row["strain_energy"] < 1e-9 * STEEL.E * row["strain_zz"] ** 2 * 20.0 * 2.0
    # 24 nodes; the strain is one unknown
    assert scene.explain().unknowns["displacements"] == 3 * 24 + 1


# -- cracks ----------------------------------------------------------------------------------------


def tear(comm: MPI.Intracomm, order: int = 1) -> fx.Scene:
    """A long strip whose outer edges slide against each other along z: mode III alone."""
    mesh = dcb_2d(comm, length=40.0, dx=0.25, ny=6, order=order)
    bond = fx.Interface("upper_face", "lower_face", bonded=lambda x: x[0] >= 20.0 - 1e-9,
                        name="bond")  # fmt: skip
    return fx.Scene(
        mesh,
        materials=STEEL,
        model=FREE,
        supports=[
            fx.Displacement("top", x=0.0, y=0.0, z=1e-3),
            fx.Displacement("bottom", x=0.0, y=0.0, z=-1e-3),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1.0))],
    )


@pytest.mark.mpi
@pytest.mark.three
def test_a_sheared_strip_tears_in_mode_three():
    # G = mu w^2/h of a long strip of half height h whose edges move by +-w (Rice 1968). Far from
    # its ends growth by an element turns a slice ahead into one behind, so that G is exact on any
    # even mesh
    scene = tear(WORLD)
    history = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    row = history.rows[-1]
    wanted = 210e3 / 2.6 * 1e-6 / 1.5
    assert row["GIII[bond]"] == pytest.approx(wanted, rel=1e-8)
    assert abs(row["GI[bond]"]) + abs(row["GII[bond]"]) < 1e-9 * wanted


def arms(model: Any, comm: MPI.Intracomm = WORLD, **options: Any) -> fx.Scene:
    """A double cantilever beam of the bench, its far end held along z where that is possible."""
    section = isinstance(model, fx.GeneralisedPlaneStrain)
    ends = [fx.Displacement(name, z=0.0) for name in ("far_upper", "far_lower")]
    return dcb(
        comm,
        dx=1.0,
        ny=2,
        model=model,
        supports=[
            fx.Displacement("pin_top", x=0.0, y=1.0),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0),
            *(ends if section else []),
        ],
        **options,
    )


def test_an_isotropic_arm_lies_between_plane_stress_and_plane_strain():
    found = {}
    for model in (fx.PlaneStress(), fx.PlaneStrain(), fx.GeneralisedPlaneStrain()):
        across = {"z": 0.0} if isinstance(model, fx.GeneralisedPlaneStrain) else {}
        scene = dcb(
            MPI.COMM_SELF,
            dx=1.0,
            ny=2,
            model=model,
            supports=[
                fx.Displacement("pin_top", x=0.0, y=1.0),
                fx.Displacement("bottom", x=0.0, y=0.0, **across),
            ],
        )
        history = scene.run(fx.Static(until=fx.Time(0.02)), grow=[], progress=False)
        found[type(model).__name__] = history.rows[-1]["R[pin_top.y]"]
    soft, stiff = found["PlaneStress"], found["PlaneStrain"]
    assert soft < found["GeneralisedPlaneStrain"] < stiff * (1.0 - 1e-6)


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize(
    ("release", "step"),
    [
        (fx.StepRelease(), {}),
        (fx.ProgressiveRelease(), {"stepping": "path"}),
        (fx.RampRelease(), {"stepping": "increment"}),
    ],
)
def test_a_crack_between_off_axis_plies_grows_with_all_modes(release: Any, step: dict[str, Any]):
    plies = {"upper": fx.Laminate([30.0], CFRP, 1.0, frame=("x", -90.0)),
             "lower": fx.Laminate([-30.0], CFRP, 1.0, frame=("x", -90.0))}  # fmt: skip
    scene = arms(FREE, materials=plies, release=release, order=1)
    end = 32.0
    (debond,) = scene.debonds
    history = scene.run(
        fx.Static(until=fx.CrackLength(debond.interface, end), **step), progress=False
    )
    row = history.rows[-1]
    assert row["a[bond]"] >= end
    assert row["force_zz"] == 0.0
    assert abs(row["balance"]) < 1e-8 * row["external_work"]
    if step.get("stepping") == "increment":
        return  # f = 1 lies within an increment
    onset = history.at("a[bond]", 30.0, event="onset")
    rates = [onset[f"{mode}[bond]"] for mode in ("GI", "GII", "GIII")]
    # arms of opposite angles shear against each other along z as they bend
    assert sum(rates) == pytest.approx(0.2, rel=1e-6)
    assert rates[2] > 5e-4 * sum(rates)


def test_rates_of_a_crack_are_the_energy_its_growth_sets_free():
    plies = {"upper": fx.Laminate([30.0], CFRP, 1.0, frame=("x", -90.0)),
             "lower": fx.Laminate([-30.0], CFRP, 1.0, frame=("x", -90.0))}  # fmt: skip
    criterion = fx.VCCT(GIc=1e9, method="closure")
    energies, rates = [], []
    for a0 in (30.0, 31.0):
        scene = arms(FREE, MPI.COMM_SELF, materials=plies, criterion=criterion, a0=a0)
        row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False).rows[-1]
        energies.append(row["strain_energy"])
        rates.append(sum(row[f"{mode}[bond]"] for mode in ("GI", "GII", "GIII")))
    # exact closure is the energy that one element sets free at fixed displacements
    freed = (energies[0] - energies[1]) / (1.0 * FREE.thickness)
    assert rates[0] == pytest.approx(freed, rel=1e-7)


# -- a slice in three dimensions -------------------------------------------------------------------


def block(dim: int, order: int) -> fx.Mesh:
    n = [6, 3, 1][:dim]
    corner = [6.0, 1.5, 0.5][:dim]
    if dim == 2:
        domain = dolfinx.mesh.create_rectangle(
            MPI.COMM_SELF, [[0.0, 0.0], corner], n, dolfinx.mesh.CellType.quadrilateral
        )
    else:
        domain = dolfinx.mesh.create_box(
            MPI.COMM_SELF,
            [[0.0, 0.0, -0.25], [6.0, 1.5, 0.25]],
            n,
            dolfinx.mesh.CellType.hexahedron,
        )
    groups: dict[str, tuple[int, Callable[[Any], Any]]] = {
        "left": (dim - 1, lambda x: np.isclose(x[0], 0.0)),
        "top": (dim - 1, lambda x: np.isclose(x[1], 1.5)),
    }
    if dim == 3:
        # the left face follows by its supports; only the rest of the sides is tied
        groups["front"] = (0, lambda x: (x[2] > 0.0) & (x[0] > 0.1))
        groups["back"] = (0, lambda x: (x[2] < 0.0) & (x[0] > 0.1))
        groups["left_back"] = (0, lambda x: np.isclose(x[0], 0.0) & (x[2] < 0.0))
        groups["left_front"] = (0, lambda x: np.isclose(x[0], 0.0) & (x[2] > 0.0))
    return mesh_from_domain(domain, groups)


def test_a_slice_of_one_cell_with_tied_sides_is_the_same():
    ply = fx.Laminate([30.0], CFRP, 1.0, frame=("x", -90.0))
    load = fx.Traction("top", (1.0, 2.0, 0.5))
    plane = fx.Scene(
        block(2, 1),
        materials=ply,
        model=fx.GeneralisedPlaneStrain(0.5),
        supports=[fx.Displacement("left", x=0.0, y=0.0, z=0.0)],
        loads=[load],
    )
    one = plane.run(fx.Static(until=fx.Time(1.0)), progress=False).rows[-1]
    elongation = 0.5 * one["strain_zz"]
    assert abs(elongation) > 1e-6
    ties = [fx.Equation((("front", c, 1.0), ("back", c, -1.0))) for c in "xy"]
    solid = fx.Scene(
        block(3, 1),
        materials=ply,
        model=fx.Solid(),
        supports=[
            fx.Displacement("left_back", x=0.0, y=0.0, z=-0.5 * elongation),
            fx.Displacement("left_front", x=0.0, y=0.0, z=0.5 * elongation),
            *ties,
            fx.Equation((("front", "z", 1.0), ("back", "z", -1.0)), value=elongation, name="pull"),
        ],
        loads=[load],
    )
    two = solid.run(fx.Static(until=fx.Time(1.0)), progress=False).rows[-1]
    assert two["v[top]"] == pytest.approx(one["v[top]"], rel=1e-9)
    assert two["strain_energy"] == pytest.approx(one["strain_energy"], rel=1e-9)
    # the strain that was found here is the one at which nothing pulls along z
    pull = two["R[pull.value]"] + 0.5 * (two["R[left_front.z]"] - two["R[left_back.z]"])
    stiff = ply.stiffness()[2, 2] * abs(one["strain_zz"]) * 6.0 * 1.5
    assert abs(pull) < 1e-8 * stiff


# -- closed forms of other bodies ------------------------------------------------------------------


def test_a_thick_cylinder_with_free_ends_is_that_of_lame():
    a, b, n, pressure = 1.0, 2.0, 12, 10.0
    domain = dolfinx.mesh.create_rectangle(
        MPI.COMM_SELF, [[a, 0.0], [b, np.pi / 2]], [n, n], dolfinx.mesh.CellType.quadrilateral
    )
    r, angle = domain.geometry.x[:, 0].copy(), domain.geometry.x[:, 1].copy()
    domain.geometry.x[:, 0], domain.geometry.x[:, 1] = r * np.cos(angle), r * np.sin(angle)
    mesh = mesh_from_domain(
        domain,
        {
            "x_axis": (1, lambda x: np.isclose(x[1], 0.0)),
            "y_axis": (1, lambda x: np.isclose(x[0], 0.0)),
            "bore": (1, lambda x: np.isclose(np.hypot(x[0], x[1]), a)),
        },
    )
    scene = fx.Scene(
        mesh,
        materials=STEEL,
        model=FREE,
        supports=[fx.Displacement("x_axis", y=0.0, z=0.0), fx.Displacement("y_axis", x=0.0)],
        loads=[fx.Pressure("bore", pressure)],
        monitors=[fx.Monitor("bore", (0.0, 0.0, 1.0), name="along")],
    )
    row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False).rows[-1]
    # s_r + s_theta = 2 p a^2/(b^2 - a^2) everywhere. The mean of the in-plane stresses follows from
    # the loads alone, on any mesh, and the chords of bore and rim change both areas alike
    wanted = -STEEL.nu / STEEL.E * 2.0 * pressure * a**2 / (b**2 - a**2)
    assert row["strain_zz"] == pytest.approx(wanted, rel=1e-8)
    assert abs(row["m[along]"]) < 1e-9 * abs(wanted)


def test_a_yielding_bar_pulled_along_its_section_follows_its_curve():
    law = fx.Plastic(E=200e3, nu=0.3, yield_stress=200.0, hardening=2000.0)
    mesh = dcb_2d(MPI.COMM_SELF, length=4.0, dx=2.0, ny=1)
    scene = fx.Scene(
        mesh,
        materials=law,
        model=fx.GeneralisedPlaneStrain(strain_zz=0.004),
        supports=[
            fx.Displacement("pin_bottom", x=0.0, y=0.0, z=0.0),
            fx.Displacement("pin_top", x=0.0),
        ],
        bonds=[fx.Interface("upper_face", "lower_face")],
    )
    step = fx.Static(until=fx.Time(1.0), stepping="increment", initial=0.25, maximum=0.25)
    row = scene.run(step, grow=[], progress=False).rows[-1]
    # uniaxial stress: e = s/E + (s - s_y)/H
    wanted = (0.004 + 200.0 / 2000.0) / (1.0 / 200e3 + 1.0 / 2000.0)
    assert row["force_zz"] == pytest.approx(wanted * 4.0 * 3.0, rel=1e-6)


def test_a_prescribed_curvature_has_the_moment_of_a_beam():
    steel = fx.Laminate([0.0] * 2, STEEL, 0.5)
    model = fx.GeneralisedPlaneStrain(3.0, curvature_y=1e-3)
    history, stress = strip(steel, model, strain=0.0, held=False, order=2)
    row = history.rows[-1]
    inertia = LENGTH * 1.0**3 / 12.0
    # ends upright: no curvature along x
    wanted = STEEL.E / (1.0 - STEEL.nu**2) * inertia * 1e-3
    assert row["moment_y"] == pytest.approx(wanted, rel=EXACT)
    assert abs(row["strain_zz"]) < 1e-12
    assert abs(stress) < 1e-9 * STEEL.E * 1e-3


# -- with other capabilities -----------------------------------------------------------------------


def test_units_do_not_matter():
    lay_up = laminate("[45/0]")
    fine, one = strip(lay_up, strain=STRAIN)
    metre = fx.Orthotropic(
        E=tuple(1e6 * e for e in CFRP.E), nu=CFRP.nu, G=tuple(1e6 * g for g in CFRP.G)
    )
    mesh = laminate_2d(MPI.COMM_SELF, plies=(0.25e-3, 0.25e-3), crack=1, length=0.01, dx=2e-3)
    scene = fx.Scene(
        mesh,
        materials=fx.Laminate("[45/0]", metre, 0.25e-3, frame=("x", -90.0)).layers("ply"),
        model=fx.GeneralisedPlaneStrain(2e-3),
        supports=[
            *(fx.Displacement(k, x=1e-5 if "far" in k else 0.0, z=0.0) for k in ENDS),
            fx.Displacement("pin_bottom", y=0.0, z=0.0),
        ],
        bonds=[fx.Interface("upper_face", "lower_face", name="bond")],
    )
    row = scene.run(fx.Static(until=fx.Time(1.0)), grow=[], progress=False).rows[-1]
    assert row["strain_zz"] == pytest.approx(fine.rows[-1]["strain_zz"], rel=1e-9)
    force = sum(row[f"R[{k}.x]"] for k in ENDS if "far" in k)
    assert force / (0.5e-3 * 2e-3) == pytest.approx(1e6 * one, rel=1e-9)


def test_slow_motion_is_the_equilibrium():
    lay_up = laminate("[45]_2")
    mesh = laminate_2d(MPI.COMM_SELF, plies=lay_up.thicknesses, crack=1, length=LENGTH, dx=2.0)
    scene = fx.Scene(
        mesh,
        materials=lay_up.layers("ply"),
        model=FREE,
        supports=[
            *(fx.Displacement(k, x=0.01 if "far" in k else 0.0, z=0.0,
                              amplitude=fx.SmoothStep((0.0, 1.0), (0.0, 1.0))) for k in ENDS),
            fx.Displacement("pin_bottom", y=0.0),
        ],
        bonds=[fx.Interface("upper_face", "lower_face", name="bond")],
        effects=[fx.Inertia(density=1.6e-9)],
    )  # fmt: skip
    row = scene.run(fx.Dynamic(until=fx.Time(1.0), dt=0.1), grow=[], progress=False).rows[-1]
    still, _ = strip(lay_up)
    # waves cross the strip 1e5 times
    assert row["strain_zz"] == pytest.approx(still.rows[-1]["strain_zz"], rel=1e-6)
    assert abs(row["balance"]) < 1e-8 * row["external_work"]


@pytest.mark.mpi
@pytest.mark.three
def test_a_run_goes_on_where_it_was_stopped(shared_path: Any):
    def stop(event: str, row: Any) -> None:
        if event == "onset" and row["a[bond]"] > 31.5:
            raise KeyError("stop here")

    whole = grown(None)
    file = fx.Checkpoint(shared_path / "run.npz", every=1)
    with pytest.raises(KeyError):
        grown(file, observers=[stop])
    again = grown(file, restart=True)
    assert len(again.rows) == len(whole.rows)
    for name in ("time", "strain_zz", "R[pin_top.y]", "GIII[bond]"):
        assert again.rows[-1][name] == pytest.approx(whole.rows[-1][name], rel=1e-9)


def grown(file: Any, **more: Any) -> fx.History:
    plies = {"upper": fx.Laminate([30.0], CFRP, 1.0, frame=("x", -90.0)),
             "lower": fx.Laminate([-30.0], CFRP, 1.0, frame=("x", -90.0))}  # fmt: skip
    scene = arms(FREE, materials=plies)
    (debond,) = scene.debonds
    step = fx.Static(until=fx.CrackLength(debond.interface, 33.0))
    return scene.run(step, checkpoint=file, progress=False, **more)


def test_fields_hold_six_stresses(tmp_path: Any):
    scene = tear(MPI.COMM_SELF)
    scene.run(fx.Static(until=fx.Time(1.0)), progress=False)
    fx.write_fields(scene, tmp_path / "fields.pvd")
    assert (tmp_path / "fields.pvd").exists()


# -- what is refused -------------------------------------------------------------------------------


def test_what_is_not_possible_is_said():
    mesh = dcb_2d(MPI.COMM_SELF, length=10.0, dx=5.0, ny=1)
    bonds = [fx.Interface("upper_face", "lower_face")]
    held = [fx.Clamp("far_lower")]

    def made(**values: Any) -> fx.Scene:
        given = {"materials": STEEL, "model": FREE, "supports": held, "bonds": bonds} | values
        return fx.Scene(mesh, **given)

    with pytest.raises(fx.InputError, match="small strain"):
        made(effects=[fx.FiniteStrain()])
    with pytest.raises(fx.InputError, match="iterative"):
        made(options=fx.CondensedOptions(method="iterative"))
    moving = made(effects=[fx.Inertia(density=1e-9)])
    with pytest.raises(fx.InputError, match="has no mass"):
        moving.run(fx.Explicit(until=fx.Time(1e-6)), grow=[], progress=False)
    loose = made(supports=[fx.Displacement("far_lower", x=0.0, y=0.0)])
    with pytest.raises(fx.FxcrackError, match="free to move along z"):
        loose.run(fx.Static(until=fx.Time(1.0)), grow=[], progress=False)
    with pytest.raises(fx.InputError, match="GeneralisedPlaneStrain"):
        fx.write_deck(loose, [fx.Static(until=fx.Time(1.0))], "never.inp")
    with pytest.raises(fx.InputError, match="force_zz"):
        fx.GeneralisedPlaneStrain(strain_zz=0.1, force_zz=1.0)
    with pytest.raises(fx.InputError, match="thickness"):
        fx.GeneralisedPlaneStrain(thickness=0.0)
    with pytest.raises(fx.InputError, match="amplitude"):
        fx.GeneralisedPlaneStrain(amplitude=2.0)  # type: ignore[arg-type]
