"""fxcrack: crack propagation along predefined, initially bonded interfaces, on FEniCSx."""

import importlib
import warnings
from typing import TYPE_CHECKING

from fxcrack.base import compat  # noqa: F401  # isort: skip  (orders MPI before DOLFINx)
from fxcrack.base.errors import EnergyError, FxcrackError, InputError
from fxcrack.base.log import show as show_log
from fxcrack.base.parallel import install as _install_abort
from fxcrack.base.signals import Interrupted
from fxcrack.condensation.options import CondensedOptions
from fxcrack.continuum.amplitudes import Amplitude, Integral, Ramp, SmoothStep
from fxcrack.continuum.continuum_shell import ContinuumShell
from fxcrack.continuum.couplings import Coupling, Equation
from fxcrack.continuum.face import Face
from fxcrack.continuum.generalised_plane_strain import GeneralisedPlaneStrain
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.kinematics import Axisymmetric, PlaneStrain, PlaneStress, Shell, Solid
from fxcrack.continuum.laminate import Laminate
from fxcrack.continuum.loads import (
    BodyForce,
    Displacement,
    Moment,
    Monitor,
    PointForce,
    PointMoment,
    Pressure,
    Traction,
    constant,
)
from fxcrack.continuum.materials import Isotropic, NeoHookean, Orthotropic, Plastic
from fxcrack.continuum.node_supports import Clamp, Rotation, Symmetry
from fxcrack.continuum.ply import Ply
from fxcrack.continuum.section import Section
from fxcrack.continuum.temperature import ByTemperature, Temperature
from fxcrack.criteria import (
    BK,
    VCCT,
    AmplitudeRelease,
    Blanco,
    CrackLengthVsTime,
    CrackOpening,
    Criterion,
    CriticalStress,
    CycleRates,
    Elber,
    EnhancedVCCT,
    Evaluator,
    Fatigue,
    FatigueLaw,
    KenaneBenzeggagh,
    Paris,
    ParisK,
    Power,
    ProgressiveRelease,
    RampRelease,
    Reeder,
    ReleaseLaw,
    StepRelease,
    Tabulated,
    TipEvaluator,
    Walker,
)
from fxcrack.deck.deck import Deck, read_deck
from fxcrack.deck.write import write_deck
from fxcrack.effects import FiniteStrain
from fxcrack.history import History
from fxcrack.interface.definition import Interface
from fxcrack.interface.rigid import RigidCylinder, RigidPlane, RigidSphere
from fxcrack.mesh import Mesh, Split, from_dolfinx, mesh_from_gmsh, read_mesh
from fxcrack.output.fields import FieldSeries, displacement_function, write_fields
from fxcrack.output.front_line import FrontLine, front_lines
from fxcrack.output.plies import PlyResults, ply_results
from fxcrack.output.tables import (
    BondHistory,
    bond_table,
    tip_table,
    write_releases,
    write_tip_table,
)
from fxcrack.output.usual_names import with_usual_names
from fxcrack.restart.checkpoint import Checkpoint, checkpoints
from fxcrack.scene import Debond, Scene
from fxcrack.solvers.options import NewtonOptions
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.end_conditions import CrackLength, Releases, Time
from fxcrack.steps.explicit import Explicit
from fxcrack.steps.static import Dynamic, Static

if TYPE_CHECKING:
    from fxcrack.output import plots as plots

__version__ = "0.2.0"

_FORMER_NAMES = {
    "OpeningRamp": "RampRelease",
    "Progressive": "ProgressiveRelease",
    "Step": "StepRelease",
}
"""Deprecated public names; they are removed in the next release."""


def __getattr__(name: str) -> object:
    """``plots``, which loads matplotlib, or a former spelling of a name, with a warning.

    Raises:
        AttributeError: There is no such name.
    """
    if name == "plots":
        return importlib.import_module("fxcrack.output.plots")
    if name in _FORMER_NAMES:
        new = _FORMER_NAMES[name]
        warnings.warn(
            f"fxcrack.{name} is now called fxcrack.{new}; the former name will be removed",
            DeprecationWarning,
            stacklevel=2,
        )
        return globals()[new]
    raise AttributeError(f"module 'fxcrack' has no attribute '{name}'")


_install_abort()

__all__ = [
    "BK",
    "VCCT",
    "Amplitude",
    "AmplitudeRelease",
    "Axisymmetric",
    "Blanco",
    "BodyForce",
    "BondHistory",
    "ByTemperature",
    "Checkpoint",
    "Clamp",
    "CondensedOptions",
    "ContinuumShell",
    "Coupling",
    "CrackLength",
    "CrackLengthVsTime",
    "CrackOpening",
    "Criterion",
    "CriticalStress",
    "CycleRates",
    "Cycles",
    "Debond",
    "Deck",
    "Displacement",
    "Dynamic",
    "Elber",
    "EnergyError",
    "EnhancedVCCT",
    "Equation",
    "Evaluator",
    "Explicit",
    "Face",
    "Fatigue",
    "FatigueLaw",
    "FieldSeries",
    "FiniteStrain",
    "FrontLine",
    "FxcrackError",
    "GeneralisedPlaneStrain",
    "History",
    "Inertia",
    "InputError",
    "Integral",
    "Interface",
    "Interrupted",
    "Isotropic",
    "KenaneBenzeggagh",
    "Laminate",
    "Mesh",
    "Moment",
    "Monitor",
    "NeoHookean",
    "NewtonOptions",
    "Orthotropic",
    "Paris",
    "ParisK",
    "PlaneStrain",
    "PlaneStress",
    "Plastic",
    "Ply",
    "PlyResults",
    "PointForce",
    "PointMoment",
    "Power",
    "Pressure",
    "ProgressiveRelease",
    "Ramp",
    "RampRelease",
    "Reeder",
    "ReleaseLaw",
    "Releases",
    "RigidCylinder",
    "RigidPlane",
    "RigidSphere",
    "Rotation",
    "Scene",
    "Section",
    "Shell",
    "SmoothStep",
    "Solid",
    "Split",
    "Static",
    "StepRelease",
    "Symmetry",
    "Tabulated",
    "Temperature",
    "Time",
    "TipEvaluator",
    "Traction",
    "Walker",
    "bond_table",
    "checkpoints",
    "constant",
    "displacement_function",
    "from_dolfinx",
    "front_lines",
    "mesh_from_gmsh",
    "ply_results",
    "read_deck",
    "read_mesh",
    "show_log",
    "tip_table",
    "with_usual_names",
    "write_deck",
    "write_fields",
    "write_releases",
    "write_tip_table",
]
