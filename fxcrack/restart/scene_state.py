"""The state of an analysis between two increments or releases, as plain values and arrays.

Everything the rest of the history depends on: interfaces, bonds that are released with time,
records of releases, fatigue, energies, counters, and the history itself. All of it is the same on
every rank.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, get_args

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.criteria.ligaments import Ligaments
from fxcrack.restart.checkpoint import Arrays, Saved
from fxcrack.restart.growing import Cell, GrowingArray, RowTable, rows_of
from fxcrack.solvers.base import Solver
from fxcrack.steps.analysis import Analysis, EnergyBalance
from fxcrack.steps.bond_records import ReleaseRecord
from fxcrack.steps.crack import Crack
from fxcrack.steps.force_ramps import ForceRamp

_SAME = 1e-9
"""Loads are numbers of the input: they differ by round-off or by far more."""


class Packed:
    """What grows with the analysis, packed for checkpoints once.

    The history, the table of cycles, and per crack and field of its records the releases so far.
    """

    def __init__(self) -> None:
        self.rows = RowTable()
        self.cycles = RowTable()
        self.records: dict[tuple[int, str], GrowingArray] = {}


def collect(analysis: Analysis, packed: Packed) -> Saved:
    """State of an analysis; collective.

    Args:
        analysis: The analysis.
        packed: What earlier calls have packed of it, updated.
    """
    fatigue = analysis.fatigue
    arrays = analysis.solver.collect()
    for g in analysis.cracks:
        arrays |= _collect_records(g, packed)
    packed.rows.update(analysis.history.rows)
    packed.cycles.update(_Cycles(fatigue.table))
    arrays |= packed.rows.arrays("rows") | packed.cycles.arrays("cycles")
    for i, ramp in enumerate(analysis.ramps):
        arrays |= _ramp_arrays(i, ramp)
    for p in fatigue.waiting:
        arrays[f"fatigue.waiting[{p}]"] = fatigue.waiting[p]
        arrays[f"fatigue.credit[{p}]"] = fatigue.credit[p]
        arrays[f"fatigue.part[{p}]"] = fatigue.ligaments[p].part
        arrays[f"fatigue.stiffness[{p}]"] = fatigue.ligaments[p].stiffness
    about = {
        "balance": analysis.balance.asdict(),
        "ramps": [_ramp(r) for r in analysis.ramps],
        "fatigue": {
            "N": fatigue.N,
            "pairs": list(fatigue.waiting),
            "columns": list(fatigue.table),
            "table": packed.cycles.names(),
        },
        "rows": packed.rows.names(),
    }
    return Saved(about, arrays)


def apply_before_condensation(analysis: Analysis, saved: Saved) -> None:
    """Put a new analysis into a saved state, up to what needs its retained jumps."""
    about, arrays = saved.about, saved.arrays
    analysis.balance = EnergyBalance(**about["balance"])
    rows = rows_of(about["rows"], arrays, "rows")
    if not all(isinstance(row.get("event"), str) and "time" in row for row in rows):
        raise ValueError("a row of the history has no event or no time")
    analysis.history.rows[:] = rows
    analysis.ramps = [_ramp_of(analysis, i, r, arrays) for i, r in enumerate(about["ramps"])]
    analysis.solver.resume(arrays, analysis.time)
    for g in analysis.cracks:
        _apply_records(g, arrays)
    fatigue, known = analysis.fatigue, about["fatigue"]
    fatigue.N = known["N"]
    cycles = rows_of(known["table"], arrays, "cycles")
    fatigue.table = {name: [row[name] for row in cycles] for name in known["columns"]}
    for p in known["pairs"]:
        fatigue.waiting[p] = np.asarray(arrays[f"fatigue.waiting[{p}]"], dtype=bool)
        fatigue.credit[p] = np.asarray(arrays[f"fatigue.credit[{p}]"], dtype=float)
        fatigue.ligaments[p] = Ligaments.none(len(fatigue.credit[p]))
        for name in ("part", "stiffness"):
            if f"fatigue.{name}[{p}]" in arrays:  # not in files of versions without partial growth
                given = np.array(arrays[f"fatigue.{name}[{p}]"], dtype=float)
                setattr(fatigue.ligaments[p], name, given)


def apply_after_condensation(analysis: Analysis, saved: Saved) -> None:
    """Check the equilibrium of an analysis whose retained jumps are chosen.

    Raises:
        InputError: Loads or jumps are not those that were saved.
    """
    before, now = saved.arrays["loads"].astype(float), analysis.loads_at(analysis.time)
    if not np.allclose(before, now, rtol=_SAME, atol=_SAME * np.abs(before).max(initial=0.0)):
        raise InputError(
            f"the checkpoint does not fit: at time {analysis.time:g} amplitudes and load factors "
            f"were {before.tolist()}, they are {now.tolist()}. Run without restart, or correct the "
            "scene"
        )
    _check_jumps(analysis, saved.arrays)


class _Cycles(Sequence[dict[str, Cell]]):
    """The table of cycles, which has columns, as rows."""

    def __init__(self, table: dict[str, list[Cell]]) -> None:
        self._table = table

    def __len__(self) -> int:
        """Number of rows."""
        return len(next(iter(self._table.values()), []))

    def __getitem__(self, which: Any) -> Any:
        """A row, or a list of them for a slice."""
        if isinstance(which, slice):
            return [self[i] for i in range(*which.indices(len(self)))]
        return {name: column[which] for name, column in self._table.items()}


def _collect_records(growth: Crack, packed: Packed) -> Arrays:
    """One array per field of the records, first axis the releases."""
    out: Arrays = {}
    for f in fields(ReleaseRecord):
        known = packed.records.setdefault((growth.p, f.name), GrowingArray())
        for record in growth.records[len(known) :]:
            known.append(getattr(record, f.name))
        out[f"record.{f.name}[{growth.p}]"] = known.array()
    return out


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
    """Kind and plain values of a bond whose force falls; arrays and its law are kept elsewhere."""
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
            values["law"] = analysis.cracks[known["p"]].law
    ramp: ForceRamp = kind(**values)
    return ramp


_FAR = 1e-6
"""Jumps found from the saved states, and the forces they make, may differ by this fraction from the
saved ones: many times round-off, and less than any other body, mesh or load would give."""


def _check_jumps(analysis: Analysis, arrays: Arrays) -> None:
    """Compare the equilibrium that was found again with the saved one.

    Bodies of very different stiffness, or nearly incompressible ones, have soft motions in which
    round-off of another factorisation (other ranks) is large as a jump, but makes no force: only
    differences that do are those of another scene.

    Raises:
        InputError: The jumps are not those that were saved.
    """
    solver = analysis.solver
    size = off = 0.0
    apart = np.zeros(len(solver.state.jump))
    for p, index in enumerate(solver.index):
        saved = arrays[f"jump[{p}]"].astype(float)
        found = np.append(solver.state.jump, 0.0)[index]  # -1 where there is none
        known = (index >= 0) & (saved != 0.0)
        size = max(size, float(np.abs(saved).max(initial=0.0)))
        off = max(off, float(np.abs(found - saved)[known].max(initial=0.0)))
        apart[index[known]] = (found - saved)[known]
    if off <= _FAR * size:
        return
    if analysis.plan.solver == "explicit" or _makes_force(analysis.condensed, apart):
        raise InputError(
            f"the checkpoint does not fit: jumps differ by {off / size:.1e} of the largest one "
            "from the equilibrium of this scene; bodies or loads are others than when it was "
            "written (a function of position, perhaps). Run without restart, or correct the scene"
        )


def _makes_force(solver: Solver, apart: Array) -> bool:
    """Whether differences of the retained jumps, shape (n_retained,), make forces."""
    system = solver.system
    moved = np.flatnonzero(system.free & ~system.closed)
    inner = system.schur[np.ix_(moved, moved)]
    held = float(np.abs(inner @ solver.state.jump[moved]).max(initial=0.0))
    return float(np.abs(inner @ apart[moved]).max(initial=0.0)) > _FAR * held
