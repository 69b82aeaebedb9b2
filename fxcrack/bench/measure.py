"""Measuring one complete crack growth, and the one static solve it is compared with.

The growth: from the mesh in memory to the onset at the last crack length, form compilation apart.
The solve: A = T^t K T with every bonded jump fixed at zero, factored by MUMPS' Cholesky method with
the workspace of the condensation, and one back-solve; factored once more with its ordering.
Memory is the highest resident size of a process, summed over the ranks; it counts libraries and
mesh too, so the solve gets a process of
its own:  python -m fxcrack.bench.measure dcb2d 0.0625 0.125 32
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

import fxcrack
from fxcrack.base.errors import SolverError
from fxcrack.base.machine import peak_memory
from fxcrack.base.parallel import slowest
from fxcrack.base.processes import run_module
from fxcrack.bench.problem import LENGTHS, Problem
from fxcrack.condensation.mumps_schur import mumps_message, ordering
from fxcrack.history import BEFORE_RELEASE, History, Row
from fxcrack.interface.jump_coordinates import FIXED, FREE, build_coordinates
from fxcrack.mesh import Mesh
from fxcrack.scene import Scene

_WORKSPACE = 40  # per cent more than MUMPS estimates (ICNTL(14)), as in the condensation
_CHILD_LIMIT = 1800.0  # seconds


class TimedHistory(History):
    """A history that notes when each row came, in seconds of ``time.perf_counter``."""

    def __init__(self, comm: MPI.Comm) -> None:
        super().__init__(comm)
        self.clock: list[float] = []

    def append(self, row: Row) -> None:
        """Add a row."""
        super().append(row)
        self.clock.append(time.perf_counter())

    def onset(self, length: float) -> int:
        """Number of the first row in which the crack, at least so long, is about to grow.

        Raises:
            SolverError: The crack never came that far.
        """
        for i, row in enumerate(self.rows):
            if row["event"] in BEFORE_RELEASE and float(row["a[bond]"]) >= length * (1.0 - 1e-9):
                return i
        raise SolverError(f"the crack did not reach a = {length:g}: {self.reason}")


@dataclass(frozen=True)
class Growth:
    """A measured crack growth.

    Attributes:
        history: Its rows.
        last: Number of the row at which the measurement ends.
        seconds: Seconds by phase and in total, the slowest rank's.
        compile: Seconds of form compilation, not in the total.
        memory: Highest resident size of the process so far, summed over ranks, MB.
    """

    history: TimedHistory
    last: int
    seconds: dict[str, float]
    compile: float
    memory: float


def grow(problem: Problem, mesh: Mesh) -> tuple[Growth, Scene]:
    """Grow the crack from a = 30 to the onset at a = 60; collective; close the scene afterwards."""
    comm = mesh.comm
    comm.Barrier()
    begin = time.perf_counter()
    scene = problem.scene(mesh)
    made = time.perf_counter()
    scene.continuum.compile()
    compiled = time.perf_counter()
    scene.history = history = TimedHistory(comm)
    scene.run(problem.step(scene), progress=False)
    end = time.perf_counter()
    last = history.onset(LENGTHS[-1])
    beyond = end - history.clock[last]
    seconds = {"scene": made - begin}
    for phase in ("assemble", "transform", "factor_with_schur", "growth"):
        seconds[phase] = scene.solver.timings.seconds[phase]
    seconds["growth"] -= beyond
    seconds["total"] = end - begin - (compiled - made) - beyond
    seconds = {phase: slowest(comm, value) for phase, value in seconds.items()}
    return Growth(history, last, seconds, slowest(comm, compiled - made), peak_memory(comm)), scene


def mumps_cholesky(matrix: PETSc.Mat, order: int | None = None) -> PETSc.PC:
    """A Cholesky factorisation by MUMPS, which the result's ``setUp`` performs.

    Args:
        matrix: Symmetric positive definite.
        order: MUMPS' ICNTL(7); its own choice by default.
    """
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    solver = PETSc.PC().create(matrix.getComm())
    solver.setType(PETSc.PC.Type.CHOLESKY)
    solver.setOperators(matrix)
    solver.setFactorSolverType("mumps")
    solver.setFactorSetUpSolverType()
    solver.getFactorMatrix().setMumpsIcntl(14, _WORKSPACE)
    if order is not None:
        solver.getFactorMatrix().setMumpsIcntl(7, order)
    return solver


def check_mumps(solver: PETSc.PC) -> None:
    """Raise what MUMPS reported.

    Raises:
        SolverError: The factorisation failed.
    """
    code, detail = (solver.getFactorMatrix().getMumpsInfog(i) for i in (1, 2))
    if code < 0:
        raise SolverError(mumps_message(code, detail))


def solve_once(problem: Problem, mesh: Mesh, *, compare: bool = True) -> dict[str, float]:
    """The static solve at a = 30: seconds by phase, the load at opening 1; collective.

    Args:
        problem: Which.
        mesh: Its mesh.
        compare: Factor a second time, in the ordering of the condensation.
    """
    comm = mesh.comm
    scene = problem.scene(mesh)
    scene.continuum.compile()
    comm.Barrier()
    clock = [time.perf_counter()]
    stiffness = scene.continuum.stiffness()
    clock.append(time.perf_counter())
    (pair,) = scene.pairs
    bonded = np.repeat(pair.bonded[:, None], mesh.gdim, axis=1)
    role = np.where(bonded, FIXED, FREE).astype(np.int8)
    coordinates = build_coordinates(scene.continuum.layout, scene.pairs, [role], scene.supports, 0)
    matrix = stiffness.ptap(coordinates.transform)
    stiffness.destroy()
    clock.append(time.perf_counter())

    upper, lower = problem.load_columns(scene)
    held = coordinates.first + np.arange(coordinates.n_supports)
    mine = held.astype(PETSc.IntType) if comm.rank == 0 else np.zeros(0, PETSc.IntType)
    solution, right, pull = (matrix.createVecRight() for _ in range(3))
    if comm.rank == 0:
        solution.setValues(mine[[upper, lower]], [0.5, -0.5])
    solution.assemble()
    matrix.mult(solution, pull)
    matrix.zeroRowsColumns(mine, 1.0, solution, right)
    clock.append(time.perf_counter())
    solver = mumps_cholesky(matrix)
    solver.setUp()
    check_mumps(solver)
    clock.append(time.perf_counter())
    solver.apply(right, solution)
    clock.append(time.perf_counter())
    solver.destroy()
    if compare:
        begin = time.perf_counter()
        solver = mumps_cholesky(matrix, ordering(mesh.gdim))
        solver.setUp()
        check_mumps(solver)
        ordered = slowest(comm, time.perf_counter() - begin)
        solver.destroy()
    load = pull.dot(solution)  # the load is the work of the unit opening on the solution

    assemble, transform, _, factor, solve = (slowest(comm, x) for x in np.diff(clock))
    for thing in (matrix, coordinates.transform, solution, right, pull):
        thing.destroy()
    scene.close()
    return {
        "assemble": assemble,
        "transform": transform,
        "plain_factor": factor,
        "one_solve": solve,
        **({"plain_factor_same_order": ordered} if compare else {}),
        "load": float(load),
    }


def memory_of_one_solve(problem: Problem, comm: MPI.Intracomm) -> float | None:
    """Peak memory of :func:`solve_once` in processes of its own, MB; collective.

    Returns:
        ``None`` if the processes could not be started.
    """
    found = None
    if comm.rank == 0:
        words = [problem.name, str(problem.dx), str(problem.dy), str(problem.ny)]
        found = run_module(__name__, words, comm.size, _CHILD_LIMIT).get("memory")
    waiting = comm.Ibarrier()
    while not waiting.Test():
        time.sleep(0.05)  # leave the cores to the processes measured
    memory: float | None = comm.bcast(found)
    return memory


def main() -> None:
    """Solve once in this process and print its peak memory."""
    name, dx, dy, ny = sys.argv[1:]
    comm = MPI.COMM_WORLD
    problem = Problem.make(name, float(dx), float(dy), int(ny))
    solve_once(problem, problem.mesh(comm), compare=False)
    memory = peak_memory(comm)
    if comm.rank == 0:
        print(json.dumps({"memory": memory, "version": fxcrack.__version__}), flush=True)


if __name__ == "__main__":
    main()
