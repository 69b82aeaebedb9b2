"""What must hold in every row of a random scene, whatever it is."""

from __future__ import annotations

import gc
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import fxcrack as fx  # isort: skip  (orders MPI before DOLFINx)
import numpy as np
from mpi4py import MPI

from fxcrack.history import Row
from stability.combinations import (
    AS_DRAWN,
    Combination,
    Described,
    reference_of,
    scene_of,
    step_of,
)

BALANCE = {"linear": 1e-8, "newton": 1e-4, "finite": 1e-4, "neo-Hookean": 1e-4, "plastic": 1e-3,
           "temperature": 1e-4, "inertia": 1e-8, "finite, inertia": 1e-8}  # fmt: skip
"""Part of the largest energy that may be missing. Linear bodies: the events of softening bonds are
found to 1e-6 of their force. Nonlinear ones: increments are divided at 1e-5 each, but for the
smallest; plastic ones: contact that closes in the smallest leaves the square of it. Bodies in
motion keep their energy to the residual of the iteration."""

LIMITS = {"penetration": 1e-8, "force on what is released": 1e-6, "dissipation falls": 1e-8,
          "bonded again": 0.0, "f off 1 at onset": 1e-5, "f above 1": 1e-5}  # fmt: skip
"""Parts of the largest jump, force and work. Forces of nonlinear bodies are known to 1e-8 of the
largest in the bodies, which interfaces need not carry; onsets are found to 1e-6."""

OF_SOFTENING = 5e-3
"""Likewise of bonds that soften in mixed mode at rest: until they are free they have no contact."""

KEPT = ("friction_energy", "plastic_energy")
"""Energies that never come back."""


class Invariants:
    """What must hold in every row; an observer.

    Attributes:
        worst: Largest violation of each invariant, over its measure.
    """

    def __init__(self, c: Combination, scene: fx.Scene) -> None:
        self._c, self._scene = c, scene
        self._jump = self._force = 0.0
        self.worst: dict[str, float] = defaultdict(float)
        self._spent: dict[str, float] = {}
        self._work = 1e-300
        self._released = 0.0

    def _see(self, name: str, value: float) -> None:
        self.worst[name] = max(self.worst[name], value)

    def __call__(self, event: str, row: Row) -> None:
        """Look at the state of a row."""
        solver: Any = self._scene.solver
        system, state = solver.system, solver.state
        n = system.n_retained
        self._jump = max(self._jump, float(np.abs(state.jump).max(initial=0.0)), 1e-300)
        force = system.forces(state, np.arange(n))
        self._force = max(self._force, float(np.abs(force).max(initial=0.0)), 1e-300)
        rows = system.contact
        if rows.any():
            gap = (state.jump + system.gap)[rows]
            self._see("penetration", -float(gap.min()) / self._jump)
        soft = np.zeros(n, dtype=bool)
        soft[system.soft.components] = True
        free = system.free & ~soft & ~system.closed
        if free.any() and system.friction is None:
            wrong = np.abs(force - state.force)[free].max()
            self._see("force on what is released", float(wrong) / self._force)
        self._energies(row)
        self._growth(event, row)

    def _energies(self, row: Row) -> None:
        self._work = max(self._work, abs(float(row["external_work"])))
        # in motion a bond loses its force over an increment in which its faces may close
        once = self._c.release == "step" and not self._c.dynamic
        kept = (*KEPT, "released_energy") if once else KEPT
        for name in kept:
            value = float(row.get(name, 0.0))
            self._see("dissipation falls", (self._spent.get(name, 0.0) - value) / self._work)
            self._spent[name] = max(value, self._spent.get(name, 0.0))

    def _growth(self, event: str, row: Row) -> None:
        released = sum(float(v) for k, v in row.items() if k.startswith("released["))
        self._see("bonded again", self._released - released)
        self._released = max(self._released, released)
        largest = max((float(v) for k, v in row.items() if k.startswith("f[")), default=0.0)
        if self._c.stepping == "increment":
            # after the first release unstable growth is allowed at any f
            if event == "increment" and not self._c.dynamic and not released:
                growth = self._scene.debonds[0].criterion
                self._see("f above 1", largest - 1.0 - growth.tolerance)
        elif event == "onset":
            self._see("f off 1 at onset", abs(largest - 1.0))
        elif event == "unstable":
            # after a release f may be anything above 1: the next one follows at once
            self._see("f off 1 at onset", 1.0 - largest)
            # faces in friction stick as the load turns back, where f may jump over 1
            if self._c.stepping == "path" and self._c.friction is None:
                self._see("f off 1 at onset", largest - 1.0)
        elif event == "bend":
            self._see("f above 1", largest - 1.0)


@dataclass
class Result:
    """What came of a scene: where it ended, how well each invariant held."""

    reason: str
    worst: dict[str, float]
    history: fx.History | None


def run_scene(
    c: Combination,
    how: Described = AS_DRAWN,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    *,
    observers: tuple[Any, ...] = (),
    **options: Any,
) -> Result:
    """Run a scene and measure its invariants; what is refused as input says so; collective.

    Args:
        c: The scene.
        how: Its description.
        comm: Communicator.
        observers: More observers of the run.
        **options: For :meth:`fxcrack.Scene.run`.
    """
    amplitude, step = step_of(c)
    try:
        scene = scene_of(c, amplitude, reference_of(c), comm, how)
    except fx.InputError as error:
        return Result(f"refused: {error}", {}, None)
    watch = Invariants(c, scene)
    try:
        history = scene.run(step, observers=[watch, *observers], progress=False, **options)
        reason = history.reason
    except fx.InputError as error:
        return Result(f"refused: {error}", {}, scene.history)
    except fx.EnergyError as error:
        history, reason = scene.history, f"energy: {error}"
    finally:
        scene.close()
    names = ("external_work", "strain_energy", "kinetic_energy")
    sizes = [np.abs(history[k].astype(float)).max() for k in names if k in history.columns]
    watch.worst["balance"] = float(
        np.abs(history["balance"].astype(float)).max() / max(*sizes, 1e-300)
    )
    gc.collect()
    return Result(reason, dict(watch.worst), history)


def faults(c: Combination, result: Result) -> list[str]:
    """Invariants that do not hold."""
    limits = {**LIMITS, "balance": BALANCE[c.bodies]}
    if c.release != "step" and not c.dynamic:
        limits["penetration"] = OF_SOFTENING
    out = [f"{k} {v:.1e}" for k, v in result.worst.items() if not v <= limits[k]]
    return out + ([result.reason] if result.reason.startswith(("stopped", "energy")) else [])
