"""The scene: what the user writes. Composition only; the layers below do the work."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.base.checks import check_instance, check_list, flag
from fxcrack.base.errors import InputError
from fxcrack.base.together import check_same_call, in_collective_call
from fxcrack.condensation.options import CondensedOptions
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.couplings import Constraint
from fxcrack.continuum.foundation import Stabilise
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.kinematics import Model, Shell
from fxcrack.continuum.loads import Displacement, Load, Monitor
from fxcrack.continuum.materials import Material
from fxcrack.continuum.node_supports import Support
from fxcrack.continuum.section import Section
from fxcrack.effects import form_terms
from fxcrack.error_estimate import as_details, check_accuracy, demand
from fxcrack.history import History
from fxcrack.interface.definition import Interface
from fxcrack.interface.pair import Pair
from fxcrack.interface.supports import Supports
from fxcrack.mesh import Mesh
from fxcrack.output.explain import Explanation, explain
from fxcrack.restart.checkpoint import Checkpoint
from fxcrack.restart.manager import RunFiles
from fxcrack.scene_input import SceneInput, compose, solver_of_path
from fxcrack.solvers.base import AnySolver
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.solvers.options import NewtonOptions
from fxcrack.step_run import check_step, checked_observers, run_step
from fxcrack.steps.crack import Crack
from fxcrack.steps.cycle_state import FatigueState
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.debond import Debond
from fxcrack.steps.end_conditions import Time
from fxcrack.steps.energy_check import REFUSED, check_energy
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.explicit_rules import (
    check_interfaces,
    check_start,
    warn_of_step_release,
    warn_of_ties,
)
from fxcrack.steps.explicit_setup import paired_by_nodes, start_from, use_explicit_solver
from fxcrack.steps.release_choice import check_friction
from fxcrack.steps.rows import Observer
from fxcrack.steps.static import Static


class Scene:
    """Bodies, interfaces, supports and loads of one analysis.

    Args:
        mesh: Mesh with named groups.
        materials: One material (a :class:`Section` of shells), or one per cell group.
        model: Kinematic model.
        supports: Prescribed displacements, rigid couplings and linear equations.
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
        stabilise: A weak foundation under bodies that only contact holds, so that an equilibrium
            exists before faces touch: a small number s, or one for each of some cell groups. Its
            stiffness per volume is s c/L^2, c the largest modulus of the materials and L the size
            of the group. Its energy is the column ``stabilising_energy``; a warning says where it
            is more than 1 % of the strain energy.
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
        supports: Sequence[Displacement | Support | Constraint] = (),
        loads: Sequence[Load] = (),
        debonds: Sequence[Debond] = (),
        bonds: Sequence[Interface] = (),
        monitors: Sequence[Monitor] = (),
        order: int | None = None,
        options: CondensedOptions | None = None,
        effects: Sequence[Any] = (),
        solver: str | None = None,
        newton: NewtonOptions | None = None,
        stabilise: Stabilise | None = None,
        path: str | None = None,
    ) -> None:
        self._n_warned = log.n_warned()
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
            solver=solver if path is None else solver_of_path(path, solver),
            newton=newton,
            stabilise=stabilise,
        )
        given = {f.name: getattr(self.input, f.name) for f in fields(self.input)}
        check_same_call(
            mesh.comm, "Scene(...)", given | {"mesh": f"'{mesh.name}' of {mesh.gdim} dimensions"}
        )
        self.analysis = compose(self.input)
        found = [(pair.bonded, pair.friction) for pair in self.pairs]
        check_same_call(
            mesh.comm, "Scene(...)", {"bonded nodes and friction of the interfaces": found}
        )
        self._files = RunFiles()

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse a change of what the scene was made of, which nothing would take up.

        Raises:
            InputError: It is not part of the state.
        """
        if not name.startswith("_") and name not in ("input", "analysis", "history"):
            known = name in {f.name for f in fields(SceneInput)}
            raise InputError(
                f"a scene is not changed by scene.{name} = ...; make another one of the same "
                + (f"parts, scene.rebuilt({name}=...)" if known else "parts by scene.rebuilt(...)")
            )
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        """Mesh, model, interfaces and present time."""
        names = ", ".join(f"'{i.title}'" for i in self.input.interfaces) or "none"
        return (
            f"<Scene of mesh '{self.mesh.name}', {type(self.input.model).__name__}, interfaces: "
            f"{names}, time {self.time:g}>"
        )

    def __reduce_ex__(self, protocol: Any) -> NoReturn:
        """Refuse copying and pickling, which also subprocesses do with what they are given.

        Raises:
            InputError: Always.
        """
        raise InputError(
            "a scene holds a distributed mesh and factorisations and cannot be copied or pickled; "
            "make another one of the same parts, scene.rebuilt(), keep its state by "
            "checkpoint=Checkpoint(path), or pass on scene.history"
        )

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
        return tuple(self.analysis.debonds)

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
            progress: Show load, crack length, f and time while running: one line of a terminal,
                lines of the log (``fxcrack.progress``) where there is none.
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
        observers = checked_observers(observers)
        if checkpoint is not None:
            example = "Checkpoint('run.npz')"
            check_instance("run", "checkpoint", checkpoint, Checkpoint, example)
        if save is not None:
            check_instance("run", "save", save, (str, Path), "'history.csv'")
        check_instance("run", "step", step, (Static, Cycles, Explicit), "Static(until=Time(1.0))")
        chosen = self.debonds if grow is None else check_list("run", "grow", grow, Debond)
        check_step(self.analysis, step, chosen)
        given = {
            **{"step": step, "grow": [d.interface.title for d in chosen], "accuracy": accuracy},
            **{"save": save, "checkpoint": checkpoint, "restart": restart},
            "observers": len(observers),
        }
        check_same_call(self.mesh.comm, "Scene.run", given)
        with in_collective_call():
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
        else:
            check_friction(chosen, self.analysis.pairs)
        first = run_step(
            self.analysis, step, chosen, self._files,
            checkpoint=checkpoint, restart=restart, save=save,
            progress=progress, observers=observers,
        )  # fmt: skip
        free = self.input.newton is not None and self.input.newton.balance == np.inf
        solver = self.solver
        check_energy(
            self.history,
            first,
            refused=np.inf if free else REFUSED,
            round_off=solver.accepted.energy_noise if isinstance(solver, NewtonSolver) else 0.0,
        )
        if accuracy is not None and not isinstance(step, Explicit):
            self.history.details["accuracy"] = as_details(demand(self, step, accuracy, chosen))
        return self.history

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
        warn_of_ties(self.pairs[len(given.debonds) :])
        others = [e for e in given.effects if not isinstance(e, Inertia)]
        begins = not isinstance(self.solver, ExplicitSolver)
        if begins and step.start == "equilibrium":
            check_start(self.continuum, given.interfaces)
        use_explicit_solver(self.analysis, lambda c: form_terms(c, others, given.loads))
        warn_of_step_release(chosen)
        if begins and step.start == "equilibrium":
            still = self.rebuilt(effects=others, **paired_by_nodes(given.debonds, given.bonds))
            # amplitudes that are there from the first moment; those that grow have not begun
            still.run(Static(until=Time(1e-12 * step.end_time)), grow=[], progress=False)
            start_from(self.analysis, still.analysis)
            still.close()

    def explain(self) -> Explanation:
        """Print which effects are on, how the scene is solved and why, and what it has cost.

        Collective; returns what it prints.
        """
        found = explain(self)
        if self.mesh.comm.rank == 0:
            print(found)
        return found

    def _repr_html_(self) -> str:
        """What :meth:`explain` says, for notebooks."""
        return explain(self)._repr_html_()

    def report(self, path: str | Path, *, title: str = "Crack growth analysis") -> None:
        """Write one HTML file about the steps run so far; collective.

        It holds the explanation, the description of the history, the warnings since the scene was
        made, the accuracy if it was asked for, pictures of load, growth and energies, the cost by
        phase and the rows of the history.

        Args:
            path: HTML file.
            title: Heading.

        Raises:
            InputError: No step was run yet, or Jinja2 is not installed.
            FxcrackError: The file could not be written.
        """
        try:
            from fxcrack.output.report import write_report  # loads Jinja2 and matplotlib
        except ModuleNotFoundError as error:
            raise InputError(
                f"report needs {error.name}, which is not installed; install it "
                f"(pip install {error.name}, Debian: python3-{error.name})"
            ) from error
        write_report(self, path, title=title, warnings=log.warned_since(self._n_warned))

    def close(self) -> None:
        """Free all PETSc objects; collective. The history stays.

        It happens by itself when the scene is no longer used: on one rank at once, on several when
        the next scene is made there.
        """
        self.solver.destroy()


__all__ = ["Debond", "Scene", "SceneInput"]
