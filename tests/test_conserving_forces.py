"""Finite strain in motion: the work of an increment's forces is the change of the energy."""

from __future__ import annotations

from bodies import MODELS, box, solve, wavy

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import dolfinx.fem
import numpy as np
import numpy.typing as npt
import pytest
import ufl
from mpi4py import MPI
from test_continuum_shell import shell
from thin_bodies import thin_body

import fxcrack as fx
from fxcrack.continuum.conserving import ConservingForces
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.elastic import Elastic
from fxcrack.continuum.inertia import InertiaForces
from fxcrack.continuum.materials import Material
from fxcrack.continuum.neo_hookean import NeoHookeanBodies
from fxcrack.continuum.term import Term
from fxcrack.continuum.tied_elastic import TiedElastic
from fxcrack.continuum.weak_form import WeakForm

Array = npt.NDArray[np.float64]

CARBON = fx.Orthotropic(
    E=(140.0, 10.0, 9.0), nu=(0.3, 0.25, 0.4), G=(5.0, 5.0, 3.5), frame=((1, 0.5, 0), (0, 1, 0))
)
RUBBER = fx.NeoHookean(100.0, 0.3)
KEEPS, LOSES = fx.Inertia(rho_inf=1.0), fx.Inertia(rho_inf=0.6)


def term_of(continuum: Continuum, material: Material) -> Elastic | NeoHookeanBodies:
    if isinstance(material, fx.NeoHookean):
        return NeoHookeanBodies(continuum)
    return Elastic(continuum, finite=True)


class Increment:
    """One increment of a term from one displacement to another, alone on its rank."""

    def __init__(self, continuum: Continuum, term: Term, effect: fx.Inertia, begin: Array) -> None:
        self.term = ConservingForces(continuum, term, effect)  # type: ignore[arg-type]
        self._u = wavy(continuum, 0.0, 0)
        self.first = self.forces(begin)
        self.before = self.energy(begin)
        self.term.begin_at(self._u)
        self.term.begin(1.0, 1.0)

    def forces(self, u: Array) -> Array:
        self._u.x.array[:] = u
        out = np.zeros_like(u)
        self.term.add_residual(out, self._u)
        return out

    def energy(self, u: Array) -> float:
        self._u.x.array[:] = u
        return self.term.stored(self._u)


CASES = [
    ("plane strain", CARBON), ("plane stress", CARBON), ("ring", CARBON),
    ("plane strain", RUBBER), ("ring", RUBBER), ("solid", CARBON), ("solid", RUBBER),
]  # fmt: skip


@pytest.mark.quick("plane strain-*", "ring-NeoHookean")
@pytest.mark.parametrize(
    ("model", "material"), CASES, ids=[f"{m}-{type(x).__name__}" for m, x in CASES]
)
def test_work_is_the_change_of_energy(model: str, material: Material) -> None:
    """To round-off, for strains of some tenths and of almost nothing; no force at no change."""
    continuum = Continuum(box(MPI.COMM_SELF, model), material, MODELS[model], order=1)
    begin, along = (wavy(continuum, s, i).x.array.copy() for i, s in enumerate((0.1, 0.3)))
    for size in (0.5, 1e-3):
        increment = Increment(continuum, term_of(continuum, material), KEEPS, begin)
        step = size * along
        last = increment.forces(begin + step)
        gained = increment.energy(begin + step) - increment.before
        given = 0.5 * (increment.first + last) @ step
        # the trapezoidal rule is off by 1e-2 and 1e-8 of it
        round_off = 1e-12 * abs(gained) + 1e-14 * increment.before
        assert abs(given - gained) < round_off
    still = increment.forces(begin)
    assert still == pytest.approx(increment.first, abs=1e-12 * np.abs(still).max())


def test_continuum_shells_of_first_order() -> None:
    """Likewise; their strains are quadratic, enhanced ones included."""
    mesh = thin_body((3, 2), (10.0, 4.0), 0.5, order=1)
    continuum = shell(mesh, fx.Isotropic(100.0, 0.3), order=1)
    begin, along = (wavy(continuum, s, i).x.array.copy() for i, s in enumerate((0.1, 0.3)))
    increment = Increment(continuum, TiedElastic(continuum, finite=True), KEEPS, begin)
    given = 0.5 * (increment.first + increment.forces(begin + along)) @ along
    gained = increment.energy(begin + along) - increment.before
    assert given == pytest.approx(gained, rel=1e-11)


def spinning(comm: MPI.Intracomm, material: Material, effect: fx.Inertia) -> WeakForm:
    """A free square that turns and stretches."""
    continuum = Continuum(
        box(comm, "plane strain", n=(2, 2, 1)), material, MODELS["plane strain"], order=1
    )
    term = ConservingForces(continuum, term_of(continuum, material), effect)
    return WeakForm(continuum, [term, InertiaForces(continuum, effect)])


@pytest.mark.mpi
@pytest.mark.parametrize("material", [CARBON, RUBBER], ids=["svk", "neo"])
def test_a_spinning_body_keeps_energy_and_moment_of_momentum(
    comm: MPI.Intracomm, material: Material
) -> None:
    """Over two turns in increments of a fifth of a radian; strains of a tenth."""
    effect = fx.Inertia(
        density=1.0, rho_inf=1.0, velocity=(lambda x: -2.0 * x[1] + x[0], lambda x: 2.0 * x[0])
    )
    bodies = spinning(comm, material, effect)
    inertia = bodies.terms[1]
    assert isinstance(inertia, InertiaForces)
    c = bodies.continuum

    def total() -> float:
        return sum(bodies.stored().values())

    def moment() -> float:
        """Of the momentum about the origin: v . M (z cross x)."""
        mass = inertia.mass_matrix()
        x, out = mass.createVecs()
        at = c.positions()[: c.n_local // 2, :2] + bodies.u.x.array[: c.n_local].reshape(-1, 2)
        x.array[:] = np.stack([-at[:, 1], at[:, 0]], axis=1).ravel()
        mass.mult(x, out)
        mine = float(out.array_r @ inertia.velocity.x.array[: c.n_local])
        return float(comm.allreduce(mine, op=MPI.SUM))

    energy, spin = total(), moment()
    strained = 0.0
    for i in range(60 if comm.size == 1 else 15):  # half a turn on several ranks
        bodies.begin(0.1 * (i + 1), 0.1)
        solve(bodies, [], tolerance=1e-13, most=60)
        bodies.commit()
        # the iteration leaves 1e-13 of the forces
        assert total() == pytest.approx(energy, rel=1e-10)
        assert moment() == pytest.approx(spin, rel=1e-10)
        strained = max(strained, bodies.stored()["strain_energy"])
    assert strained > 1e-3 * energy
    assert sum(bodies.spent().values()) == pytest.approx(0.0, abs=1e-10 * energy)
    bodies.destroy()


@pytest.mark.mpi
def test_what_damping_takes_is_counted(comm: MPI.Intracomm) -> None:
    """With rho_inf < 1 energies and dissipation of the method add up to the first energy."""
    effect = fx.Inertia(density=1.0, rho_inf=0.6, velocity=(lambda x: x[0] - 2.0 * x[1], 0.0))
    bodies = spinning(comm, CARBON, effect)
    energy = sum(bodies.stored().values())
    for i in range(20):
        bodies.begin(0.05 * (i + 1), 0.05)
        solve(bodies, [], tolerance=1e-13, most=60)
        bodies.commit()
        spent = bodies.spent()["numerical_dissipation"]
        assert sum(bodies.stored().values()) + spent == pytest.approx(energy, rel=1e-10)
    assert 1e-4 * energy < spent < 0.5 * energy
    bodies.destroy()


def test_a_state_that_was_restored_goes_on_alike(comm: MPI.Intracomm) -> None:
    """What the forces of the last end lack is part of the state."""
    effect = fx.Inertia(density=1.0, rho_inf=0.6, velocity=(lambda x: x[0] - 2.0 * x[1], 0.0))
    ends = []
    for interrupted in (False, True):
        bodies = spinning(comm, RUBBER, effect)
        for i in range(4):
            if i == 2 and interrupted:
                kept = bodies.state()
                bodies.destroy()
                bodies = spinning(comm, RUBBER, effect)
                bodies.restore(comm.bcast(kept))
            bodies.begin(0.05 * (i + 1), 0.05)
            solve(bodies, [], tolerance=1e-13, most=60)
            bodies.commit()
        ends.append((bodies.u.x.array.copy(), bodies.spent()["numerical_dissipation"]))
        bodies.destroy()
    assert ends[1][0] == pytest.approx(ends[0][0], abs=1e-13)
    assert ends[1][1] == pytest.approx(ends[0][1], rel=1e-9)


WARM = {
    "plane strain": fx.Orthotropic(
        E=(140.0, 10.0, 9.0), nu=(0.3, 0.25, 0.4), G=(5.0, 5.0, 3.5),
        frame=((1, 0.5, 0), (0, 1, 0)), expansion=(-1e-4, 2e-3, 3e-3),
    ),
    "plane stress": fx.ByTemperature(
        {0.0: fx.Isotropic(100.0, 0.3, 1e-3), 200.0: fx.Isotropic(60.0, 0.35, 2e-3)}
    ),
    "ring": fx.NeoHookean(100.0, 0.3, expansion=2e-3),
}  # fmt: skip


def over_time(continuum: Continuum, term: Term, along: Array, time: float) -> tuple[float, ...]:
    """Work of forces and temperature in one increment from rest at time 0, and energy gained."""
    increment = Increment(continuum, term, KEEPS, np.zeros_like(along))
    whole = increment.term
    whole.begin(time, time)
    step = time * along
    last = increment.forces(step)
    given = 0.5 * (increment.first + last) @ step
    increment.energy(step)
    whole.commit(increment._u)
    return given, whole.work(), increment.energy(step) - increment.before


def along_the_way(continuum: Continuum, term: Term, along: Array, time: float) -> float:
    """Work of the temperature on the straight way there: integral of dW/dT dT."""
    field = continuum.temperature
    assert field is not None
    u, change = wavy(continuum, 0.0, 0), dolfinx.fem.Function(field.rise.function_space)
    power = dolfinx.fem.form(ufl.derivative(term.energy(u), field.rise, change))
    change.x.array[:] = field.patterns[0].x.array
    total = 0.0
    for x, weight in zip(*np.polynomial.legendre.leggauss(5), strict=True):
        now = 0.5 * time * (1.0 + x)
        field.set(now)
        u.x.array[:] = now * along
        total += 0.5 * time * weight * dolfinx.fem.assemble_scalar(power)
    return total


@pytest.mark.parametrize("model", WARM)
def test_work_of_a_temperature_is_that_of_its_forces(model: str) -> None:
    """It is no remainder: the difference from the integral is of third order in the increment."""
    warmer = fx.Temperature(lambda x: 60.0 + 40.0 * x[0])
    continuum = Continuum(
        box(MPI.COMM_SELF, model), WARM[model], MODELS[model], order=1, temperature=warmer
    )
    along, off = wavy(continuum, 0.3, 1).x.array.copy(), []
    for time in (1.0, 0.5):
        continuum.temperature.set(0.0)
        term = term_of(continuum, WARM[model])
        given, heat, gained = over_time(continuum, term, along, time)
        assert given + heat == pytest.approx(gained, rel=1e-11)
        exact = along_the_way(continuum, term, along, time)
        assert abs(exact) > 0.05 * abs(gained)
        off.append(heat - exact)
        assert abs(off[-1]) < 0.2 * abs(gained)
    assert abs(off[1]) < abs(off[0]) / 6.0
