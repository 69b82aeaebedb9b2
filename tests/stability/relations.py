"""What a random scene must have in common with another description of itself."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import fxcrack as fx  # isort: skip  (orders MPI before DOLFINx)
import numpy as np

from fxcrack.history import Row
from stability.combinations import Combination, Described
from stability.invariants import Result, run_scene

ENERGIES = (
    *("external_work", "strain_energy", "kinetic_energy", "released_energy", "friction_energy"),
    *("plastic_energy", "snap_energy"),
)
SAME = {"linear": 1e-7, "temperature": 1e-7}
"""Part of the largest value that may differ; linear bodies."""
SAME_NEWTON = 1e-5
"""The same for nonlinear ones: an equilibrium is known to 1e-8 of the forces, an onset to 1e-6."""
RESTART = 1e-10


def difference(one: fx.History, other: fx.History, lengths: float, energies: float) -> str:
    """What differs, in words with the number first; empty where nothing can be compared to differ.

    Args:
        one: History as drawn.
        other: History in other units.
        lengths: Unit of length there.
        energies: Unit of energy there.
    """
    events = [r["event"] for r in one], [r["event"] for r in other]
    if events[0] != events[1]:
        first = next((i for i, (a, b) in enumerate(zip(*events, strict=False)) if a != b), -1)
        return f"inf events, from row {first}"
    found = [(0.0, "")]
    work = max(np.abs(one[k].astype(float)).max() for k in ENERGIES[:2]) or 1e-300
    for name in one.columns:
        kind = name.split("[")[0]
        if kind not in ("time", "a", "f", *ENERGIES):
            continue
        a, b = one[name].astype(float), other[name].astype(float)
        b = b / (energies if kind in ENERGIES else lengths if kind == "a" else 1.0)
        if not np.array_equal(np.isnan(a), np.isnan(b)):
            return f"inf {name} is missing"
        size = work if kind in ENERGIES else max(np.nanmax(np.abs(a), initial=0.0), 1.0)
        found.append((float(np.nanmax(np.abs(a - b), initial=0.0)) / size, name))
    return "{:.1e} {}".format(*max(found))


def _compared(c: Combination, base: Result, how: Described) -> str:
    other = run_scene(c, how)
    if base.history is None or other.history is None:
        return "" if base.reason[:7] == other.reason[:7] else f"inf {base.reason}, {other.reason}"
    energy = how.moduli * how.lengths ** (3 if c.solid else 2)
    return difference(base.history, other.history, how.lengths, energy)


def _rotation(c: Combination) -> tuple[tuple[float, ...], ...]:
    a, b = 0.7, 0.4
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    if c.solid:
        about_x = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
        turn = np.pad(turn, (0, 1)) + np.diag([0.0, 0.0, 1.0])
        turn = turn @ about_x
    return tuple(tuple(map(float, row)) for row in turn)


def _mirror(c: Combination) -> tuple[tuple[float, ...], ...]:
    signs = (1.0, -1.0, 1.0)[: 3 if c.solid else 2]
    return tuple(tuple(map(float, row)) for row in np.diag(signs))


def numbering(c: Combination, base: Result) -> str:
    """Other numbers of nodes and cells."""
    return _compared(c, base, Described(numbers=3))


def rotation(c: Combination, base: Result) -> str:
    """Everything turned."""
    return _compared(c, base, Described(turned=_rotation(c)))


def mirroring(c: Combination, base: Result) -> str:
    """Everything mirrored."""
    return _compared(c, base, Described(turned=_mirror(c)))


def units(c: Combination, base: Result) -> str:
    """Lengths and moduli in other units."""
    return _compared(c, base, Described(lengths=1e-3, moduli=1e10))


def exchange(c: Combination, base: Result) -> str:
    """Slaves and masters exchanged; only of faces whose nodes match and stay opposite."""
    return _compared(c, base, Described(exchanged=True))


class _Stop(Exception):
    """Stands for whatever ends a job."""


class _StopAt:
    def __init__(self, row: int) -> None:
        self._left = row

    def __call__(self, event: str, row: Row) -> None:
        self._left -= 1
        if self._left < 0:
            raise _Stop


def restart(c: Combination, base: Result) -> str:
    """Stopped at a row and resumed."""
    if base.history is None or base.reason.startswith(("refused", "energy")):
        return ""
    with TemporaryDirectory() as folder:
        checkpoint = fx.Checkpoint(Path(folder) / "state.npz", every=1)
        row = (len(base.history) * (1 + c.n)) // 9  # some row or other
        with suppress(_Stop):
            run_scene(c, observers=(_StopAt(row),), checkpoint=checkpoint)
        found = run_scene(c, checkpoint=checkpoint, restart=True)
    assert found.history is not None
    return difference(base.history, found.history, 1.0, 1.0)


def stepping(c: Combination, base: Result) -> str:
    """The first onset of event and path stepping, of increments within their tolerance."""
    times = {}
    for kind in ("event", "increment", "path"):
        other = replace(c, stepping=kind, turns=())
        result = run_scene(other)
        if result.history is None or result.reason.startswith("refused"):
            continue
        # increments have no row at onset, and release at the end of the one in which f passed 1
        names = ("release",) if kind == "increment" else ("onset", "unstable")
        times[kind] = next((float(r["time"]) for r in result.history if r["event"] in names), 2.0)
    event = times["event"]
    off = abs(times.get("path", event) - event)
    early = max(event - times.get("increment", event), 0.0)
    return f"{max(off, early) / event:.1e} onset {times}"


Relation = Callable[[Combination, Result], str]


def relations_of(c: Combination) -> list[Relation]:
    """Those that apply to a scene."""
    out: list[Relation] = [numbering, rotation, mirroring, restart]
    if c.bodies != "temperature":
        out.append(units)
    if c.matching and not c.finite:
        out.append(exchange)
    if not c.dynamic and c.bodies not in ("temperature", "plastic"):
        out.append(stepping)
    return out


def broken(c: Combination, base: Result, relation: Relation) -> list[str]:
    """The relation in words where it does not hold."""
    words = relation(c, base)
    limit = RESTART if relation is restart else SAME.get(c.bodies, SAME_NEWTON)
    off = float(words.split()[0]) if words else 0.0
    return [] if off <= limit else [f"{relation.__name__}: {words}"]
