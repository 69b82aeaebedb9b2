"""The state of an analysis between two increments or releases, as plain values and arrays.

Everything the rest of the history depends on: interfaces, bonds that are released with time,
records of releases, fatigue, energies, counters, and the history itself. All of it is the same on
every rank.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any, cast, get_args

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.equilibrium.cohesive_law import CohesiveBond
from fxcrack.equilibrium.contact import Equilibrium
from fxcrack.equilibrium.friction_state import FrictionMemory
from fxcrack.interface.finite_sliding import CHANGING, changing, with_changing
from fxcrack.restart.checkpoint import Arrays, Saved
from fxcrack.solvers.linear import LinearSolver
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.steps.analysis import Analysis, EnergyBalance
from fxcrack.steps.bond_records import ReleaseRecord
from fxcrack.steps.crack import Crack
from fxcrack.steps.force_ramps import ForceRamp

_SAME = 1e-9
"""Loads are numbers of the input: they differ by round-off or by far more."""


def collect(analysis: Analysis) -> Saved:
    """State of an analysis; collective."""
    fatigue = analysis.fatigue
    arrays = collect_states(analysis.solver)
    if not analysis.solver.linear:
        arrays |= collect_bodies(cast("NewtonSolver", analysis.solver))
    for g in analysis.cracks:
        arrays |= _collect_records(g)
    for i, ramp in enumerate(analysis.ramps):
        arrays |= _ramp_arrays(i, ramp)
    for p in fatigue.waiting:
        arrays[f"fatigue.waiting[{p}]"] = fatigue.waiting[p]
        arrays[f"fatigue.credit[{p}]"] = fatigue.credit[p]
    about = {
        "balance": analysis.balance.asdict(),
        "ramps": [_ramp(r) for r in analysis.ramps],
        "fatigue": {"N": fatigue.N, "pairs": list(fatigue.waiting), "table": fatigue.table},
        "rows": analysis.history.rows,
    }
    return Saved(about, arrays)


def apply_before_condensation(analysis: Analysis, saved: Saved) -> None:
    """Put a new analysis into a saved state, up to what needs the retained jumps."""
    about, arrays = saved.about, saved.arrays
    analysis.balance = EnergyBalance(**about["balance"])
    analysis.history.rows[:] = about["rows"]
    analysis.set_ramps([_ramp_of(analysis, i, r, arrays) for i, r in enumerate(about["ramps"])])
    apply_bonds(analysis.solver, arrays)
    if not analysis.solver.linear:
        apply_bodies(cast("NewtonSolver", analysis.solver), arrays, analysis.time)
    for g in analysis.cracks:
        _apply_records(g, arrays)
    fatigue, known = analysis.fatigue, about["fatigue"]
    fatigue.N = known["N"]
    fatigue.table = known["table"]
    for p in known["pairs"]:
        fatigue.waiting[p] = np.asarray(arrays[f"fatigue.waiting[{p}]"], dtype=bool)
        fatigue.credit[p] = np.asarray(arrays[f"fatigue.credit[{p}]"], dtype=float)


def apply_after_condensation(analysis: Analysis, saved: Saved) -> None:
    """Put an analysis whose jumps are condensed into the saved equilibrium.

    Raises:
        InputError: Loads or jumps are not those that were saved.
    """
    before, now = saved.arrays["loads"].astype(float), analysis.loads_at(analysis.time)
    if not np.allclose(before, now, rtol=_SAME, atol=_SAME * np.abs(before).max(initial=0.0)):
        raise InputError(
            f"the checkpoint does not fit: at time {analysis.time:g} amplitudes and load factors "
            f"were {before.tolist()}, they are {now.tolist()}. Run without restart, or mend the "
            "scene"
        )
    if not analysis.solver.linear:
        apply_accepted(cast("NewtonSolver", analysis.solver), saved.arrays)
        return
    force = analysis.given_force(analysis.time)
    apply_equilibrium(analysis.solver, saved.arrays, force)


def _collect_records(growth: Crack) -> Arrays:
    """One array per field of the records, first axis the releases."""
    return {
        f"record.{f.name}[{growth.p}]": np.array([getattr(r, f.name) for r in growth.records])
        for f in fields(ReleaseRecord)
    }


def _apply_records(growth: Crack, arrays: Arrays) -> None:
    names = [f.name for f in fields(ReleaseRecord)]
    columns = [arrays[f"record.{name}[{growth.p}]"].tolist() for name in names]
    growth.records = [ReleaseRecord(*map(_field, row)) for row in zip(*columns, strict=True)]
    growth.n_released = len(growth.records)


def _field(value: Any) -> Any:
    """A number, three of them as a tuple, or a matrix."""
    if not isinstance(value, list):
        return value
    return np.array(value) if isinstance(value[0], list) else tuple(value)


def _ramp(ramp: ForceRamp) -> dict[str, Any]:
    """Kind and plain values of a bond that lets go; arrays and its law are kept elsewhere."""
    values = {f.name: getattr(ramp, f.name) for f in fields(ramp)}
    numbers = {k: v for k, v in values.items() if isinstance(v, bool | int | float)}
    return {"kind": type(ramp).__name__, **numbers}


def _ramp_arrays(i: int, ramp: ForceRamp) -> Arrays:
    values = {f.name: getattr(ramp, f.name) for f in fields(ramp)}
    return {f"ramp.{k}[{i}]": v for k, v in values.items() if isinstance(v, np.ndarray)}


def _ramp_of(analysis: Analysis, i: int, known: dict[str, Any], arrays: Arrays) -> ForceRamp:
    kind = next(k for k in get_args(ForceRamp) if k.__name__ == known["kind"])
    values: dict[str, Any] = {k: v for k, v in known.items() if k != "kind"}
    for f in fields(kind):
        if f"ramp.{f.name}[{i}]" in arrays:
            values[f.name] = arrays[f"ramp.{f.name}[{i}]"]
        elif f.name == "law":
            values["law"] = analysis.cracks[known["p"]].debond.release
    ramp: ForceRamp = kind(**values)
    return ramp


_FAR = 1e-6
"""Jumps found from the saved states may differ by this fraction from the saved ones: many times
round-off, and less than any other body, mesh or load would give."""


def collect_states(solver: LinearSolver) -> Arrays:
    """The state of the interfaces and the loads they are in equilibrium with.

    Returns:
        loads, shape (n_loads,); per pair p bonded[p], shape (n_nodes,), and jump[p] and what
        :meth:`JumpSystem.state_dict` holds, shape (n_nodes, gdim); soft.* per softening
        bond;
        friction.* per contact node if there is friction.
    """
    out: Arrays = {"loads": solver.state.loads}
    fields = {"jump": solver.state.jump, **solver.system.state_dict()}
    for p, (front, index) in enumerate(zip(solver.fronts, solver.index, strict=True)):
        out[f"bonded[{p}]"] = front.bonded
        for name, values in fields.items():
            out[f"{name}[{p}]"] = np.where(index >= 0, values[np.maximum(index, 0)], 0.0)
    if solver.system.friction is not None:
        memory = FrictionMemory.of(solver.system.friction, solver.state)
        out |= {f"friction.{name}": values for name, values in memory.state_dict().items()}
        out["friction.energy"] = np.array(solver.friction_energy)
    return out | _collect_bonds(solver)


def _collect_bonds(solver: LinearSolver) -> Arrays:
    bonds = solver.system.soft.bonds
    rows = [
        (i, b.where[0], node, local)
        for i, b in enumerate(bonds)
        for node, local in zip(*b.where[1:], strict=True)
    ]
    return {
        "soft.where": np.array(rows, dtype=np.int64).reshape(-1, 4),
        "soft.direction": np.concatenate([np.zeros(0), *(b.direction for b in bonds)]),
        "soft.strength": np.array([b.strength for b in bonds], dtype=float),
        "soft.final": np.array([b.final for b in bonds], dtype=float),
        "soft.largest": np.array([np.nan if b.largest is None else b.largest for b in bonds]),
        "soft.finished": np.array(solver.system.soft.finished),
    }


def apply_bonds(solver: LinearSolver, arrays: Arrays) -> None:
    """Open what was open and let soften what softened; before the window is made."""
    pressed = []
    for p, front in enumerate(solver.fronts):
        front.release(np.flatnonzero(front.bonded & ~arrays[f"bonded[{p}]"].astype(bool)))
        if not solver.pairs[p].interface.contact:
            held = np.flatnonzero(arrays[f"contact[{p}]"].any(axis=1))
            pressed += [(p, int(node)) for node in held]
    solver.keep = [*solver.keep, *pressed]
    law = (arrays[f"soft.{name}"].astype(float) for name in ("strength", "final", "largest"))
    rows, direction = arrays["soft.where"].astype(np.int64), arrays["soft.direction"].astype(float)
    bonds = []
    for i, (strength, final, largest) in enumerate(zip(*law, strict=True)):
        mine = rows[:, 0] == i
        _, pair, nodes, local = rows[mine].T
        bonds.append(
            CohesiveBond(
                local, direction[mine], float(strength), float(final), (int(pair[0]), nodes, local),
                None if np.isnan(largest) else float(largest),
            )
        )  # fmt: skip
    solver.take_over(bonds, float(arrays["soft.finished"]))
    if "friction.where" in arrays:
        memory = FrictionMemory.from_state_dict(
            {name.split(".")[1]: v for name, v in arrays.items() if name.startswith("friction.")}
        )
        solver.take_over_friction(memory, float(arrays["friction.energy"]))


def apply_equilibrium(solver: LinearSolver, arrays: Arrays, force: Array) -> None:
    """Set contact and find the saved equilibrium again; after the window was made.

    Args:
        solver: Prepared model that went through :func:`apply_bonds`.
        arrays: From :func:`collect_states`.
        force: Given forces of bonds that let go with time, shape (n_retained,).

    Raises:
        InputError: The jumps are not those that were saved.
    """
    system, loads = solver.system, np.asarray(arrays["loads"], dtype=float)
    states = {name: np.zeros(system.n_retained) for name in system.state_dict()}
    saved = np.zeros(system.n_retained)
    for p, index in enumerate(solver.index):
        inside = index >= 0
        saved[index[inside]] = arrays[f"jump[{p}]"][inside]
        for name, values in states.items():
            values[index[inside]] = arrays[f"{name}[{p}]"][inside]
    system.load_state_dict(states)
    if system.friction is None:
        solver.state = system.linear(loads, force)
    else:
        # nothing moves, so what slips and what sticks cannot be told from the equilibrium
        before = system.friction.save()
        solver.state = system.equilibrium(loads, force)
        system.friction.restore(before)
    known = saved != 0.0
    size = np.abs(saved).max(initial=0.0)
    off = float(np.abs(solver.state.jump - saved)[known].max(initial=0.0))
    if off > _FAR * size:
        raise InputError(
            f"the checkpoint does not fit: jumps differ by {off / size:.1e} of the largest one "
            "from the equilibrium of this scene; bodies or loads are others than when it was "
            "written (a function of position, perhaps). Run without restart, or mend the scene"
        )


def collect_bodies(solver: NewtonSolver) -> Arrays:
    """Everything but what :func:`fxcrack.restart.scene_state.collect_states` holds; collective.

    Returns:
        On rank 0, bodies.* of :meth:`Bodies.state`; per pair force[p] and index[p], shape
        (n_nodes, gdim), and pairing.*[p] where faces slide far; conjugate, shape (n_loads,);
        dense.*; sums.
    """
    out: Arrays = {f"bodies.{name}": values for name, values in solver.bodies.state().items()}
    for p, index in enumerate(solver.index):
        out[f"index[{p}]"] = index
        out[f"force[{p}]"] = np.where(index >= 0, solver.state.force[np.maximum(index, 0)], 0.0)
    for p, (pair, master) in enumerate(zip(solver.pairs, solver.masters, strict=True)):
        known = {} if master is None else changing(pair, master)
        out |= {f"pairing.{name}[{p}]": values for name, values in known.items()}
    out["conjugate"] = solver.state.conjugate
    out |= {f"dense.{name}": values for name, values in solver.dense().items()}
    sums = solver.pairing_energy, solver.largest_force, solver.largest_energy, solver.drift
    out["sums"] = np.array(sums)
    return out


def apply_bodies(solver: NewtonSolver, arrays: Arrays, time: float) -> None:
    """Put displacements, terms and pairing into the saved state; before the window is made.

    Collective.

    Args:
        solver: The model of the same scene, on any number of ranks.
        arrays: From :func:`collect_bodies`.
        time: Time of the state.

    Raises:
        InputError: The mesh has its cells in another order than when the state was saved.
    """
    for p, master in enumerate(solver.masters):
        if master is not None:
            known = {name: arrays[f"pairing.{name}[{p}]"] for name in CHANGING}
            solver.pairs[p] = with_changing(solver.pairs[p], master, known)
    bodies = {k.split(".", 1)[1]: v for k, v in arrays.items() if k.startswith("bodies.")}
    solver.place({name: values.astype(float) for name, values in bodies.items()}, time)
    sums = (float(x) for x in arrays["sums"])
    solver.pairing_energy, solver.largest_force, solver.largest_energy, _ = sums


def apply_accepted(solver: NewtonSolver, arrays: Arrays) -> None:
    """Set contact, given forces and the dense system; after the window was made."""
    system = solver.system
    states = {name: np.zeros(system.n_retained) for name in system.state_dict()}
    force = np.zeros(system.n_retained)
    same = True
    for p, index in enumerate(solver.index):
        inside = index >= 0
        same = same and np.array_equal(index, arrays[f"index[{p}]"])
        force[index[inside]] = arrays[f"force[{p}]"][inside]
        for name, values in states.items():
            values[index[inside]] = arrays[f"{name}[{p}]"][inside]
    system.load_state_dict(states)
    loads, conjugate = (np.asarray(arrays[k], dtype=float) for k in ("loads", "conjugate"))
    solver.state = Equilibrium(loads, force, solver.present_jump(), conjugate)
    solver.anchor()
    if same:  # the march goes on as it would have, to round-off
        solver.take_dense(
            {name: np.asarray(arrays[f"dense.{name}"], dtype=float) for name in solver.dense()}
        )
        solver.drift = float(arrays["sums"][3])
