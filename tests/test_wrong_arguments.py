"""Wrong arguments by the thousand: each is refused in the project's own words, or has a meaning.

A value of a pool of wrong ones replaces one argument of a sound call, drawn with a fixed seed. What
may come out is an InputError, or nothing where the value happens to be allowed there; an exception
of Python or numpy is a failure of the test.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from wrong_calls import BOND, CALLS, ELSEWHERE, STEEL, WRONG, Awkward

import fxcrack as fx
from fxcrack import identify
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.steps.static import Static


def trouble(call: Callable[..., Any], arguments: dict[str, Any]) -> str:
    """What is wrong with the way a call ends; empty where it is refused in words, or succeeds."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # numpy warns where a number is already lost
            warnings.simplefilter("ignore", DeprecationWarning)
            call(**arguments)
    except fx.FxcrackError as error:
        return "" if len(str(error)) > 10 else f"no words: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def described(value: Any) -> str:
    return type(value).__name__ if isinstance(value, Awkward) else repr(value)


def test_a_thousand_wrong_arguments_of_constructors() -> None:
    every = [(c, given, name, w) for c, given in CALLS for name in given for w in WRONG]
    chosen = np.random.default_rng(12).permutation(len(every))[:4000]
    assert len(chosen) >= 1000
    found = []
    for i in chosen:
        call, given, name, wrong = every[i]
        problem = trouble(call, given | {name: wrong})
        if problem:
            found.append(f"{call.__qualname__}({name}={described(wrong)}): {problem}")
    assert found == []


def test_the_calls_are_sound() -> None:
    """Else every wrong argument would be refused for the wrong reason."""
    for call, given in CALLS:
        if call is fx.Displacement:
            given = given | {"z": None}
        call(**given)
    assert issubclass(fx.Dynamic, Static)


def public() -> dict[str, Any]:
    """Public names, and what they are."""
    found = {name: getattr(fx, name) for name in fx.__all__}
    return found | {f"identify.{name}": getattr(identify, name) for name in identify.__all__}


def test_nothing_public_and_no_argument_is_left_out() -> None:
    """A new class, function or argument comes with a sound call here, or with a reason."""
    tried: dict[Any, set[str]] = {}
    for call, given in [*CALLS, *OF_A_SCENE]:
        tried.setdefault(call, set()).update(given)
    tried[fx.Scene] = {"mesh", *PARTS}
    missing = {}
    for name, thing in public().items():
        if name in ELSEWHERE:
            continue
        found = set(inspect.signature(thing).parameters) - tried.get(thing, set())
        if found:
            missing[name] = sorted(found)
    assert missing == {}
    assert set(ELSEWHERE) <= set(public())


# -- scenes on a small mesh ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mesh() -> fx.Mesh:
    return dcb_2d(MPI.COMM_SELF, length=8.0, dx=2.0, ny=1)


PARTS: dict[str, Any] = {
    "materials": STEEL,
    "model": fx.PlaneStrain(),
    "supports": [
        fx.Displacement("pin_top", x=0.0, y=1.0),
        fx.Displacement("pin_bottom", x=0.0, y=-1.0),
    ],
    "loads": [],
    "debonds": [fx.Debond(BOND, fx.VCCT(GIc=0.2))],
    "bonds": [],
    "monitors": [],
    "order": 1,
    "options": None,
    "effects": [],
    "solver": None,
    "newton": None,
    "stabilise": None,
    "path": None,
}  # fmt: skip
RUN: dict[str, Any] = {
    "step": fx.Static(until=fx.Releases(1)),
    "grow": None,
    "progress": False,
    "observers": [],
    "save": None,
    "checkpoint": None,
    "restart": False,
}


def run_scene(mesh: fx.Mesh, **changes: Any) -> None:
    parts = PARTS | {k: v for k, v in changes.items() if k in PARTS}
    scene = fx.Scene(changes.get("mesh", mesh), **parts)
    try:
        scene.run(**RUN | {k: v for k, v in changes.items() if k in RUN})
    finally:
        scene.close()


@pytest.mark.quick("0")
@pytest.mark.parametrize("part", range(5))
def test_wrong_arguments_of_scenes_and_runs(
    part: int, mesh: fx.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = []
    every = [(name, wrong) for name in ("mesh", *PARTS, *RUN) for wrong in WRONG]
    for name, wrong in every[part::5]:
        if isinstance(wrong, Path) and name == "save":
            continue  # a name without an ending: refused as well, below
        problem = trouble(run_scene, {"mesh": mesh, name: wrong})
        if problem:
            found.append(f"{name}={described(wrong)}: {problem}")
    assert found == []


# -- functions of a scene and of files -------------------------------------------------------------

SCENE = object()
"""Stands for a scene that has run."""
HISTORY = object()
"""Stands for its history."""
OF_A_SCENE: list[tuple[Callable[..., Any], dict[str, Any]]] = [
    (fx.BondHistory, {"source": SCENE, "interface": "bond", "where": lambda x: x[0] > 4.0}),
    (fx.FieldSeries, {"source": SCENE, "path": "s.pvd", "events": ("start",), "every": 1}),
    (fx.bond_table, {"source": SCENE}),
    (fx.tip_table, {"source": SCENE}),
    (fx.displacement_function, {"source": SCENE}),
    (fx.front_lines, {"source": SCENE, "interface": "bond"}),
    (fx.ply_results, {"source": SCENE, "group": None}),
    (fx.with_usual_names, {"history": HISTORY}),
    (fx.write_deck, {"scene": SCENE, "steps": [fx.Static(until=fx.Time(1.0))], "path": "d.inp"}),
    (fx.write_fields, {"source": SCENE, "path": "f.pvd", "time": 1.0}),
    (fx.write_releases, {"source": SCENE, "path": "r.csv"}),
    (fx.write_tip_table, {"source": SCENE, "path": "t.csv"}),
    (fx.show_log, {"level": "warning"}),
    (identify.curve_of, {"history": HISTORY, "axes": identify.Axes("u", "R")}),
    (
        identify.linear_response,
        {"scene": SCENE, "until": fx.CrackLength(BOND, 5.0), "axes": identify.Axes("u", "R")},
    ),
    (
        identify.read_record,
        {
            "path": "record.csv", "opening": "opening", "load": "load", "crack_length": None,
            "name": "n",
        },
    ),
    (fx.read_deck, {"path": "none.inp", "comm": MPI.COMM_SELF, "order": 1}),
    (fx.read_mesh, {"path": "none.msh", "comm": MPI.COMM_SELF, "gdim": 2, "split": ()}),
    (
        fx.mesh_from_gmsh,
        {"model": "none", "comm": MPI.COMM_SELF, "gdim": 2, "split": (), "name": "n"},
    ),
    (
        fx.from_dolfinx,
        {"domain": "none", "cell_tags": None, "facet_tags": None, "names": None, "name": "n"},
    ),
]  # fmt: skip


def test_wrong_arguments_of_functions_of_a_scene(
    mesh: fx.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("record.csv").write_text("opening,load\n1,2\n2,1.5\n3,1\n")
    scene = fx.Scene(mesh, **PARTS)
    history = scene.run(fx.Static(until=fx.Releases(1)), progress=False)
    every = [(c, given, name, w) for c, given in OF_A_SCENE for name in given for w in WRONG]
    found = []
    for i in np.random.default_rng(13).permutation(len(every))[:400]:
        call, given, name, wrong = every[i]
        sound = {
            k: scene if v is SCENE else history if v is HISTORY else v for k, v in given.items()
        }
        problem = trouble(call, sound | {name: wrong})
        if problem:
            found.append(f"{call.__qualname__}({name}={described(wrong)}): {problem}")
    scene.close()
    assert found == []
