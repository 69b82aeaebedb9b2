"""The state of a scene between two increments or releases, as plain values and arrays.

Everything the rest of the history depends on: interfaces (:mod:`fxcrack.solve.state`), bonds that
let go with time, records of releases, fatigue, energies, counters, and the history itself. All of
it is the same on every rank.
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, cast, get_args

import numpy as np

from fxcrack.errors import InputError
from fxcrack.output.checkpoint import Arrays, Saved
from fxcrack.solve.state import give_bonds, give_equilibrium, take_states
from fxcrack.steps.letting_go import Letting, given_forces
from fxcrack.steps.records import ReleaseRecord

if TYPE_CHECKING:
    from fxcrack.scene import Scene
    from fxcrack.solve.newton_model import NewtonModel
    from fxcrack.steps.growth import Growth

_SAME = 1e-9
"""Loads are numbers of the input: they differ by round-off or by far more."""


def take(scene: Scene, books: dict[str, Any]) -> Saved:
    """State of a scene; collective.

    Args:
        scene: The scene.
        books: Counters and energies of the step at rest.
    """
    fatigue = scene.fatigue
    arrays = take_states(scene.model)
    if not scene.model.linear:
        from fxcrack.solve.newton_state import take_bodies  # only scenes that need it pay

        arrays |= take_bodies(cast("NewtonModel", scene.model))
    for g in scene.growths:
        arrays |= _take_records(g)
    for i, ramp in enumerate(scene.ramps):
        arrays |= _ramp_arrays(i, ramp)
    for p in fatigue.waiting:
        arrays[f"fatigue.waiting[{p}]"] = fatigue.waiting[p]
        arrays[f"fatigue.credit[{p}]"] = fatigue.credit[p]
    about = {
        "books": books,
        "ramps": [_ramp(r) for r in scene.ramps],
        "fatigue": {"N": fatigue.N, "pairs": list(fatigue.waiting), "table": fatigue.table},
        "rows": scene.history.rows,
    }
    return Saved(about, arrays)


def give_before_window(scene: Scene, saved: Saved) -> None:
    """Put a new scene into a saved state, up to what needs its window."""
    about, arrays = saved.about, saved.arrays
    scene.history.rows[:] = about["rows"]
    scene.ramps[:] = [_ramp_of(scene, i, r, arrays) for i, r in enumerate(about["ramps"])]
    scene.model.keep = [(r.p, int(k)) for r in scene.ramps for k in r.nodes]
    give_bonds(scene.model, arrays)
    if not scene.model.linear:
        from fxcrack.solve.newton_state import give_bodies

        give_bodies(cast("NewtonModel", scene.model), arrays, about["books"]["time"])
    for g in scene.growths:
        _give_records(g, arrays)
    fatigue, known = scene.fatigue, about["fatigue"]
    fatigue.N = known["N"]
    fatigue.table = known["table"]
    for p in known["pairs"]:
        fatigue.waiting[p] = np.asarray(arrays[f"fatigue.waiting[{p}]"], dtype=bool)
        fatigue.credit[p] = np.asarray(arrays[f"fatigue.credit[{p}]"], dtype=float)


def give_after_window(scene: Scene, saved: Saved) -> None:
    """Put a scene whose window is made into the saved equilibrium.

    Raises:
        InputError: Loads or jumps are not those that were saved.
    """
    books = saved.about["books"]
    before, now = saved.arrays["loads"].astype(float), scene.loads_at(books["time"])
    if not np.allclose(before, now, rtol=_SAME, atol=_SAME * np.abs(before).max(initial=0.0)):
        raise InputError(
            f"the checkpoint does not fit: at time {books['time']:g} amplitudes and load factors "
            f"were {before.tolist()}, they are {now.tolist()}. Run without restart, or mend the "
            "scene"
        )
    if not scene.model.linear:
        from fxcrack.solve.newton_state import give_accepted

        give_accepted(cast("NewtonModel", scene.model), saved.arrays)
        return
    force = given_forces(scene.model, scene.ramps, books["time"], books["increment"])
    give_equilibrium(scene.model, saved.arrays, force)


def _take_records(growth: Growth) -> Arrays:
    """One array per field of the records, first axis the releases."""
    return {
        f"record.{f.name}[{growth.p}]": np.array([getattr(r, f.name) for r in growth.records])
        for f in fields(ReleaseRecord)
    }


def _give_records(growth: Growth, arrays: Arrays) -> None:
    names = [f.name for f in fields(ReleaseRecord)]
    columns = [arrays[f"record.{name}[{growth.p}]"].tolist() for name in names]
    growth.records = [ReleaseRecord(*map(_field, row)) for row in zip(*columns, strict=True)]
    growth.n_released = len(growth.records)


def _field(value: Any) -> Any:
    """A number, three of them as a tuple, or a matrix."""
    if not isinstance(value, list):
        return value
    return np.array(value) if isinstance(value[0], list) else tuple(value)


def _ramp(ramp: Letting) -> dict[str, Any]:
    """Kind and plain values of a bond that lets go; arrays and its law are kept elsewhere."""
    values = {f.name: getattr(ramp, f.name) for f in fields(ramp)}
    numbers = {k: v for k, v in values.items() if isinstance(v, bool | int | float)}
    return {"kind": type(ramp).__name__, **numbers}


def _ramp_arrays(i: int, ramp: Letting) -> Arrays:
    values = {f.name: getattr(ramp, f.name) for f in fields(ramp)}
    return {f"ramp.{k}[{i}]": v for k, v in values.items() if isinstance(v, np.ndarray)}


def _ramp_of(scene: Scene, i: int, known: dict[str, Any], arrays: Arrays) -> Letting:
    kind = next(k for k in get_args(Letting) if k.__name__ == known["kind"])
    values: dict[str, Any] = {k: v for k, v in known.items() if k != "kind"}
    for f in fields(kind):
        if f"ramp.{f.name}[{i}]" in arrays:
            values[f.name] = arrays[f"ramp.{f.name}[{i}]"]
        elif f.name == "law":
            values["law"] = scene.growths[known["p"]].debond.release
    ramp: Letting = kind(**values)
    return ramp
