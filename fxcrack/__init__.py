"""fxcrack: crack propagation along predefined, initially bonded interfaces, on FEniCSx."""

from fxcrack import compat  # isort: skip  (orders MPI before DOLFINx)
from fxcrack.abort import install as _install_abort
from fxcrack.criteria import (
    BK,
    VCCT,
    AmplitudeRelease,
    CrackLengthVsTime,
    CrackOpening,
    CriticalStress,
    EnhancedVCCT,
    Fatigue,
    Paris,
    Power,
    Progressive,
    Reeder,
    Step,
    Tabulated,
)
from fxcrack.criteria import Ramp as OpeningRamp
from fxcrack.effects import FiniteStrain
from fxcrack.errors import FxcrackError, InputError
from fxcrack.inertia import Inertia
from fxcrack.interface.pairing import Interface
from fxcrack.interrupt import Interrupted
from fxcrack.loads import (
    Amplitude,
    BodyForce,
    Displacement,
    Monitor,
    PointForce,
    Pressure,
    Ramp,
    Traction,
)
from fxcrack.materials import Isotropic, Orthotropic
from fxcrack.mesh import Mesh, Split, mesh_from_gmsh, read_mesh
from fxcrack.models import Axisymmetric, PlaneStrain, PlaneStress, Solid
from fxcrack.nonlinear_materials import NeoHookean, Plastic
from fxcrack.output import plots
from fxcrack.output.bonds import BondHistory, bond_table, write_releases
from fxcrack.output.checkpoint import Checkpoint, checkpoints
from fxcrack.output.fields import FieldSeries, displacement_function, write_fields
from fxcrack.output.history import History
from fxcrack.output.report import tip_table, write_tip_table
from fxcrack.scene import Debond, Scene
from fxcrack.solve.newton import NewtonOptions
from fxcrack.solve.options import CondensedOptions
from fxcrack.steps.fatigue import Cycles
from fxcrack.steps.static import Dynamic, Static
from fxcrack.steps.until import CrackLength, Releases, Time
from fxcrack.temperature import ByTemperature, Temperature

__version__ = "0.1.0"

_install_abort()

__all__ = [
    "BK",
    "VCCT",
    "Amplitude",
    "AmplitudeRelease",
    "Axisymmetric",
    "BodyForce",
    "BondHistory",
    "ByTemperature",
    "Checkpoint",
    "CondensedOptions",
    "CrackLength",
    "CrackLengthVsTime",
    "CrackOpening",
    "CriticalStress",
    "Cycles",
    "Debond",
    "Displacement",
    "Dynamic",
    "EnhancedVCCT",
    "Fatigue",
    "FieldSeries",
    "FiniteStrain",
    "FxcrackError",
    "History",
    "Inertia",
    "InputError",
    "Interface",
    "Interrupted",
    "Isotropic",
    "Mesh",
    "Monitor",
    "NeoHookean",
    "NewtonOptions",
    "OpeningRamp",
    "Orthotropic",
    "Paris",
    "PlaneStrain",
    "PlaneStress",
    "Plastic",
    "PointForce",
    "Power",
    "Pressure",
    "Progressive",
    "Ramp",
    "Reeder",
    "Releases",
    "Scene",
    "Solid",
    "Split",
    "Static",
    "Step",
    "Tabulated",
    "Temperature",
    "Time",
    "Traction",
    "bond_table",
    "checkpoints",
    "compat",
    "displacement_function",
    "mesh_from_gmsh",
    "plots",
    "read_mesh",
    "tip_table",
    "write_fields",
    "write_releases",
    "write_tip_table",
]
