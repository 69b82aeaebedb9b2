"""Criteria for growth and laws of release: pure functions and frozen dataclasses on numpy arrays.

Modes and local components are always in the order (I, II, III) = (normal, growth direction, front
tangent); arrays have one row per front node.
"""

from fxcrack.criteria.closure import closure_rates
from fxcrack.criteria.cod import CrackOpening
from fxcrack.criteria.crack_length import CrackLengthVsTime
from fxcrack.criteria.critical_stress import CriticalStress
from fxcrack.criteria.enhanced import EnhancedVCCT
from fxcrack.criteria.fatigue import CycleJump, Fatigue, Paris, Regime, cycle_jump
from fxcrack.criteria.mixed_mode import BK, MixedMode, Power, Reeder, clip, total
from fxcrack.criteria.rate_criterion import RateCriterion
from fxcrack.criteria.release import (
    AmplitudeRelease,
    Progressive,
    Ramp,
    Release,
    Step,
)
from fxcrack.criteria.toughness import Property, Tabulated
from fxcrack.criteria.vcct import VCCT, energy_release_rates

__all__ = [
    "BK",
    "VCCT",
    "AmplitudeRelease",
    "CrackLengthVsTime",
    "CrackOpening",
    "CriticalStress",
    "CycleJump",
    "EnhancedVCCT",
    "Fatigue",
    "MixedMode",
    "Paris",
    "Power",
    "Progressive",
    "Property",
    "Ramp",
    "RateCriterion",
    "Reeder",
    "Regime",
    "Release",
    "Step",
    "Tabulated",
    "clip",
    "closure_rates",
    "cycle_jump",
    "energy_release_rates",
    "total",
]
