"""What a scene and a step are made of, in plain values: a restart must find the same again.

Functions of position cannot be compared; what they give on the interfaces (bonded nodes,
toughness) is compared instead.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from fxcrack.interface.definition import Interface
from fxcrack.mesh import Mesh
from fxcrack.steps.analysis import Analysis

_SAME = 1e-9
"""Numbers closer than this fraction are the same: sums over ranks differ by round-off."""
_SHOWN = 5
_LONG = 12


def fingerprint(analysis: Analysis, step: Any, grow: list[bool]) -> dict[str, Any]:
    """Everything the history of a step depends on; collective.

    Args:
        analysis: The analysis, with its cracks.
        step: The step.
        grow: Which debonds may grow.
    """
    continuum, solver = analysis.continuum, analysis.solver
    interfaces: dict[str, Any] = {}
    for p, pair in enumerate(analysis.pairs):
        parts: dict[str, Any] = {
            **plain({f.name: getattr(pair.interface, f.name) for f in _fields(pair.interface)}),
            "nodes": plain(pair.surface.x),
            "bonded": plain(pair.bonded),
            "gap": plain(pair.gap),
        }
        if p < len(analysis.cracks):
            crack = analysis.cracks[p]
            debond = crack.debond
            parts["criterion"] = plain(debond.criterion)
            parts["toughness"] = plain(crack.evaluator.toughness)
            parts["release"] = plain(crack.law)
            parts["watch"] = plain(list(debond.watch))
            parts["grows"] = grow[p]
        interfaces[pair.title] = parts
    return {
        "mesh": _mesh(analysis.mesh),
        "order": continuum.order,
        "materials": plain(continuum.part_materials),
        "model": plain(continuum.model),
        "solver": analysis.plan.solver,
        "effects": plain(analysis.effects),
        **({"stabilise": plain(analysis.stabilise)} if analysis.stabilise is not None else {}),
        "supports": [plain(c.support) for c in solver.supports.columns]
        + [plain(c) for c in solver.supports.constraints],
        "loads": plain(solver.loads),
        "monitors": plain(solver.monitors),
        "interfaces": interfaces,
        "step": plain(step),
    }


def _mesh(mesh: Mesh) -> dict[str, Any]:
    """Numbers of cells and nodes, and where the nodes are, whatever the ranks."""
    geometry = mesh.domain.geometry
    n = geometry.index_map().size_local
    x = geometry.x[:n, : mesh.gdim]
    low = np.min(mesh.comm.allgather(x.min(axis=0, initial=np.inf)), axis=0)
    away = x - low
    total = geometry.index_map().size_global
    return {
        "name": mesh.name,
        "cells": mesh.domain.topology.index_map(mesh.tdim).size_global,
        "nodes": total,
        "corner": low.tolist(),
        "centre": (mesh.comm.allreduce(away.sum(axis=0)) / total).tolist(),
        "spread": (mesh.comm.allreduce((away**2).sum(axis=0)) / total).tolist(),
    }


def _fields(thing: Any) -> tuple[dataclasses.Field[Any], ...]:
    return dataclasses.fields(thing)


def plain(thing: Any) -> Any:
    """A value as numbers, texts, lists and dictionaries; long arrays as their digest."""
    if thing is None or isinstance(thing, bool | int | float | str):
        return thing
    if isinstance(thing, np.generic):
        return thing.item()
    if isinstance(thing, np.ndarray):
        return _array(thing)
    if isinstance(thing, Interface):
        return thing.title
    if isinstance(thing, Mapping):
        return {str(k): plain(v) for k, v in thing.items()}
    if isinstance(thing, list | tuple):
        return [plain(v) for v in thing]
    if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        values = {f.name: plain(getattr(thing, f.name)) for f in _fields(thing)}
        return {"type": type(thing).__name__, **values}
    if hasattr(thing, "stiffness"):
        return {"type": type(thing).__name__, "stiffness": plain(thing.stiffness())}
    return f"a {'function' if callable(thing) else type(thing).__name__}"


def _array(values: np.ndarray[Any, Any]) -> Any:
    if values.size <= _LONG:
        return values.tolist()
    if values.dtype.kind == "f":
        # not its bytes: positions of another rank count may differ in the last digit
        scale = float(np.abs(values).max())
        first = values.ravel()
        weights = np.linspace(1.0, 2.0, len(first))
        return {
            "shape": list(values.shape),
            "largest": scale,
            "sum": float(weights @ np.abs(first)),
        }
    digest = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()[:12]
    return {"shape": list(values.shape), "digest": digest}


def differences(before: Any, now: Any, where: str = "") -> list[str]:
    """What is not the same in two descriptions, each as "where: before, now"."""
    if isinstance(before, dict) and isinstance(now, dict):
        out = []
        for key in dict.fromkeys([*before, *now]):
            place = f"{where}.{key}" if where else str(key)
            if key not in before:
                out.append(f"{place}: was not there, is {_short(now[key])}")
            elif key not in now:
                out.append(f"{place}: was {_short(before[key])}, is not there")
            else:
                out += differences(before[key], now[key], place)
        return out
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        pairs = enumerate(zip(before, now, strict=True))
        return [d for i, (a, b) in pairs for d in differences(a, b, f"{where}[{i}]")]
    if _same(before, now):
        return []
    return [f"{where}: was {_short(before)}, is {_short(now)}"]


def _same(a: Any, b: Any) -> bool:
    numbers = isinstance(a, float | int) and isinstance(b, float | int)
    if numbers and not isinstance(a, bool) and not isinstance(b, bool):
        both_nan = a != a and b != b
        return both_nan or a == b or bool(abs(a - b) <= _SAME * max(abs(a), abs(b)))
    return bool(a == b)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def summary(found: list[str]) -> str:
    """The first differences in one sentence."""
    rest = len(found) - _SHOWN
    return "; ".join(found[:_SHOWN]) + (f"; and {rest} more" if rest > 0 else "")
