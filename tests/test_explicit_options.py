"""Options of explicit dynamics: release laws, contact, mass, damping, restart, output."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from test_explicit import ALUMINIUM, G_IC, beam, coarse, imbalance, until

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d

SPEED = 8e3


def run(scene: fx.Scene, length: float = 36.0, **options: Any) -> fx.History:
    history = scene.run(until(scene, length, 3e-4, **{"rows": 40, **options}))
    scene.close()
    return history


@pytest.mark.parametrize(
    "options",
    [
        {"release": fx.ProgressiveRelease(zone=2)},
        {"release": fx.RampRelease()},
        {"release": fx.RampRelease(increments=20)},
        {"release": fx.StepRelease(), "criterion": fx.VCCT(GIc=G_IC, viscosity=1e-6)},
        {"release": fx.StepRelease()},
    ],
    ids=["zone 2", "ramp", "increments", "viscosity", "step"],
)
def test_energies_balance_with_every_release_law(options: dict[str, Any]) -> None:
    history = run(beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF), **options))
    assert history["a[bond]"][-1] >= 36.0
    assert imbalance(history) <= 1e-10
    if isinstance(options["release"], fx.ProgressiveRelease):
        # a bond that is pressed shut while it softens is solved in sweeps together with contact
        assert history["spent[bond]"][-1] == pytest.approx(G_IC, rel=2e-6)


def test_condensed_steps_have_one_element_of_softening() -> None:
    scene = beam(
        MPI.COMM_SELF, 1.0, mesh=coarse(MPI.COMM_SELF), release=fx.ProgressiveRelease(zone=2),
        effects=[],
    )  # fmt: skip
    with pytest.raises(fx.InputError, match="fast cracks"):
        scene.run(fx.Static(until=fx.Releases(1)))
    scene.close()


@pytest.mark.slow
def test_penalty_contact_lets_faces_overlap_a_little() -> None:
    exact = run(beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF)))
    scene = beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF))
    soft = run(scene, contact="penalty", penalty=0.2)
    assert imbalance(soft) <= 1e-10
    # the same crack: the penalty is a fifth of m/dt^2, far above the stiffness of the cells
    assert soft["time"][-1] == pytest.approx(exact["time"][-1], rel=0.05)


def test_friction_dissipates() -> None:
    """A block slides to rest on another: v^2/(2 mu g) where the pressure presses with m g."""
    width, height, mu, speed = 4.0, 1.0, 0.3, 50.0
    interface = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: np.zeros(x.shape[1], bool), name="faces",
        contact=True, friction=mu,
    )  # fmt: skip
    rho, pressure = 2.7e-9, 0.1
    scene = fx.Scene(
        dcb_2d(MPI.COMM_SELF, length=width, height=height, dx=0.5, ny=2),
        materials=fx.Isotropic(70e3, 0.0, density=rho),
        model=fx.PlaneStress(),
        supports=[fx.Displacement("lower", x=0.0, y=0.0)],
        loads=[fx.Pressure("top", pressure, amplitude=fx.Amplitude((0.0,), (1.0,)))],
        debonds=[fx.Debond(interface, fx.VCCT(GIc=G_IC))],
        monitors=[fx.Monitor("top", (1.0, 0.0), "slide")],
        effects=[fx.Inertia(velocity=(lambda x: np.where(x[1] > 0.0, speed, 0.0), 0.0))],
    )
    slowing = mu * pressure / (rho * height)
    stop = speed / slowing
    history = scene.run(fx.Explicit(until=fx.Time(2.0 * stop), rows=50))
    scene.close()
    way = 0.5 * speed**2 / slowing
    # vertical oscillations change the pressure about its mean
    assert history["m[slide]"][-1] == pytest.approx(way, rel=0.05)
    kinetic = 0.5 * rho * width * height * speed**2
    assert history["friction_energy"][-1] == pytest.approx(kinetic, rel=0.05)
    assert abs(history["balance"]).max() <= 1e-10 * kinetic


@pytest.mark.slow
def test_mass_scaling_and_damping() -> None:
    plain = beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF))
    first = plain.run(fx.Explicit(until=fx.Time(1e-5), rows=5))
    stable = first.details["stable_increment"]
    plain.close()
    scene = beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF))
    heavy = scene.run(fx.Explicit(until=fx.Time(1e-5), rows=5, mass_scale=4.0))
    scene.close()
    assert heavy.details["stable_increment"] == pytest.approx(2.0 * stable, rel=1e-6)
    assert heavy["mass_scaling_energy"][-1] == pytest.approx(
        0.75 * heavy["kinetic_energy"][-1], rel=1e-9
    )
    scene = beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF))
    step = fx.Explicit(until=fx.Time(1e-5), rows=5, dt=1.5 * stable, mass_scale="dt")
    chosen = scene.run(step)
    scene.close()
    assert chosen.details["stable_increment"] >= 1.5 * stable
    assert imbalance(chosen) <= 1e-10
    damped = beam(
        MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF), effects=[fx.Inertia(rayleigh=(1e4, 0.0))]
    )
    history = run(damped)
    assert history["damping_energy"][-1] > 0.0
    assert imbalance(history) <= 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["svk", "neo"])
def test_finite_strain_balances(kind: str) -> None:
    effects: list[Any] = [fx.Inertia(density=2.7e-9)]
    material: Any = ALUMINIUM
    if kind == "svk":
        effects.append(fx.FiniteStrain())
    else:
        material = fx.NeoHookean(70e3, 0.3)
    interface = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 30.0 - 1e-9, name="bond", contact=True
    )
    scene = fx.Scene(
        coarse(MPI.COMM_SELF),
        materials=material,
        model=fx.PlaneStrain(thickness=20.0),
        supports=[
            fx.Displacement("pin_top", x=0.0, y=SPEED),
            fx.Displacement("pin_bottom", x=0.0, y=-SPEED),
        ],
        debonds=[fx.Debond(interface, fx.VCCT(GIc=G_IC))],
        effects=effects,
    )
    history = run(scene)
    assert history["a[bond]"][-1] >= 36.0
    # of the second order in the increment
    assert imbalance(history) <= 1e-4
    # the area that softens is taken on the deformed face, which is stretched by 1e-3 here
    assert history["spent[bond]"][-1] == pytest.approx(G_IC, rel=3e-3)


def test_axisymmetric_scene_balances() -> None:
    """A disc torn off a disc from its axis: a ring of toughness opens."""
    interface = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 10.0 - 1e-9, name="bond", contact=True
    )
    scene = fx.Scene(
        dcb_2d(MPI.COMM_SELF, length=30.0, height=1.5, dx=1.0, ny=2),
        materials=ALUMINIUM,
        model=fx.Axisymmetric(),
        supports=[
            fx.Displacement("end_upper", x=0.0), fx.Displacement("end_lower", x=0.0),
            fx.Displacement("pin_top", y=8e3), fx.Displacement("pin_bottom", y=-8e3),
        ],
        debonds=[fx.Debond(interface, fx.VCCT(GIc=G_IC))],
        effects=[fx.Inertia()],
    )  # fmt: skip
    history = run(scene, 13.0)
    assert history["a[bond]"][-1] >= 13.0
    assert imbalance(history) <= 1e-10
    assert history["spent[bond]"][-1] == pytest.approx(G_IC, rel=1e-10)


@pytest.mark.slow
def test_restart_goes_on_as_it_would_have(tmp_path: Path) -> None:
    whole = run(beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF)))
    scene = beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF))
    step = until(scene, 36.0, 3e-4, rows=40)
    seen = []

    class Enough(Exception):
        """Ends the run from inside."""

    def stop(event: str, row: dict[str, Any]) -> None:
        seen.append(event)
        if len(seen) == 12:
            raise Enough

    kept = fx.Checkpoint(tmp_path / "run.npz", every=1)
    with pytest.raises(Enough):
        scene.run(step, checkpoint=kept, observers=[stop])
    scene.close()
    scene = beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF))
    again = scene.run(until(scene, 36.0, 3e-4, rows=40), checkpoint=kept, restart=True)
    scene.close()
    assert [r["event"] for r in again] == [r["event"] for r in whole]
    for name in ("time", "a[bond]", "strain_energy", "kinetic_energy", "external_work"):
        a, b = again[name].astype(float), whole[name].astype(float)
        assert np.abs(a - b).max() <= 1e-9 * np.abs(b).max(), name


def test_fields_bonds_and_explanation(tmp_path: Path) -> None:
    scene = beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF))
    scene.run(until(scene, 34.0, 3e-4, rows=10))
    fx.write_fields(scene, tmp_path / "fields.pvd")
    assert (tmp_path / "fields.pvd").is_file()
    table = fx.bond_table(scene)
    assert "bonds released" in table
    text = str(scene.explain())
    for word in ("explicit", "increment", "operator"):
        assert word in text, text
    scene.close()


def test_energies_balance_where_the_increment_changes() -> None:
    scene = beam(MPI.COMM_SELF, SPEED, mesh=coarse(MPI.COMM_SELF))
    for n, safety in enumerate((0.9, 0.5, 0.97)):
        history = scene.run(until(scene, 40.0, 1e-4 + 2e-5 * n, rows=10, safety=safety))
    scene.close()
    assert history["dt"].max() / history["dt"].min() == pytest.approx(0.97 / 0.5, rel=0.05)
    assert abs(history["dt_energy"][-1]) > 1e-6 * history["external_work"][-1]
    assert imbalance(history) <= 1e-10


@pytest.mark.quick("matching")
@pytest.mark.parametrize("nx_lower", [None, 44], ids=["matching", "not matching"])
def test_bonds_soften_beside_friction(nx_lower: int | None) -> None:
    """Arms pressed on each other are sheared apart: bonds soften, faces slide under pressure."""
    scene = beam(
        MPI.COMM_SELF, 0.0, mesh=coarse(MPI.COMM_SELF, nx_lower=nx_lower), friction=0.4,
        release=fx.ProgressiveRelease(zone=2),
        supports=[
            fx.Displacement("end_upper", x=1.2e4), fx.Displacement("end_lower", x=-1.2e4),
            fx.Displacement("bottom", y=0.0),
        ],
        loads=[fx.Pressure("top", 20.0, amplitude=fx.Amplitude((0.0,), (1.0,)))],
    )  # fmt: skip
    history = scene.run(until(scene, 36.0, 6e-5, rows=40))
    scene.close()
    assert history["a[bond]"][-1] >= 34.0
    assert history["friction_energy"][-1] > 0.0
    assert imbalance(history) <= 1e-10
    # softening, contact and friction are found together, so bonds spend exactly their toughness;
    # shared masters are solved in sweeps
    assert history["spent[bond]"][-1] == pytest.approx(G_IC, rel=2e-6)
