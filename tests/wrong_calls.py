"""Sound calls of the public classes and functions, and wrong values for each of their arguments.

:mod:`test_wrong_arguments` tries them, and checks that nothing public and no argument is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

import fxcrack as fx
from fxcrack import identify

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

RECORD = identify.Record([1.0, 2.0, 3.0], [2.0, 1.5, 1.0])
AXES = identify.Axes("u", "R")
CURVE = identify.Curve(np.linspace(0.0, 4.0, 5), np.linspace(3.0, 1.0, 5))
RESPONSE = identify.LinearResponse(
    np.arange(1.0, 5.0), np.arange(1.0, 5.0), np.linspace(2.0, 1.0, 4),
    np.column_stack([np.full(4, 0.2), np.zeros(4), np.zeros(4)]), np.zeros((4, 3)), np.arange(4), 4,
)  # fmt: skip

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
    (fx.NeoHookean, {"E": 1.0, "nu": 0.3, "expansion": 1e-5, "density": 1.0}),
    (
        fx.Plastic,
        {
            "E": 1.0, "nu": 0.3, "yield_stress": 1.0, "hardening": 0.0, "expansion": 1e-5,
            "density": 1.0,
        },
    ),
    (fx.ByTemperature, {"table": {0.0: STEEL}}),
    (fx.PlaneStrain, {"thickness": 1.0}),
    (fx.PlaneStress, {"thickness": 1.0}),
    (
        fx.GeneralisedPlaneStrain,
        {
            "thickness": 1.0, "strain_zz": None, "curvature_x": 0.0, "curvature_y": 0.0,
            "force_zz": 1.0, "amplitude": fx.Ramp(),
        },
    ),
    (fx.GeneralisedPlaneStrain, {"strain_zz": 0.1}),
    (fx.Amplitude, {"times": (0.0, 1.0), "values": (0.0, 1.0)}),
    (
        fx.Displacement,
        {
            "where": "top", "x": 0.0, "y": 1.0, "z": 1.0, "amplitude": fx.Ramp(), "name": "n",
        },
    ),
    (fx.Traction, {"where": "top", "value": (0.0, 1.0), "amplitude": fx.Ramp(), "name": "n"}),
    (
        fx.Pressure,
        {"where": "top", "value": 1.0, "amplitude": fx.Ramp(), "follows": False, "name": "n"},
    ),
    (fx.Pressure, {"where": "bond", "value": 1.0, "follows_crack": True}),
    (fx.BodyForce, {"value": (0.0, 1.0), "where": "b", "amplitude": fx.Ramp(), "name": "n"}),
    (fx.PointForce, {"where": "t", "value": (0.0, 1.0), "amplitude": fx.Ramp(), "name": "n"}),
    (fx.Monitor, {"where": "top", "direction": (0.0, 1.0), "name": "n", "plus": ()}),
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
            "pairing": "node-to-surface",
        },
    ),
    (fx.Interface, {"slave": "a", "master": "b", "stiffness": (1.0, 2.0, 2.0)}),
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
            "viscosity": 0.0, "reference_length": None, "mode_length": None,
        },
    ),
    (fx.VCCT, {"GIc": 0.2, "method": "domain", "rings": 2}),
    (
        fx.EnhancedVCCT,
        {
            "GIc": 0.2, "GIIc": 0.5, "GIIIc": 0.5, "mix": fx.BK(eta=1.6), "tolerance": 0.2,
            "GIc_p": 0.3, "GIIc_p": 0.6, "GIIIc_p": 0.6, "method": "vcct", "viscosity": 0.0,
            "normalisation": "tributary", "unstable_tolerance": 0.3, "reference_length": None,
            "mode_length": None,
        },
    ),
    (fx.EnhancedVCCT, {"GIc": 0.2, "GIc_p": 0.3, "method": "domain", "rings": 2}),
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
    (
        fx.Fatigue,
        {
            "GIc": 0.2, "GIIc": 0.5, "GIIIc": 0.5, "mix": fx.BK(eta=1.6), "tolerance": 0.2,
            "growth": fx.ParisK(1.0, 2.0, 7e4, 0.3), "method": "vcct", "rings": 3,
            "normalisation": "tributary", "reference_length": None, "mode_length": None,
        },
    ),
    (
        fx.ParisK,
        {
            "C": 1.0, "m": 2.0, "E": 7e4, "nu": 0.3, "state": "plane strain", "dK_th": 1.0,
            "c1": 0.0, "c2": -1.0, "r1": 0.01, "r2": 0.85, "drive": "dK",
        },
    ),
    (
        fx.Blanco,
        {
            "C_I": 1.0, "m_I": 2.0, "C_II": 1.0, "m_II": 3.0, "C_m": 2.0, "m_m": 1.0, "c1": 0.0,
            "c2": -1.0, "r1": ([0.0, 1.0], [0.1, 0.2]), "drive": fx.Walker(0.5),
            "normalised": False, "r2": 0.9,
        },
    ),
    (
        fx.KenaneBenzeggagh,
        {
            "C_I": 1.0, "m_I": 2.0, "C_II": 1.0, "m_II": 3.0, "p": 2.0, "q": 1.0,
            "normalised": False, "c1": 0.0, "c2": -1.0, "r1": 0.01, "r2": 0.9, "drive": "dK",
        },
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
            "tolerance": 0.1, "direction": (1.0, 0.0),
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
    (
        fx.Dynamic,
        {
            "until": fx.Time(1.0), "dt": 0.1, "minimum": 1e-9, "stepping": "increment",
            "initial": 0.1, "maximum": 0.1, "growth": 1.5, "cutback": 0.5, "max_cutbacks": 5,
            "max_increments": 10, "linear_scaling": None, "opening": None,
        },
    ),
    (
        fx.Explicit,
        {
            "until": fx.Time(1.0), "start": "rest", "dt": 0.1, "safety": 0.9, "rows": 20,
            "contact": "penalty", "penalty": 0.1, "mass_scale": 1.0, "operator": "auto",
            "bulk": (0.06, 1.2), "tolerance": 1e-6,
        },
    ),
    (
        fx.Cycles,
        {
            "maximum": 1.0, "ratio": 0.1, "n_max": 10.0, "until": fx.Releases(3), "change": 0.01,
            "period": None,
        },
    ),
    (fx.Cycles, {"period": (0.0, 1.0), "n_max": 10.0}),
    (fx.Cycles, {"maximum": 1.0, "minimum": 0.1, "n_max": 10.0}),
    (fx.NewtonOptions, {"tolerance": 1e-10, "max_iterations": 25, "reuse": True, "balance": 1e-5}),
    (
        fx.CondensedOptions,
        {"method": "auto", "retained_mb": 10.0, "rows": 1.0, "rtol": 1e-6, "window_mb": None},
    ),
    (fx.Checkpoint, {"path": "a.npz", "every": 3, "seconds": 1.0}),
    (fx.Split, {"surface": "s", "slave": "a", "master": "b", "toward": (0.0, 1.0)}),
    (fx.constant, {"value": 1.0}),
    (fx.SmoothStep, {"times": (0.0, 1.0), "values": (0.0, 1.0)}),
    (fx.Integral, {"of": fx.SmoothStep((0.0, 1.0), (1.0, 0.0)), "start": 0.0}),
    (fx.Clamp, {"where": "top", "name": "n", "amplitude": fx.Ramp()}),
    (fx.Symmetry, {"where": "top", "axis": "x", "name": "n", "amplitude": fx.Ramp()}),
    (
        fx.Rotation,
        {"where": "t", "x": 0.0, "y": 0.1, "z": None, "amplitude": fx.Ramp(), "name": "n"},
    ),
    (fx.Moment, {"where": "top", "value": (0.0, 1.0, 0.0), "amplitude": fx.Ramp(), "name": "n"}),
    (fx.PointMoment, {"where": "p", "value": (0.0, 1.0), "amplitude": fx.Ramp(), "name": "n"}),
    (
        fx.Coupling,
        {
            "where": "top", "point": (0.0, 0.0, 0.0), "x": 0.0, "y": 1.0, "z": None, "rx": 0.0,
            "ry": None, "rz": 0.1, "components": "xyz", "rotations": True, "mean": False,
            "amplitude": fx.Ramp(), "name": "n",
        },
    ),
    (fx.Coupling, {"where": "top", "point": (0.0, 0.0), "x": 0.0, "mean": True, "weight": 2.0}),
    (
        fx.Equation,
        {
            "terms": (("a", "x", 1.0), ("b", "x", -1.0)), "value": 0.1, "amplitude": fx.Ramp(),
            "name": "n",
        },
    ),
    (fx.Ply, {"thickness": 0.1, "angle": 30.0, "material": STEEL}),
    (fx.Laminate, {"plies": "[0/90]s", "material": STEEL, "thickness": 0.1, "frame": 30.0}),
    (fx.Laminate, {"plies": [fx.Ply(0.1, 0.0, STEEL)]}),
    (
        fx.ContinuumShell,
        {
            "section": STEEL, "bottom": "a", "top": "b", "axis": (1.0, 0.0, 0.0),
            "shear_factors": (0.8, 0.8),
        },
    ),
    (fx.Shell, {"enhanced_membrane": True}),
    (
        fx.Section,
        {
            "material": STEEL, "thickness": 1.0, "axis": (1.0, 0.0, 0.0), "offset": 0.0,
            "up": (0.0, 0.0, 1.0), "shear_factor": 0.8,
        },
    ),
    (fx.Face, {"group": "g", "side": "top"}),
    (fx.ProgressiveRelease, {"zone": 1}),
    (fx.checkpoints, {"folder": "checkpoints", "restart": False, "seconds": 60.0}),
    (
        identify.Record,
        {
            "opening": [0.0, 1.0, 2.0], "load": [0.0, 1.0, 2.0], "crack_length": [1.0, 2.0, 3.0],
            "name": "n",
        },
    ),
    (identify.Axes, {"opening": "u", "load": "R", "opening_factor": 1.0, "load_factor": 1.0}),
    (
        identify.Test,
        {"record": RECORD, "response": lambda criterion: CURVE, "axes": AXES, "deviation": 0.1},
    ),
    (
        identify.fit,
        {
            "tests": identify.Test(RECORD, RESPONSE), "criterion": lambda GIc: fx.VCCT(GIc=GIc),
            "start": {"GIc": 0.2}, "confidence": 0.9, "bounds": {"GIc": (0.1, 0.4)},
        },
    ),
]  # fmt: skip

ELSEWHERE = {
    **dict.fromkeys(
        ("EnergyError", "FxcrackError", "InputError", "Interrupted"), "an error, which users catch"
    ),
    **dict.fromkeys(
        ("Criterion", "Evaluator", "FatigueLaw", "ReleaseLaw", "TipEvaluator", "CycleRates"),
        "a base or a part of what users derive; its subclasses are tried",
    ),
    **dict.fromkeys(
        ("Deck", "FrontLine", "History", "Mesh", "PlyResults", "identify.Curve", "identify.Fit",
         "identify.LinearResponse"),
        "a result, which the package makes",
    ),
    "identify.reduction": "a module",
}  # fmt: skip
"""Public names without a sound call here, and why; functions of scenes and files are tried with a
scene."""
