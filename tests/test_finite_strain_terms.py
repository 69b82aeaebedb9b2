"""Finite strain: St. Venant-Kirchhoff and neo-Hookean bodies against closed forms."""

from __future__ import annotations

from bodies import (
    MODELS,
    box,
    dot,
    internal,
    newton_order,
    norm,
    place,
    solve,
    taylor_rates,
    total,
    wavy,
)

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.elastic import Elastic
from fxcrack.continuum.materials import Material
from fxcrack.continuum.neo_hookean import NeoHookeanBodies
from fxcrack.continuum.weak_form import WeakForm

E, NU = 100.0, 0.3
CARBON = fx.Orthotropic(
    E=(140.0, 10.0, 9.0), nu=(0.3, 0.25, 0.4), G=(5.0, 5.0, 3.5), frame=((1, 0.5, 0), (0, 1, 0))
)
STEPS = (2e-2, 1e-2, 5e-3)


def bodies_of(
    comm: MPI.Intracomm, model: str, material: Material, order: int, *, simplex: bool = False
) -> WeakForm:
    continuum = Continuum(box(comm, model, simplex=simplex), material, MODELS[model], order=order)
    if isinstance(material, fx.NeoHookean):
        return WeakForm(continuum, [NeoHookeanBodies(continuum)])
    return WeakForm(continuum, [Elastic(continuum, finite=True)])


CASES = [
    pytest.param(model, order, material, id=f"{model}-{order}-{type(material).__name__}",
                 marks=[pytest.mark.slow] if (model, order) == ("solid", 2) else [])
    for model in MODELS for order in (1, 2) for material in (CARBON, fx.NeoHookean(E, NU))
    if not (model == "plane stress" and isinstance(material, fx.NeoHookean))
]  # fmt: skip


@pytest.mark.quick("plane *-1-*")
@pytest.mark.parametrize(("model", "order", "material"), CASES)
def test_taylor(comm: MPI.Intracomm, model: str, order: int, material: Material) -> None:
    """Residual and tangent are first and second derivatives of the energy."""
    bodies = bodies_of(comm, model, material, order)
    n = bodies.continuum.n_local
    at, along = (wavy(bodies.continuum, s, i).x.array[:n] for i, s in enumerate((0.1, 0.3)))
    energy, residual = taylor_rates(bodies, at, along, STEPS)
    # the remainder is of order 2 + O(h)
    assert energy.min() > 1.9 and residual.min() > 1.9, (energy, residual)
    bodies.destroy()


def turn(angle: float) -> np.ndarray:
    """Rotation about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.quick("plane *")
@pytest.mark.parametrize("material", [CARBON, fx.NeoHookean(E, NU)], ids=["svk", "neo"])
@pytest.mark.parametrize("model", ["plane strain", "solid"])
def test_a_rigid_rotation_is_free_of_force(
    comm: MPI.Intracomm, model: str, material: Material
) -> None:
    bodies = bodies_of(comm, model, material, 1)
    c = bodies.continuum
    x = c.positions()[: c.n_local // c.gdim]
    u = (x @ (turn(1.0) - np.eye(3)).T)[:, : c.gdim].ravel()
    scale = norm(c, times_stiffness(bodies, u))
    # round-off of F, relative to the force of the same motion taken as a small strain
    assert norm(c, internal(bodies, u)) < 1e-14 * scale
    assert abs(total(bodies, u)) < 1e-14 * scale
    bodies.destroy()


def times_stiffness(bodies: WeakForm, u: np.ndarray) -> np.ndarray:
    matrix = bodies.continuum.stiffness()
    x, y = matrix.createVecs()
    x.array[:] = u
    matrix.mult(x, y)
    out = y.array.copy()
    for o in (matrix, x, y):
        o.destroy()
    return out


@pytest.mark.parametrize("material", [CARBON, fx.NeoHookean(E, NU)], ids=["svk", "neo"])
@pytest.mark.parametrize("model", ["plane strain", "ring"])
def test_small_displacements_are_linear(
    comm: MPI.Intracomm, model: str, material: Material
) -> None:
    bodies = bodies_of(comm, model, material, 1)
    c = bodies.continuum
    u = wavy(c, 1e-6, 0).x.array[: c.n_local]
    linear = times_stiffness(bodies, u)
    # strains of 1e-6: the next term is smaller by as much, times the number of second-order terms
    assert norm(c, internal(bodies, u) - linear) < 1e-5 * norm(c, linear)
    bodies.destroy()


def side_force(bodies: WeakForm, where: str, axis: int) -> float:
    """Sum of the internal forces on a side, at the present displacement."""
    c = bodies.continuum
    r = internal(bodies, bodies.u.x.array[: c.n_local].copy())
    return float(c.comm.allreduce(r[c.gdim * c.owned_nodes(where) + axis].sum()))


@pytest.mark.parametrize("stretch", [0.6, 1.5])
def test_uniaxial_neo_hookean(comm: MPI.Intracomm, stretch: float) -> None:
    """A solid bar pulled along x: free sides, so mu (b^2 - 1) + lambda ln J = 0 across."""
    bodies = bodies_of(comm, "solid", fx.NeoHookean(E, NU), 1)
    held = [("x0", 0), ("y0", 1), ("z0", 2), ("x1", 0)]
    norms = solve(bodies, held, values=lambda x: (stretch - 1.0) * x)
    mu, lame = E / (2 + 2 * NU), E * NU / ((1 + NU) * (1 - 2 * NU))
    low, high = 0.1, 10.0
    for _ in range(200):  # bisection for the square of the stretch across
        b2 = 0.5 * (low + high)
        if mu * (b2 - 1.0) + lame * np.log(stretch * b2) > 0.0:
            high = b2
        else:
            low = b2
    # nominal stress mu (l - 1/l) + lambda ln J / l on 1.0 x 0.8
    nominal = mu * (stretch - 1 / stretch) + lame * np.log(stretch * b2) / stretch
    # Newton stops at 1e-11 of the first residual
    assert side_force(bodies, "x1", 0) == pytest.approx(0.8 * nominal, rel=1e-9)
    density = mu / 2 * (stretch**2 + 2 * b2 - 3 - 2 * np.log(stretch * b2))
    density += lame / 2 * np.log(stretch * b2) ** 2
    assert bodies.stored()["strain_energy"] == pytest.approx(1.2 * density, rel=1e-9)
    # Cauchy stress: the force on the deformed area
    stress = bodies.stress().x.array.reshape(-1, 6)
    expected = np.tile([nominal / b2, 0, 0, 0, 0, 0], (len(stress), 1))
    assert stress == pytest.approx(expected, abs=1e-9 * abs(nominal))
    # quadratic convergence: the number of right digits doubles, until round-off
    assert newton_order(norms) > 1.7, norms
    bodies.destroy()


@pytest.mark.slow
@pytest.mark.mpi
def test_uniaxial_svk_in_plane_stress(comm: MPI.Intracomm) -> None:
    """S = E e along the bar: the nominal stress is l E (l^2 - 1)/2, the sides are free."""
    bodies = bodies_of(comm, "plane stress", fx.Isotropic(E, NU), 1)
    stretch = 1.3
    solve(bodies, [("x0", 0), ("y0", 1), ("x1", 0)], values=lambda x: (stretch - 1.0) * x[:, :2])
    expected = 2.0 * stretch * E * (stretch**2 - 1.0) / 2.0  # thickness 2, height 1
    assert side_force(bodies, "x1", 0) == pytest.approx(expected, rel=1e-9)
    bodies.destroy()


@pytest.mark.slow
@pytest.mark.mpi
def test_materials_side_by_side(comm: MPI.Intracomm) -> None:
    """Each law in its own cells: the energies add up, the names too."""
    mesh = box(comm, "plane strain")
    parts = {"left": fx.NeoHookean(E, NU), "right": fx.Isotropic(2.0 * E, NU)}
    continuum = Continuum(mesh, parts, fx.PlaneStrain())
    both = WeakForm(continuum, [Elastic(continuum, finite=True), NeoHookeanBodies(continuum)])
    u = wavy(continuum, 0.1, 1).x.array[: continuum.n_local]
    along = wavy(continuum, 0.3, 2).x.array[: continuum.n_local]
    energy, residual = taylor_rates(both, u, along, STEPS)
    assert energy.min() > 1.9 and residual.min() > 1.9
    expected = 0.0
    for term in (NeoHookeanBodies(continuum), Elastic(continuum, finite=True)):
        alone = WeakForm(continuum, [term])
        energy = total(alone, u)
        assert energy > 0.0
        expected += energy
        alone.destroy()
    assert total(both, u) == pytest.approx(expected, rel=1e-12)
    both.destroy()


@pytest.mark.slow
@pytest.mark.mpi
def test_inflated_ring(comm: MPI.Intracomm) -> None:
    """A ring that grows and lengthens uniformly: F = diag(b, l, b)."""
    bodies = bodies_of(comm, "ring", fx.NeoHookean(E, NU), 1)
    b, length = 1.2, 0.9
    c = bodies.continuum
    x = c.positions()[: c.n_local // 2]
    u = (x[:, :2] * [b - 1.0, length - 1.0]).ravel()
    mu, lame = E / (2 + 2 * NU), E * NU / ((1 + NU) * (1 - 2 * NU))
    j = b**2 * length
    density = mu / 2 * (2 * b**2 + length**2 - 3 - 2 * np.log(j)) + lame / 2 * np.log(j) ** 2
    volume = np.pi * (2.5**2 - 1.0**2)
    assert total(bodies, u) == pytest.approx(volume * density, rel=1e-12)
    # the axial force is the change of energy per change of height
    p_axial = mu * (length - 1 / length) + lame * np.log(j) / length
    assert side_force(bodies, "y1", 1) == pytest.approx(volume * p_axial, rel=1e-12)
    bodies.destroy()


@pytest.mark.mpi
def test_plane_stress_is_refused(comm: MPI.Intracomm) -> None:
    with pytest.raises(InputError, match="thickness stretch"):
        bodies_of(comm, "plane stress", fx.NeoHookean(E, NU), 1)
    with pytest.raises(InputError, match=r"NeoHookean: nu = 0\.5"):
        fx.NeoHookean(E, 0.5)


@pytest.mark.three
@pytest.mark.mpi
def test_forces_do_not_depend_on_the_number_of_ranks(comm: MPI.Intracomm) -> None:
    """The bodies on all ranks and on this rank alone."""
    results = []
    for c in (comm, MPI.COMM_SELF):
        bodies = bodies_of(c, "plane strain", fx.NeoHookean(E, NU), 2)
        u = wavy(bodies.continuum, 0.1, 5).x.array[: bodies.continuum.n_local]
        w = wavy(bodies.continuum, 1.0, 6).x.array[: bodies.continuum.n_local]
        results.append([total(bodies, u), dot(bodies.continuum, internal(bodies, u), w)])
        place(bodies, u)
        bodies.destroy()
    assert results[0] == pytest.approx(results[1], rel=1e-12)  # sums in another order


@pytest.mark.quick("plane stress")
@pytest.mark.parametrize("model", MODELS)
def test_stress_is_that_of_small_strain_when_small(comm: MPI.Intracomm, model: str) -> None:
    for material in (CARBON, fx.NeoHookean(E, NU)):
        if model == "plane stress" and isinstance(material, fx.NeoHookean):
            continue
        bodies = bodies_of(comm, model, material, 1)
        u = wavy(bodies.continuum, 1e-6, 3)
        place(bodies, u.x.array[: bodies.continuum.n_local])
        small = bodies.continuum.stress(u).x.array
        # strains and rotations of 1e-6, times stiffnesses of up to 140 that are not alike
        assert np.abs(bodies.stress().x.array - small).max() < 1e-4 * np.abs(small).max()
        bodies.destroy()


def test_stress_turns_with_the_body(comm: MPI.Intracomm) -> None:
    """Stretch and rotation: the second Piola-Kirchhoff stress of the stretch, turned."""
    bodies = bodies_of(comm, "solid", fx.Isotropic(E, NU), 1)
    c = bodies.continuum
    q, stretch = turn(0.7), np.diag([1.2, 0.9, 1.1])
    x = c.positions()[: c.n_local // 3]
    place(bodies, (x @ (q @ stretch - np.eye(3)).T).ravel())
    strain = np.append(0.5 * (np.diag(stretch) ** 2 - 1.0), [0.0, 0.0, 0.0])
    second = np.diag((fx.Isotropic(E, NU).stiffness() @ strain)[:3])
    cauchy = q @ stretch @ second @ stretch @ q.T / np.linalg.det(stretch)
    expected = cauchy[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    stress = bodies.stress().x.array.reshape(-1, 6)
    assert stress == pytest.approx(np.tile(expected, (len(stress), 1)), abs=1e-12 * E)
    bodies.destroy()
