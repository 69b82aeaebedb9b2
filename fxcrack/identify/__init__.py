"""Toughness from tests: least squares on load-opening data, and data reduction of the standards.

Imported as ``from fxcrack import identify``; it loads matplotlib and scipy's optimisation.
"""

from fxcrack.identify import reduction
from fxcrack.identify.fit import Fit, Test, fit
from fxcrack.identify.record import Record, read_record
from fxcrack.identify.response import Axes, Curve, LinearResponse, curve_of, linear_response

__all__ = [
    "Axes",
    "Curve",
    "Fit",
    "LinearResponse",
    "Record",
    "Test",
    "curve_of",
    "fit",
    "linear_response",
    "read_record",
    "reduction",
]
