"""The check of the energy balance that every step ends with, and energies that no load gives."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from mpi4py import MPI
from specimens import HELD_FAR, PINS, STEEL, bond

import fxcrack as fx
from fxcrack.history import History
from fxcrack.meshes.blocks import Blocks, build
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.steps import quasi_static
from fxcrack.steps.energy_check import REFUSED, WARNED, check_energy


def rows_of(comm: MPI.Intracomm, off: float, **columns: float) -> History:
    """Loading to a work of 2, then off by a part of it, then unloading."""
    history = History(comm)
    for time, work, balance in ((1.0, 1.0, 0.0), (2.0, 2.0, 2.0 * off), (3.0, 0.01, 0.0)):
        history.append(
            {"time": time, "strain_energy": work, "external_work": work, "balance": balance}
            | {"numerical_dissipation": 0.0, "R[a]": 1.0, "u[a]": work}
            | columns
        )
    return history


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_small_imbalances_are_warned_of_and_large_ones_refused(
    comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture, sign: float
) -> None:
    with caplog.at_level(logging.WARNING, logger="fxcrack"):
        check_energy(rows_of(comm, 0.9 * sign * WARNED), 0)
        assert not caplog.messages
        check_energy(rows_of(comm, 1.1 * sign * WARNED), 0)
        assert len(caplog.messages) == 1
        assert "0.0011 of the largest energy at time 2" in caplog.messages[0]
        check_energy(rows_of(comm, 0.99 * sign * REFUSED), 0)
        with pytest.raises(fx.EnergyError, match=r"off by 0\.011 .* time 2") as found:
            check_energy(rows_of(comm, 1.1 * sign * REFUSED), 0)
    assert found.value.imbalance == pytest.approx(0.011)


def test_rows_of_earlier_steps_are_the_measure_but_not_checked(comm: MPI.Intracomm) -> None:
    check_energy(rows_of(comm, 0.5), 2)
    history = rows_of(comm, 0.0)
    history.rows[2]["balance"] = 0.015  # more than the work of that row, less than 1 % of 2
    check_energy(history, 2)
    history.rows[2]["balance"] = 0.03
    with pytest.raises(fx.EnergyError):
        check_energy(history, 2)


def test_what_is_not_a_number_is_refused(comm: MPI.Intracomm) -> None:
    with pytest.raises(fx.EnergyError, match="no finite number"):
        check_energy(rows_of(comm, float("nan")), 0)


def test_energy_that_the_time_integration_makes_is_warned_of(
    comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, logger="fxcrack"):
        check_energy(rows_of(comm, 0.0, numerical_dissipation=1.5), 0)
        assert not caplog.messages
        check_energy(rows_of(comm, 0.0, numerical_dissipation=-0.03), 0)
    assert ["has made energy, 0.015" in m for m in caplog.messages] == [True]


def test_differences_of_large_numbers_are_no_alarm(comm: MPI.Intracomm) -> None:
    """A body that expands freely: energies are round-off beside loads times conjugates."""
    history = History(comm)
    history.append(
        {"time": 1.0, "strain_energy": 1e-10, "external_work": -1e-10, "balance": -2e-10}
        | {"F[t]": 1e3, "v[t]": 1e3}
    )
    check_energy(history, 0)
    check_energy(History(comm), 0)


@pytest.mark.parametrize("effects", [[], [fx.FiniteStrain()]])
def test_bodies_that_move_as_one_are_no_alarm(
    comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture, effects: list[object]
) -> None:
    """There and back by one length: all energies are round-off, and in the end nothing is moved.

    The work is 1e-11 to 1e-10 (round-off of forces, E = 70e3, times 1), all of it missing.
    """
    there_and_back = fx.Amplitude((0.0, 1.0, 2.0), (0.0, 1.0, 0.0))
    scene = fx.Scene(
        dcb_2d(comm, length=8.0, dx=1.0, ny=1),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement(end, x=1.0, y=0.0, amplitude=there_and_back)
            for end in ("end_lower", "end_upper")
        ],
        debonds=[fx.Debond(bond(3.0), fx.VCCT(GIc=0.2))],
        effects=effects,
        solver="newton",
    )
    with caplog.at_level(logging.WARNING, logger="fxcrack"):
        for end in (1.0, 2.0):
            scene.run(fx.Static(until=fx.Time(end), stepping="increment"), progress=False)
    scene.close()
    assert not [m for m in caplog.messages if "energy balance" in m]


@pytest.mark.mpi
def test_a_step_that_loses_energy_ends_with_an_error_and_its_history(
    comm: MPI.Intracomm, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a release books less than it takes, the step says so; the results are kept."""
    honest = quasi_static.release_critical

    def forgetful(analysis: object, **options: object) -> None:
        before = analysis.balance.copy()  # type: ignore[attr-defined]
        honest(analysis, **options)  # type: ignore[arg-type]
        analysis.balance.released = before.released  # type: ignore[attr-defined]

    monkeypatch.setattr(quasi_static, "release_critical", forgetful)
    scene = fx.Scene(
        dcb_2d(comm, length=20.0, dx=1.0, ny=2),
        materials=STEEL,
        model=fx.PlaneStrain(),
        supports=PINS,
        debonds=[fx.Debond(bond(10.0), fx.VCCT(GIc=0.2))],
    )
    with pytest.raises(fx.EnergyError, match="balance") as found:
        scene.run(fx.Static(until=fx.Releases(4)), progress=False)
    assert found.value.imbalance > REFUSED
    assert scene.history.reason == "4 nodes released"
    assert scene.history.rows[-1]["released[bond]"] == 4
    assert scene.history.details["releases"] == 4


# -- energies that are there before any load -------------------------------------------------------


def overlapping(comm: MPI.Intracomm, over: float) -> fx.Mesh:
    """Two blocks of height 1, the upper one lowered by ``over``."""

    def make() -> Blocks:
        model = Blocks()
        x = np.linspace(0.0, 2.0, 5)
        upper = model.add("upper", [x, np.linspace(-over, 1.0, 3)], "quadrilateral", 1)
        lower = model.add("lower", [x, np.linspace(-1.0, 0.0, 3)], "quadrilateral", 1)
        for name, block, at in (
            ("top", upper, {"y": 1.0}),
            ("upper_face", upper, {"y": -over}),
            ("lower_face", lower, {"y": 0.0}),
            ("bottom", lower, {"y": -1.0}),
        ):
            model.group(name, block.part(**at))
        return model

    return build(comm, "blocks", make)


ENDS = [fx.Displacement("top", x=0.0, y=0.0), fx.Displacement("bottom", x=0.0, y=0.0)]
EFFECTS = {"linear": [], "finite": [fx.FiniteStrain()]}


@pytest.mark.mpi
@pytest.mark.parametrize("friction", [None, 0.2])
@pytest.mark.parametrize("effects", EFFECTS)
def test_a_press_fit_gives_the_energy_it_stores(
    comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture, effects: str, friction: float | None
) -> None:
    """Uniaxial strain: 1/2 M (over/2)^2 per block of height 1 and length 2."""
    over = 1e-3
    fit = fx.Interface(
        "upper_face",
        "lower_face",
        bonded=lambda x: np.zeros(x.shape[1], dtype=bool),
        contact=True,
        gap="keep",
        friction=friction,
        name="fit",
    )
    scene = fx.Scene(
        overlapping(comm, over),
        materials=fx.Isotropic(1000.0, 0.0),
        model=fx.PlaneStrain(),
        bonds=[fit],
        supports=ENDS,
        effects=EFFECTS[effects],
    )
    with caplog.at_level(logging.WARNING, logger="fxcrack"):
        row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False).rows[-1]
    assert row["overlap_energy"] == pytest.approx(1000.0 * over**2 / 2.0, rel=2e-3)
    assert row["overlap_energy"] == pytest.approx(row["strain_energy"], rel=1e-12)
    assert abs(float(row["balance"])) < 1e-12 * float(row["strain_energy"])
    if comm.rank == 0:
        assert any("5 open nodes overlap" in m for m in caplog.messages)


@pytest.mark.quick("linear")
@pytest.mark.parametrize("effects", EFFECTS)
def test_bonds_that_held_an_overlap_give_its_energy_as_they_are_released(
    comm: MPI.Intracomm, effects: str
) -> None:
    """A shear load releases bonded faces that overlap: contact then pushes them apart."""
    tie = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] > 0.7, contact=True, gap="keep", name="b"
    )
    scene = fx.Scene(
        overlapping(comm, 1e-3),
        materials=fx.Isotropic(1000.0, 0.0),
        model=fx.PlaneStrain(),
        supports=[fx.Displacement("top", x=0.01, y=0.0), ENDS[1]],
        debonds=[fx.Debond(tie, fx.VCCT(GIc=1e-3))],
        effects=EFFECTS[effects],
    )
    history = scene.run(fx.Static(until=[fx.Releases(2), fx.Time(50.0)]), progress=False)
    given = history["overlap_energy"].astype(float)
    assert given[-1] > 1.2 * given[0] > 0.0
    largest = np.abs(history["strain_energy"].astype(float)).max()
    # at finite strain the pressure that pushes them apart grows not quite linearly
    tolerance = 1e-11 if effects == "linear" else 1e-4
    assert np.abs(history["balance"].astype(float)).max() < tolerance * largest


@pytest.mark.mpi
def test_a_given_velocity_is_energy_that_is_there(comm: MPI.Intracomm) -> None:
    """1/2 rho A L v^2 of both arms; nothing else moves them, so their energy stays."""
    scene = fx.Scene(
        dcb_2d(comm, length=20.0, height=1.5, dx=1.0, ny=1),
        materials=fx.Isotropic(70e3, 0.3, density=2.7e-9),
        model=fx.PlaneStrain(),
        supports=HELD_FAR,
        debonds=[fx.Debond(bond(10.0), fx.VCCT(GIc=1e9))],
        effects=[fx.Inertia(rho_inf=1.0, velocity=(0.0, 2e3))],
    )
    history = scene.run(fx.Dynamic(until=fx.Time(2e-4), dt=1e-5), progress=False)
    rows, start = history.rows, 0.5 * 2.7e-9 * 2.0 * 20.0 * 1.5 * 2e3**2
    assert rows[0]["initial_kinetic_energy"] == pytest.approx(start, rel=1e-12)
    for row in rows:
        assert abs(float(row["balance"])) < 1e-11 * start
