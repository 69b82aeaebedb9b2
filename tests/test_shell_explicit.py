"""Explicit dynamics of shells on surface meshes: frequencies, waves, increments and energies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.sheets import Sheet, sheets
from fxcrack.output.fields import has_finite_bodies

E, RHO, LENGTH, WIDTH = 70e3, 2.7e-9, 20.0, 2.0
FIRST = 1.8751040687119611
"""Wave number of the first mode of a cantilever times its length."""
SUDDEN = fx.Amplitude((0.0,), (1.0,))


def strip(
    comm: MPI.Intracomm, height: float, n: int, nu: float = 0.0, cell: str = "quadrilateral",
    order: int = 1, section: dict[str, Any] | None = None, inertia: dict[str, Any] | None = None,
    effects: tuple[Any, ...] = (), **given: Any,
) -> fx.Scene:  # fmt: skip
    """A strip along x of n cells, clamped at x = 0 unless other supports are given."""
    mesh = sheets(
        [Sheet("strip", np.linspace(0.0, LENGTH, n + 1), [0.0, WIDTH])], comm,
        cell=cell, order=order,
    )  # fmt: skip
    alloy = fx.Isotropic(E, nu, density=RHO, expansion=2e-5)
    given.setdefault("supports", [fx.Clamp("strip_a0")])
    given.setdefault("monitors", [fx.Monitor("strip_a1", (0, 0, 1), name="w")])
    return fx.Scene(
        mesh,
        model=fx.Shell(),
        materials=fx.Section(alloy, thickness=height, **(section or {})),
        effects=[fx.Inertia(**(inertia or {})), *effects],
        **given,
    )


def bending_mode(x: Any) -> Any:
    """First mode of a cantilever, 1 at the end."""
    s = FIRST * x[0] / LENGTH
    return 0.5 * (np.cosh(s) - np.cos(s) - 0.734095514 * (np.sinh(s) - np.sin(s)))


def balanced(history: fx.History, tolerance: float = 1e-9) -> bool:
    """Whether energies balance to a part of the largest of them."""
    columns = ("kinetic_energy", "strain_energy", "external_work")
    size = max(np.abs(history[c].astype(float)).max() for c in columns)
    return bool(np.abs(history["balance"].astype(float)).max() <= tolerance * size)


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_frequency_of_a_cantilever(comm: MPI.Intracomm, cell: str) -> None:
    """The end of a thin strip comes back after half a period of Euler and Bernoulli's beam.

    The directors' inertia lowers the frequency by 0.4 % at this size of the cells, their lumped
    mass by as little; 1 % is what is asked for.
    """
    height, n = 0.2, 16
    omega = (FIRST / LENGTH) ** 2 * np.sqrt(E * height**2 / (12.0 * RHO))
    scene = strip(comm, height, n, cell=cell, inertia={"velocity": (0.0, 0.0, bending_mode)})
    history = scene.run(fx.Explicit(until=fx.Time(3.4 / omega), rows=40), progress=False)
    t, w = (history[c].astype(float) for c in ("time", "m[w]"))
    down = int(np.flatnonzero((w[1:] < 0.0) & (w[:-1] >= 0.0))[0])
    zero = t[down] + (t[down + 1] - t[down]) * w[down] / (w[down] - w[down + 1])
    assert np.pi / omega / zero == pytest.approx(1.0, abs=0.01)
    assert balanced(history)
    part = history["mass_scaling_energy"].astype(float).max()
    assert 0.0 < part < 0.04 * history["kinetic_energy"].astype(float).max()


@pytest.mark.mpi
@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_increment_is_that_of_membrane_waves(comm: MPI.Intracomm, nu: float) -> None:
    """The increment hangs on the size of the cells, not on the thickness: 1/10 to 1/1000.

    Membrane waves allow l/c; Poisson's ratio makes cells stiffer whose directors are slow.
    """
    beta = 4.0
    found, factors = [], []
    for height in (LENGTH / 10.0, LENGTH / 1000.0):
        scene = strip(comm, height, 20, nu)
        history = scene.run(fx.Explicit(until=fx.Time(1e-6), rows=2), progress=False)
        found.append(history.details["stable_increment"] * np.sqrt(E / RHO) / (LENGTH / 20))
        factors.append(history.details["director_inertia"])
    assert found[1] == pytest.approx(found[0], rel=0.05)
    assert 0.8 < found[0] < 1.01
    # 1 + beta l^2/h^2 with beta = 4 C_33/C_11 of one material
    np.testing.assert_allclose(factors, [1.0 + beta / 4.0, 1.0 + beta * 2500.0], rtol=1e-9)


@pytest.mark.mpi
def test_membrane_wave(comm: MPI.Intracomm) -> None:
    """A sudden pull at the end arrives at the wall after L/c and is there twice as large."""
    wave, n = np.sqrt(E / RHO), 60
    scene = strip(
        comm, 0.5, n, monitors=[fx.Monitor("strip_a1", (1, 0, 0), name="end")],
        supports=[fx.Displacement("strip_a0", x=0.0, y=0.0, z=0.0, name="wall")],
        loads=[fx.Traction("strip_a1", (1.0, 0.0, 0.0), amplitude=SUDDEN)],
    )  # fmt: skip
    history = scene.run(fx.Explicit(until=fx.Time(1.9 * LENGTH / wave), rows=190), progress=False)
    t, end = history["time"].astype(float) * wave / LENGTH, history["m[end]"].astype(float)
    # one-dimensional waves: the end moves with traction/(rho c h) until the wave is back
    speed = (np.interp(1.8, t, end) - np.interp(0.2, t, end)) / (1.6 * LENGTH / wave)
    assert speed == pytest.approx(1.0 / (0.5 * RHO * wave), rel=0.01)
    wall = np.abs(history["R[wall.x]"].astype(float)) / WIDTH
    first = t[int(np.argmax(wall > 1.0))]  # half of the 2 that follows
    assert first == pytest.approx(1.0, abs=0.03)  # two cells: waves of mesh length lag behind
    assert np.mean(wall[(t > 1.1)]) == pytest.approx(2.0, rel=0.03)
    assert balanced(history)


@pytest.mark.mpi
@pytest.mark.three
def test_histories_do_not_depend_on_ranks(comm: MPI.Intracomm) -> None:
    """Loads of all kinds on a strip whose end is turned: numbers of one rank on any number."""
    ramp = fx.SmoothStep((0.0, 2e-5), (0.0, 1.0))
    scene = strip(
        comm, 0.3, 12, 0.3,
        supports=[fx.Clamp("strip_a0"), fx.Rotation("strip_a1", y=0.02, amplitude=ramp)],
        loads=[
            fx.Pressure(fx.Face("strip", "top"), 0.1, amplitude=SUDDEN),
            fx.Traction("strip_b1", (0.0, 1.0, 0.2), amplitude=ramp),
            fx.Moment("strip_b0", (0.1, 0.0, 0.0), amplitude=SUDDEN),
        ],
        inertia={"rayleigh": (2e3, 0.0), "velocity": (0.0, 10.0, 5.0)},
    )  # fmt: skip
    history = scene.run(fx.Explicit(until=fx.Time(5e-5), rows=10), progress=False)
    alone = strip(
        MPI.COMM_SELF, 0.3, 12, 0.3,
        supports=[fx.Clamp("strip_a0"), fx.Rotation("strip_a1", y=0.02, amplitude=ramp)],
        loads=[
            fx.Pressure(fx.Face("strip", "top"), 0.1, amplitude=SUDDEN),
            fx.Traction("strip_b1", (0.0, 1.0, 0.2), amplitude=ramp),
            fx.Moment("strip_b0", (0.1, 0.0, 0.0), amplitude=SUDDEN),
        ],
        inertia={"rayleigh": (2e3, 0.0), "velocity": (0.0, 10.0, 5.0)},
    )  # fmt: skip
    reference = alone.run(fx.Explicit(until=fx.Time(5e-5), rows=10), progress=False)
    assert history.details["dt"] == pytest.approx(reference.details["dt"], rel=1e-9)
    for column in ("m[w]", "kinetic_energy", "strain_energy", "external_work"):
        mine, theirs = (h[column].astype(float) for h in (history, reference))
        np.testing.assert_allclose(mine, theirs, rtol=1e-8, atol=1e-9 * np.abs(theirs).max())
    assert balanced(history)


def test_operators_scaled_mass_and_large_rotation(comm: MPI.Intracomm) -> None:
    """Product and assembly give one motion; mass for dt; large rotations balance to dt^2."""
    found = []
    given: dict[str, Any] = {"inertia": {"velocity": (0.0, 0.0, bending_mode)}}
    for operator in ("product", "assembly"):
        step = fx.Explicit(until=fx.Time(2e-5), rows=4, operator=operator)
        found.append(strip(comm, 0.2, 8, 0.3, **given).run(step, progress=False)["m[w]"])
    np.testing.assert_allclose(found[0].astype(float), found[1].astype(float), rtol=1e-9)
    dt = 1.5 * LENGTH / 8.0 / np.sqrt(E / RHO)
    step = fx.Explicit(until=fx.Time(1e-4), rows=4, dt=dt, mass_scale="dt")
    scaled = strip(comm, 0.2, 8, 0.3, **given).run(step, progress=False)
    assert scaled.details["stable_increment"] >= dt and balanced(scaled)
    scene = strip(
        comm, 0.2, 8, 0.3, effects=(fx.FiniteStrain(),),
        inertia={"velocity": (0.0, 0.0, lambda x: 4e4 * bending_mode(x))},
    )  # fmt: skip
    turning = scene.run(fx.Explicit(until=fx.Time(6e-5), rows=4), progress=False)
    assert has_finite_bodies(scene.analysis)  # files show the stresses of large rotation
    assert np.abs(turning["m[w]"].astype(float)).max() > 0.1 * LENGTH
    assert balanced(turning, 1e-3)


def test_temperature_and_start_in_equilibrium(comm: MPI.Intracomm) -> None:
    """A heated strip on rollers starts at rest in its static state and stays there."""
    heat = fx.Temperature(100.0, amplitude=SUDDEN)
    scene = strip(
        comm, 0.5, 8, effects=(heat,),
        supports=[fx.Clamp("strip_a0")],
        monitors=[fx.Monitor("strip_a1", (1, 0, 0), name="end")],
    )  # fmt: skip
    step = fx.Explicit(until=fx.Time(1e-4), rows=5, start="equilibrium")
    history = scene.run(step, progress=False)
    np.testing.assert_allclose(history["m[end]"].astype(float), 2e-5 * 100.0 * LENGTH, rtol=1e-9)


def test_restart_goes_on(comm: MPI.Intracomm, tmp_path: Path) -> None:
    """A run taken up at its checkpoint ends where the uninterrupted one does."""

    def make() -> fx.Scene:
        return strip(comm, 0.2, 8, inertia={"velocity": (0.0, 0.0, bending_mode)})

    class Enough(Exception):
        """Ends the run from inside."""

    def stop(event: str, row: dict[str, Any]) -> None:
        if float(row["time"]) > 2e-5:
            raise Enough

    step = fx.Explicit(until=fx.Time(4e-5), rows=8)
    whole = make().run(step, progress=False)
    kept, first = fx.Checkpoint(tmp_path / "run.npz", every=1), make()
    with pytest.raises(Enough):
        first.run(step, checkpoint=kept, observers=[stop], progress=False)
    first.close()
    again = make().run(step, checkpoint=kept, restart=True, progress=False)
    assert again["time"][-1] == whole["time"][-1]
    assert float(again["m[w]"][-1]) == pytest.approx(float(whole["m[w]"][-1]), rel=1e-9)
    assert balanced(again)


def explicit(scene: fx.Scene, **given: Any) -> Any:
    """Run a scene briefly."""
    return scene.run(fx.Explicit(until=fx.Time(1e-6), **given), progress=False)


def test_refusals(comm: MPI.Intracomm) -> None:
    """What explicit dynamics of shells does not have is named."""
    with pytest.raises(fx.InputError, match="first-order elements"):
        explicit(strip(comm, 0.5, 4, order=2))
    with pytest.raises(fx.InputError, match="bulk viscosity"):
        explicit(strip(comm, 0.5, 4), bulk=(0.06, 1.2))
    section = fx.Section(fx.Isotropic(E, 0.3, density=RHO), thickness=1.0)
    plate = sheets([Sheet("flat", np.linspace(0.0, 8.0, 5), [0.0, 2.0])], comm)
    scene = fx.Scene(
        plate, model=fx.Shell(), materials=section, effects=[fx.Inertia()],
        supports=[fx.Coupling("flat_a1", (8.0, 0.0, 0.0))],
    )  # fmt: skip
    with pytest.raises(fx.InputError, match="couplings and equations"):
        explicit(scene)
