"""Implicit dynamics: periods, order in the increment, spectral radius, energies."""

from __future__ import annotations

from dataclasses import replace

from bodies import (
    MODELS,
    box,
    dot,
    held_dofs,
    internal,
    newton_order,
    place,
    solve,
    taylor_rates,
    times,
    wavy,
)

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import numpy as np
import numpy.typing as npt
import pytest
import scipy.linalg
from mpi4py import MPI
from specimens import gathered

import fxcrack as fx
from fxcrack.base.errors import InputError, SolverError
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.elastic import Elastic
from fxcrack.continuum.inertia import REMEMBERED, InertiaForces
from fxcrack.continuum.weak_form import WeakForm

Array = npt.NDArray[np.float64]

E, RHO, L = 100.0, 4.0, 1.5
SPEED = 5.0  # sqrt(E/RHO)
OMEGA = np.pi * SPEED / (2.0 * L)  # first longitudinal motion of a bar held at one end
METHODS = {
    "0.8": fx.Inertia(rho_inf=0.8),
    "0": fx.Inertia(rho_inf=0.0),
    "hht": fx.Inertia.hht(-0.1),
    "newmark": fx.Inertia.newmark(),
}
BAR = [("x0", 0), ("y0", 1), ("y1", 1)]


def moving(
    comm: MPI.Intracomm,
    effect: fx.Inertia,
    *,
    model: str = "plane stress",
    order: int = 1,
    n: tuple[int, int, int] = (4, 1, 1),
    nu: float = 0.0,
    finite: bool = False,
) -> WeakForm:
    material = fx.Isotropic(E, nu, density=RHO)
    continuum = Continuum(box(comm, model, n=n), material, MODELS[model], order=order)
    elastic = Elastic(continuum, finite=finite)
    return WeakForm(continuum, [elastic, InertiaForces(continuum, effect)])


def with_velocity(effect: fx.Inertia, size: float = 0.01) -> fx.Inertia:
    return replace(effect, velocity=(lambda x: size * np.sin(0.5 * np.pi * x[0] / L), 0.0))


def march(bodies: WeakForm, dt: float, steps: int) -> Array:
    """Displacement of the middle of the free end after each step."""
    c = bodies.continuum
    x = c.positions()[: c.n_local // c.gdim]
    tip = np.flatnonzero(np.hypot(x[:, 0] - L, x[:, 1]) < 1e-9)
    out = []
    for i in range(steps):
        bodies.begin((i + 1) * dt, dt)
        solve(bodies, BAR)
        bodies.commit()
        out.append(bodies.u.x.array[c.gdim * tip[0]] if len(tip) else -np.inf)
    return np.array([max(v) for v in zip(*c.comm.allgather(out), strict=True)])


@pytest.mark.quick("hht")
@pytest.mark.parametrize("method", METHODS)
def test_order_in_the_increment(comm: MPI.Intracomm, method: str) -> None:
    """Half a period of one discrete motion: the error falls with the square of the increment."""
    end = np.pi / OMEGA
    tips, exact = [], 0.0
    for steps in (20, 40, 80):
        bodies = moving(comm, with_velocity(METHODS[method]), n=(2, 1, 1))
        exact = exact_tip(bodies, METHODS[method], end)
        tips.append(march(bodies, end / steps, steps)[-1])
        bodies.destroy()
    errors = np.abs(np.array(tips) - exact)
    rates = np.log2(errors[:-1] / errors[1:])
    assert rates.min() > 1.85, (rates, errors)  # 2 in the limit


def exact_tip(bodies: WeakForm, effect: fx.Inertia, time: float) -> float:
    """Displacement of the tip of the mesh at a time, by its own frequencies and shapes."""
    c = bodies.continuum
    velocity = c.comm.allgather(bodies.terms[1].velocity.x.array[: c.n_local].copy())
    parts = [WeakForm(c, [term]) for term in bodies.terms]
    parts[1].begin(1.0, 1.0)
    k, m = (gathered(part.tangent()).toarray() for part in parts)
    for part in parts:
        part.destroy()
    n = c.n_local // 2
    x = np.concatenate(c.comm.allgather(c.positions()[:n]))
    free = np.concatenate([[i > 1e-9, False] for i in x[:, 0]])
    alpha_m, alpha_f, beta, _ = effect.parameters
    m *= beta * (1.0 - alpha_f) / (1.0 - alpha_m)  # an increment of 1
    squares, shapes = scipy.linalg.eigh(k[np.ix_(free, free)], m[np.ix_(free, free)])
    w = np.sqrt(squares)
    u = np.zeros(len(x) * 2)
    v = np.concatenate(velocity)[free]
    u[free] = shapes @ (np.sin(w * time) / w * (shapes.T @ m[np.ix_(free, free)] @ v))
    tip = np.flatnonzero(np.hypot(x[:, 0] - L, x[:, 1]) < 1e-9)[0]
    return float(u[2 * tip])


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.verification
def test_bar_vibrates_at_its_frequency(comm: MPI.Intracomm) -> None:
    """u = v0/w sin(w t) sin(pi x/2 L), w = pi/2 L sqrt(E/rho)."""
    bodies = moving(comm, with_velocity(fx.Inertia(rho_inf=0.9)), order=2)
    steps = 100
    period = 2.0 * np.pi / OMEGA
    tip = march(bodies, period / steps, steps)
    t = np.arange(1, steps + 1) * period / steps
    # period error (w dt)^2/12 of the trapezoidal rule and some more: 3e-4 x 2 pi
    assert np.abs(tip - 0.01 / OMEGA * np.sin(OMEGA * t)).max() < 3e-3 * 0.01 / OMEGA
    bodies.destroy()


@pytest.mark.parametrize("method", METHODS)
def test_energies(comm: MPI.Intracomm, method: str) -> None:
    """What was kinetic at first is strain, kinetic or numerically dissipated energy, exactly."""
    bodies = moving(comm, with_velocity(METHODS[method]))
    first = bodies.stored()["kinetic_energy"]
    assert first == pytest.approx(0.5 * RHO * 1e-4 * 0.5 * L * 2.0, rel=3e-2)  # interpolated sine
    totals = []
    for _ in range(3):
        march(bodies, 0.15, 8)
        stored = bodies.stored()
        totals.append(sum(stored.values()))
        lost = bodies.spent()["numerical_dissipation"]
        # Newton stops at 1e-11, and there are 24 steps
        assert totals[-1] + lost == pytest.approx(first, rel=1e-9)
    if method == "newmark":
        assert totals == pytest.approx([first] * 3, rel=1e-9)
    else:
        assert first > totals[0] > totals[1] > totals[2] > 0.0
    bodies.destroy()


@pytest.mark.slow
def test_rayleigh_damping(comm: MPI.Intracomm) -> None:
    """One motion decays with ratio (r_M/w + r_K w)/2; the energy it loses is counted."""
    for rayleigh in ((0.4, 0.0), (0.0, 0.02), (0.3, 0.01)):
        effect = with_velocity(fx.Inertia(alpha_m=0.0, alpha_f=0.0, rayleigh=rayleigh))
        bodies = moving(comm, effect, order=2)
        first = bodies.stored()["kinetic_energy"]
        steps = 200
        dt = 2.0 * np.pi / OMEGA / steps
        tip = march(bodies, dt, steps)
        zeta = 0.5 * (rayleigh[0] / OMEGA + rayleigh[1] * OMEGA)
        damped = OMEGA * np.sqrt(1.0 - zeta**2)
        t = dt * np.arange(1, steps + 1)
        exact = 0.01 / damped * np.exp(-zeta * OMEGA * t) * np.sin(damped * t)
        # the period error of the trapezoidal rule is (w dt)^2/12 of 2 pi: 5e-4
        assert np.abs(tip - exact).max() < 1e-3 * np.abs(exact).max(), rayleigh
        spent = bodies.spent()
        assert spent["damping_energy"] > 0.1 * first
        assert abs(spent["numerical_dissipation"]) < 1e-9 * first
        total = sum(bodies.stored().values()) + spent["damping_energy"]
        assert total == pytest.approx(first, rel=1e-9)
        bodies.destroy()


@pytest.mark.parametrize("method", METHODS)
def test_spectral_radius(method: str) -> None:
    """One free dof, every state of the method as the start: the amplification matrix."""
    effect = METHODS[method]
    bodies = moving(MPI.COMM_SELF, effect, n=(1, 1, 1))
    c = bodies.continuum
    term = bodies.terms[1]
    held = np.setdiff1d(np.arange(c.n_local), held_dofs(c, [("x1", 0)])[:1])
    free = np.setdiff1d(np.arange(c.n_local), held)
    # c matters with damping alone, w with contact
    names = [n for n in REMEMBERED if n not in ("c", "w")]

    def step(start: Array, dt: float) -> Array:
        state = term.state()
        for name in REMEMBERED:
            state[name][:] = 0.0
        for name, value in zip(names, start, strict=True):
            state[name][free] = value
        term.restore(state)
        bodies.u.x.array[:] = state["u"]
        bodies.begin(1.0, dt)
        zero = np.zeros(c.n_local)
        r = internal(bodies, zero)[free]
        unit = zero.copy()
        unit[free] = 1.0
        zero[free] = -r / times(bodies, unit)[free]
        place(bodies, zero)
        bodies.commit()
        after = term.state()
        return np.array([after[name][free][0] for name in names])

    def radius(dt: float) -> float:
        # scaled so that all four states are lengths
        scale = np.array([1.0, dt, dt**2, dt**2])
        matrix = np.stack([step(e / scale, dt) * scale for e in np.eye(4)], axis=1)
        return float(np.abs(np.linalg.eigvals(matrix)).max())

    alpha_m, alpha_f, _, _ = effect.parameters
    fast = {"0.8": 0.8, "0": 0.0, "hht": 0.9 / 1.1, "newmark": 1.0}[method]
    # a double eigenvalue: its round-off is a root (square, cubic at 0) of that of the matrix
    assert radius(1e6) == pytest.approx(fast, abs=1e-4)
    assert radius(1e-4) == pytest.approx(1.0, abs=1e-4)  # (w dt)^3 is lost at most
    for dt in (1e-3, 1e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0):
        assert radius(dt) < 1.0 + 1e-9
    assert alpha_m <= alpha_f
    bodies.destroy()


@pytest.mark.quick("plane *", "ring-False")
@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("model", MODELS)
def test_mass(comm: MPI.Intracomm, model: str, lumped: bool) -> None:
    """A rigid acceleration needs the mass times it; lumped mass is diagonal."""
    effect = fx.Inertia(rho_inf=1.0, density=3.0, lumped=lumped)
    continuum = Continuum(box(comm, model), fx.Isotropic(E, 0.3), MODELS[model])
    bodies = WeakForm(continuum, [InertiaForces(continuum, effect)])
    bodies.begin(0.1, 0.1)
    u = np.zeros(continuum.n_local)
    u[1 :: continuum.gdim] = 1.0
    force = dot(continuum, internal(bodies, u), u)
    volume = {"solid": 1.2, "ring": np.pi * (2.5**2 - 1.0)}.get(model, 3.0)
    # at rho_inf = 1: alpha_m = alpha_f = 1/2, beta = 1/4
    assert force == pytest.approx(3.0 * volume * 4.0 / 0.1**2, rel=1e-12)
    matrix = bodies.tangent().copy()
    total = matrix.norm()
    diagonal = matrix.getDiagonal()
    off = abs(total**2 - diagonal.norm() ** 2) / total**2
    assert off < 1e-14 if lumped else off > 0.1
    matrix.destroy()
    diagonal.destroy()
    bodies.destroy()


def test_tangent_is_assembled_once_per_length_of_the_increment(comm: MPI.Intracomm) -> None:
    bodies = moving(comm, with_velocity(fx.Inertia()))
    assert bodies.constant
    seen = []
    for dt in (0.1, 0.1, 0.05, 0.05):
        bodies.begin(0.0, dt)
        seen.append((bodies.version, bodies.tangent().norm()))
        place(bodies, np.zeros(bodies.continuum.n_local))
        bodies.commit()
    assert seen[0] == seen[1] and seen[2] == seen[3]
    assert seen[0][0] != seen[2][0] and seen[0][1] < seen[2][1]
    assert bodies.n_forms == 6  # residual and tangent of two terms, strain and kinetic energy
    with pytest.raises(SolverError, match="must be > 0"):
        bodies.begin(0.0, 0.0)
    bodies.destroy()


@pytest.mark.slow
@pytest.mark.mpi
def test_taylor_with_finite_strain(comm: MPI.Intracomm) -> None:
    bodies = moving(comm, fx.Inertia(rayleigh=(0.1, 0.01)), nu=0.3, finite=True)
    bodies.begin(0.1, 0.1)
    n = bodies.continuum.n_local
    at, along = (wavy(bodies.continuum, s, i).x.array[:n] for i, s in enumerate((0.1, 0.3)))
    _, residual = taylor_rates(bodies, at, along, (2e-2, 1e-2, 5e-3), energy=False)
    assert residual.min() > 1.9
    norms = solve(bodies, BAR, values=lambda x: 0.2 * x)
    place(bodies, at)
    norms = solve(bodies, BAR)
    assert newton_order(norms) > 1.7, norms
    bodies.destroy()


@pytest.mark.slow
@pytest.mark.mpi
def test_restored_state_goes_on_alike(comm: MPI.Intracomm) -> None:
    effect = with_velocity(fx.Inertia(rayleigh=(0.1, 0.0)))
    first, second = moving(comm, effect), moving(comm, effect)
    march(first, 0.1, 5)
    second.restore(comm.bcast(first.state()))
    a, b = march(first, 0.07, 3), march(second, 0.07, 3)
    assert a == pytest.approx(b, rel=1e-12)
    assert first.spent() == pytest.approx(second.spent(), rel=1e-10)
    first.destroy()
    second.destroy()


@pytest.mark.mpi
def test_ranks_agree(comm: MPI.Intracomm) -> None:
    tips = []
    for c in (comm, MPI.COMM_SELF):
        bodies = moving(c, with_velocity(fx.Inertia(rayleigh=(0.1, 0.01))))
        tips.append([*march(bodies, 0.1, 5), *bodies.spent().values()])
        bodies.destroy()
    assert tips[0] == pytest.approx(tips[1], rel=1e-8)  # Newton stops at 1e-11


@pytest.mark.mpi
def test_what_does_not_fit(comm: MPI.Intracomm) -> None:
    continuum = Continuum(box(comm, "solid"), fx.Isotropic(E, 0.3), fx.Solid(), order=2)
    for message, make in (
        ("has no density", lambda: InertiaForces(continuum, fx.Inertia())),
        ("first-order bodies", lambda: InertiaForces(continuum, fx.Inertia(1.0, lumped=True))),
        (
            "velocity has 2 components, 3 needed",
            lambda: InertiaForces(continuum, fx.Inertia(1.0, velocity=(0.0, 1.0))),
        ),
        ("density = 0.0 must be positive", lambda: fx.Inertia(0.0)),
        ("rho_inf = 1.2", lambda: fx.Inertia(rho_inf=1.2)),
        ("together", lambda: fx.Inertia(alpha_m=0.1)),
        ("not unconditionally stable", lambda: fx.Inertia(alpha_m=0.4, alpha_f=0.1)),
        ("rayleigh", lambda: fx.Inertia(rayleigh=(-1.0, 0.0))),
        ("alpha = 0.1 must lie between", lambda: fx.Inertia.hht(0.1)),
    ):
        with pytest.raises(InputError, match=message):
            make()
