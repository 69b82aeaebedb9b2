"""The cost model: laws fitted to measurements, estimates, and the choice of the solver."""

from __future__ import annotations

import io
import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from rich.console import Console
from specimens import assert_same, dcb3
from typer.testing import CliRunner

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.base.machine import machine_memory_mb, machine_name
from fxcrack.bench.cost import Task, advise, estimate
from fxcrack.bench.fit_constants import fit_constants
from fxcrack.bench.rates import dense_rate, unshared_rate
from fxcrack.bench.scale import ScaleCase, measure, suite
from fxcrack.bench.tables import show_scale
from fxcrack.cli import app
from fxcrack.condensation.cost_laws import Constants, Law, shipped


def case(shape: str, dofs: float, method: str, **more: Any) -> dict[str, Any]:
    """A measured case that follows known laws: direct 1e-6 n + 1e-11 n^2 s in 3-D, and so on."""
    seconds = dict.fromkeys(("mesh", "scene", "assemble", "transform", "factor_inner"), 1e-6 * dofs)
    plane, ranks = shape == "plane", more.get("ranks", 1)
    factor = 1e-6 * dofs + (1e-9 * dofs**1.5 if plane else 1e-11 * dofs**2)
    retained = more.get("retained", 100)
    share = 0.6 if ranks == 2 else 1.0
    direct = method == "schur"
    seconds["factor_with_schur"] = (factor + 2e-7 * retained**2) * share if direct else 0.0
    seconds["multigrid"] = 0.0 if direct else 3e-5 * dofs
    seconds["columns"] = 0.0 if direct else 100 * 10 * 1e-7 * dofs * share
    memory = 600.0 * dofs * np.log2(dofs) if plane else 1000.0 * dofs + 200.0 * dofs ** (4 / 3)
    memory = memory + 16.0 * retained**2 if direct else 5000.0 * dofs + 4.0 * 100 * dofs
    return {
        "shape": shape, "dofs": dofs, "method": method, "ahead": False, "ranks": ranks,
        "dim": 2 if plane else 3, "retained": retained, "columns": 0 if direct else 100,
        "iterations": 0.0 if direct else 10.0, "seconds": seconds, "memory_mb": memory / 1e6,
    } | more  # fmt: skip


def measured() -> dict[str, Any]:
    cases = [case("block", n, m) for n in (2e4, 6e4, 1e5) for m in ("schur", "iterative")]
    cases += [case("block", 6e4, m, ranks=2) for m in ("schur", "iterative")]
    cases += [case("plane", n, "schur") for n in (1e5, 4e5)]
    cases += [case("plane", 1e5, "schur", ahead=True, retained=1100)]
    cases += [{"shape": "plate", "dofs": 1e5, "method": "schur", "ranks": 1, "failed": "no"}]
    return {
        "date": "2000-01-01", "machine": "abacus", "cases": cases,
        "dense": {"release_per_square": 1e-9, "factor_per_cube": 1e-10},
        "message": {"latency": 1e-5, "per_byte": 1e-9},
    }  # fmt: skip


@pytest.fixture
def known(tmp_path: Path) -> Constants:
    path = tmp_path / "constants.json"
    path.write_text(json.dumps(fit_constants(measured())))
    return Constants.read(path)


def test_laws_are_found_again(known: Constants) -> None:
    n = 3e4
    # the constants of `case`, up to the round-off of a least-squares problem
    # whose part for the retained jumps is within 1e-3 of the factorisation
    assert known.laws["direct_seconds_3"](n) == pytest.approx(1e-6 * n + 1e-11 * n**2, rel=0.1)
    assert known.laws["direct_memory_3"](n) == pytest.approx(1000 * n + 200 * n ** (4 / 3))
    assert known.laws["direct_memory_2"](2e5) == pytest.approx(600 * 2e5 * np.log2(2e5))
    assert known.laws["iterative_memory_3"](n) == pytest.approx(5000 * n)
    assert known.laws["iteration_seconds_3"](n) == pytest.approx(1e-7 * n)
    assert known.per_entry["2"] == pytest.approx(2e-7)
    # t_2 = 0.6 t_1 = t_1 / 2^g
    assert known.gain["direct_3"] == pytest.approx(-np.log2(0.6))
    assert known.gain["direct_2"] == 0.8  # not measured
    assert known.iterations["block"] == 10.0


def test_missing_cases_are_named() -> None:
    result = measured()
    result["cases"] = [c for c in result["cases"] if c["method"] == "schur"]
    with pytest.raises(InputError, match="no case of 3-D, iterative"):
        fit_constants(result)


@given(st.floats(1e3, 1e9), st.integers(1, 64), st.sampled_from(["direct", "iterative"]))
def test_estimates_grow_with_the_model(n: float, ranks: int, method: str) -> None:
    small, large = (estimate(Task(k), method, ranks) for k in (n, 2.0 * n))
    assert 0.0 < small.total_seconds < large.total_seconds
    assert 0.0 < small.total_memory < large.total_memory
    assert small.seconds.keys() | small.memory.keys() == small.measured.keys()
    # no rank helps more than its share
    one = estimate(Task(n), method, 1)
    assert one.total_seconds / ranks <= small.total_seconds * (1.0 + 1e-12)


def test_what_is_measured_and_what_is_extrapolated(known: Constants) -> None:
    law = Law(1.0, 0.0, 1.0, 0.0, 100.0, 1000.0)
    assert law.measured(100.0) and law.measured(1000.0)
    assert not law.measured(50.0) and not law.measured(1e4)
    inside, outside, many = (
        estimate(Task(n), "direct", p, known).measured for n, p in ((5e4, 1), (1e7, 1), (5e4, 8))
    )
    assert all(inside.values())
    assert not outside["factorisation"] and not many["factorisation"]


def test_advice(known: Constants) -> None:
    small = advise(Task(2e4), bytes_per_rank=8e9, constants=known)
    assert [e.method for e in small] == ["direct", "iterative"]
    assert small[0].ranks == 1
    # 200 n^(4/3) bytes are 2 TB at 3e7, the iteration takes (5000 + 4 retained) n = 0.2 TB
    large = advise(Task(3e7, retained=300), bytes_per_rank=8e9, constants=known)
    assert [(e.method, e.ranks) for e in large] == [("iterative", 32), ("direct", 256)]
    assert advise(Task(3e7), bytes_per_rank=8e9, ranks=1, constants=known) == []
    assert [e.method for e in advise(Task(1e5, dim=2), bytes_per_rank=8e9)] == ["direct"]


def test_bad_input_is_refused(tmp_path: Path) -> None:
    for words in ({"dofs": 0.0}, {"dofs": 1e6, "dim": 4}, {"dofs": 1e6, "shape": "ball"}):
        with pytest.raises(InputError, match="choose"):
            Task(**words)
    with pytest.raises(InputError, match="choose direct or iterative"):
        estimate(Task(1e6), "guess")
    with pytest.raises(InputError, match="direct one always wins"):
        estimate(Task(1e6, dim=2), "iterative")
    (tmp_path / "no.json").write_text("{}")
    with pytest.raises(InputError, match="holds no cost constants"):
        Constants.read(tmp_path / "no.json")
    for bad in (("ball", 1e4, "schur"), ("block", 1e4, "lu"), ("block", 1.0, "schur")):
        with pytest.raises(InputError, match="choose"):
            ScaleCase(*bad)


def test_shipped_constants() -> None:
    constants = shipped()
    assert constants.date and constants.machine
    assert min(law(1e5) for law in constants.laws.values()) > 0.0
    assert all(0.0 <= g <= 1.0 for g in constants.gain.values())
    # matrix and one block of vectors at the least: 81 entries of 12 bytes
    assert constants.laws["iterative_memory_3"](1.0) > 1000.0


def test_machine() -> None:
    assert 100.0 < machine_memory_mb(MPI.COMM_SELF) < 1e9
    assert "cores" in machine_name()


@pytest.mark.slow
@pytest.mark.mpi
def test_iteration_where_a_factorisation_would_not_fit(
    comm: MPI.Intracomm, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    until = fx.Static(until=fx.Releases(1))
    sizes = {"dx": 5.0, "dy": 5.0, "ny": 1}
    one = dcb3(comm, **sizes)
    monkeypatch.setattr("fxcrack.solvers.linear.machine_memory_mb", lambda comm: 1.0)
    with caplog.at_level(logging.WARNING, "fxcrack"):
        other = dcb3(comm, **sizes)
    if comm.rank == 0:
        assert "GB there are: the iterative method is used" in caplog.text
    assert one.solver.columns is None and other.solver.columns is not None
    insisting = dcb3(comm, **sizes, options=fx.CondensedOptions(method="schur"))
    assert insisting.solver.columns is None
    histories = [s.run(until, progress=False) for s in (one, other)]
    assert_same(*histories, 1e-6)  # see test_condensation_iterative.py
    for scene in (one, other, insisting):
        scene.close()


# -- the bench -------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", ["block", "plate", "plane"])
def test_meshes_have_about_the_dofs_wanted(shape: str) -> None:
    for wanted in (5e4, 3e5):
        problem = ScaleCase(shape, wanted, "schur").problem()
        if shape == "block":
            n = round(100.0 / problem.dx)
            found = 3.0 * (n + 1) ** 2 * 2 * (problem.ny + 1)
        else:
            arms = 2.0 * (100.0 / problem.dx + 1.0) * (problem.ny + 1)
            found = 2.0 * arms if shape == "plane" else 3.0 * arms * (20.0 / problem.dy + 1.0)
        assert found == pytest.approx(wanted, rel=0.25)  # the next whole number of elements


def test_suite() -> None:
    cases = suite([1e4, 3e4, 6e4], ["block", "plane"], ["schur", "iterative"], [1, 2])
    assert {c.method for c in cases if c.shape == "plane"} == {"schur"}
    assert [c.dofs for c in cases if c.ranks == 2] == [3e4, 3e4, 1.5e5]
    assert sum(c.ahead for c in cases) == 2
    cases = suite([1e4, 3e4], ["block"], ["schur", "iterative"], [2])  # all of it on two
    assert [(c.dofs, c.ranks) for c in cases] == [(1e4, 2), (3e4, 2)] * 2


@pytest.mark.slow
@pytest.mark.mpi
def test_both_methods_measure_the_same_crack(comm: MPI.Intracomm) -> None:
    direct, iterative = (measure(ScaleCase("block", 1500, m), comm) for m in ("schur", "iterative"))
    for key in ("dofs", "releases"):
        assert direct[key] == iterative[key]
    assert iterative["load"] == pytest.approx(direct["load"], rel=1e-6)
    assert iterative["columns"] > 0 == direct["columns"]
    assert direct["seconds"]["factor_with_schur"] > 0.0 == iterative["seconds"]["factor_with_schur"]
    whole = measure(ScaleCase("block", 1500, "schur", ahead=True), comm)
    assert whole["releases"] == 0 and "load" not in whole


def test_tables() -> None:
    result = measured()
    for c in result["cases"]:
        if "failed" not in c:
            c["seconds"] |= {"total": 10.0, "growth": 0.0}
            c["bytes_per_dof"] = 1e6 * c["memory_mb"] / c["dofs"]
    text = io.StringIO()
    show_scale(result, Console(file=text, width=150))
    shown = text.getvalue()
    assert "time on 1 rank over that on P" in shown and "failed" not in shown
    # the seconds of `case` on 2 ranks are 0.6 of those on 1
    assert "1.67" in shown
    assert "share nothing" not in shown
    result["unshared"] = {"1": {"memory": 1.0, "caches": 1.0}, "2": {"memory": 1.6, "caches": 1.0}}
    show_scale(result, Console(file=text, width=150))
    assert "do 1.25 x the work of one if it comes from memory, 2.00 x" in text.getvalue()


def test_dense_rates() -> None:
    assert all(v > 0.0 for v in dense_rate(200).values())


@pytest.mark.slow
def test_more_work_takes_longer() -> None:
    few, many = (unshared_rate(MPI.COMM_SELF, n) for n in (100_000, 10_000_000))
    assert many["memory"] > 5.0 * few["memory"] > 0.0
    assert min(few["caches"], many["caches"]) > 0.0


@pytest.mark.slow
def test_command_line(tmp_path: Path) -> None:
    """Sizes, constants from them, and an estimate with these constants."""
    store, numbers = tmp_path / "constants.json", tmp_path / "scale.json"
    words = ["bench", "scale", "--sizes", "1500", "--shapes", "block,plane", "--ranks", "1"]
    done = CliRunner().invoke(app, [*words, "--json", str(numbers), "--store", str(store)])
    assert done.exit_code == 0, done.output
    assert len(json.loads(numbers.read_text())["cases"]) == 5
    words = ["cost", "--dofs", "1e4,1e9", "--memory", "4", "--constants", str(store)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "take CondensedOptions(method=" in done.output and "extrapolated" in done.output


def test_cost_command() -> None:
    done = CliRunner().invoke(app, ["cost", "--memory", "8"])
    assert done.exit_code == 0, done.output
    for text in ("1e+06 dofs", "1e+08 dofs", "columns, s", "GB", "*"):
        assert text in done.output
