"""How seconds and memory grow with the size of a model: direct against iterative, 1 rank against 2.

Each case runs in processes of its own: mesh, condensation onto the jumps that a crack needs for
its first two rows, growth over these rows, one displacement field. Memory is the highest resident
size less that before the mesh, summed over ranks.

    python -m fxcrack.bench.scale block 20000 iterative 0
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import date
from typing import Any

import numpy as np
from mpi4py import MPI

import fxcrack
from fxcrack.base.errors import FxcrackError, InputError
from fxcrack.base.machine import machine_name, peak_memory
from fxcrack.base.parallel import slowest
from fxcrack.base.processes import run_module
from fxcrack.bench.problem import LENGTHS, Problem
from fxcrack.bench.rates import dense_rate, message_rate, unshared_rate
from fxcrack.condensation.options import CondensedOptions
from fxcrack.mesh import Mesh
from fxcrack.meshes.dcb import dcb_3d
from fxcrack.solvers.linear import LinearSolver
from fxcrack.steps.end_conditions import CrackLength
from fxcrack.steps.static import Static

SHAPES = ("block", "plate", "plane")
"""A cube cut by a crack; the thin 3-D arms of "dcb3d"; those of "dcb2d"."""

_BLOCK = 100.0
_ROWS = 2  # of the front that open

Result = dict[str, Any]


@dataclass(frozen=True)
class ScaleCase:
    """One model, one method, a number of ranks.

    Attributes:
        shape: "block", "plate" or "plane".
        dofs: Wanted number of displacement dofs; the mesh comes near it.
        method: "schur" or "iterative".
        ahead: Whether all jumps of the path are retained, from a = 30 to 60.
        ranks: Number of processes.
    """

    shape: str
    dofs: float
    method: str
    ahead: bool = False
    ranks: int = 1

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise InputError(f"shape = '{self.shape}': choose one of {', '.join(SHAPES)}")
        if self.method not in ("schur", "iterative"):
            raise InputError(f"method = '{self.method}': choose schur or iterative")
        if not 500 <= self.dofs <= 1e9:
            raise InputError(f"sizes: {self.dofs:g} dofs; choose sizes from 500 to 1e9")
        if self.ranks < 1:
            raise InputError(f"ranks = {self.ranks}: choose at least 1")

    @property
    def dim(self) -> int:
        """Dimension."""
        return 2 if self.shape == "plane" else 3

    def problem(self) -> Problem:
        """The speed problem whose scene is used, with the element size that gives the dofs."""
        if self.shape == "block":
            n = max(2 * round(0.5 * ((self.dofs / 3.0) ** (1.0 / 3.0) - 1.3)), 4)
            return Problem("dcb3d", _BLOCK / n, _BLOCK / n, n // 2)
        name = "dcb2d" if self.shape == "plane" else "dcb3d"
        sizes = 10.0 / 2.0 ** np.linspace(0.0, 12.0, 400)
        counts = [_count(name, dx) for dx in sizes]
        dx = float(sizes[int(np.argmin(np.abs(np.log(np.array(counts) / self.dofs))))])
        return Problem.make(name, 100.0 / round(100.0 / dx))

    def mesh(self, comm: MPI.Intracomm) -> Mesh:
        """Make the mesh; collective."""
        problem = self.problem()
        if self.shape != "block":
            return problem.mesh(comm)
        mesh: Mesh = dcb_3d(
            comm, length=_BLOCK, width=_BLOCK, height=0.5 * _BLOCK,
            dx=problem.dx, dy=problem.dx, ny=problem.ny,
        )  # fmt: skip
        return mesh


def _count(name: str, dx: float) -> float:
    arms = 2.0 * (100.0 / dx + 1.0) * (2.0 / dx + 1.0)
    return 2.0 * arms if name == "dcb2d" else 3.0 * arms * (10.0 / dx + 1.0)


def suite(
    sizes: list[float], shapes: list[str], methods: list[str], ranks: list[int]
) -> list[ScaleCase]:
    """Cases for all sizes; several ranks and many retained jumps at the middle size only.

    Without 1 among the ranks all sizes run on each of them, and nothing else. In 2-D the direct
    method alone is measured, at sizes five times as large.
    """
    middle = sorted(sizes)[len(sizes) // 2]
    out = []
    for shape in shapes:
        factor = 5.0 if shape == "plane" else 1.0
        for method in methods if shape != "plane" else ["schur"]:
            if 1 not in ranks:
                out += [
                    ScaleCase(shape, factor * s, method, False, p)
                    for s in sorted(sizes)
                    for p in ranks
                ]
                continue
            out += [ScaleCase(shape, factor * s, method, False, 1) for s in sorted(sizes)]
            out += [ScaleCase(shape, factor * middle, method, False, p) for p in ranks if p > 1]
        if "schur" in methods and 1 in ranks:
            out.append(ScaleCase(shape, factor * middle, "schur", True))
    return out


def measure(case: ScaleCase, comm: MPI.Intracomm) -> Result:
    """Run a case in the present processes; collective, the same result on every rank."""
    before = peak_memory(comm)
    comm.Barrier()
    clock = [time.perf_counter()]
    mesh = case.mesh(comm)
    clock.append(time.perf_counter())
    problem = case.problem()
    scene = problem.scene(mesh, CondensedOptions(method=case.method))
    clock.append(time.perf_counter())
    scene.continuum.compile()
    clock.append(time.perf_counter())
    (debond,) = scene.debonds
    if case.ahead:
        scene.analysis.condensed.prepare([True], [LENGTHS[-1] - LENGTHS[0]])
    else:
        reach = LENGTHS[0] + _ROWS * problem.dx
        scene.run(Static(until=CrackLength(debond.interface, reach)), progress=False)
        scene.solver.displacement().destroy()
    end = time.perf_counter()
    spent = scene.solver.timings.seconds
    seconds = {"mesh": clock[1] - clock[0], "scene": clock[2] - clock[1]}
    for phase in ("assemble", "transform", "factor_with_schur", "factor_inner", "multigrid"):
        seconds[phase] = spent.get(phase, 0.0)
    seconds |= {phase: spent.get(phase, 0.0) for phase in ("columns", "growth", "fields")}
    seconds["total"] = end - clock[0] - (clock[3] - clock[2])
    system = scene.analysis.condensed.system
    assert isinstance(scene.solver, LinearSolver)
    store = scene.solver.columns
    space = store.space if store is not None else None
    result: Result = {
        **asdict(case),
        "dim": case.dim,
        "dofs": scene.continuum.n_global,
        "retained": system.n_retained,
        "releases": sum(g.n_released for g in scene.cracks),
        "seconds": {k: slowest(comm, v) for k, v in seconds.items()},
        "columns": len(space.known) if space is not None else 0,
        "iterations": float(np.mean(space.iterations)) if space is not None else 0.0,
        "memory_mb": peak_memory(comm) - before,
        "before_mb": before,
    }
    if not case.ahead:
        row = scene.history.rows[-1]
        result["opening"], result["load"] = problem.opening(row), problem.load(row)
    result["bytes_per_dof"] = 1e6 * result["memory_mb"] / result["dofs"]
    scene.close()
    return result


def run(
    cases: list[ScaleCase],
    *,
    memory_mb: float,
    limit: float,
    tell: Callable[[Result], None] | None = None,
) -> Result:
    """Run cases one after the other, each in its own processes.

    Args:
        cases: What to run.
        memory_mb: Memory a case may take, all ranks together, MB.
        limit: Seconds a case may take.
        tell: Called with every result.

    Returns:
        Date, machine, its rates, and the results; a case that failed has "failed" with the reason.
    """
    out: Result = {
        "date": date.today().isoformat(),
        "machine": machine_name(),
        "version": fxcrack.__version__,
        "dense": dense_rate(),
        "unshared": {},
        "cases": [],
    }
    for ranks in sorted({1} | {case.ranks for case in cases}):
        out["unshared"][str(ranks)] = run_module(__name__, [], ranks, limit)
    for case in cases:
        words = [case.shape, f"{case.dofs:g}", case.method, str(int(case.ahead))]
        words.append(f"{memory_mb / case.ranks:.0f}")
        result = {**asdict(case), "dim": case.dim, **run_module(__name__, words, case.ranks, limit)}
        out["message"] = result.pop("message", out.get("message"))
        out["cases"].append(result)
        if tell is not None:
            tell(result)
    return out


def main() -> None:
    """Measure one case, or the machine, in this process and its companions; print the result."""
    comm = MPI.COMM_WORLD
    if len(sys.argv) == 1:
        rates = unshared_rate(comm)
        if comm.rank == 0:
            print(json.dumps(rates), flush=True)
        return
    shape, dofs, method, ahead, memory_mb = sys.argv[1:]
    if float(memory_mb) > 0.0:
        most = int(float(memory_mb) * 1e6)
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    case = ScaleCase(shape, float(dofs), method, bool(int(ahead)), comm.size)
    try:
        result = measure(case, comm)
        if comm.size > 1:
            result["message"] = message_rate(comm)
    except FxcrackError as error:
        result = {"failed": str(error)}
    except MemoryError:
        result = {"failed": "out of memory"}
    if comm.rank == 0:
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
