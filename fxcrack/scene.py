"""The scene: what the user writes. Composition only; the layers below do the work."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.base.checks import check_amplitudes, check_instance, check_list, warn_of_same_titles
from fxcrack.base.errors import InputError
from fxcrack.condensation.options import CondensedOptions
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.kinematics import Axisymmetric, Model, PlaneStrain, PlaneStress, Solid
from fxcrack.continuum.loads import (
    BodyForce,
    Displacement,
    Load,
    Monitor,
    PointForce,
    Pressure,
    Traction,
)
from fxcrack.continuum.materials import Material
from fxcrack.effects import dead_loads, form_terms, plan, temperature_of
from fxcrack.error_estimate import as_details, check_accuracy, demand
from fxcrack.history import History, Row
from fxcrack.interface.front import why_no_tip
from fxcrack.interface.pairing import Interface, make_pair
from fxcrack.interface.supports import collect_supports, warn_of_held_bonds
from fxcrack.mesh import Mesh
from fxcrack.output.explain import Explanation, explain
from fxcrack.restart.checkpoint import Checkpoint
from fxcrack.restart.manager import RestartManager, restart_manager
from fxcrack.solvers.base import Solver
from fxcrack.solvers.linear import LinearSolver
from fxcrack.solvers.options import NewtonOptions
from fxcrack.steps.crack import Crack
from fxcrack.steps.cycle_state import FatigueState
from fxcrack.steps.cycles import Cycles, check_criteria
from fxcrack.steps.cyclic import CyclicDriver
from fxcrack.steps.debond import Debond, check_friction
from fxcrack.steps.end_conditions import CrackLength
from fxcrack.steps.force_ramps import ForceRamp
from fxcrack.steps.progress import Progress
from fxcrack.steps.quasi_static import Observer, QuasiStaticDriver
from fxcrack.steps.static import Dynamic, Static


class Scene:
    """Bodies, interfaces, supports and loads of one analysis.

    Args:
        mesh: Mesh with named groups.
        materials: One material, or one per cell group.
        model: Kinematic model.
        supports: Prescribed displacements.
        loads: Force patterns.
        debonds: Interfaces that may come apart, with their criterion.
        bonds: Interfaces that stay as they are (bonded parts tied, open parts open).
        monitors: Displacements to watch.
        order: Order of the displacement; that of the mesh by default.
        options: How the continuum is condensed.
        effects: What the bodies do beyond small linear elasticity: :class:`FiniteStrain`,
            :class:`Temperature`, :class:`Inertia`.
        path: "newton" sends a scene without such effects through the nonlinear solver all the
            same; by default the effects decide.
        newton: Controls of the nonlinear solver, where it is used.

    Raises:
        InputError: The parts contradict each other; the message says which and how to mend it.
    """

    def __init__(
        self,
        mesh: Mesh,
        *,
        materials: Material | Mapping[str, Material],
        model: Model,
        supports: Sequence[Displacement] = (),
        loads: Sequence[Load] = (),
        debonds: Sequence[Debond] = (),
        bonds: Sequence[Interface] = (),
        monitors: Sequence[Monitor] = (),
        order: int | None = None,
        options: CondensedOptions | None = None,
        effects: Sequence[Any] = (),
        path: str | None = None,
        newton: NewtonOptions | None = None,
    ) -> None:
        self.parts = {k: v for k, v in locals().items() if k not in ("self", "mesh")}
        check_instance("Scene", "mesh", mesh, Mesh, "read_mesh('mine.msh')")
        check_instance(
            "Scene", "model", model, (PlaneStrain, PlaneStress, Axisymmetric, Solid), "Solid()"
        )
        supports = check_list("Scene", "supports", supports, Displacement)
        loads = check_list("Scene", "loads", loads, (Traction, Pressure, BodyForce, PointForce))
        check_amplitudes([*supports, *loads])
        warn_of_same_titles("loads", loads)
        debonds = check_list("Scene", "debonds", debonds, Debond)
        bonds = check_list("Scene", "bonds", bonds, Interface)
        monitors = check_list("Scene", "monitors", monitors, Monitor)
        warn_of_same_titles("monitors", monitors)
        if newton is not None:
            check_instance(
                "Scene", "newton", newton, NewtonOptions, "NewtonOptions(max_iterations=40)"
            )
        if options is not None:
            check_instance(
                "Scene", "options", options, CondensedOptions, "CondensedOptions(rows=2.0)"
            )
        if not isinstance(effects, Sequence):
            raise InputError(
                f"Scene: effects must be a list, not {type(effects).__name__}; write effects=[...]"
            )
        interfaces = [d.interface for d in debonds] + bonds
        titles = [i.title for i in interfaces]
        for title in titles:
            if titles.count(title) > 1:
                raise InputError(
                    f"interface '{title}' appears twice; give one criterion per interface and "
                    "different names to different interfaces"
                )
        self.mesh = mesh
        self.debonds = debonds
        self.effects = list(effects)
        self.continuum = Continuum(
            mesh, materials, model, order=order, temperature=temperature_of(self.effects)
        )
        self.pairs = [make_pair(self.continuum, i) for i in interfaces]
        check_friction(self.debonds, self.pairs)
        self.supports = collect_supports(self.continuum, supports)
        self.plan = plan(self.continuum, self.effects, loads, interfaces, path)
        self.loads = dead_loads(self.continuum, loads, self.plan.path)
        parts = self.continuum, self.pairs, self.supports, self.loads, monitors
        self.solver: Solver
        if self.plan.path == "condensed":
            self.solver = LinearSolver(*parts, options or CondensedOptions())
        else:
            from fxcrack.continuum.weak_form import WeakForm
            from fxcrack.solvers.newton import NewtonSolver  # only scenes that need it pay

            terms = form_terms(self.continuum, self.effects, loads)
            self.solver = NewtonSolver(
                *parts,
                options or CondensedOptions(rows=0.0),
                bodies=WeakForm(self.continuum, terms),
                newton=newton or NewtonOptions(),
            )
        self.cracks: list[Crack] = []
        self.time = 0.0
        self._work = 0.0
        self._released = 0.0
        self._snapped = 0.0
        self._viscous = 0.0
        self.ramps: list[ForceRamp] = []
        self._increment = 0
        self.fatigue = FatigueState()
        self.history = History(mesh.comm)
        self._started = False
        self.steps = 0
        self.run_id = ""
        self.kept: tuple[Checkpoint, Path, bool] | None = None

    def loads_at(self, time: float) -> Array:
        """Amplitudes of all supports and load factors at a time."""
        values = [c.coordinate(time) for c in self.supports.columns]
        return np.array(values + [load.amplitude(time) for load in self.loads])

    def _breaks(self) -> tuple[float, ...]:
        moving = [c.support.amplitude for c in self.supports.columns if c.moves]
        every = moving + [load.amplitude for load in self.loads]
        if self.continuum.temperature is not None:
            every += self.continuum.temperature.amplitudes
        return tuple(sorted({b for a in every for b in a.breaks()}))

    def run(
        self,
        step: Static | Cycles,
        *,
        grow: Sequence[Debond] | None = None,
        progress: bool = True,
        observers: Sequence[Observer] = (),
        accuracy: float | None = None,
        save: str | Path | None = None,
        checkpoint: Checkpoint | None = None,
        restart: bool = False,
    ) -> History:
        """Run a step and return the history of all steps so far; collective.

        Args:
            step: What to do and when to stop.
            grow: Debonds that may grow in this step; all by default. The others stay tied.
            progress: Show load, crack length and f while running (on a terminal only).
            observers: Called on all ranks with the name of every event and its row of the
                history, e.g. :class:`fxcrack.output.fields.FieldSeries`.
            accuracy: Relative error that load and G may have for the mesh's and the increments'
                sake. After the run it is estimated from a second solution to the first onset (see
                :mod:`fxcrack.error_estimate`), which is kept in ``history.details``.
            save: File (.csv or .json) that holds the history while the step runs.
            checkpoint: Where and how often the state is saved.
            restart: Go on from the checkpoint if there is one; with the same scene and step, on
                any number of ranks.

        Raises:
            AccuracyError: The accuracy is not reached, or cannot be judged; says what would reach
                it. The history is kept.
            InputError: The scene and the step do not go together, or the checkpoint belongs to
                another scene.
            Interrupted: Ctrl-C or SIGTERM came while ``save`` or ``checkpoint`` was given.
        """
        if accuracy is not None:
            check_accuracy(accuracy)
        check_instance("run", "step", step, (Static, Cycles), "Static(until=Time(1.0))")
        chosen = self.debonds if grow is None else check_list("run", "grow", grow, Debond)
        for debond in chosen:
            if debond not in self.debonds:
                raise InputError(
                    f"debond of interface '{debond.interface.title}' is not part of the scene"
                )
        check_criteria(step, chosen)
        if isinstance(step, Dynamic) and not any(isinstance(e, Inertia) for e in self.effects):
            raise InputError(
                "Dynamic moves bodies that have inertia, and the scene has none; write "
                "Scene(..., effects=[Inertia()]) with densities, or use a Static step"
            )
        active = [d in chosen for d in self.debonds]
        active += [False] * (len(self.pairs) - len(self.debonds))
        if not self._started:
            self.cracks = [Crack(self.solver, p, d) for p, d in enumerate(self.debonds)]
        cracks = [g for g, on in zip(self.cracks, active, strict=False) if on]
        for g in cracks:
            if not len(g.tips()):
                log.warn("%s, so nothing can debond", why_no_tip(g.front))
        keeper = restart_manager(self, step, active, checkpoint, restart, save)
        self.solver.prepare(active, self._reach(step))
        if keeper.resume is not None:
            keeper.put_in_equilibrium()
            self._take_books(keeper.resume)
            self._started = True
        elif not self._started:
            for pair, held in zip(self.pairs, self.solver.held_by_supports, strict=True):
                warn_of_held_bonds(pair, held)
            self.solver.start()
            self._started = True
        self.history.reason = keeper.finished or self._go(
            cracks, step, keeper, progress=progress, observers=observers
        )
        self.history.details = {
            "dofs": self.continuum.n_global,
            "window": self.solver.system.n_retained,
            "releases": sum(g.n_released for g in self.cracks),
            "factorizations": self.solver.timings.factorizations,
            "ranks": self.mesh.comm.size,
            "contact_steps": self.solver.system.contact_steps,
            "seconds": dict(self.solver.timings.seconds),
        }
        if self.fatigue.table["N"]:
            self.history.details["tips"] = self.fatigue.table
        if accuracy is not None:
            self.history.details["accuracy"] = as_details(demand(self, step, accuracy, chosen))
        return self.history

    def _go(
        self,
        cracks: list[Crack],
        step: Static | Cycles,
        keeper: RestartManager,
        *,
        progress: bool,
        observers: Sequence[Observer],
    ) -> str:
        """March; returns why the step ended."""
        with keeper, Progress(self.mesh.comm, enabled=progress) as show:
            every: list[Observer] = [show, *observers]

            def tell(event: str, row: Row) -> None:
                for observe in every:
                    observe(event, row)

            march = self._march(
                cracks,
                step,
                time=self.time,
                work=self._work,
                released=self._released,
                snapped=self._snapped,
                viscous=self._viscous,
                ramps=self.ramps,
                increment=self._increment,
                observer=tell,
                checkpoint_point=keeper.checkpoint_point if keeper.wanted else None,
                resume=keeper.resume,
            )
            try:
                reason = march.run()
            finally:
                self._take_books(march.carried())
            self.history.reason = reason
            keeper.finish(march, reason)
            return reason

    def _take_books(self, books: dict[str, Any]) -> None:
        """Time and energies of a march."""
        self.time, self._work, self._released = books["time"], books["work"], books["released"]
        self._snapped, self._viscous = books["snapped"], books["viscous"]
        self._increment = books["increment"]

    def _march(
        self, cracks: list[Crack], step: Static | Cycles, **carried: Any
    ) -> QuasiStaticDriver:
        common = self.history, self.loads_at, self._breaks()
        if self.plan.path == "newton":
            from fxcrack.steps.newton_path import NewtonLoadPath

            if isinstance(step, Cycles):
                raise InputError(
                    "fatigue steps need linear bodies, but this scene takes the nonlinear path "
                    f"({'; '.join(self.plan.why)}); leave that effect out, or run Static steps"
                )
            return NewtonLoadPath(self.solver, cracks, step, *common, **carried)
        if isinstance(step, Cycles):
            carried["fatigue"] = self.fatigue
            return CyclicDriver(self.solver, cracks, step, *common, **carried)
        return QuasiStaticDriver(self.solver, cracks, step, *common, **carried)

    def _reach(self, step: Static | Cycles) -> list[float]:
        """How far each crack may grow in a step, length."""
        out = [np.inf] * len(self.pairs)
        for end in step.ends:
            if isinstance(end, CrackLength):
                for g in self.cracks:
                    if self.pairs[g.p].interface is end.interface:
                        ahead = end.length - g.extent.length(g.tips())
                        size = self.pairs[g.p].surface.facet_size
                        if self.mesh.gdim == 3:
                            ahead *= 1.1
                        out[g.p] = max(ahead, 0.0) + 2.5 * size
        return out

    def explain(self) -> Explanation:
        """Print which effects are on, how the scene is solved and why, and what it has cost.

        Collective; returns what it prints.
        """
        found = explain(self)
        if self.mesh.comm.rank == 0:
            print(found)
        return found

    def close(self) -> None:
        """Free all PETSc objects; collective. The history stays.

        On one rank this happens by itself when the scene is no longer used. On several it does not:
        close scenes made in a loop, for MPI has a limited number of communicators.
        """
        self.solver.destroy()


__all__ = ["Debond", "Scene"]
