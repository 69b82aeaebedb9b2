"""Loads and materials of explicit dynamics against waves in bars, and amplitudes of all steps.

Units N, mm, s, tonne.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.integrate
from mpi4py import MPI
from test_explicit import G_IC, beam, coarse, imbalance, until

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d

E, RHO = 70e3, 2.7e-9
SPEED = float(np.sqrt(E / RHO))
HEIGHT = 10.0


def bar(comm: MPI.Intracomm, *, n: int = 20, material: Any = None, **options: Any) -> fx.Scene:
    """An upright bar of two halves of one column of n cells each, tied to each other."""
    interface = fx.Interface("upper_face", "lower_face", name="tie")
    options.setdefault("effects", [fx.Inertia()])
    return fx.Scene(
        dcb_2d(comm, length=0.5, height=HEIGHT, dx=0.5, ny=n),
        materials=material or fx.Isotropic(E, 0.0, density=RHO),
        bonds=[interface],
        monitors=[fx.Monitor("top", (0.0, 1.0), "top"), fx.Monitor("bottom", (0.0, 1.0), "low")],
        **{"model": fx.PlaneStress(), **options},
    )


def ran(scene: fx.Scene, time: float, **options: Any) -> fx.History:
    history = scene.run(fx.Explicit(until=fx.Time(time), **{"rows": 60, **options}))
    scene.close()
    return history


# -- amplitudes ------------------------------------------------------------------------------------


def test_smooth_steps_and_integrals() -> None:
    step = fx.SmoothStep((0.0, 2.0, 3.0), (0.0, 1.0, 0.5))
    assert [step(t) for t in (-1.0, 0.0, 1.0, 2.0, 2.5, 9.0)] == pytest.approx(
        [0.0, 0.0, 0.5, 1.0, 0.75, 0.5]
    )
    near = 1e-4
    assert abs(step(near) - step(0.0)) < near**2  # no jump of the slope, nor of the curvature
    way = fx.Integral(step, 0.3)
    for t in (0.7, 2.4, 5.0):
        known, _ = scipy.integrate.quad(step, 0.0, t, points=[2.0, 3.0], epsabs=1e-13)
        assert way(t) == pytest.approx(0.3 + known, rel=1e-12)
    assert way(-1.0) == pytest.approx(0.3)
    for curve in (step, way):
        # chords between the breaks are within 0.1 % of the change
        t = np.linspace(0.0, 3.0, 1001)
        exact = np.array([curve(x) for x in t])
        at = curve.breaks()
        chords = np.interp(t, at, [curve(x) for x in at])
        assert np.abs(chords - exact).max() <= 1e-3 * np.ptp(exact)
    moved = fx.Displacement.by_velocity("top", y=3.0)
    assert moved.amplitude(2.0) * 3.0 == pytest.approx(6.0)
    push = fx.Amplitude((0.0, 1.0, 1.001), (1.0, 1.0, 0.0))
    hit = fx.Displacement.by_acceleration("top", y=2.0, amplitude=push)
    assert hit.amplitude(1.0) == pytest.approx(0.5)
    with pytest.raises(fx.InputError, match="end with 0"):
        fx.Displacement.by_acceleration("top", y=2.0, amplitude=fx.Amplitude((0.0,), (1.0,)))
    with pytest.raises(fx.InputError, match="must be an Amplitude"):
        fx.Integral(fx.Ramp())  # type: ignore[arg-type]
    with pytest.raises(fx.InputError, match="2 times but 1 values"):
        fx.SmoothStep((0.0, 1.0), (0.0,))


def test_static_steps_follow_smooth_amplitudes() -> None:
    """The opening at the first release is the same whatever leads there, its time the curve's."""
    times = []
    smooth = fx.SmoothStep((0.0, 4.0), (0.0, 4.0))
    for amplitude in (fx.Ramp(), smooth):
        supports = [
            fx.Displacement("pin_top", x=0.0, y=1.0, amplitude=amplitude),
            fx.Displacement("pin_bottom", x=0.0, y=-1.0, amplitude=amplitude),
        ]
        scene = beam(
            MPI.COMM_SELF, 1.0, mesh=coarse(MPI.COMM_SELF), effects=[], supports=supports,
            release=fx.StepRelease(),
        )  # fmt: skip
        history = scene.run(fx.Static(until=fx.Releases(1)))
        scene.close()
        times.append(float(history["time"][-1]))
    assert smooth(times[1]) == pytest.approx(times[0], rel=2e-3)


# -- waves in a bar --------------------------------------------------------------------------------


@pytest.mark.mpi
def test_a_pulse_of_pressure_travels(comm: MPI.Intracomm) -> None:
    """A pulse leaves the end with twice the way of the wave, 2 int p dt/(rho c), and comes back."""
    pulse = 0.5 * HEIGHT / SPEED
    shape = fx.SmoothStep((0.0, 0.5 * pulse, pulse), (0.0, 1.0, 0.0))
    history = ran(
        bar(comm, loads=[fx.Pressure("top", 10.0, amplitude=shape)]), 3.0 * HEIGHT / SPEED
    )
    way = 10.0 * 0.5 * pulse / (RHO * SPEED)
    # at 3 of 4 half periods: the pulse has left the far end, its return to the top is to come
    assert history["m[top]"][-1] == pytest.approx(-way, rel=5e-3)
    assert history["m[low]"][-1] == pytest.approx(-2.0 * way, rel=5e-3)
    assert imbalance(history) <= 1e-11


@pytest.mark.mpi
def test_a_velocity_and_an_acceleration_send_waves(comm: MPI.Intracomm) -> None:
    rise, v = 0.4 * HEIGHT / SPEED, 1e3
    by_velocity = fx.Displacement.by_velocity(
        "top", y=-v, amplitude=fx.SmoothStep((0.0, rise), (0.0, 1.0))
    )
    slope = fx.Amplitude((0.0, 0.5 * rise, rise), (0.0, 2.0 / rise, 0.0))
    by_acceleration = fx.Displacement.by_acceleration("top", y=-v, amplitude=slope)
    for support in (by_velocity, by_acceleration):
        history = ran(bar(comm, supports=[support]), 1.5 * HEIGHT / SPEED)
        # the reaction behind the front is rho c v, and the way v (t - rise/2)
        assert history["R[top.y]"][-1] == pytest.approx(-RHO * SPEED * v * 0.5, rel=1e-2)
        late = history["time"][-1] - 0.5 * rise
        assert history["m[top]"][-1] == pytest.approx(-v * late, rel=1e-6)
        assert imbalance(history) <= 1e-11


@pytest.mark.mpi
def test_pressures_that_follow(comm: MPI.Intracomm) -> None:
    """A pressure all around a body that turns as a whole gives it neither force nor moment."""
    given = 5e4
    spin = (lambda x: -given * x[1], lambda x: given * (x[0] - 0.25))
    held = fx.Amplitude((0.0,), (1.0,))
    rubber = fx.NeoHookean(E, 0.3, density=RHO)
    loads = [
        fx.Pressure(name, 500.0, amplitude=held, name=name, follows=True)
        for name in ("top", "bottom", "end_upper", "end_lower", "far_upper", "far_lower")
    ]
    effects = [fx.Inertia(velocity=spin)]
    turned = bar(comm, n=10, material=rubber, loads=loads, effects=effects, model=fx.PlaneStrain())
    history = ran(turned, 1.2 / given, rows=10)
    # the moment of pressures that keep their direction would be 2 p V sin(angle), and turn it five
    # times as fast by then; waves of the start and centrifugal strain are 1 %
    angle = history["time"].astype(float) * given
    rigid = HEIGHT * (np.cos(angle) - 1.0)
    assert np.abs(history["m[top]"].astype(float) - rigid).max() <= 0.02 * HEIGHT
    assert np.abs(history["m[top]"].astype(float) + history["m[low]"]).max() <= 1e-6 * HEIGHT
    assert np.abs(history["balance"]).max() <= 1e-4 * history["kinetic_energy"].max()
    assert abs(history["external_work"][-1]) > 0.0


@pytest.mark.mpi
def test_heat_stretches_and_stresses(comm: MPI.Intracomm) -> None:
    """A free bar gets longer by alpha T, heated slowly; one held at both ends keeps E alpha T."""
    alpha, rise = 2e-5, 100.0
    material = fx.Isotropic(E, 0.0, density=RHO, expansion=alpha)
    slow = 20.0 * 2.0 * HEIGHT / SPEED
    heat = fx.Temperature(rise, amplitude=fx.SmoothStep((0.0, slow), (0.0, 1.0)))
    held = [fx.Displacement("top", y=0.0), fx.Displacement("bottom", y=0.0)]
    for supports in ([], held):
        scene = bar(comm, n=8, material=material, supports=supports, effects=[fx.Inertia(), heat])
        history = ran(scene, 1.2 * slow, rows=20)
        if supports:
            stress = history["R[bottom.y]"][-1] / 0.5
            assert stress == pytest.approx(E * alpha * rise, rel=1e-3)
            stored = 0.5 * E * (alpha * rise) ** 2 * 0.5 * 2.0 * HEIGHT
            assert history["strain_energy"][-1] == pytest.approx(stored, rel=2e-3)
        else:
            assert history["m[top]"][-1] - history["m[low]"][-1] == pytest.approx(
                alpha * rise * 2.0 * HEIGHT, rel=1e-3
            )
            assert history["strain_energy"][-1] <= 1e-3 * E * (alpha * rise) ** 2 * HEIGHT
        assert np.abs(history["balance"]).max() <= 1e-9 * history["external_work"].max()


@pytest.mark.mpi
def test_bulk_viscosity_calms_a_shock(comm: MPI.Intracomm) -> None:
    """A bar that meets a wall: the stress behind the shock is rho c v, with less ringing."""
    held = [fx.Displacement("bottom", y=0.0)]
    stiff = fx.Isotropic(E, 0.3, density=RHO)
    c = float(np.sqrt(E / (1.0 - 0.3**2) / RHO))
    over = {}
    # the fastest is compressed by 5 %: quadratic viscosity takes a third of the increment
    for bulk, speed in (((0.0, 0.0), 1e4), ((0.06, 1.2), 1e4), ((0.06, 1.2), 5e5)):
        sides = [fx.Displacement("end_upper", x=0.0), fx.Displacement("end_lower", x=0.0)]
        sides += [fx.Displacement("far_upper", x=0.0), fx.Displacement("far_lower", x=0.0)]
        scene = bar(
            comm, material=stiff, supports=[*held, *sides],
            effects=[fx.Inertia(velocity=(0.0, -speed))],
        )  # fmt: skip
        history = ran(scene, 1.8 * HEIGHT / c, rows=60, bulk=bulk)
        force = history["R[bottom.y]"].astype(float)[12:]
        known = RHO * c * speed * 0.5
        over.setdefault(bulk, float(np.std(force) / known))
        assert history.reason.endswith("reached")
        assert force.mean() == pytest.approx(known, rel=0.02)
        assert np.abs(history["balance"]).max() <= 1e-11 * history["initial_energy"][0]
    assert history["viscous_energy"][-1] > 0.0
    assert np.all(np.diff(history["viscous_energy"].astype(float)) >= 0.0)
    assert over[(0.06, 1.2)] < 0.7 * over[(0.0, 0.0)]
    dt = history["dt"].astype(float)
    assert 0.5 < dt.min() / dt[0] < 0.8
    assert history.details["stable_increment"] > 0.0


@pytest.mark.mpi
def test_plastic_waves(comm: MPI.Intracomm) -> None:
    """A bar in uniaxial strain hit at v: an elastic precursor, then the plastic wave.

    Behind both, the velocities of the jumps add up: v = Y'/(rho c_e) + (sigma - Y')/(rho c_p), with
    Y' = Y (1 - nu)/(1 - 2 nu) the Hugoniot elastic limit, and c_p of the modulus of uniaxial strain
    under flow, K + 4/3 mu H/(3 mu + H) (Wood, J. Appl. Mech. 19, 1952, with hardening H).
    """
    nu, yielding, hardening = 0.3, 200.0, 5e3
    mu, bulk = E / (2.0 * (1.0 + nu)), E / (3.0 * (1.0 - 2.0 * nu))
    material = fx.Plastic(E, nu, yield_stress=yielding, hardening=hardening, density=RHO)
    sides = [
        fx.Displacement(name, x=0.0)
        for name in ("end_upper", "end_lower", "far_upper", "far_lower")
    ]
    v, rise = 5e4, 1e-7
    driven = fx.Displacement.by_velocity(
        "top", y=-v, amplitude=fx.SmoothStep((0.0, rise), (0.0, 1.0))
    )
    scene = bar(comm, material=material, supports=[*sides, driven], model=fx.PlaneStrain())
    c_e = np.sqrt((bulk + 4.0 * mu / 3.0) / RHO)
    c_p = np.sqrt((bulk + 4.0 / 3.0 * mu * hardening / (3.0 * mu + hardening)) / RHO)
    history = ran(scene, 1.6 * HEIGHT / c_e, rows=60, bulk=(0.06, 1.2))
    limit = yielding * (1.0 - nu) / (1.0 - 2.0 * nu)
    stress = limit + RHO * c_p * (v - limit / (RHO * c_e))
    force = -history["R[top.y]"].astype(float)[30:] / 0.5
    assert force.mean() == pytest.approx(stress, rel=0.01)
    assert stress > 1.5 * limit
    assert history["plastic_energy"][-1] > 0.0
    # energies of bodies that yield are told by one end of the increment: first order at its jumps
    assert imbalance(history) <= 2e-3


@pytest.mark.slow
def test_restart_of_bodies_that_yield(tmp_path: Path) -> None:
    def scene() -> fx.Scene:
        material = fx.Plastic(E, 0.3, yield_stress=100.0, hardening=1e3, density=RHO)
        pull = fx.Displacement.by_velocity("top", y=4e4)
        return bar(MPI.COMM_SELF, n=8, material=material, supports=[pull], model=fx.PlaneStrain())

    end = 3.0 * HEIGHT / SPEED
    whole = ran(scene(), end)
    first = scene()
    seen = []

    class Enough(Exception):
        """Ends the run from inside."""

    def stop(event: str, row: dict[str, Any]) -> None:
        seen.append(event)
        if len(seen) == 30:
            raise Enough

    kept = fx.Checkpoint(tmp_path / "run.npz", every=1)
    step = fx.Explicit(until=fx.Time(end), rows=60)
    with pytest.raises(Enough):
        first.run(step, checkpoint=kept, observers=[stop])
    first.close()
    second = scene()
    again = second.run(step, checkpoint=kept, restart=True)
    second.close()
    for name in ("strain_energy", "plastic_energy", "kinetic_energy", "external_work"):
        a, b = again[name].astype(float), whole[name].astype(float)
        assert np.abs(a - b).max() <= 1e-9 * np.abs(b).max(), name


def test_what_is_refused() -> None:
    with pytest.raises(fx.InputError, match="two numbers"):
        fx.Explicit(until=fx.Time(1.0), bulk=0.06)  # type: ignore[arg-type]
    for wrong, words in (((2.0, 1.2), "linear bulk"), ((0.06, 1e6), "quadratic bulk")):
        with pytest.raises(fx.InputError, match=words):
            fx.Explicit(until=fx.Time(1.0), bulk=wrong)
    scene = bar(MPI.COMM_SELF, effects=[fx.Inertia(), fx.FiniteStrain()])
    with pytest.raises(fx.InputError, match="small strain"):
        scene.run(fx.Explicit(until=fx.Time(1e-6), bulk=(0.06, 1.2)))
    scene.close()
    plastic = fx.Plastic(E, 0.3, yield_stress=100.0, density=RHO)
    scene = bar(MPI.COMM_SELF, material=plastic, model=fx.PlaneStrain())
    with pytest.raises(fx.InputError, match="begin at rest"):
        scene.run(fx.Explicit(until=fx.Time(1e-6), start="equilibrium"))
    scene.close()


@pytest.mark.slow
def test_a_crack_grows_under_heat_and_a_following_pressure() -> None:
    """Faces of a DCB are driven by a pressure pulse that follows them; the toughness is spent."""
    pulse = fx.SmoothStep((0.0, 2e-5), (0.0, 1.0))
    arms = [
        fx.Pressure(face, 6.0, amplitude=pulse, name=face, follows=True)
        for face in ("end_upper", "end_lower")
    ]
    warm = fx.Isotropic(70e3, 0.3, density=2.7e-9, expansion=2e-5)
    heat = fx.Temperature(lambda x: 20.0 * x[1], amplitude=fx.SmoothStep((0.0, 1e-4), (0.0, 1.0)))
    scene = beam(
        MPI.COMM_SELF, 8e3, mesh=coarse(MPI.COMM_SELF), loads=arms, materials=warm,
        effects=[fx.Inertia(), heat],
    )  # fmt: skip
    history = scene.run(until(scene, 36.0, 3e-4, rows=40))
    scene.close()
    assert history["a[bond]"][-1] >= 36.0
    assert history["spent[bond]"][-1] == pytest.approx(G_IC, rel=1e-10)
    assert imbalance(history) <= 1e-10
