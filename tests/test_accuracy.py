"""Accuracy studies from end to end, and runs that are asked for an accuracy."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import fxcrack as fx
from fxcrack import cli
from fxcrack.accuracy import AccuracyError, Setting, choose
from fxcrack.accuracy.launch import SettingFailed, TookTooLong, Workers
from fxcrack.accuracy.load import load
from fxcrack.accuracy.run_study import run_study
from fxcrack.accuracy.scenes import STUDIES
from fxcrack.base.errors import InputError
from fxcrack.error_estimate import estimate_errors

OWN = """
from fxcrack.accuracy import Case, Measured, Setting, study
from fxcrack.accuracy.scenes import STUDIES

@study(sizes=(2.0, 1.0), orders=(1,), cells=("quadrilateral",), methods=("vcct",))
def mine(setting: Setting) -> Case:
    return STUDIES["dcb"](setting)

@study(sizes=(0.4, 0.2, 0.1), cells=("quadrilateral",), methods=("vcct",))
def disc(setting: Setting) -> Case:
    return STUDIES["penny"](setting)

def plain(setting: Setting) -> Case:
    return mine(setting)

def stuck(setting: Setting) -> Case:
    import time
    time.sleep(60.0)

def wrong(setting: Setting) -> Case:
    raise ZeroDivisionError("by design")

def first_wrong(setting: Setting) -> Case:
    return _wrong_on(0)

def second_wrong(setting: Setting) -> Case:
    return _wrong_on(1)

def _wrong_on(rank: int) -> Case:
    from mpi4py import MPI
    if MPI.COMM_WORLD.rank == rank:
        raise ZeroDivisionError(f"by design on {rank}")
    MPI.COMM_WORLD.Barrier()
"""


@pytest.fixture
def own(tmp_path: Path) -> str:
    """A file with scene functions of a user's own."""
    path = tmp_path / "own_scenes.py"
    path.write_text(OWN)
    return str(path)


# -- studies -------------------------------------------------------------------------


@pytest.mark.slow
def test_a_tiny_study_of_a_users_own_scene(own: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ["accuracy", f"{own}:mine", "--budget", "20", "--out", str(out)]
    command = [sys.executable, "-c", "from fxcrack.cli import main; main()", *words]
    found = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    result = json.loads((out / "accuracy.json").read_text())
    assert [r["setting"]["size"] for r in result["records"]] == [2.0, 1.0]
    assert result["advice"] in " ".join(found.stdout.split())
    assert not result["reference"]["exact"]
    assert "own finest runs" in result["reference"]["source"]
    assert result["theory"]["source"] == "corrected beam theory"
    for record in result["records"]:
        assert record["seconds"] > 0.0
        assert sum(record["phases"].values()) == pytest.approx(record["seconds"], rel=1e-6)
        assert set(record["memory"]) == {"setup", "factor", "growth"}
        assert set(record["errors"]) == {"load", "G", "length"}
    assert result["machine"]["fxcrack"] == fx.__version__
    assert {p.name for p in out.iterdir()} == {
        "accuracy.json", "accuracy.md", "error.png", "cost.png",
    }  # fmt: skip
    # what was measured can be used, and is not stretched
    setting = choose(out / "accuracy.json", 0.3)
    assert setting.size in (1.0, 2.0)
    with pytest.raises(AccuracyError, match="the best reached"):
        choose(out / "accuracy.json", 1e-9)
    with pytest.raises(InputError, match="no result of fxcrack accuracy"):
        choose(own, 0.01)


@pytest.mark.slow
def test_nothing_hangs_and_a_failure_does_not_end_the_study(own: str) -> None:
    setting = Setting(size=2.0)
    begin = time.monotonic()
    with (
        closing(Workers(f"{own}:stuck")) as workers,
        pytest.raises(TookTooLong, match="time limit"),
    ):
        workers.run(setting, 5.0)
    assert time.monotonic() - begin < 20.0
    # one that fails on its only rank: below
    two = replace(setting, ranks=2)
    for rank, name in enumerate(("first_wrong", "second_wrong")):  # the other one waits for it
        with closing(Workers(f"{own}:{name}")) as workers:
            with pytest.raises(SettingFailed, match=f"by design on {rank}"):
                workers.run(two, 30.0)
    with pytest.raises(InputError, match=r"no setting gave a result.*ZeroDivisionError"):
        run_study(f"{own}:wrong", budget=40.0, sizes=(2.0,))


def test_names_that_name_nothing_are_refused(own: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="fatigue_dcb"):
        load("dbc")
    with pytest.raises(InputError, match="no file"):
        load(str(tmp_path / "none.py") + ":f")
    with pytest.raises(InputError, match="cannot be imported"):
        load("no.such.module:f")
    with pytest.raises(InputError, match="no function 'f'"):
        load(f"{own}:f")
    assert load(f"{own}:plain").title == "plain"
    with pytest.raises(InputError, match="budget = 0"):
        run_study("dcb", budget=0.0)
    with pytest.raises(SystemExit):
        cli.main(["accuracy", "dcb", "--sizes", "fine"])


@pytest.mark.slow
@pytest.mark.convergence
def test_what_a_study_says_of_the_penny_shaped_crack_is_true(own: str) -> None:
    budget = 30.0  # six runs of a tenth of a second each; Python may take long to start
    result = run_study(f"{own}:disc", budget=budget)
    assert result["wall"] < budget + 5.0  # ending the workers included
    assert result["reference"]["exact"]
    assert len(result["records"]) == 6
    records = {Setting(**r["setting"]): r for r in result["records"]}
    base = [records[Setting(size=h)]["error"] for h in (0.4, 0.2, 0.1)]
    # bilinear quads: the energy release rate converges with the square of the size
    assert base[0] / base[1] > 2.5
    assert base[1] / base[2] > 2.5
    # every advice holds: the record reaches the target, and nothing faster does (but for noise)
    for target in result["targets"]:
        good = [r for r in result["records"] if r["error"] <= target["target"]]
        if target["record"] is None:
            assert not good
        else:
            chosen = result["records"][target["record"]]
            assert chosen["error"] <= target["target"]
            assert chosen["seconds"] <= 1.1 * min(r["seconds"] for r in good)


# -- an accuracy asked for -----------------------------------------------------------


def _case(name: str, **choices: Any) -> Any:
    return STUDIES[name](Setting(**choices))


@pytest.mark.mpi
def test_a_run_that_is_accurate_enough_says_how_it_knows() -> None:
    case = _case("penny", size=0.2)
    history = case.scene.run(case.step, accuracy=0.06, progress=False)
    found = history.details["accuracy"]
    # the true errors on this mesh: load 0.51 %, G 1.02 %
    assert 0.0051 < found["load"] < 0.06
    assert 0.0102 < found["G"] < 0.06
    assert "second-order solution" in found["words"]
    case.scene.close()


@pytest.mark.mpi
def test_a_run_that_is_not_accurate_enough_says_so_and_what_to_do() -> None:
    case = _case("penny", size=0.4)
    with pytest.raises(AccuracyError, match=r"1 % is not reached.*elements of at most") as error:
        case.scene.run(case.step, accuracy=0.01, progress=False)
    assert error.value.estimate is not None
    assert error.value.estimate.total > 0.01
    assert len(case.scene.history) > 2  # nothing is lost
    case.scene.close()


def test_increments_count_as_errors() -> None:
    case = _case("penny", size=0.2, stepping="increment", tolerance=0.2)
    with pytest.raises(AccuracyError, match="stepping='event' or a tolerance") as error:
        case.scene.run(case.step, accuracy=0.06, progress=False)
    assert error.value.estimate is not None
    excess = max(float(r["f[bond]"]) for r in case.scene.history if r["event"] == "increment")
    assert error.value.estimate.stepping == pytest.approx(excess**0.5 - 1.0)
    # the mesh alone would do: what it is off by does not depend on the stepping
    assert error.value.estimate.total - error.value.estimate.stepping < 0.06
    case.scene.close()


def test_what_cannot_be_judged_is_said() -> None:
    case = _case("penny", size=0.4)
    with pytest.raises(AccuracyError, match="nothing grew"):
        case.scene.run(fx.Static(until=fx.Time(0.01)), accuracy=0.1, progress=False)
    with pytest.raises(InputError, match="accuracy = 1"):
        case.scene.run(case.step, accuracy=1.0)
    case.scene.close()
    # data per slave node fit one order only
    scene = case.scene
    n = scene.pairs[0].surface.n_nodes
    bond = scene.debonds[0].interface
    other = scene.rebuilt(debonds=[fx.Debond(bond, fx.VCCT(GIc=[10.0] * n))])
    with pytest.raises(AccuracyError, match=r"cannot be judged.*fxcrack accuracy"):
        other.run(case.step, accuracy=0.1, progress=False)
    other.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "size", "order", "load", "rate", "cell"),
    [
        # true errors in per cent: of the load, and of G at a given load (of the dcb: at a given
        # opening), counted from the limits of the finest runs of fxcrack accuracy NAME
        ("dcb", 0.5, 1, 0.742, 3.04, "quadrilateral"),
        ("enf", 0.5, 1, 1.36, 2.95, "quadrilateral"),
        ("mmb", 0.5, 1, 0.868, 2.25, "quadrilateral"),
        ("fatigue_dcb", 0.25, 1, 2.61, 4.04, "quadrilateral"),
        ("dcb", 0.5, 2, 0.101, 0.692, "quadrilateral"),
        ("enf", 0.5, 2, 0.381, 0.845, "quadrilateral"),
        # loads and openings at first growth over those of the quadrilaterals and their errors
        ("dcb", 0.5, 2, 0.163, 0.98, "triangle"),
        ("enf", 0.5, 2, 0.56, 1.21, "triangle"),
    ],
)
def test_the_estimate_is_above_the_true_error_and_not_far(
    name: str, size: float, order: int, load: float, rate: float, cell: str
) -> None:
    case = _case(name, size=size, order=order, cell=cell, stepping=STUDIES[name].steppings[0])
    case.scene.run(case.step, progress=False)
    found = estimate_errors(case.scene, case.step, case.scene.debonds)
    # twice the difference for the first order; for the second a bound from half of it, and on
    # triangles from the energy of jumps of the strain
    far = {1: 2.5, 2: 8.0}[order]
    assert (found.domain is not None) == (order == 2)
    assert (found.jumps is not None) == (cell == "triangle")
    assert load < 100.0 * found.load < far * load
    assert rate < 100.0 * found.G < far * rate
    case.scene.close()


def test_cycles_feel_the_power_of_the_law() -> None:
    case = _case("fatigue_dcb", size=0.5, method="closure")
    with pytest.raises(AccuracyError, match="number of cycles") as error:
        case.scene.run(case.step, accuracy=0.05, progress=False)
    estimate = error.value.estimate
    assert estimate is not None
    assert estimate.cycles is not None
    assert estimate.cycles > 5.0 * estimate.G
    case.scene.close()


def test_the_demos_own_study_in_3d() -> None:
    from fxcrack.demos import accuracy

    case = accuracy.dcb3d(Setting(size=2.0, cell="hexahedron"))
    history = case.scene.run(case.step, progress=False)
    found = case.measure(history)
    case.scene.close()
    assert history.details["releases"] == 0
    assert found.load is not None
    assert found.G is not None
    # the coarsest mesh is 5 % off in load; the mean of G over the width at 50 N follows from it
    assert found.load == pytest.approx(62.1, rel=0.08)
    assert found.G == pytest.approx(accuracy.G_IC * (50.0 / found.load) ** 2, rel=1e-6)
