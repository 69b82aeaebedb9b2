"""Which keywords and parameters are read, which have no effect here, and which are refused.

The one table of what is known: a keyword or a parameter that does not stand in it is refused.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Kind = Literal["read", "output", "numerics", "replaced", "refused"]


@dataclass(frozen=True)
class Keyword:
    """What is known of a keyword.

    Attributes:
        kind: "read"; "output", ignored; "numerics", a control of another program's solution
            method, left out and said so; "replaced", left out in favour of what ``help`` says;
            "refused".
        parameters: Parameters that are read, squeezed.
        harmless: Parameters that change nothing here.
        help: For refused ones, what would help; for replaced ones, what is computed instead.
    """

    kind: Kind
    parameters: frozenset[str] = frozenset()
    harmless: frozenset[str] = frozenset()
    help: str = ""


def _words(text: str) -> frozenset[str]:
    return frozenset("".join(word.split()).upper() for word in text.split(",") if word.strip())


_READ = {
    # mesh, sets, surfaces
    "NODE": ("NSET, INPUT, SYSTEM", ""),
    "ELEMENT": ("TYPE, ELSET, INPUT", ""),
    "SYSTEM": ("", ""),
    "TRANSFORM": ("NSET, TYPE", ""),
    "NSET": ("NSET, GENERATE, ELSET, INSTANCE, UNSORTED", "INTERNAL, INPUT"),
    "ELSET": ("ELSET, GENERATE, INSTANCE", "INTERNAL, UNSORTED, INPUT"),
    "NGEN": ("NSET, LINE", ""),
    "NFILL": ("NSET, BIAS", ""),
    "NCOPY": ("OLD SET, NEW SET, CHANGE NUMBER, SHIFT, REFLECT, MULTIPLE", ""),
    "ELGEN": ("ELSET", ""),
    "ELCOPY": ("OLD SET, NEW SET, ELEMENT SHIFT, SHIFT NODES", ""),
    "SURFACE": ("NAME, TYPE, COMBINE, FILLET RADIUS", "INTERNAL"),
    "PART": ("NAME", ""),
    "END PART": ("", ""),
    "INSTANCE": ("NAME, PART", ""),
    "END INSTANCE": ("", ""),
    "ASSEMBLY": ("NAME", ""),
    "END ASSEMBLY": ("", ""),
    # sections, materials
    "SOLID SECTION": ("ELSET, MATERIAL, ORIENTATION", "CONTROLS"),
    "SHELL SECTION": (
        "ELSET, MATERIAL, ORIENTATION, COMPOSITE, STACK DIRECTION, POISSON, OFFSET, SYMMETRIC, "
        "SHELL THICKNESS, THICKNESS MODULUS",
        "CONTROLS, SECTION INTEGRATION, LAYUP, TEMPERATURE",
    ),
    "SHELL GENERAL SECTION": (
        "ELSET, MATERIAL, ORIENTATION, COMPOSITE, STACK DIRECTION, POISSON, OFFSET, SYMMETRIC, "
        "SHELL THICKNESS, THICKNESS MODULUS",
        "CONTROLS, LAYUP",
    ),
    "ORIENTATION": ("NAME, SYSTEM, DEFINITION", "LOCAL DIRECTIONS"),
    "DISTRIBUTION": ("NAME, LOCATION, INPUT", "TABLE"),
    "DISTRIBUTION TABLE": ("", "NAME"),
    "MATERIAL": ("NAME", "SRANGE, RTOL"),
    "ELASTIC": ("TYPE", "MODULI"),
    "PLASTIC": ("HARDENING", ""),
    "EXPANSION": ("TYPE, ZERO", ""),
    "DENSITY": ("", ""),
    "HYPERELASTIC": ("NEO HOOKE", "MODULI"),
    "DAMPING": ("ALPHA, BETA", ""),
    # interfaces
    "SURFACE INTERACTION": ("NAME, PAD THICKNESS", "TRACKING THICKNESS"),
    "FRICTION": ("ROUGH", "LAGRANGE, SLIP TOLERANCE, ELASTIC SLIP"),
    "SURFACE BEHAVIOR": ("PRESSURE-OVERCLOSURE", "AUGMENTED LAGRANGE, PENALTY, DIRECT"),
    "COHESIVE BEHAVIOR": ("TYPE, DEPENDENCIES, ELIGIBILITY, REPEATED CONTACTS", ""),
    "CONTACT": ("", "OP"),
    "CONTACT INCLUSIONS": ("ALL EXTERIOR, ALL ELEMENT BASED", ""),
    "CONTACT PROPERTY ASSIGNMENT": ("", ""),
    "CONTACT FORMULATION": ("TYPE", ""),
    "CONTACT PAIR": (
        "INTERACTION, TYPE, ADJUST, TIED, SMALL SLIDING, NO THICKNESS",
        "EXTENSION ZONE, SMOOTH, HCRIT, SLIDE DISTANCE, MINIMUM DISTANCE, CPSET, WEIGHT, OP, "
        "MECHANICAL CONSTRAINT, SUPPLEMENTARY CONSTRAINTS, TRACKING",
    ),
    "CLEARANCE": ("SLAVE, MASTER, SECONDARY, MAIN, VALUE, CPSET", ""),
    "CONTACT CLEARANCE": (
        "NAME, ADJUST, CLEARANCE, SEARCH ABOVE, SEARCH BELOW, SEARCH NSET",
        "",
    ),
    "CONTACT CLEARANCE ASSIGNMENT": ("", ""),
    "TIE": ("NAME, ADJUST, TYPE, POSITION TOLERANCE", "NO ROTATION, NO THICKNESS"),
    "COUPLING": ("CONSTRAINT NAME, REF NODE, SURFACE, INFLUENCE RADIUS", "ADJUST"),
    "KINEMATIC": ("", ""),
    "DISTRIBUTING": ("WEIGHTING METHOD", ""),
    "EQUATION": ("INPUT", ""),
    "MPC": ("INPUT", ""),
    "RIGID BODY": (
        "REF NODE, ELSET, TIE NSET, PIN NSET, NSET, ANALYTICAL SURFACE",
        "POSITION",
    ),
    "KINEMATIC COUPLING": ("REF NODE", ""),
    "INITIAL CONDITIONS": ("TYPE, NORMAL, UNBALANCED STRESS", ""),
    "NODAL ENERGY RATE": ("GENERATE, INPUT", ""),
    "AMPLITUDE": (
        "NAME, DEFINITION, TIME, VALUE, FIXED INTERVAL, BEGIN, SMOOTH, INPUT",
        "",
    ),
    # steps
    "STEP": (
        "NAME, NLGEOM, INC, AMPLITUDE, PERTURBATION",
        "EXTRAPOLATION, UNSYMM, CONVERT SDI, SOLVER",
    ),
    "END STEP": ("", ""),
    "STATIC": ("DIRECT, STABILIZE, ALLSDTOL, FACTOR, RIKS", "CONTINUE, SOLVER"),
    "VISCO": ("DIRECT, CETOL, STABILIZE, ALLSDTOL, FACTOR", "CREEP, SOLVER"),
    "DYNAMIC": (
        "ALPHA, APPLICATION, DIRECT, EXPLICIT, HAFTOL, HALFINC SCALE FACTOR, SCALE FACTOR, "
        "DIRECT USER CONTROL, ADIABATIC",
        "INITIAL, NOHAF, IMPACT, ELEMENT BY ELEMENT, FIXED TIME INCREMENTATION, SOLVER, "
        "IMPROVED DT METHOD",
    ),
    "DIRECT CYCLIC": ("FATIGUE", "CETOL, CONTINUE, DELTMX, TIME POINTS, CRITERION"),
    "FATIGUE": ("TYPE", "CETOL, DELTMX, DIRECT, TIME POINTS"),
    "BULK VISCOSITY": ("", ""),
    "FIXED MASS SCALING": ("FACTOR, DT, TYPE, ELSET", ""),
    "VARIABLE MASS SCALING": ("FACTOR, DT, TYPE, ELSET", "FREQUENCY, NUMBER INTERVAL"),
    "BOUNDARY": ("AMPLITUDE, OP, TYPE, FIXED", "LOAD CASE, REGION TYPE"),
    "CLOAD": ("AMPLITUDE, OP, FOLLOWER", "LOAD CASE, REGION TYPE"),
    "DLOAD": ("AMPLITUDE, OP, FOLLOWER", "LOAD CASE, REGION TYPE"),
    "DSLOAD": ("AMPLITUDE, OP, FOLLOWER, CONSTANT RESULTANT", "LOAD CASE, REGION TYPE"),
    "TEMPERATURE": ("AMPLITUDE, OP", ""),
    "DEBOND": (
        "SLAVE, MASTER, SECONDARY, MAIN, DEBONDING FORCE, TIME INCREMENT, FREQUENCY",
        "OUTPUT",
    ),
    "FRACTURE CRITERION": (
        "TYPE, DISTANCE, NSET, DEPENDENCIES, MIXED MODE BEHAVIOR, NODAL ENERGY RATE, SYMMETRY, "
        "TOLERANCE, UNSTABLE GROWTH TOLERANCE, VISCOSITY",
        "",
    ),
    "CONTROLS": ("TYPE, PARAMETERS, RESET, ANALYSIS", "FIELD"),
    "RESTART": ("READ", "WRITE, FREQUENCY, NUMBER INTERVAL, TIME MARKS, OVERLAY, SINGLE"),
    "INCLUDE": ("INPUT", ""),
    "PARAMETER": ("", ""),
}

_OUTPUT = (
    "HEADING, PREPRINT, PHYSICAL CONSTANTS, OUTPUT, NODE OUTPUT, MONITOR, PRINT, "
    "TIME POINTS, FILTER, FILE FORMAT, FILE OUTPUT, ELEMENT OUTPUT, CONTACT OUTPUT, ENERGY "
    "OUTPUT, INCREMENTATION OUTPUT, INTEGRATED OUTPUT, INTEGRATED OUTPUT SECTION, SURFACE "
    "OUTPUT, MODAL OUTPUT, NODE PRINT, NODE FILE, EL PRINT, EL FILE, CONTACT PRINT, CONTACT "
    "FILE, ENERGY PRINT, ENERGY FILE, SECTION PRINT, SECTION FILE, MODAL PRINT, DIAGNOSTICS, "
    "USER OUTPUT VARIABLES, CONTOUR INTEGRAL, RADIATE PRINT, NO PRINT, CONDUCTIVITY, SPECIFIC "
    "HEAT"
)
"""Headings, output requests, and material data without effect on stresses."""

_OF_OUTPUT = ("OUTPUT", "PRINT", "FILE")
"""How keywords end that ask for output, whether they stand in the table or not."""

_NUMERICS = (
    "CONTACT CONTROLS, CONTACT CONTROLS ASSIGNMENT, CONTACT STABILIZATION, SECTION CONTROLS, "
    "HOURGLASS STIFFNESS, SOLVER CONTROLS"
)

_SHEAR = "the transverse shear stiffness of shells is that of the equilibrium of their plies"
_REPLACED = {
    "TRANSVERSE SHEAR STIFFNESS": _SHEAR,
    "TRANSVERSE SHEAR": _SHEAR,
}

_SHELLS = (
    "it is not available; shells (S4R, S8R, SC8R) have *SHELL SECTION with a thickness or plies"
)
_USER = (
    "user subroutines cannot be run; use a material that fxcrack has (ELASTIC, PLASTIC, "
    "HYPERELASTIC with NEO HOOKE)"
)
_COHESIVE = (
    "cohesive zones are not available; a crack along the same interface is *DEBOND with a "
    "*FRACTURE CRITERION"
)
_GENERAL = (
    "this part of general contact is not available; name the pairs of surfaces that meet by "
    "*CONTACT INCLUSIONS (explicit dynamics) or *CONTACT PAIR"
)
_THERMAL = "heat is not computed; prescribe temperatures by *TEMPERATURE"
_PERTURBATION = "only *STATIC, *VISCO, *DYNAMIC, *DIRECT CYCLIC with FATIGUE and *FATIGUE are"

_REFUSED = {
    "NODAL THICKNESS": _SHELLS,
    "SHELL TO SOLID COUPLING": _SHELLS,
    "MEMBRANE SECTION": "membranes are not available; use solid elements",
    "BEAM SECTION": "beams are not available; use solid elements",
    "BEAM GENERAL SECTION": "beams are not available; use solid elements",
    "COHESIVE SECTION": _COHESIVE,
    "DAMAGE INITIATION": _COHESIVE,
    "DAMAGE EVOLUTION": _COHESIVE,
    "DAMAGE STABILIZATION": _COHESIVE,
    "ENRICHMENT": "cracks through elements are not available; let the crack follow surfaces",
    "ENRICHMENT ACTIVATION": "cracks through elements are not available; give surfaces",
    "USER MATERIAL": _USER,
    "DEPVAR": _USER,
    "USER DEFINED FIELD": _USER,
    "USER ELEMENT": "user elements cannot be run; use solid elements",
    "UEL PROPERTY": "user elements cannot be run; use solid elements",
    "CONTACT EXCLUSIONS": _GENERAL,
    "SURFACE PROPERTY ASSIGNMENT": _GENERAL,
    "CONTACT INITIALIZATION ASSIGNMENT": _GENERAL,
    "CONTACT INTERFERENCE": "start from surfaces that meet; interference is not available",
    "CHANGE FRICTION": "friction stays what it is; give one coefficient for all steps",
    "CONTACT DAMPING": "damping between faces is not available; give the bodies *DAMPING",
    "MODEL CHANGE": "parts and contact pairs stay in the model in all steps",
    "GAP": "gap elements are not available; use *CONTACT PAIR",
    "MASS": "point masses are not available; give the bodies their *DENSITY",
    "SPRING": "springs are not available; hold or load the bodies themselves",
    "DASHPOT": "dashpots are not available; use *DAMPING of the material",
    "CONNECTOR SECTION": "connectors are not available; hold or load the bodies themselves",
    "DISTRIBUTING COUPLING": "write *COUPLING with *DISTRIBUTING",
    "EMBEDDED ELEMENT": "embedded elements are not available; mesh them into the body",
    "PRE-TENSION SECTION": "prescribe the displacement of the bolt's end instead",
    "SUBMODEL": "prescribe the boundary's displacements by *BOUNDARY",
    "NMAP": "give the nodes in global coordinates",
    "FIELD": "field variables are not available; only *TEMPERATURE is",
    "CREEP": "creep is not available; elastic and plastic materials are",
    "VISCOELASTIC": "viscoelasticity is not available; elastic and plastic materials are",
    "RATE DEPENDENT": "plasticity does not depend on the rate here",
    "DRUCKER PRAGER": "only von Mises plasticity is available",
    "CONCRETE": "only von Mises plasticity is available",
    "POTENTIAL": "only isotropic von Mises plasticity is available",
    "CYCLIC HARDENING": "only isotropic hardening is available",
    "DEFORMATION PLASTICITY": "use *PLASTIC with a table",
    "HYPERFOAM": "neo-Hookean bodies are available: *HYPERELASTIC, NEO HOOKE",
    "INELASTIC HEAT FRACTION": _THERMAL,
    "HEAT TRANSFER": _THERMAL,
    "COUPLED TEMPERATURE-DISPLACEMENT": _THERMAL,
    "DYNAMIC TEMPERATURE-DISPLACEMENT": _THERMAL,
    "FREQUENCY": _PERTURBATION,
    "BUCKLE": _PERTURBATION,
    "STEADY STATE DYNAMICS": _PERTURBATION,
    "MODAL DYNAMIC": _PERTURBATION,
    "SOILS": _PERTURBATION,
    "LOAD CASE": "write one *STEP for each case",
    "RIGID SURFACE": "write *SURFACE, TYPE=SEGMENTS (CYLINDER, REVOLUTION) and *RIGID BODY, "
    "ANALYTICAL SURFACE",
    "SURFACE SECTION": "surface elements are not available; load element faces by *DSLOAD",
    "IMPORT": "give the model in this deck; states of other analyses are not imported",
    "COMPOSITE LAYUP": "give each ply its own elements and *SOLID SECTION",
    "IMPERFECTION": "give the nodes of the imperfect body",
}


def _squeezed(name: str) -> str:
    return "".join(name.split()).upper()


def _table() -> dict[str, Keyword]:
    found = {}
    for name in _OUTPUT.split(","):
        found[_squeezed(name)] = Keyword("output")
    for name in _NUMERICS.split(","):
        found[_squeezed(name)] = Keyword("numerics")
    for name, text in _REPLACED.items():
        found[_squeezed(name)] = Keyword("replaced", help=text)
    for name, text in _REFUSED.items():
        found[_squeezed(name)] = Keyword("refused", help=text)
    for name, (parameters, harmless) in _READ.items():
        found[_squeezed(name)] = Keyword("read", _words(parameters), _words(harmless))
    return found


KEYWORDS = _table()
"""What is known of each keyword, by its squeezed name."""

TITLES = {
    _squeezed(name): name.strip()
    for name in [*_READ, *_REPLACED, *_REFUSED, *_OUTPUT.split(","), *_NUMERICS.split(",")]
}
"""Keywords as users write them, by their squeezed names."""


def keyword_of(name: str) -> Keyword | None:
    """What is known of a keyword, ``None`` if nothing is.

    Args:
        name: Squeezed.
    """
    found = KEYWORDS.get(name)
    return Keyword("output") if found is None and name.endswith(_OF_OUTPUT) else found


def full_name(keyword: str, parameter: str) -> str:
    """A parameter's name, of which the deck may give the beginning only (at least three letters).

    Args:
        keyword: Squeezed.
        parameter: Squeezed.
    """
    known = KEYWORDS.get(keyword)
    if known is None:
        return parameter
    names: Iterable[str] = known.parameters | known.harmless
    if parameter in names or len(parameter) < 3:
        return parameter
    fitting = [name for name in names if name.startswith(parameter)]
    return fitting[0] if len(fitting) == 1 else parameter
