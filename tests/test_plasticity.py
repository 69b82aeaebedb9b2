"""J2 plasticity: closed forms, the consistent tangent, energies."""

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
    times,
    total,
    wavy,
)

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from specimens import specimen

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.elastic import Elastic
from fxcrack.continuum.plasticity import Plasticity
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.meshes.dcb import dcb_2d

Array = npt.NDArray[np.float64]

E, NU, Y, H = 100.0, 0.3, 0.5, 10.0
METAL = fx.Plastic(E, NU, yield_stress=Y, hardening=H)
TABLE = ((0.0, 0.5), (0.01, 0.7), (0.03, 0.8))
# what holds a bar that is pulled along an axis with free sides, and the side it is pulled at
PULLED = {
    "ring": ([("y0", 1), ("y1", 1)], "y1", 1, np.pi * (2.5**2 - 1.0)),
    "solid": ([("x0", 0), ("y0", 1), ("z0", 2), ("x1", 0)], "x1", 0, 0.8),
}


def plastic(
    comm: MPI.Intracomm,
    model: str,
    material: fx.Plastic = METAL,
    order: int = 1,
    temperature: fx.Temperature | None = None,
) -> WeakForm:
    continuum = Continuum(
        box(comm, model), material, MODELS[model], order=order, temperature=temperature
    )
    return WeakForm(continuum, [Plasticity(continuum)])


def side_force(bodies: WeakForm, where: str, axis: int) -> float:
    c = bodies.continuum
    r = internal(bodies, bodies.u.x.array[: c.n_local].copy())
    return float(c.comm.allreduce(r[c.gdim * c.owned_nodes(where) + axis].sum()))


def stress_of(strain: float, material: fx.Plastic) -> float:
    """Stress of uniaxial tension at a total strain, by bisection."""
    knots, stress, slopes = material.curve()
    low, high = 0.0, material.E * strain
    for _ in range(200):
        s = 0.5 * (low + high)
        p = strain - s / material.E
        k = int(np.searchsorted(knots, p, side="right")) - 1
        if s > stress[k] + slopes[k] * (p - knots[k]):
            high = s
        else:
            low = s
    return s


@pytest.mark.quick("ring-*")
@pytest.mark.parametrize(
    "material",
    [METAL, fx.Plastic(E, NU, hardening=TABLE), fx.Plastic(E, NU, yield_stress=Y)],
    ids=["linear", "table", "perfect"],
)
@pytest.mark.parametrize("model", PULLED)
def test_uniaxial(comm: MPI.Intracomm, model: str, material: fx.Plastic) -> None:
    """Loading in coarse steps and unloading: the curve itself, whatever the steps."""
    bodies = plastic(comm, model, material)
    held, where, axis, area = PULLED[model]
    peak = stress_of(0.05, material)
    for strain, stress in (
        (0.004, 0.4),
        (0.012, stress_of(0.012, material)),
        (0.05, peak),
        (0.046, peak - 0.4),
    ):
        bodies.begin(strain, 0.01)
        solve(bodies, held, values=lambda x, e=strain: e * x)
        # Newton stops at 1e-11 of the first residual
        assert side_force(bodies, where, axis) == pytest.approx(area * stress, rel=1e-8), strain
        values = bodies.stress().x.array.reshape(-1, len(bodies.continuum.model.stress_labels))
        assert values[:, axis] == pytest.approx(np.full(len(values), stress), rel=1e-8)
        bodies.commit()
    p = bodies.terms[0].equivalent_strain().x.array
    assert p == pytest.approx(np.full(len(p), 0.05 - peak / E), rel=1e-8)
    bodies.destroy()


@pytest.mark.quick("plane strain-*", "ring-1", "solid-1")
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("model", ["plane strain", "ring", "solid"])
def test_taylor(comm: MPI.Intracomm, model: str, order: int) -> None:
    """The tangent of a step into the plastic range, from a plastic state."""
    bodies = plastic(comm, model, order=order)
    c = bodies.continuum
    before = wavy(c, 0.05, 7).x.array[: c.n_local]
    place(bodies, before)
    bodies.commit()
    # far beyond yield everywhere, so that no point is on the corner of its curve
    at = before + wavy(c, 0.5, 8).x.array[: c.n_local]
    along = wavy(c, 0.3, 9).x.array[: c.n_local]
    _, residual = taylor_rates(bodies, at, along, (1e-3, 5e-4, 2.5e-4), energy=False)
    assert residual.min() > 1.9, residual
    other = wavy(c, 0.3, 10).x.array[: c.n_local]
    # round-off of a symmetric form
    there = dot(c, other, times(bodies, along))
    assert dot(c, along, times(bodies, other)) == pytest.approx(there, rel=1e-11)
    bodies.destroy()


def test_elastic_below_yield(comm: MPI.Intracomm) -> None:
    continuum = Continuum(box(comm, "plane strain"), METAL, MODELS["plane strain"])
    bodies = WeakForm(continuum, [Plasticity(continuum)])
    linear = Continuum(continuum.mesh, fx.Isotropic(E, NU), MODELS["plane strain"])
    elastic = WeakForm(linear, [Elastic(linear)])
    u = wavy(continuum, 1e-4, 2).x.array[: continuum.n_local]
    assert internal(bodies, u) == pytest.approx(internal(elastic, u), abs=1e-14)
    assert total(bodies, u) == pytest.approx(total(elastic, u), rel=1e-12)
    assert times(bodies, u) == pytest.approx(times(elastic, u), abs=1e-14)
    bodies.destroy()
    elastic.destroy()


def test_plane_strain_is_a_held_solid(comm: MPI.Intracomm) -> None:
    """The stress across the plane is in the yield function: forces of a solid held in z."""
    forces = []
    for model, deep in (("plane strain", 2.0), ("solid", 0.8)):
        bodies = plastic(comm, model)
        held = [("x0", 0), ("y0", 1), ("x1", 0)]
        if model == "solid":
            held += [("z0", 2), ("z1", 2)]
        for strain in (0.01, 0.03, 0.02):
            bodies.begin(strain, 0.01)
            solve(
                bodies,
                held,
                values=lambda x, e=strain, d=bodies.continuum.gdim: x[:, :d] * ([e, 0, 0][:d]),
            )
            bodies.commit()
        forces.append(side_force(bodies, "x1", 0) / deep)
        bodies.destroy()
    assert forces[0] == pytest.approx(forces[1], rel=1e-8)  # Newton stops at 1e-11


@pytest.mark.slow
@pytest.mark.mpi
def test_energy_balance_is_exact(comm: MPI.Intracomm) -> None:
    """Work of the ends by the trapezoidal rule = elastic energy + plastic work, cycle included."""
    bodies = plastic(comm, "plane strain", fx.Plastic(E, NU, hardening=TABLE))
    c = bodies.continuum
    work, u, r = 0.0, np.zeros(c.n_local), np.zeros(c.n_local)
    for pull in (0.01, 0.03, -0.02, 0.0, 0.05):
        bodies.begin(1.0, 1.0)
        # one end held, the other moved sideways: bending and shear
        norms = solve(
            bodies,
            [("x0", 0), ("x0", 1), ("x1", 1)],
            values=lambda x, p=pull: np.stack([0 * x[:, 0], p * x[:, 0]], axis=1),
        )
        now = bodies.u.x.array[: c.n_local].copy()
        force = internal(bodies, now)
        work += 0.5 * dot(c, r + force, now - u)
        u, r = now, force
        bodies.commit()
    plastic_work = bodies.spent()["plastic_energy"]
    assert plastic_work > 0.1 * work
    # Newton stops at 1e-11 of the first residual
    assert work == pytest.approx(bodies.stored()["strain_energy"] + plastic_work, rel=1e-9)
    assert newton_order(norms) > 1.7, norms  # quadratic, short of the limit
    bodies.destroy()


def test_clamped_bar_is_cooled_beyond_yield(comm: MPI.Intracomm) -> None:
    metal = fx.Plastic(E, NU, expansion=1e-3, yield_stress=Y, hardening=H)
    bodies = plastic(comm, "solid", metal, temperature=fx.Temperature(-20.0))
    held = [("x0", 0), ("y0", 1), ("z0", 2), ("x1", 0)]
    for time in (0.1, 0.5, 1.0, 0.9):
        bodies.begin(time, 0.1)
        solve(bodies, held)
        bodies.commit()
    # the strain that is held back is 0.02, then 0.002 less
    expected = stress_of(0.02, metal) - E * 0.002
    assert side_force(bodies, "x1", 0) == pytest.approx(0.8 * expected, rel=1e-8)
    energies = bodies.stored()["strain_energy"] + bodies.spent()["plastic_energy"]
    assert bodies.work() == pytest.approx(energies, rel=1e-9)
    bodies.destroy()


@pytest.mark.slow
@pytest.mark.mpi
def test_beside_elastic_cells_and_restored(comm: MPI.Intracomm) -> None:
    mesh = box(comm, "plane strain")
    continuum = Continuum(
        mesh, {"left": METAL, "right": fx.Isotropic(E, NU)}, MODELS["plane strain"]
    )

    def make() -> WeakForm:
        return WeakForm(continuum, [Elastic(continuum), Plasticity(continuum)])

    def step(bodies: WeakForm, strain: float) -> None:
        bodies.begin(strain, 0.1)
        solve(
            bodies,
            [("x0", 0), ("x0", 1), ("x1", 0)],
            values=lambda x: strain * x[:, :2] * [1.0, 0.0],
        )
        bodies.commit()

    first, second = make(), make()
    step(first, 0.02)
    p = first.terms[1].equivalent_strain().x.array
    inside = np.isin(np.arange(len(p)), mesh.group("left").entities)
    assert np.all(p[inside] > 0.0) and np.all(p[~inside] == 0.0)
    second.restore(comm.bcast(first.state()))
    for b in (first, second):
        step(b, 0.03)
    assert second.u.x.array == pytest.approx(first.u.x.array, abs=1e-13)
    assert second.spent()["plastic_energy"] == pytest.approx(
        first.spent()["plastic_energy"], rel=1e-11
    )
    first.destroy()
    second.destroy()


@pytest.mark.mpi
def test_forces_do_not_depend_on_the_number_of_ranks(comm: MPI.Intracomm) -> None:
    results = []
    for c in (comm, MPI.COMM_SELF):
        bodies = plastic(c, "plane strain", order=2)
        continuum = bodies.continuum
        u = wavy(continuum, 0.1, 5).x.array[: continuum.n_local]
        w = wavy(continuum, 1.0, 6).x.array[: continuum.n_local]
        place(bodies, 0.5 * u)
        bodies.commit()
        results.append([total(bodies, u), dot(continuum, internal(bodies, u), w)])
        results[-1] += [dot(continuum, times(bodies, u), w), norm(continuum, times(bodies, w))]
        bodies.commit()
        results[-1].append(bodies.spent()["plastic_energy"])
        bodies.destroy()
    assert results[0] == pytest.approx(results[1], rel=1e-11)  # sums in another order


@pytest.mark.mpi
def test_what_does_not_fit(comm: MPI.Intracomm) -> None:
    with pytest.raises(InputError, match="thickness strain"):
        plastic(comm, "plane stress")
    for message, make in (
        ("yield_stress = None must be positive", lambda: fx.Plastic(E, NU)),
        ("no softening", lambda: fx.Plastic(E, NU, yield_stress=1.0, hardening=-1.0)),
        ("must not fall", lambda: fx.Plastic(E, NU, hardening=((0.0, 1.0), (0.1, 0.9)))),
        ("must start at 0", lambda: fx.Plastic(E, NU, hardening=((0.1, 1.0), (0.2, 2.0)))),
        ("a number or pairs", lambda: fx.Plastic(E, NU, hardening=(1.0, 2.0))),
        ("contradicts", lambda: fx.Plastic(E, NU, yield_stress=3.0, hardening=TABLE)),
        ("Plastic: E = 0.0", lambda: fx.Plastic(0.0, NU, yield_stress=1.0)),
    ):
        with pytest.raises(InputError, match=message):
            make()


@pytest.mark.quick("1.0")
@pytest.mark.parametrize("increment", [1.0, 0.25])
def test_faces_that_close_in_a_long_increment_take_no_energy(
    comm: MPI.Intracomm, increment: float
) -> None:
    """Opened until it yields, then pressed together in one increment, or in four: 66 % and 12 % of
    the work were missing. The limit of the check that divides increments is 1e-5 of the stored
    energy each, but for parts of 1/512 of one; contact that closes there leaves the square of it.
    """
    there = fx.Amplitude((0.0, 1.0, 2.0), (0.0, 1.0, -0.5))
    pins = [
        fx.Displacement("pin_top", x=0.0, y=1.0, amplitude=there),
        fx.Displacement("pin_bottom", x=0.0, y=-1.0, amplitude=there),
    ]
    scene = specimen(
        dcb_2d(comm, length=15.0, dx=1.5, ny=2),
        a0=6.0,
        materials=fx.Plastic(E=70e3, nu=0.3, yield_stress=60.0, hardening=2e3),
        supports=pins,
        contact=True,
        criterion=fx.VCCT(GIc=1e9),
    )
    step = fx.Static(until=fx.Time(2.0), stepping="increment", initial=increment, maximum=increment)
    history = scene.run(step, progress=False)
    work = np.abs(history["external_work"].astype(float)).max()
    assert np.abs(history["balance"].astype(float)).max() < 5e-4 * work
    assert np.diff(history["plastic_energy"].astype(float)).min() > -1e-12 * work
