"""A speed problem from its mesh to the numbers that are reported, as plain types for JSON.

    ratio_to_one_solve = total / (assemble + plain_factor + one_solve)

total: mesh in memory to the onset at the last crack length, form compilation excluded. The other
three belong to one ordinary static solve of the same body, measured in the same process; with
MUMPS' own ordering, and in ratio_to_one_solve_same_order with that of the condensation.
"""

from __future__ import annotations

import os
import time
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fxcrack.base.parallel import slowest
from fxcrack.bench.baselines import Columns, Follower, Matrices, Onset, Refactor
from fxcrack.bench.measure import Growth, TimedHistory, grow, memory_of_one_solve, solve_once
from fxcrack.bench.problem import LENGTHS, Problem
from fxcrack.history import BEFORE_RELEASE
from fxcrack.mesh import Mesh
from fxcrack.scene import Scene

_PLAIN = ("plain_factor", "plain_factor_same_order", "one_solve")
N_RELEASES = 20
N_COLUMNS = 100
_PATIENCE = 20.0  # seconds: a baseline that needs no more for the rest is measured whole
_COMPARED = (35.0, 55.0)  # crack lengths between which a 3-D growth is compared with beam theory

Result = dict[str, Any]


def run(
    problem: Problem,
    comm: MPI.Intracomm,
    *,
    baseline: bool = False,
    memory: bool = True,
    repeat: int = 1,
) -> Result:
    """Measure a problem; collective, the same result on every rank.

    Args:
        problem: Which and how large.
        comm: Communicator.
        baseline: Measure the two baselines as well.
        memory: Measure the memory of the plain solve, in processes of its own.
        repeat: Measure so often and keep the fastest; for a machine with other work.

    Raises:
        FxcrackError: Something failed; on all ranks together.
    """
    mesh = problem.mesh(comm)
    growth, scene = grow(problem, mesh)
    peak, compile_seconds = growth.memory, growth.compile
    scene.close()
    solves = [solve_once(problem, mesh)]
    for _ in range(repeat - 1):
        again, scene = grow(problem, mesh)
        scene.close()
        growth = min(growth, again, key=lambda g: g.seconds["total"])
        solves.append(solve_once(problem, mesh))
    plain = {k: min(s[k] for s in solves) for k in _PLAIN}
    assemble = min(growth.seconds["assemble"], *(s["assemble"] for s in solves))
    one = assemble + plain["plain_factor"] + plain["one_solve"]
    history = growth.history
    total = growth.seconds["total"]
    result: Result = {
        "problem": problem.name,
        "dx": problem.dx,
        **({"dy": problem.dy} if problem.is_3d else {}),
        "ny": problem.ny,
        "dofs": history.details["dofs"],
        "retained": history.details["retained"],
        "releases": int(history.rows[growth.last]["released[bond]"]),
        "events": len(_onsets(growth)),
        "factorizations": history.details["factorizations"],
        "ranks": comm.size,
        "threads": os.environ.get("OMP_NUM_THREADS", "not limited"),
        "seconds": {**growth.seconds, **plain},
        "compile": compile_seconds,
        "one_static_solve": one,
        "ratio_to_one_solve": total / one,
        "ratio_to_one_solve_same_order": total
        / (assemble + plain["plain_factor_same_order"] + plain["one_solve"]),
        "peak_memory_mb": peak,
        "peak_memory_plain_mb": memory_of_one_solve(problem, comm) if memory else None,
        "peak_memory_note": (
            "highest resident size from the start of the process to the end of the growth, and of "
            "a process that makes the mesh, assembles, factors with all bonds fixed and solves "
            "once; Python and libraries included, summed over ranks"
        ),
        "curve": [_point(problem, history, a) for a in LENGTHS],
    }
    deviation = _deviation(problem, history)
    if deviation is not None:
        result["largest_deviation_from_reference"] = deviation
    if problem.is_3d:
        result["beam_theory"] = _beside_beam_theory(problem, growth)
    if baseline:
        result |= _baselines(problem, mesh, growth, scene)
    return result


def _onsets(growth: Growth) -> list[int]:
    """Rows of the events up to the last crack length."""
    rows = growth.history.rows[: growth.last + 1]
    return [i for i, row in enumerate(rows) if row["event"] in BEFORE_RELEASE]


def _point(problem: Problem, history: TimedHistory, length: float) -> dict[str, float]:
    row = history.rows[history.onset(length)]
    return {
        "a": length,
        "opening": problem.opening(row),
        "load": problem.load(row),
        "mean_a": float(row["a[bond]"]),
    }


def _deviation(problem: Problem, history: TimedHistory) -> float | None:
    """Largest relative deviation from the numbers known for this size, if any are."""
    found = []
    for length, (opening, load) in problem.reference().items():
        row = history.rows[history.onset(length)]
        found.append(abs(problem.load(row) / load - 1.0))
        if opening is not None:
            found.append(abs(problem.opening(row) / opening - 1.0))
    return max(found, default=None)


def _beside_beam_theory(problem: Problem, growth: Growth) -> Result:
    """Load against opening beside corrected beam theory at the same opening."""
    rows = [growth.history.rows[i] for i in _onsets(growth)]
    a = np.array([float(r["a[bond]"]) for r in rows])
    opening = np.array([problem.opening(r) for r in rows])
    load = np.array([problem.load(r) for r in rows])
    theory = np.array([problem.beam_load(d) for d in opening])
    between = (a >= _COMPARED[0]) & (a <= _COMPARED[1])
    shown = np.unique(np.searchsorted(a, np.arange(LENGTHS[0], LENGTHS[-1] + 1.0, 2.5)))
    keys = ("a", "opening", "load", "beam_load")
    return {
        "mean_load_ratio": float((load / theory)[between].mean()),
        "between": list(_COMPARED),
        "note": "load over corrected beam theory at the same opening; a is the mean of the front",
        "curve": [
            dict(zip(keys, (float(x[i]) for x in (a, opening, load, theory)), strict=True))
            for i in shown[shown < len(a)]
        ],
    }


def _baselines(problem: Problem, mesh: Mesh, growth: Growth, scene: Scene) -> Result:
    """Both baselines on the same matrices; each checked against the growth where it follows it."""
    comm = mesh.comm
    comm.Barrier()
    start = time.perf_counter()
    matrices = Matrices(problem, scene, LENGTHS[-1] - LENGTHS[0] + 2.5 * problem.dx)
    setup = slowest(comm, time.perf_counter() - start)
    refactor = _refactoring(problem, growth, scene, matrices, setup)
    columns = _by_columns(problem, growth, scene, matrices)
    matrices.destroy()
    total = growth.seconds["total"]
    return {
        "speedup_over_refactor": refactor["seconds"] / total,
        "speedup_over_columns": columns["seconds"] / total,
        "baselines": {"refactor": refactor, "columns": columns},
    }


def _refactoring(
    problem: Problem, growth: Growth, scene: Scene, matrices: Matrices, setup: float
) -> Result:
    """The growth with a factorisation at each event."""
    n_events = len(_onsets(growth))
    refactor = Refactor(matrices)
    events = _follow(matrices.comm, Follower(matrices, scene, refactor), n_events, _PATIENCE)
    refactor.destroy()
    seconds = [e.seconds for e in events]
    each = slowest(matrices.comm, float(np.mean(seconds[1:])))  # the first one orders as well
    return {
        "seconds": setup + slowest(matrices.comm, sum(seconds)) + (n_events - len(events)) * each,
        "setup": setup,
        "per_release": each,
        "per_release_ordered_anew": slowest(matrices.comm, seconds[0]),
        "measured_releases": len(events),
        "all_releases": n_events,
        "scaled": len(events) < n_events,
        "largest_difference": _difference(problem, growth, events),
        "note": "one numeric factorisation and one back-solve per event, ordered once; where "
        "scaled, the events not measured are counted with the mean of those that were",
    }


def _by_columns(problem: Problem, growth: Growth, scene: Scene, matrices: Matrices) -> Result:
    """The growth with S column by column."""
    comm, n_events = matrices.comm, len(_onsets(growth))
    columns = Columns(matrices)
    follower = Follower(matrices, scene, columns)
    events = _follow(comm, follower, min(N_RELEASES, n_events), 0.0)
    needed = matrices.gdim * int(growth.history.rows[growth.last]["released[bond]"])
    for c in range(matrices.n_retained):
        each = slowest(comm, columns.column_seconds / columns.n_columns)
        if columns.n_columns >= N_COLUMNS and (needed - columns.n_columns) * each > _PATIENCE:
            break
        columns.column(c)
    factor = slowest(comm, columns.factor_seconds)
    measured = columns.n_columns
    columns.destroy()
    growing = growth.seconds["total"] - growth.seconds["factor_with_schur"]
    return {
        "seconds": growing + factor + needed * each,
        "factor": factor,
        "per_column": each,
        "measured_columns": measured,
        "all_columns": needed,
        "scaled": measured < needed,
        "largest_difference": _difference(problem, growth, events),
        "note": "as measured, but with S by one factorisation and one back-solve per released "
        "component; where scaled, all are counted with the mean of those measured",
    }


def _follow(comm: MPI.Intracomm, follower: Follower, count: int, patience: float) -> list[Onset]:
    """Some events, all of them where the rest is expected to take no longer than ``patience``."""
    events: list[Onset] = []
    while len(events) < count:
        if len(events) == min(N_RELEASES, count):
            rest = (count - len(events)) * slowest(comm, events[-1].seconds)
            if rest > patience:
                break
        events.append(follower.onset())
    return events


def _difference(problem: Problem, growth: Growth, events: list[Onset]) -> float:
    """Largest relative difference in opening, load and crack length at the same events."""
    rows = [growth.history.rows[i] for i in _onsets(growth)[: len(events)]]
    ours: npt.NDArray[np.float64] = np.array(
        [(problem.opening(r), problem.load(r), float(r["a[bond]"])) for r in rows]
    )
    theirs = np.array([(e.opening, e.load, e.length) for e in events])
    return float(np.abs(theirs / ours - 1.0).max())
