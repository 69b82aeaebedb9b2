"""A step of a scene: whether it can be run, the state it begins in, its driver, its costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fxcrack.base import log
from fxcrack.base.checks import is_function, list_of
from fxcrack.base.errors import InputError, SolverError
from fxcrack.base.machine import threads_share_cores
from fxcrack.base.together import check_same_call
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.linear_range import warn_of_large_strain, warn_of_range
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.effects import is_finite
from fxcrack.equilibrium.growing_cholesky import NotPositiveDefinite
from fxcrack.history import Details, Row
from fxcrack.interface.front import why_no_tip
from fxcrack.interface.set_motions import warn_of_turns
from fxcrack.interface.supported_slaves import tell_of_held_bonds
from fxcrack.restart.checkpoint import Checkpoint
from fxcrack.restart.manager import RestartManager, RunFiles
from fxcrack.solvers.explicit import ExplicitSolver
from fxcrack.solvers.linear import LinearSolver
from fxcrack.solvers.second_order_effects import warn_of_second_order
from fxcrack.steps.analysis import Analysis
from fxcrack.steps.cycles import Cycles, check_criteria
from fxcrack.steps.cyclic import run_cycles
from fxcrack.steps.debond import Debond
from fxcrack.steps.driver import held_by_contact
from fxcrack.steps.end_conditions import CrackLength, Time
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.explicit_driver import run_explicit
from fxcrack.steps.explicit_setup import prepare_explicit
from fxcrack.steps.progress import Progress
from fxcrack.steps.quasi_static import run_static
from fxcrack.steps.rows import Observer
from fxcrack.steps.share_done import ShareDone
from fxcrack.steps.solver_work import SolverWork
from fxcrack.steps.static import Dynamic, Static
from fxcrack.steps.unit_check import warn_of_units


def check_step(
    analysis: Analysis, step: Static | Cycles | Explicit, chosen: Sequence[Debond]
) -> None:
    """Refuse a step that a scene cannot run.

    Args:
        analysis: The analysis of the scene.
        step: The step.
        chosen: Debonds that may grow in it.

    Raises:
        InputError: What is wrong with it.
    """
    for debond in chosen:
        if debond not in analysis.debonds:
            raise InputError(
                f"debond of interface '{debond.interface.title}' is not part of the scene"
            )
    for end in step.ends:
        if isinstance(end, Time) and end.time < analysis.time * (1.0 - 1e-12):
            raise InputError(
                f"Time({end.time:g}) is past: the scene is at time {analysis.time:g} already; give "
                "a later end"
            )
    check_criteria(step, chosen)
    if isinstance(step, Explicit):
        if analysis.stabilise is not None:
            raise InputError(
                "Explicit: stabilise is for equilibria; bodies in explicit dynamics need no "
                "supports, so leave it out"
            )
        return
    for pair in analysis.pairs:
        if pair.interface.stiffness is not None and not analysis.linear:
            raise InputError(
                f"interface '{pair.interface.title}': bonds with a stiffness of their own are for "
                "linear bodies and for Explicit; leave stiffness out in "
                f"{type(step).__name__} steps of nonlinear or moving bodies, whose bonds hold "
                "exactly"
            )
    effects = analysis.effects
    if isinstance(analysis.solver, ExplicitSolver):
        raise InputError(
            f"{type(step).__name__}: this scene has moved by explicit dynamics, and other "
            "steps cannot follow; make another scene for them, scene.rebuilt()"
        )
    if isinstance(step, Dynamic) and not any(isinstance(e, Inertia) for e in effects):
        raise InputError(
            "Dynamic moves bodies that have inertia, and the scene has none; write "
            "Scene(..., effects=[Inertia()]) with densities, or use a Static step"
        )


def checked_observers(observers: object) -> Sequence[Observer]:
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


def _warn_of_threads(analysis: Analysis) -> None:
    """Say once where threads and ranks compete for the cores."""
    why = threads_share_cores(analysis.comm)
    if why and "threads" not in analysis.said:
        analysis.said.add("threads")
        log.warn("%s, which slows all of them; set OMP_NUM_THREADS=1 before mpirun", why)


def run_step(
    analysis: Analysis,
    step: Static | Cycles | Explicit,
    chosen: Sequence[Debond],
    files: RunFiles,
    *,
    checkpoint: Checkpoint | None,
    restart: bool,
    save: str | Path | None,
    progress: bool,
    observers: Sequence[Observer],
) -> int:
    """Run a step, or go on with one; its rows and details are in the history then. Collective.

    Args:
        analysis: The analysis, with the solver for the step.
        step: What to do and when to stop.
        chosen: Debonds that may grow in it.
        files: What the steps of the scene share.
        checkpoint: Where and how often the state is saved.
        restart: Continue from the checkpoint if there is one.
        save: File that holds the history while the step runs.
        progress: Show the progress, on a terminal or as lines of the log.
        observers: Called with the name of every event and its row.

    Returns:
        Number of rows that were there before, those of a step that is resumed included.
    """
    _warn_of_threads(analysis)
    may_grow = [d in chosen for d in analysis.debonds]
    may_grow += [False] * (len(analysis.pairs) - len(analysis.debonds))
    analysis.activate(chosen, step)
    for g in analysis.active:
        # without a bonded set the scene has said so already
        if g.debond.interface.bonded is not None and not len(g.tips()):
            log.warn("%s, so nothing can debond", why_no_tip(g.front))
    _check_lengths(analysis, step)
    tough = [getattr(g.evaluator, "toughness", None) for g in analysis.cracks]
    check_same_call(analysis.comm, "Scene.run", {"toughness at the slave nodes": tough})
    warn_of_units(analysis.active, analysis.continuum, analysis.said)
    restarts = files.manager(analysis, step, may_grow, checkpoint, restart, save)
    try:
        _prepare(analysis, restarts, may_grow, step)
    except NotPositiveDefinite as error:
        raise SolverError(held_by_contact(error.why)) from error
    first = len(analysis.history)
    try:
        analysis.history.reason = restarts.finished or _drive(
            analysis, step, restarts,
            number=files.steps, progress=progress, observers=observers,
        )  # fmt: skip
    except NotPositiveDefinite as error:
        raise SolverError(held_by_contact(error.why)) from error
    analysis.history.details = _details(analysis)
    _warn_of_displacement(analysis)
    return first


def _warn_of_displacement(analysis: Analysis) -> None:
    """Warn where the displacement at the end of a step is beyond what was assumed; collective."""
    solver, continuum = analysis.solver, analysis.continuum
    # not worth a factorisation of its own, which a direct solver needs on several ranks
    linear = isinstance(solver, LinearSolver) and solver.recovers_displacement
    plastic = any(getattr(m, "form", "") == "plastic" for m in continuum.part_materials)
    constraints = solver.supports.constraints if is_finite(continuum, analysis.effects) else ()
    if not (linear or plastic or constraints):
        return
    u = solver.displacement()
    now = u.array_r.copy()
    u.destroy()
    if isinstance(solver, LinearSolver) and linear:
        if not isinstance(continuum, ShellBodies):
            warn_of_range(continuum, now, analysis.said)
        if continuum.temperature is not None:
            continuum.temperature.set(analysis.time)
        warn_of_second_order(solver, now, analysis.said)
    if plastic:
        warn_of_large_strain(continuum, now, analysis.said)
    if constraints:
        warn_of_turns(continuum, constraints, now)


def _check_lengths(analysis: Analysis, step: Static | Cycles | Explicit) -> None:
    """Refuse a crack length that the crack exceeds already; warn of one it never reaches.

    Raises:
        InputError: It does; a length that is just reached ends the step at once.
    """
    for end in step.ends:
        if not isinstance(end, CrackLength):
            continue
        for g in analysis.active:
            if g.debond.interface is end.interface and len(g.tips()):
                length = g.extent.length(g.tips())
                if length > end.length + 1e-9 * abs(length):
                    raise InputError(
                        f"CrackLength({end.length:g}): the crack of '{g.title}' is {length:g} long "
                        "already; lengths count from the end of the surface at which it is open; "
                        "give a larger one"
                    )
                largest = g.extent.largest
                if end.length > largest * (1.0 + 1e-6):
                    log.warn(
                        "CrackLength(%g): the crack of '%s' cannot be longer than %g, when the "
                        "interface is open all over; the step ends then at the latest",
                        end.length, g.title, largest,
                    )  # fmt: skip


def _prepare(
    analysis: Analysis,
    restarts: RestartManager,
    may_grow: list[bool],
    step: Static | Cycles | Explicit,
) -> None:
    """Condense around the present fronts and find the equilibrium to begin with."""
    if isinstance(step, Explicit):
        prepare_explicit(analysis, step, may_grow, resumes=restarts.resumes)
        if restarts.resumes:
            restarts.put_in_equilibrium()
        return
    solver = analysis.condensed
    if not (restarts.resumes or analysis.started) and isinstance(step, Static):
        solver.begin_motion(step.initial)
    solver.prepare(may_grow, _reach(analysis, step))
    if restarts.resumes:
        restarts.put_in_equilibrium()
    elif not analysis.started:
        for pair, held in zip(analysis.pairs, solver.held_by_supports, strict=True):
            tell_of_held_bonds(pair, held)
        solver.start()
        analysis.book_start()
    analysis.started = True


def _drive(
    analysis: Analysis,
    step: Static | Cycles | Explicit,
    restarts: RestartManager,
    *,
    number: int,
    progress: bool,
    observers: Sequence[Observer],
) -> str:
    """Run the step; returns why it ended."""
    show = Progress(analysis.comm, ShareDone(step), number=number, enabled=progress)
    with restarts, show:
        every: list[Observer] = [SolverWork(analysis, number), show, *observers]

        def tell(event: str, row: Row) -> None:
            for observe in every:
                observe(event, row)

        controls: dict[str, Any] = {
            "observer": tell,
            "checkpoint_point": restarts.checkpoint_point if restarts.wanted else None,
            "resume": restarts.progress,
        }
        if isinstance(step, Explicit):
            solver = analysis.solver
            assert isinstance(solver, ExplicitSolver)
            reason = run_explicit(analysis, solver, step, **controls)
        elif isinstance(step, Cycles):
            reason = run_cycles(analysis, step, **controls)
        else:
            reason = run_static(analysis, step, **controls)
        analysis.history.reason = reason
        restarts.finish(reason)
    log.info("step %d ended: %s", number, reason)
    return reason


def _details(analysis: Analysis) -> Details:
    """What else is worth keeping with the history, plain types only."""
    solver = analysis.solver
    details = Details(
        {
            "dofs": analysis.continuum.n_global,
            "releases": sum(g.n_released for g in analysis.cracks),
            "factorizations": solver.timings.factorizations,
            "ranks": analysis.comm.size,
            "seconds": dict(solver.timings.seconds),
        }
    )
    if isinstance(solver, ExplicitSolver):
        return Details(details | solver.about())
    system = analysis.condensed.system
    details |= {"retained": system.n_retained, "contact_steps": system.contact_steps}
    if analysis.fatigue.table["N"]:
        details["tips"] = analysis.fatigue.table
    return details


def _reach(analysis: Analysis, step: Static | Cycles | Explicit) -> list[float]:
    """How far each crack may grow in a step, length."""
    out = [np.inf] * len(analysis.pairs)
    for end in step.ends:
        if isinstance(end, CrackLength):
            for g in analysis.cracks:
                if g.debond.interface is end.interface:
                    ahead = end.length - g.extent.length(g.tips())
                    size = analysis.pairs[g.p].surface.facet_size
                    if analysis.mesh.gdim == 3:
                        ahead *= 1.1
                    out[g.p] = max(ahead, 0.0) + 2.5 * size
    return out


__all__ = ["check_step", "checked_observers", "run_step"]
