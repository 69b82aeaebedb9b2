"""Criteria for growth and laws of release: pure functions and frozen dataclasses on numpy arrays.

Modes and local components are always in the order (I, II, III) = (normal, growth direction, front
tangent); arrays have one row per front node.
"""

from fxcrack.criteria.blanco import Blanco
from fxcrack.criteria.crack_closure import closure_rates, energy_release_rates
from fxcrack.criteria.crack_length_vs_time import CrackLengthVsTime
from fxcrack.criteria.crack_opening import CrackOpening
from fxcrack.criteria.criterion import Criterion
from fxcrack.criteria.critical_stress import CriticalStress
from fxcrack.criteria.cycle_jump import CycleJump, cycle_jump
from fxcrack.criteria.cycle_rates import CycleRates
from fxcrack.criteria.driving_force import Elber, Walker
from fxcrack.criteria.element_cycles import element_cycles
from fxcrack.criteria.energy_release import RateCriterion
from fxcrack.criteria.evaluator import Evaluator, TipEvaluator
from fxcrack.criteria.fatigue import Fatigue
from fxcrack.criteria.fatigue_law import FatigueLaw, Regime
from fxcrack.criteria.growth_function import GrowthFunction
from fxcrack.criteria.kenane_benzeggagh import KenaneBenzeggagh
from fxcrack.criteria.mixed_mode import BK, MixedMode, Power, Reeder, clip, total
from fxcrack.criteria.paris import Paris
from fxcrack.criteria.paris_k import ParisK
from fxcrack.criteria.release_laws import (
    AmplitudeRelease,
    ProgressiveRelease,
    RampRelease,
    ReleaseLaw,
    StepRelease,
)
from fxcrack.criteria.toughness import Property, Tabulated
from fxcrack.criteria.vcct import VCCT, EnhancedVCCT

__all__ = [
    "BK",
    "VCCT",
    "AmplitudeRelease",
    "Blanco",
    "CrackLengthVsTime",
    "CrackOpening",
    "Criterion",
    "CriticalStress",
    "CycleJump",
    "CycleRates",
    "Elber",
    "EnhancedVCCT",
    "Evaluator",
    "Fatigue",
    "FatigueLaw",
    "GrowthFunction",
    "KenaneBenzeggagh",
    "MixedMode",
    "Paris",
    "ParisK",
    "Power",
    "ProgressiveRelease",
    "Property",
    "RampRelease",
    "RateCriterion",
    "Reeder",
    "Regime",
    "ReleaseLaw",
    "StepRelease",
    "Tabulated",
    "TipEvaluator",
    "Walker",
    "clip",
    "closure_rates",
    "cycle_jump",
    "element_cycles",
    "energy_release_rates",
    "total",
]
