"""The speed problems: right numbers, honest comparison, complete reports."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from rich.console import Console

from fxcrack.base.errors import InputError, SolverError
from fxcrack.base.machine import peak_memory
from fxcrack.bench import explicit, explicit_ranks, measure
from fxcrack.bench.problem import LENGTHS, Problem
from fxcrack.bench.speed import run
from fxcrack.bench.tables import show_explicit, show_speed

COMM = MPI.COMM_WORLD
KEYS = {
    *("dofs", "retained", "releases", "factorizations", "ranks", "seconds", "compile", "curve"),
    *("peak_memory_mb", "peak_memory_plain_mb", "ratio_to_one_solve"),
}
SECONDS = {"assemble", "plain_factor", "one_solve", "factor_with_schur", "growth", "total"}


@cache
def measured(problem: Problem, *, baseline: bool = False) -> dict[str, Any]:
    """A benchmark, run once for all tests; without the memory of processes of their own."""
    return run(problem, COMM, baseline=baseline, memory=False)


COARSE = Problem.make("dcb2d", 0.5)
COARSE_3D = Problem.make("dcb3d", 2.5, 5.0, 1)


# -- the problems --------------------------------------------------------------------


def test_sizes_have_the_defaults_of_the_command_line() -> None:
    assert Problem.make("dcb2d") == Problem("dcb2d", 0.0625, 0.125, 32)
    assert Problem.make("dcb3d") == Problem("dcb3d", 0.5, 1.0, 4)
    assert Problem.make("dcb3d", 1.0) == Problem("dcb3d", 1.0, 2.0, 2)
    assert Problem.make("dcb2d", 0.25, ny=3).ny == 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("dcb4d",), "choose dcb2d or dcb3d"),
        (("dcb2d", 0.0), "dx = 0"),
        (("dcb2d", float("nan")), "dx = nan"),
        (("dcb3d", 1.0, 30.0), "dy = 30"),
        (("dcb2d", 0.5, None, 0), "ny = 0"),
    ],
)
def test_sizes_that_make_no_mesh_are_refused(words: tuple[Any, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Problem.make(*words)


def test_beam_load_is_that_of_the_closed_form() -> None:
    # P = sqrt(Gc b E I)/c at opening 2 P c^3/(3 E I), whatever c
    stiffness = 70e3 * 20.0 * 1.5**3 / 12.0
    strength = np.sqrt(0.2 * 20.0 * stiffness)
    c = 41.5
    opening = 2.0 * strength / c * c**3 / (3.0 * stiffness)
    assert Problem.make("dcb3d").beam_load(opening) == pytest.approx(strength / c, rel=1e-12)


# -- the numbers ---------------------------------------------------------------------


@pytest.mark.quick("0.5")
@pytest.mark.mpi
@pytest.mark.verification
@pytest.mark.parametrize("dx", [0.5, 0.25, pytest.param(0.125, marks=pytest.mark.slow)])
def test_opening_and_load_are_those_of_other_programs(dx: float) -> None:
    result = measured(Problem.make("dcb2d", dx))
    assert [point["a"] for point in result["curve"]] == list(LENGTHS)
    # 0.1 %: those programs agree among themselves to 1.5e-4
    assert result["largest_deviation_from_reference"] < 1e-3
    assert result["factorizations"] == 1
    assert result["releases"] == round(30.0 / dx)


@pytest.mark.mpi
@pytest.mark.slow
@pytest.mark.verification
def test_onset_in_3d_is_that_of_other_programs() -> None:
    result = measured(Problem.make("dcb3d", 1.0))
    assert result["largest_deviation_from_reference"] < 1e-3
    # node-by-node release carries 11 to 15 % less than a straight front (docs/theory.md)
    assert result["beam_theory"]["mean_load_ratio"] == pytest.approx(0.889, abs=0.005)


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("problem", [COARSE, COARSE_3D], ids=lambda p: p.name)
def test_baselines_follow_the_same_crack(problem: Problem) -> None:
    result = measured(problem, baseline=True)
    for name in ("refactor", "columns"):
        found = result["baselines"][name]
        # the same equations solved by other factorisations of the same matrix
        assert found["largest_difference"] < 1e-8
        assert found["seconds"] > 0.0
        assert result[f"speedup_over_{name}"] == found["seconds"] / result["seconds"]["total"]
    refactor, columns = (result["baselines"][name] for name in ("refactor", "columns"))
    assert refactor["measured_releases"] == refactor["all_releases"] == result["events"]
    assert columns["all_columns"] == result["releases"] * (3 if problem.is_3d else 2)


@pytest.mark.mpi
def test_one_static_solve_starts_the_same_curve() -> None:
    mesh = COARSE.mesh(COMM)
    growth, scene = measure.grow(COARSE, mesh)
    scene.close()
    row = growth.history.rows[growth.history.onset(30.0)]
    stiffness = COARSE.load(row) / COARSE.opening(row)
    # round-off of a factorisation with a condition number near 1e6
    assert measure.solve_once(COARSE, mesh)["load"] == pytest.approx(stiffness, rel=1e-8)
    with pytest.raises(SolverError, match="did not reach a = 99"):
        growth.history.onset(99.0)


# -- the report ----------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("problem", [COARSE, COARSE_3D], ids=lambda p: p.name)
def test_result_has_all_that_is_promised(problem: Problem) -> None:
    result = measured(problem, baseline=True)
    assert result.keys() >= KEYS
    seconds = result["seconds"]
    assert seconds.keys() >= SECONDS
    parts = ("scene", "assemble", "transform", "factor_with_schur")
    assert seconds["total"] > sum(seconds[part] for part in parts)
    one = result["one_static_solve"]
    assert one <= seconds["assemble"] + seconds["plain_factor"] + seconds["one_solve"]
    assert result["ratio_to_one_solve"] == seconds["total"] / one
    assert result["ranks"] == COMM.size
    assert COMM.allgather(result) == [result] * COMM.size
    assert ("beam_theory" in result) == problem.is_3d


@pytest.mark.parametrize("problem", [COARSE, COARSE_3D], ids=lambda p: p.name)
def test_tables_show_what_the_file_holds(problem: Problem) -> None:
    result = measured(problem, baseline=True)
    text = io.StringIO()
    show_speed(result, Console(file=text, width=120))
    shown = text.getvalue()
    for number in (
        str(result["dofs"]),
        f"{result['ratio_to_one_solve']:.2f}",
        f"{result['curve'][2]['load']:.4f}",
        f"{result['speedup_over_refactor']:.1f}",
        "peak memory",
    ):
        assert number in shown


@pytest.mark.slow
def test_memory_of_the_solve_is_measured_apart() -> None:
    ballast = np.ones(40_000_000)  # 320 MB that the other process must not inherit
    memory = measure.memory_of_one_solve(COARSE, COMM)
    assert memory is not None
    assert 20.0 < memory < peak_memory(COMM) - 0.5e-6 * ballast.nbytes


def test_memory_is_left_out_where_no_process_can_be_started(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sys.executable", "/nowhere/python")
    assert measure.memory_of_one_solve(COARSE, COMM) is None


@pytest.mark.parametrize("repeat", [1, 2])
def test_repeating_keeps_the_fastest(monkeypatch: pytest.MonkeyPatch, repeat: int) -> None:
    totals: list[float] = []
    grow: Callable[..., Any] = measure.grow

    def noted(problem: Problem, mesh: Any) -> Any:
        growth, scene = grow(problem, mesh)
        totals.append(growth.seconds["total"])
        return growth, scene

    monkeypatch.setattr("fxcrack.bench.speed.grow", noted)
    result = run(Problem.make("dcb2d", 2.5), COMM, memory=False, repeat=repeat)
    assert len(totals) == repeat
    assert result["seconds"]["total"] == min(totals)


# -- explicit dynamics ---------------------------------------------------------------


def test_increments_of_explicit_dynamics_are_measured_beside_products() -> None:
    small = explicit.Case("tiny", 2, 40.0, 2.0, 1)
    result = explicit.run(small, COMM, increments=3)
    assert result["dofs"] == 2 * 2 * 21 * 2
    assert result["ms_per_increment"] > 0.0
    assert result["ratio"] == pytest.approx(result["ms_per_increment"] / result["ms_once"])
    buffer = io.StringIO()
    show_explicit([result], Console(file=buffer, width=200))
    assert "one sparse product" in buffer.getvalue()
    with pytest.raises(InputError, match="at least 1"):
        explicit.run(small, COMM, increments=0)


@pytest.mark.mpi
@pytest.mark.three
def test_gains_of_ranks_beside_processes_that_share_nothing(comm: MPI.Intracomm) -> None:
    small = explicit.Case("tiny", 2, 40.0, 2.0, 1)
    if comm.size == 1:
        with pytest.raises(InputError, match="two ranks or more"):
            explicit_ranks.compare(small, comm)
        return
    result = explicit_ranks.compare(small, comm, repeat=1, increments=3)
    assert result["ranks"] == comm.size
    gain = result["ms_one"] / result["ms_together"]
    assert result["gain_together"] == pytest.approx(gain) and gain > 0.0
    assert result["gain_apart"] == pytest.approx(comm.size * result["ms_one"] / result["ms_apart"])
