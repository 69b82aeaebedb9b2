"""Bonds under their usual names: fields, history and tables, while they let go and afterwards."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from specimens import bond, dcb, specimen
from test_criteria_in_analysis import plate, run

import fxcrack as fx
from fxcrack.criteria import RampRelease
from fxcrack.meshes.dcb import dcb_3d
from fxcrack.meshes.penny import penny
from fxcrack.output.fields import displacement_function
from fxcrack.output.interface_fields import InterfaceFields, interface_fields

ROUND_OFF = 1e-9  # of the largest value: one factorisation and a back-solve
NAMES = {"DBT", "DBSF", "DBS", "BDSTAT", "OPENBC", "CRSTS", "ENRRT", "EFENRRTR"}
AMPLITUDE = fx.AmplitudeRelease((0.0, 1e-5, 4e-5), (1.0, 0.75, 0.0))
INCREMENTS = {"stepping": "increment", "initial": 0.01, "maximum": 0.01, "max_cutbacks": 20}


def fields(scene: fx.Scene) -> InterfaceFields:
    (found,) = interface_fields(scene, displacement_function(scene))
    return found


def along_an_amplitude() -> fx.Scene:
    """Bonds under an amplitude of time, some of them half-way."""
    scene = plate(fx.CriticalStress(100.0, distance=0.3), release=AMPLITUDE)
    run(scene, fx.Releases(2))
    run(scene, fx.Time(scene.time + 2e-5))
    return scene


def softening() -> fx.Scene:
    """A bond that falls with its opening, half-way."""
    scene = dcb(MPI.COMM_WORLD, dx=1.0, ny=2, release=fx.ProgressiveRelease())
    scene.run(fx.Static(until=fx.Releases(2)))
    scene.run(fx.Static(until=fx.Time(1.005 * scene.time)))
    return scene


def over_increments() -> fx.Scene:
    """A front under a ramp of eight increments, not yet over."""
    mesh = dcb_3d(length=30.0, width=4.0, dx=1.0, dy=2.0, ny=1)
    scene = specimen(mesh, a0=10.0, release=RampRelease(increments=8))
    scene.run(fx.Static(until=fx.Releases(2), **INCREMENTS))
    scene.run(fx.Static(until=fx.Time(scene.time + 0.025), **INCREMENTS))
    return scene


SCENES: dict[str, Callable[[], fx.Scene]] = {
    "amplitude": along_an_amplitude,
    "softening": softening,
    "increments": over_increments,
}


@pytest.mark.quick("softening")
@pytest.mark.mpi
@pytest.mark.parametrize("name", SCENES)
def test_remaining_stress_is_what_the_failed_bond_carries(name: str) -> None:
    scene = SCENES[name]()
    found = fields(scene)
    bonds, (growth,) = found.bonds, scene.cracks
    assert set(bonds) == NAMES
    gone = np.array([r.node for r in growth.records])
    half_way = gone[(bonds["DBSF"][gone] > 0.01) & (bonds["DBSF"][gone] < 0.99)]
    assert len(half_way)
    # the force of a bond falls along its own direction
    expected = bonds["DBSF"][gone, None] * bonds["CRSTS"][gone]
    scale = np.abs(bonds["CRSTS"]).max()
    np.testing.assert_allclose(bonds["DBS"][gone], expected, atol=ROUND_OFF * scale)
    # and it is what the displacement field says that node carries (there is no contact here)
    for record in growth.records:
        carried = found.traction[record.node] @ record.frame
        np.testing.assert_allclose(bonds["DBS"][record.node], carried, atol=1e-8 * scale)
    np.testing.assert_array_equal(bonds["BDSTAT"], bonds["DBSF"])
    bonded = growth.front.bonded
    assert (bonds["BDSTAT"][bonded] == 1.0).all()
    never = np.setdiff1d(np.flatnonzero(~bonded), gone)
    assert len(never)
    for field in ("BDSTAT", "CRSTS", "DBS", "OPENBC", "ENRRT", "EFENRRTR"):
        assert not bonds[field][never].any()
    assert np.isnan(bonds["DBT"][never]).all() and np.isnan(bonds["DBT"][bonded]).all()
    scene.close()


@pytest.mark.mpi
def test_what_is_known_at_failure_stays_and_the_front_shows_the_present() -> None:
    scene = dcb(MPI.COMM_WORLD, dx=1.0, ny=2)
    history = scene.run(fx.Static(until=fx.Releases(3)))
    found, (growth,) = fields(scene), scene.cracks
    for record in growth.records:
        assert found.bonds["DBT"][record.node] == record.DBT
        assert found.bonds["EFENRRTR"][record.node] == record.EFENRRTR
        for name in ("CRSTS", "OPENBC", "ENRRT"):
            assert tuple(found.bonds[name][record.node]) == getattr(record, name)
    (front,) = growth.tips().node
    row = history.rows[-1]
    assert found.bonds["EFENRRTR"][front] == pytest.approx(row["f[bond]"], rel=1e-12)
    rates = [row["GI[bond]"], row["GII[bond]"], row["GIII[bond]"]]
    assert found.bonds["ENRRT"][front] == pytest.approx(rates, rel=1e-12)
    scene.close()


def test_bond_stress_is_that_of_the_bond_under_pressure_on_the_faces() -> None:
    # crack closure carries the pressure on to the faces to come; the stress of the bond does not
    pressure = [
        fx.Pressure(face, lambda x: np.where(x[0] < 2.0, 1.0, 0.0))
        for face in ("upper_face", "lower_face")
    ]
    scene = fx.Scene(
        penny(a=2.0, radius=8.0, half_height=6.0, dr=0.2),
        materials=fx.Isotropic(2e5, 0.3),
        model=fx.Axisymmetric(),
        supports=[
            fx.Displacement("axis_upper", x=0.0),
            fx.Displacement("axis_lower", x=0.0),
            fx.Displacement("axis_bottom", y=0.0),
        ],
        loads=pressure,
        debonds=[fx.Debond(bond(2.0), fx.VCCT(GIc=1e-4))],
    )
    scene.run(fx.Static(until=fx.Time(1e-3)))
    (tip,) = scene.cracks[0].tips().node
    before = fields(scene).traction[tip] / scene.time
    scene.run(fx.Static(until=fx.Releases(1)))
    (record,) = scene.cracks[0].records
    assert record.node == tip
    # linear up to the first release
    expected = before @ record.frame * record.DBT
    np.testing.assert_allclose(record.CRSTS, expected, atol=1e-7 * record.CRSTS[0])
    scene.close()


@pytest.mark.mpi
def test_history_of_chosen_bonds(shared_path: Path, comm: MPI.Intracomm) -> None:
    scene = dcb(comm, dx=1.0, ny=2, release=RampRelease(increments=4))
    seen = fx.BondHistory(scene, "bond", lambda x: np.abs(x[0] - 31.0) < 0.1)
    every = fx.BondHistory(scene, "bond")
    end = fx.CrackLength(scene.debonds[0].interface, 34.0)
    history = scene.run(fx.Static(until=end, **INCREMENTS), observers=[seen, every])
    assert len(seen.rows) == len(history)
    status = np.array([row["BDSTAT"] for row in seen.rows])
    assert status[0] == 1.0 and status[-1] == 0.0 and (np.diff(status) <= 1e-12).all()
    assert set(status.round(9)) == {1.0, 0.75, 0.5, 0.25, 0.0}
    assert {row["time"] for row in seen.rows} == set(history["time"])
    last = every.rows[-scene.cracks[0].n_released :]
    assert [row["node"] for row in last] == [r.node for r in scene.cracks[0].records]
    assert [row["DBT"] for row in last] == [r.DBT for r in scene.cracks[0].records]
    seen.to_csv(shared_path / "bonds.csv")
    fx.write_releases(scene, shared_path / "releases.csv")
    if comm.rank == 0:
        with (shared_path / "bonds.csv").open() as stream:
            table = list(csv.DictReader(stream))
        assert [float(r["BDSTAT"]) for r in table] == status.tolist()
        with (shared_path / "releases.csv").open() as stream:
            table = list(csv.DictReader(stream))
        assert [float(r["CRSTS11"]) for r in table] == [row["CRSTS11"] for row in last]
    text = fx.bond_table(scene)
    assert f"interface 'bond': {len(last)} bonds released" in text
    assert all(name in text for name in ("DBT", "DBS11", "CRSTS13", "OPENBC11", "EFENRRTR"))
    assert len(set(comm.allgather(text))) == 1
    scene.close()


def test_what_bond_history_refuses() -> None:
    scene = dcb(MPI.COMM_SELF, dx=2.0, ny=1)
    with pytest.raises(fx.InputError, match="no debond of interface 'glue'; known: bond"):
        fx.BondHistory(scene, "glue")
    with pytest.raises(fx.InputError, match=r"where gives shape \(3,\) for .* one boolean per"):
        fx.BondHistory(scene, "bond", lambda x: np.ones(3, dtype=bool))
    with pytest.raises(fx.InputError, match="no state yet; run a step before asking for its bonds"):
        fx.bond_table(scene)
