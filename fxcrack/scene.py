"""The scene: what the user writes. Composition only; the layers below do the work."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.base.checks import (
    check_amplitudes,
    check_instance,
    check_list,
    flag,
    is_function,
    list_of,
    shown,
    text,
    warn_of_same_titles,
)
from fxcrack.base.errors import InputError
from fxcrack.base.together import inside, meet
from fxcrack.condensation.options import CondensedOptions
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.kinematics import (
    Axisymmetric,
    Model,
    PlaneStrain,
    PlaneStress,
    Shell,
    Solid,
)
from fxcrack.continuum.loads import (
    BodyForce,
    Displacement,
    Load,
    Moment,
    Monitor,
    PointForce,
    PointMoment,
    Pressure,
    Traction,
)
from fxcrack.continuum.materials import Material
from fxcrack.continuum.node_supports import Clamp, Rotation, Support, Symmetry
from fxcrack.continuum.section import Section
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.effects import dead_loads, form_terms, plan, temperature_of
from fxcrack.error_estimate import as_details, check_accuracy, demand
from fxcrack.history import History, Row
from fxcrack.interface.front import why_no_tip
from fxcrack.interface.pairing import Interface, Pair, make_pair
from fxcrack.interface.supports import Supports, collect_supports, warn_of_held_bonds
from fxcrack.mesh import Mesh
from fxcrack.output.explain import Explanation, explain
from fxcrack.restart.checkpoint import Checkpoint
from fxcrack.restart.manager import RestartManager, RunFiles
from fxcrack.solvers.base import AnySolver, Solver
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.solvers.linear import LinearSolver
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.solvers.options import NewtonOptions
from fxcrack.steps.analysis import Analysis, EnergyBalance
from fxcrack.steps.crack import Crack
from fxcrack.steps.cycle_state import FatigueState
from fxcrack.steps.cycles import Cycles, check_criteria
from fxcrack.steps.cyclic import run_cycles
from fxcrack.steps.debond import Debond, check_friction
from fxcrack.steps.end_conditions import CrackLength, Time
from fxcrack.steps.energy_check import REFUSED, check_energy
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.explicit_driver import run_explicit
from fxcrack.steps.explicit_rules import check_interfaces, warn_of_step_release
from fxcrack.steps.explicit_setup import prepare_explicit, start_from, use_explicit_solver
from fxcrack.steps.progress import Progress
from fxcrack.steps.quasi_static import run_static
from fxcrack.steps.rows import Observer
from fxcrack.steps.static import Dynamic, Static


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneInput:
    """What a scene is made of, as data: a scene can be built from it again.

    Attributes as the arguments of :class:`Scene`.

    Raises:
        InputError: A part is of the wrong kind, or names are used twice.
    """

    mesh: Mesh
    materials: Material | Section | Mapping[str, Material] | Mapping[str, Section]
    model: Model | Shell
    supports: Sequence[Displacement | Support] = ()
    loads: Sequence[Load] = ()
    debonds: Sequence[Debond] = ()
    bonds: Sequence[Interface] = ()
    monitors: Sequence[Monitor] = ()
    order: int | None = None
    options: CondensedOptions | None = None
    effects: Sequence[Any] = ()
    solver: str | None = None
    newton: NewtonOptions | None = None

    def __post_init__(self) -> None:
        """Check kinds and names."""
        check_instance("Scene", "mesh", self.mesh, Mesh, "read_mesh('mine.msh')")
        check_instance(
            "Scene",
            "model",
            self.model,
            (PlaneStrain, PlaneStress, Axisymmetric, Solid, Shell),
            "Solid()",
        )
        self._take_list("supports", (Displacement, Clamp, Symmetry, Rotation))
        self._take_list("loads", (Traction, Pressure, BodyForce, PointForce, Moment, PointMoment))
        check_amplitudes([*self.supports, *self.loads])
        warn_of_same_titles("loads", self.loads)
        self._take_list("debonds", Debond)
        self._take_list("bonds", Interface)
        self._take_list("monitors", Monitor)
        warn_of_same_titles("monitors", self.monitors)
        if self.newton is not None:
            check_instance(
                "Scene", "newton", self.newton, NewtonOptions, "NewtonOptions(max_iterations=40)"
            )
        if self.options is not None:
            check_instance(
                "Scene", "options", self.options, CondensedOptions, "CondensedOptions(rows=2.0)"
            )
        if list_of(self.effects) is None:
            raise InputError(
                f"Scene: effects must be a list, not {type(self.effects).__name__}; write "
                "effects=[...]"
            )
        self._check_materials()
        text("Scene", "solver", self.solver, optional=True)
        titles = [i.title for i in self.interfaces]
        for title in titles:
            if titles.count(title) > 1:
                raise InputError(
                    f"interface '{title}' appears twice; give one criterion per interface and "
                    "different names to different interfaces"
                )

    def _check_materials(self) -> None:
        """Check that each material is one, and each key of a dictionary a name."""
        listed: list[Any] = [self.materials]
        if isinstance(self.materials, Mapping):
            listed = list(self.materials.values())
            for name in self.materials:
                text("Scene: materials", "a cell group", name)
            if not self.materials:
                raise InputError("Scene: materials is empty; give one, e.g. Isotropic(70e3, 0.3)")
        for material in listed:
            if isinstance(material, type) or not hasattr(material, "stiffness"):
                raise InputError(
                    f"materials: {shown(material)} is not a material; give one, e.g. "
                    "Isotropic(E=70e3, nu=0.3), or one per cell group, {'name': Isotropic(...)}"
                )

    def _take_list(self, name: str, kinds: type | tuple[type, ...]) -> None:
        """Check a list of parts and keep a copy."""
        object.__setattr__(self, name, check_list("Scene", name, getattr(self, name), kinds))

    @property
    def interfaces(self) -> list[Interface]:
        """Those that may debond, then those that stay as they are."""
        return [d.interface for d in self.debonds] + list(self.bonds)


class Scene:
    """Bodies, interfaces, supports and loads of one analysis.

    Args:
        mesh: Mesh with named groups.
        materials: One material (a :class:`Section` of shells), or one per cell group.
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
        solver: "newton" sends a scene without such effects through the nonlinear solver all the
            same; by default the effects decide between it and "linear".
        newton: Controls of the nonlinear solver, where it is used.
        path: Former name of ``solver``, deprecated; "condensed" stands for "linear".

    Attributes:
        input: The arguments, from which :meth:`rebuilt` builds another scene.
        analysis: What the scene is made of and all that changes while its steps are run.

    Raises:
        InputError: The parts contradict each other; the message says which and how to correct it.
    """

    def __init__(
        self,
        mesh: Mesh,
        *,
        materials: Material | Section | Mapping[str, Material] | Mapping[str, Section],
        model: Model | Shell,
        supports: Sequence[Displacement | Support] = (),
        loads: Sequence[Load] = (),
        debonds: Sequence[Debond] = (),
        bonds: Sequence[Interface] = (),
        monitors: Sequence[Monitor] = (),
        order: int | None = None,
        options: CondensedOptions | None = None,
        effects: Sequence[Any] = (),
        solver: str | None = None,
        newton: NewtonOptions | None = None,
        path: str | None = None,
    ) -> None:
        self.input = SceneInput(
            mesh=mesh,
            materials=materials,
            model=model,
            supports=supports,
            loads=loads,
            debonds=debonds,
            bonds=bonds,
            monitors=monitors,
            order=order,
            options=options,
            effects=effects,
            solver=solver if path is None else _solver_of_path(path, solver),
            newton=newton,
        )
        given = {f.name: getattr(self.input, f.name) for f in fields(self.input)}
        meet(mesh.comm, "Scene(...)", given | {"mesh": f"'{mesh.name}' of {mesh.gdim} dimensions"})
        self.analysis = _analysis(self.input)
        found = [(pair.bonded, pair.friction) for pair in self.pairs]
        meet(mesh.comm, "Scene(...)", {"bonded nodes and friction of the interfaces": found})
        self._files = RunFiles()

    def rebuilt(self, **changes: Any) -> Scene:
        """A new scene of the same input; collective.

        Args:
            **changes: Arguments of :class:`Scene` that are to be others.
        """
        given = {f.name: getattr(self.input, f.name) for f in fields(self.input)}
        return type(self)(**{**given, **changes})

    @property
    def mesh(self) -> Mesh:
        """The mesh."""
        return self.input.mesh

    @property
    def debonds(self) -> Sequence[Debond]:
        """Interfaces that may come apart."""
        return self.analysis.debonds

    @property
    def continuum(self) -> Continuum:
        """The bodies."""
        return self.analysis.continuum

    @property
    def pairs(self) -> list[Pair]:
        """Paired interfaces: those of the debonds, then the bonds."""
        return self.analysis.pairs

    @property
    def supports(self) -> Supports:
        """Prescribed displacement components."""
        return self.solver.supports

    @property
    def loads(self) -> list[Load]:
        """Force patterns; pressures that follow the bodies are not among them."""
        return self.solver.loads

    @property
    def solver(self) -> AnySolver:
        """The solver with its present equilibrium."""
        return self.analysis.solver

    @property
    def cracks(self) -> list[Crack]:
        """One per debond, once a step was run."""
        return self.analysis.cracks

    @property
    def fatigue(self) -> FatigueState:
        """What cycles leave behind for later ones."""
        return self.analysis.fatigue

    @property
    def time(self) -> float:
        """Present time."""
        return self.analysis.time

    @property
    def history(self) -> History:
        """Rows of all steps so far."""
        return self.analysis.history

    @history.setter
    def history(self, history: History) -> None:
        self.analysis.history = history

    def loads_at(self, time: float) -> Array:
        """Amplitudes of all supports and load factors at a time, shape (n_loads,)."""
        return self.analysis.loads_at(time)

    def run(
        self,
        step: Static | Cycles | Explicit,
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
            restart: Continue from the checkpoint if there is one; with the same scene and step, on
                any number of ranks.

        Raises:
            EnergyError: The energies of the step do not balance to 1 % of the largest one (beyond
                0.1 % it is a warning). The history is kept.
            AccuracyError: The accuracy is not reached, or cannot be judged; says what would reach
                it. The history is kept.
            InputError: The scene and the step are not compatible, or the checkpoint belongs to
                another scene.
            Interrupted: Ctrl-C or SIGTERM came while ``save`` or ``checkpoint`` was given.
        """
        if accuracy is not None:
            check_accuracy(accuracy)
        progress, restart = flag("run", "progress", progress), flag("run", "restart", restart)
        observers = _checked_observers(observers)
        if checkpoint is not None:
            example = "Checkpoint('run.npz')"
            check_instance("run", "checkpoint", checkpoint, Checkpoint, example)
        if save is not None:
            check_instance("run", "save", save, (str, Path), "'history.csv'")
        check_instance("run", "step", step, (Static, Cycles, Explicit), "Static(until=Time(1.0))")
        chosen = self.debonds if grow is None else check_list("run", "grow", grow, Debond)
        self._check_step(step, chosen)
        given = {
            **{"step": step, "grow": [d.interface.title for d in chosen], "accuracy": accuracy},
            **{"save": save, "checkpoint": checkpoint, "restart": restart},
            "observers": len(observers),
        }
        meet(self.mesh.comm, "Scene.run", given)
        with inside():
            return self._run(step, chosen, accuracy, save, checkpoint, progress, restart, observers)

    def _run(
        self,
        step: Static | Cycles | Explicit,
        chosen: Sequence[Debond],
        accuracy: float | None,
        save: str | Path | None,
        checkpoint: Checkpoint | None,
        progress: bool,
        restart: bool,
        observers: Sequence[Observer],
    ) -> History:
        """Run a step whose arguments were checked; collective."""
        if isinstance(step, Explicit):
            self._use_explicit(step, chosen, accuracy)
        analysis = self.analysis
        may_grow = [d in chosen for d in self.debonds]
        may_grow += [False] * (len(self.pairs) - len(self.debonds))
        analysis.activate(chosen)
        for g in analysis.active:
            if not len(g.tips()):
                log.warn("%s, so nothing can debond", why_no_tip(g.front))
        tough = [getattr(g.evaluator, "toughness", None) for g in analysis.cracks]
        meet(self.mesh.comm, "Scene.run", {"toughness at the slave nodes": tough})
        restarts = self._files.manager(analysis, step, may_grow, checkpoint, restart, save)
        self._prepare(restarts, may_grow, step)
        first = len(self.history)
        self.history.reason = restarts.finished or self._go(
            step, restarts, progress=progress, observers=observers
        )
        self.history.details = self._details()
        free = self.input.newton is not None and self.input.newton.balance == np.inf
        solver = self.solver
        check_energy(
            self.history,
            first,
            refused=np.inf if free else REFUSED,
            round_off=solver.energy_round_off() if isinstance(solver, NewtonSolver) else 0.0,
        )
        if accuracy is not None and not isinstance(step, Explicit):
            self.history.details["accuracy"] = as_details(demand(self, step, accuracy, chosen))
        return self.history

    def _check_step(self, step: Static | Cycles | Explicit, chosen: Sequence[Debond]) -> None:
        """Refuse steps that the scene cannot run."""
        for debond in chosen:
            if debond not in self.debonds:
                raise InputError(
                    f"debond of interface '{debond.interface.title}' is not part of the scene"
                )
        for end in step.ends:
            if isinstance(end, Time) and end.time < self.time * (1.0 - 1e-12):
                raise InputError(
                    f"Time({end.time:g}) is past: the scene is at time {self.time:g} already; give "
                    "a later end"
                )
        check_criteria(step, chosen)
        if isinstance(step, Explicit):
            return
        effects, why = self.analysis.effects, self.analysis.plan.why
        if isinstance(self.solver, ExplicitSolver):
            raise InputError(
                f"{type(step).__name__}: this scene has moved by explicit dynamics, and other "
                "steps cannot follow; make another scene for them, scene.rebuilt()"
            )
        if isinstance(step, Dynamic) and not any(isinstance(e, Inertia) for e in effects):
            raise InputError(
                "Dynamic moves bodies that have inertia, and the scene has none; write "
                "Scene(..., effects=[Inertia()]) with densities, or use a Static step"
            )
        if isinstance(step, Cycles) and not self.analysis.linear:
            raise InputError(
                "fatigue steps need linear bodies, but this scene takes the nonlinear solver "
                f"({'; '.join(why)}); leave that effect out, or run Static steps"
            )

    def _prepare(
        self, restarts: RestartManager, may_grow: list[bool], step: Static | Cycles | Explicit
    ) -> None:
        """Condense around the present fronts and find the equilibrium to begin with."""
        analysis = self.analysis
        if isinstance(step, Explicit):
            prepare_explicit(analysis, step, may_grow, resumes=restarts.resumes)
            if restarts.resumes:
                restarts.put_in_equilibrium()
            return
        solver = analysis.condensed
        solver.prepare(may_grow, self._reach(step))
        if restarts.resumes:
            restarts.put_in_equilibrium()
        elif not analysis.started:
            for pair, held in zip(self.pairs, solver.held_by_supports, strict=True):
                warn_of_held_bonds(pair, held)
            solver.start()
            analysis.book_start()
        analysis.started = True

    def _use_explicit(
        self, step: Explicit, chosen: Sequence[Debond], accuracy: float | None
    ) -> None:
        """Let the scene move by explicit dynamics; collective."""
        if accuracy is not None:
            raise InputError(
                "accuracy is estimated from a quasi-static solution, which Explicit does not have; "
                "leave accuracy out, and compare with a finer mesh"
            )
        given = self.input
        check_interfaces(chosen, given.bonds)
        others = [e for e in given.effects if not isinstance(e, Inertia)]
        begins = not isinstance(self.solver, ExplicitSolver)
        use_explicit_solver(
            self.analysis, given.loads, lambda c: form_terms(c, others, given.loads)
        )
        warn_of_step_release(chosen)
        if begins and step.start == "equilibrium":
            still = self.rebuilt(effects=others)
            # amplitudes that are there from the first moment; those that grow have not begun
            still.run(Static(until=Time(1e-12 * step.end_time)), grow=[], progress=False)
            start_from(self.analysis, still.analysis)
            still.close()

    def _go(
        self,
        step: Static | Cycles | Explicit,
        restarts: RestartManager,
        *,
        progress: bool,
        observers: Sequence[Observer],
    ) -> str:
        """Run the step; returns why it ended."""
        with restarts, Progress(self.mesh.comm, enabled=progress) as show:
            every: list[Observer] = [show, *observers]

            def tell(event: str, row: Row) -> None:
                for observe in every:
                    observe(event, row)

            controls: dict[str, Any] = {
                "observer": tell,
                "checkpoint_point": restarts.checkpoint_point if restarts.wanted else None,
                "resume": restarts.progress,
            }
            if isinstance(step, Explicit):
                assert isinstance(self.solver, ExplicitSolver)
                reason = run_explicit(self.analysis, self.solver, step, **controls)
            elif isinstance(step, Cycles):
                reason = run_cycles(self.analysis, step, **controls)
            else:
                reason = run_static(self.analysis, step, **controls)
            self.history.reason = reason
            restarts.finish(reason)
            return reason

    def _details(self) -> dict[str, Any]:
        """What else is worth keeping with the history, plain types only."""
        solver = self.solver
        details: dict[str, Any] = {
            "dofs": self.continuum.n_global,
            "releases": sum(g.n_released for g in self.cracks),
            "factorizations": solver.timings.factorizations,
            "ranks": self.mesh.comm.size,
            "seconds": dict(solver.timings.seconds),
        }
        if isinstance(solver, ExplicitSolver):
            return details | solver.about()
        system = self.analysis.condensed.system
        details |= {"window": system.n_retained, "contact_steps": system.contact_steps}
        if self.fatigue.table["N"]:
            details["tips"] = self.fatigue.table
        return details

    def _reach(self, step: Static | Cycles | Explicit) -> list[float]:
        """How far each crack may grow in a step, length."""
        out = [np.inf] * len(self.pairs)
        for end in step.ends:
            if isinstance(end, CrackLength):
                for g in self.cracks:
                    if g.debond.interface is end.interface:
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

        It happens by itself when the scene is no longer used: on one rank at once, on several when
        the next scene is made there.
        """
        self.solver.destroy()


def _checked_observers(observers: object) -> Sequence[Observer]:
    """The observers of a run as a list.

    Raises:
        InputError: They are not in a list, or one cannot be called.
    """
    found = list_of(observers)
    if found is None:
        raise InputError("run: observers must be a list; write observers=[...]")
    for i, observe in enumerate(found):
        if not is_function(observe):
            raise InputError(
                f"run: observers[{i}] is {type(observe).__name__}; give a function of (event, row)"
            )
    return found


def _solver_of_path(path: str, solver: str | None) -> str:
    """The solver that the former argument ``path`` asked for, with a warning."""
    warnings.warn(
        "Scene(path=...) is now called Scene(solver=...), with solver='linear' for "
        "path='condensed'; the former name will be removed",
        DeprecationWarning,
        stacklevel=3,
    )
    if solver is not None:
        raise InputError("Scene: path is the former name of solver; give solver alone")
    return "linear" if path == "condensed" else path


def _analysis(given: SceneInput) -> Analysis:
    """The analysis of a scene; collective."""
    kind: Any = ShellBodies if isinstance(given.model, Shell) else Continuum
    continuum: Continuum = kind(
        given.mesh,
        given.materials,
        given.model,
        order=given.order,
        temperature=temperature_of(given.effects),
    )
    supports = collect_supports(continuum, list(given.supports))
    pairs = [
        make_pair(
            continuum,
            one,
            others=[i for i in given.interfaces if i is not one],
            supported=supports.which,
            lumped=any(isinstance(e, Inertia) for e in given.effects),
        )
        for one in given.interfaces
    ]
    check_friction(given.debonds, pairs)
    chosen = plan(continuum, given.effects, given.loads, given.interfaces, given.solver)
    loads = dead_loads(continuum, given.loads, chosen.solver)
    parts = continuum, pairs, supports, loads, list(given.monitors)
    solver: Solver
    if chosen.solver == "linear":
        solver = LinearSolver(*parts, given.options or CondensedOptions())
    else:
        solver = NewtonSolver(
            *parts,
            given.options or CondensedOptions(rows=0.0),
            bodies=WeakForm(continuum, form_terms(continuum, given.effects, given.loads)),
            newton=given.newton or NewtonOptions(),
        )
    return Analysis(
        continuum,
        solver,
        list(given.debonds),
        chosen,
        list(given.effects),
        History(given.mesh.comm),
        EnergyBalance(),
    )


__all__ = ["Debond", "Scene", "SceneInput"]
