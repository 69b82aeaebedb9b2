"""Follower pressure: tangent, forces and work against closed forms."""

from __future__ import annotations

from bodies import (
    MODELS,
    box,
    internal,
    newton_order,
    place,
    solve,
    taylor_rates,
    times,
    uniform,
    wavy,
)

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.continuum.amplitudes import constant
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.elastic import Elastic
from fxcrack.continuum.follower_pressure import FollowerPressure
from fxcrack.continuum.load_vectors import load_vector
from fxcrack.continuum.loads import Field
from fxcrack.continuum.neo_hookean import NeoHookeanBodies
from fxcrack.continuum.weak_form import WeakForm


def pressed(
    comm: MPI.Intracomm, model: str, order: int = 1, value: Field = 3.0, where: str = "x1"
) -> tuple[Continuum, WeakForm]:
    continuum = Continuum(box(comm, model), fx.Isotropic(100.0, 0.3), MODELS[model], order=order)
    load = fx.Pressure(where, value, follows=True)
    return continuum, WeakForm(continuum, [FollowerPressure(continuum, load)])


@pytest.mark.quick("plane *")
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("model", MODELS)
def test_taylor(comm: MPI.Intracomm, model: str, order: int) -> None:
    continuum, bodies = pressed(comm, model, order, lambda x: 1.0 + x[1])
    bodies.begin(0.7, 0.7)
    n = continuum.n_local
    at, along = (wavy(continuum, s, i).x.array[:n] for i, s in enumerate((0.1, 0.3)))
    if continuum.gdim == 2 and model != "ring":
        # linear in the displacement: no remainder at all, but for round-off
        r0, kd = internal(bodies, at), times(bodies, along)
        assert internal(bodies, at + along) == pytest.approx(r0 + kd, abs=1e-12)
    else:
        _, residual = taylor_rates(bodies, at, along, (2e-2, 1e-2, 5e-3), energy=False)
        assert residual.min() > 1.9
    assert not bodies.symmetric
    bodies.destroy()


@pytest.mark.quick("plane strain")
@pytest.mark.parametrize("model", ["plane strain", "solid"])
def test_force_turns_with_the_body(comm: MPI.Intracomm, model: str) -> None:
    """A rotated and stretched block: -p times the deformed area along the deformed normal."""
    continuum, bodies = pressed(comm, model)
    c, s = np.cos(0.8), np.sin(0.8)
    f = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([1.1, 1.3, 0.9])
    d = continuum.gdim
    n = continuum.n_local
    u = uniform((f - np.eye(3))[:d, :d])(continuum.positions()[: n // d]).ravel()
    bodies.begin(2.0, 1.0)
    force = -internal(bodies, u).reshape(-1, d).sum(axis=0)
    force = continuum.comm.allreduce(force)
    # side x1 is 1.0 high and 0.8 deep (2.0 thick): stretched by 1.3 and 0.9 in the solid
    area = 1.3 * 1.0 * (0.8 * 0.9 if model == "solid" else 2.0)
    assert force == pytest.approx(-6.0 * area * np.array([c, s, 0.0])[:d], abs=1e-12)
    # at no displacement it is the dead load
    dead = load_vector(continuum, fx.Pressure("x1", 6.0))
    assert -internal(bodies, 0 * u) == pytest.approx(dead.array, abs=1e-12)
    dead.destroy()
    bodies.destroy()


@pytest.mark.quick("plane strain")
@pytest.mark.mpi
@pytest.mark.parametrize("model", ["plane strain", "ring", "solid"])
def test_work_is_pressure_times_volume(comm: MPI.Intracomm, model: str) -> None:
    """All sides under constant pressure: work = -p times the change of volume, in any steps."""
    continuum = Continuum(box(comm, model), fx.Isotropic(1.0, 0.0), MODELS[model])
    sides = ["x0", "x1", "y0", "y1"] + (["z0", "z1"] if model == "solid" else [])
    loads = [fx.Pressure(s, 2.0, amplitude=constant(1.5), follows=True) for s in sides]
    bodies = WeakForm(continuum, [FollowerPressure(continuum, load) for load in loads])
    n, d = continuum.n_local, continuum.gdim
    x = continuum.positions()[: n // d, :d]
    bodies.begin(0.0, 1.0)
    bodies.commit()
    # each axis by its own factor, in two steps on a way that is not straight
    for factors in ([1.3, 0.9, 1.0], [1.2, 1.4, 0.7]):
        place(bodies, (x * (np.array(factors)[:d] - 1.0)).ravel())
        bodies.begin(1.0, 1.0)
        bodies.commit()
    before = {"plane strain": 1.5 * 2.0, "ring": np.pi * (2.5**2 - 1.0), "solid": 1.2}[model]
    growth = {"plane strain": 1.2 * 1.4, "ring": 1.2**2 * 1.4, "solid": 1.2 * 1.4 * 0.7}[model]
    assert bodies.work() == pytest.approx(-3.0 * before * (growth - 1.0), rel=1e-12)
    bodies.destroy()


@pytest.mark.slow
@pytest.mark.mpi
def test_energy_balance_of_a_ramp(comm: MPI.Intracomm) -> None:
    """Work of a growing pressure against the energy stored; the error falls with the square."""
    errors = []
    for steps in (4, 8):
        continuum = Continuum(
            box(comm, "plane strain"), fx.NeoHookean(100.0, 0.3), MODELS["plane strain"]
        )
        load = fx.Pressure("y1", lambda x: 4.0 * x[0], follows=True)
        terms = [NeoHookeanBodies(continuum), FollowerPressure(continuum, load)]
        bodies = WeakForm(continuum, terms)
        for i in range(steps):
            bodies.begin((i + 1) / steps, 1 / steps)
            norms = solve(bodies, [("x0", 0), ("x0", 1)])
            bodies.commit()
        stored = sum(bodies.stored().values())
        errors.append(abs(bodies.work() - stored) / stored)
        assert newton_order(norms) > 1.7, norms  # quadratic, short of the limit
        bodies.destroy()
    assert errors[1] < 2e-3 and np.log2(errors[0] / errors[1]) > 1.8, errors


@pytest.mark.slow
@pytest.mark.mpi
def test_restored_state_goes_on_alike(comm: MPI.Intracomm) -> None:
    continuum = Continuum(
        box(comm, "plane strain"), fx.Isotropic(100.0, 0.3), MODELS["plane strain"]
    )

    def make() -> WeakForm:
        load = fx.Pressure("y1", 2.0, follows=True)
        terms = [Elastic(continuum, finite=True), FollowerPressure(continuum, load)]
        return WeakForm(continuum, terms)

    def step(bodies: WeakForm, time: float) -> None:
        bodies.begin(time, 0.5)
        solve(bodies, [("x0", 0), ("x0", 1)])
        bodies.commit()

    first, second = make(), make()
    step(first, 0.5)
    second.restore(comm.bcast(first.state()))
    for b in (first, second):
        step(b, 1.0)
    assert second.work() == pytest.approx(first.work(), rel=1e-13)
    assert second.u.x.array == pytest.approx(first.u.x.array, abs=1e-14)
    first.destroy()
    second.destroy()
