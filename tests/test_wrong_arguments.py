"""Wrong arguments by the thousand: each is refused in the project's own words, or has a meaning.

A value of a pool of wrong ones replaces one argument of a sound call, drawn with a fixed seed. What
may come out is an InputError, or nothing where the value happens to be allowed there; an exception
of Python or numpy is a failure of the test.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.steps.static import Static

NAN, INF = float("nan"), float("inf")
BOND = fx.Interface("upper_face", "lower_face", bonded=lambda x: x[0] >= 3.0, name="bond")
STEEL = fx.Isotropic(70e3, 0.3)


class Awkward:
    """An object whose every use fails."""

    def __repr__(self) -> str:
        raise RuntimeError("repr")

    def __float__(self) -> float:
        raise RuntimeError("float")

    def __len__(self) -> int:
        raise RuntimeError("len")

    def __bool__(self) -> bool:
        raise RuntimeError("bool")


def fails(*arguments: Any) -> Any:
    raise KeyError("a mistake in the user's function")


WRONG: list[Any] = [
    *(None, True, False, "", "text", b"bytes", 0, -1, 1.5, 1e200, -1e300, 1e308, NAN, INF, -INF),
    *(
        10**400,
        1 + 2j,
        np.complex128(1j),
        np.float32("nan"),
        np.str_("text"),
        np.datetime64("2026-11-30"),
    ),
    *(
        [],
        (),
        {},
        set(),
        [1.0],
        [NAN],
        [1.0, 2.0],
        [[1.0, 2.0], [3.0]],
        ["a", "b"],
        [None],
        {"a": 1},
    ),
    *(np.array(3.0), np.array([]), np.arange(3), np.eye(2), np.array([1j]), np.array(["x"])),
    *(np.array([True, False]), np.array([None]), range(3), (1.0, -1.0), (0.0, 0.0, 0.0)),
    *(object(), Fraction(1, 3), float, fx.VCCT, fx.Ramp, print, fails, lambda x: "word"),
    *(lambda: 1.0, Path("file"), iter([1.0]), slice(1), Ellipsis, NotImplemented),
    *(
        STEEL,
        BOND,
        fx.Ramp(),
        fx.Time(1.0),
        fx.VCCT(GIc=0.2),
        Awkward(),
    ),
]

Call = tuple[Callable[..., Any], dict[str, Any]]
CALLS: list[Call] = [
    (fx.Isotropic, {"E": 1.0, "nu": 0.3, "expansion": 1e-5, "density": 1.0}),
    (
        fx.Orthotropic,
        {
            "E": (3.0, 1.0, 1.0), "nu": (0.3, 0.3, 0.4), "G": (1.0, 1.0, 0.5),
            "frame": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), "expansion": (0.0, 0.0, 0.0),
            "density": 1.0,
        },
    ),
    (fx.NeoHookean, {"E": 1.0, "nu": 0.3}),
    (fx.Plastic, {"E": 1.0, "nu": 0.3, "yield_stress": 1.0, "hardening": 0.0}),
    (fx.ByTemperature, {"table": {0.0: STEEL}}),
    (fx.PlaneStrain, {"thickness": 1.0}),
    (fx.PlaneStress, {"thickness": 1.0}),
    (fx.Amplitude, {"times": (0.0, 1.0), "values": (0.0, 1.0)}),
    (
        fx.Displacement,
        {
            "where": "top", "x": 0.0, "y": 1.0, "z": 1.0, "amplitude": fx.Ramp(), "name": "n",
        },
    ),
    (fx.Traction, {"where": "top", "value": (0.0, 1.0), "amplitude": fx.Ramp(), "name": "n"}),
    (fx.Pressure, {"where": "top", "value": 1.0, "follows": False, "name": "n"}),
    (fx.BodyForce, {"value": (0.0, 1.0), "where": "body", "name": "n"}),
    (fx.PointForce, {"where": "top", "value": (0.0, 1.0), "name": "n"}),
    (fx.Monitor, {"where": "top", "direction": (0.0, 1.0), "name": "n"}),
    (fx.Temperature, {"value": 1.0, "reference": 0.0, "amplitude": fx.Ramp()}),
    (fx.Temperature, {"value": [(0.0, 1.0), (1.0, 2.0)], "reference": 0.0}),
    (
        fx.Inertia,
        {
            "density": 1.0, "rho_inf": 0.8, "rayleigh": (0.0, 0.0), "lumped": False,
            "velocity": (0.0, 1.0),
        },
    ),
    (fx.Inertia, {"alpha_m": 0.0, "alpha_f": 0.1}),
    (fx.Inertia.hht, {"alpha": -0.05}),
    (
        fx.Interface,
        {
            "slave": "a", "master": "b", "bonded": None, "contact": True, "friction": 0.3,
            "normal_only": False, "tolerance": 0.1, "gap": "keep", "strict": False, "name": "n",
        },
    ),
    (fx.RigidPlane, {"point": (0.0, 1.0), "normal": (0.0, 1.0)}),
    (
        fx.RigidCylinder,
        {"point": (0.0, 1.0), "axis": (0.0, 0.0, 1.0), "radius": 1.0, "inside": False},
    ),
    (fx.RigidSphere, {"point": (0.0, 1.0, 2.0), "radius": 1.0, "inside": True}),
    (
        fx.Interface,
        {"slave": "a", "master": fx.RigidPlane((0.0, 1.0), (0.0, 1.0)), "symmetry": True},
    ),
    (
        fx.Debond,
        {
            "interface": BOND, "criterion": fx.VCCT(GIc=0.2), "release": fx.StepRelease(),
            "watch": [], "temperature": 1.0,
        },
    ),
    (
        fx.VCCT,
        {
            "GIc": 0.2, "GIIc": 0.5, "GIIIc": 0.5, "mix": fx.BK(eta=1.6), "tolerance": 0.2,
            "method": "vcct", "normalisation": "tributary", "unstable_tolerance": 0.3,
            "viscosity": 0.0,
        },
    ),
    (fx.EnhancedVCCT, {"GIc": 0.2, "GIc_p": 0.3}),
    (
        fx.Fatigue,
        {"GIc": 0.2, "paris": fx.Paris(1.0, -2.0, 1.0, 1.0), "credit": False, "partial": True},
    ),
    (
        fx.Paris,
        {
            "c1": 1.0, "c2": -2.0, "c3": 1.0, "c4": 1.0, "r1": 0.01, "r2": 0.85, "drive": "dK",
            "normalised": True,
        },
    ),
    (fx.Fatigue, {"GIc": 0.2, "growth": fx.ParisK(1.0, 2.0, 7e4, 0.3)}),
    (fx.ParisK, {"C": 1.0, "m": 2.0, "E": 7e4, "nu": 0.3, "state": "plane strain", "dK_th": 1.0}),
    (
        fx.Blanco,
        {
            "C_I": 1.0, "m_I": 2.0, "C_II": 1.0, "m_II": 3.0, "C_m": 2.0, "m_m": 1.0, "c1": 0.0,
            "c2": -1.0, "r1": ([0.0, 1.0], [0.1, 0.2]), "drive": fx.Walker(0.5),
        },
    ),
    (
        fx.KenaneBenzeggagh,
        {"C_I": 1.0, "m_I": 2.0, "C_II": 1.0, "m_II": 3.0, "p": 2.0, "q": 1.0, "normalised": False},
    ),
    (fx.Walker, {"gamma": 0.5}),
    (fx.Elber, {"a": 0.5, "b": 0.4}),
    (fx.BK, {"eta": 1.6}),
    (fx.Reeder, {"eta": 1.6}),
    (fx.Power, {"am": 1.0, "an": 1.0, "ao": 1.0}),
    (fx.Tabulated, {"temperatures": [0.0, 1.0], "values": [1.0, 2.0]}),
    (
        fx.CriticalStress,
        {
            "sigma_f": 1.0, "tau1_f": 1.0, "tau2_f": 1.0, "distance": 1.0, "tolerance": 0.1,
        },
    ),
    (fx.CrackOpening, {"critical": 1.0, "distance": 1.0, "symmetry": False, "tolerance": 0.1}),
    (fx.CrackOpening, {"critical": ([0.0, 1.0], [1.0, 2.0]), "distance": 1.0}),
    (
        fx.CrackLengthVsTime,
        {
            "times": [0.0, 1.0], "lengths": [1.0, 2.0], "reference": "r", "moving": False,
            "tolerance": 0.1,
        },
    ),
    (fx.RampRelease, {"increments": 3}),
    (fx.AmplitudeRelease, {"times": [0.0, 1.0], "fractions": [1.0, 0.0], "first_increment": 0.1}),
    (fx.Time, {"time": 1.0}),
    (fx.Releases, {"count": 3}),
    (fx.CrackLength, {"interface": BOND, "length": 3.0}),
    (
        fx.Static,
        {
            "until": fx.Time(1.0), "stepping": "increment", "initial": 0.1, "minimum": 1e-9,
            "maximum": 1.0, "growth": 1.5, "cutback": 0.5, "max_cutbacks": 5,
            "max_increments": 10, "linear_scaling": 0.9,
        },
    ),
    (fx.Static, {"until": fx.Time(1.0), "stepping": "opening", "opening": ("a", "b")}),
    (fx.Dynamic, {"until": fx.Time(1.0), "dt": 0.1, "minimum": 1e-9, "stepping": "increment"}),
    (
        fx.Cycles,
        {
            "maximum": 1.0, "ratio": 0.1, "n_max": 10.0, "until": fx.Releases(3), "change": 0.01,
        },
    ),
    (fx.Cycles, {"period": (0.0, 1.0), "n_max": 10.0}),
    (fx.NewtonOptions, {"tolerance": 1e-10, "max_iterations": 25, "reuse": True, "balance": 1e-5}),
    (fx.CondensedOptions, {"method": "auto", "retained_mb": 10.0, "rows": 1.0, "rtol": 1e-6}),
    (fx.Checkpoint, {"path": "a.npz", "every": 3, "seconds": 1.0}),
    (fx.Split, {"surface": "s", "slave": "a", "master": "b", "toward": (0.0, 1.0)}),
]  # fmt: skip


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


def test_wrong_arguments_of_scenes_and_runs(
    mesh: fx.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = []
    for name in ("mesh", *PARTS, *RUN):
        for wrong in WRONG:
            if isinstance(wrong, Path) and name == "save":
                continue  # a name without an ending: refused as well, below
            problem = trouble(run_scene, {"mesh": mesh, name: wrong})
            if problem:
                found.append(f"{name}={described(wrong)}: {problem}")
    assert found == []
