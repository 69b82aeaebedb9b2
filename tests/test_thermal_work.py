"""Thermal strain against closed forms, as loads of the linear path and as terms."""

from __future__ import annotations

from bodies import (
    MODELS,
    box,
    dot,
    internal,
    newton_order,
    norm,
    solve,
    taylor_rates,
    wavy,
)

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import dolfinx.fem
import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.continuum import thermal_strain as thermal
from fxcrack.continuum.amplitudes import constant
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.elastic import Elastic
from fxcrack.continuum.load_vectors import load_vector
from fxcrack.continuum.materials import Material
from fxcrack.continuum.neo_hookean import NeoHookeanBodies
from fxcrack.continuum.stress import cell_stress
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.mesh.mesh import Group

Array = npt.NDArray[np.float64]

E, NU, A = 100.0, 0.3, 1e-3
STEEL = fx.Isotropic(E, NU, expansion=A)
CARBON = fx.Orthotropic(
    E=(140.0, 10.0, 9.0),
    nu=(0.3, 0.25, 0.4),
    G=(5.0, 5.0, 3.5),
    frame=((1.0, 0.5, 0.3), (0.0, 1.0, 0.0)),
    expansion=(-1e-4, 2e-3, 3e-3),
)
HELD = {  # no more than the rigid motions
    "plane stress": [("x0", 0), ("y0", 1)],
    "ring": [("y0", 1)],
    "solid": [("x0", 0), ("y0", 1), ("z0", 2)],
}


def heated(
    comm: MPI.Intracomm,
    model: str,
    material: Material,
    temperature: fx.Temperature,
    order: int = 1,
) -> Continuum:
    return Continuum(
        box(comm, model), material, MODELS[model], order=order, temperature=temperature
    )


KINDS = ["linear", "finite", "neo"]


def made(continuum: Continuum, kind: str) -> WeakForm:
    if kind == "neo":
        return WeakForm(continuum, [NeoHookeanBodies(continuum)])
    return WeakForm(continuum, [Elastic(continuum, finite=kind == "finite")])


@pytest.mark.quick("plane stress-*")
@pytest.mark.parametrize(
    ("model", "kind"), [(m, k) for m in HELD for k in KINDS if (m, k) != ("plane stress", "neo")]
)
def test_free_expansion_is_free_of_stress(comm: MPI.Intracomm, model: str, kind: str) -> None:
    material = fx.NeoHookean(E, NU, expansion=A) if kind == "neo" else STEEL
    continuum = heated(comm, model, material, fx.Temperature(120.0, reference=20.0))
    bodies = made(continuum, kind)
    bodies.begin(1.0, 1.0)
    solve(bodies, HELD[model])
    d = continuum.gdim
    x = continuum.positions()[: continuum.n_local // d, :d]
    free = (A * 100.0 * x).ravel()
    # Newton stops at 1e-11 of the first residual
    assert bodies.u.x.array[: continuum.n_local] == pytest.approx(free, abs=1e-12)
    # the square of the stress that is left
    assert abs(bodies.stored()["strain_energy"]) < 1e-14 * E * 50.0
    if kind == "linear":
        assert np.abs(cell_stress(continuum, bodies.u).x.array).max() < 1e-13 * E
    bodies.destroy()


@pytest.mark.quick("plane stress")
@pytest.mark.parametrize("model", ["plane stress", "solid"])
def test_a_linear_temperature_is_free_of_stress_in_second_order_bodies(
    comm: MPI.Intracomm, model: str
) -> None:
    """A temperature linear in x bends the block; strains are compatible, stress is zero."""
    field = fx.Temperature(lambda x: 50.0 * x[0] - 20.0 * x[1])
    continuum = heated(comm, model, STEEL, field, order=2)
    bodies = made(continuum, "linear")
    bodies.begin(1.0, 1.0)
    held = [("x0", i) for i in range(continuum.gdim)]

    # u = A int T: u_x = A (25 x^2 - 20 x y) + ..., the compatible quadratic displacement
    def exact(x: Array) -> Array:
        x1, x2, x3 = x.T
        g, h = A * 50.0, -A * 20.0
        u = g * (x1**2 - x2**2 - x3**2) / 2 + h * x1 * x2
        v = g * x1 * x2 + h * (x2**2 - x1**2 - x3**2) / 2
        w = g * x1 * x3 + h * x2 * x3
        out = np.stack([u, v, w], axis=1)
        if continuum.gdim == 2:
            out = out[:, :2]
        return out

    solve(bodies, held, values=exact)
    assert np.abs(cell_stress(continuum, bodies.u).x.array).max() < 1e-12 * E
    bodies.destroy()


def test_clamped_stress(comm: MPI.Intracomm) -> None:
    """No displacement at all: -E A T/(1 - 2 nu) in the solid, over (1 - nu) in the sheet."""
    for model, factor in (
        ("solid", 1.0 / (1.0 - 2.0 * NU)),
        ("plane strain", 1.0 / (1.0 - 2.0 * NU)),
        ("plane stress", 1.0 / (1.0 - NU)),
        ("ring", 1.0 / (1.0 - 2.0 * NU)),
    ):
        continuum = heated(comm, model, STEEL, fx.Temperature(30.0))
        continuum.temperature.set(0.5)
        zero = dolfinx.fem.Function(continuum.space)
        stress = cell_stress(continuum, zero).x.array.reshape(
            -1, len(continuum.model.stress_labels)
        )
        expected = np.zeros(stress.shape[1])
        expected[:3] = -E * A * 15.0 * factor
        if model == "plane stress":
            expected[2] = 0.0
        assert stress == pytest.approx(np.tile(expected, (len(stress), 1)), abs=1e-13 * E)


@pytest.mark.slow
def test_plane_strain_out_of_plane(comm: MPI.Intracomm) -> None:
    """Free in the plane, held across: strain (1 + nu) A T in the plane, stress -E A T across."""
    continuum = heated(comm, "plane strain", STEEL, fx.Temperature(40.0))
    bodies = made(continuum, "linear")
    bodies.begin(1.0, 1.0)
    solve(bodies, HELD["plane stress"])
    x = continuum.positions()[: continuum.n_local // 2, :2]
    u = bodies.u.x.array[: continuum.n_local].reshape(-1, 2)
    assert u == pytest.approx((1 + NU) * A * 40.0 * x, abs=1e-13)
    stress = cell_stress(continuum, bodies.u).x.array.reshape(-1, 4)
    expected = np.tile([0.0, 0.0, -E * A * 40.0, 0.0], (len(stress), 1))
    assert stress == pytest.approx(expected, abs=1e-13 * E)
    # what is held back stores 1/2 E (A T)^2 per volume 1.5 x 1 x 2, put in by the temperature
    bodies.commit()
    assert bodies.stored()["strain_energy"] == pytest.approx(0.5 * E * (A * 40) ** 2 * 3, rel=1e-10)
    assert bodies.work() == pytest.approx(bodies.stored()["strain_energy"], rel=1e-10)
    bodies.destroy()


@pytest.mark.quick("plane stress")
@pytest.mark.parametrize("model", MODELS)
def test_loads_of_the_linear_path(comm: MPI.Intracomm, model: str) -> None:
    """The same forces and energies as the term, pattern by pattern, for a tilted material."""
    field = fx.Temperature(
        [(0.0, 20.0), (1.0, lambda x: 20.0 + 30.0 * x[0]), (3.0, lambda x: 50.0 * x[1])],
        reference=20.0,
    )
    continuum = heated(comm, model, CARBON, field, order=2)
    loads = thermal.thermal_loads(continuum)
    assert [load.title for load in loads] == ["temperature_0", "temperature_1", "temperature_2"]
    forces = [load_vector(continuum, load) for load in loads]
    held = thermal.held_energies(continuum)
    bodies = made(continuum, "linear")
    n = continuum.n_local
    u = wavy(continuum, 1e-2, 3).x.array[:n]
    k = continuum.stiffness()
    x, ku = k.createVecs()
    x.array[:] = u
    k.mult(x, ku)
    for time in (0.0, 0.4, 1.0, 1.7, 5.0):
        bodies.begin(time, 1.0)
        a = np.array([load.amplitude(time) for load in loads])
        f = sum(c * force.array for c, force in zip(a, forces, strict=True))
        r = internal(bodies, u)
        # round-off of sums of terms of the size of K u
        assert norm(continuum, r - (ku.array - f)) < 1e-12 * norm(continuum, ku.array)
        energy = 0.5 * dot(continuum, u, ku.array) - dot(continuum, f, u) + 0.5 * a @ held @ a
        assert bodies.stored()["strain_energy"] == pytest.approx(energy, rel=1e-10)
    assert bodies.constant and bodies.version == (0,)
    assert thermal.is_linear(continuum)
    for o in (k, x, ku, *forces):
        o.destroy()
    bodies.destroy()


@pytest.mark.quick("linear")
@pytest.mark.parametrize("kind", KINDS)
def test_taylor(comm: MPI.Intracomm, kind: str) -> None:
    material = fx.NeoHookean(E, NU, expansion=0.1) if kind == "neo" else CARBON
    field = fx.Temperature(lambda x: 1.0 + x[0])
    for model in ("plane strain", "ring", "solid"):
        continuum = heated(comm, model, material, field)
        bodies = made(continuum, kind)
        bodies.begin(1.0, 1.0)
        n = continuum.n_local
        at, along = (wavy(continuum, s, i).x.array[:n] for i, s in enumerate((0.1, 0.3)))
        energy, residual = taylor_rates(bodies, at, along, (2e-2, 1e-2, 5e-3))
        assert energy.min() > 1.9
        if kind == "linear":
            r0 = internal(bodies, at)
            change = internal(bodies, at + along) - r0
            assert norm(continuum, change) > 0.0
        else:
            assert residual.min() > 1.9
        bodies.destroy()


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.verification
@pytest.mark.parametrize("path", ["linear", "finite"])
def test_bilayer_curvature(comm: MPI.Intracomm, path: str) -> None:
    """A strip of two metals bends (Timoshenko 1925, eq. 4).

    k = 6 (a1 - a2) T (1 + m)^2 / (h (3 (1 + m)^2 + (1 + m n)(m^2 + 1/(m n)))), m = t1/t2, n = E1/E2
    """
    mesh = box(comm, "plane stress", n=(40, 4, 1), size=(40.0, 2.0, 0.0))
    top = dolfinx.mesh.locate_entities(mesh.domain, 2, lambda x: x[1] > 1.0 - 1e-9)
    bottom = dolfinx.mesh.locate_entities(mesh.domain, 2, lambda x: x[1] < 1.0 + 1e-9)
    mesh.groups["top"] = Group(2, np.sort(top))
    mesh.groups["bottom"] = Group(2, np.sort(bottom))
    a1, a2, e1, e2, rise = 2.3e-5, 1.2e-5, 70.0, 210.0, -50.0
    parts = {
        "top": fx.Isotropic(e1, 0.3, expansion=a1),
        "bottom": fx.Isotropic(e2, 0.3, expansion=a2),
    }
    continuum = Continuum(mesh, parts, fx.PlaneStress(), order=2, temperature=fx.Temperature(rise))
    bodies = made(continuum, path)
    bodies.begin(1.0, 1.0)
    solve(bodies, [("x0", 0), ("x0", 1)])
    m, n, h = 1.0, e1 / e2, 2.0
    k = 6 * (a1 - a2) * rise * (1 + m) ** 2
    k /= h * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n)))
    # curvature of the axis in the middle third, away from the ends, by three points
    found = {}
    x = continuum.positions()[: continuum.n_local // 2]
    u = bodies.u.x.array[: continuum.n_local].reshape(-1, 2)
    for place_x in (14.0, 20.0, 26.0):
        near = np.flatnonzero(np.hypot(x[:, 0] - place_x, x[:, 1] - 1.0) < 1e-9)
        found[place_x] = max(comm.allgather(u[near[0], 1] if len(near) else -np.inf))
    curvature = (found[14.0] - 2 * found[20.0] + found[26.0]) / 36.0
    # a hot top bends the strip downwards; the strains of beam theory are exact away from the ends,
    # whose disturbance dies out within a few heights
    assert curvature == pytest.approx(-k, rel=2e-3)
    bodies.destroy()


@pytest.mark.slow
def test_moduli_by_temperature(comm: MPI.Intracomm) -> None:
    """A bar whose modulus varies along it with the temperature: E = 100 + 50 x, nu = 0."""
    table = fx.ByTemperature(
        {
            0.0: fx.Isotropic(100.0, 0.0),
            10.0: fx.Isotropic(200.0, 0.0),
            -5.0: fx.Isotropic(9.0, 0.0),
        }
    )
    field = fx.Temperature(lambda x: 5.0 * x[0], amplitude=constant())
    mesh = box(comm, "plane stress", n=(6, 1, 1))
    continuum = Continuum(mesh, table, fx.PlaneStress(), order=2, temperature=field)
    assert thermal.is_linear(continuum) and not thermal.thermal_loads(continuum)
    pull = load_vector(continuum, fx.Traction("x1", (1.0, 0.0)))
    bodies = made(continuum, "linear")
    bodies.begin(0.3, 0.1)
    solve(bodies, HELD["plane stress"], load=pull.array.copy())
    work = dot(continuum, pull.array, bodies.u.x.array[: continuum.n_local])
    # elongation int_0^1.5 dx/(100 + 50 x); cubic error of P2 with cells of 0.25 is far below 1e-6
    assert work == pytest.approx(np.log(1.75) / 50.0, rel=1e-6)
    # the linear path has the same stiffness
    k = continuum.stiffness()
    x, ku = k.createVecs()
    x.array[:] = bodies.u.x.array[: continuum.n_local]
    k.mult(x, ku)
    assert 0.5 * x.dot(ku) == pytest.approx(bodies.stored()["strain_energy"], rel=1e-12)
    for o in (k, x, ku, pull):
        o.destroy()
    bodies.destroy()


@pytest.mark.slow
@pytest.mark.mpi
def test_moduli_that_change_in_time(comm: MPI.Intracomm) -> None:
    """A clamped bar heated while it softens: stress E(T) A T, energies balance."""
    table = fx.ByTemperature(
        {
            0.0: fx.Isotropic(100.0, 0.0, expansion=A),
            100.0: fx.Isotropic(50.0, 0.0, expansion=2 * A),
        }
    )
    continuum = heated(comm, "plane stress", table, fx.Temperature(100.0))
    assert not thermal.is_linear(continuum)
    clamped = [("x0", 0), ("x1", 0), ("y0", 1)]
    errors, versions = [], []
    for steps in (4, 8):
        bodies = made(continuum, "linear")
        bodies.begin(0.0, 1.0)
        versions = []
        for i in range(steps):
            bodies.begin((i + 1) / steps, 1 / steps)
            solve(bodies, clamped)
            bodies.commit()
            versions.append(bodies.version)
        stored = bodies.stored()["strain_energy"]
        # 1.5 x 1 x 2 at E = 50 and A T = 0.2
        assert stored == pytest.approx(0.5 * 50.0 * 0.2**2 * 3.0, rel=1e-10)
        errors.append(abs(bodies.work() / stored - 1.0))
        assert len(set(versions)) == steps  # the tangent changed in every increment
        bodies.destroy()
    # the trapezoidal rule on a polynomial in T: second order
    assert np.log2(errors[0] / errors[1]) > 1.9 and errors[1] < 0.05, errors


def test_large_strain_heating_balances(comm: MPI.Intracomm) -> None:
    errors = []
    for steps in (4, 8):
        continuum = heated(
            comm, "plane strain", fx.NeoHookean(E, NU, expansion=0.2), fx.Temperature(1.0)
        )
        bodies = made(continuum, "neo")
        for i in range(steps):
            bodies.begin((i + 1) / steps, 1 / steps)
            norms = solve(bodies, [("x0", 0), ("x0", 1), ("x1", 0)])
            bodies.commit()
        assert newton_order(norms) > 1.7, norms  # quadratic, short of the limit
        errors.append(abs(bodies.work() / bodies.stored()["strain_energy"] - 1.0))
        bodies.destroy()
    assert np.log2(errors[0] / errors[1]) > 1.8 and errors[1] < 1e-2, errors


@pytest.mark.slow
@pytest.mark.mpi
def test_a_dolfinx_function_is_a_temperature(comm: MPI.Intracomm) -> None:
    mesh = box(comm, "plane strain")
    given = dolfinx.fem.Function(dolfinx.fem.functionspace(mesh.domain, ("Lagrange", 1)))
    given.interpolate(lambda x: 3.0 * x[0] + x[1])
    results = []
    for value in (given, lambda x: 3.0 * x[0] + x[1]):
        field = fx.Temperature(value, reference=1.0)
        continuum = Continuum(mesh, STEEL, fx.PlaneStrain(), order=2, temperature=field)
        (load,) = thermal.thermal_loads(continuum)
        vector = load_vector(continuum, load)
        results.append(vector.array.copy())
        vector.destroy()
        (pattern,) = continuum.temperature.nodal_patterns(continuum.space)
        x = continuum.positions()
        assert pattern == pytest.approx(3.0 * x[:, 0] + x[:, 1] - 1.0, abs=1e-13)
    assert results[0] == pytest.approx(results[1], abs=1e-13)
    other = box(comm, "plane strain")
    with pytest.raises(InputError, match="on the mesh of the scene"):
        Continuum(other, STEEL, fx.PlaneStrain(), temperature=fx.Temperature(given))


@pytest.mark.slow
@pytest.mark.mpi
def test_forces_do_not_depend_on_the_number_of_ranks(comm: MPI.Intracomm) -> None:
    results = []
    for c in (comm, MPI.COMM_SELF):
        continuum = heated(c, "solid", CARBON, fx.Temperature(lambda x: 10.0 * x[0] * x[1]))
        (load,) = thermal.thermal_loads(continuum)
        vector = load_vector(continuum, load)
        u = wavy(continuum, 1.0, 4).x.array[: continuum.n_local]
        results.append([dot(continuum, vector.array, u), thermal.held_energies(continuum)[0, 0]])
        vector.destroy()
    assert results[0] == pytest.approx(results[1], rel=1e-12)  # sums in another order


@pytest.mark.mpi
def test_what_does_not_fit(comm: MPI.Intracomm) -> None:
    table = fx.ByTemperature({0.0: STEEL, 10.0: fx.Isotropic(E, 0.1)})
    assert table.temperatures == (0.0, 10.0)
    with pytest.raises(InputError, match="the scene has no temperature"):
        Continuum(box(comm, "solid"), table, fx.Solid())
    with pytest.raises(InputError, match="NeoHookean cannot be tabulated"):
        fx.ByTemperature({0.0: fx.NeoHookean(E, NU)})
    with pytest.raises(InputError, match="one or more finite temperatures"):
        fx.ByTemperature({})
    with pytest.raises(InputError, match="density"):
        fx.ByTemperature({0.0: fx.Isotropic(E, NU, density=1.0), 1.0: STEEL})
    with pytest.raises(InputError, match="must be finite and increase"):
        fx.Temperature([(1.0, 0.0), (0.0, 3.0)])
    with pytest.raises(InputError, match="take no amplitude"):
        fx.Temperature([(0.0, 0.0), (1.0, 3.0)], amplitude=constant())
    with pytest.raises(InputError, match="reference = inf"):
        fx.Temperature(1.0, reference=np.inf)
    with pytest.raises(InputError, match="value = nan"):
        fx.Temperature(np.nan)
    with pytest.raises(InputError, match="expansion = nan must be finite"):
        fx.Isotropic(E, NU, expansion=np.nan)
    with pytest.raises(InputError, match="3 numbers, one per axis"):
        fx.Orthotropic((1, 1, 1), (0, 0, 0), (1, 1, 1), expansion=(1.0, 2.0))
    with pytest.raises(InputError, match=r"density = -1.0 must be positive"):
        fx.Isotropic(E, NU, density=-1.0)


def test_expansion_turns_with_the_frame() -> None:
    """Strain along the fibres, whatever their direction."""
    a = CARBON.thermal_expansion()
    t = np.array(
        [[a[0], a[5] / 2, a[4] / 2], [a[5] / 2, a[1], a[3] / 2], [a[4] / 2, a[3] / 2, a[2]]]
    )
    fibre = np.array(CARBON.frame[0]) / np.linalg.norm(CARBON.frame[0])
    assert t @ fibre == pytest.approx(-1e-4 * fibre, abs=1e-16)
    assert np.sort(np.linalg.eigvalsh(t)) == pytest.approx([-1e-4, 2e-3, 3e-3], abs=1e-15)
