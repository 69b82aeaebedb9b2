"""What a quasi-static step keeps: the state, its energies, its tips, the rows of the history.

Energy is accounted for piece by piece: work of supports and force patterns by the trapezoidal
rule (exact, everything is linear in between), released energy by the bond forces on their way
to zero; their balance with the strain energy is a check on all of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array, Ints
from fxcrack.base.errors import ComesApart, InputError
from fxcrack.criteria.evaluator import TipValues
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.history import History, Row
from fxcrack.solvers.base import Solver
from fxcrack.steps.crack import Crack
from fxcrack.steps.end_conditions import CrackLength, Releases, Time
from fxcrack.steps.force_ramps import (
    ForceRamp,
    PrescribedRamp,
    ViscousCohesiveRamp,
    ViscousRamp,
    bond_forces_of,
    given_forces,
    still_pulling,
)
from fxcrack.steps.static import Static

Observer = Callable[[str, Row], None]

LARGE = 1e60
"""A time that is never reached: the step has no end time."""


class StepDriver:
    """The books of one quasi-static step on a condensed model.

    Args:
        solver: Model with its present state; prepared for the step.
        cracks: Activated debonds.
        step: Controls.
        history: Where rows go.
        loads_at: Amplitudes and load factors at a time, shape (n_loads,).
        breaks: Times at which an amplitude changes its slope.
        time: Present time.
        work: External work so far.
        released: Energy that left through bonds so far.
        snapped: The part of it lost where softening bonds ran through unstable states.
        ramps: Bonds that are letting go with time or over increments; goes on in place.
        increment: Number of increments so far.
        observer: Called with the event's name and the row after every event.
        checkpoint_point: Called between two increments or releases, where the step could go on from
            :meth:`carried` and the state of the scene.
        resume: Books of an earlier run of the step to go on from.
    """

    def __init__(
        self,
        solver: Solver,
        cracks: list[Crack],
        step: Static,
        history: History,
        loads_at: Callable[[float], Array],
        breaks: tuple[float, ...],
        *,
        time: float = 0.0,
        work: float = 0.0,
        released: float = 0.0,
        snapped: float = 0.0,
        viscous: float = 0.0,
        ramps: list[ForceRamp] | None = None,
        increment: int = 0,
        observer: Observer | None = None,
        checkpoint_point: Callable[[StepDriver], None] | None = None,
        resume: dict[str, Any] | None = None,
    ) -> None:
        self.solver = solver
        self.cracks = cracks
        self.step = step
        self.history = history
        self.loads_at = loads_at
        self.breaks = breaks
        self.time = time
        self.work = work
        self.released = released
        self._observer = observer
        self._at_rest = checkpoint_point
        self._resume = resume
        self._names = self._column_names()
        self._end_time = min([u.time for u in step.ends if isinstance(u, Time)], default=LARGE)
        self._values: list[TipValues] = []
        self._ramps: list[ForceRamp] = [] if ramps is None else ramps
        self.increment = increment
        self.viscous = viscous
        # all energy that left through bonds but the softening ones
        self._by_force = released - solver.system.soft.taken(solver.state.jump) - snapped

    def carried(self) -> dict[str, Any]:
        """Energies and counters, plain values, with which the step can go on later."""
        return {
            "time": self.time,
            "work": self.work,
            "released": self.released,
            "snapped": self.snapped,
            "viscous": self.viscous,
            "increment": self.increment,
        }

    def _at_checkpoint_point(self) -> None:
        """Say that nothing is half done."""
        if self._at_rest is not None:
            self._at_rest(self)

    def _force_at(self, time: float) -> Array:
        """Given forces of bonds that are letting go, shape (n_retained,)."""
        return given_forces(self.solver, self._ramps, time, self.increment)

    def _hit(
        self,
        values: list[TipValues],
        here: Equilibrium,
        point: Equilibrium,
        times: tuple[float, float],
        *,
        upward: bool,
    ) -> float | None:
        """Fraction of a linear piece at which the largest f of all interfaces crosses 1."""
        found = [
            g.crossing(v, here, point, times, upward=upward)
            for g, v in zip(self.cracks, values, strict=True)
        ]
        if upward:
            return min([x for x in found if x is not None], default=None)
        # all interfaces must be below 1; one without tips does not count
        waiting = [x for x, v in zip(found, values, strict=True) if len(v.tips)]
        if not waiting or None in waiting:
            return None
        return max(x for x in waiting if x is not None)

    def _advance(self, here: Equilibrium, point: Equilibrium, time: float) -> None:
        """Move along a piece and account for its energy."""
        work, released, mean = self.solver.along(here, point)
        self.work += work
        self.released += released
        self.solver.book_friction(here, point)
        for ramp in self._ramps:
            index = self.solver.components(ramp.p, ramp.nodes)
            force, last = here.force[index], point.force[index]
            spent = float(force @ here.jump[index] - last @ point.jump[index])
            spent += float((last - force) @ mean[index])
            self._by_force += spent
            self.viscous += ramp.viscous_part(spent, self.solver, here.jump, point.jump)
        self.solver.state = point
        self.time = time

    # -- letting go ----------------------------------------------------------------------

    def _release_critical(self, *, all_ready: bool = False) -> None:
        """Release the critical nodes (or all with f >= 1) at the present load, and say so."""
        self._free(all_ready=all_ready)
        self._record("release")

    def _free(self, *, all_ready: bool = False) -> None:
        """Release the critical nodes (or all with f >= 1) at the present load."""
        for g, v in zip(self.cracks, self._values, strict=True):
            if all_ready:
                ready = np.flatnonzero(v.f >= g.criterion.release_range[0])
            elif v.f.max(initial=0.0) >= max(self._largest()) * (1.0 - 1e-6):
                ready = g.ready(v)
            else:
                continue
            if not len(ready):
                continue
            self._release(g, g.nodes_of(v, ready), v)
        self._update_tips()

    def _release(self, g: Crack, nodes: Ints, values: TipValues) -> None:
        """Let nodes of one interface go, at once or with time."""
        before = self.solver.state
        self._open(g, nodes, values)
        g.record(nodes, values, before, self.time)  # not where a body would come free

    def _open(self, g: Crack, nodes: Ints, values: TipValues) -> None:
        law = g.debond.release
        viscosity = g.criterion.viscosity
        ramp: ForceRamp | None = None
        if g.opening_driven:
            units = g.to_soften(nodes, values)
            if viscosity > 0.0:
                ramp = ViscousCohesiveRamp.begin(self.solver, g.p, units, viscosity, self.time)
            else:
                self.solver.soften(g.p, units)
        elif law.driver != "once":
            now = self.time if law.driver == "time" else float(self.increment)
            ramp = PrescribedRamp.begin(self.solver, g.p, nodes, law, now)
        elif viscosity > 0.0:
            force = bond_forces_of(self.solver, g.p, nodes)
            ramp = ViscousRamp(g.p, nodes, force, viscosity, self.time)
        else:
            self._open_at_once(g, nodes)
        if ramp is not None:
            self._ramps[:] = [*still_pulling(self._ramps, self.time, self.increment), ramp]
            self.solver.open(g.p, ramp.nodes)

    def _open_at_once(self, g: Crack, nodes: Ints) -> None:
        """Take the bond forces of nodes away at constant load."""
        if not len(nodes):
            return
        energy, work = self.solver.release(g.p, nodes, self._force_at(self.time))
        self.released += energy
        self._by_force += energy
        self.work += work

    def _update_tips(self) -> None:
        """Find tips anew, factor again if the window does not hold them, evaluate."""
        tips = [g.tips() for g in self.cracks]
        if not all(g.held(t) for g, t in zip(self.cracks, tips, strict=True)):
            self.solver.rebase()
            for g, t in zip(self.cracks, tips, strict=True):
                g.check_wake(t)
        self._values = [
            g.evaluate(t, self.solver.state, self.time)
            for g, t in zip(self.cracks, tips, strict=True)
        ]

    def _evaluate(self) -> list[TipValues]:
        return [
            g.evaluate(v.tips, self.solver.state, self.time)
            for g, v in zip(self.cracks, self._values, strict=True)
        ]

    def _largest(self) -> list[float]:
        return [float(v.f.max(initial=0.0)) for v in self._values] or [0.0]

    # -- ends and rows -------------------------------------------------------------------

    def _ended(self) -> str:
        for end in self.step.ends:
            if isinstance(end, Time) and self.time >= end.time * (1.0 - 1e-14):
                return f"time {end.time:g} reached"
            if isinstance(end, Releases) and sum(g.n_released for g in self.cracks) >= end.count:
                return f"{end.count} nodes released"
            if isinstance(end, CrackLength):
                g = self._growth_of(end)
                tips = self._values[self.cracks.index(g)].tips
                length = g.extent.length(tips)
                if length >= end.length * (1.0 - 1e-9):
                    return f"crack length {end.length:g} of '{g.title}' reached"
        if self.cracks and not any(len(v.tips) for v in self._values):
            if self._end_time < LARGE and self.time < self._end_time:
                return ""
            return "no crack tip is left"
        return ""

    def _growth_of(self, end: CrackLength) -> Crack:
        for g in self.cracks:
            if self.solver.pairs[g.p].interface is end.interface:
                return g
        raise InputError(
            f"CrackLength names interface '{end.interface.title}', which has no active Debond in "
            "this step"
        )

    def _separated(self, error: NotPositiveDefinite | ComesApart) -> str:
        what = (
            "the load exceeds what is left of the interface"
            if isinstance(error, ComesApart)
            else "letting the next node go would leave a body held by nothing"
        )
        reason = f"total separation: {what}; the step ends in the last equilibrium before it"
        log.warn("%s", reason)
        return reason

    @property
    def snapped(self) -> float:
        """Energy lost where softening bonds ran through unstable states."""
        return (
            self.released - self._by_force - self.solver.system.soft.taken(self.solver.state.jump)
        )

    def _column_names(self) -> list[tuple[str, str, bool]]:
        moving = [(c.title, c.moves) for c in self.solver.supports.columns]
        names = [(f"u[{t}]", f"R[{t}]", m) for t, m in moving]
        return names + [(f"F[{x.title}]", f"v[{x.title}]", True) for x in self.solver.loads]

    def _record(self, event: str) -> None:
        state, solver = self.solver.state, self.solver
        stored, spent = solver.stored(state), solver.spent()
        work = self.work + solver.extra_work(state)
        row: Row = {"time": float(self.time), "event": event}
        for (load, answer, moves), a, r in zip(
            self._names, state.loads, state.conjugate, strict=True
        ):
            if moves:
                row[load] = float(a)
            row[answer] = float(r)
        # displacements that criteria follow come after those of the user
        for monitor, value in zip(solver.monitors, solver.system.monitors(state), strict=False):
            row[f"m[{monitor.title}]"] = float(value)
        for g, v in zip(self.cracks, self._values, strict=True):
            row[f"a[{g.title}]"] = g.extent.length(v.tips)
            row[f"area[{g.title}]"] = g.extent.area(v.tips)
            row[f"released[{g.title}]"] = g.n_released
            g.look_for_overlap(v.tips, state)
            if len(v.tips):
                i = v.largest
                row[f"f[{g.title}]"] = float(v.f[i])
                for name, quantity in v.report.items():
                    row[f"{name}[{g.title}]"] = float(quantity[i])
                row[f"node[{g.title}]"] = int(v.tips.node[i])
        row |= stored
        row["external_work"] = work
        row["released_energy"] = self.released - self.viscous
        if self.viscous:
            row["viscous_energy"] = self.viscous
        if solver.system.soft.bonds or solver.system.soft.finished:
            row["snap_energy"] = self.snapped
        if solver.system.friction is not None:
            row["friction_energy"] = solver.friction_energy
        row |= spent
        gone = self.released + solver.friction_energy + sum(spent.values())
        row["balance"] = work - sum(stored.values()) - gone
        self.history.append(row)
        if self._observer is not None:
            self._observer(event, row)
