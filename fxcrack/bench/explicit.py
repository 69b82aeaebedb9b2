"""Cost of an increment of explicit dynamics beside one sparse product of the same matrix.

A double cantilever beam is torn open while its crack runs. Seconds of processor time of an
increment, everything in it included, are those of the fastest of several stretches of the run; a
row of the history belongs to each of them. The product, or one assembly of the residual of bodies
that are not linear, is timed in the same process right before and after; the fastest counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

import fxcrack.meshes.dcb as meshes
from fxcrack.base.errors import InputError
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.kinematics import PlaneStrain, Solid
from fxcrack.continuum.loads import Displacement
from fxcrack.continuum.materials import Isotropic
from fxcrack.criteria import VCCT
from fxcrack.effects import FiniteStrain
from fxcrack.interface.definition import Interface
from fxcrack.scene import Scene
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.steps.debond import Debond
from fxcrack.steps.end_conditions import Time
from fxcrack.steps.explicit import Explicit

Result = dict[str, Any]

_A0 = 30.0
_SPEED = 8e3  # of each pin, mm/s
_SECONDS = 0.1  # of a stretch of products
_WARM = 40  # increments before the first stretch
_STRETCHES = 40


@dataclass(frozen=True)
class Case:
    """A mesh to measure on.

    Attributes:
        name: Its name.
        dim: 2 or 3.
        length: Of the beam, mm.
        dx: Length of the elements, mm.
        ny: Elements over the height of an arm.
        dy: Length of the elements across the width, mm, 3-D only.
    """

    name: str
    dim: int
    length: float
    dx: float
    ny: int
    dy: float = 0.0


CASES = {
    c.name: c
    for c in (
        Case("4k", 2, 100.0, 0.5, 4),
        Case("54k", 2, 80.0, 0.1, 16),
        Case("211k", 2, 80.0, 0.05, 32),
        Case("127k", 3, 80.0, 0.8, 4, 0.5),
    )
}
"""Meshes by name, their numbers of dofs."""


def run(
    case: Case, comm: MPI.Intracomm, *, finite: bool = False, increments: int | None = None
) -> Result:
    """Measure a case; collective, the same result on every rank.

    Args:
        case: The mesh.
        comm: Communicator.
        finite: Finite strain: increments beside assemblies of the residual.
        increments: Of a stretch of the run; for about 0.1 s by default.

    Raises:
        InputError: The number of increments is not positive.
    """
    if increments is not None and increments < 1:
        raise InputError(f"bench explicit: {increments} increments; at least 1 is needed")
    scene = _scene(case, comm, finite)
    scene.run(Explicit(until=Time(1e-9), rows=1))
    solver = scene.analysis.solver
    assert isinstance(solver, ExplicitSolver)
    once = _once(solver)
    before = _fastest(comm, once)
    if increments is None:
        increments = int(np.clip(_SECONDS / before, 3, 500))
        increments = int(comm.allreduce(increments, op=MPI.MIN))
    # the first step was one short increment
    dt = 0.97 * solver.stable
    marks: list[tuple[float, float, int]] = []

    def mark(event: str, row: Any) -> None:
        marks.append((time.process_time(), time.perf_counter(), solver.increments))

    end = scene.analysis.time + (_WARM + _STRETCHES * increments) * dt
    operator = solver.bodies.choice.name if solver.bodies.linear else "auto"
    history = scene.run(
        Explicit(until=Time(end), rows=_STRETCHES, operator=operator), observers=[mark]
    )
    after = _fastest(comm, _once(solver))
    processor, clock, done = (np.diff(column) for column in zip(*marks, strict=True))
    some = done > 0
    per_increment = float(np.min(processor[some] / done[some]))
    wall = float(np.min(clock[some] / done[some]))
    one = min(before, after)
    result: Result = {
        "case": case.name,
        "dofs": int(solver.continuum.n_global),
        "ranks": comm.size,
        "finite_strain": finite,
        "operator": solver.bodies.choice.name,
        "increments": int(done[some].sum()),
        "releases": int(history["released[bond]"][-1]),
        "ms_per_increment": 1e3 * float(comm.allreduce(per_increment, op=MPI.MAX)),
        "ms_per_increment_wall": 1e3 * float(comm.allreduce(wall, op=MPI.MAX)),
        "ms_once": 1e3 * float(comm.allreduce(one, op=MPI.MAX)),
        "once": "one assembly of the residual" if finite else "one sparse product",
    }
    result["ratio"] = result["ms_per_increment"] / result["ms_once"]
    result["ms_beside"] = result["ms_per_increment"] - result["ms_once"]
    scene.close()
    return result


def _once(solver: ExplicitSolver) -> Callable[[], Any]:
    """One product of the stiffness, or one assembly of the residual."""
    bodies = solver.bodies
    if not bodies.linear:
        return bodies.forces
    matrix = bodies.stiffness()
    u = bodies.columns().copy()
    return lambda: matrix @ u


def _fastest(comm: MPI.Comm, once: Callable[[], Any], trials: int = 20) -> float:
    """Seconds of processor time of one call, the fastest of several stretches; collective."""
    start = time.process_time()
    once()
    calls = int(np.clip(_SECONDS / max(time.process_time() - start, 1e-5), 3, 500))
    calls = comm.allreduce(calls, op=MPI.MIN)  # a call may be collective
    best = np.inf
    for _ in range(trials):
        start = time.process_time()
        for _ in range(calls):
            once()
        best = min(best, (time.process_time() - start) / calls)
    return best


def _scene(case: Case, comm: MPI.Intracomm, finite: bool) -> Scene:
    bond = Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= _A0 - 1e-9, name="bond",
        contact=True,
    )  # fmt: skip
    if case.dim == 2:
        mesh = meshes.dcb_2d(comm, length=case.length, height=1.5, dx=case.dx, ny=case.ny)
        ends, z = ("pin_top", "pin_bottom"), None
    else:
        mesh = meshes.dcb_3d(comm, length=case.length, dx=case.dx, dy=case.dy, ny=case.ny)
        ends, z = ("end_upper", "end_lower"), 0.0
    return Scene(
        mesh,
        materials=Isotropic(70e3, 0.3, density=2.7e-9),
        model=PlaneStrain(thickness=20.0) if case.dim == 2 else Solid(),
        supports=[
            Displacement(ends[0], x=0.0, y=_SPEED, z=z),
            Displacement(ends[1], x=0.0, y=-_SPEED, z=z),
        ],
        debonds=[Debond(bond, VCCT(GIc=0.2))],
        effects=[Inertia(), FiniteStrain()] if finite else [Inertia()],
    )


__all__ = ["CASES", "Case", "run"]
